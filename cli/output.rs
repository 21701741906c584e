//! What the program writes: whole files or none, and standard output.

use std::io::{self, Write};
use std::path::Path;

use thetahat::text::harmless;

use crate::failure::Failure;
use crate::{interrupt, replace};

/// Writes to standard output.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    interrupt::writing();
    let mut stdout = io::stdout().lock();
    stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()).map_err(|error| Failure::stdout(&error))
}

/// Writes a file whole or not at all ([`replace`]), or standard output for `-`.
pub(crate) fn write(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), Failure> {
    if path != Path::new("-") {
        return replace::replace(path, fill);
    }
    interrupt::writing();
    let mut stdout = io::BufWriter::new(io::stdout().lock());
    fill(&mut stdout).and_then(|()| stdout.flush()).map_err(|error| Failure::stdout(&error))
}

/// A name as a cell of a CSV: harmless to a terminal, and to a spreadsheet, which takes what begins with one of a few
/// signs for a formula and runs it (OWASP, CSV Injection): an apostrophe in front makes it a text. Numbers stay as they
/// are.
pub(crate) fn cell(name: &str) -> String {
    const FORMULA: [char; 8] = ['=', '+', '-', '@', '＝', '＋', '－', '＠'];
    let is_number = name.parse().is_ok_and(f64::is_finite);
    let guard = if name.starts_with(FORMULA) && !is_number { "'" } else { "" };
    format!("{guard}{}", harmless(name))
}

/// Writes a table as CSV, like [`write`].
pub(crate) fn write_csv(
    path: &Path,
    rows: impl FnOnce(&mut csv::Writer<&mut dyn Write>) -> Result<(), csv::Error>,
) -> Result<(), Failure> {
    write(path, |file| {
        let mut csv = csv::Writer::from_writer(file);
        rows(&mut csv).map_err(|error| match error.into_kind() {
            csv::ErrorKind::Io(error) => error,
            other => io::Error::other(format!("{other:?}")),
        })?;
        csv.flush()
    })
}

/// Writes a page, like [`write`].
pub(crate) fn page(path: &Path, page: &str) -> Result<(), Failure> {
    write(path, |file| file.write_all(page.as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::cell;

    #[test]
    fn a_name_is_no_formula() {
        for name in ["=1+1", "+cmd|' /C calc'!A0", "-2+3", "@SUM(A1)", "＝1", "-inf", "+"] {
            assert_eq!(cell(name), format!("'{name}"));
        }
        for name in ["u", "a=b", "-1.5", "+2", "1e3", "-4e-3", "", "µ"] {
            assert_eq!(cell(name), name);
        }
        // What would begin a formula after a tab or a line break is an escape.
        assert_eq!([cell("\t=1"), cell("\r=1"), cell("\n=1")], ["\\t=1", "\\r=1", "\\n=1"]);
        assert_eq!(cell("\u{202e}u\u{1b}"), "\\u{202e}u\\u{1b}");
    }
}
