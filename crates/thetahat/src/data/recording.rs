//! Logs as they were recorded, whatever their clock.

use super::{Channel, Rows, check, checked};
use crate::Error;

/// A log as it was recorded: unlike a [`Log`](crate::data::Log) it may have an irregular clock. NaN means that the
/// sample is missing.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// The channels, all as long.
    pub channels: Vec<Channel>,
    /// When the rows were recorded.
    pub times: Times,
}

/// When the rows of a log were recorded.
#[derive(Debug, Clone, PartialEq)]
pub enum Times {
    /// Seconds, one value for each row.
    Measured(Vec<f64>),
    /// One row every given number of seconds.
    Uniform(f64),
}

impl Recording {
    /// Some rows, as a recording of its own. A measured clock goes on as it was.
    ///
    /// # Errors
    /// [`Error::Data`] for rows that are not there, channels that differ in length, and another number of times.
    ///
    /// ```
    /// use thetahat::data::{Channel, Recording, Times};
    ///
    /// let y = Channel { name: "y".into(), values: vec![1.0, 2.0, 3.0] };
    /// let log = Recording { channels: vec![y], times: Times::Measured(vec![0.0, 0.5, 2.0]) };
    /// let part = log.part("2..3".parse()?)?;
    /// assert_eq!((&part.channels[0].values[..], part.times), (&[2.0, 3.0][..], Times::Measured(vec![0.5, 2.0])));
    /// assert_eq!(log.part("2..4".parse()?).unwrap_err().to_string(), "`rows` 2..4: the log has 3 rows; name rows up to that");
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn part(&self, rows: Rows) -> Result<Self, Error> {
        let count = check(&self.channels)?;
        checked("rows", &[rows], count)?;
        let range = rows.positions();
        let channel = |channel: &Channel| Channel {
            name: channel.name.clone(),
            values: channel.values[range.clone()].to_vec(),
        };
        let times = match &self.times {
            Times::Uniform(step) => Times::Uniform(*step),
            Times::Measured(time) if time.len() == count => Times::Measured(time[range.clone()].to_vec()),
            Times::Measured(time) => {
                return Err(Error::data(format!("there are {} time stamps for {count} rows", time.len())));
            }
        };
        Ok(Self { channels: self.channels.iter().map(channel).collect(), times })
    }
}
