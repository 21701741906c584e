//! The gain of a stationary Kalman filter.

use thetahat_core::nalgebra::{Cholesky, DMatrix};

use crate::model::StateSpace;

/// Doublings after which a solution that exists has converged: of an eigenvalue 1 - 1e-9 is nothing left.
const DOUBLINGS: usize = 60;

/// The model with the gain and the covariance of the innovations of a stationary Kalman filter,
///
/// ```text
/// P = A P A' + Q - A P H' (H P H' + R)^-1 H P A',   A = F - S R^-1 H,   Q = cov w - S R^-1 S'
/// K = (A P H')(H P H' + R)^-1 + S R^-1
/// ```
///
/// where `model` holds K = S R^-1 and R, and `rest` is Q. With A_0 = A', B_0 = H' R^-1 H and P_0 = Q, by doubling,
///
/// ```text
/// W = (I + B_i P_i)^-1,   A_{i+1} = A_i W A_i,   B_{i+1} = B_i + A_i W B_i A_i',   P_{i+1} = P_i + A_i' P_i W A_i
/// ```
///
/// (Chu, Fan, Lin and Wang, Int. J. Control 77, 2004, section 2). None where it does not converge. Cost: about 10 n^3 a
/// doubling.
pub(crate) fn stationary(model: &StateSpace, rest: &DMatrix<f64>) -> Option<StateSpace> {
    let n = model.f.nrows();
    let identity = DMatrix::identity(n, n);
    let noise = &model.noise_covariance;
    let weighted = Cholesky::new(noise.clone())?.solve(&model.h);
    let between = &model.f - &model.k * &model.h;
    let (mut a, mut b, mut p) = (between.transpose(), model.h.transpose() * weighted, rest.clone());
    for _ in 0..DOUBLINGS {
        let inverse = (&identity + &b * &p).lu().try_inverse()?;
        let (through, before) = (&a * &inverse, p.norm());
        let rise = a.transpose() * &p * &inverse * &a;
        b += &through * &b * a.transpose();
        p += &rise;
        a = through * &a;
        // Halves of what rounding made different.
        b = (&b + b.transpose()) * 0.5;
        p = (&p + p.transpose()) * 0.5;
        if !p.norm().is_finite() {
            return None;
        }
        if rise.norm() <= 1e-14 * before {
            break;
        }
    }
    let innovation = &model.h * &p * model.h.transpose() + noise;
    let gain = Cholesky::new(innovation.clone())?.solve(&(&model.h * &p * between.transpose())).transpose();
    Some(StateSpace { k: gain + &model.k, noise_covariance: innovation, ..model.clone() })
}
