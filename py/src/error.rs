//! The one map of errors: what the libraries say, as Python raises it.

use std::io;

use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyKeyboardInterrupt, PyMemoryError, PyValueError};
use pyo3::prelude::*;
use thetahat::present::Layout;

create_exception!(
    thetahat,
    EstimationError,
    PyException,
    "The data cannot determine what was asked of them.\n\n\
     Attributes\n\
     ----------\n\
     parameters : list of str\n    \
         The parameters that the data leave open; empty where all of them are."
);

/// What the batch library says.
pub(crate) fn batch(py: Python<'_>, error: thetahat::Error) -> PyErr {
    // Options of several words have a hyphen, keyword arguments an underscore.
    let error = match error {
        thetahat::Error::Argument { argument, message } => {
            thetahat::Error::Argument { argument: argument.replace('-', "_"), message }
        }
        other => other,
    };
    let message = in_python(&error.to_string());
    match error {
        thetahat::Error::Interrupted => PyKeyboardInterrupt::new_err(()),
        thetahat::Error::Undetermined { parameters, .. } => undetermined(py, message, parameters),
        thetahat::Error::Argument { .. } => usage(py, message),
        _ => PyValueError::new_err(message),
    }
}

/// What the steppers say.
pub(crate) fn online(py: Python<'_>, error: thetahat_core::Error) -> PyErr {
    stepper(py, error, error.to_string())
}

/// What they say of one row of a run, given from 0. Messages count rows from 1, as those of logs do.
pub(crate) fn online_at(py: Python<'_>, row: usize, error: thetahat_core::Error) -> PyErr {
    stepper(py, error, format!("row {}: {error}", row + 1))
}

fn stepper(py: Python<'_>, error: thetahat_core::Error, message: String) -> PyErr {
    use thetahat_core::Error;
    // The method has another name here.
    let message = message.replace("with log_row", "with update");
    match error {
        Error::NoVariance { .. }
        | Error::RankDeficient { .. }
        | Error::NotObservable { .. }
        | Error::NotConverged { .. }
        | Error::Overflow => undetermined(py, message, Vec::new()),
        _ => PyValueError::new_err(message),
    }
}

/// What the program's own stages say.
pub(crate) fn program(py: Python<'_>, failure: &thetahat_cli::Failure) -> PyErr {
    let message = in_python(failure.message());
    match failure.kind() {
        thetahat_cli::Kind::Interrupted => PyKeyboardInterrupt::new_err(()),
        thetahat_cli::Kind::Undetermined => undetermined(py, message, Vec::new()),
        thetahat_cli::Kind::Io(kind) => io::Error::new(kind, message).into(),
        thetahat_cli::Kind::Usage => usage(py, message),
        thetahat_cli::Kind::Memory => PyMemoryError::new_err(message),
        _ => PyValueError::new_err(message),
    }
}

/// What is wrong with the arguments, and not with the data: the command line gives it another exit code.
fn usage(py: Python<'_>, message: String) -> PyErr {
    let error = PyValueError::new_err(message);
    match error.value(py).setattr("exit_code", 2) {
        Ok(()) => error,
        Err(other) => other,
    }
}

fn undetermined(py: Python<'_>, message: String, parameters: Vec<String>) -> PyErr {
    let error = EstimationError::new_err(message);
    match error.value(py).setattr("parameters", parameters) {
        Ok(()) => error,
        Err(other) => other,
    }
}

/// Tables of text in which arguments have their names here.
pub(crate) fn layout() -> Layout {
    Layout { spelled: in_python, ..Layout::default() }
}

/// A message that names options of the command line, with the keyword arguments that they are here: `--sample-time 0`
/// is `sample_time 0`.
///
/// It may repeat names and parts of files, and goes to a terminal: it is bounded, and what is invisible is an escape.
pub(crate) fn in_python(message: &str) -> String {
    let message = thetahat::text::message(&thetahat_cli::with_options(message));
    let mut text = String::with_capacity(message.len());
    let mut rest = message.as_str();
    while let Some(start) = rest.find("--") {
        let (before, option) = (&rest[..start], &rest[start + 2..]);
        let length = option.bytes().take_while(|byte| byte.is_ascii_lowercase() || *byte == b'-').count();
        text.push_str(before);
        // A dash that is no option stays.
        if length == 0 || !(before.is_empty() || before.ends_with([' ', '(', '\n'])) {
            text.push_str("--");
        }
        match &option[..length] {
            "input" => text.push_str("inputs"),
            "no-header" => text.push_str("header=False"),
            "header-row" => text.push_str("header"),
            "value" => text.push_str("values"),
            "decimal-comma" if option[length..].starts_with("=no") => {
                text.push_str("decimal_comma=False");
                rest = &option[length + "=no".len()..];
                continue;
            }
            "resample" => {
                // `--resample 0.1:linear`.
                let value = option[length..].strip_prefix(' ').unwrap_or_default();
                let end = value.find(|c: char| !(c.is_ascii_alphanumeric() || ":.-".contains(c)));
                match value[..end.unwrap_or(value.len())].split_once(':') {
                    Some((step, how)) if step.parse::<f64>().is_ok() => {
                        text.push_str(&format!("resample=({step}, '{how}')"));
                        rest = &value[step.len() + 1 + how.len()..];
                        continue;
                    }
                    _ => text.push_str("resample"),
                }
            }
            other => text.push_str(&other.replace('-', "_")),
        }
        rest = &option[length..];
    }
    text + rest
}
