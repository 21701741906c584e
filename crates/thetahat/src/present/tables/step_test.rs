//! A step test as a table for people.

use crate::figures::{error, fixed, number, of_unit, short};
use crate::model::Quantity;
use crate::present::Layout;
use crate::step_test::{FittedProcess, Step, StepTest};
use crate::text::{brief, harmless};

use super::text::{Text, columns, or_dash};

/// This many steps are shown of very many.
const MOST: usize = 20;

/// The steps, what is read off their responses by each way, and which to trust.
pub fn step_test(found: &StepTest, layout: Layout) -> String {
    let mut text = Text::new(layout);
    let files: Vec<String> = found.logs.iter().map(|log| harmless(&log.file)).collect();
    let (input, output) = (brief(&found.input, 40), brief(&found.output, 40));
    let source = match found.steps.len() {
        0 => format!("from sines of {input} to {output}"),
        1 => format!("1 step of {input}, response of {output}"),
        count => format!("{count} steps of {input}, responses of {output}"),
    };
    text.line(&if files.is_empty() { source } else { format!("{}: {source}", files.join(", ")) });
    text.line("");
    if !found.steps.is_empty() {
        steps(&mut text, &found.steps);
    }
    figures(&mut text, found);
    if let Some(process) = &found.process {
        process_line(&mut text, process);
    }
    for advice in &found.advice {
        text.line(&harmless(advice));
    }
    for warning in &found.warnings {
        text.line(&format!("warning: {}", harmless(warning)));
    }
    text.finish()
}

/// One line for each step.
fn steps(text: &mut Text, steps: &[Step]) {
    let mut table =
        columns(&["step", "row", "at [s]", "from", "to", "before", "regime", "noise", "response"])
            .words(&[8])
            .none("it is not evaluated");
    for (number_of, step) in (1..).zip(steps.iter().take(MOST)) {
        let response = step.response.as_ref();
        table.row([
            format!("{number_of}"),
            step.row.to_string(),
            short(step.time),
            short(step.from),
            short(step.to),
            or_dash(response, |of| number(of.initial.value)),
            or_dash(response, |of| number(of.regime.value)),
            or_dash(response, |of| error(of.noise)),
            response.map_or_else(|| "left out".to_owned(), |of| of.shape.title().to_owned()),
        ]);
    }
    if steps.len() > MOST {
        table
            .legend(format!("{MOST} of {} steps; the JSON document has all of them (`format`)", steps.len()));
    }
    text.table(table);
}

/// The process of least squares.
fn process_line(text: &mut Text, process: &FittedProcess) {
    let each = process.parameters.iter().map(|parameter| {
        let error =
            parameter.standard_error.map_or_else(String::new, |spread| format!(" ± {}", error(spread)));
        let value = of_unit(parameter.value, process.structure.unit(&parameter.name));
        format!("{} {value}{error}", parameter.name)
    });
    text.line(&format!(
        "process {} of least squares, {}: {}, RMSE {}",
        process.structure,
        process.structure.equation(),
        each.collect::<Vec<_>>().join(", "),
        error(process.rmse)
    ));
}

/// One line for each figure by each way.
fn figures(text: &mut Text, found: &StepTest) {
    let several = found.summary.iter().any(|of| of.steps > 1);
    let head = ["figure", "way", "value", "standard error", "spread"];
    let mut table = columns(if several { &head } else { &head[..4] }).words(&[1]).none(if several {
        "one step, and one fit of all, have no spread"
    } else {
        "not known"
    });
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
        let mut cells = vec![
            if name == last { String::new() } else { name.clone() },
            format!("{}{trust}", of.method.title(of.figure)),
            number(value),
            or_dash(standard_error, error),
        ];
        if several {
            cells.push(or_dash(of.spread, error));
        }
        last = name;
        table.row(cells);
    }
    table.legend("*: the one to trust");
    if several {
        table.legend("value: the mean over the steps; spread: the standard deviation between them");
    }
    let misfits = found.steps.iter().filter_map(|step| step.response.as_ref()?.misfit);
    let misfit =
        misfits.fold(None, |most: Option<f64>, misfit| Some(most.map_or(misfit, |most| most.max(misfit))));
    if let Some(misfit) = misfit {
        table.legend(format!(
            "a first order with the weighted t-bar misses the response by {} % of the step (root mean square, without noise)",
            fixed(100.0 * misfit, 1)
        ));
    }
    text.table(table);
}
