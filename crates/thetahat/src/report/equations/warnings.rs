//! What a careful reader of a fit of a model in equations should know, in plain words.

use thetahat_numerics::optimize::Stopped;

use crate::estimate::equations::listed;
use crate::figures::{chance, fixed};
use crate::model::{EquationsModel, GreyBox};
use crate::report::schema::Estimation;
use crate::respond::{
    OnLog, Tested,
    equations::{EquationsOnLog, Experiment},
};
use crate::validate::Test;

/// Mean nis, relative to what is expected, outside of this range: the noises of the model are not those of the log.
const FITTING: std::ops::RangeInclusive<f64> = 0.8..=1.25;
/// Parameters whose correlation is beyond this one can hardly be told apart, if one of them has a standard error above
/// this fraction of its value: else both are known well all the same.
const ALIKE: f64 = 0.99;
const BLURRED: f64 = 0.05;
/// Innovations are called coloured below this p-value.
const COLOURED: f64 = 0.01;

/// Of values that inputs miss.
pub(super) fn of_inputs(model: &GreyBox, experiments: &[Experiment], rows: usize) -> Vec<String> {
    let each = model.inputs().iter().enumerate().filter_map(|(position, input)| {
        let held: usize = experiments.iter().map(|experiment| experiment.held[position]).sum();
        (held > 0).then(|| {
            format!("channel '{input}' misses {held} of {rows} values; the value before each was held")
        })
    });
    each.collect()
}

/// Of the search and what it found. `walking` are the parameters that the model lets drift.
pub(super) fn of_fit(model: &EquationsModel, estimation: &Estimation, walking: &[String]) -> Vec<String> {
    let mut warnings = Vec::new();
    let Some(outcome) = estimation.procedure.equations() else { return warnings };
    match outcome.search.stopped {
        Stopped::Converged => {}
        Stopped::NoDescent => warnings.push(
            "the search stopped as no step, however short, raises the likelihood: the parameters may not be the best ones; \
             try other starts"
                .to_owned(),
        ),
        Stopped::MaxIterations | Stopped::TimeLimit => warnings.push(format!(
            "the search stopped after {} iterations, before it had converged; give start values that are closer, or allow more",
            outcome.search.iterations
        )),
    }
    let vanishing = model.parameters.iter().zip(&outcome.unknown);
    let vanishing =
        vanishing.filter(|(own, known)| own.standard_error.is_none() && known.min == Some(own.value));
    let vanishing: Vec<String> = vanishing.map(|(own, _)| own.name.clone()).collect();
    if !vanishing.is_empty() {
        warnings.push(format!(
            "the log shows no sign of {}: the likelihood is largest without, at the lower bound, where there is no standard error",
            listed(&vanishing)
        ));
    }
    let deviation = |index: usize| model.parameters[index].standard_error.unwrap_or(f64::NAN);
    for (index, (parameter, known)) in model.parameters.iter().zip(&outcome.unknown).enumerate() {
        for bound in [known.min, known.max].into_iter().flatten() {
            if (parameter.value - bound).abs() < deviation(index) {
                warnings.push(format!(
                    "'{}' is within its standard error of its bound {bound}: there the standard error says little; take it \
                     as known, or move the bound",
                    parameter.name
                ));
            }
        }
    }
    for (i, row) in model.covariance.iter().flatten().enumerate() {
        for (j, covariance) in row.iter().enumerate().take(i) {
            let correlation = covariance / (deviation(i) * deviation(j));
            let is_blurred = |index: &usize| {
                let value = model.parameters[*index].value;
                deviation(*index) > BLURRED * value.abs()
            };
            if correlation.abs() > ALIKE && [j, i].iter().any(is_blurred) {
                let names = [j, i].map(|index| model.parameters[index].name.clone());
                warnings.push(format!(
                    "the log can hardly tell {} apart (correlation {}): take one of them as known, or measure more",
                    listed(&names),
                    fixed(correlation, 4)
                ));
            }
        }
    }
    if let Some(nis) = outcome.nis.filter(|nis| nis.relative() > *FITTING.end()) {
        warnings.push(format!(
            "innovations are larger than the model tells: the mean nis is {}, not {}. Standard errors were multiplied by {}; \
             give larger noises, or equations that fit better",
            fixed(nis.mean, 3),
            fixed(nis.expected, 3),
            fixed(outcome.covariance_factor.sqrt(), 3)
        ));
    }
    if let Some(nis) = outcome.nis.filter(|nis| nis.relative() < *FITTING.start()) {
        warnings.push(format!(
            "innovations are smaller than the model tells: the mean nis is {}, not {}, so standard errors are too large; \
             give smaller noises",
            fixed(nis.mean, 3),
            fixed(nis.expected, 3)
        ));
    }
    if !walking.is_empty() {
        warnings.push(format!("{}: taken as constant by the fit, whatever the walk", listed(walking)));
    }
    warnings
}

/// Of innovations that are not white, by a test.
pub(super) fn of_colour(
    own: &EquationsOnLog<'_>,
    whiteness: impl Fn(&Tested<'_>) -> Option<Test>,
) -> Vec<String> {
    let each = own.tested().unwrap_or_default();
    let coloured = each.iter().zip(own.outputs()).filter_map(|(tested, output)| {
        let p_value = whiteness(tested)?.p_value.filter(|p_value| *p_value < COLOURED)?;
        Some(format!(
            "the innovations of '{}' are not white (p-value {}): the equations or the noises lack something, and \
             standard errors are too small",
            output.name,
            chance(p_value)
        ))
    });
    coloured.collect()
}
