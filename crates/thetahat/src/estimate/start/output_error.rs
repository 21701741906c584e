//! Denominators for y = sum_j (B_j/F_j) u_j + v, whatever the colour of v.
//!
//! 1. Steiglitz and McBride's iteration on y; 2. the same from a low-pass filter, for plants that are sampled fast;
//! 3. the same on what a long ARX model makes of the inputs without noise; 4. refined instrumental variables from each.
//!
//! Of every iteration the iterate of the lowest cost is kept. Where inputs have denominators of their own, the first
//! two take one denominator for all of them; their parts x_j, and those of the long model, each give F_j, and the last
//! step is for all of them together.

use std::ops::Range;

use thetahat_numerics::optimize::Deadline;

use super::noise::{Equation, Mixed};
use super::plant::{Best, Equations, Group, Input, Limits, Plant, Point, add_delayed, divided};
use super::stable;
use crate::model::{Orders, polynomial::product};

const STEIGLITZ_MCBRIDE: Limits = Limits { iterations: 20, tolerance: 1e-3 };
const REFINED: Limits = Limits { iterations: 15, tolerance: 1e-3 };
/// The order of the long ARX model.
const LONG: usize = 50;
/// With more segments their initial conditions are not solved for.
const MOST_SEGMENTS: usize = 1000;

/// The n poles that the second iteration begins from: they hide noise at high frequencies from it. In 30 of 30 records
/// of a plant with some 300 and 1200 samples in a period it led to the least cost, where the first did in 11.
const LOW_PASS: f64 = 0.95;
/// Starts of which the costs differ by less than this fraction are one.
const SAME_COST: f64 = 1e-9;
/// Iterations that end with costs so close have ended in the same place.
const SAME_PLACE: f64 = 1e-4;

/// F of each input, and the largest modulus above 1 of a root that was reflected.
type Denominators = (Vec<Vec<f64>>, Option<f64>);

/// Denominators and what follows from them.
#[derive(Debug, Clone)]
pub(super) struct Start {
    pub(super) name: &'static str,
    /// f of each input, without the leading 1.
    pub(super) f: Vec<Vec<f64>>,
    /// b of each input.
    pub(super) b: Vec<Vec<f64>>,
    /// y - x.
    pub(super) errors: Vec<f64>,
    /// The largest modulus above 1 of a root that was reflected.
    pub(super) unstable_pole: Option<f64>,
}

/// y = sum_j (B_j/F_j) u_j + v for all inputs that have a B.
#[derive(Debug, Clone)]
pub(super) struct OutputError<'a> {
    output: &'a [f64],
    inputs: Vec<Input<'a>>,
    /// nf of each.
    orders: Vec<usize>,
    /// Initial conditions of each.
    free: Vec<usize>,
    segments: &'a [Range<usize>],
    deadline: Deadline,
}

impl<'a> OutputError<'a> {
    pub(super) fn new(
        output: &'a [f64],
        inputs: &[&'a [f64]],
        segments: &'a [Range<usize>],
        orders: &Orders,
        deadline: Deadline,
    ) -> Self {
        let free = |input| if segments.len() > MOST_SEGMENTS { 0 } else { orders.free_responses(input) };
        let input =
            |(j, signal): (usize, &&'a [f64])| Input { signal, first: orders.nk[j], count: orders.nb[j] };
        Self {
            output,
            inputs: inputs.iter().enumerate().map(input).collect(),
            orders: orders.nf.clone(),
            free: (0..inputs.len()).map(free).collect(),
            segments,
            deadline,
        }
    }

    /// All starts, the best recipes first; none where the data are degenerate.
    pub(super) fn starts(&self) -> Vec<Start> {
        let separate = self.separate();
        if self.orders.iter().all(|&order| order == 0) {
            let start = self.start("least-squares", &separate, &separate.unit(), None);
            return start.into_iter().map(|(start, _)| start).collect();
        }
        let mut starts = Vec::new();
        let (mut begun, mut seen): (Vec<f64>, Vec<f64>) = Default::default();
        let new = |costs: &[f64], cost: f64, tolerance: f64| {
            costs.iter().all(|other| (other - cost).abs() > tolerance * cost)
        };
        let recipes: [(_, &dyn Fn() -> Option<Denominators>); 3] = [
            (["steiglitz-mcbride", "steiglitz-mcbride-refined"], &|| self.common_denominator(0.0)),
            (["low-pass", "low-pass-refined"], &|| self.common_denominator(LOW_PASS)),
            (["long-arx", "long-arx-refined"], &|| self.long_model()),
        ];
        for (names, found) in recipes {
            if !starts.is_empty() && self.deadline.is_over() {
                break;
            }
            let Some((denominators, unstable_pole)) = found() else { continue };
            let start =
                |name, denominators: &[Vec<f64>]| self.start(name, &separate, denominators, unstable_pole);
            let Some((first, cost)) = start(names[0], &denominators) else { continue };
            if !new(&begun, cost, SAME_PLACE) {
                continue;
            }
            begun.push(cost);
            let refined = if self.deadline.is_over() { None } else { self.refine(&separate, &denominators) };
            let refined = refined.and_then(|refined| start(names[1], &refined.denominators));
            for (start, cost) in refined.into_iter().chain([(first, cost)]) {
                if new(&seen, cost, SAME_COST) {
                    seen.push(cost);
                    starts.push(start);
                }
            }
        }
        starts
    }

    /// Refined instrumental variables from a start that other data gave.
    pub(super) fn refined(&self, name: &'static str, start: &Start) -> Option<Start> {
        let separate = self.separate();
        let best = self.refine(&separate, &monic(&start.f))?;
        self.start(name, &separate, &best.denominators, start.unstable_pole).map(|(start, _)| start)
    }

    /// Iterates with refined instrumental variables.
    fn refine(&self, plant: &Plant<'_>, start: &[Vec<f64>]) -> Option<Best> {
        plant.iterate(start, Equations::RefinedInstruments, None, REFINED, self.deadline)
    }

    /// The start with given f.
    pub(super) fn at(&self, name: &'static str, f: &[Vec<f64>], unstable_pole: Option<f64>) -> Option<Start> {
        self.start(name, &self.separate(), &monic(f), unstable_pole).map(|(start, _)| start)
    }

    /// Each input with a denominator of its own.
    fn separate(&self) -> Plant<'a> {
        let groups = self.inputs.iter().zip(&self.orders).zip(&self.free);
        let group = |((input, &order), &free): ((&Input<'a>, &usize), &usize)| Group {
            order,
            free,
            inputs: vec![input.clone()],
        };
        Plant { output: self.output, groups: groups.map(group).collect(), segments: self.segments }
    }

    /// Steiglitz and McBride's iteration with one denominator for all inputs, from F = (1 - `pole` q^-1)^n.
    fn common_denominator(&self, pole: f64) -> Option<Denominators> {
        let order = self.orders.iter().copied().max()?;
        // Times G on both sides, F_j G has the common order.
        let input = |(input, own): (&Input<'a>, &usize)| match input.count {
            0 => input.clone(),
            count => Input { count: count + order - own, ..input.clone() },
        };
        let group = Group {
            order,
            free: self.free.iter().copied().max()?,
            inputs: self.inputs.iter().zip(&self.orders).map(input).collect(),
        };
        let common = Plant { output: self.output, groups: vec![group], segments: self.segments };
        let start = (0..order).fold(vec![1.0], |start, _| product(&start, &[1.0, -pole]));
        let best =
            common.iterate(&[start], Equations::SteiglitzMcBride, None, STEIGLITZ_MCBRIDE, self.deadline)?;
        let used = || self.inputs.iter().zip(&self.orders).filter(|(input, _)| input.count > 0);
        if used().all(|(_, &own)| own == order) {
            let unused = |input: &Input<'_>| input.count == 0;
            let own =
                |input: &Input<'_>| if unused(input) { vec![1.0] } else { best.denominators[0].clone() };
            return Some((self.inputs.iter().map(own).collect(), best.unstable_pole));
        }
        let mut point = Point::new(&common);
        point.move_to(&best.denominators, None)?;
        let part = |(input, b): (&Input<'_>, &Vec<f64>)| self.part(input, b, &best.denominators[0]);
        let parts: Vec<Vec<f64>> = self.inputs.iter().zip(&point.numerators).map(part).collect();
        let (denominators, _) = self.separate_parts(&parts)?;
        Some((denominators, best.unstable_pole))
    }

    /// The same, for each input alone, on what a long ARX model makes of it.
    fn long_model(&self) -> Option<Denominators> {
        let equation =
            Equation { output: self.output, order: 0, inputs: self.inputs.clone(), segments: self.segments };
        let (Mixed { a, b, .. }, _) = equation.long(LONG)?;
        let (a, _) = stable(&a)?;
        let parts: Vec<Vec<f64>> =
            self.inputs.iter().zip(&b).map(|(input, b)| self.part(input, b, &a)).collect();
        self.separate_parts(&parts)
    }

    /// (B/A) u from rest.
    fn part(&self, input: &Input<'_>, b: &[f64], a: &[f64]) -> Vec<f64> {
        let mut driven = vec![0.0; self.output.len()];
        add_delayed(&mut driven, b, input.signal, input.first, self.segments);
        let mut part = Vec::new();
        divided(&mut part, &driven, a, self.segments);
        part
    }

    /// F_j from x_j, evaluated on y without the other parts.
    fn separate_parts(&self, parts: &[Vec<f64>]) -> Option<Denominators> {
        let mut denominators = Vec::new();
        let mut unstable_pole: Option<f64> = None;
        for (j, input) in self.inputs.iter().enumerate() {
            if self.orders[j] == 0 {
                denominators.push(vec![1.0]);
                continue;
            }
            let mut target = self.output.to_vec();
            for (_, other) in parts.iter().enumerate().filter(|(k, _)| *k != j) {
                target.iter_mut().zip(other).for_each(|(value, other)| *value -= other);
            }
            let group = Group { order: self.orders[j], free: self.free[j], inputs: vec![input.clone()] };
            let plant = Plant { output: &parts[j], groups: vec![group], segments: self.segments };
            let unit = plant.unit();
            let mut best = plant.iterate(
                &unit,
                Equations::SteiglitzMcBride,
                Some(&target),
                STEIGLITZ_MCBRIDE,
                self.deadline,
            )?;
            unstable_pole = [unstable_pole, best.unstable_pole].into_iter().flatten().reduce(f64::max);
            denominators.append(&mut best.denominators);
        }
        Some((denominators, unstable_pole))
    }

    /// The start with some denominators, and its cost; none where the data do not determine every B.
    fn start(
        &self,
        name: &'static str,
        plant: &Plant<'_>,
        denominators: &[Vec<f64>],
        unstable_pole: Option<f64>,
    ) -> Option<(Start, f64)> {
        let mut point = Point::new(plant);
        let cost = point.move_to(denominators, None)?;
        if point.undetermined() {
            return None;
        }
        Some((
            Start {
                name,
                f: denominators.iter().map(|monic| monic[1..].to_vec()).collect(),
                b: point.numerators,
                errors: point.errors,
                unstable_pole,
            },
            cost,
        ))
    }
}

/// With the leading 1.
fn monic(f: &[Vec<f64>]) -> Vec<Vec<f64>> {
    f.iter().map(|f| std::iter::once(1.0).chain(f.iter().copied()).collect()).collect()
}
