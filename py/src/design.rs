//! Test signals for experiments, and what these are worth.

use std::sync::Arc;

use numpy::PyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use thetahat::Document;
use thetahat::control::{ControlPlan, Design};
use thetahat::design::{DesignOptions, SignalFigures, TestSignal};
use thetahat::present::tables;
use thetahat::thetahat_core::nalgebra::Complex;
use thetahat::tune::{Controller, TuningPlan};

use crate::error;
use crate::model::Model;
use crate::plan::options;
use crate::work::interruptible;

/// An array of one dimension.
type Column<'py> = Bound<'py, PyArray1<f64>>;

/// Mean, root mean square, crest factor, order of persistent excitation, the highest order tried, and the spectrum:
/// frequencies and densities.
type Figures<'py> = (f64, f64, Option<f64>, usize, usize, Column<'py>, Column<'py>);

/// The signal that a plan asks for: its channels, the figures of each, its period, the
/// frequencies of its sinusoids, and the seconds between samples.
#[pyfunction]
#[expect(clippy::type_complexity, reason = "a tuple that the package takes apart at once")]
pub(crate) fn design_signal<'py>(
    py: Python<'py>,
    plan: &str,
) -> PyResult<(Vec<Column<'py>>, Vec<Figures<'py>>, Option<usize>, Column<'py>, f64)> {
    let asked: DesignOptions = options(py, plan)?;
    let plan = asked.signal_plan().map_err(|error| error::batch(py, error))?;
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

/// What the signals of a plan are worth for a model: the document that `thetahat design --for` writes, and its table.
#[pyfunction]
pub(crate) fn compare_signals(
    py: Python<'_>,
    model: &Bound<'_, Model>,
    plan: &str,
) -> PyResult<(String, String)> {
    let asked: DesignOptions = options(py, plan)?;
    let model = Arc::clone(model.get().model());
    let found = interruptible(py, move |_| {
        let polynomials = model.polynomials("the plan of an experiment")?;
        thetahat::design::compare_signals(polynomials, &asked.signal_plans(&model)?, &asked.want)
    })?;
    let json = found.to_json().map_err(|error| error::batch(py, error))?;
    Ok((json, tables::experiment_design(&found, error::layout())))
}

/// PI and PID settings for a process: the document that `thetahat tune` writes, and its table.
#[pyfunction]
pub(crate) fn tune(
    py: Python<'_>,
    model: &Bound<'_, Model>,
    input: Option<String>,
    closed_loop_time: Option<f64>,
    controller: Option<&str>,
) -> PyResult<(String, String)> {
    let controller = match controller {
        None => None,
        Some("pi") => Some(Controller::Pi),
        Some("pid") => Some(Controller::Pid),
        Some(other) => {
            return Err(PyValueError::new_err(format!("controller: '{other}' is neither 'pi' nor 'pid'")));
        }
    };
    let plan = TuningPlan { input, closed_loop_time, controller };
    let model = Arc::clone(model.get().model());
    let found = interruptible(py, move |_| thetahat::tune::tune(&*model.process("settings are")?, &plan))?;
    let json = found.to_json().map_err(|error| error::batch(py, error))?;
    Ok((json, tables::tuning(&found, error::layout())))
}

/// A controller for a model: the document that `thetahat control` writes, and its table. `aim` are the poles, or the
/// weight of the input, each with its imaginary part; `channels` what it moves and holds; `flags` whether it
/// integrates, and cancels zeros.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "the package gives them by name")]
pub(crate) fn control(
    py: Python<'_>,
    model: &Bound<'_, Model>,
    design: &str,
    aim: Vec<(f64, f64)>,
    observer: Option<Vec<(f64, f64)>>,
    channels: (Option<String>, Option<String>),
    flags: (bool, bool),
    limits: (f64, f64),
    draws: usize,
) -> PyResult<(String, String)> {
    let input_weight = aim.first().map_or(0.0, |weight| weight.0);
    let complex = |poles: Vec<(f64, f64)>| poles.into_iter().map(|(re, im)| Complex::new(re, im)).collect();
    let design = match design {
        "poles" => Design::Poles(complex(aim)),
        "lqr" => Design::Quadratic { input_weight },
        _ => Design::MinimumVariance { input_weight },
    };
    let plan = ControlPlan {
        input: channels.0,
        output: channels.1,
        observer: observer.map(complex),
        integrator: flags.0,
        cancel_zeros: flags.1,
        limits: limits.0..=limits.1,
        draws,
        ..ControlPlan::new(design)
    };
    let model = Arc::clone(model.get().model());
    let found = interruptible(py, move |_| thetahat::control::control(&model, &plan))?;
    let json = found.to_json().map_err(|error| error::batch(py, error))?;
    Ok((json, tables::control(&found, error::layout())))
}
