use serde::{Deserialize, Serialize};
use thetahat_core::{Action, Alarm, ChangeDetector, Chart, Innovation, Real};

use super::checks::{check, check_map, refused};
use super::collecting::{Collecting, LARGEST, SMALLEST};
use super::equation::{equation, names};
use super::estimator::{DelayLines, Estimator};
use super::plan::{PerChannel, TrackPlan};
use super::run_length::change_detector;
use super::score::TrackScore;
use crate::Error;
use crate::model::{Map, Orders};

mod snapshot;

/// The farthest horizon: beyond it a number was mistyped.
const FARTHEST: usize = 10_000;

/// What a tracker made of one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tracked {
    /// The one-step prediction, from all samples before and the inputs of this one, in the output's units; NaN if there
    /// is none: while rows are collected, and where it depends on a missing sample. (It is there where only the output
    /// is missing.)
    pub predicted: f64,
    /// The innovation e: the output less its prediction; NaN if one of the two is missing.
    pub error: f64,
    /// S, the variance of e; NaN until the noise variance is known.
    pub variance: f64,
    /// e²/S, the normalised innovation squared: 1 on average. 0 where S is not known.
    pub nis: f64,
    /// What was done with the sample.
    pub action: Action,
    /// How much is known of the parameter that least is known of, 0 … 1; 0 while scales are collected. Below 0.5 or so,
    /// do not rely on the parameters. See
    /// [`RecursiveLeastSquares::excitation`](thetahat_core::RecursiveLeastSquares::excitation).
    pub excitation: f64,
    /// A change that was noticed, if that was asked for. The charts begin after 2 n + 20 innovations, n being the
    /// number of parameters: a noise variance from fewer would call many a sample unlikely. After a report they begin
    /// at once.
    pub alarm: Option<Alarm<f64>>,
    /// Whether a value was so large that sums with it could overflow (beyond about 1e148, or 1e98 while scales are
    /// collected): it was taken for missing.
    pub too_large: bool,
}

/// A model that is estimated while the plant runs: ARX, ARMAX or nonlinear ARX under one forgetting policy.
///
/// ```text
/// A(q) y(k) = sum_j B_j(q) u_j(k) + constant + C(q) e(k),   or   y(k) = g(past outputs and inputs) + e(k)
/// ```
///
/// It is a [`RecursiveArx`](thetahat_core::RecursiveArx), a [`RecursiveArmax`](thetahat_core::RecursiveArmax) or a
/// [`RecursiveNarx`](thetahat_core::RecursiveNarx), where the equations and the sources are, with what a program needs
/// that gets its orders from a person: channels with offsets, scales that are found, predictions, figures, detection of
/// changes, and a start from the report of a fit. NaN is a missing sample. Parameters are those of the signals less
/// their offsets.
///
/// # Several outputs
///
/// ```text
/// A(q) y(k) = sum_j B_j(q) u_j(k) + constant + e(k),   A(q) = I + A_1 q⁻¹ + … + A_na q⁻ⁿᵃ with full matrices
/// ```
///
/// is an equation for each output: [`Tracker::coupled`] is one of them, a tracker with the past of all outputs in its
/// regressor, and [`Tracker::log_row_of`] and [`forecasts`](crate::track::forecasts) are for as many of them side by
/// side. Each has a memory, a noise variance, a detector and a dead zone of its own, and goes on learning where another
/// output is missing, as long as no such sample is in its regressor.
/// ([`RecursiveVectorArx`](thetahat_core::RecursiveVectorArx) is all of them in one with a common P: for a controller,
/// where no output is ever missing alone.)
///
/// # Scales
///
/// The estimator needs the typical magnitude of each channel, for its prior and its bounds. If the plan does not have
/// them, the tracker keeps the latest L rows, L being the maximum lag of the orders plus two rows for each parameter
/// and at least 10, until there are L and every channel has shown a value other than 0 (below 1e-98 counts as 0). So
/// long the action is [`Action::Collecting`]. Then the scales are the largest magnitudes that were seen, the rows that
/// were kept go into the estimator, and from the next row on all is, to the bit, as if the scales had been given and it
/// had started with the first of these rows.
///
/// # Cost
///
/// For n parameters 2 n² + 10 n multiply-adds, 2 n divisions and one logarithm a sample. Once the scales are known a
/// sample takes no memory, and nothing grows with their number.
///
/// A tracker is plain data. With serde it is written and read back, and goes on to the bit; what does not fit together
/// is an error.
///
/// ```
/// use thetahat::model::Orders;
/// use thetahat::track::{TrackPlan, Tracker};
///
/// let mut tracker = Tracker::new(&Orders::arx(1, &[1], &[1])?, &TrackPlan::default())?;
/// let mut y = 0.0;
/// for k in 0..200 {
///     let u = if k % 7 < 3 { 1.0 } else { -1.0 };
///     tracker.log_row(y, &[u])?;
///     y = 0.8 * y + 0.5 * u;
/// }
/// assert_eq!(tracker.names(), ["a1", "b1"]);
/// let parameters = tracker.parameters().expect("an estimate");
/// assert!((parameters[0] + 0.8).abs() < 1e-3 && (parameters[1] - 0.5).abs() < 1e-3);
/// // y is the output to come, which the input before it decides.
/// assert!((tracker.forecast(1)? - y).abs() < 1e-2);
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(into = "snapshot::Snapshot", try_from = "snapshot::Snapshot")]
pub struct Tracker {
    pub(super) orders: Orders,
    /// Of how many outputs the past is in the equation; 0: of its own alone, as the orders say.
    pub(super) outputs: usize,
    /// The functions of the lags that the orders are of; none: the lags are the regressor.
    pub(super) map: Option<Map>,
    pub(super) plan: TrackPlan,
    pub(super) names: Vec<String>,
    pub(super) offsets: PerChannel,
    /// Whose offset is the first value to come: the inputs, then the output. Empty if all are known.
    unset: Vec<bool>,
    pub(super) scales: Option<PerChannel>,
    pub(super) stage: Stage,
    /// Whether an exact start is over, or there was none.
    pub(super) has_estimate: bool,
    /// How many innovations are still to come before they count.
    pub(super) settling: usize,
    detector: Option<ChangeDetector<f64>>,
    score: TrackScore,
    /// The latest inputs as the estimator sees them: less their offsets, and after what the outputs in the equation
    /// were a row before.
    pub(super) inputs: Vec<f64>,
    /// The latest of these outputs, less their offsets and with the sign of A.
    pub(super) past: Vec<f64>,
    workspace: Workspace,
}

/// Where a tracker stands.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) enum Stage {
    /// The scales are not known yet.
    Collecting(Collecting),
    Running(Box<Estimator>),
}

/// Buffers for predictions.
#[derive(Debug, Clone, Default)]
struct Workspace {
    lines: Option<DelayLines>,
    inputs: Vec<f64>,
    outputs: Vec<f64>,
}

impl Tracker {
    /// A tracker that knows nothing yet. The orders are those of AR, ARX, ARMA or ARMAX.
    ///
    /// # Errors
    /// [`Error::Argument`] if the orders have D or F, or C with the method `rls`, or the other two methods without C;
    /// if ARMA or ARMAX is to start otherwise than `standard`; if there is not one offset or scale for each channel; if
    /// a factor is not above n/(n + 1) for n parameters (the constant is one of them); if a scale is not in 1e-98 …
    /// 1e98; if another number of the plan is out of its range.
    pub fn new(orders: &Orders, plan: &TrackPlan) -> Result<Self, Error> {
        Self::of(orders, 0, None, plan)
    }

    /// A tracker of one of several outputs, whose equation has the past of all of them: na samples of each. See
    /// [Several outputs](Tracker#several-outputs).
    ///
    /// The numbers of the plan for the inputs are those of the outputs, in their order, then those of the inputs; that
    /// for the output is that of the tracker's own. Parameters are a1_1, a1_2, … of the first output, a2_1, … of the
    /// next, then those of the inputs.
    ///
    /// # Errors
    /// As [`Tracker::new`]; [`Error::Argument`] for fewer than two outputs, and for orders with C.
    ///
    /// ```
    /// use thetahat::model::Orders;
    /// use thetahat::track::{TrackPlan, Tracker, forecasts};
    ///
    /// // Two tanks: a pump fills the first, which runs into the second.
    /// let orders = Orders::arx(1, &[1], &[1])?;
    /// let equation = || Tracker::coupled(&orders, 2, &TrackPlan::default());
    /// let mut tanks = [equation()?, equation()?];
    /// let mut levels = [0.0, 0.0];
    /// for k in 0..300 {
    ///     let u = if k % 7 < 3 { 1.0 } else { -1.0 };
    ///     for (place, tracker) in tanks.iter_mut().enumerate() {
    ///         tracker.log_row_of(place, &levels, &[u])?;
    ///     }
    ///     levels = [0.8 * levels[0] + 0.5 * u, 0.9 * levels[1] + 0.1 * levels[0]];
    /// }
    /// assert_eq!(tanks[1].names(), ["a1_1", "a2_1", "b1"]);
    /// let second = tanks[1].parameters().expect("an estimate");
    /// assert!((second[0] + 0.1).abs() < 1e-3 && (second[1] + 0.9).abs() < 1e-3);
    /// // The levels to come, which the input before them decides.
    /// let ahead = forecasts(&mut tanks, 1)?;
    /// assert!((ahead[0] - levels[0]).abs() < 1e-2 && (ahead[1] - levels[1]).abs() < 1e-2);
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn coupled(orders: &Orders, outputs: usize, plan: &TrackPlan) -> Result<Self, Error> {
        if outputs < 2 {
            return Err(Error::argument("outputs", format!("there are {outputs}; two or more are coupled")));
        }
        if orders.nc > 0 {
            return Err(Error::argument(
                "orders",
                format!("{orders} has C; several outputs are tracked as ARX"),
            ));
        }
        Self::of(orders, outputs, None, plan)
    }

    /// A tracker of a nonlinear ARX model: the parameters of the functions of a map,
    ///
    /// ```text
    /// y(k) = s g(z(k)) + e(k),   g(z) = sum_j theta_j f_j(z)
    /// ```
    ///
    /// where z are lags, na of the output and nb of each input from nk on, as deviations over the scale of their
    /// channel, and s is the scale of the output. Least squares from the prior, on functions instead of lags.
    /// `regressors` name the lags.
    ///
    /// # Errors
    /// As [`Tracker::new`]; [`Error::Argument`] if the map is not of that many lags, if it has more than 1000
    /// functions, and for a constant, which is one of its functions.
    pub fn nonlinear(
        orders: &Orders,
        map: &Map,
        regressors: &[String],
        plan: &TrackPlan,
    ) -> Result<Self, Error> {
        if regressors.len() != orders.parameters() {
            let message = format!("there are {} names for {} lags", regressors.len(), orders.parameters());
            return Err(Error::argument("regressors", message));
        }
        Self::of(orders, 0, Some((map, map.names(regressors))), plan)
    }

    /// The same for linear models, of one output or with this many in the equation, and for functions with their names.
    pub(super) fn of(
        orders: &Orders,
        outputs: usize,
        map: Option<(&Map, Vec<String>)>,
        plan: &TrackPlan,
    ) -> Result<Self, Error> {
        // What the estimator has is checked: `equation` takes orders for what they say.
        let lines = equation(orders, outputs);
        check(orders, &TrackPlan { offsets: None, scales: None, ..plan.clone() })?;
        check(&lines, plan)?;
        let (map, names) = match map {
            Some((map, names)) => {
                check_map(orders, map, &names, plan)?;
                (Some(map), names)
            }
            None => {
                let mut names = names(orders, outputs);
                if plan.constant {
                    names.insert(names.len() - orders.nc, "constant".to_owned());
                }
                (None, names)
            }
        };
        let inputs = lines.inputs();
        let zeros = || PerChannel { inputs: vec![0.0; inputs], output: 0.0 };
        let parameters = names.len();
        // What the scales do not decide is checked at once.
        let units = PerChannel { inputs: vec![1.0; inputs], output: 1.0 };
        let estimator =
            Estimator::new(&lines, map, plan, plan.scales.as_ref().unwrap_or(&units)).map_err(refused)?;
        let stage = match plan.scales {
            Some(_) => Stage::Running(Box::new(estimator)),
            None => Stage::Collecting(Collecting::new(lines.maximum_lag() + 2 * parameters, &lines.nb)),
        };
        Ok(Self {
            orders: orders.clone(),
            outputs,
            map: map.cloned(),
            plan: plan.clone(),
            names,
            offsets: plan.offsets.clone().unwrap_or_else(zeros),
            unset: vec![true; if plan.constant && plan.offsets.is_none() { inputs + 1 } else { 0 }],
            scales: plan.scales.clone(),
            stage,
            has_estimate: plan.start.0 != thetahat_core::RlsStart::Exact,
            settling: 2 * parameters + 20,
            detector: plan.alarm_interval.map(|interval| change_detector(interval, 1)).transpose()?,
            score: TrackScore::default(),
            inputs: vec![f64::NAN; inputs],
            past: vec![f64::NAN; outputs],
            workspace: Workspace::default(),
        })
    }

    /// One row of a log: the output y(k) and the inputs u(k) in the order of the orders, recorded at the same instant,
    /// in their own units. NaN is a missing sample. A finite value that is too large for the arithmetic is taken for
    /// missing, and [`Tracked::too_large`] says so.
    ///
    /// # Errors
    /// After which nothing has changed: [`Error::Argument`] if there is not one value for each input; [`Error::Data`]
    /// if one is infinite.
    pub fn log_row(&mut self, output: f64, inputs: &[f64]) -> Result<Tracked, Error> {
        if self.outputs > 0 {
            let message = format!("there is one value for {} outputs; give those of all", self.outputs);
            return Err(Error::argument("output", message));
        }
        self.log_row_of(0, &[output], inputs)
    }

    /// One row of a log with several outputs, of which this tracker is that of the one in this place, counted from 0.
    /// See [`Tracker::log_row`].
    ///
    /// # Errors
    /// Those of `log_row`; [`Error::Argument`] if the outputs are not those of [`Tracker::coupled`], or there is none
    /// in this place.
    pub fn log_row_of(&mut self, place: usize, outputs: &[f64], inputs: &[f64]) -> Result<Tracked, Error> {
        if inputs.len() != self.orders.inputs() {
            let message = format!("there are {} values for {} inputs", inputs.len(), self.orders.inputs());
            return Err(Error::argument("inputs", message));
        }
        let Some(&output) = outputs.get(place).filter(|_| [0, outputs.len()].contains(&self.outputs)) else {
            let message = format!("there are {} values, and this is output {}", outputs.len(), place + 1);
            return Err(Error::argument("outputs", message));
        };
        // Those that the equation has.
        let coupled = if self.outputs > 0 { outputs } else { &[] };
        if output.is_infinite() {
            return Err(Error::data("the output is infinite; if the sample is missing, leave it empty"));
        }
        for (kind, values) in [("output", coupled), ("input", inputs)] {
            if let Some(at) = values.iter().position(|value| value.is_infinite()) {
                let message = "is infinite; if the sample is missing, leave it empty";
                return Err(Error::data(format!("{kind} {} {message}", at + 1)));
            }
        }
        let limit = match self.stage {
            Stage::Collecting(_) => LARGEST,
            // A little less than what the estimator refuses.
            Stage::Running(_) => (f64::LARGEST_ENTRY / self.names.len() as f64).sqrt() * (1.0 - 1e-12),
        };
        let PerChannel { inputs: input_offsets, output: output_offset } = &mut self.offsets;
        let offsets = input_offsets.iter_mut().chain([output_offset]);
        for ((unset, offset), &value) in
            self.unset.iter_mut().zip(offsets).zip(coupled.iter().chain(inputs).chain([&output]))
        {
            if *unset && value.abs() <= limit {
                (*unset, *offset) = (false, value);
            }
        }
        let mut too_large = false;
        let mut deviation = |value: f64, offset: f64| {
            let deviation = value - offset;
            if deviation.abs() > limit {
                too_large = true;
                return f64::NAN;
            }
            deviation
        };
        let output = deviation(output, self.offsets.output);
        let mut fed = self.inputs.iter_mut().zip(&self.offsets.inputs);
        // The outputs of this row are in the regressor of the next one.
        for ((&value, past), (place, &offset)) in coupled.iter().zip(&mut self.past).zip(fed.by_ref()) {
            *place = std::mem::replace(past, -deviation(value, offset));
        }
        for ((place, &offset), &value) in fed.zip(inputs) {
            *place = deviation(value, offset);
        }
        let mut tracked = match &mut self.stage {
            Stage::Collecting(collecting) => {
                collecting.push(&self.inputs, output);
                if let Some(scales) = collecting.scales() {
                    self.start(scales)?;
                }
                Tracked::collecting()
            }
            Stage::Running(_) => self.step(output)?,
        };
        tracked.too_large = too_large;
        Ok(tracked)
    }

    /// One sample of a tracker that knows its scales; the inputs are in their place.
    fn step(&mut self, output: f64) -> Result<Tracked, Error> {
        let Stage::Running(estimator) = &mut self.stage else { return Ok(Tracked::collecting()) };
        let lines = self.workspace.lines.get_or_insert_with(|| estimator.lines().clone());
        let mut predicted = [f64::NAN];
        estimator.predict(lines, &self.inputs, &mut predicted);
        let [mut predicted] = predicted;
        let innovation = estimator.log_row(output, &self.inputs).map_err(sample_refused)?;
        let Innovation { mut error, mut variance, mut nis, action, .. } = innovation;
        let excitation = estimator.least_squares().excitation();
        if !self.has_estimate {
            // What the prior says of a sample is no prediction.
            (predicted, error, variance, nis) = (f64::NAN, f64::NAN, f64::NAN, 0.0);
            self.has_estimate = corrects(action);
        }
        let mut alarm = None;
        if error.is_finite() && self.settling > 0 {
            self.settling -= 1;
        } else if error.is_finite() {
            self.score.count(&innovation, output);
            alarm = self.detector.as_mut().and_then(|detector| detector.update(&innovation));
        }
        predicted += self.offsets.output;
        Ok(Tracked { predicted, error, variance, nis, action, excitation, alarm, too_large: false })
    }

    /// Goes on from the rows that were collected, with these scales.
    fn start(&mut self, scales: PerChannel) -> Result<(), Error> {
        let Stage::Collecting(collecting) = &self.stage else { return Ok(()) };
        let lines = equation(&self.orders, self.outputs);
        let mut estimator =
            Estimator::new(&lines, self.map.as_ref(), &self.plan, &scales).map_err(refused)?;
        let (rows, gap) = collecting.rows();
        for row in rows {
            if row.after_gap {
                estimator.gap();
            }
            let innovation = estimator.log_row(row.output, &row.inputs).map_err(sample_refused)?;
            self.has_estimate |= corrects(innovation.action);
        }
        if gap {
            estimator.gap();
        }
        self.stage = Stage::Running(Box::new(estimator));
        self.scales = Some(scales);
        Ok(())
    }

    /// Tells that an unknown number of samples is missing here: the delay lines fill anew. What was learnt stays.
    pub fn gap(&mut self) {
        match &mut self.stage {
            Stage::Collecting(collecting) => collecting.gap(),
            Stage::Running(estimator) => estimator.gap(),
        }
        self.inputs.fill(f64::NAN);
        self.past.fill(f64::NAN);
    }

    /// The prediction this many steps ahead: y(k + steps) from the samples up to k, in the output's units. Inputs to
    /// come are held at their latest values.
    ///
    /// NaN if there is none: before there is an estimate, where it depends on a missing sample, or where an unstable
    /// model overflows. 2 n multiply-adds and moves a step. (The memory for it is taken at the first call with this
    /// many steps.)
    ///
    /// # Errors
    /// [`Error::Argument`] if the steps are not in 1 … 10,000; for one of several outputs, which
    /// [`forecasts`](crate::track::forecasts) is for.
    pub fn forecast(&mut self, steps: usize) -> Result<f64, Error> {
        let last = self.predict(None, steps)?.and_then(|predicted| predicted.last()).copied();
        Ok(last.map_or(f64::NAN, |predicted| predicted + self.offsets.output))
    }

    /// The predictions of so many steps less the offset of the output; none before there is an estimate. `future` are
    /// the inputs of these steps, a row each, in their units.
    pub(super) fn predict(&mut self, future: Option<&[f64]>, steps: usize) -> Result<Option<&[f64]>, Error> {
        check_steps(steps)?;
        if self.outputs > 0 {
            let message = "this output depends on the past of the others; forecast all of them";
            return Err(Error::argument("outputs", message));
        }
        let Stage::Running(estimator) = &self.stage else { return Ok(None) };
        if !self.has_estimate {
            return Ok(None);
        }
        let Workspace { lines, inputs, outputs } = &mut self.workspace;
        let lines = lines.get_or_insert_with(|| estimator.lines().clone());
        outputs.resize(steps, f64::NAN);
        inputs.clear();
        match future {
            None => (0..steps).for_each(|_| inputs.extend_from_slice(&self.inputs)),
            Some(future) => {
                let offsets = self.offsets.inputs.iter().cycle();
                inputs.extend(future.iter().zip(offsets).map(|(input, offset)| input - offset));
            }
        }
        estimator.predict(lines, inputs, outputs);
        Ok(Some(outputs))
    }

    /// The names of the parameters, in their order: those of [`Orders::names`], with `constant` after those of B if
    /// there is one; of a nonlinear model its functions.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The estimate, in the order of the names; none before there is one.
    pub fn parameters(&self) -> Option<&[f64]> {
        match &self.stage {
            Stage::Running(estimator) if self.has_estimate => {
                Some(estimator.least_squares().parameters().as_slice())
            }
            _ => None,
        }
    }

    /// Writes the standard errors of the parameters, in the order of the names; NaN where they are not known.
    ///
    /// # Errors
    /// [`Error::Argument`] if there is not one place for each parameter.
    pub fn write_standard_errors(&self, target: &mut [f64]) -> Result<(), Error> {
        if target.len() != self.names.len() {
            let message = format!("there are {} places for {} parameters", target.len(), self.names.len());
            return Err(Error::argument("standard errors", message));
        }
        match &self.stage {
            Stage::Running(estimator) if self.has_estimate => {
                estimator.least_squares().write_standard_errors(target).map_err(refused)
            }
            _ => {
                target.fill(f64::NAN);
                Ok(())
            }
        }
    }

    /// The variance of e, in the output's units squared; none until enough samples are in.
    pub fn noise_variance(&self) -> Option<f64> {
        match &self.stage {
            Stage::Running(estimator) if self.has_estimate => estimator.noise_variance(),
            _ => None,
        }
    }

    /// The figures of the predictions so far.
    pub fn score(&self) -> &TrackScore {
        &self.score
    }

    /// The typical magnitudes of the channels less their offsets: as given, or as found; none while they are not known.
    pub fn scales(&self) -> Option<&PerChannel> {
        self.scales.as_ref()
    }

    /// What is taken from each channel.
    pub fn offsets(&self) -> &PerChannel {
        &self.offsets
    }

    /// Whether its parts fit together, as those of any tracker do that was not edited after it was written.
    pub(super) fn is_sound(&self) -> bool {
        let open = TrackPlan { scales: None, ..self.plan.clone() };
        let map = self.map.as_ref().map(|map| (map, self.names.clone()));
        // More outputs than their past in a row can be are none.
        let Ok(fresh) = Self::of(&self.orders, self.outputs.min(self.past.len()), map, &open) else {
            return false;
        };
        let lines = equation(&fresh.orders, fresh.outputs);
        let inputs = lines.inputs();
        let stage = match (&self.stage, &fresh.stage, &self.scales) {
            (Stage::Running(estimator), _, Some(scales)) => {
                Estimator::new(&lines, self.map.as_ref(), &self.plan, scales)
                    .is_ok_and(|fresh| estimator.fits(&fresh))
            }
            (Stage::Collecting(collecting), Stage::Collecting(other), None) => {
                self.plan.scales.is_none() && collecting.fits(other, inputs)
            }
            _ => false,
        };
        let each = |channels: &PerChannel, holds: fn(f64) -> bool| {
            channels.inputs.len() == inputs
                && channels.inputs.iter().chain([&channels.output]).all(|&value| holds(value))
        };
        let given =
            |asked: &Option<PerChannel>, have: &PerChannel| asked.as_ref().is_none_or(|asked| asked == have);
        let thresholds = |tracker: &Self| {
            tracker.detector.as_ref().map(|detector| Chart::ALL.map(|chart| detector.threshold(chart)))
        };
        stage
            && fresh.names == self.names
            && self.inputs.len() == inputs
            && self.past.len() == self.outputs
            && (self.outputs == 0 || self.map.is_none() && self.orders.nc == 0)
            && each(&self.offsets, f64::is_finite)
            && given(&self.plan.offsets, &self.offsets)
            && self.scales.as_ref().is_none_or(|scales| {
                each(scales, |scale| (SMALLEST..=LARGEST).contains(&scale))
                    && given(&self.plan.scales, scales)
            })
            && (self.unset.is_empty() || self.unset.len() == fresh.unset.len())
            && (self.has_estimate || !fresh.has_estimate)
            && self.settling <= fresh.settling
            && thresholds(self) == thresholds(&fresh)
            && self.score.is_sound()
    }

    /// The orders of the model, without the constant; of a nonlinear one its lags.
    pub fn orders(&self) -> &Orders {
        &self.orders
    }

    /// Of how many outputs the past is in the equation of this one; 0 where it is its own alone.
    pub fn coupled_outputs(&self) -> usize {
        self.outputs
    }

    /// The functions of a nonlinear model; none of a linear one.
    pub fn map(&self) -> Option<&Map> {
        self.map.as_ref()
    }

    /// What is estimated: structure and orders, or functions, such as ARX(2, 2, 1) or NARX polynomial, 6 terms.
    pub fn model(&self) -> String {
        match &self.map {
            None if self.outputs > 0 => format!("{} of {} outputs", self.orders, self.outputs),
            None => self.orders.to_string(),
            Some(map) => map.name(self.names.len()),
        }
    }

    /// The plan that the tracker was made with; after a report with the offsets, scales and noise scale that follow
    /// from it, where they were left open.
    pub fn plan(&self) -> &TrackPlan {
        &self.plan
    }

    /// The charts that watch for changes, if that was asked for.
    pub fn detector(&self) -> Option<&ChangeDetector<f64>> {
        self.detector.as_ref()
    }
}

impl Tracked {
    /// A row that was kept.
    fn collecting() -> Self {
        Self {
            predicted: f64::NAN,
            error: f64::NAN,
            variance: f64::NAN,
            nis: 0.0,
            action: Action::Collecting,
            excitation: 0.0,
            alarm: None,
            too_large: false,
        }
    }
}

/// That a forecast is not farther than it may be.
pub(super) fn check_steps(steps: usize) -> Result<(), Error> {
    if (1..=FARTHEST).contains(&steps) {
        return Ok(());
    }
    Err(Error::argument("horizon", format!("{steps} is not in 1 … {FARTHEST}")))
}

/// Whether the sample corrected an estimate, so that there is one.
fn corrects(action: Action) -> bool {
    matches!(
        action,
        Action::Updated | Action::Capped | Action::Projected | Action::Bounded | Action::Released
    )
}

/// What the estimator does not take as a sample.
fn sample_refused(error: thetahat_core::Error) -> Error {
    Error::data(error.to_string())
}
