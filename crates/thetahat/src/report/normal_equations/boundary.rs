//! What is known of the rows at which pieces meet.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::data::Log;

/// A row: a value of each channel, none where it is missing.
type Row = Vec<Option<f64>>;

/// The first and the last rows of some consecutive pieces: as many as the maximum lag of the model, or as the pieces
/// have.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub(super) struct Boundary {
    /// How many rows before the first one of their own there are.
    past: usize,
    /// The last of these; without a past the first rows.
    head: Vec<Row>,
    tail: Vec<Row>,
    /// The times of the first and the last row of their own, in seconds, where there is a clock.
    times: Option<[f64; 2]>,
}

impl Boundary {
    pub(super) fn new(log: &Log, names: &[&str], past: usize, lags: usize) -> Result<Self, Error> {
        let channels: Vec<&[f64]> = names
            .iter()
            .map(|name| Ok(log.channel(name)?.values.as_slice()))
            .collect::<Result<_, Error>>()?;
        let row = |row: usize| {
            channels.iter().map(|values| Some(values[row]).filter(|value| !value.is_nan())).collect()
        };
        let rows = log.rows();
        let head = if past > 0 { past.saturating_sub(lags)..past } else { 0..lags.min(rows) };
        // Several logs as one have several clocks.
        let time = log.time().filter(|_| !log.is_joined());
        Ok(Self {
            past,
            head: head.map(row).collect(),
            tail: (rows.saturating_sub(lags)..rows).map(row).collect(),
            times: time.map(|time| [time[past], time[rows - 1]]),
        })
    }

    /// That of these pieces and others after them.
    ///
    /// # Errors
    /// [`Error::Data`] if the others do not go on where these end.
    pub(super) fn joined(&self, other: &Self, lags: usize, names: &[&str]) -> Result<Self, Error> {
        if other.past > 0 {
            if let (Some([_, end]), Some([start, _])) = (self.times, other.times)
                && start <= end
            {
                return Err(Error::data(format!(
                    "the clock goes back over the boundary: the first pieces end at {end} s, and the rows of the second ones begin at {start} s; \
                     merge pieces in the order of time, each row once"
                )));
            }
            let common = self.tail.len().min(other.head.len());
            let (own, theirs) =
                (&self.tail[self.tail.len() - common..], &other.head[other.head.len() - common..]);
            let differs = own.iter().zip(theirs).rev().find_map(|(own, theirs)| {
                names.iter().zip(own.iter().zip(theirs)).find(|(_, (own, theirs))| own != theirs)
            });
            if let Some((name, (own, theirs))) = differs {
                let said = |value: &Option<f64>| {
                    value.map_or_else(|| "missing".to_owned(), |value| value.to_string())
                };
                return Err(Error::data(format!(
                    "the second pieces do not go on where the first ones end: '{name}' is {} in their past and {} there; merge pieces in \
                     their order, with the rows before a piece as its `past`, and experiments with a `past` of 0",
                    said(theirs),
                    said(own)
                )));
            }
        } else if lags > 0
            && self.tail.len() == lags
            && self.tail == other.head
            && self.tail.windows(2).any(|pair| pair[0] != pair[1])
        {
            return Err(Error::data(format!(
                "the second pieces begin with the last {lags} rows of the first ones, which would count twice; say that they are its `past`"
            )));
        }
        Ok(Self {
            past: self.past,
            head: self.head.clone(),
            tail: other.tail.clone(),
            times: self.times.zip(other.times).map(|([start, _], [_, end])| [start, end]),
        })
    }

    /// Whether all rows have as many channels.
    pub(super) fn fits(&self, channels: usize) -> bool {
        self.head.iter().chain(&self.tail).all(|row| row.len() == channels)
    }
}
