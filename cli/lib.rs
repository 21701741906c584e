//! The command line of thetahat as a library: [`run`] is the whole program. A binding to another language calls the
//! stages of the program with the same options, and gets the same tables.
//!
//! `args` is syntax only; `job` resolves it, with every check that needs no data; `log` makes a log of what
//! `thetahat_table` reads; `commands` has one file a verb. Only this crate opens other files than logs, prints, or
//! knows about terminals.

#[cfg(doctest)]
mod pages {
    #[doc = include_str!("../README.md")]
    mod readme {}
    #[doc = include_str!("../docs/firmware.md")]
    mod firmware {}
    #[doc = include_str!("../docs/rust.md")]
    mod rust {}
}

mod args;
mod binding;
mod commands;
mod failure;
mod files;
mod interrupt;
mod job;
mod line_writer;
mod live;
mod log;
mod memory;
mod messages;
mod options;
mod output;
mod progress;
mod replace;
mod shell;
mod threads;
mod wrap;

use std::ffi::OsString;

use clap::Parser;
use messages::{say, tell};
use thetahat::text;

pub use binding::{Opened, inspect, read, topic_list, write};
pub use commands::demo::LOG as DEMO_LOG;
pub use commands::{Journal, TrackedRow, Tracking, consistency};
pub use failure::{Failure, Kind};
pub use options::with_options;

/// Runs the program on its arguments, the program's name first, and gives its exit code: 0 done, 2 usage, 3 bad data,
/// 4 the data cannot determine the model, 5 input/output, 6 a model does not meet what was required, 7 an alarm
/// ended the run, 130 interrupted, 143 terminated.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let words: Vec<OsString> = arguments.into_iter().collect();
    let arguments = match args::Arguments::try_parse_from(&words) {
        Ok(arguments) => arguments,
        Err(error) => {
            // Help and version come this way too, with code 0.
            print(&error);
            return u8::try_from(error.exit_code()).unwrap_or(2);
        }
    };
    interrupt::listen();
    threads::share();
    match commands::dispatch(arguments, &shell::line(&words)) {
        Ok(()) => 0,
        Err(failure) => end(&failure),
    }
}

/// Says on standard error why the program ends, and gives its exit code.
fn end(failure: &Failure) -> u8 {
    match failure.kind() {
        Kind::Closed => {}
        Kind::Interrupted => {
            say(interrupt::message(interrupt::has_written()));
            // That of the signal.
            return interrupt::exit_code();
        }
        Kind::Alarm => tell(failure.message()),
        _ => tell(&format!("\x1b[1;31merror:\x1b[0m {}", failure.message())),
    }
    failure.exit_code()
}

/// Prints what the syntax of a command line says. Nobody is left to tell if that fails.
fn print(error: &clap::Error) {
    let plain = error.render().to_string();
    if plain.lines().any(|line| line.contains(text::is_invisible)) {
        // A file's name, which may hold anything, stood for a pattern of the shell.
        plain.lines().for_each(|line| say(&text::harmless(line)));
    } else {
        let _ = error.print();
    }
}
