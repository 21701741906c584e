use crate::data::Record;
use crate::design::{SignalKind, SignalPlan, TestSignal, Want, compare_signals, planned};
use crate::model::{Orders, PolynomialModel};
use crate::respond::{InitialCondition, simulate};
use crate::{Document, Error};

/// A model of these orders and parameters with noise of variance 0.25.
fn model(orders: &Orders, parameters: &[f64]) -> PolynomialModel {
    PolynomialModel::from_parameters(orders, parameters, None, 0.25, 0.5).unwrap()
}

/// y + a y(t-1) = b u(t-1) + e.
fn first_order(a: f64, b: f64) -> PolynomialModel {
    model(&Orders::arx(1, &[1], &[1]).unwrap(), &[a, b])
}

fn errors(model: &PolynomialModel) -> Vec<f64> {
    model.parameters.iter().map(|parameter| parameter.standard_error.unwrap()).collect()
}

fn values(kind: SignalKind, length: usize) -> Vec<Vec<f64>> {
    TestSignal::new(&SignalPlan { length, ..SignalPlan::new(kind) }).unwrap().values(length)
}

#[test]
fn errors_of_a_first_order_model_are_those_of_the_formula() {
    // White u of variance 1: M/N = diag((b^2 + sigma^2)/(1 - a^2), 1).
    let (a, b, count) = (-0.8_f64, 0.5_f64, 60_000);
    let known = planned(&first_order(a, b), &values(SignalKind::Rbs, count)).unwrap();
    let per_sample = [(1.0 - a * a) / (b * b + 0.25), 1.0];
    for (found, variance) in errors(&known).iter().zip(per_sample) {
        let expected = (0.25 * variance / count as f64).sqrt();
        // The sample moments of u are off by about 1/sqrt(N).
        assert!((found / expected - 1.0).abs() < 0.02, "{found} {expected}");
    }
    assert_eq!(known.degrees_of_freedom, Some(count - 1 - 3));
}

/// sum_t psi psi' of the input by differences of the free run, where A = C = D = 1 and psi = dy/dtheta; with a column
/// of ones.
fn by_differences(orders: &Orders, parameters: &[f64], u: &[f64], before: usize) -> Vec<Vec<f64>> {
    let long = [vec![u[0]; before], u.to_vec()].concat();
    let run = |parameters: &[f64]| {
        let nothing = vec![0.0; long.len()];
        let record = Record::new(&nothing, vec![&long]).unwrap();
        simulate(&model(orders, parameters), &record, InitialCondition::Zero).unwrap().values
    };
    let column = |k: usize| -> Vec<f64> {
        let step = 1e-6;
        let at = |sign: f64| {
            let mut moved = parameters.to_vec();
            moved[k] += sign * step;
            run(&moved)
        };
        at(1.0).iter().zip(at(-1.0)).map(|(up, down)| (up - down) / (2.0 * step)).skip(before).collect()
    };
    let mut columns: Vec<Vec<f64>> = (0..parameters.len()).map(column).collect();
    columns.push(vec![1.0; u.len()]);
    columns
}

#[test]
fn errors_of_an_output_error_model_are_those_of_its_sensitivities() {
    let orders = Orders::oe(&[2], &[2], &[1]).unwrap();
    let parameters = [1.0, 0.5, -1.5, 0.7];
    for kind in [SignalKind::Prbs, SignalKind::Steps, SignalKind::Chirp] {
        let u = &values(kind, 200)[0];
        let known = planned(&model(&orders, &parameters), std::slice::from_ref(u)).unwrap();
        // So long at rest at the first value that nothing is left of how it came there.
        let columns = by_differences(&orders, &parameters, u, 400);
        let size = columns.len();
        let entry =
            |i: usize, j: usize| -> f64 { columns[i].iter().zip(&columns[j]).map(|(x, y)| x * y).sum() };
        let matrix = thetahat_core::nalgebra::DMatrix::from_fn(size, size, entry);
        let covariance = matrix.try_inverse().unwrap() * 0.25;
        for (k, found) in errors(&known).iter().enumerate() {
            let expected = covariance[(k, k)].sqrt();
            assert!((found / expected - 1.0).abs() < 1e-5, "{kind:?} {k}: {found} {expected}");
        }
    }
}

#[test]
fn noise_alone_tells_as_much_as_theory_says() {
    // Of AR(1), C and D of order 1 the asymptotic variance is (1 - p^2)/N.
    let orders = Orders::bj(&[1], 1, 1, &[0], &[0]).unwrap();
    let (c, d, count) = (0.5_f64, -0.8_f64, 1000);
    let known = planned(&model(&orders, &[2.0, c, d]), &values(SignalKind::Rbs, count)).unwrap();
    // E psi psi' of (c, d): 1/(1 - c^2), 1/(1 - d^2), and -1/(1 - c d) between them.
    let (cc, dd, cd) = (1.0 / (1.0 - c * c), 1.0 / (1.0 - d * d), -1.0 / (1.0 - c * d));
    let determinant = cc * dd - cd * cd;
    let counted = (count - 1) as f64;
    let expected = [dd / determinant / counted, cc / determinant / counted];
    for (found, variance) in errors(&known)[1..].iter().zip(expected) {
        assert!((found / variance.sqrt() - 1.0).abs() < 1e-9, "{found} {}", variance.sqrt());
    }
}

#[test]
fn a_level_does_not_matter_and_a_constant_tells_nothing() {
    let model = first_order(-0.8, 0.5);
    let u = values(SignalKind::Prbs, 300);
    let raised = vec![u[0].iter().map(|u| u + 7.0).collect::<Vec<f64>>()];
    let (one, other) = (errors(&planned(&model, &u).unwrap()), errors(&planned(&model, &raised).unwrap()));
    assert!(one.iter().zip(&other).all(|(one, other)| (one / other - 1.0).abs() < 1e-9));
    let constant = planned(&model, &[vec![1.0; 300]]);
    assert!(
        matches!(&constant, Err(Error::Undetermined { parameters, .. }) if parameters == &["b1"]),
        "{constant:?}"
    );
    // The first of two inputs alone.
    let two = PolynomialModel::from_parameters(
        &Orders::arx(1, &[1, 1], &[1, 1]).unwrap(),
        &[-0.8, 0.5, 0.5],
        None,
        0.25,
        1.0,
    );
    let same = planned(&two.unwrap(), &[u[0].clone(), u[0].clone()]);
    assert!(matches!(same, Err(Error::Undetermined { .. })));
}

#[test]
fn the_best_signal_differs_by_purpose() {
    // A DC motor: a fast signal tells b1, one step the gain, and what lies between tells some of both.
    let plans = ["prbs", "prbs:4", "steps"].map(|waveform| SignalPlan {
        length: 1000,
        ..SignalPlan::new(waveform.parse::<crate::design::Waveform>().unwrap())
    });
    let model = model(&Orders::arx(2, &[2], &[1]).unwrap(), &[-1.5407, 0.5765, 0.36, 0.3174]);
    let wants = ["b1:0.02", "dc-gain:1%"].map(|want| want.parse::<Want>().unwrap());
    let found = compare_signals(&model, &plans, &wants).unwrap();
    let errors = |figure: usize| -> Vec<f64> {
        found.signals.iter().map(|signal| signal.standard_errors[figure].unwrap()).collect()
    };
    let (b1, gain) = (errors(0), errors(1));
    assert!(b1[0] < b1[1] && b1[1] < b1[2], "{b1:?}");
    assert!(gain[0] > gain[1] && gain[1] > gain[2], "{gain:?}");
    assert_eq!(crate::design::ExperimentDesign::from_json(&found.to_json().unwrap()).unwrap(), found);
}

#[test]
fn the_length_is_the_first_that_is_good_enough() {
    let model = first_order(-0.9, 0.5);
    for (kind, want) in [
        (SignalKind::Prbs, "b1:0.02"),
        (SignalKind::White, "dc-gain:5%"),
        (SignalKind::Multisine, "time-constant:0.3"),
        (SignalKind::Steps, "a1:1%"),
        (SignalKind::Rbs, "b1:1000"),
    ] {
        let plan = SignalPlan { length: 500, sample_time: 0.5, ..SignalPlan::new(kind) };
        let want: Want = want.parse().unwrap();
        let found =
            compare_signals(&model, std::slice::from_ref(&plan), std::slice::from_ref(&want)).unwrap();
        let needed = found.signals[0].needed.unwrap();
        let limit = found.figures[0].limit.unwrap();
        let signal = TestSignal::new(&plan).unwrap();
        let error = |length: usize| {
            let known = planned(&model, &signal.values(length)).ok()?;
            let figures = crate::design::want::figures(&known);
            figures.into_iter().find(|figure| figure.name == want.figure)?.standard_error
        };
        assert!(error(needed).unwrap() <= limit, "{kind:?}: {needed}");
        // Half a percent less is too few.
        let fewer = needed - 1 - needed / 200;
        assert!(error(fewer).is_none_or(|error| error > limit), "{kind:?}: {needed}");
    }
}

#[test]
fn a_model_that_nothing_can_be_planned_with_is_refused() {
    let refused = |model: &PolynomialModel| match planned(model, &values(SignalKind::Prbs, 100)) {
        Err(Error::Data { message, .. }) => message,
        other => panic!("{other:?}"),
    };
    assert!(refused(&model(&Orders::arx(1, &[], &[]).unwrap(), &[-0.5])).contains("no inputs"));
    assert!(refused(&first_order(-1.0, 1.0)).contains("not stable"));
    let silent = PolynomialModel { noise_variance: 0.0, ..first_order(-0.5, 1.0) };
    assert!(refused(&silent).contains("no noise"));
    let random_walk = model(&Orders::bj(&[1], 0, 1, &[0], &[1]).unwrap(), &[1.0, -1.0]);
    assert!(refused(&random_walk).contains("D of the noise"));

    let wanted = |want: &str| {
        let plan = SignalPlan::new(SignalKind::Prbs);
        let found = compare_signals(&first_order(-0.5, 1.0), &[plan], &[want.parse().unwrap()]);
        match found {
            Err(Error::Argument { argument, message }) if argument == "want" => message,
            other => panic!("{other:?}"),
        }
    };
    assert!(wanted("f1:1").contains("there are: a1, b1, dc-gain, time-constant"));
    let zero = compare_signals(
        &first_order(-0.5, 0.0),
        &[SignalPlan::new(SignalKind::Prbs)],
        &["b1:1%".parse().unwrap()],
    );
    assert!(zero.is_err_and(|error| error.to_string().contains("has no percent")));
    for text in ["", "a1", ":1", "a1:", "a1:-1", "a1:0%", "a1:nan", "a1:1:2"] {
        assert!(text.parse::<Want>().is_err(), "{text}");
    }
    assert_eq!("dc-gain2: 2%".parse::<Want>().unwrap().to_string(), "dc-gain2:2%");
    let few = planned(&first_order(-0.5, 1.0), &values(SignalKind::Prbs, 4));
    assert!(matches!(few, Err(Error::Undetermined { .. })));
    let uneven = planned(&first_order(-0.5, 1.0), &[vec![1.0; 10], vec![1.0; 10]]);
    assert!(matches!(uneven, Err(Error::Argument { .. })));
}
