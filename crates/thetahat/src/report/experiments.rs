//! One model of experiments that others hold.

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::ops::Range;

use serde::{Deserialize, Serialize};
use thetahat_numerics::optimize::Monitor;

use super::Plan;
use super::from_sums::report_of;
use super::identify::{channels, estimation_rows};
use super::schema::{Data, Missing, Report};
use super::totals::Totals;
use crate::Error;
use crate::data::{Detrend, Log, Offset, Record, Rows, Source, digests};
use crate::estimate::{
    Answer, Ask, Beside, Constant, Distributed, ExperimentData, Fitted, Holders, Initial, LONG, Method,
    Question, Task, enough, segments_of_starts,
};
use crate::model::{Orders, Structure};
use crate::select::{Choice, Focus};

/// Experiments that others hold, in other processes or on other machines, as one model of all of them sees them: OE,
/// ARMAX, Box-Jenkins, or any other that a search finds.
///
/// Each holder describes its experiments with [`new`](Self::new), descriptions are [merged](Self::merge), every holder
/// takes the [offsets](Self::offsets) of all from its channels ([`deviations`](Self::deviations)), and the
/// [fit](Self::fit) asks all of them at once for sums over their rows ([`answer`](Self::answer)): the cost, its
/// gradient and its Gram matrix at the point where the search stands. The estimate is the one that
/// [`identify`](super::identify()) finds in the joined log, but for the order in which sums are added. Starts are found
/// in some rows of all: logs of fewer than [`FETCHED_BELOW`](Self::FETCHED_BELOW) rows together are fetched whole.
///
/// ```text
/// J = sum e^2,   g = sum psi e,   G = sum psi psi',   psi = -de/dtheta
/// ```
///
/// over all samples of all experiments, with psi less what the initial conditions of its experiment explain of it
/// (Ljung, System Identification, 2nd ed. 1999, section 10.2). Each holder's work in an iteration is O(N p) for its N
/// rows, and p^2 + n (p + 1) numbers come from it, for n initial conditions.
///
/// ```
/// use thetahat::data::{Channel, Log};
/// use thetahat::model::Orders;
/// use thetahat::report::{Experiments, Plan, identify};
///
/// let log = |seed: u32| {
///     let u: Vec<f64> = (0..300).map(|t: u32| f64::from((t * t + seed * t) % 11)).collect();
///     let mut x = vec![1.0];
///     for t in 1..u.len() {
///         x.push(0.8 * x[t - 1] + 0.5 * u[t - 1]);
///     }
///     let y = x.iter().zip(0_u32..).map(|(x, t)| x + 0.01 * f64::from(t * (7 + seed) % 13)).collect();
///     let channel = |name: &str, values| Channel { name: name.into(), values };
///     Log::new(vec![channel("u", u), channel("y", y)], 0.1)
/// };
/// let plan = Plan::new(&["u"], "y", Orders::oe(&[1], &[1], &[1])?);
/// let logs = [log(1)?, log(2)?];
///
/// let mut all = Experiments::new(&logs[0], &[], &plan)?;
/// all.merge(&Experiments::new(&logs[1], &[], &plan)?)?;
/// let offsets = all.offsets(&plan)?;
/// let held: Vec<Log> = logs.iter().map(|log| Experiments::deviations(log, &plan, &offsets)).collect::<Result<_, _>>()?;
/// let report = all.fit(
///     &plan,
///     &|questions| {
///         held.iter().zip(questions).map(|(log, question)| Experiments::answer(log, &plan, question)).collect()
///     },
///     &|_| std::ops::ControlFlow::Continue(()),
/// )?;
/// let whole = identify(Log::join(logs.to_vec())?, &[], &plan)?;
/// for (one, other) in report.model.parameters().iter().zip(whole.model.parameters()) {
///     assert!((one.value - other.value).abs() < 1e-8);
/// }
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Experiments {
    /// The inputs, and the output after them.
    names: Vec<String>,
    channels: Vec<Totals>,
    sample_time: f64,
    holders: Vec<Holder>,
    time_gaps: usize,
    logs: Vec<Source>,
    digests: Vec<BTreeMap<String, String>>,
}

/// What one holder has.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Holder {
    rows: usize,
    /// The rows that count, counted from its first one.
    segments: Vec<Range<usize>>,
}

impl Experiments {
    /// The fit asks for all rows of fewer than these: starts see them all.
    pub const FETCHED_BELOW: usize = LONG;

    /// Those of a log, which may be [joined](Log::join) of several.
    ///
    /// # Errors
    /// [`Error::Argument`] for a plan that asks for more than a search on all rows; [`Error::Data`] for a channel that
    /// is not there, or if no row has a value in every channel.
    pub fn new(log: &Log, sources: &[Source], plan: &Plan) -> Result<Self, Error> {
        let orders = searched(plan)?;
        let names = channels(log, plan)?;
        log.check_uniform()?;
        let all = [Rows::new(1, log.rows())?];
        let segments = log.segments(&names, &all)?;
        if segments.is_empty() {
            return Err(Error::data("no row has a value in every channel; name other channels"));
        }
        let record = estimation_rows(log, plan, orders, &all)?;
        let totals = names.iter().map(|name| {
            let own = if *name == plan.output { &segments } else { &record.segments };
            Ok(Totals::of(&log.channel(name)?.values, 0, own))
        });
        Ok(Self {
            channels: totals.collect::<Result<_, Error>>()?,
            names: names.iter().map(|name| (*name).to_owned()).collect(),
            sample_time: log.sample_time(),
            holders: vec![Holder { rows: log.rows(), segments: record.segments.clone() }],
            time_gaps: log.gaps(),
            logs: sources.to_vec(),
            digests: digests(log, &names, &all)?,
        })
    }

    /// Adds those of other holders after these.
    ///
    /// # Errors
    /// After which nothing has changed. [`Error::Data`] if they have other channels, sample times that differ by more
    /// than 1 %, or one of the logs that are there.
    pub fn merge(&mut self, other: &Self) -> Result<(), Error> {
        if self.channels() != other.channels() {
            return Err(Error::data(format!(
                "the first experiments have the channels {}, the second ones {}; give all the same",
                self.channels().join(", "),
                other.channels().join(", ")
            )));
        }
        if (other.sample_time / self.sample_time - 1.0).abs() > 0.01 {
            return Err(Error::data(format!(
                "the second experiments have a sample time of {} s, the first ones of {} s; resample one of them",
                other.sample_time, self.sample_time
            )));
        }
        let known = || self.logs.iter().map(|log| &log.file).zip(&self.digests);
        let more = other.logs.iter().zip(&other.digests);
        let twice = |(log, digests): &(&Source, &BTreeMap<String, String>)| {
            known().any(|(file, known)| *file == log.file && known == *digests)
        };
        if let Some((log, _)) = more.into_iter().find(twice) {
            return Err(Error::data(format!("'{}' is given twice; give each experiment once", log.file)));
        }
        let rows = self.rows();
        let later = |log: &Source| {
            let rows = Rows::new(log.rows.first() + rows, log.rows.last() + rows)?;
            Ok(Source { rows, ..log.clone() })
        };
        let logs = other.logs.iter().map(later).collect::<Result<Vec<_>, Error>>()?;
        self.channels.iter_mut().zip(&other.channels).for_each(|(own, more)| own.add(more));
        self.holders.extend(other.holders.iter().cloned());
        self.time_gaps += other.time_gaps;
        self.logs.extend(logs);
        self.digests.extend(other.digests.iter().cloned());
        Ok(())
    }

    /// The same in one hand: the logs [joined](Log::join) in their order.
    #[must_use]
    pub fn joined(self) -> Self {
        let holder = Holder { rows: self.rows(), segments: self.segments() };
        Self { holders: vec![holder], ..self }
    }

    /// The rows that count, counted through all holders.
    fn segments(&self) -> Vec<Range<usize>> {
        let (mut rows, mut segments) = (0, Vec::new());
        for holder in &self.holders {
            segments.extend(holder.segments.iter().map(|own| own.start + rows..own.end + rows));
            rows += holder.rows;
        }
        segments
    }

    /// The names of the channels, the output last.
    pub fn channels(&self) -> Vec<&str> {
        self.names.iter().map(String::as_str).collect()
    }

    /// All rows.
    pub fn rows(&self) -> usize {
        self.holders.iter().map(|holder| holder.rows).sum()
    }

    /// Whether the fit asks for all rows, as there are few.
    pub fn are_fetched(&self) -> bool {
        segments_of_starts(&self.segments()).is_none()
    }

    /// What is to be taken from each channel, the inputs first: its mean over all experiments, what is set by hand, or
    /// nothing.
    ///
    /// # Errors
    /// [`Error::Undetermined`] for an input or an output that is constant.
    pub fn offsets(&self, plan: &Plan) -> Result<Vec<f64>, Error> {
        let orders = searched(plan)?;
        let each = self.names.iter().zip(&self.channels).enumerate().map(|(place, (name, totals))| {
            let by_hand = plan.offsets.iter().find(|(channel, _)| channel == name).map(|(_, level)| *level);
            let told = by_hand.or((plan.detrend == Detrend::None).then_some(0.0));
            let level = totals.level(name, told, (place < orders.inputs()).then_some(place), orders);
            level.unwrap_or_else(|| {
                Err(Error::data("no row has a value in every channel; give other experiments or channels"))
            })
        });
        each.collect()
    }

    /// Searches for the model, with the figures that need no second pass over the data: the fit one step ahead on the
    /// rows of the fit. The holders have [`deviations`](Self::deviations).
    ///
    /// # Errors
    /// As for [`identify`](super::identify()), and what `ask` says.
    pub fn fit(&self, plan: &Plan, ask: Ask<'_>, monitor: Monitor<'_>) -> Result<Report, Error> {
        let orders = searched(plan)?;
        let offsets = self.offsets(plan)?;
        let samples = self.holders.iter().flat_map(|holder| &holder.segments).map(Range::len).sum();
        enough(samples, orders)?;
        let holders = Holders::new(ask, self.holders.len());
        let near = Near::of(self, &holders)?;
        let mut method = plan.method.clone();
        if let Method::PredictionError(search) = &mut method {
            search.plant_first = plan.focus == Focus::Simulation;
        }
        let beside = Beside::constant(near.rows(), self.sample_time);
        let record = near.record();
        let (inputs, initial, constant) = (plan.inputs.as_slice(), plan.initial, plan.constant());
        let fit = Fit { constant, beside: &beside, takes_offset: plan.takes_output_offset() };
        let fitted = if near.is_all {
            fit.of(&Task { data: &record, inputs, orders, method: &method, initial, monitor })?
        } else {
            let data = Distributed::new(&holders, record, near.energy);
            let found = fit.of(&Task { data: &data, inputs, orders, method: &method, initial, monitor });
            holders.failure().map_or(found, Err)?
        };
        let spread = holders.output_spread(orders, fitted.estimate.initial() == Initial::Zero)?;
        report_of(self.data(plan)?, &fitted, orders, (&self.channels(), &offsets), spread)
    }

    /// The log without the offsets of its channels, which [`offsets`](Self::offsets) gives: what is asked for answers.
    ///
    /// # Errors
    /// [`Error::Data`] for a channel that is not there.
    pub fn deviations(log: &Log, plan: &Plan, offsets: &[f64]) -> Result<Log, Error> {
        let mut taken = log.part(&channels(log, plan)?, Rows::new(1, log.rows())?)?;
        for (name, level) in channels(log, plan)?.into_iter().zip(offsets) {
            taken.remove(name, &Offset { level: *level, slope: 0.0 });
        }
        Ok(taken)
    }

    /// What the [`deviations`](Self::deviations) of some experiments answer. As long as an iteration of a search.
    ///
    /// # Errors
    /// [`Error::Argument`] if the question is about other experiments.
    pub fn answer(deviations: &Log, plan: &Plan, question: &Question) -> Result<Answer, Error> {
        let all = [Rows::new(1, deviations.rows())?];
        question.answered_by(&estimation_rows(deviations, plan, searched(plan)?, &all)?)
    }

    /// What the model is fitted to.
    fn data(&self, plan: &Plan) -> Result<Data, Error> {
        let missing = self.names.iter().zip(&self.channels);
        Ok(Data {
            logs: self.logs.clone(),
            digests: self.digests.clone(),
            rows: self.rows(),
            sample_time: self.sample_time,
            detrend: plan.detrend.to_string(),
            prefilter: None,
            estimation: vec![Rows::new(1, self.rows())?],
            validation: Vec::new(),
            split: None,
            segments: self.segments().iter().map(Rows::from_positions).collect(),
            missing: missing
                .map(|(name, totals)| Missing { channel: name.clone(), rows: totals.missing })
                .collect(),
            time_gaps: self.time_gaps,
        })
    }
}

/// What is fitted beside the parameters.
struct Fit<'f> {
    constant: Constant,
    beside: &'f Beside,
    takes_offset: bool,
}

impl Fit<'_> {
    fn of<D: ExperimentData>(&self, task: &Task<'_, D>) -> Result<Fitted, Error> {
        let mut fitted = task.fit(self.constant, self.beside, None)?;
        if fitted.offset.is_none() && self.takes_offset {
            fitted.open = task.left_open(self.beside, &fitted.estimate)?;
        }
        Ok(fitted)
    }
}

/// Rows that are at hand.
struct Near {
    /// The output last.
    channels: Vec<Vec<f64>>,
    segments: Vec<Range<usize>>,
    is_all: bool,
    energy: f64,
}

impl Near {
    /// All of them, or as many as starts need.
    fn of(all: &Experiments, holders: &Holders<'_>) -> Result<Self, Error> {
        let segments = all.segments();
        let firsts = all.holders.iter().scan(0, |rows, holder| {
            *rows += holder.rows;
            Some(*rows - holder.rows)
        });
        let firsts: Vec<usize> = firsts.collect();
        let thin = segments_of_starts(&segments);
        let is_all = thin.is_none();
        let wanted = thin.unwrap_or(segments);
        let mut asked = vec![Vec::new(); all.holders.len()];
        for own in &wanted {
            let holder = firsts.partition_point(|first| *first <= own.start) - 1;
            asked[holder].push(own.start - firsts[holder]..own.end - firsts[holder]);
        }
        let (channels, energy) = holders.rows(&asked, all.channels.len())?;
        let mut end = 0;
        let segments = wanted.iter().map(|own| {
            end += own.len();
            end - own.len()..end
        });
        let segments = segments.collect();
        let near = Self { channels, segments, is_all, energy };
        if near.channels.iter().any(|own| own.len() != near.rows()) {
            return Err(Error::data("holders have other rows than they described; describe them again"));
        }
        Ok(near)
    }

    fn rows(&self) -> usize {
        self.segments.last().map_or(0, |last| last.end)
    }

    fn record(&self) -> Record<'_> {
        let (output, inputs) = self
            .channels
            .split_last()
            .map_or((&[][..], &[][..]), |(output, inputs)| (output.as_slice(), inputs));
        Record {
            output,
            inputs: inputs.iter().map(Vec::as_slice).collect(),
            segments: self.segments.clone(),
            past: vec![0; self.segments.len()],
        }
    }
}

/// The orders of a plan that a search on all rows of experiments that others hold serves.
fn searched(plan: &Plan) -> Result<&Orders, Error> {
    plan.check()?;
    let Choice::Known(orders) = &plan.choice else {
        return Err(Error::argument(
            "orders",
            "experiments that others hold are fitted one model; give its orders",
        ));
    };
    plan.check_focus(orders)?;
    let parts = !(plan.estimate.is_empty() && plan.validate.is_empty()) || plan.split.is_some();
    let with_noise = plan.focus == Focus::Simulation && orders.structure() != Structure::Oe;
    let refused = [
        (
            orders.is_linear(),
            "orders",
            "a model with A and B alone is found in one pass; take the normal equations of the experiments",
        ),
        (
            !matches!(plan.method, Method::PredictionError(_)),
            "method",
            "experiments that others hold are fitted by least squares; leave the other method or criterion out",
        ),
        (
            parts,
            "rows",
            "all rows serve for the fit; cut the experiments, and validate the model on other ones",
        ),
        (plan.prefilter.is_some(), "prefilter", "filter the signals before"),
        (plan.trend, "trend", "experiments have no common line; leave it out"),
        (
            !matches!(plan.detrend, Detrend::Mean | Detrend::None),
            "detrend",
            "what is taken from the channels of all experiments is their mean or nothing; give mean or none",
        ),
        (
            with_noise,
            "focus",
            "a plant before its noise takes two searches; fit the output error, or leave the focus out",
        ),
    ];
    match refused.into_iter().find(|(refused, _, _)| *refused) {
        Some((_, argument, message)) => Err(Error::argument(argument, message)),
        None => Ok(orders),
    }
}
