//! ARX models from slices: estimation through the Gram matrix and through a triangular factor, prediction, free run.

mod signals;

use std::error::Error;
use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput};
use thetahat::data::{Offset, Record};
use thetahat::estimate::{Estimate, Initial, arx, arx_factor};
use thetahat::model::{Orders, Signal};
use thetahat::respond::{InitialCondition, predict, simulate};

/// Samples of the longest signals.
const SAMPLES: usize = 1_000_000;

fn main() -> Result<(), Box<dyn Error>> {
    let mut criterion = Criterion::default()
        .sample_size(20)
        .warm_up_time(Duration::from_millis(500))
        .measurement_time(Duration::from_secs(2))
        .configure_from_args();
    let (input, output) = signals::signals(SAMPLES);
    estimates(&mut criterion, &input, &output)?;
    responses(&mut criterion, &input, &output)?;
    criterion.final_summary();
    Ok(())
}

/// Estimation, the check of the samples included.
fn estimates(criterion: &mut Criterion, input: &[f64], output: &[f64]) -> Result<(), Box<dyn Error>> {
    let small = Orders::arx(4, &[4], &[1])?;
    let large = Orders::arx(30, &[30], &[1])?;
    let mut group = criterion.benchmark_group("estimate");
    for samples in [SAMPLES / 10, SAMPLES] {
        let record = || Record::new(&output[..samples], vec![&input[..samples]]);
        group.throughput(Throughput::Elements(samples as u64));
        for (name, orders) in [("arx(4,4,1)", &small), ("arx(30,30,1)", &large)] {
            arx(&record()?, orders, Initial::Drop)?;
            group.bench_function(BenchmarkId::new(name, samples), |bencher| {
                bencher.iter(|| arx(&black_box(record())?, orders, Initial::Drop));
            });
        }
    }
    let record = || Record::new(output, vec![input]);
    Estimate::from_factor(&arx_factor(&record()?, &small, Initial::Drop)?, &small)?;
    group.bench_function(BenchmarkId::new("arx_factor(4,4,1)", SAMPLES), |bencher| {
        bencher.iter(|| arx_factor(&black_box(record())?, &small, Initial::Drop));
    });
    group.finish();
    Ok(())
}

/// What a model of orders (4, 4, 1) says of the signals that it was fitted to.
fn responses(criterion: &mut Criterion, input: &[f64], output: &[f64]) -> Result<(), Box<dyn Error>> {
    let orders = Orders::arx(4, &[4], &[1])?;
    let record = Record::new(output, vec![input])?;
    let estimate = arx(&record, &orders, Initial::Drop)?;
    let signal = |name: &str| Signal { name: name.to_owned(), offset: Offset::default() };
    let model = estimate.to_model(&orders, 1.0, vec![signal("u")], signal("y"))?;

    let mut group = criterion.benchmark_group("respond");
    group.throughput(Throughput::Elements(SAMPLES as u64));
    for horizon in [1, 10] {
        predict(&model, &record, horizon, InitialCondition::Drop)?;
        group.bench_function(BenchmarkId::new("predict", horizon), |bencher| {
            bencher.iter(|| predict(&model, black_box(&record), horizon, InitialCondition::Drop));
        });
    }
    for (name, start) in [("zero", InitialCondition::Zero), ("estimated", InitialCondition::Estimate)] {
        simulate(&model, &record, start)?;
        group.bench_function(BenchmarkId::new("simulate", name), |bencher| {
            bencher.iter(|| simulate(&model, black_box(&record), start));
        });
    }
    group.finish();
    Ok(())
}
