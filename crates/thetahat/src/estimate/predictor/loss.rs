//! Huber's loss: rho(e) = e^2/2 up to a bound, linear beyond.

use thetahat_numerics::regression::sum;

/// 2 sum rho(e).
pub(super) fn cost(errors: &[f64], bound: f64) -> f64 {
    let twice = |e: &f64| if e.abs() <= bound { e * e } else { bound * (2.0 * e.abs() - bound) };
    sum(errors.iter().map(twice))
}

/// psi(e)/e.
pub(super) fn weight(e: f64, bound: f64) -> f64 {
    if e.abs() <= bound { 1.0 } else { bound / e.abs() }
}
