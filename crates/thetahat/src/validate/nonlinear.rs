//! A test of whether the residuals of a model contain nonlinear terms of an input.
//!
//! Whiteness and independence are blind to them: with a symmetric input, u^2 correlates with no u, nor e with its own
//! past. With v(t) = u(t)^2 less its mean and x = e, or e^2 less its mean, the statistic is
//!
//! ```text
//! xi = r' V^-1 r/s^2,   r_k = sum_t v(t-k) x(t),   V_kl = sum_t v(t-k) v(t-l),   s^2 = sum_t x(t)^2/N,   k, l = 0 … 20
//! ```
//!
//! which is chi-square with 21 degrees of freedom where x is white and knows nothing of u (Billings and Voon,
//! Correlation based model validity tests for nonlinear models, Int. J. Control 44, 1986, as a portmanteau).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::{DMatrix, DVector, SymmetricEigen};
use thetahat_numerics::distribution::chi_square_tail;

use super::verdict::Test;
use crate::data::Record;
use crate::respond::{Innovations, TestedInput};

/// The longest lag.
const LAGS: usize = 20;
/// Samples for each lag at least.
const SAMPLES_PER_LAG: usize = 5;
/// Directions in which V is below this fraction of its largest hold nothing.
const NOTHING: f64 = 1e-9;

/// Whether the residuals depend on the square of an input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Nonlinearity {
    /// The output.
    pub output: String,
    /// The input channel.
    pub input: String,
    /// Of e: whether the model lacks even terms of the input.
    pub errors: Test,
    /// Of e^2: whether it lacks any, odd ones too, or the noise is larger where the input is.
    pub squares: Test,
    /// The lag at which e is correlated most with u^2, and that correlation.
    pub largest: (usize, f64),
}

/// The tests of the errors of one output, for each input of which the square is not constant.
pub(crate) fn nonlinearities(
    output: &str,
    inputs: &[TestedInput<'_>],
    record: &Record<'_>,
    innovations: &[Innovations],
) -> Vec<Nonlinearity> {
    let each = inputs.iter();
    each.filter_map(|input| nonlinearity(output, input.name, record.inputs[input.place], innovations))
        .collect()
}

fn nonlinearity(output: &str, input: &str, u: &[f64], innovations: &[Innovations]) -> Option<Nonlinearity> {
    // Samples with as many inputs before them as there are lags.
    let samples: Vec<(usize, f64)> = innovations
        .iter()
        .flat_map(|found| {
            let first = found.rows.start;
            found.counted.iter().flat_map(move |rows| {
                let known = rows.start.max(first + LAGS)..rows.end;
                known.map(move |t| (t, found.errors[t - first]))
            })
        })
        .collect();
    if samples.len() < SAMPLES_PER_LAG * (LAGS + 1) {
        return None;
    }
    let count = samples.len() as f64;
    let mean = samples.iter().map(|(t, _)| u[*t] * u[*t]).sum::<f64>() / count;
    let mut products = DMatrix::zeros(LAGS + 1, LAGS + 1);
    let (mut with_error, mut with_square) = (DVector::zeros(LAGS + 1), DVector::zeros(LAGS + 1));
    let square = samples.iter().map(|(_, e)| e * e).sum::<f64>() / count;
    let mut fourth = 0.0;
    for (t, e) in &samples {
        let v = DVector::from_fn(LAGS + 1, |k, _| u[t - k] * u[t - k] - mean);
        products.ger(1.0, &v, &v, 1.0);
        with_error.axpy(*e, &v, 1.0);
        with_square.axpy(e * e - square, &v, 1.0);
        fourth += (e * e - square).powi(2);
    }
    // An input of two levels has no square to speak of.
    let changes = products[(0, 0)] > NOTHING * count * mean * mean;
    if !changes || square <= 0.0 {
        return None;
    }
    let eigen = SymmetricEigen::new(products.clone());
    let largest = eigen.eigenvalues.max();
    let kept: Vec<usize> = (0..=LAGS).filter(|k| eigen.eigenvalues[*k] > NOTHING * largest).collect();
    let test = |r: &DVector<f64>, variance: f64| {
        let part = |k: &usize| eigen.eigenvectors.column(*k).dot(r).powi(2) / eigen.eigenvalues[*k];
        let statistic = kept.iter().map(part).sum::<f64>() / variance;
        let degrees = kept.len() as f64;
        Test { lags: LAGS + 1, statistic, degrees, p_value: chi_square_tail(statistic, degrees) }
    };
    let correlation = |k: usize| with_error[k] / (products[(k, k)] * square * count).sqrt();
    let strongest =
        (0..=LAGS).max_by(|one, other| correlation(*one).abs().total_cmp(&correlation(*other).abs()))?;
    let found = Nonlinearity {
        output: output.to_owned(),
        input: input.to_owned(),
        errors: test(&with_error, square),
        squares: test(&with_square, fourth / count),
        largest: (strongest, correlation(strongest)),
    };
    (found.errors.statistic.is_finite() && found.squares.statistic.is_finite()).then_some(found)
}
