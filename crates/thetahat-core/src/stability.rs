//! Whether polynomials are stable.

use crate::Real;

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
