//! What estimators on delay lines share: which samples they refuse, and how a model runs on from the latest ones.

use super::is_infinite;
use crate::error::check_length;
use crate::triangle::column;
use crate::ud::dot;
use crate::{Dimension, Error, Lags, Real};

impl<T: Real, N: Dimension, D: Dimension> Lags<T, N, D> {
    /// That outputs can be taken before the inputs of their instant, one number for each, and that none is infinite or
    /// too large.
    pub(crate) fn check_measured(&self, outputs: &[T]) -> Result<(), Error> {
        self.check_delays()?;
        check_length("outputs", self.outputs(), outputs.len())?;
        self.check_samples(&[], outputs)
    }

    /// That there is a number for each input and output, and that none is infinite or too large.
    pub(crate) fn check_row(&self, inputs: &[T], outputs: &[T]) -> Result<(), Error> {
        self.check_inputs(inputs)?;
        check_length("outputs", self.outputs(), outputs.len())?;
        self.check_samples(inputs, outputs)
    }

    /// Checks inputs, and takes them if outputs were measured since those before. Returns whether it took them: if not,
    /// the outputs between the two are missing.
    pub(crate) fn take_applied(&mut self, inputs: &[T]) -> Result<bool, Error> {
        self.check_inputs(inputs)?;
        self.check_samples(inputs, &[])?;
        let awaited = self.awaiting_inputs;
        if awaited {
            self.complete(inputs);
        }
        Ok(awaited)
    }

    fn check_samples(&self, inputs: &[T], outputs: &[T]) -> Result<(), Error> {
        if outputs.iter().any(is_infinite) {
            return Err(Error::Infinite { argument: "output" });
        }
        let size = self.size().value();
        for (argument, samples) in [("inputs", inputs), ("output", outputs)] {
            if samples.iter().any(|&sample| is_large(sample, size)) {
                return Err(Error::TooLarge { argument });
            }
        }
        Ok(())
    }

    /// Runs a linear model on: its predictions become its outputs, those of several outputs one after the other, with a
    /// column of parameters for each. Of the residuals, if the model has them, the last one is known, and those to come
    /// are expected to be 0.
    pub(crate) fn predict(
        &mut self,
        parameters: &[T],
        mut residual: T,
        future_inputs: &[T],
        outputs: &mut [T],
    ) -> Result<(), Error> {
        let (inputs, each, n) = (self.inputs, self.outputs().max(1), self.size().value());
        let steps = outputs.len() / each;
        check_length("outputs", steps * each, outputs.len())?;
        check_length("future_inputs", steps.saturating_mul(inputs), future_inputs.len())?;
        if future_inputs.iter().any(is_infinite) {
            return Err(Error::Infinite { argument: "future_inputs" });
        }
        let awaiting = self.awaiting_inputs;
        let mut grown = false;
        for (step, outputs) in outputs.chunks_exact_mut(each).enumerate() {
            if grown {
                outputs.fill(T::NAN);
                continue;
            }
            let next = future_inputs.get(step * inputs..).unwrap_or_default();
            if awaiting {
                self.complete(next);
            }
            self.push(if awaiting { &[] } else { next }, residual);
            if let Some(regressor) = self.regressor() {
                for (index, output) in outputs.iter_mut().enumerate() {
                    *output = dot(regressor.as_slice(), column(parameters, n, index));
                }
                grown = !outputs.iter().all(T::is_finite);
            }
            if grown || self.regressor().is_none() {
                outputs.fill(T::NAN);
            }
            self.push_checked(outputs);
            residual = T::zero();
        }
        if grown { Err(Error::Overflow) } else { Ok(()) }
    }
}

/// Whether a regressor of `size` such samples could be too large. NaN is not.
pub(crate) fn is_large<T: Real>(sample: T, size: usize) -> bool {
    sample * sample * T::from_count(size.max(1)) > T::LARGEST_ENTRY
}

/// How an estimator with one output takes inputs and rows of a log, by its `take_sample(inputs, output,
/// inputs_follow)`.
macro_rules! take_rows {
    () => {
        /// u(k), one number for each input: what acts on the plant from now on, until the next measurement, as the
        /// plant got it (so after all limits). NaN is a missing sample.
        ///
        /// If no measurement has come since the inputs before, that one is missing, and time goes on first.
        ///
        /// Errors, after which nothing has changed: [`Error::Length`](crate::Error::Length) if the number of inputs is
        /// not that of the orders; [`Error::Infinite`](crate::Error::Infinite);
        /// [`Error::TooLarge`](crate::Error::TooLarge), as for [`measured`](Self::measured).
        pub fn applied(&mut self, inputs: &[T]) -> Result<(), crate::Error> {
            if !self.lags.take_applied(inputs)? {
                self.take_sample(inputs, T::NAN, false);
            }
            Ok(())
        }

        /// One row of a log: y(k) and u(k), recorded at the same instant k. NaN is a missing sample.
        ///
        /// With every nk at least 1 it is [`measured`](Self::measured) and then [`applied`](Self::applied), to the bit:
        /// u(k) has no part in the innovation of y(k). It is not the call for a controller that knows u(k-1) when y(k)
        /// arrives: to take that as u(k) would make the model a sample late.
        ///
        /// Errors, after which nothing has changed, time included: those of the two, but for
        /// [`Error::InputFirst`](crate::Error::InputFirst).
        pub fn log_row(&mut self, output: T, inputs: &[T]) -> Result<crate::Innovation<T>, crate::Error> {
            self.lags.check_row(inputs, &[output])?;
            Ok(self.take_sample(inputs, output, false))
        }
    };
}
pub(crate) use take_rows;

/// How an estimator on delay lines predicts; the expression is its last residual, of the estimator.
macro_rules! tell_predictions {
    ($residual:expr) => {
        /// The outputs to come, ŷ(k+1), then ŷ(k+2), …, each with a number for every output of the model, as many as
        /// `outputs` holds, y(k) being the latest one.
        ///
        /// `future_inputs` are those to come, each with one number for every input, and as many samples as of outputs.
        /// Which is the first follows from the latest call: after [`measured`](Self::measured) of y(k) it is u(k),
        /// which is still to be chosen; after [`applied`](Self::applied) or [`log_row`](Self::log_row) of u(k) it is
        /// u(k+1). (With nk = 1 the last one acts on nothing then, but is there.) Predicted outputs take the place of
        /// measured ones; of residuals, if the model has them, those to come are expected to be 0. A sample that
        /// depends on a missing one is NaN.
        ///
        /// The state of the estimator does not change. With `Dyn` the delay lines are cloned. A step takes n
        /// multiply-adds for each output, and n moves.
        ///
        /// Errors: [`Error::Length`](crate::Error::Length) if the outputs are no whole samples, or there are not as
        /// many samples of inputs; [`Error::Infinite`](crate::Error::Infinite); both leave `outputs` as they were.
        /// [`Error::Overflow`](crate::Error::Overflow) if an unstable model grows out of `T`: the samples before that
        /// are written, the others are NaN.
        pub fn predict(&self, future_inputs: &[T], outputs: &mut [T]) -> Result<(), crate::Error> {
            self.predict_in(&mut self.lags.clone(), future_inputs, outputs)
        }

        /// The same as [`predict`](Self::predict) in delay lines of the caller, such as a clone of
        /// [`lags`](Self::lags), whose samples are lost: with `Dyn` it does not allocate.
        ///
        /// Errors: those of `predict`; [`Error::Length`](crate::Error::Length) (only with `Dyn`) if the lines have
        /// another size.
        pub fn predict_in(
            &self,
            workspace: &mut crate::Lags<T, N, D>,
            future_inputs: &[T],
            outputs: &mut [T],
        ) -> Result<(), crate::Error> {
            let residual: fn(&Self) -> T = $residual;
            workspace.copy_from(&self.lags)?;
            let parameters = self.estimator.parameters().as_slice();
            workspace.predict(parameters, residual(self), future_inputs, outputs)
        }

        /// The delay lines: what the next outputs are predicted from.
        pub fn lags(&self) -> &crate::Lags<T, N, D> {
            &self.lags
        }
    };
}
pub(crate) use tell_predictions;

/// What an estimator with one output tells of its inputs.
macro_rules! tell_inputs {
    () => {
        /// B(q) of an input, counted from 0, so that the i-th number multiplies q⁻ⁱ: nk zeros, then b_0 … b_(nb-1).
        /// Empty if the input has no coefficients; `None` if there is no such input.
        pub fn b(&self, input: usize) -> Option<impl Iterator<Item = T> + Clone + '_> {
            self.lags.input_coefficients(self.estimator.parameters().as_slice(), input)
        }

        /// The constant; `None` if the orders have none.
        pub fn constant(&self) -> Option<T> {
            self.lags.constant(self.estimator.parameters().as_slice())
        }
    };
}
pub(crate) use tell_inputs;
