//! The models with several outputs that normal equations hold: ARX models, and those of a subspace method.

use std::ops::RangeInclusive;

use thetahat_numerics::regression::ExtendedGram;

use super::super::schema::Report;
use super::super::state_space::{Estimated, by_sums, is_constant, of_arx, reported};
use super::NormalEquations;
use crate::Error;
use crate::data::Offset;
use crate::estimate::{
    SubspaceOptions, SubspaceSums, VectorArxOptions, joint_taps, out_of_range, vector_arx_of_sums,
};
use crate::model::Signal;
use crate::respond::InitialCondition;

/// With the offsets of all pieces, the orders and the coupling of the least MDL among those that were asked for, and
/// levels likewise.
pub(super) fn arx(sums: &NormalEquations, delays: &[usize], arx: &VectorArxOptions) -> Result<Report, Error> {
    let signals = signals(sums)?;
    let outputs = signals.len() - delays.len();
    let taps = joint_taps(delays, outputs, arx.longest(delays.len()));
    let products = sums.products.less(&taps, &offsets(&signals, delays));
    if !products.is_in_range() {
        return Err(out_of_range());
    }
    let find = |constant: bool| {
        let options = VectorArxOptions { constant, ..arx.clone() };
        vector_arx_of_sums(&products, &taps, outputs, &options, sums.sample_time)
    };
    // Errors that lagged products cannot tell from none are none: the rows are gone.
    let found =
        of_arx(find, |found| Ok(found.space.noise_covariance.clone()), delays, sums.settings.constant)?;
    let columns = ExtendedGram::columns(&taps);
    let each = (0..outputs).map(|output| columns[output * (columns.len() / taps.len())]);
    let spreads: Vec<f64> = each.map(|(place, _)| products.spread(place).sqrt()).collect();
    report(sums, found, signals, delays, &spreads)
}

/// With these offsets, the past of the least AIC and the order of the least MDL unless they are given, and levels
/// likewise.
pub(super) fn subspace(
    sums: &NormalEquations,
    delays: &[usize],
    options: &SubspaceOptions,
    orders: Option<&RangeInclusive<usize>>,
) -> Result<Report, Error> {
    let signals = signals(sums)?;
    let offsets = offsets(&signals, delays);
    let (products, starts, lags) = (&sums.products, &sums.starts, options.lags());
    let states = SubspaceSums { products, lags, starts, delays, offsets };
    let (found, spreads) = by_sums(&states, (options, orders), sums.settings.constant, sums.sample_time)?;
    report(sums, found, signals, delays, &spreads)
}

/// The channels, the inputs first, with what is taken from each.
fn signals(sums: &NormalEquations) -> Result<Vec<Signal>, Error> {
    let each = sums.settings.names().into_iter().enumerate();
    each.map(|(channel, name)| {
        let [least, largest] = sums.range(channel)?;
        if least == largest {
            return Err(is_constant(name));
        }
        let offset = Offset { level: sums.offset(channel)?, slope: 0.0 };
        Ok(Signal { name: name.to_owned(), offset })
    })
    .collect()
}

/// What is taken from the signals, the outputs first.
fn offsets(signals: &[Signal], delays: &[usize]) -> Vec<f64> {
    let (inputs, outputs) = signals.split_at(delays.len());
    outputs.iter().chain(inputs).map(|signal| signal.offset.level).collect()
}

/// The report of what was found, with the fit one step ahead of outputs with these norms about their means.
fn report(
    sums: &NormalEquations,
    found: Estimated,
    mut signals: Vec<Signal>,
    delays: &[usize],
    spreads: &[f64],
) -> Result<Report, Error> {
    let (samples, squares) = (found.samples, found.mean.diagonal());
    let outputs = signals.split_off(delays.len());
    let (mut report, _) = reported(found, (signals, outputs.clone()), delays.to_vec(), sums.data())?;
    for ((signal, square), spread) in outputs.iter().zip(&squares).zip(spreads) {
        report.fit.push(sums.one_step(&signal.name, (samples, *square), *spread, InitialCondition::Drop));
    }
    Ok(report.with_purpose())
}
