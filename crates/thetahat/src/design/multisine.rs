//! Sums of sinusoids whose phases make the peak low.
//!
//! ```text
//! u(t) = sum_k cos(2 pi k t/P + phi_k),   k in some lines,   crest factor = max |u| / root mean square of u
//! ```
//!
//! All lines have the same amplitude, so that only the phases are free. Schroeder's, from the group delay of a sweep
//! (IEEE Transactions on Information Theory 16 (1970)), give about 1.7, random ones 2.7 to 3. From these as starts u is
//! clipped, and the phases of what is left are taken with the old amplitudes, over and over, the clip coming closer to
//! the peak (Van der Ouderaa, Schoukens and Renneboog, IEEE Transactions on Instrumentation and Measurement 37 (1988)).
//! What is above the clip is taken off several times over: from the same starts peaks come out a hundredth lower on
//! flat lines, and a tenth on logarithmic ones.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use rayon::prelude::*;
use thetahat_core::nalgebra::Complex;
use thetahat_numerics::fourier::{self, Fft};
use thetahat_numerics::random::Random;

/// Pairs of starts: one transform serves two real signals, as real and imaginary parts. The first start has Schroeder's
/// phases.
const PAIRS: u64 = 5;
/// Rounds of clipping from each start, the fewest and the most, and samples for all of them together.
const ROUNDS: [usize; 2] = [100, 1000];
const SAMPLES: usize = 1 << 22;
/// The clip as a fraction of the peak, in the first round and in the last.
const CLIP: [f64; 2] = [0.7, 0.999];
/// What is above the clip is taken off so many times.
const TAKEN: f64 = 8.0;

/// One period of the sum with the lowest peak that was found, largest value 1. `lines` are numbers of periods in P
/// samples, above 0 and below P/2. O(P log P) for each of at most 1000 rounds from 10 starts, which run in parallel;
/// which of them wins does not depend on that.
pub(super) fn low_crest(lines: &[usize], period: usize, seed: u64) -> Vec<f64> {
    let [forward, inverse] = fourier::portable(period);
    let of = |pair| {
        Search::new(lines, period, &forward, &inverse)
            .lowest([0, 1].map(|k| phases(lines.len(), seed, 2 * pair + k)))
    };
    let found: Vec<[Lowest; 2]> = (0..PAIRS).into_par_iter().map(of).collect();
    let best = found.into_iter().flatten().min_by(|one, other| one.peak.total_cmp(&other.peak));
    let Lowest { peak, mut values } = best.unwrap_or_default();
    values.iter_mut().for_each(|value| *value /= peak);
    values
}

/// The phases of a start.
fn phases(lines: usize, seed: u64, start: u64) -> Vec<f64> {
    let mut random = Random::of(seed, start);
    // Of n lines of one size the k-th, from 0, has -pi k (k + 1)/n.
    let schroeder = |k: usize| -PI * (k * (k + 1) % (2 * lines)) as f64 / lines as f64;
    (0..lines).map(|k| if start == 0 { schroeder(k) } else { TAU * random.uniform() }).collect()
}

/// The lowest peak on the way from a start, and the values that have it.
#[derive(Default)]
struct Lowest {
    peak: f64,
    values: Vec<f64>,
}

/// The workspace of a pair of starts.
struct Search<'a> {
    lines: &'a [usize],
    forward: &'a Arc<dyn Fft<f64>>,
    inverse: &'a Arc<dyn Fft<f64>>,
    /// Both signals, or their transforms.
    values: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
}

impl<'a> Search<'a> {
    fn new(
        lines: &'a [usize],
        period: usize,
        forward: &'a Arc<dyn Fft<f64>>,
        inverse: &'a Arc<dyn Fft<f64>>,
    ) -> Self {
        let longest = forward.get_inplace_scratch_len().max(inverse.get_inplace_scratch_len());
        let zeros = |count: usize| vec![Complex::default(); count];
        Self { lines, forward, inverse, values: zeros(period), scratch: zeros(longest) }
    }

    fn lowest(mut self, phases: [Vec<f64>; 2]) -> [Lowest; 2] {
        let mut units = phases.map(|phases| -> Vec<Complex<f64>> {
            phases.iter().map(|phase| Complex::from_polar(1.0, *phase)).collect()
        });
        let mut best = [0, 1].map(|_| Lowest { peak: f64::INFINITY, values: Vec::new() });
        let rounds = (SAMPLES / self.values.len()).clamp(ROUNDS[0], ROUNDS[1]);
        for round in 0..=rounds {
            self.sum(&units);
            let peaks = self
                .values
                .iter()
                .fold([0.0_f64; 2], |[re, im], value| [re.max(value.re.abs()), im.max(value.im.abs())]);
            for (part, (best, peak)) in best.iter_mut().zip(peaks).enumerate() {
                if peak < best.peak {
                    let of = |value: &Complex<f64>| if part == 0 { value.re } else { value.im };
                    *best = Lowest { peak, values: self.values.iter().map(of).collect() };
                }
            }
            let level = CLIP[0] + (CLIP[1] - CLIP[0]) * round as f64 / rounds as f64;
            let [re, im] = peaks.map(|peak| peak * level);
            for value in &mut self.values {
                value.re -= TAKEN * (value.re - value.re.clamp(-re, re));
                value.im -= TAKEN * (value.im - value.im.clamp(-im, im));
            }
            self.take_phases(&mut units);
        }
        best
    }

    /// The sums of the lines with these phases.
    fn sum(&mut self, units: &[Vec<Complex<f64>>; 2]) {
        self.values.fill(Complex::default());
        let period = self.values.len();
        for ((&line, x), y) in self.lines.iter().zip(&units[0]).zip(&units[1]) {
            self.values[line] = Complex::new(x.re - y.im, x.im + y.re);
            self.values[period - line] = Complex::new(x.re + y.im, y.re - x.im);
        }
        self.inverse.process_with_scratch(&mut self.values, &mut self.scratch);
    }

    /// The phases of the lines in the values; a line that is not there keeps its own.
    fn take_phases(&mut self, units: &mut [Vec<Complex<f64>>; 2]) {
        self.forward.process_with_scratch(&mut self.values, &mut self.scratch);
        let [first, second] = units;
        for ((&line, x), y) in self.lines.iter().zip(first).zip(second) {
            let (here, mirrored) = (self.values[line], self.values[self.values.len() - line].conj());
            let (sum, difference) = (here + mirrored, here - mirrored);
            for (unit, found) in [(x, sum), (y, Complex::new(difference.im, -difference.re))] {
                let size = found.norm();
                if size > 0.0 {
                    *unit = found / size;
                }
            }
        }
    }
}
