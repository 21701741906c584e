//! What a report says where a log has a past, lacks one, or has holes.

use thetahat_numerics::noise::Noise;

use super::*;
use crate::data::{Log, Rows};
use crate::estimate::{Initial, Procedure};
use crate::model::{Model, Orders};
use crate::respond::{Horizon, InitialCondition};
use crate::tests::channel;
use crate::validate::Part;

impl Report {
    /// The polynomials of a report that has them.
    pub(crate) fn polynomials(&self) -> &crate::model::PolynomialModel {
        self.model.polynomials("this test").unwrap()
    }

    pub(crate) fn polynomials_mut(&mut self) -> &mut crate::model::PolynomialModel {
        let Model::Polynomial(model) = &mut self.model else { panic!("other kind") };
        model
    }
}

fn log(u: &[f64], y: &[f64]) -> Log {
    Log::new(vec![channel("u", u), channel("y", y)], 1.0).unwrap()
}

fn rows(text: &str) -> Vec<Rows> {
    text.split(',').map(|text| text.parse().unwrap()).collect()
}

fn fitted(log: &Log, orders: &Orders, estimate: &str, initial: Initial) -> Report {
    let estimate = if estimate.is_empty() { Vec::new() } else { rows(estimate) };
    let plan = Plan { estimate, initial, ..Plan::new(&["u"], "y", orders.clone()) };
    identify(log.clone(), &[], &plan).unwrap()
}

fn conditions(report: &Report) -> usize {
    match &report.estimation.procedure {
        Procedure::PredictionError(outcome) => outcome.initial_conditions,
        _ => 0,
    }
}

/// The mean square of the errors one step ahead on the rows of the fit is that of the estimate, and its log is known
/// again.
fn is_consistent(report: &Report, log: &Log) {
    let orders = &report.polynomials().orders;
    let one = &report.fit[0];
    assert_eq!((one.part, one.horizon), (Some(Part::Estimation), Horizon::Steps { steps: 1 }));
    assert_eq!(one.samples, report.estimation.samples, "{orders}");
    let ratio = one.rmse.unwrap().powi(2) / report.estimation.mse;
    assert!((ratio - 1.0).abs() < 1e-6, "{orders} {ratio}");
    let plan = ValidationPlan { rows: report.data.estimation.clone(), ..ValidationPlan::default() };
    let found = validate(report, None, log, &[], &plan).unwrap().validation;
    assert_eq!(found.in_sample, InSample::Yes, "{orders}");
}

/// y(t) = 0.9 y(t-1) + u(t-1) with white noise around it, u held for some samples.
fn first_order(samples: usize, noise: &mut Noise) -> (Vec<f64>, Vec<f64>) {
    let u: Vec<f64> = noise.take_normal(samples);
    let mut x = vec![3.0];
    (1..samples).for_each(|t| x.push(0.95 * x[t - 1] + u[t - 1]));
    let y = x.iter().map(|x| x + noise.normal()).collect();
    (u, y)
}

#[test]
fn rows_before_the_estimation_rows_are_its_past() {
    let mut noise = Noise(1);
    let (u, e) = (noise.take(500), noise.take(500));
    let mut y = vec![1.0; 2];
    for t in 2..500 {
        y.push(1.2 * y[t - 1] - 0.5 * y[t - 2] + u[t - 1] + 0.4 * u[t - 2] + 0.2 * e[t] + 0.1 * e[t - 1]);
    }
    let log = log(&u, &y);
    let all = [
        (Orders::arx(2, &[2], &[3]), 4),
        (Orders::arx(0, &[8], &[1]), 8),
        (Orders::armax(2, &[2], 1, &[1]), 2),
        (Orders::oe(&[2], &[2], &[3]), 0),
        (Orders::bj(&[2], 1, 2, &[2], &[3]), 2),
        (Orders::new(1, &[2], 1, 1, &[1], &[2]), 2),
    ];
    for (orders, lost) in all {
        let orders = orders.unwrap();
        for initial in [Initial::Auto, Initial::Zero] {
            // A full past, none, and one that is too short.
            for (estimate, past) in
                [("201..450", 200), ("1..250", 0), ("2..251", 1), ("101..250,301..400", 100)]
            {
                let report = fitted(&log, &orders, estimate, initial);
                let from_zero = report.estimation.initial == Some(Initial::Zero);
                let left_out = if from_zero { 0 } else { usize::saturating_sub(lost, past) };
                assert_eq!(report.estimation.samples, 250 - left_out, "{orders} {estimate} {initial:?}");
                is_consistent(&report, &log);
                let run = report.fit.last().unwrap();
                assert_eq!((run.horizon, run.samples), (Horizon::FreeRun, 250));
                // With a past there is nothing to choose.
                if initial == Initial::Auto && past > 1 && orders.has_f() {
                    let count = orders.nf.iter().sum::<usize>() * report.data.estimation.len();
                    assert_eq!(
                        (report.estimation.initial, conditions(&report)),
                        (Some(Initial::Estimate), count)
                    );
                }
            }
        }
    }
}

#[test]
fn least_squares_with_a_past_are_those_of_the_rows_behind_it() {
    let mut noise = Noise(2);
    let (u, y) = first_order(200, &mut noise);
    let orders = Orders::arx(2, &[3], &[2]).unwrap();
    let plan = |estimate: &str| Plan {
        estimate: rows(estimate),
        detrend: crate::data::Detrend::None,
        ..Plan::new(&["u"], "y", orders.clone())
    };
    // The first four of the rows have no full regressor without a past.
    let [known, alone] =
        ["105..200", "101..200"].map(|rows| identify(log(&u, &y), &[], &plan(rows)).unwrap());
    let without = identify(log(&u[100..], &y[100..]), &[], &plan("1..100")).unwrap();
    assert_eq!(
        (known.estimation.samples, alone.estimation.samples, without.estimation.samples),
        (96, 100, 96)
    );
    for (known, without) in known.polynomials().parameters.iter().zip(&without.polynomials().parameters) {
        assert!(
            (known.value - without.value).abs() < 1e-10 && known.standard_error == without.standard_error
        );
    }
}

#[test]
fn a_leading_indicator_needs_no_shifting_by_hand() {
    // y(t) = 4.8 q^-3/(1 - 0.7 q^-1) u(t) + (1 + 0.3 q^-1)/(1 - q^-1) e(t), u a random walk that begins far from its
    // mean.
    let (samples, before) = (150, 60);
    let mut estimated = 0;
    for seed in 1..=6 {
        let mut noise = Noise(seed);
        let mut u = vec![10.0];
        (1..samples + before).for_each(|t| u.push(u[t - 1] + 0.5 * noise.normal()));
        let e: Vec<f64> = (0..samples + before).map(|_| 0.05_f64.sqrt() * noise.normal()).collect();
        let (mut x, mut w) = (vec![16.0 * u[0]; 3], vec![0.0; 3]);
        for t in 3..samples + before {
            x.push(0.7 * x[t - 1] + 4.8 * u[t - 3]);
            w.push(w[t - 1] + e[t] + 0.3 * e[t - 1]);
        }
        let y: Vec<f64> = x.iter().zip(&w).map(|(x, w)| x + w).collect();
        let orders = |nk| Orders::bj(&[1], 1, 1, &[1], &[nk]).unwrap();
        let cut = log(&u[before..], &y[before..]);
        let report = fitted(&cut, &orders(3), "", Initial::Auto);
        let shifted = log(&u[before - 13..u.len() - 3], &y[before - 10..]);
        let by_hand = fitted(&shifted, &orders(0), "11..160", Initial::Auto);
        let ratio = report.polynomials().noise_variance / by_hand.polynomials().noise_variance;
        assert!((0.9..1.1).contains(&ratio), "{seed} {ratio}");
        estimated += usize::from(conditions(&report) == 3);
        assert_eq!(conditions(&by_hand), 1);
        is_consistent(&report, &cut);
        is_consistent(&by_hand, &shifted);
        // And nothing is estimated where the past is known.
        let known = fitted(&log(&u, &y), &orders(3), "61..210", Initial::Auto);
        assert_eq!((known.estimation.samples, conditions(&known)), (150, 1));
        assert!(
            (known.polynomials().noise_variance / by_hand.polynomials().noise_variance - 1.0).abs() < 0.1
        );
    }
    // Not where the walk happens to be near its mean.
    assert!(estimated >= 4);
}

#[test]
fn unknown_inputs_that_do_not_matter_are_not_estimated() {
    let mut noise = Noise(5);
    for _ in 0..5 {
        let u: Vec<f64> = (0..300).map(|t| if t < 20 { 0.0 } else { noise.normal() }).collect();
        let mut x = vec![0.0; 6];
        (6..300).for_each(|t| x.push(0.8 * x[t - 1] + u[t - 6]));
        let y: Vec<f64> = x.iter().map(|x| x + 0.1 * noise.normal()).collect();
        let orders = Orders::oe(&[1], &[1], &[6]).unwrap();
        let plan = Plan { detrend: crate::data::Detrend::None, ..Plan::new(&["u"], "y", orders) };
        let report = identify(log(&u, &y), &[], &plan).unwrap();
        assert_eq!((report.estimation.initial, conditions(&report)), (Some(Initial::Zero), 0));
    }
}

#[test]
fn missing_outputs_do_not_cut_an_output_error_model() {
    let mut noise = Noise(3);
    let orders = Orders::oe(&[1], &[1], &[1]).unwrap();
    let (mut whole, mut cut) = (Vec::new(), Vec::new());
    for _ in 0..40 {
        let (u, y) = first_order(500, &mut noise);
        whole.push(fitted(&log(&u, &y), &orders, "", Initial::Auto));
        let y: Vec<f64> = y.iter().map(|y| if noise.uniform() < -0.4 { f64::NAN } else { *y }).collect();
        let measured = y.iter().filter(|y| !y.is_nan()).count();
        let log = log(&u, &y);
        let report = fitted(&log, &orders, "", Initial::Auto);
        assert_eq!((report.estimation.samples, report.data.segments.len()), (measured, 1));
        assert_eq!(report.data.missing[1].rows, 500 - measured);
        assert!(report.fit.iter().all(|fit| fit.samples == measured));
        is_consistent(&report, &log);
        cut.push(report);
    }
    let statistics = |reports: &[Report]| {
        let of =
            |value: &dyn Fn(&Report) -> f64| reports.iter().map(value).sum::<f64>() / reports.len() as f64;
        let b = |report: &Report| report.polynomials().parameters[0].value;
        let mean = of(&b);
        let deviation = of(&|report| (b(report) - mean).powi(2)).sqrt();
        let error = of(&|report| report.polynomials().parameters[0].standard_error.unwrap());
        (mean, deviation, error, of(&|report| report.polynomials().noise_variance))
    };
    let ((_, best, ..), (mean, deviation, error, variance)) = (statistics(&whole), statistics(&cut));
    // 30 % fewer samples: 20 % wider, and the standard errors say so.
    assert!((mean - 1.0).abs() < 0.015, "{mean}");
    assert!(deviation < 1.6 * best && deviation < 0.03, "{deviation} {best}");
    assert!((0.7..1.4).contains(&(error / deviation)), "{error} {deviation}");
    assert!((0.93..1.07).contains(&variance), "{variance}");
}

#[test]
fn responses_go_on_through_missing_outputs() {
    let mut noise = Noise(4);
    let (u, mut y) = first_order(300, &mut noise);
    let complete = y.clone();
    for hole in [0..3, 50..60, 100..101, 290..300] {
        y[hole].fill(f64::NAN);
    }
    let log = log(&u, &y);
    let apply = |report: &Report, log: &Log, horizon, start| {
        apply(&report.model, log, &[], None, horizon, start).unwrap().outputs.remove(0)
    };
    let one = Horizon::Steps { steps: 1 };
    for orders in [Orders::oe(&[1], &[1], &[1]).unwrap(), Orders::arx(0, &[20], &[1]).unwrap()] {
        let report = fitted(&log, &orders, "", Initial::Auto);
        is_consistent(&report, &log);
        let start = InitialCondition::natural(report.polynomials(), one);
        let predicted = apply(&report, &log, one, start);
        let first = if orders.has_f() { 0 } else { 20 };
        assert!(predicted.predicted[first..].iter().all(|value| value.is_finite()));
        let deviation = report.polynomials().noise_variance.sqrt();
        assert!(predicted.standard_deviations.unwrap()[first..].iter().all(|own| *own >= deviation));
        assert_eq!(predicted.fit.unwrap().samples, y[first..].iter().filter(|y| !y.is_nan()).count());
        // What is said of the holes is close to what was there.
        let far = |t: usize| (predicted.predicted[t] - complete[t]).abs() > 4.0 * deviation;
        assert!(!(50..60).chain(290..300).any(far));
    }
    // Free runs of other models too: their initial state is found from what is measured.
    let report = fitted(&log, &Orders::arx(1, &[1], &[1]).unwrap(), "", Initial::Auto);
    let run = apply(&report, &log, Horizon::FreeRun, InitialCondition::Estimate);
    assert!(run.predicted.iter().all(|value| value.is_finite()));
    assert_eq!(run.fit.unwrap().samples, 276);
    let validation = validate(&report, None, &log, &[], &ValidationPlan::default()).unwrap();
    assert!(validation.signals.outputs[0].simulated.as_ref().unwrap().iter().all(|value| value.is_finite()));
}
