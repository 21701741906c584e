//! What a state-space model is to frequencies, steps and impulses.

use thetahat_core::nalgebra::{Complex, ComplexField, DMatrix, DVector};

use super::Recursion;
use crate::Error;
use crate::model::{Quantity, StateSpace, StateSpaceModel};
use crate::respond::{
    FrequencyPoint, FrequencyResponse, TransientResponse,
    frequency::{Turns, check_frequencies, has_pole},
    transient::lasting,
};

/// The frequency responses of an output at `frequencies` in radians per second: of each input, and with a single output of its noise.
///
/// ```text
/// H (q I - F)^-1 G + D,   q = exp(i omega T)
/// ```
///
/// by an LU factor at each frequency, O(n^3): the coefficients of transfer functions would lose digits at high orders. Phases are continuous
/// from frequency 0 on, as [`frequency_response`](crate::respond::frequency_response) has them.
///
/// # Errors
/// As for [`frequency_response`](crate::respond::frequency_response).
pub(crate) fn frequency_response(
    model: &StateSpaceModel,
    output: usize,
    frequencies: &[f64],
) -> Result<Vec<FrequencyResponse>, Error> {
    check_frequencies(frequencies, model.sample_time)?;
    let own = model.matrices();
    let StateSpace { f, g, h, k, .. } = &own;
    let (n, m) = g.shape();
    // e acts as an input does: at once on its own output, and through K.
    let noise =
        (h.nrows() == 1).then(|| StateSpace { g: k.clone(), d: DMatrix::identity(1, 1), ..own.clone() });
    let inputs = (0..m).map(|input| (&own, input));
    let sources: Vec<(&StateSpace, usize)> = inputs.chain(noise.iter().map(|noise| (noise, 0))).collect();
    let turns = sources.iter().map(|(space, source)| {
        let transfer = space.transfer(output, *source)?;
        Ok(Turns::new(transfer.gain, transfer.delay(), transfer.zeros, transfer.poles))
    });
    let turns = turns.collect::<Result<Vec<Turns>, Error>>()?;
    let poles: Vec<Complex<f64>> = model.poles.iter().map(|pole| Complex::new(pole.re, pole.im)).collect();

    let mut found: Vec<Vec<FrequencyPoint>> = vec![Vec::with_capacity(frequencies.len()); sources.len()];
    let seen: DVector<Complex<f64>> = h.row(output).transpose().map(|entry| Complex::new(entry, 0.0));
    for &frequency in frequencies {
        let angle = frequency * model.sample_time;
        let (sine, cosine) = angle.sin_cos();
        let q = Complex::new(cosine, sine);
        if poles.iter().any(|pole| (q - pole).modulus() < 16.0 * f64::EPSILON * (1 + n) as f64) {
            return Err(has_pole(frequency));
        }
        // (q I - F)' w = H'.
        let matrix = DMatrix::from_fn(n, n, |row, column| {
            let diagonal = if row == column { q } else { Complex::new(0.0, 0.0) };
            diagonal - f[(column, row)]
        });
        let solved = if n == 0 { Some(seen.clone()) } else { matrix.lu().solve(&seen) };
        let through = solved.ok_or_else(|| has_pole(frequency))?;
        for ((points, turns), (space, source)) in found.iter_mut().zip(&turns).zip(&sources) {
            let enters = space.g.column(*source);
            let path = through.iter().zip(enters.iter());
            let response: Complex<f64> = path.map(|(weight, entry)| weight * *entry).sum();
            let response = response + space.d[(output, *source)];
            if !response.modulus().is_finite() {
                return Err(has_pole(frequency));
            }
            points.push(FrequencyPoint::new(frequency, response, None, turns.at(angle)));
        }
    }
    let names = model.inputs.iter().map(|input| Some(input.name.clone())).chain([None]);
    Ok(names.zip(found).map(|(input, points)| FrequencyResponse { input, points }).collect())
}

/// The response of an output to what an input does from time 0 on, from rest. O(n (n + l)) for each sample.
///
/// # Errors
/// [`Error::Argument`] if the model has no such input, or no sample is asked for.
pub(crate) fn transient(
    model: &StateSpaceModel,
    (output, input): (usize, usize),
    samples: Option<usize>,
    happens: impl Fn(usize) -> f64,
) -> Result<TransientResponse, Error> {
    let inputs = model.inputs.len();
    let Some(signal) = model.inputs.get(input) else {
        return Err(Error::argument("input", format!("there is no input {input}: the model has {inputs}")));
    };
    if samples == Some(0) {
        return Err(Error::argument("samples", "a response has at least one sample"));
    }
    let poles: Vec<Complex<f64>> = model.poles.iter().map(|pole| Complex::new(pole.re, pole.im)).collect();
    let delay = model.delays.get(input).copied().unwrap_or(0);
    let samples = samples.unwrap_or_else(|| lasting(delay + 1, &poles));
    let source: Vec<f64> = (0..samples).map(happens).collect();
    let still = vec![0.0; samples];
    let signals: Vec<&[f64]> =
        (0..inputs).map(|other| if other == input { &*source } else { &*still }).collect();
    let mut simulator = Recursion::simulator(&model.matrices());
    let values = (0..samples).map(|row| simulator.step(&signals, row)[output]);
    let values: Vec<Quantity> =
        values.take_while(|value| value.is_finite()).map(|value| Quantity::new(value, None)).collect();
    Ok(TransientResponse {
        input: signal.name.clone(),
        time: (0..values.len()).map(|t| t as f64 * model.sample_time).collect(),
        values,
    })
}
