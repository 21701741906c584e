//! What tests of many modules say.

use thetahat_core::nalgebra::DMatrix;

use crate::Error;
use crate::data::{Channel, Log};

pub(crate) fn channel(name: &str, values: impl AsRef<[f64]>) -> Channel {
    Channel { name: name.to_owned(), values: values.as_ref().to_vec() }
}

pub(crate) fn log(channels: &[(&str, impl AsRef<[f64]>)], sample_time: f64) -> Log {
    let channels = channels.iter().map(|(name, values)| channel(name, values)).collect();
    Log::new(channels, sample_time).expect("a log")
}

pub(crate) fn near(found: &[f64], expected: &[f64], tolerance: f64) -> bool {
    found.len() == expected.len()
        && found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < tolerance)
}

/// Row by row.
pub(crate) fn matrix(rows: &[&[f64]]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), rows[0].len(), |row, column| rows[row][column])
}

/// This many numbers that look random, in -1 … 1: a linear congruential generator (Press and others, Numerical Recipes,
/// 1992).
pub(crate) fn congruential(seed: u32, count: usize) -> Vec<f64> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 23) - 1.0
    };
    (0..count).map(|_| next()).collect()
}

/// (numerator/denominator) signal, from rest.
pub(crate) fn filtered(numerator: &[f64], denominator: &[f64], signal: &[f64]) -> Vec<f64> {
    let mut response: Vec<f64> = Vec::with_capacity(signal.len());
    for t in 0..signal.len() {
        let driven: f64 = (0..numerator.len().min(t + 1)).map(|i| numerator[i] * signal[t - i]).sum();
        let past: f64 = (1..denominator.len().min(t + 1)).map(|i| denominator[i] * response[t - i]).sum();
        response.push(driven - past);
    }
    response
}

/// It is refused in these words.
#[track_caller]
pub(crate) fn assert_refused<V>(found: Result<V, Error>, words: &str) {
    let error = found.err().expect(words).to_string();
    assert!(error.contains(words), "{words}: {error}");
}
