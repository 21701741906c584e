//! The Kalman filter, on a factored covariance.

use nalgebra::{OMatrix, OVector};

use crate::error::{check_entries, check_length};
use crate::triangle::{column, column_mut};
use crate::ud::{add_multiple, dot};
use crate::{
    Action, Covariance, Dimension, Error, Innovation, LinearObservation, LinearTransition, Observation, Real,
    Transition, ud,
};

/// The Kalman filter.
///
/// It keeps the mean x̂ and the covariance P = U D U' of the state, given all measurements so far.
///
/// ```text
/// predict:   x̂ <- F x̂ + G u,          P <- F P F' + Q
/// correct:   e = y - H x̂ - D u,       S = H P H' + R,   K = P H' S⁻¹,
///            x̂ <- x̂ + K e,           P <- P - K S K'
/// ```
///
/// The models are arguments of [`predict`](KalmanFilter::predict) and [`correct`](KalmanFilter::correct): so
/// they may vary in time, and sensors of different sizes and rates correct the same filter, each when it has
/// something to say.
///
/// P never becomes indefinite, in `f32` too: only its factors are updated, and by formulas that do not subtract
/// variances. (Bierman 1977 for the measurements, one element after the other; for the time update see there
/// section VI.4. P - K H P loses definiteness after some 10^5 steps of ordinary data, measured.)
///
/// Units: those of the model. Memory: n² + n + 1 numbers, and as many again on the stack in a step.
///
/// Source: Kalman, A new approach to linear filtering and prediction problems, 1960; Bierman, Factorization
/// Methods for Discrete Sequential Estimation, 1977, chapters V and VI.
///
/// ```
/// use thetahat_core::nalgebra::{Const, Matrix2, RowVector2, SVector, Vector1, Vector2};
/// use thetahat_core::{Covariance, Error, KalmanFilter, LinearObservation, LinearTransition};
///
/// // Position and velocity, a sample a second; the acceleration has variance 1, the measured position too.
/// let acceleration: Covariance<f64, Const<1>> = Covariance::from_diagonal(&Vector1::new(1.0))?;
/// let noise = acceleration.transformed(&Vector2::new(0.5, 1.0))?;
/// let motion = LinearTransition::new(Matrix2::new(1.0, 1.0, 0.0, 1.0), noise)?;
/// let sensor = LinearObservation::new(
///     RowVector2::new(1.0, 0.0),
///     Covariance::<f64, Const<1>>::from_diagonal(&Vector1::new(1.0))?,
/// )?;
///
/// let prior = Covariance::from_diagonal(&Vector2::new(100.0, 100.0))?;
/// let mut filter = KalmanFilter::<f64, Const<2>>::new(Vector2::zeros(), prior)?;
/// let none = SVector::zeros(); // no inputs
/// for k in 0..50 {
///     filter.predict(&motion, &none)?;
///     let innovation = filter.correct(&sensor, &none, &Vector1::new(2.0 * k as f64))?;
///     assert!(innovation.variance[0] > 1.0);
/// }
/// assert!((filter.state() - Vector2::new(98.0, 2.0)).amax() < 1e-6);
/// // The steady filtered covariance of this model is known exactly.
/// assert!((filter.covariance().matrix() - Matrix2::new(0.75, 0.5, 0.5, 1.0)).amax() < 1e-12);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct KalmanFilter<T: Real, N: Dimension> {
    state: OVector<T, N>,
    covariance: Covariance<T, N>,
    gate: T,
    scratch: N::Scratch<T>,
}

impl<T: Real, N: Dimension> KalmanFilter<T, N> {
    /// A filter that starts from this mean and covariance of the state.
    ///
    /// Errors: [`Error::NotFinite`]; [`Error::Length`] (only with `Dyn`).
    pub fn new(state: OVector<T, N>, covariance: Covariance<T, N>) -> Result<Self, Error> {
        let size = covariance.size();
        check_entries("state", state.as_slice(), size.value())?;
        Ok(KalmanFilter { state, covariance, gate: T::INFINITY, scratch: size.scratch::<T, 3, 2>() })
    }

    /// The same with a gate: a measurement whose normalised innovation squared is above `gate` is not used, and
    /// [`Action::Gated`] says so. Infinite at first, which is no gate.
    ///
    /// Errors: [`Error::OutOfRange`] if it is not above 0.
    pub fn with_gate(self, gate: T) -> Result<Self, Error> {
        if gate > T::zero() {
            Ok(KalmanFilter { gate, ..self })
        } else {
            Err(Error::OutOfRange { argument: "gate", range: "above 0" })
        }
    }

    /// The mean of the state, x̂.
    pub fn state(&self) -> &OVector<T, N> {
        &self.state
    }

    /// The covariance of the state, P.
    pub fn covariance(&self) -> &Covariance<T, N> {
        &self.covariance
    }

    /// The time update: one sample ahead, with the input u(k).
    ///
    /// Errors, after which nothing has changed: [`Error::NotFinite`] if an input is NaN or infinite;
    /// [`Error::Overflow`]; [`Error::Length`] (only with `Dyn`). About 1.2 n³ multiply-adds; where the quick
    /// way would lose digits, n³ more.
    #[inline]
    pub fn predict<U: Dimension>(
        &mut self,
        transition: &LinearTransition<T, N, U>,
        input: &OVector<T, U>,
    ) -> Result<(), Error>
    where
        N: Dimension<U>,
    {
        check_entries("input", input.as_slice(), transition.input_matrix().ncols())?;
        check_length("transition", self.state.len(), transition.state_matrix().ncols())?;
        let next = transition.next(&self.state, input);
        let (noise_matrix, noise) = (transition.noise_matrix(), LinearTransition::noise(transition));
        self.propagate(next, transition.state_matrix(), noise_matrix, noise)
    }

    /// The measurement update, with y(k) and u(k) (which counts where the observation has a feedthrough).
    ///
    /// A NaN in the measurement is a missing element: it is skipped alone, and the others are used. The
    /// innovation tells what was new.
    ///
    /// Errors, after which nothing has changed: [`Error::Infinite`] if the measurement is;
    /// [`Error::NotFinite`] if an input is NaN or infinite; [`Error::NoVariance`]; [`Error::TooLarge`] if the
    /// measurement makes numbers overflow; [`Error::Length`] (only with `Dyn`). About m (1.5 n² + 6 n)
    /// multiply-adds and m n divisions.
    #[inline]
    pub fn correct<M: Dimension + Dimension<U> + Dimension<N>, U: Dimension>(
        &mut self,
        observation: &LinearObservation<T, N, M, U>,
        input: &OVector<T, U>,
        measurement: &OVector<T, M>,
    ) -> Result<Innovation<T, OVector<T, M>>, Error>
    where
        N: Dimension<M>,
    {
        check_entries("input", input.as_slice(), observation.input_matrix().ncols())?;
        check_length("observation", self.state.len(), observation.output_rows().nrows())?;
        let error = prediction_error(measurement, observation.output(&self.state, input))?;
        let noise = LinearObservation::noise(observation);
        self.absorb(observation.output_rows().clone(), error, noise)
    }

    /// x̂ <- `next`, P <- F P F' + Q.
    #[inline(always)]
    pub(crate) fn propagate(
        &mut self,
        next: OVector<T, N>,
        state_matrix: &OMatrix<T, N, N>,
        noise_matrix: &OMatrix<T, N, N>,
        noise: &Covariance<T, N>,
    ) -> Result<(), Error> {
        let size = self.covariance.size();
        let n = size.value();
        if !next.as_slice().iter().all(T::is_finite) {
            return Err(Error::Overflow);
        }
        let factor = self.covariance.as_mut_slice();
        let finite = size.with_scratch(&mut self.scratch, |[], [columns, work]| {
            ud::multiply(state_matrix.as_slice(), factor, columns, n);
            ud::propagate(factor, columns, noise_matrix.as_slice(), noise.as_slice(), work, n)
        });
        if !finite {
            return Err(Error::Overflow);
        }
        self.state = next;
        Ok(())
    }

    /// Corrects by the errors of a measurement, given the rows of H as columns.
    #[inline(always)]
    pub(crate) fn absorb<M: Dimension>(
        &mut self,
        mut rows: OMatrix<T, N, M>,
        error: OVector<T, M>,
        noise: &Covariance<T, M>,
    ) -> Result<Innovation<T, OVector<T, M>>, Error>
    where
        N: Dimension<M>,
    {
        let size = self.covariance.size();
        let (n, m) = (size.value(), error.len());
        let mut whitened = error.clone();
        let partial = whiten(rows.as_mut_slice(), whitened.as_mut_slice(), noise)?;
        let noise = partial.as_ref().unwrap_or(noise);
        let mut variance = noise.size().vector(T::NAN);
        let mut nis = T::zero();
        let mut action = Action::Missing;
        let (state, factor) = (self.state.as_mut_slice(), self.covariance.as_mut_slice());
        size.with_scratch(&mut self.scratch, |[f, v, step], [work]| {
            ud::copy(factor, work);
            step.fill(T::zero());
            let errors = whitened.as_slice().iter().zip(variance.as_mut_slice()).enumerate();
            for (index, (&error, variance)) in errors.filter(|(_, (error, _))| !is_missing(*error)) {
                let row = column(rows.as_slice(), n, index);
                let noise = ud::variance(noise.as_slice(), m, index);
                *variance = ud::project(work, row, f, v, noise);
                if *variance < T::MIN_POSITIVE {
                    return Err(Error::NoVariance { index });
                }
                let rest = error - dot(row, step);
                let gain = rest / *variance;
                nis += gain * rest;
                if !(nis.is_finite() && variance.is_finite()) {
                    return Err(Error::TooLarge { argument: "measurement" });
                }
                ud::update(work, f, v, noise);
                add_multiple(step, gain, v);
                action = Action::Updated;
            }
            if nis > self.gate {
                action = Action::Gated;
            }
            if action == Action::Updated {
                add_multiple(step, T::one(), state);
                if !step.iter().all(T::is_finite) {
                    return Err(Error::TooLarge { argument: "measurement" });
                }
                ud::copy(step, state);
                ud::copy(work, factor);
            }
            Ok(())
        })?;
        Ok(Innovation { error, variance, nis, action })
    }
}

/// y - ŷ: NaN where the measurement is missing.
fn prediction_error<T: Real, M: Dimension>(
    measurement: &OVector<T, M>,
    mut predicted: OVector<T, M>,
) -> Result<OVector<T, M>, Error> {
    check_length("measurement", predicted.len(), measurement.len())?;
    for (predicted, &measured) in predicted.as_mut_slice().iter_mut().zip(measurement.as_slice()) {
        if measured.abs() == T::INFINITY {
            return Err(Error::Infinite { argument: "measurement" });
        }
        if !predicted.is_finite() {
            return Err(Error::NotFinite { argument: "predicted measurement" });
        }
        *predicted = measured - *predicted;
    }
    Ok(predicted)
}

/// Whether a sample is NaN: a missing one.
fn is_missing<T: Real>(sample: &T) -> bool {
    sample.partial_cmp(sample).is_none()
}

/// Makes the noises of the elements of a measurement independent: e <- V⁻¹ e and H <- V⁻¹ H, where R = V E V'.
///
/// Returns V and E of those elements that are there, where that is another one than `noise`.
#[inline(always)]
fn whiten<T: Real, M: Dimension>(
    rows: &mut [T],
    errors: &mut [T],
    noise: &Covariance<T, M>,
) -> Result<Option<Covariance<T, M>>, Error> {
    let m = errors.len();
    if ud::is_diagonal(noise.as_slice(), m) {
        return Ok(None);
    }
    let missing = |index| errors.get(index).is_none_or(is_missing);
    let partial = if (0..m).any(missing) { Some(noise.without(missing)?) } else { None };
    let factor = partial.as_ref().unwrap_or(noise).as_slice();
    let n = rows.len() / m.max(1);
    for index in (0..m).rev() {
        let Some((earlier, later)) = rows.split_at_mut_checked((index + 1) * n) else {
            continue;
        };
        let (row, mut error) = (column_mut(earlier, n, index), errors.get(index).copied().unwrap_or(T::NAN));
        for k in index + 1..m {
            let (entry, known) = (ud::entry(factor, m, index, k), errors.get(k).copied().unwrap_or(T::NAN));
            if !is_missing(&known) {
                error -= entry * known;
                add_multiple(row, -entry, column(later, n, k - index - 1));
            }
        }
        if let Some(place) = errors.get_mut(index) {
            *place = error;
        }
    }
    Ok(partial)
}
