//! How certain the parameters are.
//!
//! cov(z) = I^-1 (Ljung, System Identification, 2nd ed. 1999, section 7.4), and cov(p) = J cov(z) J with J =
//! diag(dp/dz), the delta method.

use thetahat_core::nalgebra::{DMatrix, SymmetricEigen};

use crate::Error;
use crate::figures::{self, number};
use crate::model::equations::Unknown;

/// With a unit diagonal, eigenvalues of the information below this one are rounding.
const NOTHING: f64 = 1e-12;
/// A parameter takes part in a direction if its component is at least this fraction of the largest.
const PART: f64 = 0.1;
/// A standard error of so many times the size of a parameter says that nothing is known of it.
const AWAY: f64 = 1e6;

/// The covariance of the parameters in their own units, `slopes` being dp/dz, and the condition of the problem: the
/// ratio of the longest to the shortest direction of the information's root with a unit diagonal. Parameters that are
/// `fixed` have none: their rows and columns are 0.
///
/// # Errors
/// [`Error::Undetermined`] that names the parameters of a singular information.
pub(super) fn covariance(
    information: &[f64],
    slopes: &[f64],
    names: &[String],
    fixed: &[bool],
) -> Result<(DMatrix<f64>, f64), Error> {
    let all = names.len();
    let open: Vec<usize> = (0..all).filter(|index| !fixed[*index]).collect();
    let part: Vec<f64> =
        open.iter().flat_map(|&i| open.iter().map(move |&j| information[i * all + j])).collect();
    let own = |index: &usize| (slopes[*index], names[*index].clone());
    let (slopes, names): (Vec<f64>, Vec<String>) = open.iter().map(own).unzip();
    let (found, condition) = free_covariance(&part, &slopes, &names)?;
    let mut covariance = DMatrix::zeros(all, all);
    for (i, &row) in open.iter().enumerate() {
        for (j, &column) in open.iter().enumerate() {
            covariance[(row, column)] = found[(i, j)];
        }
    }
    Ok((covariance, condition))
}

fn free_covariance(
    information: &[f64],
    slopes: &[f64],
    names: &[String],
) -> Result<(DMatrix<f64>, f64), Error> {
    let size = names.len();
    if size == 0 {
        return Ok((DMatrix::zeros(0, 0), 1.0));
    }
    let matrix = DMatrix::from_row_slice(size, size, information);
    let without: Vec<String> =
        named(names, |index| matrix[(index, index)].is_nan() || matrix[(index, index)] <= 0.0);
    if !without.is_empty() {
        let message = format!(
            "nothing that was measured depends on {}; take it as known, or measure an output that it acts on while its \
             inputs move",
            listed(&without)
        );
        return Err(Error::undetermined(without, message));
    }
    let scales = matrix.diagonal().map(f64::sqrt);
    let unit = DMatrix::from_fn(size, size, |i, j| matrix[(i, j)] / scales[i] / scales[j]);
    let SymmetricEigen { eigenvalues, eigenvectors } = SymmetricEigen::new(unit);
    let mut open = vec![false; size];
    for (_, direction) in
        eigenvalues.iter().zip(eigenvectors.column_iter()).filter(|(value, _)| **value < NOTHING)
    {
        let largest = direction.amax();
        for (open, part) in open.iter_mut().zip(direction.iter()) {
            *open |= part.abs() >= PART * largest;
        }
    }
    let open = named(names, |index| open[index]);
    if !open.is_empty() {
        let message = format!(
            "the data cannot tell {} apart: changes of them together leave the predictions as they are; take one of them \
             as known, or measure more",
            listed(&open)
        );
        return Err(Error::undetermined(open, message));
    }
    let covariance = DMatrix::from_fn(size, size, |i, j| {
        let parts = eigenvalues.iter().zip(eigenvectors.column_iter());
        let inverse: f64 = parts.map(|(value, vector)| vector[i] * vector[j] / value).sum();
        inverse * (slopes[i] / scales[i]) * (slopes[j] / scales[j])
    });
    Ok((covariance, (eigenvalues.max() / eigenvalues.min()).sqrt()))
}

/// Refuses a parameter that the search has drawn to where it has hardly an effect, as a time constant that grows
/// without bound: nothing is known of it there.
///
/// # Errors
/// [`Error::Undetermined`] that names the first such parameter.
pub(super) fn check(unknown: &[Unknown], z: &[f64], covariance: &DMatrix<f64>) -> Result<(), Error> {
    for (index, (unknown, &z)) in unknown.iter().zip(z).enumerate() {
        let (value, error) = (unknown.scale.value(z), covariance[(index, index)].sqrt());
        let size = value.abs().max(unknown.start.abs()).max(unknown.deviation.abs());
        // Written so that a NaN is refused.
        if !(value.is_finite() && error <= AWAY * size) {
            let name = &unknown.name;
            let message = format!(
                "the log does not determine '{name}': the search has drawn it to {}, where it has hardly an effect (standard error \
                 {}); give it bounds (min, max) or another start, take it as known, or measure more",
                number(value),
                figures::error(error)
            );
            return Err(Error::undetermined(vec![name.clone()], message));
        }
    }
    Ok(())
}

fn named(names: &[String], chosen: impl Fn(usize) -> bool) -> Vec<String> {
    names.iter().enumerate().filter(|(index, _)| chosen(*index)).map(|(_, name)| name.clone()).collect()
}

/// `a`, `a and b`, `a, b and c`.
pub(crate) fn listed(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [only] => format!("'{only}'"),
        [first @ .., last] => {
            let first: Vec<String> = first.iter().map(|name| format!("'{name}'")).collect();
            format!("{} and '{last}'", first.join(", "))
        }
    }
}
