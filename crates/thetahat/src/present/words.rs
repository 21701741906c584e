//! How values are said, in cells and in sentences.

use crate::data::Rows;
use crate::estimate::{Criteria, InformationCriterion, Initial, SearchOutcome};
use crate::figures::{error, fixed, number, short};
use crate::model::{Interval, Orders, Quantity, Root, Signal, Structure};
use crate::optimize::{Algorithm, Stopped};
use crate::report::InSample;
use crate::respond::InitialCondition;
use crate::text::harmless;
use crate::validate::Part;

/// Costs that differ by less than this fraction are one.
pub(super) const ROUNDING: f64 = 1e-9;

/// Why a search ended.
pub(super) fn stopped(stopped: Stopped) -> &'static str {
    match stopped {
        Stopped::Converged => "converged",
        Stopped::NoDescent => "stopped where no step lowers the cost",
        Stopped::MaxIterations => "stopped at the most iterations",
        Stopped::TimeLimit => "stopped by the time limit",
    }
}

/// What rows served for.
pub(super) fn part(part: Part) -> &'static str {
    match part {
        Part::Estimation => "estimation",
        Part::Validation => "validation",
        Part::Test => "test",
    }
}

/// Whether a model was fitted to some rows.
pub(super) fn in_sample(in_sample: InSample) -> &'static str {
    match in_sample {
        InSample::No => "no",
        InSample::Partly => "partly",
        InSample::Yes => "yes",
    }
}

pub(super) fn yes(answer: bool) -> String {
    if answer { "yes" } else { "no" }.to_owned()
}

pub(super) fn stable(stable: bool) -> &'static str {
    if stable { "stable" } else { "unstable" }
}

/// Where a response starts from.
pub(super) fn start(start: InitialCondition) -> &'static str {
    match start {
        InitialCondition::Zero => "zero",
        InitialCondition::Drop => "drop",
        InitialCondition::Estimate => "estimate",
    }
}

/// What stands in a sentence where there is no figure.
pub(super) fn or_dash<T>(value: Option<T>, shown: impl FnOnce(T) -> String) -> String {
    value.map_or_else(|| "-".to_owned(), shown)
}

/// Some of a list that may be long.
pub(super) fn some<T: ToString>(all: &[T], most: usize, separator: &str) -> String {
    let shown: Vec<String> = all.iter().take(most).map(ToString::to_string).collect();
    let more = match all.len().saturating_sub(most) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    format!("{}{more}", shown.join(separator))
}

/// Some segments of rows.
pub(super) fn rows(rows: &[Rows]) -> String {
    some(rows, 8, ",")
}

/// A complex number.
pub(super) fn complex(root: &Root) -> String {
    if root.im == 0.0 {
        return number(root.re);
    }
    let sign = if root.im < 0.0 { '-' } else { '+' };
    format!("{} {sign} {}i", number(root.re), number(root.im.abs()))
}

/// The standard error of a real root; those of the real and the imaginary part of another.
pub(super) fn spread(root: &Root) -> Option<String> {
    root.covariance.map(|[[re, _], [_, im]]| {
        if root.im == 0.0 {
            return error(re.sqrt());
        }
        format!("{}, {}i", error(re.sqrt()), error(im.sqrt()))
    })
}

/// The ends of an interval.
pub(super) fn interval(interval: Interval) -> String {
    interval.shown(number)
}

/// A figure and its interval, or its standard error where there is none.
pub(super) fn quantity(quantity: Quantity) -> String {
    if let Some(known) = quantity.interval {
        if known == Interval::OPEN {
            return "not determined by this log".to_owned();
        }
        return match known {
            Interval { lower: Some(_), upper: Some(_) } => {
                format!("{}, 95 % interval {}", number(quantity.value), interval(known))
            }
            _ => format!("{}, {} (95 %)", number(quantity.value), interval(known)),
        };
    }
    let spread = quantity.standard_error.map_or_else(String::new, |spread| format!(" ± {}", error(spread)));
    format!("{}{spread}", number(quantity.value))
}

/// What the numbers of some models stand for.
pub(super) fn orders_legend<'a>(models: impl IntoIterator<Item = &'a Orders>) -> String {
    let mut kinds: Vec<&str> = models.into_iter().map(Orders::legend).collect();
    kinds.sort_unstable();
    kinds.dedup();
    format!("orders: {}", kinds.join(", "))
}

/// A model's structure and equation.
pub(super) fn formula(orders: &Orders) -> String {
    let name = match orders.structure() {
        Structure::Ar => "AR",
        Structure::Arma => "ARMA",
        Structure::Arx => "ARX",
        Structure::Armax => "ARMAX",
        Structure::Oe => "Output error",
        Structure::Bj => "Box-Jenkins",
        Structure::General => "General model",
    };
    format!("{name}: {}", orders.equation())
}

/// A channel with what is taken from it.
pub(super) fn signal(role: &str, signal: &Signal) -> String {
    let trend = match signal.offset.slope {
        0.0 => String::new(),
        slope => format!(" + {} a second", short(slope)),
    };
    format!("{role} {} (offset {}{trend})", harmless(&signal.name), short(signal.offset.level))
}

/// The information criteria.
pub(super) fn criteria(criteria: &Criteria) -> String {
    let of = |logarithmic: bool, figure: fn(f64) -> String| {
        let all = InformationCriterion::all().filter(|criterion| criterion.is_logarithmic() == logarithmic);
        let all =
            all.map(|criterion| format!("{} {}", criterion.name(), or_dash(criteria.of(criterion), figure)));
        all.collect::<Vec<_>>().join(", ")
    };
    format!("{}; per sample {}", of(false, number), of(true, |value| fixed(value, 4)))
}

/// What stood for the samples before the first.
pub(super) fn initial(initial: Initial, conditions: usize) -> String {
    match initial {
        Initial::Zero => "zeros before the first sample".to_owned(),
        Initial::Estimate if conditions > 0 => {
            format!("{conditions} initial condition{} estimated", if conditions == 1 { "" } else { "s" })
        }
        _ => "samples without a full past left out".to_owned(),
    }
}

/// The word of an algorithm in the options.
pub(super) fn algorithm(algorithm: Algorithm) -> &'static str {
    match algorithm {
        Algorithm::LevenbergMarquardt => "lm",
        Algorithm::GaussNewton => "gauss-newton",
        Algorithm::Newton => "newton",
        Algorithm::Gradient => "gradient",
        Algorithm::Annealing => "annealing",
    }
}

/// How a search went, in a few words.
pub(super) fn outcome(search: &SearchOutcome) -> String {
    let algorithm = algorithm(search.algorithm);
    let boundary = if search.stability_bound { " at the stability boundary" } else { "" };
    let (iterations, stopped) = (counted(search.iterations), stopped(search.stopped));
    // A comparison follows several starts; costs on fewer samples are others.
    let costs = search.starts.first().and_then(|start| start.cost).zip(search.costs.first());
    let followed = search.start_samples.is_none()
        && search.starts.iter().skip(1).any(|start| start.reached.is_some())
        && costs.is_some_and(|(start, first)| *first < start - ROUNDING * start.abs());
    let compared = if followed { " after a comparison of starts" } else { "" };
    format!("{iterations} ({algorithm}) from {}{compared}, {stopped}{boundary}", search.start)
}

pub(super) fn counted(iterations: usize) -> String {
    format!("{iterations} iteration{}", if iterations == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lists_are_cut() {
        assert_eq!(some(&[1, 2, 3], 3, ","), "1,2,3");
        assert_eq!(some(&[1, 2, 3, 4], 2, ","), "1,2 and 2 more");
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!([number(0.0), number(0.1), number(-12.0)], ["0", "0.100000", "-12.0000"]);
    }
}
