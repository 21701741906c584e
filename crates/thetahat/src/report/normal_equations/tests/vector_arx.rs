//! ARX models with several outputs.

use super::*;
use crate::estimate::{Coupling, VectorArxInputs, VectorArxOptions};
use crate::report::fit_state_space;

/// Two inputs, and two outputs that follow one another.
pub(super) fn log(rows: usize, level: f64) -> Log {
    let (u, v, e, w) = (noise(rows, 1), noise(rows, 2), noise(rows, 3), noise(rows, 4));
    let (mut y, mut z) = (vec![0.0; rows], vec![0.0; rows]);
    for t in 3..rows {
        y[t] = 1.2 * y[t - 1] - 0.5 * y[t - 2] + 0.2 * z[t - 1] + u[t - 1] - 0.3 * v[t - 3] + 0.2 * e[t];
        z[t] = 0.6 * z[t - 1] - 0.3 * y[t - 1] + 0.5 * v[t - 2] + 0.1 * w[t] + 0.05 * e[t];
    }
    let channel = |name: &str, values: &[f64]| {
        channel(name, values.iter().map(|value| value + level).collect::<Vec<_>>())
    };
    Log::new(vec![channel("u", &u), channel("v", &v), channel("y", &y), channel("z", &z)], 0.5).unwrap()
}

pub(super) fn plan() -> StateSpacePlan {
    let arx = VectorArxOptions {
        na: 2..=2,
        nb: VectorArxInputs::Each(vec![2, 3]),
        coupling: Some(Coupling::Full),
        delay: 0..=0,
        direct: false,
        constant: false,
    };
    StateSpacePlan { arx: Some(arx), ..StateSpacePlan::new(&["u", "v"], &["y", "z"]) }
}

pub(super) fn pieces(log: &Log, plan: &StateSpacePlan, boundaries: &[usize]) -> Vec<NormalEquations> {
    let made = |(part, past): &(Log, usize)| NormalEquations::of_states(part, &[], plan, *past).unwrap();
    parts(log, plan.lags(), boundaries).iter().map(made).collect()
}

/// The largest difference of the numbers of two documents of reports, relative to their size or to one.
pub(super) fn difference(one: &serde_json::Value, other: &serde_json::Value) -> f64 {
    use serde_json::Value::{Array, Number, Object};
    match (one, other) {
        (Number(one), Number(other)) => {
            let (one, other) = (one.as_f64().unwrap(), other.as_f64().unwrap());
            (one - other).abs() / other.abs().max(1.0)
        }
        (Array(one), Array(other)) if one.len() == other.len() => {
            one.iter().zip(other).map(|(one, other)| difference(one, other)).fold(0.0, f64::max)
        }
        (Object(one), Object(other)) if one.len() == other.len() => {
            // Delays are poles at zero, several of them: their digits are those of a root.
            let all = one.iter().filter(|(key, _)| !key.ends_with("poles"));
            all.map(|(key, value)| difference(value, &other[key])).fold(0.0, f64::max)
        }
        _ if one == other => 0.0,
        _ => f64::INFINITY,
    }
}

/// How far a report is from another one, but for what needs the log a second time and the names of pieces.
fn assert_same(found: &Report, expected: &Report, digits: f64) {
    let value = |report: &Report| {
        let mut own = report.clone();
        own.fit.clear();
        own.purpose.clear();
        own.data.digests.clear();
        own.data.estimation.clear();
        own.data.segments.clear();
        own.data.rows = 0;
        serde_json::to_value(own).unwrap()
    };
    let far = difference(&value(found), &value(expected));
    assert!(far <= digits, "{far:e}");
}

#[test]
fn pieces_of_a_log_give_the_model_of_the_log() {
    let boundaries = [0, 9, 10, 300, 1111, 1113, 1990, 2000];
    let arx = plan().arx.unwrap();
    let ranges =
        VectorArxOptions { na: 0..=3, nb: VectorArxInputs::Alike(0..=4), coupling: None, ..arx.clone() };
    let direct = VectorArxOptions { direct: true, ..arx.clone() };
    let alone = VectorArxOptions { coupling: Some(Coupling::None), ..arx.clone() };
    for level in [0.0, 20.0] {
        let log = log(2000, level);
        for arx in [&arx, &ranges, &direct, &alone] {
            for (detrend, constant) in [
                (Detrend::Mean, Constant::Auto),
                (Detrend::Mean, Constant::Yes),
                (Detrend::None, Constant::Yes),
            ] {
                for delays in [vec![], vec![2, 0], vec![1, 3]] {
                    let plan = StateSpacePlan { arx: Some(arx.clone()), detrend, constant, delays, ..plan() };
                    let whole = fit_state_space(&log, &[], &plan).unwrap();
                    let all = merged(&pieces(&log, &plan, &boundaries));
                    let found = all.solve().unwrap();
                    // Levels that are left in the signals take digits from the fit in one pass.
                    let digits = if detrend == Detrend::None && level > 0.0 { 1e-9 } else { 1e-12 };
                    assert_same(&found, &whole, digits);
                    assert_eq!(
                        (all.rows(), all.pieces(), all.samples()),
                        (2000, 7, whole.estimation.samples)
                    );
                }
            }
        }
    }
}

/// A log that misses the values of these channels in these rows, on a clock that stops for a while, at a boundary and
/// elsewhere.
pub(super) fn with_gaps(missing: &[(usize, usize)]) -> Log {
    let mut channels = log(1500, 3.0).channels().to_vec();
    missing.iter().for_each(|(channel, row)| channels[*channel].values[*row] = f64::NAN);
    let time =
        |t: usize| 0.5 * t as f64 + if t >= 900 { 30.0 } else { 0.0 } + if t >= 1000 { 7.0 } else { 0.0 };
    Log::with_time(channels, (0..1500).map(time).collect()).unwrap()
}

#[test]
fn missing_values_gaps_and_experiments_are_what_they_are() {
    let missing = [(2, 299), (3, 300), (0, 301), (1, 700), (3, 704), (0, 1199), (2, 0), (3, 1499)];
    let values = with_gaps(&missing);
    let series = StateSpacePlan { inputs: Vec::new(), ..plan() };
    let series_arx = VectorArxOptions { nb: VectorArxInputs::Alike(0..=0), ..plan().arx.unwrap() };
    for plan in [plan(), StateSpacePlan { arx: Some(series_arx), ..series }] {
        let whole = fit_state_space(&values, &[], &plan).unwrap();
        let found = merged(&pieces(&values, &plan, &[0, 300, 305, 900, 1200, 1500])).solve().unwrap();
        assert_same(&found, &whole, 1e-12);
        assert_eq!(found.data.time_gaps, 2);
    }
    let whole = log(900, 5.0);
    let part = |first, last| whole.part(&["u", "v", "y", "z"], Rows::new(first, last).unwrap()).unwrap();
    let experiments = [part(1, 200), part(250, 500), part(601, 602), part(700, 900)];
    let made = |log: &Log| NormalEquations::of_states(log, &[], &plan(), 0).unwrap();
    let all = merged(&experiments.iter().map(made).collect::<Vec<_>>());
    let joined = fit_state_space(&Log::join(experiments.to_vec()).unwrap(), &[], &plan()).unwrap();
    assert_same(&all.solve().unwrap(), &joined, 1e-12);
}

#[test]
fn figures_are_those_of_the_errors_and_trees_and_documents_change_nothing() {
    let log = log(3000, 20.0);
    let pieces = pieces(&log, &plan(), &[0, 500, 1000, 1500, 2000, 2500, 3000]);
    let one_by_one = merged(&pieces).solve().unwrap();
    let tree = merged(&pieces.chunks(2).map(merged).collect::<Vec<_>>());
    assert_same(&tree.solve().unwrap(), &one_by_one, 1e-13);
    let text = tree.to_json().unwrap();
    assert_eq!(NormalEquations::from_json(&text).unwrap(), tree);
    assert_eq!(tree.name(), "ARX(2, [2 3], [1 1]) with 2 outputs");
    // One step ahead, but for the first samples.
    let whole = fit_state_space(&log, &[], &plan()).unwrap();
    let figures = |report: &Report| -> Vec<(String, f64)> {
        let one = report.fit.iter().filter(|fit| fit.horizon == Horizon::ONE_STEP);
        one.map(|fit| (fit.output.clone(), fit.percent.unwrap())).collect()
    };
    for ((name, found), (other, expected)) in figures(&one_by_one).iter().zip(&figures(&whole)) {
        assert_eq!(name, other);
        assert!((found - expected).abs() < 0.1, "{name}: {found} and {expected}");
    }
    for (from, to) in [
        ("\"end\": 2", "\"end\": 4"),
        ("\"end\": 2", "\"end\": 18446744073709551615"),
        ("\"delays\": [\n      0", "\"delays\": [\n      1000000000000"),
        ("\"outputs\": [\n      \"y\",", "\"outputs\": ["),
    ] {
        assert!(text.contains(from), "{from}");
        assert!(NormalEquations::from_json(&text.replacen(from, to, 1)).is_err(), "{to}");
    }
}

#[test]
fn what_makes_no_piece_or_does_not_fit_together_is_refused() {
    let log = log(400, 0.0);
    let own = pieces(&log, &plan(), &[0, 100, 200, 300, 400]);
    let part = |first, last| log.part(&["u", "v", "y", "z"], Rows::new(first, last).unwrap()).unwrap();
    let made = |plan: &StateSpacePlan| NormalEquations::of_states(&part(201, 300), &[], plan, 0);
    let mut first = own[0].clone();
    let mut refused = |other: &NormalEquations, what: &str| {
        assert_refused(first.merge(other), what);
        assert_eq!(first, own[0]);
    };
    refused(&own[0], "a piece is given twice: number 1 of the second ones");
    refused(&own[2], "the second pieces do not go on where the first ones end: 'u' is");
    let arx = plan().arx.unwrap();
    let higher = StateSpacePlan { arx: Some(VectorArxOptions { na: 3..=3, ..arx.clone() }), ..plan() };
    refused(&made(&higher).unwrap(), "of ARX(2, [2 3], [1 1]) with 2 outputs, the second ones of ARX(3,");
    let alone = VectorArxOptions { coupling: Some(Coupling::None), ..arx.clone() };
    let alone = StateSpacePlan { arx: Some(alone), ..plan() };
    refused(&made(&alone).unwrap(), "other offsets, another constant");
    let swapped = StateSpacePlan { outputs: vec!["z".into(), "y".into()], ..plan() };
    refused(&made(&swapped).unwrap(), "the channels u, v, y, z, the second ones u, v, z, y");
    let single = Plan::new(&["u", "v", "y"], "z", Orders::arx(2, &[2, 3, 1], &[1, 1, 1]).unwrap());
    refused(&NormalEquations::new(&part(201, 300), &[], &single, 0).unwrap(), "the second ones of ARX(2,");

    let refused = |plan: StateSpacePlan, what: &str| {
        assert_refused(made(&plan), what);
    };
    let late = VectorArxOptions { delay: 0..=2, ..arx.clone() };
    refused(StateSpacePlan { arx: Some(late), ..plan() }, "nk: the rows of a model change with its delay");
    refused(StateSpacePlan { validate: vec!["1..9".parse().unwrap()], ..plan() }, "all rows of a piece");
    refused(StateSpacePlan { detrend: Detrend::Linear, ..plan() }, "give mean or none");
    refused(StateSpacePlan { delays: vec![1 << 40, 0], ..plan() }, "lags above 100000 are not read");
    refused(StateSpacePlan { outputs: vec!["y".into(), "w".into()], ..plan() }, "there is no channel 'w'");
    assert_refused(NormalEquations::of_states(&part(1, 9), &[], &plan(), 2), "2 rows are fewer than the 3");
    assert_refused(
        NormalEquations::of_states(&part(1, 9), &[], &plan(), 0).unwrap().solve(),
        "there must be more",
    );
    let moving = part(1, 100);
    let still = moving.channels().iter().map(|one| channel(&one.name, [1.0; 100]));
    let still =
        NormalEquations::of_states(&Log::new(still.collect(), 0.5).unwrap(), &[], &plan(), 0).unwrap();
    assert_refused(still.solve(), "'u' is constant over the estimation rows");
}

#[test]
fn outputs_without_noise_have_none() {
    let rows = 200;
    let u = noise(rows, 1);
    let (mut y, mut z) = (vec![0.0; rows], vec![0.0; rows]);
    for t in 1..rows {
        y[t] = 0.5 * y[t - 1] + u[t - 1];
        z[t] = 0.25 * z[t - 1] - 0.5 * y[t - 1];
    }
    let log = Log::new(vec![channel("u", u), channel("y", y), channel("z", z)], 1.0).unwrap();
    let arx = VectorArxOptions { na: 1..=1, nb: VectorArxInputs::Alike(1..=1), ..plan().arx.unwrap() };
    let plan =
        StateSpacePlan { arx: Some(arx), detrend: Detrend::None, ..StateSpacePlan::new(&["u"], &["y", "z"]) };
    let found = merged(&pieces(&log, &plan, &[0, 100, rows])).solve().unwrap();
    let whole = fit_state_space(&log, &[], &plan).unwrap();
    let matrices = |report: &Report| serde_json::to_value(&report.model).unwrap()["f"].clone();
    assert!(difference(&matrices(&found), &matrices(&whole)) < 1e-12);
    assert!(found.estimation.mse < 1e-25 && found.to_json().is_ok(), "{:e}", found.estimation.mse);
}
