use super::*;
use crate::model::{EquationsModel, GreyBox};
use crate::report::apply;
use crate::respond::{Horizon, InitialCondition};

fn model(text: &str) -> Model {
    let model = GreyBox::from_toml(text).expect("a model");
    let values = vec![0.7; model.unknown().count()];
    let covariance =
        (0..values.len()).map(|i| (0..values.len()).map(|j| f64::from(u8::from(i == j))).collect()).collect();
    EquationsModel::new(&model, &values, covariance).into()
}

#[test]
fn simulators_say_what_the_library_does() {
    let log = log(&[("u", signal(1, 200)), ("y", signal(2, 200)), ("z", signal(3, 200))], 0.1);
    for text in [
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
         v = 'force - k * tanh(x) - sqrt(1 + v^2) * v^3 * x^-2.5 / (3 + x^-3) + cos(t) * atan2(v, 2) + min(x, 0.1)'
         [outputs]
         y = 'x + t'
         z = 'ln(2 + x^2) + x^1.5 - 1/x^12'
         [noise]
         measurement = { y = 0.1, z = 0.1 }",
    ] {
        let model = model(&text.replace("x^-2.5", "(1 + x^2)^-2.5").replace("x^1.5 - 1/x^12", "(1 + x^2)^1.5 - 1/(1 + x^2)^12"));
        let run = apply(&model, &log, &[], None, Horizon::FreeRun, InitialCondition::Zero).expect("a run");
        let found = said(&form(&model, Purpose::Simulator).expect("a form").program, &model, &log);
        for (found, expected) in found.iter().zip(&run.outputs) {
            let largest = expected.predicted.iter().fold(1.0_f64, |largest, y| largest.max(y.abs()));
            for (one, other) in found.iter().zip(&expected.predicted) {
                assert!((one - other).abs() <= 1e-11 * largest, "{one} {other}");
            }
        }
    }
}
