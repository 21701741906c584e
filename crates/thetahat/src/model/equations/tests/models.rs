use super::{CART, PENDULUM};
use crate::model::equations::{Drive, Work};
use crate::model::{GreyBox, equations::Scale};

#[test]
fn a_model_keeps_the_order_of_its_text() {
    let model = GreyBox::from_toml(PENDULUM).unwrap();
    assert_eq!(model.states(), ["angle", "rate"]);
    assert_eq!(model.outputs(), ["end", "gyro"]);
    assert_eq!(model.inputs(), ["u"]);
    assert_eq!(model.unknown().collect::<Vec<_>>(), ["stiffness", "friction", "bias", "length"]);
    let (start, variances, _) = model.started();
    assert_eq!((start, variances), (vec![0.4, -0.2], vec![0.1 * 0.1, 0.0]));
    assert_eq!(model.measurement_variances_at_start(), [0.01 * 0.01, 0.02 * 0.02]);
    // The variance of a step of half a sample.
    let mut process = [0.0; 2];
    let u = Drive::held(&[0.0]);
    model.added_variances(&[0.4, -0.2], &[0.0; 4], u, 0.0, 0.1, &mut process, &mut Work::new());
    assert_eq!(process, [0.0, 0.1 * 0.1 * 0.5]);
    let words: Vec<String> = model
        .parameters()
        .iter()
        .map(|parameter| parameter.change_of_variable().unwrap_or_default())
        .collect();
    assert_eq!(words, ["stiffness = exp(z)", "friction = 0 + 1 / (1 + exp(-z))", "", "length = 2 - exp(z)"]);
}

#[test]
fn changes_of_variable_keep_bounds_and_know_their_slopes() {
    let scales = [
        (Scale::Free, -3.0),
        (Scale::Above(0.1), 2.0),
        (Scale::Below(-1.0), -1.5),
        (Scale::Between(-2.0, 6.0), 5.5),
    ];
    for (scale, value) in scales {
        let z = scale.variable(value);
        assert!((scale.value(z) - value).abs() < 1e-14);
        let h = 1e-6;
        let difference = (scale.value(z + h) - scale.value(z - h)) / (2.0 * h);
        assert!((scale.slope(z) - difference).abs() < 1e-8, "{scale:?}");
        for far in [-800.0, -30.0, 30.0, 700.0] {
            let (value, slope) = (scale.value(far), scale.slope(far));
            assert!(value.is_finite() && slope.is_finite());
            match scale {
                Scale::Free => assert_eq!(value, far),
                Scale::Above(min) => assert!(value >= min),
                Scale::Below(max) => assert!(value <= max),
                Scale::Between(min, max) => assert!(value >= min && value <= max),
            }
        }
    }
    let model = GreyBox::from_toml(CART).unwrap();
    let (z, deviation) = model.parameters()[0].start_variable();
    // mass = 0.1 + exp(z): sd_z = 1/(2 - 0.1).
    assert!((z - 1.9_f64.ln()).abs() < 1e-15 && (deviation - 1.0 / 1.9).abs() < 1e-15);
}

#[test]
fn a_parameter_becomes_known() {
    let model = GreyBox::from_toml(CART).unwrap();
    let known = model.with_parameters(&[("mass", 3.0)]).unwrap();
    assert_eq!(known.unknown().len(), 0);
    let text = CART.replace("mass = { start = 2, sd = 1, unknown = true, min = 0.1 }", "mass = 3");
    let written = GreyBox::from_toml(&text).unwrap();
    let step = |model: &GreyBox, z: &[f64]| {
        let (mut next, mut by) = ([0.0; 2], [0.0; 4]);
        model.advance(&[1.0, 2.0], z, Drive::held(&[1.0]), 0.0, 0.1, &mut next, &mut by, &mut Work::new());
        (next, by)
    };
    assert_eq!(step(&known, &[]), step(&written, &[]));
    let (next, by) = step(&model, &[2.9_f64.ln()]);
    // The mass is rounded on its way through its logarithm.
    assert!(
        (next[1] - step(&known, &[]).0[1]).abs() < 1e-15 && (by[3] - step(&known, &[]).1[3]).abs() < 1e-15
    );

    // The others stay unknown, and those that are known stay known.
    let some = GreyBox::from_toml(PENDULUM).unwrap().with_parameters(&[("bias", 0.1)]).unwrap();
    assert_eq!(some.unknown().collect::<Vec<_>>(), ["stiffness", "friction", "length"]);
    let more = some.with_parameters(&[("length", 1.0)]).unwrap();
    assert_eq!(more.unknown().collect::<Vec<_>>(), ["stiffness", "friction"]);
    let errors = [
        model.with_parameters(&[("masss", 3.0)]).unwrap_err(),
        model.with_parameters(&[("mass", 0.1)]).unwrap_err(),
        some.with_parameters(&[("bias", 0.2)]).unwrap_err(),
    ];
    let errors = errors.map(|error| error.to_string());
    assert_eq!(errors[0], "masss: the model has no such unknown parameter; did you mean 'mass'?");
    assert_eq!(errors[1], "mass: 0.1 is outside of the parameter's bounds");
    assert!(errors[2].starts_with("bias: the model has no such unknown parameter"));
}

#[test]
fn it_is_known_which_models_are_linear() {
    let linear = |from: &str, to: &str| {
        let text = CART.replace("mass = { start = 2, sd = 1, unknown = true, min = 0.1 }", "mass = 2");
        assert!(text.contains(from), "{from}");
        GreyBox::from_toml(&text.replace(from, to)).unwrap().is_linear()
    };
    assert!(linear("position + dt", "position + dt"));
    // What varies in time or with an input is linear in the state.
    assert!(linear("damping * velocity", "damping * sin(t) * velocity * force - force^2"));
    assert!(linear("y = \"position\"", "y = \"max(force, 1) * position\""));
    assert!(!linear("damping * velocity", "damping * velocity * abs(velocity)"));
    assert!(!linear("y = \"position\"", "y = \"position^2\""));
    assert!(!GreyBox::from_toml(CART).unwrap().is_linear());
}

#[test]
fn steps_are_divided_by_the_sample_time() {
    let model = GreyBox::from_toml(CART).unwrap();
    assert_eq!(model.division(0.1).unwrap(), (1, 0.1));
    assert_eq!(model.division(0.01).unwrap(), (1, 0.01));
    assert_eq!(model.division(0.26).unwrap(), (3, 0.26 / 3.0));
    let without = CART.replace("dt", "0.1");
    let model = GreyBox::from_toml(&without).unwrap();
    assert_eq!(model.division(0.3005).unwrap(), (3, 0.1));
    let errors = [0.25, 0.05, 0.0, -0.1, f64::NAN, f64::INFINITY, 2e6].map(|dt| {
        let error = model.division(dt).unwrap_err();
        error.to_string()
    });
    assert!(
        errors[0].starts_with("a step of 0.25 s is no whole multiple of the model's sample time of 0.1 s")
    );
    assert!(errors[1].contains("no whole multiple"));
    assert!(errors[2..6].iter().all(|error| error.contains("time must rise")), "{errors:?}");
    assert!(errors[6].contains("more than 1000000 times"));
}
