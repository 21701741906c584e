//! Trackers against the estimators of thetahat-core, against batch fits, and against what they are written to.

mod coupled;
mod knowledge;
mod nonlinear;
mod plans;
mod state;

use thetahat_core::nalgebra::Dyn;
use thetahat_core::{Action, Chart, Forgetting, InputOrders, RecursiveArmax, RecursiveArx};
use thetahat_core::{ArmaxMethod, ArmaxOrders, ArxOrders};
use thetahat_numerics::noise::Noise;

use super::*;
use crate::Error;
use crate::data::Record;
use crate::estimate::{Initial, arx};
use crate::model::Orders;

/// A log of y(t) = 1.5 y(t-1) - 0.7 y(t-2) + 2 u1(t-1) + 0.5 u1(t-2) - u2(t) + e(t) + c e(t-1), with e uniform in -size
/// … size.
pub(super) fn log(rows: usize, size: f64, c: f64, seed: u64) -> (Vec<[f64; 2]>, Vec<f64>) {
    let mut noise = Noise(seed);
    let inputs: Vec<[f64; 2]> = (0..rows).map(|_| [3.0 * noise.uniform(), noise.uniform()]).collect();
    let e: Vec<f64> = noise.take(rows).into_iter().map(|e| size * e).collect();
    let mut y = vec![0.0; rows];
    for t in 0..rows {
        let past = |signal: &[f64], lag: usize| if t >= lag { signal[t - lag] } else { 0.0 };
        let u = |lag: usize| if t >= lag { inputs[t - lag][0] } else { 0.0 };
        y[t] = 1.5 * past(&y, 1) - 0.7 * past(&y, 2) + 2.0 * u(1) + 0.5 * u(2) - inputs[t][1]
            + e[t]
            + c * past(&e, 1);
    }
    (inputs, y)
}

pub(super) fn orders() -> Orders {
    Orders::arx(2, &[2, 1], &[1, 0]).unwrap()
}

const INPUTS: [InputOrders; 2] = [InputOrders { nb: 2, nk: 1 }, InputOrders { nb: 1, nk: 0 }];

/// Runs a tracker over a log.
pub(super) fn run(tracker: &mut Tracker, inputs: &[[f64; 2]], y: &[f64]) -> Vec<Tracked> {
    inputs.iter().zip(y).map(|(u, &y)| tracker.log_row(y, u).unwrap()).collect()
}

pub(super) fn exactly(plan: &TrackPlan) -> TrackPlan {
    TrackPlan { forgetting: "none".parse().unwrap(), start: "exact".parse().unwrap(), ..plan.clone() }
}

#[test]
fn with_the_scales_found_it_is_the_library_to_the_bit() {
    let (inputs, mut y) = log(300, 0.3, 0.0, 1);
    y[5] = f64::NAN;
    y[80] = f64::NAN;
    let mut tracker = Tracker::new(&orders(), &TrackPlan::default()).unwrap();
    let tracked = run(&mut tracker, &inputs, &y);

    // The maximum lag is 2, the parameters are 5: 12 rows.
    let collected = tracked.iter().take_while(|tracked| tracked.action == Action::Collecting).count();
    assert_eq!(collected, 12);
    let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, |a: f64, b| a.max(b.abs()));
    let scales = tracker.scales().unwrap();
    assert_eq!(scales.output, largest(&mut y[..12].iter().copied()));
    assert_eq!(scales.inputs, [0, 1].map(|j| largest(&mut inputs[..12].iter().map(|u| u[j]))));

    let library = ArxOrders { na: 2, inputs: &INPUTS, constant: false };
    let mut library: RecursiveArx<f64, Dyn, Dyn> =
        RecursiveArx::new(&library, scales.output, &scales.inputs, Forgetting::default()).unwrap();
    for (t, (u, &y)) in inputs.iter().zip(&y).enumerate() {
        let expected = library.log_row(y, u).unwrap();
        if t >= collected {
            let found = tracked[t];
            let bits = |values: [f64; 3]| values.map(f64::to_bits);
            assert_eq!(
                bits([found.error, found.variance, found.nis]),
                bits([expected.error, expected.variance, expected.nis])
            );
            assert_eq!(found.action, expected.action);
            assert!(expected.error.is_nan() || y - found.predicted == expected.error);
        }
    }
    assert_eq!(tracker.parameters().unwrap(), library.estimator().parameters().as_slice());
    assert_eq!(tracker.noise_variance(), library.estimator().noise_variance());
    let mut errors = [0.0; 5];
    tracker.write_standard_errors(&mut errors).unwrap();
    assert_eq!(errors, library.estimator().standard_errors().unwrap().as_slice());
    assert_eq!(tracker.names(), ["a1", "a2", "b1_1", "b1_2", "b2_0"]);
}

#[test]
fn a_channel_at_zero_is_waited_for_and_the_latest_rows_are_kept() {
    let (mut inputs, y) = log(200, 0.3, 0.0, 2);
    inputs[..100].iter_mut().for_each(|u| u[1] = 0.0);
    let mut tracker = Tracker::new(&orders(), &TrackPlan::default()).unwrap();
    let tracked = run(&mut tracker, &inputs, &y);
    let collected = tracked.iter().take_while(|tracked| tracked.action == Action::Collecting).count();
    assert_eq!(collected, 101);
    // The scales are of all rows, the estimator has seen the last twelve of those.
    let scales = tracker.scales().unwrap();
    assert_eq!(scales.inputs[1], inputs[100][1].abs());
    assert_eq!(scales.output, y[..101].iter().fold(0.0, |a: f64, b| a.max(b.abs())));
    let plan = TrackPlan { scales: Some(scales.clone()), ..TrackPlan::default() };
    let mut given = Tracker::new(&orders(), &plan).unwrap();
    run(&mut given, &inputs[89..], &y[89..]);
    assert_eq!(given.parameters(), tracker.parameters());
}

#[test]
fn armax_is_the_library_to_the_bit() {
    let (inputs, y) = log(300, 0.3, 0.6, 3);
    for (method, core) in [
        (TrackMethod::Els, ArmaxMethod::ExtendedLeastSquares),
        (TrackMethod::Rpem, ArmaxMethod::PredictionError),
    ] {
        let offsets = Some(PerChannel { inputs: vec![0.0; 2], output: 0.0 });
        let plan = TrackPlan { method, constant: true, offsets, ..TrackPlan::default() };
        let mut tracker = Tracker::new(&Orders::armax(2, &[2, 1], 1, &[1, 0]).unwrap(), &plan).unwrap();
        let tracked = run(&mut tracker, &inputs, &y);
        assert_eq!(tracker.names(), ["a1", "a2", "b1_1", "b1_2", "b2_0", "constant", "c1"]);

        let scales = tracker.scales().unwrap();
        let with_constant = [INPUTS[0], INPUTS[1], InputOrders { nb: 1, nk: 0 }];
        let library = ArmaxOrders { na: 2, inputs: &with_constant, nc: 1, constant: false };
        let input_scales = [scales.inputs[0], scales.inputs[1], 1.0];
        let mut library: RecursiveArmax<f64, Dyn, Dyn> = RecursiveArmax::new(
            &library,
            core,
            scales.output,
            &input_scales,
            scales.output / 10.0,
            Forgetting::default(),
        )
        .unwrap();
        let expected: Vec<f64> = inputs
            .iter()
            .zip(&y)
            .map(|(u, &y)| library.log_row(y, &[u[0], u[1], 1.0]).unwrap().error)
            .collect();
        assert!(tracked.iter().zip(&expected).skip(16).all(|(found, expected)| found.error == *expected));
        assert_eq!(tracker.parameters().unwrap(), library.estimator().parameters().as_slice());
    }
}

#[test]
fn without_forgetting_it_ends_at_the_batch_fit() {
    let (inputs, y) = log(2000, 0.3, 0.0, 4);
    let channel = |j: usize| -> Vec<f64> { inputs.iter().map(|u| u[j]).collect() };
    let (first, second) = (channel(0), channel(1));
    let record = Record::new(&y, vec![&first, &second]).unwrap();
    let batch = arx(&record, &orders(), Initial::Drop).unwrap();

    let exact = exactly(&TrackPlan::default());
    let mut tracker = Tracker::new(&orders(), &exact).unwrap();
    run(&mut tracker, &inputs, &y);
    for (found, expected) in tracker.parameters().unwrap().iter().zip(batch.parameters()) {
        assert!((found - expected).abs() <= 1e-9 * expected.abs(), "{found} {expected}");
    }
    let mut errors = [0.0; 5];
    tracker.write_standard_errors(&mut errors).unwrap();
    for (found, row) in errors.iter().zip(batch.covariance().unwrap().iter().enumerate()) {
        assert!((found / row.1[row.0].sqrt() - 1.0).abs() < 1e-6);
    }

    // The prior of the standard start pulls at them by (Phi'Phi + S)^-1 S theta, S_jj = scale_j^2/100: nearly P S
    // theta.
    let mut standard = Tracker::new(&orders(), &TrackPlan { start: TrackStart::default(), ..exact }).unwrap();
    run(&mut standard, &inputs, &y);
    let scales = standard.scales().unwrap();
    let scale = [scales.output, scales.output, scales.inputs[0], scales.inputs[0], scales.inputs[1]];
    let pull = |row: &[f64]| -> f64 {
        let terms = row.iter().zip(batch.parameters()).zip(scale);
        terms
            .map(|((entry, theta), scale)| entry / batch.noise_variance() * scale * scale / 100.0 * theta)
            .sum()
    };
    for (index, row) in batch.covariance().unwrap().iter().enumerate() {
        let moved = batch.parameters()[index] - standard.parameters().unwrap()[index];
        assert!((moved / pull(row) - 1.0).abs() < 0.02 && moved.abs() > 1e-6, "{moved} {}", pull(row));
    }
}

#[test]
fn an_exact_start_predicts_nothing_before_it_knows_something() {
    let (inputs, y) = log(100, 0.3, 0.0, 5);
    let scales = Some(PerChannel { inputs: vec![3.0, 1.0], output: 10.0 });
    let mut tracker =
        Tracker::new(&orders(), &TrackPlan { scales, ..exactly(&TrackPlan::default()) }).unwrap();
    let mut known = 0;
    for (u, &y) in inputs.iter().zip(&y) {
        let before = tracker.parameters().is_some();
        let tracked = tracker.log_row(y, u).unwrap();
        assert_eq!(tracked.predicted.is_finite(), before, "{tracked:?}");
        assert_eq!(tracked.error.is_finite(), before);
        assert_eq!(tracker.forecast(1).unwrap().is_finite(), tracker.parameters().is_some());
        known += usize::from(before);
    }
    // Two rows fill the lines, five parameters need five more.
    assert!((90..=93).contains(&known), "{known}");
}

#[test]
fn a_missing_output_is_predicted_all_the_same() {
    let (inputs, mut y) = log(200, 0.3, 0.0, 6);
    let truth = y[150];
    y[150] = f64::NAN;
    let mut tracker = Tracker::new(&orders(), &TrackPlan::default()).unwrap();
    let tracked = run(&mut tracker, &inputs, &y);
    let missing = tracked[150];
    assert_eq!(missing.action, Action::Missing);
    assert!((missing.predicted - truth).abs() < 0.5 && missing.error.is_nan() && missing.variance.is_nan());
    // In the next two samples it is in the taps.
    assert!(tracked[151].predicted.is_nan() && tracked[152].predicted.is_nan());
    assert!(tracked[153].predicted.is_finite());
}

#[test]
fn what_is_too_large_is_missing_and_what_is_infinite_is_refused() {
    let (inputs, y) = log(200, 0.3, 0.0, 7);
    let mut tracker = Tracker::new(&orders(), &TrackPlan::default()).unwrap();
    assert!(tracker.log_row(-2e98, &[1.0, 2.0]).unwrap().too_large);
    run(&mut tracker, &inputs, &y);
    assert!(tracker.scales().unwrap().output < 1e3);

    let mut missing = tracker.clone();
    let found = tracker.log_row(f64::MAX, &[1e200, 1.0]).unwrap();
    let expected = missing.log_row(f64::NAN, &[f64::NAN, 1.0]).unwrap();
    assert!(found.too_large && !expected.too_large && found.action == expected.action);
    let after = |tracker: &mut Tracker| {
        run(tracker, &inputs, &y);
        serde_json::to_string(tracker).unwrap()
    };
    assert_eq!(after(&mut tracker), after(&mut missing));

    let before = serde_json::to_string(&tracker).unwrap();
    assert!(matches!(tracker.log_row(1.0, &[1.0, f64::INFINITY]), Err(Error::Data { .. })));
    assert!(matches!(tracker.log_row(f64::NEG_INFINITY, &[1.0, 1.0]), Err(Error::Data { .. })));
    assert!(matches!(tracker.log_row(1.0, &[1.0]), Err(Error::Argument { .. })));
    assert_eq!(serde_json::to_string(&tracker).unwrap(), before);

    // The largest that is taken is taken.
    let largest = (f64::MAX / 2_f64.powi(36) / 5.0).sqrt() * (1.0 - 1e-11);
    assert!(!tracker.log_row(1.0, &[1.0, largest]).unwrap().too_large);
}

#[test]
fn a_forecast_holds_the_inputs() {
    let (inputs, y) = log(500, 0.0, 0.0, 8);
    let offsets = Some(PerChannel { inputs: vec![1.0, -2.0], output: 50.0 });
    let shifted: Vec<[f64; 2]> = inputs.iter().map(|u| [u[0] + 1.0, u[1] - 2.0]).collect();
    let raised: Vec<f64> = y.iter().map(|y| y + 50.0).collect();
    let plan = TrackPlan { offsets, ..exactly(&TrackPlan::default()) };
    let mut tracker = Tracker::new(&orders(), &plan).unwrap();
    assert!(tracker.forecast(3).unwrap().is_nan());
    run(&mut tracker, &shifted, &raised);

    let (last, before) = (inputs[499], inputs[498]);
    let mut future = [y[498], y[499], 0.0, 0.0, 0.0];
    let mut u1 = [before[0], last[0], last[0], last[0], last[0]];
    u1[0] = before[0];
    for t in 2..5 {
        future[t] = 1.5 * future[t - 1] - 0.7 * future[t - 2] + 2.0 * u1[t - 1] + 0.5 * u1[t - 2] - last[1];
    }
    let found = tracker.forecast(3).unwrap();
    assert!((found - 50.0 - future[4]).abs() < 1e-8 * future[4].abs(), "{found} {future:?}");
    // It changes nothing, and other horizons do not change it.
    assert!((tracker.forecast(1).unwrap() - 50.0 - future[2]).abs() < 1e-8 * future[2].abs());
    assert!(tracker.forecast(10_000).unwrap().is_finite());
    for steps in [0, 10_001] {
        assert!(
            matches!(tracker.forecast(steps), Err(Error::Argument { argument, .. }) if argument == "horizon")
        );
    }
    assert_eq!(tracker.forecast(3).unwrap(), found);
    tracker.log_row(50.0, &[f64::NAN, 0.0]).unwrap();
    assert!(tracker.forecast(3).unwrap().is_nan());
}

#[test]
fn a_constant_and_offsets_are_found_and_put_back() {
    let (inputs, y) = log(1500, 0.1, 0.0, 9);
    // A (y - 50) = … is A y = … + 50 A(1), A(1) = 0.2.
    let raised: Vec<f64> = y.iter().map(|y| y + 50.0).collect();
    let plan = exactly(&TrackPlan { constant: true, ..TrackPlan::default() });
    let mut tracker = Tracker::new(&orders(), &plan).unwrap();
    let with_constant = run(&mut tracker, &inputs, &raised);
    assert_eq!(tracker.names()[5], "constant");
    // The first row stands for the offsets: A (y - y_1) = B (u - u_1) + 10 - A(1) y_1 + B(1) u_1.
    let expected = 10.0 - 0.2 * raised[0] + 2.5 * inputs[0][0] - inputs[0][1];
    assert!((tracker.parameters().unwrap()[5] - expected).abs() < 0.2);
    assert_eq!((tracker.offsets().output, &tracker.offsets().inputs[..]), (raised[0], &inputs[0][..]));

    let offsets = Some(PerChannel { inputs: vec![0.0, 0.0], output: 50.0 });
    let mut tracker = Tracker::new(&orders(), &TrackPlan { offsets, constant: false, ..plan }).unwrap();
    let with_offsets = run(&mut tracker, &inputs, &raised);
    for (a, b) in with_constant.iter().zip(&with_offsets).skip(200) {
        assert!((a.predicted - b.predicted).abs() < 0.1 && (raised[0] - 50.0).abs() < 5.0);
    }
}

#[test]
fn the_score_is_its_definition() {
    let (inputs, y) = log(1000, 0.3, 0.0, 10);
    let mut tracker = Tracker::new(&orders(), &TrackPlan::default()).unwrap();
    assert_eq!((tracker.score().mean_squared_error(), tracker.score().fit()), (None, None));
    let tracked = run(&mut tracker, &inputs, &y);
    // Twelve rows are collected, and 2 n + 20 = 30 predictions do not count.
    let (counted, y) = (&tracked[42..], &y[42..]);
    let count = counted.len() as f64;
    let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / count;
    let mse = mean(&mut counted.iter().map(|t| t.error * t.error));
    let center = mean(&mut y.iter().copied());
    let variance = mean(&mut y.iter().map(|y| (y - center) * (y - center)));
    let gaussian = |t: &Tracked| -0.5 * ((2.0 * std::f64::consts::PI * t.variance).ln() + t.nis);
    let score = tracker.score();
    let near = |found: Option<f64>, expected: f64| {
        assert!((found.unwrap() / expected - 1.0).abs() < 1e-12, "{found:?} {expected}");
    };
    assert_eq!((score.samples(), score.evaluated()), (958, 958));
    near(score.mean_squared_error(), mse);
    near(score.fit(), 100.0 * (1.0 - (mse / variance).sqrt()));
    near(score.mean_nis(), mean(&mut counted.iter().map(|t| t.nis)));
    near(score.log_likelihood(), counted.iter().map(gaussian).sum());
    assert!(score.fit().unwrap() > 90.0 && (score.mean_nis().unwrap() - 1.0).abs() < 0.2);
}

#[test]
fn a_change_of_the_plant_is_noticed_at_once() {
    let (inputs, mut y) = log(4000, 0.3, 0.0, 11);
    // From row 3000 on the first input acts on a constant load.
    y.iter_mut().skip(3000).for_each(|y| *y += 2.0);
    let plan = TrackPlan { alarm_interval: Some(1e5), ..TrackPlan::default() };
    let mut tracker = Tracker::new(&orders(), &plan).unwrap();
    let tracked = run(&mut tracker, &inputs, &y);
    let alarm = tracked.iter().position(|tracked| tracked.alarm.is_some()).unwrap();
    assert!((3000..3010).contains(&alarm), "{alarm}");
    assert!(matches!(tracked[alarm].alarm.unwrap().chart, Chart::MeanUp | Chart::Variance));
    assert!(tracker.detector().is_some());
}
