use crate::model::{EquationsModel, GreyBox};

const TEXT: &str = "sample_time = 1
[states]
x = { start = 0, sd = 1 }
[inputs]
u = 'u'
[parameters]
r = { start = 2, sd = 1, unknown = true, min = 0, unit = 'K/W' }
c = { start = 3, sd = 1, unknown = true, min = 0, max = 10 }
known = 5
[derivative]
x = '(u - x / r) / c'
[outputs]
y = 'x'
[noise]
measurement = { y = 0.1 }
[figures]
time_constant = { value = 'r * c', unit = 's' }
_half = 'time_constant / 2'
rate = 'known / _half'
none = 'sqrt(1 - r)'
";

#[test]
fn figures_have_errors_by_the_delta_method() {
    let model = GreyBox::from_toml(TEXT).unwrap();
    let covariance = vec![vec![0.04, 0.01], vec![0.01, 0.09]];
    let fitted = EquationsModel::new(&model, &[2.0, 3.0], covariance, &[0.01]);
    let [time_constant, rate, none] = fitted.figures.as_slice() else { panic!("{:?}", fitted.figures) };
    assert_eq!((time_constant.name.as_str(), time_constant.unit.as_deref()), ("time_constant", Some("s")));
    assert!((time_constant.value.unwrap() - 6.0).abs() < 1e-12);
    // g = (c, r): g' P g = 9 0.04 + 2 6 0.01 + 4 0.09.
    let variance: f64 = 0.36 + 0.12 + 0.36;
    assert!((time_constant.standard_error.unwrap() - variance.sqrt()).abs() < 1e-12);
    // 10/(r c) changes by 10/36 where r c changes by one.
    assert!((rate.value.unwrap() - 10.0 / 6.0).abs() < 1e-12);
    assert!((rate.standard_error.unwrap() - 10.0 / 36.0 * variance.sqrt()).abs() < 1e-12);
    assert_eq!((none.value, none.standard_error), (None, None));
}

#[test]
fn what_is_wrong_with_a_figure_is_said() {
    for (from, to, said) in [
        ("'r * c', unit", "'r * x', unit", "'x'"),
        ("'known / _half'", "'known / later'", "'later'"),
        ("rate =", "r =", "'r' is a parameter or a figure above"),
        ("unit = 's' }", "units = 's' }", "has no key 'units'"),
        ("{ value = 'r * c', unit = 's' }", "{ unit = 's' }", "'figures.time_constant.value' is missing"),
        ("'known / _half'", "''", "is empty"),
        ("'known / _half'", "true", "must be a number"),
        ("unit = 'K/W'", "unit = 3", "must be a text in quotes"),
    ] {
        let error = GreyBox::from_toml(&TEXT.replace(from, to)).unwrap_err().to_string();
        assert!(error.contains(said), "{to}: {error}");
    }
}
