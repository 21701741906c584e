extern crate std;
use std::vec::Vec;

use nalgebra::{Const, DMatrix, DVector, Matrix2, RowVector2, SMatrix, SVector, Vector1, Vector2};

use crate::noise::Noise;
use crate::textbook::{Square, random, random_covariance, stable};
use crate::{
    Action, Covariance, Error, ExtendedKalmanFilter, KalmanFilter, LinearObservation, LinearTransition,
    Observation, Real, Smoothed, Smoother,
};

type None = SVector<f64, 0>;

/// A linear model and its data, over some samples: x(0) ~ (mean, P), x(k+1) = F_k x(k) + b_k + w_k, and at each sample
/// some measurements.
struct Problem<const N: usize> {
    start: (SVector<f64, N>, Square<N>),
    steps: Vec<(Square<N>, SVector<f64, N>, Square<N>)>,
    /// Sample, h, y, variance: one number each.
    measurements: Vec<(usize, SMatrix<f64, 1, N>, f64, f64)>,
}

impl<const N: usize> Problem<N> {
    /// The states given the measurements, by conditioning one large Gaussian vector: means and covariances.
    fn batch(&self) -> Vec<(SVector<f64, N>, Square<N>)> {
        let (count, m) = (self.steps.len() + 1, self.measurements.len());
        let (mut mean, mut joint) = (DVector::zeros(count * N), DMatrix::zeros(count * N, count * N));
        mean.rows_mut(0, N).copy_from(&self.start.0);
        joint.view_mut((0, 0), (N, N)).copy_from(&self.start.1);
        for (k, (f, b, q)) in self.steps.iter().enumerate() {
            let state = f * mean.fixed_rows::<N>(k * N) + b;
            mean.rows_mut((k + 1) * N, N).copy_from(&state);
            let cross = f * joint.view((k * N, 0), (N, (k + 1) * N));
            joint.view_mut(((k + 1) * N, 0), (N, (k + 1) * N)).copy_from(&cross);
            joint.view_mut((0, (k + 1) * N), ((k + 1) * N, N)).copy_from(&cross.transpose());
            let variance = f * joint.fixed_view::<N, N>(k * N, k * N) * f.transpose() + q;
            joint.view_mut(((k + 1) * N, (k + 1) * N), (N, N)).copy_from(&variance);
        }
        let (mut h, mut r, mut y) = (DMatrix::zeros(m, count * N), DMatrix::zeros(m, m), DVector::zeros(m));
        for (index, (k, row, value, variance)) in self.measurements.iter().enumerate() {
            h.view_mut((index, k * N), (1, N)).copy_from(row);
            (y[index], r[(index, index)]) = (*value, *variance);
        }
        let inverse = (&h * &joint * h.transpose() + r).try_inverse().unwrap();
        let gain = &joint * h.transpose() * inverse;
        let (states, p) = (&mean + &gain * (y - &h * &mean), &joint - &gain * &h * &joint);
        (0..count)
            .map(|k| {
                (states.fixed_rows::<N>(k * N).into_owned(), p.fixed_view::<N, N>(k * N, k * N).into_owned())
            })
            .collect()
    }

    fn smoother<T: Real>(&self) -> Smoother<T, Const<N>> {
        let (mean, p): (SVector<T, N>, SMatrix<T, N, N>) =
            (nalgebra::convert(self.start.0), nalgebra::convert(self.start.1));
        let mut smoother = Smoother::new(KalmanFilter::new(mean, Covariance::new(&p).unwrap()).unwrap());
        for k in 0..=self.steps.len() {
            if k > 0 {
                let (f, b, q) = &self.steps[k - 1];
                let (f, q): (SMatrix<T, N, N>, SMatrix<T, N, N>) =
                    (nalgebra::convert(*f), nalgebra::convert(*q));
                let b: SVector<T, N> = nalgebra::convert(*b);
                let model = LinearTransition::new(f, Covariance::new(&q).unwrap()).unwrap();
                smoother.predict(&model.with_input(b).unwrap(), &Vector1::new(T::one())).unwrap();
            }
            for (_, row, y, variance) in self.measurements.iter().filter(|measurement| measurement.0 == k) {
                let noise = Covariance::from_diagonal(&Vector1::new(nalgebra::convert(*variance))).unwrap();
                let row: SMatrix<T, 1, N> = nalgebra::convert(*row);
                let sensor = LinearObservation::new(row, noise).unwrap();
                smoother.correct(&sensor, &SVector::zeros(), &Vector1::new(nalgebra::convert(*y))).unwrap();
            }
        }
        smoother
    }
}

fn least_eigenvalue<const N: usize>(matrix: &Square<N>) -> f64 {
    DMatrix::from_column_slice(N, N, matrix.as_slice()).symmetric_eigenvalues().min()
}

fn check<const N: usize>(problem: &Problem<N>, tolerance: f64) -> Vec<Smoothed<f64, Const<N>>> {
    let smoothed = problem.smoother::<f64>().smooth().unwrap();
    let batch = problem.batch();
    assert_eq!(smoothed.len(), batch.len());
    for (k, (found, (state, p))) in smoothed.iter().zip(&batch).enumerate() {
        assert!((found.state - state).amax() < tolerance, "{k}: {} {state}", found.state);
        assert!((found.covariance - p).amax() < tolerance, "{k}: {} {p}", found.covariance);
        assert_eq!(found.covariance, found.covariance.transpose());
        assert!(found.covariance.diagonal().min() >= 0.0);
        // Positive semidefinite, but for rounding.
        assert!(least_eigenvalue(&found.covariance) > -1e-14 * found.covariance.amax().max(1.0));
    }
    smoothed
}

fn random_problem<const N: usize>(noise: &mut Noise, samples: usize) -> Problem<N> {
    let mut problem = Problem {
        start: (random(noise), random_covariance(noise)),
        steps: Vec::new(),
        measurements: Vec::new(),
    };
    for k in 0..samples {
        if k > 0 {
            problem.steps.push((stable(noise, 0.8), random(noise), random_covariance(noise)));
        }
        // None, one or more at a sample.
        for _ in 0..k % 3 {
            problem.measurements.push((k, random(noise), 3.0 * noise.next(), 0.1 + noise.next().abs()));
        }
    }
    problem
}

#[test]
fn it_is_the_batch_solution() {
    let mut noise = Noise(1);
    for _ in 0..10 {
        check(&random_problem::<1>(&mut noise, 9), 1e-12);
        check(&random_problem::<2>(&mut noise, 9), 1e-12);
        check(&random_problem::<4>(&mut noise, 7), 1e-12);
    }
    check(&random_problem::<3>(&mut noise, 1), 1e-12);
}

#[test]
fn singular_covariances_are_fine() {
    let mut noise = Noise(2);
    for case in 0..30 {
        let mut problem = random_problem::<3>(&mut noise, 8);
        // A start that is known, or in part; noise of rank one, or none; a transition that forgets.
        let gamma: SVector<f64, 3> = random(&mut noise);
        match case % 3 {
            0 => problem.start.1 = Square::zeros(),
            1 => problem.start.1 = gamma * gamma.transpose(),
            _ => (),
        }
        for (f, _, q) in &mut problem.steps {
            *q = if case % 2 == 0 { gamma * gamma.transpose() } else { Square::zeros() };
            if case % 5 == 0 {
                f.row_mut(1).fill(0.0);
            }
        }
        check(&problem, 1e-12);
    }
}

#[test]
fn with_nothing_measured_or_nothing_moving_it_is_the_filter() {
    let mut noise = Noise(3);
    let mut problem = random_problem::<2>(&mut noise, 6);
    problem.measurements.clear();
    let smoother = problem.smoother::<f64>();
    let smoothed = smoother.smooth().unwrap();
    let (last, filter) = (smoothed.last().unwrap(), smoother.filter());
    assert_eq!(&last.state, filter.state());
    assert!((last.covariance - filter.covariance().matrix()).amax() < 1e-15);
    check(&problem, 1e-13);

    // A constant: given all, it is the same at all samples.
    let mut problem = random_problem::<2>(&mut noise, 9);
    for step in &mut problem.steps {
        *step = (Square::identity(), SVector::zeros(), Square::zeros());
    }
    let smoothed = check(&problem, 1e-13);
    for other in &smoothed {
        assert!((other.state - smoothed[8].state).amax() < 1e-13);
        assert!((other.covariance - smoothed[8].covariance).amax() < 1e-13);
    }
}

/// The errors at the first two samples, and at those from the fourth on, where a constant of this variance is measured
/// with variances of 10^-4.
fn errors_after_an_uncertain_start(variance: f64) -> (f64, f64) {
    let mut noise = Noise(4);
    let mut problem = random_problem::<2>(&mut noise, 12);
    problem.start.1 = variance * Square::identity();
    for step in &mut problem.steps {
        *step = (Square::identity(), SVector::zeros(), Square::zeros());
    }
    // (Σ h h'/r + P⁻¹)⁻¹ is well conditioned, at all samples the same.
    let mut information = Square::<2>::identity() / variance;
    let mut sum = information * problem.start.0;
    for (_, row, y, variance) in &mut problem.measurements {
        *variance = 1e-4;
        information += row.transpose() * *row / *variance;
        sum += row.transpose() * *y / *variance;
    }
    let p = crate::textbook::inverse(&information);
    let smoothed = problem.smoother::<f64>().smooth().unwrap();
    let error = |found: &Smoothed<f64, Const<2>>| {
        (found.state - p * sum).amax().max((found.covariance - p).amax() / p.amax())
    };
    let largest = |samples: &[Smoothed<f64, Const<2>>]| samples.iter().map(error).fold(0.0, f64::max);
    (largest(&smoothed[..2]), largest(&smoothed[3..]))
}

#[test]
fn while_the_filter_knows_little_the_digits_of_what_it_learns_are_lost() {
    // As the documentation says: of 16 digits, those of variance / 10^-4.
    for (variance, early) in [(1.0, 1e-10), (1e4, 1e-6), (1e8, 1e-2)] {
        let (first, later) = errors_after_an_uncertain_start(variance);
        assert!(first < early && later < 1e-10, "{variance} {first:e} {later:e}");
    }
}

#[test]
fn in_single_precision_it_is_nearly_the_same() {
    let mut noise = Noise(5);
    for _ in 0..10 {
        let problem = random_problem::<3>(&mut noise, 20);
        let single = problem.smoother::<f32>().smooth().unwrap();
        for (found, (state, p)) in single.iter().zip(problem.batch()) {
            assert!((found.state.map(f64::from) - state).amax() < 1e-4);
            assert!((found.covariance.map(f64::from) - p).amax() < 1e-4);
        }
    }
}

/// Two sensors of different sizes, one with correlations, elements that are missing, and one outlier at the gate.
#[test]
fn several_sensors_missing_elements_and_a_gate() {
    let mut noise = Noise(6);
    let (f, q) = (stable::<2>(&mut noise, 0.9), random_covariance::<2>(&mut noise));
    let model = LinearTransition::new(f, Covariance::new(&q).unwrap()).unwrap();
    let (h, r) = (random::<3, 2>(&mut noise), random_covariance::<3>(&mut noise));
    let pair = LinearObservation::new(h, Covariance::new(&r).unwrap()).unwrap();
    let row = RowVector2::new(1.0, 0.5);
    let single = LinearObservation::new(row, Covariance::from_diagonal(&Vector1::new(0.3)).unwrap()).unwrap();
    let start = (Vector2::new(1.0, -1.0), Square::<2>::identity());
    let filter = KalmanFilter::new(start.0, Covariance::new(&start.1).unwrap()).unwrap();
    let mut smoother = Smoother::new(filter.with_gate(50.0).unwrap());
    let mut problem = Problem { start, steps: Vec::new(), measurements: Vec::new() };
    for k in 0..10_usize {
        if k > 0 {
            smoother.predict(&model, &None::zeros()).unwrap();
            problem.steps.push((f, SVector::zeros(), q));
        }
        let mut y: SVector<f64, 3> = random(&mut noise);
        if k % 3 == 1 {
            y[k % 2] = f64::NAN;
        }
        let here: Vec<usize> = (0..3).filter(|&index| !y[index].is_nan()).collect();
        smoother.correct(&pair, &None::zeros(), &y).unwrap();
        // As independent measurements: whitened by the Cholesky factor of what is there.
        let part = DMatrix::from_fn(here.len(), here.len(), |i, j| r[(here[i], here[j])]);
        let root = part.cholesky().unwrap().l();
        let rows = DMatrix::from_fn(here.len(), 2, |i, j| h[(here[i], j)]);
        let rows = root.solve_lower_triangular(&rows).unwrap();
        let values = DVector::from_fn(here.len(), |i, _| y[here[i]]);
        let values = root.solve_lower_triangular(&values).unwrap();
        for i in 0..here.len() {
            problem.measurements.push((k, RowVector2::new(rows[(i, 0)], rows[(i, 1)]), values[i], 1.0));
        }
        // The second sensor only now and then, once far off, and once not there.
        if k % 2 == 0 {
            let y = match k {
                4 => 1e3,
                6 => f64::NAN,
                _ => noise.next(),
            };
            let action = smoother.correct(&single, &None::zeros(), &Vector1::new(y)).unwrap().action;
            match k {
                4 => assert_eq!(action, Action::Gated),
                6 => assert_eq!(action, Action::Missing),
                _ => problem.measurements.push((k, row, y, 0.3)),
            }
        }
    }
    for (found, (state, p)) in smoother.smooth().unwrap().iter().zip(problem.batch()) {
        assert!((found.state - state).amax() < 1e-12);
        assert!((found.covariance - p).amax() < 1e-12);
    }
}

/// The distance from the origin, of variance 10^-4.
struct Range;

impl Observation<f64, Const<2>, Const<1>> for Range {
    fn output(&self, x: &Vector2<f64>, _: &None) -> Vector1<f64> {
        Vector1::new(x.norm())
    }
    fn output_jacobian(&self, x: &Vector2<f64>, _: &None) -> RowVector2<f64> {
        x.transpose() / x.norm()
    }
    fn measurement_noise(&self, _: &Vector2<f64>, _: &None) -> Covariance<f64, Const<1>> {
        Covariance::from_diagonal(&Vector1::new(1e-4)).unwrap()
    }
}

#[test]
fn an_iterated_filter_is_smoothed_by_its_last_linearisations() {
    let walk = Covariance::from_diagonal(&Vector2::new(0.01, 0.01)).unwrap();
    let model = LinearTransition::new(Matrix2::identity(), walk).unwrap();
    let prior = Covariance::from_diagonal(&Vector2::new(1.0, 1.0)).unwrap();
    for iterations in [1, 4] {
        let filter = ExtendedKalmanFilter::new(Vector2::new(3.0, 1.0), prior.clone()).unwrap();
        let mut smoother = Smoother::new(filter.with_iterations(iterations).unwrap());
        let mut problem = Problem {
            start: (Vector2::new(3.0, 1.0), Square::<2>::identity()),
            steps: Vec::new(),
            measurements: Vec::new(),
        };
        for (k, y) in [4.0, 4.1, 4.05, 3.9].into_iter().enumerate() {
            if k > 0 {
                smoother.predict(&model, &None::zeros()).unwrap();
                problem.steps.push((Square::identity(), Vector2::zeros(), 0.01 * Square::identity()));
            }
            // The linear model that the last iteration saw.
            let mut point = *smoother.filter().state();
            if iterations > 1 {
                let mut fewer = ExtendedKalmanFilter::new(point, smoother.filter().covariance().clone())
                    .unwrap()
                    .with_iterations(iterations - 1)
                    .unwrap();
                fewer.correct(&Range, &None::zeros(), &Vector1::new(y)).unwrap();
                point = *fewer.state();
            }
            let row = point.transpose() / point.norm();
            problem.measurements.push((k, row, y - point.norm() + (row * point)[0], 1e-4));
            smoother.correct(&Range, &None::zeros(), &Vector1::new(y)).unwrap();
        }
        for (found, (state, p)) in smoother.smooth().unwrap().iter().zip(problem.batch()) {
            // The batch solution has a matrix of condition 10^5 to invert.
            assert!((found.state - state).amax() < 1e-10);
            assert!((found.covariance - p).amax() < 1e-10);
        }
    }
}

#[test]
fn what_fails_leaves_the_record_as_it_was() {
    let mut noise = Noise(7);
    let problem = random_problem::<2>(&mut noise, 5);
    let mut smoother = problem.smoother::<f64>();
    let expected = smoother.smooth().unwrap();
    let one = Covariance::from_diagonal(&Vector1::new(1.0)).unwrap();
    let sensor = LinearObservation::new(RowVector2::new(1.0, 0.0), one).unwrap();
    let infinite = Vector1::new(f64::INFINITY);
    let error = smoother.correct(&sensor, &None::zeros(), &infinite).unwrap_err();
    assert_eq!(error, Error::Infinite { argument: "measurement" });
    let error = smoother.correct(&sensor, &None::zeros(), &Vector1::new(1e200)).unwrap_err();
    assert_eq!(error, Error::TooLarge { argument: "measurement" });
    let large = LinearTransition::new(Matrix2::identity() * 1e200, Covariance::zero(Const)).unwrap();
    assert_eq!(smoother.predict(&large, &None::zeros()), Err(Error::Overflow));
    assert_eq!(smoother.smooth().unwrap(), expected);
    // It can go on after it has been asked.
    let model = LinearTransition::new(Matrix2::identity(), Covariance::zero(Const)).unwrap();
    smoother.predict(&model, &None::zeros()).unwrap();
    let longer = smoother.smooth().unwrap();
    assert_eq!(longer.len(), expected.len() + 1);
    assert!((longer[0].state - expected[0].state).amax() < 1e-15);
}

#[test]
fn sizes_at_run_time_give_the_same_bits() {
    let mut noise = Noise(8);
    let (f, q) = (stable::<2>(&mut noise, 0.9), random_covariance::<2>(&mut noise));
    let (h, r) = (random::<2, 2>(&mut noise), random_covariance::<2>(&mut noise));
    let model = LinearTransition::new(f, Covariance::new(&q).unwrap()).unwrap();
    let sensor = LinearObservation::new(h, Covariance::new(&r).unwrap()).unwrap();
    let dynamic = |matrix: &Square<2>| DMatrix::from_column_slice(2, 2, matrix.as_slice());
    let model_at_run_time =
        LinearTransition::new(dynamic(&f), Covariance::new(&dynamic(&q)).unwrap()).unwrap();
    let sensor_at_run_time =
        LinearObservation::new(dynamic(&h), Covariance::new(&dynamic(&r)).unwrap()).unwrap();
    let p = random_covariance::<2>(&mut noise);
    let mut smoother =
        Smoother::new(KalmanFilter::new(Vector2::zeros(), Covariance::new(&p).unwrap()).unwrap());
    let filter = KalmanFilter::new(DVector::zeros(2), Covariance::new(&dynamic(&p)).unwrap()).unwrap();
    let mut at_run_time = Smoother::new(filter);
    let none = None::zeros();
    for _ in 0..10 {
        let y = random::<2, 1>(&mut noise);
        smoother.correct(&sensor, &none, &y).unwrap();
        at_run_time.correct(&sensor_at_run_time, &none, &DVector::from_column_slice(y.as_slice())).unwrap();
        smoother.predict(&model, &none).unwrap();
        at_run_time.predict(&model_at_run_time, &none).unwrap();
    }
    for (found, expected) in at_run_time.smooth().unwrap().iter().zip(smoother.smooth().unwrap()) {
        assert_eq!(found.state.as_slice(), expected.state.as_slice());
        assert_eq!(found.covariance.as_slice(), expected.covariance.as_slice());
    }
}
