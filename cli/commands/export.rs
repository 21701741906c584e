//! `thetahat export`: a fitted model as source code for firmware.

use std::fs;
use std::path::Path;
use std::slice;

use thetahat::control::Control;
use thetahat::data::Log;
use thetahat::export::{Exported, ExportedFile, export as exported, export_controller};
use thetahat::model::Signal;
use thetahat::{Document, is_document};

use super::stored;
use crate::args::ExportArguments;
use crate::failure::Failure;
use crate::job::{LogJob, rows};
use crate::log::{self, Clocks, Loaded};
use crate::messages::{tell, warn};
use crate::output;

pub(crate) fn export(arguments: &ExportArguments) -> Result<(), Failure> {
    let job = LogJob::resolve(&arguments.log, &arguments.clock)?;
    let asked = rows("--rows", &arguments.rows)?;
    let plan = arguments.plan();
    let path = &arguments.report;
    let is_standard_input = |path: &Path| path == Path::new("-");
    if is_standard_input(path) && arguments.path.as_deref().is_some_and(is_standard_input) {
        return Err(Failure::usage("the report and the log cannot both come from standard input"));
    }
    let text = stored::text(path)?;
    let (Exported { files, warnings }, what) = if is_document::<Control>(&text) {
        let document = Control::from_json(&text)
            .map_err(|error| Failure::data(format!("{}: {error}", path.display())))?;
        let clocks = Clocks { sample_time: Some(document.sample_time), any: false };
        let (inputs, outputs) = (slice::from_ref(&document.input), slice::from_ref(&document.output));
        let made = made(arguments, &job, (clocks, inputs, outputs), |log| {
            export_controller(&document, &plan, log.map(|log| (log, asked.as_slice())))
        })?;
        (made, document.model)
    } else {
        let report = stored::report_of(path, &text)?;
        let model = &report.model;
        let signals = (Clocks::from(model), model.inputs(), model.outputs());
        let made = made(arguments, &job, signals, |log| {
            exported(&report, &plan, log.map(|log| (log, asked.as_slice())))
        })?;
        (made, model.name())
    };
    write(arguments, &files)?;
    warnings.iter().for_each(|warning| warn(warning));
    say(&format!("{} of {what}", plan.purpose.word()), &files);
    Ok(())
}

/// What `export` makes with the log that was given. What cannot be exported is refused before one is read.
fn made(
    arguments: &ExportArguments,
    job: &LogJob,
    (clocks, inputs, outputs): (Clocks, &[Signal], &[Signal]),
    export: impl Fn(Option<&Log>) -> Result<Exported, thetahat::Error>,
) -> Result<Exported, Failure> {
    let plain =
        export(None).map_err(|error| Failure::about(&error, |_| arguments.report.display().to_string()))?;
    let Some(path) = &arguments.path else { return Ok(plain) };
    // The channels that the log has.
    let Loaded { log, source, warnings } = log::load(path, job, clocks, |header| {
        let outputs = outputs.iter().map(|output| output.name.clone());
        let inputs = inputs.iter().map(|input| input.name.clone());
        Ok(inputs.chain(outputs.filter(|name| header.contains(name))).collect())
    })?;
    warnings.iter().for_each(|warning| warn(warning));
    export(Some(&log)).map_err(log::failure(&[source]))
}

fn write(arguments: &ExportArguments, files: &[ExportedFile]) -> Result<(), Failure> {
    let folder = &arguments.out;
    fs::create_dir_all(folder).map_err(|error| Failure::io(folder, "cannot be made", &error))?;
    files.iter().try_for_each(|file| {
        output::write(&folder.join(&file.name), |out| out.write_all(file.text.as_bytes()))
    })
}

fn say(what: &str, files: &[ExportedFile]) {
    let names: Vec<&str> = files.iter().map(|file| file.name.as_str()).collect();
    tell(&format!("{what}: {}", names.join(", ")));
}
