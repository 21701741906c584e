use std::time::Duration;

use thetahat::optimize::{Algorithm, Search, Step};

use super::positive;
use crate::args::{SearchArgument, SearchArguments};
use crate::failure::Failure;

/// An option of the search that was given.
pub(super) fn given(arguments: &SearchArguments) -> Option<&'static str> {
    let options = [
        ("--search", arguments.search.is_some()),
        ("--max-iterations", arguments.max_iterations.is_some()),
        ("--tolerance", arguments.tolerance.is_some()),
        ("--step", arguments.step.is_some()),
        ("--starts", arguments.starts.is_some()),
        ("--seed", arguments.seed.is_some()),
        ("--time-limit", arguments.time_limit.is_some()),
    ];
    options.into_iter().find_map(|(option, given)| given.then_some(option))
}

/// How to search.
///
/// # Errors
/// A usage failure for numbers that make no sense.
pub(super) fn search(arguments: &SearchArguments) -> Result<Search, Failure> {
    let is_random = arguments.starts.is_some() || arguments.search == Some(SearchArgument::Annealing);
    if arguments.seed.is_some() && !is_random {
        return Err(Failure::usage("--starts is needed with --seed, which says where they are"));
    }
    seeded(arguments)
}

/// The same where a seed may stand alone: there are random starts without being asked for.
///
/// # Errors
/// As for [`search`].
pub(super) fn seeded(arguments: &SearchArguments) -> Result<Search, Failure> {
    let default = Search::default();
    let algorithm = match arguments.search {
        None | Some(SearchArgument::Lm) => Algorithm::LevenbergMarquardt,
        Some(SearchArgument::GaussNewton) => Algorithm::GaussNewton,
        Some(SearchArgument::Newton) => Algorithm::Newton,
        Some(SearchArgument::Gradient) => Algorithm::Gradient,
        Some(SearchArgument::Annealing) => Algorithm::Annealing,
    };
    let step = match &arguments.step {
        Some(_) if algorithm != Algorithm::Gradient => {
            return Err(Failure::usage("--step is for --search gradient; the others choose theirs"));
        }
        Some(text) => step(text)?,
        None => default.step,
    };
    let time_limit = arguments.time_limit.map(|limit| {
        let limit = positive("--time-limit", limit, "number of seconds")?;
        Duration::try_from_secs_f64(limit)
            .map_err(|_| Failure::usage(format!("--time-limit {limit:e}: too long; leave it out")))
    });
    Ok(Search {
        algorithm,
        max_iterations: arguments.max_iterations.map_or(default.max_iterations, |count| count as usize),
        tolerance: arguments
            .tolerance
            .map_or(Ok(default.tolerance), |value| positive("--tolerance", value, "number"))?,
        step,
        starts: arguments.starts.map_or(default.starts, |count| count as usize),
        seed: arguments.seed.unwrap_or(default.seed),
        time_limit: time_limit.transpose()?,
        ..default
    })
}

/// C1 or C1,C2.
fn step(text: &str) -> Result<Step, Failure> {
    let number =
        |text: &str| text.trim().parse().ok().filter(|value: &f64| value.is_finite() && *value > 0.0);
    let constants = match text.split_once(',') {
        None => number(text).map(|c1| Step { c1, c2: None }),
        Some((c1, c2)) => number(c1).zip(number(c2)).map(|(c1, c2)| Step { c1, c2: Some(c2) }),
    };
    constants.ok_or_else(|| {
        Failure::usage(format!(
            "--step {text}: write it as C1 or C1,C2, positive numbers, such as 0.5 or 1,2"
        ))
    })
}
