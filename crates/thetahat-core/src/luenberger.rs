//! The Luenberger observer: a model that is corrected by its own error, with a fixed gain.

use nalgebra::{Complex, OMatrix, OVector};

use crate::error::{check_entries, check_finite, check_length};
use crate::kalman::{is_missing, prediction_error};
use crate::state_space::{add_product, transpose};
use crate::triangle::{column, column_mut};
use crate::ud::{add_multiple, dot};
use crate::{Action, Dimension, Error, Innovation, Observation, Real, Transition, ud};

/// The Luenberger observer, in predictor form.
///
/// ```text
/// x̂(k+1) = f(x̂(k), u(k)) + L (y(k) - h(x̂(k), u(k)))
/// ```
///
/// where f and h are F x + G u and H x + D u if the model is linear. Then the error of the estimate moves as
/// F - L H says, whatever the input does. In predictor form [`state`](LuenbergerObserver::state) is the state at
/// the next sample: y(k) has a whole sample time to be worked on. No noise is asked for, and none known: the noises of
/// the models are not used.
///
/// The gain L, n x m, comes from the poles of F - L H ([`place`](LuenbergerObserver::place)), or is the steady
/// [`predictor_gain`](crate::SteadyState::predictor_gain) of a Kalman filter, or is the user's. For a model that is
/// not linear, place the poles again whenever the linearisation at the estimate has moved, at each sample if need be.
/// (There is then no guarantee that the error shrinks, but near the truth.)
///
/// Units: L_ij has the unit of state i over that of output j. Memory: n + n m numbers.
///
/// Source: Luenberger, An introduction to observers, 1971.
///
/// ```
/// use thetahat_core::nalgebra::{Complex, Const, Matrix2, RowVector2, SVector, Vector1, Vector2};
/// use thetahat_core::{Covariance, Error, LinearObservation, LinearTransition, LuenbergerObserver};
///
/// // A cart: position and speed, of which the position is measured.
/// let cart = LinearTransition::new(Matrix2::new(1.0, 0.1, 0.0, 1.0), Covariance::zero(Const::<2>))?;
/// let sensor = LinearObservation::new(RowVector2::new(1.0, 0.0), Covariance::zero(Const::<1>))?;
///
/// let mut observer = LuenbergerObserver::<f64, _, _>::new(Vector2::zeros(), Vector2::zeros())?;
/// let none = SVector::zeros(); // no inputs
/// let poles = Vector2::new(Complex::new(0.4, 0.3), Complex::new(0.4, -0.3));
/// observer.place(&cart, &sensor, &none, &Vector1::new(1.0), &poles)?;
/// // The characteristic polynomial of F - L H is z² - 0.8 z + 0.25.
/// assert!((observer.gain() - Vector2::new(1.2, 4.5)).amax() < 1e-14);
///
/// let mut truth = Vector2::new(1.0, 2.0);
/// for _ in 0..30 {
///     observer.update(&cart, &sensor, &none, &Vector1::new(truth[0]))?;
///     truth = cart.state_matrix() * truth;
/// }
/// assert!((observer.state() - truth).amax() < 1e-7);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", into = "snapshot::Snapshot<T, N, M>"))]
#[cfg_attr(feature = "serde", serde(try_from = "snapshot::Snapshot<T, N, M>"))]
pub struct LuenbergerObserver<T: Real, N: Dimension + Dimension<M>, M: Dimension> {
    state: OVector<T, N>,
    gain: OMatrix<T, N, M>,
}

impl<T: Real, N: Dimension + Dimension<M>, M: Dimension> LuenbergerObserver<T, N, M> {
    /// What [`new`](LuenbergerObserver::new) checks.
    fn checked(state: OVector<T, N>, gain: OMatrix<T, N, M>) -> Result<Self, Error> {
        check_finite("state", state.as_slice())?;
        check_length("gain", state.len(), gain.nrows())?;
        check_finite("gain", gain.as_slice())?;
        Ok(LuenbergerObserver { state, gain })
    }
}

impl<T: Real, N: Dimension + Dimension<M>, M: Dimension + Dimension<N>> LuenbergerObserver<T, N, M> {
    /// An observer that starts from this estimate of the state, with this gain L, n x m.
    ///
    /// Errors: [`Error::NotFinite`]; [`Error::Length`] (only with `Dyn`).
    pub fn new(state: OVector<T, N>, gain: OMatrix<T, N, M>) -> Result<Self, Error> {
        Self::checked(state, gain)
    }

    /// The estimate of the state at the next sample.
    pub fn state(&self) -> &OVector<T, N> {
        &self.state
    }

    /// The gain L, n x m.
    pub fn gain(&self) -> &OMatrix<T, N, M> {
        &self.gain
    }

    /// Puts the estimate where the state is known to be.
    ///
    /// Errors, after which nothing has changed: [`Error::NotFinite`]; [`Error::Length`] (only with `Dyn`).
    ///
    /// ```
    /// use thetahat_core::nalgebra::{Const, Vector1};
    /// use thetahat_core::{Error, LuenbergerObserver};
    ///
    /// let mut tank = LuenbergerObserver::<f32, Const<1>, Const<1>>::new(Vector1::new(0.0), Vector1::new(0.5))?;
    /// tank.set_state(Vector1::new(20.0))?;
    /// assert_eq!(tank.state()[0], 20.0);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn set_state(&mut self, state: OVector<T, N>) -> Result<(), Error> {
        check_entries("state", state.as_slice(), self.state.len())?;
        self.state = state;
        Ok(())
    }

    /// Sets the gain L, n x m.
    ///
    /// Errors, after which nothing has changed: [`Error::NotFinite`]; [`Error::Length`] (only with `Dyn`).
    pub fn set_gain(&mut self, gain: OMatrix<T, N, M>) -> Result<(), Error> {
        check_length("gain", self.gain.nrows(), gain.nrows())?;
        check_entries("gain", gain.as_slice(), self.gain.len())?;
        self.gain = gain;
        Ok(())
    }

    /// Sets the gain so that F - L H has these poles, where F and H are the Jacobians at the estimate.
    ///
    /// Several outputs are combined into one, c'y, by the weights c: L = l c', where l places the poles of
    /// F - l c'H. A single output has the weight 1. (Any weights do with which the combination still tells all
    /// states apart; take the more accurate outputs with more weight.)
    ///
    /// Complex poles come in conjugate pairs, side by side. F' and H'c are brought to Hessenberg form by
    /// Householder's reflections, and the gain is read off by a recursion over the poles. 4 n³ multiply-adds.
    ///
    /// The error grows with the order, as an eigenvalue tells little of a large matrix: that of the coefficients of
    /// the characteristic polynomial was 4e-12 at n = 4 and 8e-8 at n = 8, the worst of 50 random models in `f64`
    /// (measured), and in `f32` it is larger as its rounding is. Where there are more states, prefer the steady
    /// Kalman gain.
    ///
    /// Errors, after which nothing has changed: [`Error::NotObservable`] if, by this arithmetic, the output tells no
    /// more of some combination of states than rounding does (whatever the units of the states);
    /// [`Error::OutOfRange`] if a pole is not inside the unit circle, or lacks its conjugate beside it;
    /// [`Error::NotFinite`]; [`Error::Overflow`]; [`Error::Length`] (only with `Dyn`).
    ///
    /// Source: Datta, An algorithm to assign eigenvalues in a Hessenberg matrix: single input case, 1987, on the
    /// dual pair.
    pub fn place<U: Dimension>(
        &mut self,
        transition: &impl Transition<T, N, U>,
        observation: &impl Observation<T, N, M, U>,
        input: &OVector<T, U>,
        weights: &OVector<T, M>,
        poles: &OVector<Complex<T>, N>,
    ) -> Result<(), Error> {
        let (n, m) = self.gain.shape();
        check_finite("input", input.as_slice())?;
        check_entries("weights", weights.as_slice(), m)?;
        check_length("poles", n, poles.len())?;
        Self::check_poles(poles)?;
        let state_matrix = transition.next_jacobian(&self.state, input);
        check_length("transition Jacobian", n, state_matrix.nrows())?;
        check_entries("transition Jacobian", state_matrix.as_slice(), n * n)?;
        let output_matrix = observation.output_jacobian(&self.state, input);
        check_length("observation Jacobian", m, output_matrix.nrows())?;
        check_entries("observation Jacobian", output_matrix.as_slice(), m * n)?;

        let size = self.state.shape_generic().0;
        let mut vectors = [T::zero(); 4].map(|zero| size.vector(zero));
        let mut squares = [transpose(&state_matrix), size.square(T::zero())];
        let [feedback, scales, subdiagonals, work] = vectors.each_mut().map(|vector| vector.as_mut_slice());
        let [dual, reflections] = squares.each_mut().map(|square| square.as_mut_slice());
        add_product(transpose(&output_matrix).as_slice(), weights.as_slice(), feedback);
        balance(dual, feedback, scales, [subdiagonals, work]);
        place(dual, reflections, subdiagonals, work, feedback, poles.as_slice())?;
        for (entry, &scale) in feedback.iter_mut().zip(&*scales) {
            *entry /= scale;
        }
        let mut gain = self.gain.clone();
        for (index, &weight) in weights.as_slice().iter().enumerate() {
            let target = column_mut(gain.as_mut_slice(), n, index);
            target.fill(T::zero());
            add_multiple(target, weight, feedback);
        }
        if !gain.as_slice().iter().all(T::is_finite) {
            return Err(Error::Overflow);
        }
        self.gain = gain;
        Ok(())
    }

    /// Checks poles as [`place`](LuenbergerObserver::place) does: for a gain that is placed later, at each estimate.
    ///
    /// Errors: [`Error::OutOfRange`] if a pole is not inside the unit circle, or lacks its conjugate beside it;
    /// [`Error::NotFinite`].
    pub fn check_poles(poles: &OVector<Complex<T>, N>) -> Result<(), Error> {
        let poles = poles.as_slice();
        if !poles.iter().all(|pole| pole.re.is_finite() && pole.im.is_finite()) {
            return Err(Error::NotFinite { argument: "poles" });
        }
        // Not the sum of squares: that overflows.
        let inside = |pole: &Complex<T>| {
            pole.re.abs() < T::one()
                && pole.im.abs() < T::one()
                && pole.re * pole.re + pole.im * pole.im < T::one()
        };
        if !poles.iter().all(inside) {
            return Err(Error::OutOfRange { argument: "poles", range: "inside the unit circle" });
        }
        let mut rest = poles.iter();
        while let Some(pole) = rest.next() {
            let beside = |next: &Complex<T>| next.re == pole.re && next.im == -pole.im;
            if !pole.im.is_zero() && !rest.next().is_some_and(beside) {
                return Err(Error::OutOfRange {
                    argument: "poles",
                    range: "real, or conjugate pairs side by side",
                });
            }
        }
        Ok(())
    }

    /// One sample ahead, with u(k) and y(k).
    ///
    /// A NaN in the measurement is a missing element: its error counts as 0. The innovation has the errors
    /// y - h(x̂, u); an observer knows no variances, so `variance` is NaN and `nis` 0.
    ///
    /// Errors, after which nothing has changed: [`Error::Infinite`] if the measurement is;
    /// [`Error::NotFinite`] if an input, a predicted measurement or the next state is NaN or infinite;
    /// [`Error::TooLarge`] if the measurement makes numbers overflow; [`Error::Length`] (only with `Dyn`). The
    /// model's functions, and n m multiply-adds.
    #[inline]
    pub fn update<U: Dimension>(
        &mut self,
        transition: &impl Transition<T, N, U>,
        observation: &impl Observation<T, N, M, U>,
        input: &OVector<T, U>,
        measurement: &OVector<T, M>,
    ) -> Result<Innovation<T, OVector<T, M>>, Error> {
        let (n, m) = self.gain.shape();
        check_finite("input", input.as_slice())?;
        let error = prediction_error(measurement, observation.output(&self.state, input))?;
        check_length("predicted measurement", m, error.len())?;
        let mut next = transition.next(&self.state, input);
        check_entries("next state", next.as_slice(), n)?;
        let mut action = Action::Missing;
        for (index, &error) in error.as_slice().iter().enumerate().filter(|(_, error)| !is_missing(*error)) {
            add_multiple(next.as_mut_slice(), error, column(self.gain.as_slice(), n, index));
            action = Action::Updated;
        }
        if !next.as_slice().iter().all(T::is_finite) {
            return Err(Error::TooLarge { argument: "measurement" });
        }
        self.state = next;
        let variance = error.shape_generic().0.vector(T::NAN);
        Ok(Innovation { error, variance, nis: T::zero(), action })
    }
}

/// Replaces A by S⁻¹ A S and b by S⁻¹ b, where S is diagonal, so that the result does not depend on the units of the
/// states:
///
/// ```text
/// s = max over k < n of |A|^k |b|,   element by element
/// ```
///
/// Each s is rounded down to a power of two, so that the scaling itself rounds nothing. One that is 0 (what b never
/// reaches) or overflows becomes 1; and all are 1 where they lie within a factor of 1024 of one another, where scaling
/// gains nothing.
fn balance<T: Real>(matrix: &mut [T], vector: &mut [T], scales: &mut [T], [next, reach]: [&mut [T]; 2]) {
    let n = vector.len();
    for ((scale, reach), entry) in scales.iter_mut().zip(&mut *reach).zip(&*vector) {
        *reach = entry.abs();
        *scale = *reach;
    }
    for _ in 1..n {
        next.fill(T::zero());
        for (k, &weight) in reach.iter().enumerate() {
            for (next, entry) in next.iter_mut().zip(column(matrix, n, k)) {
                *next += entry.abs() * weight;
            }
        }
        for ((scale, reach), &next) in scales.iter_mut().zip(&mut *reach).zip(&*next) {
            *reach = next;
            *scale = scale.max(next);
        }
    }
    for scale in &mut *scales {
        let regular = *scale >= T::MIN_POSITIVE && *scale < T::INFINITY;
        *scale = if regular { power_of_two(*scale) } else { T::one() };
    }
    let smallest = scales.iter().fold(T::INFINITY, |smallest, &scale| smallest.min(scale));
    if scales.iter().all(|&scale| scale / T::from_count(1024) <= smallest) {
        scales.fill(T::one());
    }
    for (entry, &scale) in vector.iter_mut().zip(&*scales) {
        *entry /= scale;
    }
    for (k, &own) in scales.iter().enumerate() {
        for (entry, &scale) in column_mut(matrix, n, k).iter_mut().zip(&*scales) {
            *entry = *entry / scale * own;
        }
    }
}

/// The largest power of two that is not above `x`, which is positive and finite.
fn power_of_two<T: Real>(x: T) -> T {
    let (mut power, two) = (T::one(), T::from_count(2));
    while power > x {
        power /= two;
    }
    while power <= x / two {
        power *= two;
    }
    power
}

/// Replaces b by k, such that A - b k' has these eigenvalues. `matrix` holds A and is used up; the others are
/// n x n, n and n numbers of any content.
///
/// ```text
/// P b = h_0 e_1,   P A P' = M, upper Hessenberg, with h_i = M_(i+1),i
/// l = e_n;   for each pole λ, i = n - 1 … 0:   l <- (M' - λ) l / h_i;   k = P'l
/// ```
///
/// This is Ackermann's formula, k' = e_n' \[b Ab … A^(n-1) b\]⁻¹ φ(A), with a triangular matrix to be inverted. A
/// conjugate pair a ± ib takes two steps at once: (M' - λ)(M' - λ*) = (M' - a)² + b².
fn place<T: Real>(
    matrix: &mut [T],
    reflections: &mut [T],
    subdiagonals: &mut [T],
    work: &mut [T],
    vector: &mut [T],
    poles: &[Complex<T>],
) -> Result<(), Error> {
    let n = vector.len();
    let largest = matrix.iter().fold(T::zero(), |largest, entry| largest.max(entry.abs()));
    if !largest.is_finite() {
        return Err(Error::Overflow);
    }
    let least = largest * T::EPSILON * T::from_count(8 * n);
    for (index, subdiagonal) in subdiagonals.iter_mut().enumerate() {
        let reflection = column_mut(reflections, n, index);
        let source = if index == 0 { &*vector } else { column(matrix, n, index - 1) };
        for (row, (target, &entry)) in reflection.iter_mut().zip(source).enumerate() {
            *target = if row < index { T::zero() } else { entry };
        }
        *subdiagonal = make_reflection(reflection, index);
        let bound = if index == 0 { T::zero() } else { least };
        if subdiagonal.abs() <= bound {
            return Err(Error::NotObservable { rank: index, states: n });
        }
        work.fill(T::zero());
        for (k, &entry) in reflection.iter().enumerate() {
            reflect(reflection, column_mut(matrix, n, k));
            add_multiple(work, entry + entry, column(matrix, n, k));
        }
        for (k, &entry) in reflection.iter().enumerate() {
            add_multiple(column_mut(matrix, n, k), -entry, work);
        }
    }

    for (index, entry) in vector.iter_mut().enumerate() {
        *entry = if index + 1 == n { T::one() } else { T::zero() };
    }
    let mut divisors = subdiagonals.iter().rev().copied();
    let mut poles = poles.iter();
    while let (Some(pole), Some(divisor)) = (poles.next(), divisors.next()) {
        for (k, target) in work.iter_mut().enumerate() {
            *target = (dot(column(matrix, n, k), vector) - pole.re * at(vector, k)) / divisor;
        }
        if pole.im.is_zero() {
            ud::copy(work, vector);
            continue;
        }
        poles.next();
        let (square, divisor) = (pole.im * pole.im / divisor, divisors.next().unwrap_or(T::one()));
        for (k, target) in vector.iter_mut().enumerate() {
            let product = dot(column(matrix, n, k), work) - pole.re * at(work, k);
            *target = (product + square * *target) / divisor;
        }
    }
    for index in (0..n).rev() {
        reflect(column(reflections, n, index), vector);
    }
    Ok(())
}

fn at<T: Real>(values: &[T], index: usize) -> T {
    values.get(index).copied().unwrap_or(T::zero())
}

/// Turns x, whose entries before `index` are 0, into the v, of length 1 or 0, with (I - 2 v v') x = h e_index.
/// Returns h.
///
/// Source: Golub and Van Loan, Matrix Computations, 4th ed., section 5.1.
fn make_reflection<T: Real>(x: &mut [T], index: usize) -> T {
    let largest = x.iter().fold(T::zero(), |largest, entry| largest.max(entry.abs()));
    if largest < T::MIN_POSITIVE {
        x.fill(T::zero());
        return T::zero();
    }
    for entry in x.iter_mut() {
        *entry /= largest;
    }
    let length = dot(x, x).sqrt();
    let Some(leading) = x.get_mut(index) else {
        return T::zero();
    };
    // Away from 0, so that nothing cancels.
    let signed = length.copysign(*leading);
    *leading += signed;
    let length = dot(x, x).sqrt();
    for entry in x.iter_mut() {
        *entry /= length;
    }
    -(signed * largest)
}

/// x <- (I - 2 v v') x.
fn reflect<T: Real>(v: &[T], x: &mut [T]) {
    let twice = dot(v, x) + dot(v, x);
    add_multiple(x, -twice, v);
}

#[cfg(feature = "serde")]
mod snapshot;
#[cfg(test)]
mod tests;
