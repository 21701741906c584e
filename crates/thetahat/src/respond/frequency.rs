use std::f64::consts::{PI, TAU};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::{Complex, ComplexField};
use thetahat_numerics::distribution::two_sided;

use crate::Error;
use crate::model::{Block, Blocks, Gradient, Interval, PolynomialModel, Quantity, covariance};

/// 95 % of chi-square for two degrees of freedom.
const CHI_SQUARE: f64 = 5.991_465;

/// The response of a model from one source to its output, at several frequencies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FrequencyResponse {
    /// The input's name; none for the noise e.
    pub input: Option<String>,
    /// One for each frequency, in their order.
    pub points: Vec<FrequencyPoint>,
}

/// A frequency response at one frequency.
///
/// With z = re + i im and the covariance matrix S of (re, im), to first order
/// var |z| = (re^2 S11 + 2 re im S12 + im^2 S22)/|z|^2 and var arg z = (im^2 S11 - 2 re im S12 + re^2 S22)/|z|^4.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FrequencyPoint {
    /// In radians per second.
    pub frequency: f64,
    /// Real part, in units of y per unit of the source.
    pub re: f64,
    /// Imaginary part.
    pub im: f64,
    /// The covariance matrix of (re, im); none where that of the parameters is unknown.
    pub covariance: Option<[[f64; 2]; 2]>,
    /// |z|, in units of y per unit of the source.
    pub magnitude: Quantity,
    /// arg z in radians, continuous in the frequency.
    pub phase: Quantity,
}

impl FrequencyPoint {
    /// A response with the covariance matrix of its real and imaginary part. Of its phases the one nearest to `near`,
    /// in radians.
    pub(crate) fn new(
        frequency: f64,
        response: Complex<f64>,
        covariance: Option<[[f64; 2]; 2]>,
        near: f64,
    ) -> Self {
        let (re, im, magnitude) = (response.re, response.im, response.modulus());
        let (cosine, sine) = (re / magnitude, im / magnitude);
        let deviation = |x: f64, y: f64| {
            let [[rr, ri], [_, ii]] = covariance?;
            let variance = x * x * rr + 2.0 * x * y * ri + y * y * ii;
            // Not finite where the response is zero.
            Some(variance.max(0.0).sqrt()).filter(|_| variance.is_finite())
        };
        let along = deviation(cosine, sine);
        let across = deviation(-sine, cosine).map(|across| across / magnitude);
        let principal = im.atan2(re);
        let phase = principal + TAU * ((near - principal) / TAU).round();
        Self {
            frequency,
            re,
            im,
            covariance,
            magnitude: Quantity::new(magnitude, along),
            phase: Quantity::new(phase, across),
        }
    }

    /// Whether another response of this frequency, with its own covariance if it has one, lies outside of the 95 %
    /// region of this one; none without a covariance. The region is as much larger as the interval of the phase is than
    /// 1.96 standard errors.
    pub fn excludes(&self, other: &Self) -> Option<bool> {
        let [[a, b], [_, c]] = self.covariance?;
        let [[p, q], [_, r]] = other.covariance.unwrap_or_default();
        let (a, b, c) = (a + p, b + q, c + r);
        let (re, im) = (self.re - other.re, self.im - other.im);
        let determinant = a * c - b * b;
        let distance = (c * re * re - 2.0 * b * re * im + a * im * im) / determinant;
        let half = self.phase.interval.and_then(|ends| Some(0.5 * (ends.upper? - ends.lower?)));
        let wider =
            half.zip(self.phase.standard_error).map_or(1.0, |(half, error)| half / error / two_sided(0.05));
        (determinant > 0.0).then_some(distance > CHI_SQUARE * wider * wider)
    }

    /// The same with intervals of this many standard errors on either side; a magnitude is not below zero.
    pub(crate) fn with_intervals(mut self, errors: f64) -> Self {
        for (quantity, least) in [(&mut self.magnitude, 0.0), (&mut self.phase, f64::NEG_INFINITY)] {
            quantity.interval = quantity.standard_error.map(|error| Interval {
                lower: Some((quantity.value - errors * error).max(least)),
                upper: Some(quantity.value + errors * error),
            });
        }
        self
    }
}

/// The frequency responses of a model at `frequencies` in radians per second: of each input, then of the noise.
///
/// With T the sample time and q = exp(i omega T):
///
/// ```text
/// G_j = B_j/(A F_j),   dG/da_k = -G q^-k/A,   dG/db_k = q^-k/(A F),   dG/df_k = -G q^-k/F
/// H   = C/(A D),       dH/da_k = -H q^-k/A,   dH/dc_k = q^-k/(A D),   dH/dd_k = -H q^-k/D
/// ```
///
/// and J P J' is the covariance matrix of (re, im), P being that of the parameters (Ljung, System Identification, 2nd
/// ed. 1999, section 9.4). There is no standard error of the magnitude and of the phase where the response is zero.
///
/// The phase is the sum of what the roots of the polynomials and the delay turn from frequency 0 on, so it does not
/// depend on which frequencies are asked for. At 0 it is 0, or pi for a negative static gain (-pi where an unstable
/// pole makes it so); each pole at q = 1 takes pi/2 off, each zero there adds as much.
///
/// Cost: O(p^2) for each frequency and source, for its p parameters.
///
/// # Errors
/// [`Error::Argument`] for a frequency that is not a number, negative, above pi/T, or one of a pole on the unit circle.
///
/// ```
/// use thetahat::data::Record;
/// use thetahat::estimate::{Initial, arx};
/// use thetahat::model::{Orders, PolynomialModel, Signal};
/// use thetahat::respond::{frequency_response, logarithmic_frequencies};
///
/// let u: Vec<f64> = (0..100).map(|t| f64::from(t * t % 7)).collect();
/// let mut y = vec![1.0];
/// for t in 1..u.len() {
///     y.push(0.8 * y[t - 1] + 0.5 * u[t - 1]);
/// }
/// let orders = Orders::arx(1, &[1], &[1])?;
/// let estimate = arx(&Record::new(&y, vec![&u])?, &orders, Initial::Drop)?;
/// let model = estimate.to_model(&orders, 0.1, vec![Signal::default()], Signal::default())?;
/// let responses = frequency_response(&model, &[0.0, std::f64::consts::PI / 0.1])?;
/// // 0.5 q^-1/(1 - 0.8 q^-1) at q = 1 and at q = -1.
/// let (low, high) = (responses[0].points[0], responses[0].points[1]);
/// assert!((low.magnitude.value - 2.5).abs() < 1e-9 && low.phase.value.abs() < 1e-9);
/// assert!((high.re + 0.5 / 1.8).abs() < 1e-9 && (high.phase.value + std::f64::consts::PI).abs() < 1e-9);
///
/// let bode = frequency_response(&model, &logarithmic_frequencies(0.01, 10.0, 100)?)?;
/// assert_eq!((bode.len(), bode[0].points.len()), (2, 100));
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn frequency_response(
    model: &PolynomialModel,
    frequencies: &[f64],
) -> Result<Vec<FrequencyResponse>, Error> {
    check_frequencies(frequencies, model.sample_time)?;
    let blocks = Blocks::of(model);
    let inputs = blocks.b.iter().zip(&blocks.f).zip(&model.inputs);
    let inputs = inputs.map(|((b, f), input)| (Some(input.name.clone()), b, f));
    let sources = inputs.chain([(None, &blocks.c, &blocks.d)]);
    sources
        .map(|(input, numerator, denominator)| {
            let transfer = Transfer::new(numerator, &blocks.a, denominator)?;
            let parameters = model.covariance.as_deref();
            let point = |frequency: &f64| transfer.at(*frequency, model.sample_time, parameters);
            Ok(FrequencyResponse {
                input,
                points: frequencies.iter().map(point).collect::<Result<_, Error>>()?,
            })
        })
        .collect()
}

/// Refuses frequencies outside of 0 … pi/T.
pub(super) fn check_frequencies(frequencies: &[f64], sample_time: f64) -> Result<(), Error> {
    // pi/T itself may be computed in several ways.
    let highest = PI / sample_time;
    let inside = |frequency: f64| frequency >= 0.0 && frequency <= highest * (1.0 + 4.0 * f64::EPSILON);
    if let Some(wrong) = frequencies.iter().find(|frequency| !inside(**frequency)) {
        return Err(Error::argument(
            "frequencies",
            format!(
                "{wrong} rad/s is not between 0 and {highest} rad/s, half the sampling frequency; beyond it a sampled \
                 model says nothing new"
            ),
        ));
    }
    Ok(())
}

/// There is no response at the frequency of a pole, nor where numbers overflow.
pub(super) fn has_pole(frequency: f64) -> Error {
    let message = format!(
        "the model has no finite response at {frequency} rad/s: a pole lies there, or its numbers are too large; leave this \
         frequency out, or scale the channels towards one"
    );
    Error::argument("frequencies", message)
}

/// `count` frequencies from `first` to `last`, each the same factor above the one before.
///
/// # Errors
/// [`Error::Argument`] unless 0 < first < last, both finite, and `count` is at least 2.
///
/// ```
/// let frequencies = thetahat::respond::logarithmic_frequencies(0.1, 10.0, 3)?;
/// assert_eq!((frequencies[0], frequencies[2]), (0.1, 10.0));
/// assert!((frequencies[1] - 1.0).abs() < 1e-15);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn logarithmic_frequencies(first: f64, last: f64, count: usize) -> Result<Vec<f64>, Error> {
    if !(first > 0.0 && first < last && last.is_finite() && count >= 2) {
        return Err(Error::argument(
            "frequencies",
            format!("{count} from {first} to {last} rad/s: give at least 2, from above 0 to a higher one"),
        ));
    }
    let (low, high) = (first.ln(), last.ln());
    let between = |k: usize| (low + (high - low) * (k as f64 / (count - 1) as f64)).exp().clamp(first, last);
    let ends = |k: usize| match k {
        0 => first,
        _ if k == count - 1 => last,
        _ => between(k),
    };
    Ok((0..count).map(ends).collect())
}

/// A transfer function P/(A Q).
struct Transfer<'a> {
    numerator: &'a Block<'a>,
    denominators: [&'a Block<'a>; 2],
    turns: Turns,
}

/// How a response g q^-delay prod (1 - z_i q^-1)/prod (1 - p_i q^-1) turns from frequency 0 on.
pub(super) struct Turns {
    zeros: Vec<Complex<f64>>,
    poles: Vec<Complex<f64>>,
    delay: usize,
    /// The phase at frequency 0, integrators apart.
    sign: f64,
}

impl Turns {
    pub(super) fn new(gain: f64, delay: usize, zeros: Vec<Complex<f64>>, poles: Vec<Complex<f64>>) -> Self {
        // Of a real root r > 1, 1 - r is negative; a complex one comes with its conjugate.
        let odd = |roots: &[Complex<f64>]| {
            roots.iter().filter(|root| root.im == 0.0 && root.re > 1.0).count() % 2 == 1
        };
        // So a root that passes from inside to outside at q = 1 changes the phase at other frequencies little.
        let above = if (gain < 0.0) != odd(&zeros) { PI } else { 0.0 };
        let sign = above - if odd(&poles) { PI } else { 0.0 };
        Self { zeros, poles, delay, sign }
    }

    /// What delay and roots turn.
    pub(super) fn at(&self, angle: f64) -> f64 {
        let turned = |roots: &[Complex<f64>]| roots.iter().map(|root| turned_by(*root, angle)).sum::<f64>();
        self.sign - self.delay as f64 * angle + turned(&self.zeros) - turned(&self.poles)
    }
}

impl<'a> Transfer<'a> {
    fn new(numerator: &'a Block<'a>, a: &'a Block<'a>, other: &'a Block<'a>) -> Result<Self, Error> {
        let poles = [a.zeros()?, other.zeros()?].concat();
        let delay = numerator.coefficients.iter().take_while(|value| **value == 0.0).count();
        let lead = numerator.coefficients.get(delay).copied().unwrap_or(0.0);
        let turns = Turns::new(lead, delay, numerator.zeros()?, poles);
        Ok(Self { numerator, denominators: [a, other], turns })
    }

    fn at(
        &self,
        frequency: f64,
        sample_time: f64,
        parameters: Option<&[Vec<f64>]>,
    ) -> Result<FrequencyPoint, Error> {
        let angle = frequency * sample_time;
        // 1/A and 1/Q are `a` and `other` below.
        let turn = |power: usize| {
            let (sine, cosine) = (power as f64 * angle).sin_cos();
            Complex::new(cosine, -sine)
        };
        let one = Complex::new(1.0, 0.0);
        let [a, other] = self.denominators.map(|block| value(block, turn).map(|value| one / value));
        let above = value(self.numerator, turn).unwrap_or(Complex::new(0.0, 0.0));
        let response = a.zip(other).map(|(a, other)| above * a * other);
        let (Some(a), Some(other), Some(response)) = (a, other, response.filter(|r| r.modulus().is_finite()))
        else {
            return Err(has_pole(frequency));
        };
        let gradient: Gradient = self
            .numerator
            .gradient(|power| turn(power) * a * other)
            .chain(self.denominators[0].gradient(|power| -response * turn(power) * a))
            .chain(self.denominators[1].gradient(|power| -response * turn(power) * other))
            .collect();
        let covariance = parameters.and_then(|parameters| covariance(parameters, &gradient));

        Ok(FrequencyPoint::new(frequency, response, covariance, self.turns.at(angle)))
    }
}

/// The phase of 1 - r q^-1 at q = exp(i angle), less its sign for a real r > 1.
fn turned_by(root: Complex<f64>, angle: f64) -> f64 {
    let (sine, cosine) = angle.sin_cos();
    let one = Complex::new(1.0, 0.0);
    if root.modulus() <= 1.0 {
        // The real part is not negative: the principal value is continuous.
        let factor = one - root * Complex::new(cosine, -sine);
        return factor.im.atan2(factor.re);
    }
    // -r q^-1 (1 - q/r)
    let factor = one - Complex::new(cosine, sine) / root;
    factor.im.atan2(factor.re) - angle
}

/// A polynomial at q^-k = `turn(k)`; none where it is rounding, or not a number.
fn value(block: &Block<'_>, turn: impl Fn(usize) -> Complex<f64>) -> Option<Complex<f64>> {
    let terms = block.coefficients.iter().enumerate();
    let value: Complex<f64> = terms.map(|(power, coefficient)| turn(power) * coefficient).sum();
    let size: f64 = block.coefficients.iter().map(|value| value.abs()).sum();
    Some(value).filter(|value| value.modulus() > 16.0 * f64::EPSILON * size)
}
