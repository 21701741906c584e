//! Fits of state-space models.

#[cfg(test)]
mod tests;
mod warnings;

use std::ops::{ControlFlow, RangeInclusive};

use super::evaluate::evaluate;
use super::schema::{Estimation, Report};
use super::shares::Shares;
use crate::data::{Detrend, JointRecord, Log, Offset, Rows, Source, Split};
use crate::estimate::{
    Constant, Criteria, Initial, OrderScore, Procedure, Refine, Refinement, RefinementOutcome,
    RefinementStart, Subspace, SubspaceOptions, SubspaceOutcome, Weighting, best_order,
    products_of_innovations, refined, subspace,
};
use crate::model::{Model, Quantity, Signal, StateSpaceModel};
use crate::optimize::{Monitor, Search};
use crate::regression::SAFE_NORMS;
use crate::respond::state_space::StateSpaceOnLog;
use crate::select::Focus;
use crate::validate::Part;
use crate::{Document, Error};

/// Singular values that a report keeps.
const MOST_VALUES: usize = 40;

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
    /// Whether the levels of the outputs are estimated with the matrices: where the outputs would stay if the inputs stayed at their offsets.
    /// A mean is not it where a log begins or ends far from there. Auto: where it lowers MDL, unless nothing is taken from the channels
    /// ([`Detrend::None`]) or an output's offset is set by hand.
    pub constant: Constant,
    /// For each input the samples that it waits before the plant sees it; none: they do not wait.
    pub delays: Vec<usize>,
    /// Whose errors a search makes small, from the model of the subspace method and from that of another weighting; none: there is no
    /// search. With it poles, gains and responses have standard errors.
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
            refine: None,
            search: Search::default(),
        }
    }

    /// Whether the plan makes sense, whatever the log.
    ///
    /// # Errors
    /// [`Error::Argument`] for no outputs, a channel that is there twice, an empty range of orders or order 0, a past of 0, and delays that
    /// are not one for each input.
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

    fn channels(&self) -> impl Iterator<Item = &str> {
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
/// with any number of inputs and outputs by a subspace method: see [`subspace`]. The order is that of least MDL, or given. Segments without a
/// missing value are each used from their first sample on, and predictions and free runs start each from the state that explains it best.
///
/// With [`refine`](StateSpacePlan::refine) a search follows for the model of the least ln det cov e, whose e are errors one step ahead or those
/// of the free run; all entries of the matrices move but along changes of coordinates, and poles, gains and responses have standard errors.
///
/// Cost: O(N q^2 p) for q channels and a past of p samples, and O(N (n + l) (n + q)) for each order n that is looked at. An iteration of a
/// search takes O(N r n (n + q)) for r = n (m + 2 l) directions.
///
/// # Errors
/// [`Error::Argument`] as for [`StateSpacePlan::check`], and for rows or orders that are not there; [`Error::Data`] for channels that are
/// not there, an irregular clock, or sums that leave the range of numbers; [`Error::Undetermined`] if rows are too few, a channel is
/// constant, outputs depend on one another, or no model has a stable predictor.
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
            return Err(Error::undetermined(
                Vec::new(),
                format!(
                    "'{name}' is constant over the estimation rows: it can determine nothing; name rows in which it changes, or leave \
                     it out"
                ),
            ));
        }
        let by_hand = plan.offsets.iter().find(|(channel, _)| channel == name);
        let offset = match by_hand {
            Some(&(_, level)) => Offset { level, slope: 0.0 },
            None => Offset::estimate(plan.detrend, log, name, &segments)?,
        };
        let rows = segments.iter().cloned().flatten();
        let largest =
            rows.map(|row| (values[row] - offset.at(log.elapsed(row))).abs()).fold(0.0_f64, f64::max);
        if !SAFE_NORMS.contains(&largest) {
            return Err(Error::data(format!(
                "squares of '{name}' leave the range of numbers; scale the channel towards one"
            )));
        }
        Ok(Signal { name: name.clone(), offset })
    };
    let inputs = plan.inputs.iter().map(signal).collect::<Result<Vec<_>, Error>>()?;
    let mut outputs = plan.outputs.iter().map(signal).collect::<Result<Vec<_>, Error>>()?;
    let signals = inputs.iter().chain(&outputs).map(|signal| (signal.name.as_str(), signal.offset));
    let deviations = log.deviations(signals)?;

    let delays = if plan.delays.is_empty() { vec![0; inputs.len()] } else { plan.delays.clone() };
    let record = deviations.joint_record(&plan.inputs, &plan.outputs, &shares.estimation)?.delayed(&delays);
    let given =
        plan.detrend == Detrend::None || plan.offsets.iter().any(|(name, _)| plan.outputs.contains(name));
    let constant = if plan.constant == Constant::Auto && given { Constant::No } else { plan.constant };
    let with = |constant: bool| Found::new(&record, plan, constant);
    let Found { subspace: found, order, scores, .. } = match constant {
        Constant::No => with(false)?,
        Constant::Yes => with(true)?,
        Constant::Auto => {
            let plain = with(false)?;
            // What has no level, as an integrator, is fitted without.
            with(true).ok().filter(|other| other.mdl < plain.mdl).unwrap_or(plain)
        }
    };
    let mut levels = found.levels(order).ok_or_else(|| {
        Error::undetermined(
            Vec::new(),
            "outputs that integrate have no level: leave the constant out (`constant` no)",
        )
    })?;
    let mut matrices = found.state_space(order, log.sample_time())?;
    let samples = record.segments.iter().map(std::ops::Range::len).sum::<usize>();
    let free = found.free_parameters(order);
    let degrees = samples.checked_sub(free.div_ceil(outputs.len())).filter(|degrees| *degrees > 0);
    let Some(degrees) = degrees else {
        return Err(Error::undetermined(
            Vec::new(),
            format!(
                "a model of order {order} has {free} free parameters, and {samples} samples of {} outputs are too few for them; give \
                 more rows, or ask for a lower order",
                outputs.len()
            ),
        ));
    };
    let (mut covariance, mut refinement) = (None, None);
    if let Some(refine) = plan.refine {
        let start = RefinementStart { name: found.weighting().to_string(), model: matrices, levels };
        let starts: Vec<RefinementStart> =
            std::iter::once(start).chain(other_start(&record, &found, order, log)).collect();
        let what = Refinement {
            refine,
            feedthrough: found.feedthrough(),
            constant: found.has_constant(),
            degrees_of_freedom: degrees,
        };
        let found = refined(&record, &starts, what, &plan.search, monitor)?;
        refinement = Some(RefinementOutcome { errors: refine, search: found.search });
        (matrices, levels, covariance) = (found.model, found.levels, found.covariance);
    }
    let products = products_of_innovations(&matrices, &record, &levels)
        .ok_or_else(|| Error::data("the errors one step ahead leave the range of numbers"))?;
    let mean = &products / samples as f64;
    matrices.noise_covariance = &products / degrees as f64;
    // A covariance is symmetric to the bit.
    matrices.noise_covariance.fill_lower_triangle_with_upper_triangle();
    for (output, level) in outputs.iter_mut().zip(&levels) {
        output.offset.level += level;
    }
    let mut model = StateSpaceModel::new((inputs, outputs), delays, &matrices, free, Some(degrees))?;
    if let Some(covariance) = covariance {
        model = model.with_covariance(covariance);
    }
    model.check()?;

    let segments = segments.iter().map(Rows::from_positions).collect();
    let data = shares.into_data((log, sources), &names, plan.detrend.to_string(), segments)?;
    let estimation = Estimation {
        procedure: Procedure::Subspace(SubspaceOutcome {
            weighting: found.weighting(),
            past: found.past(),
            future: found.future(),
            feedthrough: found.feedthrough(),
            feedthrough_given: plan.subspace.feedthrough.is_some(),
            constant: found.has_constant(),
            singular_values: found.singular_values().iter().copied().take(MOST_VALUES).collect(),
            orders: scores,
            refinement,
        }),
        initial: Some(Initial::Estimate),
        level: if let ([output], true) = (&*model.outputs, found.has_constant()) {
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
    let mut report = Report {
        schema: Report::SCHEMA.to_owned(),
        generator: concat!("thetahat ", env!("CARGO_PKG_VERSION")).to_owned(),
        data,
        selection: None,
        warnings: warnings::of_fit(&model, &estimation, &found.orders()),
        model: Model::from(model.clone()),
        estimation,
        fit: Vec::new(),
    };
    let signals =
        model.inputs.iter().chain(&model.outputs).map(|signal| (signal.name.as_str(), signal.offset));
    let deviations = log.deviations(signals)?;
    let on_log = |rows: &[Rows]| StateSpaceOnLog::new(&model, &deviations, rows, None);
    let own = on_log(&report.data.estimation)?;
    evaluate(&mut report, &own, Part::Estimation, Focus::Auto);
    for (part, rows) in report.data.held_out() {
        evaluate(&mut report, &on_log(&rows)?, part, Focus::Auto);
    }
    Ok(report)
}

/// A model of another weighting to start from: what is near the one minimum may be far from another. None where it has no such model.
fn other_start(
    record: &JointRecord<'_>,
    found: &Subspace,
    order: usize,
    log: &Log,
) -> Option<RefinementStart> {
    let weighting = if found.weighting() == Weighting::Ssarx { Weighting::Cva } else { Weighting::Ssarx };
    let options = SubspaceOptions {
        weighting,
        past: Some(found.past()),
        future: None,
        feedthrough: Some(found.feedthrough()),
        constant: found.has_constant(),
    };
    let other = subspace(record, &options).ok()?;
    let (model, levels) = (other.state_space(order, log.sample_time()).ok()?, other.levels(order)?);
    Some(RefinementStart { name: weighting.to_string(), model, levels })
}

/// The states of a record, and the order that was given or chosen.
struct Found {
    subspace: Subspace,
    order: usize,
    /// What the order was chosen among; none if it was given.
    scores: Vec<OrderScore>,
    /// That of the order.
    mdl: f64,
}

impl Found {
    fn new(record: &JointRecord<'_>, plan: &StateSpacePlan, constant: bool) -> Result<Self, Error> {
        let subspace = subspace(record, &SubspaceOptions { constant, ..plan.subspace })?;
        let (asked, highest) =
            (plan.orders.clone().unwrap_or_else(|| subspace.orders()), subspace.highest_order());
        let orders = *asked.start()..=(*asked.end()).min(highest);
        if orders.is_empty() {
            return Err(Error::argument(
                "order",
                format!("the data tell of orders up to {highest}; ask for one of these"),
            ));
        }
        let given = asked.start() == asked.end();
        let scores = subspace.scores(record, orders)?;
        let order = if given { *asked.start() } else { best_order(&scores)? };
        let own = scores.iter().find(|score| score.order == order).and_then(|score| score.mdl);
        let mdl = own.unwrap_or(f64::INFINITY);
        Ok(Self { subspace, order, scores: if given { Vec::new() } else { scores }, mdl })
    }
}
