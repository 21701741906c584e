//! Models that need a search, each from what its neighbours have found.
//!
//! A neighbour has one order less. Its parameters, and a zero, are parameters of the model with the same cost: so no
//! model ends above a neighbour. (With two orders less, a pole and a zero that cancel would be added, and the gradient
//! is zero there.) Models without such neighbours, and in the end the best ones, begin from the data as well.
//!
//! A choice by a criterion need not fit all of them (branch and bound: Land and Doig, An automatic method of solving
//! discrete programming problems, Econometrica 28, 1960). Models with the same plant differ in C and D, and none of
//! them has a lower cost than the largest of them. So the largest are fitted first, and their cost with the price of a
//! smaller model's parameters bounds its criterion.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;

use super::candidates::Trial;
use super::grid::key;
use crate::Error;
use crate::estimate::{Common, Point, extended};
use crate::model::Orders;

/// This many of the best begin from the data as well.
const BEST: usize = 5;
/// How often the best are searched for.
const ROUNDS: usize = 3;
/// A cost that is above a neighbour's by more than this fraction is one of a worse minimum.
const SAME: f64 = 1e-7;

/// A model whose criterion is above the least by this many units of 2 ln(likelihood) has e^-10 of its probability, and
/// is not fitted.
const HOPELESS: f64 = 20.0;

/// The criterion of a model from its orders, its sum of squared errors and the price of its initial conditions.
pub(super) type Score<'s> = dyn Fn(&Orders, f64, f64) -> f64 + Sync + 's;

/// Models and their neighbours.
pub(super) struct Family {
    /// The neighbours of each model.
    neighbours: Vec<Vec<usize>>,
    /// The models that need a search, by how many steps they are away from one without such neighbours.
    levels: Vec<Vec<usize>>,
    /// For each model the largest with the same plant, if it is another one.
    largest: Vec<Option<usize>>,
}

impl Family {
    /// Of models that are sorted by their number of parameters. The coefficients of inputs after the first `inputs` are
    /// in all.
    pub(super) fn new(models: &[Trial], inputs: usize) -> Self {
        let places: BTreeMap<Vec<usize>, usize> =
            models.iter().map(|model| key(&model.orders)).zip(0..).collect();
        let place = |orders: Orders| places.get(&key(&orders)).copied();
        let neighbours: Vec<Vec<usize>> =
            models.iter().map(|model| smaller(&model.orders, inputs).filter_map(place).collect()).collect();
        let searched = |k: usize| !models[k].orders.is_linear();
        let mut levels: Vec<Vec<usize>> = Vec::new();
        let mut of = vec![0; models.len()];
        for k in (0..models.len()).filter(|&k| searched(k)) {
            let before = neighbours[k].iter().filter(|&&other| searched(other)).map(|&other| of[other] + 1);
            of[k] = before.max().unwrap_or(0);
            levels.resize(levels.len().max(of[k] + 1), Vec::new());
            levels[of[k]].push(k);
        }
        let plant = |k: usize| key(&Orders { nc: 0, nd: 0, ..models[k].orders.clone() });
        let mut largest: BTreeMap<Vec<usize>, usize> = BTreeMap::new();
        for k in (0..models.len()).filter(|&k| searched(k)) {
            let Orders { nc, nd, .. } = models[k].orders;
            let before = largest.entry(plant(k)).or_insert(k);
            let other = &models[*before].orders;
            if nc >= other.nc && nd >= other.nd {
                *before = k;
            }
        }
        let above = |k: usize| {
            let of = largest.get(&plant(k)).copied().filter(|&of| of != k)?;
            let (own, all) = (&models[k].orders, &models[of].orders);
            (own.nc <= all.nc && own.nd <= all.nd).then_some(of)
        };
        let largest = (0..models.len()).map(above).collect();
        Self { neighbours, levels, largest }
    }

    /// Fits the models, from what is there of them and their neighbours. `score` says which are the best. With
    /// `essential` ones only these and those that may have the least score are fitted, to `samples`. Gives how many
    /// were not.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub(super) fn fit(
        &self,
        common: &Common<'_>,
        tried: &mut [Trial],
        score: &Score<'_>,
        essential: Option<(&BTreeSet<Vec<usize>>, usize)>,
    ) -> Result<usize, Error> {
        let mut hopeless = 0;
        let of = |tried: &[Trial], k: usize| {
            let Trial { orders, point } = &tried[k];
            point.as_ref().map_or(f64::INFINITY, |point| score(orders, point.cost, point.initial))
        };
        if essential.is_some() {
            let first: BTreeSet<usize> = self.largest.iter().flatten().copied().collect();
            self.ascend(common, tried, |_, k| first.contains(&k))?;
        }
        self.ascend(common, tried, |tried, k| {
            let Some((essential, samples)) = essential else { return true };
            let Some(largest) = self.largest[k] else { return tried[k].point.is_none() };
            let orders = &tried[k].orders;
            let bound = tried[largest].point.as_ref().map(|point| score(orders, point.cost, point.initial));
            let least = (0..tried.len()).map(|k| of(tried, k)).fold(f64::INFINITY, f64::min);
            let fits = essential.contains(&key(orders))
                || bound.is_none_or(|bound| bound - least <= HOPELESS / samples as f64);
            hopeless += usize::from(!fits);
            fits
        })?;
        let mut begun = vec![false; tried.len()];
        self.levels.first().into_iter().flatten().for_each(|&k| begun[k] = true);
        for _ in 0..ROUNDS {
            let mut order: Vec<usize> = (0..tried.len()).collect();
            let of = |k: usize| of(tried, k);
            order.sort_by(|&a, &b| of(a).total_cmp(&of(b)));
            order.truncate(BEST);
            order.retain(|&k| !begun[k] && !tried[k].orders.is_linear());
            if order.is_empty() {
                break;
            }
            let again = order.par_iter().map(|&k| common.fit(&tried[k].orders, &[], true));
            let again = again.collect::<Result<Vec<_>, Error>>()?;
            for (&k, point) in order.iter().zip(again) {
                begun[k] = true;
                let lower = |point: &Point| {
                    tried[k].point.as_ref().is_none_or(|before| point.cost < before.cost * (1.0 - SAME))
                };
                if point.as_ref().is_some_and(lower) {
                    tried[k].point = point;
                }
            }
            self.repair(common, tried)?;
        }
        Ok(hopeless)
    }

    /// Fits some of the models, the smaller first.
    fn ascend(
        &self,
        common: &Common<'_>,
        tried: &mut [Trial],
        mut which: impl FnMut(&[Trial], usize) -> bool,
    ) -> Result<(), Error> {
        for (number, level) in self.levels.iter().enumerate() {
            let level: Vec<usize> = level.iter().copied().filter(|&k| which(tried, k)).collect();
            let fitted = level.par_iter().map(|&k| {
                let starts = self.starts(k, tried);
                let fitted = common.fit(&tried[k].orders, &starts, number == 0 || starts.is_empty());
                common.finished();
                fitted
            });
            let fitted = fitted.collect::<Result<Vec<_>, Error>>()?;
            level.iter().zip(fitted).for_each(|(&k, point)| tried[k].point = point);
        }
        Ok(())
    }

    /// Begins again where a neighbour's cost is lower.
    fn repair(&self, common: &Common<'_>, tried: &mut [Trial]) -> Result<(), Error> {
        for level in &self.levels {
            let above = |&&k: &&usize| {
                let Some(own) = &tried[k].point else { return false };
                let costs = self.neighbours[k].iter().filter_map(|&n| Some(tried[n].point.as_ref()?.cost));
                costs.into_iter().any(|cost| cost < own.cost * (1.0 - SAME))
            };
            let again: Vec<usize> = level.iter().filter(above).copied().collect();
            let fitted =
                again.par_iter().map(|&k| common.fit(&tried[k].orders, &self.starts(k, tried), false));
            let fitted = fitted.collect::<Result<Vec<_>, Error>>()?;
            // Where there is nothing but a neighbour with a pole and a zero that cancel, there is no such model.
            again.into_iter().zip(fitted).for_each(|(k, point)| tried[k].point = point);
        }
        Ok(())
    }

    /// What a model may begin from: itself, as it was found under other conditions, and its neighbours.
    fn starts(&self, k: usize, tried: &[Trial]) -> Vec<Vec<f64>> {
        let own = tried[k].point.iter().map(|point| point.parameters.clone());
        let others = self.neighbours[k].iter().filter_map(|&other| {
            let Trial { orders, point } = &tried[other];
            Some(extended(orders, &point.as_ref()?.parameters, &tried[k].orders))
        });
        own.chain(others).collect()
    }
}

/// Orders with one step less: of one polynomial, or of the same polynomial of all of the first inputs.
fn smaller(orders: &Orders, inputs: usize) -> impl Iterator<Item = Orders> {
    let less = |values: &[usize]| -> Vec<Vec<usize>> {
        let (own, rest) = values.split_at(inputs);
        let one = (0..inputs).filter(|&j| own[j] > 0).map(|j| {
            let mut less = values.to_vec();
            less[j] -= 1;
            less
        });
        let all = (inputs > 1 && own.iter().all(|&value| value > 0))
            .then(|| own.iter().map(|value| value - 1).chain(rest.iter().copied()).collect());
        one.chain(all).collect()
    };
    let of_one = |value: usize| value.checked_sub(1);
    let mut found = Vec::new();
    found.extend(of_one(orders.na).map(|na| Orders { na, ..orders.clone() }));
    found.extend(less(&orders.nb).into_iter().map(|nb| Orders { nb, ..orders.clone() }));
    found.extend(of_one(orders.nc).map(|nc| Orders { nc, ..orders.clone() }));
    found.extend(of_one(orders.nd).map(|nd| Orders { nd, ..orders.clone() }));
    found.extend(less(&orders.nf).into_iter().map(|nf| Orders { nf, ..orders.clone() }));
    found.into_iter()
}
