//! The ARX model with several outputs that normal equations hold.

use super::super::schema::Report;
use super::super::state_space::{is_constant, of_arx, reported};
use super::NormalEquations;
use crate::Error;
use crate::data::Offset;
use crate::estimate::{VectorArxOptions, joint_taps, out_of_range, vector_arx_of_sums};
use crate::model::Signal;
use crate::regression::ExtendedGram;
use crate::respond::InitialCondition;

/// With the offsets of all pieces, the orders and the coupling of the least MDL among those that were asked for, and levels likewise.
pub(super) fn solve(
    sums: &NormalEquations,
    delays: &[usize],
    arx: &VectorArxOptions,
) -> Result<Report, Error> {
    let names = sums.settings.names();
    let signals = names
        .iter()
        .enumerate()
        .map(|(channel, name)| {
            let [least, largest] = sums.range(channel)?;
            if least == largest {
                return Err(is_constant(name));
            }
            let offset = Offset { level: sums.offset(channel)?, slope: 0.0 };
            Ok(Signal { name: (*name).to_owned(), offset })
        })
        .collect::<Result<Vec<_>, Error>>()?;
    let (inputs, outputs) = signals.split_at(delays.len());
    let taps = joint_taps(delays, outputs.len(), arx.longest(inputs.len()));
    let of_signals: Vec<f64> = outputs.iter().chain(inputs).map(|signal| signal.offset.level).collect();
    let products = sums.products.less(&taps, &of_signals);
    if !products.is_in_range() {
        return Err(out_of_range());
    }
    let find = |constant: bool| {
        let options = VectorArxOptions { constant, ..arx.clone() };
        vector_arx_of_sums(&products, &taps, outputs.len(), &options, sums.sample_time)
    };
    // Errors that lagged products cannot tell from none are none: the rows are gone.
    let found =
        of_arx(find, |found| Ok(found.space.noise_covariance.clone()), delays, sums.settings.constant)?;
    let (samples, squares) = (found.samples, found.mean.diagonal());
    let (mut report, _) = reported(found, (inputs.to_vec(), outputs.to_vec()), delays.to_vec(), sums.data())?;
    let columns = ExtendedGram::columns(&taps);
    let lags = columns.len() / taps.len();
    for (output, signal) in outputs.iter().enumerate() {
        let spread = products.spread(columns[output * lags].0).sqrt();
        let errors = (samples, squares[output]);
        report.fit.push(sums.one_step(&signal.name, errors, spread, InitialCondition::Drop));
    }
    Ok(report)
}
