use std::f64::consts::TAU;

use thetahat_core::nalgebra::DMatrix;

use super::*;
use crate::data::Offset;
use crate::export::interpret::Machine;
use crate::filter::{Estimator, InitialState, StateEstimate, StateFilter, StateModel};
use crate::model::{Hold, Signal, StateSpace, StateSpaceModel};
use crate::report::{StateSpacePlan, apply, fit_state_space};
use crate::respond::{Horizon, InitialCondition};

fn square(rows: [f64; 4]) -> DMatrix<f64> {
    DMatrix::from_row_slice(2, 2, &rows)
}

/// Two inputs, one of which waits, and two outputs.
fn model() -> Model {
    let signal = |name: &str, level| Signal { name: name.into(), offset: Offset { level, slope: 0.0 } };
    let matrices = StateSpace {
        f: square([0.8, 0.3, -0.2, 0.6]),
        g: square([0.5, 0.1, 0.0, -0.7]),
        h: square([1.0, 0.4, 0.3, -1.1]),
        d: square([0.0, 0.2, 0.1, 0.0]),
        k: square([0.3, 0.05, -0.1, 0.2]),
        noise_covariance: DMatrix::identity(2, 2),
        sample_time: 0.1,
    };
    let signals = (vec![signal("u", 0.5), signal("v", 0.0)], vec![signal("y", 20.0), signal("z", -3.0)]);
    StateSpaceModel::new(signals, vec![0, 2], &matrices, 12, None).expect("a model").into()
}

fn a_log() -> Log {
    let y = |seed: u32, level: f64| signal(seed, 300).iter().map(|y| level + y).collect();
    log(&[("u", signal(1, 300)), ("v", signal(2, 300)), ("y", y(3, 20.0)), ("z", y(4, -3.0))], 0.1)
}

#[test]
fn programs_say_what_the_library_does() {
    let (model, log) = (model(), a_log());
    let continuous: Model = model.to_continuous(Hold::default()).expect("a model in continuous time").into();
    for model in [model, continuous] {
        let respond =
            |horizon| apply(&model, &log, &[], None, horizon, InitialCondition::Zero).expect("a run").outputs;
        let form = |purpose| form(&model, purpose).expect("a form").program;
        let found = said(&form(Purpose::Simulator), &model, &log);
        let run = respond(Horizon::FreeRun);
        assert!((0..2).all(|output| found[output] == run[output].predicted), "{}", model.name());
        let found = said(&form(Purpose::Predictor), &model, &log);
        let ahead = respond(Horizon::Steps { steps: 1 });
        for output in 0..2 {
            // The library takes e(t) from y(t), which is rounded once more.
            let pairs = found[output].iter().zip(&ahead[output].predicted);
            assert!(
                pairs.clone().all(|(one, other)| (one - other).abs() <= 1e-13 * 24.0),
                "{}",
                model.name()
            );
        }
        // The state that predictions are made from.
        let states = said(&form(Purpose::Observer), &model, &log);
        let (matrices, u) = (form(Purpose::Predictor), 0);
        let h = matrices.arrays.iter().find(|array| array.name == "H").expect("H").values.clone();
        let d = matrices.arrays.iter().find(|array| array.name == "D").expect("D").values.clone();
        let inputs = [log.channel("u").expect("u"), log.channel("v").expect("v")]
            .map(|channel| channel.values.clone());
        for t in 1..300 {
            let seen: f64 = states.iter().zip(&h).map(|(x, h)| h * x[t - 1]).sum();
            let seen = seen + d[u] * (inputs[0][t] - 0.5) + d[1] * inputs[1][t] + 20.0;
            assert!((seen - found[0][t]).abs() < 1e-12);
        }
    }
}

/// What an observer tells of its steps along rows: innovations, variances, NIS, and how many numbers were missing.
#[test]
fn an_observer_tells_the_innovations_of_the_filter() {
    let (u, noise) = (signal(1, 300), [signal(3, 300), signal(4, 300)]);
    let (mut x, mut y) = ([0.0, 0.0], [Vec::new(), Vec::new()]);
    for row in 0..300 {
        // Outputs whose innovations go with one another.
        let e = [noise[0][row], 0.5 * noise[0][row] + noise[1][row]];
        y[0].push(20.0 + x[0] + 0.4 * x[1] + e[0]);
        y[1].push(x[1] - 3.0 + e[1]);
        x = [
            0.8 * x[0] + 0.3 * x[1] + u[row] + 0.3 * e[0],
            0.6 * x[1] - 0.2 * x[0] + 0.5 * u[row] + 0.2 * e[1],
        ];
    }
    let a_log = |y: &[Vec<f64>; 2]| log(&[("u", u.clone()), ("y", y[0].clone()), ("z", y[1].clone())], 0.1);
    for outputs in [&["y", "z"][..], &["y"]] {
        let plan = StateSpacePlan { orders: Some(2..=2), ..StateSpacePlan::new(&["u"], outputs) };
        let report = fit_state_space(&a_log(&y), &[], &plan).expect("a fit");
        let program = form(&report.model, Purpose::Observer).expect("a form").program;
        let observe = &program.entries[0];
        // Until the end, where one output is missing: the filter then knows its state less well than a stationary gain
        // says.
        for missing in 0..outputs.len() {
            let model = StateModel::from_report(&report, Some(InitialState::Zero)).expect("a model");
            let mut filter = StateFilter::new(model, Estimator::Kalman).expect("a filter");
            let mut machine = Machine::new(&program, Precision::F64);
            for row in 0..300 {
                let mut measured: Vec<f64> = y[..outputs.len()].iter().map(|y| y[row]).collect();
                if row == 299 {
                    measured[missing] = f64::INFINITY;
                }
                machine.run(observe, &[&[u[row]], &measured]);
                let known: Vec<f64> =
                    measured.iter().map(|y| if y.is_finite() { *y } else { f64::NAN }).collect();
                let expected = filter.step(None, &[u[row]], &known).expect("a step");
                tells_what_the_filter_does(&machine, &program, &expected, 1e-9);
            }
            assert_eq!(machine.missed(), 1);
        }
    }
}

/// The innovations, their variances by the likelihood that they give, and the NIS.
pub(super) fn tells_what_the_filter_does(
    machine: &Machine,
    program: &Program,
    expected: &StateEstimate<'_>,
    share: f64,
) {
    let same = |one: f64, other: f64| (one - other).abs() <= share * other.abs().max(1.0);
    let told = |name| machine.array(program, name);
    let (errors, variances, nis) = (told("innovation"), told("innovation_variance"), told("nis")[0]);
    assert_eq!(errors.len(), expected.innovations.len());
    for (error, other) in errors.iter().zip(expected.innovations) {
        assert!(same(*error, *other) || error.is_nan() && other.is_nan(), "{error} {other}");
    }
    assert!(same(nis, expected.nis.unwrap_or(0.0)), "{nis} {:?}", expected.nis);
    let known = variances.iter().filter(|variance| !variance.is_nan());
    let likelihood = known.fold(-0.5 * nis, |sum, variance| sum - 0.5 * (TAU * variance).ln());
    assert!(same(likelihood, expected.log_likelihood.expect("a likelihood")), "{likelihood}");
    // The last one that is there is given by nothing but the past.
    let last = variances.iter().rposition(|variance| !variance.is_nan());
    let deviations = expected.outputs.standard_deviations.expect("deviations");
    assert!(last.is_none_or(|last| same(variances[last].sqrt(), deviations[last])));
}

#[test]
fn a_missing_output_corrects_nothing() {
    let (model, log) = (model(), a_log());
    let predictor = form(&model, Purpose::Predictor).expect("a form").program;
    let plain = said(&predictor, &model, &log);
    let channel = |name: &str| log.channel(name).expect("a channel").values.clone();
    let with = |value: f64| {
        let mut z = channel("z");
        z[50] = value;
        super::log(&[("u", channel("u")), ("v", channel("v")), ("y", channel("y")), ("z", z)], 0.1)
    };
    let missing = said(&predictor, &model, &with(f64::NAN));
    let predicted = said(&predictor, &model, &with(plain[1][50]));
    assert!(
        missing
            .iter()
            .flatten()
            .zip(predicted.iter().flatten())
            .all(|(one, other)| (one - other).abs() < 1e-13)
    );
    assert_ne!(missing[0][51], plain[0][51]);
}
