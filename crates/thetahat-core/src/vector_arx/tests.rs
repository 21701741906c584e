extern crate std;
use std::vec::Vec;

use nalgebra::{Const, SMatrix, SVector, Vector2};

use crate::noise::Noise;
use crate::{
    Action, ArxOrders, Covariance, Error, Forgetting, InputOrders, LeastSquares, RecursiveArx,
    RecursiveVectorArx, RlsStart,
};

/// Two outputs, two inputs with delays of 1 and 2, a constant: 2·2 + 2 + 1 + 1 parameters an equation.
const ORDERS: ArxOrders<'static> = ArxOrders {
    na: 2,
    inputs: &[InputOrders { nb: 2, nk: 1 }, InputOrders { nb: 1, nk: 2 }],
    constant: true,
};
const N: usize = ORDERS.parameters_of(2);
const D: usize = ORDERS.delays();
type Plant = RecursiveVectorArx<f64, Const<N>, Const<2>, Const<D>>;
const _: () = assert!(Plant::fits(&ORDERS, 2) && !Plant::fits(&ORDERS, 3));

/// θ, a column for each output; both outputs feed each other, and the plant is stable.
fn truth() -> SMatrix<f64, N, 2> {
    SMatrix::from_columns(&[
        SVector::from([-1.2, 0.5, 0.1, -0.05, 0.4, 0.3, -0.2, 0.7]),
        SVector::from([-0.2, 0.1, -0.9, 0.3, -0.1, 0.6, 0.5, -0.3]),
    ])
}

/// The record of the plant: outputs and inputs of each sample, from rest, written down as the equation is.
fn record(samples: usize, size: f64) -> Vec<(Vector2<f64>, [f64; 2])> {
    let (truth, mut noise) = (truth(), Noise(5));
    let mut rows: Vec<(Vector2<f64>, [f64; 2])> = Vec::new();
    for k in 0..samples {
        let y = |output: usize, lag: usize| k.checked_sub(lag).map_or(0.0, |at| rows[at].0[output]);
        let u = |input: usize, lag: usize| k.checked_sub(lag).map_or(0.0, |at| rows[at].1[input]);
        let regressor =
            SVector::from([-y(0, 1), -y(0, 2), -y(1, 1), -y(1, 2), u(0, 1), u(0, 2), u(1, 2), 1.0]);
        let e = Vector2::new(noise.next(), noise.next()) * size;
        rows.push((truth.tr_mul(&regressor) + e, [noise.next(), noise.next()]));
    }
    rows
}

fn plant(forgetting: Forgetting<f64>) -> Result<Plant, Error> {
    RecursiveVectorArx::new(&ORDERS, &Vector2::new(2.0, 2.0), &[1.0, 1.0], forgetting)
}

#[test]
fn exact_data_give_the_plant_and_its_future() -> Result<(), Error> {
    let rows = record(60, 0.0);
    let mut plant = plant(Forgetting::None)?.with_start(RlsStart::Exact)?;
    for (y, u) in &rows[..50] {
        plant.log_row(y, u)?;
    }
    assert!((plant.estimator().parameters() - truth()).amax() < 1e-9);
    let coefficients = |row, output| plant.a(row, output).map(Iterator::collect::<Vec<f64>>);
    let near = |found: Option<Vec<f64>>, truth: &[f64]| {
        found.is_some_and(|found| {
            found.len() == truth.len() && found.iter().zip(truth).all(|(a, b)| (a - b).abs() < 1e-9)
        })
    };
    assert!(near(coefficients(0, 0), &[1.0, -1.2, 0.5]) && near(coefficients(0, 1), &[0.0, 0.1, -0.05]));
    assert!(near(coefficients(1, 0), &[0.0, -0.2, 0.1]) && coefficients(1, 2).is_none());
    assert!(coefficients(2, 0).is_none());
    assert!(near(plant.b(1, 0).map(Iterator::collect), &[0.0, -0.1, 0.6]));
    assert!(near(plant.b(0, 1).map(Iterator::collect), &[0.0, 0.0, -0.2]));
    assert!(plant.b(0, 2).is_none() && plant.b(2, 0).is_none() && plant.constant(2).is_none());
    assert!(plant.constant(1).is_some_and(|constant| (constant + 0.3).abs() < 1e-9));

    let future: Vec<f64> = rows[50..].iter().flat_map(|row| row.1).collect();
    let mut ahead = [0.0; 20];
    plant.predict(&future, &mut ahead)?;
    for ((y, _), found) in rows[50..].iter().zip(ahead.chunks(2)) {
        assert!((y[0] - found[0]).abs() + (y[1] - found[1]).abs() < 1e-8);
    }
    Ok(())
}

#[test]
fn without_forgetting_it_is_the_batch() -> Result<(), Error> {
    let rows = record(400, 0.3);
    let mut plant = plant(Forgetting::None)?.with_start(RlsStart::Exact)?;
    let mut batches: [LeastSquares<f64, Const<N>>; 2] = [LeastSquares::new(), LeastSquares::new()];
    for (y, u) in &rows {
        let mut lags = plant.lags().clone();
        lags.push_inputs(u)?;
        if let Some(regressor) = lags.regressor() {
            for (batch, &output) in batches.iter_mut().zip(y) {
                batch.add(regressor, output)?;
            }
        }
        plant.log_row(y, u)?;
    }
    for (output, batch) in batches.iter().enumerate() {
        let difference = plant.estimator().parameters().column(output) - batch.solve()?.parameters();
        assert!(difference.amax() < 1e-10, "{difference}");
    }
    Ok(())
}

/// With one output it is the estimator of one output, to the bit, whatever is missing.
#[test]
fn one_output_is_that_of_recursive_arx() -> Result<(), Error> {
    let orders = ArxOrders { na: 2, inputs: &[InputOrders { nb: 2, nk: 1 }], constant: false };
    let memory = Forgetting::Exponential { factor: 0.97 };
    let mut one: RecursiveArx<f64, Const<4>> = RecursiveArx::new(&orders, 1.0, &[1.0], memory)?;
    let mut several: RecursiveVectorArx<f64, Const<4>, Const<1>> =
        RecursiveVectorArx::new(&orders, &[1.0].into(), &[1.0], memory)?;
    let mut noise = Noise(8);
    for k in 0..300 {
        let y = if k % 37 == 9 { f64::NAN } else { noise.next() };
        let (scalar, vector) = (one.measured(y)?, several.measured(&[y].into())?);
        assert_eq!(scalar.action, vector.action);
        assert_eq!(scalar.error.to_bits(), vector.error[0].to_bits());
        assert_eq!(scalar.variance.to_bits(), vector.variance[0].to_bits());
        if k % 53 != 11 {
            let u = [noise.next()];
            one.applied(&u)?;
            several.applied(&u)?;
        }
        if k % 101 == 50 {
            one.gap();
            several.gap();
        }
    }
    assert_eq!(one.estimator().parameters(), several.estimator().parameters());
    Ok(())
}

#[test]
fn a_missing_output_corrects_nothing_and_leaves_the_others_in_time() -> Result<(), Error> {
    let rows = record(200, 0.0);
    let mut plant = plant(Forgetting::None)?.with_start(RlsStart::Exact)?;
    for (k, (y, u)) in rows.iter().enumerate() {
        let y = if k % 40 == 20 { Vector2::new(y[0], f64::NAN) } else { *y };
        let action = plant.log_row(&y, u)?.action;
        match k {
            0 | 1 => assert_eq!(action, Action::NotReady),
            _ if k % 40 == 20 => assert_eq!(action, Action::Missing),
            // It sits in two taps.
            _ if k > 20 && (k % 40 == 21 || k % 40 == 22) => assert_eq!(action, Action::NotReady),
            _ => assert!(matches!(action, Action::Updated | Action::Collecting), "{k} {action:?}"),
        }
    }
    assert!((plant.estimator().parameters() - truth()).amax() < 1e-8);
    // What is given to start from is where it starts.
    let held = Covariance::from_diagonal(&SVector::from([0.0; N]))?;
    let mut held = self::plant(Forgetting::None)?.with_parameters(truth())?.with_covariance(held)?;
    for (y, u) in &rows {
        let innovation = held.log_row(y, u)?;
        assert!(innovation.error.iter().all(|error| error.is_nan() || error.abs() < 1e-12));
    }
    held.set_adaptation(false);
    assert_eq!(held.log_row(&rows[0].0, &[0.0; 2])?.action, Action::Frozen);
    Ok(())
}

#[test]
fn what_is_wrong_is_refused_and_changes_nothing() -> Result<(), Error> {
    let mut plant = plant(Forgetting::None)?;
    for (y, u) in record(20, 0.1) {
        plant.log_row(&y, &u)?;
    }
    let before = std::format!("{plant:?}");
    let one = Vector2::new(1.0, 1.0);
    let infinite = plant.log_row(&Vector2::new(1.0, f64::INFINITY), &[0.0; 2]).map(|_| ());
    assert_eq!(infinite, Err(Error::Infinite { argument: "output" }));
    assert!(matches!(plant.measured(&(one * 1e200)), Err(Error::TooLarge { argument: "output" })));
    assert!(matches!(plant.log_row(&one, &[0.0]), Err(Error::Length { argument: "inputs", .. })));
    assert!(matches!(plant.applied(&[0.0, f64::INFINITY]), Err(Error::Infinite { .. })));
    let mut ahead = [7.0; 3];
    assert!(matches!(plant.predict(&[0.0; 2], &mut ahead), Err(Error::Length { argument: "outputs", .. })));
    assert!(matches!(plant.predict(&[0.0; 3], &mut ahead[..2]), Err(Error::Length { .. })));
    assert_eq!(ahead, [7.0; 3]);
    assert_eq!(std::format!("{plant:?}"), before);

    type Wrong = RecursiveVectorArx<f64, Const<{ N - 1 }>, Const<2>, Const<D>>;
    let wrong = Wrong::new(&ORDERS, &one, &[1.0, 1.0], Forgetting::None).map(|_| ());
    assert_eq!(wrong, Err(Error::Orders { needed: N, available: N - 1 }));
    let direct = ArxOrders { na: 1, inputs: &[InputOrders { nb: 1, nk: 0 }], constant: false };
    let mut direct: RecursiveVectorArx<f64, Const<3>, Const<2>> =
        RecursiveVectorArx::new(&direct, &one, &[1.0], Forgetting::None)?;
    assert_eq!(direct.measured(&one).map(|_| ()), Err(Error::InputFirst { input: 0 }));
    Ok(())
}
