//! The threads that computations share.

use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::{env, io, thread};

use rayon::{ThreadBuilder, ThreadPoolBuilder};

/// Starts as many threads as there are cores, or as `RAYON_NUM_THREADS` says; where the system has not so many to give,
/// none, and the thread that computes does all: rayon would panic. Bits do not depend on it.
///
/// Inside of a pool, as in Python, that one is used.
pub(crate) fn share() {
    if rayon::current_thread_index().is_some() {
        return;
    }
    let asked = env::var("RAYON_NUM_THREADS").ok().and_then(|count| count.parse().ok());
    let cores = || thread::available_parallelism().map_or(1, usize::from);
    let count = asked.filter(|&count: &usize| count > 0).unwrap_or_else(cores);
    let (sender, receiver) = channel();
    let receiver = Arc::new(Mutex::new(receiver));
    let (begins, is_begun) = channel();
    // One after the other: a thread that has its stack and finds no memory for what it needs besides ends the process,
    // and where all begin at once, those after it have taken that.
    let begin = |_| {
        let (receiver, begins) = (Arc::clone(&receiver), begins.clone());
        let begun = thread::Builder::new().spawn(move || {
            // Who waits for it is there.
            let _ = begins.send(());
            serve(&receiver);
        })?;
        is_begun.recv().map_err(|_| io::Error::from(io::ErrorKind::BrokenPipe))?;
        io::Result::Ok(begun)
    };
    let begun: Vec<thread::JoinHandle<()>> = (0..count).map_while(|index| begin(index).ok()).collect();
    // An earlier run in this process may have made the pool: then it stays, and the threads of this one end.
    let _ = if begun.len() == count {
        let hand_over = |work: ThreadBuilder| sender.send(work).map_err(|_| io::ErrorKind::BrokenPipe.into());
        ThreadPoolBuilder::new().num_threads(count).spawn_handler(hand_over).build_global()
    } else {
        // Their stacks are memory for the work.
        drop(sender);
        begun.into_iter().for_each(|thread| drop(thread.join()));
        ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global()
    };
}

/// Waits for the work of a thread, and does it.
fn serve(receiver: &Mutex<Receiver<ThreadBuilder>>) {
    let work = receiver.lock().unwrap_or_else(PoisonError::into_inner).recv();
    if let Ok(work) = work {
        work.run();
    }
}
