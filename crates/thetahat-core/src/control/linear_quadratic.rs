//! Linear-quadratic state feedback.

use nalgebra::{Const, OMatrix};

use crate::state_space::transpose;
use crate::{Covariance, Dimension, Error, GainSchedule, LinearObservation, LinearTransition, Real};

/// The state feedback that is the best by a quadratic measure: for x(k+1) = F x(k) + G u(k)
///
/// ```text
/// minimise Σ x(k)'Q x(k) + u(k)'R u(k),     u(k) = -K x(k)
///
/// P = F'(P - P G (G'P G + R)⁻¹ G'P) F + Q,     K = (G'P G + R)⁻¹ G'P F
/// ```
///
/// It is the dual of the Kalman filter: K' is the predictor gain of F' and G', and is found as that is
/// ([`GainSchedule::steady_state`]), on factors, so that P stays positive. The weights are given as what holds such a
/// matrix, [`Covariance`]. A weight w of an output H x is w H'H.
///
/// N is the number of states, n, and M that of inputs, m. K_ij has the unit of input i over that of state j.
///
/// For one input the loop keeps a distance from instability: |1 + K (z - F)⁻¹ G|² is nowhere less than R/(R + G'P G).
///
/// Source: Anderson and Moore, Optimal Control: Linear Quadratic Methods, 1990, sections 2.4 and 5.4; Åström and
/// Wittenmark, Computer-Controlled Systems, 3rd ed. 1997, section 11.2.
///
/// ```
/// use thetahat_core::nalgebra::{Const, Matrix1, Vector1};
/// use thetahat_core::{Covariance, Error, LinearQuadratic};
///
/// // x(k+1) = x + u with weights 1 and 1: P = 1 + P/(P + 1), the golden ratio.
/// let one: Covariance<f64, Const<1>> = Covariance::from_diagonal(&Vector1::new(1.0))?;
/// let found = LinearQuadratic::solve(&Matrix1::new(1.0), &Matrix1::new(1.0), one.clone(), one, 100)?;
/// let golden = (1.0 + 5f64.sqrt()) / 2.0;
/// assert!((found.cost.variances()[0] - golden).abs() < 1e-12);
/// assert!((found.gain[0] - 1.0 / golden).abs() < 1e-12);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LinearQuadratic<T: Real, N: Dimension + Dimension<M>, M: Dimension + Dimension<N>> {
    /// K, m x n.
    pub gain: OMatrix<T, M, N>,
    /// P: x'P x is what is still to come from the state x.
    pub cost: Covariance<T, N>,
    /// How many steps of the Riccati equation it took.
    pub steps: usize,
}

impl<
    T: Real,
    N: Dimension + Dimension<M> + Dimension<Const<0>>,
    M: Dimension + Dimension<N> + Dimension<Const<0>>,
> LinearQuadratic<T, N, M>
{
    /// The feedback of F, n x n, G, n x m, Q and R.
    ///
    /// Errors: [`Error::NotFinite`]; [`Error::Length`] (only with `Dyn`); [`Error::NotConverged`] after
    /// `maximum_steps`, as where what is unstable cannot be reached by the inputs, or something on the unit circle has
    /// no weight; [`Error::NoVariance`] if an input has no weight and acts on nothing; [`Error::Overflow`]. A step
    /// costs about 2 n³ + n² m multiply-adds, and there are as many as the loop needs to settle, and half as many
    /// again.
    ///
    /// ```
    /// use thetahat_core::nalgebra::{Const, Matrix2, Vector1, Vector2};
    /// use thetahat_core::{Covariance, Error, LinearQuadratic};
    ///
    /// // A cart: position and speed, the input is a change of the speed. Its position has the weight 1, the input 1.
    /// let weight: Covariance<f64, _> = Covariance::from_diagonal(&Vector2::new(1.0, 0.0))?;
    /// let price: Covariance<f64, Const<1>> = Covariance::from_diagonal(&Vector1::new(1.0))?;
    /// let (motion, push) = (Matrix2::new(1.0, 1.0, 0.0, 1.0), Vector2::new(0.5, 1.0));
    /// let found = LinearQuadratic::solve(&motion, &push, weight, price, 1000)?;
    /// let closed = motion - push * found.gain;
    /// assert!(closed.complex_eigenvalues().iter().all(|pole| pole.norm_sqr() < 0.49));
    /// # Ok::<(), Error>(())
    /// ```
    pub fn solve(
        state_matrix: &OMatrix<T, N, N>,
        input_matrix: &OMatrix<T, N, M>,
        state_weight: Covariance<T, N>,
        input_weight: Covariance<T, M>,
        maximum_steps: usize,
    ) -> Result<Self, Error> {
        // A start that is positive in every direction: what has no weight but is unstable must still be held.
        let size = state_weight.size();
        let largest = state_weight.variances().iter().fold(T::zero(), |largest, weight| largest.max(*weight));
        let start = if largest > T::zero() { largest } else { T::one() };
        let start = Covariance::from_diagonal(&size.vector(start))?;
        let transition = LinearTransition::new(transpose(state_matrix), state_weight)?;
        let observation = LinearObservation::new(transpose(input_matrix), input_weight)?;
        let steady = GainSchedule::new(start).steady_state(&transition, &observation, maximum_steps)?;
        Ok(LinearQuadratic {
            gain: transpose(&steady.predictor_gain),
            cost: steady.predicted,
            steps: steady.steps,
        })
    }
}

#[cfg(test)]
mod tests;
