//! Controllers for a model, and the loops that they give.
//!
//! - [`control`] designs one by a [`Design`]: placed poles, a linear-quadratic measure, or minimum variance.
//!   [`Control`] is the document: the coefficients, the [`Loop`] that they make with the model, and how many models
//!   within the covariance of the parameters it keeps stable.
//! - [`Control::controller`] is the controller of the core, that runs.
//!
//! ```text
//! R(q) u(t) = T(q) u_c(t) - S(q) y(t),   T = t_0 A_o
//! ```

mod closed_loop;
mod document;
mod plan;
mod plant;
#[cfg(test)]
mod tests;

pub use document::{Control, Loop, Polynomials, Robustness};
pub use plan::{ControlPlan, Design, control};
