//! What is shown of a row.

use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::{DMatrix, DVector};
use thetahat_core::{Action, Error, Innovation};
use thetahat_numerics::distribution::chi_square_interval;

use super::estimate::{StateEstimate, StateValues};
use super::kind::{Expected, Gaussian, Kind, Sample};
use super::model::StateModel;

/// What an estimator says beside its estimates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Certainty {
    /// Standard deviations.
    Deviations,
    /// How far at most the state is from them.
    Bounds,
    Nothing,
}

/// The numbers of one row.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Row {
    states: usize,
    /// Of the states, and after them of the parameters after the change of variable.
    #[serde(with = "super::snapshot::numbers")]
    pub(super) predicted: Vec<f64>,
    #[serde(with = "super::snapshot::numbers")]
    predicted_deviations: Vec<f64>,
    #[serde(with = "super::snapshot::numbers")]
    filtered: Vec<f64>,
    #[serde(with = "super::snapshot::numbers")]
    filtered_deviations: Vec<f64>,
    #[serde(with = "super::snapshot::numbers")]
    parameters: Vec<f64>,
    #[serde(with = "super::snapshot::numbers")]
    parameter_deviations: Vec<f64>,
    #[serde(with = "super::snapshot::numbers")]
    outputs: Vec<f64>,
    #[serde(with = "super::snapshot::numbers")]
    output_deviations: Vec<f64>,
    #[serde(with = "super::snapshot::numbers")]
    innovations: Vec<f64>,
    held: Vec<bool>,
    #[serde(with = "super::snapshot::numbers")]
    covariance: Vec<f64>,
    /// The 95 % bounds of the normalised innovation squared of 1, 2 … elements.
    bounds: Vec<Option<(f64, f64)>>,
}

/// What a measurement told.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(super) struct Told {
    nis: Option<f64>,
    log_likelihood: Option<f64>,
    action: Action,
    #[serde(default)]
    contradiction: Option<usize>,
}

impl Told {
    pub(super) fn of(innovation: &Innovation<f64, DVector<f64>>) -> Self {
        let measured = innovation.action != Action::Missing;
        let log_likelihood = Some(innovation.log_likelihood());
        Self {
            nis: measured.then_some(innovation.nis),
            log_likelihood,
            action: innovation.action,
            contradiction: None,
        }
    }

    /// By a set, which knows no likelihood.
    pub(super) fn of_set(action: Action, contradiction: Option<usize>) -> Self {
        Self { nis: None, log_likelihood: None, action, contradiction }
    }

    /// By an observer, which knows no noise.
    pub(super) fn nothing(sample: &Sample) -> Self {
        let missing = sample.outputs.iter().all(|output| output.is_nan());
        let action = if missing { Action::Missing } else { Action::Updated };
        Self { nis: None, log_likelihood: None, action, contradiction: None }
    }
}

impl Row {
    pub(super) fn new(model: &StateModel) -> Self {
        let (states, parameters) = (model.states().len(), model.unknown().len());
        let (size, outputs) = (states + parameters, model.outputs().len());
        let zeros = |size: usize| vec![0.0; size];
        Self {
            states,
            predicted: zeros(size),
            predicted_deviations: zeros(size),
            filtered: zeros(size),
            filtered_deviations: zeros(size),
            parameters: zeros(parameters),
            parameter_deviations: zeros(parameters),
            outputs: zeros(outputs),
            output_deviations: zeros(outputs),
            innovations: zeros(outputs),
            held: vec![false; model.inputs().len()],
            covariance: zeros(size * size),
            bounds: (1..=outputs).map(chi_square_interval).collect(),
        }
    }

    /// Whether it has the sizes and bounds of this one.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        let sizes = |row: &Self| {
            let numbers = [
                &row.predicted,
                &row.predicted_deviations,
                &row.filtered,
                &row.filtered_deviations,
                &row.parameters,
                &row.parameter_deviations,
                &row.outputs,
                &row.output_deviations,
                &row.innovations,
                &row.covariance,
            ];
            numbers.map(Vec::len)
        };
        sizes(self) == sizes(other)
            && self.states == other.states
            && self.held.len() == other.held.len()
            && self.bounds == other.bounds
    }

    pub(super) fn predicted(&mut self, filter: &impl Gaussian) -> Result<(), Error> {
        self.predicted.copy_from_slice(filter.state().as_slice());
        filter.covariance().write_into(&mut self.covariance)?;
        let diagonal = self.covariance.iter().step_by(self.predicted.len() + 1);
        for (deviation, variance) in self.predicted_deviations.iter_mut().zip(diagonal) {
            *deviation = variance.sqrt();
        }
        Ok(())
    }

    pub(super) fn filtered(&mut self, filter: &impl Gaussian) {
        self.filtered.copy_from_slice(filter.state().as_slice());
        for (deviation, variance) in self.filtered_deviations.iter_mut().zip(&filter.covariance().variances())
        {
            *deviation = variance.sqrt();
        }
    }

    /// How far at most the predicted state is from its estimate.
    pub(super) fn reaches(&mut self, reaches: &DVector<f64>) {
        self.predicted_deviations.copy_from_slice(reaches.as_slice());
    }

    /// How large innovations are at most.
    pub(super) fn output_reaches(&mut self, reaches: &DVector<f64>) {
        self.output_deviations.copy_from_slice(reaches.as_slice());
    }

    /// The corrected state, and how far at most the state is from it.
    pub(super) fn corrected(&mut self, state: &DVector<f64>, reaches: &DVector<f64>) {
        self.filtered.copy_from_slice(state.as_slice());
        self.filtered_deviations.copy_from_slice(reaches.as_slice());
    }

    /// p(z), and |dp/dz| times the standard deviation of z.
    pub(super) fn parameters(&mut self, kind: &Kind) {
        let Kind::Grey(grey) = kind else { return };
        for (index, parameter) in grey.parameters().iter().enumerate() {
            let place = self.states + index;
            let (z, deviation) = (self.filtered[place], self.filtered_deviations[place]);
            self.parameters[index] = parameter.scale.value(z);
            self.parameter_deviations[index] = parameter.scale.slope(z).abs() * deviation;
        }
    }

    /// The outputs as predicted, and what they are off.
    pub(super) fn seen(&mut self, outputs: &DVector<f64>, sample: &Sample) {
        self.outputs.copy_from_slice(outputs.as_slice());
        for ((innovation, measured), output) in self.innovations.iter_mut().zip(&sample.outputs).zip(outputs)
        {
            *innovation = measured - output;
        }
    }

    /// The outputs that a filter expects, and the deviations of its innovations.
    pub(super) fn expected(&mut self, expected: &Expected<'_>, sample: &Sample) {
        match expected {
            Expected::Linear(outputs, h, noise) => {
                self.seen(outputs, sample);
                self.output_deviations(h, noise);
            }
            Expected::Known(outputs, variances) => {
                self.seen(outputs, sample);
                for (deviation, variance) in self.output_deviations.iter_mut().zip(variances) {
                    *deviation = variance.sqrt();
                }
            }
        }
    }

    /// The roots of S_ii = h_i'P h_i + R_ii, with the covariance of the prediction.
    fn output_deviations(&mut self, h: &DMatrix<f64>, noise: &DMatrix<f64>) {
        let (size, outputs) = (self.predicted.len(), self.output_deviations.len());
        let h = h.as_slice();
        for (output, deviation) in self.output_deviations.iter_mut().enumerate() {
            let mut variance = 0.0;
            for i in 0..size {
                let row = h.iter().skip(output).step_by(outputs);
                let column = &self.covariance[i * size..(i + 1) * size];
                variance += h[output + i * outputs] * column.iter().zip(row).map(|(p, h)| p * h).sum::<f64>();
            }
            *deviation = (variance.max(0.0) + noise[(output, output)]).sqrt();
        }
    }

    /// What comes last: the outputs with their offsets, and the inputs that are missing.
    pub(super) fn finish(&mut self, kind: &Kind, time: f64, inputs: &[f64]) {
        for (output, offset) in self.outputs.iter_mut().zip(kind.offsets().1) {
            *output += offset.at(time);
        }
        for (held, input) in self.held.iter_mut().zip(inputs) {
            *held = input.is_nan();
        }
    }

    pub(super) fn estimate(
        &self,
        row: usize,
        time: f64,
        certainty: Certainty,
        told: &Told,
    ) -> StateEstimate<'_> {
        fn values<'a>(values: &'a [f64], numbers: &'a [f64], certainty: Certainty) -> StateValues<'a> {
            StateValues {
                values,
                standard_deviations: (certainty == Certainty::Deviations).then_some(numbers),
                bounds: (certainty == Certainty::Bounds).then_some(numbers),
            }
        }
        let states = self.states;
        let measured = self.innovations.iter().filter(|innovation| !innovation.is_nan()).count();
        let filtered = values(&self.filtered[..states], &self.filtered_deviations[..states], certainty);
        let bounds = measured.checked_sub(1).and_then(|place| self.bounds.get(place).copied().flatten());
        StateEstimate {
            row,
            time,
            predicted: values(&self.predicted[..states], &self.predicted_deviations[..states], certainty),
            filtered: (certainty != Certainty::Nothing).then_some(filtered),
            parameters: values(&self.parameters, &self.parameter_deviations, certainty),
            outputs: values(&self.outputs, &self.output_deviations, certainty),
            innovations: &self.innovations,
            measured,
            nis: told.nis,
            nis_bounds: told.nis.and(bounds),
            log_likelihood: told.log_likelihood,
            contradiction: told.contradiction,
            action: told.action,
            held: &self.held,
        }
    }
}
