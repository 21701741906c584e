//! What a model is for.

use std::fmt;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::respond::Horizon;

/// What a model is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Focus {
    /// With inputs and without orders: prediction, unless another model simulates held-out blocks clearly better. Else
    /// prediction.
    #[default]
    Auto,
    /// Errors one step ahead.
    Prediction,
    /// Free runs, driven by the inputs alone.
    Simulation,
    /// Predictions this many steps ahead.
    Steps(usize),
}

impl Focus {
    /// How far ahead held-out samples are predicted.
    pub fn horizon(self) -> Horizon {
        match self {
            Self::Auto | Self::Simulation => Horizon::FreeRun,
            Self::Prediction => Horizon::Steps { steps: 1 },
            Self::Steps(steps) => Horizon::Steps { steps },
        }
    }

    /// Whether models are evaluated by more than errors one step ahead.
    pub(super) fn looks_further(self) -> bool {
        !matches!(self, Self::Prediction | Self::Steps(1))
    }
}

impl fmt::Display for Focus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Prediction => f.write_str("prediction"),
            Self::Simulation => f.write_str("simulation"),
            Self::Steps(steps) => write!(f, "{steps}"),
        }
    }
}

impl FromStr for Focus {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        match text {
            "auto" => Ok(Self::Auto),
            "prediction" => Ok(Self::Prediction),
            "simulation" => Ok(Self::Simulation),
            _ => match text.parse() {
                Ok(steps) if steps >= 1 => Ok(Self::Steps(steps)),
                _ => Err(Error::argument(
                    "focus",
                    format!(
                        "'{text}' is none; write auto, prediction, simulation, or a number of steps ahead"
                    ),
                )),
            },
        }
    }
}
