//! How an estimator of parameters learns: forgetting, start, dead zone, outliers.

use thetahat_core::RlsStart;
use thetahat_core::nalgebra::Const;

use crate::shapes::write;
use crate::{Error, Number, memory};

/// How old samples are forgotten.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Forgetting {
    /// Nothing is forgotten: all samples weigh the same. In single precision for a finite time only.
    None = 0,
    /// A sample k samples old weighs factor^k: the memory is 1/(1 - factor) samples.
    Exponential = 1,
    /// Forgets, by the factor, only what the sample tells of: what is not excited is kept. For long silences.
    Selective = 2,
    /// The parameters do a random walk: variances grow by variance/scale^2 a sample.
    RandomWalk = 3,
    /// Forgets where an innovation is large: factor, minimum and noise_variance are needed.
    Variable = 4,
}

/// What becomes of samples whose innovations are far larger than the noise makes them.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outliers {
    /// They correct as any other.
    Used = 0,
    /// They correct as one of `threshold` standard deviations does: 3 loses nothing where there are none.
    Huber = 1,
    /// Above a normalised innovation squared of `threshold`, such as 25, they correct nothing; after `release` of them
    /// in a row the next ones do.
    Gate = 2,
}

/// How an estimator starts.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// From a prior: P_jj = 100/scale_j^2.
    Standard = 0,
    /// Regressors are collected until they have full rank; the estimate is then the batch solution, without prior.
    Exact = 1,
    /// From a prior, which is taken out over `blend` samples once the regressors have full rank.
    Mixed = 2,
}

/// How an estimator of parameters learns. What is 0 and not needed by its policy is not read. NULL in its place is
/// exponential forgetting with the factor 0.99 and the standard start.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct Learning {
    /// A `thetahat_forgetting`.
    pub forgetting: i32,
    /// Lambda, n/(n + 1) ... 1 for n parameters: for exponential, selective and variable forgetting.
    pub factor: Number,
    /// The least factor, at most the factor: for variable forgetting.
    pub minimum: Number,
    /// The growth a sample, 0 ... 100: for the random walk.
    pub variance: Number,
    /// The variance of the noise, in the unit of y squared: for variable forgetting.
    pub noise_variance: Number,
    /// A `thetahat_start`. A recursive ARMAX estimator has the standard one only.
    pub start: i32,
    /// In how many samples the prior is taken out, 0 ... 65535: for the mixed start.
    pub blend: u32,
    /// Innovations up to this, in the unit of y, correct nothing. 0 for none.
    pub dead_zone: Number,
    /// A `thetahat_outliers`.
    pub outliers: i32,
    /// From 1 on: in standard deviations for Huber's rule, a normalised innovation squared for the gate.
    pub threshold: Number,
    /// After how many outliers in a row the gate lets go, 0 ... 65535; 0 for never.
    pub release: u32,
}

impl Learning {
    pub(crate) const DEFAULT: Learning = Learning {
        forgetting: Forgetting::Exponential as i32,
        factor: 0.99,
        minimum: 0.0,
        variance: 0.0,
        noise_variance: 0.0,
        start: Start::Standard as i32,
        blend: 0,
        dead_zone: 0.0,
        outliers: Outliers::Used as i32,
        threshold: 0.0,
        release: 0,
    };

    /// What is given, or the default.
    ///
    /// # Safety
    ///
    /// The pointer is null or valid.
    pub(crate) unsafe fn given(learning: *const Learning) -> Result<Learning, Error> {
        if learning.is_null() { Ok(Learning::DEFAULT) } else { Ok(*memory::follow(learning)?) }
    }

    /// The policy, with its numbers.
    pub(crate) fn policy(&self) -> Result<thetahat_core::Forgetting<Number>, Error> {
        use thetahat_core::Forgetting as Core;
        let &Learning { factor, minimum, variance, noise_variance, .. } = self;
        match self.forgetting {
            policy if policy == Forgetting::None as i32 => Ok(Core::None),
            policy if policy == Forgetting::Exponential as i32 => Ok(Core::Exponential { factor }),
            policy if policy == Forgetting::Selective as i32 => Ok(Core::Selective { factor }),
            policy if policy == Forgetting::RandomWalk as i32 => Ok(Core::RandomWalk { variance }),
            policy if policy == Forgetting::Variable as i32 => {
                Ok(Core::Variable { factor, minimum, noise_variance })
            }
            _ => Err(Error::OutOfRange),
        }
    }

    /// The rule for outliers, with its numbers.
    pub(crate) fn outliers(&self) -> Result<thetahat_core::Outliers<Number>, Error> {
        use thetahat_core::Outliers as Core;
        let &Learning { threshold, .. } = self;
        match self.outliers {
            rule if rule == Outliers::Used as i32 => Ok(Core::Used),
            rule if rule == Outliers::Huber as i32 => Ok(Core::Huber { threshold }),
            rule if rule == Outliers::Gate as i32 => {
                let release = u16::try_from(self.release).map_err(|_| Error::OutOfRange)?;
                Ok(Core::Gate { nis: threshold, release })
            }
            _ => Err(Error::OutOfRange),
        }
    }

    /// The start, or `None` for the standard one.
    pub(crate) fn start(&self) -> Result<Option<RlsStart>, Error> {
        match self.start {
            start if start == Start::Standard as i32 => Ok(None),
            start if start == Start::Exact as i32 => Ok(Some(RlsStart::Exact)),
            start if start == Start::Mixed as i32 => {
                let blend = u16::try_from(self.blend).map_err(|_| Error::OutOfRange)?;
                Ok(Some(RlsStart::Mixed { blend }))
            }
            _ => Err(Error::OutOfRange),
        }
    }
}

/// What an estimator of any size knows.
pub(crate) trait Estimate {
    fn parameters(&self) -> &[Number];
    /// The variance of the noise; NaN if it is not known yet.
    fn noise_variance(&self) -> Number;
    /// Standard errors; NaN if they are not known yet.
    fn write_standard_errors(&self, target: &mut [Number]);
    fn write_covariance(&self, target: &mut [Number]) -> Result<(), Error>;
}

impl<const N: usize> Estimate for thetahat_core::RecursiveLeastSquares<Number, Const<N>> {
    fn parameters(&self) -> &[Number] {
        self.parameters().as_slice()
    }

    fn noise_variance(&self) -> Number {
        self.noise_variance().unwrap_or(Number::NAN)
    }

    fn write_standard_errors(&self, target: &mut [Number]) {
        if self.write_standard_errors(target).is_err() {
            target.fill(Number::NAN);
        }
    }

    fn write_covariance(&self, target: &mut [Number]) -> Result<(), Error> {
        Ok(self.covariance().write_into(target)?)
    }
}

/// Writes what is asked for into arrays of C.
///
/// # Safety
///
/// Each pointer is null, or valid for as many numbers as there are parameters, or one.
pub(crate) unsafe fn write_estimate(
    estimate: &dyn Estimate,
    parameters: *mut Number,
    standard_errors: *mut Number,
    noise_variance: *mut Number,
) -> Result<(), Error> {
    let count = |array: *mut Number, count| if array.is_null() { 0 } else { count };
    let found = estimate.parameters();
    let parameters = memory::array_mut(parameters, count(parameters, found.len()))?;
    let standard_errors = memory::array_mut(standard_errors, count(standard_errors, found.len()))?;
    let noise_variance = memory::array_mut(noise_variance, count(noise_variance, 1))?;
    write(found, parameters);
    write(&[estimate.noise_variance()], noise_variance);
    if !standard_errors.is_empty() {
        estimate.write_standard_errors(standard_errors);
    }
    Ok(())
}

/// Writes P into an array of C.
///
/// # Safety
///
/// The pointer is null, or valid for the square of the number of parameters.
pub(crate) unsafe fn write_covariance(estimate: &dyn Estimate, covariance: *mut Number) -> Result<(), Error> {
    let n = estimate.parameters().len();
    estimate.write_covariance(memory::array_mut(covariance, n * n)?)
}
