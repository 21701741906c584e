//! The rows of a topic, one after the other.

use std::io;
use std::ops::Range;
use std::thread;

use super::super::Table;
use super::super::error::Error;
use super::super::mailbox::{Event, Mailbox, Message, Waker};

/// Rows that are handed on at once.
const ROWS_OF_A_PIECE: usize = 1 << 10;

/// Some rows, one after the other.
#[derive(Default)]
struct Part {
    columns: Vec<Vec<f64>>,
    time: Vec<f64>,
}

impl Part {
    fn of(table: &Table, rows: Range<usize>) -> Self {
        let part = |values: &Vec<f64>| values.get(rows.clone()).unwrap_or_default().to_vec();
        Self {
            columns: table.columns.iter().map(part).collect(),
            time: table.time.as_ref().map(part).unwrap_or_default(),
        }
    }
}

/// The rows of a topic, one after the other.
pub(crate) struct TopicStream {
    values: Vec<f64>,
    words: Vec<String>,
    part: Part,
    next: usize,
    /// The number of the row at hand, counted from one.
    row: u64,
    ended: bool,
    mailbox: Mailbox<Part>,
}

impl TopicStream {
    /// The rows of a table.
    ///
    /// # Errors
    /// That the system has no thread for what hands them on.
    pub(super) fn of(mut table: Table) -> io::Result<Self> {
        let stream = Self {
            values: vec![0.0; table.columns.len()],
            words: std::mem::take(&mut table.words),
            part: Part::default(),
            next: 0,
            row: 0,
            ended: false,
            mailbox: Mailbox::new(),
        };
        let sender = stream.mailbox.sender();
        let send = move || {
            for first in (0..table.rows).step_by(ROWS_OF_A_PIECE) {
                let rows = first..table.rows.min(first + ROWS_OF_A_PIECE);
                if sender.send(Message::Piece(Part::of(&table, rows))).is_err() {
                    return;
                }
            }
            drop(sender.send(Message::End));
        };
        thread::Builder::new().spawn(send)?;
        Ok(stream)
    }

    pub(crate) fn waker(&self) -> Waker {
        self.mailbox.waker()
    }

    pub(crate) fn values(&self) -> &[f64] {
        &self.values
    }

    pub(crate) fn time(&self) -> Option<f64> {
        self.part.time.get(self.next.checked_sub(1)?).copied()
    }

    pub(crate) fn row(&self) -> u64 {
        self.row
    }

    pub(crate) fn words(&mut self) -> Vec<String> {
        std::mem::take(&mut self.words)
    }

    pub(crate) fn next(&mut self) -> Result<Event, Error> {
        while self.next >= self.part.time.len() {
            if self.ended {
                return Ok(Event::End);
            }
            match self.mailbox.take() {
                None => return Ok(Event::Idle),
                Some(Message::Failed(error)) => return Err(error),
                Some(Message::Stop) => return Ok(Event::Stopped),
                Some(Message::End) => self.ended = true,
                Some(Message::Piece(part)) => (self.part, self.next) = (part, 0),
            }
        }
        self.mailbox.forget();
        for (value, column) in self.values.iter_mut().zip(&self.part.columns) {
            *value = column.get(self.next).copied().unwrap_or(f64::NAN);
        }
        self.next += 1;
        self.row += 1;
        Ok(Event::Row)
    }
}
