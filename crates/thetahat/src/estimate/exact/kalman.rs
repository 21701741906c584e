//! The Kalman filter of an ARMA process in innovations form, and its derivatives.
//!
//! ```text
//! A(q) z = C(q) e:   s(t+1) = T s(t) + K e(t),   z(t) = h's(t) + e(t),   h = (1, 0, …, 0)'
//! ```
//!
//! T is the companion matrix with -a_1 … -a_m in its first column and ones above the diagonal, K = (c_1 - a_1, …, c_m -
//! a_m)', m = max(na, nc) (Hannan and Deistler, The Statistical Theory of Linear Systems, 1988, section 1.2; Harvey's
//! form, 1989, section 3.3, has one state more where nc = na). In units of var e the state begins with its stationary
//! covariance
//!
//! ```text
//! P = T P T' + K K'
//! ```
//!
//! (Gardner, Harvey and Phillips, Applied Statistics 29, 1980, AS 154), by doubling: P <- P + M P M', M <- M^2 from P =
//! K K', M = T (Smith, SIAM J. Applied Mathematics 16, 1968). As e is the noise of the measurement too, it is K' = T -
//! K h', the companion matrix of C, that carries P on. With w = P h and f = 1 + h'P h
//!
//! ```text
//! measured:  v = z - h's,   s <- T (s + w v/f) + K v/f,   P <- K' (P - w w'/f) K''
//! missing:                  s <- T s,                     P <- T P T' + K K'
//! ```
//!
//! (Jones, Technometrics 22, 1980, for missing values). After a measured value the rest of P dies away with the squares
//! of the zeros of C: once it has, f = 1 and the recursion is e = v, O(m) a sample and no more (Pearlman, Biometrika
//! 67, 1980). The derivatives are those of these equations, one by one; P depends on A and C alone.

use thetahat_core::nalgebra::{DMatrix, DVector};

/// Covariances below this, in units of var e, change no figure: what is left of them is set to zero.
const SETTLED: f64 = 1e-24;
const SETTLED_SLOPE: f64 = 1e-20;
/// Doublings of the time that a stationary covariance is summed over: beyond 2^64 samples a process is not stationary.
const DOUBLINGS: usize = 64;

/// Which coefficient a derivative is taken with respect to: that of q^-(index + 1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Coefficient {
    A(usize),
    C(usize),
}

/// An ARMA process: its matrices, and the covariance that its state begins with.
#[derive(Debug)]
pub(super) struct Process {
    size: usize,
    /// a_1 … a_m, c_1 … c_m and K.
    a: Vec<f64>,
    c: Vec<f64>,
    gain: Vec<f64>,
    /// P at the start, row by row, and its derivatives.
    start: Vec<f64>,
    start_slopes: Vec<Vec<f64>>,
    coefficients: Vec<Coefficient>,
}

impl Process {
    /// The process of monic A and C; `slopes` where derivatives are wanted. None where the covariance overflows, as for
    /// a root of A on the unit circle.
    pub(super) fn new(a: &[f64], c: &[f64], slopes: bool) -> Option<Self> {
        let size = (a.len() - 1).max(c.len() - 1).max(1);
        let padded = |monic: &[f64]| {
            let mut values = monic[1..].to_vec();
            values.resize(size, 0.0);
            values
        };
        let (na, nc) = (a.len() - 1, c.len() - 1);
        let (a, c) = (padded(a), padded(c));
        let gain: Vec<f64> = c.iter().zip(&a).map(|(c, a)| c - a).collect();
        let coefficients: Vec<Coefficient> = if slopes {
            (0..na).map(Coefficient::A).chain((0..nc).map(Coefficient::C)).collect()
        } else {
            Vec::new()
        };
        let transition = DMatrix::from_fn(size, size, |row, column| {
            let first = if column == 0 { -a[row] } else { 0.0 };
            first + f64::from(u8::from(column == row + 1))
        });
        let noise = DVector::from_column_slice(&gain);
        let mut powers = Vec::new();
        let mut covariance = &noise * noise.transpose();
        let mut power = transition.clone();
        for _ in 0..DOUBLINGS {
            let more = &power * &covariance * power.transpose();
            let done = more.norm() <= 0.5 * f64::EPSILON * covariance.norm();
            covariance += more;
            let next = &power * &power;
            powers.push(std::mem::replace(&mut power, next));
            if done {
                break;
            }
        }
        let slope = |coefficient: &Coefficient| {
            let unit = |index: usize| DVector::from_fn(size, |row, _| f64::from(u8::from(row == index)));
            // dT P T' + T P dT' + dK K' + K dK', of which the second and the fourth are the others turned.
            let half = match coefficient {
                Coefficient::A(index) => {
                    -unit(*index) * (&transition * covariance.column(0)).transpose()
                        - unit(*index) * noise.transpose()
                }
                Coefficient::C(index) => unit(*index) * noise.transpose(),
            };
            let mut sum = &half + half.transpose();
            for power in &powers {
                sum = &sum + power * &sum * power.transpose();
            }
            rows(&sum)
        };
        let start_slopes: Vec<Vec<f64>> = coefficients.iter().map(slope).collect();
        let start = rows(&covariance);
        let finite = start.iter().chain(start_slopes.iter().flatten()).all(|value| value.is_finite());
        finite.then_some(Self { size, a, c, gain, start, start_slopes, coefficients })
    }
}

fn rows(matrix: &DMatrix<f64>) -> Vec<f64> {
    matrix.row_iter().flat_map(|row| row.iter().copied().collect::<Vec<_>>()).collect()
}

/// What a measured value says: v and f, and their derivatives.
#[derive(Debug)]
pub(super) struct Innovation<'f> {
    pub(super) value: f64,
    pub(super) variance: f64,
    /// dv, one for each column.
    pub(super) slopes: &'f [f64],
    /// df, one for each coefficient; none where f = 1 from here on.
    pub(super) variance_slopes: &'f [f64],
}

/// The filter on its way through a segment.
#[derive(Debug)]
pub(super) struct Filter<'p> {
    process: &'p Process,
    /// Which coefficient each column belongs to, if to one.
    coefficients: Vec<Option<usize>>,
    state: Vec<f64>,
    /// ds, m values for each column.
    slopes: Vec<f64>,
    covariance: Vec<f64>,
    covariance_slopes: Vec<Vec<f64>>,
    settled: bool,
    value_slopes: Vec<f64>,
    variance_slopes: Vec<f64>,
    next: Vec<f64>,
}

impl<'p> Filter<'p> {
    /// Before the first sample. `columns` derivatives are taken, those with respect to the coefficients at `places`.
    pub(super) fn new(process: &'p Process, columns: usize, places: &[usize]) -> Self {
        let (size, coefficients) = (process.size, process.coefficients.len());
        let of_column = |column| places.iter().position(|place| *place == column);
        Self {
            process,
            coefficients: (0..columns).map(of_column).collect(),
            state: vec![0.0; size],
            slopes: vec![0.0; columns * size],
            covariance: process.start.clone(),
            covariance_slopes: process.start_slopes.clone(),
            settled: false,
            value_slopes: vec![0.0; columns],
            variance_slopes: vec![0.0; coefficients],
            next: vec![0.0; size * size],
        }
    }

    /// Takes z(t) in, of which the derivatives are `slopes`, and goes on to t + 1. O(m^2) for each coefficient and O(m)
    /// for each column, or the latter alone where the covariance has settled.
    pub(super) fn measured(&mut self, value: f64, slopes: &[f64]) -> Innovation<'_> {
        let Process { size, a, gain, coefficients, .. } = self.process;
        let size = *size;
        self.settle();
        let v = value - self.state[0];
        let variance = if self.settled { 1.0 } else { 1.0 + self.covariance[0] };
        let error = v / variance;
        let known = if self.settled { 0 } else { coefficients.len() };
        for (slope, covariance) in self.variance_slopes.iter_mut().zip(&self.covariance_slopes).take(known) {
            *slope = covariance[0];
        }
        for (column, own) in self.slopes.chunks_exact_mut(size).enumerate() {
            let slope = slopes[column] - own[0];
            self.value_slopes[column] = slope;
            let coefficient = self.coefficients[column];
            let mut error_slope = slope / variance;
            if let Some(index) = coefficient.filter(|_| !self.settled) {
                error_slope -= error * self.variance_slopes[index] / variance;
                for (row, own) in own.iter_mut().enumerate() {
                    *own += self.covariance_slopes[index][row * size] * error;
                }
            }
            if !self.settled {
                for (row, own) in own.iter_mut().enumerate() {
                    *own += self.covariance[row * size] * error_slope;
                }
            }
            advance(a, own);
            own.iter_mut().zip(gain).for_each(|(own, gain)| *own += gain * error_slope);
            match coefficient.map(|index| coefficients[index]) {
                // s + w v/f has z - e as its first element.
                Some(Coefficient::A(row)) => own[row] -= value,
                Some(Coefficient::C(row)) => own[row] += error,
                None => {}
            }
        }
        if !self.settled {
            for (row, state) in self.state.iter_mut().enumerate() {
                *state += self.covariance[row * size] * error;
            }
        }
        advance(a, &mut self.state);
        self.state.iter_mut().zip(gain).for_each(|(state, gain)| *state += gain * error);
        if !self.settled {
            self.condition(variance);
        }
        Innovation {
            value: v,
            variance,
            slopes: &self.value_slopes,
            variance_slopes: &self.variance_slopes[..known],
        }
    }

    /// Goes on to t + 1 without a value.
    pub(super) fn missing(&mut self) {
        let Process { size, a, gain, coefficients, .. } = self.process;
        let size = *size;
        let first = self.state[0];
        for (column, own) in self.slopes.chunks_exact_mut(size).enumerate() {
            advance(a, own);
            let coefficient = self.coefficients[column];
            if let Some(Coefficient::A(row)) = coefficient.map(|index| coefficients[index]) {
                own[row] -= first;
            }
        }
        advance(a, &mut self.state);
        self.settled = false;
        let Self { covariance, covariance_slopes, next, .. } = self;
        for (own, coefficient) in covariance_slopes.iter_mut().zip(coefficients) {
            carry(a, own, next);
            let row = match coefficient {
                Coefficient::A(row) => {
                    let turned = along(a, covariance, next);
                    (0..size).for_each(|j| {
                        let both = turned[j] - gain[j];
                        own[row * size + j] += both;
                        own[j * size + row] += both;
                    });
                    continue;
                }
                Coefficient::C(row) => *row,
            };
            for (j, gain) in gain.iter().enumerate() {
                own[row * size + j] += gain;
                own[j * size + row] += gain;
            }
        }
        carry(a, covariance, next);
        for (i, one) in gain.iter().enumerate() {
            for (j, other) in gain.iter().enumerate() {
                covariance[i * size + j] += one * other;
            }
        }
    }

    /// P <- K' (P - w w'/f) K''.
    fn condition(&mut self, variance: f64) {
        let Process { size, c, coefficients, .. } = self.process;
        let size = *size;
        let Self { covariance, covariance_slopes, variance_slopes, next, .. } = self;
        let w: Vec<f64> = (0..size).map(|row| covariance[row * size]).collect();
        for (own, slope) in covariance_slopes.iter_mut().zip(&*variance_slopes) {
            let dw: Vec<f64> = (0..size).map(|row| own[row * size]).collect();
            for i in 0..size {
                for j in 0..size {
                    own[i * size + j] -=
                        (dw[i] * w[j] + w[i] * dw[j] - w[i] * w[j] * slope / variance) / variance;
                }
                // w/f, without the difference.
                let edge = (dw[i] - w[i] * slope / variance) / variance;
                (own[i * size], own[i]) = (edge, edge);
            }
        }
        for i in 0..size {
            for j in 0..size {
                covariance[i * size + j] -= w[i] * w[j] / variance;
            }
        }
        for (i, w) in w.iter().enumerate() {
            (covariance[i * size], covariance[i]) = (w / variance, w / variance);
        }
        for (own, coefficient) in covariance_slopes.iter_mut().zip(coefficients) {
            carry(c, own, next);
            if let Coefficient::C(row) = coefficient {
                let turned = along(c, covariance, next);
                (0..size).for_each(|j| {
                    own[row * size + j] += turned[j];
                    own[j * size + row] += turned[j];
                });
            }
        }
        carry(c, covariance, next);
    }

    /// Sets what has died away to zero.
    fn settle(&mut self) {
        let size = self.process.size;
        if self.settled || (0..size).any(|row| self.covariance[row * (size + 1)].abs() > SETTLED) {
            return;
        }
        if self.covariance_slopes.iter().flatten().all(|slope| slope.abs() <= SETTLED_SLOPE) {
            self.settled = true;
            self.covariance.fill(0.0);
            self.covariance_slopes.iter_mut().for_each(|slopes| slopes.fill(0.0));
        }
    }
}

/// x <- T x for the companion matrix of a monic polynomial, whose coefficients after 1 these are.
fn advance(coefficients: &[f64], x: &mut [f64]) {
    let first = x[0];
    let size = x.len();
    for row in 0..size {
        let above = if row + 1 < size { x[row + 1] } else { 0.0 };
        x[row] = above - coefficients[row] * first;
    }
}

/// P <- T P T' for the same.
fn carry(coefficients: &[f64], matrix: &mut [f64], next: &mut [f64]) {
    let size = coefficients.len();
    let corner = matrix[0];
    for i in 0..size {
        for j in 0..=i {
            let at = |row: usize, column: usize| {
                if row < size && column < size { matrix[row * size + column] } else { 0.0 }
            };
            let value = coefficients[i] * coefficients[j] * corner
                - coefficients[i] * at(0, j + 1)
                - coefficients[j] * at(i + 1, 0)
                + at(i + 1, j + 1);
            (next[i * size + j], next[j * size + i]) = (value, value);
        }
    }
    matrix.copy_from_slice(next);
}

/// The part of the derivative of T P T' with respect to one of the coefficients that stands in its row: -(T P h)'.
fn along<'n>(coefficients: &[f64], matrix: &[f64], next: &'n mut [f64]) -> &'n [f64] {
    let size = coefficients.len();
    for j in 0..size {
        let above = if j + 1 < size { matrix[(j + 1) * size] } else { 0.0 };
        next[j] = coefficients[j] * matrix[0] - above;
    }
    &next[..size]
}
