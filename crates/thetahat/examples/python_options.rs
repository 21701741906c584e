//! Writes the options as Python has them, `py/python/thetahat/engine/option_types.py`, from the tables of options; its
//! test says whether it is up to date.
//!
//! ```text
//! cargo run -p thetahat --example python_options
//! ```

use std::error::Error;
use std::fmt::Write;
use std::fs;

use thetahat::design::DesignOptions;
use thetahat::options::{Form, Kind, OptionRow, Options};
use thetahat::plan::FitOptions;
use thetahat::report::ValidationOptions;
use thetahat::spectrum::SpectrumOptions;

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../py/python/thetahat/engine/option_types.py");

/// The parameters that functions have before their options: what the model is about, its structure and its orders.
const OWN_PARAMETERS: [&str; 25] = [
    "blocks",
    "couple",
    "delay",
    "input",
    "kernel",
    "method",
    "model",
    "na",
    "narx",
    "nb",
    "nc",
    "nd",
    "nf",
    "nk",
    "np",
    "nu",
    "ny",
    "nz",
    "order",
    "output",
    "path",
    "seasonal",
    "structure",
    "taps",
    "term",
];

/// A class of the options of a fit, what it says, and the kind of model whose options it has.
const FITS: [(&str, &str, Kind); 8] = [
    (
        "FitOptions",
        "What every fit of a model of polynomials can be told, beside the orders.",
        Kind::POLYNOMIAL,
    ),
    ("ArimaOptions", "What a fit of a seasonal ARIMA model can be told.", Kind::ARIMA),
    ("ImpulseResponseOptions", "What a fit of an impulse response can be told.", Kind::IMPULSE_RESPONSE),
    ("StateSpaceOptions", "What a fit of a model in state space can be told.", Kind::STATE_SPACE),
    ("ProcessOptions", "What a fit of a process in continuous time can be told.", Kind::PROCESS),
    ("NarxOptions", "What a fit of a nonlinear ARX model can be told.", Kind::NONLINEAR_ARX),
    ("BlocksOptions", "What a fit of a model in blocks can be told.", Kind::BLOCKS),
    ("EquationsOptions", "What a fit of a model in equations can be told.", Kind::EQUATIONS),
];

/// A class of the options of something else, what it says, and the table.
const OTHERS: [(&str, &str, &[OptionRow]); 3] = [
    ("ValidationOptions", "How to validate a model on a log.", ValidationOptions::TABLE),
    ("SpectrumOptions", "How a frequency response is estimated from a log.", SpectrumOptions::TABLE),
    ("DesignOptions", "What a test signal has to be.", DesignOptions::TABLE),
];

const HEAD: &str = r#""""The options of what takes many, written from their tables: ``cargo run -p thetahat --example python_options``."""

from collections.abc import Mapping, Sequence
from typing import Literal, Optional, TypedDict, Union

from thetahat.engine.values import Band, Bound, Duration, Frequencies, Rows
"#;

/// The name, type and documentation of an option in Python, where they are not those of the table.
fn own(option: &OptionRow) -> (String, String, String) {
    let help = spelled(option.help.trim());
    let words = (option.words)();
    let kind = match option.python {
        "" => {
            let words: Vec<String> = words.iter().map(|known| format!("\"{}\"", known.word)).collect();
            format!("Literal[{}]", words.join(", "))
        }
        kind => kind.to_owned(),
    };
    let many = matches!(option.form, Form::Repeated | Form::List) && kind.is_empty();
    let kind = if many { "Sequence[str]".to_owned() } else { kind };
    match option.field {
        "regressor" => ("regressors".to_owned(), "Sequence[str]".to_owned(), help),
        "no_linear" => (
            "linear".to_owned(),
            "bool".to_owned(),
            "Whether a constant and the regressors themselves stand beside radial basis functions (rbf); whether \
             local models, and what neighbours say, are planes (local, knn)"
                .to_owned(),
        ),
        "terms" => (
            "terms".to_owned(),
            "Union[int, Sequence[str]]".to_owned(),
            format!("{help}; or products by name, as ``Model.parameter_names`` has them"),
        ),
        "feedthrough" => (
            "feedthrough".to_owned(),
            "bool".to_owned(),
            "Whether inputs act on the outputs in the same sample".to_owned(),
        ),
        "sample_time" => ("sample_time".to_owned(), "Duration".to_owned(), help),
        field => (field.to_owned(), kind, help),
    }
}

/// Names of options as they are in Python.
fn spelled(text: &str) -> String {
    text.split('`')
        .enumerate()
        .map(|(index, part)| {
            match part {
                // What is compared for a model has it as an argument.
                "for" if index % 2 == 1 => "``model``".to_owned(),
                name if index % 2 == 1 => format!("``{}``", name.replace('-', "_")),
                text => text.to_owned(),
            }
        })
        .collect()
}

/// Lines of at most so many columns.
fn wrapped(text: &str, indent: &str) -> String {
    let (mut lines, mut line) = (String::new(), indent.to_owned());
    for word in text.split_whitespace() {
        if line.chars().count() + word.chars().count() >= 110 {
            lines.push_str(line.trim_end());
            lines.push('\n');
            line = indent.to_owned();
        }
        line.push_str(word);
        line.push(' ');
    }
    lines + line.trim_end() + "\n"
}

/// The file that the tables make.
fn file() -> Result<String, Box<dyn Error>> {
    let mut text = HEAD.to_owned();
    for (name, says, kind) in FITS {
        let takes = |option: &&OptionRow| {
            let chosen = kind == Kind::POLYNOMIAL && option.field == "select";
            option.is_for(kind) && !OWN_PARAMETERS.contains(&option.field) && !chosen
        };
        class(&mut text, name, says, &FitOptions::TABLE.iter().filter(takes).collect::<Vec<_>>())?;
    }
    for (name, says, table) in OTHERS {
        let takes = |option: &&OptionRow| !["input", "output", "signal", "want"].contains(&option.field);
        class(&mut text, name, says, &table.iter().filter(takes).collect::<Vec<_>>())?;
    }
    Ok(text)
}

/// A class of some options.
fn class(text: &mut String, name: &str, says: &str, options: &[&OptionRow]) -> Result<(), Box<dyn Error>> {
    write!(
        text,
        "\n\nclass {name}(TypedDict, total=False):\n    \"\"\"{says}\n\n    Attributes\n    ----------\n"
    )?;
    for option in options {
        let (field, _, help) = own(option);
        let known = if field == "feedthrough" { Vec::new() } else { (option.words)() };
        let words: String =
            known.iter().map(|known| format!("; ``\"{}\"``: {}", known.word, spelled(known.help))).collect();
        let default = match option.default {
            "" => String::new(),
            default => format!(" [default: {}]", spelled(default)),
        };
        writeln!(text, "    {field}")?;
        text.push_str(&wrapped(&format!("{help}{words}{default}"), "        "));
    }
    text.push_str("    \"\"\"\n\n");
    for option in options {
        let (field, kind, _) = own(option);
        writeln!(text, "    {field}: Optional[{kind}]")?;
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    Ok(fs::write(FILE, file()?)?)
}

#[test]
fn the_options_of_python_are_those_of_the_table() {
    let written = fs::read_to_string(FILE).expect("the file");
    let made = file().expect("text");
    assert!(made == written, "not up to date: cargo run -p thetahat --example python_options");
}
