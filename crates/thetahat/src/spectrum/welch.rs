//! Averages over windows that overlap by half.

use std::f64::consts::{PI, TAU};

use rayon::prelude::*;
use thetahat_core::nalgebra::Complex;
use thetahat_numerics::fourier::PairTransform;
use thetahat_numerics::regression::sum_of_squares;

use super::estimate::{Bands, CrossSpectra, Estimate, Line, pairs};
use super::plan::{Estimator, Method};
use super::signals::Signals;
use crate::Error;

/// Windows that one thread adds up: their sums are folded in order.
const BLOCK: usize = 64;
/// Hann's window and the same moved by half its length: (sum h(t) h(t + L/2) / sum h(t)^2)^2.
const OVERLAP: f64 = 1.0 / 36.0;
/// The shortest window.
const SHORTEST: usize = 8;

/// Spectra of all channels by Welch's method (IEEE Transactions on Audio and Electroacoustics 15 (1967)), with Hann's
/// window h:
///
/// ```text
/// S_ab(2 pi k/L) = mean of A_k conj(B_k) / sum_t h(t)^2,   A_k = sum_t h(t) a(t) exp(-i 2 pi k t/L),   0 < k < L/2
/// ```
///
/// Windows overlap by half and lie within segments. K of them, P of which overlap with the next, count as K/(1 + P/(18
/// K)) independent ones. O(N log L) for each channel, in one pass.
pub(super) fn cross_spectra(signals: &Signals, length: usize, band: (f64, f64)) -> CrossSpectra {
    let step = length / 2;
    let windows = |rows: usize| if rows < length { 0 } else { (rows - length) / step + 1 };
    let starts: Vec<usize> = signals
        .segments
        .iter()
        .flat_map(|segment| (0..windows(segment.len())).map(|k| segment.start + k * step))
        .collect();
    let overlaps: usize =
        signals.segments.iter().map(|segment| windows(segment.len()).saturating_sub(1)).sum();
    let window: Vec<f64> = (0..length).map(|t| (PI * t as f64 / length as f64).sin().powi(2)).collect();
    let angle = |k: usize| TAU * k as f64 / length as f64;
    let lines: Vec<usize> =
        (1..length.div_ceil(2)).filter(|&k| (band.0..=band.1).contains(&angle(k))).collect();
    let channels = signals.channels.len();
    let size = lines.len() * pairs(channels);
    let add = |starts: &[usize]| {
        let mut transform = PairTransform::new(length);
        let mut sums = vec![Complex::default(); size];
        let mut spectra = vec![Complex::default(); lines.len() * channels];
        for &start in starts {
            for (first, second) in signals.pairs() {
                let [a, b] = [first, second].map(|channel| &signals.channels[channel][start..start + length]);
                let found = transform.of(window.iter().zip(a).zip(b).map(|((h, a), b)| (h * a, h * b)));
                for (spectra, &k) in spectra.chunks_exact_mut(channels).zip(&lines) {
                    let (of_first, of_second) = found.at(k);
                    (spectra[first], spectra[second]) = (of_first, of_second);
                }
            }
            add_products(&mut sums, &spectra, channels);
        }
        sums
    };
    let parts: Vec<Vec<Complex<f64>>> = starts.par_chunks(BLOCK).map(add).collect();
    let mut values = vec![Complex::default(); size];
    parts.iter().for_each(|part| values.iter_mut().zip(part).for_each(|(sum, own)| *sum += own));
    let count = starts.len() as f64;
    let weight = 1.0 / (sum_of_squares(&window) * count.max(1.0));
    values.iter_mut().for_each(|value| *value *= weight);
    let averages = count / (1.0 + 2.0 * OVERLAP * overlaps as f64 / count.max(1.0));
    CrossSpectra { channels, angles: lines.into_iter().map(angle).collect(), values, averages }
}

/// Adds a conj(b) of all pairs of channels, line by line.
fn add_products(sums: &mut [Complex<f64>], spectra: &[Complex<f64>], channels: usize) {
    for (sums, own) in sums.chunks_exact_mut(pairs(channels)).zip(spectra.chunks_exact(channels)) {
        let products = own.iter().enumerate().flat_map(|(k, a)| own[k..].iter().map(move |b| a * b.conj()));
        sums.iter_mut().zip(products).for_each(|(sum, product)| *sum += product);
    }
}

/// The response by [`cross_spectra`].
///
/// # Errors
/// [`Error::Argument`] for a window longer than each segment; [`Error::Data`] for a log too short for any.
pub(super) fn welch(
    signals: &Signals,
    window: Option<usize>,
    estimator: Estimator,
    band: (f64, f64),
) -> Result<Estimate, Error> {
    let longest = signals.longest();
    if longest < SHORTEST {
        return Err(Error::data(format!(
            "the longest segment without a gap has {longest} rows; welch needs {SHORTEST} at least"
        )));
    }
    let length = match window {
        Some(length) if length > longest => {
            return Err(Error::argument(
                "window",
                format!(
                    "{length} rows are more than the longest segment without a gap has, {longest}; give {longest} at most"
                ),
            ));
        }
        Some(length) => length,
        // About fifteen windows.
        None => (1 << (signals.samples() / 8).max(SHORTEST).ilog2()).min(longest),
    };
    let lines = cross_spectra(signals, length, band).lines(estimator);
    let bands = if 2 * length <= longest {
        // Each line of the one is every other line of the other.
        let finer = cross_spectra(signals, 2 * length, band).lines(estimator);
        let kept = |line: &Line| {
            let k = line.angle * length as f64 / TAU;
            (k - k.round()).abs() < 0.25
        };
        Bands::Against(finer.into_iter().filter(kept).collect())
    } else {
        Bands::Unknown("windows of twice the length, which would tell, do not fit into the log")
    };
    let method = Method::Welch { window: Some(length), estimator };
    Ok(Estimate { method, lines, bands, words: Vec::new() })
}
