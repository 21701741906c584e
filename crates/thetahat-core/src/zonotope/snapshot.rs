//! What is written, and how it is checked when it is read back.

use nalgebra::{OMatrix, OVector};

use super::check_bound;
use crate::error::check_finite;
use crate::snapshot::{matrix, snapshot, vector};
use crate::{Dimension, Error, Real, ZonotopeFilter};

snapshot! {
    Snapshot<T, N, G> of ZonotopeFilter<T, N, G> where [T: Real, N: Dimension + Dimension<G>, G: Dimension] {
        #[serde(with = "vector")]
        centre: OVector<T, N>;
        #[serde(with = "matrix")]
        generators: OMatrix<T, N, G>;
        used: usize;
    }
}

impl<T: Real, N: Dimension + Dimension<G>, G: Dimension> TryFrom<Snapshot<T, N, G>>
    for ZonotopeFilter<T, N, G>
{
    type Error = Error;

    fn try_from(read: Snapshot<T, N, G>) -> Result<Self, Error> {
        let Snapshot { centre, generators, used, .. } = read;
        let mut fresh =
            ZonotopeFilter::new(centre.clone(), &(centre.clone() * T::zero()), generators.shape_generic().1)?;
        crate::error::check_length("generators", centre.len(), generators.nrows())?;
        check_finite("generators", generators.as_slice())?;
        if used > generators.ncols() {
            return Err(Error::OutOfRange { argument: "used", range: "at most the number of generators" });
        }
        (fresh.generators, fresh.used) = (generators, used);
        check_bound("generators", fresh.reaches().as_slice(), fresh.centre.len())?;
        Ok(fresh)
    }
}
