//! The direct self-tuner: the coefficients of the controller are estimated themselves.

use nalgebra::{Const, OVector};

use super::closed_loop::ClosedLoop;
use super::{Distrust, Fallback, ResponseWanted, TunerSettings, TunerState};
use crate::lags::is_large;
use crate::ud::dot;
use crate::{
    Action, ArxOrders, Dimension, Error, Forgetting, Innovation, InputOrders, Lags, Real,
    RecursiveLeastSquares, RlsStart, RstController,
};

/// How large a [`DirectSelfTuner`] is.
///
/// ```
/// use thetahat_core::DirectOrders;
///
/// // A plant of second order whose input acts on the next sample.
/// const ORDERS: DirectOrders = DirectOrders { na: 2, nb: 2, delay: 1, constant: false };
/// assert_eq!((ORDERS.parameters(), ORDERS.size(), ORDERS.delays()), (4, 2, 2));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DirectOrders {
    /// The order of the plant's A(q).
    pub na: usize,
    /// The coefficients of its B(q) after the delay.
    pub nb: usize,
    /// d, after how many samples the input acts, 1 or more. One too small does not work; where it may vary, take the
    /// largest.
    pub delay: usize,
    /// Whether there is a constant: where signals are not deviations from a working point, and where loads come.
    pub constant: bool,
}

impl DirectOrders {
    /// Coefficients of R, nb + d - 1.
    const fn of_r(&self) -> usize {
        (self.nb + self.delay).saturating_sub(1)
    }

    /// `P` of [`DirectSelfTuner`]: the coefficients of R and S, and the constant.
    pub const fn parameters(&self) -> usize {
        self.of_r() + self.na + self.constant as usize
    }

    /// `N` of [`DirectSelfTuner`].
    pub const fn size(&self) -> usize {
        let of_r = self.of_r().saturating_sub(1);
        let largest = if of_r > self.na { of_r } else { self.na };
        if largest > 1 { largest } else { 1 }
    }

    /// `D` of [`DirectSelfTuner`]: samples on their way.
    pub const fn delays(&self) -> usize {
        2 * self.delay
    }
}

/// A controller whose own coefficients are estimated while it runs, for plants whose inverse is stable and whose delay
/// is known.
///
/// ```text
/// y(k) = R(q) u_f(k-d) + S(q) y_f(k-d) + c + e(k),     A_o A_m u_f = u,   A_o A_m y_f = y
/// R u = A_m(1) A_o (u_c - c) - S y,     then y(k) = A_m(1)/A_m u_c(k-d)
/// ```
///
/// The equation above is the plant's own, multiplied by a polynomial: no design is done in a step. All zeros of the
/// plant are cancelled. Of 100 random plants of second order with stable inverses and the right delay 97 follow the set
/// point; with a delay that is one too small none; with zeros outside of the unit circle 18, by chance (measured).
/// [`IndirectSelfTuner`](crate::IndirectSelfTuner) needs to know neither, and looks at its margins: 98 to 100 of all
/// kinds.
///
/// Two ways to adapt: recursive least squares, or the normalised gradient of model-reference adaptive control
/// ([`with_gradient`](DirectSelfTuner::with_gradient)), which is cheap, bounded without forgetting, and slow.
///
/// `P`, `N` and `D` are [`DirectOrders::parameters`], [`size`](DirectOrders::size) and
/// [`delays`](DirectOrders::delays). Of [`TunerSettings`] all is used; the sign is that of r_0 = b_0.
/// [`Sensor`](crate::Sensor) and [`Probing`](crate::Probing) as there, and [`Supervision`](crate::Supervision): where
/// it is not trusted a fallback acts. The first controller waits until r_0 is known to five standard errors; later ones
/// are taken while r_0 has its sign and not less than a twentieth of its size when it was known best.
///
/// Source: Åström and Wittenmark, Adaptive Control, 2nd ed. 1995, sections 3.5, 4.3 and 5.3 (the gradient).
///
/// ```
/// use thetahat_core::nalgebra::Const;
/// use thetahat_core::{DirectOrders, DirectSelfTuner, Error, Forgetting, ResponseWanted, TunerSettings};
///
/// const ORDERS: DirectOrders = DirectOrders { na: 1, nb: 1, delay: 1, constant: true };
/// const P: usize = ORDERS.parameters();
/// const D: usize = ORDERS.delays();
/// type Tuner = DirectSelfTuner<f32, Const<P>, Const<{ ORDERS.size() }>, Const<D>>;
///
/// let response = ResponseWanted { frequency: 0.3, damping: 0.9, observer: 0.5 };
/// let settings = TunerSettings { gain_sign: 1.0, input: 20.0, ..TunerSettings::new(response, 0.0..=100.0, 10.0) };
/// let mut tuner = Tuner::new(&ORDERS, &settings, 50.0, 10.0, Forgetting::Exponential { factor: 0.99 })?;
/// let (mut temperature, mut power) = (20.0, 20.0);
/// for _ in 0..300 {
///     temperature = 0.95 * temperature + 0.08 * power + 0.5;
///     power = tuner.control(60.0, temperature);
/// }
/// assert!((temperature - 60.0).abs() < 0.5);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", into = "snapshot::Snapshot<T, P, N, D>"))]
#[cfg_attr(feature = "serde", serde(try_from = "snapshot::Snapshot<T, P, N, D>"))]
pub struct DirectSelfTuner<T: Real, P: Dimension + Dimension<Const<1>>, N: Dimension, D: Dimension> {
    lags: Lags<T, P, D>,
    adaptation: Adaptation<T, P>,
    closed: ClosedLoop<T, N>,
    of_r: usize,
    filter: Filter<T>,
    filtered_inputs: [T; 3],
    filtered_outputs: [T; 3],
    output: T,
    /// r_0 when it was known.
    known: T,
}

/// How the coefficients are found.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
enum Adaptation<T: Real, P: Dimension + Dimension<Const<1>>> {
    LeastSquares(RecursiveLeastSquares<T, P>),
    /// θ <- θ + γ W φ ε/(1 + φ'W φ), W the inverse squares of the scales.
    Gradient {
        #[cfg_attr(feature = "serde", serde(with = "crate::snapshot::vector"))]
        parameters: OVector<T, P>,
        #[cfg_attr(feature = "serde", serde(with = "crate::snapshot::vector"))]
        weights: OVector<T, P>,
        gain: T,
    },
}

impl<T: Real, P: Dimension + Dimension<Const<1>>> Adaptation<T, P> {
    fn parameters(&self) -> &[T] {
        match self {
            Adaptation::LeastSquares(estimator) => estimator.parameters().as_slice(),
            Adaptation::Gradient { parameters, .. } => parameters.as_slice(),
        }
    }

    /// Learns from a sample, if it is one that can be. What it told.
    fn learn(&mut self, regressor: &[T], output: T) -> Option<Innovation<T>> {
        match self {
            Adaptation::LeastSquares(estimator) => {
                let told = estimator.take(regressor, output).ok();
                if told.is_none() {
                    estimator.advance();
                }
                told
            }
            Adaptation::Gradient { parameters, weights, gain } => {
                let error = output - dot(regressor, parameters.as_slice());
                let weighted = regressor.iter().zip(weights.as_slice());
                let size =
                    weighted.clone().fold(T::one(), |sum, (value, weight)| sum + *value * *weight * *value);
                let step = *gain * error / size;
                if step.is_finite() && size.is_finite() {
                    for (parameter, (value, weight)) in parameters.as_mut_slice().iter_mut().zip(weighted) {
                        *parameter += step * *weight * *value;
                    }
                }
                None
            }
        }
    }

    /// Whether the first parameter exceeds five of its standard errors, where there are any.
    fn knows_gain(&self) -> Option<bool> {
        match self {
            Adaptation::LeastSquares(estimator) => {
                let (gain, covariance) = (*self.parameters().first()?, estimator.parameter_covariance());
                let variance = covariance.and_then(|found| found.variances().as_slice().first().copied());
                Some(variance.is_some_and(|variance| gain * gain > T::from_count(25) * variance))
            }
            Adaptation::Gradient { .. } => None,
        }
    }
}

impl<T: Real, P: Dimension + Dimension<Const<1>>, N: Dimension, D: Dimension> DirectSelfTuner<T, P, N, D> {
    /// A tuner that knows nothing yet. The scales are the usual sizes of the output and the input.
    ///
    /// Errors: those of [`Lags::new`] and [`RecursiveLeastSquares::new`]; [`Error::Orders`] if `N` is not
    /// [`DirectOrders::size`]; [`Error::OutOfRange`] for a delay of 0, no coefficients, or a setting that is.
    pub fn new(
        orders: &DirectOrders,
        settings: &TunerSettings<T>,
        output_scale: T,
        input_scale: T,
        forgetting: Forgetting<T>,
    ) -> Result<Self, Error> {
        let DirectOrders { na, nb, delay, constant } = *orders;
        for (argument, number) in [("delay", delay), ("na", na), ("nb", nb)] {
            if number == 0 {
                return Err(Error::OutOfRange { argument, range: "1 or more" });
            }
        }
        let (needed, of_r) = (orders.size(), orders.of_r());
        let size = N::exactly(needed).map_err(|available| Error::Orders { needed, available })?;
        let closed = ClosedLoop::new(size, settings, output_scale, delay)?;
        let inputs = [InputOrders { nb: of_r, nk: delay }, InputOrders { nb: na, nk: delay }];
        let lags: Lags<T, P, D> = Lags::new(&ArxOrders { na: 0, inputs: &inputs, constant })?;
        // A signal that stays leaves the filter as large as this.
        let filter = Filter::of(&settings.response);
        let amplification = filter.amplification();
        let scales =
            lags.scales(&[], &[input_scale * amplification, output_scale * amplification], T::NAN)?;
        let estimator = RecursiveLeastSquares::new(&scales, forgetting)?;
        let resting = settings.input * amplification;
        Ok(DirectSelfTuner {
            lags,
            adaptation: Adaptation::LeastSquares(estimator),
            closed,
            of_r,
            filter,
            filtered_inputs: [resting; 3],
            filtered_outputs: [T::zero(); 3],
            output: T::zero(),
            known: T::zero(),
        })
    }

    /// The same with another start of least squares. See [`RlsStart`].
    ///
    /// Errors: none that can occur.
    pub fn with_start(self, start: RlsStart) -> Result<Self, Error> {
        let adaptation = match self.adaptation {
            Adaptation::LeastSquares(estimator) => Adaptation::LeastSquares(estimator.with_start(start)?),
            gradient => gradient,
        };
        Ok(DirectSelfTuner { adaptation, ..self })
    }

    /// The same with the normalised gradient of model-reference adaptation in place of least squares:
    ///
    /// ```text
    /// ε = y - φ'θ,     θ <- θ + γ W φ ε/(1 + φ'W φ),     W_jj = 1/scale_j²
    /// ```
    ///
    /// It has no standard errors: the first controller comes after [`Probing::at_most`](crate::Probing::at_most)
    /// samples.
    ///
    /// Errors: [`Error::OutOfRange`] if γ is not above 0 and below 2.
    pub fn with_gradient(self, gain: T) -> Result<Self, Error> {
        if !(gain > T::zero() && gain < T::one() + T::one()) {
            return Err(Error::OutOfRange { argument: "gain", range: "above 0 and below 2" });
        }
        let adaptation = match self.adaptation {
            Adaptation::LeastSquares(estimator) => {
                // P starts as 100/scale².
                let mut weights = estimator.covariance().variances();
                weights.iter_mut().for_each(|weight| *weight /= T::from_count(100));
                Adaptation::Gradient { parameters: estimator.parameters().clone(), weights, gain }
            }
            Adaptation::Gradient { parameters, weights, .. } => {
                Adaptation::Gradient { parameters, weights, gain }
            }
        };
        Ok(DirectSelfTuner { adaptation, ..self })
    }

    /// The input from now on: time goes on by a sample, the coefficients are corrected by the measurement, and the
    /// controller acts.
    ///
    /// A measurement that is NaN is missing; see [`Sensor`](crate::Sensor). With a set point that is not finite the
    /// input stays as it was.
    pub fn control(&mut self, set_point: T, measurement: T) -> T {
        if self.lags.awaits_inputs() {
            let input = self.filter.push(&mut self.filtered_inputs, self.closed.input);
            let [output, ..] = self.filtered_outputs;
            self.lags.complete(&[input, output]);
        } else if measurement.is_finite() && !self.is_too_large(measurement) {
            // As if it had rested there.
            self.output = measurement;
            self.filtered_outputs = [measurement * self.filter.amplification(); 3];
        }
        self.lags.push(&[], T::NAN);
        let regressor = self.lags.regressor();
        let predicted =
            regressor.map_or(T::NAN, |regressor| dot(regressor.as_slice(), self.adaptation.parameters()));
        // What a regressor cannot hold is missing in it, and would stay in the filter.
        let measurement = if self.is_too_large(measurement) { T::NAN } else { measurement };
        let reading = self.closed.read(measurement, predicted);
        let learns = reading.learns && self.closed.adapting;
        match reading.output.filter(|_| !reading.predicted) {
            Some(output) => {
                let told = regressor
                    .filter(|_| learns)
                    .and_then(|regressor| self.adaptation.learn(regressor.as_slice(), output));
                let innovation = told.unwrap_or(Innovation {
                    error: output - predicted,
                    variance: T::NAN,
                    nis: T::zero(),
                    action: match regressor {
                        None => Action::NotReady,
                        Some(_) if learns => Action::Updated,
                        Some(_) => Action::Frozen,
                    },
                });
                self.closed.supervisor.learnt(innovation, output, reading.learns);
            }
            None => self.closed.supervisor.missed(),
        }
        // Where nothing is known the output is as it was: a hole in this filter would never close.
        self.output = reading.output.unwrap_or(self.output);
        self.filter.push(&mut self.filtered_outputs, self.output);
        self.lags.await_inputs(true);
        let Some(output) = reading.output.filter(|_| set_point.is_finite()) else {
            return self.closed.hold();
        };
        if self.closed.controller.is_none() || learns {
            self.redesign();
        }
        let (adaptation, offset) = (&self.adaptation, self.constant());
        // Without standard errors a design that was accepted is all that is known.
        self.closed
            .act(set_point - offset, offset, &reading, output, || adaptation.knows_gain().unwrap_or(true))
    }

    /// Tells that the actuator did something else than the latest [`control`](DirectSelfTuner::control) asked for. A
    /// number that is not finite, or whose square would overflow in a regressor, is not taken.
    pub fn applied(&mut self, input: T) {
        if !self.is_too_large(input) {
            self.closed.applied(input);
        }
    }

    /// Excites the plant for so many samples: u = α u_c + (1 - α) u_f, where u_f is the controller's and u_c the same
    /// plus or minus the largest amplitude of [`Probing`](crate::Probing).
    ///
    /// Errors: [`Error::OutOfRange`] if α is not from 0 to 1.
    pub fn probe(&mut self, share: T, samples: u32) -> Result<(), Error> {
        self.closed.probe(share, samples)
    }

    /// Turns adaptation off, or on again: the controller stays as it is.
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

    /// The coefficients of R, then those of S, then the constant, as they are estimated.
    pub fn parameters(&self) -> &[T] {
        self.adaptation.parameters()
    }

    /// The controller; `None` until there is one.
    pub fn controller(&self) -> Option<&RstController<T, N>> {
        self.closed.controller.as_ref()
    }

    /// The input that was asked for, or told by [`applied`](DirectSelfTuner::applied).
    pub fn input(&self) -> T {
        self.closed.input
    }

    /// Whether a regressor cannot hold what the filter makes of it.
    fn is_too_large(&self, sample: T) -> bool {
        is_large(sample * self.filter.amplification(), self.lags.size().value())
    }

    /// c, 0 if there is none.
    fn constant(&self) -> T {
        self.lags.constant(self.adaptation.parameters()).unwrap_or(T::zero())
    }

    /// Takes the coefficients as they are, if they are worth it.
    fn redesign(&mut self) {
        let parameters = self.adaptation.parameters();
        let Some((gain, _)) = parameters.split_first() else { return };
        let gain = *gain;
        let knows = || self.adaptation.knows_gain() == Some(true);
        if self.closed.waits(knows) {
            return;
        }
        if !parameters.iter().all(T::is_finite) || gain.is_zero() {
            return self.closed.supervisor.refuse(Distrust::Age, 1);
        }
        // r_0 divides all others. What is not known may not have another sign, nor be far smaller.
        if gain * self.closed.settings.gain_sign < T::zero() {
            let samples = if self.adaptation.knows_gain().unwrap_or(true) { 4 } else { 1 };
            return self.closed.supervisor.refuse(Distrust::Sign, samples);
        }
        if self.known.is_zero() || knows() {
            self.known = gain;
        } else if gain * self.known < T::zero() {
            return self.closed.supervisor.refuse(Distrust::Sign, 1);
        } else if gain.abs() * T::from_count(20) < self.known.abs() {
            return self.closed.supervisor.refuse(Distrust::Age, 1);
        }
        let size = self.closed.size();
        let (mut r, mut s, mut observer) =
            (size.vector(T::zero()), size.vector(T::zero()), size.vector(T::zero()));
        let of_s =
            self.lags.size().value() - self.of_r - usize::from(self.lags.constant(parameters).is_some());
        let coefficients = parameters.iter().map(|value| *value / gain);
        r.iter_mut()
            .zip(coefficients.clone().take(self.of_r).skip(1))
            .for_each(|(entry, value)| *entry = value);
        s.iter_mut().zip(coefficients.skip(self.of_r).take(of_s)).for_each(|(entry, value)| *entry = value);
        let [_, pole] = self.closed.settings.response.observer();
        observer.iter_mut().take(1).for_each(|entry| *entry = pole);
        let response = self.closed.settings.response.response();
        let ahead = response.iter().fold(T::zero(), |sum, value| sum + *value) / gain;
        // Numbers out of range: the last one goes on.
        if RstController::new(ahead, r, s, observer)
            .and_then(|controller| self.closed.install(controller))
            .is_err()
        {
            self.closed.supervisor.refuse(Distrust::Age, 1);
        }
    }
}

/// 1/(A_o A_m).
#[derive(Clone, Debug)]
struct Filter<T> {
    /// Without the leading 1.
    coefficients: [T; 3],
}

impl<T: Real> Filter<T> {
    /// That of a response.
    fn of(response: &ResponseWanted<T>) -> Self {
        let ([_, first, second], [_, pole]) = (response.response(), response.observer());
        Filter { coefficients: [first + pole, second + pole * first, pole * second] }
    }

    /// What it makes of 1 for ever.
    fn amplification(&self) -> T {
        T::one() / self.coefficients.iter().fold(T::one(), |sum, value| sum + *value)
    }

    /// The next sample of a filtered signal, the newest of its latest three first.
    fn push(&self, latest: &mut [T; 3], sample: T) -> T {
        let [first, second, third] = *latest;
        let next = sample - dot(&self.coefficients, &[first, second, third]);
        *latest = [next, first, second];
        next
    }
}

#[cfg(feature = "serde")]
mod snapshot;
