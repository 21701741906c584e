//! Tapped delay lines: recent inputs and outputs make the regressor of an ARX model.

use nalgebra::{Const, OVector};

use crate::error::check_length;
use crate::{Dimension, Error, Real, ud};

/// The orders of one input of an ARX model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InputOrders {
    /// The number of coefficients. With 0 the input is read, and not used.
    pub nb: usize,
    /// The delay in samples, from the input to the first output it acts on. With 0 it acts at once.
    pub nk: usize,
}

/// The orders of an ARX model: how many past outputs and inputs its next output depends on.
///
/// ```text
/// y(k) + a_1 y(k-1) + … + a_na y(k-na)
///     = Σ over the inputs:  b_0 u(k-nk) + b_1 u(k-nk-1) + … + b_(nb-1) u(k-nk-nb+1)  [+ constant] + e(k)
/// ```
///
/// It borrows the list of inputs, so that it serves a constant and a value read at run time. The sizes that
/// [`Lags`] needs are constant functions of it, so that they need not be counted by hand.
///
/// ```
/// use thetahat_core::{ArxOrders, InputOrders};
///
/// const ORDERS: ArxOrders = ArxOrders {
///     na: 2,
///     inputs: &[InputOrders { nb: 2, nk: 1 }, InputOrders { nb: 1, nk: 3 }],
///     constant: false,
/// };
/// assert_eq!(ORDERS.parameters(), 5);
/// assert_eq!(ORDERS.delays(), 4);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ArxOrders<'a> {
    /// The number of past outputs.
    pub na: usize,
    /// The orders of each input, in the order in which samples are pushed. Empty for a time series without
    /// input.
    pub inputs: &'a [InputOrders],
    /// Whether a constant is a parameter too, for signals that are not about 0: the level of the output where the
    /// inputs are 0 is constant/A(1).
    pub constant: bool,
}

impl ArxOrders<'_> {
    /// The number of parameters: na plus every nb, plus 1 with a constant.
    pub const fn parameters(&self) -> usize {
        let mut sum = self.na.saturating_add(self.constant as usize);
        let mut inputs = self.inputs;
        while let [first, rest @ ..] = inputs {
            sum = sum.saturating_add(first.nb);
            inputs = rest;
        }
        sum
    }

    /// The number of samples that are on their way: the nk of every input that has coefficients, added up.
    pub const fn delays(&self) -> usize {
        let mut sum: usize = 0;
        let mut inputs = self.inputs;
        while let [first, rest @ ..] = inputs {
            if first.nb > 0 {
                sum = sum.saturating_add(first.nk);
            }
            inputs = rest;
        }
        sum
    }
}

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
        let narrow = |count| u16::try_from(count).ok();
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

    /// What goes into it, of a model with so many inputs.
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
/// The outputs enter with a minus sign (Ljung, System Identification, 2nd ed., section 4.2).
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
/// `N` is the number of parameters, [`ArxOrders::parameters`]. `D` is the room for inputs on their way to the
/// regressor, at least [`ArxOrders::delays`]. It is 1 unless you say otherwise, which is right for one input
/// with nk = 1, and enough for nk = 0 or without input. Both are checked in [`new`](Lags::new). With the
/// feature `alloc` both may be `Dyn`: then they follow from the orders, and `new` allocates, and fails as a
/// `Vec` does if there is no memory.
///
/// Memory: N + D numbers, 6 N bytes and three machine words. Plain data: a clone can be driven on with predicted outputs.
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
    na: usize,
    inputs: usize,
    /// Whether y(k) is in, and u(k) is not.
    awaiting_inputs: bool,
}

impl<T: Real, N: Dimension, D: Dimension> Lags<T, N, D> {
    /// Empty delay lines: every earlier sample is missing.
    ///
    /// Errors: [`Error::Orders`] if the orders do not make exactly `N` parameters; [`Error::Delays`] if `D`
    /// is too small for the delays; these and [`Error::Length`] for an nb, an nk or a number of inputs above 65,535.
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
        Self::with_residuals(orders, 0)
    }

    /// Whether this type has the sizes for these orders: that [`new`](Lags::new) has no error. For orders that are
    /// constants, `const _: () = assert!(…)` asks the compiler: see [`RecursiveArx::fits`](crate::RecursiveArx::fits).
    pub const fn fits(orders: &ArxOrders<'_>) -> bool {
        Self::fits_with(orders, 0)
    }

    /// The same with so many past residuals.
    pub(crate) const fn fits_with(orders: &ArxOrders<'_>, residuals: usize) -> bool {
        let parameters = orders.parameters().saturating_add(residuals);
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
        let needed = orders.parameters().saturating_add(residuals);
        let parameters = N::exactly(needed).map_err(|available| Error::Orders { needed, available })?;
        let delays = D::at_least(orders.delays())
            .map_err(|available| Error::Delays { needed: orders.delays(), available })?;
        let mut lines = parameters.vector(Line { index: 0, nb: 0, nk: 0 });
        let others = [usize::from(orders.constant), residuals].map(|nb| InputOrders { nb, nk: 0 });
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
            na: orders.na,
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
        let mut taps = self.regressor.as_mut_slice().get_mut(self.na..).unwrap_or_default();
        let mut delayed = self.delayed.as_mut_slice();
        for line in in_use(self.lines.as_slice()) {
            let newest = match line.source(self.inputs) {
                Source::Input(input) => inputs.get(input).copied().unwrap_or(T::NAN),
                Source::Constant => T::one(),
                Source::Residual => residual,
            };
            let arriving = shift(take(&mut delayed, line.nk.into()), newest);
            shift(take(&mut taps, line.nb.into()), arriving);
        }
    }

    /// The inputs of the sample whose step 1 went without them, where no input acts in its own sample.
    pub(crate) fn complete(&mut self, inputs: &[T]) {
        let mut delayed = self.delayed.as_mut_slice();
        for line in in_use(self.lines.as_slice()) {
            let mine = take(&mut delayed, line.nk.into());
            if let (Source::Input(input), [newest, ..]) = (line.source(self.inputs), mine) {
                *newest = inputs.get(input).copied().unwrap_or(T::NAN);
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
        self.push_checked(output);
        Ok(())
    }

    /// Step 3 of a sample, unchecked.
    pub(crate) fn push_checked(&mut self, output: T) {
        shift(take(&mut self.regressor.as_mut_slice(), self.na), -output);
    }

    /// Takes over the samples of other lines of the same orders.
    ///
    /// Errors, after which nothing has changed: [`Error::Length`] (only with `Dyn`).
    pub(crate) fn copy_from(&mut self, other: &Self) -> Result<(), Error> {
        check_length("room", other.regressor.len(), self.regressor.len())?;
        check_length("room", other.delayed.len(), self.delayed.len())?;
        ud::copy(other.regressor.as_slice(), self.regressor.as_mut_slice());
        ud::copy(other.delayed.as_slice(), self.delayed.as_mut_slice());
        self.lines
            .as_mut_slice()
            .iter_mut()
            .zip(other.lines.as_slice())
            .for_each(|(line, &other)| *line = other);
        (self.na, self.inputs, self.awaiting_inputs) = (other.na, other.inputs, other.awaiting_inputs);
        Ok(())
    }

    /// The typical magnitude of each element of φ, given that of the output, of each input and of the residuals.
    pub(crate) fn scales(&self, output: T, inputs: &[T], residual: T) -> Result<OVector<T, N>, Error> {
        check_length("input_scales", self.inputs, inputs.len())?;
        let mut scales = self.regressor.shape_generic().0.vector(output);
        let mut taps = scales.as_mut_slice().get_mut(self.na..).unwrap_or_default();
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

    /// The number of inputs.
    pub(crate) fn inputs(&self) -> usize {
        self.inputs
    }

    /// The coefficients of A(q), the leading 1 included, among parameters in the order of φ.
    pub(crate) fn output_coefficients<'a>(
        &self,
        parameters: &'a [T],
    ) -> impl Iterator<Item = T> + Clone + use<'a, T, N, D> {
        core::iter::once(T::one()).chain(parameters.iter().take(self.na).copied())
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
        let mut start = self.na;
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
        let mut start = self.na;
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
fn shift<T: Real>(line: &mut [T], new: T) -> T {
    line.iter_mut().fold(new, |moving, place| core::mem::replace(place, moving))
}

pub(crate) fn is_infinite<T: Real>(sample: &T) -> bool {
    sample.abs() == T::INFINITY
}

#[cfg(feature = "serde")]
mod snapshot;
#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec;
    use std::vec::Vec;

    use nalgebra::{Const, Vector2, Vector3};

    use super::{ArxOrders, InputOrders, Lags};
    use crate::noise::Noise;
    use crate::{Dimension, Error, Real};

    /// A sample that is missing one time in ten.
    fn sample(noise: &mut Noise) -> f64 {
        let value = noise.next();
        if noise.next() < -0.8 { f64::NAN } else { value }
    }

    /// φ(k) by its definition, from the whole record: NaN before the start.
    fn definition(orders: &ArxOrders<'_>, inputs: &[Vec<f64>], outputs: &[f64], k: usize) -> Vec<f64> {
        let at = |signal: &[f64], lag: usize| {
            let time = k.checked_sub(lag);
            time.and_then(|time| signal.get(time).copied()).unwrap_or(f64::NAN)
        };
        let mut regressor: Vec<f64> = (1..=orders.na).map(|lag| -at(outputs, lag)).collect();
        for (&InputOrders { nb, nk }, signal) in orders.inputs.iter().zip(inputs) {
            regressor.extend((nk..nk + nb).map(|lag| at(signal, lag)));
        }
        regressor
    }

    fn check<N: Dimension, D: Dimension>(orders: &ArxOrders<'_>) {
        let mut noise = Noise(1);
        let mut inputs: Vec<Vec<f64>> = vec![vec![]; orders.inputs.len()];
        let mut outputs = vec![];
        let mut lags = Lags::<f64, N, D>::new(orders).unwrap();
        let mut ready = 0;
        for k in 0..300 {
            if k == 150 {
                lags.gap();
                inputs.iter_mut().flatten().for_each(|u| *u = f64::NAN);
                outputs.fill(f64::NAN);
            }
            let now: Vec<f64> = inputs.iter().map(|_| sample(&mut noise)).collect();
            for (signal, &u) in inputs.iter_mut().zip(&now) {
                signal.push(u);
            }
            lags.push_inputs(&now).unwrap();

            let expected = definition(orders, &inputs, &outputs, k);
            match lags.regressor() {
                Some(regressor) => {
                    ready += 1;
                    assert_eq!(regressor.as_slice(), expected, "{orders:?} at {k}");
                }
                None => assert!(expected.iter().any(|s| s.is_nan()), "{orders:?} at {k}"),
            }

            // Bad samples in between change nothing.
            let infinite = vec![f64::NEG_INFINITY; now.len()];
            assert_eq!(lags.push_inputs(&infinite).is_ok(), now.is_empty());
            assert!(lags.push_inputs(&vec![0.0; now.len() + 1]).is_err());
            assert!(lags.push_output(f64::INFINITY).is_err());

            let y = sample(&mut noise);
            lags.push_output(y).unwrap();
            outputs.push(y);
        }
        assert!(ready > 50, "{orders:?} {ready}");
    }

    const DELAYS: [usize; 4] = [0, 1, 2, 7];

    fn one(nb: usize, nk: usize) -> InputOrders {
        InputOrders { nb, nk }
    }

    #[test]
    fn static_sizes_follow_the_definition() {
        for nk in DELAYS {
            let inputs = [one(2, nk)];
            let orders = |na| ArxOrders { na, inputs: &inputs, constant: false };
            check::<Const<2>, Const<7>>(&orders(0));
            check::<Const<4>, Const<7>>(&orders(2));
        }
        let two = [one(2, 1), one(1, 3)];
        check::<Const<6>, Const<4>>(&ArxOrders { na: 3, inputs: &two, constant: false });
        let three = [one(1, 0), one(0, 5), one(2, 1)];
        check::<Const<4>, Const<1>>(&ArxOrders { na: 1, inputs: &three, constant: false });
        // No stored samples at all.
        check::<Const<3>, Const<0>>(&ArxOrders { na: 1, inputs: &[one(2, 0)], constant: false });
        check::<Const<3>, Const<1>>(&ArxOrders { na: 3, inputs: &[], constant: false });
        check::<Const<0>, Const<1>>(&ArxOrders { na: 0, inputs: &[], constant: false });
    }

    #[cfg(feature = "alloc")]
    #[test]
    fn every_combination_of_orders_follows_the_definition() {
        use nalgebra::Dyn;

        for na in 0..4 {
            for nb in 0..4 {
                for nk in DELAYS {
                    let first = one(nb, nk);
                    check::<Dyn, Dyn>(&ArxOrders { na, inputs: &[first], constant: false });
                    for second in [one(0, 1), one(1, 0), one(2, 3)] {
                        check::<Dyn, Dyn>(&ArxOrders { na, inputs: &[first, second], constant: false });
                    }
                }
            }
        }
    }

    #[test]
    fn a_missing_sample_matters_only_in_a_tap() {
        // y(k) depends on u(k-2) alone: u(1) is missed at k = 3 only.
        let mut lags: Lags<f32, Const<1>, Const<2>> =
            Lags::new(&ArxOrders { na: 0, inputs: &[one(1, 2), one(0, 1)], constant: false }).unwrap();
        let mut ready = vec![];
        for k in 0..6 {
            let u = if k == 1 { f32::NAN } else { 1.0 };
            lags.push_inputs(&[u, f32::NAN]).unwrap();
            ready.push(lags.regressor().is_some());
            lags.push_output(f32::NAN).unwrap();
        }
        assert_eq!(ready, [false, false, true, false, true, true]);
    }

    #[test]
    fn bad_samples_are_named() {
        let mut lags: Lags<f64, Const<2>> =
            Lags::new(&ArxOrders { na: 1, inputs: &[one(1, 1)], constant: false }).unwrap();
        let length = |found| Error::Length { argument: "inputs", expected: 1, found };
        assert_eq!(lags.push_inputs(&[]), Err(length(0)));
        assert_eq!(lags.push_inputs(&[1.0, 2.0]), Err(length(2)));
        let infinite = |argument| Error::Infinite { argument };
        assert_eq!(lags.push_inputs(&[f64::INFINITY]), Err(infinite("inputs")));
        assert_eq!(lags.push_output(f64::NEG_INFINITY), Err(infinite("output")));
    }

    #[test]
    fn an_infinite_input_leaves_every_line_as_it_was() {
        let mut lags: Lags<f64, Const<2>, Const<2>> =
            Lags::new(&ArxOrders { na: 0, inputs: &[one(1, 1), one(1, 1)], constant: false }).unwrap();
        lags.push_inputs(&[1.0, 2.0]).unwrap();
        assert!(lags.push_inputs(&[3.0, f64::INFINITY]).is_err());
        lags.push_inputs(&[4.0, 5.0]).unwrap();
        assert_eq!(lags.regressor(), Some(&Vector2::new(1.0, 2.0)));
    }

    #[test]
    fn orders_that_do_not_fit_are_an_error() {
        fn error<N: Dimension, D: Dimension>(na: usize, inputs: &[InputOrders]) -> Option<Error> {
            Lags::<f32, N, D>::new(&ArxOrders { na, inputs, constant: false }).err()
        }
        let orders = |needed, available| Some(Error::Orders { needed, available });
        let delays = |needed, available| Some(Error::Delays { needed, available });
        type One = Const<1>;
        type Three = Const<3>;
        assert_eq!(error::<Three, One>(2, &[one(1, 1)]), None);
        assert_eq!(error::<Three, One>(2, &[one(2, 1)]), orders(4, 3));
        assert_eq!(error::<Three, One>(1, &[one(1, 1)]), orders(2, 3));
        assert_eq!(error::<Three, One>(1, &[one(2, 2)]), delays(2, 1));
        assert_eq!(error::<Three, One>(1, &[one(1, 1); 2]), delays(2, 1));
        // An input without coefficients stores nothing.
        assert_eq!(error::<Three, One>(2, &[one(0, 9), one(1, 1)]), None);
        let most = usize::MAX;
        assert_eq!(error::<Three, One>(1, &[one(most, 1)]), orders(most, 3));
        assert_eq!(error::<Three, One>(2, &[one(1, most)]), delays(most, 1));
    }

    #[cfg(feature = "alloc")]
    #[test]
    fn numbers_that_a_line_does_not_hold_are_an_error() {
        use nalgebra::Dyn;

        let error = |inputs: &[InputOrders]| {
            Lags::<f32, Dyn, Dyn>::new(&ArxOrders { na: 0, inputs, constant: false }).err()
        };
        let (most, available) = (65_535, 65_535);
        assert_eq!(error(&[one(1, most)]), None);
        assert_eq!(error(&[one(1, most + 1)]), Some(Error::Delays { needed: most + 1, available }));
        assert_eq!(error(&[one(most + 1, 1)]), Some(Error::Orders { needed: most + 1, available }));
        let mut many = vec![one(0, 0); most + 1];
        many.push(one(1, 1));
        let length = Error::Length { argument: "inputs", expected: most, found: most + 1 };
        assert_eq!(error(&many), Some(length));
    }

    #[test]
    fn a_clone_predicts_by_taking_its_own_predictions_for_outputs() {
        // y(k) = 0.5 y(k-1) + u(k-1) + 0.25 u(k-2)
        fn step<T: Real>(lags: &mut Lags<T, Const<3>>, theta: &Vector3<T>, u: T) -> T {
            lags.push_inputs(&[u]).unwrap();
            let y = lags.regressor().unwrap().dot(theta);
            lags.push_output(y).unwrap();
            y
        }
        let theta = Vector3::new(-0.5, 1.0, 0.25);
        let mut lags: Lags<f64, Const<3>> =
            Lags::new(&ArxOrders { na: 1, inputs: &[one(2, 1)], constant: false }).unwrap();
        for _ in 0..2 {
            lags.push_inputs(&[0.0]).unwrap();
            lags.push_output(0.0).unwrap();
        }
        let mut ahead = lags.clone();
        let predicted = [1.0, 0.0, 0.0, 0.0].map(|u| step(&mut ahead, &theta, u));
        assert_eq!(predicted, [0.0, 1.0, 0.75, 0.375]);
        // The original has not moved.
        assert_eq!(step(&mut lags, &theta, 0.0), 0.0);
    }
}
