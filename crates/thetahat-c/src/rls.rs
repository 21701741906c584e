//! Recursive least squares.

use thetahat_core::RecursiveLeastSquares;
use thetahat_core::nalgebra::{Const, SVector};

use crate::error::code;
use crate::innovation::Innovation;
use crate::learning::{self, Estimate, Learning};
use crate::memory::{self, Kind, Made, Place, View, Word};
use crate::shapes::{covariance, vector};
use crate::{Error, Number};

/// Recursive least squares: y(k) = phi(k)' theta + e(k), with a regressor and an output in each sample.
pub struct Rls {
    _opaque: [u8; 0],
}

/// The number of parameters of a `thetahat_rls`: `thetahat_rls_4` for 4.
pub struct RlsSize {
    parameters: usize,
    init: fn(Place<Rls>, &[Number], &Learning) -> Made<Rls>,
    view: View<dyn Recursion>,
}

impl RlsSize {
    pub(crate) const fn new<const N: usize>() -> Self {
        RlsSize { parameters: N, init: init::<N>, view: |body| body.cast::<Estimator<N>>() }
    }
}

impl Kind for Rls {
    const TAG: u32 = 0x534c_5254;
    type Size = RlsSize;
    type Body = dyn Recursion;

    fn view(size: &RlsSize) -> View<dyn Recursion> {
        size.view
    }
}

type Estimator<const N: usize> = RecursiveLeastSquares<Number, Const<N>>;

/// What an estimator of any size does. Slices have as many elements as it has parameters.
pub(crate) trait Recursion {
    fn update(&mut self, regressor: &[Number], output: Number) -> Result<Innovation, Error>;
    fn predict(&self, regressor: &[Number]) -> Result<Number, Error>;
    fn set_parameters(&mut self, parameters: &[Number]) -> Result<(), Error>;
    fn set_covariance(&mut self, variance: &[Number]) -> Result<(), Error>;
    fn widen(&mut self, factor: Number) -> Result<(), Error>;
    fn set_adaptation(&mut self, on: bool);
    fn estimate(&self) -> &dyn Estimate;
}

impl<const N: usize> Recursion for Estimator<N> {
    fn update(&mut self, regressor: &[Number], output: Number) -> Result<Innovation, Error> {
        Ok(self.update(&vector(regressor), output)?.into())
    }

    fn predict(&self, regressor: &[Number]) -> Result<Number, Error> {
        Ok(self.predict(&vector(regressor))?)
    }

    fn set_parameters(&mut self, parameters: &[Number]) -> Result<(), Error> {
        Ok(self.set_parameters(vector(parameters))?)
    }

    fn set_covariance(&mut self, variance: &[Number]) -> Result<(), Error> {
        Ok(self.set_covariance(covariance(Some(variance))?)?)
    }

    fn widen(&mut self, factor: Number) -> Result<(), Error> {
        Ok(self.widen(factor)?)
    }

    fn set_adaptation(&mut self, on: bool) {
        self.set_adaptation(on);
    }

    fn estimate(&self) -> &dyn Estimate {
        self
    }
}

fn init<const N: usize>(place: Place<Rls>, scales: &[Number], learning: &Learning) -> Made<Rls> {
    let scales: SVector<Number, N> = vector(scales);
    let mut estimator = Estimator::new(&scales, learning.policy()?)?
        .with_dead_zone(learning.dead_zone)?
        .with_outliers(learning.outliers()?)?;
    if let Some(start) = learning.start()? {
        estimator = estimator.with_start(start)?;
    }
    place.write(estimator)
}

/// Makes an estimator that knows nothing yet: theta = 0.
///
/// - rls: where its handle goes. It points into the memory.
/// - memory, bytes: at least `THETAHAT_RLS_WORDS(n)` words, and their size in bytes.
/// - size: `&thetahat_rls_n` for n parameters.
/// - scales: n typical magnitudes of the regressors. They set the prior, P_jj = 100/scale_j^2.
/// - learning: how old samples are forgotten and how it starts; NULL for the default.
///
/// Errors: MEMORY_TOO_SMALL; NOT_FINITE; OUT_OF_RANGE if a scale is not above 0, or far from 1, or a number of the
/// policy is out of its range.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_rls_init(
    rls: *mut *mut Rls,
    memory: *mut Word,
    bytes: usize,
    size: *const RlsSize,
    scales: *const Number,
    learning: *const Learning,
) -> Error {
    code(|| {
        let handle = memory::follow(rls)?.cast_mut();
        let place = Place::<Rls>::new(memory, bytes, size)?;
        let size = place.size();
        let scales = memory::array(scales, size.parameters)?;
        let learning = Learning::given(learning)?;
        *handle = (size.init)(place, scales, &learning)?;
        Ok(())
    })
}

/// One sample: corrects the estimate by phi and y = phi' theta + e. NaN in either is a missing sample.
///
/// - regressor: phi, n numbers.
/// - output: y.
/// - innovation: what the sample told; may be NULL.
///
/// Errors: INFINITE; TOO_LARGE for numbers whose products could overflow. 1.5 n^2 + 7 n multiply-adds.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_rls_update(
    rls: *mut Rls,
    regressor: *const Number,
    output: Number,
    innovation: *mut Innovation,
) -> Error {
    code(|| {
        let estimator = memory::open(rls)?;
        let regressor = memory::array(regressor, estimator.estimate().parameters().len())?;
        let told = estimator.update(regressor, output)?;
        memory::answer(innovation, told);
        Ok(())
    })
}

/// phi' theta: the output that n regressors predict, in the unit of y. n multiply-adds.
///
/// Errors: NOT_FINITE if a regressor is NaN or infinite; OVERFLOW.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_rls_predict(
    rls: *const Rls,
    regressor: *const Number,
    output: *mut Number,
) -> Error {
    code(|| {
        let estimator = memory::read(rls)?;
        let regressor = memory::array(regressor, estimator.estimate().parameters().len())?;
        let [target] = memory::array_mut(output, 1)? else { return Err(Error::NullPointer) };
        *target = estimator.predict(regressor)?;
        Ok(())
    })
}

/// Reads the estimate. Each of the places may be NULL.
///
/// - parameters: theta, n numbers.
/// - standard_errors: those of theta, n numbers; NaN until the noise variance is known, after some more samples than
///   parameters.
/// - noise_variance: the variance of e, in the unit of y squared; NaN until it is known.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_rls_parameters(
    rls: *const Rls,
    parameters: *mut Number,
    standard_errors: *mut Number,
    noise_variance: *mut Number,
) -> Error {
    code(|| {
        learning::write_estimate(memory::read(rls)?.estimate(), parameters, standard_errors, noise_variance)
    })
}

/// Reads P, the covariance of theta in units of the noise variance, n x n. n^3/6 multiply-adds.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_rls_covariance(rls: *const Rls, covariance: *mut Number) -> Error {
    code(|| learning::write_covariance(memory::read(rls)?.estimate(), covariance))
}

/// Sets the parameters, n numbers: a warm start. P stays as it is.
///
/// Errors: NOT_FINITE; TOO_LARGE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_rls_set_parameters(rls: *mut Rls, parameters: *const Number) -> Error {
    code(|| {
        let estimator = memory::open(rls)?;
        let parameters = memory::array(parameters, estimator.estimate().parameters().len())?;
        estimator.set_parameters(parameters)
    })
}

/// Sets P, the covariance of the parameters over the noise variance, n x n, symmetric. Parameters and noise variance
/// stay. 2.5 n^3 multiply-adds.
///
/// Errors: NOT_FINITE; NOT_SYMMETRIC; NOT_POSITIVE; TOO_LARGE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_rls_set_covariance(rls: *mut Rls, covariance: *const Number) -> Error {
    code(|| {
        let estimator = memory::open(rls)?;
        let n = estimator.estimate().parameters().len();
        estimator.set_covariance(memory::array(covariance, n * n)?)
    })
}

/// Takes P for larger by a factor, at least 1: what was learnt counts that much less, and the next samples more. For a
/// plant that has changed, as after a repair.
///
/// Errors: OUT_OF_RANGE; TOO_LARGE; OVERFLOW.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_rls_widen(rls: *mut Rls, factor: Number) -> Error {
    code(|| memory::open(rls)?.widen(factor))
}

/// Turns adaptation off (0), or on again (1). While it is off innovations are computed and nothing changes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_rls_set_adaptation(rls: *mut Rls, on: u32) -> Error {
    code(|| {
        memory::open(rls)?.set_adaptation(on != 0);
        Ok(())
    })
}
