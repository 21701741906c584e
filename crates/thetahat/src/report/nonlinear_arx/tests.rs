mod approximation;
mod boxes_and_neighbours;
mod networks;
mod outputs_and_expressions;

use thetahat_numerics::noise::Noise;

use super::*;
use crate::Document;
use crate::data::Detrend;
use crate::estimate::Constant;
use crate::model::Orders;
use crate::report::{Plan, ValidationPlan, fit_nonlinear_arx, identify, validate};
use crate::respond::InitialCondition;
use crate::select::Select;
use crate::tests::{assert_refused, channel};

/// y(t) = 0.5 y(t-1) + u(t-1) + square u(t-1)^2 + cube u(t-1)^3 + e(t), e about normal with a standard deviation of
/// 0.05.
fn log(rows: usize, seed: u64, square: f64, cube: f64) -> Log {
    let mut noise = Noise(seed);
    let u = noise.take(rows);
    let mut y = vec![0.0];
    for t in 1..rows {
        let x = u[t - 1];
        let e: f64 = noise.take(12).iter().sum();
        y.push(0.5 * y[t - 1] + x + square * x * x + cube * x * x * x + 0.025 * e);
    }
    Log::new(vec![channel("u", u), channel("y", y)], 1.0).unwrap()
}

fn plan() -> NonlinearArxPlan {
    NonlinearArxPlan::new(&["u"], &["y"])
}

fn model(report: &Report) -> &NonlinearArxModel {
    let Model::NonlinearArx(model) = &report.model else { panic!("other kind") };
    model
}

#[test]
fn the_true_terms_are_found() {
    let plan = NonlinearArxPlan { raw_terms: true, detrend: Detrend::None, terms: Some(3), ..plan() };
    let report = fit_nonlinear_arx(&log(2000, 3, 0.4, 0.0), &[], &plan).unwrap();
    let mut terms: Vec<(&str, f64)> =
        report.model.parameters().iter().map(|one| (one.name.as_str(), one.value)).collect();
    terms.sort_by(|one, other| one.0.cmp(other.0));
    let names: Vec<&str> = terms.iter().map(|one| one.0).collect();
    assert_eq!(names, ["u(k-1)", "u(k-1)^2", "y(k-1)"]);
    for ((_, value), truth) in terms.iter().zip([1.0, 0.4, 0.5]) {
        assert!((value - truth).abs() < 0.02, "{terms:?}");
    }
    let outcome = &report.estimation.procedure.terms()[0];
    let sum: f64 = outcome.path.iter().map(|step| step.error_reduction).sum();
    assert!(sum < 1.0 && sum > 0.98, "{sum}");
    assert_eq!((outcome.candidates, outcome.selected_by.as_str()), (15, "given"));
}

#[test]
fn a_polynomial_of_degree_one_is_an_arx_model() {
    let log = log(500, 5, 0.0, 0.0);
    let nonlinear = NonlinearArxPlan { map: MapPlan::Polynomial { degree: 1 }, terms: Some(5), ..plan() };
    let nonlinear = fit_nonlinear_arx(&log, &[], &nonlinear).unwrap();
    let orders = Orders::arx(2, &[2], &[1]).unwrap();
    let arx = Plan { constant: Constant::Yes, ..Plan::new(&["u"], "y", orders) };
    let arx = identify(log.clone(), &[], &arx).unwrap();
    // The offset that ARX estimates is the constant here.
    assert!((nonlinear.estimation.mse / arx.estimation.mse - 1.0).abs() < 1e-3);
    let own = model(&nonlinear);
    let value = |name: &str| own.parameters.iter().find(|one| one.name == name).unwrap().value;
    let error =
        |name: &str| own.parameters.iter().find(|one| one.name == name).unwrap().standard_error.unwrap();
    let scale = own.regressors[2].scale / own.maps[0].scale;
    let (a1, b1) = (&arx.model.parameters()[0], &arx.model.parameters()[2]);
    assert!((value("y(k-1)") + a1.value).abs() < 1e-3);
    assert!((value("u(k-1)") / scale - b1.value).abs() < 1e-3);
    assert!((error("y(k-1)") / a1.standard_error.unwrap() - 1.0).abs() < 0.02);

    // Predictions, deviations and free runs are those of the linear model.
    let rows = [Rows::new(1, 500).unwrap()];
    let signals = |report: &Report| {
        let whole = report.model.inputs().iter().chain(report.model.outputs());
        let deviations = log.deviations(whole.map(|signal| (signal.name.as_str(), signal.offset))).unwrap();
        let offset = report.model.outputs()[0].offset.level;
        let on_log = report.model.on_log(&deviations, &rows, None, &[]).unwrap();
        let said = |horizon| -> Vec<f64> {
            let response = on_log.respond(horizon, InitialCondition::Drop).unwrap().remove(0);
            response.values.iter().map(|value| value + offset).collect()
        };
        let deviations = |steps| on_log.deviations(steps, InitialCondition::Drop).unwrap().remove(0);
        (said(Horizon::Steps { steps: 4 }), said(Horizon::FreeRun), deviations(1), deviations(4))
    };
    let (one, other) = (signals(&nonlinear), signals(&arx));
    for t in 100..500 {
        assert!((one.0[t] - other.0[t]).abs() < 1e-2, "{t}: {} {}", one.0[t], other.0[t]);
        assert!((one.1[t] - other.1[t]).abs() < 1e-2, "{t}: {} {}", one.1[t], other.1[t]);
        assert!((one.2[t] / other.2[t] - 1.0).abs() < 0.01, "{t}: {} {}", one.2[t], other.2[t]);
        assert!((one.3[t] / other.3[t] - 1.0).abs() < 0.01, "{t}: {} {}", one.3[t], other.3[t]);
    }
}

#[test]
fn deviations_of_a_nonlinear_model_cover_fresh_samples() {
    let (fit, fresh) = (log(300, 7, 0.3, 0.0), log(2000, 8, 0.3, 0.0));
    let plan = NonlinearArxPlan { terms: Some(4), ..plan() };
    let report = fit_nonlinear_arx(&fit, &[], &plan).unwrap();
    let look = ValidationPlan { horizons: vec![1, 5], ..ValidationPlan::default() };
    let found = validate(&report, None, &fresh, &[], &look).unwrap().validation;
    for one in &found.coverage {
        let (held, level) = (one.actual.unwrap(), one.level);
        assert!((held - level).abs() < 0.04, "{} steps, {level}: {held}", one.steps);
    }
}

#[test]
fn the_number_of_terms_is_chosen_by_the_free_run() {
    let log = log(1000, 11, 0.4, 0.1);
    let split = NonlinearArxPlan { split: Some("60/20/20".parse().unwrap()), ..plan() };
    let validate = NonlinearArxPlan {
        estimate: vec![Rows::new(1, 600).unwrap()],
        validate: vec![Rows::new(601, 1000).unwrap()],
        map: MapPlan::Polynomial { degree: 3 },
        ..plan()
    };
    let mdl = NonlinearArxPlan { select: Some(Select::MDL), ..plan() };
    for (plan, by) in [(plan(), "cv"), (split, "validation"), (validate, "validation"), (mdl, "mdl")] {
        let report = fit_nonlinear_arx(&log, &[], &plan).unwrap();
        let outcome = &report.estimation.procedure.terms()[0];
        assert_eq!(outcome.selected_by, by);
        let taken = report.model.parameters().len();
        assert!((3..=15).contains(&taken), "{by}: {taken}");
        if by != "mdl" {
            let rank = |step: &crate::estimate::TermStep| {
                step.held_out
                    .map_or((true, f64::INFINITY), |run| (!run.in_range, run.rmse.unwrap_or(f64::INFINITY)))
            };
            let own = rank(&outcome.path[taken - 1]);
            assert!(outcome.path.iter().map(rank).all(|other| own <= other), "{by}");
        }
        for fit in &report.fit {
            assert!(fit.percent.unwrap() > 85.0, "{by}: {fit:?}");
        }
        let json = report.to_json().unwrap();
        assert_eq!(Report::from_json(&json).unwrap(), report);
    }
}

#[test]
fn radial_functions_approach_what_polynomials_do() {
    let log = log(800, 13, 0.4, 0.0);
    let radial = |centres, linear| NonlinearArxPlan {
        map: MapPlan::Radial { centres, width: None, linear },
        estimate: vec![Rows::new(1, 500).unwrap()],
        validate: vec![Rows::new(501, 800).unwrap()],
        output_lags: vec![1],
        input_lags: vec![InputLags { lags: 1, delay: 1 }],
        ..plan()
    };
    for (centres, linear, count) in [
        (Centres::Chosen, true, 4..=40),
        (Centres::Chosen, false, 4..=40),
        (Centres::Clusters { count: 12, seed: 0 }, true, 15..=15),
        (Centres::Grid { each: 4 }, true, 19..=19),
        (Centres::Grid { each: 4 }, false, 16..=16),
        (Centres::Random { count: 15, seed: 1 }, true, 18..=18),
    ] {
        let report = fit_nonlinear_arx(&log, &[], &radial(centres, linear)).unwrap();
        assert!(count.contains(&report.model.parameters().len()), "{centres:?}");
        let free = report
            .fit
            .iter()
            .find(|fit| fit.part == Some(Part::Validation) && fit.horizon == Horizon::FreeRun);
        assert!(free.unwrap().percent.unwrap() > 85.0, "{centres:?}: {:?}", free.unwrap().percent);
    }
}

/// Billings and Voon's tests see what is missing, and only that.
#[test]
fn nonlinear_terms_are_seen_in_residuals() {
    let rejected = |square: f64, cube: f64, nonlinear: bool, runs: u64| -> [usize; 2] {
        let mut counts = [0; 2];
        for seed in 0..runs {
            let log = log(2000, 100 + seed, square, cube);
            let report = if nonlinear {
                fit_nonlinear_arx(
                    &log,
                    &[],
                    &NonlinearArxPlan { terms: Some(8), map: MapPlan::Polynomial { degree: 3 }, ..plan() },
                )
            } else {
                identify(log.clone(), &[], &Plan::new(&["u"], "y", Orders::arx(1, &[1], &[1]).unwrap()))
            };
            let found =
                validate(&report.unwrap(), None, &log, &[], &ValidationPlan::default()).unwrap().validation;
            let below = |test: &crate::validate::Test| usize::from(test.p_value.unwrap() < 0.05);
            counts[0] += below(&found.nonlinear[0].errors);
            counts[1] += below(&found.nonlinear[0].squares);
        }
        counts
    };
    assert_eq!(rejected(0.2, 0.0, false, 10), [10, 10]);
    assert_eq!(rejected(0.0, 0.6, false, 10)[1], 10);
    let [errors, squares] = rejected(0.2, 0.2, true, 100);
    assert!((0..=10).contains(&errors) && (0..=10).contains(&squares), "{errors} {squares}");
}

#[test]
fn free_runs_that_grow_have_no_figure() {
    // y(t) = 1.5 y(t-1) - 0.5 y(t-1)^3 + u(t-1): fits one step ahead, but a product too much lets it run away.
    let log = log(300, 17, 0.4, 0.0);
    let plan = NonlinearArxPlan { terms: Some(4), ..plan() };
    let mut report = fit_nonlinear_arx(&log, &[], &plan).unwrap();
    let Model::NonlinearArx(model) = &mut report.model else { panic!("other kind") };
    model.parameters.iter_mut().for_each(|parameter| parameter.value *= 10.0);
    let found = validate(&report, None, &log, &[], &ValidationPlan::default()).unwrap().validation;
    let free = found.fit.iter().find(|fit| fit.horizon == Horizon::FreeRun).unwrap();
    assert_eq!((free.percent, free.rmse), (None, None));
    assert!(found.warnings.iter().any(|warning| warning.contains("overflows")), "{:?}", found.warnings);
}

#[test]
fn what_cannot_be_is_refused() {
    let refused = |log: &Log, plan: NonlinearArxPlan, what: &str| {
        assert_refused(fit_nonlinear_arx(log, &[], &plan), what);
    };
    let good = log(100, 1, 0.4, 0.0);
    refused(&good, NonlinearArxPlan { map: MapPlan::Polynomial { degree: 0 }, ..plan() }, "degree");
    refused(&good, NonlinearArxPlan { map: MapPlan::Polynomial { degree: 40 }, ..plan() }, "highest degree");
    let many = NonlinearArxPlan { output_lags: vec![40], map: MapPlan::Polynomial { degree: 6 }, ..plan() };
    refused(&good, many, "too many terms");
    refused(&good, NonlinearArxPlan { terms: Some(0), ..plan() }, "one function at least");
    refused(&good, NonlinearArxPlan { ridge: Some(-1.0), ..plan() }, "ridge");
    refused(
        &good,
        NonlinearArxPlan {
            output_lags: vec![0],
            input_lags: vec![InputLags { lags: 0, delay: 1 }],
            ..plan()
        },
        "reads nothing",
    );
    refused(&good, NonlinearArxPlan { output_lags: vec![5000], ..plan() }, "lags above");
    refused(&good, NonlinearArxPlan { select: Some(Select::Validation), ..plan() }, "validation");
    refused(&good, NonlinearArxPlan { estimate: vec![Rows::new(1, 3).unwrap()], ..plan() }, "rows");
    let radial =
        |centres| NonlinearArxPlan { map: MapPlan::Radial { centres, width: None, linear: true }, ..plan() };
    refused(&good, radial(Centres::Grid { each: 1000 }), "centres");
    refused(&good, radial(Centres::Clusters { count: 0, seed: 0 }), "centres");
    let constant = Log::new(vec![channel("u", vec![1.0; 50]), channel("y", vec![2.0; 50])], 1.0).unwrap();
    refused(&constant, plan(), "is constant");
    let missing = Log::new(vec![channel("u", vec![f64::NAN; 50]), channel("y", vec![2.0; 50])], 1.0).unwrap();
    refused(&missing, plan(), "value in every channel");
    let huge: Vec<f64> = (0..50).map(|t| 1e200 * f64::from(t % 7)).collect();
    let huge = Log::new(vec![channel("u", huge.clone()), channel("y", huge)], 1.0).unwrap();
    refused(&huge, NonlinearArxPlan { raw_terms: true, ..plan() }, "range of numbers");

    // An input of two levels: its square is a multiple of 1 or of itself.
    let levels: Vec<f64> = (0..60).map(|t| f64::from(t * t % 7 % 2)).collect();
    let mut y = vec![0.0];
    (1..60).for_each(|t| y.push(0.5 * y[t - 1] + levels[t - 1] + 0.01 * ((t * 7 % 11) as f64)));
    let two = Log::new(vec![channel("u", levels), channel("y", y)], 1.0).unwrap();
    let report = fit_nonlinear_arx(
        &two,
        &[],
        &NonlinearArxPlan { terms: Some(5), raw_terms: true, detrend: Detrend::None, ..plan() },
    )
    .unwrap();
    assert!(
        report.warnings.iter().any(|warning| warning.contains("cannot be told")),
        "{:?}",
        report.warnings
    );
    assert!(
        report.model.parameters().iter().all(|one| one.name != "u(k-1)^2"),
        "the lower degree is preferred"
    );
}
