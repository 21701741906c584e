//! What a model is: its orders, its polynomials, and the document that a fit stores.

mod dynamics;
mod fitted;
mod orders;
pub(crate) mod polynomial;
mod state_space;

pub(crate) use dynamics::{Block, Blocks, Gradient, cancel, covariance, near_cancellation};
pub use dynamics::{Interval, Quantity, Root};
pub(crate) use fitted::is_covariance;
pub use fitted::{Model, OffsetCovariance, Parameter, Signal};
pub(crate) use orders::LARGEST;
pub use orders::{Orders, Structure};
pub use state_space::StateSpace;
