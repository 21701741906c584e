//! Controllers, and their design from a model.

mod pole_placement;
mod rst;

pub use pole_placement::{PlacementOrders, WantedPoles};
pub use rst::RstController;

#[cfg(feature = "serde")]
mod snapshot;
#[cfg(test)]
mod tests;
