//! A model in continuous time, as a table for people.

use crate::figures::{number, of_unit, seconds, short, three};
use crate::model::{ContinuousStateSpaceModel, ZerosPolesGain};
use crate::present::{Layout, words::complex};
use crate::report::Report;
use crate::text::harmless;
use thetahat_core::nalgebra::Complex;

use super::signal;
use super::state_space::gains;
use super::text::{self, Text, columns, or_dash};

/// Transfer functions are written out up to this order: beyond it coefficients tell nothing.
const HIGHEST: usize = 4;
/// Why a pole has no time constant or damping, or a channel no gain.
const NO_TIME: &str = "no time constant goes with a pole that does not decay, and no damping with one at 0";
const NO_ERROR: &str = "no time constant goes with a pole that does not decay, and no damping with one at 0; no standard error with poles \
                         that are too close for one";

/// The main figures of a model in continuous time.
pub(super) fn table(report: &Report, model: &ContinuousStateSpaceModel, layout: Layout) -> String {
    let mut text = Text::new(layout);
    let (name, step) = (report.model.name(), seconds(model.sample_time));
    text.line(&format!("{name}, from a sample time of {step} with {}", model.hold));
    text.line("dx/dt = A x + B u + K e, y = C x + D u + e");
    let inputs = model.inputs.iter().zip(&model.delays).map(|(input, delay)| {
        let waits = if *delay > 0.0 { format!(", delay {}", seconds(*delay)) } else { String::new() };
        format!("{}{waits}", signal("input", input))
    });
    let outputs = model.outputs.iter().map(|output| signal("output", output));
    text.line(&inputs.chain(outputs).collect::<Vec<String>>().join(", "));
    text.line("");
    poles(&mut text, model);
    gains(&mut text, (&model.inputs, &model.outputs), &model.dc_gain);
    transfers(&mut text, model);
    text.line(if model.stable { "stable" } else { "unstable" });
    text.finish()
}

fn poles(text: &mut Text, model: &ContinuousStateSpaceModel) {
    let head = [
        "pole [rad/s]",
        "natural frequency [rad/s]",
        "damping",
        "time constant [s]",
        "standard error of the pole",
    ];
    let known = model.covariance.is_some();
    let mut table = if known { columns(&head).none(NO_ERROR) } else { columns(&head[..4]).none(NO_TIME) };
    let figures = model.natural_frequencies.iter().zip(&model.damping).zip(&model.time_constants);
    // One of a pair stands for both.
    for (pole, ((frequency, damping), time)) in
        model.poles.iter().zip(figures).filter(|(pole, _)| pole.im >= 0.0)
    {
        let value = complex(pole);
        let value = if pole.im > 0.0 { format!("{value} and conjugate") } else { value };
        let spread = known.then(|| text::spread(pole));
        let figures = [
            value,
            number(*frequency),
            or_dash(*damping, three),
            or_dash(*time, |time| of_unit(time.value, "s")),
        ];
        table.row(figures.into_iter().chain(spread));
    }
    if !model.poles.is_empty() {
        text.table(table);
    }
}

/// The transfer function of each input and output, where they are short.
fn transfers(text: &mut Text, model: &ContinuousStateSpaceModel) {
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
            text.line(&format!("G(s) from {from} to {to} = {quotient}{late}"));
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
