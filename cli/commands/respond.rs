//! `thetahat predict` and `thetahat simulate`: what a stored model says of a log.

use std::io::Write;
use std::path::Path;

use thetahat::{Applied, Detrend, Drawn, Draws, Horizon, Log, Start, apply, sample};

use super::{stored, summary};
use crate::args::{PredictArguments, RespondArguments, SimulateArguments};
use crate::failure::Failure;
use crate::job::{LogJob, parsed, rows};
use crate::log::{self, Loaded};
use crate::messages::{tell, warn};
use crate::output;

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
    respond(&arguments.respond, horizon, arguments.initial.given(), None)
}

pub(crate) fn simulate(arguments: &SimulateArguments) -> Result<(), Failure> {
    let asked = arguments.draws.map(|count| Asked {
        draws: Draws { count: count as usize, seed: arguments.seed.unwrap_or(0) },
        file: arguments.draws_file.as_deref(),
    });
    respond(&arguments.respond, Horizon::FreeRun, arguments.initial.given(), asked)
}

/// Draws, and where they go.
struct Asked<'a> {
    draws: Draws,
    file: Option<&'a Path>,
}

fn respond(
    arguments: &RespondArguments,
    horizon: Horizon,
    initial: Option<Start>,
    draws: Option<Asked<'_>>,
) -> Result<(), Failure> {
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
    let kept = draws.is_some().then(|| log.clone());
    let sources = [source];
    let failed = log::failure(&sources);
    let applied = apply(&model, log, &asked, detrend, horizon, initial).map_err(&failed)?;
    let drawn = draws
        .as_ref()
        .zip(kept)
        .map(|(draws, log)| sample(&model, log, &asked, detrend, initial, &draws.draws).map_err(&failed));
    let drawn = drawn.transpose()?;
    let bands = drawn.as_ref().map(|drawn| drawn.bands(&QUANTILES));

    if let (Some(drawn), Some(Asked { file: Some(file), .. })) = (&drawn, &draws) {
        output::write_csv(file, |csv| runs_as_csv(csv, drawn, &applied, &clock))?;
    }
    output::write_csv(&arguments.out, |csv| rows_as_csv(csv, &applied, bands.as_ref(), &clock))?;
    if let Some(Drawn { unstable, varied, values, .. }) = &drawn {
        if !varied {
            warn("the covariance of the parameters is not known: the draws differ in their noise alone");
        }
        if *unstable > 0 {
            warn(&format!(
                "parameters of an unstable model were drawn {unstable} times beside {} stable ones, and drawn again",
                values.len()
            ));
        }
    }
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

/// The levels of the bands.
const QUANTILES: [f64; 2] = [0.025, 0.975];

/// Time or row, measured, predicted, the deviation or the bands where there are any; what is missing is empty.
fn rows_as_csv(
    csv: &mut csv::Writer<&mut dyn Write>,
    applied: &Applied,
    bands: Option<&(Vec<f64>, Vec<Vec<f64>>)>,
    clock: &RowClock,
) -> Result<(), csv::Error> {
    let mut columns: Vec<(String, Option<&[f64]>)> = vec![
        ("measured".to_owned(), applied.measured.as_deref()),
        ("predicted".to_owned(), Some(&applied.predicted)),
    ];
    if let Some(deviations) = &applied.standard_deviations {
        columns.push(("standard_deviation".to_owned(), Some(deviations)));
    }
    if let Some((mean, quantiles)) = bands {
        columns.push(("mean".to_owned(), Some(mean)));
        let named = QUANTILES.iter().map(|level| format!("quantile_{level}"));
        columns.extend(named.zip(quantiles).map(|(name, values)| (name, Some(values.as_slice()))));
    }
    columns_as_csv(csv, &columns, applied, clock)
}

/// Time or row, and each run.
fn runs_as_csv(
    csv: &mut csv::Writer<&mut dyn Write>,
    drawn: &Drawn,
    applied: &Applied,
    clock: &RowClock,
) -> Result<(), csv::Error> {
    let runs =
        drawn.values.iter().zip(1..).map(|(run, number)| (format!("draw_{number}"), Some(run.as_slice())));
    columns_as_csv(csv, &runs.collect::<Vec<_>>(), applied, clock)
}

/// Time or row, and some columns by their names.
fn columns_as_csv(
    csv: &mut csv::Writer<&mut dyn Write>,
    columns: &[(String, Option<&[f64]>)],
    applied: &Applied,
    clock: &RowClock,
) -> Result<(), csv::Error> {
    let name = if clock.time.is_some() { "time" } else { "row" };
    csv.write_record(std::iter::once(name).chain(columns.iter().map(|(name, _)| name.as_str())))?;
    let value = |values: Option<&[f64]>, position: usize| {
        values.and_then(|values| values.get(position).copied()).filter(|value| value.is_finite())
    };
    let asked = applied.rows.iter().flat_map(|range| range.first() - 1..range.last());
    for position in asked.chain(clock.rows..clock.rows + applied.beyond) {
        let values: Vec<Option<f64>> = columns.iter().map(|(_, values)| value(*values, position)).collect();
        match clock.at(position) {
            Some(time) => csv.serialize((time, values))?,
            None => csv.serialize((position + 1, values))?,
        }
    }
    Ok(())
}
