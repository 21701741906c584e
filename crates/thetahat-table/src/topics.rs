//! Flight and robot logs: topics, each with a clock and fields of its own.
//!
//! The file is held in memory, unpacked, and walked twice: once for what there is, and once for the values of the
//! columns that were selected. A message is a few bytes at a known place, so a field is an offset and a type, in all
//! formats.
//!
//! Power is cut in the middle of a message, cards lose blocks: what can be read is read, and what is not is told.
//! Nothing is reserved for what a file states, only for what stands in it.

mod columns;
mod dataflash;
mod number;
mod stream;
#[cfg(test)]
mod tests;
mod ulog;
mod wpilog;

use std::collections::HashMap;
use std::io::{self, Read};
use std::ops::ControlFlow;

use super::error::{Error, escaped, shortened};
use super::source::{Bytes, Topical};
use super::{Options, Selection, Table, Topic};
use columns::{Column, Wanted, joined};
use number::Number;
pub(super) use stream::TopicStream;

/// What is read of a file at once.
const PIECE: usize = 1 << 20;
/// A log has no more columns than this, and no longer names: a damaged file must not ask for more memory than there is.
const MOST_COLUMNS: usize = 1 << 18;
const LONGEST_NAME: usize = 512;
/// This many names are told.
const MOST_TOLD: usize = 6;

/// A number in the messages of a topic.
#[derive(Clone, Debug, PartialEq)]
struct Field {
    /// The column's name.
    name: String,
    /// Where it stands in a message.
    at: usize,
    number: Number,
    /// What it is divided by.
    divisor: f64,
}

/// A topic as a decoder finds it.
#[derive(Clone, Debug)]
struct FoundTopic {
    name: String,
    fields: Vec<Field>,
    rows: usize,
    first: f64,
    last: f64,
}

/// What a decoder finds in a log.
struct Found<'t> {
    topics: Vec<FoundTopic>,
    places: HashMap<String, usize>,
    columns: usize,
    /// What is not read, and why.
    left_out: Vec<String>,
    damage: Damage,
    /// Takes each message: its topic, its time in seconds and its bytes.
    take: &'t mut dyn FnMut(usize, f64, &[u8]),
}

/// What of a log cannot be read.
#[derive(Default)]
struct Damage {
    /// Bytes that are no message, and in how many places.
    bytes: usize,
    places: usize,
    /// Whether the log ends in the middle of a message.
    is_unfinished: bool,
    /// Messages that are not as they were declared.
    messages: usize,
    /// What the recorder says that it did not write: how often, and seconds.
    dropouts: usize,
    dropped: f64,
}

impl<'t> Found<'t> {
    fn new(take: &'t mut dyn FnMut(usize, f64, &[u8])) -> Self {
        Self {
            topics: Vec::new(),
            places: HashMap::new(),
            columns: 0,
            left_out: Vec::new(),
            damage: Damage::default(),
            take,
        }
    }

    /// A topic with these fields, the one that is there or a new one. None if another of this name has other fields.
    ///
    /// # Errors
    /// That there are more columns than a log has.
    fn topic(&mut self, name: &str, fields: Vec<Field>) -> Result<Option<usize>, String> {
        if let Some(&known) = self.places.get(name) {
            return Ok(self.topics.get(known).is_some_and(|topic| topic.fields == fields).then_some(known));
        }
        self.more(fields.len())?;
        self.places.insert(name.to_owned(), self.topics.len());
        self.topics.push(FoundTopic { name: name.to_owned(), fields, rows: 0, first: 0.0, last: 0.0 });
        Ok(Some(self.topics.len() - 1))
    }

    /// That there are so many columns more.
    fn more(&mut self, columns: usize) -> Result<(), String> {
        self.columns += columns;
        match self.columns > MOST_COLUMNS {
            true => Err(format!(
                "it has more than {MOST_COLUMNS} columns, as no log of this kind has: it is damaged; copy it again from \
                 the device"
            )),
            false => Ok(()),
        }
    }

    fn message(&mut self, topic: usize, time: f64, data: &[u8]) {
        let Some(found) = self.topics.get_mut(topic) else { return };
        if found.rows == 0 {
            (found.first, found.last) = (time, time);
        }
        (found.first, found.last) = (found.first.min(time), found.last.max(time));
        found.rows += 1;
        (self.take)(topic, time, data);
    }
}

impl Damage {
    /// So many bytes are no message.
    fn skip(&mut self, bytes: usize) {
        self.bytes += bytes;
        self.places += 1;
    }

    fn words(&self, file: &str) -> Vec<String> {
        let mut words = Vec::new();
        if self.is_unfinished {
            words.push(format!(
                "{file}: the log ends in the middle of a message, as where power was cut: it is read up to there"
            ));
        }
        if self.bytes > 0 {
            let places = counted(self.places, "place", "places");
            words.push(format!(
                "{file}: {} bytes in {places} are no messages, as in a file that is damaged: they are left out",
                self.bytes
            ));
        }
        if self.messages > 0 {
            words.push(format!(
                "{file}: {} not as declared, and left out",
                counted(self.messages, "message is", "messages are")
            ));
        }
        if self.dropouts > 0 {
            let times = counted(self.dropouts, "time", "times");
            words.push(format!(
                "{file}: the recorder was too slow {times}, and left out {:.3} s in all",
                self.dropped
            ));
        }
        words
    }
}

/// Walks through a log.
///
/// # Errors
/// That the file is no such log, or is one that cannot be understood.
fn decode(format: Topical, bytes: &[u8], found: &mut Found<'_>) -> Result<(), String> {
    match format {
        Topical::Ulog => ulog::decode(bytes, found),
        Topical::DataFlash => dataflash::decode(bytes, found),
        Topical::WpiLog => wpilog::decode(bytes, found),
    }
}

/// A log of topics, of which is known what there is, and of which the values are still to be read.
pub(super) struct TopicsReader {
    file: String,
    format: Topical,
    bytes: Vec<u8>,
    /// How many bytes the file has.
    size: u64,
    options: Options,
    topics: Vec<FoundTopic>,
    /// The same for who asks.
    shown: Vec<Topic>,
    names: Vec<String>,
    /// Which topic a column is of, and which of its fields.
    places: Vec<(usize, usize)>,
    damage: Vec<String>,
    left_out: Vec<String>,
}

impl TopicsReader {
    /// Reads what topics there are.
    pub(super) fn open(bytes: Bytes, format: Topical, options: &Options) -> Result<Self, Error> {
        let file = bytes.name().to_owned();
        let bad = |message: String| Error::data(&file, None, message);
        if let Some(option) = options.of_texts() {
            let this = format.said();
            return Err(bad(format!(
                "{option} says how a text is written, and this is {this}; leave it out"
            )));
        }
        for (option, given) in [
            ("`time-format`", options.time_format.is_some()),
            ("`time-unit`", options.time_unit.is_some()),
            ("`time-zone`", options.time_zone.is_some()),
        ] {
            if given {
                let this = format.said();
                return Err(bad(format!(
                    "{option} says how times are written, and {this} says that itself; leave it out"
                )));
            }
        }
        let bytes = held(bytes, &file, options)?;
        let mut nothing = |_: usize, _: f64, _: &[u8]| {};
        let mut found = Found::new(&mut nothing);
        decode(format, &bytes, &mut found).map_err(bad)?;
        let Found { mut topics, left_out, damage, .. } = found;
        let empty = topics.iter().all(|topic| topic.rows == 0 || topic.fields.is_empty());
        let damage = damage.words(&escaped(&file));
        if empty {
            let why = damage.first().map_or("it may have ended before the first one", |_| "it is damaged");
            return Err(bad(format!(
                "there is no message with numbers and a time: {why}; copy it again from the device"
            )));
        }
        // Places stay: a second walk counts alike.
        for topic in &mut topics {
            if topic.rows == 0 {
                topic.fields.clear();
            }
        }
        let (mut shown, mut names, mut places) = (Vec::new(), Vec::new(), Vec::new());
        for (place, topic) in topics.iter().enumerate().filter(|(_, topic)| !topic.fields.is_empty()) {
            let first = names.len();
            names.extend(topic.fields.iter().map(|field| field.name.clone()));
            places.extend((0..topic.fields.len()).map(|field| (place, field)));
            shown.push(Topic {
                name: topic.name.clone(),
                rows: topic.rows,
                duration: topic.last - topic.first,
                columns: first..names.len(),
            });
        }
        let size = bytes.len() as u64;
        Ok(Self {
            file,
            format,
            bytes,
            size,
            options: options.clone(),
            topics,
            shown,
            names,
            places,
            damage,
            left_out,
        })
    }

    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    pub(super) fn topics(&self) -> &[Topic] {
        &self.shown
    }

    /// What a list of the topics should say besides, in plain words.
    pub(super) fn remarks(&self) -> Vec<String> {
        let file = escaped(&self.file);
        let left_out = self.left_out.iter().map(|words| format!("{file}: {words}"));
        self.damage.iter().cloned().chain(left_out).collect()
    }

    /// Reads the selected columns; see [`Reader::read_parts`](super::Reader::read_parts).
    pub(super) fn read_parts(
        self,
        selection: &Selection,
        most: Option<usize>,
        progress: &mut dyn FnMut(u64, Option<u64>),
        take: &mut dyn FnMut(Table) -> ControlFlow<()>,
    ) -> Result<(), Error> {
        let size = self.size;
        let table = match most {
            Some(_) => self.one_topic(selection)?,
            None => self.table(selection)?,
        };
        progress(size, Some(size));
        let most = most.unwrap_or(usize::MAX).max(1);
        if table.rows <= most {
            let _ = take(table);
            return Ok(());
        }
        let mut first = 0;
        while first < table.rows {
            // What is left and would be short belongs to the part before it.
            let end = if table.rows - first < 2 * most { table.rows } else { first + most };
            let part = |values: &Vec<f64>| values.get(first..end).unwrap_or_default().to_vec();
            let words = if first == 0 { table.words.clone() } else { Vec::new() };
            let part = Table {
                columns: table.columns.iter().map(part).collect(),
                time: table.time.as_ref().map(part),
                rows: end - first,
                words,
                ..Table::default()
            };
            if take(part).is_break() {
                break;
            }
            first = end;
        }
        Ok(())
    }

    /// Gives the rows one by one; see [`Reader::stream`](super::Reader::stream).
    pub(super) fn stream(self, selection: &Selection) -> Result<TopicStream, Error> {
        let file = self.file.clone();
        TopicStream::of(self.one_topic(selection)?).map_err(|error| Error::no_thread(&file, &error))
    }

    /// The selected columns, if all are of one topic.
    fn one_topic(self, selection: &Selection) -> Result<Table, Error> {
        let file = self.file.clone();
        let table = self.table(selection)?;
        match table.clocks.as_slice() {
            [] => Ok(table),
            clocks => {
                let names: Vec<&str> = clocks.iter().map(|clock| clock.topic.as_str()).collect();
                Err(Error::data(
                    &file,
                    None,
                    format!(
                        "the columns are of several topics ({}), each with a clock of its own, and are put on one clock only \
                         where the log is read whole; name columns of one topic",
                        listed(&names)
                    ),
                ))
            }
        }
    }

    /// The selected columns.
    fn table(self, selection: &Selection) -> Result<Table, Error> {
        let bad = |message: String| Error::data(&self.file, None, message);
        if selection.time.is_some() || selection.date.is_some() {
            return Err(bad("each topic has a clock of its own; leave `time` out".to_owned()));
        }
        let mut wanted: Vec<Wanted<'_>> = Vec::new();
        let mut twice = vec![false; self.places.len()];
        for (place, &column) in selection.columns.iter().enumerate() {
            let found = self.places.get(column).and_then(|&(topic, field)| {
                let found = self.topics.get(topic)?;
                Some((topic, found, found.fields.get(field)?))
            });
            let Some((topic, found, field)) = found else {
                let all = self.names.len();
                return Err(bad(format!("there is no column {}; select from the first {all}", column + 1)));
            };
            if twice.get_mut(column).is_some_and(|twice| std::mem::replace(twice, true)) {
                let name = escaped(&shortened(&field.name));
                return Err(bad(format!("column '{name}' is selected twice; select it once")));
            }
            if found.rows > 1 && found.first == found.last {
                let topic = escaped(&shortened(&found.name));
                return Err(bad(format!(
                    "the messages of '{topic}' all have the same time, {} s: it has no clock; name columns of another topic",
                    found.first
                )));
            }
            let own = match wanted.iter().position(|wanted| wanted.topic == topic) {
                Some(own) => own,
                None => {
                    wanted.push(Wanted::new(topic, &found.name));
                    wanted.len() - 1
                }
            };
            if let Some(wanted) = wanted.get_mut(own) {
                wanted.columns.push(Column::new(place, field));
            }
        }
        let rows = |topic: usize| self.topics.get(topic).map_or(0, |topic| topic.rows);
        let values = wanted.iter().map(|wanted| rows(wanted.topic).saturating_mul(wanted.columns.len() + 1));
        let values = values.fold(0, usize::saturating_add);
        if let Some(words) = self.options.bound.and_then(|bound| bound.passed_by(values)) {
            return Err(Error::memory(&self.file, None, &words));
        }
        for wanted in &mut wanted {
            let rows = rows(wanted.topic);
            let columns = wanted.columns.iter_mut().map(|column| &mut column.values);
            for values in columns.chain([&mut wanted.time]) {
                let reserved = values.try_reserve_exact(rows);
                reserved.map_err(|error| Error::memory(&self.file, None, &error.to_string()))?;
            }
        }
        let place = |topic: usize| wanted.iter().position(|wanted| wanted.topic == topic);
        let places: Vec<Option<usize>> = (0..self.topics.len()).map(place).collect();
        let mut take = |topic: usize, time: f64, data: &[u8]| {
            let place = places.get(topic).copied().flatten();
            if let Some(wanted) = place.and_then(|place| wanted.get_mut(place)) {
                wanted.add(time, data);
            }
        };
        let mut found = Found::new(&mut take);
        decode(self.format, &self.bytes, &mut found).map_err(bad)?;
        let file = escaped(&self.file);
        let mut words = self.damage.clone();
        wanted.iter_mut().for_each(|wanted| wanted.sort(&file, &mut words));
        Ok(joined(wanted, selection.columns.len(), words))
    }
}

/// The whole file, if there is memory for it.
fn held(bytes: Bytes, file: &str, options: &Options) -> Result<Vec<u8>, Error> {
    let gzip = bytes.is_gzip();
    let (mut reader, mut held, mut piece) = (bytes.into_reader(), Vec::new(), vec![0; PIECE]);
    loop {
        let count = match reader.read(&mut piece) {
            Ok(0) => return Ok(held),
            Ok(count) => count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            // A stream that ends too early is a log whose end is missing.
            Err(error) if gzip && error.kind() == io::ErrorKind::UnexpectedEof && !held.is_empty() => {
                return Ok(held);
            }
            Err(error) => return Err(Error::io(file, format!("cannot be read: {error}"))),
        };
        let words = options.bound.and_then(|bound| bound.passed_by_file((held.len() + count) as u64));
        let words = words.or_else(|| held.try_reserve(count).err().map(|error| error.to_string()));
        if let Some(words) = words {
            return Err(Error::memory(file, None, &words));
        }
        held.extend_from_slice(&piece[..count]);
    }
}

/// So many of something.
fn counted(count: usize, one: &str, more: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { more })
}

/// Names as a message lists them, not all of very many.
fn listed(names: &[&str]) -> String {
    let first: Vec<String> = names.iter().take(MOST_TOLD).map(|name| escaped(&shortened(name))).collect();
    let more = names.len().saturating_sub(MOST_TOLD);
    if more > 0 { format!("{} and {more} more", first.join(", ")) } else { first.join(", ") }
}
