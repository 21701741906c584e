//! Where the rows of a log came from.

use jiff::SignedDuration;
use jiff::civil::DateTime;
use jiff::fmt::temporal::Pieces;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Resampling, Rows};

/// Where a log came from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Source {
    /// The file name as it was given.
    pub file: String,
    /// Its rows, counted through all logs.
    pub rows: Rows,
    /// The column that gave the time, if one did.
    pub time: Option<String>,
    /// The first time as it was written, where times were dates.
    pub start: Option<String>,
    /// How the log was made uniform, if it was irregular.
    pub resampled: Option<Resampling>,
}

impl Source {
    /// What a log is called that is no file.
    pub const IN_MEMORY: &str = "memory";

    /// When a row was, so many seconds after the first one, as the first time is written: in ISO 8601. None where times
    /// are no dates.
    ///
    /// ```
    /// use thetahat::data::{Rows, Source};
    ///
    /// let mut source = Source { file: "log.csv".into(), rows: Rows::new(1, 9)?, time: None, start: None, resampled: None };
    /// assert_eq!(source.instant(90.0), None);
    /// source.start = Some("2024-03-01 23:59:00+01:00".into());
    /// assert_eq!(source.instant(90.25).as_deref(), Some("2024-03-02 00:00:30.25+01:00"));
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn instant(&self, seconds: f64) -> Option<String> {
        let start = self.start.as_deref()?;
        let first = Start::of(start)?;
        let nanoseconds = (seconds * 1e9).round();
        let exact = nanoseconds.abs() < i64::MAX as f64;
        let now =
            first.wall.checked_add(SignedDuration::from_nanos(nanoseconds as i64)).ok().filter(|_| exact)?;
        // Days alone stay days.
        if !start.contains(':') && now.time() == jiff::civil::Time::midnight() {
            return Some(now.date().to_string());
        }
        let text = now.to_string();
        let text = if start.as_bytes().get(10) == Some(&b' ') { text.replacen('T', " ", 1) } else { text };
        Some(text + first.zone)
    }

    /// Seconds from the beginning of 1970 to the first time, as the clocks on the wall of its zone show it. None where
    /// times are no dates.
    #[cfg(feature = "present")]
    pub(crate) fn wall_seconds(&self) -> Option<f64> {
        let wall = Start::of(self.start.as_deref()?)?.wall;
        Some(jiff::tz::Offset::UTC.to_timestamp(wall).ok()?.as_nanosecond() as f64 / 1e9)
    }
}

/// The first time of a log.
struct Start<'t> {
    wall: DateTime,
    /// What follows: Z, an offset from UTC, or nothing.
    zone: &'t str,
}

impl<'t> Start<'t> {
    fn of(text: &'t str) -> Option<Self> {
        let pieces = Pieces::parse(text).ok()?;
        let wall = pieces.date().to_datetime(pieces.time().unwrap_or_default());
        let zone = match pieces.offset() {
            // The last sign is that of the offset: the date has two before.
            Some(_) => text.rfind(['Z', 'z', '+', '-', '\u{2212}']).map_or("", |at| &text[at..]),
            None => "",
        };
        Some(Self { wall, zone })
    }
}
