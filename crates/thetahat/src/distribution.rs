//! Tails and quantiles of distributions.

use statrs::distribution::{ChiSquared, Continuous, ContinuousCDF, Normal, StudentsT};
use statrs::function::beta::checked_beta_reg;

/// How often a chi-square number of this many degrees of freedom is as large; none for no degrees of freedom.
pub(crate) fn chi_square_tail(statistic: f64, degrees: f64) -> Option<f64> {
    let distribution = ChiSquared::new(degrees).ok()?;
    Some(distribution.sf(statistic.max(0.0))).filter(|p| p.is_finite())
}

/// Between which a chi-square number of this many degrees of freedom lies in 95 % of all cases: its quantiles 0.025 and 0.975;
/// none for no degrees of freedom.
pub(crate) fn chi_square_interval(degrees: usize) -> Option<(f64, f64)> {
    let distribution = ChiSquared::new(degrees as f64).ok()?;
    Some((distribution.inverse_cdf(0.025), distribution.inverse_cdf(0.975)))
}

/// How far from zero a standard normal number lies with probability 1 - `alpha`; `alpha` is in 0 … 1.
pub(crate) fn two_sided(alpha: f64) -> f64 {
    Normal::standard().inverse_cdf(1.0 - (alpha / 2.0).clamp(0.0, 0.5))
}

/// How far from zero a number of Student's distribution lies with probability 1 - `alpha`; normal without degrees of freedom.
pub(crate) fn student_two_sided(alpha: f64, degrees: Option<usize>) -> f64 {
    let student = degrees.and_then(|degrees| StudentsT::new(0.0, 1.0, degrees as f64).ok());
    student
        .map_or_else(|| two_sided(alpha), |student| student.inverse_cdf(1.0 - (alpha / 2.0).clamp(0.0, 0.5)))
}

/// sqrt(nu/(nu - 2)), the standard deviation of Student's distribution with so many degrees of freedom; 1 where they are not
/// known. With fewer than three it has none, and that of three serves.
pub(crate) fn student_factor(degrees: Option<usize>) -> f64 {
    degrees.map_or(1.0, |degrees| {
        let degrees = degrees.max(3) as f64;
        (degrees / (degrees - 2.0)).sqrt()
    })
}

/// How often a standard normal number lies farther from zero than `distance`, and the first two even Hermite coefficients of
/// that event, E (x^2 - 1) and E (x^4 - 6 x^2 + 3) over it.
pub(crate) fn outside(distance: f64) -> (f64, [f64; 2]) {
    let normal = Normal::standard();
    let density = 2.0 * normal.pdf(distance);
    (2.0 * normal.cdf(-distance), [distance * density, (distance.powi(3) - 3.0 * distance) * density])
}

/// How often more than `count` of `of` events happen, and half of how often just as many do, each with probability `p` in
/// 0 … 1: the mid-p-value of a count (Lancaster, Significance tests in discrete distributions, JASA 56 (1961)). The
/// probability of as many or more is above the level that it is compared with wherever the count jumps past it; the mid-p-value
/// is so on average.
///
/// Events that depend on one another make the variance of the count `design` times as large: they count as `of/design` ones that
/// do not (the first-order correction of Rao and Scott, JASA 76 (1981)).
pub(crate) fn binomial_mid_p(count: usize, of: usize, p: f64, design: f64) -> f64 {
    0.5 * (binomial_tail(count, of, p, design) + binomial_tail(count + 1, of, p, design))
}

/// How often at least `count` of `of` events happen, each with probability `p` in 0 … 1: by the incomplete beta function
/// (Abramowitz and Stegun 1964, 26.5.24).
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
mod tests {
    use super::*;

    #[test]
    fn tails_and_quantiles_are_those_of_tables() {
        // Abramowitz and Stegun 1964, tables 26.8 and 26.2.
        assert!((chi_square_tail(37.6525, 25.0).unwrap() - 0.05).abs() < 1e-6);
        assert!((chi_square_tail(3.841459, 1.0).unwrap() - 0.05).abs() < 1e-8);
        assert_eq!(chi_square_tail(0.0, 3.0), Some(1.0));
        assert_eq!(chi_square_tail(1.0, 0.0), None);
        assert!(chi_square_tail(1e6, 25.0).unwrap() < 1e-300);
        // Abramowitz and Stegun 1964, table 26.8, has five digits.
        let (low, high) = chi_square_interval(10).unwrap();
        assert!((low - 3.24697).abs() < 1e-5 && (high - 20.4832).abs() < 1e-4, "{low} {high}");
        assert_eq!(chi_square_interval(0), None);
        assert!((two_sided(0.05) - 1.959963985).abs() < 1e-9);
        assert!((two_sided(0.01) - 2.575829304).abs() < 1e-9);
        assert!((two_sided(1.0)).abs() < 1e-12);
        // Table 26.10.
        assert!((student_two_sided(0.05, Some(10)) - 2.228).abs() < 5e-4);
        assert_eq!(student_two_sided(0.05, None), two_sided(0.05));
        // The moments of what is outside and inside add up to none.
        let (share, [second, fourth]) = outside(1.5);
        assert!((share - 0.133614).abs() < 1e-6);
        let step = 1e-4;
        let inside = |of: fn(f64) -> f64| -> f64 {
            let at = |k: i32| (f64::from(k) + 0.5) * step;
            2.0 * step * (0..15_000).map(|k| of(at(k)) * Normal::standard().pdf(at(k))).sum::<f64>()
        };
        assert!((second + inside(|x| x * x - 1.0)).abs() < 1e-7);
        assert!((fourth + inside(|x| x.powi(4) - 6.0 * x * x + 3.0)).abs() < 1e-7);
    }

    #[test]
    fn binomial_tails_are_sums_of_their_terms() {
        for (of, p) in [(1_usize, 0.3_f64), (7, 0.01), (25, 0.05), (100, 0.2)] {
            // (of over k) p^k (1 - p)^(of - k), each from the one before.
            let mut term = (1.0 - p).powi(of as i32);
            let mut below = 0.0;
            for count in 0..=of {
                assert!(
                    (binomial_tail(count, of, p, 1.0) - (1.0 - below)).abs() < 1e-12,
                    "{count} of {of}, {p}"
                );
                let mid = 1.0 - below - 0.5 * term;
                assert!((binomial_mid_p(count, of, p, 1.0) - mid).abs() < 1e-12, "{count} of {of}, {p}");
                below += term;
                term *= (of - count) as f64 / (count + 1) as f64 * p / (1.0 - p);
            }
            assert_eq!(binomial_tail(of + 1, of, p, 1.0), 0.0);
            // Each event twice is half of the events.
            assert!((binomial_tail(2, 2 * of, p, 2.0) - binomial_tail(1, of, p, 1.0)).abs() < 1e-12);
        }
    }
}
