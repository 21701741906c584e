extern crate std;
use std::println;

use nalgebra::{Complex, Const, Matrix2, RowVector2, SMatrix, SVector, Vector1, Vector2};

use crate::noise::Noise;
use crate::textbook::{Square, random, random_covariance, stable};
use crate::{
    Action, Covariance, Error, GainSchedule, KalmanFilter, LinearObservation, LinearTransition,
    LuenbergerObserver, Observation, Real, Transition,
};

type None = SVector<f64, 0>;

fn model<T: Real, const N: usize>(f: SMatrix<T, N, N>) -> LinearTransition<T, Const<N>> {
    LinearTransition::new(f, Covariance::zero(Const)).unwrap()
}

fn sensor<T: Real, const N: usize, const M: usize>(
    h: SMatrix<T, M, N>,
) -> LinearObservation<T, Const<N>, Const<M>> {
    LinearObservation::new(h, Covariance::zero(Const)).unwrap()
}

fn placed<T: Real, const N: usize, const M: usize>(
    f: SMatrix<T, N, N>,
    h: SMatrix<T, M, N>,
    weights: &SVector<T, M>,
    poles: &SVector<Complex<T>, N>,
) -> Result<SMatrix<T, N, M>, Error> {
    let mut observer = LuenbergerObserver::new(SVector::zeros(), SMatrix::zeros()).unwrap();
    let before = observer.clone();
    let result = observer.place(&model(f), &sensor(h), &SVector::zeros(), weights, poles);
    assert!(result.is_ok() || observer == before);
    result.map(|()| *observer.gain())
}

/// The coefficients of det(z - A), by Faddeev and LeVerrier's recursion, z^(N-1) first.
fn characteristic<const N: usize>(matrix: &Square<N>) -> [f64; N] {
    let (mut power, mut coefficients) = (*matrix, [0.0; N]);
    for (k, coefficient) in coefficients.iter_mut().enumerate() {
        *coefficient = -power.trace() / (k + 1) as f64;
        power = matrix * (power + *coefficient * Square::identity());
    }
    coefficients
}

/// The coefficients of the polynomial with these roots, likewise.
fn polynomial<const N: usize>(roots: &SVector<Complex<f64>, N>) -> [f64; N] {
    let mut coefficients = [Complex::new(0.0, 0.0); N];
    for (count, root) in roots.iter().enumerate() {
        for k in (0..=count).rev() {
            let before = if k == 0 { Complex::new(1.0, 0.0) } else { coefficients[k - 1] };
            coefficients[k] -= root * before;
        }
    }
    coefficients.map(|coefficient| coefficient.re)
}

/// Poles within a radius of 0.8, about half of them complex.
fn random_poles<const N: usize>(noise: &mut Noise) -> SVector<Complex<f64>, N> {
    let (mut poles, mut index) = (SVector::from_element(Complex::new(0.0, 0.0)), 0);
    while index < N {
        let (radius, angle) = (0.8 * noise.next(), noise.next());
        if index + 1 < N && noise.next() > 0.0 {
            poles[index] = Complex::new(radius * angle.cos(), radius * angle.sin());
            poles[index + 1] = poles[index].conj();
            index += 2;
        } else {
            poles[index] = Complex::new(radius, 0.0);
            index += 1;
        }
    }
    poles
}

/// The largest error of the characteristic polynomial of F - L H.
fn worst_error<const N: usize, const M: usize>(noise: &mut Noise) -> f64 {
    let mut worst = 0.0_f64;
    for _ in 0..50 {
        let (f, h) = (stable::<N>(noise, 1.0), random::<M, N>(noise));
        let (poles, weights) = (random_poles::<N>(noise), random::<M, 1>(noise));
        let gain = placed(f, h, &weights, &poles).unwrap();
        let (found, expected) = (characteristic(&(f - gain * h)), polynomial(&poles));
        for (found, expected) in found.into_iter().zip(expected) {
            worst = worst.max((found - expected).abs());
        }
    }
    worst
}

#[test]
fn the_poles_are_placed() {
    let mut noise = Noise(1);
    let worst = [
        worst_error::<1, 1>(&mut noise),
        worst_error::<2, 1>(&mut noise),
        worst_error::<3, 2>(&mut noise),
        worst_error::<4, 1>(&mut noise),
        worst_error::<6, 1>(&mut noise),
        worst_error::<8, 1>(&mut noise),
    ];
    println!("{worst:?}");
    for (worst, bound) in worst.into_iter().zip([1e-15, 1e-12, 1e-11, 1e-10, 1e-8, 1e-6]) {
        assert!(worst < bound, "{worst:e} {bound:e}");
    }
}

#[test]
fn a_chain_of_delays_is_placed_exactly() {
    // y(k) = x_0(k), and each state is the next one a sample before: observer form, where L is read off.
    let f = SMatrix::<f64, 3, 3>::new(0.5, 1.0, 0.0, -0.2, 0.0, 1.0, 0.1, 0.0, 0.0);
    let h = SMatrix::<f64, 1, 3>::new(1.0, 0.0, 0.0);
    let poles =
        SVector::<_, 3>::new(Complex::new(0.3, 0.2), Complex::new(0.3, -0.2), Complex::new(-0.1, 0.0));
    let gain = placed(f, h, &Vector1::new(1.0), &poles).unwrap();
    let [a, b, c] = polynomial(&poles);
    assert!((gain - SVector::<f64, 3>::new(a + 0.5, b - 0.2, c + 0.1)).amax() < 1e-14);
    // In single precision, and all poles at 0: dead-beat.
    let zero = SVector::<_, 3>::from_element(Complex::new(0.0_f32, 0.0));
    let gain = placed(f.map(|f| f as f32), h.map(|h| h as f32), &Vector1::new(1.0), &zero).unwrap();
    assert!((gain - SVector::<f32, 3>::new(0.5, -0.2, 0.1)).amax() < 1e-6);
}

#[test]
fn what_cannot_be_seen_cannot_be_placed() {
    let poles = Vector2::new(Complex::new(0.1, 0.0), Complex::new(0.2, 0.0));
    let one = Vector1::new(1.0);
    let f = Matrix2::new(0.5, 0.1, 0.0, 0.7);
    // The speed alone does not tell the position, nor does a mode that cancels in the output.
    let not_observable = |rank| Err(Error::NotObservable { rank, states: 2 });
    assert_eq!(placed(f, RowVector2::new(0.0, 1.0), &one, &poles), not_observable(1));
    assert_eq!(placed(f, RowVector2::zeros(), &one, &poles), not_observable(0));
    assert_eq!(placed(Matrix2::zeros(), RowVector2::new(1.0, 0.0), &one, &poles), not_observable(1));
    assert_eq!(placed(Matrix2::identity() * 0.5, RowVector2::new(1.0, 2.0), &one, &poles), not_observable(1));
    // Weights that cancel.
    let both = Matrix2::new(1.0, 0.0, 1.0, 0.0);
    let error = placed(f, both, &Vector2::new(1.0, -1.0), &poles).unwrap_err();
    assert_eq!(error, Error::NotObservable { rank: 0, states: 2 });
    assert!(placed(f, both, &Vector2::new(1.0, 1.0), &poles).is_ok());
}

#[test]
fn poles_that_no_observer_has_are_errors() {
    let (f, h, one) = (Matrix2::new(1.0, 0.1, 0.0, 1.0), RowVector2::new(1.0, 0.0), Vector1::new(1.0));
    let place = |a: (f64, f64), b: (f64, f64)| {
        placed(f, h, &one, &Vector2::new(Complex::new(a.0, a.1), Complex::new(b.0, b.1))).map(|_| ())
    };
    assert_eq!(place((0.5, 0.5), (0.5, -0.5)), Ok(()));
    let outside = Err(Error::OutOfRange { argument: "poles", range: "inside the unit circle" });
    assert_eq!(place((1.0, 0.0), (0.0, 0.0)), outside);
    assert_eq!(place((0.8, 0.8), (0.8, -0.8)), outside);
    assert_eq!(place((-1e200, 0.0), (0.0, 0.0)), outside);
    for bad in [f64::NAN, f64::INFINITY] {
        let not_finite = Err(Error::NotFinite { argument: "poles" });
        assert_eq!(place((bad, 0.0), (0.0, 0.0)), not_finite);
        assert_eq!(place((0.5, bad), (0.5, -bad)), not_finite);
    }
    let pairs = Err(Error::OutOfRange { argument: "poles", range: "real, or conjugate pairs side by side" });
    assert_eq!(place((0.5, 0.5), (0.5, 0.5)), pairs);
    assert_eq!(place((0.5, 0.5), (0.4, -0.5)), pairs);
    assert_eq!(place((0.5, 0.0), (0.5, 0.1)), pairs);

    let zero = Vector2::from_element(Complex::new(0.0, 0.0));
    let error = placed(f, h, &Vector1::new(f64::NAN), &zero).unwrap_err();
    assert_eq!(error, Error::NotFinite { argument: "weights" });
    // The gain would have to be 1e310.
    let error = placed(f, h * 1e-310, &one, &zero).unwrap_err();
    assert!(matches!(error, Error::Overflow | Error::NotObservable { .. }), "{error}");
}

#[test]
fn with_the_steady_gain_it_is_the_kalman_filter() {
    let mut noise = Noise(2);
    let (f, h) = (stable::<3>(&mut noise, 0.95), random::<2, 3>(&mut noise));
    let q = Covariance::new(&random_covariance::<3>(&mut noise)).unwrap();
    let r = Covariance::new(&random_covariance::<2>(&mut noise)).unwrap();
    let (g, d) = (random::<3, 1>(&mut noise), random::<2, 1>(&mut noise));
    let model = LinearTransition::new(f, q).unwrap().with_input(g).unwrap();
    let sensor = LinearObservation::new(h, r).unwrap().with_input(d).unwrap();
    let start = Covariance::from_diagonal(&SVector::from_element(1.0)).unwrap();
    let steady = GainSchedule::new(start).steady_state(&model, &sensor, 1000).unwrap();
    let mut filter = KalmanFilter::new(random(&mut noise), steady.predicted).unwrap();
    let mut observer = LuenbergerObserver::new(*filter.state(), steady.predictor_gain).unwrap();
    for _ in 0..50 {
        let (u, y) = (random(&mut noise), random(&mut noise));
        let expected = filter.correct(&sensor, &u, &y).unwrap();
        filter.predict(&model, &u).unwrap();
        let found = observer.update(&model, &sensor, &u, &y).unwrap();
        assert_eq!(found.action, Action::Updated);
        assert!((found.error - expected.error).amax() < 1e-12);
        assert!((observer.state() - filter.state()).amax() < 1e-12);
    }
}

#[test]
fn missing_elements_count_as_predicted_ones() {
    let f = Matrix2::new(1.0, 0.1, 0.0, 1.0);
    let gain = Matrix2::new(0.5, 0.1, 0.2, 0.3);
    let (model, sensor) = (model(f), sensor(Matrix2::identity()));
    let start = Vector2::new(1.0, 2.0);
    let update = |y: Vector2<f64>| {
        let mut observer = LuenbergerObserver::new(start, gain).unwrap();
        let innovation = observer.update(&model, &sensor, &None::zeros(), &y).unwrap();
        assert!(innovation.variance.iter().all(|variance| variance.is_nan()));
        assert_eq!((innovation.nis, innovation.log_likelihood()), (0.0, 0.0));
        (*observer.state() - f * start, innovation.action)
    };
    let y = Vector2::new(1.5, 4.0);
    let (step, action) = update(y);
    assert!((step - gain * Vector2::new(0.5, 2.0)).amax() < 1e-15 && action == Action::Updated);
    let (step, action) = update(Vector2::new(f64::NAN, 4.0));
    assert!((step - gain * Vector2::new(0.0, 2.0)).amax() < 1e-15 && action == Action::Updated);
    assert_eq!(update(Vector2::new(f64::NAN, f64::NAN)), (Vector2::zeros(), Action::Missing));
}

/// A pendulum with a large swing, seen by the sideways position of its end.
struct Pendulum;

impl Transition<f64, Const<2>, Const<1>> for Pendulum {
    fn next(&self, x: &Vector2<f64>, u: &Vector1<f64>) -> Vector2<f64> {
        Vector2::new(x[0] + 0.02 * x[1], x[1] + 0.02 * (u[0] - 9.81 * x[0].sin()))
    }
    fn next_jacobian(&self, x: &Vector2<f64>, _: &Vector1<f64>) -> Matrix2<f64> {
        Matrix2::new(1.0, 0.02, -0.02 * 9.81 * x[0].cos(), 1.0)
    }
    fn process_noise(&self, _: &Vector2<f64>, _: &Vector1<f64>) -> Covariance<f64, Const<2>> {
        Covariance::zero(Const)
    }
}

impl Observation<f64, Const<2>, Const<1>, Const<1>> for Pendulum {
    fn output(&self, x: &Vector2<f64>, _: &Vector1<f64>) -> Vector1<f64> {
        Vector1::new((x[0] / 2.0).sin())
    }
    fn output_jacobian(&self, x: &Vector2<f64>, _: &Vector1<f64>) -> RowVector2<f64> {
        RowVector2::new((x[0] / 2.0).cos() / 2.0, 0.0)
    }
    fn measurement_noise(&self, _: &Vector2<f64>, _: &Vector1<f64>) -> Covariance<f64, Const<1>> {
        Covariance::zero(Const)
    }
}

#[test]
fn a_pendulum_is_followed_with_a_gain_for_each_state() {
    let mut truth = Vector2::new(1.5, 0.0);
    let mut observer = LuenbergerObserver::new(Vector2::new(1.0, 0.5), Vector2::zeros()).unwrap();
    let poles = Vector2::new(Complex::new(0.8, 0.1), Complex::new(0.8, -0.1));
    for k in 0..300 {
        let u = Vector1::new(if k % 50 < 25 { 1.0 } else { -1.0 });
        observer.place(&Pendulum, &Pendulum, &u, &Vector1::new(1.0), &poles).unwrap();
        observer.update(&Pendulum, &Pendulum, &u, &Pendulum.output(&truth, &u)).unwrap();
        truth = Pendulum.next(&truth, &u);
    }
    assert!((observer.state() - truth).amax() < 1e-9, "{}", observer.state() - truth);
}

#[test]
fn errors_name_the_argument_and_change_nothing() {
    let one = Vector1::new(1.0);
    let model = model::<f64, 1>(one).with_input(one).unwrap();
    let sensor = sensor::<f64, 1, 1>(one).with_input(one).unwrap();
    let mut observer = LuenbergerObserver::new(one, one).unwrap();
    let before = observer.clone();
    let not_finite = |argument| Error::NotFinite { argument };
    let bad = Vector1::new(f64::NAN);
    assert_eq!(observer.update(&model, &sensor, &bad, &one).unwrap_err(), not_finite("input"));
    let infinite = Vector1::new(f64::INFINITY);
    let error = observer.update(&model, &sensor, &one, &infinite).unwrap_err();
    assert_eq!(error, Error::Infinite { argument: "measurement" });
    let large = Vector1::new(f64::MAX);
    let error = observer.update(&model, &sensor, &-large, &large).unwrap_err();
    assert_eq!(error, Error::TooLarge { argument: "measurement" });
    let poles = Vector1::new(Complex::new(0.5, 0.0));
    assert_eq!(observer.place(&model, &sensor, &bad, &one, &poles), Err(not_finite("input")));
    assert_eq!(observer, before);
    assert_eq!(LuenbergerObserver::new(bad, one).unwrap_err(), not_finite("state"));
    assert_eq!(LuenbergerObserver::new(one, bad).unwrap_err(), not_finite("gain"));

    struct Broken(f64);
    impl Transition<f64, Const<1>> for Broken {
        fn next(&self, _: &Vector1<f64>, _: &None) -> Vector1<f64> {
            Vector1::new(self.0)
        }
        fn next_jacobian(&self, _: &Vector1<f64>, _: &None) -> Vector1<f64> {
            Vector1::new(self.0)
        }
        fn process_noise(&self, _: &Vector1<f64>, _: &None) -> Covariance<f64, Const<1>> {
            Covariance::zero(Const)
        }
    }
    impl Observation<f64, Const<1>, Const<1>> for Broken {
        fn output(&self, _: &Vector1<f64>, _: &None) -> Vector1<f64> {
            Vector1::new(self.0)
        }
        fn output_jacobian(&self, _: &Vector1<f64>, _: &None) -> Vector1<f64> {
            Vector1::new(self.0)
        }
        fn measurement_noise(&self, _: &Vector1<f64>, _: &None) -> Covariance<f64, Const<1>> {
            Covariance::zero(Const)
        }
    }
    let none = None::zeros();
    let update = |observer: &mut LuenbergerObserver<f64, _, _>, f: f64, h: f64| {
        observer.update(&Broken(f), &Broken(h), &none, &one).unwrap_err()
    };
    assert_eq!(update(&mut observer, f64::NAN, 1.0), not_finite("next state"));
    assert_eq!(update(&mut observer, 1.0, f64::NAN), not_finite("predicted measurement"));
    let mut place = |f: f64, h: f64| observer.place(&Broken(f), &Broken(h), &none, &one, &poles).unwrap_err();
    assert_eq!(place(f64::INFINITY, 1.0), not_finite("transition Jacobian"));
    assert_eq!(place(1.0, f64::INFINITY), not_finite("observation Jacobian"));
    assert_eq!(observer, before);
}

#[cfg(feature = "alloc")]
#[test]
fn sizes_at_run_time_give_the_same_bits() {
    use nalgebra::{DMatrix, DVector};

    let mut noise = Noise(3);
    let (f, h) = (stable::<4>(&mut noise, 1.0), random::<2, 4>(&mut noise));
    let (poles, weights) = (random_poles::<4>(&mut noise), Vector2::new(1.0, 0.5));
    let gain = placed(f, h, &weights, &poles).unwrap();
    let zero = |size| Covariance::from_diagonal(&DVector::from_element(size, 0.0)).unwrap();
    let model = LinearTransition::new(DMatrix::from_column_slice(4, 4, f.as_slice()), zero(4)).unwrap();
    let sensor = LinearObservation::new(DMatrix::from_column_slice(2, 4, h.as_slice()), zero(2)).unwrap();
    let mut observer = LuenbergerObserver::new(DVector::zeros(4), DMatrix::zeros(4, 2)).unwrap();
    let weights = DVector::from_column_slice(weights.as_slice());
    let poles = DVector::from_column_slice(poles.as_slice());
    let none = SVector::<f64, 0>::zeros();
    observer.place(&model, &sensor, &none, &weights, &poles).unwrap();
    assert_eq!(observer.gain().as_slice(), gain.as_slice());

    let length = |argument, expected, found| Error::Length { argument, expected, found };
    let error = LuenbergerObserver::new(DVector::<f64>::zeros(4), DMatrix::zeros(3, 2)).unwrap_err();
    assert_eq!(error, length("gain", 4, 3));
    let few = poles.rows(0, 3).into_owned();
    assert_eq!(observer.place(&model, &sensor, &none, &weights, &few), Err(length("poles", 4, 3)));
    let few = weights.rows(0, 1).into_owned();
    assert_eq!(observer.place(&model, &sensor, &none, &few, &poles), Err(length("weights", 2, 1)));
}

#[test]
fn observability_does_not_depend_on_the_sample_time_or_on_units() {
    let one = Vector1::new(1.0_f32);
    let poles = Vector2::new(Complex::new(0.4_f32, 0.3), Complex::new(0.4, -0.3));
    for dt in [1e-3_f32, 2e-6, 1e-6, 1e-12, 1e-25] {
        let gain = placed(Matrix2::new(1.0, dt, 0.0, 1.0), RowVector2::new(1.0, 0.0), &one, &poles).unwrap();
        assert!((gain[0] - 1.2).abs() < 1e-5 && (gain[1] * dt - 0.45).abs() < 1e-5, "{dt:e} {gain}");
    }
    let mut noise = Noise(11);
    let (f, h, poles) = (stable::<5>(&mut noise, 1.0), random::<1, 5>(&mut noise), random_poles(&mut noise));
    let gain = placed(f, h, &Vector1::new(1.0), &poles).unwrap();
    let units = [1e12, 1.0, 1e-9, 1e7, 1e-15];
    let scaled_f = Square::<5>::from_fn(|i, j| f[(i, j)] * units[i] / units[j]);
    let scaled_h = SMatrix::<f64, 1, 5>::from_fn(|_, j| h[j] / units[j]);
    let scaled = placed(scaled_f, scaled_h, &Vector1::new(1.0), &poles).unwrap();
    for (index, unit) in units.into_iter().enumerate() {
        assert!((scaled[index] / unit - gain[index]).abs() < 1e-9 * gain.amax());
    }
    // In any units, a mode that cancels cannot be seen.
    for unit in [1e-15, 1.0, 1e15] {
        let f = Matrix2::new(0.3, 0.0, -0.2 / unit, 0.5);
        let poles = Vector2::from_element(Complex::new(0.0, 0.0));
        let error = placed(f, RowVector2::new(1.0, -unit), &Vector1::new(1.0), &poles).unwrap_err();
        assert_eq!(error, Error::NotObservable { rank: 1, states: 2 });
    }
}
