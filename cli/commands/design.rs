//! `thetahat design`: test signals, and what experiments with them are worth.

use std::path::Path;

use thetahat::Document;
use thetahat::design::{DesignOptions, SignalFigures, SignalPlan, TestSignal, compare_signals};
use thetahat::present::tables;

use super::stored;
use crate::args::{DesignArguments, FormatArgument};
use crate::failure::Failure;
use crate::messages::tell;
use crate::output;
use crate::wrap::layout_of;

pub(crate) fn design(arguments: &DesignArguments) -> Result<(), Failure> {
    let options = arguments.options.options()?;
    match &arguments.model {
        None => signal(arguments, &options.signal_plan().map_err(|error| Failure::option(&error))?),
        Some(report) => compare(arguments, &options, report),
    }
}

/// Writes one signal, and says what it is.
fn signal(arguments: &DesignArguments, plan: &SignalPlan) -> Result<(), Failure> {
    let signal = TestSignal::new(plan).map_err(|error| Failure::option(&error))?;
    let channels = signal.values(plan.length);
    let figures: Vec<SignalFigures> =
        channels.iter().map(|values| SignalFigures::of(values, plan.sample_time)).collect();
    let names = names(plan.channels);
    if let Some(path) = &arguments.spectrum {
        output::write_csv(path, |csv| {
            csv.write_record(["frequency"].into_iter().chain(names.iter().map(String::as_str)))?;
            let first = figures.first().map_or(&[][..], |figures| &figures.spectrum);
            for (row, point) in first.iter().enumerate() {
                let densities: Vec<f64> = figures.iter().map(|of| of.spectrum[row].density).collect();
                csv.serialize((point.frequency, densities))?;
            }
            Ok(())
        })?;
    }
    output::write_csv(&arguments.out, |csv| {
        csv.write_record(["t"].into_iter().chain(names.iter().map(String::as_str)))?;
        for row in 0..plan.length {
            let values: Vec<f64> = channels.iter().map(|channel| channel[row]).collect();
            csv.serialize((row as f64 * plan.sample_time, values))?;
        }
        Ok(())
    })?;
    for line in tables::test_signal(plan, &signal, &names, &figures) {
        tell(&line);
    }
    Ok(())
}

/// Writes what several signals are worth for a model.
fn compare(arguments: &DesignArguments, options: &DesignOptions, report: &Path) -> Result<(), Failure> {
    let model = stored::model(report)?;
    let polynomials = stored::polynomials(report, &model, "the plan of an experiment")?;
    let plans = options.signal_plans(&model).map_err(|error| Failure::option(&error))?;
    let found = compare_signals(polynomials, &plans, &options.want)
        .map_err(|error| Failure::about(&error, |_| report.display().to_string()))?;
    // What goes into a file does not depend on the terminal.
    let layout = layout_of(&arguments.out);
    let text = match arguments.format {
        FormatArgument::Json => found.to_json().map_err(|error| Failure::data(error.to_string()))?,
        FormatArgument::Table => tables::experiment_design(&found, layout),
    };
    output::write(&arguments.out, |file| file.write_all(text.as_bytes()))
}

/// u, or u1, u2, …: what fits take for inputs.
fn names(channels: usize) -> Vec<String> {
    if channels == 1 { vec!["u".to_owned()] } else { (1..=channels).map(|j| format!("u{j}")).collect() }
}
