//! `thetahat tune`: PI and PID settings for a process.

use std::path::Path;

use thetahat::present::{tables, tuning_page};
use thetahat::tune::{Controller, Tuning, TuningPlan, tune as tuned};

use super::{closed_loop, stored};
use crate::args::{ControllerArgument, TuneArguments};
use crate::failure::Failure;
use crate::output;

pub(crate) fn tune(arguments: &TuneArguments, line: &str) -> Result<(), Failure> {
    let report = &arguments.report;
    let model = stored::model(report)?;
    let process = model.process("settings are").map_err(|error| stored::refused(report, error))?;
    let plan = TuningPlan {
        input: arguments.input.clone(),
        closed_loop_time: arguments.lambda,
        controller: arguments.controller.map(|controller| match controller {
            ControllerArgument::Pi => Controller::Pi,
            ControllerArgument::Pid => Controller::Pid,
        }),
    };
    let found =
        tuned(&process, &plan).map_err(|error| Failure::about(&error, |_| report.display().to_string()))?;
    if let Some(path) = &arguments.html {
        output::page(path, &tuning_page(&found, line))?;
    }
    closed_loop::write(&arguments.outputs, &found, &found.warnings, responses, tables::tuning)
}

/// A row for each setting and time.
fn responses(path: &Path, found: &Tuning) -> Result<(), Failure> {
    output::write_csv(path, |csv| {
        csv.write_record([
            "rule",
            "controller",
            "time",
            "setpoint_response",
            "controller_output",
            "load_response",
        ])?;
        for own in &found.settings {
            let of = &own.closed_loop;
            let rows = of.setpoint_response.iter().zip(&of.controller_output).zip(&of.load_response);
            for (time, ((setpoint, moved), load)) in of.time.iter().zip(rows) {
                csv.serialize((own.rule.name(), own.controller.name(), time, setpoint, moved, load))?;
            }
        }
        Ok(())
    })
}
