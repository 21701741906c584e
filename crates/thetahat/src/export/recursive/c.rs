//! An estimator as a header and a source of C99, on the interface of the core in C.

use super::super::c::{header, table};
use super::super::head::Head;
use super::super::program::Program;
use super::super::vector::Columns;
use super::super::writer::Writer;
use super::super::{ExportedFile, Language, Plan, Precision};
use super::Start;
use crate::Error;

/// The most parameters of an estimator of the interface.
const PARAMETERS: usize = 12;
/// The most inputs.
const INPUTS: usize = 4;
/// The most input samples on their way.
const DELAYS: usize = 16;

/// That the interface has the sizes of an estimator.
///
/// # Errors
/// [`Error::Argument`].
pub(super) fn check_sizes(start: &Start) -> Result<(), Error> {
    let [parameters, inputs, delays] = [start.parameters.len(), start.offsets.inputs.len(), start.delays()];
    if parameters <= PARAMETERS && inputs <= INPUTS && delays <= DELAYS {
        return Ok(());
    }
    Err(Error::argument(
        "to",
        format!(
            "estimators in C have up to {PARAMETERS} parameters, {INPUTS} inputs, and delays that add up to {DELAYS}; \
             this one has {parameters}, {inputs} and {delays}: take rust"
        ),
    ))
}

/// A function of the source.
struct Function {
    doc: &'static str,
    prototype: String,
    body: String,
}

/// The functions that step: all that the inputs allow.
fn steps(start: &Start, name: &str, real: &str) -> Vec<Function> {
    let inputs = start.offsets.inputs.len();
    let prototype = |step: &str, arguments: &str| {
        format!("thetahat_error {name}_{step}({name}_state *self, {arguments})")
    };
    let deviation = format!("    {real} deviation[{inputs}];\n    deviations(u, deviation);\n");
    let measured = Function {
        doc: "y(k) arrives: see thetahat_arx_measured.",
        prototype: prototype("measured", &format!("{real} y, thetahat_innovation *innovation")),
        body: "    return thetahat_arx_measured(self->arx, y - Y_OFFSET, innovation);\n".to_owned(),
    };
    let applied = Function {
        doc: "u(k) acts from now on: see thetahat_arx_applied.",
        prototype: prototype("applied", &format!("const {real} u[{inputs}]")),
        body: format!("{deviation}    return thetahat_arx_applied(self->arx, deviation, {inputs}U);\n"),
    };
    let log_row = Function {
        doc: "One row of a log, y(k) and u(k) at the same instant: see thetahat_arx_log_row.",
        prototype: prototype(
            "log_row",
            &format!("{real} y, const {real} u[{inputs}], thetahat_innovation *innovation"),
        ),
        body: format!(
            "{deviation}    return thetahat_arx_log_row(self->arx, y - Y_OFFSET, deviation, {inputs}U, innovation);\n"
        ),
    };
    match (inputs, acts_at_once(start)) {
        (0, _) => vec![measured],
        (_, true) => vec![log_row],
        _ => vec![measured, applied, log_row],
    }
}

/// Whether an input acts on the output of its own sample.
fn acts_at_once(start: &Start) -> bool {
    start.orders.nk.contains(&0)
}

/// The kind of the estimator, as sizes and macros name it.
fn kind(start: &Start) -> &'static str {
    if start.orders.nc > 0 { "armax" } else { "arx" }
}

/// The function that goes on from the fit.
fn init(start: &Start, name: &str, writer: &Writer<'_>) -> Function {
    let count = start.parameters.len();
    let mut body =
        "    thetahat_arx_model model = {0};\n    thetahat_arx *arx = NULL;\n    thetahat_error error;\n"
            .to_owned();
    body += &format!(
        "    model.na = {}U;\n    model.inputs = {}U;\n",
        start.orders.na,
        start.offsets.inputs.len()
    );
    for (input, (orders, scale)) in start.input_orders().iter().zip(&start.scales.inputs).enumerate() {
        body += &format!(
            "    model.input[{input}].nb = {}U;\n    model.input[{input}].nk = {}U;\n    model.input_scales[{input}] = {};\n",
            orders.nb,
            orders.nk,
            writer.number(*scale)
        );
    }
    body += &format!("    model.output_scale = {};\n", writer.number(start.scales.output));
    if start.orders.nc > 0 {
        body += &format!(
            "    model.nc = {}U;\n    model.noise_scale = {};\n    model.gradient = THETAHAT_ARMAX_GRADIENT_PREDICTION_ERROR;\n",
            start.orders.nc,
            writer.number(start.noise_variance.sqrt())
        );
    }
    body += &format!(
        "    error = thetahat_arx_init(&arx, self->memory, sizeof self->memory, &thetahat_{}_{count}, &model, learning);\n    \
         if (error == THETAHAT_ERROR_NONE) {{\n        \
         error = thetahat_arx_set_fit(arx, PARAMETERS, FACTOR, {}, {}U);\n    }}\n    \
         self->arx = (error == THETAHAT_ERROR_NONE) ? arx : NULL;\n    return error;\n",
        kind(start),
        writer.number(start.noise_variance),
        start.samples
    );
    Function {
        doc: "Goes on from the fit, with this way to forget; NULL for that of the library. To be called before anything else.",
        prototype: format!(
            "thetahat_error {name}_init({name}_state *self, const thetahat_learning *learning)"
        ),
        body,
    }
}

/// The header and the source.
pub(super) fn files(start: &Start, plan: &Plan, head: &Head) -> Vec<ExportedFile> {
    let program = Program::default();
    let writer = Writer::new(&program, Language::C, plan.precision);
    let (real, name, count, inputs) =
        (writer.real(), &plan.name, start.parameters.len(), start.offsets.inputs.len());
    let functions: Vec<Function> =
        [init(start, name, &writer)].into_iter().chain(steps(start, name, real)).collect();

    let guard = match plan.precision {
        Precision::F64 => {
            "#ifndef THETAHAT_DOUBLE\n#error \"numbers are double: define THETAHAT_DOUBLE, and link the library with its feature double\"\n#endif\n\n"
        }
        Precision::F32 => {
            "#ifdef THETAHAT_DOUBLE\n#error \"numbers are float: leave THETAHAT_DOUBLE out, or export in double precision\"\n#endif\n\n"
        }
    };
    let mut declarations = format!(
        "// An estimator in its memory, which must not be copied or moved.\ntypedef struct {{\n    \
         thetahat_arx *arx; // Of deviations from the offsets. NULL where init has failed.\n    \
         thetahat_word memory[THETAHAT_{}_WORDS({count})];\n}} {name}_state;\n",
        kind(start).to_uppercase()
    );
    for Function { doc, prototype, .. } in &functions {
        declarations += &format!("\n// {doc}\n{prototype};\n");
    }

    let mut source = format!("// See {name}.h.\n\n#include \"{name}.h\"\n\n#include <stddef.h>\n");
    if inputs > 0 {
        let offsets = writer.numbers(&start.offsets.inputs, "");
        source += &format!(
            "\n// What the inputs are measured from.\nstatic const {real} U_OFFSET[{inputs}] = {offsets};\n"
        );
    }
    let row = |row: Vec<String>| format!("    {},\n", row.join(", "));
    let factor =
        start.factor.row_iter().map(|own| row(own.iter().map(|entry| writer.number(*entry)).collect()));
    source += &format!(
        "\n// What the output is measured from.\nstatic const {real} Y_OFFSET = {};\n\n\
         // The parameters of the fit.\nstatic const {real} PARAMETERS[{count}] = {};\n\n\
         // The factor of their covariance over the noise variance, row by row.\nstatic const {real} FACTOR[{}] = {{\n{}}};\n",
        writer.number(start.offsets.output),
        writer.numbers(&start.parameters, ""),
        count * count,
        factor.collect::<String>()
    );
    if inputs > 0 {
        source += &format!(
            "\nstatic void deviations(const {real} u[{inputs}], {real} deviation[{inputs}])\n{{\n    \
             for (size_t input = 0U; input < {inputs}U; input += 1U) {{\n        \
             deviation[input] = u[input] - U_OFFSET[input];\n    }}\n}}\n"
        );
    }
    for Function { prototype, body, .. } in &functions {
        source += &format!("\n{prototype}\n{{\n{body}}}\n");
    }
    vec![
        header(name, head, &format!("#include \"thetahat.h\"\n\n{guard}"), &declarations),
        ExportedFile { name: format!("{name}.c"), text: source },
    ]
}

/// A program that steps along the rows, and says by its exit code whether the errors are the same.
pub(super) fn check(start: &Start, plan: &Plan, columns: &Columns, errors: Vec<f64>) -> ExportedFile {
    let program = Program::default();
    let writer = Writer::new(&program, Language::C, plan.precision);
    let (real, name, rows) = (writer.real(), &plan.name, columns.rows());
    let mut text = format!(
        "// Steps {name}.c along the rows of {name}.csv, where expected1 is the error of each. main gives 0 if all are the same, else 1.\n\n\
         #include \"{name}.h\"\n\n#include <math.h>\n#include <stddef.h>\n"
    );
    let has_inputs = !columns.inputs.is_empty();
    if has_inputs {
        text += &table(&writer, "INPUTS", &columns.inputs, rows);
    }
    text += &table(&writer, "MEASURED", &columns.measured, rows);
    text += &table(&writer, "EXPECTED", &[errors], rows);
    let is_wrong = |call: &str| {
        format!(
            "{name}_{call} != THETAHAT_ERROR_NONE ||\n            !same(innovation.error[0], EXPECTED[row][0])"
        )
    };
    // A log, and calls of a controller.
    let mut ways = Vec::new();
    if has_inputs {
        ways.push(("logged", is_wrong("log_row(&logged, MEASURED[row][0], INPUTS[row], &innovation)")));
    }
    if !acts_at_once(start) {
        let measured = is_wrong("measured(&online, MEASURED[row][0], &innovation)");
        let applied = format!(" ||\n            {name}_applied(&online, INPUTS[row]) != THETAHAT_ERROR_NONE");
        ways.push(("online", measured + if has_inputs { &applied } else { "" }));
    }
    for (way, _) in &ways {
        text += &format!("\nstatic {name}_state {way};\n");
    }
    text += &format!(
        "\n// Whether two errors are the same; none is known as long as the delay lines are not full.\n\
         static int same({real} found, {real} expected)\n{{\n    return found == expected || (isnan(found) && isnan(expected));\n}}\n\n\
         int main(void)\n{{\n    thetahat_learning learning = {{0}};\n    thetahat_innovation innovation;\n    int wrong = 0;\n    \
         learning.forgetting = THETAHAT_FORGETTING_NONE;\n    \
         if (thetahat_number_bytes() != sizeof({real})) {{\n        return 1;\n    }}\n"
    );
    for (way, _) in &ways {
        text += &format!(
            "    if ({name}_init(&{way}, &learning) != THETAHAT_ERROR_NONE) {{\n        return 1;\n    }}\n"
        );
    }
    text += &format!("    for (size_t row = 0U; row < {rows}U; row += 1U) {{\n");
    for (_, wrong) in &ways {
        text += &format!("        if ({wrong}) {{\n            wrong = 1;\n        }}\n");
    }
    text += "    }\n    return wrong;\n}\n";
    ExportedFile { name: format!("{name}_test.c"), text }
}
