//! What the arguments of the libraries are called here.
//!
//! The libraries name them between backticks, as `detrend`, wherever one is advised; here they are options.

use thetahat::design::DesignOptions;
use thetahat::model::KnownOptions;
use thetahat::options::{OptionRow, Options};
use thetahat::plan::FitOptions;
use thetahat::report::ValidationOptions;
use thetahat::spectrum::SpectrumOptions;
use thetahat::track::TrackOptions;

/// The tables of options.
const TABLES: [&[OptionRow]; 6] = [
    KnownOptions::TABLE,
    FitOptions::TABLE,
    DesignOptions::TABLE,
    SpectrumOptions::TABLE,
    TrackOptions::TABLE,
    ValidationOptions::TABLE,
];

/// The arguments of the libraries that are options, by the name that both have, beside those in a table.
pub(crate) const OPTIONS: [&str; 40] = [
    "cancel-zeros",
    "columns",
    "comment",
    "decimal-comma",
    "delimiter",
    "deviations",
    "draws",
    "encoding",
    "for",
    "format",
    "from",
    "gain",
    "grey",
    "header-row",
    "hold",
    "known",
    "limits",
    "lqr",
    "measurement-noise",
    "minimum-variance",
    "missing",
    "name",
    "no-header",
    "observer",
    "plan",
    "poles",
    "precision",
    "require",
    "resample",
    "sheet",
    "skip-rows",
    "stream",
    "time",
    "time-format",
    "time-unit",
    "time-zone",
    "to",
    "value",
    "warm",
    "what",
];

/// The option that an argument is, if it is one.
pub(crate) fn option_of(argument: &str) -> Option<&str> {
    // One at a time.
    match argument {
        "bounds" => Some("bound"),
        "delays" => Some("nk"),
        name => {
            let in_a_table = || TABLES.iter().any(|table| table.iter().any(|option| option.name() == name));
            (OPTIONS.contains(&name) || in_a_table()).then_some(name)
        }
    }
}

/// A message of a library with its arguments as options: `detrend` mean is --detrend mean.
pub fn with_options(message: &str) -> String {
    let mut parts = message.split('`');
    let mut text = parts.next().unwrap_or_default().to_owned();
    // Whether the next part stands after a backtick that has not been closed.
    let mut open = true;
    for part in parts {
        match option_of(part).filter(|_| open) {
            Some(option) => {
                text.push_str("--");
                text.push_str(option);
                // The backtick after it is gone too.
                open = false;
            }
            None => {
                if open {
                    text.push('`');
                }
                text.push_str(part);
                open = true;
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arguments_become_options_and_nothing_else_does() {
        for (from, to) in [
            ("`detrend` mean takes its own", "--detrend mean takes its own"),
            ("leave out one of `split` and `validate`", "leave out one of --split and --validate"),
            ("(`max-iterations`), or", "(--max-iterations), or"),
            ("`nk`", "--nk"),
            ("a `channel` and `nk` 1", "a `channel` and --nk 1"),
            ("none", "none"),
            ("a ` alone, `nk` 0", "a ` alone, --nk 0"),
            ("", ""),
        ] {
            assert_eq!(with_options(from), to);
        }
    }
}
