//! Random starts.

use std::f64::consts::PI;

use oorandom::Rand64;
use thetahat_core::nalgebra::{Complex, ComplexField};
use thetahat_numerics::optimize::normal_number;

use super::polynomials::Polynomials;
use crate::model::{
    Orders,
    polynomial::{product, roots},
};

/// The standard deviation of a change of a root: of the logarithms of its distance from the unit circle and of its
/// angle.
const SPREAD: f64 = 0.7;
/// Of a new root: its least distance from the unit circle, and its least angle.
const NEAREST: f64 = 1e-3;
const SMALLEST_ANGLE: f64 = 1e-3 * PI;

/// This many parameter vectors, with C, D and every F drawn at random, A and B as they are in `best`. The same seed
/// gives the same ones.
///
/// C, D and F are drawn by their roots: every second vector has all of them moved from where they are in `best`, by
/// factors on the distance 1 - |z| from the unit circle and on the angle; the others have new ones, these two numbers
/// being uniform on a logarithmic scale, as the time constants and frequencies of plants are. A and B, which are linear
/// once C, D and F are given, are left to [`best_linear`](thetahat_numerics::optimize::best_linear).
pub(super) fn restarts(
    orders: &Orders,
    best: &[f64],
    seed: u64,
    count: usize,
) -> impl Iterator<Item = Vec<f64>> {
    let mut random = Rand64::new(u128::from(seed));
    (0..count).map(move |number| {
        let mut polynomials = Polynomials::new(orders, best);
        let Polynomials { c, d, f, .. } = &mut polynomials;
        for monic in [c, d].into_iter().chain(f) {
            let known = if number % 2 == 0 { roots(monic) } else { None };
            *monic = match known {
                Some(known) => near(&known, monic.len(), &mut random),
                None => anywhere(monic.len() - 1, &mut random),
            };
        }
        polynomials.parameters()
    })
}

/// A monic polynomial with roots near some others. Of a conjugate pair the one in the upper half plane is given.
fn near(roots: &[Complex<f64>], length: usize, random: &mut Rand64) -> Vec<f64> {
    let upper = roots.iter().filter(|root| root.im >= 0.0);
    let mut monic = upper.fold(vec![1.0], |monic, root| {
        let distance =
            ((1.0 - root.modulus()).max(NEAREST) * (SPREAD * normal_number(random)).exp()).min(1.0);
        let factor = (SPREAD * normal_number(random)).exp();
        let from_one = root.im == 0.0 && root.re < 0.0;
        match root.im {
            0.0 if from_one => product(&monic, &[1.0, 1.0 - distance]),
            0.0 => product(&monic, &[1.0, distance - 1.0]),
            _ => product(&monic, &pair(1.0 - distance, (root.im.atan2(root.re) * factor).min(PI))),
        }
    });
    // Roots at the origin that the degree does not show.
    monic.resize(length, 0.0);
    monic
}

/// A stable monic polynomial: conjugate pairs, and two real roots in a quarter of their places.
fn anywhere(order: usize, random: &mut Rand64) -> Vec<f64> {
    let mut logarithmic = |least: f64, most: f64| least * (most / least).powf(random.rand_float());
    let mut monic = vec![1.0];
    while monic.len() <= order {
        let left = order + 1 - monic.len();
        let distance = logarithmic(NEAREST, 1.0);
        let angle = logarithmic(SMALLEST_ANGLE, 4.0 * PI);
        let next = if left > 1 && angle <= PI {
            pair(1.0 - distance, angle)
        } else {
            vec![1.0, if angle <= 3.5 * PI { distance - 1.0 } else { 1.0 - distance }]
        };
        monic = product(&monic, &next);
    }
    monic
}

/// (1 - z q^-1)(1 - z* q^-1) for z of this modulus and angle.
fn pair(modulus: f64, angle: f64) -> Vec<f64> {
    vec![1.0, -2.0 * modulus * angle.cos(), modulus * modulus]
}

#[cfg(test)]
mod tests;
