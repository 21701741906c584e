//! Fits of several models to the same samples, so that their costs can be compared.

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

use thetahat_numerics::optimize::{Deadline, Monitor, Search, best_free, search};

use super::prediction_error::is_determined;
use super::predictor::{InitialCondition, Predictor};
use super::start::candidates;
use super::thinning::energy;
use crate::Error;
use crate::data::Record;
use crate::model::Orders;
use crate::respond::NOTHING_LEFT;

/// A step that raises the log-likelihood by less than this fraction of one is not done.
const SETTLED: f64 = 0.02;

/// The largest price of an initial condition, for outputs that a model explains without errors.
const LARGEST_PRICE: f64 = 100.0;

/// Where in a segment errors begin, and where they count: the same for all models.
///
/// In the first samples, as many as the largest maximum lag of the models, e = 0; the transient of 1/C that this causes
/// fades before errors count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Window {
    /// The largest maximum lag of the models.
    pub(crate) left_out: usize,
    /// The first sample that counts.
    pub(crate) counted: usize,
}

/// The samples that all models are fitted to.
///
/// Before a segment all signals are zero; or they are unknown, and the initial conditions of 1/F are estimated.
#[derive(Clone)]
pub(crate) struct Common<'a> {
    record: &'a Record<'a>,
    begin: InitialCondition,
    window: Window,
    options: Search,
    /// A sum of squares below which errors are rounding.
    smallest: f64,
    deadline: Deadline,
    monitor: Monitor<'a>,
    /// Counts models, see [`finished`](Common::finished).
    done: Option<&'a AtomicUsize>,
}

/// A model that was fitted.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Point {
    /// theta-hat, in the order of [`Orders::names`].
    pub(crate) parameters: Vec<f64>,
    /// sum e^2.
    pub(crate) cost: f64,
    /// What the initial conditions of 1/F cost, in units of 2 ln(likelihood); zero without them.
    pub(crate) initial: f64,
}

impl<'a> Common<'a> {
    /// # Errors
    /// [`Error::Argument`] for a setting of the search that makes no sense.
    pub(crate) fn new(
        record: &'a Record<'a>,
        free: bool,
        window: Window,
        options: &Search,
        deadline: Deadline,
        monitor: Monitor<'a>,
    ) -> Result<Self, Error> {
        options.check_numbers()?;
        let samples: usize = record.segments.iter().map(Range::len).sum();
        let tolerance = options.tolerance.max(SETTLED / samples.max(1) as f64);
        let options = Search { initial_parameters: None, starts: 0, tolerance, ..options.clone() };
        let smallest = NOTHING_LEFT * energy(record);
        let begin = if free { InitialCondition::Unknown } else { InitialCondition::Zero };
        Ok(Self { record, begin, window, options, smallest, deadline, monitor, done: None })
    }

    /// The same that counts the models that are finished.
    pub(crate) fn counting(self, done: &'a AtomicUsize) -> Self {
        Self { done: Some(done), ..self }
    }

    /// Counts a model that all was done for.
    pub(crate) fn finished(&self) {
        if let Some(done) = self.done {
            done.fetch_add(1, Ordering::Relaxed);
        }
    }

    fn predictor(&self, orders: &Orders) -> Predictor<'a> {
        Predictor::counting(self.record, orders, self.begin, self.window.left_out, self.window.counted)
    }

    /// The least sum of squared errors that searches find: one from the best of `starts`, and with `recipes` one from
    /// the best of the starts that the data give. None where the data do not determine the parameters.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub(crate) fn fit(
        &self,
        orders: &Orders,
        starts: &[Vec<f64>],
        recipes: bool,
    ) -> Result<Option<Point>, Error> {
        let mut predictor = self.predictor(orders);
        if predictor.samples() <= orders.parameters() + predictor.initial_conditions() {
            return Ok(None);
        }
        let own: Vec<Vec<f64>> = if recipes && (starts.is_empty() || !self.deadline.is_over()) {
            let candidates = candidates(self.record, orders, self.deadline).unwrap_or_default();
            candidates.into_iter().map(|candidate| candidate.parameters).collect()
        } else {
            Vec::new()
        };
        let mut best: Option<(f64, Vec<f64>)> = None;
        for starts in [starts, &own] {
            let costs =
                starts.iter().filter_map(|start| Some((best_free(&mut predictor, start).ok()?, start)));
            let first = costs.min_by(|(one, _), (other, _)| one.total_cmp(other));
            let Some((_, start)) = first else { continue };
            let found =
                search(&mut predictor, start, &self.options, self.smallest, self.deadline, self.monitor)?;
            let Ok(found) = found else { continue };
            if best.as_ref().is_none_or(|(cost, _)| found.cost() < *cost) {
                best = Some((found.cost(), found.parameters));
            }
        }
        let Some((cost, parameters)) = best else { return Ok(None) };
        if best_free(&mut predictor, &parameters).is_err() {
            return Ok(None);
        }
        predictor.linearize();
        if cost > self.smallest && !is_determined(&predictor) {
            return Ok(None);
        }
        Ok(Some(Point { parameters, cost, initial: self.price(&predictor, cost) }))
    }

    /// The price of n initial conditions w: what is known of them before is that they have the size of the output. So
    /// their part in -2 ln(likelihood), integrated over them (Schwarz 1978, Annals of Statistics 6, without his limit
    /// of many samples: what fades is not seen better the longer it lasts), is
    ///
    /// ```text
    /// ln det(I + (mean y^2/sigma^2) sum h h'),  h = de/dw;
    /// ```
    ///
    /// but at least 2 n, as AIC has it: they are fitted to noise too.
    fn price(&self, predictor: &Predictor<'_>, cost: f64) -> f64 {
        let count = predictor.initial_conditions();
        if count == 0 {
            return 0.0;
        }
        let total: usize = self.record.segments.iter().map(Range::len).sum();
        let size = self.smallest / NOTHING_LEFT / total as f64;
        let variance = cost.max(self.smallest) / predictor.samples() as f64;
        let least = 2.0 * count as f64;
        predictor.free_information(size / variance).max(least).min(LARGEST_PRICE * count as f64)
    }

    /// The mean of e^2 of given parameters on samples that they were not fitted to. Initial conditions are, and take as
    /// many samples with them. None where C or F is unstable, the errors overflow, or too few samples count.
    pub(crate) fn mean(&self, orders: &Orders, parameters: &[f64]) -> Option<f64> {
        let mut predictor = self.predictor(orders);
        let left =
            predictor.samples().checked_sub(predictor.initial_conditions()).filter(|left| *left > 0)?;
        Some(best_free(&mut predictor, parameters).ok()? / left as f64)
    }
}
