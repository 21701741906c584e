use std::f64::consts::TAU;

use serde_json::json;
use thetahat_core::nalgebra::Complex;

use super::*;
use crate::model::LinearModel;

fn read(options: serde_json::Value) -> Result<Model, Error> {
    let options: KnownOptions = serde_json::from_value(options).expect("options");
    options.model()
}

fn response(model: &Model, w: f64) -> Complex<f64> {
    let linear: Vec<LinearModel<'_>> = model.linear("a response").expect("a linear model");
    let found = linear[0].frequency_response(&[w]).expect("a response");
    let point = found[0].points[0];
    Complex::from_polar(point.magnitude.value, point.phase.value)
}

fn ratio(numerator: &[f64], denominator: &[f64], x: Complex<f64>) -> Complex<f64> {
    let of = |values: &[f64]| values.iter().fold(Complex::new(0.0, 0.0), |sum, value| sum * x + *value);
    of(numerator) / of(denominator)
}

#[test]
fn polynomials_transfer_functions_and_matrices_say_the_same() -> Result<(), Error> {
    let (num, den, seconds) = ([0.36, 0.32], [1.0, -1.54, 0.58], 0.01);
    let polynomials = read(json!({"b": ["0,0.36,0.32"], "f": ["1,-1.54,0.58"], "sample_time": seconds}))?;
    let transfer = read(json!({"num": ["0.72,0.64"], "den": ["2,-3.08,1.16"], "sample_time": seconds}))?;
    let matrices = read(json!({
        "state_matrix": "1.54,-0.58;1,0", "input_matrix": "1;0", "output_matrix": "0.36,0.32", "sample_time": seconds
    }))?;
    assert_eq!(polynomials.name(), "OE(2, 2, 1)");
    assert_eq!(matrices.name(), "state space of order 2");
    for w in [0.1, 5.0, 200.0] {
        let z = Complex::from_polar(1.0, w * seconds);
        for model in [&polynomials, &transfer, &matrices] {
            assert!((response(model, w) - ratio(&num, &den, z)).norm() < 1e-9, "{} {w}", model.name());
        }
    }
    Ok(())
}

#[test]
fn continuous_models_have_their_response_and_their_delay() -> Result<(), Error> {
    let (num, den) = ([3.0, 1.0], [2.0, 0.6, 1.0]);
    let model = read(json!({"num": ["3,1"], "den": ["2,0.6,1"], "delay": [0.5]}))?;
    assert!(model.is_continuous() && model.stability() == Some(true));
    for w in [0.05, 0.7, 3.0] {
        let s = Complex::new(0.0, w);
        let expected = ratio(&num, &den, s) * Complex::from_polar(1.0, -0.5 * w);
        assert!((response(&model, w) - expected).norm() < 1e-9, "{w}: {} {expected}", response(&model, w));
    }
    // A tenth of the shortest time constant.
    assert!((model.sample_time() - 0.1 / 0.5_f64.sqrt()).abs() < 1e-9);
    Ok(())
}

#[test]
fn several_outputs_are_states_side_by_side() -> Result<(), Error> {
    let model = read(json!({
        "num": ["1", "2", "0.5,0", "1"], "den": ["1,-0.5"], "output": ["level", "heat"], "sample_time": 1
    }))?;
    let names: Vec<&str> = model.channels().collect();
    assert_eq!(names, ["u1", "u2", "level", "heat"]);
    let gains: Vec<f64> = model
        .static_gains()
        .expect("gains")
        .iter()
        .flat_map(|row| row.iter().flatten())
        .map(|gain| gain.value)
        .collect();
    assert_eq!(gains.len(), 4);
    for (gain, expected) in gains.iter().zip([2.0, 4.0, 1.0, 2.0]) {
        assert!((gain - expected).abs() < 1e-12, "{gains:?}");
    }
    Ok(())
}

#[test]
fn a_sampled_delay_is_whole_samples() -> Result<(), Error> {
    let model = read(json!({"num": ["1"], "den": ["1,-0.5"], "delay": [0.3], "sample_time": 0.1}))?;
    assert_eq!(model.name(), "OE(1, 1, 4)");
    let z = Complex::from_polar(1.0, TAU * 0.1);
    let expected = ratio(&[1.0], &[1.0, -0.5], z) * z.powi(-3);
    assert!((response(&model, TAU) - expected).norm() < 1e-9);
    Ok(())
}

#[test]
fn what_makes_no_model_is_refused() {
    for (options, words) in [
        (json!({}), "there are no numbers"),
        (json!({"b": ["1"]}), "sample-time: polynomials in q^-1"),
        (json!({"b": ["0,0"], "sample_time": 1}), "b: all of its coefficients are zero"),
        (json!({"a": "2,1", "b": ["1"], "sample_time": 1}), "a: it begins with 2"),
        (json!({"b": ["1"], "f": ["1,2", "1,3"], "sample_time": 1}), "f: there are 2 for 1 inputs"),
        (json!({"b": ["1"], "sample_time": 0}), "sample-time: it is 0 s"),
        (json!({"b": ["1"], "sample_time": 1, "noise_covariance": "-1"}), "noise-covariance: it is -1"),
        (json!({"b": ["1"], "num": ["1"], "sample_time": 1}), "num: it is for transfer functions"),
        (json!({"b": ["1"], "hold": "foh", "sample_time": 1}), "hold: it is for transfer functions"),
        (json!({"num": ["1,0,0"], "den": ["1,1"]}), "num: its degree is above"),
        (json!({"num": ["1"], "den": ["0,1"]}), "den: its first coefficient"),
        (json!({"num": ["1"]}), "den: "),
        (json!({"num": ["1"], "den": ["1,1"], "delay": [-1]}), "delay: it is -1"),
        (
            json!({"num": ["1"], "den": ["1,1"], "delay": [0.05], "sample_time": 0.1}),
            "delay: 0.05 s are not whole samples",
        ),
        (
            json!({"num": ["1", "2"], "den": ["1,1"], "output": ["a", "b"], "delay": [1, 2]}),
            "delay: an input waits as long",
        ),
        (json!({"state_matrix": "1"}), "output-matrix: missing"),
        (json!({"state_matrix": "1", "output_matrix": "1,2", "sample_time": 1}), ""),
        (json!({"b": ["1"], "sample_time": 1, "input": ["y"]}), "output: 'y' is named twice"),
        (
            json!({"b": ["1"], "sample_time": 1, "input": ["a", "b"]}),
            "input: there are 2 names for 1 channels",
        ),
        (
            json!({"state_matrix": "0.5", "output_matrix": "1;1", "sample_time": 1, "noise_covariance": "1,2;2,1"}),
            "noise-covariance: it is no covariance",
        ),
    ] {
        let message = read(options.clone()).expect_err(&options.to_string()).to_string();
        assert!(message.contains(words), "{options}: {message}");
    }
    let wrong: Result<KnownOptions, _> = serde_json::from_value(json!({"b": ["1,x"]}));
    assert!(wrong.unwrap_err().to_string().contains("write numbers with commas"));
    let wrong: Result<KnownOptions, _> = serde_json::from_value(json!({"state_matrix": "1,2;3"}));
    assert!(wrong.unwrap_err().to_string().contains("rows with semicolons"));
}

#[test]
fn a_continuous_model_of_lags_is_a_process() -> Result<(), Error> {
    // 3 e^(-2 s)/((1 + 10 s)(1 + 4 s)), and with an integrator.
    let model = read(json!({"num": ["3"], "den": ["40,14,1"], "delay": [2]}))?;
    let process = model.process("settings are")?;
    let values: Vec<(&str, f64)> =
        process.parameters.iter().map(|own| (own.name.as_str(), own.value)).collect();
    for ((name, value), (expected, known)) in
        values.iter().zip([("K", 3.0), ("tau1", 10.0), ("tau2", 4.0), ("theta", 2.0)])
    {
        assert!(*name == expected && (value - known).abs() < 1e-8, "{values:?}");
    }
    let integrating = read(json!({"num": ["0.5"], "den": ["5,1,0"]}))?;
    let process = integrating.process("settings are")?;
    assert_eq!(process.structures[0].to_string(), "p1i");
    assert!(
        (process.parameters[0].value - 0.5).abs() < 1e-9 && (process.parameters[1].value - 5.0).abs() < 1e-9
    );
    for other in [json!({"num": ["3,1"], "den": ["1,2,1"]}), json!({"num": ["1"], "den": ["1,0.1,1"]})] {
        assert!(read(other)?.process("settings are").is_err());
    }
    Ok(())
}
