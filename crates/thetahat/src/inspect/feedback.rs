//! Whether an input follows the output.

use std::ops::Range;

use statrs::distribution::{ContinuousCDF, FisherSnedecor, Normal};
use thetahat_core::nalgebra::{Cholesky, DVector};

use super::{Feedback, samples, whitening};
use crate::regression::{Lagged, Presample, Regression, Taps, add_filtered, sum_of_squares};

/// The orders of the model that gives the innovations, the first that the data determine.
const ORDERS: [usize; 4] = [10, 5, 2, 1];
/// Samples for each parameter.
const SAMPLES: usize = 5;
/// How many past innovations the input may follow.
const PAST: usize = 5;
/// The least number of the input's own past values.
const OWN_PAST: usize = 10;
/// So many standard errors from zero, the sign of an effect is certain.
const CERTAIN: f64 = 3.0;
/// Below this p-value there is feedback.
const LEVEL: f64 = 0.01;
/// Residuals below this fraction of the output are rounding.
const ROUNDING: f64 = 1e-7;

/// p-values of the hypothesis that each input does not follow the output.
///
/// Noise that enters the output comes back to the input where there is feedback, and nowhere else. So, with the innovations e of
/// the output (the residuals of an ARX model of order 10 on all inputs, lag 0 included), one test asks whether past
/// innovations help to predict the input from its own past (Granger, Econometrica 37, 1969):
///
/// ```text
/// u(t) = sum_{i=1..p} c_i u(t - i) + sum_{k=1..5} d_k e(t - k) + w(t),   H0: d = 0
/// F = d' cov(d)^-1 d / 5   ~   F(5, N - p - 5)
/// ```
///
/// Innovations rather than outputs: past outputs hold past inputs too, and would help a model of the input that is too
/// short.
///
/// A controller that answers the output of the same row shows mostly at lag 0, where it looks like an output that answers the
/// input at once. What tells them apart is the sign: feedback opposes what the plant does, so that b_0 of the ARX model,
/// which then stands for the controller, has the opposite sign of the later effect of the input. A second, one-sided test
/// is that of b_0 = 0 against such a b_0. It is done where the sign of the later effect is certain: that of b_1 + b_2 + … of
/// a model without b_0 (right if there is feedback), three standard errors from zero, and that of the impulse response of
/// the model with b_0 (right if there is none) are the same. A plant that acts at once and in the other direction
/// first is taken for feedback.
/// Of two tests with the smaller p-value p, it is 1 - (1 - p)^2 (Šidák, JASA 62, 1967). None where the innovations are
/// rounding, or the data determine no such model. O(N p).
pub(super) fn feedback(inputs: &[Vec<f64>], output: &[f64], segments: &[Range<usize>]) -> Vec<Option<f64>> {
    let signals: Vec<&[f64]> = std::iter::once(output).chain(inputs.iter().map(Vec::as_slice)).collect();
    let Some(plant) = Plant::new(&signals, segments) else { return vec![None; inputs.len()] };
    let of_input = |(position, input): (usize, &Vec<f64>)| {
        let past = follows(input, &plant.innovations, &plant.segments)?;
        let now = plant.at_once(&signals, segments, position + 1);
        Some(now.map_or(past, |now| past.min(now) * (2.0 - past.min(now))))
    };
    inputs.iter().enumerate().map(of_input).collect()
}

/// What a p-value says.
pub(super) fn verdict((input, p_value): (&String, Option<f64>)) -> Feedback {
    Feedback { input: input.clone(), p_value, found: p_value.is_some_and(|p_value| p_value < LEVEL) }
}

/// An ARX model of `signals[0]` on the others.
struct Plant {
    order: usize,
    /// The inputs that change.
    inputs: Vec<usize>,
    solved: Regression,
    innovations: Vec<f64>,
    /// What the innovations fill.
    segments: Vec<Range<usize>>,
}

impl Plant {
    fn new(signals: &[&[f64]], segments: &[Range<usize>]) -> Option<Self> {
        // An input that never changes determines nothing.
        let moving = |position: &usize| signals[*position].iter().any(|value| *value != 0.0);
        let inputs: Vec<usize> = (1..signals.len()).filter(moving).collect();
        let fitted = |order| Some((order, solved(signals, segments, &Self::taps(order, &inputs, 0))?));
        let (order, solved) = ORDERS.into_iter().find_map(fitted)?;
        if solved.residual_norm <= ROUNDING * sum_of_squares(signals[0]).sqrt() {
            return None;
        }
        let behind = whitening::shortened(segments, order);
        let mut innovations = vec![0.0; signals[0].len()];
        for rows in &behind {
            let into = &mut innovations[rows.clone()];
            into.copy_from_slice(&signals[0][rows.clone()]);
            let mut next = 0;
            for taps in Self::taps(order, &inputs, 0) {
                let mut weights = vec![0.0; taps.first];
                let parameters = &solved.parameters.as_slice()[next..next + taps.count];
                weights.extend(parameters.iter().map(|theta| -theta));
                next += taps.count;
                add_filtered(into, rows, &weights, signals[taps.signal], rows.start - order);
            }
        }
        Some(Self { order, inputs, solved, innovations, segments: behind })
    }

    /// Past outputs, and inputs from a lag on.
    fn taps(order: usize, inputs: &[usize], first: usize) -> Vec<Taps> {
        let own = Taps { signal: 0, first: 1, count: order, sign: 1.0 };
        let of_input = |&signal: &usize| Taps { signal, first, count: order + 1 - first, sign: 1.0 };
        std::iter::once(own).chain(inputs.iter().map(of_input)).collect()
    }

    /// The sum of the impulse response of an input over lags 1 … n.
    fn later_effect(&self, position: usize) -> f64 {
        let parameters = self.solved.parameters.as_slice();
        let first = self.order + position * (self.order + 1);
        let (a, b) = (&parameters[..self.order], &parameters[first..=first + self.order]);
        let mut response: Vec<f64> = Vec::with_capacity(b.len());
        for b in b {
            let past: f64 = a.iter().zip(response.iter().rev()).map(|(a, g)| a * g).sum();
            response.push(b + past);
        }
        response.iter().skip(1).sum()
    }

    /// The p-value of b_0 = 0 of an input against a b_0 that opposes what the input does later, if that has a sign.
    fn at_once(&self, signals: &[&[f64]], segments: &[Range<usize>], input: usize) -> Option<f64> {
        let position = self.inputs.iter().position(|other| *other == input)?;
        let first = self.order + position * (self.order + 1);
        let b0 = self.solved.parameters[first];
        let error = self.solved.covariance[(first, first)].sqrt();
        let later = solved(signals, segments, &Self::taps(self.order, &self.inputs, 1))?;
        let first = self.order * (1 + position);
        let sum = later.parameters.rows(first, self.order).sum();
        let spread = later.covariance.view((first, first), (self.order, self.order)).sum().sqrt();
        let p_value = Normal::standard().cdf(b0 / error * sum.signum());
        let certain = sum.abs() > CERTAIN * spread && sum * self.later_effect(position) > 0.0;
        (certain && p_value.is_finite()).then_some(p_value)
    }
}

/// The regression of `signals[0]`, if there are samples enough for it.
fn solved(signals: &[&[f64]], segments: &[Range<usize>], taps: &[Taps]) -> Option<Regression> {
    let parameters: usize = taps.iter().map(|taps| taps.count).sum();
    let lagged = Lagged::new(signals, taps.to_vec(), segments, Presample::Drop);
    if lagged.rows() < SAMPLES * parameters {
        return None;
    }
    lagged.solve().ok()
}

/// The p-value of d = 0 for one input.
fn follows(input: &[f64], innovations: &[f64], segments: &[Range<usize>]) -> Option<f64> {
    let shortest = whitening::autoregression(input, segments).len() - 1;
    // The past of a sum of sinusoids is dependent beyond its own order.
    [shortest.max(OWN_PAST), shortest.max(1)].into_iter().find_map(|own| {
        let taps = vec![
            Taps { signal: 0, first: 1, count: own, sign: 1.0 },
            Taps { signal: 1, first: 1, count: PAST, sign: 1.0 },
        ];
        let rows = samples(&whitening::shortened(segments, own.max(PAST)));
        let solved = solved(&[input, innovations], segments, &taps)?;
        if solved.residual_norm <= ROUNDING * sum_of_squares(input).sqrt() {
            return None;
        }
        let covariance = solved.covariance.view((own, own), (PAST, PAST)).into_owned();
        let past: DVector<f64> = solved.parameters.rows(own, PAST).into_owned();
        let statistic = past.dot(&Cholesky::new(covariance)?.solve(&past)) / PAST as f64;
        let distribution = FisherSnedecor::new(PAST as f64, (rows - own - PAST) as f64).ok()?;
        Some(distribution.sf(statistic)).filter(|p_value| p_value.is_finite())
    })
}
