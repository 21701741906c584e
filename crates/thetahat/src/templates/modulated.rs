//! Least squares for differential equations that are linear in their parameters, without differentiating what was
//! measured.
//!
//! An equation of signals s_i and of their derivatives,
//!
//! ```text
//! d^m y/dt^m = sum_i theta_i d^(d_i) s_i/dt^(d_i)
//! ```
//!
//! is multiplied by a function g that vanishes with its first two derivatives at the ends of a window, and integrated
//! by parts over it, so that the derivatives are those of g, which are known:
//!
//! ```text
//! (-1)^m int g^(m) y dt = sum_i theta_i (-1)^(d_i) int g^(d_i) s_i dt,    g(s) = s^3 (1 - s)^3,  0 <= s <= 1
//! ```
//!
//! Each window is a row of a linear regression. Long windows average noise, short ones see what is fast: a grid of
//! lengths gives candidates.
//!
//! Source: Shinbrot, On the analysis of linear and nonlinear systems, Transactions of the ASME 79, 1957; Preisig and
//! Rippin, Theory and application of the modulating function method, Computers and Chemical Engineering 17, 1993.

use thetahat_core::nalgebra::{DMatrix, DVector};

use super::task::{Run, Task};

/// A signal of an equation.
pub(super) struct Term {
    /// Its values, run by run.
    values: Vec<Vec<f64>>,
    /// How often it is differentiated.
    derivative: usize,
    /// Whether it is held from row to row, as an input is, or goes on between them.
    held: bool,
}

impl Term {
    /// A signal that was measured, or is made of some that were.
    pub(super) fn smooth(task: &Task<'_>, derivative: usize, signal: impl Fn(&Run, usize) -> f64) -> Self {
        Self { values: along(task, signal), derivative, held: false }
    }

    /// An input, held from row to row.
    pub(super) fn held(task: &Task<'_>, derivative: usize, signal: impl Fn(&Run, usize) -> f64) -> Self {
        Self { values: along(task, signal), derivative, held: true }
    }
}

fn along(task: &Task<'_>, signal: impl Fn(&Run, usize) -> f64) -> Vec<Vec<f64>> {
    task.runs.iter().map(|run| (0..run.time.len()).map(|row| signal(run, row)).collect()).collect()
}

/// The least and the most windows that a run is covered with are these many samples long.
const SHORTEST: usize = 6;

/// Lengths of windows to try, in samples: each twice as long as the one before, up to half of the longest run.
pub(super) fn lengths(task: &Task<'_>) -> Vec<usize> {
    let longest = task.runs.iter().map(|run| run.time.len()).max().unwrap_or(0);
    std::iter::successors(Some(SHORTEST), |length| Some(length * 2))
        .take_while(|length| *length <= longest / 2)
        .collect()
}

/// The parameters of an equation for the left side and the terms of the right side, from windows of so many samples;
/// rows that are not usable stand in no window. None where the windows do not determine them.
pub(super) fn regress(
    task: &Task<'_>,
    length: usize,
    left: &Term,
    right: &[Term],
    usable: Option<&[Vec<bool>]>,
) -> Option<Vec<f64>> {
    let mut rows: Vec<f64> = Vec::new();
    let mut targets: Vec<f64> = Vec::new();
    let stride = (length / 8).max(1);
    for (index, run) in task.runs.iter().enumerate() {
        for begin in (0..run.time.len().saturating_sub(length)).step_by(stride) {
            let end = begin + length;
            if usable.is_some_and(|usable| !usable[index][begin..=end].iter().all(|usable| *usable)) {
                continue;
            }
            let value =
                |term: &Term| integral(&run.time[begin..=end], &term.values[index][begin..=end], term);
            targets.push(value(left));
            rows.extend(right.iter().map(value));
        }
    }
    solve(rows, targets, right.len())
}

/// The least squares of rows of `width` regressors.
pub(super) fn solve(rows: Vec<f64>, targets: Vec<f64>, width: usize) -> Option<Vec<f64>> {
    if targets.len() < 2 * width {
        return None;
    }
    let mut phi = DMatrix::from_row_slice(targets.len(), width, &rows);
    let norms: Vec<f64> = phi.column_iter().map(|column| column.norm()).collect();
    if norms.iter().any(|norm| !(*norm > 0.0 && norm.is_finite())) {
        return None;
    }
    phi.column_iter_mut().zip(&norms).for_each(|(mut column, norm)| column /= *norm);
    let target = DVector::from_vec(targets);
    // Orthogonal columns, then a triangle: SVD of the small triangle alone tells whether they are dependent.
    let decomposed = phi.qr();
    let right = decomposed.q().tr_mul(&target);
    let triangle = decomposed.r().svd(true, true);
    let singular = &triangle.singular_values;
    if singular.iter().any(|value| value.is_nan()) || singular.min() <= 1e-9 * singular.max() {
        return None;
    }
    let solution = triangle.solve(&right, 0.0).ok()?;
    let theta: Vec<f64> = solution.iter().zip(&norms).map(|(value, norm)| value / norm).collect();
    theta.iter().all(|value| value.is_finite()).then_some(theta)
}

/// (-1)^d int g^(d) s dt over a window.
fn integral(time: &[f64], values: &[f64], term: &Term) -> f64 {
    let (first, last) = (time[0], time[time.len() - 1]);
    let whole = last - first;
    let at = |t: f64| (t - first) / whole;
    let scale = whole.powi(-(term.derivative as i32)) * if term.derivative % 2 == 1 { -1.0 } else { 1.0 };
    let mut sum = 0.0;
    for row in 0..time.len() - 1 {
        let (a, b) = (at(time[row]), at(time[row + 1]));
        let (left, right) = (g(a, term.derivative), g(b, term.derivative));
        let width = time[row + 1] - time[row];
        sum += if term.held {
            // Simpson's rule, as the input does not change between.
            values[row] * width / 6.0 * (left + 4.0 * g(0.5 * (a + b), term.derivative) + right)
        } else {
            0.5 * width * (left * values[row] + right * values[row + 1])
        };
    }
    scale * sum
}

/// g, its first or its second derivative by s.
fn g(s: f64, derivative: usize) -> f64 {
    let p = s * (1.0 - s);
    match derivative {
        0 => p.powi(3),
        1 => 3.0 * p.powi(2) * (1.0 - 2.0 * s),
        _ => 6.0 * p * (1.0 - 5.0 * p),
    }
}
