//! Recursive ARX and ARMAX estimators: one kind, as they are used alike.

use thetahat_core::nalgebra::Const;
use thetahat_core::{
    ArmaxMethod, ArmaxOrders, ArxOrders, Covariance, InputOrders as CoreOrders, RecursiveArmax, RecursiveArx,
};

use crate::error::code;
use crate::innovation::Innovation;
use crate::learning::{self, Estimate, Learning};
use crate::memory::{self, Kind, Made, Place, View, Word};
use crate::shapes::{covariance, matrix, vector};
use crate::{Error, Number};

/// The most inputs of a model.
pub const THETAHAT_MOST_INPUTS: usize = 4;

/// The most input samples on their way in an ARX or ARMAX model: the nk of all inputs, added up.
pub const THETAHAT_MOST_DELAYS: usize = 16;

/// The orders of one input.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct InputOrders {
    /// The number of coefficients.
    pub nb: u32,
    /// The delay in samples, from the input to the first output it acts on.
    pub nk: u32,
}

/// How a recursive ARMAX estimator corrects.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArmaxGradient {
    /// Along the gradient of the prediction: converges to a minimum of the prediction error.
    PredictionError = 0,
    /// Extended least squares: quick to converge, but not always to the truth.
    ExtendedLeastSquares = 1,
}

/// The orders of an ARX or ARMAX model, and what its signals are like.
///
/// y(k) + a_1 y(k-1) + ... + a_na y(k-na) = sum over the inputs of b_0 u(k-nk) + ... + b_(nb-1) u(k-nk-nb+1)
///     [+ constant] + e(k) + c_1 e(k-1) + ... + c_nc e(k-nc)
///
/// The parameters are a_1 ... a_na, b_0 ... of the first input, then of the next, the constant, c_1 ... c_nc.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct ArxModel {
    /// The number of past outputs.
    pub na: u32,
    /// The number of inputs, 0 ... THETAHAT_MOST_INPUTS.
    pub inputs: u32,
    /// The orders of each input.
    pub input: [InputOrders; THETAHAT_MOST_INPUTS],
    /// The number of past residuals: 0 but for sizes of ARMAX.
    pub nc: u32,
    /// 1 if a constant is a parameter too, else 0.
    pub constant: u32,
    /// The typical magnitude of the output, in its unit, above 0.
    pub output_scale: Number,
    /// The typical magnitude of each input, in its unit, above 0.
    pub input_scales: [Number; THETAHAT_MOST_INPUTS],
    /// The typical magnitude of e, in the unit of the output, above 0: for sizes of ARMAX.
    pub noise_scale: Number,
    /// A `thetahat_armax_gradient`: for sizes of ARMAX.
    pub gradient: i32,
}

impl ArxModel {
    /// The orders of the inputs, and their number.
    fn inputs(&self) -> Result<([CoreOrders; THETAHAT_MOST_INPUTS], usize), Error> {
        let orders = self.input.map(|input| CoreOrders { nb: input.nb as usize, nk: input.nk as usize });
        let count = self.inputs as usize;
        if count > THETAHAT_MOST_INPUTS { Err(Error::Length) } else { Ok((orders, count)) }
    }
}

/// An ARX or ARMAX model, estimated while the plant runs.
pub struct Arx {
    _opaque: [u8; 0],
}

/// The number of parameters of a `thetahat_arx`, and its structure: `thetahat_arx_4` is ARX with 4 parameters,
/// `thetahat_armax_5` ARMAX with 5.
pub struct ArxSize {
    init: fn(Place<Arx>, &ArxModel, &Learning) -> Made<Arx>,
    view: View<dyn Plant>,
}

impl ArxSize {
    pub(crate) const fn arx<const N: usize>() -> Self {
        ArxSize { init: init_arx::<N>, view: |body| body.cast::<ArxEstimator<N>>() }
    }

    pub(crate) const fn armax<const N: usize>() -> Self {
        ArxSize { init: init_armax::<N>, view: |body| body.cast::<ArmaxEstimator<N>>() }
    }
}

impl Kind for Arx {
    const TAG: u32 = 0x5852_4154;
    type Size = ArxSize;
    type Body = dyn Plant;

    fn view(size: &ArxSize) -> View<dyn Plant> {
        size.view
    }
}

type ArxEstimator<const N: usize> = RecursiveArx<Number, Const<N>, Const<THETAHAT_MOST_DELAYS>>;
type ArmaxEstimator<const N: usize> = RecursiveArmax<Number, Const<N>, Const<THETAHAT_MOST_DELAYS>>;

/// What a batch fit knows beside its parameters.
pub(crate) struct Fit<'a> {
    /// P, row by row, as `Covariance::factor` has it.
    factor: &'a [Number],
    noise_variance: Number,
    samples: usize,
}

impl Fit<'_> {
    /// P.
    fn covariance<const N: usize>(&self) -> Result<Covariance<Number, Const<N>>, Error> {
        Ok(Covariance::from_factor(matrix(self.factor, N))?)
    }
}

/// What an estimator of any size and structure does.
pub(crate) trait Plant {
    fn measured(&mut self, output: Number) -> Result<Innovation, Error>;
    fn applied(&mut self, inputs: &[Number]) -> Result<(), Error>;
    fn log_row(&mut self, output: Number, inputs: &[Number]) -> Result<Innovation, Error>;
    fn predict(&self, inputs: &[Number], outputs: &mut [Number]) -> Result<(), Error>;
    fn set_parameters(&mut self, parameters: &[Number], fit: Option<&Fit<'_>>) -> Result<(), Error>;
    fn set_covariance(&mut self, variance: &[Number]) -> Result<(), Error>;
    fn widen(&mut self, factor: Number) -> Result<(), Error>;
    fn set_adaptation(&mut self, on: bool);
    fn estimate(&self) -> &dyn Estimate;
}

macro_rules! plant {
    ($estimator:ident) => {
        impl<const N: usize> Plant for $estimator<N> {
            fn measured(&mut self, output: Number) -> Result<Innovation, Error> {
                Ok(self.measured(output)?.into())
            }

            fn applied(&mut self, inputs: &[Number]) -> Result<(), Error> {
                Ok(self.applied(inputs)?)
            }

            fn log_row(&mut self, output: Number, inputs: &[Number]) -> Result<Innovation, Error> {
                Ok(self.log_row(output, inputs)?.into())
            }

            fn predict(&self, inputs: &[Number], outputs: &mut [Number]) -> Result<(), Error> {
                Ok(self.predict(inputs, outputs)?)
            }

            fn set_parameters(&mut self, parameters: &[Number], fit: Option<&Fit<'_>>) -> Result<(), Error> {
                let parameters = vector(parameters);
                let Some(fit) = fit else { return Ok(self.set_parameters(parameters)?) };
                let changed = self.clone().with_parameters(parameters)?.with_covariance(fit.covariance()?)?;
                *self = changed.with_noise_variance(fit.noise_variance, fit.samples)?;
                Ok(())
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
                self.estimator()
            }
        }
    };
}

plant!(ArxEstimator);
plant!(ArmaxEstimator);

fn init_arx<const N: usize>(place: Place<Arx>, model: &ArxModel, learning: &Learning) -> Made<Arx> {
    if model.nc > 0 {
        return Err(Error::Orders);
    }
    let (inputs, count) = model.inputs()?;
    let (inputs, scales) = (inputs.get(..count), model.input_scales.get(..count));
    let orders = ArxOrders {
        na: model.na as usize,
        inputs: inputs.unwrap_or_default(),
        constant: model.constant != 0,
    };
    let policy = learning.policy()?;
    let mut plant: ArxEstimator<N> =
        RecursiveArx::new(&orders, model.output_scale, scales.unwrap_or_default(), policy)?
            .with_dead_zone(learning.dead_zone)?
            .with_outliers(learning.outliers()?)?;
    if let Some(start) = learning.start()? {
        plant = plant.with_start(start)?;
    }
    place.write(plant)
}

fn init_armax<const N: usize>(place: Place<Arx>, model: &ArxModel, learning: &Learning) -> Made<Arx> {
    let (inputs, count) = model.inputs()?;
    let (inputs, scales) = (inputs.get(..count), model.input_scales.get(..count));
    let orders = ArmaxOrders {
        na: model.na as usize,
        inputs: inputs.unwrap_or_default(),
        nc: model.nc as usize,
        constant: model.constant != 0,
    };
    let method = match model.gradient {
        gradient if gradient == ArmaxGradient::PredictionError as i32 => ArmaxMethod::PredictionError,
        gradient if gradient == ArmaxGradient::ExtendedLeastSquares as i32 => {
            ArmaxMethod::ExtendedLeastSquares
        }
        _ => return Err(Error::OutOfRange),
    };
    if learning.start()?.is_some() {
        return Err(Error::OutOfRange);
    }
    let (scales, policy) = (scales.unwrap_or_default(), learning.policy()?);
    let plant: ArmaxEstimator<N> =
        RecursiveArmax::new(&orders, method, model.output_scale, scales, model.noise_scale, policy)?;
    place.write(plant.with_dead_zone(learning.dead_zone)?.with_outliers(learning.outliers()?)?)
}

/// Makes an estimator that knows nothing yet, and has seen no sample.
///
/// - arx: where its handle goes. It points into the memory.
/// - memory, bytes: at least `THETAHAT_ARX_WORDS(n)` or `THETAHAT_ARMAX_WORDS(n)` words, and their size in bytes.
/// - size: `&thetahat_arx_n` or `&thetahat_armax_n` for n parameters.
/// - model: the orders, which make n parameters, and the scales.
/// - learning: how old samples are forgotten and how it starts; NULL for the default.
///
/// Errors: MEMORY_TOO_SMALL; ORDERS if the orders do not make n parameters; DELAYS; LENGTH for too many inputs;
/// NOT_FINITE; OUT_OF_RANGE if a scale is not above 0, or far from 1, or a number of the policy is out of its range.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_arx_init(
    arx: *mut *mut Arx,
    memory: *mut Word,
    bytes: usize,
    size: *const ArxSize,
    model: *const ArxModel,
    learning: *const Learning,
) -> Error {
    code(|| {
        let handle = memory::follow(arx)?.cast_mut();
        let place = Place::<Arx>::new(memory, bytes, size)?;
        let (size, model) = (place.size(), *memory::follow(model)?);
        let learning = Learning::given(learning)?;
        *handle = (size.init)(place, &model, &learning)?;
        Ok(())
    })
}

/// y(k) arrives: time goes on to k, and the model learns from y(k) and the inputs that were applied before. NaN is a
/// missing sample. The innovation may be NULL.
///
/// A controller calls measured, then computes u(k), then calls applied. A call that is left out is a missing sample.
///
/// Errors, after which time has not gone on: INPUT_FIRST if an nk is 0; INFINITE; TOO_LARGE. 1.5 n^2 + 7 n
/// multiply-adds, with ARMAX nc n more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_arx_measured(
    arx: *mut Arx,
    output: Number,
    innovation: *mut Innovation,
) -> Error {
    code(|| {
        let told = memory::open(arx)?.measured(output)?;
        memory::answer(innovation, told);
        Ok(())
    })
}

/// u(k): what acts on the plant from now on, until the next measurement, after all limits. NaN is a missing sample.
///
/// - inputs, count: one number for each input of the model.
///
/// Errors: LENGTH; INFINITE; TOO_LARGE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_arx_applied(arx: *mut Arx, inputs: *const Number, count: usize) -> Error {
    code(|| {
        let plant = memory::open(arx)?;
        plant.applied(memory::array(inputs, count)?)
    })
}

/// One row of a log: y(k) and u(k), recorded at the same instant k. NaN is a missing sample. The innovation may be
/// NULL.
///
/// Not the call for a controller that knows u(k-1) when y(k) arrives: that calls measured and applied.
///
/// Errors, after which time has not gone on: LENGTH; INFINITE; TOO_LARGE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_arx_log_row(
    arx: *mut Arx,
    output: Number,
    inputs: *const Number,
    count: usize,
    innovation: *mut Innovation,
) -> Error {
    code(|| {
        let plant = memory::open(arx)?;
        let told = plant.log_row(output, memory::array(inputs, count)?)?;
        memory::answer(innovation, told);
        Ok(())
    })
}

/// The outputs to come, y(k+1), y(k+2), ... after the latest one, y(k).
///
/// - inputs, count: those to come, instant by instant, one number for each input of the model: steps times the inputs.
///   After measured the first is u(k); after applied or log_row it is u(k+1).
/// - outputs, steps: where they go, and how many. One that depends on a missing sample is NaN.
///
/// Errors: LENGTH; INFINITE; OVERFLOW if an unstable model grows out of the number type: outputs before that are
/// written, the others are NaN.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_arx_predict(
    arx: *const Arx,
    inputs: *const Number,
    count: usize,
    outputs: *mut Number,
    steps: usize,
) -> Error {
    code(|| {
        let plant = memory::read(arx)?;
        plant.predict(memory::array(inputs, count)?, memory::array_mut(outputs, steps)?)
    })
}

/// Reads the estimate. Each of the places may be NULL.
///
/// - parameters: n numbers, in the order of `thetahat_arx_model`.
/// - standard_errors: n numbers; NaN until the noise variance is known, after some more samples than parameters.
/// - noise_variance: the variance of e, in the unit of y squared; NaN until it is known.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_arx_parameters(
    arx: *const Arx,
    parameters: *mut Number,
    standard_errors: *mut Number,
    noise_variance: *mut Number,
) -> Error {
    code(|| {
        learning::write_estimate(memory::read(arx)?.estimate(), parameters, standard_errors, noise_variance)
    })
}

/// Reads P, the covariance of the parameters in units of the noise variance, n x n. n^3/6 multiply-adds.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_arx_covariance(arx: *const Arx, covariance: *mut Number) -> Error {
    code(|| learning::write_covariance(memory::read(arx)?.estimate(), covariance))
}

/// Sets the parameters, n numbers: a warm start. P stays as it is.
///
/// Errors: NOT_FINITE; TOO_LARGE; OUT_OF_RANGE if C(q) is not stable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_arx_set_parameters(arx: *mut Arx, parameters: *const Number) -> Error {
    code(|| {
        let plant = memory::open(arx)?;
        let parameters = memory::array(parameters, plant.estimate().parameters().len())?;
        plant.set_parameters(parameters, None)
    })
}

/// Sets all that a batch fit knows: its parameters, how sure they are, and the noise. The start is then the standard
/// one. The samples that were seen stay.
///
/// - parameters: n numbers, in the order of `thetahat_arx_model`.
/// - factor: P, the covariance of the parameters over the noise variance, n x n, as P = U D U': D on the diagonal, the
///   upper triangular U above it, without the ones of its diagonal, and 0 below. If P is diagonal so is the factor, and
///   the same. In single precision a factor is always that of a covariance, where a rounded P may be none.
/// - noise_variance: the variance of e, at least 0, in the unit of y squared.
/// - samples: how many the fit had, more than n.
///
/// Errors: NOT_FINITE; TOO_LARGE; NEGATIVE if a number of D is; OVERFLOW; OUT_OF_RANGE if C(q) is not stable, a number
/// below the diagonal is not 0, or the noise variance or the samples are out of range.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_arx_set_fit(
    arx: *mut Arx,
    parameters: *const Number,
    factor: *const Number,
    noise_variance: Number,
    samples: usize,
) -> Error {
    code(|| {
        let plant = memory::open(arx)?;
        let n = plant.estimate().parameters().len();
        let (parameters, factor) = (memory::array(parameters, n)?, memory::array(factor, n * n)?);
        plant.set_parameters(parameters, Some(&Fit { factor, noise_variance, samples }))
    })
}

/// Sets P, the covariance of the parameters over the noise variance, n x n, symmetric. Parameters and noise variance
/// stay. 2.5 n^3 multiply-adds.
///
/// Errors: NOT_FINITE; NOT_SYMMETRIC; NOT_POSITIVE; TOO_LARGE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_arx_set_covariance(arx: *mut Arx, covariance: *const Number) -> Error {
    code(|| {
        let estimator = memory::open(arx)?;
        let n = estimator.estimate().parameters().len();
        estimator.set_covariance(memory::array(covariance, n * n)?)
    })
}

/// Takes P for larger by a factor, at least 1: what was learnt counts that much less, and the next samples more. For a
/// plant that has changed, as after a repair.
///
/// Errors: OUT_OF_RANGE; TOO_LARGE; OVERFLOW.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_arx_widen(arx: *mut Arx, factor: Number) -> Error {
    code(|| memory::open(arx)?.widen(factor))
}

/// Turns adaptation off (0), or on again (1). While it is off innovations are computed and nothing changes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_arx_set_adaptation(arx: *mut Arx, on: u32) -> Error {
    code(|| {
        memory::open(arx)?.set_adaptation(on != 0);
        Ok(())
    })
}
