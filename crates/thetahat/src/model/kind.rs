//! The kinds of models.

use std::borrow::Cow;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::equations::{EquationsModel, GreyBox};
use super::fitted::{ArimaFactors, Parameter, PolynomialModel, Signal};
use super::linear::LinearModel;
use super::nonlinear_arx::NonlinearArxModel;
use super::orders::Structure;
use super::process::ProcessModel;
use super::quantity::Quantity;
use super::state_space::{ContinuousStateSpaceModel, Hold, StateSpace, StateSpaceModel, ZerosPolesGain};
use crate::Error;
use crate::data::Offset;

/// An estimated model of any kind.
///
/// All kinds have a head: inputs, outputs, sample time, parameters and their covariance. What only some have, such as
/// polynomials, their own type says.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Model {
    /// A(q) y = B(q)/F(q) u + C(q)/D(q) e.
    Polynomial(Box<PolynomialModel>),
    /// Equations of the states and the outputs, written by hand.
    Equations(Box<EquationsModel>),
    /// y = g(past outputs and inputs) + e.
    NonlinearArx(Box<NonlinearArxModel>),
    /// Gain, lags and dead time in continuous time.
    Process(Box<ProcessModel>),
    /// A recursion of a state, with any number of outputs.
    StateSpace(Box<StateSpaceModel>),
    /// A state in continuous time, with any number of outputs: what a model of another kind was converted to.
    ContinuousStateSpace(Box<ContinuousStateSpaceModel>),
}

/// What a filter of a model's state runs on.
pub(crate) enum FilterForm<'m> {
    /// x(t+1) = F x + G u + K e, y = H x + D u + e.
    Innovations(Box<StateSpace>),
    /// The equations, with the values that were found.
    Equations(Box<GreyBox>),
    /// A map of past outputs and inputs, which are the state.
    Lags(&'m NonlinearArxModel),
}

impl From<StateSpaceModel> for Model {
    fn from(model: StateSpaceModel) -> Self {
        Self::StateSpace(Box::new(model))
    }
}

impl From<ContinuousStateSpaceModel> for Model {
    fn from(model: ContinuousStateSpaceModel) -> Self {
        Self::ContinuousStateSpace(Box::new(model))
    }
}

impl From<NonlinearArxModel> for Model {
    fn from(model: NonlinearArxModel) -> Self {
        Self::NonlinearArx(Box::new(model))
    }
}

impl From<ProcessModel> for Model {
    fn from(model: ProcessModel) -> Self {
        Self::Process(Box::new(model))
    }
}

impl From<PolynomialModel> for Model {
    fn from(model: PolynomialModel) -> Self {
        Self::Polynomial(Box::new(model))
    }
}

impl From<EquationsModel> for Model {
    fn from(model: EquationsModel) -> Self {
        Self::Equations(Box::new(model))
    }
}

impl Model {
    /// The inputs, in their order.
    pub fn inputs(&self) -> &[Signal] {
        match self {
            Self::Polynomial(model) => &model.inputs,
            Self::Equations(model) => &model.inputs,
            Self::NonlinearArx(model) => &model.inputs,
            Self::Process(model) => &model.inputs,
            Self::StateSpace(model) => &model.inputs,
            Self::ContinuousStateSpace(model) => &model.inputs,
        }
    }

    /// The outputs, in their order.
    pub fn outputs(&self) -> &[Signal] {
        match self {
            Self::Polynomial(model) => std::slice::from_ref(&model.output),
            Self::Equations(model) => &model.outputs,
            Self::NonlinearArx(model) => &model.outputs,
            Self::Process(model) => std::slice::from_ref(&model.output),
            Self::StateSpace(model) => &model.outputs,
            Self::ContinuousStateSpace(model) => &model.outputs,
        }
    }

    /// Sets what a channel is measured from: where the plant rests, or works.
    ///
    /// # Errors
    /// [`Error::Argument`] for a name that is no channel of the model, and a model in equations, which has no offsets.
    pub fn set_offset(&mut self, name: &str, level: f64) -> Result<(), Error> {
        if !self.has_offsets() {
            return Err(Error::argument("offset", "equations describe signals as they are; leave it out"));
        }
        let (inputs, outputs) = match self {
            Self::Polynomial(model) => (&mut *model.inputs, std::slice::from_mut(&mut model.output)),
            Self::Equations(model) => (&mut *model.inputs, &mut *model.outputs),
            Self::NonlinearArx(model) => (&mut *model.inputs, &mut *model.outputs),
            Self::Process(model) => (&mut *model.inputs, std::slice::from_mut(&mut model.output)),
            Self::StateSpace(model) => (&mut *model.inputs, &mut *model.outputs),
            Self::ContinuousStateSpace(model) => (&mut *model.inputs, &mut *model.outputs),
        };
        let own = inputs.iter_mut().chain(outputs).find(|signal| signal.name == name);
        let own =
            own.ok_or_else(|| Error::argument("offset", format!("'{name}' is no channel of the model")))?;
        own.offset = Offset { level, ..Offset::default() };
        Ok(())
    }

    /// The names of the channels: inputs, then outputs.
    pub fn channels(&self) -> impl Iterator<Item = &str> {
        self.inputs().iter().chain(self.outputs()).map(|signal| signal.name.as_str())
    }

    /// Seconds from one sample to the next; of a model in continuous time that of the model it was made from.
    pub fn sample_time(&self) -> f64 {
        match self {
            Self::Polynomial(model) => model.sample_time,
            Self::Equations(model) => model.sample_time,
            Self::NonlinearArx(model) => model.sample_time,
            Self::Process(model) => model.sample_time,
            Self::StateSpace(model) => model.sample_time,
            Self::ContinuousStateSpace(model) => model.sample_time,
        }
    }

    /// The parameters, in the order of the covariance; of a seasonal ARIMA model those of its factors. A state-space
    /// model has none: the entries of its matrices depend on the coordinates of the state.
    pub fn parameters(&self) -> &[Parameter] {
        match self {
            Self::Polynomial(model) => match &model.factors {
                Some(factors) => &factors.parameters,
                None => &model.parameters,
            },
            Self::Equations(model) => &model.parameters,
            Self::NonlinearArx(model) => &model.parameters,
            Self::Process(model) => &model.parameters,
            Self::StateSpace(_) | Self::ContinuousStateSpace(_) => &[],
        }
    }

    /// The number of free parameters.
    pub fn free_parameters(&self) -> usize {
        match self {
            Self::StateSpace(model) => model.free_parameters,
            Self::ContinuousStateSpace(model) => model.free_parameters,
            Self::Polynomial(_) | Self::Equations(_) | Self::NonlinearArx(_) | Self::Process(_) => {
                self.parameters().len()
            }
        }
    }

    /// The covariance matrix of the parameters, row by row; none where it is not known.
    pub fn covariance(&self) -> Option<&[Vec<f64>]> {
        match self {
            Self::Polynomial(model) => match &model.factors {
                Some(factors) => factors.covariance.as_deref(),
                None => model.covariance.as_deref(),
            },
            Self::Equations(model) => model.covariance.as_deref(),
            Self::NonlinearArx(model) => model.covariance.as_deref(),
            Self::Process(model) => model.covariance.as_deref(),
            Self::StateSpace(_) | Self::ContinuousStateSpace(_) => None,
        }
    }

    /// Whether it is known how certain its numbers are.
    pub(crate) fn has_standard_errors(&self) -> bool {
        match self {
            Self::StateSpace(model) => model.covariance.is_some(),
            Self::ContinuousStateSpace(model) => model.covariance.is_some(),
            Self::Polynomial(_) | Self::Equations(_) | Self::NonlinearArx(_) | Self::Process(_) => {
                self.covariance().is_some()
            }
        }
    }

    /// Whether inputs act on the outputs.
    pub fn is_driven(&self) -> bool {
        match self {
            Self::Polynomial(model) => model.orders.nb.iter().any(|&nb| nb > 0),
            Self::Equations(model) => !model.inputs.is_empty(),
            Self::NonlinearArx(model) => model.is_driven(),
            Self::Process(_) => true,
            Self::StateSpace(model) => !model.inputs.is_empty(),
            Self::ContinuousStateSpace(model) => !model.inputs.is_empty(),
        }
    }

    /// Whether all of its poles are inside the unit circle, or in the left half plane; none of models that say nothing
    /// of it.
    pub fn stability(&self) -> Option<bool> {
        match self {
            Self::Polynomial(model) => Some(model.stable),
            Self::StateSpace(model) => Some(model.stable),
            Self::ContinuousStateSpace(model) => Some(model.stable),
            Self::Equations(_) | Self::NonlinearArx(_) | Self::Process(_) => None,
        }
    }

    /// The time constants of the poles of a sampled linear model; none of others.
    pub fn time_constants(&self) -> Option<&[Option<Quantity>]> {
        match self {
            Self::Polynomial(model) => Some(&model.time_constants),
            Self::StateSpace(model) => Some(&model.time_constants),
            Self::Equations(_) | Self::NonlinearArx(_) | Self::Process(_) | Self::ContinuousStateSpace(_) => {
                None
            }
        }
    }

    /// The gains of a sampled linear model for inputs that do not change, a list of the inputs' for each output; none
    /// of others.
    pub fn static_gains(&self) -> Option<Vec<&[Option<Quantity>]>> {
        match self {
            Self::Polynomial(model) => Some(vec![&model.dc_gain]),
            Self::StateSpace(model) => Some(model.dc_gain.iter().map(Vec::as_slice).collect()),
            Self::Equations(_) | Self::NonlinearArx(_) | Self::Process(_) | Self::ContinuousStateSpace(_) => {
                None
            }
        }
    }

    /// Whether it says of what colour the noise is, so that its errors one step ahead are white where it is right.
    pub fn describes_noise(&self) -> bool {
        match self {
            Self::Polynomial(model) => model.structure != Structure::Oe,
            Self::Process(_) => false,
            Self::Equations(_)
            | Self::NonlinearArx(_)
            | Self::StateSpace(_)
            | Self::ContinuousStateSpace(_) => true,
        }
    }

    /// How many parameters of the noise take correlations from the errors of several outputs: F and K of a canonical
    /// form.
    pub(crate) fn noise_parameters(&self) -> usize {
        match self {
            Self::StateSpace(model) => 2 * model.order() * model.outputs.len(),
            Self::Polynomial(_)
            | Self::Equations(_)
            | Self::NonlinearArx(_)
            | Self::Process(_)
            | Self::ContinuousStateSpace(_) => 0,
        }
    }

    /// Whether it expects errors of one size in all rows. Equations may not, and then the sizes depend on the inputs.
    pub(crate) fn expects_errors_of_one_size(&self) -> bool {
        match self {
            Self::Equations(_) => false,
            Self::Polynomial(_)
            | Self::NonlinearArx(_)
            | Self::Process(_)
            | Self::StateSpace(_)
            | Self::ContinuousStateSpace(_) => true,
        }
    }

    /// Whether it knows the plant in the range of the rows alone that it was fitted to.
    pub(crate) fn ends_with_its_range(&self) -> bool {
        match self {
            Self::NonlinearArx(_) => true,
            Self::Polynomial(_)
            | Self::Equations(_)
            | Self::Process(_)
            | Self::StateSpace(_)
            | Self::ContinuousStateSpace(_) => false,
        }
    }

    /// Whether it describes deviations from offsets. Equations describe signals as they are.
    pub fn has_offsets(&self) -> bool {
        match self {
            Self::Equations(_) => false,
            Self::Polynomial(_)
            | Self::NonlinearArx(_)
            | Self::Process(_)
            | Self::StateSpace(_)
            | Self::ContinuousStateSpace(_) => true,
        }
    }

    /// The model beside offsets that were found elsewhere: of its own it says nothing.
    pub(crate) fn without_own_offsets(&self) -> Cow<'_, Self> {
        match self {
            Self::Polynomial(model) => {
                Cow::Owned(PolynomialModel { offset_covariance: None, ..(**model).clone() }.into())
            }
            Self::Process(model) => {
                Cow::Owned(ProcessModel { offset_covariance: None, ..(**model).clone() }.into())
            }
            Self::Equations(_)
            | Self::NonlinearArx(_)
            | Self::StateSpace(_)
            | Self::ContinuousStateSpace(_) => Cow::Borrowed(self),
        }
    }

    /// By how much the sum of squared errors was divided to give the noise variance; none where that is not known.
    pub(crate) fn degrees_of_freedom(&self) -> Option<usize> {
        match self {
            Self::Polynomial(model) => model.degrees_of_freedom,
            Self::StateSpace(model) => model.degrees_of_freedom,
            Self::Equations(_) | Self::NonlinearArx(_) | Self::Process(_) | Self::ContinuousStateSpace(_) => {
                None
            }
        }
    }

    /// The recursion x(t+1) = F x + G u + K e, y = H x + D u + e of a sampled linear model.
    ///
    /// # Errors
    /// [`Error::Argument`] for others, which have none.
    pub fn innovations_form(&self) -> Result<StateSpace, Error> {
        match self {
            Self::Polynomial(model) => Ok(model.state_space()),
            Self::StateSpace(model) => Ok(model.matrices()),
            Self::ContinuousStateSpace(_) => Err(Error::argument(
                "model",
                "states are left out of sampled models, and this one is in continuous time: convert it to a sample time first",
            )),
            Self::Equations(_) | Self::NonlinearArx(_) | Self::Process(_) => Err(Error::argument(
                "model",
                format!(
                    "states are left out of models in state space and of polynomials, and this one is {}",
                    self.name()
                ),
            )),
        }
    }

    /// Zeros, poles and gain from an input to an output: in the z plane, of a model in continuous time in the s plane
    /// and without its dead time.
    ///
    /// # Errors
    /// [`Error::Argument`] for a channel that is not there, and for models that are not linear; [`Error::Undetermined`]
    /// if the zeros do not converge.
    pub fn transfer(&self, output: usize, input: usize) -> Result<ZerosPolesGain, Error> {
        match self {
            Self::ContinuousStateSpace(model) => model.transfer(output, input),
            Self::Process(model) => model.in_state_space(Hold::Zero)?.transfer(output, input),
            Self::Polynomial(_) | Self::StateSpace(_) | Self::Equations(_) | Self::NonlinearArx(_) => {
                self.innovations_form()?.transfer(output, input)
            }
        }
    }

    /// What a filter of its state runs on.
    ///
    /// # Errors
    /// As for [`linear`](Self::linear) of a process that has no transfer function; [`Error::Argument`] if a model in
    /// continuous time cannot be sampled; [`Error::Report`] if equations lack a value.
    pub(crate) fn filter_form(&self) -> Result<FilterForm<'_>, Error> {
        Ok(match self {
            Self::Polynomial(model) => FilterForm::Innovations(Box::new(model.state_space())),
            Self::Process(model) => FilterForm::Innovations(Box::new(model.linear()?.state_space())),
            Self::StateSpace(model) => FilterForm::Innovations(Box::new(model.matrices())),
            Self::ContinuousStateSpace(model) => {
                FilterForm::Innovations(Box::new(model.sampled(model.sample_time, model.hold)?.matrices()))
            }
            Self::Equations(model) => FilterForm::Equations(Box::new(model.with_values()?)),
            Self::NonlinearArx(model) => FilterForm::Lags(model),
        })
    }

    /// How inputs behave between samples; none for models that do not say, such as all in discrete time.
    pub(crate) fn own_hold(&self) -> Option<Hold> {
        match self {
            Self::ContinuousStateSpace(model) => Some(model.hold),
            Self::Polynomial(_)
            | Self::Equations(_)
            | Self::NonlinearArx(_)
            | Self::Process(_)
            | Self::StateSpace(_) => None,
        }
    }

    /// Whether it is in continuous time, whatever the sample time of its log.
    pub fn is_continuous(&self) -> bool {
        match self {
            Self::Process(_) | Self::ContinuousStateSpace(_) => true,
            Self::Polynomial(_) | Self::Equations(_) | Self::NonlinearArx(_) | Self::StateSpace(_) => false,
        }
    }

    /// The polynomials, if it is of these.
    pub fn as_polynomial(&self) -> Option<&PolynomialModel> {
        if let Self::Polynomial(model) = self { Some(model) } else { None }
    }

    /// The process, if it is one.
    pub fn as_process(&self) -> Option<&ProcessModel> {
        if let Self::Process(model) = self { Some(model) } else { None }
    }

    /// The model in state space, if it is one and sampled.
    pub fn as_state_space(&self) -> Option<&StateSpaceModel> {
        if let Self::StateSpace(model) = self { Some(model) } else { None }
    }

    /// The nonlinear ARX model, if it is one.
    pub fn as_nonlinear_arx(&self) -> Option<&NonlinearArxModel> {
        if let Self::NonlinearArx(model) = self { Some(model) } else { None }
    }

    /// What it is called, with the equation where that is short.
    pub fn headline(&self) -> String {
        match self {
            Self::Polynomial(model) => {
                let own = model.factors.as_ref().map(ArimaFactors::equation);
                format!("{}: {}", self.name(), own.unwrap_or_else(|| model.orders.equation()))
            }
            Self::Equations(_)
            | Self::NonlinearArx(_)
            | Self::Process(_)
            | Self::StateSpace(_)
            | Self::ContinuousStateSpace(_) => self.name(),
        }
    }

    /// Whether it takes logs whose clock is irregular.
    pub fn takes_any_clock(&self) -> bool {
        match self {
            Self::Equations(_) | Self::Process(_) => true,
            Self::Polynomial(_)
            | Self::NonlinearArx(_)
            | Self::StateSpace(_)
            | Self::ContinuousStateSpace(_) => false,
        }
    }

    /// What it is called: structure and orders, such as ARX(2, 2, 1), or how many states the equations have.
    pub fn name(&self) -> String {
        match self {
            Self::Polynomial(model) => match &model.factors {
                Some(factors) => factors.orders.to_string(),
                None => model.orders.to_string(),
            },
            Self::Equations(model) => {
                let count = model.states.len();
                format!("equations, {count} state{}", if count == 1 { "" } else { "s" })
            }
            Self::NonlinearArx(model) => model.name(),
            Self::Process(model) => model.name(),
            Self::StateSpace(model) => model.name(),
            Self::ContinuousStateSpace(model) => model.name(),
        }
    }

    /// The process, or a model in continuous time that is one: of one input and one output, with real poles, no zeros
    /// and no more than three lags.
    ///
    /// # Errors
    /// [`Error::Argument`] if it is none; `what` is of one.
    pub fn process(&self, what: &str) -> Result<Cow<'_, ProcessModel>, Error> {
        let found = match self {
            Self::Process(model) => Some(Cow::Borrowed(&**model)),
            Self::ContinuousStateSpace(model) => model.as_process().map(Cow::Owned),
            Self::Polynomial(_) | Self::Equations(_) | Self::NonlinearArx(_) | Self::StateSpace(_) => None,
        };
        found.ok_or_else(|| {
            let message =
                format!("it is {}, and {what} of a process: fit one (`structure` p1d)", self.name());
            Error::argument("model", message)
        })
    }

    /// The polynomials.
    ///
    /// # Errors
    /// [`Error::Argument`] if the model has none, with what it can do instead; `what` needs them.
    pub fn polynomials(&self, what: &str) -> Result<&PolynomialModel, Error> {
        match self {
            Self::Polynomial(model) => Ok(model),
            Self::Equations(_) => Err(Error::argument(
                "model",
                format!(
                    "{what} is of polynomial models, and this one is in equations: it predicts, simulates, validates, compares and \
                     filters"
                ),
            )),
            Self::NonlinearArx(model) => Err(model.is_not_linear(what)),
            Self::Process(_) => Err(Error::argument(
                "model",
                format!(
                    "{what} is of polynomial models, and this one is a process in continuous time: it predicts, simulates, validates, \
                     compares and responds to steps and sines"
                ),
            )),
            Self::StateSpace(_) | Self::ContinuousStateSpace(_) => Err(Error::argument(
                "model",
                format!(
                    "{what} is of polynomial models, and this one is in state space: it predicts, simulates, validates, compares, \
                     filters and responds to steps and sines"
                ),
            )),
        }
    }

    /// What the model is from its inputs to each of its outputs: of linear equations, and of processes whose inputs are
    /// held from sample to sample, their transfer functions.
    ///
    /// # Errors
    /// [`Error::Argument`] if it is not linear, with what it can do instead; `what` needs it to be.
    pub fn linear(&self, what: &str) -> Result<Vec<LinearModel<'_>>, Error> {
        match self {
            Self::Polynomial(model) => Ok(vec![LinearModel::Polynomial(model)]),
            Self::Equations(model) => {
                let each = model.linear(what)?.into_iter();
                Ok(each.map(|model| LinearModel::Transfer(Box::new(model))).collect())
            }
            Self::NonlinearArx(model) => Err(model.is_not_linear(what)),
            Self::Process(model) => Ok(vec![LinearModel::Transfer(Box::new(model.linear()?))]),
            Self::StateSpace(model) => {
                Ok((0..model.outputs.len()).map(|output| LinearModel::StateSpace(model, output)).collect())
            }
            Self::ContinuousStateSpace(model) => {
                Ok((0..model.outputs.len()).map(|output| LinearModel::Continuous(model, output)).collect())
            }
        }
    }

    /// Checks a model that was read: that its parts fit together, so that it can be computed with.
    pub(crate) fn check(&self) -> Result<(), Error> {
        match self {
            Self::Polynomial(model) => model.check(),
            Self::Equations(model) => model.check(),
            Self::NonlinearArx(model) => model.check(),
            Self::Process(model) => model.check(),
            Self::StateSpace(model) => model.check(),
            Self::ContinuousStateSpace(model) => model.check(),
        }
    }
}
