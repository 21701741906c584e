//! From text to columns of numbers.
//!
//! Two readers share the work. The fast one takes the rows that it understands at first sight and stops in
//! front of the first one that it does not: a row with a quote, or with a mistake. The careful one, built on
//! [`Record`], knows all the rules and explains mistakes; it goes on from there to the end of the text.
//!
//! The fast one never gets past a quote, so every newline before the place where it stops ends a row.
//! Therefore a text may be cut at newlines into pieces that are read at the same time: what counts is the
//! pieces up to the first stop. Neither the table nor an error depends on where the cuts are, or on the
//! number of threads.

use std::sync::atomic::{AtomicBool, Ordering};

use memchr::{memchr, memchr_iter, memchr3};
use rayon::prelude::*;

use super::decimal;
use super::error::{Error, quoted};
use super::layout::{Layout, Row};
use super::lines::Lines;
use super::number::Numbers;
use super::record::Record;
use super::time::{Calendar, Clock, Times};
use super::words::{self, States, Tally};
use super::{Selection, Table};

/// What to read from each row.
pub(super) struct Plan {
    /// The columns there are.
    pub(super) layout: Layout,
    /// How numbers are written.
    pub(super) numbers: Numbers,
    /// How times are written.
    pub(super) times: Times,
    /// The fields to read, in ascending order.
    pub(super) fields: Vec<usize>,
    /// The one of them that is the time.
    pub(super) time: Option<usize>,
    /// Whether there was a status in place of a number.
    pub(super) has_statuses: AtomicBool,
}

/// The rows of a table, by columns.
#[derive(Default)]
pub(super) struct Rows {
    /// The values of each field in the plan; those after the last row are room for more.
    columns: Vec<Vec<f64>>,
    /// The lines of the rows.
    lines: Lines,
    /// The number of rows.
    pub(super) count: usize,
    /// The number of the line after the last one read.
    pub(super) line: u64,
    /// Whether there were rows before these, in a part that was given away.
    later: bool,
}

impl Rows {
    /// No rows yet, with the next one on `line`.
    pub(super) fn new(columns: usize, line: u64) -> Self {
        Self { columns: vec![Vec::new(); columns], line, ..Self::default() }
    }

    /// No rows yet, with the next one after these.
    pub(super) fn after(&self) -> Self {
        Self { later: self.has_any(), ..Self::new(self.columns.len(), self.line) }
    }

    /// Whether there was a row, here or before.
    pub(super) fn has_any(&self) -> bool {
        self.count > 0 || self.later
    }

    /// Adds a row that takes this many lines.
    fn push(&mut self, values: &[f64], lines: u64) {
        for (column, &value) in self.columns.iter_mut().zip(values) {
            column[self.count] = value;
        }
        self.lines.push(self.count, self.line);
        self.count += 1;
        self.line += lines;
    }

    /// Makes room for `more` rows; in all there will be about `total`.
    ///
    /// Growing by doubling would hold half as much again as the table needs.
    fn make_room(&mut self, more: usize, total: usize) {
        let needed = self.count + more;
        let total = total.max(needed);
        for column in &mut self.columns {
            if column.len() < needed {
                // Only an estimate: without the memory for it the table may still fit.
                let _ = column.try_reserve_exact(total - column.len());
                column.resize(needed, 0.0);
            }
        }
    }

    /// The room for `more` rows after the last one, of each column.
    fn room(&mut self, more: usize) -> Vec<&mut [f64]> {
        let rows = self.count..self.count + more;
        self.columns.iter_mut().map(|column| &mut column[rows.clone()]).collect()
    }

    /// Adds rows that were written into the room from `start` on.
    fn append(&mut self, start: usize, piece: &Read) {
        if start > self.count {
            for column in &mut self.columns {
                column.copy_within(start..start + piece.rows, self.count);
            }
        }
        self.lines.append(&piece.lines, self.count, self.line);
        self.count += piece.rows;
        self.line += piece.line;
    }
}

/// A piece of a text, and where its rows go.
struct Piece<'a> {
    text: &'a [u8],
    /// As many values of each column as there are lines.
    columns: Vec<&'a mut [f64]>,
}

/// What was read of a piece.
#[derive(Default)]
struct Read {
    /// The length of its text.
    length: usize,
    rows: usize,
    /// Their lines, counted from zero, and the one after the last.
    lines: Lines,
    line: u64,
}

impl Plan {
    /// Nothing is read yet.
    pub(super) fn new(layout: Layout, numbers: Numbers) -> Self {
        let has_statuses = AtomicBool::new(false);
        Self { layout, numbers, times: Times::default(), fields: Vec::new(), time: None, has_statuses }
    }

    /// The place of a field among those that are read.
    pub(super) fn place(&self, field: usize) -> usize {
        self.fields.binary_search(&field).unwrap_or_default()
    }

    /// Makes a table of the rows, its columns in the order of the selection.
    pub(super) fn table(&self, mut rows: Rows, selection: &Selection, tallies: &mut [Tally]) -> Table {
        rows.columns.iter_mut().for_each(|column| column.truncate(rows.count));
        self.count(&mut rows.columns, tallies);
        let mut take =
            |field: &usize| rows.columns.get_mut(self.place(*field)).map(std::mem::take).unwrap_or_default();
        Table {
            columns: selection.columns.iter().map(&mut take).collect(),
            time: selection.time.as_ref().map(|time| {
                let mut times = take(time);
                if let Some(date) = &selection.date {
                    times.iter_mut().zip(take(date)).for_each(|(time, day)| *time += day);
                }
                times
            }),
            start: self.times.start.clone(),
            calendar: Calendar::None,
            clocks: Vec::new(),
            rows: rows.count,
            lines: rows.lines,
            words: Vec::new(),
        }
    }

    /// Reads the rows of a text that starts with a row and ends with a newline, in pieces of about `piece_size` bytes.
    /// The text is about this `share` of all there is from the first row on, with what was read before; none if nobody
    /// knows.
    ///
    /// Returns how much of the text was read: all of it, unless a quoted field goes on after it. `unended` is whether
    /// the log ends with this text, and without a line break: a last row with too few fields was cut.
    pub(super) fn read(
        &self,
        text: &[u8],
        unended: bool,
        piece_size: usize,
        share: Option<f64>,
        record: &mut Record,
        rows: &mut Rows,
    ) -> Result<usize, Error> {
        let texts = pieces(text, piece_size);
        // No row is shorter than a line.
        let counts: Vec<usize> = texts.par_iter().map(|text| memchr_iter(b'\n', text).count()).collect();
        let most = counts.iter().sum();
        let total = share.map_or(0, |share| ((rows.count + most) as f64 / share * 1.01) as usize);
        rows.make_room(most, total);
        let mut room = rows.room(most);
        let mut cut = |count: usize| {
            room.iter_mut().map(|room| room.split_off_mut(..count).unwrap_or_default()).collect()
        };
        let pieces: Vec<Piece<'_>> =
            texts.iter().zip(&counts).map(|(text, &count)| Piece { text, columns: cut(count) }).collect();
        let read: Vec<Read> = pieces.into_par_iter().map(|piece| self.read_fast(piece)).collect();
        let (mut taken, mut start) = (0, rows.count);
        for ((text, count), read) in texts.iter().zip(counts).zip(read) {
            rows.append(start, &read);
            start += count;
            taken += read.length;
            if read.length < text.len() {
                break;
            }
        }
        Ok(taken + self.read_carefully(&text[taken..], unended, record, rows)?)
    }

    /// Reads rows up to the first that needs care.
    fn read_fast(&self, piece: Piece<'_>) -> Read {
        let Piece { text, mut columns } = piece;
        let mut read = Read::default();
        while read.length < text.len() {
            let rest = &text[read.length..];
            if let Some(length) = self.layout.dialect.skipped_line(rest) {
                read.length += length;
            } else if let Some(length) =
                self.row(rest, columns.iter_mut().filter_map(|column| column.get_mut(read.rows)))
            {
                read.lines.push(read.rows, read.line);
                read.rows += 1;
                read.length += length;
            } else {
                break;
            }
            read.line += 1;
        }
        read
    }

    /// Reads the row at the front of a text into `values`, one for each field, and returns its length, unless it needs
    /// care.
    pub(super) fn row<'v>(&self, text: &[u8], values: impl Iterator<Item = &'v mut f64>) -> Option<usize> {
        let (mut taken, mut field) = (0, 0);
        for (value, &wanted) in values.zip(&self.fields) {
            taken += self.skip(text.get(taken..)?, field, wanted)?;
            let rest = text.get(taken..)?;
            let length;
            (*value, length) = match self.number(rest, wanted) {
                Some(found) => found,
                None => self.value(rest, wanted)?,
            };
            taken += length;
            field = wanted + 1;
        }
        Some(taken + self.skip(text.get(taken..)?, field, self.layout.width())?)
    }

    /// The length of the fields from one index to before another.
    fn skip(&self, text: &[u8], from: usize, to: usize) -> Option<usize> {
        let mut skipped = 0;
        for field in from..to {
            skipped += self.field(&text[skipped..], field)?.len() + 1;
        }
        Some(skipped)
    }

    /// The field at the front of a text, if it ends as it must and without a quote.
    fn field<'a>(&self, text: &'a [u8], index: usize) -> Option<&'a [u8]> {
        let end = memchr3(self.layout.dialect.delimiter, b'\n', b'"', text)?;
        (text[end] == self.end_of(index)).then(|| &text[..end])
    }

    /// The byte after a field.
    fn end_of(&self, index: usize) -> u8 {
        if index + 1 == self.layout.width() { b'\n' } else { self.layout.dialect.delimiter }
    }

    /// Reads the value at the front of a text, and returns it with the length of its field: most are short numbers and
    /// nothing else, whose end need not be searched for.
    #[inline]
    fn number(&self, text: &[u8], index: usize) -> Option<(f64, usize)> {
        if self.numbers.are_plain() && self.has_numbers(index) {
            let (value, length) = decimal::short(text)?;
            return (text.get(length) == Some(&self.end_of(index))).then_some((value, length + 1));
        }
        None
    }

    /// How the times in a field are written, if it has some.
    fn clock(&self, index: usize) -> Option<&Clock> {
        if self.time == Some(index) {
            return Some(&self.times.clock);
        }
        self.times.days.as_ref().filter(|_| self.times.date == Some(index))
    }

    /// Whether what is in a field is meant as a number.
    fn has_numbers(&self, index: usize) -> bool {
        if let Some(clock) = self.clock(index) {
            matches!(clock, Clock::Seconds)
        } else {
            self.layout.states(index).is_none()
        }
    }

    /// Reads the value at the front of a text, whatever it is, and returns it with the length of its field, unless it
    /// needs care.
    #[inline(never)]
    fn value(&self, text: &[u8], index: usize) -> Option<(f64, usize)> {
        let dialect = self.layout.dialect;
        let blanks = |text: &[u8]| text.iter().take_while(|&&byte| dialect.is_blank(byte)).count();
        let is_time = self.time == Some(index);
        let start = blanks(text);
        // The end of a number need not be searched for either: it is where the number ends.
        if self.has_numbers(index)
            && let Some((value, length)) = self.numbers.prefix(&text[start..])
        {
            let end = start + length;
            let end = end + blanks(&text[end..]);
            if text.get(end) == Some(&self.end_of(index)) && !(is_time && value.is_nan()) {
                return Some((value, end + 1));
            }
        }
        let field = self.field(text, index)?;
        let value = self.content(dialect.trimmed(field), index).ok()?;
        Some((value, field.len() + 1))
    }

    /// Reads the content of a field; an error is a message. A status that historians write is a missing value that
    /// remembers it.
    fn content(&self, content: &[u8], index: usize) -> Result<f64, String> {
        if let Some(clock) = self.clock(index) {
            return clock.read(content, &self.numbers);
        }
        if let Some(states) = self.layout.states(index) {
            return self.state(content, states);
        }
        let number = self.numbers.read(content);
        if number.is_err()
            && let Some(missing) = words::status(content)
        {
            self.has_statuses.store(true, Ordering::Relaxed);
            return Ok(missing);
        }
        number
    }

    /// One of two words as 0 or 1.
    fn state(&self, content: &[u8], states: States) -> Result<f64, String> {
        if let Some(value) = states.read(content) {
            return Ok(value);
        }
        if self.numbers.is_missing(content) {
            return Ok(f64::NAN);
        }
        if let Some(missing) = words::status(content) {
            self.has_statuses.store(true, Ordering::Relaxed);
            return Ok(missing);
        }
        let [off, on] = states.words();
        Err(format!("{} is neither '{off}' nor '{on}', as the first rows are; correct it", quoted(content)))
    }

    /// Takes the statuses out of some columns, which are those of the plan, and counts them.
    pub(super) fn count(&self, columns: &mut [Vec<f64>], tallies: &mut [Tally]) {
        if self.has_statuses.load(Ordering::Relaxed) {
            columns.iter_mut().zip(tallies).for_each(|(column, tally)| tally.take(column));
        }
    }

    /// What the reader should know of the columns that were read, in plain words.
    pub(super) fn told(&self) -> impl Iterator<Item = String> {
        let states =
            self.fields.iter().filter_map(|&field| Some((field, self.layout.states(field)?.words())));
        states.map(|(field, [off, on])| {
            self.layout.told(&format!("{}: '{off}' is read as 0 and '{on}' as 1", self.layout.column(field)))
        })
    }

    /// That a field has statuses, in plain words.
    pub(super) fn has_missing(&self, field: usize, words: &str) -> String {
        self.layout.told(&format!("{}: read as missing values: {words}", self.layout.column(field)))
    }

    /// What was counted, in plain words.
    pub(super) fn counted(&self, tallies: &[Tally]) -> impl Iterator<Item = String> {
        let told =
            self.fields.iter().zip(tallies).filter_map(|(&field, tally)| Some((field, tally.words()?)));
        told.map(|(field, words)| self.has_missing(field, &words))
    }

    /// Reads rows by all the rules, and returns the length of their text.
    fn read_carefully(
        &self,
        text: &[u8],
        unended: bool,
        record: &mut Record,
        rows: &mut Rows,
    ) -> Result<usize, Error> {
        let layout = &self.layout;
        let mut values = vec![0.0; self.fields.len()];
        let mut taken = 0;
        while taken < text.len() {
            let rest = &text[taken..];
            if let Some(length) = layout.dialect.skipped_line(rest) {
                rows.line += 1;
                taken += length;
                continue;
            }
            let Some(length) = record.read(rest) else { break };
            let row = Row { record, text: &rest[..length], line: rows.line };
            if unended && length == rest.len() && record.len() < layout.width() {
                return Err(layout.cut(&row));
            }
            self.values(&row, !rows.has_any(), &mut values)?;
            rows.push(&values, memchr_iter(b'\n', row.text).count() as u64);
            taken += length;
        }
        Ok(taken)
    }

    /// Takes the values from a row that was read by all the rules.
    pub(super) fn values(&self, row: &Row<'_>, first: bool, values: &mut [f64]) -> Result<(), Error> {
        let layout = &self.layout;
        let fields = row.record.len();
        if fields != layout.width() && !(layout.is_open && fields == layout.width() + 1) {
            return Err(layout.ragged(row));
        }
        for (value, &index) in values.iter_mut().zip(&self.fields) {
            let content = layout.dialect.trimmed(row.record.field(index));
            let report = if first { Layout::first_fault } else { Layout::fault };
            *value = self.content(content, index).map_err(|message| report(layout, row, index, &message))?;
        }
        Ok(())
    }
}

/// Cuts a text after newlines into pieces of `size` bytes or a little more.
fn pieces(mut text: &[u8], size: usize) -> Vec<&[u8]> {
    let mut pieces = Vec::with_capacity(text.len() / size + 1);
    while !text.is_empty() {
        let cut = text
            .get(size..)
            .and_then(|rest| memchr(b'\n', rest))
            .map_or(text.len(), |newline| size + newline + 1);
        let (piece, rest) = text.split_at(cut);
        pieces.push(piece);
        text = rest;
    }
    pieces
}
