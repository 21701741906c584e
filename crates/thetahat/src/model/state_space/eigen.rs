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
pub(super) fn eigenvalues(matrix: &DMatrix<f64>) -> Result<Vec<Complex<f64>>, Error> {
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
/// With a shift s they are s + 1/mu for the eigenvalues mu of (A - s B)^-1 B, those at infinity having mu = 0: so B may be singular (Saad,
/// Numerical Methods for Large Eigenvalue Problems, 2nd ed. 2011, section 8.3). Of some shifts that is taken which lies farthest from the
/// eigenvalues. O(n^3), and as much again for each eigenvalue at zero.
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

/// Takes the eigenvalues at zero off. One of multiplicity k would come out as k numbers of modulus eps^(1/k); so, with A v = 0, reflections
/// take v to the first column of A, which vanishes, and B v to the first row of B.
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
mod tests {
    use super::*;

    /// The largest distance of the values of one list, in order, from those of the other.
    fn apart(found: &[Complex<f64>], expected: &[(f64, f64)]) -> f64 {
        assert_eq!(found.len(), expected.len(), "{found:?}");
        let pairs = found.iter().zip(expected);
        pairs.map(|(one, (re, im))| (one - Complex::new(*re, *im)).modulus()).fold(0.0, f64::max)
    }

    #[test]
    fn eigenvalues_come_largest_first_and_in_pairs() {
        // z^3 - 0.5 z^2 + z - 0.5 = (z - 0.5)(z^2 + 1).
        let companion = DMatrix::from_row_slice(3, 3, &[0.5, -1.0, 0.5, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        let found = eigenvalues(&companion).unwrap();
        assert!(apart(&found, &[(0.0, 1.0), (0.0, -1.0), (0.5, 0.0)]) < 1e-14);
        assert_eq!(found[0].conj(), found[1]);
        assert!(eigenvalues(&DMatrix::zeros(0, 0)).unwrap().is_empty());
        assert!(eigenvalues(&DMatrix::from_element(1, 1, f64::NAN)).is_err());
    }

    #[test]
    fn a_multiple_eigenvalue_at_zero_is_zero() {
        // A Jordan block of 5 at zero beside 0.9, both in coordinates that are turned.
        let mut matrix = DMatrix::zeros(6, 6);
        (0..4).for_each(|row| matrix[(row, row + 1)] = 1.0);
        matrix[(5, 5)] = 0.9;
        matrix[(2, 5)] = 0.4;
        for axis in [[1.0, 2.0, -1.0, 0.5, 3.0, 1.0], [0.3, -2.0, 1.0, 0.5, 0.7, -1.0]] {
            let (axis, _) = reflection(&DVector::from_column_slice(&axis), 2).unwrap();
            reflect_rows(&mut matrix, &axis);
            reflect_columns(&mut matrix, &axis);
        }
        let found = eigenvalues(&matrix).unwrap();
        assert!((found[0] - 0.9).modulus() < 1e-13);
        assert_eq!(found[1..], [Complex::new(0.0, 0.0); 5]);
    }

    #[test]
    fn a_pencil_has_its_finite_eigenvalues() {
        // (1 - 2 z)(3 + z) and one at infinity.
        let a = DMatrix::from_diagonal(&DVector::from_column_slice(&[1.0, 3.0, 1.0]));
        let b = DMatrix::from_diagonal(&DVector::from_column_slice(&[2.0, -1.0, 0.0]));
        assert!(apart(&pencil(a, b).unwrap(), &[(-3.0, 0.0), (0.5, 0.0)]) < 1e-14);
    }

    #[test]
    fn a_reflection_leaves_one_entry() {
        let vector = DVector::from_column_slice(&[3.0, 0.0, -4.0]);
        for entry in 0..3 {
            let (axis, left) = reflection(&vector, entry).unwrap();
            let mut matrix = DMatrix::from_column_slice(3, 1, vector.as_slice());
            reflect_rows(&mut matrix, &axis);
            for row in 0..3 {
                let expected = if row == entry { left } else { 0.0 };
                assert!((matrix[(row, 0)] - expected).abs() < 1e-14);
            }
        }
        assert!(reflection(&DVector::zeros(2), 0).is_none());
    }
}
