use super::{FLOW, NILE, filter};
use crate::filter::{Estimator, StateFilter};
use crate::tests::near;

const TRACK: &str = "\
sample_time = 1
states = ['position', 'speed']
outputs = ['y']
F = [[1, 1], [0, 1]]
H = [[1, 0]]
Q = [[0.25, 0.5], [0.5, 1]]
R = [[1]]
P0 = [[10, 0], [0, 10]]
";

/// The filtered state and its variances after a row.
fn filtered(filter: &mut StateFilter, outputs: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let filtered = filter.step(None, &[], outputs).unwrap().filtered.unwrap();
    let variances = filtered.standard_deviations.unwrap().iter().map(|sd| sd * sd).collect();
    (filtered.values.to_vec(), variances)
}

#[test]
fn the_level_of_the_nile() {
    for estimator in [Estimator::Kalman, Estimator::Extended] {
        let mut filter = filter(NILE, estimator);
        // statsmodels' local level with known variances.
        let (level, variance) = filtered(&mut filter, &[FLOW[0]]);
        assert!(near(&[level[0], variance[0]], &[1118.311462, 15076.236391], 1e-6));
        let (level, variance) = filtered(&mut filter, &[FLOW[1]]);
        assert!(near(&[level[0], variance[0]], &[1140.108439, 7894.557531], 1e-6));
    }
}

#[test]
fn the_whole_nile() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/public/nile.csv");
    let text = std::fs::read_to_string(path).unwrap();
    let mut filter = filter(NILE, Estimator::Kalman);
    let mut last = (Vec::new(), Vec::new());
    for line in text.lines().skip(1) {
        let flow: f64 = line.split(',').nth(1).unwrap().parse().unwrap();
        last = filtered(&mut filter, &[flow]);
    }
    assert!(near(&[last.0[0], last.1[0]], &[798.370293, 4032.157942], 1e-6));
    let summary = filter.summary();
    let nis = summary.nis.unwrap();
    assert_eq!((summary.rows, summary.measured, nis.rows, nis.expected), (100, 100, 100, 1.0));
    assert!((summary.log_likelihood.unwrap() + 641.585578).abs() < 1e-6);
    // Five of a hundred are expected outside, and a mean of 1 within 3 times its standard deviation of sqrt(2/100).
    assert!(nis.below + nis.above < 0.125);
    assert!((nis.mean - 1.0).abs() < 0.43);
}

#[test]
fn the_alpha_beta_filter() {
    let mut filter = filter(TRACK, Estimator::Kalman);
    for k in 0..60 {
        filter.step(None, &[], &[2.0 * f64::from(k)]).unwrap();
    }
    // The steady solution for a unit tracking index (Bar-Shalom, Li and Kirubarajan 2001, section 6.5).
    let estimate = filter.step(None, &[], &[121.0]).unwrap();
    let (predicted, filtered) = (estimate.predicted, estimate.filtered.unwrap());
    let deviations = [3.0_f64.sqrt(), 2.0_f64.sqrt()];
    assert!(near(predicted.standard_deviations.unwrap(), &deviations, 1e-12));
    assert!(near(filtered.standard_deviations.unwrap(), &[0.75_f64.sqrt(), 1.0], 1e-12));
    assert!((estimate.outputs.standard_deviations.unwrap()[0] - 2.0).abs() < 1e-12);
    let innovation = estimate.innovations[0];
    let gains: Vec<f64> = filtered
        .values
        .iter()
        .zip(predicted.values)
        .map(|(after, before)| (after - before) / innovation)
        .collect();
    assert!(near(&gains, &[0.75, 0.5], 1e-9));
    assert!((estimate.nis.unwrap() - innovation * innovation / 4.0).abs() < 1e-12);
    let expected = -0.5 * ((2.0 * std::f64::consts::PI * 4.0).ln() + estimate.nis.unwrap());
    assert!((estimate.log_likelihood.unwrap() - expected).abs() < 1e-12);
}

#[test]
fn a_plant_of_three_states() {
    let gain = [-0.3832, 0.5919, 0.5191_f64];
    let noise: Vec<String> = gain
        .iter()
        .map(|a| format!("[{}, {}, {}]", 2.3 * a * gain[0], 2.3 * a * gain[1], 2.3 * a * gain[2]))
        .collect();
    let text = format!(
        "sample_time = 1\ninputs = ['u']\noutputs = ['y']\n\
         F = [[1.1269, -0.494, 0.1129], [1, 0, 0], [0, 1, 0]]\nG = [[-0.3832], [0.5919], [0.5191]]\n\
         H = [[1, 0, 0]]\nQ = [{}]\nR = [[1]]\nP0 = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]",
        noise.join(", ")
    );
    let mut filter = filter(&text, Estimator::Kalman);
    assert_eq!(filter.model().states(), ["x1", "x2", "x3"]);
    for k in 0..100 {
        filter.step(None, &[f64::from(k % 3)], &[0.5]).unwrap();
    }
    let estimate = filter.step(None, &[0.0], &[10.0]).unwrap();
    let after = estimate.filtered.unwrap().values.iter().zip(estimate.predicted.values);
    let gains: Vec<f64> = after.map(|(after, before)| (after - before) / estimate.innovations[0]).collect();
    assert!(near(&gains, &[0.53453754, 0.01013319, -0.47756789], 1e-8), "{gains:?}");
}

#[test]
fn bounds_are_those_of_as_many_elements_as_were_measured() {
    let text = "sample_time = 1\noutputs = ['a', 'b', 'c']\nF = [[1]]\nH = [[1], [1], [2]]\nQ = [[1]]\n\
                R = [[1, 0, 0], [0, 1, 0], [0, 0, 4]]\nP0 = [[1]]";
    let mut filter = filter(text, Estimator::Kalman);
    let nan = f64::NAN;
    let tables = [
        ([nan, 1.0, nan], 0.0010, 5.0239),
        ([1.0, nan, 2.0], 0.0506, 7.3778),
        ([1.0, 1.0, 2.0], 0.2158, 9.3484),
    ];
    for (outputs, low, high) in tables {
        let estimate = filter.step(None, &[], &outputs).unwrap();
        let bounds = estimate.nis_bounds.unwrap();
        assert!(near(&[bounds.0, bounds.1], &[low, high], 5e-5), "{bounds:?}");
        assert_eq!(estimate.measured, outputs.iter().filter(|output| !output.is_nan()).count());
    }
    let estimate = filter.step(None, &[], &[nan; 3]).unwrap();
    assert_eq!((estimate.nis, estimate.nis_bounds, estimate.log_likelihood), (None, None, Some(0.0)));
    assert_eq!(estimate.action, thetahat_core::Action::Missing);
    let summary = filter.summary();
    let nis = summary.nis.unwrap();
    assert_eq!((summary.rows, summary.measured, nis.rows, nis.expected), (4, 6, 3, 2.0));
}

#[test]
fn potters_case() {
    // P0 = I/ε², R = 1, and two measurements, h1 = [1, ε] and h2 = [1, 1], one after the other.
    let small = 0.5_f64.powi(13);
    let text = format!(
        "sample_time = 1\noutputs = ['a', 'b']\nF = [[1, 0], [0, 1]]\nH = [[1, {small}], [1, 1]]\n\
         Q = [[0, 0], [0, 0]]\nR = [[1, 0], [0, 1]]\nP0 = [[{large}, 0], [0, {large}]]",
        large = 1.0 / (small * small)
    );
    let mut filter = filter(&text, Estimator::Kalman);
    filter.step(None, &[], &[1.0, f64::NAN]).unwrap();
    let (_, variances) = filtered(&mut filter, &[f64::NAN, 1.0]);
    assert!(near(&variances, &[1.00024417, 2.00048830], 1e-8), "{variances:?}");
}
