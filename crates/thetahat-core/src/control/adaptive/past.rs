//! The latest samples of a loop.

use nalgebra::OVector;

#[cfg(feature = "serde")]
use crate::Error;
use crate::lags::shift;
use crate::{Dimension, Real, RstController};

/// What a controller with other coefficients has to know, to go on as if it had been there: the latest N samples, the
/// newest first.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub(super) struct Past<T: Real, N: Dimension> {
    #[cfg_attr(feature = "serde", serde(with = "crate::snapshot::vector"))]
    set_points: OVector<T, N>,
    #[cfg_attr(feature = "serde", serde(with = "crate::snapshot::vector"))]
    outputs: OVector<T, N>,
    #[cfg_attr(feature = "serde", serde(with = "crate::snapshot::vector"))]
    inputs: OVector<T, N>,
    /// What was asked for, before the limits.
    #[cfg_attr(feature = "serde", serde(with = "crate::snapshot::vector"))]
    wanted: OVector<T, N>,
}

impl<T: Real, N: Dimension> Past<T, N> {
    /// As if it had rested with this input for ever.
    pub(super) fn resting(size: N, input: T) -> Self {
        let still = |value| size.vector(value);
        Past {
            set_points: still(T::zero()),
            outputs: still(T::zero()),
            inputs: still(input),
            wanted: still(input),
        }
    }

    /// Checks what was read.
    #[cfg(feature = "serde")]
    pub(super) fn check(&self, size: usize) -> Result<(), Error> {
        for line in [&self.set_points, &self.outputs, &self.inputs, &self.wanted] {
            crate::error::check_entries("past", line.as_slice(), size)?;
        }
        Ok(())
    }

    /// N.
    pub(super) fn size(&self) -> N {
        self.inputs.shape_generic().0
    }

    pub(super) fn push(&mut self, set_point: T, output: T, input: T, wanted: T) {
        shift(self.set_points.as_mut_slice(), set_point);
        shift(self.outputs.as_mut_slice(), output);
        shift(self.inputs.as_mut_slice(), input);
        shift(self.wanted.as_mut_slice(), wanted);
    }

    /// That the actuator did something else with the newest sample.
    pub(super) fn correct(&mut self, input: T) {
        if let Some(first) = self.inputs.as_mut_slice().first_mut() {
            *first = input;
        }
    }

    /// The controller, as if it had been there.
    pub(super) fn resume(&self, controller: &mut RstController<T, N>) {
        let targets = self.set_points.as_slice().iter().zip(self.outputs.as_slice());
        let samples = targets.zip(self.inputs.as_slice().iter().zip(self.wanted.as_slice()));
        controller.forget();
        for ((set_point, output), (input, wanted)) in samples.rev() {
            controller.follow(*set_point, *output, *input, *wanted);
        }
    }
}
