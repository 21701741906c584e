//! What the program writes: whole files or none, and text that a terminal cannot be harmed by.

use std::fs;
use std::io::{self, Write};
use std::path::Path;

use crate::failure::Failure;

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

/// Says something that the reader should know, on standard error.
pub(crate) fn warn(message: &str) {
    anstream::eprintln!("\x1b[1;33mwarning:\x1b[0m {}", harmless(message));
}

/// Writes to standard output.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    let mut stdout = io::stdout().lock();
    stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()).map_err(|error| Failure::stdout(&error))
}

/// Writes a file, or standard output for `-`.
///
/// A file is written beside its place, brought to the disk, and moved there: a crash or a full disk leaves the old
/// one or the new one. What is not a file (a device, a pipe) is written directly.
pub(crate) fn write(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), Failure> {
    let failed = |error: io::Error| Failure::io(path, "cannot be written", &error);
    if path == Path::new("-") {
        let mut stdout = io::BufWriter::new(io::stdout().lock());
        return fill(&mut stdout).and_then(|()| stdout.flush()).map_err(|error| Failure::stdout(&error));
    }
    // The file behind a link is replaced, not the link.
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let existing = fs::metadata(&target).ok();
    if existing.as_ref().is_some_and(|metadata| !metadata.is_file()) {
        let mut file = io::BufWriter::new(fs::OpenOptions::new().write(true).open(&target).map_err(failed)?);
        return fill(&mut file).and_then(|()| file.flush()).map_err(failed);
    }
    let folder = match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".thetahat-");
    let permissions = existing.map(|metadata| metadata.permissions()).or_else(default_permissions);
    if let Some(permissions) = permissions {
        builder.permissions(permissions);
    }
    let file = builder.tempfile_in(folder).map_err(failed)?;
    let mut buffered = io::BufWriter::new(file);
    fill(&mut buffered).map_err(failed)?;
    let file = buffered.into_inner().map_err(|error| failed(error.into_error()))?;
    file.as_file().sync_all().map_err(failed)?;
    file.persist(&target).map_err(|error| failed(error.error))?;
    Ok(())
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
