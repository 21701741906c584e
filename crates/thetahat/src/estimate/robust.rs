//! Estimates that do not follow wild samples, for every structure: a loss of the prediction errors that grows like |e|.
//!
//! Minimised is, over theta and the initial conditions,
//!
//! ```text
//! V = sum rho(e),   rho(e) = e^2/2 for |e| <= d,   d |e| - d^2/2 beyond
//! ```
//!
//! (Huber, Robust Statistics, 1981, chapters 4 and 7). Huber's estimate has d = k s, where s is the scale of the
//! errors, the median of |e - median(e)| over 0.6745 of the estimate of least absolute errors, held fixed (Holland and
//! Welsch, Robust regression using iteratively reweighted least squares, 1977). The estimate of least absolute errors
//! is the limit d -> 0: d goes down to a thousandth of s, and linear programs lead from there to its least value
//! ([`minimax`]): where the search with d ends in a narrow valley, up to some per cent lower.
//!
//! It starts from the estimate of least squares, and from that of outputs y^ + psi(e) in which errors are cut off at
//! 1.345 scales (Huber 1981, section 7.8, modified residuals; Martin and Thomson, Robust-resistant spectrum estimation,
//! 1982), as often as this makes the scale smaller: where wild samples lead least squares into another valley, the
//! first does not return.
//!
//! The search is that of least squares with sums weighted by w = psi(e)/e, psi = rho', which is min(1, d/|e|):
//!
//! ```text
//! G = sum w psi psi',   g = sum w psi e       (psi also stands for -de/dtheta)
//! ```
//!
//! As rho(sqrt(x)) is concave, the weighted sum of squares lies above V and touches it where the search stands: what
//! lowers the one lowers the other (Huber 1981, section 7.8). A step is taken only if V itself falls.
//!
//! The covariance is that of least squares with another factor (Huber 1981, sections 7.6 and 7.10): with m = mean
//! psi'(e), the part of the errors within d,
//!
//! ```text
//! Huber:            K^2 sum psi(e)^2/(N - p) / m^2 (sum psi psi')^-1,   K = 1 + (p/N) (1 - m)/m
//! absolute errors:  1/(4 f(0)^2) (sum psi psi')^-1,                      f the density of the errors
//! ```
//!
//! and for output error, whose errors may have a colour, psi(e) takes the place of e in the sandwich of `uncertainty`.
//!
//! What it withstands: any part of the errors below a half may be wild if the regressors are not, as in models of
//! output error, whose gradient is made of the inputs. Where past outputs or errors are regressors (A, C, D), a wild
//! output is a wild regressor in the next samples, and enough of them spoil any estimate of this kind (Huber 1981,
//! section 7.9).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::DMatrix;
use thetahat_numerics::optimize::{Deadline, Found, Monitor, Search, best_free, search};

use super::arx::rows;
use super::criterion::{Norm, sparsity};
use super::minimax;
use super::outcome::{SearchOutcome, StartOutcome, search_outcome};
use super::prediction_error::{backward_products, inverse_root, prediction_error, predictor_of};
use super::predictor::Predictor;
use super::thinning::energy;
use super::uncertainty::{autoregression, coloured};
use super::{Estimate, Initial, Procedure};
use crate::Error;
use crate::data::Record;
use crate::model::{Orders, Structure};
use crate::respond::NOTHING_LEFT;

/// The median of |e| of normal errors, in standard deviations.
const MEDIAN: f64 = 0.674_489_750_196_081_7;
/// d on the way to least absolute errors, in scales.
const SMOOTHED: [f64; 4] = [1.0, 0.1, 0.01, 0.001];
/// So often outputs are cleaned at most, while that makes the scale smaller to this fraction.
const CLEANINGS: usize = 5;
const BETTER: f64 = 0.98;
/// Scales are not taken for zero above this fraction of the RMS of the errors.
const EXACT: f64 = 1e-9;

/// How wild samples count.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Loss {
    /// By |e|.
    Absolute,
    /// By e^2/2 up to k scales, and by |e| beyond.
    Huber {
        /// k, above 0: [`Loss::K`], unless there is a reason for another.
        k: f64,
    },
}

impl Loss {
    /// Huber's k: 95 % as efficient as least squares where errors are normal (Holland and Welsch 1977).
    pub const K: f64 = 1.345;
}

/// A robust estimate: which loss, and how to search for its least value.
#[derive(Debug, Clone, PartialEq)]
pub struct Robust {
    /// What wild samples count.
    pub loss: Loss,
    /// How to search.
    pub search: Search,
}

/// How a robust estimate was found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RobustOutcome {
    /// Huber's k; none for least absolute errors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub k: Option<f64>,
    /// s, the scale of the errors in units of y.
    pub scale: f64,
    /// d: errors count by their squares up to it, in units of y; for absolute errors before linear programs end the
    /// search.
    pub bound: f64,
    /// The part of the errors that are larger.
    pub beyond: f64,
    /// The mean of what was made small: of |e|, or of rho(e).
    pub objective: f64,
    /// The search, whose costs are means of 2 rho(e); it starts from the estimate of least squares.
    pub search: SearchOutcome,
}

impl Robust {
    fn check(&self) -> Result<(), Error> {
        match self.loss {
            Loss::Huber { k } if !(k.is_finite() && k > 0.0) => Err(Error::argument(
                "norm",
                format!("huber:{k} needs a number of scales above 0, such as {}", Loss::K),
            )),
            _ => Ok(()),
        }
    }
}

/// Fits a model of any structure with a loss that does not follow wild samples, from the estimate of least squares on.
pub(super) fn robust(
    record: &Record<'_>,
    orders: &Orders,
    initial: Initial,
    how: &Robust,
    monitor: Monitor<'_>,
) -> Result<Estimate, Error> {
    how.check()?;
    let options = &how.search;
    options.check_numbers()?;
    let squares = prediction_error(record, orders, initial, options, monitor)?;
    let mut predictor = predictor_of(record, orders, &squares);
    let unusable = || minimax::unusable(orders);
    best_free(&mut predictor, squares.parameters()).map_err(|_| unusable())?;
    predictor.linearize();
    let mut scale = scale(&predictor.residuals().0);
    // Of an exact fit nothing is wild.
    let smallest = (EXACT * squares.mse().sqrt()).max((NOTHING_LEFT * energy(record)).sqrt());
    let mut at = squares.parameters().to_vec();
    for _ in 0..CLEANINGS {
        if scale <= smallest {
            break;
        }
        let cleaned = predictor.cleaned(record, Loss::K * scale);
        let clean = Record { output: &cleaned, ..record.clone() };
        let found = match prediction_error(&clean, orders, squares.initial(), options, monitor) {
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            Err(_) => break,
            Ok(found) => found,
        };
        if best_free(&mut predictor, found.parameters()).is_err() {
            break;
        }
        let next = self::scale(&predictor.residuals().0);
        if next > BETTER * scale {
            break;
        }
        scale = next;
        at = found.parameters().to_vec();
    }
    scale = scale.max(smallest);
    let deadline = Deadline::after(options.time_limit);
    let stage = |predictor: &mut Predictor<'_>, bound: f64, at: &[f64]| -> Result<Found, Error> {
        predictor.count_linearly_from(Some(bound));
        let nothing = predictor.samples() as f64 * smallest * smallest;
        search(predictor, at, options, nothing, deadline, monitor)?.map_err(|_| unusable())
    };
    let mut bound = 0.0;
    let mut found = None;
    for part in SMOOTHED {
        bound = part * scale;
        let next = stage(&mut predictor, bound, &at)?;
        at.clone_from(&next.parameters);
        found = Some(next);
    }
    if let Loss::Huber { k } = how.loss {
        scale = self::scale(&predictor.residuals().0).max(smallest);
        bound = k * scale;
        // From the better of the two.
        let best = [squares.parameters(), &at].map(|start| {
            predictor.count_linearly_from(Some(bound));
            best_free(&mut predictor, start).unwrap_or(f64::INFINITY)
        });
        let start = if best[0] < best[1] { squares.parameters() } else { &at };
        found = Some(stage(&mut predictor, bound, start)?);
    }
    let mut found = found.ok_or_else(unusable)?;
    if how.loss == Loss::Absolute {
        let at = &found.parameters;
        let least = minimax::least(&mut predictor, at, Norm::One, smallest, options, deadline, monitor)?;
        found.parameters = least.parameters;
    }
    finish(orders, &mut predictor, found, how, &squares, [scale, bound])
}

/// The estimate of a search.
fn finish(
    orders: &Orders,
    predictor: &mut Predictor<'_>,
    found: Found,
    how: &Robust,
    squares: &Estimate,
    [scale, bound]: [f64; 2],
) -> Result<Estimate, Error> {
    let (samples, initial_conditions) = (predictor.samples(), predictor.initial_conditions());
    let taken = found.parameters.len() + initial_conditions;
    let (errors, segments) = predictor.residuals();
    let count = samples as f64;
    let beyond = errors.iter().filter(|e| e.abs() > bound).count() as f64 / count;
    let absolute: f64 = errors.iter().map(|e| e.abs()).sum();
    // Where everything counts by its square: psi, and errors as a validation sees them.
    predictor.count_linearly_from(None);
    let overflow = || Error::data("the errors overflow; scale the channels towards one");
    let cost = best_free(predictor, &found.parameters).map_err(|_| overflow())?;
    predictor.linearize();
    let known = inverse_root(predictor);
    let influence: Vec<f64> = match how.loss {
        Loss::Absolute => errors.iter().map(|e| e.signum()).collect(),
        Loss::Huber { .. } => errors.iter().map(|e| e.clamp(-bound, bound)).collect(),
    };
    // What psi(e) over its slope makes of the parameters.
    let factor = match how.loss {
        Loss::Absolute => sparsity(&errors, taken).map(|sparsity| sparsity / 2.0),
        Loss::Huber { .. } => {
            let m = 1.0 - beyond;
            (m > 0.0).then(|| (1.0 + taken as f64 / count * beyond / m) / m)
        }
    };
    let covariance = known.as_ref().zip(factor).map(|((root, _), factor)| {
        let squared = factor * factor;
        let covariance: DMatrix<f64> = if orders.structure() == Structure::Oe {
            let colour = autoregression(&influence, &segments, taken);
            let products = backward_products(&predictor.columns(), &colour.monic);
            coloured(root, colour.variance, &(root.transpose() * products * root)) * squared
        } else {
            let variance = match how.loss {
                Loss::Absolute => 1.0,
                Loss::Huber { .. } => {
                    influence.iter().map(|psi| psi * psi).sum::<f64>() / (count - taken as f64)
                }
            };
            root * root.transpose() * (variance * squared)
        };
        rows(&covariance)
    });
    let (k, objective) = match how.loss {
        Loss::Absolute => (None, absolute / count),
        Loss::Huber { k } => (Some(k), found.cost() / 2.0 / count),
    };
    let start = StartOutcome {
        name: "least-squares".to_owned(),
        cost: found.costs.first().map(|cost| cost / count),
        reached: Some(found.cost() / count),
    };
    let parameters = found.parameters.clone();
    Ok(Estimate {
        covariance,
        noise_variance: cost / (count - taken as f64),
        samples,
        mse: cost / count,
        condition: known.map(|(_, condition)| condition),
        initial: squares.initial(),
        procedure: Procedure::Robust(RobustOutcome {
            k,
            scale,
            bound,
            beyond,
            objective,
            search: search_outcome(&how.search, &found, predictor, vec![start]),
        }),
        parameters,
    })
}

/// The median of |e - median(e)|, in standard deviations of normal errors.
fn scale(errors: &[f64]) -> f64 {
    let centre = median(errors.to_vec());
    median(errors.iter().map(|e| (e - centre).abs()).collect()) / MEDIAN
}

/// The mean of the middle two of an even number.
fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    let even = values.len().is_multiple_of(2);
    let (below, &mut upper, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    if !even {
        return upper;
    }
    f64::midpoint(below.iter().copied().fold(f64::NEG_INFINITY, f64::max), upper)
}

#[cfg(test)]
mod tests;
