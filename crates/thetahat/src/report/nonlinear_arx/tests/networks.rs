//! Trained maps: networks, free radial basis functions, and the choice among all.

use thetahat_numerics::random::Random;

use super::*;
use crate::Document;
use crate::model::Activation;
use crate::report::fit_nonlinear_arx_monitored;
use crate::respond::nonlinear_arx::NonlinearArxOnLog;
use crate::respond::{InitialCondition, OnLog};

/// y(k) = 0.8 y(k-1) + 0.4 tanh(1.5 u(k-1) - 0.5 y(k-1)) + e(k) in units of `scale`; a line without the tanh.
fn plant(rows: usize, scale: f64, is_line: bool, noise: f64) -> Log {
    let mut random = Random::of(3, 1);
    let (mut u, mut y) = (vec![0.0; rows], vec![0.0; rows]);
    for k in 1..rows {
        u[k] = if k % 9 == 0 { random.normal() } else { u[k - 1] };
        let drive = 1.5 * u[k - 1] - 0.5 * y[k - 1];
        let drive = if is_line { 0.5 * drive } else { drive.tanh() };
        y[k] = 0.8 * y[k - 1] + 0.4 * drive + noise * random.normal();
    }
    y.iter_mut().for_each(|y| *y = 20.0 + scale * *y);
    Log::new(vec![channel("u", u), channel("y", y)], 1.0).unwrap()
}

fn network(activation: Activation, units: Option<usize>) -> MapPlan {
    MapPlan::Network { activation, units, drawn: false }
}

fn trained(map: MapPlan) -> NonlinearArxPlan {
    NonlinearArxPlan { map, ..NonlinearArxPlan::new(&["u"], &["y"]) }
}

fn free_run(report: &Report, part: Part) -> f64 {
    let own = report.fit.iter().find(|fit| fit.part == Some(part) && fit.horizon == Horizon::FreeRun);
    own.unwrap().percent.unwrap()
}

#[test]
fn every_trained_map_runs_better_than_a_line() {
    let log = plant(900, 1.0, false, 0.01);
    let rows = |plan: NonlinearArxPlan| NonlinearArxPlan {
        estimate: vec![Rows::new(1, 600).unwrap()],
        validate: vec![Rows::new(601, 900).unwrap()],
        ..plan
    };
    let line = fit_nonlinear_arx(&log, &[], &rows(trained(MapPlan::Polynomial { degree: 1 }))).unwrap();
    let line = free_run(&line, Part::Validation);
    for map in [
        network(Activation::Tanh, Some(2)),
        network(Activation::Logistic, Some(2)),
        network(Activation::Relu, Some(4)),
        MapPlan::FreeRadial { units: Some(3) },
    ] {
        let plan = rows(NonlinearArxPlan { ridge: Some(0.01), ..trained(map.clone()) });
        let report = fit_nonlinear_arx(&log, &[], &plan).unwrap();
        let fit = free_run(&report, Part::Validation);
        // A line leaves 10 % and more.
        assert!(fit > 94.0 && fit > line + 4.0, "{map:?}: {fit} {line}");
        let outcome = &report.estimation.procedure.terms()[0];
        let training = outcome.training.as_ref().unwrap();
        assert_eq!((training.horizon, training.starts.len()), (Horizon::FreeRun, 5));
        let again = Report::from_json(&report.to_json().unwrap()).unwrap();
        assert_eq!(again, report);
    }
}

#[test]
fn without_rows_to_hold_out_the_last_ones_are() {
    let log = plant(800, 1.0, false, 0.02);
    let report = fit_nonlinear_arx(&log, &[], &trained(network(Activation::Tanh, None))).unwrap();
    let outcome = &report.estimation.procedure.terms()[0];
    // Three sizes, two ridges.
    assert_eq!((outcome.selected_by.as_str(), outcome.path.len()), ("validation", 6));
    let parts = report.data.split.as_ref().unwrap();
    assert_eq!(parts.validation, [Rows::new(561, 800).unwrap()]);
    assert!(outcome.path.iter().all(|step| step.held_out.is_some()));
    // The chosen one is trained on all rows, and from where it was, too.
    assert_eq!(outcome.training.as_ref().unwrap().starts.len(), 6);
    assert_eq!(report.estimation.samples, 798);
}

#[test]
fn units_and_threads_are_no_matter() {
    let fit = |scale: f64| {
        let plan = NonlinearArxPlan { ridge: Some(0.1), ..trained(network(Activation::Tanh, Some(2))) };
        fit_nonlinear_arx(&plant(500, scale, false, 0.02), &[], &plan).unwrap()
    };
    let (one, large) = (fit(1.0), fit(1e6));
    let values = |report: &Report| -> Vec<f64> {
        report.model.parameters().iter().map(|parameter| parameter.value).collect()
    };
    for (one, large) in values(&one).iter().zip(values(&large)) {
        assert!((one - large).abs() < 1e-5 * one.abs().max(1.0), "{one} {large}");
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(pool.install(|| fit(1.0)).to_json().unwrap(), one.to_json().unwrap());
}

#[test]
fn auto_takes_a_linear_model_where_it_is_as_good_and_a_network_where_it_is_not() {
    let fit = |is_line, lags_chosen| {
        let plan = NonlinearArxPlan { lags_chosen, ..trained(MapPlan::Auto) };
        fit_nonlinear_arx(&plant(900, 1.0, is_line, 0.01), &[], &plan).unwrap()
    };
    for lags_chosen in [false, true] {
        let report = fit(true, lags_chosen);
        assert!(matches!(report.model, Model::Polynomial(_)), "{}", report.model.name());
        assert!(
            report.selection.unwrap().steps.last().unwrap().contains("the error of none is clearly smaller")
        );
    }
    for lags_chosen in [false, true] {
        let report = fit(false, lags_chosen);
        let outcome = &report.estimation.procedure.terms()[0];
        assert!(outcome.last().unwrap().term.contains("tanh"), "{:?}", outcome.last());
        assert!(outcome.path[0].term.starts_with("linear: "), "{}", outcome.path[0].term);
        assert_eq!(outcome.candidates, outcome.path.len());
    }
}

#[test]
fn parameters_of_products_are_trained_for_free_runs() {
    let log = plant(600, 1.0, false, 0.05);
    let fit = |focus| {
        let plan = NonlinearArxPlan { terms: Some(6), focus, ..trained(MapPlan::Polynomial { degree: 3 }) };
        fit_nonlinear_arx(&log, &[], &plan).unwrap()
    };
    let (ahead, run) = (fit(None), fit(Some(Horizon::FreeRun)));
    assert!(free_run(&run, Part::Estimation) > free_run(&ahead, Part::Estimation));
    assert!(run.estimation.mse > ahead.estimation.mse);
    assert!(ahead.estimation.procedure.terms()[0].training.is_none());
}

#[test]
fn intervals_one_step_ahead_hold_the_output() {
    let log = plant(1500, 1.0, false, 0.05);
    let plan = NonlinearArxPlan {
        estimate: vec![Rows::new(1, 500).unwrap()],
        ridge: Some(0.01),
        focus: Some(Horizon::Steps { steps: 1 }),
        ..trained(network(Activation::Tanh, Some(2)))
    };
    let report = fit_nonlinear_arx(&log, &[], &plan).unwrap();
    let Model::NonlinearArx(model) = &report.model else { panic!("{:?}", report.model) };
    let offsets = [("u", model.inputs[0].offset), ("y", model.outputs[0].offset)];
    let deviations = log.deviations(offsets.into_iter()).unwrap();
    let on_log = NonlinearArxOnLog::new(model, &deviations, &[Rows::new(501, 1500).unwrap()]).unwrap();
    let said = on_log.respond(Horizon::Steps { steps: 1 }, InitialCondition::Drop).unwrap();
    let spread = on_log.deviations(1, InitialCondition::Drop).unwrap();
    let (quantile, measured) = (on_log.quantile(0.95), on_log.measured(0));
    let held = (500..1500).filter(|t| (measured[*t] - said[0].values[*t]).abs() < quantile * spread[0][*t]);
    let share = held.count() as f64 / 1000.0;
    assert!((0.93..=0.97).contains(&share), "{share}");
}

#[test]
fn intervals_of_longer_runs_are_measured_on_held_out_rows() {
    // Noise of the sensor, which does not drive the plant: what the noise along a run would do is too much.
    let mut random = Random::of(8, 2);
    let mut log = plant(3000, 1.0, false, 0.0);
    let noisy: Vec<f64> =
        log.channel("y").unwrap().values.iter().map(|y| y + 0.1 * random.normal()).collect();
    let u = log.channel("u").unwrap().clone();
    log = Log::new(vec![u, channel("y", noisy)], 1.0).unwrap();
    let plan = NonlinearArxPlan {
        estimate: vec![Rows::new(1, 600).unwrap()],
        validate: vec![Rows::new(601, 1000).unwrap()],
        ridge: Some(0.01),
        ..trained(network(Activation::Tanh, Some(2)))
    };
    let report = fit_nonlinear_arx(&log, &[], &plan).unwrap();
    let without =
        fit_nonlinear_arx(&log, &[], &NonlinearArxPlan { validate: Vec::new(), ..plan.clone() }).unwrap();
    // What holds the output on rows that neither saw, and how wide it is in the mean.
    let held = |report: &Report, steps: usize| {
        let Model::NonlinearArx(model) = &report.model else { panic!("{:?}", report.model) };
        let offsets = [("u", model.inputs[0].offset), ("y", model.outputs[0].offset)];
        let deviations = log.deviations(offsets.into_iter()).unwrap();
        let on_log = NonlinearArxOnLog::new(model, &deviations, &[Rows::new(1101, 3000).unwrap()]).unwrap();
        let said = on_log.respond(Horizon::Steps { steps }, InitialCondition::Drop).unwrap();
        let spread = on_log.deviations(steps, InitialCondition::Drop).unwrap();
        let (quantile, measured) = (on_log.quantile(0.95), on_log.measured(0));
        let is_held = |t: &usize| (measured[*t] - said[0].values[*t]).abs() < quantile * spread[0][*t];
        let share = (1300..3000).filter(is_held).count() as f64 / 1700.0;
        (share, (1300..3000).map(|t| spread[0][t]).sum::<f64>() / 1700.0)
    };
    let Model::NonlinearArx(model) = &report.model else { panic!("{:?}", report.model) };
    let steps: Vec<usize> = model.maps[0].run_errors.iter().map(|error| error.steps).collect();
    assert_eq!(steps, [1, 2, 5, 10, 20, 50, 100, 200, 500]);
    for steps in [2, 5, 20, 70, 150] {
        let ((share, width), (_, other)) = (held(&report, steps), held(&without, steps));
        assert!((0.92..=0.97).contains(&share), "{steps}: {share}");
        assert!(steps < 20 || width < 0.9 * other, "{steps}: {width} {other}");
    }
    // Of a free run they grow with the time since it began, and without held-out rows there are none.
    fn beside<'l>(report: &'l Report, log: &'l Log) -> NonlinearArxOnLog<'l> {
        let Model::NonlinearArx(model) = &report.model else { panic!("{:?}", report.model) };
        NonlinearArxOnLog::new(model, log, &[Rows::new(1101, 3000).unwrap()]).unwrap()
    }
    let run = beside(&report, &log).run_deviations(InitialCondition::Drop).unwrap().remove(0);
    let first = run.iter().position(|deviation| !deviation.is_nan()).unwrap();
    for (after, steps) in [(0, 1), (1, 2), (30, 31), (1500, 1501)] {
        assert_eq!(Some(run[first + after]), model.maps[0].run_error(steps));
    }
    assert!(beside(&without, &log).run_deviations(InitialCondition::Drop).is_none());
    let damaged = report.to_json().unwrap().replace("\"steps\": 5,", "\"steps\": 0,");
    assert_refused(Report::from_json(&damaged), "run_errors");
}

#[test]
fn drawn_units_are_chosen() {
    let log = plant(600, 1.0, false, 0.02);
    for (activation, drawn) in [(Activation::Step, true), (Activation::Tanh, true), (Activation::Step, false)]
    {
        let map = MapPlan::Network { activation, units: Some(50), drawn };
        let report =
            fit_nonlinear_arx(&log, &[], &NonlinearArxPlan { terms: Some(8), ..trained(map) }).unwrap();
        let outcome = &report.estimation.procedure.terms()[0];
        // A constant, four lags, and three units of fifty.
        assert_eq!((outcome.candidates, outcome.taken), (55, 8));
        assert_eq!(report.model.name(), format!("NARX {} network, 3 units", activation.word()));
        assert!(report.model.parameters().iter().all(|parameter| parameter.standard_error.is_some()));
    }
}

#[test]
fn what_cannot_be_trained_is_refused() {
    let log = plant(200, 1.0, false, 0.02);
    let tanh = || trained(network(Activation::Tanh, Some(2)));
    let refused = |log: &Log, plan: NonlinearArxPlan, words: &str| {
        assert_refused(fit_nonlinear_arx(log, &[], &plan), words);
    };
    refused(&log, trained(network(Activation::Tanh, Some(0))), "units");
    refused(&log, trained(network(Activation::Tanh, Some(3000))), "units");
    refused(&log, NonlinearArxPlan { terms: Some(3), ..tanh() }, "units");
    refused(&log, NonlinearArxPlan { select: Some(Select::Cv), ..tanh() }, "held out");
    refused(&log, NonlinearArxPlan { focus: Some(Horizon::Steps { steps: 0 }), ..tanh() }, "0 steps");
    refused(&log, trained(network(Activation::Tanh, Some(60))), "numbers are trained");
    // Products that are given are not chosen: there may be more than samples.
    let few = plant(8, 1.0, false, 0.1);
    let terms = ["1", "y(k-1)", "y(k-2)", "u(k-1)", "u(k-2)", "y(k-1)^2"].map(str::to_owned).to_vec();
    let products = NonlinearArxPlan { focus: Some(Horizon::FreeRun), ..trained(MapPlan::Products { terms }) };
    assert!(fit_nonlinear_arx(&few, &[], &products).is_err());
    refused(
        &log,
        NonlinearArxPlan { expressions: vec!["sqrt(y)".to_owned()], ..tanh() },
        "expressions of an output",
    );
    let knn = MapPlan::Neighbours { planes: true, units: Some(5) };
    refused(&log, NonlinearArxPlan { focus: Some(Horizon::FreeRun), ..trained(knn) }, "neighbours");
    let stopped = fit_nonlinear_arx_monitored(&log, &[], &tanh(), &|_| std::ops::ControlFlow::Break(()));
    assert_eq!(stopped, Err(Error::Interrupted));
}
