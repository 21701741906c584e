//! What models cost on samples that they were not fitted to.

use rayon::prelude::*;

use super::candidates::{Samples, Trial, energy, rows};
use super::folds::{Folds, columns_of, parted};
use super::held_out::mean_square;
use super::linear::Scaled;
use super::{EXACT, Select, Task};
use crate::Error;
use crate::data::Record;
use crate::estimate::Common;

/// Blocks of a cross-validation.
const BLOCKS: usize = 5;

/// The mean of e^2 of each model on held-out samples, the same for all; none where the choice does not need it, or the
/// data do not determine a model.
///
/// # Errors
/// [`Error::Undetermined`] if no such sample counts; [`Error::Interrupted`].
pub(super) fn costs(
    task: &Task<'_>,
    record: &Record<'_>,
    tried: &[Trial],
) -> Result<Vec<Option<f64>>, Error> {
    // The samples before a piece of a log are not zero, whatever those before its first are taken for.
    let samples = &Samples::unknown(record, tried.iter().map(|model| &model.orders));
    match (task.select, task.validation) {
        (Select::Validation, Some(validation)) => validated(task, validation, samples, tried),
        (Select::Cv, _) => cross_validated(task, record, samples, tried),
        _ => Ok(vec![None; tried.len()]),
    }
}

fn validated(
    task: &Task<'_>,
    validation: &Record<'_>,
    samples: &Samples,
    tried: &[Trial],
) -> Result<Vec<Option<f64>>, Error> {
    let count = samples.count(validation);
    if count == 0 {
        return Err(nothing_to_see("validation", samples));
    }
    let (linear, searched) = parted(tried);
    if task.looks_further() {
        let mean = |model: &Trial| {
            let parameters = &model.point.as_ref()?.parameters;
            mean_square(&model.orders, parameters, validation, task.focus.horizon())
        };
        return Ok(tried.par_iter().map(mean).collect());
    }
    let mut costs = vec![None; tried.len()];
    if !linear.is_empty() {
        let columns = columns_of(tried, &linear, validation.inputs.len());
        let scaled = Scaled::new(&rows(validation, &columns, samples)?);
        for k in linear {
            let Trial { orders, point } = &tried[k];
            costs[k] = point.as_ref().map(|point| scaled.cost_of(&columns, orders, &point.parameters));
        }
    }
    let common = Common::new(validation, true, samples.window, task.search, task.deadline, task.monitor)?;
    let others = searched.par_iter().map(|&k| {
        let Trial { orders, point } = &tried[k];
        point
            .as_ref()
            .and_then(|point| common.mean(orders, &point.parameters))
            .map(|mean| mean * count as f64)
    });
    let others: Vec<Option<f64>> = others.collect();
    searched.into_iter().zip(others).for_each(|(k, cost)| costs[k] = cost);
    Ok(means(costs, EXACT * energy(validation), count))
}

/// Costs as means, those that are rounding as zero.
fn means(costs: Vec<Option<f64>>, nothing: f64, count: usize) -> Vec<Option<f64>> {
    let mean = |cost: f64| if cost <= nothing { 0.0 } else { cost / count as f64 };
    costs.into_iter().map(|cost| cost.map(mean).filter(|mean| mean.is_finite())).collect()
}

fn nothing_to_see(rows: &str, samples: &Samples) -> Error {
    Error::undetermined(
        Vec::new(),
        format!(
            "no segment of the {rows} rows is longer than the {} samples that the models reach back; give more rows, or \
             lower the orders",
            samples.window.counted
        ),
    )
}

fn cross_validated(
    task: &Task<'_>,
    record: &Record<'_>,
    samples: &Samples,
    tried: &[Trial],
) -> Result<Vec<Option<f64>>, Error> {
    let folds = Folds::new(record, BLOCKS);
    let tests: Vec<Record<'_>> = (0..BLOCKS).map(|fold| folds.test(fold)).collect();
    let counts: Vec<usize> = tests.iter().map(|test| samples.count(test)).collect();
    if counts.contains(&0) {
        return Err(nothing_to_see("cross-validated", samples));
    }
    let (linear, searched) = parted(tried);
    let columns = columns_of(tried, &linear, record.inputs.len());
    let mut costs: Vec<Option<f64>> = tried.iter().map(|model| model.point.as_ref().map(|_| 0.0)).collect();
    let refits = folds.refitted(task, samples, tried)?;
    for (fold, ((test, refits), count)) in tests.iter().zip(&refits).zip(&counts).enumerate() {
        let add = |costs: &mut [Option<f64>], k: usize, cost: Option<f64>| {
            costs[k] = costs[k].and_then(|sum| Some(sum + cost?));
        };
        if task.looks_further() {
            let seen = folds.test_with_past(fold);
            let mean = |k: usize| {
                let refit = refits[k].as_ref()?;
                mean_square(&tried[k].orders, refit, &seen, task.focus.horizon())
            };
            let means: Vec<Option<f64>> = (0..tried.len()).into_par_iter().map(mean).collect();
            means
                .into_iter()
                .enumerate()
                .for_each(|(k, mean)| add(&mut costs, k, mean.map(|mean| mean * *count as f64)));
            continue;
        }
        if !linear.is_empty() {
            let scaled = Scaled::new(&rows(test, &columns, samples)?);
            for &k in &linear {
                let cost = refits[k].as_ref().map(|refit| scaled.cost_of(&columns, &tried[k].orders, refit));
                add(&mut costs, k, cost);
            }
        }
        let test = Common::new(test, true, samples.window, task.search, task.deadline, task.monitor)?;
        let mean = |&k: &usize| test.mean(&tried[k].orders, refits[k].as_ref()?);
        let means: Vec<Option<f64>> = searched.par_iter().map(mean).collect();
        let sums = means.into_iter().map(|mean| mean.map(|mean| mean * *count as f64));
        searched.iter().zip(sums).for_each(|(&k, sum)| add(&mut costs, k, sum));
    }
    Ok(means(costs, EXACT * energy(record), counts.iter().sum()))
}
