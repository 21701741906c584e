//! How fast a recursive estimator forgets, and how it starts.
//!
//! Another policy is a variant of [`Forgetting`], an entry of [`TABLE`], and an arm in each match of this file: what
//! does not know of it does not compile. The estimators, the command line, documents and Python take all from here.

use crate::error::check_length;
use crate::{Error, Real};

/// How a recursive estimator forgets old samples.
///
/// | policy | what it is for | bounded |
/// |---|---|---|
/// | [`None`](Forgetting::None) | parameters that do not change; a finite record | P never grows, and shrinks for ever: a finite horizon in `f32` |
/// | [`Exponential`](Forgetting::Exponential) | the default: parameters that drift, or jump, under steady excitation | by the bound |
/// | [`Selective`](Forgetting::Selective) | excitation that comes and goes: in silence nothing is forgotten | by the bound |
/// | [`RandomWalk`](Forgetting::RandomWalk) | parameters that drift at a known rate, each by its own scale | by the bound |
/// | [`Variable`](Forgetting::Variable) | long quiet times, then sudden changes, and a known noise level | by the bound |
///
/// The dead zone ([`with_dead_zone`](crate::RecursiveLeastSquares::with_dead_zone)) goes with any of them.
///
/// # One meaning of the factor
///
/// λ, the `factor`, makes the memory 1/(1 - λ) samples in every policy that has one. It lies in n/(n + 1) … 1,
/// n the number of parameters: with a memory of n samples or fewer, n parameters cannot be told from noise.
/// For a memory of 100 samples take 0.99, which is the default.
///
/// # The bound
///
/// Where nothing is learnt of a direction of the parameters, forgetting makes its variance grow, exponentially or
/// linearly, until nothing is left of the estimate but noise (wind-up). So it ends at a bound,
///
/// ```text
/// p_j = 100 / scale_j²
/// ```
///
/// P is a sum over the columns of U, P_ii = Σ_j D_j U_ij². After each sample one P_ii, in turn, is compared with its
/// bound; once it is above, the columns that make p_i/n or more of it are held, and nothing is forgotten in their
/// directions until samples have told enough of them, D_j U_ij² < p_i/(2 n) for all i. The others go on. (The random
/// walk holds a parameter while P_jj > p_j.) [`Action::Capped`](crate::Action::Capped) tells. In between a variance can
/// grow for n samples, by a factor of at most (1 + 1/n)^n < e. The bound stands at the prior: a parameter that has been
/// forgotten is as free to move as at the start.
///
/// Nothing but samples makes P smaller. So σ²P is at least the covariance of the errors, however long an input is held:
/// where a direction is not excited, its standard errors grow to their bound, and stay. Where two inputs cannot be told
/// apart, they say so. (A pseudo-measurement θ_j + v = θ̂_j of each parameter, the usual way to keep P bounded, tells P
/// what nobody measured: with λ = 0.9 and an input that was held for 10^5 samples a parameter was 40 of its standard
/// errors from the truth, in a control loop 400.)
///
/// # What each is good at
///
/// The distance of four parameters from the truth, the mean of 200 runs: 500 samples after a jump of norm 1.80, with
/// regressors of variance 1 and correlation 0, 0.95 and 0.99 (noise 0.02); the same after a jump of 0.69 of an ARX
/// plant whose input is random binary; then the largest distance in 5000 samples (noise 0.1) in which all regressors,
/// or two of the four, fall to 0.01, or are held but for 0.01. Last, the share of 95 % intervals that hold the truth in
/// the steady state, of regressors with correlation 0.95, and of a plant in closed loop whose set point changes every
/// 200 samples.
///
/// | policy | 0 | 0.95 | 0.99 | plant | silence | two silent | two silent, 0.95 before | held | open loop | closed loop |
/// |---|---|---|---|---|---|---|---|---|---|---|
/// | none | 1.20 | 1.20 | 1.21 | 0.45 | 0.006 | 0.007 | 0.027 | 0.007 | 0.95 | 0.96 |
/// | exponential, 0.99 | 0.013 | 0.016 | 0.026 | 0.005 | 2.23 | 1.86 | 1.27 | 2.42 | 0.95 | 0.97 |
/// | selective, 0.99 | 0.019 | 0.021 | 0.029 | 0.006 | 0.013 | 0.026 | 0.10 | 1.88 | 0.95 | 0.96 |
/// | random walk, 1e-4 | 0.014 | 0.59 | 0.99 | 0.019 | 0.045 | 0.038 | 0.045 | 0.041 | 0.95 | 0.95 |
/// | variable, 0.99 | 0.003 | 0.010 | 0.023 | 0.003 | 2.21 | 1.86 | 1.28 | 2.40 | 0.95 | 0.97 |
///
/// (Printed by `cargo test -p thetahat-core --test forgetting table -- --nocapture`.) The intervals of the random walk
/// are for parameters that walk as it says. Directly after a jump no interval holds the truth, whatever the policy.
/// Where the regressors tell too little of a parameter, in closed loop without changes of the set point for instance,
/// intervals are wider than need be: up to all of them hold the truth.
///
/// # What is forgotten when
///
/// Forgetting counts the samples that were measured. A missing one, and one that is skipped or comes while
/// adaptation is off, makes nothing older. The exception is the random walk, which is a model of time: with it
/// the variances grow in missing samples too. (But not in those that the dead zone skips, while adaptation is off,
/// or before the start is over.)
///
/// ```
/// use thetahat_core::nalgebra::{Const, Vector1};
/// use thetahat_core::{Error, Forgetting, RecursiveLeastSquares};
///
/// // A gain that jumps: who forgets follows, who does not takes the mean.
/// let found = |forgetting| -> Result<f64, Error> {
///     let mut gain: RecursiveLeastSquares<f64, Const<1>> =
///         RecursiveLeastSquares::new(&Vector1::new(1.0), forgetting)?;
///     for k in 0..200 {
///         gain.update(&Vector1::new(1.0), if k < 100 { 1.0 } else { 3.0 })?;
///     }
///     Ok(gain.parameters()[0])
/// };
/// assert!((found(Forgetting::Exponential { factor: 0.9 })? - 3.0).abs() < 1e-3);
/// assert!((found(Forgetting::None)? - 2.0).abs() < 1e-3);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Forgetting<T> {
    /// Nothing is forgotten: all samples weigh the same.
    ///
    /// P shrinks as 1/k. In `f32` that works for a finite time only: rounding is not forgotten either. With four
    /// parameters it exceeds one standard error after 9·10^7 samples (measured by `make soak`).
    None,
    /// A sample k samples old weighs λ^k, whether the new ones tell anything or not (Ljung and Söderström, Theory and
    /// Practice of Recursive Identification, 1983, section 2.6).
    ///
    /// ```text
    /// θ̂ = arg min Σ λ^(t-k) (y(k) - φ(k)'θ)²,          P <- (P - P φ φ'P / (λ + φ'P φ)) / λ
    /// ```
    ///
    /// In a silence of many times the memory the variances grow to their bounds, and what noise there is in the
    /// regressors drives the estimate: it bursts to about σ √(p_j/2) from the truth, σ the deviation of the noise.
    /// The standard errors say so. Where that would do harm, turn adaptation off, or take
    /// [`Selective`](Forgetting::Selective).
    Exponential {
        /// λ.
        factor: T,
    },
    /// Forgets only what the sample tells of: what is not excited is kept.
    ///
    /// ```text
    /// f = U'φ;     D_j <- D_j / λ     where f_j² D_j > (1 - λ)/100
    /// ```
    ///
    /// and then the update without forgetting. f_j is what regressor j adds to those before it, D_j the variance of
    /// what it tells of, and f_j² D_j is 1 - λ on average while the excitation is steady. A sample that tells less than
    /// a hundredth of that is silent: forgetting would let the variance grow to 100 times what it is. So neither the
    /// units of the regressors nor their scales nor the noise matter, and correlated regressors are forgotten as fast
    /// as others. n multiply-adds and comparisons more than exponential forgetting without any.
    ///
    /// For plants with long silences. After 10^6 silent samples the error is what it was (measured: 0.02 at
    /// the most, where exponential forgetting has 2 or more). But:
    ///
    /// - Its memory is up to a tenth longer than 1/(1 - λ), as small samples are not forgotten for.
    /// - Silence is relative. Where the amplitude of steady regressors falls to less than a tenth (of normally
    ///   distributed ones, a thirtieth), that counts as silence, for ever: new samples add what they tell, and nothing
    ///   is forgotten. If that is the new operating condition, widen P by
    ///   [`with_covariance`](crate::RecursiveLeastSquares::with_covariance).
    /// - A held input is not silence: until U has turned to it, all of φ is new. That costs all but a hundredth of
    ///   what is known of other directions, and noise beside it then does the same as with exponential forgetting
    ///   (the column "held").
    /// - The order of the regressors decides of which of two that are correlated something is forgotten first. In
    ///   closed loop the standard errors differed by a tenth, elsewhere by less (measured).
    ///
    /// Source: the rule is ours. Its relative on the eigenvectors of P⁻¹ is that of Goel, Bruce and Bernstein,
    /// Recursive least squares with variable-direction forgetting, 2020.
    Selective {
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
        match *self {
            Forgetting::None => Ok(()),
            Forgetting::Exponential { factor } | Forgetting::Selective { factor } => {
                FACTOR.check(factor, least, T::one())
            }
            Forgetting::RandomWalk { variance } => VARIANCE.check(variance, least, T::one()),
            Forgetting::Variable { factor, minimum, noise_variance } => {
                FACTOR.check(factor, least, T::one())?;
                MINIMUM.check(minimum, least, factor)?;
                NOISE_VARIANCE.check(noise_variance, least, factor)
            }
        }
    }

    /// The factor by which the weights of the residuals shrink, if the innovation does not decide.
    #[inline(always)]
    pub(crate) fn factor(&self) -> T {
        match *self {
            Forgetting::None | Forgetting::RandomWalk { .. } => T::one(),
            Forgetting::Exponential { factor }
            | Forgetting::Selective { factor }
            | Forgetting::Variable { factor, .. } => factor,
        }
    }

    /// Whether anything is forgotten, so that a variance can grow.
    #[inline(always)]
    pub(crate) fn forgets(&self) -> bool {
        match self {
            Forgetting::None => false,
            Forgetting::Exponential { .. }
            | Forgetting::Selective { .. }
            | Forgetting::RandomWalk { .. }
            | Forgetting::Variable { .. } => true,
        }
    }

    /// The variance by which parameters walk, each sample, if they do.
    #[inline(always)]
    pub(crate) fn walk(&self) -> Option<T> {
        match *self {
            Forgetting::RandomWalk { variance } => Some(variance),
            Forgetting::None
            | Forgetting::Exponential { .. }
            | Forgetting::Selective { .. }
            | Forgetting::Variable { .. } => None,
        }
    }

    /// λ(k): how much older this sample makes the others, given its innovations and φ'P φ.
    #[inline(always)]
    pub(crate) fn factor_at(&self, errors: &[T], spread: T) -> T {
        match *self {
            Forgetting::None | Forgetting::RandomWalk { .. } => T::one(),
            Forgetting::Exponential { factor } | Forgetting::Selective { factor } => factor,
            Forgetting::Variable { factor, minimum, noise_variance } => {
                let nis = errors.iter().fold(T::zero(), |sum, &error| sum + error / noise_variance * error);
                let nis = nis / T::from_count(errors.len()) / (T::one() + spread);
                let factor = T::one() - (T::one() - factor) * nis;
                if factor > minimum { factor } else { minimum }
            }
        }
    }

    /// f_j² D_j up to which column j of U is not forgotten, if columns differ.
    #[inline(always)]
    pub(crate) fn silence(&self) -> Option<T> {
        match *self {
            Forgetting::Selective { factor } => Some((T::one() - factor) / T::from_count(100)),
            Forgetting::None
            | Forgetting::Exponential { .. }
            | Forgetting::RandomWalk { .. }
            | Forgetting::Variable { .. } => None,
        }
    }
}

/// The most numbers that a policy has.
const MOST_NUMBERS: usize = 3;

/// A policy with its word and its numbers, as what reads and prints policies knows it. See [`Forgetting::policies`].
///
/// ```
/// use thetahat_core::{Error, Forgetting};
///
/// let policy = Forgetting::policies().iter().find(|policy| policy.word == "exponential").expect("it is there");
/// assert_eq!(policy.with(&[0.98])?, Forgetting::Exponential { factor: 0.98 });
/// # Ok::<(), Error>(())
/// ```
#[derive(Debug)]
#[non_exhaustive]
pub struct ForgettingPolicy {
    /// The word for it, such as `random-walk`.
    pub word: &'static str,
    /// What it does, in a sentence.
    pub says: &'static str,
    /// What else is to be known of it; may be empty.
    pub notes: &'static str,
    /// Who described it; may be empty.
    pub source: &'static str,
    /// Its numbers, in their order.
    pub numbers: &'static [PolicyNumber],
    make: fn([f64; MOST_NUMBERS]) -> Forgetting<f64>,
}

/// A number of a policy.
///
/// ```
/// use thetahat_core::Forgetting;
///
/// // What asks for the numbers of a policy needs no list of its own.
/// let (policy, _) = Forgetting::default().describe();
/// let [factor] = policy.numbers else { panic!("one number") };
/// assert_eq!((factor.name, factor.range.says()), ("factor", "a number above 0 and at most 1"));
/// ```
#[derive(Debug)]
#[non_exhaustive]
pub struct PolicyNumber {
    /// Its name, such as `noise_variance`.
    pub name: &'static str,
    /// What it is.
    pub says: &'static str,
    /// Where it lies.
    pub range: PolicyRange,
    /// What it usually is, if there is such a number.
    pub usual: Option<f64>,
}

/// Where a number of a policy lies, as long as the number of parameters is not known.
///
/// ```
/// use thetahat_core::PolicyRange;
///
/// assert_eq!(PolicyRange::Growth.says(), "a number from 0 to 100");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum PolicyRange {
    /// Above 0, at most 1; for n parameters n/(n + 1) to 1.
    Factor,
    /// As a factor, and at most the first number of the policy, which is one.
    UpToFactor,
    /// 0 to 100.
    Growth,
    /// Finite and above 0.
    Positive,
}

impl PolicyRange {
    /// The range in words: "a number …".
    pub fn says(self) -> &'static str {
        match self {
            PolicyRange::Factor => "a number above 0 and at most 1",
            PolicyRange::UpToFactor => "a number above 0 and at most the factor",
            PolicyRange::Growth => "a number from 0 to 100",
            PolicyRange::Positive => "a finite number above 0",
        }
    }
}

impl PolicyNumber {
    /// That a number is in its range, given the least factor and the first number of the policy.
    #[inline(always)]
    fn check<T: Real>(&self, value: T, least: T, first: T) -> Result<(), Error> {
        let is_factor = value > least && value > T::zero() && value <= T::one();
        let (fits, range) = match self.range {
            PolicyRange::Factor => {
                let range = "n/(n + 1) to 1, for n parameters: the memory, 1/(1 - factor), must be longer than n samples";
                (is_factor, range)
            }
            PolicyRange::UpToFactor => {
                (is_factor && value <= first, "n/(n + 1) to the factor, for n parameters")
            }
            PolicyRange::Growth => (value >= T::zero() && value <= T::from_count(100), "0 to 100"),
            PolicyRange::Positive => (value >= T::MIN_POSITIVE && value.is_finite(), "finite and above 0"),
        };
        fits.then_some(()).ok_or(Error::OutOfRange { argument: self.name, range })
    }
}

const FACTOR: PolicyNumber = PolicyNumber {
    name: "factor",
    says: "Lambda: the memory is 1/(1 - lambda) samples.",
    range: PolicyRange::Factor,
    usual: None,
};

const VARIANCE: PolicyNumber = PolicyNumber {
    name: "variance",
    says: "How much the variance of a parameter grows each sample, in 1/scale^2 times the noise variance.",
    range: PolicyRange::Growth,
    usual: None,
};

const MINIMUM: PolicyNumber =
    PolicyNumber { name: "minimum", says: "The least factor.", range: PolicyRange::UpToFactor, usual: None };

const NOISE_VARIANCE: PolicyNumber = PolicyNumber {
    name: "noise_variance",
    says: "The variance of the noise, in the unit of y squared.",
    range: PolicyRange::Positive,
    usual: None,
};

/// All policies, in the order of [`Forgetting`]. Firmware does not refer to it, so that no text is linked.
static TABLE: [ForgettingPolicy; 5] = [
    ForgettingPolicy {
        word: "none",
        says: "Nothing is forgotten: all samples weigh the same.",
        notes: "",
        source: "",
        numbers: &[],
        make: |_| Forgetting::None,
    },
    ForgettingPolicy {
        word: "exponential",
        says: "A sample that is k samples old weighs factor^k.",
        notes: "In a silence of many times the memory the estimate bursts: noise in the regressors drives it away from what \
                was known, and the standard errors say so. See `selective`.",
        source: "Ljung and Söderström, Theory and Practice of Recursive Identification, 1983, section 2.6.",
        numbers: &[PolicyNumber { usual: Some(0.99), ..FACTOR }],
        make: |[factor, ..]| Forgetting::Exponential { factor },
    },
    ForgettingPolicy {
        word: "selective",
        says: "Forgets only what a sample tells of: what is not excited is kept. For plants with long silences.",
        notes: "An excitation that falls below a tenth of what it was counts as silence.",
        source: "A relative: Goel, Bruce and Bernstein, Recursive least squares with variable-direction forgetting, 2020.",
        numbers: &[FACTOR],
        make: |[factor, ..]| Forgetting::Selective { factor },
    },
    ForgettingPolicy {
        word: "random-walk",
        says: "The parameters do a random walk.",
        notes: "",
        source: "Ljung and Söderström, Theory and Practice of Recursive Identification, 1983, section 2.6.",
        numbers: &[VARIANCE],
        make: |[variance, ..]| Forgetting::RandomWalk { variance },
    },
    ForgettingPolicy {
        word: "variable",
        says: "Forgets where an innovation is larger than the noise makes it.",
        notes: "",
        source: "Fortescue, Kershenbaum and Ydstie, Implementation of self-tuning regulators with variable forgetting \
                 factors, 1981.",
        numbers: &[
            PolicyNumber {
                says: "The factor where the innovation is as large as the noise makes it.",
                ..FACTOR
            },
            MINIMUM,
            NOISE_VARIANCE,
        ],
        make: |[factor, minimum, noise_variance]| Forgetting::Variable { factor, minimum, noise_variance },
    },
];

impl Forgetting<f64> {
    /// All policies with their words, names and ranges: what a program needs that reads or prints them.
    ///
    /// ```
    /// use thetahat_core::{Error, Forgetting};
    ///
    /// let mut policies = Forgetting::policies().iter();
    /// let policy = policies.find(|policy| policy.word == "random-walk").unwrap();
    /// assert_eq!(policy.numbers[0].name, "variance");
    /// assert_eq!(policy.with(&[1e-6]), Ok(Forgetting::RandomWalk { variance: 1e-6 }));
    /// assert!(matches!(policy.with(&[101.0]), Err(Error::OutOfRange { argument: "variance", .. })));
    /// ```
    pub fn policies() -> &'static [ForgettingPolicy] {
        &TABLE
    }

    /// Which policy it is, and its numbers.
    ///
    /// ```
    /// let (policy, mut numbers) = thetahat_core::Forgetting::default().describe();
    /// assert_eq!(policy.word, "exponential");
    /// assert!(numbers.next().is_some_and(|(number, value)| number.name == "factor" && value == 0.99));
    /// ```
    pub fn describe(
        self,
    ) -> (&'static ForgettingPolicy, impl Iterator<Item = (&'static PolicyNumber, f64)> + Clone) {
        let (policy, values) = match self {
            Forgetting::None => (&TABLE[0], [0.0; MOST_NUMBERS]),
            Forgetting::Exponential { factor } => (&TABLE[1], [factor, 0.0, 0.0]),
            Forgetting::Selective { factor } => (&TABLE[2], [factor, 0.0, 0.0]),
            Forgetting::RandomWalk { variance } => (&TABLE[3], [variance, 0.0, 0.0]),
            Forgetting::Variable { factor, minimum, noise_variance } => {
                (&TABLE[4], [factor, minimum, noise_variance])
            }
        };
        (policy, policy.numbers.iter().zip(values))
    }
}

impl ForgettingPolicy {
    /// The first of these numbers that is out of its range.
    pub fn refused(&self, numbers: &[f64]) -> Option<(&'static PolicyNumber, f64)> {
        let first = numbers.first().copied().unwrap_or(0.0);
        let mut pairs = self.numbers.iter().zip(numbers.iter().copied());
        pairs.find(|(number, value)| number.check(*value, 0.0, first).is_err())
    }

    /// The policy with these numbers, each in its range. That a factor is above n/(n + 1) is checked when an estimator
    /// with n parameters is made.
    ///
    /// Errors: [`Error::Length`] for another number of them, [`Error::OutOfRange`] with the name of one.
    pub fn with(&self, numbers: &[f64]) -> Result<Forgetting<f64>, Error> {
        check_length("numbers", self.numbers.len(), numbers.len())?;
        if let Some((number, value)) = self.refused(numbers) {
            number.check(value, 0.0, numbers.first().copied().unwrap_or(value))?;
        }
        let mut values = [0.0; MOST_NUMBERS];
        values.iter_mut().zip(numbers).for_each(|(value, &number)| *value = number);
        Ok((self.make)(values))
    }
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
/// hundredth: 1660.) It must be so where a policy forgets: what is less sure than p_j counts as not
/// known. The exact start without forgetting has no such reason. There the prior is 10⁴ times as wide while
/// regressors are collected, so that the start is over once their κ is below some 1000, mostly at the n-th sample;
/// [`excitation`](crate::RecursiveLeastSquares::excitation) tells how much that first estimate is worth.
///
/// ```
/// use thetahat_core::nalgebra::{Const, Vector1};
/// use thetahat_core::{Error, Forgetting, RecursiveLeastSquares, RlsStart};
///
/// // One sample of a gain of 2: the prior weighs as much as a hundredth of it, or not at all.
/// let after_one = |start| -> Result<f64, Error> {
///     let gain = RecursiveLeastSquares::<f64, Const<1>>::new(&Vector1::new(1.0), Forgetting::None)?;
///     let mut gain = gain.with_start(start)?;
///     gain.update(&Vector1::new(1.0), 2.0)?;
///     Ok(gain.parameters()[0])
/// };
/// assert!((after_one(RlsStart::Standard)? - 2.0 * 100.0 / 101.0).abs() < 1e-12);
/// assert!((after_one(RlsStart::Exact)? - 2.0).abs() < 1e-12);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum RlsStart {
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
    /// The start is over, or a variance is at its bound, as at a prior: the forgetting policy rules.
    Running,
    /// As `Running`, from parameters or a P that were given.
    Given,
    /// Not of full rank yet: there is no estimate.
    Collecting,
    /// Not of full rank yet: the estimate is that with the prior.
    Waiting,
    /// The prior is being taken out, share by share.
    Blending,
    /// As `Running`, and no prior is in the estimate.
    Free,
}

impl Phase {
    /// Whether the forgetting policy rules.
    #[inline(always)]
    pub(crate) fn is_running(self) -> bool {
        matches!(self, Phase::Running | Phase::Given | Phase::Free)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_policy_is_what_its_entry_makes() -> Result<(), Error> {
        for policy in Forgetting::policies() {
            let numbers = [0.75, 0.5, 0.25];
            let made = policy.with(&numbers[..policy.numbers.len()])?;
            let (described, values) = made.describe();
            assert!(core::ptr::eq(policy, described), "{}", policy.word);
            assert!(values.map(|(_, value)| value).eq(numbers[..policy.numbers.len()].iter().copied()));
            let named = |word: &str| Forgetting::policies().iter().filter(|other| other.word == word).count();
            assert_eq!(named(policy.word), 1);
            let refused = |numbers: &[f64]| matches!(policy.with(numbers), Err(Error::Length { .. }));
            assert!(refused(&[0.5; 4]) && (policy.numbers.is_empty() || refused(&[])));
        }
        Ok(())
    }
}
