//! Parameters of a model in equations: known numbers, and unknown ones with what is known of them.

use super::document::{Entry, Section, quoted};
use super::graph::{Graph, Node, Operation};
use super::scale::Scale;
use crate::Error;

/// A parameter that is to be found.
#[derive(Debug, Clone)]
pub(crate) struct Unknown {
    pub(crate) name: String,
    pub(crate) scale: Scale,
    /// In the parameter's own unit.
    pub(crate) start: f64,
    pub(crate) deviation: f64,
    pub(crate) walk: f64,
    /// Its unit, if the model tells it.
    pub(crate) unit: Option<String>,
    /// Whether nothing but noises depends on it: it moves no prediction.
    pub(crate) of_noise: bool,
}

impl Unknown {
    /// Takes its place after those before. The node of its value.
    pub(super) fn join(self, unknown: &mut Vec<Self>, graph: &mut Graph) -> Node {
        let z = graph.leaf(Operation::Parameter(unknown.len()));
        let node = self.scale.node(graph, z);
        unknown.push(self);
        node
    }

    /// Whether it may have a value: inside its bounds, and for a noise at the lower one.
    pub(super) fn may_be(&self, value: f64) -> bool {
        self.scale.contains(value) || (self.of_noise && self.scale.value(f64::NEG_INFINITY) == value)
    }

    /// What the parameter starts from after the change of variable: z, and its standard deviation.
    pub(crate) fn start_variable(&self) -> (f64, f64) {
        let z = self.scale.variable(self.start);
        (z, self.deviation / self.scale.slope(z).abs())
    }

    /// The standard deviation by which z drifts each sample: as p does where it starts.
    pub(crate) fn walk_variable(&self) -> f64 {
        self.walk / self.scale.slope(self.scale.variable(self.start)).abs()
    }

    /// The change of variable in words; none without bounds.
    pub(crate) fn change_of_variable(&self) -> Option<String> {
        self.scale.words(&self.name)
    }
}

/// What a model says of a parameter.
pub(super) enum Given {
    Known(f64),
    Unknown(Unknown),
}

pub(super) fn parameters<'d>(
    section: &Section<'d>,
    known: &[(String, f64)],
) -> Result<Vec<(Entry<'d>, Given)>, Error> {
    let entries = section.entries().into_iter();
    entries.map(|entry| parameter(&entry, known).map(|given| (entry, given))).collect()
}

/// A number, or what is known of an unknown one.
fn parameter(entry: &Entry<'_>, known: &[(String, f64)]) -> Result<Given, Error> {
    if !entry.is_table() {
        return Ok(Given::Known(entry.number()?));
    }
    let section = entry.section()?;
    section.allow(&["start", "sd", "unknown", "min", "max", "walk", "unit"])?;
    let unit = section.text("unit")?.map(str::to_owned);
    let walk = section.get("walk").map(|walk| walk.non_negative()).transpose()?.unwrap_or(0.0);
    let given = limited(&section, entry.key, known, section.number("min")?, |start| match start.abs() {
        0.0 => Err(section.error(format!(
            "the unknown parameter {} starts at 0 and needs 'sd', how far off that may be",
            quoted(entry.key)
        ))),
        spread => Ok(spread),
    })?;
    Ok(match given {
        Given::Unknown(unknown) => Given::Unknown(Unknown { walk, unit, ..unknown }),
        known => known,
    })
}

/// A standard deviation as a table: it is above 0 unless `min` says another bound, and may be off by as much as it is.
pub(super) fn noise_parameter(
    entry: &Entry<'_>,
    name: &str,
    known: &[(String, f64)],
) -> Result<Given, Error> {
    let section = entry.section()?;
    section.allow(&["start", "sd", "unknown", "min", "max"])?;
    let min = section.get("min").map(|min| min.non_negative()).transpose()?;
    limited(&section, name, known, Some(min.unwrap_or(0.0)), Ok)
}

/// A number with what is known of it. `spread` is how far off its start may be where it is not said.
fn limited(
    section: &Section<'_>,
    name: &str,
    known: &[(String, f64)],
    min: Option<f64>,
    spread: impl FnOnce(f64) -> Result<f64, Error>,
) -> Result<Given, Error> {
    let start = section.require("start", "the value that the parameter starts from")?;
    let (value, max) = (start.number()?, section.number("max")?);
    if let (Some(low), Some(high), Some(entry)) = (min, max, section.get("max"))
        && low >= high
    {
        return Err(entry.value_error(format!("'max' is {high}, but 'min' is {low}: it must be above it")));
    }
    let scale = Scale::new(min, max);
    if !scale.contains(value) {
        let bounds = match scale {
            Scale::Free => "finite".to_owned(),
            Scale::Above(min) => format!("above {min}"),
            Scale::Below(max) => format!("below {max}"),
            Scale::Between(min, max) => format!("between {min} and {max}"),
        };
        return Err(start.value_error(format!("{} starts at {value}: it must be {bounds}", quoted(name))));
    }
    let deviation = section.get("sd").map(|sd| sd.positive()).transpose()?;
    if !section.get("unknown").map_or(Ok(false), |flag| flag.flag())? {
        let idle = ["sd", "min", "max", "walk"].into_iter().find_map(|key| section.get(key));
        return match idle.filter(|_| section.get("unknown").is_none()) {
            Some(idle) => Err(idle.error(format!(
                "{} is of no use for a parameter that is known: add unknown = true, or write {name} = {value}",
                quoted(idle.key),
            ))),
            None => Ok(Given::Known(value)),
        };
    }
    if let Some((_, value)) = known.iter().find(|(known, _)| known == name) {
        return Ok(Given::Known(*value));
    }
    let deviation = deviation.map_or_else(|| spread(value), Ok)?;
    let name = name.to_owned();
    Ok(Given::Unknown(Unknown {
        name,
        scale,
        start: value,
        deviation,
        walk: 0.0,
        unit: None,
        of_noise: false,
    }))
}
