//! Documents about logs and models: validations, comparisons, inspections, measured responses.

use std::ffi::OsString;
use std::sync::Arc;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use thetahat::data::Rows;
use thetahat::inspect::{Inspection, InspectionPlan};
use thetahat::present::tables;
use thetahat::report::{Report, Requirement, Validated, ValidationPlan};
use thetahat::spectrum::{GivenPoint, MeasuredResponse, SpectrumPlan};
use thetahat::step_test::{StepTest, StepTestPlan};
use thetahat::{Document, is_document};

use crate::error;
use crate::journal::{Cells, cells};
use crate::log::Log;
use crate::model::Model;
use crate::plan::options;
use crate::work::{awaited, interruptible};

/// How a model does on a log: the document that `thetahat validate` writes.
#[pyclass(frozen, module = "thetahat._thetahat")]
pub(crate) struct Validation {
    found: Validated,
    requirements: Vec<Requirement>,
    #[pyo3(get)]
    alpha: f64,
}

/// Evaluates a model on a log, with the options of a plan.
#[pyfunction]
pub(crate) fn validate(
    py: Python<'_>,
    model: &Bound<'_, Model>,
    log: &Bound<'_, Log>,
    plan: &str,
    required: Vec<String>,
) -> PyResult<Validation> {
    let requirements: Vec<Requirement> = required
        .iter()
        .map(|text| text.parse())
        .collect::<Result<_, _>>()
        .map_err(|error| error::batch(py, error))?;
    let further: Vec<usize> = requirements.iter().filter_map(Requirement::steps).collect();
    let plan = ValidationPlan::of(&options(py, plan)?, &further).map_err(|error| error::batch(py, error))?;
    let log = log.get();
    let report = model.get().report(py)?;
    for requirement in &requirements {
        requirement.check(&report).map_err(|error| error::batch(py, error))?;
    }
    let (log, sources, alpha) = (Arc::clone(&log.log), log.sources.clone(), plan.alpha);
    let found = interruptible(py, move |_| thetahat::report::validate(&report, None, &log, &sources, &plan))?;
    Ok(Validation { found, requirements, alpha })
}

#[pymethods]
impl Validation {
    /// The document.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        self.found.validation.to_json().map_err(|error| error::batch(py, error))
    }

    /// The table that `thetahat validate` prints.
    fn table(&self) -> String {
        tables::validation(&self.found.validation, &self.requirements, self.alpha, error::layout())
    }

    /// What was required and is not met, in words with the figures.
    fn unmet(&self) -> Vec<String> {
        let validation = &self.found.validation;
        self.requirements.iter().filter_map(|requirement| requirement.unmet(validation, self.alpha)).collect()
    }
}

/// Several models side by side on a log: the document that `thetahat compare` writes, and its table.
#[pyfunction]
pub(crate) fn compare(
    py: Python<'_>,
    models: Vec<(String, Bound<'_, Model>)>,
    log: &Bound<'_, Log>,
    plan: &str,
    over: Option<&str>,
) -> PyResult<(String, String)> {
    let plan = ValidationPlan::of(&options(py, plan)?, &[]).map_err(|error| error::batch(py, error))?;
    let over = over.map(MeasuredResponse::from_json).transpose().map_err(|error| error::batch(py, error))?;
    let log = log.get();
    let models = models.into_iter().map(|(name, model)| Ok((name, model.get().report(py)?)));
    let models = models.collect::<PyResult<Vec<(String, Arc<Report>)>>>()?;
    let (log, sources) = (Arc::clone(&log.log), log.sources.clone());
    let comparison = interruptible(py, move |_| {
        let each = models.iter().map(|(name, report)| {
            let found = thetahat::report::validate(report, Some(name), &log, &sources, &plan)?;
            match &over {
                Some(response) => found.over(&report.model, response),
                None => Ok(found),
            }
        });
        let found: Vec<Validated> = each.collect::<Result<_, _>>()?;
        thetahat::report::compare(&found)
    })?;
    let json = comparison.to_json().map_err(|error| error::batch(py, error))?;
    Ok((json, tables::comparison(&comparison, error::layout())))
}

/// What a log is worth: the document that `thetahat inspect` writes, and its table.
#[pyfunction]
pub(crate) fn inspect(py: Python<'_>, log: &Bound<'_, Log>) -> PyResult<(String, String)> {
    let log = log.get();
    let Some(source) = log.sources.first().cloned() else {
        return Err(PyValueError::new_err("log: it comes from nowhere; make another"));
    };
    let plan =
        InspectionPlan { inputs: log.inputs.clone(), output: log.outputs.first().cloned(), resample: None };
    let log = Arc::clone(&log.log);
    let found = interruptible(py, move |_| thetahat::inspect::inspect_log(&log, &source, &plan))?;
    written(py, &found)
}

/// The same of a file, with the options of `thetahat inspect`.
#[pyfunction]
pub(crate) fn inspect_file(py: Python<'_>, options: Vec<OsString>) -> PyResult<(String, String)> {
    let found = awaited(py, move |_| thetahat_cli::inspect(&options))?
        .map_err(|failure| error::program(py, &failure))?;
    written(py, &found)
}

/// The topics of a log whose topics have clocks of their own: the document that `thetahat inspect` writes.
#[pyfunction]
pub(crate) fn topics(py: Python<'_>, options: Vec<OsString>) -> PyResult<String> {
    let found = awaited(py, move |_| thetahat_cli::topic_list(&options))?;
    let found = found.map_err(|failure| error::program(py, &failure))?;
    found.to_json().map_err(|error| error::batch(py, error))
}

/// An inspection that was written: the document, and its table.
#[pyfunction]
pub(crate) fn inspection(py: Python<'_>, text: &str) -> PyResult<(String, String)> {
    written(py, &Inspection::from_json(text).map_err(|error| error::batch(py, error))?)
}

/// What the document of a fit, a validation or an inspection says in a line of a table of many.
#[pyfunction]
pub(crate) fn row<'py>(py: Python<'py>, text: &str) -> PyResult<Cells<'py>> {
    let read = || {
        if is_document::<Inspection>(text) {
            Inspection::from_json(text).map(|inspection| inspection.row())
        } else if is_document::<thetahat::report::Validation>(text) {
            thetahat::report::Validation::from_json(text).map(|validation| validation.row())
        } else {
            Report::from_json(text).map(|report| report.row())
        }
    };
    let row = py.detach(read).map_err(|error| error::batch(py, error))?;
    cells(py, &row)
}

/// The frequency response that a log shows, with the options of a plan: the document that `thetahat spectrum` writes,
/// and its table.
#[pyfunction]
pub(crate) fn spectrum(py: Python<'_>, log: &Bound<'_, Log>, plan: &str) -> PyResult<(String, String)> {
    let log = log.get();
    let [output] = log.outputs.as_slice() else {
        return Err(PyValueError::new_err("log: a response is to one output; give a log of one"));
    };
    let plan = SpectrumPlan::of(&options(py, plan)?, log.inputs.clone(), output.clone())
        .map_err(|error| error::batch(py, error))?;
    let (log, sources) = (Arc::clone(&log.log), log.sources.clone());
    let found = interruptible(py, move |_| thetahat::spectrum::spectrum(&log, &sources, &plan))?;
    response_document(py, &found)
}

fn response_document(py: Python<'_>, found: &MeasuredResponse) -> PyResult<(String, String)> {
    let json = found.to_json().map_err(|error| error::batch(py, error))?;
    Ok((json, tables::response(found, error::layout())))
}

/// What the steps of some rows of a log show: the document that `thetahat step` writes, and its table.
#[pyfunction]
pub(crate) fn step_test(
    py: Python<'_>,
    log: &Bound<'_, Log>,
    rows: Vec<String>,
) -> PyResult<(String, String)> {
    let log = log.get();
    let ([input], [output]) = (log.inputs.as_slice(), log.outputs.as_slice()) else {
        return Err(PyValueError::new_err(
            "log: a step test has one input and one output; take them with log.select(inputs=..., output=...)",
        ));
    };
    let rows: Vec<Rows> = rows
        .iter()
        .map(|text| text.parse())
        .collect::<Result<_, _>>()
        .map_err(|error| error::batch(py, error))?;
    let plan = StepTestPlan { rows, ..StepTestPlan::new(input, output) };
    let (log, sources) = (Arc::clone(&log.log), log.sources.clone());
    let found = interruptible(py, move |_| thetahat::step_test::step_test(&log, &sources, &plan))?;
    step_document(py, &found)
}

/// The document and the table of a response whose points were measured elsewhere: frequencies in rad/s, real and
/// imaginary parts, and standard deviations if they are known.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "the columns of a table, and what they are of")]
pub(crate) fn given_response(
    py: Python<'_>,
    input: &str,
    output: &str,
    frequencies: Vec<f64>,
    re: Vec<f64>,
    im: Vec<f64>,
    deviations: Option<Vec<f64>>,
    held: Option<f64>,
) -> PyResult<(String, String)> {
    let point = |(row, ((frequency, re), im)): (usize, ((f64, f64), f64))| GivenPoint {
        frequency,
        re,
        im,
        standard_deviation: deviations.as_ref().and_then(|all| all.get(row)).copied(),
    };
    let points: Vec<GivenPoint> = frequencies.into_iter().zip(re).zip(im).enumerate().map(point).collect();
    let found =
        MeasuredResponse::given(input, output, &points, held).map_err(|error| error::batch(py, error))?;
    response_document(py, &found)
}

/// The same of the points of one that is there, from one frequency to another.
#[pyfunction]
pub(crate) fn response_within(
    py: Python<'_>,
    response: &str,
    low: f64,
    high: f64,
) -> PyResult<(String, String)> {
    let found = MeasuredResponse::from_json(response).and_then(|response| response.within(low, high));
    response_document(py, &found.map_err(|error| error::batch(py, error))?)
}

/// The step test of the document of a measured response, at the phase of -45 degrees.
#[pyfunction]
pub(crate) fn sine_test(py: Python<'_>, response: &str, input: &str) -> PyResult<(String, String)> {
    let found = MeasuredResponse::from_json(response)
        .and_then(|response| thetahat::step_test::sine_test(&response, input))
        .map_err(|error| error::batch(py, error))?;
    step_document(py, &found)
}

fn step_document(py: Python<'_>, found: &StepTest) -> PyResult<(String, String)> {
    let json = found.to_json().map_err(|error| error::batch(py, error))?;
    Ok((json, tables::step_test(found, error::layout())))
}

fn written(py: Python<'_>, found: &Inspection) -> PyResult<(String, String)> {
    let json = found.to_json().map_err(|error| error::batch(py, error))?;
    Ok((json, tables::inspection(found, error::layout())))
}
