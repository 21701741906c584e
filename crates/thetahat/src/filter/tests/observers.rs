use thetahat_core::nalgebra::{Complex, DMatrix, DVector, Dyn};
use thetahat_core::{Action, Covariance, LinearObservation, LinearTransition, LuenbergerObserver};

use super::filter;
use crate::filter::{Estimator, ObserverGain, StateFilter, StateModel};
use crate::model::GreyBox;
use crate::model::equations::{Drive, Work};
use crate::tests::assert_refused;

const CART: &str = "\
sample_time = 1
inputs = ['u']
outputs = ['y']
F = [[1, 0.1], [0, 1]]
G = [[0.005], [0.1]]
H = [[1, 0]]
Q = [[0, 0], [0, 0]]
R = [[0]]
P0 = [[0, 0], [0, 0]]
";

fn poles(poles: &[(f64, f64)]) -> Estimator {
    let poles = poles.iter().map(|(re, im)| Complex::new(*re, *im)).collect();
    Estimator::Luenberger(ObserverGain::Poles(poles))
}

#[test]
fn it_steps_as_the_observer_of_the_core_does() {
    let pair = [(0.4, 0.3), (0.4, -0.3)];
    // The characteristic polynomial of F - L H is z² - 0.8 z + 0.25.
    let gain = Estimator::Luenberger(ObserverGain::Matrix(vec![vec![1.2], vec![4.5]]));
    let mut filters = [filter(CART, poles(&pair)), filter(CART, gain)];
    let zero = Covariance::zero(Dyn(2));
    let transition: LinearTransition<f64, Dyn, Dyn> =
        LinearTransition::new(DMatrix::from_row_slice(2, 2, &[1.0, 0.1, 0.0, 1.0]), zero)
            .and_then(|transition| transition.with_input(DMatrix::from_row_slice(2, 1, &[0.005, 0.1])))
            .unwrap();
    let observation: LinearObservation<f64, Dyn, Dyn, Dyn> =
        LinearObservation::new(DMatrix::from_row_slice(1, 2, &[1.0, 0.0]), Covariance::zero(Dyn(1)))
            .and_then(|observation| observation.with_input(DMatrix::zeros(1, 1)))
            .unwrap();
    let mut reference =
        LuenbergerObserver::new(DVector::zeros(2), DMatrix::from_row_slice(2, 1, &[1.2, 4.5])).unwrap();
    let (mut position, mut speed) = (1.0, 2.0);
    for k in 0..60 {
        let force = f64::from(k % 5) - 2.0;
        let output = if k % 11 == 5 { f64::NAN } else { position };
        for filter in &mut filters {
            let estimate = filter.step(None, &[force], &[output]).unwrap();
            for (found, expected) in estimate.predicted.values.iter().zip(reference.state()) {
                assert!((found - expected).abs() < 1e-11);
            }
            assert_eq!(estimate.filtered, None);
            assert_eq!(estimate.predicted.standard_deviations, None);
            assert_eq!((estimate.nis, estimate.nis_bounds, estimate.log_likelihood), (None, None, None));
            assert_eq!(estimate.action, if output.is_nan() { Action::Missing } else { Action::Updated });
            assert_eq!(estimate.measured, usize::from(!output.is_nan()));
        }
        let drive = DVector::repeat(1, force);
        reference.update(&transition, &observation, &drive, &DVector::repeat(1, output)).unwrap();
        position += 0.1 * speed + 0.005 * force;
        speed += 0.1 * force;
    }
    let last = filters[0].step(None, &[0.0], &[position]).unwrap();
    assert!((last.predicted.values[1] - speed).abs() < 1e-6);
    let summary = filters[0].summary();
    assert_eq!((summary.rows, summary.nis, summary.log_likelihood), (61, None, None));
    assert_eq!(summary.estimator, "luenberger");
}

const PENDULUM: &str = "\
sample_time = 0.02
[states]
angle = { start = 0.5, sd = 1 }
rate = { start = 0.3, sd = 1 }
[derivative]
angle = 'rate'
rate = '-9.81 * sin(angle)'
[outputs]
end = 'sin(angle)'
[noise]
measurement.end = 0.01
";

#[test]
fn poles_are_placed_again_where_a_model_bends() {
    let mut filter = filter(PENDULUM, poles(&[(0.8, 0.1), (0.8, -0.1)]));
    let model = GreyBox::from_toml(PENDULUM).unwrap();
    let mut truth = [1.2_f64, 0.0];
    let mut errors = Vec::new();
    for k in 0..200 {
        let output = if k % 13 == 5 { f64::NAN } else { truth[0].sin() };
        let estimate = filter.step(None, &[], &[output]).unwrap();
        errors.push((estimate.predicted.values[0] - truth[0]).hypot(estimate.predicted.values[1] - truth[1]));
        let (mut next, mut jacobian) = ([0.0; 2], [0.0; 4]);
        model.advance(&truth, &[], Drive::held(&[]), 0.0, 0.02, &mut next, &mut jacobian, &mut Work::new());
        truth = next;
    }
    assert!(errors[0] > 0.5 && errors[199] < 1e-9, "{} {}", errors[0], errors[199]);
    // Near the truth the error shrinks as the poles say, |0.8 + 0.1i| = 0.806 a step, with leave for the missing rows.
    assert!(errors[100] < 1e-3 * errors[50], "{} {}", errors[50], errors[100]);
}

#[test]
fn what_does_not_fit_an_observer_is_refused() {
    let refused = |text: &str, estimator: Estimator| {
        StateFilter::new(StateModel::from_toml(text).unwrap(), estimator).unwrap_err().to_string()
    };
    let matrix = |rows: Vec<Vec<f64>>| Estimator::Luenberger(ObserverGain::Matrix(rows));
    assert_eq!(
        refused(CART, poles(&[(0.5, 0.0)])),
        "poles: there are 1, but the model has 2 states: give one for each"
    );
    for text in [CART, PENDULUM] {
        assert!(refused(text, poles(&[(1.5, 0.0), (0.2, 0.0)])).contains("inside the unit circle"));
        assert!(refused(text, poles(&[(f64::NAN, 0.0), (0.2, 0.0)])).starts_with("poles: "));
        assert!(refused(text, poles(&[(0.5, 0.1), (0.2, 0.0)])).contains("conjugate"));
    }
    assert!(refused(CART, matrix(vec![vec![1.0]])).starts_with("gain: it must have 2 rows"));
    assert!(refused(CART, matrix(vec![vec![1.0], vec![f64::NAN]])).starts_with("gain: "));
    let blind = CART.replace("H = [[1, 0]]", "H = [[0, 1]]");
    assert!(refused(&blind, poles(&[(0.5, 0.0), (0.2, 0.0)])).contains("only 1 of the 2 states"));
    let unknown = crate::model::equations::tests::CART;
    assert!(
        refused(unknown, poles(&[(0.5, 0.0), (0.2, 0.0)]))
            .contains("an observer estimates no parameters (mass)")
    );
    let smoothed = filter(CART, poles(&[(0.5, 0.0), (0.2, 0.0)])).recording().smooth();
    assert_refused(smoothed, "an observer knows no noises");
}
