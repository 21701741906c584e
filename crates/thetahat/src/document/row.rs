use std::fmt;

use serde::{Deserialize, Serialize};

/// What a document says in one line of a table: named cells, each name once, in their order.
///
/// ```
/// use thetahat::{Cell, Row};
///
/// let mut row = Row::default();
/// row.text("model", "ARX(1, 1, 1)");
/// row.number("a1", -0.5);
/// row.number("a1_error", f64::NAN); // no number, no cell
/// assert_eq!(row.get("a1"), Some(&Cell::Number(-0.5)));
/// assert_eq!(row.cells().len(), 2);
/// ```
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Row(Vec<(String, Cell)>);

/// One value of a table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Cell {
    /// Yes or no.
    Flag(bool),
    /// How many.
    Count(u64),
    /// A finite number.
    Number(f64),
    /// Words.
    Text(String),
}

impl Row {
    /// Adds a cell. A name that is taken gets an underscore at its end: a parameter may be called as a figure is.
    pub fn add(&mut self, name: &str, cell: Cell) {
        let mut name = name.to_owned();
        while self.get(&name).is_some() {
            name.push('_');
        }
        self.0.push((name, cell));
    }

    /// Adds a number, unless it is none.
    pub fn number(&mut self, name: &str, number: impl Into<Option<f64>>) {
        if let Some(number) = number.into().filter(|number| number.is_finite()) {
            self.add(name, Cell::Number(number));
        }
    }

    /// Adds a count.
    pub fn count(&mut self, name: &str, count: usize) {
        self.add(name, Cell::Count(count as u64));
    }

    /// Adds words.
    pub fn text(&mut self, name: &str, text: impl Into<String>) {
        self.add(name, Cell::Text(text.into()));
    }

    /// The cells with their names.
    pub fn cells(&self) -> &[(String, Cell)] {
        &self.0
    }

    /// The cell of a name.
    pub fn get(&self, name: &str) -> Option<&Cell> {
        self.0.iter().find(|(own, _)| own == name).map(|(_, cell)| cell)
    }

    /// The names of all cells of some rows: each once, after the name that stands before it in the first row that has
    /// it.
    ///
    /// ```
    /// use thetahat::Row;
    ///
    /// let row = |names: &[&str]| {
    ///     let mut row = Row::default();
    ///     names.iter().for_each(|name| row.count(name, 1));
    ///     row
    /// };
    /// let rows = [row(&["log", "a1", "b1"]), row(&["log", "a1", "a2", "b1"])];
    /// assert_eq!(Row::names(&rows), ["log", "a1", "a2", "b1"]);
    /// ```
    pub fn names<'r>(rows: impl IntoIterator<Item = &'r Row>) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for row in rows {
            let mut place = 0;
            for (name, _) in &row.0 {
                place = match names.iter().position(|known| known == name) {
                    Some(known) => known + 1,
                    None => {
                        names.insert(place, name.clone());
                        place + 1
                    }
                };
            }
        }
        names
    }
}

/// As a table of text has it: numbers with as many digits as tell them from all others.
impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Flag(flag) => flag.fmt(f),
            Self::Count(count) => count.fmt(f),
            // Exponents where they are shorter.
            Self::Number(number) if *number != 0.0 && !(1e-5..1e16).contains(&number.abs()) => {
                write!(f, "{number:e}")
            }
            Self::Number(number) => number.fmt(f),
            Self::Text(text) => text.fmt(f),
        }
    }
}
