//! `thetahat filter`: the state of a model along a log, or a pipe that someone is still writing to.

mod columns;

use thetahat::{GreyReport, Report, Start, StateFilter, StateModel};

use super::{stored, summary};
use crate::args::FilterArguments;
use crate::failure::Failure;
use crate::job::{Clock, FilterJob};
use crate::lines::Lines;
use crate::live::{Live, Next};
use crate::log;
use crate::output::{self, say, warn};
use columns::Columns;

pub(crate) fn filter(arguments: &FilterArguments) -> Result<(), Failure> {
    let job = FilterJob::resolve(arguments)?;
    let written = [Some(&job.lines.out), job.summary.as_ref()].into_iter().flatten();
    for written in written {
        [&job.path, &job.model].into_iter().try_for_each(|read| output::apart(written, read))?;
    }
    let model = read(&job)?;
    let estimator = job.estimator(&model);
    let filter = StateFilter::new(model, estimator).map_err(|error| Failure::option(&error))?;
    let mut run = Run::start(&job, filter)?;
    let ended = run.follow();
    let flushed = run.finish();
    let stopped = ended?;
    flushed?;
    if let Some(path) = &job.summary {
        let json = run.filter.summary().to_json().map_err(|error| Failure::data(error.to_string()))?;
        output::write(path, |file| file.write_all(json.as_bytes()))?;
    }
    if !job.lines.quiet {
        say(summary::filtered(&run.filter.summary(), run.live.malformed()).trim_end());
    }
    if stopped { Err(Failure::interrupted()) } else { Ok(()) }
}

/// The model in a file: a report of one of the two kinds, or a text.
fn read(job: &FilterJob) -> Result<StateModel, Failure> {
    let path = &job.model;
    let text = stored::text(path)?;
    // JSON begins with a brace, and TOML cannot.
    let is_json = text.trim_start().starts_with('{');
    let is_grey = text.contains("\"thetahat.greybox/");
    if job.initial.is_some() && (!is_json || is_grey) {
        return Err(Failure::usage(
            "--initial is for reports; a model in a text says itself where it starts",
        ));
    }
    let model = match (is_json, is_grey) {
        (true, true) => {
            GreyReport::from_json(&text).and_then(|report| report.fitted_model()).map(StateModel::from)
        }
        (true, false) => Report::from_json(&text)
            .and_then(|report| StateModel::from_report(&report, job.initial.unwrap_or(Start::Estimated))),
        (false, _) => StateModel::from_toml(&text),
    };
    model.map_err(|error| match &error {
        thetahat::Error::Argument { argument, .. } if argument == "initial" => Failure::option(&error),
        _ => Failure::data(format!("{}: {error}", path.display())),
    })
}

/// A log along which a state is estimated.
struct Run<'a> {
    job: &'a FilterJob,
    /// The log's name, for messages.
    name: String,
    live: Live,
    lines: Lines,
    columns: Columns,
    filter: StateFilter,
    /// The time of the row before.
    last: Option<f64>,
    /// The rows, with the step before each, where they are smoothed at the end.
    rows: Vec<(Option<f64>, Vec<f64>)>,
    /// The filter as it was before the first row, where all is to be smoothed.
    fresh: Option<StateFilter>,
}

impl<'a> Run<'a> {
    fn start(job: &'a FilterJob, filter: StateFilter) -> Result<Self, Failure> {
        let model = filter.model();
        let columns = Columns::new(job, model)?;
        let (stream, words) = log::follow(&job.path, &job.log, false, None, |_| {
            Ok(model.inputs().iter().chain(model.outputs()).cloned().collect())
        })?;
        let lines = Lines::create(&job.lines.out, job.lines.format, columns.names())?;
        words.iter().for_each(|word| warn(word));
        let fresh = job.smooth.then(|| filter.clone());
        let filter = if job.smooth { filter.recording() } else { filter };
        Ok(Self {
            job,
            name: job.path.display().to_string(),
            live: Live::new(stream, job.lines.strict),
            lines,
            columns,
            filter,
            last: None,
            rows: Vec::new(),
            fresh,
        })
    }

    /// Goes through the log to its end; says whether the program was asked to end before.
    fn follow(&mut self) -> Result<bool, Failure> {
        loop {
            match self.live.next()? {
                Next::Row => match self.job.rows {
                    Some(rows) if self.live.row() < rows.first() as u64 => {}
                    Some(rows) if self.live.row() > rows.last() as u64 => return Ok(false),
                    _ => self.row()?,
                },
                Next::Idle => self.lines.flush()?,
                Next::End => return Ok(false),
                Next::Stopped => return Ok(true),
            }
        }
    }

    /// Takes in the row at hand.
    fn row(&mut self) -> Result<(), Failure> {
        let Self { job, name, live, lines, columns, filter, last, rows, .. } = self;
        let step = match (live.time(), *last) {
            // Without its time a row has no place; the next one tells how long it took.
            (None, _) if live.has_clock() => return Ok(()),
            (Some(time), Some(before)) if time <= before => {
                let message = format!("{name}:{}: the time does not rise", live.line());
                if job.lines.strict {
                    return Err(Failure::data(format!("{message}; correct it, or leave out --strict")));
                }
                warn(&format!("{message}; the row is left out"));
                return Ok(());
            }
            (Some(time), before) => before.map(|before| time - before),
            (None, _) => job.sample_time,
        };
        *last = live.time();
        let (inputs, outputs) = live.values().split_at(filter.model().inputs().len());
        let estimate = filter
            .step(step, inputs, outputs)
            .map_err(|error| Failure::data(format!("{name}:{}: {error}", live.line())))?;
        if job.smooth {
            rows.push((step, live.values().to_vec()));
        } else if live.row().is_multiple_of(job.lines.every) {
            columns.row(lines, live.row(), live.time(), outputs, &estimate, None)?;
        }
        Ok(())
    }

    /// Writes what still waits.
    fn finish(&mut self) -> Result<(), Failure> {
        let Some(mut again) = self.fresh.take() else { return self.lines.flush() };
        let failed = |error: thetahat::Error| Failure::data(format!("{}: {error}", self.name));
        let smoothed = self.filter.smooth().map_err(failed)?;
        let inputs = self.filter.model().inputs().len();
        let has_time = matches!(self.job.log.clock, Clock::Column { .. });
        for (index, (step, values)) in self.rows.iter().enumerate() {
            let (inputs, outputs) = values.split_at(inputs);
            let estimate = again.step(*step, inputs, outputs).map_err(failed)?;
            let row = (self.job.rows.map_or(1, |rows| rows.first()) + index) as u64;
            if row.is_multiple_of(self.job.lines.every) {
                let time = has_time.then_some(estimate.time);
                self.columns.row(&mut self.lines, row, time, outputs, &estimate, smoothed.row(index))?;
            }
        }
        self.lines.flush()
    }
}
