//! Predictions through rows in which outputs are missing.

use thetahat_core::nalgebra::{DMatrix, DVector};
use thetahat_numerics::noise::Noise;

use super::signal;
use crate::Error;
use crate::data::{Channel, Log, Rows};
use crate::model::{StateSpace, StateSpaceModel};
use crate::respond::state_space::covariance::{StateCovariance, added};
use crate::respond::{Horizon, InitialCondition, OnLog, state_space::StateSpaceOnLog};

const ZERO: InitialCondition = InitialCondition::Zero;
const NAN: f64 = f64::NAN;

/// Two inputs and two outputs, with a fast noise and a slow one.
fn plant() -> StateSpace {
    StateSpace {
        f: DMatrix::from_row_slice(3, 3, &[0.9, 0.2, 0.0, -0.2, 0.8, 0.1, 0.0, 0.0, 0.7]),
        g: DMatrix::from_row_slice(3, 2, &[1.0, 0.0, 0.2, 0.5, 0.0, 1.0]),
        h: DMatrix::from_row_slice(2, 3, &[1.0, 0.0, 0.3, 0.0, 1.0, -0.5]),
        d: DMatrix::from_row_slice(2, 2, &[0.0, 0.1, 0.0, 0.0]),
        k: DMatrix::from_row_slice(3, 2, &[0.6, 0.1, -0.2, 0.5, 0.1, 0.2]),
        noise_covariance: DMatrix::from_row_slice(2, 2, &[0.25, 0.1, 0.1, 0.5]),
        sample_time: 0.1,
    }
}

fn model(space: &StateSpace) -> Result<StateSpaceModel, Error> {
    let named =
        |letter: &str, count: usize| (1..=count).map(|place| signal(&format!("{letter}{place}"))).collect();
    let (inputs, outputs) = (space.g.ncols(), space.h.nrows());
    StateSpaceModel::new((named("u", inputs), named("y", outputs)), vec![0; inputs], space, 6, None)
}

/// Inputs and outputs from rest, driven by e of the covariance C C'.
fn signals(space: &StateSpace, rows: usize, factor: &DMatrix<f64>) -> [Vec<Vec<f64>>; 2] {
    let mut noise = Noise(5);
    let (inputs, outputs) = (space.g.ncols(), space.h.nrows());
    let (mut u, mut y) = (vec![Vec::new(); inputs], vec![Vec::new(); outputs]);
    let mut x = DVector::zeros(space.f.nrows());
    for _ in 0..rows {
        let input = DVector::from_fn(inputs, |_, _| noise.normal());
        let e = factor * DVector::from_fn(factor.ncols(), |_, _| noise.normal());
        let output = &space.h * &x + &space.d * &input + &e;
        x = &space.f * x + &space.g * &input + &space.k * e;
        u.iter_mut().zip(&input).for_each(|(u, value)| u.push(*value));
        y.iter_mut().zip(&output).for_each(|(y, value)| y.push(*value));
    }
    [u, y]
}

fn root(space: &StateSpace) -> DMatrix<f64> {
    space.noise_covariance.clone().cholesky().map_or_else(|| DMatrix::zeros(0, 0), |factor| factor.l())
}

fn log(u: &[Vec<f64>], y: &[Vec<f64>]) -> Result<Log, Error> {
    let channels = |letter: &'static str, all: &[Vec<f64>]| {
        let each = all.iter().cloned().enumerate();
        each.map(|(place, values)| Channel { name: format!("{letter}{}", place + 1), values })
            .collect::<Vec<_>>()
    };
    Log::new([channels("u", u), channels("y", y)].concat(), 0.1)
}

fn all(log: &Log) -> Result<[Rows; 1], Error> {
    Ok([Rows::new(1, log.rows())?])
}

/// What an independent Kalman filter says of each row k steps ahead: the predicted outputs, and their covariance. By
/// the textbook's formulas with full inverses, from rest.
fn dense(
    space: &StateSpace,
    u: &[Vec<f64>],
    y: &[Vec<f64>],
    steps: usize,
) -> Vec<(DVector<f64>, DMatrix<f64>)> {
    let StateSpace { f, g, h, d, k, noise_covariance: r, .. } = space;
    let mut x = DVector::zeros(f.nrows());
    let mut p = DMatrix::zeros(f.nrows(), f.nrows());
    let input = |row: usize| DVector::from_iterator(u.len(), u.iter().map(|u| u[row]));
    let driven = k * r * k.transpose();
    let mut found = Vec::new();
    for row in 0..y[0].len() {
        if row + steps <= y[0].len() {
            let (mut ahead, mut spread) = (x.clone(), p.clone());
            for between in row..row + steps - 1 {
                ahead = f * ahead + g * input(between);
                spread = f * spread * f.transpose() + &driven;
            }
            found.push((h * ahead + d * input(row + steps - 1), h * spread * h.transpose() + r));
        }
        let there: Vec<usize> = (0..y.len()).filter(|output| !y[*output][row].is_nan()).collect();
        let (seen, direct) = (h.select_rows(&there), d.select_rows(&there));
        let crossed = r.select_columns(&there);
        let s = &seen * &p * seen.transpose() + crossed.select_rows(&there);
        let inverse = if there.is_empty() {
            s.clone()
        } else {
            s.clone().try_inverse().unwrap_or_else(|| s.clone() * NAN)
        };
        let gain = (f * &p * seen.transpose() + k * crossed) * inverse;
        let measured = DVector::from_iterator(there.len(), there.iter().map(|output| y[*output][row]));
        let left = measured - seen * &x - direct * input(row);
        x = f * x + g * input(row) + &gain * left;
        p = f * p * f.transpose() + &driven - &gain * s * gain.transpose();
    }
    found
}

/// Outputs of which some rows miss one, some the other and some both.
fn holes(mut y: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let rows = y[0].len();
    let mut noise = Noise(9);
    for (output, part) in y.iter_mut().zip([-0.6, -0.7]) {
        output.iter_mut().skip(1).filter(|_| noise.uniform() < part).for_each(|value| *value = NAN);
    }
    y.iter_mut().for_each(|y| y[100..110].fill(NAN));
    y[1][rows - 4..].fill(NAN);
    y[0][rows - 4..].fill(1.0);
    y
}

#[test]
fn predictions_are_those_of_an_independent_kalman_filter() -> Result<(), Error> {
    let space = plant();
    let [u, y] = signals(&space, 300, &root(&space));
    let y = holes(y);
    let log = log(&u, &y)?;
    let model = model(&space)?;
    let own = StateSpaceOnLog::new(&model, &log, &all(&log)?, Some(ZERO))?;
    for steps in [1, 2, 7, 40] {
        let expected = dense(&space, &u, &y, steps);
        let found = own.respond(Horizon::Steps { steps }, ZERO)?;
        let deviations = own.deviations(steps, ZERO)?;
        for (output, y) in y.iter().enumerate() {
            assert!(found[output].values[..steps - 1].iter().all(|value| value.is_nan()));
            for (row, (value, covariance)) in (steps - 1..).zip(&expected) {
                let apart = found[output].values[row] - value[output];
                assert!(apart.abs() < 1e-11, "{steps} steps, output {output}, row {row}: {apart:e}");
                let deviation = model.student_factor() * covariance[(output, output)].sqrt();
                let apart = deviations[output][row] - deviation;
                assert!(apart.abs() < 1e-11, "{steps} steps, output {output}, row {row}: {apart:e}");
            }
            let counted: Vec<usize> = found[output].counted.iter().cloned().flatten().collect();
            let measured: Vec<usize> = (steps - 1..300).filter(|row| !y[*row].is_nan()).collect();
            assert_eq!(counted, measured);
        }
    }
    Ok(())
}

#[test]
fn forecasts_begin_after_the_last_measured_output() -> Result<(), Error> {
    let space = plant();
    let [u, y] = signals(&space, 60, &root(&space));
    let mut y = y;
    y[1][47..].fill(NAN);
    y[0][50..].fill(NAN);
    let log = log(&u, &y)?;
    let model = model(&space)?;
    let rows = all(&log)?;
    let own = StateSpaceOnLog::new(&model, &log, &rows, Some(ZERO))?;
    let Some((first, forecasts)) = own.forecast(&log, &rows, 10, ZERO)? else {
        return Err(Error::data("there is no forecast"));
    };
    assert_eq!(first, 50);
    // To a filter, rows without outputs are one step ahead.
    let expected = dense(&space, &u, &y, 1);
    for (row, (value, covariance)) in (50..).zip(&expected[50..]) {
        for (output, forecast) in forecasts.iter().enumerate() {
            assert!((forecast.values[row - 50] - value[output]).abs() < 1e-11);
            let deviation = model.student_factor() * covariance[(output, output)].sqrt();
            assert!((forecast.standard_deviations[row - 50] - deviation).abs() < 1e-11);
        }
    }
    // The rows that are forecast are not predicted.
    let found = own.respond(Horizon::ONE_STEP, ZERO)?;
    assert!(found[1].values[49].is_finite() && found[1].values[50].is_nan());
    assert!(found[1].counted.iter().cloned().flatten().eq(0..47));
    Ok(())
}

#[test]
fn complete_rows_have_the_constant_gain_and_holes_are_forgotten() {
    let space = plant();
    let mut covariance = StateCovariance::new(&space);
    let whole = [vec![0.0; 200], vec![0.0; 200]];
    let mut hole = whole.clone();
    hole[0][10] = NAN;
    hole[1][20..23].fill(NAN);
    hole[0][21] = NAN;
    let views = |y: &[Vec<f64>; 2]| -> Vec<Vec<f64>> { y.to_vec() };
    for (y, limit) in [(views(&whole), 0), (views(&hole), 90)] {
        let y: Vec<&[f64]> = y.iter().map(Vec::as_slice).collect();
        covariance.reset();
        let varying = (0..200).filter(|row| covariance.step(&y, *row)).count();
        assert!(covariance.next().is_none() && varying <= limit && (varying > 0) == (limit > 0), "{varying}");
    }
    // P is that of the state's error, and never negative.
    let y: Vec<&[f64]> = hole.iter().map(Vec::as_slice).collect();
    covariance.reset();
    for row in 0..60 {
        covariance.step(&y, row);
        if let Some(p) = covariance.next() {
            assert_eq!(p, &p.transpose());
            let least = p.clone().symmetric_eigenvalues().min();
            assert!(least >= -1e-17, "{row}: {least:e}");
        }
    }
}

#[test]
fn a_long_hole_ends_at_the_stationary_covariance() -> Result<(), Error> {
    let space = plant();
    let rows = 600;
    let [u, mut y] = signals(&space, rows, &root(&space));
    y.iter_mut().for_each(|y| y[100..500].fill(NAN));
    let log = log(&u, &y)?;
    let model = model(&space)?;
    let own = StateSpaceOnLog::new(&model, &log, &all(&log)?, None)?;
    let deviations = own.deviations(1, InitialCondition::Estimate)?;
    // P = F P F' + K R K' by its series.
    let StateSpace { f, h, k, noise_covariance: r, .. } = &space;
    let (mut p, mut term) = (DMatrix::zeros(3, 3), k * r * k.transpose());
    for _ in 0..600 {
        p += &term;
        term = f * term * f.transpose();
    }
    for (output, deviations) in deviations.iter().enumerate() {
        let stationary = model.student_factor() * (added(h, &p, output) + r[(output, output)]).sqrt();
        let alone = model.student_factor() * r[(output, output)].sqrt();
        assert!((deviations[499] / stationary - 1.0).abs() < 1e-9);
        assert_eq!((deviations[99], deviations[100], deviations[599]), (alone, alone, alone));
        assert!(deviations[101] > alone && deviations[500] > alone);
    }
    let found = own.respond(Horizon::ONE_STEP, InitialCondition::Estimate)?;
    assert_eq!(found[0].counted, [0..100, 500..600]);
    Ok(())
}

#[test]
fn errors_are_smaller_than_after_a_restart_and_as_large_as_they_should_be() -> Result<(), Error> {
    let space = plant();
    let rows = 4000;
    let [u, y] = signals(&space, rows, &root(&space));
    let mut noise = Noise(11);
    let mut missing = y.clone();
    (0..rows).filter(|_| noise.uniform() < -0.6).for_each(|row| missing[1][row] = NAN);
    let model = model(&space)?;
    let whole = log(&u, &missing)?;
    let own = StateSpaceOnLog::new(&model, &whole, &all(&whole)?, None)?;
    let start = InitialCondition::Estimate;
    let found = own.respond(Horizon::ONE_STEP, start)?;

    // Complete segments alone, each from the state that explains it best.
    let complete = whole.segments(&["y1", "y2"], &all(&whole)?)?;
    let apart =
        complete.iter().map(|rows| Rows::new(rows.start + 1, rows.end)).collect::<Result<Vec<_>, Error>>()?;
    let cut = StateSpaceOnLog::new(&model, &whole, &apart, None)?.respond(Horizon::ONE_STEP, start)?;
    // A state that explains a few rows best explains their noise: what counts is how far predictions are from those of
    // the whole log.
    let full = log(&u, &y)?;
    let ideal = StateSpaceOnLog::new(&model, &full, &all(&full)?, None)?.respond(Horizon::ONE_STEP, start)?;
    for output in 0..2 {
        let from_ideal = |values: &[f64]| {
            let each = complete.iter().cloned().flatten();
            each.map(|row| (values[row] - ideal[output].values[row]).powi(2)).sum::<f64>()
        };
        let (through, restarted) = (from_ideal(&found[output].values), from_ideal(&cut[output].values));
        assert!(through < 0.2 * restarted, "{output}: {through} {restarted}");
        // Rows that miss the other output count too.
        let counted: usize = found[output].counted.iter().map(|rows| rows.len()).sum();
        assert_eq!(counted, missing[output].iter().filter(|y| !y.is_nan()).count());
        let (variance, ratio) = own.noise(output, Some(1.0));
        // Of 3200 squares or more the mean has a standard error of 0.025.
        assert!(variance > space.noise_covariance[(output, output)]);
        assert!(ratio.is_some_and(|ratio| (ratio - 1.0).abs() < 0.075), "{output}: {ratio:?}");
    }

    // Those of all outputs together, and what is tested, is white.
    let mut covariance = StateCovariance::new(&space);
    let outputs: Vec<&[f64]> = missing.iter().map(Vec::as_slice).collect();
    let (mut nis, mut measured) = (0.0, 0_usize);
    let error = |output: usize, row: usize| missing[output][row] - found[output].values[row];
    for row in 0..rows {
        let p = covariance.next().cloned().unwrap_or_else(|| DMatrix::zeros(3, 3));
        covariance.step(&outputs, row);
        let there: Vec<usize> = (0..2).filter(|output| !error(*output, row).is_nan()).collect();
        let s = (&space.h * p * space.h.transpose() + &space.noise_covariance)
            .select_columns(&there)
            .select_rows(&there);
        let e = DVector::from_iterator(there.len(), there.iter().map(|output| error(*output, row)));
        nis += s.cholesky().map_or(NAN, |factor| e.dot(&factor.solve(&e)));
        measured += there.len();
    }
    // Its standard error is sqrt(2/7200).
    assert!((nis / measured as f64 - 1.0).abs() < 0.05, "{}", nis / measured as f64);
    for (output, tested) in own.tested()?.iter().enumerate() {
        let [innovations] = &*tested.innovations else {
            return Err(Error::data("there is more than one segment"));
        };
        let e = &innovations.errors;
        let square = e.iter().map(|e| e * e).sum::<f64>();
        let counted = innovations.counted_errors().count();
        let expected = space.noise_covariance[(output, output)];
        assert!((square / counted as f64 / expected - 1.0).abs() < 0.075);
        let outside = (1..=40).filter(|lag| {
            let products = e[*lag..].iter().zip(e).map(|(now, before)| now * before);
            let pairs =
                e[*lag..].iter().zip(e).filter(|(now, before)| **now != 0.0 && **before != 0.0).count();
            let size = square / counted as f64 * (pairs as f64).sqrt();
            (products.sum::<f64>() / size).abs() > 1.96
        });
        // Two of 40 are expected.
        assert!(outside.count() <= 5, "{output}");
    }
    Ok(())
}

#[test]
fn outputs_without_noise_of_their_own_are_no_trouble() -> Result<(), Error> {
    // e of the second output is twice that of the first, or there is none.
    for noises in [[1.0, 2.0], [1.0, 0.0], [0.0, 0.0]] {
        let mut space = plant();
        let factor = DMatrix::from_column_slice(2, 1, &noises);
        space.noise_covariance = &factor * factor.transpose();
        let [u, y] = signals(&space, 300, &factor);
        let y = holes(y.clone());
        let log = log(&u, &y[..])?;
        let model = model(&space)?;
        let own = StateSpaceOnLog::new(&model, &log, &all(&log)?, Some(ZERO))?;
        for steps in [1, 3] {
            for start in [ZERO, InitialCondition::Estimate] {
                let found = own.respond(Horizon::Steps { steps }, start)?;
                let deviations = own.deviations(steps, start)?;
                for (response, deviations) in found.iter().zip(&deviations) {
                    assert!(
                        response.values[2..].iter().chain(&deviations[2..]).all(|value| value.is_finite())
                    );
                }
            }
        }
        assert_eq!(own.tested()?.len(), 2);
    }
    Ok(())
}

#[test]
fn a_lost_state_is_estimated_anew() -> Result<(), Error> {
    let mut space = plant();
    space.f[(2, 2)] = 1.5;
    // The gain is that of its stationary filter, of states that noise of variance 0.1 drives.
    let (f, h, noise) = (space.f.clone(), space.h.clone(), space.noise_covariance.clone());
    let mut p = DMatrix::identity(3, 3);
    for _ in 0..200 {
        let s = &h * &p * h.transpose() + &noise;
        let Some(inverse) = s.clone().try_inverse() else { return Err(Error::data("S is singular")) };
        space.k = &f * &p * h.transpose() * inverse;
        p = &f * p * f.transpose() - &space.k * &s * space.k.transpose() + DMatrix::identity(3, 3) * 0.1;
    }
    space.noise_covariance += &space.h * p * space.h.transpose();
    let rows = 400;
    let mut noise = Noise(3);
    let mut values = || noise.take_normal(rows);
    let u = [values(), values()];
    let mut y = [values(), values()];
    // A short hole is gone through, a long one is not, and a single output does not do after it.
    y.iter_mut().for_each(|y| y[50..55].fill(NAN));
    y.iter_mut().for_each(|y| y[200..300].fill(NAN));
    y[0][300..310].fill(NAN);
    let log = log(&u, &y)?;
    let model = model(&space)?;
    let own = StateSpaceOnLog::new(&model, &log, &all(&log)?, None)?;
    let found = own.respond(Horizon::ONE_STEP, InitialCondition::Estimate)?;
    assert_eq!(found[1].counted, [0..50, 55..200, 310..400]);
    assert!(found[0].values[50..55].iter().all(|value| value.is_finite()));
    assert!(found[0].values[200..310].iter().all(|value| value.is_nan()));
    assert!(found[0].values[310..].iter().all(|value| value.is_finite()));
    Ok(())
}

#[test]
fn a_state_that_is_driven_by_no_noise_stays_known() -> Result<(), Error> {
    let mut space = plant();
    space.k.fill(0.0);
    let [u, y] = signals(&space, 300, &root(&space));
    let whole = log(&u, &y)?;
    let with_holes = log(&u, &holes(y))?;
    let model = model(&space)?;
    let predicted = |log: &Log| {
        StateSpaceOnLog::new(&model, log, &all(log)?, Some(ZERO))?.respond(Horizon::ONE_STEP, ZERO)
    };
    let (found, expected) = (predicted(&with_holes)?, predicted(&whole)?);
    for (found, expected) in found.iter().zip(&expected) {
        let apart =
            found.values.iter().zip(&expected.values).map(|(found, expected)| (found - expected).abs());
        assert!(apart.fold(0.0, f64::max) < 1e-14);
    }
    Ok(())
}
