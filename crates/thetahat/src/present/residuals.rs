//! What models leave of logs.

use crate::figures::{chance, fixed, number, short, three};
use crate::report::{InSample, Validated, Validation};
use crate::respond::Horizon;
use crate::text::harmless;
use crate::validate::{Independence, Residuals, Test};

use super::charts;
use super::tree::{Sections, Table, columns, figure, known, word};
use super::words::or_dash;

/// What is said of models whose residuals need not be white.
const UNASKED: &str = "Not asked: models of output error and those by instrumental variables say nothing of the noise, so their \
                       residuals are not asked to be white.";

/// Several validations with the names of their rows or models.
pub(super) type Named<'a> = [(String, &'a Validation)];

/// Of which output, where there are several.
pub(super) fn of(found: &Validation, output: &str) -> String {
    if found.noise.len() > 1 { format!(" of {}", harmless(output)) } else { String::new() }
}

/// What a model leaves of some rows, in a text.
pub(super) fn residuals(on: &mut Sections, found: &Validation, alpha: f64) {
    if found.residuals.is_empty() {
        on.line("residuals: not tested");
        on.gap();
    }
    if together(on, "", found, Some(alpha)) {
        on.gap();
    }
    for residuals in &found.residuals {
        let fitted = match residuals.fitted {
            0 if found.in_sample == InSample::No => "held out".to_owned(),
            0 => "tested as if held out".to_owned(),
            count => format!("{count} parameters fitted to them"),
        };
        let asked = if found.white_expected { "" } else { ", which need not be white" };
        let of = of(found, &residuals.output);
        on.line(format!("residuals{of}: {} samples, {fitted}{asked}", residuals.samples));
        let one = || std::iter::once((String::new(), found, residuals));
        on.table(tests("", Some(alpha), one()));
        on.table(anderson("", Some(alpha), one()));
        on.line(stops(residuals));
        on.gap();
    }
}

/// What models leave of several parts, on a page; a chart for each of them.
pub(super) fn residuals_of_parts(on: &mut Sections, parts: &[(String, &Validated)]) {
    on.section("Residuals");
    let several = parts.len() > 1;
    for (name, Validated { validation, .. }) in parts {
        if validation.residuals.is_empty() {
            on.line(format!("There are no residuals to test ({name}): too few samples count."));
        }
        for residuals in &validation.residuals {
            let of = of(validation, &residuals.output);
            let rows = if several { format!(", {name} rows") } else { String::new() };
            let titled = |drawn: charts::Drawn| {
                drawn.map(|mut chart| {
                    chart.title.push_str(&format!("{of}{rows}"));
                    chart
                })
            };
            on.chart(|| titled(charts::autocorrelation(residuals, validation.white_expected)));
            for independence in &residuals.independence {
                on.chart(|| titled(charts::cross_correlation(independence)));
            }
        }
    }
    let all: Vec<(String, &Validation)> =
        parts.iter().map(|(name, validated)| (name.clone(), &validated.validation)).collect();
    figures(on, "rows", &all);
}

/// The tests of what is left of several parts, or by several models: `who` says which.
pub(super) fn figures(on: &mut Sections, who: &str, all: &Named<'_>) {
    if all.iter().any(|(_, validation)| !validation.white_expected) {
        on.line(UNASKED);
    }
    all.iter().for_each(|(name, validation)| {
        together(on, &format!("{name}: "), validation, None);
    });
    on.table(tests(who, None, residuals_in(all)));
    let levels = anderson(who, None, residuals_in(all));
    if !levels.rows.is_empty() {
        on.line(
            "Of white residuals about a fraction alpha of the correlations lies outside the band of that level. The p-value says \
             how likely more than that many are, with half of how likely just as many are (mid-p-value of the binomial \
             distribution); residuals are called white where it is not below the level of the validation.",
        );
    }
    residuals_in(all).for_each(|(name, _, residuals)| on.line(format!("{name}: {}", stops(residuals))));
    on.table(levels);
    all.iter().for_each(|(name, validation)| noise(on, &format!("{name}: "), validation));
    on.table(coverage(who, all));
}

/// What each leaves of each output, with names.
pub(super) fn residuals_in<'a>(
    all: &'a Named<'a>,
) -> impl Iterator<Item = (String, &'a Validation, &'a Residuals)> {
    all.iter().flat_map(|(name, validation)| {
        validation.residuals.iter().map(move |residuals| {
            (format!("{name}{}", of(validation, &residuals.output)), *validation, residuals)
        })
    })
}

/// The test of all outputs together, where there are several.
fn together(on: &mut Sections, who: &str, found: &Validation, alpha: Option<f64>) -> bool {
    if let Some(test) = &found.portmanteau {
        let verdict = alpha.map_or_else(String::new, |alpha| {
            let white = if test.p_value.is_some_and(|p| p < alpha) { "not white" } else { "white" };
            format!("{white} at {}, ", short(alpha))
        });
        on.line(format!(
            "{who}residuals of all outputs together: {verdict}{} lags, statistic {}, {} degrees, p-value {}",
            test.lags,
            fixed(test.statistic, 2),
            short(test.degrees),
            or_dash(test.p_value, chance)
        ));
    }
    found.portmanteau.is_some()
}

/// The tests of residuals; with a level what they say at that, else all of them.
fn tests<'a>(
    who: &str,
    alpha: Option<f64>,
    all: impl Iterator<Item = (String, &'a Validation, &'a Residuals)>,
) -> Table {
    let head = ["test", who, "lags", "statistic", "degrees", "p-value", &level(alpha)];
    let mut table = columns("Tests of the residuals", head)
        .words(&[1, 6])
        .none("the test has no degree of freedom left")
        .on_pages(&[1])
        .in_text(&[6]);
    let rejected = |test: &Test| test.p_value.zip(alpha).is_some_and(|(p, alpha)| p < alpha);
    for (name, found, residuals) in all {
        let mut add = |what: String, test: &Test, verdicts: [&str; 2], is_rejected: bool| {
            table.row([
                word(what),
                word(&name),
                word(test.lags),
                figure(test.statistic, |value| fixed(value, 2)),
                figure(test.degrees, short),
                figure(test.p_value, chance),
                known(test.p_value, |_| verdicts[usize::from(is_rejected)].to_owned()),
            ]);
        };
        let white = &residuals.ljung_box;
        add("white (Ljung-Box)".to_owned(), white, ["white", "not white"], rejected(white));
        for Independence { input, past, feedback, suspected, .. } in &residuals.independence {
            add(format!("independent of past {input}"), past, ["independent", "dependent"], rejected(past));
            add(format!("no feedback to {input}"), feedback, ["none seen", "suspected"], *suspected);
        }
        // Of a linear model a text has them only where there is something to see.
        let is_linear = found.structure.is_some() || found.stable.is_some();
        for one in found.nonlinear.iter().filter(|one| one.output == residuals.output) {
            for (what, test) in [("errors", &one.errors), ("squared errors", &one.squares)] {
                if alpha.is_none() || !is_linear || rejected(test) {
                    let what = format!("no {}^2 in {what}", one.input);
                    add(what, test, ["none seen", "nonlinear"], rejected(test));
                }
            }
        }
    }
    table
}

/// Anderson's test for each level.
fn anderson<'a>(
    who: &str,
    alpha: Option<f64>,
    all: impl Iterator<Item = (String, &'a Validation, &'a Residuals)>,
) -> Table {
    let head = ["Anderson: alpha", who, "band", "outside", "of", "fraction", "p-value (mid)", &level(alpha)];
    let mut table = columns("Correlations outside of their band (Anderson)", head);
    table = table.words(&[1, 7]).on_pages(&[1, 2]);
    for (name, _, Residuals { anderson, .. }) in all {
        for level in &anderson.levels {
            table.row([
                word(short(level.alpha)),
                word(&name),
                word(format!("± {}", three(level.band))),
                word(level.outside),
                word(anderson.lags),
                figure(level.outside as f64 / anderson.lags as f64, three),
                figure(level.p_value, chance),
                word(if level.white { "white" } else { "not white" }),
            ]);
        }
    }
    table
}

fn level(alpha: Option<f64>) -> String {
    alpha.map_or_else(|| "verdict".to_owned(), |alpha| format!("at {}", short(alpha)))
}

fn stops(residuals: &Residuals) -> String {
    match residuals.anderson.stops_at {
        Some(alpha) => format!("white at levels up to {}", fixed(alpha, 3)),
        None => "white at levels up to 0.5 and beyond".to_owned(),
    }
}

/// The level of the errors beside that of the model.
pub(super) fn noise(on: &mut Sections, who: &str, found: &Validation) {
    for noise in &found.noise {
        on.line(format!(
            "{who}errors{} one step ahead: mean square {}, expected {}, ratio {}",
            of(found, &noise.output),
            or_dash(noise.mse, number),
            number(noise.model),
            or_dash(noise.ratio, three)
        ));
    }
}

/// How often the output lies in its prediction intervals: one line for each horizon, the levels side by side.
pub(super) fn coverage(who: &str, all: &Named<'_>) -> Table {
    let mut levels: Vec<f64> = Vec::new();
    for one in all.iter().flat_map(|(_, validation)| &validation.coverage) {
        if !levels.contains(&one.level) {
            levels.push(one.level);
        }
    }
    let last = 2 + levels.len();
    let each = levels.iter().map(|level| format!("{} %", short(100.0 * level)));
    let head = [who, "outputs in their intervals [%]"].map(str::to_owned).into_iter().chain(each);
    let mut table = columns("Outputs in their prediction intervals", head.chain(["samples".to_owned()]))
        .words(&[1])
        .none("no deviation of the prediction is known, or no sample counts")
        .on_pages(&[0, last]);
    for (name, found) in all {
        for ahead in found.coverage.chunk_by(|a, b| (a.steps, &a.output) == (b.steps, &b.output)) {
            let [first, ..] = ahead else { continue };
            let horizon = format!("{}{}", Horizon::Steps { steps: first.steps }, of(found, &first.output));
            let at = |level: &f64| ahead.iter().find(|one| one.level == *level).and_then(|one| one.actual);
            let shares = levels.iter().map(|level| figure(at(level), |share| fixed(100.0 * share, 2)));
            let own = [word(name), word(horizon)].into_iter().chain(shares);
            table.row(own.chain([word(first.samples)]));
        }
    }
    table
}
