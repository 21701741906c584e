//! Problems that are kept as plain numbers, and put together again: what a window of rows is made of.

use nalgebra::OVector;

use super::{LeastSquares, copy_values};
use crate::triangle::{Sum, least_remainder, row, solve, solve_transposed};
use crate::ud::copy;
use crate::{Dimension, Real};

/// How many numbers [`LeastSquares::pack`] writes: the triangle [R z; 0 ρ].
pub(crate) const fn packed_numbers(parameters: usize) -> usize {
    parameters.saturating_add(1).saturating_mul(parameters.saturating_add(2)) / 2
}

impl<T: Real, N: Dimension> LeastSquares<T, N> {
    /// Forgets all rows.
    pub(crate) fn clear(&mut self) {
        self.factor_rows.fill(Sum::new(T::zero()));
        self.rotated_output.fill(Sum::new(T::zero()));
        self.residual_norm = Sum::new(T::zero());
        (self.rows, self.uncompensated_rows) = (0, 0);
    }

    /// Takes over the rows of another problem of this size.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        copy(other.factor_rows.as_slice(), self.factor_rows.as_mut_slice());
        copy(other.rotated_output.as_slice(), self.rotated_output.as_mut_slice());
        self.residual_norm = other.residual_norm;
        (self.rows, self.uncompensated_rows) = (other.rows, other.uncompensated_rows);
    }

    /// Writes [R z; 0 ρ], row after row from the diagonal on, without what rounding took.
    pub(crate) fn pack(&self, mut into: &mut [T]) {
        let size = self.size().value();
        for (index, output) in self.rotated_output.as_slice().iter().enumerate() {
            let entries = into.split_off_mut(..size - index).unwrap_or_default();
            copy_values(row(self.factor_rows.as_slice(), size, index), entries);
            if let Some(place) = into.split_off_first_mut() {
                *place = output.value;
            }
        }
        if let Some(place) = into.first_mut() {
            *place = self.residual_norm.value;
        }
    }

    /// Merges what [`pack`](LeastSquares::pack) has written of so many rows.
    pub(crate) fn merge_packed(&mut self, mut packed: &[T], rows: usize) {
        let residual_norm = packed.last().copied().unwrap_or(T::zero());
        self.fold_factor(residual_norm, |index, row| {
            let row = row.get_mut(index..).unwrap_or_default();
            copy(packed.split_off(..row.len()).unwrap_or_default(), row);
            packed.split_off_first().copied().unwrap_or(T::zero())
        });
        self.rows = self.rows.saturating_add(rows);
    }

    /// Whether what is left of each column, once those before it are projected out, is more than this share of its
    /// norm.
    pub(crate) fn is_determined(&self, share: T) -> bool {
        let size = self.size().value();
        self.rows >= size && least_remainder(self.factor_rows.as_slice(), size) > share
    }

    /// Writes R⁻¹ z; returns whether that is finite. n²/2 multiply-adds, n divisions.
    pub(crate) fn solve_into(&self, parameters: &mut [T]) -> bool {
        copy_values(self.rotated_output.as_slice(), parameters);
        solve(self.factor_rows.as_slice(), parameters);
        parameters.iter().all(T::is_finite)
    }

    /// φ'(R'R)⁻¹φ = ‖R'⁻¹φ‖²; `work` has room for φ.
    pub(crate) fn leverage(&self, regressor: &[T], work: &mut [T]) -> T {
        copy(regressor, work);
        solve_transposed(self.factor_rows.as_slice(), work);
        work.iter().fold(T::zero(), |sum, &entry| sum + entry * entry)
    }

    /// Adds a row that is checked, where the count of rows has room for it.
    pub(crate) fn add_checked(&mut self, regressor: &OVector<T, N>, output: T) {
        self.fold(regressor, output);
        self.rows = self.rows.saturating_add(1);
    }

    /// σ̂² = ρ²/(m - n), if there are more rows than parameters.
    pub(crate) fn residual_variance(&self) -> Option<T> {
        let freedom = self.rows.checked_sub(self.size().value()).filter(|&freedom| freedom > 0)?;
        let mean = self.residual_norm.value / T::from_count(freedom).sqrt();
        Some(mean * mean)
    }

    /// That a packed triangle is one that rows within the limit of [`add`](LeastSquares::add) can make.
    #[cfg(feature = "serde")]
    pub(crate) fn check_packed(packed: &[T], rows: usize) -> Result<(), crate::Error> {
        let limit = T::LARGEST_ENTRY * T::from_count(2) * T::from_count(rows.max(1)).sqrt();
        let fits = packed.iter().all(|entry| entry.abs() <= limit);
        fits.then_some(()).ok_or(crate::Error::TooLarge { argument: "stored" })
    }
}
