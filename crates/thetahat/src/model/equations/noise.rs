//! What is uncertain in a model: its start, what noise adds to its states, and its measurements.

use thetahat_core::nalgebra::DMatrix;
use thetahat_core::{Dual, Number};

use super::document::{Entry, Section, quoted, suggestion};
use super::drive::Drive;
use super::dynamics::Work;
use super::graph::{Graph, Leaves, Node, Operation};
use super::parameter::{Given, noise_parameter};
use super::program::Program;
use super::read::Scope;
use super::{GreyBox, Unknown};
use crate::Error;

/// Standard deviations as they are written are squared: all of these are variances.
#[derive(Debug, Clone)]
pub(super) struct Noise {
    /// The state at the first row, then its variances: functions of the parameters.
    start: Program,
    /// What a sample adds to the variance of each state.
    process: Program,
    /// Those of the outputs.
    measurement: Program,
    /// Whether the two before are functions of parameters alone.
    is_constant: [bool; 2],
    /// Whether no noise moves the states.
    is_absent: bool,
}

/// The nodes of the same.
pub(super) struct Nodes {
    pub(super) start: Vec<Node>,
    pub(super) process: Vec<Node>,
    pub(super) measurement: Vec<Node>,
}

impl Noise {
    pub(super) fn new(graph: &Graph, nodes: &Nodes) -> Self {
        let is_constant = |nodes: &[Node]| !graph.depends(nodes, Operation::moves);
        Self {
            start: Program::new(graph, &nodes.start),
            process: Program::new(graph, &nodes.process),
            measurement: Program::new(graph, &nodes.measurement),
            is_constant: [is_constant(&nodes.process), is_constant(&nodes.measurement)],
            is_absent: nodes.process.iter().all(|node| graph.known(*node) == Some(0.0)),
        }
    }
}

impl GreyBox {
    /// The state at the first row, and its variances.
    pub(crate) fn start<S: Number<f64>>(
        &self,
        z: &[S],
        mean: &mut [S],
        variances: &mut [S],
        work: &mut Work<S>,
    ) {
        let (program, leaves) = (&self.noise.start, Leaves::of_parameters(z));
        let results = program.run(&leaves, work.reserve(program.size()));
        for (place, result) in mean.iter_mut().chain(variances).zip(results) {
            *place = result;
        }
    }

    /// The state at the first row, and its variances, with the unknown parameters as they start; and the derivatives of
    /// that state by their variables, a row for each state.
    pub(crate) fn started(&self) -> (Vec<f64>, Vec<f64>, DMatrix<f64>) {
        let (n, p) = (self.states.len(), self.unknown.len());
        let mut slopes = DMatrix::zeros(n, p);
        let mut z: Vec<Dual<f64, 1>> =
            self.unknown.iter().map(|unknown| Dual::from(unknown.start_variable().0)).collect();
        let (mut mean, mut variances) = (vec![Dual::from(0.0); n], vec![Dual::from(0.0); n]);
        let mut work = Work::new();
        for parameter in 0..p.max(1) {
            z.iter_mut().enumerate().for_each(|(index, z)| z.derivatives[0] = f64::from(index == parameter));
            self.start(&z, &mut mean, &mut variances, &mut work);
            let by_parameter = mean.iter().map(|state| state.derivatives[0]);
            slopes.column_iter_mut().nth(parameter).into_iter().for_each(|mut column| {
                column.iter_mut().zip(by_parameter.clone()).for_each(|(slope, own)| *slope = own);
            });
        }
        let values = |of: &[Dual<f64, 1>]| of.iter().map(|number| number.value).collect();
        (values(&mean), values(&variances), slopes)
    }

    /// What noise adds to the variance of each state over some seconds.
    pub(super) fn process_variances<S: Number<f64>>(
        &self,
        leaves: &Leaves<'_, S>,
        seconds: f64,
        variances: &mut [S],
        work: &mut Work<S>,
    ) {
        let (program, share) = (&self.noise.process, seconds / self.sample_time);
        for (place, result) in variances.iter_mut().zip(program.run_on(leaves, &mut work.process)) {
            *place = result * share;
        }
    }

    /// The variance of the noise of each output.
    pub(crate) fn measurement_variances<S: Number<f64>>(
        &self,
        x: &[S],
        z: &[S],
        u: Drive<'_>,
        t: f64,
        variances: &mut [S],
        work: &mut Work<S>,
    ) {
        let (program, leaves) = (&self.noise.measurement, self.at(x, z, u, t));
        for (place, result) in variances.iter_mut().zip(program.run_on(&leaves, &mut work.measurement)) {
            *place = result;
        }
    }

    /// The same where the model begins, with inputs that are 0.
    pub(crate) fn measurement_variances_at_start(&self) -> Vec<f64> {
        let z: Vec<f64> = self.unknown.iter().map(|unknown| unknown.start_variable().0).collect();
        let (x, u) = (self.started().0, vec![0.0; self.inputs.len()]);
        let mut variances = vec![0.0; self.outputs.len()];
        self.measurement_variances(&x, &z, Drive::held(&u), 0.0, &mut variances, &mut Work::new());
        variances
    }

    /// Whether the covariances of a filter depend on parameters and the steps alone: the equations are linear in the
    /// states, whose derivatives are the same at any time, and so are the noises.
    pub(crate) fn has_constant_covariances(&self) -> bool {
        self.is_affine_in_states && self.noise.is_constant == [true; 2]
    }

    /// Whether states that are known stay known, whatever the equations: no noise moves them.
    pub(crate) fn keeps_certainty(&self) -> bool {
        self.noise.is_absent && self.noise.is_constant == [true; 2]
    }

    /// The programs of the variances, per sample of the states, and of the outputs, each with whether it is the same in
    /// every row.
    pub(crate) fn compiled_variances(&self) -> [(&Program, bool); 2] {
        let [process, measurement] = self.noise.is_constant;
        [(&self.noise.process, process), (&self.noise.measurement, measurement)]
    }
}

/// What the entries of a model are read with: names, the graph that grows, and parameters, of which some are known.
pub(super) struct Reader<'r, 'd> {
    pub(super) scope: &'r Scope<'d>,
    pub(super) graph: &'r mut Graph,
    pub(super) unknown: &'r mut Vec<Unknown>,
    pub(super) known: &'r [(String, f64)],
}

impl Reader<'_, '_> {
    /// The start of a state, and its variance.
    pub(super) fn start(&mut self, state: &Entry<'_>) -> Result<[Node; 2], Error> {
        let section = state.section()?;
        section.allow(&["start", "sd"])?;
        let what =
            "the standard deviation of what is known of the state at the first row; 0: it is known exactly";
        let deviation = section.require("sd", what)?;
        if !deviation.is_text() {
            deviation.non_negative()?;
        }
        let mut read = |entry: &Entry<'_>| {
            let node = self.scope.read(entry, self.graph)?;
            if self.graph.depends(&[node], Operation::moves) {
                let message = "a state begins before the first row is known: give a number, or an expression of parameters";
                return Err(entry.value_error(message));
            }
            Ok(node)
        };
        let mean = section.get("start").map_or(Ok(Graph::ZERO), |start| read(&start))?;
        let deviation = read(&deviation)?;
        Ok([mean, self.graph.multiply(deviation, deviation)])
    }

    /// The variances of states and outputs: those of states that are not named are 0.
    pub(super) fn noises(
        &mut self,
        section: &Section<'_>,
        states: &[Entry<'_>],
        outputs: &[Entry<'_>],
    ) -> Result<[Vec<Node>; 2], Error> {
        section.allow(&["process", "measurement"])?;
        let process = match section.section("process")? {
            None => vec![Graph::ZERO; states.len()],
            Some(table) => {
                check_names(&table, states, "state")?;
                let variance = |state: &Entry<'_>| match table.get(state.key) {
                    None => Ok(Graph::ZERO),
                    Some(entry) => self.variance(&entry, &format!("process.{}", state.key), true),
                };
                states.iter().map(variance).collect::<Result<_, Error>>()?
            }
        };
        let table = section
            .require("measurement", "the standard deviation of the noise of each output")?
            .section()?;
        check_names(&table, outputs, "output")?;
        let measurement = outputs.iter().map(|output| {
            let entry = table.require(output.key, "the standard deviation of the noise of this output")?;
            self.variance(&entry, &format!("measurement.{}", output.key), false)
        });
        Ok([process, measurement.collect::<Result<_, Error>>()?])
    }

    /// The square of a standard deviation: a number, an expression, or what is known of an unknown one, which becomes a
    /// parameter of this name. It may be 0 where that is said.
    fn variance(&mut self, entry: &Entry<'_>, name: &str, may_vanish: bool) -> Result<Node, Error> {
        let deviation = if entry.is_text() {
            let node = self.scope.read(entry, self.graph)?;
            if !may_vanish && self.graph.known(node) == Some(0.0) {
                return Err(entry.value_error("this standard deviation is 0: it must be above 0"));
            }
            node
        } else if entry.is_table() {
            match noise_parameter(entry, name, self.known)? {
                Given::Known(value) => self.graph.constant(value),
                Given::Unknown(parameter) => parameter.join(self.unknown, self.graph),
            }
        } else {
            let number = if may_vanish { entry.non_negative() } else { entry.positive() };
            self.graph.constant(number?)
        };
        Ok(self.graph.multiply(deviation, deviation))
    }
}

/// That a table names nothing but entries.
fn check_names(table: &Section<'_>, entries: &[Entry<'_>], kind: &str) -> Result<(), Error> {
    let stray = |entry: &Entry<'_>| !entries.iter().any(|known| known.key == entry.key);
    match table.entries().into_iter().find(stray) {
        None => Ok(()),
        Some(entry) => {
            let near = suggestion(entry.key, entries.iter().map(|known| known.key));
            Err(entry.error(format!("{} is no {kind} of the model{near}", quoted(entry.key))))
        }
    }
}
