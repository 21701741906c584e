//! What a model in equations knows of its inputs: those of this row and of the one before, and as far back as its
//! delays reach.

use thetahat_core::nalgebra::DVector;

use crate::model::GreyBox;
use crate::model::equations::Drive;

/// So many times the longest delay is remembered where it is unknown.
const SPARE: f64 = 4.0;

/// A row as a model sees it: deviations from the channels' offsets.
#[derive(Debug, Clone)]
pub(super) struct Sample {
    /// Seconds since the first row.
    pub(super) time: f64,
    pub(super) inputs: DVector<f64>,
    /// NaN where one is missing.
    pub(super) outputs: DVector<f64>,
}

impl Sample {
    /// What drives a state where the noises are correlated: inputs, and outputs that are there.
    pub(super) fn drives(&self) -> DVector<f64> {
        let outputs = self.outputs.iter().map(|output| if output.is_nan() { 0.0 } else { *output });
        let drives: Vec<f64> = self.inputs.iter().copied().chain(outputs).collect();
        drives.into()
    }
}

/// The latest rows; none for a model that needs but the inputs of one.
#[derive(Debug, Clone, Default)]
pub(super) struct Past {
    /// How many seconds back it reaches from the row before; none if nothing is remembered.
    reach: Option<f64>,
    times: Vec<f64>,
    /// Row after row.
    values: Vec<f64>,
    linear: Vec<bool>,
}

impl Past {
    pub(super) fn new(grey: &GreyBox) -> Self {
        let spare = if grey.parameters().is_empty() { 1.0 } else { SPARE };
        let reach = match grey.longest_delay() {
            Some(delay) => Some(delay * spare),
            None => (!grey.linear_holds().is_empty()).then_some(0.0),
        };
        Self { reach, linear: grey.linear_holds().to_vec(), ..Self::default() }
    }

    /// Takes a row, and forgets those that no delay reaches from the row before.
    pub(super) fn push(&mut self, sample: &Sample) {
        let Some(reach) = self.reach else { return };
        self.times.push(sample.time);
        self.values.extend(sample.inputs.iter());
        let Some(&before) = self.times.len().checked_sub(2).and_then(|row| self.times.get(row)) else {
            return;
        };
        let old = self.times.partition_point(|time| *time <= before - reach).saturating_sub(1);
        self.times.drain(..old);
        self.values.drain(..old * sample.inputs.len());
    }

    /// The inputs at a row that was taken: the latest, or so many before.
    pub(super) fn drive<'a>(&'a self, sample: &'a Sample, back: usize) -> Drive<'a> {
        match self.times.len().checked_sub(1 + back) {
            Some(row) => Drive::of_rows((&self.times, &self.values), sample.inputs.len(), &self.linear, row),
            None => Drive::held(sample.inputs.as_slice()),
        }
    }

    /// The rows as numbers, for a snapshot: times, and inputs row after row.
    pub(super) fn rows(&self) -> (&[f64], &[f64]) {
        (&self.times, &self.values)
    }

    /// The same past with the rows of a snapshot; none if they are not so many.
    pub(super) fn with_rows(self, times: Vec<f64>, values: Vec<f64>, inputs: usize) -> Option<Self> {
        let fits = values.len() == times.len() * inputs && (self.reach.is_some() || times.is_empty());
        fits.then_some(Self { times, values, ..self })
    }
}
