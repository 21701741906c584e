//! The messages of an Arrow stream, each whole, of which none is believed to hold more than its bytes do.
//!
//! A compressed buffer begins with the length that it will have; its reader takes memory for as much, and a length that is made up ends
//! the process. So whatever is not small is unpacked here first, into nothing, and counted.

use std::io::{self, Cursor, Read};

use arrow_ipc::{CompressionType, Message, RecordBatch, root_as_message};

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
