//! The pages of steps: of a log, and of a model.

use super::charts::{self, Shade, Stack, Transient};
use super::outputs::points;
use super::page::{Page, Section, Table};
use super::text::{or_dash, quantity};
use super::{of, tables};
use crate::data::Log;
use crate::figures::{number, of_unit, short, three, unit_of};
use crate::model::LinearModel;
use crate::step_test::{FittedProcess, StepSummary, StepTest};

/// This many responses are drawn of a log with very many steps.
const MOST: usize = 12;
/// A chart begins this fraction of the response before the step.
const BEFORE: f64 = 0.15;

/// The page of a step test: the log with its steps, each response with what is read off it, and the figures by each
/// way. `log` is the one that was evaluated, none for a frequency response. `command` is shown as what made the page.
pub fn step_test_page(found: &StepTest, log: Option<&Log>, command: &str) -> String {
    let title = format!("Step test of {}{}", found.output, of(&found.logs));
    let mut page = Page::new(title, command, &found.generator);
    page.lead = match found.steps.len() {
        0 => vec!["The time constant from sines.".to_owned()],
        1 => vec![format!("1 step of {}.", found.input)],
        count => vec![format!("{count} steps of {}.", found.input)],
    };
    page.lead.extend(found.advice.iter().map(|advice| sentence(advice)));
    page.warnings = &found.warnings;
    let mut section = Section::new("Figures");
    section.table(summaries(found));
    if let Some(process) = &found.process {
        section.table(parameters(process));
    }
    page.sections.push(section);
    if let Some(log) = log {
        page.sections.push(responses(found, log));
    }
    if !found.steps.is_empty() {
        let mut section = Section::new("Steps");
        section.table(steps(found));
        section.table(estimates(found));
        page.sections.push(section);
    }
    let mut section = Section::new("Data");
    section.table(tables::logs(&found.logs));
    page.sections.push(section);
    page.write()
}

/// The page of what a model does after a step or an impulse of each input, one entry for each output. `samples` are
/// those of the chart; none: until it has settled. `name` is what the model is called.
pub fn transient_page(
    models: &[&LinearModel<'_>],
    what: Transient,
    samples: Option<usize>,
    name: &str,
    command: &str,
) -> String {
    let kind = match what {
        Transient::Step => "Step response",
        Transient::Impulse => "Impulse response",
    };
    let generator = concat!("thetahat ", env!("CARGO_PKG_VERSION"));
    let mut page = Page::new(format!("{kind} of {name}"), command, generator);
    let mut section = Section::new(kind);
    for model in models {
        for input in model.inputs() {
            let named = [("estimate".to_owned(), *model)];
            section.chart(charts::transient(&named, &input.name, what, samples).map(|mut chart| {
                if models.len() > 1 {
                    chart.title.push_str(&format!(" to {}", model.output().name));
                }
                chart
            }));
        }
    }
    page.sections.push(section);
    page.write()
}

/// The process of least squares.
fn parameters(process: &FittedProcess) -> Table {
    let title = format!("Process {} of least squares: {}", process.structure, process.structure.equation());
    let mut table = Table::new(&title, &["parameter", "value", "unit", "standard error"]);
    for parameter in &process.parameters {
        table.row([
            parameter.name.clone(),
            number(parameter.value),
            unit_of(parameter.value, process.structure.unit(&parameter.name)),
            or_dash(parameter.standard_error, three),
        ]);
    }
    table
}

/// The log with its steps, and each response.
fn responses(found: &StepTest, log: &Log) -> Section {
    let mut section = Section::new("Responses");
    let (Ok(input), Ok(output)) = (log.channel(&found.input), log.channel(&found.output)) else {
        section.text("The log does not have the channels of the step test.");
        return section;
    };
    let time: Vec<f64> = (0..log.rows()).map(|row| log.elapsed(row)).collect();
    let drawn = found.steps.len().min(MOST);
    let points = points(2 + drawn);
    // Steps of a clock without a rhythm are no gaps.
    let mut stack = Stack::new(&time, f64::INFINITY, points);
    stack.panel(&output.name);
    stack.measured("measured", &output.values);
    stack.alone(&input.name, &input.values, 2);
    let shades: Vec<Shade> = (1..)
        .zip(&found.steps)
        .map(|(number, step)| Shade { name: format!("step {number}"), rows: vec![step.after] })
        .collect();
    section.chart(stack.draw(
        "The log",
        "Output and input over time, and the rows after each step. One time axis: zooming one zooms all.",
        &shades,
    ));
    for (number, step) in (1..).zip(&found.steps).take(drawn) {
        let Some(response) = &step.response else { continue };
        let after = step.after.positions();
        let begins = step.time - BEFORE * (log.elapsed(after.end - 1) - step.time);
        let first = step.before.positions().find(|row| time[*row] >= begins).unwrap_or(after.start);
        let shifted: Vec<f64> = time[first..after.end].iter().map(|time| time - step.time).collect();
        let data = (&shifted[..], &output.values[first..after.end]);
        section.chart(charts::step_response(number, step, response, &output.name, data, points));
    }
    if found.steps.len() > drawn {
        section.text(format!("The first {drawn} of {} steps are drawn.", found.steps.len()));
    }
    section
}

/// Each figure by each way.
fn summaries(found: &StepTest) -> Table {
    let several = found.summary.iter().any(|of| of.steps > 1);
    let head = ["figure", "way", "value", "standard error", "trust", "steps", "between steps"];
    let mut table = Table::new("What is read off, by each way", if several { &head } else { &head[..5] });
    for of in &found.summary {
        let StepSummary { figure, method, steps, value, spread, trusted } = *of;
        let unit = if figure.unit().is_empty() { String::new() } else { format!(" [{}]", figure.unit()) };
        let trust = match trusted {
            0 => String::new(),
            all if all == steps => "yes".to_owned(),
            some => format!("in {some}"),
        };
        let mut cells = vec![
            format!("{}{unit}", figure.name()),
            method.title(figure).to_owned(),
            of_unit(value.value, figure.unit()),
            or_dash(value.standard_error, three),
            trust,
        ];
        if several {
            cells.extend([steps.to_string(), or_dash(spread, three)]);
        }
        table.row(cells);
    }
    table
}

/// One row for each step.
fn steps(found: &StepTest) -> Table {
    let head = [
        "step",
        "at [s]",
        "from",
        "to",
        "before",
        "regime",
        "noise",
        "rows as one",
        "misfit [%]",
        "response",
    ];
    let mut table = Table::new("Steps", &head);
    for (position, step) in (1..).zip(&found.steps) {
        let response = step.response.as_ref();
        table.row([
            position.to_string(),
            short(step.time),
            short(step.from),
            short(step.to),
            or_dash(response, |of| quantity(of.initial)),
            or_dash(response, |of| quantity(of.regime)),
            or_dash(response, |of| three(of.noise)),
            or_dash(response, |of| three(of.correlation)),
            or_dash(response.and_then(|of| of.misfit), |misfit| three(100.0 * misfit)),
            response.map_or_else(|| "left out".to_owned(), |of| of.shape.title().to_owned()),
        ]);
    }
    table
}

/// Each figure by each way, of each step.
fn estimates(found: &StepTest) -> Table {
    let mut table = Table::new("Each step", &["step", "figure", "way", "value"]);
    if found.steps.len() < 2 {
        return table;
    }
    for (position, step) in (1..).zip(&found.steps) {
        for estimate in step.response.iter().flat_map(|of| &of.estimates) {
            table.row([
                position.to_string(),
                estimate.figure.name().to_owned(),
                estimate.method.title(estimate.figure).to_owned(),
                quantity(estimate.value),
            ]);
        }
    }
    table
}

/// With a capital letter and a full stop.
fn sentence(words: &str) -> String {
    let mut letters = words.chars();
    let first: String = letters.next().map(|first| first.to_uppercase().to_string()).unwrap_or_default();
    format!("{first}{}.", letters.as_str())
}
