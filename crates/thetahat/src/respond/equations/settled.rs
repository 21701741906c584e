//! Where the covariance of the filter has settled.
//!
//! P, the gains K and the variances S of a linear model do not depend on what was measured, and go to a limit where F,
//! Q, H and R are the same from row to row (Anderson and Moore, Optimal Filtering, 1979, section 4.4):
//!
//! ```text
//! P = F (P - P H' (H P H' + R)^-1 H P) F' + Q,   |P(k) - P| <= c k^j rho^k,   rho < 1
//! ```
//!
//! So do the derivatives of P by parameters, at the same rate. P(k) counts as its limit if it is P(k/2), in every digit
//! of values and derivatives but for rounding, k the rows alike up to this one: c rho^(k/2) (1 - rho^(k/2)) below
//! rounding says that c rho^(k/2) is, and P(k) is closer yet, however slow the filter is. From there on the state alone
//! goes from row to row, until a row is unlike: another step, or another output that is missing. After it the limit is
//! known, and it is enough to be back.
//!
//! Without noise that moves the states P = 0 is such a limit of nonlinear models too: K is 0 and S = R whatever F is.

use thetahat_core::Number;

/// Changes below this fraction are rounding.
const ROUNDING: f64 = 4.0 * f64::EPSILON;
/// In fewer rows alike than these nothing settles: a slow change could be taken for rounding.
const FEWEST: usize = 32;

/// What is known of the limit of a covariance, given as its factors.
#[derive(Debug, Clone)]
pub(super) struct Settling<S> {
    /// Whether F, Q, H and R depend on parameters and the step alone.
    has_limit: bool,
    /// Whether it stays 0 where it is: no noise moves the states.
    stays_zero: bool,
    /// The limit, and a row of those in which it is one.
    limit: Vec<S>,
    of_row: Option<usize>,
    /// Whether the factors are at the limit.
    pub(super) is_there: bool,
    /// The last row, the number of those alike up to it, and the factors after half of them or more.
    last: Option<usize>,
    alike: usize,
    half: Vec<S>,
}

impl<S: Number<f64>> Settling<S> {
    pub(super) fn new(has_limit: bool, stays_zero: bool, size: usize) -> Self {
        let zeros = || vec![S::from(0.0); size];
        Self {
            has_limit,
            stays_zero,
            limit: zeros(),
            of_row: None,
            is_there: false,
            last: None,
            alike: 0,
            half: zeros(),
        }
    }

    /// Forgets everything: other parameters, or another log.
    pub(super) fn restart(&mut self) {
        (self.of_row, self.is_there, self.last, self.alike) = (None, false, None, 0);
    }

    /// Whether a row leaves the factors as they are, which is told of rows alike.
    pub(super) fn holds(&self, is_alike: impl Fn(usize) -> bool) -> bool {
        self.is_there && self.of_row.is_some_and(is_alike)
    }

    /// Hears of the factors after a row. n^2 comparisons in few rows, and where the limit is known.
    pub(super) fn note(&mut self, row: usize, factor: &[S], is_alike: impl Fn(usize) -> bool) {
        if self.stays_zero && factor.iter().all(is_zero) {
            self.limit.copy_from_slice(factor);
            (self.of_row, self.is_there) = (Some(row), true);
            return;
        }
        if !self.has_limit {
            return;
        }
        self.alike = if self.last.is_some_and(&is_alike) { self.alike + 1 } else { 1 };
        self.last = Some(row);
        self.is_there = self.of_row.is_some_and(&is_alike) && is_near(factor, &self.limit);
        if self.is_there || !self.alike.is_power_of_two() {
            return;
        }
        if self.alike > FEWEST && is_near(factor, &self.half) {
            self.limit.copy_from_slice(factor);
            (self.of_row, self.is_there) = (Some(row), true);
        }
        self.half.copy_from_slice(factor);
    }
}

/// Whether a number is 0 whatever its variables are.
fn is_zero<S: Number<f64>>(number: &S) -> bool {
    number.value() == 0.0 && number.derivatives().iter().all(|derivative| *derivative == 0.0)
}

/// Whether numbers differ by rounding at most. The derivatives are by variables whose size is 1: those of parameters
/// with bounds are logarithms.
fn is_near<S: Number<f64>>(some: &[S], others: &[S]) -> bool {
    some.iter().zip(others).all(|(one, other)| {
        let size = one.value().abs();
        let close = |one: f64, other: f64| (one - other).abs() <= ROUNDING * one.abs().max(size);
        let mut derivatives = one.derivatives().iter().zip(other.derivatives());
        close(one.value(), other.value()) && derivatives.all(|(&one, &other)| close(one, other))
    })
}

#[cfg(test)]
mod tests;
