//! What a careful reader of a state-space fit should know.

use std::ops::RangeInclusive;

use thetahat_numerics::optimize::Stopped;

use crate::estimate::{RefinementOutcome, SubspaceOutcome, VectorArxOutcome, VectorArxScore};
use crate::figures::fixed;
use crate::model::StateSpaceModel;
use crate::report::Estimation;

/// Fewer values of the outputs for each free parameter say little.
const VALUES_A_PARAMETER: usize = 5;

/// Errors of two outputs are one where no more of their squared correlation is missing.
const TOGETHER: f64 = 1e-6;

/// Of a fit whose data offered such orders.
pub(super) fn of_fit(
    model: &StateSpaceModel,
    estimation: &Estimation,
    offered: &RangeInclusive<usize>,
) -> Vec<String> {
    let mut warnings = Vec::new();
    let outputs = model.outputs.len();
    let values = estimation.samples * outputs;
    if values < VALUES_A_PARAMETER * model.free_parameters {
        warnings.push(format!(
            "the model has {} free parameters, and there are {values} values of the outputs: they say little of it; give more rows, or \
             ask for lower orders",
            model.free_parameters
        ));
    }
    if let Some(outcome) = estimation.procedure.subspace() {
        of_subspace(&mut warnings, model, outcome, offered);
    }
    if let Some(outcome) = estimation.procedure.vector_arx() {
        of_arx(&mut warnings, outcome);
        if model.covariance.is_none() {
            warnings.push(
                "there are too many coefficients for a report to keep the covariance of all: they have standard errors, poles, gains \
                 and responses have none"
                    .to_owned(),
            );
        }
    }
    let noise = &model.noise_covariance;
    for (second, output) in model.outputs.iter().enumerate() {
        let same = |first: &usize| {
            let product = noise[*first][*first] * noise[second][second];
            product > 0.0 && noise[*first][second].powi(2) > (1.0 - TOGETHER) * product
        };
        if let Some(first) = (0..second).find(same) {
            warnings.push(format!(
                "'{}' is known from '{}': their errors are the same but for a factor; leave one out",
                output.name, model.outputs[first].name
            ));
        }
    }
    if !model.stable {
        let largest = model.poles.first().map_or(1.0, |pole| pole.re.hypot(pole.im));
        warnings.push(format!(
            "the model is unstable, its largest pole has modulus {}: free runs and responses grow without bound",
            fixed(largest, 4)
        ));
    }
    warnings
}

fn of_subspace(
    warnings: &mut Vec<String>,
    model: &StateSpaceModel,
    SubspaceOutcome { orders, refinement, .. }: &SubspaceOutcome,
    offered: &RangeInclusive<usize>,
) {
    let order = model.order();
    if let (Some(last), Some(first)) = (orders.last(), orders.first()) {
        if order == last.order && last.order > first.order && last.order < *offered.end() {
            warnings.push(format!(
                "the order that fits best, {order}, is the highest of the range: a higher one may fit better; widen the range"
            ));
        } else if order == last.order && last.order > first.order {
            warnings.push(format!(
                "the order that fits best, {order}, is the highest that was compared: give a range with higher ones, or leave trends and \
                 slow drifts out of the log"
            ));
        }
        let refused = orders.iter().filter(|score| score.mdl.is_none()).count();
        if refused > 0 {
            warnings.push(format!(
                "{refused} of the {} orders have no model with a stable predictor, and were left out",
                orders.len()
            ));
        }
    }
    if let Some(RefinementOutcome { search, .. }) = refinement {
        match search.stopped {
            Stopped::MaxIterations => warnings.push(format!(
                "the search stopped after {} iterations before it had converged; allow more (`max-iterations`)",
                search.iterations
            )),
            Stopped::TimeLimit => warnings
                .push("the search ran out of time before it had converged; allow more (`time-limit`)".to_owned()),
            Stopped::Converged | Stopped::NoDescent => {}
        }
        if model.covariance.is_none() {
            warnings.push(
                "the log does not see all directions in which the matrices may vary: poles, gains and responses have no standard errors; ask \
                 for a lower order"
                    .to_owned(),
            );
        }
    }
}

fn of_arx(warnings: &mut Vec<String>, outcome: &VectorArxOutcome) {
    let VectorArxOutcome { na, nb, nk, tried, .. } = outcome;
    let most = |of: fn(&VectorArxScore) -> usize| tried.iter().map(of).max().unwrap_or(0);
    let least = |of: fn(&VectorArxScore) -> usize| tried.iter().map(of).min().unwrap_or(0);
    let past: fn(&VectorArxScore) -> usize = |score| score.na;
    let of_inputs: fn(&VectorArxScore) -> usize = |score| score.nb.iter().copied().max().unwrap_or(0);
    let late: fn(&VectorArxScore) -> usize = |score| score.nk.iter().copied().max().unwrap_or(0);
    let highest = |own: &[usize]| own.iter().copied().max().unwrap_or(0);
    let own = [("na", *na, past), ("nb", highest(nb), of_inputs), ("nk", highest(nk), late)];
    for (name, value, of) in own {
        if value == most(of) && most(of) > least(of) {
            warnings.push(format!(
                "`{name}` {value}, which fits best, is the highest of the range: a higher one may fit better; widen the range"
            ));
        }
    }
}
