//! Documents as tables of text.

mod continuous;
mod control;
mod design;
mod equations;
mod filtered;
mod inspection;
mod nonlinear_arx;
mod process;
mod reduction;
mod response;
mod selection;
mod state_space;
mod step_test;
mod text;
mod topics;
mod tracking;
mod tuning;
mod validation;

use crate::data::Rows;
use crate::estimate::{
    ConvexOutcome, Criteria, InformationCriterion, Initial, Norm, Procedure, RobustOutcome, SearchOutcome,
    Solver,
};
use crate::figures::{error, fixed, number, of_unit, scientific, seconds, short};
use crate::model::{Interval, Model, Orders, PolynomialModel, Quantity, Root, Signal, Structure};
use crate::optimize::Algorithm;
use crate::present::Layout;
use crate::present::words::{complex, part, stopped};
use crate::report::{Estimation, Report};
use crate::respond::InitialCondition;
use crate::text::harmless;
use crate::validate::Fit;

pub use control::control;
pub use design::experiment_design;
pub use design::test_signal;
pub use filtered::filtered;
pub use inspection::inspection;
pub use reduction::hankel_singular_values;
pub use response::response;
pub use step_test::step_test;
pub use text::wrapped;
use text::{Text, columns, or_dash, some};
pub use topics::topics;
pub use tracking::tracking;
pub use tuning::tuning;
pub use validation::{comparison, validation};

/// This many of a list are written.
const MOST: usize = 8;
/// Costs that differ by less than this fraction are one.
const ROUNDING: f64 = 1e-9;
/// Why there may be no figure.
const NO_ERROR: &str = "the way it was estimated gives no standard error";
const NO_ROOT_ERROR: &str =
    "no standard error is known, or no time constant goes with a pole on or outside of the unit circle";
const NO_FIT: &str = "the output is constant, no sample counts, or the response overflows";

/// The model of a report that was converted, which has no figures of a fit.
pub fn converted(report: &Report, layout: Layout) -> String {
    match &report.model {
        Model::StateSpace(model) => state_space::model_alone(report, model, layout),
        _ => self::report(report, layout),
    }
}

/// The report's main figures.
pub fn report(report: &Report, layout: Layout) -> String {
    let mut shown = match &report.model {
        Model::Polynomial(model) => polynomial(report, model, layout),
        Model::Equations(model) => equations::table(report, model, layout),
        Model::NonlinearArx(model) => nonlinear_arx::table(report, model, layout),
        Model::Process(model) => process::table(report, model, layout),
        Model::StateSpace(model) => state_space::table(report, model, layout),
        Model::ContinuousStateSpace(model) => continuous::table(report, model, layout),
    };
    if !report.purpose.is_empty() {
        let mut text = Text::new(layout);
        text.line("");
        text.line(&report.purpose);
        shown.push_str(&text.finish());
    }
    shown
}

fn polynomial(report: &Report, model: &PolynomialModel, layout: Layout) -> String {
    let mut text = Text::new(layout);
    selection::selection(&mut text, report);
    text.line(&format!("{}, sample time {}", formula(&model.orders), seconds(model.sample_time)));
    let signals = model.inputs.iter().map(|input| signal("input", input));
    let signals: Vec<String> = signals.chain([signal("output", &model.output)]).collect();
    text.line(&signals.join(", "));
    text.line("");

    let mut parameters = columns(&["parameter", "value", "standard error"]).none(NO_ERROR);
    for parameter in &model.parameters {
        parameters.row([
            parameter.name.clone(),
            number(parameter.value),
            or_dash(parameter.standard_error, error),
        ]);
    }
    text.table(parameters);
    estimation(&mut text, &report.estimation, model);
    text.line("");
    dynamics(&mut text, model);
    text.line("");
    fits(&mut text, &report.fit);
    text.finish()
}

/// The model's structure and equation.
fn formula(orders: &Orders) -> String {
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

fn signal(role: &str, signal: &Signal) -> String {
    let trend = match signal.offset.slope {
        0.0 => String::new(),
        slope => format!(" + {} a second", short(slope)),
    };
    format!("{role} {} (offset {}{trend})", harmless(&signal.name), short(signal.offset.level))
}

/// How the parameters were found, and how well they are determined.
fn estimation(text: &mut Text, estimation: &Estimation, model: &PolynomialModel) {
    samples(text, estimation, model.noise_variance, &model.output);
    // Every polynomial model has one.
    let start = estimation.initial.unwrap_or_default();
    match &estimation.procedure {
        Procedure::LeastSquares { solver } => {
            let solver = match solver {
                Solver::NormalEquations => "normal equations",
                Solver::Qr => "QR",
                Solver::ExtendedPrecision => "normal equations in twice the precision",
            };
            text.line(&format!("least squares ({solver}), {}", initial(start, 0)));
        }
        Procedure::InstrumentalVariables { .. } => {
            text.line(&format!("instrumental variables in four stages, {}", initial(start, 0)));
        }
        Procedure::RefinedInstrumentalVariables { iterations, stopped: why, initial_conditions, .. } => {
            text.line(&format!(
                "refined instrumental variables, {}, {}, {}",
                counted(*iterations),
                stopped(*why),
                initial(start, *initial_conditions)
            ));
        }
        Procedure::Robust(found) => robust(text, found, start),
        Procedure::ExactLikelihood(found) => {
            text.line(&format!(
                "exact likelihood, ln L {}, {}, {}",
                or_dash(found.log_likelihood, four),
                outcome(&found.search),
                match start {
                    Initial::Estimate => initial(Initial::Estimate, found.search.initial_conditions),
                    _ if model.inputs.is_empty() => "stationary from the first sample on".to_owned(),
                    _ => "stationary, and inputs at rest before the first sample".to_owned(),
                }
            ));
        }
        Procedure::Constrained(outcome) => criterion(text, outcome, model, start),
        Procedure::Regularised(outcome) => {
            text.line(&format!(
                "regularised by the {} kernel of the largest likelihood, {} of {} parameters free, {}",
                outcome.kernel.name(),
                short((10.0 * outcome.effective_parameters).round() / 10.0),
                model.parameters.len(),
                initial(start, 0)
            ));
            for (kernel, input) in outcome.inputs.iter().zip(&model.inputs) {
                text.line(&format!(
                    "{}: decay {}, correlation {}, variance of the first tap {} times that of the noise",
                    harmless(&input.name),
                    number(kernel.decay),
                    number(kernel.correlation),
                    number(kernel.scale)
                ));
            }
        }
        Procedure::InnovationsLikelihood(_)
        | Procedure::ForwardRegression(_)
        | Procedure::Splits(_)
        | Procedure::Neighbours(_)
        | Procedure::Training(_)
        | Procedure::FreeRun(_)
        | Procedure::FrequencyResponse(_)
        | Procedure::Subspace(_)
        | Procedure::VectorArx(_) => {}
        Procedure::PredictionError(search) => {
            text.line(&format!(
                "prediction error, {}, {}",
                outcome(search),
                initial(start, search.initial_conditions)
            ));
        }
    }
}

/// The samples, the noise, the level and slope of the output, and the criteria.
fn samples(text: &mut Text, estimation: &Estimation, noise_variance: f64, output: &Signal) {
    text.line(&format!(
        "{} samples, noise variance {}, condition number {}",
        estimation.samples,
        number(noise_variance),
        or_dash(estimation.condition, |condition| scientific(condition, 3))
    ));
    if let Some(level) = estimation.level {
        let slope = estimation.slope.map_or_else(String::new, |slope| {
            format!(" in the middle of the rows, slope {} a second", quantity(slope))
        });
        text.line(&format!(
            "level of {} estimated with them: {}{slope}",
            harmless(&output.name),
            quantity(level)
        ));
    }
    text.line(&criteria(&estimation.criteria));
}

/// The information criteria.
fn criteria(criteria: &Criteria) -> String {
    let of = |logarithmic: bool, figure: fn(f64) -> String| {
        let all = InformationCriterion::all().filter(|criterion| criterion.is_logarithmic() == logarithmic);
        let all =
            all.map(|criterion| format!("{} {}", criterion.name(), or_dash(criteria.of(criterion), figure)));
        all.collect::<Vec<_>>().join(", ")
    };
    format!("{}; per sample {}", of(false, number), of(true, four))
}

fn four(value: f64) -> String {
    fixed(value, 4)
}

/// What stood for the samples before the first.
fn initial(initial: Initial, conditions: usize) -> String {
    match initial {
        Initial::Zero => "zeros before the first sample".to_owned(),
        Initial::Estimate if conditions > 0 => {
            format!("{conditions} initial condition{} estimated", if conditions == 1 { "" } else { "s" })
        }
        _ => "samples without a full past left out".to_owned(),
    }
}

/// The word of an algorithm in the options.
fn word(algorithm: Algorithm) -> &'static str {
    match algorithm {
        Algorithm::LevenbergMarquardt => "lm",
        Algorithm::GaussNewton => "gauss-newton",
        Algorithm::Newton => "newton",
        Algorithm::Gradient => "gradient",
        Algorithm::Annealing => "annealing",
    }
}

/// How a search went, in a few words.
fn outcome(search: &SearchOutcome) -> String {
    let algorithm = word(search.algorithm);
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

fn counted(iterations: usize) -> String {
    format!("{iterations} iteration{}", if iterations == 1 { "" } else { "s" })
}

/// What was made small where wild samples do not rule.
fn robust(text: &mut Text, found: &RobustOutcome, start: Initial) {
    let loss = found.k.map_or_else(
        || "mean absolute error".to_owned(),
        |k| format!("mean of Huber's loss with k = {}", short(k)),
    );
    text.line(&format!(
        "criterion: {loss} {}; scale of the errors {}, {} % beyond {}",
        number(found.objective),
        number(found.scale),
        fixed(100.0 * found.beyond, 2),
        number(found.bound)
    ));
    text.line(&format!(
        "robust prediction error, {}, {}",
        outcome(&found.search),
        initial(start, found.search.initial_conditions)
    ));
}

/// What was made small and respected, and the box of all that respects it.
fn criterion(text: &mut Text, outcome: &ConvexOutcome, model: &PolynomialModel, start: Initial) {
    let norm = match outcome.norm {
        Norm::Two => "sum of squared errors",
        Norm::One => "sum of absolute errors",
        Norm::Infinity => "largest absolute error",
    };
    let ridge = if outcome.ridge > 0.0 { format!(", ridge {}", short(outcome.ridge)) } else { String::new() };
    let conditions = outcome.search.as_ref().map_or(0, |search| search.initial_conditions);
    let start = initial(start, conditions);
    text.line(&format!("criterion: {norm} {}{ridge}, {start}", number(outcome.objective)));
    if let Some(search) = &outcome.search {
        text.line(&format!(
            "linear programs, {} from least squares ({}), {}",
            counted(search.costs.len().saturating_sub(1)),
            or_dash(search.costs.first().copied(), number),
            stopped(search.stopped)
        ));
    }
    if !outcome.active.is_empty() {
        text.line(&format!("at a bound: {}", some(&outcome.active, MOST, ", ")));
    }
    if let (Some(bound), Some(ranges)) = (outcome.noise_bound, &outcome.box_) {
        text.line("");
        let mut table = columns(&["parameter", "least", "largest"]);
        for (parameter, [least, largest]) in model.parameters.iter().zip(ranges) {
            table.row([parameter.name.clone(), number(*least), number(*largest)]);
        }
        text.line(&format!("all parameters with no error above {}:", short(bound)));
        text.table(table);
    }
}

/// Roots, gains and time constants.
fn dynamics(text: &mut Text, model: &PolynomialModel) {
    let head = ["root", "value", "standard error", "time constant [s]", "95 % interval"];
    let mut roots = columns(&head).words(&[4]).none(NO_ROOT_ERROR);
    let mut count = 0;
    let mut add = |role: &str, root: &Root, time: Option<Option<Quantity>>| {
        // What one letter says elsewhere.
        let row =
            [format!("{role} of {}", root.polynomial.to_uppercase()), complex(root), text::spread(root)];
        let value = time.map(|time| or_dash(time, |time| of_unit(time.value, "s")));
        let interval = time.map(|time| or_dash(time.and_then(|time| time.interval), interval));
        roots.row(row.into_iter().chain([value, interval].map(Option::unwrap_or_default)));
        count += 1;
    };
    for (pole, time) in model.poles.iter().zip(&model.time_constants) {
        add("pole", pole, Some(*time));
    }
    // Those of an impulse response say nothing: it ends where its taps do.
    let ends = model.orders.na == 0 && model.orders.nf.iter().all(|&nf| nf == 0);
    model.zeros.iter().flatten().filter(|_| !ends).for_each(|zero| add("zero", zero, None));
    model.noise_poles.iter().for_each(|pole| add("noise pole", pole, None));
    model.noise_zeros.iter().for_each(|zero| add("noise zero", zero, None));
    if count > 0 {
        text.table(roots);
    }
    for (input, gain) in model.inputs.iter().zip(&model.dc_gain) {
        let gain = gain.map_or_else(|| "none (integrator)".to_owned(), quantity);
        text.line(&format!("from {}: DC gain {gain}", harmless(&input.name)));
    }
    text.line(if model.stable { "stable" } else { "unstable" });
}

/// The ends of an interval.
fn interval(interval: Interval) -> String {
    interval.shown(number)
}

/// A figure and its interval, or its standard error where there is none.
fn quantity(quantity: Quantity) -> String {
    if let Some(known) = quantity.interval {
        if known == Interval::OPEN {
            return "not determined by this log".to_owned();
        }
        return format!("{}, 95 % interval {}", number(quantity.value), interval(known));
    }
    let spread = quantity.standard_error.map_or_else(String::new, |spread| format!(" ± {}", error(spread)));
    format!("{}{spread}", number(quantity.value))
}

fn fits(text: &mut Text, fits: &[Fit]) {
    let several = fits.iter().any(|fit| fit.output != fits[0].output);
    let head = ["output", "part", "rows", "horizon", "initial", "samples", "fit [%]", "RMSE"];
    let head = if several { &head[..] } else { &head[1..] };
    let words: &[usize] = if several { &[1, 2, 3, 4] } else { &[1, 2, 3] };
    let mut table = columns(head).words(words).none(NO_FIT);
    for fit in fits {
        let part = fit.part.map_or("", part);
        let output = several.then(|| harmless(&fit.output));
        table.row(output.into_iter().chain([
            part.to_owned(),
            rows(&fit.rows),
            fit.horizon.to_string(),
            start(fit.initial).to_owned(),
            fit.samples.to_string(),
            or_dash(fit.percent, |percent| fixed(percent, 3)),
            or_dash(fit.rmse, number),
        ]));
    }
    text.table(table);
}

/// One line that says how close a response is.
pub fn figure(fit: &Fit) -> String {
    let percent = fit.percent.map_or_else(|| "none".to_owned(), |percent| format!("{} %", fixed(percent, 3)));
    let rmse = fit.rmse.map_or_else(|| "none".to_owned(), number);
    format!(
        "fit {percent}, RMSE {rmse} ({}, initial {}, rows {}, {} samples)",
        fit.horizon,
        start(fit.initial),
        rows(&fit.rows),
        fit.samples
    )
}

fn rows(rows: &[Rows]) -> String {
    some(rows, MOST, ",")
}

/// What the numbers of some models stand for.
fn orders_legend<'a>(models: impl IntoIterator<Item = &'a Orders>) -> String {
    let mut kinds: Vec<&str> = models.into_iter().map(Orders::legend).collect();
    kinds.sort_unstable();
    kinds.dedup();
    format!("orders: {}", kinds.join(", "))
}

fn start(start: InitialCondition) -> &'static str {
    match start {
        InitialCondition::Zero => "zero",
        InitialCondition::Drop => "drop",
        InitialCondition::Estimate => "estimate",
    }
}
