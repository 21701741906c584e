//! `thetahat control`: a controller for a model.

use std::path::Path;

use thetahat::control::{Control, control as controlled};
use thetahat::present::tables;

use super::{closed_loop, stored};
use crate::args::ControlArguments;
use crate::failure::Failure;
use crate::job::control_plan;
use crate::output;

pub(crate) fn control(arguments: &ControlArguments) -> Result<(), Failure> {
    // What is wrong with an option is said before anything is read.
    let plan = control_plan(arguments)?;
    let found = controlled(&stored::model(&arguments.report)?, &plan)
        .map_err(|error| Failure::about(&error, |_| arguments.report.display().to_string()))?;
    closed_loop::write(&arguments.outputs, &found, &found.warnings, responses, tables::control)
}

/// A row for each time.
fn responses(path: &Path, found: &Control) -> Result<(), Failure> {
    output::write_csv(path, |csv| {
        csv.write_record(["time", "setpoint_response", "controller_output", "load_response"])?;
        let of = &found.closed_loop;
        let rows = of.setpoint_response.iter().zip(&of.controller_output).zip(&of.load_response);
        for (time, ((setpoint, moved), load)) in of.time.iter().zip(rows) {
            csv.serialize((time, setpoint, moved, load))?;
        }
        Ok(())
    })
}
