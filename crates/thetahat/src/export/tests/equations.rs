use super::states::tells_what_the_filter_does;
use super::*;
use crate::export::interpret::Machine;
use crate::filter::{Estimator, StateFilter, StateModel};
use crate::model::{EquationsModel, GreyBox};
use crate::report::apply;
use crate::respond::{Horizon, InitialCondition};

fn model(text: &str) -> Model {
    let model = GreyBox::from_toml(text).expect("a model");
    let values = vec![0.7; model.unknown().count()];
    let covariance =
        (0..values.len()).map(|i| (0..values.len()).map(|j| f64::from(u8::from(i == j))).collect()).collect();
    EquationsModel::new(&model, &values, covariance, &model.measurement_variances_at_start()).into()
}

#[test]
fn simulators_say_what_the_library_does() {
    for text in TEXTS {
        let model = model(text);
        let (log, run) = (silent(), free_run(&model));
        let found = said(&form(&model, Purpose::Simulator).expect("a form").program, &model, &log);
        for (found, expected) in found.iter().zip(&run) {
            same(found, expected, 1e-11);
        }
    }
}

/// The same numbers, to a part of the largest.
fn same(found: &[f64], expected: &[f64], share: f64) {
    let largest = expected.iter().fold(1.0_f64, |largest, y| largest.max(y.abs()));
    for (row, (one, other)) in found.iter().zip(expected).enumerate() {
        assert!((one - other).abs() <= share * largest, "row {row}: {one} {other}");
    }
}

const TEXTS: [&str; 3] = [
        "sample_time = 0.1
         [states]
         x = { start = 0.3, sd = 1 }
         v = { start = 0, sd = 1 }
         [inputs]
         force = 'u'
         [parameters]
         k = { start = 2, sd = 1, unknown = true, min = 0 }
         [next]
         x = 'x + dt * v'
         v = 'v + dt * (force - k * sin(x) - 0.4 * v * abs(v) + 0.01 * t)'
         [outputs]
         y = 'x'
         z = 'max(x, v)^2 / (1 + exp(-x)) + sign(force)'
         [noise]
         process = { v = 0.05 }
         measurement = { y = 0.1, z = 0.1 }",
        "sample_time = 0.1
         substeps = 3
         [states]
         x = { start = 0.3, sd = 1 }
         v = { start = 1, sd = 1 }
         [inputs]
         force = 'u'
         [parameters]
         k = { start = 2, sd = 1, unknown = true, min = 0 }
         [derivative]
         x = 'v'
         v = 'force - k * tanh(x) - sqrt(1 + v^2) * v^3 * (1 + x^2)^-2.5 / (3 + x^-3) + cos(t) * atan2(v, 2) + min(x, 0.1)'
         [outputs]
         y = 'x + t'
         z = 'ln(2 + x^2) + (1 + x^2)^1.5 - 1/(1 + x^2)^12'
         [noise]
         process = { v = 0.05 }
         measurement = { y = 0.1, z = 0.1 }",
        "sample_time = 0.1
         [states]
         x = { start = 0.3, sd = 1 }
         v = { start = 0, sd = 1 }
         [inputs]
         force = 'u'
         [parameters]
         k = { start = 2, sd = 1, unknown = true, min = 0 }
         [next]
         x = 'x + dt * v'
         v = 'v + dt * (dead(force, -0.2, 0.3) - table(x; -2:-3, -0.2:-1, 0:0, 0.1:k, 0.5:2, 2:2) - 0.4 * v)'
         [outputs]
         y = 'lines(x + v; -0.5:-1, -0.1:k, 0:0, 0.5:1) + sat(v, -0.1, 0.1 within 0.05)'
         z = 'if v > 0.1 * k and (x < 0.2 or not x < 0.5) then x else if x <= 0 within 0.1 then v else -v'
         [noise]
         process = { v = 0.05 }
         measurement = { y = 0.1, z = 0.1 }",
];

/// Inputs, and outputs that are nothing.
fn silent() -> Log {
    log(&[("u", signal(1, 200)), ("y", vec![0.0; 200]), ("z", vec![0.0; 200])], 0.1)
}

fn free_run(model: &Model) -> Vec<Vec<f64>> {
    let run = apply(model, &silent(), &[], None, Horizon::FreeRun, InitialCondition::Zero).expect("a run");
    run.outputs.into_iter().map(|output| output.predicted).collect()
}

#[test]
fn predictors_and_observers_are_the_extended_kalman_filter() {
    for text in TEXTS {
        let model = model(text);
        let measured: Vec<Vec<f64>> = free_run(&model)
            .iter()
            .zip(2..)
            .map(|(run, seed)| run.iter().zip(signal(seed, 200)).map(|(y, noise)| y + 0.2 * noise).collect())
            .collect();
        let mut outputs = measured;
        // Rows without one output, and without both.
        outputs[0][50..60].fill(f64::NAN);
        outputs[1][55..65].fill(f64::NAN);
        let channels = [("u", signal(1, 200)), ("y", outputs[0].clone()), ("z", outputs[1].clone())];
        let log = log(&channels, 0.1);
        let program = |purpose| form(&model, purpose).expect("a form").program;
        let ahead = apply(&model, &log, &[], None, Horizon::Steps { steps: 1 }, InitialCondition::Estimate);
        let predicted = said(&program(Purpose::Predictor), &model, &log);
        for (found, expected) in predicted.iter().zip(ahead.expect("a run").outputs) {
            same(found, &expected.predicted, 1e-9);
        }
        let text = text.replace("k = { start = 2, sd = 1, unknown = true, min = 0 }", "k = 0.7");
        let mut filter =
            StateFilter::new(StateModel::from_toml(&text).expect("a model"), Estimator::Extended)
                .expect("a filter");
        let mut states = vec![Vec::new(); 2];
        let observer = program(Purpose::Observer);
        let mut machine = Machine::new(&observer, Precision::F64);
        for row in 0..200 {
            let y: Vec<f64> = outputs.iter().map(|output| output[row]).collect();
            let estimate = filter.step(None, &channels[0].1[row..=row], &y).expect("a step");
            machine.run(&observer.entries[0], &[&channels[0].1[row..=row], &y]);
            // States are the same to 1e-9 of the largest, and outputs of them that are some hundred less accurate.
            tells_what_the_filter_does(&machine, &observer, &estimate, 1e-6);
            let filtered = estimate.filtered.expect("a filtered state");
            states.iter_mut().zip(filtered.values).for_each(|(states, value)| states.push(*value));
        }
        assert_eq!(machine.missed(), 20);
        for (found, expected) in said(&observer, &model, &log).iter().zip(&states) {
            same(found, expected, 1e-9);
        }
    }
}

#[test]
fn estimators_of_equations_are_refused() {
    for purpose in [Purpose::Recursive, Purpose::Controller] {
        let error = form(&model(TEXTS[0]), purpose).expect_err("no such export").to_string();
        assert!(error.contains("take simulator, predictor or observer"), "{error}");
    }
}
