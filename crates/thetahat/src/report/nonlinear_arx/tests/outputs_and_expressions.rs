//! Several outputs, expressions of channels, and runs that are kept within a range.

use super::*;
use crate::Document;
use crate::report::apply;

/// Two outputs that act on one another,
///
/// ```text
/// y1(t) = 0.5 y1(t-1) + 0.3 y2(t-1) + u(t-1) + e1,   y2(t) = 0.4 y2(t-1) - 0.2 y1(t-1) + u(t-1)^2 + e2
/// ```
///
/// with errors of which a part is common to both.
fn pair(rows: usize, spread: f64) -> Log {
    let mut noise = Noise(17);
    let u = noise.take(rows);
    let (mut first, mut second) = (vec![0.0], vec![0.0]);
    for t in 1..rows {
        let mut e = || spread * 0.5 * noise.take(12).iter().sum::<f64>();
        let (common, one, other) = (e(), e(), e());
        let (y1, y2, x) = (first[t - 1], second[t - 1], u[t - 1]);
        first.push(0.5 * y1 + 0.3 * y2 + x + common + one);
        second.push(0.4 * y2 - 0.2 * y1 + x * x + common + other);
    }
    Log::new(vec![channel("u", u), channel("y1", first), channel("y2", second)], 1.0).unwrap()
}

fn of_pair(terms: &[&str]) -> NonlinearArxPlan {
    NonlinearArxPlan {
        map: MapPlan::Products { terms: terms.iter().map(|term| (*term).to_owned()).collect() },
        output_lags: vec![1, 1],
        input_lags: vec![InputLags { lags: 1, delay: 1 }],
        raw_terms: true,
        detrend: Detrend::None,
        ..NonlinearArxPlan::new(&["u"], &["y1", "y2"])
    }
}

const ALL: [&str; 4] = ["y1(k-1)", "y2(k-1)", "u(k-1)", "u(k-1)^2"];

#[test]
fn two_outputs_are_two_maps_of_the_lags_of_both() {
    let log = pair(400, 0.0);
    let report = fit_nonlinear_arx(&log, &[], &of_pair(&ALL)).unwrap();
    let own = model(&report);
    let truth = [0.5, 0.3, 1.0, 0.0, -0.2, 0.4, 0.0, 1.0];
    for (parameter, truth) in own.parameters.iter().zip(truth) {
        assert!((parameter.value - truth).abs() < 1e-12, "{parameter:?}");
    }
    assert_eq!(own.parameters[0].name, "y1: y1(k-1)");
    assert_eq!(own.parameters[7].name, "y2: u(k-1)^2");
    assert_eq!(report.model.name(), "NARX y1 polynomial, 4 terms; y2 polynomial, 4 terms");
    // One step ahead and in the free run both outputs are exact.
    assert_eq!(report.fit.len(), 4);
    for fit in &report.fit {
        assert!(fit.rmse.unwrap() < 1e-12, "{fit:?}");
    }
    // Each output alone, the other being an input, has the same parameters.
    for (output, other) in [("y1", "y2"), ("y2", "y1")] {
        let plan = NonlinearArxPlan {
            inputs: vec!["u".into(), other.into()],
            outputs: vec![output.into()],
            output_lags: vec![1],
            input_lags: vec![InputLags { lags: 1, delay: 1 }; 2],
            ..of_pair(&ALL)
        };
        let alone = fit_nonlinear_arx(&log, &[], &plan).unwrap();
        let joint = own.of_output(usize::from(output == "y2")).unwrap();
        for (one, other) in alone.model.parameters().iter().zip(&joint.parameters) {
            assert_eq!(one.name, other.name);
            assert!((one.value - other.value).abs() < 1e-12, "{one:?} {other:?}");
        }
    }
    // It is read back as it was written, and checked.
    let text = report.to_json().unwrap();
    assert_eq!(Report::from_json(&text).unwrap().to_json().unwrap(), text);
    assert_refused(own.single("this"), "2");
    assert!(own.of_output(2).is_err());
}

/// Where both maps have the same functions F, cov(theta_1, theta_2) = sigma_12 (F'F)^-1, and (F'F)^-1 =
/// cov(theta_1)/sigma_11.
#[test]
fn errors_that_are_common_make_parameters_covary() {
    let report = fit_nonlinear_arx(&pair(3000, 0.1), &[], &of_pair(&ALL)).unwrap();
    let own = model(&report);
    let noise = &own.noise_covariance;
    // The common part is half of the variance of each.
    let (variance, common) = (0.02, 0.01);
    for (entry, truth) in [(noise[0][0], variance), (noise[1][1], variance), (noise[0][1], common)] {
        assert!((entry / truth - 1.0).abs() < 0.1, "{noise:?}");
    }
    let covariance = own.covariance.as_ref().unwrap();
    for i in 0..4 {
        for j in 0..4 {
            let expected = noise[0][1] / noise[0][0] * covariance[i][j];
            assert!((covariance[i][4 + j] - expected).abs() < 1e-9 * covariance[i][i].max(covariance[j][j]));
            assert_eq!(covariance[i][4 + j], covariance[4 + j][i]);
        }
    }
}

/// A linear pair: the covariance of the errors k steps ahead is S + A S A' + … + A^(k-1) S A^(k-1)'.
#[test]
fn errors_of_one_output_are_errors_of_the_other() {
    let log = pair(500, 0.1);
    let report = fit_nonlinear_arx(&log, &[], &of_pair(&ALL[..3])).unwrap();
    let own = model(&report);
    let theta: Vec<f64> = own.parameters.iter().map(|parameter| parameter.value).collect();
    let known = NonlinearArxModel { covariance: None, degrees_of_freedom: None, ..own.clone() };
    let a = [[theta[0], theta[1]], [theta[3], theta[4]]];
    let times = |a: [[f64; 2]; 2], b: [[f64; 2]; 2]| -> [[f64; 2]; 2] {
        std::array::from_fn(|i| std::array::from_fn(|j| a[i][0] * b[0][j] + a[i][1] * b[1][j]))
    };
    let noise = [
        [own.noise_covariance[0][0], own.noise_covariance[0][1]],
        [own.noise_covariance[1][0], own.noise_covariance[1][1]],
    ];
    let transposed = [[a[0][0], a[1][0]], [a[0][1], a[1][1]]];
    let mut sum = noise;
    for _ in 1..3 {
        let next = times(times(a, sum), transposed);
        sum = std::array::from_fn(|i| std::array::from_fn(|j| next[i][j] + noise[i][j]));
    }
    let horizon = Horizon::Steps { steps: 3 };
    let found = apply(&known.into(), &log, &[], None, horizon, InitialCondition::Drop).unwrap();
    for (output, sum) in found.outputs.iter().zip([sum[0][0], sum[1][1]]) {
        let deviation = output.standard_deviations.as_ref().unwrap()[100];
        assert!((deviation / sum.sqrt() - 1.0).abs() < 1e-12, "{deviation} {sum}");
    }
}

/// An emptying tank: y(t) = y(t-1) - 0.2 sqrt(y(t-1)) + 0.1 u(t-1).
fn tank(rows: usize) -> Log {
    let u: Vec<f64> = Noise(5).take(rows).into_iter().map(|u| 4.0 + 2.0 * u).collect();
    let mut y = vec![3.0_f64];
    for t in 1..rows {
        y.push(y[t - 1] - 0.2 * y[t - 1].sqrt() + 0.1 * u[t - 1]);
    }
    Log::new(vec![channel("u", u), channel("y", y)], 1.0).unwrap()
}

fn of_tank(expression: &str, detrend: Detrend) -> NonlinearArxPlan {
    let terms = ["1", "y(k-1)", "u(k-1)"].map(str::to_owned).into_iter();
    NonlinearArxPlan {
        map: MapPlan::Products { terms: terms.chain([format!("{expression}(k-1)")]).collect() },
        expressions: vec![expression.to_owned()],
        output_lags: vec![1],
        input_lags: vec![InputLags { lags: 1, delay: 1 }],
        detrend,
        ..plan()
    }
}

#[test]
fn a_root_of_the_output_is_a_regressor() {
    let log = tank(600);
    let plan = NonlinearArxPlan { raw_terms: true, ..of_tank("sqrt(y)", Detrend::None) };
    let report = fit_nonlinear_arx(&log, &[], &plan).unwrap();
    for (parameter, truth) in report.model.parameters().iter().zip([0.0, 1.0, 0.1, -0.2]) {
        assert!((parameter.value - truth).abs() < 1e-9, "{parameter:?}");
    }
    // Deviations from offsets, divided by scales, are the same model: its free run too, which computes the root of its
    // own output.
    for plan in [plan, of_tank("sqrt(y)", Detrend::Mean)] {
        let report = fit_nonlinear_arx(&log, &[], &plan).unwrap();
        assert!(report.fit.iter().all(|fit| fit.rmse.unwrap() < 1e-9), "{:?}", report.fit);
        let text = report.to_json().unwrap();
        assert!(text.contains("\"expressions\"") && Report::from_json(&text).is_ok());
        assert_refused(model(&report).lag_orders(), "sqrt(y)");
    }
    // The root of what rounding makes of 0 is a number too.
    let plan = NonlinearArxPlan { raw_terms: true, ..of_tank("sqrt(max(y, 0))", Detrend::None) };
    let report = fit_nonlinear_arx(&log, &[], &plan).unwrap();
    let from_rest = apply(&report.model, &log, &[], None, Horizon::FreeRun, InitialCondition::Zero).unwrap();
    // Before a run from rest the tank is at its offsets, which are 0 here.
    let (mut y, u) = (0.0_f64, &log.channel("u").unwrap().values);
    for (t, said) in from_rest.outputs[0].predicted.iter().enumerate().take(50) {
        y = y - 0.2 * y.sqrt() + 0.1 * if t == 0 { 0.0 } else { u[t - 1] };
        assert!((said - y).abs() < 1e-9, "{t}: {said} {y}");
    }
}

/// The square of the output as an expression, and as a product: predictions and their deviations agree, through the
/// slope of the expression.
#[test]
fn expressions_carry_errors_as_products_do() {
    let mut noise = Noise(23);
    let u = noise.take(400);
    let mut y = vec![0.1];
    for t in 1..400 {
        y.push(0.5 * y[t - 1] + 0.2 * y[t - 1] * y[t - 1] + 0.3 * u[t - 1] + 0.05 * noise.take(1)[0]);
    }
    let log = Log::new(vec![channel("u", u), channel("y", y)], 1.0).unwrap();
    let raw = |plan: NonlinearArxPlan| NonlinearArxPlan { raw_terms: true, ..plan };
    let expression = raw(of_tank("y^2", Detrend::None));
    let mut product = expression.clone();
    product.expressions.clear();
    let terms = ["1", "y(k-1)", "u(k-1)", "y(k-1)^2"].map(str::to_owned).to_vec();
    product.map = MapPlan::Products { terms };
    let found = [expression, product].map(|plan| {
        let report = fit_nonlinear_arx(&log, &[], &plan).unwrap();
        let horizon = Horizon::Steps { steps: 4 };
        apply(&report.model, &log, &[], None, horizon, InitialCondition::Drop).unwrap().outputs.remove(0)
    });
    let deviations = |place: usize| found[place].standard_deviations.as_ref().unwrap();
    for t in 10..400 {
        assert!((found[0].predicted[t] - found[1].predicted[t]).abs() < 1e-10, "{t}");
        assert!((deviations(0)[t] / deviations(1)[t] - 1.0).abs() < 1e-8, "{t}");
    }
}

#[test]
fn expressions_that_cannot_be_are_told() {
    let log = tank(100);
    let refused = |expression: &str, detrend, words: &str| {
        let plan = of_tank(expression, detrend);
        let plan = NonlinearArxPlan { map: MapPlan::Polynomial { degree: 1 }, ..plan };
        let error = fit_nonlinear_arx(&log, &[], &plan).unwrap_err().to_string();
        assert!(error.contains(words), "{expression}: {error}");
    };
    refused("sqrt(v)", Detrend::Mean, "unknown name 'v'");
    refused("ln(u - 100)", Detrend::Mean, "ln(u - 100) is no number in row 1");
    refused("1/(u - u)", Detrend::Mean, "reads no channel");
    refused("sqrt(u)", Detrend::Linear, "detrend");
    refused("u*0 + 2", Detrend::Mean, "reads no channel");
    refused("y", Detrend::Mean, "read already");
    let mut plan = of_tank("sqrt(u)", Detrend::Mean);
    plan.map = MapPlan::Polynomial { degree: 1 };
    let report = fit_nonlinear_arx(&log, &[], &plan).unwrap();
    // A log on which it has no value says where.
    let mut channels = ["u", "y"].map(|name| log.channel(name).unwrap().clone());
    channels[0].values[7] = -1.0;
    let other = Log::new(channels.into(), 1.0).unwrap();
    assert_refused(
        validate(&report, None, &other, &[], &ValidationPlan::default()),
        "sqrt(u) is no number in row 8",
    );
}

/// y(t) = 0.5 y(t-1) + y(t-1)^2 + u(t-1) leaves the data where the input is larger than they were.
#[test]
fn runs_are_kept_within_a_range_where_that_is_asked() {
    let u = Noise(9).take(300);
    let run = |size: f64| {
        let mut y = vec![0.0];
        for t in 1..300 {
            y.push(0.5 * y[t - 1] + y[t - 1] * y[t - 1] + size * u[t - 1]);
        }
        y
    };
    let log = Log::new(
        vec![channel("u", u.iter().map(|u| 0.05 * u).collect::<Vec<_>>()), channel("y", run(0.05))],
        1.0,
    );
    let plan = NonlinearArxPlan {
        map: MapPlan::Products { terms: ["y(k-1)", "y(k-1)^2", "u(k-1)"].map(str::to_owned).to_vec() },
        raw_terms: true,
        detrend: Detrend::None,
        ..plan()
    };
    let report = fit_nonlinear_arx(&log.unwrap(), &[], &plan).unwrap();
    let fresh = Log::new(vec![channel("u", u), channel("y", vec![0.0; 300])], 1.0).unwrap();
    let free = apply(&report.model, &fresh, &[], None, Horizon::FreeRun, InitialCondition::Drop).unwrap();
    assert!(free.clamped.is_none() && free.outputs[0].predicted.iter().skip(2).any(|y| y.is_nan()));
    let kept = report.clamped_run(&fresh, &[], None, InitialCondition::Drop).unwrap();
    let [low, high] = model(&report).maps[0].range;
    let beyond = 0.05 * (high - low) + 1e-12;
    let said = &kept.outputs[0].predicted[2..];
    assert!(said.iter().all(|y| (low - beyond..=high + beyond).contains(y)));
    assert!(kept.clamped.unwrap() > 50);
    assert!(kept.outputs[0].fit.as_ref().unwrap().outside.unwrap() > 0.5);
    // Within the range nothing changes, and other models have none.
    let inside =
        report.clamped_run(&fresh, &["1..2".parse().unwrap()], None, InitialCondition::Drop).unwrap();
    assert_eq!(inside.clamped, Some(0));
    let line =
        identify(tank(100), &[], &Plan::new(&["u"], "y", Orders::arx(1, &[1], &[1]).unwrap())).unwrap();
    assert_refused(line.clamped_run(&tank(100), &[], None, InitialCondition::Drop), "nonlinear ARX");
}
