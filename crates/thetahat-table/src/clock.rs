//! Which columns are clocks, and how their times are written: what the names, the units and the first rows show.

use jiff::Timestamp;

use super::time::{self, Unit, Written};
use super::{Options, names_of_times};

/// The instants of logs: from 2000 to 2100, in seconds since 1970.
const LOGGED: [f64; 2] = [9.4e8, 4.1e9];
/// The same in days of a spreadsheet, which counts from the end of 1899.
const SHEETS: [f64; 2] = [36_526.0, 73_050.0];
/// Nanoseconds from the day from which spreadsheets count to 1970.
pub(super) const SHEET_DAYS: i128 = 25_569 * 86_400 * 1_000_000_000;
/// A step of a clock without a unit that is longer, or shorter, may have another unit: in seconds.
const LONGEST_STEP: f64 = 1000.0;
const SHORTEST_STEP: f64 = 5e-5;
/// A clock may go back in this share of the rows, or once.
const BACK: f64 = 0.05;

/// The first values of a column, as far as they may be times.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Sample {
    /// All of its values that are there, if they are numbers.
    pub(super) numbers: Vec<f64>,
    /// The same, if they are dates or times of day.
    pub(super) dates: Vec<String>,
}

/// How the times of a column are written, and what the reader should know of that.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Recognised {
    pub(super) written: Written,
    pub(super) told: Option<String>,
}

/// The formats of dates that are tried, in the manner of strptime. Where two fit, both are told.
const DATES: [&str; 9] = [
    "%d.%m.%Y", "%d.%m.%y", "%Y/%m/%d", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y", "%Y.%m.%d", "%d-%b-%Y", "%Y%m%d",
];
const TIMES: [&str; 4] = ["%H:%M:%S%.f", "%H:%M", "%I:%M:%S %p", "%I:%M %p"];

/// Whether a column is a clock, by its name and its first values. `first` is whether it is the first of several.
pub(super) fn is_clock(name: &str, unit: Option<&str>, sample: &Sample, first: bool) -> bool {
    let Sample { numbers, dates } = sample;
    if !dates.is_empty() {
        let durations =
            || dates.iter().map(|date| time::duration(date.as_bytes())).collect::<Option<Vec<f64>>>();
        let seconds = seconds(dates).or_else(durations).unwrap_or_default();
        return numbers.is_empty() && (dates.len() == 1 || rises(&seconds));
    }
    let unnamed = first && (name.is_empty() || name.starts_with("Unnamed"));
    let named = names_of_times::of(name, unit).is_some();
    // A table without a name for its index has the numbers of its rows there.
    let counts = numbers.iter().enumerate().all(|(row, value)| *value == row as f64 + numbers[0]);
    (named || unnamed && !counts && numbers.len() > 1) && rises(numbers)
}

/// Whether a column may be meant as a clock: it is called as times are, or holds dates that change.
pub(super) fn is_called_clock(name: &str, unit: Option<&str>, sample: &Sample) -> bool {
    let Sample { numbers, dates } = sample;
    let changes =
        dates.windows(2).any(|pair| pair[0] != pair[1]) || numbers.windows(2).any(|pair| pair[0] != pair[1]);
    changes && (names_of_times::of(name, unit).is_some() || numbers.is_empty())
}

/// Whether all dates are days, without a time.
pub(super) fn are_days(sample: &Sample) -> bool {
    let Sample { numbers, dates } = sample;
    numbers.is_empty() && !dates.is_empty() && dates.iter().all(|date| !date.contains(':'))
}

/// Whether all dates are times of day, without the day.
pub(super) fn are_times_of_day(sample: &Sample) -> bool {
    let Sample { numbers, dates } = sample;
    let is_time =
        |date: &String| TIMES.iter().any(|format| time::instant(date.as_bytes(), Some(format)).is_ok());
    numbers.is_empty() && !dates.is_empty() && dates.iter().all(is_time)
}

/// Whether values rise but for a few, as those of a clock do.
fn rises(values: &[f64]) -> bool {
    let back = values.windows(2).filter(|pair| pair[1] < pair[0]).count();
    let on = values.windows(2).filter(|pair| pair[1] > pair[0]).count();
    let few = back as f64 <= (BACK * values.len() as f64).max(1.0);
    !values.is_empty() && few && (on > 0 || values.len() == 1)
}

/// Dates as seconds since 1970, in the first format that all of them have.
fn seconds(dates: &[String]) -> Option<Vec<f64>> {
    let format = formats(dates).into_iter().next()?;
    Some(read(dates, format.as_deref()))
}

fn read(dates: &[String], format: Option<&str>) -> Vec<f64> {
    let instant = |date: &String| {
        time::instant(date.as_bytes(), format).map_or(f64::NAN, |time| nanoseconds(time) / 1e9)
    };
    dates.iter().map(instant).collect()
}

fn nanoseconds(time: Timestamp) -> f64 {
    time.as_nanosecond() as f64
}

/// The formats in which all of some dates can be read: none for ISO 8601, which is the only one then.
fn formats(dates: &[String]) -> Vec<Option<String>> {
    // A year of two digits is none of the first century.
    let known = |time: Timestamp| nanoseconds(time) > -2.2e18;
    let reads = |format: Option<&str>| {
        dates.iter().all(|date| time::instant(date.as_bytes(), format).is_ok_and(known))
    };
    if reads(None) {
        return vec![None];
    }
    let dated = DATES.iter().flat_map(|date| {
        let both = TIMES.iter().map(move |time| format!("{date} {time}"));
        std::iter::once((*date).to_owned()).chain(both)
    });
    let all = TIMES.iter().map(|time| (*time).to_owned()).chain(dated);
    all.filter(|format| reads(Some(format))).map(Some).collect()
}

/// How the times of a column are written. None where there is nothing that shows it.
///
/// # Errors
/// A message for dates that can be read in two ways.
pub(super) fn recognise(
    name: &str,
    unit: Option<&str>,
    sample: &Sample,
    options: &Options,
) -> Result<Option<Recognised>, String> {
    let plain = |written| Ok(Some(Recognised { written, told: None }));
    if let Some(format) = &options.time_format {
        return plain(Written::Dates(Some(format.clone())));
    }
    if !sample.dates.is_empty() && sample.numbers.is_empty() {
        return dates(&sample.dates);
    }
    if sample.numbers.is_empty() {
        return Ok(None);
    }
    Ok(Some(of_numbers(name, unit, &sample.numbers, options.time_unit)))
}

fn dates(dates: &[String]) -> Result<Option<Recognised>, String> {
    let found = formats(dates);
    let rising: Vec<&Option<String>> =
        found.iter().filter(|format| rises(&read(dates, format.as_deref()))).collect();
    // Where not one of them rises, the order of the rows says nothing.
    let fitting = if rising.is_empty() { found.iter().collect() } else { rising };
    let first = dates.first().map_or("", String::as_str);
    let read_in = |format: &Option<String>, told| {
        Ok(Some(Recognised { written: Written::Dates(format.clone()), told }))
    };
    match fitting.as_slice() {
        [] => {
            // More hours than a day has, or more minutes than an hour.
            let are_durations = dates.iter().all(|date| time::duration(date.as_bytes()).is_some());
            Ok(are_durations.then_some(Recognised { written: Written::Durations, told: None }))
        }
        [only] => {
            let is_short = only.as_deref() == Some("%H:%M");
            let told = is_short.then(|| {
                format!(
                    "times such as {first} are read as hours and minutes; give them with seconds if they are minutes and seconds"
                )
            });
            read_in(only, told)
        }
        [one, other, ..] => {
            let [a, b] = [one, other].map(|format| format.as_deref().unwrap_or_default());
            if same_steps(dates, one, other) {
                let told =
                    format!("dates such as {first} are read as `time-format` '{a}'; '{b}' fits them too");
                return read_in(one, Some(told));
            }
            Err(format!(
                "dates such as {first} can be read in two ways; say which: `time-format` '{a}' or '{b}'"
            ))
        }
    }
}

/// Whether dates are as far apart in one format as in another.
fn same_steps(dates: &[String], one: &Option<String>, other: &Option<String>) -> bool {
    let [one, other] = [one, other].map(|format| read(dates, format.as_deref()));
    one.iter().zip(&other).all(|(a, b)| a - one[0] == b - other[0])
}

/// How numbers count time: in the unit that was given, or that the name has, or that only goes with their size.
pub(super) fn of_numbers(name: &str, unit: Option<&str>, numbers: &[f64], given: Option<Unit>) -> Recognised {
    let named = given.or_else(|| names_of_times::of(name, unit).flatten());
    let [low, high] = [f64::min, f64::max].map(|of| numbers.iter().copied().fold(numbers[0], of));
    let mut steps: Vec<f64> =
        numbers.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
    steps.sort_by(f64::total_cmp);
    let step = steps.get(steps.len() / 2).copied();
    let since_1970 = |unit: &Unit| {
        let scale = 1e9 / unit.nanoseconds() as f64;
        LOGGED[0] * scale <= low && high <= LOGGED[1] * scale
    };
    let plain = |written| Recognised { written, told: None };
    match named {
        Some(Unit::Days) if is_sheet(low, high) => return plain(Written::Since(Unit::Days, -SHEET_DAYS)),
        Some(unit) if since_1970(&unit) => return plain(Written::Since(unit, 0)),
        Some(unit) => return plain(Written::Numbers(unit)),
        None => {}
    }
    if let Some(unit) = Unit::EPOCHS.into_iter().find(since_1970) {
        let lasts = step.unwrap_or_default() * unit.nanoseconds() as f64 / 1e9;
        // Steps of a calendar are whole minutes; others are shorter.
        if lasts < 100.0 || lasts % 60.0 == 0.0 {
            return plain(Written::Since(unit, 0));
        }
    }
    let Some(step) = step else { return plain(Written::Numbers(Unit::Seconds)) };
    // Steps of a spreadsheet's days are whole seconds, or tenths of them, and hardly ever a short number of days: a
    // clock of seconds that has run for half a day has such steps.
    let tenths = step * 864_000.0;
    let is_short = (super::error::rounded(step) / step - 1.0).abs() < 1e-6;
    let dated = name.to_lowercase().starts_with("dat");
    if is_sheet(low, high)
        && 5e-7 < step
        && step < 1.0
        && (tenths - tenths.round()).abs() < 0.02
        && (dated || !is_short)
    {
        return Recognised {
            written: Written::Since(Unit::Days, -SHEET_DAYS),
            told: (!dated).then(|| {
                "its numbers are read as a spreadsheet's days; `time-unit` s reads seconds".to_owned()
            }),
        };
    }
    let other = match step {
        step if step > 1e6 => Some(Unit::Nanoseconds),
        step if step > 1e4 => Some(Unit::Microseconds),
        step if step > LONGEST_STEP => Some(Unit::Milliseconds),
        step if step < SHORTEST_STEP => Some(Unit::Days),
        _ => None,
    };
    let told = other.map(|other| {
        format!(
            "its times are read as seconds, so that a step is {} s; `time-unit` {} reads {}",
            super::error::figure(step),
            other.symbol(),
            other.name()
        )
    });
    Recognised { written: Written::Numbers(Unit::Seconds), told }
}

fn is_sheet(low: f64, high: f64) -> bool {
    SHEETS[0] <= low && high <= SHEETS[1]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(name: &str, first: f64, step: f64) -> Recognised {
        let numbers: Vec<f64> = (0..50).map(|row| first + f64::from(row) * step).collect();
        of_numbers(name, None, &numbers, None)
    }

    #[test]
    fn numbers_are_read_in_the_unit_that_they_can_only_have() {
        let days = Written::Since(Unit::Days, -SHEET_DAYS);
        for (name, first, step, expected, is_told) in [
            ("t", 0.0, 0.01, Written::Numbers(Unit::Seconds), false),
            ("t", 40_000.0, 0.01, Written::Numbers(Unit::Seconds), false),
            ("t", 40_000.0, 1.0, Written::Numbers(Unit::Seconds), false),
            ("t", 45_301.0, 10.0 / 86_400.0, days.clone(), true),
            ("Date", 45_301.0, 10.0 / 86_400.0, days.clone(), false),
            ("Date", 45_301.0, 0.25, days, false),
            ("t", 1.7e9, 0.5, Written::Since(Unit::Seconds, 0), false),
            ("t", 1.7e12, 20.0, Written::Since(Unit::Milliseconds, 0), false),
            ("t", 1.7e15, 20_000.0, Written::Since(Unit::Microseconds, 0), false),
            ("t", 1.7e18, 2e7, Written::Since(Unit::Nanoseconds, 0), false),
            // Microseconds since a processor was switched on.
            ("t", 1.2e9, 10_000.0, Written::Numbers(Unit::Seconds), true),
            ("t_us", 1.2e9, 10_000.0, Written::Numbers(Unit::Microseconds), false),
            ("t [h]", 0.0, 1e-5, Written::Numbers(Unit::Hours), false),
            ("t", 0.0, 1e-5, Written::Numbers(Unit::Seconds), true),
        ] {
            let found = written(name, first, step);
            assert_eq!((found.written, found.told.is_some()), (expected, is_told), "{name} {first} {step}");
        }
    }

    #[test]
    fn dates_are_read_in_the_format_that_all_have() {
        let found = |dates: &[&str]| {
            let dates: Vec<String> = dates.iter().map(|date| (*date).to_owned()).collect();
            super::dates(&dates)
        };
        for (dates, format) in [
            (["27.10.2024 00:30:00", "27.10.2024 00:30:10.5"], "%d.%m.%Y %H:%M:%S%.f"),
            (["27.10.24 00:30", "27.10.24 00:31"], "%d.%m.%y %H:%M"),
            (["01/13/2024 10:00", "01/13/2024 10:01"], "%m/%d/%Y %H:%M"),
            (["13/01/2024 10:00", "13/01/2024 10:01"], "%d/%m/%Y %H:%M"),
            (["2024/01/13", "2024/01/14"], "%Y/%m/%d"),
            (["10:00:00", "10:00:01"], "%H:%M:%S%.f"),
        ] {
            let written = found(&dates).unwrap().unwrap().written;
            assert_eq!(written, Written::Dates(Some(format.to_owned())), "{dates:?}");
        }
        assert_eq!(
            found(&["2024-01-10", "2024-01-11T10:00Z"]).unwrap().unwrap().written,
            Written::Dates(None)
        );
        assert_eq!(found(&["23:59:59", "24:00:00"]).unwrap().unwrap().written, Written::Durations);
        assert_eq!(found(&["1-2-3", "x"]), Ok(None));
        // Of several days nobody knows; in one it does not matter.
        let error = found(&["03/04/2024 10:00", "04/04/2024 10:00"]).unwrap_err();
        assert!(error.contains("`time-format` '%d/%m/%Y %H:%M' or '%m/%d/%Y %H:%M'"), "{error}");
        assert!(found(&["03/04/2024 10:00", "03/04/2024 10:01"]).unwrap().unwrap().told.is_some());
    }
}
