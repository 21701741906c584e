//! Ctrl-C and SIGTERM: the program ends, and no file is left half written.
//!
//! A search that asks for it ends by itself at its next iteration, and a stream with the row at hand. At any other
//! time, on the second Ctrl-C, and where that takes longer than a few seconds, the program ends at once, without the
//! file that it was writing.

use std::fs;
use std::io;
use std::path::PathBuf;
use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use indicatif::ProgressBar;
#[cfg(unix)]
use signal_hook::{consts::SIGTERM, iterator::Signals};
use tempfile::NamedTempFile;
use thetahat::Error;
use thetahat_table::Waker;

use crate::failure::Failure;
use crate::messages::say;

/// What a shell gives for a program that SIGINT ended, and for one that SIGTERM did.
const INTERRUPTED: u8 = 130;
#[cfg(unix)]
const TERMINATED: u8 = 143;

/// So long a search or a stream has to end by itself.
const PATIENCE: Duration = Duration::from_secs(5);

/// Whether a stream has to end. It is asked once a row, so it is apart from the lock.
static ENDING: AtomicBool = AtomicBool::new(false);
static STATE: Mutex<State> = Mutex::new(State::new());

/// What the handler, which runs on a thread of its own, must know.
struct State {
    /// Whether a search is under way that looks at `asked`, and whether it was asked to end.
    searching: bool,
    asked: bool,
    /// What wakes the stream that is being followed.
    waker: Option<Waker>,
    /// The exit code of whoever asked last.
    code: u8,
    /// The files that are being written, under their passing names.
    unfinished: Vec<PathBuf>,
    /// Whether something is written already.
    written: bool,
    /// What stands on the terminal.
    bar: Option<ProgressBar>,
}

impl State {
    const fn new() -> Self {
        Self {
            searching: false,
            asked: false,
            waker: None,
            code: INTERRUPTED,
            unfinished: Vec::new(),
            written: false,
            bar: None,
        }
    }
}

fn state() -> MutexGuard<'static, State> {
    STATE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Begins to listen. Where Ctrl-C is ignored, as of a job in the background of a script, it stays so.
pub(crate) fn listen() {
    *state() = State::new();
    ENDING.store(false, Ordering::Relaxed);
    // The handler of an earlier run in this process serves as well.
    let _ = ctrlc::try_set_handler(|| asked_by(INTERRUPTED));
    #[cfg(unix)]
    {
        static LISTENING: std::sync::Once = std::sync::Once::new();
        LISTENING.call_once(|| {
            let (listens, listening) = std::sync::mpsc::channel();
            // Without a thread SIGTERM ends the program as it ends any other.
            let _ = thread::Builder::new().spawn(move || {
                if let Ok(mut signals) = Signals::new([SIGTERM]) {
                    let _ = listens.send(());
                    signals.forever().for_each(|_| asked_by(TERMINATED));
                }
            });
            // A signal that comes after this is heard.
            let _ = listening.recv();
        });
    }
}

/// What happens when the program is asked to end.
fn asked_by(code: u8) {
    let mut state = state();
    state.code = code;
    if (state.searching || state.waker.is_some()) && !state.asked {
        state.asked = true;
        ENDING.store(true, Ordering::Relaxed);
        if let Some(waker) = &state.waker {
            waker.wake();
        }
        // It may wait for a reader of its output who does not come, or for who writes its log.
        let _ = thread::Builder::new().spawn(move || {
            thread::sleep(PATIENCE);
            let state = self::state();
            let goes_on = state.asked && (state.searching || state.waker.is_some());
            drop(state);
            if goes_on {
                asked_by(code);
            }
        });
        return;
    }
    if let Some(bar) = &state.bar {
        bar.finish_and_clear();
    }
    for path in &state.unfinished {
        // What is gone already need not be removed.
        let _ = fs::remove_file(path);
    }
    say(message(state.written));
    // The state is still locked: the file cannot be finished now.
    process::exit(code.into());
}

/// The exit code of a program that was asked to end.
pub(crate) fn exit_code() -> u8 {
    state().code
}

/// A stream is followed from now on: when it has to end, it is woken, and [`is_ending`] says so.
pub(crate) fn follows(waker: Waker) {
    state().waker = Some(waker);
}

/// The stream is not followed any more.
pub(crate) fn leaves() {
    state().waker = None;
}

/// Does what has not written anything and does not ask [`is_ending`]: meanwhile the program ends at once when it has
/// to. None if it has to end already.
pub(crate) fn at_once<T>(work: impl FnOnce() -> T) -> Option<T> {
    let waker = {
        let mut state = state();
        if state.asked {
            return None;
        }
        state.waker.take()
    };
    let done = work();
    state().waker = waker;
    Some(done)
}

/// Whether the stream has to end.
pub(crate) fn is_ending() -> bool {
    ENDING.load(Ordering::Relaxed)
}

/// The line for a program that was interrupted.
pub(crate) fn message(written: bool) -> &'static str {
    if written { "interrupted" } else { "interrupted; nothing was written" }
}

/// Whether something was written.
pub(crate) fn has_written() -> bool {
    state().written
}

/// Notes that output begins that cannot be taken back.
pub(crate) fn writing() {
    state().written = true;
}

/// Makes the file that is removed if the program is interrupted before [`finish`].
pub(crate) fn begin(make: impl FnOnce() -> io::Result<NamedTempFile>) -> io::Result<NamedTempFile> {
    let mut state = state();
    let file = make()?;
    state.unfinished.push(file.path().to_owned());
    Ok(file)
}

/// Moves the file to its place.
pub(crate) fn finish<T>(
    file: NamedTempFile,
    moving: impl FnOnce(NamedTempFile) -> Result<T, io::Error>,
) -> Result<T, io::Error> {
    let mut state = state();
    state.unfinished.retain(|path| path != file.path());
    let moved = moving(file)?;
    state.written = true;
    Ok(moved)
}

/// Removes the file, which was made to see whether one can be.
pub(crate) fn discard(file: NamedTempFile) -> io::Result<()> {
    let mut state = state();
    state.unfinished.retain(|path| path != file.path());
    file.close()
}

/// Notes what to clear from the terminal.
pub(crate) fn shows(bar: Option<ProgressBar>) {
    state().bar = bar;
}

/// Whether the search that asks this has to end. From now on it has a chance to.
pub(crate) fn asked() -> bool {
    let mut state = state();
    state.searching = true;
    state.asked
}

/// Runs an estimation that may look at [`asked`].
pub(crate) fn during<T>(estimation: impl FnOnce() -> Result<T, Error>) -> Result<Result<T, Error>, Failure> {
    let result = estimation();
    let mut state = state();
    state.searching = false;
    if state.asked { Err(Failure::interrupted()) } else { Ok(result) }
}
