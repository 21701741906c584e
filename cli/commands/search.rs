//! Searches that tell of their progress, and what they find.

use std::ops::ControlFlow;

use thetahat::Error;
use thetahat::data::{Log, Source};
use thetahat::optimize::Monitor;
use thetahat::report::Report;

use crate::failure::Failure;
use crate::interrupt;
use crate::progress::Searching;

/// What a fit found, and the log that it was made to, if it was kept.
pub(super) struct Identified {
    pub(super) report: Report,
    pub(super) log: Option<Log>,
    pub(super) sources: Vec<Source>,
}

/// What a search finds that tells of its progress and may be interrupted.
pub(super) fn watched<T: Send>(
    search: impl FnOnce(Monitor<'_>) -> Result<T, Error> + Send,
) -> Result<Result<T, Error>, Failure> {
    let progress = Searching::new();
    let monitor = |now| {
        progress.update(now);
        if interrupt::asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    interrupt::during(|| search(&monitor))
}
