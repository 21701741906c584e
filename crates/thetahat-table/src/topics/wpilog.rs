//! Data logs of WPILib: records with an entry, a time and data, of which those of entry 0 declare the others.
//!
//! The format is that of "WPILib Data Log File Format Specification, version 1.0".

use std::collections::HashMap;

use super::number::{Number, array};
use super::{Field, Found, LONGEST_NAME, listed};

/// Mark, version, and the size of what follows.
const HEAD: usize = 12;
/// Of a longer array, the first elements are read.
const LONGEST_ARRAY: usize = 256;

/// The data of an entry.
#[derive(Clone, Copy)]
struct Entry {
    topic: usize,
    number: Number,
    is_array: bool,
}

pub(super) fn decode(bytes: &[u8], found: &mut Found<'_>) -> Result<(), String> {
    let version: [u8; 2] = array(bytes, 6).unwrap_or_default();
    if version[1] != 1 {
        return Err(format!(
            "it is a data log of version {}.{}, and this program reads version 1; convert it to CSV",
            version[1], version[0]
        ));
    }
    let extra = array(bytes, 8).map_or(0, |extra| u32::from_le_bytes(extra) as usize);
    let mut at = HEAD.saturating_add(extra);
    // None: an entry that holds no numbers.
    let mut entries: HashMap<u32, Option<Entry>> = HashMap::new();
    let (mut left_out, mut structures, mut long) = (Vec::new(), Vec::new(), Vec::new());
    if at > bytes.len() {
        found.damage.is_unfinished = true;
    }
    while at < bytes.len() {
        let Some(Record { entry, time, data, next }) = Record::at(bytes, at) else {
            found.damage.is_unfinished = true;
            break;
        };
        at = next;
        if entry != 0 {
            match entries.get(&entry) {
                Some(Some(entry)) => entry.take(time, data, found, &mut long)?,
                Some(None) => {}
                None => found.damage.messages += 1,
            }
            continue;
        }
        let id = array(data, 1).map(u32::from_le_bytes);
        match (data.first(), id) {
            (Some(0), Some(id)) => {
                let declared = text(data, 5).and_then(|(name, after)| Some((name, text(data, after)?.0)));
                let Some((name, kind)) = declared.filter(|(name, _)| name.len() <= LONGEST_NAME) else {
                    found.damage.messages += 1;
                    continue;
                };
                let name = name.strip_prefix('/').unwrap_or(name);
                let entry = entry_of(name, kind, found)?;
                if entry.is_none() {
                    let named = if is_structure(kind) { &mut structures } else { &mut left_out };
                    if !named.iter().any(|known| known == name) {
                        named.push(name.to_owned());
                    }
                }
                entries.insert(id, entry);
            }
            (Some(1), Some(id)) => {
                entries.remove(&id);
            }
            (Some(2), Some(_)) => {}
            _ => found.damage.messages += 1,
        }
    }
    for (names, what) in [
        (structures, "entries of structures are left out (record their numbers as entries of their own)"),
        (left_out, "entries without numbers, or with others than before, are left out"),
        (long, "of arrays of more than 256 numbers the first 256 are read"),
    ] {
        if !names.is_empty() {
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            found.left_out.push(format!("{what}: {}", listed(&names)));
        }
    }
    Ok(())
}

struct Record<'b> {
    entry: u32,
    time: f64,
    data: &'b [u8],
    /// Where the next one begins.
    next: usize,
}

impl<'b> Record<'b> {
    /// None where the file ends before it does.
    fn at(bytes: &'b [u8], at: usize) -> Option<Self> {
        let sizes = usize::from(*bytes.get(at)?);
        let mut at = at + 1;
        let mut number = |size: usize| {
            let digits = bytes.get(at..at + size)?;
            at += size;
            Some(digits.iter().rev().fold(0_u64, |number, digit| number << 8 | u64::from(*digit)))
        };
        let entry = number(1 + (sizes & 3))? as u32;
        let size = usize::try_from(number(1 + (sizes >> 2 & 3))?).ok()?;
        let time = number(1 + (sizes >> 4 & 7))? as i64 as f64 / 1e6;
        let next = at.checked_add(size)?;
        Some(Self { entry, time, data: bytes.get(at..next)?, next })
    }
}

/// A text with its length before it, and where it ends.
fn text(data: &[u8], at: usize) -> Option<(&str, usize)> {
    let size = u32::from_le_bytes(array(data, at)?) as usize;
    let end = (at + 4).checked_add(size)?;
    Some((std::str::from_utf8(data.get(at + 4..end)?).ok()?, end))
}

fn is_structure(kind: &str) -> bool {
    kind.starts_with("struct:") || kind.starts_with("proto:")
}

/// What an entry of a type is; none if it holds no numbers, or others than the entry of this name before it.
fn entry_of(name: &str, kind: &str, found: &mut Found<'_>) -> Result<Option<Entry>, String> {
    let (single, is_array) = kind.strip_suffix("[]").map_or((kind, false), |single| (single, true));
    let number = match single {
        "boolean" => Number::Bool,
        "int64" => Number::I64,
        "float" => Number::F32,
        "double" => Number::F64,
        _ => return Ok(None),
    };
    let element = |index: usize| Field {
        name: if is_array { format!("{name}[{index}]") } else { name.to_owned() },
        at: index * number.size(),
        number,
        divisor: 1.0,
    };
    // How many elements there are is known by the longest one.
    let known = found
        .places
        .get(name)
        .and_then(|place| found.topics.get(*place))
        .map_or(0, |topic| topic.fields.len());
    let count = if is_array { known } else { 1 };
    let topic = found.topic(name, (0..count).map(element).collect())?;
    Ok(topic.map(|topic| Entry { topic, number, is_array }))
}

impl Entry {
    fn take(
        self,
        time: f64,
        data: &[u8],
        found: &mut Found<'_>,
        long: &mut Vec<String>,
    ) -> Result<(), String> {
        let count = data.len() / self.number.size();
        if self.is_array {
            self.widen(count, found, long)?;
        } else if count == 0 {
            found.damage.messages += 1;
            return Ok(());
        }
        found.message(self.topic, time, data);
        Ok(())
    }

    /// That an array has this many elements.
    fn widen(self, count: usize, found: &mut Found<'_>, long: &mut Vec<String>) -> Result<(), String> {
        let Some(topic) = found.topics.get_mut(self.topic) else { return Ok(()) };
        let known = topic.fields.len();
        if count > LONGEST_ARRAY && !long.contains(&topic.name) {
            long.push(topic.name.clone());
        }
        let count = count.min(LONGEST_ARRAY);
        if count > known {
            let (name, number) = (topic.name.clone(), self.number);
            let element = |index: usize| Field {
                name: format!("{name}[{index}]"),
                at: index * number.size(),
                number,
                divisor: 1.0,
            };
            topic.fields.extend((known..count).map(element));
            found.more(count - known)?;
        }
        Ok(())
    }
}
