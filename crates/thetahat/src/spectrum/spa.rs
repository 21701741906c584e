//! Transforms of windowed covariances.

use std::f64::consts::PI;

use thetahat_core::nalgebra::Complex;
use thetahat_numerics::fourier::{PairTransform, suitable};

use super::estimate::{Bands, CrossSpectra, Estimate, Line, pairs};
use super::honesty;
use super::plan::{Estimator, Method};
use super::signals::Signals;
use crate::Error;

/// The shortest of the windows that are tried, in lags.
const SHORTEST: usize = 16;
/// The longest is this part of the longest segment: about twenty independent estimates are left.
const LONGEST: usize = 16;

/// Covariances of all channels at lags -M … M.
struct Covariances {
    channels: usize,
    lags: usize,
    /// Of each pair a <= b, row by row: R_ab(tau) = 1/N sum_t a(t + tau) b(t) at tau = -M … M.
    values: Vec<Vec<f64>>,
    /// N.
    samples: usize,
}

impl Covariances {
    /// By transforms of each segment, padded with zeros. O(N log N) for each pair of channels.
    fn new(signals: &Signals, lags: usize) -> Self {
        let channels = signals.channels.len();
        let samples = signals.samples();
        let mut values = vec![vec![0.0; 2 * lags + 1]; pairs(channels)];
        for segment in &signals.segments {
            // Lags from one end do not reach the other.
            let reach = lags.min(segment.len() - 1);
            let length = suitable(segment.len() + reach);
            let mut transform = PairTransform::new(length);
            let mut spectra = vec![Vec::new(); channels];
            for (first, second) in signals.pairs() {
                let [a, b] = [first, second].map(|channel| &signals.channels[channel][segment.clone()]);
                let found = transform.of(a.iter().copied().zip(b.iter().copied()));
                let (of_first, of_second): (Vec<_>, Vec<_>) = (0..length).map(|k| found.at(k)).unzip();
                spectra[first] = of_first;
                spectra[second] = of_second;
            }
            let products = (0..channels).flat_map(|a| (a..channels).map(move |b| (a, b))).zip(&mut values);
            for ((a, b), into) in products {
                // The transform of a product's real and imaginary parts holds the covariances: r(tau) is that of exp(i
                // ...), and a forward transform has them at -tau.
                let product = spectra[a].iter().zip(&spectra[b]).map(|(a, b)| a * b.conj());
                let found = transform.of(product.map(|product| (product.re, product.im)));
                let weight = 1.0 / (length as f64 * samples as f64);
                for (position, into) in into.iter_mut().enumerate() {
                    let lag = position as isize - lags as isize;
                    if lag.unsigned_abs() > reach {
                        continue;
                    }
                    let at = (-lag).rem_euclid(length as isize) as usize;
                    let (re, im) = found.at(at);
                    // Of re + i im; the covariances are real.
                    *into += weight * (re.re - im.im);
                }
            }
        }
        Self { channels, lags, values, samples }
    }

    /// Spectra at some angles through Hann's lag window w of M lags (Blackman and Tukey 1958; Ljung 1999, section 6.4):
    ///
    /// ```text
    /// S_ab(w) = sum_{|tau| <= M} w(tau) R_ab(tau) exp(-i w tau),   w(tau) = (1 + cos(pi tau/M))/2
    /// ```
    ///
    /// They count as N/sum w^2 = 4 N/(3 M) independent ones. O(M) for each angle and pair.
    fn spectra(&self, lags: usize, angles: &[f64]) -> CrossSpectra {
        let window: Vec<f64> =
            (0..=lags).map(|tau| 0.5 * (1.0 + (PI * tau as f64 / lags as f64).cos())).collect();
        let mut values = Vec::with_capacity(angles.len() * self.values.len());
        for angle in angles {
            let turns: Vec<(f64, f64)> = window
                .iter()
                .enumerate()
                .map(|(tau, w)| {
                    let (sine, cosine) = (angle * tau as f64).sin_cos();
                    (w * sine, w * cosine)
                })
                .collect();
            for covariance in &self.values {
                let (back, forth) = (&covariance[..=self.lags], &covariance[self.lags..]);
                let (mut re, mut im) = (forth[0], 0.0);
                let both = back.iter().rev().zip(forth).zip(&turns).skip(1);
                for ((before, after), (sine, cosine)) in both {
                    re += (after + before) * cosine;
                    im -= (after - before) * sine;
                }
                values.push(Complex::new(re, im));
            }
        }
        let weight: f64 = window.iter().skip(1).map(|w| 2.0 * w * w).sum();
        let averages = self.samples as f64 / (1.0 + weight);
        CrossSpectra { channels: self.channels, angles: angles.to_vec(), values, averages }
    }
}

/// The response by Blackman and Tukey's method. Without a number of lags it is twice the first of 16, 23, 32, … that
/// leaves the response as it is when it is doubled, within what chance explains: bands that hold are worth more than
/// the least error.
///
/// # Errors
/// [`Error::Argument`] for more lags than the longest segment has rows.
pub(super) fn spa(signals: &Signals, lags: Option<usize>, angles: &[f64]) -> Result<Estimate, Error> {
    let longest = signals.longest();
    if let Some(lags) = lags.filter(|lags| *lags >= longest) {
        return Err(Error::argument(
            "lags",
            format!(
                "{lags} lags need a segment of more rows than that; the longest without a gap has {longest}"
            ),
        ));
    }
    if longest < 3 {
        return Err(Error::data(format!(
            "the longest segment without a gap has {longest} rows; spa needs 3 at least"
        )));
    }
    let most = (longest / LONGEST).clamp(1, longest - 1);
    let covariances = Covariances::new(signals, (2 * lags.unwrap_or(most)).min(longest - 1));
    let lines = |lags: usize| covariances.spectra(lags, angles).lines(Estimator::H1);
    let lags = lags.unwrap_or_else(|| {
        let each = |step: i32| (SHORTEST as f64 * (0.5 * f64::from(step)).exp2()).round() as usize;
        let tried = (0..).map(each).take_while(|&lags| lags < most);
        let resolved =
            |lags: &usize| honesty::outside(&lines(*lags), &lines(2 * lags)).is_some_and(|of| of.is_chance());
        // Twice as many: the bias that was not seen is then a fourth.
        tried.into_iter().find(resolved).map_or(most, |lags| (2 * lags).min(most))
    });
    let finer: Option<Vec<Line>> = (2 * lags < longest).then(|| lines(2 * lags));
    let bands = finer.map_or(
        Bands::Unknown("a window of twice the lags, which would tell, does not fit into the log"),
        Bands::Against,
    );
    Ok(Estimate { method: Method::Spa { lags: Some(lags) }, lines: lines(lags), bands, words: Vec::new() })
}
