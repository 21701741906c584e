use std::ops::ControlFlow;

use thetahat_core::nalgebra::Complex;
use thetahat_numerics::noise::Noise;

use super::*;
use crate::respond::Correlation;

/// Points of a function of s = j omega or, of held inputs, of z.
fn points(
    frequencies: &[f64],
    held: Option<f64>,
    deviation: f64,
    noise: &mut Noise,
    of: impl Fn(Complex<f64>) -> Complex<f64>,
) -> ResponsePoints {
    let at = |frequency: f64| match held {
        Some(time) => Complex::new(0.0, frequency * time).exp(),
        None => Complex::new(0.0, frequency),
    };
    let values = frequencies.iter().map(|frequency| {
        let exact = of(at(*frequency));
        [exact.re + deviation * noise.normal(), exact.im + deviation * noise.normal()]
    });
    ResponsePoints {
        values: values.collect(),
        frequencies: frequencies.to_vec(),
        weights: vec![1.0 / deviation.max(1e-9); frequencies.len()],
        known: true,
        sample_time: held.unwrap_or(0.01),
        held: held.is_some(),
        correlation: Correlation::None,
    }
}

fn decades(low: f64, high: f64, count: usize) -> Vec<f64> {
    let step = (high / low).ln() / (count - 1) as f64;
    (0..count).map(|place| low * (step * place as f64).exp()).collect()
}

fn fitted(points: &[ResponsePoints], order: usize, feedthrough: Option<bool>) -> Result<SharedPoles, Error> {
    shared_poles(points, &(order..=order), feedthrough, &Search::default(), &|_| ControlFlow::Continue(()))
}

fn response(matrices: &StateSpace, input: usize, at: Complex<f64>) -> Complex<f64> {
    let order = matrices.f.nrows();
    let complex = |matrix: &DMatrix<f64>| matrix.map(|value| Complex::new(value, 0.0));
    let apart = DMatrix::identity(order, order) * at - complex(&matrices.f);
    let states = apart.lu().solve(&complex(&matrices.g)).unwrap();
    (complex(&matrices.h) * states)[(0, input)] + matrices.d[(0, input)]
}

#[test]
fn exact_points_of_many_poles_come_back_in_continuous_time_and_in_samples() -> Result<(), Error> {
    let mut noise = Noise(1);
    // Three resonances and two real poles, seven decades apart.
    let of = |s: Complex<f64>| {
        let pair = |size: f64, damping: f64| s * s + s * (2.0 * damping * size) + size * size;
        (s + 3.0) * 40.0 / pair(20.0, 0.02)
            + Complex::new(1e5, 0.0) / pair(300.0, 0.3)
            + s * 2e3 / pair(5e3, 0.01)
            + Complex::new(0.02, 0.0) / (s + 0.01)
            + Complex::new(3e5, 0.0) / (s + 1e5)
            + 0.7
    };
    let frequencies = decades(1e-3, 1e5, 400);
    let found = fitted(&[points(&frequencies, None, 0.0, &mut noise, of)], 8, Some(true))?;
    for frequency in decades(2e-3, 5e4, 33) {
        let at = Complex::new(0.0, frequency);
        let error = (response(&found.matrices, 0, at) - of(at)).norm() / of(at).norm();
        assert!(error < 1e-7, "{frequency}: {error}");
    }

    // Of two inputs with shared poles, none of which acts at once.
    let below = |z: Complex<f64>| (z * z - z * 1.6 + 0.89) * (z - 0.999) * (z + 0.4) * z;
    let one = |z: Complex<f64>| (z * z * z * z * 0.2 - z * z * 0.1 + 0.05) / below(z);
    let two = |z: Complex<f64>| (z * z * z * -0.3 + z * 0.31) / below(z);
    let frequencies: Vec<f64> = (1..200).map(|place| f64::from(place) * 0.15).collect();
    let held = Some(0.1);
    let both =
        [points(&frequencies, held, 0.0, &mut noise, one), points(&frequencies, held, 0.0, &mut noise, two)];
    let found = fitted(&both, 5, Some(false))?;
    assert_eq!(found.matrices.d.norm(), 0.0);
    for frequency in [0.2, 1.0, 5.0, 20.0, 30.0] {
        let z = Complex::new(0.0, frequency * 0.1).exp();
        for (input, exact) in [one(z), two(z)].into_iter().enumerate() {
            let error = (response(&found.matrices, input, z) - exact).norm() / exact.norm();
            assert!(error < 1e-6, "{frequency} {input}: {error}");
        }
    }
    Ok(())
}

#[test]
fn slopes_are_differences_and_intervals_hold() -> Result<(), Error> {
    let of = |s: Complex<f64>| {
        (s * 2.0 + 3.0) / (s * s + s * 0.4 + 25.0) + Complex::new(1.0, 0.0) / (s + 0.7) + 0.2
    };
    let frequencies = decades(0.05, 80.0, 60);
    let mut noise = Noise(5);
    // The squared distance of the parameters from the truth is chi squared.
    let (mut sum, mut runs) = (0.0, 0);
    let truth = |section: [f64; 2], alone: f64| [section[0].ln(), section[1].ln(), alone.ln()];
    let exact: Vec<f64> = truth([0.4, 25.0], 0.7).into_iter().chain([2.0, 3.0, 1.0, 0.2]).collect();
    for _ in 0..40 {
        let own = [points(&frequencies, None, 0.01, &mut noise, of)];
        let mut objective = PolesObjective::new(&own, 3, true)?;
        let search = Search::default();
        let deadline = Deadline::after(None);
        let found =
            searched(&mut objective, None, &search, deadline, &|_| ControlFlow::Continue(()))?.unwrap();
        objective.settle(&found.parameters)?;
        let all: Vec<f64> = found.parameters.iter().chain(&objective.numerators()[0]).copied().collect();
        let covariance = objective.covariance().unwrap();
        let apart = DMatrix::from_iterator(7, 1, all.iter().zip(&exact).map(|(found, exact)| found - exact));
        sum += (apart.transpose() * covariance.try_inverse().unwrap() * &apart)[(0, 0)];
        runs += 1;
        if runs > 1 {
            continue;
        }
        // The entries of the matrices against differences of them.
        let (matrices, slopes) = objective.matrices();
        let entries = objective.entries();
        for place in 0..3 {
            let moved = |by: f64| {
                let mut other = objective.clone();
                let kept = objective.numerators().to_vec();
                let mut point = found.parameters.clone();
                point[place] += by;
                other.settle(&point).unwrap();
                other.with_numerators(kept).matrices().0
            };
            let (plus, minus) = (moved(1e-5), moved(-1e-5));
            for (row, entry) in entries.iter().enumerate() {
                let of = |model: &StateSpace| match entry.matrix {
                    crate::model::StateSpaceMatrix::F => model.f[(entry.row, entry.column)],
                    crate::model::StateSpaceMatrix::G => model.g[(entry.row, entry.column)],
                    _ => model.d[(entry.row, entry.column)],
                };
                // The size of the second state moves with its poles, and is held in the slopes.
                if entry.row == 1 {
                    continue;
                }
                let difference = (of(&plus) - of(&minus)) / 2e-5;
                assert!(
                    (difference - slopes[(row, place)]).abs() < 1e-6 * (1.0 + difference.abs()),
                    "{entry:?} {place}: {difference} {}",
                    slopes[(row, place)]
                );
            }
        }
        assert_eq!(matrices.f.nrows(), 3);
    }
    let mean = sum / f64::from(runs);
    // Of 40 runs of chi squared of 7 degrees: 7 +- 0.6.
    assert!((5.2..8.8).contains(&mean), "{mean}");
    Ok(())
}

#[test]
fn the_least_mdl_finds_the_order_and_whether_inputs_act_at_once() -> Result<(), Error> {
    let of = |s: Complex<f64>| (s * 2.0 + 3.0) / (s * s + s * 0.4 + 25.0);
    let mut noise = Noise(9);
    let own = [points(&decades(0.05, 80.0, 100), None, 0.01, &mut noise, of)];
    let found = shared_poles(&own, &(1..=6), None, &Search::default(), &|_| ControlFlow::Continue(()))?;
    assert_eq!(found.matrices.f.nrows(), 2);
    assert!(!found.outcome.feedthrough && found.outcome.orders.len() == 6);
    let few = [points(&[1.0, 2.0], None, 0.01, &mut noise, of)];
    assert!(matches!(fitted(&few, 3, None), Err(Error::Undetermined { .. })));
    let broken = shared_poles(&own, &(2..=2), None, &Search::default(), &|_| ControlFlow::Break(()));
    assert!(matches!(broken, Err(Error::Interrupted)));
    Ok(())
}
