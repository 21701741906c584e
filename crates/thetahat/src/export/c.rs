//! A program as a header and a source of C99.

use super::head::Head;
use super::program::{Array, Declared, Entry, Kind, MISSING, Program, Statement};
use super::vector::Vector;
use super::writer::Writer;
use super::{ExportedFile, Language, Precision};

/// gcc and clang tell by the first two names that every number is taken for finite, Microsoft's and Arm's compilers by
/// the others.
const FINITE_MATH: &str = "
#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__) || defined(_M_FP_FAST) || defined(__FP_FAST)
#error \"A missing number is not finite, which is not seen with -ffast-math or -ffinite-math-only: compile this file without them.\"
#endif
";

/// The header and the source.
pub(super) fn files(program: &Program, name: &str, precision: Precision, head: &Head) -> Vec<ExportedFile> {
    let mut program = program.clone();
    let init = init(&mut program);
    let mut writer = Writer::new(&program, Language::C, precision);
    let entries: Vec<&Entry> = std::iter::once(&init).chain(&program.entries).collect();

    let mut header = "// What one step leaves to the next one.\ntypedef struct {\n".to_owned();
    for Declared { name, values, doc, .. } in program.arrays.iter().filter(|array| array.is_kept()) {
        header += &format!("    {} {name}[{}]; // {doc}\n", writer.real(), values.len());
    }
    header += &format!("}} {name}_state;\n");
    for entry in &entries {
        header += "\n";
        entry.comments().for_each(|line| header += &format!("// {line}\n"));
        header += &format!("{};\n", prototype(&program, entry, name, &writer));
    }

    let mut functions = String::new();
    for entry in &entries {
        let mut body = writer.block(&entry.body, "    ");
        if entry.misses() {
            body = format!("    unsigned int {MISSING} = 0U;\n{body}    return {MISSING};\n");
        }
        functions += &format!("\n{}\n{{\n{body}}}\n", prototype(&program, entry, name, &writer));
    }
    let mut source = format!("// See {name}.h.\n\n#include \"{name}.h\"\n\n");
    if functions.contains("isfinite(") || program.calls {
        source += "#include <math.h>\n";
    }
    if functions.contains("size_t") {
        source += "#include <stddef.h>\n";
    }
    if functions.contains("isfinite(") {
        source += FINITE_MATH;
    }
    // What only a constant of the core reads is not there.
    let is_read =
        |array: &&Declared| array.kind == Kind::Table && functions.contains(&format!("{}[", array.name));
    for Declared { name, values, doc, .. } in program.arrays.iter().filter(is_read) {
        let numbers = writer.numbers(values, "");
        source +=
            &format!("\n// {doc}\nstatic const {} {name}[{}] = {numbers};\n", writer.real(), values.len());
    }
    source += &functions;
    vec![self::header(name, head, "", &header), ExportedFile { name: format!("{name}.c"), text: source }]
}

/// A header of declarations, and of what comes before them.
pub(super) fn header(name: &str, head: &Head, before: &str, declarations: &str) -> ExportedFile {
    let (comments, guard) = (head.comments(), format!("{}_H", name.to_uppercase()));
    let text = format!(
        "{comments}#ifndef {guard}\n#define {guard}\n\n{before}#ifdef __cplusplus\nextern \"C\" {{\n#endif\n\n\
         {declarations}\n#ifdef __cplusplus\n}}\n#endif\n\n#endif\n"
    );
    ExportedFile { name: format!("{name}.h"), text }
}

/// The function that puts a state at its start.
fn init(program: &mut Program) -> Entry {
    let memories: Vec<usize> =
        (0..program.arrays.len()).filter(|array| program.arrays[*array].is_kept()).collect();
    let mut body = Vec::new();
    for memory in memories {
        let Declared { name, values, .. } = program.arrays[memory].clone();
        let array = Array(memory);
        let first = values.first().copied().unwrap_or(0.0);
        let start = values.iter().any(|value| *value != first).then(|| {
            program.table(
                &format!("START_{}", name.to_uppercase()),
                &format!("What {name} starts with."),
                values.clone(),
            )
        });
        body.extend(program.repeat(values.len(), |_, i| {
            let value = start.map_or(first.into(), |start| start.at(i.clone()));
            vec![Statement::Store(array, i, value)]
        }));
    }
    Entry {
        name: "init",
        doc: vec!["Puts a state at its start. To be called before anything else.".to_owned()],
        arguments: Vec::new(),
        result: None,
        body,
    }
}

fn prototype(program: &Program, entry: &Entry, name: &str, writer: &Writer<'_>) -> String {
    let real = writer.real();
    let mut arguments = vec![format!("{name}_state *self")];
    let array =
        |array: &Array| program.arrays.get(array.0).map(|array| (array.name.as_str(), array.values.len()));
    let given = entry.arguments.iter().filter_map(array);
    arguments.extend(given.map(|(name, length)| format!("const {real} {name}[{length}]")));
    let results = entry.result.iter().filter_map(array);
    arguments.extend(results.map(|(name, length)| format!("{real} {name}[{length}]")));
    let given = if entry.misses() { "unsigned int" } else { "void" };
    format!("{given} {name}_{}({})", entry.name, arguments.join(", "))
}

/// Columns as a table of a program that checks.
pub(super) fn table(writer: &Writer<'_>, label: &str, columns: &[Vec<f64>], rows: usize) -> String {
    let mut text = format!("\nstatic const {} {label}[{rows}][{}] = {{\n", writer.real(), columns.len());
    for row in 0..rows {
        let values: Vec<String> = columns.iter().map(|column| writer.number(column[row])).collect();
        text += &format!("    {{{}}},\n", values.join(", "));
    }
    text + "};\n"
}

/// A program that steps along a test vector, and says by its exit code whether the outputs are right.
pub(super) fn check(program: &Program, name: &str, precision: Precision, vector: &Vector) -> ExportedFile {
    let writer = Writer::new(program, Language::C, precision);
    let real = writer.real();
    let rows = vector.rows();
    let mut text = format!(
        "// Steps {name}.c along the rows of {name}.csv. main gives 0 if the outputs are right, else 1.\n\n\
         #include \"{name}.h\"\n\n#include <math.h>\n#include <stddef.h>\n\n"
    );
    text += &format!("// {}\n", vector.tolerance_note());
    text += &format!("static const {real} TOLERANCE = {};\n", writer.number(vector.tolerance));
    for (label, columns) in vector.tables() {
        text += &table(&writer, label, columns, rows);
    }
    let outputs = vector.expected.len();
    let misses = program.entries.iter().any(Entry::misses);
    let counted = if misses { format!("    unsigned int {MISSING} = 0U;\n") } else { String::new() };
    text += &format!(
        "\nint main(void)\n{{\n    {name}_state state;\n    int wrong = 0;\n{counted}    {name}_init(&state);\n"
    );
    text +=
        &format!("    for (size_t row = 0U; row < {rows}U; row += 1U) {{\n        {real} y[{outputs}];\n");
    for entry in &program.entries {
        let mut arguments = vec!["&state".to_owned()];
        let given = entry.arguments.iter().filter_map(|array| program.arrays.get(array.0));
        arguments.extend(given.map(|array| format!("{}[row]", Vector::table_of(&array.name))));
        arguments.extend(entry.result.map(|_| "y".to_owned()));
        let counted = if entry.misses() { format!("{MISSING} += ") } else { String::new() };
        text += &format!("        {counted}{name}_{}({});\n", entry.name, arguments.join(", "));
    }
    let absolute = if precision == Precision::F32 { "fabsf" } else { "fabs" };
    text += &format!(
        "        for (size_t output = 0U; output < {outputs}U; output += 1U) {{\n            \
         if (!({absolute}(y[output] - EXPECTED[row][output]) <= TOLERANCE)) {{\n                wrong = 1;\n            }}\n        }}\n    }}\n"
    );
    if misses {
        text += &format!(
            "    if ({MISSING} != {}U) {{ // How many numbers of the rows are.\n        wrong = 1;\n    }}\n",
            vector.missing
        );
    }
    text += "    return wrong;\n}\n";
    ExportedFile { name: format!("{name}_test.c"), text }
}
