//! Expressions of channels, such as sqrt(u): what a nonlinear ARX model reads beside the channels themselves.

use super::document::quoted;
use super::drive::Drive;
use super::expression::{self, Names};
use super::graph::{Graph, Leaves, Node, Operation};
use super::program::Program;

/// An expression of some channels, and its slopes.
#[derive(Debug, Clone)]
pub(crate) struct ChannelExpression {
    /// The channels that it reads, by their places among those that it may, in rising order.
    channels: Vec<usize>,
    /// Its value.
    value: Program,
    /// Its slope by each of these channels.
    slopes: Program,
}

/// Numbers that an evaluation works in, of any content.
#[derive(Debug, Clone, Default)]
pub(crate) struct ExpressionBuffer(Vec<f64>);

impl ChannelExpression {
    /// Reads an expression of channels with these names.
    ///
    /// # Errors
    /// What is wrong with it, in words.
    pub(crate) fn read(text: &str, names: &[&str]) -> Result<Self, String> {
        let mut graph = Graph::new();
        let nodes = (0..names.len()).map(|place| graph.leaf(Operation::Input(place))).collect();
        let scope = Scope { names, nodes };
        let node = expression::read(text, &mut graph, &scope).map_err(|fault| {
            let before = text.get(..fault.offset).unwrap_or(text).chars().count();
            format!("{} at character {}: {}", quoted(text), before + 1, fault.message)
        })?;
        let reads = |place: &usize| graph.depends(&[node], |operation| operation == Operation::Input(*place));
        let channels: Vec<usize> = (0..names.len()).filter(reads).collect();
        if channels.is_empty() {
            return Err(format!("{} reads no channel: it is a constant", quoted(text)));
        }
        let slopes: Vec<Node> =
            channels.iter().flat_map(|place| graph.derivatives(&[node], Operation::Input(*place))).collect();
        Ok(Self { value: Program::new(&graph, &[node]), slopes: Program::new(&graph, &slopes), channels })
    }

    /// The channels that it reads, by their places among the names, in rising order.
    pub(crate) fn channels(&self) -> &[usize] {
        &self.channels
    }

    /// Its value where all channels have these values, those that it reads at least.
    pub(crate) fn value(&self, channels: &[f64], buffer: &mut ExpressionBuffer) -> f64 {
        run(&self.value, channels, buffer).next().unwrap_or(f64::NAN)
    }

    /// Its values along channels of one length, each being this much above its values there.
    pub(crate) fn along(&self, channels: &[&[f64]], levels: &[f64]) -> Vec<f64> {
        let (mut now, mut buffer) = (levels.to_vec(), ExpressionBuffer::default());
        let rows = self.channels.iter().map(|place| channels[*place].len()).min().unwrap_or(0);
        let value = |t: usize| {
            for place in &self.channels {
                now[*place] = channels[*place][t] + levels[*place];
            }
            self.value(&now, &mut buffer)
        };
        (0..rows).map(value).collect()
    }

    /// Its slopes there, by each of the channels that it reads.
    pub(crate) fn slopes<'b>(
        &'b self,
        channels: &[f64],
        buffer: &'b mut ExpressionBuffer,
    ) -> impl Iterator<Item = f64> + use<'b> {
        run(&self.slopes, channels, buffer)
    }
}

fn run<'b>(
    program: &'b Program,
    channels: &[f64],
    ExpressionBuffer(values): &'b mut ExpressionBuffer,
) -> impl Iterator<Item = f64> + use<'b> {
    values.resize(values.len().max(program.size()), 0.0);
    let leaves = Leaves { inputs: Drive::held(channels), ..Leaves::of_parameters(&[]) };
    program.run(&leaves, values)
}

/// The names that may stand in it.
struct Scope<'n> {
    names: &'n [&'n str],
    nodes: Vec<Node>,
}

impl Names for Scope<'_> {
    fn node(&self, name: &str) -> Result<Option<Node>, String> {
        Ok(self.names.iter().position(|known| *known == name).map(|place| self.nodes[place]))
    }

    fn all(&self) -> Vec<&str> {
        self.names.to_vec()
    }
}

#[cfg(test)]
mod tests;
