//! Some nodes of a graph, as a list of operations to be run from its beginning to its end.

use std::sync::Arc;

use thetahat_core::Number;

use super::graph::{self, Graph, Leaves, Node, Operation};
use super::table::Table;

/// The operations that some nodes need, in order, and where their values end up.
#[derive(Debug, Clone)]
pub(crate) struct Program {
    operations: Vec<Operation>,
    /// Those that are another number from row to row: the others are made of parameters and the length of a step.
    moving: Vec<usize>,
    results: Vec<usize>,
    tables: Vec<Arc<Table>>,
}

/// The numbers of a program that ran last with these parameters and this length of a step.
#[derive(Debug, Clone, Default)]
pub(super) struct Kept<S> {
    parameters: Vec<S>,
    step: f64,
    values: Vec<S>,
}

impl<S> Kept<S> {
    pub(super) const fn new() -> Self {
        Self { parameters: Vec::new(), step: 0.0, values: Vec::new() }
    }
}

impl Program {
    /// What computes these nodes, and nothing else.
    pub(super) fn new(graph: &Graph, roots: &[Node]) -> Self {
        let alive = graph.alive(roots);
        let mut places = vec![0; alive.len()];
        let mut operations = Vec::new();
        for (node, operation) in graph.operations().iter().enumerate().filter(|(node, _)| alive[*node]) {
            places[node] = operations.len();
            operations.push(operation.moved(|argument| places[argument]));
        }
        let mut moves = vec![false; operations.len()];
        for (place, operation) in operations.iter().enumerate() {
            let mut arguments = operation.arguments().into_iter().flatten();
            moves[place] = operation.moves() || arguments.any(|argument| moves[argument]);
        }
        let moving = (0..moves.len()).filter(|place| moves[*place]).collect();
        let results = roots.iter().map(|&root| places[root]).collect();
        Self { operations, moving, results, tables: graph.tables().to_vec() }
    }

    /// The tables that the operations name.
    pub(crate) fn tables(&self) -> &[Arc<Table>] {
        &self.tables
    }

    /// How many nodes it computes.
    pub(crate) fn results(&self) -> usize {
        self.results.len()
    }

    /// What it computes where nothing is unknown and nothing varies.
    pub(crate) fn constants(&self) -> Vec<f64> {
        self.run::<f64>(&Leaves::of_parameters(&[]), &mut vec![0.0; self.size()]).collect()
    }

    /// The operations that the first `count` nodes need, each with its place, and the places of these nodes.
    pub(crate) fn first(&self, count: usize) -> (Vec<(usize, Operation)>, &[usize]) {
        let results = self.results.get(..count).unwrap_or(&self.results);
        let mut needed = vec![false; self.operations.len()];
        results.iter().for_each(|place| needed[*place] = true);
        for (place, operation) in self.operations.iter().enumerate().rev() {
            if needed[place] {
                operation.arguments().into_iter().flatten().for_each(|argument| needed[argument] = true);
            }
        }
        let all = self.operations.iter().copied().enumerate();
        (all.filter(|(place, _)| needed[*place]).collect(), results)
    }

    /// How many numbers [`run`](Program::run) needs to work in.
    pub(super) fn size(&self) -> usize {
        self.operations.len()
    }

    /// Computes the nodes, in the order in which they were given. `values` has [`size`](Program::size) numbers, of any
    /// content.
    pub(super) fn run<'s, S: Number<f64>>(
        &'s self,
        leaves: &Leaves<'_, S>,
        values: &'s mut [S],
    ) -> impl Iterator<Item = S> + use<'s, S> {
        for (place, &operation) in self.operations.iter().enumerate() {
            values[place] = graph::value(operation, &self.tables, leaves, values);
        }
        self.results.iter().map(|&place| values[place])
    }

    /// The same, where it runs from row to row: what is made of parameters alone is computed once for each of them. In
    /// dual numbers, derivatives must be by the same variables each time. Nothing is allocated after the first run.
    pub(super) fn run_on<'s, S: Number<f64>>(
        &'s self,
        leaves: &Leaves<'_, S>,
        kept: &'s mut Kept<S>,
    ) -> impl Iterator<Item = S> + use<'s, S> {
        let is_kept = kept.values.len() == self.size()
            && kept.step == leaves.step
            && kept.parameters == leaves.parameters;
        let Kept { parameters, step, values } = kept;
        if is_kept {
            for &place in &self.moving {
                values[place] = graph::value(self.operations[place], &self.tables, leaves, values);
            }
        } else {
            parameters.clear();
            parameters.extend_from_slice(leaves.parameters);
            *step = leaves.step;
            values.resize(self.size(), S::from(0.0));
            let _ = self.run(leaves, values);
        }
        self.results.iter().map(|&place| values[place])
    }
}
