use std::ops::Range;

use thetahat_numerics::regression::{add_filtered, divide, sum};

use super::forecast::{Known, continuation};
use super::initial_responses::{
    Column, Delays, UNDETERMINED, closest, closest_of, impulse_response, until_negligible,
};
use super::innovations::{Impulses, driven, residuals};
use super::{InitialCondition, NOTHING_LEFT, Response, are_worth, check_inputs, history};
use crate::Error;
use crate::data::{Record, measured};
use crate::model::PolynomialModel;

/// The free run of a model: A(q) y^(t) = sum_j (B_j(q)/F_j(q)) u_j(t), driven by the inputs alone.
///
/// [`InitialCondition::Zero`] takes zeros before each segment. [`InitialCondition::Drop`] goes on from measured
/// samples, with e = 0 from the first sample that counts: what they say of the disturbance, which C and D give a
/// memory, dies away from there. For ARX it is the difference equation run from measured outputs and inputs.
/// [`InitialCondition::Estimate`] takes the inputs that were measured directly before the segment, and adds the
/// combination of initial-condition responses
///
/// ```text
/// q^-i (1/A) delta,   i < max(na, nb + nk - 1 of the inputs without F)
/// q^-i (1/(A F_j)) delta,   i < nf_j, or max(nf_j, n_j)
/// ```
///
/// that brings y^ closest to the output in the least-squares sense: everything that unknown samples before the segment
/// can do. Where the noise integrates, D(1) = 0, a constant is among them: its level before the segment is not known. n
/// is how many earlier inputs B reaches back to that are not known, nb + nk - 1 at most. They are taken to be zero,
/// unless estimating them is worth its parameters by the rule of [`Initial::Auto`](crate::estimate::Initial::Auto).
/// Segments too short for a start are left out.
///
/// But for [`InitialCondition::Drop`], the run goes on where an output is missing (see
/// [`Log::driven_record`](crate::data::Log::driven_record)); these samples do not count.
///
/// Signals are deviations from the model's offsets. The output of the record is not read for
/// [`InitialCondition::Zero`]. Cost: O(N (na + nb + nf)), and O(N n) more for n initial-condition responses that do not
/// die away, O(N n^2) where outputs are missing.
///
/// # Errors
/// [`Error::Argument`] if the record does not have the model's inputs; [`Error::Undetermined`] if an initial condition
/// cannot be told from the data, as for a model so unstable that its initial-condition responses overflow.
///
/// ```
/// use thetahat::data::Record;
/// use thetahat::estimate::{Initial, arx};
/// use thetahat::model::{Orders, PolynomialModel, Signal};
/// use thetahat::respond::{InitialCondition, simulate};
///
/// let u: Vec<f64> = (0..100_u32).map(|t| f64::from(t * t % 7)).collect();
/// let mut y = vec![1.0];
/// for t in 1..u.len() {
///     y.push(0.8 * y[t - 1] + 0.5 * u[t - 1]);
/// }
/// let record = Record::new(&y, vec![&u])?;
/// let orders = Orders::arx(1, &[1], &[1])?;
/// let estimate = arx(&record, &orders, Initial::Drop)?;
/// let model = estimate.to_model(&orders, 1.0, vec![Signal::default()], Signal::default())?;
/// // What began at y = 1 is made up for.
/// let run = simulate(&model, &record, InitialCondition::Estimate)?;
/// assert!(run.values.iter().zip(&y).all(|(run, y)| (run - y).abs() < 1e-9));
/// // From rest, a decaying part is missing.
/// let run = simulate(&model, &record, InitialCondition::Zero)?;
/// assert!((y[10] - run.values[10] - 0.8_f64.powi(10)).abs() < 1e-9);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn simulate(
    model: &PolynomialModel,
    record: &Record<'_>,
    start: InitialCondition,
) -> Result<Response, Error> {
    check_inputs(model, record)?;
    let conditioned = model.orders.conditioned();
    let mut free = Free::new(model, record);
    for (segment, past) in record.segments.iter().zip(&record.past) {
        let lag =
            (0..model.orders.inputs()).map(|input| model.orders.maximum_input_lag(input)).max().unwrap_or(0);
        let (before, known) = match start {
            InitialCondition::Zero => (0, 0),
            InitialCondition::Drop => (segment.start - history(model, segment, *past, 0), conditioned),
            InitialCondition::Estimate => (lag.min(*past), lag.min(*past)),
        };
        let first = segment.start - before;
        let run = (first + known).clamp(segment.start, segment.end)..segment.end;
        if run.is_empty() {
            continue;
        }
        let rows = first..segment.end;
        let inputs: Vec<&[f64]> = record.inputs.iter().map(|u| &u[rows.clone()]).collect();
        let mut values = driven(model, &inputs, rows.len(), &Impulses::none(model));
        values.drain(..run.start - first);
        if start == InitialCondition::Drop {
            let before = first..run.start;
            let (disturbance, errors) =
                residuals(model, record, &before, conditioned, &Impulses::none(model), true);
            let output = &record.output[before];
            continuation(model, &Known { output, disturbance: &disturbance, errors: &errors }, &mut values);
        } else {
            divide(&model.a, &mut values);
        }
        free.runs.push(Run { rows: run, past: *past, values });
    }
    let runs = if start == InitialCondition::Estimate { free.completed()? } else { free.runs };
    let counted = runs.iter().flat_map(|run| measured(record.output, &run.rows)).collect();
    let runs = runs.into_iter().map(|run| (run.rows, run.values)).collect();
    Ok(Response::of_runs(record.output.len(), runs, counted))
}

/// 1 - q^-1.
const INTEGRATOR: [f64; 2] = [1.0, -1.0];

/// The free run of a segment.
#[derive(Debug)]
struct Run {
    rows: Range<usize>,
    /// How many measured samples stand before it.
    past: usize,
    values: Vec<f64>,
}

/// What unknown samples before segments can do to free runs.
struct Free<'a> {
    model: &'a PolynomialModel,
    output: &'a [f64],
    /// Free runs from zero but for known inputs.
    runs: Vec<Run>,
    /// The responses of 1/A, of 1/(A F_j) for each input with F, and of 1/(1 - q^-1) where the noise integrates.
    responses: Vec<Vec<f64>>,
}

impl<'a> Free<'a> {
    fn new(model: &'a PolynomialModel, record: &Record<'a>) -> Self {
        Self { model, output: record.output, runs: Vec::new(), responses: Vec::new() }
    }

    /// How many initial-condition responses of 1/A, of each 1/(A F_j), and of 1/(1 - q^-1) make up for what is unknown
    /// before a segment.
    fn counts(&self, past: usize, with_inputs: bool) -> Vec<usize> {
        let orders = &self.model.orders;
        let inputs = 0..orders.inputs();
        let unknown = |input: usize| orders.maximum_input_lag(input).saturating_sub(past);
        let filtered = inputs
            .filter(|&input| orders.nf[input] > 0)
            .map(|input| if with_inputs { orders.nf[input].max(unknown(input)) } else { orders.nf[input] });
        let level = self.model.noise_integrates().then_some(1);
        std::iter::once(orders.conditioned() - orders.nd).chain(filtered).chain(level).collect()
    }

    /// The runs with the initial conditions that fit best.
    fn completed(mut self) -> Result<Vec<Run>, Error> {
        let longest = self.runs.iter().map(|run| run.rows.len()).max().unwrap_or(0);
        let response = |denominators: &[&[f64]]| {
            let order: usize = denominators.iter().map(|monic| monic.len()).sum();
            until_negligible(longest, order, |length| impulse_response(denominators, length))
        };
        let a = &self.model.a;
        let filtered = self.model.f.iter().filter(|f| f.len() > 1).map(|f| response(&[a, f]));
        let level = self.model.noise_integrates().then(|| response(&[&INTEGRATOR]));
        self.responses = std::iter::once(response(&[a])).chain(filtered).chain(level).collect();
        let all = |with_inputs: bool| -> Result<Vec<Completed>, Error> {
            let each = self.runs.iter().enumerate();
            each.filter_map(|(index, run)| self.complete(index, run, with_inputs).transpose()).collect()
        };
        let found = all(false)?;
        let matters = |run: &Run| self.counts(run.past, true) != self.counts(run.past, false);
        let more = if self.runs.iter().any(matters) { all(true).ok() } else { None };
        let square = |found: &[Completed]| found.iter().map(|run| self.square_of(run)).sum::<f64>();
        let unknown = |found: &[Completed]| found.iter().map(|run| run.unknown).sum::<usize>();
        let worth = |more: &Vec<Completed>| {
            let extra = unknown(more).saturating_sub(unknown(&found));
            if extra == 0 {
                return false;
            }
            let samples = found.iter().map(|run| run.samples).sum::<usize>();
            let output = |run: &Completed| sum(run.rows().map(|row| self.output[row].powi(2)));
            let nothing = NOTHING_LEFT * found.iter().map(output).sum::<f64>();
            are_worth(samples, square(&found), square(more), extra, nothing)
        };
        let best = more.filter(worth).unwrap_or(found);
        let mut runs: Vec<Option<Run>> = self.runs.into_iter().map(Some).collect();
        let completed = best.into_iter().filter_map(|Completed { run, head, .. }| {
            let mut run = runs.get_mut(run)?.take()?;
            run.values[..head.len()].copy_from_slice(&head);
            Some(run)
        });
        Ok(completed.collect())
    }

    /// The sum of squares of what a run leaves.
    fn square_of(&self, completed: &Completed) -> f64 {
        let Completed { run, head, .. } = completed;
        let Run { rows, values, .. } = &self.runs[*run];
        let value = |t: usize| head.get(t).copied().unwrap_or_else(|| values[t]);
        sum(completed.rows().map(|row| (self.output[row] - value(row - rows.start)).powi(2)))
    }

    /// What begins a run with its initial conditions, if it has more measured samples than these are.
    fn complete(&self, index: usize, run: &Run, with_inputs: bool) -> Result<Option<Completed>, Error> {
        let measured = measured(self.output, &run.rows);
        let samples: usize = measured.iter().map(Range::len).sum();
        let mut counts = self.counts(run.past, with_inputs);
        if samples <= counts.iter().sum() {
            counts = self.counts(run.past, false);
        }
        let unknown: usize = counts.iter().sum();
        if samples <= unknown {
            return Ok(None);
        }
        let head = if unknown > 0 {
            self.closest(&self.output[run.rows.clone()], &counts, samples < run.rows.len(), &run.values)?
        } else {
            Vec::new()
        };
        Ok(Some(Completed { run: index, head, measured, samples, unknown }))
    }

    /// The first of `values`, with the combination of initial-condition responses that brings them closest to `output`,
    /// which may have gaps. It does nothing to those after them.
    fn closest(
        &self,
        output: &[f64],
        counts: &[usize],
        gaps: bool,
        values: &[f64],
    ) -> Result<Vec<f64>, Error> {
        // After the last initial-condition response there is nothing to fit.
        let used = || self.responses.iter().zip(counts).filter(|(_, count)| **count > 0);
        let ends = used().map(|(response, count)| response.len() + count);
        let length = ends.max().unwrap_or(0).max(counts.iter().sum::<usize>() + 1).min(output.len());
        let error = |(y, x): (&f64, &f64)| if y.is_nan() { 0.0 } else { y - x };
        let target: Vec<f64> = output.iter().zip(values).take(length).map(error).collect();
        let fitted = |response: &[f64]| {
            let mut fitted = response[..response.len().min(length)].to_vec();
            fitted.resize(length, 0.0);
            fitted
        };
        let weights = if gaps {
            let columns = used().flat_map(|(response, count)| {
                let response = fitted(response);
                (0..*count).map(move |delay| {
                    let mut values = vec![0.0; delay.min(length)];
                    values.extend_from_slice(&response[..length - delay.min(length)]);
                    let whole = values.iter().fold(0.0_f64, |size, value| size.hypot(*value));
                    values
                        .iter_mut()
                        .zip(output)
                        .filter(|(_, y)| y.is_nan())
                        .for_each(|(value, _)| *value = 0.0);
                    Column { values, rounding: UNDETERMINED * whole }
                })
            });
            let mut weights = closest_of(&target, &columns.collect::<Vec<_>>())?.into_iter();
            counts.iter().map(|count| weights.by_ref().take(*count).collect()).collect()
        } else {
            let delays =
                |(signal, count): (&Vec<f64>, &usize)| Delays { signal: signal.clone(), count: *count };
            closest(&target, &self.responses.iter().zip(counts).map(delays).collect::<Vec<_>>())?
        };
        let mut head = values[..length].to_vec();
        for (weights, response) in weights.iter().zip(&self.responses) {
            add_filtered(&mut head, &(0..length), weights, &fitted(response), 0);
        }
        Ok(head)
    }
}

/// Which run has which initial conditions.
struct Completed {
    run: usize,
    /// Its first values with them; the others are as they were.
    head: Vec<f64>,
    /// The samples over which they were estimated, how many these are, and how many initial conditions.
    measured: Vec<Range<usize>>,
    samples: usize,
    unknown: usize,
}

impl Completed {
    fn rows(&self) -> impl Iterator<Item = usize> {
        self.measured.iter().cloned().flatten()
    }
}
