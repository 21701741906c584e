//! The compiled module `thetahat._thetahat`: the engine behind the Python package `thetahat`.
//!
//! `log`, `grey_box`, `model`, `normal_equations`, `experiments`, `evaluation` and `design` are the batch half,
//! `online` the steppers, `filter` and `track` the steppers behind logs, `noise` the noises that a filter needs.
//! `journal` is what has been done with which of many logs. `plan` reads options of a fit, `array` reads and makes
//! NumPy arrays, `error` is the one map of errors, `in_use` what is said of an object that another call uses, `work`
//! runs what takes long.

mod array;
mod design;
mod error;
mod evaluation;
mod experiments;
mod filter;
mod grey_box;
mod in_use;
mod journal;
mod log;
mod model;
mod noise;
mod normal_equations;
mod online;
mod plan;
mod templates;
mod track;
mod work;

use std::ffi::OsString;
use std::path::PathBuf;

use pyo3::prelude::*;

/// Signals are allocated for each question of a search. Freed memory is kept for a moment here; the C library gives it
/// back at once where it is told to, as it is on a worker of Dask, and half of the time is then the system's, page by
/// page.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

#[pymodule]
fn _thetahat(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("DEMO_LOG", thetahat_cli::DEMO_LOG)?;
    // The word, the name, and whether it is a logarithm of the cost and a penalty.
    let criteria = thetahat::estimate::InformationCriterion::all()
        .map(|criterion| (criterion.word(), criterion.name(), criterion.is_logarithmic()));
    module.add("CRITERIA", criteria.collect::<Vec<_>>())?;
    module.add("EstimationError", module.py().get_type::<error::EstimationError>())?;
    module.add_class::<log::Log>()?;
    module.add_class::<grey_box::GreyBox>()?;
    module.add_class::<model::Model>()?;
    module.add_class::<experiments::Experiments>()?;
    module.add_class::<normal_equations::NormalEquations>()?;
    module.add_class::<evaluation::Validation>()?;
    module.add_class::<journal::Journal>()?;
    module.add_class::<filter::StateModel>()?;
    module.add_class::<filter::StateFilter>()?;
    module.add_class::<track::Tracker>()?;
    module.add_function(wrap_pyfunction!(noise::fit_noise, module)?)?;
    module.add_function(wrap_pyfunction!(experiments::answer, module)?)?;
    module.add_function(wrap_pyfunction!(experiments::answer_equations, module)?)?;
    module.add_function(wrap_pyfunction!(experiments::fit_equations_distributed, module)?)?;
    module.add_function(wrap_pyfunction!(experiments::deviations, module)?)?;
    module.add_function(wrap_pyfunction!(track::policy, module)?)?;
    module.add_function(wrap_pyfunction!(model::fit, module)?)?;
    module.add_function(wrap_pyfunction!(model::fit_equations, module)?)?;
    module.add_function(wrap_pyfunction!(model::fit_response, module)?)?;
    module.add_function(wrap_pyfunction!(model::fit_equations_to_response, module)?)?;
    module.add_function(wrap_pyfunction!(templates::template, module)?)?;
    module.add_function(wrap_pyfunction!(templates::templates, module)?)?;
    module.add_function(wrap_pyfunction!(evaluation::validate, module)?)?;
    module.add_function(wrap_pyfunction!(evaluation::compare, module)?)?;
    module.add_function(wrap_pyfunction!(evaluation::inspect, module)?)?;
    module.add_function(wrap_pyfunction!(evaluation::inspect_file, module)?)?;
    module.add_function(wrap_pyfunction!(evaluation::inspection, module)?)?;
    module.add_function(wrap_pyfunction!(evaluation::topics, module)?)?;
    module.add_function(wrap_pyfunction!(evaluation::spectrum, module)?)?;
    module.add_function(wrap_pyfunction!(evaluation::given_response, module)?)?;
    module.add_function(wrap_pyfunction!(evaluation::response_within, module)?)?;
    module.add_function(wrap_pyfunction!(evaluation::step_test, module)?)?;
    module.add_function(wrap_pyfunction!(evaluation::sine_test, module)?)?;
    module.add_function(wrap_pyfunction!(design::control, module)?)?;
    module.add_function(wrap_pyfunction!(design::tune, module)?)?;
    module.add_function(wrap_pyfunction!(design::design_signal, module)?)?;
    module.add_function(wrap_pyfunction!(design::compare_signals, module)?)?;
    online::register(module)?;
    work::register(module)?;
    module.add_function(wrap_pyfunction!(evaluation::row, module)?)?;
    module.add_function(wrap_pyfunction!(in_python, module)?)?;
    module.add_function(wrap_pyfunction!(write, module)?)?;
    module.add_function(wrap_pyfunction!(run, module)?)
}

/// The command line: the exit code for these words, the program's name first.
#[pyfunction]
fn run(py: Python<'_>, words: Vec<OsString>) -> PyResult<u8> {
    work::blocking(py, || thetahat_cli::run(words))
}

/// Writes a text to a file, which holds either all of it or what it held before.
#[pyfunction]
fn write(py: Python<'_>, path: PathBuf, text: &str) -> PyResult<()> {
    py.detach(|| thetahat_cli::write(&path, text)).map_err(|failure| error::program(py, &failure))
}

/// A message of the command line with the keyword arguments that its options are here.
#[pyfunction]
fn in_python(message: &str) -> String {
    error::in_python(message)
}
