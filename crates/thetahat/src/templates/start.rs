//! Which of some candidates a fit starts from.

use std::ops::ControlFlow;

use thetahat_numerics::optimize::Search;

use super::draft::Draft;
use super::task::Task;
use crate::Error;
use crate::estimate::equations::largest_likelihood;
use crate::model::GreyBox;
use crate::respond::equations::{Experiment, Predictor, experiments, walk};

/// The model that explains the log best, with the noise of measurements that it leaves.
pub(super) fn best(task: &Task<'_>, drafts: Vec<Draft>) -> Result<GreyBox, Error> {
    let mut best: Option<(f64, Draft, Vec<f64>)> = None;
    for draft in drafts.into_iter().filter(Draft::is_possible) {
        let model = GreyBox::from_toml(&draft.toml(task))?;
        let logs = experiments(&model, task.log, &task.rows, &task.rows)?;
        let Some(Evaluated { value, errors }) = evaluated(&model, &logs) else { continue };
        if best.as_ref().is_none_or(|(least, ..)| value < *least) {
            best = Some((value, draft, errors));
        }
    }
    let Some((_, mut draft, mut errors)) = best else {
        let message = format!(
            "the log does not say start values of {}: no window of it gives parameters with which the model follows it; are the columns \
             and their units and signs right, and does the input move enough?",
            task.template.name
        );
        return Err(Error::undetermined(Vec::new(), message));
    };
    if let Some(left) = left(&GreyBox::from_toml(&draft.toml(task))?, task)? {
        errors = left;
    }
    for (output, error) in draft.outputs.iter_mut().zip(errors) {
        output.noise = error.max(1e-6 * task.span(output.column)).max(1e-12);
    }
    GreyBox::from_toml(&draft.toml(task))
}

/// The errors that a short search leaves: those at the start are larger than the noise. None where it fails.
fn left(model: &GreyBox, task: &Task<'_>) -> Result<Option<Vec<f64>>, Error> {
    const ITERATIONS: usize = 8;
    let logs = experiments(model, task.log, &task.rows, &task.rows)?;
    let options = Search { max_iterations: ITERATIONS, ..Search::default() };
    if model.parameters().is_empty() {
        return Ok(None);
    }
    let found = largest_likelihood(model, &logs, &options, true, &|_| ControlFlow::Continue(()));
    Ok(found.ok().and_then(|found| evaluated_at(model, &logs, &found.z)).map(|found| found.errors))
}

struct Evaluated {
    /// Minus the logarithm of the likelihood where the noise of each output is what its errors say.
    value: f64,
    /// The root of the mean square of the errors of each output.
    errors: Vec<f64>,
}

/// None where the filter leaves the range of numbers.
fn evaluated(model: &GreyBox, logs: &[Experiment]) -> Option<Evaluated> {
    let z: Vec<f64> = model.parameters().iter().map(|unknown| unknown.start_variable().0).collect();
    evaluated_at(model, logs, &z)
}

fn evaluated_at(model: &GreyBox, logs: &[Experiment], z: &[f64]) -> Option<Evaluated> {
    let mut sums = vec![(0.0, 0_usize); model.outputs().len()];
    walk(model, logs, &mut Predictor::new(model), z, |at, _, innovation| {
        let (sum, count) = &mut sums[at.output];
        *sum += innovation.error * innovation.error;
        *count += 1;
    })
    .ok()?;
    let errors: Vec<f64> = sums.iter().map(|(sum, count)| (sum / (*count).max(1) as f64).sqrt()).collect();
    let each = sums.iter().zip(&errors).map(|((_, count), error)| *count as f64 * error.max(1e-300).ln());
    let value = each.sum::<f64>();
    value.is_finite().then_some(Evaluated { value, errors })
}
