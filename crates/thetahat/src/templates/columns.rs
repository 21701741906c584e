//! Which column of a log is which of a template.

use super::{Column, Template};
use crate::Error;
use crate::text::{brief, suggestion};

/// The columns of a log that serve a template, in the order of its own.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Columns {
    /// The name in the log; none for one that is missing.
    names: Vec<Option<String>>,
}

/// What may stand after a name as its unit.
const UNITS: [&str; 37] = [
    "a", "ma", "amp", "amps", "v", "mv", "volt", "volts", "w", "kw", "watt", "watts", "m", "mm", "cm", "rad",
    "deg", "s", "rad_s", "rads", "m_s", "mps", "n", "nm", "degc", "deg_c", "c", "celsius", "k", "w_m2",
    "m3_s", "l_min", "kg_s", "l_s", "units", "percent", "pct",
];

impl Columns {
    pub(super) fn find(
        template: &Template,
        header: &[String],
        given: &[(String, String)],
    ) -> Result<Self, Error> {
        let wanted = template.columns;
        let mut names: Vec<Option<String>> = vec![None; wanted.len()];
        for (role, column) in given {
            let Some(place) = wanted.iter().position(|wanted| wanted.name == role) else {
                let near = suggestion(role, wanted.iter().map(|wanted| wanted.name));
                let message =
                    format!("{} has no column '{}'{near}; {}", template.name, brief(role, 40), wants(wanted));
                return Err(Error::argument("columns", message));
            };
            if !header.iter().any(|name| name == column) {
                let near = suggestion(column, header.iter().map(String::as_str));
                let message = format!("the log has no column '{}'{near}; {}", brief(column, 40), has(header));
                return Err(Error::argument("columns", message));
            }
            if names.iter().flatten().any(|name| name == column) || names[place].is_some() {
                let message = format!(
                    "'{role}={}': each column has one role, and each role one column",
                    brief(column, 40)
                );
                return Err(Error::argument("columns", message));
            }
            names[place] = Some(column.clone());
        }
        for (place, column) in wanted
            .iter()
            .enumerate()
            .filter(|(place, _)| given.iter().all(|(role, _)| role != wanted[*place].name))
        {
            let free = |name: &&String| !given.iter().any(|(_, taken)| taken == *name);
            let fitting = |rank: usize| -> Vec<&String> {
                header.iter().filter(free).filter(|name| rank_of(column, name) == Some(rank)).collect()
            };
            // By its own name rather than by another.
            let found = (0..3).map(fitting).find(|found| !found.is_empty()).unwrap_or_default();
            match found.as_slice() {
                [one] => names[place] = Some((*one).clone()),
                [] if column.optional => {}
                [] => return Err(missing(template, column, header)),
                several => {
                    let several: Vec<String> =
                        several.iter().map(|name| format!("'{}'", brief(name, 24))).collect();
                    let message = format!(
                        "{} of the log may be {}; say which, such as {}={}",
                        several.join(" and "),
                        column.name,
                        column.name,
                        several[0].trim_matches('\'')
                    );
                    return Err(Error::argument("columns", message));
                }
            }
        }
        Ok(Self { names })
    }

    /// The name in the log of the template's column at this place.
    pub(super) fn name(&self, place: usize) -> Option<&str> {
        self.names.get(place).and_then(Option::as_deref)
    }

    /// The columns of the log that serve.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.names.iter().flatten().map(String::as_str)
    }

    /// In words: which is which, where the names differ; empty where they do not.
    pub fn described(&self, template: &Template) -> String {
        let pairs = template.columns.iter().zip(&self.names);
        let pairs = pairs.filter_map(|(column, name)| {
            name.as_deref()
                .filter(|name| *name != column.name)
                .map(|name| format!("{} is column '{}'", column.name, brief(name, 40)))
        });
        pairs.collect::<Vec<_>>().join(", ")
    }
}

/// How well a name of a log fits a column: 0 by its own name, 1 by another one, 2 by another with a unit after it.
fn rank_of(column: &Column, name: &str) -> Option<usize> {
    let plain = plain(name);
    let with_unit = |own: &str| {
        plain
            .strip_prefix(own)
            .and_then(|rest| rest.strip_prefix('_'))
            .is_some_and(|unit| UNITS.contains(&unit))
    };
    if plain == column.name || with_unit(column.name) {
        Some(0)
    } else if column.aliases.contains(&plain.as_str()) {
        Some(1)
    } else {
        column.aliases.iter().any(|alias| with_unit(alias)).then_some(2)
    }
}

/// A name in small letters without a unit in brackets; what is no letter and no digit is one `_`.
fn plain(name: &str) -> String {
    let end = name.find(['[', '(']).filter(|at| *at > 0).unwrap_or(name.len());
    let words = name.get(..end).unwrap_or(name).to_lowercase();
    let words = words.split(|letter: char| !letter.is_alphanumeric()).filter(|word| !word.is_empty());
    words.collect::<Vec<_>>().join("_")
}

fn missing(template: &Template, column: &Column, header: &[String]) -> Error {
    let message = format!(
        "no column of the log is called {}; {} {}; {}; say which is which, such as {}=NAME",
        column.name,
        template.name,
        wants(template.columns),
        has(header),
        column.name
    );
    Error::argument("columns", message)
}

/// What a template wants, in words.
pub(super) fn wants(columns: &[Column]) -> String {
    let each = columns.iter().map(|column| {
        let optional = if column.optional { " if it is there" } else { "" };
        format!("{} [{}]{optional}", column.name, column.unit)
    });
    format!("wants {}", each.collect::<Vec<_>>().join(", "))
}

fn has(header: &[String]) -> String {
    const MOST: usize = 12;
    let names: Vec<String> = header.iter().take(MOST).map(|name| brief(name, 24)).collect();
    format!("the log has {}{}", names.join(", "), if header.len() > MOST { ", …" } else { "" })
}
