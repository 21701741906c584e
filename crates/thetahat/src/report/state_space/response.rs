//! Fits of state-space models to measured frequency responses.

use std::f64::consts::PI;

use thetahat_numerics::optimize::Monitor;

use super::StateSpacePlan;
use crate::Error;
use crate::estimate::{ResponsePoints, SharedPoles, shared_poles};
use crate::model::{ContinuousStateSpaceModel, Model, StateSpaceModel};
use crate::report::response::{
    data, estimation, from_inputs, noise_variance, points, refuse, signals, warnings as of_response,
};
use crate::report::schema::Report;
use crate::respond::FrequencyResponse;
use crate::spectrum::MeasuredResponse;

/// The orders that are compared where none are given.
const HIGHEST: usize = 10;

/// Finds the state-space model whose frequency response comes closest to a measured one, all inputs having the same
/// poles:
///
/// ```text
/// min sum_jk |G_j(omega_k) - G_jk|^2/var G_jk
/// ```
///
/// with the variances of the points; where a point has none, with |G_jk|^2 in their place: errors relative to each
/// point, as large as they turn out to be. Of a response of samples it is a [`StateSpaceModel`] with K = 0, of sines in
/// continuous time a [`ContinuousStateSpaceModel`]. All poles are stable. Of the plan it takes the inputs, none
/// standing for all of them, the orders (from 1 to 10 if none are given, of which the least MDL is taken), the delays,
/// the feedthrough (if nothing is said, where it lowers MDL) and the search. Levels are not in a response: offsets are
/// zero.
///
/// Poles, gains and responses have the standard errors of points with these variances, of which neighbours are
/// correlated as far as the method smooths, and larger where the response misses the points by more.
///
/// Cost: O(N n^2) an iteration for N points and n states, some dozen of them for each start of each order up to n.
///
/// Sources: Gustavsen and Semlyen, IEEE Transactions on Power Delivery 14, 1999; Pintelon and Schoukens, System
/// Identification: A Frequency Domain Approach, 2nd ed. 2012, section 9.11.
///
/// # Errors
/// [`Error::Argument`] for what a response does not have (rows, offsets, a past, several outputs), and an input that it
/// does not; [`Error::Undetermined`] where points are too few; [`Error::Interrupted`] if the monitor breaks.
///
/// ```
/// use std::ops::ControlFlow;
/// use thetahat::model::{ContinuousStateSpaceModel, Model};
/// use thetahat::report::{StateSpacePlan, fit_states_to_response};
/// use thetahat::spectrum::{GivenPoint, MeasuredResponse};
///
/// // 3/(1 + 0.5 s) at 20 frequencies.
/// let point = |frequency: f64| {
///     let below = 1.0 + (0.5 * frequency).powi(2);
///     GivenPoint { frequency, re: 3.0 / below, im: -1.5 * frequency / below, standard_deviation: Some(0.01) }
/// };
/// let points: Vec<GivenPoint> = (-10..10).map(|power| point(1.5_f64.powi(power))).collect();
/// let response = MeasuredResponse::given("u", "y", &points, None)?;
/// let plan = StateSpacePlan { orders: Some(1..=3), ..StateSpacePlan::new(&[], &["y"]) };
/// let report = fit_states_to_response(&response, &plan, &|_| ControlFlow::Continue(()))?;
/// assert_eq!(report.model.name(), "continuous state space of order 1");
/// let found = |model: &ContinuousStateSpaceModel| (model.poles[0].re + 2.0).abs() < 1e-6;
/// assert!(matches!(&report.model, Model::ContinuousStateSpace(model) if found(model)));
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn fit_states_to_response(
    response: &MeasuredResponse,
    plan: &StateSpacePlan,
    monitor: Monitor<'_>,
) -> Result<Report, Error> {
    let measured = from_inputs(response, &plan.inputs)?;
    let inputs: Vec<String> = measured.iter().filter_map(|own| own.input.clone()).collect();
    let outputs = vec![response.output.clone()];
    let plan = &StateSpacePlan { inputs, outputs, ..plan.clone() };
    plan.check()?;
    refuse(&[
        ("estimate", !plan.estimate.is_empty()),
        ("validate", !plan.validate.is_empty()),
        ("split", plan.split.is_some()),
        ("offset", !plan.offsets.is_empty()),
        ("past", plan.subspace.past.is_some()),
        ("future", plan.subspace.future.is_some()),
        ("refine", plan.refine.is_some()),
        ("na", plan.arx.is_some()),
    ])?;
    if response.continuous && !plan.delays.is_empty() {
        let message = "a response in continuous time has no samples that an input could wait; leave it out";
        return Err(Error::argument("nk", message));
    }
    let delays = if plan.delays.is_empty() { vec![0; measured.len()] } else { plan.delays.clone() };
    let points: Vec<ResponsePoints> =
        measured.iter().zip(&delays).map(|(own, delay)| ahead(own, *delay, response)).collect();
    let orders = plan.orders.clone().unwrap_or(1..=HIGHEST);
    let found = shared_poles(&points, &orders, plan.subspace.feedthrough, &plan.search, monitor)?;
    let data = data(response, plan.channels().map(str::to_owned));
    let values = (found.samples, found.mse);
    let estimation = estimation(found.outcome.clone().into(), values, found.free, None);
    let order = found.matrices.f.nrows();
    let mut warnings = Vec::new();
    if order == *orders.end() && orders.start() < orders.end() {
        warnings.push(format!(
            "the order that fits best, {order}, is the highest that was compared: a higher one may fit better; widen the range"
        ));
    }
    if found.covariance.is_none() {
        warnings.push(
            "the points do not tell all parameters apart: poles, gains and responses have no standard errors; ask for a lower order"
                .to_owned(),
        );
    }
    let known = points.iter().all(|own| own.known);
    warnings.extend(of_response(response, found.mse, known));
    let model = model(found, plan, delays, response)?;
    Ok(Report { warnings, ..Report::new(data, model, estimation) })
}

/// The points of an input as they would be if it did not wait.
fn ahead(own: &FrequencyResponse, delay: usize, response: &MeasuredResponse) -> ResponsePoints {
    // At the highest frequency that samples have they tell a size alone, and s is infinite.
    let highest = PI / response.sample_time * (1.0 - 1e-9);
    let mut own = own.clone();
    own.points.retain(|point| response.continuous || point.frequency < highest);
    let mut points = points(&own, response);
    let seconds = delay as f64 * response.sample_time;
    for (value, frequency) in points.values.iter_mut().zip(&points.frequencies) {
        let (sine, cosine) = (frequency * seconds).sin_cos();
        let [re, im] = *value;
        *value = [re * cosine - im * sine, re * sine + im * cosine];
    }
    points
}

fn model(
    found: SharedPoles,
    plan: &StateSpacePlan,
    delays: Vec<usize>,
    response: &MeasuredResponse,
) -> Result<Model, Error> {
    let (inputs, outputs) = (signals(&plan.inputs), signals(&plan.outputs));
    let SharedPoles { matrices, covariance, free, .. } = found;
    if response.continuous {
        let channels = (inputs, outputs);
        let model = ContinuousStateSpaceModel::of_sines(channels, &matrices, free, covariance)?;
        return Ok(model.into());
    }
    let mut matrices = matrices;
    // What e is in the time of the samples the noise of the response says, if it does.
    matrices.noise_covariance[(0, 0)] = noise_variance(response);
    let model = StateSpaceModel::new((inputs, outputs), delays, &matrices, free, None)?;
    let model = match covariance {
        Some(covariance) => model.with_covariance(covariance),
        None => model,
    };
    model.check()?;
    Ok(model.into())
}
