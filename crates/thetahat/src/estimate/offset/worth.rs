//! Whether a constant is worth its parameter.

use thetahat_numerics::optimize::{Objective, best_free};
use thetahat_numerics::regression::{Presample, sum, sum_above};

use super::super::arx::with_past;
use super::super::experiment_data::{ExperimentData, PredictionErrors};
use super::super::prediction_error::predictor_of;
use super::super::{Estimate, Initial, Norm, arx};
use crate::data::Record;
use crate::model::Orders;

/// Of a column of ones less than this fraction of its square is left beside the regressors: they hold a constant
/// already.
const DEPENDENT: f64 = 1e-9;

/// var e/S(0), at most 1: the variance of the errors over their spectral density at frequency zero, by their
/// autoregression. None where they cannot be computed.
pub(super) fn white_samples(data: &impl ExperimentData, orders: &Orders, estimate: &Estimate) -> Option<f64> {
    let mut predictor = predictor_of(data, orders, estimate);
    best_free(&mut predictor, estimate.parameters()).ok()?;
    let taken = orders.parameters() + predictor.initial_conditions();
    Some(1.0 / predictor.autoregression(taken)?.at_zero().max(1.0))
}

/// Whether the errors become smaller by what one parameter and further initial conditions cost: MDL, with the
/// likelihood of Gaussian errors; where other norms were made small, of errors with Laplace's distribution or a uniform
/// one. `share` of the samples counts.
pub(super) fn is_worth(without: &Estimate, with: &Estimate, share: f64) -> bool {
    let samples = with.samples() as f64;
    let conditions = |estimate: &Estimate| estimate.procedure().initial_conditions() as f64;
    let price = 1.0 + conditions(with) - conditions(without);
    let size = |estimate: &Estimate| {
        let constrained = estimate.procedure().constrained().filter(|outcome| outcome.norm != Norm::Two);
        constrained.map_or_else(|| estimate.cost(), |outcome| outcome.objective.powi(2))
    };
    without.mse() > 0.0 && share * samples * (size(without) / size(with)).ln() > price * samples.ln()
}

/// Whether a constant lowers the MDL of a linear model of a record.
pub(crate) fn pays(record: &Record<'_>, orders: &Orders) -> bool {
    arx(record, orders, Initial::Drop).is_ok_and(|without| lowers_mdl(record, orders, &without))
}

/// Whether a constant lowers the MDL of a linear model, given its least squares.
pub(super) fn lowers_mdl(record: &Record<'_>, orders: &Orders, without: &Estimate) -> bool {
    let samples = without.samples() as f64;
    let cost = without.mse() * samples;
    let decrease = OfConstant::new(record, orders, without).map_or(0.0, |of| of.errors * of.errors / of.left);
    let left = (cost - decrease).max(0.0);
    cost > 0.0 && samples * (cost / left).ln() > samples.ln()
}

/// What a constant beside the parameters of a linear model does, exactly: with z = 1 it lowers the sum of squared
/// errors by
///
/// ```text
/// (z'e)^2 / (z'z - z'Phi (Phi'Phi)^-1 Phi'z),
/// ```
///
/// the sums z'Phi being those of the signals, moved by one sample from lag to lag: O(N + p).
pub(super) struct OfConstant {
    /// z'e, the denominator, and (Phi'Phi)^-1 Phi'z.
    pub(super) errors: f64,
    pub(super) left: f64,
    taken: Vec<f64>,
}

impl OfConstant {
    /// None where z depends on Phi, or where there is no noise.
    pub(super) fn new(record: &Record<'_>, orders: &Orders, estimate: &Estimate) -> Option<Self> {
        let (columns, errors) = sums(record, orders, estimate);
        let covariance = estimate.covariance().filter(|_| estimate.noise_variance() > 0.0)?;
        let product = |row: &Vec<f64>| {
            row.iter().zip(&columns).map(|(entry, sum)| entry * sum).sum::<f64>() / estimate.noise_variance()
        };
        let taken: Vec<f64> = covariance.iter().map(product).collect();
        let samples = estimate.samples() as f64;
        let left = samples - columns.iter().zip(&taken).map(|(sum, taken)| sum * taken).sum::<f64>();
        (left > DEPENDENT * samples).then_some(Self { errors, left, taken })
    }

    /// The covariance of the parameters and of the constant after them, both being estimated, and the step that leads
    /// there.
    pub(super) fn joint(&self, estimate: &Estimate) -> (Vec<Vec<f64>>, Vec<f64>) {
        // By the constant, 1.
        let along: Vec<f64> = self.taken.iter().map(|taken| -taken).chain([1.0]).collect();
        let own = estimate.covariance().unwrap_or(&[]);
        let variance = estimate.noise_variance() / self.left;
        let entry = |i: usize, j: usize| {
            own.get(i).and_then(|row| row.get(j)).copied().unwrap_or(0.0) + variance * along[i] * along[j]
        };
        let rows = (0..along.len()).map(|i| (0..along.len()).map(|j| entry(i, j)).collect());
        (rows.collect(), along.iter().map(|value| value * self.errors / self.left).collect())
    }
}

/// z'Phi and z'e.
fn sums(record: &Record<'_>, orders: &Orders, estimate: &Estimate) -> (Vec<f64>, f64) {
    let (skipped, presample) = match estimate.initial() {
        Initial::Zero => (0, Presample::Zero),
        _ => (orders.maximum_lag(), Presample::Drop),
    };
    let segments = with_past(record, orders, presample);
    let sums = |signal: &[f64], first: usize, count: usize| {
        let mut sums = vec![0.0; count];
        for segment in segments.iter().filter(|segment| segment.len() > skipped) {
            // Samples before a segment are zero, or none is used.
            let rows = |lag: usize| {
                let begin = (segment.start + skipped).saturating_sub(lag).max(segment.start);
                begin..segment.end.saturating_sub(lag).max(begin)
            };
            let mut known = rows(first);
            let mut total = sum_above(&signal[known.clone()], 0.0);
            for (lag, all) in (first..).zip(&mut sums) {
                let next = rows(lag);
                total += sum_above(&signal[next.start..known.start], 0.0);
                total -= sum_above(&signal[next.end..known.end], 0.0);
                known = next;
                *all += total;
            }
        }
        sums
    };
    let mut columns: Vec<f64> = sums(record.output, 1, orders.na).iter().map(|sum| -sum).collect();
    for (input, (&nb, &nk)) in record.inputs.iter().zip(orders.nb.iter().zip(&orders.nk)) {
        columns.extend(sums(input, nk, nb));
    }
    let output: f64 = sums(record.output, 0, 1).iter().sum();
    let errors = output - sum(columns.iter().zip(estimate.parameters()).map(|(sum, value)| sum * value));
    (columns, errors)
}
