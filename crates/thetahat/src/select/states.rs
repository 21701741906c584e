//! A model in state space beside the polynomial models.
//!
//! The orders of polynomials that are compared end where searches become unsafe: a plant of many modes has more, and its states come from
//! one factor whatever their number (see [`subspace`](crate::estimate::subspace())). So the order of the least MDL is fitted without each
//! third of the rows, as polynomial models are (see `held_out`), and evaluated on it by its free run. It is taken where it is better than
//! all of them by [`FAR`]: parameters of polynomials have standard errors, and a smaller fall says little. Free runs on later rows of 240
//! simulated plants of order 1 to 3 became worse where the fall was 0.13 and 0.17, and no fall was above 0.3. Of 96 plants of two to eight
//! modes 26 had more: these free runs fit better by 1.4 to 13 points, 6 in the mean.

use std::borrow::Cow;

use rayon::prelude::*;

use super::candidates::total;
use super::compare::few_for_blocks;
use super::folds::Folds;
use super::held_out::{BLOCKS, Blocks, deviation};
use super::winners::{FAR, both, slowest};
use super::{HeldOut, SelectedModel, Selection, StateSpaceCandidate, Task};
use crate::Error;
use crate::data::{JointRecord, Record, measured};
use crate::estimate::{Constant, Ordered, SubspaceOptions, subspace};
use crate::figures::fixed;
use crate::model::{StateSpace, is_stable};
use crate::respond::state_space::Recursion;
use crate::respond::{Horizon, Response};

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

/// Compares the model in state space that has the least MDL with the polynomial model that was chosen; also gives its order where it is
/// taken instead. Without a stable polynomial model that was evaluated on blocks there is nothing to compare it with.
///
/// # Errors
/// [`Error::Interrupted`].
pub(crate) fn states(
    task: &Task<'_>,
    found: SelectedModel,
    constant: Constant,
) -> Result<(SelectedModel, Option<usize>), Error> {
    let SelectedModel { mut selection, guess } = found;
    let mut taken = None;
    if let Some(before) = best_of_polynomials(&selection)
        && task.looks_further()
        && !task.deadline.is_over()
        && let Some((candidate, radius)) = candidate(task, constant)
    {
        let order = candidate.order;
        let (is_taken, why) = verdict(&candidate, radius <= slowest(total(task.estimation)), before);
        taken = is_taken.then_some(order);
        let percent = candidate.held_out.map(|seen| format!(", {} %", fixed(seen.percent(), 1)));
        selection.steps.push(format!(
            "In state space: order {order}{}; {} as {why}.",
            percent.unwrap_or_default(),
            if is_taken { "taken instead," } else { "not taken," }
        ));
        selection.state_space = Some(candidate);
    }
    Ok((SelectedModel { selection, guess }, taken))
}

/// The mean of logarithms of the better of the polynomial model that was chosen and the one that simulates best; none where the plant is
/// unstable, or neither was evaluated.
fn best_of_polynomials(selection: &Selection) -> Option<f64> {
    let simulation = selection.winners.as_ref()?.simulation.held_out;
    let chosen = selection.chosen.held_out;
    if chosen.is_some_and(|seen| seen.unstable == seen.refits) {
        return None;
    }
    [simulation, chosen].iter().flatten().map(both).min_by(f64::total_cmp)
}

/// Whether the model is taken, and why.
fn verdict(candidate: &StateSpaceCandidate, is_fast: bool, before: f64) -> (bool, &'static str) {
    match &candidate.held_out {
        _ if !is_fast => (false, "it is unstable, or slower than the rows can show"),
        None => (false, "the rows without a block do not determine it"),
        Some(seen) if before - both(seen) > FAR => (true, "no polynomial model comes near it"),
        Some(_) => (false, "it is not far better than polynomials"),
    }
}

/// The model of the order of the least MDL, and the largest modulus of its poles; none where the record has none.
fn candidate(task: &Task<'_>, constant: Constant) -> Option<(StateSpaceCandidate, f64)> {
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
    let held_out = held_out(&few_for_blocks(&whole, &whole), &options, order);
    Some((StateSpaceCandidate { order, parameters, orders: scores, held_out }, radius))
}

/// What models of an order do on blocks that they were not fitted to; none where the rows without one do not determine them.
fn held_out(record: &Record<'_>, options: &SubspaceOptions, order: usize) -> Option<HeldOut> {
    let deviation = deviation(record);
    let folds = Folds::new(record, BLOCKS);
    if deviation == 0.0 || (0..BLOCKS).any(|fold| total(&folds.test(fold)) == 0) {
        return None;
    }
    let refit = |fold: usize| {
        let states = subspace(&joint(&folds.training(fold)), options).ok()?;
        let model = states.state_space(order, 1.0).ok()?;
        let level = states.levels(order)?.first().copied()?;
        Some((is_stable(&model.f), Refit { model, level }))
    };
    let refits = (0..BLOCKS).into_par_iter().map(refit).collect::<Option<Vec<_>>>()?;
    let blocks = Blocks::new(record, &folds, deviation);
    let figures = blocks.figures(&refits, Horizon::FreeRun, |refit, record, _| refit.run(record));
    figures.map(|(seen, _)| seen)
}

#[cfg(test)]
mod tests {
    use super::*;
    use thetahat_numerics::noise::Noise;

    fn candidate(blocks: f64, onward: f64) -> StateSpaceCandidate {
        let held_out = Some(HeldOut { blocks, onward, unpunished: blocks, unstable: 0, refits: BLOCKS });
        StateSpaceCandidate { order: 2, parameters: 6, orders: Vec::new(), held_out }
    }

    #[test]
    fn a_model_in_state_space_has_to_be_far_better() {
        // exp(-0.3) = 0.741, the mean of two logarithms.
        let before = 0.5_f64.ln();
        let is_taken = |factor: f64| verdict(&candidate(0.5 * factor, 0.5 * factor), true, before).0;
        assert!(!is_taken(0.75) && is_taken(0.73));
        assert!(!verdict(&candidate(0.25, 1.0), true, before).0);
        assert!(!verdict(&candidate(0.1, 0.1), false, before).0);
        let unknown = StateSpaceCandidate { held_out: None, ..candidate(0.1, 0.1) };
        assert!(!verdict(&unknown, true, before).0);
    }

    /// The figures against a loop over fits: blocks of a record, each from the state that fits it, the last also after what is before.
    #[test]
    fn held_out_figures_are_those_of_fits_without_a_block() -> Result<(), Error> {
        let mut noise = Noise(3);
        let (u, e) = (noise.take(330), noise.take(330));
        let mut y = vec![1.0; 330];
        for t in 2..330 {
            y[t] = 0.4 + 1.5 * y[t - 1] - 0.7 * y[t - 2] + u[t - 1] + 0.3 * e[t];
        }
        let record = Record::new(&y, vec![&u])?;
        let options =
            SubspaceOptions { constant: true, feedthrough: Some(false), ..SubspaceOptions::default() };
        let seen = held_out(&record, &options, 2).ok_or_else(|| Error::data("there are no figures"))?;
        let fit = |segments: &[std::ops::Range<usize>]| -> Result<Refit, Error> {
            let record = JointRecord { segments: segments.to_vec(), ..JointRecord::new(vec![&u], vec![&y])? };
            let states = subspace(&record, &options)?;
            let level = states.levels(2).unwrap_or_default().iter().sum();
            Ok(Refit { model: states.state_space(2, 1.0)?, level })
        };
        let mean = y.iter().sum::<f64>() / 330.0;
        let variance = y.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / 330.0;
        let square = |run: &Response, rows: std::ops::Range<usize>| -> f64 {
            rows.map(|t| (y[t] - run.values[t]).powi(2)).sum()
        };
        let (first, last) = (0..220, 110..330);
        let joined = [vec![last], vec![0..110, 220..330], vec![first]];
        let mut total = 0.0;
        for (block, others) in [0..110, 110..220, 220..330].into_iter().zip(&joined) {
            let own = Record { segments: vec![block.clone()], ..record.clone() };
            total += square(&fit(others)?.run(&own)?, block);
        }
        assert!((seen.blocks - total / 330.0 / variance).abs() < 1e-9 * seen.blocks, "{seen:?} {total}");
        // The state at the first row is that which fits the rows before the last block.
        let mut known = y.clone();
        known[220..].fill(f64::NAN);
        let run = fit(&joined[2])?.run(&Record { output: &known, ..record.clone() })?;
        let onward = square(&run, 220..330) / 110.0 / variance;
        assert!((seen.onward - onward).abs() < 1e-9 * onward, "{seen:?} {onward}");
        assert_eq!((seen.unstable, seen.refits), (0, BLOCKS));
        Ok(())
    }
}
