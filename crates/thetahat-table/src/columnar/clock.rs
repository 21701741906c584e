//! The column of times.

use std::collections::TryReserveError;

use arrow_array::Array;
use jiff::Timestamp;
use jiff::fmt::temporal::Pieces;
use jiff::tz::Offset;

use super::super::number::Numbers;
use super::super::time;
use super::values::{Kind, Zone, numbers, texts, times};

/// What a clock does with its column.
pub(super) struct Clock {
    ticks: Ticks,
    /// The first time as a text that reads as it, if it is an instant.
    pub(super) start: Option<String>,
}

/// How times are written, decided by the type of the column, and of texts by the first one.
enum Ticks {
    /// Seconds, as numbers.
    Seconds,
    /// So many nanoseconds a unit.
    Durations(i64),
    /// So many nanoseconds a unit, and the first instant in nanoseconds.
    Instants(i64, i128),
    /// As in a text table.
    Texts(time::Clock, Numbers),
}

impl Clock {
    /// Decides by the type of a column, of which this has the first row. Instants count from `start`, or from the first
    /// one. An error is a message about the first row.
    pub(super) fn decide(
        kind: &Kind,
        array: &dyn Array,
        format: Option<&str>,
        start: Option<&str>,
    ) -> Result<Self, String> {
        let plain = |ticks| Ok(Self { ticks, start: None });
        match kind {
            Kind::Numbers => plain(Ticks::Seconds),
            Kind::Durations(unit) => plain(Ticks::Durations(*unit)),
            Kind::Instants(unit, zone) => {
                let first = times(array).first().copied().flatten().ok_or(time::MISSING)?;
                let first = i128::from(first) * i128::from(*unit);
                let (first, start) = match start {
                    Some(start) => (instant(start)?, start.to_owned()),
                    None => (first, written(first, zone)?),
                };
                Ok(Self { ticks: Ticks::Instants(*unit, first), start: Some(start) })
            }
            Kind::Texts => {
                let numbers = Numbers::new(false, &[]);
                let texts = texts(array);
                let first = texts.first().copied().flatten().ok_or(time::MISSING)?;
                let field = first.trim().as_bytes();
                let mut clock = time::Clock::decide(field, format, &numbers)?;
                let mut written = clock.start(field);
                if let (Some(start), Some(_)) = (start, &written) {
                    (clock, written) = (clock.counted_from(start)?, Some(start.to_owned()));
                }
                Ok(Self { ticks: Ticks::Texts(clock, numbers), start: written })
            }
            Kind::Others => {
                Err("this type holds no times; name a column of instants, durations or seconds".to_owned())
            }
        }
    }

    /// Appends the times in seconds; where there is none it is NaN, and `fault` is told the row of the array.
    ///
    /// # Errors
    /// That there is no memory for as many.
    pub(super) fn append(
        &self,
        array: &dyn Array,
        out: &mut Vec<f64>,
        fault: &mut impl FnMut(usize, &str),
    ) -> Result<(), TryReserveError> {
        out.try_reserve(array.len())?;
        let before = out.len();
        let seconds = |nanoseconds: i128| nanoseconds as f64 / 1e9;
        match &self.ticks {
            Ticks::Seconds => {
                numbers(array, out)?;
            }
            Ticks::Durations(unit) => out.extend(
                times(array)
                    .into_iter()
                    .map(|time| time.map_or(f64::NAN, |time| seconds(i128::from(time) * i128::from(*unit)))),
            ),
            Ticks::Instants(unit, first) => out.extend(times(array).into_iter().map(|time| {
                // Whole nanoseconds up to here, as of dates in texts.
                time.map_or(f64::NAN, |time| seconds(i128::from(time) * i128::from(*unit) - first))
            })),
            Ticks::Texts(clock, numbers) => {
                for (row, text) in texts(array).into_iter().enumerate() {
                    let time = clock.read(text.unwrap_or_default().trim().as_bytes(), numbers);
                    out.push(*time.as_ref().unwrap_or(&f64::NAN));
                    if let Err(message) = time {
                        fault(row, &message);
                    }
                }
                return Ok(());
            }
        }
        for (row, time) in out.iter_mut().skip(before).enumerate().filter(|(_, time)| !time.is_finite()) {
            *time = f64::NAN;
            fault(row, time::MISSING);
        }
        Ok(())
    }
}

/// An instant as a text that reads as it: in the zone where it was written if that is an offset from UTC, else in UTC.
fn written(nanoseconds: i128, zone: &Zone) -> Result<String, String> {
    let timestamp = Timestamp::from_nanosecond(nanoseconds).map_err(|_| time::NO_DATE.to_owned())?;
    let civil = Offset::UTC.to_datetime(timestamp);
    Ok(match zone {
        Zone::Day => civil.date().to_string(),
        Zone::Unknown => civil.to_string(),
        Zone::Named(zone) => match offset(zone).filter(|offset| !offset.is_zero()) {
            Some(offset) => timestamp.display_with_offset(offset).to_string(),
            None => timestamp.to_string(),
        },
    })
}

/// The offset that a zone is, such as +01:00.
fn offset(zone: &str) -> Option<Offset> {
    Pieces::parse(&format!("1970-01-01T00:00{zone}")).ok()?.to_numeric_offset()
}

/// The nanoseconds since 1970 of an instant that `written` wrote.
fn instant(start: &str) -> Result<i128, String> {
    match time::Clock::decide(start.as_bytes(), None, &Numbers::new(false, &[]))? {
        time::Clock::Calendar { first, .. } => Ok(first.as_nanosecond()),
        _ => Err(format!("the start {start} is no date")),
    }
}
