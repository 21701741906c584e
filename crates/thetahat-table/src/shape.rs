//! What the first lines of a text show: what separates its fields, which line has the names, where the rows begin, and how
//! numbers are written.
//!
//! The names are the last line of words above the rows that has as many fields as they; units may stand between. What is
//! above is left out. Whatever was not certain is said in [`Shape::words`], with the option that says otherwise.

use super::blanks;
use super::clock::Sample;
use super::dialect::Dialect;
use super::error::{escaped, shortened};
use super::number::{Notation, Numbers};
use super::record::Record;
use super::words::{self, States};
use super::{Header, Options};

/// The delimiters that are recognised, in the order of preference between two that fit equally well: a comma
/// may be a decimal comma or part of a text, a tab hardly ever is.
const DELIMITERS: [u8; 3] = [b'\t', b';', b','];
/// How many lines, and how many fields in them, say what separates fields and what the columns hold.
const MOST_LINES: usize = 1000;
const MOST_FIELDS: usize = 20_000;
/// Where most of so many lines are values, there is nothing to doubt.
const FEW_LINES: usize = 32;
/// How many different words of a column are told.
const MOST_WORDS: usize = 5;

/// The shape of a text.
pub(super) struct Shape {
    pub(super) dialect: Dialect,
    /// Where the names start, or the first row if there are none, and on which line.
    pub(super) start: usize,
    pub(super) line: u64,
    /// Whether there are names, and how many lines between them and the first row are left out.
    pub(super) has_names: bool,
    pub(super) left_out: usize,
    /// The names, where a reader of rows would not find them so.
    pub(super) names: Option<Vec<Vec<u8>>>,
    /// The number of fields in a row where names say otherwise: a last field may be a comment.
    pub(super) width: Option<usize>,
    pub(super) decimal_comma: bool,
    pub(super) grouped: bool,
    pub(super) columns: Vec<Column>,
    /// The units of the columns, where a line has them.
    pub(super) units: Vec<String>,
    /// What the reader should know, in plain words.
    pub(super) words: Vec<String>,
}

/// What a column holds, as far as the first rows show it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Column {
    /// Two words for off and on, and nothing else.
    pub(super) states: Option<States>,
    /// Some words that are no numbers, if it holds nothing else.
    pub(super) words: Vec<String>,
    /// Whether it holds something, but not one number.
    pub(super) no_numbers: bool,
    /// Its values, as far as they may be times.
    pub(super) sample: Sample,
}

/// What is in a field.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Sort {
    Missing,
    Status,
    Number,
    Date,
    State,
    Word,
}

impl Sort {
    fn of(field: &[u8], numbers: &Numbers) -> Self {
        if numbers.is_missing(field) {
            Self::Missing
        } else if numbers.read(field).is_ok() || numbers.is_nearly(field) {
            Self::Number
        } else if is_date(field) {
            Self::Date
        } else if States::of(field).next().is_some() {
            Self::State
        } else if words::status(field).is_some() {
            Self::Status
        } else {
            Self::Word
        }
    }

    fn is_missing(self) -> bool {
        matches!(self, Self::Missing | Self::Status)
    }
}

/// Whether a field looks like a date or a time of day.
fn is_date(field: &[u8]) -> bool {
    const MONTHS: [&[u8]; 12] =
        [b"Jan", b"Feb", b"Mar", b"Apr", b"May", b"Jun", b"Jul", b"Aug", b"Sep", b"Oct", b"Nov", b"Dec"];
    let allowed = |byte: &u8| byte.is_ascii_digit() || b" -/:.,TZ+apmAPM[]_".contains(byte);
    // As in 10-Jan-2024.
    if let [_, b'-', rest @ ..] | [_, _, b'-', rest @ ..] = field
        && let Some((month, rest)) = rest.split_at_checked(3)
        && MONTHS.iter().any(|known| known.eq_ignore_ascii_case(month))
    {
        return rest.first() == Some(&b'-') && rest[1..].iter().all(allowed);
    }
    let digits = field.iter().filter(|byte| byte.is_ascii_digit()).count();
    let zone = field.iter().position(|&byte| byte == b'[').unwrap_or(field.len());
    field.first().is_some_and(u8::is_ascii_digit)
        && digits >= 3
        && field[..zone].iter().all(allowed)
        && field.iter().any(|byte| b"-/:.".contains(byte))
}

/// A line that is neither blank nor a comment.
struct Line {
    start: usize,
    number: u64,
    sorts: Vec<Sort>,
    /// The sign with which it begins if that is one of comments, although none were declared.
    mark: Option<u8>,
}

/// Some text as lines of fields.
struct Lines<'t> {
    text: &'t [u8],
    dialect: Dialect,
    lines: Vec<Line>,
}

/// The signs with which comments begin.
const MARKS: [u8; 2] = [b'#', b'%'];

impl<'t> Lines<'t> {
    /// The first lines of a text from `start` on, which is on line `number`.
    fn read(
        text: &'t [u8],
        (start, number): (usize, u64),
        dialect: Dialect,
        numbers: &Numbers,
        most: usize,
    ) -> Self {
        let mut record = Record::new(dialect.delimiter);
        let (mut position, mut number, mut lines, mut fields) = (start, number, Vec::new(), 0);
        while lines.len() < most && fields < MOST_FIELDS {
            let rest = &text[position..];
            if let Some(length) = dialect.skipped_line(rest) {
                (position, number) = (position + length, number + 1);
                continue;
            }
            let Some(length) = record.read(rest) else { break };
            let sorts: Vec<Sort> = (0..record.len())
                .map(|field| Sort::of(dialect.trimmed(record.field(field)), numbers))
                .collect();
            fields += sorts.len();
            let mark = mark(rest, dialect);
            lines.push(Line { start: position, number, sorts, mark });
            number += memchr::memchr_iter(b'\n', &rest[..length]).count() as u64;
            position += length;
        }
        Self { text, dialect, lines }
    }

    /// The fields of a line.
    fn fields(&self, line: &Line) -> Vec<Vec<u8>> {
        let mut record = Record::new(self.dialect.delimiter);
        record.read(&self.text[line.start..]);
        (0..record.len()).map(|field| self.dialect.trimmed(record.field(field)).to_vec()).collect()
    }

    /// The most frequent number of fields, unless that is one, and how many lines have it.
    fn width(&self) -> (usize, usize) {
        let own = self.lines.iter().filter(|line| !line.is_marked());
        most_frequent(&own.map(|line| line.sorts.len()).collect::<Vec<_>>())
    }

    /// How many lines have nothing in their fields that is a word.
    fn rows_of_values(&self) -> usize {
        let values = |line: &&Line| line.sorts.len() > 1 && !line.sorts.contains(&Sort::Word);
        self.lines.iter().filter(values).count()
    }

    /// What most fields of each column are: a number or a date, a state, or anything.
    fn kinds(&self, width: usize) -> Vec<Option<Sort>> {
        let rows: Vec<&Line> =
            self.lines.iter().filter(|line| !line.is_marked() && line.sorts.len() == width).collect();
        // Names, units and titles are at the beginning.
        let rows = &rows[rows.len() / 2..];
        let kind = |column: usize| {
            let count =
                |wanted: &[Sort]| rows.iter().filter(|line| wanted.contains(&line.sorts[column])).count();
            let numbers = count(&[Sort::Number, Sort::Date]);
            let (states, words) = (count(&[Sort::State]), count(&[Sort::Word]));
            match numbers.max(states).max(words) {
                0 => None,
                most if most == numbers => Some(Sort::Number),
                most if most == states => Some(Sort::State),
                _ => None,
            }
        };
        (0..width).map(kind).collect()
    }
}

impl Line {
    fn is_marked(&self) -> bool {
        self.mark.is_some()
    }

    /// Whether it can be a row of columns of these kinds.
    fn fits(&self, kinds: &[Option<Sort>]) -> bool {
        let extra = self.sorts.get(kinds.len()).is_none_or(|last| matches!(last, Sort::Word | Sort::Missing));
        let as_long = self.sorts.len() == kinds.len() || self.sorts.len() == kinds.len() + 1 && extra;
        let alike = |(sort, kind): (&Sort, &Option<Sort>)| match kind {
            _ if sort.is_missing() => true,
            Some(Sort::State) => *sort == Sort::State,
            Some(_) => matches!(sort, Sort::Number | Sort::Date),
            None => true,
        };
        !self.is_marked() && as_long && self.sorts.iter().zip(kinds).all(alike)
    }

    /// Whether it has words and no numbers.
    fn has_words(&self) -> bool {
        let wordless = |sort: &Sort| matches!(sort, Sort::Number | Sort::Date);
        self.sorts.iter().any(|sort| !sort.is_missing() && !wordless(sort))
            && !self.sorts.iter().any(wordless)
    }
}

impl Shape {
    /// Recognises the shape of a text, which ends with a newline.
    ///
    /// # Errors
    /// A message for a line of names that is not there.
    pub(super) fn recognise(text: &[u8], options: &Options) -> Result<Self, String> {
        let numbers =
            Numbers::new(options.decimal_comma == Some(true), &options.missing).with(true, &options.values);
        let (first, said) = separator(text);
        let delimiter = options.delimiter.or(said);
        let comment = options.comment;
        let separated;
        let (text, mut dialect) = match delimiter {
            Some(b' ') => {
                separated = blanks::separated(text);
                (separated.as_slice(), Dialect { delimiter: b'\t', comment, blanks: true })
            }
            Some(delimiter) => (text, Dialect { delimiter, comment, blanks: false }),
            None => {
                let best = most_consistent(text, first, options, &numbers);
                if best.blanks {
                    separated = blanks::separated(text);
                    (separated.as_slice(), best)
                } else {
                    (text, best)
                }
            }
        };
        let lines = Lines::read(text, first, dialect, &numbers, MOST_LINES);
        let (_, width) = lines.width();
        let kinds = lines.kinds(width);
        let head = Head::find(&lines, &kinds, options)?;
        if head.comment.is_some() {
            dialect.comment = head.comment;
        }
        let rows: Vec<&Line> = lines.lines[head.rows.min(lines.lines.len())..]
            .iter()
            .filter(|line| !line.is_marked() || dialect.comment.is_none())
            .take_while(|line| line.sorts.len() == width || line.fits(&kinds))
            .collect();
        let mut shape = Self {
            dialect,
            start: head.start,
            line: head.line,
            has_names: head.has_names,
            left_out: head.left_out,
            names: head.names,
            width: head.width,
            decimal_comma: false,
            grouped: false,
            columns: Vec::new(),
            units: head.units,
            words: head.words,
        };
        shape.read_columns(&lines, &rows, options);
        Ok(shape)
    }

    /// What the rows show of the columns and of how numbers are written.
    fn read_columns(&mut self, lines: &Lines<'_>, rows: &[&Line], options: &Options) {
        #[derive(Default)]
        struct Found {
            numbers: usize,
            others: usize,
            dates: usize,
            states: Option<Vec<States>>,
            words: Vec<String>,
        }
        let mut found: Vec<Found> = Vec::new();
        let mut shown: Vec<Notation> = Vec::new();
        let mut example = String::new();
        let mut record = Record::new(self.dialect.delimiter);
        for line in rows {
            record.read(&lines.text[line.start..]);
            for (column, sort) in line.sorts.iter().enumerate() {
                if found.len() <= column {
                    found.push(Found::default());
                }
                let own = &mut found[column];
                let field = self.dialect.trimmed(record.field(column));
                match sort {
                    Sort::Missing => {}
                    Sort::Status => own.others += 1,
                    Sort::Date => own.dates += 1,
                    Sort::Number => {
                        own.numbers += 1;
                        if let Some(notation) =
                            Notation::of(field).filter(|notation| !shown.contains(notation))
                        {
                            shown.push(notation);
                            if notation == Notation::OneComma {
                                example = String::from_utf8_lossy(field).into_owned();
                            }
                        }
                    }
                    Sort::State => {
                        let known: Vec<States> = States::of(field).collect();
                        match &mut own.states {
                            Some(states) => states.retain(|states| known.contains(states)),
                            none => *none = Some(known),
                        }
                    }
                    Sort::Word => {
                        own.others += 1;
                        let word = escaped(&shortened(&String::from_utf8_lossy(field)));
                        if own.words.len() <= MOST_WORDS && !own.words.contains(&word) {
                            own.words.push(word);
                        }
                    }
                }
            }
        }
        self.columns = found
            .into_iter()
            .map(|found| {
                let Found { numbers, others, dates, states, words } = found;
                let states = states.filter(|_| numbers + dates == 0 && words.is_empty());
                let states = states.and_then(|states| states.first().copied());
                let no_numbers = numbers == 0 && states.is_none() && others + dates > 0;
                Column {
                    states,
                    words: if no_numbers && dates == 0 { words } else { Vec::new() },
                    no_numbers,
                    sample: Sample::default(),
                }
            })
            .collect();
        self.read_notation(&shown, &example, options);
        self.read_samples(lines, rows, options);
    }

    /// Reads the columns that may be times.
    fn read_samples(&mut self, lines: &Lines<'_>, rows: &[&Line], options: &Options) {
        let numbers = Numbers::new(self.decimal_comma, &options.missing).with(self.grouped, &options.values);
        let mut record = Record::new(self.dialect.delimiter);
        for line in rows {
            record.read(&lines.text[line.start..]);
            for ((field, sort), column) in line.sorts.iter().enumerate().zip(&mut self.columns) {
                let text = self.dialect.trimmed(record.field(field));
                match sort {
                    Sort::Number => column.sample.numbers.extend(numbers.read(text)),
                    Sort::Date => column.sample.dates.push(String::from_utf8_lossy(text).into_owned()),
                    _ => {}
                }
            }
        }
    }

    /// Decides what a comma and a point in numbers mean.
    fn read_notation(&mut self, shown: &[Notation], example: &str, options: &Options) {
        let is_shown = |wanted: &[Notation]| wanted.iter().any(|notation| shown.contains(notation));
        let grouped =
            |comma| if comma { Notation::Comma { grouped: true } } else { Notation::Point { grouped: true } };
        let point = is_shown(&[Notation::Point { grouped: false }, grouped(false)]);
        let comma = is_shown(&[Notation::Comma { grouped: false }, grouped(true)]);
        let one_comma = is_shown(&[Notation::OneComma]);
        // With nothing but `1,234` the delimiter has to say: where it is a comma, that is no decimal sign.
        let only_one_comma = one_comma && !comma && !point && !is_shown(&[Notation::OnePoint]);
        self.decimal_comma = options
            .decimal_comma
            .unwrap_or(comma && !point || only_one_comma && self.dialect.delimiter != b',');
        self.grouped = is_shown(&[grouped(self.decimal_comma)]) || options.decimal_comma == Some(false);
        if options.decimal_comma.is_none() && only_one_comma {
            if self.decimal_comma {
                self.words.push(format!(
                    "numbers such as {example} are read with a decimal comma; `decimal-comma`=no reads them as whole numbers"
                ));
            } else {
                self.grouped = true;
                self.words.push(format!(
                    "numbers such as {example} are read as whole numbers; `decimal-comma` reads the comma as the decimal sign"
                ));
            }
        }
    }
}

/// Where a text starts after a first line that names the delimiter, as Excel writes it, and that delimiter.
fn separator(text: &[u8]) -> ((usize, u64), Option<u8>) {
    let end = memchr::memchr(b'\n', text).unwrap_or(text.len());
    match text[..end].trim_ascii_start() {
        [b's' | b'S', b'e' | b'E', b'p' | b'P', b'=', delimiter, rest @ ..]
            if rest.trim_ascii().is_empty() && end < text.len() =>
        {
            ((end + 1, 2), Some(*delimiter))
        }
        _ => ((0, 1), None),
    }
}

/// The delimiter that most lines have equally often. A text in which most lines have none has one column. Blanks are it where they
/// alone make values of what is between them.
fn most_consistent(text: &[u8], first: (usize, u64), options: &Options, numbers: &Numbers) -> Dialect {
    let dialect = |delimiter, blanks| Dialect { delimiter, comment: options.comment, blanks };
    let (mut best, mut most) = (dialect(b';', false), 0);
    for delimiter in DELIMITERS {
        if delimiter == b',' && options.decimal_comma == Some(true) || Some(delimiter) == options.comment {
            continue;
        }
        let candidate = dialect(delimiter, false);
        let (agreeing, _) = most_frequent(&counts(&text[first.0..], candidate));
        if agreeing > most {
            (best, most) = (candidate, agreeing);
        }
    }
    let few = Lines::read(text, first, best, numbers, FEW_LINES);
    let may_be_one_column = best.delimiter == b',' && few.is_one_column_of_decimal_commas();
    if 2 * few.rows_of_values() > few.lines.len() && !may_be_one_column {
        return best;
    }
    let lines = Lines::read(text, first, best, numbers, MOST_LINES);
    if may_be_one_column && lines.is_one_column_of_decimal_commas() {
        return dialect(b';', false);
    }
    let separated = blanks::separated(text);
    let by_blanks = Lines::read(&separated, first, dialect(b'\t', true), numbers, MOST_LINES);
    let values = by_blanks.rows_of_values();
    if by_blanks.width().0 >= most && values > lines.rows_of_values() { dialect(b'\t', true) } else { best }
}

/// How many fields the first lines of a text have, but for comments.
fn counts(mut text: &[u8], dialect: Dialect) -> Vec<usize> {
    let mut record = Record::new(dialect.delimiter);
    let mut counts = Vec::new();
    while counts.len() < MOST_LINES {
        if let Some(length) = dialect.skipped_line(text) {
            text = &text[length..];
            continue;
        }
        let end = memchr::memchr(b'\n', text);
        let plain = end.map(|end| &text[..end]).filter(|line| memchr::memchr(b'"', line).is_none());
        let (count, length) = match plain {
            Some(line) => (memchr::memchr_iter(dialect.delimiter, line).count() + 1, line.len() + 1),
            None => match record.read(text) {
                Some(length) => (record.len(), length),
                None => break,
            },
        };
        if mark(text, dialect).is_none() {
            counts.push(count);
        }
        text = &text[length..];
    }
    counts
}

/// The sign with which a line begins if that is one of comments, although none were declared.
fn mark(line: &[u8], dialect: Dialect) -> Option<u8> {
    let content = line.trim_ascii_start();
    let sign = content.first().copied().filter(|_| dialect.comment.is_none())?;
    (MARKS.contains(&sign) || content.starts_with(b"//")).then_some(sign)
}

/// The most frequent number of fields, unless that is one, and how many lines have it.
fn most_frequent(counts: &[usize]) -> (usize, usize) {
    let mut sorted = counts.to_vec();
    sorted.sort_unstable();
    let runs = sorted.chunk_by(|a, b| a == b).map(|run| (run.len(), run[0]));
    match runs.max() {
        Some((lines, count)) if count > 1 => (lines, count),
        _ => (0, 1),
    }
}

impl Lines<'_> {
    /// Whether a name without a comma stands above whole numbers in pairs.
    fn is_one_column_of_decimal_commas(&self) -> bool {
        let Some((first, rows)) = self.lines.split_first() else { return false };
        let halves = |line: &Line| {
            let fields = self.fields(line);
            let [whole, decimals] = fields.as_slice() else { return false };
            decimals.iter().all(u8::is_ascii_digit)
                && whole.iter().all(|byte| byte.is_ascii_digit() || *byte == b'-')
        };
        first.sorts.len() == 1 && first.has_words() && !rows.is_empty() && rows.iter().all(halves)
    }
}

/// Where the names and the rows are.
struct Head {
    start: usize,
    line: u64,
    has_names: bool,
    left_out: usize,
    /// The first line that is a row.
    rows: usize,
    names: Option<Vec<Vec<u8>>>,
    width: Option<usize>,
    comment: Option<u8>,
    units: Vec<String>,
    words: Vec<String>,
}

impl Head {
    /// The first line has the names, if it is not found to be otherwise.
    fn plain(lines: &Lines<'_>, options: &Options) -> Self {
        let (start, line) = lines.lines.first().map_or((0, 1), |line| (line.start, line.number));
        let has_names = options.header != Header::None;
        let rows = usize::from(has_names) + options.skip_rows;
        let (left_out, width, comment) = (options.skip_rows, None, None);
        let names = None;
        Self {
            start,
            line,
            has_names,
            left_out,
            rows,
            names,
            width,
            comment,
            units: Vec::new(),
            words: Vec::new(),
        }
    }

    fn find(lines: &Lines<'_>, kinds: &[Option<Sort>], options: &Options) -> Result<Self, String> {
        let plain = Self::plain(lines, options);
        let all = &lines.lines;
        let place = match options.header {
            Header::None => return Ok(plain),
            Header::Line(number) => {
                let found = all.iter().position(|line| line.number == number);
                Some(found.ok_or_else(|| {
                    format!("`header-row` {number}: there is no row on that line; give the line that has the names")
                })?)
            }
            Header::Recognised => None,
        };
        if kinds.iter().all(Option::is_none) && place.is_none() {
            return Ok(plain);
        }
        // The first row, if the names are not known.
        let first = match place {
            Some(place) => place + 1,
            None => match all.iter().position(|line| line.fits(kinds)) {
                Some(first) => first,
                None => return Ok(plain),
            },
        };
        let names = match place {
            Some(place) => Some(place),
            None => names(lines, kinds, first.saturating_sub(options.skip_rows).max(first.min(1))),
        };
        let Some(names) = names else { return Ok(plain.without_names(lines, kinds, first)) };
        Ok(plain.below(lines, kinds, names, options))
    }

    /// A text without a line of names above the row `first`.
    fn without_names(self, lines: &Lines<'_>, kinds: &[Option<Sort>], first: usize) -> Self {
        let all = &lines.lines;
        if first == 0 && is_counting(&lines.fields(&all[0])) && all.len() > 1 {
            let told =
                "the first line counts the columns and is read as their names; `no-header` reads it as a row";
            return Self { words: vec![told.to_owned()], ..self };
        }
        // What is above may be a title; if it has several fields, it is names that do not go with the rows.
        let several = all[..first].iter().any(|line| !line.is_marked() && line.sorts.len() > 1);
        if several || first > 0 && kinds.len() == 1 {
            return self;
        }
        let Line { start, number, .. } = all[first];
        let mut words = self.words;
        words.push(format!(
            "line {number} is the first row, and no line above it has names: columns are called 1, 2, …; `header-row` \
             {number} would take the names from it"
        ));
        let comment = comment_above(all, first);
        Self { start, line: number, has_names: false, left_out: 0, rows: first, words, comment, ..self }
    }

    /// A text with its names on the line `names`.
    fn below(self, lines: &Lines<'_>, kinds: &[Option<Sort>], names: usize, options: &Options) -> Self {
        let all = &lines.lines;
        let line = &all[names];
        let mut words = self.words;
        let (mut rows, mut units) = (names + 1, Vec::new());
        // Whoever says how many rows are left out has counted them.
        while options.skip_rows == 0
            && let Some(next) = all.get(rows).filter(|next| lines.may_be_units(next) && !next.fits(kinds))
            && next.sorts.len() == line.sorts.len()
        {
            words.push(format!(
                "line {} is read as units; `skip-rows` says how many lines below the names are left out",
                next.number
            ));
            if units.is_empty() {
                units = lines
                    .fields(next)
                    .iter()
                    .map(|unit| String::from_utf8_lossy(unit).into_owned())
                    .collect();
            }
            rows += 1;
        }
        if all[..names].iter().any(|line| !line.is_marked()) && options.header == Header::Recognised {
            words.push(format!(
                "the names are on line {}, and what is above is left out; `header-row` names another line",
                line.number
            ));
        }
        let wide = Some(lines.wide_names(line))
            .filter(|wide| line.sorts.len() != kinds.len() && wide.len() == kinds.len());
        let marker = line.marker(lines);
        let own = line.sorts.len() - usize::from(marker > 0 && lines.dialect.blanks);
        let is_short = own == kinds.len() + 1;
        let is_long = own + 1 == kinds.len() && lines.end_without_value(kinds.len(), rows);
        let comment = match line.is_marked() && marker == 0 {
            true => None,
            false => comment_above(all, rows),
        };
        Self {
            start: line.start + marker,
            line: line.number,
            has_names: true,
            left_out: rows - names - 1 + options.skip_rows,
            rows: rows + options.skip_rows,
            width: if is_short && lines.ends_with_comments(line) || is_long {
                Some(own.min(kinds.len()))
            } else {
                None
            },
            names: wide,
            comment,
            units,
            words,
        }
    }
}

impl Line {
    /// The length of the sign in front of names that makes a comment of them, with the blanks after it: none where none follow, as
    /// then the sign may be part of the first name.
    fn marker(&self, lines: &Lines<'_>) -> usize {
        let text = &lines.text[self.start..];
        let blanks = |text: &[u8]| text.iter().take_while(|byte| matches!(byte, b' ' | b'\t')).count();
        let before = blanks(text);
        let signs = text[before..].iter().take_while(|byte| b"#%/".contains(byte)).count();
        match blanks(&text[before + signs..]) {
            after if self.is_marked() && after > 0 => before + signs + after,
            _ => 0,
        }
    }
}

impl Lines<'_> {
    /// Whether the last field of all lines of this width from one on is empty or words, such as a comment.
    fn end_without_value(&self, width: usize, first: usize) -> bool {
        let mut rows = self.lines.iter().skip(first).filter(|line| line.sorts.len() == width);
        rows.all(|line| matches!(line.sorts.last(), Some(Sort::Missing | Sort::Word)))
    }

    /// The names of a line in which single blanks belong to them and longer runs separate, where blanks separate.
    fn wide_names(&self, line: &Line) -> Vec<Vec<u8>> {
        if !self.dialect.blanks {
            return Vec::new();
        }
        let rest = &self.text[line.start..];
        let mut own = rest[..memchr::memchr(b'\n', rest).unwrap_or(rest.len())].to_vec();
        for place in 1..own.len() {
            if own[place] == b'\t' && own[place - 1] != b' ' {
                own[place] = b' ';
            }
        }
        own.split(|byte| *byte == b'\t').map(|name| name.trim_ascii().to_vec()).collect()
    }

    /// Whether a line below the names can be one of units.
    fn may_be_units(&self, line: &Line) -> bool {
        let fields = self.fields(line);
        !line.is_marked()
            && (line.has_words() || fields.iter().all(|field| field.is_empty() || is_unit(field)))
    }

    /// Whether the last of some names is that of comments, which not every row has.
    fn ends_with_comments(&self, line: &Line) -> bool {
        const NAMES: [&str; 8] =
            ["comment", "comments", "note", "notes", "remark", "remarks", "kommentar", "bemerkung"];
        let last = self.fields(line).pop().unwrap_or_default();
        NAMES.iter().any(|name| last.eq_ignore_ascii_case(name.as_bytes()))
    }
}

/// The sign with which comments above a line begin.
fn comment_above(lines: &[Line], line: usize) -> Option<u8> {
    lines[..line.min(lines.len())].iter().find_map(|line| line.mark)
}

/// The line of names above the row `first`: the last line of words that goes with the rows and holds no units.
fn names(lines: &Lines<'_>, kinds: &[Option<Sort>], first: usize) -> Option<usize> {
    let all = &lines.lines;
    let width = kinds.len();
    let goes_with_rows = |line: &Line| {
        let own = line.sorts.len();
        own == width
            || own > width && lines.wide_names(line).len() == width
            || own == width + 1
                && (lines.ends_with_comments(line)
                    || line.is_marked() && line.marker(lines) > 0 && lines.dialect.blanks)
            || own + 1 == width && own > 0 && lines.end_without_value(width, first)
    };
    let candidates: Vec<usize> =
        (0..first).rev().filter(|&place| all[place].has_words() && goes_with_rows(&all[place])).collect();
    let found = |is_good: fn(&[Vec<u8>]) -> bool| {
        candidates.iter().find(|&&place| {
            let fields = lines.fields(&all[place]);
            !are_units(&fields) && is_good(&fields)
        })
    };
    let told = found(|fields| fields.iter().all(|field| !field.is_empty()) && are_names(fields))
        .or(found(are_names));
    // Names that are partly numbers, and what is no row below them, are what the first line is.
    let otherwise = || {
        (first > 0 && !all[0].is_marked() && (all[0].sorts.len() == width || all[0].sorts.len() > 1))
            .then_some(0)
    };
    told.or(candidates.last()).copied().or_else(otherwise)
}

/// Whether most fields have a name, and no two the same.
fn are_names(fields: &[Vec<u8>]) -> bool {
    let named: Vec<&Vec<u8>> = fields.iter().filter(|field| !field.is_empty()).collect();
    let repeats = named.iter().enumerate().any(|(place, name)| named[..place].contains(name));
    2 * named.len() > fields.len() && !repeats
}

/// Whether fields are 0, 1, 2, … or 1, 2, 3, …, as a table without names is written.
fn is_counting(fields: &[Vec<u8>]) -> bool {
    let number = |field: &Vec<u8>| std::str::from_utf8(field).ok()?.parse::<usize>().ok();
    let first = fields.first().and_then(number);
    fields.len() > 1
        && first.is_some_and(|first| {
            first <= 1 && fields.iter().enumerate().all(|(place, field)| number(field) == Some(first + place))
        })
}

/// Whether fields are units.
fn are_units(fields: &[Vec<u8>]) -> bool {
    let named: Vec<&Vec<u8>> = fields.iter().filter(|field| !field.is_empty()).collect();
    let units = named.iter().filter(|field| is_unit(field)).count();
    !named.is_empty() && 2 * units >= named.len()
}

/// Whether a field is a unit: in brackets, or known.
fn is_unit(field: &[u8]) -> bool {
    const UNITS: [&str; 92] = [
        "-", "%", "1", "s", "sec", "ms", "us", "µs", "μs", "ns", "min", "h", "hr", "d", "V", "mV", "kV", "A",
        "mA", "uA", "µA", "kA", "W", "mW", "kW", "MW", "Hz", "kHz", "MHz", "rpm", "1/min", "U/min", "rad",
        "deg", "°", "rad/s", "deg/s", "°/s", "m", "mm", "cm", "km", "m/s", "mm/s", "cm/s", "km/h", "m/s2",
        "m/s^2", "m/s²", "g", "kg", "N", "kN", "Nm", "N.m", "N*m", "Pa", "kPa", "MPa", "hPa", "mbar", "bar",
        "psi", "°C", "degC", "deg C", "C", "K", "°F", "degF", "%RH", "ppm", "l/min", "L/min", "l/s", "l/h",
        "m3/h", "m³/h", "m3/s", "kg/h", "kg/s", "J", "kJ", "kWh", "Ohm", "Ω", "lx", "lux", "dB", "pH", "TS",
        "RN",
    ];
    let Ok(text) = std::str::from_utf8(field) else { return false };
    let bracketed = [('[', ']'), ('(', ')'), ('<', '>')]
        .iter()
        .any(|&(open, close)| text.starts_with(open) && text.ends_with(close));
    let is_date_format = text.contains("yy") && text.to_lowercase().contains("mm");
    bracketed || is_date_format || UNITS.contains(&text)
}

/// Whether a text has as many whole lines as it takes to see a row: more may be yet to come.
pub(super) fn has_row(mut text: &[u8], options: &Options) -> bool {
    // What separates fields does not matter for that.
    let dialect = Dialect { delimiter: b',', comment: options.comment, blanks: false };
    let (line, wanted) = match options.header {
        Header::None => (0, options.skip_rows + 1),
        Header::Recognised => (0, options.skip_rows + 2),
        Header::Line(line) => (line, options.skip_rows + 2),
    };
    let (mut found, mut number) = (0, 1);
    while found < wanted {
        if let Some(length) = dialect.skipped_line(text) {
            text = &text[length..];
        } else if let Some(newline) = memchr::memchr(b'\n', text) {
            let content = text.trim_ascii_start();
            let is_marked = content.first().is_some_and(|first| MARKS.contains(first));
            found += usize::from(number >= line && !(is_marked && found > 0));
            text = &text[newline + 1..];
        } else {
            return false;
        }
        number += 1;
    }
    true
}
