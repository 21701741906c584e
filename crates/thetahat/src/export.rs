//! Fitted models as source code for firmware: Rust and C99 that need no heap, with every number in it.
//!
//! [`export`] takes a [`Report`] and a [`Plan`] and gives [`Exported`]: files by their names, and what to warn of. It
//! opens and writes none. [`export_controller`] does so with the document of a controller. What a step computes is one
//! small program for each kind of model, in the order of operations of [`respond`](crate::respond); both languages are
//! written from it, and so is the interpreter that makes the test vectors. So they say the same numbers, to the bit in
//! double precision.
//!
//! A program starts at rest at the offsets. Signals are in the units of their channels: offsets and scales are in the
//! files.
//!
//! ```
//! use thetahat::data::{Channel, Log};
//! use thetahat::export::{Language, Plan, Precision, Purpose, export};
//! use thetahat::model::Orders;
//! use thetahat::report::identify;
//!
//! let u: Vec<f64> = (0..200).map(|t| f64::from(t * t % 7)).collect();
//! let y = [vec![0.0], u[..199].to_vec()].concat();
//! let channel = |name: &str, values| Channel { name: name.into(), values };
//! let log = Log::new(vec![channel("u", u), channel("y", y)], 0.1)?;
//! let report = identify(log.clone(), &[], &thetahat::report::Plan::new(&["u"], "y", Orders::arx(1, &[1], &[1])?))?;
//!
//! let plan = Plan { language: Language::C, purpose: Purpose::Predictor, precision: Precision::F32, name: "plant".into() };
//! let exported = export(&report, &plan, Some((&log, &[])))?;
//! let names: Vec<&str> = exported.files.iter().map(|file| file.name.as_str()).collect();
//! assert_eq!(names, ["plant.h", "plant.c", "plant.csv", "plant_test.c"]);
//! assert!(exported.files[0].text.contains("unsigned int plant_predict(plant_state *self, const float u[1], float y[1]);"));
//! # Ok::<(), thetahat::Error>(())
//! ```

mod c;
mod controller;
mod equations;
mod head;
mod interpret;
mod map;
mod nonlinear_arx;
mod polynomial;
mod process;
mod program;
mod recursive;
mod rust;
mod signals;
mod state_space;
#[cfg(test)]
mod tests;
mod vector;
mod writer;

use std::str::FromStr;

use crate::Error;
use crate::control::Control;
use crate::data::{Log, Rows};
use crate::model::Model;
use crate::report::{Report, SAME_TIME};
use controller::Controller;
use head::Head;
use program::Program;
use vector::{Columns, Vector};

/// A language.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Language {
    /// One module, which may use `thetahat-core`.
    Rust,
    /// C99: one header and one source.
    C,
}

/// What is made of a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// Predicts the next output from what was measured before.
    Predictor,
    /// Runs freely, driven by the inputs alone.
    Simulator,
    /// Estimates the state.
    Observer,
    /// Goes on estimating the parameters, from what the fit knows.
    Recursive,
    /// Says what to do.
    Controller,
}

/// The precision of the numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// Single.
    F32,
    /// Double.
    F64,
}

/// Reads a word of a list.
fn word_of<T: Copy>(argument: &str, words: &[(&str, T)], text: &str) -> Result<T, Error> {
    words.iter().find(|(word, _)| *word == text).map(|(_, value)| *value).ok_or_else(|| {
        let words: Vec<&str> = words.iter().map(|(word, _)| *word).collect();
        Error::argument(
            argument,
            format!("'{}' is none; take one of {}", crate::text::brief(text, 40), words.join(", ")),
        )
    })
}

impl FromStr for Language {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        word_of("to", &[("rust", Self::Rust), ("c", Self::C)], text)
    }
}

impl Purpose {
    const WORDS: [(&str, Self); 5] = [
        ("predictor", Self::Predictor),
        ("simulator", Self::Simulator),
        ("observer", Self::Observer),
        ("recursive", Self::Recursive),
        ("controller", Self::Controller),
    ];

    /// What it is called.
    pub fn word(self) -> &'static str {
        Self::WORDS.iter().find(|(_, own)| *own == self).map_or("", |(word, _)| word)
    }
}

impl FromStr for Purpose {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        word_of("what", &Self::WORDS, text)
    }
}

impl FromStr for Precision {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        word_of("precision", &[("f32", Self::F32), ("f64", Self::F64)], text)
    }
}

impl Precision {
    /// The nearest number of this precision.
    fn rounded(self, value: f64) -> f64 {
        match self {
            Self::F32 => f64::from(value as f32),
            Self::F64 => value,
        }
    }

    /// That finite numbers, by the names that the source gives them, are finite in it.
    ///
    /// # Errors
    /// [`Error::Argument`] with the first that is not.
    fn check<'a>(self, numbers: impl IntoIterator<Item = (&'a str, &'a [f64])>) -> Result<(), Error> {
        let is_lost = |value: &&f64| value.is_finite() && !self.rounded(**value).is_finite();
        for (name, values) in numbers {
            if let Some(value) = values.iter().find(is_lost) {
                let message = format!(
                    "{name} has the number {value:e}, which single precision does not hold; take f64"
                );
                return Err(Error::argument("precision", message));
            }
        }
        Ok(())
    }
}

/// What to write.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Plan {
    /// The language.
    pub language: Language,
    /// What is made of the model.
    pub purpose: Purpose,
    /// The precision of all numbers.
    pub precision: Precision,
    /// What files, types and functions are called: a lower-case letter, then lower-case letters, digits and
    /// underscores.
    pub name: String,
}

impl Plan {
    /// The names of the files, with those of a test vector or without.
    pub fn files(&self, with_vector: bool) -> Vec<String> {
        let (own, test): (&[&str], _) = match self.language {
            Language::C => (&[".h", ".c"], "_test.c"),
            Language::Rust => (&[".rs"], "_test.rs"),
        };
        let vector: &[&str] = if with_vector { &[".csv", test] } else { &[] };
        own.iter().chain(vector).map(|end| format!("{}{end}", self.name)).collect()
    }
}

/// A file of an export.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ExportedFile {
    /// Its name, without a folder.
    pub name: String,
    /// What it holds.
    pub text: String,
}

/// What an export gives.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Exported {
    /// The files.
    pub files: Vec<ExportedFile>,
    /// What a careful reader should know.
    pub warnings: Vec<String>,
}

/// What a model computes, and what is to be said of it.
#[derive(Debug, Clone, PartialEq)]
struct Form {
    program: Program,
    equations: Vec<String>,
    /// Where it starts.
    start: String,
}

/// Writes a model as source code, and with rows of a log a test vector along them beside it: a CSV of inputs, outputs
/// and expected results, and a program that steps along it. No rows are all rows.
///
/// # Errors
/// [`Error::Argument`] for a name that is none, and for what the model cannot be: the message says what it can;
/// [`Error::Report`] if a number has no meaning beside its log, as an offset that is a line; [`Error::Data`] for
/// channels or rows that the log does not have.
pub fn export(report: &Report, plan: &Plan, log: Option<(&Log, &[Rows])>) -> Result<Exported, Error> {
    check_name(&plan.name)?;
    let model = &report.model;
    if plan.purpose == Purpose::Controller {
        return Err(Error::argument(
            "what",
            "a model is no controller: design one for it with thetahat control, and export its document",
        ));
    }
    if plan.purpose == Purpose::Recursive {
        return recursive::exported(report, plan, log);
    }
    let form = form(model, plan.purpose)?;
    plan.precision.check(form.program.constants())?;
    let head = Head::new(report, plan, &form.equations, &form.start)?;
    let Plan { language, precision, name, .. } = plan;
    if *language == Language::C && form.program.maps.iter().any(|map| map.statements.is_none()) {
        return Err(Error::argument(
            "to",
            "nearest neighbours are searched by thetahat-core alone; take rust, or fit another map",
        ));
    }
    let mut files = match language {
        Language::C => c::files(&form.program, name, *precision, &head),
        Language::Rust => vec![rust::file(&form.program, name, *precision, &head)],
    };
    let mut warnings = Vec::new();
    if let Some((log, rows)) = log {
        crate::report::check_sample_time(model, log)?;
        let vector = Vector::new(&form.program, model, *precision, (log, rows))?;
        files.push(vector.csv(name));
        files.push(match language {
            Language::C => c::check(&form.program, name, *precision, &vector),
            Language::Rust => rust::check(&form.program, name, *precision, &vector),
        });
        warnings.extend(vector.warning());
    }
    Ok(Exported { files, warnings })
}

/// Writes a controller as source code: C, or Rust around [`RstController`](thetahat_core::RstController). With rows of
/// a log there is a test vector beside it, as [`export`] has it: in each row the controller gets the measurement, and
/// then the input that acted. A log has no set point: it goes between the highest and the lowest measurement of the
/// rows, every 25 of them.
///
/// # Errors
/// [`Error::Argument`] for a name that is none, and a plan for something else; [`Error::Report`] for coefficients that
/// are none, and a working point that moves; [`Error::Data`] for a log of another sample time, and for channels or rows
/// that it does not have.
pub fn export_controller(
    document: &Control,
    plan: &Plan,
    log: Option<(&Log, &[Rows])>,
) -> Result<Exported, Error> {
    check_name(&plan.name)?;
    if plan.purpose != Purpose::Controller {
        return Err(refused(plan.purpose, "a controller", "controller"));
    }
    let controller = Controller::new(document)?;
    plan.precision.check(controller.constants())?;
    let head = Head::of_controller(document, plan.language)?;
    let (program, Plan { language, precision, name, .. }) = (controller::program(&controller), plan);
    let mut files = match language {
        Language::C => c::files(&program, name, *precision, &head),
        Language::Rust => vec![controller::rust(&controller, plan, &head)],
    };
    let mut warnings = Vec::new();
    if let Some((log, rows)) = log {
        if (log.sample_time() / document.sample_time - 1.0).abs() > SAME_TIME {
            return Err(Error::data(format!(
                "the log's sample time is {} s, the controller's {} s; resample the log, or design a controller for it",
                log.sample_time(),
                document.sample_time
            )));
        }
        let vector = Vector::along(&program, *precision, Columns::of_controller(document, log, rows)?)?;
        files.push(vector.csv(name));
        files.push(match language {
            Language::C => c::check(&program, name, *precision, &vector),
            Language::Rust => controller::rust_check(plan, &vector),
        });
        warnings.extend(vector.warning());
    }
    Ok(Exported { files, warnings })
}

/// The program of a model of any kind.
fn form(model: &Model, purpose: Purpose) -> Result<Form, Error> {
    match model {
        Model::Polynomial(own) => polynomial::form(model, own, purpose),
        Model::NonlinearArx(own) => nonlinear_arx::form(model, own, purpose),
        Model::Process(own) => process::form(model, own, purpose),
        Model::StateSpace(own) => state_space::form(model, own, purpose),
        Model::ContinuousStateSpace(own) => {
            let sampled = own.sampled(own.sample_time, own.hold)?;
            state_space::form(model, &sampled, purpose)
        }
        Model::Equations(own) => equations::form(model, own, purpose),
    }
}

/// That a model cannot be something.
fn refused(purpose: Purpose, model: &str, instead: &str) -> Error {
    Error::argument("what", format!("{model} is exported as no {}; take {instead}", purpose.word()))
}

/// Words that are taken in C, C++ or Rust, and names that a file of the standard library or of the core in C has.
const TAKEN: [&str; 25] = [
    "auto", "break", "case", "char", "const", "crate", "double", "else", "enum", "float", "fn", "for", "if",
    "int", "let", "loop", "main", "math", "mod", "self", "state", "struct", "thetahat", "type", "while",
];

fn check_name(name: &str) -> Result<(), Error> {
    let begins = name.starts_with(|letter: char| letter.is_ascii_lowercase());
    let goes_on =
        name.chars().all(|letter| letter.is_ascii_lowercase() || letter.is_ascii_digit() || letter == '_');
    if begins && goes_on && name.len() <= 60 && !TAKEN.contains(&name) {
        return Ok(());
    }
    Err(Error::argument(
        "name",
        format!(
            "'{}' is no name of a file, a type and functions; give a lower-case letter, then lower-case letters, digits and underscores",
            crate::text::brief(name, 40)
        ),
    ))
}
