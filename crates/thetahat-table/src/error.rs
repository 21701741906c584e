//! What went wrong while reading a log, and where.

use std::fmt;
use std::io;

/// The longest piece of the log that a message repeats, in characters.
const SHOWN: usize = 40;

/// Whose fault an [`Error`] is.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum ErrorKind {
    /// The bytes could not be read: no such file, no permission, a truncated gzip stream.
    Io,
    /// The bytes were read, but they are not the table that was asked for.
    Data,
    /// The table takes more memory than is free.
    Memory,
}

/// A reading error: one line that names the file, the position and the remedy.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Error {
    kind: ErrorKind,
    file: String,
    position: Option<Position>,
    message: String,
}

/// What to do where the system does not open a file, by its reason.
///
/// ```
/// let error = std::fs::File::open("no/such.csv").unwrap_err();
/// assert_eq!(thetahat_table::remedy(&error), "check the path and its permissions");
/// ```
pub fn remedy(error: &io::Error) -> &'static str {
    // EMFILE and ENFILE, which have no kind of their own.
    match error.raw_os_error() {
        Some(24 | 23) if cfg!(unix) => {
            "close other files or programs, or raise the limit of open files (`ulimit -n`)"
        }
        _ => "check the path and its permissions",
    }
}

/// A place in a log, both numbers counted from one.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) struct Position {
    /// The physical line.
    pub(super) line: u64,
    /// The character within that line, as an editor counts it.
    pub(super) column: u64,
}

impl Position {
    /// The place of the byte at `offset` in `text`, which starts at the first character of `line`.
    pub(super) fn within(text: &[u8], offset: usize, line: u64) -> Self {
        let before = text.get(..offset).unwrap_or(text);
        let start = memchr::memrchr(b'\n', before).map_or(0, |newline| newline + 1);
        Self {
            line: line + memchr::memchr_iter(b'\n', before).count() as u64,
            column: 1 + count_characters(&before[start..]) as u64,
        }
    }
}

/// The number of characters in a text, taking bytes that are not UTF-8 for one each.
fn count_characters(text: &[u8]) -> usize {
    text.utf8_chunks().map(|chunk| chunk.valid().chars().count() + chunk.invalid().len()).sum()
}

impl Error {
    /// An error of the file system or of the stream.
    pub(super) fn io(file: &str, message: impl Into<String>) -> Self {
        Self { kind: ErrorKind::Io, file: file.to_owned(), position: None, message: message.into() }
    }

    /// That the system has no thread for what reads a file.
    pub(super) fn no_thread(file: &str, error: &io::Error) -> Self {
        Self::io(
            file,
            format!(
                "no thread can be started that reads it: {error}; end other programs, or raise the limit"
            ),
        )
    }

    /// An error in what the log holds, or in how it was asked for.
    pub(super) fn data(
        file: &str,
        position: impl Into<Option<Position>>,
        message: impl Into<String>,
    ) -> Self {
        Self {
            kind: ErrorKind::Data,
            file: file.to_owned(),
            position: position.into(),
            message: message.into(),
        }
    }

    /// A table that takes more memory than is free; `words` say how much that is.
    pub(super) fn memory(file: &str, position: impl Into<Option<Position>>, words: &str) -> Self {
        let message =
            format!("the log does not fit into memory: {words}; name fewer columns, or cut it into several");
        Self { kind: ErrorKind::Memory, ..Self::data(file, position, message) }
    }

    /// Whose fault it is.
    pub fn kind(&self) -> ErrorKind {
        self.kind
    }
}

impl fmt::Display for Error {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}:", escaped(&self.file))?;
        if let Some(Position { line, column }) = self.position {
            write!(formatter, "{line}:{column}:")?;
        }
        write!(formatter, " {}", self.message)
    }
}

impl std::error::Error for Error {}

/// The nearest number with four digits.
pub(super) fn rounded(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

/// A number with a few digits, as a message has it.
pub(super) fn figure(value: f64) -> String {
    let short = rounded(value);
    if (1e-4..1e7).contains(&short.abs()) { short.to_string() } else { format!("{short:e}") }
}

/// A piece of the log as a message repeats it: in quotes, shortened, and harmless to a terminal.
pub(super) fn quoted(text: &[u8]) -> String {
    match std::str::from_utf8(text) {
        Ok(text) => format!("{:?}", shortened(text)),
        Err(_) => format!("\"{}\"", shortened(&text.escape_ascii().to_string())),
    }
}

/// A name as a message repeats it: like [`quoted`], without the quotes.
pub(super) fn escaped(name: &str) -> String {
    let mut escaped = String::with_capacity(name.len());
    for character in name.chars() {
        match character {
            // Harmless, and a path or a name is easier to recognise with them as they are.
            '\'' | '"' | '\\' => escaped.push(character),
            _ => escaped.extend(character.escape_debug()),
        }
    }
    escaped
}

/// The first characters of a text, with an ellipsis where something was left out.
pub(super) fn shortened(text: &str) -> String {
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_is_one_line() {
        let error = Error::data("a\nb.csv", Position { line: 3, column: 4 }, "wrong");
        assert_eq!(error.to_string(), "a\\nb.csv:3:4: wrong");
        let error = Error::io("log.csv", "gone");
        assert_eq!(error.to_string(), "log.csv: gone");
    }

    #[test]
    #[cfg(unix)]
    fn too_many_open_files_have_a_remedy_of_their_own() {
        for number in [23, 24] {
            let remedy = remedy(&io::Error::from_raw_os_error(number));
            assert!(remedy.contains("`ulimit -n`"), "{remedy}");
        }
        assert_eq!(remedy(&io::Error::from_raw_os_error(13)), "check the path and its permissions");
    }

    #[test]
    fn a_position_counts_characters_and_lines() {
        let text = "µ,é\nab,c".as_bytes();
        let position = |offset| {
            let Position { line, column } = Position::within(text, offset, 7);
            (line, column)
        };
        assert_eq!(position(0), (7, 1));
        assert_eq!(position(3), (7, 3)); // the é: two characters before it, three bytes
        assert_eq!(position(6), (8, 1));
        assert_eq!(position(9), (8, 4));
        assert_eq!(position(99), (8, 5)); // beyond the end: the end
        assert_eq!(Position::within(b"\xb0\xb0x", 2, 1).column, 3);
    }

    #[test]
    fn what_is_shown_is_short_and_harmless() {
        assert_eq!(quoted(b"a\x1b[31m\"b"), r#""a\u{1b}[31m\"b""#);
        assert_eq!(quoted(b"\xb0C\n"), r#""\xb0C\n""#);
        assert_eq!(quoted(&[b'x'; 50]), format!("\"{}…\"", "x".repeat(40)));
        assert_eq!(escaped("it's \u{202e}\r"), "it's \\u{202e}\\r");
    }
}
