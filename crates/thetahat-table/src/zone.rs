//! Dates as the clocks on the wall of a time zone show them.

use jiff::Timestamp;
use jiff::tz::{Offset, TimeZone};

use super::time::{self, Calendar};
use super::{Error, Table};

/// A time zone, and the last instant that was read in it.
pub(super) struct Zone {
    name: String,
    zone: TimeZone,
    last: Timestamp,
}

impl Zone {
    /// A time zone by its name, such as Europe/Berlin or UTC. An error is a message.
    pub(super) fn of(name: &str) -> Result<Self, String> {
        let zone = TimeZone::get(name).map_err(|_| {
            format!(
                "`time-zone` {name}: no such time zone; give a name such as Europe/Berlin, America/New_York or UTC"
            )
        })?;
        Ok(Self { name: name.to_owned(), zone, last: Timestamp::MIN })
    }

    /// Makes instants of the times of a table, which are dates without a zone.
    ///
    /// # Errors
    /// That the times are no such dates.
    pub(super) fn apply(&mut self, file: &str, table: &mut Table) -> Result<(), Error> {
        let refused = |message: String| Error::data(file, None, message);
        let Some(times) = &mut table.time else { return Ok(()) };
        let Calendar::Wall { first } = table.calendar else {
            return Err(refused(format!(
                "`time-zone` {} is for dates without a zone, and these times are none; leave it out",
                self.name
            )));
        };
        let no_date = || refused(time::NO_DATE.to_owned());
        let before = std::mem::replace(&mut self.last, Timestamp::MIN);
        let start = self.instant(first, 0.0).ok_or_else(no_date)?;
        // Of a part that follows another one the first time is not the start.
        self.last = before;
        for time in times {
            self.last = self.instant(first, *time).ok_or_else(no_date)?;
            *time = (self.last.as_nanosecond() - start.as_nanosecond()) as f64 / 1e9;
        }
        table.start = Some(start.to_string());
        table.calendar = Calendar::Instants;
        Ok(())
    }

    /// The instant at which the clocks show so many seconds more than the first time, which is `first` nanoseconds
    /// after 1970. Of the hour that comes twice, where clocks are set back, it is the first, unless that was over
    /// already.
    fn instant(&self, first: i64, seconds: f64) -> Option<Timestamp> {
        let wall = Timestamp::from_nanosecond(i128::from(first) + (seconds * 1e9).round() as i128).ok()?;
        let read = || self.zone.to_ambiguous_timestamp(Offset::UTC.to_datetime(wall));
        let instant = read().compatible().ok()?;
        if instant < self.last { read().later().ok() } else { Some(instant) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Times that the clocks of a zone show from 2024-10-27T00:00 on, in hours.
    fn instants(zone: &str, hours: &[f64]) -> Vec<f64> {
        let mut table = Table {
            time: Some(hours.iter().map(|hour| 3600.0 * (hour - hours[0])).collect()),
            calendar: Calendar::Wall { first: 1_729_987_200_000_000_000 + (hours[0] * 3.6e12) as i64 },
            ..Table::default()
        };
        Zone::of(zone).unwrap().apply("log.csv", &mut table).unwrap();
        assert_eq!(table.calendar, Calendar::Instants);
        table.time.unwrap().iter().map(|seconds| seconds / 3600.0).collect()
    }

    #[test]
    fn the_hour_that_comes_twice_comes_once_each() {
        let wall = [1.5, 2.0, 2.5, 2.0, 2.5, 3.0, 3.5];
        assert_eq!(instants("Europe/Berlin", &wall), [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0]);
        // Elsewhere clocks are set on other days, or never.
        assert_eq!(instants("America/New_York", &[1.5, 2.0, 3.0]), [0.0, 0.5, 1.5]);
        assert_eq!(instants("UTC", &[1.5, 2.0, 3.0]), [0.0, 0.5, 1.5]);
    }

    #[test]
    fn what_is_no_zone_or_has_one_is_refused() {
        assert!(Zone::of("Europe/Nowhere").is_err_and(|message| message.contains("no such time zone")));
        let mut table = Table { time: Some(vec![0.0]), ..Table::default() };
        let error = Zone::of("UTC").unwrap().apply("log.csv", &mut table).unwrap_err().to_string();
        assert!(error.starts_with("log.csv: `time-zone` UTC is for dates without a zone"), "{error}");
    }
}
