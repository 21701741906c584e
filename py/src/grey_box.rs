//! Models in equations, before a fit.

use pyo3::prelude::*;

use crate::error;

/// A model in equations, of which some parameters may be unknown.
#[pyclass(frozen, module = "thetahat._thetahat")]
pub(crate) struct GreyBox(pub(crate) thetahat::model::GreyBox);

#[pymethods]
impl GreyBox {
    /// Reads a text in TOML.
    #[new]
    fn new(py: Python<'_>, text: &str) -> PyResult<Self> {
        Ok(Self(thetahat::model::GreyBox::from_toml(text).map_err(|error| error::batch(py, error))?))
    }

    /// The same model with values of unknown parameters that are known by now.
    fn with_parameters(&self, py: Python<'_>, values: Vec<(String, f64)>) -> PyResult<Self> {
        let values: Vec<(&str, f64)> = values.iter().map(|(name, value)| (name.as_str(), *value)).collect();
        Ok(Self(self.0.with_parameters(&values).map_err(|error| error::batch(py, error))?))
    }

    fn to_toml(&self) -> &str {
        self.0.text()
    }

    #[getter]
    fn sample_time(&self) -> f64 {
        self.0.sample_time()
    }

    #[getter]
    fn states(&self) -> Vec<String> {
        self.0.states().to_vec()
    }

    #[getter]
    fn inputs(&self) -> Vec<String> {
        self.0.inputs().to_vec()
    }

    #[getter]
    fn outputs(&self) -> Vec<String> {
        self.0.outputs().to_vec()
    }

    #[getter]
    fn unknown(&self) -> Vec<String> {
        self.0.unknown().map(str::to_owned).collect()
    }

    /// Those of the unknown parameters that were given values.
    #[getter]
    fn known(&self) -> Vec<(String, f64)> {
        self.0.known().to_vec()
    }
}
