//! Predictions of several outputs, each of which depends on the past of all.

use super::tracker::{Stage, Tracker, check_steps};
use crate::Error;

/// The predictions this many steps ahead of the outputs of one model: the last row of [`predictions`], inputs to come
/// held at their latest values.
///
/// # Errors
/// As for [`predictions`].
///
/// See [`Tracker::coupled`] for an example.
pub fn forecasts(trackers: &mut [Tracker], steps: usize) -> Result<Vec<f64>, Error> {
    let mut rows = predictions(trackers, None, steps)?;
    rows.drain(..rows.len() - trackers.len());
    Ok(rows)
}

/// The predictions y(k + 1) … y(k + steps) of the outputs of one model from the samples up to k, a row for each step,
/// in the units of each. The trackers are those of its outputs, in their order, after the same rows.
///
/// `future` are the inputs u(k + 1) … u(k + steps), a row for each step, in their units; without them the latest ones
/// are held.
///
/// NaN where there is none, as for [`Tracker::forecast`]; of coupled outputs for all of them, where it is so for one. n
/// multiply-adds and moves a step and output. It takes memory for the delay lines.
///
/// # Errors
/// [`Error::Argument`] if the steps are not in 1 … 10,000, the inputs not as many, or the trackers not as many as the
/// outputs that they are coupled with.
pub fn predictions(
    trackers: &mut [Tracker],
    future: Option<&[f64]>,
    steps: usize,
) -> Result<Vec<f64>, Error> {
    check_steps(steps)?;
    let count = trackers.len();
    let Some(first) = trackers.first() else { return Ok(Vec::new()) };
    let k = first.inputs.len() - first.outputs;
    if let Some(future) = future.filter(|future| future.len() != steps * k) {
        let message = format!("expected {} values, found {}", steps * k, future.len());
        return Err(Error::argument("future", message));
    }
    let mut rows = vec![f64::NAN; steps * count];
    if trackers.iter().all(|tracker| tracker.outputs == 0) {
        for (place, tracker) in trackers.iter_mut().enumerate() {
            let offset = tracker.offsets.output;
            let predicted = tracker.predict(future, steps)?.unwrap_or_default();
            for (row, predicted) in rows.chunks_exact_mut(count).zip(predicted) {
                row[place] = predicted + offset;
            }
        }
        return Ok(rows);
    }
    if trackers.iter().any(|tracker| tracker.outputs != count) {
        let message = format!("there are {count} trackers of a model of another number of outputs");
        return Err(Error::argument("trackers", message));
    }
    let mut equations = Vec::with_capacity(count);
    for tracker in &*trackers {
        let (Stage::Running(estimator), Some(parameters)) = (&tracker.stage, tracker.parameters()) else {
            return Ok(rows);
        };
        equations.push((estimator.lines().clone(), parameters));
    }
    let Some(first) = trackers.first() else { return Ok(rows) };
    let own = |inputs: &[f64]| inputs.get(count..).unwrap_or_default().to_vec();
    let (held, offsets) = (own(&first.inputs), own(&first.offsets.inputs));
    // What stands in the regressor of the next row: the outputs of this one, and the inputs.
    let mut fed = first.past.clone();
    fed.extend_from_slice(&held);
    let mut outputs = vec![f64::NAN; count];
    for (step, row) in rows.chunks_exact_mut(count).enumerate() {
        if let Some(future) = future.and_then(|future| future.get(step * k..(step + 1) * k)) {
            let inputs = future.iter().zip(&offsets).map(|(input, offset)| input - offset);
            fed[count..].iter_mut().zip(inputs).for_each(|(fed, input)| *fed = input);
        }
        for ((lines, parameters), output) in equations.iter_mut().zip(&mut outputs) {
            lines.push_inputs(&fed).map_err(|error| Error::data(error.to_string()))?;
            *output = lines.regressor().map_or(f64::NAN, |regressor| {
                regressor.iter().zip(*parameters).map(|(value, parameter)| value * parameter).sum()
            });
        }
        if !outputs.iter().all(|output| output.is_finite()) {
            break;
        }
        for ((value, output), tracker) in row.iter_mut().zip(&outputs).zip(&*trackers) {
            *value = output + tracker.offsets.output;
        }
        fed.iter_mut().zip(&outputs).for_each(|(fed, output)| *fed = -output);
    }
    Ok(rows)
}
