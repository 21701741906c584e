//! How lines divide into fields.

use memchr::memchr;

use super::record::Record;

/// The delimiters that are recognised, in the order of preference between two that fit equally well: a comma
/// may be a decimal comma or part of a text, a tab hardly ever is.
const DELIMITERS: [u8; 3] = [b'\t', b';', b','];

/// How many rows are read to recognise the delimiter.
const SAMPLE: usize = 64;

/// What separates fields and what is no row at all.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) struct Dialect {
    /// The byte between two fields.
    pub(super) delimiter: u8,
    /// The byte with which a comment line starts.
    pub(super) comment: Option<u8>,
}

impl Dialect {
    /// Recognises the delimiter from the first rows of a text.
    ///
    /// It is the one that most rows have equally often. A text in which most rows have none has one column.
    pub(super) fn recognise(text: &[u8], comment: Option<u8>, decimal_comma: bool) -> Self {
        let (mut best, mut most) = (b';', 0);
        for delimiter in DELIMITERS {
            if delimiter == b',' && decimal_comma || Some(delimiter) == comment {
                continue;
            }
            let dialect = Self { delimiter, comment };
            let agreeing = dialect.agreeing_rows(text);
            if agreeing > most {
                (best, most) = (delimiter, agreeing);
            }
        }
        Self { delimiter: best, comment }
    }

    /// How many of the first rows have the most frequent number of fields, unless that is one field.
    fn agreeing_rows(&self, mut text: &[u8]) -> usize {
        let mut record = Record::new(self.delimiter);
        let mut counts = Vec::new();
        while counts.len() < SAMPLE {
            if let Some(length) = self.skipped_line(text) {
                text = &text[length..];
            } else if let Some(length) = record.read(text) {
                text = &text[length..];
                counts.push(record.len());
            } else {
                break;
            }
        }
        let agreeing = |count: usize| counts.iter().filter(|&&other| other == count).count();
        match counts.iter().map(|&count| (agreeing(count), count)).max() {
            Some((rows, count)) if count > 1 => rows,
            _ => 0,
        }
    }

    /// Whether a byte may surround the content of a field without being part of it.
    pub(super) fn is_blank(&self, byte: u8) -> bool {
        matches!(byte, b' ' | b'\t') && byte != self.delimiter
    }

    /// A field without the blanks around it.
    pub(super) fn trimmed<'a>(&self, mut field: &'a [u8]) -> &'a [u8] {
        while let [first, rest @ ..] = field
            && self.is_blank(*first)
        {
            field = rest;
        }
        while let [rest @ .., last] = field
            && self.is_blank(*last)
        {
            field = rest;
        }
        field
    }

    /// The length of the line at the front of a text if it is blank or a comment, its newline included.
    pub(super) fn skipped_line(&self, text: &[u8]) -> Option<usize> {
        // Most lines are seen at once to be neither.
        if matches!(text.first(), Some(b'0'..=b'9' | b'-')) {
            return None;
        }
        let start = text.iter().position(|&byte| !self.is_blank(byte))?;
        let first = text[start];
        if first == b'\n' {
            Some(start + 1)
        } else if Some(first) == self.comment {
            memchr(b'\n', &text[start..]).map(|newline| start + newline + 1)
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn delimiter(text: &str) -> char {
        char::from(Dialect::recognise(text.as_bytes(), Some(b'#'), false).delimiter)
    }

    #[test]
    fn the_most_consistent_delimiter_wins() {
        assert_eq!(delimiter("t,u,y\n1,2,3\n"), ',');
        assert_eq!(delimiter("t;u;y\n1;2;3\n"), ';');
        assert_eq!(delimiter("t\tu\n1\t2\n"), '\t');
        // Decimal commas, with and without a header.
        assert_eq!(delimiter("u;y\n1,5;2,5\n3,5;4,5\n"), ';');
        assert_eq!(delimiter("1,5;2,5\n3,5;4,5\n"), ';');
        // A text column that holds the other delimiter, most of the time.
        assert_eq!(delimiter("t,u,note\n1,2,a;b\n1,2,a;b\n"), ',');
        // Quoted and commented delimiters do not count.
        assert_eq!(delimiter("# a;b\n\"a;b\",c\n1,2\n"), ',');
        // A comma in the name of a single column.
        assert_ne!(delimiter("temperature, °C\n1\n2\n"), ',');
        // One ragged row does not change the verdict.
        assert_eq!(delimiter("a,b\n1,2\n1,2,3\n1,2\n"), ',');
    }

    #[test]
    fn a_decimal_comma_is_no_delimiter() {
        let dialect = Dialect::recognise(b"y\n1,5\n2,5\n", None, true);
        assert_ne!(dialect.delimiter, b',');
    }

    #[test]
    fn blanks_are_trimmed_unless_they_delimit() {
        let comma = Dialect { delimiter: b',', comment: None };
        let tab = Dialect { delimiter: b'\t', comment: None };
        assert_eq!(comma.trimmed(b" \t1.5 "), b"1.5");
        assert_eq!(tab.trimmed(b" 1.5\t"), b"1.5\t");
        assert_eq!(comma.trimmed(b" \t "), b"");
    }

    #[test]
    fn blank_lines_and_comments_are_skipped() {
        let dialect = Dialect { delimiter: b'\t', comment: Some(b'#') };
        assert_eq!(dialect.skipped_line(b"  \n1"), Some(3));
        assert_eq!(dialect.skipped_line(b" # x\n1"), Some(5));
        assert_eq!(dialect.skipped_line(b"\t\n"), None); // two empty fields
        assert_eq!(dialect.skipped_line(b"1 # x\n"), None);
        assert_eq!(dialect.skipped_line(b"# unfinished"), None);
        assert_eq!(dialect.skipped_line(b""), None);
    }
}
