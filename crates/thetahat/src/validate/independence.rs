//! Whether residuals depend on an input.
//!
//! s_k = sum u(t - k) e(t)/N for k = 1 … M. Where e does not depend on past inputs, sqrt(N) s has the covariance
//!
//! ```text
//! P_ij = sum_k R_e(k) R_u(k + i - j)
//! ```
//!
//! (Ljung, System Identification, 2nd ed. 1999, section 16.6), and N s' P^-1 s is chi-square with M degrees of freedom.
//! P comes from e = w/A(q), w white of variance sigma^2 and the order of A chosen by MDL: sum u(t - k) e(t) = sum
//! zeta_k(t) w(t) with zeta_k = u(t - k)/A(q^+1), and P = sigma^2 sum zeta zeta'/N, for the input as it was and
//! whatever the colour of e.
//!
//! That holds for a model that is known. On the samples of the fit, s is what is left by the estimate: with psi taken
//! off the lagged inputs,
//!
//! ```text
//! z_k(t) = u(t - k) - K_k psi(t),   K = (sum u psi')(sum psi psi')^-1,
//! ```
//!
//! sum z_k e does not change to first order with the parameters, and zeta is made of z. Directions of which psi leaves
//! less than 0.05 are left out: about one for each parameter of the plant. On other samples the parameters' errors come
//! on top: N (sum u psi'/N) cov (sum u psi'/N)'. An input that is not rich has a P of less than full rank: as many
//! directions count, two for a sinusoid.
//!
//! Future inputs, k < 0, depend on e where there is feedback; each of M lags has M times the chance. They do so too
//! where the model lacks dynamics and the input predicts itself: what speaks for feedback alone is in `feedback`.

use thetahat_core::nalgebra::{DMatrix, DVector};
use thetahat_numerics::distribution::{chi_square_tail, two_sided};
use thetahat_numerics::regression::{Lagged, Presample, Taps, sum_of_squares};

use super::feedback::follows;
use super::moments::{Column, Moments, Traces, columns, eigen};
use super::verdict::{Independence, Test};
use super::whiteness::chi_square;
use crate::estimate::{Autoregression, backward_filtered_products};

/// Directions in which an input has less than the energy of this many of its samples are left out: a sum of few errors
/// is not normal, and where an input is not rich they are no more than its ends.
const RICH: f64 = 10.0;

/// What the tests of all inputs share.
pub(super) struct Setting<'t> {
    pub(super) traces: &'t Traces<'t>,
    pub(super) moments: &'t Moments,
    /// The columns of psi, and the inverse of sum psi psi'.
    pub(super) psi: &'t [Column],
    pub(super) inverse: &'t DMatrix<f64>,
    /// The colour of e.
    pub(super) colour: &'t Autoregression,
    pub(super) samples: f64,
    /// sum e^2.
    pub(super) square: f64,
    /// Whether the parameters were fitted to these samples; if not, their covariance where it is known.
    pub(super) parameters: Parameters,
}

/// What the parameters have to do with the samples.
pub(super) enum Parameters {
    /// They were fitted to them: X_k = E psi(t) e(t - k)/var e, a row for each lag.
    Fitted(DMatrix<f64>),
    /// They come from elsewhere, with this covariance if it is known.
    Known(Option<DMatrix<f64>>),
}

/// The tests of one input over `lags` lags.
pub(super) fn independence(
    setting: &Setting<'_>,
    name: &str,
    input: usize,
    lags: usize,
) -> Option<Independence> {
    let Setting { traces, moments, psi, samples, square, .. } = *setting;
    let signal = Traces::input(input);
    let taps = Taps { signal, first: 1, count: lags, sign: 1.0 };
    let past = columns(&[taps]);
    let counted = traces.counted();
    let power: f64 =
        counted.iter().map(|segment| sum_of_squares(&traces.signal(signal)[segment.clone()])).sum();
    let with_error = moments.with_error(&past);
    // sum u(t) e(t - k), k = 0 … M.
    let signals = [traces.signal(signal), traces.signal(Traces::ERROR)];
    let delayed = vec![Taps { signal: 1, first: 0, count: lags + 1, sign: 1.0 }];
    let (_, future, _) = Lagged::new(&signals, delayed, &traces.spans(), Presample::Zero).normal_equations();

    // sqrt(N) s: its covariance for a known model, and what its parameters do to it.
    let all = [&past[..], psi].concat();
    let products = coloured_products(setting, &taps, &all) / samples;
    let (own, between) = (products.view((0, 0), (lags, lags)), products.view((0, lags), (lags, psi.len())));
    let covariance = own.clone_owned();
    let cross = moments.matrix(&past, psi);
    let (values, left) = match &setting.parameters {
        Parameters::Fitted(_) => {
            let weights = &cross * setting.inverse;
            let taken = between * weights.transpose();
            let of_psi = products.view((lags, lags), (psi.len(), psi.len()));
            let values = (&with_error - &weights * moments.with_error(psi)) / samples;
            (values, &covariance - &taken - taken.transpose() + &weights * of_psi * weights.transpose())
        }
        Parameters::Known(Some(spread)) => {
            (&with_error / samples, &covariance + &cross * spread * cross.transpose() / samples)
        }
        Parameters::Known(None) => (&with_error / samples, covariance.clone()),
    };
    let size = (square * power).sqrt();
    let shown = |sum: f64| if size > 0.0 { sum / size } else { 0.0 };
    // Half the width of the band of sum u(t - k) e(t)/size.
    let band =
        |variance: f64| if size > 0.0 { two_sided(0.05) * (samples * variance).sqrt() / size } else { 0.0 };
    let spread = |k: usize| match setting.parameters {
        Parameters::Fitted(_) => covariance[(k, k)],
        Parameters::Known(_) => left[(k, k)],
    };
    let lagged = |sums: &DVector<f64>| sums.iter().map(|sum| shown(*sum)).collect::<Vec<f64>>();
    let mut correlation = lagged(&future);
    correlation.reverse();
    correlation.extend(lagged(&with_error));
    // What is in the input lies alike at all lags.
    let typical = covariance[(0, 0)];
    let before = std::iter::repeat_n(band(typical), lags + 1);
    let result = Independence {
        input: name.to_owned(),
        correlation,
        band: before.chain((0..lags).map(|k| band(spread(k)))).collect(),
        past: standardized(&values, samples, &covariance, &left)?,
        feedback: feedback(future.rows(1, lags).as_slice(), samples * typical),
        suspected: follows(traces.signal(signal), traces.signal(Traces::ERROR), &counted)
            .is_some_and(|found| found.is_suspected()),
    };
    let finite = result.correlation.iter().chain(&result.band).all(|value| value.is_finite());
    finite.then_some(result)
}

/// sigma^2 sum zeta zeta' of some columns.
fn coloured_products(setting: &Setting<'_>, past: &Taps, all: &[Column]) -> DMatrix<f64> {
    let Autoregression { monic, variance } = setting.colour;
    if monic.len() == 1 {
        return setting.moments.matrix(all, all) * *variance;
    }
    let taps = [&[*past], &setting.traces.psi[..]].concat();
    let signals = setting.traces.signals();
    let mut products = DMatrix::zeros(all.len(), all.len());
    for segment in &setting.traces.segments {
        products +=
            backward_filtered_products(&signals, &taps, &segment.known, &segment.counted, None, monic);
    }
    products * *variance
}

/// The test of sqrt(N) s with covariance `left`, in units of the input: `covariance` is that of a known model.
fn standardized(
    values: &DVector<f64>,
    samples: f64,
    covariance: &DMatrix<f64>,
    left: &DMatrix<f64>,
) -> Option<Test> {
    let lags = values.len();
    let (eigenvalues, vectors) = eigen(covariance.clone())?;
    let few = RICH / samples * covariance.trace() / lags as f64;
    let rich = eigenvalues.iter().zip(vectors.column_iter()).filter(|(value, _)| **value > few);
    let directions: Vec<DVector<f64>> = rich.map(|(value, vector)| vector / value.sqrt()).collect();
    if directions.is_empty() {
        return Some(Test { lags, statistic: 0.0, degrees: 0.0, p_value: None });
    }
    let directions = DMatrix::from_columns(&directions);
    chi_square(&directions.tr_mul(values), samples, directions.tr_mul(&(left * &directions)), lags)
}

/// The largest of sum u(t + k) e(t) for k = 1 …, of this variance each.
fn feedback(future: &[f64], variance: f64) -> Test {
    let lags = future.len();
    let largest = future.iter().fold(0.0_f64, |largest, sum| largest.max(sum.abs()));
    let statistic = largest * (largest / variance);
    if !(statistic.is_finite() && variance > 0.0) {
        return Test { lags, statistic: 0.0, degrees: 0.0, p_value: None };
    }
    let p_value = chi_square_tail(statistic, 1.0).map(|p| (lags as f64 * p).min(1.0));
    Test { lags, statistic, degrees: 1.0, p_value }
}
