//! What a careful reader of a report should know, in plain words.

use super::document::GreyReport;
use super::uncertainty::listed;
use crate::Stopped;
use crate::figures::{chance, fixed};

/// Mean nis, relative to what is expected, outside of this range: the noises of the model are not those of the log.
const FITTING: std::ops::RangeInclusive<f64> = 0.8..=1.25;
/// Parameters whose correlation is beyond this one can hardly be told apart.
const ALIKE: f64 = 0.99;
/// Innovations are called coloured below this p-value.
const COLOURED: f64 = 0.01;

/// Of everything in the report. `walking` are the parameters that the model lets drift.
pub(super) fn warnings(report: &GreyReport, walking: &[String]) -> Vec<String> {
    let mut warnings = Vec::new();
    match report.search.stopped {
        Stopped::Converged => {}
        Stopped::NoDescent => warnings.push(
            "the search stopped as no step, however short, raises the likelihood: the parameters may not be the best ones; \
             try other start values"
                .to_owned(),
        ),
        Stopped::MaxIterations | Stopped::TimeLimit => warnings.push(format!(
            "the search stopped after {} iterations, before it had converged; give start values that are closer",
            report.search.iterations
        )),
    }
    for parameter in &report.parameters {
        for bound in [parameter.min, parameter.max].into_iter().flatten() {
            if (parameter.value - bound).abs() < parameter.standard_error {
                warnings.push(format!(
                    "'{}' is within its standard error of its bound {bound}: there the standard error says little; take it \
                     as known, or move the bound",
                    parameter.name
                ));
            }
        }
    }
    let deviations: Vec<f64> = report.parameters.iter().map(|parameter| parameter.standard_error).collect();
    for (i, row) in report.covariance.iter().enumerate() {
        for (j, covariance) in row.iter().enumerate().take(i) {
            let correlation = covariance / (deviations[i] * deviations[j]);
            if correlation.abs() > ALIKE {
                let names = [j, i].map(|index| report.parameters[index].name.clone());
                warnings.push(format!(
                    "the log can hardly tell {} apart (correlation {}): take one of them as known, or measure more",
                    listed(&names),
                    fixed(correlation, 4)
                ));
            }
        }
    }
    if let Some(nis) = report.nis.filter(|nis| nis.relative() > *FITTING.end()) {
        warnings.push(format!(
            "innovations are larger than the model tells: the mean nis is {}, not {}. Standard errors were multiplied by {}; \
             give larger noises, or equations that fit better",
            fixed(nis.mean, 3),
            fixed(nis.expected, 3),
            fixed(report.covariance_factor.sqrt(), 3)
        ));
    }
    if let Some(nis) = report.nis.filter(|nis| nis.relative() < *FITTING.start()) {
        warnings.push(format!(
            "innovations are smaller than the model tells: the mean nis is {}, not {}, so standard errors are too large; \
             give smaller noises",
            fixed(nis.mean, 3),
            fixed(nis.expected, 3)
        ));
    }
    for output in &report.outputs {
        let test = output.whiteness.as_ref();
        if let Some(p_value) = test.and_then(|test| test.p_value).filter(|p_value| *p_value < COLOURED) {
            warnings.push(format!(
                "the innovations of '{}' are not white (p-value {}): the equations or the noises lack something, and \
                 standard errors are too small",
                output.channel,
                chance(p_value)
            ));
        }
        if output.free_run.is_none() && output.readings > 0 {
            warnings.push(format!("the free run of '{}' grows out of the range of numbers", output.channel));
        }
    }
    if !walking.is_empty() {
        warnings.push(format!("{}: taken as constant by the fit, whatever the walk", listed(walking)));
    }
    warnings
}
