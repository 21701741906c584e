use std::ops::ControlFlow;

use thetahat_numerics::random::Random;

use super::*;
use crate::estimate::{Constant, Initial};
use crate::model::Orders;
use crate::report::identify;
use crate::tests::{assert_refused, channel};

/// x(t) = 1.5 x(t-1) - 0.7 x(t-2) + u(t-1) + 0.5 u(t-2) from a state of its own, seen 3 higher with noise: e, or e +
/// 0.6 e(t-1).
fn log(seed: u64, rows: usize, colour: f64) -> Log {
    let mut random = Random::of(seed, 1);
    let u: Vec<f64> = (0..rows).map(|_| random.normal() + 2.0).collect();
    let mut x = vec![10.0 * random.normal(), 10.0 * random.normal()];
    for t in 2..rows {
        x.push(1.5 * x[t - 1] - 0.7 * x[t - 2] + u[t - 1] + 0.5 * u[t - 2]);
    }
    let mut before = 0.0;
    let y = x.iter().map(|x| {
        let e = random.normal();
        let noise = e + colour * before;
        before = e;
        x + 3.0 + noise
    });
    Log::new(vec![channel("y", y.collect::<Vec<_>>()), channel("u", u)], 0.1).unwrap()
}

fn source(number: usize, rows: usize) -> Source {
    let file = format!("{number}.csv");
    Source { file, rows: Rows::new(1, rows).unwrap(), time: None, start: None, resampled: None }
}

/// As holders find it that have some of the logs each.
fn distributed(logs: &[Log], each: usize, plan: &Plan) -> Result<Report, Error> {
    let mut number = 0;
    let groups = logs.chunks(each).map(|logs| {
        let mut first = 0;
        let sources = logs.iter().map(|log| {
            number += 1;
            first += log.rows();
            Source { rows: Rows::new(first - log.rows() + 1, first).unwrap(), ..source(number, 1) }
        });
        let sources: Vec<Source> = sources.collect();
        (Log::join(logs.to_vec()).unwrap(), sources)
    });
    let groups: Vec<(Log, Vec<Source>)> = groups.collect();
    let mut all: Option<Experiments> = None;
    for (log, sources) in &groups {
        let own = Experiments::new(log, sources, plan)?;
        match &mut all {
            Some(all) => all.merge(&own)?,
            None => all = Some(own),
        }
    }
    let all = all.unwrap();
    let offsets = all.offsets(plan)?;
    let held: Vec<Log> =
        groups.iter().map(|(log, _)| Experiments::deviations(log, plan, &offsets).unwrap()).collect();
    let ask = |questions: &[Question]| {
        let each = held.iter().zip(questions).map(|(log, question)| {
            // As another process has them.
            let question = Question::from_bytes(&question.to_bytes()?)?;
            Answer::from_bytes(&Experiments::answer(log, plan, &question)?.to_bytes()?)
        });
        each.collect()
    };
    all.fit(plan, &ask, &|_| ControlFlow::Continue(()))
}

fn whole(logs: &[Log], plan: &Plan) -> Report {
    let mut first = 0;
    let sources = logs.iter().enumerate().map(|(number, log)| {
        first += log.rows();
        Source { rows: Rows::new(first - log.rows() + 1, first).unwrap(), ..source(number + 1, 1) }
    });
    let sources: Vec<Source> = sources.collect();
    identify(Log::join(logs.to_vec()).unwrap(), &sources, plan).unwrap()
}

/// Parameters to 1e-8 of their size, with their standard errors, as the whole log gives them.
fn assert_same(found: &Report, expected: &Report) {
    let (own, other) = (found.model.parameters(), expected.model.parameters());
    assert_eq!(own.len(), other.len());
    for (own, other) in own.iter().zip(other) {
        assert!((own.value - other.value).abs() <= 1e-8 * other.value.abs(), "{own:?} {other:?}");
        let (own, other) = (own.standard_error.unwrap(), other.standard_error.unwrap());
        // psi at the last step, or before it.
        assert!((own / other - 1.0).abs() < 1e-5, "{own} {other}");
    }
    let ratio = found.estimation.mse / expected.estimation.mse;
    assert!((ratio - 1.0).abs() < 1e-10, "{ratio}");
    assert_eq!(found.estimation.samples, expected.estimation.samples);
    assert_eq!(found.estimation.initial, expected.estimation.initial);
    assert_eq!(found.data, expected.data);
    match (found.estimation.level, expected.estimation.level) {
        (Some(own), Some(other)) => assert!((own.value - other.value).abs() < 1e-8 * other.value.abs()),
        (own, other) => assert_eq!(own, other),
    }
    let expected = &expected.fit[0];
    assert_eq!(found.fit[0].samples, expected.samples);
    assert!((found.fit[0].percent.unwrap() - expected.percent.unwrap()).abs() < 1e-6);
}

fn plan(orders: Orders) -> Plan {
    Plan::new(&["u"], "y", orders)
}

#[test]
fn holders_find_what_one_process_finds_in_all_logs() {
    let logs: Vec<Log> = (0..40).map(|seed| log(seed, 7000, 0.0)).collect();
    let plan = plan(Orders::oe(&[2], &[2], &[1]).unwrap());
    let expected = whole(&logs, &plan);
    assert_eq!(expected.estimation.initial, Some(Initial::Estimate));
    let found = distributed(&logs, 3, &plan).unwrap();
    assert_same(&found, &expected);
    assert_same(&distributed(&logs, 17, &plan).unwrap(), &expected);
    // The same questions have the same answers.
    assert_eq!(distributed(&logs, 3, &plan).unwrap(), found);
}

#[test]
fn so_do_those_of_models_with_noise_and_with_a_level() {
    let logs: Vec<Log> = (0..8).map(|seed| log(seed, 34_000, 0.6)).collect();
    for orders in [Orders::armax(2, &[2], 1, &[1]).unwrap(), Orders::bj(&[2], 1, 1, &[2], &[1]).unwrap()] {
        let mut plan = plan(orders);
        assert_same(&distributed(&logs, 3, &plan).unwrap(), &whole(&logs, &plan));
        plan.constant = Constant::Yes;
        let expected = whole(&logs, &plan);
        assert!(expected.estimation.level.is_some());
        assert_same(&distributed(&logs, 3, &plan).unwrap(), &expected);
    }
}

#[test]
fn missing_samples_and_rest_are_seen() {
    let mut logs: Vec<Log> = (0..3).map(|seed| log(seed, 100_000, 0.0)).collect();
    let holes = |log: &Log, name: &str, every: usize| {
        let values = log.channel(name).unwrap().values.iter().enumerate();
        values.map(|(row, value)| if row % every == 500 { f64::NAN } else { *value }).collect::<Vec<_>>()
    };
    let with = Log::new(
        vec![channel("u", holes(&logs[1], "u", 20_000)), channel("y", holes(&logs[1], "y", 1000))],
        0.1,
    );
    logs[1] = with.unwrap();
    let mut plan = plan(Orders::oe(&[2], &[2], &[1]).unwrap());
    let (found, expected) = (distributed(&logs, 1, &plan).unwrap(), whole(&logs, &plan));
    for (own, other) in found.model.parameters().iter().zip(expected.model.parameters()) {
        assert!((own.value - other.value).abs() <= 1e-8 * other.value.abs(), "{own:?} {other:?}");
        // What the errors in holes may have been is left out.
        let ratio = own.standard_error.unwrap() / other.standard_error.unwrap();
        assert!((ratio - 1.0).abs() < 1e-2, "{ratio}");
    }
    assert_eq!(found.data, expected.data);
    plan.initial = Initial::Zero;
    let logs: Vec<Log> = (3..6).map(|seed| log(seed, 100_000, 0.0)).collect();
    assert_same(&distributed(&logs, 2, &plan).unwrap(), &whole(&logs, &plan));
}

#[test]
fn short_logs_are_fetched() {
    let logs: Vec<Log> = (0..5).map(|seed| log(seed, 400, 0.3)).collect();
    for orders in [Orders::oe(&[2], &[2], &[1]).unwrap(), Orders::armax(2, &[2], 1, &[1]).unwrap()] {
        let plan = plan(orders);
        assert_same(&distributed(&logs, 2, &plan).unwrap(), &whole(&logs, &plan));
    }
}

#[test]
fn what_cannot_be_is_said() {
    let own = log(1, 300, 0.0);
    let oe = plan(Orders::oe(&[2], &[2], &[1]).unwrap());
    let mut all = Experiments::new(&own, &[source(1, 300)], &oe).unwrap();
    let before = all.clone();
    let merged = |all: &mut Experiments, other: &Log, number: usize, plan: &Plan| {
        let other = Experiments::new(other, &[source(number, other.rows())], plan);
        other.and_then(|other| all.merge(&other))
    };
    assert_refused(merged(&mut all, &own, 1, &oe), "'1.csv' is given twice");
    let slow = Log::new(own.channels().to_vec(), 0.2).unwrap();
    assert_refused(merged(&mut all, &slow, 2, &oe), "sample time of 0.2 s");
    let swapped = Plan::new(&["y"], "u", Orders::oe(&[2], &[2], &[1]).unwrap());
    assert_refused(merged(&mut all, &own, 2, &swapped), "have the channels");
    let missing = Log::new(vec![channel("y", vec![1.0, 2.0])], 0.1).unwrap();
    assert_refused(merged(&mut all, &missing, 2, &oe), "u");
    assert_eq!(all, before);

    let still = Log::new(
        vec![channel("u", vec![2.0; 300]), channel("y", own.channel("y").unwrap().values.clone())],
        0.1,
    );
    let still = Experiments::new(&still.unwrap(), &[], &oe).unwrap();
    assert_refused(still.offsets(&oe), "constant");

    let made = |plan: &Plan| Experiments::new(&own, &[], plan);
    assert_refused(made(&plan(Orders::arx(2, &[2], &[1]).unwrap())), "normal equations");
    assert_refused(made(&Plan { trend: true, ..oe.clone() }), "no common line");
    assert_refused(made(&Plan { method: Method::RefinedInstrumentalVariables, ..oe.clone() }), "method");
    let focused = Plan { focus: Focus::Simulation, ..plan(Orders::armax(2, &[2], 1, &[1]).unwrap()) };
    assert_refused(made(&focused), "focus");

    // An answer to another question, and none.
    let ask = |_: &[Question]| Ok(Vec::new());
    assert_refused(before.fit(&oe, &ask, &|_| ControlFlow::Continue(())), "another question");
    let lost = |_: &[Question]| Err(Error::data("the second worker is lost"));
    assert_refused(before.fit(&oe, &lost, &|_| ControlFlow::Continue(())), "worker is lost");
    assert!(Question::from_bytes(&[9, 9]).is_err());
    assert!(Answer::from_bytes(&[]).is_err());
}

/// What is known of some experiments, and what those have who hold them.
fn held(logs: &[Log], plan: &Plan) -> (Experiments, Vec<Log>) {
    let mut all = Experiments::new(&logs[0], &[], plan).unwrap();
    for log in &logs[1..] {
        all.merge(&Experiments::new(log, &[], plan).unwrap()).unwrap();
    }
    let offsets = all.offsets(plan).unwrap();
    let held: Vec<Log> =
        logs.iter().map(|log| Experiments::deviations(log, plan, &offsets).unwrap()).collect();
    (all, held)
}

#[test]
fn a_holder_that_is_lost_in_the_middle_ends_it() {
    let logs: Vec<Log> = (0..3).map(|seed| log(seed, 90_000, 0.0)).collect();
    let plan = plan(Orders::oe(&[2], &[2], &[1]).unwrap());
    let (all, held) = held(&logs, &plan);
    let left = std::cell::Cell::new(5);
    let ask = |questions: &[Question]| {
        left.set(left.get() - 1);
        if left.get() == 0 {
            return Err(Error::data("the worker is lost"));
        }
        assert!(left.get() > 0, "asked again");
        held.iter().zip(questions).map(|(log, question)| Experiments::answer(log, &plan, question)).collect()
    };
    assert_refused(all.fit(&plan, &ask, &|_| ControlFlow::Continue(())), "worker is lost");
    // Or answers for other experiments than it described.
    let ask = |questions: &[Question]| {
        held.iter()
            .rev()
            .zip(questions.iter().take(1))
            .map(|(log, question)| Experiments::answer(log, &plan, question))
            .collect()
    };
    assert!(all.fit(&plan, &ask, &|_| ControlFlow::Continue(())).is_err());
}

#[test]
fn a_failure_that_passes_is_no_model_of_less() {
    // What is left of the mean of u asks for a constant.
    let logs: Vec<Log> = (0..3).map(|seed| log(seed, 88_000, 0.0)).collect();
    let plan = plan(Orders::oe(&[2], &[2], &[1]).unwrap());
    let plan = Plan { offsets: vec![("u".into(), 1.9)], ..plan };
    let (all, held) = held(&logs, &plan);
    let fit = |fails: usize| {
        let asked = std::cell::Cell::new(0);
        let ask = |questions: &[Question]| {
            asked.set(asked.get() + 1);
            if asked.get() == fails {
                return Err(Error::data("the worker is away for a moment"));
            }
            let each = held.iter().zip(questions);
            each.map(|(log, question)| Experiments::answer(log, &plan, question)).collect()
        };
        (all.fit(&plan, &ask, &|_| ControlFlow::Continue(())), asked.get())
    };
    let (found, count) = fit(0);
    assert!(found.is_ok_and(|found| found.estimation.level.is_some()));
    for fails in (1..=count).rev().step_by(3) {
        let error = fit(fails).0.unwrap_err().to_string();
        assert!(error.contains("for a moment"), "{fails}: {error}");
    }
}
