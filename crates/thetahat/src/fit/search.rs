//! How to search, where a model is not linear in its parameters.

use std::time::Duration;

use thetahat_numerics::optimize::{Algorithm, Search, Step};

use crate::Error;
use crate::plan::FitOptions;

/// The options of a search.
pub(super) const OPTIONS: [&str; 7] =
    ["search", "max_iterations", "tolerance", "step", "starts", "seed", "time_limit"];

/// How to search.
///
/// # Errors
/// [`Error::Argument`] for numbers that make no sense.
pub(super) fn search(options: &FitOptions) -> Result<Search, Error> {
    let is_random = options.starts.is_some() || options.search == Some(Algorithm::Annealing);
    if options.seed.is_some() && !is_random {
        return Err(Error::argument("seed", "it says where further starts are; give `starts` too"));
    }
    seeded(options)
}

/// The same where a seed may stand alone: there are random starts without being asked for.
///
/// # Errors
/// As for [`search`].
pub(super) fn seeded(options: &FitOptions) -> Result<Search, Error> {
    let default = Search::default();
    let algorithm = options.search.unwrap_or_default();
    if options.step.is_some() && algorithm != Algorithm::Gradient {
        return Err(Error::argument("step", "it is for `search` gradient; the others choose theirs"));
    }
    let time_limit = options.time_limit.map(|limit| {
        let limit = positive("time-limit", limit, "number of seconds")?;
        Duration::try_from_secs_f64(limit)
            .map_err(|_| Error::argument("time-limit", format!("{limit:e}: too long; leave it out")))
    });
    Ok(Search {
        algorithm,
        max_iterations: within("max-iterations", options.max_iterations, 1..=1_000_000)?
            .unwrap_or(default.max_iterations),
        tolerance: options
            .tolerance
            .map_or(Ok(default.tolerance), |value| positive("tolerance", value, "number"))?,
        step: options.step.map_or(default.step, |step| Step { c1: step.c1, c2: step.c2 }),
        starts: within("starts", options.starts, 0..=10_000)?.unwrap_or(default.starts),
        seed: options.seed.unwrap_or(default.seed),
        time_limit: time_limit.transpose()?,
        ..default
    })
}

/// A number that must be positive.
pub(super) fn positive(option: &str, value: f64, what: &str) -> Result<f64, Error> {
    if value.is_finite() && value > 0.0 {
        return Ok(value);
    }
    Err(Error::argument(option, format!("{value} is not a positive {what}; give one above 0")))
}

/// A number, if it is given, in a range.
pub(super) fn within(
    option: &str,
    value: Option<usize>,
    range: std::ops::RangeInclusive<usize>,
) -> Result<Option<usize>, Error> {
    match value {
        Some(outside) if !range.contains(&outside) => {
            Err(Error::argument(option, format!("{outside} is outside {}..{}", range.start(), range.end())))
        }
        inside => Ok(inside),
    }
}
