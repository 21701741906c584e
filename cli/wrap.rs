//! Lines no wider than the terminal that shows them.

use std::io;
use std::path::Path;

use terminal_size::{Width, terminal_size_of};
use thetahat::present::Layout;

use crate::options::with_options;

/// The width of what is read from a file or a pipe, in columns.
const WIDTH: usize = 80;

/// A narrower terminal is not written for.
const NARROWEST: usize = 20;

/// The width of the terminal behind standard error, if it is one.
pub(crate) fn stderr_width() -> Option<usize> {
    terminal_size_of(io::stderr()).and_then(usable)
}

/// The width for tables on standard output.
fn stdout_width() -> usize {
    terminal_size_of(io::stdout()).and_then(usable).unwrap_or(WIDTH)
}

/// A terminal may say that it has no columns.
fn usable((Width(columns), _): (Width, terminal_size::Height)) -> Option<usize> {
    (columns > 0).then(|| usize::from(columns).max(NARROWEST))
}

/// The layout of what goes to a file, or to standard output where that is -.
pub(crate) fn layout_of(out: &Path) -> Layout {
    layout(if out == Path::new("-") { stdout_width() } else { WIDTH })
}

/// The layout of tables on standard output.
pub(crate) fn stdout_layout() -> Layout {
    layout(stdout_width())
}

/// The layout of tables on standard error.
pub(crate) fn stderr_layout() -> Layout {
    layout(stderr_width().unwrap_or(WIDTH))
}

/// Text of so many columns, with arguments as options.
fn layout(width: usize) -> Layout {
    Layout { width, spelled: with_options }
}
