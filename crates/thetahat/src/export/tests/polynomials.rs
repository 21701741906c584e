use super::*;
use crate::data::Offset;
use crate::model::{Orders, PolynomialModel, Signal};
use crate::report::apply;
use crate::respond::{Horizon, InitialCondition};

/// Models of all structures, with two inputs, delays and offsets.
fn models() -> Vec<Model> {
    let cases: [(Orders, &[f64]); 7] = [
        (Orders::arx(2, &[2, 1], &[1, 3]).expect("orders"), &[-1.5, 0.7, 0.3, 0.2, -0.4]),
        (Orders::armax(2, &[2, 1], 1, &[0, 2]).expect("orders"), &[-1.5, 0.7, 0.3, 0.2, -0.4, 0.5]),
        (Orders::oe(&[2, 1], &[2, 1], &[1, 4]).expect("orders"), &[0.3, 0.2, -0.4, -1.5, 0.7, -0.8]),
        (
            Orders::bj(&[2, 1], 1, 2, &[2, 0], &[1, 4]).expect("orders"),
            &[0.3, 0.2, -0.4, 0.5, -0.9, 0.2, -1.5, 0.7],
        ),
        (
            Orders::new(2, &[2, 1], 1, 1, &[0, 1], &[2, 1]).expect("orders"),
            &[-1.2, 0.5, 0.3, 0.2, -0.4, 0.5, -0.9, -0.6],
        ),
        (
            Orders::arx(6, &[7, 1], &[1, 1]).expect("orders"),
            &[-0.9, 0.1, 0.05, -0.1, 0.02, 0.03, 0.3, 0.2, 0.1, 0.4, 0.5, 0.6, 0.7, -0.4],
        ),
        (Orders::arx(0, &[1, 1], &[0, 0]).expect("orders"), &[0.3, -0.4]),
    ];
    let of = |(orders, theta): (Orders, &[f64])| {
        let mut model = PolynomialModel::from_parameters(&orders, theta, None, 1.0, 0.1).expect("a model");
        let signal = |name: &str, level| Signal { name: name.into(), offset: Offset { level, slope: 0.0 } };
        model.inputs = vec![signal("u", 0.5), signal("v", 0.0)];
        model.output = signal("y", 20.0);
        model.into()
    };
    cases.into_iter().map(of).collect()
}

fn a_log() -> Log {
    let y = signal(3, 300).iter().map(|y| 20.0 + y).collect();
    log(&[("u", signal(1, 300)), ("v", signal(2, 300)), ("y", y)], 0.1)
}

#[test]
fn a_simulator_says_the_bits_of_the_library() {
    let log = a_log();
    for model in models() {
        let form = form(&model, Purpose::Simulator).expect("a form");
        let found = said(&form.program, &model, &log);
        let applied =
            apply(&model, &log, &[], None, Horizon::FreeRun, InitialCondition::Zero).expect("a run");
        assert_eq!(found[0], applied.outputs[0].predicted, "{}", model.name());
    }
}

#[test]
fn a_predictor_says_what_the_library_does_before_it_is_measured() {
    let log = a_log();
    for model in models() {
        let form = form(&model, Purpose::Predictor).expect("a form");
        let found = said(&form.program, &model, &log);
        let one = Horizon::Steps { steps: 1 };
        let applied = apply(&model, &log, &[], None, one, InitialCondition::Zero).expect("a run");
        for (one, other) in found[0].iter().zip(&applied.outputs[0].predicted) {
            // The library takes e(t) from y(t), which is rounded once more.
            assert!((one - other).abs() <= 1e-12, "{}: {one} {other}", model.name());
        }
    }
}

#[test]
fn a_missing_output_is_predicted_and_a_missing_input_held() {
    for model in models() {
        let form = form(&model, Purpose::Predictor).expect("a form");
        let (u, v) = (signal(1, 40), signal(2, 40));
        let mut y: Vec<f64> = signal(3, 40).iter().map(|y| 20.0 + y).collect();
        let plain =
            said(&form.program, &model, &log(&[("u", u.clone()), ("v", v.clone()), ("y", y.clone())], 0.1));
        // What is predicted, measured, changes nothing but for its rounding.
        let mut held = u.clone();
        held[20] = held[19];
        y[30] = f64::NAN;
        let mut missing = u.clone();
        missing[20] = f64::NAN;
        let one =
            said(&form.program, &model, &log(&[("u", missing), ("v", v.clone()), ("y", y.clone())], 0.1));
        y[30] = one[0][30];
        let other = said(&form.program, &model, &log(&[("u", held), ("v", v), ("y", y)], 0.1));
        assert_eq!(one[0][..20], plain[0][..20]);
        assert!(
            one[0].iter().zip(&other[0]).all(|(one, other)| (one - other).abs() < 1e-12),
            "{}",
            model.name()
        );
    }
}

#[test]
fn what_cannot_be_exported_is_refused_by_name() {
    let model = &models()[0];
    for purpose in [Purpose::Observer, Purpose::Controller] {
        let error = form(model, purpose).expect_err("no such thing");
        assert!(error.to_string().contains("take predictor, simulator"), "{error}");
    }
    let alone =
        PolynomialModel::from_parameters(&Orders::arx(1, &[], &[]).expect("orders"), &[-0.5], None, 1.0, 1.0);
    let alone: Model = alone.expect("a model").into();
    assert!(form(&alone, Purpose::Simulator).is_err() && form(&alone, Purpose::Predictor).is_ok());
    let Model::Polynomial(moving) = model.clone() else { return };
    let mut moving = *moving;
    moving.output.offset.slope = 0.1;
    let error = form(&moving.into(), Purpose::Predictor).expect_err("an offset that moves");
    assert!(error.to_string().contains("the offset of 'y' is a line"), "{error}");
}
