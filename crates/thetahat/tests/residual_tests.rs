//! How often tests of residuals reject models that are true, and models that are not.
//!
//! `make monte-carlo` does 2000 runs of each kind. `MONTE_CARLO` is the number; without it they are fewer.

#[path = "monte_carlo/simulated.rs"]
mod simulated;

use thetahat::data::{Channel, Log, Rows};
use thetahat::estimate::Method;
use thetahat::model::Orders;
use thetahat::report::{InSample, Plan, Report, ValidationPlan, identify, validate};
use thetahat::validate::Residuals;

use simulated::{BEFORE, Random, filtered};

/// Rows of the fit, and as many fresh ones after them: Anderson's test counts 20 lags of them.
const ROWS: usize = 400;
const LEVEL: f64 = 0.05;

/// y = (plant) u + (noise) e, and what is fitted to it.
struct Kind<'k> {
    name: &'k str,
    orders: Orders,
    method: Method,
    plant: [&'k [f64]; 2],
    noise: [&'k [f64]; 2],
    /// The denominator of a filter that colours the input.
    colour: &'k [f64],
}

/// How often each test rejects, in percent.
#[derive(Debug, Default)]
struct Rates {
    ljung_box: f64,
    /// Anderson's verdict at each of the levels that there are unless others are named.
    anderson: [f64; 5],
    /// That a fraction `LEVEL` or more is outside.
    plain: f64,
    past: f64,
    feedback: f64,
}

impl Rates {
    /// Counts one more of all runs.
    fn count(&mut self, residuals: &Residuals) {
        let each = 100.0 / runs() as f64;
        let low = |p: Option<f64>| if p.expect("the case is sound") < LEVEL { each } else { 0.0 };
        self.ljung_box += low(residuals.ljung_box.p_value);
        let lags = residuals.anderson.lags as f64;
        for (rate, level) in self.anderson.iter_mut().zip(&residuals.anderson.levels) {
            *rate += if level.white { 0.0 } else { each };
            if level.alpha == LEVEL && level.outside as f64 >= LEVEL * lags {
                self.plain += each;
            }
        }
        for independence in &residuals.independence {
            self.past += low(independence.past.p_value);
            self.feedback += low(independence.feedback.p_value);
        }
    }

    fn print(&self, name: &str) {
        eprintln!(
            "{name:30} Ljung-Box {:5.1} %, Anderson {:.1?} %, plain {:5.1} %, independence {:5.1} %, feedback {:5.1} %",
            self.ljung_box, self.anderson, self.plain, self.past, self.feedback
        );
    }
}

/// How many runs: the full number, or fewer.
fn runs() -> usize {
    std::env::var("MONTE_CARLO").ok().and_then(|text| text.parse().ok()).unwrap_or(300)
}

fn log(u: Option<&[f64]>, y: &[f64]) -> Log {
    let channel = |name: &str, values: &[f64]| Channel { name: name.into(), values: values.to_vec() };
    Log::new([Some(channel("y", y)), u.map(|u| channel("u", u))].into_iter().flatten().collect(), 1.0)
        .expect("the case is sound")
}

fn fitted(log: &Log, orders: &Orders, method: &Method) -> Report {
    let plan = Plan {
        estimate: vec![Rows::new(1, ROWS).expect("the case is sound")],
        method: method.clone(),
        ..Plan::new(&["u"][..orders.inputs()], "y", orders.clone())
    };
    identify(log.clone(), &[], &plan).expect("the case is sound")
}

fn residuals(report: &Report, log: &Log, rows: [usize; 2], seen: InSample) -> Residuals {
    let rows = vec![Rows::new(rows[0], rows[1]).expect("the case is sound")];
    let plan = ValidationPlan { rows, ..ValidationPlan::default() };
    let found = validate(report, None, log, &[], &plan).expect("the case is sound").validation;
    assert_eq!(found.in_sample, seen);
    found.residuals.into_iter().next().expect("the case is sound")
}

/// What is rejected on the rows of the fit, and on fresh ones.
fn rates(kind: &Kind<'_>) -> [Rates; 2] {
    let mut rates = [Rates::default(), Rates::default()];
    for seed in 0..runs() as u64 {
        let mut random = Random::new(1 + 7919 * seed);
        let u = filtered(&[1.0], kind.colour, &random.normals(BEFORE + 2 * ROWS));
        let e = random.normals(u.len());
        let (x, v) = (filtered(kind.plant[0], kind.plant[1], &u), filtered(kind.noise[0], kind.noise[1], &e));
        let y: Vec<f64> = x.iter().zip(&v).map(|(x, v)| x + v).skip(BEFORE).collect();
        let log = log((kind.orders.inputs() > 0).then_some(&u[BEFORE..]), &y);
        let report = fitted(&log, &kind.orders, &kind.method);
        rates[0].count(&residuals(&report, &log, [1, ROWS], InSample::Yes));
        rates[1].count(&residuals(&report, &log, [ROWS + 1, 2 * ROWS], InSample::No));
    }
    for (rates, part) in rates.iter().zip(["seen", "fresh"]) {
        rates.print(&format!("{}, {part}", kind.name));
    }
    rates
}

/// Whether a rate is inside, to three standard deviations of the count more than those of 2000 runs.
fn assert_inside(what: &str, rate: f64, low: f64, high: f64) {
    let spread = |runs: f64| 300.0 * (0.05_f64 * 0.95 / runs).sqrt();
    let more = (spread(runs() as f64) - spread(2000.0)).max(0.0);
    assert!((low - more..=high + more).contains(&rate), "{what}: {rate:.1} % outside {low}..{high}");
}

/// True models are rejected about as often as the level says, those of which the noise is modelled in every test.
fn assert_levels(kind: &Kind<'_>, white: bool) {
    for (rates, part) in rates(kind).iter().zip(["seen", "fresh"]) {
        let name = |test: &str| format!("{}, {part}, {test}", kind.name);
        if white {
            assert_inside(&name("Ljung-Box"), rates.ljung_box, 2.0, 8.0);
            // On fresh rows the errors of the parameters come on top, which its bands see one by one: of 2000 true
            // Box-Jenkins models it turns away 9.1 %.
            let most = if part == "fresh" { 9.5 } else { 8.0 };
            for rate in rates.anderson {
                assert_inside(&name("Anderson"), rate, 0.0, most);
            }
        }
        if kind.orders.inputs() > 0 {
            assert_inside(&name("independence"), rates.past, 2.0, 8.0);
            assert_inside(&name("feedback"), rates.feedback, 0.0, 7.0);
        }
    }
}

const ONE: &[f64] = &[1.0];
const B: &[f64] = &[0.0, 1.0, 0.5];
const F: &[f64] = &[1.0, -1.5, 0.7];
const SLOW: &[f64] = &[1.0, -0.9];

#[test]
fn arx() {
    let orders = Orders::arx(2, &[2], &[1]).expect("the case is sound");
    for (name, colour) in [("ARX", ONE), ("ARX, slow input", SLOW)] {
        let method = Method::default();
        let kind = Kind { name, orders: orders.clone(), method, plant: [B, F], noise: [ONE, F], colour };
        assert_levels(&kind, true);
    }
}

#[test]
fn armax() {
    let orders = Orders::armax(2, &[2], 2, &[1]).expect("the case is sound");
    let noise = [&[1.0, 0.6, 0.3], F];
    let method = Method::default();
    assert_levels(&Kind { name: "ARMAX", orders, method, plant: [B, F], noise, colour: ONE }, true);
}

#[test]
fn output_error() {
    let orders = Orders::oe(&[2], &[2], &[1]).expect("the case is sound");
    let coloured: [&[f64]; 2] = [ONE, &[1.0, -0.8]];
    for (name, method, noise, colour) in [
        ("OE", Method::default(), [ONE, ONE], ONE),
        ("OE, coloured noise", Method::default(), coloured, ONE),
        ("OE, coloured noise, slow input", Method::default(), coloured, SLOW),
        ("SRIV, coloured noise", Method::RefinedInstrumentalVariables, coloured, ONE),
    ] {
        let white = noise == [ONE, ONE];
        let kind = Kind { name, orders: orders.clone(), method, plant: [B, F], noise, colour };
        assert_levels(&kind, white);
    }
}

#[test]
fn instrumental_variables() {
    let orders = Orders::arx(2, &[2], &[1]).expect("the case is sound");
    let noise: [&[f64]; 2] = [ONE, &[1.0, -0.8]];
    let method = Method::InstrumentalVariables;
    assert_levels(&Kind { name: "IV", orders, method, plant: [B, F], noise, colour: ONE }, false);
}

#[test]
fn box_jenkins() {
    let orders = Orders::bj(&[2], 1, 2, &[2], &[1]).expect("the case is sound");
    let noise: [&[f64]; 2] = [&[1.0, 0.7], &[1.0, -0.9, 0.5]];
    let method = Method::default();
    assert_levels(&Kind { name: "Box-Jenkins", orders, method, plant: [B, F], noise, colour: ONE }, true);
}

#[test]
fn time_series() {
    let ar = Orders::arx(2, &[], &[]).expect("the case is sound");
    let arma = Orders::new(2, &[], 1, 0, &[], &[]).expect("the case is sound");
    for (name, orders, c) in [("AR", ar, ONE), ("ARMA", arma, &[1.0, 0.5][..])] {
        let method = Method::default();
        assert_levels(&Kind { name, orders, method, plant: [&[0.0], ONE], noise: [c, F], colour: ONE }, true);
    }
}

#[test]
fn plants_of_too_low_an_order_are_rejected() {
    let method = Method::default;
    let orders = Orders::arx(1, &[1], &[1]).expect("the case is sound");
    let kind =
        Kind { name: "ARX(1, 1)", orders, method: method(), plant: [B, F], noise: [ONE, F], colour: ONE };
    for rates in rates(&kind) {
        assert!(rates.ljung_box > 95.0 && rates.past > 95.0, "{rates:?}");
    }
    let orders = Orders::oe(&[1], &[1], &[1]).expect("the case is sound");
    let kind =
        Kind { name: "OE(1, 1)", orders, method: method(), plant: [B, F], noise: [ONE, ONE], colour: ONE };
    for rates in rates(&kind) {
        assert!(rates.past > 95.0, "{rates:?}");
    }
}

/// u(t) = r(t) - 0.1 y(t - 1), in noise of twice the size.
#[test]
fn feedback_is_seen_and_does_no_harm() {
    let orders = Orders::arx(2, &[2], &[1]).expect("the case is sound");
    let mut rates = Rates::default();
    for seed in 0..runs() as u64 {
        let mut random = Random::new(5 + 7919 * seed);
        let (r, e) = (random.normals(BEFORE + ROWS), random.normals(BEFORE + ROWS));
        let (mut u, mut y) = (vec![0.0; 2], vec![0.0; 2]);
        for t in 2..r.len() {
            u.push(r[t] - 0.1 * y[t - 1]);
            y.push(u[t - 1] + 0.5 * u[t - 2] - F[1] * y[t - 1] - F[2] * y[t - 2] + 2.0 * e[t]);
        }
        let log = log(Some(&u[BEFORE..]), &y[BEFORE..]);
        let report = fitted(&log, &orders, &Method::default());
        rates.count(&residuals(&report, &log, [1, ROWS], InSample::Yes));
    }
    rates.print("ARX in a loop");
    assert!(rates.feedback > 95.0, "{rates:?}");
    assert_inside("ARX in a loop, Ljung-Box", rates.ljung_box, 2.0, 8.0);
    assert_inside("ARX in a loop, independence", rates.past, 2.0, 8.0);
}
