use thetahat_numerics::noise::Noise;

use super::*;

#[test]
fn known_roots_come_back() {
    // (1 - 0.9 z^-1) (1 - 1.6 z^-1 + 0.8 z^-2) z^-2: the delay has no root.
    let polynomial = product(&[0.0, 0.0, 1.0, -0.9], &[1.0, -1.6, 0.8]);
    let roots = roots(&polynomial).unwrap();
    let expected = [Complex::new(0.9, 0.0), Complex::new(0.8, 0.4), Complex::new(0.8, -0.4)];
    assert_eq!(roots.len(), 3);
    for (root, expected) in roots.iter().zip(expected) {
        assert!((root - expected).modulus() < 1e-14, "{root}");
    }
    assert_eq!(roots[1], roots[2].conj());
}

#[test]
fn odd_polynomials_have_their_roots() {
    assert_eq!(roots(&[]).unwrap(), []);
    assert_eq!(roots(&[0.0, 0.0]).unwrap(), []);
    assert_eq!(roots(&[3.0]).unwrap(), []);
    assert_eq!(roots(&[2.0, 0.0, 0.0]).unwrap(), [Complex::new(0.0, 0.0); 2]);
    assert_eq!(roots(&[1e-320, 1.0, -0.5]).unwrap(), [Complex::new(0.5, 0.0)]);
    assert_eq!(roots(&[1.0, -1e200]).unwrap(), [Complex::new(1e200, 0.0)]);
}

#[test]
fn many_roots_on_a_circle_are_exact() {
    let mut polynomial = vec![0.0; 41];
    polynomial[0] = 1.0;
    polynomial[40] = -1.0;
    for root in roots(&polynomial).unwrap() {
        assert!((root.modulus() - 1.0).abs() < 1e-13, "{root}");
    }
}

/// p0 (z - z1) (z - z2) …
fn with_roots(lead: f64, roots: &[Complex<f64>]) -> Vec<f64> {
    let mut polynomial = Vec::new();
    multiply_out(roots.iter().copied(), &mut polynomial);
    polynomial.iter().map(|coefficient| lead * coefficient.re).collect()
}

fn real(values: &[f64]) -> Vec<Complex<f64>> {
    values.iter().map(|value| Complex::new(*value, 0.0)).collect()
}

#[test]
fn roots_of_all_sizes_are_exact_beside_one_another() {
    for expected in [real(&[-5e7, 30.0, 1.5, -0.4, 0.1, 1e-9]), real(&[1e100, 1.0, 1e-100])] {
        for lead in [1.0, 1e-3, 1e150] {
            let found = roots(&with_roots(lead, &expected)).unwrap();
            for (found, expected) in found.iter().zip(&expected) {
                assert!((found - expected).modulus() < 1e-13 * expected.modulus(), "{found} {expected}");
            }
        }
    }
}

#[test]
fn roots_of_random_polynomials_make_them_again() {
    let mut noise = Noise(1);
    for degree in (1..=20).cycle().take(200) {
        let polynomial = noise.take(degree + 1);
        let found = roots(&polynomial).unwrap();
        let again = with_roots(polynomial[0], &found);
        let largest = polynomial.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        for (value, again) in polynomial.iter().zip(&again) {
            assert!((value - again).abs() < 1e-11 * largest, "{polynomial:?}");
        }
        // Real, or with its conjugate.
        assert!(found.iter().all(|root| root.im == 0.0 || found.contains(&root.conj())));
    }
}

#[test]
fn clusters_are_as_close_as_rounding_lets_them_be() {
    for count in [2, 3, 5, 8] {
        // A relative change of eps moves a root of this multiplicity by about eps^(1/count).
        let spread = 4.0 * f64::EPSILON.powf(1.0 / f64::from(count));
        for root in roots(&with_roots(1.0, &real(&vec![0.9; count as usize]))).unwrap() {
            assert!((root - 0.9).modulus() < spread, "{count} {root}");
        }
    }
    // Wilkinson's: the roots 1 to 20, of condition up to 1e14.
    let wilkinson: Vec<f64> = (1..=20).rev().map(f64::from).collect();
    for (found, expected) in roots(&with_roots(1.0, &real(&wilkinson))).unwrap().iter().zip(wilkinson) {
        assert!((found - expected).modulus() < 0.05, "{found}");
    }
}

#[test]
fn every_polynomial_comes_to_an_end() {
    let mut noise = Noise(2);
    for _ in 0..300 {
        let size = 2 + (5.0 * (noise.uniform() + 1.0)) as usize;
        let wild: Vec<f64> =
            (0..size).map(|_| noise.uniform() * 10_f64.powf(307.0 * noise.uniform())).collect();
        assert!(roots(&wild).is_some(), "{wild:?}");
        let whole: Vec<f64> = (0..size).map(|_| (3.0 * noise.uniform()).round()).collect();
        assert!(roots(&whole).is_some(), "{whole:?}");
    }
    for edge in [[1.0, f64::MAX], [f64::MAX, 1.0], [1.0, 5e-324], [5e-324, 5e-324], [1e300, 1e-300]] {
        assert_eq!(roots(&edge).unwrap(), real(&[-edge[1] / edge[0]]), "{edge:?}");
    }
    assert_eq!(roots(&[1.0, f64::NAN]), None);
    assert_eq!(roots(&vec![1.0; 201]).unwrap().len(), 200);
}

#[test]
fn a_series_times_its_polynomial_is_one() {
    let a = [1.0, -1.5, 0.7];
    let identity = product(&a, &inverse_series(&a, 30));
    assert!((identity[0] - 1.0).abs() < 1e-15);
    assert!(identity[1..30].iter().all(|value| value.abs() < 1e-14));
}
