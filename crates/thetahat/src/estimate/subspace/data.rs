//! What a subspace method asks of data.

use thetahat_core::nalgebra::{DMatrix, DVector};
use thetahat_numerics::regression::{SAFE_NORMS, joint_gram};

use super::{OrderScore, Subspace};
use crate::Error;
use crate::data::JointRecord;

/// The data of a subspace method: a record, or [sums](super::SubspaceSums) over parts of one.
pub(crate) trait SubspaceData {
    /// m and l.
    fn channels(&self) -> (usize, usize);

    /// The samples that have so many before them in their segment.
    fn samples(&self, lags: usize) -> usize;

    /// The mean products of z(t), …, z(t-longest), lag by lag, over these samples, and the means if products are to be
    /// those of deviations from them.
    fn mean_products(&self, longest: usize, centred: bool) -> (DMatrix<f64>, Option<DVector<f64>>);

    /// Why there are no products with such a past.
    fn silent(&self, past: usize) -> Error;

    /// How well the models of some orders predict: see [`Subspace::scores`].
    ///
    /// # Errors
    /// As there.
    fn scores(
        &self,
        found: &Subspace,
        orders: std::ops::RangeInclusive<usize>,
    ) -> Result<Vec<OrderScore>, Error>;
}

impl SubspaceData for JointRecord<'_> {
    fn channels(&self) -> (usize, usize) {
        (self.inputs.len(), self.outputs.len())
    }

    fn samples(&self, lags: usize) -> usize {
        self.segments.iter().map(|segment| segment.len().saturating_sub(lags)).sum()
    }

    fn mean_products(&self, longest: usize, centred: bool) -> (DMatrix<f64>, Option<DVector<f64>>) {
        let signals = self.signals();
        let (products, samples) = joint_gram(&signals, &self.segments, longest);
        let mut products = products / samples as f64;
        let means = centred.then(|| {
            let used = || self.segments.iter().filter(|segment| segment.len() > longest);
            let mut means = DVector::zeros(signals.len() * (longest + 1));
            for (place, signal) in signals.iter().enumerate() {
                let rows = used().flat_map(|segment| &signal[segment.start + longest..segment.end]);
                let mut total = thetahat_numerics::regression::sum(rows.copied());
                for lag in 0..=longest {
                    means[lag * signals.len() + place] = total / samples as f64;
                    // One sample later the rows begin and end one earlier.
                    if lag < longest {
                        let moved = used().map(|segment| {
                            signal[segment.start + longest - lag - 1] - signal[segment.end - lag - 1]
                        });
                        total += moved.sum::<f64>();
                    }
                }
            }
            means
        });
        if let Some(means) = &means {
            products.ger(-1.0, means, means, 1.0);
        }
        (products, means)
    }

    fn silent(&self, past: usize) -> Error {
        let is_silent = |signal: &&[f64]| {
            let used = self.segments.iter().filter(|segment| segment.len() > past);
            let largest = used
                .flat_map(|segment| &signal[segment.start + past..segment.end])
                .fold(0.0_f64, |largest, value| largest.max(value.abs()));
            !SAFE_NORMS.contains(&largest)
        };
        let found = self.signals().iter().position(is_silent).unwrap_or(0);
        let inputs = self.inputs.len();
        let name = if found < inputs {
            format!("input {}", found + 1)
        } else {
            format!("output {}", found - inputs + 1)
        };
        Error::undetermined(
            Vec::new(),
            format!(
                "{name} is zero, or too large or too small for its squares; leave it out, or give it in other units"
            ),
        )
    }

    fn scores(
        &self,
        found: &Subspace,
        orders: std::ops::RangeInclusive<usize>,
    ) -> Result<Vec<OrderScore>, Error> {
        found.scores(self, orders)
    }
}
