//! What is written of a tracker, and how it is checked when it is read back.

use serde::{Deserialize, Serialize};
use thetahat_core::{ChangeDetector, SnapshotVersion};

use super::{Stage, Tracker, Workspace};
use crate::Error;
use crate::model::{Map, Orders};
use crate::track::{
    missing,
    plan::{PerChannel, TrackPlan},
    score::TrackScore,
};

#[derive(Serialize, Deserialize)]
pub(super) struct Snapshot {
    version: SnapshotVersion,
    orders: Orders,
    #[serde(default, skip_serializing_if = "is_zero")]
    outputs: usize,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    map: Option<Map>,
    plan: TrackPlan,
    names: Vec<String>,
    offsets: PerChannel,
    unset: Vec<bool>,
    scales: Option<PerChannel>,
    stage: Stage,
    has_estimate: bool,
    settling: usize,
    detector: Option<ChangeDetector<f64>>,
    score: TrackScore,
    #[serde(with = "missing::vector")]
    inputs: Vec<f64>,
    #[serde(default, skip_serializing_if = "Vec::is_empty", with = "missing::vector")]
    past: Vec<f64>,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde calls it so")]
fn is_zero(count: &usize) -> bool {
    *count == 0
}

impl From<Tracker> for Snapshot {
    fn from(tracker: Tracker) -> Self {
        let Tracker { orders, outputs, map, plan, names, offsets, unset, scales, stage, .. } = tracker;
        let Tracker { has_estimate, settling, detector, score, inputs, past, .. } = tracker;
        Self {
            version: SnapshotVersion,
            orders,
            outputs,
            map,
            plan,
            names,
            offsets,
            unset,
            scales,
            stage,
            has_estimate,
            settling,
            detector,
            score,
            inputs,
            past,
        }
    }
}

impl TryFrom<Snapshot> for Tracker {
    type Error = Error;

    fn try_from(read: Snapshot) -> Result<Self, Error> {
        let Snapshot { orders, outputs, map, plan, names, offsets, unset, scales, stage, .. } = read;
        let Snapshot { has_estimate, settling, detector, score, inputs, past, .. } = read;
        let tracker = Self {
            orders,
            outputs,
            map,
            plan,
            names,
            offsets,
            unset,
            scales,
            stage,
            has_estimate,
            settling,
            detector,
            score,
            inputs,
            past,
            workspace: Workspace::default(),
        };
        if tracker.is_sound() { Ok(tracker) } else { Err(Error::data("its parts do not fit together")) }
    }
}
