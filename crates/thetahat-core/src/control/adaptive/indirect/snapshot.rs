//! What is written, and how it is checked when it is read back.

use nalgebra::Const;
use serde::{Deserialize, Serialize};

use super::{ClosedLoop, IndirectSelfTuner, Trial, TunerModel};
use crate::{Dimension, Error, Real, SnapshotVersion};

#[derive(Serialize, Deserialize)]
#[serde(bound = "M: serde::Serialize + serde::de::DeserializeOwned")]
pub(super) struct Snapshot<T: Real, N: Dimension, M> {
    version: SnapshotVersion,
    plant: M,
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

impl<T: Real, P: Dimension + Dimension<Const<1>>, N: Dimension, M: TunerModel<T, P>>
    From<IndirectSelfTuner<T, P, N, M>> for Snapshot<T, N, M>
{
    fn from(tuner: IndirectSelfTuner<T, P, N, M>) -> Self {
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

impl<T: Real, P: Dimension + Dimension<Const<1>>, N: Dimension, M: TunerModel<T, P>>
    TryFrom<Snapshot<T, N, M>> for IndirectSelfTuner<T, P, N, M>
{
    type Error = Error;

    fn try_from(read: Snapshot<T, N, M>) -> Result<Self, Error> {
        let Snapshot { plant, closed, integrator, cancel_zeros, design_every, peaks, .. } = read;
        let Snapshot { candidate, since_design, since_all, trial, known_sign, .. } = read;
        let orders = plant.orders(integrator).filter(|_| known_sign.is_finite());
        let range = "a model with one input";
        closed.check(orders.ok_or(Error::OutOfRange { argument: "plant", range })?.size())?;
        let whole = IndirectSelfTuner {
            parameters: plant.estimator().covariance().size(),
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
