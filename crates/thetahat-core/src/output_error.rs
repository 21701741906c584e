//! A recursive output-error estimator: a model that is blind to the noise of the sensor.

use core::ops::RangeInclusive;

use nalgebra::{Const, OMatrix, OVector};

use crate::gradient;
use crate::lags::{is_large, take_rows, tell_inputs, tell_predictions};
use crate::rls::{check_limits, pass_on, pass_on_settings};
use crate::stability::move_stably;
use crate::ud::{copy, dot};
use crate::{
    Action, ArxOrders, ConstantOrders, Dimension, Error, Forgetting, Innovation, Lags, Outliers, Real,
    RecursiveLeastSquares,
};

/// What a [`RecursiveOutputError`] corrects by, and along which direction.
///
/// Both find the plant without bias where an ARX model does not. The distance of f_1 from the truth, -0.9, in the mean
/// of 200 runs, and its deviation, for the plant y(k) = 0.9 y(k-1) + 0.08 u(k-1) in an open loop, u a random ±1 and
/// noise of the sensor of half the deviation of y, after 5,000 samples without forgetting; white noise, then noise that
/// a pole at 0.5 has coloured:
///
/// | | white | deviation | coloured | deviation |
/// |---|---|---|---|---|
/// | `RecursiveArx` | 0.181 | 0.010 | 0.081 | 0.005 |
/// | `PredictionError` | 0.000 | 0.001 | 0.000 | 0.002 |
/// | `Instruments` | 0.001 | 0.003 | 0.001 | 0.003 |
///
/// With white noise 375 of 400 parameters lay within 1.96 standard errors of `PredictionError`.
///
/// (Printed by `cargo test -p thetahat-core --lib output_error::tests::table -- --nocapture`.)
///
/// ```
/// use thetahat_core::nalgebra::Const;
/// use thetahat_core::{ArxOrders, Error, Forgetting, InputOrders, OutputErrorMethod, RecursiveOutputError};
///
/// const ORDERS: ArxOrders = ArxOrders { na: 1, inputs: &[InputOrders { nb: 1, nk: 1 }], constant: false };
/// type Plant = RecursiveOutputError<f32, Const<{ ORDERS.parameters() }>>;
/// let plant = Plant::new(&ORDERS, OutputErrorMethod::Instruments, 5.0, &[1.0], Forgetting::None)?;
/// assert_eq!(plant.f().count(), 2); // 1 and f_1
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum OutputErrorMethod {
    /// ψ = φ/F(q), the gradient of the model's output, and e = y - φ'θ̂, the output error: converges to a minimum of
    /// its variance. The estimate with the least variance where the noise is white, with honest standard errors then.
    /// nf n multiply-adds and moves more.
    PredictionError,
    /// Instrumental variables: ψ = φ, which holds the output of the model and none of the noise, and the equation error
    ///
    /// ```text
    /// e = y(k) + f_1 y(k-1) + … + f_nf y(k-nf) - Σ B_i(q) u_i(k) - constant
    /// ```
    ///
    /// of what was measured. It is linear in the parameters, so that there is no minimum but the one, whatever the
    /// colour of the noise of the sensor; and it needs nf measurements in a row before it learns again. The equation
    /// error is not white even where the noise of the sensor is. So the variance of the noise, standard errors and
    /// `nis` are not known, and there is no rule for [outliers](crate::Outliers).
    ///
    /// P is the symmetric one of the instruments, and its factors stay positive in single precision. (The other one,
    /// (Σ ψ φ')⁻¹, has no factors and may become singular. With both sides filtered by 1/F(q), the refined instrumental
    /// variables of Young, e becomes the output error and ψ its gradient: that is `PredictionError`.)
    Instruments,
}

/// A model with noise of the sensor, estimated while the plant runs.
///
/// ```text
/// x(k) = Σ over the inputs B_i(q)/F(q) u_i(k) [+ constant/F(1)],     y(k) = x(k) + e(k),
/// F(q) = 1 + f_1 q⁻¹ + … + f_nf q⁻ⁿᶠ
/// ```
///
/// with B as in [`RecursiveArx`](crate::RecursiveArx), one F for all inputs, and a disturbance e that does not go
/// through the plant: noise of the sensor, white or coloured, which biases an ARX model. The regressor holds the
/// model's own output in the place of what was measured,
///
/// ```text
/// φ(k) = [ -x̂(k-1) … -x̂(k-nf)   u_1(k-nk_1) …   1 ]'
/// θ    = [ f_1 … f_nf           b_0 …           constant ]'
///
/// ψ(k) = φ(k) - f_1 ψ(k-1) - … - f_nf ψ(k-nf),       e = y - φ'θ̂
/// θ̂ <- θ̂ + P ψ e/(λ + ψ'P ψ),                        P as in RecursiveLeastSquares, with ψ
/// x̂(k) = φ'θ̂                                         with the new θ̂
/// ```
///
/// or the ψ and e of [`OutputErrorMethod::Instruments`]. Everything said of forgetting and bounds at
/// [`RecursiveLeastSquares`] holds here; the start is the standard one. The [`ArxOrders`] are those of an ARX model,
/// with nf as `na`.
///
/// The input must be independent of the noise: in a closed loop both methods are biased, and a plant that is not stable
/// has no such model. F stays stable, as C of [`RecursiveArmax`](crate::RecursiveArmax) does, and [`Action::Projected`]
/// tells.
///
/// Time is the order of the calls, and a missing sample is NaN, as in [`RecursiveArx`](crate::RecursiveArx#time). A
/// missing measurement corrects nothing, and the model's output goes on. While the lines are not filled, at the start
/// and after missing inputs, measurements stand in for the model's output, and their errors die away as 1/F(q) does.
///
/// # Sizes
///
/// `N` is the number of parameters, [`ArxOrders::parameters`], and `D` the buffer for inputs on their way, at least
/// [`ArxOrders::delays`]. Memory: that of `RecursiveArx`, and n² numbers for past gradients.
///
/// Source: Ljung and Söderström, Theory and Practice of Recursive Identification, 1983, sections 3.7.2 (gradients) and
/// 6.6 (projection); Ljung, System Identification, 2nd ed., sections 11.3 (instruments) and 11.4; Söderström and
/// Stoica, Instrumental Variable Methods for System Identification, 1983 (instruments from an auxiliary model); Young,
/// Recursive Estimation and Time-Series Analysis, 2nd ed., 2011, chapters 6 and 7 (the symmetric P).
///
/// ```
/// use thetahat_core::nalgebra::{Const, Vector2};
/// use thetahat_core::{ArxOrders, Error, Forgetting, InputOrders, OutputErrorMethod, RecursiveOutputError};
///
/// // x(k) = 0.8 x(k-1) + u(k-1), and a sensor with noise of deviation 0.6.
/// let orders = ArxOrders { na: 1, inputs: &[InputOrders { nb: 1, nk: 1 }], constant: false };
/// let method = OutputErrorMethod::PredictionError;
/// let mut plant: RecursiveOutputError<f64, Const<2>> =
///     RecursiveOutputError::new(&orders, method, 2.0, &[1.0], Forgetting::None)?;
///
/// let (mut x, mut u, mut seed) = (0.0, 0.0, 1_u32);
/// for k in 0..4000 {
///     seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
///     let e = 2.0 * (f64::from(seed) / f64::from(u32::MAX) - 0.5);
///     x = 0.8 * x + u;
///     plant.measured(x + e)?;
///     u = if k % 13 < 5 { 1.0 } else { -1.0 };
///     plant.applied(&[u])?;
/// }
/// assert!((plant.estimator().parameters() - Vector2::new(-0.8, 1.0)).amax() < 0.02);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", into = "snapshot::Snapshot<T, N, D>"))]
#[cfg_attr(feature = "serde", serde(try_from = "snapshot::Snapshot<T, N, D>"))]
pub struct RecursiveOutputError<T: Real, N: Dimension + Dimension<Const<1>>, D: Dimension = Const<1>> {
    /// The model's outputs stand where an ARX model has those of the plant.
    lags: Lags<T, N, D>,
    estimator: RecursiveLeastSquares<T, N>,
    /// ψ(k-1), ψ(k-2), … ψ(k-nf), a column each. With instruments -y(k-1) … -y(k-nf) instead, in the first column.
    past: OMatrix<T, N, N>,
    nf: usize,
    method: OutputErrorMethod,
    scratch: N::Scratch<T>,
}

impl<T: Real, N: Dimension + Dimension<Const<1>>, D: Dimension> RecursiveOutputError<T, N, D> {
    /// An estimator that knows nothing yet, and has seen no sample. As [`RecursiveArx::new`](crate::RecursiveArx::new),
    /// whose scales and errors it has; `na` of the orders is nf.
    pub fn new(
        orders: &ArxOrders<'_>,
        method: OutputErrorMethod,
        output_scale: T,
        input_scales: &[T],
        forgetting: Forgetting<T>,
    ) -> Result<Self, Error> {
        let lags: Lags<T, N, D> = Lags::new(orders)?;
        let scales = lags.scales(&[output_scale], input_scales, T::NAN)?;
        let estimator = RecursiveLeastSquares::new(&scales, forgetting)?;
        let size = scales.shape_generic().0;
        let (past, scratch) = (size.square(T::zero()), size.scratch::<T, 2, 0>());
        let mut this = RecursiveOutputError { lags, estimator, past, nf: orders.na, method, scratch };
        this.forget_past();
        Ok(this)
    }

    /// The same as [`new`](RecursiveOutputError::new) for orders that are constants, so that wrong sizes do not
    /// compile: see [`RecursiveArx::of`](crate::RecursiveArx::of). The errors are those of `new` that are left.
    pub fn of<O: ConstantOrders>(
        method: OutputErrorMethod,
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
        Self::new(&O::ORDERS, method, output_scale, input_scales, forgetting)
    }

    /// That F, the first of these parameters, is stable.
    fn check_stable(&self, parameters: &OVector<T, N>) -> Result<(), Error> {
        gradient::check_stable(parameters, 0..self.nf, "such that F(q) is stable")
    }

    /// y(k) arrives: time goes on to k, and the model learns from y(k) and the inputs that were
    /// [`applied`](RecursiveOutputError::applied) before. NaN is a missing sample.
    ///
    /// The innovation is y(k) less the model's output, with both methods; the actions are those of
    /// [`RecursiveArmax::measured`](crate::RecursiveArmax::measured), with F in the place of C. With
    /// [`Instruments`](OutputErrorMethod::Instruments) it is [`NotReady`](Action::NotReady) too while one of the last
    /// nf measurements is missing, and the variance is NaN.
    ///
    /// Errors, after which nothing has changed, time included: as for
    /// [`RecursiveArx::measured`](crate::RecursiveArx::measured).
    ///
    /// 1.5 n² + (9 + nf) n multiply-adds, n divisions, and moves of (1 + nf) n + D numbers; each halving nf²/2 more.
    pub fn measured(&mut self, output: T) -> Result<Innovation<T>, Error> {
        self.lags.check_measured(&[output])?;
        Ok(self.take_sample(&[], output, true))
    }

    take_rows!();
    tell_predictions!(|_| T::zero());
    tell_inputs!();

    /// One sample, checked.
    fn take_sample(&mut self, inputs: &[T], output: T, inputs_follow: bool) -> Innovation<T> {
        self.lags.push(inputs, T::NAN);
        let learnt = self.learn(output);
        let simulated = match learnt {
            Some((_, simulated)) => simulated,
            // The measurement stands in.
            None => {
                self.estimator.advance();
                if self.method == OutputErrorMethod::PredictionError {
                    self.past.fill(T::zero());
                }
                output
            }
        };
        if self.method == OutputErrorMethod::Instruments {
            let measured = self.past.as_mut_slice().get_mut(..self.nf).unwrap_or_default();
            measured.iter_mut().fold(-output, |moving, place| core::mem::replace(place, moving));
        }
        self.lags.push_checked(&[simulated]);
        self.lags.await_inputs(inputs_follow);
        learnt.map_or(Innovation::not_ready(), |(innovation, _)| innovation)
    }

    /// Learns from y(k), if φ(k) is there; returns the innovation and x̂(k), or `None` where numbers are missing or too
    /// large.
    fn learn(&mut self, output: T) -> Option<(Innovation<T>, T)> {
        let RecursiveOutputError { lags, estimator, past, nf, method, scratch } = self;
        let (size, nf) = (past.shape_generic().0, *nf);
        let regressor = lags.regressor()?.as_slice();
        size.with_scratch(scratch, |[gradient, work], []| {
            let parameters = estimator.parameters().as_slice();
            let innovation = output - dot(regressor, parameters);
            let (mut grown, mut error) = (false, innovation);
            match method {
                OutputErrorMethod::PredictionError => {
                    let f = parameters.get(..nf).unwrap_or_default();
                    grown = !gradient::filter(gradient, regressor, f, past.as_slice());
                }
                OutputErrorMethod::Instruments => {
                    copy(regressor, gradient);
                    copy(regressor, work);
                    copy(past.as_slice().get(..nf).unwrap_or_default(), work);
                    error = output - dot(work, parameters);
                }
            }
            let (mut variance, mut nis) = ([T::NAN], T::zero());
            let action = if error.is_finite() {
                let corrected =
                    estimator.correct(gradient, &[error], &mut variance, |parameters, direction, step| {
                        move_stably(parameters, direction, step, 0..nf, work)
                    });
                // What is too large here is so by what came before: time must go on, or it would stay.
                let (found, action) = corrected.ok()?;
                nis = found;
                action
            } else {
                estimator.advance();
                if output.is_finite() { Action::NotReady } else { Action::Missing }
            };
            match method {
                OutputErrorMethod::PredictionError => {
                    if grown {
                        past.fill(T::zero());
                    }
                    gradient::push(past.as_mut_slice(), gradient, nf);
                }
                OutputErrorMethod::Instruments => {
                    estimator.forget_noise();
                    (variance, nis) = ([T::NAN], T::zero());
                }
            }
            let [variance] = variance;
            let simulated = dot(regressor, estimator.parameters().as_slice());
            let usable = simulated.is_finite() && !is_large(simulated, size.value());
            let innovation = Innovation { error: innovation, variance, nis, action };
            usable.then_some((innovation, simulated))
        })
    }

    /// Forgets past gradients or measurements.
    fn forget_past(&mut self) {
        self.past.fill(T::zero());
        if self.method == OutputErrorMethod::Instruments {
            self.past.as_mut_slice().iter_mut().take(self.nf).for_each(|measured| *measured = T::NAN);
        }
    }

    /// Takes the parameters back to their limits, one range for each, and returns whether one was out. See
    /// [`RecursiveLeastSquares::keep_within`], whose errors it has. Where the nearest point has no stable F, each
    /// parameter is cut off by itself, and F stays as it is if that does not help.
    pub fn keep_within(&mut self, limits: &[RangeInclusive<T>]) -> Result<bool, Error> {
        let RecursiveOutputError { estimator, past, nf, scratch, .. } = self;
        let size = past.shape_generic().0;
        check_limits(limits, size.value())?;
        Ok(size.with_scratch(scratch, |[before, work], []| {
            gradient::keep_within(estimator, limits, 0..*nf, before, work)
        }))
    }

    /// Whether this type has the sizes for these orders. As [`RecursiveArx::fits`](crate::RecursiveArx::fits).
    pub const fn fits(orders: &ArxOrders<'_>) -> bool {
        Lags::<T, N, D>::fits(orders)
    }

    /// F(q): 1, f_1 … f_nf.
    pub fn f(&self) -> impl Iterator<Item = T> + Clone + '_ {
        self.lags.output_coefficients(self.estimator.parameters().as_slice())
    }

    /// Tells that an unknown number of samples is missing here. See [`Lags::gap`].
    pub fn gap(&mut self) {
        self.lags.gap();
        self.forget_past();
    }

    /// Sets the parameters: see [`RecursiveLeastSquares::set_parameters`], whose errors it has.
    ///
    /// Errors: also [`Error::OutOfRange`] if F is not stable.
    pub fn set_parameters(&mut self, parameters: OVector<T, N>) -> Result<(), Error> {
        self.estimator.check_parameters(&parameters)?;
        self.check_stable(&parameters)?;
        self.estimator.set_parameters(parameters)
    }

    /// That the variance of the noise is known, which a rule for outliers compares with.
    fn knows_noise(&self, outliers: Outliers<T>) -> Result<(), Error> {
        let range = "for PredictionError only: with Instruments the variance of the noise is not known";
        let known = self.method == OutputErrorMethod::PredictionError || outliers == Outliers::Used;
        known.then_some(()).ok_or(Error::OutOfRange { argument: "outliers", range })
    }

    pass_on!(dead_zone);
    pass_on_settings!(OVector<T, N>, RecursiveLeastSquares<T, N>, Self::knows_noise);
}

#[cfg(feature = "serde")]
mod snapshot;
#[cfg(test)]
mod tests;
