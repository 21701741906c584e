//! What goes into a program and comes out of it, in the units of the channels.

use super::program::{Array, Entry, Index, Kind, Program, Statement, Value, Variable};
use crate::Error;
use crate::model::{Model, Signal};

/// What functions of programs do.
pub(super) const FREE_RUN: &str = "The next sample: takes u(k), and gives y(k) of the free run.";
pub(super) const PREDICTION: &str = "The next sample: takes u(k), and gives the prediction of y(k) from it and from what was measured before.";
pub(super) const UPDATE: &str = "What was measured in this sample, after its prediction. Where it is missing (not finite) the prediction stands for it.";

/// The signals of a program.
#[derive(Debug, Clone, Copy)]
pub(super) struct Signals {
    /// The inputs; none where there are none.
    pub(super) inputs: Option<Array>,
    /// What was measured of the outputs, which only some programs are given.
    pub(super) measured: Array,
    /// What is said of the outputs.
    pub(super) outputs: Array,
    input_offsets: Option<Array>,
    output_offsets: Option<Array>,
}

/// What an observer tells of the innovations of its last step, as [`Innovation`](thetahat_core::Innovation) has it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Innovations {
    pub(super) errors: Array,
    pub(super) variances: Array,
    /// The normalised innovation squared.
    pub(super) nis: Array,
}

impl Innovations {
    pub(super) fn new(program: &mut Program, outputs: usize) -> Self {
        let mut told = |name: &str, doc: &str, size: usize| program.told(name, doc, size);
        Self {
            errors: told(
                "innovation",
                "Of the last step: the outputs less their predictions; NaN where they are missing.",
                outputs,
            ),
            variances: told(
                "innovation_variance",
                if outputs == 1 {
                    "The variance of that; NaN where it is missing."
                } else {
                    "The variance of each of these, given those after it; NaN where they are missing."
                },
                outputs,
            ),
            nis: told(
                "nis",
                "The normalised innovation squared: chi-square distributed, a degree of freedom for each output that is there, if the model is right.",
                1,
            ),
        }
    }

    /// A step begins.
    pub(super) fn begin(&self) -> Statement {
        Statement::Store(self.nis, 0.into(), 0.0.into())
    }

    /// An output is missing.
    pub(super) fn miss(&self, place: &Index) -> [Statement; 2] {
        [self.errors, self.variances].map(|array| Statement::Store(array, place.clone(), f64::NAN.into()))
    }

    /// The variance of an innovation whose part that those after it do not predict is this.
    pub(super) fn count(&self, place: &Index, error: Variable, variance: Value) -> [Statement; 2] {
        let part = Value::from(error) * error / self.variances.at(place.clone());
        [
            Statement::Store(self.variances, place.clone(), variance),
            Statement::Store(self.nis, 0.into(), self.nis.at(0) + part),
        ]
    }
}

/// The offsets of signals.
///
/// # Errors
/// [`Error::Report`] for one that moves with time.
pub(super) fn levels(signals: &[Signal]) -> Result<Vec<f64>, Error> {
    let level = |signal: &Signal| match signal.offset.slope == 0.0 {
        true => Ok(signal.offset.level),
        false => Err(Error::report(format!(
            "the offset of '{}' is a line in the time of its log, which has no meaning beyond it; fit with another way to remove offsets",
            signal.name
        ))),
    };
    signals.iter().map(level).collect()
}

impl Signals {
    /// Those of a model.
    ///
    /// # Errors
    /// As for [`levels`].
    pub(super) fn of(program: &mut Program, model: &Model) -> Result<Self, Error> {
        let (inputs, outputs) = (levels(model.inputs())?, levels(model.outputs())?);
        let mut offsets = |name: &str, doc: &str, levels: &[f64]| {
            let any = levels.iter().any(|level| *level != 0.0);
            any.then(|| program.table(name, doc, levels.to_vec()))
        };
        let input_offsets = offsets("U_OFFSET", "What the inputs are measured from.", &inputs);
        let output_offsets = offsets("Y_OFFSET", "What the outputs are measured from.", &outputs);
        let some = !inputs.is_empty();
        Ok(Self {
            inputs: some.then(|| program.array(Kind::Argument, "u", "The inputs.", vec![0.0; inputs.len()])),
            measured: program.array(Kind::Argument, "measured", "The outputs.", vec![0.0; outputs.len()]),
            outputs: program.array(Kind::Result, "y", "The outputs.", vec![0.0; outputs.len()]),
            input_offsets,
            output_offsets,
        })
    }

    /// An input as a deviation from its offset.
    fn input(&self, input: Array, place: &Index) -> Value {
        let value = input.at(place.clone());
        match self.input_offsets {
            Some(offsets) => value - offsets.at(place.clone()),
            None => value,
        }
    }

    /// Puts an input, as a deviation, into the last place of a line that moves on: where it is missing what stands
    /// there stays.
    pub(super) fn take_input(&self, program: &mut Program, place: usize, line: Array) -> Vec<Statement> {
        self.take(program, place, line, |deviation| deviation)
    }

    /// The same of an input divided by its scale. Where it was taken before, for another line, it does not count again
    /// if it is missing.
    pub(super) fn take_scaled(
        &self,
        program: &mut Program,
        (place, is_first): (usize, bool),
        scale: f64,
        line: Array,
    ) -> Vec<Statement> {
        let mut statements = self.take(program, place, line, |deviation| deviation / scale);
        if let (false, Some(Statement::Choose { then, .. })) = (is_first, statements.last_mut()) {
            then.clear();
        }
        statements
    }

    fn take(
        &self,
        program: &mut Program,
        place: usize,
        line: Array,
        scaled: impl FnOnce(Value) -> Value,
    ) -> Vec<Statement> {
        let (Some(input), Some(last)) = (self.inputs, program.length(line).checked_sub(1)) else {
            return Vec::new();
        };
        let mut statements = program.shift(line);
        let place = Index::from(place);
        statements.push(hold(input.at(place.clone()), line, last.into(), scaled(self.input(input, &place))));
        statements
    }

    /// Puts an input, as a deviation, into its place among those that were held; where it is missing what stands there
    /// stays.
    pub(super) fn hold_input(&self, held: Array, place: &Index) -> Vec<Statement> {
        let hold =
            |input: Array| hold(input.at(place.clone()), held, place.clone(), self.input(input, place));
        self.inputs.map(hold).into_iter().collect()
    }

    /// What was measured of an output, as a deviation.
    pub(super) fn output(&self, place: &Index) -> Value {
        let value = self.measured.at(place.clone());
        match self.output_offsets {
            Some(offsets) => value - offsets.at(place.clone()),
            None => value,
        }
    }

    /// Puts what was measured of an output, as a deviation, into its place: where it is missing what stands there
    /// stays.
    pub(super) fn hold_output(&self, held: Array, place: &Index) -> Statement {
        hold(self.measured.at(place.clone()), held, place.clone(), self.output(place))
    }

    /// Says a deviation of an output in its own unit.
    pub(super) fn say(&self, place: &Index, deviation: impl Into<Value>) -> Statement {
        let deviation = deviation.into();
        let value = match self.output_offsets {
            Some(offsets) => deviation + offsets.at(place.clone()),
            None => deviation,
        };
        Statement::Store(self.outputs, place.clone(), value)
    }

    /// A function that takes the inputs and gives the outputs.
    pub(super) fn responds(&self, name: &'static str, doc: &str, body: Vec<Statement>) -> Entry {
        let arguments = self.inputs.into_iter().collect();
        Entry { name, doc: vec![doc.to_owned()], arguments, result: Some(self.outputs), body }
    }

    /// A function that takes what was measured of the outputs.
    pub(super) fn updates(&self, doc: &str, body: Vec<Statement>) -> Entry {
        let arguments = vec![self.measured];
        Entry { name: "update", doc: vec![doc.to_owned()], arguments, result: None, body }
    }

    /// A function that takes inputs and outputs and gives a state.
    pub(super) fn observes(&self, doc: &str, state: Option<Array>, body: Vec<Statement>) -> Entry {
        let arguments = self.inputs.into_iter().chain([self.measured]).collect();
        Entry { name: "observe", doc: vec![doc.to_owned()], arguments, result: state, body }
    }
}

/// Puts a value into its place, unless what it is made of is missing.
fn hold(given: Value, into: Array, at: Index, value: Value) -> Statement {
    Statement::unless_missed(given, vec![Statement::Store(into, at, value)])
}
