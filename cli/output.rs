//! What the program writes: whole files or none, and text that a terminal cannot be harmed by.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use crate::failure::Failure;
use crate::interrupt;
use crate::wrap;

/// Text without control characters: names come from files, and could hold anything.
pub(crate) fn harmless(text: &str) -> String {
    let mut harmless = String::with_capacity(text.len());
    for character in text.chars() {
        if character.is_control() {
            harmless.extend(character.escape_default());
        } else {
            harmless.push(character);
        }
    }
    harmless
}

/// Says something that the reader should know.
pub(crate) fn warn(message: &str) {
    tell(&format!("\x1b[1;33mwarning:\x1b[0m {}", harmless(message)));
}

/// Says something that may be long: on a terminal it is broken between words.
pub(crate) fn tell(line: &str) {
    match wrap::stderr_width() {
        Some(width) => say(&wrap::wrapped(line, width)),
        None => say(line),
    }
}

/// Writes a line to standard error, in colour only on a terminal. Where that fails there is nobody left to tell.
pub(crate) fn say(line: &str) {
    let _ = writeln!(anstream::stderr().lock(), "{line}");
}

/// Writes to standard output.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    interrupt::writing();
    let mut stdout = io::stdout().lock();
    stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()).map_err(|error| Failure::stdout(&error))
}

/// Writes a file, or standard output for `-`.
///
/// A file is written beside its place, brought to the disk, and moved there: a crash, a full disk or Ctrl-C leaves the
/// old one or the new one. What is not a file (a device, a pipe) is written directly.
pub(crate) fn write(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), Failure> {
    let failed = |error: io::Error| Failure::io(path, "cannot be written", &plain(error));
    if path == Path::new("-") {
        interrupt::writing();
        let mut stdout = io::BufWriter::new(io::stdout().lock());
        return fill(&mut stdout).and_then(|()| stdout.flush()).map_err(|error| Failure::stdout(&error));
    }
    let target = behind_links(path);
    let existing = fs::metadata(&target).ok();
    if existing.as_ref().is_some_and(fs::Metadata::is_dir) {
        return Err(failed(io::ErrorKind::IsADirectory.into()));
    }
    if existing.as_ref().is_some_and(|metadata| !metadata.is_file()) {
        interrupt::writing();
        let mut file = io::BufWriter::new(fs::OpenOptions::new().write(true).open(&target).map_err(failed)?);
        return fill(&mut file).and_then(|()| file.flush()).map_err(failed);
    }
    let folder = match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".thetahat-");
    if let Some(permissions) = default_permissions() {
        builder.permissions(permissions);
    }
    let file = interrupt::begin(|| builder.tempfile_in(folder)).map_err(failed)?;
    let mut buffered = io::BufWriter::new(file);
    fill(&mut buffered).map_err(failed)?;
    let file = buffered.into_inner().map_err(|error| failed(error.into_error()))?;
    if let Some(existing) = existing {
        file.as_file().set_permissions(existing.permissions()).map_err(failed)?;
    }
    file.as_file().sync_all().map_err(failed)?;
    interrupt::finish(|| file.persist(&target).map_err(|error| error.error)).map_err(failed)?;
    Ok(())
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

/// Refuses an output that would replace what was read.
pub(crate) fn apart(output: &Path, read: &Path) -> Result<(), Failure> {
    let same = |path: &Path| fs::canonicalize(path).ok().filter(|path| path.is_file());
    match (same(output), same(read)) {
        (Some(output), Some(read)) if output == read => Err(Failure::usage(format!(
            "{} would be replaced by the output; name another file",
            read.display()
        ))),
        _ => Ok(()),
    }
}

/// Refuses outputs of which two would be the same file.
pub(crate) fn distinct(outputs: &[&Path]) -> Result<(), Failure> {
    let place = |path: &Path| {
        let target = behind_links(path);
        let folder =
            target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let folder = fs::canonicalize(folder).unwrap_or_else(|_| folder.to_owned());
        target.file_name().map_or_else(|| target.clone(), |name| folder.join(name))
    };
    for (index, path) in outputs.iter().enumerate() {
        if outputs.iter().take(index).any(|other| place(other) == place(path)) {
            return Err(Failure::usage(format!(
                "{} is named for two outputs; give each a file of its own",
                path.display()
            )));
        }
    }
    Ok(())
}

/// The file behind a link, there already or not: it is replaced, not the link.
fn behind_links(path: &Path) -> PathBuf {
    let mut target = path.to_owned();
    // As many links as the system itself would follow.
    for _ in 0..40 {
        match fs::read_link(&target) {
            Ok(next) => target = target.parent().unwrap_or(Path::new("")).join(next),
            Err(_) => break,
        }
    }
    target
}

/// An error without the name that a temporary file had, which is nobody's business.
fn plain(error: io::Error) -> io::Error {
    if error.get_ref().is_some() { error.kind().into() } else { error }
}

/// What a new file may be used for: as with any other program, the user's mask decides.
#[cfg(unix)]
fn default_permissions() -> Option<fs::Permissions> {
    use std::os::unix::fs::PermissionsExt;
    Some(fs::Permissions::from_mode(0o666))
}

#[cfg(not(unix))]
fn default_permissions() -> Option<fs::Permissions> {
    None
}
