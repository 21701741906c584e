//! Transfer functions to start a search from: refined instrumental variables for continuous time (SRIVC).
//!
//! ```text
//! A(s) x = B(s) u,   y = x + e,   A(s) = s^n + a_(n-1) s^(n-1) + … + a_0
//! ```
//!
//! Divided by the A of the last round, all derivatives are those of filtered signals, and the equation is linear in
//! what is looked for:
//!
//! ```text
//! y_n = -sum a_k y_k + sum b_k u_k + level + slope t + v,   y_k = s^k/A(s) y,   u_k = s^k/A(s) u
//! ```
//!
//! Its errors v are no noise that least squares could forget, so the instruments are the same signals of a free run of
//! the last round. At the end, sum of the instruments times the errors is zero, which is the condition for the least
//! output error (Young and Jakeman, Refined instrumental variable methods of recursive time-series analysis, part III,
//! Int. J. Control 31, 1980; Garnier and Wang, eds., Identification of Continuous-time Models from Sampled Data, 2008,
//! section 4.5). The first round divides by (s + rate)^n for several rates, and its instruments are the signals
//! themselves.
//!
//! Inputs are held from row to row and the filters see that exactly; outputs move along straight lines. Of a measured
//! frequency response the filtered output is (j omega)^k/A(j omega) times each point, which makes the rounds those of
//! Sanathanan and Koerner (IEEE Trans. Automatic Control 8, 1963) with instruments. Several inputs are fitted to what
//! the others leave, in turn.

use thetahat_core::nalgebra::{Complex, DMatrix, DVector};
use thetahat_numerics::optimize::Deadline;
use thetahat_numerics::regression::{Span, product, sum_of_squares};

use super::objective::{ProcessObjective, spread};
use crate::model::{Parts, ProcessStructure, polynomial};

/// The number of rates of the first filters, and of dead times, from the shortest to the longest that are evaluated.
const RATES: usize = 8;
const DEAD_TIMES: usize = 6;
/// The fastest rate times the shortest step, and the slowest times the longest log.
const FASTEST: f64 = 1.0;
const SLOWEST: f64 = 2.0;
/// Rounds of all first filters, and of the best ones.
const FIRST_ROUNDS: usize = 2;
const ROUNDS: usize = 30;
const BEST: usize = 3;
/// A round that moves no coefficient by more than this fraction is the last.
const SETTLED: f64 = 1e-6;
/// How often each of several inputs is fitted to what the others leave.
const SWEEPS: usize = 4;

/// A transfer function and the squared errors that it leaves.
#[derive(Debug, Clone)]
struct Candidate {
    parts: Parts<f64>,
    cost: f64,
}

/// Points to search from, the best first: ln a of each input from a_(n-1) on, and its dead time if it is searched for.
pub(super) fn points(
    objective: &ProcessObjective<'_>,
    structures: &[ProcessStructure],
    deadline: Deadline,
) -> Vec<Vec<f64>> {
    let mut chosen: Vec<Option<Parts<f64>>> = vec![None; structures.len()];
    let mut last = Vec::new();
    let sweeps = if structures.len() > 1 && !objective.is_of_points() { SWEEPS } else { 1 };
    for _ in 0..sweeps {
        for (input, structure) in structures.iter().enumerate() {
            let others = structures.iter().zip(&chosen).enumerate().filter(|(other, _)| *other != input);
            let others: Vec<_> = others
                .filter_map(|(other, (structure, parts))| Some((other, structure, parts.as_ref()?)))
                .collect();
            let target = objective.left_by(input, &others);
            last = one_input(objective, (input, structure), &target, deadline);
            if let Some(best) = last.first() {
                chosen[input] = Some(best.parts.clone());
            }
        }
    }
    let of = |parts: &[Parts<f64>]| -> Vec<f64> {
        let each = parts.iter().zip(structures).flat_map(|(parts, structure)| {
            let dead_time = structure.has_dead_time().then_some(parts.dead_time);
            parts.shape.iter().map(|coefficient| coefficient.ln()).chain(dead_time)
        });
        each.collect()
    };
    let Some(parts) = chosen.into_iter().collect::<Option<Vec<_>>>() else { return Vec::new() };
    let (input, mut parts) = (structures.len() - 1, parts);
    let ways = last.into_iter().map(|candidate| {
        parts[input] = candidate.parts;
        of(&parts)
    });
    ways.collect()
}

/// The best few for one input.
fn one_input(
    objective: &ProcessObjective<'_>,
    (input, structure): (usize, &ProcessStructure),
    target: &[Vec<f64>],
    deadline: Deadline,
) -> Vec<Candidate> {
    let (short, long) = (objective.shortest(), objective.longest());
    let own = Rounds { objective, input, structure, target };
    let dead_times =
        if structure.has_dead_time() { objective.dead_times(input, DEAD_TIMES) } else { vec![0.0] };
    let mut tried: Vec<Candidate> = Vec::new();
    for rate in spread(SLOWEST / long, FASTEST / short, RATES) {
        for &dead_time in &dead_times {
            if deadline.is_over() && !tried.is_empty() {
                break;
            }
            let first = with_poles(&vec![Complex::new(-rate, 0.0); structure.lags]);
            tried.extend(own.run(first, dead_time, None, FIRST_ROUNDS));
        }
    }
    tried.sort_by(|left, right| left.cost.total_cmp(&right.cost));
    tried.truncate(BEST);
    for candidate in &mut tried {
        if deadline.is_over() {
            break;
        }
        let start = candidate.parts.clone();
        let better = own.run(start.shape.clone(), start.dead_time, Some(start), ROUNDS);
        if let Some(better) = better.filter(|better| better.cost < candidate.cost) {
            *candidate = better;
        }
    }
    tried.sort_by(|left, right| left.cost.total_cmp(&right.cost));
    tried
}

/// Rounds for one input, of the output that the others leave.
struct Rounds<'a> {
    objective: &'a ProcessObjective<'a>,
    input: usize,
    structure: &'a ProcessStructure,
    target: &'a [Vec<f64>],
}

impl Rounds<'_> {
    /// The best of some rounds from the filter 1/A(s), and from a free run for the instruments if there is one.
    fn run(
        &self,
        mut shape: Vec<f64>,
        dead_time: f64,
        mut model: Option<Parts<f64>>,
        rounds: usize,
    ) -> Option<Candidate> {
        let mut best: Option<Candidate> = None;
        for _ in 0..rounds {
            let next = self.round(&shape, dead_time, model.as_ref())?;
            let Some(found) = self.fitted(&next, dead_time) else { break };
            let moved = shape.iter().zip(&next).map(|(old, new)| (new / old - 1.0).abs());
            let settled = moved.fold(0.0, f64::max) < SETTLED;
            model = Some(found.parts.clone());
            if best.as_ref().is_none_or(|best| found.cost < best.cost) {
                best = Some(found);
            }
            if settled {
                break;
            }
            shape = next;
        }
        best
    }

    /// One round: the coefficients of A, with its roots on the left.
    fn round(&self, shape: &[f64], dead_time: f64, model: Option<&Parts<f64>>) -> Option<Vec<f64>> {
        let objective = self.objective;
        let every = self.structure.derivatives(self.structure.integrates());
        let parts = |weights: Vec<f64>| Parts { weights, shape: shape.to_vec(), dead_time };
        let driven = objective.columns_of(self.input, &every, &parts(Vec::new()));
        let mut outputs = objective.filtered(self.input, shape, self.target);
        let highest = outputs.pop()?;
        let beside: Vec<Vec<f64>> =
            driven.into_iter().take(self.structure.columns()).chain(objective.offset_columns()).collect();
        let instruments = match model {
            None => outputs.clone(),
            Some(model) => {
                let run = objective.responses_of(self.input, self.structure, model);
                let mut own = objective.filtered(self.input, shape, &run);
                own.pop();
                own
            }
        };
        let regressors: Vec<&Vec<f64>> = beside.iter().chain(&outputs).collect();
        let instruments: Vec<&Vec<f64>> = beside.iter().chain(&instruments).collect();
        let found = solved(&instruments, &regressors, &highest)?;
        // y_k stands with -a_k; a_(n-1) comes first in a shape.
        let shape: Vec<f64> = found[beside.len()..].iter().rev().map(|weight| -weight).collect();
        reflected(&shape)
    }

    /// The best weights for these poles.
    fn fitted(&self, shape: &[f64], dead_time: f64) -> Option<Candidate> {
        let objective = self.objective;
        let mut parts = Parts { weights: Vec::new(), shape: shape.to_vec(), dead_time };
        let mut span = Span::default();
        let columns = objective.columns_of(self.input, self.structure, &parts);
        let count = columns.len();
        for column in columns.into_iter().chain(objective.offset_columns()) {
            span.add(column);
        }
        let mut left = objective.seen_of(self.input, self.target);
        let has = span.take_from(&mut left);
        parts.weights = span.weights(&has);
        parts.weights.truncate(count);
        let cost = sum_of_squares(&left);
        (cost.is_finite() && parts.weights.iter().all(|weight| weight.is_finite()))
            .then_some(Candidate { parts, cost })
    }
}

/// theta of Z' Phi theta = Z' y, columns of unit norm; none where that is singular.
fn solved(instruments: &[&Vec<f64>], regressors: &[&Vec<f64>], target: &[f64]) -> Option<Vec<f64>> {
    let norm = |column: &Vec<f64>| sum_of_squares(column).sqrt();
    let (left, right): (Vec<f64>, Vec<f64>) =
        (instruments.iter().map(|own| norm(own)).collect(), regressors.iter().map(|own| norm(own)).collect());
    let size = regressors.len();
    let matrix = DMatrix::from_fn(size, size, |row, column| {
        product(instruments[row], regressors[column]) / (left[row] * right[column])
    });
    let vector = DVector::from_fn(size, |row, _| product(instruments[row], target) / left[row]);
    if !matrix.iter().chain(&vector).all(|value| value.is_finite()) {
        return None;
    }
    let found = matrix.lu().solve(&vector)?;
    let found: Vec<f64> = found.iter().zip(&right).map(|(weight, norm)| weight / norm).collect();
    found.iter().all(|weight| weight.is_finite()).then_some(found)
}

/// The same polynomial with its roots mirrored to the left of the imaginary axis; none where one lies on it.
fn reflected(shape: &[f64]) -> Option<Vec<f64>> {
    let monic: Vec<f64> = std::iter::once(1.0).chain(shape.iter().copied()).collect();
    let roots = polynomial::roots(&monic)?;
    if roots.len() != shape.len() {
        return None;
    }
    let mirrored: Vec<Complex<f64>> =
        roots.iter().map(|root| Complex::new(-root.re.abs(), root.im)).collect();
    let found = with_poles(&mirrored);
    found.iter().all(|coefficient| coefficient.is_normal() && *coefficient > 0.0).then_some(found)
}

/// a_(n-1), …, a_0 of the polynomial with these roots.
fn with_poles(poles: &[Complex<f64>]) -> Vec<f64> {
    let mut monic = vec![Complex::new(1.0, 0.0)];
    for pole in poles {
        monic.push(Complex::new(0.0, 0.0));
        for place in (1..monic.len()).rev() {
            let before = monic[place - 1];
            monic[place] -= pole * before;
        }
    }
    monic[1..].iter().map(|coefficient| coefficient.re).collect()
}
