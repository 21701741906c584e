use std::ops::ControlFlow;

use super::*;
use crate::Document;
use crate::data::Channel;

/// A random walk with seasons of four rows.
fn log(rows: usize) -> Log {
    let mut random = 11_u32;
    let mut e = Vec::new();
    let mut y: Vec<f64> = Vec::new();
    for t in 0..rows {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        e.push(f64::from(random >> 8) / f64::from(1 << 23) - 1.0);
        let seasons = if t >= 4 { y[t - 4] - 0.5 * e[t - 4] } else { 0.0 };
        y.push(seasons + e[t]);
    }
    let u = (0..rows).map(|t| ((t * t) % 7) as f64).collect();
    let channel = |name: &str, values| Channel { name: name.into(), values };
    Log::new(vec![channel("u", u), channel("y", y)], 2.0).unwrap()
}

fn fitted(plan: &ArimaPlan, log: &Log) -> Report {
    fit_arima(log, &[], plan, &|_| ControlFlow::Continue(())).unwrap()
}

#[test]
fn a_report_names_the_parameters_of_the_factors_and_is_read_back() {
    let log = log(200);
    let orders = ArimaOrders::new([0, 0, 0], Some([0, 1, 1, 4])).unwrap();
    let plan = ArimaPlan { trend: true, ..ArimaPlan::new(&["u"], "y", orders) };
    let report = fitted(&plan, &log);
    let names: Vec<&str> = report.model.parameters().iter().map(|own| own.name.as_str()).collect();
    assert_eq!(names, ["drift", "b0", "sma4"]);
    assert_eq!(report.model.name(), "ARIMA(0, 0, 0)(0, 1, 1, 4)");
    assert_eq!(
        report.model.headline(),
        "ARIMA(0, 0, 0)(0, 1, 1, 4): y(t) = drift t + B(q) u(t) + z(t), (1 - q^-4) z(t) = Theta(q^4) e(t)"
    );
    let model = report.model.as_polynomial().unwrap();
    // For each row there, for each second in the offset.
    assert_eq!(model.output.offset.slope, report.model.parameters()[0].value / 2.0);
    assert!(model.noise_integrates() && report.model.covariance().unwrap().len() == 3);
    let text = report.to_json().unwrap();
    assert_eq!(Report::from_json(&text).unwrap(), report);
    for (from, to) in [("\"sma4\"", "\"sma5\""), ("\"seasonal\": [", "\"seasonal\": [1, ")] {
        let edited = text.replacen(from, to, 1);
        assert!(edited != text && Report::from_json(&edited).is_err(), "{from}");
    }
    let sma = report.model.parameters()[2].value;
    assert_eq!(model.c, [1.0, 0.0, 0.0, 0.0, sma]);
}

#[test]
fn rows_held_out_are_predicted_from_those_before_them() {
    let log = log(200);
    let orders = ArimaOrders::new([0, 0, 0], Some([0, 1, 1, 4])).unwrap();
    let plan = ArimaPlan {
        estimate: vec!["1..150".parse().unwrap()],
        validate: vec!["151..200".parse().unwrap()],
        ..ArimaPlan::new(&[], "y", orders)
    };
    let report = fitted(&plan, &log);
    assert_eq!(report.fit.iter().map(|fit| fit.samples).collect::<Vec<_>>(), [146, 50]);
}

#[test]
fn what_differencing_takes_is_no_parameter() {
    let once = ArimaPlan::new(&[], "y", ArimaOrders::new([0, 1, 1], None).unwrap());
    let refused = |plan: ArimaPlan| plan.check().unwrap_err().to_string();
    assert!(refused(ArimaPlan { constant: Constant::Yes, ..once.clone() }).contains("differencing takes it"));
    let twice = ArimaPlan { orders: ArimaOrders::new([0, 2, 1], None).unwrap(), ..once.clone() };
    assert!(refused(ArimaPlan { trend: true, ..twice }).contains("more than once"));
    let none = ArimaPlan { orders: ArimaOrders::new([0, 0, 0], None).unwrap(), ..once.clone() };
    assert!(refused(none).contains("white noise"));
    assert!(refused(ArimaPlan { delays: vec![1, 2], ..once }).contains("2 numbers for 0 inputs"));
}
