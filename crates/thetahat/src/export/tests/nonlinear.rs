use super::interpret::Machine;
use super::map::evaluated;
use super::program::{Entry, Kind, Statement};
use super::*;
use crate::data::Offset;
use crate::model::{
    Activation, Evaluator, Map, Membership, NonlinearArxModel, OutputMap, Parameter, Regressor, Signal,
};
use crate::report::apply;
use crate::respond::{Horizon, InitialCondition};

fn maps() -> Vec<Map> {
    let centres = vec![vec![0.2, -0.4, 0.1], vec![1.0, 0.3, 0.0], vec![-0.7, 0.9, 0.5]];
    let domain = vec![[-1.0, 1.0]; 3];
    let local = |membership, planes| Map::Local {
        membership,
        planes,
        boxes: vec![
            vec![[-1.0, 0.0], [-1.0, 1.0], [-1.0, 1.0]],
            vec![[0.0, 1.0], [-1.0, 0.0], [-1.0, 1.0]],
            vec![[0.0, 1.0], [0.0, 1.0], [-1.0, 1.0]],
        ],
        domain: domain.clone(),
    };
    let network = |activation| Map::Network {
        activation,
        weights: vec![vec![0.7, -1.1, 0.3], vec![0.2, 0.4, -0.6], vec![0.9, -0.3, 0.2]],
        biases: vec![0.1, -0.4, 0.6],
    };
    let points = (0..20)
        .map(|k| vec![f64::from(k % 5) * 0.3 - 0.7, f64::from(k % 4) * 0.5 - 1.0, f64::from(k % 3) - 1.0]);
    vec![
        Map::Polynomial { terms: vec![vec![], vec![0], vec![0, 0, 1], vec![1, 2]] },
        Map::Radial { centres: centres.clone(), widths: vec![0.8, 1.0, 2.0], linear: false },
        Map::Radial { centres, widths: vec![0.8, 1.0, 2.0], linear: true },
        Map::Spline {
            regressors: vec![0, 1, 1],
            knots: vec![[-1.0, 0.5, 1.0], [-1.5, -1.0, 0.5], [-3.0, -0.5, 0.7]],
        },
        local(Membership::Rectangle, true),
        local(Membership::Trapezoid, true),
        local(Membership::Gaussian, false),
        network(Activation::Tanh),
        network(Activation::Logistic),
        network(Activation::Relu),
        network(Activation::Step),
        Map::Neighbours { count: 3, planes: false, points: points.collect() },
    ]
}

#[test]
fn statements_of_maps_say_the_bits_of_the_core() {
    for functions in maps() {
        let theta: Vec<f64> = (0..functions.parameters(3)).map(|j| 0.3 - j as f64 * 0.17).collect();
        let mut program = Program::default();
        let z = program.array(Kind::Argument, "z", "", vec![0.0; 3]);
        let y = program.array(Kind::Result, "y", "", vec![0.0]);
        let map = evaluated(&mut program, 1, &functions, theta.clone(), z);
        let Some((mut body, value)) = map.statements else { continue };
        body.push(Statement::Store(y, 0.into(), value.into()));
        let entry = Entry { name: "at", doc: Vec::new(), arguments: vec![z], result: Some(y), body };
        let mut machine = Machine::new(&program, Precision::F64);
        let evaluator = Evaluator::new(&functions, theta);
        for z in signal(5, 300).chunks_exact(3) {
            let z: Vec<f64> = z.iter().map(|z| 1.3 * z).collect();
            assert_eq!(
                machine.run(&entry, &[&z])[0].to_bits(),
                evaluator.value(&z).to_bits(),
                "{functions:?} {z:?}"
            );
        }
        for z in [[0.0, 0.0, 0.0], [1.0, -1.0, 1.0], [-1.0, 0.5, f64::NAN]] {
            let (one, other) = (machine.run(&entry, &[&z])[0], evaluator.value(&z));
            assert!(one == other || one.is_nan() && other.is_nan(), "{functions:?} {z:?}: {one} {other}");
        }
    }
}

fn model(functions: Map) -> Model {
    let signal = |name: &str, level| Signal { name: name.into(), offset: Offset { level, slope: 0.0 } };
    let regressor =
        |channel: &str, lag, scale| Regressor { channel: channel.into(), lag, scale, range: [-1.0, 1.0] };
    let theta: Vec<f64> = (0..functions.parameters(3)).map(|j| 0.1 - j as f64 * 0.01).collect();
    NonlinearArxModel {
        sample_time: 0.1,
        inputs: vec![signal("u", 0.5)],
        outputs: vec![signal("y", 20.0)],
        expressions: Vec::new(),
        regressors: vec![regressor("y", 2, 1.5), regressor("u", 0, 0.7), regressor("u", 3, 0.7)],
        maps: vec![OutputMap { scale: 1.5, range: [-1.0, 1.0], functions, run_errors: Vec::new() }],
        noise_covariance: vec![vec![1.0]],
        degrees_of_freedom: None,
        parameters: theta
            .into_iter()
            .map(|value| Parameter { name: "t".into(), value, standard_error: None })
            .collect(),
        covariance: None,
    }
    .into()
}

#[test]
fn programs_say_the_bits_of_the_library() {
    let y = signal(3, 200).iter().map(|y| 20.0 + y).collect();
    let log = log(&[("u", signal(1, 200)), ("y", y)], 0.1);
    for functions in maps() {
        let model = model(functions);
        let program = |purpose| form(&model, purpose).expect("a form").program;
        let respond =
            |horizon| apply(&model, &log, &[], None, horizon, InitialCondition::Zero).expect("a run").outputs;
        let found = said(&program(Purpose::Simulator), &model, &log);
        assert_eq!(found[0], respond(Horizon::FreeRun)[0].predicted, "{}", model.name());
        let found = said(&program(Purpose::Predictor), &model, &log);
        // The first samples have no past in the log.
        assert_eq!(found[0][3..], respond(Horizon::Steps { steps: 1 })[0].predicted[3..], "{}", model.name());
    }
}

#[test]
fn what_c_does_not_have_is_refused() {
    let mut with = model(maps().remove(0));
    if let Model::NonlinearArx(model) = &mut with {
        model.expressions.push(Signal { name: "sqrt(u)".into(), ..Signal::default() });
    }
    let error = form(&with, Purpose::Predictor).expect_err("an expression");
    assert!(error.to_string().contains("the expression sqrt(u)"), "{error}");
}
