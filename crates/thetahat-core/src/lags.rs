//! Tapped delay lines: recent inputs and outputs make the regressor of an ARX model.

mod orders;
mod samples;

use nalgebra::{Const, OVector};

use crate::error::check_length;
use crate::{Dimension, Error, Real, ud};

pub use orders::{ArxOrders, ConstantOrders, InputOrders};
pub(crate) use samples::{is_large, take_rows, tell_inputs, tell_predictions};

/// The delay line of one input that has coefficients, or of what else is in φ after the outputs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Line {
    /// The index of an input; the next two are those of the constant and of the residuals.
    pub(crate) index: u16,
    pub(crate) nb: u16,
    pub(crate) nk: u16,
}

/// What goes into a delay line.
#[derive(PartialEq)]
enum Source {
    Input(usize),
    /// 1.
    Constant,
    /// The residual of the sample before.
    Residual,
}

impl Line {
    /// The line of an input, of the constant or of the residuals. Fails where a number does not fit.
    fn new(index: usize, &InputOrders { nb, nk }: &InputOrders) -> Result<Self, Error> {
        let available = usize::from(u16::MAX);
        Ok(Line {
            index: narrow(index).ok_or(Error::Length {
                argument: "inputs",
                expected: available,
                found: index,
            })?,
            nb: narrow(nb).ok_or(Error::Orders { needed: nb, available })?,
            nk: narrow(nk).ok_or(Error::Delays { needed: nk, available })?,
        })
    }

    /// What goes into it, of a model with this many inputs.
    fn source(&self, inputs: usize) -> Source {
        let index = usize::from(self.index);
        match index.checked_sub(inputs) {
            None => Source::Input(index),
            Some(0) => Source::Constant,
            Some(_) => Source::Residual,
        }
    }
}

/// Tapped delay lines: recent inputs and outputs, arranged as the regressor of an ARX model.
///
/// ```text
/// φ(k) = [ -y(k-1) … -y(k-na)   u1(k-nk1) … u1(k-nk1-nb1+1)   u2(k-nk2) …   1 ]'
/// ```
///
/// so that y(k) = φ(k)'θ + e(k) with θ = [a_1 … a_na  b1_0 … b1_(nb1-1)  b2_0 …  constant]. The 1 is there if the
/// [`ArxOrders`] have a constant.
/// The outputs enter with a minus sign (Ljung, System Identification, 2nd ed., section 4.2). With several outputs,
/// [`with_outputs`](Lags::with_outputs), the na past samples of the first one come first, then those of the next.
///
/// Each sample takes three steps, in this order:
///
/// 1. [`push_inputs`](Lags::push_inputs): u(k);
/// 2. [`regressor`](Lags::regressor): φ(k), if nothing in it is missing;
/// 3. [`push_output`](Lags::push_output): y(k).
///
/// A missing sample is NaN: push it, and time goes on. Then there is no regressor while a missing sample sits
/// in one of the taps; one that sits in none does no harm. At the start all earlier samples are missing.
///
/// # Sizes
///
/// `N` is the number of parameters, [`ArxOrders::parameters`]. `D` is the buffer for inputs on their way to the
/// regressor, at least [`ArxOrders::delays`]. It is 1 unless you say otherwise, which is right for one input
/// with nk = 1, and enough for nk = 0 or without input. Both are checked in [`new`](Lags::new). With the
/// feature `alloc` both may be `Dyn`: then they follow from the orders, and `new` allocates, and fails as a
/// `Vec` does if there is no memory.
///
/// Memory: N + D numbers, 6 N bytes and three machine words. Plain data: a clone can be driven on with predicted
/// outputs.
///
/// ```
/// use thetahat_core::nalgebra::{Const, Vector3};
/// use thetahat_core::{ArxOrders, Error, InputOrders, Lags};
///
/// // One input: y(k) depends on y(k-1), u(k-1) and u(k-2).
/// let orders = ArxOrders { na: 1, inputs: &[InputOrders { nb: 2, nk: 1 }], constant: false };
/// let mut lags: Lags<f64, Const<3>> = Lags::new(&orders)?;
///
/// for (u, y) in [(1.0, 10.0), (2.0, 20.0)] {
///     lags.push_inputs(&[u])?;
///     assert_eq!(lags.regressor(), None); // not filled yet
///     lags.push_output(y)?;
/// }
/// lags.push_inputs(&[3.0])?;
/// assert_eq!(lags.regressor(), Some(&Vector3::new(-20.0, 2.0, 1.0)));
/// # Ok::<(), Error>(())
/// ```
///
/// Two inputs, the second with a delay of 3. The sizes follow from the orders:
///
/// ```
/// use thetahat_core::nalgebra::Const;
/// use thetahat_core::{ArxOrders, Error, InputOrders, Lags};
///
/// const ORDERS: ArxOrders = ArxOrders {
///     na: 2,
///     inputs: &[InputOrders { nb: 2, nk: 1 }, InputOrders { nb: 1, nk: 3 }],
///     constant: false,
/// };
/// type Plant = Lags<f32, Const<{ ORDERS.parameters() }>, Const<{ ORDERS.delays() }>>;
///
/// let mut lags = Plant::new(&ORDERS)?;
/// lags.push_inputs(&[0.5, -1.0])?;
/// lags.push_output(0.0)?;
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", into = "snapshot::Snapshot<T, N, D>"))]
#[cfg_attr(feature = "serde", serde(try_from = "snapshot::Snapshot<T, N, D>"))]
pub struct Lags<T: Real, N: Dimension, D: Dimension = Const<1>> {
    /// φ; NaN where a sample is missing.
    regressor: OVector<T, N>,
    /// The inputs on their way to φ, line after line, each line the newest first.
    delayed: OVector<T, D>,
    /// The lines in use, then some with nb = 0. There are at most N, as each has a coefficient: so the number
    /// of inputs need not be one more size in the type.
    lines: OVector<Line, N>,
    /// Past samples of each output.
    na: u16,
    outputs: u16,
    inputs: usize,
    /// Whether y(k) is in, and u(k) is not.
    awaiting_inputs: bool,
}

impl<T: Real, N: Dimension, D: Dimension> Lags<T, N, D> {
    /// Empty delay lines: every earlier sample is missing.
    ///
    /// Errors: [`Error::Orders`] if the orders do not make exactly `N` parameters; [`Error::Delays`] if `D` is too
    /// small for the delays; these and [`Error::Length`] for an na, an nb, an nk or a number of channels above 65,535.
    ///
    /// ```
    /// use thetahat_core::nalgebra::Const;
    /// use thetahat_core::{ArxOrders, Error, InputOrders, Lags};
    ///
    /// let orders = ArxOrders { na: 2, inputs: &[InputOrders { nb: 2, nk: 5 }], constant: false };
    /// let error = Lags::<f32, Const<3>, Const<5>>::new(&orders).unwrap_err();
    /// assert_eq!(error, Error::Orders { needed: 4, available: 3 });
    /// let error = Lags::<f32, Const<4>, Const<1>>::new(&orders).unwrap_err();
    /// assert_eq!(error, Error::Delays { needed: 5, available: 1 });
    /// ```
    pub fn new(orders: &ArxOrders<'_>) -> Result<Self, Error> {
        Self::with_outputs(orders, 1)
    }

    /// The same with several outputs, of which φ holds na past samples each.
    ///
    /// Errors: as for [`new`](Lags::new), with [`ArxOrders::parameters_of`] in the place of the number of parameters.
    ///
    /// ```
    /// use thetahat_core::nalgebra::{Const, Vector3};
    /// use thetahat_core::{ArxOrders, Error, InputOrders, Lags};
    ///
    /// const ORDERS: ArxOrders =
    ///     ArxOrders { na: 1, inputs: &[InputOrders { nb: 1, nk: 1 }], constant: false };
    /// let mut lags: Lags<f64, Const<{ ORDERS.parameters_of(2) }>> = Lags::with_outputs(&ORDERS, 2)?;
    /// lags.push_inputs(&[3.0])?;
    /// lags.push_outputs(&[1.0, 2.0])?;
    /// lags.push_inputs(&[4.0])?;
    /// assert_eq!(lags.regressor(), Some(&Vector3::new(-1.0, -2.0, 3.0)));
    /// # Ok::<(), Error>(())
    /// ```
    pub fn with_outputs(orders: &ArxOrders<'_>, outputs: usize) -> Result<Self, Error> {
        Self::of(orders, outputs, 0)
    }

    /// Whether this type has the sizes for these orders: that [`new`](Lags::new) has no error. For orders that are
    /// constants, `const _: () = assert!(…)` asks the compiler: see [`RecursiveArx::fits`](crate::RecursiveArx::fits).
    pub const fn fits(orders: &ArxOrders<'_>) -> bool {
        Self::fits_with(orders, 1, 0)
    }

    /// The same with this many outputs, and past residuals.
    pub(crate) const fn fits_with(orders: &ArxOrders<'_>, outputs: usize, residuals: usize) -> bool {
        let parameters = orders.parameters_of(outputs).saturating_add(residuals);
        let exact = match N::SIZE {
            Some(size) => size == parameters,
            None => true,
        };
        let enough = match D::SIZE {
            Some(size) => size >= orders.delays(),
            None => true,
        };
        exact && enough
    }

    /// The same with one more line after all others, for `residuals` past residuals.
    pub(crate) fn with_residuals(orders: &ArxOrders<'_>, residuals: usize) -> Result<Self, Error> {
        Self::of(orders, 1, residuals)
    }

    fn of(orders: &ArxOrders<'_>, outputs: usize, residuals: usize) -> Result<Self, Error> {
        let needed = orders.parameters_of(outputs).saturating_add(residuals);
        let parameters = N::exactly(needed).map_err(|available| Error::Orders { needed, available })?;
        let delays = D::at_least(orders.delays())
            .map_err(|available| Error::Delays { needed: orders.delays(), available })?;
        let mut lines = parameters.vector(Line { index: 0, nb: 0, nk: 0 });
        let others = [usize::from(orders.constant), residuals].map(|nb| InputOrders { nb, nk: 0 });
        let available = usize::from(u16::MAX);
        let mut places = lines.as_mut_slice().iter_mut();
        for (index, orders) in orders.inputs.iter().chain(&others).enumerate() {
            if orders.nb > 0
                && let Some(line) = places.next()
            {
                *line = Line::new(index, orders)?;
            }
        }
        let mut lags = Lags {
            regressor: parameters.vector(T::NAN),
            delayed: delays.vector(T::NAN),
            lines,
            na: narrow(orders.na).ok_or(Error::Orders { needed: orders.na, available })?,
            outputs: narrow(outputs).ok_or(Error::Length {
                argument: "outputs",
                expected: available,
                found: outputs,
            })?,
            inputs: orders.inputs.len(),
            awaiting_inputs: false,
        };
        lags.set_constant();
        Ok(lags)
    }

    /// Step 1 of a sample: takes u(k), one number for each input, in the order of [`ArxOrders::inputs`]. NaN
    /// is a missing sample. Without inputs the step may be left out.
    ///
    /// Moves every nb + nk by one place.
    ///
    /// Errors, after which nothing has changed: [`Error::Length`] if the number of inputs is not that of the
    /// orders; [`Error::Infinite`].
    pub fn push_inputs(&mut self, inputs: &[T]) -> Result<(), Error> {
        self.check_inputs(inputs)?;
        self.push(inputs, T::NAN);
        Ok(())
    }

    /// What [`push_inputs`](Lags::push_inputs) checks.
    pub(crate) fn check_inputs(&self, inputs: &[T]) -> Result<(), Error> {
        check_length("inputs", self.inputs, inputs.len())?;
        if inputs.iter().any(is_infinite) { Err(Error::Infinite { argument: "inputs" }) } else { Ok(()) }
    }

    /// Step 1 of a sample, unchecked. Inputs that are not given yet are missing; `residual` is that of the sample
    /// before.
    pub(crate) fn push(&mut self, inputs: &[T], residual: T) {
        self.push_each(|input| inputs.get(input).copied().unwrap_or(T::NAN), residual);
    }

    /// The same with the inputs as a function of their index.
    #[inline(always)]
    pub(crate) fn push_each(&mut self, input_of: impl Fn(usize) -> T, residual: T) {
        let past_outputs = self.past_outputs();
        let mut taps = self.regressor.as_mut_slice().get_mut(past_outputs..).unwrap_or_default();
        let mut delayed = self.delayed.as_mut_slice();
        for line in in_use(self.lines.as_slice()) {
            let newest = match line.source(self.inputs) {
                Source::Input(input) => input_of(input),
                Source::Constant => T::one(),
                Source::Residual => residual,
            };
            let arriving = shift(take(&mut delayed, line.nk.into()), newest);
            shift(take(&mut taps, line.nb.into()), arriving);
        }
    }

    /// The inputs of the sample whose step 1 went without them, where no input acts in its own sample.
    pub(crate) fn complete(&mut self, inputs: &[T]) {
        self.complete_each(|input| inputs.get(input).copied().unwrap_or(T::NAN));
    }

    /// The same with the inputs as a function of their index.
    #[inline(always)]
    pub(crate) fn complete_each(&mut self, input_of: impl Fn(usize) -> T) {
        let mut delayed = self.delayed.as_mut_slice();
        for line in in_use(self.lines.as_slice()) {
            let mine = take(&mut delayed, line.nk.into());
            if let (Source::Input(input), [newest, ..]) = (line.source(self.inputs), mine) {
                *newest = input_of(input);
            }
        }
        self.awaiting_inputs = false;
    }

    /// That no input acts in its own sample, so that y(k) can be predicted before u(k) is known.
    pub(crate) fn check_delays(&self) -> Result<(), Error> {
        in_use(self.lines.as_slice()).try_for_each(|line| match line.source(self.inputs) {
            Source::Input(input) if line.nk == 0 => Err(Error::InputFirst { input }),
            _ => Ok(()),
        })
    }

    /// Whether y(k) is in, and u(k) is still to come.
    pub(crate) fn awaits_inputs(&self) -> bool {
        self.awaiting_inputs
    }

    /// Says so.
    pub(crate) fn await_inputs(&mut self, awaiting: bool) {
        self.awaiting_inputs = awaiting;
    }

    /// Step 2 of a sample: φ(k), or `None` while a sample in it is missing.
    ///
    /// It is φ(k) between [`push_inputs`](Lags::push_inputs) of u(k) and [`push_output`](Lags::push_output)
    /// of y(k). `N` comparisons.
    pub fn regressor(&self) -> Option<&OVector<T, N>> {
        let missing = self.regressor.as_slice().iter().any(|sample| !sample.is_finite());
        (!missing).then_some(&self.regressor)
    }

    /// Step 3 of a sample: takes y(k). NaN is a missing sample.
    ///
    /// Moves na by one place.
    ///
    /// Errors, after which nothing has changed: [`Error::Infinite`].
    pub fn push_output(&mut self, output: T) -> Result<(), Error> {
        if is_infinite(&output) {
            return Err(Error::Infinite { argument: "output" });
        }
        check_length("outputs", self.outputs(), 1)?;
        self.push_checked(&[output]);
        Ok(())
    }

    /// The same with a number for each of several outputs.
    ///
    /// Errors, after which nothing has changed: [`Error::Length`] if the number of outputs is not that of the lines;
    /// [`Error::Infinite`].
    pub fn push_outputs(&mut self, outputs: &[T]) -> Result<(), Error> {
        check_length("outputs", self.outputs(), outputs.len())?;
        if outputs.iter().any(is_infinite) {
            return Err(Error::Infinite { argument: "outputs" });
        }
        self.push_checked(outputs);
        Ok(())
    }

    /// Step 3 of a sample, unchecked.
    #[inline(always)]
    pub(crate) fn push_checked(&mut self, outputs: &[T]) {
        let na = self.na.into();
        let mut taps = self.regressor.as_mut_slice();
        for &output in outputs {
            shift(take(&mut taps, na), -output);
        }
    }

    /// Takes `change`, one for each output, from the latest outputs, whose negatives the lines hold.
    #[inline(always)]
    pub(crate) fn take_from_newest(&mut self, change: impl Fn(usize) -> T) {
        let (na, outputs) = (self.na.into(), self.outputs());
        let mut taps = self.regressor.as_mut_slice();
        for index in 0..outputs {
            if let [newest, ..] = take(&mut taps, na) {
                *newest += change(index);
            }
        }
    }

    /// All steps of a sample, unchecked: what is made of φ(k), if nothing in it is missing. The inputs may follow.
    pub(crate) fn sample<R>(
        &mut self,
        inputs: &[T],
        outputs: &[T],
        inputs_follow: bool,
        make: impl FnOnce(&[T]) -> Option<R>,
    ) -> Option<R> {
        self.push(inputs, T::NAN);
        let made = self.regressor().and_then(|regressor| make(regressor.as_slice()));
        self.push_checked(outputs);
        self.awaiting_inputs = inputs_follow;
        made
    }

    /// Takes over the samples of other lines of the same orders.
    ///
    /// Errors, after which nothing has changed: [`Error::Length`] (only with `Dyn`).
    pub(crate) fn copy_from(&mut self, other: &Self) -> Result<(), Error> {
        check_length("workspace", other.regressor.len(), self.regressor.len())?;
        check_length("workspace", other.delayed.len(), self.delayed.len())?;
        ud::copy(other.regressor.as_slice(), self.regressor.as_mut_slice());
        ud::copy(other.delayed.as_slice(), self.delayed.as_mut_slice());
        self.lines
            .as_mut_slice()
            .iter_mut()
            .zip(other.lines.as_slice())
            .for_each(|(line, &other)| *line = other);
        (self.na, self.outputs, self.inputs) = (other.na, other.outputs, other.inputs);
        self.awaiting_inputs = other.awaiting_inputs;
        Ok(())
    }

    /// The typical magnitude of each element of φ, given that of each output, of each input and of the residuals.
    pub(crate) fn scales(&self, outputs: &[T], inputs: &[T], residual: T) -> Result<OVector<T, N>, Error> {
        check_length("input_scales", self.inputs, inputs.len())?;
        let mut scales = self.regressor.shape_generic().0.vector(T::NAN);
        let mut taps = scales.as_mut_slice();
        for &output in outputs {
            take(&mut taps, self.na.into()).fill(output);
        }
        for line in in_use(self.lines.as_slice()) {
            let magnitude = match line.source(self.inputs) {
                Source::Input(input) => inputs.get(input).copied().unwrap_or(T::NAN),
                Source::Constant => T::one(),
                Source::Residual => residual,
            };
            take(&mut taps, line.nb.into()).fill(magnitude);
        }
        Ok(scales)
    }

    /// Takes the last `count` elements of φ for 0.
    pub(crate) fn clear_last(&mut self, count: usize) {
        self.regressor.as_mut_slice().iter_mut().rev().take(count).for_each(|tap| *tap = T::zero());
    }

    /// How long φ is.
    pub(crate) fn size(&self) -> N {
        self.regressor.shape_generic().0
    }

    /// Which input an element of φ is of; `None` for an output, and for what is neither.
    pub(crate) fn input_of(&self, element: usize) -> Option<usize> {
        let mut place = element.checked_sub(self.past_outputs())?;
        for line in in_use(self.lines.as_slice()) {
            match place.checked_sub(line.nb.into()) {
                Some(further) => place = further,
                None => return Some(usize::from(line.index)).filter(|index| *index < self.inputs),
            }
        }
        None
    }

    /// The number of inputs.
    pub(crate) fn inputs(&self) -> usize {
        self.inputs
    }

    /// The number of outputs.
    pub(crate) fn outputs(&self) -> usize {
        self.outputs.into()
    }

    /// How many elements of φ are of past outputs.
    fn past_outputs(&self) -> usize {
        usize::from(self.na).saturating_mul(self.outputs.into())
    }

    /// The coefficients of A(q), the leading 1 included, among parameters in the order of φ.
    pub(crate) fn output_coefficients<'a>(
        &self,
        parameters: &'a [T],
    ) -> impl Iterator<Item = T> + Clone + use<'a, T, N, D> {
        self.coefficients_of(parameters, 0, T::one())
    }

    /// What multiplies an output in an equation whose parameters these are, after this coefficient of its latest value.
    pub(crate) fn coefficients_of<'a>(
        &self,
        parameters: &'a [T],
        output: usize,
        leading: T,
    ) -> impl Iterator<Item = T> + Clone + use<'a, T, N, D> {
        let na = self.na.into();
        let past = parameters.iter().skip(output.saturating_mul(na)).take(na);
        core::iter::once(leading).chain(past.copied())
    }

    /// The coefficients of B(q) of an input, its nk leading zeros included; `None` if there is no such input.
    pub(crate) fn input_coefficients<'a>(
        &self,
        parameters: &'a [T],
        input: usize,
    ) -> Option<impl Iterator<Item = T> + Clone + use<'a, T, N, D>> {
        if input >= self.inputs {
            return None;
        }
        let mut start = self.past_outputs();
        for line in in_use(self.lines.as_slice()) {
            if usize::from(line.index) == input {
                return Some(coefficients(parameters, start, line.nb.into(), line.nk.into()));
            }
            start += usize::from(line.nb);
        }
        Some(coefficients(parameters, start, 0, 0))
    }

    /// The constant among parameters in the order of φ; `None` if there is none.
    pub(crate) fn constant(&self, parameters: &[T]) -> Option<T> {
        parameters.get(self.constant_place()?).copied()
    }

    /// Where φ holds the 1 of the constant.
    fn constant_place(&self) -> Option<usize> {
        let mut start = self.past_outputs();
        for line in in_use(self.lines.as_slice()) {
            if line.source(self.inputs) == Source::Constant {
                return Some(start);
            }
            start += usize::from(line.nb);
        }
        None
    }

    /// Forgets all samples: an unknown number of them is missing here. The regressor comes back once it is
    /// filled with new ones.
    ///
    /// ```
    /// use thetahat_core::nalgebra::Const;
    /// use thetahat_core::{ArxOrders, Error, Lags};
    ///
    /// let mut lags: Lags<f64, Const<1>> = Lags::new(&ArxOrders { na: 1, inputs: &[], constant: false })?;
    /// lags.push_output(1.0)?;
    /// assert!(lags.regressor().is_some());
    /// lags.gap();
    /// assert!(lags.regressor().is_none());
    /// # Ok::<(), Error>(())
    /// ```
    pub fn gap(&mut self) {
        self.regressor.as_mut_slice().fill(T::NAN);
        self.delayed.as_mut_slice().fill(T::NAN);
        self.awaiting_inputs = false;
        self.set_constant();
    }

    /// The 1 in φ that the constant is multiplied by.
    fn set_constant(&mut self) {
        if let Some(one) =
            self.constant_place().and_then(|place| self.regressor.as_mut_slice().get_mut(place))
        {
            *one = T::one();
        }
    }
}

/// `zeros` zeros, then `count` parameters from `start` on.
fn coefficients<T: Real>(
    parameters: &[T],
    start: usize,
    count: usize,
    zeros: usize,
) -> impl Iterator<Item = T> + Clone + use<'_, T> {
    core::iter::repeat_n(T::zero(), zeros).chain(parameters.iter().skip(start).take(count).copied())
}

/// A count of the few bytes that it takes.
fn narrow(count: usize) -> Option<u16> {
    u16::try_from(count).ok()
}

/// The lines in use: they come first.
#[inline(always)]
fn in_use(lines: &[Line]) -> impl Iterator<Item = &Line> {
    lines.iter().take_while(|line| line.nb > 0)
}

/// The first `count` places, which are there; `rest` is what follows them.
fn take<'a, T>(rest: &mut &'a mut [T], count: usize) -> &'a mut [T] {
    rest.split_off_mut(..count).unwrap_or_default()
}

/// Moves each sample one place on, the new one to the front; returns the one that falls out.
pub(crate) fn shift<T: Real>(line: &mut [T], new: T) -> T {
    line.iter_mut().fold(new, |moving, place| core::mem::replace(place, moving))
}

pub(crate) fn is_infinite<T: Real>(sample: &T) -> bool {
    sample.abs() == T::INFINITY
}

#[cfg(feature = "serde")]
mod snapshot;
#[cfg(test)]
mod tests;
