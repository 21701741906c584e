//! What the residuals tell of the noise.

use nalgebra::OVector;

use crate::{Dimension, Real};

/// What the residuals tell of the noise: their weighted mean squares, and the sums of the weights.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub(super) struct Residuals<T: Real, M: Dimension> {
    /// v.
    #[cfg_attr(feature = "serde", serde(with = "crate::snapshot::vector"))]
    pub(super) mean_squares: OVector<T, M>,
    /// W.
    pub(super) weights: T,
    /// W₂.
    pub(super) squared_weights: T,
}

impl<T: Real, M: Dimension> Residuals<T, M> {
    pub(super) fn new(outputs: M) -> Self {
        let mean_squares = outputs.vector(T::zero());
        Residuals { mean_squares, weights: T::zero(), squared_weights: T::zero() }
    }

    /// Forgets them.
    pub(super) fn clear(&mut self) {
        self.mean_squares.fill(T::zero());
        (self.weights, self.squared_weights) = (T::zero(), T::zero());
    }

    /// Counts the innovations of a sample; `share` is 1/(1 + φ'P⁻φ), and earlier samples lose weight by `factor`.
    #[inline(always)]
    pub(super) fn count(&mut self, errors: &[T], share: T, factor: T) {
        self.weights = factor * self.weights + T::one();
        self.squared_weights = factor * factor * self.squared_weights + T::one();
        for (mean, &error) in self.mean_squares.as_mut_slice().iter_mut().zip(errors) {
            *mean += (error * share * error - *mean) / self.weights;
        }
    }

    /// σ̂² of one output, if it is known.
    pub(super) fn variance(&self, output: usize, size: usize) -> Option<T> {
        self.variance_of(*self.mean_squares.as_slice().get(output)?, size)
    }

    /// σ̂² that a mean square makes, now.
    #[inline(always)]
    pub(super) fn variance_of(&self, mean_square: T, size: usize) -> Option<T> {
        let square = self.weights * self.weights;
        let freedom = square - T::from_count(size) * self.squared_weights;
        (freedom > T::zero()).then(|| mean_square * square / freedom)
    }

    /// Writes the variances of the innovations, and returns Σ e²/S. What is not known is NaN, and counts 0.
    #[inline(always)]
    pub(super) fn normalise(&self, errors: &[T], variances: &mut [T], size: usize, relative: T) -> T {
        let mut nis = T::zero();
        for (index, (variance, &error)) in variances.iter_mut().zip(errors).enumerate() {
            let found = self.variance(index, size).map_or(T::NAN, |noise| noise * relative);
            if found >= T::MIN_POSITIVE && found.is_finite() {
                *variance = found;
                nis += error / found * error;
            }
        }
        // Without noise a sum of these could overflow.
        if nis < T::LARGEST_ENTRY { nis } else { T::LARGEST_ENTRY }
    }
}
