//! `thetahat step`: what a log of steps shows, and what a stored model does after a step.

use std::fs::File;
use std::io::{self, BufRead, Read};
use std::path::Path;

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

/// The first bytes of a file say what it is.
const HEAD: u64 = 4096;
/// UTF-8 may begin with it.
const MARK: &[u8] = b"\xef\xbb\xbf";

pub(crate) fn step(arguments: &StepArguments, line: &str) -> Result<(), Failure> {
    if !is_json(&arguments.path)? {
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

/// Whether a file is JSON: whether the first that is not blank is {. What comes on standard input is not used up. A
/// pipe that has a name cannot be read twice: it is taken for a document.
fn is_json(path: &Path) -> Result<bool, Failure> {
    let failed = |error| Failure::io(path, "cannot be read", &error);
    let begins = |head: &[u8]| {
        let head = head.strip_prefix(MARK).unwrap_or(head);
        head.iter().find(|byte| !byte.is_ascii_whitespace()) == Some(&b'{')
    };
    if path == Path::new("-") {
        return Ok(begins(io::stdin().lock().fill_buf().map_err(failed)?));
    }
    let file = File::open(path).map_err(failed)?;
    let metadata = file.metadata().map_err(failed)?;
    if !(metadata.is_file() || metadata.is_dir()) {
        return Ok(true);
    }
    let mut head = Vec::new();
    file.take(HEAD).read_to_end(&mut head).map_err(failed)?;
    Ok(begins(&head))
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
