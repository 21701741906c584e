//! What verbs that follow a log row by row have in common.

use thetahat::thetahat_core::Action;

use crate::failure::Failure;
use crate::interrupt;
use crate::output::warn;
use crate::table::{Event, Stream};

/// So many malformed lines are told one by one.
const TOLD: u64 = 5;

/// The rows of a log that is followed, malformed lines and requests to end dealt with.
pub(crate) struct Live {
    stream: Stream,
    strict: bool,
    /// Whether the row at hand is a malformed line: all its values are missing.
    is_blank: bool,
    blank: Vec<f64>,
    rows: u64,
    malformed: u64,
}

/// What comes next.
pub(crate) enum Next {
    /// A row.
    Row,
    /// There is nothing more at the moment: who holds lines back should hand them over now.
    Idle,
    /// The log ends here.
    End,
    /// The program was asked to end.
    Stopped,
}

impl Live {
    pub(crate) fn new(stream: Stream, strict: bool) -> Self {
        let blank = vec![f64::NAN; stream.values().len()];
        Self { stream, strict, is_blank: false, blank, rows: 0, malformed: 0 }
    }

    /// Goes on by one row.
    pub(crate) fn next(&mut self) -> Result<Next, Failure> {
        if interrupt::is_ending() {
            return Ok(Next::Stopped);
        }
        self.is_blank = match self.stream.next()? {
            Event::Row => false,
            Event::Malformed(error) if self.strict => return Err(error.into()),
            Event::Malformed(error) => {
                self.malformed += 1;
                match self.malformed {
                    0..=TOLD => warn(&error.to_string()),
                    _ if self.malformed == TOLD + 1 => warn("more malformed lines follow; they are counted"),
                    _ => {}
                }
                true
            }
            Event::Idle => return Ok(Next::Idle),
            Event::End => return Ok(Next::End),
            Event::Stopped => return Ok(Next::Stopped),
        };
        self.rows += 1;
        Ok(Next::Row)
    }

    /// The values of the row at hand; NaN is a missing one.
    pub(crate) fn values(&self) -> &[f64] {
        if self.is_blank { &self.blank } else { self.stream.values() }
    }

    /// The time of the row at hand in seconds, if the log has a clock and the row is not malformed.
    pub(crate) fn time(&self) -> Option<f64> {
        self.stream.time().filter(|_| !self.is_blank)
    }

    /// Whether the log has a clock.
    pub(crate) fn has_clock(&self) -> bool {
        self.stream.time().is_some()
    }

    /// The line on which the row at hand is.
    pub(crate) fn line(&self) -> u64 {
        self.stream.line()
    }

    /// The number of the row at hand, counted from 1.
    pub(crate) fn row(&self) -> u64 {
        self.rows
    }

    /// Whether the row at hand is a malformed line.
    pub(crate) fn is_malformed(&self) -> bool {
        self.is_blank
    }

    /// How many lines were malformed.
    pub(crate) fn malformed(&self) -> u64 {
        self.malformed
    }

    /// Whether the log ended inside a line, which was left alone.
    pub(crate) fn is_unfinished(&self) -> bool {
        self.stream.is_unfinished()
    }
}

/// What was done with a sample, as a word.
pub(crate) fn action(action: Action) -> &'static str {
    match action {
        Action::Updated => "updated",
        Action::Capped => "capped",
        Action::Projected => "projected",
        Action::Missing => "missing",
        Action::NotReady => "not_ready",
        Action::Collecting => "collecting",
        Action::Frozen => "frozen",
        Action::Skipped => "skipped",
        Action::Gated => "gated",
        _ => "other",
    }
}
