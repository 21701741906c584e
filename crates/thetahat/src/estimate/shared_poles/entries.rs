//! The matrices of a sum of sections, and how their entries move with its parameters.
//!
//! With delta = s of sines, and delta = (z - 1)/T of samples, s is delta/(1 + h delta) with h = T/2 or 0, so that a
//! section is exactly
//!
//! ```text
//! (g1 s + g2)/(s^2 + a1 s + a2) = n0 + (n1 delta + n2)/(delta^2 + b1 delta + b2),   k = 1 + a1 h + a2 h^2
//! b1 = (a1 + 2 a2 h)/k,   b2 = a2/k
//! n0 = (g1 h + g2 h^2)/k,   n1 = (g1 + 2 g2 h)/k - n0 b1,   n2 = g2/k - n0 b2
//! ```
//!
//! whose observer form has the block [-b1, c; -b2/c, 0] with the input [n1; n2/c] and the output [1, 0], c being any
//! number: the size of the poles (Middleton and Goodwin, Digital Control and Estimation, 1990, chapter 3, for delta).
//! Of samples z = 1 + T delta: F = I + T A, G = T B.

use thetahat_core::nalgebra::DMatrix;
use thetahat_core::{Dual, Number};

use super::fitting::size;
use super::objective::{PolesObjective, sections};
use crate::model::{Entry, StateSpace, StateSpaceMatrix};

/// Of a section: b, n0, and n.
type InDelta<S> = ([S; 2], S, [S; 2]);

/// A section in delta; a single pole has its numbers in the first places.
fn in_delta<S: Number<f64>>(a: &[S], g: &[S], h: f64) -> InDelta<S> {
    let zero = S::from(0.0);
    match (a, g) {
        ([a1, a2], [g1, g2]) => {
            let k = *a1 * h + *a2 * (h * h) + S::from(1.0);
            let b = [(*a1 + *a2 * (2.0 * h)) / k, *a2 / k];
            let n0 = (*g1 * h + *g2 * (h * h)) / k;
            (b, n0, [(*g1 + *g2 * (2.0 * h)) / k - n0 * b[0], *g2 / k - n0 * b[1]])
        }
        ([a], [g]) => {
            let k = *a * h + S::from(1.0);
            let (b, n0) = (*a / k, *g * h / k);
            ([b, zero], n0, [*g / k - n0 * b, zero])
        }
        _ => ([zero; 2], zero, [zero; 2]),
    }
}

impl PolesObjective<'_> {
    /// Where the entries stand that move: the coefficients of each section, and for each input its numerators and d.
    pub(super) fn entries(&self) -> Vec<Entry> {
        let mut entries = Vec::with_capacity(self.free_parameters());
        for section in sections(self.order()) {
            let column = section.start;
            entries.extend(section.map(|row| Entry { matrix: StateSpaceMatrix::F, row, column }));
        }
        for column in 0..self.points().len() {
            entries.extend((0..self.order()).map(|row| Entry { matrix: StateSpaceMatrix::G, row, column }));
            let direct = Entry { matrix: StateSpaceMatrix::D, row: 0, column };
            entries.extend(self.is_direct().then_some(direct));
        }
        entries
    }

    /// The model without noise, and by row how each of its entries moves with each parameter.
    pub(super) fn matrices(&self) -> (StateSpace, DMatrix<f64>) {
        let (order, inputs, poles) = (self.order(), self.points().len(), self.poles());
        let step = self.held();
        let (h, step) = step.map_or((0.0, 1.0), |time| (time / 2.0, time));
        let mut f = DMatrix::zeros(order, order);
        let mut g = DMatrix::zeros(order, inputs);
        let mut d = DMatrix::zeros(1, inputs);
        let mut output = DMatrix::zeros(1, order);
        let free = self.free_parameters();
        let mut slopes = DMatrix::zeros(free, free);
        for section in sections(order) {
            let (first, c, count) = (section.start, size(&poles, &section), section.len());
            output[(0, first)] = 1.0;
            // Of each state: the first one is in units of the output.
            let scale = [step, step / c];
            for (input, own) in self.numerators().iter().enumerate() {
                let column = order + input * self.linear();
                let variable = |value: f64, place: usize, slope: f64| {
                    let mut variable = Dual::<f64, 4>::from(value);
                    variable.derivatives[place] = slope;
                    variable
                };
                // By the logarithm of a.
                let a: Vec<Dual<f64, 4>> =
                    section.clone().zip(0..).map(|(at, own)| variable(poles[at], own, poles[at])).collect();
                let n: Vec<Dual<f64, 4>> =
                    section.clone().zip(2..).map(|(at, place)| variable(own[at], place, 1.0)).collect();
                let (below, direct, above) = in_delta(&a, &n, h);
                for place in 0..count {
                    f[(first + place, first)] = -scale[place] * below[place].value;
                    g[(first + place, input)] = scale[place] * above[place].value;
                    for by in 0..count {
                        slopes[(first + place, first + by)] = -scale[place] * below[place].derivatives[by];
                        let row = column + first + place;
                        slopes[(row, first + by)] = scale[place] * above[place].derivatives[by];
                        slopes[(row, column + first + by)] = scale[place] * above[place].derivatives[2 + by];
                    }
                }
                if self.is_direct() {
                    let row = column + order;
                    d[(0, input)] += direct.value;
                    for by in 0..count {
                        slopes[(row, first + by)] += direct.derivatives[by];
                        slopes[(row, column + first + by)] += direct.derivatives[2 + by];
                    }
                }
            }
            if count == 2 {
                f[(first, first + 1)] = step * c;
            }
        }
        if self.is_direct() {
            for (input, own) in self.numerators().iter().enumerate() {
                let row = 2 * order + input * self.linear();
                d[(0, input)] += own.last().copied().unwrap_or(0.0);
                slopes[(row, row)] = 1.0;
            }
        }
        if self.held().is_some() {
            f += DMatrix::<f64>::identity(order, order);
        }
        let noise = DMatrix::zeros(1, 1);
        let sample_time = self.points().first().map_or(1.0, |own| own.sample_time);
        let k = DMatrix::zeros(order, 1);
        (StateSpace { f, g, h: output, d, k, noise_covariance: noise, sample_time }, slopes)
    }
}
