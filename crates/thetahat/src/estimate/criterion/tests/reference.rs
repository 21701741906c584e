//! The same fits by other means: rows by definition, linear programs by a simplex method, vertices one by one.

use microlp::{ComparisonOp, LinearExpr, OptimizationDirection, Problem, Variable};

use super::{ConvexFit, Norm, Orders, Presample, Record};

/// phi(t) and y(t) of each sample that counts.
pub(super) fn table(record: &Record<'_>, orders: &Orders, presample: Presample) -> Vec<(Vec<f64>, f64)> {
    let mut table = Vec::new();
    for segment in &record.segments {
        for t in segment.clone() {
            if presample == Presample::Drop && t < segment.start + orders.maximum_lag() {
                continue;
            }
            let past =
                |values: &[f64], lag: usize| if t < segment.start + lag { 0.0 } else { values[t - lag] };
            let mut phi: Vec<f64> = (1..=orders.na).map(|lag| -past(record.output, lag)).collect();
            for ((u, &nb), &nk) in record.inputs.iter().zip(&orders.nb).zip(&orders.nk) {
                phi.extend((nk..nk + nb).map(|lag| past(u, lag)));
            }
            table.push((phi, record.output[t]));
        }
    }
    table
}

/// e(t) of each sample.
pub(super) fn errors(table: &[(Vec<f64>, f64)], parameters: &[f64]) -> Vec<f64> {
    table.iter().map(|(phi, y)| y - phi.iter().zip(parameters).map(|(a, b)| a * b).sum::<f64>()).collect()
}

/// sum |e|, sum e^2 or max |e|.
pub(super) fn norm_of(table: &[(Vec<f64>, f64)], parameters: &[f64], norm: Norm) -> f64 {
    let errors = errors(table, parameters).into_iter();
    match norm {
        Norm::One => errors.map(f64::abs).sum(),
        Norm::Two => errors.map(|e| e * e).sum(),
        Norm::Infinity => errors.fold(0.0, |largest, e| largest.max(e.abs())),
    }
}

/// The least and the largest values of two parameters with |e| <= bound: of the points where two samples are at their
/// bound those at which the others are within it.
pub(super) fn box_of_vertices(table: &[(Vec<f64>, f64)], bound: f64) -> [[f64; 2]; 2] {
    let mut ends = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for (first, (phi, y)) in table.iter().enumerate() {
        for (psi, z) in &table[..first] {
            for (s, r) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
                let (y, z) = (y - s * bound, z - r * bound);
                let determinant = phi[0] * psi[1] - phi[1] * psi[0];
                let point =
                    [(y * psi[1] - z * phi[1]) / determinant, (phi[0] * z - psi[0] * y) / determinant];
                // Rounding of e is 1e-15 or so.
                if norm_of(table, &point, Norm::Infinity) <= bound * (1.0 + 1e-9) + 1e-14 {
                    for (ends, value) in ends.iter_mut().zip(point) {
                        *ends = [ends[0].min(value), ends[1].max(value)];
                    }
                }
            }
        }
    }
    ends
}

/// A linear program over the parameters and others.
pub(super) struct Reference {
    problem: Problem,
    parameters: Vec<Variable>,
}

impl Reference {
    /// Parameters with their costs, within the bounds and the gains of the first input.
    pub(super) fn new(costs: &[f64], criterion: &ConvexFit, orders: &Orders) -> Self {
        let mut problem = Problem::new(OptimizationDirection::Minimize);
        let mut ends = vec![(f64::NEG_INFINITY, f64::INFINITY); costs.len()];
        for bound in &criterion.bounds {
            let index = orders.names().iter().position(|name| *name == bound.parameter).unwrap();
            ends[index] = (ends[index].0.max(bound.low), ends[index].1.min(bound.high));
        }
        let parameters: Vec<Variable> =
            costs.iter().zip(ends).map(|(cost, ends)| problem.add_var(*cost, ends)).collect();
        for gain in &criterion.dc_gain {
            let sum = |weight: f64| {
                let mut sum = LinearExpr::empty();
                for (index, variable) in parameters.iter().enumerate() {
                    sum.add(*variable, if index < orders.na { -weight } else { 1.0 });
                }
                sum
            };
            problem.add_constraint(sum(gain.low), ComparisonOp::Ge, gain.low);
            problem.add_constraint(sum(gain.high), ComparisonOp::Le, gain.high);
            if gain.low < gain.high && orders.na > 0 {
                let a: Vec<_> = parameters[..orders.na].iter().map(|a| (*a, 1.0)).collect();
                problem.add_constraint(a, ComparisonOp::Ge, -1.0);
            }
        }
        Self { problem, parameters }
    }

    /// phi'theta, and more.
    fn expression(&self, phi: &[f64], more: &[(Variable, f64)]) -> LinearExpr {
        let mut expression = LinearExpr::empty();
        for (variable, value) in self.parameters.iter().zip(phi) {
            expression.add(*variable, *value);
        }
        for (variable, value) in more {
            expression.add(*variable, *value);
        }
        expression
    }

    /// |e| <= bound.
    pub(super) fn bound(&mut self, table: &[(Vec<f64>, f64)], bound: f64) {
        for (phi, y) in table {
            self.problem.add_constraint(self.expression(phi, &[]), ComparisonOp::Le, y + bound);
            self.problem.add_constraint(self.expression(phi, &[]), ComparisonOp::Ge, y - bound);
        }
    }

    /// Adds sum |e| or max |e| to the costs.
    pub(super) fn add_norm(&mut self, table: &[(Vec<f64>, f64)], norm: Norm) {
        let level = (norm == Norm::Infinity).then(|| self.problem.add_var(1.0, (0.0, f64::INFINITY)));
        for (phi, y) in table {
            if let Some(level) = level {
                self.problem.add_constraint(self.expression(phi, &[(level, 1.0)]), ComparisonOp::Ge, *y);
                self.problem.add_constraint(self.expression(phi, &[(level, -1.0)]), ComparisonOp::Le, *y);
            } else {
                let plus = self.problem.add_var(1.0, (0.0, f64::INFINITY));
                let minus = self.problem.add_var(1.0, (0.0, f64::INFINITY));
                let row = self.expression(phi, &[(plus, 1.0), (minus, -1.0)]);
                self.problem.add_constraint(row, ComparisonOp::Eq, *y);
            }
        }
    }

    /// The parameters at the optimum; none if nothing is possible.
    pub(super) fn solve(&self) -> Option<Vec<f64>> {
        let solution = self.problem.solve().ok()?.into_solution().ok()?;
        Some(self.parameters.iter().map(|variable| solution.var_value(*variable)).collect())
    }
}
