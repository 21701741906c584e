//! How lines divide into fields.

use memchr::memchr;

/// What separates fields and what is no row at all.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) struct Dialect {
    /// The byte between two fields.
    pub(super) delimiter: u8,
    /// The byte with which a comment line starts.
    pub(super) comment: Option<u8>,
    /// Whether runs of blanks separate fields; the last one of a run was made the delimiter.
    pub(super) blanks: bool,
}

impl Dialect {
    /// Fields between bytes of this kind; a space stands for runs of blanks.
    pub(super) fn new(delimiter: u8, comment: Option<u8>) -> Self {
        let blanks = delimiter == b' ';
        Self { delimiter: if blanks { b'\t' } else { delimiter }, comment, blanks }
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

    /// The sign with which a line begins if that is one of comments, although none were declared.
    pub(super) fn mark(&self, line: &[u8]) -> Option<u8> {
        let content = line.trim_ascii_start();
        let sign = content.first().copied().filter(|_| self.comment.is_none())?;
        (matches!(sign, b'#' | b'%') || content.starts_with(b"//")).then_some(sign)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blanks_are_trimmed_unless_they_delimit() {
        let comma = Dialect { delimiter: b',', comment: None, blanks: false };
        let tab = Dialect { delimiter: b'\t', comment: None, blanks: false };
        assert_eq!(comma.trimmed(b" \t1.5 "), b"1.5");
        assert_eq!(tab.trimmed(b" 1.5\t"), b"1.5\t");
        assert_eq!(comma.trimmed(b" \t "), b"");
    }

    #[test]
    fn blank_lines_and_comments_are_skipped() {
        let dialect = Dialect { delimiter: b'\t', comment: Some(b'#'), blanks: false };
        assert_eq!(dialect.skipped_line(b"  \n1"), Some(3));
        assert_eq!(dialect.skipped_line(b" # x\n1"), Some(5));
        assert_eq!(dialect.skipped_line(b"\t\n"), None); // two empty fields
        assert_eq!(dialect.skipped_line(b"1 # x\n"), None);
        assert_eq!(dialect.skipped_line(b"# unfinished"), None);
        assert_eq!(dialect.skipped_line(b""), None);
    }
}
