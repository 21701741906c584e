//! Options as arguments: each is a row of a table of the library.

use std::marker::PhantomData;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};
use serde_json::{Map, Value};
use thetahat::options::{Form, OptionRow, Options};

use super::Names;
use crate::failure::Failure;
use crate::options::with_options;

/// Those of a table that were given, as JSON.
#[derive(Debug, Clone, Default)]
pub(crate) struct OptionArguments<O>(Map<String, Value>, PhantomData<O>);

impl<O: Options> OptionArguments<O> {
    /// Them as the library has them.
    pub(crate) fn options(&self) -> Result<O, Failure> {
        O::of(&self.0).map_err(|error| Failure::option(&error))
    }
}

impl<O: Options> Args for OptionArguments<O> {
    fn augment_args(command: Command) -> Command {
        O::TABLE.iter().fold(command, |command, option| command.arg(argument(option)))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<O: Options> FromArgMatches for OptionArguments<O> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let given = |option: &&OptionRow| {
            matches.value_source(option.field).is_some_and(|source| source == ValueSource::CommandLine)
        };
        let all = O::TABLE.iter().filter(given);
        Ok(Self(all.map(|option| (option.field.to_owned(), value(matches, option))).collect(), PhantomData))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

fn argument(option: &OptionRow) -> Arg {
    let mut help = with_options(option.help.trim());
    if !option.default.is_empty() {
        help.push_str(&format!(" [default: {}]", with_options(option.default)));
    }
    let own = Arg::new(option.field).long(option.name()).help(help);
    let own = match option.heading {
        "" => own,
        heading => own.help_heading(with_options(heading)),
    };
    let own = match option.field {
        "input" => own.short('u'),
        "output" => own.short('y'),
        "length" => own.short('n'),
        "signal" => own.short('s'),
        _ => own,
    };
    let words = (option.words)();
    if option.form == Form::Flag {
        return own.action(ArgAction::SetTrue);
    }
    let own = own.value_name(option.notation).allow_hyphen_values(option.signed);
    let own = match option.form {
        Form::Flag => own,
        Form::Single => own.action(ArgAction::Set),
        Form::List => own.action(ArgAction::Append).value_delimiter(','),
        Form::Repeated => own.action(ArgAction::Append),
        Form::Names => return own.action(ArgAction::Append).value_parser(clap::value_parser!(Names)),
    };
    if words.is_empty() {
        return own;
    }
    let values = words
        .into_iter()
        .map(|known| PossibleValue::new(known.word).help(with_options(known.help)).aliases(known.alias));
    own.value_parser(PossibleValuesParser::new(values).map(|word: String| word))
}

/// The value of an option that was given.
fn value(matches: &ArgMatches, option: &OptionRow) -> Value {
    let texts = || matches.get_many::<String>(option.field).into_iter().flatten().cloned();
    match option.form {
        Form::Flag => Value::Bool(true),
        Form::Single => texts().next().into(),
        Form::List | Form::Repeated => texts().map(Value::from).collect(),
        Form::Names => {
            let lists: Vec<Names> = matches.get_many(option.field).into_iter().flatten().cloned().collect();
            Names::all(&lists).into_iter().flatten().map(Value::from).collect()
        }
    }
}
