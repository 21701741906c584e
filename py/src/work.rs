//! Long work without the interpreter lock: it can be interrupted, and goes on in a forked process.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use thetahat::{Error, Monitor};

use crate::error;

/// How often Python is asked whether somebody pressed Ctrl-C.
const PATIENCE: Duration = Duration::from_millis(50);

/// The threads of this process. A fork has none of its parent's, whose pool would wait for them for ever.
static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// Runs work without the interpreter lock. Ctrl-C ends it at the next iteration of a search.
pub(crate) fn interruptible<T: Send>(
    py: Python<'_>,
    work: impl FnOnce(Monitor<'_>) -> Result<T, Error> + Send,
) -> PyResult<T> {
    let pool = pool()?;
    let asked = AtomicBool::new(false);
    let monitor =
        |_| if asked.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
    let (result, raised) = py.detach(|| {
        thread::scope(|scope| {
            let (sender, receiver) = channel();
            let monitor = &monitor;
            scope.spawn(move || sender.send(pool.install(|| work(monitor))));
            let mut raised = None;
            loop {
                match receiver.recv_timeout(PATIENCE) {
                    Ok(result) => return (Some(result), raised),
                    // The work panicked: the scope says so when it ends.
                    Err(RecvTimeoutError::Disconnected) => return (None, raised),
                    Err(RecvTimeoutError::Timeout) => {
                        if let Err(signal) = Python::attach(|py| py.check_signals()) {
                            asked.store(true, Ordering::Relaxed);
                            raised = Some(signal);
                        }
                    }
                }
            }
        })
    });
    match (raised, result) {
        (Some(signal), _) => Err(signal),
        (None, Some(result)) => result.map_err(|failure| error::batch(py, failure)),
        (None, None) => Err(PyRuntimeError::new_err("the work ended without a result")),
    }
}

/// Runs work that nobody interrupts without the interpreter lock.
pub(crate) fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let pool = pool()?;
    Ok(py.detach(|| pool.install(work)))
}

fn pool() -> PyResult<Arc<ThreadPool>> {
    let mut known = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    let process = std::process::id();
    match &*known {
        Some((owner, pool)) if *owner == process => Ok(Arc::clone(pool)),
        _ => {
            let pool = ThreadPoolBuilder::new().build();
            let pool =
                Arc::new(pool.map_err(|error| PyRuntimeError::new_err(format!("no threads: {error}")))?);
            // The parent's pool is left as it is: there is nobody to end.
            std::mem::forget(known.replace((process, Arc::clone(&pool))));
            Ok(pool)
        }
    }
}
