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
