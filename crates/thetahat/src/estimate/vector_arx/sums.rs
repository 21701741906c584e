//! ARX models with several outputs from sums of products alone: the rows are gone.

use thetahat_numerics::regression::{ExtendedGram, Taps};

use super::super::out_of_range;
use super::super::subspace::{LaggedProducts, joint_columns};
use super::{VectorArxEstimate, VectorArxOptions, of_products};
use crate::Error;

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
