//! The time of a step, and the answers to `filters.py`.

use std::hint::black_box;
use std::io;
use std::time::Instant;

use nalgebra::{Const, DimMin, SVector};

use crate::Result;
use crate::data::{self, DRAG, Model, SAMPLES};
use crate::kalman::Kalman;
use crate::nalgebra_form::{InPlaceLeastSquares, LeastSquares, PlainLeastSquares};
use crate::nonlinear::{Nonlinear, VisitNonlinear, message, visit_extended, visit_unscented};
use crate::ours::OurLeastSquares;
use crate::peers::{Visit, visit_all};

/// Passes over the record in a block: 20,000 steps, a few milliseconds, so that some blocks are undisturbed.
const PASSES: usize = 10;

/// The seconds of a step, and the estimate after one pass.
type Block = (f64, Vec<f64>);

/// What a filter is called, and what runs a block of it.
type Filter = (&'static str, Box<dyn Fn() -> Result<Block>>);

/// Answers requests until standard input ends.
pub(crate) fn serve() -> Result<()> {
    let works = [
        ("4x2", kalman_filters::<4, 2>()),
        ("6x3", kalman_filters::<6, 3>()),
        ("ekf-4x2", extended_filters::<4, 2>()),
        ("ekf-6x3", extended_filters::<6, 3>()),
        ("ukf-4x2", unscented_filters::<4, 2, 9>()),
        ("ukf-6x3", unscented_filters::<6, 3, 13>()),
        ("4", least_squares::<4>()),
        ("8", least_squares::<8>()),
        ("16", least_squares::<16>()),
    ];
    for request in io::stdin().lines() {
        let request = request?;
        let (work, name) = request.split_once(' ').unwrap_or((&request, ""));
        let Some((_, filters)) = works.iter().find(|(known, _)| *known == work) else {
            return Err(format!("there is no work '{work}'").into());
        };
        if name.is_empty() {
            println!("{}", filters.iter().map(|(name, _)| *name).collect::<Vec<_>>().join("\t"));
            continue;
        }
        let Some((_, run)) = filters.iter().find(|(known, _)| *known == name) else {
            return Err(format!("there is no filter '{name}'").into());
        };
        let (seconds, estimate) = run()?;
        println!("{seconds} {}", estimate.iter().map(f64::to_string).collect::<Vec<_>>().join(" "));
    }
    Ok(())
}

/// Collects the Kalman filters.
struct Collector(Vec<Filter>);

impl<const N: usize, const M: usize> Visit<f64, N, M> for Collector {
    fn visit<K: Kalman<f64, N, M>>(&mut self) {
        let (model, record) = (data::constant_velocity(), data::positions());
        self.0.push((K::NAME, Box::new(move || time_kalman::<K, N, M>(&model, &record))));
    }
}

fn kalman_filters<const N: usize, const M: usize>() -> Vec<Filter>
where
    Const<M>: DimMin<Const<M>, Output = Const<M>>,
{
    let mut collector = Collector(Vec::new());
    visit_all::<f64, N, M>(&mut collector);
    collector.0
}

/// Collects filters of models that are not linear.
struct NonlinearCollector<const N: usize, const M: usize> {
    model: Model<f64, N, M>,
    /// The model with which estimates must agree.
    agreed: Model<f64, N, M>,
    drag: f64,
    filters: Vec<Filter>,
}

impl<const N: usize, const M: usize> VisitNonlinear<N, M> for NonlinearCollector<N, M> {
    fn visit<F: Nonlinear<N, M>>(&mut self) {
        let (models, drag) = ([self.model.clone(), self.agreed.clone()], self.drag);
        let record = data::positions();
        self.filters.push((F::NAME, Box::new(move || time_nonlinear::<F, N, M>(&models, drag, &record))));
    }
}

fn extended_filters<const N: usize, const M: usize>() -> Vec<Filter> {
    let (model, agreed) = (data::constant_velocity(), data::constant_velocity());
    let mut collector = NonlinearCollector::<N, M> { model, agreed, drag: DRAG, filters: Vec::new() };
    visit_extended(&mut collector);
    collector.filters
}

/// Without drag, so that all transforms give the same moments. Estimates must agree without process noise: the points
/// that multicalc's update keeps from the prediction do not know of it.
fn unscented_filters<const N: usize, const M: usize, const X: usize>() -> Vec<Filter> {
    let model = data::constant_velocity();
    let agreed = Model { q: [[0.0; N]; N], ..model.clone() };
    let mut collector = NonlinearCollector::<N, M> { model, agreed, drag: 0.0, filters: Vec::new() };
    visit_unscented::<N, M, X>(&mut collector);
    collector.filters
}

fn least_squares<const N: usize>() -> Vec<Filter> {
    fn filter<L: LeastSquares<N>, const N: usize>() -> Filter {
        let record = data::regressions();
        (L::NAME, Box::new(move || time_least_squares::<L, N>(&record)))
    }
    vec![
        filter::<OurLeastSquares<N>, N>(),
        filter::<PlainLeastSquares<N>, N>(),
        filter::<InPlaceLeastSquares<N>, N>(),
    ]
}

/// A block of predictions and corrections. The compiler must not know the numbers in the model.
fn time_kalman<K: Kalman<f64, N, M>, const N: usize, const M: usize>(
    model: &Model<f64, N, M>,
    record: &[[f64; M]],
) -> Result<Block> {
    let mut filter = K::new(black_box(model)).map_err(message)?;
    let mut first_pass = Vec::new();
    let begin = Instant::now();
    for pass in 0..PASSES {
        for measurement in black_box(record) {
            filter.step(measurement).map_err(message)?;
            black_box(filter.state());
        }
        if pass == 0 {
            first_pass = filter.state().to_vec();
        }
    }
    Ok((begin.elapsed().as_secs_f64() / (PASSES * SAMPLES) as f64, first_pass))
}

/// The same of a model that is not linear. The estimate is that with the second model.
fn time_nonlinear<F: Nonlinear<N, M>, const N: usize, const M: usize>(
    [model, agreed]: &[Model<f64, N, M>; 2],
    drag: f64,
    record: &[[f64; M]],
) -> Result<Block> {
    let mut filter = F::new(agreed, drag)?;
    record.iter().try_for_each(|measurement| filter.step(measurement))?;
    let estimate = filter.state().to_vec();
    filter = F::new(black_box(model), black_box(drag))?;
    let begin = Instant::now();
    for _ in 0..PASSES {
        for measurement in black_box(record) {
            filter.step(measurement)?;
            black_box(filter.state());
        }
    }
    Ok((begin.elapsed().as_secs_f64() / (PASSES * SAMPLES) as f64, estimate))
}

/// A block of updates.
fn time_least_squares<L: LeastSquares<N>, const N: usize>(
    record: &[(SVector<f64, N>, f64)],
) -> Result<Block> {
    let mut filter = L::new().map_err(message)?;
    let mut first_pass = Vec::new();
    let begin = Instant::now();
    for pass in 0..PASSES {
        for (regressor, target) in black_box(record) {
            filter.update(regressor, *target).map_err(message)?;
            black_box(filter.parameters());
        }
        if pass == 0 {
            first_pass = filter.parameters().as_slice().to_vec();
        }
    }
    Ok((begin.elapsed().as_secs_f64() / (PASSES * SAMPLES) as f64, first_pass))
}
