//! The errors of points as a function of the poles.

use std::ops::Range;

use thetahat_core::nalgebra::Complex;
use thetahat_numerics::optimize::Objective;
use thetahat_numerics::regression::{Span, sum_of_squares};

use crate::Error;
use crate::estimate::ResponsePoints;
use crate::estimate::projection::{NormalEquations, Refusal, check_inside, draw_in};

/// Poles lie between this fraction of the lowest frequency and so many times the highest.
const WIDEST: f64 = 1e4;
/// The least damping of a pair.
const LEAST_DAMPING: f64 = 1e-7;

/// Where the coefficients of each section stand: pairs of poles, and a real one last if their number is odd.
pub(super) fn sections(order: usize) -> impl Iterator<Item = Range<usize>> + Clone {
    (0..order).step_by(2).map(move |first| first..order.min(first + 2))
}

/// What stands beside each coefficient of a numerator: s/P and 1/P; 1/P of a single pole.
pub(super) fn basis(a: &[f64], s: Complex<f64>) -> [Complex<f64>; 2] {
    let none = Complex::new(0.0, 0.0);
    match a {
        [a1, a2] => {
            let below = (s * s + s * *a1 + *a2).inv();
            [s * below, below]
        }
        [a] => [(s + *a).inv(), none],
        _ => [none; 2],
    }
}

/// The least sum of squared weighted errors that numerators leave, by the logarithms of the coefficients of the
/// sections.
#[derive(Debug, Clone)]
pub(super) struct PolesObjective<'a> {
    points: &'a [ResponsePoints],
    order: usize,
    direct: bool,
    /// s of each point of each input.
    at: Vec<Vec<Complex<f64>>>,
    /// s where z is infinite, at which a model without feedthrough is zero; none of sines, and with it.
    zero_at: Option<Complex<f64>>,
    /// Logarithms of the least and the largest coefficient of degree one: radians a second.
    limits: [f64; 2],
    /// Real and imaginary parts of each input, times their weights.
    measured: Vec<Vec<f64>>,
    /// Where it stands: logarithms, and for each input the numerators of all sections and d.
    point: Vec<f64>,
    numerators: Vec<Vec<f64>>,
    spans: Vec<Span>,
    /// Of all inputs, one after the other.
    residuals: Vec<f64>,
    equations: NormalEquations,
}

impl<'a> PolesObjective<'a> {
    /// # Errors
    /// [`Error::Data`] if there is no point above frequency 0, or squares leave the range of numbers.
    pub(super) fn new(points: &'a [ResponsePoints], order: usize, direct: bool) -> Result<Self, Error> {
        let s = |own: &ResponsePoints, frequency: f64| {
            let half = own.sample_time / 2.0;
            Complex::new(0.0, if own.held { (frequency * half).tan() / half } else { frequency })
        };
        let each = || points.iter().flat_map(|own| own.frequencies.iter().map(move |at| (own, *at)));
        let above = || each().map(|(_, frequency)| frequency).filter(|frequency| *frequency > 0.0);
        let (low, high) = (above().fold(f64::INFINITY, f64::min), above().fold(0.0, f64::max));
        if !low.is_finite() {
            return Err(Error::data("the response has no point at a frequency above 0"));
        }
        // Poles that are faster than samples are so by the mapping.
        let held = points.iter().find(|own| own.held).map(|own| 2.0 / own.sample_time);
        let measured: Vec<Vec<f64>> = points.iter().map(|own| own.measured().collect()).collect();
        if !measured.iter().map(|own| sum_of_squares(own)).sum::<f64>().is_finite() {
            return Err(Error::data(
                "squares of the points leave the range of numbers; scale them towards one",
            ));
        }
        Ok(Self {
            points,
            order,
            direct,
            at: points.iter().map(|own| own.frequencies.iter().map(|at| s(own, *at)).collect()).collect(),
            zero_at: held.filter(|_| !direct).map(|at| Complex::new(at, 0.0)),
            limits: [(low / WIDEST).ln(), (high.max(held.unwrap_or(0.0)) * WIDEST).ln()],
            residuals: measured.concat(),
            measured,
            point: Vec::new(),
            numerators: Vec::new(),
            spans: Vec::new(),
            equations: NormalEquations::default(),
        })
    }

    pub(super) fn points(&self) -> &'a [ResponsePoints] {
        self.points
    }

    pub(super) fn order(&self) -> usize {
        self.order
    }

    pub(super) fn is_direct(&self) -> bool {
        self.direct
    }

    /// For how many seconds inputs are held; none of sines.
    pub(super) fn held(&self) -> Option<f64> {
        self.points.iter().find(|own| own.held).map(|own| own.sample_time)
    }

    pub(super) fn at(&self) -> &[Vec<Complex<f64>>] {
        &self.at
    }

    pub(super) fn measured(&self) -> &[Vec<f64>] {
        &self.measured
    }

    /// Whether the errors of points are not known, and taken for relative to these.
    pub(super) fn is_relative(&self) -> bool {
        self.points.iter().any(|own| !own.known)
    }

    pub(super) fn measured_squares(&self) -> f64 {
        self.measured.iter().map(|own| sum_of_squares(own)).sum()
    }

    pub(super) fn squares(&self) -> f64 {
        sum_of_squares(&self.residuals)
    }

    /// The values that were measured.
    pub(super) fn count(&self) -> usize {
        self.measured.iter().map(Vec::len).sum()
    }

    /// Numerators and d of an input.
    pub(super) fn linear(&self) -> usize {
        self.order + usize::from(self.direct)
    }

    pub(super) fn free_parameters(&self) -> usize {
        self.order + self.points.len() * self.linear()
    }

    /// The coefficients of the sections where it stands.
    pub(super) fn poles(&self) -> Vec<f64> {
        self.point.iter().map(|value| value.exp()).collect()
    }

    pub(super) fn numerators(&self) -> &[Vec<f64>] {
        &self.numerators
    }

    /// The same with other numerators.
    #[cfg(test)]
    pub(super) fn with_numerators(self, numerators: Vec<Vec<f64>>) -> Self {
        Self { numerators, ..self }
    }

    /// Between which values each logarithm may lie.
    pub(super) fn bounds(&self) -> Vec<[f64; 2]> {
        let [low, high] = self.limits;
        let of = |section: Range<usize>| {
            let one = [low, high];
            if section.len() == 1 {
                vec![one]
            } else {
                vec![[low + LEAST_DAMPING.ln(), high], [2.0 * low, 2.0 * high]]
            }
        };
        sections(self.order).flat_map(of).collect()
    }

    /// Goes to a point that has a cost.
    ///
    /// # Errors
    /// [`Error::Data`] if it has none.
    pub(super) fn settle(&mut self, point: &[f64]) -> Result<(), Error> {
        self.evaluate(point).map(|_| ()).map_err(|_| {
            Error::data("the response leaves the range of numbers; scale the channels towards one")
        })
    }

    /// Columns of an input: so many functions of s, times the weights, less what they are where a model without
    /// feedthrough is zero.
    fn columns(
        &self,
        input: usize,
        count: usize,
        of: impl Fn(Complex<f64>) -> [Complex<f64>; 2],
    ) -> impl Iterator<Item = Vec<f64>> {
        let apart = self.zero_at.map_or([Complex::new(0.0, 0.0); 2], &of);
        let mut columns = vec![Vec::with_capacity(self.measured[input].len()); count];
        for (s, weight) in self.at[input].iter().zip(&self.points[input].weights) {
            for ((column, value), apart) in columns.iter_mut().zip(of(*s)).zip(apart) {
                let value = (value - apart) * *weight;
                column.extend([value.re, value.im]);
            }
        }
        columns.into_iter()
    }

    /// The columns that numerators and d multiply.
    pub(super) fn linear_columns(&self, input: usize, poles: &[f64]) -> Vec<Vec<f64>> {
        let each = sections(self.order).flat_map(|section| {
            self.columns(input, section.len(), move |s| basis(&poles[section.clone()], s))
        });
        let direct = self.columns(input, usize::from(self.direct), |_| [Complex::new(1.0, 0.0); 2]);
        each.chain(direct).collect()
    }

    /// How the response moves with the logarithm of each coefficient, N being held: of s^2 + a1 s + a2
    ///
    /// ```text
    /// -N/P^2 a1 s,   -N/P^2 a2
    /// ```
    fn pole_columns(&self, input: usize, poles: &[f64]) -> Vec<Vec<f64>> {
        let of = |section: Range<usize>| {
            let (a, own) = (&poles[section.clone()], &self.numerators[input][section.clone()]);
            self.columns(input, section.len(), move |s| {
                let beside = basis(a, s);
                let sum: Complex<f64> = beside.iter().zip(own).map(|(beside, own)| beside * *own).sum();
                let mut a = a.iter();
                beside.map(|beside| -sum * beside * *a.next().unwrap_or(&0.0))
            })
        };
        sections(self.order).flat_map(of).collect()
    }

    /// psi of all parameters at all points, those of the other inputs being zero: the logarithms, then for each input
    /// numerators and d.
    pub(super) fn slopes(&self) -> Vec<Vec<f64>> {
        let poles = self.poles();
        let inputs = 0..self.points.len();
        let of_poles: Vec<Vec<Vec<f64>>> =
            inputs.clone().map(|input| self.pole_columns(input, &poles)).collect();
        let mut columns: Vec<Vec<f64>> = (0..self.order)
            .map(|place| of_poles.iter().flat_map(|own| own[place].iter().copied()).collect())
            .collect();
        let mut first = 0;
        for input in inputs {
            for own in self.linear_columns(input, &poles) {
                let mut column = vec![0.0; self.count()];
                column[first..first + own.len()].copy_from_slice(&own);
                columns.push(column);
            }
            first += self.measured[input].len();
        }
        columns
    }
}

impl Objective for PolesObjective<'_> {
    type Refusal = Refusal;

    fn samples(&self) -> usize {
        self.count()
    }

    /// O(N n^2) for N values.
    fn evaluate(&mut self, point: &[f64]) -> Result<f64, Refusal> {
        check_inside(point, &self.bounds())?;
        let poles: Vec<f64> = point.iter().map(|value| value.exp()).collect();
        let (mut spans, mut numerators, mut residuals) = (Vec::new(), Vec::new(), Vec::new());
        for (input, measured) in self.measured.iter().enumerate() {
            let mut span = Span::default();
            for column in self.linear_columns(input, &poles) {
                span.add(column);
            }
            let mut left = measured.clone();
            let has = span.take_from(&mut left);
            numerators.push(span.weights(&has));
            residuals.append(&mut left);
            spans.push(span);
        }
        let cost = sum_of_squares(&residuals);
        if !cost.is_finite() {
            return Err(Refusal::Overflow);
        }
        self.point = point.to_vec();
        (self.spans, self.numerators, self.residuals) = (spans, numerators, residuals);
        Ok(cost)
    }

    fn linearize(&mut self) -> Result<f64, Refusal> {
        let poles = self.poles();
        let mut columns: Vec<Vec<f64>> = vec![Vec::with_capacity(self.residuals.len()); self.order];
        for (input, span) in self.spans.iter().enumerate() {
            for (column, mut own) in columns.iter_mut().zip(self.pole_columns(input, &poles)) {
                span.take_from(&mut own);
                column.append(&mut own);
            }
        }
        self.equations = NormalEquations::new(columns, &self.residuals, &self.point, &self.bounds());
        Ok(0.0)
    }

    fn matrix(&self) -> &[f64] {
        &self.equations.matrix
    }

    fn right(&self) -> &[f64] {
        &self.equations.right
    }

    fn is_outside(refusal: &Refusal) -> bool {
        *refusal == Refusal::Outside
    }

    fn draw_in(&mut self, from: &[f64], trial: &mut [f64]) -> bool {
        draw_in(trial, &self.bounds());
        from != trial
    }
}
