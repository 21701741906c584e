//! Tails and quantiles of distributions.

use statrs::distribution::{ChiSquared, Continuous, ContinuousCDF, Normal, StudentsT};
use statrs::function::beta::checked_beta_reg;

/// How often a chi-square number of this many degrees of freedom is as large; none for no degrees of freedom.
pub fn chi_square_tail(statistic: f64, degrees: f64) -> Option<f64> {
    let distribution = ChiSquared::new(degrees).ok()?;
    Some(distribution.sf(statistic.max(0.0))).filter(|p| p.is_finite())
}

/// Between which a chi-square number of this many degrees of freedom lies in 95 % of all cases: its quantiles 0.025 and
/// 0.975; none for no degrees of freedom.
pub fn chi_square_interval(degrees: usize) -> Option<(f64, f64)> {
    let distribution = ChiSquared::new(degrees as f64).ok()?;
    Some((distribution.inverse_cdf(0.025), distribution.inverse_cdf(0.975)))
}

/// How far from zero a standard normal number lies with probability 1 - `alpha`; `alpha` is in 0 … 1.
pub fn two_sided(alpha: f64) -> f64 {
    Normal::standard().inverse_cdf(1.0 - (alpha / 2.0).clamp(0.0, 0.5))
}

/// Above so many degrees of freedom Student's quantiles are an expansion about the normal one: the search for them
/// loses digits to 1 - y, until four are left at 10^6, and from 2e7 on it does not end.
const NEARLY_NORMAL: usize = 1_000_000;

/// How far from zero a number of Student's distribution lies with probability 1 - `alpha`; normal without degrees of
/// freedom.
///
/// With nu above 10^6 it is z + (z^3 + z)/(4 nu) + (5 z^5 + 16 z^3 + 3 z)/(96 nu^2), z the normal one, to 16 digits
/// (Abramowitz and Stegun 1964, 26.7.5).
pub fn student_two_sided(alpha: f64, degrees: Option<usize>) -> f64 {
    let z = two_sided(alpha);
    match degrees {
        Some(degrees) if degrees > NEARLY_NORMAL => {
            let nu = degrees as f64;
            let second = (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / (96.0 * nu * nu);
            z + (z.powi(3) + z) / (4.0 * nu) + second
        }
        Some(degrees) => StudentsT::new(0.0, 1.0, degrees as f64)
            .map_or(z, |student| student.inverse_cdf(1.0 - (alpha / 2.0).clamp(0.0, 0.5))),
        None => z,
    }
}

/// sqrt(nu/(nu - 2)), the standard deviation of Student's distribution with so many degrees of freedom; 1 where they
/// are not known. With fewer than three it has none, and that of three serves.
pub fn student_factor(degrees: Option<usize>) -> f64 {
    degrees.map_or(1.0, |degrees| {
        let degrees = degrees.max(3) as f64;
        (degrees / (degrees - 2.0)).sqrt()
    })
}

/// How often a standard normal number lies farther from zero than `distance`, and the first two even Hermite
/// coefficients of that event, E (x^2 - 1) and E (x^4 - 6 x^2 + 3) over it.
pub fn outside(distance: f64) -> (f64, [f64; 2]) {
    let normal = Normal::standard();
    let density = 2.0 * normal.pdf(distance);
    (2.0 * normal.cdf(-distance), [distance * density, (distance.powi(3) - 3.0 * distance) * density])
}

/// How often more than `count` of `of` events happen, and half of how often just as many do, each with probability `p`
/// in 0 … 1: the mid-p-value of a count (Lancaster, Significance tests in discrete distributions, JASA 56 (1961)). The
/// probability of as many or more is above the level that it is compared with wherever the count jumps past it; the
/// mid-p-value is so on average.
///
/// Events that depend on one another make the variance of the count `design` times as large: they count as `of/design`
/// ones that do not (the first-order correction of Rao and Scott, JASA 76 (1981)).
pub fn binomial_mid_p(count: usize, of: usize, p: f64, design: f64) -> f64 {
    0.5 * (binomial_tail(count, of, p, design) + binomial_tail(count + 1, of, p, design))
}

/// How often at least `count` of `of` events happen, each with probability `p` in 0 … 1: by the incomplete beta
/// function (Abramowitz and Stegun 1964, 26.5.24).
fn binomial_tail(count: usize, of: usize, p: f64, design: f64) -> f64 {
    if count == 0 {
        return 1.0;
    }
    if count > of {
        return 0.0;
    }
    checked_beta_reg(count as f64 / design, (of - count) as f64 / design + 1.0, p)
        .unwrap_or(f64::from(u8::from(p >= 1.0)))
}

#[cfg(test)]
mod tests;
