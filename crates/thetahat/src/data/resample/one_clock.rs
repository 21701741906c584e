//! Recordings whose clocks differ, on one clock: the topics of a flight or of a robot.

use super::super::regular::Regular;
use super::super::{Channel, GAP, Interpolation, Log, Recording, Times};
use super::{Grid, Resample, Resampling, check, median_step, short, steps};
use crate::Error;

/// A recording of changes has at least this part of its steps longer than 1.5 medians, and at most this many values for
/// each that differs from all before it.
const LONG: f64 = 0.05;
const VALUES_FOR_A_LEVEL: usize = 2;

/// A recording with its times, and its median step.
struct Part {
    recording: Recording,
    time: Vec<f64>,
    step: f64,
    /// Which channels are recorded where they change.
    on_change: Vec<bool>,
}

/// Whether a channel is recorded where it changes, and not at each step: no value is that of the message before, there
/// are few levels, and some of them last.
fn is_on_change(values: &[f64], time: &[f64], step: f64) -> bool {
    let long = steps(time).filter(|own| *own > GAP * step).count();
    if (long as f64) < LONG * time.len() as f64 || values.windows(2).any(|pair| pair[0] == pair[1]) {
        return false;
    }
    let mut levels = values.to_vec();
    levels.sort_unstable_by(f64::total_cmp);
    levels.dedup();
    VALUES_FOR_A_LEVEL * levels.len() <= values.len()
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
        let on_change =
            recording.channels.iter().map(|channel| is_on_change(&channel.values, &time, step)).collect();
        Ok(Self { recording, time, step, on_change })
    }

    /// Whether all its channels are recorded where they change: its last value holds, and its steps are no rate.
    fn is_on_change(&self) -> bool {
        self.on_change.iter().all(|on_change| *on_change)
    }

    /// The values of its channels at the instants.
    fn read(self, grid: &Grid, how: &Resample) -> Result<Vec<Channel>, Error> {
        let Self { recording, time, on_change, .. } = self;
        let hold = Resample { interpolation: Interpolation::Hold, anti_alias: false, ..*how };
        let held = |on_change: bool| on_change && how.interpolation == Interpolation::Auto;
        // Each kind by itself, as missing values of one count for all that are filtered together.
        let mut channels: Vec<Option<Channel>> = recording.channels.into_iter().map(Some).collect();
        for (holds, how) in [(true, &hold), (false, how)] {
            let places: Vec<usize> =
                (0..channels.len()).filter(|&place| held(on_change[place]) == holds).collect();
            let own: Vec<Channel> = places.iter().filter_map(|&place| channels[place].take()).collect();
            if own.is_empty() {
                continue;
            }
            for (place, channel) in places.into_iter().zip(grid.read(own, &time, how)?) {
                channels[place] = Some(channel);
            }
        }
        Ok(channels.into_iter().flatten().collect())
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
    /// Recordings with clocks of their own, of which the times count alike, on one uniform clock, from where the last
    /// of them begins to where the first ends. Without `how` the step is about the usual one of the fastest, and each
    /// channel is read its own way.
    ///
    /// A channel that is recorded only where it changes, as its few levels and its uneven steps show, is held wherever
    /// channels are read their own way, also after its last change.
    ///
    /// Each recording is read as [`Log::resampled`] reads it: with an anti-alias filter where `how` asks for one and it
    /// applies. Gives with the log how it was made; the rows are those of the longest recording, the filter is the
    /// longest.
    ///
    /// # Errors
    /// As for [`Log::resampled`]; [`Error::Data`] for recordings without a time in common, and [`Error::Argument`] for
    /// none at all.
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
        // Those that have a rate, if there are any.
        let own_way = how.is_none_or(|how| how.interpolation == Interpolation::Auto);
        let is_paced = |part: &&Part| !part.is_on_change() || !own_way;
        let has_pace = parts.iter().any(|part| is_paced(&part));
        let paced = || parts.iter().filter(|part| !has_pace || is_paced(part));
        let begins = parts.iter().max_by(|a, b| a.first().total_cmp(&b.first()));
        let ends = paced().min_by(|a, b| a.last().total_cmp(&b.last()));
        let fastest = paced().min_by(|a, b| a.step.total_cmp(&b.step));
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
        for part in parts {
            if let Some(filter) = how.filter_for(&part.time)? {
                let longest = resampling.anti_alias.get_or_insert(filter);
                longest.taps = longest.taps.max(filter.taps);
            }
            channels.extend(part.read(&grid, &how)?);
        }
        check(&channels)?;
        Ok((Self::on_clock(channels, grid.instants, how.step), resampling))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::assert_refused;

    fn part(name: &str, time: Vec<f64>, values: Vec<f64>) -> Recording {
        let channels = vec![Channel { name: name.into(), values }];
        Recording { channels, times: Times::Measured(time) }
    }

    /// So many samples from a time on.
    fn times(first: f64, step: f64, count: u32) -> Vec<f64> {
        (0..count).map(|k| first + step * f64::from(k)).collect()
    }

    #[test]
    fn a_smooth_channel_is_read_between_its_samples_and_a_stepped_one_holds() {
        let fast = times(0.013, 0.01, 400);
        let slow = times(0.0, 0.1, 41);
        let levels: Vec<f64> = (0..41).map(|k| f64::from(k / 4 % 2)).collect();
        let u = part("u", slow.clone(), levels.clone());
        let y = part("y", fast.clone(), fast.iter().map(|t| 3.0 * t).collect());
        let (log, how) = Log::on_one_clock(vec![u, y], None).unwrap();
        assert_eq!(
            (how.step, how.interpolation, how.rows, how.anti_alias),
            (0.01, Interpolation::Auto, 400, None)
        );
        assert_eq!((log.time().unwrap()[0], log.sample_time(), log.rows()), (0.013, 0.01, 399));
        for (row, t) in log.time().unwrap().iter().enumerate() {
            let expected = levels[(t / 0.1 + 1e-9).floor() as usize];
            assert_eq!(log.channels()[0].values[row], expected, "{t}");
            assert!((log.channels()[1].values[row] - 3.0 * t).abs() < 1e-9, "{t}");
        }
    }

    #[test]
    fn a_step_is_asked_for_and_what_it_cannot_show_is_filtered() {
        let fast = times(0.0, 0.001, 4000);
        let sine = |hertz: f64| fast.iter().map(|t| (std::f64::consts::TAU * hertz * t).sin()).collect();
        let asked = Resample::new(0.01, Interpolation::Linear);
        let parts =
            vec![part("slow", times(0.0, 0.02, 200), vec![1.0; 200]), part("y", fast.clone(), sine(99.0))];
        let (log, how) = Log::on_one_clock(parts, Some(&asked)).unwrap();
        assert!(how.anti_alias.is_some());
        assert!(log.channels()[1].values[40..350].iter().all(|y| y.abs() < 2e-3));
        assert!(log.channels()[0].values.iter().all(|value| *value == 1.0));
    }

    #[test]
    fn a_gap_of_one_is_missing_in_it_alone() {
        let time: Vec<f64> = times(0.0, 0.1, 20).into_iter().chain(times(4.0, 0.1, 20)).collect();
        let values = time.iter().map(|t| t.sin()).collect();
        let other = times(0.0, 0.1, 60);
        let smooth = other.iter().map(|t| t.cos()).collect();
        let (log, _) =
            Log::on_one_clock(vec![part("a", time, values), part("b", other, smooth)], None).unwrap();
        let missing =
            |channel: usize| log.channels()[channel].values.iter().filter(|value| value.is_nan()).count();
        assert_eq!((missing(0), missing(1)), (20, 0));
    }

    #[test]
    fn what_is_recorded_where_it_changes_holds_until_it_changes_and_to_the_end() {
        // Levels that last for one to nine units.
        let (mut now, mut time, mut values) = (0.0, Vec::new(), Vec::new());
        for k in 0..40_u32 {
            time.push(now);
            values.push(f64::from(k % 3) - 1.0);
            now += 0.1 * f64::from(1 + k * k % 9);
        }
        let fast = times(0.0, 0.02, 2000);
        let y = part("y", fast.clone(), fast.iter().map(|t| t.sin()).collect());
        let last = time.last().copied().unwrap();
        assert!(last < 30.0);
        let (log, how) =
            Log::on_one_clock(vec![part("u", time.clone(), values.clone()), y.clone()], None).unwrap();
        assert_eq!((how.step, log.rows()), (0.02, 2000));
        for (t, u) in log.time().unwrap().iter().zip(&log.channels()[0].values) {
            let place = time.partition_point(|change| *change <= t + 1e-7) - 1;
            assert_eq!(*u, values[place], "{t}");
        }
        // Who asks for straight lines gets them, up to the last change.
        let asked = Resample::new(0.02, Interpolation::Linear);
        let (log, _) = Log::on_one_clock(vec![part("u", time, values), y], Some(&asked)).unwrap();
        assert!(log.time().unwrap().last().is_some_and(|end| *end <= last + 1e-6));
        assert!(log.channels()[0].values.iter().any(|u| u.fract() != 0.0));
    }

    #[test]
    fn what_has_no_time_in_common_or_no_clock_is_refused() {
        let one = || part("a", times(0.0, 0.1, 20), vec![1.0; 20]);
        let late = part("b", times(5.0, 0.1, 20), vec![1.0; 20]);
        let single = part("c", vec![1.0], vec![1.0]);
        let back = part("d", vec![1.0, 0.5], vec![1.0; 2]);
        for (parts, words) in [
            (vec![one(), late], "'b' begins at 5 s, 'a' ends at 1.9 s"),
            (vec![one(), single], "one row has no time step"),
            (vec![one(), back], "time goes back"),
            (vec![one(), one()], "a"),
            (vec![], "there is none"),
        ] {
            assert_refused(Log::on_one_clock(parts, None), words);
        }
    }
}
