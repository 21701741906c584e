//! What the program says on standard error: text that a terminal cannot be harmed by.

use std::io::Write;

use thetahat::present::tables::wrapped;
use thetahat::text::message;

use crate::options::with_options;
use crate::wrap;

/// Says something that the reader should know.
pub(crate) fn warn(warning: &str) {
    tell(&format!("\x1b[1;33mwarning:\x1b[0m {}", message(&with_options(warning))));
}

/// Says something that the reader may want to know.
pub(crate) fn note(words: &str) {
    tell(&format!("\x1b[1mnote:\x1b[0m {}", message(words)));
}

/// Says something that may be long: on a terminal it is broken between words.
pub(crate) fn tell(line: &str) {
    match wrap::stderr_width() {
        Some(width) => say(&wrapped(line, width)),
        None => say(line),
    }
}

/// Writes a line to standard error, in colour only on a terminal. Where that fails there is nobody left to tell.
pub(crate) fn say(line: &str) {
    let _ = writeln!(anstream::stderr().lock(), "{line}");
}
