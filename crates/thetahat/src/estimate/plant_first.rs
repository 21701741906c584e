//! The plant that simulates best, and the noise behind it.
//!
//! The plant minimises the errors of its free run, as a model of output error does; what these errors are made of is
//! found after it:
//!
//! ```text
//! y = B/F u + v,  sum v^2 least;   then D v = C e, sum e^2 least          Box-Jenkins, output error
//! y = B/A u + v,  sum v^2 least;   then A v = C e, sum e^2 least over C   ARX, ARMAX
//! ```
//!
//! (Ljung, System Identification, 2nd ed. 1999, sections 8.5 and 10.4: what is right for the true plant in any noise,
//! and where the plant is not among the models closest to it in the frequencies that the input has). The least sum of
//! e^2 over all parameters weighs the plant's errors by 1/H instead, which looks away from slow ones. Several inputs
//! share A (see `shared`).
//!
//! The covariance of the plant is that of output error, with coloured errors; that of the noise is its own. Estimates
//! of the two do not correlate without feedback (Ljung 1999, section 9.4).

mod shared;

use std::ops::Range;

use thetahat_core::nalgebra::DMatrix;
use thetahat_numerics::optimize::{Monitor, Search, best_free};
use thetahat_numerics::regression::{sum, sum_of_squares};

use super::arx::rows;
use super::polynomials::Polynomials;
use super::prediction_error::{prediction_error, predictor_of};
use super::{Estimate, Initial, Procedure};
use crate::Error;
use crate::data::Record;
use crate::estimate::InformationCriterion;
use crate::model::Orders;

/// Autoregressions behind a plant have this many coefficients at most.
const LONGEST: usize = 10;
/// This many errors for each of them.
const SAMPLES: usize = 10;

/// The estimate of a plant first; `named` inputs have names, those after them are a constant and a trend.
pub(super) fn plant_first(
    record: &Record<'_>,
    named: usize,
    orders: &Orders,
    initial: Initial,
    options: &Search,
    monitor: Monitor<'_>,
) -> Result<Estimate, Error> {
    let plant = plant(orders, named)?;
    let driven = plant.nf[..named].iter().filter(|&&nf| nf > 0).count();
    let coefficients = orders.nb.iter().sum::<usize>();
    let b = orders.na..orders.na + coefficients;
    let (first, (v, segments), places) = if orders.na > 0 && driven > 1 {
        let (first, errors) = shared::plant(record, orders, &plant, initial, options, monitor)?;
        (first, errors, (0..b.end).collect())
    } else {
        let initial_parameters =
            options.initial_parameters.as_ref().and_then(|initial| of_plant(initial, orders, &plant));
        let search = Search { plant_first: false, initial_parameters, ..options.clone() };
        let first = prediction_error(record, &plant, initial, &search, monitor)?;
        let errors = free_run_errors(record, &plant, &first)?;
        // F, which is A where that is the denominator.
        let f = if orders.na > 0 { 0..orders.na } else { b.end + orders.nc + orders.nd..orders.parameters() };
        let places: Vec<usize> = b.clone().chain(f).collect();
        (first, errors, places)
    };
    let mut parameters = vec![0.0; orders.parameters()];
    places.iter().zip(first.parameters()).for_each(|(&place, value)| parameters[place] = *value);
    let mut polynomials = Polynomials::new(orders, &parameters);
    let (errors, segments) =
        if orders.na > 0 { filtered(&v, &segments, &polynomials.a) } else { (v, segments) };
    let noise = Orders::new(orders.nd, &[], orders.nc, 0, &[], &[]);
    let unknown = first.parameters().len() + first.procedure().initial_conditions();
    let (samples, cost, noise) = match noise {
        Ok(noise) => {
            let past = vec![0; segments.len()];
            let record = Record { output: &errors, inputs: Vec::new(), segments, past };
            let search = Search { plant_first: false, initial_parameters: None, ..options.clone() };
            let found = prediction_error(&record, &noise, Initial::Auto, &search, monitor)?;
            (found.samples(), found.mse() * found.samples() as f64, Some(found))
        }
        Err(_) => (errors.len(), sum_of_squares(&errors), None),
    };
    let taken = unknown + noise.as_ref().map_or(0, |noise| noise.parameters().len());
    if samples <= taken {
        return Err(Error::undetermined(
            orders.names(),
            "too few rows are left for the noise behind the plant; give more rows, or lower the orders",
        ));
    }
    if orders.na > 0 {
        // The level of the output, and the constant beside A that makes it.
        let gain: f64 = polynomials.a.iter().sum();
        polynomials.b[named..].iter_mut().flatten().for_each(|constant| *constant *= gain);
    }
    if let Some(noise) = &noise {
        let (d, c) = noise.parameters().split_at(orders.nd);
        polynomials.d = [&[1.0], d].concat();
        polynomials.c = [&[1.0], c].concat();
    }
    let covariance = covariance(orders, named, (&first, &places), noise.as_ref(), &polynomials);
    let procedure = match first.procedure() {
        Procedure::PredictionError(outcome) => {
            let mut outcome = outcome.clone();
            outcome.plant_first = true;
            Procedure::PredictionError(outcome)
        }
        other => other.clone(),
    };
    Ok(Estimate {
        parameters: polynomials.parameters(),
        covariance,
        noise_variance: cost / (samples - taken) as f64,
        samples,
        mse: cost / samples as f64,
        condition: first.condition(),
        // What unknown samples do to the errors one step ahead ends where there is no F.
        initial: if orders.has_f() { first.initial() } else { Initial::Drop },
        procedure,
    })
}

/// How many coefficients of an autoregression of the errors of an output-error model lower MDL.
pub(crate) fn noise_order(record: &Record<'_>, orders: &Orders, estimate: &Estimate) -> Result<usize, Error> {
    let (mut v, segments) = free_run_errors(record, orders, estimate)?;
    let level = sum(v.iter().copied()) / v.len().max(1) as f64;
    v.iter_mut().for_each(|v| *v -= level);
    let past = vec![0; segments.len()];
    let all = Record { output: &v, inputs: Vec::new(), segments, past };
    let longest = LONGEST.min(v.len() / SAMPLES);
    let mut best = (f64::INFINITY, 0);
    for order in 0..=longest {
        // All of them see the same errors.
        let segments: Vec<Range<usize>> = all
            .segments
            .iter()
            .map(|segment| segment.start + longest.min(segment.len())..segment.end)
            .collect();
        let samples: usize = segments.iter().map(Range::len).sum();
        let cost = if order == 0 {
            segments.iter().map(|segment| sum_of_squares(&v[segment.clone()])).sum()
        } else {
            let past = vec![longest; segments.len()];
            let record = Record { segments, past, ..all.clone() };
            let orders = Orders::new(order, &[], 0, 0, &[], &[])?;
            let Ok(found) = super::arx(&record, &orders, Initial::Drop) else { break };
            found.mse() * found.samples() as f64
        };
        let mdl = InformationCriterion::MDL
            .value(cost / samples as f64, order, samples)
            .unwrap_or(f64::NEG_INFINITY);
        if mdl < best.0 {
            best = (mdl, order);
        }
    }
    Ok(best.1)
}

/// The model of output error with the plant of some orders.
fn plant(orders: &Orders, named: usize) -> Result<Orders, Error> {
    let driven = orders.nb[..named].iter().filter(|nb| **nb > 0).count();
    if driven == 0 {
        return Err(Error::argument("focus", "without inputs there is no free run; take prediction"));
    }
    if orders.na == 0 {
        return Ok(Orders { nc: 0, nd: 0, ..orders.clone() });
    }
    if orders.has_f() || orders.nd > 0 {
        return Err(Error::argument(
            "focus",
            "the free run of a model with A and F or D has no plant of its own; leave out A, or F and D",
        ));
    }
    if orders.inputs() > named + 1 {
        return Err(Error::argument(
            "focus",
            "with A and a trend it is not there; take oe or bj, or leave out the trend",
        ));
    }
    let nf =
        orders.nb.iter().enumerate().map(|(input, &nb)| if input < named && nb > 0 { orders.na } else { 0 });
    Ok(Orders { na: 0, nc: 0, nd: 0, nf: nf.collect(), ..orders.clone() })
}

/// Initial parameters of the plant alone, or its part of those of all parameters.
fn of_plant(initial: &[f64], orders: &Orders, plant: &Orders) -> Option<Vec<f64>> {
    if initial.len() == plant.parameters() {
        return Some(initial.to_vec());
    }
    (initial.len() == orders.parameters() && orders.na == 0).then(|| {
        let Polynomials { b, f, .. } = Polynomials::new(orders, initial);
        let f = f.iter().flat_map(|f| f[1..].iter().copied());
        b.iter().flatten().copied().chain(f).collect()
    })
}

/// Errors, and the segments of them that follow one another.
type Errors = (Vec<f64>, Vec<Range<usize>>);

/// v of an estimated plant, and the segments of it that follow one another.
fn free_run_errors(record: &Record<'_>, plant: &Orders, estimate: &Estimate) -> Result<Errors, Error> {
    let mut predictor = predictor_of(record, plant, estimate);
    if best_free(&mut predictor, estimate.parameters()).is_err() {
        return Err(Error::data("the free run overflows; scale the channels towards one"));
    }
    Ok(predictor.residuals())
}

/// A v, where all of v is there.
fn filtered(v: &[f64], segments: &[Range<usize>], a: &[f64]) -> (Vec<f64>, Vec<Range<usize>>) {
    let mut errors = Vec::with_capacity(v.len());
    let lag = a.len() - 1;
    let segments = segments.iter().filter(|segment| segment.len() > lag).map(|segment| {
        let first = errors.len();
        errors.extend(
            (segment.start + lag..segment.end)
                .map(|t| sum(a.iter().zip((0..=t).rev()).map(|(a, t)| a * v[t]))),
        );
        first..errors.len()
    });
    let segments = segments.collect();
    (errors, segments)
}

/// The covariance of all parameters from those of plant and noise; those of the plant stand at `places` among them.
fn covariance(
    orders: &Orders,
    named: usize,
    (first, places): (&Estimate, &[usize]),
    noise: Option<&Estimate>,
    all: &Polynomials,
) -> Option<Vec<Vec<f64>>> {
    let own = first.covariance()?;
    let mut jacobian = DMatrix::zeros(orders.parameters(), places.len());
    for (column, &row) in places.iter().enumerate() {
        jacobian[(row, column)] = 1.0;
    }
    // After A and B.
    let c = orders.na + orders.nb.iter().sum::<usize>();
    if orders.na > 0 && orders.inputs() > named {
        // k = A(1) l.
        let gain: f64 = all.a.iter().sum();
        let level = all.b[named][0] / gain;
        for (column, &place) in places.iter().enumerate() {
            if place < orders.na {
                jacobian[(c - 1, column)] = level;
            } else if place == c - 1 {
                jacobian[(c - 1, column)] = gain;
            }
        }
    }
    let matrix = DMatrix::from_fn(places.len(), places.len(), |i, j| own[i][j]);
    let mut covariance = &jacobian * matrix * jacobian.transpose();
    if let Some(noise) = noise {
        let own = noise.covariance()?;
        // D comes first in the noise as its A, C first in the model.
        let place = |k: usize| if k < orders.nd { c + orders.nc + k } else { c + k - orders.nd };
        for (i, row) in own.iter().enumerate() {
            for (j, entry) in row.iter().enumerate() {
                covariance[(place(i), place(j))] = *entry;
            }
        }
    }
    Some(rows(&covariance))
}

#[cfg(test)]
mod tests;
