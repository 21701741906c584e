//! A stored nonlinear ARX model: functions of lags, and how its signals are scaled.

use nalgebra::{Const, OVector};

use crate::error::check_length;
use crate::lags::{is_infinite, is_large};
use crate::{ArxOrders, Basis, Dimension, Error, Lags, Real};

/// How a signal is made about 1 in size: z = (x - offset)/scale.
///
/// ```
/// use thetahat_core::nalgebra::Const;
/// use thetahat_core::{ArxOrders, Error, NonlinearArx, Polynomial, Scaling};
///
/// // y(k) = 20 + 4 z_0, z_0 = (y(k-1) - 20)/8: the deviation from 20 is halved in each sample.
/// const ORDERS: ArxOrders = ArxOrders { na: 1, inputs: &[], constant: false };
/// const BASIS: Polynomial = Polynomial { factors: &[0], ends: &[1] };
/// let scaling = Scaling { offset: 20.0, scale: 8.0 };
/// let mut cooling: NonlinearArx<f64, Polynomial, Const<1>> = NonlinearArx::new(BASIS, &ORDERS, scaling, &[])?;
/// cooling.log_row(28.0, &[])?;
/// let mut ahead = [0.0; 2];
/// cooling.predict(&[0.5], &[], &mut ahead)?;
/// assert_eq!(ahead, [24.0, 22.0]);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scaling<T> {
    /// What is subtracted, in the unit of the signal: its mean, or the working point.
    pub offset: T,
    /// What it is divided by then: its standard deviation, or how far it goes from there.
    pub scale: T,
}

impl<T: Real> Scaling<T> {
    fn apply(self, sample: T) -> T {
        (sample - self.offset) / self.scale
    }

    pub(crate) fn undo(self, value: T) -> T {
        self.offset + self.scale * value
    }

    pub(crate) fn check(self) -> Result<(), Error> {
        if !self.offset.is_finite() {
            return Err(Error::NotFinite { argument: "offset" });
        }
        if self.scale.is_finite() && self.scale >= T::MIN_POSITIVE {
            return Ok(());
        }
        Err(Error::OutOfRange { argument: "scale", range: "above 0 and finite" })
    }
}

/// A nonlinear ARX model without its parameters, and the samples that it predicts from:
///
/// ```text
/// ŷ(k) = o + s g(z(k)),     g(z) = Σ θ_j f_j(z)
/// z(k) = [ y(k-1) … y(k-na)   u1(k-nk1) … u1(k-nk1-nb1+1)   u2(k-nk2) … ]', each as (x - offset)/scale
/// ```
///
/// with o and s the offset and the scale of the output, and f_j the functions of a [`Basis`]. It is what a report of
/// `thetahat fit --narx` holds: parameters of its report predict the same bits here.
/// [`RecursiveNarx`](crate::RecursiveNarx) estimates them as samples arrive.
///
/// # Sizes
///
/// `Z` is the number of regressors, na and all nb, and `D` the buffer for inputs on their way, as for [`Lags`]. Memory:
/// 3 Z + D + 2 numbers and 6 Z bytes, and the basis. There are at most `Z` inputs.
///
/// Source: Ljung, System Identification, 2nd ed., section 5.4.
///
/// ```
/// use thetahat_core::nalgebra::Const;
/// use thetahat_core::{ArxOrders, Error, InputOrders, NonlinearArx, Polynomial, Scaling};
///
/// // A tank: y(k) = 20 + 5 (0.9 z_0 + 0.2 z_1 - 0.05 z_0^2), z_0 = (y(k-1) - 20)/5, z_1 = (u(k-1) - 1)/2.
/// const ORDERS: ArxOrders = ArxOrders { na: 1, inputs: &[InputOrders { nb: 1, nk: 1 }], constant: false };
/// const BASIS: Polynomial = Polynomial { factors: &[0, 1, 0, 0], ends: &[1, 2, 4] };
/// const THETA: [f32; 3] = [0.9, 0.2, -0.05];
/// let (level, valve) = (Scaling { offset: 20.0, scale: 5.0 }, Scaling { offset: 1.0, scale: 2.0 });
/// let mut tank: NonlinearArx<f32, Polynomial, Const<2>> = NonlinearArx::new(BASIS, &ORDERS, level, &[valve])?;
/// tank.log_row(25.0, &[3.0])?;
/// let mut ahead = [0.0; 2];
/// tank.predict(&THETA, &[3.0, 3.0], &mut ahead)?;
/// assert_eq!(ahead[0], 20.0 + 5.0 * (0.9 + 0.2 - 0.05)); // z_0 = z_1 = 1
///
/// // dy(k)/dy(k-1) = 0.9 - 0.1 z_0 and dy(k)/du(k-1) = 5 0.2/2: a row of F and of G, for an extended Kalman filter.
/// let mut slopes = [0.0; 2];
/// tank.slopes_at(&THETA, &[25.0, 3.0], &mut slopes)?;
/// assert!((slopes[0] - 0.8).abs() < 1e-6 && (slopes[1] - 0.5).abs() < 1e-6);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct NonlinearArx<T: Real, B, Z: Dimension, D: Dimension = Const<1>> {
    pub(crate) basis: B,
    pub(crate) output: Scaling<T>,
    /// As many as there are inputs, then some of no use.
    pub(crate) inputs: OVector<Scaling<T>, Z>,
    /// z and what comes into it: scaled samples, outputs with their own sign.
    pub(crate) lags: Lags<T, Z, D>,
}

impl<T: Real, B: Basis<T>, Z: Dimension, D: Dimension> NonlinearArx<T, B, Z, D> {
    /// A model that has seen no sample.
    ///
    /// `orders` say which lags z is made of; `inputs` has one scaling for each input.
    ///
    /// Errors: those of [`Lags::new`] and of [`Basis::check`]; [`Error::Length`] if there is not one scaling for each
    /// input, or more inputs than regressors; [`Error::NotFinite`] and [`Error::OutOfRange`] for an offset or a scale.
    pub fn new(
        basis: B,
        orders: &ArxOrders<'_>,
        output: Scaling<T>,
        inputs: &[Scaling<T>],
    ) -> Result<Self, Error> {
        let lags: Lags<T, Z, D> = Lags::new(orders)?;
        let size = lags.size();
        basis.check(size.value())?;
        check_length("inputs", orders.inputs.len(), inputs.len())?;
        if inputs.len() > size.value() {
            return Err(Error::Length { argument: "inputs", expected: size.value(), found: inputs.len() });
        }
        inputs.iter().chain([&output]).try_for_each(|scaling| scaling.check())?;
        let mut own = size.vector(Scaling { offset: T::zero(), scale: T::one() });
        own.as_mut_slice().iter_mut().zip(inputs).for_each(|(own, &scaling)| *own = scaling);
        Ok(NonlinearArx { basis, output, inputs: own, lags })
    }

    /// y(k) arrives, and time goes on to k. See [`RecursiveArx::measured`](crate::RecursiveArx::measured), whose errors
    /// it has.
    pub fn measured(&mut self, output: T) -> Result<(), Error> {
        self.lags.check_delays()?;
        self.check_samples(&[], output)?;
        self.step(&[], output, true, |_, _, _| ());
        Ok(())
    }

    /// u(k): what acts from now on, until the next measurement. See
    /// [`RecursiveArx::applied`](crate::RecursiveArx::applied), whose errors it has.
    pub fn applied(&mut self, inputs: &[T]) -> Result<(), Error> {
        self.lags.check_inputs(inputs)?;
        self.check_samples(inputs, T::NAN)?;
        if self.lags.awaits_inputs() {
            self.lags.complete_each(scaled(&self.inputs, inputs));
        } else {
            self.step(inputs, T::NAN, false, |_, _, _| ());
        }
        Ok(())
    }

    /// One row of a log: y(k) and u(k), recorded at the same instant. See
    /// [`RecursiveArx::log_row`](crate::RecursiveArx::log_row), whose errors it has.
    pub fn log_row(&mut self, output: T, inputs: &[T]) -> Result<(), Error> {
        self.check_row(output, inputs)?;
        self.step(inputs, output, false, |_, _, _| ());
        Ok(())
    }

    /// What [`log_row`](NonlinearArx::log_row) checks.
    pub(crate) fn check_row(&self, output: T, inputs: &[T]) -> Result<(), Error> {
        self.lags.check_inputs(inputs)?;
        self.check_samples(inputs, output)
    }

    /// That no sample is infinite, or too large once it is scaled.
    pub(crate) fn check_samples(&self, inputs: &[T], output: T) -> Result<(), Error> {
        if is_infinite(&output) {
            return Err(Error::Infinite { argument: "output" });
        }
        let size = self.lags.size().value();
        let mut each = inputs.iter().zip(self.inputs.as_slice());
        if each.any(|(&sample, scaling)| is_large(scaling.apply(sample), size)) {
            return Err(Error::TooLarge { argument: "inputs" });
        }
        if is_large(self.output.apply(output), size) {
            return Err(Error::TooLarge { argument: "output" });
        }
        Ok(())
    }

    /// One sample, checked. `learn` gets the basis, z(k) and the scaled y(k), if nothing in z is missing.
    #[inline(always)]
    pub(crate) fn step<A>(
        &mut self,
        inputs: &[T],
        output: T,
        inputs_follow: bool,
        learn: impl FnOnce(&B, &[T], T) -> A,
    ) -> Option<A> {
        let output = self.output.apply(output);
        self.lags.push_each(scaled(&self.inputs, inputs), T::NAN);
        let learned = self.lags.regressor().map(|z| learn(&self.basis, z.as_slice(), output));
        // Delay lines take outputs with the other sign.
        self.lags.push_checked(&[-output]);
        self.lags.await_inputs(inputs_follow);
        learned
    }

    /// The outputs to come, ŷ(k+1), ŷ(k+2), …, as many as `outputs` holds, with predicted outputs in the place of
    /// measured ones: a free run from the samples so far. Which input comes first is as for
    /// [`RecursiveArx::predict`](crate::RecursiveArx::predict), whose errors it has, and [`Error::Length`] if there is
    /// not one parameter for each function.
    ///
    /// The state does not change. With `Dyn` the delay lines are cloned.
    pub fn predict(&self, parameters: &[T], future_inputs: &[T], outputs: &mut [T]) -> Result<(), Error> {
        self.predict_in(&mut self.lags.clone(), parameters, future_inputs, outputs)
    }

    /// The same as [`predict`](NonlinearArx::predict) in delay lines of the caller, such as a clone of
    /// [`lags`](NonlinearArx::lags), whose samples are lost: with `Dyn` it does not allocate.
    ///
    /// Errors: those of `predict`; [`Error::Length`] (only with `Dyn`) if the lines have another size.
    pub fn predict_in(
        &self,
        workspace: &mut Lags<T, Z, D>,
        parameters: &[T],
        future_inputs: &[T],
        outputs: &mut [T],
    ) -> Result<(), Error> {
        check_length("parameters", self.basis.functions(), parameters.len())?;
        let inputs = workspace.inputs();
        check_length("future_inputs", outputs.len().saturating_mul(inputs), future_inputs.len())?;
        if future_inputs.iter().any(is_infinite) {
            return Err(Error::Infinite { argument: "future_inputs" });
        }
        workspace.copy_from(&self.lags)?;
        let awaiting = workspace.awaits_inputs();
        let mut grown = false;
        for (step, output) in outputs.iter_mut().enumerate() {
            if grown {
                *output = T::NAN;
                continue;
            }
            let next = scaled(&self.inputs, future_inputs.get(step * inputs..).unwrap_or_default());
            if awaiting {
                workspace.complete_each(&next);
                workspace.push(&[], T::NAN);
            } else {
                workspace.push_each(&next, T::NAN);
            }
            let value = workspace.regressor().map(|z| self.basis.value(parameters, z.as_slice()));
            let predicted = value.map(|value| self.output.undo(value));
            grown = predicted.is_some_and(|predicted| !predicted.is_finite());
            *output = predicted.filter(|_| !grown).unwrap_or(T::NAN);
            workspace.push_checked(&[-value.unwrap_or(T::NAN)]);
        }
        if grown { Err(Error::Overflow) } else { Ok(()) }
    }

    /// y where the regressors, in the order of z and in the units of the signals, are these.
    ///
    /// With `Dyn` it allocates z.
    ///
    /// Errors: [`Error::Length`] if there is not one regressor for each element of z, or not one parameter for each
    /// function.
    pub fn output_at(&self, parameters: &[T], regressors: &[T]) -> Result<T, Error> {
        let z = self.point(parameters, regressors)?;
        Ok(self.output.undo(self.basis.value(parameters, z.as_slice())))
    }

    /// dy/dx_i at these regressors, in the order of z and in the units of the signals: the Jacobian of g.
    ///
    /// With `Dyn` it allocates z.
    ///
    /// Errors, after which `slopes` is as it was: those of [`output_at`](NonlinearArx::output_at); [`Error::Length`] if
    /// there is not one slope for each regressor.
    pub fn slopes_at(&self, parameters: &[T], regressors: &[T], slopes: &mut [T]) -> Result<(), Error> {
        check_length("slopes", self.lags.size().value(), slopes.len())?;
        let z = self.point(parameters, regressors)?;
        slopes.fill(T::zero());
        self.basis.add_slopes(parameters, z.as_slice(), slopes);
        for (index, slope) in slopes.iter_mut().enumerate() {
            *slope = *slope * self.output.scale / self.scaling_of(index).scale;
        }
        Ok(())
    }

    /// z of these regressors.
    fn point(&self, parameters: &[T], regressors: &[T]) -> Result<OVector<T, Z>, Error> {
        check_length("parameters", self.basis.functions(), parameters.len())?;
        check_length("regressors", self.lags.size().value(), regressors.len())?;
        let mut z = self.lags.size().vector(T::NAN);
        for (index, (z, &regressor)) in z.as_mut_slice().iter_mut().zip(regressors).enumerate() {
            *z = self.scaling_of(index).apply(regressor);
        }
        Ok(z)
    }

    /// The scaling of an element of z.
    fn scaling_of(&self, index: usize) -> Scaling<T> {
        let own = self.lags.input_of(index).and_then(|input| self.inputs.as_slice().get(input));
        own.copied().unwrap_or(self.output)
    }

    /// Tells that an unknown number of samples is missing here. See [`Lags::gap`].
    pub fn gap(&mut self) {
        self.lags.gap();
    }

    /// The number of regressors, `Z`.
    pub fn regressors(&self) -> usize {
        self.lags.size().value()
    }

    /// How many lags of an input are regressors; `None` if there is no such input.
    pub fn lags_of(&self, input: usize) -> Option<usize> {
        let own = |element: &usize| self.lags.input_of(*element) == Some(input);
        (input < self.lags.inputs()).then(|| (0..self.regressors()).filter(own).count())
    }

    /// The functions.
    pub fn basis(&self) -> &B {
        &self.basis
    }

    /// The delay lines: the samples, scaled, that the next ones are predicted from.
    pub fn lags(&self) -> &Lags<T, Z, D> {
        &self.lags
    }
}

/// The scaled inputs by their index.
fn scaled<T: Real, Z: Dimension>(scalings: &OVector<Scaling<T>, Z>, inputs: &[T]) -> impl Fn(usize) -> T {
    move |index| {
        let sample = inputs.get(index).copied().unwrap_or(T::NAN);
        scalings.as_slice().get(index).map_or(T::NAN, |scaling| scaling.apply(sample))
    }
}

#[cfg(test)]
pub(crate) mod tests;
