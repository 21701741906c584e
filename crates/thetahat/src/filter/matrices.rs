//! A model in matrices, from a TOML file.

use thetahat_core::Covariance;
use thetahat_core::nalgebra::{DMatrix, DVector, Dyn};

use super::frame::{Frame, Names};
use super::linear::{Bounds, Linear, Matrices};
use crate::Error;
use crate::model::equations::{Entry, Section};

/// How large a matrix must be, and what its rows and columns are.
type Shape<'a> = ((usize, &'a str), (usize, &'a str));

/// Reads a model whose file has F.
pub(super) fn read(root: &Section<'_>) -> Result<(Frame, Linear), Error> {
    root.allow(&[
        "sample_time",
        "states",
        "inputs",
        "outputs",
        "F",
        "G",
        "H",
        "D",
        "Q",
        "R",
        "S",
        "x0",
        "P0",
        "process_bound",
        "measurement_bound",
        "initial_bound",
    ])?;
    let sample_time = root.require("sample_time", "the seconds of a sample")?.positive()?;
    let needed = root.require("F", "the state matrix, such as [[1, 1], [0, 1]]")?;
    let size = needed.rows()?.len();
    if size == 0 {
        return Err(needed.value_error("'F' is empty: a model has at least one state"));
    }
    let states = match root.get("states") {
        None => (1..=size).map(|state| format!("x{state}")).collect(),
        Some(entry) => {
            let names = distinct(&entry)?;
            if names.len() != size {
                return Err(entry.error(format!("there are {} names, but F has {size} rows", names.len())));
            }
            names
        }
    };
    let inputs = root.get("inputs").map_or(Ok(Vec::new()), |entry| distinct(&entry))?;
    let entry = root.require("outputs", "the channels of the rows of H, such as [\"y\"]")?;
    let outputs = distinct(&entry)?;
    if outputs.is_empty() {
        return Err(entry.value_error("'outputs' is empty: a filter needs something that is measured"));
    }
    if let Some(both) = outputs.iter().find(|output| inputs.contains(output)) {
        return Err(
            entry.value_error(format!("the channel '{both}' is an input too: it can only be one of them"))
        );
    }
    let (n, m, k) = ((size, "states"), (outputs.len(), "outputs"), (inputs.len(), "inputs"));
    let needed = |key: &str, what: &str, shape| matrix(&root.require(key, what)?, shape);
    let optional = |key: &str, shape| root.get(key).map(|entry| matrix(&entry, shape)).transpose();
    let noise = |key: &str, what: &str, size| {
        let entry = root.require(key, what)?;
        covariance(&entry, matrix(&entry, (size, size))?)
    };
    let bounds = bounds(root, size, outputs.len())?;
    // Without a covariance the noise is uniform within its bound.
    let noise = |key: &str, what: &str, size, bound: Option<&DVector<f64>>| match (bound, root.get(key)) {
        (Some(bound), None) => {
            let uniform = bound.map(|bound| bound * bound / 3.0);
            Covariance::from_diagonal(&uniform).map_err(|error| root.error(format!("'{key}': {error}")))
        }
        _ => noise(key, what, size),
    };
    let zeros = |((rows, _), (columns, _)): Shape<'_>| DMatrix::zeros(rows, columns);
    let g = if inputs.is_empty() {
        optional("G", (n, k))?
    } else {
        Some(needed("G", "the matrix of the inputs, with a column for each", (n, k))?)
    };
    let x0 = match root.get("x0") {
        None => DVector::zeros(size),
        Some(entry) => {
            let values = entry.numbers()?;
            if values.len() != size {
                return Err(
                    entry.error(format!("'x0' has {} numbers, but there are {size} states", values.len()))
                );
            }
            DVector::from_vec(values)
        }
    };
    let matrices = Matrices {
        f: needed("F", "the state matrix", (n, n))?,
        g: g.unwrap_or_else(|| zeros((n, k))),
        h: needed("H", "the output matrix", (m, n))?,
        d: optional("D", (m, k))?.unwrap_or_else(|| zeros((m, k))),
        q: noise(
            "Q",
            "the covariance of the process noise, added each sample",
            n,
            bounds.as_ref().map(|bounds| &bounds.process),
        )?,
        r: noise(
            "R",
            "the covariance of the measurement noise",
            m,
            bounds.as_ref().map(|bounds| &bounds.measurement),
        )?,
        s: optional("S", (n, m))?,
        x0,
        p0: noise(
            "P0",
            "the covariance of what is known of the state at the first row",
            n,
            bounds.as_ref().map(|bounds| &bounds.initial),
        )?,
        bounds,
    };
    let correlated = root.get("S");
    Linear::of_matrices(Names { states, inputs, outputs, sample_time }, matrices, None).map_err(|error| {
        let message = format!("no noises have these Q, R and S: {error}");
        correlated.as_ref().map_or_else(|| root.error(error.to_string()), |entry| entry.error(message))
    })
}

/// How large the noises are at most, if that is said: of all of them.
fn bounds(root: &Section<'_>, states: usize, outputs: usize) -> Result<Option<Bounds>, Error> {
    let keys = ["process_bound", "measurement_bound", "initial_bound"];
    if keys.iter().all(|key| root.get(key).is_none()) {
        return Ok(None);
    }
    let bound = |key: &str, what: &str, count: usize, of: &str| {
        let entry = root.require(key, what)?;
        let values = entry.numbers()?;
        if values.len() != count {
            return Err(
                entry.error(format!("'{key}' has {} numbers, but there are {count} {of}", values.len()))
            );
        }
        match values.iter().find(|value| **value < 0.0) {
            Some(wrong) => Err(entry.value_error(format!("'{key}' has {wrong}: no magnitude is negative"))),
            None => Ok(DVector::from_vec(values)),
        }
    };
    Ok(Some(Bounds {
        process: bound(
            keys[0],
            "the largest process noise of each state, as the others are there",
            states,
            "states",
        )?,
        measurement: bound(keys[1], "the largest measurement noise of each output", outputs, "outputs")?,
        initial: bound(keys[2], "how far each state may be from x0 at the first row", states, "states")?,
    }))
}

/// Names, none of them twice.
fn distinct(entry: &Entry<'_>) -> Result<Vec<String>, Error> {
    let names = entry.texts()?;
    match names.iter().enumerate().find(|(index, name)| names[..*index].contains(name)) {
        None => Ok(names),
        Some((_, name)) => Err(entry.value_error(format!("'{name}' is there twice"))),
    }
}

fn matrix(entry: &Entry<'_>, shape: Shape<'_>) -> Result<DMatrix<f64>, Error> {
    let ((rows, each_row), (columns, each_column)) = shape;
    let found = entry.rows()?;
    let width = found.first().map_or(columns, Vec::len);
    if found.len() != rows || width != columns {
        return Err(entry.error(format!(
            "'{}' is {} x {width}, but must be {rows} x {columns} ({each_row} x {each_column})",
            entry.key,
            found.len()
        )));
    }
    Ok(DMatrix::from_row_iterator(rows, columns, found.into_iter().flatten()))
}

fn covariance(entry: &Entry<'_>, matrix: DMatrix<f64>) -> Result<Covariance<f64, Dyn>, Error> {
    Covariance::new(&matrix).map_err(|error| match error {
        thetahat_core::Error::NotSymmetric { row, column } => entry.value_error(format!(
            "'{}' is not symmetric: entry ({}, {}) must be equal to ({}, {})",
            entry.key,
            row + 1,
            column + 1,
            column + 1,
            row + 1
        )),
        thetahat_core::Error::NotPositive { index, .. } => entry.value_error(format!(
            "'{}' is no covariance: the variance of element {}, given the others, is negative",
            entry.key,
            index + 1
        )),
        other => entry.value_error(format!("'{}': {other}", entry.key)),
    })
}
