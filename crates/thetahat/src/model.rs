//! What a model is: its orders, its polynomials, and the document that a fit stores.

mod assembly;
mod dynamics;
mod fitted;
mod orders;
pub(crate) mod polynomial;
mod quantity;
mod state_space;

pub(crate) use dynamics::{Block, Blocks, Gradient, cancel, covariance, near_cancellation};
pub(crate) use fitted::is_covariance;
pub use fitted::{Model, OffsetCovariance, Parameter, Signal};
pub(crate) use orders::LARGEST;
pub use orders::{Orders, Structure};
pub use quantity::{Interval, Quantity, Root};
pub use state_space::StateSpace;
