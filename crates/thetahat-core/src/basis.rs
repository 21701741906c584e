//! Functions of regressors, of which a nonlinear model is a weighted sum.

mod local;
mod neighbours;
mod network;

pub use local::{Local, Membership};
pub use neighbours::{MOST_NEIGHBOURS, MOST_SLOPES, Neighbours};
pub use network::{Activation, Network};

use crate::error::check_length;
use crate::{Error, Real};

/// Functions f_j of regressors z, of which a nonlinear model is a weighted sum:
///
/// ```text
/// g(z) = θ_1 f_1(z) + θ_2 f_2(z) + …
/// ```
///
/// [`Polynomial`], [`Radial`], [`Spline`], [`Network`], [`Local`] and [`Neighbours`] are views of numbers that may
/// stand in flash. Any other functions can be given by this trait; they are computed without a heap, and each is about
/// 1 where z is, so that one prior serves all.
///
/// ```
/// use thetahat_core::{Basis, Error};
///
/// /// 1 and a backlash of known width, as functions of z_0.
/// struct DeadBand(f32);
///
/// impl Basis<f32> for DeadBand {
///     fn functions(&self) -> usize {
///         2
///     }
///     fn check(&self, regressors: usize) -> Result<(), Error> {
///         if regressors > 0 { Ok(()) } else { Err(Error::Length { argument: "z", expected: 1, found: 0 }) }
///     }
///     fn each(&self, z: &[f32], mut take: impl FnMut(usize, f32)) {
///         take(0, 1.0);
///         take(1, z[0] - z[0].clamp(-self.0, self.0));
///     }
///     fn add_slopes(&self, parameters: &[f32], z: &[f32], slopes: &mut [f32]) {
///         if z[0].abs() > self.0 {
///             slopes[0] += parameters[1];
///         }
///     }
/// }
///
/// let mut slopes = [0.0];
/// DeadBand(0.5).add_slopes(&[1.0, 2.0], &[2.0], &mut slopes);
/// assert_eq!((DeadBand(0.5).value(&[1.0, 2.0], &[2.0]), slopes), (4.0, [2.0]));
/// ```
pub trait Basis<T: Real> {
    /// How many functions there are.
    fn functions(&self) -> usize;

    /// That its parts fit together, and that it reads no more than this many regressors.
    ///
    /// Errors: [`Error::Length`], which names the part.
    fn check(&self, regressors: usize) -> Result<(), Error>;

    /// Calls `take` with j and f_j(z), for j = 0, 1, … in this order.
    fn each(&self, z: &[T], take: impl FnMut(usize, T));

    /// Adds dg/dz_i to each of the slopes.
    fn add_slopes(&self, parameters: &[T], z: &[T], slopes: &mut [T]);

    /// f_j(z) for all j.
    fn evaluate(&self, z: &[T], functions: &mut [T]) {
        self.each(z, |j, f| {
            if let Some(place) = functions.get_mut(j) {
                *place = f;
            }
        });
    }

    /// g(z). One multiply-add for each function, beside the functions.
    fn value(&self, parameters: &[T], z: &[T]) -> T {
        let (mut sum, mut weights) = (T::zero(), parameters.iter());
        self.each(z, |_, f| {
            if let Some(&weight) = weights.next() {
                sum += weight * f;
            }
        });
        sum
    }
}

/// Products of regressors; the product of none is the constant 1 (Leontaritis and Billings 1985).
///
/// ```
/// use thetahat_core::{Basis, Polynomial};
///
/// // 1, z_0, z_0 z_1 and z_1^2.
/// let basis = Polynomial { factors: &[0, 0, 1, 1, 1], ends: &[0, 1, 3, 5] };
/// assert_eq!(basis.value(&[1.0, 10.0, 100.0, 1000.0], &[2.0, 3.0]), 1.0 + 20.0 + 600.0 + 9000.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Polynomial<'a> {
    /// The regressors that are multiplied, from 0 on, term after term.
    pub factors: &'a [u16],
    /// Where each term ends in `factors`.
    pub ends: &'a [u32],
}

impl Polynomial<'_> {
    /// The factors of each term.
    fn terms(&self) -> impl Iterator<Item = &[u16]> {
        self.ends.iter().scan(0, |start, &end| {
            let end = end as usize;
            let own = self.factors.get(*start..end).unwrap_or_default();
            *start = end;
            Some(own)
        })
    }
}

impl<T: Real> Basis<T> for Polynomial<'_> {
    fn functions(&self) -> usize {
        self.ends.len()
    }

    fn check(&self, regressors: usize) -> Result<(), Error> {
        let expected = self.factors.len();
        let (mut found, mut rising) = (0, true);
        for &end in self.ends {
            rising &= end as usize >= found;
            found = end as usize;
        }
        if !rising {
            return Err(Error::OutOfRange { argument: "ends", range: "not below the one before" });
        }
        check_length("ends", expected, found)?;
        let needed = self.factors.iter().map(|&factor| usize::from(factor) + 1).max().unwrap_or(0);
        if needed > regressors {
            return Err(Error::Length { argument: "factors", expected: regressors, found: needed });
        }
        Ok(())
    }

    fn each(&self, z: &[T], mut take: impl FnMut(usize, T)) {
        for (j, term) in self.terms().enumerate() {
            take(j, product(T::one(), term.iter(), z));
        }
    }

    fn add_slopes(&self, parameters: &[T], z: &[T], slopes: &mut [T]) {
        for (term, &parameter) in self.terms().zip(parameters) {
            for (at, &factor) in term.iter().enumerate() {
                let others =
                    term.iter().enumerate().filter(|(other, _)| *other != at).map(|(_, other)| other);
                if let Some(slope) = slopes.get_mut(usize::from(factor)) {
                    *slope += product(parameter, others, z);
                }
            }
        }
    }
}

/// The product of these regressors and a number.
fn product<'a, T: Real>(first: T, factors: impl Iterator<Item = &'a u16>, z: &[T]) -> T {
    factors.fold(first, |product, &factor| product * z.get(usize::from(factor)).copied().unwrap_or(T::NAN))
}

/// Radial basis functions exp(-|z - α_j|²/σ_j²), and with `linear` 1 and each regressor before them (Chen, Cowan and
/// Grant 1991, with σ² for their 2 σ²).
///
/// The exponential is that of the crate libm, so that every machine gives the same bits.
///
/// ```
/// use thetahat_core::{Basis, Radial};
///
/// // Two centres, (0, 0) and (1, 1), of width 2.
/// let centres = [0.0, 0.0, 1.0, 1.0];
/// let basis = Radial { regressors: 2, centres: &centres, inverse_squares: &[0.25, 0.25], linear: false };
/// let value: f64 = basis.value(&[3.0, 0.0], &[1.0, 1.0]);
/// assert!((value - 3.0 * (-0.5_f64).exp()).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Radial<'a, T> {
    /// The number of regressors.
    pub regressors: usize,
    /// α, point after point.
    pub centres: &'a [T],
    /// 1/σ², one for each function.
    pub inverse_squares: &'a [T],
    /// Whether 1 and the regressors come first.
    pub linear: bool,
}

impl<T: Real> Radial<'_, T> {
    /// α_j and exp(-|z - α_j|²/σ_j²) with 1/σ_j².
    fn points(&self, z: &[T]) -> impl Iterator<Item = (&[T], T, T)> {
        let each = self.centres.chunks(self.regressors.max(1)).zip(self.inverse_squares);
        each.map(|(centre, &inverse)| {
            let square = |(&z, &centre): (&T, &T)| (z - centre) * (z - centre);
            let distance = z.iter().zip(centre).map(square).fold(T::zero(), |sum, square| sum + square);
            (centre, inverse, (-distance * inverse).exponential())
        })
    }

    /// How many functions there are before those of the centres.
    fn path(&self) -> usize {
        if self.linear { self.regressors + 1 } else { 0 }
    }
}

impl<T: Real> Basis<T> for Radial<'_, T> {
    fn functions(&self) -> usize {
        self.path() + self.inverse_squares.len()
    }

    fn check(&self, regressors: usize) -> Result<(), Error> {
        check_length("regressors", regressors, self.regressors)?;
        check_length("centres", self.inverse_squares.len().saturating_mul(regressors), self.centres.len())
    }

    fn each(&self, z: &[T], mut take: impl FnMut(usize, T)) {
        if self.linear {
            take(0, T::one());
            z.iter().enumerate().for_each(|(i, &z)| take(i + 1, z));
        }
        let first = self.path();
        self.points(z).enumerate().for_each(|(j, (_, _, value))| take(first + j, value));
    }

    fn add_slopes(&self, parameters: &[T], z: &[T], slopes: &mut [T]) {
        let (path, weights) = parameters.split_at_checked(self.path()).unwrap_or_default();
        slopes.iter_mut().zip(path.iter().skip(1)).for_each(|(slope, &parameter)| *slope += parameter);
        for ((centre, inverse, value), &weight) in self.points(z).zip(weights) {
            let factor = weight * value * inverse;
            for ((slope, &z), &centre) in slopes.iter_mut().zip(z).zip(centre) {
                *slope -= (factor + factor) * (z - centre);
            }
        }
    }
}

/// 1, each regressor, and bends of single regressors, so that g is a sum of natural cubic splines, one of each
/// regressor.
///
/// A natural cubic spline with the knots k_1 < … < k_K is a cubic between them, has two continuous derivatives, and is
/// a line beyond the outer knots. Its second derivative is a sum of the K - 2 hats (linear B-splines) of three knots in
/// a row, so that 1, x and the hats integrated twice are a basis (Hastie, Tibshirani and Friedman, The Elements of
/// Statistical Learning, 2nd ed. 2009, section 5.2.1, which spans the same with truncated powers). A hat of area 1
/// integrated twice is a bend: 0 before its first knot, of slope 1 after its last one. Truncated powers grow like x³
/// and are nearly sums of one another; bends grow like x.
///
/// ```
/// use thetahat_core::{Basis, Spline};
///
/// // 1, z_0 and one bend of z_0: 0 up to -1, of slope 1 from 1 on.
/// let basis = Spline { regressors: 1, bent: &[0], knots: &[[-1.0, 0.0, 1.0]] };
/// assert_eq!(basis.value(&[0.0, 0.0, 1.0], &[-2.0]), 0.0);
/// assert_eq!(basis.value(&[0.0, 0.0, 1.0], &[3.0]), 3.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spline<'a, T> {
    /// The number of regressors.
    pub regressors: usize,
    /// For each bend its regressor, from 0 on.
    pub bent: &'a [u16],
    /// For each bend its knots, rising.
    pub knots: &'a [[T; 3]],
}

impl<T: Real> Spline<'_, T> {
    /// The regressor of each bend, its value and its slope.
    fn bends(&self, z: &[T]) -> impl Iterator<Item = (usize, T, T)> {
        self.bent.iter().zip(self.knots).map(|(&bent, &knots)| {
            let bent = usize::from(bent);
            let (value, slope) = bend(z.get(bent).copied().unwrap_or(T::NAN), knots);
            (bent, value, slope)
        })
    }
}

impl<T: Real> Basis<T> for Spline<'_, T> {
    fn functions(&self) -> usize {
        self.regressors + 1 + self.knots.len()
    }

    fn check(&self, regressors: usize) -> Result<(), Error> {
        check_length("regressors", regressors, self.regressors)?;
        check_length("knots", self.bent.len(), self.knots.len())?;
        let needed = self.bent.iter().map(|&bent| usize::from(bent) + 1).max().unwrap_or(0);
        if needed > regressors {
            return Err(Error::Length { argument: "bent", expected: regressors, found: needed });
        }
        if self.knots.iter().all(|[a, b, c]| a.is_finite() && a < b && b < c && c.is_finite()) {
            return Ok(());
        }
        Err(Error::OutOfRange { argument: "knots", range: "three rising numbers each" })
    }

    fn each(&self, z: &[T], mut take: impl FnMut(usize, T)) {
        take(0, T::one());
        z.iter().enumerate().for_each(|(i, &z)| take(i + 1, z));
        let first = self.regressors + 1;
        self.bends(z).enumerate().for_each(|(j, (_, value, _))| take(first + j, value));
    }

    fn add_slopes(&self, parameters: &[T], z: &[T], slopes: &mut [T]) {
        let (path, weights) = parameters.split_at_checked(self.regressors + 1).unwrap_or_default();
        slopes.iter_mut().zip(path.iter().skip(1)).for_each(|(slope, &parameter)| *slope += parameter);
        for ((bent, _, own), &weight) in self.bends(z).zip(weights) {
            if let Some(slope) = slopes.get_mut(bent) {
                *slope += weight * own;
            }
        }
    }
}

/// The bend of the knots `[a, b, c]`, a < b < c, at x; and its slope.
fn bend<T: Real>(x: T, [a, b, c]: [T; 3]) -> (T, T) {
    let three = T::from_count(3);
    if x <= a {
        (T::zero(), T::zero())
    } else if x <= b {
        let (from, share) = (x - a, T::one() / ((b - a) * (c - a)));
        (from * from * from * share / three, from * from * share)
    } else if x < c {
        let (to, share) = (c - x, T::one() / ((c - b) * (c - a)));
        (x - (a + b + c) / three + to * to * to * share / three, T::one() - to * to * share)
    } else {
        (x - (a + b + c) / three, T::one())
    }
}

impl<T: Real, B: Basis<T>> Basis<T> for &B {
    fn functions(&self) -> usize {
        B::functions(self)
    }

    fn check(&self, regressors: usize) -> Result<(), Error> {
        B::check(self, regressors)
    }

    fn each(&self, z: &[T], take: impl FnMut(usize, T)) {
        B::each(self, z, take);
    }

    fn add_slopes(&self, parameters: &[T], z: &[T], slopes: &mut [T]) {
        B::add_slopes(self, parameters, z, slopes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bend_is_smooth_and_straight_outside() {
        let knots = [-0.5, 0.1, 1.3];
        let step = 1e-4;
        let at = |x: f64| bend(x, knots).0;
        for k in -30..=30 {
            let x = f64::from(k) * 0.1;
            let second = (at(x + step) - 2.0 * at(x) + at(x - step)) / (step * step);
            // The hat of area 1: its height is 2 over its width.
            let rise = ((x - knots[0]) / 0.6).min((knots[2] - x) / 1.2).clamp(0.0, 1.0);
            assert!((second - rise * 2.0 / 1.8).abs() < 1e-3, "{x}: {second}");
            let slope = (at(x + step) - at(x - step)) / (2.0 * step);
            assert!((slope - bend(x, knots).1).abs() < 1e-7, "{x}: {slope}");
        }
        assert_eq!(bend(-2.0, knots), (0.0, 0.0));
        assert_eq!(bend(5.0, knots).1, 1.0);
    }
}
