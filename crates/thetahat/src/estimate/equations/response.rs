//! The likelihood of the points of a measured frequency response:
//!
//! ```text
//! V(p) = 1/2 sum over points and parts (e^2/v + ln 2 pi v),   e = Re (G_k - G(omega_k, p)), or Im
//! V_i = sum e e_i/v,   I_ij = sum e_i e_j/v
//! ```
//!
//! with the variance v of each point, independent in its two parts, which does not depend on the parameters: that is
//! the estimator of least squares, weighted. Source: Pintelon and Schoukens, System Identification: A Frequency Domain
//! Approach, 2nd ed. 2012, section 9.11.

use std::f64::consts::TAU;

use thetahat_core::{Dual, Number};

use super::likelihood::{LANE, Likelihood, Slopes};
use crate::model::equations::Work;
use crate::model::{Complex, GreyBox};
use crate::respond::Correlation;
use crate::respond::equations::{Failure, response};

/// A point of the response from an input of the model to an output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct EquationsPoint {
    /// Which channels.
    pub(crate) input: usize,
    pub(crate) output: usize,
    /// In rad/s.
    pub(crate) frequency: f64,
    pub(crate) re: f64,
    pub(crate) im: f64,
    /// That of the real part, and of the imaginary part.
    pub(crate) variance: f64,
}

/// Points that are fitted to.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct EquationsResponse {
    pub(crate) points: Vec<EquationsPoint>,
    /// For how many seconds inputs are held; none of sines in continuous time.
    pub(crate) held: Option<f64>,
    /// How the errors of the points from an input are correlated.
    pub(crate) correlation: Correlation,
}

/// V of a model on a measured response.
#[derive(Debug)]
pub(crate) struct ResponseLikelihood<'a> {
    model: &'a GreyBox,
    measured: &'a EquationsResponse,
    slopes: Slopes,
}

impl<'a> ResponseLikelihood<'a> {
    pub(crate) fn new(model: &'a GreyBox, measured: &'a EquationsResponse) -> Self {
        Self { model, measured, slopes: Slopes::zero(model.parameters().len()) }
    }

    /// Calls `take` for each point with the errors of its two parts.
    fn errors<S: Number<f64>>(
        &self,
        z: &[S],
        mut take: impl FnMut(usize, &EquationsPoint, [S; 2]),
    ) -> Result<(), Failure> {
        let held = self.measured.held;
        let system = self.model.linearized(z, held, &mut Work::new());
        let inputs = self.model.inputs().len();
        for (row, point) in self.measured.points.iter().enumerate() {
            let found = response(&system, point.output, inputs, point.frequency, held);
            let Complex { re, im } = found[point.input];
            if !(re.value().is_finite() && im.value().is_finite()) {
                return Err(Failure { log: 0, row });
            }
            take(row, point, [-(re - point.re), -(im - point.im)]);
        }
        Ok(())
    }
}

/// The two errors of each point in its standard deviations, and their slopes by each parameter, point after point.
type Linear = (Vec<[f64; 2]>, Vec<[f64; 2]>);

impl ResponseLikelihood<'_> {
    fn linear(&self, z: &[f64]) -> Result<Linear, Failure> {
        let (size, rows) = (z.len(), self.measured.points.len());
        let (mut left, mut by_parameter) = (vec![[0.0; 2]; rows], vec![[0.0; 2]; rows * size]);
        for first in (0..size).step_by(LANE) {
            let mut variables: Vec<Dual<f64, LANE>> = z.iter().map(|z| Dual::from(*z)).collect();
            let own = first..size.min(first + LANE);
            own.clone().enumerate().for_each(|(place, index)| variables[index].derivatives[place] = 1.0);
            self.errors(&variables, |row, point, errors| {
                let scale = 1.0 / point.variance.sqrt();
                left[row] = errors.map(|error| scale * error.value);
                for (place, index) in own.clone().enumerate() {
                    by_parameter[row * size + index] = errors.map(|error| scale * error.derivatives[place]);
                }
            })?;
        }
        Ok((left, by_parameter))
    }

    /// What stands for the information between its inverses where errors are correlated, the sum of rho e_i e_j/v over
    /// pairs of points of an input, row by row: see [`Correlation::spread`].
    pub(crate) fn spread(&self, z: &[f64]) -> Result<Vec<f64>, Failure> {
        let size = z.len();
        let (_, by_parameter) = self.linear(z)?;
        let mut sum = vec![0.0; size * size];
        for input in 0..self.model.inputs().len() {
            let own = || self.measured.points.iter().enumerate().filter(|(_, point)| point.input == input);
            let frequencies: Vec<f64> = own().map(|(_, point)| point.frequency).collect();
            let slopes: Vec<[f64; 2]> = own()
                .flat_map(|(row, _)| by_parameter[row * size..(row + 1) * size].iter().copied())
                .collect();
            let spread = self.measured.correlation.spread(&frequencies, &slopes, size);
            sum.iter_mut().zip(spread).for_each(|(sum, own)| *sum += own);
        }
        Ok(sum)
    }
}

impl Likelihood for ResponseLikelihood<'_> {
    fn measurements(&self) -> usize {
        2 * self.measured.points.len()
    }

    /// V. O(N n^3).
    fn evaluate(&mut self, z: &[f64]) -> Result<f64, Failure> {
        let mut sum = 0.0;
        self.errors(z, |_, point, errors| {
            sum += errors
                .map(|error| error * error / point.variance + (TAU * point.variance).ln())
                .iter()
                .sum::<f64>();
        })?;
        Ok(sum / 2.0)
    }

    fn linearize(&mut self, z: &[f64]) -> Result<(), Failure> {
        let size = z.len();
        let (left, by_parameter) = self.linear(z)?;
        let mut slopes = Slopes::zero(size);
        for (row, (errors, own)) in left.iter().zip(by_parameter.chunks_exact(size.max(1))).enumerate() {
            for (part, error) in errors.iter().enumerate() {
                slopes.squares += error * error;
                for i in 0..size {
                    slopes.gradient[i] += error * own[i][part];
                    for j in 0..size {
                        slopes.information[i * size + j] += own[i][part] * own[j][part];
                    }
                }
            }
            if !slopes.is_finite() {
                return Err(Failure { log: 0, row });
            }
        }
        self.slopes = slopes;
        Ok(())
    }

    fn slopes(&self) -> &Slopes {
        &self.slopes
    }
}
