//! A program as a module of Rust that needs no heap.

use super::head::Head;
use super::program::{Array, Basis, Declared, Entry, Field, Kind, MISSING, Program};
use super::vector::Vector;
use super::writer::Writer;
use super::{ExportedFile, Language, Precision};

/// What clippy says of numbers that were estimated, and of loops that are those of C.
pub(super) const LINTS: &str =
    "#![allow(clippy::approx_constant, clippy::manual_memcpy, clippy::needless_range_loop)]\n";

/// The module.
pub(super) fn file(program: &Program, name: &str, precision: Precision, head: &Head) -> ExportedFile {
    let mut writer = Writer::new(program, Language::Rust, precision);
    let real = writer.real();
    let mut text = head.comments() + LINTS;
    text += &uses(program);
    let mut functions = String::new();
    for entry in &program.entries {
        functions += &function(program, entry, &mut writer);
    }
    let fields: Vec<&str> =
        ["ComplexField", "RealField"].into_iter().filter(|name| functions.contains(name)).collect();
    if !fields.is_empty() {
        text += &format!("\nuse thetahat_core::nalgebra::{{{}}};\n", fields.join(", "));
    }
    for Declared { name, values, group, doc, .. } in
        program.arrays.iter().filter(|array| array.kind == Kind::Table)
    {
        let (kind, numbers) = match group {
            1 => (real.to_owned(), writer.numbers(values, "")),
            _ => {
                let line = |group: &[f64]| format!("    {},\n", writer.numbers(group, ""));
                let lines: Vec<String> = values.chunks(*group).map(line).collect();
                (format!("[{real}; {group}]"), format!("[\n{}]", lines.concat()))
            }
        };
        text += &format!("\n/// {doc}\nconst {name}: [{kind}; {}] = {numbers};\n", values.len() / group);
    }
    for (place, map) in program.maps.iter().enumerate() {
        text += &basis(program, place + 1, &map.basis, real);
    }
    let memories = || program.arrays.iter().filter(|array| array.is_kept());
    text += &format!(
        "\n/// {}, with what one step leaves to the next one.\n#[derive(Clone, Debug)]\npub struct {} {{\n",
        head.what,
        type_name(name)
    );
    for Declared { name, values, doc, kind, .. } in memories() {
        let public = if *kind == Kind::Told { "pub " } else { "" };
        text += &format!("    /// {doc}\n    {public}{name}: [{real}; {}],\n", values.len());
    }
    text += &format!(
        "}}\n\nimpl {} {{\n    /// At its start.\n    pub const fn new() -> Self {{\n        Self {{\n",
        type_name(name)
    );
    for Declared { name, values, .. } in memories() {
        let first = values.first().copied().unwrap_or(0.0);
        let start = match values.iter().all(|value| *value == first) {
            true => format!("[{}; {}]", writer.number(first), values.len()),
            false => writer.numbers(values, "            "),
        };
        text += &format!("            {name}: {start},\n");
    }
    text += "        }\n    }\n";
    text += &functions;
    text += &format!(
        "}}\n\nimpl Default for {0} {{\n    fn default() -> Self {{\n        Self::new()\n    }}\n}}\n",
        type_name(name)
    );
    ExportedFile { name: format!("{name}.rs"), text }
}

/// A function of the type.
fn function(program: &Program, entry: &Entry, writer: &mut Writer<'_>) -> String {
    let real = writer.real();
    let mut text = "\n".to_owned();
    entry.comments().for_each(|line| text += &format!("    /// {line}\n"));
    text += &format!("    {} {{\n", signature(program, entry, real));
    if entry.misses() {
        text += &format!("        let mut {MISSING}: usize = 0;\n");
    }
    let result = entry.result.and_then(|Array(array)| program.arrays.get(array));
    if let Some(Declared { name, values, .. }) = result {
        text += &format!("        let mut {name}: [{real}; {}] = [0.0; {}];\n", values.len(), values.len());
    }
    text += &writer.block(&entry.body, "        ");
    match (result, entry.misses()) {
        (Some(result), true) => text += &format!("        ({}, {MISSING})\n", result.name),
        (Some(result), false) => text += &format!("        {}\n", result.name),
        (None, true) => text += &format!("        {MISSING}\n"),
        (None, false) => {}
    }
    text + "    }\n"
}

/// What is used of the core.
fn uses(program: &Program) -> String {
    let mut names: Vec<&str> = Vec::new();
    for map in &program.maps {
        names.extend(["Basis", map.basis.name]);
        names.extend(map.basis.fields.iter().filter_map(|(_, field)| match field {
            Field::Word(name, _) => Some(*name),
            _ => None,
        }));
    }
    names.sort_unstable();
    names.dedup();
    match names[..] {
        [] => String::new(),
        _ => format!("\nuse thetahat_core::{{{}}};\n", names.join(", ")),
    }
}

/// The functions of a map as a constant.
fn basis(program: &Program, number: usize, basis: &Basis, real: &str) -> String {
    let field = |(name, field): &(&str, Field)| {
        let value = match field {
            Field::Table(Array(array)) => format!("&{}", program.arrays[*array].name),
            Field::Integers(numbers) => format!("&{numbers:?}"),
            Field::Count(count) => count.to_string(),
            Field::Flag(flag) => flag.to_string(),
            Field::Word(name, word) => format!("{name}::{word}"),
        };
        format!("{name}: {value}")
    };
    let fields: Vec<String> = basis.fields.iter().map(field).collect();
    let generics = if basis.generic { format!("<'static, {real}>") } else { "<'static>".to_owned() };
    let name = basis.name;
    format!(
        "\n/// The functions.\nconst MAP{number}: {name}{generics} = {name} {{ {} }};\n",
        fields.join(", ")
    )
}

fn signature(program: &Program, entry: &Entry, real: &str) -> String {
    let array = |Array(array): &Array| {
        program.arrays.get(*array).map(|array| (array.name.as_str(), array.values.len()))
    };
    let given = entry.arguments.iter().filter_map(array);
    let arguments: Vec<String> =
        given.map(|(name, length)| format!(", {name}: &[{real}; {length}]")).collect();
    let result = entry.result.as_ref().and_then(array);
    let result = match (result, entry.misses()) {
        (Some((_, length)), true) => format!(" -> ([{real}; {length}], usize)"),
        (Some((_, length)), false) => format!(" -> [{real}; {length}]"),
        (None, true) => " -> usize".to_owned(),
        (None, false) => String::new(),
    };
    format!("pub fn {}(&mut self{}){result}", entry.name, arguments.concat())
}

/// The name of a type: `motor_predictor` as `MotorPredictor`.
pub(super) fn type_name(name: &str) -> String {
    let word = |word: &str| {
        let mut letters = word.chars();
        letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
    };
    name.split('_').map(word).collect()
}

/// A program that steps along a test vector, and panics where an output is wrong.
pub(super) fn check(program: &Program, name: &str, precision: Precision, vector: &Vector) -> ExportedFile {
    let mut steps = String::new();
    for entry in &program.entries {
        let given = entry.arguments.iter().filter_map(|array| program.arrays.get(array.0));
        let arguments: Vec<String> =
            given.map(|array| format!("&{}[row]", Vector::table_of(&array.name))).collect();
        let (result, counted) = match (entry.result, entry.misses()) {
            (Some(_), true) => ("let (y, count) = ", "        missing += count;\n"),
            (Some(_), false) => ("let y = ", ""),
            (None, true) => ("missing += ", ""),
            (None, false) => ("", ""),
        };
        steps += &format!("        {result}model.{}({});\n{counted}", entry.name, arguments.join(", "));
    }
    steps_along(name, precision, vector, ["", &steps], program.entries.iter().any(Entry::misses))
}

/// A program that takes these steps along a test vector, which leave the outputs of a row in `y`, and where they do
/// count numbers that are missing in `missing`. What `new` gives is the model after `unwrapped`.
pub(super) fn steps_along(
    name: &str,
    precision: Precision,
    vector: &Vector,
    [unwrapped, steps]: [&str; 2],
    misses: bool,
) -> ExportedFile {
    let program = Program::default();
    let writer = Writer::new(&program, Language::Rust, precision);
    let (real, rows, outputs) = (writer.real(), vector.rows(), vector.expected.len());
    let mut text = format!(
        "// Steps {name}.rs along the rows of {name}.csv, and panics if an output is wrong.\n\n{LINTS}\n#[path = \"{name}.rs\"]\nmod {name};\n\n"
    );
    text += &format!(
        "/// {}\nconst TOLERANCE: {real} = {};\n",
        vector.tolerance_note(),
        writer.number(vector.tolerance)
    );
    for (label, columns) in vector.tables() {
        text += &format!("\nstatic {label}: [[{real}; {}]; {rows}] = [\n", columns.len());
        for row in 0..rows {
            let values: Vec<String> = columns.iter().map(|column| writer.number(column[row])).collect();
            text += &format!("    [{}],\n", values.join(", "));
        }
        text += "];\n";
    }
    let counted = if misses { format!("    let mut {MISSING}: usize = 0;\n") } else { String::new() };
    text += &format!(
        "\nfn main() {{\n    let mut model = {name}::{}::new(){unwrapped};\n{counted}    for row in 0..{rows} {{\n{steps}",
        type_name(name)
    );
    text += &format!(
        "        for output in 0..{outputs} {{\n            \
         let off = (y[output] - EXPECTED[row][output]).abs();\n            \
         assert!(off <= TOLERANCE, \"row {{}}, output {{}}: off by {{off}}\", row + 1, output + 1);\n        }}\n    }}\n"
    );
    if misses {
        text +=
            &format!("    assert_eq!({MISSING}, {}, \"numbers of the rows are missing\");\n", vector.missing);
    }
    text += "}\n";
    ExportedFile { name: format!("{name}_test.rs"), text }
}
