//! Fields that runs of blanks and tabs separate.
//!
//! Such a text becomes one with tabs without changing its length, so that places in it stay what they are: the last
//! blank between two fields becomes a tab, all others become spaces, which are trimmed. Blanks at the ends of a line
//! separate nothing.

use std::io::{self, Read};

/// What is read at once.
const PIECE: usize = 1 << 16;

/// Where in a line the text is.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
struct Place {
    /// Whether there was a field in this line.
    any: bool,
    /// Whether the byte before is a blank.
    blank: bool,
    /// Whether this is inside quotes, or was until the byte before.
    quoted: bool,
    closed: bool,
}

impl Place {
    /// Goes over some text, and makes tabs of what separates fields.
    fn pass(&mut self, text: &mut [u8]) {
        for index in 0..text.len() {
            match text[index] {
                b'\n' => *self = Self::default(),
                b' ' | b'\t' if !self.quoted => {
                    text[index] = b' ';
                    (self.blank, self.closed) = (true, false);
                }
                byte => {
                    let begins = self.blank || !self.any;
                    if self.blank && self.any && index > 0 {
                        text[index - 1] = b'\t';
                    }
                    (self.quoted, self.closed) = match byte {
                        // Two quotes inside quotes are one.
                        b'"' => (!self.quoted && (begins || self.closed), self.quoted),
                        _ => (self.quoted, false),
                    };
                    (self.any, self.blank) = (true, false);
                }
            }
        }
    }
}

/// The same text with a tab between two fields.
pub(super) fn separated(text: &[u8]) -> Vec<u8> {
    let mut text = text.to_vec();
    Place::default().pass(&mut text);
    text
}

/// A stream whose fields blanks separate, with a tab between two.
pub(super) struct Separated<R> {
    text: R,
    place: Place,
    /// What was read: first what is still to be given, from `position` on, and the last blank if it is not known yet
    /// what it is.
    ready: Vec<u8>,
    position: usize,
    /// Where in `ready` what is to be given ends.
    end: usize,
}

impl<R: Read> Separated<R> {
    pub(super) fn new(text: R) -> Self {
        Self { text, place: Place::default(), ready: Vec::new(), position: 0, end: 0 }
    }

    /// Reads on. Nothing to give then is the end of the text.
    fn fetch(&mut self) -> io::Result<()> {
        loop {
            self.ready.drain(..self.end);
            // At most one blank that was held back.
            let held = self.ready.len();
            (self.position, self.end) = (0, held);
            self.ready.resize(held + PIECE, 0);
            let read = self.text.read(&mut self.ready[held..]);
            let count = *read.as_ref().unwrap_or(&0);
            self.ready.truncate(held + count);
            if read.is_err() {
                self.end = 0;
            }
            if read? == 0 {
                return Ok(());
            }
            let mut place = self.place;
            let own = &mut self.ready[held..];
            let first = own[0];
            place.pass(own);
            if held > 0 && self.place.any && !matches!(first, b' ' | b'\t' | b'\n') {
                self.ready[0] = b'\t';
            }
            self.place = place;
            self.end = self.ready.len() - usize::from(place.blank);
            if self.end > 0 {
                return Ok(());
            }
        }
    }
}

impl<R: Read> Read for Separated<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.position == self.end {
            self.fetch()?;
        }
        let given = &self.ready[self.position..self.end];
        let count = given.len().min(buffer.len());
        buffer[..count].copy_from_slice(&given[..count]);
        self.position += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXTS: [(&str, &str); 8] = [
        ("u y\n1 2\n", "u\ty\n1\t2\n"),
        ("  1.0   2.0\n", "  1.0  \t2.0\n"),
        ("a \t b  \n", "a  \tb  \n"),
        ("\t1\t2\t\n\n \n", " 1\t2 \n\n \n"),
        ("\"T out\" y\n", "\"T out\"\ty\n"),
        ("\"a \"\" b\" 2\n", "\"a \"\" b\"\t2\n"),
        ("5\" pipe\n", "5\"\tpipe\n"),
        ("\"open 1\n2 3 ", "\"open 1\n2\t3 "),
    ];

    #[test]
    fn the_last_blank_of_a_run_separates() {
        for (text, expected) in TEXTS {
            assert_eq!(String::from_utf8(separated(text.as_bytes())).unwrap(), expected);
        }
    }

    /// A stream that gives so many bytes at once.
    struct Slow<'a>(&'a [u8], usize);

    impl Read for Slow<'_> {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            let count = self.1.min(buffer.len());
            self.0.read(&mut buffer[..count])
        }
    }

    #[test]
    fn a_stream_gives_the_same_whatever_the_cuts() {
        for (text, expected) in TEXTS {
            for at_once in 1..6 {
                let mut read = String::new();
                Separated::new(Slow(text.as_bytes(), at_once)).read_to_string(&mut read).unwrap();
                assert_eq!(read, expected, "{at_once}");
            }
        }
    }
}
