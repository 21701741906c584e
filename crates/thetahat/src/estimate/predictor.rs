//! Prediction errors of the general family and the Gram matrix of their derivatives.
//!
//! ```text
//! e = (D/C) w,   w = A y - sum_j x_j,   x_j = (B_j/F_j) u_j
//! ```
//!
//! With psi = -de/dtheta, every derivative is a shifted copy of one of few filtered signals (Ljung, System
//! Identification, 2nd ed. 1999, section 10.3):
//!
//! ```text
//! a_i: -(D/C) q^-i y       b_ji: (D/(C F_j)) q^-i u_j       f_ji: -(D/(C F_j)) q^-i x_j
//! c_i:  (1/C) q^-i e       d_i: -(1/C) q^-i w
//! ```
//!
//! So an iteration filters once for each polynomial, and the Gram matrix of psi comes from lagged products of these
//! signals: O(N p), and no matrix of N rows.
//!
//! A segment starts with samples that nothing is known of. What they do to x_j is a combination of free responses
//! q^-i (1/F_j) delta, i = 0, 1, …, with weights that are estimated too, apart for each segment: they enter e linearly and are
//! eliminated from the normal equations. For the other polynomials v = D w is set to zero in the first r samples, which
//! do not count. Then psi is a shifted copy only up to what the mask cuts off. With z the signal before the mask and g the impulse
//! response of 1/C from sample r on,
//!
//! ```text
//! (1/C) mask(q^-i z) = q^-i (1/C) mask(z) + sum_{k < i} z(r + k - i) q^-k g,
//! ```
//!
//! so that shifts of g complete the Gram matrix exactly.

use std::ops::Range;

use rayon::prelude::*;
use thetahat_core::LeastSquares;
use thetahat_core::nalgebra::{DMatrix, Dyn};

use super::normal;
use super::uncertainty::backward_filtered_products;
use crate::Orders;
use crate::data::Record;
use crate::model::polynomial::is_stable;
use crate::regression::{
    Interior, Products, Taps, add_filtered, divide, divide_together, factor_rows, sum_of_squares,
};

/// The fraction of a free response, squared, below which what is left of it is rounding.
const UNSEEN: f64 = 1e-22;
/// The fraction of its largest value below which a response has died away.
const NEGLIGIBLE: f64 = 1e-20;
/// Samples of a response that are computed at first.
const FIRST_PIECE: usize = 256;
/// Samples from which threads pay for themselves.
const PARALLEL_FROM: usize = 1 << 15;

/// The polynomials of a parameter vector.
#[derive(Debug)]
pub(super) struct Polynomials {
    pub(super) a: Vec<f64>,
    /// Without the leading zeros.
    pub(super) b: Vec<Vec<f64>>,
    pub(super) c: Vec<f64>,
    pub(super) d: Vec<f64>,
    pub(super) f: Vec<Vec<f64>>,
}

impl Polynomials {
    pub(super) fn new(orders: &Orders, parameters: &[f64]) -> Self {
        let monic = |order: usize| [vec![1.0], vec![0.0; order]].concat();
        let mut polynomials = Self {
            a: monic(orders.na),
            b: orders.nb.iter().map(|&nb| vec![0.0; nb]).collect(),
            c: monic(orders.nc),
            d: monic(orders.nd),
            f: orders.nf.iter().map(|&nf| monic(nf)).collect(),
        };
        polynomials.set(parameters);
        polynomials
    }

    fn set(&mut self, mut parameters: &[f64]) {
        let mut fill = |values: &mut [f64]| {
            let (own, rest) = parameters.split_at(values.len());
            values.copy_from_slice(own);
            parameters = rest;
        };
        fill(&mut self.a[1..]);
        self.b.iter_mut().for_each(|b| fill(b));
        fill(&mut self.c[1..]);
        fill(&mut self.d[1..]);
        self.f.iter_mut().for_each(|f| fill(&mut f[1..]));
    }

    /// The parameters in their order.
    pub(super) fn parameters(&self) -> Vec<f64> {
        let mut parameters = self.a[1..].to_vec();
        self.b.iter().for_each(|b| parameters.extend(b));
        parameters.extend(&self.c[1..]);
        parameters.extend(&self.d[1..]);
        self.f.iter().for_each(|f| parameters.extend(&f[1..]));
        parameters
    }

    /// Whether the predictor is stable: C and every F are.
    fn are_stable(&self, scratch: &mut Vec<f64>) -> bool {
        is_stable(&self.c, scratch) && self.f.iter().all(|f| is_stable(f, scratch))
    }
}

/// Which signals there are, and which columns of psi are made of them.
#[derive(Debug)]
struct Layout {
    orders: Orders,
    /// Those of the parameters in their order, then of the free responses, then of g. Signal 0 is e.
    taps: Vec<Taps>,
    /// Signal, position among the products, lag and sign, one for each column.
    columns: Vec<Column>,
    products: Products,
    parameters: usize,
    free: usize,
    /// r, the first samples that do not count.
    masked: usize,
    output: usize,
    inputs: Vec<usize>,
    error: usize,
    disturbance: usize,
    responses: Vec<usize>,
    frees: Vec<usize>,
    impulse: usize,
    signals: usize,
    /// The signals that are divided by C, and those of them that are multiplied by D.
    filtered: Vec<usize>,
    with_noise_denominator: Vec<usize>,
}

#[derive(Debug, Clone, Copy)]
struct Column {
    signal: usize,
    position: usize,
    lag: usize,
    sign: f64,
}

/// How a segment starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Begin {
    /// All earlier samples are zero, and all samples count.
    Zero,
    /// Nothing is known of earlier samples.
    Unknown,
}

impl Layout {
    fn new(orders: &Orders, begin: Begin) -> Self {
        let inputs = orders.inputs();
        let unknown = begin == Begin::Unknown;
        let masked = if unknown { orders.conditioned() } else { 0 };
        let free = |input: usize| if unknown { orders.free_responses(input) } else { 0 };
        let mut signals = 1;
        let mut next = || {
            signals += 1;
            signals - 1
        };
        let output = next();
        let own: Vec<usize> = (0..inputs).map(|_| next()).collect();
        let (error, disturbance) = (next(), next());
        let responses: Vec<usize> = (0..inputs).map(|_| next()).collect();
        let frees: Vec<usize> = (0..inputs).map(|_| next()).collect();
        let impulse = next();
        let mut taps = vec![Taps { signal: output, first: 1, count: orders.na, sign: -1.0 }];
        let b = own.iter().zip(orders.nk.iter().zip(&orders.nb));
        taps.extend(b.map(|(&signal, (&first, &count))| Taps { signal, first, count, sign: 1.0 }));
        taps.push(Taps { signal: error, first: 1, count: orders.nc, sign: 1.0 });
        taps.push(Taps { signal: disturbance, first: 1, count: orders.nd, sign: -1.0 });
        let f = responses.iter().zip(&orders.nf);
        taps.extend(f.map(|(&signal, &count)| Taps { signal, first: 1, count, sign: -1.0 }));
        let zero = frees.iter().enumerate();
        taps.extend(zero.map(|(input, &signal)| Taps { signal, first: 0, count: free(input), sign: 1.0 }));
        let used = taps.iter().filter(|taps| taps.count > 0);
        let longest = used.map(|taps| taps.first + taps.count - 1).max().unwrap_or(0);
        let corrections = if masked > 0 { longest } else { 0 };
        taps.push(Taps { signal: impulse, first: 0, count: corrections, sign: 1.0 });
        let products = Products::new(&taps);
        let columns = taps.iter().flat_map(|taps| {
            let products = &products;
            (0..taps.count).map(move |i| {
                let (signal, lag) = (taps.signal, taps.first + i);
                Column { signal, position: products.position(signal, lag), lag, sign: taps.sign }
            })
        });
        let used = |signal: &usize| taps.iter().any(|taps| taps.signal == *signal && taps.count > 0);
        let all = || std::iter::once(output).chain(own.iter().chain(&responses).copied());
        let filtered = all().chain([error, disturbance]).filter(used).collect();
        Self {
            filtered,
            with_noise_denominator: all().filter(used).collect(),
            columns: columns.collect(),
            parameters: orders.parameters(),
            free: (0..inputs).map(free).sum(),
            orders: orders.clone(),
            taps,
            products,
            masked,
            output,
            inputs: own,
            error,
            disturbance,
            responses,
            frees,
            impulse,
            signals,
        }
    }
}

/// One segment: its signals, and its part of the normal equations.
#[derive(Debug)]
struct Section<'a> {
    output: &'a [f64],
    inputs: Vec<&'a [f64]>,
    /// The filtered signals, e first.
    signals: Vec<Vec<f64>>,
    /// From which sample on each is zero: responses to impulses die away.
    supports: Vec<usize>,
    /// x_j of the inputs with F.
    responses: Vec<Vec<f64>>,
    /// w, where there is D.
    disturbance: Vec<f64>,
    scratch: Vec<f64>,
    /// What the mask cuts off each signal, r values each.
    heads: Vec<f64>,
    interior: Interior,
    entries: Vec<f64>,
    /// The Gram matrix of the parameters' and free responses' columns, row by row, and psi'e.
    gram: Vec<f64>,
    right: Vec<f64>,
    corrections: Vec<f64>,
    /// The weights of the free responses, and those of a trial.
    free: Vec<f64>,
    trial: Vec<f64>,
    /// The factor of the free responses' block, and the step to their optimum: for no change of parameters first, then for
    /// each parameter.
    free_factor: Vec<f64>,
    free_steps: Vec<f64>,
    /// For each free response, the sum of squares below which what D, C and the mask leave of it is rounding.
    free_floors: Vec<f64>,
    cost: f64,
    /// By how much the free responses alone can lower the cost.
    free_gain: f64,
}

impl<'a> Section<'a> {
    fn new(record: &Record<'a>, segment: &Range<usize>, layout: &Layout) -> Self {
        let length = segment.len();
        let used = |signal: usize| {
            signal == 0 || layout.taps.iter().any(|taps| taps.signal == signal && taps.count > 0)
        };
        let room = |used: bool| if used { vec![0.0; length] } else { Vec::new() };
        let (parameters, free) = (layout.parameters, layout.free);
        let columns = parameters + free;
        let size = layout.products.size();
        let rows = layout.masked..length;
        Self {
            output: &record.output[segment.clone()],
            inputs: record.inputs.iter().map(|input| &input[segment.clone()]).collect(),
            signals: (0..layout.signals).map(|signal| room(used(signal))).collect(),
            supports: vec![usize::MAX; layout.signals],
            responses: layout.orders.nf.iter().map(|&nf| room(nf > 0)).collect(),
            disturbance: room(layout.orders.nd > 0),
            scratch: room(layout.orders.nd > 0),
            heads: vec![0.0; layout.signals * layout.masked],
            interior: layout.products.interior(std::iter::once((layout.masked, rows))),
            entries: vec![0.0; size * size],
            gram: vec![0.0; columns * columns],
            right: vec![0.0; columns],
            corrections: vec![0.0; columns * (layout.columns.len() - columns)],
            free: vec![0.0; free],
            trial: vec![0.0; free],
            free_factor: vec![0.0; free * free],
            free_steps: vec![0.0; free * (parameters + 1)],
            free_floors: vec![0.0; free],
            cost: 0.0,
            free_gain: 0.0,
        }
    }

    /// The errors of polynomials and of the trial weights, and their sum of squares.
    fn evaluate(&mut self, layout: &Layout, polynomials: &Polynomials, negative: &[Vec<f64>]) {
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
            x.fill(0.0);
            delayed(x, layout.orders.nk[j], &polynomials.b[j], u);
            let own = if layout.free > 0 { layout.orders.free_responses(j) } else { 0 };
            let (weights, rest) = free.split_at(own);
            free = rest;
            x.iter_mut().zip(weights).for_each(|(x, weight)| *x += weight);
            divide(&polynomials.f[j], x);
            w.iter_mut().zip(&*x).for_each(|(w, x)| *w -= x);
        }
        if has_noise_denominator {
            multiply(error, &polynomials.d, &self.disturbance);
        }
        let (head, tail) = error.split_at_mut(layout.masked);
        head.fill(0.0);
        divide(&polynomials.c, tail);
        self.cost = sum_of_squares(tail);
    }

    /// psi's signals, their Gram matrix and psi'e, at what was evaluated last.
    fn linearize(&mut self, layout: &Layout, polynomials: &Polynomials) {
        let orders = &layout.orders;
        if orders.na > 0 {
            self.signals[layout.output].copy_from_slice(self.output);
        }
        for j in 0..orders.inputs() {
            if orders.nb[j] > 0 {
                self.signals[layout.inputs[j]].copy_from_slice(self.inputs[j]);
            }
            if orders.nf[j] > 0 {
                let two = [layout.inputs[j], layout.responses[j]];
                if let Ok([u, x]) = self.signals.get_disjoint_mut(two) {
                    x.copy_from_slice(&self.responses[j]);
                    divide_together(&polynomials.f[j], [u, x]);
                }
            }
        }
        if orders.nc > 0 {
            let (error, others) = self.signals.split_at_mut(1);
            others[layout.error - 1].copy_from_slice(&error[0]);
        }
        if orders.nd > 0 {
            for &signal in &layout.with_noise_denominator {
                multiply(&mut self.scratch, &polynomials.d, &self.signals[signal]);
                std::mem::swap(&mut self.scratch, &mut self.signals[signal]);
            }
            self.signals[layout.disturbance].copy_from_slice(&self.disturbance);
        }
        for &signal in &layout.filtered {
            let head = &mut self.signals[signal][..layout.masked];
            self.heads[signal * layout.masked..][..layout.masked].copy_from_slice(head);
            head.fill(0.0);
        }
        if orders.nc > 0 {
            divide_all(&polynomials.c, &mut self.signals, &layout.filtered, layout.masked);
        }
        if layout.free > 0 {
            let gain = polynomials.d.iter().map(|d| d.abs()).sum::<f64>();
            let mut next = 0;
            for j in (0..orders.inputs()).filter(|&j| orders.nf[j] > 0) {
                let size = self.respond(layout, polynomials, layout.frees[j], Some(j));
                let own = next..next + orders.free_responses(j);
                next = own.end;
                self.free_floors[own].fill(UNSEEN * gain * gain * size);
            }
        }
        if !self.signals[layout.impulse].is_empty() {
            self.respond(layout, polynomials, layout.impulse, None);
        }
        self.add_up(layout);
        self.eliminate(layout);
    }

    /// The response of (D/(C F_j)) to an impulse at the first sample, or of 1/C to one at the first that counts, until it has
    /// died away. Gives the sum of squares of what 1/F_j alone makes of it.
    fn respond(
        &mut self,
        layout: &Layout,
        polynomials: &Polynomials,
        signal: usize,
        input: Option<usize>,
    ) -> f64 {
        let (values, masked) = (&mut self.signals[signal], layout.masked);
        let orders = &layout.orders;
        let memory = 1 + orders.nc + orders.nd + input.map_or(0, |input| orders.nf[input]);
        let mut known = (FIRST_PIECE + masked + 2 * memory).min(values.len());
        let size = loop {
            let piece = &mut values[..known];
            piece.fill(0.0);
            piece[if input.is_some() { 0 } else { masked }] = 1.0;
            let mut size = 1.0;
            if let Some(input) = input {
                divide(&polynomials.f[input], piece);
                size = sum_of_squares(piece);
                if orders.nd > 0 {
                    multiply(&mut self.scratch[..known], &polynomials.d, piece);
                    piece.copy_from_slice(&self.scratch[..known]);
                }
                let (head, _) = piece.split_at_mut(masked);
                self.heads[signal * masked..][..masked].copy_from_slice(head);
                head.fill(0.0);
            }
            divide(&polynomials.c, &mut piece[masked..]);
            let largest =
                |values: &[f64]| values.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
            let quiet = largest(&piece[known.saturating_sub(memory)..]) <= NEGLIGIBLE * largest(piece);
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
        let (products, masked) = (&layout.products, layout.masked);
        self.entries.fill(0.0);
        products.add_ends(&self.signals, masked, &(masked..self.output.len()), &mut self.entries);
        products.add_interior(&self.signals, &self.supports, &mut self.interior, &mut self.entries);
        let size = products.size();
        let entry = |a: &Column, b: &Column| {
            let (low, high) = (a.position.min(b.position), a.position.max(b.position));
            a.sign * b.sign * self.entries[low * size + high]
        };
        let error = Column { signal: 0, position: products.position(0, 0), lag: 0, sign: 1.0 };
        let count = self.right.len();
        let (columns, shifts) = layout.columns.split_at(count);
        for (row, column) in columns.iter().enumerate() {
            self.right[row] = entry(column, &error);
            for (place, other) in self.gram[row * count..][..=row].iter_mut().zip(columns) {
                *place = entry(column, other);
            }
        }
        if masked > 0 {
            let width = shifts.len();
            for (weights, column) in self.corrections.chunks_exact_mut(width).zip(columns) {
                let head = &self.heads[column.signal * masked..][..masked];
                for (k, weight) in weights.iter_mut().enumerate() {
                    // z(r + k - i), zero before the segment.
                    let from = (masked + k).checked_sub(column.lag).filter(|_| k < column.lag);
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

    /// Prepares the step of the free responses that is best for any change of the parameters.
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
        for (which, steps) in self.free_steps.chunks_exact_mut(free.max(1)).enumerate() {
            if which == 0 {
                steps.copy_from_slice(&self.right[parameters..]);
            } else {
                steps.copy_from_slice(&self.gram[(which - 1) * count + parameters..][..free]);
            }
            normal::solve(&self.free_factor, free, steps);
        }
        let best = &self.free_steps[..free];
        self.free_gain = best.iter().zip(&self.right[parameters..]).map(|(step, right)| step * right).sum();
    }

    /// Adds the part of the normal equations that is left without the free responses.
    fn add_normal(&self, layout: &Layout, matrix: &mut [f64], right: &mut [f64]) {
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
    fn try_free(&mut self, step: &[f64]) {
        let free = self.free.len();
        for (index, trial) in self.trial.iter_mut().enumerate() {
            let moved: f64 =
                step.iter().enumerate().map(|(k, step)| step * self.free_steps[(k + 1) * free + index]).sum();
            *trial = self.free[index] + self.free_steps[index] - moved;
        }
    }
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
fn multiply(target: &mut [f64], monic: &[f64], values: &[f64]) {
    target.copy_from_slice(values);
    delayed(target, 1, &monic[1..], values);
}

/// The prediction errors of a record as a function of the parameters. Memory is taken when it is made; nothing that it
/// does afterwards takes more.
#[derive(Debug)]
pub(super) struct Predictor<'a> {
    layout: Layout,
    polynomials: Polynomials,
    /// -B, for the inputs without F.
    negative: Vec<Vec<f64>>,
    sections: Vec<Section<'a>>,
    samples: usize,
    stability: Vec<f64>,
    /// The normal equations of the parameters, the free responses taken out.
    pub(super) matrix: Vec<f64>,
    pub(super) right: Vec<f64>,
}

impl<'a> Predictor<'a> {
    /// Segments without a sample that counts, or with no more than the free responses need, are left out.
    pub(super) fn new(record: &Record<'a>, orders: &Orders, begin: Begin) -> Self {
        let layout = Layout::new(orders, begin);
        let needed = layout.masked.max(layout.free);
        let usable = record.segments.iter().filter(|segment| segment.len() > needed);
        let sections: Vec<Section<'a>> =
            usable.clone().map(|segment| Section::new(record, segment, &layout)).collect();
        let parameters = layout.parameters;
        Self {
            samples: usable.map(|segment| segment.len() - layout.masked).sum(),
            polynomials: Polynomials::new(orders, &vec![0.0; parameters]),
            negative: orders.nb.iter().map(|&nb| vec![0.0; nb]).collect(),
            stability: Vec::with_capacity(orders.nf.iter().copied().fold(orders.nc, usize::max)),
            matrix: vec![0.0; parameters * parameters],
            right: vec![0.0; parameters],
            layout,
            sections,
        }
    }

    /// N, the samples that count.
    pub(super) fn samples(&self) -> usize {
        self.samples
    }

    /// The initial conditions of all segments.
    pub(super) fn initial_conditions(&self) -> usize {
        self.layout.free * self.sections.len()
    }

    /// Forgets the weights of the free responses.
    pub(super) fn restart(&mut self) {
        for section in &mut self.sections {
            section.free.fill(0.0);
            section.trial.fill(0.0);
        }
    }

    /// The sum of squared errors at these parameters and the trial weights; none where C or F is unstable, or the sum
    /// overflows.
    pub(super) fn evaluate(&mut self, parameters: &[f64]) -> Result<f64, Unusable> {
        self.polynomials.set(parameters);
        if !self.polynomials.are_stable(&mut self.stability) {
            return Err(Unusable::Unstable);
        }
        for (negative, b) in self.negative.iter_mut().zip(&self.polynomials.b) {
            negative.iter_mut().zip(b).for_each(|(negative, b)| *negative = -b);
        }
        let (layout, polynomials, negative) = (&self.layout, &self.polynomials, &self.negative);
        let each = |section: &mut Section<'_>| section.evaluate(layout, polynomials, negative);
        if self.sections.len() > 1 && self.samples >= PARALLEL_FROM {
            self.sections.par_iter_mut().for_each(each);
        } else {
            self.sections.iter_mut().for_each(each);
        }
        let cost: f64 = self.sections.iter().map(|section| section.cost).sum();
        if cost.is_finite() { Ok(cost) } else { Err(Unusable::Overflow) }
    }

    /// Takes what was evaluated last as the current point, and forms the normal equations there. Gives by how much the
    /// free responses alone can lower the cost.
    pub(super) fn linearize(&mut self) -> f64 {
        let (layout, polynomials) = (&self.layout, &self.polynomials);
        let each = |section: &mut Section<'_>| {
            section.free.copy_from_slice(&section.trial);
            section.linearize(layout, polynomials);
        };
        if self.sections.len() > 1 && self.samples >= PARALLEL_FROM {
            self.sections.par_iter_mut().for_each(each);
        } else {
            self.sections.iter_mut().for_each(each);
        }
        self.matrix.fill(0.0);
        self.right.fill(0.0);
        for section in &self.sections {
            section.add_normal(layout, &mut self.matrix, &mut self.right);
        }
        self.sections.iter().map(|section| section.free_gain).sum()
    }

    /// The errors that count, and the stretches of them that follow one another.
    pub(super) fn residuals(&self) -> (Vec<f64>, Vec<Range<usize>>) {
        let mut residuals = Vec::with_capacity(self.samples);
        let segments = self.sections.iter().map(|section| {
            let first = residuals.len();
            residuals.extend_from_slice(&section.signals[0][self.layout.masked..]);
            first..residuals.len()
        });
        let segments = segments.collect();
        (residuals, segments)
    }

    /// sum zeta zeta' over all samples, zeta being psi without the free responses, filtered backwards in time by
    /// 1/A(q^+1), A = `monic`. For models of output error, at the current point.
    pub(super) fn backward_filtered_products(&self, monic: &[f64]) -> DMatrix<f64> {
        let (parameters, free) = (self.layout.parameters, self.layout.free);
        let mut sum = DMatrix::zeros(parameters, parameters);
        for section in &self.sections {
            let combination = DMatrix::from_fn(parameters, parameters + free, |row, column| {
                if column >= parameters {
                    -section.free_steps[(row + 1) * free + column - parameters]
                } else {
                    f64::from(u8::from(row == column))
                }
            });
            let signals: Vec<&[f64]> = section.signals.iter().map(Vec::as_slice).collect();
            let all = 0..section.output.len();
            let taps = &self.layout.taps;
            sum += backward_filtered_products(&signals, taps, &all, &all, Some(&combination), monic);
        }
        sum
    }

    /// The triangular factor of psi without the free responses, at the current point, as exact as Householder QR.
    /// 2 N (p + n)^2 flops for n free responses in a segment.
    ///
    /// # Errors
    /// If an entry is not finite, or too large for squares to be summed without overflow.
    pub(super) fn factor(&self) -> Result<LeastSquares<f64, Dyn>, thetahat_core::Error> {
        let layout = &self.layout;
        let (parameters, free) = (layout.parameters, layout.free);
        let count = parameters + free;
        let (columns, shifts) = layout.columns.split_at(count);
        let mut whole = LeastSquares::with_size(Dyn(parameters));
        for section in &self.sections {
            let entry = |row: usize, column: usize| {
                // The free responses come first: what is left of the parameters stands below them in the factor.
                let index = if column < free { parameters + column } else { column - free };
                let Some(Column { signal, lag, sign, .. }) = columns.get(index) else {
                    return section.signals[0][row];
                };
                let at = |signal: usize, lag: usize| {
                    if row < lag { 0.0 } else { section.signals[signal][row - lag] }
                };
                let weights = &section.corrections[index * shifts.len()..][..shifts.len()];
                let corrections =
                    shifts.iter().zip(weights).map(|(shift, weight)| weight * at(shift.signal, shift.lag));
                sign * at(*signal, *lag) + corrections.sum::<f64>()
            };
            let rows = layout.masked..section.output.len();
            let own = factor_rows(rows.clone(), entry, count + 1)?;
            let triangle = own.factor().view((free, free), (parameters, parameters)).into_owned();
            let rotated = own.rotated_output().rows(free, parameters).into_owned();
            whole.merge(&LeastSquares::from_factor(
                &triangle,
                &rotated,
                own.residual_norm(),
                rows.len() - free,
            )?)?;
        }
        Ok(whole)
    }

    /// Sets the weights of the free responses to those that are best for a step of the parameters, to first order.
    pub(super) fn try_free(&mut self, step: &[f64]) {
        self.sections.iter_mut().for_each(|section| section.try_free(step));
    }

    /// Sets the weights back to those of the current point.
    pub(super) fn keep_free(&mut self) {
        self.sections.iter_mut().for_each(|section| section.trial.copy_from_slice(&section.free));
    }
}

/// Why parameters have no cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unusable {
    /// C or F has a root outside the unit circle.
    Unstable,
    /// The errors overflow.
    Overflow,
}

#[cfg(test)]
mod tests;
