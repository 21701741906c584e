//! State-space models: how a state moves on, and what is measured of it.

use nalgebra::{Const, Dim, OMatrix, OVector};

use crate::dim::filled;
use crate::error::{check_finite, check_length};
use crate::triangle::column;
use crate::ud::{add_multiple, dot};
use crate::{Covariance, Dimension, Error, Real};

/// How a state moves on from one sample to the next.
///
/// ```text
/// x(k+1) = f(x(k), u(k)) + w(k)          w ~ (0, Q), white
/// ```
///
/// Noise that enters nonlinearly, f(x, u, w), is linearised: Q is then Γ Q_w Γ' with Γ = ∂f/∂w at w = 0, see
/// [`Covariance::transformed`]. What varies in time varies in the fields of the type that implements this.
///
/// N is the number of states, n, and U that of inputs. A function that returns NaN or infinity makes the filter
/// return an error and stay as it was.
///
/// [`LinearTransition`] is the linear one.
///
/// ```
/// use thetahat_core::nalgebra::{Const, Matrix2, Vector1, Vector2};
/// use thetahat_core::{Covariance, Transition};
///
/// /// A pendulum: angle in rad, rate in rad/s; the torque over the inertia in rad/s².
/// struct Pendulum {
///     sample_time: f64,
///     noise: Covariance<f64, Const<2>>,
/// }
///
/// impl Transition<f64, Const<2>, Const<1>> for Pendulum {
///     fn next(&self, x: &Vector2<f64>, u: &Vector1<f64>) -> Vector2<f64> {
///         Vector2::new(x[0] + self.sample_time * x[1], x[1] + self.sample_time * (u[0] - 9.81 * x[0].sin()))
///     }
///
///     fn next_jacobian(&self, x: &Vector2<f64>, _: &Vector1<f64>) -> Matrix2<f64> {
///         Matrix2::new(1.0, self.sample_time, -self.sample_time * 9.81 * x[0].cos(), 1.0)
///     }
///
///     fn process_noise(&self, _: &Vector2<f64>, _: &Vector1<f64>) -> Covariance<f64, Const<2>> {
///         self.noise.clone()
///     }
/// }
/// ```
pub trait Transition<T: Real, N: Dimension, U: Dimension = Const<0>> {
    /// f(x, u).
    fn next(&self, state: &OVector<T, N>, input: &OVector<T, U>) -> OVector<T, N>;

    /// F = ∂f/∂x at x and u, n x n.
    ///
    /// A model for an [`UnscentedKalmanFilter`](crate::UnscentedKalmanFilter) alone need not have it: it is NaN then,
    /// which every filter that wants it refuses with [`Error::NotFinite`].
    fn next_jacobian(&self, state: &OVector<T, N>, _input: &OVector<T, U>) -> OMatrix<T, N, N> {
        state.shape_generic().0.square(T::NAN)
    }

    /// Q, the covariance of what the noise adds to the next state, n x n.
    fn process_noise(&self, state: &OVector<T, N>, input: &OVector<T, U>) -> Covariance<T, N>;
}

/// What is measured of a state.
///
/// ```text
/// y(k) = h(x(k), u(k)) + v(k)          v ~ (0, R), white
/// ```
///
/// Noise that enters nonlinearly, h(x, u, v), is linearised: R is then V R_v V' with V = ∂h/∂v at v = 0, see
/// [`Covariance::transformed`]. A plant may have several observations, of different sizes and rates: each is
/// one sensor. N is the number of states, n, M that of elements of a measurement, m, and U that of inputs.
///
/// [`LinearObservation`] is the linear one.
///
/// ```
/// use thetahat_core::nalgebra::{Const, Matrix2, RowVector2, SVector, Vector1, Vector2};
/// use thetahat_core::{Covariance, Observation, Transition};
///
/// /// A pendulum with the gauge of its angle: one type is both.
/// struct Pendulum {
///     process_noise: Covariance<f64, Const<2>>,
///     gauge_noise: Covariance<f64, Const<1>>,
/// }
///
/// impl Transition<f64, Const<2>> for Pendulum {
///     fn next(&self, x: &Vector2<f64>, _: &SVector<f64, 0>) -> Vector2<f64> {
///         Vector2::new(x[0] + 0.1 * x[1], x[1] - 0.981 * x[0].sin())
///     }
///     fn next_jacobian(&self, x: &Vector2<f64>, _: &SVector<f64, 0>) -> Matrix2<f64> {
///         Matrix2::new(1.0, 0.1, -0.981 * x[0].cos(), 1.0)
///     }
///     fn process_noise(&self, _: &Vector2<f64>, _: &SVector<f64, 0>) -> Covariance<f64, Const<2>> {
///         self.process_noise.clone()
///     }
/// }
///
/// impl Observation<f64, Const<2>, Const<1>> for Pendulum {
///     fn output(&self, x: &Vector2<f64>, _: &SVector<f64, 0>) -> Vector1<f64> {
///         Vector1::new(x[0])
///     }
///     fn output_jacobian(&self, _: &Vector2<f64>, _: &SVector<f64, 0>) -> RowVector2<f64> {
///         RowVector2::new(1.0, 0.0)
///     }
///     fn measurement_noise(&self, _: &Vector2<f64>, _: &SVector<f64, 0>) -> Covariance<f64, Const<1>> {
///         self.gauge_noise.clone()
///     }
/// }
///
/// let pendulum = Pendulum { process_noise: Covariance::zero(Const), gauge_noise: Covariance::zero(Const) };
/// let (x, none) = (Vector2::new(0.0, 1.0), SVector::zeros());
/// assert_eq!(pendulum.output(&pendulum.next(&x, &none), &none), Vector1::new(0.1));
/// assert_eq!(pendulum.output_jacobian(&x, &none) * pendulum.next_jacobian(&x, &none), RowVector2::new(1.0, 0.1));
/// assert_eq!(pendulum.process_noise(&x, &none).variances(), Vector2::zeros());
/// assert_eq!(pendulum.measurement_noise(&x, &none).variances(), Vector1::zeros());
/// ```
pub trait Observation<
    T: Real,
    N: Dimension + Dimension<M>,
    M: Dimension + Dimension<N>,
    U: Dimension = Const<0>,
>
{
    /// h(x, u).
    fn output(&self, state: &OVector<T, N>, input: &OVector<T, U>) -> OVector<T, M>;

    /// H = ∂h/∂x at x and u, m x n.
    ///
    /// A model for an [`UnscentedKalmanFilter`](crate::UnscentedKalmanFilter) alone need not have it: it is NaN then,
    /// which every filter that wants it refuses with [`Error::NotFinite`].
    fn output_jacobian(&self, state: &OVector<T, N>, input: &OVector<T, U>) -> OMatrix<T, M, N> {
        let outputs = self.output(state, input).shape_generic().0;
        outputs.rows_by(state.shape_generic().0, T::NAN)
    }

    /// R, the covariance of what the noise adds to the measurement, m x m.
    fn measurement_noise(&self, state: &OVector<T, N>, input: &OVector<T, U>) -> Covariance<T, M>;
}

/// A linear transition.
///
/// ```text
/// x(k+1) = F x(k) + G u(k) + w(k)          w ~ (0, Q)
/// ```
///
/// F is n x n, G is n x (number of inputs), Q is n x n; for noise that enters by Γ, Q = Γ Q_w Γ' is
/// [`Covariance::transformed`]. A model that varies in time is a new `LinearTransition` for each sample.
///
/// ```
/// use thetahat_core::nalgebra::{Const, Matrix2, Vector1, Vector2};
/// use thetahat_core::{Covariance, Error, LinearTransition, Transition};
///
/// let noise = Covariance::from_diagonal(&Vector2::new(0.0, 0.1))?;
/// let cart: LinearTransition<f64, Const<2>, Const<1>> =
///     LinearTransition::new(Matrix2::new(1.0, 0.1, 0.0, 1.0), noise)?.with_input(Vector2::new(0.005, 0.1))?;
/// assert_eq!(cart.next(&Vector2::new(1.0, 2.0), &Vector1::new(10.0)), Vector2::new(1.25, 3.0));
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", into = "snapshot::Transition<T, N, U>"))]
#[cfg_attr(feature = "serde", serde(try_from = "snapshot::Transition<T, N, U>"))]
pub struct LinearTransition<T: Real, N: Dimension + Dimension<U>, U: Dimension = Const<0>> {
    state_matrix: OMatrix<T, N, N>,
    input_matrix: OMatrix<T, N, U>,
    noise: Covariance<T, N>,
    /// Q as a matrix: the time update needs it beside its factor.
    noise_matrix: OMatrix<T, N, N>,
}

impl<T: Real, N: Dimension + Dimension<Const<0>>> LinearTransition<T, N> {
    /// x(k+1) = F x(k) + w(k), without input, from F and Q.
    ///
    /// Errors: [`Error::NotFinite`]; [`Error::Length`] (only with `Dyn`); [`Error::Overflow`].
    pub fn new(state_matrix: OMatrix<T, N, N>, noise: Covariance<T, N>) -> Result<Self, Error> {
        let input_matrix = noise.size().rows_by(Const, T::zero());
        Self::checked(state_matrix, input_matrix, noise)
    }
}

impl<T: Real, N: Dimension + Dimension<U>, U: Dimension> LinearTransition<T, N, U> {
    /// The model of these, once they are checked.
    fn checked(
        state_matrix: OMatrix<T, N, N>,
        input_matrix: OMatrix<T, N, U>,
        noise: Covariance<T, N>,
    ) -> Result<Self, Error> {
        let size = noise.size();
        check_shape("state_matrix", &state_matrix, size, size)?;
        check_shape("input_matrix", &input_matrix, size, input_matrix.shape_generic().1)?;
        let noise_matrix = noise.matrix();
        if !noise_matrix.as_slice().iter().all(T::is_finite) {
            return Err(Error::Overflow);
        }
        Ok(LinearTransition { state_matrix, input_matrix, noise, noise_matrix })
    }

    /// The same with the input matrix G, n x (number of inputs), in place of the one it had.
    ///
    /// Errors: as for [`new`](LinearTransition::new).
    pub fn with_input<V: Dimension>(
        self,
        input_matrix: OMatrix<T, N, V>,
    ) -> Result<LinearTransition<T, N, V>, Error>
    where
        N: Dimension<V>,
    {
        LinearTransition::checked(self.state_matrix, input_matrix, self.noise)
    }

    /// The same to the bit, with the number of states in another type, see [`Covariance::to_size`].
    ///
    /// Errors: [`Error::Length`] if it has another number of states.
    pub fn to_size<K: Dimension + Dimension<U>>(
        &self,
        states: K,
    ) -> Result<LinearTransition<T, K, U>, Error> {
        let inputs = self.input_matrix.shape_generic().1;
        Ok(LinearTransition {
            noise: self.noise.to_size(states)?,
            state_matrix: filled(states.square(T::zero()), self.state_matrix.as_slice()),
            input_matrix: filled(states.rows_by(inputs, T::zero()), self.input_matrix.as_slice()),
            noise_matrix: filled(states.square(T::zero()), self.noise_matrix.as_slice()),
        })
    }

    /// F, n x n.
    pub fn state_matrix(&self) -> &OMatrix<T, N, N> {
        &self.state_matrix
    }

    /// G, n x (number of inputs).
    pub fn input_matrix(&self) -> &OMatrix<T, N, U> {
        &self.input_matrix
    }

    /// Q, factored.
    pub fn noise(&self) -> &Covariance<T, N> {
        &self.noise
    }

    /// Q as a matrix.
    pub(crate) fn noise_matrix(&self) -> &OMatrix<T, N, N> {
        &self.noise_matrix
    }
}

impl<T: Real, N: Dimension + Dimension<U>, U: Dimension> Transition<T, N, U> for LinearTransition<T, N, U> {
    fn next(&self, state: &OVector<T, N>, input: &OVector<T, U>) -> OVector<T, N> {
        let mut next = state.shape_generic().0.vector(T::zero());
        add_product(self.state_matrix.as_slice(), state.as_slice(), next.as_mut_slice());
        add_product(self.input_matrix.as_slice(), input.as_slice(), next.as_mut_slice());
        next
    }

    fn next_jacobian(&self, _state: &OVector<T, N>, _input: &OVector<T, U>) -> OMatrix<T, N, N> {
        self.state_matrix.clone()
    }

    fn process_noise(&self, _state: &OVector<T, N>, _input: &OVector<T, U>) -> Covariance<T, N> {
        self.noise.clone()
    }
}

/// A linear observation.
///
/// ```text
/// y(k) = H x(k) + D u(k) + v(k)          v ~ (0, R)
/// ```
///
/// H is m x n, D is m x (number of inputs), R is m x m and may have correlations.
///
/// ```
/// use thetahat_core::nalgebra::{Const, RowVector2, Vector1, Vector2};
/// use thetahat_core::{Covariance, Error, LinearObservation, Observation};
///
/// let noise = Covariance::from_diagonal(&Vector1::new(0.01))?;
/// let position: LinearObservation<f64, Const<2>, Const<1>> =
///     LinearObservation::new(RowVector2::new(1.0, 0.0), noise)?;
/// assert_eq!(position.output(&Vector2::new(3.0, 4.0), &Default::default()), Vector1::new(3.0));
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", into = "snapshot::Observation<T, N, M, U>"))]
#[cfg_attr(feature = "serde", serde(try_from = "snapshot::Observation<T, N, M, U>"))]
pub struct LinearObservation<
    T: Real,
    N: Dimension + Dimension<M>,
    M: Dimension + Dimension<U> + Dimension<N>,
    U: Dimension = Const<0>,
> {
    /// H', so that each row of H is contiguous.
    output_rows: OMatrix<T, N, M>,
    input_matrix: OMatrix<T, M, U>,
    noise: Covariance<T, M>,
}

impl<T: Real, N: Dimension + Dimension<M>, M: Dimension + Dimension<Const<0>> + Dimension<N>>
    LinearObservation<T, N, M>
{
    /// y(k) = H x(k) + v(k), from H and R.
    ///
    /// Errors: [`Error::NotFinite`]; [`Error::Length`] (only with `Dyn`).
    pub fn new(output_matrix: OMatrix<T, M, N>, noise: Covariance<T, M>) -> Result<Self, Error> {
        check_shape("output_matrix", &output_matrix, noise.size(), output_matrix.shape_generic().1)?;
        let input_matrix = noise.size().rows_by(Const, T::zero());
        Ok(LinearObservation { output_rows: transpose(&output_matrix), input_matrix, noise })
    }
}

impl<T: Real, N: Dimension + Dimension<M>, M: Dimension + Dimension<U> + Dimension<N>, U: Dimension>
    LinearObservation<T, N, M, U>
{
    /// The same with the feedthrough D, m x (number of inputs), in place of the one it had.
    ///
    /// Errors: as for [`new`](LinearObservation::new).
    pub fn with_input<V: Dimension>(
        self,
        input_matrix: OMatrix<T, M, V>,
    ) -> Result<LinearObservation<T, N, M, V>, Error>
    where
        M: Dimension<V>,
    {
        let LinearObservation { output_rows, noise, .. } = self;
        check_shape("input_matrix", &input_matrix, noise.size(), input_matrix.shape_generic().1)?;
        Ok(LinearObservation { output_rows, input_matrix, noise })
    }

    /// The same to the bit, with the numbers of states and outputs in other types, see [`Covariance::to_size`].
    ///
    /// Errors: [`Error::Length`] if it has another number of either.
    pub fn to_size<K: Dimension + Dimension<L>, L: Dimension + Dimension<U> + Dimension<K>>(
        &self,
        states: K,
        outputs: L,
    ) -> Result<LinearObservation<T, K, L, U>, Error> {
        check_length("observation", states.value(), self.output_rows.nrows())?;
        let inputs = self.input_matrix.shape_generic().1;
        Ok(LinearObservation {
            noise: self.noise.to_size(outputs)?,
            output_rows: filled(states.rows_by(outputs, T::zero()), self.output_rows.as_slice()),
            input_matrix: filled(outputs.rows_by(inputs, T::zero()), self.input_matrix.as_slice()),
        })
    }

    /// H, m x n: a copy.
    pub fn output_matrix(&self) -> OMatrix<T, M, N> {
        transpose(&self.output_rows)
    }

    /// D, m x (number of inputs).
    pub fn input_matrix(&self) -> &OMatrix<T, M, U> {
        &self.input_matrix
    }

    /// R, factored.
    pub fn noise(&self) -> &Covariance<T, M> {
        &self.noise
    }

    /// H', n x m.
    pub(crate) fn output_rows(&self) -> &OMatrix<T, N, M> {
        &self.output_rows
    }
}

impl<T: Real, N: Dimension + Dimension<M>, M: Dimension + Dimension<U> + Dimension<N>, U: Dimension>
    Observation<T, N, M, U> for LinearObservation<T, N, M, U>
{
    fn output(&self, state: &OVector<T, N>, input: &OVector<T, U>) -> OVector<T, M> {
        let mut output = self.noise.size().vector(T::zero());
        for (index, output) in output.as_mut_slice().iter_mut().enumerate() {
            *output = dot(column(self.output_rows.as_slice(), state.len(), index), state.as_slice());
        }
        add_product(self.input_matrix.as_slice(), input.as_slice(), output.as_mut_slice());
        output
    }

    fn output_jacobian(&self, _state: &OVector<T, N>, _input: &OVector<T, U>) -> OMatrix<T, M, N> {
        self.output_matrix()
    }

    fn measurement_noise(&self, _state: &OVector<T, N>, _input: &OVector<T, U>) -> Covariance<T, M> {
        self.noise.clone()
    }
}

/// y <- y + A x, column by column: A has as many rows as y.
pub(crate) fn add_product<T: Real>(matrix: &[T], x: &[T], y: &mut [T]) {
    for (index, &x) in x.iter().enumerate() {
        let rows = y.len();
        add_multiple(y, x, column(matrix, rows, index));
    }
}

/// The transpose, without nalgebra's checks.
pub(crate) fn transpose<T: Real, R: Dimension<C>, C: Dimension<R>>(
    matrix: &OMatrix<T, R, C>,
) -> OMatrix<T, C, R> {
    let (rows, columns) = matrix.shape_generic();
    let mut transposed = columns.rows_by(rows, T::zero());
    for (row, target) in transposed.as_mut_slice().chunks_mut(columns.value().max(1)).enumerate() {
        for (index, entry) in target.iter_mut().enumerate() {
            *entry = matrix.as_slice().get(index * rows.value() + row).copied().unwrap_or(T::zero());
        }
    }
    transposed
}

/// That a matrix has these sizes, which a type guarantees but for `Dyn`, and is finite.
fn check_shape<T: Real, R: Dimension<C>, C: Dim>(
    argument: &'static str,
    matrix: &OMatrix<T, R, C>,
    rows: R,
    columns: C,
) -> Result<(), Error> {
    let (found_rows, found_columns) = matrix.shape_generic();
    check_length(argument, rows.value(), found_rows.value())?;
    check_length(argument, columns.value(), found_columns.value())?;
    check_finite(argument, matrix.as_slice())
}

#[cfg(feature = "serde")]
mod snapshot;
