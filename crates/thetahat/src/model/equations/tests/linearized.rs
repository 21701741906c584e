use std::f64::consts::TAU;

use thetahat_core::nalgebra::Complex;

use super::super::{Drive, GreyBox, Work};
use crate::respond::equations::response;

/// Two lags, the second output with what comes at once, and an input that acts later in two places.
fn lags(hold: &str, kind: &str) -> GreyBox {
    let derivative = "one = 'gain * (u + 0.5 * u(t - late)) - one'\ntwo = 'one - 3 * two'";
    let next =
        "one = 'one + dt * (gain * (u + 0.5 * u(t - late)) - one)'\ntwo = 'two + dt * (one - 3 * two)'";
    let equations = if kind == "next" { next } else { derivative };
    GreyBox::from_toml(&format!(
        "sample_time = 0.2
         [states]
         one = {{ start = 0, sd = 0 }}
         two = {{ start = 0, sd = 0 }}
         [inputs]
         u = {{ channel = 'u', hold = '{hold}' }}
         [parameters]
         gain = {{ start = 2, sd = 1, unknown = true }}
         late = {{ start = 0.5, sd = 1, unknown = true, min = 0 }}
         [{kind}]
         {equations}
         [outputs]
         y = 'two'
         z = 'one + 0.3 * u'
         [noise]
         measurement = {{ y = 1, z = 1 }}"
    ))
    .unwrap()
}

fn of(model: &GreyBox, frequency: f64, held: Option<f64>) -> [Complex<f64>; 2] {
    let z: Vec<f64> = model.parameters().iter().map(|unknown| unknown.start_variable().0).collect();
    let system = model.linearized(&z, held, &mut Work::new());
    [0, 1].map(|output| {
        let found = response(&system, output, 1, frequency, held)[0];
        Complex::new(found.re, found.im)
    })
}

#[test]
fn the_response_to_sines_is_the_transfer_function() {
    let model = lags("zero", "derivative");
    for frequency in [0.0, 0.3, 2.0, 40.0] {
        let s = Complex::new(0.0, frequency);
        let enters = (Complex::new(1.0, 0.0) + (s * -0.5).exp() * 0.5) * 2.0;
        let one = enters / (s + 1.0);
        let [y, z] = of(&model, frequency, None);
        assert!((y - one / (s + 3.0)).norm() < 1e-14);
        assert!((z - one - 0.3).norm() < 1e-14);
    }
}

/// What a long run of the model itself makes of samples of a sine.
fn simulated(model: &GreyBox, frequency: f64, step: f64) -> [Complex<f64>; 2] {
    const ROWS: usize = 400;
    let z: Vec<f64> = model.parameters().iter().map(|unknown| unknown.start_variable().0).collect();
    let times: Vec<f64> = (0..ROWS).map(|row| row as f64 * step).collect();
    let mut parts = [[0.0; 2]; 2];
    // The responses to cosine and sine are the real and the imaginary part of that to e^(j omega t).
    for (part, shift) in [0.0, TAU / 4.0].into_iter().enumerate() {
        let values: Vec<f64> = times.iter().map(|time| (frequency * time - shift).cos()).collect();
        let mut work = Work::new();
        let (mut x, mut next, mut jacobian) = ([0.0; 2], [0.0; 2], [0.0; 4]);
        for row in 0..ROWS - 1 {
            let drive = Drive::of_rows((&times, &values), 1, model.linear_holds(), row);
            model.advance(&x, &z, drive, times[row], step, &mut next, &mut jacobian, &mut work);
            x = next;
        }
        let last = Drive::of_rows((&times, &values), 1, model.linear_holds(), ROWS - 1);
        let mut y = [0.0; 2];
        model.observe(&x, &z, last, times[ROWS - 1], &mut y, &mut [0.0; 4], &mut work);
        (0..2).for_each(|output| parts[output][part] = y[output]);
    }
    let turned = Complex::new(0.0, -frequency * times[ROWS - 1]).exp();
    parts.map(|[re, im]| Complex::new(re, im) * turned)
}

#[test]
fn the_response_in_samples_is_what_the_model_makes_of_samples_of_a_sine() {
    for (kind, step) in [("derivative", 0.2), ("derivative", 0.35), ("next", 0.2)] {
        let model = lags("zero", kind);
        for frequency in [0.1, 1.0, 7.0] {
            let (own, run) = (of(&model, frequency, Some(step)), simulated(&model, frequency, step));
            // An output sees a delayed input at its row alone, and z has none.
            for (own, run) in own.iter().zip(run) {
                assert!((own - run).norm() < 1e-10, "{kind} {step} {frequency}: {own} {run}");
            }
        }
    }
}

#[test]
fn an_input_that_goes_in_lines_bends_the_response() {
    let text = lags("linear", "derivative").text().replace("u(t - late)", "u").replace("late =", "extra =");
    let model = GreyBox::from_toml(&text).unwrap();
    for frequency in [0.1, 1.0, 7.0] {
        let (own, run) = (of(&model, frequency, Some(0.2)), simulated(&model, frequency, 0.2));
        for (own, run) in own.iter().zip(run) {
            assert!((own - run).norm() < 1e-10, "{frequency}: {own} {run}");
        }
    }
}

#[test]
fn responses_that_equations_cannot_have_are_refused() {
    let refused = |model: &GreyBox, held: Option<f64>, words: &str| {
        let message = model.check_response(held).unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    };
    let next = lags("zero", "next");
    refused(&next, None, "write the equations as [derivative]");
    let text = next.text().replace("dt * ", "0.2 * ");
    let fixed = GreyBox::from_toml(&text).unwrap();
    refused(&fixed, Some(0.3), "its sample time is 0.2 s, that of the response 0.3 s");
    assert!(fixed.check_response(Some(0.2)).is_ok());
    refused(&lags("linear", "derivative"), Some(0.2), "'u' goes in lines and acts later");
    assert!(lags("linear", "derivative").check_response(None).is_ok());
}
