//! An offset of the output that is estimated with the parameters: a constant, and a trend.
//!
//! ```text
//! A(q) y(t) = sum_j B_j(q)/F_j(q) u_j(t) + k + m r(t) + C(q)/D(q) e(t),   r(t) = (t - t_m)/h
//! ```
//!
//! (Ljung, System Identification, 2nd ed. 1999, section 14.1: the offset as a parameter). 1 and r are two more inputs
//! with one coefficient, no delay and no F: every way to estimate has them at no further cost in concepts. t_m is the
//! middle of the estimation rows and h half their length in time. As an offset of the output, A(q) (y(t) - l(t)) = ...,
//! this is the line
//!
//! ```text
//! l(t) = level + slope (t - t_m):   slope = m/(h A(1)),   level = k/A(1) + m T S/(h A(1)^2),   S = sum_i i a_i,
//! ```
//!
//! T being the sample time, as A(q) t = A(1) t - T S. So predictions and simulations know nothing of it: they see
//! deviations. Standard errors are those of the parameters to first order (see `model::dynamics`). An integrator,
//! A(1) = 0, has no level.
//!
//! An offset that is taken off before, as a mean or a line, is an estimate too, and mostly not the best one. What all
//! this leaves open of the output, together with the parameters, goes with the model (see [`OffsetCovariance`]).
//!
//! Whether a constant is worth its parameter is decided by MDL (Rissanen, Automatica 14, 1978): N ln(V_0/V_1) > ln N.
//! For models that are linear in their parameters V_1 follows from V_0, the residuals' sum and the normal equations;
//! for others the decrease that one Gauss-Newton step predicts (Rao's score test, Proc. Cambridge Philosophical Society
//! 44, 1948) says whether a second search can change the answer. The errors of an output-error model may have any
//! colour, and slow ones look like an offset: there k^2/var k > ln N is asked for too, with the variance that knows of
//! the colour (Wald's test, which is the same as the first one where errors are white). Near an integrator a level may
//! be anything beside an initial condition and a pole, and k^2/var k says nothing: there N_e ln(V_0/V_1) > 8 ln N does
//! as well, where N_e = N var e/S(0) white samples tell a mean as well as N errors e of spectral density S do (Kent,
//! Biometrika 69, 1982, on likelihood ratios of models that do not hold).

mod beside;
mod normal_equations;
#[cfg(test)]
mod tests;
mod worth;

use std::time::Instant;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_numerics::optimize::{Objective, best_free, predicted_decrease};

use super::experiment_data::ExperimentData;
use super::predictor::InitialCondition;
use super::{
    ConvexFit, Estimate, Initial, Method, Monitor, Procedure, Search, arx, estimate_of_channels, exact,
    prediction_error,
};
use crate::Error;
use crate::data::Offset;
use crate::estimate::Criteria;
use crate::model::{OffsetCovariance, Orders, Quantity, Structure};
pub(crate) use beside::Beside;
pub(crate) use normal_equations::LinearProblem;
pub(crate) use worth::pays;
use worth::{OfConstant, is_worth, lowers_mdl, white_samples};

/// A search for a constant begins where a step predicts this fraction of what it must be worth.
const PROMISING: f64 = 0.5;
/// A constant that is worth this many times its price needs no comparison with a model without it.
const CERTAIN: f64 = 2.0;
/// The same of a constant that is not sure by its own error: the colour of slow errors is seen poorly in short logs.
const CLEAR: f64 = 8.0;

/// Whether a constant is estimated with the parameters: the level of the output where the inputs are at their offsets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Constant {
    /// Where it lowers MDL.
    #[default]
    Auto,
    /// Always.
    Yes,
    /// Never.
    No,
}

/// What to estimate, beside the constant.
pub(crate) struct Task<'a, D> {
    pub(crate) data: &'a D,
    /// The inputs' names.
    pub(crate) inputs: &'a [String],
    pub(crate) orders: &'a Orders,
    pub(crate) method: &'a Method,
    pub(crate) initial: Initial,
    pub(crate) monitor: Monitor<'a>,
}

/// An estimate, and the offset that was found with it.
#[derive(Debug)]
pub(crate) struct Fitted {
    /// The model's own parameters.
    pub(crate) estimate: Estimate,
    /// Those of all parameters.
    pub(crate) criteria: Criteria,
    pub(crate) offset: Option<OutputOffset>,
    /// The uncertainty of the offset that was found.
    pub(crate) open: Option<OffsetCovariance>,
}

/// An estimate with a constant, and what that is worth.
struct WithConstant {
    fitted: Fitted,
    /// In units of its price: (k/its standard error)^2 over ln N, where that is known.
    worth: Option<f64>,
    /// N_e/N, where the errors may have a colour.
    white_samples: Option<f64>,
}

/// The line that is to be taken from the output, beside what was taken before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct OutputOffset {
    pub(crate) offset: Offset,
    /// Its value in the middle of the estimation rows.
    pub(crate) level: Quantity,
    /// In the output's units per second, where there is a trend.
    pub(crate) slope: Option<Quantity>,
    /// That middle, in seconds from the log's first row.
    pub(crate) middle: f64,
}

impl Fitted {
    /// An estimate beside which no offset was looked for.
    pub(crate) fn without_offset(estimate: Estimate) -> Self {
        Self { criteria: estimate.criteria(), estimate, offset: None, open: None }
    }
}

impl<D> Clone for Task<'_, D> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<D> Copy for Task<'_, D> {}

impl<D: ExperimentData> Task<'_, D> {
    /// The estimate with a constant, if that is asked for or worth it, and with a trend, if `beside` has one. `start`
    /// has the parameters of a model with both, where a choice among models has found some.
    ///
    /// # Errors
    /// As for [`estimate`](super::estimate()); [`Error::Argument`] where the constant does not go with method or
    /// initial condition; [`Error::Undetermined`] where the data do not tell it, or there is no level.
    pub(crate) fn fit(
        &self,
        constant: Constant,
        beside: &Beside,
        start: Option<Vec<f64>>,
    ) -> Result<Fitted, Error> {
        let wanted = constant == Constant::Yes || beside.has_trend();
        match self.refusal() {
            Some(why) if wanted => return Err(Error::argument("constant", why)),
            Some(_) => return self.plain(start.map(|start| beside.without(self.orders, &start))),
            None if constant == Constant::No && !wanted => return self.plain(start),
            None => {}
        }
        if wanted {
            return self.wanted(beside, start);
        }
        match self.method {
            // These have no sum of squares that is least: the constant's own error says what it is worth.
            Method::InstrumentalVariables
            | Method::RefinedInstrumentalVariables
            | Method::Regularised(_)
            | Method::Robust(_) => {
                return match self.beside(beside, None) {
                    Ok(Some(WithConstant { fitted, worth: Some(worth), .. })) if worth > 1.0 => Ok(fitted),
                    _ => self.plain(None),
                };
            }
            Method::ExactLikelihood(_) => return self.by_likelihood(beside),
            // All parameters within a bound: a set, and no likelihood.
            Method::Constrained(ConvexFit { noise_bound: Some(_), .. }) => return self.plain(None),
            Method::Constrained(_) | Method::PredictionError(_) => {}
        }
        let started = Instant::now();
        // What a choice found with a constant comes close to the end.
        let with = start.as_ref().map(|start| self.beside(beside, Some(start.clone())));
        let with = match with {
            Some(Err(Error::Interrupted)) => return Err(Error::Interrupted),
            Some(Ok(Some(WithConstant { fitted, worth: Some(worth), .. }))) if worth > CERTAIN => {
                return Ok(fitted);
            }
            Some(Ok(found)) => found,
            _ => None,
        };
        let without = self.plain(start.map(|start| beside.without(self.orders, &start)))?;
        let WithConstant { fitted: with, worth, white_samples } = match with {
            Some(found) => found,
            None if self.promises(beside, &without.estimate) => {
                let from = beside.with_zeros(self.orders, without.estimate.parameters());
                let method = self.method_within(started);
                match (Task { method: &method, ..*self }).beside(beside, Some(from)) {
                    Err(Error::Interrupted) => return Err(Error::Interrupted),
                    Ok(Some(found)) => found,
                    Ok(None) | Err(_) => return Ok(without),
                }
            }
            None => return Ok(without),
        };
        let is_certain = white_samples.is_none_or(|share| {
            worth.is_none_or(|worth| worth > 1.0)
                || is_worth(&without.estimate, &with.estimate, share / CLEAR)
        });
        Ok(if is_certain && is_worth(&without.estimate, &with.estimate, 1.0) { with } else { without })
    }

    /// With a constant if that raises the exact likelihood by its price.
    fn by_likelihood(&self, beside: &Beside) -> Result<Fitted, Error> {
        let started = Instant::now();
        let without = self.plain(None)?;
        let from = beside.with_zeros(self.orders, without.estimate.parameters());
        let method = self.method_within(started);
        match (Task { method: &method, ..*self }).beside(beside, Some(from)) {
            Err(Error::Interrupted) => Err(Error::Interrupted),
            Ok(Some(WithConstant { fitted: with, .. }))
                if is_worth(&without.estimate, &with.estimate, 1.0) =>
            {
                Ok(with)
            }
            _ => Ok(without),
        }
    }

    /// Why there can be no constant.
    fn refusal(&self) -> Option<&'static str> {
        let exact = matches!(self.method, Method::ExactLikelihood(_));
        if self.initial == Initial::Zero && self.orders.na > 0 && !exact {
            return Some(
                "zeros before the first sample are not at the level that is to be found, and A reaches back to them; take \
                 another initial condition, or leave the constant out",
            );
        }
        match self.method {
            Method::Constrained(ConvexFit { ridge, .. }) if *ridge > 0.0 => {
                Some("a ridge would pull the level towards zero; leave one of the two out")
            }
            _ => None,
        }
    }

    /// The method with the time that is left since then.
    fn method_within(&self, started: Instant) -> Method {
        let mut method = self.method.clone();
        if let Method::PredictionError(search)
        | Method::ExactLikelihood(search)
        | Method::Constrained(ConvexFit { search, .. }) = &mut method
            && let Some(limit) = &mut search.time_limit
        {
            *limit = limit.saturating_sub(started.elapsed());
        }
        method
    }

    /// Without a constant.
    fn plain(&self, start: Option<Vec<f64>>) -> Result<Fitted, Error> {
        let method = starting_from(self.method, start);
        let Self { data, inputs, orders, initial, monitor, .. } = *self;
        let estimate = estimate_of_channels(data, inputs, orders, &method, initial, monitor)?;
        Ok(Fitted::without_offset(estimate))
    }

    /// With a constant, whatever it is worth.
    fn wanted(&self, beside: &Beside, start: Option<Vec<f64>>) -> Result<Fitted, Error> {
        let found = self.beside(beside, start).map(|found| found.map(|found| found.fitted));
        wanted(found, || self.plain(None))
    }

    /// With a constant, and what it is worth. None where there is no level.
    fn beside(&self, beside: &Beside, start: Option<Vec<f64>>) -> Result<Option<WithConstant>, Error> {
        let all = self.all(beside, start)?;
        let place = beside.places(self.orders).start;
        let variance = all.covariance().map(|covariance| covariance[place][place]);
        let worth =
            variance.map(|variance| all.parameters()[place].powi(2) / variance / (all.samples() as f64).ln());
        let white_samples = (self.orders.structure() == Structure::Oe).then(|| {
            let signals = beside.signals();
            let (data, orders) =
                (self.data.with_inputs(&signals), self.orders.with_constants(beside.count()));
            white_samples(&data, &orders, &all).unwrap_or(0.0)
        });
        Ok(beside.apart(self.orders, all).map(|fitted| WithConstant { fitted, worth, white_samples }))
    }

    /// The estimate of all parameters, the constant and the trend among them.
    fn all(&self, beside: &Beside, start: Option<Vec<f64>>) -> Result<Estimate, Error> {
        let signals = beside.signals();
        let data = self.data.with_inputs(&signals);
        let orders = self.orders.with_constants(beside.count());
        // Initial parameters of the model alone are some of it with zeros.
        let own = match self.method {
            Method::PredictionError(Search { initial_parameters: Some(own), .. })
            | Method::ExactLikelihood(Search { initial_parameters: Some(own), .. })
                if own.len() == self.orders.parameters() =>
            {
                Some(beside.with_zeros(self.orders, own))
            }
            _ => None,
        };
        let method = starting_from(self.method, start.or(own));
        // Zeros before the first sample, to which A reaches back, are not at the level.
        let initial = match self.initial {
            Initial::Auto if self.orders.na > 0 && orders.nf.iter().any(|&nf| nf > 0) => Initial::Estimate,
            initial => initial,
        };
        estimate_of_channels(&data, self.inputs, &orders, &method, initial, self.monitor)
    }

    /// What an estimate without a constant leaves open of an offset that was taken off before, as a mean or a line: the
    /// covariance that all parameters would have if it were estimated with them, and the square of what that would
    /// change, as it was not. None where the covariance of the parameters is not known.
    ///
    /// With d = (d theta, k, m) the step from (theta, 0, 0) to the estimate of all, whose error has the covariance P,
    ///
    /// ```text
    /// E (error of (theta, 0, 0)) (…)' = P + d d'.
    /// ```
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub(crate) fn left_open(
        &self,
        beside: &Beside,
        without: &Estimate,
    ) -> Result<Option<OffsetCovariance>, Error> {
        if without.covariance().is_none() || without.noise_variance() <= 0.0 {
            return Ok(None);
        }
        let found = match without.procedure() {
            Procedure::LeastSquares { .. } | Procedure::Constrained(_) if !beside.has_trend() => {
                let record = self.data.record();
                let of = record.and_then(|record| OfConstant::new(record, self.orders, without));
                of.map(|of| of.joint(without))
            }
            Procedure::InstrumentalVariables { .. } | Procedure::Regularised(_) | Procedure::Robust(_) => {
                match self.all(beside, None) {
                    Err(Error::Interrupted) => return Err(Error::Interrupted),
                    Ok(all) => all.covariance().map(|rows| {
                        let from = beside.with_zeros(self.orders, without.parameters());
                        let step = all.parameters().iter().zip(from).map(|(to, from)| to - from);
                        (rows.to_vec(), step.collect())
                    }),
                    Err(_) => None,
                }
            }
            procedure => {
                let signals = beside.signals();
                let (data, orders) =
                    (self.data.with_inputs(&signals), self.orders.with_constants(beside.count()));
                let parameters = beside.with_zeros(self.orders, without.parameters());
                match (procedure, data.record()) {
                    (Procedure::ExactLikelihood(_), Some(record)) => {
                        exact::beside(record, beside.count(), &orders, without, &parameters)
                    }
                    _ => prediction_error::beside(&data, &orders, without, &parameters),
                }
            }
        };
        Ok(found.and_then(|(rows, step)| beside.open(self.orders, &rows, &step, [0.0; 2])))
    }

    /// Whether a constant beside the parameters of this estimate may be worth its price.
    fn promises(&self, beside: &Beside, without: &Estimate) -> bool {
        if without.mse() == 0.0 {
            return false;
        }
        if let (true, Some(record)) = (self.orders.is_linear(), self.data.record()) {
            // Of another norm least squares says it: a constant takes the mean off the errors in either.
            let squares = match self.method {
                Method::Constrained(_) => {
                    let Ok(squares) = arx(record, self.orders, self.initial) else { return false };
                    squares
                }
                _ => without.clone(),
            };
            return lowers_mdl(record, self.orders, &squares);
        }
        let samples = without.samples() as f64;
        let signals = beside.signals();
        let data = self.data.with_inputs(&signals);
        let orders = self.orders.with_constants(beside.count());
        let parameters = beside.with_zeros(self.orders, without.parameters());
        let known = without.procedure().initial_conditions() as f64;
        let from = |begin| {
            let mut predictor = data.errors(&orders, begin);
            if begin == InitialCondition::Unknown && known > predictor.initial_conditions() as f64 {
                predictor = data.errors(&orders, InitialCondition::UnknownInputs);
            }
            let price = (1.0 + predictor.initial_conditions() as f64 - known) * samples.ln();
            let count = predictor.samples() as f64;
            let Ok(cost) = best_free(&mut predictor, &parameters) else { return false };
            let left = (cost - predicted_decrease(&mut predictor)).max(0.0);
            samples * (without.mse() * count / left).ln() > PROMISING * price
        };
        let rests = without.initial() == Initial::Zero;
        // What seemed to begin at rest may have begun elsewhere.
        let open = !rests || self.initial == Initial::Auto && orders.nf.iter().any(|&nf| nf > 0);
        rests && orders.na == 0 && from(InitialCondition::Zero) || open && from(InitialCondition::Unknown)
    }
}

/// The estimate with a constant, or why there is none.
fn wanted(
    with: Result<Option<Fitted>, Error>,
    without: impl FnOnce() -> Result<Fitted, Error>,
) -> Result<Fitted, Error> {
    let missing = |message: &str| Error::undetermined(vec!["constant".to_owned()], message);
    match with {
        Ok(Some(found)) => Ok(found),
        Ok(None) => Err(missing(
            "the model has an integrator, A(1) = 0: its output has no level to be estimated; leave the constant out, or \
             fit differences of the output",
        )),
        // What the data leave open without a constant has its own words.
        Err(Error::Undetermined { .. }) => Err(without().err().unwrap_or_else(|| {
            missing(
                "the data cannot tell the constant or the trend from the other parameters, or have too few rows for both; \
                 leave it out, or give more rows",
            )
        })),
        Err(error) => Err(error),
    }
}

/// A search begins from these parameters too.
fn starting_from(method: &Method, start: Option<Vec<f64>>) -> Method {
    match (method, start) {
        (Method::PredictionError(search), Some(start)) => {
            Method::PredictionError(Search { initial_parameters: Some(start), ..search.clone() })
        }
        (Method::ExactLikelihood(search), Some(start)) => {
            Method::ExactLikelihood(Search { initial_parameters: Some(start), ..search.clone() })
        }
        _ => method.clone(),
    }
}
