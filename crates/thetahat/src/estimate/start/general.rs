//! Models with A and F: A y = sum_j B_j/F_j u_j + C/D e. The plant's poles are those of A and F, the noise's those of A
//! and D.

use thetahat_core::nalgebra::ComplexField;

use super::Candidate;
use super::mixed::{Coefficients, Data, ROUNDS, starts};
use super::noise::{Equation, Mixed, after};
use super::output_error::{OutputError, Start};
use super::plant::{Input, divided, energy, multiplied};
use crate::model::{
    Orders,
    polynomial::{product, roots},
};

/// Ways to split a denominator that are tried.
const SPLITS: usize = 12;
/// The most factors that a denominator is split into.
const MOST_PARTS: usize = 12;

impl Data<'_> {
    /// Starts with an A that is a factor of the plant's denominator; with A and F in turn; with an A that is taken from
    /// the noise; with F = 1; and with A = 1.
    pub(super) fn general(&self) -> Vec<Candidate> {
        let orders = self.orders;
        let mut candidates = Vec::new();
        candidates.extend(self.with_plant_poles());
        let is_over = |candidates: &[Candidate]| !candidates.is_empty() && self.deadline.is_over();
        if is_over(&candidates) {
            return candidates;
        }
        let without_a = Orders { na: 0, ..orders.clone() };
        let output_error = Data { orders: &without_a, ..*self };
        let found = output_error.output_error().starts();
        if let Some(first) = found.first() {
            candidates.extend(self.in_turn(first, &without_a));
            candidates.extend(self.with_noise_poles(first, &without_a));
        }
        if is_over(&candidates) {
            return candidates;
        }
        let without_f = Orders { nf: vec![0; orders.nf.len()], ..orders.clone() };
        for mut candidate in starts(self.output, self.inputs, self.segments, &without_f, self.deadline) {
            candidate.parameters.extend(self.unit_f().concat());
            candidates.push(candidate);
        }
        if is_over(&candidates) {
            return candidates;
        }
        for mut candidate in output_error.box_jenkins(&found) {
            candidate.parameters.splice(0..0, vec![0.0; orders.na]);
            candidates.push(candidate);
        }
        candidates
    }

    /// Splits the denominator A F of y = B/(A F) u + v, for one input: the A of which the noise A v = C/D e is the
    /// smallest.
    fn with_plant_poles(&self) -> Option<Candidate> {
        let orders = self.orders;
        let [nf] = orders.nf[..] else { return None };
        let whole = Orders { na: 0, nf: vec![orders.na + nf], ..orders.clone() };
        let start = Data { orders: &whole, ..*self }.output_error().starts().into_iter().next()?;
        let total = [&[1.0], &start.f[0][..]].concat();
        let later = after(self.segments, orders.na);
        let splits = factors(&total, orders.na)?.into_iter().take(SPLITS).enumerate();
        let splits = splits.take_while(|(number, _)| *number == 0 || !self.deadline.is_over());
        let found = splits.filter_map(|(_, (a, f))| {
            let v = multiplied(&a, &start.errors, self.segments);
            let noise = self.noise_of(&v, &later)?;
            let cost = energy(&self.whitened(&noise, &v, &later), &later);
            Some((cost, a, f, noise))
        });
        let (_, a, f, noise) = found.min_by(|(left, ..), (right, ..)| left.total_cmp(right))?;
        let found = Coefficients {
            a: a[1..].to_vec(),
            b: start.b,
            c: noise.c[1..].to_vec(),
            d: noise.a[1..].to_vec(),
            f: vec![f[1..].to_vec()],
        };
        Some(found.candidate("plant-poles", start.unstable_pole))
    }

    /// F of an output-error model; then in turn A, B, C and D by generalised least squares on y and u/F, and F by
    /// refined instrumental variables on A y and u, both filtered by D/C.
    fn in_turn(&self, first: &Start, without_a: &Orders) -> Option<Candidate> {
        let orders = self.orders;
        let mut start = first.clone();
        let mut best: Option<(f64, Coefficients)> = None;
        for _ in 0..ROUNDS {
            if best.is_some() && self.deadline.is_over() {
                break;
            }
            let by_f = |(input, f): (&&[f64], &Vec<f64>)| {
                let mut filtered = Vec::new();
                divided(&mut filtered, input, &[&[1.0], &f[..]].concat(), self.segments);
                filtered
            };
            let signals: Vec<Vec<f64>> = self.inputs.iter().zip(&start.f).map(by_f).collect();
            let mut equation = self.equation();
            let inputs = equation.inputs.into_iter().zip(&signals);
            equation.inputs = inputs.map(|(input, signal)| Input { signal, ..input }).collect();
            let Some(regression) = equation.hannan_rissanen(orders.nc + orders.nd) else { break };
            let Some((cost, plant, noise)) = self.generalised(&equation, regression) else { break };
            if best.as_ref().is_some_and(|(lowest, _)| cost >= *lowest) {
                break;
            }
            let output = multiplied(&plant.a, self.output, self.segments);
            let output = self.whitened(&noise, &output, self.segments);
            let inputs = self.whitened_inputs(&noise);
            let inputs: Vec<&[f64]> = inputs.iter().map(Vec::as_slice).collect();
            let found = Coefficients {
                a: plant.a[1..].to_vec(),
                b: plant.b,
                c: noise.c[1..].to_vec(),
                d: noise.a[1..].to_vec(),
                f: start.f.clone(),
            };
            best = Some((cost, found));
            let later = after(self.segments, orders.na + orders.nd);
            let filtered = OutputError::new(&output, &inputs, &later, without_a, self.deadline);
            let Some(next) = filtered.refined("in-turn", &start) else { break };
            start = next;
        }
        best.map(|(_, found)| found.candidate("in-turn", first.unstable_pole))
    }

    /// A as the poles of what the plant leaves; then the plant from A y.
    fn with_noise_poles(&self, first: &Start, without_a: &Orders) -> Option<Candidate> {
        let orders = self.orders;
        let later = after(self.segments, orders.na);
        let poles =
            Equation { output: &first.errors, order: orders.na, inputs: Vec::new(), segments: self.segments };
        let Mixed { a, .. } = poles.hannan_rissanen(orders.nc + orders.nd)?;
        let output = multiplied(&a, self.output, self.segments);
        let data = Data { output: &output, segments: &later, orders: without_a, ..*self };
        let start = data.output_error().refined("noise-poles", first)?;
        let mut candidate = start.candidate(start.name, data.noise_of_residuals(&start).as_ref(), without_a);
        candidate.parameters.splice(0..0, a[1..].iter().copied());
        Some(candidate)
    }
}

/// The ways to write a monic polynomial as the product of two real ones, the first of them with `order` roots.
fn factors(monic: &[f64], order: usize) -> Option<Vec<(Vec<f64>, Vec<f64>)>> {
    let roots = roots(monic)?;
    // Real roots, and pairs by their first.
    let mut parts: Vec<Vec<f64>> = roots
        .iter()
        .filter(|root| root.im >= 0.0)
        .map(|root| match root.im {
            0.0 => vec![1.0, -root.re],
            _ => vec![1.0, -2.0 * root.re, root.modulus_squared()],
        })
        .collect();
    parts.truncate(MOST_PARTS);
    let of = |chosen: usize, wanted: bool| {
        let parts = parts.iter().enumerate().filter(move |(k, _)| (chosen >> k & 1 == 1) == wanted);
        parts.fold(vec![1.0], |all, (_, part)| product(&all, part))
    };
    let all = (0..1_usize << parts.len()).map(|chosen| (of(chosen, true), of(chosen, false)));
    Some(all.filter(|(a, f)| a.len() == order + 1 && a.len() + f.len() == monic.len() + 1).collect())
}
