//! Filters of nonlinear ARX models.

use thetahat_core::nalgebra::{Complex, DVector};
use thetahat_numerics::random::Random;

use crate::data::{Log, Rows};
use crate::filter::kind::{Kind, Motion};
use crate::filter::{Estimator, InitialState, ObserverGain, StateFilter, StateModel};
use crate::model::{Activation, Model};
use crate::report::{InputLags, MapPlan, NonlinearArxPlan, Report, apply, fit_nonlinear_arx};
use crate::respond::{Horizon, InitialCondition};
use crate::tests::{assert_refused, channel};

/// y(k) = 0.7 y(k-1) + 0.1 y(k-2) + 0.5 tanh(u(k) + u(k-1)) + e(k), in other units.
fn log() -> Log {
    let mut random = Random::of(5, 1);
    let rows = 300;
    let (mut u, mut y) = (vec![0.0; rows], vec![0.0; rows]);
    for k in 0..rows {
        u[k] = if k < 2 || k % 5 == 0 { random.normal() } else { u[k - 1] };
        if k > 1 {
            y[k] = 0.7 * y[k - 1] + 0.1 * y[k - 2] + 0.5 * (u[k] + u[k - 1]).tanh() + 0.05 * random.normal();
        }
    }
    y.iter_mut().for_each(|y| *y = 20.0 + 3.0 * *y);
    let z: Vec<f64> = y.iter().zip(&u).map(|(y, u)| 0.1 * y * y + u).collect();
    Log::new(vec![channel("u", &u), channel("y", &y), channel("z", &z)], 0.5).unwrap()
}

fn fitted(map: MapPlan, outputs: &[&str], delay: usize, expression: Option<&str>) -> Report {
    let plan = NonlinearArxPlan {
        map,
        output_lags: vec![2; outputs.len()],
        input_lags: vec![InputLags { lags: 2, delay }],
        expressions: expression.into_iter().map(str::to_owned).collect(),
        focus: Some(Horizon::ONE_STEP),
        ..NonlinearArxPlan::new(&["u"], outputs)
    };
    fit_nonlinear_arx(&log(), &[], &plan).unwrap()
}

fn network() -> MapPlan {
    MapPlan::Network { activation: Activation::Tanh, units: Some(2), drawn: false }
}

/// Models with all that a state of lags has to know.
fn reports() -> Vec<Report> {
    let polynomial = |degree| MapPlan::Polynomial { degree };
    vec![
        fitted(polynomial(1), &["y"], 1, None),
        fitted(polynomial(2), &["y"], 0, None),
        fitted(polynomial(2), &["y", "z"], 2, None),
        fitted(polynomial(1), &["y"], 0, Some("sqrt(y)*u")),
        fitted(network(), &["y"], 0, None),
    ]
}

fn filter(report: &Report) -> StateFilter {
    StateFilter::new(StateModel::from_report(report, None).unwrap(), Estimator::Extended).unwrap()
}

fn values(log: &Log, name: &str) -> Vec<f64> {
    log.channels().iter().find(|channel| channel.name == name).unwrap().values.clone()
}

#[test]
fn outputs_that_are_all_there_give_predictions_one_step_ahead() {
    let log = log();
    for report in reports() {
        let rows = [Rows::new(1, 300).unwrap()];
        let one_step = Horizon::ONE_STEP;
        let applied = apply(&report.model, &log, &rows, None, one_step, InitialCondition::Drop).unwrap();
        let mut filter = filter(&report);
        let names: Vec<&str> = report.model.outputs().iter().map(|output| output.name.as_str()).collect();
        let measured: Vec<Vec<f64>> = names.iter().map(|name| values(&log, name)).collect();
        for (t, u) in values(&log, "u").into_iter().enumerate() {
            let y: Vec<f64> = measured.iter().map(|y| y[t]).collect();
            let estimate = filter.step(None, &[u], &y).unwrap();
            for (place, said) in applied.outputs.iter().enumerate().filter(|_| t > 10) {
                let distance = (estimate.outputs.values[place] - said.predicted[t]).abs();
                assert!(distance < 1e-9, "{}: row {t}, {distance}", report.model.name());
            }
        }
    }
}

#[test]
fn its_slopes_are_differences() {
    for report in reports() {
        let model = StateModel::from_report(&report, None).unwrap();
        let Kind::Sampled(_, Motion::Lags(lags)) = &model.kind else {
            panic!("a nonlinear ARX model has lags")
        };
        let n = model.states().len();
        let state = DVector::from_fn(n, |place, _| 0.3 - 0.2 * place as f64);
        let now = DVector::repeat(1, 0.4);
        let next = DVector::repeat(1, -0.7);
        let found = lags.ahead(&state, &now, &next).jacobian;
        for column in 0..n {
            let at = |step: f64| {
                let mut state = state.clone();
                state[column] += step;
                lags.ahead(&state, &now, &next).values
            };
            let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
            let distance = (difference - found.column(column)).amax();
            assert!(distance < 1e-8, "{}: {distance}", report.model.name());
        }
    }
}

#[test]
fn outputs_that_are_missing_are_run_on_with_the_deviation_of_a_linear_filter() {
    // Of a line the extended filter is the Kalman filter: the variance of an ARX model k steps ahead is s² sum of
    // squares of 1/A.
    let log = log();
    let report = fitted(MapPlan::Polynomial { degree: 1 }, &["y"], 1, None);
    let (u, y) = (values(&log, "u"), values(&log, "y"));
    let mut filter = filter(&report);
    let mut deviations = Vec::new();
    for t in 0..300 {
        let y = if t > 250 { f64::NAN } else { y[t] };
        let estimate = filter.step(None, &[u[t]], &[y]).unwrap();
        deviations.push(estimate.outputs.standard_deviations.unwrap()[0]);
    }
    let model = report.model.parameters();
    let of = |name: &str| model.iter().find(|one| one.name.contains(name)).unwrap().value;
    let (a1, a2) = (of("y(k-1)"), of("y(k-2)"));
    let (mut before, mut now, mut sum) = (0.0, 1.0, 0.0);
    let deviation = deviations[250];
    for (k, found) in deviations[251..].iter().enumerate() {
        sum += now * now;
        (before, now) = (now, a1 * now + a2 * before);
        assert!((found / (deviation * f64::sqrt(sum)) - 1.0).abs() < 1e-9, "{k}");
    }
    assert!(deviations[299] > 1.2 * deviation);
    assert!((filter.summary().nis.unwrap().mean - 1.0).abs() < 0.1);
}

#[test]
fn noise_of_the_measurement_is_taken_out() {
    let log = log();
    let report = fitted(network(), &["y"], 0, None);
    let (u, y) = (values(&log, "u"), values(&log, "y"));
    let mut random = Random::of(9, 1);
    let noisy: Vec<f64> = y.iter().map(|y| y + 0.6 * random.normal()).collect();
    let run = |deviations: &[f64]| {
        let model =
            StateModel::from_report(&report, None).unwrap().with_measurement_noise(deviations).unwrap();
        let level = report.model.outputs()[0].offset.level;
        let mut filter = StateFilter::new(model, Estimator::Extended).unwrap().recording();
        let mut squares = 0.0;
        for (t, (u, measured)) in u.iter().zip(&noisy).enumerate() {
            let estimate = filter.step(None, &[*u], &[*measured]).unwrap();
            squares += (estimate.filtered.unwrap().values[0] + level - y[t]).powi(2);
        }
        let smoothed = filter.smooth().unwrap();
        let error = |t: usize| smoothed.row(t + 1).unwrap().0.values[0] + level - y[t];
        let smoothed: f64 = (0..300).map(|t| error(t) * error(t)).sum();
        ((squares / 300.0).sqrt(), (smoothed / 300.0).sqrt(), filter.summary().nis.unwrap().mean)
    };
    let (exact, ..) = run(&[0.0]);
    let (filtered, smoothed, nis) = run(&[0.6]);
    assert!((exact - 0.6).abs() < 0.06, "{exact}");
    // e has a deviation of 0.15, so that the plant knows better than the sensor.
    assert!(filtered < 0.3 && smoothed < filtered, "{filtered} {smoothed}");
    assert!((nis - 1.0).abs() < 0.2, "{nis}");
}

#[test]
fn it_starts_and_observes() {
    let report = fitted(network(), &["y"], 1, None);
    let model = StateModel::from_report(&report, Some(InitialState::Zero)).unwrap();
    assert_eq!(model.states(), ["y(k)", "y(k-1)", "u(k-1)"]);
    assert!(!model.is_linear());
    assert_refused(StateFilter::new(model.clone(), Estimator::Kalman), "ekf");
    let log = log();
    let (u, y) = (values(&log, "u"), values(&log, "y"));
    // Of y(k-1) and u(k-1) the output shows one sum alone: poles for three states there are not, but gains.
    let poles = ObserverGain::Poles([0.1, 0.2, 0.3].map(|pole| Complex::new(pole, 0.0)).to_vec());
    let mut observer = StateFilter::new(model.clone(), Estimator::Luenberger(poles)).unwrap();
    let steps = u.iter().zip(&y).map(|(u, y)| observer.step(None, &[*u], &[*y]).map(|_| ()));
    assert_refused(steps.collect::<Result<Vec<()>, _>>(), "told from the outputs");
    let gain = ObserverGain::Matrix(vec![vec![0.7], vec![1.0], vec![0.0]]);
    let mut observer = StateFilter::new(model.clone(), Estimator::Luenberger(gain)).unwrap();
    let innovations =
        u.iter().zip(&y).map(|(u, y)| observer.step(None, &[*u], &[*y]).unwrap().innovations[0]);
    let innovations: Vec<f64> = innovations.skip(50).collect();
    let rms = (innovations.iter().map(|one| one * one).sum::<f64>() / 250.0).sqrt();
    // With about the slope of g by y(k-1) as gain they are the errors one step ahead.
    let Model::NonlinearArx(own) = &report.model else { panic!("{:?}", report.model) };
    let deviation = own.noise_covariance[0][0].sqrt();
    assert!(rms < 1.1 * deviation, "{rms} {deviation}");
    let mut filter = StateFilter::new(model.clone(), Estimator::Extended).unwrap();
    let first = filter.step(None, &[0.0], &[y[0]]).unwrap();
    assert!(first.filtered.unwrap().standard_deviations.unwrap().iter().all(|one| *one < 1e-9));

    for (deviations, words) in [
        (&[][..], "there are 0"),
        (&[-1.0], "no standard deviation"),
        (&[f64::NAN], "no standard deviation"),
        (&[f64::INFINITY], "no standard deviation"),
        (&[1e300], "measurement-noise"),
    ] {
        assert_refused(model.clone().with_measurement_noise(deviations), words);
    }
    let mut silent = report.clone();
    let Model::NonlinearArx(own) = &mut silent.model else { panic!("{:?}", silent.model) };
    own.noise_covariance = vec![vec![0.0]];
    let error = StateModel::from_report(&silent, None).unwrap_err().to_string();
    assert!(error.starts_with("its noise variance is 0"), "{error}");
    let linear = StateModel::from_toml(super::NILE).unwrap();
    assert_refused(linear.with_measurement_noise(&[1.0]), "nonlinear ARX");
}
