//! Logs of topics, each with a clock of its own: which clock a selection has, and how several become one.

use std::path::Path;

use thetahat::data::{Channel, Interpolation, Log, Recording, Resample, Resampling, Times};
use thetahat::figures::short;
use thetahat::inspect::{TopicList, TopicSummary};
use thetahat::text;
use thetahat_table::{OwnClock, Reader, Table, Topic};

use crate::failure::{Failure, Kind};
use crate::job::{Clock, LogJob};
use crate::shell::quoted;

/// The document that lists the topics of a log; none of any other log.
pub(crate) fn list(reader: &Reader, path: &Path) -> Option<TopicList> {
    let topics = reader.topics()?;
    let names = reader.names();
    let summary = |topic: &Topic| TopicSummary {
        name: topic.name.clone(),
        rows: topic.rows,
        rate: (topic.rows > 1 && topic.duration > 0.0).then(|| (topic.rows - 1) as f64 / topic.duration),
        duration: topic.duration,
        columns: names[topic.columns.clone()].to_vec(),
    };
    let topics: Vec<TopicSummary> = topics.iter().map(summary).collect();
    let command = command(&topics, path);
    Some(TopicList::new(path.display().to_string(), topics, command, reader.remarks()))
}

/// What to type next, for example: a column of the topic with the most messages, and one of another topic.
fn command(topics: &[TopicSummary], path: &Path) -> Option<String> {
    let path = path.to_str()?;
    let path = if path.starts_with('-') { format!("./{path}") } else { path.to_owned() };
    let mut by_rows: Vec<&TopicSummary> = topics.iter().filter(|topic| topic.rate.is_some()).collect();
    by_rows.sort_by_key(|topic| std::cmp::Reverse(topic.rows));
    let first = by_rows.first()?;
    let output = first.columns.first()?;
    let input = by_rows.get(1).and_then(|topic| topic.columns.first()).or(first.columns.get(1));
    let input = input.map_or(String::new(), |name| format!(" -u {}", quoted(&thetahat_table::list(&[name]))));
    Some(format!("thetahat inspect {}{input} -y {}", quoted(&path), quoted(output)))
}

/// What is said where columns of a log of topics are not there: besides what is wrong, how to list those that are.
pub(super) fn explained(failure: Failure, reader: &Reader, path: &Path) -> Failure {
    match reader.topics() {
        Some(topics) if failure.kind() == Kind::Data => {
            let (all, file) = (topics.len(), quoted(&path.display().to_string()));
            Failure::data(format!(
                "{}; `thetahat inspect {file}` lists the columns of its {all} topics",
                failure.message()
            ))
        }
        _ => failure,
    }
}

/// The clock of the job, if it goes with columns of a log of topics.
pub(super) fn clock(topics: &[Topic], columns: &[usize], job: &LogJob) -> Result<Clock, String> {
    let selected = topics.iter().filter(|topic| columns.iter().any(|column| topic.columns.contains(column)));
    match &job.clock {
        Clock::Column { .. } => Err("each topic of the log has a clock of its own; leave --time out".to_owned()),
        Clock::Fixed(_) if selected.count() > 1 => Err(
            "the columns are of several topics, each with a clock of its own: rows of them do not go together by their number; \
             leave --sample-time out, or give --resample"
                .to_owned(),
        ),
        clock => Ok(clock.clone()),
    }
}

/// Puts the columns of several topics on one clock. Gives how that was done, and what a person may want to know of it.
pub(super) fn on_one_clock(
    file: &str,
    names: &[String],
    table: &mut Table,
    how: Option<Resample>,
) -> Result<(Resampling, String), Failure> {
    let clocks = std::mem::take(&mut table.clocks);
    let mut order: Vec<usize> = Vec::new();
    let mut said: Vec<String> = Vec::new();
    let mut recordings: Vec<Recording> = Vec::new();
    for OwnClock { topic, time, columns } in clocks {
        said.push(format!("{} ({} Hz)", text::brief(&topic, 40), rate(&time)));
        let channel = |&place: &usize| Channel {
            name: names.get(place).cloned().unwrap_or_default(),
            values: table.columns.get_mut(place).map(std::mem::take).unwrap_or_default(),
        };
        recordings.push(Recording {
            channels: columns.iter().map(channel).collect(),
            times: Times::Measured(time),
        });
        order.extend(columns);
    }
    let (log, resampling) = Log::on_one_clock(recordings, how.as_ref())
        .map_err(|error| Failure::about(&error, |_| file.to_owned()))?;
    table.time = log.time().map(<[f64]>::to_vec);
    table.rows = log.rows();
    for (&place, channel) in order.iter().zip(log.channels()) {
        if let Some(values) = table.columns.get_mut(place) {
            values.clone_from(&channel.values);
        }
    }
    let by = match resampling.interpolation {
        Interpolation::Auto => "channels that move in steps by hold, the others by straight lines",
        Interpolation::Hold => "by hold",
        Interpolation::Linear => "by straight lines",
    };
    let otherwise = if how.is_some() { "" } else { "; --resample says otherwise" };
    let note = format!(
        "{file}: the columns are of {} topics with clocks of their own, {}: they are put on one, every {} s, {by}{otherwise}",
        said.len(),
        said.join(", "),
        resampling.step
    );
    Ok((resampling, note))
}

/// How many rows there are in a second, as a message says it.
fn rate(time: &[f64]) -> String {
    let duration = time.last().zip(time.first()).map_or(0.0, |(last, first)| last - first);
    let hertz = if duration > 0.0 { (time.len() - 1) as f64 / duration } else { 0.0 };
    // Three digits tell rates apart.
    short(format!("{hertz:.2e}").parse().unwrap_or(hertz))
}
