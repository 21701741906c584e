//! Validations and comparisons as tables for people.

use crate::estimate::InformationCriterion;
use crate::figures::{chance, fixed, number, short, three};
use crate::model::Orders;
use crate::present::Layout;
use crate::report::{Comparison, Coverage, InSample, Requirement, Validation};
use crate::respond::Horizon;
use crate::text::harmless;
use crate::validate::{Fit, Independence, Residuals, Test};

use super::text::{Text, columns, or_dash, some};
use super::{MOST, NO_FIT, fits, orders_legend, rows};

/// The level of the intervals of which a comparison says the coverage.
const LEVEL: f64 = 0.95;

/// The figures of the absolute errors.
type ErrorFigure = (&'static str, fn(&Fit) -> Option<f64>);
const ERRORS: [ErrorFigure; 2] =
    [("mean |e|", |fit| fit.mean_absolute_error), ("largest |e|", |fit| fit.largest_error)];

/// How a model does on a log, and what was required of it.
pub fn validation(found: &Validation, requirements: &[Requirement], alpha: f64, layout: Layout) -> String {
    let mut text = Text::new(layout);
    let files: Vec<String> = found.logs.iter().map(|log| harmless(&log.file)).collect();
    text.line(&format!(
        "{}, {}, on {} rows {}: {}",
        or_dash(found.report.as_deref(), harmless),
        found.model,
        some(&files, MOST, ", "),
        rows(&found.rows),
        in_sample(found.in_sample)
    ));
    if let Some(orders) = &found.orders {
        text.line(&orders_legend([orders]));
    }
    if let Some(is_stable) = found.stable {
        text.line(stable(is_stable));
    }
    text.line("");
    fits(&mut text, &found.fit);
    errors(&mut text, &found.fit);
    for noise in &found.noise {
        text.line(&format!(
            "errors{} one step ahead: mean square {}, expected {}, ratio {}",
            of(found, &noise.output),
            or_dash(noise.mse, number),
            number(noise.model),
            or_dash(noise.ratio, three)
        ));
    }
    text.line("");
    coverage(&mut text, found);
    residuals(&mut text, found, alpha);
    if !requirements.is_empty() {
        let mut table = columns(&["required", ""]).words(&[1]);
        for requirement in requirements {
            let met = requirement.unmet(found, alpha).is_none();
            table.row([requirement.to_string(), if met { "met" } else { "not met" }.to_owned()]);
        }
        text.table(table);
    }
    text.finish()
}

/// Several models, a column for each, this many columns of text wide.
pub fn comparison(comparison: &Comparison, layout: Layout) -> String {
    let models = &comparison.models;
    let mut text = Text::new(layout);
    if let Some(first) = models.first() {
        let files: Vec<String> = first.logs.iter().map(|log| harmless(&log.file)).collect();
        text.line(&format!("{} rows {}", some(&files, MOST, ", "), rows(&first.rows)));
        text.line("");
    }
    let names = models.iter().map(|model| or_dash(model.report.as_deref(), harmless));
    let header: Vec<String> = std::iter::once(String::new()).chain(names).collect();
    let mut table = columns(&header.iter().map(String::as_str).collect::<Vec<_>>())
        .none("the model or the log does not have it, or too few samples count");
    let mut row = |what: &str, of: &dyn Fn(&Validation) -> String| {
        table.row(std::iter::once(what.to_owned()).chain(models.iter().map(of)));
    };
    row("model", &|model| model.model.clone());
    row("parameters", &|model| model.parameters.to_string());
    row("stable", &|model| or_dash(model.stable, yes));
    row("fitted to these rows", &|model| {
        match model.in_sample {
            InSample::No => "no",
            InSample::Partly => "partly",
            InSample::Yes => "yes",
        }
        .to_owned()
    });
    let mut horizons: Vec<Horizon> = Vec::new();
    for horizon in models.iter().flat_map(|model| model.fit.iter().map(|fit| fit.horizon)) {
        if !horizons.contains(&horizon) {
            horizons.push(horizon);
        }
    }
    // A free run comes last, also where the first model has none.
    horizons.sort_by_key(|horizon| match horizon {
        Horizon::Steps { steps } => *steps,
        Horizon::FreeRun => usize::MAX,
    });
    let mut outputs: Vec<&str> = Vec::new();
    for noise in models.iter().flat_map(|model| &model.noise) {
        if !outputs.contains(&noise.output.as_str()) {
            outputs.push(&noise.output);
        }
    }
    for output in &outputs {
        let of = if outputs.len() > 1 { format!("{}: ", harmless(output)) } else { String::new() };
        let fit = |model: &Validation, horizon: Horizon| {
            let same = |fit: &&Fit| fit.horizon == horizon && fit.output == **output;
            model.fit.iter().find(same).cloned()
        };
        for horizon in &horizons {
            row(&format!("{of}fit [%], {horizon}"), &|model| {
                or_dash(fit(model, *horizon).and_then(|fit| fit.percent), |percent| fixed(percent, 3))
            });
        }
        for (what, figure) in ERRORS {
            row(&format!("{of}{what}, 1 step ahead"), &|model| {
                or_dash(fit(model, Horizon::Steps { steps: 1 }).as_ref().and_then(figure), number)
            });
        }
        let noise = |model: &Validation| model.noise.iter().find(|noise| noise.output == **output).cloned();
        row(&format!("{of}mean square error"), &|model| {
            or_dash(noise(model).and_then(|noise| noise.mse), number)
        });
        row(&format!("{of}  of that expected"), &|model| {
            or_dash(noise(model).and_then(|noise| noise.ratio), three)
        });
        let p = |p: Option<f64>| or_dash(p, chance);
        let residuals = |model: &Validation| {
            model.residuals.iter().find(|residuals| residuals.output == **output).cloned()
        };
        row(&format!("{of}Ljung-Box p-value"), &|model| {
            p(residuals(model).and_then(|residuals| residuals.ljung_box.p_value))
        });
        row(&format!("{of}Anderson: stops at alpha"), &|model| {
            or_dash(residuals(model), |found| stops(found.anderson.stops_at))
        });
        let mut inputs: Vec<&str> = Vec::new();
        for test in models.iter().flat_map(|model| &model.residuals).flat_map(|r| &r.independence) {
            if !inputs.contains(&test.input.as_str()) {
                inputs.push(&test.input);
            }
        }
        for input in inputs {
            row(&format!("{of}independence p-value, {}", harmless(input)), &|model| {
                let tests = residuals(model).into_iter().flat_map(|residuals| residuals.independence);
                p(tests.filter(|test| test.input == input).find_map(|test| test.past.p_value))
            });
        }
        row(&format!("{of}95 % intervals hold [%]"), &|model| {
            let same = |one: &&Coverage| one.steps == 1 && one.level == LEVEL && one.output == **output;
            or_dash(model.coverage.iter().find(same).and_then(|one| one.actual), percent)
        });
    }
    let mut inputs: Vec<&str> = Vec::new();
    for agreement in models.iter().flat_map(|model| &model.response) {
        if !inputs.contains(&agreement.input.as_str()) {
            inputs.push(&agreement.input);
        }
    }
    for input in inputs {
        let own = |model: &Validation| model.response.iter().find(|own| own.input == input).cloned();
        let name = harmless(input);
        row(&format!("outside of the response, {name}"), &|model| {
            or_dash(own(model), |own| format!("{} of {}", own.outside, own.points))
        });
        row(&format!("apart from the response, {name} [%]"), &|model| {
            or_dash(own(model), |own| fixed(100.0 * own.relative_difference, 2))
        });
    }
    if let Some(criteria) = &comparison.criteria {
        for criterion in InformationCriterion::all() {
            let each = criteria.iter().map(|criteria| {
                let value = if criterion.is_logarithmic() { |value| fixed(value, 4) } else { number };
                or_dash(criteria.of(criterion), value)
            });
            table.row(std::iter::once(format!("{} of the fit", criterion.name())).chain(each));
        }
    }
    let orders: Vec<&Orders> = models.iter().filter_map(|model| model.orders.as_ref()).collect();
    if !orders.is_empty() {
        table.legend(orders_legend(orders));
    }
    text.table(table);
    let silent: Vec<String> = models
        .iter()
        .filter(|model| !model.white_expected)
        .map(|model| or_dash(model.report.as_deref(), harmless))
        .collect();
    if !silent.is_empty() {
        text.line(&format!(
            "need not be white (output error, instrumental variables): {}",
            some(&silent, MOST, ", ")
        ));
    }
    text.finish()
}

/// Of which output, where there are several.
fn of(found: &Validation, output: &str) -> String {
    if found.noise.len() > 1 { format!(" of {}", harmless(output)) } else { String::new() }
}

/// The mean and the largest of the errors.
fn errors(text: &mut Text, fits: &[Fit]) {
    let several = fits.iter().any(|fit| fit.output != fits[0].output);
    let header: Vec<&str> = std::iter::once("errors").chain(ERRORS.map(|(what, _)| what)).collect();
    let mut table = columns(&header).none(NO_FIT);
    for fit in fits {
        let figures = ERRORS.map(|(_, of)| or_dash(of(fit), number));
        let of = if several { format!("{}, ", harmless(&fit.output)) } else { String::new() };
        table.row(std::iter::once(format!("{of}{}", fit.horizon)).chain(figures));
    }
    text.table(table);
}

fn in_sample(in_sample: InSample) -> &'static str {
    match in_sample {
        InSample::No => "held out, the fit did not use them",
        InSample::Partly => "the model was fitted to some of them",
        InSample::Yes => "the model was fitted to them",
    }
}

fn stable(stable: bool) -> &'static str {
    if stable { "stable" } else { "unstable" }
}

fn yes(value: bool) -> String {
    if value { "yes" } else { "no" }.to_owned()
}

fn percent(fraction: f64) -> String {
    fixed(100.0 * fraction, 2)
}

fn stops(alpha: Option<f64>) -> String {
    alpha.map_or_else(|| "none up to 0.5".to_owned(), |alpha| fixed(alpha, 3))
}

/// One line for each horizon, the levels side by side.
fn coverage(text: &mut Text, found: &Validation) {
    let coverage = &found.coverage;
    let mut levels: Vec<f64> = Vec::new();
    for one in coverage {
        if !levels.contains(&one.level) {
            levels.push(one.level);
        }
    }
    let header: Vec<String> = std::iter::once("outputs in their intervals [%]".to_owned())
        .chain(levels.iter().map(|level| format!("{} %", short(100.0 * level))))
        .collect();
    let mut table = columns(&header.iter().map(String::as_str).collect::<Vec<_>>())
        .none("no deviation of the prediction is known, or no sample counts");
    for ahead in coverage.chunk_by(|a, b| (a.steps, &a.output) == (b.steps, &b.output)) {
        let Some(first) = ahead.first() else { continue };
        let horizon = format!("{}{}", Horizon::Steps { steps: first.steps }, of(found, &first.output));
        let each = ahead.iter().map(|one| or_dash(one.actual, percent));
        table.row(std::iter::once(horizon).chain(each));
    }
    text.table(table);
}

/// The tests of what is left.
fn residuals(text: &mut Text, found: &Validation, alpha: f64) {
    if found.residuals.is_empty() {
        text.line("residuals: not tested");
        text.line("");
    }
    if let Some(test) = &found.portmanteau {
        let p = or_dash(test.p_value, chance);
        let verdict = if test.p_value.is_some_and(|p| p < alpha) { "not white" } else { "white" };
        text.line(&format!(
            "residuals of all outputs together: {verdict} at {}, {} lags, statistic {}, {} degrees, p-value {p}",
            short(alpha),
            test.lags,
            fixed(test.statistic, 2),
            short(test.degrees)
        ));
        text.line("");
    }
    found.residuals.iter().for_each(|residuals| residuals_of(text, found, residuals, alpha));
}

fn residuals_of(text: &mut Text, found: &Validation, residuals: &Residuals, alpha: f64) {
    let fitted = match residuals.fitted {
        0 if found.in_sample == InSample::No => "held out".to_owned(),
        0 => "tested as if held out".to_owned(),
        count => format!("{count} parameters fitted to them"),
    };
    let asked = if found.white_expected { "" } else { ", which need not be white" };
    let of = of(found, &residuals.output);
    text.line(&format!("residuals{of}: {} samples, {fitted}{asked}", residuals.samples));
    let level = format!("at {}", short(alpha));
    let mut table = columns(&["test", "lags", "statistic", "degrees", "p-value", &level])
        .words(&[5])
        .none("the test has no degree of freedom left");
    let rejected = |test: &Test| test.p_value.is_some_and(|p| p < alpha);
    let mut add = |what: String, test: &Test, verdict: &str| {
        let word = or_dash(test.p_value, |_| verdict.to_owned());
        table.row([
            what,
            test.lags.to_string(),
            fixed(test.statistic, 2),
            short(test.degrees),
            or_dash(test.p_value, chance),
            word,
        ]);
    };
    add(
        "white (Ljung-Box)".to_owned(),
        &residuals.ljung_box,
        ["white", "not white"][usize::from(rejected(&residuals.ljung_box))],
    );
    for Independence { input, past, feedback, suspected, .. } in &residuals.independence {
        let input = harmless(input);
        add(
            format!("independent of past {input}"),
            past,
            ["independent", "dependent"][usize::from(rejected(past))],
        );
        add(format!("no feedback to {input}"), feedback, ["none seen", "suspected"][usize::from(*suspected)]);
    }
    // Of a linear model only where there is something to see.
    let says = |test: &Test| (found.structure.is_none() && found.stable.is_none()) || rejected(test);
    for one in found.nonlinear.iter().filter(|one| one.output == residuals.output) {
        let input = harmless(&one.input);
        for (what, test) in [("errors", &one.errors), ("squared errors", &one.squares)] {
            if says(test) {
                let verdict = ["none seen", "nonlinear"][usize::from(rejected(test))];
                add(format!("no {input}^2 in {what}"), test, verdict);
            }
        }
    }
    text.table(table);
    let anderson = &residuals.anderson;
    let head = ["Anderson: alpha", "outside", "of", "fraction", "p-value (mid)", &level];
    let mut table = columns(&head).words(&[5]);
    for level in &anderson.levels {
        table.row([
            short(level.alpha),
            level.outside.to_string(),
            anderson.lags.to_string(),
            three(level.outside as f64 / anderson.lags as f64),
            chance(level.p_value),
            if level.white { "white" } else { "not white" }.to_owned(),
        ]);
    }
    text.table(table);
    text.line(&match anderson.stops_at {
        Some(alpha) => format!("the fraction outside is below alpha up to alpha {}", fixed(alpha, 3)),
        None => "the fraction outside is below alpha up to alpha 0.5 and beyond".to_owned(),
    });
    text.line("");
}
