//! Options as Python has them: a plan in JSON.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use thetahat::fit::FitDraft;
use thetahat::options::Options;
use thetahat::plan::{FitOptions, Fitted};

use crate::error;

/// The options of a plan in JSON.
pub(crate) fn options<O: Options>(py: Python<'_>, plan: &str) -> PyResult<O> {
    let values: serde_json::Map<String, serde_json::Value> =
        serde_json::from_str(plan).map_err(|error| PyValueError::new_err(format!("plan: {error}")))?;
    O::of(&values).map_err(|error| error::batch(py, error))
}

/// A fit with the options of a plan in JSON.
pub(crate) fn draft(py: Python<'_>, plan: &str, fitted: Fitted) -> PyResult<FitDraft> {
    FitDraft::new(&options::<FitOptions>(py, plan)?, fitted).map_err(|error| error::batch(py, error))
}
