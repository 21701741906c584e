//! What a model is: its orders, its polynomials, and the document that a fit stores.

mod assembly;
mod dynamics;
pub(crate) mod equations;
mod fitted;
mod kind;
mod nonlinear_arx;
mod orders;
pub(crate) mod polynomial;
mod quantity;
mod state_space;

pub(crate) use dynamics::{Block, Blocks, Gradient, cancel, covariance, near_cancellation};
pub use equations::{EquationsModel, GreyBox};
pub(crate) use fitted::is_covariance;
pub use fitted::{OffsetCovariance, Parameter, PolynomialModel, Signal};
pub use kind::Model;
pub(crate) use nonlinear_arx::Evaluator;
pub use nonlinear_arx::{Map, NonlinearArxModel, Regressor};
pub(crate) use orders::LARGEST;
pub use orders::{Orders, Structure};
pub use quantity::{Interval, Quantity, Root};
pub use state_space::StateSpace;
