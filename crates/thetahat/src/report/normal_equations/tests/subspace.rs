//! State-space models of a subspace method.

use super::vector_arx::{difference, log, pieces, with_gaps};
use super::*;
use crate::estimate::{Procedure, Refine, SubspaceOptions, SubspaceOutcome, Weighting};
use crate::model::{Model, StateSpaceModel};
use crate::report::fit_state_space;

fn plan() -> StateSpacePlan {
    StateSpacePlan::new(&["u", "v"], &["y", "z"])
}

fn outcome(report: &Report) -> &SubspaceOutcome {
    let Procedure::Subspace(outcome) = &report.estimation.procedure else { panic!("of a subspace method") };
    outcome
}

fn space(report: &Report) -> &StateSpaceModel {
    let Model::StateSpace(model) = &report.model else { panic!("a state-space model") };
    model
}

/// What does not depend on the signs of states: the offsets, D and H F^k [G K].
fn invariants(report: &Report) -> Vec<f64> {
    let model = space(report);
    let matrices = model.matrices();
    let mut found: Vec<f64> =
        model.inputs.iter().chain(&model.outputs).map(|signal| signal.offset.level).collect();
    found.extend(matrices.d.iter());
    let mut seen = matrices.h.clone();
    for _ in 0..10 {
        found.extend((&seen * &matrices.g).iter().chain((&seen * &matrices.k).iter()));
        seen *= &matrices.f;
    }
    found
}

/// The model of the whole, to so many digits, and errors of its size to `errors`.
fn assert_same(found: &Report, whole: &Report, digits: f64, errors: f64) {
    let (own, expected) = (outcome(found), outcome(whole));
    assert_eq!(
        (own.past, own.future, own.feedthrough),
        (expected.past, expected.future, expected.feedthrough)
    );
    assert_eq!(own.constant, expected.constant);
    assert_eq!(space(found).order(), space(whole).order());
    for (one, other) in own.singular_values.iter().zip(&expected.singular_values) {
        assert!((one - other).abs() <= digits * expected.singular_values[0], "{one} and {other}");
    }
    for (one, other) in invariants(found).iter().zip(invariants(whole)) {
        assert!((one - other).abs() <= digits * other.abs().max(1.0), "{one} and {other}");
    }
    let far = difference(
        &serde_json::to_value(&space(found).noise_covariance).unwrap(),
        &serde_json::to_value(&space(whole).noise_covariance).unwrap(),
    );
    assert!(far <= errors, "{far:e}");
    let percent = |report: &Report| report.fit[0].percent.unwrap();
    assert!(
        (percent(found) - percent(whole)).abs() < 100.0 * errors,
        "{} {}",
        percent(found),
        percent(whole)
    );
}

#[test]
fn pieces_of_a_log_give_the_model_of_the_log() {
    let boundaries = [0, 70, 300, 1111, 1113, 1990, 2000];
    let given = |past, future| SubspaceOptions { past: Some(past), future, ..SubspaceOptions::default() };
    let all = [SubspaceOptions::default(), given(12, None), given(50, None)];
    let classical = Weighting::ALL.map(|weighting| SubspaceOptions { weighting, ..given(10, Some(8)) });
    let log = log(2000, 20.0);
    for subspace in all.iter().chain(&classical) {
        for (orders, constant, delays) in [
            (None, Constant::Auto, vec![]),
            (Some(4..=4), Constant::Yes, vec![2, 0]),
            (Some(2..=6), Constant::No, vec![1, 3]),
        ] {
            let plan = StateSpacePlan { subspace: *subspace, orders, constant, delays, ..plan() };
            let whole = fit_state_space(&log, &[], &plan).unwrap();
            let found = merged(&pieces(&log, &plan, &boundaries)).solve().unwrap();
            assert_same(&found, &whole, 1e-12, 2e-2);
        }
    }
}

#[test]
fn missing_values_gaps_and_experiments_are_what_they_are() {
    let missing = [(2, 299), (3, 330), (0, 345), (1, 700), (3, 704), (0, 1199), (2, 0), (3, 1499)];
    let values = with_gaps(&missing);
    let series = StateSpacePlan { inputs: Vec::new(), ..plan() };
    let late = StateSpacePlan { delays: vec![0, 5], ..plan() };
    for plan in [plan(), series, late] {
        let whole = fit_state_space(&values, &[], &plan).unwrap();
        let found = merged(&pieces(&values, &plan, &[0, 310, 352, 900, 1200, 1500])).solve().unwrap();
        assert_same(&found, &whole, 1e-12, 5e-2);
        assert_eq!(found.data.time_gaps, 2);
    }
    // Some with fewer rows than there are lags: they tell of shorter pasts.
    let whole = log(2000, 5.0);
    let part = |first, last| whole.part(&["u", "v", "y", "z"], Rows::new(first, last).unwrap()).unwrap();
    let mut experiments = vec![part(601, 602), part(700, 790)];
    experiments.extend((0..25).map(|k| part(1000 + 40 * k, 1034 + 40 * k)));
    experiments.extend((0..6).map(|k| part(1 + 100 * k, 60 + 100 * k)));
    let plan = StateSpacePlan { orders: Some(4..=4), ..plan() };
    let made = |log: &Log| NormalEquations::of_states(log, &[], &plan, 0).unwrap();
    let all = merged(&experiments.iter().map(made).collect::<Vec<_>>());
    let joined = fit_state_space(&Log::join(experiments).unwrap(), &[], &plan).unwrap();
    assert_same(&all.solve().unwrap(), &joined, 1e-12, 5e-2);
}

#[test]
fn trees_and_documents_change_nothing() {
    let log = log(1000, 5.0);
    let all = pieces(&log, &plan(), &[0, 130, 260, 390, 520, 650, 780, 1000]);
    let right = merged(&all[4..]);
    let mut left = merged(&all[..4]);
    left.merge(&right).unwrap();
    let chain = merged(&all);
    assert_eq!(left.starts, chain.starts);
    let (one, other) = (left.solve().unwrap(), chain.solve().unwrap());
    for (one, other) in invariants(&one).iter().zip(invariants(&other)) {
        assert!((one - other).abs() < 1e-13);
    }
    let text = all[0].to_json().unwrap();
    assert_eq!(NormalEquations::from_json(&text).unwrap(), all[0]);
    for (from, to) in [
        ("\"past\": 0", "\"past\": 99"),
        ("\"starts\"", "\"ends\""),
        ("\"orders\": null", "\"orders\": {\"start\": 0, \"end\": 3}"),
    ] {
        let damaged = text.replacen(from, to, 1);
        assert_ne!(damaged, text);
        let read = NormalEquations::from_json(&damaged);
        assert!(from == "\"starts\"" || read.is_err(), "{from}");
    }
    left.starts[0].signals.clear();
    assert!(left.check().is_err());
}

#[test]
fn what_makes_no_piece_or_does_not_fit_together_is_refused() {
    let log = log(400, 0.0);
    let part = |first, last| log.part(&["u", "v", "y", "z"], Rows::new(first, last).unwrap()).unwrap();
    let made = |plan: &StateSpacePlan| NormalEquations::of_states(&part(201, 300), &[], plan, 0);
    let own = made(&plan()).unwrap();
    let mut first = own.clone();
    let other = StateSpacePlan { orders: Some(2..=3), ..plan() };
    assert_refused(
        first.merge(&made(&other).unwrap()),
        "of state space with 2 outputs, the second ones of state space of order 2..3",
    );
    assert_eq!(first, own);
    let refused = |plan: StateSpacePlan, what: &str| {
        assert_refused(made(&plan), what);
    };
    refused(StateSpacePlan { refine: Some(Refine::Prediction), ..plan() }, "refine: a search reads the log");
    let past = SubspaceOptions { past: Some(1 << 40), ..SubspaceOptions::default() };
    refused(StateSpacePlan { subspace: past, ..plan() }, "past: lags above 100000 are not read");
    assert_refused(
        NormalEquations::of_states(&part(1, 60), &[], &plan(), 20),
        "20 rows are fewer than the 50",
    );
    let unsolved = |log: &Log, plan: &StateSpacePlan| {
        NormalEquations::of_states(log, &[], plan, 0).unwrap().solve().unwrap_err().to_string()
    };
    let error = unsolved(&part(1, 8), &plan());
    assert!(error.contains("samples have it before them in their segment"), "{error}");
    let error = unsolved(&part(1, 100), &StateSpacePlan { orders: Some(500..=500), ..plan() });
    assert!(error.contains("the data tell of orders up to"), "{error}");
    let still = log.channels().iter().map(|one| channel(&one.name, [1.0; 400]));
    let error = unsolved(&Log::new(still.collect(), 0.5).unwrap(), &plan());
    assert!(error.contains("'u' is constant over the estimation rows"), "{error}");
    let mut channels = log.channels().to_vec();
    channels[3].values.iter_mut().for_each(|value| *value *= 1e-200);
    let error = unsolved(&Log::new(channels, 0.5).unwrap(), &plan());
    assert!(error.contains("range of numbers"), "{error}");
}

#[test]
fn outputs_without_noise_have_none() {
    let rows = 2000;
    let u = noise(rows, 1);
    let (mut y, mut z) = (vec![0.0; rows], vec![0.0; rows]);
    for t in 1..rows {
        y[t] = 0.9 * y[t - 1] + u[t - 1];
        z[t] = 0.5 * z[t - 1] - 0.5 * y[t - 1];
    }
    let log = Log::new(vec![channel("u", u), channel("y", y), channel("z", z)], 1.0).unwrap();
    for detrend in [Detrend::Mean, Detrend::None] {
        let plan = StateSpacePlan { detrend, ..StateSpacePlan::new(&["u"], &["y", "z"]) };
        let found = merged(&pieces(&log, &plan, &[0, 700, rows])).solve().unwrap();
        assert!(found.estimation.mse < 1e-20 && found.to_json().is_ok(), "{:e}", found.estimation.mse);
        let mut poles: Vec<f64> =
            space(&found).matrices().f.complex_eigenvalues().iter().map(|p| p.re).collect();
        poles.sort_by(f64::total_cmp);
        assert!(
            poles.len() == 2 && (poles[0] - 0.5).abs() < 1e-6 && (poles[1] - 0.9).abs() < 1e-6,
            "{poles:?}"
        );
    }
}
