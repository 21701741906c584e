//! Batches of rows from the files and streams that hold them.

use std::cell::Cell;
use std::fs::File;
use std::io::{self, BufReader, Cursor, Read, Seek, SeekFrom};
use std::panic::{self, AssertUnwindSafe};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Once};

use arrow_array::RecordBatch;
use arrow_ipc::reader::{FileReader, StreamReader};
use arrow_schema::{ArrowError, SchemaRef};
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{
    ArrowReaderMetadata, ArrowReaderOptions, ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder,
};

use super::super::error::{Error, escaped};
use super::super::memory::Bound;
use super::super::source::{Bytes, Columnar};
use super::footer;
use super::messages::{Blocks, Limits, Messages};

/// The header of a page of Parquet is shorter, but for long texts among its statistics.
const PAGE_HEADER: u64 = 1 << 12;
/// The rows of a batch of Parquet, at most. What Arrow writes comes as it was written.
const BATCH: usize = 1 << 14;

/// A format, with its article.
pub(super) fn named(format: Columnar) -> &'static str {
    match format {
        Columnar::Parquet | Columnar::EncryptedParquet => "a Parquet file",
        Columnar::ArrowFile => "an Arrow file",
        Columnar::ArrowStream => "an Arrow stream",
        Columnar::Feather1 => "a Feather file",
    }
}

/// A file or stream whose schema was read.
pub(super) enum Opened {
    Parquet {
        name: String,
        file: File,
        length: u64,
        bound: Option<Bound>,
        metadata: ArrowReaderMetadata,
    },
    File {
        name: String,
        file: File,
        length: u64,
        schema: SchemaRef,
        blocks: Option<Blocks>,
    },
    Stream {
        name: String,
        schema: SchemaRef,
        /// What was read for the schema, and what follows.
        start: Vec<u8>,
        bytes: Messages<BufReader<Box<dyn Read + Send>>>,
        bytes_read: Arc<AtomicU64>,
        total: Option<u64>,
    },
}

impl Opened {
    pub(super) fn new(
        path: &Path,
        bytes: Bytes,
        format: Columnar,
        bound: Option<Bound>,
    ) -> Result<(Self, SchemaRef), Error> {
        let name = bytes.name().to_owned();
        let refusal = |message: String| Err(Error::data(&name, None, message));
        match format {
            Columnar::EncryptedParquet => {
                refusal("this Parquet file is encrypted; write it without encryption".to_owned())
            }
            Columnar::Feather1 => refusal(
                "this is a Feather file of version 1; write it as version 2, which is an Arrow file"
                    .to_owned(),
            ),
            Columnar::Parquet | Columnar::ArrowFile
                if path == Path::new("-") || bytes.progress().1.is_none() =>
            {
                refusal(format!(
                    "{} is read from its end, where its directory is, so it cannot come through a pipe; name the file, or send an \
                 Arrow stream",
                    named(format)
                ))
            }
            Columnar::Parquet | Columnar::ArrowFile if bytes.is_gzip() => refusal(format!(
                "{} is read from its end, and this one was compressed as a whole; unpack it (gunzip)",
                named(format)
            )),
            Columnar::Parquet => Self::parquet(path, name, bound),
            Columnar::ArrowFile => Self::file(path, name, Limits::new(bound)),
            Columnar::ArrowStream => {
                let (bytes_read, total) = bytes.progress();
                // A message begins with a few bytes each.
                let bytes = BufReader::with_capacity(1 << 16, bytes.into_reader());
                let bytes = Messages::new(bytes, Limits::new(bound));
                let mut kept = Kept { bytes, copy: Vec::new() };
                let stream: Box<dyn Read + Send + '_> = Box::new(&mut kept);
                let schema = guarded(|| StreamReader::try_new(stream, None).map(|reader| reader.schema()))
                    .map_err(|error| damaged(&name, 0, &error))?;
                let Kept { bytes, copy: start } = kept;
                Ok((
                    Self::Stream { name, schema: Arc::clone(&schema), start, bytes, bytes_read, total },
                    schema,
                ))
            }
        }
    }

    fn file(path: &Path, name: String, limits: Limits) -> Result<(Self, SchemaRef), Error> {
        let (file, length) = opened(path, &name)?;
        let blocks =
            Blocks::of(opened(path, &name)?.0, limits).map_err(|error| damaged(&name, 0, &error.into()))?;
        let schema = guarded(|| Ok(FileReader::try_new(BufReader::new(file.try_clone()?), None)?.schema()))
            .map_err(|error| no_whole_file(&name, "Arrow", &error))?;
        Ok((Self::File { name, file, length, schema: Arc::clone(&schema), blocks }, schema))
    }

    fn parquet(path: &Path, name: String, bound: Option<Bound>) -> Result<(Self, SchemaRef), Error> {
        let (file, length) = opened(path, &name)?;
        let directory = directory(&file, length).map_err(|error| damaged(&name, 0, &error.into()))?;
        if let Some(fault) = directory.and_then(|directory| footer::fault(&directory)) {
            return Err(no_whole_file(&name, "Parquet", &ArrowError::ParseError(fault.to_owned())));
        }
        let load = || Ok(ArrowReaderMetadata::load(&file, ArrowReaderOptions::new())?);
        let metadata = guarded(load).map_err(|error| no_whole_file(&name, "Parquet", &error))?;
        let schema = Arc::clone(metadata.schema());
        Ok((Self::Parquet { name, file, length, bound, metadata }, schema))
    }

    /// How many rows there are, if it is known.
    pub(super) fn rows(&self) -> Option<usize> {
        match self {
            Self::Parquet { metadata, .. } => {
                usize::try_from(metadata.metadata().file_metadata().num_rows()).ok()
            }
            Self::File { .. } | Self::Stream { .. } => None,
        }
    }

    /// The rows of some columns, given in ascending order.
    pub(super) fn batches(self, columns: &[usize]) -> Result<Batches, Error> {
        let rows = self.rows().unwrap_or(0) as u64;
        let said = |name: &str, error: ArrowError| {
            Error::data(name, None, format!("it cannot be read: {}", escaped(&error.to_string())))
        };
        let columns = columns.to_vec();
        let (name, form) = match self {
            Self::Parquet { name, file, length, bound, metadata } => {
                let mask = ProjectionMask::roots(metadata.parquet_schema(), columns);
                if let Some(bound) = bound {
                    let largest = || Ok(largest_pages(&file, &metadata, &mask)?);
                    let bytes = guarded(largest).map_err(|error| damaged(&name, 0, &error))?;
                    if let Some(words) = bound.passed_by_bytes(bytes) {
                        return Err(Error::memory(&name, None, &words));
                    }
                }
                let builder = ParquetRecordBatchReaderBuilder::new_with_metadata(file, metadata);
                let build = || Ok(builder.with_projection(mask).with_batch_size(BATCH).build()?);
                let reader = Box::new(guarded(build).map_err(|error| said(&name, error))?);
                (name, Form::Parquet { reader, length, of: rows })
            }
            Self::File { name, file, length, schema, mut blocks } => {
                blocks.iter_mut().for_each(|blocks| blocks.limits.select(&schema, &columns));
                let build = || FileReader::try_new(BufReader::new(file), Some(columns));
                let reader = Box::new(guarded(build).map_err(|error| said(&name, error))?);
                (name, Form::File { reader, length, blocks, read: 0 })
            }
            Self::Stream { name, schema, start, mut bytes, bytes_read, total } => {
                bytes.limits.select(&schema, &columns);
                let bytes: Box<dyn Read + Send> = Box::new(Cursor::new(start).chain(bytes));
                let build = || StreamReader::try_new(bytes, Some(columns));
                let reader = Box::new(guarded(build).map_err(|error| said(&name, error))?);
                (name, Form::Stream { reader, bytes_read, total })
            }
        };
        Ok(Batches { name, rows: 0, form })
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
    File {
        reader: Box<FileReader<BufReader<File>>>,
        length: u64,
        blocks: Option<Blocks>,
        /// How many batches came.
        read: usize,
    },
    Stream {
        reader: Box<StreamReader<Box<dyn Read + Send>>>,
        bytes_read: Arc<AtomicU64>,
        total: Option<u64>,
    },
}

impl Batches {
    /// The number of bytes read so far, and of how many if that is known.
    pub(super) fn progress(&self) -> (u64, Option<u64>) {
        let share =
            |part: f64, all: f64, length: u64| ((length as f64 * part / all.max(1.0)) as u64, Some(length));
        match &self.form {
            Form::Parquet { length, of, .. } => share(self.rows as f64, *of as f64, *length),
            Form::File { reader, length, read, .. } => {
                share(*read as f64, reader.num_batches() as f64, *length)
            }
            Form::Stream { bytes_read, total, .. } => (bytes_read.load(Ordering::Relaxed), *total),
        }
    }
}

impl Iterator for Batches {
    type Item = Result<RecordBatch, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        let batch = match &mut self.form {
            Form::Parquet { reader, .. } => guarded(|| reader.next().transpose()),
            Form::File { reader, read, blocks, .. } => {
                let checked = blocks.as_mut().map_or(Ok(()), |blocks| blocks.check(*read));
                *read += 1;
                checked.map_err(ArrowError::from).and_then(|()| guarded(|| reader.next().transpose()))
            }
            Form::Stream { reader, .. } => guarded(|| reader.next().transpose()),
        };
        match batch.transpose()? {
            Ok(batch) => {
                self.rows += batch.num_rows() as u64;
                Some(Ok(batch))
            }
            Err(error) => Some(Err(damaged(&self.name, self.rows, &error))),
        }
    }
}

/// Does what reads a file, whose libraries panic about some damages: that is an error as any other, and nothing is
/// printed.
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

/// A stream of which a copy is kept.
struct Kept<R> {
    bytes: R,
    copy: Vec<u8>,
}

impl<R: Read> Read for Kept<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.bytes.read(buffer)?;
        self.copy.extend_from_slice(buffer.get(..count).unwrap_or_default());
        Ok(count)
    }
}

/// A file, and its length.
fn opened(path: &Path, name: &str) -> Result<(File, u64), Error> {
    let opened = File::open(path).and_then(|file| {
        let length = file.metadata()?.len();
        Ok((file, length))
    });
    opened.map_err(|error| Error::io(name, format!("cannot be read: {error}")))
}

/// The bytes of the directory at the end of a Parquet file; none where there is none, which its reader says.
fn directory(mut file: &File, length: u64) -> io::Result<Option<Vec<u8>>> {
    let mut end = [0; 8];
    let Some(place) = length.checked_sub(8) else { return Ok(None) };
    file.seek(SeekFrom::Start(place))?;
    file.read_exact(&mut end)?;
    let bytes = u64::from(u32::from_le_bytes([end[0], end[1], end[2], end[3]]));
    let Some(start) = place.checked_sub(bytes) else { return Ok(None) };
    let mut directory = Vec::new();
    file.seek(SeekFrom::Start(start))?;
    file.take(bytes).read_to_end(&mut directory)?;
    file.seek(SeekFrom::Start(0))?;
    Ok(Some(directory))
}

/// What the pages of the columns take that are unpacked at once, in the group of rows where that is most: of each
/// column its first one, which may be its dictionary, and the largest of the others.
fn largest_pages(mut file: &File, metadata: &ArrowReaderMetadata, mask: &ProjectionMask) -> io::Result<u64> {
    let mut most = 0;
    let mut header = Vec::new();
    for group in metadata.metadata().row_groups() {
        let mut bytes: u64 = 0;
        for (_, column) in group.columns().iter().enumerate().filter(|(leaf, _)| mask.leaf_included(*leaf)) {
            let (mut place, length) = column.byte_range();
            let end = place.saturating_add(length);
            let (mut first, mut largest) = (None, 0);
            while place < end {
                header.clear();
                file.seek(SeekFrom::Start(place))?;
                file.take(PAGE_HEADER.min(end - place)).read_to_end(&mut header)?;
                // A header that is longer, or cut, is left to the reader.
                let Some((own, unpacked, stored)) = footer::page(&header) else { break };
                place = place.saturating_add(own).saturating_add(stored);
                match first {
                    None => first = Some(unpacked),
                    Some(_) => largest = largest.max(unpacked),
                }
            }
            bytes = bytes.saturating_add(first.unwrap_or(0)).saturating_add(largest);
        }
        most = most.max(bytes);
    }
    file.seek(SeekFrom::Start(0))?;
    Ok(most)
}

fn no_whole_file(name: &str, format: &str, error: &ArrowError) -> Error {
    let reason = escaped(&error.to_string());
    let message = format!("this is no whole {format} file ({reason}); copy it again, or write it anew");
    Error::data(name, None, message)
}

/// Says what an error of a reader means after so many rows.
fn damaged(name: &str, rows: u64, error: &ArrowError) -> Error {
    match error {
        ArrowError::IoError(_, error) if error.kind() == io::ErrorKind::OutOfMemory => {
            Error::memory(name, None, &error.to_string())
        }
        ArrowError::IoError(_, error) if error.kind() == io::ErrorKind::UnexpectedEof => {
            let message =
                format!("it ends too early, after {rows} whole rows: it is truncated; copy it again");
            Error::data(name, None, message)
        }
        ArrowError::IoError(_, error) if error.kind() != io::ErrorKind::InvalidData => {
            Error::io(name, format!("cannot be read: {error}"))
        }
        error => {
            let reason = escaped(&error.to_string());
            let message =
                format!("it is damaged after {rows} rows ({reason}); copy it again, or write it anew");
            Error::data(name, None, message)
        }
    }
}
