use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Report;
use super::apply::{check_sample_time, record_for};
use crate::data::{Detrend, Log, Offset, Prefiltered, Record, Rows, Source, checked};
use crate::estimate::exact_mean;
use crate::figures::{chance, fixed, number};
use crate::regression::sum;
use crate::respond::{Innovations, Response, check_steps, innovations, prediction_deviations};
use crate::validate::{Fit, Horizon, Relation, Residuals};
use crate::{Document, Error, Initial, Model, Orders, Procedure, Start, Structure};

const GENERATOR: &str = concat!("thetahat ", env!("CARGO_PKG_VERSION"));
/// The levels of the prediction intervals of which the coverage is counted.
const LEVELS: [f64; 4] = [0.5, 0.8, 0.95, 0.99];
/// A log of the fit gives its mean of e^2 again to this fraction; where initial conditions were estimated with the
/// parameters, they are as exact as the search was.
const SAME: f64 = 1e-9;
const NEARLY_SAME: f64 = 1e-6;
/// A mean of e^2 below this fraction of that of the output is rounding.
const ROUNDING: f64 = 1e-24;
/// A mean of the errors above this fraction of their standard deviation is worth a word, if it is as many standard errors
/// from zero as the second number says.
const OFF_CENTER: f64 = 0.3;
const CERTAIN: f64 = 4.0;
/// Lags that tests may be asked for.
const MOST_LAGS: usize = 1000;
/// Ratios of the errors to those expected that are worth a word.
const LIKELY: std::ops::RangeInclusive<f64> = 0.5..=1.5;

/// How a stored model does on a log. The JSON document `thetahat.validation/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Validation {
    /// `thetahat.validation/1`.
    pub schema: String,
    /// The program and version that wrote it.
    pub generator: String,
    /// The file name of the report, as it was given; none for a model that comes from no file.
    pub report: Option<String>,
    /// The logs, with the rows that each has among all of them.
    pub logs: Vec<Source>,
    /// The rows looked at.
    pub rows: Vec<Rows>,
    /// Whether the model was fitted to them.
    pub seen: Seen,
    /// Which polynomials the model has.
    pub structure: Structure,
    /// How long they are.
    pub orders: Orders,
    /// Whether all poles lie inside the unit circle.
    pub stable: bool,
    /// Whether the model says that its residuals are white: those of output error and by instrumental variables say
    /// nothing of the noise.
    pub white_expected: bool,
    /// 1 step ahead, some steps ahead, and the free run, each with its start.
    pub fit: Vec<Fit>,
    /// The errors one step ahead beside those that the model expects.
    pub noise: NoiseLevel,
    /// How often the measured output lies in the prediction intervals.
    pub coverage: Vec<Coverage>,
    /// What is left of the log; none where too few samples count.
    pub residuals: Option<Residuals>,
    /// What a careful reader should know, in plain words.
    pub warnings: Vec<String>,
}

/// Whether a model was fitted to the rows of a validation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Seen {
    /// To none of them: another log, or other rows.
    No,
    /// To some.
    Partly,
    /// To all.
    Yes,
}

/// The errors one step ahead beside those that the model expects.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NoiseLevel {
    /// The mean of e^2 on the log; none where no sample counts.
    pub mse: Option<f64>,
    /// The variance of e in the model.
    pub model: f64,
    /// The first over the second: 1 where the log is like the one of the fit.
    pub ratio: Option<f64>,
}

/// How often the measured output lies in the prediction intervals.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Coverage {
    /// How many steps ahead.
    pub steps: usize,
    /// The fraction that should lie inside, such as 0.95.
    pub level: f64,
    /// The fraction that does; none where no sample counts.
    pub actual: Option<f64>,
    /// The samples that count.
    pub samples: usize,
}

/// A validation and the signals it rests on, for charts.
#[derive(Debug, Clone, PartialEq)]
pub struct Validated {
    /// The document.
    pub validation: Validation,
    /// The signals.
    pub signals: Signals,
}

/// Measured and predicted signals, one value for each row of the log, in the log's own units; NaN where there is none.
#[derive(Debug, Clone, PartialEq)]
pub struct Signals {
    /// Seconds since the first row, one value for each row.
    pub time: Vec<f64>,
    /// The inputs, with their names.
    pub inputs: Vec<(String, Vec<f64>)>,
    /// The name of the output.
    pub output: String,
    /// The measured output.
    pub measured: Vec<f64>,
    /// One step ahead.
    pub predicted: Vec<f64>,
    /// Driven by the inputs alone; none for a model without inputs.
    pub simulated: Option<Vec<f64>>,
}

/// Several models on one log, side by side. The JSON document `thetahat.comparison/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Comparison {
    /// `thetahat.comparison/1`.
    pub schema: String,
    /// The program and version that wrote it.
    pub generator: String,
    /// The models in the order they were given.
    pub models: Vec<Validation>,
}

/// How to validate.
#[derive(Debug, Clone, PartialEq)]
pub struct ValidationPlan {
    /// Rows to look at; none: all.
    pub rows: Vec<Rows>,
    /// How to find the offsets on these rows; none: the model's own.
    pub detrend: Option<Detrend>,
    /// How many steps ahead to look besides 1.
    pub horizons: Vec<usize>,
    /// L, the lags of the tests of residuals: 1 … 1000. Short logs have fewer.
    pub lags: usize,
    /// Below this p-value there is a word of warning, and Anderson's count is not that of white residuals.
    pub alpha: f64,
    /// The levels of Anderson's test.
    pub alphas: Vec<f64>,
}

impl Default for ValidationPlan {
    fn default() -> Self {
        Self {
            rows: Vec::new(),
            detrend: None,
            horizons: vec![5],
            lags: 25,
            alpha: 0.05,
            alphas: vec![0.01, 0.02, 0.05, 0.1, 0.2],
        }
    }
}

impl ValidationPlan {
    /// Whether the plan makes sense, whatever the model and the log.
    ///
    /// # Errors
    /// [`Error::Argument`] for a horizon outside 1 … 10^6, lags outside 1 … 1000, a level outside 0 … 1.
    pub fn check(&self) -> Result<(), Error> {
        for &steps in &self.horizons {
            if steps == 0 {
                return Err(Error::argument("horizon", "a prediction looks at least one step ahead"));
            }
            check_steps("horizon", steps)?;
        }
        if !(1..=MOST_LAGS).contains(&self.lags) {
            return Err(Error::argument("lags", format!("{} is outside 1..{MOST_LAGS}", self.lags)));
        }
        let level = |alpha: &f64| *alpha > 0.0 && *alpha < 1.0;
        if !level(&self.alpha) {
            return Err(Error::argument("alpha", format!("{} is not between 0 and 1", self.alpha)));
        }
        if let Some(wrong) = self.alphas.iter().find(|alpha| !level(alpha)) {
            return Err(Error::argument("alphas", format!("{wrong} is not between 0 and 1")));
        }
        Ok(())
    }
}

/// Says how a stored model does on a log: fits, what is left, and whether intervals hold.
///
/// Every response starts as [`Start::natural`] has it. The model was fitted to rows of this log if the errors one step ahead
/// on the rows of the fit, with its offsets and its start, give `estimation.mse` again: to 1e-9 of it, or to 1e-6 where initial
/// conditions were estimated with the parameters. No other log does that. A model of several logs is recognised on all of
/// them, joined as they were, and not on one of them: its parameters then count as known from elsewhere, which makes the tests
/// a little milder. The log is used up. Cost: O(N (L + p)).
///
/// # Errors
/// [`Error::Data`] for channels or rows that are not there, no row with a value in every channel, or a sample time that
/// differs from the model's by more than 1 %; [`Error::Argument`] as for [`ValidationPlan::check`]. What cannot be
/// computed of a model on a log, such as the figures of too few samples, is none in the document, with a word why.
///
/// ```
/// use thetahat::{Channel, Log, Plan, Orders, ValidationPlan, identify, validate};
///
/// let u: Vec<f64> = (0..300).map(|t| f64::from(t * t % 11)).collect();
/// let mut y = vec![20.0];
/// for (t, u) in (1..300_u32).zip(&u) {
///     let noise = f64::from(t * t * t % 101) - 50.0;
///     y.push(20.0 + 0.8 * (y[y.len() - 1] - 20.0) + 0.5 * u + 0.003 * noise);
/// }
/// let channel = |name: &str, values| Channel { name: name.into(), values };
/// let log = Log::new(vec![channel("u", u), channel("y", y)], 0.1)?;
/// let plan = Plan { estimate: vec!["1..150".parse()?], ..Plan::new(&["u"], "y", Orders::arx(1, &[1], &[1])?) };
/// let report = identify(log.clone(), &[], &plan)?;
/// let fresh = ValidationPlan { rows: vec!["151..300".parse()?], ..ValidationPlan::default() };
/// let found = validate(&report, None, log, &[], &fresh)?.validation;
/// assert!(found.fit.iter().all(|fit| fit.percent.is_some_and(|percent| percent > 75.0)));
/// assert!(found.residuals.is_some_and(|residuals| residuals.samples == 150));
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn validate(
    report: &Report,
    name: Option<&str>,
    mut log: Log,
    sources: &[Source],
    plan: &ValidationPlan,
) -> Result<Validated, Error> {
    plan.check()?;
    let model = &report.model;
    check_sample_time(model, &log)?;
    let all = vec![Rows::new(1, log.rows())?];
    let rows = checked("--rows", if plan.rows.is_empty() { &all } else { &plan.rows }, log.rows())?;
    let inputs: Vec<String> = model.inputs.iter().map(|input| input.name.clone()).collect();
    let output = &model.output.name;
    let used: Vec<&str> = inputs.iter().chain([output]).map(String::as_str).collect();
    let segments = log.segments(&used, &rows)?;
    if segments.is_empty() {
        return Err(Error::data("no row has a value in every channel; name other rows"));
    }
    let copies = inputs.iter().map(|name| Ok((name.clone(), log.channel(name)?.values.clone())));
    let mut signals = Signals {
        time: (0..log.rows()).map(|row| log.elapsed(row)).collect(),
        inputs: copies.collect::<Result<_, Error>>()?,
        output: output.clone(),
        measured: log.channel(output)?.values.clone(),
        predicted: Vec::new(),
        simulated: None,
    };
    for signal in model.inputs.iter().chain([&model.output]) {
        log.remove(&signal.name, &signal.offset);
    }
    let seen =
        if is_of_fit(report, &log, &inputs) { overlap(&rows, &report.data.estimation) } else { Seen::No };
    // What the offsets of these rows differ from the model's.
    let mut level = Offset::default();
    if let Some(detrend) = plan.detrend {
        for name in &used {
            let own = Offset::estimate(detrend, &log, name, &segments)?;
            log.remove(name, &own);
            if name == output {
                level = own;
            }
        }
    }
    let record = |horizon| record_for(model, &log, &rows, horizon, Start::natural(model, horizon));
    let records =
        Records { ahead: record(Horizon::Steps { steps: 1 })?, free_run: record(Horizon::FreeRun)? };

    let white_expected = model.structure != Structure::Oe
        && !matches!(
            report.estimation.procedure,
            Procedure::InstrumentalVariables { .. } | Procedure::RefinedInstrumentalVariables { .. }
        );
    let mut validation = Validation {
        schema: Validation::SCHEMA.to_owned(),
        generator: GENERATOR.to_owned(),
        report: name.map(str::to_owned),
        logs: sources.to_vec(),
        seen,
        structure: model.structure,
        orders: model.orders.clone(),
        stable: model.stable,
        white_expected,
        fit: Vec::new(),
        noise: NoiseLevel { mse: None, model: model.noise_variance, ratio: None },
        coverage: Vec::new(),
        residuals: None,
        warnings: Vec::new(),
        rows,
    };
    let (one_step, free_run) = looks(model, &records, plan, &mut validation);
    // Back in the log's own units.
    let whole = |response: &Response| -> Vec<f64> {
        let offset = |row: usize| {
            let elapsed = log.elapsed(row);
            level.at(elapsed) + model.output.offset.at(elapsed)
        };
        response.values.iter().enumerate().map(|(row, value)| value + offset(row)).collect()
    };
    let driven = model.orders.nb.iter().any(|&nb| nb > 0);
    let nothing = || vec![f64::NAN; log.rows()];
    signals.predicted = one_step.as_ref().map_or_else(nothing, whole);
    signals.simulated = driven.then(|| free_run.as_ref().map_or_else(nothing, whole));
    test_residuals(report, &records.ahead, plan, &mut validation);
    warn(plan, &mut validation);
    Ok(Validated { validation, signals })
}

/// Whether the log, as deviations from the model's offsets, is the one that the model was fitted to.
fn is_of_fit(report: &Report, log: &Log, inputs: &[String]) -> bool {
    if report.data.estimation.is_empty() || report.data.estimation.iter().any(|rows| rows.last() > log.rows())
    {
        return false;
    }
    let start = estimation_start(report);
    let (output, rows) = (&report.model.output.name, &report.data.estimation);
    if is_exact(report) {
        let record = log.driven_record(inputs, output, rows);
        return record.is_ok_and(|record| gives_likelihood(report, &record));
    }
    if let Some(band) = report.data.prefilter {
        let band = Prefiltered::new(&band, log, inputs, output);
        return band
            .is_ok_and(|band| band.record_alone(rows).is_ok_and(|record| gives(report, &record, start)));
    }
    let Ok(record) = estimation_record(report, log, inputs) else { return false };
    if gives(report, &record, start) {
        return true;
    }
    // Estimates by older versions begin with their segments, and end where an output is missing.
    let Ok(mut record) = log.record(inputs, output, rows) else { return false };
    record.past.fill(0);
    gives(report, &record, start)
}

/// What the responses on the rows of the fit start from, as the estimate did.
pub(super) fn estimation_start(report: &Report) -> Start {
    match report.estimation.initial {
        // Its filter begins with a covariance: predictions have none.
        _ if is_exact(report) => Start::natural(&report.model, Horizon::Steps { steps: 1 }),
        Initial::Zero => Start::Zero,
        // Without F there is nothing to estimate, and C begins from e = 0 where it does in the fit.
        _ if !report.model.orders.is_linear() => Start::Estimate,
        _ => Start::Drop,
    }
}

/// The rows of the fit as the estimate saw them.
pub(super) fn estimation_record<'l>(
    report: &Report,
    log: &'l Log,
    inputs: &[String],
) -> Result<Record<'l>, Error> {
    let (output, rows) = (&report.model.output.name, &report.data.estimation);
    let by_instruments = matches!(
        report.estimation.procedure,
        Procedure::InstrumentalVariables { .. } | Procedure::RefinedInstrumentalVariables { .. }
    );
    if by_instruments {
        // They begin with their segments.
        let record = log.record(inputs, output, rows)?;
        return Ok(Record { past: vec![0; record.segments.len()], ..record });
    }
    if !is_exact(report) && goes_through(&report.model.orders, report.estimation.initial) {
        return log.driven_record(inputs, output, rows);
    }
    log.record(inputs, output, rows)
}

/// Whether an estimate of least squared errors goes on through missing outputs. From zeros, rows of least squares begin anew.
pub(super) fn goes_through(orders: &Orders, initial: Initial) -> bool {
    !orders.needs_past_outputs() && (orders.has_f() || initial != Initial::Zero)
}

/// Whether the estimate is that of largest exact likelihood.
pub(super) fn is_exact(report: &Report) -> bool {
    matches!(report.estimation.procedure, Procedure::ExactLikelihood(_))
}

/// Whether the Kalman filter on a record gives the variance of such an estimate again.
fn gives_likelihood(report: &Report, record: &Record<'_>) -> bool {
    let (model, estimation) = (&report.model, &report.estimation);
    let parameters: Vec<f64> = model.parameters.iter().map(|parameter| parameter.value).collect();
    let found = exact_mean(record, &model.orders, &parameters, estimation.initial);
    found.is_some_and(|(samples, mse)| {
        samples == estimation.samples && (mse - estimation.mse).abs() <= NEARLY_SAME * estimation.mse
    })
}

/// Whether the errors one step ahead on a record give the mean square of the estimate again.
fn gives(report: &Report, record: &Record<'_>, start: Start) -> bool {
    let (model, estimation) = (&report.model, &report.estimation);
    let tolerance = if start == Start::Estimate { NEARLY_SAME } else { SAME };
    let Ok(found) = innovations(model, record, 1, start) else { return false };
    let (mut samples, mut square, mut size) = (0, 0.0, 0.0);
    for found in &found {
        samples += found.counted_errors().count();
        square += found.counted_errors().map(|e| e * e).sum::<f64>();
        let outputs = found.counted.iter().cloned().flatten().map(|t| record.output[t]);
        size += outputs.map(|y| y * y).sum::<f64>();
    }
    let (mse, size) = (square / samples as f64, size / samples as f64);
    samples == estimation.samples
        && mse.is_finite()
        && size.is_finite()
        && (mse - estimation.mse).abs() <= tolerance * estimation.mse + ROUNDING * size
}

/// Whether rows are among others.
fn overlap(rows: &[Rows], fitted: &[Rows]) -> Seen {
    let shared = |rows: &Rows| -> usize {
        let each = fitted.iter().map(|fitted| {
            let (first, last) = (rows.first().max(fitted.first()), rows.last().min(fitted.last()));
            (last + 1).saturating_sub(first)
        });
        each.sum()
    };
    let (all, shared): (usize, usize) = (rows.iter().map(Rows::len).sum(), rows.iter().map(shared).sum());
    match shared {
        0 => Seen::No,
        _ if shared == all => Seen::Yes,
        _ => Seen::Partly,
    }
}

/// What predictions and free runs look at.
struct Records<'l> {
    ahead: Record<'l>,
    free_run: Record<'l>,
}

/// Fits, noise level and coverage; gives the prediction one step ahead and the free run.
fn looks(
    model: &Model,
    records: &Records<'_>,
    plan: &ValidationPlan,
    validation: &mut Validation,
) -> (Option<Response>, Option<Response>) {
    let mut steps: Vec<usize> = [&[1], &plan.horizons[..]].concat();
    steps.sort_unstable();
    steps.dedup();
    let mut one_step = None;
    let ahead = steps.into_iter().map(|steps| Horizon::Steps { steps });
    let driven = model.orders.nb.iter().any(|&nb| nb > 0);
    let mut free_run = None;
    for horizon in ahead.chain(driven.then_some(Horizon::FreeRun)) {
        let start = Start::natural(model, horizon);
        let record = if horizon == Horizon::FreeRun { &records.free_run } else { &records.ahead };
        let (fit, response) = match Fit::of(model, record, &validation.rows, None, horizon, start) {
            Ok(found) => found,
            Err(error) => {
                validation.warnings.push(format!("no fit figure, {horizon}: {error}"));
                continue;
            }
        };
        if fit.percent.is_none() {
            let why = if fit.samples == 0 {
                "the stretches without a gap are too short"
            } else {
                "the output is constant, or the response overflows"
            };
            validation.warnings.push(format!("no fit figure, {horizon}: {why}"));
        }
        if horizon == (Horizon::Steps { steps: 1 }) {
            let mse = fit.rmse.map(|rmse| rmse * rmse).filter(|mse| mse.is_finite());
            let ratio = mse.map(|mse| mse / model.noise_variance).filter(|ratio| ratio.is_finite());
            validation.noise = NoiseLevel { mse, ratio, ..validation.noise };
        }
        if let Horizon::Steps { steps } = horizon {
            validation.coverage.extend(coverage(model, record, &response, steps, start));
        }
        validation.fit.push(fit);
        match horizon {
            Horizon::Steps { steps: 1 } => one_step = Some(response),
            Horizon::Steps { .. } => {}
            Horizon::FreeRun => free_run = Some(response),
        }
    }
    (one_step, free_run)
}

/// How often the output lies in the intervals around predictions so many steps ahead, as wide as their deviations say.
fn coverage(
    model: &Model,
    record: &Record<'_>,
    response: &Response,
    steps: usize,
    start: Start,
) -> Vec<Coverage> {
    // Where that fails, the prediction has failed too.
    let deviations = prediction_deviations(model, record, steps, start).unwrap_or_default();
    let errors: Vec<(f64, f64)> = response
        .counted
        .iter()
        .cloned()
        .flatten()
        .filter_map(|t| Some(((record.output[t] - response.values[t]).abs(), *deviations.get(t)?)))
        .collect();
    let samples = errors.len();
    let known = samples > 0 && errors.iter().all(|(_, deviation)| deviation.is_finite() && *deviation > 0.0);
    let each = LEVELS.into_iter().map(|level| {
        // The deviations are those of Student's distribution, the quantiles are in units of its scale.
        let width = model.quantile(level) / model.student_factor();
        let inside = errors.iter().filter(|(error, deviation)| *error <= width * deviation).count();
        Coverage { steps, level, actual: known.then(|| inside as f64 / samples as f64), samples }
    });
    each.collect()
}

/// The tests of what is left one step ahead.
fn test_residuals(report: &Report, record: &Record<'_>, plan: &ValidationPlan, validation: &mut Validation) {
    let model = &report.model;
    let start = Start::natural(model, Horizon::Steps { steps: 1 });
    // Where that fails, the fit figure has said why.
    let Ok(found) = innovations(model, record, 1, start) else { return };
    let relation = match (validation.seen, &report.estimation.procedure) {
        (Seen::No, _) => Relation::Fresh,
        (_, Procedure::InstrumentalVariables { .. }) => Relation::Instrumental,
        _ => Relation::Fitted,
    };
    let mut alphas = plan.alphas.clone();
    alphas.sort_unstable_by(f64::total_cmp);
    alphas.dedup();
    match Residuals::of(model, record, &found, relation, plan.lags, &alphas, plan.alpha) {
        Ok(residuals) => {
            validation.residuals = Some(residuals);
            validation.warnings.extend(off_center(&found));
        }
        Err(why) => validation.warnings.push(format!("the residuals are not tested: {why}")),
    }
}

/// A word on errors that are not centered, which the tests take as an offset and no matter of dynamics.
fn off_center(found: &[Innovations]) -> Option<String> {
    let errors = || found.iter().flat_map(Innovations::counted_errors);
    let samples = errors().count() as f64;
    let mean = sum(errors().copied()) / samples;
    let deviation = (sum(errors().map(|e| (e - mean).powi(2))) / samples).sqrt();
    let share = mean.abs() / deviation;
    (share > OFF_CENTER && share * samples.sqrt() > CERTAIN).then(|| {
        format!(
            "the errors one step ahead have a mean of {}, {} times their standard deviation: the offsets of this \
             log are not those of the model; --detrend mean takes its own",
            number(mean),
            fixed(share, 2)
        )
    })
}

/// What is worth a word.
fn warn(plan: &ValidationPlan, validation: &mut Validation) {
    let mut words = Vec::new();
    if !validation.stable && validation.fit.iter().any(|fit| fit.horizon == Horizon::FreeRun) {
        words.push("the model is unstable: its free run grows without bound".to_owned());
    }
    if let NoiseLevel { mse: Some(mse), model, ratio: Some(ratio) } = validation.noise
        && !LIKELY.contains(&ratio)
    {
        let what = if ratio > 1.0 {
            "the log is noisier than that of the fit, or the model is not that of this plant"
        } else {
            "the log is quieter than that of the fit: the model's intervals are too wide for it"
        };
        words.push(format!(
            "the mean square of the errors one step ahead, {}, is {} times the model's noise variance, \
             {}: {what}",
            number(mse),
            fixed(ratio, 2),
            number(model)
        ));
    }
    if let Some(residuals) = &validation.residuals {
        let rejected = |p: Option<f64>| p.filter(|p| *p < plan.alpha);
        if validation.white_expected
            && let Some(p) = rejected(residuals.ljung_box.p_value)
        {
            words.push(format!(
                "the residuals are not white (Ljung-Box, {} lags, p-value {}): the model lacks dynamics of the plant or of \
                 the noise",
                residuals.ljung_box.lags,
                chance(p)
            ));
        }
        for independence in &residuals.independence {
            let input = &independence.input;
            let past = rejected(independence.past.p_value);
            if let Some(p) = past {
                let lags = largest(independence);
                let lags = if lags.is_empty() { String::new() } else { format!(": see lags {lags}") };
                words.push(format!(
                    "the residuals depend on past values of input '{input}' (p-value {}): the model lacks dynamics or has \
                     the wrong delay{lags}",
                    chance(p)
                ));
            }
            if independence.suspected {
                words.push(format!(
                    "input '{input}' follows past residuals: feedback from the output to the input is suspected"
                ));
            }
        }
    }
    validation.warnings.extend(words);
}

/// The past lags farthest outside their band, three at most, in rising order.
fn largest(independence: &crate::Independence) -> String {
    let behind = independence.past.lags + 1;
    let each = independence.correlation.iter().zip(&independence.band).skip(behind).zip(1_usize..);
    let mut outside: Vec<(f64, usize)> = each
        .map(|((value, band), lag)| (value.abs() / band, lag))
        .filter(|(ratio, _)| *ratio > 1.0)
        .collect();
    outside.sort_by(|(a, _), (b, _)| b.total_cmp(a));
    outside.truncate(3);
    outside.sort_by_key(|(_, lag)| *lag);
    let lags: Vec<String> = outside.iter().map(|(_, lag)| lag.to_string()).collect();
    lags.join(", ")
}

/// Puts several models side by side that were validated on the same rows of one log.
///
/// # Errors
/// [`Error::Argument`] if there is none, or they are of other rows.
pub fn compare(validated: &[Validated]) -> Result<Comparison, Error> {
    let Some(first) = validated.first() else {
        return Err(Error::argument("models", "there is none to compare; give at least one"));
    };
    let same = |other: &Validated| {
        (&other.validation.logs, &other.validation.rows) == (&first.validation.logs, &first.validation.rows)
    };
    if !validated.iter().all(same) {
        return Err(Error::argument("models", "they were validated on other rows; compare them on the same"));
    }
    Ok(Comparison {
        schema: Comparison::SCHEMA.to_owned(),
        generator: GENERATOR.to_owned(),
        models: validated.iter().map(|validated| validated.validation.clone()).collect(),
    })
}

impl Document for Validation {
    const NAME: &'static str = "validation";
    const SCHEMA: &'static str = "thetahat.validation/1";
    const REMEDY: &'static str = "give a file that validate wrote";
}

impl Document for Comparison {
    const NAME: &'static str = "comparison";
    const SCHEMA: &'static str = "thetahat.comparison/1";
    const REMEDY: &'static str = "give a file that compare wrote";
}

#[cfg(test)]
mod tests;
