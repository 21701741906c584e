//! State-space models beside a log.
//!
//! Predictions one step ahead come from the recursion that the innovations drive,
//!
//! ```text
//! e(t) = y(t) - H x(t) - D u(t),   x(t+1) = F x(t) + G u(t) + K e(t)
//! ```
//!
//! each segment from the state that leaves least of them. Those k steps ahead lack what the last innovations did: with
//! Psi_j = H F^(j-1) K
//!
//! ```text
//! y(t|t-k) = y(t) - e(t) - sum_(0<j<k) Psi_j e(t-j),   cov = R + sum_(0<j<k) Psi_j R Psi_j',   R = cov e
//! ```
//!
//! (Ljung, System Identification, 2nd ed. 1999, sections 3.2 and 4.3). Free runs have e = 0, and start from the state
//! that explains the outputs best.
//!
//! Rows in which outputs are missing are gone through: predictions are those of the time-varying Kalman filter of this
//! form, whose equations stand in `covariance`. There the gain is L(t) in the place of K, and what is not known of the
//! state adds to the variances: k steps ahead
//!
//! ```text
//! y(t|t-k) = y(t) - e(t) - sum_(0<j<k) H F^(j-1) L(t-j) e(t-j)        e(t) of the outputs that were measured
//! cov      = R + sum_(0<j<k) Psi_j R Psi_j' + H F^(k-1) P(t-k+1) (H F^(k-1))'
//! ```

mod covariance;
mod on_log;
mod recursion;
mod responses;
#[cfg(test)]
mod tests;

pub(crate) use on_log::StateSpaceOnLog;
pub(crate) use recursion::Recursion;
pub(super) use responses::{Resolvent, frequency_response, transient};
