use thetahat_numerics::noise::Noise;

use super::*;
use crate::tests::matrix;

fn close(found: &DMatrix<f64>, expected: &DMatrix<f64>, tolerance: f64) -> bool {
    (found - expected).norm() <= tolerance * expected.norm().max(1.0)
}

#[test]
fn integrals_are_their_series() {
    let small = matrix(&[&[0.1, -0.3], &[0.25, 0.05]]);
    let [zero, first, second] = integrals(&small).unwrap();
    let (mut power, mut factorial) = (DMatrix::identity(2, 2), 1.0);
    let mut sums = [DMatrix::zeros(2, 2), DMatrix::zeros(2, 2), DMatrix::zeros(2, 2)];
    for k in 0..25 {
        let after = f64::from(k + 1);
        sums[0] += &power / factorial;
        sums[1] += &power / (factorial * after);
        sums[2] += &power / (factorial * after * (after + 1.0));
        power = &power * &small;
        factorial *= after;
    }
    for (found, expected) in [zero, first, second].iter().zip(&sums) {
        assert!(close(found, expected, 1e-15));
    }
}

#[test]
fn exponentials_are_exact_where_terms_cancel() {
    // Ward's example (Moler and Van Loan, SIAM Review 45, 2003, section 3): eigenvalues -1 and -17.
    let [found, ..] = integrals(&matrix(&[&[-49.0, 24.0], &[-64.0, 31.0]])).unwrap();
    let (slow, fast) = ((-1.0_f64).exp(), (-17.0_f64).exp());
    let expected =
        matrix(&[&[-2.0, 1.5], &[-4.0, 3.0]]) * slow + matrix(&[&[3.0, -1.5], &[4.0, -2.0]]) * fast;
    assert!(close(&found, &expected, 1e-13), "{found}");
    // A fast and a slow state in one matrix.
    let [found, first, _] = integrals(&matrix(&[&[-1e6, 1.0], &[0.0, -0.5]])).unwrap();
    assert!(found[(0, 0)].abs() < 1e-300 && (found[(1, 1)] - (-0.5_f64).exp()).abs() < 1e-10, "{found}");
    assert!((first[(0, 0)] - 1e-6).abs() < 1e-19, "{first}");
}

#[test]
fn exponentials_beyond_the_range_of_numbers_are_none() {
    for large in [800.0, 1e12, f64::INFINITY, f64::NAN] {
        assert!(integrals(&matrix(&[&[large, 1.0], &[0.0, 1.0]])).is_none(), "{large}");
    }
}

#[test]
fn logarithms_are_those_of_scipy() {
    // scipy 1.17.1: scipy.linalg.logm.
    let general = matrix(&[&[0.2, 0.5, 0.1], &[-0.6, 0.3, 0.4], &[0.1, 0.2, 1.7]]);
    let expected = matrix(&[
        &[-0.5860797782152192, 1.0510090472234452, -0.07554009999532528],
        &[-1.3156378870376615, -0.4320058438391045, 0.3951859266282577],
        &[0.1965950518523074, 0.12955917535222064, 0.5089252776073939],
    ]);
    assert!(close(&logarithm(&general).unwrap(), &expected, 1e-14));
    // Defective: ln 1/2 I + 2 N - 2 N^2.
    let jordan = matrix(&[&[0.5, 1.0, 0.3], &[0.0, 0.5, 1.0], &[0.0, 0.0, 0.5]]);
    let half = 0.5_f64.ln();
    let expected = matrix(&[&[half, 2.0, -1.4], &[0.0, half, 2.0], &[0.0, 0.0, half]]);
    assert!(close(&logarithm(&jordan).unwrap(), &expected, 1e-13));
}

#[test]
fn logarithms_invert_exponentials() {
    let mut noise = Noise(1);
    for size in 1..=20 {
        // Eigenvalues with imaginary parts below pi: row sums are.
        let scale = 2.5 / size as f64;
        let expected = DMatrix::from_fn(size, size, |_, _| scale * noise.uniform());
        let [exponential, ..] = integrals(&expected).unwrap();
        let found = logarithm(&exponential).unwrap();
        assert!(close(&found, &expected, 1e-12), "{size}: {}", (found - expected).norm());
    }
}

#[test]
fn a_permutation_has_a_logarithm() {
    // The cube roots of 1; ordinary QR steps leave it as it is.
    let cycle = matrix(&[&[0.0, 0.0, 1.0], &[1.0, 0.0, 0.0], &[0.0, 1.0, 0.0]]);
    let [back, ..] = integrals(&logarithm(&cycle).unwrap()).unwrap();
    assert!(close(&back, &cycle, 1e-14));
    assert!(close(&logarithm(&DMatrix::identity(4, 4)).unwrap(), &DMatrix::zeros(4, 4), 1e-14));
    assert!(logarithm(&DMatrix::zeros(0, 0)).is_some());
}

#[test]
fn eigenvalues_far_apart_keep_their_digits() {
    let fast = matrix(&[&[1e-9, 0.3, 0.2], &[0.0, 0.999_999, 0.4], &[0.0, 0.0, 0.5]]);
    let found = logarithm(&fast).unwrap();
    // One rounding of the norm is 1e-7 of this eigenvalue.
    assert!((found[(0, 0)] - 1e-9_f64.ln()).abs() < 1e-6, "{found}");
    assert!((found[(1, 1)] - 0.999_999_f64.ln()).abs() < 1e-14, "{found}");
}
