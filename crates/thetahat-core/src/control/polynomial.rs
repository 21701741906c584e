//! Coefficients of polynomials in q⁻¹, and of their products.

use crate::Real;

/// A coefficient, 0 beyond the last.
pub(super) fn at<T: Real>(values: &[T], power: usize) -> T {
    values.get(power).copied().unwrap_or(T::zero())
}

/// A coefficient of the product of two polynomials.
pub(super) fn product<T: Real>(first: &[T], second: &[T], power: usize) -> T {
    let each = first.iter().enumerate().take(power + 1);
    each.fold(T::zero(), |sum, (place, value)| sum + *value * at(second, power - place))
}
