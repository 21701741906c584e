//! Consistency where least squares is biased, intervals that cover, and identities.

use thetahat_numerics::noise::Noise;
use thetahat_numerics::optimize::Search;

use super::*;
use crate::estimate::{Method, estimate};
use crate::model::polynomial::product;
use crate::tests::filtered;

/// y = (B/F) u + v, v being noise of standard deviation `size` coloured by 1/D; the first 500 samples are not in the
/// record.
struct Experiment {
    u: Vec<f64>,
    y: Vec<f64>,
}

const B: [f64; 3] = [0.0, 1.0, 0.5];
const F: [f64; 3] = [1.0, -1.5, 0.7];
const D: [f64; 2] = [1.0, -0.8];
/// f, b.
const PLANT: [f64; 4] = [-1.5, 0.7, 1.0, 0.5];

impl Experiment {
    fn new(length: usize, size: f64, noise: &mut Noise) -> Self {
        let u = noise.take(length + 500);
        let v = filtered(&[size], &D, &noise.take(length + 500));
        let y = filtered(&B, &F, &u).iter().zip(&v).map(|(x, v)| x + v).collect();
        Self { u, y }
    }

    fn record(&self) -> Record<'_> {
        Record::new(&self.y[500..], vec![&self.u[500..]]).unwrap()
    }
}

fn four_stages(record: &Record<'_>, initial: Initial) -> Estimate {
    instrumental_variables(record, &Orders::arx(2, &[2], &[1]).unwrap(), initial).unwrap()
}

fn refined(record: &Record<'_>, initial: Initial) -> Estimate {
    refined_instrumental_variables(record, &Orders::oe(&[2], &[2], &[1]).unwrap(), initial).unwrap()
}

/// Of a number of estimates of the same parameters: how far their mean is from the truth in standard errors of that
/// mean, and how often the truth is within 1.96 of their own standard errors, for each parameter.
fn consistency(estimates: &[Estimate], truth: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let count = estimates.len() as f64;
    let of = |k: usize| estimates.iter().map(move |estimate| estimate.parameters()[k] - truth[k]);
    let error = |estimate: &Estimate, k: usize| estimate.covariance().unwrap()[k][k].sqrt();
    let bias = (0..truth.len()).map(|k| {
        let mean = of(k).sum::<f64>() / count;
        let variance = of(k).map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
        mean.abs() / (variance / count).sqrt()
    });
    let covered = (0..truth.len()).map(|k| {
        let inside = of(k).zip(estimates).filter(|(value, estimate)| value.abs() < 1.96 * error(estimate, k));
        inside.count() as f64 / count
    });
    (bias.collect(), covered.collect())
}

#[test]
fn data_without_noise_give_the_plant_back() {
    let mut noise = Noise(1);
    let experiment = Experiment::new(300, 0.0, &mut noise);
    let record = experiment.record();
    let mut cut = record.clone();
    cut.segments = vec![0..100, 110..113, 120..300];
    cut.past = vec![0; 3];
    for record in [&record, &cut] {
        let found = four_stages(record, Initial::Drop);
        let refined = refined(record, Initial::Estimate);
        for (k, value) in PLANT.iter().enumerate() {
            assert!((found.parameters()[k] - value).abs() < 1e-9, "{found:?}");
            assert!((refined.parameters()[(k + 2) % 4] - value).abs() < 1e-9, "{refined:?}");
        }
        assert!(found.mse() < 1e-20 && refined.mse() < 1e-20);
    }
}

#[test]
fn coloured_noise_biases_least_squares_and_not_instrumental_variables() {
    let mut noise = Noise(2);
    let experiments: Vec<Experiment> = (0..80).map(|_| Experiment::new(600, 0.5, &mut noise)).collect();
    let orders = Orders::arx(2, &[2], &[1]).unwrap();
    let biased =
        experiments.iter().map(|experiment| arx(&experiment.record(), &orders, Initial::Drop).unwrap());
    let (bias, _) = consistency(&biased.collect::<Vec<_>>(), &PLANT);
    assert!(bias.iter().any(|bias| *bias > 20.0), "{bias:?}");

    let found: Vec<Estimate> =
        experiments.iter().map(|experiment| four_stages(&experiment.record(), Initial::Drop)).collect();
    let (bias, covered) = consistency(&found, &PLANT);
    assert!(bias.iter().all(|bias| *bias < 4.0), "{bias:?}");
    assert!(covered.iter().all(|covered| (0.86..=1.0).contains(covered)), "{covered:?}");

    let refined: Vec<Estimate> =
        experiments.iter().map(|experiment| refined(&experiment.record(), Initial::Estimate)).collect();
    let truth = [PLANT[2], PLANT[3], PLANT[0], PLANT[1]];
    let (bias, covered) = consistency(&refined, &truth);
    assert!(bias.iter().all(|bias| *bias < 4.0), "{bias:?}");
    assert!(covered.iter().all(|covered| (0.86..=1.0).contains(covered)), "{covered:?}");
}

#[test]
fn refined_instrumental_variables_end_where_the_output_error_is_least() {
    let mut noise = Noise(3);
    let experiment = Experiment::new(1500, 0.4, &mut noise);
    let mut record = experiment.record();
    record.segments = vec![0..700, 705..1500];
    record.past = vec![0; 2];
    let orders = Orders::oe(&[2], &[2], &[1]).unwrap();
    for initial in [Initial::Zero, Initial::Estimate] {
        let found = refined(&record, initial);
        let search = Search { tolerance: 1e-14, ..Search::default() };
        let least = estimate(&record, &orders, &Method::PredictionError(search), initial).unwrap();
        assert!((found.mse() / least.mse() - 1.0).abs() < 1e-9);
        assert!((found.noise_variance() / least.noise_variance() - 1.0).abs() < 1e-9);
        for (k, (found_value, value)) in found.parameters().iter().zip(least.parameters()).enumerate() {
            let error = found.covariance().unwrap()[k][k].sqrt();
            assert!((found_value - value).abs() < 1e-3 * error, "{found:?} {least:?}");
        }
        let Procedure::RefinedInstrumentalVariables { stopped, initial_conditions, residual_order, .. } =
            found.procedure()
        else {
            panic!("{found:?}")
        };
        assert_eq!(*stopped, Stopped::Converged);
        assert_eq!(*initial_conditions, if initial == Initial::Estimate { 4 } else { 0 });
        assert!(*residual_order >= 1);
    }
}

#[test]
fn several_inputs_have_denominators_of_their_own() {
    let mut noise = Noise(4);
    let inputs: Vec<Vec<f64>> = (0..2).map(|_| noise.take(3000)).collect();
    let first = filtered(&[0.0, 1.0], &[1.0, -0.9], &inputs[0]);
    let second = filtered(&[0.0, 0.0, 2.0, 1.0], &[1.0, -1.0, 0.5], &inputs[1]);
    let v = filtered(&[0.3], &[1.0, -0.8], &noise.take(3000));
    let y: Vec<f64> = (0..3000).map(|t| first[t] + second[t] + v[t]).collect();
    let record = Record::new(&y, inputs.iter().map(Vec::as_slice).collect()).unwrap();
    let orders = Orders::oe(&[1, 2], &[1, 2], &[1, 2]).unwrap();
    let found = refined_instrumental_variables(&record, &orders, Initial::Auto).unwrap();
    assert_eq!(found.initial(), Initial::Zero);
    let truth = [1.0, 2.0, 1.0, -0.9, -1.0, 0.5];
    for (k, (value, expected)) in found.parameters().iter().zip(truth).enumerate() {
        let error = found.covariance().unwrap()[k][k].sqrt();
        assert!((value - expected).abs() < 4.0 * error && error < 0.05, "{found:?}");
    }
    // One denominator for both: B_1 F_2 and B_2 F_1 over F_1 F_2.
    let orders = Orders::arx(3, &[3, 3], &[1, 2]).unwrap();
    let found = instrumental_variables(&record, &orders, Initial::Auto).unwrap();
    let expected = product(&[1.0, -0.9], &[1.0, -1.0, 0.5]);
    for (k, (value, expected)) in found.parameters().iter().zip(&expected[1..]).enumerate() {
        let error = found.covariance().unwrap()[k][k].sqrt();
        assert!((value - expected).abs() < 4.0 * error && error < 0.1, "{found:?}");
    }
}

#[test]
fn the_start_is_estimated_where_it_is_worth_it() {
    let mut noise = Noise(5);
    let u = noise.take(1500);
    let x = filtered(&[0.0, 0.02], &[1.0, -1.98, 0.9801], &u);
    let y: Vec<f64> = x.iter().map(|x| x + 0.05 * noise.uniform()).collect();
    let orders = Orders::oe(&[1], &[2], &[1]).unwrap();
    let fit = |from: usize| {
        let record = Record::new(&y[from..], vec![&u[from..]]).unwrap();
        refined_instrumental_variables(&record, &orders, Initial::Auto).unwrap()
    };
    assert_eq!(fit(0).initial(), Initial::Zero);
    assert_eq!(fit(700).initial(), Initial::Estimate);
}

#[test]
fn what_the_methods_are_not_for_is_refused() {
    let mut noise = Noise(6);
    let experiment = Experiment::new(200, 0.1, &mut noise);
    let record = experiment.record();
    let argument = |result: Result<Estimate, Error>| match result.unwrap_err() {
        Error::Argument { argument, .. } => argument,
        other => panic!("{other}"),
    };
    for orders in [
        Orders::armax(1, &[1], 1, &[1]).unwrap(),
        Orders::arx(2, &[2], &[1]).unwrap(),
        Orders::bj(&[1], 1, 1, &[1], &[1]).unwrap(),
    ] {
        assert_eq!(argument(refined_instrumental_variables(&record, &orders, Initial::Auto)), "method");
    }
    let oe = Orders::oe(&[2], &[2], &[1]).unwrap();
    assert_eq!(argument(refined_instrumental_variables(&record, &oe, Initial::Drop)), "initial");
    assert_eq!(argument(instrumental_variables(&record, &oe, Initial::Auto)), "method");
    let silent = Record::new(record.output, vec![]).unwrap();
    let ar = Orders::arx(2, &[], &[]).unwrap();
    assert_eq!(argument(instrumental_variables(&silent, &ar, Initial::Auto)), "method");

    let undetermined = |result: Result<Estimate, Error>| matches!(result, Err(Error::Undetermined { .. }));
    let zero = vec![0.0; record.output.len()];
    let no_input = Record::new(record.output, vec![&zero]).unwrap();
    let no_output = Record::new(&zero, record.inputs.clone()).unwrap();
    let short = Record::new(&record.output[..4], vec![&record.inputs[0][..4]]).unwrap();
    let arx = Orders::arx(2, &[2], &[1]).unwrap();
    for record in [&no_input, &no_output, &short] {
        assert!(undetermined(instrumental_variables(record, &arx, Initial::Auto)));
        for initial in [Initial::Auto, Initial::Zero, Initial::Estimate] {
            assert!(undetermined(refined_instrumental_variables(record, &oe, initial)), "{initial:?}");
        }
    }
}
