//! A recursive ARX estimator of several outputs.

use nalgebra::{Const, OMatrix, OVector};

use crate::lags::tell_predictions;
use crate::rls::{pass_on, pass_on_settings};
use crate::triangle::column;
use crate::{
    Action, ArxOrders, ConstantOrders, Dimension, Error, Forgetting, Innovation, Lags, Real,
    RecursiveLeastSquares,
};

/// An ARX model with several outputs, estimated while the plant runs.
///
/// ```text
/// A(q) y(k) = Σ over the inputs B_i(q) u_i(k) [+ constant] + e(k)
///
/// A(q) = I + A_1 q⁻¹ + … + A_na q⁻ⁿᵃ,     B_i(q) = q⁻ⁿᵏ (b_0 + b_1 q⁻¹ + … + b_(nb-1) q⁻ⁿᵇ⁺¹)
/// ```
///
/// with M outputs: A_1 … A_na are M x M, full, and every b_j and the constant have an entry for each output. So each
/// output is an ARX model of its own past, that of the other outputs, and the inputs.
///
/// It is [`RecursiveLeastSquares`] with M outputs on the regressor of [`Lags::with_outputs`], φ(k) = \[-y_1(k-1) …
/// -y_1(k-na) -y_2(k-1) … u(k-nk) … 1\]', which all equations share: y(k) = θ'φ(k) + e(k) with θ n x M, a column for
/// each output, its rows in the order of φ. They share P too, so that an output more costs one product more, and not a
/// factorisation. Everything said there of forgetting and starts holds here.
///
/// Time is that of [`RecursiveArx`](crate::RecursiveArx#time): `measured`, then `applied`; or `log_row`. A sample of
/// which one output is missing corrects nothing, as P is shared; the outputs that are there go into the delay lines.
///
/// # Sizes
///
/// `N` is the number of parameters of each equation, [`ArxOrders::parameters_of`], `M` the number of outputs, and `D`
/// the buffer for inputs on their way, at least [`ArxOrders::delays`].
///
/// Source: Ljung, System Identification, 2nd ed., sections 4.2 (equations 4.53 to 4.57) and 11.2.
///
/// ```
/// use thetahat_core::nalgebra::{Const, Vector2};
/// use thetahat_core::{ArxOrders, Error, Forgetting, InputOrders, RecursiveVectorArx};
///
/// // Two tanks: a pump fills the first, which runs into the second.
/// const ORDERS: ArxOrders = ArxOrders { na: 1, inputs: &[InputOrders { nb: 1, nk: 1 }], constant: false };
/// let memory = Forgetting::Exponential { factor: 0.98 };
/// // Levels are about 2 and 1, the pump about 1.
/// let mut tanks: RecursiveVectorArx<f32, Const<{ ORDERS.parameters_of(2) }>, Const<2>> =
///     RecursiveVectorArx::new(&ORDERS, &Vector2::new(2.0, 1.0), &[1.0], memory)?;
///
/// let mut y = Vector2::new(0.0, 0.0);
/// for k in 0..300 {
///     tanks.measured(&y)?;
///     let u = if k % 7 < 3 { 1.0 } else { -1.0 };
///     tanks.applied(&[u])?;
///     y = Vector2::new(0.8 * y[0] + 0.5 * u, 0.9 * y[1] + 0.1 * y[0]);
/// }
/// // What the second level gets from the first: the coefficient of A is -0.1.
/// assert!(tanks.a(1, 0).unwrap().zip([0.0, -0.1]).all(|(a, truth)| (a - truth).abs() < 1e-3));
/// assert!(tanks.b(0, 0).unwrap().zip([0.0, 0.5]).all(|(b, truth)| (b - truth).abs() < 1e-3));
///
/// // The next two samples of both, if the pump stands still from the next one on.
/// let mut ahead = [0.0; 4];
/// tanks.predict(&[0.0; 2], &mut ahead)?;
/// assert!((ahead[3] - (0.9 * ahead[1] + 0.1 * ahead[0])).abs() < 1e-3);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", into = "snapshot::Snapshot<T, N, M, D>"))]
#[cfg_attr(feature = "serde", serde(try_from = "snapshot::Snapshot<T, N, M, D>"))]
pub struct RecursiveVectorArx<T: Real, N: Dimension + Dimension<M>, M: Dimension, D: Dimension = Const<1>> {
    lags: Lags<T, N, D>,
    estimator: RecursiveLeastSquares<T, N, M>,
}

impl<T: Real, N: Dimension + Dimension<M>, M: Dimension, D: Dimension> RecursiveVectorArx<T, N, M, D> {
    /// An estimator that knows nothing yet, and has seen no sample.
    ///
    /// `output_scales` and `input_scales` are the typical magnitudes of each output and of each input, in their own
    /// units: what they deviate from 0 by, see [Scales](RecursiveLeastSquares#scales).
    ///
    /// Errors: those of [`Lags::with_outputs`] and of [`RecursiveLeastSquares::with_outputs`]; [`Error::Length`] if
    /// there is not one scale for each input.
    pub fn new(
        orders: &ArxOrders<'_>,
        output_scales: &OVector<T, M>,
        input_scales: &[T],
        forgetting: Forgetting<T>,
    ) -> Result<Self, Error> {
        let outputs = output_scales.shape_generic().0;
        let lags: Lags<T, N, D> = Lags::with_outputs(orders, outputs.value())?;
        let scales = lags.scales(output_scales.as_slice(), input_scales, T::NAN)?;
        let estimator = RecursiveLeastSquares::with_outputs(&scales, outputs, forgetting)?;
        Ok(RecursiveVectorArx { lags, estimator })
    }

    /// The same as [`new`](RecursiveVectorArx::new) for orders that are constants, so that wrong sizes do not compile:
    /// see [`RecursiveArx::of`](crate::RecursiveArx::of). The errors are those of `new` that are left.
    pub fn of<O: ConstantOrders>(
        output_scales: &OVector<T, M>,
        input_scales: &[T],
        forgetting: Forgetting<T>,
    ) -> Result<Self, Error> {
        const {
            let fits = match M::SIZE {
                Some(outputs) => Self::fits(&O::ORDERS, outputs),
                None => true,
            };
            assert!(fits, "N is not the number of parameters, or D is less than that of delays")
        };
        Self::new(&O::ORDERS, output_scales, input_scales, forgetting)
    }

    /// y(k) arrives: time goes on to k, and the model learns from y(k) and the inputs that were
    /// [`applied`](RecursiveVectorArx::applied) before. NaN is a missing sample of an output.
    ///
    /// The innovation is that of [`RecursiveLeastSquares::update_all`], with the actions of
    /// [`RecursiveArx::measured`](crate::RecursiveArx::measured).
    ///
    /// Errors, after which nothing has changed, time included: [`Error::InputFirst`] if an input acts in its own
    /// sample: [`log_row`](RecursiveVectorArx::log_row) takes that; [`Error::Length`] (only with `Dyn`);
    /// [`Error::Infinite`]; [`Error::TooLarge`], as there.
    ///
    /// 1.5 n² + (6 + M) n multiply-adds, n divisions, and one move of n + D numbers.
    pub fn measured(&mut self, outputs: &OVector<T, M>) -> Result<Innovation<T, OVector<T, M>>, Error> {
        self.lags.check_measured(outputs.as_slice())?;
        Ok(self.take_sample(&[], outputs, true))
    }

    /// u(k), one number for each input: what acts on the plant from now on. See
    /// [`RecursiveArx::applied`](crate::RecursiveArx::applied), whose errors it has.
    pub fn applied(&mut self, inputs: &[T]) -> Result<(), Error> {
        if !self.lags.take_applied(inputs)? {
            let missing = self.estimator.parameters().shape_generic().1.vector(T::NAN);
            self.take_sample(inputs, &missing, false);
        }
        Ok(())
    }

    /// One row of a log: y(k) and u(k), recorded at the same instant k. NaN is a missing sample. See
    /// [`RecursiveArx::log_row`](crate::RecursiveArx::log_row).
    ///
    /// Errors, after which nothing has changed, time included: those of [`measured`](RecursiveVectorArx::measured) and
    /// [`applied`](RecursiveVectorArx::applied), but for [`Error::InputFirst`].
    pub fn log_row(
        &mut self,
        outputs: &OVector<T, M>,
        inputs: &[T],
    ) -> Result<Innovation<T, OVector<T, M>>, Error> {
        self.lags.check_row(inputs, outputs.as_slice())?;
        Ok(self.take_sample(inputs, outputs, false))
    }

    tell_predictions!(|_| T::zero());

    /// One sample, checked.
    fn take_sample(
        &mut self,
        inputs: &[T],
        outputs: &OVector<T, M>,
        inputs_follow: bool,
    ) -> Innovation<T, OVector<T, M>> {
        let RecursiveVectorArx { lags, estimator } = self;
        // What is too large here is so by what came before: time must go on, or it would stay.
        let taken = lags.sample(inputs, outputs.as_slice(), inputs_follow, |regressor| {
            estimator.take_all(regressor, outputs).ok()
        });
        if let Some(Innovation { error, nis, action, .. }) = &taken
            && let Some(unused) = estimator.unused(*nis, *action)
        {
            lags.take_from_newest(|index| {
                error.as_slice().get(index).map_or(T::zero(), |&error| error * unused)
            });
        }
        taken.unwrap_or_else(|| {
            estimator.advance();
            let unknown = outputs.shape_generic().0.vector(T::NAN);
            Innovation { error: unknown.clone(), variance: unknown, nis: T::zero(), action: Action::NotReady }
        })
    }

    /// Whether this type has the sizes for these orders and this many outputs, see
    /// [`RecursiveArx::fits`](crate::RecursiveArx::fits).
    ///
    /// ```
    /// use thetahat_core::nalgebra::Const;
    /// use thetahat_core::{ArxOrders, InputOrders, RecursiveVectorArx};
    ///
    /// const ORDERS: ArxOrders = ArxOrders { na: 2, inputs: &[InputOrders { nb: 1, nk: 1 }], constant: false };
    /// type Plant = RecursiveVectorArx<f32, Const<5>, Const<2>>;
    /// const _: () = assert!(Plant::fits(&ORDERS, 2));
    /// ```
    pub const fn fits(orders: &ArxOrders<'_>, outputs: usize) -> bool {
        let exact = match M::SIZE {
            Some(size) => size == outputs,
            None => true,
        };
        exact && Lags::<T, N, D>::fits_with(orders, outputs, 0)
    }

    /// A(q) in a row and a column, counted from 0: what multiplies the output of the column in the equation of that of
    /// the row. 1 or, off the diagonal, 0; then the coefficients of q⁻¹ … q⁻ⁿᵃ. `None` if there is no such output.
    pub fn a(&self, row: usize, output: usize) -> Option<impl Iterator<Item = T> + Clone + '_> {
        if output >= self.lags.outputs() {
            return None;
        }
        let leading = if row == output { T::one() } else { T::zero() };
        Some(self.lags.coefficients_of(self.equation(row)?, output, leading))
    }

    /// B(q) of an output and an input, counted from 0, so that the i-th number multiplies q⁻ⁱ: nk zeros, then b_0 …
    /// b_(nb-1). `None` if there is no such output or input.
    pub fn b(&self, row: usize, input: usize) -> Option<impl Iterator<Item = T> + Clone + '_> {
        self.lags.input_coefficients(self.equation(row)?, input)
    }

    /// The constant of an output; `None` if the orders have none, or there is no such output.
    pub fn constant(&self, row: usize) -> Option<T> {
        self.lags.constant(self.equation(row)?)
    }

    /// The parameters of an output.
    fn equation(&self, row: usize) -> Option<&[T]> {
        let parameters = self.estimator.parameters();
        (row < parameters.ncols()).then(|| column(parameters.as_slice(), parameters.nrows(), row))
    }

    /// Tells that an unknown number of samples is missing here. See [`Lags::gap`].
    pub fn gap(&mut self) {
        self.lags.gap();
    }

    /// Sets the parameters: see [`RecursiveLeastSquares::set_parameters`], whose errors it has.
    pub fn set_parameters(&mut self, parameters: OMatrix<T, N, M>) -> Result<(), Error> {
        self.estimator.set_parameters(parameters)
    }

    pass_on!(start);
    pass_on_settings!(OMatrix<T, N, M>, RecursiveLeastSquares<T, N, M>);
}

#[cfg(feature = "serde")]
mod snapshot;
#[cfg(test)]
mod tests;
