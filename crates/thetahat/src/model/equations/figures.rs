//! Figures that follow from the parameters of a model in equations, with their standard errors.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::document::{Section, quoted};
use super::expression::Names;
use super::graph::{Graph, Leaves, Node, Operation};
use super::program::Program;
use super::{GreyBox, read};
use crate::Error;

/// A figure that follows from the parameters of a model, such as a time constant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DerivedFigure {
    /// Its name in `[figures]`.
    pub name: String,
    /// Its value; none where the expression has none with these parameters.
    pub value: Option<f64>,
    /// By the delta method: √(g' P g), g being the derivatives by the parameters and P their covariance. None without a
    /// value.
    pub standard_error: Option<f64>,
    /// Its unit, if the model tells it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
}

/// The figures of a model: what they are called, and what computes them.
#[derive(Debug, Clone)]
pub(super) struct Figures {
    /// Name and unit.
    names: Vec<(String, Option<String>)>,
    /// The values, then their derivatives by each unknown parameter after its change of variable.
    program: Program,
}

impl Figures {
    /// Reads `[figures]`: expressions of parameters and of figures above. Those whose names begin with `_` only serve
    /// others.
    pub(super) fn read<'d>(
        section: Option<Section<'d>>,
        parameters: &[(&'d str, Node)],
        unknown: usize,
        graph: &mut Graph,
    ) -> Result<Self, Error> {
        let mut scope = Scope { names: parameters.to_vec() };
        let (mut names, mut roots) = (Vec::new(), Vec::new());
        for entry in section.iter().flat_map(Section::entries) {
            let (written, unit) = if entry.is_table() {
                let figure = entry.section()?;
                figure.allow(&["value", "unit"])?;
                let value = figure.require("value", "an expression of the parameters")?;
                (value, figure.text("unit")?.map(str::to_owned))
            } else {
                let own = section.as_ref().and_then(|section| section.get(entry.key));
                (own.ok_or_else(|| entry.error("this figure has no value"))?, None)
            };
            read::check_name(entry.key, &entry)?;
            if scope.names.iter().any(|(name, _)| *name == entry.key) {
                let message = format!("{} is a parameter or a figure above", quoted(entry.key));
                return Err(entry.error(format!("{message}: give this figure another name")));
            }
            let node = read::expression_of(&written, graph, &scope)?;
            scope.names.push((entry.key, node));
            if !entry.key.starts_with('_') {
                names.push((entry.key.to_owned(), unit));
                roots.push(node);
            }
        }
        for index in 0..unknown {
            let slopes = graph.derivatives(&roots[..names.len()], Operation::Parameter(index));
            roots.extend(slopes);
        }
        Ok(Self { names, program: Program::new(graph, &roots) })
    }
}

/// What may stand in the expression of a figure.
struct Scope<'d> {
    names: Vec<(&'d str, Node)>,
}

impl Names for Scope<'_> {
    fn node(&self, name: &str) -> Result<Option<Node>, String> {
        Ok(self.names.iter().find(|(known, _)| *known == name).map(|(_, node)| *node))
    }

    fn all(&self) -> Vec<&str> {
        self.names.iter().map(|(name, _)| *name).collect()
    }
}

impl GreyBox {
    /// The figures of the model with these parameters z, of which this is the covariance before the change of variable.
    pub(crate) fn figures(&self, z: &[f64], covariance: &[Vec<f64>]) -> Vec<DerivedFigure> {
        let Figures { names, program } = &self.figures;
        let leaves = Leaves::of_parameters(z);
        let mut work = vec![0.0; program.size()];
        let results: Vec<f64> = program.run(&leaves, &mut work).collect();
        let (values, slopes) = results.split_at(names.len());
        // The derivatives by those parameters that it depends on: a noise may be at its bound, and has no error there.
        let by_parameter = |figure: usize| -> Vec<(usize, f64)> {
            let slopes = slopes.iter().skip(figure).step_by(names.len().max(1)).enumerate();
            let slopes = slopes.filter(|(_, slope)| **slope != 0.0);
            slopes.map(|(index, slope)| (index, slope / self.unknown[index].scale.slope(z[index]))).collect()
        };
        let figure = |(index, ((name, unit), &value)): (usize, (&(String, Option<String>), &f64))| {
            let slopes = by_parameter(index);
            let products = slopes
                .iter()
                .flat_map(|&(i, one)| slopes.iter().map(move |&(j, other)| one * covariance[i][j] * other));
            let error = products.sum::<f64>().max(0.0).sqrt();
            DerivedFigure {
                name: name.clone(),
                value: Some(value).filter(|value| value.is_finite()),
                standard_error: Some(error).filter(|error| value.is_finite() && error.is_finite()),
                unit: unit.clone(),
            }
        };
        names.iter().zip(values).enumerate().map(figure).collect()
    }
}
