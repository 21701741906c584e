//! Where the names, the units and the first row of a text are.

use super::lines::{Line, Lines};
use super::sort::Sort;
use crate::{Header, Options};

/// Where the names and the rows are.
#[derive(Default)]
pub(crate) struct Head {
    /// Where the names start, or the first row if there are none, and on which line.
    pub(crate) start: usize,
    pub(crate) line: u64,
    /// Whether there are names, and how many lines between them and the first row are left out.
    pub(crate) has_names: bool,
    pub(crate) left_out: usize,
    /// The names, where a reader of rows would not find them so.
    pub(crate) names: Option<Vec<String>>,
    /// The number of fields in a row where names say otherwise: a last field may be a comment.
    pub(crate) width: Option<usize>,
    /// The units of the columns, where a line has them.
    pub(crate) units: Vec<String>,
    /// What the reader should know, in plain words.
    pub(crate) words: Vec<String>,
    /// How many lines there are before the first row.
    pub(super) rows: usize,
    /// The sign of comments, where lines above the rows begin with one.
    pub(super) comment: Option<u8>,
}

impl Head {
    /// # Errors
    /// A message for a line of names that is not there.
    pub(super) fn find(lines: &Lines<'_>, kinds: &[Option<Sort>], options: &Options) -> Result<Self, String> {
        let all = &lines.lines;
        let plain = Self::plain(lines, options);
        let place = match options.header {
            Header::None => return Ok(plain),
            Header::Line(wanted) => all.iter().position(|line| line.number == wanted).ok_or_else(|| {
                format!(
                    "`header-row` {wanted}: there is no row on that line; give the line that has the names"
                )
            })?,
            Header::Recognised => {
                let first = all.iter().position(|line| line.fits(kinds));
                let Some(first) = first.filter(|_| kinds.iter().any(Option::is_some)) else {
                    return Ok(plain);
                };
                // Rows that are left out may look like the first.
                let end = first.saturating_sub(options.skip_rows).max(first.min(1));
                match names(lines, kinds, end) {
                    Some(place) => place,
                    None => return Ok(plain.without_names(lines, kinds, first)),
                }
            }
        };
        Ok(plain.with_names(lines, kinds, place, options))
    }

    /// The first line has the names, if it is not found to be otherwise.
    fn plain(lines: &Lines<'_>, options: &Options) -> Self {
        let (start, line) = lines.lines.first().map_or((0, 1), |line| (line.start, line.number));
        let has_names = options.header != Header::None;
        let (left_out, rows) = (options.skip_rows, usize::from(has_names) + options.skip_rows);
        Self { start, line, has_names, left_out, rows, ..Self::default() }
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
        let told = format!(
            "line {number} is the first row, and no line above it has names: columns are called 1, 2, …; `header-row` \
             {number} would take the names from it"
        );
        Self {
            start,
            line: number,
            rows: first,
            words: vec![told],
            comment: comment_above(all, first),
            ..Self::default()
        }
    }

    /// A text with its names on the line at `place`.
    fn with_names(
        mut self,
        lines: &Lines<'_>,
        kinds: &[Option<Sort>],
        place: usize,
        options: &Options,
    ) -> Self {
        let (all, width) = (&lines.lines, kinds.len());
        let line = &all[place];
        let mut rows = place + 1;
        // Whoever says how many rows are left out has counted them.
        while options.skip_rows == 0
            && let Some(next) = all.get(rows).filter(|next| lines.may_be_units(next) && !next.fits(kinds))
            && next.sorts.len() == line.sorts.len()
        {
            self.words.push(format!(
                "line {} is read as units; `skip-rows` says how many lines below the names are left out",
                next.number
            ));
            if self.units.is_empty() {
                self.units = texts(lines.fields(next).iter());
            }
            rows += 1;
        }
        if all[..place].iter().any(|line| !line.is_marked()) && options.header == Header::Recognised {
            self.words.push(format!(
                "the names are on line {}, and what is above is left out; `header-row` names another line",
                line.number
            ));
        }
        let (marker, named) = (lines.marker(line), lines.names_on(line));
        let has_comments = named == width + 1 && lines.ends_with_comments(line);
        let has_no_name = named + 1 == width && lines.end_without_value(width, rows);
        self.width = (has_comments || has_no_name).then_some(named.min(width));
        self.names = lines.wide_names(line).filter(|wide| line.sorts.len() != width && wide.len() == width);
        if marker > 0 || !line.is_marked() {
            self.comment = comment_above(all, rows);
        }
        Self {
            start: line.start + marker,
            line: line.number,
            has_names: true,
            left_out: rows - place - 1 + options.skip_rows,
            rows: rows + options.skip_rows,
            ..self
        }
    }
}

impl Lines<'_> {
    /// The length of the sign in front of names that makes a comment of them, with the blanks after it. It is zero
    /// where no blank follows: then the sign may be part of the first name.
    fn marker(&self, line: &Line) -> usize {
        let text = &self.text[line.start..];
        let blanks = |text: &[u8]| text.iter().take_while(|byte| matches!(byte, b' ' | b'\t')).count();
        let before = blanks(text);
        let signs = text[before..].iter().take_while(|byte| b"#%/".contains(byte)).count();
        match blanks(&text[before + signs..]) {
            after if line.is_marked() && after > 0 => before + signs + after,
            _ => 0,
        }
    }

    /// How many names a line has: where blanks separate, a sign in front of them is a field and no name.
    fn names_on(&self, line: &Line) -> usize {
        line.sorts.len() - usize::from(self.dialect.blanks && self.marker(line) > 0)
    }

    /// Whether the last field of all lines of this width from one on is empty or words, such as a comment.
    fn end_without_value(&self, width: usize, first: usize) -> bool {
        let mut rows = self.lines.iter().skip(first).filter(|line| line.sorts.len() == width);
        rows.all(|line| matches!(line.sorts.last(), Some(Sort::Missing | Sort::Word)))
    }

    /// Where blanks separate: the names of a line in which single blanks belong to them, and longer runs separate.
    fn wide_names(&self, line: &Line) -> Option<Vec<String>> {
        if !self.dialect.blanks {
            return None;
        }
        let rest = &self.text[line.start..];
        let mut own = rest[..memchr::memchr(b'\n', rest).unwrap_or(rest.len())].to_vec();
        for place in 1..own.len() {
            if own[place] == b'\t' && own[place - 1] != b' ' {
                own[place] = b' ';
            }
        }
        Some(texts(own.split(|byte| *byte == b'\t').map(<[u8]>::trim_ascii)))
    }

    /// Whether a line below the names can be one of units.
    fn may_be_units(&self, line: &Line) -> bool {
        let is_unit = |field: &Vec<u8>| field.is_empty() || is_unit(field);
        !line.is_marked() && (line.has_words() || self.fields(line).iter().all(is_unit))
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
    lines.iter().take(line).find_map(|line| line.mark)
}

fn texts(fields: impl Iterator<Item: AsRef<[u8]>>) -> Vec<String> {
    fields.map(|field| String::from_utf8_lossy(field.as_ref()).into_owned()).collect()
}

/// The line of names among those before `end`: the last line of words that goes with the rows and holds no units.
fn names(lines: &Lines<'_>, kinds: &[Option<Sort>], end: usize) -> Option<usize> {
    let (all, width) = (&lines.lines, kinds.len());
    let goes_with_rows = |line: &Line| {
        let own = line.sorts.len();
        own == width
            || lines.names_on(line) == width
            || own > width && lines.wide_names(line).is_some_and(|wide| wide.len() == width)
            || own == width + 1 && lines.ends_with_comments(line)
            || own + 1 == width && lines.end_without_value(width, end)
    };
    let candidates: Vec<usize> =
        (0..end).rev().filter(|&place| all[place].has_words() && goes_with_rows(&all[place])).collect();
    let found = |is_good: fn(&[Vec<u8>]) -> bool| {
        candidates.iter().find(|&&place| {
            let fields = lines.fields(&all[place]);
            !are_units(&fields) && is_good(&fields)
        })
    };
    let told = found(|fields| fields.iter().all(|field| !field.is_empty()) && are_names(fields))
        .or_else(|| found(are_names));
    // Names that are partly numbers, and what is no row below them, are what the first line is.
    let otherwise = || {
        (end > 0 && !all[0].is_marked() && (all[0].sorts.len() == width || all[0].sorts.len() > 1))
            .then_some(0)
    };
    told.or(candidates.last()).copied().or_else(otherwise)
}

/// Whether most fields have a name, and no two the same.
fn are_names(fields: &[Vec<u8>]) -> bool {
    let mut named = filled(fields);
    let all = named.len();
    named.sort_unstable();
    named.dedup();
    2 * all > fields.len() && named.len() == all
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
    let named = filled(fields);
    let units = named.iter().filter(|field| is_unit(field)).count();
    !named.is_empty() && 2 * units >= named.len()
}

/// The fields that are not empty.
fn filled(fields: &[Vec<u8>]) -> Vec<&[u8]> {
    fields.iter().map(Vec::as_slice).filter(|field| !field.is_empty()).collect()
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
