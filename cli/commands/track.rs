//! `thetahat track`: recursive identification along a log, or a pipe that someone is still writing to.

mod channels;
mod columns;
mod pace;
mod session;
mod state;
mod tracking;

use std::path::Path;
use std::time::{Duration, Instant};

use thetahat::Document;
use thetahat::present::tables;
use thetahat::report::Report;

use super::stored;
use crate::args::TrackArguments;
use crate::failure::Failure;
use crate::job::{Clock, TrackJob};
use crate::line_writer::LineWriter;
use crate::live::{Live, Next};
use crate::log;
use crate::messages::{say, warn};
use crate::output;
use crate::replace::Held;
use crate::wrap::stderr_layout;
use columns::Columns;
use session::{Memory, Row, Session};
use state::{Place, RowPlace, State};

pub use tracking::{TrackedRow, Tracking};

pub(crate) fn track(arguments: &TrackArguments) -> Result<(), Failure> {
    let job = TrackJob::resolve(arguments)?;
    let report = job.warm.as_deref().map(stored::report).transpose()?;
    if let (Some(path), Some(report)) = (&job.warm, &report)
        && report.model.as_nonlinear_arx().is_none()
        && report.model.as_state_space().is_none()
    {
        stored::polynomials(path, &report.model, "a tracker")?;
    }
    let mut run = Run::start(&job, report.as_ref())?;
    // That it cannot be written is better known now than in a week.
    if job.state.is_some() {
        run.lines.sync()?;
        run.save()?;
    }
    let ended = run.follow();
    // What a closed pipe has not taken is written again by the next run: so it goes on from the last state saved.
    if ended.as_ref().is_err_and(Failure::is_closed) {
        return ended.map(drop);
    }
    // In the middle of a row the state is neither that before it nor that after it.
    let saved = if run.midway { Ok(()) } else { run.lines.sync().and_then(|()| run.save()) };
    let ended = ended?;
    saved?;
    run.report()?;
    match ended {
        Ended::Stopped => Err(Failure::interrupted()),
        Ended::Alarm => Err(Failure::alarm(format!("{}: an alarm in row {}", run.name, run.state.rows))),
        Ended::End => Ok(()),
    }
}

/// While nothing comes, a state that is older is written anew.
const OLDEST_STATE: Duration = Duration::from_secs(10);

/// Why a run is over.
enum Ended {
    End,
    Stopped,
    Alarm,
}

/// A log that is being tracked.
struct Run<'a> {
    job: &'a TrackJob,
    /// The log's name, for messages.
    name: String,
    live: Live,
    lines: LineWriter,
    columns: Columns,
    state: State,
    /// When the state was last written, and whether there is more since.
    saved: Instant,
    unsaved: bool,
    /// Whether a row is being taken in.
    midway: bool,
    place: Place,
    /// The state's file, which no other run may write meanwhile.
    state_file: Option<Held>,
    memory: Memory,
}

impl<'a> Run<'a> {
    fn start(job: &'a TrackJob, report: Option<&Report>) -> Result<Self, Failure> {
        let name = job.path.display().to_string();
        let mut state_file = job.state.as_ref().map(|state| Held::open(&state.path)).transpose()?;
        let stored = match (&mut state_file, &job.state) {
            (Some(file), Some(state)) => State::read(file, &state.path)?,
            _ => None,
        };
        let mut chosen = None;
        let start = stored.as_ref().and_then(|state| state.start.as_deref());
        let (stream, warnings) = log::follow(&job.path, &job.log, job.state.is_some(), start, |header| {
            let channels = channels::choose(&job.options, report, header)
                .map_err(|message| Failure::data(format!("{name}: {message}")))?;
            let names = channels.inputs.iter().chain(&channels.outputs).cloned().collect();
            chosen = Some(channels);
            Ok(names)
        })?;
        let channels = chosen.unwrap_or_default();
        let trackers = job.trackers(&channels.inputs, &channels.outputs, report)?;
        let has_clock = stream.is_of_a_topic() || matches!(job.log.clock, Clock::Column { .. });
        let time = if let Clock::Column { name, .. } = &job.log.clock { name.as_str() } else { "" };
        let lines = state::Lines {
            time,
            horizon: job.options.horizon,
            every: job.lines.every,
            format: job.lines.format,
        };
        let setting = state::setting(&lines, &channels, &trackers);
        let resumed = stored.is_some();
        let state = match stored {
            Some(state) => state.checked(&setting, &trackers, job)?,
            None => {
                let sample_time = job.sample_time.or(report.map(|report| report.model.sample_time()));
                State::new(
                    setting,
                    &channels.outputs,
                    trackers,
                    stream.start().map(str::to_owned),
                    sample_time,
                )
            }
        };
        let columns = Columns::new(has_clock, job.options.horizon, &state.outputs, &state.trackers);
        let place = match &job.state {
            Some(state_job) if resumed => Place::resumed(state_job.resume, &job.path),
            _ => Place::There,
        };
        let lines = if resumed {
            let written = state.written.lines;
            let cut = match job.lines.out == Path::new("-") {
                true => format!(", line {written} of the output: what was written beyond that comes again"),
                false => String::new(),
            };
            say(&format!("goes on after row {}{cut}", state.rows));
            LineWriter::resume(&job.lines.out, job.lines.format, columns.names(), state.written.clone())?
        } else {
            LineWriter::create(&job.lines.out, job.lines.format, columns.names())?
        };
        warnings.iter().for_each(|warning| warn(warning));
        let memory = Memory::of(&state.trackers);
        Ok(Self {
            job,
            live: Live::new(stream, &name, job.lines.strict),
            name,
            lines,
            columns,
            state,
            saved: Instant::now(),
            unsaved: false,
            midway: false,
            place,
            state_file,
            memory,
        })
    }

    /// Goes through the log to its end.
    fn follow(&mut self) -> Result<Ended, Failure> {
        let save_every = self.job.state.as_ref().map(|state| state.save_every);
        loop {
            match self.live.next()? {
                Next::Row => {}
                Next::Idle => {
                    self.lines.flush()?;
                    // A slow log would lose hours if only rows counted.
                    if self.job.state.is_some() && self.saved.elapsed() > OLDEST_STATE && self.unsaved {
                        self.lines.sync()?;
                        self.save()?;
                    }
                    continue;
                }
                Next::End => {
                    self.place.check_end(&self.state, &self.name)?;
                    return Ok(Ended::End);
                }
                Next::Stopped => return Ok(Ended::Stopped),
            }
            let alarm = match self.place.of_row(&self.state, &self.live)? {
                RowPlace::Old => continue,
                place => {
                    self.midway = true;
                    self.row(place == RowPlace::AfterGap)?
                }
            };
            self.midway = false;
            if alarm && self.job.stop_on_alarm {
                return Ok(Ended::Alarm);
            }
            if save_every.is_some_and(|every| self.state.rows.is_multiple_of(every)) {
                self.lines.sync()?;
                self.save()?;
            }
        }
    }

    /// Takes in the row at hand; says whether there was an alarm.
    fn row(&mut self, after_gap: bool) -> Result<bool, Failure> {
        let Self { job, live, lines, columns, state, unsaved, memory, .. } = self;
        *unsaved = true;
        let row = Row {
            values: live.values(),
            time: live.time(),
            malformed: live.is_malformed(),
            has_clock: live.has_clock(),
            after_gap,
        };
        let mut session = Session { every: job.lines.every, details: false, columns, state, lines, memory };
        session.row(&row, || live.place(), |_| ())
    }

    fn save(&mut self) -> Result<(), Failure> {
        (self.saved, self.unsaved) = (Instant::now(), false);
        self.state.written = self.lines.written();
        self.state_file.as_mut().map_or(Ok(()), |file| self.state.write(file))
    }

    /// Warns of an unfinished line and of an unexpected clock, writes the summary, and prints it.
    fn report(&self) -> Result<(), Failure> {
        if self.live.is_unfinished() {
            warn(&format!(
                "{}: the last line has no line break yet; it is left for the next time",
                self.name
            ));
        }
        let summary = self.state.summary();
        if summary.gaps > summary.rows / 2 {
            let expected = self.state.pace.sample_time().unwrap_or(f64::NAN);
            warn(&format!(
                "{}: most steps of the clock are not the {expected} s that the model has; give --sample-time, or a report of \
                 this sample time",
                self.name
            ));
        }
        if let Some(path) = &self.job.summary {
            let json = summary.to_json().map_err(|error| Failure::data(error.to_string()))?;
            output::write(path, |file| file.write_all(json.as_bytes()))?;
        }
        if !self.job.lines.quiet {
            let layout = stderr_layout();
            let watched = self.job.options.alarm.is_some();
            say(tables::tracking(&summary, &self.live.faults(), watched, layout).trim_end());
        }
        Ok(())
    }
}
