//! Batches of rows from the files and streams that hold them.

use std::cell::Cell;
use std::fs::File;
use std::io::{self, BufReader, Cursor, Read};
use std::panic::{self, AssertUnwindSafe};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Once};

use arrow_array::RecordBatch;
use arrow_ipc::reader::StreamReader;
use arrow_schema::{ArrowError, SchemaRef};
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{
    ArrowReaderMetadata, ArrowReaderOptions, ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder,
};

use super::super::error::{Error, escaped};
use super::super::source::{Bytes, Format};

/// The rows of a batch of Parquet, at most. What Arrow writes comes as it was written.
const BATCH: usize = 1 << 14;

/// How an Arrow file begins and ends.
const MARK: &[u8] = b"ARROW1";
/// What is between the beginning of a file and its first message is filled up with zeros to a multiple of this.
const ALIGNMENT: usize = 8;

/// A format, with its article.
pub(super) fn named(format: Format) -> &'static str {
    match format {
        Format::Parquet | Format::EncryptedParquet => "a Parquet file",
        Format::ArrowFile => "an Arrow file",
        Format::ArrowStream => "an Arrow stream",
        Format::Feather1 => "a Feather file",
    }
}

/// A file or stream whose schema was read.
pub(super) enum Opened {
    Parquet {
        name: String,
        file: File,
        length: u64,
        metadata: ArrowReaderMetadata,
    },
    Arrow {
        name: String,
        /// From the schema on.
        bytes: Box<dyn Read + Send>,
        /// Whether it ends as a file does.
        is_file: bool,
        bytes_read: Arc<AtomicU64>,
        total: Option<u64>,
    },
}

impl Opened {
    pub(super) fn new(path: &Path, bytes: Bytes, format: Format) -> Result<(Self, SchemaRef), Error> {
        let name = bytes.name().to_owned();
        let refusal = |message: &str| Err(Error::data(&name, None, message));
        match format {
            Format::EncryptedParquet => {
                refusal("this Parquet file is encrypted; write it without encryption")
            }
            Format::Feather1 => {
                refusal("this is a Feather file of version 1; write it as version 2, which is an Arrow file")
            }
            Format::Parquet if path == Path::new("-") => refusal(
                "a Parquet file is read from its end, where its directory is, so it cannot come through a pipe; name the file, or \
                 send an Arrow stream",
            ),
            Format::Parquet if bytes.is_gzip() => refusal(
                "this Parquet file was compressed as a whole, and is read from its end; unpack it (gunzip)",
            ),
            Format::Parquet => Self::parquet(path.to_owned(), name),
            Format::ArrowFile | Format::ArrowStream => {
                let is_file = format == Format::ArrowFile;
                let (bytes_read, total) = bytes.progress();
                let bytes = bytes.into_reader();
                // What it is made of has a few bytes each.
                let mut bytes: Box<dyn Read + Send> = Box::new(BufReader::with_capacity(1 << 16, bytes));
                if is_file {
                    bytes = after_mark(bytes).map_err(|error| unread(&name, &error))?;
                }
                let mut kept = Kept { bytes, copy: Vec::new() };
                let schema = guarded(|| StreamReader::try_new(&mut kept, None).map(|reader| reader.schema()))
                    .map_err(|error| damaged(&name, 0, &error))?;
                let bytes = Box::new(Cursor::new(kept.copy).chain(kept.bytes));
                Ok((Self::Arrow { name, bytes, is_file, bytes_read, total }, schema))
            }
        }
    }

    fn parquet(path: PathBuf, name: String) -> Result<(Self, SchemaRef), Error> {
        let opened = File::open(path).and_then(|file| {
            let length = file.metadata()?.len();
            Ok((file, length))
        });
        let (file, length) = opened.map_err(|error| unread(&name, &error))?;
        let load = || Ok(ArrowReaderMetadata::load(&file, ArrowReaderOptions::new())?);
        let metadata = guarded(load).map_err(|error| {
            let reason = escaped(&error.to_string());
            Error::data(
                &name,
                None,
                format!("this is no whole Parquet file ({reason}); copy it again, or write it anew"),
            )
        })?;
        let schema = Arc::clone(metadata.schema());
        Ok((Self::Parquet { name, file, length, metadata }, schema))
    }

    /// How many rows there are, if it is known.
    pub(super) fn rows(&self) -> Option<usize> {
        match self {
            Self::Parquet { metadata, .. } => {
                usize::try_from(metadata.metadata().file_metadata().num_rows()).ok()
            }
            Self::Arrow { .. } => None,
        }
    }

    /// The rows of some columns, given in ascending order; an error is a message.
    pub(super) fn batches(self, columns: &[usize]) -> Result<Batches, String> {
        let rows = self.rows().unwrap_or(0) as u64;
        match self {
            Self::Parquet { name, file, length, metadata } => {
                let mask = ProjectionMask::roots(metadata.parquet_schema(), columns.iter().copied());
                let builder = ParquetRecordBatchReaderBuilder::new_with_metadata(file, metadata);
                let build = || Ok(builder.with_projection(mask).with_batch_size(BATCH).build()?);
                let reader = guarded(build)
                    .map_err(|error| format!("it cannot be read: {}", escaped(&error.to_string())))?;
                Ok(Batches {
                    name,
                    rows: 0,
                    form: Form::Parquet { reader: Box::new(reader), length, of: rows },
                })
            }
            Self::Arrow { name, bytes, is_file, bytes_read, total } => {
                let reader = guarded(|| StreamReader::try_new(bytes, Some(columns.to_vec())))
                    .map_err(|error| escaped(&error.to_string()))?;
                let form = Form::Arrow { reader: Box::new(reader), is_file, bytes_read, total };
                Ok(Batches { name, rows: 0, form })
            }
        }
    }
}

/// The rows of some columns, batch by batch.
pub(super) struct Batches {
    /// The file's name, for messages.
    name: String,
    /// How many rows came.
    rows: u64,
    form: Form,
}

enum Form {
    Parquet {
        reader: Box<ParquetRecordBatchReader>,
        length: u64,
        /// How many rows there are.
        of: u64,
    },
    Arrow {
        reader: Box<StreamReader<Box<dyn Read + Send>>>,
        is_file: bool,
        bytes_read: Arc<AtomicU64>,
        total: Option<u64>,
    },
}

impl Batches {
    /// The number of bytes read so far, and of how many if that is known.
    pub(super) fn progress(&self) -> (u64, Option<u64>) {
        match &self.form {
            Form::Parquet { length, of, .. } => {
                let share = self.rows as f64 / (*of).max(1) as f64;
                ((*length as f64 * share) as u64, Some(*length))
            }
            Form::Arrow { bytes_read, total, .. } => (bytes_read.load(Ordering::Relaxed), *total),
        }
    }

    /// Whether an Arrow file ends as it must: it was cut off if not.
    fn check_end(&mut self) -> Option<Error> {
        let Form::Arrow { reader, is_file: true, .. } = &mut self.form else { return None };
        let mut end = Vec::new();
        match reader.get_mut().read_to_end(&mut end) {
            Err(error) => Some(unread(&self.name, &error)),
            Ok(_) if end.ends_with(MARK) => None,
            Ok(_) => Some(cut_off(&self.name, self.rows)),
        }
    }
}

impl Iterator for Batches {
    type Item = Result<RecordBatch, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        let batch = match &mut self.form {
            Form::Parquet { reader, .. } => guarded(|| reader.next().transpose()).transpose(),
            Form::Arrow { reader, .. } => guarded(|| reader.next().transpose()).transpose(),
        };
        match batch {
            Some(Ok(batch)) => {
                self.rows += batch.num_rows() as u64;
                Some(Ok(batch))
            }
            Some(Err(error)) => Some(Err(damaged(&self.name, self.rows, &error))),
            None => self.check_end().map(Err),
        }
    }
}

/// Does what reads a file, whose libraries panic about some damages: that is an error as any other, and nothing is printed.
fn guarded<T>(work: impl FnOnce() -> Result<T, ArrowError>) -> Result<T, ArrowError> {
    thread_local! {
        static GUARDED: Cell<bool> = const { Cell::new(false) };
    }
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let others = panic::take_hook();
        panic::set_hook(Box::new(move |panic| {
            if !GUARDED.get() {
                others(panic);
            }
        }));
    });
    GUARDED.set(true);
    // What was at work is given up.
    let done = panic::catch_unwind(AssertUnwindSafe(work));
    GUARDED.set(false);
    done.unwrap_or_else(|_| {
        Err(ArrowError::ParseError("what it says of itself does not fit together".to_owned()))
    })
}

/// The bytes of an Arrow file after its mark, which zeros fill up.
fn after_mark(mut bytes: Box<dyn Read + Send>) -> io::Result<Box<dyn Read + Send>> {
    let mut block = [0; ALIGNMENT];
    bytes.read_exact(&mut block)?;
    loop {
        bytes.read_exact(&mut block)?;
        if block != [0; ALIGNMENT] {
            return Ok(Box::new(Cursor::new(block).chain(bytes)));
        }
    }
}

/// A stream of which a copy is kept.
struct Kept {
    bytes: Box<dyn Read + Send>,
    copy: Vec<u8>,
}

impl Read for Kept {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.bytes.read(buffer)?;
        self.copy.extend_from_slice(buffer.get(..count).unwrap_or_default());
        Ok(count)
    }
}

fn unread(name: &str, error: &io::Error) -> Error {
    match error.kind() {
        io::ErrorKind::UnexpectedEof => cut_off(name, 0),
        _ => Error::io(name, format!("cannot be read: {error}")),
    }
}

fn cut_off(name: &str, rows: u64) -> Error {
    let message = format!("the file ends too early, after {rows} whole rows: it is truncated; copy it again");
    Error::data(name, None, message)
}

/// Says what an error of a reader means after so many rows.
fn damaged(name: &str, rows: u64, error: &ArrowError) -> Error {
    match error {
        ArrowError::IoError(_, error) if error.kind() == io::ErrorKind::UnexpectedEof => cut_off(name, rows),
        ArrowError::IoError(_, error) => Error::io(name, format!("cannot be read: {error}")),
        error => {
            let reason = escaped(&error.to_string());
            let message =
                format!("the file is damaged after {rows} rows ({reason}); copy it again, or write it anew");
            Error::data(name, None, message)
        }
    }
}
