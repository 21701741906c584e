//! The indirect self-tuner: a model is estimated, and a controller designed for it.

use nalgebra::{Const, OVector};

use super::closed_loop::ClosedLoop;
use super::model::{TunerModel, TunerOrders};
use super::{Distrust, Fallback, TunerSettings, TunerState};
#[cfg(doc)]
use super::{Probing, Sensor, Supervision};
#[cfg(doc)]
use crate::RecursiveArmax;
use crate::stability::is_stable;
use crate::{
    Dimension, Error, Forgetting, Innovation, Real, RecursiveArx, RlsStart, RstController, WantedPoles,
};

/// A controller that estimates a model of its plant, and is designed anew for it while it runs.
///
/// ```text
/// A(q) y(k) = B(q) u(k) [+ constant] + C(q) e(k)    estimated in each sample: RecursiveArx with C = 1, or RecursiveArmax
/// A R + B S = A_m A_o,   R u = T u_c - S y          placed for the estimate: RstController
/// ```
///
/// # Noise that is not white
///
/// It biases the model of a [`RecursiveArx`]. [`RecursiveArmax`], the type `M`, estimates it too, with
/// [`PredictionError`](crate::ArmaxMethod::PredictionError), and its C is a factor of A_o = C (1 - p q⁻¹), where p is
/// the [`observer`](super::ResponseWanted::observer) that was wanted. Then C goes out of what the noise does,
///
/// ```text
/// y = R C/(A_m A_o) e = R/(A_m (1 - p q⁻¹)) e,   u = -S C/(A_m A_o) e = -S/(A_m (1 - p q⁻¹)) e
/// ```
///
/// as in the loop of least variance: C is the characteristic polynomial of the stationary Kalman filter of the model,
/// and p is there for loads (Åström and Wittenmark, Computer-Controlled Systems, 3rd ed. 1997, chapter 12; Adaptive
/// Control, 2nd ed. 1995, chapter 4). C is stable, as the estimator keeps it so. Where the loop has no good margins
/// with it, as with a zero of C near to -1, the same response is tried without it.
///
/// With the plant (1 - 1.5 q⁻¹ + 0.7 q⁻²) y = (0.1 q⁻¹ + 0.05 q⁻²) u + (1 - 0.9 q⁻¹) e in a loop of frequency 0.6,
/// damping 0.8 and p = 0.3, after 3000 samples with a set point that stays, a [`RecursiveArx`] has b_1 = 0.34 and a
/// [`RecursiveArmax`] 0.09 with a standard error of 0.02; with the latter the output has three quarters of the
/// variance, and the input a third (measured). It takes more samples to know more parameters, and n² + n numbers more:
/// where the noise is nearly white a [`RecursiveArx`] is better.
///
/// # What keeps it safe
///
/// - A new design is taken only where the largest sensitivities of its loop with the estimate are small, |1/(1 + L)|
///   and |L/(1 + L)| below 2; slower responses are tried in turn, one in each sample. The last good controller goes on
///   until one is found.
/// - A model whose gain has another sign than was given gets no controller. Where none is given, the first controller
///   waits until the static gain is known to five standard errors (or for [`Probing::at_most`] samples), and the sign
///   is not changed by less either.
/// - [`Forgetting`] keeps P bounded, in silence too. See below which is best.
/// - The input stays within its limits, and no controller winds up there.
/// - What a failed sensor does is [`Sensor`]'s subject.
/// - Where all that does not help it says so, and something else acts: [`Supervision`].
///
/// # When it is not trusted
///
/// The state is [`TunerState::Distrusted`], with its reason, where designs were refused for long, the input goes from
/// limit to limit while the set point stays, or the model predicts worse than the latest measurement does. Then the
/// [`Fallback`] acts (the last controller, where it is only old), with a small excitation, and the model goes on
/// learning; the tuner controls again by itself where that has made the model good again. In a loop with a gain of 1.5,
/// which was said to be positive, and which becomes negative, the input is at its limit for 45 to 130 samples, and then
/// about where it was; after the plant is as before again it takes 200 to 1200 samples of excitation with a tenth of
/// the usual input until that is known (measured). A dead time of twelve samples that the model does not know is told
/// after about 170 samples. Of three times a hundred random plants that the model fits none was distrusted in 4900
/// samples each.
///
/// # Which forgetting
///
/// Of 100 random plants of second order with up to three samples of dead time: how many settle with a square wave as
/// set point; how many are more than 0.5 from a set point of 1 that is then held for 6000 samples; how many exceed 4
/// when the gain doubles with a square wave after it; how many have settled 300 samples later; and the median of the
/// largest outputs in that time. (Printed by `cargo test -p thetahat-core tuners_forget -- --nocapture`.)
///
/// | policy | settled | while held | above 4 | back | largest |
/// |---|---|---|---|---|---|
/// | exponential, 0.98 | 96 | 0 | 6 | 98 | 1.33 |
/// | exponential, 0.99 | 96 | 0 | 8 | 98 | 1.30 |
/// | selective, 0.98 | 96 | 0 | 9 | 97 | 1.32 |
/// | selective, 0.99 | 96 | 0 | 9 | 98 | 1.33 |
/// | random walk, 1e-4 | 97 | 0 | 5 | 98 | 1.28 |
///
/// They differ little. [`Forgetting::RandomWalk`] with a variance of 1e-4 is recommended where the scales are right
/// within a factor of a few, and exponential forgetting with a factor of 0.98 where they are not known.
///
/// # What it does not do
///
/// The margins are those with the model. Where the plant is of a higher order than the model, and a disturbance or the
/// set point excites what the model leaves out, the estimate can be far off, and the loop bursts until the model is
/// right again. The plant of Rohrs, Valavani, Athans and Stein (1985), 2/(s + 1) 229/(s² + 30 s + 229) sampled every
/// 0.04 s, with a sine of 16.1 rad/s and amplitude 0.5 on its output and a set point of 2: with a model of first order
/// the output goes up to 4.2, with one of third order to 2.2 (measured). With the sign of the gain given, the model of
/// first order gets the other one, and is not trusted after 320 samples; without it bursts may pass unseen. More
/// coefficients, slower sampling, a filter before the sampler and a slower wish help; the limits are what holds it in
/// the end.
///
/// # Time
///
/// [`control`](IndirectSelfTuner::control) is called once a sample. Where the actuator did something else than it was
/// asked for, [`applied`](IndirectSelfTuner::applied) says so before the next sample.
///
/// # Size and cost
///
/// `P` is [`TunerOrders::parameters`], `N` [`TunerOrders::size`]. Memory: that of the model and
/// [`RstController`], 8 N + P + 75 numbers. A step costs what the model's does, and up to three designs of about
/// 10 N³ + 560 N flops: the one in use, and one that is tried.
///
/// Source: Åström and Wittenmark, Adaptive Control, 2nd ed. 1995, section 3.4 and chapter 11 (the practice).
///
/// ```
/// use thetahat_core::nalgebra::Const;
/// use thetahat_core::{
///     Error, Forgetting, IndirectSelfTuner, ResponseWanted, TunerOrders, TunerSettings, TunerState,
/// };
///
/// const ORDERS: TunerOrders = TunerOrders { na: 1, nb: 2, nc: 0, constant: true, integrator: true };
/// type Tuner = IndirectSelfTuner<f32, Const<{ ORDERS.parameters() }>, Const<{ ORDERS.size() }>>;
///
/// // Nothing is known of the oven, but that more power makes it warmer. Temperatures are about 50, power 0 to 100.
/// let response = ResponseWanted { frequency: 0.3, damping: 0.9, observer: 0.5 };
/// let settings = TunerSettings { gain_sign: 1.0, input: 20.0, ..TunerSettings::new(response, 0.0..=100.0, 10.0) };
/// let mut tuner = Tuner::new(&ORDERS, &settings, 50.0, 10.0, Forgetting::Exponential { factor: 0.99 })?;
/// let (mut temperature, mut power) = (20.0, 20.0);
/// for _ in 0..300 {
///     temperature = 0.95 * temperature + 0.08 * power + 0.5;
///     power = tuner.control(60.0, temperature);
/// }
/// assert_eq!(tuner.state(), TunerState::Controlling);
/// assert!((temperature - 60.0).abs() < 0.1);
/// # Ok::<(), Error>(())
/// ```
///
/// The same with noise that is not white:
///
/// ```
/// # use thetahat_core::nalgebra::Const;
/// # use thetahat_core::{
/// #     Error, Forgetting, IndirectSelfTuner, RecursiveArmax, ResponseWanted, TunerOrders, TunerSettings, TunerState,
/// # };
/// const ORDERS: TunerOrders = TunerOrders { na: 1, nb: 2, nc: 1, constant: true, integrator: true };
/// type Plant = RecursiveArmax<f32, Const<{ ORDERS.parameters() }>>;
/// type Tuner = IndirectSelfTuner<f32, Const<{ ORDERS.parameters() }>, Const<{ ORDERS.size() }>, Plant>;
/// # let response = ResponseWanted { frequency: 0.3, damping: 0.9, observer: 0.5 };
/// # let settings = TunerSettings { gain_sign: 1.0, input: 20.0, ..TunerSettings::new(response, 0.0..=100.0, 10.0) };
/// # let mut tuner = Tuner::new(&ORDERS, &settings, 50.0, 10.0, Forgetting::Exponential { factor: 0.99 })?;
/// # let (mut temperature, mut power) = (20.0, 20.0);
/// # for _ in 0..300 {
/// #     temperature = 0.95 * temperature + 0.08 * power + 0.5;
/// #     power = tuner.control(60.0, temperature);
/// # }
/// # assert_eq!(tuner.state(), TunerState::Controlling);
/// # assert!((temperature - 60.0).abs() < 0.1);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound = "M: TunerModel<T, P> + serde::Serialize + serde::de::DeserializeOwned")
)]
#[cfg_attr(feature = "serde", serde(into = "snapshot::Snapshot<T, N, M>"))]
#[cfg_attr(feature = "serde", serde(try_from = "snapshot::Snapshot<T, N, M>"))]
pub struct IndirectSelfTuner<
    T: Real,
    P: Dimension + Dimension<Const<1>>,
    N: Dimension,
    M = RecursiveArx<T, P>,
> {
    plant: M,
    /// How many it estimates.
    parameters: P,
    closed: ClosedLoop<T, N>,
    integrator: bool,
    cancel_zeros: bool,
    design_every: u16,
    peaks: (T, T),
    /// Which of the candidates the controller is.
    candidate: usize,
    since_design: u16,
    since_all: u16,
    trial: Option<Trial<T>>,
    /// The sign of the latest static gain that was known to five standard errors; 0 if none was.
    known_sign: T,
}

/// A search of the candidates, one in each sample: which is next, and the least peaks so far.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "T: Real"))]
struct Trial<T> {
    next: usize,
    #[cfg_attr(feature = "serde", serde(with = "crate::snapshot::number"))]
    least: T,
    least_at: usize,
}

/// A, B and C of the model, from the power 0 on.
struct Model<'a, T> {
    a: &'a [T],
    b: &'a [T],
    c: &'a [T],
}

/// The number of frequencies at which margins are evaluated.
const FREQUENCIES: usize = 28;
/// The candidates are tried again after so many designs of the same one.
const TRY_ALL_AFTER: u16 = 25;

impl<T: Real, P: Dimension + Dimension<Const<1>>, N: Dimension, M: TunerModel<T, P>>
    IndirectSelfTuner<T, P, N, M>
{
    /// A tuner that knows nothing yet. The scales are the usual sizes of the output and the input, as of
    /// [`RecursiveArx::new`]. The noise scale of a [`RecursiveArmax`] is a tenth of that of the output.
    ///
    /// Errors: those of [`RecursiveArx::new`]; [`Error::Orders`] if `N` is not [`TunerOrders::size`];
    /// [`Error::OutOfRange`] for a setting that is, and for an nc above 0 with a [`RecursiveArx`].
    pub fn new(
        orders: &TunerOrders,
        settings: &TunerSettings<T>,
        output_scale: T,
        input_scale: T,
        forgetting: Forgetting<T>,
    ) -> Result<Self, Error> {
        if orders.nb == 0 {
            return Err(Error::OutOfRange { argument: "nb", range: "1 or more" });
        }
        let needed = orders.size();
        let size = N::exactly(needed).map_err(|available| Error::Orders { needed, available })?;
        let plant = M::new(orders, [output_scale, input_scale], forgetting)?;
        let two = T::one() + T::one();
        Ok(IndirectSelfTuner {
            parameters: plant.estimator().covariance().size(),
            plant,
            closed: ClosedLoop::new(size, settings, output_scale, 1)?,
            integrator: orders.integrator,
            cancel_zeros: false,
            design_every: 1,
            peaks: (two, two + T::one()),
            candidate: 0,
            since_design: 0,
            since_all: 0,
            trial: None,
            known_sign: T::zero(),
        })
    }

    /// The same with the zeros of the plant cancelled: only where they are known to be well inside the unit circle.
    pub fn with_cancelled_zeros(self) -> Self {
        IndirectSelfTuner { cancel_zeros: true, ..self }
    }

    /// The same with a design every so many samples, in place of each.
    ///
    /// Errors: [`Error::OutOfRange`] for 0.
    pub fn with_design_every(self, samples: u16) -> Result<Self, Error> {
        if samples == 0 {
            return Err(Error::OutOfRange { argument: "samples", range: "1 or more" });
        }
        Ok(IndirectSelfTuner { design_every: samples, ..self })
    }

    /// The same with other limits of the larger one of the [`peaks`](RstController::peaks) of a design, 2 and 3 at
    /// first: below the first it is taken at once, and if there is none the one with the least peaks is, below the
    /// second.
    ///
    /// Errors: [`Error::OutOfRange`] if they are not 1 or more and in order.
    pub fn with_peaks(self, good: T, bearable: T) -> Result<Self, Error> {
        if !(good >= T::one() && bearable >= good) {
            return Err(Error::OutOfRange { argument: "peaks", range: "1 or more, and in order" });
        }
        Ok(IndirectSelfTuner { peaks: (good, bearable), ..self })
    }

    /// The same with another start of the estimator. See [`RlsStart`].
    ///
    /// Errors: those of [`RecursiveArmax::with_start`].
    pub fn with_start(self, start: RlsStart) -> Result<Self, Error> {
        Ok(IndirectSelfTuner { plant: self.plant.with_start(start)?, ..self })
    }

    /// The same with a model to start from, such as one that was fitted to a log: `plant` with the orders of this
    /// tuner. The first controller is designed for it.
    ///
    /// Errors: [`Error::OutOfRange`] if it has other orders.
    pub fn with_plant(self, plant: M) -> Result<Self, Error> {
        if plant.orders(self.integrator) != self.plant.orders(self.integrator) {
            return Err(Error::OutOfRange { argument: "plant", range: "a model of the orders of the tuner" });
        }
        let mut tuner = IndirectSelfTuner { plant, ..self };
        tuner.closed.skip_probing();
        Ok(tuner)
    }

    /// The input from now on: time goes on by a sample, the model learns from the measurement, the controller is
    /// designed anew, and acts.
    ///
    /// A measurement that is NaN is missing; see [`Sensor`]. With a set point that is not finite the input stays as it
    /// was.
    pub fn control(&mut self, set_point: T, measurement: T) -> T {
        let predicted = self.advance();
        let reading = self.closed.read(measurement, predicted);
        self.plant.set_adaptation(reading.learns && self.closed.adapting);
        // What a regressor cannot hold is missing in it.
        let taken = reading.output.and_then(|output| Some((output, self.plant.measured(output).ok()?)));
        match taken {
            Some((output, innovation)) if !reading.predicted => {
                self.closed.supervisor.learnt(innovation, output, reading.learns);
            }
            Some(_) => self.closed.supervisor.missed(),
            None => {
                self.closed.supervisor.missed();
                // Cannot fail.
                let _ = self.plant.measured(T::NAN);
            }
        }
        let Some((output, _)) = taken.filter(|_| set_point.is_finite()) else { return self.closed.hold() };
        if self.closed.controller.is_none() || (reading.learns && self.closed.adapting) {
            self.redesign();
        }
        let plant = &self.plant;
        self.closed.act(set_point, T::zero(), &reading, output, || knows_gain(plant))
    }

    /// Tells that the actuator did something else than the latest [`control`](IndirectSelfTuner::control) asked for. A
    /// number that is not finite is not taken.
    pub fn applied(&mut self, input: T) {
        self.closed.applied(input);
    }

    /// Excites the plant for so many samples: u = α u_c + (1 - α) u_f, where u_f is the controller's and u_c the same
    /// plus or minus the largest amplitude of [`Probing`].
    ///
    /// Errors: [`Error::OutOfRange`] if α is not from 0 to 1.
    pub fn probe(&mut self, share: T, samples: u32) -> Result<(), Error> {
        self.closed.probe(share, samples)
    }

    /// Turns adaptation off, or on again: the model and the controller stay as they are.
    pub fn set_adaptation(&mut self, on: bool) {
        self.closed.adapting = on;
    }

    /// What it did in the latest sample.
    pub fn state(&self) -> TunerState {
        self.closed.state
    }

    /// Says that the gain has this sign from now on, or 0 that it is not known.
    ///
    /// Errors: [`Error::OutOfRange`] if it is not finite.
    pub fn set_gain_sign(&mut self, sign: T) -> Result<(), Error> {
        self.closed.set_gain_sign(sign)
    }

    /// What acts from now on while the tuner is not trusted.
    ///
    /// Errors: [`Error::OutOfRange`] if it is an input that is not finite.
    pub fn set_fallback(&mut self, fallback: Fallback<T>) -> Result<(), Error> {
        self.closed.set_fallback(fallback)
    }

    /// Trusts the tuner from now on: the controller acts, or the plant is excited until there is one. What
    /// [`Supervision`](crate::Supervision) looks at begins anew.
    pub fn trust(&mut self) {
        self.closed.trust();
    }

    /// Why it is not trusted; `None` if it is.
    pub fn distrust(&self) -> Option<Distrust> {
        self.closed.supervisor.distrust
    }

    /// What the latest measurement told the model.
    pub fn innovation(&self) -> Innovation<T> {
        self.closed.supervisor.innovation()
    }

    /// The samples since the latest design that was accepted, or since the start: 0 if that was in the latest sample.
    pub fn design_age(&self) -> u32 {
        self.closed.supervisor.age()
    }

    /// The model.
    pub fn plant(&self) -> &M {
        &self.plant
    }

    /// The controller; `None` until there is one.
    pub fn controller(&self) -> Option<&RstController<T, N>> {
        self.closed.controller.as_ref()
    }

    /// The input that was asked for, or told by [`applied`](IndirectSelfTuner::applied).
    pub fn input(&self) -> T {
        self.closed.input
    }

    /// The input that acted goes into the model; what the next measurement should be.
    fn advance(&mut self) -> T {
        let mut predicted = [T::NAN];
        // Not before the first sample; and where the model overflows nothing is predicted.
        if self.plant.lags().awaits_inputs() {
            let told = self.plant.applied(self.closed.input);
            if told.and_then(|()| self.plant.predict(T::zero(), &mut predicted)).is_err() {
                return T::NAN;
            }
        }
        let [predicted] = predicted;
        predicted
    }

    /// Designs a controller for the model as it is, if it is time and the model is worth one.
    fn redesign(&mut self) {
        self.since_design = self.since_design.saturating_add(1);
        if self.closed.controller.is_some() && self.since_design < self.design_every {
            return;
        }
        self.since_design = 0;
        if self.closed.waits(|| knows_gain(&self.plant)) {
            return;
        }
        let cause = self.design_anew();
        if self.design_age() > 0 {
            // A sign that is wrong beyond doubt counts four times.
            let is_sure = cause == Distrust::Sign && knows_gain(&self.plant);
            let samples = if is_sure { self.design_every.saturating_mul(4) } else { self.design_every };
            self.closed.supervisor.refuse(cause, samples);
        }
    }

    /// Designs a controller, or says why there is none.
    fn design_anew(&mut self) -> Distrust {
        let Some(polynomials) = self.polynomials() else { return Distrust::Age };
        let [(a, na), (b, nb), (c, nc)] = &polynomials;
        let model = Model {
            a: a.as_slice().get(..*na).unwrap_or_default(),
            b: b.as_slice().get(..*nb).unwrap_or_default(),
            c: c.as_slice().get(..*nc).unwrap_or_default(),
        };
        if !self.has_its_sign(model.b) {
            return Distrust::Sign;
        }
        let is_good = self.renew(&model);
        let was_margin = self.closed.supervisor.cause() == Distrust::Margin;
        if self.search(&model, is_good) || was_margin { Distrust::Margin } else { Distrust::Age }
    }

    /// Whether the static gain has the sign that was given; where none is, that of a gain that was known.
    fn has_its_sign(&mut self, b: &[T]) -> bool {
        let gain = b.iter().fold(T::zero(), |sum, value| sum + *value);
        let given = self.closed.settings.gain_sign;
        if !given.is_zero() {
            return gain * given >= T::zero();
        }
        if gain * self.known_sign > T::zero() {
            return true;
        }
        if knows_gain(&self.plant) {
            self.known_sign = if gain > T::zero() { T::one() } else { -T::one() };
            return true;
        }
        self.known_sign.is_zero()
    }

    /// The candidate in use, for the model as it is now. Whether its margins are good, and it was taken.
    fn renew(&mut self, model: &Model<'_, T>) -> bool {
        if self.closed.controller.is_none() {
            return false;
        }
        let renewed = self.design(model, self.candidate).filter(|(_, peaks)| *peaks <= self.peaks.0);
        let is_good = renewed.is_some();
        if let Some((controller, _)) = renewed {
            self.take(controller, self.candidate);
        }
        is_good
    }

    /// Tries the next candidate: where the one in use is not good, and time and again whether a faster one is.
    /// Whether all were tried, and none was bearable.
    fn search(&mut self, model: &Model<'_, T>, is_good: bool) -> bool {
        self.since_all = self.since_all.saturating_add(1);
        if self.trial.is_none() && (!is_good || self.since_all >= TRY_ALL_AFTER) {
            (self.trial, self.since_all) = (Some(Trial { next: 0, least: T::INFINITY, least_at: 0 }), 0);
        }
        let Some(trial) = self.trial.take() else { return false };
        if is_good && trial.next == self.candidate {
            return false;
        }
        if self.closed.settings.response.candidate(trial.next, model.a, model.c).is_none() {
            // All were tried, and none is good: the least bad one, if it is bearable still.
            let least = if trial.least <= self.peaks.1 { self.design(model, trial.least_at) } else { None };
            let bearable = least.filter(|(_, peaks)| *peaks <= self.peaks.1);
            let is_none = bearable.is_none();
            if let Some((controller, _)) = bearable {
                self.take(controller, trial.least_at);
            }
            return is_none;
        }
        let tried = self.design(model, trial.next);
        let peaks = tried.as_ref().map_or(T::INFINITY, |(_, peaks)| *peaks);
        match tried.filter(|_| peaks <= self.peaks.0) {
            Some((controller, _)) => self.take(controller, trial.next),
            None => {
                let better = peaks < trial.least;
                let (least, least_at) =
                    if better { (peaks, trial.next) } else { (trial.least, trial.least_at) };
                self.trial = Some(Trial { next: trial.next + 1, least, least_at });
            }
        }
        false
    }

    fn take(&mut self, controller: RstController<T, N>, candidate: usize) {
        // Cannot fail: the limits were checked.
        if self.closed.install(controller).is_ok() {
            self.candidate = candidate;
        }
    }

    /// The controller of a candidate for a model, and the larger one of its peaks.
    fn design(&self, model: &Model<'_, T>, candidate: usize) -> Option<(RstController<T, N>, T)> {
        let Model { a, b, c } = *model;
        let candidate = self.closed.settings.response.candidate(candidate, a, c)?;
        let mut rest = self.parameters.vector(T::zero());
        if candidate.own.is_some() {
            rest.iter_mut().zip(a.iter().skip(1)).for_each(|(entry, value)| *entry = *value);
            if !is_stable(rest.as_mut_slice()) {
                return None;
            }
        }
        let poles = WantedPoles {
            response: candidate.response(),
            observer: candidate.observer(rest.as_mut_slice()),
            integrator: self.integrator,
            cancel_zeros: self.cancel_zeros,
        };
        let controller = RstController::pole_placement_with(a, b, &poles, |_| Ok(self.closed.size())).ok()?;
        let (sensitivity, complementary) = controller.peaks(a, b, FREQUENCIES);
        let largest = sensitivity.max(complementary);
        largest.is_finite().then_some((controller, largest))
    }

    /// A, B and C of the model, filled up with zeros, and how long they are, where they are finite.
    fn polynomials(&self) -> Option<[(OVector<T, P>, usize); 3]> {
        let (a, b, c) = (self.plant.a(), self.plant.b(0)?, self.plant.c());
        let found = [filled(self.parameters, a), filled(self.parameters, b), filled(self.parameters, c)];
        found.iter().all(|(whole, _)| whole.iter().all(T::is_finite)).then_some(found)
    }
}

/// Whether |B(1)| exceeds five of its standard errors.
fn knows_gain<T: Real, P: Dimension + Dimension<Const<1>>, M: TunerModel<T, P>>(plant: &M) -> bool {
    let estimator = plant.estimator();
    let Some(covariance) = estimator.parameter_covariance() else { return false };
    let Some(coefficients) = plant.b(0) else { return false };
    let first = plant.a().count().saturating_sub(1);
    let count = coefficients.clone().count().saturating_sub(1);
    let gain = coefficients.fold(T::zero(), |sum, value| sum + value);
    let size = covariance.size().value();
    let matrix = covariance.matrix();
    let mut variance = T::zero();
    for column in first..first + count {
        let column = matrix.as_slice().iter().skip(column * size + first).take(count);
        variance = column.fold(variance, |sum, value| sum + *value);
    }
    gain * gain > T::from_count(25) * variance
}

/// Coefficients, filled up with zeros, and how many there are.
fn filled<T: Real, P: Dimension>(
    size: P,
    coefficients: impl Iterator<Item = T> + Clone,
) -> (OVector<T, P>, usize) {
    let mut whole = size.vector(T::zero());
    whole.iter_mut().zip(coefficients.clone()).for_each(|(entry, value)| *entry = value);
    (whole, coefficients.count())
}

#[cfg(feature = "serde")]
mod snapshot;
