//! `thetahat export`: a fitted model as source code for firmware.

use std::fs;
use std::path::Path;

use thetahat::control::Control;
use thetahat::export::{Exported, ExportedFile, export as exported, export_controller};
use thetahat::model::Model;
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
    if is_document::<Control>(&text) {
        return controller(arguments, &text);
    }
    let report = stored::report_of(path, &text)?;
    // What cannot be exported is refused before a log is read.
    let plain = exported(&report, &plan, None)
        .map_err(|error| Failure::about(&error, |_| path.display().to_string()))?;
    let Exported { files, warnings } = match &arguments.path {
        None => plain,
        Some(log_path) => {
            let Loaded { log, source, words } = load(log_path, &job, &report.model)?;
            words.iter().for_each(|word| warn(word));
            exported(&report, &plan, Some((&log, &asked))).map_err(log::failure(&[source]))?
        }
    };
    write(arguments, &files)?;
    warnings.iter().for_each(|warning| warn(warning));
    say(&format!("{} of {}", plan.purpose.word(), report.model.name()), &files);
    Ok(())
}

/// The controller of a document.
fn controller(arguments: &ExportArguments, text: &str) -> Result<(), Failure> {
    let shown = arguments.report.display();
    if arguments.path.is_some() {
        return Err(Failure::usage("a controller has no test vector: leave the log out"));
    }
    let document = Control::from_json(text).map_err(|error| Failure::data(format!("{shown}: {error}")))?;
    let exported = export_controller(&document, &arguments.plan());
    let Exported { files, .. } = exported.map_err(|error| Failure::about(&error, |_| shown.to_string()))?;
    write(arguments, &files)?;
    say(&format!("controller of {}", document.model), &files);
    Ok(())
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

/// The channels of a model that a log has.
fn load(path: &Path, job: &LogJob, model: &Model) -> Result<Loaded, Failure> {
    log::load(path, job, Clocks::from(model), |header| {
        let inputs = model.inputs().iter().map(|input| input.name.clone());
        let outputs = model.outputs().iter().map(|output| output.name.clone());
        Ok(inputs.chain(outputs.filter(|name| header.contains(name))).collect())
    })
}
