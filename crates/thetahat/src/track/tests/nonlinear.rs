//! Trackers of nonlinear ARX models.

use super::*;
use crate::data::{Detrend, Log};
use crate::model::{Evaluator, Map, Model};
use crate::report::{Centres, InputLags, MapPlan, NonlinearArxPlan, Report, fit_nonlinear_arx};
use crate::tests::{assert_refused, channel};

/// y(t) = 0.5 y(t-1) + u(t-1) - 0.3 u(t-1) y(t-1) + e(t) about 20, u about 3.
fn samples(rows: usize, seed: u64) -> (Vec<f64>, Vec<f64>) {
    let mut noise = Noise(seed);
    let (u, e) = (noise.take(rows), noise.take(rows));
    let mut y = vec![0.0];
    for t in 1..rows {
        y.push(0.5 * y[t - 1] + u[t - 1] - 0.3 * u[t - 1] * y[t - 1] + 0.05 * e[t]);
    }
    (u.iter().map(|u| u + 3.0).collect(), y.iter().map(|y| y + 20.0).collect())
}

fn log((u, y): (Vec<f64>, Vec<f64>)) -> Log {
    Log::new(vec![channel("u", u), channel("y", y)], 1.0).unwrap()
}

fn plan() -> NonlinearArxPlan {
    let lags = vec![InputLags { lags: 1, delay: 1 }];
    NonlinearArxPlan { output_lags: vec![1], input_lags: lags, ..NonlinearArxPlan::new(&["u"], &["y"]) }
}

fn about_offsets() -> TrackPlan {
    TrackPlan {
        offsets: Some(PerChannel { inputs: vec![3.0], output: 20.0 }),
        scales: Some(PerChannel { inputs: vec![1.0], output: 1.0 }),
        ..TrackPlan::default()
    }
}

fn tracker(degree: usize, plan: &TrackPlan) -> Result<Tracker, Error> {
    let orders = Orders::arx(1, &[1], &[1]).unwrap();
    let map = Map::polynomial(2, degree)?;
    Tracker::nonlinear(&orders, &map, &orders.lag_names(&["u".to_owned()], "y"), plan)
}

fn values(report: &Report) -> Vec<(String, f64)> {
    let mut values: Vec<(String, f64)> =
        report.model.parameters().iter().map(|one| (one.name.clone(), one.value)).collect();
    values.sort_by(|one, other| one.0.cmp(&other.0));
    values
}

#[test]
fn without_forgetting_it_is_the_batch_fit() {
    let (u, y) = samples(400, 3);
    let mut tracker = tracker(2, &exactly(&about_offsets())).unwrap();
    for (u, y) in u.iter().zip(&y) {
        tracker.log_row(*y, &[*u]).unwrap();
    }
    let batch = NonlinearArxPlan {
        raw_terms: true,
        detrend: Detrend::None,
        offsets: vec![("u".into(), 3.0), ("y".into(), 20.0)],
        terms: Some(6),
        ..plan()
    };
    let report = fit_nonlinear_arx(&log((u, y)), &[], &batch).unwrap();
    let mut found: Vec<(String, f64)> =
        tracker.names().iter().cloned().zip(tracker.parameters().unwrap().iter().copied()).collect();
    found.sort_by(|one, other| one.0.cmp(&other.0));
    for (one, other) in found.iter().zip(values(&report)) {
        assert_eq!(one.0, other.0);
        assert!((one.1 - other.1).abs() < 1e-8, "{one:?} {other:?}");
    }
    let Model::NonlinearArx(model) = &report.model else { panic!("other kind") };
    assert!((tracker.noise_variance().unwrap() / model.noise_covariance[0][0] - 1.0).abs() < 1e-8);
    assert_eq!(tracker.model(), "NARX polynomial, 6 terms");
}

/// Half of a log by a fit, the other half by the tracker that starts from it, is a fit of the whole: but for the row
/// after the boundary, whose lags the tracker does not have.
#[test]
fn a_report_goes_on() {
    let (u, y) = samples(601, 9);
    for map in [
        MapPlan::Polynomial { degree: 2 },
        MapPlan::Radial { centres: Centres::Grid { each: 2 }, width: Some(2.0), linear: true },
        MapPlan::Spline { units: 2 },
    ] {
        let plan = NonlinearArxPlan { map, ..plan() };
        let all = log((u.clone(), y.clone()));
        let first = NonlinearArxPlan { estimate: vec!["1..300".parse().unwrap()], ..plan.clone() };
        let report = fit_nonlinear_arx(&all, &[], &first).unwrap();
        let mut tracker = Tracker::from_report(
            &report,
            &TrackPlan { forgetting: "none".parse().unwrap(), ..TrackPlan::default() },
        )
        .unwrap();
        assert_eq!(
            tracker.names(),
            report.model.parameters().iter().map(|one| one.name.clone()).collect::<Vec<_>>()
        );
        let before = tracker.parameters().unwrap().to_vec();
        assert_eq!(before, report.model.parameters().iter().map(|one| one.value).collect::<Vec<_>>());
        for (u, y) in u.iter().zip(&y).skip(300) {
            tracker.log_row(*y, &[*u]).unwrap();
        }
        // The information of both halves: P^-1 adds up, so that standard errors fall by about the root of two.
        let mut errors = vec![0.0; before.len()];
        tracker.write_standard_errors(&mut errors).unwrap();
        for (parameter, error) in report.model.parameters().iter().zip(errors) {
            let share = error / parameter.standard_error.unwrap();
            assert!((0.5..0.95).contains(&share), "{} {share}", parameter.name);
        }
        // A sum of splines does not have what u(t-1) y(t-1) does.
        let least = if matches!(tracker.map(), Some(Map::Spline { .. })) { 80.0 } else { 85.0 };
        assert!(tracker.score().fit().unwrap() > least, "{:?}", tracker.score().fit());
    }
}

#[test]
fn predictions_are_those_of_the_model() {
    let (u, y) = samples(300, 4);
    let all = log((u.clone(), y.clone()));
    let report = fit_nonlinear_arx(&all, &[], &plan()).unwrap();
    let plan = TrackPlan { dead_zone: 1e9, forgetting: "none".parse().unwrap(), ..TrackPlan::default() };
    let mut tracker = Tracker::from_report(&report, &plan).unwrap();
    let Model::NonlinearArx(model) = &report.model else { panic!("other kind") };
    let theta = model.parameters.iter().map(|parameter| parameter.value).collect();
    let g = Evaluator::new(&model.maps[0].functions, theta);
    let (input, output) = (model.inputs[0].offset.level, model.outputs[0].offset.level);
    let mut before = None;
    for (u, y) in u.iter().zip(&y) {
        let tracked = tracker.log_row(*y, &[*u]).unwrap();
        if let Some((u, y)) = before {
            let z = [(y - output) / model.regressors[0].scale, (u - input) / model.regressors[1].scale];
            assert_eq!(tracked.predicted, model.maps[0].scale * g.value(&z) + output);
        }
        before = Some((*u, *y));
    }
}

#[test]
fn a_state_goes_on_to_the_bit() {
    let (u, y) = samples(80, 5);
    let open = TrackPlan { scales: None, ..about_offsets() };
    for plan in [open, about_offsets(), exactly(&about_offsets())] {
        let mut tracker = tracker(3, &plan).unwrap();
        for (t, (u, y)) in u.iter().zip(&y).enumerate() {
            if [0, 3, 20, 50].contains(&t) {
                let text = serde_json::to_string(&tracker).unwrap();
                let mut copy: Tracker = serde_json::from_str(&text).unwrap();
                assert_eq!(serde_json::to_string(&copy).unwrap(), text);
                let mut original = tracker.clone();
                for (u, y) in u_and_y(t) {
                    let one = original.log_row(y, &[u]).unwrap();
                    let other = copy.log_row(y, &[u]).unwrap();
                    assert_eq!(format!("{one:?}"), format!("{other:?}"));
                }
                // A state that was edited is refused.
                for (good, bad) in [
                    (
                        "\"map\":{\"type\":\"polynomial\",\"terms\":[[]",
                        "\"map\":{\"type\":\"polynomial\",\"terms\":[[7]",
                    ),
                    ("u(k-1)^3", "u(k-1)^4"),
                ] {
                    let edited = text.replacen(good, bad, 1);
                    if edited != text {
                        let read: Result<Tracker, _> = serde_json::from_str(&edited);
                        assert!(good.starts_with('u') || read.is_err(), "{t} {good}");
                    }
                }
            }
            tracker.log_row(if t % 11 == 7 { f64::NAN } else { *y }, &[*u]).unwrap();
        }
    }
    fn u_and_y(t: usize) -> Vec<(f64, f64)> {
        let (u, y) = samples(30, 6 + t as u64);
        u.into_iter().zip(y).collect()
    }
}

#[test]
fn what_does_not_fit_is_told() {
    let told = |plan: &TrackPlan, degree: usize| tracker(degree, plan).unwrap_err().to_string();
    assert!(told(&TrackPlan { constant: true, ..TrackPlan::default() }, 2).contains("constant"));
    assert!(told(&TrackPlan { method: TrackMethod::Els, ..TrackPlan::default() }, 2).contains("method"));
    assert!(told(&TrackPlan::default(), 0).contains("degree"));
    let orders = Orders::arx(5, &[5], &[1]).unwrap();
    let names = orders.lag_names(&["u".to_owned()], "y");
    let map = Map::polynomial(10, 6).unwrap();
    assert_refused(Tracker::nonlinear(&orders, &map, &names, &TrackPlan::default()), "8008 functions");
    let map = Map::polynomial(3, 2).unwrap();
    assert!(Tracker::nonlinear(&orders, &map, &names[..3], &TrackPlan::default()).is_err());
    let (u, y) = samples(100, 4);
    let report = fit_nonlinear_arx(&log((u, y)), &[], &plan()).unwrap();
    let mut odd = report.clone();
    let Model::NonlinearArx(model) = &mut odd.model else { panic!("other kind") };
    model.regressors[0].lag = 2;
    assert_refused(Tracker::from_report(&odd, &TrackPlan::default()), "lags in a row");
    let mut odd = report;
    let Model::NonlinearArx(model) = &mut odd.model else { panic!("other kind") };
    model.covariance = None;
    assert_refused(Tracker::from_report(&odd, &TrackPlan::default()), "covariance");
}
