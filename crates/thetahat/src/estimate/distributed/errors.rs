//! Prediction errors of which the sums come from those who hold the data.

use std::ops::Range;

use thetahat_core::LeastSquares;
use thetahat_core::nalgebra::{DMatrix, DVector, Dyn};
use thetahat_numerics::optimize::Objective;

use super::message::{AboutErrors, Asked, Factor, Found, ModelErrors, Point, Sums};
use super::{Distributed, Holders};
use crate::estimate::experiment_data::PredictionErrors;
use crate::estimate::polynomials::{Polynomials, Unusable};
use crate::estimate::predictor::InitialCondition;
use crate::estimate::stability_boundary::StabilityBoundary;
use crate::estimate::uncertainty::{Autoregression, ErrorProducts, HIGHEST};
use crate::model::Orders;

/// The prediction errors of experiments that others hold.
pub(crate) struct DistributedErrors<'e> {
    holders: &'e Holders<'e>,
    model: ModelErrors,
    samples: usize,
    /// Of each holder, the initial conditions of its experiments.
    conditions: Vec<Vec<usize>>,
    polynomials: Polynomials,
    stability: Vec<f64>,
    stability_boundary: StabilityBoundary,
    /// Where the errors were evaluated last, and what the holders said.
    parameters: Vec<f64>,
    evaluated: Vec<Vec<f64>>,
    last: Vec<Sums>,
    /// The weights to be tried next, and those of the current point.
    trial: Vec<Vec<f64>>,
    free: Vec<Vec<f64>>,
    free_steps: Vec<Vec<f64>>,
    matrix: Vec<f64>,
    right: Vec<f64>,
    diagonal: Vec<f64>,
}

impl<'e> DistributedErrors<'e> {
    pub(super) fn new(data: &'e Distributed<'_>, orders: &Orders, begin: InitialCondition) -> Self {
        let (holders, parameters) = (data.holders, orders.parameters());
        let model = ModelErrors { orders: orders.clone(), begin, constants: data.constants };
        let sizes = holders.answers(
            |_| Asked::Errors(model.clone(), AboutErrors::Size),
            |found| if let Found::Size { samples, free, .. } = found { Some((samples, free)) } else { None },
        );
        let (samples, conditions): (Vec<usize>, Vec<Vec<usize>>) =
            sizes.unwrap_or_default().into_iter().unzip();
        let zeros: Vec<Vec<f64>> = conditions.iter().map(|own| vec![0.0; own.iter().sum()]).collect();
        Self {
            holders,
            model,
            samples: samples.iter().sum(),
            polynomials: Polynomials::new(orders, &vec![0.0; parameters]),
            stability: Vec::new(),
            stability_boundary: StabilityBoundary::new(orders, false),
            parameters: vec![0.0; parameters],
            evaluated: zeros.clone(),
            last: Vec::new(),
            trial: zeros.clone(),
            free_steps: zeros.iter().map(|own| vec![0.0; own.len() * (parameters + 1)]).collect(),
            free: zeros,
            conditions,
            matrix: vec![0.0; parameters * parameters],
            right: vec![0.0; parameters],
            diagonal: vec![0.0; parameters],
        }
    }

    /// Answers about the errors where they were evaluated last.
    fn about<T>(
        &self,
        about: impl Fn(Point) -> AboutErrors,
        read: impl Fn(Found) -> Option<T>,
    ) -> Option<Vec<T>> {
        let point = |holder: usize| Point {
            parameters: self.parameters.clone(),
            free: self.evaluated.get(holder).cloned().unwrap_or_default(),
        };
        self.holders.answers(|holder| Asked::Errors(self.model.clone(), about(point(holder))), read)
    }

    fn products(&self, order: usize) -> Option<ErrorProducts> {
        let found = self.about(
            |at| AboutErrors::Autoregression(at, order),
            |found| if let Found::Autoregression(own) = found { Some(own) } else { None },
        )?;
        let mut found = found.into_iter();
        let mut sum = found.next()??;
        for own in found {
            sum.add(&own?);
        }
        Some(sum)
    }
}

impl Objective for DistributedErrors<'_> {
    type Refusal = Unusable;

    fn samples(&self) -> usize {
        self.samples
    }

    fn initial_conditions(&self) -> usize {
        self.conditions.iter().flatten().sum()
    }

    fn linear(&self) -> Range<usize> {
        let orders = &self.model.orders;
        0..orders.na + orders.nb.iter().sum::<usize>()
    }

    fn restart(&mut self) {
        self.free.iter_mut().chain(&mut self.trial).for_each(|own| own.fill(0.0));
    }

    fn evaluate(&mut self, parameters: &[f64]) -> Result<f64, Unusable> {
        self.polynomials.set(parameters);
        if !self.polynomials.are_stable(&mut self.stability) {
            return Err(Unusable::Unstable);
        }
        self.parameters.copy_from_slice(parameters);
        self.evaluated.clone_from(&self.trial);
        let sums = self.about(AboutErrors::Sums, |found| match found {
            Found::Sums(sums) => Some(sums),
            _ => None,
        });
        let sums: Option<Vec<Sums>> = sums.and_then(|sums| sums.into_iter().collect());
        self.last = sums.ok_or(Unusable::Overflow)?;
        let cost: f64 = self.last.iter().map(|sums| sums.cost).sum();
        if cost.is_finite() { Ok(cost) } else { Err(Unusable::Overflow) }
    }

    fn linearize(&mut self) -> Result<f64, Unusable> {
        self.free.clone_from(&self.trial);
        self.matrix.fill(0.0);
        self.right.fill(0.0);
        self.diagonal.fill(0.0);
        let mut gain = 0.0;
        for (sums, steps) in self.last.iter().zip(&mut self.free_steps) {
            let add =
                |all: &mut [f64], own: &[f64]| all.iter_mut().zip(own).for_each(|(all, own)| *all += own);
            add(&mut self.matrix, &sums.matrix);
            add(&mut self.right, &sums.right);
            add(&mut self.diagonal, &sums.diagonal);
            steps.clone_from(&sums.free_steps);
            gain += sums.free_gain;
        }
        Ok(gain)
    }

    fn try_free(&mut self, step: &[f64]) {
        let parameters = self.right.len();
        let holders = self.conditions.iter().zip(&mut self.trial).zip(self.free.iter().zip(&self.free_steps));
        for ((conditions, trial), (free, steps)) in holders {
            let (mut first, mut steps) = (0, steps.as_slice());
            for &count in conditions {
                let (own, rest) = steps.split_at(count * (parameters + 1));
                steps = rest;
                for index in 0..count {
                    let moved = step.iter().enumerate().map(|(k, step)| step * own[(k + 1) * count + index]);
                    trial[first + index] = free[first + index] + own[index] - moved.sum::<f64>();
                }
                first += count;
            }
        }
    }

    fn keep_free(&mut self) {
        self.trial.clone_from(&self.free);
    }

    fn matrix(&self) -> &[f64] {
        &self.matrix
    }

    fn right(&self) -> &[f64] {
        &self.right
    }

    fn is_outside(refusal: &Unusable) -> bool {
        *refusal == Unusable::Unstable
    }

    fn draw_in(&mut self, from: &[f64], trial: &mut [f64]) -> bool {
        self.stability_boundary.draw_in(from, trial)
    }
}

impl PredictionErrors for DistributedErrors<'_> {
    fn cancellation(&self) -> f64 {
        let size = self.right.len();
        let ratio = |k: usize| self.diagonal[k] / self.matrix[k * size + k];
        (0..size).map(ratio).fold(1.0, f64::max).sqrt()
    }

    fn factor(&self) -> Option<LeastSquares<f64, Dyn>> {
        let size = self.right.len();
        let found = self.about(AboutErrors::Factor, |found| match found {
            Found::Factor(factor) => Some(factor),
            _ => None,
        })?;
        let mut whole = LeastSquares::with_size(Dyn(size));
        for own in found {
            let Factor { triangle, rotated, residual_norm, rows } = own?;
            if triangle.len() != size * size || rotated.len() != size {
                return None;
            }
            let triangle = DMatrix::from_row_slice(size, size, &triangle);
            let own = LeastSquares::from_factor(&triangle, &DVector::from_vec(rotated), residual_norm, rows);
            whole.merge(&own.ok()?).ok()?;
        }
        Some(whole)
    }

    fn autoregression(&self, taken: usize) -> Option<Autoregression> {
        let mut found = self.products(HIGHEST)?;
        let highest = found.highest(taken);
        if highest < HIGHEST {
            found = self.products(highest)?;
        }
        Some(found.autoregression(taken))
    }

    /// That of the errors that are left: of so many samples what the fit has taken is nothing.
    fn restricted_autoregression(&self, taken: usize) -> Option<Autoregression> {
        self.autoregression(taken)
    }

    fn backward_filtered_products(&self, weights: &DMatrix<f64>, monic: &[f64]) -> Option<DMatrix<f64>> {
        let size = weights.nrows();
        let rows: Vec<Vec<f64>> = weights.row_iter().map(|row| row.iter().copied().collect()).collect();
        let found = self.about(
            |at| AboutErrors::Filtered { at, weights: rows.clone(), monic: monic.to_vec() },
            |found| if let Found::Filtered(own) = found { Some(own) } else { None },
        )?;
        let mut sum = DMatrix::zeros(size, size);
        for own in found {
            let own = own?;
            if own.len() != size || own.iter().any(|row| row.len() != size) {
                return None;
            }
            sum += DMatrix::from_fn(size, size, |i, j| own[i][j]);
        }
        Some(sum)
    }
}
