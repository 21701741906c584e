//! The options of a fit as arguments: each is a row of the library's table.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};
use serde_json::{Map, Value};
use thetahat::plan::{FIT_OPTIONS, FitOption, FitOptions, Form};

use super::Names;
use crate::failure::Failure;
use crate::options::with_options;

/// Values of these may begin with a hyphen.
const MAY_BE_NEGATIVE: [&str; 11] = [
    "dc_gain",
    "noise_bound",
    "norm",
    "prefilter",
    "regressor",
    "ridge",
    "split",
    "step",
    "time_limit",
    "tolerance",
    "width",
];

/// Those that were given, as JSON.
#[derive(Debug, Clone, Default)]
pub(crate) struct FitOptionArguments(Map<String, Value>);

impl FitOptionArguments {
    /// Them as the library has them.
    pub(crate) fn options(&self) -> Result<FitOptions, Failure> {
        FitOptions::of(&self.0).map_err(|error| Failure::option(&error))
    }
}

impl Args for FitOptionArguments {
    fn augment_args(command: Command) -> Command {
        FIT_OPTIONS.iter().fold(command, |command, option| command.arg(argument(option)))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for FitOptionArguments {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let given = |option: &&FitOption| {
            matches.value_source(option.field).is_some_and(|source| source == ValueSource::CommandLine)
        };
        let all = FIT_OPTIONS.iter().filter(given);
        Ok(Self(all.map(|option| (option.field.to_owned(), value(matches, option))).collect()))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

fn argument(option: &FitOption) -> Arg {
    let mut help = with_options(option.help.trim());
    if !option.default.is_empty() {
        help.push_str(&format!(" [default: {}]", with_options(option.default)));
    }
    let own =
        Arg::new(option.field).long(option.name()).help(help).help_heading(with_options(option.heading));
    let own = match option.field {
        "input" => own.short('u'),
        "output" => own.short('y'),
        _ => own,
    };
    let words = (option.words)();
    let own = own.value_name(option.notation).allow_hyphen_values(MAY_BE_NEGATIVE.contains(&option.field));
    let own = match option.form {
        Form::Flag => return own.action(ArgAction::SetTrue),
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
fn value(matches: &ArgMatches, option: &FitOption) -> Value {
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
