//! The online estimators: one step of each, in `f64` and in `f32`.

use std::error::Error;
use std::hint::black_box;
use std::time::Duration;

use criterion::BenchmarkGroup;
use criterion::Criterion;
use criterion::measurement::WallTime;
use thetahat::model::Orders;
use thetahat::track::{PerChannel, TrackPlan, Tracker};
use thetahat_core::nalgebra::{self, Const, SMatrix, SVector};
use thetahat_core::{
    ArxOrders, Covariance, Forgetting, InputOrders, KalmanFilter, LinearObservation, LinearTransition, Real,
    RecursiveArx, RecursiveLeastSquares,
};

/// Samples that are gone through again and again.
const SAMPLES: usize = 1000;

fn main() -> Result<(), Box<dyn Error>> {
    let mut criterion = Criterion::default()
        .sample_size(20)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1))
        .configure_from_args();
    precision::<f64>(&mut criterion, "f64")?;
    precision::<f32>(&mut criterion, "f32")?;
    tracker(&mut criterion)?;
    criterion.final_summary();
    Ok(())
}

fn precision<T: Real>(criterion: &mut Criterion, name: &str) -> Result<(), thetahat_core::Error> {
    let mut group = criterion.benchmark_group(name);
    recursive::<T, 4>(&mut group)?;
    recursive::<T, 8>(&mut group)?;
    recursive::<T, 16>(&mut group)?;
    recursive_arx::<T>(&mut group)?;
    kalman::<T, 2, 1>(&mut group)?;
    kalman::<T, 4, 2>(&mut group)?;
    kalman::<T, 6, 3>(&mut group)?;
    group.finish();
    Ok(())
}

/// Some number between -1 and 1.
fn value<T: Real>(k: usize) -> T {
    nalgebra::convert((k as f64 * 0.7548776662466927).fract() * 2.0 - 1.0)
}

fn recursive<T: Real, const N: usize>(
    group: &mut BenchmarkGroup<'_, WallTime>,
) -> Result<(), thetahat_core::Error> {
    let forgetting = Forgetting::Exponential { factor: nalgebra::convert(0.99) };
    let mut estimator = RecursiveLeastSquares::<T, Const<N>>::new(&SVector::repeat(T::one()), forgetting)?;
    let samples: Vec<SVector<T, N>> =
        (0..SAMPLES).map(|k| SVector::from_fn(|row, _| value(k * (row + 3) + row * row))).collect();
    let mut k = 0;
    group.bench_function(format!("RecursiveLeastSquares, n = {N}"), |bencher| {
        bencher.iter(|| {
            k = (k + 1) % SAMPLES;
            estimator.update(black_box(&samples[k]), value(k))
        });
    });
    Ok(())
}

fn recursive_arx<T: Real>(group: &mut BenchmarkGroup<'_, WallTime>) -> Result<(), thetahat_core::Error> {
    let orders = ArxOrders { na: 4, inputs: &[InputOrders { nb: 4, nk: 1 }], constant: false };
    let forgetting = Forgetting::Exponential { factor: nalgebra::convert(0.99) };
    let mut plant = RecursiveArx::<T, Const<8>>::new(&orders, T::one(), &[T::one()], forgetting)?;
    let mut k = 0;
    group.bench_function("RecursiveArx(4, 4, 1)", |bencher| {
        bencher.iter(|| {
            k = (k + 1) % SAMPLES;
            plant.log_row(value(3 * k + 1), &[value(k)])
        });
    });
    Ok(())
}

/// What a program runs that got its orders from a person: run-time sizes, a prediction, charts for changes.
fn tracker(criterion: &mut Criterion) -> Result<(), thetahat::Error> {
    let scales = PerChannel { inputs: vec![1.0], output: 1.0 };
    let plan = TrackPlan { scales: Some(scales), alarm_interval: Some(10_000.0), ..TrackPlan::default() };
    let mut tracker = Tracker::new(&Orders::arx(4, &[4], &[1])?, &plan)?;
    let mut k = 0;
    criterion.bench_function("Tracker, ARX(4, 4, 1)", |bencher| {
        bencher.iter(|| {
            k = (k + 1) % SAMPLES;
            tracker.log_row(value(3 * k + 1), &[value(k)])
        });
    });
    Ok(())
}

/// Positions and velocities in M directions, the positions measured: one prediction and one correction.
fn kalman<T: Real, const N: usize, const M: usize>(
    group: &mut BenchmarkGroup<'_, WallTime>,
) -> Result<(), thetahat_core::Error> {
    let number = |value: f64| -> T { nalgebra::convert(value) };
    let mut state_matrix = SMatrix::<T, N, N>::identity();
    let mut output_matrix = SMatrix::<T, M, N>::zeros();
    for index in 0..M {
        state_matrix[(index, index + M)] = number(0.1);
        output_matrix[(index, index)] = T::one();
    }
    let transition =
        LinearTransition::new(state_matrix, Covariance::from_diagonal(&SVector::repeat(number(0.01)))?)?;
    let noise = Covariance::from_diagonal(&SVector::repeat(number(0.3)))?;
    let observation = LinearObservation::new(output_matrix, noise)?;
    let prior = Covariance::from_diagonal(&SVector::repeat(number(10.0)))?;
    let mut filter = KalmanFilter::<T, Const<N>>::new(SVector::zeros(), prior)?;
    let mut k = 0;
    group.bench_function(format!("KalmanFilter, {N} x {M}"), |bencher| {
        bencher.iter(|| {
            k = (k + 1) % SAMPLES;
            filter.predict(black_box(&transition), &SVector::zeros())?;
            let measurement = SVector::<T, M>::from_fn(|row, _| value(k + 7 * row));
            filter.correct(black_box(&observation), &SVector::zeros(), &measurement)
        });
    });
    Ok(())
}
