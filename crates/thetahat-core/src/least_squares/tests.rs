extern crate std;
use std::vec;
use std::vec::Vec;

use nalgebra::{Const, SMatrix, SVector};

use crate::noise::Noise;
use crate::{Dimension, Error, LeastSquares, Real};

type Problem<const K: usize> = LeastSquares<f64, Const<K>>;

fn random<const M: usize, const K: usize>(seed: u64) -> (SMatrix<f64, M, K>, SVector<f64, M>) {
    let mut noise = Noise(seed);
    (SMatrix::from_fn(|_, _| noise.next()), SVector::from_fn(|_, _| noise.next()))
}

fn add_all<T: Real, const M: usize, const K: usize>(
    problem: &mut LeastSquares<T, Const<K>>,
    rows: &SMatrix<T, M, K>,
    outputs: &SVector<T, M>,
) {
    for (row, &output) in rows.row_iter().zip(outputs.iter()) {
        problem.add(&row.transpose(), output).unwrap();
    }
}

fn problem_of<T: Real, const M: usize, const K: usize>(
    rows: &SMatrix<T, M, K>,
    outputs: &SVector<T, M>,
) -> LeastSquares<T, Const<K>> {
    let mut problem = LeastSquares::new();
    add_all(&mut problem, rows, outputs);
    problem
}

/// Everything a problem holds, for comparison to the bit.
fn contents<T: Real + Into<f64>, N: Dimension>(problem: &LeastSquares<T, N>) -> Vec<u64> {
    let sums = problem.factor_rows.iter().chain(problem.rotated_output.iter());
    let sums = sums.chain([&problem.residual_norm]);
    let bits = sums.flat_map(|sum| [sum.value, sum.carry].map(|number| number.into().to_bits()));
    let counts = [problem.rows, problem.uncompensated_rows];
    bits.chain(counts.map(|count| count as u64)).collect()
}

/// R'R = A'A, R'z = A'y, z'z + rho^2 = y'y, and R upper triangular.
fn check_identities<T: Real, const M: usize, const K: usize>(
    problem: &LeastSquares<T, Const<K>>,
    rows: &SMatrix<T, M, K>,
    outputs: &SVector<T, M>,
    tolerance: T,
) {
    let (factor, rotated) = (problem.factor(), problem.rotated_output());
    assert!((factor.tr_mul(&factor) - rows.tr_mul(rows)).amax() <= tolerance);
    assert!((factor.tr_mul(&rotated) - rows.tr_mul(outputs)).amax() <= tolerance);
    let energy = rotated.norm_squared() + problem.residual_norm() * problem.residual_norm();
    assert!((energy - outputs.norm_squared()).abs() <= tolerance);
    assert_eq!(factor, factor.upper_triangle());
    assert!(factor.diagonal().iter().all(|entry| *entry >= T::zero()));
    assert_eq!(problem.rows(), M);
}

#[test]
fn the_factor_is_that_of_the_rows() {
    let (rows, outputs) = random::<60, 5>(1);
    check_identities(&problem_of(&rows, &outputs), &rows, &outputs, 4e-14);
    let (rows, outputs): (SMatrix<f32, 60, 5>, SVector<f32, 60>) =
        (nalgebra::convert_unchecked(rows), nalgebra::convert_unchecked(outputs));
    check_identities(&problem_of(&rows, &outputs), &rows, &outputs, 2e-5);

    // Fewer rows than columns, one row, one column.
    let (rows, outputs) = random::<3, 5>(2);
    check_identities(&problem_of(&rows, &outputs), &rows, &outputs, 1e-15);
    let (rows, outputs) = random::<1, 4>(3);
    check_identities(&problem_of(&rows, &outputs), &rows, &outputs, 1e-15);
    let (rows, outputs) = random::<9, 1>(4);
    check_identities(&problem_of(&rows, &outputs), &rows, &outputs, 4e-15);

    // Many zeros: rows that skip rotations, and land in the middle of the triangle.
    let (mut rows, outputs) = random::<40, 6>(5);
    let mut noise = Noise(6);
    rows.iter_mut().for_each(|entry| {
        if noise.next() < 0.6 {
            *entry = 0.0;
        }
    });
    check_identities(&problem_of(&rows, &outputs), &rows, &outputs, 2e-14);
}

#[test]
fn the_solution_is_that_of_an_independent_solver() {
    for seed in 0..20 {
        let (rows, outputs) = random::<30, 4>(seed);
        let solution = problem_of(&rows, &outputs).solve().unwrap();
        let expected = rows.svd(true, true).solve(&outputs, 0.0).unwrap();
        assert!((solution.parameters() - expected).amax() < 1e-14);
        let residuals = outputs - rows * expected;
        assert!((solution.residual_norm() - residuals.norm()).abs() < 1e-14);
        let squares = solution.residual_sum_of_squares();
        assert!((squares - residuals.norm_squared()).abs() < 2e-14);
        assert_eq!(solution.degrees_of_freedom(), 26);
        assert!((solution.residual_variance().unwrap() - squares / 26.0).abs() < 1e-15);
    }
}

#[test]
fn the_covariance_is_its_definition() {
    let (rows, outputs) = random::<30, 4>(7);
    let solution = problem_of(&rows, &outputs).solve().unwrap();
    let inverse = rows.tr_mul(&rows).try_inverse().unwrap();
    let expected = inverse * solution.residual_variance().unwrap();
    let covariance = solution.covariance().unwrap();
    assert!((covariance - expected).amax() < 1e-15);
    assert_eq!(covariance, covariance.transpose());
    let errors = solution.standard_errors().unwrap();
    assert!((errors.component_mul(&errors) - covariance.diagonal()).amax() < 1e-16);
}

#[test]
fn standard_errors_survive_units_whose_variances_do_not() {
    let (rows, outputs) = random::<30, 2>(8);
    let plain = problem_of(&rows, &outputs).solve().unwrap();
    let mut scaled_rows = rows;
    scaled_rows.column_mut(0).scale_mut(1e-200);
    let scaled = problem_of(&scaled_rows, &outputs).solve().unwrap();
    let (plain_errors, scaled_errors) = (plain.standard_errors().unwrap(), scaled.standard_errors().unwrap());
    assert!((scaled_errors[0] / plain_errors[0] / 1e200 - 1.0).abs() < 1e-14);
    assert!((scaled_errors[1] / plain_errors[1] - 1.0).abs() < 1e-14);
    let (plain, scaled) = (plain.covariance().unwrap(), scaled.covariance().unwrap());
    assert_eq!(scaled[(0, 0)], f64::INFINITY);
    assert!((scaled[(0, 1)] / plain[(0, 1)] / 1e200 - 1.0).abs() < 1e-13);
    assert!((scaled[(1, 1)] / plain[(1, 1)] - 1.0).abs() < 1e-14);
}

#[test]
fn merging_parts_equals_the_whole() {
    let (rows, outputs) = random::<24, 4>(9);
    let whole = problem_of(&rows, &outputs);
    for cut in 0..=24 {
        let (mut first, mut second) = (Problem::<4>::new(), Problem::new());
        for (index, row) in rows.row_iter().enumerate() {
            let part = if index < cut { &mut first } else { &mut second };
            part.add(&row.transpose(), outputs[index]).unwrap();
        }
        let before = contents(&second);
        first.merge(&second).unwrap();
        assert_eq!(contents(&second), before);
        check_identities(&first, &rows, &outputs, 2e-14);
        assert!((first.factor() - whole.factor()).amax() < 1e-14);
        assert!((first.residual_norm() - whole.residual_norm()).abs() < 1e-14);
        let (merged, expected) = (first.solve().unwrap(), whole.solve().unwrap());
        assert!((merged.parameters() - expected.parameters()).amax() < 1e-14);
    }
}

#[test]
fn merging_nothing_changes_nothing() {
    let (rows, outputs) = random::<24, 4>(10);
    let mut problem = problem_of(&rows, &outputs);
    let before = contents(&problem);
    problem.merge(&LeastSquares::new()).unwrap();
    assert_eq!(contents(&problem), before);
}

#[test]
fn the_order_of_the_rows_does_not_matter() {
    let (rows, outputs) = random::<50, 4>(11);
    let forward = problem_of(&rows, &outputs);
    let mut backward = Problem::<4>::new();
    for index in (0..50).rev() {
        backward.add(&rows.row(index).transpose(), outputs[index]).unwrap();
    }
    assert!((forward.factor() - backward.factor()).amax() < 2e-14);
    assert!((forward.rotated_output() - backward.rotated_output()).amax() < 2e-14);
    assert!((forward.residual_norm() - backward.residual_norm()).abs() < 1e-14);
}

#[test]
fn as_many_rows_as_parameters_fit_exactly_and_say_nothing_of_the_variance() {
    let (rows, outputs) = random::<4, 4>(12);
    let problem = problem_of(&rows, &outputs);
    assert_eq!(problem.residual_norm(), 0.0);
    let solution = problem.solve().unwrap();
    assert!((rows * solution.parameters() - outputs).amax() < 1e-14);
    assert_eq!(solution.degrees_of_freedom(), 0);
    assert_eq!(solution.residual_variance(), None);
    assert_eq!(solution.covariance(), None);
    assert_eq!(solution.standard_errors(), None);
}

#[test]
fn too_few_rows_are_an_error() {
    let mut problem = Problem::<2>::new();
    for found in 0..2 {
        let expected = Error::TooFewRows { needed: 2, found };
        assert_eq!(problem.solve().unwrap_err(), expected);
        assert_eq!(problem.condition(), f64::INFINITY);
        assert_eq!(problem.rank().value(), found);
        problem.add(&SVector::from([1.0, found as f64]), 1.0).unwrap();
    }
    assert!(problem.solve().is_ok());
}

#[test]
fn no_parameters_leave_the_outputs() {
    let mut problem = Problem::<0>::default();
    problem.add(&SVector::from([]), 3.0).unwrap();
    problem.add(&SVector::from([]), -4.0).unwrap();
    assert!(problem.rank().is_full());
    assert_eq!(problem.condition(), 1.0);
    let variance = problem.solve().unwrap().residual_variance().unwrap();
    assert!((variance - 12.5).abs() < 1e-14);
    assert_eq!(problem.solve().unwrap().covariance().unwrap().len(), 0);
}

#[test]
fn bad_rows_leave_everything_as_it_was() {
    fn check<T: Real + Into<f64>>(filled: LeastSquares<T, Const<3>>, too_large: T) {
        let not_finite = |argument| Error::NotFinite { argument };
        let large = |argument| Error::TooLarge { argument };
        let good = SVector::repeat(T::one());
        for mut problem in [LeastSquares::new(), filled] {
            let before = contents(&problem);
            for (bad, error) in [
                (T::NAN, not_finite as fn(&'static str) -> Error),
                (T::INFINITY, not_finite),
                (-T::INFINITY, not_finite),
                (too_large, large),
                (-too_large, large),
            ] {
                for position in 0..3 {
                    let mut row = good;
                    row[position] = bad;
                    assert_eq!(problem.add(&row, T::one()), Err(error("regressor")));
                    assert_eq!(contents(&problem), before);
                }
                assert_eq!(problem.add(&good, bad), Err(error("output")));
                assert_eq!(contents(&problem), before);
            }
        }
    }
    let (rows, outputs) = random::<10, 3>(13);
    check(problem_of(&rows, &outputs), f64::MAX);
    check(problem_of(&rows, &outputs), f64::LARGEST_ENTRY * 1.001);
    let (rows, outputs): (SMatrix<f32, 10, 3>, SVector<f32, 10>) =
        (nalgebra::convert_unchecked(rows), nalgebra::convert_unchecked(outputs));
    check(problem_of(&rows, &outputs), f32::MAX);
    check(problem_of(&rows, &outputs), f32::LARGEST_ENTRY * 1.001);
}

#[test]
fn the_largest_entries_never_overflow() {
    fn check<T: Real + Into<f64>>(from: fn(f64) -> T) {
        let mut noise = Noise(14);
        let mut problem = LeastSquares::<T, Const<4>>::new();
        let mut other = LeastSquares::new();
        for _ in 0..2000 {
            let mut entry = || T::LARGEST_ENTRY * from(noise.next()).signum();
            let row = SVector::from_fn(|_, _| entry());
            problem.add(&row, entry()).unwrap();
            other.add(&row, entry()).unwrap();
        }
        problem.merge(&other).unwrap();
        assert!(problem.factor().iter().all(|&entry| entry.into().is_finite()));
        assert!(problem.condition().into() < 1.2);
        assert!(problem.solve().is_ok());
        // The limit of `from_factor` admits what rows within the limit of `add` make.
        let copy = LeastSquares::<T, Const<4>>::from_factor(
            &problem.factor(),
            &problem.rotated_output(),
            problem.residual_norm(),
            problem.rows(),
        );
        assert_eq!(copy.unwrap().factor(), problem.factor());
    }
    check::<f32>(|number| number as f32);
    check::<f64>(|number| number);
}

#[test]
fn residuals_whose_squares_underflow_are_kept() {
    let mut problem = Problem::<1>::new();
    for output in [1.0, 2.0, 3.0, 6.0] {
        problem.add(&SVector::from([1.0]), output * 1e-200).unwrap();
    }
    assert!((problem.residual_norm() / 1e-200 - 14.0_f64.sqrt()).abs() < 1e-14);
}

#[test]
fn dependent_columns_are_named() {
    fn dependent(change: impl Fn(&mut SMatrix<f64, 40, 5>)) -> Vec<usize> {
        let (mut rows, outputs) = random::<40, 5>(15);
        change(&mut rows);
        let problem = problem_of(&rows, &outputs);
        let rank = problem.rank();
        let named: Vec<usize> = rank.dependent().collect();
        assert_eq!(rank.value(), 5 - named.len());
        assert_eq!(rank.is_full(), named.is_empty());
        match named.first() {
            Some(&column) => {
                assert_eq!(problem.solve().unwrap_err(), Error::RankDeficient { column });
                assert!(problem.condition() > 1e14);
            }
            None => assert!(problem.solve().is_ok()),
        }
        named
    }
    assert_eq!(dependent(|_| ()), vec![]);
    for column in 0..5 {
        assert_eq!(dependent(|rows| rows.column_mut(column).fill(0.0)), [column]);
    }
    assert_eq!(dependent(|rows| rows.fill(0.0)), [0, 1, 2, 3, 4]);
    // Of columns that are multiples of one another the first is kept, whatever their scale.
    for factor in [1.0, -1.0, 3e-120, 3e120] {
        let duplicate = |rows: &mut SMatrix<f64, 40, 5>| {
            let copy = rows.column(1) * factor;
            rows.set_column(3, &copy);
        };
        assert_eq!(dependent(duplicate), [3]);
    }
    let sum = |rows: &mut SMatrix<f64, 40, 5>| {
        let sum = rows.column(0) - rows.column(2) * 2.0 + rows.column(4) * 0.3;
        rows.set_column(3, &sum);
    };
    // One of the four that are related; column 1 is not.
    let named = dependent(sum);
    assert!(named.len() == 1 && named != [1]);
    let both = |rows: &mut SMatrix<f64, 40, 5>| {
        rows.column_mut(0).fill(0.0);
        let copy = rows.column(1).into_owned();
        rows.set_column(4, &copy);
    };
    assert_eq!(dependent(both), [0, 4]);
    // Nearly dependent is not dependent.
    let nearly = |rows: &mut SMatrix<f64, 40, 5>| {
        let copy = rows.column(1) + rows.column(3) * 1e-11;
        rows.set_column(3, &copy);
    };
    assert_eq!(dependent(nearly), vec![]);
}

#[test]
fn more_rounding_is_expected_of_a_factor_from_elsewhere() {
    let factor = SMatrix::<f64, 2, 2>::new(1.0, 1.0, 0.0, 1e-14);
    let rank_after = |rows| {
        let problem = Problem::<2>::from_factor(&factor, &SVector::zeros(), 0.0, rows).unwrap();
        let mut merged = Problem::new();
        merged.merge(&problem).unwrap();
        assert_eq!(merged.rank(), problem.rank());
        merged.rank().value()
    };
    assert_eq!(rank_after(100), 2); // (8 + 10) epsilon = 4e-15
    assert_eq!(rank_after(10_000), 1); // (8 + 100) epsilon = 2.4e-14
}

#[test]
fn scale_is_not_dependence() {
    let (mut rows, outputs) = random::<40, 5>(16);
    let plain = problem_of(&rows, &outputs);
    let scales = [1e-150, 1.0, 1e150, 1e-75, 1e75];
    for (mut column, scale) in rows.column_iter_mut().zip(scales) {
        column.scale_mut(scale);
    }
    let scaled = problem_of(&rows, &outputs);
    assert!(scaled.rank().is_full());
    assert!((scaled.condition() / plain.condition() - 1.0).abs() < 1e-12);
    let (plain, scaled) = (plain.solve().unwrap(), scaled.solve().unwrap());
    for (index, scale) in scales.into_iter().enumerate() {
        let ratio = scaled.parameters()[index] * scale / plain.parameters()[index];
        assert!((ratio - 1.0).abs() < 1e-13);
    }

    let (rows, outputs) = random::<40, 3>(17);
    let (mut rows, outputs): (SMatrix<f32, 40, 3>, SVector<f32, 40>) =
        (nalgebra::convert_unchecked(rows), nalgebra::convert_unchecked(outputs));
    rows.column_mut(0).scale_mut(1e-25);
    rows.column_mut(2).scale_mut(1e25);
    assert!(problem_of(&rows, &outputs).solve().is_ok());
}

#[test]
fn a_long_record_in_single_precision_stays_accurate() {
    // Rotations as they are usually written, without compensation, are wrong by 2e-3 here.
    let mut noise = Noise(18);
    let mut single = LeastSquares::<f32, Const<2>>::new();
    let mut double = Problem::<2>::new();
    let mut dependent = LeastSquares::<f32, Const<3>>::new();
    for _ in 0..100_000 {
        let [a, b, output] = [(); 3].map(|()| noise.next() as f32);
        single.add(&SVector::from([a, b]), output).unwrap();
        double.add(&SVector::from([a, b].map(f64::from)), f64::from(output)).unwrap();
        dependent.add(&SVector::from([a, b, a + b]), output).unwrap();
    }
    let factor: SMatrix<f64, 2, 2> = nalgebra::convert(single.factor());
    let error = (factor - double.factor()).amax() / double.factor().amax();
    assert!(error < 3e-7, "{error}");
    let error = f64::from(single.residual_norm()) / double.residual_norm() - 1.0;
    assert!(error.abs() < 3e-7, "{error}");
    assert_eq!(dependent.rank().dependent().collect::<Vec<_>>(), [2]);
}

#[test]
fn ill_conditioned_columns_are_as_accurate_as_with_reflections() {
    // Powers of t. In single precision, so that the answer in double precision is exact in comparison.
    let (mut our_error, mut their_error) = (0.0_f64, 0.0_f64);
    for seed in 0..20 {
        let mut noise = Noise(seed);
        let rows = SMatrix::<f32, 60, 6>::from_fn(|row, power| {
            let t = row as f32 / 60.0;
            t.powi(power as i32)
        });
        let outputs = SVector::<f32, 60>::from_fn(|_, _| noise.next() as f32);
        let exact_rows: SMatrix<f64, 60, 6> = nalgebra::convert(rows);
        let exact_outputs: SVector<f64, 60> = nalgebra::convert(outputs);
        let exact = exact_rows.svd(true, true).solve(&exact_outputs, 0.0).unwrap();

        let ours = problem_of(&rows, &outputs).solve().unwrap();
        let mut rotated = outputs;
        let reflections = rows.qr();
        reflections.q_tr_mul(&mut rotated);
        let theirs = reflections.r().solve_upper_triangular(&rotated.fixed_rows::<6>(0)).unwrap();

        let distance = |parameters: SVector<f32, 6>| {
            let parameters: SVector<f64, 6> = nalgebra::convert(parameters);
            (parameters - exact).norm() / exact.norm()
        };
        our_error = our_error.max(distance(*ours.parameters()));
        their_error = their_error.max(distance(theirs));
    }
    assert!(our_error < 2.0 * their_error, "{our_error} {their_error}");
    assert!(our_error < 2e-3, "{our_error}"); // the condition number is 3e3, epsilon 1e-7
}

#[test]
fn the_condition_number_is_within_its_band() {
    let mut noise = Noise(19);
    for trial in 0..300 {
        let spread = 10.0_f64.powf(f64::from(trial % 10) / 4.0);
        let left = SMatrix::<f64, 20, 6>::from_fn(|_, _| noise.next()).qr().q();
        let right = SMatrix::<f64, 6, 6>::from_fn(|_, _| noise.next()).qr().q();
        let values = SVector::<f64, 6>::from_fn(|index, _| spread.powi(-(index as i32)));
        let mut rows = left * SMatrix::from_diagonal(&values) * right;
        let problem = problem_of(&rows, &SVector::zeros());
        for mut column in rows.column_iter_mut() {
            column.normalize_mut();
        }
        let values = rows.singular_values();
        let ratio = problem.condition() / (values.max() / values.min());
        assert!((0.77..1.01).contains(&ratio), "{ratio}");
    }
}

#[test]
fn a_factor_from_elsewhere_continues() {
    let (rows, outputs) = random::<40, 4>(20);
    let reflections = rows.fixed_rows::<25>(0).into_owned().qr();
    let mut rotated = outputs.fixed_rows::<25>(0).into_owned();
    reflections.q_tr_mul(&mut rotated);
    let (top, rest) = (rotated.fixed_rows::<4>(0).into_owned(), rotated.fixed_rows::<21>(4).norm());
    // A sign that `add` does not make.
    let (mut factor, mut top) = (reflections.r(), top);
    factor.row_mut(1).neg_mut();
    top[1] = -top[1];

    let mut problem = Problem::<4>::from_factor(&factor, &top, rest, 25).unwrap();
    assert_eq!(problem.factor(), factor);
    let late = (25..40).map(|index| (rows.row(index), outputs[index]));
    for (row, output) in late {
        problem.add(&row.transpose(), output).unwrap();
    }
    let (continued, whole) = (problem.solve().unwrap(), problem_of(&rows, &outputs).solve().unwrap());
    assert!((continued.parameters() - whole.parameters()).amax() < 1e-14);
    assert!((continued.residual_norm() - whole.residual_norm()).abs() < 1e-14);
    let difference = continued.covariance().unwrap() - whole.covariance().unwrap();
    assert!(difference.amax() < 1e-15);
}

#[test]
fn a_bad_factor_is_refused() {
    let factor = SMatrix::<f64, 2, 2>::new(1.0, 2.0, 0.0, 3.0);
    let output = SVector::from([4.0, 5.0]);
    let refused =
        |factor, output, norm, rows| Problem::<2>::from_factor(&factor, &output, norm, rows).unwrap_err();
    assert!(Problem::<2>::from_factor(&factor, &output, 0.5, 3).is_ok());
    assert!(Problem::<2>::from_factor(&factor, &output, 0.0, 2).is_ok());

    let argument = "factor";
    let with = |entry| SMatrix::<f64, 2, 2>::new(1.0, entry, 0.0, 3.0);
    assert_eq!(refused(with(f64::NAN), output, 0.5, 3), Error::NotFinite { argument });
    assert_eq!(refused(with(1e299), output, 0.5, 3), Error::TooLarge { argument });
    let lower = SMatrix::<f64, 2, 2>::new(1.0, 2.0, 1e-9, 3.0);
    assert_eq!(refused(lower, output, 0.5, 3), Error::NotTriangular { row: 1, column: 0 });

    let argument = "rotated_output";
    let with = |entry| SVector::from([4.0, entry]);
    assert_eq!(refused(factor, with(f64::INFINITY), 0.5, 3), Error::NotFinite { argument });
    assert_eq!(refused(factor, with(-1e299), 0.5, 3), Error::TooLarge { argument });

    let argument = "residual_norm";
    assert_eq!(refused(factor, output, f64::NAN, 3), Error::NotFinite { argument });
    assert_eq!(refused(factor, output, 1e299, 3), Error::TooLarge { argument });
    assert_eq!(refused(factor, output, -0.5, 3), Error::Negative { argument });

    assert_eq!(refused(factor, output, 0.5, 2), Error::TooFewRows { needed: 3, found: 2 });
    assert_eq!(refused(factor, output, 0.0, 1), Error::TooFewRows { needed: 2, found: 1 });
}

#[test]
fn a_full_counter_of_rows_is_an_error() {
    let factor = SMatrix::<f64, 1, 1>::new(1.0);
    let mut problem = Problem::<1>::from_factor(&factor, &SVector::from([2.0]), 0.5, usize::MAX).unwrap();
    let before = contents(&problem);
    assert_eq!(problem.add(&SVector::from([1.0]), 1.0), Err(Error::TooManyRows));
    assert_eq!(problem.merge(&problem.clone()), Err(Error::TooManyRows));
    assert_eq!(contents(&problem), before);
}

#[test]
fn a_result_that_does_not_fit_is_an_error() {
    let factor = SMatrix::<f64, 1, 1>::new(1e-310);
    let problem = Problem::<1>::from_factor(&factor, &SVector::from([1.0]), 0.5, 3).unwrap();
    assert_eq!(problem.solve().unwrap_err(), Error::Overflow);
}

#[cfg(feature = "alloc")]
mod run_time_size {
    use nalgebra::{DMatrix, DVector, Dyn, OVector};

    use super::*;

    fn both<const K: usize>(rows: usize, seed: u64) -> (Problem<K>, LeastSquares<f64, Dyn>) {
        let mut noise = Noise(seed);
        let mut fixed = Problem::<K>::new();
        let mut dynamic = LeastSquares::with_size(Dyn(K));
        for _ in 0..rows {
            let row = SVector::<f64, K>::from_fn(|_, _| noise.next());
            let output = noise.next();
            fixed.add(&row, output).unwrap();
            dynamic.add(&DVector::from_column_slice(row.as_slice()), output).unwrap();
        }
        (fixed, dynamic)
    }

    fn bits<N: Dimension>(numbers: &OVector<f64, N>) -> Vec<u64> {
        numbers.iter().map(|number| number.to_bits()).collect()
    }

    #[test]
    fn it_agrees_with_the_static_size_to_the_bit() {
        let (mut fixed, mut dynamic) = both::<5>(40, 21);
        assert_eq!(contents(&fixed), contents(&dynamic));
        let (more_fixed, more_dynamic) = both::<5>(9, 22);
        fixed.merge(&more_fixed).unwrap();
        dynamic.merge(&more_dynamic).unwrap();
        assert_eq!(contents(&fixed), contents(&dynamic));
        assert_eq!(fixed.factor().as_slice(), dynamic.factor().as_slice());
        assert_eq!(fixed.condition().to_bits(), dynamic.condition().to_bits());

        let (fixed, dynamic) = (fixed.solve().unwrap(), dynamic.solve().unwrap());
        assert_eq!(bits(fixed.parameters()), bits(dynamic.parameters()));
        let (fixed_errors, dynamic_errors) =
            (fixed.standard_errors().unwrap(), dynamic.standard_errors().unwrap());
        assert_eq!(bits(&fixed_errors), bits(&dynamic_errors));
        let (fixed, dynamic) = (fixed.covariance().unwrap(), dynamic.covariance().unwrap());
        assert_eq!(fixed.as_slice(), dynamic.as_slice());
    }

    #[test]
    fn a_wrong_size_is_an_error_and_changes_nothing() {
        let (_, mut problem) = both::<3>(10, 23);
        let before = contents(&problem);
        let length = |argument, found| Error::Length { argument, expected: 3, found };
        for found in [0, 2, 4] {
            let row = DVector::repeat(found, 1.0);
            assert_eq!(problem.add(&row, 1.0), Err(length("regressor", found)));
            let other = LeastSquares::with_size(Dyn(found));
            assert_eq!(problem.merge(&other), Err(length("other", found)));
        }
        assert_eq!(contents(&problem), before);

        let from = |factor: DMatrix<f64>, output: DVector<f64>| {
            LeastSquares::<f64, Dyn>::from_factor(&factor, &output, 0.0, 9).unwrap_err()
        };
        let error = from(DMatrix::zeros(3, 2), DVector::zeros(3));
        assert_eq!(error, length("factor", 2));
        let error = from(DMatrix::zeros(3, 3), DVector::zeros(4));
        assert_eq!(error, length("rotated_output", 4));
    }

    #[test]
    fn no_parameters_leave_the_outputs() {
        let mut problem = LeastSquares::<f64, Dyn>::with_size(Dyn(0));
        problem.add(&DVector::zeros(0), -2.0).unwrap();
        assert_eq!(problem.solve().unwrap().residual_variance(), Some(4.0));
    }
}
