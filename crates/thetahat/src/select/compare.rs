//! All models on the same samples.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicUsize, Ordering};

use thetahat_numerics::optimize::Progress;

use super::candidates::{Compared, Samples, Trial, energy, rows, total};
use super::drift::{self, Drift};
use super::linear::{Columns, Fitted, Scaled};
use super::search::Family;
use super::{Candidate, EXACT, Select, Task, held_out, held_out_mse};
use crate::Error;
use crate::data::Record;
use crate::estimate::{Common, Initial, Point, thinned_to};
use crate::model::Orders;

/// Of records with more samples, models of which some need a search see segments only: this many, each so long.
pub(super) const LONG: usize = 1 << 16;
pub(super) const SEGMENTS: usize = 16;
pub(super) const SEGMENT: usize = 1 << 11;
/// A step of a search takes N p^2 multiplications, and the searches of a choice many steps: models that take more are
/// left out, and records of which models with [`USUAL`] coefficients for each input, and as many for the noise, take
/// more are thinned, to segments of so many samples at least.
const MOST_OPERATIONS: f64 = 1e7;
const USUAL: usize = 4;
const SHORTEST: usize = 1 << 8;
/// Of records with more samples, blocks are held out of segments only: few, so that free runs are long.
const MOST_IN_BLOCKS: usize = 1 << 14;
const SEGMENTS_OF_BLOCKS: usize = 4;
/// Models that were compared.
pub(super) struct Outcome {
    /// Those that the data determine.
    pub(super) models: Vec<Compared>,
    pub(super) failed: usize,
    /// Those that were not fitted, as larger ones show that they cannot have the least MDL.
    pub(super) hopeless: usize,
    /// The smallest model of all.
    pub(super) smallest: Option<Orders>,
    /// N.
    pub(super) samples: usize,
    /// What there is to say of the samples, in sentences.
    pub(super) remarks: Vec<String>,
    /// Whether the noise drifts.
    pub(super) drift: Option<Drift>,
}

/// Fits all models to the same samples. Each model is there once. With `essential` ones, by what tells them apart (see
/// `key`), others that cannot have the least MDL are not fitted.
///
/// # Errors
/// As for [`choose`](super::choose).
pub(super) fn compare(
    task: &Task<'_>,
    models: Vec<Orders>,
    essential: Option<&BTreeSet<Vec<usize>>>,
) -> Result<Outcome, Error> {
    let mut remarks = Vec::new();
    let models: Vec<Orders> = models.iter().map(|orders| task.with_constants(orders)).collect();
    let searched = models.iter().any(|orders| !orders.is_linear());
    let all = total(task.estimation);
    let thin = if searched { thinned(task, essential.is_some()) } else { None };
    if let Some(thin) = &thin {
        remarks.push(format!(
            "To save time, compared on {} of {all} samples, in {} segments spread over the log.",
            total(thin),
            thin.segments.len()
        ));
    }
    let record = thin.as_ref().unwrap_or(task.estimation);
    let samples = Samples::new(record, task.initial, &models)?;
    let count = samples.count(record);
    let is_held_out = task.select.is_held_out();
    let smallest = models.first().map(|orders| task.named(orders));
    let mut tried: Vec<Trial> = models.into_iter().map(|orders| Trial { orders, point: None }).collect();
    // Blocks are left where time is up: the answer so far stands.
    let with_blocks = !is_held_out && task.looks_further();
    fit_linear(record, &samples, &mut tried, searched || is_held_out || with_blocks)?;
    // A part of a segment begins where the log knows what came before. Its initial conditions are not what the model
    // has to tell in the whole log: they cost no more than what they take of the noise, one each.
    let own = task.estimation.segments.len() as f64 / record.segments.len().max(1) as f64;
    let price = |orders: &Orders, initial: f64| {
        let free: usize = (0..orders.inputs()).map(|input| orders.free_responses(input)).sum();
        let taken = if initial > 0.0 { (free * record.segments.len()) as f64 } else { 0.0 };
        own.min(1.0) * initial + (1.0 - own.min(1.0)) * taken
    };
    // Those of linear models are zero already where they are rounding.
    let nothing = if searched { EXACT * energy(record) } else { 0.0 };
    let exact = |cost: f64| if cost <= nothing { 0.0 } else { cost };
    let mut hopeless = 0;
    if searched {
        let free = task.initial != Initial::Zero;
        let (done, all) = (AtomicUsize::new(0), tried.iter().filter(|one| !one.orders.is_linear()).count());
        let told = |now: Progress| {
            let models = Some((done.load(Ordering::Relaxed).min(all), all));
            (task.monitor)(Progress { models, ..now })
        };
        let common = Common::new(record, free, samples.window, task.search, task.deadline, &told)?;
        let common = common.counting(&done);
        let score = |orders: &Orders, cost: f64, initial: f64| {
            let (size, mse) = (orders.parameters(), exact(cost) / count as f64);
            let score = score(Select::MDL, mse, size, price(orders, initial), count, None);
            score.unwrap_or(f64::NEG_INFINITY)
        };
        let essential = essential.filter(|_| task.select == Select::MDL).zip(Some(count));
        hopeless = Family::new(&tried, task.inputs.len()).fit(&common, &mut tried, &score, essential)?;
    }
    let costs = held_out_mse::costs(task, record, &tried)?;
    let scores: Vec<Option<f64>> = tried
        .iter()
        .zip(&costs)
        .map(|(Trial { orders, point }, held_out_mse)| {
            let Point { cost, initial, .. } = point.as_ref()?;
            let mse = exact(*cost) / count as f64;
            score(task.select, mse, orders.parameters(), price(orders, *initial), count, *held_out_mse)
        })
        .collect();
    let mut drift = None;
    let held_out = if (with_blocks || task.may_drift) && !task.deadline.is_over() {
        // An exact model has no criterion, and is the best.
        let place = |k: usize| {
            let exact = tried[k].point.as_ref().is_some_and(|point| exact(point.cost) == 0.0);
            if exact { f64::NEG_INFINITY } else { scores[k].unwrap_or(f64::INFINITY) }
        };
        let mut order: Vec<usize> = (0..tried.len()).filter(|&k| tried[k].point.is_some()).collect();
        order.sort_by(|&a, &b| place(a).total_cmp(&place(b)));
        let is_stable = |k: &&usize| {
            let point = tried[**k].point.as_ref();
            point.is_some_and(|point| held_out::radius(&tried[**k].orders, &point.parameters) < 1.0)
        };
        if task.may_drift
            && let Some(&best) = order.iter().find(is_stable)
        {
            drift = drift::drift(task, record, &tried[best])?;
        }
        let record = few_for_blocks(record, task.estimation);
        let samples = Samples::unknown(&record, tried.iter().map(|model| &model.orders));
        let which = if with_blocks { held_out::promising(&order, &tried) } else { Vec::new() };
        held_out::figures(task, &record, &samples, &tried, &which, drift.map(|drift| drift.window))?
    } else {
        vec![None; tried.len()]
    };
    let total = tried.len();
    let figures = costs.into_iter().zip(scores).zip(held_out);
    let models = tried.into_iter().zip(figures).filter_map(
        |(Trial { orders, point }, ((held_out_mse, score), held_out))| {
            let Point { parameters, cost, .. } = point?;
            let held_out_mse = if is_held_out { Some(held_out_mse?) } else { None };
            let radius = if with_blocks { held_out::radius(&orders, &parameters) } else { f64::INFINITY };
            let noise_radius = held_out::noise_radius(&orders, &parameters);
            let initial_parameters = (!orders.is_linear()).then_some(parameters);
            let orders = task.named(&orders);
            let (held_out, parts) = held_out.unzip();
            let scored = Candidate {
                structure: orders.structure(),
                parameters: orders.parameters(),
                mse: exact(cost) / count as f64,
                held_out_mse,
                held_out,
                score,
                orders,
            };
            Some(Compared { scored, initial_parameters, radius, noise_radius, parts })
        },
    );
    let models: Vec<Compared> = models.collect();
    Ok(Outcome {
        failed: total - models.len() - hopeless,
        hopeless,
        models,
        samples: count,
        smallest,
        remarks,
        drift,
    })
}

/// Segments of a long record: models of which some need a search see no more of it. With `sparing` they are shorter for
/// many inputs.
fn thinned<'a>(task: &Task<'a>, sparing: bool) -> Option<Record<'a>> {
    let usual = (USUAL * (task.inputs.len() + 1)) as f64;
    let length = if sparing { (MOST_OPERATIONS / (usual * usual)) as usize / SEGMENTS } else { usize::MAX };
    let length = length.max(SHORTEST);
    let most = LONG.min(length.saturating_mul(SEGMENTS));
    let is_long = total(task.estimation) > most;
    if is_long { thinned_to(task.estimation, SEGMENTS, length.min(SEGMENT)) } else { None }
}

/// Leaves out the models whose searches take too long, but for the smallest of all; and what there is to say of that.
pub(super) fn keep_quick(task: &Task<'_>, models: &mut Vec<Orders>) -> Option<String> {
    let samples = thinned(task, true).map_or_else(|| total(task.estimation), |thin| total(&thin)).max(1);
    let least = models.iter().map(Orders::parameters).min().unwrap_or(0);
    let most = ((MOST_OPERATIONS / samples as f64).sqrt() as usize).max(least);
    let all = models.len();
    models.retain(|orders| orders.is_linear() || orders.parameters() <= most);
    (models.len() < all).then(|| {
        format!("To save time, models that need a search have at most {most} parameters: ranges of orders try larger ones.")
    })
}

/// The part of a record that blocks are held out of: of a long one segments of all there is.
pub(crate) fn few_for_blocks<'a>(record: &Record<'a>, all: &Record<'a>) -> Record<'a> {
    let most = total(record) > MOST_IN_BLOCKS;
    let few = if most { thinned_to(all, SEGMENTS_OF_BLOCKS, SEGMENT) } else { None };
    few.unwrap_or_else(|| record.clone())
}

/// What a model is chosen by.
///
/// The initial conditions of 1/F are no parameters of the model, but have their price in N ln J: J is raised by it.
fn score(
    select: Select,
    mse: f64,
    parameters: usize,
    initial: f64,
    samples: usize,
    held_out_mse: Option<f64>,
) -> Option<f64> {
    let raised = mse * (initial / samples as f64).exp();
    match select {
        Select::Criterion(criterion) => criterion.value(raised, parameters, samples),
        Select::Validation | Select::Cv => held_out_mse,
    }
}

/// Fits the models that are linear in their parameters.
fn fit_linear(
    record: &Record<'_>,
    samples: &Samples,
    tried: &mut [Trial],
    with_parameters: bool,
) -> Result<(), Error> {
    let count = samples.count(record);
    let fits = |model: &&mut Trial| model.orders.is_linear() && model.orders.parameters() < count;
    let mut linear: Vec<&mut Trial> = tried.iter_mut().filter(fits).collect();
    if linear.is_empty() {
        return Ok(());
    }
    let orders: Vec<&Orders> = linear.iter().map(|model| &model.orders).collect();
    let columns = Columns::new(orders.iter().copied(), record.inputs.len());
    let rows = rows(record, &columns, samples)?;
    let fitted = Scaled::new(&rows).fit(&columns, &orders, with_parameters);
    for (model, fitted) in linear.iter_mut().zip(fitted) {
        let point = |Fitted { cost, parameters }| Point { parameters, cost, initial: 0.0 };
        model.point = fitted.map(point);
    }
    Ok(())
}
