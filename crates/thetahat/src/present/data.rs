//! Where documents come from: their logs and what was done to them.

use crate::data::{Rows, Source};
use crate::figures::{seconds, short};
use crate::report::Report;

use super::tree::{Table, columns, known, word};
use super::words::{quantity, some};

/// This many segments of rows are shown.
const MOST: usize = 20;

/// The files of a title.
pub(super) fn of(logs: &[Source]) -> String {
    match logs {
        [] => String::new(),
        [log] => format!(": {}", log.file),
        [log, rest @ ..] => format!(": {} and {} more", log.file, rest.len()),
    }
}

pub(super) fn logs(sources: &[Source]) -> Table {
    let mut table =
        columns("Logs", ["file", "rows", "time column", "start", "resampled"]).words(&[1, 2, 3, 4]);
    for source in sources {
        let resampled = source.resampled.as_ref().map(|resampling| {
            let filter = resampling.anti_alias.map_or_else(String::new, |filter| {
                format!(", low-pass filtered at {} Hz", short(filter.cutoff))
            });
            format!("to {} s, from {} rows{filter}", short(resampling.step), resampling.rows)
        });
        table.row([
            word(&source.file),
            word(source.rows),
            known(source.time.clone(), |name| name),
            known(source.start.clone(), |start| start),
            word(resampled.unwrap_or_else(|| "no".to_owned())),
        ]);
    }
    table
}

pub(super) fn data(report: &Report) -> Table {
    let data = &report.data;
    let mut table = columns("Data", ["figure", "value"]).words(&[1]);
    let mut add = |name: &str, value: String| table.row([word(name), word(value)]);
    let parts = |parts: &[Rows]| if parts.is_empty() { "none".to_owned() } else { some(parts, MOST, ", ") };
    add("rows", data.rows.to_string());
    add("sample time", seconds(data.sample_time));
    add("detrend", data.detrend.clone());
    if let Some(band) = data.prefilter {
        add("fitted in the band", format!("{band} Hz"));
    }
    if let Some(level) = report.estimation.level {
        add("level of the output", quantity(level));
    }
    if let Some(slope) = report.estimation.slope {
        add("slope of the output, a second", quantity(slope));
    }
    add("estimation rows", parts(&data.estimation));
    add("validation rows", parts(&data.validation));
    if let Some(split) = &data.split {
        add("split: estimation", parts(&split.estimation));
        add("split: validation", parts(&split.validation));
        add("split: test", parts(&split.test));
    }
    add("segments without a gap", some(&data.segments, MOST, ", "));
    add("gaps in the clock", data.time_gaps.to_string());
    for missing in &data.missing {
        add(&format!("missing in {}", missing.channel), missing.rows.to_string());
    }
    table
}
