//! What is written, and how it is checked when it is read back.

use nalgebra::{Const, OVector};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::RecursiveNarx;
use crate::error::check_length;
use crate::snapshot::{Entry, vector};
use crate::{
    Basis, Dimension, Error, Lags, NonlinearArx, Real, RecursiveLeastSquares, Scaling, SnapshotVersion,
};

impl<T: Real> Entry for Scaling<T> {
    const BLANK: Self = Scaling { offset: T::NAN, scale: T::NAN };

    fn write<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        (self.offset, self.scale).serialize(serializer)
    }

    fn read<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let (offset, scale) = Deserialize::deserialize(deserializer)?;
        Ok(Scaling { offset, scale })
    }
}

#[derive(Serialize, Deserialize)]
#[serde(bound(serialize = "B: Serialize", deserialize = "B: Deserialize<'de>"))]
pub(super) struct Snapshot<T: Real, B, Z: Dimension, N: Dimension + Dimension<Const<1>>, D: Dimension> {
    version: SnapshotVersion,
    basis: B,
    /// Offset and scale.
    output: (T, T),
    #[serde(with = "vector")]
    inputs: OVector<Scaling<T>, Z>,
    lags: Lags<T, Z, D>,
    estimator: RecursiveLeastSquares<T, N>,
}

impl<T: Real, B, Z: Dimension, N: Dimension + Dimension<Const<1>>, D: Dimension>
    From<RecursiveNarx<T, B, Z, N, D>> for Snapshot<T, B, Z, N, D>
{
    fn from(narx: RecursiveNarx<T, B, Z, N, D>) -> Self {
        let RecursiveNarx { model, estimator, .. } = narx;
        let NonlinearArx { basis, output: Scaling { offset, scale }, inputs, lags } = model;
        Snapshot { version: SnapshotVersion, basis, output: (offset, scale), inputs, lags, estimator }
    }
}

impl<T: Real, B: Basis<T>, Z: Dimension, N: Dimension + Dimension<Const<1>>, D: Dimension>
    TryFrom<Snapshot<T, B, Z, N, D>> for RecursiveNarx<T, B, Z, N, D>
{
    type Error = Error;

    fn try_from(read: Snapshot<T, B, Z, N, D>) -> Result<Self, Error> {
        let Snapshot { version: _, basis, output: (offset, scale), inputs, lags, estimator } = read;
        let output = Scaling { offset, scale };
        let size = lags.size().value();
        lags.check_counts(size, 1, 0)?;
        basis.check(size)?;
        check_length("inputs", size, inputs.len())?;
        check_length("basis", estimator.parameters().len(), basis.functions())?;
        inputs.as_slice().iter().chain([&output]).try_for_each(|scaling| scaling.check())?;
        if lags.inputs() > size {
            return Err(Error::Length { argument: "inputs", expected: size, found: lags.inputs() });
        }
        let functions = estimator.covariance().size().vector(T::NAN);
        Ok(RecursiveNarx { model: NonlinearArx { basis, output, inputs, lags }, estimator, functions })
    }
}
