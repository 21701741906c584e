use thetahat_core::nalgebra::{DMatrix, DVector};
use thetahat_numerics::noise::Noise;

use super::*;
use crate::estimate::{Method, estimate};
use crate::tests::assert_refused;

/// Two inputs, y(t) = sum 0.7^i u1(t-i) - 0.5 u2(t-1) + e(t).
fn record(rows: usize, spread: f64) -> [Vec<f64>; 3] {
    let mut noise = Noise(7);
    let (u, v, e) = (noise.take(rows), noise.take(rows), noise.take(rows));
    let mut x = 0.0;
    let y = (0..rows).map(|t| {
        x = 0.7 * x + u[t];
        x - if t > 0 { 0.5 * v[t - 1] } else { 0.0 } + spread * e[t]
    });
    [y.collect(), u, v]
}

/// The sums of a regression on taps of both inputs.
fn sums(taps: [usize; 2]) -> (Mat<f64>, Vec<f64>, f64, usize) {
    let [y, u, v] = record(200, 0.3);
    let orders = Orders::arx(0, &taps, &[0, 0]).unwrap();
    let signals: Vec<&[f64]> = vec![&y, &u, &v];
    let segments: Vec<_> = std::iter::once(0..200).collect();
    let lagged = Lagged::new(
        &signals,
        super::taps(&orders),
        &segments,
        thetahat_numerics::regression::Presample::Drop,
    );
    let (found, cross, energy) = gram(&lagged);
    let size = cross.len();
    (Mat::from_fn(size, size, |i, j| found[(i, j)]), cross.as_slice().to_vec(), energy, lagged.rows())
}

/// The likelihood is that of its definition, N ln(rss/N) + ln det(I + P G) with dense matrices.
#[test]
fn the_likelihood_is_that_of_the_prior() {
    let taps = [12, 5];
    let (found, cross, energy, samples) = sums(taps);
    let size = cross.len();
    let whole = DMatrix::from_fn(size, size, |i, j| found[(i, j)]);
    let d = DVector::from_column_slice(&cross);
    for kernel in [Kernel::Dc, Kernel::Tc] {
        let mut evidence = Evidence::new(found.clone(), &cross, energy, samples, &taps, kernel);
        let x = match kernel {
            Kernel::Dc => vec![0.3, 1.2, 0.8, -1.0, 0.4, -0.3],
            Kernel::Tc => vec![0.3, 1.2, -1.0, 0.4],
        };
        let kernels = evidence.kernels(&x);
        let block = |i: usize| usize::from(i >= taps[0]);
        let prior = DMatrix::from_fn(size, size, |i, j| {
            let KernelParameters { scale, decay, correlation } = kernels[block(i)];
            let first = block(i) * taps[0];
            let (i, k) = (i.wrapping_sub(first), j.wrapping_sub(first));
            let same = j >= first && k < taps[block(i + first)];
            if !same {
                return 0.0;
            }
            scale * decay.powf((i + k) as f64 / 2.0) * correlation.powi(i.abs_diff(k) as i32)
        });
        let identity = DMatrix::<f64>::identity(size, size);
        let g = (&identity + &prior * &whole).lu().solve(&(&prior * &d)).unwrap();
        let rss = energy - d.dot(&g);
        let n = samples as f64;
        let expected = n * (rss / n).ln() + (&identity + &prior * &whole).lu().determinant().ln();
        let value = evidence.value(&x, None).unwrap();
        assert!((value - expected).abs() < 1e-8 * expected.abs(), "{kernel:?}: {value} {expected}");
        for (found, expected) in evidence.response().iter().zip(g.iter()) {
            assert!((found - expected).abs() < 1e-10, "{found} {expected}");
        }
        let inverse = evidence.inverse();
        let posterior = (&identity + &prior * &whole).lu().solve(&prior).unwrap();
        for i in 0..size {
            for j in 0..size {
                assert!((inverse[(i, j)] - posterior[(i, j)]).abs() < 1e-10 * posterior[(i, i)].max(1e-3));
            }
        }
    }
}

#[test]
fn slopes_are_differences_of_values() {
    for (kernel, x) in [
        (Kernel::Dc, vec![0.3, 1.2, 0.8, -1.0, 0.4, -0.3]),
        (Kernel::Tc, vec![0.3, 1.2, -1.0, 0.4]),
        (Kernel::Dc, vec![-2.0, 3.0, 2.0, 1.0, -0.5, 0.0]),
    ] {
        // A single tap has no decay and no correlation.
        for taps in [[12, 5], [9, 1]] {
            let (gram, cross, energy, samples) = sums(taps);
            let mut evidence = Evidence::new(gram, &cross, energy, samples, &taps, kernel);
            let mut slopes = vec![0.0; x.len()];
            evidence.value(&x, Some(&mut slopes)).unwrap();
            for place in 0..x.len() {
                let mut at = |step: f64| {
                    let mut x = x.clone();
                    x[place] += step;
                    evidence.value(&x, None).unwrap()
                };
                let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
                assert!(
                    (difference - slopes[place]).abs() < 1e-5 * slopes[place].abs().max(1.0),
                    "{kernel:?} {taps:?} {place}: {difference} {slopes:?}"
                );
            }
        }
    }
}

/// Far fewer parameters are free than there are taps, and the response is nearer to the truth than that of least
/// squares.
#[test]
fn a_prior_takes_noise_off_the_response() {
    let [y, u, v] = record(150, 1.0);
    let record = Record::new(&y, vec![&u, &v]).unwrap();
    let orders = Orders::arx(0, &[40, 20], &[0, 0]).unwrap();
    let truth = |place: usize| match place {
        0..=39 => 0.7_f64.powi(place as i32),
        // b1 of the second input; the others of its taps are 0.
        place => {
            if place == 41 {
                -0.5
            } else {
                0.0
            }
        }
    };
    let error = |method: &Method| {
        let found = estimate(&record, &orders, method, Initial::Auto).unwrap();
        let each = found.parameters().iter().enumerate().map(|(place, g)| (g - truth(place)).powi(2));
        (each.sum::<f64>().sqrt(), found)
    };
    let (plain, _) = error(&Method::default());
    for kernel in [Kernel::Dc, Kernel::Tc] {
        let (own, found) = error(&Method::Regularised(kernel));
        assert!(own < 0.6 * plain, "{kernel:?}: {own} {plain}");
        let Procedure::Regularised(outcome) = found.procedure() else { panic!("other procedure") };
        assert!(outcome.effective_parameters < 30.0 && outcome.inputs.len() == 2, "{outcome:?}");
        assert!(found.noise_variance() > 0.2 && found.noise_variance() < 0.5, "{}", found.noise_variance());
        assert_eq!(found.degrees_of_freedom(), Some((111.0 - outcome.effective_parameters).round() as usize));
    }
}

#[test]
fn what_cannot_be_estimated_is_refused() {
    let [y, u, _] = record(60, 0.1);
    let zero = vec![0.0; 60];
    let refused = |u: &[f64], orders: &Orders, words: &str| {
        let record = Record::new(&y, vec![u]).unwrap();
        assert_refused(estimate(&record, orders, &Method::Regularised(Kernel::Dc), Initial::Auto), words);
    };
    refused(&u, &Orders::arx(1, &[5], &[0]).unwrap(), "leave A out");
    refused(&u, &Orders::oe(&[5], &[1], &[0]).unwrap(), "not linear in its parameters");
    refused(&u, &Orders::arx(0, &[40], &[0]).unwrap(), "too few rows");
    refused(&zero, &Orders::arx(0, &[5], &[0]).unwrap(), "input 1 is zero");
}
