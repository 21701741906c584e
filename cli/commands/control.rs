//! `thetahat control`: a controller for a model.

use std::path::Path;

use thetahat::Document;
use thetahat::control::{Control, ControlPlan, control as controlled};
use thetahat::model::Model;

use super::{stored, summary};
use crate::args::{ControlArguments, FormatArgument};
use crate::failure::Failure;
use crate::job::control_plan;
use crate::messages::warn;
use crate::output;
use crate::wrap::{WIDTH, stdout_width};

pub(crate) fn control(arguments: &ControlArguments) -> Result<(), Failure> {
    // What is wrong with an option is said before anything is read.
    let plan = control_plan(arguments)?;
    let found = designed(&plan, &stored::model(&arguments.report)?, &arguments.report)?;
    let json = found.to_json().map_err(|error| Failure::data(error.to_string()))?;
    if let Some(path) = &arguments.document {
        output::write(path, |file| file.write_all(json.as_bytes()))?;
    }
    if let Some(path) = &arguments.responses {
        responses(path, &found)?;
    }
    for warning in &found.warnings {
        warn(warning);
    }
    // What goes into a file does not depend on the terminal.
    let width = if arguments.out == Path::new("-") { stdout_width() } else { WIDTH };
    let text = match arguments.format {
        FormatArgument::Json => json,
        FormatArgument::Table => summary::control(&found, width),
    };
    output::write(&arguments.out, |file| file.write_all(text.as_bytes()))
}

/// The controller for a model, which messages name by a path.
pub(crate) fn designed(plan: &ControlPlan, model: &Model, name: &Path) -> Result<Control, Failure> {
    controlled(model, plan).map_err(|error| Failure::about(&error, |_| name.display().to_string()))
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
