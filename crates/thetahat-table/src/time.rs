//! The time column.

use jiff::Timestamp;
use jiff::fmt::strtime::BrokenDownTime;
use jiff::fmt::temporal::Pieces;
use jiff::tz::Offset;

use super::error::{escaped, quoted};
use super::number::Numbers;

/// How the times are written, decided by the first one.
#[derive(Clone, Debug)]
pub(super) enum Clock {
    /// Seconds, as numbers.
    Seconds,
    /// Dates and times of day, returned as seconds since the first one.
    Calendar {
        /// A format in the manner of strptime; without one, ISO 8601.
        format: Option<String>,
        /// The first one.
        first: Timestamp,
    },
}

impl Clock {
    /// Decides by the first time how the others are written; an error is a message.
    pub(super) fn decide(field: &[u8], format: Option<&str>, numbers: &Numbers) -> Result<Self, String> {
        if numbers.is_missing(field) {
            return Err(MISSING.to_owned());
        }
        let seconds = numbers.read(field);
        if format.is_none() && (seconds.is_ok() || numbers.is_nearly(field)) {
            return seconds.map(|_| Self::Seconds);
        }
        let first = instant(field, format)?;
        Ok(Self::Calendar { format: format.map(str::to_owned), first })
    }

    /// Reads a whole field without blanks around it as seconds; an error is a message.
    pub(super) fn read(&self, field: &[u8], numbers: &Numbers) -> Result<f64, String> {
        match self {
            _ if numbers.is_missing(field) => Err(MISSING.to_owned()),
            Self::Seconds => numbers.read(field).map_err(|message| match instant(field, None) {
                Ok(_) => format!(
                    "{} is a date, but the first time is a number; write all times alike",
                    quoted(field)
                ),
                Err(_) => message,
            }),
            Self::Calendar { format, first } => {
                let now = instant(field, format.as_deref())?;
                // Whole nanoseconds up to here: as seconds since 1970 both would have lost their last digits.
                Ok((now.as_nanosecond() - first.as_nanosecond()) as f64 / 1e9)
            }
        }
    }
}

/// The message for a time that is not there.
pub(super) const MISSING: &str = "the time is missing; fill it in, or take the row out";

/// Reads a date and time of day; one without an offset is in UTC.
fn instant(field: &[u8], format: Option<&str>) -> Result<Timestamp, String> {
    match format {
        Some(format) => formatted(field, format).map_err(|reason| {
            format!(
                "{} does not follow `time-format` {} ({}); correct one of them",
                quoted(field),
                quoted(format.as_bytes()),
                escaped(&reason.to_string())
            )
        }),
        None => iso(field).map_err(|reason| {
            format!(
                "{} is not a date and time as in 2024-03-01T12:00:00.250Z ({}); correct it, or describe \
                 it, as in `time-format` '%d.%m.%Y %H:%M:%S%.f'",
                quoted(field),
                escaped(&reason.to_string())
            )
        }),
    }
}

/// Reads a date and time of day in ISO 8601.
fn iso(field: &[u8]) -> Result<Timestamp, jiff::Error> {
    let pieces = Pieces::parse(field)?;
    let offset = match (pieces.to_numeric_offset(), pieces.time_zone_annotation()) {
        (Some(offset), _) => offset,
        (None, None) => Offset::UTC,
        (None, Some(_)) => {
            return Err(jiff::Error::from_args(format_args!("a time zone needs its offset from UTC")));
        }
    };
    offset.to_timestamp(pieces.date().to_datetime(pieces.time().unwrap_or_default()))
}

/// Reads a date and time of day, or only the latter, in the manner of strptime.
fn formatted(field: &[u8], format: &str) -> Result<Timestamp, jiff::Error> {
    let parts = BrokenDownTime::parse(format, field)?;
    if let Some(timestamp) = parts.timestamp() {
        return Ok(timestamp);
    }
    let has_date = parts.year().is_some()
        || parts.iso_week_year().is_some()
        || parts.month().is_some()
        || parts.day().is_some()
        || parts.day_of_year().is_some()
        || parts.weekday().is_some();
    let date = if has_date { parts.to_date()? } else { jiff::civil::date(1970, 1, 1) };
    let offset = match (parts.offset(), parts.iana_time_zone()) {
        (Some(offset), _) => offset,
        (None, None) => Offset::UTC,
        (None, Some(_)) => {
            return Err(jiff::Error::from_args(format_args!("a time zone needs its offset from UTC")));
        }
    };
    offset.to_timestamp(date.to_datetime(parts.to_time()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers() -> Numbers {
        Numbers::new(false, &["-1".to_owned()])
    }

    fn seconds(first: &str, format: Option<&str>, then: &str) -> Result<f64, String> {
        Clock::decide(first.as_bytes(), format, &numbers())?.read(then.as_bytes(), &numbers())
    }

    #[test]
    fn numbers_are_seconds() {
        assert_eq!(seconds("5", None, "5.25"), Ok(5.25));
        assert_eq!(seconds("2024", None, "2025"), Ok(2025.0));
    }

    #[test]
    fn dates_are_counted_from_the_first() {
        let start = "2024-03-01T12:00:00.250Z";
        for (then, expected) in [
            ("2024-03-01T12:00:00.350Z", 0.1),
            ("2024-03-01 12:00:00.350", 0.1),
            ("2024-03-01T13:00:00.250+01:00", 0.0),
            ("2024-03-01T12:00:00,250000001Z", 1e-9),
            ("2024-03-01", -43_200.25),
            ("20240302T120000.25Z", 86_400.0),
            ("2024-03-01T12:00:01.250Z[Europe/Paris]", 1.0),
        ] {
            assert_eq!(seconds(start, None, then), Ok(expected), "{then}");
        }
    }

    #[test]
    fn a_format_is_followed() {
        let format = Some("%d.%m.%Y %H:%M:%S%.f");
        assert_eq!(seconds("01.03.2024 12:00:00", format, "02.03.2024 12:00:00.5"), Ok(86_400.5));
        // With a format a number is not a number of seconds.
        assert_eq!(seconds("20240301120000", Some("%Y%m%d%H%M%S"), "20240301120001"), Ok(1.0));
        assert_eq!(seconds("1709294400", Some("%s"), "1709294401"), Ok(1.0));
        // A time of day alone.
        assert_eq!(seconds("12:00:00", Some("%H:%M:%S"), "12:01:00"), Ok(60.0));
        assert_eq!(seconds("12:00 +0000", Some("%H:%M %z"), "12:00 -0100"), Ok(3600.0));
    }

    #[test]
    fn every_time_is_written_like_the_first() {
        assert!(
            seconds("1", None, "2024-03-01").is_err_and(|message| message.contains("first time is a number"))
        );
        assert!(seconds("2024-03-01", None, "1").is_err_and(|message| message.contains("`time-format`")));
        assert!(
            seconds("2024-03-01", None, "2024-02-30").is_err_and(|message| message.contains("2024-02-30"))
        );
        assert!(seconds("12:00", None, "12:00").is_err_and(|message| message.contains("`time-format`")));
        assert!(seconds("0,5", None, "").is_err_and(|message| message.contains("`decimal-comma`")));
        assert!(
            seconds("1.3.24", Some("%Y"), "1").is_err_and(|message| message.contains("`time-format` \"%Y\""))
        );
        // Neither a weekday nor a zone says when.
        assert!(seconds("Mon 12:00", Some("%a %H:%M"), "").is_err());
        assert!(
            seconds("2024-03-01T12:00[Europe/Paris]", None, "")
                .is_err_and(|message| message.contains("offset"))
        );
    }

    #[test]
    fn a_missing_time_is_an_error() {
        for missing in ["", "NaN", "null", "-1"] {
            assert_eq!(seconds(missing, None, "1"), Err(MISSING.to_owned()), "{missing:?}");
            assert_eq!(seconds("1", None, missing), Err(MISSING.to_owned()), "{missing:?}");
            assert_eq!(seconds("2024-03-01", None, missing), Err(MISSING.to_owned()), "{missing:?}");
        }
    }
}
