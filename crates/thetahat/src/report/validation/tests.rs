//! What a validation says of models whose truth is known.

use thetahat_numerics::noise::Noise;
use thetahat_numerics::optimize::Search;

use super::*;
use crate::estimate::{Initial, Method};
use crate::model::Orders;
use crate::report::{Demand, Plan, Requirement, identify};
use crate::respond::InitialCondition;
use crate::tests::{assert_refused, channel};

/// Rows of u and y around 5 and 20: y(t) = 1.2 y(t-1) - 0.5 y(t-2) + u(t-1) + 0.4 u(t-2) + 0.2 e(t).
fn signals(rows: usize) -> (Vec<f64>, Vec<f64>) {
    let mut noise = Noise(17);
    let (u, e) = (noise.take(rows), noise.take(rows));
    let mut y = vec![0.0; 2];
    for t in 2..rows {
        y.push(1.2 * y[t - 1] - 0.5 * y[t - 2] + u[t - 1] + 0.4 * u[t - 2] + 0.2 * e[t]);
    }
    (u.iter().map(|u| u + 5.0).collect(), y.iter().map(|y| y + 20.0).collect())
}

fn log(u: &[f64], y: &[f64]) -> Log {
    Log::new(vec![channel("u", u), channel("y", y)], 0.5).unwrap()
}

fn rows(text: &str) -> Vec<Rows> {
    text.split(',').map(|text| text.parse().unwrap()).collect()
}

fn fitted(log: &Log, estimate: &str, orders: Orders, initial: Initial) -> Report {
    let inputs = &["u"][..orders.inputs()];
    let plan = Plan { estimate: rows(estimate), initial, ..Plan::new(inputs, "y", orders) };
    identify(log.clone(), &[], &plan).unwrap()
}

fn arx() -> Orders {
    Orders::arx(2, &[2], &[1]).unwrap()
}

fn plan(text: &str) -> ValidationPlan {
    ValidationPlan { rows: if text.is_empty() { vec![] } else { rows(text) }, ..ValidationPlan::default() }
}

fn found(report: &Report, log: &Log, plan: &ValidationPlan) -> Validation {
    validate(report, None, log, &[], plan).unwrap().validation
}

#[test]
fn the_log_of_the_fit_is_known_by_its_errors() {
    let (u, y) = signals(400);
    let whole = log(&u, &y);
    let mut gaps = y.clone();
    gaps[100] = f64::NAN;
    let gaps = log(&u, &gaps);
    let oe = Orders::oe(&[2], &[2], &[1]).unwrap();
    let armax = Orders::armax(2, &[2], 1, &[1]).unwrap();
    let bj = Orders::bj(&[2], 1, 1, &[2], &[1]).unwrap();
    for (log, estimate, orders, initial) in [
        (&whole, "1..200", arx(), Initial::Auto),
        (&whole, "101..300", arx(), Initial::Drop),
        (&gaps, "51..300", arx(), Initial::Zero),
        (&whole, "101..300", armax.clone(), Initial::Drop),
        (&gaps, "51..300", armax, Initial::Zero),
        (&whole, "101..300", oe.clone(), Initial::Estimate),
        (&whole, "1..300", oe, Initial::Zero),
        (&gaps, "51..300", bj, Initial::Estimate),
        (&whole, "51..300", Orders::arx(2, &[], &[]).unwrap(), Initial::Auto),
    ] {
        let report = fitted(log, estimate, orders, initial);
        let what = format!("{:?} {estimate} {initial:?}", report.polynomials().structure);
        let seen = |text: &str| found(&report, log, &plan(text)).in_sample;
        assert_eq!(seen(estimate), InSample::Yes, "{what}");
        assert_eq!(
            (seen("301..400"), seen("101..400"), seen("120..150,160..190")),
            (InSample::No, InSample::Partly, InSample::Yes)
        );
        // The offsets of the fit are those that count, whatever the validation takes.
        let other = ValidationPlan { detrend: Some(Detrend::None), ..plan(estimate) };
        assert_eq!(found(&report, log, &other).in_sample, InSample::Yes, "{what}");
        // One value in another log is another one.
        let mut changed = y.clone();
        changed[150] += 1e-3;
        let found = found(&report, &super::tests::log(&u, &changed), &plan(estimate));
        assert_eq!(found.in_sample, InSample::No, "{what}");
        assert_eq!(found.residuals[0].fitted, 0);
    }
    // A log that goes on after the rows of the fit; one that ends before.
    let report = fitted(&log(&u[..300], &y[..300]), "1..300", arx(), Initial::Auto);
    assert_eq!(found(&report, &whole, &plan("1..300")).in_sample, InSample::Yes);
    assert_eq!(found(&report, &log(&u[..200], &y[..200]), &plan("")).in_sample, InSample::No);
}

#[test]
fn figures_are_those_of_their_definitions() {
    let (u, y) = signals(600);
    let log = log(&u, &y);
    let report = fitted(&log, "1..300", arx(), Initial::Auto);
    let plan = ValidationPlan { horizons: vec![3, 1, 3, 7], ..plan("301..600") };
    let Validated { validation: found, signals, .. } =
        validate(&report, Some("m"), &log, &[], &plan).unwrap();
    let output = &signals.outputs[0];
    assert_eq!((found.schema.as_str(), found.report.as_deref()), (Validation::SCHEMA, Some("m")));
    let horizons: Vec<String> = found.fit.iter().map(|fit| fit.horizon.to_string()).collect();
    assert_eq!(horizons, ["1 step ahead", "3 steps ahead", "7 steps ahead", "free run"]);
    assert_eq!(
        found.coverage.iter().map(|one| one.steps).collect::<Vec<_>>(),
        [1, 1, 1, 1, 3, 3, 3, 3, 7, 7, 7, 7]
    );
    // In the log's own units, over the rows that were asked for.
    assert_eq!((&output.measured, &signals.inputs[0].1, &signals.time[2]), (&y, &u, &1.0));
    let errors: Vec<f64> = (300..600).map(|t| y[t] - output.predicted[t]).collect();
    let mse = errors.iter().map(|e| e * e).sum::<f64>() / 300.0;
    assert!((found.noise[0].mse.unwrap() / mse - 1.0).abs() < 1e-9);
    assert!((found.noise[0].ratio.unwrap() - mse / report.polynomials().noise_variance).abs() < 1e-9);
    assert!((found.fit[0].rmse.unwrap() - mse.sqrt()).abs() < 1e-12);
    let half = 1.959964 * report.polynomials().noise_variance.sqrt();
    let inside = errors.iter().filter(|e| e.abs() <= half).count() as f64 / 300.0;
    assert_eq!((found.coverage[2].level, found.coverage[2].actual), (0.95, Some(inside)));
    let run = output.simulated.as_ref().unwrap();
    assert!(output.predicted[299].is_nan() && run[299].is_nan() && run[300].is_finite());
    let square = (300..600).map(|t| (y[t] - run[t]).powi(2)).sum::<f64>();
    assert!((found.fit[3].rmse.unwrap() - (square / 300.0).sqrt()).abs() < 1e-12);
    assert_eq!(found.fit[3].initial, InitialCondition::Estimate);

    assert!(
        found.white_expected && found.stable == Some(true) && found.warnings.is_empty(),
        "{:?}",
        found.warnings
    );
    let text = found.to_json().unwrap();
    assert_eq!(Validation::from_json(&text).unwrap(), found);
    assert!(text.ends_with("}\n"));
}

#[test]
fn offsets_of_the_rows_are_taken_where_asked_for() {
    let (u, y) = signals(600);
    let whole = log(&u, &y);
    let report = fitted(&whole, "1..300", arx(), Initial::Auto);
    let high: Vec<f64> = y.iter().map(|y| y + 3.0).collect();
    let high = log(&u, &high);
    let plain = validate(&report, None, &high, &[], &plan("301..600")).unwrap();
    let text = plain.validation.warnings.join("\n");
    assert!(text.contains("have a mean of 0.90") && text.contains("`detrend` mean"), "{text}");
    assert!(text.contains("times the model's noise variance"), "{text}");
    // An offset is no matter of dynamics.
    assert!(!text.contains("white") && !text.contains("past values"), "{text}");
    let own = ValidationPlan { detrend: Some(Detrend::Mean), ..plan("301..600") };
    let own = validate(&report, None, &high, &[], &own).unwrap();
    assert!(own.validation.warnings.is_empty(), "{:?}", own.validation.warnings);
    assert!(own.validation.fit.iter().all(|fit| fit.percent.unwrap() > 80.0));
    let near =
        |t: usize| (own.signals.outputs[0].predicted[t] - own.signals.outputs[0].measured[t]).abs() < 1.0;
    assert!((301..600).all(near));
}

#[test]
fn what_is_wrong_is_said() {
    let (u, y) = signals(600);
    let log = log(&u, &y);
    let words = |orders: Orders| {
        let report = fitted(&log, "1..300", orders, Initial::Auto);
        let found = found(&report, &log, &plan("301..600"));
        (found.warnings.join("\n"), found)
    };
    let (text, _) = words(Orders::arx(2, &[2], &[3]).unwrap());
    assert!(text.contains("past values of input 'u'") && text.contains("see lags 1"), "{text}");
    let (text, found) = words(Orders::arx(1, &[1], &[2]).unwrap());
    assert!(text.contains("are not white (Ljung-Box, 25 lags"), "{text}");
    let unmet = |text: &str| text.parse::<Requirement>().unwrap().unmet(&found, 0.05);
    assert!(unmet("white").unwrap().starts_with("white: the p-value of Ljung-Box is "));
    assert!(unmet("independent").unwrap().starts_with("independent: 'u' has p-value "));
    assert_eq!(unmet("stable"), None);
    assert_eq!(unmet("fit>=10"), None);
    assert!(unmet("fit@5>=99.5").unwrap().contains("fit@5>=99.5: the fit is "));
    assert!(unmet("fit@8>=1").unwrap().contains("there is no fit figure (8 steps ahead)"));
    assert_eq!(unmet("coverage>=85"), None);
    assert!(unmet("coverage>=100").unwrap().contains("hold "));

    let (text, found) = words(arx());
    assert_eq!(text, "");
    for met in ["white", "independent", "fit@1>=80", "fit>=80", "fit@5>=-1e3"] {
        assert_eq!(met.parse::<Requirement>().unwrap().unmet(&found, 0.05), None, "{met}");
    }
    // Two inputs share the level.
    let of = |p: f64| {
        let mut two = found.clone();
        let independence = &mut two.residuals[0].independence;
        independence.push(independence[0].clone());
        independence[1].past.p_value = Some(p);
        Requirement::from(Demand::Independent).unmet(&two, 0.05)
    };
    assert_eq!(of(0.03), None);
    assert!(of(0.02).unwrap().contains("p-value 0.0200, below 0.025"));
    // Without a test there is nothing that could be met.
    let untested =
        Validation { residuals: vec![], fit: vec![], coverage: vec![], stable: Some(false), ..found };
    for text in ["white", "independent", "fit>=0", "coverage>=0", "stable"] {
        let requirement: Requirement = text.parse().unwrap();
        assert!(requirement.unmet(&untested, 0.05).unwrap().starts_with(text));
        assert_eq!(requirement.to_string(), text);
    }
}

#[test]
fn requirements_are_read_and_refused() {
    for wrong in [
        "",
        "blue",
        "White",
        "fit",
        "fit>=",
        "fit>=x",
        "fit>=nan",
        "fit>=101",
        "fit@0>=5",
        "fit@x>=5",
        "fit=5",
        "mean-error",
        "mean-error>=1",
        "mean-error<=",
        "mean-error<=-1",
        "mean-error@0<=1",
        "error<=1",
        "largest-error<=inf",
        "fit[y>=3",
        "blue[y]",
        "stable[y]",
    ] {
        let error = wrong.parse::<Requirement>().unwrap_err();
        assert!(
            matches!(&error, Error::Argument { argument, .. } if argument == "require"),
            "{wrong}: {error}"
        );
    }
    assert_eq!(" fit@3 >= 80 ".parse(), Ok(Demand::Fit { steps: Some(3), percent: 80.0 }));
    let mean = Demand::MeanError { steps: None, limit: 0.5 };
    let largest = Demand::LargestError { steps: Some(2), limit: 0.0 };
    assert_eq!("mean-error<=0.5".parse(), Ok(mean));
    assert_eq!("largest-error@2 <= 0".parse(), Ok(largest));
    assert_eq!([mean, largest].map(|one| one.to_string()), ["mean-error<=0.5", "largest-error@2<=0"]);
    // Of one output; a name may hold brackets.
    for (text, output) in [("fit[y2]@3>=80", "y2"), ("white[a[1]]", "a[1]"), ("mean-error[y]<=0.5", "y")] {
        let one: Requirement = text.parse().unwrap();
        assert_eq!((one.output.as_deref(), one.to_string().as_str()), (Some(output), text));
    }
    let (u, y) = signals(300);
    let log = log(&u, &y);
    let oe = fitted(&log, "1..300", Orders::oe(&[2], &[2], &[1]).unwrap(), Initial::Auto);
    let text = Requirement::from(Demand::White).check(&oe).unwrap_err().to_string();
    assert!(text.contains("OE(") && text.contains("says nothing of the noise"), "{text}");
    assert!(Requirement::from(Demand::Independent).check(&oe).is_ok());
    assert!(!found(&oe, &log, &plan("")).white_expected);
    let ar = fitted(&log, "1..300", Orders::arx(2, &[], &[]).unwrap(), Initial::Auto);
    assert_refused(Requirement::from(Demand::Independent).check(&ar), "no inputs");
    assert!(Requirement::from(Demand::White).check(&ar).is_ok());
    // A series has no free run: one step ahead is meant.
    let found = found(&ar, &log, &plan(""));
    assert!(found.fit.iter().all(|fit| fit.horizon != Horizon::FreeRun));
    assert_eq!(Requirement::from(Demand::Fit { steps: None, percent: 20.0 }).unmet(&found, 0.05), None);
}

#[test]
fn logs_that_say_little_leave_nulls() {
    let (u, y) = signals(300);
    let whole = log(&u, &y);
    let report = fitted(&whole, "1..300", arx(), Initial::Auto);
    for (u, y) in [
        (vec![5.0], vec![20.0]),
        (vec![5.0; 100], vec![20.0; 100]),
        (u.clone(), y.iter().map(|y| 1e200 * y).collect()),
        (u.clone(), y.iter().map(|y| 1e-200 * y).collect()),
        (u[..12].to_vec(), y[..12].to_vec()),
        (u.clone(), (0..300).map(|t| if t % 2 == 0 { y[t] } else { f64::NAN }).collect()),
        (vec![5.0; 300], y.clone()),
    ] {
        let found = found(&report, &log(&u, &y), &plan(""));
        let text = found.to_json().unwrap();
        assert_eq!(Validation::from_json(&text).unwrap(), found);
        assert!(!found.residuals.is_empty() || !found.warnings.is_empty());
    }
    let nothing = log(&[f64::NAN; 5], &[1.0; 5]);
    assert_refused(validate(&report, None, &nothing, &[], &plan("")), "no row has a value in every channel");
    let slow = Log::new(whole.channels().to_vec(), 0.6).unwrap();
    assert_refused(validate(&report, None, &slow, &[], &plan("")), "sample time");
    let wrong = |plan: ValidationPlan| match plan.check() {
        Err(Error::Argument { argument, .. }) => argument,
        other => format!("{other:?}"),
    };
    let default = ValidationPlan::default;
    assert_eq!(wrong(ValidationPlan { horizons: vec![0], ..default() }), "horizon");
    assert_eq!(wrong(ValidationPlan { horizons: vec![usize::MAX], ..default() }), "horizon");
    assert_eq!(wrong(ValidationPlan { lags: 0, ..default() }), "lags");
    assert_eq!(wrong(ValidationPlan { lags: 1001, ..default() }), "lags");
    assert_eq!(wrong(ValidationPlan { alpha: 0.0, ..default() }), "alpha");
    assert_eq!(wrong(ValidationPlan { alphas: vec![f64::NAN], ..default() }), "alphas");
}

#[test]
fn models_are_compared_on_the_same_rows() {
    let (u, y) = signals(300);
    let log = log(&u, &y);
    let report = fitted(&log, "1..300", arx(), Initial::Auto);
    let on = |text: &str| validate(&report, Some("a"), &log, &[], &plan(text)).unwrap();
    let comparison = compare(&[on("1..200"), on("1..200")]).unwrap();
    assert_eq!(comparison.models.len(), 2);
    let text = comparison.to_json().unwrap();
    assert_eq!(Comparison::from_json(&text).unwrap(), comparison);
    assert!(compare(&[on("1..200"), on("1..201")]).is_err() && compare(&[]).is_err());
    // Each document is known by its schema.
    assert_refused(Validation::from_json(&text), "thetahat.comparison/1");
    assert_refused(Comparison::from_json("{}"), "not a thetahat comparison");
    assert!(<Validation as Document>::json_schema()["properties"]["noise"].is_object());
    assert!(<Comparison as Document>::json_schema()["properties"]["models"].is_object());
}

#[test]
fn a_search_that_did_not_end_is_known_too() {
    // Initial conditions are then not quite the best ones.
    let (u, y) = signals(300);
    let log = log(&u, &y);
    let orders = Orders::oe(&[2], &[2], &[1]).unwrap();
    let search = Search { max_iterations: 1, ..Search::default() };
    let method = Method::PredictionError(search);
    let plan = Plan { method, initial: Initial::Estimate, ..Plan::new(&["u"], "y", orders) };
    let report = identify(log.clone(), &[], &plan).unwrap();
    assert_eq!(found(&report, &log, &super::tests::plan("")).in_sample, InSample::Yes);
}
