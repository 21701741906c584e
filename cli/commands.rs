//! One file a verb.

mod bode;
mod demo;
mod fit;
mod help;
mod respond;
mod stored;
mod summary;

use crate::args::{Arguments, Command};
use crate::failure::Failure;

pub(crate) fn dispatch(arguments: Arguments) -> Result<(), Failure> {
    match arguments.command {
        Command::Fit(arguments) => fit::fit(&arguments),
        Command::Predict(arguments) => respond::predict(&arguments),
        Command::Simulate(arguments) => respond::simulate(&arguments),
        Command::Bode(arguments) => bode::bode(&arguments),
        Command::Demo(arguments) => demo::demo(&arguments),
        Command::Schema => help::schema(),
        Command::Completions { shell } => help::completions(shell),
        Command::Man { verb } => help::manual(verb.as_deref()),
    }
}
