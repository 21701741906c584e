//! Searches that tell of their progress, and what they find.

use std::cell::RefCell;
use std::ops::ControlFlow;

use thetahat::Error;
use thetahat::data::{Log, Source};
use thetahat::optimize::Monitor;
use thetahat::report::Report;

use crate::failure::Failure;
use crate::interrupt;
use crate::messages::warn;
use crate::options::with_options;
use crate::progress::Searching;

/// What a fit found, and the log that it was made to, if it was kept.
pub(super) struct Identified {
    pub(super) report: Report,
    pub(super) log: Option<Log>,
    pub(super) sources: Vec<Source>,
}

/// How the work on a log tells of itself.
pub(super) enum Telling {
    /// At once, on standard error.
    Aloud,
    /// As one of many: what the reader should know is kept, nothing is drawn, and who has the many under way ends when
    /// asked to.
    Kept(RefCell<Vec<String>>),
}

impl Telling {
    /// Says something that the reader should know.
    pub(super) fn warn(&self, warning: &str) {
        match self {
            Self::Aloud => warn(warning),
            Self::Kept(warnings) => warnings.borrow_mut().push(with_options(warning)),
        }
    }

    /// What was kept.
    pub(super) fn kept(self) -> Vec<String> {
        match self {
            Self::Aloud => Vec::new(),
            Self::Kept(warnings) => warnings.into_inner(),
        }
    }

    /// What a search finds that tells of its progress and may be interrupted.
    pub(super) fn watched<T: Send>(
        &self,
        search: impl FnOnce(Monitor<'_>) -> Result<T, Error> + Send,
    ) -> Result<Result<T, Error>, Failure> {
        let progress = Searching::new();
        let monitor = |now| {
            progress.update(now);
            if interrupt::asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        match self {
            Self::Aloud => interrupt::during(|| search(&monitor)),
            Self::Kept(_) => Ok(search(&monitor)),
        }
    }
}
