//! Robust estimates against conditions of optimality, exact solutions, outliers and simulation.

use std::ops::ControlFlow;

use thetahat_numerics::noise::Noise;

use super::*;
use crate::estimate::{ConvexFit, Method, Norm, estimate};

fn fitted(record: &Record<'_>, orders: &Orders, loss: Loss) -> (Estimate, RobustOutcome) {
    let method = Method::Robust(Robust {
        loss,
        search: Search { tolerance: 1e-12, max_iterations: 1000, ..Search::default() },
    });
    let found = estimate(record, orders, &method, Initial::Auto).unwrap();
    let outcome = match found.procedure() {
        Procedure::Robust(outcome) => Some(outcome.clone()),
        _ => None,
    };
    (found, outcome.expect("a robust procedure"))
}

/// y of B/F u + C/D e over A, of one input, from rest.
struct Plant<'a> {
    a: &'a [f64],
    b: &'a [f64],
    c: &'a [f64],
    d: &'a [f64],
    f: &'a [f64],
}

impl Plant<'_> {
    fn run(&self, u: &[f64], e: &[f64]) -> Vec<f64> {
        let filtered = |above: &[f64], below: &[f64], x: &[f64]| {
            let mut y = vec![0.0; x.len()];
            thetahat_numerics::regression::add_filtered(&mut y, &(0..x.len()), above, x, 0);
            thetahat_numerics::regression::divide(below, &mut y);
            y
        };
        let (driven, noise) = (filtered(self.b, self.f, u), filtered(self.c, self.d, e));
        let mut y: Vec<f64> = driven.iter().zip(noise).map(|(x, v)| x + v).collect();
        thetahat_numerics::regression::divide(self.a, &mut y);
        y
    }
}

const ONE: &[f64] = &[1.0];

/// Normal errors, of which some are wild.
fn wild(noise: &mut Noise, count: usize, part: f64) -> Vec<f64> {
    (0..count)
        .map(|_| {
            let size = if noise.uniform() < 2.0 * part - 1.0 { 20.0 } else { 0.2 };
            size * noise.normal()
        })
        .collect()
}

#[test]
fn of_arx_the_gradient_of_the_loss_is_zero_and_the_scale_is_that_of_least_absolute_errors() {
    let mut noise = Noise(5);
    let (u, e) = (noise.take(400), wild(&mut noise, 400, 0.05));
    let y = Plant { a: &[1.0, -0.7], b: &[0.0, 1.0], c: ONE, d: ONE, f: ONE }.run(&u, &e);
    let record = Record::new(&y, vec![&u]).unwrap();
    let orders = Orders::arx(1, &[1], &[1]).unwrap();
    let (huber, outcome) = fitted(&record, &orders, Loss::Huber { k: Loss::K });
    let p = huber.parameters();
    let error = |t: usize, p: &[f64]| y[t] + p[0] * y[t - 1] - p[1] * u[t - 1];
    let psi = |t: usize| error(t, p).clamp(-outcome.bound, outcome.bound);
    let gradient =
        [(1..400).map(|t| psi(t) * y[t - 1]).sum::<f64>(), (1..400).map(|t| psi(t) * u[t - 1]).sum::<f64>()];
    let size: f64 = (1..400).map(|t| (psi(t) * y[t - 1]).abs()).sum();
    assert!(gradient.iter().all(|entry| entry.abs() < 1e-5 * size), "{gradient:?} {size}");
    assert!((outcome.bound - 1.345 * outcome.scale).abs() < 1e-15 && outcome.k == Some(1.345));
    let rho = |e: f64| {
        if e.abs() <= outcome.bound { e * e / 2.0 } else { outcome.bound * (e.abs() - outcome.bound / 2.0) }
    };
    let objective = (1..400).map(|t| rho(error(t, p))).sum::<f64>() / 399.0;
    assert!((objective / outcome.objective - 1.0).abs() < 1e-9);
    let beyond = (1..400).filter(|t| error(*t, p).abs() > outcome.bound).count() as f64 / 399.0;
    assert!((beyond - outcome.beyond).abs() < 1e-12);
    // The costs fall.
    assert!(outcome.search.costs.windows(2).all(|pair| pair[1] < pair[0]));

    // Least absolute errors: those of the linear program, and their scale.
    let exact = Method::Constrained(ConvexFit { norm: Norm::One, ..ConvexFit::default() });
    let exact = estimate(&record, &orders, &exact, Initial::Auto).unwrap();
    let (smoothed, found) = fitted(&record, &orders, Loss::Absolute);
    let sum = |p: &[f64]| (1..400).map(|t| error(t, p).abs()).sum::<f64>();
    assert!((sum(smoothed.parameters()) / sum(exact.parameters()) - 1.0).abs() < 1e-9);
    assert!((sum(smoothed.parameters()) / 399.0 / found.objective - 1.0).abs() < 1e-9);
    let mut errors: Vec<f64> = (1..400).map(|t| error(t, exact.parameters())).collect();
    errors.sort_by(f64::total_cmp);
    let centre = errors[199];
    let mut apart: Vec<f64> = errors.iter().map(|e| (e - centre).abs()).collect();
    apart.sort_by(f64::total_cmp);
    assert!(
        (outcome.scale / (apart[199] / 0.674_489_75) - 1.0).abs() < 0.01,
        "{} {}",
        outcome.scale,
        apart[199]
    );
    // Its standard errors are those of the convex criterion.
    for (one, other) in [(0, 0), (1, 1)]
        .map(|(i, j)| (smoothed.covariance().unwrap()[i][j], exact.covariance().unwrap()[i][j]))
    {
        assert!((one / other - 1.0).abs() < 0.1, "{one} {other}");
    }
}

#[test]
fn wild_samples_do_little_to_any_structure() {
    let cases: [(Plant<'_>, Orders, Vec<f64>); 3] = [
        (
            Plant { a: ONE, b: &[0.0, 0.5], c: ONE, d: ONE, f: &[1.0, -0.8] },
            Orders::oe(&[1], &[1], &[1]).unwrap(),
            vec![0.5, -0.8],
        ),
        (
            Plant { a: &[1.0, -0.8], b: &[0.0, 0.5], c: &[1.0, 0.4], d: ONE, f: ONE },
            Orders::armax(1, &[1], 1, &[1]).unwrap(),
            vec![-0.8, 0.5, 0.4],
        ),
        (
            Plant { a: ONE, b: &[0.0, 0.5], c: ONE, d: &[1.0, -0.6], f: &[1.0, -0.8] },
            Orders::bj(&[1], 0, 1, &[1], &[1]).unwrap(),
            vec![0.5, -0.6, -0.8],
        ),
    ];
    let mut noise = Noise(9);
    for (plant, orders, truth) in cases {
        let far = |found: &Estimate| {
            found
                .parameters()
                .iter()
                .zip(&truth)
                .map(|(found, truth)| (found - truth).powi(2))
                .sum::<f64>()
                .sqrt()
        };
        let (mut squares, mut huber, mut absolute) = (0.0, 0.0, 0.0);
        for _ in 0..8 {
            let (u, e) = (noise.take(600), wild(&mut noise, 600, 0.05));
            let y = plant.run(&u, &e);
            let record = Record::new(&y, vec![&u]).unwrap();
            squares += far(&estimate(&record, &orders, &Method::default(), Initial::Auto).unwrap());
            huber += far(&fitted(&record, &orders, Loss::Huber { k: Loss::K }).0);
            absolute += far(&fitted(&record, &orders, Loss::Absolute).0);
        }
        println!("{orders}: {squares} by squares, {huber} by Huber's loss, {absolute} by |e|");
        assert!(
            huber < 0.25 * squares && absolute < 0.25 * squares,
            "{orders}: {squares} {huber} {absolute}"
        );
    }
}

#[test]
fn standard_errors_are_those_of_repeated_runs() {
    let plant = Plant { a: ONE, b: &[0.0, 0.5], c: ONE, d: ONE, f: &[1.0, -0.8] };
    let orders = Orders::oe(&[1], &[1], &[1]).unwrap();
    let armax = Plant { a: &[1.0, -0.8], b: &[0.0, 0.5], c: &[1.0, 0.4], d: ONE, f: ONE };
    let with_c = Orders::armax(1, &[1], 1, &[1]).unwrap();
    let cases = [(&plant, &orders, vec![0.5, -0.8]), (&armax, &with_c, vec![-0.8, 0.5, 0.4])];
    let mut noise = Noise(21);
    for (plant, orders, truth) in cases {
        for loss in [Loss::Huber { k: Loss::K }, Loss::Absolute] {
            let runs = 40;
            let mut ratio = vec![0.0; truth.len()];
            for _ in 0..runs {
                let (u, e) = (noise.take(400), wild(&mut noise, 400, 0.05));
                let y = plant.run(&u, &e);
                let (found, _) = fitted(&Record::new(&y, vec![&u]).unwrap(), orders, loss);
                let covariance = found.covariance().unwrap();
                for (k, ratio) in ratio.iter_mut().enumerate() {
                    *ratio += (found.parameters()[k] - truth[k]).powi(2) / covariance[k][k] / f64::from(runs);
                }
            }
            println!("{orders} {loss:?}: {ratio:?}");
            // chi-square of 40 degrees over 40 has a deviation of 0.22.
            assert!(ratio.iter().all(|ratio| (0.4..2.0).contains(ratio)), "{orders} {loss:?}: {ratio:?}");
        }
    }
}

#[test]
fn where_nothing_is_wild_it_is_least_squares() {
    let mut noise = Noise(2);
    let (u, e) = (noise.take(300), noise.take(300));
    let y = Plant { a: ONE, b: &[0.0, 0.5], c: ONE, d: ONE, f: &[1.0, -0.8] }.run(&u, &e);
    let record = Record::new(&y, vec![&u]).unwrap();
    let orders = Orders::oe(&[1], &[1], &[1]).unwrap();
    // Uniform errors do not go beyond 1, ten scales are more.
    let (huber, outcome) = fitted(&record, &orders, Loss::Huber { k: 10.0 });
    assert_eq!(outcome.beyond, 0.0);
    let search = Search { tolerance: 1e-12, ..Search::default() };
    let squares = estimate(&record, &orders, &Method::PredictionError(search), huber.initial()).unwrap();
    for (one, other) in huber.parameters().iter().zip(squares.parameters()) {
        assert!((one - other).abs() < 1e-6, "{one} {other}");
    }
    for (one, other) in
        huber.covariance().unwrap().iter().flatten().zip(squares.covariance().unwrap().iter().flatten())
    {
        assert!((one / other - 1.0).abs() < 1e-3, "{one} {other}");
    }
    // An exact fit stays one.
    let y = Plant { a: ONE, b: &[0.0, 0.5], c: ONE, d: ONE, f: &[1.0, -0.8] }.run(&u, &[0.0; 300]);
    let (exact, _) = fitted(&Record::new(&y, vec![&u]).unwrap(), &orders, Loss::Absolute);
    assert!((exact.parameters()[1] + 0.8).abs() < 1e-9);
}

#[test]
fn what_makes_no_sense_is_refused_and_whoever_watches_may_end_it() {
    let mut noise = Noise(2);
    let (u, y) = (noise.take(100), noise.take(100));
    let record = Record::new(&y, vec![&u]).unwrap();
    let orders = Orders::oe(&[1], &[1], &[1]).unwrap();
    for k in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let how = Robust { loss: Loss::Huber { k }, search: Search::default() };
        let error = estimate(&record, &orders, &Method::Robust(how), Initial::Auto).unwrap_err();
        assert!(matches!(&error, Error::Argument { argument, .. } if argument == "norm"), "{error}");
    }
    let how = Robust { loss: Loss::Absolute, search: Search::default() };
    let ended = robust(&record, &orders, Initial::Auto, &how, &|_| ControlFlow::Break(()));
    assert_eq!(ended, Err(Error::Interrupted));
}
