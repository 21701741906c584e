//! What the first rows show of the columns and of how numbers are written.

use super::lines::{Line, Lines};
use super::sort::Sort;
use crate::Options;
use crate::clock::Sample;
use crate::error::{escaped, shortened};
use crate::number::{Notation, Numbers};
use crate::words::States;

/// How many different words of a column are told.
const MOST_WORDS: usize = 5;

/// What a column holds, as far as the first rows show it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Column {
    /// Two words for off and on, and nothing else.
    pub(crate) states: Option<States>,
    /// Some words that are no numbers, if it holds nothing else.
    pub(crate) words: Vec<String>,
    /// Whether it holds something, but not one number.
    pub(crate) no_numbers: bool,
    /// Its values, as far as they may be times.
    pub(crate) sample: Sample,
}

/// The columns of some rows, how their numbers are written, and what the reader should know of that, in plain words.
pub(super) fn read(
    lines: &Lines<'_>,
    rows: &[&Line],
    options: &Options,
) -> (Vec<Column>, Numbers, Option<String>) {
    let mut found: Vec<Found> = Vec::new();
    let mut notations = Notations::default();
    lines.each_field(rows, |column, sort, field| {
        if found.len() <= column {
            found.push(Found::default());
        }
        found[column].add(sort, field);
        if sort == Sort::Number {
            notations.add(field);
        }
    });
    let (numbers, told) = notations.decided(lines.dialect.delimiter, options);
    let mut columns: Vec<Column> = found.into_iter().map(Found::column).collect();
    lines.each_field(rows, |column, sort, field| {
        let sample = &mut columns[column].sample;
        match sort {
            Sort::Number => sample.numbers.extend(numbers.value(field)),
            Sort::Date => sample.dates.push(String::from_utf8_lossy(field).into_owned()),
            _ => {}
        }
    });
    (columns, numbers, told)
}

/// What was found in the fields of a column.
#[derive(Default)]
struct Found {
    numbers: usize,
    dates: usize,
    /// Words and statuses.
    others: usize,
    states: Option<Vec<States>>,
    words: Vec<String>,
}

impl Found {
    fn add(&mut self, sort: Sort, field: &[u8]) {
        match sort {
            Sort::Missing => {}
            Sort::Status => self.others += 1,
            Sort::Date => self.dates += 1,
            Sort::Number => self.numbers += 1,
            Sort::State => {
                let known: Vec<States> = States::of(field).collect();
                match &mut self.states {
                    Some(states) => states.retain(|states| known.contains(states)),
                    none => *none = Some(known),
                }
            }
            Sort::Word => {
                self.others += 1;
                if self.words.len() <= MOST_WORDS {
                    let word = escaped(&shortened(&String::from_utf8_lossy(field)));
                    if !self.words.contains(&word) {
                        self.words.push(word);
                    }
                }
            }
        }
    }

    fn column(self) -> Column {
        let Self { numbers, dates, others, states, words } = self;
        let states = states.filter(|_| numbers + dates == 0 && words.is_empty());
        let states = states.and_then(|states| states.first().copied());
        let no_numbers = numbers == 0 && states.is_none() && others + dates > 0;
        let words = if no_numbers && dates == 0 { words } else { Vec::new() };
        Column { states, words, no_numbers, sample: Sample::default() }
    }
}

/// The notations that the numbers of a log show.
#[derive(Default)]
struct Notations {
    shown: Vec<Notation>,
    /// The first number with a comma before three digits.
    example: String,
}

impl Notations {
    fn add(&mut self, field: &[u8]) {
        if let Some(notation) = Notation::of(field).filter(|notation| !self.shown.contains(notation)) {
            self.shown.push(notation);
            if notation == Notation::OneComma {
                self.example = String::from_utf8_lossy(field).into_owned();
            }
        }
    }

    /// What a comma and a point in numbers mean, and what the reader should know of that.
    fn decided(&self, delimiter: u8, options: &Options) -> (Numbers, Option<String>) {
        let shows = |notation| self.shown.contains(&notation);
        let point = [false, true].map(|grouped| shows(Notation::Point { grouped }));
        let comma = [false, true].map(|grouped| shows(Notation::Comma { grouped }));
        let [is_point, is_comma] = [point, comma].map(|shown| shown.contains(&true));
        // With nothing but `1,234` the delimiter has to say: where it is a comma, that is no decimal sign.
        let only_one_comma =
            shows(Notation::OneComma) && !is_comma && !is_point && !shows(Notation::OnePoint);
        let decimal_comma =
            options.decimal_comma.unwrap_or(is_comma && !is_point || only_one_comma && delimiter != b',');
        let doubtful = options.decimal_comma.is_none() && only_one_comma;
        let [_, shows_groups] = if decimal_comma { comma } else { point };
        let grouped = shows_groups || options.decimal_comma == Some(false) || doubtful && !decimal_comma;
        let numbers = Numbers::new(decimal_comma, &options.missing).with(grouped, &options.values);
        let example = &self.example;
        let told = match decimal_comma {
            _ if !doubtful => None,
            true => Some(format!(
                "numbers such as {example} are read with a decimal comma; `decimal-comma`=no reads them as whole numbers"
            )),
            false => Some(format!(
                "numbers such as {example} are read as whole numbers; `decimal-comma` reads the comma as the decimal sign"
            )),
        };
        (numbers, told)
    }
}
