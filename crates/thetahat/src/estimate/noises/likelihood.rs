//! The likelihood of a linear model as a function of its noises.

use std::f64::consts::TAU;

use thetahat_core::{Dual, Number};

use super::array::{ArrayFilter, Plant};
use super::{Noises, Rows};
use crate::estimate::equations::{LANE, Likelihood, Slopes};
use crate::model::equations::Scale;
use crate::respond::equations::Failure;

/// V of a plant on some logs, see [`Likelihood`], with the memory that it takes.
#[derive(Debug)]
pub(super) struct NoiseLikelihood<'a> {
    plant: &'a Plant,
    noises: &'a Noises,
    logs: &'a [Rows],
    measurements: usize,
    plain: ArrayFilter<f64>,
    lanes: Vec<ArrayFilter<Dual<f64, LANE>>>,
    /// e_i and S_i of each element of a row.
    error_slopes: Vec<f64>,
    variance_slopes: Vec<f64>,
    slopes: Slopes,
}

impl<'a> NoiseLikelihood<'a> {
    pub(super) fn new(plant: &'a Plant, noises: &'a Noises, logs: &'a [Rows]) -> Self {
        let (size, outputs) = (noises.unknown.len(), plant.h.nrows());
        let measured = |log: &Rows| log.outputs.iter().filter(|value| !value.is_nan()).count();
        Self {
            plant,
            noises,
            logs,
            measurements: logs.iter().map(measured).sum(),
            plain: ArrayFilter::new(plant, noises.columns),
            lanes: vec![ArrayFilter::new(plant, noises.columns); size.div_ceil(LANE)],
            error_slopes: vec![0.0; outputs * size],
            variance_slopes: vec![0.0; outputs * size],
            slopes: Slopes::zero(size),
        }
    }
}

impl Noises {
    /// L, row after row, at these variables.
    fn factor<S: Number<f64>>(&self, z: &[S]) -> Vec<S> {
        let mut factor = vec![S::from(0.0); self.rows * self.columns];
        for entry in &self.entries {
            let z = z[entry.parameter];
            // No noise has another scale.
            let value = if self.unknown[entry.parameter].scale == Scale::Free { z } else { z.exp() };
            factor[entry.row * self.columns + entry.column] += value * entry.weight;
        }
        factor
    }
}

/// A filter along a row and the steps to the next one, over which inputs are held.
fn advance<S: Number<f64>>(
    filter: &mut ArrayFilter<S>,
    (plant, noise): (&Plant, &[S]),
    (log, row): (&Rows, usize),
    told: impl FnMut(S, S),
) -> Option<()> {
    let inputs = log.input(row, plant.g.ncols());
    filter.step(plant, noise, inputs, log.output(row, plant.h.nrows()), told)?;
    for _ in 1..log.steps.get(row + 1).copied().unwrap_or(1) {
        filter.step(plant, noise, inputs, &log.nothing, |_, _| {})?;
    }
    Some(())
}

impl Likelihood for NoiseLikelihood<'_> {
    fn measurements(&self) -> usize {
        self.measurements
    }

    fn evaluate(&mut self, z: &[f64]) -> Result<f64, Failure> {
        let noise = self.noises.factor(z);
        let mut sum = 0.0;
        for (index, log) in self.logs.iter().enumerate() {
            self.plain.restart(self.plant);
            for row in 0..log.steps.len() {
                advance(&mut self.plain, (self.plant, &noise), (log, row), |error, variance| {
                    sum += error * error / variance + (TAU * variance).ln();
                })
                .ok_or(Failure { log: index, row })?;
            }
        }
        Ok(sum / 2.0)
    }

    fn linearize(&mut self, z: &[f64]) -> Result<(), Failure> {
        let size = z.len();
        let noise: Vec<Vec<Dual<f64, LANE>>> = (0..self.lanes.len())
            .map(|lane| {
                let variable = |(index, &value): (usize, &f64)| {
                    let mut variable = Dual::from(value);
                    if index / LANE == lane {
                        variable.derivatives[index % LANE] = 1.0;
                    }
                    variable
                };
                self.noises.factor(&z.iter().enumerate().map(variable).collect::<Vec<_>>())
            })
            .collect();
        self.slopes.clear();
        let outputs = self.plant.h.nrows();
        let mut values = vec![(0.0, 0.0); outputs];
        for (index, log) in self.logs.iter().enumerate() {
            self.lanes.iter_mut().for_each(|lane| lane.restart(self.plant));
            for row in 0..log.steps.len() {
                let failure = Failure { log: index, row };
                let mut elements = 0;
                for (place, (filter, noise)) in self.lanes.iter_mut().zip(&noise).enumerate() {
                    elements = 0;
                    advance(filter, (self.plant, noise), (log, row), |error, variance| {
                        values[elements] = (error.value, variance.value);
                        let first = elements * size + place * LANE;
                        let own = first..(first + LANE).min((elements + 1) * size);
                        let count = own.len();
                        self.error_slopes[own.clone()].copy_from_slice(&error.derivatives[..count]);
                        self.variance_slopes[own].copy_from_slice(&variance.derivatives[..count]);
                        elements += 1;
                    })
                    .ok_or(failure)?;
                }
                for (element, &(error, variance)) in values[..elements].iter().enumerate() {
                    let own = element * size..(element + 1) * size;
                    let by = (&self.error_slopes[own.clone()], &self.variance_slopes[own]);
                    self.slopes.take((error, variance), by);
                }
                if !self.slopes.is_finite() {
                    return Err(failure);
                }
            }
        }
        self.slopes.mirror();
        Ok(())
    }

    fn slopes(&self) -> &Slopes {
        &self.slopes
    }
}
