//! What linear equations are to their inputs: transfer functions.
//!
//! ```text
//! x(k+1) = A x + sum_e B_e v_e + E_e (q - 1) v_e + c,   y = C x + sum_e D_e v_e + d
//! ```
//!
//! where e are the ways by which inputs come in, each with its delay of m - f samples, v_e = q^-m (1 - f + f q) u
//! ([`Linearized`]; E_e is of inputs that go in lines). So y = sum_e N_e(q)/A(q) v_e + constants, where A(q) is the
//! characteristic polynomial of A, by Faddeev and Le Verrier's recursion (Gantmacher, The Theory of Matrices, 1959,
//! chapter IV, section 5), which gives the adjoint of q I - A with it:
//!
//! ```text
//! M_1 = I,   a_k = -tr(A M_k)/k,   M_(k+1) = A M_k + a_k I,   A(q) = 1 + sum a_k q^-k
//! N_e = D_e A(q) + sum_k C M_k (B_e - E_e) q^-k + C M_k E_e q^-(k-1)
//! ```
//!
//! In dual numbers the same operations give the derivatives by the parameters, and with them the covariance of A and B.
//! The recursion loses digits for many states, about one for each from ten on.

use thetahat_core::{Dual, Number};

use super::{EquationsModel, GreyBox, Linearized, Work};
use crate::Error;
use crate::model::{LARGEST, Orders, PolynomialModel, fitted::propagated};

/// Derivatives that are computed together.
const LANE: usize = 4;

/// A, and B of each input, of one output: a_1 … a_n, then b_0 … b_(n + l) of each, the last of which is l samples late.
type Coefficients<S> = Vec<S>;

impl EquationsModel {
    /// The model of polynomials from all inputs to each output: A y = B u, whatever the noise.
    ///
    /// # Errors
    /// [`Error::Argument`] if the equations are not linear in states and inputs, or know the time; `what` needs them to
    /// be.
    pub(crate) fn linear(&self, what: &str) -> Result<Vec<PolynomialModel>, Error> {
        let (model, z) = self.with_variables()?;
        if !model.superposes() {
            return Err(Error::argument(
                "model",
                format!(
                    "{what} is of linear models, and these equations are not linear in their states and inputs, or know the time: \
                     they predict, simulate, validate, compare and filter"
                ),
            ));
        }
        let lines = model.linear_holds().iter().zip(model.delays()).zip(&self.inputs);
        if let Some((_, input)) = lines.into_iter().find(|((line, delay), _)| **line && delay.is_some()) {
            return Err(Error::argument(
                "model",
                format!(
                    "{what} is of inputs that go in lines or act later, and '{}' does both: the equations predict, simulate, \
                     validate, compare and filter",
                    input.name
                ),
            ));
        }
        let (late, plain) = coefficients(&model, &z)?;
        let size = z.len();
        // By the parameters in their own units.
        let mut slopes = vec![vec![0.0; size]; plain.iter().map(Vec::len).sum()];
        for first in (0..size).step_by(LANE) {
            let mut variables: Vec<Dual<f64, LANE>> = z.iter().map(|z| Dual::from(*z)).collect();
            let own = first..size.min(first + LANE);
            own.clone().enumerate().for_each(|(place, index)| variables[index].derivatives[place] = 1.0);
            for (found, slopes) in coefficients(&model, &variables)?.1.iter().flatten().zip(&mut slopes) {
                for (place, index) in own.clone().enumerate() {
                    let scale = model.parameters()[index].scale.slope(z[index]);
                    slopes[index] = found.derivatives[place] / scale;
                }
            }
        }
        let mut slopes = slopes.into_iter();
        let outputs = plain.into_iter().zip(&self.outputs).enumerate();
        let each = outputs.map(|(index, (values, output))| {
            let slopes: Vec<Vec<f64>> = slopes.by_ref().take(values.len()).collect();
            let (values, slopes, orders) = self.arranged(&late, values, slopes)?;
            let covariance = propagated(&slopes, self.covariance.as_deref());
            let variance = self.noise_covariance[index][index];
            let time = self.sample_time;
            let model =
                PolynomialModel::from_parameters(&orders, &values, covariance.as_deref(), variance, time)?;
            Ok(PolynomialModel { inputs: self.inputs.clone(), output: output.clone(), ..model })
        });
        each.collect()
    }

    /// The same without the first b that are zero whatever the parameters, and the orders that are left.
    #[expect(clippy::type_complexity, reason = "values and slopes as they came, and orders")]
    fn arranged(
        &self,
        late: &[usize],
        values: Vec<f64>,
        slopes: Vec<Vec<f64>>,
    ) -> Result<(Vec<f64>, Vec<Vec<f64>>, Orders), Error> {
        let n = self.states.len();
        let is_nothing =
            |place: usize| values[place] == 0.0 && slopes[place].iter().all(|slope| *slope == 0.0);
        let (mut kept, mut lengths, mut delays) = ((0..n).collect::<Vec<_>>(), Vec::new(), Vec::new());
        let mut end = n;
        for late in late {
            let (first, last) = (end, end + n + late);
            end = last + 1;
            let begin = (first..last).find(|place| !is_nothing(*place)).unwrap_or(last);
            kept.extend(begin..end);
            lengths.push(end - begin);
            delays.push(begin - first);
        }
        let orders = Orders::arx(n, &lengths, &delays)?;
        let slopes = kept.iter().map(|&place| slopes[place].clone()).collect();
        Ok((kept.iter().map(|&place| values[place]).collect(), slopes, orders))
    }
}

/// By how many samples the last of each input is late, and the coefficients of each output. O(n^4 + n^3 m e) for e ways
/// by which inputs come in.
///
/// # Errors
/// [`Error::Argument`] for a delay of more samples than an order may have.
fn coefficients<S: Number<f64>>(
    model: &GreyBox,
    z: &[S],
) -> Result<(Vec<usize>, Vec<Coefficients<S>>), Error> {
    let (n, m, inputs) = (model.states().len(), model.outputs().len(), model.inputs().len());
    let (zero, time): (S, f64) = (0.0.into(), model.sample_time());
    let Linearized { a: matrix, c, entrances } = model.linearized(z, Some(time), &mut Work::new());
    let times = |left: &[S], right: &[S]| -> Vec<S> {
        let mut product = vec![zero; n * n];
        for column in 0..n {
            for k in 0..n {
                for row in 0..n {
                    product[column * n + row] += left[k * n + row] * right[column * n + k];
                }
            }
        }
        product
    };
    let diagonal = |matrix: &mut [S], value: S| {
        matrix.iter_mut().step_by(n + 1).for_each(|entry| *entry += value);
    };
    let mut adjoints = vec![vec![zero; n * n]];
    diagonal(&mut adjoints[0], 1.0.into());
    let mut polynomial: Vec<S> = Vec::with_capacity(n);
    for k in 1..=n {
        let mut next = times(&matrix, &adjoints[k - 1]);
        let trace = next.iter().step_by(n + 1).fold(zero, |sum, &entry| sum + entry);
        polynomial.push(-(trace * (1.0 / k as f64)));
        diagonal(&mut next, polynomial[k - 1]);
        adjoints.push(next);
    }
    // Row `output` of C, times M_k, times a column.
    let seen = |output: usize, k: usize, column: &[S]| -> S {
        let mut sum = zero;
        for (adjoint, &weight) in adjoints[k - 1].chunks_exact(n).zip(column) {
            for (row, &entry) in adjoint.iter().enumerate() {
                sum += c[row * m + output] * entry * weight;
            }
        }
        sum
    };
    let mut late = vec![0; inputs];
    for own in &entrances {
        late[own.input] = late[own.input].max(own.late(time).0);
    }
    if let Some(place) = late.iter().position(|&late| late > LARGEST) {
        let (name, samples) = (&model.inputs()[place], late[place]);
        return Err(Error::argument(
            "model",
            format!("'{name}' acts {samples} samples later, and {LARGEST} is the most of polynomials"),
        ));
    }
    let firsts: Vec<usize> =
        (0..inputs).map(|input| n + late[..input].iter().map(|late| n + 1 + late).sum::<usize>()).collect();
    let length = n + late.iter().map(|late| n + 1 + late).sum::<usize>();
    let found = (0..m).map(|output| {
        let mut found = vec![zero; length];
        found[..n].copy_from_slice(&polynomial);
        for own in &entrances {
            let mut numerator = vec![own.d[output]];
            numerator.extend(polynomial.iter().map(|&a| own.d[output] * a));
            for k in 1..=n {
                numerator[k] += seen(output, k, &own.b);
                if !own.bend.is_empty() {
                    let bent = seen(output, k, &own.bend);
                    numerator[k] += -bent;
                    numerator[k - 1] += bent;
                }
            }
            let (samples, part) = own.late(time);
            for (place, &entry) in (firsts[own.input] + samples..).zip(&numerator) {
                found[place] += entry * (-part + 1.0);
                if samples > 0 {
                    found[place - 1] += entry * part;
                }
            }
        }
        found
    });
    let found = found.collect();
    Ok((late, found))
}
