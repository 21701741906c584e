//! Options and progress of the search for the parameters of the least cost: a [`Search`] has the options, among them an
//! [`Algorithm`] and a [`Step`]. It reports its [`Progress`] to a [`Monitor`], and why it [`Stopped`].
//!
//! The equations of each algorithm, and when it stops, are those of
//! [`thetahat_numerics::optimize`](https://docs.rs/thetahat-numerics/latest/thetahat_numerics/optimize).

pub use thetahat_numerics::optimize::{Algorithm, Monitor, Progress, Search, Step, Stopped};
