//! One model from pieces is that of the whole log.

mod nonlinear_arx;
mod subspace;
mod vector_arx;

use super::*;
use crate::data::Detrend;
use crate::estimate::{Constant, Initial, Kernel, Method};
use crate::model::{OffsetCovariance, Orders};
use crate::report::identify;
use crate::respond::Horizon;
use crate::select::Choice;
use crate::tests::{assert_refused, channel, congruential};

/// Numbers in -1 … 1.
fn noise(count: usize, seed: u32) -> Vec<f64> {
    congruential(seed, count)
}

/// Two inputs, and an output that is far from zero.
fn log(rows: usize, [level, base, unit]: [f64; 3]) -> Log {
    let (u, v, e) = (noise(rows, 1), noise(rows, 2), noise(rows, 3));
    let mut y = vec![0.0; rows];
    for t in 3..rows {
        y[t] = 1.6 * y[t - 1] - 0.7 * y[t - 2] + u[t - 1] + 0.4 * u[t - 2] - 0.3 * v[t - 3] + 0.2 * e[t];
    }
    let channels = vec![
        channel("u", u.iter().map(|u| unit * u + base).collect::<Vec<_>>()),
        channel("v", v),
        channel("y", y.iter().map(|y| y + level).collect::<Vec<_>>()),
    ];
    Log::new(channels, 0.5).unwrap()
}

fn plan() -> Plan {
    Plan::new(&["u", "v"], "y", Orders::arx(2, &[2, 1], &[1, 3]).unwrap())
}

/// The rows from one boundary to the next, each piece with the past that it needs.
fn pieces(log: &Log, plan: &Plan, boundaries: &[usize]) -> Vec<NormalEquations> {
    let Choice::Known(orders) = &plan.choice else { panic!("orders are given") };
    let made = |part: &Log, past: usize| NormalEquations::new(part, &[], plan, past).unwrap();
    parts(log, orders.maximum_lag(), boundaries).iter().map(|(part, past)| made(part, *past)).collect()
}

/// The rows from one boundary to the next, with those before them that a model reaches back to, and how many these are.
fn parts(log: &Log, lags: usize, boundaries: &[usize]) -> Vec<(Log, usize)> {
    let names: Vec<&str> = log.channels().iter().map(|channel| channel.name.as_str()).collect();
    let part = |pair: &[usize]| {
        let past = lags.min(pair[0]);
        (log.part(&names, Rows::new(pair[0] - past + 1, pair[1]).unwrap()).unwrap(), past)
    };
    boundaries.windows(2).map(part).collect()
}

fn merged(pieces: &[NormalEquations]) -> NormalEquations {
    let mut all = pieces[0].clone();
    pieces[1..].iter().for_each(|piece| all.merge(piece).unwrap());
    all
}

/// Everything that a fit says of the model, to so many digits.
fn assert_same(found: &Report, expected: &Report, digits: f64) {
    let close = |what: &str, a: f64, b: f64, scale: f64| {
        assert!((a - b).abs() <= digits * scale, "{what}: {a} and {b}, {:e}", (a - b).abs() / scale);
    };
    let (one, other) = (found.model.polynomials("").unwrap(), expected.model.polynomials("").unwrap());
    assert_eq!(one.orders, other.orders);
    for (a, b) in one.parameters.iter().zip(&other.parameters) {
        let error = b.standard_error.unwrap();
        close(&b.name, a.value, b.value, b.value.abs().max(error));
        close(&b.name, a.standard_error.unwrap(), error, error);
    }
    close("variance", one.noise_variance, other.noise_variance, other.noise_variance);
    assert_eq!(
        (one.offset_covariance.is_some(), one.noise_variance > 0.0),
        (other.offset_covariance.is_some(), true)
    );
    for (a, b) in one.inputs.iter().chain([&one.output]).zip(other.inputs.iter().chain([&other.output])) {
        close(&b.name, a.offset.level, b.offset.level, b.offset.level.abs().max(1.0));
    }
    // Where regressors nearly depend, the uncertainty of an offset is a small difference of large numbers.
    let well = expected.estimation.condition.is_none_or(|condition| condition < 1e5);
    if let (Some(a), Some(b), true) = (&one.offset_covariance, &other.offset_covariance, well) {
        let constant = |of: &OffsetCovariance| of.covariance.last().unwrap().last().copied().unwrap();
        close("constant", constant(a), constant(b), 10.0 * constant(b));
    }
    assert_eq!(found.estimation.level.is_some(), expected.estimation.level.is_some());
    assert_eq!(found.estimation.samples, expected.estimation.samples);
    let (a, b) = (&found.fit[0], &expected.fit[0]);
    assert_eq!((a.horizon, a.initial), (b.horizon, b.initial));
    // Predictions without past outputs begin earlier than the estimate after a hole in the output.
    if a.samples == b.samples {
        close("fit", a.percent.unwrap(), b.percent.unwrap(), 100.0);
        close("rmse", a.rmse.unwrap(), b.rmse.unwrap(), b.rmse.unwrap());
    }
    let missing =
        |report: &Report| -> Vec<usize> { report.data.missing.iter().map(|one| one.rows).collect() };
    assert_eq!(missing(found), missing(expected));
}

#[test]
fn pieces_of_a_log_give_the_model_of_the_log() {
    let rows = 2000;
    let boundaries = [0, 4, 5, 300, 1111, 1113, 1990, rows];
    for size in [[0.0, 0.0, 1.0], [20.0, -5.0, 1.0], [1e6, 1e3, 1e-4]] {
        let log = log(rows, size);
        for (detrend, constant) in [
            (Detrend::Mean, Constant::Auto),
            (Detrend::Mean, Constant::Yes),
            (Detrend::None, Constant::Auto),
            (Detrend::None, Constant::Yes),
        ] {
            let plan = Plan { detrend, constant, ..plan() };
            let whole = identify(log.clone(), &[], &plan).unwrap();
            let all = merged(&pieces(&log, &plan, &boundaries));
            assert_eq!((all.rows(), all.samples(), all.pieces()), (rows, rows - 3, 7));
            // Without the offset taken, the fit on one machine has the condition number of large offsets.
            let condition = whole.estimation.condition.unwrap();
            assert_same(&all.solve().unwrap(), &whole, 1e-12_f64.max(1e-15 * condition * condition));
        }
    }
}

#[test]
fn missing_values_and_gaps_at_boundaries_stay_what_they_are() {
    let mut values = log(1500, [3.0, 1.0, 1.0]);
    let mut channels = values.channels().to_vec();
    for (channel, row) in [(2, 299), (2, 300), (0, 301), (1, 700), (2, 704), (0, 1199), (2, 0), (2, 1499)] {
        channels[channel].values[row] = f64::NAN;
    }
    // A clock that stops for a while, at a boundary and elsewhere.
    let time =
        |t: usize| 0.5 * t as f64 + if t >= 900 { 30.0 } else { 0.0 } + if t >= 1000 { 7.0 } else { 0.0 };
    values = Log::with_time(channels, (0..1500).map(time).collect()).unwrap();
    let fir = Plan { ..Plan::new(&["u", "v"], "y", Orders::arx(0, &[12, 4], &[1, 2]).unwrap()) };
    let series = Plan::new(&[], "y", Orders::arx(3, &[], &[]).unwrap());
    for plan in [plan(), fir.clone(), series] {
        let whole = identify(values.clone(), &[], &plan).unwrap();
        let all = merged(&pieces(&values, &plan, &[0, 300, 301, 900, 1200, 1500]));
        assert_same(&all.solve().unwrap(), &whole, 1e-12);
        assert_eq!(all.solve().unwrap().data.time_gaps, 2);
    }
    // The kernel is found by a search that ends with fewer digits.
    for constant in [Constant::Auto, Constant::Yes] {
        let plan = Plan { method: Method::Regularised(Kernel::Dc), constant, ..fir.clone() };
        let whole = identify(values.clone(), &[], &plan).unwrap();
        let all = merged(&pieces(&values, &plan, &[0, 300, 301, 900, 1200, 1500]));
        assert_same(&all.solve().unwrap(), &whole, 1e-6);
    }
}

#[test]
fn experiments_give_the_model_of_joined_logs() {
    let whole = log(900, [5.0, 0.0, 1.0]);
    let part = |first, last| whole.part(&["u", "v", "y"], Rows::new(first, last).unwrap()).unwrap();
    let experiments = [part(1, 200), part(250, 500), part(601, 602), part(700, 900)];
    let made = |log: &Log| NormalEquations::new(log, &[], &plan(), 0).unwrap();
    let all = merged(&experiments.iter().map(made).collect::<Vec<_>>());
    let joined = identify(Log::join(experiments.to_vec()).unwrap(), &[], &plan()).unwrap();
    assert_same(&all.solve().unwrap(), &joined, 1e-12);
    assert_eq!(all.samples(), 197 + 248 + 198);
}

#[test]
fn grouping_changes_nothing_that_is_seen_and_the_same_order_no_bit() {
    let log = log(3000, [1e6, 0.0, 1.0]);
    let pieces = pieces(&log, &plan(), &[0, 500, 1000, 1500, 2000, 2500, 3000]);
    let one_by_one = merged(&pieces);
    let pairs: Vec<NormalEquations> = pieces.chunks(2).map(merged).collect();
    let tree = merged(&pairs);
    assert_same(&tree.solve().unwrap(), &one_by_one.solve().unwrap(), 1e-14);
    assert_eq!(merged(&pairs).to_json().unwrap(), tree.to_json().unwrap());
    assert_eq!(NormalEquations::from_json(&tree.to_json().unwrap()).unwrap(), tree);
}

#[test]
fn regressors_that_nearly_depend_are_solved_as_exactly() {
    // A slow plant with two modes near to one another, sampled fast, and more orders than it has.
    let rows = 4000;
    let (u, e) = (noise(rows, 5), noise(rows, 6));
    let (mut x, mut y, mut w) = (0.0, vec![0.0; rows], 0.0);
    for t in 1..rows {
        w = 0.999 * w + u[t - 1];
        x = 0.998 * x + 0.01 * w;
        y[t] = x + 1e-6 * e[t];
    }
    let log = Log::new(vec![channel("u", u), channel("y", y)], 1.0).unwrap();
    let plan = Plan::new(&["u"], "y", Orders::arx(8, &[8], &[1]).unwrap());
    let whole = identify(log.clone(), &[], &plan).unwrap();
    let condition = whole.estimation.condition.unwrap();
    assert!(condition > 1e6, "{condition:e}");
    let boundaries = [0, 1000, 1999, 3500, rows];
    let found = merged(&pieces(&log, &plan, &boundaries)).solve().unwrap();
    // The bound of the fit on one machine.
    assert_same(&found, &whole, 1e-15 * condition);
    let again = merged(&pieces(&log, &plan, &[0, 77, rows])).solve().unwrap();
    assert_same(&found, &again, 1e-12);
}

#[test]
fn pieces_that_do_not_fit_together_are_refused_and_nothing_changes() {
    let log = log(400, [0.0, 0.0, 1.0]);
    let own = pieces(&log, &plan(), &[0, 100, 200, 300, 400]);
    let mut first = own[0].clone();
    let mut refused = |other: &NormalEquations, what: &str| {
        assert_refused(first.merge(other), what);
        assert_eq!(first, own[0]);
    };
    refused(&own[0], "a piece is given twice: number 1 of the second ones");
    refused(&own[2], "the second pieces do not go on where the first ones end: 'u' is");
    let made = |log: &Log, plan: &Plan, past| NormalEquations::new(log, &[], plan, past);
    let part = |first, last| log.part(&["u", "v", "y"], Rows::new(first, last).unwrap()).unwrap();
    // The overlap is not said.
    refused(&made(&part(98, 200), &plan(), 0).unwrap(), "begin with the last 3 rows of the first ones");
    let higher = Plan::new(&["u", "v"], "y", Orders::arx(2, &[2, 2], &[1, 3]).unwrap());
    refused(
        &made(&part(201, 300), &higher, 0).unwrap(),
        "the first ones are of ARX(2, [2 1], [1 3]), the second ones of",
    );
    let fewer = Plan::new(&["u"], "y", Orders::arx(2, &[2], &[1]).unwrap());
    refused(&made(&part(201, 300), &fewer, 0).unwrap(), "have the channels u, v, y, the second ones u, y");
    let other = Plan { offsets: vec![("y".to_owned(), 1.0)], ..plan() };
    refused(&made(&part(201, 300), &other, 0).unwrap(), "other offsets, another constant");
    let faster = Log::new(part(201, 300).channels().to_vec(), 0.4).unwrap();
    refused(&made(&faster, &plan(), 0).unwrap(), "a sample time of 0.4 s, the first ones of 0.5 s");
    // With a clock the order is seen too.
    let clock = |log: Log, start: usize| {
        let time = (0..log.rows()).map(|row| 0.5 * (start + row) as f64).collect();
        Log::with_time(log.channels().to_vec(), time).unwrap()
    };
    let late = made(&clock(part(101, 200), 100), &plan(), 0).unwrap();
    let early = made(&clock(part(48, 100), 47), &plan(), 3).unwrap();
    assert_refused(
        late.clone().merge(&early),
        "the clock goes back over the boundary: the first pieces end at 99.5 s",
    );
}

#[test]
fn what_makes_no_piece_is_refused() {
    let log = log(50, [0.0, 0.0, 1.0]);
    let refused = |plan: &Plan, past, what: &str| {
        assert_refused(NormalEquations::new(&log, &[], plan, past), what);
    };
    refused(&plan(), 2, "past: 2 rows are fewer than the 3 that the model reaches back to");
    refused(&plan(), 50, "past: all 50 rows of the piece are of the one before it");
    refused(&Plan::new(&["w"], "y", Orders::arx(1, &[1], &[1]).unwrap()), 0, "there is no channel 'w'");
    refused(&Plan::new(&["u"], "y", Orders::oe(&[1], &[1], &[1]).unwrap()), 0, "is found by a search");
    refused(&Plan { detrend: Detrend::Linear, ..plan() }, 0, "give mean or none");
    refused(&Plan { trend: true, ..plan() }, 0, "trend: pieces have no common line");
    refused(&Plan { initial: Initial::Zero, ..plan() }, 0, "initial: rows without a full regressor");
    refused(&Plan { validate: vec!["1..9".parse().unwrap()], ..plan() }, 0, "rows: all rows of a piece");
    refused(
        &Plan { method: Method::InstrumentalVariables, ..plan() },
        0,
        "normal equations give least squares",
    );
    // What one piece does not tell may be in the others: it is asked for in the end.
    let short = log.part(&["u", "v", "y"], Rows::new(1, 7).unwrap()).unwrap();
    assert_refused(
        NormalEquations::new(&short, &[], &plan(), 0).unwrap().solve(),
        "too few rows for the orders",
    );
    let still = vec![
        channel("u", vec![1.0; 50]),
        log.channel("v").unwrap().clone(),
        log.channel("y").unwrap().clone(),
    ];
    let still = NormalEquations::new(&Log::new(still, 0.5).unwrap(), &[], &plan(), 0).unwrap();
    assert_refused(still.solve(), "input 'u' is constant over the estimation rows");
    let mut both = still;
    both.merge(&NormalEquations::new(&log, &[], &plan(), 0).unwrap()).unwrap();
    assert!(both.solve().is_ok());
    let absent = vec![channel("y", vec![f64::NAN; 50])];
    let series = Plan::new(&[], "y", Orders::arx(1, &[], &[]).unwrap());
    let absent = NormalEquations::new(&Log::new(absent, 1.0).unwrap(), &[], &series, 0).unwrap();
    assert_refused(absent.solve(), "no row of the pieces has a value in every channel");
    let huge = vec![channel("y", noise(50, 1).iter().map(|y| y * 1e200).collect::<Vec<_>>())];
    assert_refused(
        NormalEquations::new(&Log::new(huge, 1.0).unwrap(), &[], &series, 0),
        "leave the range of numbers",
    );
}

#[test]
fn documents_that_do_not_fit_together_are_refused() {
    let text = merged(&pieces(&log(60, [0.0, 0.0, 1.0]), &plan(), &[0, 30, 60])).to_json().unwrap();
    for (from, to) in [
        ("thetahat.normal-equations/1", "thetahat.normal-equations/2"),
        ("\"na\": 2", "\"na\": 1"),
        ("\"na\": 2", "\"na\": 18446744073709551615"),
        ("\"detrend\": \"mean\"", "\"detrend\": \"linear\""),
        ("\"sample_time\": 0.5", "\"sample_time\": -0.5"),
        ("\"rows\": 57", "\"rows\": 56"),
    ] {
        assert!(text.contains(from), "{from}");
        assert!(NormalEquations::from_json(&text.replace(from, to)).is_err(), "{to}");
    }
    // Models of polynomials have the fields that they had before there were other kinds.
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    let keys = |of: &serde_json::Value| of.as_object().unwrap().keys().cloned().collect::<Vec<_>>().join(" ");
    let settings = ["constant", "detrend", "inputs", "kernel", "offsets", "orders", "output"];
    let mut found: Vec<String> = keys(&value["settings"]).split(' ').map(str::to_owned).collect();
    found.sort_unstable();
    assert_eq!(found, settings);
    assert!(value.get("centred").is_none() && value["channels"][0].get("squares").is_none());
}
