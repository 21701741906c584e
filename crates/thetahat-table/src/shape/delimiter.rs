//! What separates the fields of a text.

use memchr::{memchr, memchr_iter};

use super::lines::{Line, Lines, most_frequent};
use crate::Options;
use crate::dialect::Dialect;
use crate::number::Numbers;
use crate::record::Record;

/// The delimiters that are recognised, in the order of preference between two that fit equally well: a comma
/// may be a decimal comma or part of a text, a tab hardly ever is.
const DELIMITERS: [u8; 3] = [b'\t', b';', b','];
/// How many lines say what separates fields and what the columns hold.
const MOST_LINES: usize = 1000;
/// Where most of so many lines are values, there is nothing to doubt.
const FEW_LINES: usize = 32;

/// The first lines of a text, divided by the delimiter that is given, or named in the first line, or by the one that
/// most lines have equally often. A text in which most lines have none has one column. Blanks are the delimiter where
/// they alone make values of what is between them.
pub(super) fn divided<'t>(text: &'t [u8], options: &Options, numbers: &Numbers) -> Lines<'t> {
    let (first, named) = separator(text);
    let dialect = |delimiter| Dialect::new(delimiter, options.comment);
    let read = |delimiter, most| Lines::read(text, first, dialect(delimiter), numbers, most);
    if let Some(delimiter) = options.delimiter.or(named) {
        return read(delimiter, MOST_LINES);
    }
    let (mut best, mut most) = (b';', 0);
    for delimiter in DELIMITERS {
        if delimiter == b',' && options.decimal_comma == Some(true) || Some(delimiter) == options.comment {
            continue;
        }
        let (agreeing, _) = most_frequent(counts(&text[first.0..], dialect(delimiter)));
        if agreeing > most {
            (best, most) = (delimiter, agreeing);
        }
    }
    let few = read(best, FEW_LINES);
    let may_be_one_column = best == b',' && is_one_column_of_decimal_commas(&few);
    let lines = read(best, MOST_LINES);
    if 2 * few.rows_of_values() > few.lines.len() && !may_be_one_column {
        return lines;
    }
    if may_be_one_column && is_one_column_of_decimal_commas(&lines) {
        return read(b';', MOST_LINES);
    }
    let by_blanks = read(b' ', MOST_LINES);
    let (agreeing, _) = by_blanks.width();
    if agreeing >= most && by_blanks.rows_of_values() > lines.rows_of_values() { by_blanks } else { lines }
}

/// Where a text starts after a first line that names the delimiter, as Excel writes it, and that delimiter.
fn separator(text: &[u8]) -> ((usize, u64), Option<u8>) {
    let end = memchr(b'\n', text).unwrap_or(text.len());
    match text[..end].trim_ascii_start() {
        [b's' | b'S', b'e' | b'E', b'p' | b'P', b'=', delimiter, rest @ ..]
            if rest.trim_ascii().is_empty() && end < text.len() =>
        {
            ((end + 1, 2), Some(*delimiter))
        }
        _ => ((0, 1), None),
    }
}

/// How many fields the first lines of a text have, but for comments.
fn counts(mut text: &[u8], dialect: Dialect) -> Vec<usize> {
    let mut record = Record::new(dialect.delimiter);
    let mut counts = Vec::new();
    while counts.len() < MOST_LINES {
        if let Some(length) = dialect.skipped_line(text) {
            text = &text[length..];
            continue;
        }
        let plain = memchr(b'\n', text).map(|end| &text[..end]).filter(|line| memchr(b'"', line).is_none());
        let (count, length) = match plain {
            Some(line) => (memchr_iter(dialect.delimiter, line).count() + 1, line.len() + 1),
            None => match record.read(text) {
                Some(length) => (record.len(), length),
                None => break,
            },
        };
        if dialect.mark(text).is_none() {
            counts.push(count);
        }
        text = &text[length..];
    }
    counts
}

/// Whether a name without a comma stands above whole numbers in pairs.
fn is_one_column_of_decimal_commas(lines: &Lines<'_>) -> bool {
    let Some((first, rows)) = lines.lines.split_first() else { return false };
    let halves = |line: &Line| {
        let fields = lines.fields(line);
        let [whole, decimals] = fields.as_slice() else { return false };
        decimals.iter().all(u8::is_ascii_digit)
            && whole.iter().all(|byte| byte.is_ascii_digit() || *byte == b'-')
    };
    first.sorts.len() == 1 && first.has_words() && !rows.is_empty() && rows.iter().all(halves)
}
