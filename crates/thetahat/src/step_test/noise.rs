//! The noise of an output at rest, with its colour.

use crate::inspect::autoregression;

/// Correlations below this count as none, and no more lags than these are taken.
const FAINT: f64 = 1e-3;
const LAGS: usize = 1000;
/// The correlation from row to row of what lasts longer.
const SLOWEST: f64 = 0.99;

/// Autocovariances of the noise.
#[derive(Debug)]
pub(super) struct Noise {
    /// At lags of 0, 1, … rows; those after them are zero.
    covariance: Vec<f64>,
}

impl Noise {
    /// From what is left of the output where it is at rest: the variance about the mean of each part, and the
    /// correlation of an autoregression A(q) e = w whose order is that of the least description length. With g the
    /// impulse response of 1/A the covariance at lag k is proportional to sum_j g_j g_{j+k}, so that no combination of
    /// rows has a negative variance. Of values that are multiples of a `step`, 0 of others, noise that is less than a
    /// step is that of rounding, which stays the same while the output rests: of variance step^2/12 (Widrow and Kollar,
    /// Quantization Noise, 2008, section 5.2) at all lags. O(N).
    pub(super) fn of(parts: &[&[f64]], step: f64) -> Self {
        let (mut left, mut segments, mut degrees) = (Vec::new(), Vec::new(), 0);
        for part in parts.iter().filter(|part| part.len() > 1) {
            let mean = part.iter().sum::<f64>() / part.len() as f64;
            segments.push(left.len()..left.len() + part.len());
            left.extend(part.iter().map(|value| value - mean));
            degrees += part.len() - 1;
        }
        let square: f64 = left.iter().map(|value| value * value).sum();
        let variance = square / degrees.max(1) as f64;
        if step > 0.0 && variance < 0.25 * step * step {
            return Self { covariance: vec![step * step / 12.0; LAGS] };
        }
        if !(variance > 0.0 && variance.is_finite()) {
            return Self { covariance: vec![0.0] };
        }
        let response = impulse_response(&autoregression(&left, &segments)).unwrap_or_else(|| {
            // What is left moves slowly, over more rows than these: a drift.
            let products: f64 = left.windows(2).map(|pair| pair[0] * pair[1]).sum();
            let next = (products / square).clamp(-SLOWEST, SLOWEST);
            (0..LAGS).map(|lag| next.powi(lag as i32)).collect()
        });
        let correlation = |lag: usize| -> f64 {
            response.iter().zip(&response[lag..]).map(|(first, second)| first * second).sum()
        };
        let scale = variance / correlation(0);
        Self { covariance: (0..response.len()).map(|lag| scale * correlation(lag)).collect() }
    }

    /// The standard deviation.
    pub(super) fn deviation(&self) -> f64 {
        self.covariance.first().map_or(0.0, |variance| variance.sqrt())
    }

    /// How many rows tell as much as one of white noise.
    pub(super) fn correlation(&self) -> f64 {
        let white = self.covariance[0];
        if white > 0.0 { self.long_run() / white } else { 1.0 }
    }

    /// The sum of the covariances at all lags.
    fn long_run(&self) -> f64 {
        (self.covariance[0] + 2.0 * self.covariance[1..].iter().sum::<f64>()).max(0.0)
    }

    /// The variance of a combination of rows. O(rows times lags).
    pub(super) fn variance(&self, weights: &[f64]) -> f64 {
        let first = weights.iter().position(|weight| *weight != 0.0).unwrap_or(0);
        let last = weights.iter().rposition(|weight| *weight != 0.0).map_or(first, |last| last + 1);
        let weights = &weights[first..last];
        let at = |lag: usize| -> f64 { weights.iter().zip(&weights[lag..]).map(|(a, b)| a * b).sum() };
        let lags = self.covariance.iter().enumerate().take(weights.len());
        lags.map(|(lag, covariance)| covariance * at(lag) * if lag > 0 { 2.0 } else { 1.0 })
            .sum::<f64>()
            .max(0.0)
    }

    /// The variance of the mean of this many rows.
    pub(super) fn of_mean(&self, count: usize) -> f64 {
        let rows = count.max(1) as f64;
        let lags = self.covariance.iter().enumerate().skip(1).take(count.saturating_sub(1));
        let shared: f64 = lags.map(|(lag, covariance)| 2.0 * (1.0 - lag as f64 / rows) * covariance).sum();
        ((self.covariance[0] + shared) / rows).max(0.0)
    }
}

/// That of 1/A up to where nothing is left of it; none if that takes too long, as of an A that is not stable.
fn impulse_response(monic: &[f64]) -> Option<Vec<f64>> {
    let mut response = vec![1.0];
    let order = monic.len() - 1;
    while response.len() < LAGS {
        let last = response.len();
        let past = monic.iter().enumerate().skip(1).take(last);
        response.push(past.map(|(lag, a)| -a * response[last - lag]).sum());
        let tail = &response[response.len().saturating_sub(order.max(1))..];
        if tail.iter().all(|value: &f64| value.abs() < FAINT) {
            return Some(response);
        }
    }
    None
}
