//! What a careful reader of a process should know.

use thetahat_numerics::optimize::Stopped;

use crate::data::Record;
use crate::figures::{number, short};
use crate::model::{Parameter, ProcessModel, polynomial};
use crate::report::Estimation;
use crate::respond::process::HeldLog;
use crate::validate::feedback::feedback;

/// A time constant shorter than this part of a sample is not seen, nor one longer than the log.
const SHORT: f64 = 0.1;
/// Twice the standard error above the value: the parameter may as well not be there.
const UNCERTAIN: f64 = 0.5;

/// So much of the squared errors may be that of a first state by chance, and by their colour.
const STARTS: f64 = 0.1;
/// Time constants this close are one.
const SAME: f64 = 1.01;

fn is_lag(name: &str) -> bool {
    name.starts_with("tau") && !name.starts_with("tau_z")
}

/// Whether a state in which the log begins would explain so much that it is not at rest there.
pub(super) fn begins_in_motion(explained_by_starts: f64) -> bool {
    explained_by_starts > STARTS
}

/// What there is to say of inputs that follow the output: the errors of a free run are not those of the process then.
pub(super) fn of_feedback(inputs: &[String], record: &Record<'_>) -> Vec<String> {
    let follows = feedback(&record.inputs, record.output, &record.segments).certain();
    let names = inputs.iter().zip(follows).filter(|(_, follows)| *follows);
    names
        .map(|(name, _)| {
            format!(
                "input '{name}' follows past errors of the output, as in a closed loop: the free run of a process is biased there; fit a \
                 model with noise (arx, armax, bj)"
            )
        })
        .collect()
}

pub(super) fn of_fit(
    model: &ProcessModel,
    held: &[HeldLog],
    estimation: &Estimation,
    explained_by_starts: f64,
) -> Vec<String> {
    let mut words = Vec::new();
    if begins_in_motion(explained_by_starts) {
        words.push(format!(
            "{:.0} % of the squared errors are what is left of a state in which the log begins: it is not at rest with its first inputs; \
             estimate the state, with `initial` estimate",
            100.0 * explained_by_starts
        ));
    }
    let longest = held.iter().filter_map(|part| part.times.last()).copied().fold(0.0, f64::max);
    for (number_of_input, input) in model.inputs.iter().enumerate() {
        let changes: usize = held
            .iter()
            .map(|part| part.inputs[number_of_input].windows(2).filter(|pair| pair[0] != pair[1]).count())
            .sum();
        if changes == 1 {
            words.push(format!(
                "'{}' has one step: what else moved the output in the same time cannot be told from it; a second step, back or further, \
                 can show that the gain is the same",
                input.name
            ));
        }
    }
    let missing: usize = held.iter().map(|part| part.held).sum();
    if missing > 0 {
        words.push(format!("{missing} missing values of inputs hold the value before them"));
    }
    words.extend(of_parameters(model, longest));
    if let Some(outcome) = estimation.procedure.free_run() {
        match outcome.stopped {
            Stopped::MaxIterations | Stopped::TimeLimit => words.push(
                "the search was stopped before it came to its end: give it more iterations or time"
                    .to_owned(),
            ),
            Stopped::Converged | Stopped::NoDescent => {}
        }
        if outcome.initial_conditions > 0 && words.iter().any(|word| word.contains("has one step")) {
            words.push(
                "the state that the log begins in is estimated beside a single step, which it resembles: the gain is less certain for it"
                    .to_owned(),
            );
        }
    }
    words
}

/// What the parameters say of the structure, of a log as long as this.
pub(super) fn of_parameters(model: &ProcessModel, longest: f64) -> Vec<String> {
    let mut words = Vec::new();
    if model.covariance.is_none() {
        words.push(
            "there are no standard errors: the log hardly tells the parameters apart; take a simpler structure, or a log in which the input \
             moves more"
                .to_owned(),
        );
    }
    for ((structure, parts), input) in model.structures.iter().zip(model.parts()).zip(&model.inputs) {
        let monic: Vec<f64> = std::iter::once(1.0).chain(parts.shape).collect();
        let poles = if structure.is_transfer_function() { polynomial::roots(&monic) } else { None };
        if poles.into_iter().flatten().any(|pole| pole.norm() * longest < 1.0) {
            words.push(format!(
                "a pole from '{}' is slower than the log is long, and the gain a guess: an integrator (i) may say as much, or take a longer \
                 log",
                input.name
            ));
        }
    }
    for (structure, own) in model.structures.iter().zip(model.of_inputs()) {
        let lags: Vec<&Parameter> = own.iter().filter(|own| is_lag(&own.name)).collect();
        let same = lags.windows(2).find(|pair| pair[0].value < SAME * pair[1].value);
        if let (Some(pair), false) = (same, structure.is_underdamped() || structure.is_parallel()) {
            words.push(format!(
                "{} and {} are the same: the process may overshoot, which two lags that may be underdamped (u) tell",
                pair[0].name, pair[1].name
            ));
        }
    }
    for parameter in &model.parameters {
        let name = &parameter.name;
        let is = |word: &str| name.starts_with(word);
        if is("theta") && parameter.value == 0.0 {
            words.push(format!("{name} comes to zero: the log shows no dead time; a structure without d has one parameter less"));
            continue;
        }
        if is_lag(name) {
            if parameter.value > longest {
                words.push(format!(
                    "{name} is {} s and the log {} s long: it shows the beginning of the response alone, and the gain is a guess; \
                     an integrator (i) may say as much, or take a longer log",
                    number(parameter.value),
                    short(longest)
                ));
                continue;
            }
            if parameter.value < SHORT * model.sample_time {
                words.push(format!(
                    "{name} is {} s, less than a tenth of a sample: the log does not show it; take one lag less",
                    number(parameter.value)
                ));
                continue;
            }
        }
        if is("zeta") && parameter.value > 1.0 {
            words.push(format!(
                "{name} is {}: the pair is two lags; a structure without u says the same",
                number(parameter.value)
            ));
        }
        if parameter.standard_error.is_some_and(|error| error > UNCERTAIN * parameter.value.abs()) {
            words.push(format!("{name} is not certain: zero is within twice its standard error"));
        }
    }
    words
}
