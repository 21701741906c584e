use super::frame::{Frame, InitialState};
use super::kind::{Kind, Motion};
use super::lags::Lags;
use super::linear::Linear;
use super::matrices;
use crate::Error;
use crate::model::{FilterForm, GreyBox, equations::Document};
use crate::report::Report;

/// A model with a state, for a [`StateFilter`](super::StateFilter).
///
/// It is a [`Report`] of a fit, in the form of
/// [`PolynomialModel::state_space`](crate::model::PolynomialModel::state_space); or a TOML file with equations (see
/// [`GreyBox`]), or with matrices:
///
/// ```text
/// x(k+1) = F x(k) + G u(k) + w(k)          w ~ (0, Q), v ~ (0, R), cov(w, v) = S
/// y(k)   = H x(k) + D u(k) + v(k)          at the first row x ~ (x0, P0)
///
/// sample_time = 1
/// states = ["level"]        # names; x1, x2 … if left out
/// inputs = []               # the channels that are the columns of G; none if left out
/// outputs = ["y"]           # the channels that are the rows of H
/// F = [[1.0]]
/// H = [[1.0]]
/// Q = [[1469.1]]
/// R = [[15099.0]]
/// x0 = [0]                  # zeros if left out
/// P0 = [[1e7]]
/// process_bound = [120]     # instead of, or beside, Q, R and P0: the largest magnitudes of w and v,
/// measurement_bound = [400] # and of x - x0 at the first row, for Estimator::Bounded
/// initial_bound = [1e4]
/// ```
///
/// Where a covariance is left out beside its bound, it is that of noise that is uniform within it: bound²/3. There is
/// also G if there are inputs, and D and S if they are not zero (G: n x inputs, D: outputs x inputs, S: n x outputs).
#[derive(Debug, Clone)]
pub struct StateModel {
    pub(super) kind: Kind,
}

impl From<(Frame, Linear)> for StateModel {
    fn from((frame, linear): (Frame, Linear)) -> Self {
        Self { kind: Kind::Sampled(Box::new(frame), Motion::Linear(Box::new(linear))) }
    }
}

impl From<(Frame, Lags)> for StateModel {
    fn from((frame, lags): (Frame, Lags)) -> Self {
        Self { kind: Kind::Sampled(Box::new(frame), Motion::Lags(Box::new(lags))) }
    }
}

impl From<GreyBox> for StateModel {
    /// Unknown noises are taken as they start: a filter does not find them.
    fn from(model: GreyBox) -> Self {
        Self { kind: Kind::Grey(Box::new(model.with_noises_as_they_start())) }
    }
}

impl StateModel {
    /// Reads a model with equations or with matrices.
    ///
    /// # Errors
    /// [`Error::Model`] with line and column, and with what is wrong there.
    ///
    /// ```
    /// use thetahat::filter::StateModel;
    ///
    /// let text = "sample_time = 1\noutputs = ['y']\nF = [[1]]\nH = [[1]]\nQ = [[0.1]]\nR = [[1, 2]]\nP0 = [[1]]";
    /// let error = StateModel::from_toml(text).unwrap_err();
    /// assert_eq!(error.to_string(), "line 6, column 1: 'R' is 1 x 2, but must be 1 x 1 (outputs x outputs)");
    /// let model = StateModel::from_toml(&text.replace("[1, 2]", "[2]"))?;
    /// assert_eq!((model.states(), model.outputs()), (["x1".to_owned()].as_slice(), ["y".to_owned()].as_slice()));
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn from_toml(text: &str) -> Result<Self, Error> {
        let document = Document::parse(text)?;
        let root = document.root();
        if ["F", "H", "P0"].iter().any(|key| root.get(key).is_some()) {
            return Ok(matrices::read(&root)?.into());
        }
        Ok(GreyBox::from_toml(text)?.into())
    }

    /// The model of a report, from what `start` says, [`InitialState::Unknown`] without: polynomials and state space in
    /// innovations form; a nonlinear ARX model with its lags as the state, as deviations from the offsets, of which an
    /// unknown start is anywhere in the range of the rows that it was fitted to. Equations are as they are, with the
    /// values that were found, from the start that they say.
    ///
    /// # Errors
    /// [`Error::Report`] if the noise variance is 0, or the numbers overflow; [`Error::Argument`] for a start of
    /// equations.
    pub fn from_report(report: &Report, start: Option<InitialState>) -> Result<Self, Error> {
        let model = &report.model;
        let from = start.unwrap_or(InitialState::Unknown);
        Ok(match model.filter_form()? {
            FilterForm::Innovations(space) => {
                Linear::of_innovations(*space, (model.inputs(), model.outputs()), from)?.into()
            }
            FilterForm::Lags(model) => Lags::of_model(model, from)?.into(),
            FilterForm::Equations(_) if start.is_some() => {
                return Err(Error::argument(
                    "initial",
                    "a model in equations says itself where its states start; leave it out, or change its text",
                ));
            }
            FilterForm::Equations(model) => (*model).into(),
        })
    }

    /// The same, and outputs that are measured with white noise of these standard deviations, in units of the outputs,
    /// beside the noise of the report that drives the plant. A nonlinear ARX model measures its outputs exactly unless
    /// it is said; other models say theirs.
    ///
    /// # Errors
    /// [`Error::Argument`] for another model, another number of outputs, or what is no deviation.
    pub fn with_measurement_noise(self, deviations: &[f64]) -> Result<Self, Error> {
        let argument = "measurement-noise";
        let Kind::Sampled(frame, Motion::Lags(lags)) = self.kind else {
            let message = "it is for reports of nonlinear ARX models: this model says its noises itself";
            return Err(Error::argument(argument, message));
        };
        let outputs = frame.names.outputs.len();
        if deviations.len() != outputs {
            let message = format!("there are {}, but the model has {outputs}", deviations.len());
            return Err(Error::argument(argument, message));
        }
        let is_wrong = |deviation: &&f64| !deviation.is_finite() || deviation.is_sign_negative();
        if let Some(wrong) = deviations.iter().find(is_wrong) {
            return Err(Error::argument(argument, format!("{wrong} is no standard deviation")));
        }
        let variances: Vec<f64> = deviations.iter().map(|deviation| deviation * deviation).collect();
        let frame = frame.with_output_variances(variances.into());
        Ok((frame.map_err(|error| Error::argument(argument, error.to_string()))?, *lags).into())
    }

    /// The names of the states.
    pub fn states(&self) -> &[String] {
        match &self.kind {
            Kind::Grey(grey) => grey.states(),
            Kind::Sampled(frame, _) => &frame.names.states,
        }
    }

    /// The channels of the inputs.
    pub fn inputs(&self) -> &[String] {
        match &self.kind {
            Kind::Grey(grey) => grey.inputs(),
            Kind::Sampled(frame, _) => &frame.names.inputs,
        }
    }

    /// The channels of the outputs.
    pub fn outputs(&self) -> &[String] {
        match &self.kind {
            Kind::Grey(grey) => grey.outputs(),
            Kind::Sampled(frame, _) => &frame.names.outputs,
        }
    }

    /// The names of the unknown parameters.
    pub fn unknown(&self) -> impl ExactSizeIterator<Item = &str> {
        let parameters = match &self.kind {
            Kind::Sampled(..) => &[],
            Kind::Grey(grey) => grey.parameters(),
        };
        parameters.iter().map(|parameter| parameter.name.as_str())
    }

    /// How the unknown parameters are kept within their bounds, in words, such as `mass = 0.1 + exp(z)`; none for one
    /// without bounds.
    pub fn changes_of_variable(&self) -> impl ExactSizeIterator<Item = Option<String>> {
        let parameters = match &self.kind {
            Kind::Sampled(..) => &[],
            Kind::Grey(grey) => grey.parameters(),
        };
        parameters.iter().map(|parameter| parameter.change_of_variable())
    }

    /// The length of a sample, in seconds.
    pub fn sample_time(&self) -> f64 {
        match &self.kind {
            Kind::Sampled(frame, _) => frame.names.sample_time,
            Kind::Grey(grey) => grey.sample_time(),
        }
    }

    /// Whether it is linear in its state and has no unknown parameters, so that
    /// [`Estimator::Kalman`](super::Estimator::Kalman) is exact.
    pub fn is_linear(&self) -> bool {
        match &self.kind {
            Kind::Sampled(_, motion) => matches!(motion, Motion::Linear(_)),
            Kind::Grey(grey) => grey.is_linear(),
        }
    }
}
