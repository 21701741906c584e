//! Where a search begins.
//!
//! The sum of squared prediction errors has local minima, and a start decides which one is found (Ljung, System
//! Identification, 2nd ed. 1999, section 10.5). So each structure has several recipes, none of which searches:
//! linear regressions, a fixed number of them, on filtered signals.
//!
//! - `plant`: what B, the initial conditions and the cost are for given F, and steps towards a better F;
//!   `output_error`: the recipes that use them.
//! - `noise`: A, B and C by way of a long ARX model.
//! - `mixed`: the recipes of each structure, put together from these; `general`: those with A and F.
//! - `reduced`: normal equations from which initial conditions are taken out.

mod general;
mod mixed;
pub(super) mod noise;
mod output_error;
pub(super) mod plant;
pub(super) mod reduced;
#[cfg(test)]
mod tests;

use std::ops::Range;

use thetahat_core::nalgebra::{Complex, ComplexField};
use thetahat_numerics::optimize::Deadline;
use thetahat_numerics::regression::{Lagged, Presample, Taps, Unsolved};

use super::arx::{enough, out_of_range, signals};
use crate::Error;
use crate::data::Record;
use crate::model::{
    Orders,
    polynomial::{is_stable, multiply_out, roots},
};

/// Roots closer to the unit circle are moved away from it by this factor.
const SHRINK: f64 = 0.999;
/// Sizes of signals of which squares stay within the range of numbers.
const SAFE: std::ops::RangeInclusive<f64> = 1e-140..=1e140;

/// Where a search may begin.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Candidate {
    /// The recipe.
    pub(super) name: &'static str,
    /// In the order of [`Orders::names`]. C and F are stable.
    pub(super) parameters: Vec<f64>,
    /// The largest modulus of a root of F that was above 1, before it was reflected.
    pub(super) unstable_pole: Option<f64>,
}

/// The starts for a model, the most promising recipe first. O(N p), some dozen passes over the data.
///
/// A recipe that the data do not serve is left out. Segments begin with unknown initial conditions. After the deadline
/// no recipe begins but the first, and no iteration of one.
///
/// # Errors
/// As for [`arx`](super::arx()): [`Error::Undetermined`] if the data serve none, with the parameters concerned.
pub(super) fn candidates(
    record: &Record<'_>,
    orders: &Orders,
    deadline: Deadline,
) -> Result<Vec<Candidate>, Error> {
    let signals = signals(record, orders)?;
    let lost = |segment: &Range<usize>| segment.len().saturating_sub(orders.conditioned());
    enough(record.segments.iter().map(lost).sum(), orders)?;
    let mut candidates = mixed::starts(record.output, &record.inputs, &record.segments, orders, deadline);
    candidates.retain(|candidate| candidate.parameters.iter().all(|value| value.is_finite()));
    if candidates.is_empty() {
        return Err(undetermined(&signals, record, orders));
    }
    Ok(candidates)
}

/// What plants are found for the orders of B and F of a model without A, whatever its noise.
pub(super) struct Plants(Vec<output_error::Start>);

impl Plants {
    /// None where the data are degenerate. O(N p), some dozen passes over the data.
    pub(super) fn new(record: &Record<'_>, orders: &Orders, deadline: Deadline) -> Self {
        Self(data(record, orders, deadline).output_error().starts())
    }

    /// [`candidates`] with these plants, for orders that have the same B and F, and C and D too: a few passes more.
    pub(super) fn with_noise(
        &self,
        record: &Record<'_>,
        orders: &Orders,
        deadline: Deadline,
    ) -> Vec<Vec<f64>> {
        let found = data(record, orders, deadline).box_jenkins(&self.0);
        found.into_iter().map(|candidate| candidate.parameters).collect()
    }
}

fn data<'a>(record: &'a Record<'a>, orders: &'a Orders, deadline: Deadline) -> mixed::Data<'a> {
    let Record { output, inputs, segments, .. } = record;
    mixed::Data { output, inputs, segments, orders, deadline }
}

/// Why there is no start.
fn undetermined(signals: &[&[f64]], record: &Record<'_>, orders: &Orders) -> Error {
    let largest = |signal: &&[f64]| {
        let values = record.segments.iter().flat_map(|rows| &signal[rows.clone()]);
        values.fold(0.0_f64, |largest, value| largest.max(value.abs()))
    };
    if signals.iter().map(largest).any(|largest| largest != 0.0 && !SAFE.contains(&largest)) {
        return out_of_range();
    }
    // The linear model of this size says what is at fault.
    let names = orders.names();
    let common = orders.nf.iter().copied().max().unwrap_or(0);
    let mut columns: Vec<Vec<String>> = Vec::new();
    let named =
        |letter: char| names.iter().filter(move |name| name.starts_with(letter)).cloned().collect::<Vec<_>>();
    let order = orders.na.max(common).max(orders.nd).max(1);
    let of_output: Vec<String> = ['a', 'd', 'f'].into_iter().flat_map(named).collect();
    columns.extend(std::iter::repeat_n(of_output, order));
    columns.extend(named('b').into_iter().map(|name| vec![name]));
    let mut taps = vec![Taps { signal: 0, first: 1, count: order, sign: -1.0 }];
    let inputs = orders.nb.iter().zip(&orders.nk).enumerate();
    taps.extend(inputs.map(|(j, (&count, &first))| Taps { signal: j + 1, first, count, sign: 1.0 }));
    let lagged = Lagged::new(signals, taps, &record.segments, Presample::Drop);
    let solved = if lagged.rows() > columns.len() { lagged.solve().err() } else { None };
    let mut concerned = match solved {
        Some(Unsolved::Deficient(at)) => {
            at.iter().filter_map(|&at| columns.get(at)).flatten().cloned().collect()
        }
        _ => names.clone(),
    };
    concerned.sort_by_key(|name| names.iter().position(|other| other == name));
    concerned.dedup();
    let message = format!(
        "the data give no start for a search: they cannot tell {} from the other parameters; excite the input more, give \
         more rows, or lower the orders",
        concerned.join(", ")
    );
    Error::undetermined(concerned, message)
}

/// A monic polynomial with its unstable roots reflected at the unit circle, z to 1/z*, and the largest modulus above 1
/// that there was. None if a coefficient is not finite.
pub(super) fn stable(monic: &[f64]) -> Option<(Vec<f64>, Option<f64>)> {
    if !monic.iter().all(|value| value.is_finite()) {
        return None;
    }
    let mut scratch = Vec::new();
    if is_stable(monic, &mut scratch) {
        return Some((monic.to_vec(), None));
    }
    let roots = roots(monic)?;
    let largest = roots.iter().map(|root| root.modulus()).fold(0.0, f64::max);
    let reflect = |root: &Complex<f64>| {
        if root.modulus() > 1.0 { *root / root.modulus_squared() } else { *root }
    };
    let mut product = Vec::new();
    multiply_out(roots.iter().map(reflect), &mut product);
    let mut reflected: Vec<f64> = product.iter().map(|value| value.re).collect();
    // Roots beyond the range of numbers are reflected into the origin.
    reflected.resize(monic.len(), 0.0);
    // On the circle, or so close that rounding decides.
    while !is_stable(&reflected, &mut scratch) {
        let mut factor = 1.0;
        for value in reflected.iter_mut().skip(1) {
            factor *= SHRINK;
            *value *= factor;
        }
    }
    Some((reflected, (largest > 1.0).then_some(largest)))
}
