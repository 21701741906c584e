//! The tables.

mod inspection;
mod validation;

pub(super) use inspection::{channels, clock, delays, excitation};
use validation::asked;
pub(super) use validation::{anderson, coverage, noise, tests, which};

use super::page::Table;
use super::text::{or_dash, quantity, rows, time_constant};
use crate::data::{Rows, Source};
use crate::estimate::{
    Criteria, InformationCriterion, Procedure, RefinementOutcome, TermsOutcome, VectorArxOutcome,
};
use crate::figures::{chance, fixed, number, scientific, seconds, short, three, unit_of};
use crate::model::{
    ContinuousStateSpaceModel, EquationsModel, NonlinearArxModel, Orders, Parameter, PolynomialModel,
    ProcessModel, Quantity, Root, Signal, StateSpaceModel,
};
use crate::present::words::{complex, part, stopped};
use crate::report::{Estimation, InSample, Report, Validated};
use crate::respond::InitialCondition;
use crate::select::{Candidate, Selection};
use crate::validate::Fit;

/// The models of a search that are listed.
const BEST: usize = 20;

pub(super) fn parameters(model: &PolynomialModel) -> Table {
    let mut table = Table::new("Parameters", &["parameter", "value", "standard error"]);
    for parameter in &model.parameters {
        table.row([
            parameter.name.clone(),
            number(parameter.value),
            or_dash(parameter.standard_error, three),
        ]);
    }
    table
}

/// The same of a nonlinear ARX model.
pub(super) fn functions(parameters: &[Parameter]) -> Table {
    let mut table = Table::new("Parameters", &["function", "parameter", "standard error"]);
    for parameter in parameters {
        let error = or_dash(parameter.standard_error, three);
        table.row([parameter.name.clone(), number(parameter.value), error]);
    }
    table
}

/// What a nonlinear ARX model reads.
pub(super) fn regressors(model: &NonlinearArxModel) -> Table {
    let mut table = Table::new("Regressors", &["regressor", "divided by", "least", "largest"]);
    for regressor in &model.regressors {
        let [low, high] = regressor.range;
        table.row([regressor.name(), number(regressor.scale), number(low), number(high)]);
    }
    table
}

/// The path of a choice of functions.
pub(super) fn path(outcome: &TermsOutcome) -> Table {
    let head = [
        "",
        "function",
        "parameters",
        "error reduction ratio",
        "RMSE, 1 step ahead",
        "free run",
        "free run, held out",
        "cannot be told from it",
    ];
    let mut table = Table::new("Path of the choice", &head);
    for (at, step) in outcome.path.iter().enumerate() {
        table.row([
            format!("{}{}", at + 1, if at + 1 == outcome.taken { " taken" } else { "" }),
            step.term.clone(),
            step.parameters.to_string(),
            scientific(step.error_reduction, 3),
            number(step.rmse),
            or_dash(step.free_run.and_then(|run| run.rmse), number),
            or_dash(step.held_out.and_then(|run| run.rmse), number),
            step.aliases.join(", "),
        ]);
    }
    table
}

pub(super) fn fits(fits: &[Fit]) -> Table {
    let parts = fits.iter().any(|fit| fit.part.is_some());
    let outputs = fits.iter().any(|fit| fit.output != fits[0].output);
    let first = outputs.then_some("output").into_iter().chain(parts.then_some("part"));
    let figures = ["horizon", "start", "fit [%]", "RMSE", "mean |e|", "largest |e|", "samples", "rows"];
    let head: Vec<&str> = first.chain(figures).collect();
    let mut table = Table::new("Fit", &head);
    for fit in fits {
        let mut cells = Vec::new();
        cells.extend(outputs.then(|| fit.output.clone()));
        cells.extend(parts.then(|| or_dash(fit.part, |own| part(own).to_owned())));
        cells.extend([
            fit.horizon.to_string(),
            start(fit.initial).to_owned(),
            or_dash(fit.percent, |percent| fixed(percent, 3)),
            or_dash(fit.rmse, number),
            or_dash(fit.mean_absolute_error, number),
            or_dash(fit.largest_error, number),
            fit.samples.to_string(),
            rows(&fit.rows),
        ]);
        table.row(cells);
    }
    table
}

/// Poles and zeros with their uncertainty.
pub(super) fn roots(model: &PolynomialModel) -> Table {
    let mut table = Table::new("Roots", &["root", "value", "standard error", "modulus", "time constant [s]"]);
    let mut add = |role: &str, root: &Root, time: Option<String>| {
        table.row([
            format!("{role} of {}", root.polynomial.to_uppercase()),
            complex(root),
            spread(root),
            number(root.re.hypot(root.im)),
            time.unwrap_or_default(),
        ]);
    };
    let times = model.time_constants.iter().copied().chain(std::iter::repeat(None));
    for (pole, time) in model.poles.iter().zip(times) {
        add("pole", pole, Some(or_dash(time, time_constant)));
    }
    model.zeros.iter().flatten().for_each(|zero| add("zero", zero, None));
    model.noise_poles.iter().for_each(|pole| add("noise pole", pole, None));
    model.noise_zeros.iter().for_each(|zero| add("noise zero", zero, None));
    table
}

/// The standard error of a root, that of each of its parts.
fn spread(root: &Root) -> String {
    or_dash(root.covariance, |[[re, _], [_, im]]| {
        let re_error = three(re.sqrt());
        if root.im == 0.0 { re_error } else { format!("{re_error}, {}i", three(im.sqrt())) }
    })
}

/// The channels with their offsets and static gains.
pub(super) fn signals(model: &PolynomialModel) -> Table {
    let mut table =
        Table::new("Signals", &["channel", "role", "offset", "trend [1/s]", "static gain to the output"]);
    let gains =
        model.dc_gain.iter().map(|gain| gain.map_or_else(|| "none (integrator)".to_owned(), quantity));
    let inputs = model.inputs.iter().zip(gains.chain(std::iter::repeat_with(String::new)));
    for (role, signal, gain) in
        inputs.map(|(signal, gain)| ("input", signal, gain)).chain([("output", &model.output, String::new())])
    {
        let offset = signal.offset;
        table.row([signal.name.clone(), role.to_owned(), number(offset.level), short(offset.slope), gain]);
    }
    table
}

/// The poles of a state-space model, and those of its predictor.
pub(super) fn eigenvalues(model: &StateSpaceModel) -> Table {
    let mut table = Table::new("Poles", &["root", "value", "standard error", "modulus", "time constant [s]"]);
    let mut add = |role: &str, pole: &Root, time: String| {
        let modulus = number(pole.re.hypot(pole.im));
        table.row([role.to_owned(), complex(pole), spread(pole), modulus, time]);
    };
    for (pole, time) in model.poles.iter().zip(&model.time_constants) {
        add("pole", pole, or_dash(*time, time_constant));
    }
    model.predictor_poles.iter().for_each(|pole| add("pole of the predictor", pole, String::new()));
    table
}

/// The poles of a model in continuous time.
pub(super) fn continuous_poles(model: &ContinuousStateSpaceModel) -> Table {
    let head = ["pole [rad/s]", "natural frequency [rad/s]", "damping", "time constant [s]"];
    let mut table = Table::new("Poles", &head);
    let figures = model.natural_frequencies.iter().zip(&model.damping).zip(&model.time_constants);
    for (pole, ((frequency, damping), time)) in model.poles.iter().zip(figures) {
        let damping = or_dash(*damping, number);
        table.row([complex(pole), number(*frequency), damping, or_dash(*time, time_constant)]);
    }
    table
}

/// The channels of a state-space model with their offsets, and the static gain from each input to each output.
pub(super) fn signals_and_gains(model: &StateSpaceModel) -> Table {
    let to = model.outputs.iter().map(|output| format!("static gain to {}", output.name));
    let head: Vec<String> = ["channel", "role", "offset", "trend [1/s]", "delay"]
        .map(str::to_owned)
        .into_iter()
        .chain(to)
        .collect();
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let mut table = Table::new("Signals", &head);
    let row = |signal: &Signal, role: &str, delay: String, gains: Vec<String>| {
        let own =
            [signal.name.clone(), role.to_owned(), number(signal.offset.level), short(signal.offset.slope)];
        own.into_iter().chain([delay]).chain(gains).collect::<Vec<String>>()
    };
    for (place, (input, delay)) in model.inputs.iter().zip(&model.delays).enumerate() {
        let gain = |gains: &Vec<Option<Quantity>>| {
            gains.get(place).copied().flatten().map_or_else(|| "none (integrator)".to_owned(), quantity)
        };
        table.row(row(input, "input", delay.to_string(), model.dc_gain.iter().map(gain).collect()));
    }
    for output in &model.outputs {
        table.row(row(output, "output", String::new(), vec![String::new(); model.outputs.len()]));
    }
    table
}

/// The deviations of the innovations, and how they are correlated.
pub(super) fn noise_of_outputs(model: &StateSpaceModel) -> Table {
    let with = model.outputs.iter().map(|output| format!("correlation with {}", output.name));
    let head: Vec<String> =
        ["innovations of", "deviation"].map(str::to_owned).into_iter().chain(with).collect();
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let mut table = Table::new("Noise", &head);
    let noise = &model.noise_covariance;
    for (i, output) in model.outputs.iter().enumerate() {
        let correlation = |j: usize| {
            let product = noise[i][i] * noise[j][j];
            if product > 0.0 { fixed(noise[i][j] / product.sqrt(), 3) } else { "–".to_owned() }
        };
        let each = (0..model.outputs.len()).map(correlation);
        table.row([output.name.clone(), number(noise[i][i].max(0.0).sqrt())].into_iter().chain(each));
    }
    table
}

/// The parameters of a process, and how certain they would be if its errors were white.
pub(super) fn process_parameters(report: &Report, model: &ProcessModel) -> Table {
    let head = ["parameter", "value", "unit", "standard error", "if errors were white"];
    let mut table = Table::new("Parameters", &head);
    let Some(outcome) = report.estimation.procedure.process() else { return table };
    let units = model.structures.iter().zip(model.of_inputs());
    let units =
        units.flat_map(|(structure, own)| own.iter().map(|parameter| structure.unit(&parameter.name)));
    for ((parameter, white), unit) in model.parameters.iter().zip(&outcome.white_standard_errors).zip(units) {
        table.row([
            parameter.name.clone(),
            number(parameter.value),
            unit_of(parameter.value, unit),
            or_dash(parameter.standard_error, three),
            or_dash(*white, three),
        ]);
    }
    table
}

/// The parameters of a model in equations, and what was known of them before.
pub(super) fn unknown_parameters(report: &Report, model: &EquationsModel) -> Table {
    let head = ["parameter", "value", "standard error", "start", "min", "max", "change of variable"];
    let mut table = Table::new("Parameters", &head);
    let unknown = report.estimation.procedure.equations().map_or(&[][..], |outcome| &outcome.unknown);
    for (parameter, known) in model.parameters.iter().zip(unknown) {
        table.row([
            parameter.name.clone(),
            number(parameter.value),
            or_dash(parameter.standard_error, three),
            short(known.start),
            or_dash(known.min, short),
            or_dash(known.max, short),
            or_dash(known.change_of_variable.clone(), |words| words),
        ]);
    }
    table
}

/// Where the states of a model in equations start in its free runs on the estimation rows.
pub(super) fn starts(report: &Report, model: &EquationsModel) -> Table {
    let mut table = Table::new("States", &["state", "start of each free run on the estimation rows"]);
    let starts = report.estimation.procedure.equations().map_or(&[][..], |outcome| &outcome.starts);
    for (state, starts) in model.states.iter().zip(starts) {
        let starts: Vec<String> = starts.iter().map(|start| or_dash(*start, number)).collect();
        table.row([state.clone(), starts.join(", ")]);
    }
    table
}

pub(super) fn estimation(estimation: &Estimation, noise_variance: Option<f64>) -> Table {
    let mut table = Table::new("Estimation", &["figure", "value"]);
    let mut add = |name: &str, value: String| table.row([name.to_owned(), value]);
    add("procedure", procedure(&estimation.procedure));
    add("samples", estimation.samples.to_string());
    add("mean of e²", number(estimation.mse));
    if let Some(variance) = noise_variance {
        add("noise variance", number(variance));
    }
    if let Some(outcome) = estimation.procedure.equations() {
        let nis = outcome.nis.as_ref();
        add("ln L", number(outcome.log_likelihood));
        add(
            "mean nis",
            or_dash(nis, |nis| format!("{} (expected {})", three(nis.mean), three(nis.expected))),
        );
        add("covariance multiplied by", three(outcome.covariance_factor));
    }
    add("condition number", or_dash(estimation.condition, |condition| scientific(condition, 3)));
    let four = |value: f64| fixed(value, 4);
    let criteria = &estimation.criteria;
    for criterion in InformationCriterion::all() {
        let each = if criterion.is_logarithmic() { ", for each sample" } else { "" };
        let value = if criterion.is_logarithmic() { four } else { number };
        add(&format!("{}{each}", criterion.name()), or_dash(criteria.of(criterion), value));
    }
    table
}

fn procedure(procedure: &Procedure) -> String {
    match procedure {
        Procedure::LeastSquares { .. } => "least squares".to_owned(),
        Procedure::InstrumentalVariables { .. } => "instrumental variables".to_owned(),
        Procedure::RefinedInstrumentalVariables { iterations, stopped: why, .. } => {
            format!("refined instrumental variables, iterations: {iterations}, {}", stopped(*why))
        }
        Procedure::PredictionError(search) => {
            format!("prediction error, iterations: {}, {}", search.iterations, stopped(search.stopped))
        }
        Procedure::Robust(outcome) => {
            let loss = outcome
                .k
                .map_or_else(|| "absolute errors".to_owned(), |k| format!("Huber's loss, k = {}", short(k)));
            let search = &outcome.search;
            format!("{loss}, iterations: {}, {}", search.iterations, stopped(search.stopped))
        }
        Procedure::ExactLikelihood(outcome) => {
            let search = &outcome.search;
            format!(
                "exact likelihood, ln L = {}, iterations: {}, {}",
                or_dash(outcome.log_likelihood, |value| fixed(value, 4)),
                search.iterations,
                stopped(search.stopped)
            )
        }
        Procedure::Constrained(outcome) => {
            let norm = outcome.norm;
            outcome.search.as_ref().map_or_else(
                || format!("convex optimization, norm {norm}"),
                |search| {
                    let iterations = search.costs.len().saturating_sub(1);
                    format!(
                        "linear programs, norm {norm}, iterations: {iterations}, {}",
                        stopped(search.stopped)
                    )
                },
            )
        }
        Procedure::Regularised(outcome) => format!(
            "regularised by the {} kernel of the largest likelihood, {} of its parameters free",
            outcome.kernel.name(),
            fixed(outcome.effective_parameters, 1)
        ),
        Procedure::InnovationsLikelihood(outcome) => format!(
            "largest likelihood of the innovations, iterations: {}, {}",
            outcome.search.iterations,
            stopped(outcome.search.stopped)
        ),
        Procedure::ForwardRegression(outcome) => each(&outcome.maps, |map| {
            let (candidates, by) = (map.candidates, &map.selected_by);
            format!("forward regression among {candidates} functions, their number by {by}")
        }),
        Procedure::Splits(outcome) => each(&outcome.maps, |map| {
            let (looked_at, by) = (map.path.len(), &map.selected_by);
            format!("local models by splits, {looked_at} looked at, their number by {by}")
        }),
        Procedure::FrequencyResponse(outcome) => format!(
            "least errors of the frequency response, iterations: {}, {}",
            outcome.iterations,
            stopped(outcome.stopped)
        ),
        Procedure::FreeRun(outcome) => format!(
            "least errors of the free run, iterations: {}, {}; errors of the colour of an autoregression of order {}",
            outcome.iterations,
            stopped(outcome.stopped),
            outcome.noise_order
        ),
        Procedure::Subspace(outcome) => format!(
            "subspace ({}) from a past of {} samples, {}{}",
            outcome.weighting.to_string().to_uppercase(),
            outcome.past,
            if outcome.feedthrough { "inputs act at once" } else { "no feedthrough" },
            outcome.refinement.as_ref().map_or_else(
                String::new,
                |RefinementOutcome { errors, search }| format!(
                    "; refined for the least errors of {}, iterations: {}, {}",
                    errors.of(),
                    search.iterations,
                    stopped(search.stopped)
                )
            )
        ),
        Procedure::VectorArx(outcome) => format!(
            "least squares of all outputs, ARX with na {}, nb {}, nk {}, coupling {}",
            outcome.na,
            list(&outcome.nb),
            list(&outcome.nk),
            outcome.coupling
        ),
        Procedure::Neighbours(outcome) => each(&outcome.maps, |map| {
            let (kept, by) = (map.candidates, &map.selected_by);
            format!("{kept} samples kept, the number of neighbours by {by}")
        }),
        Procedure::Training(outcome) => each(&outcome.maps, |map| {
            let (tried, by) = (map.candidates, &map.selected_by);
            let how = map.training.as_ref().map_or_else(String::new, |training| {
                let starts = training.starts.len();
                format!(
                    "; errors of the {} the least of {starts} starts, {}",
                    training.horizon,
                    stopped(training.stopped)
                )
            });
            format!("trained: {tried} tried, the one taken by {by}{how}")
        }),
    }
}

fn list(numbers: &[usize]) -> String {
    numbers.iter().map(ToString::to_string).collect::<Vec<String>>().join(", ")
}

/// The coefficients of an ARX model with several outputs: a row for each equation and regressor.
pub(super) fn matrix_coefficients(outcome: &VectorArxOutcome, model: &StateSpaceModel) -> Table {
    let mut table = Table::new("Coefficients", &["equation of", "coefficient", "value", "standard error"]);
    for (place, output) in model.outputs.iter().enumerate() {
        // A report that was edited may have other numbers of them.
        let mut add = |of: String, value: Option<&Quantity>| {
            if let Some(Quantity { value, standard_error: Some(error), .. }) = value {
                table.row([output.name.clone(), of, number(*value), three(*error)]);
            }
        };
        for (lag, rows) in (1_usize..).zip(&outcome.a) {
            for (column, other) in model.outputs.iter().enumerate() {
                add(format!("A{lag}, {}", other.name), rows.get(place).and_then(|row| row.get(column)));
            }
        }
        for ((input, coefficients), first) in model.inputs.iter().zip(&outcome.b).zip(&outcome.nk) {
            for (later, values) in coefficients.iter().enumerate() {
                add(format!("B{}, {}", first.saturating_add(later), input.name), values.get(place));
            }
        }
    }
    table
}

/// What is said of the map of each output.
fn each(maps: &[TermsOutcome], of: impl Fn(&TermsOutcome) -> String) -> String {
    maps.iter().map(of).collect::<Vec<String>>().join("; ")
}

pub(super) fn logs(sources: &[Source]) -> Table {
    let mut table = Table::new("Logs", &["file", "rows", "time column", "start", "resampled"]);
    for source in sources {
        let resampled = source.resampled.as_ref().map(|resampling| {
            let filter = resampling.anti_alias.map_or_else(String::new, |filter| {
                format!(", low-pass filtered at {} Hz", short(filter.cutoff))
            });
            format!("to {} s, from {} rows{filter}", short(resampling.step), resampling.rows)
        });
        table.row([
            source.file.clone(),
            source.rows.to_string(),
            or_dash(source.time.as_ref(), Clone::clone),
            or_dash(source.start.as_ref(), Clone::clone),
            resampled.unwrap_or_else(|| "no".to_owned()),
        ]);
    }
    table
}

pub(super) fn data(report: &Report) -> Table {
    let data = &report.data;
    let mut table = Table::new("Data", &["figure", "value"]);
    let mut add = |name: &str, value: String| table.row([name.to_owned(), value]);
    let parts = |parts: &[Rows]| if parts.is_empty() { "none".to_owned() } else { rows(parts) };
    add("rows", data.rows.to_string());
    add("sample time", seconds(data.sample_time));
    add("detrend", data.detrend.clone());
    if let Some(band) = data.prefilter {
        add("fitted in the band", format!("{band} Hz"));
    }
    if let Some(level) = report.estimation.level {
        add("level of the output", quantity(level));
    }
    if let Some(slope) = report.estimation.slope {
        add("slope of the output, a second", quantity(slope));
    }
    add("estimation rows", parts(&data.estimation));
    add("validation rows", parts(&data.validation));
    if let Some(split) = &data.split {
        add("split: estimation", parts(&split.estimation));
        add("split: validation", parts(&split.validation));
        add("split: test", parts(&split.test));
    }
    add("segments without a gap", rows(&data.segments));
    add("gaps in the clock", data.time_gaps.to_string());
    for missing in &data.missing {
        add(&format!("missing in {}", missing.channel), missing.rows.to_string());
    }
    table
}

/// The best models of a search.
pub(super) fn best(selection: &Selection) -> Table {
    let score = super::charts::score(selection.select);
    let held_out = selection.best.iter().any(|model| model.held_out_mse.is_some());
    let mut head = vec!["model", "parameters", score, "mean of e²"];
    if held_out {
        head.push("mean of e², held out");
    }
    let best = &selection.best[..selection.best.len().min(BEST)];
    let caption = format!(
        "The best models of the search, on the {} samples that all share ({})",
        selection.samples,
        legend(best.iter().map(|model| &model.orders))
    );
    let mut table = Table::new(caption, &head);
    let row = |model: &Candidate| {
        let mut cells = vec![
            model.orders.to_string(),
            model.parameters.to_string(),
            or_dash(model.score, number),
            number(model.mse),
        ];
        if held_out {
            cells.push(or_dash(model.held_out_mse, number));
        }
        cells
    };
    best.iter().for_each(|model| table.row(row(model)));
    table
}

/// What the numbers of some models stand for.
fn legend<'a>(models: impl Iterator<Item = &'a Orders>) -> String {
    let mut kinds: Vec<&str> = models.map(Orders::legend).collect();
    kinds.sort_unstable();
    kinds.dedup();
    kinds.join(", ")
}

/// Several models side by side.
pub(super) fn comparison(models: &[(String, &Validated)], criteria: Option<&[Criteria]>) -> Table {
    let mut head: Vec<String> =
        ["file", "model", "parameters", "stable", "in-sample"].map(str::to_owned).to_vec();
    let mut horizons: Vec<String> = Vec::new();
    let several = models.iter().any(|(_, validated)| validated.validation.noise.len() > 1);
    let said = |fit: &Fit| {
        let of = if several { format!("of {}, ", fit.output) } else { String::new() };
        format!("fit {of}{} [%]", fit.horizon)
    };
    for fit in models.iter().flat_map(|(_, validated)| &validated.validation.fit) {
        if !horizons.contains(&said(fit)) {
            horizons.push(said(fit));
        }
    }
    head.extend(horizons.iter().cloned());
    let tests = [
        "errors / noise",
        "white, p-value",
        "past inputs, p-value",
        "feedback, p-value",
        "too many outside from alpha on",
    ];
    head.extend(tests.map(str::to_owned));
    let over = models.iter().any(|(_, validated)| !validated.validation.response.is_empty());
    head.extend(over.then(|| "points outside of the response".to_owned()));
    if criteria.is_some() {
        head.extend(InformationCriterion::all().map(|criterion| format!("{} of the fit", criterion.name())));
    }
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let orders = models.iter().filter_map(|(_, validated)| validated.validation.orders.as_ref());
    let legend = legend(orders);
    let legend = if legend.is_empty() { legend } else { format!(" ({legend})") };
    let mut table = Table::new(format!("Figures{legend}"), &head);
    for (index, (name, Validated { validation, .. })) in models.iter().enumerate() {
        let mut cells = vec![
            name.clone(),
            validation.model.clone(),
            validation.parameters.to_string(),
            or_dash(validation.stable, yes),
            in_sample(validation.in_sample).to_owned(),
        ];
        cells.extend(horizons.iter().map(|horizon| {
            let fit = validation.fit.iter().find(|fit| said(fit) == *horizon);
            or_dash(fit.and_then(|fit| fit.percent), |percent| fixed(percent, 3))
        }));
        // Of several outputs the one that is farthest from what is asked.
        let farthest = |ratio: &f64| ratio.ln().abs();
        let ratios = validation.noise.iter().filter_map(|noise| noise.ratio);
        let ratio = ratios.max_by(|one, other| farthest(one).total_cmp(&farthest(other)));
        cells.push(or_dash(ratio, three));
        let each = || validation.residuals.iter();
        let least = |of: fn(&crate::validate::Independence) -> Option<f64>| {
            each().flat_map(|residuals| &residuals.independence).filter_map(of).reduce(f64::min)
        };
        let asked = asked(validation);
        let white = each().filter_map(|residuals| residuals.ljung_box.p_value).reduce(f64::min);
        cells.push(or_dash(white, |p| format!("{}{asked}", chance(p))));
        cells.push(or_dash(least(|independence| independence.past.p_value), chance));
        cells.push(or_dash(least(|independence| independence.feedback.p_value), chance));
        let stops = each().map(|residuals| residuals.anderson.stops_at.unwrap_or(f64::INFINITY));
        cells.push(or_dash(stops.reduce(f64::min), |stops| {
            let stops = if stops.is_finite() { short(stops) } else { "none up to 0.5".to_owned() };
            format!("{stops}{asked}")
        }));
        cells.extend(over.then(|| {
            let each = validation.response.iter();
            let each = each.map(|own| format!("{}: {} of {}", own.input, own.outside, own.points));
            or_dash(each.reduce(|all, one| format!("{all}, {one}")), |text| text)
        }));
        if let Some(own) = criteria.and_then(|criteria| criteria.get(index)) {
            cells.extend(InformationCriterion::all().map(|criterion| {
                let value = if criterion.is_logarithmic() { |value| fixed(value, 4) } else { number };
                or_dash(own.of(criterion), value)
            }));
        }
        table.row(cells);
    }
    table.turned()
}

fn start(start: InitialCondition) -> &'static str {
    match start {
        InitialCondition::Zero => "from zero",
        InitialCondition::Drop => "from measured",
        InitialCondition::Estimate => "start estimated",
    }
}

pub(super) fn in_sample(in_sample: InSample) -> &'static str {
    match in_sample {
        InSample::No => "no",
        InSample::Partly => "partly",
        InSample::Yes => "yes",
    }
}

fn yes(answer: bool) -> String {
    if answer { "yes" } else { "no" }.to_owned()
}
