//! Bars on a terminal, for those who wait.

use std::io::IsTerminal;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use thetahat::figures::scientific;

use crate::interrupt;

/// What takes longer shows its progress on a terminal.
const PATIENCE: Duration = Duration::from_secs(1);
/// How often a spinner turns.
const TURN: Duration = Duration::from_millis(120);

/// Whether what is done many times over has the terminal for its own bar.
static TAKEN: AtomicBool = AtomicBool::new(false);

/// A bar that appears when patience ends, and goes when it is dropped.
#[derive(Debug)]
struct Bar {
    began: Instant,
    shown: OnceLock<ProgressBar>,
}

impl Bar {
    fn new() -> Self {
        Self { began: Instant::now(), shown: OnceLock::new() }
    }

    /// The bar, if it is time for it. The first time it is made of a template.
    fn due(&self, make: impl FnOnce() -> (ProgressBar, &'static str)) -> Option<&ProgressBar> {
        let shown = self.shown.get();
        if shown.is_some() || self.began.elapsed() < PATIENCE || !std::io::stderr().is_terminal() {
            return shown;
        }
        Some(self.shown.get_or_init(|| {
            let (bar, template) = make();
            let style =
                ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
            let bar = bar.with_style(style);
            interrupt::shows(Some(bar.clone()));
            bar
        }))
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        if let Some(bar) = self.shown.get() {
            bar.finish_and_clear();
            interrupt::shows(None);
        }
    }
}

/// How much of a log has been read.
#[derive(Debug)]
pub(crate) struct Reading(Bar);

impl Reading {
    pub(crate) fn new() -> Self {
        Self(Bar::new())
    }

    /// This many bytes, of how many if that is known.
    pub(crate) fn update(&self, read: u64, total: Option<u64>) {
        let make = || match total {
            Some(total) => (ProgressBar::new(total), "reading {wide_bar} {bytes}/{total_bytes} {eta}"),
            None => (ProgressBar::new_spinner(), "reading {spinner} {bytes}"),
        };
        if !TAKEN.load(Ordering::Relaxed)
            && let Some(bar) = self.0.due(make)
        {
            bar.set_position(read);
        }
    }
}

/// Where a search is.
#[derive(Debug)]
pub(crate) struct Searching(Bar);

impl Searching {
    pub(crate) fn new() -> Self {
        Self(Bar::new())
    }

    pub(crate) fn update(&self, progress: thetahat::optimize::Progress) {
        let make = || {
            let bar = ProgressBar::new_spinner();
            bar.enable_steady_tick(TURN);
            (bar, "searching {spinner} {msg} {elapsed}")
        };
        if !TAKEN.load(Ordering::Relaxed)
            && let Some(bar) = self.0.due(make)
        {
            let cost = scientific(progress.cost, 6);
            bar.set_message(match progress.models {
                Some((done, all)) => format!("{done} of {all} models, cost {cost}"),
                None => format!("iteration {}, cost {cost}", progress.iteration),
            });
        }
    }
}

/// How many of many logs are done. It has the terminal for itself.
#[derive(Debug)]
pub(crate) struct Counting {
    bar: Bar,
    logs: usize,
    done: AtomicUsize,
    failed: AtomicUsize,
}

impl Counting {
    pub(crate) fn new(logs: usize) -> Self {
        TAKEN.store(true, Ordering::Relaxed);
        Self { bar: Bar::new(), logs, done: AtomicUsize::new(0), failed: AtomicUsize::new(0) }
    }

    /// One more, well or not.
    pub(crate) fn done(&self, failed: bool) {
        let failures = self.failed.fetch_add(failed.into(), Ordering::Relaxed) + usize::from(failed);
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        let make = || (ProgressBar::new(self.logs as u64), "{wide_bar} {pos}/{len} logs, {msg} {eta}");
        if let Some(bar) = self.bar.due(make) {
            bar.set_message(format!("{failures} failed"));
            bar.set_position(done as u64);
        }
    }
}

impl Drop for Counting {
    fn drop(&mut self) {
        TAKEN.store(false, Ordering::Relaxed);
    }
}
