//! Planned standard errors are those that estimates have.

use thetahat::data::Record;
use thetahat::design::{SignalKind, SignalPlan, TestSignal, Waveform, planned};
use thetahat::estimate::{Initial, Method, estimate};
use thetahat::model::{Orders, PolynomialModel, Signal};

use super::runs;
use super::simulated::{BEFORE, Random, filtered};

/// The deviation of an output from its level, as a model has it from an input, with noise.
fn output(model: &PolynomialModel, u: &[f64], random: &mut Random) -> Vec<f64> {
    let e: Vec<f64> = random.normals(u.len()).iter().map(|e| model.noise_variance.sqrt() * e).collect();
    let x = filtered(&model.b[0], &model.f[0], u);
    let v = filtered(&model.c, &model.d, &e);
    let sum: Vec<f64> = x.iter().zip(&v).map(|(x, v)| x + v).collect();
    filtered(&[1.0], &model.a, &sum)
}

/// Estimates of some orders with the level of the output as the coefficient of a second input of ones: the parameters
/// without it, and the static gain.
fn estimated(orders: &Orders, y: &[f64], u: &[f64]) -> (Vec<f64>, PolynomialModel) {
    let ones = vec![1.0; y.len()];
    let record = Record::new(y, vec![u, &ones]).expect("the case is sound");
    let with = |own: usize, other: usize| [own, other];
    let wider = Orders::new(
        orders.na,
        &with(orders.nb[0], 1),
        orders.nc,
        orders.nd,
        &with(orders.nf[0], 0),
        &with(orders.nk[0], 0),
    );
    let wider = wider.expect("the case is sound");
    let found = estimate(&record, &wider, &Method::default(), Initial::Auto).expect("the case is sound");
    let mut parameters = found.parameters().to_vec();
    parameters.remove(orders.na + orders.nb[0]);
    let signals = ["u", "one"].map(|name| Signal { name: name.to_owned(), ..Signal::default() });
    let model = found.to_model(&wider, 1.0, signals.to_vec(), Signal::default()).expect("the case is sound");
    (parameters, model)
}

/// The ratio of planned to simulated errors of each parameter and of the static gain, over many experiments with a
/// signal.
fn assert_planned(orders: &Orders, truth: [&[f64]; 5], waveform: &str, length: usize) {
    let [a, b, c, d, f] = truth;
    // The truth is a model that was fitted: any will do.
    let mut random = Random::new(1);
    let u = random.normals(BEFORE + 4000);
    let e = random.normals(u.len());
    let (x, v) = (filtered(b, f, &u), filtered(c, d, &e));
    let y = filtered(&[1.0], a, &x.iter().zip(&v).map(|(x, v)| x + 0.5 * v).collect::<Vec<f64>>());
    let record = Record::new(&y[BEFORE..], vec![&u[BEFORE..]]).expect("the case is sound");
    let prior = estimate(&record, orders, &Method::default(), Initial::Auto).expect("the case is sound");
    let signal = Signal { name: "u".to_owned(), ..Signal::default() };
    let model = prior.to_model(orders, 1.0, vec![signal], Signal::default()).expect("the case is sound");

    let waveform: Waveform = waveform.parse().expect("a kind");
    let plan = SignalPlan { length, ..SignalPlan::new(waveform) };
    let inputs = TestSignal::new(&plan).expect("the case is sound").values(length);
    let known = planned(&model, &inputs).expect("the case is sound");
    let gain = |model: &PolynomialModel| model.dc_gain[0].expect("no integrator");
    let own = known.parameters.iter().map(|parameter| (parameter.name.as_str(), parameter.value));
    let errors = known.parameters.iter().map(|parameter| parameter.standard_error);
    let figures: Vec<(&str, f64)> = own.chain([("dc-gain", gain(&known).value)]).collect();
    let errors: Vec<f64> =
        errors.chain([gain(&known).standard_error]).map(|error| error.expect("it is known")).collect();

    // At rest at the first value, far from zero, until the experiment begins.
    let driven = [vec![inputs[0][0]; BEFORE], inputs[0].clone()].concat();
    let runs = runs(60);
    let mut errors_found = vec![Vec::with_capacity(runs); figures.len()];
    for seed in 0..runs as u64 {
        let y = output(&model, &driven, &mut Random::new(100 + seed));
        let y: Vec<f64> = y[BEFORE..].iter().map(|y| y + 3.0).collect();
        let (parameters, found) = estimated(orders, &y, &inputs[0]);
        let values = parameters.into_iter().chain([gain(&found).value]);
        for ((all, value), (_, truth)) in errors_found.iter_mut().zip(values).zip(&figures) {
            all.push(value - truth);
        }
    }
    // About their mean: that of a short log is biased, which no covariance says. The standard deviation of n errors is
    // known to 1/sqrt(2 n) of itself: beyond four times that it is another one.
    let spread = 4.0 / (2.0 * runs as f64).sqrt();
    let mut ratios = Vec::new();
    for (((name, _), error), found) in figures.iter().zip(&errors).zip(&errors_found) {
        let mean = found.iter().sum::<f64>() / runs as f64;
        let square = found.iter().map(|error| (error - mean).powi(2)).sum::<f64>();
        let ratio = error / (square / (runs - 1) as f64).sqrt();
        eprintln!("{:?} {waveform} {name}: planned over simulated {ratio:.3}", orders.structure());
        assert!((ratio - 1.0).abs() < spread, "{name}: {ratio}");
        ratios.push(ratio.ln());
    }
    let mean = (ratios.iter().sum::<f64>() / ratios.len() as f64).exp();
    eprintln!("{:?} {waveform}: {mean:.3}", orders.structure());
    // Of several figures together less is chance.
    assert!((mean - 1.0).abs() < 0.02 + 0.5 * spread, "{mean}");
}

const ONE: &[f64] = &[1.0];
const SLOW: &[f64] = &[1.0, -1.5, 0.7];

#[test]
fn planned_errors_of_arx_are_those_of_estimates() {
    let orders = Orders::arx(2, &[2], &[1]).expect("the case is sound");
    for waveform in ["prbs", "prbs:4", "steps:100", "multisine"] {
        assert_planned(&orders, [SLOW, &[0.0, 1.0, 0.5], ONE, ONE, ONE], waveform, 1000);
    }
}

#[test]
fn planned_errors_of_output_error_are_those_of_estimates() {
    let orders = Orders::oe(&[2], &[2], &[1]).expect("the case is sound");
    for waveform in ["prbs:2", "steps"] {
        assert_planned(&orders, [ONE, &[0.0, 1.0, 0.5], ONE, ONE, SLOW], waveform, 1000);
    }
}

#[test]
fn planned_errors_of_armax_and_box_jenkins_are_those_of_estimates() {
    let armax = Orders::armax(2, &[2], 1, &[1]).expect("the case is sound");
    assert_planned(&armax, [SLOW, &[0.0, 1.0, 0.5], &[1.0, 0.5], ONE, ONE], "rbs:2", 1000);
    let bj = Orders::bj(&[2], 1, 1, &[2], &[1]).expect("the case is sound");
    assert_planned(&bj, [ONE, &[0.0, 1.0, 0.5], &[1.0, 0.5], &[1.0, -0.8], SLOW], "prbs", 1000);
}

#[test]
fn every_kind_of_signal_can_be_planned_with() {
    let orders = Orders::arx(1, &[1], &[1]).expect("the case is sound");
    let first: [&[f64]; 5] = [&[1.0, -0.9], &[0.0, 1.0], ONE, ONE, ONE];
    for kind in SignalKind::all() {
        assert_planned(&orders, first, kind.word(), 2000);
    }
}
