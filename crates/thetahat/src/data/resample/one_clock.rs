//! Recordings whose clocks differ, on one clock: the topics of a flight or of a robot.

use super::super::regular::Regular;
use super::super::{Interpolation, Log, Recording, Resample, Resampling, Times};
use super::{Grid, check, median_step, short};
use crate::Error;

/// A recording with its times, and its median step.
struct Part {
    recording: Recording,
    time: Vec<f64>,
    step: f64,
}

impl Part {
    fn new(mut recording: Recording) -> Result<Self, Error> {
        let rows = check(&recording.channels)?;
        let time = match std::mem::replace(&mut recording.times, Times::Uniform(1.0)) {
            Times::Measured(time) => time,
            Times::Uniform(step) => (0..rows).map(|row| row as f64 * step).collect(),
        };
        let named = |error: Error| match error {
            Error::Data { channel: None, row, message } => {
                let first = recording.channels.first().map(|channel| channel.name.clone());
                Error::Data { channel: first, row, message }
            }
            other => other,
        };
        let step = median_step(&time, rows).map_err(named)?;
        Ok(Self { recording, time, step })
    }

    fn first(&self) -> f64 {
        self.time.first().copied().unwrap_or(f64::NAN)
    }

    fn last(&self) -> f64 {
        self.time.last().copied().unwrap_or(f64::NAN)
    }

    /// What messages call it.
    fn name(&self) -> &str {
        self.recording.channels.first().map_or("", |channel| channel.name.as_str())
    }
}

impl Log {
    /// Recordings with clocks of their own, of which the times count alike, on one uniform clock, from where the last of them begins to
    /// where the first ends. Without `how` the step is about the usual one of the fastest, and each channel is read its own way.
    ///
    /// Each recording is read as [`Log::resampled`] reads it: with an anti-alias filter where `how` asks for one and it applies. Gives with
    /// the log how it was made; the rows are those of the longest recording, the filter is the longest.
    ///
    /// # Errors
    /// As for [`Log::resampled`]; [`Error::Data`] for recordings without a time in common, and [`Error::Argument`] for none at all.
    ///
    /// ```
    /// use thetahat::data::{Channel, Log, Recording, Times};
    ///
    /// // A switch every second, and a temperature every half of one from a little later on.
    /// let part = |name: &str, times: Vec<f64>, value: fn(f64) -> f64| Recording {
    ///     channels: vec![Channel { name: name.into(), values: times.iter().map(|t| value(*t)).collect() }],
    ///     times: Times::Measured(times),
    /// };
    /// let switch = part("u", (0..9).map(f64::from).collect(), |t| f64::from(t >= 4.0));
    /// let slope = part("y", (0..16).map(|k| 0.75 + 0.5 * f64::from(k)).collect(), |t| 2.0 * t);
    /// let (log, how) = Log::on_one_clock(vec![switch, slope], None)?;
    /// assert_eq!((how.step, log.rows()), (0.5, 15)); // from 0.75 s to 7.75 s
    /// assert_eq!(log.channels()[0].values[5..8], [0.0, 0.0, 1.0]);
    /// assert_eq!(log.channels()[1].values[..3], [1.5, 2.5, 3.5]);
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn on_one_clock(
        recordings: Vec<Recording>,
        how: Option<&Resample>,
    ) -> Result<(Self, Resampling), Error> {
        let parts: Vec<Part> = recordings.into_iter().map(Part::new).collect::<Result<_, _>>()?;
        let begins = parts.iter().max_by(|a, b| a.first().total_cmp(&b.first()));
        let ends = parts.iter().min_by(|a, b| a.last().total_cmp(&b.last()));
        let fastest = parts.iter().min_by(|a, b| a.step.total_cmp(&b.step));
        let (Some(begins), Some(ends), Some(fastest)) = (begins, ends, fastest) else {
            return Err(Error::argument("recordings", "there is none; give at least one"));
        };
        let (first, last) = (begins.first(), ends.last());
        if first >= last {
            return Err(Error::data(format!(
                "there is no time that all have: '{}' begins at {} s, '{}' ends at {} s; name others",
                begins.name(),
                short(first),
                ends.name(),
                short(last)
            )));
        }
        let how = how.copied().unwrap_or_else(|| Resample {
            step: Regular::of(&fastest.time, fastest.step).step,
            interpolation: Interpolation::Auto,
            anti_alias: false,
        });
        let rows = parts.iter().map(|part| part.time.len()).max().unwrap_or(0);
        let grid = Grid::new(first, last, how.step, rows)?;
        let mut resampling =
            Resampling { step: how.step, interpolation: how.interpolation, rows, anti_alias: None };
        let mut channels = Vec::new();
        for Part { recording, time, .. } in parts {
            if let Some(filter) = how.filter_for(&time)? {
                let longest = resampling.anti_alias.get_or_insert(filter);
                longest.taps = longest.taps.max(filter.taps);
            }
            channels.extend(grid.read(recording.channels, &time, &how)?);
        }
        check(&channels)?;
        Ok((Self::on_clock(channels, grid.instants, how.step), resampling))
    }
}
