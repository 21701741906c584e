//! Controllers, and their design from a model.

mod adaptive;
mod linear_quadratic;
mod minimum_variance;
mod pid;
mod pole_placement;
mod polynomial;
mod rst;

pub use adaptive::{
    DirectOrders, DirectSelfTuner, Distrust, Fallback, IndirectSelfTuner, Probing, ResponseWanted, Sensor,
    Supervision, TunerModel, TunerOrders, TunerSettings, TunerState,
};
pub use linear_quadratic::LinearQuadratic;
pub use minimum_variance::{MinimumVariance, MinimumVarianceOrders};
pub use pid::PidSettings;
pub use pole_placement::{PlacementOrders, WantedPoles};
pub use rst::RstController;

#[cfg(feature = "serde")]
mod snapshot;
#[cfg(test)]
mod tests;
