//! How parameters were found, and how well they are determined.

use crate::estimate::{
    ConvexOutcome, Coupling, Initial, Norm, OrderScore, Procedure, ProcessOutcome, RefinementOutcome,
    RobustOutcome, Solver, SubspaceOutcome, VectorArxOutcome,
};
use thetahat_numerics::optimize::Stopped;

use crate::figures::{fixed, number, scientific, short};
use crate::model::{Model, Parameter, Signal};
use crate::present::tree::{Sections, columns, figure, word};
use crate::present::words::{
    algorithm, counted, criteria, initial, or_dash, outcome, quantity, some, stopped,
};
use crate::report::{Estimation, Report};
use crate::text::harmless;

use super::mean_square;

/// This many of a list are written.
const MOST: usize = 8;

/// The samples, the noise, the level and slope of the output, and the criteria.
pub(super) fn samples(on: &mut Sections, estimation: &Estimation, noise_variance: f64, output: &Signal) {
    if estimation.procedure.is_given() {
        on.line(format!("noise variance {}", number(noise_variance)));
        return;
    }
    on.line(format!(
        "{} samples, noise variance {}, condition number {}",
        estimation.samples,
        number(noise_variance),
        or_dash(estimation.condition, |condition| scientific(condition, 3))
    ));
    mean_square(on, estimation);
    if let Some(level) = estimation.level {
        let slope = estimation.slope.map_or_else(String::new, |slope| {
            format!(" in the middle of the rows, slope {} a second", quantity(slope))
        });
        on.line(format!("operating point of '{}': {}{slope}", harmless(&output.name), quantity(level)));
    }
    on.line(criteria(&estimation.criteria));
}

fn given(on: &mut Sections) {
    on.line("The numbers were given, and nothing was estimated.");
}

/// How the parameters of a model were found.
pub(super) fn procedure(on: &mut Sections, report: &Report) {
    let estimation = &report.estimation;
    let (inputs, parameters) = (report.model.inputs(), report.model.parameters());
    // Every polynomial model has one.
    let start = estimation.initial.unwrap_or_default();
    match &estimation.procedure {
        Procedure::LeastSquares { solver } => {
            let solver = match solver {
                Solver::NormalEquations => "normal equations",
                Solver::Qr => "QR",
                Solver::ExtendedPrecision => "normal equations in twice the precision",
            };
            on.line(format!("least squares ({solver}), {}", initial(start, 0)));
        }
        Procedure::InstrumentalVariables { .. } => {
            on.line(format!("instrumental variables in four stages, {}", initial(start, 0)));
        }
        Procedure::RefinedInstrumentalVariables { iterations, stopped: why, initial_conditions, .. } => {
            on.line(format!(
                "refined instrumental variables, {}, {}, {}",
                counted(*iterations),
                stopped(*why),
                initial(start, *initial_conditions)
            ));
        }
        Procedure::Robust(found) => robust(on, found, start),
        Procedure::ExactLikelihood(found) => {
            on.line(format!(
                "exact likelihood, ln L {}, {}, {}",
                or_dash(found.log_likelihood, |value| fixed(value, 4)),
                outcome(&found.search),
                match start {
                    Initial::Estimate => initial(Initial::Estimate, found.search.initial_conditions),
                    _ if report.model.as_polynomial().is_some_and(|model| model.factors.is_some()) =>
                        "differences stationary from the first one on".to_owned(),
                    _ if inputs.is_empty() => "stationary from the first sample on".to_owned(),
                    _ => "stationary, and inputs at rest before the first sample".to_owned(),
                }
            ));
        }
        Procedure::Constrained(outcome) => criterion(on, outcome, parameters, start),
        Procedure::Regularised(outcome) => {
            on.line(format!(
                "regularised by the {} kernel of the largest likelihood, {} of {} parameters free, {}",
                outcome.kernel.name(),
                short((10.0 * outcome.effective_parameters).round() / 10.0),
                parameters.len(),
                initial(start, 0)
            ));
            for (kernel, input) in outcome.inputs.iter().zip(inputs) {
                on.line(format!(
                    "{}: decay {}, correlation {}, variance of the first tap {} times that of the noise",
                    harmless(&input.name),
                    number(kernel.decay),
                    number(kernel.correlation),
                    number(kernel.scale)
                ));
            }
        }
        Procedure::PredictionError(search) => {
            on.line(format!(
                "prediction error, {}, {}",
                outcome(search),
                initial(start, search.initial_conditions)
            ));
        }
        Procedure::Given => given(on),
        // A text says of a model that was made of another one what it is, not how that was found.
        _ if matches!(report.model, Model::Polynomial(_)) && !on.is_page() => {}
        Procedure::InnovationsLikelihood(found) => {
            let search = &found.search;
            let starts = match search.reached.len() {
                0 => String::new(),
                count => format!(" from the best of {count} starts"),
            };
            on.line(format!(
                "largest likelihood, {} ({}){starts}, {}",
                counted(search.iterations),
                algorithm(search.algorithm),
                stopped(search.stopped)
            ));
        }
        Procedure::FreeRun(found) => free_run(on, found),
        Procedure::FrequencyResponse(found) => {
            on.line(points(estimation, found.relative, found.iterations, found.stopped));
        }
        Procedure::SharedPoles(found) => {
            on.line(points(estimation, found.relative, found.iterations, found.stopped));
            let feedthrough = feedthrough(found.feedthrough, found.feedthrough_given);
            on.line(format!("vector fitting and a search; {feedthrough}"));
            order_scores(on, &found.orders);
        }
        Procedure::Subspace(found) => {
            on.line(subspace(found));
            if let Some(RefinementOutcome { errors, search }) = &found.refinement {
                on.line(format!("refined for the least errors of {}: {}", errors.of(), outcome(search)));
            }
        }
        Procedure::VectorArx(found) => on.line(orders(found)),
        // Said of each output, below its functions.
        Procedure::ForwardRegression(_)
        | Procedure::Splits(_)
        | Procedure::Neighbours(_)
        | Procedure::Training(_) => {}
    }
}

/// What was made small where wild samples do not rule.
fn robust(on: &mut Sections, found: &RobustOutcome, start: Initial) {
    let loss = found.k.map_or_else(
        || "mean absolute error".to_owned(),
        |k| format!("mean of Huber's loss with k = {}", short(k)),
    );
    on.line(format!(
        "criterion: {loss} {}; scale of the errors {}, {} % beyond {}",
        number(found.objective),
        number(found.scale),
        fixed(100.0 * found.beyond, 2),
        number(found.bound)
    ));
    on.line(format!(
        "robust prediction error, {}, {}",
        outcome(&found.search),
        initial(start, found.search.initial_conditions)
    ));
}

/// What was made small and respected, and the box of all that respects it.
fn criterion(on: &mut Sections, outcome: &ConvexOutcome, parameters: &[Parameter], start: Initial) {
    let norm = match outcome.norm {
        Norm::Two => "sum of squared errors",
        Norm::One => "sum of absolute errors",
        Norm::Infinity => "largest absolute error",
    };
    let ridge = if outcome.ridge > 0.0 { format!(", ridge {}", short(outcome.ridge)) } else { String::new() };
    let conditions = outcome.search.as_ref().map_or(0, |search| search.initial_conditions);
    let start = initial(start, conditions);
    on.line(format!("criterion: {norm} {}{ridge}, {start}", number(outcome.objective)));
    if let Some(search) = &outcome.search {
        on.line(format!(
            "linear programs, {} from least squares ({}), {}",
            counted(search.costs.len().saturating_sub(1)),
            or_dash(search.costs.first().copied(), number),
            stopped(search.stopped)
        ));
    }
    if !outcome.active.is_empty() {
        on.line(format!("at a bound: {}", some(&outcome.active, MOST, ", ")));
    }
    if let (Some(bound), Some(ranges)) = (outcome.noise_bound, &outcome.box_) {
        on.gap();
        let mut table = columns("Ranges of the parameters", ["parameter", "least", "largest"]);
        for (parameter, [least, largest]) in parameters.iter().zip(ranges) {
            table.row([word(&parameter.name), figure(*least, number), figure(*largest, number)]);
        }
        on.line(format!("all parameters with no error above {}:", short(bound)));
        on.table(table);
    }
}

/// How the parameters of a process were found.
fn free_run(on: &mut Sections, outcome: &ProcessOutcome) {
    let start = match outcome.initial_conditions {
        0 => "logs begin at rest".to_owned(),
        1 => "1 initial condition estimated".to_owned(),
        count => format!("{count} initial conditions estimated"),
    };
    on.line(format!(
        "least errors of the free run, {}, {}, {start}",
        counted(outcome.iterations),
        stopped(outcome.stopped)
    ));
    on.line(match outcome.noise_order {
        0 => "standard errors of white errors, which the residuals are".to_owned(),
        order => format!(
            "standard errors of errors with the colour of the residuals, an autoregression of order {order}"
        ),
    });
}

/// What an order was chosen among.
fn order_scores(on: &mut Sections, scores: &[OrderScore]) {
    let least = scores.iter().filter_map(|score| score.mdl).fold(f64::INFINITY, f64::min);
    let mut table = columns("Orders", ["", "order", "MDL above the least"]);
    for score in scores {
        table.row([
            word(if score.mdl == Some(least) { "*" } else { "" }),
            word(score.order),
            score.mdl.map_or(word(""), |mdl| figure(mdl - least, |value| fixed(value, 1))),
        ]);
    }
    if !scores.is_empty() {
        on.table(table);
    }
}

/// Whether inputs act at once, and who said it.
fn feedthrough(is_there: bool, given: bool) -> &'static str {
    match (is_there, given) {
        (true, true) => "inputs act at once, as asked for",
        (false, true) => "no input acts at once, as asked for",
        (true, false) => "inputs act at once, which lowers MDL",
        (false, false) => "no input acts at once",
    }
}

/// How points of a frequency response were fitted to.
fn points(estimation: &Estimation, is_relative: bool, iterations: usize, why: Stopped) -> String {
    let root = estimation.mse.sqrt();
    let missed = if is_relative {
        format!("{} % of their size", short(100.0 * root))
    } else {
        format!("{} of their standard deviations", number(root))
    };
    format!(
        "{} parts of points, missed by {missed} in the mean, {}, {}",
        estimation.samples,
        counted(iterations),
        stopped(why)
    )
}

/// How states were found.
fn subspace(outcome: &SubspaceOutcome) -> String {
    let feedthrough = feedthrough(outcome.feedthrough, outcome.feedthrough_given);
    let method = outcome.weighting.to_string().to_uppercase();
    let levels = if outcome.constant { "; levels of the outputs estimated with the matrices" } else { "" };
    format!("subspace method {method}, a past of {} samples; {feedthrough}{levels}", outcome.past)
}

/// The orders of an ARX model of several outputs, and among how many models it was chosen.
fn orders(outcome: &VectorArxOutcome) -> String {
    let VectorArxOutcome { na, nb, nk, coupling, constant, tried, .. } = outcome;
    let list = |numbers: &[usize]| numbers.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    let inputs = if nb.is_empty() { String::new() } else { format!(", nb {}, nk {}", list(nb), list(nk)) };
    let coupling = match coupling {
        Coupling::Full => "A full",
        Coupling::None => "A diagonal",
    };
    let levels = if *constant { "; levels of the outputs estimated with the coefficients" } else { "" };
    let chosen =
        if tried.is_empty() { String::new() } else { format!("; the least MDL of {} models", tried.len()) };
    format!("least squares, na {na}{inputs}, {coupling}{levels}{chosen}")
}
