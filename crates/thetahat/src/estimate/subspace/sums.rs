//! The states of data of which sums of lagged products are left: the rows are gone.

use std::ops::RangeInclusive;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::{DMatrix, DVector};
use thetahat_numerics::regression::{ExtendedGram, Lagged, Presample};

use super::data::SubspaceData;
use super::joint::{joint_columns, joint_taps};
use super::{LONGEST_PAST, OrderScore, Subspace, SubspaceOptions, Weighting, longest_past};
use crate::Error;

/// The samples that a predictor runs over before its errors count.
const RUN: usize = 10;

/// The variance of errors, in squares of the scales, that sums in 32 digits cannot distinguish from zero.
const ROUNDING_VARIANCE: f64 = 1e-26;

impl SubspaceOptions {
    /// How many lags of all signals a model and its errors are found from.
    pub(crate) fn lags(&self) -> usize {
        let past = self.past.unwrap_or(LONGEST_PAST);
        let future = if self.weighting == Weighting::Ssarx { 1 } else { self.future.unwrap_or(past) };
        past.saturating_add(RUN.max(future.saturating_sub(1)))
    }
}

/// The first samples of a segment, of which too few are before them for all lags. Shorter pasts have products of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub(crate) struct SegmentStart {
    /// How many of them are not summed: they come before the others.
    pub(crate) past: usize,
    /// Signal by signal, the outputs first.
    pub(crate) signals: Vec<Vec<f64>>,
}

impl SegmentStart {
    /// Whether it can be one of so many signals and lags.
    pub(crate) fn fits(&self, signals: usize, lags: usize) -> bool {
        let samples = self.signals.first().map_or(0, Vec::len);
        let whole =
            |signal: &Vec<f64>| signal.len() == samples && signal.iter().all(|value| value.is_finite());
        self.signals.len() == signals
            && self.past < samples
            && samples <= lags
            && self.signals.iter().all(whole)
    }
}

/// Sums over data whose rows are gone.
#[derive(Debug)]
pub(crate) struct SubspaceSums<'s> {
    /// The products of all lags of the signals, the outputs first, over the samples that have these lags before them.
    pub(crate) products: &'s ExtendedGram,
    /// As many lags of each.
    pub(crate) lags: usize,
    /// What the samples without them are.
    pub(crate) starts: &'s [SegmentStart],
    /// For each input the samples that it waits.
    pub(crate) delays: &'s [usize],
    /// What is taken from each signal, the outputs first.
    pub(crate) offsets: Vec<f64>,
}

/// The errors one step ahead of a model.
#[derive(Debug)]
pub(crate) struct SubspaceErrors {
    /// How many samples have them: those with all the lags before them that their predictor runs over.
    pub(crate) samples: usize,
    /// Their mean products.
    pub(crate) mean: DMatrix<f64>,
    /// The norm of each output about its mean over these samples.
    pub(crate) spreads: Vec<f64>,
}

impl SubspaceSums<'_> {
    fn outputs(&self) -> usize {
        self.offsets.len() - self.delays.len()
    }

    /// The products of fewer lags, over all samples that have these before them.
    pub(crate) fn of(&self, lags: usize) -> ExtendedGram {
        let taps = |lags: usize| joint_taps(self.delays, self.outputs(), lags);
        let (own, all) = (taps(lags), ExtendedGram::columns(&taps(self.lags)));
        let kept = all.chunks_exact(self.lags + 1).flat_map(|signal| &signal[..=lags]);
        let mut products = self.products.restricted(&own, kept.map(|(place, _)| *place));
        let before = self.before(lags);
        for start in self.starts {
            let signals: Vec<&[f64]> = start.signals.iter().map(Vec::as_slice).collect();
            let first = start.past.saturating_sub(before);
            let samples = first..start.signals.first().map_or(0, Vec::len);
            let segments = std::slice::from_ref(&samples);
            let lagged = Lagged::new(&signals, own.clone(), segments, Presample::Drop);
            products.merge(&ExtendedGram::of(&lagged));
        }
        products.less(&own, &self.offsets)
    }

    /// How many samples have to come before one that has so many lags.
    fn before(&self, lags: usize) -> usize {
        lags + self.delays.iter().copied().max().unwrap_or(0)
    }

    /// The lags of the errors: some more than those of the states, from which their predictor starts, if there are
    /// samples with them.
    fn lags_of_errors(&self, past: usize) -> usize {
        longest_past(self, past.saturating_add(RUN)).map_or(past, |longest| longest.max(past))
    }

    /// The errors one step ahead of a model of some order. The predictor starts at the states that as many samples say
    /// as the model was found from, and runs over the lags that are left:
    ///
    /// ```text
    /// e(t) = y(t) - D u(t) - sum_j H A^(j-1) [G - K D, K] z(t-j) - H A^r x(t-r),   A = F - K H,   j = 1 … r,
    /// ```
    ///
    /// a combination C of lagged signals, so that the mean of e e' is C times their products times C'. None for an
    /// order without a model.
    pub(crate) fn errors(&self, found: &Subspace, order: usize) -> Option<SubspaceErrors> {
        let lags = self.lags_of_errors(found.past());
        let products = self.of(lags);
        let mut mean = self.mean_errors(&products, found, order, lags)?;
        for (output, scale) in found.scales[found.inputs..].iter().enumerate() {
            mean.row_mut(output).scale_mut(*scale);
            mean.column_mut(output).scale_mut(*scale);
        }
        let columns = ExtendedGram::columns(&joint_taps(self.delays, self.outputs(), lags));
        let outputs = columns.chunks_exact(lags + 1).take(self.outputs());
        let spreads = outputs.map(|lags| products.spread(lags[0].0).sqrt()).collect();
        Some(SubspaceErrors { samples: products.rows(), mean, spreads })
    }

    /// The mean of e e' in units of the scales.
    fn mean_errors(
        &self,
        products: &ExtendedGram,
        found: &Subspace,
        order: usize,
        lags: usize,
    ) -> Option<DMatrix<f64>> {
        let mut combination = found.errors_of_lags(order, lags)?;
        for (place, mut column) in combination.column_iter_mut().enumerate() {
            column.unscale_mut(found.scales[place % found.scales.len()]);
        }
        let columns = joint_columns(&joint_taps(self.delays, self.outputs(), lags), self.outputs());
        let mean = products.mean_products_of(&columns, &combination, found.has_constant())
            + DMatrix::identity(self.outputs(), self.outputs()) * ROUNDING_VARIANCE;
        mean.iter().all(|value| value.is_finite()).then_some(mean)
    }
}

impl SubspaceData for SubspaceSums<'_> {
    fn channels(&self) -> (usize, usize) {
        (self.delays.len(), self.outputs())
    }

    fn samples(&self, lags: usize) -> usize {
        let before = self.before(lags);
        let counted = |start: &SegmentStart| {
            start.signals.first().map_or(0, Vec::len).saturating_sub(before.max(start.past))
        };
        self.products.rows() + self.starts.iter().map(counted).sum::<usize>()
    }

    fn mean_products(&self, longest: usize, centred: bool) -> (DMatrix<f64>, Option<DVector<f64>>) {
        let columns = joint_columns(&joint_taps(self.delays, self.outputs(), longest), self.outputs());
        self.of(longest).mean_products(&columns, centred)
    }

    fn silent(&self, _past: usize) -> Error {
        super::super::out_of_range()
    }

    fn scores(&self, found: &Subspace, orders: RangeInclusive<usize>) -> Result<Vec<OrderScore>, Error> {
        let lags = self.lags_of_errors(found.past());
        let products = self.of(lags);
        found.scored(products.rows() as f64, orders, |order, _, _| {
            self.mean_errors(&products, found, order, lags)
        })
    }
}
