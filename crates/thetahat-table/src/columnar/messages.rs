//! The messages of an Arrow stream or file, each whole, of which none is believed to hold more than its bytes do.
//!
//! A compressed buffer begins with the length that it will have; its reader takes memory for as much, and a length that is made up ends
//! the process. So whatever is not small is unpacked here first, into nothing, and counted.

use std::fs::File;
use std::io::{self, Cursor, Read, Seek, SeekFrom};

use arrow_ipc::{Block, CompressionType, Message, RecordBatch, root_as_footer, root_as_message};

/// What marks the length of a message, and the end of all.
const MARK: [u8; 4] = [0xff; 4];
/// A length of so many bytes is believed.
const SMALL: u64 = 1 << 20;
/// So is one that is no more times as long as what it was packed into.
const RATIO: u64 = 64;

/// Bytes that are passed on message by message.
pub(super) struct Messages<R> {
    bytes: R,
    message: Cursor<Vec<u8>>,
    /// Whether there was the last message, or one that its reader will not understand.
    ended: bool,
}

impl<R: Read> Messages<R> {
    pub(super) fn new(bytes: R) -> Self {
        Self { bytes, message: Cursor::new(Vec::new()), ended: false }
    }

    /// Reads the next message. What ends too early is passed on as far as it goes: its reader says so.
    fn next(&mut self) -> io::Result<()> {
        let Self { bytes, message, ended } = self;
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
        let start = message.len();
        if take(body, message)? {
            check(&said, message.get(start..).unwrap_or_default())?;
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
    batches: Vec<Block>,
}

impl Blocks {
    /// Those of the file, the dictionaries looked at. None where there is no directory, which the reader of the file says.
    pub(super) fn of(mut file: File) -> io::Result<Option<Self>> {
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
        let mut blocks = Self { file, batches };
        dictionaries.iter().try_for_each(|block| blocks.look(block))?;
        Ok(Some(blocks))
    }

    /// Looks at a batch before it is read.
    pub(super) fn check(&mut self, batch: usize) -> io::Result<()> {
        match self.batches.get(batch).copied() {
            Some(block) => self.look(&block),
            None => Ok(()),
        }
    }

    fn look(&mut self, block: &Block) -> io::Result<()> {
        let (Ok(start), Ok(header), Ok(body)) = (
            u64::try_from(block.offset()),
            u64::try_from(block.metaDataLength()),
            u64::try_from(block.bodyLength()),
        ) else {
            return Ok(());
        };
        let mut bytes = Vec::new();
        self.file.seek(SeekFrom::Start(start))?;
        self.file.by_ref().take(header).read_to_end(&mut bytes)?;
        // The length in front, with the mark before it or without.
        let prefix = if bytes.starts_with(&MARK) { 8 } else { 4 };
        let header = bytes.get(prefix..).unwrap_or_default().to_vec();
        let Ok(said) = root_as_message(&header) else { return Ok(()) };
        if said.header_as_record_batch().is_some_and(|batch| batch.compression().is_none()) {
            return Ok(());
        }
        bytes.clear();
        self.file.by_ref().take(body).read_to_end(&mut bytes)?;
        check(&said, &bytes)
    }
}

/// That the compressed buffers of a message are as long as they say.
fn check(message: &Message<'_>, body: &[u8]) -> io::Result<()> {
    let dictionary = message.header_as_dictionary_batch().and_then(|dictionary| dictionary.data());
    let Some(batch) = message.header_as_record_batch().or(dictionary) else { return Ok(()) };
    let Some(compression) = batch.compression() else { return Ok(()) };
    for (length, packed) in packed(&batch, body) {
        if length <= SMALL.max(RATIO * packed.len() as u64) {
            continue;
        }
        let counted = |reader: &mut dyn Read| io::copy(&mut reader.take(length + 1), &mut io::sink());
        let found = match compression.codec() {
            CompressionType::LZ4_FRAME => counted(&mut lz4_flex::frame::FrameDecoder::new(packed)),
            CompressionType::ZSTD => {
                zstd::Decoder::with_buffer(packed).and_then(|mut reader| counted(&mut reader))
            }
            // Its reader will not know it either.
            _ => Ok(length),
        };
        if found.ok() != Some(length) {
            let words = format!("a buffer says that it has {length} bytes, and has others");
            return Err(io::Error::new(io::ErrorKind::InvalidData, words));
        }
    }
    Ok(())
}

/// The buffers of a batch that are compressed: how long each says it is, and its bytes.
fn packed<'b>(batch: &RecordBatch<'_>, body: &'b [u8]) -> Vec<(u64, &'b [u8])> {
    let buffers = batch.buffers().into_iter().flatten();
    let of = |offset: i64, length: i64| {
        let start = usize::try_from(offset).ok()?;
        let end = start.checked_add(usize::try_from(length).ok()?)?;
        let (length, packed) = body.get(start..end)?.split_first_chunk()?;
        // -1 is one that is not compressed after all.
        Some((u64::try_from(i64::from_le_bytes(*length)).ok()?, packed))
    };
    buffers.filter_map(|buffer| of(buffer.offset(), buffer.length())).collect()
}
