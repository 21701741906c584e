use serde::{Deserialize, Serialize};
use thetahat_core::Innovation;

/// How well the samples were predicted one ahead, before each was used: the figures that policies are compared by.
///
/// The first 2 n + 20 samples that were predicted do not count, n being the number of parameters, unless the tracker
/// started from a report: while nothing is known, errors are as large as the output, and would hide those of all later
/// samples.
///
/// The figures are running means, so that they neither overflow nor lose digits, however many samples there are
/// (Welford, Note on a method for calculating corrected sums of squares and products, Technometrics 4, 1962).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct TrackScore {
    samples: u64,
    mean_squared_error: f64,
    mean_output: f64,
    output_variance: f64,
    evaluated: u64,
    mean_nis: f64,
    mean_log_likelihood: f64,
}

impl TrackScore {
    /// A sample that was predicted and measured; the output may have any origin.
    pub(super) fn count(&mut self, innovation: &Innovation<f64>, output: f64) {
        self.samples = self.samples.saturating_add(1);
        let share = 1.0 / self.samples as f64;
        self.mean_squared_error += (innovation.error * innovation.error - self.mean_squared_error) * share;
        let before = output - self.mean_output;
        self.mean_output += before * share;
        self.output_variance += (before * (output - self.mean_output) - self.output_variance) * share;
        if innovation.variance.is_finite() {
            self.evaluated = self.evaluated.saturating_add(1);
            let share = 1.0 / self.evaluated as f64;
            self.mean_nis += (innovation.nis - self.mean_nis) * share;
            self.mean_log_likelihood += (innovation.log_likelihood() - self.mean_log_likelihood) * share;
        }
    }

    /// Whether its numbers can be those of any samples.
    pub(super) fn is_sound(&self) -> bool {
        let squares = [self.mean_squared_error, self.output_variance, self.mean_nis];
        self.evaluated <= self.samples
            && squares.iter().all(|square| square.is_finite() && *square >= 0.0)
            && self.mean_output.is_finite()
            && self.mean_log_likelihood.is_finite()
    }

    /// The number of samples that count: predicted and measured.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// The mean of e², in the output's units squared; none before the first.
    pub fn mean_squared_error(&self) -> Option<f64> {
        (self.samples > 0).then_some(self.mean_squared_error)
    }

    /// The one-step fit, 100 (1 - |e|/|y - mean(y)|), in percent, on the samples that count; none if they are all the
    /// same.
    pub fn fit(&self) -> Option<f64> {
        let known = self.output_variance > 0.0;
        known.then(|| 100.0 * (1.0 - (self.mean_squared_error / self.output_variance).sqrt()))
    }

    /// How many of them had an innovation with a known variance: those that the next two figures are of.
    pub fn evaluated(&self) -> u64 {
        self.evaluated
    }

    /// The mean of e²/S: 1 if the variances are right, above 1 if the tracker is surer than it should be.
    pub fn mean_nis(&self) -> Option<f64> {
        (self.evaluated > 0).then_some(self.mean_nis)
    }

    /// The sum over the samples of ln p(y), the Gaussian log-likelihood of each given those before it. The larger, the
    /// better, among trackers of the same samples.
    pub fn log_likelihood(&self) -> Option<f64> {
        (self.evaluated > 0).then_some(self.mean_log_likelihood * self.evaluated as f64)
    }
}
