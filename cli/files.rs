//! Which files a command line reads and writes, and that they do not come in each other's way.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::failure::Failure;
use crate::replace::{behind_links, check, folder};

/// The files of a command line, `-` for standard input or output.
#[derive(Debug, Default)]
pub(crate) struct Files {
    pub(crate) read: Vec<PathBuf>,
    pub(crate) written: Vec<PathBuf>,
    /// Whether folders that are not there are made for what is written.
    pub(crate) makes_folders: bool,
}

impl Files {
    /// Refuses, before anything is written, an output that would replace what is read or another output, under whatever
    /// name: a hard link is the same file, and so is what standard output is redirected to (a program that reads what
    /// it writes does not end). The same file is told by device and inode. Refuses, before anything is computed, an
    /// output that cannot be written.
    ///
    /// # Errors
    /// As said; that links go round in a circle.
    pub(crate) fn check(&self) -> Result<(), Failure> {
        let mut written: Vec<(&Path, Identity)> = Vec::new();
        for (index, path) in self.written.iter().enumerate() {
            if self.written[..index].contains(path) {
                return Err(twice(path));
            }
            let identity = match path.as_path() == Path::new("-") {
                true => None,
                false => Identity::of_output(path)
                    .map_err(|error| Failure::io(path, "cannot be written", &error))?,
            };
            let Some(identity) = identity else { continue };
            if written.iter().any(|(_, other)| *other == identity) {
                return Err(twice(path));
            }
            written.push((path, identity));
        }
        let stdout = Identity::of_stream(&io::stdout());
        if let Some((path, _)) = written.iter().find(|(_, identity)| Some(identity) == stdout.as_ref()) {
            return Err(Failure::usage(format!(
                "{} is named for an output, and standard output goes to it too; give each a file of its own",
                path.display()
            )));
        }
        for read in &self.read {
            let identity = match read.as_path() == Path::new("-") {
                true => Identity::of_stream(&io::stdin()),
                false => Identity::of_file(read),
            };
            let Some(identity) = identity else { continue };
            if let Some((path, _)) = written.iter().find(|(_, other)| *other == identity) {
                let other = match *path == read.as_path() {
                    true => String::new(),
                    false => format!(" {}, which is the same file", path.display()),
                };
                return Err(Failure::usage(format!(
                    "{} would be replaced by the output{other}; name another file",
                    name(read, "standard input")
                )));
            }
            if stdout.as_ref() == Some(&identity) {
                return Err(Failure::usage(format!(
                    "{} is read, and standard output goes to it; send it to another file",
                    name(read, "standard input")
                )));
            }
        }
        self.written
            .iter()
            .filter(|path| path.as_path() != Path::new("-"))
            .try_for_each(|path| check(path, self.makes_folders))
    }
}

fn twice(path: &Path) -> Failure {
    let name = name(path, "standard output (-)");
    Failure::usage(format!("{name} is named for two outputs; give each a file of its own"))
}

fn name(path: &Path, dash: &str) -> String {
    if path == Path::new("-") { dash.to_owned() } else { path.display().to_string() }
}

/// What tells a file from all others, whatever its names.
#[derive(Debug, PartialEq)]
enum Identity {
    /// Device and inode.
    #[cfg(unix)]
    There(u64, u64),
    /// The place of a file that is not there yet; of every file where the system has no inodes.
    At(PathBuf),
}

impl Identity {
    /// Of a file that is to be written, there already or not. None of a device, a pipe or a terminal, which may be read
    /// and written at once.
    fn of_output(path: &Path) -> io::Result<Option<Self>> {
        let target = behind_links(path)?;
        if target.exists() {
            return Ok(Self::of_file(&target));
        }
        let folder = folder(&target);
        let folder = fs::canonicalize(folder).unwrap_or_else(|_| folder.to_owned());
        Ok(Some(Self::At(target.file_name().map_or_else(|| target.clone(), |name| folder.join(name)))))
    }
}

#[cfg(unix)]
impl Identity {
    fn of_file(path: &Path) -> Option<Self> {
        Self::of(&fs::metadata(path).ok()?)
    }

    /// Of what standard input or output is redirected to.
    fn of_stream(stream: &impl std::os::fd::AsFd) -> Option<Self> {
        let file = fs::File::from(stream.as_fd().try_clone_to_owned().ok()?);
        Self::of(&file.metadata().ok()?)
    }

    fn of(metadata: &fs::Metadata) -> Option<Self> {
        use std::os::unix::fs::MetadataExt;
        metadata.is_file().then(|| Self::There(metadata.dev(), metadata.ino()))
    }
}

#[cfg(not(unix))]
impl Identity {
    fn of_file(path: &Path) -> Option<Self> {
        fs::canonicalize(path).ok().filter(|path| path.is_file()).map(Self::At)
    }

    fn of_stream<T>(_: &T) -> Option<Self> {
        None
    }
}
