//! All lags of several outputs and inputs, and the sums of their products.

use std::ops::Range;

use thetahat_numerics::regression::{Column, ExtendedGram, Lagged, Presample, Taps};

use super::super::out_of_range;
use crate::Error;

/// All lags of all signals, the outputs first; inputs wait `delays` samples.
pub(crate) fn joint_taps(delays: &[usize], outputs: usize, longest: usize) -> Vec<Taps> {
    let firsts = std::iter::repeat_n(0, outputs).chain(delays.iter().copied());
    firsts.enumerate().map(|(signal, first)| Taps { signal, first, count: longest + 1, sign: 1.0 }).collect()
}

/// The sums of the products of these, for models that are solved without the record: `segments` have a regressor's lags
/// before their first sample that counts.
pub(crate) fn joint_products(
    signals: &[&[f64]],
    taps: Vec<Taps>,
    segments: &[Range<usize>],
) -> Result<ExtendedGram, Error> {
    let gram = ExtendedGram::of(&Lagged::new(signals, taps, segments, Presample::Drop));
    if gram.is_in_range() { Ok(gram) } else { Err(out_of_range()) }
}

/// Where the lags of the signals of these taps stand, lag by lag, the inputs before the outputs.
pub(in crate::estimate) fn joint_columns(taps: &[Taps], outputs: usize) -> Vec<Column> {
    let (of_signals, lags) = (ExtendedGram::columns(taps), taps.first().map_or(0, |taps| taps.count));
    let signals: Vec<usize> = (outputs..taps.len()).chain(0..outputs).collect();
    let each = (0..lags).flat_map(|lag| signals.iter().map(move |signal| signal * lags + lag));
    each.map(|place| of_signals[place]).collect()
}
