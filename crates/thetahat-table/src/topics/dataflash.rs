//! DataFlash, as ArduPilot records it: two bytes of mark, the kind of a message and its data. Messages of the kind FMT
//! declare the others; those of the kind FMTU say, among other things, which field tells sensors of one kind apart.
//!
//! The letters of formats are those of ArduPilot's `LogStructure.h`.

use std::collections::HashMap;

use memchr::memmem;

use super::number::{Number, array};
use super::{Field, Found, listed};

const MARK: [u8; 2] = [0xa3, 0x95];
const MESSAGE_HEAD: usize = 3;
/// The kind that declares others, and the size of its messages without their head.
const FMT: u8 = 128;
const FMT_SIZE: usize = 86;
/// Messages about messages, which are no signals.
const OF_THE_LOG: [&str; 4] = ["FMT", "FMTU", "MULT", "UNIT"];
/// Numbers in an array.
const ARRAY: usize = 32;

/// What is known of the messages of a kind.
#[derive(Clone)]
struct Declared {
    name: String,
    /// How many bytes they have without their head.
    size: usize,
    parts: Vec<Part>,
}

#[derive(Clone)]
struct Part {
    label: String,
    at: usize,
    letter: u8,
}

/// Messages one after the other, with what was declared so far.
struct Walk<'b> {
    bytes: &'b [u8],
    at: usize,
    declared: Vec<Option<Declared>>,
    /// Bytes that are no messages, in each place.
    skipped: Vec<usize>,
    is_unfinished: bool,
}

impl<'b> Walk<'b> {
    fn new(bytes: &'b [u8]) -> Self {
        Self { bytes, at: 0, declared: vec![None; 256], skipped: Vec::new(), is_unfinished: false }
    }

    /// Where the next message begins that may be one.
    fn skip(&mut self) {
        let rest = self.bytes.get(self.at + 1..).unwrap_or_default();
        let next = memmem::find(rest, &MARK).map_or(self.bytes.len(), |found| self.at + 1 + found);
        self.skipped.push(next - self.at);
        self.at = next;
    }
}

impl<'b> Iterator for Walk<'b> {
    type Item = (u8, &'b [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let rest = self.bytes.get(self.at..).filter(|rest| !rest.is_empty())?;
            let Some(&[first, second, kind]) = rest.get(..MESSAGE_HEAD) else {
                self.is_unfinished |= MARK.starts_with(rest.get(..2).unwrap_or(rest));
                if !self.is_unfinished {
                    self.skipped.push(rest.len());
                }
                self.at = self.bytes.len();
                return None;
            };
            let declared = self.declared.get(usize::from(kind)).and_then(Option::as_ref);
            let size = if kind == FMT { Some(FMT_SIZE) } else { declared.map(|declared| declared.size) };
            let (MARK, Some(size)) = ([first, second], size) else {
                self.skip();
                continue;
            };
            let Some(data) = rest.get(MESSAGE_HEAD..MESSAGE_HEAD + size) else {
                // The log ends here, if nothing follows that begins as a message does.
                if memmem::find(&rest[MESSAGE_HEAD..], &MARK).is_none() {
                    self.is_unfinished = true;
                    self.at = self.bytes.len();
                    return None;
                }
                self.skip();
                continue;
            };
            if kind == FMT
                && let Some((kind, declared)) = declaration(data)
                && let Some(place) = self.declared.get_mut(usize::from(kind))
            {
                *place = Some(declared);
            }
            self.at += MESSAGE_HEAD + size;
            return Some((kind, data));
        }
    }
}

pub(super) fn decode(bytes: &[u8], found: &mut Found<'_>) -> Result<(), String> {
    // Which field tells the sensors apart may be said after the first messages.
    let mut instances: Vec<Option<usize>> = vec![None; 256];
    let mut walk = Walk::new(bytes);
    while let Some((kind, data)) = walk.next() {
        let declared = walk.declared.get(usize::from(kind)).and_then(Option::as_ref);
        if let Some((of, place)) =
            declared.filter(|declared| declared.name == "FMTU").and_then(|own| instance(own, data))
            && let Some(known) = instances.get_mut(usize::from(of))
        {
            *known = Some(place);
        }
    }
    let mut topics: HashMap<(u8, u8), Option<usize>> = HashMap::new();
    let mut left_out: Vec<String> = Vec::new();
    let mut walk = Walk::new(bytes);
    while let Some((kind, data)) = walk.next() {
        if kind == FMT {
            // What a kind was before may not be what it is now.
            topics.retain(|(known, _), _| data.first() != Some(known));
            continue;
        }
        let Some(declared) = walk.declared.get(usize::from(kind)).and_then(Option::as_ref) else { continue };
        if OF_THE_LOG.contains(&declared.name.as_str()) {
            continue;
        }
        let Some((time, unit)) = declared.time() else {
            if !left_out.contains(&declared.name) {
                left_out.push(declared.name.clone());
            }
            continue;
        };
        let place = instances.get(usize::from(kind)).copied().flatten();
        let own =
            place.and_then(|place| declared.parts.get(place)).filter(|part| b"bBM".contains(&part.letter));
        let instance = own.and_then(|part| data.get(part.at)).copied().unwrap_or(0);
        let topic = match topics.get(&(kind, instance)) {
            Some(topic) => *topic,
            None => {
                let name = match instance {
                    0 => declared.name.clone(),
                    other => format!("{}#{other}", declared.name),
                };
                let fields = declared.fields(&name, own.map(|part| part.at));
                let topic = if fields.is_empty() { None } else { found.topic(&name, fields)? };
                topics.insert((kind, instance), topic);
                if topic.is_none() && !left_out.contains(&name) {
                    left_out.push(name);
                }
                topic
            }
        };
        if let (Some(topic), Some(time)) =
            (topic, number(time.letter).and_then(|number| number.read(data, time.at)))
        {
            found.message(topic, time / unit, data);
        }
    }
    walk.skipped.iter().for_each(|bytes| found.damage.skip(*bytes));
    found.damage.is_unfinished = walk.is_unfinished;
    if !left_out.is_empty() {
        let names: Vec<&str> = left_out.iter().map(String::as_str).collect();
        found.left_out.push(format!("messages without numbers or a clock are left out: {}", listed(&names)));
    }
    Ok(())
}

/// The kind that a message declares, and how.
fn declaration(data: &[u8]) -> Option<(u8, Declared)> {
    let text = |from: usize, size: usize| -> Option<&str> {
        let bytes = data.get(from..from + size)?;
        let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(size);
        std::str::from_utf8(&bytes[..end]).ok()
    };
    let [kind, size] = array(data, 0)?;
    let (name, letters, labels) = (text(2, 4)?, text(6, 16)?, text(22, 64)?);
    let size = usize::from(size).checked_sub(MESSAGE_HEAD)?;
    let (mut parts, mut at) = (Vec::new(), 0);
    for (letter, label) in letters.bytes().zip(labels.split(',')) {
        parts.push(Part { label: label.trim().to_owned(), at, letter });
        at += width(letter)?;
    }
    (at <= size && !name.is_empty()).then(|| (kind, Declared { name: name.to_owned(), size, parts }))
}

/// Which field tells the messages of a kind apart.
fn instance(declared: &Declared, data: &[u8]) -> Option<(u8, usize)> {
    let part = |label: &str| declared.parts.iter().find(|part| part.label == label);
    let (of, units) = (part("FmtType")?, part("UnitIds")?);
    let units = data.get(units.at..units.at + width(units.letter)?)?;
    Some((*data.get(of.at)?, units.iter().take_while(|unit| **unit != 0).position(|unit| *unit == b'#')?))
}

impl Declared {
    /// The time of its messages, and how many of its units are a second.
    fn time(&self) -> Option<(&Part, f64)> {
        let part =
            |label: &str| self.parts.iter().find(|part| part.label == label && number(part.letter).is_some());
        part("TimeUS").map(|part| (part, 1e6)).or_else(|| part("TimeMS").map(|part| (part, 1e3)))
    }

    /// Its numbers but the time, and but the one at a place.
    fn fields(&self, topic: &str, without: Option<usize>) -> Vec<Field> {
        let time = self.time().map(|(part, _)| part.at);
        let parts = self.parts.iter().filter(|part| ![time, without].contains(&Some(part.at)));
        let mut fields = Vec::new();
        for Part { label, at, letter } in parts {
            let name = format!("{topic}.{label}");
            if *letter == b'a' {
                let element = |index: usize| Field {
                    name: format!("{name}[{index}]"),
                    at: at + 2 * index,
                    number: Number::I16,
                    divisor: 1.0,
                };
                fields.extend((0..ARRAY).map(element));
            } else if let Some(number) = number(*letter) {
                fields.push(Field { name, at: *at, number, divisor: divisor(*letter) });
            }
        }
        fields
    }
}

/// The number that a letter stands for; none for texts and arrays.
fn number(letter: u8) -> Option<Number> {
    Some(match letter {
        b'b' => Number::I8,
        b'B' | b'M' => Number::U8,
        b'h' | b'c' => Number::I16,
        b'H' | b'C' => Number::U16,
        b'i' | b'e' | b'L' => Number::I32,
        b'I' | b'E' => Number::U32,
        b'q' => Number::I64,
        b'Q' => Number::U64,
        b'g' => Number::F16,
        b'f' => Number::F32,
        b'd' => Number::F64,
        _ => return None,
    })
}

/// How many bytes a letter stands for.
fn width(letter: u8) -> Option<usize> {
    match letter {
        b'n' => Some(4),
        b'N' => Some(16),
        b'Z' | b'a' => Some(64),
        other => number(other).map(Number::size),
    }
}

/// Hundredths, and degrees in units of 1e-7.
fn divisor(letter: u8) -> f64 {
    match letter {
        b'c' | b'C' | b'e' | b'E' => 100.0,
        b'L' => 1e7,
        _ => 1.0,
    }
}
