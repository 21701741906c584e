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
