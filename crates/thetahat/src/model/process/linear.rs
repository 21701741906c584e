//! What a process is to an input that is held between samples: polynomials.
//!
//! With T the sample time and a dead time theta = m T - p, m whole and 0 <= p < T, the output at a sample is that p
//! seconds after the sample m before:
//!
//! ```text
//! x(k+1) = F x(k) + G u(k),   y(k) = w'(C (F_p x(k-m) + G_p u(k-m)) + D u(k-m)),   F = e^(A T),  F_p = e^(A p)
//! ```
//!
//! (Åström and Wittenmark, Computer-Controlled Systems, 3rd ed. 1997, section 2.3). The polynomials follow by Faddeev
//! and Le Verrier's recursion (Gantmacher, The Theory of Matrices, 1959, chapter IV, section 5), in dual numbers, which
//! give their covariance.

use thetahat_core::{Dual, Number};

use super::ProcessModel;
use super::chain::MOST_STATES;
use super::structure::{MOST_PARAMETERS, ProcessStructure};
use crate::Error;
use crate::model::{Orders, PolynomialModel, fitted::propagated};

/// Derivatives that are computed together.
const LANE: usize = MOST_PARAMETERS;
/// A dead time is no longer than so many samples.
const MOST_SAMPLES: f64 = 1e5;

/// F less its first 1, then B from the power nk on.
struct Transfer<S> {
    f: Vec<S>,
    b: Vec<S>,
    nk: usize,
}

impl ProcessModel {
    /// The polynomials from all inputs to the output, y = sum B_j/F_j u_j + e.
    ///
    /// # Errors
    /// [`Error::Data`] if a dead time is more than 10^5 samples.
    pub(crate) fn linear(&self) -> Result<PolynomialModel, Error> {
        let mut transfers = Vec::new();
        for (structure, parameters) in self.structures.iter().zip(self.of_inputs()) {
            let mut variables = [Dual::from(0.0); LANE];
            let mut values = [0.0; LANE];
            values.iter_mut().zip(parameters).for_each(|(value, parameter)| *value = parameter.value);
            variables.copy_from_slice(&Dual::<f64, LANE>::variables(values));
            transfers.push(transfer(structure, &variables[..parameters.len()], self.sample_time)?);
        }
        let lengths: Vec<usize> = transfers.iter().map(|own| own.b.len()).collect();
        let denominators: Vec<usize> = transfers.iter().map(|own| own.f.len()).collect();
        let delays: Vec<usize> = transfers.iter().map(|own| own.nk).collect();
        let orders = Orders::oe(&lengths, &denominators, &delays)?;
        // All b of all inputs, then all f, each with the place of the first parameter of its input.
        let mut first = 0;
        let mut places = Vec::new();
        for structure in &self.structures {
            places.push(first);
            first += structure.parameters();
        }
        let numerators =
            transfers.iter().zip(&places).flat_map(|(own, place)| own.b.iter().map(|b| (*b, *place)));
        let denominators =
            transfers.iter().zip(&places).flat_map(|(own, place)| own.f.iter().map(|f| (*f, *place)));
        let coefficients: Vec<(Dual<f64, LANE>, usize)> = numerators.chain(denominators).collect();
        let values: Vec<f64> = coefficients.iter().map(|(coefficient, _)| coefficient.value).collect();
        let count = self.parameters.len();
        let slopes: Vec<Vec<f64>> = coefficients
            .iter()
            .map(|(coefficient, place)| {
                let mut slopes = vec![0.0; count];
                slopes[*place..]
                    .iter_mut()
                    .zip(coefficient.derivatives)
                    .for_each(|(slope, own)| *slope = own);
                slopes
            })
            .collect();
        let covariance = propagated(&slopes, self.covariance.as_deref());
        let model = PolynomialModel::from_parameters(
            &orders,
            &values,
            covariance.as_deref(),
            self.noise_variance,
            self.sample_time,
        )?
        .with_degrees_of_freedom(self.degrees_of_freedom)?;
        Ok(PolynomialModel { inputs: self.inputs.clone(), output: self.output.clone(), ..model })
    }
}

/// B/F of an input that is held for `time` seconds.
fn transfer<S: Number<f64>>(
    structure: &ProcessStructure,
    parameters: &[S],
    time: f64,
) -> Result<Transfer<S>, Error> {
    let parts = structure.taken_apart(parameters);
    let chain = structure.chain(&parts.shape);
    let (n, zero) = (chain.states(), S::from(0.0));
    let samples = (parts.dead_time.value() / time).ceil();
    if samples > MOST_SAMPLES {
        return Err(Error::data(format!(
            "a dead time of {samples} samples is more than {MOST_SAMPLES} as polynomials have them; give a longer sample time"
        )));
    }
    let delay = samples as usize;
    let ahead = S::from(samples * time) - parts.dead_time;
    let (whole, part) = (chain.transition(time.into()), chain.transition(ahead));
    // w'C of a state and an input.
    let seen = |state: &[S; MOST_STATES], u: f64| {
        let columns = chain.columns(state, u);
        parts.weights.iter().zip(columns).fold(zero, |sum, (weight, column)| sum + *weight * column)
    };
    let unit = |index: usize| {
        let mut state = [zero; MOST_STATES];
        state[index] = 1.0.into();
        state
    };
    let h: Vec<S> = (0..n).map(|index| seen(&part.apply(&unit(index), 0.0), 0.0)).collect();
    let direct = seen(&part.apply(&[zero; MOST_STATES], 1.0), 1.0);
    let g = whole.apply(&[zero; MOST_STATES], 1.0);
    let mut adjoint = [[zero; MOST_STATES]; MOST_STATES];
    (0..n).for_each(|index| adjoint[index][index] = 1.0.into());
    let (mut f, mut b) = (Vec::with_capacity(n), vec![direct]);
    for k in 1..=n {
        let mut own = zero;
        for (row, weight) in h.iter().enumerate() {
            (0..n).for_each(|column| own += *weight * adjoint[row][column] * g[column]);
        }
        let mut next = [[zero; MOST_STATES]; MOST_STATES];
        for (row, next) in next.iter_mut().enumerate().take(n) {
            for (column, entry) in next.iter_mut().enumerate().take(n) {
                (0..n).for_each(|i| *entry += whole.entry(row, i) * adjoint[i][column]);
            }
        }
        let trace = (0..n).fold(zero, |sum, index| sum + next[index][index]);
        let coefficient = -(trace * (1.0 / k as f64));
        (0..n).for_each(|index| next[index][index] += coefficient);
        adjoint = next;
        b.push(own + direct * coefficient);
        f.push(coefficient);
    }
    let waits = !structure.acts_at_once() && ahead.value() == 0.0;
    if waits {
        b.remove(0);
    }
    Ok(Transfer { f, b, nk: delay + usize::from(waits) })
}
