//! The document.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::RstController;
use thetahat_core::nalgebra::{DVector, Dyn};

use crate::document::document_methods;
use crate::model::{Root, Signal};
use crate::{Document, Error};

/// A controller for a model, and the loop that it gives. The JSON document `thetahat.control/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Control {
    /// `thetahat.control/1`.
    pub schema: String,
    /// The program and version that wrote it.
    pub generator: String,
    /// What the model is called.
    pub model: String,
    /// How it was designed, in a sentence.
    pub design: String,
    /// The input that the controller moves, with the working point that its deviations are from.
    pub input: Signal,
    /// The output that it holds, likewise.
    pub output: Signal,
    /// Seconds from one sample to the next.
    pub sample_time: f64,
    /// The controller.
    pub controller: Polynomials,
    /// K of u = -K x, of the linear-quadratic designs: the state is that of the controllable form, x_i(t) = w(t-i) with
    /// A(q) w = q^-1 u and y = b_1 x_1 + b_2 x_2 + …; with an integrator of A (1 - q^-1), and u is its change.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub state_feedback: Option<Vec<f64>>,
    /// What the loop with the model does.
    pub closed_loop: Loop,
    /// How it bears what the model does not know; none where the covariance of the parameters is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robustness: Option<Robustness>,
    /// What a careful reader should know, in plain words.
    pub warnings: Vec<String>,
}

/// R(q) u(t) = T(q) u_c(t) - S(q) y(t), coefficients in rising powers of q^-1. Beyond its limits A_o v = T u_c - S y +
/// (A_o - R) u, u = v within them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Polynomials {
    /// R, monic.
    pub r: Vec<f64>,
    /// S.
    pub s: Vec<f64>,
    /// T = t_0 A_o.
    pub t: Vec<f64>,
    /// A_o, monic.
    pub observer: Vec<f64>,
    /// t_0.
    pub gain: f64,
    /// The lowest input, as a deviation; none where there is no limit.
    pub lowest: Option<f64>,
    /// The highest input, likewise.
    pub highest: Option<f64>,
}

/// What a loop does, in deviations from the working point and without limits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Loop {
    /// The roots of A R + B S, the largest first.
    pub poles: Vec<Root>,
    /// Whether all of them lie inside the unit circle.
    pub stable: bool,
    /// Ms, the largest of 1/|1 + L|, L = B S/(A R): by so much noise and errors of the model grow at worst. 1.2 to 2 is
    /// usual.
    pub peak_sensitivity: f64,
    /// Mt, the largest of |L/(1 + L)|.
    pub peak_complementary_sensitivity: f64,
    /// By how much the gain may grow before the loop is unstable; none where no gain does that.
    pub gain_margin: Option<f64>,
    /// By how many degrees the phase may fall; none where |L| does not cross 1.
    pub phase_margin: Option<f64>,
    /// What becomes of a set point that stays, 1 where the loop has no error.
    pub static_gain: f64,
    /// Seconds from 10 % to 90 % of a step of the set point; none where it does not get there.
    pub rise_time: Option<f64>,
    /// The part of the step by which the output goes beyond it.
    pub overshoot: Option<f64>,
    /// Seconds after which the output stays within 2 % of where it ends; none where it does not.
    pub settling_time: Option<f64>,
    /// The standard deviation of the output under the noise of the model; none where the model says nothing of it.
    pub output_deviation: Option<f64>,
    /// That of the input.
    pub input_deviation: Option<f64>,
    /// Seconds, of the responses.
    pub time: Vec<f64>,
    /// The output after a step of the set point by 1.
    pub setpoint_response: Vec<f64>,
    /// What the controller does then.
    pub controller_output: Vec<f64>,
    /// The output after a step of 1 at the input of the plant.
    pub load_response: Vec<f64>,
}

/// The same controller with models of parameters drawn from the normal distribution of the estimate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Robustness {
    /// How many.
    pub draws: usize,
    /// The share of them whose loop is stable.
    pub stable_share: f64,
    /// What the peak of the sensitivity is below for 95 % of them; none where more than 5 % are unstable.
    pub peak_sensitivity_95: Option<f64>,
}

impl Control {
    /// The controller, at rest, as the core runs it.
    ///
    /// # Errors
    /// [`Error::Report`] where the coefficients are not finite or do not begin with 1.
    pub fn controller(&self) -> Result<RstController<f64, Dyn>, Error> {
        let own = &self.controller;
        let wrong =
            |what: &str| Error::report(format!("controller.{what}; the document was edited or damaged"));
        let rest = |name: &str, values: &[f64]| match values {
            [1.0, rest @ ..] => Ok(rest.to_vec()),
            _ => Err(wrong(&format!("{name} does not begin with 1"))),
        };
        let (r, observer) = (rest("r", &own.r)?, rest("observer", &own.observer)?);
        let size = r.len().max(own.s.len()).max(observer.len()).max(1);
        let filled =
            |values: &[f64]| DVector::from_fn(size, |place, _| values.get(place).copied().unwrap_or(0.0));
        let limits = own.lowest.unwrap_or(f64::NEG_INFINITY)..=own.highest.unwrap_or(f64::INFINITY);
        RstController::new(own.gain, filled(&r), filled(&own.s), filled(&observer))
            .and_then(|controller| controller.with_limits(limits))
            .map_err(|error| wrong(&error.to_string()))
    }
}

impl Document for Control {
    const NAME: &'static str = "controller";
    const SCHEMA: &'static str = "thetahat.control/1";
    const REMEDY: &'static str = "give a file that control wrote";

    document_methods!();

    fn check(&self) -> Result<(), Error> {
        if !(self.sample_time > 0.0 && self.sample_time.is_finite()) {
            return Err(Error::report(
                "sample_time is not a positive number; the document was edited or damaged",
            ));
        }
        self.controller().map(|_| ())
    }
}
