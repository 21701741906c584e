//! Models whose functions are written in C, and what filters of them share.

use core::ffi::c_void;

use thetahat_core::nalgebra::{Const, SMatrix, SVector};
use thetahat_core::{Covariance, Observation, Transition};

use crate::innovation::Innovation;
use crate::memory::{self, Kind};
use crate::shapes::{matrix, vector, write};
use crate::{Error, Number};

/// A function of the state: `value` from `state`; `context` is that of the function. Arrays do not overlap. Values are
/// 0 before the call, so that only the others need be written.
pub type FunctionOfState =
    Option<unsafe extern "C" fn(state: *const Number, value: *mut Number, context: *mut c_void)>;

/// A function of the state and its Jacobian: f or h of a model. Inputs and time are in the context. A function that
/// writes NaN or infinity makes the filter return an error and stay as it was.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct Function {
    /// f(x), n numbers, or h(x), m numbers.
    pub value: FunctionOfState,
    /// df/dx, n x n, or dh/dx, m x n, row by row. An unscented filter does not call it: it may be NULL there.
    pub jacobian: FunctionOfState,
    /// What the functions are called with.
    pub context: *mut c_void,
}

/// A function of C with all its parts.
#[derive(Clone, Copy)]
pub(crate) struct Model {
    value: unsafe extern "C" fn(*const Number, *mut Number, *mut c_void),
    jacobian: FunctionOfState,
    context: *mut c_void,
}

impl Model {
    /// The model that C gives, its Jacobian missing or not.
    ///
    /// # Safety
    ///
    /// The pointer is null or valid. While the model is used, its functions keep what their documentation says.
    pub(crate) unsafe fn new(function: *const Function) -> Result<Self, Error> {
        let Function { value, jacobian, context } = *memory::follow(function)?;
        Ok(Model { value: value.ok_or(Error::NullPointer)?, jacobian, context })
    }

    /// The same for a filter that needs the Jacobian.
    ///
    /// # Safety
    ///
    /// As for [`new`](Model::new).
    pub(crate) unsafe fn with_jacobian(function: *const Function) -> Result<Self, Error> {
        let model = Model::new(function)?;
        if model.jacobian.is_some() { Ok(model) } else { Err(Error::NullPointer) }
    }

    fn value<const N: usize, const R: usize>(&self, state: &SVector<Number, N>) -> SVector<Number, R> {
        let mut value: SVector<Number, R> = vector(&[]);
        // SAFETY: `new` was promised that the function writes as many numbers.
        unsafe { (self.value)(state.as_slice().as_ptr(), value.as_mut_slice().as_mut_ptr(), self.context) };
        value
    }

    fn jacobian<const N: usize, const R: usize>(&self, state: &SVector<Number, N>) -> SMatrix<Number, R, N> {
        let mut rows: SMatrix<Number, N, R> = matrix(&[], R);
        if let Some(jacobian) = self.jacobian {
            // SAFETY: `new` was promised that the function writes as many numbers.
            unsafe { jacobian(state.as_slice().as_ptr(), rows.as_mut_slice().as_mut_ptr(), self.context) };
        }
        matrix(rows.as_slice(), N)
    }
}

/// A model with the covariance of its noise.
pub(crate) struct With<'a, C> {
    pub(crate) model: Model,
    pub(crate) noise: &'a C,
}

impl<const N: usize> Transition<Number, Const<N>> for With<'_, Covariance<Number, Const<N>>> {
    fn next(&self, state: &SVector<Number, N>, _: &SVector<Number, 0>) -> SVector<Number, N> {
        self.model.value(state)
    }

    fn next_jacobian(&self, state: &SVector<Number, N>, _: &SVector<Number, 0>) -> SMatrix<Number, N, N> {
        self.model.jacobian(state)
    }

    fn process_noise(&self, _: &SVector<Number, N>, _: &SVector<Number, 0>) -> Covariance<Number, Const<N>> {
        self.noise.clone()
    }
}

impl<const N: usize, const M: usize> Observation<Number, Const<N>, Const<M>>
    for With<'_, Covariance<Number, Const<M>>>
{
    fn output(&self, state: &SVector<Number, N>, _: &SVector<Number, 0>) -> SVector<Number, M> {
        self.model.value(state)
    }

    fn output_jacobian(&self, state: &SVector<Number, N>, _: &SVector<Number, 0>) -> SMatrix<Number, M, N> {
        self.model.jacobian(state)
    }

    fn measurement_noise(
        &self,
        _: &SVector<Number, N>,
        _: &SVector<Number, 0>,
    ) -> Covariance<Number, Const<M>> {
        self.noise.clone()
    }
}

/// A filter and the covariances of the noises.
pub(crate) struct Noisy<F, const N: usize, const M: usize> {
    pub(crate) filter: F,
    pub(crate) process: Covariance<Number, Const<N>>,
    pub(crate) measurement: Covariance<Number, Const<M>>,
}

impl<F, const N: usize, const M: usize> Noisy<F, N, M> {
    /// The filter, without noise at first.
    pub(crate) fn new(filter: F) -> Self {
        Noisy { filter, process: Covariance::zero(Const), measurement: Covariance::zero(Const) }
    }
}

/// What a filter of any size does.
pub(crate) trait Filter {
    /// The numbers of states and outputs.
    fn sizes(&self) -> [usize; 2];
    fn set_noise(&mut self, process: Option<&[Number]>, measurement: Option<&[Number]>) -> Result<(), Error>;
    fn set_state(&mut self, state: &[Number]) -> Result<(), Error>;
    fn set_covariance(&mut self, variance: Option<&[Number]>) -> Result<(), Error>;
    fn widen(&mut self, factor: Number) -> Result<(), Error>;
    fn set_gate(&mut self, gate: Number, release: u16) -> Result<(), Error>;
    fn predict(&mut self, transition: Model) -> Result<(), Error>;
    fn correct(&mut self, observation: Model, measurement: &[Number]) -> Result<Innovation, Error>;
    fn state(&self) -> &[Number];
    fn write_covariance(&self, target: &mut [Number]) -> Result<(), Error>;
}

/// Implements [`Filter`] for a filter of thetahat-core. (Its two filters of functions have these methods, but no trait
/// for them.)
macro_rules! filter_of_functions {
    ($filter:ident) => {
        impl<const N: usize, const M: usize> $crate::functions::Filter
            for $crate::functions::Noisy<$filter<Number, Const<N>>, N, M>
        {
            fn sizes(&self) -> [usize; 2] {
                [N, M]
            }

            fn set_noise(
                &mut self,
                process: Option<&[Number]>,
                measurement: Option<&[Number]>,
            ) -> Result<(), Error> {
                (self.process, self.measurement) =
                    ($crate::shapes::covariance(process)?, $crate::shapes::covariance(measurement)?);
                Ok(())
            }

            fn set_state(&mut self, state: &[Number]) -> Result<(), Error> {
                Ok(self.filter.set_state($crate::shapes::vector(state))?)
            }

            fn set_covariance(&mut self, variance: Option<&[Number]>) -> Result<(), Error> {
                Ok(self.filter.set_covariance($crate::shapes::covariance(variance)?)?)
            }

            fn widen(&mut self, factor: Number) -> Result<(), Error> {
                Ok(self.filter.widen(factor)?)
            }

            fn set_gate(&mut self, gate: Number, release: u16) -> Result<(), Error> {
                self.filter.set_gate(gate)?;
                self.filter.set_release(release);
                Ok(())
            }

            fn predict(&mut self, model: $crate::functions::Model) -> Result<(), Error> {
                Ok(self.filter.predict(
                    &$crate::functions::With { model, noise: &self.process },
                    &$crate::shapes::vector(&[]),
                )?)
            }

            fn correct(
                &mut self,
                model: $crate::functions::Model,
                measurement: &[Number],
            ) -> Result<$crate::Innovation, Error> {
                let observation = $crate::functions::With { model, noise: &self.measurement };
                Ok(self
                    .filter
                    .correct(
                        &observation,
                        &$crate::shapes::vector(&[]),
                        &$crate::shapes::vector(measurement),
                    )?
                    .into())
            }

            fn state(&self) -> &[Number] {
                self.filter.state().as_slice()
            }

            fn write_covariance(&self, target: &mut [Number]) -> Result<(), Error> {
                Ok(self.filter.covariance().write_into(target)?)
            }
        }
    };
}

pub(crate) use filter_of_functions;

/// Sets Q and R.
///
/// # Safety
///
/// Pointers are null or valid, as the function of C says.
pub(crate) unsafe fn set_noise<K: Kind>(
    filter: *mut K,
    process_noise: *const Number,
    measurement_noise: *const Number,
) -> Result<(), Error>
where
    K::Body: Filter,
{
    let filter = memory::open(filter)?;
    let [n, m] = filter.sizes();
    filter.set_noise(memory::optional(process_noise, n * n)?, memory::optional(measurement_noise, m * m)?)
}

/// Sets the state.
///
/// # Safety
///
/// As for [`set_noise`].
pub(crate) unsafe fn set_state<K: Kind>(filter: *mut K, state: *const Number) -> Result<(), Error>
where
    K::Body: Filter,
{
    let filter = memory::open(filter)?;
    let [states, _] = filter.sizes();
    filter.set_state(memory::array(state, states)?)
}

/// Sets P.
///
/// # Safety
///
/// As for [`set_noise`].
pub(crate) unsafe fn set_covariance<K: Kind>(filter: *mut K, covariance: *const Number) -> Result<(), Error>
where
    K::Body: Filter,
{
    let filter = memory::open(filter)?;
    let [states, _] = filter.sizes();
    filter.set_covariance(memory::optional(covariance, states * states)?)
}

/// Sets the gate and when it lets go.
///
/// # Safety
///
/// As for [`set_noise`].
pub(crate) unsafe fn set_gate<K: Kind>(filter: *mut K, gate: Number, release: u32) -> Result<(), Error>
where
    K::Body: Filter,
{
    let release = u16::try_from(release).map_err(|_| Error::OutOfRange)?;
    memory::open(filter)?.set_gate(gate, release)
}

/// The measurement update.
///
/// # Safety
///
/// As for [`set_noise`].
pub(crate) unsafe fn correct<K: Kind>(
    filter: *mut K,
    observation: Model,
    measurement: *const Number,
    innovation: *mut Innovation,
) -> Result<(), Error>
where
    K::Body: Filter,
{
    let [_, outputs] = memory::read(filter)?.sizes();
    let measurement = memory::array(measurement, outputs)?;
    memory::busy(filter, |filter| {
        let told = filter.correct(observation, measurement)?;
        memory::answer(innovation, told);
        Ok(())
    })
}

/// Reads the state.
///
/// # Safety
///
/// As for [`set_noise`].
pub(crate) unsafe fn state<K: Kind>(filter: *const K, state: *mut Number) -> Result<(), Error>
where
    K::Body: Filter,
{
    let found = memory::read(filter)?.state();
    write(found, memory::array_mut(state, found.len())?);
    Ok(())
}

/// Reads P.
///
/// # Safety
///
/// As for [`set_noise`].
pub(crate) unsafe fn covariance<K: Kind>(filter: *const K, covariance: *mut Number) -> Result<(), Error>
where
    K::Body: Filter,
{
    let filter = memory::read(filter)?;
    let [states, _] = filter.sizes();
    filter.write_covariance(memory::array_mut(covariance, states * states)?)
}
