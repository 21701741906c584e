//! Blocks of a record, each of which is left out once.

use std::ops::Range;

use rayon::prelude::*;
use thetahat_numerics::regression::Presample;

use super::Task;
use super::candidates::{Samples, Trial, rows, total};
use super::linear::{Columns, Kept, Rows, Scaled};
use crate::Error;
use crate::data::Record;
use crate::estimate::{Common, Point};
use crate::model::Orders;

/// The linear models among those that have parameters, and all others.
pub(super) fn parted(tried: &[Trial]) -> (Vec<usize>, Vec<usize>) {
    let fitted = (0..tried.len()).filter(|&k| tried[k].point.is_some());
    fitted.partition(|&k| tried[k].orders.is_linear())
}

pub(super) fn columns_of(tried: &[Trial], linear: &[usize], inputs: usize) -> Columns {
    Columns::new(linear.iter().map(|&k| &tried[k].orders), inputs)
}

/// Consecutive samples, and which segment they are of.
type Piece = (usize, Range<usize>);

/// A record cut into blocks of consecutive samples, as long as one another to within one, each of which is left out
/// once.
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
    pub(super) fn training(&self, fold: usize) -> Record<'r> {
        let others = self.blocks.iter().enumerate().filter(|(k, _)| *k != fold);
        part(self.record, joined(others.flat_map(|(_, block)| block)))
    }

    /// The parameters of models fitted without a block, for each block: from those of all blocks, and for linear ones
    /// from sums over blocks. None where the others do not determine them.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub(super) fn refitted(
        &self,
        task: &Task<'_>,
        samples: &Samples,
        tried: &[Trial],
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
                let Trial { orders, point } = &tried[k];
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
