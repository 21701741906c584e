use std::ops::Range;

use super::forecast::{Known, continuation};
use super::free_response::{Delays, closest, impulse_response, until_negligible};
use super::innovations::{Impulses, driven, residuals};
use super::{Response, Start, check_inputs, history};
use crate::data::Record;
use crate::regression::{add_filtered, divide};
use crate::{Error, Model};

/// The free run of a model: A(q) y^(t) = sum_j (B_j(q)/F_j(q)) u_j(t), driven by the inputs alone.
///
/// [`Start::Zero`] takes zeros before each segment. [`Start::Drop`] goes on from measured samples, with e = 0
/// from the first sample that counts: what they say of the disturbance, which C and D give a memory, dies away from
/// there. For ARX it is the difference equation run from measured outputs and inputs. [`Start::Estimate`] adds the
/// combination of free responses
///
/// ```text
/// q^-i (1/A) delta,   i < max(na, nb + nk - 1 of the inputs without F)
/// q^-i (1/(A F_j)) delta,   i < nf_j
/// ```
///
/// that brings y^ closest to the output in the least-squares sense: everything that unknown samples before the segment
/// can do, but for earlier values of inputs with F, which are taken to be zero. Segments too short for a start are left out.
///
/// Signals are deviations from the model's offsets. The output of the record is not read for [`Start::Zero`].
/// Cost: O(N (na + nb + nf)), and O(N n) more for n free responses that do not die away.
///
/// # Errors
/// [`Error::Argument`] if the record does not have the model's inputs; [`Error::Undetermined`] if an initial condition
/// cannot be told from the data, as for a model so unstable that its free responses overflow.
///
/// ```
/// use thetahat::{Initial, Model, Orders, Record, Signal, Start, arx, simulate};
///
/// let u: Vec<f64> = (0..100_u32).map(|t| f64::from(t * t % 7)).collect();
/// let mut y = vec![1.0];
/// for t in 1..u.len() {
///     y.push(0.8 * y[t - 1] + 0.5 * u[t - 1]);
/// }
/// let record = Record::new(&y, vec![&u])?;
/// let orders = Orders::arx(1, &[1], &[1])?;
/// let estimate = arx(&record, &orders, Initial::Drop)?;
/// let model = Model::new(&orders, &estimate, 1.0, vec![Signal::default()], Signal::default())?;
/// // What began at y = 1 is made up for.
/// let run = simulate(&model, &record, Start::Estimate)?;
/// assert!(run.values.iter().zip(&y).all(|(run, y)| (run - y).abs() < 1e-9));
/// // From rest, a decaying part is missing.
/// let run = simulate(&model, &record, Start::Zero)?;
/// assert!((y[10] - run.values[10] - 0.8_f64.powi(10)).abs() < 1e-9);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn simulate(model: &Model, record: &Record<'_>, start: Start) -> Result<Response, Error> {
    check_inputs(model, record)?;
    let conditioned = model.orders.conditioned();
    let longest = record.segments.iter().map(Range::len).max().unwrap_or(0);
    let free = (start == Start::Estimate).then(|| Free::of(model, longest));
    let mut response = Response::empty(record.output.len());
    for (segment, past) in record.segments.iter().zip(&record.past) {
        let first = if start == Start::Drop { history(model, segment, *past, 0) } else { segment.start };
        let known = if start == Start::Drop { conditioned } else { 0 };
        let counted = (first + known).clamp(segment.start, segment.end)..segment.end;
        // An initial condition of n numbers needs more than n samples to be estimated from.
        if counted.is_empty() || free.as_ref().is_some_and(|free| counted.len() <= free.count) {
            continue;
        }
        let rows = first..segment.end;
        let inputs: Vec<&[f64]> = record.inputs.iter().map(|u| &u[rows.clone()]).collect();
        let mut x = driven(model, &inputs, rows.len(), &Impulses::none(model));
        let x = x.split_off(counted.start - first);
        let values = &mut response.values[counted.clone()];
        values.copy_from_slice(&x);
        if start == Start::Drop {
            let before = first..counted.start;
            let (disturbance, errors) =
                residuals(model, record, &before, conditioned, &Impulses::none(model));
            let output = &record.output[before];
            continuation(model, &Known { output, disturbance: &disturbance, errors: &errors }, values);
        } else {
            divide(&model.a, values);
        }
        if let Some(free) = &free {
            free.add_closest(&record.output[segment.clone()], values)?;
        }
        response.counted.push(counted);
    }
    Ok(response)
}

/// What unknown samples before a segment can do to a free run.
struct Free {
    count: usize,
    basis: Vec<Delays>,
}

impl Free {
    fn of(model: &Model, length: usize) -> Self {
        let orders = &model.orders;
        let response = |denominators: &[&[f64]], count| {
            let order: usize = denominators.iter().map(|monic| monic.len()).sum();
            let signal = until_negligible(length, order, |length| impulse_response(denominators, length));
            Delays { signal, count }
        };
        let direct = response(&[&model.a], orders.conditioned() - orders.nd);
        let filtered = model.f.iter().enumerate().filter(|(_, f)| f.len() > 1);
        let filtered = filtered.map(|(input, f)| response(&[&model.a, f], orders.free_responses(input)));
        let basis: Vec<Delays> = std::iter::once(direct).chain(filtered).collect();
        Self { count: basis.iter().map(|delays| delays.count).sum(), basis }
    }

    /// Adds the combination of free responses that brings `values` closest to `output`.
    fn add_closest(&self, output: &[f64], values: &mut [f64]) -> Result<(), Error> {
        if self.count == 0 {
            return Ok(());
        }
        // Behind the last free response there is nothing to fit.
        let ends = self.basis.iter().filter(|delays| delays.count > 0);
        let ends = ends.map(|delays| delays.signal.len() + delays.count);
        let length = ends.max().unwrap_or(0).max(self.count + 1).min(output.len());
        let target: Vec<f64> = output.iter().zip(&*values).take(length).map(|(y, x)| y - x).collect();
        for (weights, delays) in closest(&target, &self.basis)?.iter().zip(&self.basis) {
            let mut response = delays.signal[..delays.signal.len().min(length)].to_vec();
            response.resize(length, 0.0);
            add_filtered(&mut values[..length], &(0..length), weights, &response, 0);
        }
        Ok(())
    }
}
