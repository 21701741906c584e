use std::ops::Range;

use thetahat_numerics::regression::{add_filtered, divide};

use super::initial_responses::until_negligible;
use super::innovations::{Innovations, errors_alone};
use super::{InitialCondition, Response, check_inputs};
use crate::Error;
use crate::data::Record;
use crate::model::PolynomialModel;

/// Steps that a prediction or a forecast may look ahead: beyond them a number was mistyped.
pub(super) const MOST_STEPS: usize = 1_000_000;

/// The k-step prediction of a model: y(t) from the outputs up to t - k and the inputs up to t.
///
/// With the innovations e(t) = (D/C) [A y - sum_j (B_j/F_j) u_j] and the impulse response h of C/(A D):
///
/// ```text
/// y^(t | t-k) = y(t) - sum_{i<k} h_i e(t-i)
/// ```
///
/// which is what the equation gives that runs k steps from what was known, with e = 0 (Ljung, System Identification,
/// 2nd ed. 1999, section 3.2; Åström, Introduction to Stochastic Control Theory, 1970, chapter 6).
///
/// [`InitialCondition::Zero`] takes zeros before each segment, and every sample has a prediction.
/// [`InitialCondition::Drop`] and [`InitialCondition::Estimate`] leave out the samples without an output k steps before
/// them to look from: the first r + k - 1 of those they use (for r see [`InitialCondition`]). What unknown samples have
/// done to B/F u is nothing to the first two; the last estimates it from the one-step errors, whatever k is, as
/// estimates with [`Initial::Estimate`](crate::estimate::Initial::Estimate) do. It leaves out segments with no more
/// samples than there are numbers to estimate.
///
/// Signals are deviations from the model's offsets. Cost: O(N (na + nb + nc + nd + nf + k)), the k up to where h has
/// died away; for n initial conditions to be estimated O(N n^2) more, up to where their responses have.
///
/// Models without A, C and D have predictions where an output is missing too, as they need no past one (see
/// [`Log::driven_record`](crate::data::Log::driven_record)); these samples do not count.
///
/// # Errors
/// [`Error::Argument`] if `horizon` is 0, the record does not have the model's inputs, or
/// [`InitialCondition::Estimate`] is asked of a model without C, D and F, which has nothing to estimate;
/// [`Error::Undetermined`] if an initial condition cannot be told from the data, as for a model so unstable that its
/// responses overflow.
///
/// ```
/// use thetahat::data::Record;
/// use thetahat::estimate::{Initial, arx};
/// use thetahat::model::{Orders, PolynomialModel, Signal};
/// use thetahat::respond::{InitialCondition, predict};
///
/// let u: Vec<f64> = (0..100_u32).map(|t| f64::from(t * t % 7)).collect();
/// let mut y = vec![1.0];
/// for t in 1..u.len() {
///     y.push(0.8 * y[t - 1] + 0.5 * u[t - 1]);
/// }
/// let record = Record::new(&y, vec![&u])?;
/// let orders = Orders::arx(1, &[1], &[1])?;
/// let estimate = arx(&record, &orders, Initial::Drop)?;
/// let model = estimate.to_model(&orders, 1.0, vec![Signal::default()], Signal::default())?;
/// // Two steps ahead: from y(48), and from the inputs that are known by then.
/// let response = predict(&model, &record, 2, InitialCondition::Drop)?;
/// let expected = 0.8 * (0.8 * y[48] + 0.5 * u[48]) + 0.5 * u[49];
/// assert!((response.values[50] - expected).abs() < 1e-9);
/// // The first two samples have no output two steps before them.
/// assert_eq!(response.counted, [2..100]);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn predict(
    model: &PolynomialModel,
    record: &Record<'_>,
    horizon: usize,
    start: InitialCondition,
) -> Result<Response, Error> {
    if horizon == 0 {
        return Err(no_step());
    }
    check_inputs(model, record)?;
    check_start(model, start)?;
    // Farther than from before the first sample to the last there is nothing to look from.
    let horizon = horizon.min(longest(record) + 1);
    Ok(predicted(model, record, horizon, &errors_alone(model, record, horizon, start)?))
}

/// The prediction that follows from the innovations of those samples that have one so many steps ahead.
pub(super) fn predicted(
    model: &PolynomialModel,
    record: &Record<'_>,
    horizon: usize,
    innovations: &[Innovations],
) -> Response {
    let response = disturbance_response(model, horizon);
    let weights: Vec<f64> = response.iter().map(|h| -h).collect();
    let counted = innovations.iter().flat_map(|found| found.counted.iter().cloned()).collect();
    let mut predicted = Response::of_signal(record.output, counted);
    for found in innovations {
        for counted in &found.counted {
            let values = &mut predicted.values[counted.clone()];
            let rows = counted.start - found.rows.start..counted.end - found.rows.start;
            add_filtered(values, &rows, &weights, &found.errors, 0);
        }
        if !model.orders.needs_past_outputs() {
            for row in found.span.clone().filter(|row| record.output[*row].is_nan()) {
                predicted.values[row] = -found.disturbance[row - found.rows.start];
            }
        }
    }
    predicted
}

/// The standard deviation of the error of a k-step prediction, in units of y: sigma sqrt(sum_{i<k} h_i^2), with h the
/// impulse response of C/(A D) and sigma^2 the variance of e.
///
/// It is that of a true model that started long ago: the uncertainty of the parameters and of the initial condition
/// comes on top, as [`prediction_deviations`](crate::respond::prediction_deviations) have it. Infinite where h
/// overflows. Cost: O(k (na + nc + nd)), up to where h has died away.
///
/// # Errors
/// [`Error::Argument`] if `horizon` is 0 or above 10^6.
///
/// ```
/// use thetahat::data::Record;
/// use thetahat::estimate::{Initial, arx};
/// use thetahat::model::{Orders, PolynomialModel, Signal};
/// use thetahat::respond::prediction_deviation;
///
/// let mut y: Vec<f64> = vec![0.0, 1.0];
/// for t in 2..100 {
///     y.push(0.8 * y[t - 1] + f64::from(t as u32 * 7 % 11) - 5.0);
/// }
/// let orders = Orders::arx(1, &[], &[])?;
/// let estimate = arx(&Record::new(&y, vec![])?, &orders, Initial::Drop)?;
/// let model = estimate.to_model(&orders, 1.0, vec![], Signal::default())?;
/// // A = 1 + a q^-1: h = 1, -a, a^2, …
/// let (sigma, a) = (model.noise_variance.sqrt(), model.a[1]);
/// assert!((prediction_deviation(&model, 1)? - sigma).abs() < 1e-14);
/// assert!((prediction_deviation(&model, 2)? - sigma * (1.0 + a * a).sqrt()).abs() < 1e-14);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn prediction_deviation(model: &PolynomialModel, horizon: usize) -> Result<f64, Error> {
    if horizon == 0 {
        return Err(no_step());
    }
    check_steps("horizon", horizon)?;
    let response = disturbance_response(model, horizon);
    Ok(model.noise_variance.sqrt() * accumulated(&response, 1).last().copied().unwrap_or(0.0))
}

/// The standard deviations of predictions 1 … `steps` steps ahead.
pub(crate) fn deviations(model: &PolynomialModel, steps: usize) -> Vec<f64> {
    let sigma = model.noise_variance.sqrt();
    let mut deviations = accumulated(&disturbance_response(model, steps), steps);
    deviations.iter_mut().for_each(|deviation| *deviation *= sigma);
    deviations
}

/// sqrt(sum_{i<k} h_i^2) for k = 1, 2, …, at least `length` of them.
pub(super) fn accumulated(response: &[f64], length: usize) -> Vec<f64> {
    let mut size = 0.0_f64;
    let mut sizes: Vec<f64> = Vec::with_capacity(length);
    for h in response {
        // Squares would overflow sooner.
        size = size.hypot(*h);
        sizes.push(size);
    }
    sizes.resize(length.max(sizes.len()), size);
    sizes
}

/// The impulse response h of C/(A D), `length` samples at most: what e does to y.
pub(super) fn disturbance_response(model: &PolynomialModel, length: usize) -> Vec<f64> {
    let order = model.orders.na + model.orders.nc + model.orders.nd;
    until_negligible(length, order, |length| {
        let mut response = vec![0.0; length];
        response.iter_mut().zip(&model.c).for_each(|(h, c)| *h = *c);
        divide(&model.a, &mut response);
        divide(&model.d, &mut response);
        response
    })
}

/// The longest segment of samples that a response may use.
pub(crate) fn longest(record: &Record<'_>) -> usize {
    let lengths =
        record.segments.iter().map(Range::len).zip(&record.past).map(|(length, past)| length + past);
    lengths.max().unwrap_or(0)
}

pub(super) fn check_start(model: &PolynomialModel, start: InitialCondition) -> Result<(), Error> {
    if start == InitialCondition::Estimate && model.orders.is_linear() {
        return Err(Error::argument(
            "initial",
            "estimate is for models with C, D or F, and for free runs: others predict from measured samples alone; use drop, \
             zero or auto",
        ));
    }
    Ok(())
}

pub(crate) fn check_steps(argument: &str, steps: usize) -> Result<(), Error> {
    if steps > MOST_STEPS {
        return Err(Error::argument(argument, format!("{steps} steps are more than {MOST_STEPS}, the most")));
    }
    Ok(())
}

fn no_step() -> Error {
    Error::argument("horizon", "a prediction looks at least one step ahead")
}
