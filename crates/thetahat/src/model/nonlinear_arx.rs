//! Nonlinear ARX models: y(t) = g(phi(t)) + e(t).

mod evaluator;
mod functions;
mod map;
mod terms;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub(crate) use evaluator::Evaluator;
pub use functions::Functions;
pub use map::{Activation, Map, Membership};

use super::equations::ChannelExpression;
use super::orders::lag_name;
use super::{Orders, Parameter, Signal, is_covariance};
use crate::Error;

/// A nonlinear ARX model: for each output i
///
/// ```text
/// y_i(t) = s_i g_i(z(t)) + e_i(t),   z_r(t) = x_r(t - l_r)/s_r,   g_i(z) = sum_j theta_j f_j(z)
/// ```
///
/// where x_r is an output, an input, or an expression of them, as a deviation from its offset, l_r a lag, s_r the scale
/// of that channel, s_i that of the output, and f_j the functions of its [`Map`] (Ljung, System Identification, 2nd ed.
/// 1999, section 5.4). Scales and offsets come from the rows of the estimation, so that z has about the size of 1. All
/// maps read the same z.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NonlinearArxModel {
    /// Seconds from one sample to the next.
    pub sample_time: f64,
    /// The inputs.
    pub inputs: Vec<Signal>,
    /// The outputs.
    pub outputs: Vec<Signal>,
    /// Expressions of inputs and outputs that are read like these, such as sqrt(u). The name of each is its text; it is
    /// of the values of the channels in their own units.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub expressions: Vec<Signal>,
    /// z, in its order.
    pub regressors: Vec<Regressor>,
    /// g and s of each output.
    pub maps: Vec<OutputMap>,
    /// The covariance of e, row by row: the sums of products of residuals over N - p, with the root of both N - p where
    /// these differ.
    pub noise_covariance: Vec<Vec<f64>>,
    /// N - p of the output with most parameters, the degrees of freedom of `noise_covariance`.
    pub degrees_of_freedom: Option<usize>,
    /// theta, one for each function of each map, in the order of `covariance`.
    pub parameters: Vec<Parameter>,
    /// The covariance matrix of the parameters, row by row; none where no theory gives one. Of one map that was
    /// trained, rows of the numbers of its functions come after them: alpha and 1/sigma of each radial basis function,
    /// or w and b of each unit. It is approximate then: that of Gauss and Newton with white errors.
    pub covariance: Option<Vec<Vec<f64>>>,
}

/// What a nonlinear ARX model says of one of its outputs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OutputMap {
    /// s, in units of the output.
    pub scale: f64,
    /// The least and the largest output of the estimation rows, as deviations from the offset.
    pub range: [f64; 2],
    /// The functions f.
    pub functions: Map,
    /// The errors of runs over rows that were held out, in rising order of how long ago they began; none where no rows
    /// were.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub run_errors: Vec<RunError>,
}

/// How far runs were off that began at what was measured so many samples before.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RunError {
    /// Samples from the last measured output to the one that is predicted.
    pub steps: usize,
    /// The root mean square of the errors, in units of the output.
    pub rmse: f64,
}

impl OutputMap {
    /// The root mean square error of runs of so many samples, between those that were measured by the logarithm of
    /// their length, and beyond the longest that of the longest; none where no rows were held out.
    ///
    /// ```
    /// use thetahat::model::{Map, OutputMap, RunError};
    ///
    /// let run_errors = vec![RunError { steps: 1, rmse: 0.1 }, RunError { steps: 100, rmse: 0.5 }];
    /// let functions = Map::Polynomial { terms: Vec::new() };
    /// let map = OutputMap { scale: 1.0, range: [0.0; 2], functions, run_errors };
    /// assert!((map.run_error(10).unwrap() - 0.3).abs() < 1e-12);
    /// assert_eq!((map.run_error(1), map.run_error(1000)), (Some(0.1), Some(0.5)));
    /// ```
    pub fn run_error(&self, steps: usize) -> Option<f64> {
        let after = self.run_errors.partition_point(|error| error.steps < steps);
        match (after.checked_sub(1).map(|before| self.run_errors[before]), self.run_errors.get(after)) {
            (Some(before), Some(after)) => {
                let log = |steps: usize| (steps as f64).ln();
                let share = (log(steps) - log(before.steps)) / (log(after.steps) - log(before.steps));
                Some(before.rmse + share * (after.rmse - before.rmse))
            }
            (before, after) => after.copied().or(before).map(|error| error.rmse),
        }
    }
}

/// A lag of a channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Regressor {
    /// The channel: an output, an input, or an expression.
    pub channel: String,
    /// How many samples before the output it is read.
    pub lag: usize,
    /// What it is divided by, in units of the channel.
    pub scale: f64,
    /// Its least and its largest value in the estimation rows, as deviations from the channel's offset.
    pub range: [f64; 2],
}

impl Regressor {
    /// Such as y(k-1), or u(k) without a lag.
    pub fn name(&self) -> String {
        lag_name(&self.channel, self.lag)
    }
}

impl NonlinearArxModel {
    /// What regressors read: outputs, inputs, expressions.
    pub(crate) fn signals(&self) -> impl Iterator<Item = &Signal> {
        self.outputs.iter().chain(&self.inputs).chain(&self.expressions)
    }

    /// Which of [`signals`](Self::signals) each regressor reads.
    pub(crate) fn sources(&self) -> Vec<usize> {
        let place = |regressor: &Regressor| {
            self.signals().position(|signal| signal.name == regressor.channel).unwrap_or(0)
        };
        self.regressors.iter().map(place).collect()
    }

    /// The expressions, which read channels by their places among outputs and inputs.
    ///
    /// # Errors
    /// What is wrong with one, in words.
    pub(crate) fn read_expressions(&self) -> Result<Vec<ChannelExpression>, String> {
        let names: Vec<&str> =
            self.outputs.iter().chain(&self.inputs).map(|signal| signal.name.as_str()).collect();
        let each = self.expressions.iter();
        each.map(|expression| ChannelExpression::read(&expression.name, &names)).collect()
    }

    /// Whether anything but outputs is read.
    pub(crate) fn is_driven(&self) -> bool {
        let of_outputs = self.outputs.len();
        // Names that are refused are told where a model is checked.
        let expressions = self.read_expressions().unwrap_or_default();
        let driven = |source: usize| match source.checked_sub(of_outputs + self.inputs.len()) {
            Some(place) => expressions
                .get(place)
                .is_some_and(|one| one.channels().iter().any(|channel| *channel >= of_outputs)),
            None => source >= of_outputs,
        };
        self.sources().into_iter().any(driven)
    }

    /// The model of one of its outputs, to which the others are inputs.
    ///
    /// # Errors
    /// [`Error::Argument`] for an output that is not there.
    pub fn of_output(&self, output: usize) -> Result<Self, Error> {
        let (Some(signal), Some(map)) = (self.outputs.get(output), self.maps.get(output)) else {
            let message =
                format!("{output} is none of the {} outputs, which are counted from 0", self.outputs.len());
            return Err(Error::argument("output", message));
        };
        if self.outputs.len() == 1 {
            return Ok(self.clone());
        }
        let others = self.outputs.iter().filter(|other| *other != signal);
        let own = self.places().get(output).cloned().unwrap_or_default();
        let own = own.start.min(self.parameters.len())..own.end.min(self.parameters.len());
        let mut parameters = self.parameters[own.clone()].to_vec();
        for parameter in &mut parameters {
            if let Some(name) = parameter.name.strip_prefix(&format!("{}: ", signal.name)) {
                parameter.name = name.to_owned();
            }
        }
        let covariance = self.covariance.as_ref();
        let covariance =
            covariance.map(|rows| rows[own.clone()].iter().map(|row| row[own.clone()].to_vec()).collect());
        let variance = self.noise_covariance.get(output).and_then(|row| row.get(output)).copied();
        Ok(Self {
            sample_time: self.sample_time,
            inputs: self.inputs.iter().chain(others).cloned().collect(),
            outputs: vec![signal.clone()],
            expressions: self.expressions.clone(),
            regressors: self.regressors.clone(),
            maps: vec![map.clone()],
            noise_covariance: vec![vec![variance.unwrap_or(0.0)]],
            degrees_of_freedom: self.degrees_of_freedom,
            parameters,
            covariance,
        })
    }

    /// The model of a single output as such.
    ///
    /// # Errors
    /// [`Error::Report`] where it has several; `what` is of one.
    pub fn single(&self, what: &str) -> Result<(&Signal, &OutputMap), Error> {
        match (&*self.outputs, &*self.maps) {
            ([output], [map]) => Ok((output, map)),
            _ => Err(Error::report(format!(
                "{what} is of one output, and the model of the report has {}; fit each of them alone, the others being inputs",
                self.outputs.len()
            ))),
        }
    }

    /// Its lags as the orders of an ARX model with one output: na of the output, and nb of each input from nk on.
    ///
    /// # Errors
    /// [`Error::Report`] where there are several outputs, or regressors are not lags in a row, each channel with one
    /// scale.
    pub fn lag_orders(&self) -> Result<Orders, Error> {
        let (_, map) = self.single("a recursion")?;
        if let Some(expression) = self.expressions.first() {
            return Err(Error::report(format!(
                "the model of the report reads {}, and a recursion only channels; write its values into the log as a column, and fit with \
                 that as an input",
                expression.name
            )));
        }
        let sources = self.sources();
        let of = |source: usize| {
            let own = sources.iter().zip(&self.regressors).filter(move |(other, _)| **other == source);
            own.map(|(_, regressor)| (regressor.lag, regressor.scale)).collect::<Vec<(usize, f64)>>()
        };
        let channels: Vec<Vec<(usize, f64)>> = (0..=self.inputs.len()).map(of).collect();
        let firsts: Vec<usize> =
            channels.iter().map(|lags| lags.first().map_or(1, |(first, _)| *first)).collect();
        let in_a_row = |(lags, first): (&Vec<(usize, f64)>, &usize)| {
            lags.iter().enumerate().all(|(at, (lag, scale))| *lag == first + at && *scale == lags[0].1)
        };
        let of_output = channels[0].iter().all(|(_, scale)| *scale == map.scale) && firsts[0] == 1;
        if !sources.is_sorted() || !of_output || !channels.iter().zip(&firsts).all(in_a_row) {
            return Err(Error::report(
                "the regressors of the report are not lags in a row, each channel with one scale; they cannot be tracked",
            ));
        }
        let counts: Vec<usize> = channels.iter().map(Vec::len).collect();
        Orders::arx(counts[0], &counts[1..], &firsts[1..])
    }

    /// The longest lag of any channel.
    pub(crate) fn lags(&self) -> usize {
        self.regressors.iter().map(|regressor| regressor.lag).max().unwrap_or(0)
    }

    /// The parameters of each map, by their places.
    pub(crate) fn places(&self) -> Vec<std::ops::Range<usize>> {
        let regressors = self.regressors.len();
        let each = self.maps.iter().scan(0, |first, map| {
            let end = *first + map.functions.parameters(regressors);
            Some(std::mem::replace(first, end)..end)
        });
        each.collect()
    }

    /// Such as NARX polynomial, 8 terms; of several outputs with what each has.
    pub(crate) fn name(&self) -> String {
        let regressors = self.regressors.len();
        let described = |map: &OutputMap| map.functions.describe(map.functions.parameters(regressors));
        match &*self.maps {
            [map] => format!("NARX {}", described(map)),
            maps => {
                let each: Vec<String> = maps
                    .iter()
                    .zip(&self.outputs)
                    .map(|(map, output)| format!("{} {}", output.name, described(map)))
                    .collect();
                format!("NARX {}", each.join("; "))
            }
        }
    }

    /// What only linear models do, asked of this one.
    pub(super) fn is_not_linear(&self, what: &str) -> Error {
        Error::argument(
            "model",
            format!(
                "{what} is of linear models, and this one is not: it predicts, simulates, validates and compares"
            ),
        )
    }

    /// Checks a model that was read: that its parts fit together, so that it can be computed with.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let wrong =
            |what: String| Err(Error::report(format!("model.{what}; the report was edited or damaged")));
        let channels: Vec<&str> = self.signals().map(|signal| signal.name.as_str()).collect();
        if let Some(place) = (1..channels.len()).find(|place| channels[..*place].contains(&channels[*place]))
        {
            return wrong(format!("inputs, outputs and expressions have '{}' twice", channels[place]));
        }
        if let Err(what) = self.read_expressions() {
            return wrong(format!("expressions: {what}"));
        }
        let outputs = self.outputs.len();
        if outputs == 0 || self.maps.len() != outputs {
            return wrong("maps is not one for each output, of which there is one at least".to_owned());
        }
        if self.regressors.is_empty() {
            return wrong("regressors has none".to_owned());
        }
        for ((place, regressor), source) in self.regressors.iter().enumerate().zip(self.sources()) {
            if !channels.contains(&regressor.channel.as_str()) {
                return wrong(format!("regressors[{place}].channel is none of its signals"));
            }
            if source < outputs && regressor.lag == 0 {
                return wrong(format!("regressors[{place}] is the output itself"));
            }
            if !(regressor.scale.is_finite() && regressor.scale > 0.0) {
                return wrong(format!("regressors[{place}].scale is not a positive number"));
            }
            if regressor.lag > crate::model::LARGEST {
                return wrong(format!("regressors[{place}].lag is too long"));
            }
        }
        let of_outputs = |one: &ChannelExpression| one.channels().iter().any(|channel| *channel < outputs);
        let read = self.read_expressions().unwrap_or_default();
        let at_once = |regressor: &&Regressor| {
            let place = self.expressions.iter().position(|own| own.name == regressor.channel);
            regressor.lag == 0 && place.and_then(|place| read.get(place)).is_some_and(of_outputs)
        };
        if let Some(regressor) = self.regressors.iter().find(at_once) {
            return wrong(format!("regressors has {} of the output itself", regressor.name()));
        }
        let positive = |value: f64| value.is_finite() && value > 0.0;
        if !positive(self.sample_time) || !self.maps.iter().all(|map| positive(map.scale)) {
            return wrong("sample_time or a scale of maps is not a positive number".to_owned());
        }
        for (place, map) in self.maps.iter().enumerate() {
            let each = map.run_errors.iter();
            let rise = map.run_errors.windows(2).all(|pair| pair[0].steps < pair[1].steps);
            if !rise
                || each.clone().any(|error| error.steps == 0 || !error.rmse.is_finite() || error.rmse < 0.0)
            {
                return wrong(format!("maps[{place}].run_errors are no errors of longer and longer runs"));
            }
            if let Err(what) = map.functions.check(self.regressors.len()) {
                return wrong(format!("maps[{place}].functions.{what}"));
            }
        }
        let count = self.places().last().map_or(0, |places| places.end);
        if self.parameters.len() != count {
            return wrong(format!("parameters has {} entries for {count} functions", self.parameters.len()));
        }
        if self.parameters.iter().any(|parameter| !parameter.value.is_finite()) {
            return wrong("parameters has values that are no numbers".to_owned());
        }
        let square = |rows: &Vec<Vec<f64>>, size: usize| {
            rows.len() == size && rows.iter().all(|row| row.len() == size)
        };
        if !square(&self.noise_covariance, outputs) || !is_covariance(&self.noise_covariance) {
            return wrong("noise_covariance does not have a row and a column for each output".to_owned());
        }
        let shape = if let [map] = &*self.maps { map.functions.shape().len() } else { 0 };
        let fits = |rows: &Vec<Vec<f64>>| square(rows, count) || square(rows, count + shape);
        if self.covariance.as_ref().is_some_and(|rows| !fits(rows) || !is_covariance(rows)) {
            return wrong("covariance does not have a row and a column for each parameter".to_owned());
        }
        Ok(())
    }
}
