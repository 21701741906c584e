//! Names that columns of times have, and the units in them.

use super::time::Unit;

/// What columns of times are called, in lower case and without the unit.
const NAMES: [&str; 34] = [
    "t",
    "time",
    "times",
    "timestamp",
    "time stamp",
    "time_stamp",
    "timestamps",
    "ts",
    "datetime",
    "date time",
    "date_time",
    "date/time",
    "date",
    "datum",
    "zeit",
    "zeitstempel",
    "uhrzeit",
    "temps",
    "tiempo",
    "tempo",
    "epoch",
    "unixtime",
    "unix time",
    "unix_time",
    "elapsed",
    "elapsed time",
    "elapsed_time",
    "rel time",
    "reltime",
    "sim time",
    "simtime",
    "local time",
    "utc",
    "x_value",
];
/// The same where the name is a unit.
const UNITS_AS_NAMES: [&str; 10] = [
    "seconds",
    "sec",
    "secs",
    "millis",
    "milliseconds",
    "micros",
    "microseconds",
    "minutes",
    "hours",
    "nanoseconds",
];

/// Whether a column is called as times are, and in which unit its name, or the line of units, says that they count.
///
/// ```text
/// t [ms] · Time (s) · TimeUS · time_ns · _time · %time · t/min
/// ```
pub(super) fn of(name: &str, unit: Option<&str>) -> Option<Option<Unit>> {
    let name = name.trim().trim_start_matches(['%', '#', '_', '/']).trim();
    // A temperature is T.
    if name == "T" {
        return None;
    }
    let lower = name.to_lowercase();
    if UNITS_AS_NAMES.contains(&lower.as_str()) {
        return Some(Unit::of(&lower));
    }
    if NAMES.contains(&lower.as_str()) {
        return Some(unit.and_then(|unit| Unit::of(&bare(unit))));
    }
    // A unit after the name.
    let ends = |from: usize| {
        let (base, unit) = (lower.get(..from)?, lower.get(from..)?);
        let base = base.trim_end_matches([' ', '_', '/', ',', '-', '.', '(', '[', '<']);
        let unit = Unit::of(&bare(unit))?;
        NAMES.contains(&base).then_some(unit)
    };
    (1..lower.len()).find_map(ends).map(Some)
}

/// A unit without what surrounds it.
fn bare(unit: &str) -> String {
    let signs = [' ', '_', '/', ',', '-', '.', '(', ')', '[', ']', '<', '>'];
    unit.trim_matches(signs).replace("in ", "").to_lowercase()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_say_whether_they_are_times_and_in_which_unit() {
        for (name, expected) in [
            ("t", Some(None)),
            ("Time", Some(None)),
            ("_time", Some(None)),
            ("%time", Some(None)),
            ("Datetime", Some(None)),
            ("Time (s)", Some(Some(Unit::Seconds))),
            ("t [ms]", Some(Some(Unit::Milliseconds))),
            ("TimeUS", Some(Some(Unit::Microseconds))),
            ("time_ns", Some(Some(Unit::Nanoseconds))),
            ("timestamp_us", Some(Some(Unit::Microseconds))),
            ("t/min", Some(Some(Unit::Minutes))),
            ("Time, h", Some(Some(Unit::Hours))),
            ("Time in hours", Some(Some(Unit::Hours))),
            ("millis", Some(Some(Unit::Milliseconds))),
            ("T", None),
            ("T out", None),
            ("ton", None),
            ("ts", Some(None)),
            ("temp", None),
            ("response time", None),
            ("times two", None),
            ("u", None),
            ("", None),
            ("µ", None),
        ] {
            assert_eq!(of(name, None), expected, "{name}");
        }
        assert_eq!(of("t", Some("[ms]")), Some(Some(Unit::Milliseconds)));
        assert_eq!(of("t", Some("min")), Some(Some(Unit::Minutes)));
        assert_eq!(of("t", Some("V")), Some(None));
    }
}
