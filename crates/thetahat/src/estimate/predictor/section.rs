//! One segment of a record: its filtered signals and its part of the normal equations.

use std::ops::Range;

use thetahat_core::nalgebra::DMatrix;
use thetahat_numerics::optimize::normal;
use thetahat_numerics::regression::{
    Interior, add_filtered, add_scaled, divide, divide_together, product, sum_of_squares,
};

use super::{Column, Layout, loss};
use crate::data::Record;
use crate::estimate::polynomials::Polynomials;

/// The fraction of an initial-condition response, squared, below which its remainder is rounding.
const RESPONSE_ROUNDING: f64 = 1e-22;
/// The fraction of its largest value below which a response has died away.
const NEGLIGIBLE: f64 = 1e-20;
/// Samples of a response that are computed at first.
const FIRST_PIECE: usize = 256;

/// One segment and what is known before it: its signals, and its part of the normal equations.
#[derive(Debug)]
pub(super) struct Section<'a> {
    /// Which layout it has.
    pub(super) layout: usize,
    /// The sample of the record that it begins with.
    pub(super) first: usize,
    /// The samples that count.
    pub(super) runs: Vec<Range<usize>>,
    pub(super) output: &'a [f64],
    pub(super) inputs: Vec<&'a [f64]>,
    /// The filtered signals, e first.
    pub(super) signals: Vec<Vec<f64>>,
    /// From which sample on each is zero: responses to impulses die away.
    pub(super) supports: Vec<usize>,
    /// x_j of the inputs with F.
    pub(super) responses: Vec<Vec<f64>>,
    /// w, where there is D.
    pub(super) disturbance: Vec<f64>,
    pub(super) scratch: Vec<f64>,
    /// What the mask cuts off each signal, r values each.
    pub(super) heads: Vec<f64>,
    /// For all parameters, and for those that errors are linear in.
    pub(super) interiors: [Interior; 2],
    pub(super) entries: Vec<f64>,
    /// The Gram matrix of the parameters' and initial-condition responses' columns, row by row, and psi'e.
    pub(super) gram: Vec<f64>,
    pub(super) right: Vec<f64>,
    pub(super) corrections: Vec<f64>,
    /// The weights of the initial-condition responses, and those of a trial.
    pub(super) free: Vec<f64>,
    pub(super) trial: Vec<f64>,
    /// The factor of the initial-condition responses' block, and the step to their optimum: for no change of parameters
    /// first, then for each parameter.
    pub(super) free_factor: Vec<f64>,
    pub(super) free_steps: Vec<f64>,
    /// For each initial-condition response, the sum of squares below which what D, C and the mask leave of it is
    /// rounding.
    pub(super) free_floors: Vec<f64>,
    /// Initial-condition responses that begin before the samples that count, and how far each is known; what follows is
    /// nothing.
    faded: Vec<f64>,
    faded_lengths: Vec<usize>,
    /// The response of 1/F_j to an impulse, for each input with such initial conditions.
    faded_responses: Vec<Vec<f64>>,
    pub(super) cost: f64,
    /// By how much the initial-condition responses alone can lower the cost.
    pub(super) free_gain: f64,
}

impl<'a> Section<'a> {
    /// The samples `rows` of a record, of which the `runs` count.
    pub(super) fn new(
        record: &Record<'a>,
        rows: &Range<usize>,
        runs: Vec<Range<usize>>,
        layout: &Layout,
        index: usize,
    ) -> Self {
        let length = rows.len();
        let used = |signal: usize| {
            signal == 0 || layout.taps.iter().any(|taps| taps.signal == signal && taps.count > 0)
        };
        // Written when it is known what: a predictor may serve one question, and zeros first would be a tenth of its
        // time.
        let buffer = |used: bool| Vec::with_capacity(if used { length } else { 0 });
        let signal = |signal: usize| {
            // Behind an impulse response is nothing.
            let responds = signal == layout.impulse || layout.frees.contains(&signal);
            if responds && used(signal) { vec![0.0; length] } else { buffer(used(signal)) }
        };
        let (parameters, free) = (layout.parameters, layout.free);
        let columns = parameters + free;
        let size = layout.products.size();
        let counted = runs.iter().map(|run| (layout.conditioned, run.clone()));
        Self {
            layout: index,
            first: rows.start,
            output: &record.output[rows.clone()],
            inputs: record.inputs.iter().map(|input| &input[rows.clone()]).collect(),
            signals: (0..layout.signals).map(signal).collect(),
            supports: vec![usize::MAX; layout.signals],
            responses: layout.orders.nf.iter().map(|&nf| buffer(nf > 0)).collect(),
            disturbance: buffer(layout.orders.nd > 0),
            scratch: buffer(layout.orders.nd > 0),
            heads: vec![0.0; layout.signals * layout.conditioned],
            interiors: [layout, layout.linear()].map(|layout| layout.products.interior(counted.clone())),
            entries: vec![0.0; size * size],
            gram: vec![0.0; columns * columns],
            right: vec![0.0; columns],
            corrections: vec![0.0; columns * (layout.columns.len() - columns)],
            free: vec![0.0; free],
            trial: vec![0.0; free],
            free_factor: vec![0.0; free * free],
            free_steps: vec![0.0; free * (parameters + 1)],
            free_floors: vec![0.0; free],
            faded: if layout.faded { vec![0.0; free * length] } else { Vec::new() },
            faded_lengths: vec![0; free],
            faded_responses: layout.orders.nf.iter().map(|&nf| buffer(layout.faded && nf > 0)).collect(),
            cost: 0.0,
            free_gain: 0.0,
            runs,
        }
    }

    /// From the first to the last sample that counts.
    pub(super) fn span(&self) -> Range<usize> {
        let ends = self.runs.first().zip(self.runs.last());
        ends.map_or(0..0, |(first, last)| first.start..last.end)
    }

    /// The errors of polynomials with the trial weights that are best for them, and their sum of squares.
    ///
    /// For initial-condition responses that begin before the samples that count: a small change of F changes a faded
    /// response many times over, which no step of the weights to first order follows.
    pub(super) fn project(&mut self, layout: &Layout, polynomials: &Polynomials, negative: &[Vec<f64>]) {
        self.trial.fill(0.0);
        self.evaluate(layout, polynomials, negative);
        let free = layout.free;
        let length = self.output.len();
        let gain: f64 = polynomials.d.iter().map(|d| d.abs()).sum();
        let mut own = 0;
        for (j, &order) in layout.orders.nf.iter().enumerate() {
            let count = layout.own_free[j];
            if count == 0 {
                continue;
            }
            // That of an impulse one sample later is the same one sample later, up to the mask.
            let (columns, response) =
                (&mut self.faded[own * length..][..count * length], &mut self.faded_responses[j]);
            let memory = 1 + order + layout.orders.nc + layout.orders.nd;
            let mut known = (FIRST_PIECE + layout.counted + 2 * memory).min(length);
            let size = loop {
                response.clear();
                response.resize(known - layout.origin, 0.0);
                response[0] = 1.0;
                divide(&polynomials.f[j], response);
                let masked = if layout.orders.nd > 0 {
                    multiply(&mut self.scratch, &polynomials.d, response);
                    &self.scratch
                } else {
                    &*response
                };
                for (delay, column) in columns.chunks_exact_mut(length).enumerate() {
                    let (head, tail) = column[..known].split_at_mut(layout.origin + delay);
                    head.fill(0.0);
                    tail.copy_from_slice(&masked[..tail.len()]);
                    column[..layout.conditioned].fill(0.0);
                }
                let mut rest = columns.chunks_exact_mut(length).map(|c| &mut c[layout.conditioned..known]);
                while let Some(one) = rest.next() {
                    match rest.next() {
                        Some(other) => divide_together(&polynomials.c, [one, other]),
                        None => divide(&polynomials.c, one),
                    }
                }
                let quiet = |column: &[f64]| is_quiet(&column[..known], memory);
                if known == length || columns.chunks_exact(length).all(quiet) {
                    break sum_of_squares(response);
                }
                known = (4 * known).min(length);
            };
            self.faded_lengths[own..own + count].fill(known);
            self.free_floors[own..own + count].fill(RESPONSE_ROUNDING * gain * gain * size);
            own += count;
        }
        let counted = |column: usize, known: usize| &self.faded[column * length..][layout.counted..known];
        for row in 0..free {
            let known = self.faded_lengths[row];
            self.trial[row] = product(counted(row, known), &self.signals[0][layout.counted..known]);
            for column in 0..=row {
                let known = known.min(self.faded_lengths[column]);
                let value = product(counted(row, known), counted(column, known));
                let seen = row != column || value > self.free_floors[row];
                self.free_factor[row * free + column] = if seen { value } else { 0.0 };
            }
        }
        normal::factor(&mut self.free_factor, free);
        normal::solve(&self.free_factor, free, &mut self.trial);
        self.add_faded(layout);
    }

    /// Adds the initial-condition responses with the trial weights to what was evaluated without them.
    fn add_faded(&mut self, layout: &Layout) {
        let length = self.output.len();
        let mut own = 0;
        for (j, &count) in layout.own_free.iter().enumerate() {
            for delay in 0..count {
                let (weight, known) = (self.trial[own], self.faded_lengths[own]);
                let rows = layout.origin + delay..known;
                let response = &self.faded_responses[j][..rows.len()];
                add_scaled(&mut self.responses[j][rows.clone()], weight, response);
                if layout.orders.nd > 0 {
                    add_scaled(&mut self.disturbance[rows], -weight, response);
                }
                let rows = layout.conditioned..known;
                let column = &self.faded[own * length..][rows.clone()];
                add_scaled(&mut self.signals[0][rows], -weight, column);
                own += 1;
            }
        }
        self.cost = self.squares(layout);
    }

    /// The errors of polynomials and of the trial weights, and their sum of squares.
    pub(super) fn evaluate(&mut self, layout: &Layout, polynomials: &Polynomials, negative: &[Vec<f64>]) {
        let (error, _) = self.signals.split_at_mut(1);
        let error = &mut error[0];
        // Without D, w is made where e will be.
        let has_noise_denominator = layout.orders.nd > 0;
        let w = if has_noise_denominator { &mut self.disturbance } else { &mut *error };
        multiply(w, &polynomials.a, self.output);
        let mut free = self.trial.as_slice();
        for (j, u) in self.inputs.iter().enumerate() {
            if layout.orders.nf[j] == 0 {
                delayed(w, layout.orders.nk[j], &negative[j], u);
                continue;
            }
            let x = &mut self.responses[j];
            x.clear();
            x.resize(self.output.len(), 0.0);
            delayed(x, layout.orders.nk[j], &polynomials.b[j], u);
            let (weights, rest) = free.split_at(layout.own_free[j]);
            free = rest;
            x.iter_mut().skip(layout.origin).zip(weights).for_each(|(x, weight)| *x += weight);
            divide(&polynomials.f[j], x);
            w.iter_mut().zip(&*x).for_each(|(w, x)| *w -= x);
        }
        if has_noise_denominator {
            multiply(error, &polynomials.d, &self.disturbance);
        }
        let (head, tail) = error.split_at_mut(layout.conditioned);
        head.fill(0.0);
        divide(&polynomials.c, tail);
        self.cost = self.squares(layout);
    }

    /// sum e^2, or sum rho(e).
    fn squares(&self, layout: &Layout) -> f64 {
        let each = self.runs.iter().map(|run| {
            let errors = &self.signals[0][run.clone()];
            layout.bound.map_or_else(|| sum_of_squares(errors), |bound| loss::cost(errors, bound))
        });
        each.sum()
    }

    /// psi's signals, their Gram matrix and psi'e, at what was evaluated last.
    pub(super) fn linearize(&mut self, layout: &Layout, polynomials: &Polynomials) {
        let orders = &layout.orders;
        if orders.na > 0 {
            self.output.clone_into(&mut self.signals[layout.output]);
        }
        for j in 0..orders.inputs() {
            if orders.nb[j] > 0 {
                self.inputs[j].clone_into(&mut self.signals[layout.inputs[j]]);
            }
            if orders.nf[j] > 0 {
                let two = [layout.inputs[j], layout.responses[j]];
                if let Ok([u, x]) = self.signals.get_disjoint_mut(two) {
                    if layout.uses(layout.responses[j]) {
                        x.clone_from(&self.responses[j]);
                        divide_together(&polynomials.f[j], [u, x]);
                    } else {
                        divide(&polynomials.f[j], u);
                    }
                }
            }
        }
        if layout.uses(layout.error) {
            let (error, others) = self.signals.split_at_mut(1);
            others[layout.error - 1].clone_from(&error[0]);
        }
        if orders.nd > 0 {
            for &signal in &layout.with_noise_denominator {
                multiply(&mut self.scratch, &polynomials.d, &self.signals[signal]);
                std::mem::swap(&mut self.scratch, &mut self.signals[signal]);
            }
            if layout.uses(layout.disturbance) {
                self.signals[layout.disturbance].clone_from(&self.disturbance);
            }
        }
        for &signal in &layout.filtered {
            let head = &mut self.signals[signal][..layout.conditioned];
            self.heads[signal * layout.conditioned..][..layout.conditioned].copy_from_slice(head);
            head.fill(0.0);
        }
        if orders.nc > 0 {
            divide_all(&polynomials.c, &mut self.signals, &layout.filtered, layout.conditioned);
        }
        if layout.free > 0 {
            let gain = polynomials.d.iter().map(|d| d.abs()).sum::<f64>();
            let mut next = 0;
            for j in (0..orders.inputs()).filter(|&j| layout.own_free[j] > 0) {
                let size = self.respond(layout, polynomials, layout.frees[j], Some(j));
                let own = next..next + layout.own_free[j];
                next = own.end;
                self.free_floors[own].fill(RESPONSE_ROUNDING * gain * gain * size);
            }
        }
        if layout.uses(layout.impulse) {
            self.respond(layout, polynomials, layout.impulse, None);
        }
        self.add_up(layout);
        if let Some(bound) = layout.bound {
            self.weigh(layout, bound);
        }
        self.eliminate(layout);
    }

    /// The response of (D/(C F_j)) to an impulse where initial-condition responses begin, or of 1/C to one at the first
    /// that counts, until it has died away. Gives the sum of squares of what 1/F_j alone makes of it.
    fn respond(
        &mut self,
        layout: &Layout,
        polynomials: &Polynomials,
        signal: usize,
        input: Option<usize>,
    ) -> f64 {
        let (values, conditioned) = (&mut self.signals[signal], layout.conditioned);
        let orders = &layout.orders;
        let memory = 1 + orders.nc + orders.nd + input.map_or(0, |input| orders.nf[input]);
        let first = if input.is_some() { layout.origin } else { conditioned };
        let mut known = (FIRST_PIECE + conditioned.max(first) + 2 * memory).min(values.len());
        let size = loop {
            let piece = &mut values[..known];
            piece.fill(0.0);
            piece[first] = 1.0;
            let mut size = 1.0;
            if let Some(input) = input {
                divide(&polynomials.f[input], piece);
                size = sum_of_squares(piece);
                if orders.nd > 0 {
                    multiply(&mut self.scratch, &polynomials.d, piece);
                    piece.copy_from_slice(&self.scratch);
                }
                let (head, _) = piece.split_at_mut(conditioned);
                self.heads[signal * conditioned..][..conditioned].copy_from_slice(head);
                head.fill(0.0);
            }
            divide(&polynomials.c, &mut piece[conditioned..]);
            let quiet = is_quiet(piece, memory);
            if quiet || known == values.len() {
                break size;
            }
            known = (4 * known).min(values.len());
        };
        // What an earlier response left behind this one.
        let before = self.supports[signal].min(values.len()).max(known);
        values[known..before].fill(0.0);
        self.supports[signal] = known;
        size
    }

    /// The Gram matrix of the columns and psi'e.
    fn add_up(&mut self, layout: &Layout) {
        let (products, conditioned) = (&layout.products, layout.conditioned);
        let size = products.size();
        let entries = &mut self.entries[..size * size];
        entries.fill(0.0);
        for run in &self.runs {
            products.add_ends(&self.signals, conditioned, run, entries);
        }
        let interior = &mut self.interiors[usize::from(layout.linear.is_none())];
        products.add_interior(&self.signals, &self.supports, interior, entries);
        let entries = &self.entries[..size * size];
        let entry = |a: &Column, b: &Column| {
            let (low, high) = (a.position.min(b.position), a.position.max(b.position));
            a.sign * b.sign * entries[low * size + high]
        };
        let error = Column { signal: 0, position: products.position(0, 0), lag: 0, sign: 1.0 };
        let count = layout.parameters + layout.free;
        let (columns, shifts) = layout.columns.split_at(count);
        for (row, column) in columns.iter().enumerate() {
            self.right[row] = entry(column, &error);
            for (place, other) in self.gram[row * count..][..=row].iter_mut().zip(columns) {
                *place = entry(column, other);
            }
        }
        if !shifts.is_empty() {
            let width = shifts.len();
            for (weights, column) in self.corrections.chunks_exact_mut(width).zip(columns) {
                let head = &self.heads[column.signal * conditioned..][..conditioned];
                for (k, weight) in weights.iter_mut().enumerate() {
                    // z(r + k - i), zero before the segment.
                    let from = (conditioned + k).checked_sub(column.lag).filter(|_| k < column.lag);
                    *weight = from.map_or(0.0, |from| column.sign * head[from]);
                }
            }
            for row in 0..count {
                let weights = &self.corrections[row * width..][..width];
                let with_error =
                    shifts.iter().zip(weights).map(|(shift, weight)| weight * entry(shift, &error));
                self.right[row] += with_error.sum::<f64>();
                for column in 0..=row {
                    let others = &self.corrections[column * width..][..width];
                    let mut more = 0.0;
                    for (k, shift) in shifts.iter().enumerate() {
                        let squares =
                            shifts.iter().zip(others).map(|(other, weight)| weight * entry(shift, other));
                        more += weights[k] * (entry(shift, &columns[column]) + squares.sum::<f64>())
                            + others[k] * entry(shift, &columns[row]);
                    }
                    self.gram[row * count + column] += more;
                }
            }
        }
        for row in 0..count {
            for column in 0..row {
                self.gram[column * count + row] = self.gram[row * count + column];
            }
        }
    }

    /// Prepares the step of the initial-condition responses that is best for any change of the parameters.
    fn eliminate(&mut self, layout: &Layout) {
        let (parameters, free) = (layout.parameters, layout.free);
        let count = parameters + free;
        for row in 0..free {
            let from = &self.gram[(parameters + row) * count + parameters..][..free];
            let to = &mut self.free_factor[row * free..][..free];
            to.copy_from_slice(from);
            if to[row] <= self.free_floors[row] {
                // A dependent column: its weight stays.
                to[row] = 0.0;
            }
        }
        normal::factor(&mut self.free_factor, free);
        let all = self.free_steps.chunks_exact_mut(free.max(1)).take(1 + parameters);
        for (which, steps) in all.enumerate() {
            if which == 0 {
                steps.copy_from_slice(&self.right[parameters..count]);
            } else {
                steps.copy_from_slice(&self.gram[(which - 1) * count + parameters..][..free]);
            }
            normal::solve(&self.free_factor, free, steps);
        }
        let best = &self.free_steps[..free];
        self.free_gain =
            best.iter().zip(&self.right[parameters..count]).map(|(step, right)| step * right).sum();
    }

    /// A sample of a column: first of those of the initial-condition responses, then of those of psi, and e last.
    pub(super) fn sensitivity(&self, layout: &Layout, row: usize, column: usize) -> f64 {
        let (parameters, free) = (layout.parameters, layout.free);
        let (columns, shifts) = layout.columns.split_at(parameters + free);
        if column == columns.len() {
            return self.signals[0][row];
        }
        let index = if column < free { parameters + column } else { column - free };
        let Column { signal, lag, sign, .. } = columns[index];
        let at = |signal: usize, lag: usize| if row < lag { 0.0 } else { self.signals[signal][row - lag] };
        let weights = &self.corrections[index * shifts.len()..][..shifts.len()];
        let corrections =
            shifts.iter().zip(weights).map(|(shift, weight)| weight * at(shift.signal, shift.lag));
        sign * at(signal, lag) + corrections.sum::<f64>()
    }

    /// What makes psi without the initial-condition responses of psi and of these.
    pub(super) fn without_free(&self, parameters: usize, free: usize) -> DMatrix<f64> {
        DMatrix::from_fn(parameters, parameters + free, |row, column| {
            if column >= parameters {
                -self.free_steps[(row + 1) * free + column - parameters]
            } else {
                f64::from(u8::from(row == column))
            }
        })
    }

    /// Adds the part of the normal equations that is left without the initial-condition responses.
    pub(super) fn add_normal(&self, layout: &Layout, matrix: &mut [f64], right: &mut [f64]) {
        let (parameters, free) = (layout.parameters, layout.free);
        let count = parameters + free;
        for row in 0..parameters {
            let cross = &self.gram[row * count + parameters..][..free];
            let taken =
                |steps: &[f64]| steps.iter().zip(cross).map(|(step, cross)| step * cross).sum::<f64>();
            right[row] += self.right[row] - taken(&self.free_steps[..free]);
            for column in 0..parameters {
                matrix[row * parameters + column] +=
                    self.gram[row * count + column] - taken(&self.free_steps[(column + 1) * free..][..free]);
            }
        }
    }

    /// Sets the trial weights to those that are best for a step of the parameters.
    pub(super) fn try_free(&mut self, step: &[f64]) {
        let free = self.free.len();
        for (index, trial) in self.trial.iter_mut().enumerate() {
            let moved: f64 =
                step.iter().enumerate().map(|(k, step)| step * self.free_steps[(k + 1) * free + index]).sum();
            *trial = self.free[index] + self.free_steps[index] - moved;
        }
    }
}

/// Whether the last values of a response are nothing beside the others.
fn is_quiet(values: &[f64], memory: usize) -> bool {
    let largest = |values: &[f64]| values.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    largest(&values[values.len().saturating_sub(memory)..]) <= NEGLIGIBLE * largest(values)
}

/// `target(t) += sum_i weights[i] u(t - delay - i)`.
fn delayed(target: &mut [f64], delay: usize, weights: &[f64], u: &[f64]) {
    let from = delay.min(target.len());
    let target = &mut target[from..];
    add_filtered(target, &(0..target.len()), weights, &u[..u.len() - from], 0);
}

/// Divides some of the signals from one sample on, four at a time.
fn divide_all(monic: &[f64], signals: &mut [Vec<f64>], which: &[usize], from: usize) {
    fn some<const K: usize>(monic: &[f64], signals: &mut [Vec<f64>], which: [usize; K], from: usize) {
        if let Ok(some) = signals.get_disjoint_mut(which) {
            divide_together(monic, some.map(|values| &mut values[from..]));
        }
    }
    for group in which.chunks(4) {
        match *group {
            [a, b, c, d] => some(monic, signals, [a, b, c, d], from),
            [a, b, c] => some(monic, signals, [a, b, c], from),
            [a, b] => some(monic, signals, [a, b], from),
            [a] => some(monic, signals, [a], from),
            _ => {}
        }
    }
}

/// `target = P values` for a monic P.
fn multiply(target: &mut Vec<f64>, monic: &[f64], values: &[f64]) {
    values.clone_into(target);
    delayed(target, 1, &monic[1..], values);
}
