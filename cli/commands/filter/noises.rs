//! `thetahat filter --fit-noise`: the noises of a model in matrices, from a log.

use thetahat::estimate::NoiseStructure;
use thetahat::filter::{NoiseLog, StateModel};
use thetahat::optimize::Search;
use thetahat::present::tables;

use crate::commands::search::Telling;
use crate::failure::Failure;
use crate::job::FilterJob;
use crate::live::{Live, Next};
use crate::log;
use crate::messages::{say, warn};
use crate::output;
use crate::wrap::stderr_layout;

/// Finds the noises of a model and writes it with them.
pub(super) fn fit_noise(
    job: &FilterJob,
    model: &StateModel,
    structure: NoiseStructure,
) -> Result<(), Failure> {
    let name = job.path.display().to_string();
    let Rows { steps, inputs, outputs } = read(job, model)?;
    let log = NoiseLog { steps: Some(&steps), inputs: &inputs, outputs: &outputs };
    let found = Telling::Aloud
        .watched(|monitor| model.fit_noise(&[log], structure, &Search::default(), monitor))?
        .map_err(|error| match &error {
            thetahat::Error::Argument { argument, message } if argument == "structure" => {
                Failure::usage(format!("--fit-noise: {message}"))
            }
            thetahat::Error::Argument { argument, message } if argument == "model" => {
                Failure::usage(format!("--fit-noise: {}: {message}", job.model.display()))
            }
            _ => Failure::about(&error, |_| name.clone()),
        })?;
    let text = found.model.to_toml().unwrap_or_default();
    output::write(&job.lines.out, |file| file.write_all(text.as_bytes()))?;
    found.warnings().iter().for_each(|warning| warn(&format!("{name}: {warning}")));
    if !job.lines.quiet {
        say(tables::noises(&found, stderr_layout()).trim_end());
    }
    Ok(())
}

/// The rows of a log: see [`NoiseLog`].
#[derive(Default)]
struct Rows {
    steps: Vec<f64>,
    inputs: Vec<f64>,
    outputs: Vec<f64>,
}

/// Reads the rows that were asked for, to the end of the log.
fn read(job: &FilterJob, model: &StateModel) -> Result<Rows, Failure> {
    let (stream, warnings) = log::follow(&job.path, &job.log, false, None, |_| {
        Ok(model.inputs().iter().chain(model.outputs()).cloned().collect())
    })?;
    warnings.iter().for_each(|warning| warn(warning));
    let mut live = Live::new(stream, &job.path.display().to_string(), job.lines.strict);
    let (first, last) = job.rows.map_or((1, u64::MAX), |rows| (rows.first() as u64, rows.last() as u64));
    let mut rows = Rows::default();
    while live.row() < last {
        match live.next()? {
            Next::Row => {}
            Next::Idle => continue,
            Next::End if job.rows.is_some() => {
                let message = format!("there are {} rows; name some of them (--rows)", live.row());
                return Err(Failure::data(format!("{}: {message}", job.path.display())));
            }
            Next::End => break,
            Next::Stopped => return Err(Failure::interrupted()),
        }
        // Without its time a row has no place; the next one tells how long it took.
        if live.row() < first || (live.has_clock() && live.time().is_none()) {
            continue;
        }
        let step = if live.has_clock() { live.step() } else { job.sample_time };
        let (inputs, outputs) = live.values().split_at(model.inputs().len());
        rows.steps.push(step.unwrap_or(f64::NAN));
        rows.inputs.extend_from_slice(inputs);
        rows.outputs.extend_from_slice(outputs);
    }
    Ok(rows)
}
