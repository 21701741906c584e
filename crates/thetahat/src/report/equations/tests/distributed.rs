use std::ops::ControlFlow;

use thetahat_numerics::random::Random;

use crate::Error;
use crate::data::{Log, Rows};
use crate::estimate::{Answer, Ask, Question};
use crate::model::GreyBox;
use crate::report::{EquationsPlan, Report, answer_equations, fit_equations, fit_equations_distributed};
use crate::tests::{assert_refused, channel};

fn tank() -> GreyBox {
    let text = "sample_time = 1
        [states]
        level = { start = 0, sd = 1 }
        [inputs]
        flow = 'u'
        [parameters]
        area = { start = 1, sd = 1, unknown = true, min = 0 }
        leak = { start = 0.3, sd = 0.2, unknown = true }
        [next]
        level = 'level + dt * (flow - leak * level) / area'
        [outputs]
        y = 'level'
        [noise]
        process = { level = 0.001 }
        measurement = { y = 0.01 }";
    GreyBox::from_toml(text).unwrap()
}

/// A tank of 2 m^2 that leaks 0.1 of its level.
fn log(seed: u64) -> Log {
    let mut random = Random::of(seed, 1);
    let u: Vec<f64> = (0..120).map(|t| f64::from((t / 10 + seed as u32) % 3)).collect();
    let mut x = 0.3 * random.normal();
    let y = u.iter().map(|u| {
        let y = x + 0.1 * random.normal();
        x += (u - 0.1 * x) / 2.0;
        y
    });
    Log::new(vec![channel("y", y.collect::<Vec<_>>()), channel("u", u)], 1.0).unwrap()
}

fn distributed(logs: &[Log], each: usize, plan: &EquationsPlan) -> Result<Report, Error> {
    let model = tank();
    let held: Vec<Log> = logs.chunks(each).map(|own| Log::join(own.to_vec()).unwrap()).collect();
    let counts: Vec<usize> = logs.chunks(each).map(<[Log]>::len).collect();
    let ask = |questions: &[Question]| {
        let each = held.iter().zip(questions).map(|(log, question)| {
            // As another process has them.
            let question = Question::from_bytes(&question.to_bytes()?)?;
            Answer::from_bytes(&answer_equations(&model, log, &question)?.to_bytes()?)
        });
        each.collect()
    };
    let joined = Log::join(logs.to_vec()).unwrap();
    fit_equations_distributed(&model, (&joined, &[]), plan, &counts, &ask, &|_| ControlFlow::Continue(()))
}

#[test]
fn holders_find_what_one_process_finds() {
    let logs: Vec<Log> = (0..7).map(log).collect();
    let mut plan = EquationsPlan::default();
    for starts in [0, 2] {
        plan.search.starts = starts;
        let joined = Log::join(logs.clone()).unwrap();
        let whole = fit_equations(&tank(), &joined, &[], &plan, &|_| ControlFlow::Continue(())).unwrap();
        for each in [1, 3] {
            let found = distributed(&logs, each, &plan).unwrap();
            for (own, other) in found.model.parameters().iter().zip(whole.model.parameters()) {
                assert!((own.value / other.value - 1.0).abs() < 1e-8, "{own:?} {other:?}");
                let ratio = own.standard_error.unwrap() / other.standard_error.unwrap();
                assert!((ratio - 1.0).abs() < 1e-8, "{ratio}");
            }
            assert_eq!(found.data, whole.data);
            assert_eq!(found.fit.len(), whole.fit.len());
            assert_eq!(found, distributed(&logs, each, &plan).unwrap());
        }
    }
}

#[test]
fn what_cannot_be_is_said() {
    let logs: Vec<Log> = (0..2).map(log).collect();
    let plan = EquationsPlan { estimate: vec![Rows::new(1, 100).unwrap()], ..EquationsPlan::default() };
    assert_refused(distributed(&logs, 1, &plan), "all rows serve");
    let plan = EquationsPlan::default();
    let joined = Log::join(logs.clone()).unwrap();
    let fit = |counts: &[usize], ask: Ask<'_>| {
        let found = fit_equations_distributed(&tank(), (&joined, &[]), &plan, counts, ask, &|_| {
            ControlFlow::Continue(())
        });
        found.unwrap_err().to_string()
    };
    assert!(fit(&[1], &|_| Ok(Vec::new())).contains("count the logs"));
    assert!(fit(&[1, 1], &|_| Ok(Vec::new())).contains("another question"));
    assert!(fit(&[1, 1], &|_| Err(Error::data("the worker is lost"))).contains("worker is lost"));
    // Where the filter does not work, the row is that of all logs.
    let mut wild = logs[1].channel("y").unwrap().values.clone();
    wild[3] = 1e300;
    let u = logs[1].channel("u").unwrap().values.clone();
    let wild = Log::new(vec![channel("y", wild), channel("u", u)], 1.0).unwrap();
    let both = [logs[0].clone(), wild];
    let whole =
        fit_equations(
            &tank(),
            &Log::join(both.to_vec()).unwrap(),
            &[],
            &plan,
            &|_| ControlFlow::Continue(()),
        );
    let words = whole.unwrap_err().to_string();
    assert_eq!(distributed(&both, 1, &plan).unwrap_err().to_string(), words);
}
