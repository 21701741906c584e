//! Random starts near a given one.

use oorandom::Rand64;

use super::predictor::Polynomials;
use crate::Orders;

/// The spread of random starts: of reflection coefficients on the scale of atanh, and of other coefficients in their own
/// sizes.
const SPREAD: f64 = 0.7;

/// So many parameter vectors around `best`, C and F stable. The same seed gives the same ones.
///
/// C and F vary in their reflection coefficients k, atanh k being shifted at random: every stable polynomial can come, and
/// no other.
pub(super) fn restarts<'a>(
    orders: &'a Orders,
    best: &'a [f64],
    seed: u64,
    count: usize,
) -> impl Iterator<Item = Vec<f64>> + 'a {
    let mut random = Rand64::new(u128::from(seed));
    (0..count).map(move |_| {
        let mut polynomials = Polynomials::new(orders, best);
        let mut normal = || (0..12).map(|_| random.rand_float()).sum::<f64>() - 6.0;
        let scale = |value: &mut f64, normal: &mut dyn FnMut() -> f64| *value *= 1.0 + SPREAD * normal();
        polynomials.a[1..]
            .iter_mut()
            .chain(&mut polynomials.d[1..])
            .for_each(|value| scale(value, &mut normal));
        polynomials.b.iter_mut().flatten().for_each(|value| scale(value, &mut normal));
        for monic in std::iter::once(&mut polynomials.c).chain(&mut polynomials.f) {
            let mut reflections = step_down(monic);
            reflections
                .iter_mut()
                .for_each(|k| *k = (k.atanh() + SPREAD * normal()).tanh().clamp(-0.9999, 0.9999));
            *monic = step_up(&reflections);
        }
        polynomials.parameters()
    })
}

/// The reflection coefficients k_1 … k_n of a stable monic polynomial (Kay, Modern Spectral Estimation, 1988, section 6.3).
fn step_down(monic: &[f64]) -> Vec<f64> {
    let mut polynomial = monic[1..].to_vec();
    let mut reflections = vec![0.0; polynomial.len()];
    while let Some(last) = polynomial.pop() {
        reflections[polynomial.len()] = last;
        let reversed: Vec<f64> = polynomial.iter().rev().copied().collect();
        for (value, other) in polynomial.iter_mut().zip(reversed) {
            *value = (*value - last * other) / (1.0 - last * last);
        }
    }
    reflections
}

/// The monic polynomial of reflection coefficients.
fn step_up(reflections: &[f64]) -> Vec<f64> {
    let mut polynomial: Vec<f64> = Vec::new();
    for &k in reflections {
        let reversed: Vec<f64> = polynomial.iter().rev().copied().collect();
        polynomial.iter_mut().zip(reversed).for_each(|(value, other)| *value += k * other);
        polynomial.push(k);
    }
    std::iter::once(1.0).chain(polynomial).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::polynomial::is_stable;

    #[test]
    fn steps_down_and_up_are_inverse() {
        let monic = [1.0, -1.6, 0.9, -0.1];
        let back = step_up(&step_down(&monic));
        assert!(monic.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-14));
    }

    #[test]
    fn random_starts_are_stable_differ_and_come_again() {
        let orders = Orders::bj(&[2], 1, 2, &[2], &[1]).unwrap();
        let best = [1.0, 0.5, 0.3, -1.2, 0.6, -1.9, 0.95];
        let starts: Vec<Vec<f64>> = restarts(&orders, &best, 7, 50).collect();
        assert_eq!(starts, restarts(&orders, &best, 7, 50).collect::<Vec<_>>());
        assert!(starts.windows(2).all(|pair| pair[0] != pair[1]));
        for start in starts {
            let polynomials = Polynomials::new(&orders, &start);
            assert!(
                is_stable(&polynomials.f[0], &mut Vec::new()) && is_stable(&polynomials.c, &mut Vec::new())
            );
        }
    }
}
