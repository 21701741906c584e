//! The Kalman filter, on a factored covariance.

use core::borrow::Borrow;

use nalgebra::{ArrayStorage, Const, OMatrix, OVector};

use crate::dim::filled;
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
/// But what is never forgotten keeps its rounding: P of four constants without process noise was off by 12 % after
/// 10^5 samples in `f32` (measured). A little process noise cures it. And what is measured exactly, with R = 0, must
/// not be measured again with nothing in between: rounding is then all there is to correct.
///
/// Its state is plain data: [`state`](KalmanFilter::state), [`covariance`](KalmanFilter::covariance) and
/// [`gate`](KalmanFilter::gate) are a snapshot, and [`new`](KalmanFilter::new) and
/// [`with_gate`](KalmanFilter::with_gate) restore it to the bit. (What a gate that lets go has counted starts anew.)
///
/// Units: those of the model. Memory: n² + n + 2 numbers. On the stack, `predict` takes 2 n² + 3 n numbers more, and
/// `correct` n² + 3 n + (n + 3) m, with m outputs; with `Dyn` 2 n² + 3 n of them are kept in the filter.
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
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", into = "snapshot::Snapshot<T, N>"))]
#[cfg_attr(feature = "serde", serde(try_from = "snapshot::Snapshot<T, N>"))]
pub struct KalmanFilter<T: Real, N: Dimension> {
    state: OVector<T, N>,
    covariance: Covariance<T, N>,
    gate: T,
    /// After how many measurements in a row the gate lets go; 0 if never. How many the latest ones are.
    release: u16,
    gated: u16,
    scratch: N::Scratch<T>,
}

/// Equal to the bit: the same state, factors and gate.
impl<T: Real, N: Dimension> PartialEq for KalmanFilter<T, N> {
    fn eq(&self, other: &Self) -> bool {
        let gate = |filter: &Self| (filter.gate, filter.release, filter.gated);
        self.state == other.state && self.covariance == other.covariance && gate(self) == gate(other)
    }
}

impl<T: Real, N: Dimension> KalmanFilter<T, N> {
    /// A filter that starts from this mean and covariance of the state.
    ///
    /// Errors: [`Error::NotFinite`]; [`Error::Length`] (only with `Dyn`).
    pub fn new(state: OVector<T, N>, covariance: Covariance<T, N>) -> Result<Self, Error> {
        check_entries("state", state.as_slice(), covariance.size().value())?;
        Ok(Self::started(state, covariance))
    }

    /// A filter that starts from this state, which is finite and has the size of the covariance.
    pub(crate) fn started(state: OVector<T, N>, covariance: Covariance<T, N>) -> Self {
        let scratch = covariance.size().scratch::<T, 3, 2>();
        KalmanFilter { state, covariance, gate: T::INFINITY, release: 0, gated: 0, scratch }
    }

    /// The same with a gate: a measurement whose normalised innovation squared is above `gate` is not used, and
    /// [`Action::Gated`] says so. Infinite at first, which is no gate.
    ///
    /// A gate can lock out: once the state is far off, as after a jump of the plant, all measurements are above it, and
    /// P grows too slowly to let them in. [`gated_in_a_row`](KalmanFilter::gated_in_a_row) tells, and
    /// [`with_release`](KalmanFilter::with_release) lets go.
    ///
    /// Errors: [`Error::OutOfRange`] if it is not above 0.
    pub fn with_gate(mut self, gate: T) -> Result<Self, Error> {
        self.set_gate(gate)?;
        Ok(self)
    }

    /// The same with a gate that lets go: after `count` measurements in a row that were above it, those that follow are
    /// used, and [`Action::Released`] says so, until one is within the gate again. 0 is a gate that never lets go, as
    /// at first.
    ///
    /// An outlier is rarely followed by another: with independent outliers, one in twenty say, `count` of them in a row
    /// come once in 20^count samples. Each released measurement is weighed as any other: where P is small the state
    /// comes back slowly, by the gain of the filter. ([`widen`](KalmanFilter::widen) makes it quicker, where the plant
    /// has jumped.)
    ///
    /// ```
    /// use thetahat_core::nalgebra::{Const, Matrix1, Vector1};
    /// use thetahat_core::{Action, Covariance, Error, KalmanFilter, LinearObservation, LinearTransition};
    ///
    /// let variance = |value: f64| Covariance::<f64, Const<1>>::from_diagonal(&Vector1::new(value));
    /// let walk = LinearTransition::new(Matrix1::new(1.0), variance(0.01)?)?;
    /// let gauge = LinearObservation::new(Matrix1::new(1.0), variance(1.0)?)?;
    /// let mut filter = KalmanFilter::new(Vector1::new(0.0), variance(1.0)?)?.with_gate(9.0)?.with_release(5);
    /// let mut actions = [Action::Missing; 40];
    /// for action in &mut actions {
    ///     filter.predict(&walk, &Default::default())?;
    ///     *action = filter.correct(&gauge, &Default::default(), &Vector1::new(100.0))?.action; // it is at 100, not 0
    /// }
    /// assert_eq!(actions[4..6], [Action::Gated, Action::Released]);
    /// assert_eq!(actions[39], Action::Updated);
    /// assert!(filter.gated_in_a_row() == 0 && (filter.state()[0] - 100.0).abs() < 5.0);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn with_release(mut self, count: u16) -> Self {
        self.set_release(count);
        self
    }

    /// Puts the state where it is known to be. P stays: see [`set_covariance`](KalmanFilter::set_covariance). What the
    /// gate has counted starts anew.
    ///
    /// Errors, after which nothing has changed: [`Error::NotFinite`]; [`Error::Length`] (only with `Dyn`).
    ///
    /// ```
    /// use thetahat_core::nalgebra::{Const, Vector2};
    /// use thetahat_core::{Covariance, Error, KalmanFilter};
    ///
    /// /// The cart stands at its reference switch. In a `static` or a task only a `&mut` of the filter is there.
    /// fn at_the_switch(cart: &mut KalmanFilter<f32, Const<2>>) -> Result<(), Error> {
    ///     cart.set_state(Vector2::new(1.5, 0.0))?;
    ///     cart.set_covariance(Covariance::from_diagonal(&Vector2::new(1e-6, 0.0))?)
    /// }
    ///
    /// let mut cart = KalmanFilter::new(Vector2::zeros(), Covariance::from_diagonal(&Vector2::new(9.0, 1.0))?)?;
    /// at_the_switch(&mut cart)?;
    /// assert_eq!(*cart.state(), Vector2::new(1.5, 0.0));
    /// # Ok::<(), Error>(())
    /// ```
    pub fn set_state(&mut self, state: OVector<T, N>) -> Result<(), Error> {
        check_entries("state", state.as_slice(), self.covariance.size().value())?;
        (self.state, self.gated) = (state, 0);
        Ok(())
    }

    /// Sets P. The state stays.
    ///
    /// Errors, after which nothing has changed: [`Error::Length`] (only with `Dyn`).
    pub fn set_covariance(&mut self, covariance: Covariance<T, N>) -> Result<(), Error> {
        check_length("covariance", self.state.len(), covariance.size().value())?;
        self.covariance = covariance;
        Ok(())
    }

    /// Takes P for larger by a factor: the next measurements move the state more. For a state that is less sure than P
    /// says, as after a fault. No variance shrinks, and one of 0 stays 0.
    ///
    /// ```text
    /// P <- factor P,     factor >= 1
    /// ```
    ///
    /// Errors, after which nothing has changed: [`Error::OutOfRange`] if the factor is not finite and at least 1;
    /// [`Error::Overflow`]. n multiplications and n²/2 multiply-adds.
    pub fn widen(&mut self, factor: T) -> Result<(), Error> {
        self.covariance = self.covariance.widened(factor)?;
        Ok(())
    }

    /// The same by a sum, P <- P + Q: what has come to the state beside the process noise, as where the plant was
    /// moved.
    ///
    /// Errors, after which nothing has changed: [`Error::Length`] (only with `Dyn`); [`Error::Overflow`]. 1.5 n³
    /// multiply-adds.
    pub fn widen_by(&mut self, covariance: &Covariance<T, N>) -> Result<(), Error> {
        self.covariance = self.covariance.plus(covariance)?;
        Ok(())
    }

    /// Sets the gate: see [`with_gate`](KalmanFilter::with_gate), whose errors it has.
    pub fn set_gate(&mut self, gate: T) -> Result<(), Error> {
        if gate > T::zero() {
            self.gate = gate;
            Ok(())
        } else {
            Err(Error::OutOfRange { argument: "gate", range: "above 0" })
        }
    }

    /// Sets when the gate lets go: see [`with_release`](KalmanFilter::with_release).
    pub fn set_release(&mut self, count: u16) {
        self.release = count;
    }

    /// The same to the bit, with its size in another type, see [`Covariance::to_size`]. With `Const` a step needs no
    /// heap, and is quicker.
    ///
    /// Errors: [`Error::Length`] if it has another size.
    pub fn to_size<K: Dimension>(&self, size: K) -> Result<KalmanFilter<T, K>, Error> {
        let covariance = self.covariance.to_size(size)?;
        let state = filled(size.vector(T::zero()), self.state.as_slice());
        let KalmanFilter { gate, release, gated, .. } = *self;
        Ok(KalmanFilter { gate, release, gated, ..KalmanFilter::started(state, covariance) })
    }

    /// The mean of the state, x̂.
    pub fn state(&self) -> &OVector<T, N> {
        &self.state
    }

    /// The covariance of the state, P.
    pub fn covariance(&self) -> &Covariance<T, N> {
        &self.covariance
    }

    /// The gate on the normalised innovation squared: infinite if there is none.
    pub fn gate(&self) -> T {
        self.gate
    }

    /// The same with the gate of another filter, and what it has counted.
    pub(crate) fn with_gate_of(self, other: &Self) -> Self {
        KalmanFilter { gate: other.gate, release: other.release, gated: other.gated, ..self }
    }

    /// After how many measurements in a row the gate lets go; 0 if never.
    pub fn release(&self) -> u16 {
        self.release
    }

    /// How many of the latest measurements were above the gate, since the last one within it, at most 65,535; missing
    /// ones do not count. More than a few: the gate has locked the filter out.
    pub fn gated_in_a_row(&self) -> u16 {
        self.gated
    }

    /// S = H P H' + R, the covariance of the innovation that this observation would have now, m x m.
    ///
    /// Errors: [`Error::Length`] (only with `Dyn`); [`Error::Overflow`]. n² m/2 + 1.5 m² (n + m) multiply-adds.
    pub fn innovation_covariance<M: Dimension + Dimension<U> + Dimension<N>, U: Dimension>(
        &self,
        observation: &LinearObservation<T, N, M, U>,
    ) -> Result<Covariance<T, M>, Error>
    where
        N: Dimension<M>,
    {
        self.covariance.transformed(&observation.output_matrix())?.plus(observation.noise())
    }

    /// (x - x̂)'P⁻¹(x - x̂) = Σ z_j²/D_j with U z = x - x̂, over what P leaves open but for rounding.
    pub(crate) fn squared_distance(&self, state: &OVector<T, N>) -> T {
        let (factor, n) = (self.covariance.as_slice(), self.state.len());
        let mut rest = state.clone();
        add_multiple(rest.as_mut_slice(), -T::one(), self.state.as_slice());
        let mut sum = T::zero();
        for index in (0..n).rev() {
            let (before, last) = rest.as_mut_slice().split_at_mut_checked(index).unwrap_or_default();
            let Some(&mut z) = last.first_mut() else { continue };
            add_multiple(before, -z, column(factor, n, index));
            let variance = ud::variance(factor, n, index);
            if variance >= T::MIN_POSITIVE && variance > T::EPSILON * ud::diagonal(factor, n, index) {
                sum += z * (z / variance);
            }
        }
        sum
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
        let (noise_matrix, noise) = (transition.noise_matrix(), transition.noise());
        self.propagate(transition, next, transition.state_matrix(), noise_matrix, || noise)
    }

    /// The time update where the process noise and the noise of a measurement are correlated.
    ///
    /// ```text
    /// cov(w(k), v(k)) = S:   x̂ <- F x̂ + G u + S R⁻¹ (y - H x̂ - D u)
    ///                        P <- (F - S R⁻¹ H) P (F - S R⁻¹ H)' + Q - S R⁻¹ S'
    /// ```
    ///
    /// It comes after [`correct`](KalmanFilter::correct) with the same u(k) and y(k): the measurement tells
    /// something about w(k) too. S is n x m. Of a measurement with missing elements the others are used; if all
    /// are missing, or if `correct` answered [`Action::Gated`], [`predict`](KalmanFilter::predict) is the update.
    /// A model in innovations form, x(k+1) = F x + G u + K e, y = H x + D u + e with var e = R, has Q = K R K'
    /// and S = K R: then Q - S R⁻¹ S' = 0.
    ///
    /// Errors, after which nothing has changed: [`Error::NotPositive`] if no noises have these covariances, that
    /// is if Q - S R⁻¹ S' has a negative variance; and those of [`predict`](KalmanFilter::predict) and
    /// [`correct`](KalmanFilter::correct). About 2 n³ + 3 n² m multiply-adds.
    ///
    /// Source: Anderson and Moore, Optimal Filtering, 1979, section 5.5.
    ///
    /// ```
    /// use thetahat_core::nalgebra::{Const, SVector, Vector1};
    /// use thetahat_core::{Covariance, Error, KalmanFilter, LinearObservation, LinearTransition};
    ///
    /// // x(k+1) = 0.5 x + e, y = x + e: the ARMA model y(k) = 0.5 y(k-1) + e(k) + 0.5 e(k-1), var e = 1.
    /// let one: Covariance<f64, Const<1>> = Covariance::from_diagonal(&Vector1::new(1.0))?;
    /// let model = LinearTransition::new(Vector1::new(0.5), one.clone())?;
    /// let output = LinearObservation::new(Vector1::new(1.0), one)?;
    /// let none = SVector::zeros();
    ///
    /// let mut filter = KalmanFilter::new(Vector1::new(0.0), Covariance::zero(Const))?;
    /// for y in [1.0, 2.0] {
    ///     filter.correct(&output, &none, &Vector1::new(y))?;
    ///     filter.predict_correlated(&model, &output, &Vector1::new(1.0), &none, &Vector1::new(y))?;
    /// }
    /// // e(0) = 1 and x(1) = 1; e(1) = 2 - 1 = 1 and x(2) = 0.5 + 1, with no doubt left.
    /// assert_eq!(filter.state()[0], 1.5);
    /// assert_eq!(filter.covariance().variances()[0], 0.0);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn predict_correlated<M: Dimension + Dimension<U> + Dimension<N>, U: Dimension>(
        &mut self,
        transition: &LinearTransition<T, N, U>,
        observation: &LinearObservation<T, N, M, U>,
        cross_covariance: &OMatrix<T, N, M>,
        input: &OVector<T, U>,
        measurement: &OVector<T, M>,
    ) -> Result<(), Error>
    where
        N: Dimension<U> + Dimension<M>,
    {
        let (n, m) = (self.state.len(), observation.output_rows().ncols());
        check_entries("input", input.as_slice(), transition.input_matrix().ncols())?;
        check_length("observation", transition.input_matrix().ncols(), observation.input_matrix().ncols())?;
        check_length("transition", n, transition.state_matrix().ncols())?;
        check_length("observation", n, observation.output_rows().nrows())?;
        check_length("cross_covariance", m, cross_covariance.ncols())?;
        check_entries("cross_covariance", cross_covariance.as_slice(), n * m)?;
        let error = prediction_error(measurement, observation.output(&self.state, input))?;
        let (mut rows, mut cross) = (observation.output_rows().clone(), cross_covariance.clone());
        let noise = observation.noise();
        let mut whitened = error.clone();
        whiten(cross.as_mut_slice(), whitened.as_mut_slice(), noise);
        ud::copy(error.as_slice(), whitened.as_mut_slice());
        let partial = whiten(rows.as_mut_slice(), whitened.as_mut_slice(), noise);
        let noise = partial.as_ref().unwrap_or(noise);

        let mut next = transition.next(&self.state, input);
        let mut state_matrix = transition.state_matrix().clone();
        let mut rest = transition.noise_matrix().clone();
        let given = transition.noise().variances();
        for (index, (error, &whitened)) in error.iter().zip(whitened.iter()).enumerate() {
            if is_missing(error) {
                continue;
            }
            let variance = ud::variance(noise.as_slice(), m, index);
            let weights = column(cross.as_slice(), n, index);
            if variance < T::MIN_POSITIVE {
                // An element without noise has no part in w: what is there must be rounding.
                let bound = ud::diagonal(noise.as_slice(), m, index).sqrt() * T::SQRT_EPSILON;
                if weights.iter().zip(given.iter()).any(|(weight, given)| weight.abs() > bound * given.sqrt())
                {
                    return Err(Error::NotPositive {
                        argument: "measurement noise given the process noise",
                        index,
                    });
                }
                continue;
            }
            for (i, &h) in column(rows.as_slice(), n, index).iter().enumerate() {
                add_multiple(column_mut(state_matrix.as_mut_slice(), n, i), -h / variance, weights);
            }
            for (i, &weight) in weights.iter().enumerate() {
                add_multiple(column_mut(rest.as_mut_slice(), n, i), -weight / variance, weights);
            }
            add_multiple(next.as_mut_slice(), whitened / variance, weights);
        }
        let rest = Covariance::decomposed(rest, &given, "process noise given the measurement")?;
        self.propagate(transition, next, &state_matrix, &rest.matrix(), || &rest)
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
        let noise = observation.noise();
        self.absorb(observation.output_rows().clone(), error, noise, |_, _, _, _| ())
    }

    /// x̂ <- `next`, P <- F P F' + Q. The factors of Q are asked for where the quick way would lose digits.
    ///
    /// The closure has the type of the model among its own. So each model has its own copy, which a compiler puts where
    /// it is called, with the constants of that model's Jacobian: an extended Kalman filter 3 x 1 takes a quarter less
    /// instructions for it (Cortex-M4F, measured). One copy for all models of a size would be called as soon as
    /// there are two.
    #[inline(always)]
    pub(crate) fn propagate<Model, Noise: Borrow<Covariance<T, N>>>(
        &mut self,
        _model: &Model,
        next: OVector<T, N>,
        state_matrix: &OMatrix<T, N, N>,
        noise_matrix: &OMatrix<T, N, N>,
        noise: impl FnOnce() -> Noise,
    ) -> Result<(), Error> {
        let size = self.covariance.size();
        if !next.as_slice().iter().all(T::is_finite) {
            return Err(Error::Overflow);
        }
        let factor = self.covariance.as_mut_slice();
        let quick = size.with_scratch(&mut self.scratch, |vectors, squares| {
            ud::propagate(factor, state_matrix.as_slice(), noise_matrix.as_slice(), squares, vectors)
        });
        if !quick && !self.propagate_by_columns(state_matrix, noise().borrow()) {
            return Err(Error::Overflow);
        }
        self.state = next;
        Ok(())
    }

    /// The covariance of [`propagate`](KalmanFilter::propagate), where it goes wrong the quick way.
    #[cold]
    fn propagate_by_columns(&mut self, state_matrix: &OMatrix<T, N, N>, noise: &Covariance<T, N>) -> bool {
        let factor = self.covariance.as_mut_slice();
        noise.size().with_scratch(&mut self.scratch, |[product], [work]| {
            ud::propagate_by_columns(factor, state_matrix.as_slice(), noise.as_slice(), work, product)
        })
    }

    /// Corrects by the errors of a measurement, given the rows of H as columns. `record` is told of each element
    /// that is used, whitened: y = h'x + v, var v = r. Its arguments are h, P h, h'P h + r and y - h'x̂ before the
    /// update by this element.
    #[inline(always)]
    pub(crate) fn absorb<M: Dimension>(
        &mut self,
        mut rows: OMatrix<T, N, M>,
        error: OVector<T, M>,
        noise: &Covariance<T, M>,
        mut record: impl FnMut(&[T], &[T], T, T),
    ) -> Result<Innovation<T, OVector<T, M>>, Error>
    where
        N: Dimension<M>,
    {
        let size = self.covariance.size();
        let (n, m) = (size.value(), error.len());
        let mut whitened = error.clone();
        let partial = whiten(rows.as_mut_slice(), whitened.as_mut_slice(), noise);
        let noise = partial.as_ref().unwrap_or(noise);
        let error_is_missing = |index| error.as_slice().get(index).is_none_or(is_missing);
        let mut variance = noise.size().vector(T::NAN);
        let mut nis = T::zero();
        let mut action = Action::Missing;
        let (state, factor) = (self.state.as_mut_slice(), self.covariance.as_mut_slice());
        size.with_scratch(&mut self.scratch, |[f, v, step], [work]| {
            ud::copy(factor, work);
            step.fill(T::zero());
            // Each element is whitened by those after it: so these come first.
            for (index, (&error, variance)) in
                whitened.as_slice().iter().zip(variance.as_mut_slice()).enumerate().rev()
            {
                if error_is_missing(index) {
                    continue;
                }
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
                ud::update(work, f, v, noise, T::one());
                add_multiple(step, gain, v);
                record(row, v, *variance, rest);
                action = Action::Updated;
            }
            if nis > self.gate {
                let lets_go = self.release > 0 && self.gated >= self.release;
                action = if lets_go { Action::Released } else { Action::Gated };
            }
            if matches!(action, Action::Updated | Action::Released) {
                add_multiple(step, T::one(), state);
                if !(step.iter().all(T::is_finite) && ud::is_finite(work, n)) {
                    return Err(Error::TooLarge { argument: "measurement" });
                }
                ud::copy(step, state);
                ud::copy(work, factor);
            }
            Ok(())
        })?;
        match action {
            Action::Updated => self.gated = 0,
            Action::Gated | Action::Released => self.gated = self.gated.saturating_add(1),
            _ => {}
        }
        Ok(Innovation { error, variance, nis, action })
    }
}

/// y - ŷ: NaN where the measurement is missing.
pub(crate) fn prediction_error<T: Real, M: Dimension>(
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
pub(crate) fn is_missing<T: Real>(sample: &T) -> bool {
    sample.partial_cmp(sample).is_none()
}

/// Makes the noises of the elements of a measurement independent: e <- V⁻¹ e and H <- V⁻¹ H, where R = V E V'.
///
/// Returns V and E of those elements that are there, where that is another one than `noise`.
#[inline(always)]
pub(crate) fn whiten<T: Real, M: Dimension>(
    rows: &mut [T],
    errors: &mut [T],
    noise: &Covariance<T, M>,
) -> Option<Covariance<T, M>> {
    let m = errors.len();
    if ud::is_diagonal(noise.as_slice(), m) {
        return None;
    }
    let missing = |index| errors.get(index).is_none_or(is_missing);
    let partial = if (0..m).any(missing) { Some(noise.without(missing)) } else { None };
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
    partial
}

/// Filters that are constants, in single and in double precision.
macro_rules! constant {
    ($real:ty) => {
        impl<const N: usize> KalmanFilter<$real, Const<N>> {
            /// The same as [`new`](KalmanFilter::new) as a constant, for a filter in a `static`: nothing is set up at
            /// run time.
            ///
            /// Errors: [`Error::NotFinite`].
            ///
            /// ```
            /// use std::sync::Mutex;
            /// use thetahat_core::nalgebra::{Const, Vector2};
            /// use thetahat_core::{Covariance, Error, KalmanFilter};
            ///
            /// type Cart = KalmanFilter<f32, Const<2>>;
            /// const AT_REST: Result<Cart, Error> = match Covariance::<f32, _>::constant([9.0, 1.0]) {
            ///     Ok(prior) => Cart::constant([0.0, 0.0], prior),
            ///     Err(error) => Err(error),
            /// };
            /// static CART: Mutex<Cart> = Mutex::new(match AT_REST {
            ///     Ok(cart) => cart,
            ///     Err(_) => panic!("a number is wrong"), // it does not compile then
            /// });
            ///
            /// CART.lock().unwrap().set_state(Vector2::new(1.5, 0.0))?;
            /// # Ok::<(), Error>(())
            /// ```
            pub const fn constant(
                state: [$real; N],
                covariance: Covariance<$real, Const<N>>,
            ) -> Result<Self, Error> {
                let mut index = 0;
                while index < N {
                    if !state[index].is_finite() {
                        return Err(Error::NotFinite { argument: "state" });
                    }
                    index += 1;
                }
                let state = OVector::<$real, Const<N>>::from_array_storage(ArrayStorage([state]));
                let gate = <$real>::INFINITY;
                Ok(KalmanFilter { state, covariance, gate, release: 0, gated: 0, scratch: () })
            }
        }
    };
}

constant!(f32);
constant!(f64);

#[cfg(feature = "serde")]
mod snapshot;
mod stored;
#[cfg(test)]
mod tests;

pub(crate) use stored::stored_numbers;
