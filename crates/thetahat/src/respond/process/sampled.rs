//! The frequency response of a process whose input is held from sample to sample.
//!
//! With a dead time theta = m T - p, and z = e^(j omega T),
//!
//! ```text
//! G(omega) = w'(C (F_p (z I - F)^-1 G + G_p) + D) z^-m,   F = e^(A T),  F_p = e^(A p),  G, G_p the same of a held input
//! ```
//!
//! (Åström and Wittenmark, Computer-Controlled Systems, 3rd ed. 1997, section 2.3). It is solved in the states:
//! polynomials of a process that is slow beside its samples lose digits near z = 1.

use thetahat_core::{Dual, Number};

use super::held::LANE;
use crate::model::{Columns, Parts, ProcessStructure, State};

/// The lags of a structure at most, and a dead time.
const SLOPES: usize = LANE + 1;

/// A complex number of numbers that have derivatives.
#[derive(Debug, Clone, Copy)]
struct Complex<S> {
    re: S,
    im: S,
}

impl<S: Number<f64>> Complex<S> {
    fn new(re: f64, im: f64) -> Self {
        Self { re: re.into(), im: im.into() }
    }

    fn times(self, other: Self) -> Self {
        Self { re: self.re * other.re - self.im * other.im, im: self.re * other.im + self.im * other.re }
    }

    fn minus(self, other: Self) -> Self {
        Self { re: self.re - other.re, im: self.im - other.im }
    }

    fn over(self, other: Self) -> Self {
        let square = other.re * other.re + other.im * other.im;
        let product = self.times(Self { re: other.re, im: -other.im });
        Self { re: product.re / square, im: product.im / square }
    }

    fn size(self) -> f64 {
        self.re.value().hypot(self.im.value())
    }
}

/// Calls `take` for each frequency, in rad/s, with the real and the imaginary part of each column for a sample time.
pub(crate) fn responses(
    structure: &ProcessStructure,
    shape: &[f64],
    dead_time: f64,
    (frequencies, time): (&[f64], f64),
    take: impl FnMut(usize, &Columns<f64>, &Columns<f64>),
) {
    columns(structure, shape, dead_time, (frequencies, time), take);
}

/// Calls `take` for each frequency with the columns, and with the slopes of their sum by the shape and, last, by the
/// dead time; each as real and imaginary part.
pub(crate) fn response_slopes(
    structure: &ProcessStructure,
    parts: &Parts<f64>,
    points: (&[f64], f64),
    mut take: impl FnMut(usize, [&Columns<f64>; 2], [&[f64; SLOPES]; 2]),
) {
    let mut values = [0.0; SLOPES];
    values.iter_mut().zip(&parts.shape).for_each(|(value, own)| *value = *own);
    values[LANE] = parts.dead_time;
    let variables = Dual::<f64, SLOPES>::variables(values);
    let shape = &variables[..parts.shape.len().min(LANE)];
    columns(structure, shape, variables[LANE], points, |row, re, im| {
        let sum = |columns: &Columns<Dual<f64, SLOPES>>| {
            let mut slopes = [0.0; SLOPES];
            for (weight, column) in parts.weights.iter().zip(columns) {
                slopes.iter_mut().zip(column.derivatives).for_each(|(slope, own)| *slope += weight * own);
            }
            slopes
        };
        let plain = |columns: &Columns<Dual<f64, SLOPES>>| columns.map(|column| column.value);
        take(row, [&plain(re), &plain(im)], [&sum(re), &sum(im)]);
    });
}

fn columns<S: Number<f64>>(
    structure: &ProcessStructure,
    shape: &[S],
    dead_time: S,
    (frequencies, time): (&[f64], f64),
    mut take: impl FnMut(usize, &Columns<S>, &Columns<S>),
) {
    let chain = structure.chain(shape);
    let n = chain.states();
    let samples = (dead_time.value() / time).ceil();
    let ahead = S::from(samples * time) - dead_time;
    let (whole, part) = (chain.transition(time.into()), chain.transition(ahead));
    let rest = chain.at_rest(0.0, 0.0);
    let (driven, direct) = (whole.apply(&rest, 1.0), part.apply(&rest, 1.0));
    for (row, frequency) in frequencies.iter().enumerate() {
        let (sine, cosine) = (frequency * time).sin_cos();
        // (z I - F) x = G, by elimination with the largest pivot.
        let mut matrix: Vec<Vec<Complex<S>>> = (0..n)
            .map(|i| {
                let entry = |j: usize| {
                    let own = Complex { re: whole.entry(i, j), im: S::from(0.0) };
                    let z = if i == j { Complex::new(cosine, sine) } else { Complex::new(0.0, 0.0) };
                    z.minus(own)
                };
                (0..n).map(entry).chain([Complex { re: driven[i], im: S::from(0.0) }]).collect()
            })
            .collect();
        for step in 0..n {
            let pivot = (step..n).max_by(|&i, &j| matrix[i][step].size().total_cmp(&matrix[j][step].size()));
            matrix.swap(step, pivot.unwrap_or(step));
            let (above, below) = matrix.split_at_mut(step + 1);
            let own = &above[step];
            for row in below {
                let factor = row[step].over(own[step]);
                for (entry, own) in row.iter_mut().zip(own).skip(step) {
                    *entry = entry.minus(factor.times(*own));
                }
            }
        }
        let (mut re, mut im): (State<S>, State<S>) = (rest, rest);
        for i in (0..n).rev() {
            let mut value = matrix[i][n];
            for j in i + 1..n {
                value = value.minus(matrix[i][j].times(Complex { re: re[j], im: im[j] }));
            }
            let value = value.over(matrix[i][i]);
            (re[i], im[i]) = (value.re, value.im);
        }
        let (mut real, imaginary) = (part.apply(&re, 0.0), part.apply(&im, 0.0));
        real.iter_mut().zip(direct).for_each(|(value, direct)| *value += direct);
        let (mut re, mut im) = (chain.columns(&real, 1.0), chain.columns(&imaginary, 0.0));
        let (sine, cosine) = (-samples * frequency * time).sin_cos();
        for (re, im) in re.iter_mut().zip(&mut im) {
            let turned = Complex { re: *re, im: *im }.times(Complex::new(cosine, sine));
            (*re, *im) = (turned.re, turned.im);
        }
        take(row, &re, &im);
    }
}
