//! The noises of a model in matrices, from logs.

use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use thetahat::estimate::NoiseStructure;
use thetahat::filter::NoiseLog;
use thetahat::optimize::{Search, Stopped};

use crate::array::{from_matrix, matrix, vector};
use crate::filter::StateModel;
use crate::work::interruptible;

/// The seconds before each row, the inputs and the outputs of a log.
type Arrays<'py> = (Option<Bound<'py, PyAny>>, Bound<'py, PyAny>, Bound<'py, PyAny>);

/// Q, R and S of the largest likelihood.
#[pyfunction]
pub(crate) fn fit_noise<'py>(
    py: Python<'py>,
    model: &StateModel,
    logs: Vec<Arrays<'py>>,
    structure: &str,
    max_iterations: usize,
    tolerance: f64,
) -> PyResult<Bound<'py, PyDict>> {
    let structure = match structure {
        "diagonal" => NoiseStructure::Diagonal,
        "full" => NoiseStructure::Full,
        "scaled" => NoiseStructure::Scaled,
        "innovations" => NoiseStructure::Innovations,
        other => {
            return Err(PyValueError::new_err(format!(
                "structure: '{other}' is none of 'diagonal', 'full', 'scaled', 'innovations'"
            )));
        }
    };
    let model = model.model.clone();
    let (k, m) = (model.inputs().len(), model.outputs().len());
    let mut owned = Vec::with_capacity(logs.len());
    for (steps, inputs, outputs) in &logs {
        let outputs: PyReadonlyArray2<'_, f64> = matrix("y", outputs, [None, Some(m)])?;
        let rows = outputs.shape()[0];
        let inputs: Vec<f64> = match k {
            0 => Vec::new(),
            _ => matrix("u", inputs, [Some(rows), Some(k)])?.as_slice()?.to_vec(),
        };
        let steps: Option<PyReadonlyArray1<'_, f64>> =
            steps.as_ref().map(|steps| vector("time", steps, Some(rows))).transpose()?;
        let steps = steps.as_ref().map(|steps| steps.as_slice().map(<[f64]>::to_vec)).transpose()?;
        owned.push((steps, inputs, outputs.as_slice()?.to_vec()));
    }
    let search = Search { max_iterations, tolerance, ..Search::default() };
    let found = interruptible(py, move |monitor| {
        let logs: Vec<NoiseLog<'_>> = owned
            .iter()
            .map(|(steps, inputs, outputs)| NoiseLog { steps: steps.as_deref(), inputs, outputs })
            .collect();
        model.fit_noise(&logs, structure, &search, monitor)
    })?;
    let result = PyDict::new(py);
    let matrices = [
        ("Q", &found.process),
        ("R", &found.measurement),
        ("S", &found.cross),
        ("Q_errors", &found.process_errors),
        ("R_errors", &found.measurement_errors),
        ("S_errors", &found.cross_errors),
    ];
    for (name, matrix) in matrices {
        result.set_item(name, from_matrix(py, matrix)?)?;
    }
    result.set_item("text", found.model.to_toml())?;
    result.set_item("warnings", found.warnings())?;
    result.set_item("log_likelihood", found.log_likelihood)?;
    result.set_item("log_likelihoods", found.search.log_likelihoods)?;
    result.set_item("measured", found.measured)?;
    result.set_item("iterations", found.search.iterations)?;
    let stopped = match found.search.stopped {
        Stopped::Converged => "converged",
        Stopped::NoDescent => "no-descent",
        Stopped::MaxIterations => "max-iterations",
        Stopped::TimeLimit => "time-limit",
    };
    result.set_item("stopped", stopped)?;
    Ok(result)
}
