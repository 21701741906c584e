//! The program in w whose optimum is that of the regression: its goal, its limits and its samples.

use thetahat_core::nalgebra::{DMatrix, DVector};

use super::super::{Norm, Program, Row};
use super::{Fitting, Frame, Working};

/// What is minimised over w.
pub(super) enum Goal<'g> {
    Norm(Norm),
    /// A linear function of w.
    Along(&'g DVector<f64>),
}

impl Fitting<'_> {
    /// The program in w, with the largest |e| after it for that norm.
    pub(super) fn program(
        &self,
        frame: &Frame,
        working: &Working,
        goal: &Goal<'_>,
        bound: Option<f64>,
        radius: Option<f64>,
    ) -> Program {
        let size = self.sizes.len();
        let leveled = matches!(goal, Goal::Norm(Norm::Infinity));
        let variables = size + usize::from(leveled);
        let row = |coefficients: &DVector<f64>, level: f64, right: f64| {
            let mut coefficients = coefficients.clone().resize_vertically(variables, 0.0);
            if leveled {
                coefficients[size] = -level;
            }
            Row { coefficients, right }
        };
        let mut program = Program::new(variables);
        match goal {
            Goal::Norm(norm) => self.add_goal(&mut program, frame, working, *norm),
            Goal::Along(direction) => program.gradient.copy_from(*direction),
        }
        for (index, limit) in self.limits.iter().enumerate().filter(|(_, limit)| limit.is_equation()) {
            let (direction, norm) = &self.directions[index];
            let right = (limit.low - limit.value(&frame.base)) / (frame.unit * norm);
            program.equal.push(row(direction, 0.0, right));
        }
        for &(index, upper) in &working.limits {
            let limit = &self.limits[index];
            if !limit.is_equation() {
                let (direction, norm) = &self.directions[index];
                let sign = if upper { 1.0 } else { -1.0 };
                let right = sign * (limit.end(upper) - limit.value(&frame.base)) / (frame.unit * norm);
                program.below.push(row(&(direction * sign), 0.0, right));
            }
        }
        for &(at, positive) in &working.samples {
            // e - q'w <= level, or the negative of the left side.
            let sign = if positive { 1.0 } else { -1.0 };
            let direction = self.spread.tr_mul(&self.samples.regressor(at)) * -sign;
            let residual = sign * frame.residuals[at] / frame.unit;
            let (level, fixed) = if leveled { (1.0, 0.0) } else { (0.0, bound.unwrap_or(0.0) / frame.unit) };
            program.below.push(row(&direction, level, fixed - residual));
        }
        let axis = |index: usize, sign: f64| {
            let mut axis = DVector::zeros(variables);
            axis[index] = sign;
            axis
        };
        if leveled {
            program.below.push(Row { coefficients: axis(size, -1.0), right: 0.0 });
            if let Some(bound) = bound.filter(|_| working.bounded) {
                program.below.push(Row { coefficients: axis(size, 1.0), right: bound / frame.unit });
            }
        }
        if let Some(radius) = radius {
            for index in 0..size {
                for sign in [1.0, -1.0] {
                    program.below.push(Row { coefficients: axis(index, sign), right: radius });
                }
            }
        }
        program
    }

    /// What a norm and the ridge add to a program, in units of the residuals.
    fn add_goal(&self, program: &mut Program, frame: &Frame, working: &Working, norm: Norm) {
        let (size, count) = (self.sizes.len(), self.samples.count() as f64);
        if norm == Norm::Two {
            // The factor holds the ridge, and rows that the limits keep constant. With a bound on |e| the optimum may
            // be far from least squares, compared with how far w can go: then its value is scaled to that.
            let way = self.way(&frame.base) / frame.unit;
            let scale = way.norm().max(1.0);
            program.hessian.fill_diagonal(1.0 / scale);
            program.gradient.copy_from(&(way / scale));
            return;
        }
        if norm == Norm::Infinity {
            program.gradient[size] = 1.0;
        } else {
            self.add_deviations(program, frame, working);
        }
        if self.ridge > 0.0 {
            let samples = if norm == Norm::Infinity { count } else { 1.0 };
            let weight = 2.0 * self.ridge / (samples * self.target());
            let sized = DMatrix::from_diagonal(&self.sizes) * &self.spread;
            let curvature = sized.tr_mul(&sized) * (weight * frame.unit);
            program.hessian.view_mut((0, 0), (size, size)).copy_from(&curvature);
            let slope = sized.tr_mul(&self.sizes.component_mul(&frame.base)) * weight;
            let mut gradient = program.gradient.rows_mut(0, size);
            gradient += slope;
        }
    }

    /// The terms of sum |e|.
    fn add_deviations(&self, program: &mut Program, frame: &Frame, working: &Working) {
        let alone = |at: usize| {
            let coefficients = self.spread.tr_mul(&self.samples.regressor(at));
            (1.0, Row { coefficients, right: frame.residuals[at] / frame.unit })
        };
        let Some(signs) = &working.signs else {
            program.deviations.extend((0..self.samples.count()).map(alone));
            return;
        };
        program.deviations.extend((0..signs.len()).filter(|at| signs[*at] == 0.0).map(alone));
        for sign in [1.0, -1.0] {
            let members = || signs.iter().zip(&frame.residuals).filter(|(own, _)| **own == sign);
            let count = members().count() as f64;
            if count > 0.0 {
                let sum: f64 = members().map(|(_, residual)| residual).sum();
                let coefficients = self.spread.tr_mul(&self.samples.sum(|at| signs[at] == sign)) / count;
                program.deviations.push((count, Row { coefficients, right: sum / (frame.unit * count) }));
            }
        }
    }
}
