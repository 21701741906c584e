//! Monomials of variables, and their Gram matrix from moments.
//!
//! The product of two monomials of degree d at most is one of degree 2 d at most, so that the Gram matrix of M
//! monomials of n variables holds C(n + 2 d, 2 d) different numbers, and no matrix of regressors is needed. With x_0 =
//! 1 a monomial is a tuple i_1 <= … <= i_d of indices, 0 where there is no further factor. A moment is a tuple of 2 d
//! such indices; it is the product of its first half, whose last index is c, and of its second half, whose first index
//! is not below c:
//!
//! ```text
//! moments with i_d = c:   sum_t A_c(t) B_c(t)',   A_c the monomials that end with c, B_c those that begin with c or later
//! ```
//!
//! These are products of dense matrices, a tile for each c. Cost for N rows: 2 N C(n + 2 d, 2 d) flops.

use std::collections::HashMap;

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};
use rayon::prelude::*;

use crate::Error;

/// Rows of which the monomials are in memory at once.
const ROWS: usize = 512;
/// A higher degree was mistyped.
const MOST_FACTORS: usize = 12;
/// Moments at most: 512 MB.
const MOST_MOMENTS: usize = 64_000_000;

/// All monomials of some variables up to a degree, the constant first.
#[derive(Debug, Clone)]
pub struct Monomials {
    variables: usize,
    degree: usize,
    /// Indices as above, in lexicographic order.
    tuples: Vec<Vec<u16>>,
    /// The place of each tuple.
    places: HashMap<Vec<u16>, usize>,
    /// For each tuple the tile that it is in as a first half, and its row there.
    rows: Vec<(usize, usize)>,
    /// For each tile the monomials of its rows, and the first monomial of its columns, which end with the last
    /// monomial.
    tiles: Vec<(Vec<usize>, usize)>,
}

impl Monomials {
    /// # Errors
    /// [`Error::Argument`] if there is nothing to multiply, or there are too many products.
    pub fn new(variables: usize, degree: usize) -> Result<Self, Error> {
        if degree == 0 {
            return Err(Error::argument("degree", "a polynomial of degree 0 is a constant; give 1 or more"));
        }
        if degree > MOST_FACTORS {
            return Err(Error::argument(
                "degree",
                format!("{degree} is above {MOST_FACTORS}, the highest degree"),
            ));
        }
        let moments = combinations(variables + 2 * degree, 2 * degree);
        if moments.is_none_or(|moments| moments > MOST_MOMENTS) || variables >= usize::from(u16::MAX) {
            return Err(Error::argument(
                "degree",
                format!(
                    "polynomials of degree {degree} of {variables} regressors have too many terms to choose from; give a lower \
                     degree or fewer lags"
                ),
            ));
        }
        let mut tuples = vec![Vec::new()];
        for _ in 0..degree {
            tuples = tuples
                .into_iter()
                .flat_map(|tuple: Vec<u16>| {
                    let first = tuple.last().copied().unwrap_or(0);
                    (first..=variables as u16).map(move |next| [&tuple[..], &[next]].concat())
                })
                .collect();
        }
        let mut tiles: Vec<(Vec<usize>, usize)> = (0..=variables)
            .map(|c| (Vec::new(), tuples.partition_point(|tuple| usize::from(tuple[0]) < c)))
            .collect();
        let mut rows = Vec::with_capacity(tuples.len());
        for (place, tuple) in tuples.iter().enumerate() {
            let tile = usize::from(tuple[degree - 1]);
            rows.push((tile, tiles[tile].0.len()));
            tiles[tile].0.push(place);
        }
        let places = tuples.iter().cloned().enumerate().map(|(place, tuple)| (tuple, place)).collect();
        Ok(Self { variables, degree, tuples, places, rows, tiles })
    }

    /// How many monomials there are.
    pub fn count(&self) -> usize {
        self.tuples.len()
    }

    /// How many different numbers their Gram matrix has, and how many more stand in the tiles.
    pub fn moments(&self) -> usize {
        self.tiles.iter().map(|(rows, first)| rows.len() * (self.count() - first)).sum()
    }

    /// The variables that are multiplied, from 0 on; none for the constant.
    pub fn factors(&self, place: usize) -> Vec<usize> {
        self.tuples[place].iter().filter(|index| **index > 0).map(|index| usize::from(*index) - 1).collect()
    }

    /// Writes the values of all monomials in some rows, a column for each; `variable` fills those of a variable.
    fn write(&self, rows: usize, variable: impl Fn(usize, &mut [f64]), values: &mut Mat<f64>) {
        let mut variables = vec![1.0; (self.variables + 1) * rows];
        for (index, values) in variables.chunks_exact_mut(rows.max(1)).enumerate().skip(1) {
            variable(index - 1, values);
        }
        // The product of all but the last factor stands in the stack, for each length.
        let mut stack = vec![1.0; self.degree * rows];
        let mut before: &[u16] = &[];
        for (place, tuple) in self.tuples.iter().enumerate() {
            let common = tuple.iter().zip(before).take_while(|(one, other)| one == other).count();
            for depth in common..self.degree {
                let factor = &variables[usize::from(tuple[depth]) * rows..][..rows];
                let (below, own) = stack.split_at_mut(depth * rows);
                for (t, product) in own[..rows].iter_mut().enumerate() {
                    let prefix = if depth == 0 { 1.0 } else { below[(depth - 1) * rows + t] };
                    *product = prefix * factor[t];
                }
            }
            let product = &stack[(self.degree - 1) * rows..];
            values.col_as_slice_mut(place)[..rows].copy_from_slice(&product[..rows]);
            before = tuple;
        }
    }
}

/// n over k, unless it overflows.
fn combinations(n: usize, k: usize) -> Option<usize> {
    (1..=k).try_fold(1_usize, |product, i| Some(product.checked_mul(n - k + i)? / i))
}

/// Sums over rows of products of monomials, and of monomials and a target.
#[derive(Debug, Clone)]
pub struct Moments {
    tiles: Vec<Mat<f64>>,
    /// For each monomial the sum of its products with the target.
    pub cross: Vec<f64>,
    /// The sum of the target's squares.
    pub energy: f64,
    /// How many rows were summed.
    pub rows: usize,
}

impl Moments {
    /// Sums over no rows.
    pub fn zero(monomials: &Monomials) -> Self {
        let count = monomials.count();
        let tile = |(rows, first): &(Vec<usize>, usize)| Mat::zeros(rows.len(), count - first);
        Self {
            tiles: monomials.tiles.iter().map(tile).collect(),
            cross: vec![0.0; count],
            energy: 0.0,
            rows: 0,
        }
    }

    /// Adds `rows` rows; `variable` fills the values of a variable from a row on, `target` those of the target.
    pub fn add(
        &mut self,
        monomials: &Monomials,
        rows: usize,
        variable: impl Fn(usize, usize, &mut [f64]),
        target: impl Fn(usize, &mut [f64]),
    ) {
        let mut values = Mat::zeros(ROWS.min(rows), monomials.count());
        for first in (0..rows).step_by(ROWS) {
            let some = ROWS.min(rows - first);
            monomials.write(some, |index, into| variable(index, first, into), &mut values);
            let mut y = vec![0.0; some];
            target(first, &mut y);
            self.tiles.par_iter_mut().zip(&monomials.tiles).for_each(|(sum, (rows, column))| {
                let mut left = Mat::zeros(some, rows.len());
                for (mut own, place) in left.col_iter_mut().zip(rows) {
                    own.copy_from(values.col(*place).subrows(0, some));
                }
                let right = values.as_ref().submatrix(0, *column, some, values.ncols() - column);
                matmul(sum.as_mut(), Accum::Add, left.transpose(), right, 1.0, Par::Seq);
            });
            for (sum, place) in self.cross.iter_mut().zip(0..) {
                *sum += super::product(&values.col_as_slice(place)[..some], &y);
            }
            self.energy += super::sum_of_squares(&y);
        }
        self.rows += rows;
    }

    /// Adds the sums of other rows.
    pub fn merge(&mut self, other: &Self) {
        for (sum, tile) in self.tiles.iter_mut().zip(&other.tiles) {
            *sum += tile;
        }
        self.cross.iter_mut().zip(&other.cross).for_each(|(sum, value)| *sum += value);
        self.energy += other.energy;
        self.rows += other.rows;
    }

    /// An entry of the Gram matrix of the monomials.
    pub fn gram(&self, monomials: &Monomials, one: usize, other: usize) -> f64 {
        let degree = monomials.degree;
        let mut both = [0; 2 * MOST_FACTORS];
        let both = &mut both[..2 * degree];
        both[..degree].copy_from_slice(&monomials.tuples[one]);
        both[degree..].copy_from_slice(&monomials.tuples[other]);
        both.sort_unstable();
        let (first, second) = both.split_at(degree);
        let place = |half: &[u16]| monomials.places.get(half).copied();
        let (Some(first), Some(second)) = (place(first), place(second)) else { return f64::NAN };
        let (tile, row) = monomials.rows[first];
        self.tiles[tile][(row, second - monomials.tiles[tile].1)]
    }

    /// Whether all sums are numbers.
    pub fn is_finite(&self) -> bool {
        let finite =
            |tile: &Mat<f64>| tile.col_iter().all(|column| column.iter().all(|value| value.is_finite()));
        self.energy.is_finite()
            && self.cross.iter().all(|value| value.is_finite())
            && self.tiles.iter().all(finite)
    }
}

#[cfg(test)]
mod tests;
