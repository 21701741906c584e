use std::ops::{ControlFlow, Range};

use super::schema::{Data, Estimation, Missing, Report, Source};
use crate::data::{Detrend, Log, Offset, Record, Rows, checked};
use crate::estimate::{
    Estimate, Method, Monitor, Procedure, SearchOutcome, Stopped, enough, estimate_of_channels,
};
use crate::model::{cancel, near_cancellation};
use crate::respond::Start;
use crate::validate::{Fit, Horizon, Part};
use crate::{Error, Initial, Model, Orders, Signal};

/// Below this fraction of a channel's size, what detrending leaves is rounding.
const ROUNDING: f64 = 1e-13;
/// Condition numbers above this one are worth a word.
const ILL_CONDITIONED: f64 = 1e6;
/// Below this fit, in percent, a model explains little.
const POOR: f64 = 50.0;

/// What to fit, and to which part of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// The input channels, in the order of the orders.
    pub inputs: Vec<String>,
    /// The output channel.
    pub output: String,
    /// Rows to estimate on; none: all.
    pub estimate: Vec<Rows>,
    /// Rows to validate on.
    pub validate: Vec<Rows>,
    /// What is taken from each channel.
    pub detrend: Detrend,
    /// Channels whose offset is set by hand.
    pub offsets: Vec<(String, f64)>,
    /// The orders, which say the structure too.
    pub orders: Orders,
    /// How to estimate.
    pub method: Method,
    /// What stands for the samples before a segment.
    pub initial: Initial,
}

/// Fits a model to a log and reports on it: the whole way from data to figures.
///
/// The log is used up: its channels become deviations from their offsets in place.
///
/// # Errors
/// [`Error::Argument`] and [`Error::Data`] for channels or rows that are not there; [`Error::Undetermined`] if the data
/// cannot determine the parameters, which are named.
///
/// ```
/// use thetahat::{Channel, Detrend, Initial, Log, Method, Orders, Plan, identify};
///
/// let u: Vec<f64> = (0..200).map(|t| f64::from(t * t % 7)).collect();
/// let mut y = vec![20.0];
/// for t in 1..u.len() {
///     y.push(20.0 + 0.8 * (y[t - 1] - 20.0) + 0.5 * u[t - 1]);
/// }
/// let channel = |name: &str, values| Channel { name: name.into(), values };
/// let log = Log::new(vec![channel("u", u), channel("y", y)], 0.1)?;
/// let plan = Plan {
///     inputs: vec!["u".into()],
///     output: "y".into(),
///     estimate: vec!["1..150".parse()?],
///     validate: vec!["151..200".parse()?],
///     detrend: Detrend::Mean,
///     offsets: vec![],
///     orders: Orders::arx(1, &[1], &[1])?,
///     method: Method::default(),
///     initial: Initial::Auto,
/// };
/// let report = identify(log, &[], &plan)?;
/// assert!(report.model.stable);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn identify(log: Log, sources: &[Source], plan: &Plan) -> Result<Report, Error> {
    identify_monitored(log, sources, plan, &|_| ControlFlow::Continue(()))
}

/// [`identify`] that tells `monitor` of each iteration of a search. The monitor may end it.
///
/// # Errors
/// As for [`identify`]; [`Error::Interrupted`] if the monitor says so.
pub fn identify_monitored(
    mut log: Log,
    sources: &[Source],
    plan: &Plan,
    monitor: Monitor<'_>,
) -> Result<Report, Error> {
    let names: Vec<&str> = plan.inputs.iter().chain([&plan.output]).map(String::as_str).collect();
    for (position, name) in names.iter().enumerate() {
        log.channel(name)?;
        if names[..position].contains(name) {
            return Err(Error::argument(
                "channels",
                format!("'{name}' is named twice; a channel has one role"),
            ));
        }
    }
    if let Some((name, _)) = plan.offsets.iter().find(|(name, _)| !names.contains(&name.as_str())) {
        return Err(Error::argument(
            "offset",
            format!("'{name}' is neither an input nor the output; name one of: {}", names.join(", ")),
        ));
    }
    let all = vec![Rows::new(1, log.rows())?];
    let asked = if plan.estimate.is_empty() { &all } else { &plan.estimate };
    let estimation = checked("--estimate", asked, log.rows())?;
    let validation = checked("--validate", &plan.validate, log.rows())?;
    let segments = log.segments(&names, &estimation)?;
    if segments.is_empty() {
        return Err(Error::data(
            "no estimation row has a value in every channel; name other rows or channels",
        ));
    }
    let left_out = if plan.initial == Initial::Zero { 0 } else { plan.orders.conditioned() };
    enough(segments.iter().map(|segment| segment.len().saturating_sub(left_out)).sum(), &plan.orders)?;
    let missing = names.iter().map(|name| {
        let values = &log.channel(name)?.values;
        Ok(Missing {
            channel: (*name).to_owned(),
            rows: values.iter().filter(|value| value.is_nan()).count(),
        })
    });
    let missing = missing.collect::<Result<Vec<_>, Error>>()?;

    let signals = names.iter().map(|name| deviations(&mut log, name, plan, &segments));
    let signals: Vec<Signal> = signals.collect::<Result<_, Error>>()?;
    let (output, inputs) = signals.split_last().ok_or_else(|| Error::data("there is no output"))?;
    let record = log.record(&plan.inputs, &plan.output, &estimation)?;
    let estimate =
        estimate_of_channels(&record, &plan.inputs, &plan.orders, &plan.method, plan.initial, monitor)?;
    let model = Model::new(&plan.orders, &estimate, log.sample_time(), inputs.to_vec(), output.clone())?;

    let mut report = Report {
        schema: Report::schema_name(),
        generator: concat!("thetahat ", env!("CARGO_PKG_VERSION")).to_owned(),
        data: Data {
            logs: sources.to_vec(),
            rows: log.rows(),
            sample_time: log.sample_time(),
            detrend: plan.detrend.to_string(),
            estimation: estimation.clone(),
            validation: validation.clone(),
            segments: segments.iter().map(Rows::from_positions).collect(),
            missing,
            time_gaps: log.jumps(),
        },
        estimation: estimation_of(&estimate),
        fit: Vec::new(),
        warnings: Vec::new(),
        model,
    };
    report.warnings = warnings(&report);
    judge(&mut report, &record, &estimation, Part::Estimation, estimate.initial());
    if !validation.is_empty() {
        let record = log.record(&plan.inputs, &plan.output, &validation)?;
        judge(&mut report, &record, &validation, Part::Validation, estimate.initial());
    }
    report.warnings.extend(unstable_plant(&report));
    Ok(report)
}

/// A word on a plant that seems to be unstable, where F, which must be stable, explains little.
fn unstable_plant(report: &Report) -> Option<String> {
    let Procedure::PredictionError(search) = &report.estimation.procedure else { return None };
    let pole = search.unstable_pole?;
    let explained = report.fit.first()?.percent?;
    (explained < POOR).then(|| {
        format!(
            "the plant seems to be unstable: least squares finds a pole of modulus {pole:.4}; F must be stable and \
             explains {explained:.1} % only; an unstable plant needs A (arx or armax)"
        )
    })
}

/// Takes a channel's offset from it, in place.
fn deviations(log: &mut Log, name: &str, plan: &Plan, segments: &[Range<usize>]) -> Result<Signal, Error> {
    let by_hand = plan.offsets.iter().find(|(channel, _)| channel == name);
    let offset = match by_hand {
        Some(&(_, level)) => Offset { level, slope: 0.0 },
        None => Offset::estimate(plan.detrend, log, name, segments)?,
    };
    let largest = |log: &Log| -> Result<f64, Error> {
        let values = &log.channel(name)?.values;
        Ok(segments.iter().cloned().flatten().fold(0.0, |largest, row| values[row].abs().max(largest)))
    };
    let before = largest(log)?;
    log.remove(name, &offset);
    let position = plan.inputs.iter().position(|input| input == name);
    let used = position.is_none_or(|input| plan.orders.nb.get(input).is_some_and(|&nb| nb > 0));
    if used && largest(log)? <= ROUNDING * before {
        let role = if position.is_some() { "input" } else { "output" };
        let what = if plan.detrend == Detrend::Linear { "is a straight line" } else { "is constant" };
        let concerned = parameters_of(position, &plan.orders);
        return Err(Error::undetermined(
            concerned.clone(),
            format!(
                "{role} '{name}' {what} over the estimation rows: it cannot determine {}; name rows in which it \
                 changes, or leave it out",
                concerned.join(", ")
            ),
        ));
    }
    Ok(Signal { name: name.to_owned(), offset })
}

/// The parameters that a channel determines: those of an input's B and F; for the output all of them.
fn parameters_of(input: Option<usize>, orders: &Orders) -> Vec<String> {
    let names = orders.names();
    let Some(input) = input else { return names };
    let b = orders.na + orders.nb[..input].iter().sum::<usize>();
    let f = names.len() - orders.nf[input..].iter().sum::<usize>();
    [&names[b..b + orders.nb[input]], &names[f..f + orders.nf[input]]].concat()
}

fn estimation_of(estimate: &Estimate) -> Estimation {
    Estimation {
        procedure: estimate.procedure().clone(),
        initial: estimate.initial(),
        samples: estimate.samples(),
        mse: estimate.mse(),
        criteria: estimate.criteria(),
        condition: estimate.condition(),
    }
}

/// Adds the figures of one part of the log: one step ahead, and driven by the inputs alone where there are any.
fn judge(report: &mut Report, record: &Record<'_>, rows: &[Rows], part: Part, initial: Initial) {
    let first = match initial {
        Initial::Zero => Start::Zero,
        Initial::Estimate => Start::Estimated,
        Initial::Auto | Initial::Drop => Start::Measured,
    };
    let mut looks = vec![(Horizon::Steps { steps: 1 }, first)];
    if report.model.orders.nb.iter().any(|&nb| nb > 0) {
        looks.push((Horizon::FreeRun, Start::Estimated));
    }
    for (horizon, start) in looks {
        let name = match part {
            Part::Estimation => "estimation",
            Part::Validation => "validation",
        };
        match Fit::of(&report.model, record, rows, Some(part), horizon, start) {
            Ok((fit, _)) => {
                if fit.percent.is_none() {
                    let why = if fit.samples == 0 {
                        "its stretches without a gap are too short"
                    } else {
                        "the output is constant there, or the response overflows"
                    };
                    report.warnings.push(format!("no fit figure on the {name} rows, {horizon}: {why}"));
                }
                report.fit.push(fit);
            }
            Err(error) => {
                report.warnings.push(format!("no fit figure on the {name} rows, {horizon}: {error}"))
            }
        }
    }
}

fn warnings(report: &Report) -> Vec<String> {
    let (data, model) = (&report.data, &report.model);
    let mut warnings = Vec::new();
    for missing in data.missing.iter().filter(|missing| missing.rows > 0) {
        warnings.push(format!(
            "channel '{}' misses {} of {} values; the log is cut there",
            missing.channel, missing.rows, data.rows
        ));
    }
    if data.time_gaps > 0 {
        warnings.push(format!("jumps of the clock: {}; the log is cut there", data.time_gaps));
    }
    if data
        .validation
        .iter()
        .any(|v| data.estimation.iter().any(|e| v.first() <= e.last() && e.first() <= v.last()))
    {
        warnings.push("validation rows overlap estimation rows: their figures flatter the model".to_owned());
    }
    if !model.stable {
        let largest = model.poles.iter().map(|pole| pole.re.hypot(pole.im)).fold(0.0, f64::max);
        warnings.push(format!(
            "the model is unstable (largest pole {largest:.6}): its free run grows without bound"
        ));
    }
    if let Procedure::PredictionError(search) = &report.estimation.procedure {
        warnings.extend(search_warnings(search));
    }
    if let Some((pole, zero)) = near_cancellation(model) {
        warnings.push(format!(
            "{}: within their uncertainty they are one; lower both orders by one, unless they are known",
            cancel(&pole, &zero)
        ));
    }
    if let Some(condition) = report.estimation.condition.filter(|condition| *condition > ILL_CONDITIONED) {
        warnings.push(format!(
            "the regressors are nearly dependent (condition number {condition:.1e}): parameters are uncertain; lower the orders \
             or sample more slowly"
        ));
    }
    warnings
}

/// What is worth a word of a search.
fn search_warnings(search: &SearchOutcome) -> Vec<String> {
    let mut warnings = Vec::new();
    let iterations = search.iterations;
    match search.stopped {
        Stopped::Converged => {}
        Stopped::MaxIterations => warnings.push(format!(
            "no convergence in {iterations} iterations: the parameters are not those of least cost; allow more \
             (--max-iterations), or lower the orders"
        )),
        Stopped::TimeLimit => warnings.push(format!(
            "no convergence: the time was used up after {iterations} iterations; allow more (--time-limit)"
        )),
        Stopped::NoDescent if !search.stability_bound => warnings.push(format!(
            "the search stopped after {iterations} iterations where no step lowers the cost (gradient {:.1e}): the cost is \
             flat or rough there; lower the orders",
            search.gradient_norm
        )),
        Stopped::NoDescent => {}
    }
    if search.stability_bound {
        warnings.push(
            "the search ended at the border of stability: C or F has a root on the unit circle; the data want an \
             unstable or overdifferenced model, so use arx or armax for an unstable plant, or lower nc or nf"
                .to_owned(),
        );
    }
    warnings
}
