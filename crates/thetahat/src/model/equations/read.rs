//! From the text of a model to its programs.

use super::document::{Document, Entry, Section, error_at, quoted, suggestion};
use super::dynamics::{Functions, Step};
use super::expression::{self, CONSTANTS, Names};
use super::graph::{Graph, Leaves, Node, Operation};
use super::linearized::Entrances;
use super::noise::{Nodes, Noise, Reader};
use super::parameter::{Given, parameters};
use super::program::Program;
use super::{Figures, GreyBox, Unknown};
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
        "signals",
        "next",
        "derivative",
        "outputs",
        "noise",
        "figures",
    ])?;
    let sample_time = root.require("sample_time", "the seconds of a sample")?.positive()?;
    let needed = |key: &str, what: &str| root.require(key, what)?.section();
    let states = needed("states", "a table of the states, such as [states] x = { start = 0, sd = 1 }")?;
    let states = match states.entries() {
        none if none.is_empty() => {
            return Err(states.error("[states] is empty: a model has at least one state"));
        }
        some => some,
    };
    let (inputs, lines) =
        root.section("inputs")?.map_or(Ok((Vec::new(), Vec::new())), |section| inputs(&section))?;
    let parameters = match root.section("parameters")? {
        Some(section) => parameters(&section, known)?,
        None => Vec::new(),
    };
    let unknowns = parameters.iter().filter(|(_, parameter)| matches!(parameter, Given::Unknown(_)));
    let estimated: Vec<&Entry<'_>> = states.iter().chain(unknowns.map(|(entry, _)| entry)).collect();
    few(&estimated, "states and unknown parameters together")?;
    few(&inputs.iter().map(|(entry, _)| entry).collect::<Vec<_>>(), "inputs")?;
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
            Given::Unknown(parameter) => parameter.join(&mut unknown, &mut graph),
        };
        scope.declare(entry.key, node, &entry)?;
    }
    let last_parameter = scope.names.len();
    let mut reader = Reader { scope: &scope, graph: &mut graph, unknown: &mut unknown, known };
    let started = states.iter().map(|state| reader.start(state)).collect::<Result<Vec<_>, _>>()?;
    for signal in root.section("signals")?.iter().flat_map(Section::entries) {
        let node = scope.read(&signal, &mut graph)?;
        scope.declare(signal.key, node, &signal)?;
    }

    let (step, equations) = equations(&root)?;
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
    if let Some((entry, channel)) =
        inputs.iter().find(|(_, channel)| outputs.iter().any(|out| out.key == channel))
    {
        return Err(entry.value_error(format!(
            "the channel {} is an output too: it can only be one of them",
            quoted(channel)
        )));
    }
    let noise = needed("noise", "a table of standard deviations, such as [noise] measurement = { y = 0.1 }")?;
    let mut reader = Reader { scope: &scope, graph: &mut graph, unknown: &mut unknown, known };
    let [process, measurement] = reader.noises(&noise, &states, &outputs)?;
    let estimated = states.len() + unknown.len();
    if estimated > MOST {
        let message = format!(
            "there are {estimated} states and unknown parameters together, and equations have up to {MOST}"
        );
        return Err(noise.error(message));
    }
    let place = |place: usize| started.iter().map(move |nodes| nodes[place]);
    let nodes = Nodes { start: place(0).chain(place(1)).collect(), process, measurement };
    let acts = [&rates[..], &seen[..], &nodes.start[..]].concat();
    for (index, unknown) in unknown.iter_mut().enumerate() {
        unknown.of_noise = !graph.depends(&acts, |operation| operation == Operation::Parameter(index));
    }
    let noise = Noise::new(&graph, &nodes);

    let (transition, first) = functions(&mut graph, &rates, states.len(), unknown.len());
    let (observation, second) = functions(&mut graph, &seen, states.len(), unknown.len());
    let all: Vec<Node> = rates.iter().chain(&seen).copied().collect();
    let is_state = |operation| matches!(operation, Operation::State(_));
    let noises = [&nodes.process[..], &nodes.measurement[..]].concat();
    let by_states: Vec<Node> = first.iter().chain(&second).copied().collect();
    let bends = |operation| matches!(operation, Operation::State(_) | Operation::Parameter(_));
    let linear = unknown.is_empty()
        && !graph.depends(&by_states, bends)
        && !graph.jumps(&all, is_state)
        && !graph.depends(&noises, is_state);
    let drives = graph.drives();
    let entrances = Entrances::new(&mut graph, &drives, &rates, &seen);
    let is_linear = |graph: &mut Graph, functions: &[Node], by_states: Vec<Node>| {
        let mut slopes = by_states;
        drives.iter().for_each(|&drive| slopes.extend(graph.derivatives(functions, drive)));
        !graph.depends(&slopes, Operation::moves) && !graph.jumps(functions, Operation::moves)
    };
    let is_affine_in_states = !graph.depends(&by_states, Operation::moves) && !graph.jumps(&all, is_state);
    let superposes = is_linear(&mut graph, &all, by_states);
    let known_names = &scope.names[first_parameter..last_parameter];
    let figures = Figures::read(root.section("figures")?, known_names, unknown.len(), &mut graph)?;
    let any_step = step != Step::Next || graph.depends(&rates, |operation| operation == Operation::Step);
    let step = match step {
        Step::Integrated(count)
            if !graph.depends(&[&rates[..], &nodes.process[..]].concat(), |leaf| leaf == Operation::Time)
                && !graph.depends(&nodes.process, Operation::moves)
                && is_linear(&mut graph, &rates, first) =>
        {
            Step::Exact(count)
        }
        other => other,
    };
    let goes_in_line = |operation| match operation {
        Operation::Input(input) | Operation::Delayed(input, ..) => lines.get(input).copied().unwrap_or(false),
        _ => false,
    };
    let has_lines = graph.depends(&rates, goes_in_line);
    if let Some((entry, _)) = inputs.iter().zip(&lines).find(|(_, line)| **line).map(|(input, _)| input)
        && step == Step::Next
    {
        return Err(entry.value_error(
            "hold = \"linear\" goes with [derivative]: [next] knows an input at its rows alone",
        ));
    }
    Ok(GreyBox {
        text: text.to_owned(),
        sample_time,
        states: states.iter().map(|state| state.key.to_owned()).collect(),
        outputs: outputs.iter().map(|entry| entry.key.to_owned()).collect(),
        linear,
        superposes,
        is_affine_in_states,
        any_step,
        bends: has_lines,
        delays: longest_delays(&graph, inputs.len(), &unknown),
        inputs: inputs.into_iter().map(|(_, channel)| channel).collect(),
        linear_holds: lines,
        unknown,
        known: known.to_vec(),
        step,
        transition,
        observation,
        entrances,
        noise,
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

/// The longest delay of each input with parameters as they start; none of one that acts at once.
fn longest_delays(graph: &Graph, inputs: usize, unknown: &[Unknown]) -> Vec<Option<f64>> {
    let delays = graph.drives().into_iter().filter_map(|drive| match drive {
        Operation::Delayed(input, _, delay) => Some((input, delay)),
        _ => None,
    });
    let (places, nodes): (Vec<usize>, Vec<Node>) = delays.unzip();
    let program = Program::new(graph, &nodes);
    let z: Vec<f64> = unknown.iter().map(|unknown| unknown.start_variable().0).collect();
    let mut longest = vec![None; inputs];
    let mut numbers = vec![0.0; program.size()];
    for (place, delay) in places.into_iter().zip(program.run(&Leaves::of_parameters(&z), &mut numbers)) {
        longest[place] = Some(longest[place].map_or(delay, |longest: f64| longest.max(delay)));
    }
    longest
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
pub(super) struct Scope<'d> {
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
    pub(super) fn read(&self, entry: &Entry<'_>, graph: &mut Graph) -> Result<Node, Error> {
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

/// The channels of the inputs, and which of these go from row to row in straight lines: none if the list is empty.
type Inputs<'d> = (Vec<(Entry<'d>, String)>, Vec<bool>);

fn inputs<'d>(section: &Section<'d>) -> Result<Inputs<'d>, Error> {
    let mut inputs: Vec<(Entry<'d>, String)> = Vec::new();
    let mut lines = Vec::new();
    for entry in section.entries() {
        let channel = if entry.is_table() {
            let table = entry.section()?;
            table.allow(&["channel", "hold"])?;
            let hold = table.get("hold").map(|hold| hold.one_of(&["zero", "linear"])).transpose()?;
            lines.push(hold == Some("linear"));
            table.require("channel", "the channel of the log")?.text()?.to_owned()
        } else {
            lines.push(false);
            entry.text()?.to_owned()
        };
        if inputs.iter().any(|(_, other)| *other == channel) {
            return Err(entry.value_error(format!("the channel {} is there twice", quoted(&channel))));
        }
        inputs.push((entry, channel));
    }
    if !lines.contains(&true) {
        lines.clear();
    }
    Ok((inputs, lines))
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
