use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::InitialCondition;
use crate::model::PolynomialModel;

/// How far ahead a response looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Horizon {
    /// This many steps ahead of the last measured output.
    Steps {
        /// At least 1.
        steps: usize,
    },
    /// Driven by the inputs alone.
    FreeRun,
}

impl Horizon {
    /// From what was measured.
    pub(crate) const ONE_STEP: Self = Self::Steps { steps: 1 };
}

impl fmt::Display for Horizon {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Steps { steps: 1 } => f.write_str("1 step ahead"),
            Self::Steps { steps } => write!(f, "{steps} steps ahead"),
            Self::FreeRun => f.write_str("free run"),
        }
    }
}

impl InitialCondition {
    /// The default initial condition of a response to measured data. Free runs, and predictions with C, D or F, of
    /// which the filters have a memory: [`InitialCondition::Estimate`]. Other predictions, which need no more than a
    /// few measured samples: [`InitialCondition::Drop`].
    ///
    /// A log without the output leaves only [`InitialCondition::Zero`].
    pub fn natural(model: &PolynomialModel, horizon: Horizon) -> Self {
        match horizon {
            Horizon::Steps { .. } if model.orders.is_linear() => Self::Drop,
            Horizon::Steps { .. } | Horizon::FreeRun => Self::Estimate,
        }
    }
}
