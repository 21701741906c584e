//! Steps that cross the boundary of stability.
//!
//! A step of Gauss and Newton often takes a root of C or F out of the unit circle: the data want a slower mode than
//! there is, or an unstable one. In a shorter step, or a damped one, all parameters would wait for that root, and a
//! search would crawl. So the root alone is moved back, to a fraction of the distance from the circle that there was
//! before, and A and B, which are linear once C, D and F are given, are solved for (Golub and Pereyra, SIAM J.
//! Numerical Analysis 10, 1973).

use thetahat_core::nalgebra::{Complex, ComplexField};

use super::polynomials::Polynomials;
use crate::model::{
    Orders,
    polynomial::{Roots, is_stable, multiply_out},
};

/// The fraction of the distance from the circle.
const NEARER: f64 = 0.2;

/// Memory for such steps, taken once.
#[derive(Debug)]
pub(super) struct StabilityBoundary {
    stable_a: bool,
    before: Polynomials,
    after: Polynomials,
    roots: Roots,
    product: Vec<Complex<f64>>,
    scratch: Vec<f64>,
}

impl StabilityBoundary {
    /// For models whose A has to be stable too, or need not be.
    pub(super) fn new(orders: &Orders, stable_a: bool) -> Self {
        let zero = vec![0.0; orders.parameters()];
        let na = if stable_a { orders.na } else { 0 };
        let longest = orders.nf.iter().copied().fold(orders.nc.max(na), usize::max) + 1;
        Self {
            stable_a,
            before: Polynomials::new(orders, &zero),
            after: Polynomials::new(orders, &zero),
            roots: Roots::with_capacity(longest),
            product: Vec::with_capacity(longest + 1),
            scratch: Vec::with_capacity(longest),
        }
    }

    /// Moves the roots of C and F at `trial`, and of A if need be, that are outside the unit circle back into it, on a
    /// circle that is nearer to it than the roots at `from`. Says whether that made all of them stable. O(n^2) for each
    /// sweep over n roots.
    pub(super) fn draw_in(&mut self, from: &[f64], trial: &mut [f64]) -> bool {
        let Self { stable_a, before, after, roots, product, scratch } = self;
        before.set(from);
        after.set(trial);
        let a = usize::from(!*stable_a);
        let all_before = [&before.a, &before.c].into_iter().skip(a).chain(&before.f);
        let all_after = [&mut after.a, &mut after.c].into_iter().skip(a).chain(&mut after.f);
        for (monic, before) in all_after.zip(all_before) {
            if is_stable(monic, scratch) {
                continue;
            }
            let Some(found) = roots.of(before) else { return false };
            let outermost = found.first().map_or(0.0, |root| root.modulus());
            let radius = 1.0 - NEARER * (1.0 - outermost);
            let Some(found) = roots.of(monic) else { return false };
            let moved = found.iter().map(|root| *root * (radius / root.modulus()).min(1.0));
            multiply_out(moved, product);
            monic.iter_mut().zip(product.iter()).for_each(|(value, product)| *value = product.re);
            if !is_stable(monic, scratch) {
                return false;
            }
        }
        after.write(trial);
        true
    }
}

#[cfg(test)]
mod tests;
