//! Whether residuals are white: the tests of Ljung and Box, and of Anderson.
//!
//! With r_k = sum e(t) e(t - k)/sum e^2 over the N_k pairs that there are of N samples:
//!
//! ```text
//! Ljung and Box 1978:   Q = N (N + 2) sum_{k <= L} r_k^2/N_k
//! ```
//!
//! is chi-square with L degrees of freedom for a model that is known. One that was estimated has other correlations,
//!
//! ```text
//! r^_k = r_k - X_k (theta-hat - theta),   X_k = E psi(t) e(t - k)/sigma^2,
//! ```
//!
//! so that sqrt(N) r^ has the covariance C: I - N X cov X' on the samples of the fit, with cov = sigma^2 (sum psi
//! psi')^-1 (Box and Pierce 1970); I + N X cov X' on others, where the parameters' errors come on top. On the samples
//! of the fit X follows from the model: past e is in psi by -1/A for a, 1/C for c and -1/D for d, each delayed by the
//! coefficient's number, and not at all for B and F. Sums over the samples would take away directions by their noise
//! (with 120 samples and 24 lags 11 to 13 % of true ARX and OE models were rejected at 5 %); on other samples it adds
//! some, and sums are taken, which also hold in a loop. On the samples of the fit, what psi explains of e is taken off:
//! nothing at the least sum of squares, and then r^ is that of any estimate close to the truth (Breusch 1978, Godfrey
//! 1978). The statistic is N r^' C^-1 r^ over the directions that the fit has left free, those of eigenvalues above
//! 0.05, with as many degrees of freedom. For C = I it is Q; on the samples of an ARMA model about L - na - nc
//! directions are free, with inputs about L - nc - nd.

use std::ops::Range;

use thetahat_core::nalgebra::{DMatrix, DVector};
use thetahat_numerics::distribution::{binomial_mid_p, chi_square_tail, outside, two_sided};
use thetahat_numerics::regression::{Lagged, Presample, Taps};

use super::moments::eigen;
use super::verdict::{Anderson, AndersonLevel, Test};

/// Directions of which the fit has left less than this fraction say nothing.
const FREE: f64 = 0.05;
/// Anderson's test counts lags up to a twentieth of the samples: R(tau) has a variance of N/(N - tau), and with more
/// lags more than a fraction alpha of them lies outside.
const SAMPLES_PER_ANDERSON_LAG: usize = 20;
/// The deviation of a correlation that the fit has left none.
const CERTAIN: f64 = 1e-9;

/// The autocorrelation of errors over segments without a gap.
#[derive(Debug, Clone)]
pub(super) struct Autocorrelation {
    /// N.
    pub(super) samples: usize,
    /// sum e^2.
    pub(super) square: f64,
    /// r_k for k = 1, 2, …
    pub(super) values: Vec<f64>,
    /// N_k.
    pub(super) pairs: Vec<usize>,
}

impl Autocorrelation {
    /// O(N K) for K lags; none of them pairs samples of two segments. `error` is zero where it does not count.
    pub(super) fn new(error: &[f64], segments: &[&[Range<usize>]], lags: usize) -> Self {
        let taps = vec![Taps { signal: 0, first: 1, count: lags, sign: 1.0 }];
        let span = |runs: &&[Range<usize>]| Some(runs.first()?.start..runs.last()?.end);
        let spans: Vec<Range<usize>> = segments.iter().filter_map(span).collect();
        let (_, sums, square) = Lagged::new(&[error], taps, &spans, Presample::Zero).normal_equations();
        Self {
            samples: segments.iter().copied().flatten().map(Range::len).sum(),
            square,
            values: sums.iter().map(|sum| sum / square).collect(),
            pairs: (1..=lags).map(|lag| pairs(segments, lag)).collect(),
        }
    }
}

/// How many pairs of samples of one segment are this many steps apart. A segment is a list of runs of samples.
pub(super) fn pairs(segments: &[&[Range<usize>]], lag: usize) -> usize {
    let of = |runs: &[Range<usize>]| {
        // Each run against itself and those from which it is this many steps away: both lists rise.
        let (mut count, mut first) = (0, 0);
        for run in runs {
            while runs[first].end + lag <= run.start {
                first += 1;
            }
            let near = runs[first..].iter().take_while(|earlier| earlier.start + lag < run.end);
            let shared = near.map(|earlier| {
                run.end.min(earlier.end + lag).saturating_sub(run.start.max(earlier.start + lag))
            });
            count += shared.sum::<usize>();
        }
        count
    };
    segments.iter().copied().map(of).sum()
}

/// How many lags Anderson's test counts: those of Ljung and Box's test, as far as they are few beside the samples.
pub(super) fn anderson_lags(samples: usize, lags: usize) -> usize {
    lags.min((samples / SAMPLES_PER_ANDERSON_LAG).max(1))
}

/// Ljung and Box's test of the first lags. `shift` is what the estimate takes from the correlations, `covariance` is C.
pub(super) fn ljung_box(
    correlation: &Autocorrelation,
    shift: &DVector<f64>,
    covariance: &DMatrix<f64>,
) -> Option<Test> {
    let lags = shift.len();
    let samples = correlation.samples as f64;
    let scale = |k: usize| ((samples + 2.0) / correlation.pairs[k] as f64).sqrt();
    let weight = |k: usize| (samples / correlation.pairs[k] as f64).sqrt();
    let values = DVector::from_fn(lags, |k, _| scale(k) * (correlation.values[k] - shift[k]));
    let scaled = DMatrix::from_fn(lags, lags, |k, l| {
        let own = f64::from(u8::from(k == l));
        own + (covariance[(k, l)] - own) * weight(k) * weight(l)
    });
    chi_square(&values, samples, scaled, lags)
}

/// `samples` v' C^-1 v over the directions in which C is not too small, and how often a chi-square number is as large.
pub(super) fn chi_square(
    values: &DVector<f64>,
    samples: f64,
    covariance: DMatrix<f64>,
    lags: usize,
) -> Option<Test> {
    let (eigenvalues, vectors) = eigen(covariance)?;
    let free = eigenvalues.iter().zip(vectors.column_iter()).filter(|(value, _)| **value > FREE);
    let parts = free.map(|(value, vector)| vector.dot(values).powi(2) / value);
    let (count, sum) = parts.fold((0_usize, 0.0), |(count, sum), part| (count + 1, sum + part));
    let (statistic, degrees) = (samples * sum, count as f64);
    statistic.is_finite().then(|| Test {
        lags,
        statistic,
        degrees,
        p_value: chi_square_tail(statistic, degrees),
    })
}

/// Anderson's test (Anderson 1942): chi(tau) = R(tau)/R(0) with R(tau) = sum e(t) e(t - tau)/N_tau is outside its band
/// where
/// |sqrt(N) chi(tau)| exceeds the normal quantile of alpha/2; white residuals have about a fraction alpha outside. Where the
/// parameters' errors make chi(tau) more variable than that, C_tau,tau above 1, the band is as much wider.
///
/// The plain rule calls residuals white if a fraction below alpha is outside. Of 20 lags and alpha = 0.05 that is none,
/// and white residuals are so in 36 of 100 logs: as a scale that orders models it serves (`stops_at`), as a verdict it
/// does not. So the verdict asks how likely the count is: residuals are not white where its mid-p-value is below
/// `level`. The count is about binomial, with the mean of what each lag is outside with: sqrt(N) chi(tau) has the
/// variance N C_tau,tau/N_tau. Where C has correlations r_ij, lags are outside together, to second order of the events'
/// Hermite series (Mehler's formula: Cramér, Mathematical Methods of Statistics, 1946, section 21.12)
///
/// ```text
/// cov = sum_{m = 2, 4} c_m,i c_m,j r_ij^m/m!
/// ```
///
/// and the count is of as many fewer lags as its variance is larger.
pub(super) fn anderson(
    correlation: &Autocorrelation,
    covariance: &DMatrix<f64>,
    lags: usize,
    alphas: &[f64],
    level: f64,
) -> Anderson {
    let samples = correlation.samples as f64;
    let size = |lag: usize| {
        let chi = correlation.values[lag] * samples / correlation.pairs[lag] as f64;
        samples.sqrt() * chi.abs() / covariance[(lag, lag)].max(1.0).sqrt()
    };
    let mut sizes: Vec<f64> = (0..lags).map(size).collect();
    sizes.sort_unstable_by(f64::total_cmp);
    let count = |alpha: f64| lags - sizes.partition_point(|size| *size <= two_sided(alpha));
    let deviations: Vec<f64> = (0..lags)
        .map(|lag| {
            let own = covariance[(lag, lag)];
            (samples / correlation.pairs[lag] as f64 * own / own.max(1.0)).max(0.0).sqrt().max(CERTAIN)
        })
        .collect();
    // The mean probability of being outside, and the variance of the count beside that of a binomial one.
    let expected = |alpha: f64| {
        let band = two_sided(alpha);
        let events: Vec<(f64, [f64; 2])> =
            deviations.iter().map(|deviation| outside(band / deviation)).collect();
        let mean = events.iter().map(|(p, _)| p).sum::<f64>() / lags as f64;
        let mut variance = events.iter().map(|(p, _)| p * (1.0 - p)).sum::<f64>();
        for i in 0..lags {
            for j in 0..i {
                let size = covariance[(i, i)] * covariance[(j, j)];
                let square = covariance[(i, j)].powi(2) / size;
                if square.is_finite() {
                    let [second, fourth] = [0, 1].map(|m| events[i].1[m] * events[j].1[m]);
                    variance += 2.0 * (second * square / 2.0 + fourth * square * square / 24.0);
                }
            }
        }
        (mean, (variance / (lags as f64 * mean * (1.0 - mean))).max(1.0))
    };
    let passes = |alpha: f64| (count(alpha) as f64) < alpha * lags as f64;
    let at = |&alpha: &f64| {
        let outside = count(alpha);
        let (mean, design) = expected(alpha);
        let p_value = binomial_mid_p(outside, lags, mean, design);
        AndersonLevel {
            alpha,
            band: two_sided(alpha) / samples.sqrt(),
            outside,
            white: p_value >= level,
            p_value,
        }
    };
    let scale = (1..=500).map(|thousandths| f64::from(thousandths) / 1000.0);
    Anderson {
        lags,
        levels: alphas.iter().map(at).collect(),
        stops_at: scale.into_iter().find(|&alpha| !passes(alpha)),
    }
}
