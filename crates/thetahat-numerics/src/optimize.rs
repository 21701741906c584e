//! The search for the parameters of the least cost, whatever the cost is.
//!
//! [`Search`] says how: an [`Algorithm`], a [`Step`], limits. It tells a [`Monitor`] of its [`Progress`], and why it
//! [`Stopped`].
//!
//! With the normal equations G step = g of an iteration, scaled so that G has a unit diagonal:
//!
//! ```text
//! Levenberg-Marquardt  (G + mu I) step = g,  mu from 1e-8, a tenth where the cost falls as predicted; where it rises, the step
//!                      is halved as often as the objective says, then mu is times 10
//! Gauss-Newton         G step = g,  halved until the cost falls
//! Newton-Raphson       (H + mu I) step = g,  H the Hessian by differences of g, mu the least that makes it positive; halved
//! steepest descent     step = c1/(c2 + l) g,  halved
//! simulated annealing  random steps that may raise the cost, the less the later; then Levenberg-Marquardt from the best point met
//! ```
//!
//! (Levenberg 1944; Marquardt 1963; Moré, The Levenberg-Marquardt algorithm: implementation and theory, 1978; Ljung,
//! System Identification, 2nd ed. 1999, section 10.2.) A step that leaves the region where parameters have a meaning,
//! such as that of a stable C and F, is refused like one that raises the cost; the objective may move it back to the
//! boundary.
//!
//! Damping alone freezes the flat directions of an ill-conditioned matrix, along which a narrow valley leads: with it
//! an output-error fit of two inputs took 157 iterations, with halved steps 8.
//!
//! # When it stops
//!
//! One tolerance, a fraction of the cost J, bounds the decrease that a full step predicts:
//!
//! ```text
//! g' G^-1 g <= tolerance J
//! ```
//!
//! Textbooks name four rules. Near a minimum, where the quadratic model holds, this one stands for all of them:
//!
//! - the relative decrease of J: the same number, one iteration ahead. It is not small because a step was damped or
//!   halved;
//! - the change of J: the same times J. A fraction does not depend on the units of the signals;
//! - the change of theta: with s = G^-1 g the decrease is s'G s, which is J/N times the squared length of s in standard
//!   errors. With a tolerance of 1e-8 and 1000 samples no combination of parameters is further than 0.003 standard
//!   errors from the minimum;
//! - the gradient: the decrease is the square of its norm in the metric G^-1, whatever the units of the parameters. How
//!   large it is at the end, a report says (`gradient_norm`).
//!
//! A cost that no step lowers further ends a search too: at what rounding allows it has converged, else there is
//! [`NoDescent`](Stopped::NoDescent). Iterations and time have limits.

mod annealing;
pub mod normal;
mod objective;
mod options;
mod orthogonal;
mod outcome;
mod quasi_newton;
mod search;
mod solved;
mod starts;
#[cfg(test)]
mod tests;
mod workspace;

pub use objective::{Objective, StepRules};
pub use options::{Algorithm, Search, Step};
pub use outcome::{Deadline, Found};
pub use outcome::{Monitor, Progress, Stopped};
pub use quasi_newton::least;
pub use search::search;
pub use solved::{best_free, best_linear, predicted_decrease};
pub use starts::{lowest, normal_number};
