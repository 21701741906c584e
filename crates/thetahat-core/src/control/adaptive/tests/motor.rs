use nalgebra::Const;

use super::Simulated;
use crate::control::tests::motor;
use crate::noise::Noise;
use crate::{
    DirectOrders, DirectSelfTuner, Error, Forgetting, IndirectSelfTuner, Probing, ResponseWanted, RlsStart,
    RstController, TunerOrders, TunerSettings,
};

/// Without and with the zero cancelled (figures of an independent program): r_1, s_0, s_1, t_0.
const PLACED: [f64; 4] = [0.111105, 1.642216, -0.747070, 0.895146];
const CANCELLED: [f64; 4] = [0.846742, 2.685158, -1.032054, 1.653104];
const ORDERS: TunerOrders = TunerOrders { na: 2, nb: 2, nc: 0, constant: false, integrator: false };
const DIRECT: DirectOrders = DirectOrders { na: 2, nb: 2, delay: 1, constant: false };

type Indirect = IndirectSelfTuner<f64, Const<{ ORDERS.parameters() }>, Const<{ ORDERS.size() }>>;
type Direct = DirectSelfTuner<
    f64,
    Const<{ DIRECT.parameters() }>,
    Const<{ DIRECT.size() }>,
    Const<{ DIRECT.delays() }>,
>;

fn plant() -> Simulated {
    let (a, b) = motor();
    Simulated::new(a, &b[1..])
}

/// Frequency 1 and damping 0.7 with 0.5 s a sample; a probing input of the size of the set point.
fn wanted() -> TunerSettings<f64> {
    let response = ResponseWanted { frequency: 0.5, damping: 0.7, observer: 0.0 };
    let probing = Probing { amplitude: 1.0, ..Probing::of_scale(1.0) };
    TunerSettings { probing, ..TunerSettings::new(response, -100.0..=100.0, 1.0) }
}

fn indirect(start: RlsStart) -> Result<Indirect, Error> {
    let forgetting = Forgetting::Exponential { factor: 0.98 };
    // The poles that are wanted, whatever their margins.
    Indirect::new(&ORDERS, &wanted(), 1.0, 1.0, forgetting)?.with_start(start)?.with_peaks(100.0, 100.0)
}

fn direct(start: RlsStart) -> Result<Direct, Error> {
    Direct::new(&DIRECT, &wanted(), 1.0, 1.0, Forgetting::Exponential { factor: 0.98 })?.with_start(start)
}

fn set_point(k: usize) -> f64 {
    if (k / 20).is_multiple_of(2) { 1.0 } else { -1.0 }
}

fn coefficients<N: crate::Dimension>(controller: &RstController<f64, N>) -> [f64; 4] {
    let (r, s) = (controller.r().as_slice(), controller.s().as_slice());
    [r[0], s[0], s[1], controller.gain()]
}

fn distance(found: [f64; 4], expected: [f64; 4]) -> f64 {
    found.iter().zip(expected).fold(0.0, |largest, (found, expected)| largest.max((found - expected).abs()))
}

/// The published controllers, 10⁻⁶ after 20 samples.
#[test]
fn without_noise_the_motor_gets_its_controller_within_twenty_samples() -> Result<(), Error> {
    for start in [RlsStart::Exact, RlsStart::Mixed { blend: 1 }] {
        for (tuner, expected) in
            [(indirect(start)?, PLACED), (indirect(start)?.with_cancelled_zeros(), CANCELLED)]
        {
            let (mut tuner, mut plant) = (tuner, plant());
            for k in 0..200 {
                let y = plant.output(0.0);
                plant.input(tuner.control(set_point(k), y));
                if k >= 20 {
                    let found = tuner.controller().map(coefficients).unwrap_or_default();
                    assert!(distance(found, expected) < 1e-6, "{start:?} {k} {found:?}");
                }
            }
        }
        let (mut tuner, mut plant) = (direct(start)?, plant());
        for k in 0..200 {
            let y = plant.output(0.0);
            plant.input(tuner.control(set_point(k), y));
            if k >= 20 {
                let found = tuner.controller().map(coefficients).unwrap_or_default();
                assert!(distance(found, CANCELLED) < 1e-6, "{start:?} {k} {found:?}");
            }
        }
    }
    Ok(())
}

/// Noise in the equation, a hundredth of the set point: 40 runs, without forgetting.
#[test]
fn under_noise_the_model_is_within_three_standard_errors() -> Result<(), Error> {
    let (a, b) = motor();
    let truth = [a[1], a[2], b[1], b[2]];
    let mut outside = 0;
    for seed in 0..40 {
        let mut noise = Noise(seed);
        let mut tuner = Indirect::new(&ORDERS, &wanted(), 1.0, 1.0, Forgetting::None)?
            .with_start(RlsStart::Exact)?
            .with_peaks(100.0, 100.0)?;
        let mut plant = plant();
        for k in 0..200 {
            let y = plant.output(0.01 * noise.normal());
            plant.input(tuner.control(set_point(k), y));
        }
        let estimator = tuner.plant().estimator();
        let errors = estimator.standard_errors().ok_or(Error::Overflow)?;
        let each = estimator.parameters().iter().zip(truth).zip(errors.iter());
        outside += each.filter(|((found, truth), error)| (*found - truth).abs() > 3.0 * **error).count();
    }
    // Of 160 parameters 0.4 are outside by chance.
    assert!(outside <= 2, "{outside}");
    Ok(())
}

/// The gradient of model-reference adaptation gets there too, later.
#[test]
fn the_gradient_follows_the_model_in_the_end() -> Result<(), Error> {
    let (mut tuner, mut plant) = (direct(RlsStart::Standard)?.with_gradient(0.5)?, plant());
    let mut late = 0.0_f64;
    for k in 0..20_000 {
        let y = plant.output(0.0);
        plant.input(tuner.control(set_point(k), y));
        if k >= 19_000 && k % 20 > 15 {
            late = late.max((y - set_point(k)).abs());
        }
    }
    assert!(late < 0.02, "{late}");
    Ok(())
}

/// A model from elsewhere gives the first controller at once.
#[test]
fn a_known_plant_is_controlled_from_the_first_sample() -> Result<(), Error> {
    let (a, b) = motor();
    let model =
        indirect(RlsStart::Standard)?.plant().clone().with_parameters([a[1], a[2], b[1], b[2]].into())?;
    let (mut tuner, mut plant) = (indirect(RlsStart::Standard)?.with_plant(model)?, plant());
    let y = plant.output(0.0);
    let first = tuner.control(1.0, y);
    assert!((first - PLACED[3]).abs() < 1e-5, "{first}");
    Ok(())
}

/// α = 0.5 of an amplitude of 0.2 around what the controller wants.
#[test]
fn it_probes_on_request() -> Result<(), Error> {
    let (mut tuner, mut plant) = (indirect(RlsStart::Exact)?, plant());
    let mut step = |tuner: &mut Indirect| {
        let y = plant.output(0.0);
        let u = tuner.control(0.0, y);
        plant.input(u);
        u
    };
    for _ in 0..300 {
        step(&mut tuner);
    }
    assert!(step(&mut tuner).abs() < 1e-9);
    tuner.probe(0.05, 10)?;
    // The largest amplitude is 2.
    assert!((step(&mut tuner).abs() - 0.1).abs() < 1e-9);
    for _ in 0..300 {
        step(&mut tuner);
    }
    assert!(step(&mut tuner).abs() < 1e-6);
    Ok(())
}
