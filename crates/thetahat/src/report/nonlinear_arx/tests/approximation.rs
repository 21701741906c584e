//! Universal approximation: every kind of map comes as near to a function as it has parameters for.

use super::*;
use crate::model::Membership;

/// The function: a bend, a wave and a slope over -1 … 1.
fn g(u: f64) -> f64 {
    (4.0 * u).tanh() + 0.3 * (5.0 * u).sin() + 0.2 * u
}

/// y(t) = g(u(t)) without noise: 500 samples that fill the range, then a fine grid between them.
fn log() -> Log {
    let u: Vec<f64> = (0..500)
        .map(|k| 2.0 * (f64::from(k) * 0.618_033_988_749_894_9).fract() - 1.0)
        .chain((0..=1000).map(|k| 0.99 * (f64::from(k) / 500.0 - 1.0)))
        .collect();
    let y: Vec<f64> = u.iter().map(|u| g(*u)).collect();
    Log::new(vec![channel("u", u), channel("y", y)], 1.0).unwrap()
}

/// Parameters, and the root mean square and the largest of g^ - g over the grid: eps_2 and eps_inf.
fn distance(log: &Log, map: MapPlan) -> (usize, f64, f64) {
    let terms = match map {
        // All of them.
        MapPlan::Polynomial { degree } => Some(degree + 1),
        MapPlan::Radial { centres: Centres::Grid { each }, .. } => Some(each + 2),
        MapPlan::Spline { units } => Some(units + 2),
        _ => None,
    };
    let plan = NonlinearArxPlan {
        map,
        terms,
        output_lags: vec![0],
        input_lags: vec![InputLags { lags: 1, delay: 0 }],
        estimate: vec![Rows::new(1, 500).unwrap()],
        validate: vec![Rows::new(501, 1501).unwrap()],
        ..NonlinearArxPlan::new(&["u"], &["y"])
    };
    let report = fit_nonlinear_arx(log, &[], &plan).unwrap();
    let fit = report.fit.iter().find(|fit| fit.part == Some(Part::Validation)).unwrap();
    (report.model.parameters().len(), fit.rmse.unwrap(), fit.largest_error.unwrap())
}

/// `cargo test -p thetahat approximation -- --nocapture` prints the curves of docs/nonlinear.md.
#[test]
fn every_map_comes_near() {
    let log = log();
    let local = |membership, planes, units| MapPlan::Local { membership, planes, units: Some(units) };
    let grid = |each| MapPlan::Radial { centres: Centres::Grid { each }, width: None, linear: true };
    // For each map its sizes, and the least distances that the largest must reach.
    let maps: [(&str, Vec<MapPlan>, f64, f64); 6] = [
        (
            "rectangles, constants",
            [4, 8, 16, 32, 64].map(|units| local(Membership::Rectangle, false, units)).to_vec(),
            0.02,
            0.15,
        ),
        (
            "rectangles, planes",
            [2, 4, 8, 16, 32].map(|units| local(Membership::Rectangle, true, units)).to_vec(),
            0.002,
            0.02,
        ),
        (
            "trapezoids, planes",
            [2, 4, 8, 16, 32].map(|units| local(Membership::Trapezoid, true, units)).to_vec(),
            0.002,
            0.01,
        ),
        ("radial functions", [2, 4, 8, 16, 32].map(grid).to_vec(), 1e-4, 1e-3),
        ("splines", [2, 4, 8, 16, 32].map(|units| MapPlan::Spline { units }).to_vec(), 1e-3, 1e-2),
        ("polynomials", [3, 5, 7, 9, 11].map(|degree| MapPlan::Polynomial { degree }).to_vec(), 1e-2, 0.05),
    ];
    for (name, sizes, root_mean_square, largest) in maps {
        let found: Vec<(usize, f64, f64)> = sizes.into_iter().map(|map| distance(&log, map)).collect();
        for (parameters, two, infinity) in &found {
            println!("{name:22} {parameters:3} {two:.2e} {infinity:.2e}");
        }
        let (first, last) = (found[0], found[found.len() - 1]);
        assert!(last.1 < root_mean_square && last.2 < largest, "{name}: {found:?}");
        assert!(last.1 < 0.1 * first.1 && last.2 < 0.25 * first.2, "{name}: {found:?}");
    }
}
