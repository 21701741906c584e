use super::fitted::{PolynomialModel, Signal};
use super::quantity::Quantity;
use super::state_space::{ContinuousStateSpaceModel, StateSpaceModel};

/// What a linear model is from its inputs to one of its outputs.
#[derive(Debug, Clone, PartialEq)]
pub enum LinearModel<'m> {
    /// Polynomials that were fitted, with their noise.
    Polynomial(&'m PolynomialModel),
    /// A transfer function from each input, which follows from a model of another kind; of the noise it says nothing.
    Transfer(Box<PolynomialModel>),
    /// An output of a state-space model, counted from 0.
    StateSpace(&'m StateSpaceModel, usize),
    /// An output of a model in continuous time, counted from 0.
    Continuous(&'m ContinuousStateSpaceModel, usize),
}

impl LinearModel<'_> {
    /// The inputs.
    pub fn inputs(&self) -> &[Signal] {
        match self {
            Self::Polynomial(model) => &model.inputs,
            Self::Transfer(model) => &model.inputs,
            Self::StateSpace(model, _) => &model.inputs,
            Self::Continuous(model, _) => &model.inputs,
        }
    }

    /// The output.
    pub fn output(&self) -> &Signal {
        match self {
            Self::Polynomial(model) => &model.output,
            Self::Transfer(model) => &model.output,
            Self::StateSpace(model, output) => &model.outputs[*output],
            Self::Continuous(model, output) => &model.outputs[*output],
        }
    }

    /// Seconds from one sample to the next; of a model in continuous time from one sample of its transient responses.
    pub fn sample_time(&self) -> f64 {
        match self {
            Self::Polynomial(model) => model.sample_time,
            Self::Transfer(model) => model.sample_time,
            Self::StateSpace(model, _) => model.sample_time,
            Self::Continuous(model, _) => model.sample_time,
        }
    }

    /// Whether all poles lie inside the unit circle, in continuous time left of the imaginary axis.
    pub fn stable(&self) -> bool {
        match self {
            Self::Polynomial(model) => model.stable,
            Self::Transfer(model) => model.stable,
            Self::StateSpace(model, _) => model.stable,
            Self::Continuous(model, _) => model.stable,
        }
    }

    /// The static gain of an input, counted from 0; none where a pole of it stands at an integrator's place.
    pub fn dc_gain(&self, input: usize) -> Option<Quantity> {
        let of = |gains: &[Option<Quantity>]| gains.get(input).copied().flatten();
        match self {
            Self::Polynomial(model) => of(&model.dc_gain),
            Self::Transfer(model) => of(&model.dc_gain),
            Self::StateSpace(model, output) => model.dc_gain.get(*output).and_then(|gains| of(gains)),
            Self::Continuous(model, output) => model.dc_gain.get(*output).and_then(|gains| of(gains)),
        }
    }

    /// Whether it has one noise and says what becomes of it. Of a state-space model each output has a noise of its own,
    /// and all may reach it.
    pub fn has_noise(&self) -> bool {
        match self {
            Self::Polynomial(_) => true,
            Self::Transfer(_) | Self::Continuous(..) => false,
            Self::StateSpace(model, _) => model.outputs.len() == 1,
        }
    }
}
