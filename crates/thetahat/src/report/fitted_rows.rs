//! The rows of a fit as the estimate saw them.

use super::schema::Report;
use crate::Error;
use crate::data::{Log, Record, Rows, digest, inside};
use crate::estimate::Initial;
use crate::model::{Orders, PolynomialModel};
use crate::respond::{Horizon, InitialCondition};

/// What the responses on the rows of the fit start from, as the estimate did.
pub(super) fn estimation_start(report: &Report, model: &PolynomialModel) -> InitialCondition {
    match report.estimation.initial {
        // Its filter begins with a covariance: predictions have none.
        _ if is_exact(report) => InitialCondition::natural(model, Horizon::Steps { steps: 1 }),
        Some(Initial::Zero) => InitialCondition::Zero,
        // Without F there is nothing to estimate, and C begins from e = 0 where it does in the fit.
        _ if !model.orders.is_linear() => InitialCondition::Estimate,
        _ => InitialCondition::Drop,
    }
}

/// The rows of the fit as the estimate saw them.
pub(super) fn estimation_record<'l>(
    report: &Report,
    model: &PolynomialModel,
    log: &'l Log,
    inputs: &[String],
) -> Result<Record<'l>, Error> {
    let (output, rows) = (&model.output.name, &report.data.estimation);
    if report.estimation.procedure.is_instrumental() {
        // They begin with their segments.
        let record = log.record(inputs, output, rows)?;
        return Ok(Record { past: vec![0; record.segments.len()], ..record });
    }
    let initial = report.estimation.initial.unwrap_or_default();
    if !is_exact(report) && goes_through(&model.orders, initial) {
        return log.driven_record(inputs, output, rows);
    }
    log.record(inputs, output, rows)
}

/// Whether an estimate of least squared errors goes on through missing outputs. From zeros, rows of least squares begin
/// anew.
pub(super) fn goes_through(orders: &Orders, initial: Initial) -> bool {
    !orders.needs_past_outputs() && (orders.has_f() || initial != Initial::Zero)
}

/// Whether the estimate is that of largest exact likelihood.
pub(super) fn is_exact(report: &Report) -> bool {
    report.estimation.procedure.exact_likelihood().is_some()
}

/// The rows of this log that the model was fitted to, by their digests.
pub(super) fn rows_of_fit(report: &Report, log: &Log) -> Result<Vec<Rows>, Error> {
    let data = &report.data;
    let names: Vec<&str> = report.model.channels().collect();
    if !names.iter().all(|name| log.has(name)) {
        return Ok(Vec::new());
    }
    let of_sources = data.logs.iter().map(|source| source.rows.positions());
    let whole = std::iter::once(0..data.rows);
    let parts: Vec<_> =
        if data.logs.len() == data.digests.len() { of_sources.collect() } else { whole.collect() };
    let channels: Vec<&[f64]> =
        names.iter().map(|name| Ok(log.channel(name)?.values.as_slice())).collect::<Result<_, Error>>()?;
    let mut found = Vec::new();
    for own in log.logs() {
        for (part, digests) in parts.iter().zip(&data.digests) {
            let rows = inside(&data.estimation, part);
            let Some(last) = rows.last() else { continue };
            let same = |(name, values): (&&str, &&[f64])| {
                digests.get(*name).is_some_and(|known| *known == digest(&values[own.clone()], &rows))
            };
            if last.end <= own.len() && names.iter().zip(&channels).all(same) {
                found.extend(
                    rows.iter()
                        .map(|rows| Rows::from_positions(&(rows.start + own.start..rows.end + own.start))),
                );
                break;
            }
        }
    }
    Ok(found)
}
