//! `thetahat predict` and `thetahat simulate`: what a stored model says of a log.

use std::io::Write;
use std::path::Path;

use thetahat::{Applied, Detrend, Horizon, Log, Start, apply};

use super::{stored, summary};
use crate::args::{PredictArguments, RespondArguments, SimulateArguments};
use crate::failure::Failure;
use crate::job::{LogJob, parsed, rows};
use crate::log::{self, Loaded};
use crate::output::{self, tell, warn};

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
    respond(&arguments.respond, horizon, arguments.initial.given())
}

pub(crate) fn simulate(arguments: &SimulateArguments) -> Result<(), Failure> {
    respond(&arguments.respond, Horizon::FreeRun, arguments.initial.given())
}

fn respond(arguments: &RespondArguments, horizon: Horizon, initial: Option<Start>) -> Result<(), Failure> {
    let job = LogJob::resolve(&arguments.log, &arguments.clock)?;
    let asked = rows("--rows", &arguments.rows)?;
    let detrend: Option<Detrend> = match arguments.detrend.as_str() {
        "model" => None,
        text => Some(parsed("--detrend", text)?),
    };
    if arguments.report == Path::new("-") && arguments.path == Path::new("-") {
        return Err(Failure::usage("the report and the log cannot both come from standard input"));
    }
    let model = stored::model(&arguments.report)?;

    let output = model.output.name.clone();
    let mut measured = true;
    let Loaded { log, source, words } =
        log::load(&arguments.path, &job, Some(model.sample_time), |header| {
            measured = header.contains(&output);
            let inputs = model.inputs.iter().map(|input| input.name.clone());
            Ok(inputs.chain(measured.then(|| output.clone())).collect())
        })?;
    words.iter().for_each(|word| warn(word));
    let initial =
        initial.unwrap_or_else(|| if measured { Start::natural(&model, horizon) } else { Start::Zero });
    let clock = RowClock::of(&log);
    let applied = apply(&model, log, &asked, detrend, horizon, initial).map_err(log::failure(&[source]))?;

    output::write_csv(&arguments.out, |csv| rows_as_csv(csv, &applied, &clock))?;
    match &applied.fit {
        Some(_) if !applied.predicted.iter().any(|value| value.is_finite()) => {
            warn("no row could be predicted: the stretches without a gap are too short")
        }
        Some(fit) => tell(&summary::figure(fit)),
        None => {}
    }
    Ok(())
}

/// What the rows of an answer are called. It survives the log, which is used up.
struct RowClock {
    time: Option<Vec<f64>>,
    rows: usize,
    sample_time: f64,
}

impl RowClock {
    fn of(log: &Log) -> Self {
        Self { time: log.time().map(<[f64]>::to_vec), rows: log.rows(), sample_time: log.sample_time() }
    }

    /// The time of a row (0-based), where there are times; those behind the end of the log go on in its own step.
    fn at(&self, position: usize) -> Option<f64> {
        let beyond = (position + 1).saturating_sub(self.rows) as f64 * self.sample_time;
        self.time.as_ref().map(|time| time[position.min(self.rows - 1)] + beyond)
    }
}

/// Time or row, measured, predicted, and the deviation where there is one; what is missing is empty.
fn rows_as_csv(
    csv: &mut csv::Writer<&mut dyn Write>,
    applied: &Applied,
    clock: &RowClock,
) -> Result<(), csv::Error> {
    let name = if clock.time.is_some() { "time" } else { "row" };
    let deviations = applied.standard_deviations.as_deref();
    csv.write_record(
        [name, "measured", "predicted"].into_iter().chain(deviations.map(|_| "standard_deviation")),
    )?;
    let value = |values: Option<&[f64]>, position: usize| {
        values.and_then(|values| values.get(position).copied()).filter(|value| value.is_finite())
    };
    let asked = applied.rows.iter().flat_map(|range| range.first() - 1..range.last());
    for position in asked.chain(clock.rows..clock.rows + applied.beyond) {
        let measured = value(applied.measured.as_deref(), position);
        let predicted = value(Some(&applied.predicted), position);
        let deviation = deviations.map(|deviations| value(Some(deviations), position));
        match (clock.at(position), deviation) {
            (Some(time), Some(deviation)) => csv.serialize((time, measured, predicted, deviation))?,
            (Some(time), None) => csv.serialize((time, measured, predicted))?,
            (None, Some(deviation)) => csv.serialize((position + 1, measured, predicted, deviation))?,
            (None, None) => csv.serialize((position + 1, measured, predicted))?,
        }
    }
    Ok(())
}
