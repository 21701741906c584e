//! Logs of all formats, behind one front.

#[cfg(any(feature = "matlab", feature = "spreadsheets"))]
use std::io::Cursor;
use std::ops::ControlFlow;
use std::path::Path;

#[cfg(feature = "matlab")]
use super::Header;
use super::error::Error;
use super::mailbox::{Event, Waker};
#[cfg(feature = "matlab")]
use super::matlab::{self, Variables};
use super::reader::{SIZES, TextReader};
#[cfg(any(feature = "columnar", feature = "flight-logs", feature = "matlab", feature = "spreadsheets"))]
use super::source::Format;
use super::source::{Bytes, Source};
#[cfg(feature = "spreadsheets")]
use super::spreadsheet::{self, Sheet};
use super::stream::TextStream;
use super::time::Calendar;
use super::zone::Zone;
use super::{ClockColumns, Options, Selection, Table, Topic};

#[cfg(feature = "columnar")]
use super::columnar::{ColumnarReader, ColumnarStream};
#[cfg(feature = "flight-logs")]
use super::topics::{TopicStream, TopicsReader};

/// A log whose columns are known and whose rows are still to be read.
pub struct Reader {
    any: AnyReader,
    /// The name that messages give the log.
    file: String,
    /// That of dates without a zone.
    zone: Option<Zone>,
}

pub(super) enum AnyReader {
    Text(Box<TextReader>),
    #[cfg(feature = "columnar")]
    Columnar(Box<ColumnarReader>),
    #[cfg(feature = "flight-logs")]
    Topics(Box<TopicsReader>),
}

impl Reader {
    /// Opens a log, or standard input for `-`, and reads as far as its first row.
    pub fn open(path: &Path, options: &Options) -> Result<Self, Error> {
        Self::begin(path, options, |source, options| TextReader::start(source, options, SIZES))
    }

    /// Opens a log as [`open`](Reader::open) does, without asking for more than it takes to know its columns: it may be
    /// a pipe on which the next row is yet to come. For [`stream`](Reader::stream).
    pub fn open_live(path: &Path, options: &Options) -> Result<Self, Error> {
        Self::begin(path, options, TextReader::start_live)
    }

    fn begin(
        path: &Path,
        options: &Options,
        text: impl FnOnce(Source, &Options) -> Result<TextReader, Error>,
    ) -> Result<Self, Error> {
        options.check().map_err(|message| Error::data(&path.display().to_string(), None, message))?;
        let bytes = Bytes::open(path)?;
        let file = bytes.name().to_owned();
        let zone = options.time_zone.as_deref().and_then(|name| Zone::of(name).ok());
        let any = match bytes.format {
            #[cfg(feature = "spreadsheets")]
            Some(Format::Spreadsheet) => {
                let Sheet { text: cells, words } = spreadsheet::read(bytes, options)?;
                let total = Some(cells.len() as u64);
                let cells = Bytes::new(&file, Cursor::new(cells), total)?;
                let mut reader = text(Source::new(cells, None), options)?;
                reader.tell(&words);
                Ok(AnyReader::Text(Box::new(reader)))
            }
            _ if options.sheet.is_some() => {
                Err(Error::data(&file, None, "`sheet` is for spreadsheets, and this is none; leave it out"))
            }
            None => Ok(AnyReader::Text(Box::new(text(Source::new(bytes, options.encoding), options)?))),
            #[cfg(feature = "columnar")]
            Some(Format::Columnar(format)) => {
                Ok(AnyReader::Columnar(Box::new(ColumnarReader::open(path, bytes, format, options)?)))
            }
            #[cfg(feature = "matlab")]
            Some(Format::Matlab) => {
                let Variables { text: rows, words } = matlab::read(bytes, options)?;
                let total = Some(rows.len() as u64);
                let rows = Bytes::new(&file, Cursor::new(rows), total)?;
                // How it is written is known.
                let (header, delimiter, decimal_comma) = (Header::Line(1), Some(b'\t'), Some(false));
                let options = Options { header, delimiter, decimal_comma, ..options.clone() };
                let mut reader = text(Source::new(rows, None), &options)?;
                reader.tell(&words);
                Ok(AnyReader::Text(Box::new(reader)))
            }
            #[cfg(feature = "flight-logs")]
            Some(Format::Topical(format)) => {
                Ok(AnyReader::Topics(Box::new(TopicsReader::open(bytes, format, options)?)))
            }
            #[cfg(not(all(
                feature = "columnar",
                feature = "flight-logs",
                feature = "matlab",
                feature = "spreadsheets"
            )))]
            Some(_) => Err(Error::data(
                bytes.name(),
                None,
                "is in a format that this program was built without; build it with the features columnar, flight-logs, matlab and \
                 spreadsheets, or write CSV",
            )),
        };
        Ok(Self { any: any?, file, zone })
    }

    /// A text in any stream.
    #[cfg(test)]
    pub(super) fn of_text(reader: TextReader) -> Self {
        Self { any: AnyReader::Text(Box::new(reader)), file: String::new(), zone: None }
    }

    /// The names of the columns, as they are in the header; without one they are numbered from `1`.
    pub fn names(&self) -> &[String] {
        match &self.any {
            AnyReader::Text(reader) => reader.names(),
            #[cfg(feature = "columnar")]
            AnyReader::Columnar(reader) => reader.names(),
            #[cfg(feature = "flight-logs")]
            AnyReader::Topics(reader) => reader.names(),
        }
    }

    /// The topics of a log of which each topic has a clock of its own; none of any other log.
    pub fn topics(&self) -> Option<&[Topic]> {
        match &self.any {
            #[cfg(feature = "flight-logs")]
            AnyReader::Topics(reader) => Some(reader.topics()),
            _ => None,
        }
    }

    /// What is not as it should be with the topics of a log, and what of it is not read, in plain words.
    pub fn remarks(&self) -> Vec<String> {
        match &self.any {
            #[cfg(feature = "flight-logs")]
            AnyReader::Topics(reader) => reader.remarks(),
            _ => Vec::new(),
        }
    }

    /// The columns that hold something else than numbers, as far as the first rows show it: not one of their values
    /// there is a number, and not all are missing.
    pub fn words(&self) -> Vec<bool> {
        match &self.any {
            AnyReader::Text(reader) => reader.words(),
            #[cfg(feature = "columnar")]
            AnyReader::Columnar(reader) => reader.words(),
            #[cfg(feature = "flight-logs")]
            AnyReader::Topics(reader) => vec![false; reader.names().len()],
        }
    }

    /// The columns of which the name is not UTF-8 and cannot be shown.
    pub fn nameless(&self) -> Vec<usize> {
        match &self.any {
            AnyReader::Text(reader) => reader.nameless().collect(),
            #[cfg(feature = "columnar")]
            AnyReader::Columnar(_) => Vec::new(),
            #[cfg(feature = "flight-logs")]
            AnyReader::Topics(_) => Vec::new(),
        }
    }

    /// The columns that are clocks by their type, or in a text by their names and their first values.
    pub fn times(&self) -> Vec<ClockColumns> {
        match &self.any {
            AnyReader::Text(reader) => reader.times(),
            #[cfg(feature = "columnar")]
            AnyReader::Columnar(reader) => {
                reader.times().into_iter().map(|time| ClockColumns { time, date: None }).collect()
            }
            #[cfg(feature = "flight-logs")]
            AnyReader::Topics(_) => Vec::new(),
        }
    }

    /// The columns of a text that are called as clocks are, or hold dates: without being a clock, they may be meant as
    /// one.
    pub fn called_clocks(&self) -> Vec<usize> {
        match &self.any {
            AnyReader::Text(reader) => reader.called_clocks(),
            #[cfg(feature = "columnar")]
            AnyReader::Columnar(_) => Vec::new(),
            #[cfg(feature = "flight-logs")]
            AnyReader::Topics(_) => Vec::new(),
        }
    }

    /// Reads the selected columns of all rows.
    ///
    /// `progress` is called once a block with the number of bytes read so far, and of how many if that is
    /// known. Both count what is stored, before it is unpacked.
    pub fn read(
        self,
        selection: &Selection,
        progress: &mut dyn FnMut(u64, Option<u64>),
    ) -> Result<Table, Error> {
        let mut whole = Table::default();
        self.read_parts(selection, None, progress, &mut |table| {
            whole = table;
            ControlFlow::Continue(())
        })?;
        Ok(whole)
    }

    /// The same in parts, each with `most` rows or a little more, the last one with what is left: memory does not grow
    /// with the rows. None: all in one.
    pub fn read_parts(
        self,
        selection: &Selection,
        most: Option<usize>,
        progress: &mut dyn FnMut(u64, Option<u64>),
        take: &mut dyn FnMut(Table) -> ControlFlow<()>,
    ) -> Result<(), Error> {
        let Self { any, file, mut zone } = self;
        // What cannot be read in the zone ends the reading.
        let mut failed = None;
        let mut take = |mut table: Table| {
            table.calendar = Calendar::of(table.start.as_deref());
            match zone.as_mut().map_or(Ok(()), |zone| zone.apply(&file, &mut table)) {
                Ok(()) => take(table),
                Err(error) => {
                    failed = Some(error);
                    ControlFlow::Break(())
                }
            }
        };
        let read = match any {
            AnyReader::Text(reader) => reader.read_parts(selection, most, progress, &mut take),
            #[cfg(feature = "columnar")]
            AnyReader::Columnar(reader) => reader.read_parts(selection, most, progress, &mut take),
            #[cfg(feature = "flight-logs")]
            AnyReader::Topics(reader) => reader.read_parts(selection, most, progress, &mut take),
        };
        read.and(failed.map_or(Ok(()), Err))
    }

    /// Gives the rows of the selected columns one by one. With `whole_lines` a last line that has no line break yet is
    /// not taken for a row: who writes the log may not have finished it. Dates count from `start`, written as they are,
    /// or from the first one.
    pub fn stream(
        self,
        selection: &Selection,
        whole_lines: bool,
        start: Option<&str>,
    ) -> Result<Stream, Error> {
        match self.any {
            AnyReader::Text(reader) => {
                Ok(Stream(AnyStream::Text(Box::new(reader.stream(selection, whole_lines, start)?))))
            }
            #[cfg(feature = "columnar")]
            AnyReader::Columnar(reader) => {
                Ok(Stream(AnyStream::Columnar(Box::new(reader.stream(selection, start)?))))
            }
            #[cfg(feature = "flight-logs")]
            AnyReader::Topics(reader) => Ok(Stream(AnyStream::Topics(Box::new(reader.stream(selection)?)))),
        }
    }
}

/// A log of which the rows are read one after the other. Memory does not grow with their number.
pub struct Stream(AnyStream);

enum AnyStream {
    Text(Box<TextStream>),
    #[cfg(feature = "columnar")]
    Columnar(Box<ColumnarStream>),
    #[cfg(feature = "flight-logs")]
    Topics(Box<TopicStream>),
}

impl Stream {
    /// What ends this stream early.
    pub fn waker(&self) -> Waker {
        match &self.0 {
            AnyStream::Text(stream) => stream.waker(),
            #[cfg(feature = "columnar")]
            AnyStream::Columnar(stream) => stream.waker(),
            #[cfg(feature = "flight-logs")]
            AnyStream::Topics(stream) => stream.waker(),
        }
    }

    /// The time that dates count from, as it is written; none if times are numbers.
    pub fn start(&self) -> Option<&str> {
        match &self.0 {
            AnyStream::Text(stream) => stream.start(),
            #[cfg(feature = "columnar")]
            AnyStream::Columnar(stream) => stream.start(),
            #[cfg(feature = "flight-logs")]
            AnyStream::Topics(_) => None,
        }
    }

    /// Whether its rows are those of a topic, which have a time each, also where none is selected.
    pub fn is_of_a_topic(&self) -> bool {
        match &self.0 {
            #[cfg(feature = "flight-logs")]
            AnyStream::Topics(_) => true,
            _ => false,
        }
    }

    /// The row at hand, in the order of the selection; NaN is a missing value.
    pub fn values(&self) -> &[f64] {
        match &self.0 {
            AnyStream::Text(stream) => stream.values(),
            #[cfg(feature = "columnar")]
            AnyStream::Columnar(stream) => stream.values(),
            #[cfg(feature = "flight-logs")]
            AnyStream::Topics(stream) => stream.values(),
        }
    }

    /// The time of the row at hand in seconds, as [`Table::time`].
    pub fn time(&self) -> Option<f64> {
        match &self.0 {
            AnyStream::Text(stream) => stream.time(),
            #[cfg(feature = "columnar")]
            AnyStream::Columnar(stream) => stream.time(),
            #[cfg(feature = "flight-logs")]
            AnyStream::Topics(stream) => stream.time(),
        }
    }

    /// The row at hand, or the malformed one, as messages name it.
    pub fn place(&self, file: &str) -> String {
        match &self.0 {
            AnyStream::Text(stream) => format!("{file}:{}", stream.line()),
            #[cfg(feature = "columnar")]
            AnyStream::Columnar(stream) => format!("{file}: row {}", stream.row()),
            #[cfg(feature = "flight-logs")]
            AnyStream::Topics(stream) => format!("{file}: row {}", stream.row()),
        }
    }

    /// Whether the log ended inside a line, which was left alone.
    pub fn is_unfinished(&self) -> bool {
        match &self.0 {
            AnyStream::Text(stream) => stream.is_unfinished(),
            #[cfg(feature = "columnar")]
            AnyStream::Columnar(_) => false,
            #[cfg(feature = "flight-logs")]
            AnyStream::Topics(_) => false,
        }
    }

    /// What the reader should know, in plain words, each once.
    pub fn words(&mut self) -> Vec<String> {
        match &mut self.0 {
            AnyStream::Text(stream) => stream.words(),
            #[cfg(feature = "columnar")]
            AnyStream::Columnar(stream) => stream.words(),
            #[cfg(feature = "flight-logs")]
            AnyStream::Topics(stream) => stream.words(),
        }
    }

    /// Goes on by one row.
    ///
    /// # Errors
    /// That the log cannot be read, or a text has a line of more than 16 MiB. What was read before is told first.
    pub fn advance(&mut self) -> Result<Event, Error> {
        match &mut self.0 {
            AnyStream::Text(stream) => stream.next(),
            #[cfg(feature = "columnar")]
            AnyStream::Columnar(stream) => stream.next(),
            #[cfg(feature = "flight-logs")]
            AnyStream::Topics(stream) => stream.next(),
        }
    }
}
