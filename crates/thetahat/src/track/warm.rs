//! A tracker that goes on from a fit.

mod several;

use thetahat_core::Covariance;
use thetahat_core::nalgebra::{DMatrix, DVector};

use super::checks::{check, check_map};
use super::estimator::Estimator;
use super::plan::{PerChannel, TrackPlan};
use super::tracker::{Stage, Tracker};
use crate::Error;
use crate::model::{NonlinearArxModel, Orders, Parameter, PolynomialModel, Signal};
use crate::report::Report;

/// What P_jj of a parameter that nothing is known of is times the square of its scale, as
/// [`RecursiveLeastSquares`](thetahat_core::RecursiveLeastSquares) has it. The scale of the constant is 1.
const PRIOR: f64 = 100.0;

impl Tracker {
    /// A tracker that starts from what a fit found, a report of AR, ARX, ARMA, ARMAX or nonlinear ARX: its parameters,
    /// its covariance divided by its noise variance as P, its noise variance and number of samples, its offsets.
    ///
    /// The orders are those of the report; of a nonlinear model the functions and scales too. Scales that the plan does
    /// not have follow from P: the regressor of parameter j has the magnitude 1/sqrt(N P_jj) at least, N being the
    /// number of samples, and a channel the largest of its parameters'. So there are no rows to collect. The noise
    /// scale is the square root of the noise variance. A constant is not in the report: it starts from 0, and is as
    /// free as without a report.
    ///
    /// # Errors
    /// As [`Tracker::new`]; [`Error::Report`] if the report is of another structure; if it has no covariance or a noise
    /// variance of 0, or an offset that is a line in time; [`Error::Argument`] if the plan asks for another start than
    /// `standard`.
    pub fn from_report(report: &Report, plan: &TrackPlan) -> Result<Self, Error> {
        check_start(plan)?;
        if let Some(model) = report.model.as_nonlinear_arx() {
            return Self::from_nonlinear(model, report.estimation.samples, plan);
        }
        let model = polynomials(report)?;
        check(&model.orders, plan)?;
        let relative = relative(model)?;
        let mut plan = plan.clone();
        plan.offsets = Some(match plan.offsets {
            Some(given) => given,
            None => offsets(&model.inputs, &model.output)?,
        });
        if plan.scales.is_none() {
            plan.scales = Some(scales(&model.orders, &relative, report.estimation.samples));
        }
        plan.noise_scale = plan.noise_scale.or(Some(model.noise_variance.sqrt()));
        // What was given passed before: what does not pass now is what follows from the report.
        check(&model.orders, &plan).map_err(unusable)?;
        let tracker = Self::new(&model.orders, &plan)?;
        let constant = plan.constant.then_some(model.parameters.len() - model.orders.nc);
        tracker.with_parameters(
            &model.parameters,
            constant,
            &relative,
            model.noise_variance,
            report.estimation.samples,
        )
    }

    /// The same with what a fit knows: its parameters, and the place of a constant that it does not know of.
    fn with_parameters(
        mut self,
        known: &[Parameter],
        constant: Option<usize>,
        relative: &DMatrix<f64>,
        variance: f64,
        samples: usize,
    ) -> Result<Self, Error> {
        let Stage::Running(estimator) = self.stage else { return Ok(self) };
        // Where the constant stands, those of C are one place on.
        let place = |index: usize| index + usize::from(constant.is_some_and(|constant| index >= constant));
        let count = self.names.len();
        let mut parameters = DVector::zeros(count);
        let mut covariance = DMatrix::zeros(count, count);
        for (row, parameter) in known.iter().enumerate() {
            parameters[place(row)] = parameter.value;
            for column in 0..known.len() {
                covariance[(place(row), place(column))] = relative[(row, column)];
            }
        }
        if let Some(constant) = constant {
            covariance[(constant, constant)] = PRIOR;
        }
        let covariance = Covariance::new(&covariance).map_err(unusable)?;
        let estimator = match *estimator {
            Estimator::Arx(arx) => arx
                .with_parameters(parameters)
                .and_then(|arx| arx.with_covariance(covariance)?.with_noise_variance(variance, samples))
                .map(Estimator::Arx),
            Estimator::Armax(armax) => armax
                .with_parameters(parameters)
                .and_then(|armax| armax.with_covariance(covariance)?.with_noise_variance(variance, samples))
                .map(Estimator::Armax),
            Estimator::Narx(narx) => narx
                .with_parameters(parameters)
                .and_then(|narx| narx.with_covariance(covariance)?.with_noise_variance(variance, samples))
                .map(Estimator::Narx),
        };
        self.stage = Stage::Running(Box::new(estimator.map_err(unusable)?));
        // The noise variance is known from the start.
        self.settling = 0;
        Ok(self)
    }

    /// The same for a nonlinear model, whose scales are its own.
    fn from_nonlinear(model: &NonlinearArxModel, samples: usize, plan: &TrackPlan) -> Result<Self, Error> {
        model.check()?;
        let orders = model.lag_orders()?;
        let (output, map) = model.single("a recursion")?;
        let noise_variance = model.noise_covariance[0][0];
        let names: Vec<String> = model.parameters.iter().map(|parameter| parameter.name.clone()).collect();
        check(&orders, plan)?;
        check_map(&orders, &map.functions, &names, plan)?;
        if plan.scales.is_some() {
            return Err(Error::argument("scale", "a nonlinear model has its own scales; leave it out"));
        }
        let count = names.len();
        let square = map.scale * map.scale;
        let relative =
            relative_covariance(model.covariance.as_deref(), noise_variance / square, count, count)?;
        let scale = |name: &str| {
            let own = model.regressors.iter().find(|regressor| regressor.channel == name);
            own.map_or(1.0, |regressor| regressor.scale)
        };
        let mut plan = plan.clone();
        plan.offsets = Some(match plan.offsets {
            Some(given) => given,
            None => offsets(&model.inputs, output)?,
        });
        let inputs = model.inputs.iter().map(|input| scale(&input.name)).collect();
        plan.scales = Some(PerChannel { inputs, output: map.scale });
        // What was given passed before: what does not pass now is what follows from the report.
        check(&orders, &plan).map_err(unusable)?;
        let tracker = Self::of(&orders, 0, Some((&map.functions, names)), &plan)?;
        tracker.with_parameters(&model.parameters, None, &relative, noise_variance, samples)
    }
}

/// A model that recursive least squares, or their extension by C, can go on with.
///
/// # Errors
/// [`Error::Argument`] and [`Error::Report`] if it is of another structure or kind.
pub(crate) fn polynomials(report: &Report) -> Result<&PolynomialModel, Error> {
    let model = report.model.polynomials("a tracker")?;
    if model.orders.nd > 0 || model.orders.nf.iter().any(|&nf| nf > 0) {
        return Err(Error::report(format!(
            "the report has {}: only AR, ARX, ARMA, ARMAX and nonlinear ARX can be tracked",
            model.orders
        )));
    }
    model.check()?;
    Ok(model)
}

/// P of such a model.
///
/// # Errors
/// [`Error::Report`] if it does not say how sure it is.
pub(crate) fn relative(model: &PolynomialModel) -> Result<DMatrix<f64>, Error> {
    let count = model.parameters.len();
    relative_covariance(model.covariance.as_deref(), model.noise_variance, count, model.orders.parameters())
}

/// P: the covariance over the noise variance, symmetric to the bit.
fn relative_covariance(
    rows: Option<&[Vec<f64>]>,
    noise_variance: f64,
    count: usize,
    expected: usize,
) -> Result<DMatrix<f64>, Error> {
    let Some(rows) = rows else {
        return Err(Error::report(
            "the report has no covariance, so that it does not say how sure its model is",
        ));
    };
    check_variance(noise_variance)?;
    if count != expected {
        return Err(Error::report(
            "model.parameters are not as many as its orders make; the report was edited or damaged",
        ));
    }
    let entry = |i: usize, j: usize| rows.get(i).and_then(|row| row.get(j)).copied().unwrap_or(f64::NAN);
    let relative =
        DMatrix::from_fn(count, count, |i, j| (entry(i, j) / 2.0 + entry(j, i) / 2.0) / noise_variance);
    Ok(relative)
}

/// That a plan has no start of its own.
fn check_start(plan: &TrackPlan) -> Result<(), Error> {
    if plan.start.0 == thetahat_core::RlsStart::Standard {
        return Ok(());
    }
    let message = format!("'{}' is a start without a report; leave it out", plan.start);
    Err(Error::argument("start", message))
}

/// That a covariance can be divided by it.
fn check_variance(noise_variance: f64) -> Result<(), Error> {
    if noise_variance > 0.0 {
        return Ok(());
    }
    Err(Error::report(
        "the report has a noise variance of 0, so that its covariance does not say how sure its model is; start without it",
    ))
}

/// The offsets of a report, which are levels.
fn offsets(inputs: &[Signal], output: &Signal) -> Result<PerChannel, Error> {
    let inputs = inputs.iter().map(offset_level).collect::<Result<_, _>>()?;
    Ok(PerChannel { inputs, output: offset_level(output)? })
}

/// The offset of a channel, which is a level.
fn offset_level(signal: &Signal) -> Result<f64, Error> {
    if signal.offset.slope == 0.0 {
        return Ok(signal.offset.level);
    }
    Err(Error::report(format!(
        "the offset of '{}' in the report is a line in the time of its log, which has no meaning beyond it; fit with another way to remove \
         offsets, or give offsets",
        signal.name
    )))
}

/// 1/sqrt(N P_jj), the largest of each channel. A channel without parameters has no say: 1.
pub(crate) fn scales(orders: &Orders, relative: &DMatrix<f64>, samples: usize) -> PerChannel {
    let variances = relative.diagonal();
    let mut magnitudes = variances.iter().map(|variance| 1.0 / (samples as f64 * variance).sqrt());
    let mut largest = |count: usize| match magnitudes.by_ref().take(count).fold(0.0, f64::max) {
        0.0 => 1.0,
        largest => largest,
    };
    let output = largest(orders.na);
    let inputs = orders.nb.iter().map(|&nb| largest(nb)).collect();
    PerChannel { inputs, output }
}

/// What of a report the estimator does not take.
fn unusable(error: impl std::fmt::Display) -> Error {
    Error::report(format!("the report cannot be tracked: {error}"))
}
