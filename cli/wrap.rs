//! Lines no wider than the terminal that shows them.

use std::io;

use terminal_size::{Width, terminal_size_of};
use textwrap::{Options, WordSplitter};

/// The width of what is read from a file or a pipe, in columns.
pub const WIDTH: usize = 80;

/// A narrower terminal is not written for.
const NARROWEST: usize = 20;

/// The width of the terminal behind standard error, if it is one.
pub(crate) fn stderr_width() -> Option<usize> {
    terminal_size_of(io::stderr()).and_then(usable)
}

/// The width for tables on standard output.
pub(crate) fn stdout_width() -> usize {
    terminal_size_of(io::stdout()).and_then(usable).unwrap_or(WIDTH)
}

/// A terminal may say that it has no columns.
fn usable((Width(columns), _): (Width, terminal_size::Height)) -> Option<usize> {
    (columns > 0).then(|| usize::from(columns).max(NARROWEST))
}

/// Breaks lines between words. A word that is too long, such as the name of a file, stays whole.
pub(crate) fn wrapped(text: &str, width: usize) -> String {
    let options = Options::new(width)
        .subsequent_indent("  ")
        .break_words(false)
        // Options begin with hyphens.
        .word_splitter(WordSplitter::NoHyphenation);
    textwrap::fill(text, options)
}
