//! The model as one plant: an input, the output, and one noise.

use thetahat_core::nalgebra::{Complex, DMatrix};

use crate::Error;
use crate::model::polynomial::{multiply_out, product};
use crate::model::{LinearModel, PolynomialModel, StateSpace};

/// A(q) y = B(q) u + C(q)/D(q) e, from what may have more polynomials.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Plant {
    /// Monic.
    pub(super) a: Vec<f64>,
    /// With its leading zeros.
    pub(super) b: Vec<f64>,
    /// Monic; A where nothing is said of the noise, which then is that of measurements.
    pub(super) c: Vec<f64>,
    /// Monic.
    pub(super) d: Vec<f64>,
    /// The variance of e; none where nothing is said of it.
    pub(super) noise_variance: Option<f64>,
}

impl Plant {
    /// Of an input, counted from 0.
    pub(super) fn of(model: &LinearModel<'_>, input: usize) -> Result<Self, Error> {
        match model {
            LinearModel::Polynomial(model) => Ok(Self::of_polynomials(model, input, true)),
            LinearModel::Transfer(model) => Ok(Self::of_polynomials(model, input, false)),
            LinearModel::StateSpace(space, output) => {
                Self::of_states(&space.matrices(), *output, input, model.has_noise())
            }
            LinearModel::Continuous(..) => Err(Error::argument(
                "model",
                "it is in continuous time: convert it to the sample time of the controller",
            )),
        }
    }

    /// A F y = B u + C F/D e.
    pub(super) fn of_polynomials(model: &PolynomialModel, input: usize, has_noise: bool) -> Self {
        let (b, f) = (&model.b[input], &model.f[input]);
        let a = trimmed(product(&model.a, f));
        let c = if has_noise { trimmed(product(&model.c, f)) } else { a.clone() };
        let noise_variance = has_noise.then_some(model.noise_variance);
        Self { a, b: trimmed(b.clone()), c, d: model.d.clone(), noise_variance }
    }

    /// det(q - F) y = det(q - F) (H (q - F)^-1 G + D) u + det(q - F + K H) e.
    fn of_states(space: &StateSpace, output: usize, input: usize, has_noise: bool) -> Result<Self, Error> {
        let transfer = space.transfer(output, input)?;
        let a = monic(&transfer.poles);
        let mut b = vec![0.0; transfer.delay()];
        b.extend(monic(&transfer.zeros).iter().map(|value| value * transfer.gain));
        let c = if has_noise {
            let h = DMatrix::from_fn(1, space.h.ncols(), |_, state| space.h[(output, state)]);
            let predictor = StateSpace { f: &space.f - &space.k * h, ..space.clone() };
            monic(&predictor.poles()?)
        } else {
            a.clone()
        };
        let noise_variance = has_noise.then(|| space.noise_covariance[(0, 0)]);
        Ok(Self { a: trimmed(a), b: trimmed(b), c: trimmed(c), d: vec![1.0], noise_variance })
    }
}

/// Without zeros at its end.
pub(super) fn trimmed(mut polynomial: Vec<f64>) -> Vec<f64> {
    while polynomial.len() > 1 && polynomial.last() == Some(&0.0) {
        polynomial.pop();
    }
    polynomial
}

/// The monic polynomial in q^-1 of these roots, which come with their conjugates.
pub(super) fn monic(roots: &[Complex<f64>]) -> Vec<f64> {
    let mut found = Vec::new();
    multiply_out(roots.iter().copied(), &mut found);
    found.iter().map(|value| value.re).collect()
}
