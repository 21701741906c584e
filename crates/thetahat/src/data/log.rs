use std::collections::HashSet;
use std::ops::Range;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::padding::Padding;
use super::steps::{gap_above, irregularity, median_step, steps};
use crate::Error;
use crate::data::{Offset, Rows, checked};

/// One named signal of a log. NaN means that the sample is missing.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// The name, such as a CSV's column has.
    pub name: String,
    /// One value for each row, in the log's own units.
    pub values: Vec<f64>,
}

/// Channels on a common, uniform clock.
///
/// Time is in seconds. Where the clock has a gap, or a sample is missing, a new segment starts; no method of this crate
/// reaches across such a boundary. A missing output alone is no boundary to models that do not need past outputs.
///
/// ```
/// use thetahat::data::{Channel, Log};
///
/// let u = Channel { name: "u".into(), values: vec![0.0, 1.0, 1.0] };
/// let y = Channel { name: "y".into(), values: vec![0.0, 0.0, 0.5] };
/// let log = Log::new(vec![u, y], 0.1)?;
/// assert_eq!(log.rows(), 3);
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Log {
    channels: Vec<Channel>,
    /// In how many rows each of them misses its value.
    missing: Vec<usize>,
    rows: usize,
    sample_time: f64,
    /// Seconds, one for each row, where the log came with a clock.
    time: Option<Vec<f64>>,
    /// 0-based rows before which the clock has a gap, or another log begins.
    starts: Vec<usize>,
    /// Those of them at which another log begins.
    boundaries: Vec<usize>,
    /// Seconds from the first row of the log that this one was cut from, from where slopes are counted.
    before: f64,
    /// Why the clock is not uniform, if it is not.
    irregular: Option<Error>,
}

/// How a log that is not uniform is read between its samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Interpolation {
    /// The last value holds until the next: what a digital output does.
    Hold,
    /// A straight line from one sample to the next.
    Linear,
    /// Each channel its own: one that moves in steps holds its last value, a smooth one is read from straight lines.
    /// Not through a gap of the clock.
    Auto,
}

impl Log {
    /// A log with one sample every `sample_time` seconds.
    ///
    /// # Errors
    /// [`Error::Argument`] for a sample time that is not positive; [`Error::Data`] if there are no rows, channels
    /// differ in length, share a name, or hold an infinity.
    pub fn new(channels: Vec<Channel>, sample_time: f64) -> Result<Self, Error> {
        if !(sample_time.is_finite() && sample_time > 0.0) {
            return Err(Error::argument(
                "sample time",
                format!("{sample_time} is not a positive number of seconds"),
            ));
        }
        let Checked { rows, missing } = Checked::new(&channels)?;
        Ok(Self {
            channels,
            missing,
            rows,
            sample_time,
            time: None,
            starts: Vec::new(),
            boundaries: Vec::new(),
            before: 0.0,
            irregular: None,
        })
    }

    /// A log with a clock: `time` in seconds, one value for each row. The sample time is the median step; a step over
    /// 1.5 medians starts a new segment. Where a third of all steps is longer, the log is one of two rates: then a step
    /// over 1.5 of what all but a twentieth have.
    ///
    /// # Errors
    /// [`Error::Data`] as for [`Log::new`], if time is not finite, repeats or goes back, and if another step differs
    /// from the median by more than 10 % (then [`Log::resampled`] helps).
    pub fn with_time(channels: Vec<Channel>, time: Vec<f64>) -> Result<Self, Error> {
        let log = Self::recorded(channels, time)?;
        log.check_uniform()?;
        Ok(log)
    }

    /// A log as it was recorded: its clock may be irregular. Models in equations take it as it is; what needs a uniform
    /// clock refuses it with the error of [`with_time`](Self::with_time). Its sample time is the median step.
    ///
    /// # Errors
    /// [`Error::Data`] as for [`Log::new`], and if time is not finite, repeats or goes back.
    ///
    /// ```
    /// use thetahat::data::{Channel, Log};
    ///
    /// let y = Channel { name: "y".into(), values: vec![0.0, 1.0, 0.5] };
    /// let log = Log::recorded(vec![y], vec![0.0, 1.0, 1.8])?;
    /// assert!(log.record(&[], "y", &["1..3".parse()?]).unwrap_err().to_string().contains("the log is not uniform"));
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn recorded(channels: Vec<Channel>, time: Vec<f64>) -> Result<Self, Error> {
        let Checked { rows, missing } = Checked::new(&channels)?;
        let median = median_step(&time, rows)?;
        let gap = gap_above(&time, median);
        let long = steps(&time).enumerate().filter(|(_, step)| *step > gap);
        let starts: Vec<usize> = long.map(|(position, _)| position + 1).collect();
        let irregular = irregularity(&time, median, &starts);
        Ok(Self {
            channels,
            missing,
            rows,
            sample_time: median,
            time: Some(time),
            starts,
            boundaries: Vec::new(),
            before: 0.0,
            irregular,
        })
    }

    /// That the clock is uniform, but for gaps.
    ///
    /// # Errors
    /// [`Error::Data`] with the first row whose step is another.
    pub(crate) fn check_uniform(&self) -> Result<(), Error> {
        self.irregular.clone().map_or(Ok(()), Err)
    }

    /// A log on a clock that is known to be uniform.
    pub(super) fn on_clock(channels: Vec<Channel>, time: Vec<f64>, sample_time: f64) -> Self {
        Self {
            missing: channels.iter().map(|channel| Contents::of(&channel.values).missing).collect(),
            channels,
            rows: time.len(),
            sample_time,
            time: Some(time),
            starts: Vec::new(),
            boundaries: Vec::new(),
            before: 0.0,
            irregular: None,
        }
    }

    /// Several logs as one: experiments with the same plant, one after the other. Rows are counted through all of them,
    /// and no segment reaches from one to the next.
    ///
    /// # Errors
    /// [`Error::Argument`] if there is no log; [`Error::Data`] if one misses a channel that the first has, or its
    /// sample time differs from the first's by more than 1 %.
    pub fn join(logs: Vec<Self>) -> Result<Self, Error> {
        let mut logs = logs.into_iter();
        let mut joined =
            logs.next().ok_or_else(|| Error::argument("logs", "there is none; give at least one"))?;
        for (position, mut log) in logs.enumerate() {
            let number = position + 2;
            if (log.sample_time / joined.sample_time - 1.0).abs() > 0.01 {
                return Err(Error::data(format!(
                    "log {number} has a sample time of {} s, the first one of {} s; resample one of them",
                    log.sample_time, joined.sample_time
                )));
            }
            for (channel, missing) in joined.channels.iter_mut().zip(&mut joined.missing) {
                let place =
                    log.channels.iter().position(|own| own.name == channel.name).ok_or_else(|| {
                        let message = format!(
                            "log {number} has no channel '{}', which the first one has",
                            channel.name
                        );
                        Error::in_channel(&channel.name, None, message)
                    })?;
                channel.values.append(&mut log.channels[place].values);
                *missing += log.missing[place];
            }
            joined.starts.push(joined.rows);
            joined.starts.extend(log.starts.iter().map(|start| start + joined.rows));
            joined.boundaries.push(joined.rows);
            joined.time = match (joined.time, log.time) {
                (Some(mut time), Some(mut more)) => {
                    time.append(&mut more);
                    Some(time)
                }
                _ => None,
            };
            joined.irregular = joined.irregular.or(log.irregular);
            joined.rows += log.rows;
        }
        Ok(joined)
    }

    /// Some rows of some channels, as a log of its own with the same sample time. A line that was taken from a channel
    /// goes on in it as in the whole log.
    ///
    /// # Errors
    /// [`Error::Data`] for a channel or rows that are not there.
    pub fn part(&self, names: &[&str], rows: Rows) -> Result<Self, Error> {
        checked("rows", &[rows], self.rows)?;
        let range = rows.positions();
        // Side by side: new memory takes longer to get than to fill.
        let channels = names.par_iter().map(|name| {
            let values = self.channel(name)?.values[range.clone()].to_vec();
            Ok(Channel { name: (*name).to_owned(), values })
        });
        let channels = channels.collect::<Result<Vec<_>, Error>>()?;
        let inside = |positions: &[usize]| -> Vec<usize> {
            let inside =
                positions.iter().filter(|position| range.contains(position) && **position > range.start);
            inside.map(|position| position - range.start).collect()
        };
        let Checked { rows, missing } = Checked::new(&channels)?;
        Ok(Self {
            channels,
            missing,
            rows,
            sample_time: self.sample_time,
            time: self.time.as_ref().map(|time| time[range.clone()].to_vec()),
            starts: inside(&self.starts),
            boundaries: inside(&self.boundaries),
            before: self.elapsed(range.start),
            irregular: self.irregular.clone(),
        })
    }

    /// A log that was taken apart to store it: by its channels, [sample time](Self::sample_time), [clock](Self::time),
    /// [segment starts](Self::segment_starts), [boundaries](Self::boundaries) and what came [before](Self::before).
    ///
    /// # Errors
    /// As for [`Log::new`]; [`Error::Data`] if the clock does not go with the rows, or a break is no row of the log.
    pub fn restored(
        channels: Vec<Channel>,
        sample_time: f64,
        time: Option<Vec<f64>>,
        starts: Vec<usize>,
        boundaries: Vec<usize>,
        before: f64,
    ) -> Result<Self, Error> {
        let log = Self::new(channels, sample_time)?;
        let finite = |time: &Vec<f64>| time.len() == log.rows && time.iter().all(|time| time.is_finite());
        let rising = |positions: &[usize]| {
            let inside = positions.iter().all(|position| (1..log.rows).contains(position));
            inside && positions.is_sorted_by(|a, b| a < b)
        };
        let known = boundaries.iter().all(|boundary| starts.binary_search(boundary).is_ok());
        if !(time.iter().all(finite) && rising(&starts) && rising(&boundaries) && known && before.is_finite())
        {
            return Err(Error::data("the parts of a stored log do not fit together; store it again"));
        }
        let irregular = time.as_ref().and_then(|time| irregularity(time, sample_time, &starts));
        Ok(Self { time, starts, boundaries, before, irregular, ..log })
    }

    /// The rows (0-based) before which no segment reaches back: where the clock has a gap, or another log begins.
    pub fn segment_starts(&self) -> &[usize] {
        &self.starts
    }

    /// Those of the segment starts at which another log begins.
    pub fn boundaries(&self) -> &[usize] {
        &self.boundaries
    }

    /// The rows (0-based) of each log of which this one is made.
    pub(crate) fn logs(&self) -> impl Iterator<Item = Range<usize>> {
        let starts = std::iter::once(0).chain(self.boundaries.iter().copied());
        starts.zip(self.boundaries.iter().copied().chain([self.rows])).map(|(first, end)| first..end)
    }

    /// The log with offsets taken from some channels, and without the others. A channel that is not there is missing in
    /// every row.
    pub(crate) fn deviations<'s>(
        &self,
        signals: impl Iterator<Item = (&'s str, Offset)>,
    ) -> Result<Self, Error> {
        let (here, absent): (Vec<_>, Vec<_>) = signals.partition(|(name, _)| self.has(name));
        let names: Vec<&str> = here.iter().map(|(name, _)| *name).collect();
        let mut log = self.part(&names, Rows::new(1, self.rows)?)?;
        here.iter().for_each(|(name, offset)| log.remove(name, offset));
        let nowhere = |name: &str| Channel { name: name.to_owned(), values: vec![f64::NAN; self.rows] };
        Ok(absent.iter().fold(log, |log, (name, _)| log.with_channel(nowhere(name))))
    }

    /// The log with a further channel, which has a value for each row, NaN where there is none.
    pub(crate) fn with_channel(mut self, channel: Channel) -> Self {
        debug_assert_eq!(channel.values.len(), self.rows);
        self.missing.push(Contents::of(&channel.values).missing);
        self.channels.push(channel);
        self
    }

    /// Whether it is several logs as one, which have no common clock.
    pub(crate) fn is_joined(&self) -> bool {
        !self.boundaries.is_empty()
    }

    /// Seconds from the row before a row (0-based) to it.
    pub(crate) fn step_to(&self, row: usize) -> f64 {
        self.time.as_ref().map_or(self.sample_time, |time| time[row] - time[row - 1])
    }

    /// The number of rows, at least 1.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Seconds from one row to the next.
    pub fn sample_time(&self) -> f64 {
        self.sample_time
    }

    /// The clock, in seconds, where the log came with one.
    pub fn time(&self) -> Option<&[f64]> {
        self.time.as_deref()
    }

    /// Seconds from the first row to a row (0-based); of a [part](Self::part), from that of the whole log.
    pub(crate) fn elapsed(&self, row: usize) -> f64 {
        self.before
            + match &self.time {
                Some(time) => time[row] - time[0],
                None => row as f64 * self.sample_time,
            }
    }

    /// Seconds from the first row of the log that this one was cut from to its own.
    pub fn before(&self) -> f64 {
        self.before
    }

    /// The log with the values of its channels changed in place, side by side.
    pub(super) fn changed(mut self, change: impl Fn(&mut [f64]) + Sync) -> Self {
        let change = |channel: &mut Channel| {
            change(&mut channel.values);
            Contents::of(&channel.values).missing
        };
        self.missing = self.channels.par_iter_mut().map(change).collect();
        self
    }

    /// The channels in their order.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// The channel of a name.
    ///
    /// # Errors
    /// [`Error::Data`] that lists the channels there are.
    pub fn channel(&self, name: &str) -> Result<&Channel, Error> {
        Ok(&self.channels[self.place(name)?])
    }

    /// In how many rows the channel of a name misses its value.
    ///
    /// # Errors
    /// As for [`channel`](Self::channel).
    pub(crate) fn missing(&self, name: &str) -> Result<usize, Error> {
        Ok(self.missing[self.place(name)?])
    }

    fn place(&self, name: &str) -> Result<usize, Error> {
        self.channels.iter().position(|channel| channel.name == name).ok_or_else(|| {
            let names: Vec<&str> = self.channels.iter().map(|channel| channel.name.as_str()).collect();
            Error::in_channel(
                name,
                None,
                format!("there is no channel '{name}'; there are: {}", names.join(", ")),
            )
        })
    }

    /// Whether the log has a channel of this name.
    pub fn has(&self, name: &str) -> bool {
        self.channels.iter().any(|channel| channel.name == name)
    }

    /// The last rows of which all named channels repeat one value, as padding does: at least 20 and a hundredth of all.
    ///
    /// # Errors
    /// [`Error::Data`] for a name that is not there.
    pub(crate) fn padding(&self, names: &[&str]) -> Result<Option<Padding>, Error> {
        let mut last = self.rows;
        for name in names {
            let values = &self.channel(name)?.values;
            let same = values.iter().rev().take_while(|value| Some(*value) == values.last()).count();
            last = last.min(same);
        }
        Padding::of(self.rows, last)
    }

    /// How many gaps the clock has, not counting where another log begins.
    pub fn gaps(&self) -> usize {
        self.starts.len() - self.boundaries.len()
    }

    /// The segments of consecutive rows inside `parts` in which none of the named channels misses a value
    /// and the clock has no gap, as 0-based ranges.
    ///
    /// # Errors
    /// [`Error::Data`] for a name that is not there.
    pub(crate) fn segments(&self, names: &[&str], parts: &[Rows]) -> Result<Vec<Range<usize>>, Error> {
        self.check_uniform()?;
        let mut channels = Vec::new();
        for name in names {
            let place = self.place(name)?;
            // Those that miss nothing need not be searched.
            if self.missing[place] > 0 {
                channels.push(self.channels[place].values.as_slice());
            }
        }
        Ok(self.between_gaps(&channels, parts))
    }

    /// The same for the values of some of its channels.
    pub(crate) fn segments_of(&self, channels: &[&[f64]], parts: &[Rows]) -> Vec<Range<usize>> {
        let channels: Vec<&[f64]> = channels.iter().copied().filter(|values| misses(values)).collect();
        self.between_gaps(&channels, parts)
    }

    /// The same for those of them that miss a value somewhere.
    fn between_gaps(&self, channels: &[&[f64]], parts: &[Rows]) -> Vec<Range<usize>> {
        let mut segments = Vec::new();
        for part in parts {
            let part = part.positions();
            let mut edges = vec![part.start];
            edges.extend(
                self.starts.iter().copied().filter(|start| part.contains(start) && *start > part.start),
            );
            edges.push(part.end);
            for pair in edges.windows(2) {
                let mut first = pair[0];
                let rows = if channels.is_empty() { pair[1]..pair[1] } else { pair[0]..pair[1] };
                for row in rows {
                    if channels.iter().any(|values| values[row].is_nan()) {
                        if first < row {
                            segments.push(first..row);
                        }
                        first = row + 1;
                    }
                }
                if first < pair[1] {
                    segments.push(first..pair[1]);
                }
            }
        }
        segments
    }

    /// The log without the values of a channel at some of its rows (from 1), in place.
    pub(crate) fn forget(&mut self, name: &str, rows: &[usize]) {
        let Some(place) = self.channels.iter().position(|channel| channel.name == name) else { return };
        let values = &mut self.channels[place].values;
        for row in rows.iter().filter_map(|row| row.checked_sub(1)) {
            values[row] = f64::NAN;
        }
        self.missing[place] = Contents::of(values).missing;
    }

    /// The log with an offset taken from one of its channels, in place.
    pub(crate) fn remove(&mut self, name: &str, offset: &Offset) {
        let Some(position) = self.channels.iter().position(|channel| channel.name == name) else {
            return;
        };
        let mut values = std::mem::take(&mut self.channels[position].values);
        if offset.slope == 0.0 {
            values.iter_mut().for_each(|value| *value -= offset.level);
        } else {
            for (row, value) in values.iter_mut().enumerate() {
                *value -= offset.at(self.elapsed(row));
            }
        }
        self.channels[position].values = values;
    }
}

impl Interpolation {
    /// The same for a channel with these values: one of the other two.
    pub(super) fn of(self, values: &[f64]) -> Self {
        if self != Self::Auto {
            return self;
        }
        let pairs = values.windows(2).filter(|pair| !pair[0].is_nan() && !pair[1].is_nan());
        let (still, all) =
            pairs.fold((0, 0), |(still, all), pair| (still + usize::from(pair[0] == pair[1]), all + 1));
        if 2 * still > all { Self::Hold } else { Self::Linear }
    }

    /// The value at `instant`, which lies at or after sample `left` and before the next.
    pub(super) fn read(self, time: &[f64], values: &[f64], left: usize, instant: f64) -> f64 {
        let value = values[left];
        match (self, time.get(left + 1), values.get(left + 1)) {
            (Self::Linear, Some(next_time), Some(next)) if instant > time[left] => {
                let fraction = (instant - time[left]) / (next_time - time[left]);
                value + fraction * (next - value)
            }
            _ => value,
        }
    }
}

/// Checks names, lengths and infinities; gives the number of rows.
pub(crate) fn check(channels: &[Channel]) -> Result<usize, Error> {
    Ok(Checked::new(channels)?.rows)
}

/// Channels without infinities that go together.
struct Checked {
    rows: usize,
    /// In how many of them each channel misses its value.
    missing: Vec<usize>,
}

impl Checked {
    fn new(channels: &[Channel]) -> Result<Self, Error> {
        let rows = channels.first().map_or(0, |channel| channel.values.len());
        if rows == 0 {
            return Err(Error::data("the log has no rows"));
        }
        let mut names = HashSet::with_capacity(channels.len());
        // On this thread: a forked process makes logs, and has none of its parent's threads.
        let contents: Vec<Contents> = channels.iter().map(|channel| Contents::of(&channel.values)).collect();
        for (channel, contents) in channels.iter().zip(&contents) {
            let name = channel.name.as_str();
            if !names.insert(name) {
                return Err(Error::in_channel(name, None, format!("two channels are called '{name}'")));
            }
            if channel.values.len() != rows {
                let message =
                    format!("channel '{name}' has {} rows, the others have {rows}", channel.values.len());
                return Err(Error::in_channel(name, None, message));
            }
            if let Some(row) = contents.infinite {
                let message = format!("channel '{name}' is infinite in row {}", row + 1);
                return Err(Error::in_channel(name, Some(row + 1), message));
            }
        }
        Ok(Self { rows, missing: contents.iter().map(|contents| contents.missing).collect() })
    }
}

/// What there is among values besides finite numbers.
struct Contents {
    /// The first that is infinite.
    infinite: Option<usize>,
    /// How many are missing.
    missing: usize,
}

impl Contents {
    fn of(values: &[f64]) -> Self {
        let mut missing = 0;
        // Whole blocks at once: without a way out in between they are looked at side by side.
        let infinite = values.chunks(1024).position(|block| {
            let infinite = block.iter().fold(false, |any, value| any | value.is_infinite());
            missing += block.iter().map(|value| u64::from(value.is_nan())).sum::<u64>() as usize;
            infinite
        });
        let infinite = infinite.and_then(|block| {
            let first = 1024 * block;
            Some(first + values[first..].iter().position(|value| value.is_infinite())?)
        });
        Self { infinite, missing }
    }
}

/// The runs of samples among `rows` in which no value is missing.
pub(crate) fn measured(values: &[f64], rows: &Range<usize>) -> Vec<Range<usize>> {
    let own = &values[rows.clone()];
    if !misses(own) {
        return if own.is_empty() { Vec::new() } else { vec![rows.clone()] };
    }
    let mut next = rows.start;
    let runs = own.chunk_by(|a, b| a.is_nan() == b.is_nan()).map(|run| {
        next += run.len();
        (run[0].is_nan(), next - run.len()..next)
    });
    runs.filter(|(missing, _)| !missing).map(|(_, run)| run).collect()
}

/// Whether a value is missing.
fn misses(values: &[f64]) -> bool {
    // Whole blocks at once: without a way out in between they are compared side by side.
    values.chunks(1024).any(|block| block.iter().fold(false, |missing, value| missing | value.is_nan()))
}
