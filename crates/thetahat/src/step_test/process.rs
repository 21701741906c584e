//! The process of least squared errors, beside what is read off the responses.

use std::ops::ControlFlow;

use thetahat_numerics::optimize::Search;

use super::document::{FittedProcess, Shape, Step};
use crate::Error;
use crate::data::{Log, Offset, Rows};
use crate::estimate::{Background, ProcessEstimate, least_free_run};
use crate::model::{Parameter, ProcessModel, ProcessStructure, Quantity};
use crate::respond::process::held_logs;

/// The structure for the shape that most responses have, the plainest of those that are as many.
fn structure(steps: &[Step]) -> Result<ProcessStructure, Error> {
    let count = |shape: Shape| {
        steps
            .iter()
            .filter_map(|step| step.response.as_ref())
            .filter(|response| response.shape == shape)
            .count()
    };
    let words = [(Shape::FirstOrder, "p1d"), (Shape::Overdamped, "p2d"), (Shape::Underdamped, "p2du")];
    // The last of equal ones would win.
    let (_, word) = words.into_iter().rev().max_by_key(|(shape, _)| count(*shape)).unwrap_or(words[0]);
    word.parse()
}

/// The process of the rows of a step test.
pub(super) fn fitted(
    log: &Log,
    (input, output): (&str, &str),
    rows: &[Rows],
    steps: &[Step],
) -> Result<FittedProcess, Error> {
    let structure = structure(steps)?;
    let rows = if rows.is_empty() { vec![Rows::new(1, log.rows())?] } else { rows.to_vec() };
    let first = log.channel(input)?.values.iter().copied().find(|value| !value.is_nan()).unwrap_or(0.0);
    let offsets = [(input, first), (output, 0.0)];
    let deviations =
        log.deviations(offsets.into_iter().map(|(name, level)| (name, Offset { level, slope: 0.0 })))?;
    let held = held_logs(&deviations, &[input], &rows)?;
    let names = ProcessModel::names(&[structure], &[input.to_owned()]);
    let background = Background { level: true, slope: false, free: false };
    let measured = &deviations.channel(output)?.values;
    let found: ProcessEstimate =
        least_free_run(&[structure], &names, (&held, measured), background, &Search::default(), &|_| {
            ControlFlow::Continue(())
        })?;
    let error = |place: usize| found.covariance.as_ref().map(|rows| rows[place][place].sqrt());
    let parameters = names
        .iter()
        .zip(&found.run.parameters)
        .enumerate()
        .map(|(place, (name, &value))| Parameter { name: name.clone(), value, standard_error: error(place) });
    Ok(FittedProcess {
        structure,
        parameters: parameters.collect(),
        level: Quantity::new(found.run.level.unwrap_or(0.0), error(names.len())),
        rmse: found.mse.sqrt(),
    })
}
