//! The errors of points as a function of the poles.

use std::ops::Range;

use thetahat_core::nalgebra::Complex;
use thetahat_numerics::optimize::Objective;
use thetahat_numerics::regression::{Span, product, sum_of_squares};

use crate::Error;
use crate::estimate::ResponsePoints;

/// Poles lie between this fraction of the lowest frequency and so many times the highest.
const WIDEST: f64 = 1e4;
/// The least damping of a pair.
const LEAST_DAMPING: f64 = 1e-7;

/// Where the coefficients of each section stand: pairs of poles, and a real one last if their number is odd.
pub(super) fn sections(order: usize) -> impl Iterator<Item = Range<usize>> + Clone {
    (0..order).step_by(2).map(move |first| first..order.min(first + 2))
}

/// Why poles have no cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Refusal {
    /// They are outside of their limits.
    Outside,
    /// The errors are no numbers.
    Overflow,
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
    residuals: Vec<Vec<f64>>,
    matrix: Vec<f64>,
    right: Vec<f64>,
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
            residuals: measured.clone(),
            measured,
            point: Vec::new(),
            numerators: Vec::new(),
            spans: Vec::new(),
            matrix: Vec::new(),
            right: Vec::new(),
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
        self.residuals.iter().map(|own| sum_of_squares(own)).sum()
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

    /// A column of an input: a function of s, times the weights.
    pub(super) fn column(&self, input: usize, of: impl Fn(Complex<f64>) -> Complex<f64>) -> Vec<f64> {
        let weighted = self.at[input].iter().zip(&self.points[input].weights).flat_map(|(s, weight)| {
            let value = of(*s) * *weight;
            [value.re, value.im]
        });
        weighted.collect()
    }

    /// The columns that numerators and d multiply.
    pub(super) fn linear_columns(&self, input: usize, poles: &[f64]) -> Vec<Vec<f64>> {
        let mut columns = Vec::with_capacity(self.linear());
        for section in sections(self.order) {
            for place in 0..section.len() {
                let value = |s: Complex<f64>| basis(&poles[section.clone()], s)[place];
                let apart = self.zero_at.map_or(Complex::new(0.0, 0.0), value);
                columns.push(self.column(input, |s| value(s) - apart));
            }
        }
        if self.direct {
            columns.push(self.column(input, |_| Complex::new(1.0, 0.0)));
        }
        columns
    }

    /// How the response moves with the logarithm of each coefficient, N being held: of s^2 + a1 s + a2
    ///
    /// ```text
    /// -N/P^2 a1 s,   -N/P^2 a2
    /// ```
    fn pole_columns(&self, input: usize, poles: &[f64]) -> Vec<Vec<f64>> {
        let mut columns = Vec::with_capacity(self.order);
        for section in sections(self.order) {
            let (a, own) = (&poles[section.clone()], &self.numerators[input][section.clone()]);
            for place in 0..section.len() {
                let value = |s: Complex<f64>| {
                    let beside = basis(a, s);
                    let sum: Complex<f64> = beside.iter().zip(own).map(|(beside, own)| beside * *own).sum();
                    -sum * beside[place] * a[place]
                };
                let apart = self.zero_at.map_or(Complex::new(0.0, 0.0), value);
                columns.push(self.column(input, |s| value(s) - apart));
            }
        }
        columns
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
        let inside = |(value, [low, high]): (&f64, [f64; 2])| *value >= low && *value <= high;
        if !point.iter().zip(self.bounds()).all(inside) {
            return Err(Refusal::Outside);
        }
        let poles: Vec<f64> = point.iter().map(|value| value.exp()).collect();
        let (mut cost, mut spans, mut numerators, mut residuals) = (0.0, Vec::new(), Vec::new(), Vec::new());
        for (input, measured) in self.measured.iter().enumerate() {
            let mut span = Span::default();
            for column in self.linear_columns(input, &poles) {
                span.add(column);
            }
            let mut left = measured.clone();
            let has = span.take_from(&mut left);
            cost += sum_of_squares(&left);
            numerators.push(span.weights(&has));
            residuals.push(left);
            spans.push(span);
        }
        if !cost.is_finite() {
            return Err(Refusal::Overflow);
        }
        self.point = point.to_vec();
        (self.spans, self.numerators, self.residuals) = (spans, numerators, residuals);
        Ok(cost)
    }

    fn linearize(&mut self) -> Result<f64, Refusal> {
        let poles = self.poles();
        let size = self.order;
        self.matrix = vec![0.0; size * size];
        self.right = vec![0.0; size];
        for (input, (span, left)) in self.spans.iter().zip(&self.residuals).enumerate() {
            let mut columns = self.pole_columns(input, &poles);
            for column in &mut columns {
                span.take_from(column);
            }
            for (i, column) in columns.iter().enumerate() {
                self.right[i] += product(column, left);
                for (j, other) in columns.iter().enumerate() {
                    self.matrix[i * size + j] += product(column, other);
                }
            }
        }
        for (place, [low, high]) in self.bounds().into_iter().enumerate() {
            let (value, right) = (self.point[place], self.right[place]);
            // It would leave through the bound that it stands on.
            if value <= low && right < 0.0 || value >= high && right > 0.0 {
                self.right[place] = 0.0;
                for other in 0..size {
                    self.matrix[place * size + other] = 0.0;
                    self.matrix[other * size + place] = 0.0;
                }
            }
        }
        Ok(0.0)
    }

    fn matrix(&self) -> &[f64] {
        &self.matrix
    }

    fn right(&self) -> &[f64] {
        &self.right
    }

    fn is_outside(refusal: &Refusal) -> bool {
        *refusal == Refusal::Outside
    }

    /// Moves coefficients onto the bound that they would cross.
    fn draw_in(&mut self, from: &[f64], trial: &mut [f64]) -> bool {
        for (value, [low, high]) in trial.iter_mut().zip(self.bounds()) {
            *value = value.clamp(low, high);
        }
        from != trial
    }
}
