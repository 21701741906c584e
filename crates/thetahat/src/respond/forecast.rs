use thetahat_numerics::regression::divide_from;

use super::innovations::{driven, of_segments};
use super::predict::{check_start, check_steps, deviations};
use super::sensitivities::{Paths, student};
use super::{InitialCondition, check_inputs};
use crate::Error;
use crate::data::Record;
use crate::model::PolynomialModel;

/// What a model expects after the last sample of a record.
#[derive(Debug, Clone, PartialEq)]
pub struct Forecast {
    /// y^(N+1 | N), y^(N+2 | N), …, in deviations like the record.
    pub values: Vec<f64>,
    /// The standard deviations of their errors: what the noise does, as
    /// [`prediction_deviation`](crate::respond::prediction_deviation) has it, and what the uncertainty of the
    /// parameters, the output's offset and the initial states adds to first order, with the factor sqrt(nu/(nu - 2)) of
    /// Student's distribution where the noise variance was estimated with nu degrees of freedom.
    pub standard_deviations: Vec<f64>,
}

/// The forecast of a model from the end of a record's last segment on, `steps` samples.
///
/// With N the last sample of the segment, y^(N+k | N) is what the equations give that run on with e = 0:
///
/// ```text
/// x(t) = sum_j (B_j/F_j) u_j(t),   D w = C e,   A y = x + w
/// ```
///
/// It is the mean of y(N+k) given everything up to N and the inputs (Ljung, System Identification, 2nd ed. 1999,
/// section 3.2). `inputs[j][i]` is u_j(N+1+i). With nk samples of delay the last nk are not needed, and an input
/// without B needs none; what is there beyond them is not read. The start is as for
/// [`predict`](crate::respond::predict).
///
/// Cost: p + 1 times that of a prediction of the last segment, and O(steps p (na + nb + nc + nd + nf)), for p
/// parameters.
///
/// # Errors
/// [`Error::Argument`] if there are fewer future inputs than needed, one is not finite, the record or `inputs` do not
/// have as many inputs as the model, `steps` is above 10^6, or the start does not suit the model; [`Error::Data`] if
/// the last segment is too short to start from; [`Error::Undetermined`] as for a prediction.
///
/// ```
/// use thetahat::data::Record;
/// use thetahat::estimate::{Initial, arx};
/// use thetahat::model::{Orders, PolynomialModel, Signal};
/// use thetahat::respond::{InitialCondition, forecast};
///
/// let u: Vec<f64> = (0..100).map(|t| f64::from(t * t % 7)).collect();
/// let mut y = vec![1.0];
/// for t in 1..u.len() {
///     y.push(0.8 * y[t - 1] + 0.5 * u[t - 1]);
/// }
/// let record = Record::new(&y, vec![&u])?;
/// let orders = Orders::arx(1, &[1], &[1])?;
/// let estimate = arx(&record, &orders, Initial::Drop)?;
/// let model = estimate.to_model(&orders, 1.0, vec![Signal::default()], Signal::default())?;
/// // Two steps ahead; the second needs the input of the first.
/// let ahead = forecast(&model, &record, &[&[3.0]], 2, InitialCondition::Drop)?;
/// let first = 0.8 * y[99] + 0.5 * u[99];
/// assert!((ahead.values[0] - first).abs() < 1e-9);
/// assert!((ahead.values[1] - (0.8 * first + 0.5 * 3.0)).abs() < 1e-9);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn forecast(
    model: &PolynomialModel,
    record: &Record<'_>,
    inputs: &[&[f64]],
    steps: usize,
    start: InitialCondition,
) -> Result<Forecast, Error> {
    forecast_if_possible(model, record, inputs, steps, start)?.ok_or_else(|| {
        Error::data("the last segment without a gap is too short to forecast from; start from zero, or give more rows")
    })
}

/// The same; none if the last segment is too short.
pub(crate) fn forecast_if_possible(
    model: &PolynomialModel,
    record: &Record<'_>,
    inputs: &[&[f64]],
    steps: usize,
    start: InitialCondition,
) -> Result<Option<Forecast>, Error> {
    check_inputs(model, record)?;
    check_start(model, start)?;
    check_steps("steps", steps)?;
    check_future(model, inputs, steps)?;
    if let Some((model, signals)) = model.with_open_offset(record.output.len() + steps) {
        let (past, future): (Vec<_>, Vec<_>) = signals
            .iter()
            .map(|signal| {
                let next = record.segments.last().map_or(0, |segment| segment.end);
                (signal[..record.output.len()].to_vec(), &signal[next..next + steps])
            })
            .unzip();
        let inputs = [inputs, &future].concat();
        return forecast_if_possible(&model, &record.with_inputs(&past), &inputs, steps, start);
    }
    let (Some(segment), Some(past)) = (record.segments.last(), record.past.last()) else { return Ok(None) };
    let found = of_segments(model, record, &[(segment.clone(), *past)], 1, start, true)?.pop();
    let Some(found) = found else { return Ok(None) };
    let rows = found.rows.clone();

    let whole = |(measured, future): (&&[f64], &&[f64])| {
        let mut whole = measured[rows.clone()].to_vec();
        whole.extend(future.iter().take(steps));
        // What the delay keeps from being read.
        whole.resize(rows.len() + steps, 0.0);
        whole
    };
    let whole: Vec<Vec<f64>> = record.inputs.iter().zip(inputs).map(whole).collect();
    let views: Vec<&[f64]> = whole.iter().map(Vec::as_slice).collect();
    let mut values = driven(model, &views, rows.len() + steps, &found.impulses).split_off(rows.len());
    let measured = &record.output[rows];
    let known = Known { output: measured, disturbance: &found.disturbance, errors: &found.errors };
    let disturbance = continuation(model, &known, &mut values);
    let mut errors = found.errors.clone();
    errors.resize(measured.len() + steps, 0.0);
    let (output, disturbance) =
        ([measured, &values].concat(), [found.disturbance.as_slice(), &disturbance].concat());
    let paths = Paths::new(model, &found, whole, output, disturbance, errors);
    let others = paths.of_forecast(model, start)?;
    let each = deviations(model, steps).into_iter().zip(others);
    let standard_deviations = each.map(|(noise, other)| student(model, noise, other)).collect();
    Ok(Some(Forecast { values, standard_deviations }))
}

/// What is known of a segment of samples: y, w and e.
#[derive(Debug, Clone, Copy)]
pub(super) struct Known<'a> {
    pub(super) output: &'a [f64],
    pub(super) disturbance: &'a [f64],
    pub(super) errors: &'a [f64],
}

/// Goes on from what is known with e = 0: `values` holds x and becomes y. Gives w.
pub(super) fn continuation(model: &PolynomialModel, known: &Known<'_>, values: &mut [f64]) -> Vec<f64> {
    // Of D w = C e only what e was before is left.
    let mut disturbance = vec![0.0; values.len()];
    for (t, value) in disturbance.iter_mut().take(model.orders.nc).enumerate() {
        let earlier = known.errors.iter().rev();
        *value = model.c[t + 1..].iter().zip(earlier).map(|(c, e)| c * e).sum();
    }
    divide_from(&model.d[1..], known.disturbance, &mut disturbance);
    values.iter_mut().zip(&disturbance).for_each(|(value, w)| *value += w);
    divide_from(&model.a[1..], known.output, values);
    disturbance
}

/// Future inputs must be there as far as they have an effect.
fn check_future(model: &PolynomialModel, inputs: &[&[f64]], steps: usize) -> Result<(), Error> {
    let (expected, found) = (model.b.len(), inputs.len());
    if found != expected {
        return Err(Error::argument(
            "inputs",
            format!("the model has {expected} inputs, and there are future values of {found}"),
        ));
    }
    for (input, future) in inputs.iter().enumerate() {
        let (nb, nk) = (model.orders.nb[input], model.orders.nk[input]);
        let needed = if nb == 0 { 0 } else { steps.saturating_sub(nk) };
        if future.len() < needed {
            return Err(Error::argument(
                "inputs",
                format!(
                    "{steps} steps need {needed} future values of input {}, there are {}; give more, or ask for fewer \
                     steps",
                    input + 1,
                    future.len()
                ),
            ));
        }
        if let Some(position) = future.iter().take(steps).position(|value| !value.is_finite()) {
            return Err(Error::argument(
                "inputs",
                format!("future value {} of input {} is not finite", position + 1, input + 1),
            ));
        }
    }
    Ok(())
}
