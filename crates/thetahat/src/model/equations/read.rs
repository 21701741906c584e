//! From the text of a model to its programs.

use super::document::{Document, Entry, Section, error_at, quoted, suggestion};
use super::dynamics::{Functions, Step};
use super::expression::{self, CONSTANTS, Names};
use super::graph::{Graph, Node, Operation};
use super::program::Program;
use super::{Figures, GreyBox, Scale, Unknown};
use crate::Error;

/// Most substeps of a step.
const MOST_SUBSTEPS: f64 = 1000.0;
/// Most states and unknown parameters together, inputs, and outputs: a row of a filter takes the cube of the first.
const MOST: usize = 200;

/// Reads a model; parameters in `known` are known, whatever the text says.
pub(super) fn model(text: &str, known: &[(String, f64)]) -> Result<GreyBox, Error> {
    let document = Document::parse(text)?;
    let root = document.root();
    root.allow(&[
        "sample_time",
        "substeps",
        "states",
        "inputs",
        "parameters",
        "next",
        "derivative",
        "outputs",
        "noise",
        "figures",
    ])?;
    let sample_time = root.require("sample_time", "the seconds of a sample")?.positive()?;
    let needed = |key: &str, what: &str| root.require(key, what)?.section();
    let (states, start, start_deviations) =
        states(&needed("states", "a table of the states, such as [states] x = { start = 0, sd = 1 }")?)?;
    let inputs = root.section("inputs")?.map_or(Ok(Vec::new()), |section| inputs(&section))?;
    let parameters = match root.section("parameters")? {
        Some(section) => parameters(&section, known)?,
        None => Vec::new(),
    };
    let unknowns = parameters.iter().filter(|(_, parameter)| matches!(parameter, Given::Unknown(_)));
    let estimated: Vec<&Entry<'_>> = states.iter().chain(unknowns.map(|(entry, _)| entry)).collect();
    few(&estimated, "states and unknown parameters together")?;
    few(&inputs.iter().map(|(entry, _)| entry).collect::<Vec<_>>(), "inputs")?;
    let (step, equations) = equations(&root)?;

    let mut graph = Graph::new();
    let mut scope = Scope { names: Vec::new(), time: graph.leaf(Operation::Time), step: None };
    for (index, state) in states.iter().enumerate() {
        let node = graph.leaf(Operation::State(index));
        scope.declare(state.key, node, state)?;
    }
    for (index, (entry, _)) in inputs.iter().enumerate() {
        let node = graph.leaf(Operation::Input(index));
        scope.declare(entry.key, node, entry)?;
    }
    let mut unknown = Vec::new();
    let first_parameter = scope.names.len();
    for (entry, parameter) in parameters {
        let node = match parameter {
            Given::Known(value) => graph.constant(value),
            Given::Unknown(parameter) => {
                let variable = graph.leaf(Operation::Parameter(unknown.len()));
                let node = parameter.scale.node(&mut graph, variable);
                unknown.push(parameter);
                node
            }
        };
        scope.declare(entry.key, node, &entry)?;
    }

    let written = equations.entries();
    if let Some(entry) = written.iter().find(|entry| !states.iter().any(|state| state.key == entry.key)) {
        let near = suggestion(entry.key, states.iter().map(|state| state.key));
        return Err(entry.error(format!("{} is no state, so it has no equation{near}", quoted(entry.key))));
    }
    if step == Step::Next {
        scope.step = Some(graph.leaf(Operation::Step));
    }
    let mut rates = Vec::with_capacity(states.len());
    for state in &states {
        let table = if step == Step::Next { "next" } else { "derivative" };
        let entry = equations.get(state.key).ok_or_else(|| {
            state.error(format!("the state {} has no equation: add it to [{table}]", quoted(state.key)))
        })?;
        rates.push(scope.read(&entry, &mut graph)?);
    }
    scope.step = None;
    let observed = needed("outputs", "a table of channel = expression, such as [outputs] y = \"x\"")?;
    let outputs = observed.entries();
    if outputs.is_empty() {
        return Err(observed.error("[outputs] is empty: a filter needs something that is measured"));
    }
    few(&outputs.iter().collect::<Vec<_>>(), "outputs")?;
    let seen = outputs.iter().map(|entry| scope.read(entry, &mut graph)).collect::<Result<Vec<_>, _>>()?;
    if let Some((entry, _)) = inputs.iter().find(|(_, channel)| outputs.iter().any(|out| out.key == channel))
    {
        return Err(entry.value_error(format!(
            "the channel {} is an output too: it can only be one of them",
            quoted(entry.text()?)
        )));
    }
    let noise = needed("noise", "a table of standard deviations, such as [noise] measurement = { y = 0.1 }")?;
    let (process_variances, measurement_variances) = noises(&noise, &states, &outputs)?;

    let (transition, first) = functions(&mut graph, &rates, states.len(), unknown.len());
    let (observation, second) = functions(&mut graph, &seen, states.len(), unknown.len());
    let mut slopes: Vec<Node> = first.into_iter().chain(second).collect();
    let bends = |operation| matches!(operation, Operation::State(_) | Operation::Parameter(_));
    let all: Vec<Node> = rates.iter().chain(&seen).copied().collect();
    let is_state = |operation| matches!(operation, Operation::State(_));
    let linear = unknown.is_empty() && !graph.depends(&slopes, bends) && !graph.jumps(&all, is_state);
    let moves = |operation| matches!(operation, Operation::State(_) | Operation::Input(_) | Operation::Time);
    for input in 0..inputs.len() {
        slopes.extend(graph.derivatives(&all, Operation::Input(input)));
    }
    let superposes = !graph.depends(&slopes, moves) && !graph.jumps(&all, moves);
    let known_names = &scope.names[first_parameter..];
    let figures = Figures::read(root.section("figures")?, known_names, unknown.len(), &mut graph)?;
    let any_step = step != Step::Next || graph.depends(&rates, |operation| operation == Operation::Step);
    Ok(GreyBox {
        text: text.to_owned(),
        sample_time,
        start,
        start_deviations,
        states: states.iter().map(|state| state.key.to_owned()).collect(),
        inputs: inputs.into_iter().map(|(_, channel)| channel).collect(),
        outputs: outputs.iter().map(|entry| entry.key.to_owned()).collect(),
        linear,
        superposes,
        unknown,
        known: known.to_vec(),
        step,
        any_step,
        transition,
        observation,
        process_variances,
        measurement_variances,
        figures,
    })
}

/// That there are no more of something than a filter can take.
fn few(entries: &[&Entry<'_>], what: &str) -> Result<(), Error> {
    match entries.get(MOST) {
        Some(entry) => {
            Err(entry.error(format!("there are {} {what}, and equations have up to {MOST}", entries.len())))
        }
        None => Ok(()),
    }
}

/// The programs of some nodes and their derivatives, and the derivatives by the states.
fn functions(graph: &mut Graph, roots: &[Node], states: usize, parameters: usize) -> (Functions, Vec<Node>) {
    let mut slopes = Vec::new();
    for state in 0..states {
        slopes.extend(graph.derivatives(roots, Operation::State(state)));
    }
    let mut all: Vec<Node> = roots.iter().chain(&slopes).copied().collect();
    let by_state = Program::new(graph, &all);
    for parameter in 0..parameters {
        all.extend(graph.derivatives(roots, Operation::Parameter(parameter)));
    }
    (Functions { by_state, full: Program::new(graph, &all) }, slopes)
}

/// What the names of the equations stand for.
struct Scope<'d> {
    names: Vec<(&'d str, Node)>,
    time: Node,
    /// None where `dt` may not stand.
    step: Option<Node>,
}

impl<'d> Scope<'d> {
    fn declare(&mut self, name: &'d str, node: Node, entry: &Entry<'_>) -> Result<(), Error> {
        check_name(name, entry)?;
        if self.names.iter().any(|(other, _)| *other == name) {
            return Err(
                entry.error(format!("the name {} is there twice: give one of them another", quoted(name)))
            );
        }
        self.names.push((name, node));
        Ok(())
    }

    /// The expression of an entry.
    fn read(&self, entry: &Entry<'_>, graph: &mut Graph) -> Result<Node, Error> {
        expression_of(entry, graph, self)
    }
}

/// The expression of an entry: a text, or a mere number.
pub(super) fn expression_of(entry: &Entry<'_>, graph: &mut Graph, names: &impl Names) -> Result<Node, Error> {
    if !entry.is_text() {
        return Ok(graph.constant(entry.number()?));
    }
    let (origin, exact) = entry.text_origin();
    let node = expression::read(entry.text()?, graph, names).map_err(|fault| {
        let offset = if exact { origin + fault.offset } else { origin };
        error_at(entry.document(), offset, fault.message)
    })?;
    match graph.known(node) {
        Some(value) if !value.is_finite() => {
            Err(entry.value_error("this expression is not a finite number, whatever the states are"))
        }
        _ => Ok(node),
    }
}

impl Names for Scope<'_> {
    fn node(&self, name: &str) -> Result<Option<Node>, String> {
        match name {
            "t" => Ok(Some(self.time)),
            "dt" if self.step.is_none() => Err(
                "'dt' stands only in [next]: an output has no step, and [derivative] is in continuous time"
                    .to_owned(),
            ),
            "dt" => Ok(self.step),
            _ => Ok(self.names.iter().find(|(known, _)| *known == name).map(|(_, node)| *node)),
        }
    }

    fn all(&self) -> Vec<&str> {
        let own = self.names.iter().map(|(name, _)| *name);
        own.chain(CONSTANTS.into_iter().filter(|name| *name != "dt" || self.step.is_some())).collect()
    }
}

/// That a name can stand in an expression.
pub(super) fn check_name(name: &str, entry: &Entry<'_>) -> Result<(), Error> {
    if expression::is_reserved(name) || name == "log" {
        return Err(entry.error(format!("{} has a meaning in expressions: take another name", quoted(name))));
    }
    if !expression::is_name(name) {
        return Err(entry.error(format!(
            "{} cannot stand in an expression: a name has letters, digits and '_', and begins with no digit",
            quoted(name)
        )));
    }
    Ok(())
}

/// The states, where they start, and the standard deviations of that.
type States<'d> = (Vec<Entry<'d>>, Vec<f64>, Vec<f64>);

fn states<'d>(section: &Section<'d>) -> Result<States<'d>, Error> {
    let entries = section.entries();
    if entries.is_empty() {
        return Err(section.error("[states] is empty: a model has at least one state"));
    }
    let (mut starts, mut deviations) = (Vec::new(), Vec::new());
    for entry in &entries {
        let state = entry.section()?;
        state.allow(&["start", "sd"])?;
        starts.push(state.number("start")?.unwrap_or(0.0));
        let what =
            "the standard deviation of what is known of the state at the first row; 0: it is known exactly";
        deviations.push(state.require("sd", what)?.non_negative()?);
    }
    Ok((entries, starts, deviations))
}

fn inputs<'d>(section: &Section<'d>) -> Result<Vec<(Entry<'d>, String)>, Error> {
    let mut inputs: Vec<(Entry<'d>, String)> = Vec::new();
    for entry in section.entries() {
        let channel = entry.text()?.to_owned();
        if inputs.iter().any(|(_, other)| *other == channel) {
            return Err(entry.value_error(format!("the channel {} is there twice", quoted(&channel))));
        }
        inputs.push((entry, channel));
    }
    Ok(inputs)
}

/// What a model says of a parameter.
enum Given {
    Known(f64),
    Unknown(Unknown),
}

fn parameters<'d>(section: &Section<'d>, known: &[(String, f64)]) -> Result<Vec<(Entry<'d>, Given)>, Error> {
    let entries = section.entries().into_iter();
    entries.map(|entry| parameter(&entry, known).map(|given| (entry, given))).collect()
}

fn parameter(entry: &Entry<'_>, known: &[(String, f64)]) -> Result<Given, Error> {
    if !entry.is_table() {
        return Ok(Given::Known(entry.number()?));
    }
    let section = entry.section()?;
    section.allow(&["start", "sd", "unknown", "min", "max", "walk", "unit"])?;
    let start = section.require("start", "the value that the parameter starts from")?;
    let value = start.number()?;
    let (min, max) = (section.number("min")?, section.number("max")?);
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
        return Err(
            start.value_error(format!("{} starts at {value}: it must be {bounds}", quoted(entry.key)))
        );
    }
    let deviation = section.get("sd").map(|sd| sd.positive()).transpose()?;
    let walk = section.get("walk").map(|walk| walk.non_negative()).transpose()?;
    if !section.get("unknown").map_or(Ok(false), |flag| flag.flag())? {
        let idle = ["sd", "min", "max", "walk"].into_iter().find_map(|key| section.get(key));
        return match idle.filter(|_| section.get("unknown").is_none()) {
            Some(idle) => Err(idle.error(format!(
                "{} is of no use for a parameter that is known: add unknown = true, or write {} = {value}",
                quoted(idle.key),
                entry.key
            ))),
            None => Ok(Given::Known(value)),
        };
    }
    if let Some((_, value)) = known.iter().find(|(name, _)| name == entry.key) {
        return Ok(Given::Known(*value));
    }
    let deviation = deviation.ok_or_else(|| {
        section.error(format!(
            "the unknown parameter {} needs 'sd', how far off its start may be",
            quoted(entry.key)
        ))
    })?;
    let name = entry.key.to_owned();
    let unit = section.text("unit")?.map(str::to_owned);
    Ok(Given::Unknown(Unknown { name, scale, start: value, deviation, walk: walk.unwrap_or(0.0), unit }))
}

/// How the states move on, and the table that says it.
fn equations<'d>(root: &Section<'d>) -> Result<(Step, Section<'d>), Error> {
    match (root.section("next")?, root.section("derivative")?) {
        (Some(next), None) => match root.get("substeps") {
            Some(substeps) => Err(substeps.error("'substeps' goes with [derivative], here is [next]")),
            None => Ok((Step::Next, next)),
        },
        (None, Some(derivative)) => {
            let count = match root.get("substeps") {
                None => 1.0,
                Some(entry) => {
                    let count = entry.number()?;
                    if count.fract() != 0.0 || !(1.0..=MOST_SUBSTEPS).contains(&count) {
                        let message = format!("'substeps' must be a whole number from 1 to {MOST_SUBSTEPS}");
                        return Err(entry.value_error(message));
                    }
                    count
                }
            };
            Ok((Step::Integrated(count as usize), derivative))
        }
        (Some(_), Some(both)) => Err(both.error("there are both [next] and [derivative]: give one of them")),
        (None, None) => Err(root.error(
            "there are no equations: give [next] with the next value of each state, or [derivative] with its derivative",
        )),
    }
}

/// The variances of states and outputs.
fn noises(
    section: &Section<'_>,
    states: &[Entry<'_>],
    outputs: &[Entry<'_>],
) -> Result<(Vec<f64>, Vec<f64>), Error> {
    section.allow(&["process", "measurement"])?;
    let known = |table: &Section<'_>, entries: &[Entry<'_>], kind: &str| {
        let stray = |entry: &Entry<'_>| !entries.iter().any(|known| known.key == entry.key);
        match table.entries().into_iter().find(stray) {
            None => Ok(()),
            Some(entry) => {
                let near = suggestion(entry.key, entries.iter().map(|known| known.key));
                Err(entry.error(format!("{} is no {kind} of the model{near}", quoted(entry.key))))
            }
        }
    };
    let mut process = vec![0.0; states.len()];
    if let Some(table) = section.section("process")? {
        known(&table, states, "state")?;
        for (variance, state) in process.iter_mut().zip(states) {
            *variance = table.get(state.key).map_or(Ok(0.0), |entry| entry.non_negative())?.powi(2);
        }
    }
    let table =
        section.require("measurement", "the standard deviation of the noise of each output")?.section()?;
    known(&table, outputs, "output")?;
    let measurement = outputs.iter().map(|output| {
        let what = "the standard deviation of the noise of this output";
        Ok(table.require(output.key, what)?.positive()?.powi(2))
    });
    Ok((process, measurement.collect::<Result<_, Error>>()?))
}
