//! Starts from the optima of nested models, so that a larger model does not fit worse than a smaller one.
//!
//! The parameters of a smaller model, padded with zeros, have the same cost in a larger one, and a search never ends
//! above the cost that it begins from. So where every model of a lattice begins from the best of those with one
//! coefficient fewer in A, in every B, in C, in D or in every F, no model ends above any that is nested in it, by
//! induction.

use std::collections::BTreeMap;
use std::ops::Range;

use thetahat_numerics::optimize::{Search, best_free};

use super::{Job, Problem};
use crate::Error;
use crate::data::Record;
use crate::estimate::{
    experiment_data::PredictionErrors,
    polynomials::extended,
    predictor::InitialCondition,
    start::{Plants, candidates},
    thinning::{Packed, filled, thinned_to},
};
use crate::model::Orders;

/// How many starts of a smaller model are followed for how many iterations: near enough to its optimum.
const ROUNDS: [(usize, usize); 2] = [(3, 3), (1, 8)];
const SAME_COST: f64 = 1e-6;
const TOLERANCE: f64 = 1e-5;
/// Models of a lattice at most.
const MOST_MODELS: usize = 96;
/// So few of them cost little, where the record is not long.
const FEW_MODELS: usize = 9;
/// Of a longer record the smaller models see segments.
const LONG: usize = 1 << 12;
const SEGMENTS: usize = 4;

/// How many coefficients there are of A, of the longest B, of C, of D and of the longest F.
type Levels = [usize; 5];

impl Job<'_> {
    /// The optima of the models with one coefficient fewer in A, every B, C, D or every F, as parameters of this model.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub(super) fn nested(&self, problem: Problem<'_, '_>) -> Result<Vec<Vec<f64>>, Error> {
        let Problem { record, orders, begin } = problem;
        if !orders.has_f() {
            return self.predecessors(problem);
        }
        let thin = thinned(record);
        let thin = thin.as_ref().map(Packed::record);
        // In the middle of a log nothing is at rest.
        let (record, begin) = thin.as_ref().map_or((record, begin), |thin| (thin, InitialCondition::Unknown));
        let top = levels(orders);
        let bottom = bottom(&top);
        let mut known: BTreeMap<Levels, Vec<f64>> = BTreeMap::new();
        let mut plants: BTreeMap<[usize; 2], Plants> = BTreeMap::new();
        let mut next = Some(bottom);
        while let Some(at) = next {
            next = following(&at, &bottom, &top);
            if at == top || self.deadline.is_over() {
                continue;
            }
            let own = lowered(orders, &top, &at);
            let mut predictor = Problem { record, orders: &own, begin }.predictor();
            if predictor.samples() <= own.parameters() + predictor.initial_conditions() {
                continue;
            }
            let padded = smaller(&at)
                .filter_map(|less| Some(extended(&lowered(orders, &top, &less), known.get(&less)?, &own)));
            let mut starts: Vec<Vec<f64>> = padded.collect();
            if has_recipes(&at, &top, &bottom) {
                starts.extend(filled(record, |record| {
                    let plants = plants.entry([at[1], at[4]]);
                    let plants = plants.or_insert_with(|| Plants::new(record, &own, self.deadline));
                    plants.with_noise(record, &own, self.deadline)
                }));
            }
            if let Some(parameters) = self.optimum(&mut predictor, starts)? {
                known.insert(at, parameters);
            }
        }
        let last = smaller(&top)
            .filter_map(|less| Some(extended(&lowered(orders, &top, &less), known.get(&less)?, orders)));
        Ok(last.collect())
    }

    /// The optima of the models with one coefficient fewer in A, every B or C, each from its own recipes, as parameters
    /// of this model.
    fn predecessors(&self, problem: Problem<'_, '_>) -> Result<Vec<Vec<f64>>, Error> {
        let Problem { record, orders, begin } = problem;
        let thin = thinned(record);
        let thin = thin.as_ref().map(Packed::record);
        let (record, begin) = thin.as_ref().map_or((record, begin), |thin| (thin, InitialCondition::Unknown));
        let top = levels(orders);
        let mut padded = Vec::new();
        for less in smaller(&top).filter(|less| !self.deadline.is_over() && less[2] > 0) {
            let own = lowered(orders, &top, &less);
            let mut predictor = Problem { record, orders: &own, begin }.predictor();
            let recipes = filled(record, |record| candidates(record, &own, self.deadline));
            let starts = recipes.unwrap_or_default().into_iter().map(|candidate| candidate.parameters);
            if let Some(parameters) = self.optimum(&mut predictor, starts.collect())? {
                padded.push(extended(&own, &parameters, orders));
            }
        }
        Ok(padded)
    }

    /// Where a search leads from the best of some starts: best after a few iterations of those that cost least.
    fn optimum(
        &self,
        predictor: &mut impl PredictionErrors,
        starts: Vec<Vec<f64>>,
    ) -> Result<Option<Vec<f64>>, Error> {
        let costs = starts.into_iter().filter_map(|start| Some((best_free(predictor, &start).ok()?, start)));
        let mut starts: Vec<(f64, Vec<f64>)> = costs.collect();
        for (kept, iterations) in ROUNDS {
            starts.sort_by(|(one, _), (other, _)| one.total_cmp(other));
            starts.dedup_by(|(later, _), (first, _)| *later - *first <= SAME_COST * *first);
            starts.truncate(kept);
            let search = Search { max_iterations: iterations, tolerance: TOLERANCE, ..Search::default() };
            for (cost, start) in &mut starts {
                let Ok(found) = self.search_with(predictor, start, &search)? else { continue };
                (*cost, *start) = (found.cost(), found.parameters);
            }
        }
        let best = starts.into_iter().min_by(|(one, _), (other, _)| one.total_cmp(other));
        Ok(best.map(|(_, parameters)| parameters))
    }
}

/// Segments of a longer record: enough to see where searches lead.
pub(super) fn thinned(record: &Record<'_>) -> Option<Packed> {
    let few = if is_long(record) { thinned_to(record, SEGMENTS, LONG / SEGMENTS) } else { None };
    few.map(|record| Packed::of(&record))
}

pub(super) fn is_long(record: &Record<'_>) -> bool {
    record.segments.iter().map(Range::len).sum::<usize>() > LONG
}

/// Recipes are for models without A of which the plant is nearly that of the top, with all of its noise or none; for
/// those with its plant; and for the smallest.
fn has_recipes(at: &Levels, top: &Levels, bottom: &Levels) -> bool {
    let plant = at[1] == top[1] && at[4] == top[4];
    let close = at[1] + 1 >= top[1] && at[4] + 2 >= top[4];
    let noise = at[2..4] == top[2..4] || at[2..4] == [0, 0];
    at == bottom || at[0] == 0 && (plant || close && noise)
}

fn levels(orders: &Orders) -> Levels {
    let most = |orders: &[usize]| orders.iter().copied().max().unwrap_or(0);
    [orders.na, most(&orders.nb), orders.nc, orders.nd, most(&orders.nf)]
}

/// The lowest levels: B and F keep a coefficient, and there are not too many models above them.
fn bottom(top: &Levels) -> Levels {
    let least = [0, 1, 0, 0, 1];
    let depth = |depth: usize| -> Levels {
        std::array::from_fn(|k| top[k].saturating_sub(depth).max(least[k].min(top[k])))
    };
    let deepest = top.iter().copied().max().unwrap_or(0);
    (0..=deepest).rev().map(depth).find(|bottom| count(top, bottom) <= MOST_MODELS).unwrap_or(*top)
}

/// The next levels, the last one counted up first.
fn following(at: &Levels, bottom: &Levels, top: &Levels) -> Option<Levels> {
    let mut next = *at;
    for k in (0..next.len()).rev() {
        if next[k] < top[k] {
            next[k] += 1;
            return Some(next);
        }
        next[k] = bottom[k];
    }
    None
}

/// Whether the models below one are so few that a search of each costs little.
pub(super) fn are_few(record: &Record<'_>, orders: &Orders) -> bool {
    let top = levels(orders);
    !is_long(record) && count(&top, &bottom(&top)) <= FEW_MODELS
}

/// The models of a lattice.
fn count(top: &Levels, bottom: &Levels) -> usize {
    top.iter().zip(bottom).map(|(top, bottom)| top - bottom + 1).product()
}

/// The levels with one coefficient fewer.
fn smaller(at: &Levels) -> impl Iterator<Item = Levels> {
    let at = *at;
    (0..at.len()).filter(move |&k| at[k] > 0).map(move |k| {
        let mut less = at;
        less[k] -= 1;
        less
    })
}

/// The orders at some levels below the top. A B or F that is there keeps a coefficient.
fn lowered(orders: &Orders, top: &Levels, at: &Levels) -> Orders {
    let less = |orders: &[usize], k: usize| {
        orders.iter().map(|&order| order.saturating_sub(top[k] - at[k]).max(order.min(1))).collect()
    };
    Orders {
        na: at[0],
        nb: less(&orders.nb, 1),
        nc: at[2],
        nd: at[3],
        nf: less(&orders.nf, 4),
        nk: orders.nk.clone(),
    }
}
