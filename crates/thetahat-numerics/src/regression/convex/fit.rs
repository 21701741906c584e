//! Regressions under limits: the smallest norm of the residuals, and how far parameters can go.
//!
//! With the triangular factor T of all rows (T'T = Phi'Phi, plus the rows of a ridge and of equalities), a feasible
//! point b and a unit s of the residuals, the variables are w in
//!
//! ```text
//! theta = b + s S w,   S = sqrt(N) T^-1,   e(t)/s = e_b(t)/s - q(t)'w,   q(t) = S' phi(t),   sum q q' = N I,
//! ```
//!
//! so that a program is well conditioned however near to dependent the regressors are. In w least squares is a
//! projection onto the limits (Lawson and Hanson, Solving Least Squares Problems, 1974, chapter 23). b is that
//! least-squares solution.
//!
//! Few samples matter, and only these are in the program:
//!
//! - a bound on |e|, and the largest |e|, hold p + 1 samples. The program begins with those of the largest |e_b|;
//!   samples that its optimum violates are added, until there is none (Remez 1934; Kelley 1960, the cutting-plane
//!   method).
//! - sum |e| is linear in the samples that keep their sign. Those far from zero are added up to two sums, of which the
//!   absolute values are a lower bound, and exact if no sign is wrong; samples with a wrong sign are taken out of the
//!   sum and the program is solved again (Portnoy and Koenker, The Gaussian hare and the Laplacian tortoise,
//!   Statistical Science 12 (1997), section 5). About (N p)^(2/3) samples remain.

use std::ops::RangeInclusive;

use rayon::prelude::*;
use thetahat_core::LeastSquares;
use thetahat_core::nalgebra::{DMatrix, DVector, Dyn};

mod program;

use super::limit::Limit;
use super::samples::{Samples, largest, smallest};
use super::{Failure, Norm, Program, Row, Subspace};
use crate::regression::{Lagged, Unsolved, factor_rows};
use program::Goal;

/// A parameter whose spread is this fraction of what it was without limits is held by them.
const HELD: f64 = 1e-12;
/// RMS of which products neither overflow nor lose digits.
const SAFE_SIZES: RangeInclusive<f64> = 1e-140..=1e140;
/// Rounds until the program holds all samples that it needs, at most. Each adds some.
const ROUNDS: usize = 500;
/// Samples and limits are met to this, in units of the residuals.
const MET: f64 = 1e-11;
/// Limits this near to b are in the first program, in units of the residuals.
const NEAR: f64 = 1e-6;
/// Bounds closer than this tolerance, in units of the data, count as equal.
const POSSIBLE: f64 = 1e-9;
/// From this part of the samples on a ridge is strong.
const STRONG: f64 = 1e-3;
/// Up to this many samples all are in the program of the sum of |e|.
const ALL: usize = 1000;
/// The program of sum |e| begins with this many times (N p)^(2/3) samples.
const FREE: f64 = 2.0;
/// If more than this part of them had a wrong sign, they are chosen again.
const WRONG: f64 = 0.1;

/// A step of this part of what is allowed goes as far as it may.
const NEARLY: f64 = 1.0 - 1e-6;

/// A regression under limits, ready to be solved in any norm.
#[derive(Debug)]
pub struct Fitting<'a> {
    samples: Samples<'a>,
    limits: &'a [Limit],
    ridge: f64,
    /// R of the regressors alone.
    regressors: DMatrix<f64>,
    /// The RMS of each regressor.
    sizes: DVector<f64>,
    /// The RMS of y.
    target: f64,
    /// T.
    triangle: DMatrix<f64>,
    /// S.
    spread: DMatrix<f64>,
    /// Least squares without the inequalities.
    unlimited: DVector<f64>,
    condition: f64,
    /// For each limit `S'c`, normed, and its norm.
    directions: Vec<(DVector<f64>, f64)>,
}

/// A solved regression.
#[derive(Debug, Clone)]
pub struct Solved {
    /// theta-hat.
    pub parameters: DVector<f64>,
    /// Steps of the interior point method, over all programs.
    pub iterations: u32,
}

/// Where w is counted from, and its unit.
struct Frame {
    base: DVector<f64>,
    unit: f64,
    /// e_b.
    residuals: Vec<f64>,
}

/// The samples and limits in a program: number or index, and on which side.
#[derive(Default)]
struct Working {
    limits: Vec<(usize, bool)>,
    samples: Vec<(usize, bool)>,
    /// Whether the largest |e| is near its bound, which only a ridge can bring about.
    bounded: bool,
    /// For the sum of |e|: the sign of each sample that is in a sum, 0 of those that are not.
    signs: Option<Vec<f64>>,
}

impl<'a> Fitting<'a> {
    /// Factors the rows of the regression, `ridge` rows (see [`Fitting::fit`]) and the equations among the limits.
    ///
    /// # Errors
    /// [`Unsolved`] names the parameters that all these leave open.
    pub fn new(lagged: &'a Lagged<'a>, limits: &'a [Limit], ridge: f64) -> Result<Self, Unsolved> {
        let factor = lagged.factor().map_err(|_| Unsolved::Range)?;
        Self::of(Samples::of_lagged(lagged), factor, limits, ridge)
    }

    /// The same for a regression whose regressors are columns of the target's length.
    ///
    /// # Errors
    /// As for [`Fitting::new`].
    pub fn of_columns(
        target: &'a [f64],
        columns: &'a [Vec<f64>],
        limits: &'a [Limit],
    ) -> Result<Self, Unsolved> {
        let entry = |row: usize, column: usize| columns.get(column).map_or(target[row], |column| column[row]);
        let factor = factor_rows(0..target.len(), entry, columns.len() + 1).map_err(|_| Unsolved::Range)?;
        Self::of(Samples::of_columns(target, columns), factor, limits, 0.0)
    }

    fn of(
        samples: Samples<'a>,
        mut factor: LeastSquares<f64, Dyn>,
        limits: &'a [Limit],
        ridge: f64,
    ) -> Result<Self, Unsolved> {
        let regressors = factor.factor();
        let root = (samples.count() as f64).sqrt();
        let target = factor.rotated_output().norm().hypot(factor.residual_norm()) / root;
        let sizes = DVector::from_iterator(
            regressors.ncols(),
            regressors.column_iter().map(|column| column.norm() / root),
        );
        let safe = |size: &f64, peak: f64| SAFE_SIZES.contains(size) || peak == 0.0;
        let peaks = regressors.column_iter().map(|column| column.amax());
        let target_peak = factor.rotated_output().amax().max(factor.residual_norm());
        if !sizes.iter().zip(peaks).all(|(size, peak)| safe(size, peak)) || !safe(&target, target_peak) {
            return Err(Unsolved::Range);
        }
        add_rows(&mut factor, limits, ridge, &sizes, root).map_err(|_| Unsolved::Range)?;
        let dependent: Vec<usize> = factor.rank().dependent().collect();
        if !dependent.is_empty() {
            return Err(Unsolved::Deficient(dependent));
        }
        let unlimited = factor.solve().map_err(|_| Unsolved::Range)?.parameters().clone();
        let triangle = factor.factor();
        let spread = triangle
            .solve_upper_triangular(&DMatrix::identity(sizes.len(), sizes.len()))
            .ok_or(Unsolved::Range)?
            * root;
        let directions = limits.iter().map(|limit| {
            let direction = spread.tr_mul(&limit.coefficients);
            let norm = direction.norm();
            (direction.unscale(norm), norm)
        });
        let directions: Vec<_> = directions.collect();
        if !directions.iter().all(|(_, norm)| norm.is_normal()) {
            return Err(Unsolved::Range);
        }
        let condition = factor.condition();
        Ok(Self {
            samples,
            limits,
            ridge,
            regressors,
            sizes,
            target,
            triangle,
            spread,
            unlimited,
            condition,
            directions,
        })
    }

    /// The condition number of the rows, their columns scaled to unit norm.
    pub fn condition(&self) -> f64 {
        self.condition
    }

    /// e over the samples that count.
    pub fn residuals(&self, parameters: &DVector<f64>) -> Vec<f64> {
        self.samples.residuals(parameters)
    }

    /// What rounding may add to a residual.
    pub fn rounding(&self, parameters: &DVector<f64>) -> f64 {
        self.samples.rounding(parameters)
    }

    /// How far `coefficients' theta` moves when the predictions move by `unit` in their RMS, at most.
    pub fn reach(&self, limit: usize, unit: f64) -> f64 {
        self.directions[limit].1 * unit
    }

    /// Whether there are parameters that meet some limits.
    ///
    /// Bounds of single parameters are compared exactly. Else all rows are loosened by t times (1 + their right side),
    /// in units in which regressors and y have an RMS of 1, and the smallest t is found: 0 if they are possible.
    pub fn possible(&self, limits: &[Limit]) -> Result<bool, Failure> {
        let size = self.sizes.len();
        let mut ends = vec![(f64::NEG_INFINITY, f64::INFINITY); size];
        let mut single = true;
        for limit in limits {
            let mut entries = limit.coefficients.iter().enumerate().filter(|(_, c)| **c != 0.0);
            if let (Some((index, &factor)), None) = (entries.next(), entries.next()) {
                let (low, high) = (limit.low / factor, limit.high / factor);
                let (low, high) = if factor > 0.0 { (low, high) } else { (high, low) };
                ends[index] = (ends[index].0.max(low), ends[index].1.min(high));
            } else {
                single = false;
            }
        }
        if single || ends.iter().any(|(low, high)| low > high) {
            return Ok(ends.iter().all(|(low, high)| low <= high));
        }
        let mut program = Program::new(size + 1);
        program.gradient[size] = 1.0;
        let mut least = DVector::zeros(size + 1);
        least[size] = -1.0;
        program.below.push(Row { coefficients: least, right: 0.0 });
        for limit in limits {
            let sized = limit
                .coefficients
                .zip_map(&self.sizes, |c, size| if size > 0.0 { c * self.target() / size } else { c });
            let norm = sized.norm();
            for (sign, end) in [(1.0, limit.high), (-1.0, limit.low)] {
                if end.is_finite() {
                    let right = sign * end / norm;
                    let loose = 1.0 + right.abs();
                    let mut coefficients = (&sized * (sign / norm / loose)).resize_vertically(size + 1, 0.0);
                    coefficients[size] = -1.0;
                    program.below.push(Row { coefficients, right: right / loose });
                }
            }
        }
        Ok(program.solve()?.x[size] <= POSSIBLE)
    }

    /// The parameters of the smallest norm under the limits and, with a bound, |e(t)| <= bound. After the bound stand
    /// parameters that meet all these.
    ///
    /// ```text
    /// 2: sum e^2 + k sum (r theta)^2    1: sum |e| + k/r_y sum (r theta)^2    inf: N max |e| + k/r_y sum (r theta)^2
    /// ```
    ///
    /// with the ridge k, the RMS r of each parameter's regressor and the RMS r_y of y.
    pub fn fit(&self, norm: Norm, bound: Option<(f64, &DVector<f64>)>) -> Result<Solved, Failure> {
        let mut central = self.least_squares()?;
        let mut residuals = self.samples.residuals(&central.parameters);
        let mut least_unit = 0.0;
        match bound {
            Some((bound, feasible)) if peak(&residuals) > bound => {
                central.parameters.copy_from(feasible);
                residuals = self.samples.residuals(feasible);
                least_unit = bound;
            }
            _ if norm == Norm::Two => return Ok(central),
            _ => {}
        }
        let bound = bound.map(|(bound, _)| bound);
        let rounding = self.samples.rounding(&central.parameters);
        let unit = root_mean_square(&residuals).max(rounding).max(least_unit);
        let unit = if unit > 0.0 { unit } else { 1.0 };
        let frame = Frame { base: central.parameters, unit, residuals };
        let working = self.first(&frame, norm);
        let radius = self.radius(&frame, &working, norm);
        let solved = self.solved(&frame, working, norm, bound, radius)?;
        Ok(Solved { iterations: central.iterations + solved.iterations, ..solved })
    }

    /// The parameters of the smallest norm, 1 or inf, under the limits and close to zero: |w| is at most `radius` in
    /// each entry, in units of the RMS of y. A parameter moves the residuals by that RMS, in theirs, where its w is 1.
    ///
    /// # Errors
    /// [`Failure::Unsolved`].
    pub fn step(&self, norm: Norm, radius: f64) -> Result<Solved, Failure> {
        let base = DVector::zeros(self.sizes.len());
        let residuals = self.samples.residuals(&base);
        let frame = Frame { base, unit: self.target(), residuals };
        self.solved(&frame, self.first(&frame, norm), norm, None, Some(radius))
    }

    /// Whether a step goes as far as `radius` allows.
    pub fn reaches(&self, step: &DVector<f64>, radius: f64) -> bool {
        let way = &self.triangle * step / ((self.samples.count() as f64).sqrt() * self.target());
        way.amax() > radius * NEARLY
    }

    /// The optimum of the program in w, to which samples are added until it holds all that it needs.
    fn solved(
        &self,
        frame: &Frame,
        mut working: Working,
        norm: Norm,
        bound: Option<f64>,
        radius: Option<f64>,
    ) -> Result<Solved, Failure> {
        let unit = frame.unit;
        let mut iterations = 0;
        for _ in 0..ROUNDS {
            let program = self.program(frame, &working, &Goal::Norm(norm), bound, radius);
            let optimum = program.solve()?;
            iterations += optimum.iterations;
            let parameters = self.parameters(frame, &optimum.x);
            let residuals = self.samples.residuals(&parameters);
            let level = match norm {
                Norm::Infinity => Some(optimum.x[self.sizes.len()] * unit),
                Norm::One | Norm::Two => bound,
            };
            let mut grown = self.grow(frame, &mut working, &parameters, &residuals, level);
            if norm == Norm::Infinity && !working.bounded && bound.is_some_and(|bound| level > Some(bound)) {
                working.bounded = true;
                grown = true;
            }
            if let Some(signs) = &mut working.signs {
                grown |= self.correct(signs, &parameters, &residuals, unit);
            }
            if !grown {
                return Ok(Solved { parameters, iterations });
            }
        }
        Err(Failure::Unsolved(format!("no end after {ROUNDS} rounds")))
    }

    /// The least and the largest value of each parameter under the limits and |e(t)| <= bound, which must be possible:
    /// `center` does it. The rows must determine the parameters without a ridge.
    pub fn extents(&self, bound: f64, center: DVector<f64>) -> Result<(Vec<[f64; 2]>, u32), Failure> {
        let residuals = self.samples.residuals(&center);
        let unit = bound.max(self.samples.rounding(&center));
        let unit = if unit > 0.0 { unit } else { 1.0 };
        let frame = Frame { base: center, unit, residuals };
        // |Phi d| <= sqrt(N) 2 bound for the difference d of two such parameter vectors.
        let radius = 2.0 * bound / unit + 1.0;
        let extents = (0..self.sizes.len()).into_par_iter().map(|parameter| {
            let direction = self.spread.row(parameter).transpose();
            let direction = direction.unscale(direction.norm());
            let (low, first) = self.farthest(&frame, parameter, &direction, bound, radius)?;
            let (high, second) = self.farthest(&frame, parameter, &-direction, bound, radius)?;
            Ok(([low, high], first + second))
        });
        // Collected before a failure is reported, so that it is the first one whatever the threads.
        let extents: Vec<Result<_, Failure>> = extents.collect();
        let extents: Vec<([f64; 2], u32)> = extents.into_iter().collect::<Result<_, _>>()?;
        Ok((extents.iter().map(|(ends, _)| *ends).collect(), extents.iter().map(|(_, steps)| steps).sum()))
    }

    /// A parameter where `direction' w` is smallest under the limits and |e(t)| <= bound, and the steps that took.
    fn farthest(
        &self,
        frame: &Frame,
        parameter: usize,
        direction: &DVector<f64>,
        bound: f64,
        radius: f64,
    ) -> Result<(f64, u32), Failure> {
        let mut working = self.first(frame, Norm::Infinity);
        let mut iterations = 0;
        for _ in 0..ROUNDS {
            let program = self.program(frame, &working, &Goal::Along(direction), Some(bound), Some(radius));
            let optimum = program.solve()?;
            iterations += optimum.iterations;
            let parameters = self.parameters(frame, &optimum.x);
            let residuals = self.samples.residuals(&parameters);
            if !self.grow(frame, &mut working, &parameters, &residuals, Some(bound)) {
                return Ok((parameters[parameter], iterations));
            }
        }
        Err(Failure::Unsolved(format!("no end after {ROUNDS} rounds")))
    }

    /// `M G M` with `G = Phi'Phi`, `M = Z (Z'(G + K) Z)^-1 Z'`, K the ridge and Z the directions along which the limits
    /// of these indices do not change; and the trace of `M G`, the number of parameters that the data determine.
    pub fn spread_within(&self, active: &[usize]) -> (DMatrix<f64>, f64) {
        let size = self.sizes.len();
        let rows: Vec<Row> = active
            .iter()
            .map(|&index| Row { coefficients: self.directions[index].0.clone(), right: 0.0 })
            .collect();
        let held = Subspace::new(rows.iter(), size);
        let mut free = &self.spread * held.complement() / (self.samples.count() as f64).sqrt();
        for (mut free, spread) in free.row_iter_mut().zip(self.spread.row_iter()) {
            // What a limit holds does not vary, not even by rounding.
            if free.norm() * (self.samples.count() as f64).sqrt() <= HELD * spread.norm() {
                free.fill(0.0);
            }
        }
        if self.ridge == 0.0 {
            return (&free * free.transpose(), free.ncols() as f64);
        }
        let image = &self.regressors * &free;
        let inner = image.tr_mul(&image);
        let trace = inner.trace();
        (&free * inner * free.transpose(), trace)
    }

    /// Least squares under the limits.
    pub fn least_squares(&self) -> Result<Solved, Failure> {
        let mut working = Working::default();
        let mut fit = Solved { parameters: self.unlimited.clone(), iterations: 0 };
        // Distances are in units of the largest violation of the first round.
        let mut frame: Option<Frame> = None;
        for _ in 0..ROUNDS {
            let unit = frame.as_ref().map_or(0.0, |frame| frame.unit);
            let worst = self.violated_limits(&mut working, &fit.parameters, unit);
            if worst == 0.0 {
                return Ok(fit);
            }
            let frame = frame.get_or_insert_with(|| Frame {
                base: self.unlimited.clone(),
                unit: worst,
                residuals: Vec::new(),
            });
            let program = self.program(frame, &working, &Goal::Norm(Norm::Two), None, None);
            let optimum = program.solve()?;
            fit.iterations += optimum.iterations;
            fit.parameters = self.parameters(frame, &optimum.x);
        }
        Err(Failure::Unsolved(format!("no end after {ROUNDS} rounds")))
    }

    /// Adds the ends of limits that the parameters violate; how far they do at most, in units of w times `unit`, and 0
    /// if none is new.
    fn violated_limits(&self, working: &mut Working, parameters: &DVector<f64>, unit: f64) -> f64 {
        let mut worst = 0.0_f64;
        for (index, limit) in self.limits.iter().enumerate() {
            let value = limit.value(parameters);
            for upper in [false, true] {
                let excess = if upper { value - limit.high } else { limit.low - value };
                let allowed = limit.rounding(parameters, upper).max(MET * unit * self.directions[index].1);
                if excess > allowed && !working.limits.contains(&(index, upper)) {
                    worst = worst.max(excess / self.directions[index].1);
                    working.limits.push((index, upper));
                }
            }
        }
        worst
    }

    /// The program's first samples and limits.
    fn first(&self, frame: &Frame, norm: Norm) -> Working {
        let mut working = Working::default();
        for (index, limit) in self.limits.iter().enumerate() {
            let value = limit.value(&frame.base);
            let near = NEAR * frame.unit * self.directions[index].1;
            for upper in [false, true] {
                if (limit.end(upper) - value).abs() <= near {
                    working.limits.push((index, upper));
                }
            }
        }
        if norm == Norm::Infinity {
            working.samples = largest(&frame.residuals, 0.0, self.batch(), &[]);
        }
        let count = self.samples.count();
        if norm == Norm::One && count > ALL {
            let free = FREE * (count as f64 * self.sizes.len() as f64).powf(2.0 / 3.0);
            if free < count as f64 {
                working.signs = Some(signs(&frame.residuals, free as usize));
            }
        }
        working
    }

    /// How many samples a round adds at most.
    fn batch(&self) -> usize {
        2 * self.sizes.len() + 8
    }

    /// Adds the samples with |e| above `level` and the limits that are violated; whether there was one.
    fn grow(
        &self,
        frame: &Frame,
        working: &mut Working,
        parameters: &DVector<f64>,
        residuals: &[f64],
        level: Option<f64>,
    ) -> bool {
        let mut grown = self.violated_limits(working, parameters, frame.unit) > 0.0;
        if let Some(level) = level {
            let level = level.max(0.0) + (MET * frame.unit).max(self.samples.rounding(parameters));
            let more = largest(residuals, level, self.batch(), &working.samples);
            grown |= !more.is_empty();
            working.samples.extend(more);
        }
        grown
    }

    /// Takes samples with a wrong sign out of the sums; whether there was one.
    fn correct(&self, signs: &mut Vec<f64>, parameters: &DVector<f64>, residuals: &[f64], unit: f64) -> bool {
        let allowed = (MET * unit).max(self.samples.rounding(parameters));
        let is_wrong = |(sign, residual): (&f64, &f64)| sign * residual < -allowed;
        let wrong = signs.iter().zip(residuals).filter(|pair| is_wrong(*pair)).count();
        let free = signs.iter().filter(|sign| **sign == 0.0).count();
        if wrong as f64 > WRONG * free as f64 {
            *signs = self::signs(residuals, (2 * free).max(free + wrong));
        } else {
            for (sign, residual) in signs.iter_mut().zip(residuals) {
                if *sign * residual < -allowed {
                    *sign = 0.0;
                }
            }
        }
        wrong > 0
    }

    /// A radius of |w| that holds every optimum, where a program of few samples alone may be unbounded; a strong ridge,
    /// and least squares, bound it already.
    ///
    /// Let J be what b gives for each sample, which no optimum exceeds, and m the norm of e_b without the ridge. Then
    /// the way d from b to an optimum has `|Phi d| <= sqrt(N) (m + J)`, or N of that for the sum of |e|, and `k sum (r
    /// d)^2 <= 4 N r_y J`.
    fn radius(&self, frame: &Frame, working: &Working, norm: Norm) -> Option<f64> {
        let residuals = &frame.residuals;
        let count = residuals.len() as f64;
        let (size, factor) = match norm {
            Norm::Infinity => (peak(residuals), 1.0),
            Norm::One if working.signs.is_some() => {
                (residuals.iter().map(|e| e.abs()).sum::<f64>() / count, count.sqrt())
            }
            Norm::One | Norm::Two => return None,
        };
        let sized = self.sizes.component_mul(&frame.base).norm_squared();
        let all = size + self.ridge * sized / (count * self.target());
        let across = if self.ridge > 0.0 { 4.0 * self.target() * all } else { 0.0 };
        let radius = (factor * (size + all)).hypot(across.sqrt()) / frame.unit + 1.0;
        (self.ridge < STRONG * count).then_some(radius)
    }

    /// The RMS of y, or 1 where y is zero.
    fn target(&self) -> f64 {
        if self.target > 0.0 { self.target } else { 1.0 }
    }

    /// theta of a w, after which there may be other variables.
    fn parameters(&self, frame: &Frame, w: &DVector<f64>) -> DVector<f64> {
        &frame.base + &self.spread * w.rows(0, self.sizes.len()) * frame.unit
    }

    /// w of parameters, counted from least squares without inequalities, in the unit of y.
    fn way(&self, parameters: &DVector<f64>) -> DVector<f64> {
        &self.triangle * (parameters - &self.unlimited) / (self.samples.count() as f64).sqrt()
    }
}

/// Adds to the factor the rows of a ridge, and one for each equation of which the weight is that of all samples.
fn add_rows(
    factor: &mut LeastSquares<f64, Dyn>,
    limits: &[Limit],
    ridge: f64,
    sizes: &DVector<f64>,
    root: f64,
) -> Result<(), thetahat_core::Error> {
    if ridge > 0.0 {
        for (index, size) in sizes.iter().enumerate() {
            let mut row = DVector::zeros(sizes.len());
            row[index] = ridge.sqrt() * size;
            factor.add(&row, 0.0)?;
        }
    }
    for limit in limits.iter().filter(|limit| limit.is_equation()) {
        // A regressor of zeros has no unit.
        let sized = limit.coefficients.zip_map(sizes, |c, size| if size > 0.0 { c / size } else { c });
        let weight = root / sized.norm();
        factor.add(&(&limit.coefficients * weight), limit.low * weight)?;
    }
    Ok(())
}

/// The sign of each residual, and 0 of the `free` smallest.
fn signs(residuals: &[f64], free: usize) -> Vec<f64> {
    let mut signs: Vec<f64> = residuals.iter().map(|e| 1.0_f64.copysign(*e)).collect();
    smallest(residuals, free).into_iter().for_each(|at| signs[at] = 0.0);
    signs
}

/// The largest size.
pub fn peak(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |peak, value| peak.max(value.abs()))
}

fn root_mean_square(values: &[f64]) -> f64 {
    // In units of the peak, so that no square leaves the range.
    let peak = peak(values);
    if peak == 0.0 {
        return 0.0;
    }
    let squares: f64 = values.iter().map(|value| (value / peak).powi(2)).sum();
    peak * (squares / values.len() as f64).sqrt()
}
