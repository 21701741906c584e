//! How sentences and tables are written: no line is wider than asked for, but for one long word.

use crate::figures::error;
use crate::model::Root;
use crate::text::harmless;
use comfy_table::{CellAlignment, ColumnConstraint, ContentArrangement, Width, presets};
use textwrap::core::display_width;
use textwrap::{Options, WordSplitter};

use crate::present::Layout;

/// What stands where there is no figure.
const NONE: &str = "-";
/// Blanks between two columns.
const BETWEEN: usize = 2;

/// Lines, gathered.
#[derive(Debug)]
pub(super) struct Text {
    lines: String,
    layout: Layout,
}

impl Text {
    pub(super) fn new(layout: Layout) -> Self {
        Self { lines: String::new(), layout }
    }

    /// Appends sentences.
    pub(super) fn line(&mut self, content: &str) {
        self.verbatim(&wrapped(&(self.layout.spelled)(content), self.layout.width));
    }

    /// Appends a line as it is, such as one to be typed.
    pub(super) fn verbatim(&mut self, content: &str) {
        // Names in it come from files.
        for line in content.split('\n') {
            self.lines.push_str(&harmless(line));
            self.lines.push('\n');
        }
    }

    /// Appends a table, what its signs mean, and an empty line. What is too wide goes on below, the first column again
    /// in front.
    pub(super) fn table(&mut self, table: Table) {
        for (position, columns) in table.blocks(self.layout.width).into_iter().enumerate() {
            if position > 0 {
                self.verbatim("");
            }
            for shown in table.drawn(&columns, self.layout.width).lines() {
                self.verbatim(shown.trim_end());
            }
        }
        if table.rows.iter().flatten().any(|cell| cell == NONE) {
            self.line(&format!("{NONE}: {}", table.none));
        }
        for line in &table.legend {
            self.line(line);
        }
        self.verbatim("");
    }

    /// All of it, with one line break at the end.
    pub(super) fn finish(mut self) -> String {
        self.lines.truncate(self.lines.trim_end().len());
        self.lines.push('\n');
        self.lines
    }
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

/// A table with a heading for each column.
#[derive(Debug)]
pub(super) struct Table {
    head: Vec<String>,
    rows: Vec<Vec<String>>,
    /// The columns of words, which begin at one line; figures end at one.
    words: Vec<usize>,
    /// Why there is no figure where there is none.
    none: &'static str,
    /// What else needs a warning.
    legend: Vec<String>,
}

/// A table of columns with these names: words in the first one, and figures in the others.
pub(super) fn columns(names: &[&str]) -> Table {
    Table {
        head: names.iter().map(|name| harmless(name)).collect(),
        rows: Vec::new(),
        words: vec![0],
        none: "not known",
        legend: Vec::new(),
    }
}

impl Table {
    /// The same with words in some further columns.
    pub(super) fn words(mut self, columns: &[usize]) -> Self {
        self.words.extend(columns);
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

    pub(super) fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().map(|cell| harmless(&cell)).collect());
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

pub(super) fn or_dash<T>(value: Option<T>, shown: impl FnOnce(T) -> String) -> String {
    value.map_or_else(|| NONE.to_owned(), shown)
}

/// Some of a list that may be long.
pub(super) fn some<T: ToString>(all: &[T], most: usize, separator: &str) -> String {
    let shown: Vec<String> = all.iter().take(most).map(ToString::to_string).collect();
    let more = match all.len().saturating_sub(most) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    format!("{}{more}", shown.join(separator))
}

/// The standard error of a real root; those of the real and the imaginary part of another.
pub(super) fn spread(root: &Root) -> String {
    or_dash(root.covariance, |[[re, _], [_, im]]| {
        if root.im == 0.0 {
            return error(re.sqrt());
        }
        format!("{}, {}i", error(re.sqrt()), error(im.sqrt()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let mut table = columns(&["channel", "first", "second", "third"]).words(&[2]).none("nothing there");
        table.row(["long-name", "1.5", "word", "-"].map(str::to_owned));
        table.row(["u", "-12.25", "w", "3"].map(str::to_owned));
        table
    }

    fn written(width: usize) -> String {
        let mut text = Text::new(Layout { width, ..Layout::default() });
        text.table(table());
        text.finish()
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
        let mut text = Text::new(Layout { width: 20, ..Layout::default() });
        text.line("warning: the clock is irregular");
        text.verbatim("thetahat fit log.csv --time t");
        assert_eq!(text.finish(), "warning: the clock\n  is irregular\nthetahat fit log.csv --time t\n");
    }

    #[test]
    fn long_lists_are_cut() {
        assert_eq!(some(&[1, 2, 3], 3, ","), "1,2,3");
        assert_eq!(some(&[1, 2, 3, 4], 2, ","), "1,2 and 2 more");
    }
}
