//! The free run of a linear system around static curves, and its derivatives.
//!
//! ```text
//! x(k+1) = A x(k) + B u(k) + E w(k)
//! z(k)   = C x(k) + D u(k)                    w_i(k) = f_i(z_i(k))
//! y(k)   = H x(k) + J u(k) + L w(k)
//! ```
//!
//! The numbers of one matrix [A B E; C D 0; H J L] are known or parameters. With theta for these, the numbers of the
//! curves and x(0), the derivatives follow the same recursion,
//!
//! ```text
//! z' = C x' + (dC x + dD u),   w' = f'(z) z' + (df)(z),   x'(k+1) = A x' + E w' + (dA x + dB u + dE w)
//! ```
//!
//! which is exact (Schoukens and Toth 2020, On the initialization of nonlinear LFR model identification with the best
//! linear approximation, IFAC-PapersOnLine 53-2, section 2, for the structure). A row costs O(p (n + q)(n + q + 1))
//! for n states, q curves and p parameters.

use thetahat_core::nalgebra::DMatrix;

use super::curve::{Basis, Curve};
use crate::model::eigenvalues;

/// A parameter of the matrix: where it stands, with its sign there.
#[derive(Debug, Clone)]
pub(super) struct Place {
    pub(super) row: usize,
    pub(super) column: usize,
    pub(super) sign: f64,
    pub(super) name: String,
}

/// A linear system around static curves, of which the parameters are open.
#[derive(Debug, Clone)]
pub(super) struct Machine {
    pub(super) states: usize,
    pub(super) inputs: usize,
    pub(super) curves: Vec<Curve>,
    /// What is known of the matrix, row by row.
    pub(super) known: Vec<f64>,
    pub(super) places: Vec<Place>,
}

/// Rows that follow one another, from a state of their own.
#[derive(Debug, Clone)]
pub(super) struct Run {
    /// Row after row.
    pub(super) inputs: Vec<f64>,
    /// NaN where it is missing.
    pub(super) output: Vec<f64>,
}

/// Outputs beyond this multiple of what was measured are those of a run that grows without end.
const FAR: f64 = 1e6;

impl Machine {
    /// Without a number yet.
    pub(super) fn new(states: usize, inputs: usize, curves: Vec<Curve>) -> Self {
        let q = curves.len();
        let known = vec![0.0; (states + q + 1) * (states + inputs + q)];
        Self { states, inputs, curves, known, places: Vec::new() }
    }

    /// Row and column of an entry are those of the states, then of the inputs or z, and so on.
    pub(super) fn is_one(&mut self, row: usize, column: usize) {
        let width = self.width();
        self.known[row * width + column] = 1.0;
    }

    pub(super) fn is_parameter(&mut self, row: usize, column: usize, sign: f64, name: String) {
        self.places.push(Place { row, column, sign, name });
    }

    pub(super) fn width(&self) -> usize {
        self.states + self.inputs + self.curves.len()
    }

    pub(super) fn height(&self) -> usize {
        self.states + self.curves.len() + 1
    }

    /// How many parameters it has, x(0) not counted.
    pub(super) fn parameters(&self) -> usize {
        self.places.len() + self.curves.iter().map(Curve::size).sum::<usize>()
    }

    /// Where the numbers of a curve begin among the parameters.
    pub(super) fn numbers(&self, curve: usize) -> std::ops::Range<usize> {
        let start = self.places.len() + self.curves[..curve].iter().map(Curve::size).sum::<usize>();
        start..start + self.curves[curve].size()
    }

    /// Whether an entry of the matrix is known to be 1.
    pub(super) fn is_known_one(&self, row: usize, column: usize) -> bool {
        self.known[row * self.width() + column] == 1.0
    }

    /// The matrix, row by row.
    fn matrix(&self, theta: &[f64]) -> Vec<f64> {
        let (mut matrix, width) = (self.known.clone(), self.width());
        for (place, value) in self.places.iter().zip(theta) {
            matrix[place.row * width + place.column] = place.sign * value;
        }
        matrix
    }

    /// Whether the linear systems are stable, or integrate: no mode grows by more than a part of itself in so many
    /// rows.
    pub(super) fn is_stable(&self, theta: &[f64], rows: usize) -> bool {
        let (n, width, matrix) = (self.states, self.width(), self.matrix(theta));
        let system = DMatrix::from_fn(n, n, |row, column| matrix[row * width + column]);
        let poles = eigenvalues(&system).unwrap_or_default();
        let radius = poles.iter().map(|pole| pole.norm()).fold(0.0, f64::max);
        radius <= 1.0 + 0.1 / rows as f64
    }

    /// Goes through a run and gives row, state, z and y; false where it grows without end.
    pub(super) fn run(
        &self,
        theta: &[f64],
        start: &[f64],
        run: &Run,
        mut seen: impl FnMut(usize, &[f64], &[f64], f64),
    ) -> bool {
        let (n, m, width) = (self.states, self.inputs, self.width());
        let (matrix, limit) = (self.matrix(theta), run.limit());
        let row = |row: usize| &matrix[row * width..(row + 1) * width];
        let ranges: Vec<_> = (0..self.curves.len()).map(|curve| self.numbers(curve)).collect();
        let mut signals = vec![0.0; width];
        signals[..n].copy_from_slice(start);
        let (mut next, mut z, mut basis) = (vec![0.0; n], vec![0.0; self.curves.len()], Basis::new());
        for (at, inputs) in run.rows(m).enumerate() {
            signals[n..n + m].copy_from_slice(inputs);
            for (index, curve) in self.curves.iter().enumerate() {
                z[index] = product(row(n + index), &signals[..n + m]);
                let numbers = &theta[ranges[index].clone()];
                signals[n + m + index] = curve.evaluate(z[index], numbers, &mut basis).0;
            }
            let y = product(row(n + self.curves.len()), &signals);
            if y.is_nan() || y.abs() > limit {
                return false;
            }
            seen(at, &signals[..n], &z, y);
            for (index, next) in next.iter_mut().enumerate() {
                *next = product(row(index), &signals);
            }
            signals[..n].copy_from_slice(&next);
        }
        true
    }

    /// The same with the derivatives of y by all parameters and then by x(0), of each row.
    pub(super) fn slopes(
        &self,
        theta: &[f64],
        start: &[f64],
        run: &Run,
        mut seen: impl FnMut(usize, f64, &[f64]),
    ) -> bool {
        let (n, m, q, width) = (self.states, self.inputs, self.curves.len(), self.width());
        let (shared, matrix, limit) = (self.parameters(), self.matrix(theta), run.limit());
        let size = shared + n;
        let ranges: Vec<_> = (0..q).map(|curve| self.numbers(curve)).collect();
        let parameters_of = |row: usize| {
            let own = self.places.iter().enumerate().filter(move |(_, place)| place.row == row);
            own.map(|(index, place)| (index, place.column, place.sign)).collect::<Vec<_>>()
        };
        let parameters: Vec<_> = (0..self.height()).map(parameters_of).collect();
        let mut signals = vec![0.0; width];
        signals[..n].copy_from_slice(start);
        // The derivatives of states and of w, a row for each.
        let mut slopes = vec![0.0; (n + q) * size];
        for state in 0..n {
            slopes[state * size + shared + state] = 1.0;
        }
        let (mut next, mut next_slopes) = (vec![0.0; n], vec![0.0; n * size]);
        let (mut own, mut basis) = (vec![0.0; size], Basis::new());
        // A row of the matrix times the signals, and the derivatives of that.
        let combine = |row: usize, known: usize, signals: &[f64], slopes: &[f64], into: &mut [f64]| {
            let entries = &matrix[row * width..(row + 1) * width];
            into.fill(0.0);
            for (index, slopes) in slopes.chunks_exact(size).take(known).enumerate() {
                let entry = entries[if index < n { index } else { m + index }];
                if entry != 0.0 {
                    into.iter_mut().zip(slopes).for_each(|(into, slope)| *into += entry * slope);
                }
            }
            for (parameter, column, sign) in &parameters[row] {
                into[*parameter] += sign * signals[*column];
            }
            product(entries, signals)
        };
        for (at, inputs) in run.rows(m).enumerate() {
            signals[n..n + m].copy_from_slice(inputs);
            signals[n + m..].fill(0.0);
            for (index, curve) in self.curves.iter().enumerate() {
                let z = combine(n + index, n, &signals, &slopes, &mut own);
                let (w, slope) = curve.evaluate(z, &theta[ranges[index].clone()], &mut basis);
                let of_w = &mut slopes[(n + index) * size..(n + index + 1) * size];
                of_w.iter_mut().zip(&own).for_each(|(of_w, own)| *of_w = slope * own);
                for (number, value) in &basis {
                    of_w[ranges[index].start + number] += value;
                }
                signals[n + m + index] = w;
            }
            let y = combine(n + q, n + q, &signals, &slopes, &mut own);
            if y.is_nan() || y.abs() > limit {
                return false;
            }
            seen(at, y, &own);
            for (state, of_next) in next_slopes.chunks_exact_mut(size).enumerate() {
                next[state] = combine(state, n + q, &signals, &slopes, of_next);
            }
            signals[..n].copy_from_slice(&next);
            slopes[..n * size].copy_from_slice(&next_slopes);
        }
        true
    }
}

impl Run {
    fn rows(&self, inputs: usize) -> impl Iterator<Item = &[f64]> {
        (0..self.output.len()).map(move |row| &self.inputs[row * inputs..(row + 1) * inputs])
    }

    /// How far an output may go.
    fn limit(&self) -> f64 {
        let measured = self.output.iter().filter(|value| value.is_finite());
        FAR * measured.fold(f64::MIN_POSITIVE / f64::EPSILON, |largest: f64, value| largest.max(value.abs()))
    }
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
