//! The least largest error against steps in all directions, least squares under bounded noise, and refusals.

use std::ops::ControlFlow;

use thetahat_numerics::noise::Noise;
use thetahat_numerics::regression::{add_filtered, divide};

use super::*;
use crate::estimate::{Bound, Method, estimate};

fn search() -> Search {
    Search { tolerance: 1e-10, max_iterations: 500, ..Search::default() }
}

fn fitted(record: &Record<'_>, orders: &Orders, initial: Initial) -> (Estimate, ConvexOutcome) {
    let method =
        Method::Constrained(ConvexFit { norm: Norm::Infinity, search: search(), ..ConvexFit::default() });
    let found = estimate(record, orders, &method, initial).unwrap();
    let outcome = match found.procedure() {
        Procedure::Constrained(outcome) => Some(outcome.clone()),
        _ => None,
    };
    (found, outcome.expect("a convex procedure"))
}

/// x B/F of a signal from rest.
fn filtered(above: &[f64], below: &[f64], x: &[f64]) -> Vec<f64> {
    let mut y = vec![0.0; x.len()];
    add_filtered(&mut y, &(0..x.len()), above, x, 0);
    divide(below, &mut y);
    y
}

/// e = D/C (A y - B/F u) of a model of one input, from rest.
fn errors(orders: &Orders, theta: &[f64], u: &[f64], y: &[f64]) -> Vec<f64> {
    let mut rest = theta;
    let mut monic = |count: usize| {
        let (own, others) = rest.split_at(count);
        rest = others;
        [&[1.0], own].concat()
    };
    let a = monic(orders.na);
    let mut b = monic(orders.nb[0]);
    b.remove(0);
    let b = [vec![0.0; orders.nk[0]], b].concat();
    let (c, d) = (monic(orders.nc), monic(orders.nd));
    let f = monic(orders.nf[0]);
    let one = [1.0];
    let plant = filtered(&b, &f, u);
    let w: Vec<f64> = filtered(&a, &one, y).iter().zip(plant).map(|(y, x)| y - x).collect();
    filtered(&d, &c, &w)
}

#[test]
fn no_small_step_in_any_direction_lowers_the_largest_error() {
    let mut noise = Noise(11);
    let cases = [
        Orders::oe(&[1], &[1], &[1]).unwrap(),
        Orders::oe(&[2], &[2], &[1]).unwrap(),
        Orders::bj(&[1], 1, 1, &[1], &[1]).unwrap(),
        Orders::new(1, &[1], 1, 0, &[1], &[1]).unwrap(),
    ];
    for orders in cases {
        let (u, e) = (noise.take(300), noise.take(300));
        let x = filtered(&[0.0, 1.0, 0.5], &[1.0, -1.2, 0.45], &u);
        let y: Vec<f64> = x.iter().zip(filtered(&[1.0, 0.3], &[1.0, -0.5], &e)).map(|(x, v)| x + v).collect();
        let record = Record::new(&y, vec![&u]).unwrap();
        let (found, outcome) = fitted(&record, &orders, Initial::Zero);
        let size = |theta: &[f64]| peak(&errors(&orders, theta, &u, &y));
        let least = size(found.parameters());
        assert!((least / outcome.objective - 1.0).abs() < 1e-9, "{orders}: {least} {}", outcome.objective);
        let search = outcome.search.unwrap();
        assert_eq!(search.stopped, Stopped::Converged, "{orders}");
        assert!(search.costs.windows(2).all(|pair| pair[1] < pair[0]), "{orders}");
        // It starts from least squares, and ends below.
        let squares =
            estimate(&record, &orders, &Method::PredictionError(self::search()), Initial::Zero).unwrap();
        assert!((search.costs[0] / size(squares.parameters()) - 1.0).abs() < 1e-6);
        assert!(least < 0.99 * search.costs[0], "{orders}: {least} {}", search.costs[0]);
        for size_of_step in [1e-2, 1e-3, 1e-4, 1e-5] {
            for _ in 0..200 {
                let step = |theta: &f64| theta + size_of_step * (2.0 * noise.uniform() - 1.0);
                let near: Vec<f64> = found.parameters().iter().map(step).collect();
                assert!(size(&near) > least * (1.0 - 1e-7), "{orders}: {} {least}", size(&near));
            }
        }
    }
}

#[test]
fn errors_of_known_bound_are_used_better_than_by_least_squares() {
    let mut noise = Noise(3);
    let orders = Orders::oe(&[1], &[1], &[1]).unwrap();
    let (mut squares, mut largest) = (0.0, 0.0);
    for _ in 0..10 {
        let (u, e) = (noise.take(1000), noise.take(1000));
        let bounded: Vec<f64> = e.iter().map(|e| e.clamp(-1.0, 1.0)).collect();
        let x = filtered(&[0.0, 0.5], &[1.0, -0.8], &u);
        let y: Vec<f64> = x.iter().zip(bounded).map(|(x, e)| x + 0.2 * e).collect();
        let record = Record::new(&y, vec![&u]).unwrap();
        let far = |found: &Estimate| (found.parameters()[1] + 0.8).powi(2);
        squares += far(&estimate(&record, &orders, &Method::default(), Initial::Zero).unwrap());
        largest += far(&fitted(&record, &orders, Initial::Zero).0);
    }
    assert!(largest < 0.2 * squares, "{largest} {squares}");
}

#[test]
fn initial_conditions_of_each_segment_are_unknowns_too() {
    let mut noise = Noise(7);
    let (u, e) = (noise.take(400), noise.take(400));
    let x = filtered(&[0.0, 0.5], &[1.0, -0.95], &u);
    let y: Vec<f64> = x.iter().zip(&e).map(|(x, e)| x + 0.05 * e).collect();
    let orders = Orders::oe(&[1], &[1], &[1]).unwrap();
    let record =
        Record { segments: vec![50..200, 230..400], past: vec![0, 0], ..Record::new(&y, vec![&u]).unwrap() };
    let (found, outcome) = fitted(&record, &orders, Initial::Estimate);
    let search = outcome.search.unwrap();
    assert_eq!((search.initial_conditions, search.stopped), (2, Stopped::Converged));
    assert!((found.parameters()[1] + 0.95).abs() < 0.01);
    // From rest each segment would begin with errors as large as the plant's state.
    assert!(outcome.objective < 0.06, "{}", outcome.objective);
}

#[test]
fn exact_fits_stay_exact() {
    let mut noise = Noise(5);
    let u = noise.take(200);
    let y = filtered(&[0.0, 0.5], &[1.0, -0.8], &u);
    let record = Record::new(&y, vec![&u]).unwrap();
    let (found, outcome) = fitted(&record, &Orders::oe(&[1], &[1], &[1]).unwrap(), Initial::Zero);
    assert!((found.parameters()[1] + 0.8).abs() < 1e-9);
    assert!(outcome.objective < 1e-9);
}

#[test]
fn what_is_for_linear_models_is_refused_and_whoever_watches_may_end_it() {
    let mut noise = Noise(2);
    let (u, y) = (noise.take(100), noise.take(100));
    let record = Record::new(&y, vec![&u]).unwrap();
    let orders = Orders::oe(&[1], &[1], &[1]).unwrap();
    let bound = Bound { parameter: "b1".to_owned(), low: 0.0, high: 1.0 };
    let infinity = ConvexFit { norm: Norm::Infinity, ..ConvexFit::default() };
    let refused = [
        ConvexFit { norm: Norm::One, ..ConvexFit::default() },
        ConvexFit { bounds: vec![bound], ..infinity.clone() },
        ConvexFit { ridge: 1.0, ..infinity.clone() },
        ConvexFit { noise_bound: Some(1.0), ..infinity.clone() },
    ];
    for criterion in refused {
        let error = estimate(&record, &orders, &Method::Constrained(criterion), Initial::Auto).unwrap_err();
        assert!(matches!(&error, Error::Argument { .. }), "{error}");
    }
    let ended = minimax(&record, &orders, Initial::Auto, &infinity, &|_| ControlFlow::Break(()));
    assert_eq!(ended, Err(Error::Interrupted));
    let search = Search { max_iterations: 0, ..Search::default() };
    let still = ConvexFit { search, ..infinity };
    let still = estimate(&record, &orders, &Method::Constrained(still), Initial::Zero).unwrap();
    let Procedure::Constrained(outcome) = still.procedure() else { return };
    assert_eq!(outcome.search.as_ref().map(|search| search.stopped), Some(Stopped::MaxIterations));
}
