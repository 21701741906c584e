//! Reading a text table from its first byte to its last.

use std::ops::ControlFlow;

use memchr::{memchr, memchr_iter, memrchr};

use super::block::Block;
use super::error::{Error, Position, quoted};
use super::layout::{Layout, Row};
use super::number::NUL_BYTE;
use super::record::Record;
use super::rows::{Plan, Rows};
use super::shape::{self, Head, Shape};
use super::source::Source;
use super::stream::{Text, TextStream};
use super::time::{Clock, Times};
use super::words::Tally;
use super::{ClockColumns, Options, Selection, Table};

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

/// How much of a text is looked at before it is read.
const HEAD: usize = 1 << 18;

/// The sizes for real files.
pub(super) const SIZES: Sizes = Sizes { block: 1 << 20, piece: 1 << 17, row: 1 << 24 };

/// A text table whose columns are known and whose rows are still to be read.
pub(super) struct TextReader {
    options: Options,
    sizes: Sizes,
    source: Source,
    /// What is known of the columns, and nothing to read as long as none is selected.
    plan: Plan,
    /// The errors to report if a column with such a name is used.
    undecoded_names: Vec<(usize, Error)>,
    /// What the reader should know, in plain words.
    told: Vec<String>,
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
    /// Reads a stream as far as its first row, and nothing that it would have to wait for: it may be a pipe on which
    /// the next row is yet to come. For [`stream`](TextReader::stream).
    pub(super) fn start_live(mut source: Source, options: &Options) -> Result<Self, Error> {
        let head = source.look_ahead(SIZES.row, |text| shape::has_row(text, options));
        let sizes = Sizes { block: head.len(), ..SIZES };
        Self::begin(source, head, options, sizes)
    }

    /// Reads a stream as far as its first row.
    pub(super) fn start(mut source: Source, options: &Options, sizes: Sizes) -> Result<Self, Error> {
        let head = source.look_ahead(HEAD, |_| false);
        Self::begin(source, head, options, sizes)
    }

    /// Reads a stream of which `head` is the beginning as far as its first row.
    fn begin(mut source: Source, mut head: Vec<u8>, options: &Options, sizes: Sizes) -> Result<Self, Error> {
        let file = source.name().to_owned();
        if let Some(offset) = memchr(0, &head) {
            return Err(Error::data(&file, Position::within(&head, offset, 1), NUL_BYTE));
        }
        // Whole lines; a text may end without a line break, or be one long line.
        match memrchr(b'\n', &head) {
            Some(newline) if head.len() >= HEAD => head.truncate(newline + 1),
            _ if head.last().is_some_and(|&byte| byte != b'\n') => head.push(b'\n'),
            _ => {}
        }
        let shape = Shape::recognise(&head, options).map_err(|message| Error::data(&file, None, message))?;
        if shape.dialect.blanks {
            source.separate_at_blanks();
        }
        let mut current = Block::default();
        current.fill(&[], sizes.block.max(1), &mut source)?;
        if current.text().is_empty() {
            return Err(Error::data(&file, None, "the file is empty; record at least one row"));
        }
        let Shape { dialect, mut head, columns, numbers } = shape;
        let layout = Layout {
            file,
            dialect,
            names: Vec::new(),
            is_open: head.width.is_some(),
            columns,
            units: std::mem::take(&mut head.units),
        };
        let mut reader = Self {
            options: options.clone(),
            sizes,
            source,
            told: head.words.iter().map(|words| layout.told(words)).collect(),
            plan: Plan::new(layout, numbers),
            undecoded_names: Vec::new(),
            current,
            next: Block::default(),
            record: Record::new(dialect.delimiter),
            position: 0,
            length: 0,
            line: head.line,
        };
        reader.pass(head.start)?;
        reader.read_head(head)?;
        Ok(reader)
    }

    /// Goes on by some bytes.
    fn pass(&mut self, mut bytes: usize) -> Result<(), Error> {
        while bytes > self.current.text().len() && !self.current.is_last() {
            bytes -= self.current.text().len();
            self.next.fill(&[], self.sizes.block, &mut self.source)?;
            std::mem::swap(&mut self.current, &mut self.next);
        }
        self.position = bytes.min(self.current.text().len());
        Ok(())
    }

    /// Reads the names of the columns, leaves out what is between them and the first row, and stops there.
    fn read_head(&mut self, head: Head) -> Result<(), Error> {
        if head.has_names {
            self.advance()?;
            self.read_names();
        }
        for _ in 0..head.left_out {
            self.advance()?;
        }
        self.advance()?;
        let names = &mut self.plan.layout.names;
        if !head.has_names {
            *names = (1..=self.record.len()).map(|number| number.to_string()).collect();
        }
        if let Some(width) = head.width {
            names.truncate(width);
        }
        if let Some(known) = head.names {
            *names = known;
        }
        Ok(())
    }

    /// Takes the names from the row at hand.
    fn read_names(&mut self) {
        for index in 0..self.record.len() {
            let name = self.plan.layout.dialect.trimmed(self.record.field(index));
            let text = String::from_utf8_lossy(name).into_owned();
            // It is there as well if the name was decoded by a wrong encoding.
            if text.contains(char::REPLACEMENT_CHARACTER) {
                let message = format!(
                    "its name {} is not UTF-8; name the file's encoding, as in `encoding` windows-1252",
                    quoted(name)
                );
                self.undecoded_names.push((index, self.plan.layout.fault(&self.row(), index, &message)));
            }
            self.plan.layout.names.push(text);
        }
    }

    /// Goes on to the next row, which must exist.
    fn advance(&mut self) -> Result<(), Error> {
        let passed = &self.current.text()[self.position..self.position + self.length];
        self.line += memchr_iter(b'\n', passed).count() as u64;
        self.position += self.length;
        loop {
            let rest = &self.current.text()[self.position..];
            if let Some(length) = self.plan.layout.dialect.skipped_line(rest) {
                self.position += length;
                self.line += 1;
            } else if let Some(length) = self.record.read(rest) {
                self.length = length;
                return Ok(());
            } else if self.current.is_last() {
                let row = Row { record: &self.record, text: rest, line: self.line };
                let empty = rest.is_empty();
                return Err(if empty {
                    self.plan.layout.no_rows(self.line)
                } else {
                    self.plan.layout.unclosed(&row, "the file")
                });
            } else if rest.len() > self.sizes.row {
                return Err(self.plan.layout.too_long(self.line, self.sizes.row));
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
        &self.plan.layout.names
    }

    /// The columns that hold something else than numbers, as far as the first rows show it: not one of their values
    /// there is a number, and not all are missing.
    pub(super) fn words(&self) -> Vec<bool> {
        let of = |column: usize| self.plan.layout.columns.get(column).is_some_and(|column| column.no_numbers);
        (0..self.plan.layout.width()).map(of).collect()
    }

    /// Further words that the reader should know.
    #[cfg(any(feature = "matlab", feature = "spreadsheets"))]
    pub(super) fn tell(&mut self, words: &[String]) {
        let words = words.iter().map(|words| self.plan.layout.told(words));
        self.told.splice(0..0, words);
    }

    /// The columns that are clocks by their names and their first values.
    pub(super) fn times(&self) -> Vec<ClockColumns> {
        self.plan.layout.clocks()
    }

    /// The columns that are called as clocks are, or hold dates.
    pub(super) fn called_clocks(&self) -> Vec<usize> {
        self.plan.layout.called_clocks()
    }

    /// The columns of which the name is not UTF-8 and cannot be shown.
    pub(super) fn nameless(&self) -> impl Iterator<Item = usize> {
        self.undecoded_names.iter().map(|(column, _)| *column)
    }

    /// Reads the selected columns; see [`Reader::read_parts`](super::Reader::read_parts).
    pub(super) fn read_parts(
        mut self,
        selection: &Selection,
        most: Option<usize>,
        progress: &mut dyn FnMut(u64, Option<u64>),
        take: &mut dyn FnMut(Table) -> ControlFlow<()>,
    ) -> Result<(), Error> {
        self.select(selection)?;
        let Self {
            options,
            sizes,
            mut source,
            plan,
            told,
            mut current,
            mut next,
            mut record,
            mut position,
            line,
            ..
        } = self;
        let mut rows = Rows::new(plan.fields.len(), line);
        let mut tallies = vec![Tally::default(); plan.fields.len()];
        loop {
            let text = &current.text()[position..];
            let (whole, tail) = text.split_at(memrchr(b'\n', text).map_or(0, |newline| newline + 1));
            // What is given in parts needs no room for all.
            let share = source.share_read().filter(|_| most.is_none());
            let (read, filled) = rayon::join(
                || plan.read(whole, current.is_unended(), sizes.piece, share, &mut record, &mut rows),
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
                    return Err(plan.layout.unclosed(&row, "the file"));
                }
                progress(source.bytes_read(), source.total());
                let mut last = plan.table(rows, selection, &mut tallies);
                last.words = told.into_iter().chain(plan.told()).chain(plan.counted(&tallies)).collect();
                let _ = take(last);
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
                let after = rows.after();
                let part = plan.table(std::mem::replace(&mut rows, after), selection, &mut tallies);
                if take(part).is_break() {
                    return Ok(());
                }
            }
        }
    }

    /// Gives the rows of the selected columns one by one. With `whole_lines` a last line that has no line break yet is
    /// not taken for a row: who writes the log may not have finished it. Dates count from `start`, written as they are,
    /// or from the first one.
    pub(super) fn stream(
        mut self,
        selection: &Selection,
        whole_lines: bool,
        start: Option<&str>,
    ) -> Result<TextStream, Error> {
        self.select(selection)?;
        let Self { source, mut plan, mut told, current, position, line, .. } = self;
        if let (Some(start), Some(_)) = (start, &plan.times.start) {
            let times = std::mem::take(&mut plan.times).counted_from(start);
            plan.times = times.map_err(|message| Error::data(&plan.layout.file, None, message))?;
        }
        told.extend(plan.told());
        let text = current.raw().get(position..).unwrap_or_default().to_vec();
        TextStream::begin(plan, selection, Text { text, line, source, whole_lines, words: told })
    }

    /// Plans to read the selected columns.
    fn select(&mut self, selection: &Selection) -> Result<(), Error> {
        self.plan.fields = self.fields(selection)?;
        self.plan.times = self.clock(selection)?;
        self.plan.time = selection.time;
        Ok(())
    }

    /// The selected fields in ascending order, if the selection makes sense.
    fn fields(&self, selection: &Selection) -> Result<Vec<usize>, Error> {
        let all = selection.columns.iter().copied().chain(selection.time).chain(selection.date);
        let mut fields: Vec<usize> = all.collect();
        fields.sort_unstable();
        let unusable = |message| Err(Error::data(&self.plan.layout.file, None, message));
        if let Some(twice) = fields.windows(2).find(|pair| pair[0] == pair[1]) {
            return unusable(format!(
                "{} is selected twice; select it once",
                self.plan.layout.column(twice[0])
            ));
        }
        if let Some(beyond) = fields.iter().find(|&&field| field >= self.plan.layout.width()) {
            let width = self.plan.layout.width();
            return unusable(format!("there is no column {}; select from the first {width}", beyond + 1));
        }
        match self.undecoded_names.iter().find(|(index, _)| fields.contains(index)) {
            Some((_, error)) => Err(error.clone()),
            None => Ok(fields),
        }
    }

    /// How the times of the selected columns are read, from those in the first row on.
    fn clock(&mut self, selection: &Selection) -> Result<Times, Error> {
        let Selection { time: Some(time), date, .. } = *selection else { return Ok(Times::default()) };
        // A row of another width is refused when it is read.
        if self.record.len() < self.plan.layout.width() {
            return Ok(Times::default());
        }
        let own = self.column_clock(time)?;
        let days = date.map(|date| self.column_clock(date)).transpose()?;
        let row = self.row();
        let field = |column| self.plan.layout.dialect.trimmed(row.record.field(column));
        let start = match (&days, date) {
            (Some(days), Some(date)) => days.start_at(&own).or_else(|| days.start(field(date))),
            _ => own.start(field(time)),
        };
        Ok(Times { clock: own, date, days, start })
    }

    /// How the times of a column are read.
    fn column_clock(&mut self, column: usize) -> Result<Clock, Error> {
        let row = self.row();
        let field = self.plan.layout.dialect.trimmed(row.record.field(column));
        let fault = |message: String| self.plan.layout.first_fault(&row, column, &message);
        let recognised = self.plan.layout.times(column, &self.options).map_err(fault)?;
        let clock = match &recognised {
            Some(known) => Clock::begin(field, &known.written, &self.plan.numbers),
            None => Clock::decide(field, self.options.time_format.as_deref(), &self.plan.numbers),
        };
        let clock = clock.map_err(fault)?;
        if let Some(told) = recognised.and_then(|known| known.told) {
            self.told.push(self.plan.layout.told(&format!("{}: {told}", self.plan.layout.column(column))));
        }
        Ok(clock)
    }
}
