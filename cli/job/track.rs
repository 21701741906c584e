use std::path::{Path, PathBuf};

use thetahat::report::Report;
use thetahat::track::{TrackOptions, Tracker};

use super::{LineJob, LogJob};
use crate::args::{ResumeArgument, TrackArguments};
use crate::failure::Failure;

/// A model to track.
#[derive(Debug)]
pub(crate) struct TrackJob {
    pub(crate) path: PathBuf,
    pub(crate) log: LogJob,
    /// Seconds from one row to the next, if that is given.
    pub(crate) sample_time: Option<f64>,
    pub(crate) options: TrackOptions,
    pub(crate) warm: Option<PathBuf>,
    pub(crate) lines: LineJob,
    pub(crate) stop_on_alarm: bool,
    pub(crate) state: Option<StateJob>,
    pub(crate) summary: Option<PathBuf>,
}

/// Where the state is kept.
#[derive(Debug)]
pub(crate) struct StateJob {
    pub(crate) path: PathBuf,
    pub(crate) save_every: u64,
    pub(crate) resume: ResumeArgument,
}

impl TrackJob {
    pub(crate) fn resolve(arguments: &TrackArguments) -> Result<Self, Failure> {
        let (log, sample_time) = LogJob::live(&arguments.log, &arguments.clock)?;
        let options = arguments.options.options()?;
        options.check(arguments.warm.is_some()).map_err(|error| Failure::option(&error))?;
        if arguments.warm.as_deref() == Some(Path::new("-")) && arguments.path == Path::new("-") {
            return Err(Failure::usage(
                "only one of the report and the log can come from standard input (-)",
            ));
        }
        if arguments.state.as_deref() == Some(Path::new("-")) {
            return Err(Failure::usage("--state -: a state is kept in a file; name one"));
        }
        Ok(Self {
            path: arguments.path.clone(),
            log,
            sample_time,
            options,
            warm: arguments.warm.clone(),
            lines: LineJob::resolve(&arguments.lines),
            stop_on_alarm: arguments.stop_on_alarm,
            state: arguments.state.as_ref().map(|path| StateJob {
                path: path.clone(),
                save_every: arguments.save_every,
                resume: arguments.resume,
            }),
            summary: arguments.lines.summary.clone(),
        })
    }

    /// Trackers for each way to forget: one for each output.
    pub(crate) fn trackers(
        &self,
        inputs: &[String],
        outputs: &[String],
        report: Option<&Report>,
    ) -> Result<Vec<Tracker>, Failure> {
        self.options.trackers(inputs, outputs, report).map_err(|error| match error {
            thetahat::Error::Report { .. } => {
                let file = self.warm.as_ref().map_or_else(String::new, |path| path.display().to_string());
                Failure::data(format!("{file}: {error}"))
            }
            _ => Failure::option(&error),
        })
    }
}
