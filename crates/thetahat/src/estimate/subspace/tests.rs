use thetahat_core::nalgebra::{DMatrix, DVector};
use thetahat_numerics::random::Random;

use super::*;
use crate::model::riccati::stationary;
use crate::tests::assert_refused;

/// Two inputs, two outputs, four states of two lightly damped modes.
pub(in crate::estimate) fn plant() -> StateSpace {
    StateSpace {
        f: DMatrix::from_row_slice(
            4,
            4,
            &[0.8, 0.4, 0.0, 0.0, -0.4, 0.8, 0.0, 0.0, 0.0, 0.0, 0.3, 0.6, 0.1, 0.0, -0.6, 0.3],
        ),
        g: DMatrix::from_row_slice(4, 2, &[1.0, 0.2, -0.5, 0.7, 0.3, 1.0, 0.0, -0.8]),
        h: DMatrix::from_row_slice(2, 4, &[1.0, 0.0, 0.5, 0.0, 0.0, 0.6, 0.0, 1.0]),
        d: DMatrix::from_row_slice(2, 2, &[0.0, 0.0, 0.4, 0.0]),
        k: DMatrix::from_row_slice(4, 2, &[0.3, 0.0, 0.1, 0.2, 0.0, 0.1, -0.1, 0.3]),
        noise_covariance: DMatrix::from_row_slice(2, 2, &[0.25, 0.1, 0.1, 0.2]),
        sample_time: 1.0,
    }
}

/// u and y, N samples each, of a plant whose inputs are u = r - feedback y, r of variance 1.
pub(in crate::estimate) struct Run {
    pub(in crate::estimate) inputs: Vec<Vec<f64>>,
    pub(in crate::estimate) outputs: Vec<Vec<f64>>,
}

impl Run {
    fn new(model: &StateSpace, count: usize, seed: u64, noise: f64, feedback: &DMatrix<f64>) -> Self {
        let mut random = Random::of(seed, 0);
        let (l, m) = model.d.shape();
        let root = model.noise_covariance.clone().cholesky().unwrap().l() * noise;
        let mut state = DVector::zeros(model.f.nrows());
        let (mut inputs, mut outputs) = (vec![Vec::new(); m], vec![Vec::new(); l]);
        for _ in 0..count {
            let e = &root * DVector::from_fn(l, |_, _| random.normal());
            let r = DVector::from_fn(m, |_, _| random.normal());
            // y = H x + e + D (r - feedback y).
            let loop_matrix = DMatrix::identity(l, l) + &model.d * feedback;
            let y = loop_matrix.lu().solve(&(&model.h * &state + &e + &model.d * &r)).unwrap();
            let u = r - feedback * &y;
            inputs.iter_mut().zip(u.iter()).for_each(|(signal, value)| signal.push(*value));
            outputs.iter_mut().zip(y.iter()).for_each(|(signal, value)| signal.push(*value));
            state = &model.f * state + &model.g * u + &model.k * e;
        }
        Self { inputs, outputs }
    }

    pub(in crate::estimate) fn open(model: &StateSpace, count: usize, seed: u64, noise: f64) -> Self {
        Self::new(model, count, seed, noise, &DMatrix::zeros(model.g.ncols(), model.h.nrows()))
    }

    pub(in crate::estimate) fn record(&self) -> JointRecord<'_> {
        JointRecord::new(
            self.inputs.iter().map(Vec::as_slice).collect(),
            self.outputs.iter().map(Vec::as_slice).collect(),
        )
        .unwrap()
    }
}

/// D, H G, H F G, …
fn markov(model: &StateSpace) -> DMatrix<f64> {
    let (l, m) = model.d.shape();
    let mut all = DMatrix::zeros(l, m * 60);
    let mut through = model.g.clone();
    all.columns_mut(0, m).copy_from(&model.d);
    for lag in 1..60 {
        all.columns_mut(m * lag, m).copy_from(&(&model.h * &through));
        through = &model.f * through;
    }
    all
}

pub(in crate::estimate) fn distance(found: &StateSpace, truth: &StateSpace) -> f64 {
    (markov(found) - markov(truth)).norm() / markov(truth).norm()
}

#[test]
fn data_without_noise_give_the_plant() {
    let run = Run::open(&plant(), 600, 1, 0.0);
    let found = subspace(&run.record(), &SubspaceOptions::default()).unwrap();
    assert!(found.feedthrough());
    assert_eq!(found.order(&run.record(), found.orders()).unwrap(), 4);
    let model = found.state_space(4, 1.0).unwrap();
    let error = distance(&model, &plant());
    assert!(error < 1e-7, "{error}");
}

#[test]
fn noise_leaves_what_it_must_and_the_order_is_found() {
    let run = Run::open(&plant(), 3000, 2, 1.0);
    let record = run.record();
    let found = subspace(&record, &SubspaceOptions::default()).unwrap();
    assert_eq!(found.order(&record, found.orders()).unwrap(), 4);
    let model = found.state_space(4, 0.5).unwrap();
    assert_eq!(model.sample_time, 0.5);
    assert!(distance(&model, &plant()) < 0.04, "{}", distance(&model, &plant()));
    // The noise model too: K seen from the outputs, and the covariance of e.
    let by_noise = |model: &StateSpace| markov(&StateSpace { g: model.k.clone(), ..model.clone() });
    let error = (by_noise(&model) - by_noise(&plant())).norm() / by_noise(&plant()).norm();
    assert!(error < 0.25, "{error}");
    let spread =
        (&model.noise_covariance - plant().noise_covariance).norm() / plant().noise_covariance.norm();
    assert!(spread < 0.1, "{spread}");
}

/// A controller that acts at once: u(t) and e(t) are correlated, and D is not estimated unless it is asked for.
#[test]
fn fed_back_inputs_do_not_bias() {
    let plant = StateSpace { d: DMatrix::zeros(2, 2), ..plant() };
    let feedback = DMatrix::from_row_slice(2, 2, &[0.3, 0.1, -0.2, 0.3]);
    assert!(is_stable(&(&plant.f - &plant.g * &feedback * &plant.h)));
    let error = |count| {
        let mut errors: Vec<f64> = (0..9)
            .map(|seed| {
                let run = Run::new(&plant, count, seed, 3.0, &feedback);
                let found = subspace(&run.record(), &SubspaceOptions::default()).unwrap();
                assert!(!found.feedthrough());
                distance(&found.state_space(4, 1.0).unwrap(), &plant)
            })
            .collect();
        errors.sort_by(f64::total_cmp);
        errors[4]
    };
    let (short, long) = (error(1000), error(16_000));
    assert!(long < 0.06 && long < 0.4 * short, "{short} {long}");
}

#[test]
fn an_unstable_plant_in_a_loop_is_found() {
    let mut plant = StateSpace { d: DMatrix::zeros(2, 2), ..plant() };
    plant.f[(2, 2)] = 1.05;
    plant.f[(3, 2)] = 0.0;
    plant.f[(2, 3)] = 0.0;
    plant.g = DMatrix::identity(4, 2);
    plant.g[(2, 0)] = 1.0;
    let feedback = DMatrix::from_row_slice(2, 2, &[0.4, 0.0, 0.0, 0.0]);
    assert!(!is_stable(&plant.f) && is_stable(&(&plant.f - &plant.g * &feedback * &plant.h)));
    let run = Run::new(&plant, 4000, 4, 0.3, &feedback);
    let found = subspace(&run.record(), &SubspaceOptions::default()).unwrap();
    let model = found.state_space(4, 1.0).unwrap();
    assert!(!is_stable(&model.f) && is_stable(&(&model.f - &model.k * &model.h)));
    let largest = model.f.complex_eigenvalues().iter().map(|value| value.norm()).fold(0.0, f64::max);
    assert!((largest - 1.05).abs() < 0.01, "{largest}");
}

#[test]
fn a_series_without_inputs_has_a_model() {
    let plant = StateSpace { g: DMatrix::zeros(4, 0), d: DMatrix::zeros(2, 0), ..plant() };
    let run = Run::open(&plant, 4000, 5, 1.0);
    let record = run.record();
    let found = subspace(&record, &SubspaceOptions::default()).unwrap();
    assert!(!found.feedthrough());
    let model = found.state_space(found.order(&record, 1..=8).unwrap(), 1.0).unwrap();
    let spread = (&model.noise_covariance - plant.noise_covariance).norm();
    assert!(spread < 0.04, "{spread}");
}

#[test]
fn other_units_give_the_same_model() {
    let run = Run::open(&plant(), 800, 6, 1.0);
    let scaled = |signals: &[Vec<f64>], factors: [f64; 2]| -> Vec<Vec<f64>> {
        signals.iter().zip(factors).map(|(s, factor)| s.iter().map(|x| x * factor).collect()).collect()
    };
    let other = Run { inputs: scaled(&run.inputs, [1e6, 1e-3]), outputs: scaled(&run.outputs, [1e-6, 1e3]) };
    let model = |run: &Run| {
        let found = subspace(&run.record(), &SubspaceOptions::default()).unwrap();
        found.state_space(4, 1.0).unwrap()
    };
    let (mut there, here) = (model(&other), model(&run));
    there.g.column_mut(0).scale_mut(1e6);
    there.g.column_mut(1).scale_mut(1e-3);
    there.d.column_mut(0).scale_mut(1e6);
    there.d.column_mut(1).scale_mut(1e-3);
    for matrix in [&mut there.h, &mut there.d] {
        matrix.row_mut(0).scale_mut(1e6);
        matrix.row_mut(1).scale_mut(1e-3);
    }
    assert!(distance(&there, &here) < 1e-10, "{}", distance(&there, &here));
}

/// Segments of one experiment: only samples with their past count, and each is scored from a state of its own.
#[test]
fn segments_are_apart() {
    let run = Run::open(&plant(), 4000, 7, 0.5);
    let mut record = run.record();
    record.segments = vec![0..900, 1000..2500, 2600..2603, 2700..4000];
    let found = subspace(&record, &SubspaceOptions::default()).unwrap();
    assert_eq!(found.order(&record, 1..=8).unwrap(), 4);
    assert!(distance(&found.state_space(4, 1.0).unwrap(), &plant()) < 0.03);
}

/// P = 4 P/(P + 1) + 1.
#[test]
fn the_gain_is_that_of_a_stationary_filter() {
    let one = || DMatrix::from_element(1, 1, 1.0);
    let zero = || DMatrix::from_element(1, 1, 0.0);
    let model = StateSpace {
        f: one() * 2.0,
        g: one(),
        h: one(),
        d: zero(),
        k: zero(),
        noise_covariance: one(),
        sample_time: 1.0,
    };
    let found = stationary(&model, &one()).unwrap();
    let p = 2.0 + 5_f64.sqrt();
    assert!((found.k[(0, 0)] - 2.0 * p / (p + 1.0)).abs() < 1e-13);
    assert!((found.noise_covariance[(0, 0)] - p - 1.0).abs() < 1e-12);
    assert!(is_stable(&(&found.f - &found.k * &found.h)));
}

#[test]
fn what_cannot_be_told_is_said() {
    let run = Run::open(&plant(), 300, 8, 1.0);
    let options = |past| SubspaceOptions { past: Some(past), ..SubspaceOptions::default() };
    let message = |record: &JointRecord<'_>, options: &SubspaceOptions| {
        subspace(record, options).unwrap_err().to_string()
    };
    let whole = run.record();
    assert!(message(&whole, &options(0)).starts_with("past: it is 0"));
    assert!(message(&whole, &options(80)).contains("makes 324 lagged signals, and 220 samples"));
    assert!(message(&whole, &options(usize::MAX)).contains("more samples than signals"));
    let mut short = whole.clone();
    short.segments[0] = 0..9;
    assert!(message(&short, &SubspaceOptions::default()).contains("give more rows, or fewer channels"));
    let zeros = vec![0.0; 300];
    let silent = JointRecord::new(vec![&run.inputs[0], &zeros], vec![&run.outputs[0]]).unwrap();
    assert!(message(&silent, &SubspaceOptions::default()).starts_with("input 2 is zero"));
    let silent = JointRecord::new(vec![&run.inputs[0]], vec![&run.outputs[0], &zeros]).unwrap();
    assert!(message(&silent, &SubspaceOptions::default()).starts_with("output 2 is zero"));
    let huge: Vec<f64> = run.outputs[0].iter().map(|y| y * 1e200).collect();
    let huge = JointRecord::new(vec![&run.inputs[0]], vec![&huge]).unwrap();
    assert!(message(&huge, &SubspaceOptions::default()).starts_with("output 1 is zero, or too large"));
    let nothing = JointRecord { outputs: Vec::new(), ..whole.clone() };
    assert!(message(&nothing, &SubspaceOptions::default()).contains("no outputs"));

    let found = subspace(&whole, &SubspaceOptions::default()).unwrap();
    let highest = found.highest_order();
    for order in [0, highest + 1] {
        let error = found.state_space(order, 1.0).unwrap_err().to_string();
        assert_eq!(error, format!("order: it is {order}; the data tell of orders from 1 to {highest}"));
    }
    assert_refused(found.order(&whole, highest + 1..=highest + 3), "range is empty");
    let one = JointRecord::new(vec![], vec![&run.outputs[0]]).unwrap();
    assert_refused(found.scores(&one, [1]), "0 inputs and 1 outputs");
    // A copy of an output, a constant one: something is found, or said.
    let copied = JointRecord::new(vec![&run.inputs[0]], vec![&run.outputs[0], &run.outputs[0]]).unwrap();
    if let Ok(found) = subspace(&copied, &SubspaceOptions::default()) {
        let model = found.state_space(2, 1.0).unwrap();
        assert!(model.f.iter().chain(model.h.iter()).all(|value| value.is_finite()));
    }
    let constant = vec![3.0; 300];
    let constant = JointRecord::new(vec![&run.inputs[0]], vec![&constant]).unwrap();
    if let Ok(found) = subspace(&constant, &SubspaceOptions::default()) {
        assert!(found.scores(&constant, found.orders()).is_ok());
    }
}

#[test]
fn a_predictor_of_too_low_an_order_knows_its_errors() -> Result<(), Error> {
    let run = Run::open(&plant(), 4000, 11, 1.0);
    let record = run.record();
    let found = subspace(&record, &SubspaceOptions::default())?;
    for order in [2, 3, 4] {
        let model = found.state_space(order, 1.0)?;
        let seen = products_of_innovations(&model, &record, &[0.0, 0.0]).ok_or(Error::data("no errors"))?;
        let apart = log_determinant(&(seen / 4000.0)) - log_determinant(&model.noise_covariance);
        // The gain of a regression on all past samples leaves 2 more at order 2.
        assert!(apart.abs() < 0.35, "{order}: {apart}");
    }
    Ok(())
}
