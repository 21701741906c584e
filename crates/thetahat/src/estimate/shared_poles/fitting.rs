//! Poles to start from, by vector fitting.

use std::ops::Range;

use thetahat_core::nalgebra::{Complex, DMatrix};
use thetahat_numerics::optimize::Objective;
use thetahat_numerics::regression::{Span, sum_of_squares};

use super::objective::{PolesObjective, basis, sections};
use crate::model::eigenvalues;

/// How often poles are moved.
const ROUNDS: usize = 20;
/// The damping of pairs at the beginning (Gustavsen and Semlyen 1999, section 3.3).
const DAMPING: f64 = 0.01;
/// The least that sigma may be at infinity, as a fraction of what it is in the mean.
const LEAST_SIGMA: f64 = 1e-8;

impl PolesObjective<'_> {
    /// Logarithms of coefficients to search from: where vector fitting leads from lightly damped pairs, from real
    /// poles, and from the poles of an order less with one more.
    pub(super) fn starts(&mut self, before: Option<&[f64]>) -> Vec<Vec<f64>> {
        let order = self.order();
        let moved = || self.at().iter().flatten().map(|s| s.im).filter(|at| *at > 0.0);
        let (low, high) = (moved().fold(f64::INFINITY, f64::min), moved().fold(0.0, f64::max));
        let high = high.min(self.held().map_or(f64::INFINITY, |time| 200.0 / time)).max(low);
        let spread = |count: usize| {
            let step = (high / low).ln() / count.saturating_sub(1).max(1) as f64;
            let first = if count == 1 { (low * high).sqrt() } else { low };
            (0..count).map(move |place| first * (step * place as f64).exp())
        };
        let mut pairs: Vec<f64> = spread(order / 2).flat_map(|at| [2.0 * DAMPING * at, at * at]).collect();
        let real: Vec<f64> = spread(order).collect();
        let real = of_poles(&real.iter().map(|at| Complex::new(-at, 0.0)).collect::<Vec<_>>());
        if order % 2 == 1 {
            pairs.push((low * high).sqrt());
        }
        let mut first = vec![pairs, real];
        if let Some(before) = before {
            let mut own: Vec<f64> = before.iter().map(|value| value.exp()).collect();
            let further = (low * high).sqrt();
            match own.pop().filter(|_| order.is_multiple_of(2)) {
                // The real pole of before and one more.
                Some(alone) => own.extend([alone + further, alone * further]),
                None => {
                    own = before.iter().map(|value| value.exp()).collect();
                    own.push(further);
                }
            }
            first.push(own);
        }
        first.into_iter().filter_map(|own| self.fitted(own)).collect()
    }

    /// The best of the poles that vector fitting goes through.
    fn fitted(&mut self, mut poles: Vec<f64>) -> Option<Vec<f64>> {
        let mut best: Option<(f64, Vec<f64>)> = None;
        for _ in 0..ROUNDS {
            let mut point: Vec<f64> = poles.iter().map(|value| value.ln()).collect();
            self.draw_in(&[], &mut point);
            if let Ok(cost) = self.evaluate(&point)
                && best.as_ref().is_none_or(|(own, _)| cost < *own)
            {
                best = Some((cost, point.clone()));
            }
            poles = point.iter().map(|value| value.exp()).collect();
            let Some(next) = self.relocated(&poles) else { break };
            poles = next;
        }
        best.map(|(_, point)| point)
    }

    /// The zeros of sigma, which are the poles of the next round:
    ///
    /// ```text
    /// sigma = d + sum C_i/P_i,   (sum N_ij/P_i + d_j) - sigma G_j = 0 in the least squares, sum Re sigma = K
    /// ```
    ///
    /// over the K points of all inputs. With x' = A x + b, sigma = d + c x they are the eigenvalues of A - b c/d; those
    /// right of the axis are mirrored.
    fn relocated(&self, poles: &[f64]) -> Option<Vec<f64>> {
        let order = self.order();
        let mut stacked: Vec<Vec<f64>> = vec![Vec::new(); order + 1];
        let mut sums = vec![0.0; order + 1];
        for (input, own) in self.points().iter().enumerate() {
            let mut span = Span::default();
            for column in self.linear_columns(input, poles) {
                span.add(column);
            }
            let mut beside = vec![Vec::with_capacity(2 * own.values.len()); order + 1];
            for ((s, [re, im]), weight) in self.at()[input].iter().zip(&own.values).zip(&own.weights) {
                let mut take = |place: usize, value: Complex<f64>| {
                    sums[place] += value.re;
                    let product = -value * Complex::new(*re, *im) * *weight;
                    beside[place].extend([product.re, product.im]);
                };
                for section in sections(order) {
                    let values = basis(&poles[section.clone()], *s);
                    section.zip(values).for_each(|(place, value)| take(place, value));
                }
                take(order, Complex::new(1.0, 0.0));
            }
            for (whole, mut column) in stacked.iter_mut().zip(beside) {
                span.take_from(&mut column);
                whole.append(&mut column);
            }
        }
        let count = self.count() as f64 / 2.0;
        let weight = self.measured().iter().map(|own| sum_of_squares(own)).sum::<f64>().sqrt() / count;
        let mut right = vec![0.0; stacked[0].len()];
        right.push(weight * count);
        let mut span = Span::default();
        for (mut column, sum) in stacked.into_iter().zip(sums) {
            column.push(weight * sum);
            span.add(column);
        }
        let has = span.take_from(&mut right);
        let mut sigma = span.weights(&has);
        let last = sigma.pop()?;
        let last = if last.abs() < LEAST_SIGMA { LEAST_SIGMA.copysign(last) } else { last };
        let mut matrix = DMatrix::zeros(order, order);
        for section in sections(order) {
            let (first, s) = (section.start, size(poles, &section));
            match &poles[section.clone()] {
                [a1, a2] => {
                    matrix[(first, first)] = -a1;
                    matrix[(first, first + 1)] = s;
                    matrix[(first + 1, first)] = -a2 / s;
                }
                [a] => matrix[(first, first)] = -a,
                _ => {}
            }
            for own in section.clone() {
                let enters = sigma[own] / if own == first { 1.0 } else { s };
                for other in sections(order) {
                    matrix[(own, other.start)] -= enters / last;
                }
            }
        }
        let zeros = eigenvalues(&matrix).ok()?;
        let usable = zeros.iter().all(|zero| zero.re.is_finite() && zero.norm() > 0.0);
        usable.then(|| of_poles(&zeros))
    }
}

/// How large the second state of a section is beside the first: that of its poles.
pub(super) fn size(poles: &[f64], section: &Range<usize>) -> f64 {
    match &poles[section.clone()] {
        [_, a2] => a2.sqrt(),
        _ => 1.0,
    }
}

/// The coefficients of the sections with these poles, mirrored to the left.
fn of_poles(poles: &[Complex<f64>]) -> Vec<f64> {
    let mut found = Vec::with_capacity(poles.len());
    for pole in poles.iter().filter(|pole| pole.im > 0.0) {
        // One on the axis is a little left of it.
        found.extend([(2.0 * pole.re.abs()).max(1e-9 * pole.norm()), pole.norm_sqr()]);
    }
    let mut real: Vec<f64> = poles.iter().filter(|pole| pole.im == 0.0).map(|pole| pole.re.abs()).collect();
    real.sort_by(f64::total_cmp);
    for own in real.chunks(2) {
        match own {
            [one, other] => found.extend([one + other, one * other]),
            one => found.extend(one),
        }
    }
    found
}
