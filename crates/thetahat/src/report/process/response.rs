//! Fits of processes to measured frequency responses.

use thetahat_numerics::optimize::Monitor;

use super::{ProcessPlan, model};
use crate::Error;
use crate::estimate::{ResponsePoints, least_response_errors};
use crate::model::ProcessModel;
use crate::report::Report;
use crate::report::response::{
    data, estimation, from_inputs, noise_variance, points, refuse, signals, warnings as of_response,
};
use crate::spectrum::MeasuredResponse;

/// Finds the process whose frequency response, with an input that is held from sample to sample or, of a response in
/// continuous time, to sines, comes closest to a measured one:
///
/// ```text
/// min sum_k |G(omega_k) - G_k|^2/var G_k
/// ```
///
/// with the variances of the points; where a point has none, with |G_k|^2 in their place: errors relative to each
/// point, as large as they turn out to be. Of the plan it takes the inputs, none standing for all of them, the
/// structures and the search. Levels are not in a response: offsets are zero.
///
/// Standard errors are those of points with these variances, of which neighbours are correlated as far as the method
/// smooths, and larger where the response misses the points by more.
///
/// Source: Pintelon and Schoukens, System Identification: A Frequency Domain Approach, 2nd ed. 2012, section 9.11;
/// Ljung, System Identification, 2nd ed. 1999, section 7.7.
///
/// # Errors
/// [`Error::Argument`] for what a response does not have (rows, offsets, a slope, a start), and an input that it does
/// not; otherwise as for [`fit_process`](super::fit_process).
///
/// ```
/// use std::ops::ControlFlow;
/// use thetahat::data::{Channel, Log};
/// use thetahat::report::{ProcessPlan, fit_process_to_response};
/// use thetahat::spectrum::{SpectrumPlan, spectrum};
///
/// // 2/(1 + 5 s), sampled each second with a held input.
/// let (mut u, mut y, mut random) = (vec![0.0], vec![0.0], 1_u32);
/// let pole = (-0.2_f64).exp();
/// for t in 1..3000 {
///     random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
///     y.push(pole * y[t - 1] + 2.0 * (1.0 - pole) * u[t - 1]);
///     u.push(f64::from(random >> 16) / 32_768.0 - 1.0);
/// }
/// let channel = |name: &str, values| Channel { name: name.into(), values };
/// let log = Log::new(vec![channel("u", u), channel("y", y)], 1.0)?;
/// let response = spectrum(&log, &[], &SpectrumPlan::new(&["u"], "y"))?;
/// let plan = ProcessPlan::new(&[], "y", "p1".parse()?);
/// let report = fit_process_to_response(&response, &plan, &|_| ControlFlow::Continue(()))?;
/// assert!((report.model.parameters()[1].value - 5.0).abs() < 0.01);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn fit_process_to_response(
    response: &MeasuredResponse,
    plan: &ProcessPlan,
    monitor: Monitor<'_>,
) -> Result<Report, Error> {
    let measured = from_inputs(response, &plan.inputs)?;
    let inputs = measured.iter().filter_map(|own| own.input.clone()).collect();
    let plan = &ProcessPlan { inputs, output: response.output.clone(), ..plan.clone() };
    plan.check()?;
    refuse(&[
        ("estimate", !plan.estimate.is_empty()),
        ("validate", !plan.validate.is_empty()),
        ("split", plan.split.is_some()),
        ("offset", !plan.offsets.is_empty()),
        ("trend", plan.trend),
        ("initial", plan.free_start == Some(true)),
    ])?;
    let points: Vec<ResponsePoints> = measured.iter().map(|own| points(own, response)).collect();
    let structures = plan.each();
    let names = ProcessModel::names(&structures, &plan.inputs);
    let found = least_response_errors(&structures, &names, &points, &plan.search, monitor)?;
    let inputs = signals(&plan.inputs);
    let own = model(plan, response.sample_time, inputs, structures, &names, (false, &found))?;
    // What e is in the time of the samples the noise of the response says, if it does.
    let own = ProcessModel { noise_variance: noise_variance(response), degrees_of_freedom: None, ..own };
    let data = data(response, plan.inputs.iter().chain([&plan.output]).cloned());
    let values = (found.samples, found.mse);
    let estimation = estimation(found.outcome.of_response(), values, names.len(), found.condition);
    let mut warnings = super::warnings::of_parameters(&own, f64::INFINITY);
    let known = points.iter().all(|own| own.known);
    warnings.extend(of_response(response, found.mse, known));
    Ok(Report { warnings, ..Report::new(data, own, estimation) })
}
