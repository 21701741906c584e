//! Sums of products of monomials, which can be moved to other centres afterwards.
//!
//! A product of deviations is a sum of products of the signals,
//!
//! ```text
//! prod_i (x_i - m_i) = sum over the sets A of its factors  prod_{i in A} x_i  prod_{i not in A} (-m_i),
//! ```
//!
//! so that the columns of some monomials and of all their divisors, one among them, are combinations T of those about
//! another centre, and their sums S <- T S T'. Sums that were made about the mean of a part of the data keep their
//! digits, and are moved to that of all.

use std::collections::{BTreeMap, BTreeSet};

use faer::fx128;
use rayon::prelude::*;

use super::super::kernel::extended_product;
use super::super::total::Total;
use super::ExtendedGram;

/// Rows whose columns are in memory at once.
const ROWS: usize = 2048;
/// Columns at most: their sums are 8 MB.
const MOST_COLUMNS: usize = 1000;

/// Monomials and all their divisors, one first. Each is a list of variables that does not fall.
#[derive(Debug)]
pub struct DividedMonomials {
    /// Where each stands among the columns.
    places: BTreeMap<Vec<usize>, usize>,
    /// In the order of the columns, those after one and the target: the column without the last factor, and that
    /// factor.
    parents: Vec<(usize, usize)>,
    variables: usize,
}

impl DividedMonomials {
    /// Where y(t) stands.
    pub const TARGET: usize = 1;

    /// Of some of so many variables; none where they are too many.
    pub fn new(terms: &[Vec<usize>], variables: usize) -> Option<Self> {
        let mut all = BTreeSet::from([(0, Vec::new())]);
        let mut open: Vec<Vec<usize>> = terms.to_vec();
        while let Some(mut term) = open.pop() {
            term.sort_unstable();
            if all.insert((term.len(), term.clone())) {
                let without = |at: usize| [&term[..at], &term[at + 1..]].concat();
                open.extend((0..term.len()).map(without));
            }
            if all.len() >= MOST_COLUMNS {
                return None;
            }
        }
        let (mut places, mut parents) = (BTreeMap::new(), Vec::new());
        for (_, term) in all {
            let place = match term.split_last() {
                None => 0,
                Some((last, before)) => {
                    parents.push((*places.get(before)?, *last));
                    parents.len() + Self::TARGET
                }
            };
            places.insert(term, place);
        }
        Some(Self { places, parents, variables })
    }

    /// How many columns there are.
    pub fn size(&self) -> usize {
        self.parents.len() + 2
    }

    /// Where a monomial stands.
    pub fn place(&self, term: &[usize]) -> Option<usize> {
        let mut sorted = term.to_vec();
        sorted.sort_unstable();
        self.places.get(&sorted).copied()
    }

    /// The sums over some rows. `variable` fills the values of a variable, the target after them, from a row on. O(N
    /// M^2) for M columns.
    pub fn sums(&self, rows: usize, variable: impl Fn(usize, usize, &mut [f64])) -> ExtendedGram {
        let size = self.size();
        let mut triangle: Vec<Vec<fx128>> = (0..size).map(|row| vec![fx128::ZERO; size - row]).collect();
        let mut variables = vec![vec![0.0; ROWS.min(rows)]; self.variables];
        let mut columns = vec![vec![1.0; ROWS.min(rows)]; size];
        for first in (0..rows).step_by(ROWS) {
            let some = ROWS.min(rows - first);
            variables
                .iter_mut()
                .enumerate()
                .for_each(|(index, into)| variable(index, first, &mut into[..some]));
            variable(self.variables, first, &mut columns[Self::TARGET][..some]);
            for (place, (parent, factor)) in (Self::TARGET + 1..).zip(&self.parents) {
                let (before, own) = columns.split_at_mut(place);
                let factors = before[*parent].iter().zip(&variables[*factor]);
                own[0]
                    .iter_mut()
                    .zip(factors)
                    .take(some)
                    .for_each(|(product, (one, other))| *product = one * other);
            }
            triangle.par_iter_mut().enumerate().for_each(|(row, sums)| {
                for (sum, column) in sums.iter_mut().zip(&columns[row..]) {
                    sum.add(extended_product(&columns[row][..some], &column[..some]));
                }
            });
        }
        ExtendedGram { rows, size, entries: triangle.concat() }
    }

    /// Sums about one centre, of each variable and at the end of the target, as they are about another one.
    pub fn moved(&self, sums: &ExtendedGram, from: &[f64], to: &[f64]) -> ExtendedGram {
        // Exact.
        let less =
            |variable: usize| fx128::from_f64(from[variable]).add_accurate(fx128::from_f64(-to[variable]));
        let mut columns = vec![Vec::new(); self.size()];
        columns[Self::TARGET] = vec![(Self::TARGET, fx128::ONE), (0, less(self.variables))];
        for (term, place) in &self.places {
            let mut parts = BTreeMap::from([(Vec::new(), fx128::ONE)]);
            for factor in term {
                let mut more: BTreeMap<Vec<usize>, fx128> = BTreeMap::new();
                for (part, weight) in parts {
                    more.entry([&part[..], &[*factor]].concat()).or_insert(fx128::ZERO).add(weight);
                    if from[*factor] != to[*factor] {
                        more.entry(part).or_insert(fx128::ZERO).add(weight * less(*factor));
                    }
                }
                parts = more;
            }
            columns[*place] =
                parts.iter().filter_map(|(part, weight)| Some((*self.places.get(part)?, *weight))).collect();
        }
        sums.combined(&columns)
    }
}

impl ExtendedGram {
    /// The sums of columns that are combinations of these: S <- T S T'.
    fn combined(&self, columns: &[Vec<(usize, fx128)>]) -> Self {
        let size = self.size;
        let sum = |parts: &[(usize, fx128)], entry: &dyn Fn(usize) -> fx128| {
            parts.iter().fold(fx128::ZERO, |sum, (place, weight)| sum.add_accurate(*weight * entry(*place)))
        };
        let left: Vec<fx128> = (columns.iter())
            .flat_map(|parts| (0..size).map(move |column| sum(parts, &|place| self.entry(place, column))))
            .collect();
        let entry = |row: usize, column: usize| sum(&columns[column], &|place| left[row * size + place]);
        let entries = (0..size).flat_map(|row| (row..size).map(move |column| (row, column)));
        Self { entries: entries.map(|(row, column)| entry(row, column)).collect(), ..*self }
    }
}
