//! Searches against one another, and what they say when something is wrong.

use thetahat_numerics::noise::Noise;
use thetahat_numerics::optimize::{Algorithm, Step};

use super::*;
use crate::estimate::Procedure;
use crate::tests::filtered;

/// A Box-Jenkins plant: its input and its output.
fn box_jenkins(length: usize, noise: &mut Noise) -> (Vec<f64>, Vec<f64>) {
    let (u, e) = (noise.take(length), noise.take(length));
    let x = filtered(&[0.0, 1.0, 0.5], &[1.0, -1.5, 0.7], &u);
    let v = filtered(&[1.0, 0.5], &[1.0, -0.8], &e);
    let y = x.iter().zip(&v).map(|(x, v)| x + 0.3 * v).collect();
    (u, y)
}

fn found(record: &Record<'_>, orders: &Orders, initial: Initial, search: &Search) -> Result<Estimate, Error> {
    prediction_error(record, orders, initial, search, &|_| std::ops::ControlFlow::Continue(()))
}

fn outcome(estimate: &Estimate) -> &SearchOutcome {
    match estimate.procedure() {
        Procedure::PredictionError(outcome) => outcome,
        other => panic!("{other:?}"),
    }
}

#[test]
fn all_algorithms_reach_the_same_minimum() {
    let mut noise = Noise(1);
    let (u, y) = box_jenkins(1000, &mut noise);
    let record = Record::new(&y, vec![&u]).unwrap();
    for orders in [
        Orders::armax(2, &[2], 2, &[1]).unwrap(),
        Orders::oe(&[2], &[2], &[1]).unwrap(),
        Orders::bj(&[2], 1, 1, &[2], &[1]).unwrap(),
        Orders::new(1, &[2], 1, 1, &[1], &[1]).unwrap(),
    ] {
        let tight = Search { tolerance: 1e-13, ..Search::default() };
        let best = found(&record, &orders, Initial::Auto, &tight).unwrap();
        assert_eq!(outcome(&best).stopped, Stopped::Converged);
        assert!(outcome(&best).gradient_norm < 1e-5);
        assert!(outcome(&best).costs.windows(2).all(|pair| pair[1] < pair[0]));
        for algorithm in [Algorithm::GaussNewton, Algorithm::Newton, Algorithm::Gradient] {
            let slow = algorithm == Algorithm::Gradient;
            let search = Search {
                algorithm,
                max_iterations: 3000,
                tolerance: if slow { 1e-9 } else { 1e-13 },
                step: Step { c1: 1.0, c2: None },
                ..Search::default()
            };
            let other = found(&record, &orders, Initial::Auto, &search).unwrap();
            let excess = other.mse() / best.mse() - 1.0;
            assert!(excess.abs() < 1e-8, "{algorithm:?} {:?} {excess:e}", orders.structure());
        }
    }
}

#[test]
fn a_falling_step_of_steepest_descent_is_c1_over_c2_and_the_iteration() {
    let mut noise = Noise(2);
    let (u, y) = box_jenkins(500, &mut noise);
    let record = Record::new(&y, vec![&u]).unwrap();
    let orders = Orders::oe(&[2], &[2], &[1]).unwrap();
    let step = Step { c1: 2.0, c2: Some(4.0) };
    let search = Search { algorithm: Algorithm::Gradient, max_iterations: 5, step, ..Search::default() };
    let estimate = found(&record, &orders, Initial::Zero, &search).unwrap();
    assert_eq!(outcome(&estimate).step, Some(step));
    assert!(outcome(&estimate).iterations <= 5);
}

#[test]
fn without_time_one_start_is_looked_for_and_none_searched_from_further() {
    let (u, y) = box_jenkins(500, &mut Noise(3));
    let record = Record::new(&y, vec![&u]).unwrap();
    for starts in [0, 20] {
        let plenty = Search { starts, ..Search::default() };
        let none = Search { time_limit: Some(std::time::Duration::ZERO), ..plenty.clone() };
        for (orders, recipes) in [
            (Orders::bj(&[2], 1, 1, &[2], &[1]).unwrap(), 4),
            (Orders::oe(&[2], &[2], &[1]).unwrap(), 2),
            (Orders { na: 1, nb: vec![2], nc: 1, nd: 1, nf: vec![1], nk: vec![1] }, 4),
            (Orders { na: 2, nb: vec![2], nc: 0, nd: 1, nf: vec![0], nk: vec![1] }, 2),
        ] {
            let estimate = found(&record, &orders, Initial::Zero, &plenty).unwrap();
            assert!(outcome(&estimate).starts.len() >= recipes.max(starts), "{orders}");
            let estimate = found(&record, &orders, Initial::Zero, &none).unwrap();
            let outcome = outcome(&estimate);
            assert_eq!((outcome.starts.len(), outcome.iterations), (1, 0), "{orders}");
            assert_eq!(outcome.stopped, Stopped::TimeLimit, "{orders}");
        }
    }
}

#[test]
fn the_report_says_why_a_search_stopped() {
    let mut noise = Noise(3);
    let (u, y) = box_jenkins(500, &mut noise);
    let record = Record::new(&y, vec![&u]).unwrap();
    let orders = Orders::bj(&[2], 1, 1, &[2], &[1]).unwrap();
    let none = Search { max_iterations: 0, tolerance: 1e-14, ..Search::default() };
    let estimate = found(&record, &orders, Initial::Zero, &none).unwrap();
    assert_eq!((outcome(&estimate).stopped, outcome(&estimate).iterations), (Stopped::MaxIterations, 0));
    let no_time =
        Search { time_limit: Some(std::time::Duration::ZERO), tolerance: 1e-14, ..Search::default() };
    let estimate = found(&record, &orders, Initial::Zero, &no_time).unwrap();
    assert_eq!(outcome(&estimate).stopped, Stopped::TimeLimit);
    let stop = |_| std::ops::ControlFlow::Break(());
    let interrupted = prediction_error(&record, &orders, Initial::Auto, &Search::default(), &stop);
    assert_eq!(interrupted.unwrap_err(), Error::Interrupted);
}

#[test]
fn more_starts_never_end_at_a_higher_cost_and_the_same_seed_gives_the_same_bits() {
    let mut noise = Noise(4);
    let (u, y) = box_jenkins(400, &mut noise);
    let record = Record::new(&y, vec![&u]).unwrap();
    let orders = Orders::bj(&[3], 2, 2, &[3], &[1]).unwrap();
    let one = found(&record, &orders, Initial::Estimate, &Search::default()).unwrap();
    let several = Search { starts: 12, seed: 5, ..Search::default() };
    let many = found(&record, &orders, Initial::Estimate, &several).unwrap();
    assert!(many.mse() <= one.mse() * (1.0 + 1e-7));
    assert!(outcome(&many).starts.len() >= 13);
    assert_eq!(many, found(&record, &orders, Initial::Estimate, &several).unwrap());
}

#[test]
fn initial_conditions_are_estimated_where_they_are_worth_it() {
    let mut noise = Noise(5);
    let u = noise.take(1500);
    // Slow, so that the start is seen for long.
    let x = filtered(&[0.0, 0.02], &[1.0, -1.98, 0.9801], &u);
    let y: Vec<f64> = x.iter().map(|x| x + 0.05 * noise.uniform()).collect();
    let orders = Orders::oe(&[1], &[2], &[1]).unwrap();
    let fit = |from: usize, initial| {
        let record = Record::new(&y[from..], vec![&u[from..]]).unwrap();
        found(&record, &orders, initial, &Search::default()).unwrap()
    };
    assert_eq!(fit(0, Initial::Auto).initial(), Initial::Zero);
    assert_eq!(fit(0, Initial::Auto).mse(), fit(0, Initial::Zero).mse());
    let moving = fit(700, Initial::Auto);
    assert_eq!((moving.initial(), outcome(&moving).initial_conditions), (Initial::Estimate, 2));
    assert!((moving.mse() / fit(700, Initial::Estimate).mse() - 1.0).abs() < 1e-7);
    assert!(fit(700, Initial::Zero).mse() > 2.0 * moving.mse());
    let record = Record::new(&y, vec![&u]).unwrap();
    assert!(found(&record, &orders, Initial::Drop, &Search::default()).is_err());
}

#[test]
fn segments_of_one_experiment_give_the_model_of_the_whole() {
    let mut noise = Noise(6);
    let (u, y) = box_jenkins(4000, &mut noise);
    let record = Record::new(&y, vec![&u]).unwrap();
    let mut cut = record.clone();
    cut.segments = vec![0..1000, 1001..1004, 1010..2500, 2510..4000];
    cut.past = vec![0; 4];
    for orders in [Orders::armax(2, &[2], 1, &[1]).unwrap(), Orders::bj(&[2], 1, 1, &[2], &[1]).unwrap()] {
        let whole = found(&record, &orders, Initial::Auto, &Search::default()).unwrap();
        let parts = found(&cut, &orders, Initial::Auto, &Search::default()).unwrap();
        let covariance = whole.covariance().unwrap();
        for (index, (a, b)) in whole.parameters().iter().zip(parts.parameters()).enumerate() {
            assert!((a - b).abs() < 0.5 * covariance[index][index].sqrt(), "{a} {b}");
        }
    }
}

#[test]
fn units_change_nothing_but_the_gain() {
    let mut noise = Noise(7);
    let (u, y) = box_jenkins(800, &mut noise);
    let orders = Orders::bj(&[2], 1, 1, &[2], &[1]).unwrap();
    let tight = Search { tolerance: 1e-13, ..Search::default() };
    let fit = |y_size: f64, u_size: f64| {
        let (y, u): (Vec<f64>, Vec<f64>) =
            (y.iter().map(|y| y * y_size).collect(), u.iter().map(|u| u * u_size).collect());
        found(&Record::new(&y, vec![&u]).unwrap(), &orders, Initial::Auto, &tight)
    };
    let unit = fit(1.0, 1.0).unwrap();
    for (y_size, u_size) in [(1e30, 1.0), (1.0, 1e-30), (1e-60, 1e60), (1e100, 1e100)] {
        let scaled = fit(y_size, u_size).unwrap();
        for (index, (a, b)) in unit.parameters().iter().zip(scaled.parameters()).enumerate() {
            let b = if index < 2 { b * u_size / y_size } else { *b };
            assert!((a - b).abs() < 1e-5 * a.abs(), "{index}: {a} {b}, {y_size} {u_size}");
        }
    }
    for size in [1e200, 1e-200, 1e300] {
        assert!(fit(size, 1.0).is_err(), "{size}");
        let _ = fit(1.0, size);
    }
}

#[test]
fn what_cannot_be_estimated_is_refused_in_words() {
    let mut noise = Noise(8);
    let (u, y) = box_jenkins(300, &mut noise);
    let zero = vec![0.0; 300];
    let orders = [
        Orders::armax(2, &[2], 2, &[1]).unwrap(),
        Orders::oe(&[2], &[2], &[1]).unwrap(),
        Orders::bj(&[2], 2, 2, &[2], &[1]).unwrap(),
    ];
    for orders in &orders {
        let other = if orders.has_f() { Initial::Estimate } else { Initial::Drop };
        let of_others = if orders.has_f() { Initial::Drop } else { Initial::Estimate };
        let whole = Record::new(&y, vec![&u]).unwrap();
        let refused = found(&whole, orders, of_others, &Search::default()).unwrap_err();
        assert!(matches!(refused, Error::Argument { argument, .. } if argument == "initial"));
        for initial in [Initial::Zero, other, Initial::Auto] {
            let fit = |y: &[f64], u: &[f64]| {
                let record = Record::new(y, vec![u]).unwrap();
                found(&record, orders, initial, &Search::default())
            };
            for length in [1, 2, 3, 4] {
                let refused = fit(&y[..length], &u[..length]).unwrap_err();
                assert!(matches!(refused, Error::Undetermined { .. }), "{length}: {refused}");
            }
            for (y, u) in [(&zero, &u), (&y, &zero), (&zero, &zero)] {
                assert!(fit(y, u).is_err());
            }
            let none = Record::new(&y, vec![]).unwrap();
            assert!(matches!(found(&none, orders, initial, &Search::default()), Err(Error::Argument { .. })));
        }
    }
    let record = Record::new(&y, vec![&u]).unwrap();
    for search in [
        Search { tolerance: 0.0, ..Search::default() },
        Search { tolerance: f64::NAN, ..Search::default() },
        Search { step: Step { c1: -1.0, c2: None }, ..Search::default() },
        Search { initial_parameters: Some(vec![1.0]), ..Search::default() },
    ] {
        let refused = found(&record, &orders[0], Initial::Auto, &search).unwrap_err();
        assert!(matches!(refused, Error::Argument { .. }), "{refused}");
    }
}

/// Products with a power of two are exact, so nothing that is compared or solved may depend on it.
#[test]
fn a_power_of_two_changes_no_bit() {
    let (u, y) = public("gas_furnace.csv");
    let other = Noise(3).take(u.len());
    for (orders, inputs) in [
        (Orders::armax(3, &[3], 3, &[1]).unwrap(), 1),
        (Orders::oe(&[2], &[2], &[1]).unwrap(), 1),
        (Orders::oe(&[4], &[4], &[1]).unwrap(), 1),
        (Orders::bj(&[3], 0, 2, &[3], &[1]).unwrap(), 1),
        (Orders::oe(&[2, 2], &[2, 2], &[1, 1]).unwrap(), 2),
    ] {
        let fit = |u_size: f64, y_size: f64| {
            let sized = |values: &[f64], size| values.iter().map(|value| value * size).collect::<Vec<f64>>();
            let (u, y) = (sized(&u, u_size), sized(&y, y_size));
            let record = Record::new(&y, [&u[..], &other].into_iter().take(inputs).collect()).unwrap();
            let estimate = found(&record, &orders, Initial::Auto, &Search::default()).unwrap();
            (estimate.mse() / y_size / y_size, outcome(&estimate).costs.len())
        };
        let unit = fit(1.0, 1.0);
        for (u_size, y_size) in [(1024.0, 1.0), (1.0, 1024.0), (0.25, 1024.0)] {
            assert_eq!(fit(u_size, y_size), unit, "{orders} {u_size} {y_size}");
        }
    }
}

/// The least costs of many random starts, and of searches in several coordinates.
#[test]
fn the_least_known_costs_are_reached() {
    for (file, orders, initial, least) in [
        ("hair_dryer.csv", Orders::oe(&[5], &[5], &[1]), Initial::Zero, 0.0074508),
        ("hair_dryer.csv", Orders::oe(&[6], &[6], &[1]), Initial::Estimate, 0.0048741),
        ("robot_arm.csv", Orders::armax(3, &[3], 3, &[1]), Initial::Auto, 5.9027e-6),
        ("robot_arm.csv", Orders::armax(5, &[5], 5, &[1]), Initial::Auto, 1.5316e-7),
    ] {
        let (u, y) = public(file);
        let record = Record::new(&y, vec![&u]).unwrap();
        let mse = found(&record, &orders.unwrap(), initial, &Search::default()).unwrap().mse();
        assert!((mse / least - 1.0).abs() < 1e-3, "{file} {mse} {least}");
    }
}

/// A log of tests/data/public without its mean: input and output.
fn public(file: &str) -> (Vec<f64>, Vec<f64>) {
    let path = format!("{}/../../tests/data/public/{file}", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).unwrap();
    let rows = text.lines().skip(1).map(|line| line.split_once(',').unwrap());
    let (u, y): (Vec<f64>, Vec<f64>) =
        rows.map(|(u, y)| (u.parse::<f64>().unwrap(), y.parse::<f64>().unwrap())).unzip();
    let centred = |values: Vec<f64>| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.iter().map(|value| value - mean).collect()
    };
    (centred(u), centred(y))
}

/// Plants of a log are not in the model set, and costs have many minima.
#[test]
fn a_larger_model_does_not_fit_a_log_worse_than_a_nested_one() {
    let noises = [(0, 0), (0, 1), (1, 1), (0, 2)];
    for file in ["gas_furnace.csv", "hair_dryer.csv"] {
        let (u, y) = public(file);
        let record = Record::new(&y, vec![&u]).unwrap();
        let mut fitted: Vec<([usize; 4], f64)> = Vec::new();
        for (nb, nf) in [(1, 1), (2, 1), (1, 2), (2, 2), (3, 1), (3, 2)] {
            for (nc, nd) in noises {
                let orders = Orders::bj(&[nb], nc, nd, &[nf], &[3]).unwrap();
                let own = found(&record, &orders, Initial::Zero, &Search::default()).unwrap().mse();
                fitted.push(([nb, nf, nc, nd], own));
            }
        }
        for (orders, mse) in &fitted {
            for (smaller, least) in &fitted {
                let nested = smaller.iter().zip(orders).all(|(smaller, order)| smaller <= order);
                assert!(!nested || *mse <= least * 1.001, "{file} {orders:?} {mse} {smaller:?} {least}");
            }
        }
    }
}

#[test]
fn a_larger_armax_model_does_not_fit_a_log_worse_than_a_nested_one() {
    for (file, nk, smaller, larger) in
        [("robot_arm.csv", 1, (3, 2, 3), (3, 3, 3)), ("gas_furnace.csv", 3, (2, 3, 4), (3, 3, 4))]
    {
        let (u, y) = public(file);
        let record = Record::new(&y, vec![&u]).unwrap();
        let [small, large] = [smaller, larger].map(|(na, nb, nc)| {
            let orders = Orders::armax(na, &[nb], nc, &[nk]).unwrap();
            found(&record, &orders, Initial::Zero, &Search::default()).unwrap()
        });
        assert!(large.mse() <= 1.001 * small.mse(), "{file}: {} {}", large.mse(), small.mse());
    }
}

/// Of a long record one start is enough where it leaves white errors; where it does not, all are compared.
#[test]
fn white_errors_of_a_long_record_end_the_comparison_of_starts() {
    let mut noise = Noise(4);
    let (u, e) = (noise.take(6000), noise.take(6000));
    let a = [1.0, -1.5, 0.7];
    let x = filtered(&[0.0, 1.0, 0.5], &a, &u);
    let v = filtered(&[1.0, -1.0, 0.2], &a, &e);
    let y: Vec<f64> = x.iter().zip(&v).map(|(x, v)| x + v).collect();
    let record = Record::new(&y, vec![&u]).unwrap();
    let follow = |orders: Orders| {
        let estimate = found(&record, &orders, Initial::Zero, &Search::default()).unwrap();
        let starts = &outcome(&estimate).starts;
        (starts.iter().filter(|start| start.reached.is_some()).count(), estimate.mse())
    };
    let (one, mse) = follow(Orders::armax(2, &[2], 2, &[1]).unwrap());
    assert_eq!(one, 1);
    let several = Search { starts: 8, ..Search::default() };
    let orders = Orders::armax(2, &[2], 2, &[1]).unwrap();
    let least = found(&record, &orders, Initial::Zero, &several).unwrap().mse();
    assert!((mse / least - 1.0).abs() < 1e-6, "{mse} {least}");
    assert!(follow(Orders::armax(1, &[2], 2, &[1]).unwrap()).0 > 1);
}

/// The plant's pole is on the unit circle: a search comes to the boundary, and goes on along it.
#[test]
fn a_search_goes_on_along_the_boundary_of_stability() {
    let mut noise = Noise(11);
    let (u, e) = (noise.take(600), noise.take(600));
    let x = filtered(&[0.0, 1.0, 0.5], &[1.0, -1.6, 0.6], &u);
    let y: Vec<f64> = x.iter().zip(&e).map(|(x, e)| x + 2.0 * e).collect();
    let record = Record::new(&y, vec![&u]).unwrap();
    let orders = Orders::oe(&[2], &[2], &[1]).unwrap();
    // Far from the plant in all parameters, with a pole from which the steps lead out of the circle.
    let search = Search { initial_parameters: Some(vec![0.5, 0.0, -1.2, 0.25]), ..Search::default() };
    let estimate = found(&record, &orders, Initial::Zero, &search).unwrap();
    let [b1, b2, f1, f2] = estimate.parameters() else { panic!("four parameters") };
    assert!((b1 - 1.0).abs() < 0.1 && (b2 - 0.5).abs() < 0.2, "{b1} {b2}");
    assert!((f1 + 1.6).abs() < 0.01 && (f2 - 0.6).abs() < 0.01, "{f1} {f2}");
    assert!(estimate.mse() < 4.5);
}
