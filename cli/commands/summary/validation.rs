//! Validations and comparisons as tables for people.

use thetahat::figures::{chance, fixed, number, short, three};
use thetahat::text::harmless;
use thetahat::{Comparison, Coverage, Fit, Horizon, Independence, Requirement, Seen, Test, Validation};

use super::text::{Text, columns, or_dash, some};
use super::{MOST, NO_FIT, fits, orders_legend, rows};

/// The level of the intervals of which a comparison says the coverage.
const LEVEL: f64 = 0.95;

/// The figures of the absolute errors.
type ErrorFigure = (&'static str, fn(&Fit) -> Option<f64>);
const ERRORS: [ErrorFigure; 2] =
    [("mean |e|", |fit| fit.mean_absolute_error), ("largest |e|", |fit| fit.largest_error)];

/// How a model does on a log, and what was required of it, so many columns wide.
pub fn validation(found: &Validation, requirements: &[Requirement], alpha: f64, width: usize) -> String {
    let mut text = Text::new(width);
    let files: Vec<String> = found.logs.iter().map(|log| harmless(&log.file)).collect();
    text.line(&format!(
        "{}, {}, on {} rows {}: {}",
        or_dash(found.report.as_deref(), harmless),
        found.orders,
        some(&files, MOST, ", "),
        rows(&found.rows),
        seen(found.seen)
    ));
    text.line(&orders_legend([&found.orders]));
    text.line(stable(found.stable));
    text.line("");
    fits(&mut text, &found.fit);
    errors(&mut text, &found.fit);
    let noise = &found.noise;
    text.line(&format!(
        "errors one step ahead: mean square {}, expected {}, ratio {}",
        or_dash(noise.mse, number),
        number(noise.model),
        or_dash(noise.ratio, three)
    ));
    text.line("");
    coverage(&mut text, &found.coverage);
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

/// Several models, a column for each, so many columns of text wide.
pub fn comparison(comparison: &Comparison, width: usize) -> String {
    let models = &comparison.models;
    let mut text = Text::new(width);
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
    row("orders", &|model| model.orders.to_string());
    row("parameters", &|model| model.orders.parameters().to_string());
    row("stable", &|model| yes(model.stable));
    row("fitted to these rows", &|model| {
        match model.seen {
            Seen::No => "no",
            Seen::Partly => "partly",
            Seen::Yes => "yes",
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
    for horizon in horizons {
        row(&format!("fit [%], {horizon}"), &|model| {
            let fit = model.fit.iter().find(|fit| fit.horizon == horizon);
            or_dash(fit.and_then(|fit| fit.percent), |percent| fixed(percent, 3))
        });
    }
    for (what, of) in ERRORS {
        row(&format!("{what}, 1 step ahead"), &|model| {
            let fit = model.fit.iter().find(|fit| fit.horizon == (Horizon::Steps { steps: 1 }));
            or_dash(fit.and_then(of), number)
        });
    }
    row("mean square error", &|model| or_dash(model.noise.mse, number));
    row("  of that expected", &|model| or_dash(model.noise.ratio, three));
    let p = |p: Option<f64>| or_dash(p, chance);
    row("Ljung-Box p-value", &|model| {
        p(model.residuals.as_ref().and_then(|residuals| residuals.ljung_box.p_value))
    });
    row("Anderson: stops at alpha", &|model| {
        or_dash(model.residuals.as_ref(), |found| stops(found.anderson.stops_at))
    });
    let mut inputs: Vec<&str> = Vec::new();
    for test in models.iter().filter_map(|model| model.residuals.as_ref()).flat_map(|r| &r.independence) {
        if !inputs.contains(&test.input.as_str()) {
            inputs.push(&test.input);
        }
    }
    for input in inputs {
        row(&format!("independence p-value, {}", harmless(input)), &|model| {
            let tests = model.residuals.iter().flat_map(|residuals| &residuals.independence);
            p(tests.filter(|test| test.input == input).find_map(|test| test.past.p_value))
        });
    }
    row("95 % intervals hold [%]", &|model| {
        let one = model.coverage.iter().find(|one| one.steps == 1 && one.level == LEVEL);
        or_dash(one.and_then(|one| one.actual), percent)
    });
    table.legend(orders_legend(models.iter().map(|model| &model.orders)));
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

/// The mean and the largest of the errors.
fn errors(text: &mut Text, fits: &[Fit]) {
    let header: Vec<&str> = std::iter::once("errors").chain(ERRORS.map(|(what, _)| what)).collect();
    let mut table = columns(&header).none(NO_FIT);
    for fit in fits {
        let figures = ERRORS.map(|(_, of)| or_dash(of(fit), number));
        table.row(std::iter::once(fit.horizon.to_string()).chain(figures));
    }
    text.table(table);
}

fn seen(seen: Seen) -> &'static str {
    match seen {
        Seen::No => "fresh, the fit did not see them",
        Seen::Partly => "the model was fitted to some of them",
        Seen::Yes => "the model was fitted to them",
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
fn coverage(text: &mut Text, coverage: &[Coverage]) {
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
    for ahead in coverage.chunk_by(|a, b| a.steps == b.steps) {
        let Some(first) = ahead.first() else { continue };
        let horizon = Horizon::Steps { steps: first.steps }.to_string();
        let each = ahead.iter().map(|one| or_dash(one.actual, percent));
        table.row(std::iter::once(horizon).chain(each));
    }
    text.table(table);
}

/// The tests of what is left.
fn residuals(text: &mut Text, found: &Validation, alpha: f64) {
    let Some(residuals) = &found.residuals else {
        text.line("residuals: not tested");
        text.line("");
        return;
    };
    let fitted = match residuals.fitted {
        0 => "fresh".to_owned(),
        count => format!("{count} parameters fitted to them"),
    };
    let asked = if found.white_expected { "" } else { ", which need not be white" };
    text.line(&format!("residuals: {} samples, {fitted}{asked}", residuals.samples));
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
