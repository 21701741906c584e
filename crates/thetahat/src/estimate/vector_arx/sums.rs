//! ARX models with several outputs from sums of products alone: the rows are gone.

use std::ops::Range;

use super::super::out_of_range;
use super::super::subspace::LaggedProducts;
use super::{VectorArxEstimate, VectorArxOptions, of_products};
use crate::Error;
use crate::regression::{Column, ExtendedGram, Lagged, Presample, Taps};

/// All lags of all signals, the outputs first; inputs wait `delays` samples.
pub(crate) fn joint_taps(delays: &[usize], outputs: usize, longest: usize) -> Vec<Taps> {
    let firsts = std::iter::repeat_n(0, outputs).chain(delays.iter().copied());
    firsts.enumerate().map(|(signal, first)| Taps { signal, first, count: longest + 1, sign: 1.0 }).collect()
}

/// The sums of the products of these, for models that are solved without the record: `segments` have a regressor's lags before their
/// first sample that counts.
pub(crate) fn joint_products(
    signals: &[&[f64]],
    taps: Vec<Taps>,
    segments: &[Range<usize>],
) -> Result<ExtendedGram, Error> {
    let gram = ExtendedGram::of(&Lagged::new(signals, taps, segments, Presample::Drop));
    if gram.is_in_range() { Ok(gram) } else { Err(out_of_range()) }
}

/// Where the lags of the signals of these taps stand, lag by lag, the inputs before the outputs.
fn joint_columns(taps: &[Taps], outputs: usize) -> Vec<Column> {
    let (of_signals, lags) = (ExtendedGram::columns(taps), taps.first().map_or(0, |taps| taps.count));
    let signals: Vec<usize> = (outputs..taps.len()).chain(0..outputs).collect();
    let each = (0..lags).flat_map(|lag| signals.iter().map(move |signal| signal * lags + lag));
    each.map(|place| of_signals[place]).collect()
}

/// [`vector_arx`](super::vector_arx) of products of signals less their offsets.
///
/// # Errors
/// As there.
pub(crate) fn vector_arx_of_sums(
    gram: &ExtendedGram,
    taps: &[Taps],
    outputs: usize,
    options: &VectorArxOptions,
    sample_time: f64,
) -> Result<VectorArxEstimate, Error> {
    let inputs = taps.len() - outputs;
    let columns = joint_columns(taps, outputs);
    let products = |_: usize, longest: usize| {
        let (products, means) = gram.mean_products(&columns, options.constant);
        let of_signals = (inputs, outputs);
        LaggedProducts::scaled(of_signals, longest, gram.rows(), (products, means)).ok_or_else(out_of_range)
    };
    of_products(products, |_| gram.rows(), (inputs, outputs), options, sample_time)
}
