//! What models cost on samples that they were not fitted to.

use std::ops::Range;

use rayon::prelude::*;

use super::compare::{Samples, Tried, energy, rows, total};
use super::held_out::mean_square;
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
    if task.looks_further() {
        let mean = |model: &Tried| {
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
            let Tried { orders, point } = &tried[k];
            costs[k] = point.as_ref().map(|point| scaled.cost_of(&columns, orders, &point.parameters));
        }
    }
    let common = Common::new(validation, true, samples.window, task.search, task.deadline, task.monitor)?;
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

/// Consecutive samples, and which segment they are of.
type Piece = (usize, Range<usize>);

/// A record cut into blocks of consecutive samples, as long as one another to within one, each of which is left out once.
pub(super) struct Folds<'t, 'r> {
    record: &'t Record<'r>,
    blocks: Vec<Vec<Piece>>,
}

impl<'t, 'r> Folds<'t, 'r> {
    pub(super) fn new(record: &'t Record<'r>, count: usize) -> Self {
        let total = total(record);
        let mut blocks = vec![Vec::new(); count];
        let mut before = 0;
        for (number, segment) in record.segments.iter().enumerate() {
            for (k, block) in blocks.iter_mut().enumerate() {
                let start = (k * total / count).max(before);
                let end = ((k + 1) * total / count).min(before + segment.len());
                if start < end {
                    block.push((number, segment.start + start - before..segment.start + end - before));
                }
            }
            before += segment.len();
        }
        Self { record, blocks }
    }

    pub(super) fn count(&self) -> usize {
        self.blocks.len()
    }

    /// The block that is left out.
    pub(super) fn test(&self, fold: usize) -> Record<'r> {
        part(self.record, joined(self.blocks[fold].iter()))
    }

    /// The same, with what was measured directly before it.
    pub(super) fn test_with_past(&self, fold: usize) -> Record<'r> {
        let past = self.blocks[fold].iter().map(|(number, piece)| {
            self.record.past[*number] + piece.start - self.record.segments[*number].start
        });
        Record { past: past.collect(), ..self.test(fold) }
    }

    /// The others.
    fn training(&self, fold: usize) -> Record<'r> {
        let others = self.blocks.iter().enumerate().filter(|(k, _)| *k != fold);
        part(self.record, joined(others.flat_map(|(_, block)| block)))
    }

    /// The parameters of models fitted without a block, for each block: from those of all blocks, and for linear ones from
    /// sums over blocks. None where the others do not determine them.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub(super) fn refitted(
        &self,
        task: &Task<'_>,
        samples: &Samples,
        tried: &[Tried],
    ) -> Result<Vec<Vec<Option<Vec<f64>>>>, Error> {
        let (linear, searched) = parted(tried);
        let columns = columns_of(tried, &linear, self.record.inputs.len());
        let orders: Vec<&Orders> = linear.iter().map(|&k| &tried[k].orders).collect();
        let mut parts = Vec::new();
        if !linear.is_empty() {
            let exact = rows(self.record, &columns, samples)?;
            let kept = if matches!(exact, Rows::Products(..)) { Kept::Products } else { Kept::Factor };
            for fold in 0..self.count() {
                let test = self.test(fold);
                parts.push(Rows::new(&test, &columns, Presample::Drop, samples.window.counted, kept)?);
            }
        }
        let mut all = Vec::new();
        for fold in 0..self.count() {
            let mut refits = vec![None; tried.len()];
            let mut others = parts.iter().enumerate().filter(|(k, _)| *k != fold).map(|(_, part)| part);
            if let Some(mut training) = others.next().cloned() {
                others.try_for_each(|part| training.add(part))?;
                let fitted = Scaled::new(&training).fit(&columns, &orders, true);
                for ((&k, orders), fitted) in linear.iter().zip(&orders).zip(fitted) {
                    let enough = orders.parameters() < training.count();
                    refits[k] = fitted.filter(|_| enough).map(|fitted| fitted.parameters);
                }
            }
            let training = self.training(fold);
            let training =
                Common::new(&training, true, samples.window, task.search, task.deadline, task.monitor)?;
            let found = searched.par_iter().map(|&k| {
                let Tried { orders, point } = &tried[k];
                let Some(Point { parameters, .. }) = point else { return Ok(None) };
                training.fit(orders, std::slice::from_ref(parameters), false)
            });
            let found = found.collect::<Result<Vec<_>, Error>>()?;
            for (&k, fitted) in searched.iter().zip(found) {
                refits[k] = fitted.map(|fitted| fitted.parameters);
            }
            all.push(refits);
        }
        Ok(all)
    }
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
