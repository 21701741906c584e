//! The search for the least V.
//!
//! Fisher scoring with Levenberg and Marquardt's damping, in parameters scaled so that the matrix has a unit diagonal:
//!
//! ```text
//! (A + mu E) step = -V',   A = I + diag(c_i),   c_i = |V_i| of a parameter with bounds, 0 of the others
//! ```
//!
//! I is the information and E the identity. mu goes from 1e-8, times 10 where V rises, a tenth where it falls as foretold (Levenberg 1944; Marquardt 1963; Ljung,
//! System Identification, 2nd ed. 1999, section 10.2). c_i is the most that the curvature of p(z) adds to that of V: for
//! p = min + exp(z), V_p p'' = V_z. It vanishes at a minimum, and keeps a parameter that is drawn to its bound from running away:
//! there I_ii and V_i vanish together, and V_i^2/I_ii does not.
//!
//! Where V falls by more than foretold, as on a plateau far from the minimum, the step is doubled as long as V falls further:
//! there the sum of e_i e_j/S says more about e than about V.
//!
//! A step after which the filter does not work is refused like one that raises V. The search stops when V' A^-1 V'/2, the
//! decrease that a full step foretells, is below the tolerance times max(N, sum e^2/S)/2, N the elements that were
//! measured. That is V without its logarithms, which may be of either sign.

use thetahat_core::nalgebra::{DMatrix, DVector};

use super::likelihood::Criterion;
use crate::Error;
use crate::estimate::optimize::{
    Deadline, FIRST_DAMPING, LARGEST_DAMPING, Monitor, Progress, ROUNDING, SMALLEST_DAMPING, Stopped,
};
use crate::respond::equations::Failure;

/// Where V falls by so many times what was foretold, a longer step is tried.
const BETTER: f64 = 1.2;

/// What a search found.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Found {
    pub(super) z: Vec<f64>,
    /// V at the start and behind each iteration.
    pub(super) values: Vec<f64>,
    pub(super) stopped: Stopped,
}

impl Found {
    /// V.
    pub(super) fn value(&self) -> f64 {
        self.values.last().copied().unwrap_or(f64::NAN)
    }
}

/// Searches from `start`; `bounded` tells which parameters have a bound. The criterion is left linearised at what is found.
///
/// # Errors
/// [`Error::Interrupted`]; the [`Failure`] of the filter at the start.
pub(super) fn search(
    criterion: &mut Criterion<'_>,
    start: &[f64],
    bounded: &[bool],
    max_iterations: usize,
    tolerance: f64,
    deadline: Deadline,
    monitor: Monitor<'_>,
) -> Result<Result<Found, Failure>, Error> {
    let mut z = start.to_vec();
    let mut value = match criterion.evaluate(&z) {
        Ok(value) => value,
        Err(failure) => return Ok(Err(failure)),
    };
    let mut values = vec![value];
    let mut damping = FIRST_DAMPING;
    let measured = criterion.measurements as f64;
    let stopped = loop {
        let iteration = values.len() - 1;
        if monitor(Progress { iteration, cost: value / measured }).is_break() {
            return Err(Error::Interrupted);
        }
        if let Err(failure) = criterion.linearize(&z) {
            return Ok(Err(failure));
        }
        let size = measured.max(criterion.squares) / 2.0;
        let scaled = Scaled::new(criterion, bounded);
        let foretold = scaled.step(SMALLEST_DAMPING).map_or(f64::INFINITY, |(_, foretold)| foretold);
        if foretold <= tolerance * size {
            break Stopped::Converged;
        }
        if iteration >= max_iterations {
            break Stopped::MaxIterations;
        }
        if deadline.is_over() {
            break Stopped::TimeLimit;
        }
        let accepted = loop {
            if damping > LARGEST_DAMPING {
                break None;
            }
            if let Some((step, expected)) = scaled.step(damping) {
                let trial: Vec<f64> = z.iter().zip(&step).map(|(z, step)| z + step).collect();
                match criterion.evaluate(&trial) {
                    Ok(lower) if lower < value => break Some((trial, lower, expected)),
                    Ok(_) | Err(_) => {}
                }
            }
            damping *= 10.0;
        };
        let Some((mut trial, mut lower, expected)) = accepted else {
            break if foretold <= ROUNDING * size.max(value.abs()) {
                Stopped::Converged
            } else {
                Stopped::NoDescent
            };
        };
        if value - lower > 0.75 * expected {
            damping = (damping / 10.0).max(SMALLEST_DAMPING);
        }
        if value - lower > BETTER * expected {
            loop {
                let longer: Vec<f64> = z.iter().zip(&trial).map(|(z, trial)| z + 2.0 * (trial - z)).collect();
                match criterion.evaluate(&longer) {
                    Ok(further) if further < lower => (trial, lower) = (longer, further),
                    Ok(_) | Err(_) => break,
                }
            }
        }
        z = trial;
        value = lower;
        values.push(value);
    };
    Ok(Ok(Found { z, values, stopped }))
}

/// A and V' with a unit diagonal.
struct Scaled {
    matrix: DMatrix<f64>,
    gradient: DVector<f64>,
    scales: Vec<f64>,
}

impl Scaled {
    fn new(criterion: &Criterion<'_>, bounded: &[bool]) -> Self {
        let size = criterion.gradient.len();
        let mut matrix = DMatrix::from_row_slice(size, size, &criterion.information);
        for (index, _) in bounded.iter().enumerate().filter(|(_, bounded)| **bounded) {
            matrix[(index, index)] += criterion.gradient[index].abs();
        }
        // A parameter without effect stays where it is.
        let root = |diagonal: &f64| if *diagonal > 0.0 { diagonal.sqrt() } else { 1.0 };
        let scales: Vec<f64> = matrix.diagonal().iter().map(root).collect();
        let gradient = DVector::from_fn(size, |i, _| criterion.gradient[i] / scales[i]);
        let matrix = DMatrix::from_fn(size, size, |i, j| matrix[(i, j)] / scales[i] / scales[j]);
        Self { matrix, gradient, scales }
    }

    /// The step in z, and the decrease of V that it foretells: -V's - s'A s/2. None where the damping is too little for the
    /// rounding of A.
    fn step(&self, damping: f64) -> Option<(Vec<f64>, f64)> {
        let size = self.scales.len();
        let damped = &self.matrix + DMatrix::identity(size, size) * damping;
        let step = -damped.cholesky()?.solve(&self.gradient);
        let foretold = -self.gradient.dot(&step) - step.dot(&(&self.matrix * &step)) / 2.0;
        Some((step.iter().zip(&self.scales).map(|(step, scale)| step / scale).collect(), foretold))
    }
}
