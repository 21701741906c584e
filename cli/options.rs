//! What the arguments of the libraries are called here.
//!
//! The libraries name them between backticks, as `detrend`, wherever one is advised; here they are options.

/// The arguments of the libraries that are options, by the name that both have.
pub(crate) const OPTIONS: [&str; 99] = [
    "alarm",
    "alpha",
    "alphas",
    "band",
    "cancel-zeros",
    "centres",
    "channels",
    "comment",
    "constant",
    "couple",
    "dc-gain",
    "dead-zone",
    "decimal-comma",
    "degree",
    "delimiter",
    "detrend",
    "discard",
    "draws",
    "encoding",
    "estimate",
    "estimator",
    "feedthrough",
    "focus",
    "forgetting",
    "format",
    "frequencies",
    "future",
    "gain",
    "half-width",
    "header-row",
    "hold",
    "horizon",
    "initial",
    "lags",
    "length",
    "limits",
    "lqr",
    "max-iterations",
    "measurement-noise",
    "method",
    "minimum-variance",
    "missing",
    "model",
    "most-terms",
    "name",
    "narx",
    "nf",
    "nk",
    "no-header",
    "noise-bound",
    "norm",
    "nu",
    "ny",
    "observer",
    "offset",
    "order",
    "outliers",
    "past",
    "period",
    "points",
    "poles",
    "precision",
    "prefilter",
    "range",
    "raw-terms",
    "refine",
    "require",
    "resample",
    "ridge",
    "rms",
    "rows",
    "sample-time",
    "scale",
    "select",
    "sheet",
    "signal",
    "skip-rows",
    "split",
    "start",
    "step",
    "structure",
    "term",
    "terms",
    "time",
    "time-format",
    "time-limit",
    "time-unit",
    "time-zone",
    "to",
    "tolerance",
    "trend",
    "units",
    "validate",
    "value",
    "want",
    "weighting",
    "what",
    "width",
    "window",
];

/// The option that an argument is, if it is one.
pub(crate) fn option_of(argument: &str) -> Option<&'static str> {
    // One at a time.
    match argument {
        "bounds" => Some("bound"),
        "delays" => Some("nk"),
        name => OPTIONS.into_iter().find(|option| *option == name),
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
