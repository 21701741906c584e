//! An estimator as a module of Rust.

use super::super::head::Head;
use super::super::program::Program;
use super::super::rust::{LINTS, type_name};
use super::super::vector::Columns;
use super::super::writer::Writer;
use super::super::{ExportedFile, Language, Plan};
use super::Start;

/// The module.
pub(super) fn file(start: &Start, plan: &Plan, head: &Head) -> ExportedFile {
    let program = Program::default();
    let writer = Writer::new(&program, Language::Rust, plan.precision);
    let (real, name) = (writer.real(), type_name(&plan.name));
    let armax = start.orders.nc > 0;
    let (kind, orders, of_c, imports) = match armax {
        true => (
            "RecursiveArmax",
            "ArmaxOrders",
            format!("nc: {}, ", start.orders.nc),
            "ArmaxMethod, ArmaxOrders",
        ),
        false => ("RecursiveArx", "ArxOrders", String::new(), "ArxOrders"),
    };
    let (count, inputs, delays) = (start.parameters.len(), start.offsets.inputs.len(), start.delays());
    let input_orders: Vec<String> = start
        .input_orders()
        .iter()
        .map(|own| format!("InputOrders {{ nb: {}, nk: {} }}", own.nb, own.nk))
        .collect();
    let input_orders_used = if inputs > 0 { "InputOrders, " } else { "" };
    let numbers = |values: &[f64]| writer.numbers(values, "");
    let rows: Vec<String> = start
        .factor
        .row_iter()
        .map(|row| format!("    {},\n", numbers(&row.iter().copied().collect::<Vec<_>>()).replace('\n', " ")))
        .collect();
    let (method, noise) = match armax {
        true => {
            ("ArmaxMethod::PredictionError, ", format!("{}, ", writer.number(start.noise_variance.sqrt())))
        }
        false => ("", String::new()),
    };
    let mut text = head.comments() + LINTS;
    text += &format!(
        "\nuse thetahat_core::nalgebra::{{Const, SMatrix, SVector}};\nuse thetahat_core::{{{imports}, Covariance, Error, Forgetting, {input_orders_used}Innovation, {kind}}};\n\n"
    );
    text += &format!(
        "/// The orders.\npub const ORDERS: {orders}<'static> = {orders} {{ na: {}, inputs: &[{}], {of_c}constant: false }};\n\n",
        start.orders.na,
        input_orders.join(", ")
    );
    let several = |values: &[f64]| (format!("[{real}; {}]", values.len()), numbers(values));
    let one = |value: f64| (real.to_owned(), writer.number(value));
    let covariance = (format!("[[{real}; {count}]; {count}]"), format!("[\n{}]", rows.concat()));
    for (doc, name, (kind, value)) in [
        ("What the inputs are measured from.", "pub const U_OFFSET", several(&start.offsets.inputs)),
        ("What the output is measured from.", "pub const Y_OFFSET", one(start.offsets.output)),
        ("The typical magnitudes of the inputs.", "const U_SCALE", several(&start.scales.inputs)),
        ("That of the output.", "const Y_SCALE", one(start.scales.output)),
        ("The parameters of the fit.", "pub const PARAMETERS", several(&start.parameters)),
        (
            "Their covariance over the noise variance, factored as `Covariance::factor` has it.",
            "const FACTOR",
            covariance,
        ),
    ] {
        text += &format!("/// {doc}\n{name}: {kind} = {value};\n\n");
    }
    text += &format!(
        "/// The estimator of the core, of deviations from the offsets.\npub type Estimator = {kind}<{real}, Const<{count}>, Const<{delays}>>;\n\n"
    );
    text += &format!(
        "/// The estimator, of signals in their own units.\n#[derive(Clone, Debug)]\npub struct {name} {{\n    /// Of deviations from the offsets.\n    pub estimator: Estimator,\n}}\n\n\
         impl {name} {{\n    /// Goes on from the fit.\n    ///\n    /// Errors: those of the core for a way to forget.\n    \
         pub fn new(forgetting: Forgetting<{real}>) -> Result<Self, Error> {{\n        \
         let factor = SMatrix::<{real}, {count}, {count}>::from_fn(|row, column| FACTOR[row][column]);\n        \
         let estimator = Estimator::new(&ORDERS, {method}Y_SCALE, &U_SCALE, {noise}forgetting)?\n            \
         .with_parameters(SVector::from(PARAMETERS))?\n            \
         .with_covariance(Covariance::from_factor(factor)?)?\n            \
         .with_noise_variance({}, {})?;\n        Ok(Self {{ estimator }})\n    }}\n\n",
        writer.number(start.noise_variance),
        start.samples
    );
    text += &format!(
        "    /// y(k) arrives: see `measured` of the estimator.\n    pub fn measured(&mut self, y: {real}) -> Result<Innovation<{real}>, Error> {{\n        \
         self.estimator.measured(y - Y_OFFSET)\n    }}\n\n    \
         /// u(k) acts from now on: see `applied` of the estimator.\n    pub fn applied(&mut self, u: &[{real}; {inputs}]) -> Result<(), Error> {{\n        \
         self.estimator.applied(&deviations(u))\n    }}\n\n    \
         /// One row of a log, y(k) and u(k) at the same instant: see `log_row` of the estimator.\n    \
         pub fn log_row(&mut self, y: {real}, u: &[{real}; {inputs}]) -> Result<Innovation<{real}>, Error> {{\n        \
         self.estimator.log_row(y - Y_OFFSET, &deviations(u))\n    }}\n}}\n\n\
         fn deviations(u: &[{real}; {inputs}]) -> [{real}; {inputs}] {{\n    core::array::from_fn(|input| u[input] - U_OFFSET[input])\n}}\n"
    );
    ExportedFile { name: format!("{}.rs", plan.name), text }
}

/// A program that steps along the rows, and panics where an error is another.
pub(super) fn check(plan: &Plan, columns: &Columns, errors: &[f64]) -> ExportedFile {
    let program = Program::default();
    let writer = Writer::new(&program, Language::Rust, plan.precision);
    let (real, name, rows, inputs) = (writer.real(), &plan.name, columns.rows(), columns.inputs.len());
    let mut text = format!(
        "// Steps {name}.rs along the rows of {name}.csv, where expected1 is the error of each, and panics if one is wrong.\n\n\
         {LINTS}\n#[path = \"{name}.rs\"]\nmod {name};\n\nuse thetahat_core::{{Error, Forgetting}};\n\n\
         /// u(k), y(k) and the error.\nstatic ROWS: [([{real}; {inputs}], {real}, {real}); {rows}] = [\n"
    );
    for (row, error) in errors.iter().enumerate() {
        let u: Vec<f64> = columns.inputs.iter().map(|column| column[row]).collect();
        let u: Vec<String> = u.iter().map(|value| writer.number(*value)).collect();
        text += &format!(
            "    ([{}], {}, {}),\n",
            u.join(", "),
            writer.number(columns.measured[0][row]),
            writer.number(*error)
        );
    }
    text += &format!(
        "];\n\n/// Whether two errors are the same; none is known as long as the delay lines are not full.\n\
         fn same(found: {real}, expected: {real}) -> bool {{\n    found == expected || found.is_nan() && expected.is_nan()\n}}\n\n\
         fn main() -> Result<(), Error> {{\n    let mut model = {name}::{}::new(Forgetting::None)?;\n    let mut online = model.clone();\n    \
         for (row, (u, y, expected)) in ROWS.iter().enumerate() {{\n        \
         let found = model.log_row(*y, u)?.error;\n        \
         assert!(same(found, *expected), \"row {{}}: {{found}} is not {{expected}}\", row + 1);\n        \
         // As a controller calls it, where no input acts in its own sample.\n        \
         if let Ok(innovation) = online.measured(*y) {{\n            \
         assert!(same(innovation.error, *expected), \"row {{}}: measured, {{}}\", row + 1, innovation.error);\n            \
         online.applied(u)?;\n        }}\n    }}\n    Ok(())\n}}\n",
        type_name(name)
    );
    ExportedFile { name: format!("{name}_test.rs"), text }
}
