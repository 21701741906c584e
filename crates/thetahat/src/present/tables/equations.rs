//! What a fit of a model in equations found, as a table for people.

use crate::figures::{error, number, scientific, seconds, short};
use crate::model::EquationsModel;
use crate::present::Layout;
use crate::report::Report;
use crate::text::harmless;

use super::filtered::surprise;
use super::text::{Text, columns, or_dash};
use super::{counted, criteria, fits, stopped, word};

/// The main figures of a fit of a model in equations.
pub(super) fn table(report: &Report, model: &EquationsModel, layout: Layout) -> String {
    let mut text = Text::new(layout);
    let listed = |names: Vec<String>| if names.is_empty() { "none".to_owned() } else { names.join(", ") };
    let names = |signals: &[crate::model::Signal]| {
        listed(signals.iter().map(|signal| harmless(&signal.name)).collect())
    };
    text.line(&format!("{}, sample time {}", report.model.name(), seconds(model.sample_time)));
    text.line(&format!(
        "inputs {}, outputs {}, states {}",
        names(&model.inputs),
        names(&model.outputs),
        listed(model.states.clone())
    ));
    text.line("");
    let Some(outcome) = report.estimation.procedure.equations() else { return text.finish() };
    let head = ["parameter", "value", "standard error", "start", "estimated as"];
    let mut parameters = columns(&head).words(&[4]);
    for (parameter, known) in model.parameters.iter().zip(&outcome.unknown) {
        parameters.row([
            parameter.name.clone(),
            number(parameter.value),
            or_dash(parameter.standard_error, error),
            short(known.start),
            known.change_of_variable.clone().unwrap_or_default(),
        ]);
    }
    text.table(parameters);
    let (estimation, search) = (&report.estimation, &outcome.search);
    text.line(&format!(
        "{} rows, {} measured values, log-likelihood {}, condition number {}",
        report.data.rows,
        estimation.samples,
        number(outcome.log_likelihood),
        or_dash(estimation.condition, |condition| scientific(condition, 3))
    ));
    text.line(&criteria(&estimation.criteria));
    let starts = match search.reached.len() {
        0 => String::new(),
        count => format!(" from the best of {count} starts"),
    };
    text.line(&format!(
        "largest likelihood, {} ({}){starts}, {}",
        counted(search.iterations),
        word(search.algorithm),
        stopped(search.stopped)
    ));
    if let Some(nis) = &outcome.nis {
        text.line(&surprise(nis));
    }
    text.line("");
    fits(&mut text, &report.fit);
    text.finish()
}
