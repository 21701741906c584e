//! One step: whether its response can be evaluated, and what is read off it.

use std::ops::Range;

use super::document::{Shape, Step, StepEstimate, StepFigure, StepMethod, StepResponse};
use super::first_order::{crossings, first_order};
use super::influence::Influence;
use super::levels::{self, Jump};
use super::noise::Noise;
use super::response::Response;
use super::second_order::{first_peak, second_order};
use crate::Error;
use crate::data::Rows;
use crate::figures::{fixed, number, three};
use crate::model::Quantity;

/// An output is at rest before a step over all of the level, or over the last part of it, whichever is first.
const PARTS: [f64; 3] = [1.0, 0.5, 0.25];
/// In more than the last of them it moves by no more than this fraction of the step: a longer part has to be worth it.
const RESTS: f64 = 0.002;
/// The final steady state is the last part of the rows after a step; of a response without overshoot all rows after
/// this many rise times, which are six time constants of a first order.
const LAST: f64 = 0.2;
const OVER: f64 = 2.7;
/// Fewer rows are no level and no response.
const BEFORE: usize = 4;
const AFTER: usize = 12;
/// At rest the output moves by no more than this fraction of the step, as far as can be told with this many standard
/// errors.
const MOVES: f64 = 0.015;
const ERRORS: f64 = 3.0;
/// A larger standard error, as a fraction of the step, is that of a transient rather than of noise.
const KNOWN: f64 = 0.03;
/// Nor has a response without overshoot reached its final steady state this many rise times after it began: three time
/// constants of a first order, what noise lets one see or not.
const UNFINISHED: f64 = 1.35;
/// A change of the output is lost in noise below this many standard deviations of it, or this many of its own standard
/// errors.
const LOST: f64 = 2.0;
const LOST_MEAN: f64 = 4.0;
/// What noise makes of a level is rounding below this fraction of the range of the output.
const ROUNDING: f64 = 1e-12;
/// Levels are looked for up to this many times the time to nine tenths of the change.
const PASSED: f64 = 2.0;
/// A rise over fewer steps of the clock is coarse.
const COARSE: f64 = 4.0;

/// A part of a log: the rows that have both values, on their own clock.
#[derive(Debug)]
pub(super) struct Section {
    /// 0-based.
    pub(super) rows: Vec<usize>,
    pub(super) time: Vec<f64>,
    pub(super) input: Vec<f64>,
    /// (y - lowest)/unit.
    pub(super) output: Vec<f64>,
    pub(super) lowest: f64,
    pub(super) unit: f64,
    /// What the output is a multiple of, over the unit; 0 of no step.
    pub(super) step: f64,
}

/// A step with its response or why it has none, and what a reader should know of it.
pub(super) fn evaluated(section: &Section, jump: &Jump) -> Result<(Step, Vec<String>), Error> {
    let rows =
        |range: &Range<usize>| Rows::new(section.rows[range.start] + 1, section.rows[range.end - 1] + 1);
    let first = jump.to.rows.start;
    let (response, refused, mut words) =
        match levels_of(section, jump).and_then(|of| response(section, jump, of)) {
            Ok((response, words)) => (Some(response), None, words),
            Err(why) => (None, Some(why), Vec::new()),
        };
    if jump.taken > 0 && response.is_some() {
        words.push(format!(
            "the input takes {} rows from one level to the other: times count from the first of them",
            jump.taken
        ));
    }
    let step = Step {
        row: section.rows[first] + 1,
        time: section.time[first],
        from: jump.from.value,
        to: jump.to.value,
        before: rows(&jump.from.rows)?,
        after: rows(&jump.to.rows)?,
        refused,
        response,
    };
    Ok((step, words))
}

/// The output before a step and in the final steady state.
struct Levels {
    before: Range<usize>,
    regime: Range<usize>,
    noise: Noise,
    /// Their means.
    values: [f64; 2],
}

impl Levels {
    fn of(section: &Section, before: Range<usize>, regime: Range<usize>) -> Self {
        let part = |rows: &Range<usize>| &section.output[rows.clone()];
        let mean = |rows: &Range<usize>| part(rows).iter().sum::<f64>() / rows.len() as f64;
        Self {
            noise: Noise::of(&[part(&before), part(&regime)], section.step),
            values: [mean(&before), mean(&regime)],
            before,
            regime,
        }
    }

    fn change(&self) -> f64 {
        self.values[1] - self.values[0]
    }

    /// The variances of the means.
    fn variances(&self) -> [f64; 2] {
        [self.noise.of_mean(self.before.len()), self.noise.of_mean(self.regime.len())]
    }
}

/// The levels between which the output moves, or why there are none.
fn levels_of(section: &Section, jump: &Jump) -> Result<Levels, String> {
    let (held, after) = (&jump.from.rows, &jump.to.rows);
    if held.len() < BEFORE || after.len() < AFTER {
        return Err(format!(
            "there are {} rows before it and {} after it; it takes {BEFORE} and {AFTER}",
            held.len(),
            after.len()
        ));
    }
    let tail = |rows: &Range<usize>, part: f64| {
        let count = ((part * rows.len() as f64) as usize).max(BEFORE);
        rows.end - count..rows.end
    };
    let regime = tail(after, LAST);
    let level = |part: f64| Levels::of(section, tail(held, part), regime.clone());
    let levels = level(PARTS[2]);
    let change = levels.change();
    let [first, second] = levels.variances();
    let lost = (LOST * levels.noise.deviation()).max(LOST_MEAN * (first + second).sqrt()).max(ROUNDING);
    if change.abs() <= lost {
        return Err(format!(
            "the output changes by {}, which is lost in its noise (standard deviation {}); make the step larger",
            number(change * section.unit),
            number(levels.noise.deviation() * section.unit)
        ));
    }
    let moves = |rows: &Range<usize>| moves(&section.time[rows.clone()], &section.output[rows.clone()]);
    let size = change.abs();
    let within =
        |(moved, error): (f64, f64), most: f64| moved.abs() <= most * size + ERRORS * error.min(KNOWN * size);
    let percent = |moved: f64| three(100.0 * (moved / change).abs());
    let rests = |part: &f64| within(moves(&tail(held, *part)), if *part > PARTS[2] { RESTS } else { MOVES });
    let Some(part) = PARTS.into_iter().find(rests) else {
        let rows = tail(held, PARTS[2]);
        return Err(format!(
            "the output is not at rest before it: over the last {} rows it still moves by {} % of the change; wait longer before \
             the step",
            rows.len(),
            percent(moves(&rows).0)
        ));
    };
    let moved = moves(&regime);
    if !within(moved, MOVES) {
        return Err(format!(
            "the output does not reach a final steady state: over the last {} rows it still moves by {} % of the change; hold the \
             input longer, or fit a model, which needs no steady state",
            regime.len(),
            percent(moved.0)
        ));
    }
    Ok(level(part))
}

/// By how much the straight line through some values moves over them, and the standard error of that, with the colour
/// of what it leaves; that of white noise at least, as few rows may look less noisy by chance.
fn moves(time: &[f64], values: &[f64]) -> (f64, f64) {
    let count = time.len() as f64;
    let (middle, level) = (time.iter().sum::<f64>() / count, values.iter().sum::<f64>() / count);
    let square: f64 = time.iter().map(|t| (t - middle).powi(2)).sum();
    let span = time[time.len() - 1] - time[0];
    let weights: Vec<f64> = time.iter().map(|t| span * (t - middle) / square).collect();
    let moved: f64 = weights.iter().zip(values).map(|(weight, value)| weight * value).sum();
    let left: Vec<f64> =
        time.iter().zip(values).map(|(t, value)| value - level - moved * (t - middle) / span).collect();
    let noise = Noise::of(&[&left], 0.0);
    let white = noise.deviation().powi(2) * weights.iter().map(|weight| weight * weight).sum::<f64>();
    (moved, noise.variance(&weights).max(white).sqrt())
}

/// What is read off.
type Figures = Vec<(StepFigure, StepMethod, Quantity)>;

/// The response between two levels, and what a reader should know of it; or why there is none.
fn response(section: &Section, jump: &Jump, levels: Levels) -> Result<(StepResponse, Vec<String>), String> {
    let after = jump.to.rows.clone();
    let start = section.time[after.start];
    let time: Vec<f64> = section.time[after.clone()].iter().map(|t| t - start).collect();
    let first = read(&time, &section.output[after.clone()], &levels)?;
    let begins = section.time[levels.regime.start] - start - first.begins;
    if first.shape != Shape::Underdamped && begins < UNFINISHED * first.rise {
        return Err(format!(
            "the output does not reach a final steady state: it rises within {} s, and the last {} rows begin {} s after that \
             began; hold the input longer, or fit a model, which needs no steady state",
            number(first.rise),
            levels.regime.len(),
            number(begins)
        ));
    }
    // In a response without overshoot more rows than the last ones may be in the final steady state.
    let over = start + first.begins + OVER * first.rise;
    let from = after.start + section.time[after.clone()].partition_point(|t| *t < over);
    let longer = first.shape != Shape::Underdamped && from < levels.regime.start;
    let (levels, read) = match longer {
        true => {
            let levels = Levels::of(section, levels.before, from..after.end);
            let read = read(&time, &section.output[after.clone()], &levels)?;
            (levels, read)
        }
        false => (levels, first),
    };
    let unit = section.unit;
    let [before, regime] = levels.variances();
    let level = |value: f64, variance: f64| {
        Quantity::new(section.lowest + unit * value, Some(unit * variance.sqrt()))
    };
    let gain = gain(section, jump, &levels);
    if !(gain.value.is_finite() && gain.standard_error.is_some_and(f64::is_finite)) {
        return Err("the gain leaves the range of numbers: give the channels in other units".to_owned());
    }
    let mut figures = vec![(StepFigure::Gain, StepMethod::Regime, gain)];
    figures.extend(read.figures);
    let mut words = read.words;
    let clock = (time[time.len() - 1]) / (time.len() - 1) as f64;
    if read.rise < COARSE * clock {
        words.push(format!(
            "it rises within {} steps of the clock: times are coarse; record faster",
            fixed((read.rise / clock).max(0.0), 1)
        ));
    }
    let response = StepResponse {
        initial: level(levels.values[0], before),
        regime: level(levels.values[1], regime),
        regime_rows: Rows::new(
            section.rows[levels.regime.start] + 1,
            section.rows[levels.regime.end - 1] + 1,
        )
        .map_err(|error| error.to_string())?,
        noise: unit * levels.noise.deviation(),
        correlation: levels.noise.correlation(),
        shape: read.shape,
        misfit: read.misfit,
        estimates: trusted(&figures, read.shape),
    };
    Ok((response, words))
}

/// The change of the output over that of the input, with the errors of all four levels.
fn gain(section: &Section, jump: &Jump, levels: &Levels) -> Quantity {
    let step = jump.to.value - jump.from.value;
    let change = section.unit * levels.change();
    let output = section.unit * levels.variances().iter().sum::<f64>().sqrt() / step;
    let noise = levels::noise(&section.input);
    let held = |level: &levels::Level| 1.0 / level.rows.len() as f64;
    let input = noise * (held(&jump.from) + held(&jump.to)).sqrt() * change / step / step;
    Quantity::new(change / step, Some(output.hypot(input)))
}

/// What is read off a response.
struct Read {
    shape: Shape,
    misfit: Option<f64>,
    rise: f64,
    /// The dead time.
    begins: f64,
    figures: Figures,
    words: Vec<String>,
}

/// Reads off a response with these levels all but its gain.
fn read(time: &[f64], output: &[f64], levels: &Levels) -> Result<Read, String> {
    let change = levels.change();
    let response = Response {
        time,
        values: output.iter().map(|value| (value - levels.values[0]) / change).collect(),
        noise: &levels.noise,
        change,
        levels: levels.variances(),
    };
    let quantity = |figure: &Influence| Quantity::new(figure.value, Some(response.spread(figure)));
    let unusual = || {
        "its response does not rise from one level to the other, so that no way of reading it applies"
            .to_owned()
    };
    let peak = first_peak(&response);
    if peak.as_ref().is_some_and(|peak| peak.above.value >= 1.0) {
        return Err("the output overshoots by more than its whole change, which no damped second order does; fit a model".to_owned());
    }
    let (middle, rows) = response.half_time().ok_or_else(unusual)?;
    let smoothed = response.smoothed(rows / 4);
    let passed = smoothed.iter().position(|s| *s > 0.9).map_or(middle, |row| time[row]);
    let end = match &peak {
        Some(peak) => peak.time.value,
        None => PASSED * passed,
    };
    if response.time_below(0.9, end) <= response.time_below(0.1, end) {
        return Err("the output goes from one level to the other within one step of the clock, so that there is no transient to read; \
                    record faster"
            .to_owned());
    }
    let levels = crossings(&response, end).ok_or_else(unusual)?;
    let (shape, misfit, found) = match &peak {
        Some(peak) => {
            let half = response.crossing(0.5, end, levels.scale, end).ok_or_else(unusual)?;
            (Shape::Underdamped, None, second_order(&response, peak, &half))
        }
        None => first_order(&response, &levels)
            .map(|of| (of.shape, Some(of.misfit), of.figures))
            .ok_or_else(unusual)?,
    };
    let finite = |of: &Influence| of.value.is_finite() && response.spread(of).is_finite();
    if !found.iter().all(|(_, _, figure)| finite(figure)) {
        return Err(unusual());
    }
    let begins = found
        .iter()
        .find(|(figure, method, _)| (*figure, *method) == (StepFigure::DeadTime, StepMethod::TwoPoints))
        .map_or(0.0, |(_, _, figure)| figure.value);
    let mut figures: Figures = Vec::new();
    if let Some((at, spread)) = response.leaves_noise(levels.scale) {
        figures.push((StepFigure::DeadTime, StepMethod::NoiseBand, Quantity::new(at, Some(spread))));
    }
    figures.extend(found.iter().map(|(figure, method, of)| (*figure, *method, quantity(of))));
    let mut words = Vec::new();
    match levels.rise.filter(finite) {
        Some(rise) => figures.push((StepFigure::RiseTime, StepMethod::Crossings, quantity(&rise))),
        None => words
            .push("noise hides where the output passes 10 % and 90 % of its change: no rise time".to_owned()),
    }
    match response.settles(levels.scale).filter(finite) {
        Some(settles) => figures.push((StepFigure::SettlingTime, StepMethod::Crossings, quantity(&settles))),
        None => words.push(
            "noise hides when the output stays within 2 % of its final steady state: no settling time"
                .to_owned(),
        ),
    }
    Ok(Read { shape, misfit, rise: levels.scale, begins, figures, words })
}

/// The estimates with those to trust, which the shape says; of two frequencies the one with the smaller standard error.
fn trusted(figures: &Figures, shape: Shape) -> Vec<StepEstimate> {
    let error = |method| {
        let own =
            figures.iter().find(|(figure, of, _)| (*figure, *of) == (StepFigure::NaturalFrequency, method));
        own.and_then(|(_, _, value)| value.standard_error).unwrap_or(f64::INFINITY)
    };
    let is_trusted = |figure, method| match figure {
        StepFigure::TimeConstant => match shape {
            Shape::FirstOrder => method == StepMethod::WeightedAverage,
            Shape::Overdamped | Shape::Underdamped => method == StepMethod::TwoPoints,
        },
        StepFigure::DeadTime => method == StepMethod::TwoPoints,
        StepFigure::Damping => method == StepMethod::Peak,
        StepFigure::NaturalFrequency => {
            let peaks = error(StepMethod::TwoPeaks) < error(StepMethod::Peak);
            method == if peaks { StepMethod::TwoPeaks } else { StepMethod::Peak }
        }
        // There is one way.
        StepFigure::Gain
        | StepFigure::RiseTime
        | StepFigure::SettlingTime
        | StepFigure::Overshoot
        | StepFigure::PeakTime
        | StepFigure::Period => true,
    };
    let mut all: Vec<StepEstimate> = figures
        .iter()
        .map(|&(figure, method, value)| StepEstimate {
            figure,
            method,
            value,
            trusted: is_trusted(figure, method),
        })
        .collect();
    all.sort_by_key(|of| of.figure);
    all
}
