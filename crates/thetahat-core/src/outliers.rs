//! What becomes of samples whose innovations are far larger than the noise makes them.

use crate::{Action, Error, Real};

/// What a recursive estimator does with a sample whose innovation is far larger than the noise makes it: a spike of a
/// sensor, a bit that flipped.
///
/// One such sample can undo what hundreds have taught, as least squares weighs errors by their squares. The
/// normalised innovation squared ([`nis`](crate::Innovation::nis)) tells it from others: for Gaussian noise it is above
/// 9 in 0.3 % of the samples, above 16 in 0.006 %.
///
/// A spike would also stand in the regressors of the next samples. So the delay lines of past outputs (of ARX, ARMAX
/// and nonlinear ARX models) take of the first outlier in a row the prediction plus the part of the innovation that was
/// used (Martin and Thomson, Robust-resistant spectrum estimation, 1982). An outlier right after it tells that the
/// plant has moved: it is taken as it was measured. (On ten public logs of plants that are not all linear, to clean all
/// of a row made the errors of a step ahead up to eight times as large.)
///
/// What an outlier tells of the noise variance is bounded by the threshold, twice as much of it with each in a row: so
/// a noise that has grown is learnt within a few samples, even from none, and nothing is locked out for ever.
///
/// What it costs and brings: the root mean square error of b_0 = 1 of ARX(1, 1), forgetting by 0.99, Gaussian noise,
/// over 100 runs; with one sample in 100 a spike of 30 deviations; and after how many samples half of a change of b_0
/// to 2 is learnt:
///
/// | | no outliers | spikes | half of a change |
/// |---|---|---|---|
/// | `Used` | 0.0144 | 0.0536 | 69.9 |
/// | `Huber`, 3 | 0.0144 | 0.0155 | 71.3 |
/// | `Gate`, 25, 20 | 0.0144 | 0.0145 | 71.5 |
/// | `Gate`, 16, 5 | 0.0144 | 0.0145 | 74.7 |
///
/// (Printed by `cargo test -p thetahat-core --lib outliers::tests::table -- --nocapture`.) It is off unless it is asked
/// for: on logs without spikes, of plants that are not linear, the errors of a step ahead are up to a third larger with
/// it (ten public logs: 7 % on average; with a spike in one sample of 100 they are a fifth, the median), and without it
/// the estimate is that of least squares.
///
/// It begins once the noise variance is known, and the [start](crate::RlsStart) is over.
///
/// ```
/// use thetahat_core::nalgebra::{Const, Vector1};
/// use thetahat_core::{Action, Error, Forgetting, Outliers, RecursiveLeastSquares};
///
/// let mut level: RecursiveLeastSquares<f64, Const<1>> =
///     RecursiveLeastSquares::new(&Vector1::new(1.0), Forgetting::default())?
///         .with_outliers(Outliers::Gate { nis: 25.0, release: 10 })?;
/// for k in 0..100 {
///     level.update(&Vector1::new(1.0), 5.0 + 0.1 * f64::from(k % 3 - 1))?;
/// }
/// assert_eq!(level.update(&Vector1::new(1.0), 300.0)?.action, Action::Gated);
/// assert!((level.parameters()[0] - 5.0).abs() < 0.01);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Outliers<T> {
    /// It corrects as any other.
    #[default]
    Used,
    /// An innovation of more than `threshold` standard deviations corrects as much as one of `threshold`, and P shrinks
    /// by less: [`Action::Bounded`](crate::Action::Bounded). With 3 next to nothing is lost where
    /// the noise is Gaussian.
    ///
    /// Source: Huber, Robust Statistics, 1981, section 7.8 (the weight).
    Huber {
        /// From 1 on, in standard deviations.
        threshold: T,
    },
    /// A sample whose normalised innovation squared is above `nis` corrects nothing:
    /// [`Action::Gated`](crate::Action::Gated). After `release` of them in a row the next ones are used,
    /// [`Action::Released`](crate::Action::Released), until one is within the gate again; with 0
    /// the gate lets go only as the noise variance learns of them.
    Gate {
        /// From 1 on; 25 is five standard deviations.
        nis: T,
        /// How many in a row.
        release: u16,
    },
}

impl<T: Real> Outliers<T> {
    /// That the threshold is in its range.
    pub(crate) fn check(self) -> Result<(), Error> {
        let (argument, threshold) = match self {
            Outliers::Used => return Ok(()),
            Outliers::Huber { threshold } => ("threshold", threshold),
            Outliers::Gate { nis, .. } => ("nis", nis),
        };
        let fits = threshold >= T::one() && threshold * threshold <= T::LARGEST_ENTRY;
        fits.then_some(()).ok_or(Error::OutOfRange { argument, range: "1 or more, and not huge" })
    }
}

/// A rule at work, in few bytes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Watch<T> {
    /// The normalised innovation squared above which a sample is an outlier.
    pub(crate) limit: T,
    /// How many of them came in a row.
    pub(crate) in_a_row: u16,
    release: u16,
    bounds: bool,
}

/// What becomes of an outlier.
pub(crate) struct Outlier<T> {
    /// How many times the variance of the noise P shrinks by.
    pub(crate) noise: T,
    /// The part of its innovation that is used.
    pub(crate) used: T,
    /// The part of its square that counts in the noise variance.
    pub(crate) counted: T,
    pub(crate) action: Action,
}

impl<T: Real> Outlier<T> {
    /// By what P grows as it forgets: where nothing is used nothing is forgotten.
    pub(crate) fn growth(&self, usual: T) -> T {
        if self.used.is_zero() { T::one() } else { usual }
    }
}

impl<T: Real> Watch<T> {
    pub(crate) fn new(rule: Outliers<T>) -> Result<Self, Error> {
        rule.check()?;
        let (limit, release, bounds) = match rule {
            Outliers::Used => (T::INFINITY, 0, false),
            Outliers::Huber { threshold } => (threshold * threshold, 0, true),
            Outliers::Gate { nis, release } => (nis, release, false),
        };
        Ok(Watch { limit, in_a_row: 0, release, bounds })
    }

    /// The rule. The root of a rounded square is what was squared, to the bit (Boldo 2015).
    pub(crate) fn rule(&self) -> Outliers<T> {
        match self {
            Watch { limit, .. } if !limit.is_finite() => Outliers::Used,
            Watch { limit, bounds: true, .. } => Outliers::Huber { threshold: limit.sqrt() },
            &Watch { limit: nis, release, .. } => Outliers::Gate { nis, release },
        }
    }

    /// An outlier came. What counts of its square doubles with each in a row.
    #[cold]
    #[inline(never)]
    pub(crate) fn evaluate(&mut self, nis: T) -> Outlier<T> {
        let (used, action) = match self.bounds {
            true => (self.part(nis), Action::Bounded),
            false if self.release > 0 && self.in_a_row >= self.release => (T::one(), Action::Released),
            false => (T::zero(), Action::Gated),
        };
        let counted = self.limit / nis * T::from_count(1 << self.in_a_row.min(30));
        self.in_a_row = self.in_a_row.saturating_add(1);
        Outlier {
            noise: if used.is_zero() { T::LARGEST_ENTRY } else { T::one() / used },
            used,
            counted: if counted < T::one() { counted } else { T::one() },
            action,
        }
    }

    /// The part of its innovation that Huber's rule uses of an outlier.
    fn part(&self, nis: T) -> T {
        (self.limit / nis).sqrt()
    }

    /// The part that was not used of the outlier that came last, if none came right before it.
    #[inline(always)]
    pub(crate) fn unused(&self, nis: T, action: Action) -> Option<T> {
        if self.in_a_row == 1 { self.unused_of_first(nis, action) } else { None }
    }

    #[cold]
    #[inline(never)]
    fn unused_of_first(&self, nis: T, action: Action) -> Option<T> {
        let rests = matches!(action, Action::Frozen | Action::Skipped);
        let used = if self.bounds { self.part(nis) } else { T::zero() };
        (nis > self.limit && !rests).then(|| T::one() - used)
    }
}

#[cfg(test)]
mod tests;
