//! What a sample does to the estimate, policy by policy.

use crate::error::check_length;
use crate::forgetting::{Forgetting, Phase};
use crate::lags::is_infinite;
use crate::triangle::{column_mut, diagonal_mut};
use crate::ud::{add_multiple, dot};
use crate::{Action, Dimension, Error, Real, RecursiveLeastSquares, ud};

impl<T: Real, N: Dimension + Dimension<M>, M: Dimension> RecursiveLeastSquares<T, N, M> {
    /// One sample; writes the innovations and their variances.
    #[inline(always)]
    pub(super) fn step(
        &mut self,
        regressor: &[T],
        outputs: &[T],
        errors: &mut [T],
        variances: &mut [T],
    ) -> Result<(T, Action), Error> {
        check_length("regressor", self.bounds.len(), regressor.len())?;
        check_length("outputs", errors.len(), outputs.len())?;
        for (index, (error, &output)) in errors.iter_mut().zip(outputs).enumerate() {
            *error = output - dot(regressor, self.of_output(index));
        }
        // A number that is not finite always shows in the innovation.
        if !errors.iter().all(T::is_finite) {
            check_sample(regressor, outputs)?;
            self.advance();
            return Ok((T::zero(), Action::Missing));
        }
        self.correct(regressor, errors, variances, |parameters, direction, step| {
            add_multiple(parameters, step, direction);
            false
        })
    }

    /// Corrects by these innovations, given the gradient of the prediction with respect to the parameters. Writes
    /// the variances of the innovations; returns their normalised sum of squares, and what was done.
    ///
    /// `move_by` adds a multiple of a direction to the parameters of one output, or less where it must, and then
    /// returns true.
    #[inline(always)]
    pub(crate) fn correct(
        &mut self,
        gradient: &[T],
        errors: &[T],
        variances: &mut [T],
        mut move_by: impl FnMut(&mut [T], &[T], T) -> bool,
    ) -> Result<(T, Action), Error> {
        let size = self.covariance.size();
        let n = size.value();
        let running = self.phase.is_running();
        let policy = if running { self.forgetting } else { Forgetting::None };
        let resting = !self.adapting || self.is_in_dead_zone(errors);
        let (adapting, weight, with_prior) =
            (self.adapting, policy.factor(), self.phase != Phase::Free && running);
        let RecursiveLeastSquares { parameters, covariance, residuals, .. } = self;
        let factor = covariance.as_mut_slice();
        // Only what is needed in each step is in here: what a function out of line is given cannot stay in registers.
        let (nis, mut action) = size.with_scratch(&mut self.scratch, |[f, v], []| {
            let spread = ud::project(factor, gradient, f, v, T::zero());
            check_small(gradient, errors, spread)?;
            // Nothing can fail from here on.
            let rule = if resting { Forgetting::None } else { policy };
            let spread = rule.forget_directions(factor, f, v, spread);
            let noise = rule.factor_at(errors, spread);
            // The divisions for the innovation come first: they go on beside those of the update.
            let (total, growth) = (noise + spread, T::one() / noise);
            let nis = residuals.normalise(errors, variances, n, total * growth);
            if !adapting {
                return Ok((nis, Action::Frozen));
            }
            // P does not shrink in a dead zone, but the estimate is better than it says.
            let (mut share, mut action) = (T::one(), Action::Skipped);
            let weight = if rule.follows_innovation() { noise } else { weight };
            if !resting {
                let inverse = ud::update(factor, f, v, noise, growth);
                // A sample that fixes parameters tells of the prior as well as of the noise. A start that takes the prior
                // out does so from the residuals too: then every sample counts.
                let fixing = with_prior && total * growth > T::from_count(11);
                share = if fixing { T::zero() } else { noise * inverse };
                action = Action::Updated;
                for (index, &error) in errors.iter().enumerate() {
                    if move_by(column_mut(parameters.as_mut_slice(), n, index), v, error * inverse) {
                        action = Action::Projected;
                    }
                }
            }
            residuals.count(errors, share, weight);
            Ok((nis, action))
        })?;
        if resting {
            return Ok((nis, action));
        }
        self.after.call(self);
        if !running {
            if self.phase == Phase::Collecting {
                action = Action::Collecting;
            }
            return Ok((nis, action));
        }
        if !policy.forgets() {
            return Ok((nis, action));
        }
        if self.cap() && action == Action::Updated {
            action = Action::Capped;
        }
        Ok((nis, action))
    }

    /// Brings P_jj back to p_j, if it is above, for the parameter whose turn it is; the next one is next.
    #[inline(always)]
    pub(super) fn cap(&mut self) -> bool {
        let (turn, n) = (usize::from(self.turn), self.bounds.len());
        let variance = ud::diagonal(self.covariance.as_slice(), n, turn);
        let bound = self.bounds.as_slice().get(turn).copied().unwrap_or(T::INFINITY);
        let above = variance > bound;
        if above {
            // In this order nothing overflows.
            self.bring_back(bound / ((variance - bound) / variance));
        }
        self.turn = if turn + 1 < n { self.turn + 1 } else { 0 };
        above
    }

    /// Absorbs a measurement of the parameter whose turn it is, with this noise variance, whose innovation is 0.
    #[cold]
    #[inline(never)]
    fn bring_back(&mut self, noise: T) {
        // This is a prior again.
        if self.phase == Phase::Free {
            self.phase = Phase::Running;
        }
        let (size, turn) = (self.covariance.size(), usize::from(self.turn));
        let factor = self.covariance.as_mut_slice();
        size.with_scratch(&mut self.scratch, |[f, v], []| {
            measure_one(factor, turn, f, v);
            ud::update(factor, f, v, noise, T::one());
        });
    }

    fn is_in_dead_zone(&self, errors: &[T]) -> bool {
        self.dead_zone > T::zero() && errors.iter().all(|error| error.abs() <= self.dead_zone)
    }
}

/// That no number of a sample is infinite, and one is NaN.
#[cold]
fn check_sample<T: Real>(regressor: &[T], outputs: &[T]) -> Result<(), Error> {
    if regressor.iter().any(is_infinite) {
        return Err(Error::Infinite { argument: "regressor" });
    }
    if outputs.iter().any(is_infinite) {
        return Err(Error::Infinite { argument: "output" });
    }
    let missing = regressor.iter().chain(outputs).any(|value| !value.is_finite());
    missing.then_some(()).ok_or(Error::TooLarge { argument: "regressor" })
}

/// Whether the squares sum up to at most `LARGEST_ENTRY`. With φ and e that small, and the scales in their range,
/// neither U nor D nor θ̂ can overflow or vanish: D_j >= 1/(P⁻¹)_jj = 1/(1/p_j + Σ φ_j²), the sum over the memory;
/// |U_ij| <= √(P_ii/D_j); |Δθ_j| <= √P_jj |e|.
#[inline(always)]
pub(crate) fn is_small<T: Real>(values: &[T]) -> bool {
    dot(values, values) <= T::LARGEST_ENTRY
}

/// That a sample can be absorbed without overflow, given φ'P φ. Forgetting makes at most twice that of it, as λ is
/// 1/2 or more.
#[inline(always)]
fn check_small<T: Real>(gradient: &[T], errors: &[T], spread: T) -> Result<(), Error> {
    if !((spread * T::from_count(4)).is_finite() && is_small(gradient)) {
        return Err(Error::TooLarge { argument: "regressor" });
    }
    if !is_small(errors) {
        return Err(Error::TooLarge { argument: "output" });
    }
    Ok(())
}

/// P <- `scale` P.
#[inline(always)]
pub(super) fn scale_variances<T: Real>(factor: &mut [T], size: usize, scale: T) {
    for index in 0..size {
        if let Some(variance) = diagonal_mut(factor, size, index) {
            *variance *= scale;
        }
    }
}

/// f = U'h, v = D f for h = e_j.
pub(super) fn measure_one<T: Real>(factor: &[T], index: usize, f: &mut [T], v: &mut [T]) {
    let size = f.len();
    for (k, (f, v)) in f.iter_mut().zip(v).enumerate() {
        *f = match k {
            _ if k < index => T::zero(),
            _ if k == index => T::one(),
            _ => ud::entry(factor, size, index, k),
        };
        *v = ud::variance(factor, size, k) * *f;
    }
}
