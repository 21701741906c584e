//! ULog, as PX4 records it: messages with a size and a kind, of which some declare formats, some topics, and some are
//! data.
//!
//! The format is that of the PX4 developer guide ("ULog file format", versions 1 and 2).

use std::collections::HashMap;

use memchr::memmem;

use super::number::{Number, array};
use super::{Field, Found, LONGEST_NAME, listed};

/// The marks of the file and of a message at which reading can begin again.
const HEAD: usize = 16;
const SYNC: [u8; 11] = [8, 0, b'S', 0x2f, 0x73, 0x13, 0x20, 0x25, 0x0c, 0xbb, 0x12];
/// Size and kind of a message.
const MESSAGE_HEAD: usize = 3;
/// No message is larger.
const LARGEST: usize = 1 << 16;
/// Formats stand in one another no deeper than this.
const DEEPEST: usize = 16;

/// A member of a format: a number, an array of them, or of another format.
struct Member {
    kind: String,
    /// None for a single one.
    count: Option<usize>,
    name: String,
}

/// What is known of the data with an id.
enum Subscribed {
    /// Its name and its instance; its fields are looked for when there is data.
    Named(String, u8),
    /// Its topic, where its time stands, and how many bytes it has at least.
    Topic {
        topic: usize,
        time: usize,
        least: usize,
    },
    Unreadable,
}

pub(super) fn decode(bytes: &[u8], found: &mut Found<'_>) -> Result<(), String> {
    let mut log = Ulog { formats: HashMap::new(), subscribed: HashMap::new(), clockless: Vec::new() };
    let mut at = HEAD;
    // What is appended after a crash begins where the log ended, be it in the middle of a message.
    let mut ends = vec![bytes.len()];
    if bytes.get(HEAD + 2) == Some(&b'B') {
        ends.splice(0..0, appended(bytes)?);
    }
    for end in ends {
        at = log.section(bytes, at, end, found)?;
    }
    if !log.clockless.is_empty() {
        let names: Vec<&str> = log.clockless.iter().map(String::as_str).collect();
        found.left_out.push(format!("topics without numbers or a clock are left out: {}", listed(&names)));
    }
    Ok(())
}

/// Where data begin that were appended.
fn appended(bytes: &[u8]) -> Result<Vec<usize>, String> {
    let flags: [u8; 8] = array(bytes, HEAD + MESSAGE_HEAD + 8).unwrap_or_default();
    if flags[0] & !1 != 0 || flags[1..].iter().any(|flags| *flags != 0) {
        return Err(
            "it is an ULog of a later version, which this program does not know; convert it to CSV, for \
                    example with ulog2csv"
                .to_owned(),
        );
    }
    let offset = |place: usize| array(bytes, HEAD + MESSAGE_HEAD + 16 + 8 * place).map(u64::from_le_bytes);
    let offsets = (0..3).filter_map(offset).filter_map(|offset| usize::try_from(offset).ok());
    let mut offsets: Vec<usize> = offsets.filter(|offset| (HEAD..bytes.len()).contains(offset)).collect();
    offsets.sort_unstable();
    Ok(offsets)
}

struct Ulog {
    formats: HashMap<String, Vec<Member>>,
    subscribed: HashMap<u16, Subscribed>,
    /// Topics that are not read.
    clockless: Vec<String>,
}

impl Ulog {
    /// Reads the messages of a section, and gives where the next one begins.
    fn section(
        &mut self,
        bytes: &[u8],
        mut at: usize,
        end: usize,
        found: &mut Found<'_>,
    ) -> Result<usize, String> {
        while at < end {
            let head = bytes.get(at..end).filter(|rest| rest.len() >= MESSAGE_HEAD);
            let Some(&[low, high, kind, ..]) = head else {
                found.damage.is_unfinished = true;
                break;
            };
            let data = at + MESSAGE_HEAD;
            let next = data + usize::from(u16::from_le_bytes([low, high]));
            let is_known = kind.is_ascii_alphabetic();
            if !is_known || next > end {
                let rest = bytes.get(at + 1..end).unwrap_or_default();
                match memmem::find(rest, &SYNC) {
                    Some(sync) => {
                        found.damage.skip(sync + 1);
                        at += sync + 1;
                        continue;
                    }
                    None if is_known => found.damage.is_unfinished = true,
                    None => found.damage.skip(end - at),
                }
                break;
            }
            self.message(kind, bytes.get(data..next).unwrap_or_default(), found)?;
            at = next;
        }
        Ok(end)
    }

    fn message(&mut self, kind: u8, data: &[u8], found: &mut Found<'_>) -> Result<(), String> {
        match kind {
            b'F' => match format(data) {
                Some((name, members)) => {
                    self.formats.entry(name).or_insert(members);
                }
                None => found.damage.messages += 1,
            },
            b'A' => {
                let name = data.get(3..).and_then(|name| std::str::from_utf8(name).ok());
                let (Some(&[instance, low, high, ..]), Some(name)) = (data.get(..3), name) else {
                    found.damage.messages += 1;
                    return Ok(());
                };
                let id = u16::from_le_bytes([low, high]);
                self.subscribed.entry(id).or_insert_with(|| Subscribed::Named(name.to_owned(), instance));
            }
            b'D' => self.data(data, found)?,
            b'O' => {
                if let Some(duration) = array(data, 0) {
                    found.damage.dropouts += 1;
                    found.damage.dropped += f64::from(u16::from_le_bytes(duration)) / 1e3;
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn data(&mut self, data: &[u8], found: &mut Found<'_>) -> Result<(), String> {
        let subscribed = array(data, 0).and_then(|id| self.subscribed.get_mut(&u16::from_le_bytes(id)));
        let (Some(subscribed), Some(data)) = (subscribed, data.get(2..)) else {
            found.damage.messages += 1;
            return Ok(());
        };
        if let Subscribed::Named(name, instance) = subscribed {
            let name = match *instance {
                0 => std::mem::take(name),
                instance => format!("{name}#{instance}"),
            };
            let format = name.split('#').next().unwrap_or_default();
            let layout = Layout::of(format, &name, &self.formats);
            *subscribed = Subscribed::Unreadable;
            if let Some(Layout { fields, time: Some(time), least, .. }) = layout
                && !fields.is_empty()
                && let Some(topic) = found.topic(&name, fields)?
            {
                *subscribed = Subscribed::Topic { topic, time, least };
            } else {
                self.clockless.push(name);
            }
        }
        match *subscribed {
            Subscribed::Topic { topic, time, least } if data.len() >= least => {
                if let Some(time) = Number::U64.read(data, time) {
                    found.message(topic, time / 1e6, data);
                }
            }
            Subscribed::Topic { .. } => found.damage.messages += 1,
            _ => {}
        }
        Ok(())
    }
}

/// The name and the members of a format.
fn format(text: &[u8]) -> Option<(String, Vec<Member>)> {
    let (name, members) = std::str::from_utf8(text).ok()?.split_once(':')?;
    let member = |text: &str| {
        let (kind, name) = text.trim().split_once(' ')?;
        let (kind, count) = match kind.split_once('[') {
            Some((kind, count)) => (kind, Some(count.strip_suffix(']')?.parse().ok()?)),
            None => (kind, None),
        };
        Some(Member { kind: kind.to_owned(), count, name: name.to_owned() })
    };
    let members = members.split(';').filter(|text| !text.trim().is_empty());
    let members: Option<Vec<Member>> = members.map(member).collect();
    (name.len() <= LONGEST_NAME).then_some((name.to_owned(), members?))
}

/// Where the numbers of a topic stand.
struct Layout<'f> {
    formats: &'f HashMap<String, Vec<Member>>,
    fields: Vec<Field>,
    time: Option<usize>,
    size: usize,
    /// The size without padding at the end, which may not be there.
    least: usize,
    /// How many members were gone through: some take no place.
    gone_through: usize,
}

impl<'f> Layout<'f> {
    /// None for a format that is not there, contains itself, or is larger than a message.
    fn of(format: &str, topic: &str, formats: &'f HashMap<String, Vec<Member>>) -> Option<Self> {
        let mut layout =
            Layout { formats, fields: Vec::new(), time: None, size: 0, least: 0, gone_through: 0 };
        layout.add(format, &format!("{topic}."), 0)?;
        Some(layout)
    }

    fn add(&mut self, format: &str, before: &str, depth: usize) -> Option<()> {
        if depth > DEEPEST || before.len() > LONGEST_NAME {
            return None;
        }
        let formats = self.formats;
        for Member { kind, count, name } in formats.get(format)? {
            let number = number(kind);
            for index in 0..count.unwrap_or(1) {
                self.gone_through += 1;
                if self.gone_through > LARGEST || self.size > LARGEST {
                    return None;
                }
                let path = || match count {
                    Some(_) => format!("{before}{name}[{index}]"),
                    None => format!("{before}{name}"),
                };
                match (number, kind.as_str()) {
                    // Texts and padding are no numbers.
                    (Some(number), _) if name.starts_with("_padding") => self.size += number.size(),
                    (Some(number), _) => {
                        match (depth, name.as_str(), number) {
                            (0, "timestamp", Number::U64) => self.time = Some(self.size),
                            _ => {
                                let name = path();
                                if name.len() > LONGEST_NAME {
                                    return None;
                                }
                                self.fields.push(Field { name, at: self.size, number, divisor: 1.0 });
                            }
                        }
                        self.size += number.size();
                        self.least = self.size;
                    }
                    (None, "char") => {
                        self.size += 1;
                        self.least = self.size;
                    }
                    (None, other) => {
                        self.add(other, &format!("{}.", path()), depth + 1)?;
                        self.least = self.size;
                    }
                }
            }
        }
        Some(())
    }
}

/// The number of a type; none for texts and formats.
fn number(kind: &str) -> Option<Number> {
    Some(match kind {
        "int8_t" => Number::I8,
        "uint8_t" => Number::U8,
        "int16_t" => Number::I16,
        "uint16_t" => Number::U16,
        "int32_t" => Number::I32,
        "uint32_t" => Number::U32,
        "int64_t" => Number::I64,
        "uint64_t" => Number::U64,
        "float" => Number::F32,
        "double" => Number::F64,
        "bool" => Number::Bool,
        _ => return None,
    })
}
