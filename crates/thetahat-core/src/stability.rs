//! Whether polynomials are stable, and steps that keep them so.

use core::ops::Range;

use crate::Real;
use crate::ud::{add_multiple, copy};

/// How often a step is halved before it is left out.
const HALVINGS: usize = 10;

/// Whether all zeros of 1 + c_1 q⁻¹ + … lie inside the radius 1 - 1/1024, by the Schur-Cohn recursion on c_i/radiusⁱ.
/// Uses up `c`. nc²/2 multiply-adds.
///
/// ```text
/// k = c_m,   |k| < 1,   c_i <- (c_i - k c_(m-i))/(1 - k²)           m = nc … 1
/// ```
pub(crate) fn is_stable<T: Real>(mut c: &mut [T]) -> bool {
    let growth = T::from_count(1024) / T::from_count(1023);
    c.iter_mut().fold(growth, |power, c| {
        *c *= power;
        power * growth
    });
    while let [lower @ .., k] = c {
        let k = *k;
        let rest = T::one() - k * k;
        if !(rest > T::zero() && rest.is_finite()) {
            return false;
        }
        let mut ends = lower.iter_mut();
        while let Some(first) = ends.next() {
            match ends.next_back() {
                Some(last) => (*first, *last) = ((*first - k * *last) / rest, (*last - k * *first) / rest),
                None => *first /= T::one() + k,
            }
        }
        c = lower;
    }
    true
}

/// Adds `step` times `direction` to the parameters, or half of it, a quarter, …, so that the polynomial among them
/// stays stable; nothing if that does not help. `work` has at least the size of the polynomial. Returns whether the
/// step was shortened.
#[inline(always)]
pub(crate) fn move_stably<T: Real>(
    parameters: &mut [T],
    direction: &[T],
    mut step: T,
    polynomial: Range<usize>,
    work: &mut [T],
) -> bool {
    let work = work.get_mut(..polynomial.len()).unwrap_or_default();
    for halvings in 0..=HALVINGS {
        copy(parameters.get(polynomial.clone()).unwrap_or_default(), work);
        add_multiple(work, step, direction.get(polynomial.clone()).unwrap_or_default());
        if is_stable(work) {
            add_multiple(parameters, step, direction);
            return halvings > 0;
        }
        step /= T::from_count(2);
    }
    true
}
