//! Plants that are ready: models in equations whose columns are named by their trade and whose start values are found
//! from the log.
//!
//! A [`Template`] says which columns it wants and in which units. From a log it makes a [`GreyBox`]: the equations, the
//! numbers from which a fit starts, and the figures that people of that trade ask for. What comes out is an ordinary
//! model: its text can be written out and changed.
//!
//! **Start values.** The equations are linear in the parameters, or in combinations of them, if the states are
//! measured: least squares on modulated signals finds them for windows of several lengths, or a grid of
//! time constants with least squares for the rest. Each candidate goes through the filter once; the one of the largest
//! likelihood is where the fit starts. All of that is deterministic.
//!
//! ```
//! use thetahat::data::{Channel, Log};
//! use thetahat::templates::Template;
//!
//! let template = Template::named("pendulum")?;
//! assert_eq!(template.columns[0].name, "angle");
//! assert!(Template::named("pendulun").unwrap_err().to_string().contains("did you mean 'pendulum'?"));
//!
//! // A pendulum of 0.5 m that swings.
//! let angle = |k: u32| 0.3 * (-0.05 * f64::from(k) * 0.02).exp() * (4.43 * f64::from(k) * 0.02).cos();
//! let log = Log::new(vec![Channel { name: "Angle [rad]".into(), values: (0..500).map(angle).collect() }], 0.02)?;
//! let names: Vec<String> = log.channels().iter().map(|channel| channel.name.clone()).collect();
//! let columns = template.columns_in(&names, &[])?;
//! let model = template.model(&log, &columns, &[], &[])?;
//! assert_eq!(model.outputs(), ["Angle [rad]"]);
//! # Ok::<(), thetahat::Error>(())
//! ```

mod battery;
mod columns;
mod draft;
mod exchanger;
mod mechanism;
mod modulated;
mod motor;
mod multirotor;
mod pendulum;
mod room;
mod spring;
mod start;
mod tank;
mod task;
#[cfg(test)]
mod tests;

pub use columns::Columns;

use std::fmt::Write;

use crate::Error;
use crate::data::{Log, Rows};
use crate::model::GreyBox;
use crate::text::suggestion;
use draft::Draft;
use task::Task;

/// A plant that is ready.
#[derive(Debug)]
pub struct Template {
    /// What it is called.
    pub name: &'static str,
    /// What it is, in a few words.
    pub title: &'static str,
    /// The columns that it wants.
    pub columns: &'static [Column],
    /// Numbers that it takes as known.
    pub settings: &'static [Setting],
    /// The parameters that a fit finds, with their units.
    pub parameters: &'static [(&'static str, &'static str)],
    draft: fn(&Task<'_>) -> Result<Vec<Draft>, Error>,
}

/// A column that a template wants.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Column {
    /// What it is called.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// What it is.
    pub meaning: &'static str,
    /// Whether the template does without it.
    pub optional: bool,
    /// What logs call it too.
    aliases: &'static [&'static str],
}

/// A number that a template takes as known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setting {
    /// What it is called.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Its value where none is given; none: it is found from the log, as `meaning` says.
    pub default: Option<f64>,
    /// What it is.
    pub meaning: &'static str,
}

/// All of them.
static TEMPLATES: [&Template; 13] = [
    &motor::MOTOR,
    &mechanism::MECHANISM,
    &mechanism::ELEVATOR,
    &mechanism::ARM,
    &battery::BATTERY,
    &battery::BATTERY_TWO,
    &room::ROOM,
    &room::ROOM_TWO,
    &tank::TANK,
    &pendulum::PENDULUM,
    &spring::SPRING,
    &exchanger::EXCHANGER,
    &multirotor::MULTIROTOR,
];

impl Template {
    /// All templates.
    pub fn all() -> &'static [&'static Template] {
        &TEMPLATES
    }

    /// The template of a name.
    ///
    /// # Errors
    /// [`Error::Argument`] if there is none, with the names that there are.
    pub fn named(name: &str) -> Result<&'static Self, Error> {
        TEMPLATES.iter().find(|template| template.name == name).copied().ok_or_else(|| {
            let names: Vec<&str> = TEMPLATES.iter().map(|template| template.name).collect();
            let near = suggestion(name, names.iter().copied());
            let brief = crate::text::brief(name, 40);
            Error::argument(
                "template",
                format!("there is no template '{brief}'{near}; there are {}", names.join(", ")),
            )
        })
    }

    /// Which columns of a log are which: those given as (name of the template, name in the log), and the others by
    /// their names, without regard to case and units.
    ///
    /// # Errors
    /// [`Error::Argument`] if a wanted column is not there, or several could be it, with those that are wanted.
    pub fn columns_in(&self, header: &[String], given: &[(String, String)]) -> Result<Columns, Error> {
        Columns::find(self, header, given)
    }

    /// The model of a log, with start values that are found from these rows of it; none: from all. What is `known` of
    /// settings and parameters is taken as it is.
    ///
    /// # Errors
    /// [`Error::Argument`] for a setting or parameter that the template does not have; [`Error::Data`] for a channel or
    /// rows that are not there; [`Error::Undetermined`] if the log cannot say the parameters, with the reason.
    pub fn model(
        &self,
        log: &Log,
        columns: &Columns,
        known: &[(String, f64)],
        rows: &[Rows],
    ) -> Result<GreyBox, Error> {
        let task = Task::new(self, log, columns, known, rows)?;
        let drafts = (self.draft)(&task)?;
        start::best(&task, drafts)
    }

    /// The columns that it wants with their units, in a few words.
    pub fn wants(&self) -> String {
        columns::wants(self.columns)
    }

    /// What it wants and finds, in lines.
    pub fn summary(&self) -> String {
        let mut text = format!("{}: {}\n\ncolumns\n", self.name, self.title);
        // Writing to a string cannot fail.
        for Column { name, unit, meaning, optional, .. } in self.columns {
            let optional = if *optional { ", may be missing" } else { "" };
            let _ = writeln!(text, "  {:<21} {meaning}{optional}", format!("{name} [{unit}]"));
        }
        if !self.settings.is_empty() {
            text.push_str("numbers that are known\n");
        }
        for Setting { name, unit, default, meaning } in self.settings {
            let value = default.map_or_else(String::new, |value| format!(" = {value}"));
            let _ = writeln!(text, "  {:<21} {meaning}", format!("{name}{value} {unit}").trim_end());
        }
        text.push_str("parameters that are found\n");
        for (name, unit) in self.parameters {
            let _ = writeln!(
                text,
                "  {name}{}",
                if unit.is_empty() { String::new() } else { format!(" [{unit}]") }
            );
        }
        text
    }
}
