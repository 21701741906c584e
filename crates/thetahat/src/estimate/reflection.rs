//! Stable monic polynomials in coordinates without a boundary: z_i = artanh k_i of their reflection coefficients k_i.
//!
//! ```text
//! a_m(j) = a_(m-1)(j) + k_m a_(m-1)(m - j),   a_m(m) = k_m
//! ```
//!
//! |k_i| < 1 for all i if and only if all roots are inside the unit circle (Schur 1917; Levinson 1947; Kay, Modern
//! Spectral Estimation, 1988, section 6.3). In coefficients the region of stability has a curved boundary, at which a
//! search stops; here it is all of space.

/// The coordinates of the polynomial with these coefficients after the leading one; false if a root is not inside the
/// unit circle.
pub(super) fn coordinates(coefficients: &[f64], into: &mut [f64]) -> bool {
    into.copy_from_slice(coefficients);
    for order in (0..into.len()).rev() {
        let (rest, last) = into.split_at_mut(order);
        let reflection = last[0];
        let left = 1.0 - reflection * reflection;
        if left.is_nan() || left <= 0.0 {
            return false;
        }
        for low in 0..order.div_ceil(2) {
            let high = order - 1 - low;
            let (a, b) = (rest[low], rest[high]);
            rest[low] = (a - reflection * b) / left;
            rest[high] = (b - reflection * a) / left;
        }
        last[0] = reflection.atanh();
    }
    true
}

/// The coefficients at these coordinates, and a row of their derivatives for each, `stride` numbers apart. O(n³) with
/// these.
pub(super) fn coefficients(coordinates: &[f64], into: &mut [f64], slopes: Option<(&mut [f64], usize)>) {
    let mut slopes = slopes;
    for (order, coordinate) in coordinates.iter().enumerate() {
        let reflection = coordinate.tanh();
        if let Some((slopes, stride)) = &mut slopes {
            // Of the coefficients before with respect to the coordinates before, then all with respect to this one.
            for earlier in 0..order {
                for low in 0..order.div_ceil(2) {
                    let high = order - 1 - low;
                    let (one, other) = (low * *stride + earlier, high * *stride + earlier);
                    let (a, b) = (slopes[one], slopes[other]);
                    slopes[one] = a + reflection * b;
                    slopes[other] = b + reflection * a;
                }
                slopes[order * *stride + earlier] = 0.0;
            }
            // 1 - tanh², as exact near the boundary.
            let steepness = coordinate.cosh().powi(-2);
            for row in 0..order {
                slopes[row * *stride + order] = into[order - 1 - row] * steepness;
            }
            slopes[order * *stride + order] = steepness;
        }
        for low in 0..order.div_ceil(2) {
            let high = order - 1 - low;
            let (a, b) = (into[low], into[high]);
            into[low] = a + reflection * b;
            into[high] = b + reflection * a;
        }
        into[order] = reflection;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_are_each_others_inverse_and_have_these_derivatives() {
        for roots in
            [vec![0.9], vec![0.99, -0.5], vec![0.999, 0.99, 0.9, -0.8], vec![0.3, 0.2, -0.1, 0.5, 0.95]]
        {
            let mut monic = vec![1.0];
            for root in &roots {
                monic.push(0.0);
                for k in (1..monic.len()).rev() {
                    monic[k] -= root * monic[k - 1];
                }
            }
            let size = roots.len();
            let (mut z, mut back) = (vec![0.0; size], vec![0.0; size]);
            assert!(coordinates(&monic[1..], &mut z));
            // Rows of a larger matrix.
            let stride = size + 2;
            let mut slopes = vec![7.0; size * stride];
            coefficients(&z, &mut back, Some((&mut slopes, stride)));
            for (found, truth) in back.iter().zip(&monic[1..]) {
                assert!((found - truth).abs() < 1e-11, "{roots:?}: {back:?}");
            }
            for place in 0..size {
                let at = |change: f64| {
                    let (mut moved, mut found) = (z.clone(), vec![0.0; size]);
                    moved[place] += change;
                    coefficients(&moved, &mut found, None);
                    found
                };
                let (up, down) = (at(1e-5), at(-1e-5));
                for row in 0..size {
                    let slope = (up[row] - down[row]) / 2e-5;
                    assert!((slopes[row * stride + place] - slope).abs() < 1e-8, "{roots:?} {row} {place}");
                }
            }
        }
    }

    #[test]
    fn an_unstable_polynomial_has_none() {
        for monic in [vec![-1.0], vec![-2.5, 1.0], vec![f64::NAN], vec![0.0, 1.0]] {
            assert!(!coordinates(&monic, &mut vec![0.0; monic.len()]));
        }
        assert!(coordinates(&[], &mut []));
    }
}
