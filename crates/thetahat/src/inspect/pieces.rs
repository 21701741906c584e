//! An inspection of a log that is read part by part.

mod channel;
mod clock;
pub(super) mod counts;
mod dynamics;
pub(super) mod far;
mod input;
mod part;

use std::fmt;

use rayon::prelude::*;

use super::clock::Ticks;
use super::run::{self, roles};
use super::{Inspection, InspectionPlan, findings};
use crate::Error;
use crate::data::{Channel, Finding, Padding, Recording, Source, Times, check};
use channel::ChannelTotals;
use clock::Steps;
use dynamics::Dynamics;

/// The median step of the first part and that of the whole log differ by less than this fraction.
const SAME_STEP: f64 = 0.01;

/// An inspection of a log of any length, of which the parts are given one after the other: memory does not grow with
/// the rows.
///
/// A log of one part is inspected as [`inspect()`](super::inspect()) does. Of several parts each figure is a sum that
/// adds up over them, the boundaries included:
///
/// - exact to rounding: rows, clock (gaps, the first row at which time goes back), and of each channel what is missing,
///   its range, mean, standard deviation, trend, repeated values, holds, saturation; of each input its changes, order
///   of excitation, spectrum, and whether it is the same as another one.
/// - from the moments of lagged signals up to lag 112: delays, with a constant in all models, and prewhitened
///   correlations. Of each segment they leave out as many first samples.
/// - from counts of values: the median step is exact while there are no more than 65,536 different ones; beyond that it
///   has a relative error of 2^-10 at most, in practice. The limit of outliers follows from two quantiles of such
///   counts; of more than 16,384 outliers the farthest are counted. What a channel is rounded to is told of up to
///   65,536 different values. (Of more than 16 channels these numbers are less, down to a sixteenth.)
/// - of the first 100,000 rows, or of the first part if it has fewer: feedback, impulse responses.
/// - left out: whether a step test begins at rest, delays where there are more than seven inputs or the sums lack the
///   digits, and excitation, delays and feedback where the clock is irregular or goes back: the log is not resampled.
///
/// The findings of the document name what is left out, and what is of the first rows. Gaps are told by the median step
/// of the first part; where the whole log has another one, what depends on it is left out.
///
/// Cost: O(N (log L + q^2 L)) for N rows, q inputs and outputs and L = 112; the memory of a part, 4 MB for each channel
/// (0.3 MB of more than 256), and some 30 MB for the lags of eight signals.
///
/// Source: the sums are those of `regression::lagged_moments` (Chan, Golub and LeVeque 1983), the counts those of
/// Epicoco et al. (IEEE Access 8, 2020).
///
/// ```
/// use thetahat::data::{Channel, Recording, Rows, Source, Times};
/// use thetahat::inspect::{InspectionPlan, PiecewiseInspection};
///
/// let plan = InspectionPlan { inputs: vec!["u".into()], output: None, resample: None };
/// let mut inspection = PiecewiseInspection::new(plan)?;
/// for part in 0..4_u32 {
///     let u = (0..5000_u32).map(|row| f64::from((5000 * part + row).pow(2) % 1009)).collect();
///     let channels = vec![Channel { name: "u".into(), values: u }];
///     inspection.add(Recording { channels, times: Times::Uniform(0.1) })?;
/// }
/// let source =
///     Source { file: "log".into(), rows: Rows::new(1, 20_000)?, time: None, start: None, resampled: None };
/// let found = inspection.finish(&source)?;
/// assert_eq!((found.rows, found.excitation[0].order), (20_000, 50));
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug)]
pub struct PiecewiseInspection {
    plan: InspectionPlan,
    totals: Option<Totals>,
    /// The first part, while it is the only one.
    only: Option<Recording>,
}

/// What is known so far.
struct Totals {
    names: Vec<String>,
    rows: usize,
    channels: Vec<ChannelTotals>,
    clock: Clocked,
    /// Or why there are none.
    dynamics: Result<Dynamics, String>,
}

impl fmt::Debug for Totals {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Totals").field("names", &self.names).field("rows", &self.rows).finish_non_exhaustive()
    }
}

enum Clocked {
    Uniform(f64),
    Measured {
        steps: Steps,
        /// That of the first part.
        median: f64,
    },
}

impl PiecewiseInspection {
    /// Of no rows yet.
    ///
    /// # Errors
    /// [`Error::Argument`] for a plan that puts the log on another clock.
    pub fn new(plan: InspectionPlan) -> Result<Self, Error> {
        if plan.resample.is_some() {
            return Err(Error::argument(
                "resample",
                "a log that is inspected part by part is not put on another clock; resample it first, or inspect it whole",
            ));
        }
        Ok(Self { plan, totals: None, only: None })
    }

    /// Adds the next rows.
    ///
    /// # Errors
    /// As for [`inspect()`](super::inspect()), with the row of this part; [`Error::Data`] if a part has other channels
    /// than the first, or another kind of clock. Nothing has changed then.
    pub fn add(&mut self, part: Recording) -> Result<(), Error> {
        let rows = check(&part.channels)?;
        if let Times::Measured(time) = &part.times
            && time.len() != rows
        {
            return Err(Error::data(format!("there are {} time stamps for {rows} rows", time.len())));
        }
        match &mut self.totals {
            None => {
                self.totals = Some(Totals::new(&part, &self.plan)?);
                self.only = Some(part);
            }
            Some(totals) => {
                totals.add(&part, &self.plan)?;
                self.only = None;
            }
        }
        Ok(())
    }

    /// What there is to say of all rows. `source` says where they came from; its rows are those of the log.
    ///
    /// # Errors
    /// As for [`inspect()`](super::inspect()); [`Error::Data`] if there was no part.
    pub fn finish(self, source: &Source) -> Result<Inspection, Error> {
        match (self.only, self.totals) {
            (Some(only), _) => run::inspect(only, source, &self.plan),
            (None, Some(totals)) => totals.finish(source, &self.plan),
            (None, None) => Err(Error::data("the log has no rows")),
        }
    }
}

impl Totals {
    fn new(first: &Recording, plan: &InspectionPlan) -> Result<Self, Error> {
        let Recording { channels, times } = first;
        let roles = roles(channels, plan)?;
        let clock = match times {
            Times::Uniform(step) => {
                Ticks::new(times, check(channels)?)?;
                Clocked::Uniform(*step)
            }
            Times::Measured(time) => {
                let mut steps = Steps::new(time)?;
                // A first part that never advances says nothing; the whole is asked again.
                let median = steps.median().map_or(f64::NAN, |(median, _)| median);
                Clocked::Measured { steps, median }
            }
        };
        let (time, sample_time, runs) = match (&clock, times) {
            (Clocked::Measured { steps, median }, Times::Measured(time)) => {
                (time.as_slice(), *median, steps.run_forward())
            }
            (Clocked::Measured { median, .. }, _) => (&[][..], *median, true),
            (Clocked::Uniform(step), _) => (&[][..], *step, true),
        };
        let dynamics = if roles.is_empty() {
            Err(run::NO_ROLES.to_owned())
        } else if !runs || sample_time.is_nan() {
            Err(run::BACKWARD.to_owned())
        } else {
            let own = wanted(channels, plan).into_iter().cloned().collect();
            Ok(Dynamics::new(own, time, sample_time, plan)?)
        };
        let mut totals = Self {
            names: channels.iter().map(|channel| channel.name.clone()).collect(),
            rows: 0,
            channels: channels.iter().map(|_| ChannelTotals::new(channels.len())).collect(),
            clock,
            dynamics,
        };
        totals.count(first);
        Ok(totals)
    }

    fn add(&mut self, part: &Recording, plan: &InspectionPlan) -> Result<(), Error> {
        if !part.channels.iter().map(|channel| &channel.name).eq(&self.names) {
            return Err(Error::data(
                "a part has other channels than the first; give the same, in the same order",
            ));
        }
        let before = self.rows;
        let time = match (&mut self.clock, &part.times) {
            (Clocked::Uniform(step), Times::Uniform(own)) if step == own => &[][..],
            (Clocked::Measured { steps, .. }, Times::Measured(time)) => {
                steps.add(time)?;
                if !steps.run_forward() {
                    self.dynamics = Err(run::BACKWARD.to_owned());
                }
                time
            }
            _ => {
                return Err(Error::data(
                    "a part has another clock than the first; give all of them the same",
                ));
            }
        };
        if let Ok(dynamics) = &mut self.dynamics {
            dynamics.add(&wanted(&part.channels, plan), time)?;
        }
        debug_assert_eq!(self.rows, before);
        self.count(part);
        Ok(())
    }

    /// Counts what there is in the channels.
    fn count(&mut self, part: &Recording) {
        let first = self.rows;
        let origin = match &self.clock {
            Clocked::Measured { steps, .. } => steps.first(),
            Clocked::Uniform(_) => 0.0,
        };
        let elapsed = |position: usize| match &part.times {
            Times::Measured(time) => time[position] - origin,
            Times::Uniform(step) => (first + position) as f64 * step,
        };
        self.channels
            .par_iter_mut()
            .zip(&part.channels)
            .for_each(|(totals, channel)| totals.add(&channel.values, first, elapsed));
        self.rows += part.channels.first().map_or(0, |channel| channel.values.len());
    }

    fn finish(mut self, source: &Source, plan: &InspectionPlan) -> Result<Inspection, Error> {
        let mut left_out = Vec::new();
        let (ticks, first_median) = match &mut self.clock {
            Clocked::Uniform(step) => (Ticks::new(&Times::Uniform(*step), self.rows)?, *step),
            Clocked::Measured { steps, median } => {
                let (ticks, exact) = steps.finish()?;
                if !exact {
                    left_out.push(Finding::left_out(
                        "the clock has more different steps than are kept: its sample time is the median to three digits",
                    ));
                }
                (ticks, *median)
            }
        };
        let role = |name: &str| {
            let is_output = plan.output.as_deref() == Some(name);
            let is_input = plan.inputs.iter().any(|input| input == name);
            if is_output { Some("output") } else { is_input.then_some("input") }
        };
        let mut last = self.rows;
        let mut quality = Vec::with_capacity(self.channels.len());
        for (name, totals) in self.names.iter().zip(&mut self.channels) {
            if role(name).is_some() {
                last = last.min(totals.tail());
            }
            let (own, not_said) = totals.finish(name, role(name));
            quality.push(own);
            left_out.extend(not_said);
        }
        let mut inspection = run::described(quality, self.rows, &ticks, source, plan)?;
        inspection.findings.extend(left_out);
        match self.dynamics {
            Err(why) => inspection.findings.push(Finding::left_out(why)),
            Ok(_) if ticks.clock.irregular => inspection.findings.push(Finding::left_out(run::IRREGULAR)),
            Ok(_) if (first_median / ticks.clock.sample_time - 1.0).abs() > SAME_STEP => {
                inspection.findings.push(Finding::left_out(
                    "excitation, delay and feedback are left out, as the clock is another one at the beginning of the log",
                ));
            }
            Ok(dynamics) => {
                let padding = Padding::of(self.rows, last)?;
                inspection.findings.extend(padding.map(|padding| findings::of_padding(&padding)));
                dynamics.finish(&mut inspection, plan)?;
            }
        }
        let of_the_dynamics = findings::of_the_dynamics(&inspection, plan);
        inspection.findings.extend(of_the_dynamics);
        Ok(inspection)
    }
}

/// The inputs, then the output.
fn wanted<'c>(channels: &'c [Channel], plan: &InspectionPlan) -> Vec<&'c Channel> {
    let named = |name: &String| channels.iter().find(|channel| channel.name == *name);
    plan.inputs.iter().chain(&plan.output).filter_map(named).collect()
}
