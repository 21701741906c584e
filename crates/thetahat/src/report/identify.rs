mod in_states;
mod integrating;
mod nonlinear;
mod step_test;

use std::borrow::Cow;
use std::ops::{ControlFlow, Range};

use rayon::prelude::*;
use thetahat_numerics::optimize::{Deadline, Monitor, Search};
use thetahat_numerics::regression::{largest, sum};

use super::fitted_rows::goes_through;
use super::pending::{Open, OpenPolynomial, PendingEvaluation};
use super::plan::Plan;
use super::schema::{Data, Estimation, Missing, Report};
use super::shares::Shares;
use super::warnings::warnings;
use crate::Error;
use crate::data::{Decision, Detrend, FindingKind, Log, Offset, Prefiltered, Record, Rows, Source, digests};
use crate::estimate::{self, Beside, Constant, Estimate, Fitted, Initial, Method, OutputOffset, enough};
use crate::inspect::{is_few_sinusoids, outliers_of};
use crate::model::{Interval, Orders, ProcessStructure, Quantity, Signal};
use crate::respond::{Horizon, InitialCondition, innovations};
use crate::select::{self, Automatic, Choice, Focus, SelectedModel, Selection, Task};
use in_states::InStates;
use integrating::Integrating;
use nonlinear::Nonlinear;
use step_test::StepTest;

/// Below this fraction of a channel's size, what detrending leaves is rounding.
pub(super) const ROUNDING: f64 = 1e-13;
/// So many rows are named.
const LISTED: usize = 5;

/// Fits a model to a log and reports on it: the whole way from data to figures.
///
/// The log is used up: its channels become deviations from their offsets in place.
///
/// # Errors
/// [`Error::Argument`] and [`Error::Data`] for channels or rows that are not there; [`Error::Undetermined`] if the data
/// cannot determine the parameters, which are named.
///
/// ```
/// use thetahat::data::{Channel, Log};
/// use thetahat::model::Orders;
/// use thetahat::report::{Plan, identify};
///
/// let u: Vec<f64> = (0..200).map(|t| f64::from(t * t % 7)).collect();
/// let mut y = vec![20.0];
/// for t in 1..u.len() {
///     y.push(20.0 + 0.8 * (y[t - 1] - 20.0) + 0.5 * u[t - 1]);
/// }
/// let channel = |name: &str, values| Channel { name: name.into(), values };
/// let log = Log::new(vec![channel("u", u), channel("y", y)], 0.1)?;
/// let plan = Plan {
///     estimate: vec!["1..150".parse()?],
///     validate: vec!["151..200".parse()?],
///     ..Plan::new(&["u"], "y", Orders::arx(1, &[1], &[1])?)
/// };
/// let report = identify(log, &[], &plan)?;
/// assert!(report.model.polynomials("stability")?.stable);
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
    log: Log,
    sources: &[Source],
    plan: &Plan,
    monitor: Monitor<'_>,
) -> Result<Report, Error> {
    let (pending, log) = fit(log, sources, plan, monitor)?;
    pending.evaluate_on(&log)
}

impl PendingEvaluation {
    /// [`identify_monitored`] up to the figures.
    ///
    /// # Errors
    /// As for [`identify_monitored`].
    pub fn new(log: Log, sources: &[Source], plan: &Plan, monitor: Monitor<'_>) -> Result<Self, Error> {
        Ok(fit(log, sources, plan, monitor)?.0)
    }
}

/// Fits the model; also gives the log as deviations.
fn fit(
    mut log: Log,
    sources: &[Source],
    plan: &Plan,
    monitor: Monitor<'_>,
) -> Result<(PendingEvaluation, Log), Error> {
    plan.check()?;
    let names = channels(&log, plan)?;
    let Shares { estimation, validation, parts } =
        Shares::of(&plan.estimate, &plan.validate, plan.split, log.rows())?;
    let digests = digests(&log, &names, &estimation)?;
    let missing =
        names.iter().map(|name| Ok(Missing { channel: (*name).to_owned(), rows: log.missing(name)? }));
    let missing = missing.collect::<Result<Vec<_>, Error>>()?;
    let mut decisions = Vec::new();
    if matches!(plan.choice, Choice::Automatic(_)) && !plan.uses_outliers {
        decisions.extend(without_outliers(&mut log, plan, &estimation)?);
    }
    let segments = log.segments(&names, &estimation)?;
    if segments.is_empty() {
        return Err(Error::data(
            "no estimation row has a value in every channel; name other rows or channels",
        ));
    }
    if let Choice::Known(orders) = &plan.choice {
        let record = estimation_rows(&log, plan, orders, &estimation)?;
        let exact = matches!(plan.method, Method::ExactLikelihood(_));
        let left_out = if exact || plan.initial == Initial::Zero { 0 } else { orders.conditioned() };
        let rows = record.segments.iter().zip(&record.past);
        enough(
            rows.map(|(rows, past)| rows.len().saturating_sub(left_out.saturating_sub(*past))).sum(),
            orders,
        )?;
    }
    let compared = Compared {
        estimation: parts.as_ref().map_or(&estimation, |parts| &parts.estimation),
        validation: parts.as_ref().map_or(&validation, |parts| &parts.validation),
    };
    let raw = matches!(plan.choice, Choice::Automatic(_)).then(|| log.clone());
    let rivals = match &raw {
        Some(raw) => Rivals::of(raw, plan, compared.estimation)?,
        None => Rivals::default(),
    };
    let padding = log.padding(&names)?;
    // What an input has done while the output was missing is in the output after it.
    let driven = match &plan.choice {
        Choice::Known(orders) => estimation_rows(&log, plan, orders, &estimation)?.segments,
        Choice::Grid(_) | Choice::Automatic(_) => segments.clone(),
    };
    let rows_of = |name: &str| if name == plan.output { &segments } else { &driven };
    let origins: Vec<_> = names.par_iter().map(|name| Origin::of(&log, name, plan, rows_of(name))).collect();
    let signals =
        names.iter().zip(origins).map(|(name, origin)| origin?.taken(&mut log, name, plan, rows_of(name)));
    let signals: Vec<Signal> = signals.collect::<Result<_, Error>>()?;
    let (output, inputs) = signals.split_last().ok_or_else(|| Error::data("there is no output"))?;
    let beside = Beside::new(&log, &segments, plan.trend)?;
    let band =
        plan.prefilter.map(|band| Prefiltered::new(&band, &log, &plan.inputs, &plan.output)).transpose()?;
    let record = |rows: &[Rows]| match &band {
        Some(band) => band.record(rows),
        None => log.record(&plan.inputs, &plan.output, rows),
    };
    let mut method = plan.method.clone();
    let (mut selection, mut orders, initial_parameters) = match &plan.choice {
        Choice::Known(orders) => (None, orders.clone(), None),
        Choice::Grid(_) | Choice::Automatic(_) => {
            let Chosen { found, with_constant, process, order, nonlinear } =
                selected(&record, plan, &compared, &beside, &rivals, (sources, monitor))?;
            let SelectedModel { selection, decisions: found, mut initial_parameters } = found;
            decisions.extend(found);
            if let Some((structure, test)) = process.zip(rivals.step_test) {
                let report = test.fit(structure, selection, decisions, (sources, monitor))?;
                return Ok((PendingEvaluation::done(report), log));
            }
            if let Some(report) = nonlinear {
                let report = Report { selection: Some(selection), decisions, ..report };
                return Ok((PendingEvaluation::done(report), log));
            }
            if let Some((order, in_states)) = order.zip(rivals.in_states) {
                let report = in_states.fit(order, selection, decisions, (sources, monitor))?;
                return Ok((PendingEvaluation::done(report), log));
            }
            if let (Method::PredictionError(search), false) = (&mut method, with_constant) {
                search.initial_parameters = initial_parameters.take();
            }
            let orders = selection.chosen.orders.clone();
            (Some(selection), orders, initial_parameters)
        }
    };
    plan.check_focus(&orders)?;
    if let Method::PredictionError(search) = &mut method {
        search.plant_first = plan.focus == Focus::Simulation && !matches!(plan.choice, Choice::Automatic(_));
    }
    let rows = |orders: &Orders| match &band {
        Some(band) => band.record_alone(&estimation),
        None => estimation_rows(&log, plan, orders, &estimation),
    };
    let drifts = selection.as_ref().is_some_and(|selection| selection.noise_integrates);
    if drifts {
        orders = select::drifting(&orders);
        decisions.push(drift(&plan.output, &orders));
    }
    let mut seen = rows(&orders)?;
    let task = estimate::Task {
        data: &seen,
        inputs: &plan.inputs,
        orders: &orders,
        method: &method,
        initial: plan.initial,
        monitor,
    };
    let mut fitted = match &method {
        Method::PredictionError(search) if drifts => {
            let estimate = estimate::with_noise_integrator(&seen, &orders, &plan.inputs, search, monitor)?;
            Fitted::without_offset(estimate)
        }
        _ => task.fit(plan.constant(), &beside, initial_parameters)?,
    };
    let wants_noise = |selection: &&mut Selection| !drifts && plan.estimates_noise_after_plant(selection);
    if let Some(selection) = selection.as_mut().filter(wants_noise) {
        let order = estimate::noise_order(&seen, &orders, &fitted.estimate)?;
        if order > 0 {
            let Orders { nb, nf, nk, .. } = &orders;
            let with_noise = Orders::bj(nb, 0, order, nf, nk)?;
            let plant = fitted.estimate.parameters();
            let method = match &method {
                Method::PredictionError(search) => Method::PredictionError(Search {
                    plant_first: true,
                    initial_parameters: Some(plant.to_vec()),
                    ..search.clone()
                }),
                other => other.clone(),
            };
            let record = rows(&with_noise)?;
            let constant = if fitted.offset.is_some() { Constant::Yes } else { Constant::No };
            let task = estimate::Task { data: &record, orders: &with_noise, method: &method, ..task };
            fitted = task.fit(constant, &beside, None)?;
            selection.steps.push(format!(
                "After it an autoregression of order {order} describes what its free run leaves, for predictions: {with_noise}."
            ));
            (seen, orders) = (record, with_noise);
        }
    }
    let task = estimate::Task {
        data: &seen,
        orders: &orders,
        inputs: &plan.inputs,
        method: &method,
        initial: plan.initial,
        monitor,
    };
    if band.is_none() && !drifts && fitted.offset.is_none() && plan.takes_output_offset() {
        let taken = Beside::new(&log, &segments, plan.detrend == Detrend::Linear)?;
        fitted.open = task.left_open(&taken, &fitted.estimate)?;
    }
    if band.is_some() {
        let variance = unfiltered_variance(&fitted.estimate, &orders, &log, plan, &estimation)?;
        fitted.estimate = fitted.estimate.of_prefiltered(&seen, &orders, variance);
        fitted.criteria = fitted.estimate.criteria();
    }
    // A prefilter leaves rows out, but cuts nothing.
    let segments = if band.is_some() { segments } else { seen.segments };
    let Fitted { estimate, offset, open, .. } = &fitted;
    let mut model = estimate.to_model(&orders, log.sample_time(), inputs.to_vec(), output.clone())?;
    model.offset_covariance.clone_from(open);
    let record = log.record(&plan.inputs, &plan.output, &estimation)?;
    let sinusoids: Vec<bool> =
        record.inputs.iter().map(|input| is_few_sinusoids(input, &record.segments)).collect();
    for (gain, _) in model.dc_gain.iter_mut().zip(&sinusoids).filter(|(_, few)| **few) {
        if let Some(gain) = gain {
            (gain.standard_error, gain.interval) = (None, Some(Interval::OPEN));
        }
    }
    let taken = [output.offset, offset.map_or_else(Offset::default, |found| found.offset)];
    if let Some(found) = offset {
        log.remove(&output.name, &found.offset);
        model.output.offset = Offset {
            level: output.offset.level + found.offset.level,
            slope: output.offset.slope + found.offset.slope,
        };
    }

    let closed = decisions.iter().any(|decision| decision.kind == FindingKind::Feedback);
    if let Some(rival) = rivals.integrating.filter(|_| !closed) {
        let record = log.record(&plan.inputs, &plan.output, &estimation)?;
        if let Some((report, decision)) = rival.instead(&model, &record, (sources, monitor))? {
            decisions.retain(|other| other.kind != FindingKind::Drift);
            decisions.push(decision);
            let decisions = [decisions, report.decisions].concat();
            return Ok((PendingEvaluation::done(Report { selection, decisions, ..report }), log));
        }
    }

    let data = Data {
        logs: sources.to_vec(),
        digests,
        rows: log.rows(),
        sample_time: log.sample_time(),
        detrend: plan.detrend.to_string(),
        prefilter: plan.prefilter,
        estimation: estimation.clone(),
        validation: validation.clone(),
        split: parts,
        segments: segments.iter().map(Rows::from_positions).collect(),
        missing,
        time_gaps: log.gaps(),
    };
    let estimated = estimation_of(&fitted, output.offset);
    let mut report = Report { selection, decisions, ..Report::new(data, model.clone(), estimated) };
    report.warnings = warnings(&report, &model);
    let fitted = |first: usize| estimation.iter().any(|rows| rows.last() >= first);
    report
        .warnings
        .extend(padding.filter(|padding| fitted(padding.rows.first())).map(|padding| padding.to_string()));
    if let Some(band) = &band {
        report.warnings.extend(band.warning(&estimation)?);
    }
    let grid = if let Choice::Grid(grid) = &plan.choice { Some(grid.clone()) } else { None };
    let open = Open::Polynomial(OpenPolynomial { model, grid, focus: plan.focus, taken }.into());
    Ok((PendingEvaluation::open(report, open), log))
}

/// Takes the outliers of the output for missing in the rows to estimate on; and what is to be said of it.
fn without_outliers(log: &mut Log, plan: &Plan, rows: &[Rows]) -> Result<Option<Decision>, Error> {
    let all = outliers_of(log, &plan.output, &plan.inputs)?;
    let far: Vec<usize> = all
        .into_iter()
        .filter(|row| rows.iter().any(|rows| (rows.first()..=rows.last()).contains(row)))
        .collect();
    let shown: Vec<String> = far.iter().take(LISTED).map(ToString::to_string).collect();
    if shown.is_empty() {
        return Ok(None);
    }
    log.forget(&plan.output, &far);
    let (plural, more) =
        if far.len() == 1 { ("", "") } else { ("s", if far.len() > LISTED { ", …" } else { "" }) };
    Ok(Some(Decision {
        kind: FindingKind::Outliers,
        channels: vec![plan.output.clone()],
        because: format!(
            "output '{}' has {} value{plural} far from {} neighbours, at row{plural} {}{more}",
            plan.output,
            far.len(),
            if far.len() == 1 { "its" } else { "their" },
            shown.join(", ")
        ),
        did: format!("{} taken for missing", if far.len() == 1 { "it is" } else { "they are" }),
        instead: "`norm` 2".to_owned(),
    }))
}

/// The channels that a plan names, which the log has, the inputs first.
pub(super) fn channels<'p>(log: &Log, plan: &'p Plan) -> Result<Vec<&'p str>, Error> {
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
    Ok(names)
}

/// The record that models of these orders are fitted to: it goes on through missing outputs where no past one is
/// needed.
pub(super) fn estimation_rows<'l>(
    log: &'l Log,
    plan: &Plan,
    orders: &Orders,
    rows: &[Rows],
) -> Result<Record<'l>, Error> {
    let squares = matches!(plan.method, Method::PredictionError(_) | Method::Constrained(_));
    let exact = matches!(plan.method, Method::ExactLikelihood(_));
    if exact || squares && goes_through(orders, plan.initial) {
        return log.driven_record(&plan.inputs, &plan.output, rows);
    }
    log.record(&plan.inputs, &plan.output, rows)
}

/// The rows on which models are compared.
struct Compared<'a> {
    estimation: &'a [Rows],
    validation: &'a [Rows],
}

/// Models of other kinds that compete with polynomials, each where it may.
#[derive(Default)]
struct Rivals<'l> {
    step_test: Option<StepTest<'l>>,
    in_states: Option<InStates<'l>>,
    nonlinear: Option<Nonlinear<'l>>,
    integrating: Option<Integrating<'l>>,
}

impl<'l> Rivals<'l> {
    /// Those of a log as it was read.
    ///
    /// # Errors
    /// [`Error::Data`] for channels that are not there.
    fn of(log: &'l Log, plan: &Plan, rows: &[Rows]) -> Result<Self, Error> {
        Ok(Self {
            step_test: StepTest::of(log, plan, rows)?,
            in_states: InStates::of(log, plan),
            nonlinear: Nonlinear::of(log, plan),
            integrating: Integrating::of(log, plan),
        })
    }
}

/// A choice, whether all models had a constant, and the process, the order of the model in state space or the report of
/// the nonlinear one that is taken instead, if one is.
struct Chosen {
    found: SelectedModel,
    with_constant: bool,
    process: Option<ProcessStructure>,
    order: Option<usize>,
    nonlinear: Option<Report>,
}

/// The choice among several models. Where a constant is asked for or pays, all of them have one.
fn selected<'a>(
    record: &impl Fn(&[Rows]) -> Result<Record<'a>, Error>,
    plan: &Plan,
    compared: &Compared<'_>,
    beside: &Beside,
    rivals: &Rivals<'_>,
    (sources, monitor): (&[Source], Monitor<'_>),
) -> Result<Chosen, Error> {
    let Method::PredictionError(search) = &plan.method else {
        return Err(Error::argument(
            "method",
            "a choice among models compares prediction errors; give the orders for another method or criterion",
        ));
    };
    let held_out = compared.validation;
    let held_out = if held_out.is_empty() { None } else { Some(record(held_out)?) };
    let estimation = record(compared.estimation)?;
    let with_constant = match plan.constant() {
        _ if plan.trend => true,
        Constant::Yes => true,
        Constant::No => false,
        // What is measured from a rest is at its level already, but for what the chosen model finds.
        Constant::Auto if matches!(plan.detrend, Detrend::Start(_)) => false,
        Constant::Auto => plan.initial != Initial::Zero && select::constant_pays(&estimation),
    };
    let signals = if with_constant { beside.signals() } else { Vec::new() };
    let held_out = held_out.map(|held_out| held_out.with_inputs(&signals));
    let (choice, decision) = without_delays(&plan.choice, &estimation, &plan.inputs);
    let task = Task {
        estimation: &estimation.with_inputs(&signals),
        validation: held_out.as_ref(),
        inputs: &plan.inputs,
        select: plan.select,
        focus: if decision.is_some() && plan.focus == Focus::Auto { Focus::Prediction } else { plan.focus },
        initial: plan.initial,
        may_drift: plan.initial == Initial::Auto && plan.prefilter.is_none() && !plan.trend,
        search,
        deadline: Deadline::after(search.time_limit),
        monitor,
    };
    let mut found = select::choose(&task, &choice)?;
    found.decisions.extend(decision);
    if with_constant {
        let what = if plan.trend { "a constant and a trend" } else { "a constant" };
        found.selection.steps.push(format!("All models were compared with {what} beside them."));
    }
    let (found, process) = match &rivals.step_test {
        Some(test) => test.compete(&task, found)?,
        None => (found, None),
    };
    let (found, order) = match rivals.in_states {
        Some(_) if process.is_none() => select::states(&task, found, plan.constant())?,
        _ => (found, None),
    };
    let (found, nonlinear) = match &rivals.nonlinear {
        Some(rival) if process.is_none() && order.is_none() => rival.compete(&task, found, sources)?,
        _ => (found, None),
    };
    Ok(Chosen { found, with_constant, process, order, nonlinear })
}

/// The choice without a search for delays where all inputs are sums of few sinusoids, which do not tell one delay from
/// another; and what is to be said of that.
fn without_delays<'c>(
    choice: &'c Choice,
    record: &Record<'_>,
    inputs: &[String],
) -> (Cow<'c, Choice>, Option<Decision>) {
    let Choice::Automatic(automatic @ Automatic { nk: None, .. }) = choice else {
        return (Cow::Borrowed(choice), None);
    };
    if inputs.is_empty() || !record.inputs.iter().all(|input| is_few_sinusoids(input, &record.segments)) {
        return (Cow::Borrowed(choice), None);
    }
    let plural = if inputs.len() == 1 { " '" } else { "s '" };
    let are = if inputs.len() == 1 { "is a sum" } else { "are sums" };
    let decision = Decision {
        kind: FindingKind::FewSinusoids,
        channels: inputs.to_vec(),
        because: format!("input{plural}{}' {are} of a few sinusoids", inputs.join("', '")),
        did: "no delay is searched, no gain at rest is given, and errors one step ahead decide, as the log shows no more".to_owned(),
        instead: "`nk` or `focus`".to_owned(),
    };
    let nk = Some(vec![1; inputs.len()]);
    (Cow::Owned(Choice::Automatic(Automatic { nk, ..automatic.clone() })), Some(decision))
}

/// What a drift of the output changes.
fn drift(output: &str, orders: &Orders) -> Decision {
    Decision {
        kind: FindingKind::Drift,
        channels: vec![output.to_owned()],
        because: format!("the level of output '{output}' wanders, and no input makes it"),
        did: format!(
            "the noise of {orders} integrates (D has the root 1), free runs have a level of their own in each window, and no offset is known"
        ),
        instead: "`model` oe or `focus` simulation".to_owned(),
    }
}

/// The variance of the errors one step ahead of the unfiltered signals, sum e^2/(N - p) over the estimation rows.
fn unfiltered_variance(
    estimate: &Estimate,
    orders: &Orders,
    log: &Log,
    plan: &Plan,
    rows: &[Rows],
) -> Result<f64, Error> {
    let model = estimate.to_model(
        orders,
        log.sample_time(),
        vec![Signal::default(); orders.inputs()],
        Signal::default(),
    )?;
    let record = log.record(&plan.inputs, &plan.output, rows)?;
    let start = InitialCondition::natural(&model, Horizon::Steps { steps: 1 });
    let found = innovations(&model, &record, 1, start)?;
    let errors = || found.iter().flat_map(|found| found.counted_errors());
    let (samples, squares) = (errors().count(), sum(errors().map(|e| e * e)));
    Ok(squares / samples.saturating_sub(orders.parameters()).max(1) as f64)
}

/// What a channel is measured from, and how large it is before that is taken from it.
struct Origin {
    offset: Offset,
    largest: f64,
}

impl Origin {
    fn of(log: &Log, name: &str, plan: &Plan, segments: &[Range<usize>]) -> Result<Self, Error> {
        let by_hand = plan.offsets.iter().find(|(channel, _)| channel == name);
        let offset = match by_hand {
            Some(&(_, level)) => Offset { level, slope: 0.0 },
            None => Offset::estimate(plan.detrend, log, name, segments)?,
        };
        Ok(Self { offset, largest: largest_in(log, name, segments)? })
    }

    /// Takes the offset from the channel, in place.
    fn taken(
        self,
        log: &mut Log,
        name: &str,
        plan: &Plan,
        segments: &[Range<usize>],
    ) -> Result<Signal, Error> {
        let Self { offset, largest } = self;
        log.remove(name, &offset);
        let position = plan.inputs.iter().position(|input| input == name);
        let known = if let Choice::Known(orders) = &plan.choice { Some(orders) } else { None };
        let used = |input: usize| known.is_none_or(|orders| orders.nb.get(input).is_some_and(|&nb| nb > 0));
        if position.is_none_or(used) && largest_in(log, name, segments)? <= ROUNDING * largest {
            return Err(constant(name, position, known, plan.detrend == Detrend::Linear));
        }
        Ok(Signal { name: name.to_owned(), offset })
    }
}

/// The largest size of a channel's values in some segments.
fn largest_in(log: &Log, name: &str, segments: &[Range<usize>]) -> Result<f64, Error> {
    let values = &log.channel(name)?.values;
    Ok(segments.iter().map(|segment| largest(&values[segment.clone()])).fold(0.0, f64::max))
}

/// A channel that does not change, or a straight line.
pub(super) fn constant(name: &str, input: Option<usize>, known: Option<&Orders>, is_line: bool) -> Error {
    let (role, or) = if input.is_some() { ("input", ", or leave it out") } else { ("output", "") };
    let what = if is_line { "is a straight line" } else { "is constant" };
    let concerned = known.map_or_else(Vec::new, |orders| parameters_of(input, orders));
    let parameters =
        if concerned.is_empty() { "parameters of a model".to_owned() } else { concerned.join(", ") };
    Error::undetermined(
        concerned,
        format!(
            "{role} '{name}' {what} over the estimation rows: it cannot determine {parameters}; name rows in which it \
             changes{or}"
        ),
    )
}

/// The parameters that a channel determines: those of an input's B and F; for the output all of them.
fn parameters_of(input: Option<usize>, orders: &Orders) -> Vec<String> {
    let names = orders.names();
    let Some(input) = input else { return names };
    let b = orders.na + orders.nb[..input].iter().sum::<usize>();
    let f = names.len() - orders.nf[input..].iter().sum::<usize>();
    [&names[b..b + orders.nb[input]], &names[f..f + orders.nf[input]]].concat()
}

/// How the parameters were found, and what was found beside them: as it is measured from zero, where `taken` was taken
/// before.
pub(super) fn estimation_of(fitted: &Fitted, taken: Offset) -> Estimation {
    let Fitted { estimate, criteria, offset, .. } = fitted;
    let above = |base: f64, found: Quantity| Quantity { value: base + found.value, ..found };
    Estimation {
        level: offset.map(|OutputOffset { level, middle, .. }| above(taken.at(middle), level)),
        slope: offset.and_then(|found| Some(above(taken.slope, found.slope?))),
        procedure: estimate.procedure().clone(),
        initial: Some(estimate.initial()),
        samples: estimate.samples(),
        mse: estimate.mse(),
        criteria: *criteria,
        condition: estimate.condition(),
    }
}

#[cfg(test)]
mod offset_tests;
#[cfg(test)]
mod tests;
