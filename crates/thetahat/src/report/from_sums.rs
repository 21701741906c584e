//! Reports of fits to sums over data that are not read a second time.

use super::fitted_rows::estimation_start;
use super::identify::estimation_of;
use super::schema::{Data, Report};
use super::warnings::warnings;
use crate::Error;
use crate::data::{Offset, Rows};
use crate::estimate::Fitted;
use crate::model::{Orders, Signal};
use crate::respond::{Horizon, InitialCondition};
use crate::validate::{Fit, Part};

/// That of a model of polynomials of some channels, the inputs first, less their offsets. `spread` is the root of the
/// sum of squares of the output about its mean, over the samples that count.
pub(super) fn report_of(
    data: Data,
    fitted: &Fitted,
    orders: &Orders,
    (names, offsets): (&[&str], &[f64]),
    spread: f64,
) -> Result<Report, Error> {
    let Fitted { estimate, offset, open, .. } = fitted;
    let level = |level: f64| Offset { level, slope: 0.0 };
    let signal = |(name, offset): (&&str, &f64)| Signal { name: (*name).to_owned(), offset: level(*offset) };
    let mut inputs: Vec<Signal> = names.iter().zip(offsets).map(signal).collect();
    let output = inputs.pop().ok_or_else(|| Error::data("there is no output"))?;
    let taken = output.offset;
    let mut model = estimate.to_model(orders, data.sample_time, inputs, output)?;
    model.offset_covariance.clone_from(open);
    model.output.offset.level = taken.level + offset.map_or(0.0, |found| found.offset.level);
    let mut report = Report::new(data, model.clone(), estimation_of(fitted, taken));
    report.warnings = warnings(&report, &model);
    let (start, errors) = (estimation_start(&report, &model), (estimate.samples(), estimate.mse()));
    report.fit.push(one_step(&model.output.name, &report.data.estimation, errors, spread, start));
    Ok(report.with_purpose())
}

/// The figures one step ahead of an output with this norm about its mean, of errors with this mean square.
pub(super) fn one_step(
    output: &str,
    rows: &[Rows],
    (samples, mse): (usize, f64),
    spread: f64,
    initial: InitialCondition,
) -> Fit {
    let finite = |figure: f64| Some(figure).filter(|figure| figure.is_finite());
    Fit {
        output: output.to_owned(),
        rows: rows.to_vec(),
        part: Some(Part::Estimation),
        horizon: Horizon::ONE_STEP,
        initial,
        samples,
        percent: finite(100.0 * (1.0 - (mse * samples as f64).sqrt() / spread)),
        rmse: finite(mse.sqrt()),
        mean_absolute_error: None,
        largest_error: None,
        outside: None,
    }
}
