//! Initial-condition responses: what a filter says of samples before the first, and the combination of them that fits
//! best.

use thetahat_numerics::regression::{Lagged, Presample, Taps, Unsolved, divide, sum};

use crate::Error;

/// A response has died away when it is below this fraction of its largest value.
const NEGLIGIBLE: f64 = 1e-20;
/// An initial condition of which less than this fraction is in the errors is not determined: its remainder is rounding.
pub(super) const UNDETERMINED: f64 = 1e-11;

/// A response until it has died away, or is not finite any more, or has `length` samples. `compute` gives its
/// first samples; `order` is how many of them determine all that follow.
pub(crate) fn until_negligible(length: usize, order: usize, compute: impl Fn(usize) -> Vec<f64>) -> Vec<f64> {
    let (mut known, mut largest) = (0, 0.0_f64);
    // In growing pieces: a series is cheap, but not for a million samples of nothing.
    let mut piece = 256.max(order.saturating_mul(4));
    loop {
        let mut response = compute(piece.min(length));
        largest = response[known..].iter().fold(largest, |largest, h| largest.max(h.abs()));
        known = response.len();
        if !response.iter().all(|h| h.is_finite()) {
            return response;
        }
        let quiet = response.iter().rev().take_while(|h| h.abs() <= NEGLIGIBLE * largest).count();
        if quiet > order {
            response.truncate(known - quiet);
            return response;
        }
        if known >= length {
            return response;
        }
        piece = piece.saturating_mul(4);
    }
}

/// The first samples of the impulse response of 1/(P_1 P_2 …), all monic.
pub(super) fn impulse_response(denominators: &[&[f64]], length: usize) -> Vec<f64> {
    let mut response = vec![0.0; length];
    if let Some(first) = response.first_mut() {
        *first = 1.0;
    }
    denominators.iter().for_each(|monic| divide(monic, &mut response));
    response
}

/// A signal from rest, delayed by 0, …, `count - 1` samples. What is not there of it is zero.
#[derive(Debug)]
pub(super) struct Delays {
    pub(super) signal: Vec<f64>,
    pub(super) count: usize,
}

/// The weights of delayed signals that bring their sum closest to `target`, which is longer than there are delays;
/// one list for each signal.
///
/// Delays of a growing response differ by rounding only. Any of them serves: those that add nothing have no weight.
pub(super) fn closest(target: &[f64], basis: &[Delays]) -> Result<Vec<Vec<f64>>, Error> {
    let length = target.len();
    let fit = |signal: &[f64]| {
        let mut fitted = signal[..signal.len().min(length)].to_vec();
        fitted.resize(length, 0.0);
        fitted
    };
    let signals: Vec<Vec<f64>> = basis.iter().map(|delays| fit(&delays.signal)).collect();
    let mut weights: Vec<Vec<f64>> = basis.iter().map(|delays| vec![0.0; delays.count]).collect();
    if !signals.iter().flatten().chain(target).all(|value| value.is_finite()) {
        return Err(unknown());
    }
    let is_zero = |values: &[f64]| values.iter().all(|value| *value == 0.0);
    let mut columns: Vec<(usize, usize)> = basis
        .iter()
        .enumerate()
        .flat_map(|(signal, delays)| (0..delays.count).map(move |i| (signal, i)))
        .filter(|&(signal, delay)| !is_zero(&signals[signal][..length.saturating_sub(delay)]))
        .collect();
    if columns.is_empty() || is_zero(target) {
        return Ok(weights);
    }
    let all: Vec<&[f64]> = std::iter::once(target).chain(signals.iter().map(Vec::as_slice)).collect();
    let whole = 0..length;
    loop {
        let next = |a: &(usize, usize), b: &(usize, usize)| a.0 == b.0 && a.1 + 1 == b.1;
        let run = |run: &[(usize, usize)]| Taps {
            signal: run[0].0 + 1,
            first: run[0].1,
            count: run.len(),
            sign: 1.0,
        };
        let taps = columns.chunk_by(next).map(run).collect();
        match Lagged::new(&all, taps, std::slice::from_ref(&whole), Presample::Zero).solve() {
            Ok(solved) => {
                for (&(signal, delay), weight) in columns.iter().zip(solved.parameters.iter()) {
                    weights[signal][delay] = *weight;
                }
                return Ok(weights);
            }
            Err(Unsolved::Deficient(dependent)) if dependent.len() < columns.len() => {
                for column in dependent.iter().rev() {
                    columns.remove(*column);
                }
            }
            Err(_) => return Err(unknown()),
        }
    }
}

/// A column of a least-squares problem, and the size below which what is left of it is rounding.
#[derive(Debug)]
pub(super) struct Column {
    pub(super) values: Vec<f64>,
    pub(super) rounding: f64,
}

/// The weights of columns that bring their sum closest to `target`. What those before it explain of a column up to
/// rounding is left out, and its weight is zero.
///
/// By the modified Gram-Schmidt process, each column twice, which is as exact as Householder's (Björck, Numerical
/// Methods for Least Squares Problems, 1996, section 2.4). For few columns without structure: O(N n^2).
pub(super) fn closest_of(target: &[f64], columns: &[Column]) -> Result<Vec<f64>, Error> {
    let product = |a: &[f64], b: &[f64]| sum(a.iter().zip(b).map(|(a, b)| a * b));
    let take = |from: &mut [f64], weight: f64, unit: &[f64]| {
        from.iter_mut().zip(unit).for_each(|(from, unit)| *from -= weight * unit);
    };
    // Unit columns; which of all they are, and what is taken off them to make them orthogonal.
    let mut units: Vec<Vec<f64>> = Vec::new();
    let mut triangle: Vec<(usize, Vec<f64>)> = Vec::new();
    for (index, column) in columns.iter().enumerate() {
        let mut values = column.values.clone();
        let mut weights = vec![0.0; units.len()];
        for _ in 0..2 {
            for (unit, weight) in units.iter().zip(&mut weights) {
                let part = product(&values, unit);
                take(&mut values, part, unit);
                *weight += part;
            }
        }
        let size = product(&values, &values).sqrt();
        if !(size.is_finite() && column.rounding.is_finite()) {
            return Err(unknown());
        }
        if size > column.rounding {
            values.iter_mut().for_each(|value| *value /= size);
            units.push(values);
            weights.push(size);
            triangle.push((index, weights));
        }
    }
    let mut rest = target.to_vec();
    let mut right: Vec<f64> = Vec::new();
    for unit in &units {
        let part = product(&rest, unit);
        take(&mut rest, part, unit);
        right.push(part);
    }
    if !right.iter().all(|value| value.is_finite()) {
        return Err(unknown());
    }
    let mut solution = vec![0.0; columns.len()];
    while let (Some((index, weights)), Some(part)) = (triangle.pop(), right.pop()) {
        let Some((size, above)) = weights.split_last() else { break };
        let weight = part / size;
        solution[index] = weight;
        right.iter_mut().zip(above).for_each(|(right, above)| *right -= weight * above);
    }
    Ok(solution)
}

fn unknown() -> Error {
    Error::undetermined(
        Vec::new(),
        "the initial condition of a response cannot be told from the data; use zero or drop",
    )
}
