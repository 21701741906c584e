//! Fits of state-space models.

mod estimated;
mod response;
#[cfg(test)]
mod tests;
mod warnings;

use std::ops::{ControlFlow, RangeInclusive};

use thetahat_numerics::optimize::{Monitor, Search};
use thetahat_numerics::regression::{SAFE_NORMS, largest};

use super::pending::{Open, PendingEvaluation};
use super::schema::{Data, Estimation, Report};
use super::shares::Shares;
use crate::Error;
use crate::data::{Detrend, Log, Offset, Rows, Source, Split};
use crate::estimate::{Constant, Criteria, Initial, Refine, SubspaceOptions, VectorArxOptions};
use crate::model::{Quantity, Signal, StateSpaceModel};
pub(super) use estimated::{Estimated, by_sums, of_arx};
pub use response::fit_states_to_response;

/// Which state-space model to fit, and to which part of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct StateSpacePlan {
    /// The input channels; none for a time series.
    pub inputs: Vec<String>,
    /// The output channels, at least one.
    pub outputs: Vec<String>,
    /// Rows to estimate on; none: all.
    pub estimate: Vec<Rows>,
    /// Rows to validate on.
    pub validate: Vec<Rows>,
    /// Cuts the rows to estimate on into parts: the fit is made to the first two, and evaluated on the third.
    pub split: Option<Split>,
    /// What is taken from each channel.
    pub detrend: Detrend,
    /// Channels whose offset is set by hand.
    pub offsets: Vec<(String, f64)>,
    /// The orders among which the least MDL chooses; none: those from 1 to 20 of which the data tell.
    pub orders: Option<RangeInclusive<usize>>,
    /// How the states are found.
    pub subspace: SubspaceOptions,
    /// Whether the levels of the outputs are estimated with the matrices: where the outputs would stay if the inputs
    /// stayed at their offsets. A mean is not it where a log begins or ends far from there. Auto: where it lowers MDL,
    /// unless nothing is taken from the channels ([`Detrend::None`]) or an output's offset is set by hand.
    pub constant: Constant,
    /// For each input the samples that it waits before the plant sees it; none: they do not wait.
    pub delays: Vec<usize>,
    /// An ARX model in the place of one of a subspace method, whose options then do not count;
    /// [`constant`](Self::constant) decides on its constant.
    pub arx: Option<VectorArxOptions>,
    /// Whose errors a search makes small, from the model of the subspace method and from that of another weighting;
    /// none: there is no search. With it poles, gains and responses have standard errors.
    pub refine: Option<Refine>,
    /// How to search.
    pub search: Search,
}

impl StateSpacePlan {
    /// All rows, means removed, everything else as the data say; further settings as fields.
    ///
    /// ```
    /// use thetahat::report::StateSpacePlan;
    ///
    /// let plan = StateSpacePlan { orders: Some(4..=4), ..StateSpacePlan::new(&["u"], &["y1", "y2"]) };
    /// assert!(plan.check().is_ok());
    /// ```
    pub fn new(inputs: &[&str], outputs: &[&str]) -> Self {
        let owned = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        Self {
            inputs: owned(inputs),
            outputs: owned(outputs),
            estimate: Vec::new(),
            validate: Vec::new(),
            split: None,
            detrend: Detrend::Mean,
            offsets: Vec::new(),
            orders: None,
            subspace: SubspaceOptions::default(),
            constant: Constant::Auto,
            delays: Vec::new(),
            arx: None,
            refine: None,
            search: Search::default(),
        }
    }

    /// Whether the plan makes sense, whatever the log.
    ///
    /// # Errors
    /// [`Error::Argument`] for no outputs, a channel that is there twice, an empty range of orders or order 0, a past
    /// of 0, and delays that are not one for each input.
    pub fn check(&self) -> Result<(), Error> {
        if self.outputs.is_empty() {
            return Err(Error::argument("output", "there is none; name at least one"));
        }
        let mut names: Vec<&str> = self.channels().collect();
        names.sort_unstable();
        if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(Error::argument("output", format!("'{}' is there twice; name it once", pair[0])));
        }
        if let Some((name, _)) = self.offsets.iter().find(|(name, _)| !names.contains(&name.as_str())) {
            return Err(Error::argument("offset", format!("'{name}' is no input or output of the model")));
        }
        if let Some(orders) = &self.orders
            && (*orders.start() == 0 || orders.is_empty())
        {
            let (first, last) = (orders.start(), orders.end());
            return Err(Error::argument(
                "order",
                format!("{first}..{last} is no range of orders; they begin with 1, such as 1..10"),
            ));
        }
        if self.subspace.past == Some(0) {
            return Err(Error::argument(
                "past",
                "it is 0, and a state is made of past samples; take 1 or more",
            ));
        }
        self.search.check_numbers()?;
        if self.inputs.is_empty() && self.refine == Some(Refine::Simulation) {
            return Err(Error::argument(
                "refine",
                "without inputs there is no free run whose errors could be small; take prediction",
            ));
        }
        if self.arx.is_some() && self.refine.is_some() {
            return Err(Error::argument("refine", "an ARX model is its own least errors; leave it out"));
        }
        if self.inputs.is_empty() && self.subspace.feedthrough == Some(true) {
            return Err(Error::argument("feedthrough", "without inputs there is none; leave it out"));
        }
        if !self.delays.is_empty() && self.delays.len() != self.inputs.len() {
            return Err(Error::argument(
                "delays",
                format!(
                    "there are {} for {} inputs; give one for each",
                    self.delays.len(),
                    self.inputs.len()
                ),
            ));
        }
        Ok(())
    }

    /// How many rows before a row a model is found from: the lags of an ARX model; or the past of a subspace method, 40
    /// where the data choose it, and 10 more or its future, from which its errors come.
    pub fn lags(&self) -> usize {
        let late = self.delays.iter().copied().max().unwrap_or(0);
        let lags = self.arx.as_ref().map(|arx| arx.longest(self.inputs.len()));
        late.saturating_add(lags.unwrap_or_else(|| self.subspace.lags()))
    }

    /// Levels that are given are not estimated unless that is asked for.
    pub(super) fn resolved_constant(&self) -> Constant {
        let by_hand = self.offsets.iter().any(|(name, _)| self.outputs.contains(name));
        let given = self.detrend == Detrend::None || by_hand;
        if self.constant == Constant::Auto && given { Constant::No } else { self.constant }
    }

    pub(super) fn channels(&self) -> impl Iterator<Item = &str> {
        self.inputs.iter().chain(&self.outputs).map(String::as_str)
    }
}

/// Fits a state-space model,
///
/// ```text
/// x(t+1) = F x(t) + G u(t) + K e(t)
/// y(t)   = H x(t) + D u(t) + e(t)
/// ```
///
/// with any number of inputs and outputs by a subspace method: see [`subspace`](crate::estimate::subspace()). The order
/// is that of least MDL, or given. Segments without a missing value are each used from their first sample on, from the
/// state that explains it best. Predictions and free runs start so too, and go on through missing outputs: predictions
/// by the time-varying Kalman filter of this form, whose variances have what is not known of the state.
///
/// With [`arx`](StateSpacePlan::arx) the model is an ARX model with a matrix polynomial A(q), by least squares.
///
/// With [`refine`](StateSpacePlan::refine) a search follows for the model of the least ln det cov e, whose e are errors
/// one step ahead or those of the free run; all entries of the matrices move but along changes of coordinates, and
/// poles, gains and responses have standard errors.
///
/// Cost: O(N q^2 p) for q channels and a past of p samples, and O(N (n + l) (n + q)) for each order n that is looked
/// at. An iteration of a search takes O(N r n (n + q)) for r = n (m + 2 l) directions.
///
/// # Errors
/// [`Error::Argument`] as for [`StateSpacePlan::check`], and for rows or orders that are not there; [`Error::Data`] for
/// channels that are not there, an irregular clock, or sums that leave the range of numbers; [`Error::Undetermined`] if
/// rows are too few, a channel is constant, outputs depend on one another, or no model has a stable predictor.
///
/// ```
/// use thetahat::data::{Channel, Log};
/// use thetahat::report::{StateSpacePlan, fit_state_space};
///
/// // x(t+1) = 0.8 x(t) + u(t), of which two sensors see once and twice as much, with some noise.
/// let mut random = 1_u32;
/// let mut sample = || {
///     random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
///     f64::from(random >> 16) / 32_768.0 - 1.0
/// };
/// let (mut u, mut y1, mut y2, mut x) = (vec![], vec![], vec![], 0.0);
/// for _ in 0..1000 {
///     u.push(sample());
///     y1.push(5.0 + x + 0.1 * sample());
///     y2.push(2.0 * x + 0.1 * sample());
///     x = 0.8 * x + u[u.len() - 1];
/// }
/// let channel = |name: &str, values| Channel { name: name.into(), values };
/// let log = Log::new(vec![channel("u", u), channel("y1", y1), channel("y2", y2)], 0.1)?;
/// let report = fit_state_space(&log, &[], &StateSpacePlan::new(&["u"], &["y1", "y2"]))?;
/// assert_eq!(report.model.name(), "state space of order 1");
/// let step = report.model.linear("a step response")?[1].step_response(0, Some(100))?;
/// assert!((step.values[99].value - 2.0 / (1.0 - 0.8)).abs() < 0.2);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn fit_state_space(log: &Log, sources: &[Source], plan: &StateSpacePlan) -> Result<Report, Error> {
    fit_state_space_monitored(log, sources, plan, &|_| ControlFlow::Continue(()))
}

/// As [`fit_state_space`], telling a monitor of the progress of the search.
///
/// # Errors
/// As for [`fit_state_space`], and [`Error::Interrupted`] if the monitor breaks.
pub fn fit_state_space_monitored(
    log: &Log,
    sources: &[Source],
    plan: &StateSpacePlan,
    monitor: Monitor<'_>,
) -> Result<Report, Error> {
    let (report, model) = fit(log, sources, plan, monitor)?;
    let signals = model.inputs.iter().chain(&model.outputs);
    let deviations = log.deviations(signals.map(|signal| (signal.name.as_str(), signal.offset)))?;
    PendingEvaluation::open(report, Open::StateSpace(model.into())).evaluate_on(&deviations)
}

impl PendingEvaluation {
    /// [`fit_state_space_monitored`] up to the figures.
    ///
    /// # Errors
    /// As for [`fit_state_space_monitored`].
    pub fn of_states(
        log: &Log,
        sources: &[Source],
        plan: &StateSpacePlan,
        monitor: Monitor<'_>,
    ) -> Result<Self, Error> {
        let (report, model) = fit(log, sources, plan, monitor)?;
        Ok(Self::open(report, Open::StateSpace(model.into())))
    }
}

/// The report without the figures of its fit, and the model.
fn fit(
    log: &Log,
    sources: &[Source],
    plan: &StateSpacePlan,
    monitor: Monitor<'_>,
) -> Result<(Report, StateSpaceModel), Error> {
    plan.check()?;
    let names: Vec<&str> = plan.channels().collect();
    names.iter().try_for_each(|name| log.channel(name).map(|_| ()))?;
    let shares = Shares::of(&plan.estimate, &plan.validate, plan.split, log.rows())?;
    let segments = log.segments(&names, &shares.estimation)?;
    if segments.is_empty() {
        return Err(Error::data(
            "no estimation row has a value in every channel; name other rows or channels",
        ));
    }
    let signal = |name: &String| -> Result<Signal, Error> {
        let values = &log.channel(name)?.values;
        let mut rows = segments.iter().cloned().flatten();
        let first = rows.next().map(|row| values[row]);
        if rows.all(|row| Some(values[row]) == first) {
            return Err(is_constant(name));
        }
        let by_hand = plan.offsets.iter().find(|(channel, _)| channel == name);
        let offset = match by_hand {
            Some(&(_, level)) => Offset { level, slope: 0.0 },
            None => Offset::estimate(plan.detrend, log, name, &segments)?,
        };
        Ok(Signal { name: name.clone(), offset })
    };
    let inputs = plan.inputs.iter().map(signal).collect::<Result<Vec<_>, Error>>()?;
    let outputs = plan.outputs.iter().map(signal).collect::<Result<Vec<_>, Error>>()?;
    let signals = inputs.iter().chain(&outputs).map(|signal| (signal.name.as_str(), signal.offset));
    let deviations = log.deviations(signals)?;
    for name in &names {
        let values = &deviations.channel(name)?.values;
        let each = segments.iter().map(|segment| largest(&values[segment.clone()]));
        if !SAFE_NORMS.contains(&each.fold(0.0, f64::max)) {
            return Err(Error::data(format!(
                "squares of '{name}' leave the range of numbers; scale the channel towards one"
            )));
        }
    }

    let delays = if plan.delays.is_empty() { vec![0; inputs.len()] } else { plan.delays.clone() };
    let record = deviations.joint_record(&plan.inputs, &plan.outputs, &shares.estimation)?.delayed(&delays);
    if record.segments.is_empty() {
        return Err(Error::undetermined(
            Vec::new(),
            "no segment is longer than the delays of the inputs (`nk`): lower them, or give more rows",
        ));
    }
    let constant = plan.resolved_constant();
    let found = match &plan.arx {
        Some(arx) => estimated::by_arx(&record, (arx, &delays), constant, log)?,
        None => estimated::by_subspace(&record, plan, constant, (log, monitor))?,
    };
    let segments = segments.iter().map(Rows::from_positions).collect();
    let data = shares.into_data((log, sources), &names, plan.detrend.to_string(), segments)?;
    reported(found, (inputs, outputs), delays, data)
}

/// The report of what was found, without the figures of its fit, and the model.
pub(super) fn reported(
    found: Estimated,
    (inputs, mut outputs): (Vec<Signal>, Vec<Signal>),
    mut delays: Vec<usize>,
    data: Data,
) -> Result<(Report, StateSpaceModel), Error> {
    let Estimated {
        matrices,
        levels,
        covariance,
        procedure,
        free,
        degrees,
        samples,
        mean,
        has_levels,
        delay,
        offered,
    } = found;
    delays.iter_mut().for_each(|own| *own += delay);
    for (output, level) in outputs.iter_mut().zip(&levels) {
        output.offset.level += level;
    }
    let mut model = StateSpaceModel::new((inputs, outputs), delays, &matrices, free, Some(degrees))?;
    if let Some(covariance) = covariance {
        model = model.with_covariance(covariance);
    }
    model.check()?;

    let estimation = Estimation {
        procedure,
        initial: Some(Initial::Estimate),
        level: if let ([output], true) = (&*model.outputs, has_levels) {
            Some(Quantity::new(output.offset.level, None))
        } else {
            None
        },
        slope: None,
        samples,
        mse: mean.trace() / mean.nrows() as f64,
        criteria: Criteria::new(mean.determinant(), free, samples),
        condition: None,
    };
    let words = warnings::of_fit(&model, &estimation, &offered);
    let mut report = Report::new(data, model.clone(), estimation);
    report.warnings.extend(words);
    Ok((report, model))
}

/// A channel that does not change.
pub(super) fn is_constant(name: &str) -> Error {
    Error::undetermined(
        Vec::new(),
        format!(
            "'{name}' is constant over the estimation rows: it can determine nothing; name rows in which it changes, or leave it out"
        ),
    )
}
