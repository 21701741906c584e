mod missing_outputs;

use thetahat_core::nalgebra::DMatrix;
use thetahat_numerics::noise::Noise;

use super::*;
use crate::data::{Channel, Log, Offset};
use crate::model::{LinearModel, Model, Orders, PolynomialModel, Signal, StateSpace, StateSpaceModel};
use crate::respond::{
    Horizon, InitialCondition, OnLog, PolynomialOnLog, frequency_response, impulse_response, step_response,
};
use crate::tests::{assert_refused, channel};

fn signal(name: &str) -> Signal {
    Signal { name: name.to_owned(), offset: Offset::default() }
}

/// A y = B u + C e, and the same in state space.
fn pair() -> (PolynomialModel, StateSpaceModel) {
    let orders = Orders::new(2, &[2, 1], 1, 0, &[0, 0], &[1, 0]).unwrap();
    let parameters = [-1.5, 0.7, 1.0, 0.5, -0.3, 0.4];
    let mut model = PolynomialModel::from_parameters(&orders, &parameters, None, 0.25, 0.1).unwrap();
    model.inputs = vec![signal("u1"), signal("u2")];
    model.output = signal("y");
    (model.clone(), of(&model, &model.state_space(), vec![0, 0]))
}

fn of(model: &PolynomialModel, space: &StateSpace, delays: Vec<usize>) -> StateSpaceModel {
    let signals = (model.inputs.clone(), vec![model.output.clone()]);
    StateSpaceModel::new(signals, delays, space, 6, None).unwrap()
}

/// Two inputs and the output of a model that noise drives.
fn log(model: &PolynomialModel, rows: usize) -> Log {
    let mut noise = Noise(1);
    let mut draw = |scale: f64| -> Vec<f64> { (0..rows).map(|_| scale * noise.uniform()).collect() };
    let (u1, u2, e) = (draw(1.0), draw(1.0), draw(0.5));
    let StateSpace { f, g, h, d, k, .. } = model.state_space();
    let mut state = DMatrix::from_element(f.nrows(), 1, 2.0);
    let mut y = Vec::new();
    for t in 0..rows {
        let u = DMatrix::from_column_slice(2, 1, &[u1[t], u2[t]]);
        y.push((&h * &state + &d * &u)[(0, 0)] + e[t]);
        state = &f * state + &g * u + &k * e[t];
    }
    Log::new(vec![channel("u1", u1), channel("u2", u2), channel("y", y)], 0.1).unwrap()
}

fn apart(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let known = found.iter().zip(expected).filter(|(found, expected)| !(found.is_nan() && expected.is_nan()));
    known.map(|(found, expected)| (found - expected).abs()).fold(0.0, f64::max)
}

#[test]
fn it_responds_to_frequencies_and_steps_as_its_polynomials_do() {
    let (polynomials, states) = pair();
    let model = LinearModel::StateSpace(&states, 0);
    let frequencies = [0.01, 0.5, 3.0, 12.0, std::f64::consts::PI / 0.1];
    let found = model.frequency_response(&frequencies).unwrap();
    let expected = frequency_response(&polynomials, &frequencies).unwrap();
    assert_eq!(found.len(), 3);
    for (found, expected) in found.iter().zip(&expected) {
        assert_eq!(found.input, expected.input);
        for (found, expected) in found.points.iter().zip(&expected.points) {
            assert!((found.re - expected.re).hypot(found.im - expected.im) < 1e-12, "{found:?} {expected:?}");
            assert!((found.phase.value - expected.phase.value).abs() < 1e-12, "{found:?} {expected:?}");
        }
    }
    for input in 0..2 {
        for (found, expected) in [
            (model.step_response(input, Some(60)), step_response(&polynomials, input, Some(60))),
            (model.impulse_response(input, Some(60)), impulse_response(&polynomials, input, Some(60))),
        ] {
            let (found, expected) = (found.unwrap(), expected.unwrap());
            assert_eq!((&found.input, &found.time), (&expected.input, &expected.time));
            let values =
                |all: &[crate::model::Quantity]| -> Vec<f64> { all.iter().map(|one| one.value).collect() };
            assert!(apart(&values(&found.values), &values(&expected.values)) < 1e-12);
        }
    }
    let whole = model.step_response(0, None).unwrap();
    let (last, gain) = (whole.values.last().unwrap().value, states.dc_gain[0][0].unwrap().value);
    assert!((20..60).contains(&whole.values.len()) && (last / gain - 1.0).abs() < 0.01);
    let gains: Vec<f64> = states.dc_gain[0].iter().map(|gain| gain.unwrap().value).collect();
    let expected: Vec<f64> = polynomials.dc_gain.iter().map(|gain| gain.unwrap().value).collect();
    assert!(apart(&gains, &expected) < 1e-12);
    assert!(model.step_response(2, None).is_err() && model.step_response(0, Some(0)).is_err());
    assert!(model.frequency_response(&[40.0]).is_err());
}

#[test]
fn it_predicts_as_its_polynomials_do() {
    let (polynomials, states) = pair();
    let log = log(&polynomials, 400);
    let rows = ["1..150".parse().unwrap(), "201..400".parse().unwrap()];
    let zero = InitialCondition::Zero;
    let other = PolynomialOnLog::new(&polynomials, &log, &rows, Some(zero)).unwrap();
    let own = StateSpaceOnLog::new(&states, &log, &rows, Some(zero)).unwrap();
    let late = |values: &[f64]| values[230..].to_vec();
    for horizon in [1, 2, 7].map(|steps| Horizon::Steps { steps }) {
        let (found, expected) = (own.respond(horizon, zero).unwrap(), other.respond(horizon, zero).unwrap());
        // What stood before the second part the polynomials know; the root of C is 0.4.
        assert!(apart(&late(&found[0].values), &late(&expected[0].values)) < 1e-9, "{horizon}");
    }
    let (found, expected) =
        (own.respond(Horizon::FreeRun, zero).unwrap(), other.respond(Horizon::FreeRun, zero).unwrap());
    assert!(apart(&found[0].values, &expected[0].values) < 1e-11);
    for steps in [1, 4] {
        let (found, expected) =
            (own.deviations(steps, zero).unwrap(), other.deviations(steps, zero).unwrap());
        assert!(apart(&late(&found[0]), &late(&expected[0])) < 1e-12);
    }
    // From the state that fits best the first errors are smaller.
    let from_best = StateSpaceOnLog::new(&states, &log, &rows, None).unwrap();
    let errors = |start| {
        let found = from_best.respond(Horizon::Steps { steps: 1 }, start).unwrap();
        let y = &log.channel("y").unwrap().values;
        (0..20).map(|t| (y[t] - found[0].values[t]).powi(2)).sum::<f64>()
    };
    assert!(errors(InitialCondition::Estimate) < 0.8 * errors(zero));
    assert!(from_best.respond(Horizon::FreeRun, InitialCondition::Drop).is_err());
}

#[test]
fn it_goes_on_after_the_last_output() {
    let (polynomials, states) = pair();
    let mut whole = log(&polynomials, 100);
    let rows = ["1..100".parse().unwrap()];
    let mut channels: Vec<Channel> =
        ["u1", "u2", "y"].map(|name| whole.channel(name).unwrap().clone()).to_vec();
    channels[2].values[90..].fill(f64::NAN);
    whole = Log::new(channels, 0.1).unwrap();
    let start = InitialCondition::Zero;
    let own = StateSpaceOnLog::new(&states, &whole, &rows, Some(start)).unwrap();
    let other = PolynomialOnLog::new(&polynomials, &whole, &rows, Some(start)).unwrap();
    let (first, found) = own.forecast(&whole, &rows, 10, start).unwrap().unwrap();
    let (same, expected) = other.forecast(&whole, &rows, 10, start).unwrap().unwrap();
    assert_eq!((first, same), (90, 90));
    assert!(apart(&found[0].values, &expected[0].values) < 1e-10);
    assert!(apart(&found[0].standard_deviations, &expected[0].standard_deviations) < 1e-12);
}

#[test]
fn inputs_that_wait_act_so_much_later() {
    let (polynomials, _) = pair();
    let states = of(&polynomials, &polynomials.state_space(), vec![3, 0]);
    let model = LinearModel::StateSpace(&states, 0);
    assert_eq!(
        (states.f.len(), states.order(), states.name().as_str()),
        (5, 2, "state space of order 2, delays 3, 0")
    );
    let late = model.step_response(0, Some(40)).unwrap();
    let plain = step_response(&polynomials, 0, Some(37)).unwrap();
    for (t, expected) in plain.values.iter().enumerate() {
        assert!((late.values[t + 3].value - expected.value).abs() < 1e-12);
    }
    assert!(late.values[..4].iter().all(|value| value.value == 0.0));
    // Three samples turn a sine by three times its angle more.
    let [found, expected] = [model.frequency_response(&[2.0]), frequency_response(&polynomials, &[2.0])];
    let turned = found.unwrap()[0].points[0].phase.value - expected.unwrap()[0].points[0].phase.value;
    assert!((turned + 3.0 * 2.0 * 0.1).abs() < 1e-12, "{turned}");
    Model::from(states).check().unwrap();
}

#[test]
fn a_damaged_model_is_refused() {
    let (_, states) = pair();
    type Damage = fn(&mut StateSpaceModel);
    let cases: [(Damage, &str); 9] = [
        (|model| model.f[0].truncate(1), "f is not 2 x 2"),
        (|model| model.g[1][0] = f64::NAN, "g has a value that is not finite"),
        (|model| model.delays = vec![1], "delays"),
        (|model| model.delays = vec![usize::MAX, 1], "delays"),
        (|model| model.noise_covariance[0][0] = -1.0, "noise_covariance"),
        (|model| model.outputs.clear(), "outputs has none"),
        (|model| model.inputs[1].name = "y".to_owned(), "'y' twice"),
        (|model| model.poles.clear(), "poles"),
        (|model| model.sample_time = 0.0, "sample_time"),
    ];
    for (change, words) in cases {
        let mut model = states.clone();
        change(&mut model);
        assert_refused(Model::from(model).check(), words);
    }
}
