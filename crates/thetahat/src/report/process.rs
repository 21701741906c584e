//! Fits of processes in continuous time.

mod response;
#[cfg(test)]
mod tests;
mod warnings;

pub use response::fit_process_to_response;

use thetahat_numerics::optimize::{Monitor, Search};

use super::evaluate::evaluate;
use super::plan::Plan;
use super::schema::{Estimation, Report};
use super::shares::Shares;
use crate::Error;
use crate::data::{Decision, FindingKind, Log, Offset, Rows, Source, Split};
use crate::estimate::{Background, Criteria, Initial, ProcessEstimate, least_free_run};
use crate::model::{OffsetCovariance, Parameter, ProcessModel, ProcessStructure, Quantity, Signal};
use crate::respond::process::{ProcessOnLog, held_logs};
use crate::select::Focus;
use crate::validate::Part;

/// What process to fit, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct ProcessPlan {
    /// The inputs, at least one.
    pub inputs: Vec<String>,
    /// The output.
    pub output: String,
    /// The structure from each input, or one for all.
    pub structures: Vec<ProcessStructure>,
    /// Rows to estimate on; none: all.
    pub estimate: Vec<Rows>,
    /// Rows to validate on.
    pub validate: Vec<Rows>,
    /// Cuts the rows to estimate on into parts: the fit is to the first two, and evaluated on the third.
    pub split: Option<Split>,
    /// Offsets that are known. That of an input is else its first value; that of the output is estimated.
    pub offsets: Vec<(String, f64)>,
    /// Whether the output has a slope of its own, in its units per second.
    pub trend: bool,
    /// Whether each log begins in a state that is estimated, or at rest. None: at rest, unless a state explains more
    /// than a tenth of the squared errors.
    pub free_start: Option<bool>,
    /// How to search; `starts` are further points of the grid, `initial_parameters` and `plant_first` do not apply.
    pub search: Search,
}

impl ProcessPlan {
    /// The process of the channels and rows of another plan, whose structures are to be named.
    pub(super) fn of(plan: &Plan, search: &Search) -> Self {
        Self {
            inputs: plan.inputs.clone(),
            output: plan.output.clone(),
            structures: Vec::new(),
            estimate: plan.estimate.clone(),
            validate: plan.validate.clone(),
            split: plan.split,
            offsets: Vec::new(),
            trend: plan.trend,
            free_start: (plan.initial == Initial::Zero).then_some(false),
            search: search.clone(),
        }
    }

    /// A plan for one structure from all inputs, with the other choices at their defaults.
    pub fn new(inputs: &[&str], output: &str, structure: ProcessStructure) -> Self {
        Self {
            inputs: inputs.iter().map(|&name| name.to_owned()).collect(),
            output: output.to_owned(),
            structures: vec![structure],
            estimate: Vec::new(),
            validate: Vec::new(),
            split: None,
            offsets: Vec::new(),
            trend: false,
            free_start: None,
            search: Search::default(),
        }
    }

    /// Whether the plan makes sense, whatever the log.
    ///
    /// # Errors
    /// [`Error::Argument`] if there is no input, a name comes twice, there are structures for other inputs, or an
    /// offset is of another channel or not finite.
    pub fn check(&self) -> Result<(), Error> {
        if self.inputs.is_empty() {
            return Err(Error::argument("input", "a process has one input at least"));
        }
        let mut names: Vec<&String> = self.inputs.iter().chain([&self.output]).collect();
        names.sort_unstable();
        if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(Error::argument(
                "input",
                format!("'{}' comes twice; name each channel once", pair[0]),
            ));
        }
        if self.structures.len() != 1 && self.structures.len() != self.inputs.len() {
            return Err(Error::argument(
                "structure",
                format!(
                    "there are {} for {} inputs; give one for all or one for each",
                    self.structures.len(),
                    self.inputs.len()
                ),
            ));
        }
        let rational = self.structures.iter().filter(|structure| structure.is_transfer_function()).count();
        if !(rational == 0 || rational == self.structures.len()) {
            return Err(Error::argument(
                "structure",
                "transfer functions (tf) stand beside processes (p, rc): give those of one kind for all inputs",
            ));
        }
        for (name, value) in &self.offsets {
            if !self.inputs.contains(name) && *name != self.output {
                return Err(Error::argument("offset", format!("the model has no channel '{name}'")));
            }
            if !value.is_finite() {
                return Err(Error::argument("offset", format!("that of '{name}' is {value}")));
            }
        }
        if self.trend && self.offset_of(&self.output).is_some() {
            return Err(Error::argument(
                "trend",
                "it is a line with a level, which the offset of the output is; leave one of them out",
            ));
        }
        Ok(())
    }

    fn offset_of(&self, name: &str) -> Option<f64> {
        self.offsets.iter().find(|(own, _)| own == name).map(|(_, value)| *value)
    }

    /// The structure from each input.
    fn each(&self) -> Vec<ProcessStructure> {
        match *self.structures {
            [one] => vec![one; self.inputs.len()],
            ref several => several.to_vec(),
        }
    }
}

/// Finds a process in continuous time in a log, or in several that are joined, and reports on it.
///
/// ```text
/// y(t) = y0 + m t + sum_j G_j(s) (u_j(t) - u_j0) + e(t),   G(s) = K (1 + tau_z s)/(s (1 + tau1 s)(1 + tau2 s)…) e^(-theta s)
/// ```
///
/// with the factors that the [structure](ProcessStructure) of an input has. The sum of e^2 over the measured outputs is
/// as small as can be: gains, y0 and m follow for each shape and dead time (variable projection, Golub and Pereyra
/// 1973), which a Levenberg-Marquardt search finds from a grid. Transfer functions (`tf`) are searched for from refined
/// instrumental variables in continuous time (SRIVC).
///
/// **Inputs** are held from each row to the next, and the response is exact at the times of the rows: the clock may be
/// irregular ([`Log::recorded`]), and a dead time need not be a number of samples. A missing input holds the value
/// before it, a missing output is left out.
///
/// **Start.** The process is at rest in the first row of each log, with the inputs of that row, which are the offsets
/// u_j0 unless others are given. With `free_start`, and where nothing was said and a state explains more than a tenth
/// of the squared errors, each log has a state of its own; beside a single step that is nearly the same as the step.
/// The output of an integrator then has a slope too, since an input that is not at rest moves it at a rate of its own,
/// unless the offset of the input is given.
///
/// **Standard errors** are for errors of any colour, that of an autoregression of the residuals. Those for white
/// errors, which are far too small for most plants, stand in [`ProcessOutcome`](crate::estimate::ProcessOutcome).
///
/// An iteration costs O(N p^2) for p parameters.
///
/// Source: Ljung, System Identification, 2nd ed. 1999, sections 4.3, 9.3 and 10.2; Golub and Pereyra, SIAM J. Numerical
/// Analysis 10 (1973); Kaufman, BIT 15 (1975); Young and Jakeman, Int. J. Control 31 (1980).
///
/// # Errors
/// [`Error::Argument`] as for [`ProcessPlan::check`], and for rows that are not there; [`Error::Data`] if a channel is
/// not there or squares leave the range of numbers; [`Error::Undetermined`] for an input that never changes, too few
/// values, and parameters that the log does not determine; [`Error::Interrupted`] if the monitor says so.
///
/// ```
/// use std::ops::ControlFlow;
/// use thetahat::data::{Channel, Log};
/// use thetahat::report::{ProcessPlan, fit_process};
///
/// // 2/(1 + 5 s) e^(-1.3 s) after a step at 3 s, on an irregular clock.
/// let time: Vec<f64> = (0..60).map(|k| f64::from(k) * 0.5 + 0.1 * f64::from(k % 3)).collect();
/// let u: Vec<f64> = time.iter().map(|t| if *t < 3.0 { 0.0 } else { 1.0 }).collect();
/// let start = time[u.iter().position(|u| *u > 0.0).unwrap()];
/// let y = time.iter().map(|t| 20.0 + 2.0 * (1.0 - (-(t - start - 1.3).max(0.0) / 5.0).exp())).collect();
/// let channel = |name: &str, values| Channel { name: name.into(), values };
/// let log = Log::recorded(vec![channel("u", u), channel("y", y)], time)?;
/// let plan = ProcessPlan::new(&["u"], "y", "p1d".parse()?);
/// let report = fit_process(&log, &[], &plan, &|_| ControlFlow::Continue(()))?;
/// let found: Vec<f64> = report.model.parameters().iter().map(|parameter| parameter.value).collect();
/// assert!((found[0] - 2.0).abs() < 1e-6 && (found[1] - 5.0).abs() < 1e-6 && (found[2] - 1.3).abs() < 1e-6);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn fit_process(
    log: &Log,
    sources: &[Source],
    plan: &ProcessPlan,
    monitor: Monitor<'_>,
) -> Result<Report, Error> {
    plan.check()?;
    let names: Vec<&str> = plan.inputs.iter().chain([&plan.output]).map(String::as_str).collect();
    names.iter().try_for_each(|name| log.channel(name).map(|_| ()))?;
    let shares = Shares::of(&plan.estimate, &plan.validate, plan.split, log.rows())?;
    let inputs = plan.inputs.iter().map(|name| {
        let first = || log.channel(name).ok()?.values.iter().copied().find(|value| !value.is_nan());
        let level = plan.offset_of(name).or_else(first).unwrap_or(0.0);
        Signal { name: name.clone(), offset: Offset { level, slope: 0.0 } }
    });
    let inputs: Vec<Signal> = inputs.collect();
    let given = plan.offset_of(&plan.output);
    let offsets = inputs.iter().map(|input| (input.name.as_str(), input.offset));
    let output = (plan.output.as_str(), Offset { level: given.unwrap_or(0.0), slope: 0.0 });
    let deviations = log.deviations(offsets.chain([output]))?;
    let input_names: Vec<&str> = plan.inputs.iter().map(String::as_str).collect();
    let held = held_logs(&deviations, &input_names, &shares.estimation)?;
    for (input, name) in plan.inputs.iter().enumerate() {
        let mut values = held.iter().flat_map(|part| &part.inputs[input]);
        let first = values.next();
        if values.all(|value| Some(value) == first) {
            return Err(Error::undetermined(
                Vec::new(),
                format!(
                    "input '{name}' never changes: there is no step to learn from; name rows in which it moves, or leave it out"
                ),
            ));
        }
    }
    let structures = plan.each();
    // An integrator that is not at rest in the first row rises at a rate that nobody knows.
    let open_rate = structures
        .iter()
        .zip(&plan.inputs)
        .any(|(structure, input)| structure.integrates() && plan.offset_of(input).is_none());
    let parameters = ProcessModel::names(&structures, &plan.inputs);
    let measured = &deviations.channel(&plan.output)?.values;
    let fit = |free: bool| {
        let slope = plan.trend || free && given.is_none() && open_rate;
        let background = Background { level: given.is_none(), slope, free };
        let found =
            least_free_run(&structures, &parameters, (&held, measured), background, &plan.search, monitor)?;
        Ok::<_, Error>((background, found))
    };
    let mut decisions = Vec::new();
    let (mut background, mut found) = fit(plan.free_start.unwrap_or(false))?;
    // With a state of its own an integrator has a slope too, which columns of states do not show.
    let free = match plan.free_start {
        None if open_rate && given.is_none() => Some(fit(true)?),
        None if warnings::begins_in_motion(found.explained_by_starts) => Some(fit(true)?),
        _ => None,
    };
    if let Some((free, own)) = free
        && warnings::begins_in_motion(found.explained_by_starts.max(1.0 - own.mse / found.mse))
    {
        let explained = 100.0 * found.explained_by_starts.max(1.0 - own.mse / found.mse);
        decisions.push(Decision {
            kind: FindingKind::InMotion,
            channels: Vec::new(),
            because: format!("the log does not begin at rest with its first inputs, by {explained:.0} % of the squared errors"),
            did: "the state in which it begins is estimated".to_owned(),
            instead: "`initial` zero".to_owned(),
        });
        (background, found) = (free, own);
    }
    let model = model(plan, log.sample_time(), inputs, structures, &parameters, (background.free, &found))?;
    let starts = found.explained_by_starts;

    let segments = held.iter().flat_map(|part| &part.counted).map(Rows::from_positions);
    let data = shares.into_data((log, sources), &names, "none".to_owned(), segments.collect())?;
    let error = |place: usize| found.covariance.as_ref().map(|rows| rows[place][place].sqrt());
    let count = parameters.len();
    let estimation = Estimation {
        initial: Some(if background.free { Initial::Estimate } else { Initial::Zero }),
        level: found.run.level.map(|level| Quantity::new(level, error(count))),
        slope: found.run.slope.map(|slope| Quantity::new(slope, error(count + 1))),
        samples: found.samples,
        mse: found.mse,
        criteria: Criteria::new(found.mse, count + background.offsets(), found.samples),
        condition: found.condition,
        procedure: found.outcome.of_log(),
    };
    let words = warnings::of_fit(&model, &held, &estimation, starts);
    let mut report = Report { decisions, ..Report::new(data, model.clone(), estimation) };
    report.warnings.extend(words);
    if log.check_uniform().is_ok()
        && let Ok(record) = deviations.record(&plan.inputs, &plan.output, &report.data.estimation)
    {
        report.warnings.extend(warnings::of_feedback(&plan.inputs, &record));
    }
    let signals = || model.inputs.iter().chain([&model.output]);
    let own = log.deviations(signals().map(|signal| (signal.name.as_str(), signal.offset)))?;
    let on_log = |rows: &[Rows]| ProcessOnLog::new(&model, &own, rows);
    let fitted = on_log(&report.data.estimation)?;
    evaluate(&mut report, &fitted, Part::Estimation, Focus::Auto);
    for (part, rows) in report.data.held_out() {
        evaluate(&mut report, &on_log(&rows)?, part, Focus::Auto);
    }
    Ok(report.with_purpose())
}

/// The model of what was found.
fn model(
    plan: &ProcessPlan,
    sample_time: f64,
    inputs: Vec<Signal>,
    structures: Vec<ProcessStructure>,
    names: &[String],
    (free_start, found): (bool, &ProcessEstimate),
) -> Result<ProcessModel, Error> {
    let count = names.len();
    let covariance = found.covariance.as_ref();
    let parameters =
        names.iter().zip(&found.run.parameters).enumerate().map(|(place, (name, &value))| Parameter {
            name: name.clone(),
            value,
            standard_error: covariance.map(|rows| rows[place][place].sqrt()),
        });
    let offset = match (found.run.level, found.run.slope) {
        (Some(level), slope) => {
            let slope = slope.unwrap_or(0.0);
            Offset { level: level - slope * found.run.middle, slope }
        }
        _ => Offset { level: plan.offset_of(&plan.output).unwrap_or(0.0), slope: 0.0 },
    };
    let own: Option<Vec<Vec<f64>>> =
        covariance.map(|rows| rows[..count].iter().map(|row| row[..count].to_vec()).collect());
    let open = covariance.filter(|_| found.run.level.is_some());
    let model = ProcessModel {
        structures,
        sample_time,
        inputs,
        output: Signal { name: plan.output.clone(), offset },
        parameters: parameters.collect(),
        covariance: own,
        offset_covariance: open.map(|rows| OffsetCovariance {
            covariance: rows.clone(),
            middle: found.run.slope.map(|_| found.run.middle),
        }),
        noise_variance: found.noise_variance,
        degrees_of_freedom: Some(found.samples - found.unknowns),
        free_start,
    };
    model.check()?;
    Ok(model)
}
