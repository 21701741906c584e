//! The deviations of predictions against finite differences, and against what is known in closed form.

use thetahat_numerics::noise::Noise;

use super::general::{model, models, output};
use super::{signals, views, with_poles};
use crate::data::Record;
use crate::model::{OffsetCovariance, Orders, PolynomialModel};
use crate::respond::{
    Draws, InitialCondition, draw, forecast, predict, prediction_deviation, prediction_deviations,
};

/// A covariance matrix of full rank, small enough that the first order is exact.
fn covariance(count: usize, noise: &mut Noise) -> Vec<Vec<f64>> {
    let factor: Vec<Vec<f64>> = (0..count).map(|_| noise.take(count)).collect();
    let inner = |a: &Vec<f64>, b: &Vec<f64>| 1e-4 * a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    factor.iter().map(|a| factor.iter().map(|b| inner(a, b)).collect()).collect()
}

/// g' P g at each place of what `values` gives for parameters, by central differences.
fn spread(
    model: &PolynomialModel,
    covariance: &[Vec<f64>],
    values: impl Fn(&PolynomialModel) -> Vec<f64>,
) -> Vec<f64> {
    let center: Vec<f64> = model.parameters.iter().map(|parameter| parameter.value).collect();
    let moved = |k: usize, by: f64| {
        let mut moved = center.clone();
        moved[k] += by;
        values(
            &PolynomialModel::from_parameters(&model.orders, &moved, None, model.noise_variance, 1.0)
                .unwrap(),
        )
    };
    let step = 1e-7;
    let slopes: Vec<Vec<f64>> = (0..center.len())
        .map(|k| {
            let sides = moved(k, step).into_iter().zip(moved(k, -step));
            sides.map(|(up, down)| (up - down) / (2.0 * step)).collect()
        })
        .collect();
    let at = |t: usize| -> f64 {
        let row =
            |i: usize| slopes[i][t] * (0..center.len()).map(|j| covariance[i][j] * slopes[j][t]).sum::<f64>();
        (0..center.len()).map(row).sum()
    };
    (0..slopes.first().map_or(0, Vec::len)).map(at).collect()
}

fn starts(model: &PolynomialModel) -> &'static [InitialCondition] {
    if model.orders.is_linear() {
        &[InitialCondition::Zero, InitialCondition::Drop]
    } else {
        &[InitialCondition::Zero, InitialCondition::Drop, InitialCondition::Estimate]
    }
}

#[test]
fn parameters_add_the_square_of_what_they_do() {
    let mut noise = Noise(21);
    // Models with a root on the circle are left out: they have neighbours that are unstable.
    for model in
        models().into_iter().filter(|model| model.stable && model.noise_poles.iter().all(|p| p.re < 1.0))
    {
        let (u, e) = (signals(model.b.len(), 140, &mut noise), noise.take(140));
        let (noisy, exact) = (output(&model, &u, &e), output(&model, &u, &[0.0; 140]));
        let future: Vec<&[f64]> = u.iter().map(|u| &u[120..]).collect();
        let uncertain = PolynomialModel {
            covariance: Some(covariance(model.parameters.len(), &mut noise)),
            ..model.clone()
        };
        let matrix = uncertain.covariance.as_ref().unwrap();
        let assert_added = |what: &str, with: &[f64], without: &[f64], expected: &[f64]| {
            assert_eq!(with.len(), expected.len());
            for (t, ((with, without), expected)) in with.iter().zip(without).zip(expected).enumerate() {
                let found = with * with - without * without;
                assert!(
                    (found - expected).abs() <= 1e-5 * (expected + without * without),
                    "{} {what}, {t}: {found} {expected}",
                    model.orders
                );
            }
        };
        // An impulse into 1/F that D takes off again is not seen, but beside these parameters it is.
        let cancels = model.f.contains(&model.d) && model.d.len() > 1;
        for &start in
            starts(&model).iter().filter(|start| !(cancels && **start == InitialCondition::Estimate))
        {
            // What initial conditions are worth depends on the parameters too, in proportion to the errors: of second
            // order, and not there without errors.
            let record = if start == InitialCondition::Estimate {
                Record {
                    output: &exact,
                    inputs: views(&u),
                    segments: std::iter::once(0..120).collect(),
                    past: vec![0],
                }
            } else {
                Record {
                    output: &noisy,
                    inputs: views(&u),
                    segments: vec![0..50, 60..120],
                    past: vec![0, 10],
                }
            };
            for horizon in [1, 4] {
                let counted =
                    |values: Vec<f64>| values.into_iter().filter(|v| !v.is_nan()).collect::<Vec<_>>();
                let of = |model: &PolynomialModel| {
                    counted(predict(model, &record, horizon, start).unwrap().values)
                };
                let deviations = |model: &PolynomialModel| {
                    counted(prediction_deviations(model, &record, horizon, start).unwrap())
                };
                let expected = spread(&model, matrix, of);
                let what = format!("{start:?} {horizon}");
                assert_added(&what, &deviations(&uncertain), &deviations(&model), &expected);
            }
            let ahead = |model: &PolynomialModel| forecast(model, &record, &future, 20, start).unwrap();
            let expected = spread(&model, matrix, |model| ahead(model).values);
            let (with, without) = (ahead(&uncertain).standard_deviations, ahead(&model).standard_deviations);
            assert_added(&format!("{start:?} forecast"), &with, &without, &expected);
        }
    }
}

#[test]
fn errors_before_the_first_count_as_far_as_c_remembers_them() {
    // y = e + c q^-1 e: of the error before the first sample (-c)^t is left after t samples, and it is of variance 1/4.
    let c = 0.8_f64;
    let model = model(&[1.0], &[], &[1.0, c], &[1.0]);
    let y = Noise(22).take(12);
    let record = Record::new(&y, vec![]).unwrap();
    let found = prediction_deviations(&model, &record, 1, InitialCondition::Drop).unwrap();
    for (t, found) in found.iter().enumerate() {
        let expected = 0.5 * (1.0 + c.powi(2 * t as i32 + 2)).sqrt();
        assert!((found - expected).abs() < 1e-14, "{t} {found} {expected}");
    }
    let ahead = forecast(&model, &record, &[], 2, InitialCondition::Drop).unwrap().standard_deviations;
    assert!((ahead[0] - 0.5 * (1.0 + c.powi(26)).sqrt()).abs() < 1e-14);
    // Two steps ahead no error of before is left.
    assert!((ahead[1] - 0.5 * (1.0 + c * c).sqrt()).abs() < 1e-14);
    // From rest they are known.
    let rest = prediction_deviations(&model, &record, 1, InitialCondition::Zero).unwrap();
    assert!(rest.iter().all(|deviation| *deviation == 0.5));
}

#[test]
fn an_estimated_start_is_uncertain_in_forecasts() {
    // x(t) = f^t delta, delta by regression: var = sigma^2 (1 + f^2k/sum f^2t).
    let f = 0.95_f64;
    let model = model(&[1.0], &[(1, &[1.0], &[1.0, -f])], &[1.0], &[1.0]);
    let mut noise = Noise(23);
    let (u, y) = (noise.take(40), noise.take(30));
    let record = Record::new(&y, vec![&u[..30]]).unwrap();
    let ahead = forecast(&model, &record, &[&u[30..]], 10, InitialCondition::Estimate).unwrap();
    let sum: f64 = (0..30).map(|t| f.powi(2 * t)).sum();
    for (step, found) in ahead.standard_deviations.iter().enumerate() {
        let expected = 0.5 * (1.0 + f.powi(2 * (30 + step as i32)) / sum).sqrt();
        assert!((found - expected).abs() < 1e-12, "{step} {found} {expected}");
    }
}

#[test]
fn degrees_of_freedom_make_intervals_wider() {
    let model = model(&with_poles(&[0.5]), &[], &[1.0], &[1.0]);
    let y = Noise(24).take(30);
    let record = Record::new(&y, vec![]).unwrap();
    let of = |degrees: Option<usize>| {
        let model = PolynomialModel { degrees_of_freedom: degrees, ..model.clone() };
        prediction_deviations(&model, &record, 3, InitialCondition::Drop).unwrap()[10]
    };
    assert_eq!(of(None), prediction_deviation(&model, 3).unwrap());
    assert!((of(Some(10)) / of(None) - 1.25_f64.sqrt()).abs() < 1e-14);
    // Student's distribution has a variance from three degrees on.
    assert!((of(Some(1)) / of(None) - 3.0_f64.sqrt()).abs() < 1e-14);
}

/// A matrix of zeros but for the variances of the offset.
fn open(model: &mut PolynomialModel, variances: &[f64], middle: Option<f64>) {
    let own = model.parameters.len();
    let size = own + variances.len();
    let entry = |i: usize, j: usize| if i == j && i >= own { variances[i - own] } else { 0.0 };
    let covariance = (0..size).map(|i| (0..size).map(|j| entry(i, j)).collect()).collect();
    model.offset_covariance = Some(OffsetCovariance { covariance, middle });
}

#[test]
fn an_open_offset_adds_what_a_constant_and_a_trend_do() {
    let mut noise = Noise(31);
    let (u, y) = (noise.take(60), noise.take(60));
    let record = Record::new(&y, vec![&u]).unwrap();
    let near = |found: f64, variance: f64| (found / variance.sqrt() - 1.0).abs() < 1e-12;
    let of = |orders: Orders, parameters: &[f64]| {
        PolynomialModel::from_parameters(&orders, parameters, None, 0.25, 0.5).unwrap()
    };
    // Without A the constant is the level.
    let mut oe = of(Orders::oe(&[1], &[1], &[1]).unwrap(), &[1.0, -0.5]);
    open(&mut oe, &[0.04], None);
    let found = prediction_deviations(&oe, &record, 3, InitialCondition::Zero).unwrap();
    assert!(found.iter().all(|found| near(*found, 0.29)), "{found:?}");
    let ahead = forecast(&oe, &record, &[&[1.0; 4]], 4, InitialCondition::Zero).unwrap();
    assert!(ahead.standard_deviations.iter().all(|found| near(*found, 0.29)));
    // An error of the equation goes through 1/A for as long as the horizon is.
    let mut arx = of(Orders::arx(1, &[1], &[1]).unwrap(), &[-0.5, 1.0]);
    open(&mut arx, &[0.04], None);
    let (sums, squares) = ([1.0, 1.5, 1.75], [1.0, 1.25, 1.3125]);
    for steps in 1..=3 {
        let variance = 0.25 * squares[steps - 1] + 0.04 * sums[steps - 1] * sums[steps - 1];
        let found = prediction_deviations(&arx, &record, steps, InitialCondition::Drop).unwrap();
        assert!(found[steps..].iter().all(|found| near(*found, variance)), "{steps}");
        let ahead = forecast(&arx, &record, &[&[1.0; 3]], 3, InitialCondition::Drop).unwrap();
        assert!(near(ahead.standard_deviations[steps - 1], variance), "{steps}");
    }
    // A trend counts from the middle on, in seconds.
    open(&mut oe, &[0.0, 0.01], Some(10.0));
    let found = prediction_deviations(&oe, &record, 1, InitialCondition::Zero).unwrap();
    let variance = |row: usize| 0.25 + 0.01 * (0.5 * row as f64 - 10.0).powi(2);
    assert!(found.iter().enumerate().all(|(row, found)| near(*found, variance(row))));
    let ahead = forecast(&oe, &record, &[&[1.0; 4]], 4, InitialCondition::Zero).unwrap();
    for (step, found) in ahead.standard_deviations.iter().enumerate() {
        assert!(near(*found, variance(60 + step)), "{step}");
    }
    // Draws have it too.
    open(&mut oe, &[0.75], None);
    let runs = draw(&oe, &record, InitialCondition::Zero, &Draws { count: 4000, seed: 1 }).unwrap();
    let errors = |row: usize| {
        let mean = runs.values.iter().map(|run| run[row]).sum::<f64>() / 4000.0;
        runs.values.iter().map(|run| (run[row] - mean).powi(2)).sum::<f64>() / 3999.0
    };
    assert!(runs.varied && (errors(7) - 1.0).abs() < 0.09 && (errors(50) - 1.0).abs() < 0.09);
}
