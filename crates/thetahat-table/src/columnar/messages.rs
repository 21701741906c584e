//! The messages of an Arrow stream or file, each whole, of which none is believed to hold more than its bytes do.
//!
//! A compressed buffer begins with the length that it will have; its reader takes memory for as much, and a length that
//! is made up ends the process. So whatever is not small is unpacked here first, into nothing, and counted. What is
//! packed well may still be more than there is memory for: a batch is held against the bound of the reader before it is
//! unpacked.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Cursor, Read, Seek, SeekFrom};

use arrow_ipc::{Block, CompressionType, Message, RecordBatch, root_as_footer, root_as_message};
use arrow_schema::{DataType, Schema};

use super::super::memory::Bound;

/// What marks the length of a message, and the end of all.
const MARK: [u8; 4] = [0xff; 4];
/// A length of so many bytes is believed.
const SMALL: u64 = 1 << 20;
/// So is one that is no more times as long as what it was packed into.
const RATIO: u64 = 64;

/// What the batches of a log may take.
#[derive(Default)]
pub(super) struct Limits {
    bound: Option<Bound>,
    /// How many columns are read.
    columns: usize,
    /// Which buffers of a batch are read; all where nothing is said.
    wanted: Option<Vec<bool>>,
    /// The bytes of each dictionary, by its number.
    dictionaries: BTreeMap<i64, u64>,
}

impl Limits {
    pub(super) fn new(bound: Option<Bound>) -> Self {
        Self { bound, ..Self::default() }
    }

    /// From now on these columns of a schema are read, in ascending order.
    pub(super) fn select(&mut self, schema: &Schema, columns: &[usize]) {
        self.columns = columns.len();
        let of = |(index, count)| std::iter::repeat_n(columns.binary_search(&index).is_ok(), count);
        let counts: Option<Vec<usize>> =
            schema.fields().iter().map(|field| buffers(field.data_type())).collect();
        self.wanted = counts.map(|counts| counts.into_iter().enumerate().flat_map(of).collect());
    }

    /// That there is memory for a message, of which the body is not read yet.
    fn announce(&self, message: &Message<'_>) -> io::Result<()> {
        let Some(bound) = self.bound else { return Ok(()) };
        let dictionary = message.header_as_dictionary_batch().and_then(|dictionary| dictionary.data());
        // A value of a dictionary is a number once more.
        let (batch, columns) = match dictionary {
            Some(batch) => (Some(batch), 1),
            None => (message.header_as_record_batch(), self.columns),
        };
        let rows = usize::try_from(batch.map_or(0, |batch| batch.length())).unwrap_or(0);
        let bytes = u64::try_from(message.bodyLength()).unwrap_or(0);
        match bound.passed_by(rows.saturating_mul(columns)).or_else(|| bound.passed_by_bytes(bytes)) {
            Some(words) => Err(io::Error::new(io::ErrorKind::OutOfMemory, words)),
            None => Ok(()),
        }
    }

    /// That there is memory for what is in the body of a message, and that its compressed buffers are as long as they
    /// say.
    fn check(&mut self, message: &Message<'_>, body: &[u8]) -> io::Result<()> {
        let dictionary = message.header_as_dictionary_batch();
        let values = dictionary.and_then(|dictionary| dictionary.data());
        let Some(batch) = message.header_as_record_batch().or(values) else { return Ok(()) };
        let wanted = self.wanted.as_deref().filter(|_| dictionary.is_none());
        let packed = packed(&batch, body, wanted);
        let unpacked = packed.iter().fold(0_u64, |sum, (length, _)| sum.saturating_add(*length));
        let mut bytes = unpacked.saturating_add(body.len() as u64);
        if let Some(dictionary) = dictionary {
            let held = self.dictionaries.entry(dictionary.id()).or_default();
            *held = if dictionary.isDelta() { held.saturating_add(bytes) } else { bytes };
            bytes = 0;
        }
        let bytes = self.dictionaries.values().fold(bytes, |sum, more| sum.saturating_add(*more));
        if let Some(words) = self.bound.and_then(|bound| bound.passed_by_bytes(bytes)) {
            return Err(io::Error::new(io::ErrorKind::OutOfMemory, words));
        }
        match batch.compression() {
            Some(compression) => packed
                .iter()
                .try_for_each(|&(length, packed)| is_as_long(compression.codec(), packed, length)),
            None => Ok(()),
        }
    }
}

/// The buffers of a column without columns in it, if that is known without a batch.
fn buffers(data_type: &DataType) -> Option<usize> {
    match data_type {
        DataType::Null => Some(0),
        DataType::Utf8 | DataType::LargeUtf8 | DataType::Binary | DataType::LargeBinary => Some(3),
        DataType::Boolean | DataType::FixedSizeBinary(_) | DataType::Dictionary(..) => Some(2),
        primitive => primitive.is_primitive().then_some(2),
    }
}

/// Bytes that are passed on message by message.
pub(super) struct Messages<R> {
    bytes: R,
    pub(super) limits: Limits,
    message: Cursor<Vec<u8>>,
    /// Whether there was the last message, or one that its reader will not understand.
    ended: bool,
}

impl<R: Read> Messages<R> {
    pub(super) fn new(bytes: R, limits: Limits) -> Self {
        Self { bytes, limits, message: Cursor::new(Vec::new()), ended: false }
    }

    /// Reads the next message. What ends too early is passed on as far as it goes: its reader says so.
    fn next(&mut self) -> io::Result<()> {
        let Self { bytes, limits, message, ended } = self;
        message.set_position(0);
        let message = message.get_mut();
        message.clear();
        *ended = true;
        // Memory grows with the bytes that come, whatever was said.
        let mut take = |count: usize, message: &mut Vec<u8>| -> io::Result<bool> {
            Ok(bytes.by_ref().take(count as u64).read_to_end(message)? == count)
        };
        if !take(4, message)? || (message.as_slice() == MARK && !take(4, message)?) {
            return Ok(());
        }
        let length = message.last_chunk().map_or(0, |bytes| i32::from_le_bytes(*bytes));
        let mut header = Vec::new();
        let is_whole = usize::try_from(length).is_ok_and(|length| length > 0)
            && take(usize::try_from(length).unwrap_or(0), &mut header)?;
        message.extend_from_slice(&header);
        let Some(said) = root_as_message(&header).ok().filter(|_| is_whole) else { return Ok(()) };
        let Ok(body) = usize::try_from(said.bodyLength()) else { return Ok(()) };
        limits.announce(&said)?;
        let start = message.len();
        if take(body, message)? {
            limits.check(&said, message.get(start..).unwrap_or_default())?;
            *ended = false;
        }
        Ok(())
    }
}

impl<R: Read> Read for Messages<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.message.read(buffer)?;
        if count > 0 || buffer.is_empty() || self.ended {
            return Ok(count);
        }
        self.next()?;
        self.message.read(buffer)
    }
}

/// The messages of a file, which its directory names.
pub(super) struct Blocks {
    file: File,
    length: u64,
    pub(super) limits: Limits,
    batches: Vec<Block>,
}

impl Blocks {
    /// The blocks of the file, with its dictionaries checked. None where there is no directory, which the reader of the
    /// file reports.
    pub(super) fn of(mut file: File, limits: Limits) -> io::Result<Option<Self>> {
        let mut end = [0; 10];
        let length = file.seek(SeekFrom::End(0))?;
        let Some(place) = length.checked_sub(10) else { return Ok(None) };
        file.seek(SeekFrom::Start(place))?;
        file.read_exact(&mut end)?;
        let bytes = u64::try_from(i32::from_le_bytes([end[0], end[1], end[2], end[3]])).unwrap_or(u64::MAX);
        let Some(start) = place.checked_sub(bytes) else { return Ok(None) };
        let mut directory = Vec::new();
        file.seek(SeekFrom::Start(start))?;
        file.by_ref().take(bytes).read_to_end(&mut directory)?;
        let Ok(directory) = root_as_footer(&directory) else { return Ok(None) };
        let batches = directory.recordBatches().iter().flatten().copied().collect();
        let dictionaries: Vec<Block> = directory.dictionaries().iter().flatten().copied().collect();
        let mut blocks = Self { file, length, limits, batches };
        dictionaries.iter().try_for_each(|block| blocks.check_block(block))?;
        Ok(Some(blocks))
    }

    /// Checks a batch before it is read.
    pub(super) fn check(&mut self, batch: usize) -> io::Result<()> {
        match self.batches.get(batch).copied() {
            Some(block) => self.check_block(&block),
            None => Ok(()),
        }
    }

    /// Checks a block: that it lies within the file, and the message in its header.
    fn check_block(&mut self, block: &Block) -> io::Result<()> {
        let (Ok(start), Ok(header), Ok(body)) = (
            u64::try_from(block.offset()),
            u64::try_from(block.metaDataLength()),
            u64::try_from(block.bodyLength()),
        ) else {
            return Ok(());
        };
        if start.saturating_add(header).saturating_add(body) > self.length {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        let mut bytes = Vec::new();
        self.file.seek(SeekFrom::Start(start))?;
        self.file.by_ref().take(header).read_to_end(&mut bytes)?;
        // The length in front, with the mark before it or without.
        let prefix = if bytes.starts_with(&MARK) { 8 } else { 4 };
        let header = bytes.get(prefix..).unwrap_or_default().to_vec();
        let Ok(said) = root_as_message(&header) else { return Ok(()) };
        self.limits.announce(&said)?;
        if said.header_as_record_batch().is_some_and(|batch| batch.compression().is_none()) {
            return Ok(());
        }
        bytes.clear();
        self.file.by_ref().take(body).read_to_end(&mut bytes)?;
        self.limits.check(&said, &bytes)
    }
}

/// That a compressed buffer is as long as it says.
fn is_as_long(codec: CompressionType, packed: &[u8], length: u64) -> io::Result<()> {
    if length <= SMALL.max(RATIO * packed.len() as u64) {
        return Ok(());
    }
    let counted =
        |reader: &mut dyn Read| io::copy(&mut reader.take(length.saturating_add(1)), &mut io::sink());
    let found = match codec {
        CompressionType::LZ4_FRAME => counted(&mut lz4_flex::frame::FrameDecoder::new(packed)),
        CompressionType::ZSTD => {
            zstd::Decoder::with_buffer(packed).and_then(|mut reader| counted(&mut reader))
        }
        // Its reader will not know it either.
        _ => Ok(length),
    };
    if found.ok() == Some(length) {
        return Ok(());
    }
    let words = format!("a buffer says that it has {length} bytes, and has others");
    Err(io::Error::new(io::ErrorKind::InvalidData, words))
}

/// The wanted buffers of a batch that are compressed: how long each says it is, and its bytes.
fn packed<'b>(batch: &RecordBatch<'_>, body: &'b [u8], wanted: Option<&[bool]>) -> Vec<(u64, &'b [u8])> {
    if batch.compression().is_none() {
        return Vec::new();
    }
    let is_wanted = |index: usize| wanted.is_none_or(|wanted| wanted.get(index) != Some(&false));
    let buffers = batch.buffers().into_iter().flatten().enumerate();
    let buffers = buffers.filter(|(index, _)| is_wanted(*index)).map(|(_, buffer)| buffer);
    let of = |offset: i64, length: i64| {
        let start = usize::try_from(offset).ok()?;
        let end = start.checked_add(usize::try_from(length).ok()?)?;
        let (length, packed) = body.get(start..end)?.split_first_chunk()?;
        // -1 is one that is not compressed after all.
        Some((u64::try_from(i64::from_le_bytes(*length)).ok()?, packed))
    };
    buffers.filter_map(|buffer| of(buffer.offset(), buffer.length())).collect()
}
