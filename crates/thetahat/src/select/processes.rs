//! Processes in continuous time beside the polynomial models of a step test.
//!
//! A log of few steps has few lags to choose orders from, and what stands between a step and its effect, a gain, time
//! constants and a dead time, is what the test was made for. So some structures are fitted without each third of the
//! rows, as polynomial models are (see `held_out`), and evaluated on it: by their free run from the first row on, at
//! rest with the first inputs, as a process has no initial state of its own. Dead times are those of all rows, as the
//! delays of polynomial models are, and time constants stay near theirs: a block may have all that there is to see of a
//! lag. Fits see every so many rows of a long log, which costs them little: the response is exact at any time.

use std::borrow::Cow;
use std::ops::Range;

use rayon::prelude::*;
use thetahat_numerics::optimize::Search;
use thetahat_numerics::regression::sum;

use super::candidates::total;
use super::folds::Folds;
use super::held_out::{BLOCKS, cut, deviation, mean_square};
use super::selection::logarithm;
use super::winners::GATE;
use super::{HeldOut, ProcessCandidate, SelectedModel, Selection, Task};
use crate::Error;
use crate::estimate::{
    Background, FreeRun, InformationCriterion, Method, estimate_monitored, least_free_run,
    least_free_run_from,
};
use crate::figures::fixed;
use crate::model::{Orders, ProcessModel, ProcessStructure};
use crate::respond::Horizon;
use crate::respond::process::{HeldLog, at_rest};

/// What is tried, the same from each input.
const STRUCTURES: [&str; 5] = ["p0di", "p1d", "p1di", "p2d", "p2du"];
/// A step test changes an input this often at most.
const MOST_CHANGES: usize = 20;
/// It holds its levels for this many rows, on average.
const HELD: usize = 20;
/// About so many rows are seen.
const SEEN: usize = 2000;

/// Whether each of the inputs, missing values left out, has few steps, and time to show what they do.
pub(crate) fn is_step_test(inputs: &[&[f64]]) -> bool {
    let few = |input: &&[f64]| {
        let count =
            changes(input.iter().copied().filter(|value| !value.is_nan())).take(MOST_CHANGES + 1).count();
        Some(count).filter(|count| (1..=MOST_CHANGES).contains(count))
    };
    let changes: Option<Vec<usize>> = inputs.iter().map(few).collect();
    let rows = inputs.first().map_or(0, |input| input.len());
    changes.is_some_and(|changes| !changes.is_empty() && rows >= HELD * changes.iter().sum::<usize>())
}

/// The places at which a value is not what it was before.
fn changes(values: impl Iterator<Item = f64>) -> impl Iterator<Item = usize> {
    let mut before = None;
    values
        .enumerate()
        .filter(move |(_, value)| before.replace(*value).is_some_and(|before| before != *value))
        .map(|(place, _)| place)
}

/// The rows in which processes are compared.
struct Excerpt<'a> {
    held: Cow<'a, [HeldLog]>,
    output: Cow<'a, [f64]>,
    /// Which block a row is of.
    block: Vec<Option<usize>>,
}

impl<'a> Excerpt<'a> {
    /// All rows, or about [`SEEN`] of them.
    fn new(held: &'a [HeldLog], output: &'a [f64], folds: &Folds<'_, '_>) -> Self {
        let mut block = vec![None; output.len()];
        for fold in 0..folds.count() {
            folds.test(fold).segments.into_iter().for_each(|rows| block[rows].fill(Some(fold)));
        }
        let rows: usize = held.iter().map(|part| part.times.len()).sum();
        let every = rows.div_ceil(SEEN);
        if every == 1 {
            return Self { held: Cow::Borrowed(held), output: Cow::Borrowed(output), block };
        }
        let mut seen = Self { held: Cow::default(), output: Cow::default(), block: Vec::new() };
        for part in held {
            let mut kept: Vec<usize> = (0..part.times.len()).step_by(every).collect();
            part.inputs.iter().for_each(|input| kept.extend(changes(input.iter().copied())));
            kept.sort_unstable();
            kept.dedup();
            let before = seen.block.len();
            let counts =
                |row: &usize| part.counted.iter().any(|rows| rows.contains(&(row + part.rows.start)));
            // A row that does not count has an output that is left out.
            let value = |row: &usize| if counts(row) { output[row + part.rows.start] } else { f64::NAN };
            seen.output.to_mut().extend(kept.iter().map(value));
            seen.block.extend(kept.iter().map(|row| block[row + part.rows.start]));
            let rows = before..seen.block.len();
            seen.held.to_mut().push(HeldLog {
                counted: vec![rows.clone()],
                rows,
                after_pause: part.after_pause,
                begins: part.begins,
                times: kept.iter().map(|row| part.times[*row]).collect(),
                inputs: part
                    .inputs
                    .iter()
                    .map(|input| kept.iter().map(|row| input[*row]).collect())
                    .collect(),
                held: part.held,
            });
        }
        seen
    }

    /// The output without a block.
    fn without(&self, left_out: usize) -> Vec<f64> {
        let kept = self.output.iter().zip(&self.block);
        kept.map(|(value, block)| if *block == Some(left_out) { f64::NAN } else { *value }).collect()
    }

    /// The mean of the squared errors in a block, cut off, and how many they are; none without one.
    fn mean_square(
        &self,
        structures: &[ProcessStructure],
        found: &FreeRun,
        block: usize,
        deviation: f64,
    ) -> Option<(f64, usize)> {
        let mut first = 0;
        let parts = structures.iter().map(|structure| {
            let own: Range<usize> = first..first + structure.parameters();
            first = own.end;
            structure.taken_apart(&found.parameters[own])
        });
        let parts: Vec<_> = parts.collect();
        let mut response = vec![0.0; self.output.len()];
        at_rest(structures, &parts, &self.held, &mut response);
        for part in self.held.iter() {
            for (row, time) in part.rows.clone().zip(&part.times) {
                let slope = found.slope.unwrap_or(0.0) * (part.begins + time - found.middle);
                response[row] += found.level.unwrap_or(0.0) + slope;
            }
        }
        let own = (0..self.output.len()).filter(|row| self.block[*row] == Some(block));
        let own: Vec<f64> = own
            .filter(|row| !self.output[*row].is_nan())
            .map(|row| cut((self.output[row], response[row]), deviation).powi(2))
            .collect();
        (!own.is_empty()).then(|| (sum(own.iter().copied()) / own.len() as f64, own.len()))
    }
}

/// What speaks for one structure; none where the log does not determine it, or it is another that competes too.
fn candidate(
    task: &Task<'_>,
    excerpt: &Excerpt<'_>,
    structure: ProcessStructure,
    background: Background,
    deviation: f64,
) -> Result<Option<ProcessCandidate>, Error> {
    let structures = vec![structure; task.inputs.len()];
    let names = ProcessModel::names(&structures, task.inputs);
    let search = Search { starts: 0, time_limit: task.deadline.left(), ..task.search.clone() };
    let seen = (&*excerpt.held, &*excerpt.output);
    let whole = least_free_run(&structures, &names, seen, background, &search, task.monitor);
    let Some(whole) = unless_undetermined(whole)? else { return Ok(None) };
    // A pair with more damping is two lags, which compete as such.
    let damping = structure.names().iter().position(|name| name == "zeta");
    if damping.is_some_and(|place| whole.run.parameters[place] >= 1.0) {
        return Ok(None);
    }
    let mut held_out = None;
    let (mut squares, mut samples) = (0.0, 0);
    for block in 0..BLOCKS {
        let (start, output) = (&whole.run.parameters, excerpt.without(block));
        let seen = (&*excerpt.held, &*output);
        let refit = least_free_run_from(start, &structures, seen, background, &search, task.monitor);
        let found = unless_undetermined(refit)?.flatten();
        let Some((mean, count)) =
            found.and_then(|found| excerpt.mean_square(&structures, &found, block, deviation))
        else {
            held_out = None;
            break;
        };
        squares += mean * count as f64;
        samples += count;
        let blocks = squares / samples as f64;
        held_out = Some(HeldOut { blocks, onward: mean, unpunished: blocks, unstable: 0, refits: BLOCKS });
    }
    let mdl = InformationCriterion::MDL.value(whole.mse, names.len(), whole.samples);
    Ok(Some(ProcessCandidate { structure, parameters: names.len(), mse: whole.mse, mdl, held_out }))
}

fn unless_undetermined<T>(found: Result<T, Error>) -> Result<Option<T>, Error> {
    match found {
        Ok(found) => Ok(Some(found)),
        Err(Error::Interrupted) => Err(Error::Interrupted),
        Err(_) => Ok(None),
    }
}

/// Compares processes with the polynomial model that was chosen; also gives the structure of the one that is taken, if
/// one is.
///
/// The process has the least MDL of its free run. It is taken where no polynomial model does clearly better on the
/// blocks, as it has the fewest parameters and they are those that a step test is made for. Where the rows without a
/// block, that of the only step say, do not determine one of the two, it is taken if its free run over all rows is
/// about as good.
///
/// # Errors
/// [`Error::Interrupted`].
pub(crate) fn processes(
    task: &Task<'_>,
    found: SelectedModel,
    (held, output): (&[HeldLog], &[f64]),
    background: Background,
) -> Result<(SelectedModel, Option<ProcessStructure>), Error> {
    let deviation = deviation(task.estimation);
    let folds = Folds::new(task.estimation, BLOCKS);
    if deviation == 0.0 || (0..BLOCKS).any(|fold| total(&folds.test(fold)) == 0) {
        return Ok((found, None));
    }
    let excerpt = Excerpt::new(held, output, &folds);
    let structures = STRUCTURES.iter().filter_map(|word| word.parse().ok());
    let structures: Vec<ProcessStructure> = structures.collect();
    let candidates: Vec<Option<ProcessCandidate>> = structures
        .into_par_iter()
        .map(|structure| candidate(task, &excerpt, structure, background, deviation))
        .collect::<Result<_, Error>>()?;
    let mut candidates: Vec<ProcessCandidate> = candidates.into_iter().flatten().collect();
    // What a larger structure adds must be worth its parameters.
    let smaller = candidates.clone();
    candidates.retain(|own| {
        let beats = |other: &ProcessCandidate| other.parameters < own.parameters && other.mdl <= own.mdl;
        !smaller.iter().any(beats)
    });
    let mdl = |own: &ProcessCandidate| own.mdl.unwrap_or(f64::NEG_INFINITY);
    candidates.sort_by(|one, other| mdl(one).total_cmp(&mdl(other)));
    let SelectedModel { mut selection, decisions, initial_parameters } = found;
    let mut taken = None;
    if let Some(best) = candidates.first() {
        let others: Vec<String> = candidates.iter().map(said).collect();
        selection.steps.push(format!(
            "The inputs have few steps, so processes in continuous time compete, in free runs from rest on held-out blocks: {}.",
            others.join(", ")
        ));
        let (is_taken, why) = verdict(
            &selection,
            best,
            free_run(task, &selection.chosen.orders, initial_parameters.as_deref())?,
        );
        taken = is_taken.then_some(best.structure);
        selection.steps.push(if is_taken {
            format!("Taken instead: the process {}, as {why}.", best.structure)
        } else {
            format!("Not taken, as {why}; `structure` {} fits the process.", best.structure)
        });
    }
    selection.processes = candidates;
    Ok((SelectedModel { selection, decisions, initial_parameters }, taken))
}

fn said(candidate: &ProcessCandidate) -> String {
    match candidate.held_out {
        Some(seen) => format!("{} {} %", candidate.structure, fixed(seen.percent(), 1)),
        None => format!("{}, which they do not determine without one", candidate.structure),
    }
}

/// The mean square of the errors of a polynomial model's free run over all rows; none where it grows out of the range
/// of numbers.
///
/// # Errors
/// [`Error::Interrupted`].
fn free_run(
    task: &Task<'_>,
    orders: &Orders,
    initial_parameters: Option<&[f64]>,
) -> Result<Option<f64>, Error> {
    let orders = task.with_constants(orders);
    let square = |parameters: &[f64]| mean_square(&orders, parameters, task.estimation, Horizon::FreeRun);
    if let Some(initial_parameters) = initial_parameters {
        return Ok(square(initial_parameters));
    }
    // Of models without C, D and F nothing was kept.
    let method = Method::PredictionError(task.search.clone());
    let found = estimate_monitored(task.estimation, &orders, &method, task.initial, task.monitor);
    Ok(unless_undetermined(found)?.and_then(|found| square(found.parameters())))
}

/// Whether the best process is taken, and why; `free_run` is the mean square of the free run of the polynomial model
/// that was chosen.
fn verdict(selection: &Selection, best: &ProcessCandidate, free_run: Option<f64>) -> (bool, &'static str) {
    let Some(winners) = &selection.winners else {
        return (false, "no polynomial model is stable: the plant may be unstable");
    };
    let chosen = &selection.chosen;
    if chosen.held_out.is_some_and(|seen| seen.unstable == seen.refits) {
        return (false, "the plant is unstable");
    }
    let (Some(own), Some(before)) = (best.held_out, chosen.held_out) else {
        return match free_run {
            Some(square) if logarithm(best.mse) > logarithm(square) + GATE => {
                (false, "the free run of the polynomial model is closer to all rows")
            }
            Some(_) => {
                (true, "the rows without a block do not determine both, and it is as close to all of them")
            }
            None => (true, "the free run of the polynomial model grows without bound"),
        };
    };
    let best = winners.simulation.held_out.map_or(before.both(), |seen| seen.both().min(before.both()));
    if own.both() > best + GATE {
        return (false, "a polynomial model does better there");
    }
    (true, "no polynomial model does clearly better there")
}

#[cfg(test)]
mod tests;
