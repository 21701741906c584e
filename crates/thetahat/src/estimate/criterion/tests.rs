//! Fits under a criterion against linear programs, conditions of optimality and vertices found by trial.

mod reference;
mod refusals;

use std::ops::Range;

use super::*;
use crate::estimate::{Initial, arx};
use crate::regression::noise::Noise;
use reference::{Reference, box_of_vertices, errors, norm_of, table};

/// What made the data: y(t) = 1.2 y(t-1) - 0.5 y(t-2) + 0.8 u(t-1) + 0.3 u(t-2) + size * error.
fn data(length: usize, noise: &mut Noise, size: f64, error: fn(f64) -> f64) -> (Vec<f64>, Vec<f64>) {
    let u = noise.take(length);
    let mut y = vec![0.0; length];
    for t in 0..length {
        let past = |values: &[f64], lag: usize| if t < lag { 0.0 } else { values[t - lag] };
        let driven = 0.8 * past(&u, 1) + 0.3 * past(&u, 2);
        y[t] = 1.2 * past(&y, 1) - 0.5 * past(&y, 2) + driven + size * error(noise.next());
    }
    (y, u)
}

/// Errors of a double exponential distribution from uniform ones.
fn wild(uniform: f64) -> f64 {
    -uniform.signum() * (1.0 - uniform.abs()).max(1e-12).ln()
}

fn even(uniform: f64) -> f64 {
    uniform
}

const ALL: [Norm; 3] = [Norm::One, Norm::Two, Norm::Infinity];

fn record<'a>(y: &'a [f64], u: &[&'a [f64]], segments: &[Range<usize>]) -> Record<'a> {
    let mut record = Record::new(y, u.to_vec()).unwrap();
    record.past = vec![0; segments.len()];
    record.segments = segments.to_vec();
    record
}

/// One segment.
fn whole(length: usize) -> Vec<Range<usize>> {
    std::iter::once(0..length).collect()
}

/// In the words of a user.
fn criterion(norm: Norm, bounds: &[&str], gains: &[&str]) -> Criterion {
    let bounds = bounds.iter().map(|text| text.parse().unwrap()).collect();
    let dc_gain = gains.iter().map(|text| text.parse().unwrap()).collect();
    Criterion { norm, bounds, dc_gain, ..Criterion::default() }
}

fn orders(na: usize, nb: usize) -> Orders {
    Orders::arx(na, &[nb], &[1]).unwrap()
}

fn fit(y: &[f64], u: &[f64], orders: &Orders, criterion: &Criterion) -> Result<Constrained, Error> {
    constrained(&Record::new(y, vec![u])?, &["u".to_owned()], orders, Presample::Drop, criterion)
}

/// Criteria with nothing asked for, bounds that hold the fit back, and gains.
fn criteria(norm: Norm) -> [Criterion; 4] {
    [
        criterion(norm, &[], &[]),
        criterion(norm, &["a1=-0.6..0", "b1=..0.7"], &[]),
        criterion(norm, &[], &["2.5"]),
        criterion(norm, &[], &["u=3..3.2"]),
    ]
}

#[test]
fn one_norm_and_largest_error_equal_linear_programs() {
    let mut noise = Noise(1);
    for length in [8, 15, 25, 40] {
        for _ in 0..5 {
            let (y, u) = data(length, &mut noise, 0.3, wild);
            for orders in [orders(1, 1), orders(2, 1), orders(1, 2)] {
                let segments = if length == 40 { vec![0..15, 16..40] } else { whole(length) };
                let record = record(&y, &[&u], &segments);
                for presample in [Presample::Drop, Presample::Zero] {
                    let rows = table(&record, &orders, presample);
                    for criterion in [Norm::One, Norm::Infinity].into_iter().flat_map(criteria) {
                        let mut program =
                            Reference::new(&vec![0.0; orders.parameters()], &criterion, &orders);
                        program.add_norm(&rows, criterion.norm);
                        let expected = program.solve().unwrap();
                        let found =
                            constrained(&record, &["u".to_owned()], &orders, presample, &criterion).unwrap();
                        let least = norm_of(&rows, &expected, criterion.norm);
                        let reached = norm_of(&rows, &found.parameters, criterion.norm);
                        assert!(
                            (reached - least).abs() < 1e-9 * (1.0 + least),
                            "{criterion:?} {reached} {least}"
                        );
                        assert!((found.outcome.objective - reached).abs() < 1e-9 * (1.0 + least));
                        // Within a1 = -0.6..0 to the bit.
                        for bound in &criterion.bounds {
                            let index =
                                orders.names().iter().position(|name| *name == bound.parameter).unwrap();
                            assert!((bound.low..=bound.high).contains(&found.parameters[index]));
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn bounds_that_do_not_hold_back_leave_least_squares() {
    let mut noise = Noise(2);
    let (y, u) = data(300, &mut noise, 0.2, even);
    let record = Record::new(&y, vec![&u]).unwrap();
    let free = arx(&record, &orders(2, 2), Initial::Drop).unwrap();
    let loose = criterion(Norm::Two, &["a1=-3..3", "b2=-9.."], &[]);
    for criterion in [Criterion::default(), loose] {
        let found = fit(&y, &u, &orders(2, 2), &criterion).unwrap();
        for (found, free) in found.parameters.iter().zip(free.parameters()) {
            assert!((found - free).abs() < 1e-12);
        }
        assert!(found.outcome.active.is_empty());
    }
}

#[test]
fn where_bounds_hold_back_the_conditions_of_optimality_hold() {
    let mut noise = Noise(3);
    let (y, u) = data(400, &mut noise, 0.2, even);
    let orders = orders(2, 2);
    let record = Record::new(&y, vec![&u]).unwrap();
    let rows = table(&record, &orders, Presample::Drop);
    let [_, bounded, ..] = criteria(Norm::Two);
    let found = fit(&y, &u, &orders, &bounded).unwrap();
    assert_eq!(found.parameters[0], -0.6);
    assert!(found.outcome.active.iter().any(|words| words.contains("a1")), "{:?}", found.outcome.active);
    let e = errors(&rows, &found.parameters);
    let slope = |index: usize| rows.iter().zip(&e).map(|((phi, _), e)| phi[index] * e).sum::<f64>();
    let size = e.iter().map(|e| e * e).sum::<f64>();
    // A smaller a1 would lower the cost; what is free has no slope.
    assert!(slope(0) < 0.0);
    for index in 1..4 {
        let held = found.outcome.active.iter().any(|words| words.contains(&orders.names()[index]));
        assert!(held || slope(index).abs() < 1e-9 * size, "{index} {}", slope(index));
    }
}

#[test]
fn a_static_gain_is_what_was_asked_for() {
    let mut noise = Noise(4);
    let (y, u) = data(200, &mut noise, 0.3, wild);
    for norm in ALL {
        let [_, _, equal, range] = criteria(norm);
        let gain = |criterion: &Criterion| {
            let p = fit(&y, &u, &orders(2, 2), criterion).unwrap().parameters;
            (p[2] + p[3]) / (1.0 + p[0] + p[1])
        };
        assert!((gain(&equal) - 2.5).abs() < 1e-9, "{norm}");
        assert!((3.0 - 1e-9..=3.2 + 1e-9).contains(&gain(&range)), "{norm}");
    }
}

#[test]
fn the_box_of_a_noise_bound_is_that_of_the_vertices() {
    let mut noise = Noise(5);
    for length in [6, 12, 25] {
        let (y, u) = data(length, &mut noise, 0.2, even);
        let record = Record::new(&y, vec![&u]).unwrap();
        let rows = table(&record, &orders(1, 1), Presample::Drop);
        let least = fit(&y, &u, &orders(1, 1), &Criterion { norm: Norm::Infinity, ..Criterion::default() });
        let bound = 1.3 * least.unwrap().outcome.objective;
        let criterion = Criterion { noise_bound: Some(bound), ..Criterion::default() };
        let found = fit(&y, &u, &orders(1, 1), &criterion).unwrap();
        let ends = found.outcome.box_.unwrap();
        for (found, expected) in ends.iter().zip(box_of_vertices(&rows, bound)) {
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() < 1e-7 * (1.0 + expected.abs()), "{found} {expected}");
            }
        }
        assert!(norm_of(&rows, &found.parameters, Norm::Infinity) <= bound * (1.0 + 1e-9));
        assert!(found.covariance.is_none());
        // And by linear programs: the least and the largest of each parameter.
        for index in 0..2 {
            for (sign, end) in [(1.0, ends[index][0]), (-1.0, ends[index][1])] {
                let mut costs = [0.0; 2];
                costs[index] = sign;
                let mut program = Reference::new(&costs, &criterion, &orders(1, 1));
                program.bound(&rows, bound);
                assert!((program.solve().unwrap()[index] - end).abs() < 1e-7);
            }
        }
    }
}
