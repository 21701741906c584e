//! A report as a table for people.

use std::fmt::Write;

use comfy_table::{CellAlignment, Table, presets};
use thetahat::{Complex, Fit, Part, Report, Rows, Signal, Start};

use crate::output::harmless;

/// The report's main figures.
pub(crate) fn table(report: &Report) -> String {
    let model = &report.model;
    let mut text = String::new();
    let signal = |role: &str, signal: &Signal| {
        let trend = match signal.offset.slope {
            0.0 => String::new(),
            slope => format!(" + {} a second", short(slope)),
        };
        format!("{role} {} (offset {}{trend})", harmless(&signal.name), short(signal.offset.level))
    };
    line(
        &mut text,
        &format!("ARX: A(q) y(t) = B(q) u(t) + e(t), sample time {} s", short(model.sample_time)),
    );
    let signals = model.inputs.iter().map(|input| signal("input", input));
    let signals: Vec<String> = signals.chain([signal("output", &model.output)]).collect();
    line(&mut text, &signals.join(", "));
    line(&mut text, "");

    let mut parameters = plain(&["parameter", "value", "standard error"]);
    for parameter in &model.parameters {
        parameters.add_row([
            parameter.name.clone(),
            number(parameter.value),
            format!("{:.2e}", parameter.standard_error),
        ]);
    }
    right_aligned(&mut text, parameters, &[1, 2]);

    let estimation = &report.estimation;
    let or_none = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.4}"));
    line(
        &mut text,
        &format!(
            "{} samples, noise variance {}, condition number {:.3e}",
            estimation.samples,
            number(model.noise_variance),
            estimation.condition
        ),
    );
    let criteria = &estimation.criteria;
    line(
        &mut text,
        &format!(
            "FPE {}, AIC {}, AICc {}, MDL {}",
            number(criteria.fpe),
            or_none(criteria.aic),
            or_none(criteria.aicc),
            or_none(criteria.mdl)
        ),
    );
    line(&mut text, "");

    let mut poles = plain(&["pole", "time constant [s]"]);
    for (pole, time) in model.poles.iter().zip(&model.time_constants) {
        poles.add_row([complex(pole), time.map_or_else(|| "-".to_owned(), number)]);
    }
    if !model.poles.is_empty() {
        right_aligned(&mut text, poles, &[1]);
    }
    for ((input, zeros), gain) in model.inputs.iter().zip(&model.zeros).zip(&model.dc_gain) {
        let zeros: Vec<String> = zeros.iter().map(complex).collect();
        let zeros =
            if zeros.is_empty() { "no zeros".to_owned() } else { format!("zeros {}", zeros.join(", ")) };
        let gain = gain.map_or_else(|| "none (integrator)".to_owned(), number);
        line(&mut text, &format!("from {}: DC gain {gain}, {zeros}", harmless(&input.name)));
    }
    line(&mut text, if model.stable { "stable" } else { "unstable" });
    line(&mut text, "");

    let mut fits = plain(&["part", "rows", "horizon", "initial", "samples", "fit [%]", "RMSE"]);
    for fit in &report.fit {
        let part = match fit.part {
            Some(Part::Estimation) => "estimation",
            Some(Part::Validation) => "validation",
            None => "",
        };
        fits.add_row([
            part.to_owned(),
            rows(&fit.rows),
            fit.horizon.to_string(),
            start(fit.initial).to_owned(),
            fit.samples.to_string(),
            fit.percent.map_or_else(|| "-".to_owned(), |percent| format!("{percent:.3}")),
            fit.rmse.map_or_else(|| "-".to_owned(), number),
        ]);
    }
    right_aligned(&mut text, fits, &[4, 5, 6]);
    // One line break at the end.
    text.truncate(text.trim_end().len());
    text.push('\n');
    text
}

/// One line that says how close a response is.
pub(crate) fn figure(fit: &Fit) -> String {
    let percent = fit.percent.map_or_else(|| "none".to_owned(), |percent| format!("{percent:.3} %"));
    let rmse = fit.rmse.map_or_else(|| "none".to_owned(), number);
    format!(
        "fit {percent}, RMSE {rmse} ({}, initial {}, rows {}, {} samples)",
        fit.horizon,
        start(fit.initial),
        rows(&fit.rows),
        fit.samples
    )
}

fn line(text: &mut String, content: &str) {
    text.push_str(content);
    text.push('\n');
}

/// Six significant digits.
fn number(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 {
        return "0".to_owned();
    }
    if !(1e-4..1e6).contains(&size) {
        return format!("{value:.5e}");
    }
    let decimals = (5 - size.log10().floor() as i32).clamp(0, 9) as usize;
    format!("{value:.decimals$}")
}

/// The same without zeros at the end.
fn short(value: f64) -> String {
    let text = number(value);
    if text.contains('.') && !text.contains('e') {
        return text.trim_end_matches('0').trim_end_matches('.').to_owned();
    }
    text
}

fn complex(value: &Complex) -> String {
    let mut text = number(value.re);
    if value.im != 0.0 {
        let sign = if value.im < 0.0 { '-' } else { '+' };
        // Writing to a string cannot fail.
        let _ = write!(text, " {sign} {}i", number(value.im.abs()));
    }
    text
}

fn rows(rows: &[Rows]) -> String {
    let shown: Vec<String> = rows.iter().map(Rows::to_string).collect();
    shown.join(",")
}

fn start(start: Start) -> &'static str {
    match start {
        Start::Zero => "zero",
        Start::Measured => "measured",
        Start::Estimated => "estimated",
    }
}

fn plain(header: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header(header.iter().copied());
    table
}

/// Appends a table, numbers to the right, and an empty line.
fn right_aligned(text: &mut String, mut table: Table, columns: &[usize]) {
    for (position, column) in table.column_iter_mut().enumerate() {
        // Two blanks between columns, none before the first.
        column.set_padding((0, 2));
        if columns.contains(&position) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    for shown in table.lines() {
        line(text, shown.trim_end());
    }
    line(text, "");
}
