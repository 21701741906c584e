//! Signals side by side: how well each would tell what is wanted, and how long it takes.

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::figures::SignalFigures;
use super::planned::Prior;
use super::signal::{SignalPlan, TestSignal};
use super::want::{Figure, Want, figures};
use crate::document::GENERATOR;
use crate::document::document_methods;
use crate::model::PolynomialModel;
use crate::{Document, Error};

/// The longest experiment that is thought of, in samples.
const LONGEST: usize = 1_000_000;
/// A length is sought to this fraction of itself.
const EXACT: f64 = 0.002;

/// How well each of several signals would tell the figures of a model. The JSON document `thetahat.design/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ExperimentDesign {
    /// `thetahat.design/1`.
    pub schema: String,
    /// The program and version that wrote it.
    pub generator: String,
    /// Structure and orders of the model that it is planned with.
    pub model: String,
    /// Seconds from one sample to the next.
    pub sample_time: f64,
    /// The samples of the experiments that are compared.
    pub length: usize,
    /// What is wanted; empty where nobody said.
    pub wants: Vec<Want>,
    /// The figures that are compared: those that are wanted, or all.
    pub figures: Vec<DesignFigure>,
    /// One entry for each signal.
    pub signals: Vec<SignalWorth>,
}

/// A figure of the model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DesignFigure {
    /// Such as `a1` or `dc-gain`.
    pub name: String,
    /// Its value in the model.
    pub value: f64,
    /// The largest standard error that is wanted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limit: Option<f64>,
}

/// What one signal is worth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SignalWorth {
    /// Such as `prbs:4`.
    pub signal: String,
    /// The root mean square of its deviations from the mean, for each channel.
    pub rms: Vec<f64>,
    /// The largest deviation over that.
    pub crest_factor: Vec<Option<f64>>,
    /// The order of persistence of excitation, 50 at most.
    pub order: Vec<usize>,
    /// The standard error of each figure; none where the signal leaves it open.
    pub standard_errors: Vec<Option<f64>>,
    /// The fewest samples, to half a percent, after which all errors are as small as is wanted; none where nothing is
    /// wanted, and where a million are too few.
    pub needed: Option<usize>,
}

/// Compares signals for a model: the standard errors that each would give, and how long it has to be for those that are
/// wanted.
///
/// The errors are those of [`planned`](super::planned()). The length is found by evaluating them: each sample adds
/// information, so that a longer experiment, which begins with the shorter one, is never worse, and halving an interval
/// finds the first that is good enough. Signals are compared in parallel.
///
/// Cost: about 20 evaluations of O(N p) for each signal.
///
/// # Errors
/// As for [`TestSignal::new`] and [`planned`](super::planned()), but that inputs which leave parameters open have no
/// errors; and [`Error::Argument`] for a figure that the model does not have.
///
/// ```
/// use thetahat::data::Record;
/// use thetahat::design::{SignalKind, SignalPlan, compare_signals};
/// use thetahat::estimate::{Initial, arx};
/// use thetahat::model::{Orders, Signal};
///
/// let u: Vec<f64> = (0..200).map(|t| f64::from(t * t % 7)).collect();
/// let mut y = vec![1.0];
/// for t in 1..u.len() {
///     y.push(0.9 * y[t - 1] + 0.5 * u[t - 1] + 0.1 * f64::from((t * t * t) as u32 % 11));
/// }
/// let orders = Orders::arx(1, &[1], &[1])?;
/// let estimate = arx(&Record::new(&y, vec![&u])?, &orders, Initial::Drop)?;
/// let model = estimate.to_model(&orders, 1.0, vec![Signal::default()], Signal::default())?;
///
/// let plans = [SignalKind::Prbs, SignalKind::Steps].map(SignalPlan::new);
/// let design = compare_signals(&model, &plans, &["b1:0.01".parse()?])?;
/// // A PRBS tells b1 sooner than one step does.
/// assert!(design.signals[0].needed.unwrap() < design.signals[1].needed.unwrap_or(usize::MAX));
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn compare_signals(
    model: &PolynomialModel,
    plans: &[SignalPlan],
    wants: &[Want],
) -> Result<ExperimentDesign, Error> {
    let prior = Prior::new(model)?;
    let chosen = chosen(model, wants)?;
    let worth = |plan: &SignalPlan| worth(&prior, plan, &chosen);
    let signals = plans.par_iter().map(worth).collect::<Result<Vec<_>, Error>>()?;
    Ok(ExperimentDesign {
        schema: ExperimentDesign::SCHEMA.to_owned(),
        generator: GENERATOR.to_owned(),
        model: model.orders.to_string(),
        sample_time: model.sample_time,
        length: plans.first().map_or(0, |plan| plan.length),
        wants: wants.to_vec(),
        figures: chosen,
        signals,
    })
}

impl Document for ExperimentDesign {
    const NAME: &'static str = "design of an experiment";
    const SCHEMA: &'static str = "thetahat.design/1";
    const REMEDY: &'static str = "give a file that design wrote";

    document_methods!();
}

/// The figures that are compared.
fn chosen(model: &PolynomialModel, wants: &[Want]) -> Result<Vec<DesignFigure>, Error> {
    let all = figures(model);
    if wants.is_empty() {
        let each =
            all.into_iter().map(|Figure { name, value, .. }| DesignFigure { name, value, limit: None });
        return Ok(each.collect());
    }
    let figure = |want: &Want| {
        let known = all.iter().find(|figure| figure.name == want.figure).ok_or_else(|| {
            let names: Vec<&str> = all.iter().map(|figure| figure.name.as_str()).collect();
            Error::argument(
                "want",
                format!("the model has no '{}'; there are: {}", want.figure, names.join(", ")),
            )
        })?;
        let limit = want.limit_of(known.value);
        if limit > 0.0 {
            return Ok(DesignFigure { name: known.name.clone(), value: known.value, limit: Some(limit) });
        }
        Err(Error::argument("want", format!("'{want}': {} is zero, and has no percent", want.figure)))
    };
    wants.iter().map(figure).collect()
}

/// What a signal is worth.
fn worth(prior: &Prior<'_>, plan: &SignalPlan, chosen: &[DesignFigure]) -> Result<SignalWorth, Error> {
    let signal = TestSignal::new(plan)?;
    let errors = |length: usize| -> Result<Vec<Option<f64>>, Error> {
        match prior.planned(&signal.values(length)) {
            Ok(known) => {
                let known = figures(&known);
                let error =
                    |of: &DesignFigure| known.iter().find(|figure| figure.name == of.name)?.standard_error;
                Ok(chosen.iter().map(error).collect())
            }
            Err(Error::Undetermined { .. }) => Ok(vec![None; chosen.len()]),
            Err(other) => Err(other),
        }
    };
    // The largest error in units of what is wanted.
    let excess = |length: usize| -> Result<f64, Error> {
        let each = errors(length)?.into_iter().zip(chosen);
        Ok(each.fold(0.0_f64, |largest, (error, figure)| match (error, figure.limit) {
            (Some(error), Some(limit)) => largest.max(error / limit),
            (None, Some(_)) => f64::INFINITY,
            (_, None) => largest,
        }))
    };
    let wanted = chosen.iter().any(|figure| figure.limit.is_some());
    let needed = if wanted { fewest(excess, plan.length)? } else { None };
    let own = signal.values(plan.length);
    let each: Vec<SignalFigures> =
        own.iter().map(|values| SignalFigures::of(values, prior.model().sample_time)).collect();
    Ok(SignalWorth {
        signal: plan.waveform.to_string(),
        rms: each.iter().map(|figures| figures.rms).collect(),
        crest_factor: each.iter().map(|figures| figures.crest_factor).collect(),
        order: each.iter().map(|figures| figures.order).collect(),
        standard_errors: errors(plan.length)?,
        needed,
    })
}

/// The fewest samples for which a falling `excess` is at most 1, from a first guess on.
fn fewest(excess: impl Fn(usize) -> Result<f64, Error>, guess: usize) -> Result<Option<usize>, Error> {
    // Errors fall like 1/sqrt(N): that says where to look next, not what the answer is.
    let (mut low, mut high) = (0, guess.clamp(1, LONGEST));
    let mut at = excess(high)?;
    while at > 1.0 {
        if high == LONGEST {
            return Ok(None);
        }
        low = high;
        let further = (high as f64 * (1.05 * at * at).clamp(1.1, 16.0)).ceil();
        high = (further as usize).min(LONGEST);
        at = excess(high)?;
    }
    while high - low > 1 && (high - low) as f64 > EXACT * high as f64 {
        let scaled = (high as f64 * at * at) as usize;
        let middle = low + (high - low) / 2;
        // The guess of the scale closes in from one side only.
        let next = if low == 0 { scaled.clamp(high / 16 + 1, middle.max(1)).min(high - 1) } else { middle };
        let here = excess(next)?;
        if here <= 1.0 {
            (high, at) = (next, here);
        } else {
            low = next;
        }
    }
    Ok(Some(high))
}
