//! What is written, and how it is checked when it is read back.

use nalgebra::OVector;
use serde::{Deserialize, Serialize};

use super::FilterHistory;
use crate::error::check_length;
use crate::snapshot::vector;
use crate::{Dimension, Error, ExtendedKalmanFilter, OutOfSequenceFilter, Real, SnapshotVersion};

#[derive(Serialize, Deserialize)]
#[serde(bound = "")]
pub(super) struct Snapshot<T: Real, N: Dimension, M: Dimension, U: Dimension, B: Dimension> {
    version: SnapshotVersion,
    filter: ExtendedKalmanFilter<T, N>,
    #[serde(with = "vector")]
    ring: OVector<T, B>,
    history: FilterHistory,
    newest: usize,
    kept: usize,
    #[serde(skip)]
    sizes: core::marker::PhantomData<(M, U)>,
}

impl<T: Real, N: Dimension, M: Dimension, U: Dimension, B: Dimension> From<OutOfSequenceFilter<T, N, M, U, B>>
    for Snapshot<T, N, M, U, B>
{
    fn from(this: OutOfSequenceFilter<T, N, M, U, B>) -> Self {
        let OutOfSequenceFilter { filter, ring, history, newest, kept, .. } = this;
        let sizes = core::marker::PhantomData;
        Snapshot { version: SnapshotVersion, filter, ring, history, newest, kept, sizes }
    }
}

impl<T: Real, N: Dimension, M: Dimension, U: Dimension, B: Dimension> TryFrom<Snapshot<T, N, M, U, B>>
    for OutOfSequenceFilter<T, N, M, U, B>
{
    type Error = Error;

    fn try_from(read: Snapshot<T, N, M, U, B>) -> Result<Self, Error> {
        let Snapshot { version: _, filter, ring, history, newest, kept, sizes: _ } = read;
        let size = |argument, found| move |expected| Error::Length { argument, expected, found };
        let outputs = M::exactly(history.outputs).map_err(size("outputs", history.outputs))?;
        let inputs = U::exactly(history.inputs).map_err(size("inputs", history.inputs))?;
        check_length("states", filter.state().len(), history.states)?;
        // Before memory is asked for.
        if history.numbers() > ring.len() {
            return Err(Error::Length { argument: "ring", expected: history.numbers(), found: ring.len() });
        }
        let empty: Self = OutOfSequenceFilter::new(filter, outputs, inputs, history.samples)?;
        check_length("ring", empty.ring.len(), ring.len())?;
        if newest > history.samples || kept > history.samples {
            return Err(Error::OutOfRange { argument: "newest", range: "within the ring" });
        }
        let this = OutOfSequenceFilter { ring, newest, kept, ..empty };
        this.check()?;
        Ok(this)
    }
}
