//! What stands in the comments of an exported file.

use super::{Language, Plan, Precision, Purpose};
use crate::control::Control;
use crate::data::text_digest;
use crate::model::Signal;
use crate::report::Report;
use crate::text::harmless;
use crate::{Document, Error};

/// What a reader of the file should know.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Head {
    /// Such as `predictor of ARX(2, 2, 3)`.
    pub(super) what: String,
    lines: Vec<String>,
}

impl Head {
    /// # Errors
    /// [`Error::Report`] if the report cannot be written.
    pub(super) fn new(
        report: &Report,
        plan: &Plan,
        equations: &[String],
        start: &str,
    ) -> Result<Self, Error> {
        let model = &report.model;
        let what = format!("{} of {}", plan.purpose.word(), model.name());
        let mut lines = vec![
            format!(
                "{what}, written by thetahat {} of the report with the digest",
                env!("CARGO_PKG_VERSION")
            ),
            format!("{}.", text_digest(&report.to_json()?)),
            String::new(),
        ];
        lines.extend(equations.iter().cloned());
        lines.push(String::new());
        lines.push(format!("Sample time {} s. It starts {start}.", model.sample_time()));
        let named = |place: usize, letter: char, signal: &Signal| {
            format!(
                "{letter}[{place}] is '{}', in its own unit, with the offset {}.",
                harmless(&signal.name),
                signal.offset.level
            )
        };
        lines.extend(model.inputs().iter().enumerate().map(|(place, signal)| named(place, 'u', signal)));
        lines.extend(model.outputs().iter().enumerate().map(|(place, signal)| named(place, 'y', signal)));
        if plan.purpose == Purpose::Recursive {
            lines.push(
                "Where an output is missing (NaN), or a sample that predicts it, nothing is corrected."
                    .to_owned(),
            );
        } else {
            lines.extend(
                [
                    "A number that is not finite is missing: an input keeps its value before, the first ones their offset, and an output",
                    "corrects nothing. Each function gives how many of the numbers that it takes are missing.",
                ]
                .map(str::to_owned),
            );
            lines.extend(finite_math(plan.language));
        }
        lines.push(match plan.precision {
            Precision::F64 => "Compiled without contraction of a * b + c (-ffp-contract=off), its bits are those of the test vector.".to_owned(),
            Precision::F32 => "Constants are the nearest in single precision.".to_owned(),
        });
        Ok(Self { what, lines })
    }

    /// That of a controller.
    ///
    /// # Errors
    /// [`Error::Report`] if the document cannot be written.
    pub(super) fn of_controller(document: &Control, language: Language) -> Result<Self, Error> {
        let signal = |what: &str, signal: &Signal| {
            format!(
                "{what} '{}', in its own unit, with the working point {}.",
                harmless(&signal.name),
                signal.offset.level
            )
        };
        let mut lines = vec![
            format!(
                "controller, written by thetahat {} of the document with the digest",
                env!("CARGO_PKG_VERSION")
            ),
            format!("{}.", text_digest(&document.to_json()?)),
            String::new(),
            harmless(&document.design),
            format!("of a model: {}", harmless(&document.model)),
            String::new(),
            format!("Sample time {} s. It starts at rest at the working point.", document.sample_time),
            signal("It moves", &document.input),
            signal("It holds", &document.output),
            "Where the set point or the measurement is not finite the input stays as it was.".to_owned(),
        ];
        lines.extend(finite_math(language));
        Ok(Self { what: "controller".to_owned(), lines })
    }

    /// Comments of both languages.
    pub(super) fn comments(&self) -> String {
        let line = |line: &String| if line.is_empty() { "//\n".to_owned() } else { format!("// {line}\n") };
        self.lines.iter().map(line).chain(["\n".to_owned()]).collect()
    }
}

/// Why C does not compile in some ways.
fn finite_math(language: Language) -> Option<String> {
    let why = "With -ffast-math or -ffinite-math-only a compiler takes every number for finite, and misses those: the source refuses them.";
    (language == Language::C).then(|| why.to_owned())
}
