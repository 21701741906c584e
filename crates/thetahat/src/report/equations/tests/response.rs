//! Fits to measured frequency responses.

use std::ops::ControlFlow;

use super::super::{EquationsPlan, fit_equations_to_response};
use crate::Error;
use crate::data::{Channel, Log};
use crate::model::{GreyBox, Model};
use crate::report::{ProcessPlan, Report, fit_process_to_response};
use crate::spectrum::{Estimator, GivenPoint, MeasuredResponse, Method, SpectrumPlan, spectrum};

/// A resistance in series with two RC elements, one of a delayed current for the sake of the test.
const CELL: &str = "\
sample_time = 1
[states]
fast = { start = 0, sd = 0 }
slow = { start = 0, sd = 0 }
[inputs]
i = 'current'
[parameters]
r0 = { start = 0.02, sd = 0.02, unknown = true, min = 0 }
r1 = { start = 0.02, sd = 0.02, unknown = true, min = 0 }
r2 = { start = 0.02, sd = 0.02, unknown = true, min = 0 }
tau1 = { start = 0.2, sd = 0.2, unknown = true, min = 0 }
tau2 = { start = 20, sd = 20, unknown = true, min = 0 }
[derivative]
fast = '(r1 * i - fast) / tau1'
slow = '(r2 * i - slow) / tau2'
[outputs]
voltage = 'r0 * i + fast + slow'
[figures]
c1 = { value = 'tau1 / r1', unit = 'F' }
[noise]
measurement = { voltage = { start = 0.001, unknown = true } }
";
const TRUTH: [f64; 5] = [0.015, 0.01, 0.04, 0.05, 8.0];

fn normal(random: &mut oorandom::Rand64) -> f64 {
    thetahat_numerics::optimize::normal_number(random)
}

/// Its impedance at 60 frequencies, with errors of this size.
fn impedance(seed: u64, error: f64, known: bool) -> MeasuredResponse {
    let mut random = oorandom::Rand64::new(u128::from(seed));
    let [r0, r1, r2, tau1, tau2] = TRUTH;
    let points: Vec<GivenPoint> = (0..60)
        .map(|row| {
            let frequency = 10.0_f64.powf(-2.5 + 5.0 * f64::from(row) / 59.0);
            let part = |r: f64, tau: f64| {
                let below = 1.0 + (frequency * tau).powi(2);
                [r / below, -r * frequency * tau / below]
            };
            let (one, two) = (part(r1, tau1), part(r2, tau2));
            GivenPoint {
                frequency,
                re: r0 + one[0] + two[0] + error * normal(&mut random),
                im: one[1] + two[1] + error * normal(&mut random),
                standard_deviation: known.then_some(error),
            }
        })
        .collect();
    MeasuredResponse::given("current", "voltage", &points, None).unwrap()
}

fn fitted(text: &str, response: &MeasuredResponse) -> Result<Report, Error> {
    let model = GreyBox::from_toml(text)?;
    fit_equations_to_response(&model, response, &EquationsPlan::default(), &|_| ControlFlow::Continue(()))
}

/// How often the intervals of 95 % hold the truth, in so many fits.
fn held(known: bool, runs: u64) -> f64 {
    let mut inside = 0;
    for seed in 0..runs {
        let report = fitted(CELL, &impedance(seed, 1e-4, known)).unwrap();
        for (parameter, truth) in report.model.parameters().iter().zip(TRUTH) {
            let error = parameter.standard_error.unwrap();
            inside += u32::from((parameter.value - truth).abs() < 1.96 * error);
        }
    }
    f64::from(inside) / (5 * runs) as f64
}

#[test]
fn the_elements_of_a_cell_come_back_with_intervals_that_hold() {
    for known in [true, false] {
        let share = held(known, 100);
        // Of 500 that hold with 95 %, all but a millionth of draws are within five standard deviations of 1 %.
        assert!((share - 0.95).abs() < 0.05, "{known}: {share}");
    }
}

#[test]
fn errors_that_are_not_known_are_found() {
    let report = fitted(CELL, &impedance(1, 0.0, false)).unwrap();
    for (parameter, truth) in report.model.parameters().iter().zip(TRUTH) {
        // As near as the search goes.
        assert!((parameter.value / truth - 1.0).abs() < 1e-6, "{parameter:?}");
        assert!(parameter.standard_error.unwrap() < 1e-6 * truth, "{parameter:?}");
    }
    let Model::Equations(model) = &report.model else { panic!("equations") };
    assert!((model.figures[0].value.unwrap() - 5.0).abs() < 1e-6);
    // The noise of a measurement in time is not among them: the response says nothing of it.
    assert_eq!(model.known.get("measurement.voltage"), Some(&0.001));
    assert!(report.warnings.is_empty(), "{:?}", report.warnings);
    // What cannot be told apart by what was measured is named.
    let text = CELL
        .replace("'r0 * i + fast + slow'", "'r0 * i + rest * i + fast + slow'")
        .replace("[derivative]", "rest = { start = 0.01, sd = 0.01, unknown = true, min = 0 }\n[derivative]");
    let Err(Error::Undetermined { parameters, .. }) = fitted(&text, &impedance(1, 1e-4, true)) else {
        panic!("r0 and rest add up");
    };
    assert_eq!(parameters, ["r0", "rest"]);
}

/// 3/(1 + 4 s) in samples of half a second, and its response by some method.
fn lag(seed: u64, method: Method) -> MeasuredResponse {
    let mut random = oorandom::Rand64::new(u128::from(seed));
    let (mut u, mut y, mut x) = (Vec::new(), Vec::new(), 0.0);
    let pole = (-0.125_f64).exp();
    for _ in 0..2000 {
        u.push(normal(&mut random));
        y.push(x + 0.3 * normal(&mut random));
        x = pole * x + 3.0 * (1.0 - pole) * u[u.len() - 1];
    }
    let channel = |name: &str, values| Channel { name: name.into(), values };
    let log = Log::new(vec![channel("u", u), channel("y", y)], 0.5).unwrap();
    spectrum(&log, &[], &SpectrumPlan { method, ..SpectrumPlan::new(&["u"], "y") }).unwrap()
}

const LAG: &str = "sample_time = 0.5
[states]
x = { start = 0, sd = 1 }
[inputs]
u = 'u'
[parameters]
gain = { start = 1, sd = 1, unknown = true }
tau = { start = 1, sd = 1, unknown = true, min = 0 }
[derivative]
x = '(gain * u - x) / tau'
[outputs]
y = 'x'
[noise]
measurement = { y = 0.1 }";

/// Neighbouring points of these methods share most of their noise.
#[test]
fn intervals_know_how_far_a_response_is_smooth() {
    const RUNS: u64 = 60;
    for method in [
        Method::Lpm { half_width: None },
        Method::Spa { lags: Some(300) },
        Method::Welch { window: Some(500), estimator: Estimator::H1 },
    ] {
        let (mut inside, mut of_process) = (0, 0);
        for seed in 0..RUNS {
            let response = lag(seed, method);
            let holds = |report: &Report| {
                let own = report.model.parameters().iter().zip([3.0, 4.0]);
                own.filter(|(parameter, truth)| {
                    (parameter.value - truth).abs() < 1.96 * parameter.standard_error.unwrap()
                })
                .count()
            };
            inside += holds(&fitted(LAG, &response).unwrap());
            let plan = ProcessPlan::new(&[], "y", "p1".parse().unwrap());
            let report = fit_process_to_response(&response, &plan, &|_| ControlFlow::Continue(()));
            of_process += holds(&report.unwrap());
        }
        for held in [inside, of_process] {
            let share = held as f64 / (2 * RUNS) as f64;
            assert!(share > 0.85, "{method:?}: {share}");
        }
    }
}

#[test]
fn what_a_response_cannot_say_is_refused() {
    let response = impedance(1, 1e-4, true);
    let refused = |text: &str, words: &str| {
        let message = fitted(text, &response).unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    };
    let known = CELL.replace(", sd = 0.02, unknown = true, min = 0 }", " }");
    let known = known.replace(", sd = 0.2, unknown = true, min = 0 }", " }");
    let known =
        known.replace(", sd = 20, unknown = true, min = 0 }", " }").replace("= { start = 0.02 }", "= 0.02");
    let known = known.replace("= { start = 0.2 }", "= 0.2").replace("= { start = 20 }", "= 20");
    refused(&known, "does not depend on any of its unknown parameters: they are noises");
    refused(
        &known.replace("{ start = 0.001, unknown = true }", "0.001"),
        "none of its parameters is unknown",
    );
    refused(
        &CELL.replace("'current'", "'amps'"),
        "the response has the input 'current', and the model: amps",
    );
    refused(
        &CELL.replace("voltage =", "volts ="),
        "the response has the output 'voltage', and the model: volts",
    );
    let next = CELL.replace("[derivative]", "[next]");
    refused(&next, "write the equations as [derivative]");
    refused(&CELL.replace("- slow) / tau2", "- slow) / tau2 * exp(800 * tau2)"), "is no number at");
    let model = GreyBox::from_toml(CELL).unwrap();
    let plan = EquationsPlan { split: Some("60/20/20".parse().unwrap()), ..EquationsPlan::default() };
    let error =
        fit_equations_to_response(&model, &response, &plan, &|_| ControlFlow::Continue(())).unwrap_err();
    assert!(error.to_string().contains("a frequency response has no rows"), "{error}");
    let error =
        fit_equations_to_response(&model, &response, &EquationsPlan::default(), &|_| ControlFlow::Break(()));
    assert!(matches!(error, Err(Error::Interrupted)), "{error:?}");
}
