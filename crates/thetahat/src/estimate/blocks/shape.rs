//! The machine of a structure, and where its training starts.

use thetahat_core::nalgebra::Complex;

use super::curve::{Curve, knots};
use super::linear_start::Linear;
use super::machine::{Machine, Run};
use super::{BlockStructure, CurveForm, Levels, rounded};
use crate::model::polynomial::roots;

/// What a model in blocks is made of.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Shape {
    pub(super) structure: BlockStructure,
    /// States.
    pub(super) order: usize,
    /// Of each input.
    pub(super) delays: Vec<usize>,
    pub(super) form: CurveForm,
    /// Knots of lines, or the degree of a polynomial.
    pub(super) size: usize,
    /// Whether the argument of the curve in a feedback is any of the states and inputs, and not x_1.
    pub(super) is_general: bool,
}

/// Numbers from which the training starts.
pub(super) struct Start {
    pub(super) machine: Machine,
    pub(super) theta: Vec<f64>,
}

/// Shares of the poles between two filters are tried as long as there are no more than these.
const MOST_SHARES: usize = 64;

impl Shape {
    /// In how many ways linear systems and curves can share their scales.
    pub(super) fn shared_scales(&self) -> usize {
        match self.structure {
            BlockStructure::Hammerstein => self.delays.len(),
            BlockStructure::Wiener | BlockStructure::Feedback => 1,
            BlockStructure::WienerHammerstein => 2,
        }
    }

    /// Curves for what their arguments were; none where one of these does not move.
    pub(super) fn curves(&self, seen: Vec<Vec<f64>>) -> Option<Vec<Curve>> {
        let curve = |(index, values): (usize, Vec<f64>)| match self.form {
            CurveForm::Lines(_) => {
                let knots = knots(values, self.size)?;
                // Levels of several curves add up: one of them is enough.
                let pinned = (index > 0).then_some(knots.len() / 2);
                Some(Curve::Lines { knots, pinned })
            }
            CurveForm::Polynomial(_) => {
                let low = values.iter().copied().fold(f64::INFINITY, f64::min);
                let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let (middle, scale) = (rounded((low + high) / 2.0), rounded((high - low) / 2.0));
                // What a feedback has of the first degree is in the poles.
                let is_there = |power: &i32| match self.structure {
                    BlockStructure::Feedback => *power != 1,
                    _ => index == 0 || *power != 0,
                };
                let powers = (0..).take(self.size + 1).filter(is_there).collect();
                (scale > 0.0).then_some(Curve::Polynomial { middle, scale, powers })
            }
        };
        seen.into_iter().enumerate().map(curve).collect()
    }

    /// Where to start, given the best linear approximation.
    pub(super) fn starts(
        &self,
        linear: &Linear,
        runs: &[Run],
        (means, offsets): (&Levels, &Levels),
    ) -> Vec<Start> {
        let (n, m) = (self.order, self.delays.len());
        let u = |input: usize| -> Vec<f64> {
            runs.iter().flat_map(|run| run.inputs.iter().skip(input).step_by(m).copied()).collect()
        };
        let level = means.output - offsets.output;
        let gain = |input: usize| Some(linear.gain(input)).filter(|gain| gain.is_normal()).unwrap_or(1.0);
        match self.structure {
            BlockStructure::Hammerstein => {
                let Some(curves) = self.curves((0..m).map(u).collect()) else { return Vec::new() };
                let mut theta = linear.f.clone();
                for input in 0..m {
                    theta.extend(linear.b[input].iter().map(|b| b / gain(input)));
                }
                for input in (0..m).filter(|input| self.delays[*input] == 0) {
                    theta.push(linear.d[input] / gain(input));
                }
                for (input, curve) in curves.iter().enumerate() {
                    let level = if input == 0 { level } else { 0.0 };
                    theta.extend(curve.like(|z| gain(input) * (z - means.inputs[input]) + level));
                }
                vec![Start { machine: self.hammerstein(curves), theta }]
            }
            BlockStructure::Wiener => {
                let first = gain(0);
                let mut theta = linear.f.clone();
                theta.extend(linear.b.iter().flatten().map(|b| b / first));
                theta.extend(self.direct().map(|input| linear.d[input] / first));
                let rest: f64 = (0..m).map(|input| linear.gain(input) / first * means.inputs[input]).sum();
                let z = arguments(&self.filter(), &theta, runs);
                let Some(curves) = z.and_then(|z| self.curves(vec![z])) else { return Vec::new() };
                theta.extend(curves[0].like(|z| first * (z - rest) + level));
                vec![Start { machine: self.wiener(curves), theta }]
            }
            BlockStructure::WienerHammerstein => self.shares(linear, runs, (&means.inputs, level)),
            BlockStructure::Feedback => {
                let y = runs.iter().flat_map(|run| run.output.iter().copied());
                let y = y.filter(|value| value.is_finite()).collect();
                let Some(curves) = self.curves(vec![y]) else { return Vec::new() };
                let mut theta = linear.f.clone();
                theta.extend(linear.b.iter().flatten());
                // What the curve says goes where the first input goes.
                theta.extend(&linear.b[0]);
                let direct: Vec<f64> = self.direct().map(|input| linear.d[input]).collect();
                if self.is_general {
                    theta.extend(vec![0.0; n - 1 + direct.len()]);
                }
                theta.extend(&direct);
                if self.is_general || !direct.is_empty() {
                    theta.push(0.0);
                }
                theta.extend(curves[0].like(|_| 0.0));
                vec![Start { machine: self.feedback(curves), theta }]
            }
        }
    }

    /// The inputs that act at once.
    fn direct(&self) -> impl Iterator<Item = usize> {
        (0..self.delays.len()).filter(|input| self.delays[*input] == 0)
    }

    fn hammerstein(&self, curves: Vec<Curve>) -> Machine {
        let (n, m) = (self.order, self.delays.len());
        let mut machine = Machine::new(n, m, curves);
        companion(&mut machine, 0..n, "f");
        for input in 0..m {
            machine.is_one(n + input, n + input);
            column(&mut machine, 0..n, n + m + input, &numbered("b", input, m));
        }
        machine.is_one(n + m, 0);
        for input in self.direct() {
            machine.is_parameter(n + m, n + m + input, 1.0, numbered("d", input, m)(""));
        }
        machine
    }

    /// The system of a Wiener model without its curve.
    fn filter(&self) -> Machine {
        let n = self.order;
        let mut machine = Machine::new(n, self.delays.len(), Vec::new());
        self.first_system(&mut machine, n, n);
        machine
    }

    fn wiener(&self, curves: Vec<Curve>) -> Machine {
        let (n, m) = (self.order, self.delays.len());
        let mut machine = Machine::new(n, m, curves);
        self.first_system(&mut machine, n, n);
        machine.is_one(n + 1, n + m);
        machine
    }

    /// The system from the inputs, of so many states, to this row.
    fn first_system(&self, machine: &mut Machine, states: usize, row: usize) {
        let (n, m) = (machine.states, self.delays.len());
        companion(machine, 0..states, "f");
        for input in 0..m {
            column(machine, 0..states, n + input, &numbered("b", input, m));
        }
        machine.is_one(row, 0);
        for input in self.direct() {
            machine.is_parameter(row, n + input, 1.0, numbered("d", input, m)(""));
        }
    }

    fn between(&self, first: usize, curves: Vec<Curve>) -> Machine {
        let (n, m) = (self.order, self.delays.len());
        let mut machine = Machine::new(n, m, curves);
        self.first_system(&mut machine, first, n);
        companion(&mut machine, first..n, "p");
        column(&mut machine, first..n, n + m, &numbered("q", 0, 1));
        machine.is_one(n + 1, first);
        machine.is_parameter(n + 1, n + m, 1.0, "q0".to_owned());
        machine
    }

    fn feedback(&self, curves: Vec<Curve>) -> Machine {
        let (n, m) = (self.order, self.delays.len());
        let mut machine = Machine::new(n, m, curves);
        companion(&mut machine, 0..n, "f");
        for input in 0..m {
            column(&mut machine, 0..n, n + input, &numbered("b", input, m));
        }
        column(&mut machine, 0..n, n + m, &numbered("e", 0, 1));
        machine.is_one(n, 0);
        let direct: Vec<usize> = self.direct().collect();
        if self.is_general {
            for state in 1..n {
                machine.is_parameter(n, state, 1.0, format!("c{}", state + 1));
            }
            for input in &direct {
                machine.is_parameter(n, n + input, 1.0, numbered("h", *input, m)(""));
            }
        }
        machine.is_one(n + 1, 0);
        for input in &direct {
            machine.is_parameter(n + 1, n + input, 1.0, numbered("d", *input, m)(""));
        }
        if self.is_general || !direct.is_empty() {
            machine.is_parameter(n + 1, n + m, 1.0, "d_w".to_owned());
        }
        machine
    }

    /// All shares of the poles between two filters without zeros, each with a gain of 1.
    fn shares(&self, linear: &Linear, runs: &[Run], (means, level): (&[f64], f64)) -> Vec<Start> {
        let monic: Vec<f64> = std::iter::once(1.0).chain(linear.f.iter().copied()).collect();
        let Some(roots) = roots(&monic) else { return Vec::new() };
        // Of conjugates one stands for both.
        let poles: Vec<Complex<f64>> = roots.into_iter().filter(|root| root.im >= 0.0).collect();
        let gains: Vec<f64> = (0..self.delays.len()).map(|input| linear.gain(input)).collect();
        let first = Some(gains[0]).filter(|gain| gain.is_normal()).unwrap_or(1.0);
        let rest: f64 = gains.iter().zip(means).map(|(gain, mean)| gain / first * mean).sum();
        let mut starts = Vec::new();
        for share in 1..(1_usize << poles.len().min(16)) - 1 {
            let of = |is_first: bool| -> Vec<f64> {
                let own = poles.iter().enumerate().filter(|(index, _)| (share >> index & 1 == 1) == is_first);
                own.fold(vec![1.0], |polynomial, (_, pole)| times(&polynomial, *pole))
            };
            let (before, after) = (of(true), of(false));
            let states = before.len() - 1;
            let mut theta = before[1..].to_vec();
            for gain in &gains {
                let mut b = vec![0.0; states];
                b[0] = gain / first * before.iter().sum::<f64>();
                theta.extend(b);
            }
            theta.extend(self.direct().map(|_| 0.0));
            let mut filter = Machine::new(states, self.delays.len(), Vec::new());
            self.first_system(&mut filter, states, states);
            let z = arguments(&filter, &theta, runs);
            let Some(curves) = z.and_then(|z| self.curves(vec![z])) else { continue };
            theta.extend(&after[1..]);
            let mut q = vec![0.0; after.len() - 1];
            q[0] = after.iter().sum();
            theta.extend(q);
            theta.push(0.0);
            theta.extend(curves[0].like(|z| first * (z - rest) + level));
            starts.push(Start { machine: self.between(states, curves), theta });
            if starts.len() == MOST_SHARES {
                break;
            }
        }
        starts
    }
}

/// A polynomial in q^-1 times the one of a pole, and of its conjugate.
fn times(polynomial: &[f64], pole: Complex<f64>) -> Vec<f64> {
    let factor =
        if pole.im == 0.0 { vec![1.0, -pole.re] } else { vec![1.0, -2.0 * pole.re, pole.norm_sqr()] };
    let mut product = vec![0.0; polynomial.len() + factor.len() - 1];
    for (i, a) in polynomial.iter().enumerate() {
        for (j, b) in factor.iter().enumerate() {
            product[i + j] += a * b;
        }
    }
    product
}

/// What a filter gives in all rows; none where it grows without end.
fn arguments(filter: &Machine, theta: &[f64], runs: &[Run]) -> Option<Vec<f64>> {
    let mut all = Vec::new();
    let start = vec![0.0; filter.states];
    let is_bounded = runs.iter().all(|run| filter.run(theta, &start, run, |_, _, _, z| all.push(z)));
    is_bounded.then_some(all)
}

/// -f in the first column of these states, ones above the diagonal.
fn companion(machine: &mut Machine, states: std::ops::Range<usize>, letter: &str) {
    for (index, state) in states.clone().enumerate() {
        machine.is_parameter(state, states.start, -1.0, format!("{letter}{}", index + 1));
        if state + 1 < states.end {
            machine.is_one(state, state + 1);
        }
    }
}

fn column(
    machine: &mut Machine,
    states: std::ops::Range<usize>,
    column: usize,
    name: &impl Fn(&str) -> String,
) {
    for (index, state) in states.enumerate() {
        machine.is_parameter(state, column, 1.0, name(&(index + 1).to_string()));
    }
}

/// Names such as b1, or b1_2 for the second of several inputs.
fn numbered(letter: &str, input: usize, inputs: usize) -> impl Fn(&str) -> String {
    let end = if inputs > 1 { format!("_{}", input + 1) } else { String::new() };
    let letter = letter.to_owned();
    move |number| format!("{letter}{number}{end}")
}
