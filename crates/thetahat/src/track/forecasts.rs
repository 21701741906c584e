//! Predictions of several outputs, each of which depends on the past of all.

use super::tracker::{Stage, Tracker, check_steps};
use crate::Error;

/// The predictions this many steps ahead of the outputs of one model: y(k + steps) from the samples up to k, in the
/// units of each. The trackers are those of its outputs, in their order, after the same rows. Inputs to come are held
/// at their latest values.
///
/// NaN if there is none, as for [`Tracker::forecast`]; of coupled outputs for all of them, where it is so for one. n
/// multiply-adds and moves a step and output. It takes memory for the delay lines.
///
/// # Errors
/// [`Error::Argument`] if the steps are not in 1 … 10,000, or the trackers are not as many as the outputs that they are
/// coupled with.
///
/// See [`Tracker::coupled`] for an example.
pub fn forecasts(trackers: &mut [Tracker], steps: usize) -> Result<Vec<f64>, Error> {
    check_steps(steps)?;
    if trackers.iter().all(|tracker| tracker.outputs == 0) {
        return trackers.iter_mut().map(|tracker| tracker.forecast(steps)).collect();
    }
    let count = trackers.len();
    if trackers.iter().any(|tracker| tracker.outputs != count) {
        let message = format!("there are {count} trackers of a model of another number of outputs");
        return Err(Error::argument("trackers", message));
    }
    let unknown = vec![f64::NAN; count];
    let mut equations = Vec::with_capacity(count);
    for tracker in &*trackers {
        let (Stage::Running(estimator), Some(parameters)) = (&tracker.stage, tracker.parameters()) else {
            return Ok(unknown);
        };
        equations.push((estimator.lines().clone(), parameters));
    }
    let Some(first) = trackers.first() else { return Ok(unknown) };
    // What stands in the regressor of the next row: the outputs of this one, and the inputs that are held.
    let mut fed = first.past.clone();
    fed.extend_from_slice(first.inputs.get(count..).unwrap_or_default());
    let mut outputs = unknown.clone();
    for _ in 0..steps {
        for ((lines, parameters), output) in equations.iter_mut().zip(&mut outputs) {
            lines.push_inputs(&fed).map_err(|error| Error::data(error.to_string()))?;
            *output = lines.regressor().map_or(f64::NAN, |regressor| {
                regressor.iter().zip(*parameters).map(|(value, parameter)| value * parameter).sum()
            });
        }
        if !outputs.iter().all(|output| output.is_finite()) {
            return Ok(unknown);
        }
        fed.iter_mut().zip(&outputs).for_each(|(fed, output)| *fed = -output);
    }
    let offsets = trackers.iter().map(|tracker| tracker.offsets.output);
    Ok(outputs.iter().zip(offsets).map(|(output, offset)| output + offset).collect())
}
