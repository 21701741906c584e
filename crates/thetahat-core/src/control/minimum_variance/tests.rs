extern crate std;
use std::vec;
use std::vec::Vec;

use nalgebra::Const;

use super::{MinimumVariance, MinimumVarianceOrders};
use crate::control::tests::{Plant, monic, near, plus, times};
use crate::noise::Noise;
use crate::{Error, RstController};

const LEAST: MinimumVariance<f64> = MinimumVariance { input_weight: 0.0, integrator: false };

/// A plant with a stable inverse after so many samples of delay, and its noise.
fn delayed(delay: usize) -> ([f64; 3], Vec<f64>, [f64; 3]) {
    let mut b = vec![0.0; delay];
    b.extend([1.0, 0.5]);
    ([1.0, -1.5, 0.7], b, [1.0, -0.6, 0.2])
}

/// F of C = A F + q⁻ᵈ G.
fn first_coefficients(a: &[f64], c: &[f64], delay: usize) -> Vec<f64> {
    let at = |values: &[f64], place: usize| values.get(place).copied().unwrap_or(0.0);
    let mut f = vec![];
    for power in 0..delay {
        let known: f64 = f.iter().enumerate().map(|(place, f)| f * at(a, power - place)).sum();
        f.push(at(c, power) - known);
    }
    f
}

/// A R + B S = B' (C (or its like with an integrator and a weight)).
#[test]
fn the_poles_of_the_loop_are_those_of_the_noise_and_of_what_is_weighted() -> Result<(), Error> {
    for delay in 1..=4 {
        let (a, b, c) = delayed(delay);
        for wanted in [
            LEAST,
            MinimumVariance { input_weight: 0.4, ..LEAST },
            MinimumVariance { input_weight: 0.4, integrator: true },
            MinimumVariance { integrator: true, ..LEAST },
        ] {
            let found: RstController<f64, Const<6>> = RstController::minimum_variance(&a, &b, &c, &wanted)?;
            let (r, s) = (monic(found.r()), found.s().as_slice().to_vec());
            let closed = plus(&times(&a, &r), &times(&b, &s));
            let difference: &[f64] = if wanted.integrator { &[1.0, -1.0] } else { &[1.0] };
            let drifting = times(&a, difference);
            let inner: Vec<f64> =
                plus(&b[delay..], &drifting.iter().map(|a| a * wanted.input_weight).collect::<Vec<_>>());
            let poles: Vec<f64> = times(&inner, &c).iter().map(|value| value / inner[0]).collect();
            assert!(near(&closed, &poles, 1e-12), "{delay} {wanted:?} {closed:?} {poles:?}");
            assert!(near(&monic(found.observer()), &c, 1e-15));
            if wanted.integrator {
                assert!(r.iter().sum::<f64>().abs() < 1e-12);
            }
        }
    }
    Ok(())
}

/// σ² Σ f_i², over 10⁵ samples.
#[test]
fn the_output_has_the_least_variance() -> Result<(), Error> {
    for delay in 1..=4 {
        let (a, b, c) = delayed(delay);
        let mut controller: RstController<f64, Const<5>> =
            RstController::minimum_variance(&a, &b, &c, &LEAST)?;
        let (mut noise, mut e) = (Noise(delay as u64), [0.0; 3]);
        let (mut y, mut u) = ([0.0; 3], [0.0; 7]);
        let samples = 100_000;
        let mut squares = 0.0;
        for _ in 0..samples {
            e = [noise.next(), e[0], e[1]];
            let driven: f64 = b.iter().skip(1).zip(u).map(|(b, u)| b * u).sum();
            let disturbed: f64 = c.iter().zip(e).map(|(c, e)| c * e).sum();
            let next = -a[1] * y[0] - a[2] * y[1] + driven + disturbed;
            y = [next, y[0], y[1]];
            squares += next * next;
            u.rotate_right(1);
            u[0] = controller.control(0.0, next);
        }
        let variance = squares / f64::from(samples);
        // Noise between -1 and 1 has the variance 1/3.
        let expected = first_coefficients(&a, &c, delay).iter().map(|f| f * f).sum::<f64>() / 3.0;
        assert!((variance / expected - 1.0).abs() < 0.03, "{delay}: {variance} {expected}");
    }
    Ok(())
}

/// The least weights with which the loop of 1 - 1.5 q⁻¹ + 0.7 q⁻² is stable (figures of an independent program).
#[test]
fn a_plant_without_a_stable_inverse_needs_a_weight() {
    let a = [1.0, -1.5, 0.7];
    for (zero, least) in [(1.5, 0.3), (2.0, 0.5), (-1.2, 2.0)] {
        let b = [0.0, 1.0, zero];
        let stable = |input_weight| {
            let wanted = MinimumVariance { input_weight, integrator: false };
            RstController::<f64, Const<2>>::minimum_variance(&a, &b, &[1.0], &wanted).is_ok()
        };
        assert!(!stable(0.0) && !stable(0.5 * least), "{zero}");
        assert!(stable(least) && stable(1.5 * least), "{zero}");
    }
}

#[test]
fn a_drift_and_a_load_leave_no_error_with_an_integrator() -> Result<(), Error> {
    let (a, b, c) = delayed(2);
    let wanted = MinimumVariance { input_weight: 0.2, integrator: true };
    let mut controller: RstController<f64, Const<3>> = RstController::minimum_variance(&a, &b, &c, &wanted)?;
    let mut plant = Plant { a: &a, b: &b, outputs: vec![], inputs: vec![] };
    for _ in 0..200 {
        let y = plant.output(0.6);
        plant.inputs.push(controller.control(3.0, y));
    }
    assert!((plant.outputs[199] - 3.0).abs() < 1e-9, "{}", plant.outputs[199]);
    Ok(())
}

#[test]
fn what_has_no_such_controller_is_refused() {
    let (a, b, c) = ([1.0, -0.5], [0.0, 1.0, 0.2], [1.0, 0.3]);
    let found = |a: &[f64], b: &[f64], c: &[f64], wanted: &MinimumVariance<f64>| {
        RstController::<f64, Const<1>>::minimum_variance(a, b, c, wanted).map(|_| ())
    };
    assert_eq!(MinimumVarianceOrders { na: 1, nb: 2, nc: 1, integrator: false }.size(), 1);
    assert_eq!(found(&a, &b, &c, &LEAST), Ok(()));
    let refused =
        |result, name| matches!(result, Err(Error::OutOfRange { argument, .. }) if argument == name);
    assert!(refused(found(&[0.5], &b, &c, &LEAST), "a"));
    assert!(refused(found(&[], &b, &c, &LEAST), "a"));
    assert!(refused(found(&a, &[1.0, 2.0], &c, &LEAST), "b"));
    assert!(refused(found(&a, &[0.0, 0.0], &c, &LEAST), "b"));
    assert!(refused(found(&a, &[], &c, &LEAST), "b"));
    assert!(refused(found(&a, &b, &[1.0, -1.0], &LEAST), "c"));
    assert!(refused(found(&a, &[0.0, 1.0, 2.0], &c, &LEAST), "input_weight"));
    assert_eq!(
        found(&a, &b, &c, &MinimumVariance { input_weight: -1.0, ..LEAST }),
        Err(Error::Negative { argument: "input_weight" })
    );
    assert_eq!(
        found(&a, &b, &c, &MinimumVariance { integrator: true, ..LEAST }),
        Err(Error::Orders { needed: 2, available: 1 })
    );
    assert_eq!(found(&a, &[0.0, f64::NAN], &c, &LEAST), Err(Error::NotFinite { argument: "b" }));
    assert!(found(&a, &[0.0, 1e-320], &c, &LEAST).is_err());
}
