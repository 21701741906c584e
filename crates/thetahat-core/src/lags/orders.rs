//! The orders of ARX models: how many past outputs and inputs make the next output.

/// The orders of one input of an ARX model.
///
/// ```
/// use thetahat_core::{ArxOrders, InputOrders};
///
/// // b_0 u(k-3) + b_1 u(k-4): two coefficients after a dead time of three samples.
/// const VALVE: InputOrders = InputOrders { nb: 2, nk: 3 };
/// assert_eq!(ArxOrders { na: 0, inputs: &[VALVE], constant: false }.delays(), 3);
/// ```
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
/// [`Lags`](crate::Lags) needs are constant functions of it, so that they need not be counted by hand.
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
        self.parameters_of(1)
    }

    /// The number of parameters of each equation with this many outputs, when each depends on the past of all: na times
    /// the outputs plus every nb, plus 1 with a constant.
    ///
    /// ```
    /// use thetahat_core::{ArxOrders, InputOrders};
    ///
    /// let orders = ArxOrders { na: 2, inputs: &[InputOrders { nb: 3, nk: 1 }], constant: true };
    /// assert_eq!(orders.parameters_of(2), 2 * 2 + 3 + 1);
    /// ```
    pub const fn parameters_of(&self, outputs: usize) -> usize {
        let mut sum = self.na.saturating_mul(outputs).saturating_add(self.constant as usize);
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

/// Orders that are a constant of a type: what is made of them does not compile with a wrong size.
///
/// `O` is [`ArxOrders`] or [`ArmaxOrders`](crate::ArmaxOrders). See [`RecursiveArx::of`](crate::RecursiveArx::of).
///
/// ```
/// use thetahat_core::{ArxOrders, ConstantOrders, InputOrders};
///
/// struct Heater;
/// impl ConstantOrders for Heater {
///     const ORDERS: ArxOrders<'static> =
///         ArxOrders { na: 1, inputs: &[InputOrders { nb: 1, nk: 1 }], constant: false };
/// }
/// assert_eq!(Heater::ORDERS.parameters(), 2);
/// ```
pub trait ConstantOrders<O = ArxOrders<'static>> {
    /// The orders.
    const ORDERS: O;
}
