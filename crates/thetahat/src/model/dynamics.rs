//! What the polynomials of a model say of its dynamics: poles, zeros, static gains and time constants.
//!
//! Their uncertainty is that of the parameters to first order, cov g(theta-hat) = J P J' with J = dg/dtheta and P the
//! covariance matrix of theta-hat (the delta method: Rao, Linear Statistical Inference and its Applications, 2nd ed.
//! 1973, section 6a.2). For a simple root z of p(z) = sum_k p_k z^(n-k)
//!
//! ```text
//! dz/dp_k = -z^(n-k) / p'(z)
//! ```
//!
//! (Wilkinson, Rounding Errors in Algebraic Processes, 1963, chapter 2), and by the chain rule
//!
//! ```text
//! tau = -T/ln|z|:              dtau = T/(|z| ln^2|z|) d|z|,   |z| d|z| = re dre + im dim
//! g = B(1)/(A(1) F(1)):        dg/db_k = 1/(A(1) F(1)),   dg/da_k = -g/A(1),   dg/df_k = -g/F(1)
//! ```
//!
//! Near an integrator tau and g are far from normal, and plus or minus some standard errors of them says nothing. What
//! they are made of is nearly normal, |z|, B(1) and A(1) F(1), and their intervals are taken from there: tau rises
//! with |z|, so that the ends of the interval of |z| are those of tau, without an upper one where 1 is inside; and g
//! lies where
//!
//! ```text
//! (n - g d)^2 <= q^2 var(n - g d),   n = B(1),   d = A(1) F(1)
//! ```
//!
//! with the quantile q of the normal or Student's distribution (Fieller, Some problems in interval estimation, J. Royal
//! Statistical Society B 16 (1954)). That is an interval while d differs from 0 with the same confidence; beyond, g has
//! no upper end, and the sign of n as far as that is certain: d is positive for a stable model.
//!
//! Poles that are estimated near 1 come out too small, and more so where a level is taken off: there the t-statistic of
//! d = 0 has the distribution of Dickey and Fuller (J. American Statistical Association 74 (1979)), and not the normal
//! one. So an upper end is given only where that rejects an integrator.

#[cfg(test)]
mod tests;

use thetahat_core::nalgebra::{Complex, ComplexField};

use super::polynomial;
use super::quantity::{Interval, Quantity, Root};
use crate::Error;
use crate::figures::fixed;
use crate::model::PolynomialModel;

/// A root this close to another one, in its own standard deviations, may not be simple as far as the data can tell.
/// Of sampled polynomials of degree 2 one in six then has a pair where the others have real roots, or the other way
/// round, and the first order is up to 25 % too small (measured).
const APART: f64 = 4.0;
/// By more than this fraction no correlation of the two parts of a root exceeds 1 for rounding alone.
const ROUNDED: f64 = 1e-6;
/// A pole and a zero farther apart than this do not cancel, however uncertain they are.
const NEAR: f64 = 0.1;
/// How often an interval holds its figure.
pub(super) const LEVEL: f64 = 0.95;
/// Where the t-statistic of a root at 1 lies below in 2.5 % of logs, a constant being estimated too (Fuller,
/// Introduction to Statistical Time Series, 1976, table 8.5.2). The normal distribution has 1.96 there.
const UNIT_ROOT: f64 = 3.12;
/// 95 % of chi-square for one and two degrees of freedom.
const CHI_SQUARE: [f64; 2] = [3.841, 5.991];

/// A polynomial of a model, and where its coefficients stand among the parameters.
#[derive(Debug)]
pub(crate) struct Block<'a> {
    name: String,
    pub(crate) coefficients: &'a [f64],
    /// The zeros that it begins with.
    delay: usize,
    /// The lowest power of q^-1 that has a parameter.
    power: usize,
    /// The parameter of this power.
    first: usize,
}

/// The polynomials of a model.
#[derive(Debug)]
pub(crate) struct Blocks<'a> {
    pub(crate) a: Block<'a>,
    pub(crate) b: Vec<Block<'a>>,
    pub(crate) c: Block<'a>,
    pub(crate) d: Block<'a>,
    pub(crate) f: Vec<Block<'a>>,
}

impl<'a> Blocks<'a> {
    pub(crate) fn of(model: &'a PolynomialModel) -> Self {
        let several = model.b.len() > 1;
        let mut next = 0;
        let mut block =
            |letter: &str, input: Option<usize>, coefficients: &'a [f64], delay: Option<usize>| {
                let first = next;
                // Without a delay it is monic.
                let power = delay.unwrap_or(1);
                next += coefficients.len().saturating_sub(power);
                let number =
                    input.filter(|_| several).map_or_else(String::new, |input| (input + 1).to_string());
                let name = format!("{letter}{number}");
                Block { name, coefficients, delay: delay.unwrap_or(0), power, first }
            };
        // The order of the parameters.
        let a = block("a", None, &model.a, None);
        let delays = model.b.iter().zip(&model.orders.nk).enumerate();
        let b = delays.map(|(input, (b, &nk))| block("b", Some(input), b, Some(nk))).collect();
        let c = block("c", None, &model.c, None);
        let d = block("d", None, &model.d, None);
        let f = model.f.iter().enumerate().map(|(input, f)| block("f", Some(input), f, None)).collect();
        Self { a, b, c, d, f }
    }
}

/// How a complex quantity changes with the parameters: their positions, and the derivatives.
pub(crate) type Gradient = Vec<(usize, Complex<f64>)>;

impl Block<'_> {
    /// The derivatives of a quantity with respect to the coefficients, `of` saying it for a power of q^-1.
    pub(crate) fn gradient(
        &self,
        mut of: impl FnMut(usize) -> Complex<f64>,
    ) -> impl Iterator<Item = (usize, Complex<f64>)> {
        (self.power..self.coefficients.len()).map(move |power| (self.first + power - self.power, of(power)))
    }

    /// The value at q = 1, none where it is rounding: at an integrator.
    fn at_one(&self) -> Option<f64> {
        let sum: f64 = self.coefficients.iter().sum();
        let size: f64 = self.coefficients.iter().map(|value| value.abs()).sum();
        Some(sum).filter(|sum| sum.abs() > 16.0 * f64::EPSILON * size)
    }

    pub(crate) fn zeros(&self) -> Result<Vec<Complex<f64>>, Error> {
        polynomial::roots(self.coefficients)
            .ok_or_else(|| Error::data("the roots of a polynomial do not converge; lower the orders"))
    }

    /// How a root moves with the coefficients. Not finite for a multiple root.
    fn moved(&self, root: Complex<f64>) -> Gradient {
        let coefficients = &self.coefficients[self.delay..];
        // In z inside the unit circle, in x = 1/z outside, where powers of z may overflow: with P(x) = sum_k p_k x^k
        // dz/dp_k = z^2 x^k/P'(x).
        let inside = root.modulus() <= 1.0;
        let at = if inside { root } else { reciprocal(root) };
        let mut powers = vec![Complex::new(1.0, 0.0); coefficients.len()];
        (1..powers.len()).for_each(|k| powers[k] = powers[k - 1] * at);
        let factor = if inside {
            powers.reverse();
            -reciprocal(slope(coefficients.iter(), at))
        } else {
            root * root * reciprocal(slope(coefficients.iter().rev(), at))
        };
        self.gradient(|power| factor * powers[power - self.delay]).collect()
    }

    /// The roots with their uncertainty.
    fn roots(&self, parameters: Option<&[Vec<f64>]>) -> Result<Vec<Root>, Error> {
        let zeros = self.zeros()?;
        let root = |(index, &z): (usize, &Complex<f64>)| {
            let covariance = parameters.and_then(|parameters| covariance(parameters, &self.moved(z)));
            let covariance = covariance.filter(|covariance| is_simple(index, &zeros, covariance));
            Root { polynomial: self.name.clone(), re: z.re, im: z.im, covariance }
        };
        Ok(zeros.iter().enumerate().map(root).collect())
    }
}

/// Whether one of some roots has a covariance to first order: whether no other lies within four of its standard
/// deviations.
pub(crate) fn is_simple(index: usize, roots: &[Complex<f64>], [[re, both], [_, im]]: &[[f64; 2]; 2]) -> bool {
    // No covariance exceeds its deviations: else all of it is rounding.
    let is_one = both.abs() <= (1.0 + ROUNDED) * (re * im).sqrt();
    let deviation = (re + im).sqrt();
    let apart = |other: usize| (roots[other] - roots[index]).modulus() > APART * deviation;
    is_one && (0..roots.len()).filter(|other| *other != index).all(apart)
}

/// The derivative of a polynomial, of which the highest power comes first.
fn slope<'a>(falling: impl Iterator<Item = &'a f64>, at: Complex<f64>) -> Complex<f64> {
    let zero = Complex::new(0.0, 0.0);
    let (_, slope) = falling.fold((zero, zero), |(value, slope), p| (value * at + p, slope * at + value));
    slope
}

/// 1/z without overflow of |z|^2.
fn reciprocal(z: Complex<f64>) -> Complex<f64> {
    let modulus = z.modulus();
    z.conj() / modulus / modulus
}

/// The covariance matrix of (re, im) of a quantity: J P J'. None where it cannot be had: where it is not finite, and
/// where a variance is below zero, so that P is none of a covariance.
///
/// Rounding may leave a variance that is zero below it: |P_kl| <= s_k s_l, and a sum of products of n numbers with
/// errors of eps is off by at most 4 n eps (sum_k |j_k| s_k)^2 (Higham, Accuracy and Stability of Numerical Algorithms,
/// 2nd ed. 2002, section 3.1). What is not further below is zero.
pub(crate) fn covariance(parameters: &[Vec<f64>], gradient: &Gradient) -> Option<[[f64; 2]; 2]> {
    let [mut rr, mut ri, mut ii] = [0.0; 3];
    let [mut re_size, mut im_size] = [0.0; 2];
    for (row, left) in gradient {
        let of = &parameters[*row];
        let weighted: Complex<f64> = gradient.iter().map(|(column, right)| right * of[*column]).sum();
        rr += left.re * weighted.re;
        ri += left.re * weighted.im;
        ii += left.im * weighted.im;
        // Not a number for a variance below zero.
        let deviation = of[*row].sqrt();
        re_size += left.re.abs() * deviation;
        im_size += left.im.abs() * deviation;
    }
    let rounding = 4.0 * gradient.len() as f64 * f64::EPSILON;
    let variance = |sum: f64, size: f64| (sum >= -rounding * size * size).then(|| sum.max(0.0));
    let covariance = [[variance(rr, re_size)?, ri], [ri, variance(ii, im_size)?]];
    // An infinite or undefined sum is kept by none of these.
    (rr.is_finite() && ri.is_finite() && ii.is_finite()).then_some(covariance)
}

/// The square root of a real quantity's variance.
pub(crate) fn standard_error(parameters: Option<&[Vec<f64>]>, gradient: &Gradient) -> Option<f64> {
    covariance(parameters?, gradient).map(|covariance| covariance[0][0].sqrt())
}

/// Fills in what follows from the polynomials of a model and the covariance of its parameters.
pub(super) fn describe(model: &mut PolynomialModel) -> Result<(), Error> {
    let blocks = Blocks::of(model);
    let parameters = model.covariance.as_deref();
    let mut poles = blocks.a.roots(parameters)?;
    for f in &blocks.f {
        poles.extend(f.roots(parameters)?);
    }
    let zeros = blocks.b.iter().map(|b| b.roots(parameters)).collect::<Result<Vec<_>, Error>>()?;
    let (noise_poles, noise_zeros) = (blocks.d.roots(parameters)?, blocks.c.roots(parameters)?);
    let inputs = blocks.b.iter().zip(&blocks.f);
    let stable = poles.iter().all(|pole| pole.value().modulus() < 1.0);
    let quantile = model.quantile(LEVEL);
    let gain = |(b, f)| static_gain(&blocks.a, b, f, parameters, stable, quantile);
    let dc_gain = inputs.map(gain).collect();
    let time_constants = poles.iter().map(|pole| time_constant(pole, model.sample_time, quantile)).collect();

    model.stable = stable;
    model.poles = poles;
    model.zeros = zeros;
    model.noise_poles = noise_poles;
    model.noise_zeros = noise_zeros;
    model.dc_gain = dc_gain;
    model.time_constants = time_constants;
    Ok(())
}

/// B(1)/(A(1) F(1)).
fn static_gain(
    a: &Block<'_>,
    b: &Block<'_>,
    f: &Block<'_>,
    parameters: Option<&[Vec<f64>]>,
    stable: bool,
    quantile: f64,
) -> Option<Quantity> {
    let (a_one, f_one) = (a.at_one()?, f.at_one()?);
    let numerator = b.coefficients.iter().sum::<f64>();
    let value = numerator / a_one / f_one;
    let real = |value: f64| Complex::new(value, 0.0);
    let gradient = a.gradient(|_| real(-value / a_one));
    let gradient = gradient.chain(b.gradient(|_| real(1.0 / a_one / f_one)));
    let gradient = gradient.chain(f.gradient(|_| real(-value / f_one))).collect();
    // Of n and d, as a complex number of which they are the parts.
    let parts = b.gradient(|_| real(1.0));
    let parts = parts.chain(a.gradient(|_| Complex::new(0.0, f_one)));
    let parts: Gradient = parts.chain(f.gradient(|_| Complex::new(0.0, a_one))).collect();
    let spread = parameters.and_then(|parameters| covariance(parameters, &parts));
    let interval = spread.map(|spread| ratio([numerator, a_one * f_one], spread, quantile, stable));
    let standard_error = standard_error(parameters, &gradient);
    // Without B there is nothing to divide.
    let interval = interval.filter(|_| b.coefficients.len() > b.power);
    value.is_finite().then_some(Quantity { value, standard_error, interval })
}

/// Fieller's interval for n/d of two figures with a covariance matrix. `positive` says that d is known to be so.
fn ratio([n, d]: [f64; 2], [[nn, nd], [_, dd]]: [[f64; 2]; 2], quantile: f64, positive: bool) -> Interval {
    let square = quantile * quantile;
    // a g^2 - 2 b g + c <= 0.
    let (a, b, c) = (d * d - square * dd, n * d - square * nd, n * n - square * nn);
    let root = (b * b - a * c).max(0.0).sqrt();
    // Without cancellation: one root by the sum, the other by the product.
    let sum = b + root.copysign(b);
    let (first, second) = (sum / a, if sum == 0.0 { 0.0 } else { c / sum });
    let (low, high) = (first.min(second), first.max(second));
    let known = |value: f64| Some(value).filter(|value| value.is_finite());
    let bounded = d * d > UNIT_ROOT * UNIT_ROOT * dd;
    if a > 0.0 && bounded {
        return Interval { lower: known(low), upper: known(high) };
    }
    // Only n differs from 0: g lies beyond one end, and the sign of d says beyond which. That is the one nearest to 0,
    // or the one of its sign.
    match (positive && c > 0.0, n > 0.0) {
        (true, true) => Interval { lower: known(if a > 0.0 { low } else { high }), upper: None },
        (true, false) => Interval { lower: None, upper: known(if a > 0.0 { high } else { low }) },
        (false, _) => Interval { lower: None, upper: None },
    }
}

/// -T/ln|z|, none outside the unit circle.
pub(super) fn time_constant(pole: &Root, sample_time: f64, quantile: f64) -> Option<Quantity> {
    let modulus = pole.value().modulus();
    let value = -sample_time / modulus.ln();
    let known = pole.covariance.filter(|_| modulus > 0.0);
    let deviation = known.map(|[[rr, ri], [_, ii]]| {
        let (re, im) = (pole.re / modulus, pole.im / modulus);
        (re * re * rr + 2.0 * re * im * ri + im * im * ii).max(0.0).sqrt()
    });
    let slope = (value / modulus / modulus.ln()).abs();
    let standard_error = deviation.map(|deviation| slope * deviation).filter(|error| error.is_finite());
    let real = pole.im == 0.0 && pole.re > 0.0;
    let bounded = |deviation: &f64| !real || 1.0 - modulus > UNIT_ROOT * deviation;
    let interval = deviation.filter(|deviation| deviation.is_finite()).map(|deviation| {
        let (low, high) = (modulus - quantile * deviation, modulus + quantile * deviation);
        let end = |modulus: f64| -sample_time / modulus.ln();
        Interval {
            lower: Some(if low > 0.0 { end(low) } else { 0.0 }),
            upper: (high < 1.0 && bounded(&deviation)).then(|| end(high)),
        }
    });
    (modulus < 1.0 && value.is_finite()).then_some(Quantity { value, standard_error, interval })
}

/// The pole and the zero of a model that come closest to cancelling each other, if they nearly do; the pole first.
///
/// Compared are, for each input, the roots of A and F_j with those of B_j, and for the noise those of A and D with
/// those of C. A pair nearly cancels if it is at most 0.1 apart and the data do not tell it apart: the squared
/// distance in the metric of the covariance of z - p, to first order in the parameters of both, is below the 95 %
/// point of chi-square, with one degree of freedom if both are real and two if not. Where that covariance is not
/// known, the distance alone counts: then the question makes sense only of a model that is known to have too many
/// parameters.
///
/// The common part of their movement cancels in z - p. So a common factor of B and F shows even where the data leave
/// open where it is.
pub(crate) fn near_cancellation(model: &PolynomialModel) -> Option<(Root, Root)> {
    let blocks = Blocks::of(model);
    let parameters = model.covariance.as_deref();
    let inputs = blocks.b.iter().zip(&blocks.f);
    let pairs = inputs.flat_map(|(b, f)| [(&blocks.a, b), (f, b)]);
    let pairs = pairs.chain([(&blocks.a, &blocks.c), (&blocks.d, &blocks.c)]);
    let mut closest = None;
    let mut least = NEAR;
    for (denominator, numerator) in pairs {
        let (poles, zeros) = (denominator.roots(parameters).ok()?, numerator.roots(parameters).ok()?);
        for pole in &poles {
            for zero in &zeros {
                let apart = zero.value() - pole.value();
                // Of a conjugate pair the first serves.
                if apart.modulus() > least || (closest.is_some() && apart.modulus() == least) {
                    continue;
                }
                let mut gradient = numerator.moved(zero.value());
                gradient.extend(denominator.moved(pole.value()).into_iter().map(|(k, slope)| (k, -slope)));
                if parameters.is_none_or(|parameters| indistinct(apart, parameters, &gradient)) {
                    least = apart.modulus();
                    closest = Some((pole.clone(), zero.clone()));
                }
            }
        }
    }
    closest
}

/// A pair that nearly cancels, in words.
pub(crate) fn cancel(pole: &Root, zero: &Root) -> String {
    let shown = |root: &Root| {
        let (name, sign) = (root.polynomial.to_uppercase(), if root.im < 0.0 { '-' } else { '+' });
        let imaginary =
            if root.im == 0.0 { String::new() } else { format!(" {sign} {}i", fixed(root.im.abs(), 4)) };
        format!("{}{imaginary} of {name}", fixed(root.re, 4))
    };
    format!("the pole {} and the zero {} nearly cancel", shown(pole), shown(zero))
}

/// Whether a difference may be zero.
fn indistinct(apart: Complex<f64>, parameters: &[Vec<f64>], gradient: &Gradient) -> bool {
    let Some([[rr, ri], [_, ii]]) = covariance(parameters, gradient) else { return true };
    // What rounding may make of a sum of large terms that cancel.
    let size = |part: fn(&Complex<f64>) -> f64| -> f64 {
        let spread = gradient.iter().map(|(k, slope)| part(slope).abs() * parameters[*k][*k].sqrt());
        spread.sum::<f64>().powi(2) * 4.0 * f64::EPSILON
    };
    let (rr, ii) = (rr + size(|slope| slope.re), ii + size(|slope| slope.im));
    if apart.im == 0.0 && ii == 0.0 {
        return apart.re * apart.re <= CHI_SQUARE[0] * rr;
    }
    let determinant = rr * ii - ri * ri;
    let square = ii * apart.re * apart.re - 2.0 * ri * apart.re * apart.im + rr * apart.im * apart.im;
    square <= CHI_SQUARE[1] * determinant
}
