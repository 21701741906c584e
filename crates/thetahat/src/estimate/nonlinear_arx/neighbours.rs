//! Nearest neighbours: samples are the model, and the choice is how many of them are asked.

use rayon::prelude::*;
use thetahat_core::{MOST_NEIGHBOURS, MOST_SLOPES};

use super::figures::{Sums, run};
use super::{BLOCKS, Chosen, Count, RunFigures, Samples, Solved, TermStep, as_rows};
use crate::Error;
use crate::model::{Evaluator, Map, NonlinearArxModel, Parameter};

/// Samples that are kept, at most: evenly chosen of more.
const KEPT: usize = 5000;
/// Numbers of neighbours that are tried.
const COUNTS: [usize; 10] = [1, 2, 3, 5, 8, 13, 21, 34, 55, 64];

impl Samples<'_> {
    /// The model of some samples that asks `count` of them; its noise is not known.
    fn kept(&self, rows: &[usize], count: usize, planes: bool) -> NonlinearArxModel {
        let rows = evenly(rows, KEPT);
        let points = rows.iter().map(|t| self.point(*t)).collect();
        let map = Map::Neighbours { count, planes, points };
        let names = map.names(&self.names());
        let parameters = names.into_iter().zip(&rows).map(|(name, t)| Parameter {
            name,
            value: self.signals[0][*t],
            standard_error: None,
        });
        self.model(map, parameters.collect())
    }

    /// The mean square of the errors one step ahead on blocks, each by the samples of the others, in units of the
    /// output; none where these are too few. Samples that are next in time are near to one another: what they say of
    /// each other is not what they say of a fresh log (Burman, Chow and Nolan, Biometrika 81, 1994).
    fn blocks_mse(&self, asked: usize, planes: bool) -> Option<f64> {
        let (mut squares, mut count) = (0.0, 0_usize);
        for block in self.blocks() {
            let others = self.others(block);
            if others.len() < asked {
                return None;
            }
            let model = self.kept(&others, asked, planes);
            let theta = model.parameters.iter().map(|parameter| parameter.value).collect();
            let evaluator = Evaluator::new(&model.maps[0].functions, theta);
            let square = |t: &usize| (self.signals[0][*t] - evaluator.value(&self.point(*t))).powi(2);
            let each: Vec<f64> = evenly(block, KEPT / BLOCKS).par_iter().map(square).collect();
            squares += each.iter().sum::<f64>();
            count += each.len();
        }
        Some(squares * self.scale.powi(2) / count as f64)
    }

    /// Keeps the samples, and chooses how many of them are asked, unless that is given.
    ///
    /// # Errors
    /// [`Error::Argument`] for a number that the samples do not have, or a criterion that counts parameters;
    /// [`Error::Undetermined`] for too few samples to hold some of them out.
    pub(crate) fn keep(
        &self,
        planes: bool,
        count: &Count,
        chosen_on: Option<&Self>,
    ) -> Result<(Chosen, Solved), Error> {
        let samples = self.rows.len().min(KEPT);
        if planes && self.taps.len() > MOST_SLOPES {
            return Err(Error::argument(
                "ny",
                format!(
                    "a plane is fitted to {MOST_SLOPES} regressors at most, there are {}; take fewer lags, or means in place of planes",
                    self.taps.len()
                ),
            ));
        }
        let others = samples - 1;
        let tried: Vec<usize> = match *count {
            Count::Given(wanted) if wanted == 0 || wanted > others.min(MOST_NEIGHBOURS) => {
                return Err(Error::argument(
                    "units",
                    format!(
                        "{wanted} neighbours of {samples} samples; give from 1 to {}",
                        others.min(MOST_NEIGHBOURS)
                    ),
                ));
            }
            Count::Given(wanted) => vec![wanted],
            Count::Least(_) => {
                return Err(Error::argument(
                    "select",
                    "samples are no parameters, so that information criteria do not count them; take validation or cv",
                ));
            }
            _ => COUNTS.into_iter().filter(|count| *count <= others).collect(),
        };
        let mut steps = Vec::new();
        let square = self.mean_square(&self.rows);
        for &asked in &tried {
            let Some(mse) = self.blocks_mse(asked, planes) else { break };
            let held_out = match count {
                Count::HeldOut(rows) => {
                    let others = chosen_on.unwrap_or(self);
                    // Where fewer samples are chosen on than are asked, nothing is known.
                    let enough = asked <= others.rows.len();
                    enough
                        .then(|| RunFigures::of(&others.kept(&others.rows, asked, planes), self.log, rows))
                        .transpose()?
                }
                Count::Blocks => self.in_blocks(asked, planes)?,
                _ => None,
            };
            steps.push(TermStep {
                term: format!("{asked} neighbour{}", if asked == 1 { "" } else { "s" }),
                parameters: samples.div_ceil(asked),
                error_reduction: 1.0 - mse / square,
                aliases: Vec::new(),
                rmse: mse.sqrt(),
                free_run: None,
                held_out,
            });
        }
        if steps.is_empty() {
            return Err(Error::undetermined(
                Vec::new(),
                format!(
                    "{samples} samples are too few: each fifth of them is predicted from the others; give fewer `units`, or more rows"
                ),
            ));
        }
        let taken = if let Count::Given(_) = count { 1 } else { count.best(&steps, 1, samples) };
        let mut model = self.kept(&self.rows, tried[taken - 1], planes);
        let mse = steps[taken - 1].rmse.powi(2);
        model.noise_covariance = vec![vec![mse]];
        let map = model.maps[0].functions.clone();
        Ok((Chosen { map, steps, taken }, Solved { model, mse, condition: None }))
    }

    /// The free runs on blocks, each by the samples of the others.
    fn in_blocks(&self, asked: usize, planes: bool) -> Result<Option<RunFigures>, Error> {
        let mut sums = Sums::default();
        for block in self.blocks() {
            let others = self.others(block);
            if others.len() < asked {
                return Ok(None);
            }
            sums.add(run(&self.kept(&others, asked, planes), self.log, &as_rows(block))?);
        }
        Ok(Some(sums.figures()))
    }
}

/// Some of them, `most` at most.
fn evenly(rows: &[usize], most: usize) -> Vec<usize> {
    let kept = rows.len().min(most);
    (0..kept).map(|place| rows[place * rows.len() / kept]).collect()
}
