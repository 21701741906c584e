//! A recursive nonlinear ARX estimator: functions of delay lines that feed recursive least squares.

use core::ops::RangeInclusive;

use nalgebra::{Const, OVector};

use crate::rls::{pass_on, pass_on_settings};
use crate::{
    ArxOrders, Basis, Dimension, Error, Forgetting, Innovation, Lags, NonlinearArx, Real,
    RecursiveLeastSquares, Scaling,
};

/// A nonlinear ARX model, estimated while the plant runs.
///
/// ```text
/// y(k) = o + s (Σ θ_j f_j(z(k)) + e(k))
/// z(k) = [ y(k-1) … y(k-na)   u1(k-nk1) … u1(k-nk1-nb1+1)   u2(k-nk2) … ]', each as (x - offset)/scale
/// ```
///
/// It is [`RecursiveLeastSquares`] on the functions of a [`Basis`] of z, and linear in θ: all that is said there of
/// forgetting, starts and bounds holds here, and [`RecursiveArx`](crate::RecursiveArx) says in which order
/// [`measured`](RecursiveNarx::measured) and [`applied`](RecursiveNarx::applied) are called. Signals are scaled to
/// about 1 first, so that one prior serves all functions, and single precision is enough.
///
/// Terms come from a batch choice (`thetahat fit --narx`), whose parameters are these to the unit; or are all products
/// up to a degree, where there are few. More terms than the plant tells apart stay bounded, and are of no use.
///
/// # Sizes
///
/// `Z` is the number of regressors, `N` that of functions, and `D` the buffer for inputs on their way, as for [`Lags`].
/// Memory: that of [`NonlinearArx`] and of [`RecursiveLeastSquares`], and N numbers.
///
/// Source: Ljung, System Identification, 2nd ed., sections 5.4 and 11.2.
///
/// ```
/// use thetahat_core::nalgebra::Const;
/// use thetahat_core::{ArxOrders, Error, Forgetting, InputOrders, Polynomial, RecursiveNarx, Scaling};
///
/// // y(k) = 0.5 y(k-1) + u(k-1) - 0.2 y(k-1)^2, signals about 1.
/// const ORDERS: ArxOrders = ArxOrders { na: 1, inputs: &[InputOrders { nb: 1, nk: 1 }], constant: false };
/// const BASIS: Polynomial = Polynomial { factors: &[0, 1, 0, 0], ends: &[1, 2, 4] };
/// const UNIT: Scaling<f32> = Scaling { offset: 0.0, scale: 1.0 };
/// let mut plant: RecursiveNarx<f32, Polynomial, Const<2>, Const<3>> =
///     RecursiveNarx::new(BASIS, &ORDERS, UNIT, &[UNIT], Forgetting::default())?;
///
/// let (mut y, mut u) = (0.0, 0.0);
/// for k in 0..300 {
///     y = 0.5 * y + u - 0.2 * y * y;
///     plant.measured(y)?;
///     u = [0.7, -0.4, 1.0, 0.1, -0.8][k * k % 5] * if k % 3 == 0 { 1.0 } else { 0.6 };
///     plant.applied(&[u])?;
/// }
/// let truth = [0.5, 1.0, -0.2];
/// assert!(plant.estimator().parameters().iter().zip(truth).all(|(found, truth)| (found - truth).abs() < 1e-3));
///
/// // The next two outputs, with inputs that are still to be chosen.
/// let mut ahead = [0.0; 2];
/// plant.predict(&[0.5], &mut ahead[..1])?;
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "B: Clone + serde::Serialize",
        deserialize = "B: Basis<T> + serde::Deserialize<'de>"
    ))
)]
#[cfg_attr(feature = "serde", serde(into = "snapshot::Snapshot<T, B, Z, N, D>"))]
#[cfg_attr(feature = "serde", serde(try_from = "snapshot::Snapshot<T, B, Z, N, D>"))]
pub struct RecursiveNarx<
    T: Real,
    B,
    Z: Dimension,
    N: Dimension + Dimension<Const<1>>,
    D: Dimension = Const<1>,
> {
    model: NonlinearArx<T, B, Z, D>,
    estimator: RecursiveLeastSquares<T, N>,
    /// f(z) of the sample.
    functions: OVector<T, N>,
}

impl<T: Real, B: Basis<T>, Z: Dimension, N: Dimension + Dimension<Const<1>>, D: Dimension>
    RecursiveNarx<T, B, Z, N, D>
{
    /// An estimator that knows nothing yet, and has seen no sample.
    ///
    /// Errors: those of [`NonlinearArx::new`] and of [`RecursiveLeastSquares::new`]; [`Error::Length`] if there are not
    /// `N` functions.
    pub fn new(
        basis: B,
        orders: &ArxOrders<'_>,
        output: Scaling<T>,
        inputs: &[Scaling<T>],
        forgetting: Forgetting<T>,
    ) -> Result<Self, Error> {
        let found = basis.functions();
        let size = <N as crate::dim::Workspace>::exactly(found).map_err(|expected| Error::Length {
            argument: "basis",
            expected,
            found,
        })?;
        let model = NonlinearArx::new(basis, orders, output, inputs)?;
        let estimator = RecursiveLeastSquares::new(&size.vector(T::one()), forgetting)?;
        Ok(RecursiveNarx { model, estimator, functions: size.vector(T::NAN) })
    }

    /// The same with a noise variance, in squared units of the output, that is known from earlier samples. See
    /// [`RecursiveLeastSquares::with_noise_variance`], whose errors it has.
    pub fn with_noise_variance(mut self, variance: T, samples: usize) -> Result<Self, Error> {
        self.set_noise_variance(variance, samples)?;
        Ok(self)
    }

    /// The same with a dead zone, in the unit of the output. See [`RecursiveLeastSquares::with_dead_zone`], whose
    /// errors it has.
    pub fn with_dead_zone(mut self, width: T) -> Result<Self, Error> {
        self.set_dead_zone(width)?;
        Ok(self)
    }

    /// y(k) arrives: time goes on to k, and the model learns. See
    /// [`RecursiveArx::measured`](crate::RecursiveArx::measured), whose errors it has.
    ///
    /// The innovation is in units of the output. Beside the functions 1.5 n² + 7 n multiply-adds and n divisions.
    pub fn measured(&mut self, output: T) -> Result<Innovation<T>, Error> {
        self.model.lags.check_delays()?;
        self.model.check_samples(&[], output)?;
        Ok(self.take_sample(&[], output, true))
    }

    /// u(k): what acts on the plant from now on. See [`RecursiveArx::applied`](crate::RecursiveArx::applied), whose
    /// errors it has.
    pub fn applied(&mut self, inputs: &[T]) -> Result<(), Error> {
        let missing = !self.model.lags.awaits_inputs();
        self.model.applied(inputs)?;
        if missing {
            self.estimator.advance();
        }
        Ok(())
    }

    /// One row of a log: y(k) and u(k), recorded at the same instant. See
    /// [`RecursiveArx::log_row`](crate::RecursiveArx::log_row), whose errors it has.
    pub fn log_row(&mut self, output: T, inputs: &[T]) -> Result<Innovation<T>, Error> {
        self.model.check_row(output, inputs)?;
        Ok(self.take_sample(inputs, output, false))
    }

    /// One sample, checked.
    fn take_sample(&mut self, inputs: &[T], output: T, inputs_follow: bool) -> Innovation<T> {
        let RecursiveNarx { model, estimator, functions } = self;
        let functions = functions.as_mut_slice();
        let scale = model.output.scale;
        let taken = model.step(inputs, output, inputs_follow, |basis, z, output| {
            basis.evaluate(z, functions);
            // What is too large here is so by what came before: time must go on, or it would stay.
            estimator.take(functions, output).ok()
        });
        if let Some(innovation) = taken.flatten() {
            if let Some(unused) = estimator.unused(innovation.nis, innovation.action) {
                // These lines hold outputs, not their negatives.
                model.lags.take_from_newest(|_| -innovation.error * unused);
            }
            let (error, variance) = (innovation.error * scale, innovation.variance * scale * scale);
            return Innovation { error, variance, ..innovation };
        }
        estimator.advance();
        Innovation::not_ready()
    }

    /// The outputs to come, by the parameters of now. See [`NonlinearArx::predict`], whose errors it has.
    pub fn predict(&self, future_inputs: &[T], outputs: &mut [T]) -> Result<(), Error> {
        self.model.predict(self.estimator.parameters().as_slice(), future_inputs, outputs)
    }

    /// The same in delay lines of the caller. See [`NonlinearArx::predict_in`], whose errors it has.
    pub fn predict_in(
        &self,
        workspace: &mut Lags<T, Z, D>,
        future_inputs: &[T],
        outputs: &mut [T],
    ) -> Result<(), Error> {
        self.model.predict_in(workspace, self.estimator.parameters().as_slice(), future_inputs, outputs)
    }

    /// Takes the parameters back to their limits, one range for each, and returns whether one was out. See
    /// [`RecursiveLeastSquares::keep_within`], whose errors it has.
    pub fn keep_within(&mut self, limits: &[RangeInclusive<T>]) -> Result<bool, Error> {
        self.estimator.keep_within(limits)
    }

    /// The variance of the noise, in squared units of the output; `None` until enough samples are in.
    pub fn noise_variance(&self) -> Option<T> {
        let scale = self.model.output.scale;
        self.estimator.noise_variance().map(|variance| variance * scale * scale)
    }

    /// Tells that an unknown number of samples is missing here. See [`Lags::gap`].
    pub fn gap(&mut self) {
        self.model.gap();
    }

    /// Sets the parameters: see [`RecursiveLeastSquares::set_parameters`], whose errors it has.
    pub fn set_parameters(&mut self, parameters: OVector<T, N>) -> Result<(), Error> {
        self.estimator.set_parameters(parameters)
    }

    /// Sets the noise variance, in squared units of the output: see [`RecursiveLeastSquares::set_noise_variance`],
    /// whose errors it has.
    pub fn set_noise_variance(&mut self, variance: T, samples: usize) -> Result<(), Error> {
        let scale = self.model.output.scale;
        self.estimator.set_noise_variance(variance / (scale * scale), samples)
    }

    /// Sets the dead zone, in the unit of the output: see [`RecursiveLeastSquares::set_dead_zone`], whose errors it
    /// has.
    pub fn set_dead_zone(&mut self, width: T) -> Result<(), Error> {
        self.estimator.set_dead_zone(width / self.model.output.scale)
    }

    /// The model without its parameters: functions, scalings, delay lines, and the slopes of g.
    pub fn model(&self) -> &NonlinearArx<T, B, Z, D> {
        &self.model
    }

    pass_on!(start, solution);
    pass_on_settings!(OVector<T, N>, RecursiveLeastSquares<T, N>);
}

#[cfg(feature = "serde")]
mod snapshot;
#[cfg(test)]
mod tests;
