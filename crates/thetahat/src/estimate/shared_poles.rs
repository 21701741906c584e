//! State-space models of frequency responses: quotients with shared poles that come closest to measured points,
//!
//! ```text
//! min sum_jk |G_j(omega_k) - G_jk|^2 w_jk^2,   G_j = d_j + sum_i N_ij(s)/P_i(s),   P = s^2 + a1 s + a2, or s + a
//! ```
//!
//! with s = j omega where inputs are sines in continuous time, and s = 2/T (z - 1)/(z + 1) where they are held for T
//! seconds, which maps the unit circle on the imaginary axis: both have their stable poles left of it. Numerators and
//! d are least squares for given poles (variable projection, Golub and Pereyra 1973, with the derivative of Kaufman
//! 1975); the search moves the logarithms of the a, so that all poles are stable.
//!
//! It starts from vector fitting (Gustavsen and Semlyen, IEEE Trans. Power Delivery 14, 1999; relaxed: Gustavsen, the
//! same 21, 2006), which finds poles in turn as the zeros of sigma in sigma G = sum N/P + d, sigma being a quotient
//! over the poles of before, and from what one pole less found.

mod entries;
mod fitting;
mod objective;

use std::ops::RangeInclusive;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::DMatrix;
use thetahat_numerics::optimize::{Algorithm, Deadline, Found, Monitor, Search, Stopped, search};
use thetahat_numerics::regression::{Span, sum_of_squares};

use super::uncertainty::coloured;
use super::{OrderScore, ResponsePoints};
use crate::Error;
use crate::model::{EntryCovariance, StateSpace};
use objective::PolesObjective;

/// The relative decrease at which searches stop.
const TOLERANCE: f64 = 1e-11;
/// A cost below this fraction of the points' squares is rounding.
const ROUNDING: f64 = 1e-26;

/// How a state-space model was found from a measured frequency response.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SharedPolesOutcome {
    /// Whether the inputs act on the output at once, so that D was estimated.
    pub feedthrough: bool,
    /// Whether that was asked for; else the points said it.
    pub feedthrough_given: bool,
    /// What the order was chosen among; empty if it was given.
    pub orders: Vec<OrderScore>,
    /// Whether, in a frequency response without errors of its own, errors were taken for relative to each point.
    pub relative: bool,
    /// How steps were chosen.
    pub algorithm: Algorithm,
    /// Iterations done, from the start that won.
    pub iterations: usize,
    /// The mean of the squared weighted errors at that start and after each iteration.
    pub costs: Vec<f64>,
    /// Why it stopped.
    pub stopped: Stopped,
}

/// What was found.
#[derive(Debug, Clone)]
pub(crate) struct SharedPoles {
    /// Without noise. Of sines in continuous time A, B, C and D stand as F, G, H and D.
    pub(crate) matrices: StateSpace,
    /// None where the points do not tell all entries.
    pub(crate) covariance: Option<EntryCovariance>,
    /// The values that were measured, and the parameters that are free.
    pub(crate) samples: usize,
    pub(crate) free: usize,
    pub(crate) mse: f64,
    pub(crate) outcome: SharedPolesOutcome,
}

/// Fits models of these orders to the points of the response from each input, and takes that of the least MDL
///
/// ```text
/// N/l ln(V/N) + p ln(N/l)
/// ```
///
/// for p parameters and N values whose errors are alike in groups of l: the mean over points of the sum of their
/// squared correlations with all others. That the points come with their variances does not count: where a response is
/// missed by more than these, each order would pay.
///
/// # Errors
/// [`Error::Undetermined`] if points are too few for the lowest order; [`Error::Data`] if squares leave the range of
/// numbers; [`Error::Interrupted`] if the monitor says so.
pub(crate) fn shared_poles(
    points: &[ResponsePoints],
    orders: &RangeInclusive<usize>,
    feedthrough: Option<bool>,
    options: &Search,
    monitor: Monitor<'_>,
) -> Result<SharedPoles, Error> {
    options.check_numbers()?;
    let options = Search { tolerance: options.tolerance.min(TOLERANCE), ..options.clone() };
    let deadline = Deadline::after(options.time_limit);
    let alike = alike(points);
    let mut best: Option<(PolesObjective<'_>, Found, f64)> = None;
    let mut scores: Vec<OrderScore> = Vec::new();
    let choices: &[bool] = match feedthrough {
        Some(true) => &[true],
        Some(false) => &[false],
        None => &[false, true],
    };
    for direct in choices {
        let mut before: Option<Vec<f64>> = None;
        for order in 1..=*orders.end() {
            let mut objective = PolesObjective::new(points, order, *direct)?;
            let (free, samples) = (objective.free_parameters(), objective.count());
            if samples <= free {
                break;
            }
            let Some(found) = searched(&mut objective, before.as_deref(), &options, deadline, monitor)?
            else {
                break;
            };
            before = Some(found.parameters.clone());
            if order < *orders.start() {
                continue;
            }
            let values = samples as f64 / alike;
            let mean = (found.cost() / samples as f64).max(f64::MIN_POSITIVE);
            let mdl = values * mean.ln() + free as f64 * values.ln();
            match scores.iter_mut().find(|score| score.order == order) {
                Some(score) => score.mdl = score.mdl.map(|own| own.min(mdl)),
                None => scores.push(OrderScore { order, mdl: Some(mdl) }),
            }
            if best.as_ref().is_none_or(|(.., own)| mdl < *own) {
                best = Some((objective, found, mdl));
            }
        }
    }
    let Some((mut objective, found, _)) = best else {
        let samples: usize = points.iter().map(|own| 2 * own.frequencies.len()).sum();
        return Err(Error::undetermined(
            Vec::new(),
            format!(
                "{samples} measured values, two of each point, are too few for a model of order {}; give more points, or ask for a lower \
                 order",
                orders.start()
            ),
        ));
    };
    objective.settle(&found.parameters)?;
    let (samples, free) = (objective.count(), objective.free_parameters());
    let (matrices, slopes) = objective.matrices();
    let covariance = objective.covariance().map(|own| {
        let spread = &slopes * own * slopes.transpose();
        let values = spread.row_iter().map(|row| row.iter().copied().collect()).collect();
        EntryCovariance { entries: objective.entries(), values }
    });
    let outcome = SharedPolesOutcome {
        feedthrough: objective.is_direct(),
        feedthrough_given: feedthrough.is_some(),
        orders: if orders.start() == orders.end() { Vec::new() } else { scores },
        relative: objective.is_relative(),
        algorithm: options.algorithm,
        iterations: found.costs.len() - 1,
        costs: found.costs.iter().map(|cost| cost / samples as f64).collect(),
        stopped: found.stopped,
    };
    Ok(SharedPoles { matrices, covariance, samples, free, mse: found.cost() / samples as f64, outcome })
}

/// How many values have errors that are alike.
fn alike(points: &[ResponsePoints]) -> f64 {
    let each = points.iter().flat_map(|own| {
        own.frequencies.iter().map(move |one| {
            let with = own.frequencies.iter().map(|other| {
                let [re, im] = own.correlation.of_parts(*one, *other);
                0.5 * (re * re + im * im)
            });
            with.sum::<f64>()
        })
    });
    let (sum, count) = each.fold((0.0, 0.0), |(sum, count), own| (sum + own, count + 1.0));
    (sum / count).max(1.0)
}

/// The best of the searches from all starts; none where no start has a cost.
fn searched(
    objective: &mut PolesObjective<'_>,
    before: Option<&[f64]>,
    options: &Search,
    deadline: Deadline,
    monitor: Monitor<'_>,
) -> Result<Option<Found>, Error> {
    let smallest = ROUNDING * objective.measured_squares();
    let mut best: Option<Found> = None;
    for start in objective.starts(before) {
        if best.is_some() && deadline.is_over() {
            break;
        }
        let Ok(found) = search(objective, &start, options, smallest, deadline, monitor)? else { continue };
        if best.as_ref().is_none_or(|best| found.cost() < best.cost()) {
            best = Some(found);
        }
    }
    Ok(best)
}

impl PolesObjective<'_> {
    /// The covariance of the parameters: the logarithms of the a, then for each input numerators and d. It is
    ///
    /// ```text
    /// (Psi' Psi)^-1 (sum rho_kl psi_k psi_l') (Psi' Psi)^-1
    /// ```
    ///
    /// with the correlations rho of the points' errors, times the mean square of the errors where that is above one or
    /// the errors are relative. None where a column depends on others.
    fn covariance(&self) -> Option<DMatrix<f64>> {
        let psi = self.slopes();
        let norms: Vec<f64> = psi.iter().map(|column| sum_of_squares(column).sqrt()).collect();
        let mut span = Span::default();
        for (column, norm) in psi.iter().zip(&norms) {
            if !span.add(column.iter().map(|value| value / norm).collect()) {
                return None;
            }
        }
        let size = psi.len();
        let mut root = span.triangle().solve_upper_triangular(&DMatrix::identity(size, size))?;
        root.row_iter_mut().zip(&norms).for_each(|(mut row, norm)| row /= *norm);
        let inverse = &root * root.transpose();
        let spread = ResponsePoints::spread(self.points(), &psi.iter().collect::<Vec<_>>());
        let variance = self.squares() / (self.count() - self.free_parameters()) as f64;
        let larger = if self.is_relative() { variance } else { variance.max(1.0) };
        let covariance = coloured(&inverse, larger, &spread);
        let is_one = covariance.iter().all(|value| value.is_finite())
            && covariance.diagonal().iter().all(|value| *value > 0.0);
        is_one.then_some(covariance)
    }
}

#[cfg(test)]
mod tests;
