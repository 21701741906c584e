//! Output that grows line by line, as JSON Lines or as CSV: both have the same columns.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Stdout, Write};
use std::path::{Path, PathBuf};

use thetahat::text;

use crate::failure::Failure;
use crate::{interrupt, output, replace};

/// How a line is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    /// An object a line. What a line does not have is left out.
    JsonLines,
    /// A row a line, below a header.
    Csv,
}

/// A file is recognised by this many of its last bytes.
const KNOWN_BY: usize = 48;

/// This many bytes are written at once, where nobody waits for them.
const FULL: usize = 1 << 16;

/// A file or standard output, and the lines on their way to it. Only whole lines are ever written.
pub(crate) struct LineWriter {
    path: PathBuf,
    sink: Sink,
    format: Format,
    /// The columns as each format writes them.
    columns: Vec<Column>,
    buffer: Vec<u8>,
    written: Written,
    /// Where a file that is gone on with has to be cut off first.
    cut: Option<u64>,
}

/// How much a stream of lines has come to.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(crate) struct Written {
    /// The lines, the header of a CSV included.
    pub(crate) lines: u64,
    /// Their bytes.
    pub(crate) bytes: u64,
    /// The last of them, as they were handed over: what a file is known by.
    end: Vec<u8>,
}

impl Written {
    /// Whether its numbers fit together.
    pub(crate) fn is_sound(&self) -> bool {
        self.lines <= self.bytes && self.end.len() as u64 == self.bytes.min(KNOWN_BY as u64)
    }
}

enum Sink {
    Stdout(Stdout),
    File(File),
    /// Lines are counted alone.
    None,
}

struct Column {
    /// `"name":`
    key: Vec<u8>,
    /// The name as CSV has it.
    title: Vec<u8>,
}

impl LineWriter {
    /// Begins a file, or standard output for `-`, with these columns.
    pub(crate) fn create(path: &Path, format: Format, names: &[String]) -> Result<Self, Failure> {
        let sink = if path == Path::new("-") {
            Sink::Stdout(io::stdout())
        } else {
            let failed = |error| Failure::io(path, "cannot be written", &error);
            let mut options = OpenOptions::new();
            // It is emptied only once nobody else writes it.
            let file = options.write(true).create(true).truncate(false).open(path).map_err(failed)?;
            if is_file(&file) {
                replace::lock(path, &file)?;
                file.set_len(0).map_err(failed)?;
            }
            Sink::File(file)
        };
        let mut lines = Self::begin(path, sink, format, names, Written::default());
        lines.head();
        Ok(lines)
    }

    /// Counts the lines that would be written: from the first one on, or beyond those that an earlier run has counted.
    pub(crate) fn counting(format: Format, names: &[String], written: Option<Written>) -> Self {
        let anew = written.is_none();
        let mut lines = Self::begin(Path::new(""), Sink::None, format, names, written.unwrap_or_default());
        if anew {
            lines.head();
        }
        lines
    }

    /// What a line is.
    pub(crate) fn format(&self) -> Format {
        self.format
    }

    /// The header of a CSV.
    fn head(&mut self) {
        if self.format != Format::Csv {
            return;
        }
        for (index, column) in self.columns.iter().enumerate() {
            if index > 0 {
                self.buffer.push(b',');
            }
            self.buffer.extend_from_slice(&column.title);
        }
        self.buffer.push(b'\n');
        self.written = Written { lines: 1, bytes: self.buffer.len() as u64, ..Written::default() };
    }

    /// Goes on where an earlier run saved that it was: what a file has beyond that is taken off when the next line
    /// comes.
    pub(crate) fn resume(
        path: &Path,
        format: Format,
        names: &[String],
        written: Written,
    ) -> Result<Self, Failure> {
        if path == Path::new("-") {
            return Ok(Self::begin(path, Sink::Stdout(io::stdout()), format, names, written));
        }
        let failed = |error| Failure::io(path, "cannot be written", &error);
        let other = |what: String| {
            let lines = written.lines;
            Failure::data(format!(
                "{}: {what}, but the state says that {lines} lines of it were written; give the file that goes with the state, \
                 or another --state",
                path.display()
            ))
        };
        let opened = OpenOptions::new().read(true).write(true).open(path);
        let mut file = opened.map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => other("it is not there".to_owned()),
            _ => failed(error),
        })?;
        let metadata = file.metadata().map_err(failed)?;
        let cut = metadata.is_file().then_some(written.bytes);
        if cut.is_some() {
            replace::lock(path, &file)?;
            let known = (written.end.len() as u64).min(written.bytes);
            if metadata.len() < written.bytes {
                return Err(other(format!("it has {} bytes", metadata.len())));
            }
            let mut end = vec![0; known as usize];
            file.seek(SeekFrom::Start(written.bytes - known)).map_err(failed)?;
            file.read_exact(&mut end).map_err(failed)?;
            if end != written.end {
                return Err(other("it holds something else".to_owned()));
            }
        }
        let lines = Self::begin(path, Sink::File(file), format, names, written);
        Ok(Self { cut, ..lines })
    }

    fn begin(path: &Path, sink: Sink, format: Format, names: &[String], written: Written) -> Self {
        let columns = names
            .iter()
            .map(|name| Column { key: format!("{}:", text::json(name)).into_bytes(), title: quoted(name) });
        Self {
            path: path.to_owned(),
            sink,
            format,
            columns: columns.collect(),
            buffer: Vec::new(),
            written,
            cut: None,
        }
    }

    /// What was written so far, the lines that still wait included.
    pub(crate) fn written(&self) -> Written {
        self.written.clone()
    }

    /// Adds a line; `fill` gives its cells from the first column on. Those it does not reach are empty.
    pub(crate) fn add(&mut self, fill: impl FnOnce(&mut Cells<'_>)) -> Result<(), Failure> {
        let before = self.buffer.len();
        let mut cells = Cells { lines: &mut *self, column: 0, any: false };
        fill(&mut cells);
        cells.end();
        self.written.lines = self.written.lines.saturating_add(1);
        self.written.bytes = self.written.bytes.saturating_add((self.buffer.len() - before) as u64);
        if self.buffer.len() >= FULL { self.flush() } else { Ok(()) }
    }

    /// Hands all lines over to the system.
    pub(crate) fn flush(&mut self) -> Result<(), Failure> {
        if self.buffer.is_empty() {
            return Ok(());
        }
        if !matches!(self.sink, Sink::None) {
            interrupt::writing();
        }
        let written = match &mut self.sink {
            Sink::None => Ok(()),
            Sink::Stdout(stdout) => {
                let mut stdout = stdout.lock();
                stdout.write_all(&self.buffer).and_then(|()| stdout.flush())
            }
            Sink::File(file) => match self.cut.take() {
                Some(bytes) => file.set_len(bytes).and_then(|()| file.seek(SeekFrom::End(0)).map(drop)),
                None => Ok(()),
            }
            .and_then(|()| file.write_all(&self.buffer)),
        };
        let end = &mut self.written.end;
        end.extend_from_slice(&self.buffer[self.buffer.len().saturating_sub(KNOWN_BY)..]);
        end.drain(..end.len().saturating_sub(KNOWN_BY));
        self.buffer.clear();
        written.map_err(|error| Failure::io(&self.shown(), "cannot be written", &error))
    }

    /// Brings all lines to the disk.
    pub(crate) fn sync(&mut self) -> Result<(), Failure> {
        self.flush()?;
        if let Sink::File(file) = &self.sink
            && is_file(file)
        {
            return file.sync_data().map_err(|error| Failure::io(&self.path, "cannot be written", &error));
        }
        Ok(())
    }

    fn shown(&self) -> PathBuf {
        if self.path == Path::new("-") { "standard output".into() } else { self.path.clone() }
    }
}

/// The cells of a line, column by column.
pub(crate) struct Cells<'a> {
    lines: &'a mut LineWriter,
    column: usize,
    any: bool,
}

impl Cells<'_> {
    /// A number. What is not a number is null, or empty.
    pub(crate) fn number(&mut self, value: f64) {
        let csv = self.lines.format == Format::Csv;
        self.cell(|buffer| match value.is_finite() {
            // A vector takes all that is written to it. Adding 0 makes -0 a plain 0.
            true => drop(serde_json::to_writer(buffer, &(value + 0.0))),
            false if csv => {}
            false => buffer.extend_from_slice(b"null"),
        });
    }

    /// A count.
    pub(crate) fn count(&mut self, value: u64) {
        self.cell(|buffer| drop(serde_json::to_writer(buffer, &value)));
    }

    /// A word.
    pub(crate) fn word(&mut self, word: &str) {
        let csv = self.lines.format == Format::Csv;
        // Words are short, and plain but for names: that is seen sooner than they are copied through a writer.
        let plain = word.bytes().all(|byte| byte.is_ascii_alphanumeric() || b" _:.".contains(&byte));
        self.cell(|buffer| match (csv, plain) {
            (true, true) => buffer.extend_from_slice(word.as_bytes()),
            (true, false) => buffer.extend_from_slice(&quoted(word)),
            (false, true) => drop(serde_json::to_writer(buffer, word)),
            (false, false) => buffer.extend_from_slice(text::json(word).as_bytes()),
        });
    }

    /// Nothing in this many columns.
    pub(crate) fn skip(&mut self, columns: usize) {
        for _ in 0..columns {
            if self.lines.format == Format::Csv {
                self.cell(|_| ());
            } else {
                self.column += 1;
            }
        }
    }

    fn cell(&mut self, write: impl FnOnce(&mut Vec<u8>)) {
        let LineWriter { buffer, columns, format, .. } = &mut *self.lines;
        let Some(column) = columns.get(self.column) else { return };
        match format {
            Format::JsonLines => {
                buffer.push(if self.any { b',' } else { b'{' });
                buffer.extend_from_slice(&column.key);
            }
            Format::Csv if self.any => buffer.push(b','),
            Format::Csv => {}
        }
        self.any = true;
        self.column += 1;
        write(buffer);
    }

    fn end(mut self) {
        self.skip(self.lines.columns.len().saturating_sub(self.column));
        match self.lines.format {
            Format::JsonLines => self.lines.buffer.extend_from_slice(b"}\n"),
            Format::Csv => self.lines.buffer.push(b'\n'),
        }
    }
}

/// Whether it is no device and no pipe.
fn is_file(file: &File) -> bool {
    file.metadata().is_ok_and(|metadata| metadata.is_file())
}

/// A name as a field of a CSV: [`output::cell`], between quotes if it needs them (RFC 4180).
fn quoted(name: &str) -> Vec<u8> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    // A vector takes all that is written to it.
    let _ = csv.write_record([output::cell(name)]);
    let mut field = csv.into_inner().unwrap_or_default();
    field.pop();
    field
}
