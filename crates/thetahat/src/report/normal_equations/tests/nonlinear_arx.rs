//! Nonlinear ARX models of products that are named.

use super::*;
use crate::model::Model;
use crate::report::{InputLags, MapPlan, fit_nonlinear_arx};
use crate::select::Select;

/// One input, and an output that is far from zero.
fn log(rows: usize, [level, base, unit]: [f64; 3]) -> Log {
    let (u, e) = (noise(rows, 1), noise(rows, 3));
    let mut y = vec![0.0; rows];
    for t in 2..rows {
        let v = u[t - 1];
        y[t] = 0.6 * y[t - 1] - 0.1 * y[t - 2] + v + 0.5 * v * v - 0.2 * y[t - 1] * v + 0.05 * e[t];
    }
    let u: Vec<f64> = u.iter().map(|u| base + unit * u).collect();
    Log::new(vec![channel("u", u), channel("y", y.iter().map(|y| level + y).collect::<Vec<_>>())], 0.5)
        .unwrap()
}

fn plan() -> NonlinearArxPlan {
    let terms = ["1", "y(k-1)", "y(k-2)", "u(k-1)", "u(k-1)^2", "y(k-1)*u(k-1)", "y(k-1)*u(k-2)^2"];
    NonlinearArxPlan {
        map: MapPlan::Products { terms: terms.iter().map(|term| (*term).to_owned()).collect() },
        ..NonlinearArxPlan::new(&["u"], &["y"])
    }
}

fn pieces(log: &Log, plan: &NonlinearArxPlan, boundaries: &[usize]) -> Vec<NormalEquations> {
    let made =
        |(part, past): &(Log, usize)| NormalEquations::of_nonlinear_arx(part, &[], plan, *past).unwrap();
    parts(log, plan.lags(), boundaries).iter().map(made).collect()
}

/// Everything that a fit says of the model, to so many digits.
fn assert_same(found: &Report, expected: &Report, digits: f64) {
    let close = |what: &str, a: f64, b: f64, scale: f64| {
        assert!((a - b).abs() <= digits * scale, "{what}: {a} and {b}, {:e}", (a - b).abs() / scale);
    };
    let model = |report: &Report| match &report.model {
        Model::NonlinearArx(model) => (**model).clone(),
        other => panic!("{}", other.name()),
    };
    let (one, other) = (model(found), model(expected));
    assert_eq!(one.parameters.len(), other.parameters.len());
    for (a, b) in one.parameters.iter().zip(&other.parameters) {
        let error = b.standard_error.unwrap();
        assert_eq!(a.name, b.name);
        close(&b.name, a.value, b.value, b.value.abs().max(error));
        close(&b.name, a.standard_error.unwrap(), error, error);
    }
    let variance = other.noise_covariance[0][0];
    close("variance", one.noise_covariance[0][0], variance, variance);
    for (a, b) in one.signals().zip(other.signals()) {
        close(&b.name, a.offset.level, b.offset.level, b.offset.level.abs().max(1.0));
    }
    for (a, b) in one.regressors.iter().zip(&other.regressors) {
        assert_eq!((&a.channel, a.lag), (&b.channel, b.lag));
        close("scale", a.scale, b.scale, b.scale);
        (0..2).for_each(|end| close("range", a.range[end], b.range[end], b.range[end].abs() * 10.0));
    }
    close("scale", one.maps[0].scale, other.maps[0].scale, other.maps[0].scale);
    assert_eq!(one.degrees_of_freedom, other.degrees_of_freedom);
    let path = |report: &Report| report.estimation.procedure.terms()[0].path.clone();
    for (a, b) in path(found).iter().zip(&path(expected)) {
        assert_eq!((&a.term, a.parameters), (&b.term, b.parameters));
        close("part", a.error_reduction, b.error_reduction, 10.0);
        close("rmse", a.rmse, b.rmse, 100.0 * b.rmse);
    }
    let condition = |report: &Report| report.estimation.condition.unwrap();
    close("condition", condition(found), condition(expected), 1e9 * condition(expected));
    let figures = |report: &Report| {
        let one = report.fit.iter().find(|fit| fit.horizon == Horizon::ONE_STEP).unwrap();
        (one.samples, one.percent.unwrap(), one.rmse.unwrap())
    };
    let (a, b) = (figures(found), figures(expected));
    assert_eq!(a.0, b.0);
    close("fit", a.1, b.1, 100.0);
    close("rmse", a.2, b.2, b.2);
    assert_eq!(found.data.missing, expected.data.missing);
    assert_eq!(found.data.time_gaps, expected.data.time_gaps);
}

#[test]
fn pieces_of_a_log_give_the_model_of_the_log() {
    let boundaries = [0, 4, 5, 300, 1111, 1113, 1990, 2000];
    let expression = NonlinearArxPlan {
        expressions: vec!["sqrt(abs(u - 7))".into()],
        map: MapPlan::Products {
            terms: ["y(k-1)", "sqrt(abs(u - 7))(k-1)^2", "1"].iter().map(|term| (*term).to_owned()).collect(),
        },
        ..plan()
    };
    for (size, digits) in [([0.0, 0.0, 1.0], 1e-12), ([20.0, -5.0, 3.0], 1e-12), ([1e6, 1e3, 1e-4], 1e-8)] {
        let log = log(2000, size);
        for plan in [plan(), NonlinearArxPlan { raw_terms: true, ..plan() }, expression.clone()] {
            let whole = fit_nonlinear_arx(&log, &[], &plan).unwrap();
            let pieces = pieces(&log, &plan, &boundaries);
            let all = merged(&pieces);
            assert_eq!((all.rows(), all.pieces(), all.samples()), (2000, 7, whole.estimation.samples));
            assert_same(&all.solve().unwrap(), &whole, digits);
            let tree = merged(&pieces.chunks(2).map(merged).collect::<Vec<_>>());
            assert_same(&tree.solve().unwrap(), &all.solve().unwrap(), 1e-12_f64.max(digits / 100.0));
        }
    }
    // Chosen by what they explain, as many as are asked for or as have the least of a criterion.
    let by =
        |terms, select| NonlinearArxPlan { map: MapPlan::Polynomial { degree: 3 }, terms, select, ..plan() };
    let log = log(2000, [20.0, -5.0, 3.0]);
    for plan in [by(Some(5), None), by(None, Some(Select::MDL))] {
        let whole = fit_nonlinear_arx(&log, &[], &plan).unwrap();
        let all = merged(&pieces(&log, &plan, &boundaries));
        assert_same(&all.solve().unwrap(), &whole, 1e-12);
        assert_eq!(NormalEquations::from_json(&all.to_json().unwrap()).unwrap(), all);
        assert_eq!(all.name(), "NARX polynomial of degree 3");
        let outcome = |report: &Report| {
            let terms = &report.estimation.procedure.terms()[0];
            (terms.taken, terms.candidates, terms.selected_by.clone(), terms.path.len())
        };
        assert_eq!(outcome(&all.solve().unwrap()), outcome(&whole));
    }
    // Offsets that are told, with means that are far from them.
    let told = NonlinearArxPlan { offsets: vec![("u".into(), -4.0), ("y".into(), 20.5)], ..plan() };
    for plan in [told, NonlinearArxPlan { detrend: Detrend::None, ..plan() }] {
        let whole = fit_nonlinear_arx(&log, &[], &plan).unwrap();
        let found = merged(&pieces(&log, &plan, &boundaries)).solve().unwrap();
        assert_same(&found, &whole, 1e-15 * whole.estimation.condition.unwrap().powi(2).max(1e3));
    }
}

#[test]
fn missing_values_gaps_and_experiments_are_what_they_are() {
    let mut channels = log(1500, [3.0, 1.0, 1.0]).channels().to_vec();
    for (channel, row) in [(1, 299), (1, 300), (0, 301), (1, 704), (0, 1199), (1, 0), (1, 1499)] {
        channels[channel].values[row] = f64::NAN;
    }
    // A piece in which nothing was measured.
    channels[1].values[1200..1250].fill(f64::NAN);
    let time =
        |t: usize| 0.5 * t as f64 + if t >= 900 { 30.0 } else { 0.0 } + if t >= 1000 { 7.0 } else { 0.0 };
    let values = Log::with_time(channels, (0..1500).map(time).collect()).unwrap();
    let whole = fit_nonlinear_arx(&values, &[], &plan()).unwrap();
    let pieces = pieces(&values, &plan(), &[0, 300, 301, 900, 1200, 1250, 1500]);
    assert_same(&merged(&pieces).solve().unwrap(), &whole, 1e-12);
    let mut late = pieces[4].clone();
    late.merge(&pieces[5]).unwrap();
    let mut all = merged(&pieces[..4]);
    all.merge(&late).unwrap();
    assert_same(&all.solve().unwrap(), &whole, 1e-12);

    let whole = log(900, [5.0, 0.0, 1.0]);
    let part = |first, last| whole.part(&["u", "y"], Rows::new(first, last).unwrap()).unwrap();
    let experiments = [part(1, 200), part(250, 500), part(601, 602), part(700, 900)];
    let made = |log: &Log| NormalEquations::of_nonlinear_arx(log, &[], &plan(), 0).unwrap();
    let all = merged(&experiments.iter().map(made).collect::<Vec<_>>());
    let joined = fit_nonlinear_arx(&Log::join(experiments.to_vec()).unwrap(), &[], &plan()).unwrap();
    assert_same(&all.solve().unwrap(), &joined, 1e-12);
}

#[test]
fn documents_are_read_back_and_damaged_ones_refused() {
    let all = merged(&pieces(&log(200, [3.0, 1.0, 1.0]), &plan(), &[0, 100, 200]));
    assert_eq!(all.name(), "NARX polynomial, 7 terms");
    let text = all.to_json().unwrap();
    assert_eq!(NormalEquations::from_json(&text).unwrap(), all);
    for (from, to) in [
        ("\"y(k-1)*u(k-1)\"", "\"y(k-1)*u(k-9)\""),
        ("\"u(k-1)^2\"", "\"u(k-1)^3\""),
        ("\"centres\": [", "\"centres\": [ 0.0,"),
        ("\"output_lags\": [\n      2", "\"output_lags\": [\n      18446744073709551615"),
    ] {
        assert!(text.contains(from), "{from}");
        assert!(NormalEquations::from_json(&text.replacen(from, to, 1)).is_err(), "{to}");
    }
}

#[test]
fn what_makes_no_piece_or_does_not_fit_together_is_refused() {
    let log = log(400, [0.0, 0.0, 1.0]);
    let own = pieces(&log, &plan(), &[0, 100, 200, 300, 400]);
    let part = |first, last| log.part(&["u", "y"], Rows::new(first, last).unwrap()).unwrap();
    let made = |plan: &NonlinearArxPlan| NormalEquations::of_nonlinear_arx(&part(201, 300), &[], plan, 0);
    let mut first = own[0].clone();
    let mut refused = |other: &NormalEquations, what: &str| {
        assert_refused(first.merge(other), what);
        assert_eq!(first, own[0]);
    };
    let products =
        |terms: &[&str]| MapPlan::Products { terms: terms.iter().map(|term| (*term).into()).collect() };
    refused(&own[0], "a piece is given twice: number 1 of the second ones");
    refused(&own[2], "the second pieces do not go on where the first ones end: 'u' is");
    let fewer = NonlinearArxPlan { map: products(&["y(k-1)", "u(k-1)"]), ..plan() };
    refused(
        &made(&fewer).unwrap(),
        "of NARX polynomial, 7 terms, the second ones of NARX polynomial, 2 terms",
    );
    let raw = NonlinearArxPlan { raw_terms: true, ..plan() };
    refused(&made(&raw).unwrap(), "another kernel or other products");
    let linear = Plan::new(&["u"], "y", Orders::arx(2, &[2], &[1]).unwrap());
    refused(
        &NormalEquations::new(&part(201, 300), &[], &linear, 0).unwrap(),
        "the second ones of ARX(2, 2, 1)",
    );

    let refused = |plan: NonlinearArxPlan, what: &str| {
        assert_refused(made(&plan), what);
    };
    refused(
        NonlinearArxPlan { map: MapPlan::Polynomial { degree: 2 }, ..plan() },
        "select: free runs say how many products",
    );
    let many = NonlinearArxPlan { map: MapPlan::Polynomial { degree: 6 }, terms: Some(3), ..plan() };
    let many = NonlinearArxPlan { output_lags: vec![5], ..many };
    refused(many, "the products and their parts are more than 1000");
    refused(NonlinearArxPlan { map: MapPlan::Spline { units: 3 }, ..plan() }, "narx: centres, knots, boxes");
    refused(NonlinearArxPlan { ridge: Some(1.0), ..plan() }, "ridge: normal equations give least squares");
    refused(NonlinearArxPlan { focus: Some(Horizon::FreeRun), ..plan() }, "focus: longer runs read the log");
    refused(NonlinearArxPlan { validate: vec!["1..9".parse().unwrap()], ..plan() }, "all rows of a piece");
    refused(NonlinearArxPlan { detrend: Detrend::Linear, ..plan() }, "give mean or none");
    refused(NonlinearArxPlan { map: products(&["u(k-9)"]), ..plan() }, "u(k-9)");
    let wide = NonlinearArxPlan {
        output_lags: vec![12],
        input_lags: vec![InputLags { lags: 12, delay: 1 }],
        ..plan()
    };
    let all: Vec<String> = (1..=11).map(|lag| format!("y(k-{lag})*u(k-{lag})")).collect();
    refused(
        NonlinearArxPlan { map: products(&[&all.join("*")]), ..wide },
        "the products and their parts are more",
    );
    let both = NonlinearArxPlan { output_lags: vec![1, 1], ..NonlinearArxPlan::new(&[], &["y", "u"]) };
    refused(
        NonlinearArxPlan { map: products(&["y(k-1)"]), ..both },
        "output: pieces make nonlinear models of one",
    );
    let lags = InputLags { lags: 1, delay: 5 };
    let late = NonlinearArxPlan { input_lags: vec![lags], map: products(&["u(k-5)"]), ..plan() };
    assert_refused(
        NormalEquations::of_nonlinear_arx(&part(1, 50), &[], &late, 3),
        "past: 3 rows are fewer than the 5",
    );

    let of = |log: &Log, plan: &NonlinearArxPlan| NormalEquations::of_nonlinear_arx(log, &[], plan, 0);
    let solved = |log: &Log, plan: &NonlinearArxPlan| of(log, plan).unwrap().solve().unwrap_err().to_string();
    assert!(solved(&part(1, 8), &plan()).contains("7 functions need more than 7 samples"));
    let twice = NonlinearArxPlan { map: products(&["u(k-1)", "u(k-2)"]), ..plan() };
    let steady: Vec<f64> = (0..100).map(|t| f64::from(t / 50)).collect();
    let slow = Log::new(vec![channel("u", steady.clone()), channel("y", noise(100, 2))], 0.5).unwrap();
    let square = NonlinearArxPlan { map: products(&["u(k-1)", "u(k-1)^2"]), detrend: Detrend::None, ..twice };
    let error = solved(&slow, &square);
    assert!(error.contains("u(k-1)^2 is a sum of the other functions"), "{error}");
    let still = Log::new(vec![channel("u", vec![1.0; 100]), channel("y", noise(100, 2))], 0.5).unwrap();
    assert!(solved(&still, &plan()).contains("input 'u' is constant over the estimation rows"));
    let huge = vec![
        channel("u", noise(100, 1)),
        channel("y", noise(100, 2).iter().map(|y| y * 1e60).collect::<Vec<_>>()),
    ];
    let cubes = NonlinearArxPlan { map: products(&["y(k-1)^3"]), ..plan() };
    assert_refused(of(&Log::new(huge, 0.5).unwrap(), &cubes), "leave the range of numbers");
}
