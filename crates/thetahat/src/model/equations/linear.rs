//! What linear equations are to their inputs: transfer functions.
//!
//! ```text
//! x(k+1) = F x + G u + c,   y = H x + D u + d
//! y = (H (q I - F)^-1 G + D) u + constants = (B(q)/A(q)) u + constants
//! ```
//!
//! A is the characteristic polynomial of F, by Faddeev and Le Verrier's recursion (Gantmacher, The Theory of Matrices,
//! 1959, chapter IV, section 5), which gives the adjoint of q I - F with it:
//!
//! ```text
//! M_1 = I,   a_k = -tr(F M_k)/k,   M_(k+1) = F M_k + a_k I
//! A = 1 + sum a_k q^-k,   B = D A + sum (H M_k G) q^-k
//! ```
//!
//! In dual numbers the same operations give the derivatives by the parameters, and with them the covariance of A and B.
//! The recursion loses digits for many states, about one for each from ten on.

use thetahat_core::{Dual, Number};

use super::{Drive, EquationsModel, GreyBox, Work};
use crate::Error;
use crate::model::{Orders, PolynomialModel, fitted::propagated};

/// Derivatives that are computed together.
const LANE: usize = 4;

/// A, and B of each input, of one output: a_1 … a_n, then b_0 … b_n of each.
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
        if model.longest_delay().is_some() || !model.linear_holds().is_empty() {
            return Err(Error::argument(
                "model",
                format!(
                    "{what} is of inputs that are held from row to row and act without delay, and these equations say otherwise of an \
                     input: they predict, simulate, validate, compare and filter"
                ),
            ));
        }
        let plain = coefficients(&model, &z);
        let size = z.len();
        // By the parameters in their own units.
        let mut slopes = vec![vec![0.0; size]; plain.iter().map(Vec::len).sum()];
        for first in (0..size).step_by(LANE) {
            let mut variables: Vec<Dual<f64, LANE>> = z.iter().map(|z| Dual::from(*z)).collect();
            let own = first..size.min(first + LANE);
            own.clone().enumerate().for_each(|(place, index)| variables[index].derivatives[place] = 1.0);
            for (found, slopes) in coefficients(&model, &variables).iter().flatten().zip(&mut slopes) {
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
            let (values, slopes, orders) = self.arranged(values, slopes)?;
            let covariance = propagated(&slopes, self.covariance.as_deref());
            let variance = self.noise_covariance[index][index];
            let time = self.sample_time;
            let model =
                PolynomialModel::from_parameters(&orders, &values, covariance.as_deref(), variance, time)?;
            Ok(PolynomialModel { inputs: self.inputs.clone(), output: output.clone(), ..model })
        });
        each.collect()
    }

    /// The same without a b_0 that is zero whatever the parameters, and the orders that are left.
    #[expect(clippy::type_complexity, reason = "values and slopes as they came, and orders")]
    fn arranged(
        &self,
        values: Vec<f64>,
        slopes: Vec<Vec<f64>>,
    ) -> Result<(Vec<f64>, Vec<Vec<f64>>, Orders), Error> {
        let (n, inputs) = (self.states.len(), self.inputs.len());
        let at_once: Vec<usize> = (0..inputs).map(|input| n + input * (n + 1)).collect();
        let is_nothing =
            |place: &usize| values[*place] == 0.0 && slopes[*place].iter().all(|slope| *slope == 0.0);
        let out: Vec<usize> = at_once.iter().filter(|place| is_nothing(place)).copied().collect();
        let delays: Vec<usize> = at_once.iter().map(|place| usize::from(out.contains(place))).collect();
        let lengths: Vec<usize> = delays.iter().map(|delay| n + 1 - delay).collect();
        let orders = Orders::arx(n, &lengths, &delays)?;
        let kept = |place: &usize| !out.contains(place);
        let places: Vec<usize> = (0..values.len()).filter(kept).collect();
        let slopes = places.iter().map(|&place| slopes[place].clone()).collect();
        Ok((places.iter().map(|&place| values[place]).collect(), slopes, orders))
    }
}

/// Those of each output. O(n^4 + n^3 (m + inputs)).
fn coefficients<S: Number<f64>>(model: &GreyBox, z: &[S]) -> Vec<Coefficients<S>> {
    let (n, m, inputs) = (model.states().len(), model.outputs().len(), model.inputs().len());
    let zero: S = 0.0.into();
    let mut work = Work::new();
    let origin = vec![zero; n];
    // F and H, column after column, and what u does beside what stands without it.
    let mut at = |u: &[f64]| {
        let (mut next, mut f) = (vec![zero; n], vec![zero; n * n]);
        let (mut y, mut h) = (vec![zero; m], vec![zero; m * n]);
        let u = Drive::held(u);
        model.advance(&origin, z, u, 0.0, model.sample_time(), &mut next, &mut f, &mut work);
        model.observe(&origin, z, u, 0.0, &mut y, &mut h, &mut work);
        (next, f, y, h)
    };
    let mut u = vec![0.0; inputs];
    let (next, f, y, h) = at(&u);
    let (mut g, mut d) = (Vec::new(), Vec::new());
    for input in 0..inputs {
        u[input] = 1.0;
        let (moved, _, seen, _) = at(&u);
        u[input] = 0.0;
        g.push(moved.iter().zip(&next).map(|(&moved, &next)| moved - next).collect::<Vec<S>>());
        d.push(seen.iter().zip(&y).map(|(&seen, &y)| seen - y).collect::<Vec<S>>());
    }
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
    let mut found: Vec<Coefficients<S>> = vec![vec![zero; n + inputs * (n + 1)]; m];
    let mut adjoint = vec![zero; n * n];
    (0..n).for_each(|index| adjoint[index * n + index] = 1.0.into());
    for k in 1..=n {
        for (output, found) in found.iter_mut().enumerate() {
            for (input, g) in g.iter().enumerate() {
                let mut sum = zero;
                for column in 0..n {
                    for row in 0..n {
                        sum += h[row * m + output] * adjoint[column * n + row] * g[column];
                    }
                }
                found[n + input * (n + 1) + k] = sum;
            }
        }
        adjoint = times(&f, &adjoint);
        let trace = (0..n).fold(zero, |sum, index| sum + adjoint[index * n + index]);
        let a = -(trace * (1.0 / k as f64));
        (0..n).for_each(|index| adjoint[index * n + index] += a);
        found.iter_mut().for_each(|found| found[k - 1] = a);
    }
    for (output, found) in found.iter_mut().enumerate() {
        for (input, d) in d.iter().enumerate() {
            let first = n + input * (n + 1);
            found[first] = d[output];
            for k in 1..=n {
                let a = found[k - 1];
                found[first + k] += d[output] * a;
            }
        }
    }
    found
}
