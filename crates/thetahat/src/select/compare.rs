//! All models on the same samples.

use super::linear::{Columns, Fitted, Kept, Rows, Scaled};
use super::search::Family;
use super::{EXACT, Scored, Select, Task, unseen};
use crate::data::Record;
use crate::estimate::{Common, Initial, Point, Window, drop_is_not_for_f, stretches};
use crate::regression::{Presample, sum_of_squares};
use crate::{Criteria, Error, Orders};

/// Of records with more samples, models of which some need a search see stretches only: so many, each so long.
const LONG: usize = 1 << 16;
const STRETCHES: usize = 16;
const STRETCH: usize = 1 << 11;
/// So many samples behind those that models reach back to do not count where there is C: what 1/C makes of e = 0 before
/// them fades there. It would be tens of times the price of a parameter.
const FADING: usize = 50;
/// Of a segment of mean length not more than this part is given to that.
const LEAST_OF_PIECE: usize = 20;

/// Models that were compared.
pub(super) struct Outcome {
    /// Those that the data determine, and of each that was searched for its parameters.
    pub(super) scored: Vec<(Scored, Option<Vec<f64>>)>,
    pub(super) failed: usize,
    /// N.
    pub(super) samples: usize,
    /// The smallest model of all.
    pub(super) smallest: Option<Orders>,
    /// What there is to say of the samples, in sentences.
    pub(super) remarks: Vec<String>,
}

/// What all models share.
pub(super) struct Samples {
    pub(super) window: Window,
    pub(super) presample: Presample,
}

/// A model on the common samples.
#[derive(Debug, Clone)]
pub(super) struct Tried {
    pub(super) orders: Orders,
    pub(super) point: Option<Point>,
}

impl Samples {
    /// # Errors
    /// [`Error::Argument`] if samples are to be dropped and a model has F.
    pub(super) fn new(record: &Record<'_>, initial: Initial, models: &[Orders]) -> Result<Self, Error> {
        let filtered = |orders: &Orders| orders.nf.iter().any(|&nf| nf > 0);
        if initial == Initial::Drop && models.iter().any(filtered) {
            return Err(drop_is_not_for_f());
        }
        if initial == Initial::Zero {
            return Ok(Self { window: Window::default(), presample: Presample::Zero });
        }
        Ok(Self::unknown(record, models.iter()))
    }

    /// The samples behind those that some model reaches back to.
    pub(super) fn unknown<'m>(record: &Record<'_>, models: impl Iterator<Item = &'m Orders> + Clone) -> Self {
        // Segments that are too short for the free responses of one model are so for all.
        let reach = |orders: &Orders| orders.conditioned().max(orders.nf.iter().sum());
        let silent = models.clone().map(reach).max().unwrap_or(0);
        let coloured = models.filter(|orders| orders.nc > 0).count() > 0;
        let most = total(record) / record.segments.len().max(1) / LEAST_OF_PIECE;
        let counted = silent + if coloured { FADING.min(most) } else { 0 };
        Self { window: Window { silent, counted }, presample: Presample::Drop }
    }

    /// How many samples of a record count.
    pub(super) fn count(&self, record: &Record<'_>) -> usize {
        record.segments.iter().map(|segment| segment.len().saturating_sub(self.window.counted)).sum()
    }
}

/// Fits all models to the same samples. Each model is there once.
///
/// # Errors
/// As for [`choose`](super::choose).
pub(super) fn compare(task: &Task<'_>, models: Vec<Orders>) -> Result<Outcome, Error> {
    let mut remarks = Vec::new();
    let searched = models.iter().any(|orders| !orders.is_linear());
    let all = total(task.estimation);
    let thin = if searched && all > LONG { stretches(task.estimation, STRETCHES, STRETCH) } else { None };
    if let Some(thin) = &thin {
        remarks.push(format!(
            "To save time, compared on {} of {all} samples, in {} stretches spread over the log.",
            total(thin),
            thin.segments.len()
        ));
    }
    let record = thin.as_ref().unwrap_or(task.estimation);
    let samples = Samples::new(record, task.initial, &models)?;
    let count = samples.count(record);
    let with_unseen = matches!(task.select, Select::Validation | Select::Cv);
    let mut tried = fit_linear(record, &samples, &models, searched || with_unseen)?;
    let energy: f64 =
        record.segments.iter().map(|segment| sum_of_squares(&record.output[segment.clone()])).sum();
    let exact = |cost: f64| if cost <= EXACT * energy { 0.0 } else { cost };
    if searched {
        let free = task.initial != Initial::Zero;
        let common = Common::new(record, free, samples.window, task.search, task.monitor)?;
        let score = |point: &Point| {
            let (size, mse) = (point.parameters.len(), exact(point.cost) / count as f64);
            let score = score(Select::Mdl, mse, size, point.initial, count, None);
            score.unwrap_or(f64::NEG_INFINITY)
        };
        Family::new(&models).fit(&common, &mut tried, &score)?;
    }
    let looks = unseen::costs(task, record, &tried)?;
    let scored = tried.iter().zip(looks).filter_map(|(model, unseen)| {
        let point = model.point.as_ref()?;
        let unseen = match (with_unseen, unseen) {
            (true, None) => return None,
            (_, unseen) => unseen,
        };
        let cost = exact(point.cost);
        let mse = cost / count as f64;
        let parameters = model.orders.parameters();
        let scored = Scored {
            structure: model.orders.structure(),
            orders: model.orders.clone(),
            parameters,
            mse,
            unseen,
            score: score(task.select, mse, parameters, point.initial, count, unseen),
        };
        Some((scored, (!model.orders.is_linear()).then(|| point.parameters.clone())))
    });
    let scored: Vec<(Scored, Option<Vec<f64>>)> = scored.collect();
    let failed = models.len() - scored.len();
    Ok(Outcome { scored, failed, samples: count, smallest: models.first().cloned(), remarks })
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
    unseen: Option<f64>,
) -> Option<f64> {
    let raised = mse * (initial / samples as f64).exp();
    let criteria = Criteria::new(raised, parameters, samples);
    match select {
        Select::Mdl => criteria.mdl,
        Select::Aic => criteria.aic,
        Select::Aicc => criteria.aicc,
        Select::Fpe => Some(criteria.fpe),
        Select::Validation | Select::Cv => unseen,
    }
}

/// The models that are linear in their parameters; the others are left open.
fn fit_linear(
    record: &Record<'_>,
    samples: &Samples,
    models: &[Orders],
    with_parameters: bool,
) -> Result<Vec<Tried>, Error> {
    let count = samples.count(record);
    let linear: Vec<usize> =
        (0..models.len()).filter(|&k| models[k].is_linear() && models[k].parameters() < count).collect();
    let mut tried: Vec<Tried> =
        models.iter().map(|orders| Tried { orders: orders.clone(), point: None }).collect();
    if linear.is_empty() {
        return Ok(tried);
    }
    let own: Vec<&Orders> = linear.iter().map(|&k| &models[k]).collect();
    let columns = Columns::new(own.iter().copied(), record.inputs.len());
    let rows = rows(record, &columns, samples)?;
    let fitted = Scaled::new(&rows).fit(&columns, &own, with_parameters);
    for (k, fitted) in linear.into_iter().zip(fitted) {
        let point = |Fitted { cost, parameters }| Point { parameters, cost, initial: 0.0 };
        tried[k].point = fitted.map(point);
    }
    Ok(tried)
}

/// The rows of a record, kept so that costs are exact.
pub(super) fn rows(record: &Record<'_>, columns: &Columns, samples: &Samples) -> Result<Rows, Error> {
    let products = Rows::new(record, columns, samples.presample, samples.window.counted, Kept::Products)?;
    if products.are_exact() {
        return Ok(products);
    }
    Rows::new(record, columns, samples.presample, samples.window.counted, Kept::Factor)
}

/// All samples of a record.
pub(super) fn total(record: &Record<'_>) -> usize {
    record.segments.iter().map(std::ops::Range::len).sum()
}
