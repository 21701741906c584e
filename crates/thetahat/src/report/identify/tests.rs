use super::*;
use crate::data::Channel;
use crate::regression::noise::Noise;
use crate::select::{Grid, OrderRange, Path};

#[test]
fn figures_that_wait_are_the_same() {
    let mut noise = Noise(5);
    let (u, e) = (noise.take(400), noise.take(400));
    let mut y = vec![20.0; 400];
    for t in 1..400 {
        y[t] = 20.0 + 0.8 * (y[t - 1] - 20.0) + 0.5 * u[t - 1] + 0.1 * e[t];
    }
    y[300] = f64::NAN;
    let channel = |name: &str, values: &[f64]| Channel { name: name.into(), values: values.to_vec() };
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
    let channel = |name: &str, values: Vec<f64>| Channel { name: name.into(), values };
    let (runs, samples) = (100, 500);
    let (mut squares, mut variance) = ([0.0; 2], 0.0);
    for _ in 0..runs {
        let u = noise.take(samples);
        let mut x = vec![0.0];
        (1..samples).for_each(|t| x.push(0.8 * x[t - 1] + 0.5 * u[t - 1]));
        let y = x.iter().map(|x| x + 0.3 * noise.normal()).collect();
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
