//! A model in equations as it is put together, and its text.

use std::fmt::Write;

use super::task::Task;
use crate::model::toml_text;

/// A model, with the values from which a fit starts.
#[derive(Debug, Clone, Default)]
pub(super) struct Draft {
    /// What it is, in lines of a comment.
    pub(super) about: Vec<String>,
    pub(super) states: Vec<State>,
    /// Name in the equations, and the column of the template.
    pub(super) inputs: Vec<(&'static str, usize)>,
    pub(super) parameters: Vec<Parameter>,
    /// Whether the equations give the next state, not its derivative.
    pub(super) next: bool,
    /// Steps of the integration from row to row.
    pub(super) substeps: usize,
    /// State and its equation.
    pub(super) equations: Vec<(&'static str, String)>,
    pub(super) outputs: Vec<Output>,
    /// State, the output whose noise tells the scale, and what part of that a sample adds to the state, to start from.
    pub(super) process: Vec<(&'static str, usize, f64)>,
    pub(super) figures: Vec<Figure>,
}

#[derive(Debug, Clone)]
pub(super) struct State {
    pub(super) name: &'static str,
    pub(super) unit: &'static str,
    pub(super) start: f64,
    pub(super) deviation: f64,
}

#[derive(Debug, Clone)]
pub(super) struct Parameter {
    pub(super) name: String,
    pub(super) unit: String,
    pub(super) start: f64,
    /// How far off the start may be; none for what is known.
    pub(super) deviation: Option<f64>,
    pub(super) min: Option<f64>,
}

#[derive(Debug, Clone)]
pub(super) struct Output {
    /// The column of the template.
    pub(super) column: usize,
    pub(super) expression: String,
    pub(super) noise: f64,
}

#[derive(Debug, Clone)]
pub(super) struct Figure {
    pub(super) name: &'static str,
    pub(super) expression: &'static str,
    pub(super) unit: &'static str,
}

/// A figure.
pub(super) fn figure(name: &'static str, expression: &'static str, unit: &'static str) -> Figure {
    Figure { name, expression, unit }
}

impl Parameter {
    /// An unknown one above 0.
    pub(super) fn positive(name: impl Into<String>, unit: impl Into<String>, start: f64) -> Self {
        Self { name: name.into(), unit: unit.into(), start, deviation: Some(start.abs()), min: Some(0.0) }
    }

    /// An unknown one of any sign, which may be so far off.
    pub(super) fn free(name: impl Into<String>, unit: impl Into<String>, start: f64, deviation: f64) -> Self {
        Self { name: name.into(), unit: unit.into(), start, deviation: Some(deviation), min: None }
    }

    /// One that is known.
    pub(super) fn known(name: impl Into<String>, unit: impl Into<String>, value: f64) -> Self {
        Self { name: name.into(), unit: unit.into(), start: value, deviation: None, min: None }
    }
}

impl Draft {
    /// Whether all its numbers can stand in a model.
    pub(super) fn is_possible(&self) -> bool {
        self.parameters.iter().all(|parameter| {
            parameter.start.is_finite() && parameter.min.is_none_or(|min| parameter.start > min)
        })
    }

    /// The text, in TOML. What the task knows of its parameters is known.
    pub(super) fn toml(&self, task: &Task<'_>) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        for line in &self.about {
            let _ = writeln!(text, "# {line}");
        }
        let _ = writeln!(text, "sample_time = {}", task.step);
        if self.substeps > 1 {
            let _ = writeln!(text, "substeps = {}", self.substeps);
        }
        text.push_str("\n[states]\n");
        for State { name, unit, start, deviation } in &self.states {
            let line = format!("{name} = {{ start = {}, sd = {} }}", short(*start), short(*deviation));
            let _ = writeln!(text, "{line:<44} # {unit}");
        }
        if !self.inputs.is_empty() {
            text.push_str("\n[inputs]\n");
        }
        for (name, column) in &self.inputs {
            let line = format!("{name} = {}", toml_text(task.channel(*column)));
            let _ = writeln!(text, "{line:<44} # {}", task.template.columns[*column].unit);
        }
        text.push_str("\n[parameters]\n");
        for parameter in &self.parameters {
            let _ = writeln!(text, "{}", parameter.line(task));
        }
        let _ = writeln!(text, "\n[{}]", if self.next { "next" } else { "derivative" });
        for (state, expression) in &self.equations {
            let _ = writeln!(text, "{state} = \"{expression}\"");
        }
        text.push_str("\n[outputs]\n");
        for Output { column, expression, .. } in &self.outputs {
            let line = format!("{} = \"{expression}\"", toml_text(task.channel(*column)));
            let _ = writeln!(text, "{line:<44} # {}", task.template.columns[*column].unit);
        }
        text.push_str("\n[noise]\n");
        let noise = |kind: &str, name: &str, key: &str, start: f64, min: f64| {
            task.known(&format!("{kind}.{name}")).map_or_else(
                || {
                    let min = if min > 0.0 { format!(", min = {}", short(min)) } else { String::new() };
                    format!("{key} = {{ start = {}, unknown = true{min} }}", short(start))
                },
                |value| format!("{key} = {value}"),
            )
        };
        if !self.process.is_empty() {
            let each = self.process.iter().map(|(state, output, part)| {
                noise("process", state, state, part * self.outputs[*output].noise, 0.0)
            });
            let _ = writeln!(text, "process = {{ {} }}", each.collect::<Vec<_>>().join(", "));
        }
        // A sensor is not better than a part of what its values scatter by from row to row, or are rounded to.
        let each = self.outputs.iter().map(|output| {
            let (channel, least) = (task.channel(output.column), 0.1 * task.noise(output.column));
            noise("measurement", channel, &toml_text(channel), output.noise.max(2.0 * least), least)
        });
        let _ = writeln!(text, "measurement = {{ {} }}", each.collect::<Vec<_>>().join(", "));
        if !self.figures.is_empty() {
            text.push_str("\n[figures]\n");
        }
        for Figure { name, expression, unit } in &self.figures {
            let _ = match *unit {
                "" => writeln!(text, "{name} = \"{expression}\""),
                unit => writeln!(text, "{name} = {{ value = \"{expression}\", unit = \"{unit}\" }}"),
            };
        }
        text
    }
}

impl Parameter {
    fn line(&self, task: &Task<'_>) -> String {
        let Self { name, unit, start, deviation, min } = self;
        match (task.known(name), deviation) {
            (Some(value), _) => {
                format!("{:<44} # {unit}", format!("{name} = {value}")).trim_end_matches("# ").to_owned()
            }
            (None, None) => format!("{:<44} # {unit}", format!("{name} = {}", short(*start)))
                .trim_end_matches("# ")
                .to_owned(),
            (None, Some(deviation)) => {
                let min = min.map_or_else(String::new, |min| format!(", min = {min}"));
                let unit = if unit.is_empty() { String::new() } else { format!(", unit = \"{unit}\"") };
                let (start, deviation) = (short(*start), short(deviation.max(1e-300)));
                format!("{name} = {{ start = {start}, sd = {deviation}, unknown = true{min}{unit} }}")
            }
        }
    }
}

/// A number with six digits.
fn short(value: f64) -> String {
    let rounded: f64 = format!("{value:.5e}").parse().unwrap_or(value) + 0.0;
    if rounded != 0.0 && !(1e-4..1e7).contains(&rounded.abs()) {
        format!("{rounded:e}")
    } else {
        format!("{rounded}")
    }
}
