//! What a careful reader of a report should know, in plain words.

use thetahat_numerics::optimize::Stopped;

use super::fitted_rows::is_exact;
use super::schema::Report;
use crate::estimate::SearchOutcome;
use crate::figures::{error, fixed, number, scientific};
use crate::model::{Orders, PolynomialModel, Structure, cancel, near_cancellation};
use crate::select::{Grid, OrderRange};

/// Condition numbers above this one are worth a warning.
const ILL_CONDITIONED: f64 = 1e6;
/// Below this fit, in percent, a model explains little.
const POOR: f64 = 50.0;
/// A last tap of more than this many standard errors, and of this part of the largest, is not zero.
const CERTAIN: f64 = 3.0;
const SMALL: f64 = 0.02;

/// What data, model and search call for.
pub(super) fn warnings(report: &Report, model: &PolynomialModel) -> Vec<String> {
    let data = &report.data;
    let mut warnings = Vec::new();
    for missing in data.missing.iter().filter(|missing| missing.rows > 0) {
        let output = missing.channel == model.output.name;
        warnings.push(format!(
            "channel '{}' misses {} of {} values; {}",
            missing.channel,
            missing.rows,
            data.rows,
            if output && model.structure == Structure::Oe {
                "these rows do not count"
            } else if output && model.factors.is_some() {
                "the fit goes on through them"
            } else if output && is_exact(report) {
                "the fit goes on through them, its figures do not"
            } else {
                "the log is cut there"
            }
        ));
    }
    if data.time_gaps > 0 {
        warnings.push(format!("gaps in the clock: {}; the log is cut there", data.time_gaps));
    }
    warnings.extend(data.overlap());
    if !model.stable {
        let largest = model.poles.iter().map(|pole| pole.re.hypot(pole.im)).fold(0.0, f64::max);
        warnings.push(format!(
            "the model is unstable (largest pole {}): its free run grows without bound",
            number(largest)
        ));
    }
    let procedure = &report.estimation.procedure;
    if let Some(search) = procedure.search() {
        let of = match (&model.factors, procedure.exact_likelihood()) {
            (Some(_), _) => Bounded::Factors,
            (None, Some(_)) => Bounded::Likelihood,
            (None, None) => Bounded::Errors,
        };
        warnings.extend(search_warnings(search, of));
    }
    if let Some(search) = procedure.constrained().and_then(|outcome| outcome.search.as_ref()) {
        let iterations = search.costs.len().saturating_sub(1);
        warnings.extend(stopped_early(search.stopped, iterations, None));
    }
    if procedure.regularised().is_some() {
        warnings.extend(cut_off(model));
    }
    // Factors of differences and seasons are close to one another on purpose.
    let cancels = if model.factors.is_none() { near_cancellation(model) } else { None };
    if let Some((pole, zero)) = cancels {
        // What A shares with C alone is in the plant all the same.
        let plant_too = pole.polynomial == "a" && zero.polynomial == "c" && !model.inputs.is_empty();
        let remedy = if plant_too {
            "the noise does without this pole of the plant; try Box-Jenkins or output error"
        } else {
            "lower both orders by one, unless they are known"
        };
        warnings.push(format!("{}: within their uncertainty they are one; {remedy}", cancel(&pole, &zero)));
    }
    if let Some(condition) = report.estimation.condition.filter(|condition| *condition > ILL_CONDITIONED) {
        warnings.push(format!(
            "the regressors are nearly dependent (condition number {}): parameters are uncertain; lower the orders \
             or sample more slowly",
            scientific(condition, 1)
        ));
    }
    warnings
}

/// Warns of impulse responses whose last tap is not zero for certain.
fn cut_off(model: &PolynomialModel) -> impl Iterator<Item = String> {
    let ends = model.b.iter().zip(&model.orders.nb).scan(0, |end, (b, taps)| {
        *end += taps;
        Some((*end, b))
    });
    ends.zip(&model.inputs).filter_map(|((end, b), input)| {
        let last = model.parameters.get(end.checked_sub(1)?)?;
        let largest = b.iter().fold(0.0_f64, |largest, tap| largest.max(tap.abs()));
        let size = last.value.abs();
        (size > CERTAIN * last.standard_error? && size > SMALL * largest).then(|| {
            format!(
                "the response of '{}' has not died out at its last tap ({} {}, standard error {}): its gain is that of these taps alone; \
                 give more `taps`",
                input.name,
                last.name,
                number(last.value),
                error(last.standard_error.unwrap_or(0.0))
            )
        })
    })
}

/// What must be stable in a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Bounded {
    /// C and F, for the least errors.
    Errors,
    /// A and C, for the largest likelihood.
    Likelihood,
    /// The factors of C and D.
    Factors,
}

/// What is worth a warning of a search.
fn search_warnings(search: &SearchOutcome, of: Bounded) -> Vec<String> {
    let (iterations, stopped) = (search.iterations, search.stopped);
    let bounded = stopped == Stopped::NoDescent && search.stability_bound && of == Bounded::Errors;
    let early = (!bounded).then(|| stopped_early(stopped, iterations, Some(search.gradient_norm))).flatten();
    let mut warnings: Vec<String> = early.into_iter().collect();
    if search.stability_bound {
        let roots = match of {
            Bounded::Factors => {
                "theta or Theta with a root on the unit circle means a difference too many, phi or Phi one too few; its parameters \
                 have no standard errors"
            }
            Bounded::Likelihood => {
                "A or C has a root on the unit circle; take differences of an output that wanders without a level, and of one that was \
                 differenced too often none; or lower na or nc"
            }
            Bounded::Errors => {
                "C or F has a root on the unit circle; the data want an unstable or overdifferenced model, so use arx or armax for an \
                 unstable plant, or lower nc or nf"
            }
        };
        warnings.push(format!("the search ended at the stability boundary: {roots}"));
    }
    warnings
}

/// A warning of a search that ended elsewhere than at a minimum, after so many iterations and with this gradient, if
/// there is one.
fn stopped_early(stopped: Stopped, iterations: usize, gradient: Option<f64>) -> Option<String> {
    match stopped {
        Stopped::Converged => None,
        Stopped::MaxIterations => Some(format!(
            "no convergence in {iterations} iterations: the parameters are not those of least cost; allow more \
             (`max-iterations`), or lower the orders"
        )),
        Stopped::TimeLimit => Some(format!(
            "no convergence: the time was used up after {iterations} iterations; allow more (`time-limit`)"
        )),
        Stopped::NoDescent => Some(format!(
            "the search stopped after {iterations} iterations where no step lowers the cost{}: the cost is flat or \
             rough there; lower the orders",
            gradient.map_or_else(String::new, |gradient| format!(" (gradient {})", scientific(gradient, 1)))
        )),
    }
}

/// A warning of a plant that seems to be unstable, where F, which must be stable, explains little.
pub(super) fn unstable_plant(report: &Report) -> Option<String> {
    let pole = report.estimation.procedure.search()?.unstable_pole?;
    let explained = report.fit.first()?.percent?;
    (explained < POOR).then(|| {
        format!(
            "the plant seems to be unstable: least squares finds a pole of modulus {}; F must be stable and \
             explains {} % only; an unstable plant needs A (arx or armax)",
            fixed(pole, 4),
            fixed(explained, 1)
        )
    })
}

/// A warning of orders that are the largest of their range: a larger one could be better.
pub(super) fn at_the_stability_boundary(orders: &Orders, grid: &Grid) -> Option<String> {
    let of_inputs = |ranges: &[OrderRange], orders: &[usize]| {
        let range = |input: usize| ranges.get(input).or(ranges.first());
        let at = |(input, order): (usize, &usize)| {
            range(input).is_some_and(|range| range.single().is_none() && range.last() == *order)
        };
        orders.iter().enumerate().any(at)
    };
    let names: Vec<&str> = [
        ("na", of_inputs(&[grid.na], &[orders.na])),
        ("nb", of_inputs(&grid.nb, &orders.nb)),
        ("nc", of_inputs(&[grid.nc], &[orders.nc])),
        ("nd", of_inputs(&[grid.nd], &[orders.nd])),
        ("nf", of_inputs(&grid.nf, &orders.nf)),
        ("nk", of_inputs(&grid.nk, &orders.nk)),
    ]
    .into_iter()
    .filter_map(|(name, at)| at.then_some(name))
    .collect();
    (!names.is_empty()).then(|| {
        format!(
            "the chosen {} {} the largest allowed: a larger one may be better; widen the range",
            names.join(", "),
            if names.len() == 1 { "is" } else { "are" }
        )
    })
}
