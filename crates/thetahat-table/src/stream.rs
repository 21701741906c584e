//! A text read row by row, as it comes: a file to its end, or a pipe that someone is still writing to.

use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel};
use std::thread;

use memchr::memchr;

use super::Selection;
use super::error::Error;
use super::layout::Row;
use super::mailbox::{Event, Mailbox, Message, Waker};
use super::record::Record;
use super::rows::Plan;
use super::source::Source;
use super::words::Tally;

/// What is read at once, at most. A pipe gives less.
const PIECE: usize = 1 << 16;
/// The longest line.
const LONGEST: usize = 1 << 24;

/// A text of which the rows are read one after the other. Memory does not grow with their number.
///
/// A thread of its own reads the text, so that a row is parsed as soon as its line break is there. Every line is a row:
/// a quoted field does not reach beyond it.
pub(super) struct TextStream {
    plan: Plan,
    record: Record,
    /// The values of the row at hand by ascending field, and in the order of the selection.
    fields: Vec<f64>,
    values: Vec<f64>,
    /// Where each selected column is among the fields, and where the time is.
    places: Vec<usize>,
    time: Option<usize>,
    date: Option<usize>,
    /// What was read and not yet parsed, from `position` on.
    text: Vec<u8>,
    position: usize,
    /// The line of the row at hand, and the line after it.
    line: u64,
    next_line: u64,
    any: bool,
    /// Whether a last line without a line break is left alone.
    whole_lines: bool,
    /// What the reader should know, in plain words, and was not told yet.
    words: Vec<String>,
    /// The statuses of which that was said, by field.
    tallies: Vec<Tally>,
    ended: bool,
    mailbox: Mailbox<Vec<u8>>,
    spent: Sender<Vec<u8>>,
}

/// A text of which something was read already.
pub(super) struct Text {
    /// What was read, from the first row on, and on which line that is.
    pub(super) text: Vec<u8>,
    pub(super) line: u64,
    /// Where the rest comes from.
    pub(super) source: Source,
    /// Whether a last line without a line break is left alone.
    pub(super) whole_lines: bool,
    /// What the reader should know, in plain words.
    pub(super) words: Vec<String>,
}

impl TextStream {
    /// # Errors
    /// That the system has no thread that reads ahead.
    pub(super) fn begin(plan: Plan, selection: &Selection, text: Text) -> Result<Self, Error> {
        let Text { text, line, source, whole_lines, words } = text;
        let mailbox = Mailbox::new();
        let (spent, empty) = channel();
        let pieces = mailbox.sender();
        let begun = thread::Builder::new().spawn(move || read(source, &pieces, &empty));
        begun.map_err(|error| Error::no_thread(&plan.layout.file, &error))?;
        let place = |field: &usize| plan.place(*field);
        Ok(Self {
            fields: vec![0.0; plan.fields.len()],
            values: vec![0.0; selection.columns.len()],
            places: selection.columns.iter().map(place).collect(),
            time: selection.time.as_ref().map(place),
            date: selection.date.as_ref().map(place),
            record: Record::new(plan.layout.dialect.delimiter),
            words,
            tallies: vec![Tally::default(); plan.fields.len()],
            plan,
            text,
            position: 0,
            line,
            next_line: line,
            any: false,
            whole_lines,
            ended: false,
            mailbox,
            spent,
        })
    }

    /// What ends this stream early.
    pub(super) fn waker(&self) -> Waker {
        self.mailbox.waker()
    }

    /// The time that dates count from, as it is written; none if times are numbers.
    pub(super) fn start(&self) -> Option<&str> {
        self.plan.times.start.as_deref()
    }

    /// The row at hand, in the order of the selection; NaN is a missing value.
    pub(super) fn values(&self) -> &[f64] {
        &self.values
    }

    /// The time of the row at hand in seconds, as [`Table::time`](super::Table).
    pub(super) fn time(&self) -> Option<f64> {
        let time = self.fields.get(self.time?).copied()?;
        Some(time + self.date.and_then(|date| self.fields.get(date)).copied().unwrap_or_default())
    }

    /// The line on which the row at hand is, or the malformed one.
    pub(super) fn line(&self) -> u64 {
        self.line
    }

    /// What the reader should know, in plain words, each once.
    pub(super) fn words(&mut self) -> Vec<String> {
        std::mem::take(&mut self.words)
    }

    /// Makes missing values of statuses in the row at hand, and says so of each column once.
    fn tell_statuses(&mut self) {
        if !self.plan.has_statuses.swap(false, Ordering::Relaxed) {
            return;
        }
        for (place, (value, tally)) in self.fields.iter_mut().zip(&mut self.tallies).enumerate() {
            let known = tally.words().is_some();
            tally.take(std::slice::from_mut(value));
            if let (false, Some(words), Some(&field)) = (known, tally.words(), self.plan.fields.get(place)) {
                self.words.push(self.plan.has_missing(field, &words));
            }
        }
    }

    /// Whether the log ended inside a line, which was left alone.
    pub(super) fn is_unfinished(&self) -> bool {
        self.ended && self.position < self.text.len()
    }

    /// Goes on by one row.
    ///
    /// # Errors
    /// That the text cannot be read, or has a line of more than 16 MiB. What was read before is told first.
    pub(super) fn next(&mut self) -> Result<Event, Error> {
        loop {
            if let Some(event) = self.parse()? {
                self.mailbox.forget();
                return Ok(event);
            }
            if self.ended {
                return Ok(Event::End);
            }
            match self.mailbox.take() {
                None => return Ok(Event::Idle),
                Some(Message::Failed(error)) => return Err(error),
                Some(Message::Stop) => return Ok(Event::Stopped),
                Some(Message::End) => {
                    self.ended = true;
                    if !self.whole_lines && self.position < self.text.len() {
                        self.text.push(b'\n');
                    }
                }
                Some(Message::Piece(piece)) => {
                    self.text.drain(..self.position);
                    self.position = 0;
                    self.text.extend_from_slice(&piece);
                    // The thread may have ended; then nobody needs the memory.
                    let _ = self.spent.send(piece);
                }
            }
        }
    }

    /// Parses the row at the front of the text, if it is there as a whole.
    fn parse(&mut self) -> Result<Option<Event>, Error> {
        let layout = &self.plan.layout;
        while let Some(length) = layout.dialect.skipped_line(&self.text[self.position..]) {
            self.position += length;
            self.next_line += 1;
        }
        let rest = &self.text[self.position..];
        let mut event = Event::Row;
        let length = match self.plan.row(rest, self.fields.iter_mut()) {
            Some(length) => length,
            None => {
                let Some(newline) = memchr(b'\n', rest) else {
                    if rest.len() > LONGEST {
                        return Err(layout.too_long(self.next_line, LONGEST));
                    }
                    return Ok(None);
                };
                let text = &rest[..=newline];
                let whole = self.record.read(text).is_some();
                let row = Row { record: &self.record, text, line: self.next_line };
                let read = if whole {
                    self.plan.values(&row, !self.any, &mut self.fields)
                } else {
                    Err(layout.unclosed(&row, "its line"))
                };
                if let Err(error) = read {
                    event = Event::Malformed(error);
                }
                newline + 1
            }
        };
        self.position += length;
        self.line = self.next_line;
        self.next_line += 1;
        self.any = true;
        self.tell_statuses();
        for (value, &place) in self.values.iter_mut().zip(&self.places) {
            *value = self.fields[place];
        }
        Ok(Some(event))
    }
}

/// Reads a text to its end, or until nobody takes it.
fn read(mut source: Source, pieces: &SyncSender<Message<Vec<u8>>>, empty: &Receiver<Vec<u8>>) {
    loop {
        let mut piece = empty.try_recv().unwrap_or_default();
        piece.resize(PIECE, 0);
        let message = match source.read_some(&mut piece) {
            Ok(0) => Message::End,
            Ok(count) => {
                piece.truncate(count);
                Message::Piece(piece)
            }
            Err(error) => Message::Failed(error),
        };
        let goes_on = matches!(message, Message::Piece(_));
        if pieces.send(message).is_err() || !goes_on {
            return;
        }
    }
}
