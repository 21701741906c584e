extern crate std;

use std::vec::Vec;

use nalgebra::Const;

use super::Simulated;
use crate::control::polynomial::product;
use crate::noise::Noise;
use crate::{
    Error, Forgetting, IndirectSelfTuner, RecursiveArmax, ResponseWanted, RlsStart, TunerOrders,
    TunerSettings,
};

const WHITE: TunerOrders = TunerOrders { na: 2, nb: 2, nc: 0, constant: true, integrator: true };
const COLOURED: TunerOrders = TunerOrders { nc: 1, ..WHITE };
type Arx = IndirectSelfTuner<f64, Const<{ WHITE.parameters() }>, Const<{ WHITE.size() }>>;
type Plant<const P: usize> = RecursiveArmax<f64, Const<P>>;
type Armax<const P: usize, const N: usize> = IndirectSelfTuner<f64, Const<P>, Const<N>, Plant<P>>;
type Coloured = Armax<{ COLOURED.parameters() }, { COLOURED.size() }>;

const FORGETTING: Forgetting<f64> = Forgetting::Exponential { factor: 0.998 };
const RESPONSE: ResponseWanted<f64> = ResponseWanted { frequency: 0.6, damping: 0.8, observer: 0.3 };
/// A, B, the constant, C.
const TRUTH: [f64; 6] = [-1.5, 0.7, 0.1, 0.05, 0.0, -0.9];

fn wanted() -> TunerSettings<f64> {
    TunerSettings::new(RESPONSE, -10.0..=10.0, 1.0)
}

/// Set points that change for 3000 samples, then 3000 with 0; returns the variances of outputs and inputs in the
/// latter.
fn run(seed: u64, mut control: impl FnMut(f64, f64) -> f64) -> [f64; 2] {
    let (mut noise, mut before, mut variances) = (Noise(seed), 0.0, [0.0; 2]);
    let mut plant = Simulated::new([1.0, TRUTH[0], TRUTH[1]], &TRUTH[2..4]);
    for k in 0..6000 {
        let e = 0.05 * noise.normal();
        let y = plant.output(e + TRUTH[5] * before);
        before = e;
        let changing = if k / 50 % 2 == 0 { 1.0 } else { -1.0 };
        let u = control(if k < 3000 { changing } else { 0.0 }, y);
        plant.input(u);
        if k >= 3100 {
            variances = [variances[0] + y * y / 2900.0, variances[1] + u * u / 2900.0];
        }
    }
    variances
}

/// Noise (1 - 0.9 q⁻¹) e: a model without C has bias, a model with it has none, and less comes of the noise.
#[test]
fn noise_that_is_not_white_takes_a_model_with_c() -> Result<(), Error> {
    for seed in 1..6 {
        let mut arx = Arx::new(&WHITE, &wanted(), 1.0, 1.0, FORGETTING)?;
        let mut armax = Coloured::new(&COLOURED, &wanted(), 1.0, 1.0, FORGETTING)?;
        let of_arx = run(seed, |set_point, y| arx.control(set_point, y));
        let of_armax = run(seed, |set_point, y| armax.control(set_point, y));
        assert!(of_armax[0] < 0.85 * of_arx[0] && of_armax[1] < 0.5 * of_arx[1], "{of_arx:?} {of_armax:?}");
        let (biased, unbiased) = (arx.plant().estimator(), armax.plant().estimator());
        let errors = biased.standard_errors().ok_or(Error::Overflow)?;
        assert!((biased.parameters()[2] - TRUTH[2]).abs() > 5.0 * errors[2]);
        let errors = unbiased.standard_errors().ok_or(Error::Overflow)?;
        for ((found, truth), error) in unbiased.parameters().iter().zip(TRUTH).zip(errors.iter()) {
            assert!((found - truth).abs() < 3.0 * error, "{seed}: {found} {truth} {error}");
        }
    }
    Ok(())
}

/// The C of the model is in A_o = C (1 - p q⁻¹), and the poles are those that were wanted: with more coefficients of R
/// where a small model leaves it too few, as A = 1 + a q⁻¹, B = b q⁻¹, for A_m A_o of degree 4.
#[test]
fn the_observer_is_that_of_the_noise() -> Result<(), Error> {
    const SMALL: TunerOrders = TunerOrders { na: 1, nb: 1, nc: 1, constant: true, integrator: true };
    assert_eq!((SMALL.size(), TunerOrders { nc: 0, ..SMALL }.size()), (4, 2));
    let mut tuner =
        Armax::<{ SMALL.parameters() }, { SMALL.size() }>::new(&SMALL, &wanted(), 1.0, 1.0, FORGETTING)?;
    let (mut noise, mut before, mut plant) = (Noise(3), 0.0, Simulated::new([1.0, -0.9, 0.0], &[0.2]));
    for k in 0..2000 {
        let e = 0.02 * noise.normal();
        let y = plant.output(e - 0.7 * before);
        before = e;
        plant.input(tuner.control(if k / 50 % 2 == 0 { 1.0 } else { -1.0 }, y));
    }
    let controller = tuner.controller().ok_or(Error::Overflow)?;
    let model = tuner.plant();
    let (a, b, c) = (
        model.a().collect::<Vec<_>>(),
        model.b(0).into_iter().flatten().collect::<Vec<_>>(),
        model.c().collect::<Vec<_>>(),
    );
    assert!((c[1] + 0.7).abs() < 0.1, "{c:?}");
    let observer = [&[1.0][..], controller.observer().as_slice()].concat();
    let r = [&[1.0][..], controller.r().as_slice()].concat();
    for power in 0..=4 {
        let wanted_observer = product(&c, &RESPONSE.observer(), power);
        assert_eq!(observer[power], wanted_observer);
        let closed = product(&a, &r, power) + product(&b, controller.s().as_slice(), power);
        assert!((closed - product(&RESPONSE.response(), &observer, power)).abs() < 1e-12, "{power} {closed}");
    }
    Ok(())
}

/// A model without noise parameters is an ARX model, to the bit, whatever its type.
#[test]
fn without_c_both_models_are_the_same() -> Result<(), Error> {
    type Same = Armax<{ WHITE.parameters() }, { WHITE.size() }>;
    for start in [RlsStart::Standard, RlsStart::Exact, RlsStart::Mixed { blend: 3 }] {
        let mut arx = Arx::new(&WHITE, &wanted(), 1.0, 1.0, FORGETTING)?.with_start(start)?;
        let mut armax = Same::new(&WHITE, &wanted(), 1.0, 1.0, FORGETTING)?.with_start(start)?;
        let mut count = 0;
        run(7, |set_point, y| {
            count += 1;
            let y = if count % 97 == 5 { f64::NAN } else { y };
            let (first, second) = (arx.control(set_point, y), armax.control(set_point, y));
            assert_eq!(
                (first, arx.plant().estimator().parameters()),
                (second, armax.plant().estimator().parameters())
            );
            first
        });
    }
    Ok(())
}

#[test]
fn orders_that_do_not_fit_the_model_are_refused() -> Result<(), Error> {
    let range = "0 with a RecursiveArx";
    let found = Arx::new(&COLOURED, &wanted(), 1.0, 1.0, FORGETTING).map(|_| ());
    assert_eq!(found, Err(Error::OutOfRange { argument: "nc", range }));
    let found = Coloured::new(&WHITE, &wanted(), 1.0, 1.0, FORGETTING).map(|_| ());
    assert_eq!(found, Err(Error::Orders { needed: 5, available: 6 }));
    let many = TunerOrders { nc: 3, ..COLOURED };
    assert_eq!(
        Coloured::new(&many, &wanted(), 1.0, 1.0, FORGETTING).map(|_| ()),
        Err(Error::Orders { needed: 6, available: 4 })
    );
    let usual = || Coloured::new(&COLOURED, &wanted(), 1.0, 1.0, FORGETTING);
    let other = TunerOrders { na: 1, nb: 3, ..COLOURED };
    let plant = Coloured::new(&other, &wanted(), 1.0, 1.0, FORGETTING)?.plant().clone();
    let found = usual()?.with_plant(plant).map(|_| ());
    assert!(matches!(found, Err(Error::OutOfRange { argument: "plant", .. })), "{found:?}");
    assert!(usual()?.with_plant(usual()?.plant().clone()).is_ok());
    let found = usual()?.with_start(RlsStart::Exact).map(|_| ());
    assert!(matches!(found, Err(Error::OutOfRange { argument: "start", .. })), "{found:?}");
    assert!(usual()?.with_start(RlsStart::Standard).is_ok());
    Ok(())
}
