//! `thetahat predict` and `thetahat simulate`: what a stored model says of a log.

use std::fs::File;
use std::io::{self, Read, Write};
use std::path::Path;

use thetahat::{Applied, Detrend, Horizon, Model, Report, Start, apply};

use super::summary;
use crate::args::{PredictArguments, RespondArguments, SimulateArguments};
use crate::failure::Failure;
use crate::job::{LogJob, parsed, rows};
use crate::log::{self, Loaded};
use crate::output::{self, say, warn};

/// A report has this many bytes at most: beyond it the file is something else.
const LARGEST_REPORT: u64 = 1 << 30;

pub(crate) fn predict(arguments: &PredictArguments) -> Result<(), Failure> {
    let horizon = match arguments.horizon.as_str() {
        "inf" => Horizon::FreeRun,
        text => match text.parse() {
            Ok(steps) if steps > 0 => Horizon::Steps { steps },
            _ => {
                return Err(Failure::usage(format!(
                    "--horizon {text}: give a number of steps from 1 on, or inf"
                )));
            }
        },
    };
    respond(&arguments.respond, horizon, arguments.initial.map(Start::from))
}

pub(crate) fn simulate(arguments: &SimulateArguments) -> Result<(), Failure> {
    respond(&arguments.respond, Horizon::FreeRun, arguments.initial.map(Start::from))
}

fn respond(arguments: &RespondArguments, horizon: Horizon, initial: Option<Start>) -> Result<(), Failure> {
    let job = LogJob::resolve(&arguments.log, &arguments.clock)?;
    let asked = rows("--rows", &arguments.rows)?;
    let detrend: Option<Detrend> = match arguments.detrend.as_str() {
        "model" => None,
        text => Some(parsed("--detrend", text)?),
    };
    if arguments.report == Path::new("-") && job.path == Path::new("-") {
        return Err(Failure::usage("the report and the log cannot both come from standard input"));
    }
    output::apart(&arguments.out, &job.path)?;
    output::apart(&arguments.out, &arguments.report)?;
    let model = stored(&arguments.report)?;

    let output = model.output.name.clone();
    let mut measured = true;
    let Loaded { log, source } = log::load(&job, Some(model.sample_time), |header| {
        measured = header.contains(&output);
        let inputs = model.inputs.iter().map(|input| input.name.clone());
        Ok(inputs.chain(measured.then(|| output.clone())).collect())
    })?;
    let initial = initial.unwrap_or(match (horizon, measured) {
        (Horizon::Steps { .. }, _) => Start::Measured,
        (Horizon::FreeRun, true) => Start::Estimated,
        (Horizon::FreeRun, false) => Start::Zero,
    });
    // The clock survives the log, which is used up.
    let time: Option<Vec<f64>> = log.time().map(<[f64]>::to_vec);
    let applied = apply(&model, log, &asked, detrend, horizon, initial).map_err(Loaded::failure(&source))?;

    output::write(&arguments.out, |file| {
        rows_as_csv(file, &applied, time.as_deref()).map_err(|error| match error.into_kind() {
            csv::ErrorKind::Io(error) => error,
            other => io::Error::other(format!("{other:?}")),
        })
    })?;
    match &applied.fit {
        Some(fit) if fit.samples > 0 => say(&summary::figure(fit)),
        Some(_) => warn("no row could be predicted: the stretches without a gap are too short"),
        None => {}
    }
    Ok(())
}

/// Time or row, measured, predicted; what is missing is empty.
fn rows_as_csv(file: &mut dyn Write, applied: &Applied, time: Option<&[f64]>) -> Result<(), csv::Error> {
    let mut csv = csv::Writer::from_writer(file);
    csv.write_record([if time.is_some() { "time" } else { "row" }, "measured", "predicted"])?;
    let present = |value: f64| Some(value).filter(|value| value.is_finite());
    for row in applied.rows.iter().flat_map(|range| range.first()..=range.last()) {
        let position = row - 1;
        let measured = applied.measured.as_ref().and_then(|measured| present(measured[position]));
        let predicted = present(applied.predicted[position]);
        match time {
            Some(time) => csv.serialize((time[position], measured, predicted))?,
            None => csv.serialize((row, measured, predicted))?,
        }
    }
    Ok(csv.flush()?)
}

/// The model of a stored report.
fn stored(path: &Path) -> Result<Model, Failure> {
    let failed = |error| Failure::io(path, "cannot be read", &error);
    let mut bytes = Vec::new();
    if path == Path::new("-") {
        io::stdin().lock().take(LARGEST_REPORT).read_to_end(&mut bytes).map_err(failed)?;
    } else {
        File::open(path).map_err(failed)?.take(LARGEST_REPORT).read_to_end(&mut bytes).map_err(failed)?;
    }
    let bad = |message: String| Failure::data(format!("{}: {message}", path.display()));
    let text = String::from_utf8(bytes)
        .map_err(|_| bad("this is not a thetahat report: not UTF-8 text".to_owned()))?;
    Ok(Report::from_json(&text).map_err(|error| bad(error.to_string()))?.model)
}
