//! What is known of a table before its rows are read.

use super::clock::{self, Recognised};
use super::dialect::Dialect;
use super::error::{Error, Position, escaped, quoted, shortened};
use super::number::starts_with_number;
use super::record::Record;
use super::shape::Column;
use super::words::States;
use super::{ClockColumns, Options};

/// The file, its columns, and how its lines divide into fields.
pub(super) struct Layout {
    /// The file's name, for messages.
    pub(super) file: String,
    /// What separates fields.
    pub(super) dialect: Dialect,
    /// The columns' names; their number is the number of fields in each row.
    pub(super) names: Vec<String>,
    /// Whether what follows the last of these fields, such as a comment, is left out.
    pub(super) is_open: bool,
    /// What each column holds, and in which unit, where that is known.
    pub(super) columns: Vec<Column>,
    pub(super) units: Vec<String>,
}

/// A row that [`Record`] has read, and where it came from.
pub(super) struct Row<'a> {
    /// Its fields.
    pub(super) record: &'a Record,
    /// Its text, from the start of its first line to the newline after the last.
    pub(super) text: &'a [u8],
    /// The number of its first line.
    pub(super) line: u64,
}

impl Row<'_> {
    /// Where the content of a field starts; the end of the row if there are not so many.
    fn position_of(&self, field: usize, dialect: Dialect) -> Position {
        let start = self.record.start_of(field, self.text);
        let blanks = self.text[start..].iter().take_while(|&&byte| dialect.is_blank(byte)).count();
        let offset = if self.record.len() > field { start + blanks } else { start };
        Position::within(self.text, offset, self.line)
    }
}

impl Layout {
    /// The number of fields in each row.
    pub(super) fn width(&self) -> usize {
        self.names.len()
    }

    /// The two words of a column that holds nothing else.
    pub(super) fn states(&self, column: usize) -> Option<States> {
        self.columns.get(column)?.states
    }

    /// How the times of a column are written, as its name, its unit and its first values show it. None where they do
    /// not.
    ///
    /// # Errors
    /// A message for dates that can be read in two ways.
    pub(super) fn times(&self, column: usize, options: &Options) -> Result<Option<Recognised>, String> {
        match (self.names.get(column), self.columns.get(column)) {
            (Some(name), Some(own)) => clock::recognise(name, self.unit(column), &own.sample, options),
            _ => Ok(None),
        }
    }

    fn unit(&self, column: usize) -> Option<&str> {
        self.units.get(column).map(String::as_str)
    }

    /// The columns that are clocks by their names and their first values; a column of days goes with the times of day
    /// beside it.
    pub(super) fn clocks(&self) -> Vec<ClockColumns> {
        let sample = |column: usize| self.columns.get(column).map(|own| &own.sample);
        let is_day = |column| sample(column).is_some_and(clock::are_days);
        let is_time_of_day = |column| sample(column).is_some_and(clock::are_times_of_day);
        let mut found: Vec<ClockColumns> = (1..self.width())
            .flat_map(|column| [(column - 1, column), (column, column - 1)])
            .filter(|&(date, time)| is_day(date) && is_time_of_day(time))
            .map(|(date, time)| ClockColumns { time, date: Some(date) })
            .collect();
        let is_clock = |column: usize| {
            let name = &self.names[column];
            let first = column == 0 && self.width() > 1;
            sample(column).is_some_and(|own| clock::is_clock(name, self.unit(column), own, first))
        };
        let of_pairs: Vec<usize> =
            found.iter().flat_map(|pair| [Some(pair.time), pair.date]).flatten().collect();
        let alone = (0..self.width()).filter(|&column| !of_pairs.contains(&column) && is_clock(column));
        found.extend(alone.map(|time| ClockColumns { time, date: None }));
        found
    }

    /// The columns that are called as clocks are, or hold dates, whether they are clocks or not.
    pub(super) fn called_clocks(&self) -> Vec<usize> {
        let is_called = |column: &usize| {
            let own = self.columns.get(*column);
            own.is_some_and(|own| {
                clock::is_called_clock(&self.names[*column], self.unit(*column), &own.sample)
            })
        };
        (0..self.width()).filter(is_called).collect()
    }

    /// A column as messages call it.
    pub(super) fn column(&self, index: usize) -> String {
        match self.names.get(index) {
            Some(name) if !name.is_empty() => format!("column '{}'", escaped(&shortened(name))),
            _ => format!("column {}", index + 1),
        }
    }

    /// What the reader should know of the file, in plain words.
    pub(super) fn told(&self, words: &str) -> String {
        format!("{}: {words}", escaped(&self.file))
    }

    /// An error at a field.
    pub(super) fn fault(&self, row: &Row<'_>, field: usize, message: &str) -> Error {
        let position = row.position_of(field, self.dialect);
        Error::data(&self.file, position, format!("{}: {message}", self.column(field)))
    }

    /// An error at a field of the first row; a word there may be a unit.
    pub(super) fn first_fault(&self, row: &Row<'_>, field: usize, message: &str) -> Error {
        let content = self.dialect.trimmed(row.record.field(field));
        if starts_with_number(content) {
            return self.fault(row, field, message);
        }
        let words = self.columns.get(field).map_or(&[][..], |column| &column.words);
        let message = match words {
            [first, _, ..] => format!(
                "this column holds words ({}), not numbers; say what each stands for (`value` {first}=0), or leave the column \
                 out",
                words.join(", ")
            ),
            _ => format!("{message}; if this row holds units, leave it out with `skip-rows`"),
        };
        self.fault(row, field, &message)
    }

    /// The error for a row with the wrong number of fields.
    pub(super) fn ragged(&self, row: &Row<'_>) -> Error {
        let (found, width) = (row.record.len(), self.width());
        let first = self.names.first().map_or("", String::as_str);
        let advice = if self.dialect.delimiter == b',' && found == 2 * width {
            if width == 1 {
                "if it has a decimal comma, say `decimal-comma`"
            } else {
                "if it has decimal commas, separate its fields by semicolons and say `decimal-comma`"
            }
        } else if matches!(row.text.trim_ascii_start().first(), Some(b'#' | b'%' | b'/' | b'!' | b'*')) {
            "if this line is a comment, say `comment` and its first character"
        } else if first.starts_with(['#', '%', '/']) && width < found {
            "if the first line is a comment, say `comment` and its first character"
        } else if found > width && row.record.field(found - 1).trim_ascii().is_empty() {
            "take the delimiter at its end away, or name one column more"
        } else if found > width {
            "take a field away, or quote the one that holds a delimiter"
        } else {
            "add what is missing, if only the delimiters"
        };
        self.uneven(row, advice)
    }

    /// The error for a last row without a line break and with too few fields.
    pub(super) fn cut(&self, row: &Row<'_>) -> Error {
        self.uneven(
            row,
            "this is the last line and has no line break: it was probably cut; delete this line, or add what is missing",
        )
    }

    fn uneven(&self, row: &Row<'_>, advice: &str) -> Error {
        let (found, width) = (row.record.len(), self.width());
        let message = format!(
            "this row has {}, but there {} {} ({} separates them); {advice}",
            counted(found, "field"),
            if width == 1 { "is" } else { "are" },
            counted(width, "column"),
            match self.dialect.blanks {
                true => "a run of blanks".to_owned(),
                false => quoted(&[self.dialect.delimiter]),
            },
        );
        Error::data(&self.file, row.position_of(found.min(width), self.dialect), message)
    }

    /// The error for a text (`the file`, `its line`) that ends inside quotes; the row is as much of it as there is.
    pub(super) fn unclosed(&self, row: &Row<'_>, text: &str) -> Error {
        let position = row.position_of(row.record.len(), self.dialect);
        let message = format!("this quote is not closed before the end of {text}; close it, or take it away");
        Error::data(&self.file, position, message)
    }

    /// The error for a row that is longer than `limit` bytes.
    pub(super) fn too_long(&self, line: u64, limit: usize) -> Error {
        let message = format!(
            "this row is longer than {limit} bytes: either this is no text table, or a quote is not closed; \
             name a text file, or close the quote"
        );
        Error::data(&self.file, Position { line, column: 1 }, message)
    }

    /// The error for a table that takes more memory than there is; it was read up to `line`.
    pub(super) fn too_large(&self, line: u64, words: &str) -> Error {
        Error::memory(&self.file, Position { line, column: 1 }, words)
    }

    /// The error for a text that ends on `line` without a row of data.
    pub(super) fn no_rows(&self, line: u64) -> Error {
        let message = if self.names.is_empty() {
            "there is no row, only blank lines and comments; record at least one row"
        } else {
            "there are no data rows below the header; record at least one"
        };
        Error::data(&self.file, Position { line, column: 1 }, message)
    }
}

/// A number and the noun that goes with it.
fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}
