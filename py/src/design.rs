//! Test signals for experiments, and what these are worth.

use std::ffi::OsString;
use std::sync::Arc;

use numpy::PyArray1;
use pyo3::prelude::*;
use thetahat::Document;
use thetahat::design::{SignalFigures, TestSignal};
use thetahat::present::tables;

use crate::error;
use crate::model::Model;
use crate::work::{awaited, interruptible};

/// An array of one dimension.
type Column<'py> = Bound<'py, PyArray1<f64>>;

/// Mean, root mean square, crest factor, order of persistent excitation, the highest order tried, and the spectrum:
/// frequencies and densities.
type Figures<'py> = (f64, f64, Option<f64>, usize, usize, Column<'py>, Column<'py>);

/// The signal that `thetahat design` makes with these options: its channels, the figures of each, its period, the
/// frequencies of its sinusoids, and the seconds between samples.
#[pyfunction]
#[expect(clippy::type_complexity, reason = "a tuple that the package takes apart at once")]
pub(crate) fn design_signal<'py>(
    py: Python<'py>,
    options: Vec<OsString>,
) -> PyResult<(Vec<Column<'py>>, Vec<Figures<'py>>, Option<usize>, Column<'py>, f64)> {
    let plan = thetahat_cli::signal_plan(&options).map_err(|failure| error::program(py, &failure))?;
    let sample_time = plan.sample_time;
    let (signal, channels, figures) = interruptible(py, move |_| {
        let signal = TestSignal::new(&plan)?;
        let channels = signal.values(plan.length);
        let figures: Vec<SignalFigures> =
            channels.iter().map(|values| SignalFigures::of(values, plan.sample_time)).collect();
        Ok((signal, channels, figures))
    })?;
    let column = |values: Vec<f64>| PyArray1::from_vec(py, values);
    let told = figures.into_iter().map(|figures| {
        let frequencies = figures.spectrum.iter().map(|point| point.frequency).collect();
        let densities = figures.spectrum.iter().map(|point| point.density).collect();
        let SignalFigures { mean, rms, crest_factor, order, highest, .. } = figures;
        (mean, rms, crest_factor, order, highest, column(frequencies), column(densities))
    });
    let told = told.collect();
    let frequencies = column(signal.frequencies().to_vec());
    Ok((channels.into_iter().map(column).collect(), told, signal.period(), frequencies, sample_time))
}

/// What several signals are worth for a model: the document that `thetahat design --for` writes, and its table.
#[pyfunction]
pub(crate) fn compare_signals(
    py: Python<'_>,
    model: &Bound<'_, Model>,
    options: Vec<OsString>,
) -> PyResult<(String, String)> {
    let model = Arc::clone(model.get().model());
    let found = awaited(py, move |_| thetahat_cli::compare_signals(&options, &model))?
        .map_err(|failure| error::program(py, &failure))?;
    let json = found.to_json().map_err(|error| error::batch(py, error))?;
    Ok((json, tables::experiment_design(&found, error::layout())))
}

/// PI and PID settings for a process: the document that `thetahat tune` writes, and its table.
#[pyfunction]
pub(crate) fn tune(
    py: Python<'_>,
    model: &Bound<'_, Model>,
    options: Vec<OsString>,
) -> PyResult<(String, String)> {
    let model = Arc::clone(model.get().model());
    let found = awaited(py, move |_| thetahat_cli::tuning_of(&options, &model))?
        .map_err(|failure| error::program(py, &failure))?;
    let json = found.to_json().map_err(|error| error::batch(py, error))?;
    Ok((json, tables::tuning(&found, error::layout())))
}

/// A controller for a model: the document that `thetahat control` writes, and its table.
#[pyfunction]
pub(crate) fn control(
    py: Python<'_>,
    model: &Bound<'_, Model>,
    options: Vec<OsString>,
) -> PyResult<(String, String)> {
    let model = Arc::clone(model.get().model());
    let found = awaited(py, move |_| thetahat_cli::controller_of(&options, &model))?
        .map_err(|failure| error::program(py, &failure))?;
    let json = found.to_json().map_err(|error| error::batch(py, error))?;
    Ok((json, tables::control(&found, error::layout())))
}
