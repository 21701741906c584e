use thetahat_core::nalgebra::{DMatrix, DVector, Dyn};
use thetahat_core::{
    Augmented, Covariance, ExtendedKalmanFilter, KalmanFilter, LinearObservation, LinearTransition,
    ParametricObservation, ParametricTransition,
};
use thetahat_numerics::noise::Noise;

use super::filter;
use crate::filter::{Estimator, StateEstimate, StateFilter, StateModel};
use crate::model::equations::{Drive, Work};
use crate::model::{
    GreyBox,
    equations::tests::{CART, PENDULUM},
};

/// The cart with a known mass of 2, in equations and in matrices.
fn known_cart() -> (String, String) {
    let equations = CART.replace("mass = { start = 2, sd = 1, unknown = true, min = 0.1 }", "mass = 2");
    let matrices = format!(
        "sample_time = 0.1\nstates = ['position', 'velocity']\ninputs = ['u']\noutputs = ['y']\n\
         F = [[1, 0.1], [0, {}]]\nG = [[0], [{}]]\nH = [[1, 0]]\nQ = [[0, 0], [0, {}]]\nR = [[{}]]\n\
         x0 = [0, 0.5]\nP0 = [[1, 0], [0, 4]]",
        1.0 - 0.1 * 0.4 / 2.0,
        0.1 / 2.0,
        0.01 * 0.01,
        0.05 * 0.05
    );
    (equations, matrices)
}

/// A log of the cart with this mass: force and position.
fn cart_log(mass: f64, rows: usize, seed: u64) -> Vec<(f64, f64)> {
    let mut noise = Noise(seed);
    let (mut position, mut velocity) = (0.3, -0.2);
    let row = |k: usize| {
        let force = if k % 60 < 30 { 2.0 } else { -2.0 };
        let measured = (force, position + 0.05 * noise.normal());
        let faster = velocity + 0.1 * (force - 0.4 * velocity) / mass + 0.01 * noise.normal();
        position += 0.1 * velocity;
        velocity = faster;
        measured
    };
    (0..rows).map(row).collect()
}

fn state(estimate: &StateEstimate<'_>) -> Vec<f64> {
    let filtered = estimate.filtered.unwrap();
    filtered.values.iter().chain(filtered.standard_deviations.unwrap()).copied().collect()
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn equations_and_matrices_are_the_same_model() {
    let (equations, matrices) = known_cart();
    let mut filters = [
        filter(&equations, Estimator::Kalman),
        filter(&equations, Estimator::Extended),
        filter(&matrices, Estimator::Kalman),
        filter(&matrices, Estimator::Extended),
    ];
    for (force, position) in cart_log(2.0, 100, 1) {
        let all = filters.each_mut().map(|filter| state(&filter.step(None, &[force], &[position]).unwrap()));
        assert_eq!((&all[0], &all[2]), (&all[1], &all[3]));
        // The same sums in another order.
        assert!(largest_difference(&all[0], &all[2]) < 1e-12);
    }
    let totals = filters.each_ref().map(|filter| filter.summary().log_likelihood.unwrap());
    assert!((totals[0] - totals[2]).abs() < 1e-9);
    assert_eq!(filters[0].model().unknown().len(), 0);
    // The estimator is the one that was asked for.
    assert_eq!(filters.map(|filter| filter.summary().estimator), ["kalman", "ekf", "kalman", "ekf"]);
}

#[test]
fn an_unknown_mass_is_found_with_the_state() {
    for (seed, mass) in [(2, 3.5), (3, 1.2), (4, 5.0)] {
        let mut filter = filter(CART, Estimator::Extended);
        let mut last = (0.0, 0.0);
        for (force, position) in cart_log(mass, 400, seed) {
            let estimate = filter.step(None, &[force], &[position]).unwrap();
            last = (estimate.parameters.values[0], estimate.parameters.standard_deviations.unwrap()[0]);
            assert!(last.0 > 0.1);
        }
        assert!((last.0 - mass).abs() < 3.0 * last.1, "{mass}: {last:?}");
        assert!(last.1 < 0.1 * mass, "{mass}: {last:?}");
        // A right model: chi-square of 400 degrees of freedom, within 4 standard deviations.
        assert!((filter.summary().nis.unwrap().mean - 1.0).abs() < 4.0 * (2.0_f64 / 400.0).sqrt());
    }
}

type Vector = DVector<f64>;
type Matrix = DMatrix<f64>;

/// A model in equations as the core wants a model with unknown parameters: a step of a sample time at the time 0.
struct Parametric<'m>(&'m GreyBox);

impl Parametric<'_> {
    fn step(&self, x: &Vector, z: &Vector, u: &Vector) -> (Vector, Matrix) {
        let (n, dt) = (x.len(), self.0.sample_time());
        let (mut next, mut by) = (Vector::zeros(n), Matrix::zeros(n, n + z.len()));
        let (values, jacobian) = (next.as_mut_slice(), by.as_mut_slice());
        self.0.advance(
            x.as_slice(),
            z.as_slice(),
            Drive::held(u.as_slice()),
            0.0,
            dt,
            values,
            jacobian,
            &mut Work::new(),
        );
        (next, by)
    }

    fn seen(&self, x: &Vector, z: &Vector, u: &Vector) -> (Vector, Matrix) {
        let m = self.0.outputs().len();
        let (mut y, mut by) = (Vector::zeros(m), Matrix::zeros(m, x.len() + z.len()));
        let (values, jacobian) = (y.as_mut_slice(), by.as_mut_slice());
        self.0.observe(
            x.as_slice(),
            z.as_slice(),
            Drive::held(u.as_slice()),
            0.0,
            values,
            jacobian,
            &mut Work::new(),
        );
        (y, by)
    }
}

impl ParametricTransition<f64, Dyn, Dyn, Dyn> for Parametric<'_> {
    fn next(&self, x: &Vector, z: &Vector, u: &Vector) -> Vector {
        self.step(x, z, u).0
    }
    fn next_jacobian(&self, x: &Vector, z: &Vector, u: &Vector) -> Matrix {
        self.step(x, z, u).1.columns(0, x.len()).into_owned()
    }
    fn next_parameter_jacobian(&self, x: &Vector, z: &Vector, u: &Vector) -> Matrix {
        self.step(x, z, u).1.columns(x.len(), z.len()).into_owned()
    }
    fn process_noise(&self, x: &Vector, z: &Vector, u: &Vector) -> Covariance<f64, Dyn> {
        let (mut variances, dt) = (Vector::zeros(x.len()), self.0.sample_time());
        let [x, z, u] = [x, z, u].map(|vector| vector.as_slice());
        let u = Drive::held(u);
        self.0.added_variances(x, z, u, 0.0, dt, variances.as_mut_slice(), &mut Work::new());
        Covariance::from_diagonal(&variances).unwrap()
    }
}

impl ParametricObservation<f64, Dyn, Dyn, Dyn, Dyn> for Parametric<'_> {
    fn output(&self, x: &Vector, z: &Vector, u: &Vector) -> Vector {
        self.seen(x, z, u).0
    }
    fn output_jacobian(&self, x: &Vector, z: &Vector, u: &Vector) -> Matrix {
        self.seen(x, z, u).1.columns(0, x.len()).into_owned()
    }
    fn output_parameter_jacobian(&self, x: &Vector, z: &Vector, u: &Vector) -> Matrix {
        self.seen(x, z, u).1.columns(x.len(), z.len()).into_owned()
    }
    fn measurement_noise(&self, _: &Vector, _: &Vector, _: &Vector) -> Covariance<f64, Dyn> {
        Covariance::from_diagonal(&Vector::from_vec(self.0.measurement_variances_at_start())).unwrap()
    }
}

#[test]
fn unknown_parameters_are_those_of_an_augmented_model() {
    let text = PENDULUM.replace("bias * cos(t)", "bias");
    let model = GreyBox::from_toml(&text).unwrap();
    let (x, variances, _) = model.started();
    let starts: Vec<(f64, f64)> = model.parameters().iter().map(|p| p.start_variable()).collect();
    let mean: Vec<f64> = x.iter().copied().chain(starts.iter().map(|start| start.0)).collect();
    let variances = variances.iter().copied().chain(starts.iter().map(|start| start.1 * start.1));
    let prior = Covariance::from_diagonal(&Vector::from_iterator(6, variances)).unwrap();
    let mut reference = ExtendedKalmanFilter::new(mean.into(), prior).unwrap();
    let walks = Vector::from_iterator(4, model.parameters().iter().map(|p| p.walk_variable().powi(2)));
    let plant: Augmented<_, f64, Dyn, Dyn, Dyn> = Augmented::new(Parametric(&model), Dyn(2), Dyn(4))
        .and_then(|plant| plant.with_walk(Covariance::from_diagonal(&walks)?))
        .unwrap();

    let mut filter = filter(&text, Estimator::Extended);
    let mut noise = Noise(8);
    let mut last = None;
    for _ in 0..50 {
        let (u, y) = (noise.normal(), [0.3 * noise.normal(), noise.normal()]);
        let estimate = filter.step(None, &[u], &y).unwrap();
        if let Some(u) = last {
            reference.predict(&plant, &u).unwrap();
        }
        let drive = Vector::repeat(1, u);
        reference.correct(&plant, &drive, &Vector::from_column_slice(&y)).unwrap();
        // The same sums in the same order.
        assert_eq!(estimate.filtered.unwrap().values, &reference.state().as_slice()[..2]);
        let parameters = model.parameters().iter().zip(&reference.state().as_slice()[2..]);
        let expected: Vec<f64> = parameters.map(|(parameter, z)| parameter.scale.value(*z)).collect();
        assert_eq!(estimate.parameters.values, expected);
        last = Some(drive);
    }
}

#[test]
fn the_start_is_told_in_the_parameters_own_units() {
    let mut filter = filter(PENDULUM, Estimator::Extended);
    let words: Vec<String> = filter.model().changes_of_variable().map(Option::unwrap_or_default).collect();
    assert_eq!(words[0], "stiffness = exp(z)");
    let estimate = filter.step(None, &[0.0], &[f64::NAN, f64::NAN]).unwrap();
    let parameters = estimate.parameters;
    assert!(largest_difference(parameters.values, &[9.0, 0.3, 0.05, 0.8]) < 1e-14);
    assert!(largest_difference(parameters.standard_deviations.unwrap(), &[1.0, 0.1, 0.1, 0.1]) < 1e-14);
    // What walks is less certain after a gap: to first order by 0.01 each of 25 samples.
    let estimate = filter.step(Some(5.0), &[0.0], &[f64::NAN, f64::NAN]).unwrap();
    let deviations = estimate.parameters.standard_deviations.unwrap();
    assert!(largest_difference(&deviations[..3], &[1.0, 0.1, 0.1]) < 1e-14);
    assert!((deviations[3] - (0.01_f64 + 25.0 * 0.0001).sqrt()).abs() < 1e-12);
    assert_eq!((estimate.time, estimate.row), (5.0, 2));
}

#[test]
fn a_long_step_is_the_rows_that_are_missing() {
    let (equations, matrices) = known_cart();
    let correlated = format!("{matrices}\nS = [[0], [0.0004]]");
    let derivative =
        CART.replace("[next]", "[derivative]").replace("position + dt * velocity", "velocity").replace(
            "velocity + dt * (force - damping * velocity) / mass",
            "(force - damping * velocity) / mass",
        );
    for text in [CART, &equations, &matrices, &correlated, &derivative] {
        let (mut gaps, mut holes) = (filter(text, Estimator::Extended), filter(text, Estimator::Extended));
        let mut last = 0;
        for (k, (force, position)) in cart_log(2.0, 200, 5).into_iter().enumerate() {
            // The force is that of the last row that is there.
            if [0, 1, 2].contains(&(k % 7)) {
                let step = 0.1 * (k - last) as f64;
                let with_gaps = state(&gaps.step(Some(step), &[force], &[position]).unwrap());
                let with_holes = state(&holes.step(None, &[force], &[position]).unwrap());
                // The steps' lengths differ by rounding.
                assert!(largest_difference(&with_gaps, &with_holes) < 1e-10, "{text}");
                last = k;
            } else {
                let estimate = holes.step(None, &[f64::NAN], &[f64::NAN]).unwrap();
                assert_eq!(estimate.held, [true]);
            }
        }
        assert!(
            (gaps.summary().log_likelihood.unwrap() - holes.summary().log_likelihood.unwrap()).abs() < 1e-8
        );
    }
}

#[test]
fn steps_of_any_length_are_taken_by_equations_in_time() {
    // dx/dt = -x: exp(-t), up to a fifth of the fifth power of the step.
    let text = "sample_time = 0.1\n[states]\nx = { start = 1, sd = 0 }\n[derivative]\nx = '-x'\n\
                [outputs]\ny = 'x'\n[noise]\nmeasurement.y = 1\nprocess.x = 0.3";
    let mut filter = filter(text, Estimator::Kalman);
    let mut time = 0.0;
    for step in [0.0, 0.03, 0.1, 0.012, 0.25, 1.0] {
        let estimate = filter.step(Some(step), &[], &[f64::NAN]).unwrap();
        time += step;
        assert!((estimate.predicted.values[0] - (-time).exp()).abs() < 1e-6);
    }
    // Noise of variance 0.09 in 0.1 s is 0.9 a second; var = 0.45 (1 - exp(-2 t)), up to its being added at a step's
    // end.
    let deviation =
        filter.step(Some(10.0), &[], &[f64::NAN]).unwrap().predicted.standard_deviations.unwrap()[0];
    assert!((deviation * deviation / 0.45 - 1.0).abs() < 0.11, "{deviation}");
}

#[test]
fn elements_that_are_missing_are_skipped_alone() {
    let two = "sample_time = 1\noutputs = ['a', 'b']\nF = [[1, 1], [0, 1]]\nH = [[1, 0], [0, 1]]\n\
               Q = [[0.1, 0], [0, 0.2]]\nR = [[1, 0.5], [0.5, 2]]\nP0 = [[3, 0], [0, 3]]";
    let first = two
        .replace("['a', 'b']", "['a']")
        .replace("H = [[1, 0], [0, 1]]", "H = [[1, 0]]")
        .replace("[[1, 0.5], [0.5, 2]]", "[[1]]");
    let (mut both, mut alone) = (filter(two, Estimator::Kalman), filter(&first, Estimator::Kalman));
    for y in [1.0, 2.0, 5.0, 3.0] {
        let estimate = both.step(None, &[], &[y, f64::NAN]).unwrap();
        assert!(estimate.innovations[1].is_nan() && estimate.outputs.values[1].is_finite());
        assert_eq!(estimate.measured, 1);
        let found = state(&estimate);
        assert!(largest_difference(&found, &state(&alone.step(None, &[], &[y]).unwrap())) < 1e-14);
    }
    assert!((both.summary().log_likelihood.unwrap() - alone.summary().log_likelihood.unwrap()).abs() < 1e-13);
}

#[test]
fn an_input_that_is_missing_keeps_its_last_value() {
    let (text, _) = known_cart();
    let (mut missing, mut given) = (filter(&text, Estimator::Kalman), filter(&text, Estimator::Kalman));
    for (input, expected) in [(f64::NAN, 0.0), (3.0, 3.0), (f64::NAN, 3.0), (f64::NAN, 3.0), (1.0, 1.0)] {
        let estimate = missing.step(None, &[input], &[1.0]).unwrap();
        assert_eq!(estimate.held, [input.is_nan()]);
        let found = state(&estimate);
        assert_eq!(found, state(&given.step(None, &[expected], &[1.0]).unwrap()));
    }
}

/// A model of three states, two inputs and two outputs with correlated noises: w = A (a, b, c), v = B (a, b, d), of
/// independent numbers of variance 1.
fn correlated() -> (String, [DMatrix<f64>; 7]) {
    let f = DMatrix::from_row_slice(3, 3, &[0.7, 0.2, 0.0, -0.1, 0.8, 0.3, 0.0, 0.1, 0.5]);
    let g = DMatrix::from_row_slice(3, 2, &[1.0, 0.0, 0.5, 0.2, 0.0, -1.0]);
    let h = DMatrix::from_row_slice(2, 3, &[1.0, 0.0, 0.3, 0.0, 1.0, -0.2]);
    let d = DMatrix::from_row_slice(2, 2, &[0.0, 0.4, 0.1, 0.0]);
    let a = DMatrix::from_row_slice(3, 4, &[0.5, 0.1, 0.3, 0.0, -0.2, 0.4, 0.1, 0.0, 0.3, 0.3, 0.2, 0.0]);
    let b = DMatrix::from_row_slice(2, 4, &[0.6, 0.0, 0.0, 0.5, 0.2, 0.7, 0.0, 0.3]);
    let (q, r, s) = (&a * a.transpose(), &b * b.transpose(), &a * b.transpose());
    let rows = |matrix: &DMatrix<f64>| {
        let row = |row: usize| format!("{:?}", matrix.row(row).iter().copied().collect::<Vec<_>>());
        format!("[{}]", (0..matrix.nrows()).map(row).collect::<Vec<_>>().join(", "))
    };
    let text = format!(
        "sample_time = 1\ninputs = ['u', 'v']\noutputs = ['y', 'z']\nF = {}\nG = {}\nH = {}\nD = {}\nQ = {}\nR = {}\n\
         S = {}\nP0 = [[1, 0, 0], [0, 2, 0], [0, 0, 3]]",
        rows(&f),
        rows(&g),
        rows(&h),
        rows(&d),
        rows(&q),
        rows(&r),
        rows(&s)
    );
    (text, [f, g, h, d, q, r, s])
}

#[test]
fn correlated_noises_are_used_as_by_the_kalman_filter() {
    let (text, [f, g, h, d, q, r, s]) = correlated();
    let mut filter = filter(&text, Estimator::Kalman);
    let transition: LinearTransition<f64, Dyn, Dyn> =
        LinearTransition::new(f, Covariance::new(&q).unwrap()).unwrap().with_input(g).unwrap();
    let observation = LinearObservation::new(h, Covariance::new(&r).unwrap()).unwrap().with_input(d).unwrap();
    let prior = Covariance::from_diagonal(&DVector::from_vec(vec![1.0, 2.0, 3.0])).unwrap();
    let mut reference = KalmanFilter::new(DVector::zeros(3), prior).unwrap();
    let mut noise = Noise(9);
    let mut before: Option<(DVector<f64>, DVector<f64>)> = None;
    for k in 0..60 {
        let inputs = [noise.normal(), noise.normal()];
        // Each element is missing at times, and both.
        let outputs = [7, 5].map(|every| if k % every == 3 { f64::NAN } else { 3.0 * noise.normal() });
        let (u, y) = (DVector::from_column_slice(&inputs), DVector::from_column_slice(&outputs));
        if let Some((u, y)) = &before {
            if y.iter().all(|y| y.is_nan()) {
                reference.predict(&transition, u).unwrap();
            } else {
                reference.predict_correlated(&transition, &observation, &s, u, y).unwrap();
            }
        }
        let estimate = filter.step(None, &inputs, &outputs).unwrap();
        assert!(largest_difference(estimate.predicted.values, reference.state().as_slice()) < 1e-11);
        let variances: Vec<f64> =
            estimate.predicted.standard_deviations.unwrap().iter().map(|sd| sd * sd).collect();
        assert!(largest_difference(&variances, reference.covariance().variances().as_slice()) < 1e-11);
        let expected = reference.correct(&observation, &u, &y).unwrap();
        assert!((estimate.log_likelihood.unwrap() - expected.log_likelihood()).abs() < 1e-10);
        before = Some((u, y));
    }
}

#[test]
fn noises_in_innovations_form_leave_no_doubt() {
    let text = "sample_time = 1\noutputs = ['y']\nF = [[0.5]]\nH = [[1]]\nQ = [[1]]\nR = [[1]]\nS = [[1]]\nP0 = [[0]]";
    let mut filter = filter(text, Estimator::Kalman);
    for y in [1.0, 2.0] {
        filter.step(None, &[], &[y]).unwrap();
    }
    // y(k) = 0.5 y(k-1) + e(k) + 0.5 e(k-1): e(0) = 1, e(1) = 1, x(2) = 0.5 + 1.
    let estimate = filter.step(None, &[], &[f64::NAN]).unwrap();
    assert_eq!(estimate.predicted.values, [1.5]);
    assert_eq!(estimate.predicted.standard_deviations.unwrap(), [0.0]);
    // After a missing row the process noise is unknown again.
    let estimate = filter.step(None, &[], &[1.0]).unwrap();
    assert_eq!(estimate.predicted.standard_deviations.unwrap(), [1.0]);
}

#[test]
fn a_step_that_fails_changes_nothing() {
    let text = "sample_time = 1\n[states]\nx = { start = 1, sd = 1 }\n[inputs]\nu = 'u'\n[next]\nx = 'x + dt * ln(u)'\n\
                [outputs]\ny = 'x * sqrt(u)'\n[noise]\nmeasurement.y = 1";
    let mut filter = filter(text, Estimator::Extended).recording();
    filter.step(None, &[2.0], &[1.0]).unwrap();
    let mut other = filter.clone();
    let refused = |filter: &mut StateFilter, step, inputs: &[f64], outputs: &[f64]| {
        filter.step(step, inputs, outputs).unwrap_err().to_string()
    };
    // The square root of a negative number, after the prediction went well.
    let message = refused(&mut filter, None, &[-1.0], &[1.0]);
    assert!(
        message.starts_with("the estimate cannot go on: the predicted measurement is not finite"),
        "{message}"
    );
    assert!(refused(&mut filter, None, &[f64::INFINITY], &[1.0]).contains("'u' is infinite in row 2"));
    assert!(refused(&mut filter, None, &[1.0], &[f64::NEG_INFINITY]).contains("'y' is infinite in row 2"));
    assert!(refused(&mut filter, Some(-1.0), &[1.0], &[1.0]).contains("time must rise"));
    assert!(refused(&mut filter, None, &[], &[1.0]).contains("inputs: there are 0, but the model has 1"));
    assert!(refused(&mut filter, None, &[1.0], &[1.0, 2.0]).contains("outputs: there are 2"));
    assert_eq!(filter.latest(), other.latest());
    for (u, y) in [(0.5, 2.0), (3.0, f64::NAN), (1.0, 1.5)] {
        let found = state(&filter.step(Some(0.7), &[u], &[y]).unwrap());
        assert_eq!(found, state(&other.step(Some(0.7), &[u], &[y]).unwrap()));
    }
    assert_eq!(filter.summary(), other.summary());
    assert_eq!(filter.smooth().unwrap(), other.smooth().unwrap());
}

#[test]
fn a_model_of_ones_own_is_a_model() {
    let grey = GreyBox::from_toml(CART).unwrap();
    let model = StateModel::from(grey);
    assert!(!model.is_linear());
    assert_eq!((model.inputs(), model.sample_time()), (["u".to_owned()].as_slice(), 0.1));
}
