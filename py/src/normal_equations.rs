//! One model from many pieces of the data.

use std::sync::Arc;

use pyo3::prelude::*;
use thetahat::Document;
use thetahat::estimate::SubspaceOptions;
use thetahat::report::{NormalEquations as Sums, StateSpacePlan};

use crate::error;
use crate::log::Log;
use crate::model::Model;
use crate::work::interruptible;

/// The normal equations of some pieces: the document of which Python has the text.
#[pyclass(frozen, module = "thetahat._thetahat")]
pub(crate) struct NormalEquations(Arc<Sums>);

#[pymethods]
impl NormalEquations {
    /// Those of a piece of which the first `past` rows are of the one before it, with the options of a plan in JSON.
    #[new]
    fn new(py: Python<'_>, log: &Bound<'_, Log>, plan: &str, past: usize) -> PyResult<Self> {
        let log = log.get();
        let plan = log.plan(py, plan)?;
        let (channels, sources) = (Arc::clone(&log.log), log.sources.clone());
        let made = interruptible(py, move |_| plan.pieces(&channels, &sources, past))?;
        Ok(Self(Arc::new(made)))
    }

    /// How many rows a state-space model of a subspace method with these options reaches back to.
    #[staticmethod]
    fn lags_of_states(
        py: Python<'_>,
        weighting: Option<&str>,
        past: Option<usize>,
        future: Option<usize>,
    ) -> PyResult<usize> {
        let weighting = weighting.map(str::parse).transpose().map_err(|error| error::batch(py, error))?;
        let weighting = weighting.unwrap_or_default();
        let subspace = SubspaceOptions { weighting, past, future, ..SubspaceOptions::default() };
        Ok(StateSpacePlan { subspace, ..StateSpacePlan::new(&[], &[]) }.lags())
    }

    /// Reads the document back.
    #[staticmethod]
    fn from_json(py: Python<'_>, text: &str) -> PyResult<Self> {
        Ok(Self(Arc::new(Sums::from_json(text).map_err(|error| error::batch(py, error))?)))
    }

    /// The document.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        self.0.to_json().map_err(|error| error::batch(py, error))
    }

    /// Those of these pieces and of others after them.
    fn merged(&self, py: Python<'_>, others: Vec<PyRef<'_, Self>>) -> PyResult<Self> {
        let (own, others) = (Arc::clone(&self.0), others.iter().map(|other| Arc::clone(&other.0)));
        let others: Vec<Arc<Sums>> = others.collect();
        let merged = interruptible(py, move |_| {
            let mut all = (*own).clone();
            others.iter().try_for_each(|other| all.merge(other))?;
            Ok(all)
        })?;
        Ok(Self(Arc::new(merged)))
    }

    /// The model.
    fn solve(&self, py: Python<'_>) -> PyResult<Model> {
        let own = Arc::clone(&self.0);
        Ok(Model::of(interruptible(py, move |_| own.solve())?))
    }

    /// The model and its orders, such as ARX(2, 2, 1).
    fn name(&self) -> String {
        self.0.name()
    }

    /// The channels, the outputs last.
    #[getter]
    fn channels(&self) -> Vec<&str> {
        self.0.channels()
    }

    /// How many of them are outputs.
    #[getter]
    fn outputs(&self) -> usize {
        self.0.outputs().len()
    }

    #[getter]
    fn lags(&self) -> usize {
        self.0.lags()
    }

    #[getter]
    fn rows(&self) -> usize {
        self.0.rows()
    }

    #[getter]
    fn samples(&self) -> usize {
        self.0.samples()
    }

    #[getter]
    fn pieces(&self) -> usize {
        self.0.pieces()
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.0 == other.0
    }
}
