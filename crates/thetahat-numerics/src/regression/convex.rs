//! Convex programs in a few variables, solved by an interior point method and then made exact on their active rows.
//!
//! ```text
//! minimise  x'H x / 2 + g'x + sum_k w_k |f_k - F_k x|   subject to   E x = h,  C x <= d
//! ```
//!
//! with H positive semidefinite (Goulart and Chen, Clarabel: an interior-point solver for conic programs with quadratic
//! objectives, 2024). An interior point ends close to the optimum, not on it: 1e-9 or so. Which rows hold with equality
//! there is seen from their multipliers: the product of a slack and its multiplier tends to zero, and one of the two
//! stays. With these rows as equations the optimum solves a linear system, to rounding. This is the polishing of
//! Stellato, Banjac, Goulart, Bemporad and Boyd, OSQP, Mathematical Programming Computation 12 (2020), section 4. It is
//! taken if it is as feasible as the interior point and its value no higher.
//!
//! The solver runs in one thread: the same bits whatever the number of threads.

mod fit;
mod limit;
mod samples;

use std::fmt;
use std::str::FromStr;

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolution, DefaultSolver, IPSolver, SolverStatus, SupportedConeT,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::{DMatrix, DVector};

use crate::Error;
pub use fit::{Fitting, Solved, peak};
pub use limit::Limit;

/// Duality gap and residuals that the interior point method is to reach, on rows of unit size.
const TOLERANCE: f64 = 1e-11;
/// What counts as reached where rounding stops it earlier.
const REDUCED_TOLERANCE: f64 = 1e-7;
/// What the solver adds to the diagonal of its linear systems; the next one where that does not give an exact optimum.
/// Nearly parallel rows want little of it, others much.
const REGULARISATIONS: [f64; 3] = [1e-8, 1e-11, 1e-14];
/// How much larger than the slack a multiplier must be for its row to be active; one try each.
const THRESHOLDS: [f64; 3] = [1.0, 1e3, 1e-3];
/// What is left of a row of unit norm that depends on others, at most.
const DEPENDENT: f64 = 1e-9;
/// By how much polishing may raise the value, relative to it: the gap that the interior point has left.
const VALUE_GAP: f64 = 1e-8;
/// By how much polishing may miss a row, where active rows are nearly parallel.
const FEASIBLE: f64 = 1e-10;
/// What rounding makes of a slack of zero, in units of its terms.
const ROW_ROUNDING: f64 = 1e-13;

/// What a fit makes small.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
pub enum Norm {
    /// The sum of |e|: a few wild samples do not move it.
    #[serde(rename = "1")]
    One,
    /// The sum of e^2: least squares.
    #[default]
    #[serde(rename = "2")]
    Two,
    /// The largest |e|.
    #[serde(rename = "inf")]
    Infinity,
}

impl fmt::Display for Norm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::One => "1",
            Self::Two => "2",
            Self::Infinity => "inf",
        })
    }
}

impl FromStr for Norm {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        match text {
            "1" => Ok(Self::One),
            "2" => Ok(Self::Two),
            "inf" => Ok(Self::Infinity),
            _ => Err(Error::argument("norm", format!("'{text}' is none of 1, 2 and inf"))),
        }
    }
}

/// `coefficients' x` against `right`.
#[derive(Debug, Clone)]
struct Row {
    coefficients: DVector<f64>,
    right: f64,
}

impl Row {
    /// `right - coefficients' x`.
    fn slack(&self, x: &DVector<f64>) -> f64 {
        self.right - self.coefficients.dot(x)
    }

    /// What rounding may make of a slack of zero.
    fn rounding(&self, x: &DVector<f64>) -> f64 {
        let terms = self.coefficients.iter().zip(x.iter()).map(|(c, x)| (c * x).abs());
        ROW_ROUNDING * (1.0 + self.right.abs() + terms.sum::<f64>())
    }
}

/// A convex program as at the top of this file. Its rows should have about unit size.
#[derive(Debug, Clone)]
struct Program {
    /// H.
    hessian: DMatrix<f64>,
    /// g.
    gradient: DVector<f64>,
    /// The weights w_k > 0, and f_k - F_k x.
    deviations: Vec<(f64, Row)>,
    /// E x = h.
    equal: Vec<Row>,
    /// C x <= d.
    below: Vec<Row>,
}

/// The optimum of a program.
#[derive(Debug, Clone)]
struct Optimum {
    x: DVector<f64>,
    /// Steps of the interior point method.
    iterations: u32,
}

/// Why a program has no optimum.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Failure {
    /// No x meets the constraints.
    Infeasible,
    /// The solver did not come to an end: its own word for it.
    Unsolved(String),
}

/// Where the interior point method ended.
struct Interior {
    x: DVector<f64>,
    /// How far the value there may lie below the optimum, as the constraints are met nearly only.
    deficit: f64,
    /// For each deviation the smaller one of the multipliers of its two parts, over its weight and that part.
    deviations: Vec<f64>,
    /// For each row of `below` its multiplier, over its slack.
    below: Vec<f64>,
}

impl Program {
    /// A program of `size` variables without rows.
    fn new(size: usize) -> Self {
        Self {
            hessian: DMatrix::zeros(size, size),
            gradient: DVector::zeros(size),
            deviations: Vec::new(),
            equal: Vec::new(),
            below: Vec::new(),
        }
    }

    /// The optimum: exact to rounding where the active rows can be told, else the interior point.
    ///
    /// Cost: some 10 to 30 factorisations of (number of rows) n^2 flops for n variables.
    fn solve(&self) -> Result<Optimum, Failure> {
        let mut iterations = 0;
        let mut rough = None;
        let mut failure = Failure::Unsolved(String::new());
        for regularisation in REGULARISATIONS {
            let solution = self.interior(regularisation)?;
            iterations += solution.iterations;
            match solution.status {
                SolverStatus::Solved | SolverStatus::AlmostSolved => {
                    let interior = self.read(&solution);
                    let polished = THRESHOLDS.iter().find_map(|level| self.polished(&interior, *level));
                    if let Some(x) = polished {
                        return Ok(Optimum { x, iterations });
                    }
                    rough.get_or_insert(interior.x);
                }
                SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => {
                    failure = Failure::Infeasible;
                }
                other => failure = Failure::Unsolved(format!("{other:?}")),
            }
        }
        rough.map(|x| Optimum { x, iterations }).ok_or(failure)
    }

    /// What the program minimises.
    fn value(&self, x: &DVector<f64>) -> f64 {
        let deviations = self.deviations.iter().map(|(weight, row)| weight * row.slack(x).abs());
        x.dot(&(&self.hessian * x)) / 2.0 + self.gradient.dot(x) + deviations.sum::<f64>()
    }

    /// By how much x fails the constraints, over what rounding explains.
    fn violation(&self, x: &DVector<f64>) -> f64 {
        let equal = self.equal.iter().map(|row| row.slack(x).abs() - row.rounding(x));
        let below = self.below.iter().map(|row| -row.slack(x) - row.rounding(x));
        equal.chain(below).fold(0.0, f64::max)
    }

    /// Runs the solver. Its variables are x, and the positive and the negative parts of the deviations:
    /// `F x + p - m = f`, `p >= 0`, `m >= 0`. Its rows are E, F, C and these parts.
    fn interior(&self, regularisation: f64) -> Result<DefaultSolution<f64>, Failure> {
        let (size, parts) = (self.gradient.len(), self.deviations.len());
        let (zeros, signs) = (self.equal.len() + parts, self.below.len() + 2 * parts);
        let variables = size + 2 * parts;

        let mut quadratic = Columns::new();
        for column in 0..size {
            // The solver wants the upper triangle.
            quadratic.add((0..=column).map(|row| (row, self.hessian[(row, column)])));
        }
        (size..variables).for_each(|_| quadratic.add(std::iter::empty()));
        let rows: Vec<&Row> =
            self.equal.iter().chain(self.deviations.iter().map(|(_, row)| row)).chain(&self.below).collect();
        let mut linear = Columns::new();
        for column in 0..size {
            linear.add(rows.iter().map(|row| row.coefficients[column]).enumerate());
        }
        for part in 0..2 * parts {
            let sign = if part < parts { 1.0 } else { -1.0 };
            linear.add([(self.equal.len() + part % parts, sign), (rows.len() + part, -1.0)].into_iter());
        }
        let mut costs: Vec<f64> = self.gradient.iter().copied().collect();
        costs.extend(self.deviations.iter().chain(&self.deviations).map(|(weight, _)| *weight));
        let mut right: Vec<f64> = rows.iter().map(|row| row.right).collect();
        right.resize(zeros + signs, 0.0);
        let mut solver = DefaultSolver::new(
            &quadratic.matrix(variables),
            &costs,
            &linear.matrix(zeros + signs),
            &right,
            &[SupportedConeT::ZeroConeT(zeros), SupportedConeT::NonnegativeConeT(signs)],
            settings(regularisation),
        )
        .map_err(|error| Failure::Unsolved(error.to_string()))?;
        solver.solve();
        Ok(solver.solution)
    }

    /// What the solver found.
    fn read(&self, solution: &DefaultSolution<f64>) -> Interior {
        let parts = self.deviations.len();
        let zeros = self.equal.len() + parts;
        let (slacks, multipliers) = (&solution.s[zeros..], &solution.z[zeros..]);
        let ratio = |at: usize| multipliers[at] / slacks[at].max(f64::MIN_POSITIVE);
        let first = self.below.len();
        // At a deviation of zero both parts have a multiplier above 0.
        let smaller = |k: usize| ratio(first + k).min(ratio(first + parts + k));
        let x = DVector::from_column_slice(&solution.x[..self.gradient.len()]);
        let equal = self.equal.iter().zip(&solution.z).map(|(row, z)| (z * row.slack(&x)).abs());
        let below = self.below.iter().zip(multipliers).map(|(row, z)| z * (-row.slack(&x)).max(0.0));
        Interior {
            deficit: equal.chain(below).sum(),
            deviations: self.deviations.iter().enumerate().map(|(k, (w, _))| smaller(k) / w).collect(),
            below: (0..first).map(ratio).collect(),
            x,
        }
    }

    /// The optimum among the points at which the rows that seem active hold with equality; none if it is worse than the
    /// interior point.
    fn polished(&self, interior: &Interior, level: f64) -> Option<DVector<f64>> {
        let (zero, other): (Vec<_>, Vec<_>) =
            self.deviations.iter().zip(&interior.deviations).partition(|(_, strength)| **strength > level);
        let below = self.below.iter().zip(&interior.below).filter(|(_, strength)| **strength > level);
        let mut candidates: Vec<(&Row, &f64)> =
            zero.into_iter().map(|((_, row), strength)| (row, strength)).chain(below).collect();
        // The surest first; the sort keeps the order of equals.
        candidates.sort_by(|(_, a), (_, b)| b.total_cmp(a));
        let active = self.equal.iter().chain(candidates.into_iter().map(|(row, _)| row));
        let subspace = Subspace::new(active, self.gradient.len());

        // Deviations that are not zero keep their signs: then the value is quadratic.
        let mut gradient = self.gradient.clone();
        for ((weight, row), _) in other {
            gradient.axpy(-weight * row.slack(&interior.x).signum(), &row.coefficients, 1.0);
        }
        let mut x = subspace.nearest(&interior.x);
        let free = subspace.complement();
        let curvature = free.tr_mul(&(&self.hessian * &free));
        // Without curvature any point is as good as that one.
        if let Some(factor) = curvature.cholesky().filter(|_| free.ncols() > 0) {
            // Twice: the second step corrects the rounding of the first.
            for _ in 0..2 {
                x -= &free * factor.solve(&free.tr_mul(&(&self.hessian * &x + &gradient)));
            }
            x = subspace.nearest(&x);
        }
        let (value, reached) = (self.value(&x), self.value(&interior.x));
        let low = value <= reached + interior.deficit + VALUE_GAP * (1.0 + reached.abs());
        (low && self.violation(&x) <= self.violation(&interior.x).max(FEASIBLE)).then_some(x)
    }
}

/// The points that meet some rows with equality.
struct Subspace<'p> {
    rows: Vec<&'p Row>,
    /// An orthonormal basis of the rows.
    basis: Vec<DVector<f64>>,
    /// Each row in that basis: a lower triangle.
    triangle: Vec<Vec<f64>>,
    size: usize,
}

impl<'p> Subspace<'p> {
    /// Of the rows those that do not depend on ones before them.
    fn new(rows: impl Iterator<Item = &'p Row>, size: usize) -> Self {
        let mut subspace = Self { rows: Vec::new(), basis: Vec::new(), triangle: Vec::new(), size };
        for row in rows {
            if subspace.basis.len() == size {
                break;
            }
            let (rest, weights) = without(&subspace.basis, &row.coefficients);
            let left = rest.norm();
            if left > DEPENDENT * row.coefficients.norm() {
                subspace.basis.push(rest.unscale(left));
                subspace.triangle.push([weights, vec![left]].concat());
                subspace.rows.push(row);
            }
        }
        subspace
    }

    /// The point that is nearest to `x`.
    fn nearest(&self, x: &DVector<f64>) -> DVector<f64> {
        let mut x = x.clone();
        // Twice: the second step corrects the rounding of the first.
        for _ in 0..2 {
            let mut steps: Vec<f64> = Vec::with_capacity(self.rows.len());
            for (row, weights) in self.rows.iter().zip(&self.triangle) {
                let done: f64 = steps.iter().zip(weights).map(|(step, weight)| step * weight).sum();
                steps.push((row.slack(&x) - done) / weights[steps.len()]);
            }
            for (step, direction) in steps.iter().zip(&self.basis) {
                x.axpy(*step, direction, 1.0);
            }
        }
        x
    }

    /// An orthonormal basis of the directions along which the rows do not change, column by column.
    fn complement(&self) -> DMatrix<f64> {
        let mut basis = self.basis.clone();
        while basis.len() < self.size {
            // The axis of which the most is left: 1/n of its squared length or more.
            let left = |axis: &usize| 1.0 - basis.iter().map(|b| b[*axis] * b[*axis]).sum::<f64>();
            let Some(axis) = (0..self.size).max_by(|a, b| left(a).total_cmp(&left(b))) else { break };
            let unit = DVector::from_fn(self.size, |index, _| if index == axis { 1.0 } else { 0.0 });
            basis.push(without(&basis, &unit).0.normalize());
        }
        DMatrix::from_fn(self.size, self.size - self.basis.len(), |i, j| basis[self.basis.len() + j][i])
    }
}

/// What an orthonormal basis leaves of a vector, and what it takes of it: Gram-Schmidt, twice (Björck, Numerical
/// Methods for Least Squares Problems, 1996, section 2.4).
fn without(basis: &[DVector<f64>], vector: &DVector<f64>) -> (DVector<f64>, Vec<f64>) {
    let mut rest = vector.clone();
    let mut weights = vec![0.0; basis.len()];
    for _ in 0..2 {
        for (weight, direction) in weights.iter_mut().zip(basis) {
            let more = rest.dot(direction);
            *weight += more;
            rest.axpy(-more, direction, 1.0);
        }
    }
    (rest, weights)
}

/// A sparse matrix as it grows, column by column.
struct Columns {
    starts: Vec<usize>,
    rows: Vec<usize>,
    values: Vec<f64>,
}

impl Columns {
    fn new() -> Self {
        Self { starts: vec![0], rows: Vec::new(), values: Vec::new() }
    }

    /// Adds a column: its rows, rising, and values. Zeros are left out.
    fn add(&mut self, entries: impl Iterator<Item = (usize, f64)>) {
        for (row, value) in entries.filter(|(_, value)| *value != 0.0) {
            self.rows.push(row);
            self.values.push(value);
        }
        self.starts.push(self.rows.len());
    }

    fn matrix(self, rows: usize) -> CscMatrix<f64> {
        CscMatrix::new(rows, self.starts.len() - 1, self.starts, self.rows, self.values)
    }
}

fn settings(regularisation: f64) -> DefaultSettings<f64> {
    DefaultSettings {
        verbose: false,
        tol_gap_abs: TOLERANCE,
        tol_gap_rel: TOLERANCE,
        tol_feas: TOLERANCE,
        reduced_tol_gap_abs: REDUCED_TOLERANCE,
        reduced_tol_gap_rel: REDUCED_TOLERANCE,
        reduced_tol_feas: REDUCED_TOLERANCE,
        static_regularization_constant: regularisation,
        max_threads: 1,
        direct_solve_method: "qdldl".to_owned(),
        ..DefaultSettings::default()
    }
}
