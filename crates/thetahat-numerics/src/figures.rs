//! How numbers are written for people: in tables, on pages and in sentences. All are written here, so that none is
//! wider than [`WIDEST`], and none is `NaN` or `inf`.

/// No number takes more characters.
pub const WIDEST: usize = 12;

/// What stands for a number that is none, or too large to be one.
const UNKNOWN: &str = "unknown";

/// A number to six significant digits, as tables and pages write it.
///
/// ```
/// use thetahat_numerics::figures::number;
///
/// assert_eq!(number(18.9182446), "18.9182");
/// assert_eq!(number(-2.5e-7), "-2.50000e-7");
/// assert_eq!(number(f64::NAN), "unknown");
/// ```
pub fn number(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 {
        return "0".to_owned();
    }
    if !(1e-4..1e6).contains(&size) {
        return scientific(value, 5);
    }
    let decimals = (5 - size.log10().floor() as i32).clamp(0, 9) as usize;
    format!("{value:.decimals$}")
}

/// [`number`] without zeros at its end.
///
/// ```
/// use thetahat_numerics::figures::short;
///
/// assert_eq!([short(0.0800000001), short(2.5e-7), short(1e9)], ["0.08", "2.5e-7", "1e9"]);
/// ```
pub fn short(value: f64) -> String {
    let text = number(value);
    let (mantissa, exponent) = text.split_at(text.find('e').unwrap_or(text.len()));
    if mantissa.contains('.') {
        return format!("{}{exponent}", mantissa.trim_end_matches('0').trim_end_matches('.'));
    }
    text
}

/// A number with this many decimals; as [`number`] where that is too wide.
///
/// ```
/// use thetahat_numerics::figures::fixed;
///
/// assert_eq!([fixed(98.0602, 3), fixed(-1e160, 3)], ["98.060", "-1.00000e160"]);
/// ```
pub fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    if value.is_finite() && text.len() <= WIDEST { text } else { number(value) }
}

/// A number in powers of ten with this many decimals, or as many of them as there is room for.
///
/// ```
/// use thetahat_numerics::figures::scientific;
///
/// assert_eq!([scientific(0.012345, 2), scientific(-1e-300, 5)], ["1.23e-2", "-1.0000e-300"]);
/// ```
pub fn scientific(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return UNKNOWN.to_owned();
    }
    let text = format!("{value:.decimals$e}");
    match text.len().saturating_sub(WIDEST) {
        0 => text,
        wide => format!("{value:.*e}", decimals.saturating_sub(wide)),
    }
}

/// A standard error: three digits.
///
/// ```
/// assert_eq!(thetahat_numerics::figures::error(0.0110412), "1.10e-2");
/// ```
pub fn error(value: f64) -> String {
    scientific(value, 2)
}

/// Three digits: a ratio, or a probability.
///
/// ```
/// use thetahat_numerics::figures::three;
///
/// assert_eq!([three(0.0), three(0.012_34), three(1.0), three(1e-9)], ["0", "0.0123", "1.00", "1.00e-9"]);
/// ```
pub fn three(value: f64) -> String {
    if (1e-3..1e3).contains(&value.abs()) {
        let decimals = (2 - value.abs().log10().floor() as i32).clamp(0, 5) as usize;
        return format!("{value:.decimals$}");
    }
    if value == 0.0 { "0".to_owned() } else { scientific(value, 2) }
}

/// A p-value, or another probability that may be small.
///
/// ```
/// use thetahat_numerics::figures::chance;
///
/// assert_eq!([chance(0.593_91), chance(8.5e-7), chance(0.0)], ["0.5939", "8.5e-7", "<1e-300"]);
/// ```
pub fn chance(probability: f64) -> String {
    match probability {
        0.0 => "<1e-300".to_owned(),
        1e-4.. => fixed(probability, 4),
        small => scientific(small, 1),
    }
}

/// A time as people say it where they do not count seconds: below a thousandth of one, and from a minute and a half on.
///
/// ```
/// use thetahat_numerics::figures::spoken_time;
///
/// assert_eq!(spoken_time(5421.0).as_deref(), Some("1.51 h"));
/// assert_eq!(spoken_time(0.00025).as_deref(), Some("0.25 ms"));
/// assert_eq!(spoken_time(30.0), None);
/// ```
pub fn spoken_time(seconds: f64) -> Option<String> {
    let size = seconds.abs();
    if size == 0.0 || !size.is_finite() {
        return None;
    }
    // Each unit with where it begins.
    const UNITS: [(f64, f64, &str); 6] = [
        (1.728e5, 8.64e4, "d"),
        (5400.0, 3600.0, "h"),
        (90.0, 60.0, "min"),
        (1e-3, 1.0, ""),
        (1e-4, 1e-3, "ms"),
        (1e-7, 1e-6, "µs"),
    ];
    let (_, unit, name) = *UNITS.iter().find(|(begins, ..)| size >= *begins).unwrap_or(&(0.0, 1e-9, "ns"));
    let value = three(seconds / unit);
    let value = if value.contains('.') && !value.contains('e') {
        value.trim_end_matches('0').trim_end_matches('.')
    } else {
        &value
    };
    (!name.is_empty()).then(|| format!("{value} {name}"))
}

/// A figure in a column that has its unit beside it, to six digits; of seconds with [`spoken_time`] too.
///
/// ```
/// use thetahat_numerics::figures::of_unit;
///
/// assert_eq!([of_unit(5400.0, "s"), of_unit(5400.0, "rad/s")], ["5400.00 (1.5 h)", "5400.00"]);
/// ```
pub fn of_unit(value: f64, unit: &str) -> String {
    if unit == "s" { with_spoken(number(value), value) } else { number(value) }
}

/// A unit in a column of units; of seconds with [`spoken_time`] too.
///
/// ```
/// use thetahat_numerics::figures::unit_of;
///
/// assert_eq!([unit_of(136.0, "s"), unit_of(136.0, "y/u")], ["s (2.27 min)", "y/u"]);
/// ```
pub fn unit_of(value: f64, unit: &str) -> String {
    if unit == "s" { with_spoken(unit.to_owned(), value) } else { unit.to_owned() }
}

/// A time in a sentence.
///
/// ```
/// use thetahat_numerics::figures::seconds;
///
/// assert_eq!([seconds(90.0), seconds(2.5)], ["90 s (1.5 min)", "2.5 s"]);
/// ```
pub fn seconds(seconds: f64) -> String {
    with_spoken(format!("{} s", short(seconds)), seconds)
}

fn with_spoken(written: String, seconds: f64) -> String {
    spoken_time(seconds).map_or_else(|| written.clone(), |spoken| format!("{written} ({spoken})"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_number_is_wider_than_twelve_characters_or_not_a_number() {
        let sizes =
            [0.0, 5e-324, 1e-300, 1.234_567_89e-5, 0.1, 1.0 / 3.0, 99.999_999, 999_999.7, 1e160, 1e307];
        let odd = [f64::NAN, f64::INFINITY];
        let values = sizes.iter().chain(&odd).flat_map(|size| [*size, -size]);
        for value in values {
            let mut written = vec![number(value), short(value), error(value), three(value)];
            written.extend((0..9).flat_map(|decimals| [fixed(value, decimals), scientific(value, decimals)]));
            for text in written {
                assert!(text.len() <= WIDEST, "{value:e}: {text}");
                let read = text.parse::<f64>();
                // Adding a half: what has no decimals is rounded.
                let close = |read: f64| (read - value).abs() <= 0.5 + 0.5 * value.abs();
                assert!(
                    value.is_finite() && read.clone().is_ok_and(close) || text == UNKNOWN,
                    "{value:e}: {text}"
                );
            }
        }
    }
}
