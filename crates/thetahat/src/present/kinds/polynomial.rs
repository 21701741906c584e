//! Polynomial models.

use super::procedure::{procedure, samples};
use super::{closing, responses, signals};
use crate::figures::{number, of_unit, seconds};
use crate::model::{Parameter, PolynomialModel, Quantity, Root};
use crate::present::charts;
use crate::present::tree::{Sections, Table, columns, error, figure, known, word};
use crate::present::words::{complex, formula, interval, quantity, spread, stable};
use crate::report::Report;
use crate::text::harmless;

/// Why there may be no figure.
pub(super) const NO_ERROR: &str = "the way it was estimated gives no standard error";
const NO_ROOT_ERROR: &str =
    "no standard error is known, or no time constant goes with a pole on or outside of the unit circle";

pub(super) fn present(on: &mut Sections, report: &Report, model: &PolynomialModel) {
    on.section("Model");
    let what = if model.factors.is_some() { report.model.headline() } else { formula(&model.orders) };
    on.line(format!("{what}, sample time {}", seconds(model.sample_time)));
    signals(on, &model.inputs, std::slice::from_ref(&model.output));
    on.gap();
    let given = report.estimation.procedure.is_given();
    on.table(parameters(report.model.parameters()).without(if given { &[2] } else { &[] }));
    samples(on, &report.estimation, model.noise_variance, &model.output);
    procedure(on, report);
    let seasonal = model.factors.is_some();
    if on.is_page() || !(seasonal && model.inputs.is_empty()) {
        on.gap();
        dynamics(on, model);
    }
    responses(on, report, true);
    closing(on, report);
}

pub(in crate::present) fn parameters(parameters: &[Parameter]) -> Table {
    let mut table = columns("Parameters", ["parameter", "value", "standard error"]).none(NO_ERROR);
    for parameter in parameters {
        let value = figure(parameter.value, number);
        table.row([word(&parameter.name), value, error(parameter.standard_error)]);
    }
    table
}

/// Roots, gains and time constants.
fn dynamics(on: &mut Sections, model: &PolynomialModel) {
    on.section("Poles and zeros");
    on.chart(|| charts::roots(model));
    let head = ["root", "value", "standard error", "modulus", "time constant [s]", "95 % interval"];
    let mut roots = columns("Roots", head).words(&[5]).none(NO_ROOT_ERROR).on_pages(&[3]);
    let mut add = |role: &str, root: &Root, time: Option<Option<Quantity>>| {
        roots.row([
            // What one letter says elsewhere.
            word(format!("{role} of {}", root.polynomial.to_uppercase())),
            word(complex(root)),
            known(spread(root), |spread| spread),
            figure(root.re.hypot(root.im), number),
            time.map_or(word(""), |time| known(time, |time| of_unit(time.value, "s"))),
            time.map_or(word(""), |time| known(time.and_then(|time| time.interval), interval)),
        ]);
    };
    for (pole, time) in model.poles.iter().zip(&model.time_constants) {
        add("pole", pole, Some(*time));
    }
    // Those of an impulse response say little: it ends where its taps do.
    let ends = model.orders.na == 0 && model.orders.nf.iter().all(|&nf| nf == 0);
    model.zeros.iter().flatten().filter(|_| on.is_page() || !ends).for_each(|zero| add("zero", zero, None));
    model.noise_poles.iter().for_each(|pole| add("noise pole", pole, None));
    model.noise_zeros.iter().for_each(|zero| add("noise zero", zero, None));
    // Those of seasons lie on circles, many of them, and say no more than the factors do.
    if !roots.rows.is_empty() && (on.is_page() || model.factors.is_none()) {
        on.table(roots);
    }
    static_gains(on, model);
    on.line(stable(model.stable));
}

/// The static gain from each input.
pub(super) fn static_gains(on: &mut Sections, model: &PolynomialModel) {
    for (input, gain) in model.inputs.iter().zip(&model.dc_gain) {
        let gain = gain.map_or_else(|| "none (integrator)".to_owned(), quantity);
        on.line(format!("from {}: DC gain {gain}", harmless(&input.name)));
    }
}
