//! The frequency response of a process whose input is held from sample to sample, or is a sine in continuous time.
//!
//! With a dead time theta = m T - p, and z = e^(j omega T), that of an input which is held for T seconds is
//!
//! ```text
//! G(omega) = w'(C (F_p (z I - F)^-1 G + G_p) + D) z^-m,   F = e^(A T),  F_p = e^(A p),  G, G_p the same of a held input
//! ```
//!
//! (Åström and Wittenmark, Computer-Controlled Systems, 3rd ed. 1997, section 2.3), and that to a sine
//!
//! ```text
//! G(omega) = w'(C (j omega I - A)^-1 B + D) e^(-j omega theta)
//! ```
//!
//! Both are solved in the states: polynomials of a process that is slow beside its samples lose digits near z = 1.

use thetahat_core::{Dual, Number};

use super::held::LANE;
use crate::model::{Chain, Columns, Complex, Parts, ProcessStructure, State, Transition, resolved};

/// The lags of a structure at most, and a dead time.
const SLOPES: usize = LANE + 1;

/// Frequencies in rad/s, and for how many seconds the input is held; none for sines in continuous time.
pub(crate) type Points<'a> = (&'a [f64], Option<f64>);

/// Calls `take` for each frequency with the real and the imaginary part of each column.
pub(crate) fn responses(
    structure: &ProcessStructure,
    shape: &[f64],
    dead_time: f64,
    points: Points<'_>,
    take: impl FnMut(usize, &Columns<f64>, &Columns<f64>),
) {
    columns(structure, shape, dead_time, points, take);
}

/// Calls `take` for each frequency with the columns, and with the slopes of their sum by the shape and, last, by the
/// dead time; each as real and imaginary part.
pub(crate) fn response_slopes(
    structure: &ProcessStructure,
    parts: &Parts<f64>,
    points: Points<'_>,
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
    (frequencies, hold): Points<'_>,
    mut take: impl FnMut(usize, &Columns<S>, &Columns<S>),
) {
    let chain = structure.chain(shape);
    let n = chain.states();
    let held = hold.map(|time| Held::new(&chain, dead_time, time));
    let rest = chain.at_rest(0.0, 0.0);
    let driven = held.as_ref().map_or_else(|| chain.slope(&rest, 1.0), |held| held.whole.apply(&rest, 1.0));
    for (row, &frequency) in frequencies.iter().enumerate() {
        // z and F of a held input, j omega and A of a sine.
        let point: Complex<S> = match &held {
            Some(held) => {
                let (sine, cosine) = (frequency * held.time).sin_cos();
                Complex::new(cosine, sine)
            }
            None => Complex::new(0.0, frequency),
        };
        let entry = |i: usize, j: usize| match &held {
            Some(held) => held.whole.entry(i, j),
            None => chain.entry(i, j),
        };
        let (mut re, mut im) = (rest, rest);
        let solved = resolved(n, point, entry, |i| driven[i]);
        for ((re, im), value) in re.iter_mut().zip(&mut im).zip(solved) {
            (*re, *im) = (value.re, value.im);
        }
        let late = match &held {
            Some(held) => {
                (re, im) = held.later(&rest, (&re, &im));
                let (sine, cosine) = (-held.samples * frequency * held.time).sin_cos();
                Complex::new(cosine, sine)
            }
            None => Complex::turned(-(dead_time * frequency)),
        };
        let (mut re, mut im) = (chain.columns(&re, 1.0), chain.columns(&im, 0.0));
        for (re, im) in re.iter_mut().zip(&mut im) {
            let turned = Complex { re: *re, im: *im }.times(late);
            (*re, *im) = (turned.re, turned.im);
        }
        take(row, &re, &im);
    }
}

/// The states in samples of a held input, with a dead time that is `samples` of them less a part of one.
struct Held<S> {
    time: f64,
    samples: f64,
    /// F, and F_p.
    whole: Transition<S>,
    part: Transition<S>,
}

impl<S: Number<f64>> Held<S> {
    fn new(chain: &Chain<S>, dead_time: S, time: f64) -> Self {
        let samples = (dead_time.value() / time).ceil();
        let ahead = S::from(samples * time) - dead_time;
        Self { time, samples, whole: chain.transition(time.into()), part: chain.transition(ahead) }
    }

    /// F_p x + G_p.
    fn later(&self, rest: &State<S>, (re, im): (&State<S>, &State<S>)) -> (State<S>, State<S>) {
        let (mut real, imaginary) = (self.part.apply(re, 0.0), self.part.apply(im, 0.0));
        let direct = self.part.apply(rest, 1.0);
        real.iter_mut().zip(direct).for_each(|(value, direct)| *value += direct);
        (real, imaginary)
    }
}
