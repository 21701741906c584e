//! Which of some candidates a fit starts from.

use super::draft::Draft;
use super::task::Task;
use crate::Error;
use crate::model::GreyBox;
use crate::respond::equations::{Experiment, Predictor, experiments, walk};
use crate::text::brief;

/// The model that explains the log best, with the noise of measurements that it leaves.
pub(super) fn best(task: &Task<'_>, drafts: Vec<Draft>) -> Result<GreyBox, Error> {
    let mut best: Option<(f64, Draft, Vec<f64>)> = None;
    for draft in drafts.into_iter().filter(Draft::is_possible) {
        // Candidates are compared by how far they go without noise that moves the plant.
        let plain = Draft { process: Vec::new(), ..draft.clone() };
        let model = GreyBox::from_toml(&plain.toml(task))?;
        let logs = experiments(&model, task.log, &task.rows, &task.rows)?;
        let Some(Evaluated { value, errors }) = evaluated(&model, &logs) else { continue };
        if best.as_ref().is_none_or(|(least, ..)| value < *least) {
            best = Some((value, draft, errors));
        }
    }
    let Some((_, mut draft, errors)) = best else {
        let message = format!(
            "the log does not say start values of {}: no window of it gives parameters with which the model follows it; are the columns \
             and their units and signs right, and does the input move enough?",
            task.template.name
        );
        return Err(Error::undetermined(Vec::new(), message));
    };
    all_known_are_in(task, &draft)?;
    for (output, error) in draft.outputs.iter_mut().zip(errors) {
        output.noise = error.max(1e-6 * task.span(output.column)).max(1e-12);
    }
    GreyBox::from_toml(&draft.toml(task))
}

/// That what is known is a setting or stands in the model.
fn all_known_are_in(task: &Task<'_>, draft: &Draft) -> Result<(), Error> {
    let is_there = |name: &String| {
        task.template.settings.iter().any(|setting| setting.name == name)
            || draft.parameters.iter().any(|parameter| parameter.name == *name)
            || draft.process.iter().any(|(state, ..)| format!("process.{state}") == *name)
            || draft
                .outputs
                .iter()
                .any(|output| format!("measurement.{}", task.channel(output.column)) == *name)
    };
    match task.known.iter().find(|(name, _)| !is_there(name)) {
        None => Ok(()),
        Some((name, _)) => {
            let message = format!("the model of this log has no '{}'; leave it out", brief(name, 40));
            Err(Error::argument("known", message))
        }
    }
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
    let mut sums = vec![(0.0, 0_usize); model.outputs().len()];
    walk(model, logs, &mut Predictor::new(model), &z, |at, _, innovation| {
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
