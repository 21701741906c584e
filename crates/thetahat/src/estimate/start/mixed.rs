//! The recipes for each structure, put together from those for the plant and those for the noise.

use std::ops::Range;

use thetahat_core::nalgebra::Complex;
use thetahat_numerics::optimize::Deadline;

use super::Candidate;
use super::noise::{Equation, Mixed, after};
use super::output_error::{OutputError, Start};
use super::plant::{Equations, Group, Input, Limits, Plant, Point, divided, energy, multiplied};
use crate::model::{Orders, polynomial::multiply_out};

/// Rounds of least squares with filtered signals.
pub(super) const ROUNDS: usize = 3;
const ITERATIONS: Limits = Limits { iterations: 20, tolerance: 1e-3 };
/// The first and the last root of C of starts with a given one.
const GIVEN: [(&str, [f64; 2]); 3] =
    [("equal-roots", [0.3, 0.3]), ("spread-roots", [-0.6, 0.8]), ("slow-roots", [0.0, 0.95])];
/// Below this fraction of sum y^2, a plant's errors are rounding.
const EXACT: f64 = 1e-20;

/// Coefficients of the polynomials without leading ones, those of b and f for each input.
#[derive(Debug, Clone)]
pub(super) struct Coefficients {
    pub(super) a: Vec<f64>,
    pub(super) b: Vec<Vec<f64>>,
    pub(super) c: Vec<f64>,
    pub(super) d: Vec<f64>,
    pub(super) f: Vec<Vec<f64>>,
}

impl Coefficients {
    pub(super) fn candidate(self, name: &'static str, unstable_pole: Option<f64>) -> Candidate {
        let parts = [vec![self.a], self.b, vec![self.c, self.d], self.f];
        Candidate { name, parameters: parts.concat().concat(), unstable_pole }
    }
}

/// All starts for a structure.
pub(super) fn starts(
    output: &[f64],
    inputs: &[&[f64]],
    segments: &[Range<usize>],
    orders: &Orders,
    deadline: Deadline,
) -> Vec<Candidate> {
    let data = Data { output, inputs, segments, orders, deadline };
    let driven = orders.nb.iter().any(|&nb| nb > 0);
    let filtered = orders.nf.iter().any(|&nf| nf > 0);
    match (driven, filtered, orders.na > 0, orders.nd > 0) {
        (false, _, false, _) => data.noise().into_iter().collect(),
        (_, false, _, false) => data.armax(),
        (_, false, true, true) => data.ararmax(),
        (_, _, false, _) => data.box_jenkins(&data.output_error().starts()),
        (_, true, true, _) => data.general(),
    }
}

/// A record and what is asked of it.
#[derive(Clone, Copy)]
pub(super) struct Data<'a> {
    pub(super) output: &'a [f64],
    pub(super) inputs: &'a [&'a [f64]],
    pub(super) segments: &'a [Range<usize>],
    pub(super) orders: &'a Orders,
    pub(super) deadline: Deadline,
}

impl<'a> Data<'a> {
    pub(super) fn equation(&self) -> Equation<'a> {
        let inputs = self.inputs.iter().enumerate();
        let input = |(j, signal): (usize, &&'a [f64])| Input {
            signal,
            first: self.orders.nk[j],
            count: self.orders.nb[j],
        };
        Equation {
            output: self.output,
            order: self.orders.na,
            inputs: inputs.map(input).collect(),
            segments: self.segments,
        }
    }

    pub(super) fn unit_f(&self) -> Vec<Vec<f64>> {
        self.orders.nf.iter().map(|&nf| vec![0.0; nf]).collect()
    }

    /// y = C/D e.
    fn noise(&self) -> Option<Candidate> {
        let Mixed { a: d, c, .. } = self.noise_of(self.output, self.segments)?;
        let b = vec![Vec::new(); self.inputs.len()];
        let found =
            Coefficients { a: Vec::new(), b, c: c[1..].to_vec(), d: d[1..].to_vec(), f: self.unit_f() };
        Some(found.candidate("hannan-rissanen", None))
    }

    /// C and D, the latter as a, of D v = C e.
    pub(super) fn noise_of(&self, v: &[f64], segments: &[Range<usize>]) -> Option<Mixed> {
        Equation { output: v, order: self.orders.nd, inputs: Vec::new(), segments }
            .hannan_rissanen(self.orders.nc)
    }

    /// A y = B u + C e, and without inputs A y = C e: by a long ARX model; and A and B by least squares on y/C and u/C
    /// for some given C, as the errors may have several minima over C.
    fn armax(&self) -> Vec<Candidate> {
        let (equation, nc) = (self.equation(), self.orders.nc);
        let candidate = |name, Mixed { a, b, c }: Mixed| {
            let (a, c) = (a[1..].to_vec(), c[1..].to_vec());
            Coefficients { a, b, c, d: vec![0.0; self.orders.nd], f: self.unit_f() }.candidate(name, None)
        };
        let first = equation.hannan_rissanen(nc).map(|found| candidate("hannan-rissanen", found));
        let Some(first) = first else { return Vec::new() };
        let mut candidates = vec![first];
        if nc == 0 {
            return candidates;
        }
        for (name, [first, last]) in GIVEN {
            if self.deadline.is_over() {
                break;
            }
            let root = |k: usize| first + (last - first) * k as f64 / nc.max(2).saturating_sub(1) as f64;
            let mut product = Vec::new();
            multiply_out((0..nc).map(|k| Complex::new(root(k), 0.0)), &mut product);
            let c: Vec<f64> = product.iter().map(|value| value.re).collect();
            let noise = Mixed { a: vec![1.0], b: Vec::new(), c };
            let output = self.whitened(&noise, self.output, self.segments);
            let inputs = self.whitened_inputs(&noise);
            let of_inputs = equation.inputs.iter().zip(&inputs);
            let filtered = Equation {
                output: &output,
                inputs: of_inputs.map(|(input, signal)| Input { signal, ..input.clone() }).collect(),
                ..equation.clone()
            };
            let found = filtered.least_squares();
            candidates.extend(found.map(|found| candidate(name, Mixed { c: noise.c, ..found })));
        }
        candidates
    }

    /// A y = B u + C/D e by A and B that are consistent in noise of any colour, each improved by generalised least
    /// squares: C and D from w = A y - B u, then A and B by least squares on y and u filtered by D/C (Clarke 1967).
    fn ararmax(&self) -> Vec<Candidate> {
        let equation = self.equation();
        let orders = self.orders;
        let recipes: [(_, &dyn Fn() -> Option<Mixed>); 2] = [
            ("hannan-rissanen", &|| equation.hannan_rissanen(orders.nc + orders.nd)),
            ("refined-instruments", &|| self.by_instruments()),
        ];
        let mut candidates = Vec::new();
        for (name, start) in recipes {
            if !candidates.is_empty() && self.deadline.is_over() {
                break;
            }
            let start = start().and_then(|start| self.generalised(&equation, start));
            let Some((_, plant, noise)) = start else { continue };
            let found = Coefficients {
                a: plant.a[1..].to_vec(),
                b: plant.b,
                c: noise.c[1..].to_vec(),
                d: noise.a[1..].to_vec(),
                f: self.unit_f(),
            };
            candidates.push(found.candidate(name, None));
        }
        candidates
    }

    /// A and B as the plant B/A of an output-error model.
    fn by_instruments(&self) -> Option<Mixed> {
        let inputs = self.equation().inputs;
        if inputs.iter().all(|input| input.count == 0) {
            return None;
        }
        let group = Group { order: self.orders.na, free: self.orders.maximum_lag(), inputs };
        let plant = Plant { output: self.output, groups: vec![group], segments: self.segments };
        let first =
            plant.iterate(&plant.unit(), Equations::SteiglitzMcBride, None, ITERATIONS, self.deadline)?;
        let best = plant.iterate(
            &first.denominators,
            Equations::RefinedInstruments,
            None,
            ITERATIONS,
            self.deadline,
        )?;
        let mut point = Point::new(&plant);
        point.move_to(&best.denominators, None)?;
        let a = best.denominators.into_iter().next()?;
        (!point.undetermined()).then(|| Mixed { a, b: point.numerators, c: vec![1.0] })
    }

    /// Rounds of generalised least squares; the plant and the noise with the lowest sum of squared errors.
    pub(super) fn generalised(&self, equation: &Equation<'_>, start: Mixed) -> Option<(f64, Mixed, Mixed)> {
        let lag = self.orders.maximum_lag();
        let later = after(self.segments, lag);
        let mut plant = start;
        let mut best: Option<(f64, Mixed, Mixed)> = None;
        for _ in 0..ROUNDS {
            if best.is_some() && self.deadline.is_over() {
                break;
            }
            let w = equation.errors(&plant, lag);
            let Some(noise) = self.noise_of(&w, &later) else { break };
            let cost = energy(&self.whitened(&noise, &w, &later), &later);
            if best.as_ref().is_some_and(|(lowest, ..)| cost >= *lowest) {
                break;
            }
            let output = self.whitened(&noise, equation.output, self.segments);
            let inputs: Vec<Vec<f64>> = equation
                .inputs
                .iter()
                .map(|input| self.whitened(&noise, input.signal, self.segments))
                .collect();
            best = Some((cost, plant, noise));
            let filtered = Equation {
                output: &output,
                order: equation.order,
                inputs: equation
                    .inputs
                    .iter()
                    .zip(&inputs)
                    .map(|(input, signal)| Input { signal, ..input.clone() })
                    .collect(),
                segments: &later,
            };
            let Some(next) = filtered.least_squares() else { break };
            plant = next;
        }
        best
    }

    /// (D/C) x from rest in each segment.
    pub(super) fn whitened(&self, noise: &Mixed, signal: &[f64], segments: &[Range<usize>]) -> Vec<f64> {
        let mut whitened = Vec::new();
        divided(&mut whitened, &multiplied(&noise.a, signal, segments), &noise.c, segments);
        whitened
    }

    /// (D/C) u_j.
    pub(super) fn whitened_inputs(&self, noise: &Mixed) -> Vec<Vec<f64>> {
        self.inputs.iter().map(|input| self.whitened(noise, input, self.segments)).collect()
    }

    /// y = B/F u + C/D e: F whatever the noise, C and D from y - x; then F, B and the noise once more with all signals
    /// filtered by D/C (Young 1976; Young and Jakeman, Int. J. Control 29, 1979).
    pub(super) fn box_jenkins(&self, starts: &[Start]) -> Vec<Candidate> {
        let candidate = |name, start: &Start| {
            let noise = self.noise_of_residuals(start);
            (start.candidate(name, noise.as_ref(), self.orders), noise)
        };
        let mut candidates = Vec::new();
        for (position, start) in starts.iter().enumerate() {
            if position > 0 && self.deadline.is_over() {
                break;
            }
            let (found, noise) = candidate(start.name, start);
            candidates.push(found);
            // The recipe that leads.
            let (0, Some(noise), false) = (position, noise, self.deadline.is_over()) else { continue };
            let output = self.whitened(&noise, self.output, self.segments);
            let inputs = self.whitened_inputs(&noise);
            let inputs: Vec<&[f64]> = inputs.iter().map(Vec::as_slice).collect();
            let whitened = OutputError::new(&output, &inputs, self.segments, self.orders, self.deadline);
            let refined = whitened.refined("filtered-refined-instruments", start).and_then(|refined| {
                // What the refined F leaves of y itself.
                let of_output = self.output_error().at(refined.name, &refined.f, refined.unstable_pole)?;
                Some(Start { b: refined.b, ..of_output })
            });
            candidates.extend(refined.map(|refined| candidate(refined.name, &refined).0));
        }
        candidates
    }

    /// y = B/F u + v.
    pub(super) fn output_error(&self) -> OutputError<'a> {
        OutputError::new(self.output, self.inputs, self.segments, self.orders, self.deadline)
    }

    /// The noise model of the residuals of a plant, where there is no A; none where the residuals are rounding, or
    /// white by the orders.
    pub(super) fn noise_of_residuals(&self, start: &Start) -> Option<Mixed> {
        if self.orders.nc + self.orders.nd == 0 {
            return None;
        }
        // Inputs without F have no initial-condition response to make up for unknown samples before a segment.
        let segments = after(self.segments, self.orders.conditioned() - self.orders.nd);
        let left = energy(&start.errors, &segments);
        let exact = left <= EXACT * energy(self.output, self.segments);
        if exact { None } else { self.noise_of(&start.errors, &segments) }
    }
}

impl Start {
    /// With C and D, for a model of these orders without A.
    pub(super) fn candidate(&self, name: &'static str, noise: Option<&Mixed>, orders: &Orders) -> Candidate {
        let (c, d) = noise.map_or_else(
            || (vec![0.0; orders.nc], vec![0.0; orders.nd]),
            |noise| (noise.c[1..].to_vec(), noise.a[1..].to_vec()),
        );
        Coefficients { a: vec![0.0; orders.na], b: self.b.clone(), c, d, f: self.f.clone() }
            .candidate(name, self.unstable_pole)
    }
}
