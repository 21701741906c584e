//! The memory of a search, and the steps that are made from normal equations.

use super::normal;
use super::objective::Objective;
use super::orthogonal::Orthogonal;

/// Always there: directions in which the matrix is nothing but rounding predict no decrease.
pub(super) const SMALLEST_DAMPING: f64 = 1e-12;
/// With a damping beyond this no step is long enough to matter.
pub(super) const LARGEST_DAMPING: f64 = 1e12;
/// Where columns differ by less than this of their squares, sums of squares have lost half of the digits.
const LOST: f64 = 1e-8;
/// The first perturbation of a Hessian that is not positive definite, beside a diagonal near 1.
const FIRST_PERTURBATION: f64 = 1e-4;
/// The relative step of differences of the gradient.
const DIFFERENCE: f64 = 1e-6;

/// Memory of a search, taken once.
#[derive(Debug)]
pub(super) struct Workspace {
    /// The scaled matrix, its factor, and a step.
    scaled: Vec<f64>,
    pub(super) factor: Vec<f64>,
    pub(super) step: Vec<f64>,
    /// The step in the parameters' own units, and where it leads.
    pub(super) moved: Vec<f64>,
    pub(super) trial: Vec<f64>,
    scales: Vec<f64>,
    /// The scaled gradient.
    pub(super) right: Vec<f64>,
    /// Takes the place of the scaled matrix once that is not exact enough.
    pub(super) orthogonal: Option<Orthogonal>,
    /// The Hessian of Newton's method.
    hessian: Vec<f64>,
    center: Vec<f64>,
}

impl Workspace {
    pub(super) fn new(size: usize, newton: bool) -> Self {
        let square = || vec![0.0; size * size];
        let line = || vec![0.0; size];
        Self {
            scaled: square(),
            factor: square(),
            step: line(),
            moved: line(),
            trial: line(),
            scales: line(),
            right: line(),
            orthogonal: None,
            hessian: if newton { square() } else { Vec::new() },
            center: line(),
        }
    }

    /// Scales the normal equations so that the matrix has a unit diagonal, and solves them. Gives the decrease of the
    /// cost that the solution predicts.
    pub(super) fn scale(&mut self, objective: &mut impl Objective, parameters: &[f64]) -> f64 {
        if let Some(orthogonal) = &mut self.orthogonal {
            if let Some(predicted) = orthogonal.scale(objective, parameters, &mut self.right, &mut self.step)
            {
                return predicted;
            }
            self.orthogonal = None;
        }
        let size = self.scales.len();
        for (index, scale) in self.scales.iter_mut().enumerate() {
            let diagonal = objective.matrix()[index * size + index];
            // A column of which nothing is left but rounding, whose square may be negative, has no step.
            *scale = if diagonal > 0.0 { diagonal.sqrt() } else { f64::INFINITY };
            self.right[index] = objective.right()[index] / *scale;
        }
        for row in 0..size {
            for column in 0..size {
                self.scaled[row * size + column] =
                    objective.matrix()[row * size + column] / self.scales[row] / self.scales[column];
            }
        }
        self.solve_damped(SMALLEST_DAMPING);
        self.step.iter().zip(&self.right).map(|(step, right)| step * right).sum()
    }

    /// Goes on by orthogonal transformations, and gives the decrease that these predict; none where it does so already,
    /// or the objective has no triangle.
    pub(super) fn turn(&mut self, objective: &mut impl Objective, parameters: &[f64]) -> Option<f64> {
        if self.orthogonal.is_some() {
            return None;
        }
        let mut orthogonal = Orthogonal::new(parameters.len());
        let predicted = orthogonal.scale(objective, parameters, &mut self.right, &mut self.step)?;
        self.orthogonal = Some(orthogonal);
        Some(predicted)
    }

    /// Whether the normal equations that were solved last have lost digits that count.
    pub(super) fn is_lost(&self) -> bool {
        let size = self.scales.len();
        let least = (0..size).map(|index| self.factor[index * (size + 1)]).fold(f64::INFINITY, f64::min);
        let largest = (0..size).map(|index| self.factor[index * (size + 1)]).fold(0.0, f64::max);
        self.orthogonal.is_none() && (least * least < LOST || largest == f64::INFINITY)
    }

    /// `(G + damping I) step = g`.
    pub(super) fn solve_damped(&mut self, damping: f64) {
        if let Some(orthogonal) = &mut self.orthogonal {
            orthogonal.solve_damped(damping, &mut self.step);
            return;
        }
        let size = self.scales.len();
        self.factor.copy_from_slice(&self.scaled);
        (0..size).for_each(|index| self.factor[index * size + index] += damping);
        normal::factor(&mut self.factor, size);
        self.step.copy_from_slice(&self.right);
        normal::solve(&self.factor, size, &mut self.step);
    }

    /// `(H + damping I) step = g` with the least damping, in tenfold steps, that makes the matrix positive definite.
    ///
    /// H comes from central differences of g, one-sided ones beside the boundary of where there is a cost: 2 p
    /// linearizations.
    pub(super) fn newton_step(&mut self, objective: &mut impl Objective, parameters: &[f64], cost: f64) {
        let size = self.scales.len();
        let cost = objective.scale(cost);
        self.center.copy_from_slice(objective.right());
        for column in 0..size {
            // A change of sqrt(cost)/scale changes the errors by their own size.
            let apart = DIFFERENCE * (parameters[column].abs() + 100.0 * cost.sqrt() / self.scales[column]);
            let mut width = 0.0;
            (0..size).for_each(|row| self.hessian[row * size + column] = 0.0);
            for side in [-1.0, 1.0] {
                self.trial.copy_from_slice(parameters);
                self.trial[column] += side * apart;
                objective.keep_free();
                let usable = objective.evaluate(&self.trial).is_ok() && objective.linearize().is_ok();
                if usable {
                    width += apart;
                }
                // g is minus half the gradient.
                let gradient = if usable { objective.right() } else { &self.center };
                for (row, value) in gradient.iter().enumerate() {
                    self.hessian[row * size + column] -= side * value;
                }
            }
            let width = if width > 0.0 { width } else { 1.0 };
            for row in 0..size {
                self.hessian[row * size + column] /= width * self.scales[row] * self.scales[column];
            }
        }
        objective.keep_free();
        // The signals of the current point again, which has a cost and normal equations.
        let _ = objective.evaluate(parameters);
        let _ = objective.linearize();
        let mut damping = 0.0;
        loop {
            for row in 0..size {
                for column in 0..size {
                    let (one, other) = (self.hessian[row * size + column], self.hessian[column * size + row]);
                    self.factor[row * size + column] = f64::midpoint(one, other);
                }
                self.factor[row * size + row] += damping;
            }
            if normal::factor(&mut self.factor, size) == 0 || damping > LARGEST_DAMPING {
                break;
            }
            damping = (damping * 10.0).max(FIRST_PERTURBATION);
        }
        self.step.copy_from_slice(&self.right);
        normal::solve(&self.factor, size, &mut self.step);
    }

    /// Where a fraction of the step leads, and the decrease of the cost that it predicts: 2 g's - s'G s.
    pub(super) fn apply(&mut self, objective: &mut impl Objective, parameters: &[f64], fraction: f64) -> f64 {
        if let Some(orthogonal) = &mut self.orthogonal {
            let places = [&mut self.step[..], &mut self.trial, &mut self.moved];
            return orthogonal.apply(objective, parameters, fraction, places);
        }
        let size = self.scales.len();
        let mut predicted = 0.0;
        for (row, parameter) in parameters.iter().enumerate() {
            let step = fraction * self.step[row];
            self.moved[row] = step / self.scales[row];
            self.trial[row] = parameter + self.moved[row];
            let curved = self.scaled[row * size..][..size].iter().zip(&self.step);
            predicted += step * (2.0 * self.right[row] - fraction * curved.map(|(g, s)| g * s).sum::<f64>());
        }
        predicted
    }
}
