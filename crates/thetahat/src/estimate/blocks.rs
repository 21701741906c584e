//! Models in blocks: linear systems and static curves, for the least errors of the free run.
//!
//! ```text
//! Hammerstein          y = G(q) f(u)                     a valve, a pump, a heater that switches
//! Wiener               y = f(G(q) u)                     a sensor
//! Wiener-Hammerstein   y = G2(q) f(G1(q) u)              an amplifier between two filters
//! feedback             y = G(q) [u; w],  w = f(z)        a spring, friction, an outflow; z is y, or any sum of states
//!                                                        and inputs
//! ```
//!
//! (Giri and Bai, Block-oriented Nonlinear System Identification, 2010, chapters 1 to 3; Schoukens and Toth 2020 for
//! the last.) The linear systems are in observer form, so that each has one parametrization only; where curves and
//! systems could share a gain, that of the systems at rest is 1, and the curve is what is measured at rest.
//!
//! **Start.** The best linear approximation of the log, an output-error fit, with a straight line for the curve, or
//! none in the feedback (Schoukens and Tiels 2017, Identification of block-oriented nonlinear systems starting from
//! linear approximations: a survey, Automatica 85). Between two filters all shares of its poles are tried. From there
//! all numbers move together, by exact derivatives of the free run.
//!
//! **Choice.** Delays, and the numbers of knots and states are those of the least MDL, on the first rows of a long log;
//! of states there are fewer where that costs next to nothing.

mod curve;
mod free_run;
mod linear_start;
mod machine;
mod shape;
#[cfg(test)]
mod tests;
mod text;

use std::ops::Range;

use thetahat_numerics::optimize::{Deadline, Monitor, Objective, Search, search};

use crate::Error;
use crate::data::Record;
use free_run::{FreeRunErrors, measured};
use linear_start::Linear;
use machine::{Machine, Run};
use shape::Shape;

/// How linear systems and curves follow one another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BlockStructure {
    /// A curve of each input, then a linear system.
    Hammerstein,
    /// A linear system, then a curve.
    Wiener,
    /// A curve between two linear systems.
    WienerHammerstein,
    /// A linear system around a curve.
    Feedback,
}

/// The form of static curves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CurveForm {
    /// Straight lines between so many knots; as the data choose where no number is given.
    Lines(Option<usize>),
    /// A polynomial of this degree.
    Polynomial(usize),
}

/// What of a model in blocks is said, and how to search.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct BlocksOptions {
    pub(crate) structure: BlockStructure,
    /// States: those that are tried, the first and the last.
    pub(crate) orders: (usize, usize),
    /// Samples from each input to its first effect; none: those that the data choose.
    pub(crate) delays: Option<Vec<usize>>,
    pub(crate) curve: CurveForm,
    pub(crate) search: Search,
}

/// Rows that are compared on.
const COMPARED_ROWS: usize = 20_000;
/// Runs at most.
const MOST_RUNS: usize = 100;
/// Iterations before models are compared.
const COMPARED_ITERATIONS: usize = 30;
/// Delays that are tried from far to near.
const DELAYS: [usize; 10] = [0, 2, 3, 4, 6, 9, 13, 18, 25, 35];
/// Fewer states do, and the output for the argument of a curve in a feedback, if with them the mean of e^2 is larger by
/// less than this part.
const SLIGHT: f64 = 0.1;
/// Knots at first, and at most.
const KNOTS: usize = 7;
const MOST_KNOTS: usize = 49;

/// A model with its numbers.
#[derive(Debug, Clone)]
struct Trained {
    shape: Shape,
    machine: Machine,
    /// The parameters.
    theta: Vec<f64>,
    /// x(0) of each run.
    starts: Vec<f64>,
    /// The sum of squared errors.
    cost: f64,
    samples: usize,
    /// The samples that would say as much if errors were white.
    effective: f64,
}

impl Trained {
    /// For errors like a(k) = r a(k-1) + white noise (Bayley and Hammersley, The effective number of independent
    /// observations in an autocorrelated time series, 1946): N (1 - r)/(1 + r) samples.
    fn mdl(&self, n: f64) -> f64 {
        n * (self.cost.max(f64::MIN_POSITIVE) / self.samples as f64).ln() + self.theta.len() as f64 * n.ln()
    }

    /// What it says of these runs, if it does not grow without end.
    fn walk(&self, runs: &[Run], mut seen: impl FnMut(&[f64], &[f64])) {
        for (run, start) in runs.iter().zip(self.starts.chunks(self.machine.states)) {
            self.machine.run(&self.theta, start, run, |_, state, z, _| seen(state, z));
        }
    }
}

/// Trains a model in blocks and writes it as [equations](crate::model::GreyBox): the text, which begins at the numbers
/// that were found. `record` may miss outputs.
///
/// # Errors
/// [`Error::Undetermined`] if no linear model explains anything of the log, or a channel does not move;
/// [`Error::Interrupted`] if the monitor says so.
pub(crate) fn blocks(
    (record, inputs, output): (&Record<'_>, &[String], &str),
    sample_time: f64,
    options: &BlocksOptions,
    monitor: Monitor<'_>,
) -> Result<String, Error> {
    let work = Work::new(record, inputs, output, options, monitor)?;
    let chosen = work.chosen()?;
    let whole = Work { rows: usize::MAX, ..work };
    let found = whole.improved(&chosen, options.search.max_iterations)?.unwrap_or(chosen);
    let runs = whole.runs(&found.shape);
    Ok(text::written(&found, &runs, (inputs, output), (&whole.offsets, sample_time)))
}

/// A number for each signal.
#[derive(Debug, Clone)]
struct Levels {
    inputs: Vec<f64>,
    output: f64,
}

/// A log and what is wanted of it.
struct Work<'a> {
    record: &'a Record<'a>,
    options: &'a BlocksOptions,
    /// What is subtracted from inputs and output.
    offsets: Levels,
    means: Levels,
    /// How many rows of the log count.
    rows: usize,
    deadline: Deadline,
    monitor: Monitor<'a>,
}

impl<'a> Work<'a> {
    fn new(
        record: &'a Record<'a>,
        inputs: &[String],
        output: &str,
        options: &'a BlocksOptions,
        monitor: Monitor<'a>,
    ) -> Result<Self, Error> {
        let mean = |name: &str, signal: &[f64]| {
            let values = record.segments.iter().flat_map(|rows| &signal[rows.clone()]);
            let values: Vec<f64> = values.copied().filter(|value| value.is_finite()).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            if values.iter().all(|value| Some(value) == values.first()) {
                let message = format!("'{name}' does not move in these rows: nothing can be said about it");
                return Err(Error::undetermined(Vec::new(), message));
            }
            Ok(mean)
        };
        let of_inputs = inputs.iter().zip(&record.inputs).map(|(name, signal)| mean(name, signal));
        let means =
            Levels { inputs: of_inputs.collect::<Result<_, _>>()?, output: mean(output, record.output)? };
        let offsets = match options.structure {
            BlockStructure::Feedback => Levels {
                inputs: means.inputs.iter().map(|mean| rounded(*mean)).collect(),
                output: rounded(means.output),
            },
            _ => Levels { inputs: vec![0.0; means.inputs.len()], output: 0.0 },
        };
        let deadline = Deadline::after(options.search.time_limit);
        Ok(Self { record, options, offsets, means, rows: COMPARED_ROWS, deadline, monitor })
    }

    /// The runs that a model of these delays sees.
    fn runs(&self, shape: &Shape) -> Vec<Run> {
        // Each has a state of its own to find: of very many the longest do.
        let mut segments: Vec<&Range<usize>> = self.record.segments.iter().collect();
        segments.sort_by_key(|segment| std::cmp::Reverse(segment.len()));
        segments.truncate(MOST_RUNS);
        segments.sort_by_key(|segment| segment.start);
        let mut left = self.rows;
        let mut runs = Vec::new();
        for segment in segments {
            let rows = segment.start..segment.end.min(segment.start.saturating_add(left));
            left -= rows.len();
            if rows.is_empty() {
                break;
            }
            let mut inputs = Vec::with_capacity(rows.len() * shape.delays.len());
            for row in rows.clone() {
                for (index, (signal, delay)) in self.record.inputs.iter().zip(&shape.delays).enumerate() {
                    let late = row.saturating_sub(delay.saturating_sub(1)).max(segment.start);
                    inputs.push(signal[late] - self.offsets.inputs[index]);
                }
            }
            let output = self.record.output[rows].iter().map(|value| value - self.offsets.output).collect();
            runs.push(Run { inputs, output });
        }
        runs
    }

    /// The least errors from some numbers on; none where the model grows without end there.
    fn trained(
        &self,
        shape: &Shape,
        machine: Machine,
        runs: &[Run],
        (mut theta, starts): (Vec<f64>, Vec<f64>),
        iterations: usize,
    ) -> Result<Option<Trained>, Error> {
        let shared = theta.len();
        theta.extend(starts);
        let mut errors = FreeRunErrors::new(&machine, runs);
        let options = Search { max_iterations: iterations, starts: 0, ..self.options.search.clone() };
        let Ok(found) = search(&mut errors, &theta, &options, 0.0, self.deadline, self.monitor)? else {
            return Ok(None);
        };
        let may_grow = shape.structure == BlockStructure::Feedback;
        if !may_grow && !machine.is_stable(&found.parameters, measured(runs)) {
            return Ok(None);
        }
        let (cost, samples) = (found.cost(), errors.samples());
        let mut theta = found.parameters;
        let starts = theta.split_off(shared);
        let correlation = correlation(&machine, &theta, &starts, runs).clamp(0.0, 0.999);
        let effective = (samples as f64 * (1.0 - correlation) / (1.0 + correlation)).max(2.0);
        Ok(Some(Trained { shape: shape.clone(), machine, theta, starts, cost, samples, effective }))
    }

    /// A model of this shape, from the best linear approximation on.
    fn started(&self, shape: &Shape) -> Result<Option<Trained>, Error> {
        let Some(linear) = Linear::found(self.record, &self.means, (shape.order, &shape.delays), self.rows)?
        else {
            return Ok(None);
        };
        let runs = self.runs(shape);
        let mut best: Option<Trained> = None;
        for start in shape.starts(&linear, &runs, (&self.means, &self.offsets)) {
            let rest = vec![0.0; start.machine.states * runs.len()];
            let found =
                self.trained(shape, start.machine, &runs, (start.theta, rest), COMPARED_ITERATIONS)?;
            best = better(best, found);
        }
        Ok(best)
    }

    /// A model that was trained, trained on.
    fn improved(&self, from: &Trained, iterations: usize) -> Result<Option<Trained>, Error> {
        let runs = self.runs(&from.shape);
        let n = from.machine.states;
        // Further runs begin at rest.
        let mut starts = from.starts.clone();
        starts.resize(n * runs.len(), 0.0);
        self.trained(&from.shape, from.machine.clone(), &runs, (from.theta.clone(), starts), iterations)
    }

    /// The model of the least MDL.
    fn chosen(&self) -> Result<Trained, Error> {
        let (first, last) = self.options.orders;
        let inputs = self.record.inputs.len();
        let size = match self.options.curve {
            CurveForm::Lines(knots) => knots.unwrap_or(KNOTS),
            CurveForm::Polynomial(degree) => degree,
        };
        let middle = 2.clamp(first, last);
        let delays = self.options.delays.clone().unwrap_or(vec![1; inputs]);
        let shape = |order: usize, delays: &[usize]| Shape {
            structure: self.options.structure,
            order,
            delays: delays.to_vec(),
            form: self.options.curve,
            size,
            is_general: false,
        };
        let mut best = self.started(&shape(middle, &delays))?;
        let is_open = self.options.delays.is_none();
        for input in (0..inputs).filter(|_| is_open) {
            for delay in DELAYS {
                let mut delays = best.as_ref().map_or(&delays, |best| &best.shape.delays).clone();
                delays[input] = delay;
                best = better(best, self.started(&shape(middle, &delays))?);
            }
        }
        let best = self.nearer(best, is_open)?.map(|best| self.refined(best, is_open)).transpose()?;
        let mut all: Vec<Trained> = best.into_iter().collect();
        for order in (first..=last).filter(|order| *order != middle) {
            let Some(own) = all.first() else { break };
            let shape = Shape { order, size: own.shape.size, ..shape(order, &own.shape.delays) };
            let other = self.nearer(self.started(&shape)?, is_open)?;
            all.extend(other.map(|other| self.refined(other, is_open)).transpose()?);
        }
        // What the log leaves open is no choice, unless nothing else is there.
        let (determined, open): (Vec<_>, Vec<_>) = all.into_iter().partition(|own| self.is_determined(own));
        let mut all = if determined.is_empty() { open } else { determined };
        let best = all.iter().cloned().map(Some).fold(None, better);
        let least = best.map_or(0.0, |best| best.cost / best.samples as f64);
        all.sort_by_key(|own| own.shape.order);
        let chosen = all.into_iter().find(|own| own.cost / own.samples as f64 * (1.0 - SLIGHT) <= least);
        chosen.ok_or_else(|| {
            let message = "no linear model follows the output at all, and that is where a model in blocks begins: is the output \
                           driven by these inputs?";
            Error::undetermined(Vec::new(), message)
        })
    }

    /// With knots over what its curves see, more of them where their number is open, and the delays of that.
    fn refined(&self, from: Trained, is_open: bool) -> Result<Trained, Error> {
        let mut best = from;
        if best.shape.structure == BlockStructure::Feedback {
            let general = self.started(&Shape { is_general: true, ..best.shape.clone() })?;
            return Ok(general.filter(|general| general.cost < best.cost * (1.0 - SLIGHT)).unwrap_or(best));
        }
        if let (CurveForm::Lines(_), BlockStructure::Wiener | BlockStructure::WienerHammerstein) =
            (self.options.curve, self.options.structure)
        {
            // What a curve sees moves with the system before it.
            for _ in 0..2 {
                best = self.with_knots(&best, best.shape.size)?.unwrap_or(best);
            }
        }
        while self.options.curve == CurveForm::Lines(None) && best.shape.size < MOST_KNOTS {
            match self.with_knots(&best, 2 * best.shape.size - 1)?.filter(|finer| is_better(finer, &best)) {
                Some(finer) => best = finer,
                None => break,
            }
        }
        // A better curve may say another delay.
        let near = self.nearer(Some(best.clone()), is_open)?;
        Ok(near.unwrap_or(best))
    }

    /// Whether the log says all its parameters, but for the scales that are shared.
    fn is_determined(&self, own: &Trained) -> bool {
        let runs = self.runs(&own.shape);
        let theta = [&own.theta[..], &own.starts].concat();
        FreeRunErrors::new(&own.machine, &runs).open_directions(&theta) <= own.shape.shared_scales()
    }

    /// With delays a sample shorter or longer, as long as that is better.
    fn nearer(&self, from: Option<Trained>, is_open: bool) -> Result<Option<Trained>, Error> {
        let mut best = from;
        for input in (0..self.record.inputs.len()).filter(|_| is_open) {
            for longer in [false, true] {
                while let Some(own) = &best {
                    let mut shape = own.shape.clone();
                    let delay = shape.delays[input];
                    let Some(next) = (if longer { delay.checked_add(1) } else { delay.checked_sub(1) })
                    else {
                        break;
                    };
                    shape.delays[input] = next;
                    let other = self.started(&shape)?;
                    if !other.as_ref().is_some_and(|other| is_better(other, own)) {
                        break;
                    }
                    best = other;
                }
            }
        }
        Ok(best)
    }

    /// The same with up to so many knots over what its curves see, from these curves on; none where there are no
    /// more places for knots than it has.
    fn with_knots(&self, from: &Trained, size: usize) -> Result<Option<Trained>, Error> {
        let runs = self.runs(&from.shape);
        let shape = Shape { size, ..from.shape.clone() };
        let mut seen = vec![Vec::new(); from.machine.curves.len()];
        from.walk(&runs, |_, z| seen.iter_mut().zip(z).for_each(|(seen, z)| seen.push(*z)));
        let Some(curves) = shape.curves(seen) else { return Ok(None) };
        let is_more = curves.iter().zip(&from.machine.curves).any(|(own, other)| own.size() > other.size());
        if size > from.shape.size && !is_more {
            return Ok(None);
        }
        let mut theta = from.theta[..from.machine.places.len()].to_vec();
        for (index, (curve, old)) in curves.iter().zip(&from.machine.curves).enumerate() {
            let numbers = &from.theta[from.machine.numbers(index)];
            theta.extend(curve.like(|z| old.evaluate(z, numbers, &mut curve::Basis::new()).0));
        }
        let machine = Machine { curves, ..from.machine.clone() };
        self.trained(&shape, machine, &runs, (theta, from.starts.clone()), COMPARED_ITERATIONS)
    }
}

/// The correlation of errors of rows beside one another.
fn correlation(machine: &Machine, theta: &[f64], starts: &[f64], runs: &[Run]) -> f64 {
    let (mut squares, mut products) = (0.0, 0.0);
    for (run, start) in runs.iter().zip(starts.chunks(machine.states)) {
        let mut before = f64::NAN;
        machine.run(theta, start, run, |row, _, _, y| {
            let error = run.output[row] - y;
            if before.is_finite() && error.is_finite() {
                squares += (error * error + before * before) / 2.0;
                products += error * before;
            }
            before = error;
        });
    }
    if squares > 0.0 { products / squares } else { 0.0 }
}

/// Whether one has the smaller MDL, with as many samples as the whiter errors say: what is left in the others is no
/// noise.
fn is_better(one: &Trained, than: &Trained) -> bool {
    let samples = one.effective.max(than.effective);
    one.mdl(samples) < than.mdl(samples)
}

/// The one of the smaller MDL.
fn better(one: Option<Trained>, other: Option<Trained>) -> Option<Trained> {
    match (one, other) {
        (Some(one), Some(other)) => Some(if is_better(&other, &one) { other } else { one }),
        (one, other) => one.or(other),
    }
}

/// A number with six digits, for a text.
fn rounded(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value) + 0.0
}
