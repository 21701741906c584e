//! What the values of a channel are measured from.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a channel's values are measured from: `level + slope * t`, t in seconds from the log's first row.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct Offset {
    /// In the channel's own units.
    pub level: f64,
    /// In the channel's units per second.
    pub slope: f64,
}

impl Offset {
    /// The offset `t` seconds after the log's first row.
    pub fn at(&self, t: f64) -> f64 {
        self.level + self.slope * t
    }
}
