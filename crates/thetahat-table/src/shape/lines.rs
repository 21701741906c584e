//! The first lines of a text and what is in their fields.

use std::borrow::Cow;

use memchr::memchr_iter;

use super::sort::Sort;
use crate::blanks;
use crate::dialect::Dialect;
use crate::number::Numbers;
use crate::record::Record;

/// How many fields say what the columns hold.
const MOST_FIELDS: usize = 20_000;

/// A line that is neither blank nor a comment.
pub(super) struct Line {
    pub(super) start: usize,
    pub(super) number: u64,
    /// What is in each of its fields.
    pub(super) sorts: Vec<Sort>,
    /// The sign with which it begins if that is one of comments, although none were declared.
    pub(super) mark: Option<u8>,
}

/// Some text as lines of fields.
pub(super) struct Lines<'t> {
    pub(super) text: Cow<'t, [u8]>,
    pub(super) dialect: Dialect,
    pub(super) lines: Vec<Line>,
}

impl<'t> Lines<'t> {
    /// The first lines of a text from `start` on, which is on line `number`, `most` of them.
    pub(super) fn read(
        text: &'t [u8],
        (start, number): (usize, u64),
        dialect: Dialect,
        numbers: &Numbers,
        most: usize,
    ) -> Self {
        let text = if dialect.blanks { Cow::Owned(blanks::separated(text)) } else { Cow::Borrowed(text) };
        let mut record = Record::new(dialect.delimiter);
        let (mut position, mut number, mut lines, mut fields) = (start, number, Vec::new(), 0);
        while lines.len() < most && fields < MOST_FIELDS {
            let rest = &text[position..];
            if let Some(length) = dialect.skipped_line(rest) {
                (position, number) = (position + length, number + 1);
                continue;
            }
            let Some(length) = record.read(rest) else { break };
            let sorts: Vec<Sort> = (0..record.len())
                .map(|field| Sort::of(dialect.trimmed(record.field(field)), numbers))
                .collect();
            fields += sorts.len();
            lines.push(Line { start: position, number, sorts, mark: dialect.mark(rest) });
            number += memchr_iter(b'\n', &rest[..length]).count() as u64;
            position += length;
        }
        Self { text, dialect, lines }
    }

    /// The fields of a line.
    pub(super) fn fields(&self, line: &Line) -> Vec<Vec<u8>> {
        let mut fields = Vec::with_capacity(line.sorts.len());
        self.each_field(&[line], |_, _, field| fields.push(field.to_vec()));
        fields
    }

    /// Goes over the fields of some lines: the column of each, what it is, and its content.
    pub(super) fn each_field(&self, lines: &[&Line], mut take: impl FnMut(usize, Sort, &[u8])) {
        let mut record = Record::new(self.dialect.delimiter);
        for line in lines {
            record.read(&self.text[line.start..]);
            for (column, sort) in line.sorts.iter().enumerate() {
                take(column, *sort, self.dialect.trimmed(record.field(column)));
            }
        }
    }

    /// The most frequent number of fields, unless that is one, and how many lines have it.
    pub(super) fn width(&self) -> (usize, usize) {
        let own = self.lines.iter().filter(|line| !line.is_marked());
        most_frequent(own.map(|line| line.sorts.len()).collect())
    }

    /// How many lines have nothing in their fields that is a word.
    pub(super) fn rows_of_values(&self) -> usize {
        let values = |line: &&Line| line.sorts.len() > 1 && !line.sorts.contains(&Sort::Word);
        self.lines.iter().filter(values).count()
    }

    /// What most fields of each column are: a number or a date, a state, or anything.
    pub(super) fn kinds(&self) -> Vec<Option<Sort>> {
        let (_, width) = self.width();
        let rows: Vec<&Line> =
            self.lines.iter().filter(|line| !line.is_marked() && line.sorts.len() == width).collect();
        // Names, units and titles are at the beginning.
        let rows = &rows[rows.len() / 2..];
        let kind = |column: usize| {
            let count =
                |wanted: fn(Sort) -> bool| rows.iter().filter(|line| wanted(line.sorts[column])).count();
            let numbers = count(Sort::is_value);
            let states = count(|sort| sort == Sort::State);
            let words = count(|sort| sort == Sort::Word);
            match numbers.max(states).max(words) {
                0 => None,
                most if most == numbers => Some(Sort::Number),
                most if most == states => Some(Sort::State),
                _ => None,
            }
        };
        (0..width).map(kind).collect()
    }
}

impl Line {
    pub(super) fn is_marked(&self) -> bool {
        self.mark.is_some()
    }

    /// Whether it can be a row of columns of these kinds.
    pub(super) fn fits(&self, kinds: &[Option<Sort>]) -> bool {
        let extra = self.sorts.get(kinds.len()).is_none_or(|last| matches!(last, Sort::Word | Sort::Missing));
        let as_long = self.sorts.len() == kinds.len() || self.sorts.len() == kinds.len() + 1 && extra;
        let alike = |(sort, kind): (&Sort, &Option<Sort>)| match kind {
            _ if sort.is_missing() => true,
            Some(Sort::State) => *sort == Sort::State,
            Some(_) => sort.is_value(),
            None => true,
        };
        !self.is_marked() && as_long && self.sorts.iter().zip(kinds).all(alike)
    }

    /// Whether it has words and no numbers.
    pub(super) fn has_words(&self) -> bool {
        self.sorts.iter().any(|sort| !sort.is_missing()) && !self.sorts.iter().any(|sort| sort.is_value())
    }
}

/// The most frequent number of fields, unless that is one, and how many lines have it.
pub(super) fn most_frequent(mut counts: Vec<usize>) -> (usize, usize) {
    counts.sort_unstable();
    let runs = counts.chunk_by(|a, b| a == b).map(|run| (run.len(), run[0]));
    match runs.max() {
        Some((lines, count)) if count > 1 => (lines, count),
        _ => (0, 1),
    }
}
