//! What is written, and how it is checked when it is read back.

use nalgebra::Const;
use serde::{Deserialize, Serialize};

use super::{ClosedLoop, IndirectSelfTuner, Trial};
use crate::{Dimension, Error, PlacementOrders, Real, RecursiveArx, SnapshotVersion};

#[derive(Serialize, Deserialize)]
#[serde(bound = "")]
pub(super) struct Snapshot<T: Real, P: Dimension + Dimension<Const<1>>, N: Dimension> {
    version: SnapshotVersion,
    plant: RecursiveArx<T, P>,
    closed: ClosedLoop<T, N>,
    integrator: bool,
    cancel_zeros: bool,
    design_every: u16,
    peaks: (T, T),
    candidate: usize,
    since_design: u16,
    since_all: u16,
    trial: Option<Trial<T>>,
    known_sign: T,
}

impl<T: Real, P: Dimension + Dimension<Const<1>>, N: Dimension> From<IndirectSelfTuner<T, P, N>>
    for Snapshot<T, P, N>
{
    fn from(tuner: IndirectSelfTuner<T, P, N>) -> Self {
        let IndirectSelfTuner { plant, closed, integrator, cancel_zeros, design_every, peaks, .. } = tuner;
        let IndirectSelfTuner { candidate, since_design, since_all, trial, known_sign, .. } = tuner;
        Snapshot {
            version: SnapshotVersion,
            plant,
            closed,
            integrator,
            cancel_zeros,
            design_every,
            peaks,
            candidate,
            since_design,
            since_all,
            trial,
            known_sign,
        }
    }
}

impl<T: Real, P: Dimension + Dimension<Const<1>>, N: Dimension> TryFrom<Snapshot<T, P, N>>
    for IndirectSelfTuner<T, P, N>
{
    type Error = Error;

    fn try_from(read: Snapshot<T, P, N>) -> Result<Self, Error> {
        let Snapshot { plant, closed, integrator, cancel_zeros, design_every, peaks, .. } = read;
        let Snapshot { candidate, since_design, since_all, trial, known_sign, .. } = read;
        // A of na + 1 coefficients, B of one input with a leading zero.
        let (na, nb) = (plant.a().count(), plant.b(0).map_or(0, Iterator::count));
        if nb < 2 || plant.b(1).is_some() || !known_sign.is_finite() {
            return Err(Error::OutOfRange { argument: "plant", range: "a model with one input" });
        }
        closed.check(PlacementOrders { na: na.saturating_sub(1), nb: nb - 1, integrator }.size())?;
        let whole = IndirectSelfTuner {
            plant,
            closed,
            integrator,
            cancel_zeros,
            design_every: 1,
            peaks: (T::one(), T::one()),
            candidate,
            since_design,
            since_all,
            trial,
            known_sign,
        };
        whole.with_design_every(design_every)?.with_peaks(peaks.0, peaks.1)
    }
}
