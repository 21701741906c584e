//! A page as a document: sections of sentences, tables and charts.

use askama::Template;
use plotly::Plot;

use super::figure::{Chart, Drawn};
use super::text;
use crate::Error;

/// A page before it is written. All of its text is escaped when it is.
#[derive(Template)]
#[template(path = "page.html")]
pub(super) struct Page<'a> {
    pub(super) title: String,
    /// Below the title: sentences, the first as the headline.
    pub(super) lead: Vec<String>,
    pub(super) warnings: &'a [String],
    pub(super) sections: Vec<Section>,
    /// The command that made the page.
    pub(super) command: &'a str,
    /// The program and version that made it.
    pub(super) generator: &'a str,
    style: &'static str,
    script: &'static str,
    library: String,
}

/// A part of a page with a heading.
#[derive(Default)]
pub(super) struct Section {
    pub(super) title: String,
    pub(super) blocks: Vec<Block>,
}

/// What sections are made of.
pub(super) enum Block {
    /// A sentence or more.
    Text(String),
    /// What can be typed.
    Command(String),
    Table(Table),
    Chart(Chart),
}

/// A table with a heading for each column. The first cell of a row names it.
pub(super) struct Table {
    pub(super) caption: String,
    pub(super) head: Vec<String>,
    pub(super) rows: Vec<Vec<String>>,
    /// The columns that hold figures: they end at one line.
    figures: Vec<bool>,
}

impl Table {
    pub(super) fn new(caption: impl Into<String>, head: &[&str]) -> Self {
        Self {
            caption: caption.into(),
            head: head.iter().map(|name| (*name).to_owned()).collect(),
            rows: Vec::new(),
            figures: Vec::new(),
        }
    }

    fn is_figures(&self, column: &usize) -> bool {
        self.figures.get(*column).is_some_and(|figures| *figures)
    }

    /// The same with rows for columns.
    pub(super) fn turned(self) -> Self {
        let lines: Vec<&Vec<String>> = std::iter::once(&self.head).chain(&self.rows).collect();
        let column = |k: usize| lines.iter().filter_map(|line| line.get(k)).cloned().collect();
        let rows = (1..self.head.len()).map(column).collect();
        Self { head: column(0), rows, caption: self.caption, figures: Vec::new() }
    }

    pub(super) fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }
}

impl Section {
    pub(super) fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), blocks: Vec::new() }
    }

    pub(super) fn text(&mut self, text: impl Into<String>) {
        self.blocks.push(Block::Text(text.into()));
    }

    /// Adds a table, if it has rows.
    pub(super) fn table(&mut self, mut table: Table) {
        let figure = |text: &String| {
            let is_word = |c: char| c.is_alphabetic() && !matches!(c, 'e' | 'i');
            text.is_empty()
                || (text.starts_with(|first: char| "–±<-0123456789".contains(first))
                    && !text.contains(is_word))
        };
        let column = |k: usize| k > 0 && table.rows.iter().filter_map(|row| row.get(k)).all(figure);
        table.figures = (0..table.head.len()).map(column).collect();
        if table.rows.iter().flatten().any(|cell| cell == text::NONE) {
            table.caption = format!("{} ({}: not known)", table.caption, text::NONE);
        }
        if !table.rows.is_empty() {
            self.blocks.push(Block::Table(table));
        }
    }

    /// Adds a chart, or why there is none.
    pub(super) fn chart(&mut self, drawn: Drawn) {
        self.blocks.push(match drawn {
            Ok(chart) => Block::Chart(chart),
            Err(reason) => Block::Text(reason),
        });
    }
}

impl<'a> Page<'a> {
    pub(super) fn new(title: String, command: &'a str, generator: &'a str) -> Result<Self, Error> {
        Ok(Self {
            title,
            lead: Vec::new(),
            warnings: &[],
            sections: Vec::new(),
            command,
            generator,
            style: include_str!("style.css"),
            script: include_str!("page.js"),
            library: library()?,
        })
    }

    /// The page as HTML.
    pub(super) fn write(&self) -> Result<String, Error> {
        self.render().map_err(|error| Error::report(format!("the page cannot be written: {error}")))
    }
}

/// The charting library alone: the crate brings it as the first script element, and one for formulas behind it.
fn library() -> Result<String, Error> {
    let mut sources = Plot::offline_js_sources();
    let start = sources.find("<script").and_then(|tag| Some(tag + sources[tag..].find('>')? + 1));
    let script = start.and_then(|start| Some(start..start + sources[start..].find("</script")?));
    match script {
        Some(script) if sources[script.clone()].contains("plotly.js") => {
            sources.truncate(script.end);
            sources.drain(..script.start);
            Ok(sources)
        }
        _ => Err(Error::report("the charting library is not where it was; this is a mistake of the program")),
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_library_is_taken_alone() {
        let library = super::library().unwrap();
        assert!(library.trim_start().starts_with("/**\n* plotly.js v"));
        assert!(library.trim_end().ends_with("return Plotly;\n}));"), "{}", &library[library.len() - 80..]);
        assert!(library.len() < 4_700_000 && !library.contains("</script") && !library.contains("<!--"));
    }
}
