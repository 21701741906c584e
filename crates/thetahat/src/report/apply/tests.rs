use super::*;
use crate::model::{Orders, PolynomialModel};
use crate::respond::prediction_deviation;
use crate::tests::channel;

/// A(q) y = B(q) u + e around levels and slopes, with an input if there is a B.
fn model(a: f64, b: &[f64]) -> PolynomialModel {
    let nk = [1];
    let orders = Orders::arx(1, &[b.len()][..b.len().min(1)], &nk[..b.len().min(1)]).unwrap();
    let parameters = [&[a], b].concat();
    let mut model = PolynomialModel::from_parameters(&orders, &parameters, None, 0.25, 2.0).unwrap();
    model.output.name = "y".to_owned();
    model.output.offset = Offset { level: 5.0, slope: 0.1 };
    for input in &mut model.inputs {
        input.name = "u".to_owned();
        input.offset = Offset { level: -1.0, slope: 0.0 };
    }
    model
}

/// What `y` is measured from in a row (0-based).
fn level(row: usize) -> f64 {
    5.0 + 0.1 * 2.0 * row as f64
}

fn predicted(model: &PolynomialModel, log: &Log, rows: &[Rows], steps: usize) -> One {
    one(apply(&model.clone().into(), log, rows, None, Horizon::Steps { steps }, InitialCondition::Drop)
        .unwrap())
}

/// What is said of the only output.
struct One {
    beyond: usize,
    measured: Option<Vec<f64>>,
    predicted: Vec<f64>,
    standard_deviations: Option<Vec<f64>>,
    fit: Option<Fit>,
}

fn one(applied: Applied) -> One {
    let [AppliedOutput { name, measured, predicted, standard_deviations, fit }] =
        <[AppliedOutput; 1]>::try_from(applied.outputs).unwrap();
    assert_eq!(name, "y");
    One { beyond: applied.beyond, measured, predicted, standard_deviations, fit }
}

fn near(found: f64, expected: f64) -> bool {
    (found - expected).abs() < 1e-12 || (found.is_nan() && expected.is_nan())
}

#[test]
fn a_series_is_forecast_beyond_its_end() {
    let model = model(-0.5, &[]);
    let y = [6.0, 4.0, 7.0, 6.5, 5.5];
    let log = Log::new(vec![channel("y", y)], 2.0).unwrap();
    let applied = predicted(&model, &log, &[], 3);
    let deviations = applied.standard_deviations.unwrap();
    assert_eq!((applied.beyond, applied.predicted.len(), deviations.len()), (3, 8, 8));
    assert_eq!(applied.measured.unwrap(), y);
    let known = [f64::NAN, f64::NAN, f64::NAN, y[0] - level(0), y[1] - level(1)].map(|y| y / 8.0);
    let last = y[4] - level(4);
    let ahead = [last / 2.0, last / 4.0, last / 8.0];
    for (row, expected) in known.iter().chain(&ahead).enumerate() {
        assert!(near(applied.predicted[row], expected + level(row)), "{row}");
    }
    let spread = [3, 3, 1, 2, 3].map(|steps| prediction_deviation(&model, steps).unwrap());
    assert!(deviations[..3].iter().all(|deviation| deviation.is_nan()));
    assert_eq!(deviations[3..], spread);
    // The last two values are missing: two of three steps lie in the log.
    let log = Log::new(vec![channel("y", [y[0], y[1], y[4], f64::NAN, f64::NAN])], 2.0).unwrap();
    let applied = predicted(&model, &log, &[], 3);
    assert_eq!((applied.beyond, applied.predicted.len()), (1, 6));
    let last = y[4] - level(2);
    for (step, expected) in [last / 2.0, last / 4.0, last / 8.0].into_iter().enumerate() {
        assert!(near(applied.predicted[3 + step], expected + level(3 + step)));
        assert_eq!(applied.standard_deviations.as_ref().unwrap()[3 + step], spread[2 + step]);
    }
    assert_eq!(applied.fit.unwrap().samples, 0);
    // One step of three.
    assert_eq!(predicted(&model, &log, &[], 1).beyond, 0);
    assert!(predicted(&model, &log, &[], 1).predicted[4].is_nan());
}

#[test]
fn rows_that_were_not_asked_for_are_not_forecast() {
    let model = model(-0.5, &[]);
    let log = Log::new(vec![channel("y", [1.0, 2.0, 3.0, 4.0])], 2.0).unwrap();
    let rows = |text: &str| [text.parse().unwrap()];
    let applied = predicted(&model, &log, &rows("1..3"), 2);
    assert_eq!((applied.beyond, applied.predicted.len()), (0, 4));
    assert!(applied.predicted[3].is_nan());
    assert_eq!(predicted(&model, &log, &rows("2..4"), 2).beyond, 2);
    // One row is enough for this model, and none is not.
    assert_eq!(predicted(&model, &log, &rows("4..4"), 2).beyond, 2);
    let none = Log::new(vec![channel("y", [f64::NAN; 4])], 2.0).unwrap();
    assert_eq!(predicted(&model, &none, &[], 2).beyond, 0);
    let far =
        apply(&model.into(), &log, &[], None, Horizon::Steps { steps: usize::MAX }, InitialCondition::Drop);
    assert!(matches!(far, Err(Error::Argument { argument, .. }) if argument == "horizon"));
}

#[test]
fn missing_outputs_at_the_end_are_forecast_from_their_inputs() {
    let model = model(-0.5, &[2.0]);
    let nan = f64::NAN;
    let u = [0.0, 1.0, -1.0, 2.0, 3.0, 1.0, 0.0];
    let y = [5.0, 6.0, 7.0, nan, nan, nan, nan];
    let log = |u: &[f64]| Log::new(vec![channel("u", u), channel("y", y)], 2.0).unwrap();
    let applied = predicted(&model, &log(&u), &[], 3);
    assert_eq!((applied.beyond, applied.predicted.len()), (0, 7));
    let mut last = y[2] - level(2);
    for row in 3..6 {
        last = 0.5 * last + 2.0 * (u[row - 1] + 1.0);
        assert!(near(applied.predicted[row], last + level(row)), "{row}");
        let deviation = applied.standard_deviations.as_ref().unwrap()[row];
        assert_eq!(deviation, prediction_deviation(&model, row - 2).unwrap());
    }
    // Farther than the horizon there is nothing, nor after a gap in the input.
    assert!(applied.predicted[6].is_nan());
    let gap = predicted(&model, &log(&[u[0], u[1], u[2], u[3], nan, u[5], u[6]]), &[], 3);
    assert!(gap.predicted[3].is_finite() && gap.predicted[4..].iter().all(|value| value.is_nan()));
    // A horizon beyond the log is no error where the inputs end it.
    assert!(predicted(&model, &log(&u), &[], usize::MAX).predicted[6].is_finite());
}

#[test]
fn a_jump_of_the_clock_ends_the_forecast() {
    let nan = f64::NAN;
    let time = vec![0.0, 2.0, 4.0, 6.0, 20.0, 22.0];
    let y = channel("y", [1.0, 2.0, 3.0, nan, nan, nan]);
    let log = Log::with_time(vec![y], time).unwrap();
    let applied = predicted(&model(-0.5, &[]), &log, &[], 4);
    assert_eq!(applied.beyond, 0);
    assert!(applied.predicted[3].is_finite() && applied.predicted[4].is_nan());
}

#[test]
fn free_runs_have_no_deviations_and_from_zero_they_grow() {
    let polynomial = model(-0.5, &[2.0]);
    let model = polynomial.clone().into();
    let y = [5.0, 6.0, 7.0, 5.0, 4.0];
    let log = Log::new(vec![channel("u", [1.0; 5]), channel("y", y)], 2.0).unwrap();
    let run = one(apply(&model, &log, &[], None, Horizon::FreeRun, InitialCondition::Estimate).unwrap());
    assert_eq!((run.beyond, run.standard_deviations, run.predicted.len()), (0, None, 5));
    let inputs = Log::new(vec![channel("u", [1.0; 5])], 2.0).unwrap();
    let run = one(apply(&model, &inputs, &[], None, Horizon::FreeRun, InitialCondition::Zero).unwrap());
    assert_eq!((run.measured, run.standard_deviations, run.predicted.len()), (None, None, 5));
    let zero =
        one(apply(&model, &log, &[], None, Horizon::Steps { steps: 2 }, InitialCondition::Zero).unwrap());
    let steps = [1, 2, 2, 2, 2].map(|steps| prediction_deviation(&polynomial, steps).unwrap());
    assert_eq!(zero.standard_deviations.unwrap(), steps);
}
