//! What a sample does to the estimate, policy by policy.

use crate::error::check_length;
use crate::forgetting::{Forgetting, Phase};
use crate::lags::is_infinite;
use crate::triangle::{column, column_mut};
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
        let (adapting, weight, with_prior) = (self.adapting, policy.factor(), self.phase == Phase::Running);
        let RecursiveLeastSquares { parameters, covariance, residuals, .. } = self;
        let factor = covariance.as_mut_slice();
        // Only what is needed in each step is in here: what a function out of line is given cannot stay in registers.
        let (nis, mut action) = size.with_scratch(&mut self.scratch, |[f, v], []| {
            let spread = ud::project(factor, gradient, f, v, T::zero());
            check_small(gradient, errors, spread)?;
            // Nothing can fail from here on.
            if resting {
                let nis = residuals.normalise(errors, variances, n, T::one() + spread);
                if !adapting {
                    return Ok((nis, Action::Frozen));
                }
                // P does not shrink meanwhile, but the estimate is better than it says.
                residuals.count(errors, T::one(), weight);
                return Ok((nis, Action::Skipped));
            }
            let spread = match policy {
                Forgetting::Selective { factor: lambda } => forget_selectively(factor, f, v, lambda),
                _ => spread,
            };
            let noise = match policy {
                Forgetting::None | Forgetting::RandomWalk { .. } | Forgetting::Selective { .. } => T::one(),
                Forgetting::Exponential { factor } => factor,
                Forgetting::Variable { factor, minimum, noise_variance } => {
                    let surprise =
                        errors.iter().fold(T::zero(), |sum, &error| sum + error / noise_variance * error);
                    let surprise = surprise / T::from_count(errors.len()) / (T::one() + spread);
                    (T::one() - (T::one() - factor) * surprise).max(minimum)
                }
            };
            // The divisions for the innovation come first: they go on beside those of the update.
            let (total, growth) = (noise + spread, T::one() / noise);
            let nis = residuals.normalise(errors, variances, n, total * growth);
            let inverse = ud::update(factor, f, v, noise, growth);
            // A sample that fixes parameters tells of the prior as well as of the noise. A start that takes the prior
            // out does so from the residuals too: then every sample counts.
            let fixing = with_prior && total * growth > T::from_count(11);
            let weight = if let Forgetting::Variable { .. } = policy { noise } else { weight };
            residuals.count(errors, if fixing { T::zero() } else { noise * inverse }, weight);
            let mut restrained = false;
            for (index, &error) in errors.iter().enumerate() {
                restrained |= move_by(column_mut(parameters.as_mut_slice(), n, index), v, error * inverse);
            }
            Ok((nis, if restrained { Action::Projected } else { Action::Updated }))
        })?;
        if resting {
            return Ok((nis, action));
        }
        if !running {
            self.remove_prior();
            if let Phase::Waiting { collecting: true, .. } = self.phase {
                action = Action::Collecting;
            }
            return Ok((nis, action));
        }
        if let Forgetting::None = policy {
            return Ok((nis, action));
        }
        if let Forgetting::RandomWalk { variance } = policy {
            self.walk(variance);
        }
        if self.cap() && action == Action::Updated {
            action = Action::Capped;
        }
        Ok((nis, action))
    }

    /// P_jj <- P_jj + n `variance` / scale_j², for the parameter whose turn it is, unless it is held.
    #[inline(never)]
    pub(super) fn walk(&mut self, variance: T) {
        let growth = variance * T::from_count(self.bounds.len()) / T::from_count(100);
        let (factor, bounds, turn) = (self.covariance.as_mut_slice(), self.bounds.as_slice(), self.turn);
        // A parameter that is held stays.
        if ud::diagonal(factor, bounds.len(), turn).is_zero() {
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

    /// Brings P_jj back to p_j, if it is above, for the parameter whose turn it is; the next one is next.
    #[inline(always)]
    pub(super) fn cap(&mut self) -> bool {
        let (turn, n) = (self.turn, self.bounds.len());
        let variance = ud::diagonal(self.covariance.as_slice(), n, turn);
        let bound = self.bounds.as_slice().get(turn).copied().unwrap_or(T::INFINITY);
        let above = variance > bound;
        if above {
            // In this order nothing overflows.
            self.bring_back(bound / ((variance - bound) / variance));
        }
        self.turn = if turn + 1 < n { turn + 1 } else { 0 };
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
        let (size, turn) = (self.covariance.size(), self.turn);
        let factor = self.covariance.as_mut_slice();
        size.with_scratch(&mut self.scratch, |[f, v], []| {
            measure_one(factor, turn, f, v);
            ud::update(factor, f, v, noise, T::one());
        });
    }

    /// Takes a share of the prior θ_j = 0, var p_j, out of the estimate, once the data outweigh it.
    ///
    /// ```text
    /// q = p_j/share - P_jj,    W v <- W v - θ̂_j²/q,    θ̂ <- θ̂ + P e_j θ̂_j / q,    P <- P + P e_j e_j'P / q
    /// ```
    ///
    /// Σ P_jj/p_j <= 1/2 says that P⁻¹ is at least twice the information of the prior. So q >= p_j/2 in every step.
    /// Here p_j is that of the start, see [`width`](RecursiveLeastSquares::width).
    #[cold]
    #[inline(never)]
    fn remove_prior(&mut self) {
        let width = self.width();
        let RecursiveLeastSquares { parameters, covariance, bounds, residuals, phase, .. } = self;
        let size = covariance.size();
        let (n, factor) = (size.value(), covariance.as_mut_slice());
        let (left, total) = match *phase {
            Phase::Running | Phase::Free => return,
            Phase::Blending { left, total } => (left, total.max(1)),
            Phase::Waiting { blend, .. } => {
                let known = bounds.as_slice().iter().enumerate();
                let sum = known.fold(T::zero(), |sum, (index, &p)| sum + ud::diagonal(factor, n, index) / p);
                if sum > width / T::from_count(2) {
                    return;
                }
                (blend.max(1), blend.max(1))
            }
        };
        size.with_scratch(&mut self.scratch, |[gain], []| {
            for (index, &bound) in bounds.as_slice().iter().enumerate() {
                covariance_column(factor, index, gain);
                let variance = gain.get(index).copied().unwrap_or(T::zero());
                let rest = bound * width * T::from_count(usize::from(total)) - variance;
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
        *phase = if left > 1 { Phase::Blending { left: left - 1, total } } else { Phase::Free };
    }

    /// By how much the variances of the prior that an exact start takes out are above p_j. With forgetting it cannot
    /// be more than 1: an estimate that is less sure than the cap lets it be would be held where it is.
    pub(super) fn width(&self) -> T {
        match (self.phase, self.forgetting) {
            (Phase::Waiting { collecting: true, .. }, Forgetting::None) => T::from_count(10_000),
            _ => T::one(),
        }
    }

    fn is_in_dead_zone(&self, errors: &[T]) -> bool {
        self.dead_zone > T::zero() && errors.iter().all(|error| error.abs() <= self.dead_zone)
    }
}

/// That no number of a sample is infinite, and one is NaN.
#[cold]
fn check_sample<T: Real>(regressor: &[T], outputs: &[T]) -> Result<(), Error> {
    for (argument, values) in [("regressor", regressor), ("output", outputs)] {
        if values.iter().any(is_infinite) {
            return Err(Error::Infinite { argument });
        }
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

/// Selective forgetting, between the two phases of an update: D_j <- D_j/λ where f_j² D_j > (1 - λ)/100. Keeps
/// v = D f; returns φ'P φ.
#[inline(always)]
fn forget_selectively<T: Real>(factor: &mut [T], f: &[T], v: &mut [T], lambda: T) -> T {
    let (growth, least) = (T::one() / lambda, (T::one() - lambda) / T::from_count(100));
    let (size, mut spread) = (f.len(), T::zero());
    for (index, (&f, v)) in f.iter().zip(v).enumerate() {
        if f * *v > least
            && let Some(variance) = diagonal_mut(factor, size, index)
        {
            *variance *= growth;
            *v *= growth;
        }
        spread += f * *v;
    }
    spread
}

fn diagonal_mut<T: Real>(factor: &mut [T], size: usize, index: usize) -> Option<&mut T> {
    column_mut(factor, size, index).get_mut(index)
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
fn measure_one<T: Real>(factor: &[T], index: usize, f: &mut [T], v: &mut [T]) {
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
