//! What a sample does to the estimate, policy by policy.

use crate::error::check_length;
use crate::forgetting::{Forgetting, Phase};
use crate::lags::is_infinite;
use crate::outliers::Outlier;
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
        let (adapting, with_prior) = (self.adapting, self.phase != Phase::Free && running);
        let RecursiveLeastSquares {
            parameters,
            covariance,
            residuals,
            held,
            held_columns,
            noises,
            outliers,
            ..
        } = self;
        let (factor, any_held) = (covariance.as_mut_slice(), *held_columns > 0);
        // Only what is needed in each step is in here: what a function out of line is given cannot stay in registers.
        let (nis, mut action) = size.with_scratch(&mut self.scratch, |[f, v], []| {
            let spread = ud::project(factor, gradient, f, v, T::zero());
            check_small(gradient, errors, spread)?;
            // Nothing can fail from here on.
            let rule = if resting { Forgetting::None } else { policy };
            let lambda = rule.factor_at(errors, spread);
            // One λ for all columns is left to the update.
            let (noise, spread) = match rule.silence() {
                None if !any_held => (lambda, spread),
                silence => {
                    let known = (noises.as_mut_slice(), residuals.mean_squares.as_slice());
                    (T::one(), forget_columns(factor, f, v, lambda, silence, held.as_slice(), known))
                }
            };
            // The divisions for the innovation come first: they go on beside those of the update.
            let (total, growth) = (noise + spread, T::one() / noise);
            let ratio = total * growth;
            let nis = residuals.normalise(errors, variances, n, ratio);
            if !adapting {
                return Ok((nis, Action::Frozen));
            }
            // P does not shrink in a dead zone, but the estimate is better than it says.
            let (mut share, mut action) = (T::one(), Action::Skipped);
            let weight = if resting { policy.factor() } else { lambda };
            if !resting {
                // An outlier corrects by less, and P shrinks as by a sample with so much more noise.
                let outlier = (nis > outliers.limit && running).then(|| outliers.evaluate(nis));
                let (noisy, growth) = match &outlier {
                    None => (noise, growth),
                    Some(outlier) => (noise * outlier.noise, outlier.growth(growth)),
                };
                let inverse = ud::update(factor, f, v, noisy, growth);
                let gain;
                (gain, share, action) = match outlier {
                    None => {
                        outliers.in_a_row = 0;
                        // A sample that fixes parameters tells of the prior as well as of the noise. A start that takes
                        // the prior out does so from the residuals too: then every sample counts.
                        let fixing = with_prior && ratio > T::from_count(11);
                        (inverse, if fixing { T::zero() } else { noise * inverse }, Action::Updated)
                    }
                    Some(Outlier { used, counted, action, .. }) => {
                        (used / total, counted * noise / total, action)
                    }
                };
                for (index, &error) in errors.iter().enumerate() {
                    if move_by(column_mut(parameters.as_mut_slice(), n, index), v, error * gain) {
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
        if self.hold() && action == Action::Updated {
            action = Action::Capped;
        }
        Ok((nis, action))
    }

    /// Compares one variance with its bound, another in each sample, in turn. Returns whether any column is held.
    #[inline(always)]
    pub(super) fn hold(&mut self) -> bool {
        let (turn, n) = (usize::from(self.turn), self.bounds.len());
        let bound = self.bounds.as_slice().get(turn).copied().unwrap_or(T::INFINITY);
        let is_above = ud::diagonal(self.covariance.as_slice(), n, turn) > bound;
        if is_above || self.held.as_slice().get(turn).is_some_and(|held| *held) {
            self.update_held(turn, is_above);
        }
        self.turn = if turn + 1 < n { self.turn + 1 } else { 0 };
        self.held_columns > 0
    }

    /// Updates which columns of U are held. If `is_above`, so that P_ii > p_i for i = `row`, holds the columns that
    /// contribute at least p_i/n to P_ii. A column that is held keeps its noise, and is released once it contributes at
    /// most p_k/(2 n) to every P_kk.
    #[cold]
    #[inline(never)]
    fn update_held(&mut self, row: usize, is_above: bool) {
        let n = self.bounds.len();
        let RecursiveLeastSquares { covariance, bounds, held, residuals, noises, .. } = self;
        let (factor, held) = (covariance.as_slice(), held.as_mut_slice());
        let mut set = |held: &mut bool, index: usize, holds: bool| {
            *held = holds;
            keep_noise(noises.as_mut_slice(), residuals.mean_squares.as_slice(), n, index, holds);
        };
        // D_j U_ij² n/p_i
        let count = T::from_count(n);
        let share = |row: usize, index: usize| {
            let entry = if row == index { T::one() } else { ud::entry(factor, n, row, index) };
            let bound = bounds.as_slice().get(row).copied().unwrap_or(T::one());
            ud::variance(factor, n, index) * entry / bound * entry * count
        };
        if let Some(held) = held.get_mut(row).filter(|held| **held) {
            let makes_little = (0..=row).all(|other| share(other, row) * T::from_count(2) < T::one());
            set(held, row, !makes_little);
        }
        if is_above {
            for (index, held) in held.iter_mut().enumerate().skip(row) {
                if share(row, index) >= T::one() {
                    set(held, index, true);
                }
            }
        }
        let any = held.iter().filter(|held| **held).count();
        // What is not known is a prior again.
        if any > 0 && self.phase == Phase::Free {
            self.phase = Phase::Running;
        }
        self.held_columns = u16::try_from(any).unwrap_or(u16::MAX);
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

/// D_j <- D_j/λ, of the columns that are not held and tell more than `silence`, given f = U'φ and v = D f. Keeps v = D
/// f; returns φ'P φ.
#[inline(always)]
fn forget_columns<T: Real>(
    factor: &mut [T],
    f: &[T],
    v: &mut [T],
    lambda: T,
    silence: Option<T>,
    held: &[bool],
    (noises, mean_squares): (&mut [T], &[T]),
) -> T {
    let (growth, size, mut spread) = (T::one() / lambda, f.len(), T::zero());
    for (index, ((&f, v), &held)) in f.iter().zip(v).zip(held).enumerate() {
        let is_silent = silence.is_some_and(|least| f * *v <= least);
        if !held {
            if silence.is_some() {
                keep_noise(noises, mean_squares, size, index, is_silent);
            }
            if !is_silent && let Some(variance) = diagonal_mut(factor, size, index) {
                *variance *= growth;
                *v *= growth;
            }
        }
        spread += f * *v;
    }
    spread
}

/// Keeps the largest v of the noise while a column is not forgotten.
#[inline(always)]
fn keep_noise<T: Real>(noises: &mut [T], mean_squares: &[T], size: usize, index: usize, keeps: bool) {
    for (kept, &noise) in noises.iter_mut().skip(index).step_by(size.max(1)).zip(mean_squares) {
        *kept = if !keeps {
            T::zero()
        } else if noise > *kept {
            noise
        } else {
            *kept
        };
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
