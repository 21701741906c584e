//! Models in equations.

use super::procedure::procedure;
use super::{closing, mean_square, responses};
use crate::estimate::EquationsOutcome;
use crate::figures::{number, scientific, seconds, short, three};
use crate::model::{EquationsModel, Signal};
use crate::present::filtered::consistency;
use crate::present::tree::{Sections, Table, columns, error, figure, word};
use crate::present::words::{criteria, or_dash};
use crate::report::Report;
use crate::text::harmless;

pub(super) fn present(on: &mut Sections, report: &Report, model: &EquationsModel) {
    on.section("Model");
    let listed = |names: Vec<String>| if names.is_empty() { "none".to_owned() } else { names.join(", ") };
    let names = |signals: &[Signal]| listed(signals.iter().map(|signal| harmless(&signal.name)).collect());
    on.line(format!("{}, sample time {}", report.model.name(), seconds(model.sample_time)));
    on.line(format!(
        "inputs {}, outputs {}, states {}",
        names(&model.inputs),
        names(&model.outputs),
        listed(model.states.clone())
    ));
    on.gap();
    let Some(outcome) = report.estimation.procedure.equations() else { return };
    on.table(parameters(outcome, model));
    if on.is_page() {
        on.table(starts(outcome, model));
    }
    let estimation = &report.estimation;
    on.line(format!(
        "{} rows, {} measured values, log-likelihood {}, condition number {}",
        report.data.rows,
        estimation.samples,
        number(outcome.log_likelihood),
        or_dash(estimation.condition, |condition| scientific(condition, 3))
    ));
    mean_square(on, estimation);
    on.line(criteria(&estimation.criteria));
    procedure(on, report);
    if let Some(nis) = &outcome.nis {
        on.line(consistency(nis));
    }
    if on.is_page() {
        on.line(format!("covariance multiplied by {}", three(outcome.covariance_factor)));
        on.line("The model as it was written, before the fit:");
        on.command(&model.equations);
        // Equations that are not linear have no responses of this kind.
        if !model.inputs.is_empty() {
            responses(on, report, false);
        }
    }
    closing(on, report);
}

/// The parameters, and what was known of them before.
fn parameters(outcome: &EquationsOutcome, model: &EquationsModel) -> Table {
    let head =
        ["parameter", "value", "standard error", "95 % from", "to", "start", "min", "max", "estimated as"];
    let mut table = columns("Parameters", head)
        .words(&[8])
        .on_pages(&[6, 7])
        .without(if outcome.profile.is_empty() { &[3, 4] } else { &[] });
    for (index, (parameter, known)) in model.parameters.iter().zip(&outcome.unknown).enumerate() {
        let profile = outcome.profile.get(index);
        table.row([
            word(&parameter.name),
            figure(parameter.value, number),
            error(parameter.standard_error),
            figure(profile.and_then(|profile| profile.low), number),
            figure(profile.and_then(|profile| profile.high), number),
            figure(known.start, short),
            figure(known.min, short),
            figure(known.max, short),
            word(known.change_of_variable.clone().unwrap_or_default()),
        ]);
    }
    table
}

/// Where the states start in the free runs on the estimation rows.
fn starts(outcome: &EquationsOutcome, model: &EquationsModel) -> Table {
    let mut table = columns("States", ["state", "start of each free run on the estimation rows"]);
    for (state, starts) in model.states.iter().zip(&outcome.starts) {
        let starts: Vec<String> = starts.iter().map(|start| or_dash(*start, number)).collect();
        table.row([word(state), word(starts.join(", "))]);
    }
    table
}
