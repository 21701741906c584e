//! The extended Kalman filter: the Kalman filter of the linearised model.

use nalgebra::{OMatrix, OVector};

use crate::around::around_kalman_filter;
use crate::error::{check_entries, check_finite, check_length};
use crate::kalman::{is_missing, prediction_error, whiten};
use crate::state_space::transpose;
use crate::triangle::column;
use crate::ud::{self, add_multiple, dot};
use crate::{Action, Covariance, Dimension, Error, Innovation, KalmanFilter, Observation, Real, Transition};

/// The extended Kalman filter.
///
/// It keeps an estimate x̂ of the state and a covariance P = U D U' of its error, as [`KalmanFilter`] does, for
/// models that are not linear:
///
/// ```text
/// predict:   F = ∂f/∂x at x̂, u:          x̂ <- f(x̂, u),       P <- F P F' + Q
/// correct:   H = ∂h/∂x at x̂, u:          e = y - h(x̂, u),    S = H P H' + R,   K = P H' S⁻¹,
///                                         x̂ <- x̂ + K e,       P <- P - K S K'
/// ```
///
/// So the transition is linearised about the filtered estimate, the observation about the predicted one. With a
/// linear model it is the Kalman filter, to the bit. The models are any types that implement [`Transition`] and
/// [`Observation`]; with the feature `autodiff` the Jacobians come by themselves.
///
/// **It is an approximation.** P does not know of the error of the linearisation, so it may promise too much,
/// and a bad start may never be forgotten. That holds above all where unknown parameters are estimated as part of
/// the state (see [`Augmented`](crate::Augmented)): such estimates may be biased or diverge, since K does not see
/// how it depends on the parameters (Ljung, Asymptotic behavior of the extended Kalman filter as a parameter
/// estimator for linear systems, 1979). Start near, give the noises honest covariances, and watch `nis`.
///
/// An angle that is measured jumps by 2π where the innovation must not: add to the measurement the multiple of
/// 2π that brings it nearest to `observation.output(filter.state(), &input)`.
///
/// Units: those of the model. Memory: as [`KalmanFilter`], and a count.
///
/// Source: Jazwinski, Stochastic Processes and Filtering Theory, 1970, sections 8.3 and 8.6; Anderson and Moore,
/// Optimal Filtering, 1979, section 8.2.
///
/// ```
/// use thetahat_core::nalgebra::{Const, Matrix2, SMatrix, SVector, Vector1, Vector2};
/// use thetahat_core::{Covariance, Error, ExtendedKalmanFilter, Observation, Transition};
///
/// /// A pendulum, its angle in rad and its rate in rad/s, seen by the sideways position of its end in m.
/// struct Pendulum;
/// const T: f64 = 0.02;
///
/// impl Transition<f64, Const<2>> for Pendulum {
///     fn next(&self, x: &Vector2<f64>, _: &SVector<f64, 0>) -> Vector2<f64> {
///         Vector2::new(x[0] + T * x[1], x[1] - T * 9.81 * x[0].sin())
///     }
///     fn next_jacobian(&self, x: &Vector2<f64>, _: &SVector<f64, 0>) -> Matrix2<f64> {
///         Matrix2::new(1.0, T, -T * 9.81 * x[0].cos(), 1.0)
///     }
///     fn process_noise(&self, _: &Vector2<f64>, _: &SVector<f64, 0>) -> Covariance<f64, Const<2>> {
///         Covariance::zero(Const)
///     }
/// }
///
/// impl Observation<f64, Const<2>, Const<1>> for Pendulum {
///     fn output(&self, x: &Vector2<f64>, _: &SVector<f64, 0>) -> Vector1<f64> {
///         Vector1::new(x[0].sin())
///     }
///     fn output_jacobian(&self, x: &Vector2<f64>, _: &SVector<f64, 0>) -> SMatrix<f64, 1, 2> {
///         SMatrix::<f64, 1, 2>::new(x[0].cos(), 0.0)
///     }
///     fn measurement_noise(&self, _: &Vector2<f64>, _: &SVector<f64, 0>) -> Covariance<f64, Const<1>> {
///         Covariance::from_diagonal(&Vector1::new(1e-4)).unwrap_or(Covariance::zero(Const))
///     }
/// }
///
/// let none = SVector::zeros(); // no inputs
/// let mut truth = Vector2::new(0.8, 0.0);
/// let prior = Covariance::from_diagonal(&Vector2::new(0.1, 0.1))?;
/// let mut filter = ExtendedKalmanFilter::new(Vector2::new(0.5, 0.3), prior)?;
/// for _ in 0..200 {
///     truth = Pendulum.next(&truth, &none);
///     filter.predict(&Pendulum, &none)?;
///     filter.correct(&Pendulum, &none, &Vector1::new(truth[0].sin()))?;
/// }
/// assert!((filter.state() - truth).amax() < 2e-3);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", into = "snapshot::Snapshot<T, N>"))]
#[cfg_attr(feature = "serde", serde(try_from = "snapshot::Snapshot<T, N>"))]
pub struct ExtendedKalmanFilter<T: Real, N: Dimension> {
    linear: KalmanFilter<T, N>,
    iterations: usize,
}

impl<T: Real, N: Dimension> From<KalmanFilter<T, N>> for ExtendedKalmanFilter<T, N> {
    /// The same filter, for models that need not be linear.
    fn from(linear: KalmanFilter<T, N>) -> Self {
        ExtendedKalmanFilter::around(linear)
    }
}

around_kalman_filter!(ExtendedKalmanFilter);

impl<T: Real, N: Dimension> ExtendedKalmanFilter<T, N> {
    /// A filter that starts from this estimate of the state and the covariance of its error.
    ///
    /// Errors: [`Error::NotFinite`]; [`Error::Length`] (only with `Dyn`).
    pub fn new(state: OVector<T, N>, covariance: Covariance<T, N>) -> Result<Self, Error> {
        Ok(KalmanFilter::new(state, covariance)?.into())
    }

    /// A filter around this one, as a constant for a `static`: see [`KalmanFilter::constant`].
    pub const fn around(linear: KalmanFilter<T, N>) -> Self {
        ExtendedKalmanFilter { linear, iterations: 1 }
    }

    /// The same with a measurement update that is iterated: the iterated extended Kalman filter. It linearises the
    /// observation `count` times at most, each time about its last result. 1 at first, which is no iteration.
    ///
    /// ```text
    /// V(x) = (x - x̂)'P⁻¹(x - x̂) + (y - h(x, u))'R⁻¹(y - h(x, u))
    /// x_0 = x̂;   H_i = ∂h/∂x at x_i:   x = x̂ + K_i (y - h(x_i, u) - H_i (x̂ - x_i)),   x_(i+1) = x_i + t (x - x_i)
    /// ```
    ///
    /// These are Gauss-Newton steps towards the most probable state, the minimum of V. t is the first of 1, 1/2, 1/4 …
    /// that makes V smaller: whole steps may go to and fro, or away, where h bends within the uncertainty of x̂. The
    /// update ends when no step does, or the step is rounding. P is that of the last linearisation.
    ///
    /// Iterations help where the measurement is much more accurate than the prediction and h bends between the two; two
    /// or three are enough then. The innovation that is returned, and the gate, are those of the first.
    ///
    /// Errors: [`Error::OutOfRange`] if `count` is 0.
    ///
    /// Source: Jazwinski 1970, section 8.3; Bell and Cathey, The iterated Kalman filter update as a Gauss-Newton
    /// method, 1993; Skoglund, Hendeby and Axehill, Extended Kalman filter modifications based on an optimization view
    /// point, 2015 (the length of the steps).
    pub fn with_iterations(mut self, count: usize) -> Result<Self, Error> {
        self.set_iterations(count)?;
        Ok(self)
    }

    /// Sets how often a measurement update linearises at most: see
    /// [`with_iterations`](ExtendedKalmanFilter::with_iterations), whose errors it has.
    pub fn set_iterations(&mut self, count: usize) -> Result<(), Error> {
        if count == 0 {
            return Err(Error::OutOfRange { argument: "iterations", range: "1 or more" });
        }
        self.iterations = count;
        Ok(())
    }

    /// The filter around which it is.
    pub(crate) fn linear(&self) -> &KalmanFilter<T, N> {
        &self.linear
    }

    /// The filter around which it is.
    pub(crate) fn linear_mut(&mut self) -> &mut KalmanFilter<T, N> {
        &mut self.linear
    }

    /// How often a measurement update linearises the observation at most.
    pub fn iterations(&self) -> usize {
        self.iterations
    }

    /// The time update: one sample ahead, with the input u(k).
    ///
    /// Errors, after which nothing has changed: [`Error::NotFinite`] if an input, the next state or the
    /// Jacobian is NaN or infinite; [`Error::Overflow`]; [`Error::Length`] (only with `Dyn`). The model's
    /// functions, and about 1.5 n³ multiply-adds; where the quick way would lose digits, n³ more.
    #[inline]
    pub fn predict<U: Dimension>(
        &mut self,
        transition: &impl Transition<T, N, U>,
        input: &OVector<T, U>,
    ) -> Result<(), Error> {
        self.predict_recorded(transition, input).map(|_| ())
    }

    /// The time update; returns F.
    #[inline(always)]
    pub(crate) fn predict_recorded<U: Dimension>(
        &mut self,
        transition: &impl Transition<T, N, U>,
        input: &OVector<T, U>,
    ) -> Result<OMatrix<T, N, N>, Error> {
        check_finite("input", input.as_slice())?;
        let (state, n) = (self.linear.state(), self.linear.state().len());
        let next = transition.next(state, input);
        let state_matrix = transition.next_jacobian(state, input);
        let noise = transition.process_noise(state, input);
        check_entries("next state", next.as_slice(), n)?;
        check_length("transition Jacobian", n, state_matrix.nrows())?;
        check_entries("transition Jacobian", state_matrix.as_slice(), n * n)?;
        noise.check("transition noise", n)?;
        self.linear.propagate(transition, next, &state_matrix, &noise.matrix(), || &noise)?;
        Ok(state_matrix)
    }

    /// The measurement update, with y(k) and u(k).
    ///
    /// A NaN in the measurement is a missing element: it is skipped alone, and the others are used. The
    /// innovation tells what was new.
    ///
    /// Errors, after which nothing has changed: [`Error::Infinite`] if the measurement is;
    /// [`Error::NotFinite`] if an input, a predicted measurement or a Jacobian is NaN or infinite;
    /// [`Error::NoVariance`]; [`Error::TooLarge`] if the measurement makes numbers overflow; [`Error::Length`]
    /// (only with `Dyn`). For each linearisation the model's functions, about m (1.5 n² + 6 n) multiply-adds and
    /// m n divisions.
    #[inline]
    pub fn correct<M: Dimension + Dimension<N>, U: Dimension>(
        &mut self,
        observation: &impl Observation<T, N, M, U>,
        input: &OVector<T, U>,
        measurement: &OVector<T, M>,
    ) -> Result<Innovation<T, OVector<T, M>>, Error>
    where
        N: Dimension<M>,
    {
        self.correct_recorded(observation, input, measurement, |_, _, _, _, _| ())
    }

    /// The measurement update. `record` is told of each element that is used, as in [`KalmanFilter::absorb`],
    /// and, as its first argument, in which iteration: only the last one counts.
    #[inline(always)]
    pub(crate) fn correct_recorded<M: Dimension + Dimension<N>, U: Dimension>(
        &mut self,
        observation: &impl Observation<T, N, M, U>,
        input: &OVector<T, U>,
        measurement: &OVector<T, M>,
        mut record: impl FnMut(usize, &[T], &[T], T, T),
    ) -> Result<Innovation<T, OVector<T, M>>, Error>
    where
        N: Dimension<M>,
    {
        check_finite("input", input.as_slice())?;
        if self.iterations > 1 {
            return self.iterate(observation, input, measurement, record);
        }
        let Linearised { rows, error, noise } =
            Linearised::at(self.linear.state(), observation, input, measurement)?;
        self.linear.absorb(rows, error, &noise, |h, v, s, e| record(0, h, v, s, e))
    }

    /// An iterated measurement update. (Apart from the other, so that this one costs no step that does not iterate.)
    #[cold]
    #[inline(never)]
    fn iterate<M: Dimension + Dimension<N>, U: Dimension>(
        &mut self,
        observation: &impl Observation<T, N, M, U>,
        input: &OVector<T, U>,
        measurement: &OVector<T, M>,
        mut record: impl FnMut(usize, &[T], &[T], T, T),
    ) -> Result<Innovation<T, OVector<T, M>>, Error>
    where
        N: Dimension<M>,
    {
        let (mut state, mut iteration) = (self.linear.state().clone(), 0);
        // The innovation of the first linearisation, and the filter with the gate after it.
        let mut first = None;
        loop {
            let linearised = Linearised::at(&state, observation, input, measurement)?;
            let Linearised { rows, error, noise } = linearised.clone().seen_from(self.linear.state(), &state);
            let mut corrected = self.linear.clone();
            if iteration > 0 {
                corrected.set_gate(T::INFINITY)?;
            }
            let told = corrected.absorb(rows, error, &noise, |h, v, s, e| record(iteration, h, v, s, e))?;
            let (innovation, checked) = first.get_or_insert_with(|| (told, corrected.clone()));
            if !matches!(innovation.action, Action::Updated | Action::Released) {
                self.linear = corrected;
                return Ok(innovation.clone());
            }
            // `corrected` is where the whole step from `state` leads.
            let distance = |state: &OVector<T, N>, error: OVector<T, M>| {
                let measured = squares(error, &linearised.noise, &innovation.variance);
                self.linear.squared_distance(state) + measured
            };
            let before = distance(&state, linearised.error.clone());
            // Rounding of h counts divided by the deviation of the noise.
            let rounding = T::SQRT_EPSILON * (T::one() + before);
            let mut step = corrected.state().clone();
            add_multiple(step.as_mut_slice(), -T::one(), state.as_slice());
            let mut fraction = T::one();
            let found = (0..HALVINGS).find_map(|_| {
                let mut next = state.clone();
                add_multiple(next.as_mut_slice(), fraction, step.as_slice());
                fraction *= nalgebra::convert(0.5);
                let error = prediction_error(measurement, observation.output(&next, input)).ok()?;
                (distance(&next, error) < before + rounding).then_some(next)
            });
            let mut ended = true;
            if let Some(next) = found {
                let mut change = next.as_slice().iter().zip(state.as_slice());
                ended = change.all(|(&next, &x)| (next - x).abs() <= T::EPSILON * x.abs());
                ud::copy(next.as_slice(), state.as_mut_slice());
            }
            iteration += 1;
            if ended || iteration == self.iterations {
                corrected.set_state(state)?;
                self.linear = corrected.with_gate_of(checked);
                return Ok(innovation.clone());
            }
        }
    }
}

/// How often a step of an iterated update is halved: to a thousandth.
const HALVINGS: usize = 10;

/// e'R⁻¹e of the elements that are there, R = V E V'. Where a measurement is exact, rounding beside its innovation
/// variance stands for its noise.
fn squares<T: Real, M: Dimension>(
    mut error: OVector<T, M>,
    noise: &Covariance<T, M>,
    innovation: &OVector<T, M>,
) -> T {
    let m = error.len();
    let missing: OVector<T, M> = error.clone();
    let partial = whiten(&mut [], error.as_mut_slice(), noise);
    let noise = partial.as_ref().unwrap_or(noise);
    let each = error.iter().zip(missing.iter()).zip(innovation.iter()).enumerate();
    each.fold(T::zero(), |sum, (index, ((&error, missing), &innovation))| {
        if is_missing(missing) {
            return sum;
        }
        let variance = ud::variance(noise.as_slice(), m, index).max(T::EPSILON * innovation);
        sum + error * (error / variance)
    })
}

/// An observation at one state.
#[derive(Clone)]
struct Linearised<T: Real, N: Dimension<M>, M: Dimension> {
    /// The rows of H, as columns.
    rows: OMatrix<T, N, M>,
    /// y - h(x, u).
    error: OVector<T, M>,
    /// R.
    noise: Covariance<T, M>,
}

impl<T: Real, N: Dimension + Dimension<M>, M: Dimension + Dimension<N>> Linearised<T, N, M> {
    #[inline(always)]
    fn at<U: Dimension>(
        state: &OVector<T, N>,
        observation: &impl Observation<T, N, M, U>,
        input: &OVector<T, U>,
        measurement: &OVector<T, M>,
    ) -> Result<Self, Error> {
        let error = prediction_error(measurement, observation.output(state, input))?;
        let output_matrix = observation.output_jacobian(state, input);
        let noise = observation.measurement_noise(state, input);
        let (n, m) = (state.len(), error.len());
        check_length("observation Jacobian", m, output_matrix.nrows())?;
        check_entries("observation Jacobian", output_matrix.as_slice(), n * m)?;
        noise.check("observation noise", m)?;
        Ok(Linearised { rows: transpose(&output_matrix), error, noise })
    }

    /// The same about `origin`: y - h(x, u) - H (origin - x).
    fn seen_from(mut self, origin: &OVector<T, N>, state: &OVector<T, N>) -> Self {
        let mut away = origin.clone();
        for (away, &state) in away.as_mut_slice().iter_mut().zip(state.as_slice()) {
            *away -= state;
        }
        for (index, error) in self.error.as_mut_slice().iter_mut().enumerate() {
            *error -= dot(column(self.rows.as_slice(), away.len(), index), away.as_slice());
        }
        self
    }
}

#[cfg(feature = "serde")]
mod snapshot;
#[cfg(test)]
mod tests;
