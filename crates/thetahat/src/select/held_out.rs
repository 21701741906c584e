//! How well models simulate samples that they were not fitted to, or predict them several steps ahead.
//!
//! The record is cut into thirds. Each model is fitted again to two of them and evaluated on the third, with the
//! initial state that fits best there. Errors are in standard deviations of the output and count up to five of them, so
//! that a run that leaves the range of the data does not outweigh all others; a model that is unstable without a third
//! counts as if it had left it.

use rayon::prelude::*;
use thetahat_numerics::regression::sum;

use super::candidates::{Samples, Trial, total};
use super::folds::Folds;
use super::{HeldOut, Task};
use crate::Error;
use crate::data::Record;
use crate::model::{
    Orders, PolynomialModel, Structure,
    polynomial::{is_stable, roots},
};
use crate::respond::{Horizon, InitialCondition, Response, predict, simulate};

/// A record is cut into this many blocks.
pub(super) const BLOCKS: usize = 3;
/// A block is cut into this many parts: 10 to 30 in all are enough (Schmeiser 1982).
const PARTS: usize = 10;
/// Errors count up to this many standard deviations of the output.
const LARGEST: f64 = 5.0;
/// The error of an unstable refit counts this many times, and is this at least.
const UNSTABLE: f64 = 1.5;

/// By how many of its standard errors the mean square of one model exceeds that of another on the same samples.
///
/// Errors of neighbouring samples go together. Sums over parts hardly do, so their differences tell how certain the
/// mean is: batch means (Schmeiser, Batch size effects in the analysis of simulation output, Operations Research 30,
/// 1982) of the differences of two models' losses (Diebold and Mariano, Comparing predictive accuracy, J. Business and
/// Economic Statistics 13, 1995).
pub(super) fn standard_errors(one: &[f64], other: &[f64]) -> f64 {
    let count = one.len() as f64;
    let differences = || one.iter().zip(other).map(|(one, other)| one - other);
    let mean = sum(differences()) / count;
    let variance = sum(differences().map(|difference| (difference - mean).powi(2))) / (count - 1.0);
    // Without any difference 0/0, which is no clear one.
    mean / (variance / count).sqrt()
}

/// The figures of a model, and the sums of e^2 on parts of the blocks, in order and as long as one another to within
/// one sample.
pub(super) type Seen = (HeldOut, Vec<f64>);

/// The figures of some models; none of others, and where the data do not determine a model without a block.
///
/// # Errors
/// [`Error::Interrupted`].
pub(super) fn figures(
    task: &Task<'_>,
    record: &Record<'_>,
    samples: &Samples,
    tried: &[Trial],
    which: &[usize],
    window: Option<usize>,
) -> Result<Vec<Option<Seen>>, Error> {
    let mut figures = vec![None; tried.len()];
    let deviation = deviation(record);
    let folds = Folds::new(record, BLOCKS);
    let some: Vec<Trial> = which.iter().map(|&k| tried[k].clone()).collect();
    if some.is_empty() || deviation == 0.0 || (0..BLOCKS).any(|fold| total(&folds.test(fold)) == 0) {
        return Ok(figures);
    }
    let refits = folds.refitted(task, samples, &some)?;
    let blocks = Blocks::new(record, &folds, deviation, window);
    let horizon = task.focus.horizon();
    let of_model = |k: usize| -> Option<Seen> {
        let orders = &some[k].orders;
        let model = |refits: &Vec<Option<Vec<f64>>>| {
            let parameters = refits[k].as_ref()?;
            let model = PolynomialModel::from_parameters(orders, parameters, None, 1.0, 1.0).ok()?;
            Some((is_all_stable(&model), model))
        };
        let models: Vec<_> = refits.iter().map(model).collect::<Option<_>>()?;
        blocks.figures(&models, horizon, response)
    };
    let found: Vec<Option<Seen>> = (0..some.len()).into_par_iter().map(of_model).collect();
    which.iter().zip(found).for_each(|(&k, figure)| figures[k] = figure);
    Ok(figures)
}

/// The models that are evaluated: of each structure, delay and number of parameters the one with the least criterion,
/// in the order of their criterion.
pub(super) fn promising(order: &[usize], tried: &[Trial]) -> Vec<usize> {
    let mut seen: Vec<(Structure, usize, &[usize])> = Vec::new();
    let mut promising = Vec::new();
    for &k in order {
        let orders = &tried[k].orders;
        let kind = (orders.structure(), orders.parameters(), &orders.nk[..]);
        if !seen.contains(&kind) {
            seen.push(kind);
            promising.push(k);
        }
    }
    promising
}

/// The mean of e^2 of given parameters, `horizon` ahead; none where the response overflows.
pub(super) fn mean_square(
    orders: &Orders,
    parameters: &[f64],
    record: &Record<'_>,
    horizon: Horizon,
) -> Option<f64> {
    let model = PolynomialModel::from_parameters(orders, parameters, None, 1.0, 1.0).ok()?;
    let response = response(&model, record, horizon).ok()?;
    let errors = || counted(record, &response).map(|(measured, said)| measured - said);
    Some(sum(errors().map(|e| e * e)) / errors().count() as f64).filter(|mean| mean.is_finite())
}

fn response(model: &PolynomialModel, record: &Record<'_>, horizon: Horizon) -> Result<Response, Error> {
    match horizon {
        Horizon::FreeRun => simulate(model, record, InitialCondition::Estimate),
        Horizon::Steps { steps } => predict(model, record, steps, InitialCondition::natural(model, horizon)),
    }
}

fn counted<'a>(
    record: &'a Record<'_>,
    response: &'a Response,
) -> impl Iterator<Item = (f64, f64)> + Clone + 'a {
    response.counted.iter().cloned().flatten().map(|t| (record.output[t], response.values[t]))
}

/// The root of the mean of squared errors, cut off; none without a sample.
fn root(pairs: impl Iterator<Item = (f64, f64)> + Clone, deviation: f64) -> Option<f64> {
    let count = pairs.clone().count();
    (count > 0).then(|| (sum(pairs.map(|pair| cut(pair, deviation).powi(2))) / count as f64).sqrt())
}

/// The size of an error; NaN is cut off too.
pub(super) fn cut((measured, said): (f64, f64), deviation: f64) -> f64 {
    ((measured - said).abs() / deviation).min(LARGEST)
}

fn punished(root: f64) -> f64 {
    UNSTABLE * root.max(UNSTABLE)
}

fn is_all_stable(model: &PolynomialModel) -> bool {
    let mut scratch = Vec::new();
    std::iter::once(&model.a).chain(&model.f).all(|polynomial| is_stable(polynomial, &mut scratch))
}

/// The largest modulus of a pole of the plant, a root of A or an F; infinite where it is not known.
pub(super) fn radius(orders: &Orders, parameters: &[f64]) -> f64 {
    let model = PolynomialModel::from_parameters(orders, parameters, None, 1.0, 1.0);
    let largest = |model: PolynomialModel| {
        std::iter::once(&model.a).chain(&model.f).map(|own| largest_root(own)).fold(0.0, f64::max)
    };
    model.map_or(f64::INFINITY, largest)
}

/// The same of C.
pub(super) fn noise_radius(orders: &Orders, parameters: &[f64]) -> f64 {
    let model = PolynomialModel::from_parameters(orders, parameters, None, 1.0, 1.0);
    model.map_or(f64::INFINITY, |model| largest_root(&model.c))
}

fn largest_root(polynomial: &[f64]) -> f64 {
    let Some(roots) = roots(polynomial) else { return f64::INFINITY };
    roots.iter().map(|root| root.re.hypot(root.im)).fold(0.0, f64::max)
}

/// The standard deviation of the output.
pub(super) fn deviation(record: &Record<'_>) -> f64 {
    let values = || record.segments.iter().flat_map(|segment| &record.output[segment.clone()]);
    let count = total(record).max(1) as f64;
    let mean = sum(values().copied()) / count;
    (sum(values().map(|y| (y - mean).powi(2))) / count).sqrt()
}

/// The blocks of a record, on which models that were fitted without one are evaluated.
pub(super) struct Blocks<'r> {
    tests: Vec<Record<'r>>,
    onward: Onward<'r>,
    deviation: f64,
    /// Windows of this many samples have levels of their own, where the noise drifts.
    window: Option<usize>,
}

impl<'r> Blocks<'r> {
    /// `deviation` is that of the output, not 0.
    pub(super) fn new(
        record: &Record<'r>,
        folds: &Folds<'_, 'r>,
        deviation: f64,
        window: Option<usize>,
    ) -> Self {
        let tests = (0..folds.count()).map(|fold| folds.test_with_past(fold)).collect();
        Self { tests, onward: Onward::new(record, folds), deviation, window }
    }

    /// The figures of models, each fitted without the block of its place, and whether they are stable; `respond` says
    /// what one makes of a record. None where a block has no samples that count.
    pub(super) fn figures<M>(
        &self,
        models: &[(bool, M)],
        horizon: Horizon,
        respond: impl Fn(&M, &Record<'_>, Horizon) -> Result<Response, Error>,
    ) -> Option<Seen> {
        let deviation = self.deviation;
        let (mut blocks, mut unpunished, mut samples, mut unstable) = (0.0, 0.0, 0, 0);
        let mut parts = vec![0.0; BLOCKS * PARTS];
        for (((stable, model), test), parts) in models.iter().zip(&self.tests).zip(parts.chunks_mut(PARTS)) {
            let count = total(test);
            let root = match respond(model, test, horizon) {
                Ok(response) => {
                    let pairs = leveled(counted(test, &response).collect(), self.window);
                    let count = pairs.len();
                    let each = pairs.iter().enumerate();
                    each.for_each(|(k, pair)| parts[k * PARTS / count] += cut(*pair, deviation).powi(2));
                    root(pairs.iter().copied(), deviation)?
                }
                Err(_) => LARGEST,
            };
            let counted = if *stable { root } else { punished(root) };
            blocks += counted * counted * count as f64;
            unpunished += root * root * count as f64;
            samples += count;
            unstable += usize::from(!stable);
        }
        let (stable, last) = models.last()?;
        let mean = |sum: f64| sum / samples as f64;
        let onward = match horizon {
            Horizon::FreeRun => {
                let run = |record: &Record<'_>| respond(last, record, horizon);
                let root = self.onward.root_mean_square(run, deviation, self.window).unwrap_or(LARGEST);
                if *stable { root * root } else { punished(root).powi(2) }
            }
            Horizon::Steps { .. } => mean(blocks),
        };
        let seen =
            HeldOut { blocks: mean(blocks), onward, unpunished: mean(unpunished), unstable, refits: BLOCKS };
        Some((seen, parts))
    }
}

/// The last block after what comes before it in its segments.
struct Onward<'r> {
    record: Record<'r>,
    /// The output without the last block.
    known: Vec<f64>,
    last: Record<'r>,
}

impl<'r> Onward<'r> {
    fn new(record: &Record<'r>, folds: &Folds<'_, 'r>) -> Self {
        let last = folds.test_with_past(folds.count() - 1);
        let mut known = record.output.to_vec();
        for piece in &last.segments {
            known[piece.clone()].fill(f64::NAN);
        }
        Self { record: record.clone(), known, last }
    }

    /// A segment of which nothing is known before begins with the state that fits it.
    fn root_mean_square(
        &self,
        run: impl Fn(&Record<'_>) -> Result<Response, Error>,
        deviation: f64,
        window: Option<usize>,
    ) -> Option<f64> {
        let begins = |segment: &std::ops::Range<usize>| self.known[segment.start].is_nan();
        let (mut before, mut alone) = (self.record.clone(), self.last.clone());
        let select = |record: &mut Record<'_>, keep: &dyn Fn(&std::ops::Range<usize>) -> bool| {
            let kept = record.segments.iter().zip(&record.past).filter(|(segment, _)| keep(segment));
            let (segments, past) = kept.map(|(segment, past)| (segment.clone(), *past)).unzip();
            (record.segments, record.past) = (segments, past);
        };
        let whole: Vec<usize> = self.record.segments.iter().filter(|s| begins(s)).map(|s| s.start).collect();
        select(&mut before, &|segment| !begins(segment));
        select(&mut alone, &|segment| whole.contains(&segment.start));
        let mut pairs = Vec::new();
        if !before.segments.is_empty() {
            let known = Record { output: &self.known, ..before };
            let response = run(&known).ok()?;
            let continued = self.last.segments.iter().filter(|piece| !whole.contains(&piece.start));
            let rows = continued.cloned().flatten();
            pairs.extend(rows.map(|t| (self.record.output[t], response.values[t])));
        }
        if !alone.segments.is_empty() {
            let response = run(&alone).ok()?;
            pairs.extend(counted(&alone, &response));
        }
        root(leveled(pairs, window).iter().copied(), deviation)
    }
}

/// Values and what was said of them, in windows with the level that fits each best.
fn leveled(mut pairs: Vec<(f64, f64)>, window: Option<usize>) -> Vec<(f64, f64)> {
    let Some(window) = window else { return pairs };
    // Windows as long as one another to within one sample.
    let count = (pairs.len() / window).max(1);
    let mut rest = pairs.as_mut_slice();
    for left in (1..=count).rev() {
        let (own, others) = rest.split_at_mut(rest.len() / left);
        let mean = sum(own.iter().map(|(measured, said)| measured - said)) / own.len().max(1) as f64;
        own.iter_mut().for_each(|(_, said)| *said += mean);
        rest = others;
    }
    pairs
}
