use super::NILE;
use crate::Error;
use crate::filter::{Estimator, StateFilter, StateModel};
use crate::model::equations::tests::CART;

const TWO: &str = "\
sample_time = 0.5
states = ['a', 'b']
inputs = ['u']
outputs = ['y', 'z']
F = [[1, 0], [0, 1]]
G = [[1], [0]]
H = [[1, 0], [0, 1]]
D = [[0], [1]]
Q = [[1, 0], [0, 1]]
R = [[1, 0.5], [0.5, 1]]
S = [[0.1, 0], [0, 0]]
x0 = [1, 2]
P0 = [[1, 0], [0, 1]]
";

#[test]
fn matrices_that_do_not_fit_are_named_with_their_place() {
    assert!(StateModel::from_toml(TWO).is_ok());
    let error = StateModel::from_toml(&TWO.replace("sample_time = 0.5", "sample_time = -1")).unwrap_err();
    assert!(matches!(error, Error::Model { line: 1, column: 15, .. }), "{error:?}");
    let cases = [
        (
            "sample_time = 0.5",
            "sample_time = -1",
            "line 1, column 15: 'sample_time' is -1: it must be above 0",
        ),
        ("states = ['a', 'b']", "states = ['a']", "line 2, column 1: there are 1 names, but F has 2 rows"),
        ("states = ['a', 'b']", "states = ['a', 'a']", "line 2, column 10: 'a' is there twice"),
        (
            "states = ['a', 'b']",
            "states = ['a', 2]",
            "line 2, column 16: 'states' must be a text in quotes, but here is a number",
        ),
        ("outputs = ['y', 'z']", "outputs = []", "line 4, column 11: 'outputs' is empty"),
        (
            "outputs = ['y', 'z']",
            "outputs = ['y', 'u']",
            "line 4, column 11: the channel 'u' is an input too",
        ),
        ("outputs = ['y', 'z']\n", "", "line 1, column 1: 'outputs' is missing"),
        (
            "F = [[1, 0], [0, 1]]",
            "F = [[1, 0], [0]]",
            "line 5, column 14: row 2 of 'F' has 1 numbers, the first row 2",
        ),
        (
            "F = [[1, 0], [0, 1]]",
            "F = [[1], [0]]",
            "line 5, column 1: 'F' is 2 x 1, but must be 2 x 2 (states x states)",
        ),
        ("F = [[1, 0], [0, 1]]", "F = []", "line 5, column 5: 'F' is empty"),
        ("F = [[1, 0], [0, 1]]", "F = [[1, 0], [0, nan]]", "line 5, column 18: 'F' must be a finite number"),
        (
            "F = [[1, 0], [0, 1]]",
            "F = [1, 0]",
            "line 5, column 6: 'F' must be an array in [ ], but here is a number",
        ),
        ("G = [[1], [0]]\n", "", "line 1, column 1: 'G' is missing"),
        (
            "G = [[1], [0]]",
            "G = [[1, 0]]",
            "line 6, column 1: 'G' is 1 x 2, but must be 2 x 1 (states x inputs)",
        ),
        (
            "H = [[1, 0], [0, 1]]",
            "H = [[1, 0]]",
            "line 7, column 1: 'H' is 1 x 2, but must be 2 x 2 (outputs x states)",
        ),
        (
            "D = [[0], [1]]",
            "D = [[0]]",
            "line 8, column 1: 'D' is 1 x 1, but must be 2 x 1 (outputs x inputs)",
        ),
        (
            "Q = [[1, 0], [0, 1]]",
            "Q = [[1, 2], [2, 1]]",
            "line 9, column 5: 'Q' is no covariance: the variance of element",
        ),
        (
            "Q = [[1, 0], [0, 1]]",
            "Q = [[1, 2], [0, 1]]",
            "line 9, column 5: 'Q' is not symmetric: entry (1, 2) must be equal to (2, 1)",
        ),
        (
            "S = [[0.1, 0], [0, 0]]",
            "S = [[1.1, 0], [0, 0]]",
            "line 11, column 1: no noises have these Q, R and S: ",
        ),
        (
            "R = [[1, 0.5], [0.5, 1]]",
            "R = [[1, 1], [1, 1]]",
            "line 11, column 1: no noises have these Q, R and S: R, which must be regular",
        ),
        ("S = [[0.1, 0], [0, 0]]", "T = [[0.1, 0], [0, 0]]", "line 11, column 1: the model has no key 'T'"),
        ("x0 = [1, 2]", "x0 = [1]", "line 12, column 1: 'x0' has 1 numbers, but there are 2 states"),
        ("P0 = [[1, 0], [0, 1]]", "P0 = [[-1, 0], [0, 1]]", "line 13, column 6: 'P0' is no covariance"),
    ];
    let wrong: Vec<String> = cases
        .into_iter()
        .map(|(from, to, expected)| {
            assert!(TWO.contains(from), "{from}");
            (to, expected, StateModel::from_toml(&TWO.replacen(from, to, 1)).expect_err(to).to_string())
        })
        .filter(|(_, expected, found)| !found.starts_with(expected))
        .map(|(to, expected, found)| format!("{to}:\n  found    {found}\n  expected {expected}"))
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn what_is_not_linear_needs_the_extended_filter() {
    let refused = |text: &str| {
        StateFilter::new(StateModel::from_toml(text).unwrap(), Estimator::Kalman).unwrap_err().to_string()
    };
    assert_eq!(
        refused(CART),
        "estimator: the model has unknown parameters (mass): use the extended Kalman filter (ekf) or the unscented one (ukf)"
    );
    let bent = "sample_time = 1\n[states]\nx = { sd = 1 }\n[next]\nx = 'sin(x)'\n[outputs]\ny = 'x'\n[noise]\nmeasurement.y = 1";
    assert_eq!(
        refused(bent),
        "estimator: the model is not linear in its state: use the extended Kalman filter (ekf) or the unscented one (ukf)"
    );
}

#[test]
fn steps_of_a_model_in_matrices_are_whole_multiples() {
    let mut filter = super::filter(NILE, Estimator::Kalman);
    filter.step(Some(0.3), &[], &[1.0]).unwrap();
    for (step, expected) in
        [(1.5, "no whole multiple"), (0.5, "no whole multiple"), (1.1e6, "more than 1000000 times")]
    {
        let error = filter.step(Some(step), &[], &[1.0]).unwrap_err();
        assert!(error.to_string().contains(expected), "{error}");
        assert!(matches!(error, Error::Data { row: Some(2), .. }));
    }
    let estimate = filter.step(Some(2.0), &[], &[f64::NAN]).unwrap();
    // P = 15076.2… + 2 Q.
    let before = 1e7 * 15099.0 / (1e7 + 15099.0);
    assert!(
        (estimate.predicted.standard_deviations.unwrap()[0].powi(2) - before - 2.0 * 1469.1).abs() < 1e-6
    );
}
