use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the normalised innovations squared of a filter lay, counted by row.
///
/// That of a row is e' S^-1 e over the outputs that were measured in it: chi-square with as many degrees of freedom as
/// there are of these, if the model and its noises are right (Bar-Shalom, Li and Kirubarajan, Estimation with
/// Applications to Tracking and Navigation, 2001, section 5.4).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NisSummary {
    /// How many rows have one.
    pub rows: usize,
    /// Their mean.
    pub mean: f64,
    /// What the mean is if the model is right: the number of values measured, divided by the rows.
    pub expected: f64,
    /// The part of the rows below the bounds that hold 95 %: 0.025 if the model is right.
    pub below: f64,
    /// The part above: 0.025 if the model is right.
    pub above: f64,
}

impl NisSummary {
    /// The mean relative to what is expected: 1 if the model is right, and the mean of e^2/S over the values measured.
    pub(crate) fn relative(&self) -> f64 {
        self.mean / self.expected
    }
}

/// The same while rows come in.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(crate) struct NisCount {
    rows: usize,
    measured: usize,
    mean: f64,
    below: usize,
    above: usize,
}

impl NisCount {
    /// One more row, with the bounds of its 95 %.
    pub(crate) fn add(&mut self, nis: f64, measured: usize, (low, high): (f64, f64)) {
        self.rows += 1;
        self.measured += measured;
        self.mean += (nis - self.mean) / self.rows as f64;
        self.below += usize::from(nis < low);
        self.above += usize::from(nis > high);
    }

    /// None without rows.
    pub(crate) fn summary(&self) -> Option<NisSummary> {
        let rows = self.rows as f64;
        (self.rows > 0).then(|| NisSummary {
            rows: self.rows,
            mean: self.mean,
            expected: self.measured as f64 / rows,
            below: self.below as f64 / rows,
            above: self.above as f64 / rows,
        })
    }
}
