//! Models in continuous time.

use super::procedure::procedure;
use super::{gains, mean_square, pair, responses};
use crate::figures::{number, of_unit, seconds, short, three};
use crate::model::{ContinuousStateSpaceModel, ZerosPolesGain};
use crate::present::tree::{Sections, columns, figure, known};
use crate::present::words::{criteria, signal, spread, stable};
use crate::report::Report;
use crate::text::harmless;
use thetahat_core::nalgebra::Complex;

/// Transfer functions are written out up to this order: beyond it coefficients tell nothing.
const HIGHEST: usize = 4;
/// Why a pole has no time constant or damping, or a channel no gain.
const NO_TIME: &str = "no time constant goes with a pole that does not decay, and no damping with one at 0";
const NO_ERROR: &str = "no time constant goes with a pole that does not decay, and no damping with one at 0; no standard error with poles \
                         that are too close for one";

pub(super) fn present(on: &mut Sections, report: &Report, model: &ContinuousStateSpaceModel) {
    on.section("Model");
    let (name, step) = (report.model.name(), seconds(model.sample_time));
    let own = &report.estimation.procedure;
    let (given, of_response) = (own.is_given(), own.shared_poles().is_some());
    let from = if given || of_response { "responses in steps of" } else { "from a sample time of" };
    on.line(format!("{name}, {from} {step} with {}", model.hold));
    on.line(if of_response {
        "dx/dt = A x + B u, y = C x + D u"
    } else {
        "dx/dt = A x + B u + K e, y = C x + D u + e"
    });
    let inputs = model.inputs.iter().zip(&model.delays).map(|(input, delay)| {
        let waits = if *delay > 0.0 { format!(", delay {}", seconds(*delay)) } else { String::new() };
        format!("{}{waits}", signal("input", input))
    });
    let outputs = model.outputs.iter().map(|output| signal("output", output));
    on.line(inputs.chain(outputs).collect::<Vec<String>>().join(", "));
    if (given || of_response) && !on.is_page() {
        procedure(on, report);
    }
    on.gap();
    poles(on, model);
    gains(on, (&model.inputs, &model.outputs), &model.dc_gain);
    transfers(on, model);
    on.line(stable(model.stable));
    if on.is_page() {
        let estimation = &report.estimation;
        if !estimation.procedure.is_given() {
            on.line(format!("{} samples", estimation.samples));
            mean_square(on, estimation);
            on.line(criteria(&estimation.criteria));
        }
        procedure(on, report);
        responses(on, report, false);
    }
}

fn poles(on: &mut Sections, model: &ContinuousStateSpaceModel) {
    let head = [
        "pole [rad/s]",
        "natural frequency [rad/s]",
        "damping",
        "time constant [s]",
        "standard error of the pole",
    ];
    let is_certain = model.covariance.is_some();
    let mut table = columns("Poles", head).none(if is_certain { NO_ERROR } else { NO_TIME });
    table = table.without(if is_certain { &[] } else { &[4] });
    let figures = model.natural_frequencies.iter().zip(&model.damping).zip(&model.time_constants);
    // One of a pair stands for both.
    for (pole, ((frequency, damping), time)) in
        model.poles.iter().zip(figures).filter(|(pole, _)| pole.im >= 0.0)
    {
        table.row([
            pair(pole),
            figure(*frequency, number),
            figure(*damping, three),
            known(*time, |time| of_unit(time.value, "s")),
            known(spread(pole), |spread| spread),
        ]);
    }
    if !model.poles.is_empty() {
        on.table(table);
    }
}

/// The transfer function of each input and output, where they are short.
fn transfers(on: &mut Sections, model: &ContinuousStateSpaceModel) {
    if model.a.len() > HIGHEST {
        return;
    }
    for (place, output) in model.outputs.iter().enumerate() {
        for (input, signal) in model.inputs.iter().enumerate() {
            let Ok(transfer) = model.transfer(place, input) else { continue };
            let late = match model.delays[input] {
                delay if delay > 0.0 => format!(" e^(-{} s)", short(delay)),
                _ => String::new(),
            };
            let quotient = quotient(&transfer);
            let (from, to) = (harmless(&signal.name), harmless(&output.name));
            on.line(format!("G(s) from {from} to {to} = {quotient}{late}"));
        }
    }
}

/// Numerator and denominator in falling powers of s.
fn quotient(transfer: &ZerosPolesGain) -> String {
    if transfer.gain == 0.0 {
        return "0".to_owned();
    }
    let numerator = polynomial(transfer.gain, &transfer.zeros);
    if transfer.poles.is_empty() {
        return numerator;
    }
    format!("({numerator})/({})", polynomial(1.0, &transfer.poles))
}

/// gain (s - root) (s - root) …, multiplied out. Complex roots come in pairs.
fn polynomial(gain: f64, roots: &[Complex<f64>]) -> String {
    let mut coefficients = vec![Complex::new(gain, 0.0)];
    for root in roots {
        coefficients.push(Complex::new(0.0, 0.0));
        for place in (1..coefficients.len()).rev() {
            let before = coefficients[place - 1];
            coefficients[place] -= root * before;
        }
    }
    let mut text = String::new();
    for (place, coefficient) in coefficients.iter().enumerate() {
        let (value, power) = (coefficient.re, roots.len() - place);
        if value == 0.0 && !roots.is_empty() {
            continue;
        }
        let sign = match (text.is_empty(), value < 0.0) {
            (true, true) => "-",
            (true, false) => "",
            (false, true) => " - ",
            (false, false) => " + ",
        };
        let factor = if value.abs() == 1.0 && power > 0 { String::new() } else { number(value.abs()) };
        let power = match power {
            0 => String::new(),
            1 => "s".to_owned(),
            power => format!("s^{power}"),
        };
        let space = if factor.is_empty() || power.is_empty() { "" } else { " " };
        text.push_str(&format!("{sign}{factor}{space}{power}"));
    }
    text
}
