//! From settings to a test signal.

use std::f64::consts::{PI, TAU};

use thetahat_numerics::random::Random;

use super::multisine::low_crest;
use super::prbs;
use super::waveform::{SignalKind, Waveform};
use crate::Error;
use crate::respond::logarithmic_frequencies;

/// The most values of a signal, over all channels.
const MOST_VALUES: usize = 10_000_000;
/// The longest period that phases are sought for.
const LONGEST_PERIOD: usize = 1 << 17;
/// The longest that is chosen.
const USUAL_PERIOD: usize = 1 << 12;
/// The default number of frequencies of a stepped-sine experiment.
const FREQUENCIES: usize = 10;
/// The lowest of these frequencies has at least this many cycles by default.
const CYCLES: f64 = 4.0;
/// No fewer, of which the first may be a transient.
const LEAST_CYCLES: f64 = 2.0;
/// Samples of the shortest period of a sine.
const SHORTEST: usize = 3;

/// What a test signal has to be.
#[derive(Debug, Clone, PartialEq)]
pub struct SignalPlan {
    /// Its kind, and how long each value is held.
    pub waveform: Waveform,
    /// The lowest and the highest value, in units of the input.
    pub range: [f64; 2],
    /// The root mean square of the deviations from the middle of `range`, instead of the width of that: a power budget.
    /// The signal then leaves the range, or stays inside, as its crest factor says.
    pub rms: Option<f64>,
    /// The lowest and the highest frequency, in radians per second: of multisines, chirps and stepped sines. None: all
    /// that the period has, and of stepped sines those up to half the highest.
    pub band: Option<[f64; 2]>,
    /// How many frequencies there are, each the same factor above the one before: of multisines, where None is all
    /// lines of the period that lie in the band, and of stepped sines, where it is 10, or as many as there is room for.
    pub points: Option<usize>,
    /// How many samples.
    pub length: usize,
    /// The number of samples after which the signal repeats itself. None: of a PRBS the longest that fits into the
    /// length; of a multisine 4096 at most; else the whole length, and no repetition of what is random.
    pub period: Option<usize>,
    /// How many signals without correlation over a period.
    pub channels: usize,
    /// Which of the random ones: the same seed gives the same signal.
    pub seed: u64,
    /// Seconds from one sample to the next.
    pub sample_time: f64,
}

impl SignalPlan {
    /// One channel of 1023 samples between -1 and 1, a second apart: a whole period of a PRBS of order 10.
    pub fn new(waveform: impl Into<Waveform>) -> Self {
        Self {
            waveform: waveform.into(),
            range: [-1.0, 1.0],
            rms: None,
            band: None,
            points: None,
            length: prbs::length(10),
            period: None,
            channels: 1,
            seed: 0,
            sample_time: 1.0,
        }
    }
}

/// A test signal: as many of its samples as somebody wants.
///
/// A longer experiment begins with the samples of a shorter one.
#[derive(Debug, Clone, PartialEq)]
pub struct TestSignal {
    waveform: Waveform,
    channels: usize,
    seed: u64,
    hold: usize,
    /// One period of values in -1 … 1 for each channel; none for what is random and never repeats itself.
    unit: Option<Vec<Vec<f64>>>,
    frequencies: Vec<f64>,
    /// What -1 and 1 stand for.
    levels: [f64; 2],
}

impl TestSignal {
    /// Makes the signal of a plan.
    ///
    /// - `prbs`: [maximum length](SignalKind::Prbs), registers of order 2 to 16; channels are shifts of one sequence by
    ///   the same fraction of its period, so that their correlation is -1/L at every lag below that.
    /// - `rbs`, `white`: independent values, drawn anew after the clock period; channels are independent.
    /// - `multisine`: sinusoids of one amplitude on lines of the period, without the lines at 0 and at half the
    ///   sampling frequency, with phases that make the peak low (Van der Ouderaa, Schoukens and Renneboog 1988);
    ///   channels have every m-th line each, so that they are not correlated at any lag.
    /// - `chirp`: sin of a phase whose slope rises from the lower to the upper end of the band within a period;
    ///   channels are shifts.
    /// - `sines`: each frequency for the same time, with a period rounded to whole samples; one channel after the
    ///   other, the others in the middle of the range.
    /// - `steps`: up and down with the dwell of the first channel, twice that of the second, and so on (Rademacher
    ///   functions): channels are orthogonal over a period. Without a dwell there is one step for one channel, in the
    ///   middle of the length.
    ///
    /// Cost: O(N) for N samples; of a multisine O(P log P) for a period of P samples, up to 20000 times.
    ///
    /// # Errors
    /// [`Error::Argument`] if a setting makes no sense, does not go with the kind of signal, or with another one.
    ///
    /// ```
    /// use thetahat::design::{SignalKind, SignalPlan, TestSignal};
    ///
    /// let plan = SignalPlan { length: 15, range: [0.0, 5.0], ..SignalPlan::new(SignalKind::Prbs) };
    /// let signal = TestSignal::new(&plan)?;
    /// let u = &signal.values(15)[0];
    /// // One more of the low level: eight of fifteen.
    /// assert_eq!((signal.period(), u.iter().filter(|value| **value == 0.0).count()), (Some(15), 8));
    /// assert_eq!(u.iter().sum::<f64>(), 7.0 * 5.0);
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn new(plan: &SignalPlan) -> Result<Self, Error> {
        check(plan)?;
        let Made { hold, unit, frequencies } = made(plan)?;
        let mut signal = Self {
            waveform: plan.waveform,
            channels: plan.channels,
            seed: plan.seed,
            hold,
            unit,
            frequencies,
            levels: [-1.0, 1.0],
        };
        let [low, high] = plan.range;
        signal.levels = match plan.rms {
            None => plan.range,
            Some(rms) => {
                let reach = rms / signal.unit_rms();
                let middle = 0.5 * low + 0.5 * high;
                [middle - reach, middle + reach]
            }
        };
        if signal.levels.iter().all(|level| level.is_finite()) {
            Ok(signal)
        } else {
            Err(Error::argument("rms", "the values leave the range of numbers; ask for a smaller one"))
        }
    }

    /// The root mean square of the values in -1 … 1: over a period, or as expected.
    fn unit_rms(&self) -> f64 {
        match (&self.unit, self.waveform.kind) {
            (Some(channels), _) => {
                let count = channels.iter().map(Vec::len).sum::<usize>() as f64;
                (channels.iter().flatten().map(|value| value * value).sum::<f64>() / count).sqrt()
            }
            (None, SignalKind::White) => 1.0 / 3.0_f64.sqrt(),
            (None, _) => 1.0,
        }
    }

    /// The first `length` samples of each channel.
    pub fn values(&self, length: usize) -> Vec<Vec<f64>> {
        let [low, high] = self.levels;
        // Both ends are met to the bit.
        let level = |value: f64| low * (0.5 - 0.5 * value) + high * (0.5 + 0.5 * value);
        match &self.unit {
            Some(channels) => {
                let repeated = |period: &Vec<f64>| -> Vec<f64> {
                    period.iter().cycle().take(length).copied().map(level).collect()
                };
                channels.iter().map(repeated).collect()
            }
            None => {
                let each = random(self.waveform.kind, self.hold, length, self.channels, self.seed);
                each.into_iter().map(|values| values.into_iter().map(level).collect()).collect()
            }
        }
    }

    /// After how many samples it repeats itself; none for what is random.
    pub fn period(&self) -> Option<usize> {
        self.unit.as_ref().and_then(|channels| channels.first()).map(Vec::len)
    }

    /// For how many samples each value is held.
    pub fn hold(&self) -> usize {
        self.hold
    }

    /// The frequencies of its sinusoids in radians per second: those of a multisine, rising, or of stepped sines, one
    /// after the other. Empty for other kinds.
    pub fn frequencies(&self) -> &[f64] {
        &self.frequencies
    }

    /// The lowest and the highest value that it may have.
    pub fn levels(&self) -> [f64; 2] {
        self.levels
    }
}

/// What a kind of signal has to say of a plan.
struct Made {
    hold: usize,
    unit: Option<Vec<Vec<f64>>>,
    frequencies: Vec<f64>,
}

/// What can be said of a plan whatever its kind.
fn check(plan: &SignalPlan) -> Result<(), Error> {
    let wrong = |argument: &str, message: String| Err(Error::argument(argument, message));
    let SignalPlan { waveform, range: [low, high], length, channels, sample_time, .. } = *plan;
    let word = waveform.kind.word();
    if channels == 0 {
        return wrong("channels", "0: a signal has at least one channel".to_owned());
    }
    if length == 0 {
        return wrong("length", "0: an experiment has at least one sample".to_owned());
    }
    if length.saturating_mul(channels) > MOST_VALUES {
        return wrong(
            "length",
            format!(
                "{length} samples of {channels} channels are more than {MOST_VALUES} values; ask for fewer"
            ),
        );
    }
    if !(low.is_finite() && high.is_finite() && low < high) {
        return wrong("range", format!("{low} to {high}: give a level and a higher one, both finite"));
    }
    if let Some(rms) = plan.rms
        && !(rms.is_finite() && rms > 0.0)
    {
        return wrong("rms", format!("{rms}: not a positive number"));
    }
    if !(sample_time.is_finite() && sample_time > 0.0) {
        return wrong("sample-time", format!("{sample_time}: not a positive number of seconds"));
    }
    if let Some(period) = plan.period
        && !(2..=length).contains(&period)
    {
        return wrong(
            "period",
            format!(
                "{period} samples: give at least 2, and no more than the {length} of the experiment (`length`)"
            ),
        );
    }
    if let Some([first, last]) = plan.band {
        let highest = PI / sample_time;
        if !waveform.kind.has_band() {
            return wrong(
                "band",
                format!(
                    "a {word} signal has no band: for how long each value is held says how fast it is, such as {word}:4"
                ),
            );
        }
        if !(first >= 0.0 && first < last && last <= highest * (1.0 + 4.0 * f64::EPSILON)) {
            return wrong(
                "band",
                format!(
                    "{first} to {last} rad/s: give a frequency and a higher one, up to {highest} rad/s, half the sampling \
                     frequency"
                ),
            );
        }
    }
    if let Some(points) = plan.points {
        if !waveform.kind.has_points() {
            return wrong("points", format!("a {word} signal has no number of frequencies; leave it out"));
        }
        if points < 2 {
            return wrong("points", format!("{points}: give at least 2 frequencies"));
        }
    }
    Ok(())
}

fn made(plan: &SignalPlan) -> Result<Made, Error> {
    let none = Vec::new;
    let hold = plan.waveform.hold.unwrap_or(1);
    match plan.waveform.kind {
        SignalKind::Prbs => Ok(Made { hold, unit: Some(binary(plan, hold)?), frequencies: none() }),
        kind @ (SignalKind::Rbs | SignalKind::White) => {
            let unit = plan.period.map(|period| random(kind, hold, period, plan.channels, plan.seed));
            Ok(Made { hold, unit, frequencies: none() })
        }
        SignalKind::Multisine => multisine(plan),
        SignalKind::Chirp => Ok(Made { hold: 1, unit: Some(chirp(plan)), frequencies: none() }),
        SignalKind::Sines => sines(plan),
        SignalKind::Steps => {
            let (hold, unit) = steps(plan)?;
            Ok(Made { hold, unit: Some(unit), frequencies: none() })
        }
    }
}

/// Independent values, each held: a stream of random numbers for each channel.
fn random(kind: SignalKind, hold: usize, length: usize, channels: usize, seed: u64) -> Vec<Vec<f64>> {
    let of = |channel: u64| {
        let mut random = Random::of(seed, channel);
        let mut values = Vec::with_capacity(length);
        while values.len() < length {
            let uniform = 2.0 * random.uniform() - 1.0;
            let value = if kind == SignalKind::White { uniform } else { 1.0_f64.copysign(uniform) };
            values.resize((values.len() + hold).min(length), value);
        }
        values
    };
    (0..channels as u64).map(of).collect()
}

/// A period of a PRBS for each channel.
fn binary(plan: &SignalPlan, hold: usize) -> Result<Vec<Vec<f64>>, Error> {
    let [shortest, longest] = prbs::ORDERS.map(prbs::length);
    let order = match plan.period {
        Some(period) => {
            let order = (period % hold == 0).then_some(period / hold).and_then(prbs::order_of);
            order.ok_or_else(|| {
                let near = prbs::longest_order(period / hold).unwrap_or(prbs::ORDERS[0]);
                Error::argument(
                    "period",
                    format!(
                        "{period} samples: a PRBS repeats itself after 2^n - 1 values, n = 2 … 16, such as {} samples here",
                        prbs::length(near) * hold
                    ),
                )
            })?
        }
        None => prbs::longest_order(plan.length / hold).ok_or_else(|| {
            Error::argument(
                "length",
                format!(
                    "{} samples hold no period of a PRBS, of {shortest} to {longest} values of {hold} samples each; give at least \
                     {}",
                    plan.length,
                    shortest.saturating_mul(hold)
                ),
            )
        })?,
    };
    let sequence = prbs::sequence(order, plan.seed);
    let values = sequence.len();
    if plan.channels > values {
        return Err(Error::argument(
            "channels",
            format!("{} are more than the {values} shifts of this PRBS; give a longer period", plan.channels),
        ));
    }
    let shifted = |channel: usize| {
        let first = channel * values / plan.channels;
        let each = sequence[first..].iter().chain(&sequence[..first]);
        each.flat_map(|value| std::iter::repeat_n(*value, hold)).collect()
    };
    Ok((0..plan.channels).map(shifted).collect())
}

/// A period of a multisine for each channel, and its frequencies.
fn multisine(plan: &SignalPlan) -> Result<Made, Error> {
    let period = plan.period.unwrap_or(plan.length.min(USUAL_PERIOD));
    if period > LONGEST_PERIOD {
        return Err(Error::argument(
            "period",
            format!("{period} samples: phases are sought for {LONGEST_PERIOD} at most"),
        ));
    }
    // Lines are apart by 2 pi/(P T).
    let apart = TAU / (period as f64 * plan.sample_time);
    let last = period.saturating_sub(1) / 2;
    let nearest = |frequency: f64| frequency / apart;
    let (low, high) = plan.band.map_or((1, last), |[low, high]| {
        // The ends belong to the band, whatever rounding says.
        let (low, high) = (nearest(low) * (1.0 - 1e-9), nearest(high) * (1.0 + 1e-9));
        ((low.ceil() as usize).max(1), (high.floor() as usize).min(last))
    });
    let lines: Vec<usize> = match plan.points {
        _ if low > high => Vec::new(),
        Some(points) if low < high => {
            let spaced = logarithmic_frequencies(low as f64, high as f64, points)?;
            let mut lines: Vec<usize> = spaced.into_iter().map(|line| line.round() as usize).collect();
            lines.dedup();
            lines
        }
        _ => (low..=high).collect(),
    };
    if lines.len() < plan.channels {
        return Err(Error::argument(
            "band",
            format!(
                "{} lines lie in it, {apart} rad/s apart, and each of {} channels needs one; give a wider band or a longer period",
                lines.len(),
                plan.channels
            ),
        ));
    }
    let of = |channel: usize| -> Vec<usize> {
        lines.iter().skip(channel).step_by(plan.channels).copied().collect()
    };
    let unit = (0..plan.channels).map(|channel| low_crest(&of(channel), period, plan.seed ^ channel as u64));
    let unit = Some(unit.collect());
    Ok(Made { hold: 1, unit, frequencies: lines.iter().map(|line| *line as f64 * apart).collect() })
}

/// A period of a chirp for each channel: sin(w0 t + (w1 - w0) t^2/(2 P T)), t from 0 to P T.
fn chirp(plan: &SignalPlan) -> Vec<Vec<f64>> {
    let period = plan.period.unwrap_or(plan.length);
    // In radians a sample.
    let [first, last] = match plan.band {
        Some(band) => band.map(|frequency| frequency * plan.sample_time),
        None => [TAU / period as f64, PI],
    };
    let value = |t: usize| {
        let t = t as f64;
        (first * t + (last - first) * t * t / (2.0 * period as f64)).sin()
    };
    let sweep: Vec<f64> = (0..period).map(value).collect();
    let shifted = |channel: usize| {
        let begin = channel * period / plan.channels;
        [&sweep[begin..], &sweep[..begin]].concat()
    };
    (0..plan.channels).map(shifted).collect()
}

/// How many samples each of some sines has, and the period of each, which falls.
fn cycles(plan: &SignalPlan, period: usize, points: usize) -> Result<(usize, Vec<usize>), Error> {
    let block = period / points.saturating_mul(plan.channels);
    let highest = PI / plan.sample_time;
    let one = TAU / (block as f64 * plan.sample_time);
    let [low, high] = plan.band.unwrap_or([CYCLES * one, 0.5 * highest]);
    if low >= high {
        return Err(Error::argument(
            "points",
            format!(
                "each of {points} frequencies for {} channels would have {block} of the {period} samples, too few for several \
                 cycles; ask for fewer, or give more samples",
                plan.channels
            ),
        ));
    }
    if low < LEAST_CYCLES * one * (1.0 - 1e-9) {
        return Err(Error::argument(
            "band",
            format!(
                "each of {points} frequencies for {} channels has {block} of the {period} samples, and at {low} rad/s less than two \
                 cycles within; begin with a higher one, ask for fewer `points`, or give more samples",
                plan.channels
            ),
        ));
    }
    let samples = |frequency: f64| TAU / (frequency * plan.sample_time);
    // No two of one period.
    let mut cycles: Vec<usize> = Vec::new();
    for frequency in logarithmic_frequencies(low, high, points)? {
        let shorter = cycles.last().map_or(block / 2, |last| last.saturating_sub(1));
        cycles.push((samples(frequency).round() as usize).min(shorter));
    }
    if let Some(short) = cycles.iter().find(|cycle| **cycle < SHORTEST) {
        return Err(Error::argument(
            "points",
            format!(
                "{points} frequencies with periods of whole samples, no two of one, would go down to {short} samples; ask for fewer, or \
                 for a lower or a wider band"
            ),
        ));
    }
    Ok((block, cycles))
}

/// Stepped sines, and their frequencies: those of the first channel, which the others have too. Each has a period of
/// whole samples, so that it repeats itself to the bit and an analysis finds the period.
fn sines(plan: &SignalPlan) -> Result<Made, Error> {
    let period = plan.period.unwrap_or(plan.length);
    let (block, cycles) = match plan.points {
        Some(points) => cycles(plan, period, points)?,
        // As many as there is room for.
        None => {
            let room = (3..=FREQUENCIES).rev().find_map(|points| cycles(plan, period, points).ok());
            room.map_or_else(|| cycles(plan, period, 2), Ok)?
        }
    };
    let sine = |cycle: &usize| -> Vec<f64> {
        // The angle modulo a cycle: later cycles have the bits of the first.
        (0..block).map(|t| (TAU * (t % cycle) as f64 / *cycle as f64).sin()).collect()
    };
    let all: Vec<f64> = cycles.iter().flat_map(sine).collect();
    let of = |channel: usize| {
        let mut values = vec![0.0; period];
        values[channel * all.len()..][..all.len()].copy_from_slice(&all);
        values
    };
    let frequencies = cycles.iter().map(|cycle| TAU / (*cycle as f64 * plan.sample_time)).collect();
    Ok(Made { hold: 1, unit: Some((0..plan.channels).map(of).collect()), frequencies })
}

/// The dwell of steps, and a period for each channel.
fn steps(plan: &SignalPlan) -> Result<(usize, Vec<Vec<f64>>), Error> {
    let SignalPlan { channels, length, period, .. } = *plan;
    // Channel j changes after 2^j dwells: a period has 2^m of them.
    let dwells = u32::try_from(channels).ok().and_then(|channels| 1_usize.checked_shl(channels));
    let room = period.unwrap_or(length);
    let dwells = dwells.filter(|dwells| *dwells <= room).ok_or_else(|| {
        Error::argument(
            "channels",
            format!(
                "{channels} take 2^{channels} steps, more than the {room} samples; ask for fewer channels"
            ),
        )
    })?;
    let hold = plan.waveform.hold.unwrap_or(room / dwells);
    if let Some(period) = period
        && Some(period) != hold.checked_mul(dwells)
    {
        return Err(Error::argument(
            "period",
            format!(
                "{period} samples are not {dwells} times the {hold} that a step is held; leave one of them out"
            ),
        ));
    }
    let last = hold.saturating_mul(dwells / 2);
    if last >= length {
        return Err(Error::argument(
            "signal",
            format!(
                "with values held for {hold} samples, the last channel would change first after {last} of {length}: never; hold them \
                 for fewer"
            ),
        ));
    }
    let whole = 2 * last;
    let value = |channel: usize, t: usize| if (t / hold) >> channel & 1 == 0 { -1.0 } else { 1.0 };
    let of = |channel: usize| (0..whole).map(|t| value(channel, t)).collect();
    Ok((hold, (0..channels).map(of).collect()))
}
