//! Controllers.

use serde_json::json;
use thetahat_core::nalgebra::Const;
use thetahat_core::{
    DirectOrders, DirectSelfTuner, Error, Fallback, Forgetting, IndirectSelfTuner, Probing, RecursiveArmax,
    ResponseWanted, RstController, Sensor, Supervision, TunerOrders, TunerSettings,
};

use super::{check, output, refuses, value};

#[test]
fn controllers() {
    let controller: RstController<f64, Const<2>> =
        RstController::new(2.0, [-1.0, 0.1].into(), [2.2, -2.0].into(), [-0.9, 0.0].into()).unwrap();
    for limited in [controller.clone(), controller.clone().with_limits(-1.0..=2.0).unwrap()] {
        check(limited, |controller, k| controller.control(value(k), output(k)));
    }
    let numbers = &[json!("NaN"), json!("inf")][..];
    refuses(
        &controller,
        &[
            ("/state/2/0", numbers),
            ("/gain", &[json!(null)]),
            ("/r", &[json!([3, 1, [0.0, 0.0, 0.0]])]),
            ("/version", &[json!(0)]),
        ],
    );
}

fn settings() -> TunerSettings<f64> {
    let response = ResponseWanted { frequency: 0.4, damping: 0.8, observer: 0.3 };
    let sensor = Sensor { range: -5.0..=f64::INFINITY, ..Sensor::default() };
    let usual = TunerSettings::new(response, f64::NEG_INFINITY..=8.0, 1.0);
    let supervision = Supervision { replace_old: true, ..usual.supervision };
    TunerSettings { sensor, probing: Probing { at_most: 20, ..usual.probing }, supervision, ..usual }
}

const FORGETTING: Forgetting<f64> = Forgetting::Exponential { factor: 0.98 };

#[test]
fn indirect_self_tuners() -> Result<(), Error> {
    const ORDERS: TunerOrders = TunerOrders { na: 2, nb: 2, nc: 0, constant: true, integrator: true };
    type Tuner = IndirectSelfTuner<f64, Const<{ ORDERS.parameters() }>, Const<{ ORDERS.size() }>>;
    let tuner = Tuner::new(&ORDERS, &settings(), 3.0, 1.0, FORGETTING)?.with_peaks(1e6, 1e6)?;
    let step = |tuner: &mut Tuner, k: usize| {
        let input = tuner.control(value(k / 8), output(k));
        tuner.applied(value(3 * k));
        (input, tuner.state())
    };
    check(tuner.clone(), step);
    let mut running = tuner;
    (0..60).for_each(|k| {
        step(&mut running, k);
    });
    assert!(running.controller().is_some());
    check(running.clone(), step);
    // No margins are good enough: it is not trusted, with any fallback.
    for fallback in [Fallback::Hold, Fallback::LastGood, Fallback::Input(0.5)] {
        let mut doubted = running.clone().with_peaks(1.0, 1.0)?;
        doubted.set_fallback(fallback)?;
        let step = |tuner: &mut Tuner, k: usize| {
            let told = (step(tuner, k), tuner.distrust(), tuner.design_age());
            // NaN is not itself.
            (told, tuner.innovation().error.to_bits())
        };
        (0..300).for_each(|k| {
            step(&mut doubted, k);
        });
        assert!(doubted.distrust().is_some());
        check(doubted, step);
    }
    refuses(
        &running,
        &[
            ("/closed/past/inputs/2/0", &[json!("NaN"), json!("inf")][..]),
            ("/closed/share", &[json!(2.0)]),
            ("/closed/signs", &[json!(0)]),
            ("/closed/supervisor/failures", &[json!(6)]),
            ("/closed/supervisor/sound", &[json!(64)]),
            ("/closed/supervisor/held", &[json!(null)]),
            ("/closed/settings/supervision/excitation", &[json!(-1.0), json!("NaN")]),
            ("/closed/settings/supervision/fallback", &[json!({"Input": "NaN"})]),
            ("/closed/settings/response/damping", &[json!(3.0)]),
            ("/closed/settings/limits", &[json!([1.0, 0.0])]),
            ("/design_every", &[json!(0)]),
            ("/peaks", &[json!([0.5, 2.0])]),
            ("/integrator", &[json!(false)]),
            ("/version", &[json!(0)]),
        ],
    );
    Ok(())
}

#[test]
fn indirect_self_tuners_with_noise() -> Result<(), Error> {
    const ORDERS: TunerOrders = TunerOrders { na: 1, nb: 2, nc: 2, constant: true, integrator: true };
    const P: usize = ORDERS.parameters();
    type Tuner = IndirectSelfTuner<f64, Const<P>, Const<{ ORDERS.size() }>, RecursiveArmax<f64, Const<P>>>;
    let mut tuner = Tuner::new(&ORDERS, &settings(), 3.0, 1.0, FORGETTING)?.with_peaks(1e6, 1e6)?;
    let step = |tuner: &mut Tuner, k: usize| {
        let input = tuner.control(value(k / 8), output(k));
        tuner.applied(value(3 * k));
        (input, tuner.state(), tuner.plant().estimator().parameters().as_slice().to_vec())
    };
    check(tuner.clone(), step);
    (0..60).for_each(|k| {
        step(&mut tuner, k);
    });
    assert!(tuner.controller().is_some());
    check(tuner.clone(), step);
    refuses(&tuner, &[("/plant/nc", &[json!(1), json!(3)][..]), ("/known_sign", &[json!(null)])]);
    Ok(())
}

#[test]
fn direct_self_tuners() -> Result<(), Error> {
    const ORDERS: DirectOrders = DirectOrders { na: 2, nb: 2, delay: 1, constant: true };
    const P: usize = ORDERS.parameters();
    type Tuner = DirectSelfTuner<f64, Const<P>, Const<{ ORDERS.size() }>, Const<{ ORDERS.delays() }>>;
    let tuner = Tuner::new(&ORDERS, &settings(), 3.0, 1.0, FORGETTING)?;
    let step = |tuner: &mut Tuner, k: usize| {
        let input = tuner.control(value(k / 8), output(k));
        tuner.applied(value(3 * k));
        (input, tuner.state(), tuner.parameters().to_vec())
    };
    check(tuner.clone(), step);
    check(tuner.clone().with_gradient(0.5)?, step);
    refuses(
        &tuner,
        &[
            ("/filtered_inputs/0", &[json!(null)][..]),
            ("/of_r", &[json!(0), json!(9)]),
            ("/closed/input", &[json!(null)]),
            ("/version", &[json!(0)]),
        ],
    );
    Ok(())
}
