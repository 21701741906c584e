//! Local models, grown by splitting.

use rayon::prelude::*;
use thetahat_core::Local;
use thetahat_core::nalgebra::{DMatrix, DVector};

use super::figures::{Sums, run};
use super::{Candidates, Chosen, Count, RunFigures, Samples, TermStep, as_rows};
use crate::Error;
use crate::figures::short;
use crate::model::{Map, Membership, NonlinearArxModel};

/// What is added to the squares of a local regression, in parts of their mean: splits are compared by it, models are
/// not solved by it.
const SMALL: f64 = 1e-10;

/// How local models are grown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Growth {
    pub(crate) membership: Membership,
    pub(crate) planes: bool,
    /// Local models at most.
    pub(crate) most: usize,
}

/// A model on the way.
struct Step {
    split: String,
    model: NonlinearArxModel,
    /// The share of the squares that is left.
    left: f64,
}

/// A local model on the way, at the samples of the fit.
#[derive(Clone)]
struct Own {
    sides: Vec<[f64; 2]>,
    /// Its membership at each sample, and what it says there.
    member: Vec<f64>,
    says: Vec<f64>,
}

/// What is known at each sample: z, y, and of all local models the sum of the memberships and of what they say,
/// weighted by these.
struct Field<'d> {
    growth: Growth,
    domain: &'d [[f64; 2]],
    points: Vec<Vec<f64>>,
    y: Vec<f64>,
    total: Vec<f64>,
    said: Vec<f64>,
}

impl Field<'_> {
    fn members(&self, sides: &[[f64; 2]]) -> Vec<f64> {
        let Growth { membership, planes, .. } = self.growth;
        let local = Local { membership: membership.of_the_core(), planes, sides, domain: self.domain };
        self.points.iter().map(|z| local.member(sides, z)).collect()
    }

    /// A local model by weighted least squares; none where too few samples are its own.
    fn fitted(&self, sides: Vec<[f64; 2]>, member: Vec<f64>, total: &[f64]) -> Option<Own> {
        let count = if self.growth.planes { self.domain.len() + 1 } else { 1 };
        let regressor = |z: &[f64], place: usize| if place == 0 { 1.0 } else { z[place - 1] };
        let (mut gram, mut cross) = (DMatrix::<f64>::zeros(count, count), DVector::<f64>::zeros(count));
        let mut samples = 0.0;
        for (((z, y), member), total) in self.points.iter().zip(&self.y).zip(&member).zip(total) {
            let weight = member / total;
            if weight < 1e-6 {
                continue;
            }
            samples += weight;
            for i in 0..count {
                let own = weight * regressor(z, i);
                cross[i] += own * y;
                for k in 0..=i {
                    gram[(i, k)] += own * regressor(z, k);
                }
            }
        }
        if samples < (count + 1) as f64 {
            return None;
        }
        let small = SMALL * gram.trace() / count as f64;
        (0..count).for_each(|place| gram[(place, place)] += small);
        let theta = gram.cholesky()?.solve(&cross);
        let plane = |z: &Vec<f64>| (0..count).map(|place| theta[place] * regressor(z, place)).sum();
        let says = self.points.iter().map(plane).collect();
        Some(Own { sides, member, says })
    }

    /// The two local models that come of a box where it is cut in half, and the sum of squared errors with them.
    fn split(&self, own: &Own, regressor: usize) -> Option<([Own; 2], f64)> {
        let [low, high] = own.sides[regressor];
        let middle = f64::midpoint(low, high);
        let half = |side: [f64; 2]| {
            let mut sides = own.sides.clone();
            sides[regressor] = side;
            let member = self.members(&sides);
            (sides, member)
        };
        let halves = [half([low, middle]), half([middle, high])];
        let total: Vec<f64> = (0..self.y.len())
            .map(|at| self.total[at] - own.member[at] + halves[0].1[at] + halves[1].1[at])
            .collect();
        let [first, second] = halves.map(|(sides, member)| self.fitted(sides, member, &total));
        let halves = [first?, second?];
        let error = |at: usize| {
            let said = self.said[at] - own.member[at] * own.says[at]
                + halves.iter().map(|half| half.member[at] * half.says[at]).sum::<f64>();
            self.y[at] - said / total[at]
        };
        let squares: f64 = (0..self.y.len()).map(|at| error(at).powi(2)).sum();
        squares.is_finite().then_some((halves, squares))
    }

    /// The sum of squared errors of all, and the share of it that each local model answers for.
    fn squares(&self, all: &[Own]) -> (f64, Vec<f64>) {
        let square = |at: usize| (self.y[at] - self.said[at] / self.total[at]).powi(2);
        let each: Vec<f64> = (0..self.y.len()).map(square).collect();
        let of = |own: &Own| -> f64 {
            let each = each.iter().zip(&own.member).zip(&self.total);
            each.map(|((square, member), total)| square * member / total).sum()
        };
        (each.iter().sum(), all.iter().map(of).collect())
    }

    fn sum(&mut self, all: &[Own]) {
        for at in 0..self.y.len() {
            self.total[at] = all.iter().map(|own| own.member[at]).sum();
            self.said[at] = all.iter().map(|own| own.member[at] * own.says[at]).sum();
        }
    }
}

impl Samples<'_> {
    /// Local models by LOLIMOT: that which answers for the largest part of the squared errors is cut in half, along the
    /// regressor where this leaves least, and so on (Nelles and Isermann 1996; Nelles, Nonlinear System Identification,
    /// 2001, section 13.3.1). Splits are compared by weighted regressions of the two new models alone; each model on
    /// the way is then solved for all of its parameters.
    ///
    /// # Errors
    /// [`Error::Undetermined`] where a regressor is constant, or samples allow fewer local models than are asked for.
    pub(crate) fn grow(
        &self,
        growth: Growth,
        count: &Count,
        chosen_on: Option<&Self>,
    ) -> Result<Chosen, Error> {
        let path = self.grown(growth, &self.rows)?;
        if let Count::Given(wanted) = *count
            && wanted > path.len()
        {
            return Err(Error::undetermined(
                Vec::new(),
                format!(
                    "{wanted} local models are asked for, and {} samples allow {}; take fewer `units`, or more rows",
                    self.rows.len(),
                    path.len()
                ),
            ));
        }
        let mut held_out: Vec<Option<RunFigures>> = vec![None; path.len()];
        match count {
            Count::Given(_) | Count::Least(_) => {}
            Count::HeldOut(rows) => {
                let others = chosen_on.map(|others| others.grown(growth, &others.rows)).transpose()?;
                for (place, step) in held_out.iter_mut().zip(others.as_ref().unwrap_or(&path)) {
                    *place = Some(RunFigures::of(&step.model, self.log, rows)?);
                }
            }
            Count::Blocks => {
                let mut sums = vec![Some(Sums::default()); path.len()];
                for block in self.blocks() {
                    let others = self.others(block);
                    let own = self.grown(growth, &others)?;
                    let rows = as_rows(block);
                    for (at, sum) in sums.iter_mut().enumerate() {
                        *sum = match (sum.take(), own.get(at)) {
                            (Some(mut sum), Some(step)) => {
                                sum.add(run(&step.model, self.log, &rows)?);
                                Some(sum)
                            }
                            _ => None,
                        };
                    }
                }
                held_out = sums.into_iter().map(|sum| sum.map(Sums::figures)).collect();
            }
        }
        let (rows, square) = (as_rows(&self.rows), self.mean_square(&self.rows));
        let mut before = 1.0;
        let mut steps = Vec::new();
        for (step, held_out) in path.iter().zip(held_out) {
            steps.push(TermStep {
                term: step.split.clone(),
                parameters: step.model.parameters.len(),
                error_reduction: before - step.left,
                aliases: Vec::new(),
                rmse: (step.left.max(0.0) * square).sqrt(),
                free_run: Some(RunFigures::of(&step.model, self.log, &rows)?),
                held_out,
            });
            before = step.left;
        }
        let taken = count.best(&steps, 1, self.rows.len());
        Ok(Chosen { map: path[taken - 1].model.maps[0].functions.clone(), steps, taken })
    }

    /// The models on the way for some samples: one local model, two, and so on. There is one at least.
    fn grown(&self, growth: Growth, rows: &[usize]) -> Result<Vec<Step>, Error> {
        let (domain, names) = (self.ranges(), self.names());
        if let Some(place) = domain.iter().position(|[low, high]| low >= high) {
            return Err(Error::undetermined(
                vec![names[place].clone()],
                format!(
                    "{} is constant over the estimation rows; leave it out, or name other rows",
                    names[place]
                ),
            ));
        }
        let mut field = Field {
            growth,
            domain: &domain,
            points: rows.iter().map(|t| self.point(*t)).collect(),
            y: rows.iter().map(|t| self.signals[0][*t]).collect(),
            total: vec![1.0; rows.len()],
            said: vec![0.0; rows.len()],
        };
        let undetermined = || {
            let needed = if growth.planes { domain.len() + 2 } else { 2 };
            let why = if rows.len() < needed {
                format!(
                    "one local model needs {needed} samples at least, and there are {}; name more rows, or fewer lags",
                    rows.len()
                )
            } else {
                "regressors are sums of one another on the estimation rows, so that no plane is determined; leave some of them out, or \
                 name other rows"
                    .to_owned()
            };
            Error::undetermined(Vec::new(), why)
        };
        let whole = field.members(&domain);
        let mut all = vec![field.fitted(domain.clone(), whole.clone(), &whole).ok_or_else(undetermined)?];
        let mut steps = Vec::new();
        let first = if growth.planes { "plane" } else { "constant" };
        steps.push(self.solved_step(growth, &all, &domain, rows, first.to_owned()).ok_or_else(undetermined)?);
        while steps.len() < growth.most {
            field.sum(&all);
            let (squares, each) = field.squares(&all);
            let mut worst: Vec<usize> = (0..all.len()).collect();
            worst.sort_by(|one, other| each[*other].total_cmp(&each[*one]));
            let halved = worst.into_iter().find_map(|place| {
                let found: Vec<_> = (0..domain.len())
                    .into_par_iter()
                    .map(|regressor| field.split(&all[place], regressor).map(|split| (regressor, split)))
                    .collect();
                let best = found.into_iter().flatten().min_by(|one, other| one.1.1.total_cmp(&other.1.1));
                best.filter(|(_, (_, left))| *left < squares).map(|found| (place, found))
            });
            let Some((place, (regressor, (halves, _)))) = halved else { break };
            let split = format!("split({}, {})", names[regressor], short(halves[0].sides[regressor][1]));
            all.splice(place..=place, halves);
            let Some(step) = self.solved_step(growth, &all, &domain, rows, split) else { break };
            steps.push(step);
        }
        Ok(steps)
    }

    /// A model on the way; none where the samples do not determine its parameters.
    fn solved_step(
        &self,
        growth: Growth,
        all: &[Own],
        domain: &[[f64; 2]],
        rows: &[usize],
        split: String,
    ) -> Option<Step> {
        let Growth { membership, planes, .. } = growth;
        let boxes = all.iter().map(|own| own.sides.clone()).collect();
        let map = Map::Local { membership, planes, boxes, domain: domain.to_vec() };
        let count = map.parameters(domain.len());
        let candidates = Candidates::Functions { map, always: count };
        let products = self.products(&candidates, rows);
        if rows.len() <= count || !products.is_finite() {
            return None;
        }
        let path = self.path(&candidates, &products, count);
        let (model, left) = (self.on_path(&candidates, &path, count), path.left(count));
        (path.chosen.len() == count).then_some(Step { split, model, left })
    }
}
