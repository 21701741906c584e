//! How names are written in charts.

use crate::text::harmless;

/// A name in a chart is no wider than this many characters, and less beside an axis.
const LONGEST: [usize; 2] = [40, 15];

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
