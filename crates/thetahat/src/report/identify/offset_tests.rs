//! Constants and trends: what they change, and what they leave.

use thetahat_numerics::noise::Noise;
use thetahat_numerics::optimize::Search;

use super::*;
use crate::Document;
use crate::data::Record;
use crate::estimate::{ConvexFit, estimate};
use crate::model::{Model, PolynomialModel};
use crate::report::Report;
use crate::select::{Automatic, Grid, OrderRange, Path};
use crate::tests::{assert_refused, channel};

fn log(u: &[f64], y: &[f64]) -> Log {
    Log::new(vec![channel("u", u), channel("y", y)], 2.0).unwrap()
}

/// y = B/F u + C/D e with one pole, noise of so much.
fn driven(u: &[f64], size: f64, seed: u64) -> Vec<f64> {
    let mut noise = Noise(seed);
    let (mut x, mut v, mut before) = (0.0, 0.0, 0.0);
    let each = u.iter().map(|u| {
        let value = x;
        x = 0.9 * x + 0.5 * u;
        let e = size * noise.normal();
        v = 0.6 * v + e + 0.4 * before;
        before = e;
        value + v
    });
    each.collect()
}

/// A step test from rest: this many rows each at 0, 40, 10 and 60, the output 0.9 times the one before and 0.05 times
/// the input.
fn step_test(seed: u64, size: f64) -> (Vec<f64>, Vec<f64>) {
    let u: Vec<f64> = [0.0, 40.0, 10.0, 60.0].into_iter().flat_map(|u| vec![u; 40]).collect();
    let mut noise = Noise(seed);
    let mut x = 0.0;
    let y = u.iter().map(|u| {
        let value = x;
        x = 0.9 * x + 0.05 * u;
        300.0 + value + size * noise.normal()
    });
    let y = y.collect();
    (u, y)
}

fn structures() -> Vec<Orders> {
    let all = [
        Orders::arx(2, &[2], &[1]),
        Orders::armax(1, &[1], 1, &[1]),
        Orders::oe(&[1], &[1], &[1]),
        Orders::bj(&[1], 1, 1, &[1], &[1]),
        Orders::new(1, &[1], 0, 1, &[0], &[1]),
        Orders::new(1, &[1], 1, 0, &[1], &[1]),
        Orders::arx(2, &[], &[]),
        Orders::armax(1, &[], 1, &[]),
    ];
    all.map(Result::unwrap).to_vec()
}

fn plan(orders: &Orders) -> Plan {
    let plan = Plan::new(&["u"][..orders.inputs()], "y", orders.clone());
    Plan { constant: Constant::Yes, ..plan }
}

fn fitted(u: &[f64], y: &[f64], plan: &Plan) -> Report {
    identify(log(u, y), &[], plan).unwrap()
}

fn level(report: &Report) -> Quantity {
    report.estimation.level.expect("there is a constant")
}

#[test]
fn what_is_added_to_the_output_changes_its_level_alone() {
    let u = Noise(3).take(400);
    let y = driven(&u, 0.3, 4);
    let raised: Vec<f64> = y.iter().map(|y| y + 20.0).collect();
    // The search stops within sqrt(400 tolerance) standard errors of the least cost.
    let method = Method::PredictionError(Search { tolerance: 1e-12, ..Search::default() });
    for orders in structures() {
        let plan = Plan { detrend: Detrend::None, method: method.clone(), ..plan(&orders) };
        let (low, high) = (fitted(&u, &y, &plan), fitted(&u, &raised, &plan));
        for (low, high) in low.polynomials().parameters.iter().zip(&high.polynomials().parameters) {
            assert!(
                (low.value - high.value).abs() < 2e-4 * low.standard_error.unwrap(),
                "{orders} {low:?} {high:?}"
            );
        }
        let (below, above) = (level(&low), level(&high));
        let error = below.standard_error.unwrap();
        assert!((above.value - below.value - 20.0).abs() < 2e-4 * error, "{orders}");
        assert!((above.standard_error.unwrap() / error - 1.0).abs() < 1e-3, "{orders}");
        assert_eq!(high.polynomials().output.offset.level, above.value);
        assert_eq!(low.polynomials().parameters.len(), orders.parameters());
        assert_eq!(
            (low.polynomials().inputs.len(), low.polynomials().orders.clone()),
            (orders.inputs(), orders)
        );
    }
}

#[test]
fn a_constant_is_an_input_of_ones() {
    let u = Noise(5).take(400);
    let y: Vec<f64> = driven(&u, 0.3, 6).iter().map(|y| y + 1.5).collect();
    let ones = vec![1.0; 400];
    for orders in structures() {
        let report = fitted(&u, &y, &Plan { detrend: Detrend::None, ..plan(&orders) });
        let inputs = [&u[..], &ones];
        let record = Record::new(&y, inputs[1 - orders.inputs()..].to_vec()).unwrap();
        let more = |values: &[usize], last| [values, &[last]].concat();
        let (nb, nf, nk) = (more(&orders.nb, 1), more(&orders.nf, 0), more(&orders.nk, 0));
        let extended = Orders::new(orders.na, &nb, orders.nc, orders.nd, &nf, &nk).unwrap();
        // Zeros before the first sample are no start for A and a level.
        let filtered = orders.nf.iter().any(|&nf| nf > 0);
        let initial = if orders.na > 0 && filtered { Initial::Estimate } else { Initial::Auto };
        let explicit = estimate(&record, &extended, &Method::default(), initial).unwrap();
        let place = orders.na + orders.nb.iter().sum::<usize>();
        let mut expected = explicit.parameters().to_vec();
        let constant = expected.remove(place);
        for (found, expected) in report.polynomials().parameters.iter().zip(&expected) {
            assert!((found.value - expected).abs() < 1e-9, "{orders} {}", found.name);
        }
        let gain: f64 = report.polynomials().a.iter().sum();
        assert!((level(&report).value * gain - constant).abs() < 1e-9, "{orders}");
        assert!((report.polynomials().noise_variance - explicit.noise_variance()).abs() < 1e-9);
        assert_eq!(report.estimation.criteria, explicit.criteria());
    }
}

#[test]
fn the_errors_of_the_fit_are_those_of_the_model() {
    let u = Noise(7).take(300);
    let y: Vec<f64> =
        driven(&u, 0.3, 8).iter().zip(0..).map(|(y, t)| y + 50.0 + 0.02 * f64::from(t)).collect();
    for orders in structures() {
        let filtered = orders.nf.iter().any(|&nf| nf > 0);
        for initial in [Initial::Auto, Initial::Drop, Initial::Zero, Initial::Estimate] {
            let of_others = if filtered { Initial::Drop } else { Initial::Estimate };
            if initial == of_others || initial == Initial::Zero && orders.na > 0 {
                continue;
            }
            for trend in [false, true] {
                let plan = Plan { initial, trend, ..plan(&orders) };
                let report = fitted(&u, &y, &plan);
                let evaluated = report.fit[0].rmse.unwrap().powi(2);
                assert_eq!(report.fit[0].samples, report.estimation.samples);
                assert!(
                    (evaluated / report.estimation.mse - 1.0).abs() < 1e-9,
                    "{orders} {initial:?} {trend}"
                );
                let pending =
                    PendingEvaluation::new(log(&u, &y), &[], &plan, &|_| ControlFlow::Continue(())).unwrap();
                assert_eq!(pending.evaluate(log(&u, &y)).unwrap(), report, "{orders}");
            }
        }
    }
}

#[test]
fn a_step_test_from_rest_comes_out_right() {
    let orders = [Orders::oe(&[1], &[1], &[1]), Orders::bj(&[1], 0, 1, &[1], &[1])];
    for orders in orders.map(Result::unwrap) {
        for seed in 0..5 {
            let (u, y) = step_test(seed, 0.3);
            let report = fitted(&u, &y, &Plan { constant: Constant::Auto, ..plan(&orders) });
            let near = |found: Quantity, truth: f64| {
                (found.value - truth).abs() < 4.0 * found.standard_error.unwrap()
            };
            assert!(near(report.polynomials().dc_gain[0].unwrap(), 0.5), "{orders} {seed}");
            assert!(
                near(report.polynomials().time_constants[0].unwrap(), -2.0 / 0.9_f64.ln()),
                "{orders} {seed}"
            );
            // The inputs' offset is their mean.
            assert!(near(level(&report), 300.0 + 0.5 * 27.5), "{orders} {seed}: {:?}", level(&report));
            // From rest all is known without a constant.
            let plan = Plan { detrend: Detrend::Start(40), ..Plan::new(&["u"], "y", orders.clone()) };
            let from_rest = fitted(&u, &y, &plan);
            assert!(near(from_rest.polynomials().dc_gain[0].unwrap(), 0.5), "{orders} {seed}");
        }
    }
}

#[test]
fn choices_find_the_model_of_a_step_test() {
    let one = |last| OrderRange::new(1, last).unwrap();
    let grid = Grid {
        na: 0.into(),
        nb: vec![1.into()],
        nc: 0.into(),
        nd: 0.into(),
        nf: vec![one(2)],
        nk: vec![one(4)],
        path: Path::All,
    };
    let (u, y) = step_test(20, 0.3);
    let automatic = Automatic { structure: Some(crate::model::Structure::Oe), ..Automatic::default() };
    for choice in [Choice::Grid(grid), Choice::Automatic(automatic)] {
        let report = fitted(&u, &y, &Plan::new(&["u"], "y", choice));
        let gain = report.polynomials().dc_gain[0].unwrap();
        assert!((gain.value - 0.5).abs() < 4.0 * gain.standard_error.unwrap(), "{gain:?}");
        assert_eq!(report.polynomials().inputs.len(), 1);
        let selection = report.selection.as_ref().unwrap();
        assert!(selection.steps.iter().any(|step| step.contains("a constant")), "{:?}", selection.steps);
        assert!(selection.best.iter().all(|model| model.orders.inputs() == 1));
        assert_eq!(selection.chosen.orders, report.polynomials().orders);
    }
    // With nothing said, it is what the plant is: a gain of 0.5, a lag of -1/ln 0.9 samples, and no dead time.
    let report = fitted(&u, &y, &Plan::new(&["u"], "y", Choice::Automatic(Automatic::default())));
    let Model::Process(process) = &report.model else { panic!("{}", report.model.name()) };
    for (name, truth) in [("K", 0.5), ("tau", -2.0 / 0.9_f64.ln()), ("theta", 0.0)] {
        let parameter = process.parameters.iter().find(|parameter| parameter.name == name).unwrap();
        let error = parameter.standard_error.unwrap();
        assert!((parameter.value - truth).abs() < 4.0 * error, "{parameter:?}");
    }
}

#[test]
fn a_trend_is_found() {
    let u = Noise(9).take(500);
    let y: Vec<f64> =
        driven(&u, 0.3, 10).iter().zip(0..).map(|(y, t)| y + 5.0 + 0.03 * f64::from(t)).collect();
    for orders in structures().into_iter().filter(|orders| orders.inputs() > 0) {
        let report = fitted(&u, &y, &Plan { trend: true, constant: Constant::Auto, ..plan(&orders) });
        let slope = report.estimation.slope.unwrap();
        // Rows are 2 s apart.
        assert!((slope.value - 0.015).abs() < 4.0 * slope.standard_error.unwrap(), "{orders} {slope:?}");
        assert_eq!(report.polynomials().output.offset.slope, slope.value);
        let middle = level(&report);
        let line = report.polynomials().output.offset.at(499.0);
        assert!((middle.value - line).abs() < 1e-9, "{orders}: {middle:?} {line}");
    }
}

#[test]
fn no_constant_is_seen_where_there_is_none() {
    let all = [Orders::arx(1, &[1], &[1]), Orders::oe(&[1], &[1], &[1]), Orders::bj(&[1], 0, 1, &[1], &[1])];
    for orders in all.map(Result::unwrap) {
        let with = (0..60_u64).filter(|seed| {
            let u = Noise(100 + seed).take(200);
            let y = driven(&u, 0.5, 500 + seed);
            let report = fitted(&u, &y, &Plan::new(&["u"], "y", orders.clone()));
            report.estimation.level.is_some()
        });
        assert!(with.count() <= 3, "{orders}");
    }
}

#[test]
fn other_ways_to_estimate_have_a_constant_too() {
    let (u, y) = step_test(30, 0.2);
    let bounded = ConvexFit { bounds: vec!["a1=-0.95..-0.8".parse().unwrap()], ..ConvexFit::default() };
    let one = ConvexFit { norm: crate::estimate::Norm::One, ..ConvexFit::default() };
    let (arx, oe) = (Orders::arx(1, &[1], &[1]).unwrap(), Orders::oe(&[1], &[1], &[1]).unwrap());
    let ways = [
        (arx.clone(), Method::InstrumentalVariables, 0.05),
        (oe, Method::RefinedInstrumentalVariables, 0.05),
        (arx.clone(), Method::Constrained(bounded), 0.1),
        (arx.clone(), Method::Constrained(one), 0.1),
    ];
    for (orders, method, close) in ways {
        for constant in [Constant::Yes, Constant::Auto] {
            let report = fitted(&u, &y, &Plan { method: method.clone(), constant, ..plan(&orders) });
            let gain = report.polynomials().dc_gain[0].unwrap().value;
            assert!((gain - 0.5).abs() < close, "{method:?} {constant:?}: {gain}");
            assert!((level(&report).value - 313.75).abs() < 2.0, "{method:?} {:?}", level(&report));
            assert_eq!(report.polynomials().parameters.len(), 2);
        }
    }
    // A bound on the gain names the input as it did.
    let gain = ConvexFit { dc_gain: vec!["u=0.4..0.45".parse().unwrap()], ..ConvexFit::default() };
    let report = fitted(&u, &y, &Plan { method: Method::Constrained(gain), ..plan(&arx) });
    assert!((report.polynomials().dc_gain[0].unwrap().value - 0.45).abs() < 1e-6);
}

#[test]
fn what_cannot_be_had_is_refused_by_name() {
    let (u, y) = step_test(40, 0.1);
    let arx = Orders::arx(1, &[1], &[1]).unwrap();
    let of = |plan: &Plan| identify(log(&u, &y), &[], plan).unwrap_err().to_string();
    let zero = Plan { initial: Initial::Zero, ..plan(&arx) };
    assert!(of(&zero).starts_with("constant: zeros before the first sample"), "{}", of(&zero));
    let automatic = Plan { choice: Choice::Automatic(Automatic::default()), ..zero.clone() };
    assert!(of(&automatic).starts_with("constant: zeros before the first sample"));
    // Where it is left to the data there is none.
    let report = fitted(&u, &y, &Plan { constant: Constant::Auto, ..zero });
    assert_eq!(report.estimation.level, None);
    let no = Plan { trend: true, constant: Constant::No, ..plan(&arx) };
    assert!(of(&no).starts_with("trend: "), "{}", of(&no));
    let band = Plan { prefilter: Some("0.01..0.2".parse().unwrap()), ..plan(&arx) };
    assert!(of(&band).starts_with("constant: a level is not in a band"), "{}", of(&band));
    let ridge = ConvexFit { ridge: 1.0, ..ConvexFit::default() };
    let ridge = Plan { method: Method::Constrained(ridge), ..plan(&arx) };
    assert!(of(&ridge).contains("ridge"), "{}", of(&ridge));
    let joined = Log::join(vec![log(&u, &y), log(&u, &y)]).unwrap();
    let error = identify(joined, &[], &Plan { trend: true, ..plan(&arx) }).unwrap_err().to_string();
    assert!(error.starts_with("trend: several logs"), "{error}");
    // Without noise A(1) is 0 to rounding.
    let mut sum = vec![0.0; 100];
    let u = Noise(50).take(100);
    for t in 1..100 {
        sum[t] = sum[t - 1] + u[t - 1] + 0.25;
    }
    let plan = Plan { detrend: Detrend::None, ..plan(&arx) };
    let error = identify(log(&u, &sum), &[], &plan).unwrap_err();
    assert!(
        matches!(&error, Error::Undetermined { parameters, .. } if parameters == &["constant"]),
        "{error}"
    );
    assert!(error.to_string().contains("integrator"), "{error}");
    // Three rows are too few for three parameters.
    assert_refused(identify(log(&u[..4], &sum[..4]), &[], &plan), "constant");
}

#[test]
fn what_is_open_of_the_offset_goes_with_the_model() {
    let u = Noise(11).take(400);
    let y = driven(&u, 0.3, 12);
    let raised: Vec<f64> = y.iter().map(|y| y + 20.0).collect();
    let method = Method::PredictionError(Search { tolerance: 1e-12, ..Search::default() });
    for orders in structures() {
        let open = |y: &[f64], plan: &Plan| {
            fitted(&u, y, plan).polynomials().offset_covariance.clone().map(|open| open.covariance)
        };
        // Estimated, around zero and around another level: the matrix is the same, and that of the parameters is a part
        // of it.
        let yes = Plan { detrend: Detrend::None, method: method.clone(), ..plan(&orders) };
        let (low, high) = (open(&y, &yes).unwrap(), open(&raised, &yes).unwrap());
        let count = orders.parameters();
        let own = fitted(&u, &y, &yes).polynomials().covariance.clone().unwrap();
        assert_eq!(low.len(), count + 1);
        for (i, j) in (0..=count).flat_map(|i| (0..=count).map(move |j| (i, j))) {
            let size = (low[i][i] * low[j][j]).sqrt();
            assert!((low[i][j] - high[i][j]).abs() < 1e-3 * size, "{orders} {i} {j}");
            assert!(i == count || j == count || (low[i][j] - own[i][j]).abs() < 1e-9 * size, "{orders}");
        }
        // Taken as a mean it is as uncertain, and as far off as its estimate.
        let found = fitted(&u, &raised, &plan(&orders));
        let mean = Plan { constant: Constant::No, method: method.clone(), ..plan(&orders) };
        let report = fitted(&u, &raised, &mean);
        let gain: f64 = report.polynomials().a.iter().sum();
        let off = gain * (level(&found).value - report.polynomials().output.offset.level);
        let taken = open(&raised, &mean).unwrap();
        let expected = low[count][count] + off * off;
        assert!(
            (taken[count][count] / expected - 1.0).abs() < 0.1,
            "{orders} {} {expected}",
            taken[count][count]
        );
        let line = open(&raised, &Plan { detrend: Detrend::Linear, ..mean.clone() }).unwrap();
        assert_eq!(line.len(), count + 2, "{orders}");
        // What is given is certain, and old reports do not say.
        let given = Plan { offsets: vec![("y".to_owned(), 20.0)], ..mean.clone() };
        assert_eq!(open(&raised, &given), None);
        assert_eq!(open(&raised, &Plan { detrend: Detrend::None, ..mean.clone() }), None);
        let mut document: serde_json::Value = serde_json::from_str(&report.to_json().unwrap()).unwrap();
        assert_eq!(Report::from_json(&document.to_string()).unwrap(), report);
        document["model"].as_object_mut().unwrap().remove("offset_covariance");
        assert_eq!(Report::from_json(&document.to_string()).unwrap().polynomials().offset_covariance, None);
    }
    let instruments =
        Plan { method: Method::InstrumentalVariables, constant: Constant::No, ..plan(&structures()[0]) };
    assert!(fitted(&u, &raised, &instruments).polynomials().offset_covariance.is_some());
    let refined = Plan {
        method: Method::RefinedInstrumentalVariables,
        constant: Constant::No,
        ..plan(&structures()[2])
    };
    assert!(fitted(&u, &raised, &refined).polynomials().offset_covariance.is_some());
}

#[test]
fn forecasts_count_the_level() {
    // A short log with a slow pole: the mean is far from known.
    let mut noise = Noise(13);
    let u = noise.take(60);
    let mut y = vec![0.0];
    (1..60).for_each(|t| y.push(0.97 * y[t - 1] + 0.5 * u[t - 1] + noise.normal()));
    let orders = Orders::arx(1, &[1], &[1]).unwrap();
    let model = fitted(&u, &y, &Plan { constant: Constant::No, ..plan(&orders) }).polynomials().clone();
    let given = PolynomialModel { offset_covariance: None, ..model.clone() };
    let last = |model: &PolynomialModel, detrend: Option<Detrend>| {
        let start = crate::respond::InitialCondition::Drop;
        let (model, horizon) = (model.clone().into(), Horizon::Steps { steps: 20 });
        let applied = crate::report::apply(&model, &log(&u, &y), &[], detrend, horizon, start);
        applied.unwrap().outputs[0].standard_deviations.as_ref().unwrap()[59]
    };
    assert!(last(&model, None) > 1.05 * last(&given, None), "{} {}", last(&model, None), last(&given, None));
    // An offset of other rows is not that of the model.
    assert_eq!(last(&model, Some(Detrend::Mean)), last(&given, Some(Detrend::Mean)));
}
