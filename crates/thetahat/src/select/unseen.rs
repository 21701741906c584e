//! What models cost on samples that they were not fitted to.

use std::ops::Range;

use rayon::prelude::*;

use super::compare::{Samples, Tried, energy, rows};
use super::linear::{Columns, Kept, Rows, Scaled};
use super::{EXACT, Select, Task};
use crate::data::Record;
use crate::estimate::{Common, Point};
use crate::regression::Presample;
use crate::{Error, Orders};

/// Blocks of a cross-validation.
const BLOCKS: usize = 5;

/// The mean of e^2 of each model on unseen samples, the same for all; none where the choice does not need it, or the data
/// do not determine a model.
///
/// # Errors
/// [`Error::Undetermined`] if no such sample counts; [`Error::Interrupted`].
pub(super) fn costs(
    task: &Task<'_>,
    record: &Record<'_>,
    tried: &[Tried],
) -> Result<Vec<Option<f64>>, Error> {
    // The samples before a piece of a log are not zero, whatever those before its first are taken for.
    let samples = &Samples::unknown(record, tried.iter().map(|model| &model.orders));
    match (task.select, task.validation) {
        (Select::Validation, Some(validation)) => validated(task, validation, samples, tried),
        (Select::Cv, _) => cross_validated(task, record, samples, tried),
        _ => Ok(vec![None; tried.len()]),
    }
}

/// The linear models among those that have parameters, and all others.
fn parted(tried: &[Tried]) -> (Vec<usize>, Vec<usize>) {
    let fitted = (0..tried.len()).filter(|&k| tried[k].point.is_some());
    fitted.partition(|&k| tried[k].orders.is_linear())
}

fn columns_of(tried: &[Tried], linear: &[usize], inputs: usize) -> Columns {
    Columns::new(linear.iter().map(|&k| &tried[k].orders), inputs)
}

fn validated(
    task: &Task<'_>,
    validation: &Record<'_>,
    samples: &Samples,
    tried: &[Tried],
) -> Result<Vec<Option<f64>>, Error> {
    let count = samples.count(validation);
    if count == 0 {
        return Err(nothing_to_see("validation", samples));
    }
    let (linear, searched) = parted(tried);
    let mut costs = vec![None; tried.len()];
    if !linear.is_empty() {
        let columns = columns_of(tried, &linear, validation.inputs.len());
        let scaled = Scaled::new(&rows(validation, &columns, samples)?);
        for k in linear {
            let Tried { orders, point } = &tried[k];
            costs[k] = point.as_ref().map(|point| scaled.cost_of(&columns, orders, &point.parameters));
        }
    }
    let common = Common::new(validation, true, samples.window, task.search, task.monitor)?;
    let others = searched.par_iter().map(|&k| {
        let Tried { orders, point } = &tried[k];
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
            "no stretch of the {rows} rows is longer than the {} samples that the models reach back; give more rows, or \
             lower the orders",
            samples.window.counted
        ),
    )
}

fn cross_validated(
    task: &Task<'_>,
    record: &Record<'_>,
    samples: &Samples,
    tried: &[Tried],
) -> Result<Vec<Option<f64>>, Error> {
    let blocks = blocks(record);
    let tests: Vec<Record<'_>> = blocks.iter().map(|block| part(record, joined(block.iter()))).collect();
    let counts: Vec<usize> = tests.iter().map(|test| samples.count(test)).collect();
    if counts.contains(&0) {
        return Err(nothing_to_see("cross-validated", samples));
    }
    let (linear, searched) = parted(tried);
    let mut costs: Vec<Option<f64>> = tried.iter().map(|model| model.point.as_ref().map(|_| 0.0)).collect();
    if !linear.is_empty() {
        let columns = columns_of(tried, &linear, record.inputs.len());
        let orders: Vec<&Orders> = linear.iter().map(|&k| &tried[k].orders).collect();
        let exact = rows(record, &columns, samples)?;
        let kept = if matches!(exact, Rows::Products(..)) { Kept::Products } else { Kept::Factor };
        let parts =
            tests.iter().map(|test| Rows::new(test, &columns, Presample::Drop, samples.window.counted, kept));
        let parts = parts.collect::<Result<Vec<_>, Error>>()?;
        for left_out in 0..BLOCKS {
            let mut others = parts.iter().enumerate().filter(|(k, _)| *k != left_out).map(|(_, part)| part);
            let Some(mut training) = others.next().cloned() else { continue };
            others.try_for_each(|part| training.add(part))?;
            let fitted = Scaled::new(&training).fit(&columns, &orders, true);
            let test = Scaled::new(&parts[left_out]);
            for ((&k, orders), fitted) in linear.iter().zip(&orders).zip(fitted) {
                let enough = orders.parameters() < training.count();
                let cost = fitted
                    .filter(|_| enough)
                    .map(|fitted| test.cost_of(&columns, orders, &fitted.parameters));
                costs[k] = costs[k].and_then(|sum| Some(sum + cost?));
            }
        }
    }
    for (left_out, test) in tests.iter().enumerate() {
        let count = counts[left_out] as f64;
        let others = blocks.iter().enumerate().filter(|(k, _)| *k != left_out).flat_map(|(_, block)| block);
        let training = part(record, joined(others));
        let training = Common::new(&training, true, samples.window, task.search, task.monitor)?;
        let test = training.on(test);
        let found = searched.par_iter().map(|&k| {
            let Tried { orders, point } = &tried[k];
            let Some(Point { parameters, .. }) = point else { return Ok(None) };
            let fitted = training.fit(orders, std::slice::from_ref(parameters), false)?;
            Ok(fitted.and_then(|fitted| test.mean(orders, &fitted.parameters)).map(|mean| mean * count))
        });
        let found = found.collect::<Result<Vec<_>, Error>>()?;
        for (&k, cost) in searched.iter().zip(found) {
            costs[k] = costs[k].and_then(|sum| Some(sum + cost?));
        }
    }
    Ok(means(costs, EXACT * energy(record), counts.iter().sum()))
}

/// Consecutive samples, and which segment they are of.
type Piece = (usize, Range<usize>);

/// Blocks of consecutive samples, as long as one another to within one.
fn blocks(record: &Record<'_>) -> Vec<Vec<Piece>> {
    let total: usize = record.segments.iter().map(Range::len).sum();
    let mut blocks = vec![Vec::new(); BLOCKS];
    let mut before = 0;
    for (number, segment) in record.segments.iter().enumerate() {
        for (k, block) in blocks.iter_mut().enumerate() {
            let start = (k * total / BLOCKS).max(before);
            let end = ((k + 1) * total / BLOCKS).min(before + segment.len());
            if start < end {
                block.push((number, segment.start + start - before..segment.start + end - before));
            }
        }
        before += segment.len();
    }
    blocks
}

/// Pieces of one segment that touch become one.
fn joined<'p>(pieces: impl Iterator<Item = &'p Piece>) -> Vec<Range<usize>> {
    let mut joined: Vec<Piece> = Vec::new();
    for (number, piece) in pieces {
        match joined.last_mut() {
            Some((last, range)) if *last == *number && range.end == piece.start => range.end = piece.end,
            _ => joined.push((*number, piece.clone())),
        }
    }
    joined.into_iter().map(|(_, range)| range).collect()
}

fn part<'a>(record: &Record<'a>, segments: Vec<Range<usize>>) -> Record<'a> {
    let past = vec![0; segments.len()];
    Record { output: record.output, inputs: record.inputs.clone(), segments, past }
}
