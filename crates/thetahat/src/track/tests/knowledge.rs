//! Trackers that go on from a report.

use super::*;
use crate::data::{Detrend, Log};
use crate::report::{Plan, Report, identify};
use crate::tests::channel;

/// A fit of rows of the log.
fn fit(inputs: &[[f64; 2]], y: &[f64], rows: &str, orders: Orders, detrend: Detrend) -> Report {
    let input = |j: usize| inputs.iter().map(|u| u[j]).collect::<Vec<_>>();
    let channels = vec![channel("u", input(0)), channel("v", input(1)), channel("y", y)];
    let plan = Plan {
        estimate: vec![rows.parse().unwrap()],
        detrend,
        initial: if orders.is_linear() { Initial::Drop } else { Initial::Zero },
        ..Plan::new(&["u", "v"], "y", orders)
    };
    identify(Log::new(channels, 0.1).unwrap(), &[], &plan).unwrap()
}

fn unforgetting() -> TrackPlan {
    TrackPlan { forgetting: "none".parse().unwrap(), ..TrackPlan::default() }
}

#[test]
fn it_goes_on_where_the_fit_ended() {
    let (inputs, y) = log(1000, 0.3, 0.0, 20);
    let report = fit(&inputs, &y, "1..400", orders(), Detrend::None);
    let mut tracker = Tracker::from_report(&report, &unforgetting()).unwrap();
    // At first it is the report.
    assert_eq!(
        tracker.names(),
        report.polynomials().parameters.iter().map(|p| p.name.clone()).collect::<Vec<_>>()
    );
    let mut errors = [0.0; 5];
    tracker.write_standard_errors(&mut errors).unwrap();
    for ((parameter, value), error) in
        report.polynomials().parameters.iter().zip(tracker.parameters().unwrap()).zip(errors)
    {
        assert_eq!(parameter.value, *value);
        assert!((error / parameter.standard_error.unwrap() - 1.0).abs() < 1e-12);
    }
    assert!((tracker.noise_variance().unwrap() / report.polynomials().noise_variance - 1.0).abs() < 1e-14);
    let scales = tracker.scales().unwrap();
    assert!(
        scales
            .inputs
            .iter()
            .chain([&scales.output])
            .zip([3.0, 1.0, 10.0])
            .all(|(found, size)| { (0.1 * size..=size).contains(found) }),
        "{scales:?}"
    );

    // In the end it is the fit of both parts, each without what came before it.
    let tracked = run(&mut tracker, &inputs[400..], &y[400..]);
    assert!(tracked.iter().all(|tracked| tracked.action != Action::Collecting));
    assert!(tracked[5].nis > 0.0 && tracker.score().samples() == 598);
    let (u, v): (Vec<f64>, Vec<f64>) = inputs.iter().map(|u| (u[0], u[1])).unzip();
    let record =
        Record { output: &y, inputs: vec![&u, &v], segments: vec![0..400, 400..1000], past: vec![0; 2] };
    let batch = arx(&record, &orders(), Initial::Drop).unwrap();
    for (found, expected) in tracker.parameters().unwrap().iter().zip(batch.parameters()) {
        assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
    }
    assert!((tracker.noise_variance().unwrap() / batch.noise_variance() - 1.0).abs() < 1e-9);
}

#[test]
fn offsets_come_along_and_a_constant_stands_beside() {
    let (inputs, y) = log(800, 0.3, 0.0, 21);
    let raised: Vec<f64> = y.iter().map(|y| y + 50.0).collect();
    let report = fit(&inputs, &raised, "1..400", orders(), Detrend::Mean);
    for constant in [false, true] {
        let plan = TrackPlan { constant, ..unforgetting() };
        let mut tracker = Tracker::from_report(&report, &plan).unwrap();
        assert_eq!(tracker.offsets().output, report.polynomials().output.offset.level);
        let tracked = run(&mut tracker, &inputs[400..], &raised[400..]);
        assert!(tracked[2..].iter().all(|tracked| tracked.error.abs() < 0.5), "{constant}");
    }
    // Given ones come first.
    let offsets = PerChannel { inputs: vec![1.0, 2.0], output: 3.0 };
    let plan = TrackPlan { offsets: Some(offsets.clone()), ..unforgetting() };
    assert_eq!(Tracker::from_report(&report, &plan).unwrap().offsets(), &offsets);

    let line = fit(&inputs, &raised, "1..400", orders(), Detrend::Linear);
    assert!(matches!(Tracker::from_report(&line, &unforgetting()), Err(Error::Report { .. })));
    assert!(Tracker::from_report(&line, &plan).is_ok());
}

#[test]
fn a_noise_model_comes_along() {
    let (inputs, y) = log(1500, 0.3, 0.6, 22);
    let orders = Orders::armax(2, &[2, 1], 1, &[1, 0]).unwrap();
    let report = fit(&inputs, &y, "1..500", orders.clone(), Detrend::None);
    let plan = TrackPlan { method: TrackMethod::Rpem, constant: true, ..unforgetting() };
    let mut tracker = Tracker::from_report(&report, &plan).unwrap();
    assert_eq!(tracker.names()[5..], ["constant", "c1"]);
    let parameters = tracker.parameters().unwrap();
    assert_eq!([parameters[5], parameters[6]], [0.0, report.polynomials().c[1]]);
    let tracked = run(&mut tracker, &inputs[500..], &y[500..]);
    // With C the errors are e, uniform in -0.3 … 0.3; without it their variance would be 1.36 times as large.
    let mse = tracker.score().mean_squared_error().unwrap();
    assert!((mse / 0.03 - 1.0).abs() < 0.1 && tracked.len() == 1000, "{mse}");
    assert!((tracker.parameters().unwrap()[6] - 0.6).abs() < 0.08);
}

#[test]
fn reports_that_cannot_be_tracked_are_refused() {
    let (inputs, y) = log(400, 0.3, 0.0, 23);
    let report = fit(&inputs, &y, "1..400", orders(), Detrend::None);
    let message =
        |report: &Report, plan: &TrackPlan| Tracker::from_report(report, plan).unwrap_err().to_string();
    let plan = unforgetting();
    let oe = fit(&inputs, &y, "1..400", Orders::oe(&[1, 1], &[1, 1], &[1, 0]).unwrap(), Detrend::None);
    assert!(message(&oe, &plan).contains("only AR, ARX, ARMA, ARMAX and nonlinear ARX"));
    assert!(message(&report, &exactly(&plan)).starts_with("start"));
    let rpem = TrackPlan { method: TrackMethod::Rpem, ..plan.clone() };
    assert!(message(&report, &rpem).starts_with("method"));

    type Damage = fn(&mut Report);
    let damages: [(Damage, &str); 6] = [
        (|report| report.polynomials_mut().covariance = None, "no covariance"),
        (|report| report.polynomials_mut().noise_variance = 0.0, "noise variance of 0"),
        (|report| report.polynomials_mut().parameters.truncate(2), "damaged"),
        (
            |report| report.polynomials_mut().covariance.iter_mut().for_each(|rows| rows[1][1] = -1.0),
            "positive",
        ),
        (|report| report.estimation.samples = 5, "5 rows"),
        (
            |report| report.polynomials_mut().covariance.iter_mut().for_each(|rows| rows[4][4] = 1e-220),
            "scale: that of input 2, ",
        ),
    ];
    for (damage, expected) in damages {
        let mut damaged = report.clone();
        damage(&mut damaged);
        assert!(message(&damaged, &plan).contains(expected), "{}", message(&damaged, &plan));
    }
}
