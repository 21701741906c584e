//! Why the program ends without having done what was asked.

use std::fmt::Display;
use std::io;
use std::path::Path;

use thetahat::text;

use crate::options::{option_of, with_options};

/// One line for a person, and an exit code for a script.
#[derive(Debug)]
pub struct Failure {
    kind: Kind,
    message: String,
}

/// What kind of failure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Kind {
    /// Nobody reads the output any more: nothing to say.
    Closed,
    /// Ctrl-C.
    Interrupted,
    /// The options do not make sense.
    Usage,
    /// The log or the report does not hold what was asked of it.
    Data,
    /// The log takes more memory than is free.
    Memory,
    /// The data cannot determine the model.
    Undetermined,
    /// A file cannot be read or written, and what the system says of it.
    Io(io::ErrorKind),
    /// A model does not meet what was asked of it.
    Unmet,
    /// An alarm ended the run, as was asked.
    Alarm,
}

impl Failure {
    /// What kind it is.
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// Whether it was the machine's, not the log's: another time it may not be there.
    pub(crate) fn may_pass(&self) -> bool {
        matches!(self.kind, Kind::Memory | Kind::Io(_) | Kind::Interrupted | Kind::Closed)
    }

    /// The exit code of a program that ends so.
    pub(crate) fn exit_code(&self) -> u8 {
        match self.kind {
            Kind::Closed => 0,
            Kind::Usage => 2,
            Kind::Data | Kind::Memory => 3,
            Kind::Undetermined => 4,
            Kind::Io(_) => 5,
            Kind::Unmet => 6,
            Kind::Alarm => 7,
            Kind::Interrupted => 130,
        }
    }

    /// What a row of many says of one of them, as the end of all.
    pub(crate) fn of_exit_code(code: u64, message: impl AsRef<str>) -> Self {
        let kinds = [Kind::Usage, Kind::Undetermined, Kind::Io(io::ErrorKind::Other), Kind::Unmet];
        let kind = kinds.into_iter().find(|kind| u64::from(Self::new(*kind, "").exit_code()) == code);
        Self::new(kind.unwrap_or(Kind::Data), message)
    }

    /// What is wrong and what to do, in one line.
    pub fn message(&self) -> &str {
        &self.message
    }

    /// The message may repeat names and parts of files: it is shown as [`text::message`] does.
    fn new(kind: Kind, message: impl AsRef<str>) -> Self {
        Self { kind, message: text::message(&with_options(message.as_ref())) }
    }

    /// The command line does not make sense.
    pub(crate) fn usage(message: impl AsRef<str>) -> Self {
        Self::new(Kind::Usage, message)
    }

    /// What the library says of an argument.
    pub(crate) fn option(error: &thetahat::Error) -> Self {
        if let thetahat::Error::Argument { argument, message } = error
            && let Some(option) = option_of(argument)
        {
            return Self::usage(format!("--{option}: {message}"));
        }
        Self::usage(error.to_string())
    }

    /// Ctrl-C.
    pub(crate) fn interrupted() -> Self {
        Self::new(Kind::Interrupted, "")
    }

    /// The log or the report does not hold what was asked of it.
    pub(crate) fn data(message: impl AsRef<str>) -> Self {
        Self::new(Kind::Data, message)
    }

    /// A model does not meet what was asked of it.
    pub(crate) fn unmet(message: impl AsRef<str>) -> Self {
        Self::new(Kind::Unmet, message)
    }

    /// An alarm ended the run, as was asked.
    pub(crate) fn alarm(message: impl AsRef<str>) -> Self {
        Self::new(Kind::Alarm, message)
    }

    /// Whether nobody reads the output any more.
    pub(crate) fn is_closed(&self) -> bool {
        self.kind == Kind::Closed
    }

    /// A file cannot be read or written.
    pub(crate) fn io(path: &Path, what: impl Display, error: &io::Error) -> Self {
        if error.kind() == io::ErrorKind::BrokenPipe {
            return Self::new(Kind::Closed, "");
        }
        let remedy = match error.kind() {
            io::ErrorKind::StorageFull => "make room on the disk",
            io::ErrorKind::IsADirectory => "name a file in it",
            _ => thetahat_table::remedy(error),
        };
        Self::new(Kind::Io(error.kind()), format!("{}: {what}: {error}; {remedy}", path.display()))
    }

    /// Another run has the file.
    pub(crate) fn busy(message: impl AsRef<str>) -> Self {
        Self::new(Kind::Io(io::ErrorKind::ResourceBusy), message)
    }

    /// Standard output cannot be written.
    pub(crate) fn stdout(error: &io::Error) -> Self {
        Self::io(Path::new("standard output"), "cannot be written", error)
    }

    /// What the library says of a log, with the place it is about.
    pub(crate) fn about(error: &thetahat::Error, place: impl FnOnce(Option<usize>) -> String) -> Self {
        let (kind, row) = match error {
            thetahat::Error::Argument { .. } => return Self::option(error),
            thetahat::Error::Interrupted => return Self::interrupted(),
            thetahat::Error::Undetermined { .. } => (Kind::Undetermined, None),
            thetahat::Error::Data { row, .. } => (Kind::Data, *row),
            _ => (Kind::Data, None),
        };
        Self::new(kind, format!("{}: {error}", place(row)))
    }

    /// The same, with the file that it is about in front.
    pub(crate) fn of(self, path: &Path) -> Self {
        Self::new(self.kind, format!("{}: {}", path.display(), self.message))
    }
}

impl From<thetahat_table::Error> for Failure {
    fn from(error: thetahat_table::Error) -> Self {
        let kind = match error.kind() {
            thetahat_table::ErrorKind::Io => Kind::Io(io::ErrorKind::Other),
            thetahat_table::ErrorKind::Data => Kind::Data,
            thetahat_table::ErrorKind::Memory => Kind::Memory,
        };
        Self::new(kind, error.to_string())
    }
}
