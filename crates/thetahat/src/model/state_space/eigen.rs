//! Eigenvalues of matrices and pencils, those at zero exactly zero, and the reflections that find them.

use thetahat_core::nalgebra::{Complex, ComplexField, DMatrix, DVector};

use crate::{Error, figures};

/// The same matrix for faer.
pub(super) fn faer_of(matrix: &DMatrix<f64>) -> faer::Mat<f64> {
    faer::Mat::from_fn(matrix.nrows(), matrix.ncols(), |row, column| matrix[(row, column)])
}

/// The same matrix for nalgebra.
pub(super) fn nalgebra_of(matrix: faer::MatRef<'_, f64>) -> DMatrix<f64> {
    DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |row, column| matrix[(row, column)])
}

/// X of A X = B by an LU factor; none where A is singular. Of no rows there is none to divide by.
pub(super) fn solved(a: DMatrix<f64>, b: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    if a.is_empty() { Some(b.clone()) } else { a.lu().solve(b) }
}

/// Rounding of a matrix of this size as a fraction of its norm.
pub(super) fn rounding(size: usize) -> f64 {
    10.0 * size.max(1) as f64 * f64::EPSILON
}

/// Shifts that are tried: irrational, so that no eigenvalue of a plant that people write down is one.
const SHIFTS: [f64; 4] =
    [std::f64::consts::SQRT_2, -std::f64::consts::SQRT_2, std::f64::consts::E, -std::f64::consts::E];

/// The eigenvalues of a square matrix, largest first; of a conjugate pair the positive imaginary part first. O(n^3).
pub(crate) fn eigenvalues(matrix: &DMatrix<f64>) -> Result<Vec<Complex<f64>>, Error> {
    let Deflated { a, b, at_zero } =
        deflated(matrix.clone(), DMatrix::identity(matrix.nrows(), matrix.nrows()))?;
    // Reflections have made an orthogonal matrix of the identity.
    Ok(in_order(standard(&b.tr_mul(&a))?, at_zero))
}

/// Whether all eigenvalues lie inside the unit circle.
pub(crate) fn is_stable(matrix: &DMatrix<f64>) -> bool {
    standard(matrix).is_ok_and(|found| found.iter().all(|value| value.modulus() < 1.0))
}

/// Eigenvalues and eigenvectors of a symmetric matrix; none where they do not converge.
pub(crate) fn symmetric_eigen(matrix: &DMatrix<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
    if !matrix.iter().all(|value| value.is_finite()) {
        return None;
    }
    let found = faer_of(matrix).self_adjoint_eigen(faer::Side::Lower).ok()?;
    let values = DVector::from_iterator(matrix.nrows(), found.S().column_vector().iter().copied());
    Some((values, nalgebra_of(found.U())))
}

/// The finite z with det(A - z B) = 0, in the order of [`eigenvalues`].
///
/// With a shift s they are s + 1/mu for the eigenvalues mu of (A - s B)^-1 B, those at infinity having mu = 0: so B may
/// be singular (Saad, Numerical Methods for Large Eigenvalue Problems, 2nd ed. 2011, section 8.3). Of some shifts that
/// is taken which lies farthest from the eigenvalues. O(n^3), and as much again for each eigenvalue at zero.
pub(super) fn pencil(a: DMatrix<f64>, b: DMatrix<f64>) -> Result<Vec<Complex<f64>>, Error> {
    let Deflated { a, b, at_zero } = deflated(a, b)?;
    let inverted = SHIFTS.iter().filter_map(|&shift| {
        let inverse = solved(&a - &b * shift, &b)?;
        let size = inverse.norm();
        size.is_finite().then_some((shift, inverse, size))
    });
    let Some((shift, inverse, size)) = inverted.min_by(|(_, _, a), (_, _, b)| a.total_cmp(b)) else {
        return Ok(in_order(Vec::new(), at_zero));
    };
    let at_infinity = rounding(a.nrows()) * size;
    let finite = standard(&inverse)?.into_iter().filter(|mu| mu.modulus() > at_infinity);
    Ok(in_order(finite.map(|mu| mu.finv() + shift).collect(), at_zero))
}

/// A pencil without its eigenvalues at zero.
struct Deflated {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    at_zero: usize,
}

/// Takes the eigenvalues at zero off. One of multiplicity k would come out as k numbers of modulus eps^(1/k); so, with
/// A v = 0, reflections take v to the first column of A, which vanishes, and B v to the first row of B.
fn deflated(mut a: DMatrix<f64>, mut b: DMatrix<f64>) -> Result<Deflated, Error> {
    if !a.iter().chain(b.iter()).all(|value| value.is_finite()) {
        return Err(Error::argument("model", "a matrix has an entry that is not a finite number"));
    }
    let mut at_zero = 0;
    // Against the whole matrix: what is left of it at the end may be rounding only.
    let mut least = None;
    while a.nrows() > 0 {
        let size = a.nrows();
        let decomposed = faer_of(&a).svd().map_err(|_| diverges())?;
        let values = decomposed.S().column_vector();
        if values[size - 1] > *least.get_or_insert(rounding(size) * values[0]) {
            break;
        }
        let kernel = decomposed.V().col(size - 1);
        let kernel = DVector::from_fn(size, |row, _| kernel[row]);
        if let Some((axis, _)) = reflection(&kernel, 0) {
            reflect_columns(&mut a, &axis);
            reflect_columns(&mut b, &axis);
        }
        if let Some((axis, _)) = reflection(&b.column(0).into_owned(), 0) {
            reflect_rows(&mut a, &axis);
            reflect_rows(&mut b, &axis);
        }
        a = a.view((1, 1), (size - 1, size - 1)).into_owned();
        b = b.view((1, 1), (size - 1, size - 1)).into_owned();
        at_zero += 1;
    }
    Ok(Deflated { a, b, at_zero })
}

/// The eigenvalues of a matrix in any order.
fn standard(matrix: &DMatrix<f64>) -> Result<Vec<Complex<f64>>, Error> {
    if matrix.is_empty() {
        return Ok(Vec::new());
    }
    let found = faer_of(matrix).eigenvalues().map_err(|_| diverges())?;
    Ok(found.iter().map(|value| Complex::new(value.re, value.im)).collect())
}

fn in_order(mut found: Vec<Complex<f64>>, at_zero: usize) -> Vec<Complex<f64>> {
    found.extend(std::iter::repeat_n(Complex::new(0.0, 0.0), at_zero));
    found.sort_by(|a, b| {
        b.modulus().total_cmp(&a.modulus()).then(b.re.total_cmp(&a.re)).then(b.im.total_cmp(&a.im))
    });
    found
}

fn diverges() -> Error {
    Error::undetermined(Vec::new(), "the eigenvalues of the model do not converge")
}

/// An eigenvalue in an error.
pub(super) fn named(value: Complex<f64>) -> String {
    let real = figures::short(value.re);
    if value.im == 0.0 {
        return real;
    }
    let sign = if value.im > 0.0 { '+' } else { '-' };
    format!("{real} {sign} {}i", figures::short(value.im.abs()))
}

/// The unit axis a for which (I - 2 a a') v has one entry only, and what that entry is. None for v = 0.
pub(super) fn reflection(vector: &DVector<f64>, entry: usize) -> Option<(DVector<f64>, f64)> {
    let norm = vector.norm();
    let left = if vector[entry] > 0.0 { -norm } else { norm };
    let mut axis = vector.clone();
    axis[entry] -= left;
    axis.try_normalize_mut(0.0).map(|_| (axis, left))
}

/// (I - 2 a a') M.
pub(super) fn reflect_rows(matrix: &mut DMatrix<f64>, axis: &DVector<f64>) {
    let along = matrix.tr_mul(axis);
    matrix.ger(-2.0, axis, &along, 1.0);
}

/// M (I - 2 a a').
pub(super) fn reflect_columns(matrix: &mut DMatrix<f64>, axis: &DVector<f64>) {
    let along = &*matrix * axis;
    matrix.ger(-2.0, &along, axis, 1.0);
}

#[cfg(test)]
mod tests;
