//! What follows a sample in some estimators only: the random walk, and the end of a start.

use core::fmt;

use crate::forgetting::{Forgetting, Phase};
use crate::triangle::{column, column_mut};
use crate::ud::add_multiple;
use crate::{Dimension, Real, RecursiveLeastSquares, ud};

/// What an estimator of type `E` does after each sample, if anything.
///
/// It is a pointer, set when the estimator is set up, and not a branch on the policy or the start: what no estimator of
/// a program points to is not linked, also where estimators are in static memory. That is a third of the code.
pub(super) struct After<E>(Option<fn(&mut E)>);

impl<E> Clone for After<E> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<E> Copy for After<E> {}

impl<E> fmt::Debug for After<E> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Not an address: that says nothing, and differs from run to run.
        formatter.write_str(if self.0.is_some() { "After" } else { "Nothing" })
    }
}

impl<E> After<E> {
    #[inline(always)]
    pub(super) fn call(self, estimator: &mut E) {
        if let Some(after) = self.0 {
            after(estimator);
        }
    }
}

impl<T: Real, N: Dimension + Dimension<M>, M: Dimension> After<RecursiveLeastSquares<T, N, M>> {
    /// What a policy needs once the start is over.
    #[inline(always)]
    pub(super) fn of(forgetting: Forgetting<T>) -> Self {
        After(if forgetting.walk().is_some() { Some(RecursiveLeastSquares::walk) } else { None })
    }

    /// What every policy and every start can do with: it finds out.
    pub(super) fn any() -> Self {
        After(Some(RecursiveLeastSquares::finish_start))
    }
}

impl<T: Real, N: Dimension + Dimension<M>, M: Dimension> RecursiveLeastSquares<T, N, M> {
    /// P_jj <- P_jj + n `variance` / scale_j², for the parameter whose turn it is, unless it is held.
    #[inline(never)]
    pub(super) fn walk(&mut self) {
        let Some(variance) = self.forgetting.walk() else { return };
        let growth = variance * T::from_count(self.bounds.len()) / T::from_count(100);
        let (factor, bounds) = (self.covariance.as_mut_slice(), self.bounds.as_slice());
        let turn = usize::from(self.turn);
        // A parameter that is known stays so, and none becomes less sure than its bound.
        let variance = ud::diagonal(factor, bounds.len(), turn);
        if variance.is_zero() || bounds.get(turn).is_none_or(|&bound| variance > bound) {
            return;
        }
        self.bounds.shape_generic().0.with_scratch(&mut self.scratch, |[unit], []| {
            unit.fill(T::zero());
            if let (Some(entry), Some(&bound)) = (unit.get_mut(turn), bounds.get(turn)) {
                *entry = T::one();
                ud::add_dyad(factor, unit, growth * bound);
            }
        });
    }

    /// Goes on with the start; once it is over, with what the policy needs.
    #[cold]
    #[inline(never)]
    fn finish_start(&mut self) {
        let running = self.phase.is_running();
        self.remove_prior();
        if self.phase.is_running() {
            self.after = After::of(self.forgetting);
        }
        if running {
            self.after.call(self);
        }
    }

    /// Takes a share of the prior θ_j = 0, var p_j, out of the estimate, once the data outweigh it.
    ///
    /// ```text
    /// q = p_j/share - P_jj,    W v <- W v - θ̂_j²/q,    θ̂ <- θ̂ + P e_j θ̂_j / q,    P <- P + P e_j e_j'P / q
    /// ```
    ///
    /// Σ P_jj/p_j <= 1/2 says that P⁻¹ is at least twice the information of the prior. So q >= p_j/2 in every step.
    /// Here p_j is that of the start, see [`width`](RecursiveLeastSquares::width).
    fn remove_prior(&mut self) {
        let width = self.width();
        let RecursiveLeastSquares { parameters, covariance, bounds, residuals, .. } = self;
        let size = covariance.size();
        let (n, factor) = (size.value(), covariance.as_mut_slice());
        if self.phase.is_running() {
            return;
        }
        if self.phase != Phase::Blending {
            let known = bounds.as_slice().iter().enumerate();
            let sum = known.fold(T::zero(), |sum, (index, &p)| sum + ud::diagonal(factor, n, index) / p);
            if sum > width / T::from_count(2) {
                return;
            }
        }
        let shares = T::from_count(usize::from(self.shares));
        size.with_scratch(&mut self.scratch, |[gain], []| {
            for (index, &bound) in bounds.as_slice().iter().enumerate() {
                covariance_column(factor, index, gain);
                let variance = gain.get(index).copied().unwrap_or(T::zero());
                let rest = bound * width * shares - variance;
                if rest <= T::zero() {
                    continue;
                }
                for (output, mean) in residuals.mean_squares.as_mut_slice().iter_mut().enumerate() {
                    let parameters = column_mut(parameters.as_mut_slice(), n, output);
                    let parameter = parameters.get(index).copied().unwrap_or(T::zero());
                    *mean = (*mean - parameter / rest * parameter / residuals.weights).max(T::zero());
                    add_multiple(parameters, parameter / rest, gain);
                }
                ud::add_dyad(factor, gain, T::one() / rest);
            }
        });
        self.shares_left = self.shares_left.saturating_sub(1);
        self.phase = if self.shares_left > 0 { Phase::Blending } else { Phase::Free };
    }

    /// By how much the variances of the prior that an exact start takes out are above p_j. With forgetting it cannot
    /// be more than 1: an estimate that is less sure than its bound counts as not known.
    pub(super) fn width(&self) -> T {
        let wide = self.phase == Phase::Collecting && !self.forgetting.forgets();
        if wide { T::from_count(10_000) } else { T::one() }
    }
}

/// Writes P e_j into `target`.
fn covariance_column<T: Real>(factor: &[T], index: usize, target: &mut [T]) {
    let size = target.len();
    target.fill(T::zero());
    for k in index..size {
        let variance = ud::variance(factor, size, k);
        let weight = if k == index { variance } else { variance * ud::entry(factor, size, index, k) };
        let (above, rest) = target.split_at_mut_checked(k).unwrap_or_default();
        add_multiple(above, weight, column(factor, size, k));
        if let [diagonal, ..] = rest {
            *diagonal += weight;
        }
    }
}
