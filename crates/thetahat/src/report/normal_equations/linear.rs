//! The model of polynomials that normal equations hold.

use super::super::fitted_rows::estimation_start;
use super::super::identify::{ROUNDING, constant, estimation_of};
use super::super::schema::Report;
use super::super::warnings::warnings;
use super::NormalEquations;
use crate::data::Offset;
use crate::estimate::{Fitted, Kernel, LinearProblem, out_of_range, taps};
use crate::model::{Orders, Signal};
use crate::{Document, Error};

/// With the offsets of all pieces, and a constant where it is worth its parameter.
pub(super) fn solve(
    sums: &NormalEquations,
    orders: &Orders,
    kernel: Option<Kernel>,
) -> Result<Report, Error> {
    let names = sums.settings.names();
    let offsets = (0..names.len())
        .map(|channel| {
            let level = sums.offset(channel)?;
            let input = (channel < orders.inputs()).then_some(channel);
            let used = input.is_none_or(|input| orders.nb[input] > 0);
            let [least, largest] = sums.range(channel)?;
            let size = |least: f64, largest: f64| least.abs().max(largest.abs());
            if used && size(least - level, largest - level) <= ROUNDING * size(least, largest) {
                return Err(constant(names[channel], input, Some(orders), false));
            }
            Ok(level)
        })
        .collect::<Result<Vec<_>, Error>>()?;
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
    let Fitted { estimate, offset, open, .. } = &fitted;
    let level = |level: f64| Offset { level, slope: 0.0 };
    let signal = |(name, offset): (&&str, &f64)| Signal { name: (*name).to_owned(), offset: level(*offset) };
    let found = offset.map_or(0.0, |found| found.offset.level);
    let signals = names.iter().zip(of_inputs).map(signal).collect();
    let mut model = estimate.to_model(orders, sums.sample_time, signals, signal((&output, taken)))?;
    model.offset_covariance.clone_from(open);
    model.output.offset.level = taken + found;
    let mut report = Report {
        schema: Report::SCHEMA.to_owned(),
        generator: concat!("thetahat ", env!("CARGO_PKG_VERSION")).to_owned(),
        data: sums.data(),
        selection: None,
        estimation: estimation_of(&fitted, level(*taken)),
        fit: Vec::new(),
        warnings: Vec::new(),
        model: model.clone().into(),
    };
    report.warnings = warnings(&report, &model);
    let start = estimation_start(&report, &model);
    let errors = (estimate.samples(), estimate.mse());
    report.fit.push(sums.one_step(output, errors, problem.output_spread(), start));
    Ok(report)
}
