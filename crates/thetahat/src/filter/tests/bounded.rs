//! Noise that is known by its bound alone.

use thetahat_core::Action;
use thetahat_numerics::noise::Noise;

use super::{FLOW, NILE, filter};
use crate::filter::{Estimator, StateFilter, StateModel};

const CART: &str = "\
sample_time = 1
states = ['position', 'velocity']
inputs = ['u']
outputs = ['y', 'z']
F = [[1, 1], [0, 0.9]]
G = [[0], [1]]
H = [[1, 0], [0, 1]]
process_bound = [0, 0.02]
measurement_bound = [0.5, 1]
initial_bound = [5, 2]
";

#[test]
fn the_state_is_within_its_bounds_in_every_row() {
    let mut filter = filter(CART, Estimator::Bounded { deviations: None });
    let (mut noise, mut state) = (Noise(6), [4.0, -1.5]);
    for k in 0..2000 {
        let u = if k % 40 < 20 { 0.3 } else { -0.3 };
        let (y, z) = (state[0] + 0.5 * noise.uniform(), state[1] + noise.uniform());
        let row = filter.step(None, &[u], &[if k % 5 == 0 { f64::NAN } else { y }, z]).unwrap();
        assert_eq!((row.contradiction, row.action), (None, Action::Updated));
        for (values, before) in [(row.predicted, true), (row.filtered.unwrap(), false)] {
            assert!(values.standard_deviations.is_none());
            for (index, state) in state.iter().enumerate() {
                let reach = values.bounds.unwrap()[index];
                assert!((state - values.values[index]).abs() <= reach, "{k} {before}");
            }
        }
        assert!((y - row.outputs.values[0]).abs() <= row.outputs.bounds.unwrap()[0]);
        assert!(row.nis.is_none() && row.log_likelihood.is_none());
        state = [state[0] + state[1], 0.9 * state[1] + u + 0.02 * noise.uniform()];
    }
    let summary = filter.summary();
    assert_eq!((summary.estimator.as_str(), summary.contradictions), ("bounded", Some(0)));
    assert!(summary.log_likelihood.is_none() && summary.nis.is_none());
    assert!(summary.states[0].bound.unwrap() < 0.5 && summary.states[0].standard_deviation.is_none());
    assert!(filter.clone().smooth().unwrap_err().to_string().contains("does not smooth"));
}

#[test]
fn a_row_that_no_state_explains_is_told_and_not_used() {
    let fresh = || filter(CART, Estimator::Bounded { deviations: None });
    let (mut with, mut without) = (fresh(), fresh());
    for k in 0..50 {
        let (y, z) = if k == 30 { (0.1, 9.0) } else { (0.1, -0.1) };
        let row = with.step(None, &[0.0], &[y, z]).unwrap();
        assert_eq!(row.contradiction, (k == 30).then_some(1));
        assert_eq!(row.action == Action::Gated, k == 30);
        without.step(None, &[0.0], &if k == 30 { [f64::NAN; 2] } else { [y, z] }).unwrap();
    }
    assert_eq!(with.latest().unwrap().filtered, without.latest().unwrap().filtered);
    assert_eq!(with.summary().contradictions, Some(1));
}

#[test]
fn deviations_of_gaussian_noises_are_bounds() {
    // With one state all is exact: intervals that widen by 3 sqrt(Q) and meet those of 3 sqrt(R).
    let mut filter = filter(NILE, Estimator::Bounded { deviations: Some(3.0) });
    let (process, measurement) = (3.0 * 1469.1_f64.sqrt(), 3.0 * 15_099.0_f64.sqrt());
    let (mut low, mut high) = (-3.0 * 1e7_f64.sqrt() + process, 3.0 * 1e7_f64.sqrt() - process);
    for flow in FLOW {
        (low, high) = (low - process, high + process);
        (low, high) = (low.max(flow - measurement), high.min(flow + measurement));
        let level = filter.step(None, &[], &[flow]).unwrap().filtered.unwrap();
        let (value, bound) = (level.values[0], level.bounds.unwrap()[0]);
        assert!((value - bound - low).abs() < 1e-9 * high && (value + bound - high).abs() < 1e-9 * high);
    }
}

#[test]
fn a_snapshot_goes_on_to_the_bit() {
    let fresh = || filter(CART, Estimator::Bounded { deviations: None });
    let (mut kept, mut noise) = (fresh(), Noise(4));
    let mut row = || [0.2 * noise.uniform(), 0.2 * noise.uniform()];
    for _ in 0..15 {
        kept.step(None, &[0.0], &row()).unwrap();
    }
    let text = serde_json::to_string(&kept.snapshot()).unwrap();
    let mut again = fresh().resumed(serde_json::from_str(&text).unwrap()).unwrap();
    for _ in 0..15 {
        let y = row();
        assert_eq!(again.step(None, &[0.0], &y).unwrap(), kept.step(None, &[0.0], &y).unwrap());
    }
}

#[test]
fn the_same_file_is_a_model_of_uniform_noise() {
    let given = format!(
        "{CART}Q = [[0, 0], [0, {}]]\nR = [[{}, 0], [0, {}]]\nP0 = [[{}, 0], [0, {}]]\n",
        0.02 * 0.02 / 3.0,
        0.5 * 0.5 / 3.0,
        1.0 / 3.0,
        25.0 / 3.0,
        4.0 / 3.0
    );
    let mut filters = [filter(CART, Estimator::Kalman), filter(&given, Estimator::Kalman)];
    for k in 0..20 {
        let all = filters.each_mut().map(|filter| {
            let row = filter.step(None, &[0.1], &[f64::from(k), 1.0]).unwrap().filtered.unwrap();
            (row.values.to_vec(), row.standard_deviations.unwrap().to_vec())
        });
        assert_eq!(all[0], all[1]);
    }
}

#[test]
fn refusals_say_what_to_do() {
    let refused = |text: &str, deviations| {
        let model = StateModel::from_toml(text).unwrap();
        StateFilter::new(model, Estimator::Bounded { deviations }).unwrap_err().to_string()
    };
    let bent = "sample_time = 1\n[states]\nx = { sd = 1 }\n[next]\nx = 'sin(x)'\n[outputs]\ny = 'x'\n[noise]\nmeasurement.y = 1";
    assert!(refused(bent, None).contains("bounded noise is for linear models"));
    assert!(refused(NILE, None).contains("write process_bound, measurement_bound and initial_bound"));
    assert!(refused(NILE, Some(0.0)).contains("deviations: 0 is no number above 0"));
    assert!(refused(CART, Some(3.0)).contains("the model says its bounds itself"));
    let correlated = format!("{CART}S = [[0, 0], [0.0001, 0]]");
    assert!(refused(&correlated, None).contains("leave S out"), "{}", refused(&correlated, None));
    for (from, to, message) in [
        ("process_bound = [0, 0.02]\n", "", "'process_bound' is missing"),
        ("[0, 0.02]", "[0.02]", "'process_bound' has 1 numbers, but there are 2 states"),
        ("[0.5, 1]", "[0.5, -1]", "'measurement_bound' has -1: no magnitude is negative"),
        ("[5, 2]", "[5, nan]", "'initial_bound' must be a finite number"),
    ] {
        let error = StateModel::from_toml(&CART.replace(from, to)).unwrap_err().to_string();
        assert!(error.contains(message), "{error}");
    }
}
