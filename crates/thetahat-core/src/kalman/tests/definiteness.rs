//! Hard covariances in single precision.

extern crate std;
use std::println;

use nalgebra::{
    Const, Matrix2, Matrix3, Matrix4, RowVector3, RowVector4, SMatrix, SVector, Vector3, Vector4,
};

use super::{difference, observation, transition};
use crate::noise::Noise;
use crate::textbook::{Square, random, random_covariance, stable};
use crate::{Covariance, KalmanFilter, LinearObservation, LinearTransition, Real};

/// The factors of F P F' + Q by modified weighted Gram-Schmidt orthogonalisation of [F U | U_Q], as Thornton (1976)
/// and Bierman (1977, section VI.4) print it.
fn gram_schmidt<T: Real, const N: usize>(
    f: &SMatrix<T, N, N>,
    p: &Covariance<T, Const<N>>,
    q: &Covariance<T, Const<N>>,
) -> Covariance<T, Const<N>> {
    let unit = |covariance: &Covariance<T, Const<N>>| {
        let mut u = covariance.factor();
        let d = u.diagonal();
        u.fill_diagonal(T::one());
        (u, d)
    };
    let ((u, d), (u_noise, d_noise)) = (unit(p), unit(q));
    let (mut left, mut right) = (f * u, u_noise);
    let mut factor = SMatrix::<T, N, N>::zeros();
    for j in (0..N).rev() {
        let product = |left: &SMatrix<T, N, N>, right: &SMatrix<T, N, N>, a: usize, b: usize| {
            (0..N).fold(T::zero(), |sum, k| {
                sum + d[k] * left[(a, k)] * left[(b, k)] + d_noise[k] * right[(a, k)] * right[(b, k)]
            })
        };
        let norm = product(&left, &right, j, j);
        factor[(j, j)] = norm;
        if norm > T::zero() {
            for i in 0..j {
                let share = product(&left, &right, i, j) / norm;
                factor[(i, j)] = share;
                for k in 0..N {
                    let (pivot, other) = (left[(j, k)], right[(j, k)]);
                    left[(i, k)] -= share * pivot;
                    right[(i, k)] -= share * other;
                }
            }
        }
    }
    Covariance::from_factor(factor).unwrap()
}

fn predicted<T: Real, const N: usize>(
    f: &SMatrix<T, N, N>,
    p: &Covariance<T, Const<N>>,
    q: &Covariance<T, Const<N>>,
) -> Covariance<T, Const<N>> {
    let mut filter = KalmanFilter::new(SVector::zeros(), p.clone()).unwrap();
    filter.predict(&LinearTransition::new(*f, q.clone()).unwrap(), &SVector::zeros()).unwrap();
    filter.covariance().clone()
}

fn widened<const N: usize>(covariance: &Covariance<f32, Const<N>>) -> Covariance<f64, Const<N>> {
    Covariance::from_factor(covariance.factor().map(f64::from)).unwrap()
}

/// Random factors, D between 10^-`decades` and 1.
fn graded<T: Real, const N: usize>(noise: &mut Noise, decades: f64) -> Covariance<T, Const<N>> {
    let mut factor: Square<N> = random::<N, N>(noise).upper_triangle();
    for j in 0..N {
        factor[(j, j)] = 10_f64.powf(noise.next().abs() * -decades);
    }
    Covariance::from_factor(nalgebra::convert(factor)).unwrap()
}

fn check_time_update<const N: usize>(noise: &mut Noise) {
    for decades in [0.0, 2.0, 6.0] {
        for _ in 0..10 {
            let (p, q) = (graded::<f64, N>(noise, decades), graded(noise, decades));
            let f = random(noise);
            let rank_one = Covariance::<f64, Const<1>>::from_diagonal(&SVector::<f64, 1>::new(1e-3)).unwrap();
            let rank_one = rank_one.transformed(&random::<N, 1>(noise)).unwrap();
            let zero = Covariance::zero(Const);
            for (p, q) in
                [(&p, &q), (&p, &zero), (&zero, &q), (&zero, &zero), (&p, &rank_one), (&zero, &rank_one)]
            {
                let (quick, slow) = (predicted(&f, p, q), gram_schmidt(&f, p, q));
                assert!(difference(&quick.matrix(), &slow.matrix()) < 1e-14, "{N} {decades}");
            }
            // A transition of rank one.
            let flat = random::<N, 1>(noise) * random::<1, N>(noise);
            let (quick, slow) = (predicted(&flat, &p, &zero), gram_schmidt(&flat, &p, &zero));
            assert!(difference(&quick.matrix(), &slow.matrix()) < 1e-14, "{N} {decades}");
        }
    }
}

#[test]
fn the_time_update_is_that_of_gram_schmidt() {
    let mut noise = Noise(1);
    check_time_update::<1>(&mut noise);
    check_time_update::<2>(&mut noise);
    check_time_update::<4>(&mut noise);
    check_time_update::<6>(&mut noise);
    check_time_update::<10>(&mut noise);
}

/// The largest errors of the time update, and of Gram-Schmidt, in single precision.
fn hard_time_updates<const N: usize>(noise: &mut Noise) -> [f64; 2] {
    let mut worst = [0.0_f64; 2];
    for case in 0..100 {
        // A prior of condition 10^12, noise of rank one or none, two nearly equal rows.
        let p = graded::<f32, N>(noise, 12.0);
        let mut f = random::<N, N>(noise);
        if case % 2 == 0 {
            let close = f.row(0) + 1e-3 * random::<1, N>(noise);
            f.set_row(1, &close);
        }
        let f: SMatrix<f32, N, N> = nalgebra::convert(f);
        let mut q = Covariance::zero(Const);
        if case % 3 > 0 {
            let small = Covariance::<f32, Const<1>>::from_diagonal(&SVector::<f32, 1>::new(1e-6)).unwrap();
            let gamma: SMatrix<f32, N, 1> = nalgebra::convert(random::<N, 1>(noise));
            q = small.transformed(&gamma).unwrap();
        }
        let exact = gram_schmidt(&f.map(f64::from), &widened(&p), &widened(&q)).matrix();
        for (worst, found) in worst.iter_mut().zip([predicted(&f, &p, &q), gram_schmidt(&f, &p, &q)]) {
            *worst = worst.max(difference(&widened(&found).matrix(), &exact));
        }
    }
    worst
}

#[test]
fn in_single_precision_hard_time_updates_are_as_good_as_gram_schmidt() {
    let mut noise = Noise(2);
    let worst = [
        hard_time_updates::<2>(&mut noise),
        hard_time_updates::<3>(&mut noise),
        hard_time_updates::<4>(&mut noise),
        hard_time_updates::<6>(&mut noise),
    ];
    println!("time update, Gram-Schmidt: {worst:?}");
    for [hybrid, slow] in worst {
        // Some epsilons of 1.2e-7, beside the variances.
        assert!(hybrid < 5e-6 && slow < 5e-6, "{worst:?}");
    }
}

const STEPS: usize = 100_000;

/// Runs a filter for this many steps in single precision, and in double until its covariance is steady (as it does not
/// depend on the data). Returns the largest difference of the two covariances.
fn run<const N: usize, const M: usize>(
    p: &Square<N>,
    (f, q): (&Square<N>, &Square<N>),
    (h, r): (&SMatrix<f64, M, N>, &Square<M>),
    steady: usize,
) -> f64 {
    fn start<T: Real, const N: usize>(p: &Square<N>) -> KalmanFilter<T, Const<N>> {
        KalmanFilter::new(SVector::zeros(), super::covariance(p)).unwrap()
    }
    fn step<T: Real, const N: usize, const M: usize>(
        filter: &mut KalmanFilter<T, Const<N>>,
        model: &LinearTransition<T, Const<N>>,
        sensor: &LinearObservation<T, Const<N>, Const<M>>,
        y: &SVector<f64, M>,
    ) {
        filter.predict(model, &SVector::zeros()).unwrap();
        filter.correct(sensor, &SVector::zeros(), &nalgebra::convert(*y)).unwrap();
    }
    let (mut single, mut double) = (start::<f32, N>(p), start::<f64, N>(p));
    let (model, model_in_double) = (transition(f, q), transition(f, q));
    let (sensor, sensor_in_double) = (observation(h, r), observation(h, r));
    let (mut noise, mut worst) = (Noise(3), 0.0_f64);
    for k in 0..STEPS {
        let y = random(&mut noise);
        step(&mut single, &model, &sensor, &y);
        if k < steady {
            step(&mut double, &model_in_double, &sensor_in_double, &y);
        }
        // What is lost does not come back.
        if k < 100 || k % 64 == 0 {
            let factor = single.covariance().factor();
            assert!(factor.iter().all(|entry| entry.is_finite()) && factor.diagonal().min() >= 0.0);
            worst =
                worst.max(difference(&widened(single.covariance()).matrix(), &double.covariance().matrix()));
        }
    }
    worst
}

#[test]
fn eight_hard_filters_keep_definite_for_a_hundred_thousand_steps_in_single_precision() {
    let cart = Matrix2::new(1.0, 0.1, 0.0, 1.0);
    let position = SMatrix::<f64, 1, 2>::new(1.0, 0.0);
    let one = |r: f64| SMatrix::<f64, 1, 1>::new(r);
    let mut noise = Noise(4);
    let mut differences = std::vec::Vec::new();

    // An ordinary one, on which P - K H P fails after 77,693 steps.
    let f = Matrix3::new(1.1269, -0.494, 0.1129, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0);
    let gamma = Vector3::new(-0.3832, 0.5919, 0.5191);
    let (q, h) = (gamma * 2.3 * gamma.transpose(), RowVector3::new(1.0, 0.0, 0.0));
    differences.push(run(&Matrix3::identity(), (&f, &q), (&h, &one(1.0)), 1000));
    // Nothing known, and an accurate sensor.
    let q = Matrix2::new(1e-8, 0.0, 0.0, 1e-4);
    differences.push(run(&(1e12 * Matrix2::identity()), (&cart, &q), (&position, &one(1e-6)), 1000));
    // Constants, without noise: known better and better.
    let h = random::<2, 4>(&mut noise);
    let (identity, zero) = (Matrix4::identity(), Matrix4::zeros());
    differences.push(run(&(1e6 * identity), (&identity, &zero), (&h, &Matrix2::identity()), STEPS));
    // Units that differ by 10^12.
    let units = Matrix3::from_diagonal(&Vector3::new(1e-6, 1.0, 1e6));
    let inverse = Matrix3::from_diagonal(&Vector3::new(1e6, 1.0, 1e-6));
    let f = units * stable::<3>(&mut noise, 0.99) * inverse;
    let q = units * random_covariance::<3>(&mut noise) * units * 1e-4;
    let h = RowVector3::new(1.0, 1.0, 1.0) * inverse;
    differences.push(run(&(units * units * 1e3), (&f, &q), (&h, &one(1e-3)), 1000));
    // Two sensors that see almost the same.
    let h = Matrix2::new(1.0, 1e-3, 1.0, -1e-3);
    let q = 1e-6 * Matrix2::identity();
    differences.push(run(
        &(1e6 * Matrix2::identity()),
        (&cart, &q),
        (&h, &(1e-6 * Matrix2::identity())),
        1000,
    ));
    // Two oscillators, barely damped, driven together.
    let (sine, cosine) = 0.1_f64.sin_cos();
    let turn = Matrix2::new(cosine, -sine, sine, cosine) * 0.9999;
    let mut f = Matrix4::zeros();
    f.fixed_view_mut::<2, 2>(0, 0).copy_from(&turn);
    f.fixed_view_mut::<2, 2>(2, 2).copy_from(&(turn * turn * turn));
    let gamma = Vector4::new(1.0, 0.0, 1.0, 0.0);
    let (q, h) = (gamma * 1e-6 * gamma.transpose(), RowVector4::new(1.0, 0.0, 1.0, 0.0));
    differences.push(run(&(100.0 * Matrix4::identity()), (&f, &q), (&h, &one(1e-4)), STEPS));
    // A delay line: a transition that forgets, and a sensor at its end.
    let mut f = Matrix4::zeros();
    f[(0, 0)] = 0.999;
    for index in 1..4 {
        f[(index, index - 1)] = 1.0;
    }
    let q = Matrix4::from_diagonal(&Vector4::new(1e-4, 0.0, 0.0, 0.0));
    let h = RowVector4::new(0.0, 0.0, 0.0, 1.0);
    differences.push(run(&(1e4 * Matrix4::identity()), (&f, &q), (&h, &one(1e-8)), 1000));
    // Measurements whose noises are nearly one.
    let h = random::<3, 3>(&mut noise);
    let r = Matrix3::from_element(1.0) + 1e-5 * Matrix3::identity();
    let (f, q) = (stable::<3>(&mut noise, 0.999), 1e-4 * random_covariance::<3>(&mut noise));
    differences.push(run(&(1e3 * Matrix3::identity()), (&f, &q), (&h, &r), 1000));

    println!("{differences:?}");
    // Without noise and forgetting, rounding adds up: 0.12 there, beside the variances.
    assert!(differences.remove(2) < 0.2);
    assert!(differences.iter().all(|&difference| difference < 2e-3), "{differences:?}");
}
