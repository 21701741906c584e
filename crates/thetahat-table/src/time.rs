//! The time column.

use jiff::Timestamp;
use jiff::fmt::strtime::BrokenDownTime;
use jiff::fmt::temporal::Pieces;
use jiff::tz::Offset;

use super::error::{escaped, quoted};
use super::number::Numbers;

/// A unit in which numbers count time.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Unit {
    /// 1e-9 s.
    Nanoseconds,
    /// 1e-6 s.
    Microseconds,
    /// 1e-3 s.
    Milliseconds,
    /// Seconds.
    Seconds,
    /// 60 s.
    Minutes,
    /// 3600 s.
    Hours,
    /// 86400 s.
    Days,
}

impl Unit {
    const ALL: [Self; 7] = [
        Self::Nanoseconds,
        Self::Microseconds,
        Self::Milliseconds,
        Self::Seconds,
        Self::Minutes,
        Self::Hours,
        Self::Days,
    ];
    /// Those in which times since 1970 are counted.
    pub(super) const EPOCHS: [Self; 4] =
        [Self::Seconds, Self::Milliseconds, Self::Microseconds, Self::Nanoseconds];

    /// A unit by its symbol, or by one of its names in lower case.
    ///
    /// ```
    /// use thetahat_table::Unit;
    ///
    /// assert_eq!(Unit::of("ms"), Some(Unit::Milliseconds));
    /// assert_eq!(Unit::of("mV"), None);
    /// ```
    pub fn of(text: &str) -> Option<Self> {
        Some(match text {
            "ns" | "nsec" | "nanos" | "nanoseconds" => Self::Nanoseconds,
            "us" | "\u{b5}s" | "\u{3bc}s" | "usec" | "micros" | "microseconds" => Self::Microseconds,
            "ms" | "msec" | "millis" | "milliseconds" => Self::Milliseconds,
            "s" | "sec" | "secs" | "second" | "seconds" | "sek" | "sekunden" => Self::Seconds,
            "min" | "mins" | "minute" | "minutes" | "minuten" => Self::Minutes,
            "h" | "hr" | "hrs" | "hour" | "hours" | "stunden" => Self::Hours,
            "d" | "day" | "days" | "tage" => Self::Days,
            _ => return None,
        })
    }

    /// How many nanoseconds one is.
    pub(super) fn nanoseconds(self) -> i128 {
        match self {
            Self::Nanoseconds => 1,
            Self::Microseconds => 1_000,
            Self::Milliseconds => 1_000_000,
            Self::Seconds => 1_000_000_000,
            Self::Minutes => 60_000_000_000,
            Self::Hours => 3_600_000_000_000,
            Self::Days => 86_400_000_000_000,
        }
    }

    /// Its symbol.
    pub(super) fn symbol(self) -> &'static str {
        Self::NAMES[Self::ALL.iter().position(|unit| *unit == self).unwrap_or_default()].0
    }

    /// Its name.
    pub(super) fn name(self) -> &'static str {
        Self::NAMES[Self::ALL.iter().position(|unit| *unit == self).unwrap_or_default()].1
    }

    const NAMES: [(&'static str, &'static str); 7] = [
        ("ns", "nanoseconds"),
        ("us", "microseconds"),
        ("ms", "milliseconds"),
        ("s", "seconds"),
        ("min", "minutes"),
        ("h", "hours"),
        ("d", "days"),
    ];

    /// A number of them in seconds.
    fn seconds(self, number: f64) -> f64 {
        // A division by a power of ten is exact to the last digit, a product with its inverse is not.
        match self {
            Self::Nanoseconds => number / 1e9,
            Self::Microseconds => number / 1e6,
            Self::Milliseconds => number / 1e3,
            Self::Seconds => number,
            Self::Minutes => number * 60.0,
            Self::Hours => number * 3600.0,
            Self::Days => number * 86_400.0,
        }
    }
}

/// How the times are written, decided by the first one.
#[derive(Clone, Debug)]
pub(super) enum Clock {
    /// Seconds, as numbers.
    Seconds,
    /// Numbers in another unit, as they are.
    Numbers(Unit),
    /// Hours, minutes and seconds, as they are.
    Durations,
    /// Numbers in a unit, returned as seconds since the first one.
    Since {
        unit: Unit,
        /// The first one, and its whole part and fraction if it has them.
        first: f64,
        parts: Option<(i64, f64)>,
        /// When that is.
        instant: Timestamp,
    },
    /// Dates and times of day, returned as seconds since the first one.
    Calendar {
        /// A format in the manner of strptime; without one, ISO 8601.
        format: Option<String>,
        /// The first one.
        first: Timestamp,
    },
}

/// How the times of a column are written.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Written {
    /// Numbers in a unit, as they are.
    Numbers(Unit),
    /// Numbers that count from a day: so many nanoseconds after it was 1970.
    Since(Unit, i128),
    /// ISO 8601, or a format in the manner of strptime.
    Dates(Option<String>),
    /// Hours, minutes and seconds since the beginning, as in 27:05:10.5, or minutes and seconds.
    Durations,
}

/// What times are, besides seconds.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum Calendar {
    /// Numbers.
    #[default]
    None,
    /// Times of day, of any day.
    TimesOfDay,
    /// Dates as the clocks on a wall show them.
    Wall {
        /// The first one, in nanoseconds since these clocks showed the beginning of 1970.
        first: i64,
    },
    /// Instants.
    Instants,
}

impl Calendar {
    /// That of times of which this is the first.
    pub(super) fn of(start: Option<&str>) -> Self {
        let Some(start) = start else { return Self::None };
        let has_zone = |pieces: &Pieces<'_>| {
            pieces.to_numeric_offset().is_some() || pieces.time_zone_annotation().is_some()
        };
        match (Pieces::parse(start.as_bytes()), instant(start.as_bytes(), None)) {
            (Ok(pieces), Ok(_)) if has_zone(&pieces) => Self::Instants,
            // Years beyond 2262 have clocks that nobody sets.
            (Ok(_), Ok(first)) => {
                i64::try_from(first.as_nanosecond()).map_or(Self::Instants, |first| Self::Wall { first })
            }
            _ => Self::TimesOfDay,
        }
    }
}

/// The times of a log, of one column or of two.
#[derive(Clone, Debug)]
pub(super) struct Times {
    /// How the times are written.
    pub(super) clock: Clock,
    /// The column of the days that these are times of, if it is another, and how they are written.
    pub(super) date: Option<usize>,
    pub(super) days: Option<Clock>,
    /// The first time in ISO 8601, if it is a date.
    pub(super) start: Option<String>,
}

impl Default for Times {
    fn default() -> Self {
        Self { clock: Clock::Seconds, date: None, days: None, start: None }
    }
}

impl Times {
    /// The same times counted from another start, in ISO 8601. An error is a message.
    pub(super) fn counted_from(self, start: &str) -> Result<Self, String> {
        let (clock, days) = match self.days {
            None => (self.clock.counted_from(start)?, None),
            // The days count from there, and the times of day from midnight.
            Some(days) => (self.clock.counted_from("1970-01-01")?, Some(days.counted_from(start)?)),
        };
        Ok(Self { clock, days, start: Some(start.to_owned()), ..self })
    }
}

impl Clock {
    /// A clock whose times are written like this, from the first one on. An error is a message.
    pub(super) fn begin(field: &[u8], written: &Written, numbers: &Numbers) -> Result<Self, String> {
        if numbers.is_missing(field) {
            return Err(MISSING.to_owned());
        }
        match written {
            Written::Numbers(Unit::Seconds) => Self::decide(field, None, numbers),
            Written::Numbers(unit) => number(field, numbers).map(|_| Self::Numbers(*unit)),
            Written::Since(unit, origin) => {
                let first = number(field, numbers)?;
                let parts = whole_and_fraction(field, first);
                let (whole, fraction) = parts.unwrap_or((0, first));
                // Spreadsheets keep microseconds.
                let rest = (fraction * (unit.nanoseconds() / 1_000) as f64).round() as i128 * 1_000;
                let nanoseconds = i128::from(whole) * unit.nanoseconds() + rest;
                let instant = Timestamp::from_nanosecond(nanoseconds + origin)
                    .map_err(|_| format!("{} is no time since 1970 in {}", quoted(field), unit.name()))?;
                Ok(Self::Since { unit: *unit, first, parts, instant })
            }
            Written::Durations if duration(field).is_some() => Ok(Self::Durations),
            Written::Durations => Self::decide(field, None, numbers),
            Written::Dates(format) => Self::decide(field, format.as_deref(), numbers),
        }
    }

    /// The first time in ISO 8601: as it is written if it is that. None of times that are mere numbers.
    pub(super) fn start(&self, field: &[u8]) -> Option<String> {
        match self {
            Self::Seconds | Self::Numbers(_) | Self::Durations => None,
            Self::Since { unit: Unit::Days, instant, .. } => Some(civil(*instant)),
            Self::Since { instant, .. } => Some(instant.to_string()),
            Self::Calendar { format: None, .. } => Some(String::from_utf8_lossy(field).into_owned()),
            // A time of day alone has no day.
            Self::Calendar { format: Some(_), first } if is_first_day(*first) => {
                Some(String::from_utf8_lossy(field).into_owned())
            }
            Self::Calendar { format: Some(format), first } => {
                let zoned = ["%z", "%:z", "%Z", "%s", "%Q"].iter().any(|part| format.contains(part));
                Some(if zoned { first.to_string() } else { civil(*first) })
            }
        }
    }

    /// The first time of a clock of days whose times of day are in another column, in ISO 8601; none if one of them has
    /// no calendar.
    pub(super) fn start_at(&self, times: &Self) -> Option<String> {
        match (self, times) {
            // Times of day count from the beginning of 1970.
            (Self::Calendar { first: day, .. }, Self::Calendar { first: time, .. }) => {
                Timestamp::from_nanosecond(day.as_nanosecond() + time.as_nanosecond()).ok().map(civil)
            }
            _ => None,
        }
    }

    /// The same clock with its times counted from another start, in ISO 8601. An error is a message.
    pub(super) fn counted_from(self, start: &str) -> Result<Self, String> {
        let from = || match &self {
            Self::Calendar { format: Some(format), first } if is_first_day(*first) => {
                instant(start.as_bytes(), Some(format))
            }
            _ => instant(start.as_bytes(), None),
        };
        if matches!(self, Self::Seconds | Self::Numbers(_) | Self::Durations) {
            return Ok(self);
        }
        let from = from()?;
        Ok(match self {
            Self::Seconds | Self::Numbers(_) | Self::Durations => self,
            Self::Calendar { format, .. } => Self::Calendar { format, first: from },
            Self::Since { unit, first, parts, instant } => {
                let ahead =
                    (from.as_nanosecond() - instant.as_nanosecond()) as f64 / unit.nanoseconds() as f64;
                let parts = parts.map(|(whole, fraction)| (whole, fraction + ahead));
                Self::Since { unit, first: first + ahead, parts, instant: from }
            }
        })
    }

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
            Self::Seconds => number(field, numbers),
            Self::Numbers(unit) => Ok(unit.seconds(number(field, numbers)?)),
            Self::Durations => duration(field).ok_or_else(|| {
                format!("{} is no time as in 27:05:10.5, as the first ones are; correct it", quoted(field))
            }),
            Self::Since { unit, first, parts, .. } => {
                let now = number(field, numbers)?;
                Ok(unit.seconds(match (whole_and_fraction(field, now), parts) {
                    // Exact: times since 1970 have more digits than a number has.
                    (Some((whole, fraction)), Some((first, part))) => {
                        (i128::from(whole) - i128::from(*first)) as f64 + (fraction - part)
                    }
                    _ => now - first,
                }))
            }
            Self::Calendar { format, first } => {
                let now = instant(field, format.as_deref())?;
                // Whole nanoseconds up to here: as seconds since 1970 both would have lost their last digits.
                Ok((now.as_nanosecond() - first.as_nanosecond()) as f64 / 1e9)
            }
        }
    }
}

/// More digits than these of a fraction are not read exactly.
const MOST_DIGITS: usize = 15;

/// The message for a time that no calendar has.
pub(super) const NO_DATE: &str = "the time is no date between the years -9999 and 9999; correct it";

/// The message for a time that is not there.
pub(super) const MISSING: &str = "the time is missing; fill it in, or take the row out";

/// Whether an instant is on the day that stands for all, where times have none.
fn is_first_day(instant: Timestamp) -> bool {
    (0..86_400).contains(&instant.as_second())
}

/// An instant as the clocks on a wall show it that have no zone.
fn civil(instant: Timestamp) -> String {
    Offset::UTC.to_datetime(instant).to_string()
}

/// Hours, minutes and seconds with colons between them, or minutes and seconds, in seconds.
pub(super) fn duration(field: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(field).ok()?;
    let (before, seconds) = text.rsplit_once(':')?;
    let (hours, minutes) = before.split_once(':').unwrap_or(("0", before));
    let whole = |text: &str, below: Option<u32>| {
        let number: u32 = text.parse().ok().filter(|_| text.bytes().all(|byte| byte.is_ascii_digit()))?;
        below.is_none_or(|below| number < below).then_some(f64::from(number))
    };
    let below = before.contains(':').then_some(60);
    let plain = seconds.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.' || byte == b',');
    let seconds: f64 = seconds.replace(',', ".").parse().ok().filter(|seconds| plain && *seconds < 60.0)?;
    Some(3600.0 * whole(hours, None)? + 60.0 * whole(minutes, below)? + seconds)
}

/// The whole part and the fraction of a number that has nothing but digits and what separates these two.
fn whole_and_fraction(field: &[u8], value: f64) -> Option<(i64, f64)> {
    let text = std::str::from_utf8(field).ok()?;
    let (whole, digits) = text.split_once(['.', ',']).unwrap_or((text, ""));
    let whole: i64 = whole.parse().ok()?;
    let fraction = match digits {
        "" => 0.0,
        _ if whole < 0 || digits.len() > MOST_DIGITS || !digits.bytes().all(|byte| byte.is_ascii_digit()) => {
            return None;
        }
        _ => digits.parse::<u64>().ok()? as f64 / 10.0_f64.powi(digits.len() as i32),
    };
    // What separates them may stand for thousands.
    let is_value = (whole as f64 + fraction - value).abs() <= 4.0 * f64::EPSILON * value.abs();
    is_value.then_some((whole, fraction))
}

/// A time that is a number.
fn number(field: &[u8], numbers: &Numbers) -> Result<f64, String> {
    numbers.read(field).map_err(|message| match instant(field, None) {
        Ok(_) => {
            format!("{} is a date, but the first time is a number; write all times alike", quoted(field))
        }
        Err(_) => message,
    })
}

/// Reads a date and time of day; one without an offset is in UTC.
pub(super) fn instant(field: &[u8], format: Option<&str>) -> Result<Timestamp, String> {
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
    fn decimals_of_seconds_since_1970_keep_their_digits() {
        let since = |decimal_comma: bool, first: &str, then: &str| {
            let numbers = Numbers::new(decimal_comma, &[]);
            let written = Written::Since(Unit::Seconds, 0);
            Clock::begin(first.as_bytes(), &written, &numbers)?.read(then.as_bytes(), &numbers)
        };
        assert_eq!(since(false, "1700000000.0", "1700000000.1"), Ok(0.1));
        assert_eq!(since(false, "1700000000", "1700086400.000001"), Ok(86_400.000_001));
        assert_eq!(since(true, "1700000000,25", "1700000001,125"), Ok(0.875));
        assert_eq!(since(false, "1700000000.999999", "1700000001.000001"), Ok(1.0 + (0.000_001 - 0.999_999)));
        // In other forms the number itself.
        assert_eq!(since(false, "1.7e9", "1700000000.5"), Ok(0.5));
        assert!(since(false, "1700000000", "abc").is_err());
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
