//! A model in state space beside the polynomial models.
//!
//! The orders of polynomials that are compared end where searches become unsafe: a plant of many modes has more, and
//! its states come from one factor whatever their number (see [`subspace`](crate::estimate::subspace())). So the order
//! of the least MDL is fitted without each third of the rows, as polynomial models are (see `held_out`), and evaluated
//! on it by its free run. It is taken where it is better than all of them by [`FAR`](super::winners::FAR): parameters
//! of polynomials have standard errors, and a smaller fall says little. Free runs on later rows of 240 simulated plants
//! of order 1 to 3 became worse where the fall was 0.13 and 0.17, and no fall was above 0.3. Of 96 plants of two to
//! eight modes 26 had more: these free runs fit better by 1.4 to 13 points, 6 in the mean.

use std::borrow::Cow;

use super::candidates::total;
use super::compare::few_for_blocks;
use super::rival::on_blocks;
use super::winners::slowest;
use super::{HeldOut, SelectedModel, Selection, StateSpaceCandidate, Task};
use crate::Error;
use crate::data::{JointRecord, Record, measured};
use crate::estimate::{Constant, Ordered, SubspaceOptions, subspace};
use crate::figures::fixed;
use crate::model::{StateSpace, is_stable};
use crate::respond::Response;
use crate::respond::state_space::Recursion;

/// The model without a block, and the level of its output.
struct Refit {
    model: StateSpace,
    level: f64,
}

impl Refit {
    /// The free run of a record, each segment from the state that fits it best.
    fn run(&self, record: &Record<'_>) -> Result<Response, Error> {
        let output: Cow<'_, [f64]> = if self.level == 0.0 {
            Cow::Borrowed(record.output)
        } else {
            record.output.iter().map(|value| value - self.level).collect()
        };
        let mut simulator = Recursion::simulator(&self.model);
        let mut response = Response { values: vec![f64::NAN; output.len()], counted: Vec::new() };
        for rows in &record.segments {
            simulator.start_at_best(&record.inputs, &[&output], rows.clone());
            for row in rows.clone() {
                response.values[row] = simulator.step(&record.inputs, row)[0] + self.level;
            }
            response.counted.extend(measured(&output, rows));
        }
        if record.segments.iter().cloned().flatten().any(|row| !response.values[row].is_finite()) {
            return Err(Error::data("the response grows out of the range of numbers"));
        }
        Ok(response)
    }
}

fn joint<'a>(record: &Record<'a>) -> JointRecord<'a> {
    let Record { output, inputs, segments, .. } = record.clone();
    JointRecord { inputs, outputs: vec![output], segments }
}

/// Compares the model in state space that has the least MDL with the polynomial model that was chosen; also gives its
/// order where it is taken instead. Without a stable polynomial model that was evaluated on blocks there is nothing to
/// compare it with.
///
/// # Errors
/// [`Error::Interrupted`].
pub(crate) fn states(
    task: &Task<'_>,
    found: SelectedModel,
    constant: Constant,
) -> Result<(SelectedModel, Option<usize>), Error> {
    let SelectedModel { mut selection, decisions, initial_parameters } = found;
    let mut taken = None;
    if selection.has_rivals()
        && task.looks_further()
        && !task.deadline.is_over()
        && let Some((candidate, radius)) = candidate(task, constant, selection.level_window)
    {
        let order = candidate.order;
        let (is_taken, why) = verdict(&candidate, radius <= slowest(total(task.estimation)), &selection);
        taken = is_taken.then_some(order);
        let percent = candidate.held_out.map(|seen| format!(", {} %", fixed(seen.percent(), 1)));
        selection.steps.push(format!(
            "In state space: order {order}{}; {} as {why}.",
            percent.unwrap_or_default(),
            if is_taken { "taken instead," } else { "not taken," }
        ));
        selection.state_space = Some(candidate);
    }
    Ok((SelectedModel { selection, decisions, initial_parameters }, taken))
}

/// Whether the model is taken, and why.
fn verdict(candidate: &StateSpaceCandidate, is_fast: bool, selection: &Selection) -> (bool, &'static str) {
    match &candidate.held_out {
        _ if !is_fast => (false, "it is unstable, or slower than the rows can show"),
        None => (false, "the rows without a block do not determine it"),
        Some(seen) if selection.is_far_worse_than(seen) => (true, "no polynomial model comes near it"),
        Some(_) => (false, "it is not far better than polynomials"),
    }
}

/// The model of the order of the least MDL, and the largest modulus of its poles; none where the record has none.
fn candidate(
    task: &Task<'_>,
    constant: Constant,
    window: Option<usize>,
) -> Option<(StateSpaceCandidate, f64)> {
    let whole = task.named_record();
    let found = Ordered::new(&joint(&whole), &SubspaceOptions::default(), None, constant).ok()?;
    let Ordered { subspace: states, order, scores, .. } = found;
    states.levels(order)?;
    let poles = states.state_space(order, 1.0).ok()?.poles().ok()?;
    let radius = poles.iter().map(|pole| pole.re.hypot(pole.im)).fold(0.0, f64::max);
    let options = SubspaceOptions {
        feedthrough: Some(states.feedthrough()),
        constant: states.has_constant(),
        ..SubspaceOptions::default()
    };
    let parameters = states.free_parameters(order);
    let held_out = held_out(&few_for_blocks(&whole, &whole), window, &options, order);
    Some((StateSpaceCandidate { order, parameters, orders: scores, held_out }, radius))
}

/// What models of an order do on blocks that they were not fitted to; none where the rows without one do not determine
/// them.
fn held_out(
    record: &Record<'_>,
    window: Option<usize>,
    options: &SubspaceOptions,
    order: usize,
) -> Option<HeldOut> {
    let fit = |training: &Record<'_>| {
        let states = subspace(&joint(training), options).ok()?;
        let model = states.state_space(order, 1.0).ok()?;
        let level = states.levels(order)?.first().copied()?;
        Some((is_stable(&model.f), Refit { model, level }))
    };
    on_blocks(record, window, fit, |refit, record| refit.run(record))
}
