//! Dates as the clocks on the wall of a time zone show them.

use jiff::Timestamp;
use jiff::tz::{Offset, TimeZone};

use super::time::{self, Calendar};
use super::{Error, Table};

/// A time zone, and how far its clocks are ahead.
pub(super) struct Zone {
    name: String,
    zone: TimeZone,
}

impl Zone {
    /// A time zone by its name, such as Europe/Berlin or UTC. An error is a message.
    pub(super) fn of(name: &str) -> Result<Self, String> {
        let zone = TimeZone::get(name).map_err(|_| {
            format!("`time-zone` {name}: no such time zone; give a name such as Europe/Berlin, America/New_York or UTC")
        })?;
        Ok(Self { name: name.to_owned(), zone })
    }

    /// Makes instants of the times of a table, which are dates without a zone. Of the hour that comes twice, where clocks are set back,
    /// it is the first.
    ///
    /// # Errors
    /// That the times are no such dates.
    pub(super) fn apply(&self, file: &str, table: &mut Table) -> Result<(), Error> {
        let refused = |message: String| Error::data(file, None, message);
        let Some(times) = &mut table.time else { return Ok(()) };
        let Calendar::Wall { first } = table.calendar else {
            return Err(refused(format!(
                "`time-zone` {} is for dates without a zone, and these times are none; leave it out",
                self.name
            )));
        };
        let start = self.instant(first, 0.0).ok_or_else(|| refused(time::NO_DATE.to_owned()))?;
        for time in times {
            let instant = self.instant(first, *time).ok_or_else(|| refused(time::NO_DATE.to_owned()))?;
            *time = (instant.as_nanosecond() - start.as_nanosecond()) as f64 / 1e9;
        }
        table.start = Some(start.to_string());
        table.calendar = Calendar::Zone;
        Ok(())
    }

    /// The instant at which the clocks show so many seconds more than the first time, which is `first` nanoseconds after 1970.
    fn instant(&self, first: i64, seconds: f64) -> Option<Timestamp> {
        let wall = Timestamp::from_nanosecond(i128::from(first) + (seconds * 1e9).round() as i128).ok()?;
        self.zone.to_ambiguous_timestamp(Offset::UTC.to_datetime(wall)).compatible().ok()
    }
}
