//! `thetahat inspect`: checks of a log before a fit.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use thetahat::data::{Finding, Recording, Source, Times};
use thetahat::inspect::{Inspection, InspectionPlan, PiecewiseInspection, TopicList};
use thetahat::present::{inspection_page, tables};
use thetahat::{Document, text};
use thetahat_table::Reader;

use super::each::{Done, each};
use super::experiments::usual_inputs;
use crate::args::{EachArguments, FormatArgument, InspectArguments};
use crate::failure::Failure;
use crate::job::InspectJob;
use crate::log::{self, Recorded};
use crate::output;
use crate::wrap::layout_of;

pub(crate) fn inspect(arguments: &InspectArguments, line: &str) -> Result<(), Failure> {
    if arguments.each.each {
        return each(&arguments.each, &arguments.logs, &of_many(arguments)?, |log| one(arguments, log));
    }
    let job = InspectJob::resolve(arguments)?;
    let reader = if arguments.stream { None } else { Some(log::open(&job.path, &job.log)?) };
    let topics =
        reader.as_ref().filter(|_| !job.is_named()).and_then(|reader| log::list_of_topics(reader, &job.path));
    if let Some(topics) = topics {
        return list(&topics, arguments);
    }
    let (inspection, recording) = inspected_in(&job, arguments, reader)?;
    if let (Some(path), Some(Recording { channels, times })) = (&arguments.html, recording) {
        let time = match times {
            Times::Measured(time) => time,
            Times::Uniform(step) => (0..inspection.rows).map(|row| row as f64 * step).collect(),
        };
        let signals: Vec<(String, Vec<f64>)> =
            channels.into_iter().map(|channel| (channel.name, channel.values)).collect();
        output::page(path, &inspection_page(&inspection, &signals, &time, line))?;
    }
    let text = match arguments.format {
        FormatArgument::Json => inspection.to_json().map_err(|error| Failure::data(error.to_string()))?,
        FormatArgument::Table => tables::inspection(&inspection, layout_of(&arguments.out)),
    };
    output::write(&arguments.out, |file| file.write_all(text.as_bytes()))
}

/// Says what topics there are, of which columns may be named.
fn list(topics: &TopicList, arguments: &InspectArguments) -> Result<(), Failure> {
    if arguments.html.is_some() {
        return Err(Failure::usage(
            "--html draws columns, and the log has topics with clocks of their own: name columns with --input and --output",
        ));
    }
    let text = match arguments.format {
        FormatArgument::Json => topics.to_json().map_err(|error| Failure::data(error.to_string()))?,
        FormatArgument::Table => tables::topics(topics, layout_of(&arguments.out)),
    };
    output::write(&arguments.out, |file| file.write_all(text.as_bytes()))
}

/// What inspections of many logs have in common, in words that differ where they do.
fn of_many(arguments: &InspectArguments) -> Result<String, Failure> {
    let own = of_log(arguments, Path::new("log"));
    // What is wrong with the options is so with all logs.
    InspectJob::resolve(&own)?;
    Ok(format!("inspect {own:?}"))
}

/// The same inspection of one log.
fn of_log(arguments: &InspectArguments, log: &Path) -> InspectArguments {
    InspectArguments { logs: vec![log.to_owned()], each: EachArguments::default(), ..arguments.clone() }
}

/// Inspects one log of many.
fn one(arguments: &InspectArguments, log: &Path) -> Result<Done, Failure> {
    let own = of_log(arguments, log);
    let mut job = InspectJob::resolve(&own)?;
    job.log.quiet = true;
    let (inspection, _) = inspected(&job, &own)?;
    Done::new(&inspection, inspection.row(), Vec::new(), &inspection.warnings())
}

/// Reads the log and inspects it. What was read is there for a page, if one was asked for.
pub(crate) fn inspected(
    job: &InspectJob,
    arguments: &InspectArguments,
) -> Result<(Inspection, Option<Recording>), Failure> {
    let reader = if arguments.stream { None } else { Some(log::open(&job.path, &job.log)?) };
    inspected_in(job, arguments, reader)
}

/// The same of a log that is open, or of one that is read part by part.
fn inspected_in(
    job: &InspectJob,
    arguments: &InspectArguments,
    reader: Option<Reader>,
) -> Result<(Inspection, Option<Recording>), Failure> {
    let (mut inspection, warnings, kept) = match reader {
        Some(reader) => whole(reader, job, arguments.html.is_some())?,
        None => {
            let (inspection, warnings) = in_parts(job)?;
            (inspection, warnings, None)
        }
    };
    inspection.findings.splice(0..0, warnings.into_iter().map(Finding::reading));
    inspection.command = job.command(arguments, &inspection);
    Ok((inspection, kept))
}

/// The inspection of a log that is read whole, what the reader should know of how it was read, and what was read, if it
/// is wanted.
fn whole(
    reader: Reader,
    job: &InspectJob,
    keeps: bool,
) -> Result<(Inspection, Vec<String>, Option<Recording>), Failure> {
    let mut chosen = Chosen::default();
    let Recorded { recording, source, lines, mut warnings } =
        log::record(reader, &job.path, &job.log, |reader| {
            chosen = Chosen::new(job, reader)?;
            Ok(chosen.columns.clone())
        })?;
    warnings.append(&mut chosen.warnings);
    let kept = keeps.then(|| recording.clone());
    let mut plan = chosen.plan(job);
    // Topics are on one clock already.
    if source.resampled.is_some() {
        plan.resample = None;
    }
    let inspected = thetahat::inspect::inspect(recording, &source, &plan);
    let mut inspection = inspected.map_err(log::at_line(&source.file, &lines))?;
    if source.resampled.is_some() {
        inspection.log.resampled = source.resampled;
    }
    Ok((inspection, warnings, kept))
}

/// The inspection of a log that is read part by part, and what the reader should know of how it was read.
fn in_parts(job: &InspectJob) -> Result<(Inspection, Vec<String>), Failure> {
    let file = job.path.display().to_string();
    let failed = |error| Failure::about(&error, |_| file.clone());
    let mut inspection: Option<(PiecewiseInspection, Source)> = None;
    let mut left_out = Vec::new();
    let choose = |reader: &Reader| {
        let mut chosen = Chosen::new(job, reader)?;
        left_out.append(&mut chosen.warnings);
        Ok((chosen.columns.clone(), 0, chosen.plan(job)))
    };
    let mut warnings = log::in_parts(&job.path, &job.log, choose, &mut |plan, mut part| {
        let taken = part.taken();
        let (sums, source) = match &mut inspection {
            Some(begun) => begun,
            none => {
                let sums = PiecewiseInspection::new(plan.clone()).map_err(failed)?;
                none.insert((sums, Source { file: file.clone(), ..part.source.clone() }))
            }
        };
        source.rows = part.source.rows;
        sums.add(taken).map_err(|error| part.failure(&error))
    })?;
    warnings.append(&mut left_out);
    let (sums, source) =
        inspection.ok_or_else(|| Failure::data(format!("{file}: there is no row; record at least one")))?;
    Ok((sums.finish(&source).map_err(failed)?, warnings))
}

/// This many columns that are left out for one reason are named.
const MOST_TOLD: usize = 3;

/// Which columns are inspected, and what they are.
#[derive(Debug, Default)]
struct Chosen {
    columns: Vec<String>,
    inputs: Vec<String>,
    output: Option<String>,
    /// What was left out, in plain words.
    warnings: Vec<String>,
}

impl Chosen {
    /// The named columns; without names all that hold numbers. Their roles are those that a fit would give them.
    fn new(job: &InspectJob, reader: &Reader) -> Result<Self, Failure> {
        let mut chosen = Self::default();
        if reader.topics().is_some() && !job.is_named() {
            let file = job.path.display();
            return Err(Failure::data(format!(
                "{file}: of topics with clocks of their own the columns that are named are inspected (--input, --output)"
            )));
        }
        let readable = chosen.readable(job, reader);
        let usual = |name: &str| readable.iter().find(|other| *other == name).cloned();
        chosen.output = job.output.clone().or_else(|| usual("y"));
        chosen.inputs = job.inputs.clone().unwrap_or_else(|| usual_inputs(&readable));
        // Whoever names an input y means it.
        if job.output.is_none() {
            chosen.output.take_if(|output| chosen.inputs.contains(output));
        }
        if job.inputs.is_none() {
            chosen.inputs.retain(|input| chosen.output.as_ref() != Some(input));
        }
        chosen.columns = if job.is_named() {
            chosen.warnings.clear();
            chosen.inputs.iter().chain(&chosen.output).cloned().collect()
        } else {
            readable
        };
        if chosen.columns.is_empty() {
            let (file, names) = (job.path.display(), log::listed(reader.names()));
            return Err(Failure::data(format!("{file}: no column holds numbers; there are: {names}")));
        }
        Ok(chosen)
    }

    fn plan(&self, job: &InspectJob) -> InspectionPlan {
        let resample = job.log.clock.resample();
        InspectionPlan { inputs: self.inputs.clone(), output: self.output.clone(), resample }
    }

    /// The columns but the clock that can be read; says which cannot.
    fn readable(&mut self, job: &InspectJob, reader: &Reader) -> Vec<String> {
        const REASONS: [&str; 3] = [
            "its name is not UTF-8; name the file's encoding (--encoding)",
            "another one has the same name; rename one of them",
            "it holds no numbers",
        ];
        let names = reader.names();
        let clocks = log::clocks(reader, &job.log);
        let nameless: HashSet<usize> = reader.nameless().into_iter().collect();
        let mut count: HashMap<&str, usize> = HashMap::with_capacity(names.len());
        names.iter().for_each(|name| *count.entry(name).or_default() += 1);
        let mut readable: Vec<String> = Vec::new();
        let mut left_out = [const { Vec::new() }; REASONS.len()];
        for ((column, name), holds_words) in names.iter().enumerate().zip(reader.words()) {
            let reason = match (nameless.contains(&column), count[name.as_str()]) {
                _ if clocks.contains(&column) => continue,
                (true, _) => 0,
                // A name that stands twice cannot be read at all.
                (_, 2..) => 1,
                _ if holds_words => 2,
                _ => {
                    readable.push(name.clone());
                    continue;
                }
            };
            left_out[reason].push(column);
        }
        for (columns, reason) in left_out.iter().zip(REASONS) {
            for &column in columns.iter().take(MOST_TOLD) {
                let name = text::brief(&names[column], 40);
                self.warnings.push(format!("column {} ('{name}') is left out: {reason}", column + 1));
            }
            if columns.len() > MOST_TOLD {
                let more = columns.len() - MOST_TOLD;
                self.warnings.push(format!("{more} more columns are left out for the same reason: {reason}"));
            }
        }
        readable
    }
}
