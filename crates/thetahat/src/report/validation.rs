mod document;
mod options;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use thetahat_numerics::distribution::chi_square_tail;
use thetahat_numerics::regression::sum;

pub use document::{Comparison, Coverage, InSample, LikelihoodRatio, NoiseLevel, Validation};
pub use options::{Offsets, ValidationOptions};

use super::Report;
use super::evaluate::of_output;
use super::fitted_rows::rows_of_fit;
use super::suited::{check_offsets, check_sample_time};
use crate::data::{Detrend, Log, Offset, Rows, Source, checked};
use crate::document::GENERATOR;
use crate::estimate::{Criteria, NullDistribution};
use crate::figures::{chance, fixed, number};
use crate::model::Model;
use crate::respond::{Horizon, Innovations, OnLog, Response, Tested, check_steps};
use crate::spectrum::MeasuredResponse;
use crate::validate::{Fit, Residuals, nonlinearities, portmanteau};
use crate::{Document, Error};

/// The levels of the prediction intervals of which the coverage is counted.
const LEVELS: [f64; 4] = [0.5, 0.8, 0.95, 0.99];
/// Fits whose samples differ by more than this fraction have no comparable criteria.
const AS_MANY: f64 = 0.05;
/// A mean of the errors above this fraction of their standard deviation is worth a warning, if it is as many standard
/// errors from zero as the second number says.
const OFF_CENTER: f64 = 0.3;
const CERTAIN: f64 = 4.0;
/// This share of the samples may lie outside of what a nonlinear model was fitted to.
const FEW: f64 = 0.05;
/// So many samples stand for each lag of the test of all outputs together.
const PORTMANTEAU: usize = 10;
/// Lags that tests may be asked for.
const MOST_LAGS: usize = 1000;
/// Ratios of the errors to those expected that are worth a warning.
const LIKELY: std::ops::RangeInclusive<f64> = 0.5..=1.5;

/// A validation and the signals it rests on, for charts.
#[derive(Debug, Clone, PartialEq)]
pub struct Validated {
    /// The document.
    pub validation: Validation,
    /// The signals.
    pub signals: Signals,
    /// What the model was fitted to, and how well.
    fitted: FittedTo,
}

impl Validated {
    /// The same with how the model agrees with a measured frequency response.
    ///
    /// # Errors
    /// [`Error::Argument`] if the model is not linear, has another sample time, or none of the channels of the
    /// response.
    pub fn over(mut self, model: &Model, response: &MeasuredResponse) -> Result<Self, Error> {
        let all = model.linear("a frequency response")?;
        let own = all.iter().find(|own| own.output().name == response.output);
        let found = own.map(|own| response.agreement(own)).transpose()?.unwrap_or_default();
        if found.is_empty() {
            return Err(Error::argument(
                "model",
                format!(
                    "it has no input of the response to '{}'; compare models of the same channels",
                    response.output
                ),
            ));
        }
        self.validation.response = found;
        Ok(self)
    }
}

/// What makes fits comparable: the values of the outputs that they were made to, and how many counted.
#[derive(Debug, Clone, PartialEq)]
struct FittedTo {
    /// For each log and each output.
    outputs: Vec<Vec<String>>,
    samples: usize,
    criteria: Criteria,
    /// Of a model in equations the logarithm of the likelihood, and the parameters that were fitted.
    likelihood: Option<(f64, Vec<String>)>,
}

/// Measured and predicted signals, one value for each row of the log, in the log's own units; NaN where there is none.
#[derive(Debug, Clone, PartialEq)]
pub struct Signals {
    /// Seconds since the first row, one value for each row.
    pub time: Vec<f64>,
    /// The inputs, with their names.
    pub inputs: Vec<(String, Vec<f64>)>,
    /// The outputs.
    pub outputs: Vec<OutputSignals>,
}

/// An output as it was measured and as a model has it.
#[derive(Debug, Clone, PartialEq)]
pub struct OutputSignals {
    /// Its name.
    pub name: String,
    /// As it was measured.
    pub measured: Vec<f64>,
    /// One step ahead.
    pub predicted: Vec<f64>,
    /// Driven by the inputs alone; none for a model without inputs.
    pub simulated: Option<Vec<f64>>,
}

/// How to validate.
#[derive(Debug, Clone, PartialEq)]
pub struct ValidationPlan {
    /// Rows to validate on; none: all.
    pub rows: Vec<Rows>,
    /// How to find the offsets on these rows; none: the model's own.
    pub detrend: Option<Detrend>,
    /// Prediction horizons besides 1, in steps.
    pub horizons: Vec<usize>,
    /// L, the lags of the tests of residuals: 1 … 1000. Short logs have fewer.
    pub lags: usize,
    /// Below this p-value there is a warning, and Anderson's count is not that of white residuals.
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
                return Err(Error::argument("horizon", "0: give a number of steps from 1 on"));
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

/// Validates a stored model on a log: its fits, tests of its residuals, and the coverage of its intervals.
///
/// Every response starts from [`Model::natural_start`]. The model was fitted to rows of this log if these have the
/// values that `data.digests` of the report says, bit for bit. Of a model of several logs each is recognised by itself.
/// Cost: O(N (L + p)) for a polynomial model, O(N k p (n^3 + m n^2)) for one in equations that looks k steps ahead.
///
/// # Errors
/// [`Error::Data`] for channels or rows that are not there, no row with a value in every channel, a sample time that
/// differs from the model's by more than 1 %, or a clock that it cannot follow; [`Error::Argument`] as for
/// [`ValidationPlan::check`]. What cannot be computed of a model on a log, such as the figures of too few samples, is
/// none in the document, with a warning that says why.
///
/// ```
/// use thetahat::data::{Channel, Log};
/// use thetahat::model::Orders;
/// use thetahat::report::{Plan, ValidationPlan, identify, validate};
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
/// let found = validate(&report, None, &log, &[], &fresh)?.validation;
/// assert!(found.fit.iter().all(|fit| fit.percent.is_some_and(|percent| percent > 75.0)));
/// assert_eq!(found.residuals[0].samples, 150);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn validate(
    report: &Report,
    name: Option<&str>,
    log: &Log,
    sources: &[Source],
    plan: &ValidationPlan,
) -> Result<Validated, Error> {
    plan.check()?;
    let model = &report.model;
    check_sample_time(model, log)?;
    let all = vec![Rows::new(1, log.rows())?];
    let rows = checked("rows", if plan.rows.is_empty() { &all } else { &plan.rows }, log.rows())?;
    let names: Vec<&str> = model.channels().collect();
    let fitted = rows_of_fit(report, log)?;
    let seen = overlap(&rows, &fitted);
    let whole = model.inputs().iter().chain(model.outputs());
    let mut deviations = log.deviations(whole.map(|signal| (signal.name.as_str(), signal.offset)))?;
    if !model.takes_any_clock() && log.segments(&names, &rows)?.is_empty() {
        return Err(Error::data("no row has a value in every channel; name other rows"));
    }
    // What the offsets of these rows differ from the model's.
    let mut levels = vec![Offset::default(); names.len()];
    if let Some(detrend) = plan.detrend {
        check_offsets(model)?;
        let segments = log.segments(&names, &rows)?;
        for (name, level) in names.iter().zip(&mut levels) {
            *level = Offset::estimate(detrend, &deviations, name, &segments)?;
            deviations.remove(name, level);
        }
    }
    let on_log = model.on_log(&deviations, &rows, None, &fitted)?;

    let polynomial = model.as_polynomial();
    let white_expected = model.describes_noise() && !report.estimation.procedure.is_instrumental();
    let mut validation = Validation {
        schema: Validation::SCHEMA.to_owned(),
        generator: GENERATOR.to_owned(),
        report: name.map(str::to_owned),
        logs: sources.to_vec(),
        in_sample: seen,
        model: model.name(),
        parameters: model.free_parameters(),
        structure: polynomial.map(|model| model.structure),
        // The name of a seasonal ARIMA model says what its numbers stand for.
        orders: polynomial.filter(|model| model.factors.is_none()).map(|model| model.orders.clone()),
        stable: model.stability(),
        driven: on_log.is_driven(),
        white_expected,
        fit: Vec::new(),
        noise: Vec::new(),
        coverage: Vec::new(),
        residuals: Vec::new(),
        portmanteau: None,
        nonlinear: Vec::new(),
        response: Vec::new(),
        warnings: Vec::new(),
        rows,
    };
    let Evaluated { one_step, free_run } = evaluate(&*on_log, plan, &mut validation);
    test_residuals(report, &*on_log, plan, &mut validation);
    warn(plan, &mut validation);

    let inputs = model.inputs().iter().map(|input| {
        let name = &input.name;
        Ok((name.clone(), log.channel(name)?.values.clone()))
    });
    let inputs = inputs.collect::<Result<Vec<_>, Error>>()?;
    let outputs =
        model.outputs().iter().zip(&levels[inputs.len()..]).enumerate().map(|(index, (signal, level))| {
            // Back in the log's own units.
            let whole = |responses: &Option<Vec<Response>>| -> Vec<f64> {
                let Some(responses) = responses else { return vec![f64::NAN; log.rows()] };
                let offset = |row: usize| {
                    let elapsed = log.elapsed(row);
                    level.at(elapsed) + signal.offset.at(elapsed)
                };
                responses[index].values.iter().enumerate().map(|(row, value)| value + offset(row)).collect()
            };
            Ok(OutputSignals {
                name: signal.name.clone(),
                measured: log.channel(&signal.name)?.values.clone(),
                predicted: whole(&one_step),
                simulated: validation.driven.then(|| whole(&free_run)),
            })
        });
    let signals = Signals {
        time: (0..log.rows()).map(|row| log.elapsed(row)).collect(),
        inputs,
        outputs: outputs.collect::<Result<_, Error>>()?,
    };
    let digest = |digests: &BTreeMap<String, String>| -> Vec<String> {
        model.outputs().iter().filter_map(|output| digests.get(&output.name).cloned()).collect()
    };
    let fitted = FittedTo {
        outputs: report.data.digests.iter().map(digest).collect(),
        samples: report.estimation.samples,
        criteria: report.estimation.criteria,
        likelihood: report.estimation.procedure.equations().map(|outcome| {
            let names = outcome.unknown.iter().map(|unknown| unknown.name.clone());
            (outcome.log_likelihood, names.collect())
        }),
    };
    Ok(Validated { validation, signals, fitted })
}

/// Whether rows are among others.
fn overlap(rows: &[Rows], fitted: &[Rows]) -> InSample {
    let shared = |rows: &Rows| -> usize {
        let each = fitted.iter().map(|fitted| {
            let (first, last) = (rows.first().max(fitted.first()), rows.last().min(fitted.last()));
            (last + 1).saturating_sub(first)
        });
        each.sum()
    };
    let (all, shared): (usize, usize) = (rows.iter().map(Rows::len).sum(), rows.iter().map(shared).sum());
    match shared {
        0 => InSample::No,
        _ if shared == all => InSample::Yes,
        _ => InSample::Partly,
    }
}

/// The prediction one step ahead and the free run, where they could be computed.
struct Evaluated {
    one_step: Option<Vec<Response>>,
    free_run: Option<Vec<Response>>,
}

/// Fits, noise level and coverage.
fn evaluate(on_log: &dyn OnLog, plan: &ValidationPlan, validation: &mut Validation) -> Evaluated {
    let mut steps: Vec<usize> = [&[1], &plan.horizons[..]].concat();
    steps.sort_unstable();
    steps.dedup();
    let mut evaluated = Evaluated { one_step: None, free_run: None };
    let ahead = steps.into_iter().map(|steps| Horizon::Steps { steps });
    for horizon in ahead.chain(on_log.is_driven().then_some(Horizon::FreeRun)) {
        let start = on_log.natural_start(horizon);
        let responses = match on_log.respond(horizon, start) {
            Ok(responses) => responses,
            Err(error) => {
                validation.warnings.push(format!("no fit figure, {horizon}: {error}"));
                continue;
            }
        };
        for (index, (response, output)) in responses.iter().zip(on_log.outputs()).enumerate() {
            let (name, measured) = (&output.name, on_log.measured(index));
            let mut fit = Fit::new(name, measured, response, &validation.rows, None, (horizon, start));
            fit.outside = on_log.outside(index, &responses, horizon);
            if fit.percent.is_none() {
                let why = if fit.samples == 0 {
                    "the segments without a gap are too short"
                } else {
                    "the output is constant, or the response overflows"
                };
                let which = of_output(on_log, name);
                validation.warnings.push(format!("no fit figure{which}, {horizon}: {why}"));
            }
            if horizon == (Horizon::Steps { steps: 1 }) {
                let mse = fit.rmse.map(|rmse| rmse * rmse).filter(|mse| mse.is_finite());
                let (variance, ratio) = on_log.noise(index, mse);
                let ratio = ratio.filter(|ratio| ratio.is_finite());
                validation.noise.push(NoiseLevel { output: name.clone(), mse, model: variance, ratio });
            }
            validation.fit.push(fit);
        }
        match horizon {
            Horizon::Steps { steps } => {
                // Where that fails, the prediction has failed too.
                let deviations = on_log.deviations(steps, start).unwrap_or_default();
                for (index, response) in responses.iter().enumerate() {
                    let deviations = deviations.get(index).map_or(&[][..], Vec::as_slice);
                    validation.coverage.extend(coverage(on_log, index, response, deviations, steps));
                }
                if steps == 1 {
                    evaluated.one_step = Some(responses);
                }
            }
            Horizon::FreeRun => evaluated.free_run = Some(responses),
        }
    }
    validation.warnings.extend(unknown_range(&validation.fit));
    evaluated
}

/// A warning where a nonlinear model read values outside of those that it was fitted to, for more than a few samples:
/// it knows nothing of them.
fn unknown_range(fits: &[Fit]) -> Option<String> {
    let shares = fits.iter().filter_map(|fit| Some((fit.outside?, fit)));
    let (share, fit) = shares.max_by(|(one, _), (other, _)| one.total_cmp(other))?;
    (share > FEW).then(|| {
        format!(
            "for {} % of the samples of '{}', {}, the model read values outside of those that it was fitted to, of which it knows nothing: fit it to \
             a log that covers them",
            fixed(100.0 * share, 0),
            fit.output,
            fit.horizon
        )
    })
}

/// How often an output lies in the intervals around predictions this many steps ahead, as wide as their deviations say.
fn coverage<'a>(
    on_log: &'a dyn OnLog,
    output: usize,
    response: &Response,
    deviations: &[f64],
    steps: usize,
) -> impl Iterator<Item = Coverage> + use<'a> {
    let measured = on_log.measured(output);
    let errors: Vec<(f64, f64)> = response
        .counted
        .iter()
        .cloned()
        .flatten()
        .filter_map(|t| Some(((measured[t] - response.values[t]).abs(), *deviations.get(t)?)))
        .collect();
    let samples = errors.len();
    let known = samples > 0 && errors.iter().all(|(_, deviation)| deviation.is_finite() && *deviation > 0.0);
    LEVELS.into_iter().map(move |level| {
        let width = on_log.quantile(level);
        let inside = errors.iter().filter(|(error, deviation)| *error <= width * deviation).count();
        Coverage {
            output: on_log.outputs()[output].name.clone(),
            steps,
            level,
            actual: known.then(|| inside as f64 / samples as f64),
            samples,
        }
    })
}

/// The tests of what is left one step ahead.
fn test_residuals(report: &Report, on_log: &dyn OnLog, plan: &ValidationPlan, validation: &mut Validation) {
    // Where that fails, the fit figure has said why.
    let Ok(each) = on_log.tested() else { return };
    let null = match validation.in_sample {
        InSample::No => NullDistribution::Known,
        InSample::Yes | InSample::Partly => report.estimation.procedure.null_distribution(),
    };
    let mut alphas = plan.alphas.clone();
    alphas.sort_unstable_by(f64::total_cmp);
    alphas.dedup();
    let together: Vec<&[Innovations]> = each.iter().map(|one| &*one.innovations).collect();
    let fitted = match validation.in_sample {
        InSample::Yes => report.model.noise_parameters(),
        InSample::No | InSample::Partly => 0,
    };
    let samples: usize =
        each.first().map_or(0, |one| one.innovations.iter().map(|own| own.counted_errors().count()).sum());
    validation.portmanteau = portmanteau(&together, plan.lags.min(samples / PORTMANTEAU), fitted);
    for tested in &each {
        let Tested { output, inputs, record, innovations, .. } = tested;
        match Residuals::of(tested, null, plan.lags, &alphas, plan.alpha) {
            Ok(residuals) => {
                validation.residuals.push(residuals);
                if report.model.expects_errors_of_one_size() {
                    validation.nonlinear.extend(nonlinearities(output, inputs, record, innovations));
                }
                validation.warnings.extend(off_center(innovations));
            }
            Err(why) => validation
                .warnings
                .push(format!("the residuals{} are not tested: {why}", of_output(on_log, output))),
        }
    }
}

/// A warning of errors that are not centered, which the tests take as an offset and no matter of dynamics.
fn off_center(found: &[Innovations]) -> Option<String> {
    let errors = || found.iter().flat_map(Innovations::counted_errors);
    let samples = errors().count() as f64;
    let mean = sum(errors().copied()) / samples;
    let deviation = (sum(errors().map(|e| (e - mean).powi(2))) / samples).sqrt();
    let share = mean.abs() / deviation;
    (share > OFF_CENTER && share * samples.sqrt() > CERTAIN).then(|| {
        format!(
            "the errors one step ahead have a mean of {}, {} times their standard deviation: the offsets of this \
             log are not those of the model; `detrend` mean takes its own",
            number(mean),
            fixed(share, 2)
        )
    })
}

/// What is worth a warning.
fn warn(plan: &ValidationPlan, validation: &mut Validation) {
    let mut words = Vec::new();
    if validation.stable == Some(false) && validation.fit.iter().any(|fit| fit.horizon == Horizon::FreeRun) {
        words.push("the model is unstable: its free run grows without bound".to_owned());
    }
    let several = validation.noise.len() > 1;
    let of = |output: &str| if several { format!(" of '{output}'") } else { String::new() };
    for noise in &validation.noise {
        let NoiseLevel { mse: Some(mse), model, ratio: Some(ratio), output } = noise else { continue };
        if LIKELY.contains(ratio) {
            continue;
        }
        let what = if *ratio > 1.0 {
            "the log is noisier than that of the fit, or the model is not that of this plant"
        } else {
            "the log is quieter than that of the fit: the model's intervals are too wide for it"
        };
        words.push(format!(
            "the mean square of the errors{} one step ahead, {}, is {} times the model's noise variance, \
             {}: {what}",
            of(output),
            number(*mse),
            fixed(*ratio, 2),
            number(*model)
        ));
    }
    if validation.white_expected
        && let Some(test) = &validation.portmanteau
        && let Some(p) = test.p_value.filter(|p| *p < plan.alpha)
        && validation.residuals.iter().all(|one| one.ljung_box.p_value.is_none_or(|p| p >= plan.alpha))
    {
        words.push(format!(
            "the residuals of the outputs together are not white ({} lags, p-value {}): the past of one tells of another",
            test.lags,
            chance(p)
        ));
    }
    for residuals in &validation.residuals {
        let of = of(&residuals.output);
        let rejected = |p: Option<f64>| p.filter(|p| *p < plan.alpha);
        if validation.white_expected
            && let Some(p) = rejected(residuals.ljung_box.p_value)
        {
            words.push(format!(
                "the residuals{of} are not white (Ljung-Box, {} lags, p-value {}): the model lacks dynamics of the plant or of \
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
                    "the residuals{of} depend on past values of input '{input}' (p-value {}): the model lacks dynamics or has \
                     the wrong delay{lags}",
                    chance(p)
                ));
            }
            if independence.suspected {
                words.push(format!(
                    "input '{input}' follows past residuals{of}: feedback from the output to the input is suspected"
                ));
            }
        }
    }
    // Of a model with poles it is no fault, and the table says it.
    let is_nonlinear = validation.stable.is_none();
    for found in validation.nonlinear.iter().filter(|_| is_nonlinear) {
        let of = of(&found.output);
        if let Some(p) = found.errors.p_value.filter(|p| *p < plan.alpha) {
            words.push(format!(
                "the residuals{of} hold squares of input '{}' (p-value {}): the model lacks nonlinear terms",
                found.input,
                chance(p)
            ));
        }
    }
    validation.warnings.extend(words);
}

/// The past lags farthest outside their band, three at most, in rising order.
fn largest(independence: &crate::validate::Independence) -> String {
    let after = independence.past.lags + 1;
    let each = independence.correlation.iter().zip(&independence.band).skip(after).zip(1_usize..);
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
        criteria: comparable(validated)
            .then(|| validated.iter().map(|validated| validated.fitted.criteria).collect()),
        likelihood_ratios: likelihood_ratios(validated),
    })
}

/// Of all pairs of models in equations, fitted to the same values, of which the parameters of one are among those of
/// the other.
fn likelihood_ratios(validated: &[Validated]) -> Vec<LikelihoodRatio> {
    let pairs = (0..validated.len()).flat_map(|one| (0..validated.len()).map(move |other| (one, other)));
    let ratio = |(smaller, larger): (usize, usize)| {
        let (one, other) = (&validated[smaller].fitted, &validated[larger].fitted);
        let ((low, few), (high, many)) = one.likelihood.as_ref().zip(other.likelihood.as_ref())?;
        let further: Vec<String> = many.iter().filter(|name| !few.contains(name)).cloned().collect();
        let is_nested = few.iter().all(|name| many.contains(name)) && !further.is_empty();
        let same = one.samples == other.samples && one.outputs == other.outputs;
        let ratio = (2.0 * (high - low)).max(0.0);
        (is_nested && same).then(|| LikelihoodRatio {
            smaller,
            larger,
            ratio,
            p_value: chi_square_tail(ratio, further.len() as f64).unwrap_or(1.0),
            parameters: further,
        })
    };
    pairs.filter_map(ratio).collect()
}

/// Whether all models were fitted to the same values of the same outputs, and about as many of them count.
fn comparable(validated: &[Validated]) -> bool {
    let outputs = |one: &Validated| -> Vec<String> {
        one.signals.outputs.iter().map(|output| output.name.clone()).collect()
    };
    let samples = || validated.iter().map(|one| one.fitted.samples as f64);
    let (least, most) = (samples().fold(f64::INFINITY, f64::min), samples().fold(0.0, f64::max));
    let same = validated.windows(2).all(|pair| {
        pair[0].fitted.outputs == pair[1].fitted.outputs && outputs(&pair[0]) == outputs(&pair[1])
    });
    validated.len() > 1 && same && most - least <= AS_MANY * most
}
