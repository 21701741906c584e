//! The time constant from sines: where the phase is -45 degrees.

use std::f64::consts::FRAC_PI_4;

use super::document::{StepFigure, StepMethod, StepSummary, StepTest};
use crate::document::GENERATOR;
use crate::figures::{fixed, short};
use crate::model::Quantity;
use crate::respond::FrequencyPoint;
use crate::spectrum::MeasuredResponse;
use crate::{Document, Error};

/// Two frequencies farther apart than this factor leave much to the interpolation.
const APART: f64 = 4.0;

/// The time constant of a first order K/(1 + i omega tau) from a measured frequency response, such as that of sines one
/// after the other: tau = 1/omega at the frequency where the phase is -45 degrees, between two measured frequencies on
/// the line of tan(phase) over omega, which a first order follows. The gain is the magnitude there times sqrt(2).
///
/// The sign of the gain is that of the response at the lowest frequency. A dead time turns the phase by omega theta
/// more, and makes the time constant too large by about 2 theta: the document says so. The standard error follows from
/// those of the two phases. O(points).
///
/// # Errors
/// [`Error::Argument`] for an input that the response is not from; [`Error::Undetermined`] where the phase does not
/// pass -45 degrees between two of the frequencies.
pub fn sine_test(found: &MeasuredResponse, input: &str) -> Result<StepTest, Error> {
    let Some(response) = found.from_input(input) else {
        let there = found.responses.iter().filter_map(|response| response.input.as_deref());
        let there: Vec<&str> = there.collect();
        return Err(Error::argument(
            "input",
            format!("the response is not from '{input}'; it is from: {}", there.join(", ")),
        ));
    };
    let mut points: Vec<&FrequencyPoint> = response.points.iter().collect();
    points.sort_by(|a, b| a.frequency.total_cmp(&b.frequency));
    let negative = points.first().is_some_and(|point| point.re < 0.0);
    let sign = if negative { -1.0 } else { 1.0 };
    // -tan(phase), which a first order has in proportion to the frequency.
    let tangent = |point: &FrequencyPoint| -(sign * point.im) / (sign * point.re);
    let turned = |point: &FrequencyPoint| (sign * point.im).atan2(sign * point.re);
    let pair = points.windows(2).find(|pair| turned(pair[0]) > -FRAC_PI_4 && turned(pair[1]) <= -FRAC_PI_4);
    let Some(&[below, above]) = pair else {
        let (first, last) =
            points.first().zip(points.last()).map_or((0.0, 0.0), |(a, b)| (turned(a), turned(b)));
        return Err(Error::undetermined(
            Vec::new(),
            format!(
                "the phase does not pass -45 degrees between two frequencies (it is {} degrees at the lowest, {} at the highest): \
                 measure sines on both sides of it",
                fixed(first.to_degrees(), 1),
                fixed(last.to_degrees(), 1)
            ),
        ));
    };
    // Beyond -90 degrees the tangent turns over: the phase itself serves there.
    let use_phase = sign * above.re <= 0.0;
    let of = |point: &FrequencyPoint| if use_phase { -turned(point) } else { tangent(point) };
    let slope_of = |point: &FrequencyPoint| if use_phase { 1.0 } else { 1.0 + tangent(point).powi(2) };
    let level = if use_phase { FRAC_PI_4 } else { 1.0 };
    let (x, y) = (of(below), of(above));
    let part = (level - x) / (y - x);
    let span = above.frequency - below.frequency;
    let frequency = below.frequency + part * span;
    let tau = 1.0 / frequency;
    let error = below.phase.standard_error.zip(above.phase.standard_error).map(|(first, second)| {
        let by = span / (y - x);
        let moved = ((1.0 - part) * by * first * slope_of(below)).hypot(part * by * second * slope_of(above));
        tau * tau * moved
    });
    // 1/|G|^2 of a first order is a straight line over the square of the frequency.
    let square = |value: f64| value * value;
    let across =
        (square(frequency) - square(below.frequency)) / (square(above.frequency) - square(below.frequency));
    let inverse = |point: &FrequencyPoint| 1.0 / square(point.magnitude.value);
    let magnitude = 1.0 / ((1.0 - across) * inverse(below) + across * inverse(above)).sqrt();
    let size = below.magnitude.standard_error.zip(above.magnitude.standard_error);
    let size = size.map(|(first, second)| 2_f64.sqrt() * ((1.0 - across) * first).hypot(across * second));
    let of = |figure, value| StepSummary {
        figure,
        method: StepMethod::Phase,
        steps: 1,
        value,
        spread: None,
        trusted: 1,
    };
    let mut warnings = found.warnings.clone();
    if above.frequency > APART * below.frequency {
        warnings.push(format!(
            "the phase passes -45 degrees between {} and {} rad/s, which are far apart: measure a sine near {} rad/s",
            short(below.frequency),
            short(above.frequency),
            short(frequency)
        ));
    }
    Ok(StepTest {
        schema: StepTest::SCHEMA.to_owned(),
        generator: GENERATOR.to_owned(),
        logs: found.logs.clone(),
        input: input.to_owned(),
        output: found.output.clone(),
        steps: Vec::new(),
        process: None,
        summary: vec![
            of(StepFigure::Gain, Quantity::new(sign * 2_f64.sqrt() * magnitude, size)),
            of(StepFigure::TimeConstant, Quantity::new(tau, error)),
        ],
        advice: vec![
            "sines: the time constant rests on the two frequencies beside -45 degrees, and on a first order without dead time, which \
             turns the phase further and makes it too large by about twice itself; a model laid over all frequencies (bode, with over) shows both"
                .to_owned(),
        ],
        warnings,
    })
}
