//! Long work without the interpreter lock: Ctrl-C ends it, and it goes on in a forked process.
//!
//! Whatever may use the threads of rayon goes through [`awaited`], or [`blocking`]: in a fork rayon's own pool waits
//! for threads that only the parent has.

use std::any::Any;
use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};

use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::{ThreadPool, ThreadPoolBuilder};
use thetahat::Error;
use thetahat::optimize::{Monitor, Progress};

use crate::error;

/// How often Python is asked whether somebody pressed Ctrl-C.
const PATIENCE: Duration = Duration::from_millis(50);
/// A loop checks the time after about this many multiplications, some tens of microseconds.
const WORK: usize = 1 << 17;

/// How long the interpreter waits at its end for calls of functions to return.
const FAREWELL: Duration = Duration::from_secs(2);
/// How long there has to be none for that.
const QUIET: Duration = Duration::from_millis(30);

/// The threads of this process, by how many they are. A fork has none of its parent's.
static POOLS: Mutex<Pools> = Mutex::new(Pools { process: 0, pools: BTreeMap::new() });

struct Pools {
    process: u32,
    /// Of 0 threads as many as there are cores.
    pools: BTreeMap<usize, Arc<ThreadPool>>,
}

thread_local! {
    /// How many threads the calls of this thread share with all others that want as many; 0: as many as there are
    /// cores.
    static THREADS: Cell<usize> = const { Cell::new(0) };
    /// What ends the calls of this thread, which no signal reaches where it is not the main one.
    static STOP: RefCell<Option<Arc<AtomicBool>>> = const { RefCell::new(None) };
    /// What is told of the progress of the calls of this thread.
    static TOLD: RefCell<Option<Py<PyAny>>> = const { RefCell::new(None) };
}

/// Where work is: how many models or iterations are done, of how many, and the least cost so far.
#[derive(Clone, Copy, PartialEq)]
struct Place {
    done: usize,
    total: Option<usize>,
    best: f64,
}

/// Where work is, written where it is done, read where it is waited for.
#[derive(Default)]
struct Watch(Mutex<Option<Place>>);

impl Watch {
    fn note(&self, now: Progress) {
        let mut place = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let best = place.map_or(f64::INFINITY, |before| before.best).min(now.cost);
        let (done, total) = now.models.map_or((now.iteration, None), |(done, all)| (done, Some(all)));
        *place = Some(Place { done, total, best });
    }

    fn place(&self) -> Option<Place> {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Ends the long work of the threads that have it, see [`threads`], within some tens of milliseconds.
#[pyclass(frozen, module = "thetahat._thetahat")]
#[derive(Default)]
struct Stop(Arc<AtomicBool>);

#[pymethods]
impl Stop {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    /// Work that is under way, and any that begins later, ends with KeyboardInterrupt.
    fn ask(&self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Runs a stage of the library without the interpreter lock, see [`awaited`].
pub(crate) fn interruptible<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(Monitor<'_>) -> Result<T, Error> + Send + 'static,
) -> PyResult<T> {
    awaited(py, work)?.map_err(|failure| error::batch(py, failure))
}

/// Runs work without the interpreter lock. Ctrl-C ends it: a search at its next iteration, anything else at once for
/// Python, while the work itself, of which nobody takes the result, goes on to its end beside it. So it owns its data.
pub(crate) fn awaited<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(Monitor<'_>) -> T + Send + 'static,
) -> PyResult<T> {
    awaited_on(&*pool()?, py, work)
}

/// The same on threads of its own: work that waits for calls of Python, which may want the others.
pub(crate) fn interruptible_apart<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(Monitor<'_>) -> Result<T, Error> + Send + 'static,
) -> PyResult<T> {
    awaited_on(&new_pool()?, py, work)?.map_err(|failure| error::batch(py, failure))
}

fn awaited_on<T: Send + 'static>(
    pool: &ThreadPool,
    py: Python<'_>,
    work: impl FnOnce(Monitor<'_>) -> T + Send + 'static,
) -> PyResult<T> {
    let asked = Arc::new(AtomicBool::new(false));
    let (sender, receiver) = sync_channel::<Result<T, Box<dyn Any + Send>>>(1);
    let stop = Arc::clone(&asked);
    let told = TOLD.with_borrow(|told| told.as_ref().map(|told| told.clone_ref(py)));
    let watch = told.as_ref().map(|_| Arc::<Watch>::default());
    let noted = watch.clone();
    pool.spawn(move || {
        let monitor = |now: Progress| {
            if let Some(watch) = &noted {
                watch.note(now);
            }
            if stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        // Nobody listens after Ctrl-C.
        let _ = sender.send(catch_unwind(AssertUnwindSafe(|| work(&monitor))));
    });
    let mut last = None;
    let mut tell = || {
        let (Some(told), Some(watch)) = (&told, &watch) else { return Ok(()) };
        let now = watch.place();
        if now == last {
            return Ok(());
        }
        last = now;
        let Some(Place { done, total, best }) = now else { return Ok(()) };
        Python::attach(|py| told.call1(py, (done, total, best.is_finite().then_some(best))).map(|_| ()))
    };
    let ended = py.detach(move || {
        loop {
            match receiver.recv_timeout(PATIENCE) {
                Ok(result) => {
                    tell()?;
                    return Ok(Some(result));
                }
                Err(RecvTimeoutError::Disconnected) => return Ok(None),
                Err(RecvTimeoutError::Timeout) => signals().and_then(|()| tell())?,
            }
        }
    });
    match ended {
        Ok(Some(Ok(result))) => Ok(result),
        Ok(Some(Err(panic))) => resume_unwind(panic),
        Ok(None) => Err(PyRuntimeError::new_err("the work ended without a result")),
        Err(signal) => {
            asked.store(true, Ordering::Relaxed);
            // What comes next does not wait for the threads that are still at it.
            known().pools.remove(&THREADS.get());
            Err(signal)
        }
    }
}

/// Runs work that looks after signals itself without the interpreter lock.
pub(crate) fn blocking<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let pool = pool()?;
    Ok(py.detach(|| pool.install(work)))
}

fn pool() -> PyResult<Arc<ThreadPool>> {
    let mut known = known();
    let threads = THREADS.get();
    if let Some(pool) = known.pools.get(&threads) {
        return Ok(Arc::clone(pool));
    }
    let pool = Arc::new(new_pool()?);
    known.pools.insert(threads, Arc::clone(&pool));
    Ok(pool)
}

fn new_pool() -> PyResult<ThreadPool> {
    let pool = ThreadPoolBuilder::new().num_threads(THREADS.get()).build();
    pool.map_err(|error| PyRuntimeError::new_err(format!("no threads: {error}")))
}

/// The pools of this process.
fn known() -> MutexGuard<'static, Pools> {
    let mut known = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    let process = std::process::id();
    if known.process != process {
        // The parent's are left as they are: there is nobody to end.
        std::mem::forget(std::mem::take(&mut known.pools));
        known.process = process;
    }
    known
}

/// Has the calls of this thread share this many threads with all others that want as many, 0: as many as there are
/// cores; and end when `stop` is asked. Gives what was before, to be given back.
#[pyfunction]
#[pyo3(signature = (count, stop))]
fn threads(count: usize, stop: Option<&Bound<'_, Stop>>) -> (usize, Option<Stop>) {
    (THREADS.replace(count), STOP.replace(stop.map(|stop| Arc::clone(&stop.get().0))).map(Stop))
}

/// Has the calls of this thread tell this function of their progress, with how many models or iterations are done, of
/// how many, and the least cost so far; None for no function. Gives what was before, to be given back.
#[pyfunction]
#[pyo3(signature = (told))]
fn progress(told: Option<Py<PyAny>>) -> Option<Py<PyAny>> {
    TOLD.replace(told)
}

/// What Python's handlers of the signals since the last time raise.
fn signals() -> PyResult<()> {
    if STOP.with_borrow(|stop| stop.as_ref().is_some_and(|stop| stop.load(Ordering::Relaxed))) {
        return Err(PyKeyboardInterrupt::new_err(()));
    }
    Python::try_attach(|py| py.check_signals()).unwrap_or_else(|| {
        rest();
        Ok(())
    })
}

/// Ends a loop without the interpreter lock at Ctrl-C.
pub(crate) struct Pulse {
    /// Rounds of the loop between two checks of the time.
    stride: usize,
    left: usize,
    asked: Instant,
}

impl Pulse {
    /// For a loop of which a round takes about this many multiplications.
    pub(crate) fn new(multiplications: usize) -> Self {
        let stride = WORK / multiplications.clamp(1, WORK);
        Self { stride, left: stride, asked: Instant::now() }
    }

    /// To be called in each round.
    #[inline(always)]
    pub(crate) fn check(&mut self) -> PyResult<()> {
        self.left -= 1;
        if self.left == 0 { self.check_time() } else { Ok(()) }
    }

    #[cold]
    fn check_time(&mut self) -> PyResult<()> {
        self.left = self.stride;
        if self.asked.elapsed() < PATIENCE {
            return Ok(());
        }
        self.asked = Instant::now();
        signals()
    }
}

/// Calls of Python code that are under way in this process.
static CALLS: AtomicUsize = AtomicUsize::new(0);
/// Whether another thread than that which imported the module has made one.
static ELSEWHERE: AtomicBool = AtomicBool::new(false);
/// The thread that imported the module.
static HERE: OnceLock<ThreadId> = OnceLock::new();
/// The thread that ends the interpreter.
static ENDING: OnceLock<ThreadId> = OnceLock::new();

/// Registers what has to be done when the interpreter ends, and in a fork.
pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    let _ = HERE.set(thread::current().id());
    module.add_class::<Stop>()?;
    module.add_function(wrap_pyfunction!(threads, module)?)?;
    module.add_function(wrap_pyfunction!(progress, module)?)?;
    py.import("atexit")?.call_method1("register", (wrap_pyfunction!(end, module)?,))?;
    let os = py.import("os")?;
    if os.hasattr("register_at_fork")? {
        let hooks = PyDict::new(py);
        hooks.set_item("after_in_child", wrap_pyfunction!(forget_calls, module)?)?;
        os.call_method("register_at_fork", (), Some(&hooks))?;
    }
    Ok(())
}

/// Calls Python code from a loop of ours.
///
/// Before Python 3.14 a daemon thread that wants the interpreter lock after the interpreter has ended is torn down
/// where it stands. With a function of this module under the Python code on its stack that aborts the process. So the
/// interpreter waits until such calls have returned, and a thread that begins another one rests for ever, as every
/// daemon thread does from Python 3.14 on.
pub(crate) fn calling<T>(py: Python<'_>, call: impl FnOnce() -> T) -> T {
    /// Counts while it lives.
    struct Call;
    impl Drop for Call {
        fn drop(&mut self) {
            let _ = CALLS.fetch_update(Ordering::SeqCst, Ordering::SeqCst, |calls| calls.checked_sub(1));
        }
    }
    let own = thread::current().id();
    CALLS.fetch_add(1, Ordering::SeqCst);
    let counted = Call;
    if ENDING.get().is_some_and(|thread| *thread != own) {
        drop(counted);
        py.detach(rest);
    }
    if HERE.get() != Some(&own) {
        ELSEWHERE.store(true, Ordering::SeqCst);
    }
    call()
}

/// For a thread whose interpreter has ended.
fn rest() {
    loop {
        thread::park();
    }
}

/// The interpreter ends.
#[pyfunction]
fn end(py: Python<'_>) {
    let _ = ENDING.set(thread::current().id());
    if !ELSEWHERE.load(Ordering::SeqCst) {
        return;
    }
    py.detach(|| {
        let asked = Instant::now();
        let mut quiet = Instant::now();
        // A thread in a loop begins its next call soon, and rests.
        while quiet.elapsed() < QUIET && asked.elapsed() < FAREWELL {
            if CALLS.load(Ordering::SeqCst) > 0 {
                quiet = Instant::now();
            }
            thread::sleep(Duration::from_millis(1));
        }
    });
}

/// The calls of other threads are not in this process.
#[pyfunction]
fn forget_calls() {
    CALLS.store(0, Ordering::SeqCst);
}
