use thetahat_numerics::noise::Noise;

use super::*;
use crate::report::{StateSpacePlan, fit_state_space};
use crate::select::{Automatic, Select};
use crate::select::{Grid, OrderRange, Path};
use crate::tests::channel;

#[test]
fn figures_that_wait_are_the_same() {
    let mut noise = Noise(5);
    let (u, e) = (noise.take(400), noise.take(400));
    let mut y = vec![20.0; 400];
    for t in 1..400 {
        y[t] = 20.0 + 0.8 * (y[t - 1] - 20.0) + 0.5 * u[t - 1] + 0.1 * e[t];
    }
    y[300] = f64::NAN;
    let log = Log::new(vec![channel("u", &u), channel("y", &y)], 0.1).unwrap();
    let one = OrderRange::new(1, 1).unwrap();
    let grid = Grid {
        na: OrderRange::new(1, 2).unwrap(),
        nb: vec![one],
        nc: 0.into(),
        nd: 0.into(),
        nf: vec![0.into()],
        nk: vec![one],
        path: Path::All,
    };
    let known = Plan::new(&["u"], "y", Orders::oe(&[1], &[1], &[1]).unwrap());
    let plans = [
        Plan { validate: vec!["301..400".parse().unwrap()], detrend: Detrend::Linear, ..known.clone() },
        Plan { split: Some("60/20/20".parse().unwrap()), choice: Choice::Grid(grid), ..known },
    ];
    for plan in plans {
        let whole = identify(log.clone(), &[], &plan).unwrap();
        let pending =
            PendingEvaluation::new(log.clone(), &[], &plan, &|_| ControlFlow::Continue(())).unwrap();
        assert!(pending.report().fit.is_empty() && pending.report().model == whole.model);
        assert_eq!(pending.evaluate(log.clone()).unwrap(), whole);
    }
}

#[test]
fn a_fit_in_a_band_knows_how_sure_it_is_and_what_noise_there_is() {
    let mut noise = Noise(7);
    let orders = Orders::oe(&[1], &[1], &[1]).unwrap();
    let truth = [0.5, -0.8];
    let (runs, samples) = (100, 500);
    let (mut squares, mut variance) = ([0.0; 2], 0.0);
    for _ in 0..runs {
        let u = noise.take(samples);
        let mut x = vec![0.0];
        (1..samples).for_each(|t| x.push(0.8 * x[t - 1] + 0.5 * u[t - 1]));
        let y: Vec<f64> = x.iter().map(|x| x + 0.3 * noise.normal()).collect();
        let log = Log::new(vec![channel("u", u), channel("y", y)], 1.0).unwrap();
        let prefilter = Some("0.01..0.2".parse().unwrap());
        let plan = Plan { prefilter, detrend: Detrend::None, ..Plan::new(&["u"], "y", orders.clone()) };
        let model = identify(log, &[], &plan).unwrap().model;
        let model = model.polynomials("this test").unwrap();
        for ((square, parameter), truth) in squares.iter_mut().zip(&model.parameters).zip(truth) {
            *square +=
                ((parameter.value - truth) / parameter.standard_error.unwrap()).powi(2) / f64::from(runs);
        }
        variance += model.noise_variance / f64::from(runs);
    }
    // chi-square of 100 degrees over 100 has a deviation of 0.14.
    assert!(squares.iter().all(|square| (0.65..1.45).contains(square)), "{squares:?}");
    assert!((variance / 0.09 - 1.0).abs() < 0.05, "{variance}");
}

#[test]
fn the_largest_is_found_in_any_place() {
    assert_eq!(largest(&[]), 0.0);
    for place in 0..19 {
        let mut values = [0.5; 19];
        values[place] = -3.0;
        assert_eq!(largest(&values), 3.0);
    }
}

/// Six lightly damped modes of a plant whose input is held for three samples, and white noise a tenth as large as what
/// they do.
fn modes() -> Result<Log, Error> {
    let mut noise = Noise(11);
    let (moved, e) = (noise.take(1200), noise.take(1200));
    let u: Vec<f64> = (0..1200).map(|t| moved[t / 3].signum()).collect();
    let mut y = vec![3.0; 1200];
    for (frequency, gain) in [(0.3_f64, 0.3), (0.6, -0.8), (1.0, 1.2), (1.4, -1.0), (1.9, 1.3), (2.4, -0.9)] {
        let radius = 0.99_f64;
        let (a1, a2) = (-2.0 * radius * frequency.cos(), radius * radius);
        let mut x = [0.0; 2];
        for (t, y) in y.iter_mut().enumerate() {
            let driven = if t > 0 { gain * u[t - 1] } else { 0.0 };
            x = [driven - a1 * x[0] - a2 * x[1], x[0]];
            *y += x[0];
        }
    }
    let size = |signal: &[f64]| sum(signal.iter().map(|value| value * value)).sqrt();
    let deviations: Vec<f64> = y.iter().map(|y| y - 3.0).collect();
    let small = 0.1 * size(&deviations) / size(&e);
    y.iter_mut().zip(&e).for_each(|(y, e)| *y += small * e);
    Log::new(vec![channel("u", u), channel("y", y)], 0.1)
}

#[test]
fn a_plant_of_many_modes_gets_a_model_in_state_space() -> Result<(), Error> {
    let log = modes()?;
    let plan = Plan {
        estimate: vec!["1..800".parse()?],
        validate: vec!["801..1200".parse()?],
        ..Plan::new(&["u"], "y", Choice::Automatic(Automatic::default()))
    };
    let mut report = identify(log.clone(), &[], &plan)?;
    let selection = report.selection.take().ok_or_else(|| Error::report("there is no selection"))?;
    let candidate = selection.state_space.ok_or_else(|| Error::report("there is no candidate"))?;
    assert_eq!(
        (candidate.order, &*report.model.name()),
        (12, "state space of order 12"),
        "{:?}",
        selection.steps
    );
    assert!(candidate.orders.len() > 12);
    // It is the very report of that order.
    let own = StateSpacePlan {
        orders: Some(12..=12),
        estimate: plan.estimate.clone(),
        validate: plan.validate.clone(),
        ..StateSpacePlan::new(&["u"], &["y"])
    };
    assert!(report == fit_state_space(&log, &[], &own)?);
    // Who asks for what a model in state space is not gets polynomials.
    let asked = [
        Plan { focus: Focus::Prediction, ..plan.clone() },
        Plan { initial: Initial::Zero, ..plan.clone() },
        Plan { select: "aic".parse::<Select>()?, ..plan.clone() },
        Plan { trend: true, ..plan.clone() },
        Plan { choice: Choice::Automatic(Automatic { nk: Some(vec![1]), ..Automatic::default() }), ..plan },
    ];
    assert!(asked.iter().all(|plan| in_states::InStates::of(&log, plan).is_none()));
    Ok(())
}
