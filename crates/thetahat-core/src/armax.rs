//! A recursive ARMAX estimator: extended least squares, and the prediction error method.

use core::ops::{Range, RangeInclusive};

use nalgebra::{Const, OMatrix, OVector};

use crate::gradient;
use crate::lags::{is_large, take_rows, tell_inputs, tell_predictions};
use crate::rls::{check_limits, pass_on, pass_on_settings};
use crate::stability::move_stably;
use crate::ud::dot;
use crate::{
    Action, ArxOrders, ConstantOrders, Dimension, Error, Forgetting, Innovation, InputOrders, Lags, Real,
    RecursiveLeastSquares, RlsStart,
};

/// The orders of an ARMAX model: those of an [ARX model](ArxOrders), and the order of its noise.
///
/// ```
/// use thetahat_core::{ArmaxOrders, InputOrders};
///
/// const ORDERS: ArmaxOrders =
///     ArmaxOrders { na: 2, inputs: &[InputOrders { nb: 2, nk: 3 }], nc: 1, constant: false };
/// assert_eq!(ORDERS.parameters(), 5);
/// assert_eq!(ORDERS.delays(), 3);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ArmaxOrders<'a> {
    /// The number of past outputs.
    pub na: usize,
    /// The orders of each input, in the order in which samples are given. Empty for ARMA.
    pub inputs: &'a [InputOrders],
    /// The number of past residuals.
    pub nc: usize,
    /// Whether a constant is a parameter too, as in [`ArxOrders`].
    pub constant: bool,
}

impl<'a> ArmaxOrders<'a> {
    /// The number of parameters: na plus every nb plus nc, plus 1 with a constant.
    pub const fn parameters(&self) -> usize {
        self.plant().parameters().saturating_add(self.nc)
    }

    /// The number of samples that are on their way: the nk of every input that has coefficients, added up.
    pub const fn delays(&self) -> usize {
        self.plant().delays()
    }

    const fn plant(&self) -> ArxOrders<'a> {
        ArxOrders { na: self.na, inputs: self.inputs, constant: self.constant }
    }
}

/// Along which gradient a [`RecursiveArmax`] corrects.
///
/// ```
/// use thetahat_core::nalgebra::Const;
/// use thetahat_core::{ArmaxMethod, ArmaxOrders, Error, Forgetting, InputOrders, RecursiveArmax};
///
/// const ORDERS: ArmaxOrders = ArmaxOrders { na: 1, inputs: &[InputOrders { nb: 1, nk: 1 }], nc: 1, constant: false };
/// type Plant = RecursiveArmax<f32, Const<{ ORDERS.parameters() }>>;
/// let plant = Plant::new(&ORDERS, ArmaxMethod::PredictionError, 5.0, &[1.0], 0.1, Forgetting::default())?;
/// assert_eq!(plant.c().count(), 2); // 1 and c_1
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ArmaxMethod {
    /// ψ = φ: the residuals are taken for measured. Quick to converge, but not always to the truth: it does if
    /// 1/C(q) - 1/2 is positive real, and may fail if not. Also called extended least squares, or recursive
    /// pseudo-linear regression.
    ExtendedLeastSquares,
    /// ψ = φ/C(q), the gradient of the prediction: converges to a minimum of the prediction error. As the first
    /// residuals are poor and C is not known yet, it may be slow at the start, above all where nothing is forgotten:
    /// with λ = 0.999 it recovers sooner than with none. nc n multiply-adds and moves more.
    PredictionError,
}

/// An ARMAX model, estimated while the plant runs.
///
/// ```text
/// A(q) y(k) = Σ over the inputs B_i(q) u_i(k) [+ constant] + C(q) e(k),       C(q) = 1 + c_1 q⁻¹ + … + c_nc q⁻ⁿᶜ
/// ```
///
/// with A and B as in [`RecursiveArx`](crate::RecursiveArx). Where the disturbance is not white, it finds the plant
/// without bias, and predicts the disturbance too. The regressor holds past residuals beside the signals,
///
/// ```text
/// φ(k) = [ -y(k-1) … -y(k-na)   u_1(k-nk_1) …   1          ε(k-1) … ε(k-nc) ]'
/// θ    = [ a_1 … a_na           b_0 …           constant   c_1 … c_nc ]'
///
/// e = y - φ'θ̂                                  the innovation
/// ψ = φ, or ψ(k) = φ(k) - c_1 ψ(k-1) - … - c_nc ψ(k-nc)
/// θ̂ <- θ̂ + P ψ e/(λ + ψ'P ψ),                  P as in RecursiveLeastSquares, with ψ
/// ε(k) = y - φ'θ̂                               the residual, with the new θ̂
/// ```
///
/// [`ArmaxMethod`] says which ψ is for what. Everything said of forgetting and bounds at [`RecursiveLeastSquares`]
/// holds here; the start is the standard one where nc is above 0.
///
/// C stays stable, with its zeros inside the radius 1 - 1/1024, so that what 1/C(q) filters is forgotten after some
/// thousand samples: a step that would lead out is halved until it does not, at most ten times, and else left out.
/// [`Action::Projected`] tells.
///
/// Time is the order of the calls, and a missing sample is NaN, as in
/// [`RecursiveArx`](crate::RecursiveArx#time). Residuals that are not known, at the start and of missing samples,
/// count as 0.
///
/// # Sizes
///
/// `N` is the number of parameters, [`ArmaxOrders::parameters`], and `D` the buffer for inputs on their way, at least
/// [`ArmaxOrders::delays`]. Memory: that of `RecursiveArx`, and n² + 1 numbers for past gradients.
///
/// Source: Ljung and Söderström, Theory and Practice of Recursive Identification, 1983, sections 3.7.2 (gradients),
/// 5.5 (residuals) and 6.6 (projection); Ljung, System Identification, 2nd ed., sections 11.4 to 11.6; Jury, Theory and
/// Application of the z-Transform Method, 1964, chapter 3 (the Schur-Cohn recursion).
///
/// ```
/// use thetahat_core::nalgebra::Const;
/// use thetahat_core::{ArmaxMethod, ArmaxOrders, Error, Forgetting, InputOrders, RecursiveArmax};
///
/// // y(k) = 0.8 y(k-1) + u(k-1) + e(k) + 0.6 e(k-1)
/// let orders = ArmaxOrders { na: 1, inputs: &[InputOrders { nb: 1, nk: 1 }], nc: 1, constant: false };
/// // Outputs are about 2, inputs 1, the noise 0.5.
/// let mut plant: RecursiveArmax<f64, Const<3>> =
///     RecursiveArmax::new(&orders, ArmaxMethod::PredictionError, 2.0, &[1.0], 0.5, Forgetting::None)?;
///
/// let (mut y, mut u, mut before, mut seed) = (0.0, 0.0, 0.0, 1_u32);
/// for k in 0..4000 {
///     seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
///     let e = f64::from(seed) / f64::from(u32::MAX) - 0.5;
///     y = 0.8 * y + u + e + 0.6 * before;
///     before = e;
///     plant.measured(y)?;
///     u = if k % 13 < 5 { 1.0 } else { -1.0 };
///     plant.applied(&[u])?;
/// }
/// assert!((plant.a().nth(1).unwrap() + 0.8).abs() < 0.01);
/// assert!((plant.b(0).unwrap().nth(1).unwrap() - 1.0).abs() < 0.05);
/// assert!((plant.c().nth(1).unwrap() - 0.6).abs() < 0.05);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", into = "snapshot::Snapshot<T, N, D>"))]
#[cfg_attr(feature = "serde", serde(try_from = "snapshot::Snapshot<T, N, D>"))]
pub struct RecursiveArmax<T: Real, N: Dimension + Dimension<Const<1>>, D: Dimension = Const<1>> {
    lags: Lags<T, N, D>,
    estimator: RecursiveLeastSquares<T, N>,
    /// ψ(k-1) … ψ(k-nc), a column each. There are at most n, as each has a parameter.
    gradients: OMatrix<T, N, N>,
    /// ε(k-1), on its way to φ.
    residual: T,
    nc: usize,
    method: ArmaxMethod,
    scratch: N::Scratch<T>,
}

impl<T: Real, N: Dimension + Dimension<Const<1>>, D: Dimension> RecursiveArmax<T, N, D> {
    /// An estimator that knows nothing yet, and has seen no sample.
    ///
    /// The scales are the typical magnitudes of the output, of each input, and of the noise e: what is left once
    /// the output is predicted. See [Scales](RecursiveLeastSquares#scales).
    ///
    /// Errors: [`Error::Orders`] if the orders do not make exactly `N` parameters; [`Error::Delays`] if `D` is too
    /// small for the delays; [`Error::Length`] if there is not one scale for each input; those of
    /// [`RecursiveLeastSquares::new`].
    pub fn new(
        orders: &ArmaxOrders<'_>,
        method: ArmaxMethod,
        output_scale: T,
        input_scales: &[T],
        noise_scale: T,
        forgetting: Forgetting<T>,
    ) -> Result<Self, Error> {
        let mut lags: Lags<T, N, D> = Lags::with_residuals(&orders.plant(), orders.nc)?;
        let scales = lags.scales(&[output_scale], input_scales, noise_scale)?;
        let estimator = RecursiveLeastSquares::new(&scales, forgetting)?;
        lags.clear_last(orders.nc);
        let size = scales.shape_generic().0;
        Ok(RecursiveArmax {
            lags,
            estimator,
            gradients: size.square(T::zero()),
            residual: T::zero(),
            nc: orders.nc,
            method,
            scratch: size.scratch::<T, 2, 0>(),
        })
    }

    /// The same as [`new`](RecursiveArmax::new) for orders that are constants, so that wrong sizes do not compile: see
    /// [`RecursiveArx::of`](crate::RecursiveArx::of). The errors are those of `new` that are left.
    pub fn of<O: ConstantOrders<ArmaxOrders<'static>>>(
        method: ArmaxMethod,
        output_scale: T,
        input_scales: &[T],
        noise_scale: T,
        forgetting: Forgetting<T>,
    ) -> Result<Self, Error> {
        const {
            assert!(
                Self::fits(&O::ORDERS),
                "N is not the number of parameters, or D is less than that of delays"
            )
        };
        Self::new(&O::ORDERS, method, output_scale, input_scales, noise_scale, forgetting)
    }

    /// The same with another start. See [`RecursiveLeastSquares::with_start`].
    ///
    /// Errors: [`Error::OutOfRange`] for any but the standard one with nc above 0: residuals are not known before
    /// parameters are.
    pub fn with_start(self, start: RlsStart) -> Result<Self, Error> {
        if self.nc > 0 && start != RlsStart::Standard {
            return Err(Error::OutOfRange { argument: "start", range: "standard, as nc is above 0" });
        }
        Ok(RecursiveArmax { estimator: self.estimator.with_start(start)?, ..self })
    }

    /// That C of these parameters is stable.
    fn check_stable(&self, parameters: &OVector<T, N>) -> Result<(), Error> {
        let c = of_noise(parameters.len(), self.nc);
        gradient::check_stable(parameters, c, "such that C(q) is stable")
    }

    /// y(k) arrives: time goes on to k, and the model learns from y(k) and the inputs that were
    /// [`applied`](RecursiveArmax::applied) before. NaN is a missing sample.
    ///
    /// The innovation is that of [`RecursiveLeastSquares::update`]. Its action is
    /// [`NotReady`](Action::NotReady) while a missing sample sits in a tap, the lines are not filled yet, or numbers
    /// that are accepted one by one would overflow together; and [`Projected`](Action::Projected) if the step was
    /// shortened to keep C stable. (A variance may be at its bound in the same sample:
    /// `Projected` comes before `Capped`.)
    ///
    /// Errors, after which nothing has changed, time included: as for
    /// [`RecursiveArx::measured`](crate::RecursiveArx::measured).
    ///
    /// 1.5 n² + (9 + nc) n multiply-adds, n divisions, and moves of (1 + nc) n + D numbers; each halving nc²/2 more.
    pub fn measured(&mut self, output: T) -> Result<Innovation<T>, Error> {
        self.lags.check_measured(&[output])?;
        Ok(self.take_sample(&[], output, true))
    }

    take_rows!();
    tell_predictions!(|this| this.residual);
    tell_inputs!();

    /// One sample, checked.
    fn take_sample(&mut self, inputs: &[T], output: T, inputs_follow: bool) -> Innovation<T> {
        let RecursiveArmax { lags, estimator, gradients, residual, nc, method, scratch } = self;
        let nc = *nc;
        lags.push(inputs, *residual);
        let size = gradients.shape_generic().0;
        let regressor = lags.regressor().map(OVector::as_slice);
        let innovation = size.with_scratch(scratch, |[gradient, work], []| {
            let mut innovation = Innovation::not_ready();
            let Some(regressor) = regressor else {
                estimator.advance();
                gradients.fill(T::zero());
                *residual = T::zero();
                return innovation;
            };
            let c = match method {
                ArmaxMethod::ExtendedLeastSquares => &[],
                ArmaxMethod::PredictionError => noise(estimator.parameters().as_slice(), nc),
            };
            let grown = !gradient::filter(gradient, regressor, c, gradients.as_slice());
            if output.is_finite() {
                let error = output - dot(regressor, estimator.parameters().as_slice());
                let mut variance = [T::NAN];
                let corrected =
                    estimator.correct(gradient, &[error], &mut variance, |parameters, direction, step| {
                        let c = of_noise(parameters.len(), nc);
                        move_stably(parameters, direction, step, c, work)
                    });
                // What is too large here is so by what came before: time must go on, or it would stay.
                let Ok((nis, action)) = corrected else {
                    estimator.advance();
                    gradients.fill(T::zero());
                    *residual = T::zero();
                    return innovation;
                };
                let [variance] = variance;
                // What is not used of an outlier does not come into the delay lines.
                let output =
                    output - estimator.unused(nis, action).map_or(T::zero(), |unused| error * unused);
                innovation = Innovation { error, variance, nis, action };
                let left = output - dot(regressor, estimator.parameters().as_slice());
                let usable = left.is_finite() && !is_large(left, size.value());
                *residual = if usable { left } else { T::zero() };
            } else {
                innovation.action = Action::Missing;
                estimator.advance();
                *residual = T::zero();
            }
            if grown {
                gradients.fill(T::zero());
            }
            gradient::push(gradients.as_mut_slice(), gradient, nc);
            innovation
        });
        lags.push_checked(&[output]);
        if let Some(unused) = estimator.unused(innovation.nis, innovation.action) {
            lags.take_from_newest(|_| innovation.error * unused);
        }
        lags.await_inputs(inputs_follow);
        innovation
    }

    /// Takes the parameters of A, B and the constant back to their limits, one range for each, and returns whether one
    /// was out. See [`RecursiveLeastSquares::keep_within`], whose errors it has. C has no limits but its stability:
    /// where the nearest point has no stable C, each parameter is cut off by itself.
    pub fn keep_within(&mut self, limits: &[RangeInclusive<T>]) -> Result<bool, Error> {
        let RecursiveArmax { estimator, gradients, nc, scratch, .. } = self;
        let size = gradients.shape_generic().0;
        check_limits(limits, size.value().saturating_sub(*nc))?;
        let c = of_noise(size.value(), *nc);
        Ok(size.with_scratch(scratch, |[before, work], []| {
            gradient::keep_within(estimator, limits, c, before, work)
        }))
    }

    /// Whether this type has the sizes for these orders. As [`RecursiveArx::fits`](crate::RecursiveArx::fits).
    pub const fn fits(orders: &ArmaxOrders<'_>) -> bool {
        Lags::<T, N, D>::fits_with(&orders.plant(), 1, orders.nc)
    }

    /// A(q): 1, a_1 … a_na.
    pub fn a(&self) -> impl Iterator<Item = T> + Clone + '_ {
        self.lags.output_coefficients(self.estimator.parameters().as_slice())
    }

    /// C(q): 1, c_1 … c_nc.
    pub fn c(&self) -> impl Iterator<Item = T> + Clone + '_ {
        core::iter::once(T::one())
            .chain(noise(self.estimator.parameters().as_slice(), self.nc).iter().copied())
    }

    /// Tells that an unknown number of samples is missing here. See [`Lags::gap`].
    pub fn gap(&mut self) {
        self.lags.gap();
        self.lags.clear_last(self.nc);
        self.gradients.fill(T::zero());
        self.residual = T::zero();
    }

    /// Sets the parameters: see [`RecursiveLeastSquares::set_parameters`], whose errors it has.
    ///
    /// Errors: also [`Error::OutOfRange`] if C is not stable.
    pub fn set_parameters(&mut self, parameters: OVector<T, N>) -> Result<(), Error> {
        self.estimator.check_parameters(&parameters)?;
        self.check_stable(&parameters)?;
        self.estimator.set_parameters(parameters)
    }

    pass_on!(noise_variance, dead_zone);
    pass_on_settings!(OVector<T, N>, RecursiveLeastSquares<T, N>);
}

/// Where C stands in this many parameters.
fn of_noise(parameters: usize, nc: usize) -> Range<usize> {
    parameters.saturating_sub(nc)..parameters
}

/// C of these parameters, without its 1.
fn noise<T>(parameters: &[T], nc: usize) -> &[T] {
    parameters.get(of_noise(parameters.len(), nc)).unwrap_or_default()
}

#[cfg(feature = "serde")]
mod snapshot;
#[cfg(test)]
mod tests;
