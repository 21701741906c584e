//! Estimates against what made the data, and against one another.

use std::ops::Range;

use thetahat_numerics::noise::Noise;

use super::{Estimate, arx, arx_factor};
use crate::Error;
use crate::data::Record;
use crate::estimate::Initial;
use crate::model::{Orders, polynomial::product};

/// What made the data.
struct Plant {
    orders: Orders,
    /// a1 … a_na, then b of each input.
    parameters: Vec<f64>,
}

impl Plant {
    /// Poles inside a circle of radius 0.95.
    fn random(noise: &mut Noise) -> Self {
        let mut below = |count: usize| ((noise.uniform() + 1.0) / 2.0 * count as f64) as usize;
        let (na, inputs) = (below(5), 1 + below(2));
        let nb: Vec<usize> = (0..inputs).map(|_| 1 + below(4)).collect();
        let nk: Vec<usize> = (0..inputs).map(|_| below(4)).collect();
        let mut a = vec![1.0];
        while a.len() + 1 < na {
            let (radius, angle) = (0.95 * noise.uniform().abs(), 3.0 * noise.uniform());
            a = product(&a, &[1.0, -2.0 * radius * angle.cos(), radius * radius]);
        }
        while a.len() < na + 1 {
            a = product(&a, &[1.0, -0.95 * noise.uniform()]);
        }
        let mut parameters = a.split_off(1);
        parameters.extend(noise.take(nb.iter().sum()));
        Self { orders: Orders::arx(na, &nb, &nk).unwrap(), parameters }
    }

    /// The output to `inputs` and equation errors `e`, from rest.
    fn output(&self, inputs: &[Vec<f64>], e: &[f64]) -> Vec<f64> {
        let mut y: Vec<f64> = Vec::new();
        for t in 0..e.len() {
            let (a, mut b) = self.parameters.split_at(self.orders.na);
            let mut value = e[t] - a.iter().zip(y.iter().rev()).map(|(a, y)| a * y).sum::<f64>();
            for (j, u) in inputs.iter().enumerate() {
                let (own, rest) = b.split_at(self.orders.nb[j]);
                let lags = (self.orders.nk[j]..=t).zip(own);
                value += lags.map(|(lag, b)| b * u[t - lag]).sum::<f64>();
                b = rest;
            }
            y.push(value);
        }
        y
    }
}

fn record<'a, U: AsRef<[f64]>>(y: &'a [f64], u: &'a [U], segments: &[Range<usize>]) -> Record<'a> {
    let mut record = Record::new(y, u.iter().map(AsRef::as_ref).collect()).unwrap();
    record.past = vec![0; segments.len()];
    record.segments = segments.to_vec();
    record
}

/// One segment.
fn whole(length: usize) -> Vec<Range<usize>> {
    std::iter::once(0..length).collect()
}

fn close(found: &[f64], expected: &[f64], tolerance: f64) -> bool {
    let largest = expected.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    found.len() == expected.len()
        && found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() <= tolerance * largest)
}

#[test]
fn data_without_noise_give_the_plant_back() {
    let mut noise = Noise(1);
    for _ in 0..60 {
        let plant = Plant::random(&mut noise);
        let u: Vec<Vec<f64>> = (0..plant.orders.inputs()).map(|_| noise.take(400)).collect();
        let y = plant.output(&u, &[0.0; 400]);
        let all = whole(400);
        let cut = [30..31, 40..43, 50..150, 150..400];
        for (segments, initial) in [(&all[..], Initial::Drop), (&all, Initial::Zero), (&cut, Initial::Drop)] {
            let estimate = arx(&record(&y, &u, segments), &plant.orders, initial).unwrap();
            assert!(close(estimate.parameters(), &plant.parameters, 1e-10), "{:?}", plant.orders);
            assert!(estimate.noise_variance() < 1e-25);
        }
    }
}

#[test]
fn merged_factors_of_the_segments_give_the_fit_of_all() {
    let mut noise = Noise(2);
    for _ in 0..30 {
        let plant = Plant::random(&mut noise);
        let u: Vec<Vec<f64>> = (0..plant.orders.inputs()).map(|_| noise.take(500)).collect();
        let y = plant.output(&u, &noise.take(500));
        let segments = [0..2, 3..50, 50..57, 60..500];
        for initial in [Initial::Drop, Initial::Zero] {
            let whole = arx(&record(&y, &u, &segments), &plant.orders, initial).unwrap();
            let mut factors = segments.iter().map(|segment| {
                arx_factor(&record(&y, &u, std::slice::from_ref(segment)), &plant.orders, initial)
            });
            let mut merged = factors.next().unwrap().unwrap();
            for factor in factors {
                merged.merge(&factor.unwrap()).unwrap();
            }
            let merged = Estimate::from_factor(&merged, &plant.orders).unwrap();
            assert_eq!(merged.samples(), whole.samples());
            assert!(close(merged.parameters(), whole.parameters(), 1e-12));
            assert!(close(
                &merged.covariance().unwrap().concat(),
                &whole.covariance().unwrap().concat(),
                1e-11
            ));
            assert!(close(&[merged.mse()], &[whole.mse()], 1e-13));
            assert!(close(&[merged.condition().unwrap()], &[whole.condition().unwrap()], 1e-9));
        }
    }
}

/// The parameters that an estimate cannot determine.
fn undetermined(y: &[f64], u: &[&[f64]], orders: &Orders) -> Vec<String> {
    match arx(&record(y, u, &whole(y.len())), orders, Initial::Drop).unwrap_err() {
        Error::Undetermined { parameters, .. } => parameters,
        other => panic!("{other}"),
    }
}

#[test]
fn what_the_data_cannot_determine_is_named() {
    let mut noise = Noise(3);
    let (u, v) = (noise.take(100), noise.take(100));
    let y = noise.take(100);
    let (zero, one) = (vec![0.0; 100], vec![3.0; 100]);
    let sum: Vec<f64> = u.iter().zip(&v).map(|(u, v)| u + v).collect();
    let orders = |inputs: usize| Orders::arx(1, &vec![2; inputs], &vec![1; inputs]).unwrap();
    assert_eq!(undetermined(&y, &[&zero], &orders(1)), ["b1", "b2"]);
    assert_eq!(undetermined(&zero, &[&u], &orders(1)), ["a1"]);
    assert_eq!(undetermined(&y, &[&one], &orders(1)), ["b2"]);
    assert_eq!(undetermined(&y, &[&u, &u], &orders(2)), ["b2_1", "b2_2"]);
    assert_eq!(undetermined(&y, &[&u, &one, &zero], &orders(3)), ["b2_2", "b3_1", "b3_2"]);
    // Of three columns that add up to nothing one has to go, of each lag.
    assert_eq!(undetermined(&y, &[&u, &v, &sum], &orders(3)).len(), 2);
    // Too few rows for anything.
    assert_eq!(undetermined(&y[..5], &[&u[..5]], &orders(1)), ["a1", "b1", "b2"]);
    assert!(arx(&record(&y[..6], &[&u[..6]], &whole(6)), &orders(1), Initial::Drop).is_ok());
}

#[test]
fn units_of_any_size_scale_the_estimate_or_are_refused() {
    let mut noise = Noise(4);
    let orders = Orders::arx(1, &[1], &[1]).unwrap();
    let u = noise.take(200);
    let mut y = vec![0.0];
    (1..200).for_each(|t| y.push(0.8 * y[t - 1] + u[t - 1] + 0.1 * noise.uniform()));
    let unit = arx(&record(&y, &[&u], &whole(200)), &orders, Initial::Drop).unwrap();
    let mut refused = 0;
    let sizes = [1e-300, 1e-200, 1e-150, 1e-100, 1e-3, 1.0, 1e100, 1e150, 1e200, 1e300];
    for y_size in sizes {
        for u_size in sizes {
            let scaled = |values: &[f64], size: f64| values.iter().map(|v| v * size).collect::<Vec<_>>();
            let (y, u) = (scaled(&y, y_size), [scaled(&u, u_size)]);
            match arx(&record(&y, &u, &whole(200)), &orders, Initial::Drop) {
                Ok(found) => {
                    let b = unit.parameters()[1] * y_size / u_size;
                    assert!(close(&found.parameters()[..1], &unit.parameters()[..1], 1e-12));
                    assert!(close(&found.parameters()[1..], &[b], 1e-12), "{y_size} {u_size}");
                    assert!(close(&[found.mse()], &[unit.mse() * y_size * y_size], 1e-12));
                    let variance = unit.covariance().unwrap()[1][1] * (y_size / u_size).powi(2);
                    assert!(
                        close(&found.covariance().unwrap()[1][1..], &[variance], 1e-12),
                        "{y_size} {u_size}"
                    );
                }
                Err(error) => {
                    assert!(matches!(error, Error::Data { .. }), "{error}");
                    // Then the variance of e or of b is beyond the range of numbers.
                    let within = |size: f64| (1e-140..1e140).contains(&size);
                    assert!(!within(y_size) || !within(y_size / u_size), "{y_size} {u_size}");
                    refused += 1;
                }
            }
        }
    }
    assert!(refused > 0);
}

#[test]
fn a_target_of_another_size_than_the_regressors_gives_no_wrong_answer() {
    let mut noise = Noise(5);
    let orders = Orders::arx(0, &[1], &[0]).unwrap();
    let (u, y) = (noise.take(50), noise.take(50));
    for (y_size, u_size) in [(1e250, 1e100), (1e160, 1e120), (1e-250, 1e-100), (1e-200, 1.0), (1e200, 1.0)] {
        let y: Vec<f64> = y.iter().map(|y| y * y_size).collect();
        let u = [u.iter().map(|u| u * u_size).collect::<Vec<_>>()];
        assert!(arx(&record(&y, &u, &whole(50)), &orders, Initial::Drop).is_err(), "{y_size} {u_size}");
    }
    // An output of zeros is no problem for a model that does not look back.
    let estimate = arx(&record(&[0.0; 50], &[u], &whole(50)), &orders, Initial::Drop).unwrap();
    assert_eq!((estimate.parameters(), estimate.mse()), (&[0.0][..], 0.0));
}

#[test]
fn a_factor_of_other_orders_is_refused() {
    let mut noise = Noise(6);
    let (y, u) = (noise.take(50), [noise.take(50)]);
    let orders = |na| Orders::arx(na, &[1], &[1]).unwrap();
    let factor = arx_factor(&record(&y, &u, &whole(50)), &orders(2), Initial::Drop).unwrap();
    assert!(matches!(Estimate::from_factor(&factor, &orders(1)), Err(Error::Argument { .. })));
}
