//! MATLAB files (level 5, as `save` writes with -v6 or -v7): the variables of one length as a text with tabs, which is
//! then read as any other.
//!
//! The format is that of "MAT-File Format" (The MathWorks), level 5. A damaged file must not ask for more memory than
//! there is: sizes are compared with what is there before they are believed.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::io::Read;

use flate2::read::ZlibDecoder;

use super::Options;
use super::error::{Error, escaped, shortened};
use super::source::Bytes;

/// How a file begins, and one of the format that came after it.
const HEAD: usize = 128;
const HDF: &[u8] = b"MATLAB 7.3";
/// What is unpacked at once.
const PIECE: usize = 1 << 20;
/// This many variables are told.
const MOST_TOLD: usize = 6;
/// A file has no more columns than this.
const MOST_COLUMNS: usize = 1 << 16;

/// The variables of one length as a text, and what the reader should know.
pub(super) struct Variables {
    pub(super) text: Vec<u8>,
    pub(super) words: Vec<String>,
}

/// Reads the variables of the length that most columns have.
///
/// # Errors
/// That the file cannot be read, is of another format, holds no such variables, or does not fit into memory.
pub(super) fn read(bytes: Bytes, options: &Options) -> Result<Variables, Error> {
    let file = bytes.name().to_owned();
    let bad = |message: String| Error::data(&file, None, message);
    if let Some(option) = options.of_texts() {
        return Err(bad(format!(
            "{option} says how a text is written, and this is a MATLAB file; leave it out"
        )));
    }
    let content = held(bytes.into_reader(), &file, options)?;
    if content.starts_with(HDF) {
        return Err(bad(
            "it is a MATLAB file of version 7.3, which is another format; save it with -v7".to_owned()
        ));
    }
    let is_little = match content.get(126..HEAD) {
        Some(b"IM") => true,
        Some(b"MI") => false,
        _ => return Err(bad("it is a MATLAB file that ends in its head; save it again with -v7".to_owned())),
    };
    let mut found = Found { is_little, ..Found::default() };
    found.elements(&content[HEAD..], &file, options)?;
    found.table(&file)
}

/// The whole of a stream, if there is memory for it.
fn held(mut reader: impl Read, file: &str, options: &Options) -> Result<Vec<u8>, Error> {
    let (mut held, mut piece) = (Vec::new(), vec![0; PIECE]);
    loop {
        let count = match reader.read(&mut piece) {
            Ok(0) => return Ok(held),
            Ok(count) => count,
            Err(error) => {
                return Err(Error::io(file, format!("cannot be read: {error}; save it again with -v7")));
            }
        };
        let words = options.bound.and_then(|bound| bound.passed_by_file((held.len() + count) as u64));
        let words = words.or_else(|| held.try_reserve(count).err().map(|error| error.to_string()));
        if let Some(words) = words {
            return Err(Error::memory(file, None, &words));
        }
        held.extend_from_slice(&piece[..count]);
    }
}

/// A variable: a vector, or the columns of a matrix.
struct Variable {
    name: String,
    rows: usize,
    values: Vec<f64>,
}

impl Variable {
    fn columns(&self) -> usize {
        self.values.len() / self.rows.max(1)
    }
}

/// What a variable is.
enum Matrix {
    /// A full real matrix of numbers.
    Numbers(Variable),
    /// Anything else, by its name.
    Other(String),
}

/// What is in a file.
#[derive(Default)]
struct Found {
    is_little: bool,
    variables: Vec<Variable>,
    /// Variables that are no full real matrices of numbers.
    others: Vec<String>,
    is_cut: bool,
}

/// The types of elements.
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;

/// An element: its type and its data.
type Element<'b> = (u32, &'b [u8]);

impl Found {
    fn u32(&self, bytes: &[u8], at: usize) -> Option<u32> {
        let bytes: [u8; 4] = bytes.get(at..at.checked_add(4)?)?.try_into().ok()?;
        Some(if self.is_little { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) })
    }

    /// The element that bytes begin with, and what follows; none where they end before it does.
    fn element<'b>(&self, bytes: &'b [u8]) -> Option<(Element<'b>, &'b [u8])> {
        let first = self.u32(bytes, 0)?;
        // Up to four bytes stand in the tag itself.
        if first >> 16 != 0 {
            let data = bytes.get(4..4 + (first >> 16) as usize).filter(|data| data.len() <= 4)?;
            return Some(((first & 0xffff, data), bytes.get(8..)?));
        }
        let size = self.u32(bytes, 4)? as usize;
        let end = 8_usize.checked_add(size)?;
        let data = bytes.get(8..end)?;
        // All but packed ones end at a multiple of eight bytes; the last may not.
        let next = if first == COMPRESSED { end } else { end.checked_add(7)? & !7 };
        Some(((first, data), bytes.get(next..).unwrap_or_default()))
    }

    fn elements(&mut self, mut bytes: &[u8], file: &str, options: &Options) -> Result<(), Error> {
        while !bytes.is_empty() {
            let Some(((kind, data), rest)) = self.element(bytes) else {
                self.is_cut = true;
                return Ok(());
            };
            bytes = rest;
            match kind {
                MATRIX => self.variable(data, file)?,
                COMPRESSED => match held(ZlibDecoder::new(data), file, options) {
                    Ok(unpacked) => match self.element(&unpacked) {
                        Some(((MATRIX, data), _)) => self.variable(data, file)?,
                        Some(_) => {}
                        None => self.is_cut = true,
                    },
                    Err(error) if error.kind() == super::ErrorKind::Memory => return Err(error),
                    Err(_) => self.is_cut = true,
                },
                _ => {}
            }
        }
        Ok(())
    }

    fn variable(&mut self, data: &[u8], file: &str) -> Result<(), Error> {
        match self.matrix(data) {
            None => self.is_cut = true,
            Some(Matrix::Other(name)) => self.others.push(name),
            Some(Matrix::Numbers(variable)) => {
                let columns: usize = self.variables.iter().map(Variable::columns).sum();
                if columns.saturating_add(variable.columns()) > MOST_COLUMNS {
                    let message = format!(
                        "it has more than {MOST_COLUMNS} columns; save fewer variables, each with a row for each sample"
                    );
                    return Err(Error::data(file, None, message));
                }
                self.variables.push(variable);
            }
        }
        Ok(())
    }

    /// None for a variable that does not hold together.
    fn matrix(&self, data: &[u8]) -> Option<Matrix> {
        const IS_COMPLEX: u32 = 0x800;
        let ((_, flags), rest) = self.element(data)?;
        let flags = self.u32(flags, 0)?;
        // Objects have no dimensions here.
        if flags & 0xff > 15 {
            return Some(Matrix::Other("an object".to_owned()));
        }
        let ((_, sizes), rest) = self.element(rest)?;
        let ((_, name), rest) = self.element(rest)?;
        let name = String::from_utf8_lossy(name).into_owned();
        let size = |place: usize| self.u32(sizes, 4 * place).map(|size| size as usize);
        let sizes: Option<Vec<usize>> = (0..sizes.len() / 4).map(size).collect();
        // Doubles, singles and whole numbers, and what is logical among these.
        let (&[rows, columns], 6..=15, 0) = (sizes?.as_slice(), flags & 0xff, flags & IS_COMPLEX) else {
            return Some(Matrix::Other(name));
        };
        let ((kind, values), _) = self.element(rest)?;
        let values = self.numbers(kind, values)?;
        if rows.checked_mul(columns)? != values.len() {
            return None;
        }
        // A row is a vector as well.
        let rows = if rows == 1 { columns } else { rows };
        Some(Matrix::Numbers(Variable { name, rows, values }))
    }

    fn numbers(&self, kind: u32, data: &[u8]) -> Option<Vec<f64>> {
        /// The numbers of a type, in one order of bytes or the other.
        macro_rules! of {
            ($type:ty) => {{
                const SIZE: usize = size_of::<$type>();
                let (parts, _) = data.as_chunks::<SIZE>();
                let number = |part: &[u8; SIZE]| match self.is_little {
                    true => <$type>::from_le_bytes(*part) as f64,
                    false => <$type>::from_be_bytes(*part) as f64,
                };
                parts.iter().map(number).collect()
            }};
        }
        Some(match kind {
            1 => of!(i8),
            2 => of!(u8),
            3 => of!(i16),
            4 => of!(u16),
            5 => of!(i32),
            6 => of!(u32),
            7 => of!(f32),
            9 => of!(f64),
            12 => of!(i64),
            13 => of!(u64),
            _ => return None,
        })
    }

    /// The variables of the length that most columns have, of the longest if several have as many.
    fn table(self, file: &str) -> Result<Variables, Error> {
        let lengths = self.variables.iter().map(|variable| variable.rows).filter(|rows| *rows > 1);
        let columns = |rows: usize| -> usize {
            self.variables.iter().filter(|variable| variable.rows == rows).map(Variable::columns).sum()
        };
        let Some(rows) = lengths.max_by_key(|&rows| (columns(rows), rows)) else {
            let why = if self.is_cut { "it is damaged, or ends too early" } else { "there is none" };
            return Err(Error::data(
                file,
                None,
                format!(
                    "it should hold vectors of numbers, one value for each sample, and {why}; save them with -v7"
                ),
            ));
        };
        let mut words = Vec::new();
        if self.is_cut {
            words.push("a variable ends too early or is damaged, and is left out".to_owned());
        }
        if !self.others.is_empty() {
            words.push(format!(
                "variables that are no full real matrices of numbers are left out, such as texts, cells and structures (save \
                 their fields as variables): {}",
                listed(self.others.iter().map(|name| escaped(&shortened(name))))
            ));
        }
        let lengths = self.variables.iter().filter(|variable| variable.rows != rows);
        let lengths =
            listed(lengths.map(|other| format!("{} ({})", escaped(&shortened(&other.name)), other.rows)));
        if !lengths.is_empty() {
            words.push(format!("the variables of {rows} rows are read, and others left out: {lengths}"));
        }
        let mut names: Vec<Cow<'_, str>> = Vec::new();
        let mut all: Vec<&[f64]> = Vec::new();
        for variable in self.variables.iter().filter(|variable| variable.rows == rows) {
            let several = variable.columns() > 1;
            for (place, column) in variable.values.chunks(rows).enumerate() {
                names.push(match several {
                    true => Cow::Owned(format!("{}_{}", variable.name, place + 1)),
                    false => Cow::Borrowed(&variable.name),
                });
                all.push(column);
            }
        }
        let mut text = String::new();
        let quoted = |name: &Cow<'_, str>| format!("\"{}\"", name.replace('"', "\"\""));
        text.push_str(&names.iter().map(quoted).collect::<Vec<_>>().join("\t"));
        text.push('\n');
        for row in 0..rows {
            for (place, column) in all.iter().enumerate() {
                if place > 0 {
                    text.push('\t');
                }
                // Writing to a text does not fail. The number reads as it is.
                let _ = write!(text, "{}", column[row]);
            }
            text.push('\n');
        }
        Ok(Variables { text: text.into_bytes(), words })
    }
}

/// Names as a message lists them, not all of very many.
fn listed(names: impl Iterator<Item = String>) -> String {
    let mut names: Vec<String> = names.collect();
    let more = names.len().saturating_sub(MOST_TOLD);
    names.truncate(MOST_TOLD);
    if more > 0 { format!("{} and {more} more", names.join(", ")) } else { names.join(", ") }
}

#[cfg(test)]
mod tests;
