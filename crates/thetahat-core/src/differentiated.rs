//! Models that are written as one function, and differentiated exactly.

use nalgebra::{ArrayStorage, SVector};
use nalgebra::{Const, Matrix, OMatrix, OVector};

use crate::{Covariance, Dual, Number, Observation, Real, Transition};

/// A transition, written as one function of any [`Number`].
///
/// ```text
/// x(k+1) = f(x(k), u(k), w(k))          w ~ (0, Q_w), white
/// ```
///
/// N is the number of states, W that of noises, U that of inputs. [`Differentiated`] makes a [`Transition`] of it.
///
/// ```
/// use thetahat_core::nalgebra::{SVector, Vector1, Vector2};
/// use thetahat_core::{Covariance, Differentiated, Error, Number, Transition, TransitionFunction};
///
/// /// A cart with friction, on which a random force acts: position and speed, every 0.1 s.
/// struct Cart;
///
/// impl TransitionFunction<f64, 2, 1> for Cart {
///     fn next<S: Number<f64>>(&self, [position, speed]: [S; 2], _: [S; 0], [force]: [S; 1]) -> [S; 2] {
///         [position + speed * 0.1, speed * 0.9 + force * 0.1]
///     }
/// }
///
/// let cart = Differentiated::new(Cart, Covariance::from_diagonal(&Vector1::new(4.0))?);
/// let noise = cart.process_noise(&Vector2::zeros(), &SVector::<f64, 0>::zeros());
/// assert!((noise.variances() - Vector2::new(0.0, 0.04)).amax() < 1e-15);
/// # Ok::<(), Error>(())
/// ```
pub trait TransitionFunction<T: Real, const N: usize, const W: usize, const U: usize = 0> {
    /// f(x, u, w).
    fn next<S: Number<T>>(&self, state: [S; N], input: [S; U], noise: [S; W]) -> [S; N];
}

/// An observation, written as one function of any [`Number`].
///
/// ```text
/// y(k) = h(x(k), u(k), v(k))          v ~ (0, R_v), white
/// ```
///
/// N is the number of states, M that of elements of a measurement, V that of noises, U that of inputs.
/// [`Differentiated`] makes an [`Observation`] of it.
///
/// ```
/// use thetahat_core::nalgebra::{RowVector2, SVector, Vector1, Vector2};
/// use thetahat_core::{Covariance, Differentiated, Error, Number, Observation, ObservationFunction};
///
/// /// The distance of a point from the origin, with an error of the sensor.
/// struct Distance;
///
/// impl ObservationFunction<f64, 2, 1, 1> for Distance {
///     fn output<S: Number<f64>>(&self, [x, y]: [S; 2], _: [S; 0], [error]: [S; 1]) -> [S; 1] {
///         [(x * x + y * y).sqrt() + error]
///     }
/// }
///
/// let sensor = Differentiated::new(Distance, Covariance::from_diagonal(&Vector1::new(0.01))?);
/// let found = sensor.output_jacobian(&Vector2::new(3.0, 4.0), &SVector::<f64, 0>::zeros());
/// assert!((found - RowVector2::new(0.6, 0.8)).amax() < 1e-15);
/// # Ok::<(), Error>(())
/// ```
pub trait ObservationFunction<T: Real, const N: usize, const M: usize, const V: usize, const U: usize = 0> {
    /// h(x, u, v).
    fn output<S: Number<T>>(&self, state: [S; N], input: [S; U], noise: [S; V]) -> [S; M];
}

impl<T: Real, const N: usize, const W: usize, const U: usize, F: TransitionFunction<T, N, W, U>>
    TransitionFunction<T, N, W, U> for &F
{
    fn next<S: Number<T>>(&self, state: [S; N], input: [S; U], noise: [S; W]) -> [S; N] {
        (**self).next(state, input, noise)
    }
}

impl<
    T: Real,
    const N: usize,
    const M: usize,
    const V: usize,
    const U: usize,
    F: ObservationFunction<T, N, M, V, U>,
> ObservationFunction<T, N, M, V, U> for &F
{
    fn output<S: Number<T>>(&self, state: [S; N], input: [S; U], noise: [S; V]) -> [S; M] {
        (**self).output(state, input, noise)
    }
}

/// A model written as one function, with Jacobians from [`Dual`] numbers.
///
/// ```text
/// F = ∂f/∂x,     Γ = ∂f/∂w,     Q = Γ Q_w Γ',          H = ∂h/∂x,     V = ∂h/∂v,     R = V R_v V'
/// ```
///
/// at x, u and no noise. So the noise may enter anywhere, and the Jacobians are exact but for rounding. It is a
/// [`Transition`] if the function is a [`TransitionFunction`], and an [`Observation`] if it is an
/// [`ObservationFunction`]. A type that is both is wrapped twice, by reference, as its noises are two.
///
/// Unknown parameters are estimated as states: let the function take them as such and return them as they are.
///
/// Cost, beside the function itself: the function once with [`Dual`] numbers of N derivatives, and once with W
/// (V) of them.
///
/// ```
/// use thetahat_core::nalgebra::{Const, Matrix1, SVector, Vector1, Vector2};
/// use thetahat_core::{
///     Covariance, Differentiated, Error, ExtendedKalmanFilter, Number, ObservationFunction, TransitionFunction,
/// };
///
/// /// A pendulum, its angle in rad and its rate in rad/s. The torque on it is noise, in rad/s². It is seen by the
/// /// sideways position of its end, in m.
/// struct Pendulum {
///     sample_time: f64,
/// }
///
/// impl TransitionFunction<f64, 2, 1> for Pendulum {
///     fn next<S: Number<f64>>(&self, [angle, rate]: [S; 2], _: [S; 0], [torque]: [S; 1]) -> [S; 2] {
///         let acceleration = torque - angle.sin() * 9.81;
///         [angle + rate * self.sample_time, rate + acceleration * self.sample_time]
///     }
/// }
///
/// impl ObservationFunction<f64, 2, 1, 1> for Pendulum {
///     fn output<S: Number<f64>>(&self, [angle, _]: [S; 2], _: [S; 0], [error]: [S; 1]) -> [S; 1] {
///         [angle.sin() + error]
///     }
/// }
///
/// let pendulum = Pendulum { sample_time: 0.02 };
/// let motion = Differentiated::new(&pendulum, Covariance::from_diagonal(&Vector1::new(0.0))?);
/// let camera = Differentiated::new(&pendulum, Covariance::from_diagonal(&Vector1::new(1e-4))?);
///
/// let none = SVector::zeros(); // no inputs
/// let mut truth = [0.8, 0.0];
/// let prior = Covariance::from_diagonal(&Vector2::new(0.1, 0.1))?;
/// let mut filter = ExtendedKalmanFilter::new(Vector2::new(0.5, 0.3), prior)?;
/// for _ in 0..200 {
///     truth = pendulum.next(truth, [], [0.0]);
///     filter.predict(&motion, &none)?;
///     filter.correct(&camera, &none, &Vector1::new(truth[0].sin()))?;
/// }
/// assert!((filter.state() - Vector2::from(truth)).amax() < 2e-3);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Differentiated<F, T: Real, const W: usize> {
    function: F,
    noise: Covariance<T, Const<W>>,
}

impl<F, T: Real, const W: usize> Differentiated<F, T, W> {
    /// The model with this function, and the covariance of the noise that enters it: Q_w, or R_v.
    pub fn new(function: F, noise: Covariance<T, Const<W>>) -> Self {
        Differentiated { function, noise }
    }

    /// The function.
    pub fn function(&self) -> &F {
        &self.function
    }
}

impl<F, T, const N: usize, const W: usize, const U: usize> Transition<T, Const<N>, Const<U>>
    for Differentiated<F, T, W>
where
    F: TransitionFunction<T, N, W, U>,
    T: Real,
{
    fn next(&self, state: &SVector<T, N>, input: &SVector<T, U>) -> SVector<T, N> {
        vector(self.function.next(numbers(state), numbers(input), [T::zero(); W]))
    }

    fn next_jacobian(&self, state: &SVector<T, N>, input: &SVector<T, U>) -> OMatrix<T, Const<N>, Const<N>> {
        let next =
            self.function.next(Dual::variables(numbers(state)), constants(input), [T::zero().into(); W]);
        jacobian(next)
    }

    fn process_noise(&self, state: &SVector<T, N>, input: &SVector<T, U>) -> Covariance<T, Const<N>> {
        let next = self.function.next(constants(state), constants(input), Dual::variables([T::zero(); W]));
        entering(&self.noise, next)
    }
}

impl<F, T, const N: usize, const M: usize, const V: usize, const U: usize>
    Observation<T, Const<N>, Const<M>, Const<U>> for Differentiated<F, T, V>
where
    F: ObservationFunction<T, N, M, V, U>,
    T: Real,
{
    fn output(&self, state: &SVector<T, N>, input: &SVector<T, U>) -> SVector<T, M> {
        vector(self.function.output(numbers(state), numbers(input), [T::zero(); V]))
    }

    fn output_jacobian(
        &self,
        state: &SVector<T, N>,
        input: &SVector<T, U>,
    ) -> OMatrix<T, Const<M>, Const<N>> {
        let output =
            self.function.output(Dual::variables(numbers(state)), constants(input), [T::zero().into(); V]);
        jacobian(output)
    }

    fn measurement_noise(&self, state: &SVector<T, N>, input: &SVector<T, U>) -> Covariance<T, Const<M>> {
        let output =
            self.function.output(constants(state), constants(input), Dual::variables([T::zero(); V]));
        entering(&self.noise, output)
    }
}

fn numbers<T: Real, const N: usize>(vector: &SVector<T, N>) -> [T; N] {
    let [numbers] = vector.data.0;
    numbers
}

fn constants<T: Real, const N: usize, const D: usize>(vector: &SVector<T, N>) -> [Dual<T, D>; N] {
    numbers(vector).map(Dual::from)
}

fn vector<T: Real, const N: usize>(numbers: [T; N]) -> SVector<T, N> {
    OVector::from_data(ArrayStorage([numbers]))
}

/// The derivatives of each element, as the rows of a matrix.
fn jacobian<T: Real, const M: usize, const N: usize>(
    elements: [Dual<T, N>; M],
) -> OMatrix<T, Const<M>, Const<N>> {
    let mut columns = [[T::zero(); M]; N];
    for (index, column) in columns.iter_mut().enumerate() {
        for (entry, element) in column.iter_mut().zip(&elements) {
            *entry = element.derivatives.get(index).copied().unwrap_or(T::zero());
        }
    }
    Matrix::from_data(ArrayStorage(columns))
}

/// The covariance of what the noise adds to these elements, which have their derivatives with respect to it.
/// NaN where that is not finite: a filter then refuses it.
fn entering<T: Real, const M: usize, const W: usize>(
    noise: &Covariance<T, Const<W>>,
    elements: [Dual<T, W>; M],
) -> Covariance<T, Const<M>> {
    noise.transformed(&jacobian(elements)).unwrap_or(Covariance::unknown(Const))
}

#[cfg(test)]
mod tests;
