//! A recursive ARX estimator: delay lines that feed recursive least squares.

use core::ops::RangeInclusive;

use nalgebra::{Const, OVector};

use crate::lags::{take_rows, tell_inputs, tell_predictions};
use crate::rls::{pass_on, pass_on_settings};
use crate::{
    ArxOrders, ConstantOrders, Dimension, Error, Forgetting, Innovation, Lags, Real, RecursiveLeastSquares,
};

/// An ARX model, estimated while the plant runs.
///
/// ```text
/// A(q) y(k) = Σ over the inputs B_i(q) u_i(k) [+ constant] + e(k)
///
/// A(q) = 1 + a_1 q⁻¹ + … + a_na q⁻ⁿᵃ,     B_i(q) = q⁻ⁿᵏ (b_0 + b_1 q⁻¹ + … + b_(nb-1) q⁻ⁿᵇ⁺¹)
/// ```
///
/// It is [`RecursiveLeastSquares`] on the regressor of [`Lags`], φ(k) = \[-y(k-1) … u(k-nk) … 1\]', with θ = \[a_1 …
/// a_na  b_0 … of the first input, then of the next, and the constant if the orders have one\]. Everything said there
/// of forgetting, starts and bounds holds here. [`ArxOrders`] describes orders and delays.
///
/// # Time
///
/// Time is the order of the calls, and a controller writes them in the order in which things happen:
///
/// ```text
/// measured(y(k))      y(k) arrives; the model learns from it, with the inputs that were applied before
/// …                   the controller computes u(k)
/// applied(u(k))       what acts from now on, until the next measurement
/// ```
///
/// A call that is left out is a missing sample, and never shifts one signal against the other: after two measurements
/// in a row the input between them is missing, after two inputs in a row the output between them. A missing number is
/// NaN. Time goes on, and while it sits in a tap nothing is corrected.
///
/// [`log_row`](RecursiveArx::log_row) takes u(k) and y(k) that were recorded at the same instant k, as a row of a log
/// holds them: it is `measured(y(k))`, then `applied(u(k))`. Where an input acts in its own sample (nk = 0), y(k) needs
/// u(k), and only `log_row` can take the two.
///
/// # Noise
///
/// The equation has its noise e inside: a disturbance of the plant, filtered by 1/A(q). Then the estimate has no bias,
/// in a closed loop either, if the loop has a delay and is excited, as by changes of the set point. Noise of the sensor
/// is another: it enters φ, and pulls A(q) towards 1. With the plant y(k) = 0.9 y(k-1) + 0.08 u(k-1) in an open loop, u
/// a random ±1, and a standard deviation of the noise half that of y, a_1 comes out as -0.72; with a tenth, as -0.89.
/// Where that matters, slow the sampling, or model the noise: [`RecursiveArmax`](crate::RecursiveArmax).
///
/// # Sizes
///
/// `N` is the number of parameters, [`ArxOrders::parameters`], and `D` the buffer for inputs on their way, at least
/// [`ArxOrders::delays`], as for [`Lags`]. Memory: that of both; for 4 parameters in `f32` on a 32-bit machine 196
/// bytes.
///
/// Source: Ljung, System Identification, 2nd ed., sections 4.2 and 11.2.
///
/// ```
/// use thetahat_core::nalgebra::Const;
/// use thetahat_core::{ArxOrders, Error, Forgetting, InputOrders, RecursiveArx};
///
/// // y(k) = 0.8 y(k-1) + 0.5 u(k-2): a heater that answers after two samples.
/// let orders = ArxOrders { na: 1, inputs: &[InputOrders { nb: 1, nk: 2 }], constant: false };
/// // Outputs are about 2, inputs about 1.
/// let mut plant: RecursiveArx<f32, Const<2>, Const<2>> =
///     RecursiveArx::new(&orders, 2.0, &[1.0], Forgetting::Exponential { factor: 0.98 })?;
///
/// let (mut y, mut before) = (0.0, [0.0; 2]);
/// for k in 0..200 {
///     y = 0.8 * y + 0.5 * before[1];
///     plant.measured(y)?;
///     let u = if k % 7 < 3 { 1.0 } else { -1.0 };
///     plant.applied(&[u])?;
///     before = [u, before[0]];
/// }
/// assert!(plant.a().zip([1.0, -0.8]).all(|(a, truth)| (a - truth).abs() < 1e-4));
/// assert!(plant.b(0).unwrap().zip([0.0, 0.0, 0.5]).all(|(b, truth)| (b - truth).abs() < 1e-4));
///
/// // What comes if the heater is switched off: the next two outputs still see it.
/// let mut ahead = [0.0; 3];
/// plant.predict(&[0.0; 3], &mut ahead)?;
/// assert!((ahead[2] - 0.8 * ahead[1]).abs() < 1e-3);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", into = "snapshot::Snapshot<T, N, D>"))]
#[cfg_attr(feature = "serde", serde(try_from = "snapshot::Snapshot<T, N, D>"))]
pub struct RecursiveArx<T: Real, N: Dimension + Dimension<Const<1>>, D: Dimension = Const<1>> {
    lags: Lags<T, N, D>,
    estimator: RecursiveLeastSquares<T, N>,
}

impl<T: Real, N: Dimension + Dimension<Const<1>>, D: Dimension> RecursiveArx<T, N, D> {
    /// An estimator that knows nothing yet, and has seen no sample.
    ///
    /// `output_scale` and `input_scales` are the typical magnitudes of the output and of each input, in their own
    /// units: what they deviate from 0 by, see [Scales](RecursiveLeastSquares#scales). (A signal with a large
    /// offset is better taken as its deviation from a working point.)
    ///
    /// Errors: those of [`Lags::new`] and of [`RecursiveLeastSquares::new`]; [`Error::Length`] if there is not one
    /// scale for each input.
    ///
    /// ```
    /// use thetahat_core::nalgebra::Const;
    /// use thetahat_core::{ArxOrders, Error, Forgetting, InputOrders, RecursiveArx};
    ///
    /// const ORDERS: ArxOrders = ArxOrders {
    ///     na: 2,
    ///     inputs: &[InputOrders { nb: 2, nk: 1 }, InputOrders { nb: 1, nk: 3 }],
    ///     constant: false,
    /// };
    /// type Plant = RecursiveArx<f32, Const<{ ORDERS.parameters() }>, Const<{ ORDERS.delays() }>>;
    ///
    /// // Outputs in degrees, a heater in watts, a valve from 0 to 1.
    /// let plant = Plant::new(&ORDERS, 5.0, &[300.0, 0.5], Forgetting::default())?;
    /// assert_eq!(plant.b(1).unwrap().count(), 4); // three zeros and a coefficient
    /// # Ok::<(), Error>(())
    /// ```
    pub fn new(
        orders: &ArxOrders<'_>,
        output_scale: T,
        input_scales: &[T],
        forgetting: Forgetting<T>,
    ) -> Result<Self, Error> {
        let lags: Lags<T, N, D> = Lags::new(orders)?;
        let scales = lags.scales(&[output_scale], input_scales, T::NAN)?;
        Ok(RecursiveArx { estimator: RecursiveLeastSquares::new(&scales, forgetting)?, lags })
    }

    /// The same as [`new`](RecursiveArx::new) for orders that are constants: wrong sizes do not compile. (With `Dyn`,
    /// which has no size to compare, they are made to fit.)
    ///
    /// Errors: those of `new` that are left, of the scales and the policy.
    ///
    /// ```
    /// use thetahat_core::nalgebra::Const;
    /// use thetahat_core::{ArxOrders, ConstantOrders, Error, Forgetting, InputOrders, RecursiveArx};
    ///
    /// struct Heater;
    /// impl ConstantOrders for Heater {
    ///     const ORDERS: ArxOrders<'static> =
    ///         ArxOrders { na: 1, inputs: &[InputOrders { nb: 1, nk: 1 }], constant: false };
    /// }
    /// let heater: RecursiveArx<f32, Const<2>> = RecursiveArx::of::<Heater>(20.0, &[50.0], Forgetting::default())?;
    /// # Ok::<(), Error>(())
    /// ```
    ///
    /// ```compile_fail,E0080
    /// # use thetahat_core::nalgebra::Const;
    /// # use thetahat_core::{ArxOrders, ConstantOrders, Error, Forgetting, InputOrders, RecursiveArx};
    /// # struct Heater;
    /// # impl ConstantOrders for Heater {
    /// #     const ORDERS: ArxOrders<'static> =
    /// #         ArxOrders { na: 1, inputs: &[InputOrders { nb: 1, nk: 1 }], constant: false };
    /// # }
    /// // One parameter too many.
    /// let heater: RecursiveArx<f32, Const<3>> = RecursiveArx::of::<Heater>(20.0, &[50.0], Forgetting::default())?;
    /// # Ok::<(), Error>(())
    /// ```
    pub fn of<O: ConstantOrders>(
        output_scale: T,
        input_scales: &[T],
        forgetting: Forgetting<T>,
    ) -> Result<Self, Error> {
        const {
            assert!(
                Self::fits(&O::ORDERS),
                "N is not the number of parameters, or D is less than that of delays"
            )
        };
        Self::new(&O::ORDERS, output_scale, input_scales, forgetting)
    }

    /// y(k) arrives: time goes on to k, and the model learns from y(k) and the inputs that were
    /// [`applied`](RecursiveArx::applied) before. NaN is a missing sample.
    ///
    /// The innovation is that of [`RecursiveLeastSquares::update`]. Its action is
    /// [`NotReady`](crate::Action::NotReady) while a missing sample sits in a tap, or the lines are not filled yet; and
    /// where numbers that are accepted one by one would overflow together with P or the parameters: nothing is
    /// corrected then, but time goes on, so that a large sample leaves the taps again.
    ///
    /// Errors, after which nothing has changed, time included: [`Error::InputFirst`] if an input acts in its own
    /// sample: [`log_row`](RecursiveArx::log_row) takes that; [`Error::Infinite`]; [`Error::TooLarge`] for a sample
    /// whose square times n exceeds [`Real::LARGEST_ENTRY`] (7e13/√n in `f32`). If time should go on, pass NaN instead.
    ///
    /// 1.5 n² + 7 n multiply-adds, n divisions, and one move of n + D numbers.
    pub fn measured(&mut self, output: T) -> Result<Innovation<T>, Error> {
        self.lags.check_measured(&[output])?;
        Ok(self.take_sample(&[], output, true))
    }

    take_rows!();
    tell_predictions!(|_| T::zero());
    tell_inputs!();

    /// One sample, checked.
    fn take_sample(&mut self, inputs: &[T], output: T, inputs_follow: bool) -> Innovation<T> {
        let RecursiveArx { lags, estimator } = self;
        // What is too large here is so by what came before: time must go on, or it would stay.
        let taken =
            lags.sample(inputs, &[output], inputs_follow, |regressor| estimator.take(regressor, output).ok());
        if let Some(Innovation { error, nis, action, .. }) = taken
            && let Some(unused) = estimator.unused(nis, action)
        {
            lags.take_from_newest(|_| error * unused);
        }
        taken.unwrap_or_else(|| {
            estimator.advance();
            Innovation::not_ready()
        })
    }

    /// Takes the parameters back to their limits, one range for each, and returns whether one was out. See
    /// [`RecursiveLeastSquares::keep_within`], whose errors it has.
    ///
    /// ```
    /// use core::ops::RangeInclusive;
    /// use thetahat_core::nalgebra::Const;
    /// use thetahat_core::{ArxOrders, Error, Forgetting, InputOrders, RecursiveArx};
    ///
    /// // A heater: its gain b1 is positive, whatever the first samples look like.
    /// const LIMITS: [RangeInclusive<f32>; 2] = [-0.999..=0.0, 0.001..=f32::INFINITY];
    /// let orders = ArxOrders { na: 1, inputs: &[InputOrders { nb: 1, nk: 1 }], constant: false };
    /// let mut heater: RecursiveArx<f32, Const<2>> =
    ///     RecursiveArx::new(&orders, 20.0, &[50.0], Forgetting::default())?;
    /// heater.measured(3.0)?;
    /// heater.applied(&[50.0])?;
    /// heater.measured(-1.0)?; // a draught
    /// assert!(heater.keep_within(&LIMITS)?);
    /// let [a1, b1] = (*heater.estimator().parameters()).into();
    /// assert!(LIMITS[0].contains(&a1) && LIMITS[1].contains(&b1));
    /// # Ok::<(), Error>(())
    /// ```
    pub fn keep_within(&mut self, limits: &[RangeInclusive<T>]) -> Result<bool, Error> {
        self.estimator.keep_within(limits)
    }

    /// Whether this type has the sizes for these orders: that [`new`](RecursiveArx::new) answers neither
    /// [`Error::Orders`] nor [`Error::Delays`]. Where the orders are constants, the compiler can be asked:
    ///
    /// ```
    /// use thetahat_core::nalgebra::Const;
    /// use thetahat_core::{ArxOrders, InputOrders, RecursiveArx};
    ///
    /// const ORDERS: ArxOrders = ArxOrders { na: 2, inputs: &[InputOrders { nb: 2, nk: 3 }], constant: false };
    /// type Plant = RecursiveArx<f32, Const<4>, Const<3>>;
    /// const _: () = assert!(Plant::fits(&ORDERS));
    /// ```
    ///
    /// A wrong size does not compile then:
    ///
    /// ```compile_fail,E0080
    /// # use thetahat_core::nalgebra::Const;
    /// # use thetahat_core::{ArxOrders, InputOrders, RecursiveArx};
    /// # const ORDERS: ArxOrders = ArxOrders { na: 2, inputs: &[InputOrders { nb: 2, nk: 3 }], constant: false };
    /// type Plant = RecursiveArx<f32, Const<5>, Const<3>>;
    /// const _: () = assert!(Plant::fits(&ORDERS));
    /// ```
    ///
    /// ```compile_fail,E0080
    /// # use thetahat_core::nalgebra::Const;
    /// # use thetahat_core::{ArxOrders, InputOrders, RecursiveArx};
    /// # const ORDERS: ArxOrders = ArxOrders { na: 2, inputs: &[InputOrders { nb: 2, nk: 3 }], constant: false };
    /// type Plant = RecursiveArx<f32, Const<4>>; // a buffer for one input on its way, of three
    /// const _: () = assert!(Plant::fits(&ORDERS));
    /// ```
    pub const fn fits(orders: &ArxOrders<'_>) -> bool {
        Lags::<T, N, D>::fits(orders)
    }

    /// A(q): 1, a_1 … a_na.
    pub fn a(&self) -> impl Iterator<Item = T> + Clone + '_ {
        self.lags.output_coefficients(self.estimator.parameters().as_slice())
    }

    /// Tells that an unknown number of samples is missing here. See [`Lags::gap`].
    pub fn gap(&mut self) {
        self.lags.gap();
    }

    /// Sets the parameters: see [`RecursiveLeastSquares::set_parameters`], whose errors it has.
    pub fn set_parameters(&mut self, parameters: OVector<T, N>) -> Result<(), Error> {
        self.estimator.set_parameters(parameters)
    }

    pass_on!(start, solution, noise_variance, dead_zone);
    pass_on_settings!(OVector<T, N>, RecursiveLeastSquares<T, N>);
}

#[cfg(feature = "serde")]
mod snapshot;
#[cfg(test)]
pub(crate) mod tests;
