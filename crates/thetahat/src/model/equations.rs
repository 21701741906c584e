//! Models of a plant in equations, written by hand in a TOML file, with exact derivatives.

mod branch;
mod channels;
mod document;
mod drive;
mod dynamics;
mod exact;
mod expression;
mod figures;
mod fitted;
mod graph;
mod interpolation;
mod linear;
mod linearized;
mod noise;
mod parameter;
mod program;
mod read;
mod scale;
mod table;
#[cfg(test)]
pub(crate) mod tests;

pub(crate) use channels::{ChannelExpression, ExpressionBuffer};
pub(crate) use document::{Document, Entry, Section, suggestion, toml_text};
pub(crate) use drive::Drive;
use dynamics::Functions;
pub(crate) use dynamics::{Step, Work};
pub use figures::DerivedFigure;
use figures::Figures;
pub use fitted::EquationsModel;
pub(crate) use graph::{Function, Operation};
use linearized::Entrances;
pub(crate) use linearized::{Entrance, Linearized};
use noise::Noise;
pub(crate) use parameter::Unknown;
pub(crate) use program::Program;
pub(crate) use scale::Scale;
pub(crate) use table::Table;

use crate::Error;

/// A model in equations, of which some parameters may be unknown.
///
/// ```text
/// x(k+1) = f(x(k), p, u(k), t, dt) + w(k)      or      dx/dt = f(x, p, u, t)
/// y(k)   = h(x(k), p, u(k), t) + v(k)
/// ```
///
/// It is written as TOML:
///
/// ```text
/// sample_time = 0.1                  # seconds
///
/// [states]                           # what is known of each at the first row; sd = 0: exactly that
/// position = { start = 0, sd = 1 }
/// velocity = { start = 0, sd = 1 }
///
/// [inputs]                           # name in the equations = channel of the log
/// force = "u"
///
/// [parameters]                       # a number, or what is known of an unknown one
/// mass = { start = 2, sd = 1, unknown = true, min = 0.1 }
/// damping = 0.4
///
/// [signals]                          # names for expressions, if there are any
/// friction = "damping * velocity"
///
/// [next]                             # or [derivative]
/// position = "position + dt * velocity"
/// velocity = "velocity + dt * (force - friction) / mass"
///
/// [outputs]                          # channel of the log = expression
/// y = "position"
///
/// [noise]                            # standard deviations: of a sample, of a measurement
/// process = { velocity = 0.01 }
/// measurement = { y = 0.05 }
/// ```
///
/// **Expressions** have numbers, the names of states, inputs and parameters, `+ - * / ^` and parentheses, `sin cos tan
/// asin acos atan sinh cosh tanh exp ln log10 sqrt abs sign` of one argument and `atan2 min max` of two, `pi`, and `t`,
/// the seconds since the first row. Angles are in rad. `-x^2` is `-(x^2)`, `x^y^z` is `x^(y^z)`. A power whose exponent
/// is no constant is `exp(y ln x)`, so x must be positive. Where `min`, `max`, `abs` or `sign` has no derivative, it is
/// that of one side.
///
/// **Branches.** `if a > b then c else d`, with `<`, `<=`, `>` or `>=`, is one of both; what follows `else` goes as far
/// as the expression does. `and`, `or` and `not` join comparisons, in parentheses or not: `if a > b and not c > d then
/// …`. `sat(x, low, high)` keeps x between two limits, `dead(x, low, high)` is 0 between them, x - low below and x -
/// high above. A width makes them smooth: `if a > b within w then c else d` is (c + d)/2 + (c - d)/2 tanh((a - b)/w),
/// of one comparison, `max(x, 0 within w)` is (x + √(x² + w²))/2, and `abs(x within w)` is √(x² + w²); `min`, `sat` and
/// `dead` are made of the same `max`. The width is a number above 0, and may be a parameter.
///
/// **Tables.** `table(x; 0:3.2, 0.5:3.65, 1:4.1)` goes through values at knots that rise, by cubic polynomials that
/// rise and fall where the values do (Fritsch and Carlson 1980, with the slopes of Fritsch and Butland 1984: PCHIP),
/// and `lines(x; 0:3.2, 1:4.1)` by straight lines. Beyond the ends both are held. A value may be made of parameters,
/// unknown ones too.
///
/// **Time.** `[next]` gives the next state. With `dt`, the seconds of a step, in its equations the steps may vary, else
/// each is one `sample_time`. `[derivative]` gives dx/dt; where it is linear in states and inputs and does not know the
/// time, the step is exact. Else it is integrated by the classical Runge-Kutta method of order four in one step from
/// row to row, or in `substeps` of them. A step of several sample times is taken as that many equal steps, so that a
/// missing row does no harm.
///
/// **Inputs** are held from row to row, or go in straight lines to the next with `force = { channel = "u", hold =
/// "linear" }`, which needs `[derivative]`. `force(t - delay)` is an input so many seconds ago, with a delay that is a
/// number or made of parameters; one that is held is then taken as its mean over the step.
///
/// **Noise.** `process` is what a sample of length `sample_time` adds to the state: its variance grows with the length
/// of the step, sd² dt/sample_time. A state that is not named has none. An exact step takes it as white noise of the
/// intensity sd²/sample_time that acts all the time; else it is added at the end of the step. `measurement` is the
/// standard deviation of each output. Each is a number; an expression of states, inputs, parameters and `t`; or
/// unknown, `{ start = 0.1, unknown = true }`, and then a parameter by the name of `process.velocity` or
/// `measurement.y`, above 0 unless `min` says other. `start` and `sd` of a state may be expressions of parameters.
///
/// **Unknown parameters** have a `start`, the standard deviation `sd` of what is known of it, and perhaps bounds `min`
/// and `max`, between which a change of variable keeps them: p = min + exp(z), p = max - exp(z), or p = min + (max -
/// min)/(1 + exp(-z)), with z free. `walk` is the standard deviation by which such a parameter drifts each
/// `sample_time`.
///
/// **Figures.** `[figures]` has expressions of parameters, and of figures above, which a fit reports with their
/// standard errors: `time_constant = "capacity / loss"`, or with a unit `{ value = "capacity / loss", unit = "s" }`.
/// Those whose names begin with `_` only serve others. A parameter may have a `unit` too.
///
/// All equations are compiled once into one list of operations in which nothing is computed twice, together with all
/// partial derivatives, found by the rules of calculus. Nothing is approximated by differences.
///
/// ```
/// use thetahat::model::GreyBox;
///
/// let model = GreyBox::from_toml(
///     "sample_time = 60
///      [states]
///      temperature = { start = 20, sd = 5 }
///      [inputs]
///      power = \"heater\"
///      [parameters]
///      resistance = { start = 0.01, sd = 0.005, unknown = true, min = 0 }
///      capacity = 4e5
///      [derivative]
///      temperature = \"(power - (temperature - 20) / resistance) / capacity\"
///      [outputs]
///      thermometer = \"temperature\"
///      [noise]
///      measurement = { thermometer = 0.1 }",
/// )?;
/// assert_eq!(model.states(), ["temperature"]);
/// assert_eq!(model.inputs(), ["heater"]);
/// assert_eq!(model.unknown().collect::<Vec<_>>(), ["resistance"]);
///
/// let error = GreyBox::from_toml("sample_time = 1\n[states]\nx = { start = 0 }").unwrap_err();
/// assert!(error.to_string().starts_with("line 3, column 1: 'states.x.sd' is missing"));
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct GreyBox {
    text: String,
    sample_time: f64,
    states: Vec<String>,
    inputs: Vec<String>,
    outputs: Vec<String>,
    unknown: Vec<Unknown>,
    /// Unknown ones that are known by now.
    known: Vec<(String, f64)>,
    step: Step,
    /// Whether the equations know the length of a step.
    any_step: bool,
    /// Which inputs go from row to row in straight lines; empty where none does.
    linear_holds: Vec<bool>,
    /// Whether the equations of the states are other ones at the end of a step: for an input that goes in a line.
    bends: bool,
    /// The longest delay of each input, in seconds, with parameters as they start; none of one that acts at once.
    delays: Vec<Option<f64>>,
    linear: bool,
    superposes: bool,
    /// Whether derivatives by the states are the same in all states, with all inputs and at all times.
    is_affine_in_states: bool,
    transition: Functions,
    observation: Functions,
    entrances: Entrances,
    noise: Noise,
    figures: Figures,
}

/// The most equal steps that one step is divided into.
pub(crate) const MOST_STEPS: f64 = 1e6;

impl GreyBox {
    /// Reads a model.
    ///
    /// # Errors
    /// [`Error::Model`] with line and column, and with what is wrong there: of the TOML, of a key, or of an expression.
    pub fn from_toml(text: &str) -> Result<Self, Error> {
        read::model(text, &[])
    }

    /// The same with some unknown parameters known: for what a fit has found.
    ///
    /// # Errors
    /// [`Error::Argument`] if the model has no unknown parameter of a name, a value is outside its bounds or not
    /// finite.
    pub fn with_parameters(&self, values: &[(&str, f64)]) -> Result<Self, Error> {
        for (name, value) in values {
            let Some(unknown) = self.unknown.iter().find(|unknown| unknown.name == *name) else {
                let near = suggestion(name, self.unknown());
                return Err(Error::argument(name, format!("the model has no such unknown parameter{near}")));
            };
            if !unknown.may_be(*value) {
                return Err(Error::argument(name, format!("{value} is outside of the parameter's bounds")));
            }
        }
        let mut known = self.known.clone();
        known.extend(values.iter().map(|(name, value)| ((*name).to_owned(), *value)));
        read::model(&self.text, &known)
    }

    /// The same with what only noises depend on known, as it starts.
    pub(crate) fn with_noises_as_they_start(self) -> Self {
        let of_noise = self.unknown.iter().filter(|unknown| unknown.of_noise);
        let starts: Vec<(&str, f64)> =
            of_noise.map(|unknown| (unknown.name.as_str(), unknown.start)).collect();
        // The text was read with other values before.
        let known = if starts.is_empty() { None } else { self.with_parameters(&starts).ok() };
        known.unwrap_or(self)
    }

    /// Those of the unknown parameters that were given values.
    pub fn known(&self) -> &[(String, f64)] {
        &self.known
    }

    /// The text that it was read from.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The length of a sample, in seconds.
    pub fn sample_time(&self) -> f64 {
        self.sample_time
    }

    /// The names of the states, in the order of the text.
    pub fn states(&self) -> &[String] {
        &self.states
    }

    /// The channels of the inputs, in the order of the text.
    pub fn inputs(&self) -> &[String] {
        &self.inputs
    }

    /// The channels of the outputs, in the order of the text.
    pub fn outputs(&self) -> &[String] {
        &self.outputs
    }

    /// The names of the unknown parameters, in the order of the text.
    pub fn unknown(&self) -> impl ExactSizeIterator<Item = &str> {
        self.unknown.iter().map(|unknown| unknown.name.as_str())
    }

    /// Whether the derivatives by the states depend on neither states nor unknown parameters.
    pub fn is_linear(&self) -> bool {
        self.linear
    }

    /// Whether what several inputs do adds up, at any time: the equations are linear in states and inputs together, and
    /// do not know the time. Unknown parameters may stand anywhere in them.
    pub fn superposes(&self) -> bool {
        self.superposes
    }

    /// Which inputs go from row to row in straight lines; empty where none does.
    pub(crate) fn linear_holds(&self) -> &[bool] {
        &self.linear_holds
    }

    /// The longest delay of an input, in seconds, with parameters as they start; none without delays.
    pub(crate) fn longest_delay(&self) -> Option<f64> {
        self.delays.iter().copied().flatten().reduce(f64::max)
    }

    /// That of each input; none of one that acts at once.
    pub(crate) fn delays(&self) -> Vec<Option<f64>> {
        self.delays.clone()
    }

    /// What is known of the unknown parameters, and their changes of variable.
    pub(crate) fn parameters(&self) -> &[Unknown] {
        &self.unknown
    }

    /// How a step of `dt` seconds is taken: as this many equal ones, and the length of each.
    ///
    /// # Errors
    /// [`Error::Data`] if it is not above 0 or too long; if the equations do not know its length, and it is no whole
    /// multiple of the sample time within 1 %.
    pub(crate) fn division(&self, dt: f64) -> Result<(usize, f64), Error> {
        if self.any_step {
            let count = (check_step(dt)? / self.sample_time).round().max(1.0);
            Ok((check_count(count, dt, self.sample_time)?, dt / count))
        } else {
            Ok((whole_steps(dt, self.sample_time)?, self.sample_time))
        }
    }
}

fn check_step(dt: f64) -> Result<f64, Error> {
    if dt > 0.0 && dt.is_finite() {
        Ok(dt)
    } else {
        Err(Error::data(format!("a step of {dt} s: time must rise from row to row")))
    }
}

fn check_count(count: f64, dt: f64, sample_time: f64) -> Result<usize, Error> {
    if count <= MOST_STEPS {
        Ok(count as usize)
    } else {
        Err(Error::data(format!(
            "a step of {dt} s is more than {MOST_STEPS} times the model's sample time of {sample_time} s; begin again after \
             such a gap"
        )))
    }
}

/// A step as a whole number of sample times, which it must be within 1 %.
///
/// # Errors
/// [`Error::Data`] if it is not, or there are more than a million.
pub(crate) fn whole_steps(dt: f64, sample_time: f64) -> Result<usize, Error> {
    let count = (check_step(dt)? / sample_time).round();
    if count < 1.0 || (dt / (count * sample_time) - 1.0).abs() > 0.01 {
        return Err(Error::data(format!(
            "a step of {dt} s is no whole multiple of the model's sample time of {sample_time} s; resample the log, or write \
             the model in equations with dt or [derivative]"
        )));
    }
    check_count(count, dt, sample_time)
}
