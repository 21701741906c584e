//! What verbs that follow a log row by row have in common.

use thetahat_table::{Event, Stream};

use crate::failure::Failure;
use crate::interrupt;
use crate::messages::warn;

/// This many faults of a kind are told one by one.
const TOLD: u64 = 5;

/// The rows of a log that is followed, malformed lines, odd clocks and requests to end dealt with.
pub(crate) struct Live {
    stream: Stream,
    /// The log's name, for messages.
    name: String,
    strict: bool,
    /// Whether the row at hand is a malformed line: all its values are missing.
    is_blank: bool,
    blank: Vec<f64>,
    /// The latest time, and the seconds to it from the one before.
    last: Option<f64>,
    step: Option<f64>,
    rows: u64,
    malformed: u64,
    set_back: u64,
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
    pub(crate) fn new(stream: Stream, name: &str, strict: bool) -> Self {
        Self {
            blank: vec![f64::NAN; stream.values().len()],
            stream,
            name: name.to_owned(),
            strict,
            is_blank: false,
            last: None,
            step: None,
            rows: 0,
            malformed: 0,
            set_back: 0,
        }
    }

    /// Goes on by one row.
    pub(crate) fn next(&mut self) -> Result<Next, Failure> {
        if interrupt::is_ending() {
            return Ok(Next::Stopped);
        }
        self.is_blank = false;
        let event = self.stream.advance()?;
        self.stream.words().iter().for_each(|word| warn(word));
        match event {
            Event::Row => self.look_at_the_clock()?,
            Event::Malformed(error) => self.malformed(error.into())?,
            Event::Idle => return Ok(Next::Idle),
            Event::End => return Ok(Next::End),
            Event::Stopped => return Ok(Next::Stopped),
        }
        self.rows += 1;
        Ok(Next::Row)
    }

    /// A row with the time of the one before is one too many; an earlier time is a clock that was set back.
    fn look_at_the_clock(&mut self) -> Result<(), Failure> {
        let Some(time) = self.stream.time() else { return Ok(()) };
        let place = self.place();
        match self.last {
            Some(last) if time == last => {
                let message = format!("{place}: the time is that of the row before; take the row out");
                return self.malformed(Failure::data(message));
            }
            Some(last) if time < last => {
                let message = format!("{place}: the time is before that of the row before");
                if self.strict {
                    return Err(Failure::data(format!("{message}; correct it, or leave out --strict")));
                }
                self.set_back += 1;
                tell(self.set_back, &format!("{message}; it goes on from there"), "more of this follows");
                self.step = None;
            }
            last => self.step = last.map(|last| time - last),
        }
        self.last = Some(time);
        Ok(())
    }

    fn malformed(&mut self, failure: Failure) -> Result<(), Failure> {
        if self.strict {
            return Err(failure);
        }
        self.is_blank = true;
        self.malformed += 1;
        tell(self.malformed, failure.message(), "more malformed lines follow; they are counted");
        Ok(())
    }

    /// Seconds since the row before that has a time; none for the first one, without a clock, and where the clock was
    /// set back.
    pub(crate) fn step(&self) -> Option<f64> {
        self.step
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

    /// The row at hand as messages name it.
    pub(crate) fn place(&self) -> String {
        self.stream.place(&self.name)
    }

    /// The number of the row at hand, counted from 1.
    pub(crate) fn row(&self) -> u64 {
        self.rows
    }

    /// Whether the row at hand is a malformed line.
    pub(crate) fn is_malformed(&self) -> bool {
        self.is_blank
    }

    /// What was in the log besides good rows, as it goes after the number of rows: nothing, or such as ", 2 malformed".
    pub(crate) fn faults(&self) -> String {
        let malformed = match self.malformed {
            0 => String::new(),
            count => format!(", {count} malformed"),
        };
        let set_back = match self.set_back {
            0 => String::new(),
            1 => ", clock set back once".to_owned(),
            count => format!(", clock set back {count} times"),
        };
        malformed + &set_back
    }

    /// Whether the log ended inside a line, which was left alone.
    pub(crate) fn is_unfinished(&self) -> bool {
        self.stream.is_unfinished()
    }
}

/// Nobody has to wait for it any more.
impl Drop for Live {
    fn drop(&mut self) {
        interrupt::leaves();
    }
}

/// Tells the first faults of a kind one by one, and then that there are more.
fn tell(count: u64, message: &str, more: &str) {
    match count {
        0..=TOLD => warn(message),
        _ if count == TOLD + 1 => warn(more),
        _ => {}
    }
}
