extern crate std;
use std::format;

use nalgebra::{Const, Matrix2, Matrix3, SMatrix, SVector, Vector2, Vector3};

use crate::noise::Noise;
use crate::textbook::{Square, difference, random, random_covariance};
use crate::{Covariance, Error, Real};

type Of<const N: usize> = Covariance<f64, Const<N>>;

/// That the factors are those of a positive semidefinite matrix: D not negative, all finite.
fn assert_legal<T: Real, const N: usize>(covariance: &Covariance<T, Const<N>>) {
    let factor = covariance.factor();
    assert!(factor.iter().all(T::is_finite));
    assert!(factor.diagonal().iter().all(|&variance| variance >= T::zero()));
    assert_eq!(factor, factor.upper_triangle());
}

fn check_factors_of_random_matrices<const N: usize>(noise: &mut Noise) {
    for _ in 0..20 {
        let matrix = random_covariance::<N>(noise);
        let covariance = Of::new(&matrix).unwrap();
        assert_legal(&covariance);
        assert!(difference(&covariance.matrix(), &matrix) < 2e-14);
        let symmetric = covariance.matrix();
        assert_eq!(symmetric, symmetric.transpose());
        assert!((covariance.variances() - symmetric.diagonal()).amax() < 1e-14);
        assert_eq!(Of::from_factor(covariance.factor()).unwrap(), covariance);

        // The same in other units, 12 decades apart, is the same.
        let units = Square::<N>::from_diagonal(&SVector::from_fn(|i, _| 10_f64.powi((i % 3) as i32 * 6 - 6)));
        let scaled = units * matrix * units;
        assert!(difference(&Of::new(&scaled).unwrap().matrix(), &scaled) < 2e-14);
    }
}

#[test]
fn the_factors_are_those_of_the_matrix() {
    let mut noise = Noise(1);
    check_factors_of_random_matrices::<1>(&mut noise);
    check_factors_of_random_matrices::<2>(&mut noise);
    check_factors_of_random_matrices::<5>(&mut noise);
    check_factors_of_random_matrices::<9>(&mut noise);
    assert_eq!(Covariance::<f64, Const<0>>::zero(Const).matrix().len(), 0);
}

fn check_singular_matrices<T: Real + Into<f64>, const N: usize>(noise: &mut Noise, tolerance: f64) {
    for rank in 0..=N {
        for _ in 0..200 {
            let root: Square<N> = SMatrix::from_fn(|_, j| if j < rank { noise.next() } else { 0.0 });
            let exact = root * root.transpose();
            let matrix: SMatrix<T, N, N> = nalgebra::convert(exact);
            let covariance = Covariance::<T, Const<N>>::new(&matrix).unwrap();
            assert_legal(&covariance);
            let found = covariance.matrix().map(Into::into);
            assert!(difference(&found, &exact) < tolerance, "{N} {rank} {}", difference(&found, &exact));
        }
    }
}

#[test]
fn singular_matrices_are_covariances_too() {
    let mut noise = Noise(2);
    check_singular_matrices::<f64, 2>(&mut noise, 1e-14);
    check_singular_matrices::<f64, 5>(&mut noise, 5e-14);
    check_singular_matrices::<f64, 8>(&mut noise, 1e-13);
    check_singular_matrices::<f32, 2>(&mut noise, 3e-6);
    check_singular_matrices::<f32, 5>(&mut noise, 3e-5);
    check_singular_matrices::<f32, 8>(&mut noise, 5e-5);

    let known = Matrix3::from_diagonal(&Vector3::new(1.0, 0.0, 2.0));
    assert_eq!(Of::new(&known).unwrap().matrix(), known);
    let same = Matrix2::new(1.0, 1.0, 1.0, 1.0);
    assert_eq!(Of::new(&same).unwrap().matrix(), same);
}

#[test]
fn what_a_nearly_singular_matrix_says_is_not_dropped() {
    // Elements 1 and 2 differ by δ of variance 1e-16, below the rounding of their variances; element 0 is 10^8 δ.
    // So P_01 - P_02 = 1e-8 says how δ and element 0 go together.
    for order in [[0, 1, 2], [1, 0, 2], [1, 2, 0], [2, 1, 0]] {
        let matrix = Matrix3::new(1.0, 1e-8, 0.0, 1e-8, 1.0, 1.0, 0.0, 1.0, 1.0);
        let matrix = Matrix3::from_fn(|i, j| matrix[(order[i], order[j])]);
        assert!(difference(&Of::new(&matrix).unwrap().matrix(), &matrix) < 4.0 * f64::EPSILON);
    }
}

#[test]
fn indefinite_matrices_are_refused() {
    let refused =
        |matrix| matches!(Of::<2>::new(&matrix), Err(Error::NotPositive { argument: "covariance", .. }));
    assert!(refused(Matrix2::new(1.0, 0.0, 0.0, -1e-300)));
    assert!(refused(Matrix2::new(1.0, 2.0, 2.0, 1.0)));
    assert!(refused(Matrix2::new(1.0, 1e-20, 1e-20, 0.0)));
    assert!(refused(Matrix2::new(0.0, 1e-20, 1e-20, 1.0)));
    let limit = 1.0 + 1e-12;
    assert!(refused(Matrix2::new(1.0, limit, limit, 1.0)));
    assert!(refused(Matrix2::new(1e-20, limit * 1e-10, limit * 1e-10, 1.0)));
    // Correlations of 0.9, 0.9 and -0.9: each pair could be, the three cannot.
    let matrix = Matrix3::new(1.0, 0.9, -0.9, 0.9, 1.0, 0.9, -0.9, 0.9, 1.0);
    assert!(matches!(Of::new(&matrix), Err(Error::NotPositive { .. })));
    // Only just indefinite: some rounding below a singular one. Just as much is allowed.
    let mut noise = Noise(3);
    for _ in 0..100 {
        let root: SMatrix<f64, 6, 3> = random(&mut noise);
        let matrix = root * root.transpose();
        let scale = matrix.diagonal().amax();
        assert!(Of::new(&(matrix - Square::identity() * 1e-16 * scale)).is_ok());
        assert!(Of::new(&(matrix - Square::identity() * 1e-12 * scale)).is_err());
    }
}

#[test]
fn what_is_no_covariance_is_an_error() {
    let not_finite = Err(Error::NotFinite { argument: "covariance" });
    assert_eq!(Of::new(&Matrix2::new(1.0, 0.0, f64::NAN, 1.0)), not_finite);
    assert_eq!(Of::new(&Matrix2::new(1.0, f64::INFINITY, f64::INFINITY, 1.0)), not_finite);
    let not_symmetric = Err(Error::NotSymmetric { row: 0, column: 1 });
    assert_eq!(Of::new(&Matrix2::new(1.0, 0.5, 0.4, 1.0)), not_symmetric);
    assert_eq!(Of::new(&Matrix2::new(1.0, 1e-14, -1e-14, 1.0)), not_symmetric);
    // As products round, though, it need not be symmetric.
    assert!(Of::new(&Matrix2::new(1.0, 1e-16, -1e-16, 1.0)).is_ok());

    assert_eq!(Of::from_diagonal(&Vector2::new(1.0, -1.0)), Err(Error::Negative { argument: "variances" }));
    let infinite = Vector2::new(1.0, f64::INFINITY);
    assert_eq!(Of::from_diagonal(&infinite), Err(Error::NotFinite { argument: "variances" }));

    let factor = Err(Error::NotFinite { argument: "factor" });
    assert_eq!(Of::from_factor(Matrix2::new(1.0, f64::NAN, 0.0, 1.0)), factor);
    let negative = Err(Error::Negative { argument: "factor" });
    assert_eq!(Of::from_factor(Matrix2::new(1.0, 0.0, 0.0, -1.0)), negative);
    let below = Err(Error::NotTriangular { row: 1, column: 0 });
    assert_eq!(Of::from_factor(Matrix2::new(1.0, 0.0, 1.0, 1.0)), below);

    let large = Of::from_diagonal(&Vector2::new(1e300, 1.0)).unwrap();
    assert_eq!(large.transformed(&(Matrix2::identity() * 1e10)), Err(Error::Overflow));
    let infinite = Matrix2::identity() * f64::INFINITY;
    assert_eq!(large.transformed(&infinite), Err(Error::NotFinite { argument: "matrix" }));
    let largest = Of::from_diagonal(&Vector2::new(f64::MAX, 1.0)).unwrap();
    assert_eq!(largest.plus(&largest), Err(Error::Overflow));
}

#[test]
fn transformations_and_sums_are_those_of_the_matrices() {
    let mut noise = Noise(4);
    let matrix = random_covariance::<4>(&mut noise);
    let covariance = Of::new(&matrix).unwrap();
    for _ in 0..20 {
        let wide: SMatrix<f64, 2, 4> = random(&mut noise);
        let found = covariance.transformed(&wide).unwrap();
        assert!(difference(&found.matrix(), &(wide * matrix * wide.transpose())) < 1e-14);
        // Singular: seven numbers made of four.
        let tall: SMatrix<f64, 7, 4> = random(&mut noise);
        let found = covariance.transformed(&tall).unwrap();
        assert_legal(&found);
        assert!(difference(&found.matrix(), &(tall * matrix * tall.transpose())) < 1e-14);

        let other = random_covariance::<4>(&mut noise);
        let sum = covariance.plus(&Of::new(&other).unwrap()).unwrap();
        assert!(difference(&sum.matrix(), &(matrix + other)) < 1e-14);
    }
    assert_eq!(covariance.plus(&Covariance::zero(Const)).unwrap(), covariance);
    assert_eq!(covariance.transformed(&Square::zeros()).unwrap(), Covariance::zero(Const));
}

fn check_missing<T: Real + Into<f64>>(covariance: &Covariance<T, Const<5>>, tolerance: f64) {
    let given: Square<5> = covariance.matrix().map(Into::into);
    for missing in 0..32_usize {
        let is_missing = |index: usize| missing >> index & 1 == 1;
        let rest = covariance.without(is_missing);
        assert_legal(&rest);
        let expected =
            Square::<5>::from_fn(|i, j| if is_missing(i) || is_missing(j) { 0.0 } else { given[(i, j)] });
        assert!(difference(&rest.matrix().map(Into::into), &expected) < tolerance, "{missing}");
    }
}

#[test]
fn what_is_left_without_missing_elements_is_a_part_of_the_matrix() {
    let mut noise = Noise(5);
    for rank in [1, 2, 4, 5] {
        let root: Square<5> = SMatrix::from_fn(|_, j| if j < rank { noise.next() } else { 0.0 });
        let matrix = root * root.transpose();
        check_missing(&Covariance::<f64, _>::new(&matrix).unwrap(), 1e-14);
        let single: SMatrix<f32, 5, 5> = nalgebra::convert(matrix);
        check_missing(&Covariance::<f32, _>::new(&single).unwrap(), 3e-6);
    }
}

#[test]
fn it_prints_its_factors() {
    let covariance = Of::new(&Matrix2::new(4.0, 1.0, 1.0, 2.0)).unwrap();
    assert_eq!(format!("{covariance:?}"), "Covariance { factor: [[3.5, 0.0], [0.5, 2.0]] }");
}

#[test]
fn variances_below_the_normal_numbers_are_covariances() {
    for tiny in [1e-39_f32, 1e-45, f32::MIN_POSITIVE] {
        let found = Covariance::<f32, Const<1>>::new(&nalgebra::Matrix1::new(tiny)).unwrap();
        assert!((found.matrix()[0] - tiny).abs() < f32::MIN_POSITIVE);
        let given = Matrix2::new(tiny, 0.0, 0.0, 1.0);
        let found = Covariance::<f32, Const<2>>::new(&given).unwrap();
        assert!((found.matrix() - given).amax() < f32::MIN_POSITIVE);
    }
    assert!(Covariance::<f32, Const<1>>::new(&nalgebra::Matrix1::new(-1e-39)).is_err());
    assert!(Of::new(&(Matrix2::identity() * 1e-310)).is_ok());
    let large = Of::from_diagonal(&Vector2::new(1e308, 1e308)).unwrap();
    assert_eq!(large.transformed(&Matrix2::new(1.0, 1.0, 1.0, -1.0)), Err(Error::Overflow));
}
