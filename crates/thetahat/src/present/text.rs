//! Documents as lines of text: no line is wider than asked for, but for one long word.

use comfy_table::{CellAlignment, ColumnConstraint, ContentArrangement, Width, presets};
use textwrap::core::display_width;
use textwrap::{Options, WordSplitter};

use super::tree::{Cell, Item, Sections, Table};
use crate::present::Layout;
use crate::text::harmless;

/// What stands where there is no figure.
const NONE: &str = "-";
/// Blanks between two columns.
const BETWEEN: usize = 2;

/// All of a document, with one line break at the end.
pub(super) fn written(document: &Sections, layout: Layout) -> String {
    let mut text = Text { lines: String::new(), layout };
    for item in document.sections.iter().flat_map(|section| &section.items) {
        match item {
            Item::Line(line) => text.line(line),
            Item::Command(command) => text.verbatim(command),
            Item::Table(table) => text.table(table),
            Item::Chart(_) => {}
        }
    }
    text.lines.truncate(text.lines.trim_end().len());
    text.lines.push('\n');
    text.lines
}

/// Breaks lines between words. A word that is too long, such as the name of a file, stays whole.
pub fn wrapped(text: &str, width: usize) -> String {
    let options = Options::new(width)
        .subsequent_indent("  ")
        .break_words(false)
        // Options begin with hyphens.
        .word_splitter(WordSplitter::NoHyphenation);
    textwrap::fill(text, options)
}

/// Lines, gathered.
struct Text {
    lines: String,
    layout: Layout,
}

impl Text {
    /// Appends sentences.
    fn line(&mut self, content: &str) {
        self.verbatim(&wrapped(&(self.layout.spelled)(content), self.layout.width));
    }

    /// Appends a line as it is, such as one to be typed.
    fn verbatim(&mut self, content: &str) {
        // Names in it come from files.
        for line in content.split('\n') {
            self.lines.push_str(&harmless(line));
            self.lines.push('\n');
        }
    }

    /// Appends a table, what its signs mean, and an empty line. What is too wide goes on below, the first column again
    /// in front.
    fn table(&mut self, table: &Table) {
        let lines = Lines::of(table);
        for (position, columns) in lines.blocks(self.layout.width).into_iter().enumerate() {
            if position > 0 {
                self.verbatim("");
            }
            for shown in lines.drawn(&columns, self.layout.width).lines() {
                self.verbatim(shown.trim_end());
            }
        }
        if table.has_unknown() {
            self.line(&format!("{NONE}: {}", table.none));
        }
        for line in &table.legend {
            self.line(line);
        }
        self.verbatim("");
    }
}

/// A table, its cells as they are written.
struct Lines<'t> {
    head: Vec<String>,
    rows: Vec<Vec<String>>,
    words: &'t [usize],
}

impl<'t> Lines<'t> {
    fn of(table: &'t Table) -> Self {
        let cell = |cell: &Cell| match cell {
            Cell::Unknown => NONE.to_owned(),
            Cell::Words(words) => harmless(words),
            Cell::Figure(value, [written, _]) => written(*value),
        };
        let row = |row: &Vec<Cell>| row.iter().map(cell).collect();
        Self {
            head: table.head.iter().map(|name| harmless(name)).collect(),
            rows: table.rows.iter().map(row).collect(),
            words: &table.words,
        }
    }

    /// The columns of each part that is not too wide. The first column, half as wide at most, is in all of them.
    fn blocks(&self, width: usize) -> Vec<Vec<usize>> {
        let cells = |column: usize| {
            std::iter::once(&self.head).chain(&self.rows).filter_map(move |row| row.get(column))
        };
        let widest = |column: usize| cells(column).map(|cell| display_width(cell)).max().unwrap_or(0);
        let first = widest(0).min(width / 2);
        let (mut blocks, mut used) = (vec![vec![0]], first);
        for column in 1..self.head.len() {
            let more = BETWEEN + widest(column);
            if used + more > width && blocks.last().is_some_and(|block| block.len() > 1) {
                blocks.push(vec![0]);
                used = first;
            }
            used += more;
            blocks.last_mut().into_iter().for_each(|block| block.push(column));
        }
        blocks
    }

    /// Some columns. What is too wide even so is broken within its cells.
    fn drawn(&self, columns: &[usize], width: usize) -> comfy_table::Table {
        let of = |row: &[String]| -> Vec<String> {
            columns.iter().map(|&column| row.get(column).cloned().unwrap_or_default()).collect()
        };
        let mut table = comfy_table::Table::new();
        table.load_style(presets::NOTHING).set_header(of(&self.head));
        table.set_content_arrangement(ContentArrangement::Dynamic);
        // The blanks after the last column do not show.
        table.set_width(u16::try_from(width + BETWEEN).unwrap_or(u16::MAX));
        for row in &self.rows {
            table.add_row(of(row));
        }
        for (column, shown) in columns.iter().zip(table.column_iter_mut()) {
            // Two blanks between columns, none before the first.
            shown.set_padding((0, BETWEEN as u16));
            if *column == 0 {
                let most = u16::try_from(width / 2 + BETWEEN).unwrap_or(u16::MAX);
                shown.set_constraint(ColumnConstraint::UpperBoundary(Width::Fixed(most)));
            }
            if !self.words.contains(column) {
                shown.set_cell_alignment(CellAlignment::Right);
            }
        }
        table
    }
}

#[cfg(test)]
mod tests {
    use super::super::tree::{Medium, columns, figure, word};
    use super::*;

    fn table() -> Table {
        let names = ["channel", "first", "second", "third"];
        let mut table = columns("Channels", names).words(&[2]).none("nothing there");
        let number = |value: Option<f64>| figure(value, |value| value.to_string());
        table.row([word("long-name"), number(Some(1.5)), word("word"), number(None)]);
        table.row([word("u"), number(Some(-12.25)), word("w"), number(Some(3.0))]);
        table
    }

    fn shown(width: usize, add: impl FnOnce(&mut Sections)) -> String {
        let mut document = Sections::new(Medium::Text);
        add(&mut document);
        super::written(&document, Layout { width, ..Layout::default() })
    }

    fn written(width: usize) -> String {
        shown(width, |document| document.table(table()))
    }

    #[test]
    fn figures_end_and_words_begin_at_one_line() {
        let shown = "channel     first  second  third\n\
                     long-name     1.5  word        -\n\
                     u          -12.25  w           3\n\
                     -: nothing there\n";
        assert_eq!(written(80), shown);
        assert_eq!(written(32), shown);
    }

    #[test]
    fn what_is_too_wide_goes_on_below() {
        let shown = "channel     first  second\n\
                     long-name     1.5  word\n\
                     u          -12.25  w\n\
                     \n\
                     channel    third\n\
                     long-name      -\n\
                     u              3\n\
                     -: nothing there\n";
        assert_eq!(written(31), shown);
        for width in 14..40 {
            assert!(written(width).lines().all(|line| display_width(line) <= width), "{width}");
        }
    }

    #[test]
    fn sentences_are_wrapped_and_what_is_typed_is_not() {
        let text = shown(20, |document| {
            document.line("warning: the clock is irregular");
            document.command("thetahat fit log.csv --time t");
        });
        assert_eq!(text, "warning: the clock\n  is irregular\nthetahat fit log.csv --time t\n");
    }
}
