//! Nonlinear ARX models:
//!
//! ```text
//! y^_i(t) = s_i g_i(z(t)),   z_r(t) = x_r(t - l_r)/s_r
//! ```
//!
//! (Ljung, System Identification, 2nd ed. 1999, section 5.4), each signal divided by its scale once.

use super::map::evaluated;
use super::program::{Array, Index, Program, Statement};
use super::signals::{FREE_RUN, PREDICTION, Signals, UPDATE};
use super::{Form, Purpose, refused};
use crate::Error;
use crate::model::{Model, NonlinearArxModel};

/// The program of a model.
///
/// # Errors
/// [`Error::Report`] for an offset that moves; [`Error::Argument`] for what such a model has not.
pub(super) fn form(whole: &Model, model: &NonlinearArxModel, purpose: Purpose) -> Result<Form, Error> {
    if !matches!(purpose, Purpose::Predictor | Purpose::Simulator) {
        return Err(refused(purpose, "a nonlinear ARX model", "predictor, simulator or recursive"));
    }
    if let Some(expression) = model.expressions.first() {
        return Err(Error::argument(
            "what",
            format!(
                "the model reads the expression {}, which is not exported; make it a channel of the log, and fit again",
                crate::text::brief(&expression.name, 40)
            ),
        ));
    }
    let mut program = Program::default();
    let signals = Signals::of(&mut program, whole)?;
    let mut equations = vec![model.name(), "y_i(t) = s_i g_i(z(t)), with z of:".to_owned()];
    equations.extend(model.regressors.iter().map(|regressor| {
        format!("{}, divided by {}", crate::text::harmless(&regressor.name()), regressor.scale)
    }));
    let lines = DelayLines::new(&mut program, model);
    let z = program.memory("z", "The regressors, scaled.", vec![0.0; model.regressors.len()]);
    let outputs = model.outputs.len();
    let predicted =
        program.memory("predicted", "The outputs as predicted, as deviations.", vec![0.0; outputs]);
    let scales = model.maps.iter().map(|map| map.scale).collect();
    let scales = program.table("S", "The scales of the outputs.", scales);

    let mut body = lines.take_inputs(&mut program, &signals, outputs);
    body.extend(lines.regressors(z, outputs));
    for (place, (map, own)) in model.maps.iter().zip(model.places()).enumerate() {
        let theta = model.parameters.get(own).unwrap_or_default();
        let theta = theta.iter().map(|parameter| parameter.value).collect();
        let map = evaluated(&mut program, place + 1, &map.functions, theta, z);
        let value = program.variable("value");
        body.push(Statement::Evaluate { map: program.maps.len(), into: value });
        program.maps.push(map);
        body.push(Statement::Store(predicted, place.into(), scales.at(place) * value));
        body.push(signals.say(&place.into(), predicted.at(place)));
    }
    program.entries = if purpose == Purpose::Simulator {
        body.extend(lines.take_outputs(&mut program, predicted));
        vec![signals.responds("step", FREE_RUN, body)]
    } else {
        let mut update: Vec<Statement> =
            (0..outputs).map(|output| signals.hold_output(predicted, &output.into())).collect();
        update.extend(lines.take_outputs(&mut program, predicted));
        vec![signals.responds("predict", PREDICTION, body), signals.updates(UPDATE, update)]
    };
    Ok(Form { program, equations, start: "at rest at the offsets".to_owned() })
}

/// The delay lines of the signals, each divided by its scale: two lines for a signal that is read with two scales.
struct DelayLines {
    /// The signal (outputs, then inputs), the scale, and the line.
    each: Vec<(usize, f64, Array)>,
    /// For each regressor its line and its lag.
    read: Vec<(usize, usize)>,
}

impl DelayLines {
    fn new(program: &mut Program, model: &NonlinearArxModel) -> Self {
        let outputs = model.outputs.len();
        let mut sorts: Vec<(usize, f64, usize)> = Vec::new();
        let mut read = Vec::new();
        for (source, regressor) in model.sources().into_iter().zip(&model.regressors) {
            let found = sorts.iter().position(|(own, scale, _)| (*own, *scale) == (source, regressor.scale));
            let place = found.unwrap_or_else(|| {
                sorts.push((source, regressor.scale, 0));
                sorts.len() - 1
            });
            sorts[place].2 = sorts[place].2.max(regressor.lag);
            read.push((place, regressor.lag));
        }
        let mut line = |(source, scale, lag): (usize, f64, usize)| {
            let input = source.checked_sub(outputs);
            // Of an input the sample of now is there.
            let length = lag + usize::from(input.is_some());
            let name = input.map_or_else(|| format!("y{}", source + 1), |input| format!("u{}", input + 1));
            let taken =
                program.arrays.iter().filter(|array| array.name.starts_with(&format!("{name}_past"))).count();
            let name = if taken == 0 { format!("{name}_past") } else { format!("{name}_past_{}", taken + 1) };
            let doc = format!("Divided by {scale}, the oldest value first.");
            (source, scale, program.memory(&name, &doc, vec![0.0; length]))
        };
        Self { each: sorts.into_iter().map(&mut line).collect(), read }
    }

    fn take_inputs(&self, program: &mut Program, signals: &Signals, outputs: usize) -> Vec<Statement> {
        let inputs = self.each.iter().enumerate().filter_map(|(place, (source, scale, line))| {
            let is_first = self.each.iter().take(place).all(|(own, ..)| own != source);
            Some(((source.checked_sub(outputs)?, is_first), scale, line))
        });
        inputs.flat_map(|(input, scale, line)| signals.take_scaled(program, input, *scale, *line)).collect()
    }

    /// z.
    fn regressors(&self, z: Array, outputs: usize) -> Vec<Statement> {
        let value = |(place, lag): &(usize, usize)| {
            let (source, _, line) = self.each[*place];
            let last = self.longest(*place, outputs);
            line.at(if source < outputs { last - lag } else { last - 1 - lag })
        };
        self.read.iter().enumerate().map(|(r, read)| Statement::Store(z, r.into(), value(read))).collect()
    }

    /// How long a line is.
    fn longest(&self, place: usize, outputs: usize) -> usize {
        let lags = self.read.iter().filter(|(own, _)| *own == place).map(|(_, lag)| *lag);
        lags.max().unwrap_or(0) + usize::from(self.each[place].0 >= outputs)
    }

    /// Puts deviations of the outputs into their lines.
    fn take_outputs(&self, program: &mut Program, deviations: Array) -> Vec<Statement> {
        let outputs = program.length(deviations);
        let own = self.each.iter().filter(|(source, ..)| *source < outputs);
        own.flat_map(|(source, scale, line)| {
            program.push(*line, deviations.at(Index::from(*source)) / *scale)
        })
        .collect()
    }
}
