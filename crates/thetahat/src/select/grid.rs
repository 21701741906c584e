//! The models of a grid of orders.

use std::collections::BTreeSet;

use super::{Grid, OrderRange, Path};
use crate::Error;
use crate::model::Orders;

/// More models than that were not meant.
const MOST_MODELS: usize = 100_000;

/// Indices of the turns: na, nb of each range, nc, nd, nf of each range.
type Place = Vec<usize>;

impl Grid {
    /// The models for this many inputs, the smallest first, each once.
    ///
    /// Combinations that are no model are left out: no coefficient at all, or F without B. An input without B has the
    /// first of its delays.
    ///
    /// # Errors
    /// [`Error::Argument`] if there is not one range of nb, nf and nk for all inputs or for each of them, if there are
    /// more than 100,000 models, or none.
    pub fn orders(&self, inputs: usize) -> Result<Vec<Orders>, Error> {
        let nk = each("nk", &self.nk, inputs)?;
        for (name, ranges) in [("nb", &self.nb), ("nf", &self.nf)] {
            each(name, ranges, inputs)?;
        }
        let ranges = self.turns(inputs);
        // Of all orders the highest is checked, before they are counted.
        let highest = ranges.iter().chain(&nk).map(OrderRange::last).max().unwrap_or(0);
        Orders::arx(highest.max(1), &[], &[])?;
        let places = self.places(&ranges, &nk)?;
        let mut delays: Vec<Vec<usize>> = vec![Vec::new()];
        for range in &nk {
            let longer = |delays: &Vec<usize>| {
                let all = (range.first()..=range.last()).map(|nk| [&delays[..], &[nk]].concat());
                all.collect::<Vec<_>>()
            };
            delays = delays.iter().flat_map(longer).collect();
        }
        // Only inputs that may have no B make the same model twice.
        let twice = delays.len() > 1 && self.nb.iter().any(|range| range.first() == 0);
        let mut models = Vec::new();
        let mut seen = BTreeSet::new();
        for delays in &delays {
            for place in &places {
                let Some(orders) = self.at(place, delays, &nk) else { continue };
                if !twice || seen.insert(key(&orders)) {
                    models.push(orders);
                }
            }
        }
        if models.is_empty() {
            return Err(Error::argument(
                "orders",
                "no model is in these ranges: all orders are 0, or F is there without B",
            ));
        }
        // Stable: of equal size the first made stays first.
        models.sort_by_key(Orders::parameters);
        Ok(models)
    }

    /// The ranges that are walked, in the order of their turns.
    fn turns(&self, inputs: usize) -> Vec<OrderRange> {
        let of_inputs = |ranges: &[OrderRange]| if inputs == 0 { Vec::new() } else { ranges.to_vec() };
        [vec![self.na], of_inputs(&self.nb), vec![self.nc, self.nd], of_inputs(&self.nf)].concat()
    }

    /// The orders of each turn, for any delay.
    fn places(&self, ranges: &[OrderRange], nk: &[OrderRange]) -> Result<Vec<Place>, Error> {
        let width = |range: &OrderRange| range.last() - range.first() + 1;
        let product = |ranges: &[OrderRange]| {
            ranges.iter().map(width).try_fold(1_usize, |all, width| all.checked_mul(width))
        };
        let count = match self.path {
            Path::All => product(ranges),
            Path::Alternate => Some(ranges.iter().map(|range| width(range) - 1).sum::<usize>() + 1),
        };
        let models = product(nk).and_then(|delays| count?.checked_mul(delays));
        let many = || match models {
            Some(models) => format!("{models} models"),
            None => "too many models to count".to_owned(),
        };
        if models.is_none_or(|models| models > MOST_MODELS) {
            return Err(Error::argument(
                "orders",
                format!(
                    "the ranges make {}, and {MOST_MODELS} are the most that are compared; narrow them, or walk the \
                     alternate path",
                    many()
                ),
            ));
        }
        let first: Place = ranges.iter().map(OrderRange::first).collect();
        let mut places = vec![first.clone()];
        match self.path {
            Path::All => {
                for (turn, range) in ranges.iter().enumerate() {
                    let more = (range.first() + 1..=range.last()).flat_map(|order| {
                        places.iter().map(move |place| {
                            let mut place = place.clone();
                            place[turn] = order;
                            place
                        })
                    });
                    let more: Vec<Place> = more.collect();
                    places.extend(more);
                }
            }
            Path::Alternate => {
                let mut place = first;
                while place.iter().zip(ranges).any(|(order, range)| *order < range.last()) {
                    for turn in 0..ranges.len() {
                        if place[turn] < ranges[turn].last() {
                            place[turn] += 1;
                            places.push(place.clone());
                        }
                    }
                }
            }
        }
        Ok(places)
    }

    /// The model of a place; none where it is no model.
    fn at(&self, place: &Place, delays: &[usize], nk: &[OrderRange]) -> Option<Orders> {
        let inputs = delays.len();
        let (na, rest) = (place[0], &place[1..]);
        let of_inputs = |ranges: &[OrderRange], orders: &[usize]| match (inputs, ranges) {
            (0, _) => Vec::new(),
            (_, [_]) => vec![orders[0]; inputs],
            _ => orders.to_vec(),
        };
        let ranges = if inputs == 0 { 0 } else { self.nb.len() };
        let nb = of_inputs(&self.nb, &rest[..ranges]);
        let (nc, nd) = (rest[ranges], rest[ranges + 1]);
        let nf = of_inputs(&self.nf, &rest[ranges + 2..]);
        let filtered_nothing = nb.iter().zip(&nf).any(|(&nb, &nf)| nb == 0 && nf > 0);
        if filtered_nothing || na + nc + nd + nb.iter().sum::<usize>() == 0 {
            return None;
        }
        let used = nb.iter().zip(delays.iter().zip(nk));
        let nk: Vec<usize> =
            used.map(|(&nb, (&own, range))| if nb > 0 { own } else { range.first() }).collect();
        Some(Orders { na, nb, nc, nd, nf, nk })
    }
}

/// The range of each input.
fn each(name: &str, ranges: &[OrderRange], inputs: usize) -> Result<Vec<OrderRange>, Error> {
    match ranges {
        [one] => Ok(vec![*one; inputs]),
        _ if ranges.len() == inputs => Ok(ranges.to_vec()),
        _ => Err(Error::argument(
            name,
            format!(
                "there are {} values for {inputs} inputs; give one for each, or one for all",
                ranges.len()
            ),
        )),
    }
}

/// What tells models apart, in the order of na, nb, nc, nd, nf, nk.
pub(super) fn key(orders: &Orders) -> Vec<usize> {
    let Orders { na, nb, nc, nd, nf, nk } = orders;
    [&[*na], &nb[..], &[*nc, *nd], nf, nk].concat()
}
