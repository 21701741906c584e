//! What a state-space model is to frequencies, steps and impulses.

use thetahat_core::nalgebra::{Complex, ComplexField, DMatrix, DVector, Dyn, LU};

use super::Recursion;
use crate::Error;
use crate::model::{
    EntryCovariance, Gradient, Path, Quantity, StateSpace, StateSpaceMatrix, StateSpaceModel, covariance,
    standard_error,
};
use crate::respond::{
    FrequencyPoint, FrequencyResponse, TransientResponse,
    frequency::{Turns, check_frequencies, has_pole},
    transient::lasting,
};

/// The frequency responses of an output at `frequencies` in radians per second: of each input, and with a single output
/// of its noise.
///
/// ```text
/// H (q I - F)^-1 G + D,   q = exp(i omega T)
/// ```
///
/// by an LU factor at each frequency, O(n^3): the coefficients of transfer functions would lose digits at high orders.
/// Phases are continuous from frequency 0 on, as [`frequency_response`](crate::respond::frequency_response) has them.
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
    let inputs = (0..m).map(|input| (&own, Path { output, input: Some(input) }));
    let noise = noise.iter().map(|noise| (noise, Path { output, input: None }));
    let sources: Vec<(&StateSpace, Path)> = inputs.chain(noise).collect();
    let turns = sources.iter().map(|(space, path)| {
        let transfer = space.transfer(output, path.input.unwrap_or(0))?;
        Ok(Turns::new(transfer.gain, transfer.delay(), transfer.zeros, transfer.poles))
    });
    let turns = turns.collect::<Result<Vec<Turns>, Error>>()?;
    let poles: Vec<Complex<f64>> = model.poles.iter().map(|pole| Complex::new(pole.re, pole.im)).collect();

    let mut found: Vec<Vec<FrequencyPoint>> = vec![Vec::with_capacity(frequencies.len()); sources.len()];
    let seen = h.row(output).transpose();
    for &frequency in frequencies {
        let angle = frequency * model.sample_time;
        let (sine, cosine) = angle.sin_cos();
        let q = Complex::new(cosine, sine);
        if poles.iter().any(|pole| (q - pole).modulus() < 16.0 * f64::EPSILON * (1 + n) as f64) {
            return Err(has_pole(frequency));
        }
        let resolvent = Resolvent::new((f, &seen), q, model.covariance.as_ref());
        let resolvent = resolvent.ok_or_else(|| has_pole(frequency))?;
        for ((points, turns), (space, path)) in found.iter_mut().zip(&turns).zip(&sources) {
            let source = path.input.unwrap_or(0);
            let (enters, direct) = (space.g.column(source), space.d[(output, source)]);
            let one = Complex::new(1.0, 0.0);
            let (response, spread) = resolvent.response(*path, (&enters.into_owned(), direct), one);
            if !response.modulus().is_finite() {
                return Err(has_pole(frequency));
            }
            points.push(FrequencyPoint::new(frequency, response, spread, turns.at(angle)));
        }
    }
    let names = model.inputs.iter().map(|input| Some(input.name.clone())).chain([None]);
    Ok(names.zip(found).map(|(input, points)| FrequencyResponse { input, points }).collect())
}

/// What states do at a point q of the complex plane, seen by an output: w' = h (q I - F)^-1; of equations in continuous
/// time q is s and F is A.
pub(in crate::respond) struct Resolvent<'m> {
    weights: DVector<Complex<f64>>,
    known: Option<&'m EntryCovariance>,
    /// A factor of q I - F, where errors are known.
    forward: Option<LU<Complex<f64>, Dyn, Dyn>>,
}

impl<'m> Resolvent<'m> {
    /// None where q is an eigenvalue. O(n^3).
    pub(in crate::respond) fn new(
        (f, seen): (&DMatrix<f64>, &DVector<f64>),
        at: Complex<f64>,
        known: Option<&'m EntryCovariance>,
    ) -> Option<Self> {
        let n = f.nrows();
        let seen = seen.map(|entry| Complex::new(entry, 0.0));
        if n == 0 {
            return Some(Self { weights: seen, known: None, forward: None });
        }
        let matrix = DMatrix::from_fn(n, n, |row, column| {
            let diagonal = if row == column { at } else { Complex::new(0.0, 0.0) };
            diagonal - f[(row, column)]
        });
        Some(Self {
            weights: matrix.transpose().lu().solve(&seen)?,
            known,
            forward: known.map(|_| matrix.lu()),
        })
    }

    /// (w' g + d) times a factor, and the covariance of its parts.
    pub(in crate::respond) fn response(
        &self,
        path: Path,
        (enters, direct): (&DVector<f64>, f64),
        factor: Complex<f64>,
    ) -> (Complex<f64>, Option<[[f64; 2]; 2]>) {
        let enters = enters.map(|entry| Complex::new(entry, 0.0));
        let response = (self.weights.dot(&enters) + direct) * factor;
        let spread = self.known.zip(self.forward.as_ref()).and_then(|(known, forward)| {
            let states = forward.solve(&enters)?;
            let gradient = known.gradient(|entry| path.slope(entry, &self.weights, &states) * factor);
            covariance(&known.values, &gradient)
        });
        (response, spread)
    }
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
    let matrices = model.matrices();
    let mut simulator = Recursion::simulator(&matrices);
    let mut slopes = model
        .covariance
        .as_ref()
        .map(|known| Slopes::new(&matrices, known, Path { output, input: Some(input) }));
    let mut values = Vec::with_capacity(samples);
    for (row, source) in source.iter().enumerate() {
        let error = slopes.as_mut().and_then(|slopes| slopes.step(simulator.state(), *source));
        let value = simulator.step(&signals, row)[output];
        if !value.is_finite() {
            break;
        }
        values.push(Quantity::new(value, error));
    }
    Ok(TransientResponse {
        input: signal.name.clone(),
        time: (0..values.len()).map(|t| t as f64 * model.sample_time).collect(),
        values,
    })
}

/// How a response moves with the free entries of a model: with the states X of their slopes
///
/// ```text
/// X(t+1) = F X(t) + dF x(t) + dG u(t),   dy = H X(t) + dH x(t) + dD u(t)
/// ```
struct Slopes<'m> {
    model: &'m StateSpace,
    known: &'m EntryCovariance,
    path: Path,
    /// X, a column for each entry.
    states: DMatrix<f64>,
    next: DMatrix<f64>,
}

impl<'m> Slopes<'m> {
    fn new(model: &'m StateSpace, known: &'m EntryCovariance, path: Path) -> Self {
        let states = DMatrix::zeros(model.f.nrows(), known.entries.len());
        Self { model, known, path, next: states.clone(), states }
    }

    /// The standard error of the output of a state and the source, before the next step. O(n^2 r + r^2) for r entries.
    fn step(&mut self, state: &[f64], source: f64) -> Option<f64> {
        let StateSpace { f, h, .. } = self.model;
        let Path { output, input } = self.path;
        let through = h.row(output) * &self.states;
        let direct = |matrix: StateSpaceMatrix, row: usize, column: usize| match matrix {
            StateSpaceMatrix::H if row == output => state[column],
            StateSpaceMatrix::D if row == output && Some(column) == input => source,
            _ => 0.0,
        };
        let all = self.known.entries.iter().zip(through.iter());
        let gradient: Gradient = all
            .map(|(entry, through)| through + direct(entry.matrix, entry.row, entry.column))
            .map(|slope| Complex::new(slope, 0.0))
            .enumerate()
            .collect();
        self.next.gemm(1.0, f, &self.states, 0.0);
        for (place, entry) in self.known.entries.iter().enumerate() {
            self.next[(entry.row, place)] += match entry.matrix {
                StateSpaceMatrix::F => state[entry.column],
                StateSpaceMatrix::G if Some(entry.column) == input => source,
                _ => continue,
            };
        }
        std::mem::swap(&mut self.states, &mut self.next);
        standard_error(Some(&self.known.values), &gradient)
    }
}
