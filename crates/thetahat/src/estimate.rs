//! From a record and orders to parameters.
//!
//! - [`estimate()`] fits the model that [`Orders`] say to a [`Record`] by a [`Method`] and gives an [`Estimate`];
//!   [`estimate_monitored`] tells a [`Monitor`] of its progress. [`Initial`] says what stands for the samples before
//!   the first.
//! - [`arx`] is its short form for models that are linear in their parameters. [`arx_factor`] gives a triangular factor
//!   that merges with those of other records.
//! - [`subspace()`] finds the states of a record with several outputs ([`SubspaceOptions`] with a [`Weighting`]); of
//!   the [`Subspace`] a [`StateSpace`](crate::model::StateSpace) of any order is read off, and an [`OrderScore`] says
//!   how well it predicts.
//! - A [`BlockStructure`] says how linear systems and curves, of a [`CurveForm`], follow one another in a model in
//!   blocks.
//! - Methods have settings: a [`Search`], [`Robust`] (a [`Loss`]), [`ConvexFit`] (a
//!   [`Norm`], [`Bound`]s and [`GainBound`]s), [`LikelihoodSearch`] for models in equations ([`UnknownParameter`]).
//!   [`Constant`] says whether the level of the output is estimated too.
//! - [`Procedure`] says how an estimate was found: by a [`Solver`], or with a [`SearchOutcome`] ([`StartOutcome`]),
//!   [`ConvexOutcome`], [`RobustOutcome`], [`LikelihoodOutcome`], [`EquationsOutcome`] (with [`ProfileInterval`]s),
//!   [`SharedPolesOutcome`], [`SubspaceOutcome`] (with a
//!   [`RefinementOutcome`] where it was followed by a search for what [`Refine`] says), [`VectorArxOutcome`] (of
//!   [`VectorArxOptions`] with [`VectorArxInputs`] and a [`Coupling`]; a [`VectorArxScore`] for each model) or
//!   [`MapsOutcome`] (for each output a [`TermsOutcome`]: a path of [`TermStep`]s with their [`RunFigures`]).
//! - [`NoiseStructure`] says what is unknown of the noises of a model in matrices.
//! - [`Criteria`] are the values of each [`InformationCriterion`].
//!
//! The methods and their sources are at [`Method`]; the theory is that of Ljung, System Identification, 2nd ed. 1999,
//! chapters 7 and 10.
//!
//! ```
//! use thetahat::data::Record;
//! use thetahat::estimate::{Initial, arx};
//! use thetahat::model::Orders;
//!
//! let u = [1.0, -1.0, 2.0, 0.0, 1.0];
//! let y = [0.0, 2.0, -1.0, 3.5, 1.75]; // y(t) = 0.5 y(t-1) + 2 u(t-1)
//! let estimate = arx(&Record::new(&y, vec![&u])?, &Orders::arx(1, &[1], &[1])?, Initial::Drop)?;
//! assert!((estimate.parameters()[0] + 0.5).abs() < 1e-12); // a1
//! assert!((estimate.parameters()[1] - 2.0).abs() < 1e-12); // b1
//! # Ok::<(), thetahat::Error>(())
//! ```

mod arima;
mod arx;
mod blocks;
mod common;
mod criteria;
mod criterion;
mod distributed;
pub(crate) mod equations;
mod exact;
mod experiment_data;
mod impulse_response;
mod initial;
mod instrumental;
mod minimax;
mod noise_integrator;
pub(crate) mod noises;
pub(crate) mod nonlinear_arx;
mod offset;
mod outcome;
mod plant_first;
mod polynomials;
mod prediction_error;
mod predictor;
mod procedure;
mod process;
mod projection;
mod refinement;
mod reflection;
mod response_points;
mod restart;
mod robust;
mod shared_poles;
mod stability_boundary;
mod start;
mod subspace;
#[cfg(test)]
mod tests;
mod thinning;
mod uncertainty;
mod vector_arx;

use std::ops::ControlFlow;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_numerics::optimize::{Monitor, Search, Stopped};

use crate::Error;
use crate::data::Record;
use crate::model::{Orders, Structure};
use crate::model::{PolynomialModel, Signal};
pub(crate) use arima::{ArimaData, ArimaEstimate, arima};
pub use arx::{arx, arx_factor};
pub(crate) use arx::{enough, estimate_is_for_f, lagged_products, out_of_range, taps};
pub use blocks::{BlockStructure, CurveForm};
pub(crate) use blocks::{BlocksOptions, blocks};
pub(crate) use common::{Common, Point, Window};
pub use criteria::{Criteria, InformationCriterion};
pub use criterion::{Bound, ConvexFit, ConvexOutcome, GainBound, Norm};
pub use distributed::{Answer, Ask, Question};
pub(crate) use distributed::{Distributed, DistributedLikelihood, Holders};
pub use equations::{EquationsOutcome, LikelihoodSearch, ProfileInterval, UnknownParameter};
pub use exact::LikelihoodOutcome;
pub(crate) use experiment_data::ExperimentData;
pub use impulse_response::{Kernel, KernelParameters, RegularisedOutcome};
pub use initial::Initial;
pub(crate) use noise_integrator::with_noise_integrator;
pub use noises::NoiseStructure;
pub use nonlinear_arx::{MapsOutcome, RunFigures, TermStep, TermsOutcome, TrainingOutcome};
pub use offset::Constant;
pub(crate) use offset::{Beside, Fitted, LinearProblem, OutputOffset, Task, pays};
pub use outcome::{ProgramsOutcome, SearchOutcome, StartOutcome};
pub(crate) use plant_first::noise_order;
pub(crate) use polynomials::extended;
pub(crate) use prediction_error::drop_is_not_for_f;
use procedure::FilteredCovariance;
pub(crate) use procedure::NullDistribution;
pub use process::ProcessOutcome;
pub(crate) use process::{
    Background, FreeRun, ProcessEstimate, least_free_run, least_free_run_from, least_response_errors,
};
pub use refinement::{Refine, RefinementOutcome};
pub(crate) use refinement::{Refinement, RefinementStart, refined};
pub(crate) use response_points::ResponsePoints;
pub use robust::{Loss, Robust, RobustOutcome};
pub use shared_poles::SharedPolesOutcome;
pub(crate) use shared_poles::{SharedPoles, shared_poles};
pub use subspace::{OrderScore, Subspace, SubspaceOptions, SubspaceOutcome, Weighting, subspace};
pub(crate) use subspace::{
    Ordered, SegmentStart, SubspaceErrors, SubspaceSums, joint_products, joint_taps, products_of_innovations,
    with_levels,
};
pub use thetahat_numerics::regression::Solver;
pub(crate) use thinning::{LONG, segments_of_starts, thinned_to};
pub(crate) use uncertainty::{Autoregression, autoregression, backward_filtered_products, coloured};
pub use vector_arx::{Coupling, VectorArxInputs, VectorArxOptions, VectorArxOutcome, VectorArxScore};
pub(crate) use vector_arx::{VectorArxEstimate, vector_arx, vector_arx_of_sums};

/// How an estimate was found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "method", rename_all = "kebab-case")]
pub enum Procedure {
    /// In one step, as the predictor is linear in the parameters.
    LeastSquares {
        /// How the least-squares problem was solved.
        solver: Solver,
    },
    /// By instrumental variables in four stages: A and B, whatever the colour of the noise.
    InstrumentalVariables {
        /// The order of the autoregression that the signals of the last stage are filtered by.
        filter_order: usize,
        /// The order of the autoregression of the residuals that the covariance rests on.
        residual_order: usize,
    },
    /// By refined instrumental variables: B and F, whatever the colour of the noise.
    RefinedInstrumentalVariables {
        /// Iterations done, from the best start.
        iterations: usize,
        /// Why they stopped.
        stopped: Stopped,
        /// The initial conditions that were estimated.
        initial_conditions: usize,
        /// The order of the autoregression of the residuals that the covariance rests on.
        residual_order: usize,
    },
    /// By a search for the least sum of squared prediction errors.
    PredictionError(SearchOutcome),
    /// By regularised least squares, with the kernel of the largest marginal likelihood.
    Regularised(RegularisedOutcome),
    /// By convex optimization.
    Constrained(ConvexOutcome),
    /// By a search for the least sum of a loss that does not follow wild samples.
    Robust(RobustOutcome),
    /// By a search for the largest likelihood of all measured outputs.
    ExactLikelihood(LikelihoodOutcome),
    /// The largest likelihood of the innovations of a model in equations.
    InnovationsLikelihood(EquationsOutcome),
    /// In one step for functions of the regressors, which were chosen one after the other.
    ForwardRegression(MapsOutcome),
    /// In one step for local models, whose boxes were split one after the other.
    Splits(MapsOutcome),
    /// By the samples themselves.
    Neighbours(MapsOutcome),
    /// By a search for all numbers of a map, from several starts.
    Training(MapsOutcome),
    /// By a search for the least errors of the free run of a process in continuous time.
    FreeRun(ProcessOutcome),
    /// By a search for the least errors of the frequency response of a process.
    FrequencyResponse(ProcessOutcome),
    /// By a subspace method: the states first, then the matrices.
    Subspace(SubspaceOutcome),
    /// By a search for the least errors of the frequency response of a state-space model.
    SharedPoles(SharedPolesOutcome),
    /// Of several outputs at once, by least squares: A(q) y = B(q) u + e with matrices for coefficients.
    VectorArx(VectorArxOutcome),
    /// Not at all: the numbers of the model were given.
    Given,
}

/// How to estimate.
#[derive(Debug, Clone, PartialEq)]
pub enum Method {
    /// The least sum of squared prediction errors: in one step where they are linear in the parameters, else by a
    /// search.
    PredictionError(Search),
    /// Instrumental variables in four stages, for ARX models: consistent in noise of any colour (Söderström and Stoica
    /// 1983).
    InstrumentalVariables,
    /// Refined instrumental variables, for models of output error (Young 1976).
    RefinedInstrumentalVariables,
    /// Another norm of the errors, or bounds on what the parameters may be, for models that are linear in their
    /// parameters.
    Constrained(ConvexFit),
    /// Regularised least squares for impulse responses, y = B u + e, with a kernel whose parameters are those of the
    /// largest marginal likelihood (Chen, Ohlsson and Ljung 2012). The parameters' covariance is that of the posterior
    /// distribution. Cost: O(N p) and O(p^3) in each of some dozen steps, for p taps.
    ///
    /// ```
    /// use thetahat::data::Record;
    /// use thetahat::estimate::{Initial, Kernel, Method, estimate};
    /// use thetahat::model::Orders;
    ///
    /// // g(i) = 0.8^i, seen with noise, from few samples for 40 taps.
    /// let (mut x, mut random) = (0.0, 1_u32);
    /// let mut next = || {
    ///     random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    ///     f64::from(random >> 8) / f64::from(1 << 23) - 1.0
    /// };
    /// let u: Vec<f64> = (0..150).map(|_| next()).collect();
    /// let y: Vec<f64> = u.iter().map(|u| { x = 0.8 * x + u; x + 0.3 * next() }).collect();
    /// let orders = Orders::arx(0, &[40], &[0])?;
    /// let record = Record::new(&y, vec![&u])?;
    /// let found = estimate(&record, &orders, &Method::Regularised(Kernel::Dc), Initial::Drop)?;
    /// let error = |g: &[f64]| (0..40).map(|i| (g[i as usize] - 0.8_f64.powi(i)).powi(2)).sum::<f64>();
    /// let plain = estimate(&record, &orders, &Method::default(), Initial::Drop)?;
    /// assert!(error(found.parameters()) < 0.2 * error(plain.parameters()));
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    Regularised(Kernel),
    /// A loss of the prediction errors that grows like |e|, for any structure (Huber 1981).
    Robust(Robust),
    /// The largest likelihood of all measured outputs, by the Kalman filter, for A y = B u + C e with a stable A:
    /// through missing outputs, and without a first sample left out (Harvey 1989). The covariance is that of the
    /// information of the parameters.
    ///
    /// The response to the inputs begins at rest ([`Initial::Zero`]), or in a state that is estimated
    /// ([`Initial::Estimate`]); auto takes the second where samples were measured before a segment, or it is worth its
    /// parameters. The process C/A e begins with its stationary covariance. An iteration takes O(N (m^2 (na + nc) + m
    /// p + p^2)), m = max(na, nc); without missing outputs the first term is soon over.
    ///
    /// ```
    /// use thetahat::data::{Channel, Log};
    /// use thetahat::estimate::{Initial, Method, Procedure, estimate};
    /// use thetahat::optimize::Search;
    /// use thetahat::model::Orders;
    ///
    /// let (mut y, mut noise) = (vec![0.0], 1_u32);
    /// for t in 1..200 {
    ///     noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    ///     y.push(0.8 * y[t - 1] + f64::from(noise >> 16) / 32_768.0 - 1.0);
    /// }
    /// (0..200).filter(|t| t * 3 % 10 < 3).for_each(|t| y[t] = f64::NAN);
    /// let log = Log::new(vec![Channel { name: "y".into(), values: y }], 1.0)?;
    /// let record = log.driven_record(&[], "y", &["1..200".parse()?])?;
    /// let method = Method::ExactLikelihood(Search::default());
    /// let found = estimate(&record, &Orders::arx(1, &[], &[])?, &method, Initial::Auto)?;
    /// assert_eq!(found.samples(), 140);
    /// assert!((found.parameters()[0] + 0.8).abs() < 0.1); // a1
    /// assert!(matches!(found.procedure(), Procedure::ExactLikelihood(found) if found.log_likelihood.is_some()));
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    ExactLikelihood(Search),
}

impl Default for Method {
    fn default() -> Self {
        Self::PredictionError(Search::default())
    }
}

/// Fits A(q) y(t) = sum_j B_j(q)/F_j(q) u_j(t - nk_j) + C(q)/D(q) e(t) to a record.
///
/// The structure follows from the orders. Bounds on static gains call the inputs `u1`, `u2`, ….
///
/// # Errors
/// [`Error::Argument`] if the record does not have the orders' inputs, or the method or initial condition is not for
/// this structure; [`Error::Undetermined`] if there are too few samples or the data cannot determine the parameters;
/// [`Error::Data`] if squares of the signals leave the range of `f64`.
///
/// ```
/// use thetahat::data::Record;
/// use thetahat::estimate::{Initial, Method, estimate};
/// use thetahat::model::Orders;
///
/// // x(t) = 0.8 x(t-1) + u(t-1) from rest, seen with a small disturbance.
/// let u: Vec<f64> = (0..200_u32).map(|t| f64::from(t * t % 11) - 5.0).collect();
/// let mut x = vec![0.0];
/// for t in 1..u.len() {
///     x.push(0.8 * x[t - 1] + u[t - 1]);
/// }
/// let y: Vec<f64> = x.iter().zip(0_u32..).map(|(x, t)| x + 0.01 * f64::from(t * 7 % 13)).collect();
/// let orders = Orders::oe(&[1], &[1], &[1])?;
/// let record = Record::new(&y, vec![&u])?;
/// let found = estimate(&record, &orders, &Method::default(), Initial::Zero)?;
/// assert!((found.parameters()[0] - 1.0).abs() < 0.01); // b1
/// assert!((found.parameters()[1] + 0.8).abs() < 0.01); // f1
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn estimate(
    record: &Record<'_>,
    orders: &Orders,
    method: &Method,
    initial: Initial,
) -> Result<Estimate, Error> {
    estimate_monitored(record, orders, method, initial, &|_| ControlFlow::Continue(()))
}

/// [`estimate`] that tells `monitor` of each iteration of a search, on the thread that does it. The monitor may end it.
///
/// # Errors
/// As for [`estimate`]; [`Error::Interrupted`] if the monitor says so.
pub fn estimate_monitored(
    record: &Record<'_>,
    orders: &Orders,
    method: &Method,
    initial: Initial,
    monitor: Monitor<'_>,
) -> Result<Estimate, Error> {
    let inputs: Vec<String> = (1..=orders.inputs()).map(|number| format!("u{number}")).collect();
    estimate_of_channels(record, &inputs, orders, method, initial, monitor)
}

/// The same with the inputs' names, which bounds on their static gains use. The last inputs may have none: those of a
/// constant and a trend. Data that are not at hand are for a search of prediction errors.
pub(crate) fn estimate_of_channels(
    data: &impl ExperimentData,
    inputs: &[String],
    orders: &Orders,
    method: &Method,
    initial: Initial,
    monitor: Monitor<'_>,
) -> Result<Estimate, Error> {
    let of_plant = |search: &Search| search.plant_first && orders.structure() != Structure::Oe;
    let record = match (method, data.record()) {
        (Method::PredictionError(search), record) if record.is_none() || !of_plant(search) => {
            return prediction_error::prediction_error(data, orders, initial, search, monitor);
        }
        (_, Some(record)) => record,
        (_, None) => {
            return Err(Error::argument("method", "experiments that others hold are fitted by a search"));
        }
    };
    match method {
        Method::PredictionError(search) => {
            plant_first::plant_first(record, inputs.len(), orders, initial, search, monitor)
        }
        Method::Regularised(kernel) => {
            impulse_response::impulse_response(record, inputs.len(), orders, initial, *kernel)
        }
        Method::Robust(how) => robust::robust(record, orders, initial, how, monitor),
        Method::ExactLikelihood(search) => {
            let lines = orders.inputs().saturating_sub(inputs.len());
            exact::exact(record, lines, orders, initial, search, monitor)
        }
        Method::InstrumentalVariables => instrumental::instrumental_variables(record, orders, initial),
        Method::RefinedInstrumentalVariables => {
            instrumental::refined_instrumental_variables(record, orders, initial)
        }
        Method::Constrained(demands) if !orders.is_linear() => {
            minimax::minimax(record, orders, initial, demands, monitor)
        }
        Method::Constrained(demands) => {
            let (initial, presample) = arx::resolved(initial)?;
            let found = criterion::constrained(record, inputs, orders, presample, demands)?;
            let unknown = (found.samples - found.parameters.len()) as f64;
            Ok(Estimate {
                parameters: found.parameters,
                covariance: found.covariance,
                noise_variance: found.sum_of_squares / unknown,
                samples: found.samples,
                mse: found.sum_of_squares / found.samples as f64,
                condition: Some(found.condition),
                initial,
                procedure: Procedure::Constrained(found.outcome),
            })
        }
    }
}

/// Estimated parameters and what is known about them.
///
/// With prediction errors e(t, theta) over N samples, p parameters and n initial conditions: theta-hat minimises sum
/// e^2, sigma^2 = sum e^2 / (N - p - n), cov = sigma^2 (sum psi psi')^-1 with psi = -de/dtheta, the initial conditions
/// taken out (Ljung, System Identification, 2nd ed. 1999, sections 7.3 and 9.3).
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    parameters: Vec<f64>,
    covariance: Option<Vec<Vec<f64>>>,
    noise_variance: f64,
    samples: usize,
    mse: f64,
    condition: Option<f64>,
    initial: Initial,
    procedure: Procedure,
}

impl Estimate {
    /// The model with these parameters.
    ///
    /// # Errors
    /// [`Error::Data`] if a coefficient or the variance overflows, or roots do not converge.
    pub fn to_model(
        &self,
        orders: &Orders,
        sample_time: f64,
        inputs: Vec<Signal>,
        output: Signal,
    ) -> Result<PolynomialModel, Error> {
        let Self { parameters, noise_variance, .. } = self;
        let model = PolynomialModel::from_parameters(
            orders,
            parameters,
            self.covariance(),
            *noise_variance,
            sample_time,
        )?
        .with_degrees_of_freedom(self.degrees_of_freedom())?;
        if !self.criteria().of(InformationCriterion::FPE).is_some_and(f64::is_finite) {
            return Err(Error::data("the noise variance overflows; scale the output towards one"));
        }
        Ok(PolynomialModel { inputs, output, ..model })
    }

    /// theta-hat, in the order of [`Orders::names`](crate::model::Orders::names).
    pub fn parameters(&self) -> &[f64] {
        &self.parameters
    }

    /// The covariance matrix of theta-hat, row by row; none where no theory gives one.
    pub fn covariance(&self) -> Option<&[Vec<f64>]> {
        self.covariance.as_deref()
    }

    /// sigma^2, in the units of y squared.
    pub fn noise_variance(&self) -> f64 {
        self.noise_variance
    }

    /// By how much the sum of squared errors was divided to give sigma^2: N less the parameters and the initial
    /// conditions that were estimated. None where sigma^2 is zero.
    pub fn degrees_of_freedom(&self) -> Option<usize> {
        let degrees = (self.mse * self.samples as f64 / self.noise_variance).round();
        (degrees >= 1.0 && degrees <= self.samples as f64).then_some(degrees as usize)
    }

    /// N, the samples that count.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// The mean of e^2 over these samples; for exact likelihood that of v^2/f, innovations over their variances in
    /// units of var e: the estimate of var e that makes the likelihood largest.
    pub fn mse(&self) -> f64 {
        self.mse
    }

    /// The mean of e^2 of an estimate of least squared errors that has the same likelihood, in which every f is 1.
    pub(crate) fn cost(&self) -> f64 {
        self.procedure.exact_likelihood().and_then(LikelihoodOutcome::cost).unwrap_or(self.mse)
    }

    /// The condition number of psi, its columns scaled to unit norm; none where they are dependent.
    pub fn condition(&self) -> Option<f64> {
        self.condition
    }

    /// What stood for the samples before the first: never [`Initial::Auto`].
    pub fn initial(&self) -> Initial {
        self.initial
    }

    /// How it was found.
    pub fn procedure(&self) -> &Procedure {
        &self.procedure
    }

    /// What the estimate from prefiltered signals says of those that are not: their noise variance, and the covariance
    /// of the parameters with filtered errors, which have a colour where e is white. None for convex criteria and
    /// robust ones, but of output error.
    pub(crate) fn of_prefiltered(self, record: &Record<'_>, orders: &Orders, noise_variance: f64) -> Self {
        let covariance = match self.procedure.filtered_covariance(orders.structure() == Structure::Oe) {
            FilteredCovariance::OfColouredErrors => {
                prediction_error::coloured_covariance(record, orders, &self)
            }
            FilteredCovariance::Own => self.covariance,
            FilteredCovariance::Unknown => None,
        };
        Self { covariance, noise_variance, ..self }
    }

    /// Those of the exact likelihood where that was made large: AIC = (2 p - 2 ln L)/N - ln 2 pi - 1, and the others
    /// alike.
    pub fn criteria(&self) -> Criteria {
        // Those that a prior holds are no more free.
        let effective =
            self.procedure.regularised().map(|outcome| outcome.effective_parameters.round() as usize);
        let parameters = effective.unwrap_or(self.parameters.len());
        Criteria::new(self.cost(), parameters, self.samples)
    }
}
