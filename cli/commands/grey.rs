//! `thetahat fit --grey`: the unknown parameters of a model in equations.

use std::ops::ControlFlow;
use std::path::Path;

use thetahat::{Document, GreyBox, Recording, Rows, Source, Times, fit_grey};

use super::{stored, summary};
use crate::args::{FitArguments, FormatArgument};
use crate::failure::Failure;
use crate::interrupt;
use crate::job::{Clock, GreyJob};
use crate::log::{self, Recorded};
use crate::messages::warn;
use crate::output;
use crate::progress::Searching;
use crate::wrap::stdout_width;

pub(super) fn fit(arguments: &FitArguments, model: &Path) -> Result<(), Failure> {
    let job = GreyJob::resolve(arguments, model)?;
    let text = stored::text(model)?;
    let grey =
        GreyBox::from_toml(&text).map_err(|error| Failure::data(format!("{}: {error}", model.display())))?;
    let (mut recordings, mut sources) = (Vec::new(), Vec::<Source>::new());
    for path in &job.paths {
        let names = || grey.inputs().iter().chain(grey.outputs()).cloned().collect();
        let Recorded { mut recording, mut source, words, .. } = log::record(path, &job.log, |_| Ok(names()))?;
        words.iter().for_each(|word| warn(word));
        if job.log.clock == Clock::Unknown {
            recording.times = Times::Uniform(grey.sample_time());
        }
        let before = sources.last().map_or(0, |source| source.rows.last());
        source.rows = Rows::new(before + 1, before + source.rows.last())
            .map_err(|error| Failure::data(format!("{}: {error}", path.display())))?;
        recordings.push(recording);
        sources.push(source);
    }
    let recordings = parts(recordings, &sources, &job.estimate)?;
    let progress = Searching::new();
    let monitor = |now| {
        progress.update(now);
        if interrupt::asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let found = interrupt::during(|| fit_grey(&grey, &recordings, &sources, &monitor));
    drop(progress);
    let report = found?.map_err(log::failure(&sources))?;
    let json = report.to_json().map_err(|error| Failure::data(error.to_string()))?;
    if let Some(path) = &arguments.report {
        output::write(path, |file| file.write_all(json.as_bytes()))?;
    }
    report.warnings.iter().for_each(|warning| warn(warning));
    match arguments.format {
        // Standard output holds one document.
        _ if arguments.report.as_deref() == Some(Path::new("-")) => Ok(()),
        FormatArgument::Json => output::print(&json),
        FormatArgument::Table => output::print(&summary::grey(&report, stdout_width())),
    }
}

/// The rows asked for, counted through all logs: each stretch within a log is an experiment of its own. All if none are.
fn parts(logs: Vec<Recording>, sources: &[Source], asked: &[Rows]) -> Result<Vec<Recording>, Failure> {
    if asked.is_empty() {
        return Ok(logs);
    }
    let all = sources.last().map_or(0, |source| source.rows.last());
    if let Some(beyond) = asked.iter().find(|rows| rows.last() > all) {
        return Err(Failure::data(format!("--estimate {beyond}: there are {all} rows; name some of them")));
    }
    let mut parts = Vec::new();
    for rows in asked {
        for (recording, source) in logs.iter().zip(sources) {
            let first = rows.first().max(source.rows.first());
            let last = rows.last().min(source.rows.last());
            if first > last {
                continue;
            }
            let before = source.rows.first() - 1;
            let part = Rows::new(first - before, last - before).and_then(|rows| recording.part(rows));
            parts.push(part.map_err(log::failure(sources))?);
        }
    }
    Ok(parts)
}
