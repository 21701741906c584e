//! How numbers and names are written.

use crate::data::Rows;
use crate::figures::{number, spoken_time, three};
use crate::model::{Interval, Quantity};
use crate::text::harmless;

/// What stands where there is no figure.
pub(super) const NONE: &str = "–";
/// A name in a chart is no wider than this many characters, and less beside an axis.
const LONGEST: [usize; 2] = [40, 15];

/// Percent of a whole, to three digits.
pub(super) fn percent(fraction: f64) -> String {
    let text = three(100.0 * fraction);
    let plain = text.contains('.') && !text.contains('e');
    format!("{} %", if plain { text.trim_end_matches('0').trim_end_matches('.') } else { &text })
}

pub(super) fn or_dash<T>(value: Option<T>, shown: impl FnOnce(T) -> String) -> String {
    value.map_or_else(|| NONE.to_owned(), shown)
}

/// A figure and its interval, or its standard error where there is none.
pub(super) fn quantity(quantity: Quantity) -> String {
    if let Some(interval) = quantity.interval {
        if interval == Interval::OPEN {
            return "not determined by this log".to_owned();
        }
        return format!("{}, 95 %: {}", number(quantity.value), interval.shown(number));
    }
    let error = quantity.standard_error.map_or_else(String::new, |error| format!(" ± {}", three(error)));
    format!("{}{error}", number(quantity.value))
}

/// A time constant in seconds: as [`quantity`], and as people say such a time.
pub(super) fn time_constant(time: Quantity) -> String {
    let spoken = spoken_time(time.value).map_or_else(String::new, |spoken| format!(" ({spoken})"));
    format!("{}{spoken}", quantity(time))
}

pub(super) fn rows(rows: &[Rows]) -> String {
    let shown: Vec<String> = rows.iter().take(20).map(Rows::to_string).collect();
    let rest = rows.len() - shown.len();
    let more = if rest > 0 { format!(" and {rest} more") } else { String::new() };
    format!("{}{more}", shown.join(", "))
}

/// A name as charts show it: their library reads a subset of HTML, of which nothing may be left.
pub(super) fn plain(name: &str) -> String {
    cut(name, LONGEST[0])
}

/// The same where there is little room.
pub(super) fn brief(name: &str) -> String {
    cut(name, LONGEST[1])
}

fn cut(name: &str, longest: usize) -> String {
    let mut shown: String = name.chars().take(longest).collect();
    if shown.len() < name.len() {
        shown.push('…');
    }
    harmless(&shown).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// JSON that may stand inside a script element.
pub(super) fn inside_script(json: &str) -> String {
    let mut safe = String::with_capacity(json.len());
    for character in json.chars() {
        match character {
            '<' | '>' | '&' | '\u{2028}' | '\u{2029}' => {
                safe.push_str(&format!("\\u{:04x}", u32::from(character)));
            }
            other => safe.push(other),
        }
    }
    safe
}

#[cfg(test)]
mod tests;
