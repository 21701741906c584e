//! What a model is: its orders, its polynomials, and the document that a fit stores.

mod fitted;
mod orders;
pub(crate) mod polynomial;

pub use fitted::{Complex, Model, Parameter, Signal, Structure};
pub use orders::Orders;
