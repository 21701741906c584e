//! Networks with one hidden layer: units that bend across a direction of the regressors.

use super::Basis;
use crate::error::check_length;
use crate::{Error, Real};

/// What a unit of a [`Network`] makes of its sum.
///
/// ```
/// use thetahat_core::Activation;
///
/// // The value and the slope.
/// assert_eq!(Activation::Relu.at(2.0), (2.0, 1.0));
/// assert_eq!(Activation::Logistic.at(0.0), (0.5, 0.25));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activation {
    /// tanh a.
    Tanh,
    /// 1/(1 + exp(-a)).
    Logistic,
    /// a where it is positive, else 0: beside a linear path a hinge (Breiman 1993).
    Relu,
    /// 1 where a is not negative, else 0. Its slope is 0 everywhere.
    Step,
}

impl Activation {
    /// f(a) and df/da.
    #[inline]
    pub fn at<T: Real>(self, sum: T) -> (T, T) {
        let (zero, one) = (T::zero(), T::one());
        match self {
            Activation::Tanh => {
                let value = sum.hyperbolic_tangent();
                (value, one - value * value)
            }
            Activation::Logistic => {
                let half = one / (one + one);
                let value = half + half * (half * sum).hyperbolic_tangent();
                (value, value * (one - value))
            }
            Activation::Relu if sum > zero => (sum, one),
            Activation::Step if sum >= zero => (one, zero),
            Activation::Relu | Activation::Step if sum <= zero => (zero, zero),
            // What is no number stays none.
            Activation::Relu | Activation::Step => (sum, zero),
        }
    }
}

/// A network with one hidden layer beside a linear path: 1, each regressor, and for each unit
///
/// ```text
/// f_j(z) = f(w_j' z + b_j)
/// ```
///
/// (Rumelhart, Hinton and Williams 1986; Ljung, System Identification, 2nd ed., section 5.4). The weights w and b of
/// the hidden layer are a view of numbers that may stand in flash; the model is linear in those of the output.
///
/// The hyperbolic tangent is that of the crate libm, so that every machine gives the same bits.
///
/// Cost: one multiply-add for each weight, and f for each unit.
///
/// ```
/// use thetahat_core::{Activation, Basis, Network};
///
/// // 1 + 2 z_0 + 3 tanh(z_0 - z_1).
/// let basis = Network { activation: Activation::Tanh, regressors: 2, weights: &[1.0, -1.0], biases: &[0.0] };
/// let value: f64 = basis.value(&[1.0, 2.0, 0.0, 3.0], &[0.5, 0.25]);
/// assert!((value - (2.0 + 3.0 * 0.25_f64.tanh())).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Network<'a, T> {
    /// What a unit makes of its sum.
    pub activation: Activation,
    /// The number of regressors.
    pub regressors: usize,
    /// w, unit after unit.
    pub weights: &'a [T],
    /// b, one for each unit.
    pub biases: &'a [T],
}

impl<T: Real> Network<'_, T> {
    /// w_j with f and df/da of each unit.
    fn units(&self, z: &[T]) -> impl Iterator<Item = (&[T], T, T)> {
        let each = self.weights.chunks(self.regressors.max(1)).zip(self.biases);
        each.map(move |(weights, &bias)| {
            let sum = weights.iter().zip(z).fold(bias, |sum, (&weight, &z)| sum + weight * z);
            let (value, slope) = self.activation.at(sum);
            (weights, value, slope)
        })
    }
}

impl<T: Real> Basis<T> for Network<'_, T> {
    fn functions(&self) -> usize {
        self.regressors + 1 + self.biases.len()
    }

    fn check(&self, regressors: usize) -> Result<(), Error> {
        check_length("regressors", regressors, self.regressors)?;
        check_length("weights", self.biases.len().saturating_mul(regressors), self.weights.len())
    }

    fn each(&self, z: &[T], mut take: impl FnMut(usize, T)) {
        take(0, T::one());
        z.iter().enumerate().for_each(|(i, &z)| take(i + 1, z));
        let first = self.regressors + 1;
        self.units(z).enumerate().for_each(|(j, (_, value, _))| take(first + j, value));
    }

    fn add_slopes(&self, parameters: &[T], z: &[T], slopes: &mut [T]) {
        let (path, outer) = parameters.split_at_checked(self.regressors + 1).unwrap_or_default();
        slopes.iter_mut().zip(path.iter().skip(1)).for_each(|(slope, &parameter)| *slope += parameter);
        for ((weights, _, own), &outer) in self.units(z).zip(outer) {
            for (slope, &weight) in slopes.iter_mut().zip(weights) {
                *slope += outer * own * weight;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_are_differences_of_values() {
        let (weights, biases) = ([0.7, -1.1, 0.2, 0.4, 0.9, -0.3], [0.1, -0.4, 0.6]);
        for activation in [Activation::Tanh, Activation::Logistic, Activation::Relu, Activation::Step] {
            let basis = Network { activation, regressors: 2, weights: &weights, biases: &biases };
            assert_eq!(Basis::<f64>::check(&basis, 2), Ok(()));
            let theta = [0.3, -0.8, 0.5, 1.2, -0.7, 0.9];
            let z = [0.37, -0.81];
            let mut slopes = [0.0; 2];
            basis.add_slopes(&theta, &z, &mut slopes);
            for i in 0..2 {
                let moved = |step: f64| {
                    let mut z = z;
                    z[i] += step;
                    basis.value(&theta, &z)
                };
                let difference = (moved(1e-5) - moved(-1e-5)) / 2e-5;
                assert!((difference - slopes[i]).abs() < 1e-9, "{activation:?} {i}: {difference} {slopes:?}");
            }
        }
    }

    #[test]
    fn activations_go_from_end_to_end() {
        assert_eq!(Activation::Tanh.at(40.0_f64).0, 1.0);
        assert_eq!(Activation::Logistic.at(-800.0_f64), (0.0, 0.0));
        assert_eq!(Activation::Logistic.at(0.0_f32), (0.5, 0.25));
        assert_eq!(Activation::Relu.at(-2.0_f64), (0.0, 0.0));
        assert_eq!(Activation::Step.at(0.0_f64), (1.0, 0.0));
        assert_eq!(Activation::Step.at(-1e-9_f64).0, 0.0);
        for activation in [Activation::Tanh, Activation::Logistic, Activation::Relu, Activation::Step] {
            assert!(activation.at(f64::NAN).0.is_nan(), "{activation:?}");
        }
    }
}
