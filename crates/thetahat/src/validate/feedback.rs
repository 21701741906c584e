//! Whether an input follows the output.
//!
//! Noise that enters the output comes back to the input where there is feedback, and nowhere else. So, with the
//! innovations e of the output, one test asks whether past innovations help to predict the input beyond its own past
//! (Granger, Econometrica 37, 1969):
//!
//! ```text
//! u(t) = sum_{i=1..p} c_i u(t - i) + w(t),   psi(w(t)) = sum_{k=1..5} d_k z_k(t) + r(t),   H0: d = 0
//! W = d' G M^-1 G d  ~  chi-square(5),   G = sum z z',   M = N/(N - p - 5) sum r^2 z z'
//! ```
//!
//! z_k is what the past of u leaves of e(t - k). Innovations rather than outputs: past outputs hold past inputs too,
//! and would help a model of the input that is too short.
//!
//! - Set-points move in steps: a few w are large and hide what all others show. psi bounds w at two standard deviations
//!   (Huber, Robust Statistics, 1981, section 7.8), and c is that of these bounded residuals, found with his
//!   pseudo-values. An input that is held most of the time has no such scale, and keeps its w.
//! - The spread of r changes with u where the plant is not linear, or u is held: M is that of White (Econometrica 48,
//!   1980).
//! - A plant that is not linear leaves a function of past inputs in e, which may tell a little of an input that is not
//!   Gaussian, and in a long log any little is significant. So d of four fifths of the rows has to predict the fifth
//!   that was left out: `explained` is the fraction of the squares of psi(w) that this takes away, over all five, and
//!   feedback is suspected from 0.5 % on only.
//!
//! The effect of e(t) on u(t) itself is left out: it looks like an output that answers the input at once. A controller
//! that sees the output of the same row is found by what follows, which is weaker. An input that its own past
//! determines or that repeats itself, and data without noise, tell nothing of it. Nor does a controller that has little
//! noise to answer: then an unstable plant tells, which would not stay where it is without one ([`unstable_pole`]).

use std::ops::Range;

use thetahat_core::nalgebra::{Cholesky, SMatrix, SVector};
use thetahat_numerics::distribution::chi_square_tail;
use thetahat_numerics::regression::{Lagged, Presample, Regression, Taps, add_filtered, sum_of_squares};

use crate::figures::fixed;
use crate::model::{Orders, PolynomialModel, Root};

/// The orders of the model that gives the innovations, the first that the data determine.
const ORDERS: [usize; 4] = [10, 5, 2, 1];
/// Samples for each parameter.
const SAMPLES: usize = 5;
/// How many past innovations the input may follow.
const PAST: usize = 5;
/// The input's own past values: one for this many samples, no fewer and no more than these.
const SAMPLES_OF_OWN_PAST: usize = 20;
const OWN_PAST: [usize; 2] = [10, 40];
/// Where that many depend on one another, as those of a few sinusoids do.
const SHORTER: [usize; 3] = [5, 2, 1];
/// The bound of what is new in the input, in standard deviations, and the factor that makes one of a median.
const BOUND: f64 = 2.0;
const OF_MEDIAN: f64 = 1.482_602_218_505_602;
/// An input of which the median step is below this part of its root mean square is held.
const HELD: f64 = 0.02;
/// How often the pseudo-values are formed.
const ROUNDS: usize = 4;
/// The parts of the rows that are left out, one after the other.
const PARTS: usize = 5;
/// A pole is outside of the unit circle from this many standard errors on.
const CERTAIN: f64 = 3.0;
/// And by this much: an integrator without noise is on it to rounding.
const OUTSIDE: f64 = 1e-4;
/// Below this p-value there may be feedback, if as much is explained.
const LEVEL: f64 = 0.01;
const EXPLAINED: f64 = 0.005;
/// The same for feedback beyond doubt.
const CERTAIN_LEVEL: f64 = 1e-6;
const CERTAIN_EXPLAINED: f64 = 0.02;
/// An input that changes no more often is that of a step test, and follows whatever happens to come before its steps.
const FEW_CHANGES: usize = 5;
/// An input repeats itself if it does so to this fraction of its largest value; this many comparisons are made for each
/// sample.
const REPEATED: f64 = 1e-6;
const COMPARISONS: usize = 20;
/// Residuals below this fraction of the output, or of the input, are rounding.
const ROUNDING: f64 = 1e-7;

/// Of the past innovations.
type Vector = SVector<f64, PAST>;
type Matrix = SMatrix<f64, PAST, PAST>;

/// What past innovations tell of an input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Feedback {
    /// How often data without feedback have as large a W.
    pub(crate) p_value: f64,
    /// The fraction of what is new in the input that they predict on rows left out; negative where they mislead.
    pub(crate) explained: f64,
}

impl Feedback {
    /// Whether that speaks for feedback.
    pub(crate) fn is_suspected(&self) -> bool {
        self.p_value < LEVEL && self.explained > EXPLAINED
    }

    /// Whether there is feedback beyond doubt: so that a choice of models leaves out what needs a log without.
    pub(crate) fn is_certain(&self) -> bool {
        self.p_value < CERTAIN_LEVEL && self.explained > CERTAIN_EXPLAINED
    }
}

/// What tells of a loop.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Loop {
    /// What the innovations of the output tell of each input; none where they are rounding, or the data determine no
    /// model.
    pub(crate) inputs: Vec<Option<Feedback>>,
    /// The modulus of the plant's largest pole and its standard error, where it is outside of the unit circle for
    /// certain.
    unstable_pole: Option<[f64; 2]>,
}

impl Loop {
    /// Which inputs follow the output beyond doubt.
    pub(crate) fn certain(&self) -> Vec<bool> {
        self.inputs.iter().map(|input| input.is_some_and(|found| found.is_certain())).collect()
    }

    /// What an unstable plant says, in words.
    pub(crate) fn unstable(&self) -> Option<String> {
        let [modulus, deviation] = self.unstable_pole?.map(|value| fixed(value, 4));
        Some(format!(
            "the plant is unstable, with a pole of modulus {modulus} ± {deviation}: something holds its output"
        ))
    }
}

/// What an ARX model of order 10 on all inputs, lag 0 included, tells of a loop: its innovations and its poles. O(N
/// p^2).
pub(crate) fn feedback<S: AsRef<[f64]>>(inputs: &[S], output: &[f64], segments: &[Range<usize>]) -> Loop {
    let output = centred(output, segments);
    let inputs: Vec<Vec<f64>> = inputs.iter().map(|input| centred(input.as_ref(), segments)).collect();
    let signals: Vec<&[f64]> = std::iter::once(&output).chain(&inputs).map(Vec::as_slice).collect();
    let nothing = Loop { inputs: vec![None; inputs.len()], unstable_pole: None };
    let Some((order, taps, solved)) = predictor(&signals, segments) else { return nothing };
    let unstable_pole = unstable_pole(order, &solved);
    if solved.residual_norm <= ROUNDING * sum_of_squares(&output).sqrt() {
        return Loop { unstable_pole, ..nothing };
    }
    let innovations = residuals(&signals, segments, &taps, solved.parameters.as_slice(), order);
    let segments = shortened(segments, order);
    drop(output);
    let inputs = inputs.iter().map(|input| follows(input, &innovations, &segments)).collect();
    Loop { inputs, unstable_pole }
}

/// A signal less its mean over the segments, zero outside.
fn centred(signal: &[f64], segments: &[Range<usize>]) -> Vec<f64> {
    let count: usize = segments.iter().map(Range::len).sum();
    let sum: f64 = segments.iter().flat_map(|segment| &signal[segment.clone()]).sum();
    let mean = sum / count.max(1) as f64;
    let mut centred = vec![0.0; signal.len()];
    for t in segments.iter().cloned().flatten() {
        centred[t] = signal[t] - mean;
    }
    centred
}

/// The modulus of the largest pole of an ARX model, and its standard error, where it is more than [`CERTAIN`] of them
/// outside of the unit circle. None else, and where its standard error is not known.
fn unstable_pole(order: usize, solved: &Regression) -> Option<[f64; 2]> {
    let own = solved.covariance.view((0, 0), (order, order));
    let covariance: Vec<Vec<f64>> = own.row_iter().map(|row| row.iter().copied().collect()).collect();
    let a: Vec<f64> = solved.parameters.iter().take(order).map(|weight| -weight).collect();
    let orders = Orders::arx(order, &[], &[]).ok()?;
    let model = PolynomialModel::from_parameters(&orders, &a, Some(&covariance), 1.0, 1.0).ok()?;
    // The largest one comes first.
    let Root { re, im, covariance, .. } = model.poles.first()?;
    let [[real, both], [_, imaginary]] = (*covariance)?;
    let modulus = re.hypot(*im);
    let deviation = (re * re * real + 2.0 * re * im * both + im * im * imaginary).sqrt() / modulus;
    (modulus > 1.0 + OUTSIDE.max(CERTAIN * deviation)).then_some([modulus, deviation])
}

/// The ARX model of `signals[0]` on the others of the first order that the data determine, and its lags.
fn predictor(signals: &[&[f64]], segments: &[Range<usize>]) -> Option<(usize, Vec<Taps>, Regression)> {
    // An input that never changes determines nothing.
    let moves = |signal: &usize| signals[*signal].iter().any(|value| *value != 0.0);
    let taps = |order: usize| -> Vec<Taps> {
        let own = Taps { signal: 0, first: 1, count: order, sign: 1.0 };
        let input = |signal: usize| Taps { signal, first: 0, count: order + 1, sign: 1.0 };
        std::iter::once(own).chain((1..signals.len()).filter(moves).map(input)).collect()
    };
    ORDERS.into_iter().find_map(|order| {
        let taps = taps(order);
        let solved = solved(signals, segments, &taps, 0)?;
        Some((order, taps, solved))
    })
}

/// What past innovations, zero outside of the segments, tell of an input. None where they tell nothing.
pub(crate) fn follows(input: &[f64], innovations: &[f64], segments: &[Range<usize>]) -> Option<Feedback> {
    let input = &centred(input, segments);
    let samples: usize = segments.iter().map(Range::len).sum();
    let [fewest, most] = OWN_PAST;
    let own = (samples / SAMPLES_OF_OWN_PAST).clamp(fewest, most);
    let changes =
        |rows: &Range<usize>| input[rows.clone()].windows(2).filter(|pair| pair[0] != pair[1]).count();
    if segments.iter().map(changes).sum::<usize>() <= FEW_CHANGES || repeats(input, segments) {
        return None;
    }
    let beyond = |own| beyond(own, input, innovations, segments);
    [own, fewest].into_iter().chain(SHORTER).find_map(beyond).flatten()
}

/// Whether an input has a period, twice at least in one segment: noise of the output would not come back in step. O(N).
fn repeats(input: &[f64], segments: &[Range<usize>]) -> bool {
    let [segment] = segments else { return false };
    let signal = &input[segment.clone()];
    let tolerance = REPEATED * signal.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    let mut left = COMPARISONS * signal.len();
    for period in 2..=signal.len() / 2 {
        let (early, late) = (&signal[..signal.len() - period], &signal[period..]);
        let same = early.iter().zip(late).take_while(|(a, b)| (*a - *b).abs() <= tolerance).count();
        if same == early.len() {
            return true;
        }
        left = left.saturating_sub(same + 1);
        if left == 0 {
            break;
        }
    }
    false
}

/// The same beyond this many past values of the input: none if they depend on one another, or are too many, and nothing
/// if they determine it.
fn beyond(
    own: usize,
    input: &[f64],
    innovations: &[f64],
    segments: &[Range<usize>],
) -> Option<Option<Feedback>> {
    let left_out = own.max(PAST);
    let kept = shortened(segments, left_out);
    let rows = || kept.iter().cloned().flatten();
    let count = rows().count();
    if count < SAMPLES * (own + PAST) {
        return None;
    }
    // What the past of the input leaves of a signal.
    let past = [Taps { signal: 1, first: 1, count: own, sign: 1.0 }];
    let left = |signal: &[f64]| -> Option<Vec<f64>> {
        let solved = solved(&[signal, input], segments, &past, left_out)?;
        Some(residuals(&[signal, input], segments, &past, solved.parameters.as_slice(), left_out))
    };
    let mut new = left(input)?;
    let square = |signal: &[f64]| -> f64 { rows().map(|t| signal[t] * signal[t]).sum() };
    if square(&new) <= ROUNDING * ROUNDING * square(input) {
        return Some(None);
    }
    let mut bounded = new.clone();
    for _ in 0..ROUNDS {
        let deviation = {
            let mut sizes: Vec<f64> = rows().map(|t| new[t].abs()).collect();
            let (_, median, _) = sizes.select_nth_unstable_by(count / 2, f64::total_cmp);
            OF_MEDIAN * *median
        };
        if deviation <= HELD * (square(&new) / count as f64).sqrt() {
            bounded = std::mem::take(&mut new);
            break;
        }
        let bound = BOUND * deviation;
        bounded.iter_mut().zip(&new).for_each(|(psi, w)| *psi = w.clamp(-bound, bound));
        // What the past predicts now, and the bounded residual beside it.
        let target: Vec<f64> =
            input.iter().zip(&new).zip(&bounded).map(|((u, w), psi)| u - w + psi).collect();
        let change = left(&target)?;
        new.iter_mut().zip(&bounded).zip(&change).for_each(|((w, psi), left)| *w = *w - psi + left);
    }
    drop(new);
    let bounded = left(&bounded)?;
    // What the past of the input tells of e(t - k): five weights for each of its values, and no further signals.
    let told = |lag: usize| {
        let late = [&vec![0.0; lag], &innovations[..innovations.len() - lag]].concat();
        Some(solved(&[&late, input], segments, &past, left_out)?.parameters)
    };
    let told: Vec<_> = (1..=PAST).map(told).collect::<Option<_>>()?;
    let regressor = |t: usize| {
        Vector::from_fn(|k, _| {
            let own = told[k].iter().zip(input[..t].iter().rev()).map(|(weight, u)| weight * u);
            innovations[t - k - 1] - own.sum::<f64>()
        })
    };
    Some(evaluated(&bounded, &regressor, rows, own))
}

/// W and what d predicts of rows left out.
fn evaluated<R: Iterator<Item = usize>>(
    bounded: &[f64],
    regressor: &dyn Fn(usize) -> Vector,
    rows: impl Fn() -> R,
    own: usize,
) -> Option<Feedback> {
    let count = rows().count();
    let mut parts = vec![(Matrix::zeros(), Vector::zeros()); PARTS];
    let mut square = 0.0;
    for (position, t) in rows().enumerate() {
        let z = regressor(t);
        let (matrix, right) = &mut parts[position * PARTS / count];
        matrix.ger(1.0, &z, &z, 1.0);
        right.axpy(bounded[t], &z, 1.0);
        square += bounded[t] * bounded[t];
    }
    let matrix: Matrix = parts.iter().map(|(matrix, _)| matrix).sum();
    let right: Vector = parts.iter().map(|(_, right)| right).sum();
    let effect = Cholesky::new(matrix)?.solve(&right);
    let mut spread = Matrix::zeros();
    for t in rows() {
        let z = regressor(t);
        let rest = bounded[t] - z.dot(&effect);
        spread.ger(rest * rest, &z, &z, 1.0);
    }
    spread *= count as f64 / (count - own - PAST) as f64;
    let statistic = right.dot(&Cholesky::new(spread)?.solve(&right));
    let predicted = |(own, toward): &(Matrix, Vector)| {
        let effect = Cholesky::new(matrix - own)?.solve(&(right - toward));
        Some(2.0 * effect.dot(toward) - effect.dot(&(own * effect)))
    };
    let explained: f64 = parts.iter().map(predicted).sum::<Option<f64>>()? / square;
    let p_value = chi_square_tail(statistic, PAST as f64)?;
    (p_value.is_finite() && explained.is_finite()).then_some(Feedback { p_value, explained })
}

/// The regression of `signals[0]` without the first samples of each segment, if there are samples enough for it.
fn solved(
    signals: &[&[f64]],
    segments: &[Range<usize>],
    taps: &[Taps],
    left_out: usize,
) -> Option<Regression> {
    let parameters: usize = taps.iter().map(|taps| taps.count).sum();
    let lagged = Lagged::new(signals, taps.to_vec(), segments, Presample::Drop).after(left_out);
    if lagged.rows() < SAMPLES * parameters {
        return None;
    }
    lagged.solve().ok()
}

/// `signals[0]` less what the taps say, zero in the first samples of each segment.
fn residuals(
    signals: &[&[f64]],
    segments: &[Range<usize>],
    taps: &[Taps],
    parameters: &[f64],
    left_out: usize,
) -> Vec<f64> {
    let mut residuals = vec![0.0; signals[0].len()];
    for rows in &shortened(segments, left_out) {
        let into = &mut residuals[rows.clone()];
        into.copy_from_slice(&signals[0][rows.clone()]);
        let mut rest = parameters;
        for taps in taps {
            let (own, others) = rest.split_at(taps.count);
            rest = others;
            let weights: Vec<f64> =
                std::iter::repeat_n(0.0, taps.first).chain(own.iter().map(|theta| -theta)).collect();
            add_filtered(into, rows, &weights, signals[taps.signal], rows.start - left_out);
        }
    }
    residuals
}

/// The segments without their first samples.
fn shortened(segments: &[Range<usize>], by: usize) -> Vec<Range<usize>> {
    let rest = segments.iter().map(|segment| segment.start + by..segment.end);
    rest.filter(|segment| !segment.is_empty()).collect()
}
