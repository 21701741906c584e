//! `thetahat predict` and `thetahat simulate`: what a stored model says of a log.

use std::io::Write;
use std::path::Path;

use thetahat::data::{Detrend, Log, Source};
use thetahat::present::tables;
use thetahat::report::{Applied, sample};
use thetahat::respond::{Drawn, Draws, Horizon, InitialCondition};

use super::stored;
use crate::args::{PredictArguments, RespondArguments, SimulateArguments};
use crate::failure::Failure;
use crate::job::{LogJob, parsed, rows};
use crate::log::{self, Clocks, Loaded};
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
    respond(&arguments.respond, horizon, arguments.initial.given(), &Run::Plain)
}

pub(crate) fn simulate(arguments: &SimulateArguments) -> Result<(), Failure> {
    let run = match arguments.draws {
        Some(count) => Run::Drawn(
            Draws { count: count as usize, seed: arguments.seed.unwrap_or(0) },
            arguments.draws_file.as_deref(),
        ),
        None if arguments.clamp => Run::Clamped,
        None => Run::Plain,
    };
    respond(&arguments.respond, Horizon::FreeRun, arguments.initial.given(), &run)
}

/// What is asked of a response.
enum Run<'a> {
    Plain,
    /// What is fed back stays in a range.
    Clamped,
    /// Beside it draws, and where they go.
    Drawn(Draws, Option<&'a Path>),
}

fn respond(
    arguments: &RespondArguments,
    horizon: Horizon,
    initial: Option<InitialCondition>,
    run: &Run<'_>,
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
    let report = stored::report(&arguments.report)?;
    let model = &report.model;

    if let Run::Drawn(..) = run {
        stored::polynomials(&arguments.report, model, "what is drawn from a fit's uncertainty")?;
    }
    let mut measured = true;
    let loaded = log::load(&arguments.path, &job, Clocks::from(model), |header| {
        let outputs = || model.outputs().iter().map(|output| output.name.clone());
        measured = outputs().all(|name| header.contains(&name));
        let inputs = model.inputs().iter().map(|input| input.name.clone());
        Ok(inputs.chain(outputs().filter(|name| header.contains(name))).collect())
    });
    let Loaded { log, source, warnings } = loaded?;
    warnings.iter().for_each(|warning| warn(warning));
    let natural = || if measured { model.natural_start(horizon) } else { InitialCondition::Zero };
    let initial = initial.unwrap_or_else(natural);
    let sources = [source];
    let clock = RowClock { log: &log, source: &sources[0] };
    let failed = log::failure(&sources);
    let applied = match run {
        Run::Clamped => report.clamped_run(&log, &asked, detrend, initial),
        Run::Plain | Run::Drawn(..) => report.apply(&log, &asked, detrend, horizon, initial),
    };
    let applied = applied.map_err(&failed)?;
    let drawn = match run {
        Run::Drawn(draws, _) => Some(sample(model, &log, &asked, detrend, initial, draws).map_err(&failed)?),
        Run::Plain | Run::Clamped => None,
    };
    let bands = drawn.as_ref().map(|drawn| drawn.bands(&QUANTILES));

    if let (Some(drawn), Run::Drawn(_, Some(file))) = (&drawn, run) {
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
    for output in &applied.outputs {
        let of = if applied.outputs.len() > 1 { format!("{}: ", output.name) } else { String::new() };
        match &output.fit {
            Some(fit) if fit.samples == 0 && !output.predicted.iter().any(|value| value.is_finite()) => {
                warn(&format!("{of}no row could be predicted: the segments without a gap are too short"))
            }
            Some(fit) => tell(&format!("{of}{}", tables::figure(fit))),
            None => {}
        }
        // Squares of numbers always have a mean.
        if output.fit.as_ref().is_some_and(|fit| fit.samples > 0 && fit.rmse.is_none()) {
            warn(&format!(
                "{of}the response, or the squares of its errors, grow beyond the range of numbers; rows without a number are empty"
            ));
        }
    }
    if let Some(clamped) = applied.clamped {
        let values = if clamped == 1 { "value was" } else { "values were" };
        tell(&format!("{clamped} {values} kept within 1.1 times the range of the estimation rows"));
    }
    // Every output reads the same values.
    if let Some(outside) = applied.outputs.iter().find_map(|output| output.fit.as_ref()?.outside)
        && outside > 0.0
    {
        tell(&format!(
            "in {:.1} % of the samples the model read values outside of those of the estimation rows",
            100.0 * outside
        ));
    }
    Ok(())
}

/// What the rows of an answer are called.
struct RowClock<'l> {
    log: &'l Log,
    source: &'l Source,
}

/// A row by its time, or by its number.
#[derive(serde::Serialize)]
#[serde(untagged)]
enum RowName {
    Date(String),
    Seconds(f64),
    Number(usize),
}

impl RowClock<'_> {
    /// The time of a row (0-based), as the log has it, where there are times; those after the end of the log go on in
    /// its own step.
    fn at(&self, position: usize) -> RowName {
        let rows = self.log.rows();
        let beyond = (position + 1).saturating_sub(rows) as f64 * self.log.sample_time();
        let Some(time) = self.log.time() else { return RowName::Number(position + 1) };
        let seconds = time[position.min(rows - 1)] + beyond;
        self.source.instant(seconds).map_or(RowName::Seconds(seconds), RowName::Date)
    }
}

/// The levels of the bands.
const QUANTILES: [f64; 2] = [0.025, 0.975];

/// Time or row, measured, predicted, the deviation or the bands where there are any; what is missing is empty.
fn rows_as_csv(
    csv: &mut csv::Writer<&mut dyn Write>,
    applied: &Applied,
    bands: Option<&(Vec<f64>, Vec<Vec<f64>>)>,
    clock: &RowClock<'_>,
) -> Result<(), csv::Error> {
    let mut columns: Vec<(String, Option<&[f64]>)> = Vec::new();
    for output in &applied.outputs {
        let name = |what: &str| match applied.outputs.len() {
            1 => what.to_owned(),
            _ => format!("{what}_{}", output.name),
        };
        columns.push((name("measured"), output.measured.as_deref()));
        columns.push((name("predicted"), Some(&output.predicted)));
        if let Some(deviations) = &output.standard_deviations {
            columns.push((name("standard_deviation"), Some(deviations)));
        }
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
    clock: &RowClock<'_>,
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
    clock: &RowClock<'_>,
) -> Result<(), csv::Error> {
    let name = if clock.log.time().is_some() { "time" } else { "row" };
    csv.write_record(std::iter::once(name).chain(columns.iter().map(|(name, _)| name.as_str())))?;
    let value = |values: Option<&[f64]>, position: usize| {
        values.and_then(|values| values.get(position).copied()).filter(|value| value.is_finite())
    };
    let asked = applied.rows.iter().flat_map(|range| range.first() - 1..range.last());
    for position in asked.chain((0..applied.beyond).map(|beyond| clock.log.rows() + beyond)) {
        let values: Vec<Option<f64>> = columns.iter().map(|(_, values)| value(*values, position)).collect();
        csv.serialize((clock.at(position), values))?;
    }
    Ok(())
}
