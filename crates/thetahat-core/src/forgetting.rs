//! How fast a recursive estimator forgets, and how it starts.

use crate::{Error, Real};

/// How a recursive estimator forgets old samples.
///
/// | policy | what it is for | bounded |
/// |---|---|---|
/// | [`None`](Forgetting::None) | parameters that do not change; a finite record | P never grows, and shrinks for ever: a finite horizon in `f32` |
/// | [`Exponential`](Forgetting::Exponential) | the default: parameters that drift, or jump | by the cap |
/// | [`Directional`](Forgetting::Directional) | poor or intermittent excitation: only what a sample tells of is forgotten | by construction, and by the cap |
/// | [`RandomWalk`](Forgetting::RandomWalk) | parameters that drift at a known rate, each by its own scale | by the cap |
/// | [`Variable`](Forgetting::Variable) | long quiet times, then sudden changes, and a known noise level | by the cap |
///
/// The dead zone ([`with_dead_zone`](crate::RecursiveLeastSquares::with_dead_zone)) goes with any of them.
///
/// # One meaning of the factor
///
/// λ, the `factor`, makes the memory 1/(1 - λ) samples in every policy that has one. It lies in n/(n + 1) … 1,
/// n the number of parameters: with a memory of n samples or fewer, n parameters cannot be told from noise.
/// For a memory of 100 samples take 0.99, which is the default.
///
/// # The cap
///
/// Where nothing is learnt of a parameter, forgetting makes its variance grow, exponentially or linearly, until
/// nothing is left of the estimate but noise (wind-up). So after each sample one variance, in turn, is compared
/// with its bound
///
/// ```text
/// P_jj <= p_j = 100 / scale_j²
/// ```
///
/// and where it is above, it is brought back to p_j by a pseudo-measurement θ_j + v = θ̂_j, var v =
/// P_jj p_j/(P_jj - p_j). The innovation of that is 0: the estimate stays where it is, and P stays a covariance,
/// which it would not if its diagonal were clipped. [`Action::Capped`](crate::Action::Capped) tells. In between a
/// variance can grow for n samples, by a factor of at most (1 + 1/n)^n < e. The bound stands at the prior: a
/// parameter that has been forgotten is as free to move as at the start.
///
/// # What is forgotten when
///
/// Forgetting counts the samples that were measured. A missing one, and one that is skipped or comes while
/// adaptation is off, makes nothing older. The exception is the random walk, which is a model of time: with it
/// the variances grow in missing samples too. (But not in those that the dead zone skips, while adaptation is off,
/// or before the start is over.)
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Forgetting<T> {
    /// Nothing is forgotten: all samples weigh the same.
    ///
    /// P shrinks as 1/k. In `f32` that works for a finite time only: rounding is not forgotten either. With four
    /// parameters it exceeds one standard error after 9·10^7 samples (measured by `make soak`).
    None,
    /// A sample k samples old weighs λ^k (Ljung and Söderström, Theory and Practice of Recursive Identification,
    /// 1983, section 2.6).
    ///
    /// ```text
    /// θ̂ = arg min Σ λ^(t-k) (y(k) - φ(k)'θ)²,          P <- (P - P φ φ'P / (λ + φ'P φ)) / λ
    /// ```
    Exponential {
        /// λ.
        factor: T,
    },
    /// Forgets only along the regressor: what a sample does not tell of is kept.
    ///
    /// ```text
    /// P <- P + (1 - μ)/(μ w'P⁻¹w) w w',   w = φ/scale²,   μ = 1 - n (1 - λ),          where |φ/scale|² >= 1/100
    /// ```
    ///
    /// and then the update without forgetting. μ, not λ, is the factor of the source. As each sample forgets in
    /// one of n directions, its memory is n/(1 - μ) samples, which is 1/(1 - λ): so that one factor means one
    /// memory in all policies. A regressor below the threshold is used, and nothing is forgotten for it: else
    /// noise would take the place of what is known.
    ///
    /// Three to four times the time of exponential forgetting (measured).
    ///
    /// Source: Cao and Schwartz, A directional forgetting algorithm based on the decomposition of the
    /// information matrix, 2000; Lai and Bernstein, arXiv:2404.10844, 2024.
    Directional {
        /// λ.
        factor: T,
    },
    /// The parameters do a random walk: the estimator is a Kalman filter with F = I, R = 1.
    ///
    /// ```text
    /// P_jj <- P_jj + variance / scale_j²          each sample
    /// ```
    ///
    /// In the unit of the noise variance, as P is. Each sample, one parameter in turn gets the growth of n
    /// samples: that is the same on average, and costs n² multiply-adds where all at once cost n³. Two to three
    /// times the time of exponential forgetting (measured).
    ///
    /// Source: Ljung and Söderström 1983, section 2.6.
    RandomWalk {
        /// How much the variance of a parameter grows each sample, in 1/scale² times the noise variance:
        /// 0 … 100.
        variance: T,
    },
    /// Forgets where an innovation is large: a small one is no reason to.
    ///
    /// ```text
    /// λ(k) = 1 - (1 - λ) e²/(σ² (1 + φ'P φ)),          at least the minimum
    /// ```
    ///
    /// As long as the innovations are as large as the noise, the memory is 1/(1 - λ) on average. (In the source,
    /// Σ0 = σ²/(1 - λ).) With several outputs e² is their mean.
    ///
    /// Source: Fortescue, Kershenbaum and Ydstie, Implementation of self-tuning regulators with variable
    /// forgetting factors, 1981.
    Variable {
        /// λ, the factor where e² is as large as the noise makes it.
        factor: T,
        /// The least factor, at most λ.
        minimum: T,
        /// σ², the variance of the noise, in the unit of y²; above 0.
        noise_variance: T,
    },
}

impl<T: Real> Default for Forgetting<T> {
    /// Exponential, a memory of 100 samples: λ = 0.99.
    fn default() -> Self {
        Forgetting::Exponential { factor: T::one() - T::one() / T::from_count(100) }
    }
}

impl<T: Real> Forgetting<T> {
    /// That every number is in its range, for `size` parameters.
    pub(crate) fn check(&self, size: usize) -> Result<(), Error> {
        let n = T::from_count(size);
        // A little less than n/(n + 1), so that a factor that was computed as n/(n + 1) passes.
        let least = n / (n + T::one()) - T::from_count(4) * T::EPSILON;
        let is_factor = |factor: T| factor > least && factor > T::zero() && factor <= T::one();
        match *self {
            Forgetting::None => Ok(()),
            Forgetting::Exponential { factor } | Forgetting::Directional { factor } => {
                check_factor(is_factor(factor))
            }
            Forgetting::RandomWalk { variance } => {
                let fits = variance >= T::zero() && variance <= T::from_count(100);
                fits.then_some(()).ok_or(Error::OutOfRange { argument: "variance", range: "0 to 100" })
            }
            Forgetting::Variable { factor, minimum, noise_variance } => {
                check_factor(is_factor(factor))?;
                if !(is_factor(minimum) && minimum <= factor) {
                    let range = "n/(n + 1) to the factor, for n parameters";
                    return Err(Error::OutOfRange { argument: "minimum", range });
                }
                let fits = noise_variance >= T::MIN_POSITIVE && noise_variance.is_finite();
                fits.then_some(())
                    .ok_or(Error::OutOfRange { argument: "noise_variance", range: "finite and above 0" })
            }
        }
    }

    /// The factor by which the weights of the residuals shrink, if the innovation does not decide.
    pub(crate) fn factor(&self) -> T {
        match *self {
            Forgetting::None | Forgetting::RandomWalk { .. } => T::one(),
            Forgetting::Exponential { factor }
            | Forgetting::Directional { factor }
            | Forgetting::Variable { factor, .. } => factor,
        }
    }
}

fn check_factor(fits: bool) -> Result<(), Error> {
    let range = "n/(n + 1) to 1, for n parameters: the memory, 1/(1 - factor), must be longer than n samples";
    fits.then_some(()).ok_or(Error::OutOfRange { argument: "factor", range })
}

/// How a recursive estimator starts.
///
/// The prior says θ = 0, with the variances p_j = 100/scale_j² (in the unit of the noise variance). It weighs as
/// much as a hundredth of one sample of typical size; and the three starts differ in what becomes of it.
///
/// They cost no memory. The exact estimate needs no collected rows: it is the standard one less the prior, and
/// taking a measurement back out of a factored covariance makes a variance grow, which is safe. Until the data
/// weigh more than the prior in every direction, nothing is forgotten. Then the prior is taken out, in 3 n³
/// multiply-adds, and what is left is the least squares solution of all samples so far. From there on the
/// [`Forgetting`] policy rules.
///
/// # How long it takes
///
/// The condition is
///
/// ```text
/// Σ P_jj/p_j <= 1/2
/// ```
///
/// and that takes more than full rank: some 2·κ²/100 samples, where κ is the condition number of the regressors in
/// units of their scales. (Measured, with three regressors that differ by a tenth of their size: 23 samples; by a
/// hundredth: 1660.) It must be so where a policy forgets: an estimate less sure than p_j would be held where it is
/// by the cap. The exact start without forgetting has no such reason. There the prior is 10⁴ times as wide while
/// regressors are collected, so that the start is over once their κ is below some 1000, mostly at the n-th sample;
/// [`excitation`](crate::RecursiveLeastSquares::excitation) tells how much that first estimate is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Start {
    /// With the prior, which stays in. With forgetting it fades.
    Standard,
    /// Without a prior: regressors are collected until they weigh enough in every direction, and
    /// [`Action::Collecting`](crate::Action::Collecting) says that there is no estimate yet. Then start from the
    /// least squares solution.
    Exact,
    /// Standard until the regressors weigh enough in every direction, then on to the exact estimate.
    Mixed {
        /// In how many samples the prior is taken out, a share in each. With 0, at once.
        blend: u16,
    },
}

/// Where a start stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) enum Phase {
    /// The start is over, or a prior is in again: the forgetting policy rules.
    Running,
    /// Not of full rank yet.
    Waiting { collecting: bool, blend: u16 },
    /// The prior is being taken out; `left` of `total` shares of it are still in.
    Blending { left: u16, total: u16 },
    /// As `Running`, and no prior is in the estimate.
    Free,
}

impl Phase {
    /// Whether the forgetting policy rules.
    #[inline(always)]
    pub(crate) fn is_running(self) -> bool {
        matches!(self, Phase::Running | Phase::Free)
    }
}

impl From<Start> for Phase {
    fn from(start: Start) -> Self {
        match start {
            Start::Standard => Phase::Running,
            Start::Exact => Phase::Waiting { collecting: true, blend: 0 },
            Start::Mixed { blend } => Phase::Waiting { collecting: false, blend },
        }
    }
}
