//! Fits under a criterion: against linear programs of another solver, conditions of optimality, and vertices one by
//! one.

mod reference;
mod refusals;

use std::ops::Range;

use thetahat_core::nalgebra::{DMatrix, DVector};
use thetahat_numerics::noise::Noise;

use super::*;
use crate::estimate::{Initial, arx::arx};
use reference::{Reference, box_of_vertices, errors, norm_of, table};

/// y(t) = 1.2 y(t-1) - 0.5 y(t-2) + 0.8 u(t-1) + 0.3 u(t-2) + e(t), e being `size` times what `error` makes of uniform
/// numbers.
fn data(length: usize, noise: &mut Noise, size: f64, error: fn(f64) -> f64) -> (Vec<f64>, Vec<f64>) {
    let u = noise.take(length);
    let mut y: Vec<f64> = Vec::new();
    for t in 0..length {
        let past = |values: &[f64], lag: usize| if t < lag { 0.0 } else { values[t - lag] };
        let driven = 0.8 * past(&u, 1) + 0.3 * past(&u, 2);
        y.push(1.2 * past(&y, 1) - 0.5 * past(&y, 2) + driven + size * error(noise.uniform()));
    }
    (y, u)
}

fn even(uniform: f64) -> f64 {
    uniform
}

/// A double exponential distribution of variance 2: single wild samples.
fn wild(uniform: f64) -> f64 {
    -uniform.signum() * (1.0 - uniform.abs()).max(1e-12).ln()
}

fn record<'a>(y: &'a [f64], inputs: &[&'a [f64]], segments: &[Range<usize>]) -> Record<'a> {
    let mut record = Record::new(y, inputs.to_vec()).unwrap();
    record.past = vec![0; segments.len()];
    record.segments = segments.to_vec();
    record
}

/// One segment.
fn whole(length: usize) -> Vec<Range<usize>> {
    std::iter::once(0..length).collect()
}

fn orders(na: usize, nb: usize) -> Orders {
    Orders::arx(na, &[nb], &[1]).unwrap()
}

/// A criterion from what a person writes.
fn criterion(norm: Norm, bounds: &[&str], dc_gain: &[&str]) -> ConvexFit {
    ConvexFit {
        norm,
        bounds: bounds.iter().map(|bound| bound.parse().unwrap()).collect(),
        dc_gain: dc_gain.iter().map(|gain| gain.parse().unwrap()).collect(),
        ..ConvexFit::default()
    }
}

/// A fit to one segment of which the samples without a past are left out.
fn fit(y: &[f64], u: &[f64], orders: &Orders, criterion: &ConvexFit) -> Result<Constrained, Error> {
    let record = record(y, &[u], &whole(y.len()));
    constrained(&record, &["u".to_owned()], orders, Presample::Drop, criterion)
}

/// Random bounds and gains that the parameters of `data`, and few others, are near to.
fn random_demands(noise: &mut Noise, orders: &Orders) -> ConvexFit {
    let mut criterion = ConvexFit::default();
    for parameter in orders.names() {
        if noise.uniform() > 0.4 {
            let low = noise.uniform();
            criterion.bounds.push(Bound { parameter, low, high: low + noise.uniform().abs() });
        }
    }
    if orders.nb[0] > 0 && noise.uniform() > 0.4 {
        let low = 2.0 * noise.uniform();
        let high = if noise.uniform() > 0.0 { low } else { low + 1.0 };
        criterion.dc_gain.push(GainBound { input: None, low, high });
    }
    criterion
}

const ALL: [Norm; 3] = [Norm::One, Norm::Two, Norm::Infinity];

#[test]
fn what_a_bound_holds_has_no_spread() {
    let mut noise = Noise(31);
    let (y, u) = data(400, &mut noise, 0.1, even);
    let held = criterion(Norm::Two, &["a1=-0.6..0"], &[]);
    let found = fit(&y, &u, &orders(2, 2), &held).unwrap();
    let covariance = found.covariance.unwrap();
    assert_eq!(found.parameters[0], -0.6);
    assert_eq!(covariance[0], [0.0; 4]);
    assert!((1..4).all(|index| covariance[index][index] > 0.0));
}

#[test]
fn sums_and_largest_errors_equal_those_of_linear_programs() {
    let mut noise = Noise(1);
    let (mut fitted, mut refused) = (0, 0);
    for case in 0..360 {
        let length = 12 + case % 29;
        let size = [1.0, 0.1, 1e-3, 1e-6][case % 4];
        let (y, u) = data(length, &mut noise, size, if case % 2 == 0 { wild } else { even });
        let (na, nb) = [(1, 1), (2, 1), (1, 2), (0, 3), (0, 1), (3, 0)][case % 6];
        let orders = orders(na, nb);
        let criterion = ConvexFit {
            norm: [Norm::One, Norm::Infinity][case / 6 % 2],
            ..random_demands(&mut noise, &orders)
        };
        let segments =
            if noise.uniform() > 0.0 { whole(length) } else { vec![0..length / 3, length / 3 + 1..length] };
        let presample = if noise.uniform() > 0.0 { Presample::Drop } else { Presample::Zero };
        let record = record(&y, &[&u], &segments);
        let table = table(&record, &orders, presample);
        let mut reference = Reference::new(&vec![0.0; na + nb], &criterion, &orders);
        reference.add_norm(&table, criterion.norm);
        let expected = reference.solve();
        let found = constrained(&record, &["u".to_owned()], &orders, presample, &criterion);
        match (expected, found) {
            (Some(expected), Ok(found)) => {
                let (theirs, own) = (
                    norm_of(&table, &expected, criterion.norm),
                    norm_of(&table, &found.parameters, criterion.norm),
                );
                assert!((own - theirs).abs() < 1e-10 * theirs, "{case}: {own} {theirs} {criterion:?}");
                assert!((own - found.outcome.objective).abs() < 1e-12 * own, "{case}");
                assert_eq!(found.samples, table.len());
                fitted += 1;
            }
            (None, Err(Error::Data { message, .. })) => {
                assert!(message.starts_with("infeasible: "), "{message}");
                refused += 1;
            }
            (expected, found) => panic!("{case} {criterion:?} {expected:?} {found:?}"),
        }
    }
    assert!(fitted > 300 && refused > 3, "{fitted} {refused}");
}

#[test]
fn parameters_of_few_samples_are_those_of_the_linear_program() {
    let mut noise = Noise(2);
    for case in 0..60 {
        let (y, u) = data(30, &mut noise, 0.1, wild);
        let orders = orders(1 + case % 2, 1);
        let record = record(&y, &[&u], &whole(30));
        let table = table(&record, &orders, Presample::Drop);
        for norm in [Norm::One, Norm::Infinity] {
            let mut reference =
                Reference::new(&vec![0.0; orders.parameters()], &ConvexFit::default(), &orders);
            reference.add_norm(&table, norm);
            let expected = reference.solve().unwrap();
            let found = fit(&y, &u, &orders, &criterion(norm, &[], &[])).unwrap();
            for (found, expected) in found.parameters.iter().zip(expected) {
                assert!((found - expected).abs() < 1e-9, "{norm} {found} {expected}");
            }
        }
    }
}

#[test]
fn a_noise_bound_gives_the_smallest_norm_and_the_box_of_the_linear_programs() {
    let mut noise = Noise(3);
    for case in 0..60 {
        let (y, u) = data(12 + case % 29, &mut noise, [1.0, 0.1, 1e-2][case % 3], even);
        let (na, nb) = [(1, 1), (2, 1), (0, 3), (2, 2)][case % 4];
        let orders = orders(na, nb);
        let record = record(&y, &[&u], &whole(y.len()));
        let table = table(&record, &orders, Presample::Drop);
        let least = fit(&y, &u, &orders, &criterion(Norm::Infinity, &[], &[])).unwrap().outcome.objective;
        let bound = least * [1.01, 1.5, 3.0][case / 3 % 3];
        let mut criterion = criterion(ALL[case % 3], if na > 1 { &["a1=-1.5..-1.0"] } else { &[] }, &[]);
        criterion.noise_bound = Some(bound);
        let found = match fit(&y, &u, &orders, &criterion) {
            Ok(found) => found,
            Err(error) => {
                assert!(error.to_string().contains("with a1=-1.5..-1:"), "{error}");
                continue;
            }
        };
        assert!(norm_of(&table, &found.parameters, Norm::Infinity) <= bound * (1.0 + 1e-10));
        assert_eq!(found.covariance, None);
        if criterion.norm == Norm::One {
            let mut reference = Reference::new(&vec![0.0; na + nb], &criterion, &orders);
            reference.add_norm(&table, Norm::One);
            reference.bound(&table, bound);
            let theirs = norm_of(&table, &reference.solve().unwrap(), Norm::One);
            assert!((found.outcome.objective - theirs).abs() < 1e-9 * theirs);
        }
        for (parameter, ends) in found.outcome.box_.unwrap().into_iter().enumerate() {
            for (sign, end) in [1.0, -1.0].into_iter().zip(ends) {
                let mut costs = vec![0.0; na + nb];
                costs[parameter] = sign;
                let mut reference = Reference::new(&costs, &criterion, &orders);
                reference.bound(&table, bound);
                let expected = reference.solve().unwrap()[parameter];
                // The other solver keeps |e| <= E to 1e-8 only.
                assert!((end - expected).abs() < 1e-6 * (ends[1] - ends[0]), "{case} {end} {expected}");
            }
        }
    }
}

#[test]
fn the_box_of_two_parameters_is_that_of_the_vertices() {
    let mut noise = Noise(4);
    for case in 0..40 {
        let size = [1.0, 1e-3, 1e-6, 1e-9][case % 4];
        let u = noise.take(25);
        let mut y = vec![0.0];
        (1..25).for_each(|t| y.push(0.7 * y[t - 1] + 2.0 * u[t - 1] + size * noise.uniform()));
        let table = table(&record(&y, &[&u], &whole(25)), &orders(1, 1), Presample::Drop);
        let bound = size * (1.0 + case as f64 / 20.0);
        let criterion = ConvexFit { noise_bound: Some(bound), ..ConvexFit::default() };
        let found = fit(&y, &u, &orders(1, 1), &criterion).unwrap().outcome.box_.unwrap();
        let expected = box_of_vertices(&table, bound);
        for (found, expected) in found.concat().iter().zip(expected.concat()) {
            // Rounding of the residuals is 1e-16 or so.
            assert!((found - expected).abs() < 1e-9 * size + 1e-14, "{size} {found} {expected}");
        }
    }
}

#[test]
fn least_squares_that_respects_the_bounds_is_that_of_arx() {
    let mut noise = Noise(5);
    let (y, u) = data(300, &mut noise, 0.3, even);
    for (initial, presample) in [(Initial::Drop, Presample::Drop), (Initial::Zero, Presample::Zero)] {
        for segments in [whole(300), vec![3..40, 41..45, 60..300]] {
            let record = record(&y, &[&u], &segments);
            let expected = arx(&record, &orders(2, 2), initial).unwrap();
            let inside = criterion(Norm::Two, &["a1=-3..3", "b1=0.."], &["1..9"]);
            for criterion in [ConvexFit::default(), inside] {
                let found =
                    constrained(&record, &["u".to_owned()], &orders(2, 2), presample, &criterion).unwrap();
                assert_eq!(found.parameters, expected.parameters());
                assert_eq!(
                    (found.samples, Some(found.condition)),
                    (expected.samples(), expected.condition())
                );
                assert!((found.sum_of_squares / found.samples as f64 - expected.mse()).abs() < 1e-15);
                assert_eq!((found.outcome.objective, found.outcome.iterations), (found.sum_of_squares, 0));
                assert!(found.outcome.active.is_empty());
                assert!(found.covariance.is_some());
            }
            // The same by the other way, with a bound on |e| that holds.
            let loose = ConvexFit { noise_bound: Some(100.0), ..ConvexFit::default() };
            let found = constrained(&record, &["u".to_owned()], &orders(2, 2), presample, &loose).unwrap();
            for (found, expected) in found.parameters.iter().zip(expected.parameters()) {
                assert!((found - expected).abs() < 1e-12);
            }
        }
    }
}

#[test]
fn least_squares_under_bounds_meets_the_conditions_of_optimality() {
    let mut noise = Noise(6);
    let mut actives = 0;
    for case in 0..120 {
        let (y, u) = data(60, &mut noise, [1.0, 1e-3][case % 2], even);
        let orders = orders(2, 2);
        let mut criterion = random_demands(&mut noise, &orders);
        criterion.dc_gain.clear();
        let found = fit(&y, &u, &orders, &criterion).unwrap();
        let table = table(&record(&y, &[&u], &whole(60)), &orders, Presample::Drop);
        let size = found.sum_of_squares.sqrt();
        for (index, name) in orders.names().iter().enumerate() {
            let errors = errors(&table, &found.parameters);
            let slope: f64 = table.iter().zip(errors).map(|((phi, _), e)| phi[index] * e).sum();
            // Units of |phi| |e|.
            let slope = slope / size / table.iter().map(|(phi, _)| phi[index].powi(2)).sum::<f64>().sqrt();
            let value = found.parameters[index];
            match criterion.bounds.iter().find(|bound| bound.parameter == *name) {
                Some(bound) => {
                    assert!(bound.low <= value && value <= bound.high, "{bound} {value}");
                    let active = found.outcome.active.contains(&bound.to_string());
                    assert_eq!(active, value == bound.low || value == bound.high);
                    actives += usize::from(active);
                    // More of it would help, were it allowed.
                    assert!(slope < 1e-9 || value == bound.high, "{slope}");
                    assert!(slope > -1e-9 || value == bound.low, "{slope}");
                }
                None => assert!(slope.abs() < 1e-9, "{slope}"),
            }
        }
    }
    assert!(actives > 100, "{actives}");
}

#[test]
fn a_range_as_narrow_as_rounding_keeps_its_ends_apart() {
    let mut noise = Noise(17);
    let (y, u) = data(200, &mut noise, 1e-6, even);
    for norm in ALL {
        let free = fit(&y, &u, &orders(2, 2), &criterion(norm, &[], &[])).unwrap().parameters[0];
        for away in [-1e-6, 1e-6] {
            let near = free + away;
            let far = near + away.signum() * 1e-12;
            let bound = Bound { parameter: "a1".into(), low: near.min(far), high: near.max(far) };
            let found =
                fit(&y, &u, &orders(2, 2), &ConvexFit { norm, bounds: vec![bound], ..ConvexFit::default() });
            assert_eq!(found.unwrap().parameters[0], near);
        }
    }
}

#[test]
fn a_noise_bound_holds_against_a_strong_ridge() {
    let mut noise = Noise(18);
    let (y, u) = data(200, &mut noise, 1e-6, even);
    let table = table(&record(&y, &[&u], &whole(200)), &orders(2, 2), Presample::Drop);
    for norm in ALL {
        for ridge in [1e3, 1e6] {
            let criterion = ConvexFit { norm, ridge, noise_bound: Some(2e-6), ..ConvexFit::default() };
            let found = fit(&y, &u, &orders(2, 2), &criterion).unwrap();
            let largest = norm_of(&table, &found.parameters, Norm::Infinity);
            // All of the bound is used up, to the rounding of e.
            assert!((largest - 2e-6).abs() < 2e-15, "{norm} {ridge} {largest}");
        }
    }
}

#[test]
fn gains_hold_for_each_input_and_norm() {
    let mut noise = Noise(7);
    let (y, u) = data(200, &mut noise, 0.1, even);
    let v = noise.take(200);
    let record = record(&y, &[&u, &v], &whole(200));
    let orders = Orders::arx(2, &[2, 1], &[1, 0]).unwrap();
    let names = ["u".to_owned(), "a=b".to_owned()];
    for norm in ALL {
        let gains = |parameters: &[f64]| {
            let a = 1.0 + parameters[0] + parameters[1];
            [(parameters[2] + parameters[3]) / a, parameters[4] / a]
        };
        let equal = criterion(norm, &[], &["u=3", "a=b=-0.5"]);
        let found = constrained(&record, &names, &orders, Presample::Drop, &equal).unwrap();
        let [first, second] = gains(&found.parameters);
        assert!((first - 3.0).abs() < 1e-9 && (second + 0.5).abs() < 1e-9, "{first} {second}");
        assert_eq!(found.outcome.active, ["dc-gain u=3", "dc-gain a=b=-0.5"]);
        // The gain of the data is 3.67.
        let range = criterion(norm, &[], &["u=1..3", "a=b=-9..9"]);
        let found = constrained(&record, &names, &orders, Presample::Drop, &range).unwrap();
        assert!((gains(&found.parameters)[0] - 3.0).abs() < 1e-9);
        assert_eq!(found.outcome.active, ["dc-gain u=1..3"]);
        let free = criterion(norm, &[], &["u=3.."]);
        let found = constrained(&record, &names, &orders, Presample::Drop, &free).unwrap();
        assert!(found.outcome.active.is_empty());
    }
}

#[test]
fn a_ridge_is_more_samples() {
    let mut noise = Noise(8);
    let (y, u) = data(80, &mut noise, 0.3, even);
    let orders = orders(2, 2);
    let table = table(&record(&y, &[&u], &whole(80)), &orders, Presample::Drop);
    let phi = DMatrix::from_fn(table.len(), 4, |row, column| table[row].0[column]);
    let target = DVector::from_fn(table.len(), |row, _| table[row].1);
    let sizes = DVector::from_fn(4, |column, _| phi.column(column).norm() / (table.len() as f64).sqrt());
    let gram = phi.tr_mul(&phi);
    for ridge in [1e-3, 1.0, 50.0, 1e4] {
        let criterion = ConvexFit { ridge, ..ConvexFit::default() };
        let found = fit(&y, &u, &orders, &criterion).unwrap();
        let sum = &gram + DMatrix::from_diagonal(&sizes.map(|size| ridge * size * size));
        let inverse = sum.try_inverse().unwrap();
        let expected = &inverse * phi.tr_mul(&target);
        let errors = &target - &phi * &expected;
        let variance = errors.norm_squared() / (table.len() as f64 - (&inverse * &gram).trace());
        let covariance = &inverse * &gram * &inverse * variance;
        for i in 0..4 {
            assert!((found.parameters[i] - expected[i]).abs() < 1e-12);
            for j in 0..4 {
                let entry = found.covariance.as_ref().unwrap()[i][j];
                assert!(
                    (entry - covariance[(i, j)]).abs() < 1e-12 * covariance[(i, i)].max(covariance[(j, j)])
                );
            }
        }
        assert!((found.outcome.objective - errors.norm_squared()).abs() < 1e-12 * errors.norm_squared());
    }
}

#[test]
fn no_small_change_is_better_with_a_ridge() {
    let mut noise = Noise(9);
    let (y, u) = data(80, &mut noise, 0.3, wild);
    let orders = orders(2, 2);
    let table = table(&record(&y, &[&u], &whole(80)), &orders, Presample::Drop);
    let count = table.len() as f64;
    let square = |of: fn(&(Vec<f64>, f64), usize) -> f64, index: usize| {
        (table.iter().map(|row| of(row, index).powi(2)).sum::<f64>() / count).sqrt()
    };
    let target = square(|row, _| row.1, 0);
    for norm in [Norm::One, Norm::Infinity] {
        for ridge in [1e-3, 1.0, 50.0, 1e4] {
            let found = fit(&y, &u, &orders, &ConvexFit { norm, ridge, ..ConvexFit::default() }).unwrap();
            let value = |parameters: &[f64]| {
                let penalty =
                    |(index, value): (usize, &f64)| (value * square(|row, i| row.0[i], index)).powi(2);
                let penalty = ridge / target * parameters.iter().enumerate().map(penalty).sum::<f64>();
                penalty + norm_of(&table, parameters, norm) * if norm == Norm::One { 1.0 } else { count }
            };
            let least = value(&found.parameters);
            for _ in 0..300 {
                let step = 0.1_f64.powf(4.0 + 3.0 * noise.uniform());
                let other: Vec<f64> =
                    found.parameters.iter().map(|value| value + step * noise.uniform()).collect();
                assert!(value(&other) > least * (1.0 - 1e-13), "{norm} {ridge} {step}");
            }
        }
    }
}

/// The least multiplier of the active samples, less what it must be at least: not negative at the optimum.
fn certificate(table: &[(Vec<f64>, f64)], parameters: &[f64], norm: Norm) -> f64 {
    let size = parameters.len();
    let q = DMatrix::from_fn(table.len(), size, |row, column| table[row].0[column]).qr().q();
    let errors = errors(table, parameters);
    let mut order: Vec<usize> = (0..table.len()).collect();
    order.sort_by(|a, b| errors[*a].abs().total_cmp(&errors[*b].abs()));
    let sign = |row: usize| errors[row].signum();
    if norm == Norm::One {
        // sum sign(e) q over the others + sum lambda q over the p zero errors = 0, |lambda| <= 1.
        let (zero, others) = order.split_at(size);
        let matrix = DMatrix::from_fn(size, size, |i, j| q[(zero[j], i)]);
        let right =
            DVector::from_fn(size, |i, _| -others.iter().map(|row| q[(*row, i)] * sign(*row)).sum::<f64>());
        return 1.0 - matrix.lu().solve(&right).unwrap().amax();
    }
    // sum lambda sign(e) q = 0 and sum lambda = 1 over the p + 1 largest errors, lambda >= 0.
    let peaks = &order[table.len() - size - 1..];
    let matrix =
        DMatrix::from_fn(
            size + 1,
            size + 1,
            |i, j| if i < size { q[(peaks[j], i)] * sign(peaks[j]) } else { 1.0 },
        );
    let right = DVector::from_fn(size + 1, |i, _| if i < size { 0.0 } else { 1.0 });
    matrix.lu().solve(&right).unwrap().min()
}

#[test]
fn long_records_have_multipliers_of_an_optimum() {
    let mut noise = Noise(10);
    for (length, size, error) in [(4000, 0.1, wild as fn(f64) -> f64), (4000, 1e-6, even), (1500, 10.0, wild)]
    {
        let (mut y, mut u) = data(length, &mut noise, size, error);
        // Offsets, and units of their own.
        y.iter_mut().for_each(|y| *y = 1e6 * (*y + 3.0));
        u.iter_mut().for_each(|u| *u = 1e-3 * (*u + 3.0));
        let orders = orders(3, 3);
        let table = table(&record(&y, &[&u], &whole(length)), &orders, Presample::Drop);
        for norm in [Norm::One, Norm::Infinity] {
            let found = fit(&y, &u, &orders, &criterion(norm, &[], &[])).unwrap();
            let least = certificate(&table, &found.parameters, norm);
            assert!(least > 0.0, "{norm} {length} {size}: {least}");
        }
    }
}

#[test]
fn quantised_and_noiseless_records_are_fitted() {
    let mut noise = Noise(11);
    let (y, u) = data(150, &mut noise, 0.1, even);
    let y: Vec<f64> = y.iter().map(|y| (4.0 * y).round() / 4.0).collect();
    let u: Vec<f64> = u.iter().map(|u| u.signum()).collect();
    let orders = orders(2, 2);
    let table = table(&record(&y, &[&u], &whole(150)), &orders, Presample::Drop);
    for norm in [Norm::One, Norm::Infinity] {
        let mut reference = Reference::new(&[0.0; 4], &ConvexFit::default(), &orders);
        reference.add_norm(&table, norm);
        let theirs = norm_of(&table, &reference.solve().unwrap(), norm);
        let own = fit(&y, &u, &orders, &criterion(norm, &[], &[])).unwrap().outcome.objective;
        assert!((own - theirs).abs() < 1e-10 * theirs, "{own} {theirs}");
    }
    let (y, u) = data(150, &mut noise, 0.0, even);
    for norm in ALL {
        for bound in [None, Some(0.0), Some(1e-9), Some(10.0)] {
            let criterion = ConvexFit { norm, noise_bound: bound, ..criterion(norm, &["a2=0.5..1"], &[]) };
            let found = fit(&y, &u, &orders, &criterion).unwrap();
            for (found, expected) in found.parameters.iter().zip([-1.2, 0.5, 0.8, 0.3]) {
                assert!((found - expected).abs() < 1e-12, "{norm} {bound:?} {found}");
            }
        }
    }
}

#[test]
fn units_of_the_channels_scale_the_fit() {
    let mut noise = Noise(12);
    let (y, u) = data(100, &mut noise, 0.2, wild);
    for norm in ALL {
        for (y_unit, u_unit) in [(1e100, 1.0), (1e-100, 1.0), (1.0, 1e100), (1e5, 1e-5), (1e-60, 1e60)] {
            let scaled =
                |values: &[f64], unit: f64| values.iter().map(|value| value * unit).collect::<Vec<_>>();
            let gain = |unit: f64| GainBound { input: None, low: unit, high: 2.0 * unit };
            let of = |unit: f64, gain_unit: f64| ConvexFit {
                norm,
                ridge: 2.0,
                bounds: vec!["a1=-1.1..0".parse().unwrap()],
                dc_gain: vec![gain(gain_unit)],
                noise_bound: Some(2.5 * unit),
                ..ConvexFit::default()
            };
            let expected = fit(&y, &u, &orders(2, 2), &of(1.0, 1.0)).unwrap();
            let (y, u) = (scaled(&y, y_unit), scaled(&u, u_unit));
            let found = fit(&y, &u, &orders(2, 2), &of(y_unit, y_unit / u_unit)).unwrap();
            for (index, (found, expected)) in found.parameters.iter().zip(&expected.parameters).enumerate() {
                let unit = if index < 2 { 1.0 } else { y_unit / u_unit };
                assert!(
                    (found / unit - expected).abs() < 1e-9,
                    "{norm} {y_unit} {u_unit} {found} {expected}"
                );
            }
            let power = if norm == Norm::Two { 2 } else { 1 };
            let objective = found.outcome.objective / y_unit.powi(power);
            assert!((objective - expected.outcome.objective).abs() < 1e-9 * objective);
        }
    }
}

#[test]
fn active_bounds_leave_no_variance_across_them() {
    let mut noise = Noise(13);
    let (y, u) = data(200, &mut noise, 0.3, even);
    let found = fit(&y, &u, &orders(2, 2), &criterion(Norm::Two, &["a1=-1..0"], &["3"])).unwrap();
    let covariance = found.covariance.unwrap();
    let matrix = DMatrix::from_fn(4, 4, |i, j| covariance[i][j]);
    let across = [DVector::from_vec(vec![1.0, 0.0, 0.0, 0.0]), DVector::from_vec(vec![-3.0, -3.0, 1.0, 1.0])];
    for direction in across {
        assert!((&matrix * direction).amax() < 1e-11 * matrix.amax());
    }
    let table = table(&record(&y, &[&u], &whole(200)), &orders(2, 2), Presample::Drop);
    // theta = base + a2 (0, 1, 0, 3)' + b1 (0, 0, 1, -1)': b1 + b2 = 3 (1 + a1 + a2).
    let free = DMatrix::from_row_slice(4, 2, &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 3.0, -1.0]);
    let phi = DMatrix::from_fn(table.len(), 4, |row, column| table[row].0[column]) * &free;
    let variance = found.sum_of_squares / (table.len() as f64 - 2.0);
    let expected = &free * phi.tr_mul(&phi).try_inverse().unwrap() * free.transpose() * variance;
    assert!((matrix - &expected).amax() < 1e-12 * expected.amax());
}

#[test]
fn standard_errors_of_the_sum_of_errors_are_those_of_many_trials() {
    let mut noise = Noise(14);
    let trials = 150;
    let mut found: Vec<Vec<f64>> = Vec::new();
    let mut variance = [0.0; 2];
    for _ in 0..trials {
        let u = noise.take(150);
        let mut y = vec![0.0];
        (1..150).for_each(|t| y.push(0.6 * y[t - 1] + u[t - 1] + wild(noise.uniform())));
        let fitted = fit(&y, &u, &orders(1, 1), &criterion(Norm::One, &[], &[])).unwrap();
        for (index, row) in fitted.covariance.unwrap().iter().enumerate() {
            variance[index] += row[index] / f64::from(trials);
        }
        found.push(fitted.parameters);
    }
    for (index, expected) in [-0.6, 1.0].into_iter().enumerate() {
        let spread = found.iter().map(|parameters| (parameters[index] - expected).powi(2)).sum::<f64>();
        // 150 trials tell a standard deviation to 6 %; the quantiles of 150 errors add some.
        let ratio = (variance[index] / (spread / f64::from(trials))).sqrt();
        assert!((0.85..1.25).contains(&ratio), "{index}: {ratio}");
    }
    // A bound that is active takes the theory away.
    let (y, u) = data(100, &mut noise, 0.1, wild);
    for criterion in [
        criterion(Norm::One, &["a1=-1..0"], &[]),
        criterion(Norm::Infinity, &[], &[]),
        ConvexFit { norm: Norm::One, ridge: 1.0, ..ConvexFit::default() },
    ] {
        assert_eq!(fit(&y, &u, &orders(2, 2), &criterion).unwrap().covariance, None);
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let mut noise = Noise(15);
    // From 65 536 samples on the rows are factored in parallel.
    for (norm, length) in [(Norm::One, 1500), (Norm::Two, 70_000), (Norm::Infinity, 70_000)] {
        let (y, u) = data(length, &mut noise, 0.1, even);
        let criterion =
            ConvexFit { ridge: 3.0, noise_bound: Some(0.3), ..criterion(norm, &["a1=-1.15..0"], &["1..9"]) };
        let results = [1, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| fit(&y, &u, &orders(2, 2), &criterion).unwrap())
        });
        assert_eq!(results[0], results[1]);
    }
}

#[test]
fn an_outcome_is_read_back_from_its_json() {
    let mut noise = Noise(16);
    let (y, u) = data(100, &mut noise, 0.1, even);
    let criterion = ConvexFit { noise_bound: Some(0.5), ..criterion(Norm::Infinity, &["a1=-1..0"], &[]) };
    let outcome = fit(&y, &u, &orders(2, 2), &criterion).unwrap().outcome;
    let json = serde_json::to_string(&outcome).unwrap();
    assert!(json.starts_with("{\"norm\":\"inf\",\"objective\":") && json.contains("\"box\":[[-"), "{json}");
    assert_eq!(serde_json::from_str::<ConvexOutcome>(&json).unwrap(), outcome);
}

#[test]
fn words_are_read_and_written() {
    for words in ["a1=-1.9..0", "b1=0..", "b1=..2", "a2=0.5", "b2_1=-1e-7..2.5e12"] {
        assert_eq!(words.parse::<Bound>().unwrap().to_string(), words);
    }
    for words in ["2.5", "1..3", "u1=1..3", "a=b=..3", "1e12.."] {
        assert_eq!(words.parse::<GainBound>().unwrap().to_string(), words);
    }
    for words in ["1", "2", "inf"] {
        assert_eq!(words.parse::<Norm>().unwrap().to_string(), words);
    }
    assert_eq!(
        "a1=.5...75".parse::<Bound>().unwrap(),
        Bound { parameter: "a1".into(), low: 0.5, high: 0.75 }
    );
    assert!(ConvexFit::default().is_plain());
    assert!(!ConvexFit { noise_bound: Some(1.0), ..ConvexFit::default() }.is_plain());
}

#[test]
fn figures_are_rounded_up() {
    assert_eq!(rounded_up(0.13724), "0.1373");
    assert_eq!(rounded_up(0.1372), "0.1372");
    assert_eq!(rounded_up(99_991.0), "100000");
    assert_eq!(rounded_up(1.000_01e-7), "1.001e-7");
    assert_eq!(rounded_up(2.0), "2");
}
