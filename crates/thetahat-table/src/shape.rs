//! What the first lines of a text show: what separates its fields, which line has the names, where the rows begin, and
//! how numbers are written.
//!
//! The names are the last line of words above the rows that has as many fields as they; units may stand between. What
//! is above is left out. Whatever was not certain is said in [`Head::words`], with the option that says otherwise.

mod columns;
mod delimiter;
mod head;
mod lines;
mod sort;

pub(super) use columns::Column;
pub(super) use head::Head;

use lines::Line;

use super::dialect::Dialect;
use super::number::Numbers;
use super::{Header, Options};

/// The shape of a text.
pub(super) struct Shape {
    pub(super) dialect: Dialect,
    pub(super) head: Head,
    pub(super) columns: Vec<Column>,
    /// How numbers are written.
    pub(super) numbers: Numbers,
}

impl Shape {
    /// Recognises the shape of a text, which ends with a newline.
    ///
    /// # Errors
    /// A message for a line of names that is not there.
    pub(super) fn recognise(text: &[u8], options: &Options) -> Result<Self, String> {
        let numbers =
            Numbers::new(options.decimal_comma == Some(true), &options.missing).with(true, &options.values);
        let lines = delimiter::divided(text, options, &numbers);
        let kinds = lines.kinds();
        let mut head = Head::find(&lines, &kinds, options)?;
        let mut dialect = lines.dialect;
        dialect.comment = head.comment.or(dialect.comment);
        let rows: Vec<&Line> = lines
            .lines
            .iter()
            .skip(head.rows)
            .filter(|line| !line.is_marked() || dialect.comment.is_none())
            .take_while(|line| line.sorts.len() == kinds.len() || line.fits(&kinds))
            .collect();
        let (columns, numbers, told) = columns::read(&lines, &rows, options);
        head.words.extend(told);
        Ok(Self { dialect, head, columns, numbers })
    }
}

/// Whether a text has as many whole lines as it takes to see a row: more may be yet to come.
pub(super) fn has_row(mut text: &[u8], options: &Options) -> bool {
    // What separates fields does not matter for that.
    let dialect = Dialect::new(b',', options.comment);
    let (line, wanted) = match options.header {
        Header::None => (0, options.skip_rows + 1),
        Header::Recognised => (0, options.skip_rows + 2),
        Header::Line(line) => (line, options.skip_rows + 2),
    };
    let (mut found, mut number) = (0, 1);
    while found < wanted {
        if let Some(length) = dialect.skipped_line(text) {
            text = &text[length..];
        } else if let Some(newline) = memchr::memchr(b'\n', text) {
            found += usize::from(number >= line && !(found > 0 && dialect.mark(text).is_some()));
            text = &text[newline + 1..];
        } else {
            return false;
        }
        number += 1;
    }
    true
}
