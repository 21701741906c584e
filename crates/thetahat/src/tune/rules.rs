//! From a process to settings.

use super::closed_loop::closed_loop;
use super::document::{Controller, ControllerSettings, ReducedProcess, Rule, Tuning};
use super::lags::{Lags, lags};
use crate::document::GENERATOR;
use crate::figures::short;
use crate::model::{ProcessModel, ProcessStructure};
use crate::{Document, Error};

/// Ms above this is worth a warning.
const LARGEST_SENSITIVITY: f64 = 2.0;
/// Twice its standard error above this part of a parameter too.
const UNCERTAIN: f64 = 0.25;
/// The closed-loop time constant of a process without a dead time, as a part of its own.
const FAST: f64 = 1.0 / 3.0;

/// Which settings.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TuningPlan {
    /// The input that the controller moves; none: the only one.
    pub input: Option<String>,
    /// The time constant that the loop shall have, in seconds; none: theta by SIMC, the larger of tau and theta by
    /// lambda tuning.
    pub closed_loop_time: Option<f64>,
    /// The controller; none: both.
    pub controller: Option<Controller>,
}

/// Settings of PI and PID controllers for a process by SIMC and by lambda tuning, and what the loops with them do.
///
/// ```text
/// PI   Kc = tau1/(K (tau_c + theta)),  Ti = min(tau1, 4 (tau_c + theta))              SIMC; Ti = tau1 by lambda tuning
/// PID  the same in series with 1 + tau2 s; with f = 1 + tau2/Ti: Kc f, Ti f, Td = tau2/f
/// integrating:  Kc = 1/(K (tau_c + theta)),  Ti = 4 (tau_c + theta)                   SIMC
///               Kc = (2 lambda + theta)/(K (lambda + theta)^2),  Ti = 2 lambda + theta   lambda tuning
/// ```
///
/// Lags that a rule has no place for go to the dead time and to the lag before them by halves (Skogestad's half rule).
///
/// Source: Skogestad, J. Process Control 13 (2003), sections 3 and 5; Dahlin 1968; Åström and Hägglund, Advanced PID
/// Control, 2006, section 6.5; Chien and Fruehauf 1990 for integrating processes.
///
/// # Errors
/// [`Error::Argument`] for an input that is not there or not named where there are several, a closed-loop time that is
/// not positive, and processes that the rules are not for: with a zero, a pair that is underdamped, lags side by side,
/// or no gain.
///
/// ```
/// use std::ops::ControlFlow;
/// use thetahat::data::{Channel, Log};
/// use thetahat::model::Model;
/// use thetahat::report::{ProcessPlan, fit_process};
/// use thetahat::tune::{Controller, Rule, TuningPlan, tune};
///
/// // e^(-s)/(1 + 10 s)
/// let u: Vec<f64> = (0..100).map(|t| f64::from(u8::from(t >= 10))).collect();
/// let y = (0..100).map(|t| 1.0 - (-f64::from((t - 11).max(0)) / 10.0).exp()).collect();
/// let channel = |name: &str, values| Channel { name: name.into(), values };
/// let log = Log::new(vec![channel("u", u), channel("y", y)], 1.0)?;
/// let report = fit_process(&log, &[], &ProcessPlan::new(&["u"], "y", "p1d".parse()?), &|_| ControlFlow::Continue(()))?;
/// let Model::Process(process) = &report.model else { panic!("a process") };
/// let found = tune(process, &TuningPlan::default())?;
/// let simc = &found.settings[0];
/// assert_eq!((simc.rule, simc.controller), (Rule::Simc, Controller::Pi));
/// assert!((simc.gain - 5.0).abs() < 1e-3 && (simc.integral_time - 8.0).abs() < 1e-3);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn tune(model: &ProcessModel, plan: &TuningPlan) -> Result<Tuning, Error> {
    if let Some(time) = plan.closed_loop_time
        && !(time > 0.0 && time.is_finite())
    {
        return Err(Error::argument("lambda", format!("{time} is not a positive number of seconds")));
    }
    let place = input(model, plan)?;
    let structure = model.structures[place];
    check(&structure)?;
    let before: usize = model.structures[..place].iter().map(ProcessStructure::parameters).sum();
    let own: Vec<f64> = model.of_inputs().nth(place).unwrap_or(&[]).iter().map(|own| own.value).collect();
    let process = lags(&structure, &own);
    if process.gain == 0.0 {
        return Err(Error::argument("model", "its gain is zero: the input does not move the output"));
    }
    let rows = model.covariance.as_deref();
    let spread: Option<Vec<Vec<f64>>> = rows.map(|rows| {
        rows[before..before + own.len()].iter().map(|row| row[before..before + own.len()].to_vec()).collect()
    });
    let mut settings = Vec::new();
    for rule in [Rule::Simc, Rule::Lambda] {
        for controller in [Controller::Pi, Controller::Pid] {
            let asked = plan.controller.is_none_or(|asked| asked == controller);
            if asked
                && let Some((reduced, time, values)) = set(&process, rule, controller, plan.closed_loop_time)
            {
                let [gain, integral_time, derivative_time] = values;
                let closed_loop = closed_loop((&structure, &own), spread.as_deref(), values, time);
                settings.push(ControllerSettings {
                    rule,
                    controller,
                    process: reduced,
                    closed_loop_time: time,
                    gain,
                    integral_time,
                    derivative_time,
                    closed_loop,
                });
            }
        }
    }
    let input = model.inputs[place].name.clone();
    let warnings = warnings(model, place, &process, &settings, plan);
    Ok(Tuning {
        schema: Tuning::SCHEMA.to_owned(),
        generator: GENERATOR.to_owned(),
        model: format!("process {structure}"),
        input,
        output: model.output.name.clone(),
        settings,
        warnings,
    })
}

/// Where the input stands.
fn input(model: &ProcessModel, plan: &TuningPlan) -> Result<usize, Error> {
    let names = || model.inputs.iter().map(|input| input.name.as_str()).collect::<Vec<_>>().join(", ");
    match (&plan.input, model.inputs.len()) {
        (None, 1) => Ok(0),
        (None, _) => Err(Error::argument(
            "input",
            format!("the process has several; name the one to move: {}", names()),
        )),
        (Some(name), _) => model.inputs.iter().position(|input| input.name == *name).ok_or_else(|| {
            Error::argument("input", format!("the process has none called '{name}', but: {}", names()))
        }),
    }
}

/// Whether the rules are for such a process.
fn check(structure: &ProcessStructure) -> Result<(), Error> {
    let wrong = |what: &str| {
        Err(Error::argument(
            "model",
            format!(
                "it is {structure}, and the rules are not for processes {what}; fit another structure, such as p1d or p2d"
            ),
        ))
    };
    if structure.is_parallel() {
        return wrong("of lags side by side");
    }
    if structure.is_transfer_function() {
        return wrong("of polynomials");
    }
    if structure.columns() > 1 {
        return wrong("with a zero");
    }
    if structure.is_underdamped() {
        return wrong("that may be underdamped");
    }
    Ok(())
}

/// The reduced process, the closed-loop time, and Kc, Ti and Td; none where a PID is a PI.
fn set(
    process: &Lags,
    rule: Rule,
    controller: Controller,
    asked: Option<f64>,
) -> Option<(ReducedProcess, f64, [f64; 3])> {
    // Beside the longest lag, or the integrator, a PID has one more.
    let more = usize::from(controller == Controller::Pid);
    let reduced = process.reduced(more + usize::from(!process.integrates));
    let (first, second) = if process.integrates {
        (None, reduced.taus.first().copied())
    } else {
        (Some(reduced.taus.first().copied()?), reduced.taus.get(1).copied())
    };
    if more == 1 && second.is_none() {
        return None;
    }
    let (gain, theta) = (process.gain, reduced.dead_time);
    let slowest = first.or(second).unwrap_or(1.0);
    let time = asked.unwrap_or(match rule {
        Rule::Simc if theta > 0.0 => theta,
        Rule::Simc => FAST * slowest,
        Rule::Lambda => slowest.max(theta),
    });
    let sum = time + theta;
    let (kc, ti) = match (rule, first) {
        (Rule::Simc, Some(tau)) => (tau / (gain * sum), tau.min(4.0 * sum)),
        (Rule::Lambda, Some(tau)) => (tau / (gain * sum), tau),
        (Rule::Simc, None) => (1.0 / (gain * sum), 4.0 * sum),
        (Rule::Lambda, None) => ((time + sum) / (gain * sum * sum), time + sum),
    };
    let td = if more == 1 { second.unwrap_or(0.0) } else { 0.0 };
    let factor = 1.0 + td / ti;
    let seen = ReducedProcess { gain, time_constant: first, second_time_constant: td, dead_time: theta };
    Some((seen, time, [kc * factor, ti * factor, td / factor]))
}

fn warnings(
    model: &ProcessModel,
    place: usize,
    process: &Lags,
    settings: &[ControllerSettings],
    plan: &TuningPlan,
) -> Vec<String> {
    let mut words = Vec::new();
    if process.dead_time == 0.0 && plan.closed_loop_time.is_none() {
        words.push(
            "the process has no dead time, which SIMC takes for the closed-loop time constant: a third of the longest lag stands for it; \
             say how fast the loop shall be (lambda)"
                .to_owned(),
        );
    }
    for parameter in model.of_inputs().nth(place).unwrap_or(&[]) {
        if parameter.standard_error.is_some_and(|error| 2.0 * error > UNCERTAIN * parameter.value.abs()) {
            words.push(format!(
                "{} is known to ± {} only (95 %): look at the worst Ms, or take a longer lambda",
                parameter.name,
                short(2.0 * parameter.standard_error.unwrap_or(0.0))
            ));
        }
    }
    for own in settings {
        let name = format!("{} {}", own.rule.name(), own.controller.name());
        if !own.closed_loop.stable {
            words.push(format!(
                "{name}: the loop is not stable with the fitted process; take a longer lambda"
            ));
        } else if model.covariance.is_some() && own.closed_loop.worst_peak_sensitivity.is_none() {
            words.push(format!(
                "{name}: the loop is not stable at an end of the 95 % intervals of the parameters; take a longer lambda, or learn more of \
                 the process"
            ));
        } else if own.closed_loop.peak_sensitivity > LARGEST_SENSITIVITY {
            words.push(format!(
                "{name}: Ms is {}, above 2: small errors of the model make the loop oscillate; take a longer lambda",
                short((100.0 * own.closed_loop.peak_sensitivity).round() / 100.0)
            ));
        }
    }
    if plan.controller == Some(Controller::Pid) && settings.is_empty() {
        words.push(
            "a PID by these rules is for processes of two lags; this one has one: take a PI".to_owned(),
        );
    }
    words
}
