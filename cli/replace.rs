//! Files that are replaced whole, and files that one run has for itself.
//!
//! A file is written beside its place under a passing name, brought to the disk, and moved there: a crash, a full disk
//! or Ctrl-C leaves the old one or the new one. Whoever writes a file holds its lock (`flock`; `LockFileEx` on
//! Windows), which the system releases when the program ends in whatever way. So a passing file that nobody holds was
//! left by a run that was killed, and the next run that writes into its folder removes it.

use std::ffi::OsStr;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::failure::Failure;
use crate::interrupt;
use crate::messages::warn;

#[cfg(test)]
mod tests;

/// What a passing name begins and ends with; between the two are this many letters and digits.
const BEFORE: &str = ".thetahat-";
const AFTER: &str = ".tmp";
const LETTERS: usize = 12;

/// Writes a file. What is not a file (a device, a pipe) is written directly.
pub(crate) fn replace(
    path: &Path,
    fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), Failure> {
    if let Ok(target) = behind_links(path) {
        sweep(folder(&target));
    }
    put(path, fill)
}

/// The same in a folder that was [swept](sweep).
pub(crate) fn put(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), Failure> {
    let failed = |error: io::Error| Failure::io(path, "cannot be written", &plain(error));
    let target = behind_links(path).map_err(failed)?;
    let existing = existing(&target).map_err(failed)?;
    if existing.as_ref().is_some_and(|metadata| !metadata.is_file()) {
        interrupt::writing();
        let mut file = BufWriter::new(OpenOptions::new().write(true).open(&target).map_err(failed)?);
        return fill(&mut file).and_then(|()| file.flush()).map_err(failed);
    }
    let file = filled(&target, existing.as_ref(), fill).map_err(failed)?;
    interrupt::finish(file, |file| file.persist(&target).map_err(|error| error.error)).map_err(failed)?;
    Ok(())
}

/// That a file can be written, before anything is computed for it: its folder takes another one for an instant, or that
/// in which it will be made.
///
/// # Errors
/// What [`replace`] would say.
pub(crate) fn check(path: &Path, makes_folders: bool) -> Result<(), Failure> {
    let failed = |error: io::Error| Failure::io(path, "cannot be written", &plain(error));
    let target = behind_links(path).map_err(failed)?;
    let existing = existing(&target).map_err(failed)?;
    if existing.as_ref().is_some_and(|metadata| !metadata.is_file()) {
        return Ok(());
    }
    let mut folder = folder(&target);
    if makes_folders {
        folder = folder.ancestors().find(|folder| folder.exists()).unwrap_or(Path::new("."));
    }
    if let Err(error) = fs::metadata(folder) {
        return Err(Failure::io(path, "cannot be written: its folder is not there", &error));
    }
    let file = interrupt::begin(|| passing(folder, existing.is_none())).map_err(failed)?;
    interrupt::discard(file).map_err(failed)
}

/// A file that this run has for itself, and replaces from time to time.
pub(crate) struct Held {
    path: PathBuf,
    target: PathBuf,
    /// The file at its place, locked; none if there is none yet.
    file: Option<File>,
}

impl Held {
    /// Takes hold of a file, there already or not.
    ///
    /// # Errors
    /// That another run holds it, or that it cannot be opened.
    pub(crate) fn open(path: &Path) -> Result<Self, Failure> {
        let failed = |error: io::Error| Failure::io(path, "cannot be read", &error);
        let target = behind_links(path).map_err(failed)?;
        sweep(folder(&target));
        let held = |file| Self { path: path.to_owned(), target: target.clone(), file };
        loop {
            let file = match File::open(&target) {
                Ok(file) => file,
                Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(held(None)),
                Err(error) => return Err(failed(error)),
            };
            lock(path, &file)?;
            // Whoever held it may have replaced it before the lock was free.
            if is_at(&file, &target) {
                return Ok(held(Some(file)));
            }
        }
    }

    /// What is in it; none if there is no file yet.
    ///
    /// # Errors
    /// That it cannot be read.
    pub(crate) fn read(&mut self) -> Result<Option<Vec<u8>>, Failure> {
        let Some(file) = &mut self.file else { return Ok(None) };
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(|error| Failure::io(&self.path, "cannot be read", &error))?;
        Ok(Some(bytes))
    }

    /// Replaces it: the file holds what it did or this, whatever happens.
    ///
    /// # Errors
    /// That it cannot be written, or that it was not there and another run has made it since.
    pub(crate) fn write(&mut self, bytes: &[u8]) -> Result<(), Failure> {
        let Self { path, target, file } = self;
        let failed = |error: io::Error| Failure::io(path, "cannot be written", &plain(error));
        let existing = existing(target).map_err(failed)?;
        let new = filled(target, existing.as_ref(), |new| new.write_all(bytes)).map_err(failed)?;
        // Windows does not replace what is open.
        let is_first = if cfg!(windows) { file.take().is_none() } else { file.is_none() };
        let moved = interrupt::finish(new, |new| {
            let moved = if is_first { new.persist_noclobber(&*target) } else { new.persist(&*target) };
            moved.map_err(|error| error.error)
        });
        *file = Some(moved.map_err(|error| match error.kind() {
            io::ErrorKind::AlreadyExists => busy(path),
            _ => failed(error),
        })?);
        Ok(())
    }
}

/// Takes the lock of a file that only one run at a time can write.
///
/// # Errors
/// That another run holds it.
pub(crate) fn lock(path: &Path, file: &File) -> Result<(), Failure> {
    match file.try_lock() {
        Ok(()) => Ok(()),
        Err(TryLockError::WouldBlock) => Err(busy(path)),
        Err(TryLockError::Error(error)) => {
            warn(&format!(
                "{}: it cannot be locked ({error}); see to it that no other run writes it",
                path.display()
            ));
            Ok(())
        }
    }
}

fn busy(path: &Path) -> Failure {
    Failure::busy(format!(
        "{}: another run is writing it; wait until that has ended, or name another file",
        path.display()
    ))
}

/// A passing file beside a target with all that is to be in it, and with the mode of the file that it will replace.
fn filled(
    target: &Path,
    existing: Option<&fs::Metadata>,
    fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<NamedTempFile> {
    let file = interrupt::begin(|| passing(folder(target), existing.is_none()))?;
    let mut buffered = BufWriter::new(file);
    fill(&mut buffered)?;
    let file = buffered.into_inner().map_err(io::IntoInnerError::into_error)?;
    if let Some(existing) = existing {
        take_over(file.as_file(), existing)?;
    }
    file.as_file().sync_all()?;
    Ok(file)
}

/// An empty file under a passing name, locked. Only its owner can read it, unless it is to be a new file: the user's
/// mask decides for that, as with any other program.
fn passing(folder: &Path, is_new: bool) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(BEFORE).suffix(AFTER).rand_bytes(LETTERS);
    #[cfg(unix)]
    if is_new {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    #[cfg(not(unix))]
    let _ = is_new;
    loop {
        let file = builder.tempfile_in(folder)?;
        // Another run that sweeps may have met it before it was locked. Where there are no locks nothing is swept.
        match file.as_file().try_lock() {
            Err(TryLockError::WouldBlock) => {}
            _ if is_at(file.as_file(), file.path()) => return Ok(file),
            _ => {}
        }
    }
}

/// Gives a file the owner, the group and the mode of the one that it will replace, as far as that is allowed.
#[cfg(unix)]
fn take_over(file: &File, existing: &fs::Metadata) -> io::Result<()> {
    use std::os::unix::fs::{MetadataExt, PermissionsExt, fchown};
    let own = file.metadata()?;
    let mut mode = existing.mode() & 0o7777;
    if (own.uid(), own.gid()) != (existing.uid(), existing.gid())
        && fchown(file, Some(existing.uid()), Some(existing.gid())).is_err()
        && own.gid() != existing.gid()
        && fchown(file, None, Some(existing.gid())).is_err()
    {
        // What was meant for one group is not for another.
        mode &= !0o070;
    }
    file.set_permissions(fs::Permissions::from_mode(mode))
}

#[cfg(not(unix))]
fn take_over(file: &File, existing: &fs::Metadata) -> io::Result<()> {
    file.set_permissions(existing.permissions())
}

/// Removes the passing files that runs left in a folder when they were killed.
pub(crate) fn sweep(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        if !is_passing(&entry.file_name()) || !entry.file_type().is_ok_and(|kind| kind.is_file()) {
            continue;
        }
        let path = entry.path();
        let Ok(file) = OpenOptions::new().read(true).write(true).open(&path) else { continue };
        // Nobody holds it, and nobody will: who makes one looks, once he has locked it, whether it is still there.
        if file.try_lock().is_ok() && is_at(&file, &path) {
            // Another run may be sweeping too.
            let _ = fs::remove_file(&path);
        }
    }
}

/// Whether a name is one that [`passing`] gives.
fn is_passing(name: &OsStr) -> bool {
    name.to_str().and_then(|name| name.strip_prefix(BEFORE)?.strip_suffix(AFTER)).is_some_and(|middle| {
        middle.len() == LETTERS && middle.bytes().all(|byte| byte.is_ascii_alphanumeric())
    })
}

/// Whether an open file is the one at a path.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    match (file.metadata(), fs::metadata(path)) {
        (Ok(open), Ok(there)) => (open.dev(), open.ino()) == (there.dev(), there.ino()),
        _ => false,
    }
}

/// Windows does not let an open file be removed or replaced.
#[cfg(not(unix))]
fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

/// The file behind a link, there already or not: it is replaced, not the link.
///
/// # Errors
/// That the links go round in a circle.
pub(crate) fn behind_links(path: &Path) -> io::Result<PathBuf> {
    let mut target = path.to_owned();
    // As many links as the system itself would follow.
    for _ in 0..40 {
        match fs::read_link(&target) {
            Ok(next) => target = target.parent().unwrap_or(Path::new("")).join(next),
            Err(_) => return Ok(target),
        }
    }
    // The system says it in its own words.
    fs::metadata(path).map(|_| target)
}

/// The folder that a file is in.
pub(crate) fn folder(target: &Path) -> &Path {
    target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// What stands at the place of a file that is to be written.
fn existing(target: &Path) -> io::Result<Option<fs::Metadata>> {
    match fs::metadata(target) {
        Ok(metadata) if metadata.is_dir() => Err(io::ErrorKind::IsADirectory.into()),
        Ok(metadata) => Ok(Some(metadata)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}

/// An error without the name that a passing file had, which is nobody's business.
fn plain(error: io::Error) -> io::Error {
    if error.get_ref().is_none() {
        return error;
    }
    // The number of the system is left in the text only, in front of the name; many numbers have no kind of their own.
    let text = error.to_string();
    let number = text.split_once("(os error ").and_then(|(_, rest)| rest.split_once(')')?.0.parse().ok());
    match number.map(io::Error::from_raw_os_error) {
        Some(plain) if plain.kind() == error.kind() => plain,
        _ => error.kind().into(),
    }
}
