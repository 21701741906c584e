//! Where the bytes come from: a file or standard input, unpacked, and decoded to UTF-8 where they are text.

use std::fs::File;
use std::io::{self, Cursor, Read};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use encoding_rs::{Encoding, UTF_8};
use encoding_rs_io::DecodeReaderBytesBuilder;
use flate2::read::MultiGzDecoder;

use memchr::memchr;

use super::blanks::Separated;
use super::error::{Error, remedy};

/// The first bytes of every gzip stream.
const GZIP: [u8; 2] = [0x1f, 0x8b];
/// What is asked of a pipe at once: as much as it holds.
const PIECE: usize = 1 << 16;

/// What the first bytes of a log say that it is, if it is no text.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Format {
    /// Columns of values in binary.
    Columnar(Columnar),
    /// A zip file, as spreadsheets are today, and the container of those before.
    Spreadsheet,
    /// Variables of MATLAB.
    Matlab,
    /// Topics, each with a clock of its own.
    Topical(Topical),
}

/// The formats of topics.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Topical {
    Ulog,
    DataFlash,
    WpiLog,
}

#[cfg(feature = "flight-logs")]
impl Topical {
    /// What messages call such a file.
    pub(super) fn said(self) -> &'static str {
        match self {
            Self::Ulog => "an ULog",
            Self::DataFlash => "a DataFlash log",
            Self::WpiLog => "a data log of WPILib",
        }
    }
}

/// The formats of columns of values in binary.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Columnar {
    Parquet,
    EncryptedParquet,
    ArrowFile,
    ArrowStream,
    Feather1,
}

impl Format {
    /// The first bytes of each. Those of a stream are the mark before each of its messages, and no text in any
    /// encoding.
    const MARKS: [(&[u8], Self); 12] = [
        (b"PAR1", Self::Columnar(Columnar::Parquet)),
        (b"PARE", Self::Columnar(Columnar::EncryptedParquet)),
        (b"ARROW1", Self::Columnar(Columnar::ArrowFile)),
        (&[0xff; 4], Self::Columnar(Columnar::ArrowStream)),
        (b"FEA1", Self::Columnar(Columnar::Feather1)),
        (b"PK\x03\x04", Self::Spreadsheet),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", Self::Spreadsheet),
        (b"MATLAB 5.0 MAT-file", Self::Matlab),
        (b"MATLAB 7.3 MAT-file", Self::Matlab),
        (b"ULog\x01\x12\x35", Self::Topical(Topical::Ulog)),
        // A message that declares messages, as the first one does.
        (b"\xa3\x95\x80", Self::Topical(Topical::DataFlash)),
        (b"WPILOG", Self::Topical(Topical::WpiLog)),
    ];

    /// The format that begins with these bytes.
    fn of(start: &[u8]) -> Option<Self> {
        Self::MARKS.into_iter().find(|(mark, _)| start.starts_with(mark)).map(|(_, format)| format)
    }

    /// Whether these bytes may be the beginning of a mark.
    fn may_begin(start: &[u8]) -> bool {
        Self::MARKS.iter().any(|(mark, _)| mark.len() > start.len() && mark.starts_with(start))
    }
}

/// A stream of bytes, unpacked, and how much of its origin has been read.
pub(super) struct Bytes {
    name: String,
    bytes: Box<dyn Read + Send>,
    gzip: bool,
    bytes_read: Arc<AtomicU64>,
    total: Option<u64>,
    /// What its first bytes say that it is; none for text.
    pub(super) format: Option<Format>,
}

impl Bytes {
    /// Opens a file, or standard input for `-`.
    pub(super) fn open(path: &Path) -> Result<Self, Error> {
        if path == Path::new("-") {
            return Self::new("standard input", io::stdin(), None);
        }
        let name = path.display().to_string();
        let opened = File::open(path).and_then(|file| {
            let metadata = file.metadata()?;
            Ok((file, metadata))
        });
        match opened {
            Err(error) => Err(Error::io(&name, format!("cannot be opened: {error}; {}", remedy(&error)))),
            Ok((_, metadata)) if metadata.is_dir() => {
                Err(Error::io(&name, "is a directory; name a file in it"))
            }
            Ok((file, metadata)) => {
                let total = metadata.is_file().then_some(metadata.len());
                Self::new(&name, file, total)
            }
        }
    }

    /// Unpacks a stream of `total` bytes. gzip is known by its first bytes, and so are formats that are no text.
    pub(super) fn new(
        name: &str,
        origin: impl Read + Send + 'static,
        total: Option<u64>,
    ) -> Result<Self, Error> {
        let bytes_read = Arc::new(AtomicU64::new(0));
        let mut origin = Counted { origin, bytes: Arc::clone(&bytes_read) };
        let mut start = Vec::new();
        let peeked = origin.by_ref().take(GZIP.len() as u64).read_to_end(&mut start);
        let gzip = start == GZIP;
        let origin = Cursor::new(start).chain(origin);
        let mut unpacked: Box<dyn Read + Send> =
            if gzip { Box::new(MultiGzDecoder::new(origin)) } else { Box::new(origin) };
        // No more than it takes to know: a log that is still being written may have no more.
        let mut start = Vec::new();
        let looked_at = peeked.and_then(|_| {
            while Format::may_begin(&start) && unpacked.by_ref().take(1).read_to_end(&mut start)? > 0 {}
            Ok(())
        });
        let format = Format::of(&start);
        let bytes: Box<dyn Read + Send> =
            if start.is_empty() { unpacked } else { Box::new(Cursor::new(start).chain(unpacked)) };
        let bytes = Self { name: name.to_owned(), bytes, gzip, bytes_read, total, format };
        match looked_at {
            Ok(()) => Ok(bytes),
            Err(error) => Err(failure(&bytes.name, gzip, &error)),
        }
    }

    /// The name that messages give it.
    pub(super) fn name(&self) -> &str {
        &self.name
    }

    /// Whether it was unpacked.
    #[cfg(any(feature = "columnar", feature = "flight-logs"))]
    pub(super) fn is_gzip(&self) -> bool {
        self.gzip
    }

    /// How much of it was read, whenever it is asked, as it is stored, and of how much; that is not known of a stream.
    #[cfg(feature = "columnar")]
    pub(super) fn progress(&self) -> (Arc<AtomicU64>, Option<u64>) {
        (Arc::clone(&self.bytes_read), self.total)
    }

    /// The bytes themselves.
    #[cfg(any(feature = "columnar", feature = "flight-logs", feature = "matlab", feature = "spreadsheets"))]
    pub(super) fn into_reader(self) -> Box<dyn Read + Send> {
        self.bytes
    }
}

/// A stream of text, and how much of its origin has been read.
pub(super) struct Source {
    name: String,
    text: Box<dyn Read + Send>,
    gzip: bool,
    bytes_read: Arc<AtomicU64>,
    total: Option<u64>,
}

impl Source {
    /// Decodes a stream of bytes. UTF-16 is known by its byte-order mark; a mark also overrules `encoding`. Without
    /// either, the bytes are passed on as they are.
    pub(super) fn new(bytes: Bytes, encoding: Option<&'static Encoding>) -> Self {
        let Bytes { name, bytes, gzip, bytes_read, total, .. } = bytes;
        // Decoding UTF-8 to UTF-8 would take time and hide what is wrong with it.
        let encoding = encoding.filter(|&encoding| encoding != UTF_8);
        let text = DecodeReaderBytesBuilder::new()
            .encoding(encoding)
            .utf8_passthru(encoding.is_none())
            .strip_bom(true)
            .bom_override(true)
            .build(bytes);
        Self { name, text: Box::new(LineEnds { text, after: false }), gzip, bytes_read, total }
    }

    /// The name that messages give it.
    pub(super) fn name(&self) -> &str {
        &self.name
    }

    /// The bytes read so far from the file or standard input, as they are stored there.
    pub(super) fn bytes_read(&self) -> u64 {
        self.bytes_read.load(Ordering::Relaxed)
    }

    /// The length of the file, as it is stored; nothing for a stream.
    pub(super) fn total(&self) -> Option<u64> {
        self.total
    }

    /// The part of the file that has been read; nothing for a stream.
    pub(super) fn share_read(&self) -> Option<f64> {
        self.total.map(|total| self.bytes_read() as f64 / total as f64)
    }

    /// Fills `buffer` as far as the text reaches, and returns how far.
    pub(super) fn fill(&mut self, buffer: &mut [u8]) -> Result<usize, Error> {
        let mut filled = 0;
        while filled < buffer.len() {
            match self.text.read(&mut buffer[filled..]) {
                Ok(0) => break,
                Ok(count) => filled += count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(self.failure(&error)),
            }
        }
        Ok(filled)
    }

    /// Reads what is there, and waits only if nothing is; 0 is the end of the text.
    pub(super) fn read_some(&mut self, buffer: &mut [u8]) -> Result<usize, Error> {
        loop {
            match self.text.read(buffer) {
                Ok(count) => return Ok(count),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(self.failure(&error)),
            }
        }
    }

    /// Reads no more than it takes to be `enough`, or `most` bytes, or all there is. It is read again afterwards, and
    /// so is an error.
    pub(super) fn look_ahead(&mut self, most: usize, enough: impl Fn(&[u8]) -> bool) -> Vec<u8> {
        let (mut head, mut piece) = (Vec::new(), vec![0; PIECE]);
        let mut failed = None;
        while !enough(&head) && head.len() < most {
            match self.text.read(&mut piece) {
                Ok(0) => break,
                Ok(count) => head.extend_from_slice(&piece[..count]),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => {
                    failed = Some(error);
                    break;
                }
            }
        }
        let rest = std::mem::replace(&mut self.text, Box::new(io::empty()));
        self.text = Box::new(Cursor::new(head.clone()).chain(Failing(failed)).chain(rest));
        head
    }

    /// From here on runs of blanks separate fields: the last of each is a tab.
    pub(super) fn separate_at_blanks(&mut self) {
        let text = std::mem::replace(&mut self.text, Box::new(io::empty()));
        self.text = Box::new(Separated::new(text));
    }

    /// Says what a failed read means.
    fn failure(&self, error: &io::Error) -> Error {
        failure(&self.name, self.gzip, error)
    }
}

/// Nothing, or an error.
struct Failing(Option<io::Error>);

impl Read for Failing {
    fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
        self.0.take().map_or(Ok(0), Err)
    }
}

/// Says what a failed read means.
fn failure(name: &str, gzip: bool, error: &io::Error) -> Error {
    let message = match error.kind() {
        io::ErrorKind::UnexpectedEof if gzip => {
            "the gzip stream ends too early: the file is truncated; copy or compress it again".to_owned()
        }
        io::ErrorKind::InvalidInput | io::ErrorKind::InvalidData if gzip => {
            format!("the gzip stream is damaged ({error}); copy or compress it again")
        }
        _ => format!("cannot be read: {error}"),
    };
    Error::io(name, message)
}

/// A text of which every line ends with a newline and nothing else, also where it ends with a carriage return alone.
struct LineEnds<R> {
    text: R,
    /// Whether the last byte was a carriage return, for which a newline was given: one that follows is part of it.
    after: bool,
}

impl<R: Read> Read for LineEnds<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            let count = self.text.read(buffer)?;
            // How much was taken, and how much of it was kept.
            let mut taken =
                usize::from(std::mem::take(&mut self.after) && buffer.first() == Some(&b'\n')).min(count);
            let mut kept = 0;
            while let Some(found) = memchr(b'\r', &buffer[taken..count]) {
                buffer.copy_within(taken..taken + found, kept);
                kept += found;
                taken += found + 1;
                buffer[kept] = b'\n';
                kept += 1;
                self.after = taken == count;
                taken += usize::from(!self.after && buffer[taken] == b'\n');
            }
            if kept < taken {
                buffer.copy_within(taken..count, kept);
            }
            kept += count - taken;
            if kept > 0 || count == 0 {
                return Ok(kept);
            }
        }
    }
}

/// A stream that counts its bytes.
struct Counted<R> {
    origin: R,
    bytes: Arc<AtomicU64>,
}

impl<R: Read> Read for Counted<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.origin.read(buffer)?;
        self.bytes.fetch_add(count as u64, Ordering::Relaxed);
        Ok(count)
    }
}
