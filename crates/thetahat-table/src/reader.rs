//! Reading a text table from its first byte to its last.

use std::ops::ControlFlow;

use memchr::{memchr, memchr_iter, memrchr};

use super::block::Block;
use super::dialect::Dialect;
use super::error::{Error, Position, quoted};
use super::layout::{Layout, Row};
use super::number::{NUL_BYTE, Numbers};
use super::record::Record;
use super::rows::{Plan, Rows};
use super::source::Source;
use super::stream::{Text, TextStream, has_lines};
use super::time::Clock;
use super::{Options, Selection, Table};

/// How much is held in memory and handled at a time, in bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sizes {
    /// What is read at once.
    pub(super) block: usize,
    /// What one thread parses at once.
    pub(super) piece: usize,
    /// The longest row.
    pub(super) row: usize,
}

/// This many rows say whether a column holds numbers.
const LOOKED_AT: usize = 1000;

/// The sizes for real files.
pub(super) const SIZES: Sizes = Sizes { block: 1 << 20, piece: 1 << 17, row: 1 << 24 };

/// A text table whose columns are known and whose rows are still to be read.
pub(super) struct TextReader {
    options: Options,
    sizes: Sizes,
    source: Source,
    layout: Layout,
    /// The errors to report if a column with such a name is used.
    undecoded_names: Vec<(usize, Error)>,
    /// The text at hand, and space for the text after it.
    current: Block,
    next: Block,
    /// The first row; where it starts in the current block, its length, and its line.
    record: Record,
    position: usize,
    length: usize,
    line: u64,
}

impl TextReader {
    /// Reads a stream as far as its first row, and nothing that it would have to wait for: it may be a pipe on which the next row
    /// is yet to come. For [`stream`](TextReader::stream).
    pub(super) fn start_live(mut source: Source, options: &Options) -> Result<Self, Error> {
        let lines = usize::from(options.header) + options.skip_rows + 1;
        let head = source.look_ahead(SIZES.row, |text| has_lines(text, lines, options.comment))?;
        Self::start(source, options, Sizes { block: head, ..SIZES })
    }

    /// Reads a stream as far as its first row.
    pub(super) fn start(mut source: Source, options: &Options, sizes: Sizes) -> Result<Self, Error> {
        let file = source.name().to_owned();
        let mut current = Block::default();
        current.fill(&[], sizes.block, &mut source)?;
        let text = current.text();
        if text.is_empty() {
            return Err(Error::data(&file, None, "the file is empty; record at least one row"));
        }
        if let Some(offset) = memchr(0, text) {
            return Err(Error::data(&file, Position::within(text, offset, 1), NUL_BYTE));
        }
        let dialect = match options.delimiter {
            Some(delimiter) => Dialect { delimiter, comment: options.comment },
            None => Dialect::recognise(text, options.comment, options.decimal_comma),
        };
        let mut reader = Self {
            options: options.clone(),
            sizes,
            source,
            layout: Layout { file, dialect, names: Vec::new() },
            undecoded_names: Vec::new(),
            current,
            next: Block::default(),
            record: Record::new(dialect.delimiter),
            position: 0,
            length: 0,
            line: 1,
        };
        reader.read_head()?;
        Ok(reader)
    }

    /// Reads the names of the columns and stops at the first row.
    fn read_head(&mut self) -> Result<(), Error> {
        if self.options.header {
            self.advance()?;
            self.read_names();
        }
        for _ in 0..self.options.skip_rows {
            self.advance()?;
        }
        self.advance()?;
        if !self.options.header {
            self.layout.names = (1..=self.record.len()).map(|number| number.to_string()).collect();
        }
        Ok(())
    }

    /// Takes the names from the row at hand.
    fn read_names(&mut self) {
        for index in 0..self.record.len() {
            let name = self.layout.dialect.trimmed(self.record.field(index));
            let text = String::from_utf8_lossy(name).into_owned();
            // It is there as well if the name was decoded by a wrong encoding.
            if text.contains(char::REPLACEMENT_CHARACTER) {
                let message = format!(
                    "its name {} is not UTF-8; name the file's encoding, as in `encoding` windows-1252",
                    quoted(name)
                );
                self.undecoded_names.push((index, self.layout.fault(&self.row(), index, &message)));
            }
            self.layout.names.push(text);
        }
    }

    /// Goes on to the next row, which must exist.
    fn advance(&mut self) -> Result<(), Error> {
        let passed = &self.current.text()[self.position..self.position + self.length];
        self.line += memchr_iter(b'\n', passed).count() as u64;
        self.position += self.length;
        loop {
            let rest = &self.current.text()[self.position..];
            if let Some(length) = self.layout.dialect.skipped_line(rest) {
                self.position += length;
                self.line += 1;
            } else if let Some(length) = self.record.read(rest) {
                self.length = length;
                return Ok(());
            } else if self.current.is_last() {
                let row = Row { record: &self.record, text: rest, line: self.line };
                let empty = rest.is_empty();
                return Err(if empty { self.layout.no_rows(self.line) } else { self.layout.unclosed(&row) });
            } else if rest.len() > self.sizes.row {
                return Err(self.layout.too_long(self.line, self.sizes.row));
            } else {
                let amount = self.sizes.block.max(self.current.carried());
                self.next.fill(rest, amount, &mut self.source)?;
                std::mem::swap(&mut self.current, &mut self.next);
                self.position = 0;
            }
        }
    }

    /// The row at hand.
    fn row(&self) -> Row<'_> {
        let text = &self.current.text()[self.position..self.position + self.length];
        Row { record: &self.record, text, line: self.line }
    }

    /// The names of the columns, as they are in the header; without one they are numbered from `1`.
    pub(super) fn names(&self) -> &[String] {
        &self.layout.names
    }

    /// The columns that hold something else than numbers, as far as the first rows show it: not one of their values there
    /// is a number, and not all are missing.
    pub(super) fn words(&self) -> Vec<bool> {
        let numbers = Numbers::new(self.options.decimal_comma, &self.options.missing);
        let dialect = self.layout.dialect;
        let mut text = &self.current.text()[self.position..];
        let mut record = Record::new(dialect.delimiter);
        let (mut numeric, mut other) = (vec![false; self.layout.width()], vec![false; self.layout.width()]);
        let mut rows = 0;
        while rows < LOOKED_AT {
            if let Some(length) = dialect.skipped_line(text) {
                text = &text[length..];
            } else if let Some(length) = record.read(text) {
                text = &text[length..];
                rows += 1;
                for (column, (numeric, other)) in numeric.iter_mut().zip(&mut other).enumerate() {
                    if column < record.len() {
                        let field = dialect.trimmed(record.field(column));
                        let number = numbers.read(field).is_ok() || numbers.is_nearly(field);
                        *numeric |= number && !numbers.is_missing(field);
                        *other |= !number;
                    }
                }
            } else {
                break;
            }
        }
        numeric.into_iter().zip(other).map(|(numeric, other)| other && !numeric).collect()
    }

    /// The columns of which the name is not UTF-8 and cannot be shown.
    pub(super) fn nameless(&self) -> impl Iterator<Item = usize> {
        self.undecoded_names.iter().map(|(column, _)| *column)
    }

    /// Reads the selected columns; see [`Reader::read_parts`](super::Reader::read_parts).
    pub(super) fn read_parts(
        self,
        selection: &Selection,
        most: Option<usize>,
        progress: &mut dyn FnMut(u64, Option<u64>),
        take: &mut dyn FnMut(Table) -> ControlFlow<()>,
    ) -> Result<(), Error> {
        let fields = self.fields(selection)?;
        let numbers = Numbers::new(self.options.decimal_comma, &self.options.missing);
        let (clock, start) = self.clock(selection, &numbers)?;
        let Self {
            options,
            sizes,
            mut source,
            layout,
            mut current,
            mut next,
            mut record,
            mut position,
            line,
            ..
        } = self;
        let plan = Plan { layout, numbers, clock, fields, time: selection.time };
        let mut rows = Rows::new(plan.fields.len(), line);
        loop {
            let text = &current.text()[position..];
            let (whole, tail) = text.split_at(memrchr(b'\n', text).map_or(0, |newline| newline + 1));
            // What is given in parts needs no room for all.
            let share = source.share_read().filter(|_| most.is_none());
            let (read, filled) = rayon::join(
                || plan.read(whole, sizes.piece, share, &mut record, &mut rows),
                || {
                    if current.is_last() {
                        return Ok(());
                    }
                    // A row that grows over many blocks is read again with each: so let them double.
                    next.fill(tail, sizes.block.max(current.carried()), &mut source)
                },
            );
            // What is wrong with this block comes before what is wrong with the next.
            let taken = read?;
            if let Some(words) =
                options.bound.and_then(|bound| bound.passed_by(rows.count.saturating_mul(plan.fields.len())))
            {
                return Err(plan.layout.too_large(rows.line, &words));
            }
            let left = &text[taken..];
            if current.is_last() {
                if !left.is_empty() {
                    let row = Row { record: &record, text: left, line: rows.line };
                    return Err(plan.layout.unclosed(&row));
                }
                progress(source.bytes_read(), source.total());
                let _ = take(plan.table(rows, selection, start));
                return Ok(());
            }
            if left.len() > sizes.row {
                return Err(plan.layout.too_long(rows.line, sizes.row));
            }
            filled?;
            next.prepend(&whole[taken..]);
            progress(source.bytes_read(), source.total());
            std::mem::swap(&mut current, &mut next);
            position = 0;
            if most.is_some_and(|most| rows.count >= most) {
                let after = Rows::new(plan.fields.len(), rows.line);
                let part = plan.table(std::mem::replace(&mut rows, after), selection, start.clone());
                if take(part).is_break() {
                    return Ok(());
                }
            }
        }
    }

    /// Gives the rows of the selected columns one by one. With `whole_lines` a last line that has no line break yet is
    /// not taken for a row: who writes the log may not have finished it. Dates count from `start`, written as they are, or
    /// from the first one.
    pub(super) fn stream(
        self,
        selection: &Selection,
        whole_lines: bool,
        start: Option<&str>,
    ) -> Result<TextStream, Error> {
        let fields = self.fields(selection)?;
        let numbers = Numbers::new(self.options.decimal_comma, &self.options.missing);
        let (mut clock, mut first) = self.clock(selection, &numbers)?;
        if let (Some(start), Clock::Calendar { .. }) = (start, &clock) {
            clock = Clock::decide(start.as_bytes(), self.options.time_format.as_deref(), &numbers)
                .map_err(|message| Error::data(&self.layout.file, None, message))?;
            first = Some(start.to_owned());
        }
        let Self { source, layout, current, position, line, .. } = self;
        let text = current.raw().get(position..).unwrap_or_default().to_vec();
        let plan = Plan { layout, numbers, clock, fields, time: selection.time };
        TextStream::begin(plan, selection, Text { text, line, source, whole_lines, start: first })
    }

    /// The selected fields in ascending order, if the selection makes sense.
    fn fields(&self, selection: &Selection) -> Result<Vec<usize>, Error> {
        let mut fields: Vec<usize> = selection.columns.iter().copied().chain(selection.time).collect();
        fields.sort_unstable();
        let unusable = |message| Err(Error::data(&self.layout.file, None, message));
        if let Some(twice) = fields.windows(2).find(|pair| pair[0] == pair[1]) {
            return unusable(format!("{} is selected twice; select it once", self.layout.column(twice[0])));
        }
        if let Some(beyond) = fields.iter().find(|&&field| field >= self.layout.width()) {
            let width = self.layout.width();
            return unusable(format!("there is no column {}; select from the first {width}", beyond + 1));
        }
        match self.undecoded_names.iter().find(|(index, _)| fields.contains(index)) {
            Some((_, error)) => Err(error.clone()),
            None => Ok(fields),
        }
    }

    /// Decides by the first row how times are written, and returns the first one if it is a date.
    fn clock(&self, selection: &Selection, numbers: &Numbers) -> Result<(Clock, Option<String>), Error> {
        let row = self.row();
        match selection.time {
            // A row of another width is refused when it is read.
            Some(index) if row.record.len() == self.layout.width() => {
                let field = self.layout.dialect.trimmed(row.record.field(index));
                let clock = Clock::decide(field, self.options.time_format.as_deref(), numbers)
                    .map_err(|message| self.layout.first_fault(&row, index, &message))?;
                let is_date = matches!(clock, Clock::Calendar { .. });
                Ok((clock, is_date.then(|| String::from_utf8_lossy(field).into_owned())))
            }
            _ => Ok((Clock::Seconds, None)),
        }
    }
}
