//! The latest samples of a loop.

use nalgebra::OVector;

use crate::{Dimension, Real, RstController};

/// What a controller with other coefficients has to know, to go on as if it had been there: the latest N samples, the newest first.
#[derive(Clone, Debug)]
pub(super) struct Past<T: Real, N: Dimension> {
    set_points: OVector<T, N>,
    outputs: OVector<T, N>,
    inputs: OVector<T, N>,
    /// What was asked for, before the limits.
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

    /// N.
    pub(super) fn size(&self) -> N {
        self.inputs.shape_generic().0
    }

    pub(super) fn push(&mut self, set_point: T, output: T, input: T, wanted: T) {
        let lines = [
            (&mut self.set_points, set_point),
            (&mut self.outputs, output),
            (&mut self.inputs, input),
            (&mut self.wanted, wanted),
        ];
        for (line, newest) in lines {
            let line = line.as_mut_slice();
            line.rotate_right(1.min(line.len()));
            if let Some(first) = line.first_mut() {
                *first = newest;
            }
        }
    }

    /// That the actuator did something else with the newest sample.
    pub(super) fn correct(&mut self, input: T) {
        if let Some(first) = self.inputs.as_mut_slice().first_mut() {
            *first = input;
        }
    }

    /// The controller, as if it had been there.
    pub(super) fn resume(&self, controller: &mut RstController<T, N>) {
        // Slices: the iterators of nalgebra divide to go backwards, and that can panic.
        let [set_points, outputs, inputs, wanted] =
            [&self.set_points, &self.outputs, &self.inputs, &self.wanted].map(|line| line.as_slice().iter());
        let samples = set_points.zip(outputs).zip(inputs.zip(wanted));
        controller.forget();
        for ((set_point, output), (input, wanted)) in samples.rev() {
            controller.follow(*set_point, *output, *input, *wanted);
        }
    }
}
