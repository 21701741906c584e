//! Linear controllers with limits and without windup:
//!
//! ```text
//! A_o(q) v(k) = t_0 A_o(q) u_c(k) - S(q) y(k) + (A_o(q) - R(q)) u(k),   u = v within the limits
//! ```
//!
//! (Åström and Wittenmark, Computer-Controlled Systems, 3rd ed. 1997, section 9.4), in the order of operations of
//! [`RstController`](thetahat_core::RstController).

use thetahat_core::nalgebra::DVector;

use super::head::Head;
use super::program::{Condition, Entry, Index, Kind, Program, Statement, Value, Variable};
use super::rust::{LINTS, steps_along, type_name};
use super::signals::levels;
use super::vector::Vector;
use super::writer::Writer;
use super::{ExportedFile, Language, Plan};
use crate::Error;
use crate::control::Control;

/// The numbers of a controller, in the letters of [`RstController`](thetahat_core::RstController): R and A_o without
/// their leading 1, all as long as S, filled up with zeros.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Controller {
    /// t_0.
    gain: f64,
    r: Vec<f64>,
    s: Vec<f64>,
    /// A_o.
    observer: Vec<f64>,
    /// The lowest and the highest input, in its own unit: infinite where there is none.
    limits: [f64; 2],
    /// What the input, and what the measurement and the set point are measured from: the working point.
    offsets: [f64; 2],
}

impl Controller {
    /// That of a document.
    ///
    /// # Errors
    /// [`Error::Report`] for coefficients that are none, and for a working point that moves.
    pub(super) fn new(document: &Control) -> Result<Self, Error> {
        let own = document.controller()?;
        let offsets = levels(&[document.input.clone(), document.output.clone()])?;
        let [level, working] = offsets[..] else {
            return Err(Error::report("a controller has an input and an output"));
        };
        let (lowest, highest) = own.limits();
        let values = |vector: &DVector<f64>| vector.as_slice().to_vec();
        Ok(Self {
            gain: own.gain(),
            r: values(own.r()),
            s: values(own.s()),
            observer: values(own.observer()),
            limits: [lowest + level, highest + level],
            offsets: [level, working],
        })
    }

    /// Its numbers, by the names that the source gives them.
    pub(super) fn constants(&self) -> [(&str, &[f64]); 6] {
        [
            ("GAIN", std::slice::from_ref(&self.gain)),
            ("R", &self.r),
            ("S", &self.s),
            ("OBSERVER", &self.observer),
            ("the limits of the input", &self.limits),
            ("the working point", &self.offsets),
        ]
    }
}

/// The program of a controller: `control` and `applied`.
pub(super) fn program(controller: &Controller) -> Program {
    let Controller { gain, r, s, observer, limits, offsets: [level, working] } = controller;
    let n = s.len();
    let mut program = Program::default();
    let set_point = program.array(Kind::Argument, "set_point", "The set point.", vec![0.0]);
    let measured = program.array(Kind::Argument, "measured", "The measurement.", vec![0.0]);
    let told = program.array(Kind::Argument, "u", "The input that acted.", vec![0.0]);
    let output = program.array(Kind::Result, "input", "The input.", vec![0.0]);
    let r = program.table("R", "R without its leading 1.", r.clone());
    let s = program.table("S", "S.", s.clone());
    let observer =
        program.table("OBSERVER", "The observer polynomial without its leading 1.", observer.clone());
    let z = program.memory("z", "What of the past acts on the next output.", vec![0.0; n]);
    let latest = program.memory("latest", "The latest input, as a deviation.", vec![0.0]);

    let [reference, y, wanted, input, ahead] =
        ["reference", "y", "wanted", "deviation", "ahead"].map(|name| program.variable(name));
    let gained = || Value::from(*gain) * reference;
    let mut then = vec![Statement::Let(input, wanted.into())];
    let [lowest, highest] = limits.map(|limit| limit - level);
    if lowest.is_finite() {
        then.push(keep(input, Condition::Less(input.into(), lowest.into()), lowest));
    }
    if highest.is_finite() {
        then.push(keep(input, Condition::Less(highest.into(), input.into()), highest));
    }
    then.push(Statement::Let(ahead, gained() - wanted));
    // z_i <- z_(i+1) + a_i (t_0 u_c - v) + (a_i - r_i) u - s_(i+1) y: each reads what stands after it.
    let own =
        |i: &Index| (observer.at(i.clone()) * ahead, (observer.at(i.clone()) - r.at(i.clone())) * input);
    then.extend(program.repeat(n - 1, |_, i| {
        let after = i.clone().plus(1);
        let (of_wanted, of_input) = own(&i);
        let value = z.at(after.clone()) + of_wanted + of_input - s.at(after) * y;
        vec![Statement::Store(z, i, value)]
    }));
    let (of_wanted, of_input) = own(&(n - 1).into());
    then.push(Statement::Store(z, (n - 1).into(), of_wanted + of_input));
    then.push(Statement::Store(latest, 0.into(), input.into()));
    let said = program.variable("said");
    let mut body = vec![
        Statement::Let(reference, set_point.at(0) - *working),
        Statement::Let(y, measured.at(0) - *working),
        Statement::Let(wanted, gained() - s.at(0) * y + z.at(0)),
        Statement::unless_missing(wanted.into(), then),
        Statement::Let(said, latest.at(0) + *level),
    ];
    // A sum may be rounded to beyond a limit.
    let [lowest, highest] = *limits;
    if lowest.is_finite() {
        body.push(keep(said, Condition::Less(said.into(), lowest.into()), lowest));
    }
    if highest.is_finite() {
        body.push(keep(said, Condition::Less(highest.into(), said.into()), highest));
    }
    body.push(Statement::Store(output, 0.into(), said.into()));
    let doc = [
        "Takes the set point and the measurement of this sample, and gives the input from now on, within its limits.",
        "Where one of them is not finite the input stays as it was.",
    ];
    let control = Entry {
        name: "control",
        doc: doc.map(str::to_owned).to_vec(),
        arguments: vec![set_point, measured],
        result: Some(output),
        body,
    };

    let change = program.variable("change");
    let mut then = program.repeat(n, |_, i| {
        let value = z.at(i.clone()) + (observer.at(i.clone()) - r.at(i.clone())) * change;
        vec![Statement::Store(z, i, value)]
    });
    then.push(Statement::Store(latest, 0.into(), told.at(0) - *level));
    let applied = Entry {
        name: "applied",
        doc: vec![
            "Tells that the actuator did something else than `control` asked for, before the next sample."
                .to_owned(),
        ],
        arguments: vec![told],
        result: None,
        body: vec![
            Statement::Let(change, told.at(0) - *level - latest.at(0)),
            Statement::unless_missing(change.into(), then),
        ],
    };
    program.entries = vec![control, applied];
    program
}

/// Gives a variable another value where something holds.
fn keep(variable: Variable, condition: Condition, value: f64) -> Statement {
    Statement::Choose { condition, then: vec![Statement::Set(variable, value.into())], otherwise: Vec::new() }
}

/// A controller as a module of Rust, around the type of the core.
pub(super) fn rust(controller: &Controller, plan: &Plan, head: &Head) -> ExportedFile {
    let Controller { gain, r, s, observer, limits: [lowest, highest], offsets: [level, working] } =
        controller;
    let program = Program::default();
    let writer = Writer::new(&program, Language::Rust, plan.precision);
    let (real, name, n) = (writer.real(), type_name(&plan.name), s.len());
    let mut text = head.comments() + LINTS;
    text += "\nuse thetahat_core::nalgebra::{Const, SVector};\nuse thetahat_core::{Error, RstController};\n";
    for (name, doc, values) in [
        ("R", "R without its leading 1.", r),
        ("S", "S.", s),
        ("OBSERVER", "The observer polynomial without its leading 1.", observer),
    ] {
        text += &format!("\n/// {doc}\npub const {name}: [{real}; {n}] = {};\n", writer.numbers(values, ""));
    }
    for (name, doc, value) in [
        ("GAIN", "t_0.", gain),
        ("INPUT_OFFSET", "What the input is measured from.", level),
        ("OUTPUT_OFFSET", "What the measurement and the set point are measured from.", working),
        ("LOWEST", "The lowest input.", lowest),
        ("HIGHEST", "The highest input.", highest),
    ] {
        text += &format!("\n/// {doc}\npub const {name}: {real} = {};\n", writer.number(*value));
    }
    text += &format!(
        "\n/// The controller, of signals in their own units.\n#[derive(Clone, Debug)]\npub struct {name} {{\n    \
         /// Of deviations from the offsets.\n    pub controller: RstController<{real}, Const<{n}>>,\n}}\n\n\
         impl {name} {{\n    /// At rest.\n    ///\n    /// Errors: none with these numbers.\n    \
         pub fn new() -> Result<Self, Error> {{\n        \
         let [r, s, observer] = [R, S, OBSERVER].map(SVector::from);\n        \
         let controller = RstController::new(GAIN, r, s, observer)?;\n        \
         Ok(Self {{ controller: controller.with_limits(LOWEST - INPUT_OFFSET..=HIGHEST - INPUT_OFFSET)? }})\n    }}\n\n    \
         /// Takes the set point and the measurement of this sample, and gives the input from now on, within its limits.\n    \
         pub fn control(&mut self, set_point: {real}, measured: {real}) -> {real} {{\n        \
         let input = self.controller.control(set_point - OUTPUT_OFFSET, measured - OUTPUT_OFFSET) + INPUT_OFFSET;\n        \
         input.clamp(LOWEST, HIGHEST)\n    }}\n\n    \
         /// Tells that the actuator did something else than `control` asked for, before the next sample.\n    \
         pub fn applied(&mut self, input: {real}) {{\n        self.controller.applied(input - INPUT_OFFSET);\n    }}\n}}\n"
    );
    ExportedFile { name: format!("{}.rs", plan.name), text }
}

/// A program that steps that module along a test vector, and panics where an input is wrong.
pub(super) fn rust_check(plan: &Plan, vector: &Vector) -> ExportedFile {
    let steps = "        let y = [model.control(SET_POINTS[row][0], MEASURED[row][0])];\n        model.applied(INPUTS[row][0]);\n";
    steps_along(&plan.name, plan.precision, vector, [".expect(\"a controller\")", steps], false)
}
