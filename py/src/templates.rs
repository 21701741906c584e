//! Plants that are ready, with start values from a log.

use pyo3::prelude::*;
use thetahat::plan::Fitted;
use thetahat::templates::Template;

use crate::error;
use crate::grey_box::GreyBox;
use crate::log::Log;
use crate::plan::draft;

/// The model of a template for a log; a plan in JSON says which rows are fitted to.
#[pyfunction]
pub(crate) fn template(
    py: Python<'_>,
    log: &Bound<'_, Log>,
    name: &str,
    columns: Vec<(String, String)>,
    known: Vec<(String, f64)>,
    plan: &str,
) -> PyResult<GreyBox> {
    let log = &log.get().log;
    let draft = draft(py, plan, Fitted::Equations)?;
    let made = || {
        let rows = draft.equations_plan()?.fitted_rows(log.rows())?;
        let template = Template::named(name)?;
        let header: Vec<String> = log.channels().iter().map(|channel| channel.name.clone()).collect();
        template.model(log, &template.columns_in(&header, &columns)?, &known, &rows)
    };
    py.detach(made).map(GreyBox).map_err(|error| error::batch(py, error))
}

/// The names of the templates, and what each wants and finds, in lines.
#[pyfunction]
pub(crate) fn templates() -> Vec<(&'static str, String)> {
    Template::all().iter().map(|template| (template.name, template.summary())).collect()
}
