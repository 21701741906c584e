//! Options of a fit, as Python has them: a plan in JSON.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use thetahat::fit::FitDraft;
use thetahat::plan::{FitOptions, Fitted};

use crate::error;

/// A fit with the options of a plan in JSON.
pub(crate) fn draft(py: Python<'_>, plan: &str, fitted: Fitted) -> PyResult<FitDraft> {
    let values: serde_json::Map<String, serde_json::Value> =
        serde_json::from_str(plan).map_err(|error| PyValueError::new_err(format!("plan: {error}")))?;
    let draft = FitOptions::of(&values).and_then(|options| FitDraft::new(&options, fitted));
    draft.map_err(|error| error::batch(py, error))
}
