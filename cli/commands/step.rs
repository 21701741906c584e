//! `thetahat step`: what a log of steps shows, and what a stored model does after a step.

use thetahat::data::Log;
use thetahat::present::{step_test_page, tables};
use thetahat::spectrum::MeasuredResponse;
use thetahat::step_test::{StepTest, sine_test, step_test};
use thetahat::{Document, is_document};

use super::experiments::{Experiments, Wanted, read};
use super::{stored, transient};
use crate::args::{FormatArgument, StepArguments};
use crate::failure::Failure;
use crate::job::StepTestJob;
use crate::wrap::layout_of;
use crate::{log, output};

pub(crate) fn step(arguments: &StepArguments, line: &str) -> Result<(), Failure> {
    if !stored::is_json(&arguments.path)? {
        let (found, log) = tested(&StepTestJob::resolve(arguments)?)?;
        return written(arguments, &found, Some(&log), line);
    }
    let path = &arguments.path;
    let text = stored::text(path)?;
    if is_document::<MeasuredResponse>(&text) {
        arguments.check_document("a frequency response", true)?;
        let response = stored::response_of(path, &text)?;
        let inputs: Vec<&str> = response.responses.iter().filter_map(|of| of.input.as_deref()).collect();
        let input = match (&arguments.input, inputs.as_slice()) {
            (Some(named), _) => named.as_str(),
            (None, [only]) => only,
            (None, several) => {
                return Err(Failure::usage(format!(
                    "{}: the response is from several inputs; name one with --input: {}",
                    path.display(),
                    several.join(", ")
                )));
            }
        };
        let found = sine_test(&response, input)
            .map_err(|error| Failure::about(&error, |_| path.display().to_string()))?;
        return written(arguments, &found, None, line);
    }
    arguments.check_document("a report", false)?;
    let what = if arguments.impulse { transient::IMPULSE } else { transient::STEP };
    let model = stored::report_of(path, &text)?.model;
    let samples = arguments.samples.map(|samples| samples as usize);
    transient::respond(&what, path, &model, samples, &arguments.out, arguments.html.as_deref(), line)
}

/// Reads the log and evaluates its steps.
fn tested(job: &StepTestJob) -> Result<(StepTest, Log), Failure> {
    let named = job.input.as_ref().map(|name| vec![name.clone()]);
    let wanted = Wanted {
        inputs: named.clone(),
        outputs: job.output.iter().cloned().collect(),
        driven: true,
        none: "no inputs",
    };
    let one = |inputs: usize| match inputs {
        1 => Ok(()),
        _ => Err(Failure::usage(format!(
            "a step test has one input, and there are {inputs}: name one with --input"
        ))),
    };
    let paths = [job.path.clone()];
    let Experiments { log, sources, channels, warnings } = read(&paths, &job.log, &wanted, true, one)?;
    let (mut inputs, output) = channels.single();
    let plan = job.plan(inputs.pop().unwrap_or_default(), output);
    let mut found = step_test(&log, &sources, &plan).map_err(log::failure(&sources))?;
    found.warnings.splice(0..0, warnings);
    Ok((found, log))
}

/// Writes the document, as a table or as it is, and its page.
fn written(
    arguments: &StepArguments,
    found: &StepTest,
    log: Option<&Log>,
    line: &str,
) -> Result<(), Failure> {
    let json = found.to_json().map_err(|error| Failure::data(error.to_string()))?;
    if let Some(path) = &arguments.html {
        output::page(path, &step_test_page(found, log, line))?;
    }
    if let Some(path) = &arguments.report {
        output::write(path, |file| file.write_all(json.as_bytes()))?;
    }
    // What goes into a file does not depend on the terminal.
    let layout = layout_of(&arguments.out);
    let text = match arguments.format {
        Some(FormatArgument::Json) => json,
        Some(FormatArgument::Table) | None => tables::step_test(found, layout),
    };
    output::write(&arguments.out, |file| file.write_all(text.as_bytes()))
}
