//! Estimates with and without a constant from normal equations alone, in twice the precision: the rows are gone.
//!
//! A column of ones is among those whose products were summed, so that the constant, what it is worth, and the
//! uncertainty of an offset that was subtracted before the fit follow as they do from a record.

use thetahat_numerics::regression::{Column, ExtendedGram};

use super::super::impulse_response::of_products;
use super::super::{Estimate, Initial, Kernel, arx};
use super::worth::is_worth;
use super::{Beside, Constant, Fitted, wanted};
use crate::Error;
use crate::model::{OffsetCovariance, Orders};

/// Where y(t) stands.
const TARGET: usize = 1;

/// A linear model, and the sums of products of its signals less their offsets.
#[derive(Debug)]
pub(crate) struct LinearProblem<'a> {
    pub(crate) orders: &'a Orders,
    pub(crate) sample_time: f64,
    /// Of an impulse response that is regularised.
    pub(crate) kernel: Option<Kernel>,
    pub(crate) products: ExtendedGram,
}

impl LinearProblem<'_> {
    /// # Errors
    /// As for [`Task::fit`](super::Task::fit).
    pub(crate) fn fit(&self, constant: Constant) -> Result<Fitted, Error> {
        let plain = || {
            let estimate = self.estimate(false)?;
            Ok(Fitted { criteria: estimate.criteria(), estimate, offset: None, open: None })
        };
        let with = || Ok(self.beside().apart(self.orders, self.estimate(true)?));
        match constant {
            Constant::Yes => wanted(with(), plain),
            Constant::No => plain(),
            Constant::Auto if self.kernel.is_some() => match self.estimate(true) {
                Ok(all) if self.is_certain(&all) => {
                    self.beside().apart(self.orders, all).map_or_else(plain, Ok)
                }
                _ => plain(),
            },
            Constant::Auto => {
                let without = plain()?;
                Ok(match with() {
                    Ok(Some(with)) if is_worth(&without.estimate, &with.estimate, 1.0) => with,
                    _ => without,
                })
            }
        }
    }

    /// What an estimate without a constant leaves open of the offset that was taken: see
    /// [`Task::left_open`](super::Task::left_open).
    pub(crate) fn left_open(&self, without: &Estimate) -> Option<OffsetCovariance> {
        if without.noise_variance() <= 0.0 {
            return None;
        }
        let (beside, all) = (self.beside(), self.estimate(true).ok()?);
        // Least squares has its covariance with the variance of its own errors.
        let share = if self.kernel.is_some() { 1.0 } else { without.noise_variance() / all.noise_variance() };
        let scaled = |row: &Vec<f64>| row.iter().map(|entry| share * entry).collect();
        let rows: Vec<Vec<f64>> = all.covariance()?.iter().map(scaled).collect();
        let from = beside.with_zeros(self.orders, without.parameters());
        let step: Vec<f64> = all.parameters().iter().zip(from).map(|(to, from)| to - from).collect();
        beside.open(self.orders, &rows, &step, [0.0; 2])
    }

    /// The root of the sum of squares of y about its mean.
    pub(crate) fn output_spread(&self) -> f64 {
        self.products.spread(TARGET).sqrt()
    }

    fn beside(&self) -> Beside {
        Beside::constant(0, self.sample_time)
    }

    fn columns(&self) -> Vec<Column> {
        ExtendedGram::columns(&arx::taps(self.orders))
    }

    /// All parameters, with that of the column of ones after them.
    fn estimate(&self, constant: bool) -> Result<Estimate, Error> {
        let (mut orders, mut columns) = (self.orders.clone(), self.columns());
        if constant {
            orders = orders.with_constants(1);
            columns.push((0, 1.0));
        }
        let samples = self.products.rows();
        arx::enough(samples, &orders)?;
        if let Some(kernel) = self.kernel {
            let (products, inputs) = (self.products.plain(&columns, TARGET), self.orders.inputs());
            return of_products(products, samples, inputs, &orders, Initial::Drop, kernel);
        }
        let solved = self.products.solve(&columns, TARGET).map_err(|why| arx::unsolved(why, &orders))?;
        Estimate::of_regression(solved, samples, Initial::Drop)
    }

    /// Whether the constant is worth it by its own error, where no sum of squares is least.
    fn is_certain(&self, all: &Estimate) -> bool {
        let place = self.beside().places(self.orders).start;
        let variance = all.covariance().map(|covariance| covariance[place][place]);
        variance
            .is_some_and(|variance| all.parameters()[place].powi(2) / variance > (all.samples() as f64).ln())
    }
}
