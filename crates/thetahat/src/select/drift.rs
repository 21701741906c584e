//! Whether the noise drifts: its level wanders without end, and no input makes it.
//!
//! The model with the least MDL is fitted again with a noise that integrates, 1 - q^-1 in D in the place of a root that
//! was searched for (Box, Jenkins and Reinsel, Time Series Analysis, 1994, chapter 4). That is one parameter less, so
//! MDL is less unless the data speak against it. Free runs have no level of their own then: they are compared in
//! windows of some settling times, each with the level that fits it best. Without that a slow pole of a plant is
//! rewarded for following the drift.

use super::Task;
use super::candidates::Trial;
use super::held_out::radius;
use crate::Error;
use crate::data::Record;
use crate::estimate::{Estimate, Initial, Method, estimate_of_channels, with_noise_integrator};
use crate::model::{Orders, polynomial::roots};

/// A noise with no slower real root than this does not drift.
const SLOW: f64 = 0.9;
/// Nor does one whose time constant is less than this many times that of the plant.
const SLOWER: f64 = 2.0;
/// Blocks average over a noise whose time constant is less than this fraction of the samples.
const MOST: f64 = 50.0;
/// A random walk shows where it is above white noise after less than this fraction of the samples.
const LEAST: f64 = 20.0;
/// Windows are this many time constants of the slowest pole long, and no shorter than this.
const SETTLED: f64 = 4.0;
const SHORTEST: usize = 64;

/// The orders of a model with a noise that integrates in the place of one with a slow root: D has that root, or A, and
/// then B one to cancel it. None where the noise has no model of its own.
fn integrating(orders: &Orders) -> Option<Orders> {
    match orders {
        Orders { nd: 1.., .. } => Some(orders.clone()),
        Orders { na: 1.., nc: 1.., nb, .. } => {
            let nb = nb.iter().map(|&nb| if nb > 1 { nb - 1 } else { nb }).collect();
            Some(Orders { na: orders.na - 1, nb, nd: 1, ..orders.clone() })
        }
        _ => None,
    }
}

/// The same for any model that was chosen where the noise drifts: one without a model of the noise gets a random walk
/// and white noise.
pub(crate) fn drifting(orders: &Orders) -> Orders {
    integrating(orders).unwrap_or_else(|| Orders { nc: orders.nc.max(1), nd: 1, ..orders.clone() })
}

/// What drifts, if the noise of a model does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Drift {
    /// How long windows are in which free runs have levels of their own.
    pub(super) window: usize,
    /// Whether the noise integrates; it is slower than the plant otherwise.
    pub(super) integrates: bool,
}

/// What drifts, by the noise of the model with the least criterion; none where nothing does. Two searches.
///
/// # Errors
/// [`Error::Interrupted`].
pub(super) fn drift(task: &Task<'_>, record: &Record<'_>, model: &Trial) -> Result<Option<Drift>, Error> {
    let Some(point) = &model.point else { return Ok(None) };
    let orders = &model.orders;
    let after_c = before_c(orders) + orders.nc;
    let own = if orders.nd > 0 { after_c..after_c + orders.nd } else { 0..orders.na };
    let noise = slowest_real(&point.parameters[own]);
    let Some(with) = integrating(orders).filter(|_| noise > SLOW) else { return Ok(None) };
    let method = Method::PredictionError(task.search.clone());
    let free = estimate_of_channels(record, task.inputs, orders, &method, Initial::Auto, task.monitor);
    let named = Record { inputs: record.inputs[..task.inputs.len()].to_vec(), ..record.clone() };
    let with = task.named(&with);
    let integrated = with_noise_integrator(&named, &with, task.inputs, task.search, task.monitor);
    let (free, integrated) = match (free, integrated) {
        (Err(Error::Interrupted), _) | (_, Err(Error::Interrupted)) => return Err(Error::Interrupted),
        (Ok(free), Ok(integrated)) => (free, integrated),
        _ => return Ok(None),
    };
    // The root is no parameter that the data chose.
    let mdl = |estimate: &Estimate, parameters: usize| {
        let samples = free.samples() as f64;
        estimate.mse().ln() + parameters as f64 * samples.ln() / samples
    };
    let integrates = mdl(&integrated, with.parameters() - 1) <= mdl(&free, orders.parameters());
    let plant =
        if integrates { radius(&with, integrated.parameters()) } else { radius(orders, &point.parameters) };
    let time = |root: f64| -1.0 / root.min(1.0 - 1e-9).ln();
    let (samples, first) = (free.samples() as f64, before_c(&with));
    let white = slowest_real(&integrated.parameters()[first..first + with.nc]);
    let drifts = if integrates {
        // A root of C beside the 1 of D says that there is neither.
        time(white) < samples / LEAST
    } else {
        orders.nd > 0 && time(noise) > (SLOWER * time(plant)).max(samples / MOST)
    };
    if !drifts {
        return Ok(None);
    }
    Ok(Some(Drift { window: ((SETTLED * time(plant)) as usize).max(SHORTEST), integrates }))
}

/// The place of the first parameter of C.
fn before_c(orders: &Orders) -> usize {
    orders.na + orders.nb.iter().sum::<usize>()
}

/// The largest real root of a monic polynomial that has these coefficients after the first; 0 where none is positive.
fn slowest_real(coefficients: &[f64]) -> f64 {
    let monic: Vec<f64> = std::iter::once(1.0).chain(coefficients.iter().copied()).collect();
    let roots = roots(&monic).unwrap_or_default();
    roots.iter().filter(|root| root.im == 0.0).map(|root| root.re).fold(0.0, f64::max)
}
