//! Controllers of minimum variance.

use super::RstController;
use super::polynomial::at;
use crate::error::check_finite;
use crate::stability::is_stable;
use crate::{Dimension, Error, Real};

/// How large a controller of minimum variance is: `N` of [`RstController`].
///
/// ```
/// use thetahat_core::MinimumVarianceOrders;
///
/// // A = 1 + a_1 q⁻¹, B = b_2 q⁻² + b_3 q⁻³, C = 1 + c_1 q⁻¹.
/// assert_eq!(MinimumVarianceOrders { na: 1, nb: 3, nc: 1, integrator: false }.size(), 2);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MinimumVarianceOrders {
    /// The highest power of q⁻¹ in A.
    pub na: usize,
    /// The highest power of q⁻¹ in B, delays included.
    pub nb: usize,
    /// The highest power of q⁻¹ in C.
    pub nc: usize,
    /// Whether the controller integrates.
    pub integrator: bool,
}

impl MinimumVarianceOrders {
    /// The largest of nb - 1, na and nc, and one more with an integrator.
    pub const fn size(&self) -> usize {
        let mut largest = self.nb.saturating_sub(1);
        if self.na > largest {
            largest = self.na;
        }
        if self.nc > largest {
            largest = self.nc;
        }
        largest + self.integrator as usize
    }
}

/// What is kept small beside the error.
///
/// ```
/// use thetahat_core::nalgebra::Const;
/// use thetahat_core::{Error, MinimumVariance, RstController};
///
/// // A price on changes of the input, and no error from a constant load.
/// let wanted = MinimumVariance::new(0.1).with_integrator(true);
/// let paper: RstController<f32, Const<2>> =
///     RstController::minimum_variance(&[1.0, -0.9], &[0.0, 1.0], &[1.0, -0.3], &wanted)?;
/// assert!((1.0 + paper.r().sum()).abs() < 1e-6); // R has the factor 1 - q⁻¹
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct MinimumVariance<T> {
    /// ρ, what u² costs beside (y - u_c)²; with an integrator what the square of a change of u costs. 0 is the minimum
    /// variance of the output, at whatever price, and needs a plant whose inverse is stable.
    pub input_weight: T,
    /// Whether the noise drifts, C/(1 - q⁻¹) e in place of C e: then the controller integrates, and a constant load
    /// leaves no error.
    pub integrator: bool,
}

impl<T> MinimumVariance<T> {
    /// With this weight of the input, and without an integrator.
    pub const fn new(input_weight: T) -> Self {
        MinimumVariance { input_weight, integrator: false }
    }
}

impl<T: Copy> MinimumVariance<T> {
    /// The same with an integrator, or without.
    pub const fn with_integrator(mut self, integrator: bool) -> Self {
        self.integrator = integrator;
        self
    }
}

impl<T: Real, N: Dimension> RstController<T, N> {
    /// The controller that keeps y near to u_c in spite of the noise of A(q) y = B(q) u + C(q) e, B = q⁻ᵈ B' with
    /// b_0 ≠ 0:
    ///
    /// ```text
    /// minimise E (y(k+d) - u_c(k))² + ρ u(k)²
    ///
    /// C = A F + q⁻ᵈ G,   F = 1 + f_1 q⁻¹ + … of d coefficients: the noise that comes before u(k) acts
    /// (B' F + ρ/b_0 C) u(k) = C u_c(k) - G y(k)
    /// ```
    ///
    /// With ρ = 0 the output is y(k) = u_c(k-d) + F e(k), whose variance σ² Σ f_i² no linear controller can make
    /// smaller. The poles of the loop are those of C and of b_0 B' + ρ A. With an integrator A is A (1 - q⁻¹) in all of
    /// this, and u is its change. `a`, `b` and `c` are polynomials from the power 0 on, b with its leading zeros. For
    /// ARX models c is `[1]`.
    ///
    /// A set point has the gain B'(1)/(B'(1) + ρ/b_0 A(1)), which is 1 with an integrator.
    ///
    /// Errors: [`Error::NotFinite`]; [`Error::OutOfRange`] if a or c does not begin with 1, b not with 0 or is all
    /// zeros, c or the loop has a zero that is not inside the radius 1 - 1/1024 (B' for ρ = 0: try a weight; A for a
    /// large ρ); [`Error::Orders`] if `N` is less than [`MinimumVarianceOrders::size`]; [`Error::Overflow`] for numbers
    /// at the ends of `T`.
    ///
    /// About 3 N² multiply-adds.
    ///
    /// Source: Åström, Introduction to Stochastic Control Theory, 1970, chapter 6; Clarke and Gawthrop, Self-tuning
    /// controller, Proc. IEE 122 (9), 1975 (ρ).
    ///
    /// ```
    /// use thetahat_core::nalgebra::Const;
    /// use thetahat_core::{Error, MinimumVariance, RstController};
    ///
    /// // y(k) = 0.9 y(k-1) + u(k-1) + e(k) - 0.3 e(k-1): u = -0.6 y.
    /// let wanted = MinimumVariance::new(0.0);
    /// let paper: RstController<f64, Const<1>> =
    ///     RstController::minimum_variance(&[1.0, -0.9], &[0.0, 1.0], &[1.0, -0.3], &wanted)?;
    /// assert!((paper.s()[0] - 0.6).abs() < 1e-15 && paper.r()[0] == 0.0);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn minimum_variance(a: &[T], b: &[T], c: &[T], wanted: &MinimumVariance<T>) -> Result<Self, Error> {
        let MinimumVariance { input_weight, integrator } = *wanted;
        for (argument, values) in [("a", a), ("b", b), ("c", c), ("input_weight", &[input_weight])] {
            check_finite(argument, values)?;
        }
        for (argument, values) in [("a", a), ("c", c)] {
            if values.first() != Some(&T::one()) {
                return Err(Error::OutOfRange { argument, range: "a polynomial that begins with 1" });
            }
        }
        if input_weight < T::zero() {
            return Err(Error::Negative { argument: "input_weight" });
        }
        let delay = b.iter().take_while(|value| **value == T::zero()).count();
        if delay == 0 || delay == b.len() {
            return Err(Error::OutOfRange {
                argument: "b",
                range: "a polynomial that begins with 0 and is not all 0",
            });
        }
        let orders = MinimumVarianceOrders { na: a.len() - 1, nb: b.len() - 1, nc: c.len() - 1, integrator };
        let needed = orders.size();
        let size = N::at_least(needed).map_err(|available| Error::Orders { needed, available })?;
        // A, or A (1 - q⁻¹).
        let denominator = |power: usize| {
            let before = power.checked_sub(1).map_or(T::zero(), |before| at(a, before));
            at(a, power) - if integrator { before } else { T::zero() }
        };
        let first = at(b, delay);
        let price = input_weight / first;
        let leading = first + price;
        let (mut r, mut s, mut observer) =
            (size.vector(T::zero()), size.vector(T::zero()), size.vector(T::zero()));
        for (place, entry) in observer.iter_mut().enumerate() {
            *entry = at(c, place + 1);
        }
        // Zeros that stay in the loop: b_0 B' + ρ A, and C.
        for (place, entry) in r.iter_mut().enumerate() {
            *entry = (at(b, delay + place + 1) + price * denominator(place + 1)) / leading;
        }
        s.copy_from(&observer);
        if !is_stable(s.as_mut_slice()) {
            return Err(Error::OutOfRange {
                argument: "c",
                range: "a polynomial with its zeros inside the unit circle",
            });
        }
        if !is_stable(r.as_mut_slice()) {
            return Err(Error::OutOfRange {
                argument: "input_weight",
                range: "such that the loop is stable: 0 is for a b whose zeros are inside the unit circle, others need a weight",
            });
        }
        // F, without its leading 1, in the place of R for now.
        for power in 1..delay {
            let known = f_times(r.as_slice(), delay, &denominator, power);
            if let Some(entry) = r.as_mut_slice().get_mut(power - 1) {
                *entry = at(c, power) - known;
            }
        }
        for (place, entry) in s.iter_mut().enumerate() {
            let power = delay + place;
            *entry = (at(c, power) - f_times(r.as_slice(), delay, &denominator, power)) / leading;
        }
        // B' F + ρ/b_0 C from its highest power down: what is overwritten is not needed any more, but F is. So into a
        // copy.
        let f = r.clone();
        let times_f = |power: usize| {
            let f = f.as_slice().iter().take(delay - 1);
            let others = f.enumerate().filter_map(|(place, f)| {
                let left = power.checked_sub(place + 1)?;
                Some(*f * at(b, delay + left))
            });
            others.fold(at(b, delay + power) + price * at(c, power), |sum, value| sum + value)
        };
        for (place, entry) in r.iter_mut().enumerate() {
            let before = if integrator { times_f(place) } else { T::zero() };
            *entry = (times_f(place + 1) - before) / leading;
        }
        if !(r.iter().chain(s.iter()).all(T::is_finite) && (T::one() / leading).is_finite()) {
            return Err(Error::Overflow);
        }
        RstController::new(T::one() / leading, r, s, observer)
    }
}

/// A coefficient of A F without the part a_0 f_power: F = 1 + f_1 q⁻¹ + … with `delay` coefficients.
fn f_times<T: Real>(f: &[T], delay: usize, a: &impl Fn(usize) -> T, power: usize) -> T {
    let others = f.iter().take(delay - 1).enumerate().filter_map(|(place, f)| {
        let left = power.checked_sub(place + 1)?;
        (left > 0).then(|| *f * a(left))
    });
    others.fold(a(power), |sum, value| sum + value)
}

#[cfg(test)]
mod tests;
