//! Step tests, and what models do after steps.

use crate::data::Log;
use crate::document::GENERATOR;
use crate::figures::{self, fixed, number, of_unit, short, three};
use crate::model::{LinearModel, Quantity};
use crate::present::Layout;
use crate::step_test::{FittedProcess, StepTest};
use crate::text::{brief, harmless};

use super::charts::{self, Shade, Stack, Transient};
use super::data;
use super::html::Page;
use super::outputs::points;
use super::tree::{Medium, Sections, Table, columns, error, figure, known, word};
use super::words::quantity;

/// This many steps are in a text, and drawn on a page, of very many.
const MOST: usize = 20;
const DRAWN: usize = 12;
/// A chart begins this fraction of the response before the step.
const BEFORE: f64 = 0.15;

/// The steps, what is read off their responses by each way, and which to trust.
pub fn step_test(found: &StepTest, layout: Layout) -> String {
    let on = &mut Sections::new(Medium::Text);
    figures_of(on, found);
    for warning in &found.warnings {
        on.line(format!("warning: {}", harmless(warning)));
    }
    super::text::written(on, layout)
}

/// The page of a step test: the log with its steps, each response with what is read off it, and the figures by each
/// way. `log` is the one that was evaluated, none for a frequency response. `command` is shown as what made the page.
pub fn step_test_page(found: &StepTest, log: Option<&Log>, command: &str) -> String {
    let mut document = Sections::new(Medium::Page);
    figures_of(&mut document, found);
    log.into_iter().for_each(|log| responses(&mut document, found, log));
    if found.steps.len() > 1 {
        document.section("Steps");
        document.table(estimates(found));
    }
    document.section("Data");
    document.table(data::logs(&found.logs));
    Page {
        title: format!("Step test of {}{}", found.output, data::of(&found.logs)),
        warnings: &found.warnings,
        document,
        command,
        generator: &found.generator,
    }
    .write()
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
    let mut document = Sections::new(Medium::Page);
    document.section(kind);
    for model in models {
        for input in model.inputs() {
            let named = [("estimate".to_owned(), *model)];
            let drawn = charts::transient(&named, &input.name, what, samples).map(|mut chart| {
                if models.len() > 1 {
                    chart.title.push_str(&format!(" to {}", model.output().name));
                }
                chart
            });
            document.chart(|| drawn);
        }
    }
    Page { title: format!("{kind} of {name}"), warnings: &[], document, command, generator: GENERATOR }
        .write()
}

/// The steps and the figures.
fn figures_of(on: &mut Sections, found: &StepTest) {
    let files: Vec<String> = found.logs.iter().map(|log| harmless(&log.file)).collect();
    let (input, output) = (brief(&found.input, 40), brief(&found.output, 40));
    let source = match found.steps.len() {
        0 => format!("from sines of {input} to {output}"),
        1 => format!("1 step of {input}, response of {output}"),
        count => format!("{count} steps of {input}, responses of {output}"),
    };
    on.line(if files.is_empty() { source } else { format!("{}: {source}", files.join(", ")) });
    on.gap();
    on.section("Figures");
    if !found.steps.is_empty() {
        on.table(steps(found, on.medium));
    }
    on.table(summaries(found, on.medium));
    if let Some(process) = &found.process {
        process_line(on, process);
    }
    for advice in &found.advice {
        on.line(harmless(advice));
    }
}

/// One line for each step. A page says how certain its levels are.
fn steps(found: &StepTest, medium: Medium) -> Table {
    let (most, said): (usize, fn(Quantity) -> String) = match medium {
        Medium::Text => (MOST, |level| number(level.value)),
        Medium::Page => (usize::MAX, quantity),
    };
    let head = [
        "step",
        "row",
        "at [s]",
        "from",
        "to",
        "before",
        "final",
        "noise",
        "rows as one",
        "misfit [%]",
        "response",
    ];
    let mut table = columns("Steps", head).words(&[10]).none("it is not evaluated").on_pages(&[8, 9]);
    for (position, step) in (1..).zip(found.steps.iter().take(most)) {
        let response = step.response.as_ref();
        table.row([
            word(position),
            word(step.row),
            figure(step.time, short),
            figure(step.from, short),
            figure(step.to, short),
            known(response, |of| said(of.initial)),
            known(response, |of| said(of.regime)),
            error(response.map(|of| of.noise)),
            figure(response.map(|of| of.correlation), three),
            figure(response.and_then(|of| of.misfit), |misfit| three(100.0 * misfit)),
            word(response.map_or("left out", |of| of.shape.title())),
        ]);
    }
    let count = found.steps.len();
    if count > most {
        table.legend(format!("{most} of {count} steps; the JSON document has all of them (`format`)"));
    }
    table
}

/// The process of least squares.
fn process_line(on: &mut Sections, process: &FittedProcess) {
    let each = process.parameters.iter().map(|parameter| {
        let spread = parameter
            .standard_error
            .map_or_else(String::new, |spread| format!(" ± {}", figures::error(spread)));
        let value = of_unit(parameter.value, process.structure.unit(&parameter.name));
        format!("{} {value}{spread}", parameter.name)
    });
    on.line(format!(
        "process {} of least squares, {}: {}, RMSE {}",
        process.structure,
        process.structure.equation(),
        each.collect::<Vec<_>>().join(", "),
        figures::error(process.rmse)
    ));
}

/// One line for each figure by each way. In a text the first way has its name.
fn summaries(found: &StepTest, medium: Medium) -> Table {
    let several = found.summary.iter().any(|of| of.steps > 1);
    let head = ["figure", "way", "value", "standard error", "steps", "spread"];
    let mut table = columns("What is read off, by each way", head)
        .words(&[1])
        .none(if several { "one step, and one fit of all, have no spread" } else { "not known" })
        .on_pages(&[4])
        .without(if several { &[] } else { &[4, 5] });
    let is_text = medium == Medium::Text;
    let mut last = String::new();
    for of in &found.summary {
        let unit = of.figure.unit();
        let name = of.figure.name();
        let name = if unit.is_empty() { name.to_owned() } else { format!("{name} [{unit}]") };
        let Quantity { value, standard_error, .. } = of.value;
        let trust = match of.trusted {
            0 => String::new(),
            all if all == of.steps => " *".to_owned(),
            some => format!(" (* in {some})"),
        };
        table.row([
            word(if is_text && name == last { "" } else { &name }),
            word(format!("{}{trust}", of.method.title(of.figure))),
            word(if is_text { number(value) } else { of_unit(value, unit) }),
            error(standard_error),
            word(of.steps),
            error(of.spread),
        ]);
        last = name;
    }
    table.legend("*: the one to trust");
    if several {
        table.legend("value: the mean over the steps; spread: the standard deviation between them");
    }
    let misfits = found.steps.iter().filter_map(|step| step.response.as_ref()?.misfit);
    if let Some(misfit) = misfits.reduce(f64::max) {
        table.legend(format!(
            "a first order with the weighted t-bar misses the response by {} % of the step (root mean square, without noise)",
            fixed(100.0 * misfit, 1)
        ));
    }
    table
}

/// The log with its steps, and each response.
fn responses(on: &mut Sections, found: &StepTest, log: &Log) {
    on.section("Responses");
    let (Ok(input), Ok(output)) = (log.channel(&found.input), log.channel(&found.output)) else {
        on.line("The log does not have the channels of the step test.");
        return;
    };
    let time: Vec<f64> = (0..log.rows()).map(|row| log.elapsed(row)).collect();
    let drawn = found.steps.len().min(DRAWN);
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
    let words =
        "Output and input over time, and the rows after each step. One time axis: zooming one zooms all.";
    on.chart(|| stack.draw("The log", words, &shades));
    for (number, step) in (1..).zip(&found.steps).take(drawn) {
        let Some(response) = &step.response else { continue };
        let after = step.after.positions();
        let begins = step.time - BEFORE * (log.elapsed(after.end - 1) - step.time);
        let first = step.before.positions().find(|row| time[*row] >= begins).unwrap_or(after.start);
        let shifted: Vec<f64> = time[first..after.end].iter().map(|time| time - step.time).collect();
        let data = (&shifted[..], &output.values[first..after.end]);
        on.chart(|| charts::step_response(number, step, response, &output.name, data, points));
    }
    if found.steps.len() > drawn {
        on.line(format!("The first {drawn} of {} steps are drawn.", found.steps.len()));
    }
}

/// Each figure by each way, of each step.
fn estimates(found: &StepTest) -> Table {
    let mut table = columns("Each step", ["step", "figure", "way", "value"]).words(&[1, 2, 3]);
    if found.steps.len() < 2 {
        return table;
    }
    for (position, step) in (1..).zip(&found.steps) {
        for estimate in step.response.iter().flat_map(|of| &of.estimates) {
            table.row([
                word(position),
                word(estimate.figure.name()),
                word(estimate.method.title(estimate.figure)),
                word(quantity(estimate.value)),
            ]);
        }
    }
    table
}
