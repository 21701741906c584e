//! What a model in continuous time is to frequencies, steps and impulses.

use std::f64::consts::PI;

use thetahat_core::nalgebra::{Complex, ComplexField};

use super::frequency::has_pole;
use super::state_space::Resolvent;
use super::transient::lasting;
use super::{FrequencyPoint, FrequencyResponse, TransientResponse, state_space};
use crate::Error;
use crate::model::{ContinuousStateSpace, ContinuousStateSpaceModel, Hold, Path, Quantity, ZerosPolesGain};

/// Of roots this near the imaginary axis nobody knows on which side they lie.
const ON_AXIS: f64 = 16.0 * f64::EPSILON;

/// The frequency responses of an output at `frequencies` in radians per second, from each input:
///
/// ```text
/// (C (i omega I - A)^-1 B + D) e^(-i omega delay)
/// ```
///
/// by an LU factor at each frequency, O(n^3). Of the noise it says nothing: that of continuous time has no variance.
/// Phases are the sums of what zeros, poles and the delay turn from frequency 0 on.
///
/// # Errors
/// [`Error::Argument`] for a frequency that is not a number, negative, or one of a pole on the imaginary axis.
pub(super) fn frequency_response(
    model: &ContinuousStateSpaceModel,
    output: usize,
    frequencies: &[f64],
) -> Result<Vec<FrequencyResponse>, Error> {
    if let Some(wrong) = frequencies.iter().find(|frequency| !(**frequency >= 0.0 && frequency.is_finite())) {
        return Err(Error::argument("frequencies", format!("{wrong} rad/s is not 0 or more and finite")));
    }
    let ContinuousStateSpace { a, b, c, d, .. } = model.matrices();
    let (n, m) = b.shape();
    let transfers: Vec<ZerosPolesGain> =
        (0..m).map(|input| model.transfer(output, input)).collect::<Result<_, Error>>()?;
    let seen = c.row(output).transpose();
    let size = a.norm();
    let mut found: Vec<Vec<FrequencyPoint>> = vec![Vec::with_capacity(frequencies.len()); m];
    for &frequency in frequencies {
        let s = Complex::new(0.0, frequency);
        let near = ON_AXIS * (1 + n) as f64 * size.max(frequency);
        if model.poles.iter().any(|pole| (s - Complex::new(pole.re, pole.im)).modulus() <= near && n > 0) {
            return Err(has_pole(frequency));
        }
        let resolvent = Resolvent::new((&a, &seen), s, model.covariance.as_ref());
        let resolvent = resolvent.ok_or_else(|| has_pole(frequency))?;
        for (input, (points, transfer)) in found.iter_mut().zip(&transfers).enumerate() {
            let delay = model.delays[input];
            let (sine, cosine) = (-frequency * delay).sin_cos();
            let (path, late) = (Path { output, input: Some(input) }, Complex::new(cosine, sine));
            let enters = (&b.column(input).into_owned(), d[(output, input)]);
            let (response, spread) = resolvent.response(path, enters, late);
            if !response.modulus().is_finite() {
                return Err(has_pole(frequency));
            }
            let near = turned(transfer, frequency) - frequency * delay;
            points.push(FrequencyPoint::new(frequency, response, spread, near));
        }
    }
    let names = model.inputs.iter().map(|input| Some(input.name.clone()));
    Ok(names.zip(found).map(|(input, points)| FrequencyResponse { input, points }).collect())
}

/// What zeros and poles turn from frequency 0 on, as those of sampled models do: pi for a negative static gain, -pi
/// where an unstable pole makes it so, and a pole at 0 takes pi/2 off.
fn turned(transfer: &ZerosPolesGain, frequency: f64) -> f64 {
    let odd =
        |roots: &[Complex<f64>]| roots.iter().filter(|root| root.im == 0.0 && root.re > 0.0).count() % 2 == 1;
    let above = if (transfer.gain < 0.0) != odd(&transfer.zeros) { PI } else { 0.0 };
    let sign = above - if odd(&transfer.poles) { PI } else { 0.0 };
    let turned = |roots: &[Complex<f64>]| {
        let each = roots.iter().map(|root| {
            let (re, im) = (-root.re, frequency - root.im);
            // A root on the right turns as its mirror image on the left does, the other way round.
            if re < 0.0 { -(im.atan2(-re)) } else { im.atan2(re) }
        });
        each.sum::<f64>()
    };
    sign + turned(&transfer.zeros) - turned(&transfer.poles)
}

/// The response of an output to a step of an input at time 0, from rest: of samples that hold their input it is exact.
///
/// # Errors
/// [`Error::Argument`] if the model has no such input, or no sample is asked for; those of
/// [`ContinuousStateSpaceModel::sampled`].
pub(super) fn step_response(
    model: &ContinuousStateSpaceModel,
    pair: (usize, usize),
    samples: Option<usize>,
) -> Result<TransientResponse, Error> {
    let sampled = model.sampled(model.sample_time, Hold::Zero)?;
    state_space::transient(&sampled, pair, samples, |_| 1.0)
}

/// The response of an output to an impulse of area 1 at time 0, from rest, C e^(A (t - delay)) B.
///
/// # Errors
/// As for [`step_response`]; [`Error::Argument`] where the input acts at once.
pub(super) fn impulse_response(
    model: &ContinuousStateSpaceModel,
    (output, input): (usize, usize),
    samples: Option<usize>,
) -> Result<TransientResponse, Error> {
    let inputs = model.inputs.len();
    let Some(signal) = model.inputs.get(input) else {
        return Err(Error::argument("input", format!("there is no input {input}: the model has {inputs}")));
    };
    if samples == Some(0) {
        return Err(Error::argument("samples", "a response has at least one sample"));
    }
    let continuous = model.matrices();
    if continuous.d[(output, input)] != 0.0 {
        return Err(Error::argument(
            "model",
            format!(
                "'{}' acts at once on '{}': in continuous time the response to an impulse is infinite; ask for that to a step, or convert \
                 the model to a sample time",
                signal.name, model.outputs[output].name
            ),
        ));
    }
    let (seconds, delay) = (model.sample_time, model.delays[input]);
    let sampled = continuous.sampled(seconds, Hold::Zero)?;
    // The first sample that sees it, and how long it has been there by then.
    let first = (delay / seconds - 1e-9).ceil().max(0.0) as usize;
    let after = first as f64 * seconds - delay;
    let mut state = continuous.b.column(input).into_owned();
    if after > 1e-9 * seconds {
        state = continuous.sampled(after, Hold::Zero)?.f * state;
    }
    let samples = samples.map_or_else(|| Ok(lasting(first + 1, &sampled.poles()?)), Ok::<usize, Error>)?;
    let mut values = vec![0.0; first.min(samples)];
    while values.len() < samples {
        let value: f64 = continuous.c.row(output).iter().zip(state.iter()).map(|(c, x)| c * x).sum();
        if !value.is_finite() {
            break;
        }
        values.push(value);
        state = &sampled.f * state;
    }
    Ok(TransientResponse {
        input: signal.name.clone(),
        time: (0..values.len()).map(|t| t as f64 * seconds).collect(),
        values: values.into_iter().map(|value| Quantity::new(value, None)).collect(),
    })
}
