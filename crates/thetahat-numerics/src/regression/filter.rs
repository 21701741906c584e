//! Filters in q^-1 over segments of a signal: products with a polynomial, and divisions by a monic one.

use std::ops::Range;

use super::kernel;

/// Adds `sum_l weights[l] x(t - l)` to `target`, which stands for the samples `rows`; before sample `start` x is zero.
pub fn add_filtered(target: &mut [f64], rows: &Range<usize>, weights: &[f64], x: &[f64], start: usize) {
    let lag = weights.len().saturating_sub(1);
    let full = (start + lag).clamp(rows.start, rows.end);
    let (head, tail) = target.split_at_mut(full - rows.start);
    for (row, value) in (rows.start..full).zip(head) {
        let known = (row + 1).saturating_sub(start).min(weights.len());
        // The largest lag comes first, as after the start: the bits are those of a recursion that begins with zeros.
        let past = weights[..known].iter().rev().zip(&x[row + 1 - known..=row]);
        past.for_each(|(weight, x)| *value += weight * x);
    }
    if full < rows.end && !weights.is_empty() {
        kernel::add_filtered(tail, weights, &x[full - lag..rows.end]);
    }
}

/// x = w/A from rest, in place: `x(t) = w(t) - a1 x(t-1) - … - an x(t-n)`, `monic` being 1, a1 … an. 2 n flops a
/// sample.
pub fn divide(monic: &[f64], values: &mut [f64]) {
    divide_together(monic, [values]);
}

/// The same for several signals of one length. A sample waits for the one before it; side by side, signals wait
/// together.
pub fn divide_together<const K: usize>(monic: &[f64], signals: [&mut [f64]; K]) {
    match *monic {
        [] | [_] => {}
        [_, a] => divide_by(signals, [a]),
        [_, a, b] => divide_by(signals, [a, b]),
        [_, a, b, c] => divide_by(signals, [a, b, c]),
        [_, a, b, c, d] => divide_by(signals, [a, b, c, d]),
        [_, a, b, c, d, ref far @ ..] => divide_by_more(signals, [a, b, c, d], far),
    }
}

/// The same for a few weights, with the past in registers.
fn divide_by<const K: usize, const N: usize>(mut signals: [&mut [f64]; K], weights: [f64; N]) {
    let length = signals.iter().map(|values| values.len()).min().unwrap_or(0);
    let mut pasts = [[0.0; N]; K];
    for t in 0..length {
        for (values, past) in signals.iter_mut().zip(&mut pasts) {
            // The latest value comes last: only its product and one subtraction wait for the sample before.
            let mut sum = values[t];
            for k in (0..N).rev() {
                sum -= weights[k] * past[k];
            }
            // By hand: `rotate_right` moves memory, which the next sample would wait for.
            for k in (1..N).rev() {
                past[k] = past[k - 1];
            }
            past[0] = sum;
            values[t] = sum;
        }
    }
}

/// The same for more weights, those of lags beyond four in `far`: what is that long ago is in memory by then.
fn divide_by_more<const K: usize>(mut signals: [&mut [f64]; K], near: [f64; 4], far: &[f64]) {
    let length = signals.iter().map(|values| values.len()).min().unwrap_or(0);
    let mut pasts = [[0.0; 4]; K];
    for t in 0..length {
        let end = t.saturating_sub(near.len());
        let far = &far[..far.len().min(end)];
        for (values, past) in signals.iter_mut().zip(&mut pasts) {
            let mut sum = values[t];
            for (weight, x) in far.iter().rev().zip(&values[end - far.len()..end]) {
                sum -= weight * x;
            }
            for k in (0..near.len()).rev() {
                sum -= near[k] * past[k];
            }
            *past = [sum, past[0], past[1], past[2]];
            values[t] = sum;
        }
    }
}

/// x = w/A in place, `before` holding the x before the first, the latest last; what is not there is zero.
pub fn divide_from(weights: &[f64], before: &[f64], values: &mut [f64]) {
    let order = weights.len();
    let start = order.min(values.len());
    for t in 0..start {
        // x(t - 1 - k), the latest value last, as above.
        let earlier =
            |k: usize| if k < t { Some(&values[t - 1 - k]) } else { before.iter().rev().nth(k - t) };
        let products = weights.iter().enumerate().rev().filter_map(|(k, a)| Some(a * earlier(k)?));
        values[t] = products.fold(values[t], |sum, product| sum - product);
    }
    for t in start..values.len() {
        let earlier = weights.iter().rev().zip(&values[t - order..t]);
        values[t] = earlier.fold(values[t], |sum, (a, x)| sum - a * x);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    #[test]
    fn a_quotient_times_its_divisor_is_the_dividend() {
        let mut random = Random::of(2, 1);
        for order in 0..9 {
            let monic: Vec<f64> =
                (0..=order).map(|k| if k == 0 { 1.0 } else { 0.2 * random.normal() / k as f64 }).collect();
            for length in [0, 1, order, order + 1, 40] {
                let values: Vec<f64> = (0..length).map(|_| random.normal()).collect();
                let mut quotients = [values.clone(), values.iter().map(|value| -value).collect()];
                let [one, other] = &mut quotients;
                divide_together(&monic, [one, other]);
                let mut from = values.clone();
                divide_from(&monic[1..], &[], &mut from);
                for (t, value) in values.iter().enumerate() {
                    let known = monic.iter().zip(quotients[0][..=t].iter().rev());
                    let again: f64 = known.map(|(weight, x)| weight * x).sum();
                    assert!((again - value).abs() < 1e-13 * (1.0 + value.abs()));
                    assert_eq!(quotients[0][t], -quotients[1][t]);
                    assert!((from[t] - quotients[0][t]).abs() < 1e-13 * (1.0 + from[t].abs()));
                }
            }
        }
    }
}
