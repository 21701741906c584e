//! The unscented filter and the iterated extended one, along rows.

use thetahat_numerics::noise::Noise;

use super::{FLOW, NILE, filter};
use crate::filter::{Estimator, StateFilter};
use crate::model::equations::tests::{CART, PENDULUM};

/// A distance that is measured well, of a point that walks slowly past.
const RADAR: &str = "sample_time = 1
[states]
x = { start = 3, sd = 1 }
y = { start = 1, sd = 1 }
[next]
x = 'x - 0.05'
y = 'y'
[outputs]
range = 'sqrt(x^2 + y^2)'
[noise]
process.x = 0.01
process.y = 0.01
measurement.range = 0.01
";

fn states(filter: &mut StateFilter, inputs: &[f64], outputs: &[f64]) -> Vec<f64> {
    let estimate = filter.step(None, inputs, outputs).unwrap();
    let filtered = estimate.filtered.unwrap();
    let numbers = [filtered.values, filtered.standard_deviations.unwrap(), estimate.outputs.values];
    let numbers = numbers.into_iter().chain(estimate.outputs.standard_deviations);
    numbers.flatten().copied().chain([estimate.nis.unwrap_or(0.0)]).collect()
}

fn assert_close(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() < tolerance * (1.0 + expected.abs()), "{found} {expected}");
    }
}

#[test]
fn with_a_linear_model_all_are_the_kalman_filter() {
    let all = [Estimator::Kalman, Estimator::Iterated, Estimator::Unscented];
    let mut filters = all.map(|estimator| filter(NILE, estimator).recording());
    for flow in FLOW {
        let [kalman, iterated, unscented] = filters.each_mut().map(|one| states(one, &[], &[flow]));
        assert_close(&iterated, &kalman, 1e-12);
        assert_close(&unscented, &kalman, 1e-9);
    }
    let [kalman, iterated, unscented] = filters.each_ref().map(|filter| filter.smooth().unwrap());
    for row in 1..=FLOW.len() {
        let of = |smoothed: &crate::filter::SmoothedStates| {
            let state = smoothed.row(row).unwrap().0;
            [state.values[0], state.standard_deviations.unwrap()[0]]
        };
        assert_close(&of(&iterated), &of(&kalman), 1e-12);
        assert_close(&of(&unscented), &of(&kalman), 1e-9);
    }
    let words = filters.map(|filter| filter.summary().estimator);
    assert_eq!(words, ["kalman", "iekf", "ukf"]);
}

/// Squared errors beside their variances, of the position of a point after 20 distances, over 200 logs: 2 if P is
/// right. No filter of one mean is: a distance does not tell on which side of the sensor the point is.
#[test]
fn deviations_promise_less_where_the_model_bends() {
    let found = [Estimator::Extended, Estimator::Iterated, Estimator::Unscented].map(|estimator| {
        let (mut noise, mut sum) = (Noise(3), 0.0);
        for _ in 0..200 {
            let mut filter = filter(RADAR, estimator.clone());
            let (mut x, mut y) = (3.0 + noise.normal(), 1.0 + noise.normal());
            for _ in 0..20 {
                states(&mut filter, &[], &[f64::hypot(x, y) + 0.01 * noise.normal()]);
                x += -0.05 + 0.01 * noise.normal();
                y += 0.01 * noise.normal();
            }
            let last = filter.latest().unwrap().filtered.unwrap();
            // The point before it went on.
            let errors = [x + 0.05 - last.values[0], y - last.values[1]];
            let deviations = last.standard_deviations.unwrap();
            sum += (0..2).map(|state| (errors[state] / deviations[state]).powi(2)).sum::<f64>();
        }
        sum / 200.0
    });
    let [extended, _, unscented] = found;
    assert!(unscented < 30.0 && extended > 5.0 * unscented, "{found:?}");
}

#[test]
fn unknown_parameters_are_found() {
    for estimator in [Estimator::Iterated, Estimator::Unscented] {
        let (mut noise, mut position, mut velocity) = (Noise(2), 0.3, -0.2);
        let mut filter = filter(CART, estimator);
        for k in 0..400 {
            let force = if k % 60 < 30 { 2.0 } else { -2.0 };
            filter.step(None, &[force], &[position + 0.05 * noise.normal()]).unwrap();
            let faster = velocity + 0.1 * (force - 0.4 * velocity) / 3.5 + 0.01 * noise.normal();
            position += 0.1 * velocity;
            velocity = faster;
        }
        let parameters = filter.latest().unwrap().parameters;
        let (mass, deviation) = (parameters.values[0], parameters.standard_deviations.unwrap()[0]);
        assert!((mass - 3.5).abs() < 3.0 * deviation && deviation < 0.35, "{mass} {deviation}");
        assert!((filter.summary().nis.unwrap().mean - 1.0).abs() < 4.0 * (2.0_f64 / 400.0).sqrt());
    }
}

#[test]
fn snapshots_go_on_to_the_bit() {
    for estimator in [Estimator::Iterated, Estimator::Unscented] {
        let mut noise = Noise(9);
        let mut row = || ([noise.normal()], [0.3 * noise.normal(), noise.normal()]);
        let mut kept = filter(PENDULUM, estimator.clone());
        for _ in 0..20 {
            let (u, y) = row();
            kept.step(None, &u, &y).unwrap();
        }
        let text = serde_json::to_string(&kept.snapshot()).unwrap();
        let mut again = filter(PENDULUM, estimator).resumed(serde_json::from_str(&text).unwrap()).unwrap();
        assert!(filter(PENDULUM, Estimator::Extended).resumed(kept.snapshot()).is_err());
        for _ in 0..20 {
            let (u, y) = row();
            assert_eq!(again.step(None, &u, &y).unwrap(), kept.step(None, &u, &y).unwrap());
        }
    }
}

#[test]
fn a_model_without_an_answer_at_a_point_is_told() {
    let text = "sample_time = 1\n[states]\nx = { start = 1, sd = 1 }\n[next]\nx = 'x'\n\
                [outputs]\ny = 'sqrt(x)'\n[noise]\nmeasurement.y = 1";
    let mut filter = filter(text, Estimator::Unscented);
    let error = filter.step(None, &[], &[1.0]).unwrap_err().to_string();
    assert!(
        error.starts_with("the estimate cannot go on: the predicted measurement is not finite"),
        "{error}"
    );
    assert!(filter.latest().is_none());
}
