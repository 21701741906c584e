//! Spreadsheets: a sheet of a workbook (xlsx) as a text with tabs, which is then read as any other.
//!
//! A damaged file, or one that was made to do harm, must not ask for more memory than there is: the sizes that it
//! states are compared with what is there before the library that reads it believes them, and cells are taken one by
//! one.

use std::fmt::Write as _;
use std::io::{Cursor, Read};
use std::panic::catch_unwind;

use calamine::{DataRef, ExcelDateTime, Reader as _, Xlsx};
use zip::ZipArchive;

use super::Options;
use super::error::{Error, escaped, shortened};
use super::source::Bytes;

/// The text of a sheet has no more than so many bytes for one of the unpacked file, and this many besides.
const GROWTH: u64 = 8;
const SPARE: u64 = 1 << 20;
/// No string of the table of strings has fewer bytes in the file.
const SHORTEST_STRING: u64 = 4;
/// Where the number of strings stands in their table, at most.
const HEAD: u64 = 4096;
/// This many names of sheets are told.
const MOST_TOLD: usize = 6;

/// A sheet as a text, and what the reader should know.
pub(super) struct Sheet {
    pub(super) text: Vec<u8>,
    pub(super) words: Vec<String>,
}

/// Why a workbook is not read.
enum Refusal {
    Data(String),
    Memory(String),
}

impl From<String> for Refusal {
    fn from(message: String) -> Self {
        Self::Data(message)
    }
}

/// Reads the sheet of a workbook that the options name, or the first that holds numbers.
///
/// # Errors
/// That the file cannot be read, is damaged or encrypted, is of another format, does not fit into memory, or has no
/// such sheet.
pub(super) fn read(bytes: Bytes, options: &Options) -> Result<Sheet, Error> {
    let file = bytes.name().to_owned();
    let bad = |message: String| Error::data(&file, None, message);
    for (option, given) in
        [("`delimiter`", options.delimiter.is_some()), ("`encoding`", options.encoding.is_some())]
    {
        if given {
            return Err(bad(format!(
                "{option} says how a text is written, and this is a spreadsheet; leave it out"
            )));
        }
    }
    let mut content = Vec::new();
    let read = bytes.into_reader().read_to_end(&mut content);
    read.map_err(|error| Error::io(&file, format!("cannot be read: {error}")))?;
    let options = options.clone();
    // The library is not known to be free of panics.
    let read = catch_unwind(move || chosen(&content, &options))
        .unwrap_or_else(|_| Err(damaged(&"it does not hold together").into()));
    read.map_err(|refusal| match refusal {
        Refusal::Data(message) => bad(message),
        Refusal::Memory(words) => Error::memory(&file, None, &words),
    })
}

fn damaged(error: &dyn std::fmt::Display) -> String {
    format!("this is no workbook that can be read ({error}); save it as xlsx again, or as CSV")
}

/// What there is to know of a workbook before it is read: how many bytes its parts have unpacked.
fn checked(content: &[u8]) -> Result<u64, Refusal> {
    const OTHER: &str = "this is no workbook in the format xlsx; save it as xlsx or as CSV";
    if !content.starts_with(b"PK") {
        return Err(Refusal::Data(OTHER.to_owned()));
    }
    let mut archive = ZipArchive::new(Cursor::new(content)).map_err(|error| damaged(&error))?;
    if archive.index_for_name("xl/workbook.xml").is_none() {
        return Err(Refusal::Data(OTHER.to_owned()));
    }
    let mut unpacked = 0_u64;
    for place in 0..archive.len() {
        let part = archive.by_index(place).map_err(|error| damaged(&error))?;
        unpacked = unpacked.saturating_add(part.size());
        if !part.name().is_ok_and(|name| name.to_lowercase().ends_with("sharedstrings.xml")) {
            continue;
        }
        let (size, mut head) = (part.size(), Vec::new());
        part.take(HEAD).read_to_end(&mut head).map_err(|error| damaged(&error))?;
        let head = String::from_utf8_lossy(&head);
        let known = head.find("<sst").or_else(|| head.find(":sst")).map(|at| stated(&head[at..]));
        if known.is_none_or(|known| known > size / SHORTEST_STRING) {
            return Err(damaged(&"it states more strings than it has").into());
        }
    }
    Ok(unpacked)
}

/// The largest number of strings that the head of their table states.
fn stated(head: &str) -> u64 {
    let numbers = head.match_indices("ount=").map(|(at, found)| {
        let digits = head[at + found.len()..].trim_start_matches(['"', '\'']);
        let end = digits.find(|c: char| !c.is_ascii_digit()).unwrap_or(digits.len());
        digits[..end].parse().unwrap_or(if end > 0 { u64::MAX } else { 0 })
    });
    numbers.max().unwrap_or(0)
}

/// The sheet that is wanted, or the first with numbers.
fn chosen(content: &[u8], options: &Options) -> Result<Sheet, Refusal> {
    let unpacked = checked(content)?;
    let most = unpacked.saturating_mul(GROWTH).saturating_add(SPARE);
    if let Some(words) = options.bound.and_then(|bound| bound.passed_by_bytes(most)) {
        return Err(Refusal::Memory(words));
    }
    let mut book = Xlsx::new(Cursor::new(content)).map_err(|error| damaged(&error))?;
    let names = book.sheet_names();
    if let Some(wanted) = &options.sheet {
        if !names.contains(wanted) {
            return Err(
                format!("there is no sheet '{}'; there are: {}", shown(wanted), listed(&names)).into()
            );
        }
        let Cells { text, .. } = Cells::of(&mut book, wanted, most)?;
        return Ok(Sheet { text: text.into_bytes(), words: Vec::new() });
    }
    let (mut found, mut others) = (None, Vec::new());
    for name in names {
        let cells = Cells::of(&mut book, &name, most)?;
        match &found {
            _ if !cells.has_numbers => {}
            Some(_) => others.push(name),
            None => found = Some((name, cells.text)),
        }
    }
    let (name, text) = found.ok_or_else(|| "no sheet holds numbers; record at least one row".to_owned())?;
    let words = match others.is_empty() {
        true => Vec::new(),
        false => {
            vec![format!("sheet '{}' is read; `sheet` names another one: {}", shown(&name), listed(&others))]
        }
    };
    Ok(Sheet { text: text.into_bytes(), words })
}

fn shown(name: &str) -> String {
    escaped(&shortened(name))
}

fn listed(names: &[String]) -> String {
    let more = if names.len() > MOST_TOLD { ", …" } else { "" };
    let first: Vec<String> = names.iter().take(MOST_TOLD).map(|name| shown(name)).collect();
    first.join(", ") + more
}

/// A sheet as a text whose lines are its rows, with tabs between the cells.
struct Cells {
    text: String,
    has_numbers: bool,
}

impl Cells {
    fn of(book: &mut Xlsx<Cursor<&[u8]>>, name: &str, most: u64) -> Result<Self, Refusal> {
        let mut reader = book.worksheet_cells_reader(name).map_err(|error| damaged(&error))?;
        let (mut rows, mut has_numbers, mut width, mut size) = (Vec::new(), false, 0, 0);
        while let Some(cell) = reader.next_cell().map_err(|error| damaged(&error))? {
            let ((row, column), value) = (cell.get_position(), cell.get_value());
            let text = written(value);
            if text.is_empty() {
                continue;
            }
            has_numbers |= matches!(value, DataRef::Int(_) | DataRef::Float(_));
            size += text.len() as u64;
            width = width.max(u64::from(column) + 1);
            rows.push((row, column, text));
        }
        rows.sort_unstable_by_key(|(row, column, _)| (*row, *column));
        rows.dedup_by_key(|(row, column, _)| (*row, *column));
        let last = rows.last().map_or(0, |(row, ..)| u64::from(*row) + 1);
        if size.saturating_add(last.saturating_mul(width)) > most {
            return Err(damaged(&"its cells are too far apart").into());
        }
        let (mut text, mut cells) = (String::new(), rows.into_iter().peekable());
        for row in 0..last {
            // A row without cells is a blank line.
            let mut next = 0;
            while let Some((_, column, value)) = cells.next_if(|(own, ..)| u64::from(*own) == row) {
                text.extend(std::iter::repeat_n('\t', (u64::from(column) - next) as usize));
                text.push_str(&value);
                next = u64::from(column);
            }
            if next > 0 || text.ends_with(|c| c != '\n') {
                text.extend(std::iter::repeat_n('\t', (width - 1 - next) as usize));
            }
            text.push('\n');
        }
        Ok(Self { text, has_numbers })
    }
}

/// A cell as a field of a text.
fn written(cell: &DataRef<'_>) -> String {
    match cell {
        DataRef::Empty => String::new(),
        DataRef::Int(value) => value.to_string(),
        DataRef::Float(value) => value.to_string(),
        DataRef::Bool(value) => value.to_string(),
        DataRef::Error(error) => error.to_string(),
        DataRef::DateTime(time) => date(time),
        DataRef::String(words) | DataRef::DateTimeIso(words) | DataRef::DurationIso(words) => field(words),
        DataRef::SharedString(words) => field(words),
    }
}

fn field(words: &str) -> String {
    match words.contains(['\t', '\n', '\r', '"']) {
        true => format!("\"{}\"", words.replace('"', "\"\"")),
        false => words.trim().to_owned(),
    }
}

/// A date, a date and time, a time of day, or a duration in seconds.
fn date(time: &ExcelDateTime) -> String {
    let days = time.as_f64();
    if time.is_duration() {
        return (days * 86_400.0).to_string();
    }
    let (year, month, day, hour, minute, second, milli) = time.to_ymd_hms_milli();
    let mut of_day = format!("{hour:02}:{minute:02}:{second:02}");
    if milli > 0 {
        // Writing to a text does not fail.
        let _ = write!(of_day, ".{milli:03}");
    }
    match (days < 1.0, (hour, minute, second, milli) == (0, 0, 0, 0)) {
        (true, _) => of_day,
        (false, true) => format!("{year:04}-{month:02}-{day:02}"),
        (false, false) => format!("{year:04}-{month:02}-{day:02} {of_day}"),
    }
}

#[cfg(test)]
mod tests;
