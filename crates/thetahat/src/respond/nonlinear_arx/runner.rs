//! A nonlinear ARX model laid out for runs along signals.

use std::ops::Range;

use rayon::prelude::*;

use crate::model::{ChannelExpression, Evaluator, ExpressionBuffer, NonlinearArxModel};

/// A free run beyond this many times the largest output of the fit is lost.
const LOST: f64 = 1e6;
/// Outputs that are fed back are kept within this many times the range of the estimation rows, about its middle, where
/// that is asked for.
const RANGE: f64 = 1.1;

/// A model laid out for runs along signals, which are deviations from its offsets.
#[derive(Debug)]
pub(crate) struct Runner<'m> {
    pub(super) model: &'m NonlinearArxModel,
    /// g of each output, and which of all parameters are its own.
    pub(super) evaluators: Vec<Evaluator>,
    pub(super) places: Vec<Range<usize>>,
    /// For each regressor the signal (outputs, inputs, expressions), the lag and the scale.
    pub(super) taps: Vec<(usize, usize, f64)>,
    pub(super) expressions: Vec<ChannelExpression>,
    /// What outputs and inputs are measured from, and what each signal is where all of these are at their levels.
    levels: Vec<f64>,
    rest: Vec<f64>,
    /// The longest lag of any output, and that of any signal.
    pub(super) output_lags: usize,
    pub(super) lags: usize,
}

/// Signals as deviations, with a value for each row of a log.
#[derive(Debug, Clone)]
pub(super) struct Signals<'l> {
    pub(super) outputs: Vec<&'l [f64]>,
    pub(super) inputs: Vec<&'l [f64]>,
    pub(super) expressions: Vec<Vec<f64>>,
}

impl Signals<'_> {
    fn of(&self, source: usize) -> &[f64] {
        let inputs = source.checked_sub(self.outputs.len());
        match (inputs, inputs.and_then(|place| place.checked_sub(self.inputs.len()))) {
            (_, Some(place)) => &self.expressions[place],
            (Some(place), None) => self.inputs[place],
            (None, _) => self.outputs[source],
        }
    }
}

/// What a free run says.
#[derive(Debug)]
pub(super) struct Run {
    /// Each output over the rows of the run, NaN where it left the range of sense.
    pub(super) outputs: Vec<Vec<f64>>,
    /// How many of these values were kept within the range of the estimation rows.
    pub(super) clamped: usize,
}

impl<'m> Runner<'m> {
    pub(crate) fn new(model: &'m NonlinearArxModel) -> Self {
        let places = model.places();
        let each = model.maps.iter().zip(&places);
        let evaluators = each.map(|(map, places)| {
            let own = model.parameters.get(places.clone()).unwrap_or_default();
            Evaluator::new(&map.functions, own.iter().map(|parameter| parameter.value).collect())
        });
        let taps: Vec<(usize, usize, f64)> = (model.sources().into_iter().zip(&model.regressors))
            .map(|(source, regressor)| (source, regressor.lag, regressor.scale))
            .collect();
        // A model that was checked has no other.
        let expressions = model.read_expressions().unwrap_or_default();
        let channels = model.outputs.iter().chain(&model.inputs);
        let levels: Vec<f64> = channels.map(|signal| signal.offset.level).collect();
        let mut buffer = ExpressionBuffer::default();
        let at_levels = expressions
            .iter()
            .zip(&model.expressions)
            .map(|(expression, signal)| expression.value(&levels, &mut buffer) - signal.offset.level);
        let rest = std::iter::repeat_n(0.0, levels.len()).chain(at_levels).collect();
        let mut runner = Self {
            evaluators: evaluators.collect(),
            places,
            rest,
            levels,
            expressions,
            output_lags: 0,
            lags: model.lags(),
            taps,
            model,
        };
        let of_outputs = runner.taps.iter().filter(|(source, ..)| runner.is_of_outputs(*source));
        runner.output_lags = of_outputs.map(|(_, lag, _)| *lag).max().unwrap_or(0);
        runner
    }

    pub(super) fn outputs(&self) -> usize {
        self.model.outputs.len()
    }

    /// The expression that a signal is, by its place.
    pub(super) fn expression(&self, source: usize) -> Option<usize> {
        source.checked_sub(self.levels.len())
    }

    /// Whether a signal is an output, or an expression of one.
    fn is_of_outputs(&self, source: usize) -> bool {
        match self.expression(source) {
            Some(place) => self.expressions[place].channels().iter().any(|channel| *channel < self.outputs()),
            None => source < self.outputs(),
        }
    }

    /// The signals with the expressions of these; an expression of a value that is missing is missing.
    pub(super) fn signals<'l>(&self, outputs: Vec<&'l [f64]>, inputs: Vec<&'l [f64]>) -> Signals<'l> {
        let channels: Vec<&[f64]> = outputs.iter().chain(&inputs).copied().collect();
        let each = self.expressions.iter().zip(&self.model.expressions).map(|(expression, signal)| {
            let mut values = expression.along(&channels, &self.levels);
            values.iter_mut().for_each(|value| *value -= signal.offset.level);
            values
        });
        let expressions = each.collect();
        Signals { outputs, inputs, expressions }
    }

    /// The first sample from `from` on before which all outputs were measured as far back as the model reads them.
    pub(super) fn first_known(&self, signals: &Signals<'_>, from: usize, end: usize) -> Option<usize> {
        let known = |t: &usize| {
            let before = *t - self.output_lags..*t;
            signals.outputs.iter().all(|y| y[before.clone()].iter().all(|value| !value.is_nan()))
        };
        (from.max(self.output_lags)..end).find(known)
    }

    /// Runs from sample `rows.start` on, driven by the inputs and by its own outputs. Before it stands what was
    /// measured, or where the run begins `at_rest` nothing. What leaves the range of sense is NaN to the end. With
    /// `clamp` outputs are kept within 1.1 times the range of the estimation rows.
    pub(super) fn run(&self, signals: &Signals<'_>, rows: Range<usize>, at_rest: bool, clamp: bool) -> Run {
        let (mut walk, mut clamped) = (Walk::new(self, true), 0);
        walk.begin(signals, rows.clone(), rows.start, at_rest);
        let limits: Vec<[f64; 2]> = self.model.maps.iter().map(|map| within(map.range, RANGE)).collect();
        let lost = self.model.maps.iter().map(|map| {
            let [low, high] = map.range;
            LOST * low.abs().max(high.abs()).max(map.scale)
        });
        let lost: Vec<f64> = lost.collect();
        let mut next = vec![0.0; self.outputs()];
        for t in rows.clone() {
            walk.read(t);
            self.next(&walk.z, &mut next);
            for (value, [low, high]) in next.iter_mut().zip(&limits).filter(|_| clamp) {
                let kept = value.clamp(*low, *high);
                clamped += usize::from(kept != *value && !value.is_nan());
                *value = kept;
            }
            let sound = next.iter().zip(&lost).all(|(value, lost)| value.abs() <= *lost);
            if !sound || !walk.write(t, &next) {
                // Where an expression of this output is no number there is no next one.
                let left = t + usize::from(sound) - rows.start;
                walk.outputs.iter_mut().for_each(|values| values[self.lags + left..].fill(f64::NAN));
                break;
            }
        }
        let own = |values: Vec<f64>| values[self.lags..].to_vec();
        Run { outputs: walk.outputs.into_iter().map(own).collect(), clamped }
    }

    /// y^ of each output at z.
    pub(super) fn next(&self, z: &[f64], into: &mut [f64]) {
        for ((value, evaluator), map) in into.iter_mut().zip(&self.evaluators).zip(&self.model.maps) {
            *value = map.scale * evaluator.value(z);
        }
    }

    /// The share of samples of which a regressor lies outside the range of the estimation rows.
    pub(super) fn outside(&self, signals: &Signals<'_>, rows: &[Range<usize>]) -> Option<f64> {
        let ends = self.model.regressors.iter().map(|regressor| {
            let [low, high] = regressor.range;
            let rounding = f64::EPSILON * 4.0 * low.abs().max(high.abs());
            (low - rounding, high + rounding)
        });
        let taps: Vec<_> = self.taps.iter().zip(ends).collect();
        let is_beyond = |t: &usize| {
            taps.iter().any(|((source, lag, _), (low, high))| {
                let value = t.checked_sub(*lag).map_or(0.0, |at| signals.of(*source)[at]);
                value < *low || value > *high
            })
        };
        let count: usize = rows.iter().map(Range::len).sum();
        let beyond = rows.par_iter().cloned().flatten().filter(is_beyond).count();
        (count > 0).then(|| beyond as f64 / count as f64)
    }
}

/// So many times a range, about its middle.
pub(crate) fn within([low, high]: [f64; 2], times: f64) -> [f64; 2] {
    let (middle, half) = (f64::midpoint(low, high), times * (high - low) / 2.0);
    [middle - half, middle + half]
}

/// The signals about some rows, as a run reads and writes them: each divided by its scale once, and not for each lag.
#[derive(Debug)]
pub(super) struct Walk<'r, 'm> {
    runner: &'r Runner<'m>,
    /// The signals that are read, with what they are divided by.
    scaled: Vec<(usize, f64)>,
    /// For each regressor that is read its place, where its signal stands in `scaled`, and its lag.
    read: Vec<(usize, usize, usize)>,
    /// Of each the values from the longest lag before the first row on.
    values: Vec<Vec<f64>>,
    /// The same of all outputs, as deviations.
    pub(super) outputs: Vec<Vec<f64>>,
    /// Inputs as they are, and all channels at a row, which expressions are of.
    inputs: Vec<Vec<f64>>,
    channels: Vec<f64>,
    buffer: ExpressionBuffer,
    first: usize,
    /// z at the row that was read last.
    pub(super) z: Vec<f64>,
}

impl<'r, 'm> Walk<'r, 'm> {
    /// `needed`: without the regressors that no map depends on.
    pub(super) fn new(runner: &'r Runner<'m>, needed: bool) -> Self {
        let mut scaled: Vec<(usize, f64)> =
            runner.taps.iter().map(|(source, _, scale)| (*source, *scale)).collect();
        scaled.sort_unstable_by(|one, other| one.0.cmp(&other.0).then(one.1.total_cmp(&other.1)));
        scaled.dedup();
        let place = |own: (usize, f64)| scaled.iter().position(|signal| *signal == own).unwrap_or(0);
        let is_read = |regressor: usize| runner.evaluators.iter().any(|evaluator| evaluator.reads(regressor));
        let read = (runner.taps.iter().enumerate())
            .filter(|(regressor, _)| !needed || is_read(*regressor))
            .map(|(regressor, (source, lag, scale))| (regressor, place((*source, *scale)), *lag))
            .collect();
        Self {
            read,
            values: vec![Vec::new(); scaled.len()],
            outputs: vec![Vec::new(); runner.outputs()],
            inputs: vec![
                Vec::new();
                if runner.expressions.is_empty() { 0 } else { runner.model.inputs.len() }
            ],
            channels: vec![0.0; runner.levels.len()],
            buffer: ExpressionBuffer::default(),
            first: 0,
            z: vec![0.0; runner.taps.len()],
            scaled,
            runner,
        }
    }

    /// Begins at some rows. Outputs, and expressions of them, are known before row `known`; what stands before the
    /// first row of a log, or with `at_rest` before the first of these rows, is at its level.
    pub(super) fn begin(&mut self, signals: &Signals<'_>, rows: Range<usize>, known: usize, at_rest: bool) {
        let (runner, lags) = (self.runner, self.runner.lags);
        self.first = rows.start;
        let from = if at_rest { rows.start } else { rows.start.saturating_sub(lags) };
        let before = lags - (rows.start - from);
        let fill = |into: &mut Vec<f64>, source: usize, scale: f64| {
            let end = if runner.is_of_outputs(source) { known.min(rows.end) } else { rows.end };
            let signal = signals.of(source);
            into.clear();
            into.resize(before, runner.rest[source] / scale);
            into.extend(signal[from..end.min(signal.len())].iter().map(|value| value / scale));
            into.resize(lags + rows.len(), 0.0);
        };
        for (into, (source, scale)) in self.values.iter_mut().zip(&self.scaled) {
            fill(into, *source, *scale);
        }
        for (source, into) in self.outputs.iter_mut().enumerate() {
            fill(into, source, 1.0);
        }
        for (place, into) in self.inputs.iter_mut().enumerate() {
            fill(into, runner.outputs() + place, 1.0);
        }
    }

    /// z(t).
    pub(super) fn read(&mut self, t: usize) {
        let now = t + self.runner.lags - self.first;
        for (regressor, signal, lag) in &self.read {
            self.z[*regressor] = self.values[*signal][now - lag];
        }
    }

    /// Says what the outputs are at row t; gives whether all expressions of them are numbers.
    pub(super) fn write(&mut self, t: usize, outputs: &[f64]) -> bool {
        let now = t + self.runner.lags - self.first;
        for (values, value) in self.outputs.iter_mut().zip(outputs) {
            values[now] = *value;
        }
        if !self.runner.expressions.is_empty() {
            self.look(now);
        }
        let mut sound = true;
        for (values, (source, scale)) in self.values.iter_mut().zip(&self.scaled) {
            if *source < outputs.len() {
                values[now] = outputs[*source] / scale;
            } else if let Some(place) = self.runner.expression(*source)
                && self.runner.is_of_outputs(*source)
            {
                let value = self.runner.expressions[place].value(&self.channels, &mut self.buffer);
                values[now] = (value - self.runner.model.expressions[place].offset.level) / scale;
                sound &= value.is_finite();
            }
        }
        sound
    }

    /// The channels, in their own units, at a place of the window.
    fn look(&mut self, at: usize) {
        let channels = self.outputs.iter().chain(&self.inputs).map(|values| values[at]);
        for ((own, value), level) in self.channels.iter_mut().zip(channels).zip(&self.runner.levels) {
            *own = value + level;
        }
    }

    /// Calls `take` with each output that an expression is of, and the slope by it at row t.
    pub(super) fn expression_slopes(&mut self, place: usize, t: usize, mut take: impl FnMut(usize, f64)) {
        self.look(t + self.runner.lags - self.first);
        let expression = &self.runner.expressions[place];
        let slopes = expression.slopes(&self.channels, &mut self.buffer);
        for (channel, slope) in expression.channels().iter().zip(slopes) {
            if *channel < self.runner.outputs() {
                take(*channel, slope);
            }
        }
    }

    /// The first row.
    pub(super) fn first(&self) -> usize {
        self.first
    }
}
