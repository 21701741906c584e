//! How often a cumulative sum gives a false alarm, and the thresholds that make it as seldom as asked.
//!
//! A chart g <- max(0, g + w), with independent w of distribution F, starts at 0 and gives an alarm once g > h. Its
//! average run length L is the mean number of samples until then. With L(x) for a start at x (Page 1954),
//!
//! ```text
//! L(x) = 1 + L(0) F(-x) + integral from 0 to h of L(y) dF(y - x)
//! ```
//!
//! It is solved by collocation on m + 1 points, L being linear between them: with d = h/m and G the integral of F,
//!
//! ```text
//! integral from y to y + d of (t - y)/d dF(t - x) = F(y + d - x) - (G(y + d - x) - G(y - x))/d
//! ```
//!
//! so that a density that is infinite somewhere, such as that of chi-square with one degree of freedom, does no harm
//! (as it does to the Markov chain of Brook and Evans 1972, which takes L for constant between points). The error falls
//! as 1/m^2, and what is left of it is taken off by comparing two m.

use std::f64::consts::{LN_2, PI, SQRT_2};

use statrs::function::erf::erfc;
use statrs::function::gamma::gamma_lr;
use thetahat_core::ChangeDetector;

use crate::Error;

/// The number of segments between points, and half of it for comparison.
const SEGMENTS: usize = 240;
/// The search for a threshold ends once its average run length is this close to the one asked for, relative to it.
const PRECISION: f64 = 1e-6;

/// The charts that give one false alarm in `interval` samples on average, all together, if the innovations are Gaussian
/// and as large as their variance says. With one output half of the alarms are from the two charts of the mean, half
/// from that of the variance. With L the average run length of a chart, the mean number of samples until it gives a
/// false alarm,
///
/// ```text
/// mean up       L = 4 interval
/// mean down     L = 4 interval
/// variance      L = 2 interval
/// ```
///
/// Rates add: 1/(4 interval) + 1/(4 interval) + 1/(2 interval) = 1/interval. So they do for the two charts of the mean
/// (Kemp, The average run length of the cumulative sum chart when a V-mask is used, J. R. Statist. Soc. B 23, 1961);
/// with the chart of the variance as far as alarms do not coincide.
///
/// With several outputs the chart of the variance is alone, and its L is the interval: its steps are those of
/// chi-square with as many degrees of freedom as `outputs`. Where some are missing at times it gives alarms about as
/// often: with three outputs, each missing in a fifth of the samples, 0.84 times (measured).
///
/// For the charts see [`ChangeDetector`]. The thresholds solve Page's integral equation (1954) to 0.1 % of the interval
/// up to 1e6, and to 1 % at 1e9.
///
/// Cost: some 20 run lengths for each of the two thresholds, each of two Toeplitz systems, of 121 and of 241 rows: some
/// 3e7 multiply-adds in all, once for a detector.
///
/// How real alarms differ: charts that see the same innovations give an alarm together at times, which makes false ones
/// a little rarer than asked. An estimator with a short memory takes its innovations for a little less sure than they
/// are: with 4 parameters and a factor of 0.99 they came 0.5 to 0.7 times as often, with 0.999 or without forgetting
/// 0.9 to 1.1 times (measured). Outliers and heavy tails give more, mostly on the chart of the variance.
///
/// # Errors
/// [`Error::Argument`] if the interval is not in 10 … 1e9, or there are not 1 to 1000 outputs.
///
/// ```
/// use thetahat::thetahat_core::Chart;
/// use thetahat::track::change_detector;
///
/// let detector = change_detector(10_000.0, 1)?;
/// assert!((detector.threshold(Chart::MeanUp) - 8.75).abs() < 0.01);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn change_detector(interval: f64, outputs: usize) -> Result<ChangeDetector<f64>, Error> {
    if !(10.0..=1e9).contains(&interval) {
        return Err(Error::argument(
            "alarm",
            format!(
                "{interval} is not a number of samples from 10 to 1e9: give the mean number between false alarms"
            ),
        ));
    }
    let thresholds = match outputs {
        1 => (threshold(4.0 * interval, mean), threshold(2.0 * interval, |w| variance(w, 1))),
        2..=1000 => (f64::INFINITY, threshold(interval, |w| variance(w, outputs))),
        _ => return Err(Error::argument("outputs", format!("{outputs} is not in 1 … 1000"))),
    };
    ChangeDetector::new(thresholds.0, thresholds.1)
        .map_err(|error| Error::argument("alarm", error.to_string()))
}

/// The steps of a chart of the mean, z - 1/2: normal, with G(w) = x Phi(x) + phi(x), x = w + 1/2.
fn mean(w: f64) -> Steps {
    let x = w + 0.5;
    let distribution = erfc(-x / SQRT_2) / 2.0;
    Steps { distribution, integral: x * distribution + density(x) }
}

/// The steps of the chart of the variance, (s/2 - m ln 2)/2: with F_m the distribution function of chi-square with m
/// degrees of freedom,
///
/// ```text
/// s = 4 w + 2 m ln 2,     4 G = s F_m(s) - m F_(m+2)(s)
/// ```
fn variance(w: f64, outputs: usize) -> Steps {
    let degrees = outputs as f64;
    let square = 4.0 * w + 2.0 * degrees * LN_2;
    if square <= 0.0 {
        return Steps::default();
    }
    let distribution = gamma_lr(degrees / 2.0, square / 2.0);
    let next = gamma_lr(degrees / 2.0 + 1.0, square / 2.0);
    Steps { distribution, integral: (square * distribution - degrees * next) / 4.0 }
}

/// phi, the density of the normal distribution.
fn density(x: f64) -> f64 {
    (-x * x / 2.0).exp() / (2.0 * PI).sqrt()
}

/// The threshold h with the average run length that is asked for: by regula falsi, in its Illinois form, on ln L, which
/// is nearly a line.
///
/// The steps are log-likelihood ratios, so that L >= exp(h) (Lorden, Procedures for reacting to a change in
/// distribution, 1971): h lies between 0 and ln L.
fn threshold(interval: f64, steps: impl Fn(f64) -> Steps + Copy) -> f64 {
    let excess = |h: f64| (average_run_length(h, steps) / interval).ln();
    let (mut low, mut high) = (0.0, interval.ln());
    let (mut below, mut above) = (-(interval * (1.0 - steps(0.0).distribution)).ln(), excess(high));
    // Where a step above 0 is rarer than that, as with many outputs, so is an alarm: the least threshold is the answer.
    if below >= 0.0 {
        return f64::MIN_POSITIVE;
    }
    let mut middle = high;
    for _ in 0..60 {
        middle = low - below * (high - low) / (above - below);
        let found = excess(middle);
        if found.abs() < PRECISION {
            break;
        }
        if found > 0.0 {
            (high, above) = (middle, found);
            below /= 2.0;
        } else {
            (low, below) = (middle, found);
            above /= 2.0;
        }
    }
    middle
}

/// L for a start at 0, the error in 1/m^2 taken off.
fn average_run_length(threshold: f64, steps: impl Fn(f64) -> Steps + Copy) -> f64 {
    let coarse = on_points(SEGMENTS / 2, threshold, steps);
    let fine = on_points(SEGMENTS, threshold, steps);
    fine + (fine - coarse) / 3.0
}

/// L for a start at 0 by collocation at m + 1 points: L = 1 + P L, where all columns of P but the first and the last
/// are those of a Toeplitz matrix T,
///
/// ```text
/// P L = T L + p L(0) + q L(h)
/// ```
///
/// With (I - T) (a, b, c) = (1, p, q) that is L = a + b L(0) + c L(h), of which the first and the last row have two
/// unknowns.
fn on_points(segments: usize, threshold: f64, steps: impl Fn(f64) -> Steps) -> f64 {
    let width = threshold / segments as f64;
    let points = segments + 1;
    // F and G at all differences of two points, and one beyond at both ends.
    let at: Vec<Steps> =
        (0..=2 * points).map(|index| steps((index as f64 - points as f64) * width)).collect();
    let slopes: Vec<f64> = at.windows(2).map(|pair| (pair[1].integral - pair[0].integral) / width).collect();
    let entries: Vec<f64> = slopes
        .windows(2)
        .enumerate()
        .map(|(index, pair)| f64::from(u8::from(index == segments)) - (pair[1] - pair[0]))
        .collect();
    let sides: Vec<[f64; 3]> = (0..points)
        .map(|row| {
            let to_last = points + segments - row;
            [1.0, slopes[segments - row], at[to_last].distribution - slopes[to_last]]
        })
        .collect();
    let solution = toeplitz(&entries, &sides);
    let ([a, b, c], [a_last, b_last, c_last]) = (solution[0], solution[segments]);
    let length = (a + c * a_last / (1.0 - c_last)) / (1.0 - b - c * b_last / (1.0 - c_last));
    // One that is no positive number is longer than numbers tell.
    if length > 0.0 && length.is_finite() { length } else { f64::MAX }
}

/// The solutions of T x = b for three b at once, of n rows each, with the `entries` t(1-n) … t(n-1) of T_ij = t(j - i):
/// in 11 n² multiply-adds (Levinson 1947; Golub and Van Loan, Matrix Computations, 4th ed. 2013, section 4.7). All
/// leading blocks of T have to be well conditioned.
fn toeplitz(entries: &[f64], right: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let rows = right.len();
    let diagonal = rows - 1;
    // T f = (1, 0, …, 0) and T b = (0, …, 0, 1), for leading blocks that grow.
    let (mut forward, mut backward) = (vec![0.0; rows], vec![0.0; rows]);
    let mut solution = vec![[0.0; 3]; rows];
    let first = 1.0 / entries[diagonal];
    (forward[0], backward[0], solution[0]) = (first, first, right[0].map(|side| side * first));
    for row in 1..rows {
        let below = &entries[diagonal - row..];
        let (mut beyond_forward, mut beyond_backward, mut missing) = (0.0, 0.0, right[row]);
        for column in 0..row {
            beyond_forward += below[column] * forward[column];
            beyond_backward += entries[diagonal + 1 + column] * backward[column];
            for (missing, solved) in missing.iter_mut().zip(&solution[column]) {
                *missing -= below[column] * solved;
            }
        }
        let scale = 1.0 / (1.0 - beyond_forward * beyond_backward);
        let mut shifted = 0.0;
        for column in 0..=row {
            let (ahead, behind) = (forward[column], shifted);
            shifted = backward[column];
            forward[column] = scale * (ahead - beyond_forward * behind);
            backward[column] = scale * (behind - beyond_backward * ahead);
            for (solved, missing) in solution[column].iter_mut().zip(missing) {
                *solved += missing * backward[column];
            }
        }
    }
    solution
}

/// How the steps of a chart are distributed.
#[derive(Clone, Copy, Default)]
struct Steps {
    /// F.
    distribution: f64,
    /// G, the integral of F from minus infinity.
    integral: f64,
}

#[cfg(test)]
mod tests;
