//! Gains of the Kalman filter, computed before there are data.

use nalgebra::{OMatrix, OVector};

use crate::error::check_length;
use crate::state_space::add_product;
use crate::triangle::{column, column_mut};
use crate::{Covariance, Dimension, Error, KalmanFilter, LinearObservation, LinearTransition, Real, ud};

/// The gains of a Kalman filter, computed ahead: where the model is known, they do not depend on the data.
///
/// ```text
/// predict:   P <- F P F' + Q
/// correct:   K = P H' (H P H' + R)⁻¹,     P <- P - K H P,     for use as x̂ <- x̂ + K (y - H x̂ - D u)
/// ```
///
/// It is stepped as [`KalmanFilter`] is, with the same models and the same arithmetic, and without a measurement.
/// So the models may vary in time, and sensors may differ. [`steady_state`](GainSchedule::steady_state) goes on to
/// where nothing changes any more.
///
/// Units: K_ij has the unit of state i over that of output j. Memory: as [`KalmanFilter`].
///
/// Source: Anderson and Moore, Optimal Filtering, 1979, sections 3.1 and 4.4.
///
/// ```
/// use thetahat_core::nalgebra::{Const, Vector1};
/// use thetahat_core::{Covariance, Error, GainSchedule, LinearObservation, LinearTransition};
///
/// // A constant, measured again and again with the same variance: the gains are those of a mean.
/// let constant = LinearTransition::new(Vector1::new(1.0), Covariance::zero(Const::<1>))?;
/// let noise: Covariance<f64, Const<1>> = Covariance::from_diagonal(&Vector1::new(3.0))?;
/// let sensor = LinearObservation::new(Vector1::new(1.0), noise)?;
/// let mut schedule = GainSchedule::new(Covariance::from_diagonal(&Vector1::new(1e9))?);
/// for k in 1..10 {
///     schedule.predict(&constant)?;
///     let gain = schedule.correct(&sensor)?;
///     assert!((gain[0] - 1.0 / f64::from(k)).abs() < 1e-8);
/// }
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", into = "snapshot::Snapshot<T, N>"))]
#[cfg_attr(feature = "serde", serde(try_from = "snapshot::Snapshot<T, N>"))]
pub struct GainSchedule<T: Real, N: Dimension> {
    /// Its state stays 0.
    filter: KalmanFilter<T, N>,
}

/// What a Kalman filter comes to when its model does not change in time.
///
/// ```
/// use thetahat_core::nalgebra::{Const, Matrix1, Vector1};
/// use thetahat_core::{Covariance, Error, GainSchedule, LinearObservation, LinearTransition};
///
/// // A level that walks with variance 1/2 a sample, measured with variance 1.
/// let variance = |value: f64| Covariance::<f64, Const<1>>::from_diagonal(&Vector1::new(value));
/// let walk = LinearTransition::new(Matrix1::new(1.0), variance(0.5)?)?;
/// let gauge = LinearObservation::new(Matrix1::new(1.0), variance(1.0)?)?;
/// let steady = GainSchedule::new(variance(1.0)?).steady_state(&walk, &gauge, 100)?;
/// // P before a measurement solves P² - P/2 - 1/2 = 0.
/// assert!((steady.predicted.variances()[0] - 1.0).abs() < 1e-12);
/// assert!((steady.filtered.variances()[0] - 0.5).abs() < 1e-12);
/// assert!((steady.gain[0] - 0.5).abs() < 1e-12);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct SteadyState<T: Real, N: Dimension + Dimension<M>, M: Dimension> {
    /// P before a measurement.
    pub predicted: Covariance<T, N>,
    /// P after it.
    pub filtered: Covariance<T, N>,
    /// K, n x m: x̂ <- x̂ + K (y - H x̂ - D u).
    pub gain: OMatrix<T, N, M>,
    /// F K, n x m: x̂(k+1) = F x̂(k) + G u(k) + F K (y(k) - H x̂(k) - D u(k)), in predictor form, as the
    /// [`LuenbergerObserver`](crate::LuenbergerObserver) has it.
    pub predictor_gain: OMatrix<T, N, M>,
    /// How many samples it took.
    pub steps: usize,
}

impl<T: Real, N: Dimension> GainSchedule<T, N> {
    /// A schedule that starts from this covariance of the state.
    pub fn new(covariance: Covariance<T, N>) -> Self {
        let state = covariance.size().vector(T::zero());
        GainSchedule { filter: KalmanFilter::started(state, covariance) }
    }

    /// P now.
    pub fn covariance(&self) -> &Covariance<T, N> {
        self.filter.covariance()
    }

    /// The time update.
    ///
    /// Errors, after which nothing has changed, and cost: as of [`KalmanFilter::predict`].
    pub fn predict<U: Dimension>(&mut self, transition: &LinearTransition<T, N, U>) -> Result<(), Error>
    where
        N: Dimension<U>,
    {
        let state = self.filter.state().clone();
        check_length("transition", state.len(), transition.state_matrix().ncols())?;
        let (noise_matrix, noise) = (transition.noise_matrix(), transition.noise());
        self.filter.propagate(transition, state, transition.state_matrix(), noise_matrix, || noise)
    }

    /// The measurement update: K, n x m.
    ///
    /// Errors, after which nothing has changed: as of [`KalmanFilter::correct`]. m times its cost, and n² m.
    pub fn correct<M: Dimension + Dimension<U> + Dimension<N>, U: Dimension>(
        &mut self,
        observation: &LinearObservation<T, N, M, U>,
    ) -> Result<OMatrix<T, N, M>, Error>
    where
        N: Dimension<M>,
    {
        let noise = observation.noise();
        let (n, m) = (self.filter.state().len(), noise.size());
        let mut gain = self.covariance().size().rows_by(m, T::zero());
        let mut corrected = self.clone();
        for index in 0..m.value() {
            let mut unit = m.vector(T::zero());
            if let Some(error) = unit.as_mut_slice().get_mut(index) {
                *error = T::one();
            }
            corrected.clone_from(self);
            corrected.absorb(observation, unit)?;
            ud::copy(corrected.filter.state().as_slice(), column_mut(gain.as_mut_slice(), n, index));
        }
        let state = self.filter.state().clone();
        self.filter = KalmanFilter::started(state, corrected.filter.covariance().clone());
        Ok(gain)
    }

    /// Goes on, sample after sample, until P does not change any more but for rounding, and tells what the filter
    /// is then: the fixed point of the discrete Riccati equation
    ///
    /// ```text
    /// P = F (P - P H' (H P H' + R)⁻¹ H P) F' + Q
    /// ```
    ///
    /// There is one, whatever the start, if all that is unstable is measured and all that is not stable is driven
    /// by noise. (If something is not driven, a start with P = 0 would stay there: start with a P that is positive
    /// definite. What is stable and not driven becomes known exactly, in many steps.) Its error is that of the filter,
    /// about a rounding for each sample that the filter remembers: for a random walk with variance q, measured with
    /// variance 1, P was off by 6e-7, 6e-5 and 1.4e-4 at q = 1e-4, 1e-6 and 1e-8 in `f32`, and by 1e-12 at most in
    /// `f64` (measured). To see that nothing changes any more takes half as many steps again, or as many again.
    ///
    /// Errors: [`Error::NotConverged`] after `maximum_steps` samples; [`Error::Overflow`]; those of
    /// [`predict`](GainSchedule::predict) and [`correct`](GainSchedule::correct). Each step costs one of each and
    /// n³/3.
    ///
    /// ```
    /// use thetahat_core::nalgebra::{Const, Matrix2, RowVector2, Vector1, Vector2};
    /// use thetahat_core::{Covariance, Error, GainSchedule, LinearObservation, LinearTransition};
    ///
    /// // The alpha-beta filter: a random acceleration of variance 1, a position measured with variance 1.
    /// let one: Covariance<f64, Const<1>> = Covariance::from_diagonal(&Vector1::new(1.0))?;
    /// let noise = one.transformed(&Vector2::new(0.5, 1.0))?;
    /// let motion = LinearTransition::new(Matrix2::new(1.0, 1.0, 0.0, 1.0), noise)?;
    /// let sensor = LinearObservation::new(RowVector2::new(1.0, 0.0), one)?;
    /// let start = Covariance::from_diagonal(&Vector2::new(1.0, 1.0))?;
    ///
    /// let steady = GainSchedule::new(start).steady_state(&motion, &sensor, 1000)?;
    /// assert!((steady.gain - Vector2::new(0.75, 0.5)).amax() < 1e-14);
    /// assert!((steady.predictor_gain - Vector2::new(1.25, 0.5)).amax() < 1e-14);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn steady_state<M: Dimension + Dimension<U> + Dimension<N>, U: Dimension>(
        self,
        transition: &LinearTransition<T, N, U>,
        observation: &LinearObservation<T, N, M, U>,
        maximum_steps: usize,
    ) -> Result<SteadyState<T, N, M>, Error>
    where
        N: Dimension<U> + Dimension<M>,
    {
        self.steady_state_unless(transition, observation, maximum_steps, || false)
    }

    /// The same, given up where `interrupted`, which is asked before each step, says so.
    ///
    /// Errors: those of [`steady_state`](GainSchedule::steady_state); [`Error::NotConverged`] with the steps done where
    /// it was given up.
    pub fn steady_state_unless<M: Dimension + Dimension<U> + Dimension<N>, U: Dimension>(
        mut self,
        transition: &LinearTransition<T, N, U>,
        observation: &LinearObservation<T, N, M, U>,
        maximum_steps: usize,
        mut interrupted: impl FnMut() -> bool,
    ) -> Result<SteadyState<T, N, M>, Error>
    where
        N: Dimension<U> + Dimension<M>,
    {
        let (size, outputs) = (self.covariance().size(), observation.noise().size());
        self.predict(transition)?;
        let mut matrix = self.covariance().matrix();
        let (mut least_change, mut least_at) = (T::INFINITY, 0);
        for steps in 1..=maximum_steps {
            if interrupted() {
                return Err(Error::NotConverged { steps: steps - 1 });
            }
            self.absorb(observation, outputs.vector(T::zero()))?;
            self.predict(transition)?;
            let next = self.covariance().matrix();
            let change = relative_change(matrix.as_slice(), next.as_slice(), size.value());
            if change < least_change {
                (least_change, least_at) = (change, steps);
            }
            // No longer shrinking: for half as long as it has been, at the level of rounding; or, where rounding is
            // amplified, for as long.
            let rounding = Covariance::<T, N>::rounding(size.value());
            let patience = if least_change <= rounding { least_at / 2 + 8 } else { least_at + 8 };
            let stays = least_change <= T::SQRT_EPSILON && steps - least_at > patience;
            if change.is_zero() || stays {
                let predicted = self.covariance().clone();
                let gain = self.correct(observation)?;
                let mut predictor_gain = size.rows_by(outputs, T::zero());
                for index in 0..outputs.value() {
                    let target = column_mut(predictor_gain.as_mut_slice(), size.value(), index);
                    let gain = column(gain.as_slice(), size.value(), index);
                    add_product(transition.state_matrix().as_slice(), gain, target);
                }
                let filtered = self.covariance().clone();
                return Ok(SteadyState { predicted, filtered, gain, predictor_gain, steps });
            }
            matrix = next;
        }
        Err(Error::NotConverged { steps: maximum_steps })
    }

    /// The measurement update, with these errors of the measurement.
    fn absorb<M: Dimension + Dimension<U> + Dimension<N>, U: Dimension>(
        &mut self,
        observation: &LinearObservation<T, N, M, U>,
        error: OVector<T, M>,
    ) -> Result<(), Error>
    where
        N: Dimension<M>,
    {
        let rows = observation.output_rows();
        check_length("observation", self.filter.state().len(), rows.nrows())?;
        self.filter.absorb(rows.clone(), error, observation.noise(), |_, _, _, _| ())?;
        Ok(())
    }
}

/// The largest change of a covariance matrix, beside the variances of the two elements.
fn relative_change<T: Real>(old: &[T], new: &[T], size: usize) -> T {
    let variance = |index| ud::variance(old, size, index).max(ud::variance(new, size, index));
    let mut largest = T::zero();
    for index in 0..size {
        for (row, (&old, &new)) in column(old, size, index).iter().zip(column(new, size, index)).enumerate() {
            let change = (new - old).abs();
            if change > T::zero() {
                largest = largest.max(change / variance(row).sqrt() / variance(index).sqrt());
            }
        }
    }
    largest
}

#[cfg(feature = "serde")]
mod snapshot;
#[cfg(test)]
mod tests;
