//! A document as sections of sentences, tables and charts. Each is made once; `text` and `html` draw it.

use super::charts::{Chart, Drawn};
use crate::figures;

/// Where a document is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Medium {
    /// In a terminal, without charts.
    Text,
    /// In a browser.
    Page,
}

/// Sections in the order in which they are read.
#[derive(Debug)]
pub(super) struct Sections {
    pub(super) medium: Medium,
    pub(super) sections: Vec<Section>,
}

/// A part of a document. Pages show its title; one without a title is their lead.
#[derive(Debug)]
pub(super) struct Section {
    pub(super) title: String,
    pub(super) items: Vec<Item>,
}

/// What sections are made of.
#[derive(Debug)]
pub(super) enum Item {
    /// A sentence or more. Text has an empty line where there is none.
    Line(String),
    /// What can be typed.
    Command(String),
    Table(Table),
    Chart(Chart),
}

impl Sections {
    pub(super) fn new(medium: Medium) -> Self {
        Self { medium, sections: Vec::new() }
    }

    /// What follows is a section of its own.
    pub(super) fn section(&mut self, title: impl Into<String>) {
        self.sections.push(Section { title: title.into(), items: Vec::new() });
    }

    fn push(&mut self, item: Item) {
        match self.sections.last_mut() {
            Some(section) => section.items.push(item),
            None => self.sections.push(Section { title: String::new(), items: vec![item] }),
        }
    }

    pub(super) fn line(&mut self, line: impl Into<String>) {
        self.push(Item::Line(line.into()));
    }

    /// An empty line of text.
    pub(super) fn gap(&mut self) {
        self.line("");
    }

    pub(super) fn command(&mut self, command: &str) {
        self.push(Item::Command(command.to_owned()));
    }

    /// Appends a table with those of its columns that this medium shows.
    pub(super) fn table(&mut self, table: Table) {
        let medium = self.medium;
        self.push(Item::Table(table.on(medium)));
    }

    /// Appends a chart, or the sentence that says why there is none, where charts are shown.
    pub(super) fn chart(&mut self, draw: impl FnOnce() -> Drawn) {
        if self.is_page() {
            match draw() {
                Ok(chart) => self.push(Item::Chart(chart)),
                Err(reason) => self.line(reason),
            }
        }
    }

    pub(super) fn is_page(&self) -> bool {
        self.medium == Medium::Page
    }
}

/// A table with a heading for each column. The first cell of a row names it.
#[derive(Debug)]
pub(super) struct Table {
    /// What it shows, on pages.
    pub(super) caption: String,
    pub(super) head: Vec<String>,
    pub(super) rows: Vec<Vec<Cell>>,
    /// The columns of words, which begin at one line; figures end at one.
    pub(super) words: Vec<usize>,
    /// Why there is no figure where there is none.
    pub(super) none: &'static str,
    /// What else needs a warning.
    pub(super) legend: Vec<String>,
    /// Columns that one medium shows, or none.
    only: Vec<(Option<Medium>, usize)>,
}

/// A table of columns with these names: words in the first one, and figures in the others.
pub(super) fn columns<N: ToString>(caption: impl Into<String>, names: impl IntoIterator<Item = N>) -> Table {
    Table {
        caption: caption.into(),
        head: names.into_iter().map(|name| name.to_string()).collect(),
        rows: Vec::new(),
        words: vec![0],
        none: "not known",
        legend: Vec::new(),
        only: Vec::new(),
    }
}

impl Table {
    /// The same with words in some further columns.
    pub(super) fn words(mut self, columns: &[usize]) -> Self {
        self.words.extend(columns);
        self
    }

    /// The same with some columns on pages only.
    pub(super) fn on_pages(mut self, columns: &[usize]) -> Self {
        self.only.extend(columns.iter().map(|column| (Some(Medium::Page), *column)));
        self
    }

    /// The same with some columns in text only.
    pub(super) fn in_text(mut self, columns: &[usize]) -> Self {
        self.only.extend(columns.iter().map(|column| (Some(Medium::Text), *column)));
        self
    }

    /// The same without some columns.
    pub(super) fn without(mut self, columns: &[usize]) -> Self {
        self.only.extend(columns.iter().map(|column| (None, *column)));
        self
    }

    /// Says why there is no figure where there is none.
    pub(super) fn none(mut self, why: &'static str) -> Self {
        self.none = why;
        self
    }

    /// A line below the table.
    pub(super) fn legend(&mut self, line: impl Into<String>) {
        self.legend.push(line.into());
    }

    pub(super) fn row(&mut self, cells: impl IntoIterator<Item = Cell>) {
        self.rows.push(cells.into_iter().collect());
    }

    /// Whether some figure is not there.
    pub(super) fn has_unknown(&self) -> bool {
        self.rows.iter().flatten().any(|cell| matches!(cell, Cell::Unknown))
    }

    /// The same with the columns that a medium shows.
    fn on(mut self, medium: Medium) -> Self {
        let kept: Vec<usize> = (0..self.head.len())
            .filter(|column| self.only.iter().all(|(only, other)| other != column || *only == Some(medium)))
            .collect();
        let of = |row: &[Cell]| kept.iter().filter_map(|&column| row.get(column)).cloned().collect();
        self.rows = self.rows.iter().map(|row| of(row)).collect();
        self.head = kept.iter().map(|&column| self.head[column].clone()).collect();
        self.words = (0..kept.len()).filter(|place| self.words.contains(&kept[*place])).collect();
        self
    }
}

/// What stands in a table.
#[derive(Debug, Clone)]
pub(super) enum Cell {
    /// There is no figure; the table says why.
    Unknown,
    Words(String),
    /// A number, and how it is written in text and on pages.
    Figure(f64, [fn(f64) -> String; 2]),
}

/// A word, a name or a count.
pub(super) fn word(word: impl ToString) -> Cell {
    Cell::Words(word.to_string())
}

/// A number and how it is written, where it is known.
pub(super) fn figure(value: impl Into<Option<f64>>, written: fn(f64) -> String) -> Cell {
    self::written(value, [written; 2])
}

/// The same where a page writes it otherwise.
pub(super) fn written(value: impl Into<Option<f64>>, written: [fn(f64) -> String; 2]) -> Cell {
    value.into().map_or(Cell::Unknown, |value| Cell::Figure(value, written))
}

/// A standard error: where figures end at one line each has its power of ten.
pub(super) fn error(value: impl Into<Option<f64>>) -> Cell {
    written(value, [figures::error, figures::three])
}

/// What is said of a value, where it is known.
pub(super) fn known<T>(value: Option<T>, said: impl FnOnce(T) -> String) -> Cell {
    value.map_or(Cell::Unknown, |value| Cell::Words(said(value)))
}
