//! What has been done with which of many logs: the journal of the command line.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use thetahat::{Cell, Row};

use crate::error;

/// The journal of a folder of documents, which this run has for itself until it is closed.
#[pyclass(frozen, module = "thetahat._thetahat")]
pub(crate) struct Journal(Mutex<Option<Arc<thetahat_cli::Journal>>>);

impl Journal {
    fn open(&self) -> PyResult<Arc<thetahat_cli::Journal>> {
        let held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        held.clone().ok_or_else(|| PyValueError::new_err("the journal is closed; open another"))
    }
}

#[pymethods]
impl Journal {
    /// That of a folder, for rows that depend on all that `common` says beside their logs.
    #[new]
    fn new(py: Python<'_>, folder: PathBuf, common: &str) -> PyResult<Self> {
        let opened = py.detach(|| thetahat_cli::Journal::open(&folder, common));
        Ok(Self(Mutex::new(Some(Arc::new(opened.map_err(|failure| error::program(py, &failure))?)))))
    }

    /// The digest of a file and of what its row depends on; None if it cannot be read.
    fn digest(&self, py: Python<'_>, path: PathBuf) -> PyResult<Option<String>> {
        let journal = self.open()?;
        Ok(py.detach(|| journal.digest(&path)))
    }

    /// The row of a log in an earlier run, if nothing has changed since.
    fn row<'py>(&self, py: Python<'py>, log: &str, digest: &str) -> PyResult<Option<Cells<'py>>> {
        self.open()?.row(log, digest).map(|row| cells(py, &row)).transpose()
    }

    /// Notes the row of a log.
    fn note(&self, py: Python<'_>, digest: &str, row: Vec<(String, Bound<'_, PyAny>)>) -> PyResult<()> {
        let mut noted = Row::default();
        for (name, value) in &row {
            noted.add(name, cell(value)?);
        }
        let journal = self.open()?;
        py.detach(|| journal.note(digest, &noted)).map_err(|failure| error::program(py, &failure))
    }

    /// Leaves the folder to other runs.
    fn close(&self) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take();
    }
}

/// The cells of a row, with their names.
pub(crate) type Cells<'py> = Vec<(String, Bound<'py, PyAny>)>;

/// A row as values of Python.
pub(crate) fn cells<'py>(py: Python<'py>, row: &Row) -> PyResult<Cells<'py>> {
    let value = |(name, cell): &(String, Cell)| {
        let value = match cell {
            Cell::Flag(flag) => flag.into_pyobject(py)?.to_owned().into_any(),
            Cell::Count(count) => count.into_pyobject(py)?.into_any(),
            Cell::Number(number) => number.into_pyobject(py)?.into_any(),
            Cell::Text(text) => text.into_pyobject(py)?.into_any(),
        };
        Ok((name.clone(), value))
    };
    row.cells().iter().map(value).collect()
}

fn cell(value: &Bound<'_, PyAny>) -> PyResult<Cell> {
    // A bool is a whole number in Python, too.
    if let Ok(flag) = value.extract() {
        return Ok(Cell::Flag(flag));
    }
    if let Ok(count) = value.extract() {
        return Ok(Cell::Count(count));
    }
    if let Ok(number) = value.extract() {
        return Ok(Cell::Number(number));
    }
    Ok(Cell::Text(value.extract()?))
}
