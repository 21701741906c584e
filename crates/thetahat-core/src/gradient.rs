//! Gradients of predictions: regressors that go through 1/C(q), for polynomials C that change from sample to sample,
//! and stay stable.

use core::ops::{Range, RangeInclusive};

use nalgebra::{Const, OVector};

use crate::rls::is_small;
use crate::stability::is_stable;
use crate::triangle::{column, column_mut};
use crate::ud::{add_multiple, copy};
use crate::{Dimension, Error, Real, RecursiveLeastSquares};

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

/// That the polynomial of these parameters is stable; `range` says of which polynomial.
pub(crate) fn check_stable<T: Real, N: Dimension>(
    parameters: &OVector<T, N>,
    polynomial: Range<usize>,
    range: &'static str,
) -> Result<(), Error> {
    let mut work = parameters.clone();
    let stable = is_stable(work.as_mut_slice().get_mut(polynomial).unwrap_or_default());
    stable.then_some(()).ok_or(Error::OutOfRange { argument: "parameters", range })
}

/// Takes the parameters back to their limits, as [`RecursiveLeastSquares::project`], so that their polynomial stays
/// stable: where the nearest point has no stable one, each parameter is cut off by itself, and the polynomial stays as
/// it was if that does not help. `before` and `work` have the size of the parameters.
pub(crate) fn keep_within<T: Real, N: Dimension + Dimension<Const<1>>>(
    estimator: &mut RecursiveLeastSquares<T, N>,
    limits: &[RangeInclusive<T>],
    polynomial: Range<usize>,
    before: &mut [T],
    work: &mut [T],
) -> bool {
    copy(estimator.parameters().as_slice(), before);
    let work = work.get_mut(..polynomial.len()).unwrap_or_default();
    let mut is_stable_now = |estimator: &RecursiveLeastSquares<T, N>| {
        copy(estimator.parameters().as_slice().get(polynomial.clone()).unwrap_or_default(), work);
        is_stable(work)
    };
    let out = estimator.project(limits);
    if out && !is_stable_now(estimator) {
        estimator.put_parameters(before);
        estimator.cut_off(limits);
        if !is_stable_now(estimator) {
            for (index, parameter) in estimator.parameters().as_slice().iter().enumerate() {
                if let Some(before) = before.get_mut(index).filter(|_| !polynomial.contains(&index)) {
                    *before = *parameter;
                }
            }
            estimator.put_parameters(before);
        }
    }
    out
}
