use super::*;
use crate::data::Offset;
use crate::model::{Parameter, ProcessModel, ProcessStructure, Signal};
use crate::report::apply;
use crate::respond::{Horizon, InitialCondition};

fn model(words: &[&str], values: &[f64]) -> Model {
    let structures: Vec<ProcessStructure> =
        words.iter().map(|word| word.parse().expect("a structure")).collect();
    let signal = |name: String, level| Signal { name, offset: Offset { level, slope: 0.0 } };
    let inputs: Vec<Signal> = (1..=words.len()).map(|number| signal(format!("u{number}"), 0.3)).collect();
    let names: Vec<String> = inputs.iter().map(|input| input.name.clone()).collect();
    let parameters = ProcessModel::names(&structures, &names).into_iter().zip(values);
    let parameter = |(name, &value): (String, &f64)| Parameter { name, value, standard_error: None };
    ProcessModel {
        structures,
        sample_time: 0.5,
        inputs,
        output: signal("y".to_owned(), 20.0),
        parameters: parameters.map(parameter).collect(),
        covariance: None,
        offset_covariance: None,
        noise_variance: 1.0,
        degrees_of_freedom: None,
        free_start: false,
    }
    .into()
}

#[test]
fn programs_say_what_the_library_does() {
    let log = log(&[("u1", signal(1, 400)), ("u2", signal(2, 400)), ("y", signal(3, 400))], 0.5);
    for (words, values) in [
        (vec!["p1d"], vec![2.0, 3.0, 1.3]),
        (vec!["p2dz", "p1"], vec![2.0, 3.0, 1.5, 0.7, 1.0, -1.0, 0.4]),
        (vec!["p2du"], vec![1.5, 2.0, 0.3, 0.2]),
        (vec!["p1di"], vec![0.5, 3.0, 2.1]),
        (vec!["p0id"], vec![0.5, 0.9]),
        (vec!["rc2"], vec![0.5, 0.9, 3.0, 0.3, 20.0]),
        (vec!["tf21d", "tf31"], vec![1.0, 0.4, 1.5, 0.8, 0.6, 0.3, 1.0, 1.5, 2.0, 0.7]),
    ] {
        let model = model(&words, &values);
        let run = apply(&model, &log, &[], None, Horizon::FreeRun, InitialCondition::Zero).expect("a run");
        for purpose in [Purpose::Simulator, Purpose::Predictor] {
            let found = said(&form(&model, purpose).expect("a form").program, &model, &log);
            let largest = run.outputs[0].predicted.iter().fold(0.0_f64, |largest, y| largest.max(y.abs()));
            for (one, other) in found[0].iter().zip(&run.outputs[0].predicted) {
                assert!((one - other).abs() <= 1e-12 * largest, "{words:?}: {one} {other}");
            }
        }
    }
    let error = form(&model(&["p1d"], &[1.0, 1.0, 1e9]), Purpose::Simulator).expect_err("too long");
    assert!(error.to_string().contains("samples long"), "{error}");
}
