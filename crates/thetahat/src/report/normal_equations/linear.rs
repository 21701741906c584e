//! The model of polynomials that normal equations hold.

use super::super::from_sums::report_of;
use super::super::schema::Report;
use super::NormalEquations;
use crate::Error;
use crate::estimate::{Kernel, LinearProblem, out_of_range, taps};
use crate::model::Orders;

/// With the offsets of all pieces, and a constant where it is worth its parameter.
pub(super) fn solve(
    sums: &NormalEquations,
    orders: &Orders,
    kernel: Option<Kernel>,
) -> Result<Report, Error> {
    let names = sums.settings.names();
    let offsets = names.iter().enumerate().map(|(channel, name)| {
        let input = (channel < orders.inputs()).then_some(channel);
        sums.range(channel)?;
        let level = sums.channels[channel].level(name, sums.settings.told_offset(name), input, orders);
        level.unwrap_or(Ok(0.0))
    });
    let offsets = offsets.collect::<Result<Vec<_>, Error>>()?;
    // y is the first signal of a regression.
    let (taken, of_inputs) = offsets.split_last().ok_or_else(|| Error::data("there is no output"))?;
    let of_signals: Vec<f64> = std::iter::once(taken).chain(of_inputs).copied().collect();
    let products = sums.products.less(&taps(orders), &of_signals);
    if !products.is_in_range() {
        return Err(out_of_range());
    }
    let problem = LinearProblem { orders, sample_time: sums.sample_time, kernel, products };
    let mut fitted = problem.fit(sums.settings.constant)?;
    let output = names[names.len() - 1];
    if fitted.offset.is_none() && sums.settings.told_offset(output).is_none() {
        fitted.open = problem.left_open(&fitted.estimate);
    }
    report_of(sums.data(), &fitted, orders, (&names, &offsets), problem.output_spread())
}
