//! Linear models from arrays of C, as Kalman filters and observers hold them.

use thetahat_core::nalgebra::{Const, SVector};
use thetahat_core::{LinearObservation, LinearTransition};

use crate::arx::THETAHAT_MOST_INPUTS;
use crate::shapes::{covariance, matrix, vector};
use crate::{Error, Number, memory};

type Inputs = Const<THETAHAT_MOST_INPUTS>;
type Transition<const N: usize> = LinearTransition<Number, Const<N>, Inputs>;
type Observation<const N: usize, const M: usize> = LinearObservation<Number, Const<N>, Const<M>, Inputs>;

/// The input, with 0 for those that the model does not have.
pub(crate) type Input = SVector<Number, THETAHAT_MOST_INPUTS>;

/// The models of a filter or observer, once they are set.
pub(crate) struct Models<const N: usize, const M: usize> {
    transition: Option<Transition<N>>,
    observation: Option<Observation<N, M>>,
    inputs: usize,
}

impl<const N: usize, const M: usize> Models<N, M> {
    pub(crate) const NONE: Self = Models { transition: None, observation: None, inputs: 0 };

    pub(crate) fn inputs(&self) -> usize {
        self.inputs
    }

    pub(crate) fn transition(&self) -> Result<&Transition<N>, Error> {
        self.transition.as_ref().ok_or(Error::NoModel)
    }

    pub(crate) fn observation(&self) -> Result<&Observation<N, M>, Error> {
        self.observation.as_ref().ok_or(Error::NoModel)
    }

    /// Sets F, n x n, G, n x inputs, and Q, n x n. What is not given is 0. The number of inputs does not change under a
    /// D that is not 0: its columns are those of the inputs before.
    pub(crate) fn set_transition(&mut self, given: &Matrices<'_>) -> Result<(), Error> {
        let has_direct = |own: &Observation<N, M>| own.input_matrix().iter().any(|entry| *entry != 0.0);
        if given.inputs != self.inputs && self.observation.as_ref().is_some_and(has_direct) {
            return Err(Error::Inputs);
        }
        let transition = LinearTransition::new(matrix(given.of_state, N), covariance(given.noise)?)?;
        let input_matrix = matrix(given.of_input.unwrap_or_default(), given.inputs);
        self.transition = Some(transition.with_input(input_matrix)?);
        self.inputs = given.inputs;
        Ok(())
    }

    /// Sets H, m x n, D, m x inputs, and R, m x m. What is not given is 0. Without inputs no D is given.
    pub(crate) fn set_observation(&mut self, given: &Matrices<'_>) -> Result<(), Error> {
        if given.inputs == 0 && given.of_input.is_some() {
            return Err(Error::Inputs);
        }
        let observation = LinearObservation::new(matrix(given.of_state, N), covariance(given.noise)?)?;
        let input_matrix = matrix(given.of_input.unwrap_or_default(), given.inputs);
        self.observation = Some(observation.with_input(input_matrix)?);
        Ok(())
    }
}

/// The matrices of a transition or an observation, row by row.
pub(crate) struct Matrices<'a> {
    of_state: &'a [Number],
    of_input: Option<&'a [Number]>,
    inputs: usize,
    noise: Option<&'a [Number]>,
}

/// The matrices of a model that C gives, with so many rows, states and inputs.
///
/// # Safety
///
/// Each pointer is null, or valid for a matrix of its size.
pub(crate) unsafe fn matrices<'a>(
    [rows, states, inputs]: [usize; 3],
    of_state: *const Number,
    of_input: *const Number,
    noise: *const Number,
) -> Result<Matrices<'a>, Error> {
    if inputs > THETAHAT_MOST_INPUTS {
        return Err(Error::Length);
    }
    Ok(Matrices {
        of_state: memory::array(of_state, rows * states)?,
        of_input: memory::optional(of_input, rows * inputs)?,
        inputs,
        noise: memory::optional(noise, rows * rows)?,
    })
}

/// The input that C gives.
///
/// # Safety
///
/// The pointer is null, or valid for so many numbers.
pub(crate) unsafe fn input(input: *const Number, inputs: usize) -> Result<Input, Error> {
    Ok(vector(memory::array(input, inputs)?))
}
