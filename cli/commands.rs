//! One file a verb.

mod bode;
mod closed_loop;
mod compare;
mod control;
mod convert;
pub(crate) mod demo;
mod design;
mod each;
mod experiments;
mod export;
mod filter;
mod fit;
mod help;
mod inspect;
mod model;
mod pieces;
mod reduce;
mod respond;
mod response;
mod search;
mod spectrum;
mod step;
mod stored;
mod templates;
mod track;
mod transient;
mod tune;
mod validate;

pub use each::Journal;
pub(crate) use experiments::{Experiments, experiments};
pub use filter::consistency;
pub(crate) use inspect::inspected;
pub(crate) use stored::plan;
pub use track::{TrackedRow, Tracking};

use crate::args::{Arguments, Command};
use crate::failure::Failure;

/// `line` is the command line as it was typed.
pub(crate) fn dispatch(arguments: Arguments, line: &str) -> Result<(), Failure> {
    arguments.command.files().check()?;
    match arguments.command {
        Command::Fit(arguments) => fit::fit(&arguments, line),
        Command::Inspect(arguments) => inspect::inspect(&arguments, line),
        Command::Spectrum(arguments) => spectrum::spectrum(&arguments, line),
        Command::Predict(arguments) => respond::predict(&arguments),
        Command::Simulate(arguments) => respond::simulate(&arguments),
        Command::Validate(arguments) => validate::validate(&arguments, line),
        Command::Compare(arguments) => compare::compare(&arguments, line),
        Command::Track(arguments) => track::track(&arguments),
        Command::Filter(arguments) => filter::filter(&arguments),
        Command::Bode(arguments) => bode::bode(&arguments, line),
        Command::Step(arguments) => step::step(&arguments, line),
        Command::Impulse(arguments) => transient::impulse(&arguments, line),
        Command::Reduce(arguments) => reduce::reduce(&arguments),
        Command::Convert(arguments) => convert::convert(&arguments),
        Command::Model(arguments) => model::model(&arguments),
        Command::Tune(arguments) => tune::tune(&arguments, line),
        Command::Control(arguments) => control::control(&arguments),
        Command::Export(arguments) => export::export(&arguments),
        Command::Design(arguments) => design::design(&arguments),
        Command::Templates(arguments) => templates::templates(&arguments),
        Command::Demo(arguments) => demo::demo(&arguments),
        Command::Schema { document } => help::schema(document),
        Command::Completions { shell } => help::completions(shell),
        Command::Man { verb } => help::manual(verb.as_deref()),
    }
}
