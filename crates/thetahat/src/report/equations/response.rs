//! Fits of equations to measured frequency responses.

use thetahat_core::nalgebra::DMatrix;
use thetahat_numerics::optimize::Monitor;

use super::{EquationsPlan, profiled, something_unknown, warnings};
use crate::Error;
use crate::estimate::equations::{EquationsPoint, EquationsResponse, ResponseLikelihood, largest_likelihood};
use crate::estimate::{EquationsOutcome, Procedure, coloured};
use crate::model::{EquationsModel, GreyBox};
use crate::report::response::{data, estimation, fitted, refuse, variance, warnings as of_response};
use crate::report::schema::Report;
use crate::respond::equations::Failure;
use crate::spectrum::MeasuredResponse;

/// What errors are taken for relative to each point, where those of the points are not known; the fit says then how
/// large they are.
const RELATIVE: f64 = 0.01;

/// Finds the unknown parameters of a model in equations in a measured frequency response, and reports on it:
///
/// ```text
/// min sum_k |G(omega_k, p) - G_k|^2/var G_k
/// ```
///
/// with the variances of the points, or |G_k|^2 in their place where there are none: errors relative to each point, as
/// large as they turn out to be. G is that of the equations near the state in which they start, with inputs of 0, which
/// `start` may have as an expression of parameters; linear equations have the same response anywhere. Of a response to
/// inputs that are held the equations are taken in the response's samples, of one in continuous time as they are.
///
/// The search is that of [`fit_equations`](super::fit_equations). What a response does not say - how states begin, and
/// noises - stays as it starts; parameters that stand nowhere else are none of the fit. Standard errors are those of
/// points with these variances, of which neighbours are correlated as far as the method smooths, and larger where the
/// response misses the points by more.
///
/// Cost: O(K n^3 p) an iteration, for K points, n states and p parameters.
///
/// Source: Pintelon and Schoukens, System Identification: A Frequency Domain Approach, 2nd ed. 2012, section 9.11;
/// Ljung, System Identification, 2nd ed. 1999, section 7.7.
///
/// # Errors
/// [`Error::Argument`] if nothing that the response depends on is unknown, for rows, for channels of the response that
/// the model does not have, for equations of the next state and a response in continuous time or of other samples;
/// [`Error::Undetermined`] as for [`fit_equations`](super::fit_equations); [`Error::Data`] where the response of the
/// equations is no number; [`Error::Interrupted`] if the monitor says so.
///
/// ```
/// use std::ops::ControlFlow;
/// use thetahat::model::GreyBox;
/// use thetahat::report::{EquationsPlan, fit_equations_to_response};
/// use thetahat::spectrum::{GivenPoint, MeasuredResponse};
///
/// // 0.01 ohm in series with 0.02 ohm beside 500 F.
/// let point = |frequency: f64| {
///     let below = 1.0 + (10.0 * frequency).powi(2);
///     GivenPoint { frequency, re: 0.01 + 0.02 / below, im: -0.2 * frequency / below, standard_deviation: None }
/// };
/// let points: Vec<GivenPoint> = (-8..5).map(|power| point(2.0_f64.powi(power))).collect();
/// let impedance = MeasuredResponse::given("current", "voltage", &points, None)?;
/// let model = GreyBox::from_toml(
///     "sample_time = 1
///      [states]
///      over = { start = 0, sd = 0 }
///      [inputs]
///      i = \"current\"
///      [parameters]
///      r0 = { start = 0.1, sd = 0.1, unknown = true, min = 0 }
///      r1 = { start = 0.1, sd = 0.1, unknown = true, min = 0 }
///      c1 = { start = 100, sd = 100, unknown = true, min = 0 }
///      [derivative]
///      over = \"i / c1 - over / (r1 * c1)\"
///      [outputs]
///      voltage = \"r0 * i + over\"
///      [noise]
///      measurement = { voltage = 0.001 }",
/// )?;
/// let plan = EquationsPlan::default();
/// let report = fit_equations_to_response(&model, &impedance, &plan, &|_| ControlFlow::Continue(()))?;
/// assert!((report.model.parameters()[2].value - 500.0).abs() < 1e-3);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn fit_equations_to_response(
    model: &GreyBox,
    response: &MeasuredResponse,
    plan: &EquationsPlan,
    monitor: Monitor<'_>,
) -> Result<Report, Error> {
    refuse(&[
        ("estimate", !plan.estimate.is_empty()),
        ("validate", !plan.validate.is_empty()),
        ("split", plan.split.is_some()),
    ])?;
    something_unknown(model)?;
    let model = model.clone().with_noises_as_they_start();
    if model.parameters().is_empty() {
        let message = "the response does not depend on any of its unknown parameters: they are noises";
        return Err(Error::argument("model", message));
    }
    let held = (!response.continuous).then_some(response.sample_time);
    model.check_response(held)?;
    let (points, known) = points(&model, response)?;
    let measured = EquationsResponse { points, held, correlation: response.correlation() };
    let criterion = || ResponseLikelihood::new(&model, &measured);
    let failed = |Failure { row, .. }: Failure| {
        Error::data(format!(
            "the response of the equations is no number at {} rad/s; give start values that are closer",
            measured.points[row].frequency
        ))
    };
    let found = largest_likelihood(&model, criterion, failed, &plan.search, plan.own_start_only, monitor)?;

    let samples = found.samples as f64;
    let relative = found.squares / samples;
    // Known errors are not smaller than they are said to be.
    let factor =
        if known { relative.max(1.0) } else { found.squares / (samples - found.values.len() as f64) };
    let profile = if plan.profile {
        profiled(&model, criterion, &found, factor, &plan.search, monitor)?
    } else {
        Vec::new()
    };
    // From the variables to the parameters: covariances have a slope for each side, their inverses one over it.
    let spread = criterion().spread(&found.z).map_err(failed)?;
    let slope = |index: usize| model.parameters()[index].scale.slope(found.z[index]);
    let size = found.z.len();
    let spread = DMatrix::from_fn(size, size, |i, j| spread[i * size + j] / slope(i) / slope(j));
    let correlated = coloured(&found.covariance, factor, &spread);
    let covariance = correlated.row_iter().map(|row| row.iter().copied().collect());
    let noise = model.measurement_variances_at_start();
    let own = EquationsModel::new(&model, &found.values, covariance.collect(), &noise);
    let unknown = model.parameters().iter().enumerate();
    let unknown = unknown.map(|(index, unknown)| unknown.reported(found.covariance[(index, index)].sqrt()));
    // In variances of the points, as of processes.
    let mse = if known { relative } else { relative * RELATIVE * RELATIVE };
    let procedure = Procedure::from(EquationsOutcome {
        log_likelihood: -found.value,
        nis: None,
        covariance_factor: factor,
        unknown: unknown.collect(),
        profile,
        starts: Vec::new(),
        search: found.search,
    });
    let condition = Some(found.condition);
    let estimation = estimation(procedure, (found.samples, mse), found.values.len(), condition);
    let mut words = warnings::of_fit(&own, &estimation, &[]);
    words.extend(of_response(response, relative, known));
    let channels = model.inputs().iter().chain(model.outputs()).cloned();
    let mut report = Report::new(data(response, channels), own, estimation);
    report.warnings.extend(words);
    Ok(report)
}

/// The points of a response, and whether their variances are known.
fn points(model: &GreyBox, response: &MeasuredResponse) -> Result<(Vec<EquationsPoint>, bool), Error> {
    let place = |channels: &[String], kind: &str, name: &str| {
        channels.iter().position(|own| own == name).ok_or_else(|| {
            Error::argument(
                "model",
                format!(
                    "the response has the {kind} '{name}', and the model: {}; rename one of them",
                    if channels.is_empty() { "none".to_owned() } else { channels.join(", ") }
                ),
            )
        })
    };
    let output = place(model.outputs(), "output", &response.output)?;
    let mut found = Vec::new();
    let known = response.responses.iter().flat_map(fitted).all(|point| variance(point).is_some());
    for own in &response.responses {
        let input = place(model.inputs(), "input", own.input.as_deref().unwrap_or_default())?;
        found.extend(fitted(own).map(|point| EquationsPoint {
            input,
            output,
            frequency: point.frequency,
            re: point.re,
            im: point.im,
            variance: match variance(point) {
                Some(variance) if known => variance,
                _ => (RELATIVE * point.magnitude.value).powi(2),
            },
        }));
    }
    Ok((found, known))
}
