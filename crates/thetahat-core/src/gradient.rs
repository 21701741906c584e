//! Gradients of predictions: regressors that go through 1/C(q), for polynomials C that change from sample to sample.

use crate::Real;
use crate::rls::is_small;
use crate::triangle::{column, column_mut};
use crate::ud::{add_multiple, copy};

/// ψ(k) = φ(k) - c_1 ψ(k-1) - … - c_nc ψ(k-nc), from past gradients in the columns of `past`. Returns false where that
/// has grown too large, as it may while C changes, although every single C is stable: then ψ is φ, and the past is to
/// be forgotten.
#[inline(always)]
pub(crate) fn filter<T: Real>(gradient: &mut [T], regressor: &[T], polynomial: &[T], past: &[T]) -> bool {
    copy(regressor, gradient);
    for (index, &coefficient) in polynomial.iter().enumerate() {
        add_multiple(gradient, -coefficient, column(past, regressor.len(), index));
    }
    let small = is_small(gradient);
    if !small {
        copy(regressor, gradient);
    }
    small
}

/// Moves each of `count` columns one place on, the new one to the front; the oldest one falls out, into `gradient`.
#[inline(always)]
pub(crate) fn push<T: Real>(past: &mut [T], gradient: &mut [T], count: usize) {
    let size = gradient.len();
    for index in 0..count {
        let column = column_mut(past, size, index);
        column.iter_mut().zip(&mut *gradient).for_each(|(past, moving)| core::mem::swap(past, moving));
    }
}
