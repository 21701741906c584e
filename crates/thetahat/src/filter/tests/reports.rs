use thetahat_numerics::noise::Noise;

use crate::Error;
use crate::data::{Log, Offset, Record};
use crate::filter::{Estimator, InitialState, StateFilter, StateModel, linear::Linear};
use crate::model::{Model, Orders, PolynomialModel};
use crate::report::{Plan, StateSpacePlan, fit_state_space, identify};
use crate::respond::{Horizon, InitialCondition, predict};
use crate::tests::channel;

/// Models of all structures: na, nb, nc, nd, nf, nk and their parameters a, b, c, d, f.
fn models() -> Vec<PolynomialModel> {
    let model = |(na, nb, nc, nd, nf, nk): (usize, &[usize], usize, usize, &[usize], &[usize]),
                 parameters: &[f64]| {
        let orders = Orders::new(na, nb, nc, nd, nf, nk).unwrap();
        PolynomialModel::from_parameters(&orders, parameters, None, 0.25, 0.5).unwrap()
    };
    vec![
        model((2, &[], 0, 0, &[], &[]), &[-1.5, 0.7]),
        model((1, &[], 2, 0, &[], &[]), &[-0.9, 0.5, 0.2]),
        model((2, &[2], 0, 0, &[0], &[1]), &[-1.5, 0.7, 1.0, 0.5]),
        model((1, &[1, 2], 0, 0, &[0, 0], &[0, 3]), &[-0.8, 0.4, 1.0, 0.5]),
        model((2, &[1], 1, 0, &[0], &[0]), &[-1.5, 0.7, 1.0, -0.6]),
        model((0, &[2], 0, 0, &[2], &[1]), &[1.0, 0.5, -1.5, 0.7]),
        model((0, &[1], 1, 1, &[1], &[2]), &[1.0, 0.4, -0.9, -0.8]),
        model((0, &[1], 0, 0, &[0], &[0]), &[2.0]),
        model((1, &[1], 1, 1, &[1], &[1]), &[-0.5, 1.0, 0.3, -0.2, 0.6]),
    ]
}

fn filter(model: &PolynomialModel) -> StateFilter {
    let linear = {
        let signals = (&*model.inputs, std::slice::from_ref(&model.output));
        Linear::of_innovations(model.state_space(), signals, InitialState::Zero).unwrap()
    };
    StateFilter::new(linear.into(), Estimator::Kalman).unwrap()
}

#[test]
fn predictions_are_those_of_the_difference_equation() {
    for mut model in models() {
        let inputs = model.b.len();
        for (index, input) in model.inputs.iter_mut().enumerate() {
            input.name = format!("u{index}");
            input.offset = Offset { level: 3.0, slope: 0.01 };
        }
        model.output.name = "y".to_owned();
        model.output.offset = Offset { level: -2.0, slope: 0.02 };
        let mut noise = Noise(17);
        let u: Vec<Vec<f64>> = (0..inputs).map(|_| noise.take_normal(80)).collect();
        let y: Vec<f64> = noise.take_normal(80);
        let record = Record::new(&y, u.iter().map(Vec::as_slice).collect()).unwrap();
        let expected = predict(&model, &record, 1, InitialCondition::Zero).unwrap().values;

        let mut filter = filter(&model);
        assert_eq!(filter.model().outputs(), ["y"]);
        for row in 0..80 {
            let time = 0.5 * row as f64;
            let raw: Vec<f64> = u.iter().map(|u| u[row] + 3.0 + 0.01 * time).collect();
            let level = -2.0 + 0.02 * time;
            let estimate = filter.step(None, &raw, &[y[row] + level]).unwrap();
            let found = estimate.outputs.values[0] - level;
            assert!((found - expected[row]).abs() < 1e-12, "{:?}, {row}", model.orders);
            // Without missing rows nothing is uncertain but e.
            assert!((estimate.outputs.standard_deviations.unwrap()[0] - 0.5).abs() < 1e-15);
        }
    }
}

#[test]
fn a_missing_row_makes_the_next_as_uncertain_as_two_steps_ahead() {
    for model in models() {
        let mut filter = filter(&model);
        let inputs = vec![0.3; model.b.len()];
        for _ in 0..30 {
            filter.step(None, &inputs, &[0.1]).unwrap();
        }
        for steps in 1..4 {
            let estimate = filter.step(None, &inputs, &[f64::NAN]).unwrap();
            let expected = crate::respond::prediction_deviation(&model, steps).unwrap();
            let found = estimate.outputs.standard_deviations.unwrap()[0];
            assert!((found - expected).abs() < 1e-12, "{:?}: {found} {expected}", model.orders);
        }
    }
}

#[test]
fn a_report_of_a_fit_is_a_model() {
    let mut noise = Noise(5);
    let u: Vec<f64> = (0..300).map(|_| noise.normal() + 4.0).collect();
    // At rest at first, as the filter is.
    let mut y = vec![10.0; 300];
    for t in 1..300 {
        y[t] = 0.8 * y[t - 1] + 0.5 * u[t - 1] + 0.1 * noise.normal();
    }
    let log = Log::new(vec![channel("u", &u), channel("y", &y)], 0.1).unwrap();
    let plan = Plan::new(&["u"], "y", Orders::arx(1, &[1], &[1]).unwrap());
    let identified = identify(log, &[], &plan).unwrap();
    let model = StateModel::from_report(&identified, Some(InitialState::Zero)).unwrap();
    assert_eq!(
        (model.inputs(), model.outputs(), model.sample_time()),
        (["u".to_owned()].as_slice(), ["y".to_owned()].as_slice(), 0.1)
    );
    let mut filter = StateFilter::new(model, Estimator::Kalman).unwrap();
    for (u, y) in u.iter().zip(&y) {
        filter.step(Some(0.1), &[*u], &[*y]).unwrap();
    }
    // The model is right: chi-square of 300 degrees of freedom within 4 standard deviations, but for the first rows.
    assert!((filter.summary().nis.unwrap().mean - 1.0).abs() < 0.4, "{}", filter.summary().nis.unwrap().mean);

    // A log that begins away from the offsets: where it began is found, and no other innovation is as large.
    let late = |start| {
        let model = StateModel::from_report(&identified, start).unwrap();
        let mut filter = StateFilter::new(model, Estimator::Kalman).unwrap();
        let rows = u.iter().zip(&y).map(|(u, y)| filter.step(None, &[*u], &[*y + 5.0]).unwrap().nis.unwrap());
        rows.take(10).collect::<Vec<f64>>()
    };
    let (rest, unknown) = (late(Some(InitialState::Zero)), late(Some(InitialState::Unknown)));
    assert!(rest[0] > 100.0 && unknown[0] < 1.0, "{} {}", rest[0], unknown[0]);

    let mut silent = identified.clone();
    silent.polynomials_mut().noise_variance = 0.0;
    let error = StateModel::from_report(&silent, Some(InitialState::Unknown)).unwrap_err().to_string();
    assert!(error.starts_with("its noise variance is 0"), "{error}");
}

/// Through missing outputs, predictions of a model in state space are those of its filter.
#[test]
fn predictions_through_missing_outputs_are_those_of_the_filter() -> Result<(), Error> {
    let mut noise = Noise(23);
    let (mut u, mut y) = (Vec::new(), [Vec::new(), Vec::new()]);
    let mut x = [0.0, 0.0];
    for _ in 0..400 {
        let (input, e) = (noise.uniform(), [noise.uniform(), noise.uniform()]);
        u.push(input);
        for (y, (x, e)) in y.iter_mut().zip(x.iter().zip(e)) {
            y.push(x + e);
        }
        x = [0.8 * x[0] + 0.3 * x[1] + input + 0.5 * e[0], 0.7 * x[1] + 0.4 * e[0] + 0.3 * e[1]];
    }
    let log =
        |y: &[Vec<f64>; 2]| Log::new(vec![channel("u", &u), channel("y1", &y[0]), channel("y2", &y[1])], 0.5);
    let plan = StateSpacePlan { orders: Some(2..=2), ..StateSpacePlan::new(&["u"], &["y1", "y2"]) };
    let report = fit_state_space(&log(&y)?, &[], &plan)?;
    for y in &mut y {
        (1..400).filter(|_| noise.uniform() < -0.6).for_each(|row| y[row] = f64::NAN);
    }
    let applied = report.apply(&log(&y)?, &[], None, Horizon::Steps { steps: 1 }, InitialCondition::Zero)?;

    let model = StateModel::from_report(&report, Some(InitialState::Zero))?;
    let mut filter = StateFilter::new(model, Estimator::Kalman)?;
    // Predictions know that their variances are estimated.
    let factor = match &report.model {
        Model::StateSpace(model) => model.student_factor(),
        _ => f64::NAN,
    };
    let mut through = 0;
    for row in 0..400 {
        let estimate = filter.step(None, &[u[row]], &[y[0][row], y[1][row]])?;
        through += usize::from(estimate.measured < 2);
        for (output, own) in applied.outputs.iter().enumerate() {
            let apart = own.predicted[row] - estimate.outputs.values[output];
            assert!(apart.abs() < 1e-11, "{row}, {output}: {apart:e}");
            let deviations = own.standard_deviations.as_ref().zip(estimate.outputs.standard_deviations);
            let apart = deviations.map(|(own, filter)| own[row] - factor * filter[output]);
            assert!(apart.is_some_and(|apart| apart.abs() < 1e-11), "{row}, {output}: {apart:?}");
        }
    }
    assert!(through > 100);
    Ok(())
}
