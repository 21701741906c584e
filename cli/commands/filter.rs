//! `thetahat filter`: the state of a model along a log, or a pipe that someone is still writing to.

mod columns;
mod noises;

use thetahat::Document;
use thetahat::figures::fixed;
use thetahat::filter::{FilterSummary, StateFilter, StateModel};
use thetahat::present::tables;
use thetahat::report::Report;

use super::stored;
use crate::args::FilterArguments;
use crate::failure::Failure;
use crate::interrupt;
use crate::job::FilterJob;
use crate::line_writer::LineWriter;
use crate::live::{Live, Next};
use crate::log;
use crate::messages::{say, warn};
use crate::output;
use crate::wrap::stderr_layout;
use columns::Columns;

pub(crate) fn filter(arguments: &FilterArguments) -> Result<(), Failure> {
    let job = FilterJob::resolve(arguments)?;
    let model = read(&job)?;
    let model = match &*job.measurement_noise {
        [] => model,
        deviations => model.with_measurement_noise(deviations).map_err(|error| Failure::option(&error))?,
    };
    if let Some(structure) = job.noise_structure {
        return noises::fit_noise(&job, &model, structure);
    }
    let estimator = job.estimator(&model);
    let filter = StateFilter::new(model, estimator).map_err(|error| match &error {
        thetahat::Error::Argument { argument, message } if argument == "start" => {
            Failure::data(format!("{}: it cannot start: {message}", job.model.display()))
        }
        _ => Failure::option(&error),
    })?;
    let mut run = Run::start(&job, filter)?;
    let ended = run.follow();
    let finished = run.finish();
    let stopped = ended? | !finished?;
    if let Some(path) = &job.summary {
        let json = run.filter.summary().to_json().map_err(|error| Failure::data(error.to_string()))?;
        output::write(path, |file| file.write_all(json.as_bytes()))?;
    }
    if let Some(word) = consistency(&run.filter.summary()) {
        warn(&format!("{}: {word}", run.name));
    }
    if !job.lines.quiet {
        let layout = stderr_layout();
        say(tables::filtered(&run.filter.summary(), &run.live.faults(), layout).trim_end());
    }
    if stopped { Err(Failure::interrupted()) } else { Ok(()) }
}

/// What to think of normalised innovations that are far from what the model says, and of rows that contradict it.
pub fn consistency(summary: &FilterSummary) -> Option<String> {
    if let Some(count) = summary.contradictions.filter(|count| *count > 0) {
        let rows = if count == 1 { "1 row is".to_owned() } else { format!("{count} rows are") };
        return Some(format!(
            "{rows} explained by no state within the bounds, and not used: a noise is larger than its bound, a sensor has \
             failed, or the model is wrong; 'contradicts' names the output"
        ));
    }
    let nis = summary.nis.as_ref()?;
    let ratio = nis.mean / nis.expected;
    let advice = match ratio {
        2.0.. => {
            "standard deviations are too small; look at the clock (--time), the start, and the noises of the model"
        }
        ..0.5 => "standard deviations are too large; give the model smaller noises",
        _ => return None,
    };
    let ratio = fixed(ratio, 2);
    Some(format!("squared innovations are {ratio} times as large as the model says, so {advice}"))
}

/// The model in a file: a report, or a text.
fn read(job: &FilterJob) -> Result<StateModel, Failure> {
    let path = &job.model;
    let text = stored::text(path)?;
    // JSON begins with a brace, and TOML cannot.
    let is_json = text.trim_start().starts_with('{');
    let report = if is_json { Some(Report::from_json(&text)) } else { None };
    let says_itself = || {
        report.as_ref().is_none_or(|report| matches!(report, Ok(report) if report.model.takes_any_clock()))
    };
    if job.initial.is_some() && says_itself() {
        return Err(Failure::usage(
            "--initial is for reports of polynomials and nonlinear ARX models; a model in a text says itself where it starts",
        ));
    }
    let model = match report {
        Some(report) => report.and_then(|report| StateModel::from_report(&report, job.initial)),
        None => StateModel::from_toml(&text),
    };
    model.map_err(|error| {
        let swapped =
            job.path.extension().is_some_and(|extension| extension == "toml" || extension == "json");
        let advice = if swapped { "; the model stands in front of the log" } else { "" };
        Failure::data(format!("{}: {error}{advice}", path.display()))
    })
}

/// A log along which a state is estimated.
struct Run<'a> {
    job: &'a FilterJob,
    /// The log's name, for messages.
    name: String,
    live: Live,
    lines: LineWriter,
    columns: Columns,
    filter: StateFilter,
    /// The time of the log's first row.
    began: Option<f64>,
    /// What was read, where it is smoothed at the end.
    kept: Vec<Kept>,
    /// The filter as it was before the first row, where all is to be smoothed.
    fresh: Option<StateFilter>,
}

impl<'a> Run<'a> {
    fn start(job: &'a FilterJob, filter: StateFilter) -> Result<Self, Failure> {
        let model = filter.model();
        let columns = Columns::new(job, model)?;
        let (stream, warnings) = log::follow(&job.path, &job.log, false, None, |_| {
            Ok(model.inputs().iter().chain(model.outputs()).cloned().collect())
        })?;
        let lines = LineWriter::create(&job.lines.out, job.lines.format, columns.names())?;
        warnings.iter().for_each(|warning| warn(warning));
        let fresh = job.smooth.then(|| filter.clone());
        let filter = if job.smooth { filter.recording() } else { filter };
        Ok(Self {
            job,
            name: job.path.display().to_string(),
            live: Live::new(stream, &job.path.display().to_string(), job.lines.strict),
            lines,
            columns,
            filter,
            began: None,
            kept: Vec::new(),
            fresh,
        })
    }

    /// Goes through the log to its end; says whether the program was asked to end before.
    fn follow(&mut self) -> Result<bool, Failure> {
        let (first, last) =
            self.job.rows.map_or((1, u64::MAX), |rows| (rows.first() as u64, rows.last() as u64));
        while self.live.row() < last {
            match self.live.next()? {
                Next::Row => {
                    self.began = self.began.or(self.live.time());
                    if self.live.row() == first && first > 1 {
                        self.start_late(first);
                    }
                    if self.live.row() >= first {
                        self.row()?;
                    }
                }
                Next::Idle => self.lines.flush()?,
                Next::End => match self.job.rows {
                    Some(rows) => {
                        let all = self.live.row();
                        let message = format!("--rows {rows}: there are {all} rows; name some of them");
                        return Err(Failure::data(format!("{}: {message}", self.name)));
                    }
                    None => return Ok(false),
                },
                Next::Stopped => return Ok(true),
            }
        }
        Ok(false)
    }

    /// Says that the first row to go through is not the first one of the log.
    fn start_late(&mut self, row: u64) {
        let steps = (row - 1) as f64 * self.job.sample_time.unwrap_or(self.filter.model().sample_time());
        let seconds = self.live.time().zip(self.began).map_or(steps, |(time, began)| time - began);
        self.filter = self.filter.clone().starting_at(seconds);
        self.fresh = self.fresh.take().map(|fresh| fresh.starting_at(seconds));
    }

    /// Takes in the row at hand.
    fn row(&mut self) -> Result<(), Failure> {
        let Self { job, live, lines, columns, filter, kept, .. } = self;
        // Without its time a row has no place; the next one tells how long it took.
        if live.has_clock() && live.time().is_none() {
            return Ok(());
        }
        let (row, time, values) = (live.row(), live.time(), live.values());
        let step = if live.has_clock() { live.step() } else { job.sample_time };
        let (inputs, outputs) = values.split_at(filter.model().inputs().len());
        let estimate = filter
            .step(step, inputs, outputs)
            .map_err(|error| {
                Failure::data(format!(
                    "{}: {error}; if the log is right, the filter has diverged: start it nearer, or with larger noises",
                    live.place()
                ))
            })?;
        if job.smooth {
            kept.push(Kept { row, time, step, values: values.to_vec() });
        } else if row.is_multiple_of(job.lines.every) {
            columns.row(lines, row, time, outputs, &estimate, None)?;
        }
        Ok(())
    }

    /// Writes what still waits; says whether that was all. A log that did not come to its end is not smoothed.
    fn finish(&mut self) -> Result<bool, Failure> {
        let Some(mut again) = self.fresh.take() else { return self.lines.flush().map(|()| true) };
        let failed = |error: thetahat::Error| Failure::data(format!("{}: {error}", self.name));
        let Some(smoothed) = interrupt::at_once(|| self.filter.smooth()) else { return Ok(false) };
        let smoothed = smoothed.map_err(failed)?;
        let inputs = self.filter.model().inputs().len();
        for (index, Kept { row, time, step, values }) in self.kept.iter().enumerate() {
            if interrupt::is_ending() {
                self.lines.flush()?;
                return Ok(false);
            }
            let (inputs, outputs) = values.split_at(inputs);
            let estimate = again.step(*step, inputs, outputs).map_err(failed)?;
            if row.is_multiple_of(self.job.lines.every) {
                self.columns.row(
                    &mut self.lines,
                    *row,
                    *time,
                    outputs,
                    &estimate,
                    smoothed.row(index + 1),
                )?;
            }
        }
        self.lines.flush().map(|()| true)
    }
}

/// A row that was read.
struct Kept {
    row: u64,
    time: Option<f64>,
    /// The seconds since the row before, as the filter was told.
    step: Option<f64>,
    values: Vec<f64>,
}
