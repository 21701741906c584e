//! Logs in columns: Parquet files, and Arrow IPC files and streams.
//!
//! All come as batches of Arrow arrays, of the selected columns only. Files are read from their end, where their
//! directory is; only a stream may come through a pipe.

mod batches;
mod clock;
mod footer;
mod messages;
mod values;

#[cfg(test)]
mod tests;

use std::collections::TryReserveError;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::mpsc::SyncSender;
use std::thread;

use arrow_array::RecordBatch;
use arrow_schema::Schema;

use super::error::{Error, escaped, shortened};
use super::lines::Lines;
use super::mailbox::{Event, Mailbox, Message, Waker};
use super::source::{Bytes, Columnar};
use super::time::Calendar;
use super::{Options, Selection, Table};
use batches::{Batches, Opened};
use clock::Clock;
use values::{Kind, numbers};

/// A log in columns, whose names and types are known and whose rows are still to be read.
pub(super) struct ColumnarReader {
    options: Options,
    columns: Columns,
    opened: Opened,
}

/// The columns of a file.
struct Columns {
    /// The file's name, for messages.
    file: String,
    names: Vec<String>,
    kinds: Vec<Kind>,
    /// Their types as messages name them.
    types: Vec<String>,
}

impl Columns {
    fn of(file: &str, schema: &Schema) -> Self {
        let fields = schema.fields();
        Self {
            file: file.to_owned(),
            names: fields.iter().map(|field| field.name().clone()).collect(),
            kinds: fields.iter().map(|field| Kind::of(field.data_type())).collect(),
            types: fields.iter().map(|field| field.data_type().to_string()).collect(),
        }
    }

    /// A column as messages call it.
    fn said(&self, index: usize) -> String {
        match self.names.get(index) {
            Some(name) if !name.is_empty() => format!("column '{}'", escaped(&shortened(name))),
            _ => format!("column {}", index + 1),
        }
    }

    fn kind(&self, index: usize) -> &Kind {
        self.kinds.get(index).unwrap_or(&Kind::Others)
    }

    /// An error in a row, counted from one.
    fn fault(&self, index: usize, row: u64, message: &str) -> Error {
        Error::data(&self.file, None, format!("{}, row {row}: {message}", self.said(index)))
    }

    fn error(&self, message: impl Into<String>) -> Error {
        Error::data(&self.file, None, message)
    }

    /// The selected columns in ascending order, if the selection makes sense and they hold what is asked of them.
    fn fields(&self, selection: &Selection) -> Result<Vec<usize>, Error> {
        let mut fields: Vec<usize> = selection.columns.iter().copied().chain(selection.time).collect();
        fields.sort_unstable();
        if let Some(beyond) = fields.iter().find(|&&field| field >= self.names.len()) {
            let all = self.names.len();
            return Err(self.error(format!("there is no column {}; select from the first {all}", beyond + 1)));
        }
        if let Some([twice, ..]) = fields.windows(2).find(|pair| pair.first() == pair.last()) {
            return Err(self.error(format!("{} is selected twice; select it once", self.said(*twice))));
        }
        for &index in &selection.columns {
            let (said, kind) = (self.said(index), self.types.get(index).map_or("", String::as_str));
            match self.kind(index) {
                Kind::Numbers => {}
                Kind::Texts => {
                    return Err(self.error(format!(
                        "{said} holds texts ({kind}), not numbers; write it as a column of numbers"
                    )));
                }
                Kind::Instants(..) | Kind::Durations(_) => {
                    return Err(self.error(format!(
                        "{said} holds times ({kind}), which only the clock is; name it with `time`"
                    )));
                }
                Kind::Others => {
                    return Err(self.error(format!(
                        "{said} is of the type {kind}; a signal has one number in each row: write such columns"
                    )));
                }
            }
        }
        Ok(fields)
    }
}

impl ColumnarReader {
    /// Reads what the columns are.
    pub(super) fn open(
        path: &Path,
        bytes: Bytes,
        format: Columnar,
        options: &Options,
    ) -> Result<Self, Error> {
        let file = bytes.name().to_owned();
        if let Some(option) = options.of_texts() {
            return Err(Error::data(
                &file,
                None,
                format!(
                    "{option} says how a text is written, and this is {}; leave it out",
                    batches::named(format)
                ),
            ));
        }
        let (opened, schema) = Opened::new(path, bytes, format, options.bound)?;
        let columns = Columns::of(&file, &schema);
        if columns.names.is_empty() {
            return Err(columns.error("there are no columns; write at least one"));
        }
        Ok(Self { options: options.clone(), columns, opened })
    }

    pub(super) fn names(&self) -> &[String] {
        &self.columns.names
    }

    /// The columns that hold something else than numbers.
    pub(super) fn words(&self) -> Vec<bool> {
        self.columns.kinds.iter().map(|kind| *kind != Kind::Numbers).collect()
    }

    /// The columns that are times by their type.
    pub(super) fn times(&self) -> Vec<usize> {
        let is_time = |kind: &Kind| matches!(kind, Kind::Instants(..) | Kind::Durations(_));
        let kinds = self.columns.kinds.iter().enumerate();
        kinds.filter(|(_, kind)| is_time(kind)).map(|(index, _)| index).collect()
    }

    /// Reads the selected columns; see [`Reader::read_parts`](super::Reader::read_parts).
    pub(super) fn read_parts(
        self,
        selection: &Selection,
        most: Option<usize>,
        progress: &mut dyn FnMut(u64, Option<u64>),
        take: &mut dyn FnMut(Table) -> ControlFlow<()>,
    ) -> Result<(), Error> {
        let bound = self.options.bound;
        let rows = self.opened.rows();
        let mut conversion = self.conversion(selection, None)?;
        let too_large = |values: usize| bound.and_then(|bound| bound.passed_by(values));
        let width = conversion.fields.len();
        let whole = rows.filter(|_| most.is_none());
        if let Some(words) = whole.and_then(|rows| too_large(rows.saturating_mul(width))) {
            return Err(conversion.too_large(&words));
        }
        let room = most.or(rows).unwrap_or(0);
        let mut part = Part::new(width, room);
        while let Some(batch) = conversion.batch()? {
            conversion.append(&batch, &mut part, false)?;
            if let Some(fault) = part.first_fault() {
                return Err(fault);
            }
            if let Some(words) = too_large(part.rows.saturating_mul(width)) {
                return Err(conversion.too_large(&words));
            }
            let (read, total) = conversion.batches.progress();
            progress(read, total);
            if most.is_some_and(|most| part.rows >= most) {
                let whole = std::mem::replace(&mut part, Part::new(width, room));
                if take(conversion.table(whole, selection)).is_break() {
                    return Ok(());
                }
            }
        }
        let _ = take(conversion.table(part, selection));
        Ok(())
    }

    /// Gives the rows of the selected columns one by one; see [`Reader::stream`](super::Reader::stream).
    pub(super) fn stream(self, selection: &Selection, start: Option<&str>) -> Result<ColumnarStream, Error> {
        let conversion = self.conversion(selection, start)?;
        let place = |field: &usize| conversion.fields.binary_search(field).unwrap_or_default();
        let mailbox = Mailbox::new();
        let stream = ColumnarStream {
            places: selection.columns.iter().map(place).collect(),
            time: selection.time.as_ref().map(place),
            values: vec![0.0; selection.columns.len()],
            start: conversion.clock.as_ref().and_then(|clock| clock.start.clone()),
            part: Part::default(),
            next: 0,
            fault: 0,
            row: 0,
            words: Vec::new(),
            ended: false,
            mailbox,
        };
        let sender = stream.mailbox.sender();
        let file = conversion.columns.file.clone();
        let begun = thread::Builder::new().spawn(move || conversion.send(&sender));
        begun.map_err(|error| Error::no_thread(&file, &error))?;
        Ok(stream)
    }

    /// Begins to read, and decides by the first row how times are written.
    fn conversion(self, selection: &Selection, start: Option<&str>) -> Result<Conversion, Error> {
        let Self { options, columns, opened } = self;
        let fields = columns.fields(selection)?;
        let format = options.time_format.as_deref();
        if format.is_some()
            && let Some(time) = selection.time.filter(|&time| *columns.kind(time) != Kind::Texts)
        {
            let message = format!(
                "{} holds {}, not texts, so `time-format` says nothing of it; leave it out",
                columns.said(time),
                columns.kind(time).said()
            );
            return Err(columns.error(message));
        }
        let mut batches = opened.batches(&fields)?;
        let first = loop {
            match batches.next() {
                None => return Err(columns.error("there are no rows; record at least one")),
                Some(Err(error)) => return Err(error),
                Some(Ok(batch)) if batch.num_rows() == 0 => {}
                Some(Ok(batch)) => break batch,
            }
        };
        let mut clock = None;
        if let Some(time) = selection.time {
            let place = fields.binary_search(&time).unwrap_or_default();
            let found = match first.columns().get(place) {
                Some(array) => Clock::decide(columns.kind(time), array.as_ref(), format, start),
                None => Err("is not there".to_owned()),
            };
            clock = Some(found.map_err(|message| columns.fault(time, 1, &message))?);
        }
        Ok(Conversion { columns, fields, time: selection.time, clock, batches, first: Some(first), rows: 0 })
    }
}

/// From batches to columns of numbers.
struct Conversion {
    columns: Columns,
    /// The columns to read, in ascending order.
    fields: Vec<usize>,
    /// The one of them that is the time.
    time: Option<usize>,
    clock: Option<Clock>,
    batches: Batches,
    /// The first batch, which was read in advance.
    first: Option<RecordBatch>,
    /// How many rows were read.
    rows: u64,
}

/// Some rows as columns of numbers.
#[derive(Default)]
struct Part {
    columns: Vec<Vec<f64>>,
    rows: usize,
    /// What is wrong, by row of the part.
    faults: Vec<(usize, Error)>,
    words: Vec<String>,
}

impl Part {
    /// No rows yet; there will be about so many.
    fn new(columns: usize, rows: usize) -> Self {
        let column = || {
            let mut column = Vec::new();
            // Only what the file says: without the memory for it the table may still fit.
            let _ = column.try_reserve_exact(rows);
            column
        };
        Self { columns: (0..columns).map(|_| column()).collect(), ..Self::default() }
    }

    /// The first that is wrong.
    fn first_fault(&mut self) -> Option<Error> {
        (!self.faults.is_empty()).then(|| self.faults.swap_remove(0).1)
    }
}

impl Conversion {
    /// The next batch.
    fn batch(&mut self) -> Result<Option<RecordBatch>, Error> {
        match self.first.take() {
            Some(first) => Ok(Some(first)),
            None => self.batches.next().transpose(),
        }
    }

    /// Appends the rows of a batch. Where a value is wrong it is NaN, and all faults are kept, or the first one of each
    /// column.
    fn append(&mut self, batch: &RecordBatch, part: &mut Part, all: bool) -> Result<(), Error> {
        let Self { columns, fields, time, clock, rows, .. } = self;
        let start = part.rows;
        for ((index, array), values) in fields.iter().copied().zip(batch.columns()).zip(&mut part.columns) {
            let full = |error: TryReserveError| Error::memory(&columns.file, None, &error.to_string());
            let mut faults = 0;
            let mut fault = |row: usize, message: &str| {
                if all || faults == 0 {
                    part.faults.push((start + row, columns.fault(index, *rows + row as u64 + 1, message)));
                }
                faults += 1;
            };
            if Some(index) == *time {
                let Some(clock) = clock else { continue };
                clock.append(array.as_ref(), values, &mut fault).map_err(full)?;
                continue;
            }
            if numbers(array.as_ref(), values).map_err(full)? {
                let word = format!(
                    "{}: {} has whole numbers beyond 2^53, which are rounded to the nearest ones that 64 bits of floating \
                     point hold",
                    columns.file,
                    columns.said(index)
                );
                if !part.words.contains(&word) {
                    part.words.push(word);
                }
            }
            let new = values.get_mut(start..).unwrap_or_default();
            // One pass for all: it hardly ever finds any.
            if new.iter().any(|value| value.is_infinite()) {
                for (row, value) in new.iter_mut().enumerate().filter(|(_, value)| value.is_infinite()) {
                    *value = f64::NAN;
                    fault(row, "the value is infinite; correct it, or write null if it is missing");
                }
            }
        }
        // The first row first, and in it the first column.
        part.faults.sort_by_key(|(row, _)| *row);
        part.rows += batch.num_rows();
        *rows += batch.num_rows() as u64;
        Ok(())
    }

    /// A table of some rows, its columns in the order of the selection.
    fn table(&self, mut part: Part, selection: &Selection) -> Table {
        let place = |field: &usize| self.fields.binary_search(field).unwrap_or_default();
        let mut take = |field| part.columns.get_mut(place(field)).map(std::mem::take).unwrap_or_default();
        Table {
            columns: selection.columns.iter().map(&mut take).collect(),
            time: selection.time.as_ref().map(take),
            start: self.clock.as_ref().and_then(|clock| clock.start.clone()),
            calendar: Calendar::None,
            clocks: Vec::new(),
            rows: part.rows,
            lines: Lines::default(),
            words: part.words,
        }
    }

    /// The error for a table that takes more memory than there is.
    fn too_large(&self, words: &str) -> Error {
        Error::memory(&self.columns.file, None, words)
    }

    /// Reads all rows for who takes them, until nobody does.
    fn send(mut self, parts: &SyncSender<Message<Part>>) {
        loop {
            let mut part = Part::new(self.fields.len(), 0);
            let message = match self.batch() {
                Ok(Some(batch)) => match self.append(&batch, &mut part, true) {
                    Ok(()) => Message::Piece(part),
                    Err(error) => Message::Failed(error),
                },
                Ok(None) => Message::End,
                Err(error) => Message::Failed(error),
            };
            let goes_on = matches!(message, Message::Piece(_));
            if parts.send(message).is_err() || !goes_on {
                return;
            }
        }
    }
}

/// A log in columns of which the rows are read one after the other. Memory does not grow with their number.
///
/// A thread of its own reads the batches.
pub(super) struct ColumnarStream {
    /// Where each selected column is in a part, and where the time is.
    places: Vec<usize>,
    time: Option<usize>,
    /// The values of the row at hand, in the order of the selection.
    values: Vec<f64>,
    start: Option<String>,
    /// The rows at hand; the next one and the next fault among them.
    part: Part,
    next: usize,
    fault: usize,
    /// The number of the row at hand, counted from one.
    row: u64,
    words: Vec<String>,
    ended: bool,
    mailbox: Mailbox<Part>,
}

impl ColumnarStream {
    pub(super) fn waker(&self) -> Waker {
        self.mailbox.waker()
    }

    pub(super) fn start(&self) -> Option<&str> {
        self.start.as_deref()
    }

    pub(super) fn values(&self) -> &[f64] {
        &self.values
    }

    pub(super) fn time(&self) -> Option<f64> {
        self.part.columns.get(self.time?)?.get(self.next.checked_sub(1)?).copied()
    }

    pub(super) fn row(&self) -> u64 {
        self.row
    }

    pub(super) fn words(&mut self) -> Vec<String> {
        std::mem::take(&mut self.words)
    }

    pub(super) fn next(&mut self) -> Result<Event, Error> {
        while self.next >= self.part.rows {
            if self.ended {
                return Ok(Event::End);
            }
            match self.mailbox.take() {
                None => return Ok(Event::Idle),
                Some(Message::Failed(error)) => return Err(error),
                Some(Message::Stop) => return Ok(Event::Stopped),
                Some(Message::End) => self.ended = true,
                Some(Message::Piece(mut part)) => {
                    self.words.append(&mut part.words);
                    (self.part, self.next, self.fault) = (part, 0, 0);
                }
            }
        }
        self.mailbox.forget();
        for (value, &place) in self.values.iter_mut().zip(&self.places) {
            *value = self
                .part
                .columns
                .get(place)
                .and_then(|column| column.get(self.next))
                .copied()
                .unwrap_or(f64::NAN);
        }
        let mut event = Event::Row;
        while let Some((_, error)) = self.part.faults.get(self.fault).filter(|(row, _)| *row == self.next) {
            // One is told for each row.
            if matches!(event, Event::Row) {
                event = Event::Malformed(error.clone());
            }
            self.fault += 1;
        }
        self.next += 1;
        self.row += 1;
        Ok(event)
    }
}
