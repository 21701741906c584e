//! Models with unknown parameters, as models with a larger state.

use nalgebra::{Const, OMatrix, OVector};

use crate::error::check_length;
use crate::triangle::{column, column_mut};
use crate::{Covariance, Dimension, Error, Observation, Real, Transition, ud};

/// A transition that depends on unknown parameters θ.
///
/// ```text
/// x(k+1) = f(x(k), θ, u(k)) + w(k)          w ~ (0, Q), white
/// ```
///
/// X is the number of states, P that of parameters, U that of inputs. [`Augmented`] makes a [`Transition`] of it.
///
/// ```
/// use thetahat_core::nalgebra::{Const, Matrix1, Matrix2, SVector, Vector1, Vector2};
/// use thetahat_core::{Augmented, Covariance, Error, ParametricTransition, Transition};
///
/// /// A capacitor that leaks at an unknown rate: x(k+1) = θ x(k).
/// struct Leak;
/// type Numbers<'a> = &'a Vector1<f64>;
/// type None<'a> = &'a SVector<f64, 0>;
///
/// impl ParametricTransition<f64, Const<1>, Const<1>> for Leak {
///     fn next(&self, x: Numbers, rate: Numbers, _: None) -> Vector1<f64> {
///         rate * x[0]
///     }
///     fn next_jacobian(&self, _: Numbers, rate: Numbers, _: None) -> Matrix1<f64> {
///         *rate
///     }
///     fn next_parameter_jacobian(&self, x: Numbers, _: Numbers, _: None) -> Matrix1<f64> {
///         *x
///     }
///     fn process_noise(&self, _: Numbers, _: Numbers, _: None) -> Covariance<f64, Const<1>> {
///         Covariance::zero(Const)
///     }
/// }
///
/// let model: Augmented<_, f64, Const<2>, _, _> = Augmented::new(Leak, Const::<1>, Const::<1>)?;
/// let found = model.next_jacobian(&Vector2::new(2.0, 0.9), &SVector::zeros());
/// assert_eq!(found, Matrix2::new(0.9, 2.0, 0.0, 1.0));
/// # Ok::<(), Error>(())
/// ```
pub trait ParametricTransition<
    T: Real,
    X: Dimension + Dimension<P>,
    P: Dimension + Dimension<X>,
    U: Dimension = Const<0>,
>
{
    /// f(x, θ, u).
    fn next(&self, state: &OVector<T, X>, parameters: &OVector<T, P>, input: &OVector<T, U>)
    -> OVector<T, X>;

    /// ∂f/∂x, X x X.
    fn next_jacobian(
        &self,
        state: &OVector<T, X>,
        parameters: &OVector<T, P>,
        input: &OVector<T, U>,
    ) -> OMatrix<T, X, X>;

    /// ∂f/∂θ, X x P.
    fn next_parameter_jacobian(
        &self,
        state: &OVector<T, X>,
        parameters: &OVector<T, P>,
        input: &OVector<T, U>,
    ) -> OMatrix<T, X, P>;

    /// Q, the covariance of what the noise adds to the next state, X x X.
    fn process_noise(
        &self,
        state: &OVector<T, X>,
        parameters: &OVector<T, P>,
        input: &OVector<T, U>,
    ) -> Covariance<T, X>;
}

/// An observation that depends on unknown parameters θ.
///
/// ```text
/// y(k) = h(x(k), θ, u(k)) + v(k)          v ~ (0, R), white
/// ```
///
/// X is the number of states, P that of parameters, M that of elements of a measurement, U that of inputs.
/// [`Augmented`] makes an [`Observation`] of it. [`WithoutParameters`] makes one of an `Observation`.
///
/// ```
/// use thetahat_core::nalgebra::{Const, Matrix1, RowVector2, SVector, Vector1, Vector2};
/// use thetahat_core::{Augmented, Covariance, Error, Observation, ParametricObservation};
///
/// /// A gauge with an unknown offset: y = x + θ.
/// struct Gauge;
/// type Numbers<'a> = &'a Vector1<f64>;
/// type None<'a> = &'a SVector<f64, 0>;
///
/// impl ParametricObservation<f64, Const<1>, Const<1>, Const<1>> for Gauge {
///     fn output(&self, x: Numbers, offset: Numbers, _: None) -> Vector1<f64> {
///         x + offset
///     }
///     fn output_jacobian(&self, _: Numbers, _: Numbers, _: None) -> Matrix1<f64> {
///         Matrix1::new(1.0)
///     }
///     fn output_parameter_jacobian(&self, _: Numbers, _: Numbers, _: None) -> Matrix1<f64> {
///         Matrix1::new(1.0)
///     }
///     fn measurement_noise(&self, _: Numbers, _: Numbers, _: None) -> Covariance<f64, Const<1>> {
///         Covariance::zero(Const)
///     }
/// }
///
/// let model: Augmented<_, f64, Const<2>, _, _> = Augmented::new(Gauge, Const::<1>, Const::<1>)?;
/// let (z, none) = (Vector2::new(2.0, 0.5), SVector::zeros());
/// assert_eq!((model.output(&z, &none), model.output_jacobian(&z, &none)), (Vector1::new(2.5), RowVector2::new(1.0, 1.0)));
/// # Ok::<(), Error>(())
/// ```
pub trait ParametricObservation<
    T: Real,
    X: Dimension + Dimension<M>,
    P: Dimension + Dimension<M>,
    M: Dimension + Dimension<X> + Dimension<P>,
    U: Dimension = Const<0>,
>
{
    /// h(x, θ, u).
    fn output(
        &self,
        state: &OVector<T, X>,
        parameters: &OVector<T, P>,
        input: &OVector<T, U>,
    ) -> OVector<T, M>;

    /// ∂h/∂x, M x X.
    fn output_jacobian(
        &self,
        state: &OVector<T, X>,
        parameters: &OVector<T, P>,
        input: &OVector<T, U>,
    ) -> OMatrix<T, M, X>;

    /// ∂h/∂θ, M x P.
    fn output_parameter_jacobian(
        &self,
        state: &OVector<T, X>,
        parameters: &OVector<T, P>,
        input: &OVector<T, U>,
    ) -> OMatrix<T, M, P>;

    /// R, the covariance of what the noise adds to the measurement, M x M.
    fn measurement_noise(
        &self,
        state: &OVector<T, X>,
        parameters: &OVector<T, P>,
        input: &OVector<T, U>,
    ) -> Covariance<T, M>;
}

/// An observation that depends on no parameter, as a [`ParametricObservation`]: for [`Augmented`].
///
/// ```
/// use thetahat_core::nalgebra::{Const, Matrix1, RowVector2, SVector, Vector2};
/// use thetahat_core::{Augmented, Covariance, Error, LinearObservation, Observation, WithoutParameters};
///
/// let gauge = LinearObservation::new(Matrix1::new(3.0), Covariance::<f64, Const<1>>::zero(Const))?;
/// let model: Augmented<_, f64, Const<2>, _, _> =
///     Augmented::new(WithoutParameters(gauge), Const::<1>, Const::<1>)?;
/// let found = model.output_jacobian(&Vector2::new(2.0, 0.5), &SVector::zeros());
/// assert_eq!(found, RowVector2::new(3.0, 0.0)); // the parameter is not seen
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WithoutParameters<O>(pub O);

impl<T, X, P, M, U, O> ParametricObservation<T, X, P, M, U> for WithoutParameters<O>
where
    T: Real,
    X: Dimension + Dimension<M>,
    P: Dimension + Dimension<M>,
    M: Dimension + Dimension<X> + Dimension<P>,
    U: Dimension,
    O: Observation<T, X, M, U>,
{
    fn output(&self, state: &OVector<T, X>, _: &OVector<T, P>, input: &OVector<T, U>) -> OVector<T, M> {
        self.0.output(state, input)
    }

    fn output_jacobian(
        &self,
        state: &OVector<T, X>,
        _: &OVector<T, P>,
        input: &OVector<T, U>,
    ) -> OMatrix<T, M, X> {
        self.0.output_jacobian(state, input)
    }

    fn output_parameter_jacobian(
        &self,
        state: &OVector<T, X>,
        parameters: &OVector<T, P>,
        input: &OVector<T, U>,
    ) -> OMatrix<T, M, P> {
        let rows = self.0.output(state, input).shape_generic().0;
        rows.rows_by(parameters.shape_generic().0, T::zero())
    }

    fn measurement_noise(
        &self,
        state: &OVector<T, X>,
        _: &OVector<T, P>,
        input: &OVector<T, U>,
    ) -> Covariance<T, M> {
        self.0.measurement_noise(state, input)
    }
}

/// A model with unknown parameters, as a model with a larger state: so that a filter estimates both.
///
/// ```text
/// z = [x; θ]:     x(k+1) = f(x(k), θ(k), u(k)) + w(k),     θ(k+1) = θ(k) + w_θ(k),     y(k) = h(x, θ, u) + v(k)
///
/// F = [ ∂f/∂x  ∂f/∂θ ]        H = [ ∂h/∂x  ∂h/∂θ ]        Q = [ Q_x   0  ]
///     [   0      I   ]                                        [  0   Q_θ ]
/// ```
///
/// The parameters walk at random with covariance Q_θ a sample: 0 at first, for parameters that are constant, which
/// makes the filter more and more sure of them; more, for parameters that drift. It is a [`Transition`] if the
/// model is a [`ParametricTransition`], and an [`Observation`] if it is a [`ParametricObservation`].
///
/// Such an estimate may be biased or diverge: see [`ExtendedKalmanFilter`](crate::ExtendedKalmanFilter).
///
/// With `Dyn`, an answer of the model that has the wrong size becomes NaN, which a filter refuses.
///
/// N is X + P, the number of states and parameters: what is checked when it is built, as the sum of two sizes is no
/// type. Memory: that of the model, and P² numbers.
///
/// Source: Jazwinski, Stochastic Processes and Filtering Theory, 1970, section 8.4; Ljung and Söderström, Theory
/// and Practice of Recursive Identification, 1983, section 2.4.
///
/// ```
/// use thetahat_core::nalgebra::{Const, Matrix1, Vector1, Vector2};
/// use thetahat_core::{
///     Augmented, Covariance, Error, ExtendedKalmanFilter, LinearObservation, ParametricTransition,
///     WithoutParameters,
/// };
///
/// /// A first-order plant with an unknown pole: x(k+1) = θ x(k) + u(k).
/// struct Pole;
/// type Numbers<'a> = &'a Vector1<f64>;
///
/// impl ParametricTransition<f64, Const<1>, Const<1>, Const<1>> for Pole {
///     fn next(&self, x: Numbers, pole: Numbers, u: Numbers) -> Vector1<f64> {
///         Vector1::new(pole[0] * x[0] + u[0])
///     }
///     fn next_jacobian(&self, _: Numbers, pole: Numbers, _: Numbers) -> Matrix1<f64> {
///         *pole
///     }
///     fn next_parameter_jacobian(&self, x: Numbers, _: Numbers, _: Numbers) -> Matrix1<f64> {
///         *x
///     }
///     fn process_noise(&self, _: Numbers, _: Numbers, _: Numbers) -> Covariance<f64, Const<1>> {
///         Covariance::zero(Const)
///     }
/// }
///
/// let plant = Augmented::new(Pole, Const::<1>, Const::<1>)?;
/// let noise: Covariance<f64, Const<1>> = Covariance::from_diagonal(&Vector1::new(1e-4))?;
/// let sensor = LinearObservation::new(Vector1::new(1.0), noise)?.with_input(Vector1::new(0.0))?;
/// let sensor = Augmented::new(WithoutParameters(sensor), Const::<1>, Const::<1>)?;
///
/// // The state starts at 0, the pole at 0.5 ± 0.5.
/// let prior = Covariance::from_diagonal(&Vector2::new(0.0, 0.25))?;
/// let mut filter = ExtendedKalmanFilter::new(Vector2::new(0.0, 0.5), prior)?;
/// let mut truth = 0.0;
/// for k in 0..50 {
///     let u = Vector1::new(if k % 10 < 5 { 1.0 } else { -1.0 });
///     truth = 0.8 * truth + u[0];
///     filter.predict(&plant, &u)?;
///     filter.correct(&sensor, &u, &Vector1::new(truth))?;
/// }
/// assert!((filter.state() - Vector2::new(truth, 0.8)).amax() < 1e-3);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Augmented<A, T: Real, N, X, P: Dimension> {
    model: A,
    size: N,
    states: X,
    walk: Covariance<T, P>,
}

impl<A, T: Real, N: Dimension, X: Dimension, P: Dimension> Augmented<A, T, N, X, P> {
    /// The model with this many states and parameters (`Const::<2>`, or `Dyn(2)` with the feature `alloc`), which
    /// do not change in time.
    ///
    /// Errors: [`Error::Length`] if N is not their sum, or that is not a `usize`.
    pub fn new(model: A, states: X, parameters: P) -> Result<Self, Error> {
        let length = |expected, found| Error::Length { argument: "augmented state", expected, found };
        let sum = states.value().checked_add(parameters.value());
        let sum = sum.ok_or_else(|| length(usize::MAX, states.value()))?;
        let size = N::exactly(sum).map_err(|found| length(sum, found))?;
        Ok(Augmented { model, size, states, walk: Covariance::zero(parameters) })
    }

    /// The same with parameters that walk at random: Q_θ is what each sample adds to their covariance.
    ///
    /// Errors: [`Error::Length`] (only with `Dyn`).
    pub fn with_walk(mut self, walk: Covariance<T, P>) -> Result<Self, Error> {
        self.set_walk(walk)?;
        Ok(self)
    }

    /// Sets how the parameters walk: see [`with_walk`](Augmented::with_walk), whose errors it has.
    pub fn set_walk(&mut self, walk: Covariance<T, P>) -> Result<(), Error> {
        check_length("walk", self.walk.size().value(), walk.size().value())?;
        self.walk = walk;
        Ok(())
    }

    /// The model.
    pub fn model(&self) -> &A {
        &self.model
    }

    /// Makes a filter refuse what a model answered in the wrong size, which only `Dyn` allows.
    fn refuse_unless(&self, fits: bool, answer: &mut [T]) {
        if !fits {
            answer.fill(T::NAN);
        }
    }

    /// x and θ.
    fn split(&self, state: &OVector<T, N>) -> (OVector<T, X>, OVector<T, P>) {
        let mut states = self.states.vector(T::zero());
        let mut parameters = self.walk.size().vector(T::zero());
        ud::copy(state.as_slice(), states.as_mut_slice());
        ud::copy(state.as_slice().get(self.states.value()..).unwrap_or_default(), parameters.as_mut_slice());
        (states, parameters)
    }
}

impl<A, T, N, X, P, U> Transition<T, N, U> for Augmented<A, T, N, X, P>
where
    A: ParametricTransition<T, X, P, U>,
    T: Real,
    N: Dimension,
    X: Dimension + Dimension<P>,
    P: Dimension + Dimension<X>,
    U: Dimension,
{
    fn next(&self, state: &OVector<T, N>, input: &OVector<T, U>) -> OVector<T, N> {
        let (states, parameters) = self.split(state);
        let next_states = self.model.next(&states, &parameters, input);
        let mut next = state.clone();
        ud::copy(next_states.as_slice(), next.as_mut_slice());
        self.refuse_unless(next_states.len() == self.states.value(), next.as_mut_slice());
        next
    }

    fn next_jacobian(&self, state: &OVector<T, N>, input: &OVector<T, U>) -> OMatrix<T, N, N> {
        let (x, n) = (self.states.value(), self.size.value());
        let (states, parameters) = self.split(state);
        let by_state = self.model.next_jacobian(&states, &parameters, input);
        let by_parameter = self.model.next_parameter_jacobian(&states, &parameters, input);
        let mut jacobian = self.size.square(T::zero());
        for index in 0..n {
            let target = column_mut(jacobian.as_mut_slice(), n, index);
            if index < x {
                ud::copy(column(by_state.as_slice(), x, index), target);
            } else {
                ud::copy(column(by_parameter.as_slice(), x, index - x), target);
                if let Some(diagonal) = target.get_mut(index) {
                    *diagonal = T::one();
                }
            }
        }
        let fits = by_state.len() == x * x && by_parameter.len() == x * (n - x);
        self.refuse_unless(fits, jacobian.as_mut_slice());
        jacobian
    }

    fn process_noise(&self, state: &OVector<T, N>, input: &OVector<T, U>) -> Covariance<T, N> {
        let (states, parameters) = self.split(state);
        Covariance::block_diagonal(
            self.size,
            &self.model.process_noise(&states, &parameters, input),
            &self.walk,
        )
    }
}

impl<A, T, N, X, P, M, U> Observation<T, N, M, U> for Augmented<A, T, N, X, P>
where
    A: ParametricObservation<T, X, P, M, U>,
    T: Real,
    N: Dimension + Dimension<M>,
    X: Dimension + Dimension<M>,
    P: Dimension + Dimension<M>,
    M: Dimension + Dimension<N> + Dimension<X> + Dimension<P>,
    U: Dimension,
{
    fn output(&self, state: &OVector<T, N>, input: &OVector<T, U>) -> OVector<T, M> {
        let (states, parameters) = self.split(state);
        self.model.output(&states, &parameters, input)
    }

    fn output_jacobian(&self, state: &OVector<T, N>, input: &OVector<T, U>) -> OMatrix<T, M, N> {
        let (states, parameters) = self.split(state);
        let by_state = self.model.output_jacobian(&states, &parameters, input);
        let by_parameter = self.model.output_parameter_jacobian(&states, &parameters, input);
        let mut jacobian = by_state.shape_generic().0.rows_by(self.size, T::zero());
        let columns = by_state.as_slice().iter().chain(by_parameter.as_slice());
        for (entry, &value) in jacobian.as_mut_slice().iter_mut().zip(columns) {
            *entry = value;
        }
        let fits =
            by_state.ncols() == self.states.value() && by_parameter.len() + by_state.len() == jacobian.len();
        self.refuse_unless(fits, jacobian.as_mut_slice());
        jacobian
    }

    fn measurement_noise(&self, state: &OVector<T, N>, input: &OVector<T, U>) -> Covariance<T, M> {
        let (states, parameters) = self.split(state);
        self.model.measurement_noise(&states, &parameters, input)
    }
}

#[cfg(test)]
mod tests;
