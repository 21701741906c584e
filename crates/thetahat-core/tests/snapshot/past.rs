//! A window of samples, and a filter with a history.

use serde_json::json;
use thetahat_core::nalgebra::{Const, DVector, Dyn, Matrix2, SVector, Vector1, Vector2, Vector3};
use thetahat_core::{Covariance, KalmanFilter, OutOfSequenceFilter, Window, WindowedLeastSquares};

use super::{check, model, output, refuses, value};

#[test]
fn out_of_sequence_filter() {
    let (transition, observation) = model();
    let prior = Covariance::new(&Matrix2::new(4.0, 1.0, 1.0, 2.0)).unwrap();
    let filter = KalmanFilter::new(Vector2::new(0.5, -1.0), prior).unwrap().with_gate(5.0).unwrap();
    let late: OutOfSequenceFilter<f64, Const<2>, Const<1>, Const<0>, Const<40>> =
        OutOfSequenceFilter::new(filter, Const, Const, 4).unwrap();
    check(late, |late, k| {
        let input = SVector::zeros();
        // Each third measurement comes two samples late.
        let now = if k % 3 == 0 { f64::NAN } else { output(k) };
        let answer = late.correct(&observation, &input, &Vector1::new(now));
        let after = if k % 3 == 2 {
            Some(late.correct_late(&transition, &observation, 2, &Vector1::new(value(7 * k))))
        } else {
            None
        };
        late.predict(&transition, &input).unwrap();
        (answer, after, late.filter().clone())
    });
}

#[test]
fn windowed_least_squares() {
    for window in [Window { blocks: 6, block: 1 }, Window { blocks: 3, block: 4 }] {
        let windowed: WindowedLeastSquares<f64, Const<3>, Const<60>> =
            WindowedLeastSquares::new(Const, window).unwrap();
        check(windowed, |windowed, k| {
            let held = if (8..16).contains(&k) { 1.0 } else { value(k) };
            let answer = windowed.update(&Vector3::new(held, value(3 * k), 1.0), output(k));
            (answer, *windowed.parameters(), windowed.noise_variance(), windowed.is_determined())
        });
    }
}

#[test]
fn what_is_no_window_and_no_history_is_refused() {
    let numbers = &[json!("NaN"), json!("inf"), json!(1e300)][..];
    let mut windowed: WindowedLeastSquares<f64, Dyn, Dyn> =
        WindowedLeastSquares::new(Dyn(2), Window { blocks: 3, block: 2 }).unwrap();
    for k in 0..9 {
        windowed.update(&DVector::from_vec(vec![value(k), 1.0]), value(3 * k)).unwrap();
    }
    refuses(
        &windowed,
        &[
            ("/window/blocks", &[json!(2), json!(4), json!(0), json!(u64::MAX)]),
            ("/window/block", &[json!(0), json!(1), json!(u64::MAX)]),
            ("/stored/2/3", numbers),
            ("/parameters/2/0", numbers.split_last().unwrap().1),
            ("/parameters", &[json!([3, 1, [0.0, 0.0, 0.0]])]),
            ("/older_blocks", &[json!(3), json!(u64::MAX)]),
            ("/newer_blocks", &[json!(0), json!(2), json!(u64::MAX)]),
            ("/current/rows", &[json!(0), json!(2)]),
        ],
    );

    let (transition, observation) = model();
    let prior = Covariance::new(&Matrix2::new(4.0, 1.0, 1.0, 2.0)).unwrap();
    let filter = KalmanFilter::new(Vector2::new(0.5, -1.0), prior).unwrap();
    let mut late: OutOfSequenceFilter<f64, Const<2>, Const<1>, Const<0>, Const<40>> =
        OutOfSequenceFilter::new(filter, Const, Const, 2).unwrap();
    for k in 0..5 {
        late.correct(&observation, &SVector::zeros(), &Vector1::new(value(k))).unwrap();
        late.predict(&transition, &SVector::zeros()).unwrap();
    }
    refuses(
        &late,
        &[
            ("/history/samples", &[json!(0), json!(1), json!(6), json!(u64::MAX)]),
            ("/history/states", &[json!(1), json!(3)]),
            ("/history/outputs", &[json!(0), json!(2), json!(u64::MAX)]),
            ("/history/inputs", &[json!(1)]),
            ("/newest", &[json!(3), json!(u64::MAX)]),
            ("/kept", &[json!(3), json!(u64::MAX)]),
            ("/ring/2/0", &[json!("NaN"), json!("inf")]),
            ("/ring/2/2", &[json!(-1.0), json!("NaN")]),
            ("/ring/2/6", &[json!("inf")]),
        ],
    );
}
