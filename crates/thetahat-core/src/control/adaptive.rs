//! Controllers that learn their plant while they control it.

mod closed_loop;
mod direct;
mod indirect;
mod model;
mod past;
mod probe;
mod response;
mod sensor;
mod settings;
mod trust;

pub use direct::{DirectOrders, DirectSelfTuner};
pub use indirect::IndirectSelfTuner;
pub use model::{TunerModel, TunerOrders};
pub use probe::Probing;
pub use response::ResponseWanted;
pub use sensor::Sensor;
pub use settings::{TunerSettings, TunerState};
pub use trust::{Distrust, Fallback, Supervision};

#[cfg(test)]
mod tests;
