//! Arrays of C as vectors and matrices: matrices stand row by row, as `m[rows][columns]` does.

use thetahat_core::Covariance;
use thetahat_core::nalgebra::{ArrayStorage, Const, SMatrix, SVector};

use crate::{Error, Number};

/// The vector with these elements; what is missing is 0.
pub(crate) fn vector<const N: usize>(elements: &[Number]) -> SVector<Number, N> {
    let mut array = [0.0; N];
    array.iter_mut().zip(elements).for_each(|(target, element)| *target = *element);
    SVector::from_data(ArrayStorage([array]))
}

/// The matrix with these entries, row by row, `width` in each row; what is missing is 0.
pub(crate) fn matrix<const R: usize, const C: usize>(
    entries: &[Number],
    width: usize,
) -> SMatrix<Number, R, C> {
    let mut columns = [[0.0; R]; C];
    for (column, target) in columns.iter_mut().enumerate().take(width) {
        for (row, target) in target.iter_mut().enumerate() {
            *target = entries.get(row * width + column).copied().unwrap_or(0.0);
        }
    }
    SMatrix::from_data(ArrayStorage(columns))
}

/// The covariance with these entries; that of no noise if there are none.
pub(crate) fn covariance<const N: usize>(
    entries: Option<&[Number]>,
) -> Result<Covariance<Number, Const<N>>, Error> {
    Ok(entries.map_or(Ok(Covariance::zero(Const)), |entries| Covariance::new(&matrix(entries, N)))?)
}

/// Writes a vector, or as much of it as fits.
pub(crate) fn write(source: &[Number], target: &mut [Number]) {
    target.iter_mut().zip(source).for_each(|(target, element)| *target = *element);
}

/// Writes a matrix row by row, or as much of it as fits.
pub(crate) fn write_rows<const R: usize, const C: usize>(
    source: &SMatrix<Number, R, C>,
    target: &mut [Number],
) {
    for (row, target) in target.chunks_mut(C.max(1)).enumerate() {
        for (column, target) in target.iter_mut().enumerate() {
            *target = source.as_slice().get(column * R + row).copied().unwrap_or(0.0);
        }
    }
}
