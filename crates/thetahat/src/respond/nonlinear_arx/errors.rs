//! How far predictions of a nonlinear ARX model may be off, as they are run.

use std::ops::Range;

use super::runner::{Runner, Walk};

/// The covariance of the errors of the last outputs along a run, and their slopes by the parameters.
#[derive(Debug)]
pub(super) struct Errors {
    /// Outputs, and how many samples of them are in memory.
    outputs: usize,
    lags: usize,
    /// The covariance of e, and that of the parameters; none where it is not known. Row by row.
    noise: Vec<Vec<f64>>,
    spread: Option<Vec<Vec<f64>>>,
    /// The covariance of the errors of the last outputs, the latest first, row by row.
    covariance: Vec<f64>,
    /// The slopes of the last outputs by the parameters, the latest first.
    slopes: Vec<Vec<f64>>,
    /// a, the slopes of each next output by the last ones, and their products with the covariance.
    weights: Vec<f64>,
    crossed: Vec<f64>,
    functions: Vec<f64>,
    by_regressor: Vec<f64>,
    /// The slopes of the next outputs by the parameters.
    next: Vec<Vec<f64>>,
}

impl Errors {
    pub(super) fn new(runner: &Runner<'_>) -> Self {
        let (outputs, lags) = (runner.outputs(), runner.output_lags.max(1));
        let size = outputs * lags;
        // With those of trained functions after them.
        let parameters = runner.model.covariance.as_ref().map_or(runner.model.parameters.len(), Vec::len);
        Self {
            outputs,
            lags,
            noise: runner.model.noise_covariance.clone(),
            spread: runner.model.covariance.clone(),
            covariance: vec![0.0; size * size],
            slopes: vec![vec![0.0; parameters]; size],
            weights: vec![0.0; outputs * size],
            crossed: vec![0.0; outputs * size],
            functions: vec![0.0; parameters],
            by_regressor: vec![0.0; runner.taps.len()],
            next: vec![vec![0.0; parameters]; outputs],
        }
    }

    /// All before was measured.
    pub(super) fn begin(&mut self) {
        self.covariance.fill(0.0);
        self.slopes.iter_mut().for_each(|slopes| slopes.fill(0.0));
    }

    /// The variances of the errors of the outputs at row t, of which `walk` has read z.
    pub(super) fn step(&mut self, runner: &Runner<'_>, walk: &mut Walk<'_, '_>, t: usize, into: &mut [f64]) {
        self.read(runner, walk, t);
        let (outputs, size) = (self.outputs, self.outputs * self.lags);
        let Self { covariance, weights, crossed, .. } = self;
        for (crossed, weights) in crossed.chunks_exact_mut(size).zip(weights.chunks_exact(size)) {
            for (j, crossed) in crossed.iter_mut().enumerate() {
                let column = covariance[j..].iter().step_by(size);
                *crossed = weights.iter().zip(column).map(|(a, entry)| a * entry).sum();
            }
        }
        // The errors before move on by a sample, those of the new one come first.
        for i in (outputs..size).rev() {
            covariance
                .copy_within((i - outputs) * size..(i - outputs) * size + size - outputs, i * size + outputs);
        }
        for i in 0..outputs {
            for j in 0..outputs {
                let own = crossed[i * size..(i + 1) * size].iter().zip(&weights[j * size..]);
                covariance[i * size + j] =
                    own.map(|(one, weight)| one * weight).sum::<f64>() + self.noise[i][j];
            }
            for j in outputs..size {
                covariance[i * size + j] = crossed[i * size + j - outputs];
                covariance[j * size + i] = crossed[i * size + j - outputs];
            }
        }
        for (i, variance) in into.iter_mut().enumerate() {
            *variance = covariance[i * size + i];
        }
        if let Some(spread) = self.spread.take() {
            self.open(runner, &spread, into);
            self.spread = Some(spread);
        }
    }

    /// The slopes of g at z, by the parameters and by the last outputs.
    fn read(&mut self, runner: &Runner<'_>, walk: &mut Walk<'_, '_>, t: usize) {
        let (outputs, size) = (self.outputs, self.outputs * self.lags);
        self.weights.fill(0.0);
        for (i, (evaluator, map)) in runner.evaluators.iter().zip(&runner.model.maps).enumerate() {
            let own = numbers(runner, i, self.functions.len());
            let functions = &mut self.functions[own];
            evaluator.gradient(&walk.z, functions);
            evaluator.slopes_of_gradient(&walk.z, functions, &mut self.by_regressor);
            let weights = &mut self.weights[i * size..(i + 1) * size];
            for ((source, lag, own), slope) in runner.taps.iter().zip(&self.by_regressor) {
                let slope = map.scale * slope / own;
                if *source < outputs {
                    weights[(lag - 1) * outputs + source] += slope;
                } else if let Some(place) = runner.expression(*source)
                    && t >= walk.first() + lag
                {
                    // What was measured has no error.
                    walk.expression_slopes(place, t - lag, |output, inner| {
                        weights[(lag - 1) * outputs + output] += slope * inner;
                    });
                }
            }
        }
    }

    /// Adds g' P g, with the slopes g of the outputs by the parameters.
    fn open(&mut self, runner: &Runner<'_>, spread: &[Vec<f64>], into: &mut [f64]) {
        let (outputs, size) = (self.outputs, self.outputs * self.lags);
        for (i, own) in self.next.iter_mut().enumerate() {
            own.fill(0.0);
            for place in numbers(runner, i, self.functions.len()) {
                own[place] = runner.model.maps[i].scale * self.functions[place];
            }
            for (weight, slopes) in self.weights[i * size..].iter().zip(&self.slopes) {
                if *weight != 0.0 {
                    own.iter_mut().zip(slopes).for_each(|(own, slope)| *own += weight * slope);
                }
            }
            let mut open = 0.0;
            for (row, slope) in spread.iter().zip(&*own) {
                open += slope * row.iter().zip(&*own).map(|(entry, slope)| entry * slope).sum::<f64>();
            }
            into[i] += open.max(0.0);
        }
        self.slopes.rotate_right(outputs);
        self.slopes[..outputs].swap_with_slice(&mut self.next);
    }
}

/// The places of the numbers of a map among all `count`. Those of trained functions come after the parameters, of one
/// map.
fn numbers(runner: &Runner<'_>, map: usize, count: usize) -> Range<usize> {
    let own = runner.places[map].clone();
    if runner.places.len() == 1 { own.start..count } else { own }
}
