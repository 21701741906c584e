//! What all searches for denominators share. For given F of each group g of inputs that have one in common,
//!
//! ```text
//! y(t) = sum_g x_g(t) + e(t),   x_g = sum_{j in g} (B_j/F_g) u_j + (Delta_gs/F_g) delta
//! ```
//!
//! is linear in B and in the initial conditions Delta of each segment s. Divided by F, the equation
//! F_g (x_g + e) = sum B_j u_j + Delta_gs + (F_g e) is linear in all parameters, with F held in the filter:
//!
//! ```text
//! e(t) = phi(t)' (theta_next - theta),   phi = [ -y_F(t - i)   u_F(t - nk - i)   h(t - i) ],   y_F = (x_g + e)/F
//! ```
//!
//! Least squares on it is the step of Steiglitz and McBride; with x_F = x_g/F as instruments for y_F it is that of the
//! refined instrumental variables; with x_F in place of y_F it is that of Gauss and Newton. Increments
//! have the same fixed points as the equations for theta itself, and are exact where these lose digits.
//!
//! Sources: Steiglitz and McBride, A technique for the identification of linear systems, IEEE Trans. Automatic Control
//! 10, 1965; Young, Some observations on instrumental variable methods of time-series analysis, Int. J. Control 23,
//! 1976; Young, Recursive Estimation and Time-Series Analysis, 2nd ed. 2011, chapters 6 and 7.

use std::ops::Range;

use thetahat_core::nalgebra::{DMatrix, DVector};
use thetahat_numerics::optimize::Deadline;
use thetahat_numerics::regression::{
    Lagged, Presample, Taps, add_filtered, divide, divide_together, sum_of_squares,
};

use super::reduced::{Factor, Free, Reduced};
use super::stable;

/// Below this fraction of sum y^2, sum e^2 is rounding.
const EXACT: f64 = 1e-26;

/// `count` coefficients of B, the first of which multiplies u(t - `first`).
#[derive(Debug, Clone)]
pub(in crate::estimate) struct Input<'a> {
    pub(in crate::estimate) signal: &'a [f64],
    pub(in crate::estimate) first: usize,
    pub(in crate::estimate) count: usize,
}

/// Inputs with one F of `order` coefficients, and `free` initial conditions in each segment.
#[derive(Debug, Clone)]
pub(in crate::estimate) struct Group<'a> {
    pub(in crate::estimate) order: usize,
    pub(in crate::estimate) free: usize,
    pub(in crate::estimate) inputs: Vec<Input<'a>>,
}

/// The data and the orders.
#[derive(Debug, Clone)]
pub(in crate::estimate) struct Plant<'a> {
    pub(in crate::estimate) output: &'a [f64],
    pub(in crate::estimate) groups: Vec<Group<'a>>,
    pub(in crate::estimate) segments: &'a [Range<usize>],
}

/// Which equations the next parameters solve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::estimate) enum Equations {
    /// Least squares.
    SteiglitzMcBride,
    /// The instruments are free of noise.
    RefinedInstruments,
}

/// How far to iterate.
#[derive(Debug, Clone, Copy)]
pub(in crate::estimate) struct Limits {
    pub(in crate::estimate) iterations: usize,
    /// Stop when the next step changes the response by less than this fraction of the errors.
    pub(in crate::estimate) tolerance: f64,
}

/// The best of the denominators that an iteration went through.
#[derive(Debug, Clone)]
pub(in crate::estimate) struct Best {
    /// Monic and stable, for each group.
    pub(in crate::estimate) denominators: Vec<Vec<f64>>,
    /// sum e^2.
    pub(in crate::estimate) cost: f64,
    /// The largest modulus above 1 of a root before reflection.
    pub(in crate::estimate) unstable_pole: Option<f64>,
}

/// Signals at the latest denominators.
#[derive(Debug, Clone)]
pub(in crate::estimate) struct Point<'p, 'a> {
    plant: &'p Plant<'a>,
    pub(in crate::estimate) denominators: Vec<Vec<f64>>,
    /// b of each input, groups after one another.
    pub(in crate::estimate) numerators: Vec<Vec<f64>>,
    /// u_j/F.
    filtered: Vec<Vec<f64>>,
    pub(in crate::estimate) free: Free,
    /// x_g.
    pub(in crate::estimate) responses: Vec<Vec<f64>>,
    /// e.
    pub(in crate::estimate) errors: Vec<f64>,
    /// sum e^2.
    pub(in crate::estimate) cost: f64,
    /// Whether some b is undetermined.
    pub(in crate::estimate) deficient: bool,
    /// (x_g + e)/F and x_g/F.
    outputs: Vec<Vec<f64>>,
    instruments: Vec<Vec<f64>>,
}

/// Where an iteration goes next.
pub(in crate::estimate) struct Step {
    /// F before reflection.
    pub(in crate::estimate) denominators: Vec<Vec<f64>>,
    /// |change of the response|^2.
    pub(in crate::estimate) change: f64,
}

impl<'a> Plant<'a> {
    pub(in crate::estimate) fn inputs(&self) -> impl Iterator<Item = &Input<'a>> {
        self.groups.iter().flat_map(|group| &group.inputs)
    }

    /// F = 1 for each group.
    pub(in crate::estimate) fn unit(&self) -> Vec<Vec<f64>> {
        let unit =
            |group: &Group<'_>| std::iter::once(1.0).chain(std::iter::repeat_n(0.0, group.order)).collect();
        self.groups.iter().map(unit).collect()
    }

    /// Iterates from some denominators, reflecting unstable roots, and keeps those of the lowest cost: on `target`
    /// where there is one, else on the plant's own output. O(N p) for each iteration, of which none begins after the
    /// deadline. None if no cost is a number.
    pub(in crate::estimate) fn iterate(
        &self,
        start: &[Vec<f64>],
        equations: Equations,
        target: Option<&[f64]>,
        limits: Limits,
        deadline: Deadline,
    ) -> Option<Best> {
        let mut point = Point::new(self);
        let mut best: Option<Best> = None;
        let (mut next, mut unstable_pole) = (start.to_vec(), None);
        let exact = EXACT * energy(self.output, self.segments);
        for iterations in 0..=limits.iterations {
            let Some(cost) = point.move_to(&next, target) else { break };
            if best.as_ref().is_none_or(|best| cost < best.cost) {
                best = Some(Best { denominators: next, cost, unstable_pole });
            }
            if iterations == limits.iterations || point.cost <= exact || deadline.is_over() {
                break;
            }
            let Some(step) = point.step(equations) else { break };
            let reflected: Option<Vec<_>> = step.denominators.iter().map(|monic| stable(monic)).collect();
            let Some(reflected) = reflected else { break };
            unstable_pole = reflected.iter().filter_map(|(_, modulus)| *modulus).reduce(f64::max);
            next = reflected.into_iter().map(|(monic, _)| monic).collect();
            if step.change <= limits.tolerance * limits.tolerance * cost {
                break;
            }
        }
        best
    }
}

impl<'p, 'a> Point<'p, 'a> {
    pub(in crate::estimate) fn new(plant: &'p Plant<'a>) -> Self {
        let (groups, inputs) = (plant.groups.len(), plant.inputs().count());
        Self {
            plant,
            denominators: Vec::new(),
            numerators: vec![Vec::new(); inputs],
            filtered: vec![Vec::new(); inputs],
            free: Free::default(),
            responses: vec![Vec::new(); groups],
            errors: Vec::new(),
            cost: f64::NAN,
            deficient: false,
            outputs: vec![Vec::new(); groups],
            instruments: vec![Vec::new(); groups],
        }
    }

    /// Solves for b and the initial conditions; gives the least sum of squares, for the output `target` if there is
    /// one.
    pub(in crate::estimate) fn move_to(
        &mut self,
        denominators: &[Vec<f64>],
        target: Option<&[f64]>,
    ) -> Option<f64> {
        let plant = self.plant;
        self.denominators = denominators.to_vec();
        let monics = plant
            .groups
            .iter()
            .zip(denominators)
            .flat_map(|(group, monic)| group.inputs.iter().map(move |input| (input, monic)));
        for ((input, monic), filtered) in monics.zip(&mut self.filtered) {
            divided(filtered, input.signal, monic, plant.segments);
        }
        let longest = plant.segments.iter().map(Range::len).max().unwrap_or(0);
        let frees =
            denominators.iter().zip(&plant.groups).map(|(monic, group)| (monic.as_slice(), group.free));
        self.free = Free::new(frees, longest);

        let mut signals: Vec<&[f64]> = vec![plant.output];
        signals.extend(self.filtered.iter().map(Vec::as_slice));
        let mut taps = self.input_taps(1);
        if let Some(target) = target {
            taps.push(Taps { signal: signals.len(), first: 0, count: 1, sign: 1.0 });
            signals.push(target);
        }
        let reduced = Reduced::new(&signals, &taps, plant.segments, &self.free)?;
        let count = plant.inputs().map(|input| input.count).sum();
        let factor = Factor::new(&reduced.matrix.view((0, 0), (count, count)).into_owned())?;
        self.deficient = factor.deficient;
        let solution = factor.solve(&reduced.right.rows(0, count).into_owned());
        let mut rest = solution.as_slice();
        for (numerator, input) in self.numerators.iter_mut().zip(plant.inputs()) {
            let (own, others) = rest.split_at(input.count);
            *numerator = own.to_vec();
            rest = others;
        }
        let initial = reduced.initial_conditions(&solution.clone().resize_vertically(taps_count(&taps), 0.0));
        self.respond(&initial);
        self.cost = energy(&self.errors, plant.segments);
        let cost = if target.is_some() {
            // |y|^2 - c' G^-1 c.
            let mut products = reduced.matrix.view((0, count), (count, 1)).into_owned();
            factor.forward(products.as_mut_slice());
            (reduced.matrix[(count, count)] - products.norm_squared()).max(0.0)
        } else {
            self.cost
        };
        (cost.is_finite() && self.cost.is_finite()).then_some(cost)
    }

    /// x_g and e.
    fn respond(&mut self, initial: &[DVector<f64>]) {
        let plant = self.plant;
        self.errors.clear();
        self.errors.extend_from_slice(plant.output);
        let mut inputs = self.numerators.iter().zip(&self.filtered).zip(plant.inputs());
        let mut delays = 0;
        for (g, (group, response)) in plant.groups.iter().zip(&mut self.responses).enumerate() {
            response.clear();
            response.resize(plant.output.len(), 0.0);
            for ((numerator, filtered), input) in inputs.by_ref().take(group.inputs.len()) {
                add_delayed(response, numerator, filtered, input.first, plant.segments);
            }
            for (segment, initial) in plant.segments.iter().zip(initial) {
                let free = &self.free.responses[g];
                let head = 0..segment.len().min(free.len());
                let weights = &initial.as_slice()[delays..delays + group.free];
                add_filtered(&mut response[segment.start..][..head.end], &head, weights, free, 0);
            }
            delays += group.free;
            self.errors.iter_mut().zip(response.iter()).for_each(|(error, value)| *error -= value);
        }
    }

    /// Whether the data leave a b open, or an F as there is nothing behind it.
    pub(in crate::estimate) fn undetermined(&self) -> bool {
        let plant = self.plant;
        let silent = |response: &Vec<f64>| energy(response, plant.segments) == 0.0;
        let open = plant.groups.iter().zip(&self.responses).any(|(group, x)| group.order > 0 && silent(x));
        if open || !self.deficient {
            return open;
        }
        // Nearly dependent, or dependent: on the rows themselves that is not a matter of rounding.
        let mut signals: Vec<&[f64]> = vec![plant.output];
        signals.extend(self.filtered.iter().map(Vec::as_slice));
        let taps = self.input_taps(1);
        let lagged = Lagged::new(&signals, taps.clone(), plant.segments, Presample::Zero);
        lagged.rows() <= taps_count(&taps) || lagged.solve().is_err()
    }

    /// Taps for the filtered inputs, which are the signals from `first` on.
    fn input_taps(&self, first: usize) -> Vec<Taps> {
        let taps = |(k, input): (usize, &Input<'_>)| Taps {
            signal: first + k,
            first: input.first,
            count: input.count,
            sign: 1.0,
        };
        self.plant.inputs().enumerate().map(taps).collect()
    }

    /// The signals and taps of psi = -de/dtheta, for b of each input and f of each group: u_F(t - nk - i), -x_F(t - i).
    /// They need `filter_outputs` before.
    pub(in crate::estimate) fn sensitivities(&self) -> (Vec<&[f64]>, Vec<Taps>) {
        let mut taps = self.input_taps(0);
        let mut signals: Vec<&[f64]> = self.filtered.iter().map(Vec::as_slice).collect();
        for (group, instrument) in
            self.plant.groups.iter().zip(&self.instruments).filter(|(group, _)| group.order > 0)
        {
            taps.push(Taps { signal: signals.len(), first: 1, count: group.order, sign: -1.0 });
            signals.push(instrument);
        }
        (signals, taps)
    }

    /// (x_g + e)/F, and x_g/F if asked for.
    pub(in crate::estimate) fn filter_outputs(&mut self, instruments: bool) {
        let plant = self.plant;
        for (g, monic) in self.denominators.iter().enumerate().filter(|(g, _)| plant.groups[*g].order > 0) {
            let (output, instrument) = (&mut self.outputs[g], &mut self.instruments[g]);
            output.clear();
            if let [_] = plant.groups[..] {
                output.extend_from_slice(plant.output);
            } else {
                output.extend(self.responses[g].iter().zip(&self.errors).map(|(x, e)| x + e));
            }
            if !instruments {
                divide_segments(output, monic, plant.segments);
                continue;
            }
            instrument.clear();
            instrument.extend_from_slice(&self.responses[g]);
            for segment in plant.segments {
                let both = [&mut output[segment.clone()], &mut instrument[segment.clone()]];
                divide_together(used(monic), both);
            }
        }
    }

    /// The next denominators. None where they are undetermined.
    pub(in crate::estimate) fn step(&mut self, equations: Equations) -> Option<Step> {
        let refined = equations == Equations::RefinedInstruments;
        self.filter_outputs(refined);
        let plant = self.plant;
        let orders = || plant.groups.iter().enumerate().filter(|(_, group)| group.order > 0);
        let count: usize = plant.groups.iter().map(|group| group.order).sum();
        let mut signals: Vec<&[f64]> = vec![&self.errors];
        let mut taps = Vec::new();
        for filtered in [Some(&self.outputs), refined.then_some(&self.instruments)].into_iter().flatten() {
            for (g, group) in orders() {
                taps.push(Taps { signal: signals.len(), first: 1, count: group.order, sign: -1.0 });
                signals.push(&filtered[g]);
            }
        }
        taps.extend(self.input_taps(signals.len()));
        signals.extend(self.filtered.iter().map(Vec::as_slice));
        let reduced = Reduced::new(&signals, &taps, plant.segments, &self.free)?;
        let step = if refined {
            let size = reduced.right.len();
            // Rows of the instruments and the inputs, columns of the outputs and the inputs.
            let rows = |k: usize| k + count;
            let columns = |k: usize| if k < count { k } else { k + count };
            let matrix =
                DMatrix::from_fn(size - count, size - count, |i, j| reduced.matrix[(rows(i), columns(j))]);
            let square = |k: usize| reduced.matrix[(k, k)];
            let squares: [Vec<f64>; 2] = [
                (0..size - count).map(|i| square(rows(i))).collect(),
                (0..size - count).map(|j| square(columns(j))).collect(),
            ];
            let step = inverse(&matrix, squares)? * reduced.right.rows(count, size - count);
            let square = reduced.matrix.view((count, count), (size - count, size - count)) * &step;
            (step.dot(&square), step)
        } else {
            let step = Factor::new(&reduced.matrix)?.solve(&reduced.right);
            (step.dot(&reduced.right), step)
        };
        let (change, step) = step;
        let mut rest = step.as_slice();
        let mut denominators = self.denominators.clone();
        for (monic, group) in denominators.iter_mut().zip(&plant.groups) {
            let (own, others) = rest.split_at(group.order);
            monic.iter_mut().skip(1).zip(own).for_each(|(f, change)| *f += change);
            rest = others;
        }
        Some(Step { denominators, change })
    }
}

/// (Z'X)^-1, by way of columns of Z and X of unit length, whatever their units: `squares` are those of the columns of
/// Z, then of X. None if it is singular, as where a column is nothing but rounding.
pub(in crate::estimate) fn inverse(matrix: &DMatrix<f64>, squares: [Vec<f64>; 2]) -> Option<DMatrix<f64>> {
    if !squares.iter().flatten().all(|square| *square > 0.0) {
        return None;
    }
    let [rows, columns] = squares.map(|squares| squares.into_iter().map(f64::sqrt).collect::<Vec<f64>>());
    let mut scaled = matrix.clone();
    scaled.row_iter_mut().zip(&rows).for_each(|(mut row, length)| row.unscale_mut(*length));
    scaled.column_iter_mut().zip(&columns).for_each(|(mut column, length)| column.unscale_mut(*length));
    let mut inverse = scaled.lu().try_inverse()?;
    inverse.row_iter_mut().zip(&columns).for_each(|(mut row, length)| row.unscale_mut(*length));
    inverse.column_iter_mut().zip(&rows).for_each(|(mut column, length)| column.unscale_mut(*length));
    inverse.iter().all(|entry| entry.is_finite()).then_some(inverse)
}

/// x/F from rest in each segment.
pub(in crate::estimate) fn divided(
    into: &mut Vec<f64>,
    signal: &[f64],
    monic: &[f64],
    segments: &[Range<usize>],
) {
    into.clear();
    into.extend_from_slice(signal);
    divide_segments(into, monic, segments);
}

/// P x, P being a polynomial in q^-1 and x zero before each segment.
pub(in crate::estimate) fn multiplied(
    polynomial: &[f64],
    signal: &[f64],
    segments: &[Range<usize>],
) -> Vec<f64> {
    let mut product = vec![0.0; signal.len()];
    for segment in segments {
        add_filtered(&mut product[segment.clone()], segment, polynomial, signal, segment.start);
    }
    product
}

/// Adds B(q) x(t - `first`), x being zero before each segment.
pub(in crate::estimate) fn add_delayed(
    into: &mut [f64],
    b: &[f64],
    signal: &[f64],
    first: usize,
    segments: &[Range<usize>],
) {
    for segment in segments {
        let first = first.min(segment.len());
        let target = &mut into[segment.start + first..segment.end];
        add_filtered(target, &(segment.start..segment.end - first), b, signal, segment.start);
    }
}

fn divide_segments(values: &mut [f64], monic: &[f64], segments: &[Range<usize>]) {
    segments.iter().for_each(|segment| divide(used(monic), &mut values[segment.clone()]));
}

/// Without the zeros at the end.
fn used(monic: &[f64]) -> &[f64] {
    &monic[..monic.iter().rposition(|f| *f != 0.0).map_or(0, |last| last + 1)]
}

/// sum x^2.
pub(in crate::estimate) fn energy(values: &[f64], segments: &[Range<usize>]) -> f64 {
    segments.iter().map(|segment| sum_of_squares(&values[segment.clone()])).sum()
}

fn taps_count(taps: &[Taps]) -> usize {
    taps.iter().map(|taps| taps.count).sum()
}
