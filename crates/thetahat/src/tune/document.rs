//! The document.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Document;
use crate::document::document_methods;

/// Settings of controllers for a process, and what the loops with them do. The JSON document `thetahat.tuning/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Tuning {
    /// `thetahat.tuning/1`.
    pub schema: String,
    /// The program and version that wrote it.
    pub generator: String,
    /// What the process is called.
    pub model: String,
    /// The input that the controller moves.
    pub input: String,
    /// The output that it holds.
    pub output: String,
    /// The settings, by rule and controller.
    pub settings: Vec<ControllerSettings>,
    /// What a careful reader should know, in plain words.
    pub warnings: Vec<String>,
}

/// The settings of a controller, u = Kc (e + 1/Ti int e dt + Td de/dt), by one rule.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ControllerSettings {
    /// The rule.
    pub rule: Rule,
    /// The controller.
    pub controller: Controller,
    /// The process that the rule sees.
    pub process: ReducedProcess,
    /// The time constant that the loop shall have, in seconds: tau_c or lambda.
    pub closed_loop_time: f64,
    /// Kc, in units of the input per unit of the output.
    pub gain: f64,
    /// Ti, in seconds.
    pub integral_time: f64,
    /// Td, in seconds; 0 of a PI.
    pub derivative_time: f64,
    /// What the loop with the fitted process does.
    pub closed_loop: ClosedLoop,
}

/// K e^(-theta s)/((1 + tau1 s)(1 + tau2 s)), or K e^(-theta s)/(s (1 + tau2 s)).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ReducedProcess {
    /// K, in units of the output per unit of the input, of an integrating process per second.
    pub gain: f64,
    /// tau1, in seconds; none of an integrating process.
    pub time_constant: Option<f64>,
    /// tau2, in seconds; 0 where the rule has none.
    pub second_time_constant: f64,
    /// theta, in seconds.
    pub dead_time: f64,
}

/// How settings are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Rule {
    /// Skogestad's rules (J. Process Control 13 (2003)): the loop follows like 1/(1 + tau_c s) e^(-theta s), and Ti is
    /// no longer than 4 (tau_c + theta), so that loads are taken away soon.
    Simc,
    /// Lambda tuning (Dahlin 1968; Åström and Hägglund, Advanced PID Control, 2006, section 6.5): the same with Ti =
    /// tau1.
    Lambda,
}

/// Which controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Controller {
    /// Proportional and integral.
    Pi,
    /// With a derivative too.
    Pid,
}

/// What a loop does, by the fitted process and not by the reduced one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ClosedLoop {
    /// Whether all of its poles are stable: whether the step settles.
    pub stable: bool,
    /// Seconds from 10 % to 90 % of a step of the set point; none where it does not get there.
    pub rise_time: Option<f64>,
    /// The part of the step by which the output goes beyond it; none of an unstable loop.
    pub overshoot: Option<f64>,
    /// Seconds after which the output stays within 2 % of the step; none where it does not.
    pub settling_time: Option<f64>,
    /// Ms, the largest of 1/|1 + L|: by so much noise and modelling errors grow at worst. 1.2 to 2 is usual.
    pub peak_sensitivity: f64,
    /// By how much the gain may grow before the loop is unstable; none where no gain does that.
    pub gain_margin: Option<f64>,
    /// By how many degrees the phase may fall; none where |L| does not cross 1.
    pub phase_margin: Option<f64>,
    /// The integral of the absolute error after a step of 1 at the input of the process; none of an unstable loop.
    pub load_absolute_error: Option<f64>,
    /// The largest Ms where each parameter, and the directions in which they are least certain together, lie at the
    /// ends of their 95 % intervals; none where no standard errors are known, and where the loop is not stable at one
    /// of these ends.
    pub worst_peak_sensitivity: Option<f64>,
    /// Seconds, of the responses.
    pub time: Vec<f64>,
    /// The output after a step of the set point by 1.
    pub setpoint_response: Vec<f64>,
    /// What the controller does then.
    pub controller_output: Vec<f64>,
    /// The output after a step of 1 at the input of the process.
    pub load_response: Vec<f64>,
}

impl Rule {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Simc => "SIMC",
            Self::Lambda => "lambda",
        }
    }
}

impl Controller {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pi => "PI",
            Self::Pid => "PID",
        }
    }
}

impl Document for Tuning {
    const NAME: &'static str = "tuning";
    const SCHEMA: &'static str = "thetahat.tuning/1";
    const REMEDY: &'static str = "give a file that tune wrote";

    document_methods!();
}
