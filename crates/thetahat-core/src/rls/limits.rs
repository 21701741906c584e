//! Limits of parameters, kept by projection.

use core::ops::RangeInclusive;

use nalgebra::Const;

use super::sample::measure_one;
use crate::error::check_length;
use crate::ud::add_multiple;
use crate::{Dimension, Error, Real, RecursiveLeastSquares, ud};

impl<T: Real, N: Dimension + Dimension<Const<1>>> RecursiveLeastSquares<T, N> {
    /// Takes the parameters back to their limits, one range for each, where an update has led them out. Returns whether
    /// one was out: then what became of the sample is [`Action::Projected`](crate::Action::Projected).
    ///
    /// ```text
    /// θ̂ <- argmin (θ - θ̂)'P⁻¹(θ - θ̂)     over all θ with  lower_j <= θ_j <= upper_j
    /// ```
    ///
    /// That is the least squares estimate under these limits: what a limit takes from one parameter, those that
    /// correlate with it make up for, as θ̂ - P e_j (θ̂_j - limit)/P_jj does for one alone. (To cut off a parameter by
    /// itself would spoil the predictions.) P stays as it is.
    ///
    /// For what is known of a plant, such as the sign of a gain that a self-tuning controller divides by. An
    /// infinite end is no limit. Call it after each update, before the parameters are used; the limits are the
    /// caller's, and may be a constant in flash.
    ///
    /// Errors, after which nothing has changed: [`Error::Length`] if there is not one range for each parameter;
    /// [`Error::OutOfRange`] if one is empty, or an end is NaN.
    ///
    /// 2 n comparisons where all hold. With a limits active some 1.5 n² a² multiply-adds, 3 n² for one, and n² + 4 n
    /// numbers on the stack. (With `Dyn` the first call that moves takes memory for them.)
    ///
    /// Source: Nocedal and Wright, Numerical Optimization, 2nd ed., section 16.5 (active sets); Goodwin and Sin,
    /// Adaptive Filtering Prediction and Control, 1984, section 3.7 (projection in the metric of P).
    ///
    /// ```
    /// use core::ops::RangeInclusive;
    /// use thetahat_core::nalgebra::{Const, Vector2};
    /// use thetahat_core::{Error, Forgetting, RecursiveLeastSquares};
    ///
    /// // The second parameter is a gain, and positive.
    /// const LIMITS: [RangeInclusive<f32>; 2] = [f32::NEG_INFINITY..=f32::INFINITY, 0.01..=f32::INFINITY];
    /// let mut line: RecursiveLeastSquares<f32, Const<2>> =
    ///     RecursiveLeastSquares::new(&Vector2::new(1.0, 1.0), Forgetting::default())?;
    /// line.update(&Vector2::new(1.0, 1.0), -3.0)?;
    /// assert!(line.keep_within(&LIMITS)?);
    /// let [offset, gain] = (*line.parameters()).into();
    /// // The other one has taken over: the line still passes the point (but for the prior).
    /// assert!((0.01..0.0101).contains(&gain) && (offset + gain + 3.0).abs() < 0.1);
    /// assert!(!line.keep_within(&LIMITS)?);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn keep_within(&mut self, limits: &[RangeInclusive<T>]) -> Result<bool, Error> {
        check_limits(limits, self.bounds.len())?;
        Ok(self.project(limits))
    }

    /// The same, checked; what has no range has no limit.
    pub(crate) fn project(&mut self, limits: &[RangeInclusive<T>]) -> bool {
        let holds = |(parameter, limit): (&T, &RangeInclusive<T>)| limit.contains(parameter);
        let all = self.parameters.as_slice().iter().zip(limits).all(holds);
        if !all {
            self.move_within(limits);
        }
        !all
    }

    /// By a set of active limits: the limit that is passed by most, in standard deviations, joins it; one that keeps
    /// its parameter from going inwards leaves. Once neither happens, that is the point.
    #[cold]
    #[inline(never)]
    fn move_within(&mut self, limits: &[RangeInclusive<T>]) {
        let size = self.covariance.size();
        let n = size.value();
        let (factor, parameters) = (self.covariance.as_slice(), self.parameters.as_mut_slice());
        size.with_scratch(&mut self.scratch, |[estimate, ends, f, v], [work]| {
            ud::copy(parameters, estimate);
            // NaN: not active.
            ends.fill(T::NAN);
            let mut at = |ends: &[T], parameters: &mut [T]| {
                ud::copy(estimate, parameters);
                ud::copy(factor, work);
                condition(work, parameters, ends, f, v);
            };
            // Each round but the last changes the set; in exact arithmetic few do.
            for _ in 0..4 * n {
                if let Some((index, end)) = furthest_out(parameters, limits, ends, factor) {
                    set(ends, index, end);
                    at(ends, parameters);
                    continue;
                }
                let leaves = limits.iter().enumerate().any(|(index, limit)| {
                    let end = ends.get(index).copied().unwrap_or(T::NAN);
                    if !end.is_finite() {
                        return false;
                    }
                    set(ends, index, T::NAN);
                    at(ends, parameters);
                    // Inwards, be it beyond the other end: that may join then.
                    let inwards = parameters.get(index).is_some_and(|&parameter| {
                        parameter > end && *limit.end() > end || parameter < end && *limit.start() < end
                    });
                    if !inwards {
                        set(ends, index, end);
                    }
                    inwards
                });
                if !leaves {
                    at(ends, parameters);
                    break;
                }
            }
        });
        // Rounding, and what P holds where it is.
        cut_off(parameters, limits);
    }

    /// Sets the parameters, and nothing else.
    pub(crate) fn put_parameters(&mut self, parameters: &[T]) {
        ud::copy(parameters, self.parameters.as_mut_slice());
    }

    /// Cuts off each parameter by itself.
    pub(crate) fn cut_off(&mut self, limits: &[RangeInclusive<T>]) {
        cut_off(self.parameters.as_mut_slice(), limits);
    }
}

/// The parameter that is furthest out of its limits, in its standard deviations, of those that are at no end yet; the
/// end.
fn furthest_out<T: Real>(
    parameters: &[T],
    limits: &[RangeInclusive<T>],
    ends: &[T],
    factor: &[T],
) -> Option<(usize, T)> {
    let (mut furthest, mut found) = (T::zero(), None);
    for (index, ((&parameter, limit), at)) in parameters.iter().zip(limits).zip(ends).enumerate() {
        if at.is_finite() || limit.contains(&parameter) {
            continue;
        }
        let end = if parameter < *limit.start() { *limit.start() } else { *limit.end() };
        let beyond = (parameter - end).abs() / ud::diagonal(factor, parameters.len(), index).sqrt();
        // Infinite: it is held.
        if beyond > furthest && beyond.is_finite() {
            (furthest, found) = (beyond, Some((index, end)));
        }
    }
    found
}

fn set<T>(values: &mut [T], index: usize, value: T) {
    if let Some(place) = values.get_mut(index) {
        *place = value;
    }
}

/// Takes parameters with the covariance `factor` for measured exactly, where there is an end: θ <- θ + P e_j (end -
/// θ_j)/P_jj, P <- P - P e_j e_j'P/P_jj, one after another. What the others leave no variance stays.
fn condition<T: Real>(factor: &mut [T], parameters: &mut [T], ends: &[T], f: &mut [T], v: &mut [T]) {
    let size = parameters.len();
    for (index, &end) in ends.iter().enumerate() {
        let Some(&parameter) = parameters.get(index) else { return };
        if !(end.is_finite() && ud::diagonal(factor, size, index) > T::zero()) {
            continue;
        }
        measure_one(factor, index, f, v);
        let step = (end - parameter) * ud::update(factor, f, v, T::zero(), T::one());
        if step.is_finite() {
            add_multiple(parameters, step, v);
        }
    }
}

fn cut_off<T: Real>(parameters: &mut [T], limits: &[RangeInclusive<T>]) {
    for (parameter, limit) in parameters.iter_mut().zip(limits) {
        if *parameter < *limit.start() {
            *parameter = *limit.start();
        } else if *parameter > *limit.end() {
            *parameter = *limit.end();
        }
    }
}

/// That there is a range for each of this many parameters, and that none is empty.
pub(crate) fn check_limits<T: Real>(limits: &[RangeInclusive<T>], parameters: usize) -> Result<(), Error> {
    check_length("limits", parameters, limits.len())?;
    let possible = |limit: &RangeInclusive<T>| *limit.start() < T::INFINITY && *limit.end() > -T::INFINITY;
    if limits.iter().all(|limit| limit.start() <= limit.end() && possible(limit)) {
        Ok(())
    } else {
        Err(Error::OutOfRange { argument: "limits", range: "from a lower end to an upper one" })
    }
}
