//! The delay from an input to the output, and how the two go together.

use std::ops::Range;

use thetahat_numerics::regression::{Lagged, LaggedMoments, Presample, Taps, sum_of_squares};

use super::moments::samples;
use super::{DelayEstimate, whitening};
use crate::Error;
use crate::data::Record;
use crate::estimate::{self, Initial, Kernel, Method};
use crate::model::Orders;
use crate::select::{constant_pays, delays};

/// The highest lag tried.
const HIGHEST: usize = 50;
/// Impulse responses of so many values in all.
const WIDEST: usize = 200;
/// They are of so many of the first rows, which show as much.
const RESPONSE_ROWS: usize = 20_000;
/// Samples for each lag tried.
const SAMPLES: usize = 10;
/// Below this fraction of the square of a signal, what is left of it by its past is rounding.
const ROUNDING: f64 = 1e-8;
/// Half the width of the band that holds 95 % of a standard normal variable.
const BAND: f64 = 1.959_963_984_540_054;

/// Puts in the delays of all inputs together, as a fit without orders finds them: see `select::delay`. Inputs that
/// never change have none; `follows` says which follow the output.
///
/// The signals are deviations.
pub(super) fn estimate(
    found: &mut [DelayEstimate],
    inputs: &[Vec<f64>],
    output: &[f64],
    segments: &[Range<usize>],
    follows: &[bool],
) -> Result<(), Error> {
    let moving: Vec<usize> =
        (0..inputs.len()).filter(|&input| inputs[input].iter().any(|value| *value != 0.0)).collect();
    if segments.is_empty() || output.iter().all(|value| *value == 0.0) {
        return Ok(());
    }
    let mut record = Record {
        output,
        inputs: moving.iter().map(|&input| inputs[input].as_slice()).collect(),
        segments: segments.to_vec(),
        past: vec![0; segments.len()],
    };
    let ones = vec![1.0; output.len()];
    if constant_pays(&record) {
        record.inputs.push(&ones);
    }
    let names: Vec<String> = moving.iter().map(|&input| found[input].input.clone()).collect();
    let follows: Vec<bool> = moving.iter().map(|&input| follows[input]).collect();
    for (&input, delay) in moving.iter().zip(delays(&record, &names, &follows)?) {
        found[input].confidence = delay.confidence;
        found[input].nk = delay.confidence.map(|_| delay.nk);
    }
    record.inputs.truncate(moving.len());
    respond(found, &moving, &record);
    Ok(())
}

/// Puts in the impulse responses of the inputs of a record, in units of its signals, as far as the highest lag tried.
/// O(M^3) for M lags of all of them.
pub(super) fn respond(found: &mut [DelayEstimate], moving: &[usize], record: &Record<'_>) {
    let end = record.output.len().min(RESPONSE_ROWS);
    let within = record.segments.iter().map(|segment| segment.start..segment.end.min(end));
    let segments: Vec<Range<usize>> = within.filter(|segment| !segment.is_empty()).collect();
    let count = samples(&segments);
    let record = &Record {
        output: &record.output[..end],
        inputs: record.inputs.iter().map(|input| &input[..end]).collect(),
        past: vec![0; segments.len()],
        segments,
    };
    let taps = (HIGHEST + 1).min(count / (SAMPLES * moving.len().max(1)));
    if moving.is_empty() || taps < 2 || taps * moving.len() > WIDEST {
        return;
    }
    let Ok(orders) = Orders::arx(0, &vec![taps; moving.len()], &vec![0; moving.len()]) else { return };
    let Ok(estimate) = estimate::estimate(record, &orders, &Method::Regularised(Kernel::Dc), Initial::Drop)
    else {
        return;
    };
    let Some(covariance) = estimate.covariance() else { return };
    for (own, &input) in moving.iter().enumerate() {
        let places = own * taps..(own + 1) * taps;
        found[input].impulse_response = estimate.parameters()[places.clone()].to_vec();
        found[input].impulse_response_errors = places.map(|place| covariance[place][place].sqrt()).collect();
    }
}

/// The correlation of the prewhitened signals:
///
/// ```text
/// a(t) = A_u(q) u(t),   b(t) = A_y(q) y(t),   r(k) = sum a(t - k) b(t) / sqrt(sum a^2 sum b^2)
/// ```
///
/// with autoregressions A_u of the input and A_y of the output. Box and Jenkins (Time Series Analysis, 1976, section
/// 11.2) filter both by A_u, which leaves b as slow as the output is and its correlations small; with a filter each
/// (Haugh, JASA 71, 1976) b is the output's own innovation. Neither filter moves the first lag at which there is an
/// effect, as both are monic in q^-1: b = A_y/A_u B/F a + noise, which begins at q^-nk.
///
/// As a is white, r(k) has the variance 1/N at lags before the delay, whatever the noise (Bartlett's formula: its sum
/// over the products of both autocorrelations has one term left). So it has at negative lags, where the input comes
/// after the output, unless it follows the output. O(N M).
///
/// The signals are deviations, zero outside of the segments. The delay itself is left open: the first correlation that
/// stands out is often too late where the input is slow.
pub(super) fn correlation(
    name: &str,
    input: &[f64],
    output: &[f64],
    segments: &[Range<usize>],
) -> DelayEstimate {
    let mut found = DelayEstimate::unknown(name);
    let (of_input, of_output) =
        (whitening::autoregression(input, segments), whitening::autoregression(output, segments));
    let left_out = of_input.len().max(of_output.len()) - 1;
    let kept = whitening::shortened(segments, left_out);
    let count = samples(&kept);
    let lags = HIGHEST.min(count / SAMPLES);
    if lags == 0 {
        return found;
    }
    let a = whitening::filtered(&of_input, input, &kept_with_past(&kept, of_input.len() - 1));
    let b = whitening::filtered(&of_output, output, &kept_with_past(&kept, of_output.len() - 1));
    let square =
        |signal: &[f64]| -> f64 { kept.iter().map(|segment| sum_of_squares(&signal[segment.clone()])).sum() };
    let size = square(&a).sqrt() * square(&b).sqrt();
    // An input that its own past determines brings nothing new that could be found again.
    let known = square(&a) <= ROUNDING * square(input) || square(&b) <= ROUNDING * square(output);
    if known || !size.is_normal() {
        return found;
    }
    let correlation = |late: &[f64], early: &[f64], first: usize| -> Vec<f64> {
        let taps = vec![Taps { signal: 1, first, count: lags + 1 - first, sign: 1.0 }];
        let (_, products, _) = Lagged::new(&[late, early], taps, &kept, Presample::Zero).normal_equations();
        products.iter().map(|product| (product / size).clamp(-1.0, 1.0)).collect()
    };
    found.correlation = correlation(&b, &a, 0);
    found.following = correlation(&a, &b, 1);
    found.band = BAND / (count as f64).sqrt();
    found
}

/// The same of signals of which the moments are known, as far as their lags reach: with S the sums of products,
///
/// ```text
/// sum a(t - k) b(t) = sum_i sum_j A_u,i A_y,j S[u(t - k - i), y(t - j)]
/// ```
pub(super) fn correlation_of(
    name: &str,
    moments: &LaggedMoments,
    input: usize,
    output: usize,
) -> DelayEstimate {
    let mut found = DelayEstimate::unknown(name);
    let white = |signal: usize| {
        let highest = whitening::HIGHEST.min(moments.longest() / 2).min(moments.rows() / SAMPLES);
        let own = [Taps { signal: 0, first: 1, count: highest, sign: -1.0 }];
        whitening::of_products(moments.normal_equations(&[signal], &own), moments.rows())
    };
    let (a, b) = ((input, white(input)), (output, white(output)));
    let lags = HIGHEST.min(moments.longest() + 1 - a.1.len().max(b.1.len())).min(moments.rows() / SAMPLES);
    if lags == 0 {
        return found;
    }
    let product = |(early, weights): &(usize, Vec<f64>), lag: usize, (late, others): &(usize, Vec<f64>)| {
        let inner = |i: usize| -> f64 {
            let each = others.iter().enumerate();
            each.map(|(j, other)| other * moments.product((*early, lag + i), (*late, j))).sum()
        };
        weights.iter().enumerate().map(|(i, weight)| weight * inner(i)).sum::<f64>()
    };
    let (of_input, of_output) = (product(&a, 0, &a), product(&b, 0, &b));
    let whole = |signal: usize| moments.product((signal, 0), (signal, 0));
    let known = of_input <= ROUNDING * whole(input) || of_output <= ROUNDING * whole(output);
    let size = of_input.sqrt() * of_output.sqrt();
    if known || !size.is_normal() {
        return found;
    }
    found.correlation = (0..=lags).map(|lag| (product(&a, lag, &b) / size).clamp(-1.0, 1.0)).collect();
    found.following = (1..=lags).map(|lag| (product(&b, lag, &a) / size).clamp(-1.0, 1.0)).collect();
    found.band = BAND / (moments.rows() as f64).sqrt();
    found
}

/// The segments with this many samples more at their beginnings.
fn kept_with_past(kept: &[Range<usize>], past: usize) -> Vec<Range<usize>> {
    kept.iter().map(|segment| segment.start - past..segment.end).collect()
}
