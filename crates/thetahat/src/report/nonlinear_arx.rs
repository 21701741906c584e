//! Fits of nonlinear ARX models.

mod map;
mod plan;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;

use thetahat_numerics::optimize::{Monitor, Stopped};

use super::evaluate::evaluate;
use super::schema::{Data, Estimation, Report};
use super::shares::Shares;
use crate::Error;
use crate::data::{Channel, Log, Offset, Rows, Source};
use crate::estimate::{
    Criteria, MapsOutcome, Procedure,
    nonlinear_arx::{Joint, joint},
};
use crate::model::{ChannelExpression, Map, Model, NonlinearArxModel, OutputMap, Regressor, Signal};
use crate::respond::{
    Horizon,
    nonlinear_arx::{NonlinearArxOnLog, no_number},
};
use crate::select::Focus;
use crate::validate::Part;

use self::map::fit_map;
pub use plan::{Centres, InputLags, MapPlan, NonlinearArxPlan};

/// Below this fraction of a channel's size, what an offset leaves is rounding.
pub(super) const ROUNDING: f64 = 1e-13;

/// The fit of a plan that was checked, of one kind of map.
pub(super) fn fit_planned(
    log: &Log,
    sources: &[Source],
    plan: &NonlinearArxPlan,
    monitor: Monitor<'_>,
) -> Result<Report, Error> {
    let names: Vec<&str> = plan.inputs.iter().chain(&plan.outputs).map(String::as_str).collect();
    names.iter().try_for_each(|name| log.channel(name).map(|_| ()))?;
    let shares = Shares::of(&plan.estimate, &plan.validate, plan.split, log.rows())?;
    let expressions = plan.read_expressions()?;
    let Prepared { whole, signals, deviations } = prepare(log, plan, &expressions, &shares.estimation)?;
    let scales = scales(&whole, &signals, &deviations, plan.raw_terms, &shares.estimation)?;
    let head = head(plan, &signals, &expressions, whole.sample_time(), scales)?;
    let fitted = (0..plan.outputs.len())
        .map(|output| fit_map(plan, &head.of_output(output)?, &deviations, &shares, monitor))
        .collect::<Result<Vec<_>, Error>>()?;
    let by = match plan.map {
        MapPlan::Local { .. } => MapsOutcome::split,
        MapPlan::Neighbours { .. } => MapsOutcome::of_neighbours,
        _ if plan.map.trained().is_some() => MapsOutcome::trained,
        _ => MapsOutcome::chosen,
    };
    // Samples are no parameters: as many as there are of them for each that is asked stand for one.
    let parameters = fitted.iter().map(|one| {
        let own = one.outcome.last().map(|step| step.parameters);
        own.unwrap_or(one.solved.model.parameters.len())
    });
    let (parameters, samples) = (parameters.sum(), fitted.first().map_or(0, |one| one.samples.count()));
    let (maps, parts) = fitted.into_iter().map(|one| (one.outcome, (one.samples, one.solved))).unzip();
    let joint = joint(&head.inputs, parts)
        .ok_or_else(|| Error::argument("output", "a model has one output at least"))?;
    let segments = deviations.segments(&names, &shares.estimation)?;
    let segments = segments.iter().map(Rows::from_positions).collect();
    let data = shares.into_data((log, sources), &names, plan.detrend.to_string(), segments)?;
    let Reported { mut report, mut model } =
        reported(joint, by(MapsOutcome { maps }), (parameters, samples), data);
    let held_out: Vec<Rows> = report.data.held_out().into_iter().flat_map(|(_, rows)| rows).collect();
    if !held_out.is_empty() {
        let errors = NonlinearArxOnLog::new(&model, &deviations, &held_out)?.run_errors();
        model.maps.iter_mut().zip(errors).for_each(|(map, errors)| map.run_errors = errors);
        report.model = Model::from(model.clone());
    }
    let on_log = |rows: &[Rows]| NonlinearArxOnLog::new(&model, &deviations, rows);
    let own = on_log(&report.data.estimation)?;
    evaluate(&mut report, &own, Part::Estimation, Focus::Auto);
    for (part, rows) in report.data.held_out() {
        evaluate(&mut report, &on_log(&rows)?, part, Focus::Auto);
    }
    report.warnings.extend(warnings(&report, &model));
    Ok(report.with_purpose())
}

/// A report without figures and warnings, and its model.
pub(super) struct Reported {
    pub(super) report: Report,
    pub(super) model: NonlinearArxModel,
}

/// Of a model with so many parameters that was found from so many samples.
pub(super) fn reported(
    Joint { model, mse, determinant, condition }: Joint,
    procedure: Procedure,
    (parameters, samples): (usize, usize),
    data: Data,
) -> Reported {
    let estimation = Estimation {
        procedure,
        initial: None,
        level: None,
        slope: None,
        samples,
        mse,
        criteria: Criteria::new(determinant, parameters, samples),
        condition,
    };
    let report = Report::new(data, model.clone(), estimation);
    Reported { report, model }
}

/// A log with the expressions of the plan as further channels.
struct Prepared<'l> {
    /// As it was measured.
    whole: Cow<'l, Log>,
    /// The offsets of all channels.
    signals: BTreeMap<String, Signal>,
    /// The log without them.
    deviations: Log,
}

/// The channels and expressions of a plan, and their offsets.
fn prepare<'l>(
    log: &'l Log,
    plan: &NonlinearArxPlan,
    expressions: &[ChannelExpression],
    estimation: &[Rows],
) -> Result<Prepared<'l>, Error> {
    let names: Vec<&str> = plan.channels().collect();
    let segments = log.segments(&names, estimation)?;
    if segments.is_empty() {
        return Err(Error::data(
            "no estimation row has a value in every channel; name other rows or channels",
        ));
    }
    let whole = with_expressions(log, plan, expressions, &segments)?;
    let mut signals = BTreeMap::new();
    for name in names.iter().copied().chain(plan.expressions.iter().map(String::as_str)) {
        let by_hand = plan.offsets.iter().find(|(channel, _)| channel == name);
        let offset = match by_hand {
            Some(&(_, level)) => Offset { level, slope: 0.0 },
            None => Offset::estimate(plan.detrend, &whole, name, &segments)?,
        };
        signals.insert(name.to_owned(), Signal { name: name.to_owned(), offset });
    }
    let offsets = signals.iter().map(|(name, signal)| (name.as_str(), signal.offset));
    let deviations = whole.deviations(offsets)?;
    Ok(Prepared { whole, signals, deviations })
}

/// The log with the values of the expressions as further channels, which have to be numbers in these segments.
pub(super) fn with_expressions<'l>(
    log: &'l Log,
    plan: &NonlinearArxPlan,
    expressions: &[ChannelExpression],
    segments: &[Range<usize>],
) -> Result<Cow<'l, Log>, Error> {
    let mut whole = Cow::Borrowed(log);
    let names: Vec<&str> = plan.channels().collect();
    let channels = names.iter().map(|name| Ok(log.channel(name)?.values.as_slice()));
    let channels: Vec<&[f64]> = channels.collect::<Result<_, Error>>()?;
    for (text, expression) in plan.expressions.iter().zip(expressions) {
        let mut values = expression.along(&channels, &vec![0.0; channels.len()]);
        if let Some(row) = segments.iter().cloned().flatten().find(|row| !values[*row].is_finite()) {
            return Err(no_number(text, row));
        }
        values.iter_mut().filter(|value| !value.is_finite()).for_each(|value| *value = f64::NAN);
        whole = Cow::Owned(whole.into_owned().with_channel(Channel { name: text.clone(), values }));
    }
    Ok(whole)
}

/// What channels are divided by, each with its role: the standard deviation over the estimation rows; 1 in the signals'
/// own units.
fn scales<'l>(
    log: &'l Log,
    signals: &BTreeMap<String, Signal>,
    deviations: &'l Log,
    keeps_units: bool,
    estimation: &[Rows],
) -> Result<impl Fn(&str, &str) -> Result<f64, Error> + use<'l>, Error> {
    let names: Vec<&str> = signals.keys().map(String::as_str).collect();
    let segments = deviations.segments(&names, estimation)?;
    Ok(move |name: &str, role: &str| -> Result<f64, Error> {
        let (own, raw) = (&deviations.channel(name)?.values, &log.channel(name)?.values);
        let of =
            |values: &[f64]| segments.iter().map(|rows| &values[rows.clone()]).collect::<Vec<_>>().concat();
        let (values, size) = (of(own), of(raw).iter().fold(0.0_f64, |size, value| size.max(value.abs())));
        let mean = thetahat_numerics::regression::sum(values.iter().copied()) / values.len() as f64;
        let variance = thetahat_numerics::regression::sum(values.iter().map(|value| (value - mean).powi(2)))
            / values.len() as f64;
        let spread = variance.sqrt();
        let varies = values.iter().any(|value| (value - mean).abs() > ROUNDING * size);
        if varies && !variance.is_normal() {
            return Err(Error::data(format!(
                "squares of '{name}' leave the range of numbers; scale the channel towards one"
            )));
        }
        if spread.is_nan() || spread <= ROUNDING * size {
            return Err(is_constant(name, role));
        }
        Ok(if keeps_units { 1.0 } else { spread })
    })
}

/// A channel that does not change.
pub(super) fn is_constant(name: &str, role: &str) -> Error {
    let or = if role == "output" { "" } else { ", or leave it out" };
    Error::undetermined(
        Vec::new(),
        format!(
            "{role} '{name}' is constant over the estimation rows: it can determine nothing; name rows in which it changes{or}"
        ),
    )
}

/// The model but its functions: signals, regressors and their scales.
pub(super) fn head(
    plan: &NonlinearArxPlan,
    signals: &BTreeMap<String, Signal>,
    expressions: &[ChannelExpression],
    sample_time: f64,
    scale: impl Fn(&str, &str) -> Result<f64, Error>,
) -> Result<NonlinearArxModel, Error> {
    let mut regressors: Vec<Regressor> = Vec::new();
    let mut read = |channel: &str, lags: std::ops::Range<usize>, scale: f64| {
        regressors.extend(lags.map(|lag| Regressor {
            channel: channel.to_owned(),
            lag,
            scale,
            range: [0.0; 2],
        }));
    };
    let mut maps = Vec::new();
    for (output, lags) in plan.outputs.iter().zip(&plan.output_lags) {
        let scale = scale(output, "output")?;
        read(output, 1..lags + 1, scale);
        let functions = Map::Polynomial { terms: Vec::new() };
        maps.push(OutputMap { scale, range: [0.0; 2], functions, run_errors: Vec::new() });
    }
    for (input, lags) in plan.inputs.iter().zip(&plan.input_lags) {
        read(input, lags.delay..lags.delay + lags.lags, scale(input, "input")?);
    }
    for (text, expression) in plan.expressions.iter().zip(expressions) {
        read(text, plan.lags_of(expression), scale(text, "regressor")?);
    }
    let named = |names: &[String]| names.iter().map(|name| signals[name].clone()).collect();
    Ok(NonlinearArxModel {
        sample_time,
        inputs: named(&plan.inputs),
        outputs: named(&plan.outputs),
        expressions: named(&plan.expressions),
        regressors,
        noise_covariance: vec![vec![0.0; maps.len()]; maps.len()],
        maps,
        degrees_of_freedom: None,
        parameters: Vec::new(),
        covariance: None,
    })
}

/// What a careful reader should know.
pub(super) fn warnings(report: &Report, model: &NonlinearArxModel) -> Vec<String> {
    let mut warnings = Vec::new();
    for ((outcome, map), output) in
        report.estimation.procedure.terms().iter().zip(&model.maps).zip(&model.outputs)
    {
        let of = if model.outputs.len() > 1 { format!("{}: ", output.name) } else { String::new() };
        let taken = &outcome.path[..outcome.taken.min(outcome.path.len())];
        if let Map::Neighbours { points, .. } = &map.functions
            && points.len() < report.estimation.samples
        {
            warnings.push(format!(
                "{of}the model keeps {} of {} samples, evenly chosen: a distance to each is a cost of every prediction",
                points.len(),
                report.estimation.samples
            ));
        }
        if let Some(run) = taken.last().and_then(|step| step.free_run).filter(|run| !run.in_range) {
            let what = if run.rmse.is_some() {
                "leaves 1.1 times the range of the output"
            } else {
                "grows without bound"
            };
            warnings.push(format!(
                "{of}the free run on the estimation rows {what}: check this run before you simulate with the model"
            ));
        }
        if let Some(training) = outcome.training.as_ref() {
            let more = match training.stopped {
                Stopped::MaxIterations => Some("allow more (`max-iterations`)"),
                Stopped::TimeLimit => Some("allow more time (`time-limit`)"),
                Stopped::Converged | Stopped::NoDescent => None,
            };
            warnings.extend(more.map(|more| {
                format!(
                    "{of}the training has not converged in {} iterations: its numbers are not those of least cost; {more}",
                    training.iterations
                )
            }));
        }
        let aliases: Vec<&str> = taken.iter().flat_map(|step| &step.aliases).map(String::as_str).collect();
        if let Some(first) = aliases.first() {
            let others =
                if aliases.len() > 1 { format!(" and {} more", aliases.len() - 1) } else { String::new() };
            warnings.push(format!(
                "{of}{first}{others} cannot be told from sums of the chosen terms on the estimation rows, as where an input has few levels"
            ));
        }
    }
    for fit in &report.fit {
        if let (Some(percent), Some(Part::Estimation), Horizon::FreeRun) =
            (fit.percent, fit.part, fit.horizon)
            && percent <= 0.0
        {
            let of = if model.outputs.len() > 1 { format!("{}: ", fit.output) } else { String::new() };
            warnings.push(format!(
                "{of}the free run on the estimation rows is no better than the mean of the output: take other lags, another map, or \
                 validation rows that the choice evaluates"
            ));
        }
    }
    // The first output stands for all: they read the same values.
    for fit in report.fit.iter().filter(|fit| Some(&fit.output) == model.outputs.first().map(|own| &own.name))
    {
        if let (Some(outside), Some(part), Horizon::FreeRun) = (fit.outside, fit.part, fit.horizon)
            && outside > 0.1
            && part != Part::Estimation
        {
            let name = if part == Part::Test { "test" } else { "validation" };
            warnings.push(format!(
                "in {:.0} % of the {name} rows the free run reads values outside of those of the estimation rows: the model extrapolates",
                100.0 * outside
            ));
        }
    }
    warnings
}

#[cfg(test)]
mod tests;
