//! Where the rows of a log came from.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{AntiAlias, Interpolation, Resample, Rows};
use crate::Error;

/// Where a log came from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Source {
    /// The file name as it was given.
    pub file: String,
    /// Its rows, counted through all logs.
    pub rows: Rows,
    /// The column that gave the time, if one did.
    pub time: Option<String>,
    /// The first time as it was written, where times were dates.
    pub start: Option<String>,
    /// How the log was made uniform, if it was irregular.
    pub resampled: Option<Resampling>,
}

impl Source {
    /// What a log is called that is no file.
    pub const IN_MEMORY: &str = "memory";
}

/// How a log was put on another clock.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Resampling {
    /// Seconds between the new rows.
    pub step: f64,
    /// How values between samples were read.
    pub interpolation: Interpolation,
    /// The number of rows before.
    pub rows: usize,
    /// The filter that took out what the new clock cannot show; none where it does not apply, or was not wanted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub anti_alias: Option<AntiAlias>,
}

impl Resampling {
    /// What becomes of a log with these times.
    ///
    /// # Errors
    /// As for [`Resample::filter_for`].
    pub fn new(how: &Resample, time: &[f64]) -> Result<Self, Error> {
        let Resample { step, interpolation, .. } = *how;
        Ok(Self { step, interpolation, rows: time.len(), anti_alias: how.filter_for(time)? })
    }
}
