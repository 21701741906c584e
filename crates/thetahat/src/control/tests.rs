use thetahat_core::nalgebra::Complex;

use super::*;
use crate::model::{Model, Orders, PolynomialModel};
use crate::tests::near;
use crate::{Document, Error};

/// A model of these parameters, with this covariance.
fn model(orders: &Orders, values: &[f64], variance: f64, covariance: Option<f64>) -> Result<Model, Error> {
    let rows: Option<Vec<Vec<f64>>> = covariance.map(|variance| {
        let each = 0..values.len();
        each.clone().map(|i| each.clone().map(|j| if i == j { variance } else { 0.0 }).collect()).collect()
    });
    Ok(PolynomialModel::from_parameters(orders, values, rows.as_deref(), variance, 0.5)?.into())
}

/// 1/(s (s + 1)) every 0.5 s.
fn motor(covariance: Option<f64>) -> Result<Model, Error> {
    let e = (-0.5_f64).exp();
    let values = [-1.0 - e, e, -0.5 + e, 1.0 - 1.5 * e];
    model(&Orders::arx(2, &[2], &[1])?, &values, 0.01, covariance)
}

/// Frequency 1 and damping 0.7.
fn wanted() -> Vec<Complex<f64>> {
    let pole = Complex::from_polar((-0.35_f64).exp(), 0.5 * (1.0 - 0.49_f64).sqrt());
    vec![pole, pole.conj()]
}

/// The published controllers of the motor (figures of an independent program).
#[test]
fn the_motor_has_its_controllers() -> Result<(), Error> {
    let mut plan = ControlPlan { integrator: false, ..ControlPlan::new(Design::Poles(wanted())) };
    let found = control(&motor(None)?, &plan)?;
    assert!(near(&found.controller.r, &[1.0, 0.111105], 1e-6), "{found:?}");
    assert!(near(&found.controller.s, &[1.642216, -0.747070], 1e-6));
    assert!(near(&found.controller.t, &[0.895146], 1e-6));
    assert!(found.robustness.is_none() && found.closed_loop.stable);
    let overshoot = found.closed_loop.overshoot.unwrap_or(1.0);
    assert!((0.03..0.06).contains(&overshoot), "{overshoot}");
    plan.cancel_zeros = true;
    let found = control(&motor(None)?, &plan)?;
    assert!(near(&found.controller.r, &[1.0, 0.846742], 1e-6));
    assert!(near(&found.controller.s, &[2.685158, -1.032054], 1e-6));
    assert!(near(&found.controller.t, &[1.653104], 1e-6));
    let plan = ControlPlan { integrator: false, ..ControlPlan::new(Design::Quadratic { input_weight: 0.1 }) };
    let found = control(&motor(None)?, &plan)?;
    assert!(near(&found.state_feedback.unwrap_or_default(), &[0.753177, -0.343431], 1e-6));
    Ok(())
}

/// The loop runs as the document says: the controller of the core with the model.
#[test]
fn the_responses_are_those_of_the_running_loop() -> Result<(), Error> {
    for design in [
        Design::Poles(vec![0.6.into()]),
        Design::Quadratic { input_weight: 0.3 },
        Design::MinimumVariance { input_weight: 1e-3 },
    ] {
        let found = control(&motor(Some(1e-6))?, &ControlPlan::new(design))?;
        let mut controller = Control::from_json(&found.to_json()?)?.controller()?;
        let e = (-0.5_f64).exp();
        let (mut y, mut u) = ([0.0; 2], [0.0; 2]);
        for (expected, moved) in
            found.closed_loop.setpoint_response.iter().zip(&found.closed_loop.controller_output)
        {
            let next = (1.0 + e) * y[0] - e * y[1] + (e - 0.5) * u[0] + (1.0 - 1.5 * e) * u[1];
            y = [next, y[0]];
            u = [controller.control(1.0, next), u[0]];
            assert!((next - expected).abs() < 1e-9 && (u[0] - moved).abs() < 1e-9, "{}", found.design);
        }
        assert!((found.closed_loop.static_gain - 1.0).abs() < 1e-9);
        // A load leaves no error.
        assert!(found.closed_loop.load_response.last().is_some_and(|last| last.abs() < 1e-2));
        assert!(found.robustness.as_ref().is_some_and(|share| share.stable_share == 1.0), "{found:?}");
    }
    Ok(())
}

/// sigma^2 sum f_i^2 of C = A F + q^-d G.
#[test]
fn minimum_variance_has_the_least_deviation() -> Result<(), Error> {
    let orders = Orders::new(2, &[2], 1, 0, &[0], &[2])?;
    let model = model(&orders, &[-1.5, 0.7, 1.0, 0.5, -0.4], 4.0, None)?;
    let mut plan =
        ControlPlan { integrator: false, ..ControlPlan::new(Design::MinimumVariance { input_weight: 0.0 }) };
    let found = control(&model, &plan)?;
    let first: f64 = -0.4 + 1.5;
    let expected = 2.0 * (1.0 + first * first).sqrt();
    let deviation = found.closed_loop.output_deviation.unwrap_or_default();
    assert!((deviation - expected).abs() < 1e-9, "{deviation} {expected}");
    plan.design = Design::MinimumVariance { input_weight: 1.0 };
    let dearer = control(&model, &plan)?;
    assert!(dearer.closed_loop.output_deviation > found.closed_loop.output_deviation);
    assert!(dearer.closed_loop.input_deviation < found.closed_loop.input_deviation);
    Ok(())
}

/// L = k q^-1/(1 - q^-1): the gain may grow to 2/k, and the phase margin at |L| = 1 is 90 - w/2 degrees with k = 2
/// sin(w/2).
#[test]
fn margins_are_those_of_an_integrator() -> Result<(), Error> {
    let plant = plant::Plant {
        a: vec![1.0, -1.0],
        b: vec![0.0, 1.0],
        c: vec![1.0],
        d: vec![1.0],
        noise_variance: None,
    };
    let gain = 0.5_f64;
    let vector = |value| thetahat_core::nalgebra::DVector::from_element(1, value);
    let controller = thetahat_core::RstController::new(gain, vector(0.0), vector(gain), vector(0.0))
        .map_err(|error| Error::report(error.to_string()))?;
    let found = closed_loop::closed_loop(&controller, &plant, 1.0)?;
    assert!(found.gain_margin.is_some_and(|margin| (margin - 4.0).abs() < 1e-3), "{found:?}");
    let turn = 2.0 * (gain / 2.0).asin();
    let expected = 90.0 - (turn / 2.0).to_degrees();
    assert!(found.phase_margin.is_some_and(|margin| (margin - expected).abs() < 0.05), "{found:?}");
    assert!((found.peak_sensitivity - 2.0 / (2.0 - gain)).abs() < 1e-3);
    Ok(())
}

#[test]
fn an_uncertain_model_makes_fewer_stable_loops() -> Result<(), Error> {
    let plan = ControlPlan::new(Design::Poles(vec![0.3.into()]));
    let share = |variance| -> Result<f64, Error> {
        Ok(control(&motor(Some(variance))?, &plan)?.robustness.map_or(2.0, |found| found.stable_share))
    };
    assert!(share(1e-8)? == 1.0 && share(1e-2)? < 0.9);
    let found = control(&motor(Some(1e-2))?, &plan)?;
    assert!(found.warnings.iter().any(|warning| warning.contains("unstable loop")), "{:?}", found.warnings);
    Ok(())
}

#[test]
fn what_cannot_be_designed_is_refused() -> Result<(), Error> {
    let motor = motor(None)?;
    let refused = |model: &Model, plan: ControlPlan, words: &str| {
        let error = control(model, &plan).map(|_| ()).map_err(|error| error.to_string());
        assert!(error.as_ref().is_err_and(|message| message.contains(words)), "{error:?}: {words}");
    };
    let poles =
        |poles: &[f64]| ControlPlan::new(Design::Poles(poles.iter().map(|pole| (*pole).into()).collect()));
    refused(&motor, poles(&[1.0]), "not inside");
    refused(&motor, poles(&[f64::NAN]), "not a number");
    refused(&motor, poles(&[0.1; 5]), "more than");
    refused(&motor, ControlPlan::new(Design::Poles(vec![Complex::new(0.1, 0.2)])), "conjugate");
    refused(&motor, ControlPlan { input: Some("v".into()), ..poles(&[0.5]) }, "none called 'v'");
    refused(&motor, ControlPlan { output: Some("v".into()), ..poles(&[0.5]) }, "none called 'v'");
    refused(&motor, ControlPlan { limits: 1.0..=0.0, ..poles(&[0.5]) }, "no range");
    refused(&motor, ControlPlan { draws: 0, ..poles(&[0.5]) }, "outside");
    refused(&motor, ControlPlan { observer: Some(vec![0.1.into(); 5]), ..poles(&[0.5]) }, "more than");
    let quadratic = |input_weight| ControlPlan::new(Design::Quadratic { input_weight });
    refused(&motor, quadratic(0.0), "not a positive");
    refused(&motor, ControlPlan { cancel_zeros: true, ..quadratic(1.0) }, "minimum variance cancels");
    let least = |input_weight| ControlPlan::new(Design::MinimumVariance { input_weight });
    refused(&motor, least(-1.0), "not 0 or more");
    refused(&motor, ControlPlan { observer: Some(vec![]), ..least(0.0) }, "leaves no choice");
    let at_once = model(&Orders::arx(1, &[1], &[0])?, &[-0.5, 1.0], 1.0, None)?;
    refused(&at_once, poles(&[0.5]), "acts at once");
    let inverse = model(&Orders::arx(1, &[2], &[1])?, &[-0.5, 1.0, -1.5], 1.0, None)?;
    refused(&inverse, ControlPlan { cancel_zeros: true, ..poles(&[0.5]) }, "outside of the unit circle");
    refused(&inverse, least(0.0), "others need a weight");
    let common = model(&Orders::arx(2, &[2], &[1])?, &[-1.5, 0.56, 1.0, -0.7], 1.0, None)?;
    refused(&common, poles(&[0.5]), "in common");
    let two = model(&Orders::arx(1, &[1, 1], &[1, 1])?, &[-0.5, 1.0, 1.0], 1.0, None)?;
    refused(&two, poles(&[0.5]), "the model has");
    let edited =
        control(&motor, &poles(&[0.5]))?.to_json()?.replacen("\"gain\": ", "\"gain\": 1e999, \"x\": ", 1);
    assert!(Control::from_json(&edited).is_err());
    Ok(())
}
