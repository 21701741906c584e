//! How numbers and tables are written.

use std::fmt::Write;

use comfy_table::{CellAlignment, Table, presets};
use thetahat::Root;
pub(super) use thetahat::figures::{number, short};

/// Lines, gathered.
#[derive(Debug, Default)]
pub(super) struct Text(String);

impl Text {
    pub(super) fn line(&mut self, content: &str) {
        self.0.push_str(content);
        self.0.push('\n');
    }

    /// Appends a table, the named columns to the right, and an empty line.
    pub(super) fn table(&mut self, mut table: Table, right: &[usize]) {
        for (position, column) in table.column_iter_mut().enumerate() {
            // Two blanks between columns, none before the first.
            column.set_padding((0, 2));
            if right.contains(&position) {
                column.set_cell_alignment(CellAlignment::Right);
            }
        }
        for shown in table.lines() {
            self.line(shown.trim_end());
        }
        self.line("");
    }

    /// All of it, with one line break at the end.
    pub(super) fn finish(mut self) -> String {
        self.0.truncate(self.0.trim_end().len());
        self.0.push('\n');
        self.0
    }
}

/// A table of columns with these names.
pub(super) fn columns(names: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header(names.iter().copied());
    table
}

/// Three digits.
pub(super) fn uncertainty(value: f64) -> String {
    format!("{value:.2e}")
}

pub(super) fn or_dash<T>(value: Option<T>, shown: impl FnOnce(T) -> String) -> String {
    value.map_or_else(|| "-".to_owned(), shown)
}

pub(super) fn complex(root: &Root) -> String {
    let mut text = number(root.re);
    if root.im != 0.0 {
        let sign = if root.im < 0.0 { '-' } else { '+' };
        // Writing to a string cannot fail.
        let _ = write!(text, " {sign} {}i", number(root.im.abs()));
    }
    text
}

/// The standard error of a real root; those of the real and the imaginary part of another.
pub(super) fn spread(root: &Root) -> String {
    or_dash(root.covariance, |[[re, _], [_, im]]| {
        if root.im == 0.0 {
            return uncertainty(re.sqrt());
        }
        format!("{}, {}i", uncertainty(re.sqrt()), uncertainty(im.sqrt()))
    })
}
