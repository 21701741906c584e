//! How text that comes from files is shown: names, and messages about what is wrong with a file.
//!
//! A name may hold anything. Written to a terminal as it is, it could move the cursor, change the title of the window,
//! or look like another name.

use std::fmt::Write;

/// A message is at most this long, in characters; of a longer one these are kept at its start and at its end.
const LONGEST: usize = 1000;
const START: usize = 600;
const END: usize = 300;

/// Whether a character is invisible: the control characters, those that break lines, set the direction of writing or
/// have no width (Unicode 16, category Cc, `Default_Ignorable_Code_Point`, U+2028, U+2029 and U+FFF9 to U+FFFB).
///
/// ```
/// use thetahat_numerics::text::is_invisible;
///
/// assert!(['\x1b', '\u{9b}', '\n', '\u{200b}', '\u{202e}', '\u{2066}', '\u{feff}'].into_iter().all(is_invisible));
/// assert!(!"Temp [°C] é µ 温度 ع 🌡".contains(is_invisible));
/// ```
pub fn is_invisible(character: char) -> bool {
    character.is_control()
        || matches!(character,
            '\u{ad}' | '\u{34f}' | '\u{61c}' | '\u{115f}'..='\u{1160}' | '\u{17b4}'..='\u{17b5}'
            | '\u{180b}'..='\u{180f}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}'
            | '\u{2060}'..='\u{206f}' | '\u{3164}' | '\u{fe00}'..='\u{fe0f}' | '\u{feff}' | '\u{ffa0}'
            | '\u{fff0}'..='\u{fffb}' | '\u{1bca0}'..='\u{1bca3}' | '\u{1d173}'..='\u{1d17a}'
            | '\u{e0000}'..='\u{e0fff}')
}

/// A text with what is invisible ([`is_invisible`]) as an escape: harmless to a terminal, and on one line.
///
/// ```
/// assert_eq!(thetahat_numerics::text::harmless("u\x1b[2J\u{202e}x"), "u\\u{1b}[2J\\u{202e}x");
/// ```
pub fn harmless(text: &str) -> String {
    let mut harmless = String::with_capacity(text.len());
    for character in text.chars() {
        if is_invisible(character) {
            harmless.extend(character.escape_default());
        } else {
            harmless.push(character);
        }
    }
    harmless
}

/// A name as a message repeats it: [`harmless`], and cut off after this many characters.
///
/// ```
/// assert_eq!(thetahat_numerics::text::brief("heater", 40), "heater");
/// assert_eq!(thetahat_numerics::text::brief("\x1bheater", 8), "\\u{1b}he…");
/// ```
pub fn brief(name: &str, longest: usize) -> String {
    let cut = |text: &str| text.char_indices().nth(longest).map(|(end, _)| end);
    // No character is shown as less than one.
    let mut shown = harmless(&name[..cut(name).unwrap_or(name.len())]);
    let end = cut(&shown).or(cut(name).map(|_| shown.len()));
    if let Some(end) = end {
        shown.truncate(end);
        shown.push('…');
    }
    shown
}

/// A message that may repeat parts of a file: [`harmless`], and at most 1000 characters long. Of a longer one the start
/// and the end are kept, which say what and where.
///
/// ```
/// let long = format!("unknown field `{}` at line 1 column 9", "x".repeat(50_000_000));
/// let message = thetahat_numerics::text::message(&long);
/// assert!(message.chars().count() <= 1000);
/// assert!(message.starts_with("unknown field `xxx") && message.ends_with("xxx` at line 1 column 9"));
/// ```
pub fn message(text: &str) -> String {
    // An escape is at most ten characters long.
    let most = 10 * LONGEST;
    let harmless = match text.char_indices().nth(most) {
        None => harmless(text),
        Some((start, _)) => {
            let end = text.char_indices().rev().nth(most).map_or(0, |(end, _)| end);
            format!("{}{}", harmless(&text[..start]), harmless(&text[end.max(start)..]))
        }
    };
    let place = |index: usize| harmless.char_indices().nth(index).map(|(place, _)| place);
    match (place(LONGEST), place(START)) {
        (Some(_), Some(start)) => {
            let end = harmless.char_indices().rev().nth(END - 1).map_or(0, |(end, _)| end);
            format!("{}…{}", &harmless[..start], &harmless[end..])
        }
        _ => harmless,
    }
}

/// A text as a string of JSON, between quotes, with what is invisible as an escape.
///
/// ```
/// assert_eq!(thetahat_numerics::text::json("a\"\u{202e}\n"), r#""a\"\u202e\n""#);
/// ```
pub fn json(text: &str) -> String {
    escaped_json(serde_json::Value::from(text).to_string())
}

/// A JSON text with what is invisible as escapes, except line breaks, which stand between its tokens only. It says the
/// same.
pub fn escaped_json(json: String) -> String {
    let is_shown = |character: char| character == '\n' || !is_invisible(character);
    if json.chars().all(is_shown) {
        return json;
    }
    let mut escaped = String::with_capacity(json.len());
    for character in json.chars() {
        if is_shown(character) {
            escaped.push(character);
            continue;
        }
        for unit in character.encode_utf16(&mut [0; 2]) {
            // Writing to a string cannot fail.
            let _ = write!(escaped, "\\u{unit:04x}");
        }
    }
    escaped
}

/// The name that differs least from a word, if one is near: at most a third of its characters have to be changed, and
/// not all of them.
///
/// (Levenshtein 1966, by Wagner and Fischer's recursion of 1974.)
fn nearest<'n>(word: &str, names: impl IntoIterator<Item = &'n str>) -> Option<&'n str> {
    let letters: Vec<char> = word.chars().take(100).flat_map(char::to_lowercase).collect();
    let distance = |name: &str| {
        let mut row: Vec<usize> = (0..=letters.len()).collect();
        for (i, there) in name.chars().take(100).flat_map(char::to_lowercase).enumerate() {
            let mut diagonal = std::mem::replace(&mut row[0], i + 1);
            for (j, here) in letters.iter().enumerate() {
                let changed = diagonal + usize::from(*here != there);
                diagonal = row[j + 1];
                row[j + 1] = changed.min(diagonal + 1).min(row[j] + 1);
            }
        }
        row[letters.len()]
    };
    let best = names.into_iter().map(|name| (distance(name), name)).min_by_key(|(distance, _)| *distance)?;
    (best.0 <= letters.len().div_ceil(3) && best.0 < letters.len()).then_some(best.1)
}

/// "; did you mean 'x'?" where a name is near, or nothing.
///
/// ```
/// use thetahat_numerics::text::suggestion;
///
/// assert_eq!(suggestion("detrned", ["detrend", "offset"]), "; did you mean 'detrend'?");
/// assert_eq!(suggestion("gain", ["detrend", "offset"]), "");
/// ```
pub fn suggestion<'n>(word: &str, names: impl IntoIterator<Item = &'n str>) -> String {
    nearest(word, names).map_or(String::new(), |name| format!("; did you mean '{name}'?"))
}

#[cfg(test)]
mod tests;
