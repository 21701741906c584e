extern crate std;

use nalgebra::{Const, Matrix2, SMatrix, SVector, Vector2};

use crate::noise::Noise;
use crate::textbook::{random, random_covariance};
use crate::{
    Covariance, Differentiated, Error, ExtendedKalmanFilter, KalmanFilter, LinearObservation,
    LinearTransition, Number, Observation, ObservationFunction, Real, Transition, TransitionFunction,
};

/// A vehicle: position, heading, speed; driven by an acceleration and a turning rate, both with noise. The noise of
/// the second is proportional to it.
struct Vehicle<T> {
    sample_time: T,
}

impl<T: Real> TransitionFunction<T, 4, 2, 2> for Vehicle<T> {
    fn next<S: Number<T>>(
        &self,
        [x, y, heading, speed]: [S; 4],
        [acceleration, turn]: [S; 2],
        [rough, slip]: [S; 2],
    ) -> [S; 4] {
        let (sine, cosine) = heading.sin_cos();
        let way = speed * self.sample_time;
        [
            x + way * cosine,
            y + way * sine,
            heading + turn * (slip + T::one()) * self.sample_time,
            speed + (acceleration + rough) * self.sample_time,
        ]
    }
}

/// Its range and bearing; the range has a noise that grows with it.
impl<T: Real> ObservationFunction<T, 4, 2, 3, 2> for Vehicle<T> {
    fn output<S: Number<T>>(&self, [x, y, _, _]: [S; 4], _: [S; 2], [near, far, angle]: [S; 3]) -> [S; 2] {
        let range = (x * x + y * y).sqrt();
        [range * (far + T::one()) + near, y.atan2(x) + angle]
    }
}

fn quotient<const M: usize, const N: usize>(
    function: impl Fn(&SVector<f64, N>) -> SVector<f64, M>,
    at: &SVector<f64, N>,
) -> SMatrix<f64, M, N> {
    SMatrix::from_fn(|i, j| {
        let mut step = SVector::zeros();
        step[j] = 1e-6;
        (function(&(at + step))[i] - function(&(at - step))[i]) / 2e-6
    })
}

#[test]
fn jacobians_are_those_of_differences() {
    let mut noise = Noise(1);
    let vehicle = Vehicle { sample_time: 0.1 };
    let (q, r) = (random_covariance::<2>(&mut noise), random_covariance::<3>(&mut noise));
    let motion = Differentiated::new(&vehicle, Covariance::new(&q).unwrap());
    let sensor = Differentiated::new(&vehicle, Covariance::new(&r).unwrap());
    assert_eq!(motion.function().sample_time, 0.1);
    for _ in 0..100 {
        let (x, u) = (3.0 * random::<4, 1>(&mut noise), random::<2, 1>(&mut noise));
        let next = |x: &SVector<f64, 4>, w: &Vector2<f64>| {
            SVector::<f64, 4>::from(vehicle.next((*x).into(), u.into(), (*w).into()))
        };
        let found = motion.next_jacobian(&x, &u);
        assert!((found - quotient(|x| next(x, &Vector2::zeros()), &x)).amax() < 1e-7);
        assert_eq!(motion.next(&x, &u), next(&x, &Vector2::zeros()));
        let gamma = quotient(|w| next(&x, w), &Vector2::zeros());
        let found = motion.process_noise(&x, &u).matrix();
        assert!((found - gamma * q * gamma.transpose()).amax() < 1e-7);

        let output = |x: &SVector<f64, 4>, v: &SVector<f64, 3>| {
            Vector2::from(ObservationFunction::output(&vehicle, (*x).into(), u.into(), (*v).into()))
        };
        let found = sensor.output_jacobian(&x, &u);
        let scale = 1.0 / x.fixed_rows::<2>(0).norm().min(1.0);
        assert!(
            (found - quotient(|x| output(x, &SVector::zeros()), &x)).amax() < 1e-6 * scale * scale * scale
        );
        assert_eq!(Observation::output(&sensor, &x, &u), output(&x, &SVector::zeros()));
        let v = quotient(|v| output(&x, v), &SVector::zeros());
        let found = sensor.measurement_noise(&x, &u).matrix();
        assert!((found - v * r * v.transpose()).amax() < 1e-6);
    }
}

/// x(k+1) = F x + G u + Γ w, y = H x + D u + v.
struct Linear {
    f: Matrix2<f64>,
    g: Vector2<f64>,
    gamma: Vector2<f64>,
}

impl TransitionFunction<f64, 2, 1, 1> for Linear {
    fn next<S: Number<f64>>(&self, [a, b]: [S; 2], [u]: [S; 1], [w]: [S; 1]) -> [S; 2] {
        [0, 1].map(|i| {
            let row = self.f.row(i);
            a * row[0] + b * row[1] + u * self.g[i] + w * self.gamma[i]
        })
    }
}

impl ObservationFunction<f64, 2, 1, 1, 1> for Linear {
    fn output<S: Number<f64>>(&self, [a, b]: [S; 2], [u]: [S; 1], [v]: [S; 1]) -> [S; 1] {
        [a - b * 2.0 + u + v]
    }
}

#[test]
fn on_a_linear_function_the_extended_filter_is_the_kalman_filter() {
    let mut noise = Noise(2);
    let linear = Linear { f: random(&mut noise), g: random(&mut noise), gamma: random(&mut noise) };
    let variance =
        |variance| Covariance::<f64, Const<1>>::from_diagonal(&SVector::<f64, 1>::new(variance)).unwrap();
    let q = variance(0.3).transformed(&linear.gamma).unwrap();
    let model = LinearTransition::new(linear.f, q).unwrap().with_input(linear.g).unwrap();
    let h = nalgebra::RowVector2::new(1.0, -2.0);
    let one = SVector::<f64, 1>::new(1.0);
    let sensor = LinearObservation::new(h, variance(0.1)).unwrap().with_input(one).unwrap();
    let (motion, seen) =
        (Differentiated::new(&linear, variance(0.3)), Differentiated::new(&linear, variance(0.1)));
    let prior = Covariance::new(&random_covariance::<2>(&mut noise)).unwrap();
    let mut filter = KalmanFilter::new(Vector2::zeros(), prior.clone()).unwrap();
    let mut extended = ExtendedKalmanFilter::new(Vector2::zeros(), prior).unwrap();
    for _ in 0..50 {
        let (u, y) = (random(&mut noise), random(&mut noise));
        filter.predict(&model, &u).unwrap();
        extended.predict(&motion, &u).unwrap();
        filter.correct(&sensor, &u, &y).unwrap();
        extended.correct(&seen, &u, &y).unwrap();
        assert!((filter.state() - extended.state()).amax() < 1e-14);
        assert!((filter.covariance().matrix() - extended.covariance().matrix()).amax() < 1e-14);
    }
}

#[test]
fn a_vehicle_is_followed_in_single_precision() {
    let vehicle = Vehicle::<f32> { sample_time: 0.1 };
    let q = Covariance::from_diagonal(&Vector2::new(1e-2, 1e-2)).unwrap();
    let r = Covariance::from_diagonal(&nalgebra::Vector3::new(1e-4, 1e-4, 1e-5)).unwrap();
    let (motion, sensor) = (Differentiated::new(&vehicle, q), Differentiated::new(&vehicle, r));
    let mut noise = Noise(3);
    let mut truth = [5.0_f32, 0.0, 1.5, 1.0];
    let prior = Covariance::from_diagonal(&nalgebra::Vector4::new(1.0, 1.0, 0.5, 1.0)).unwrap();
    let mut filter = ExtendedKalmanFilter::new(nalgebra::Vector4::new(4.0, 0.5, 1.0, 0.5), prior).unwrap();
    let mut random = |size: f32| size * noise.next() as f32;
    for _ in 0..300 {
        let u = [0.0, 0.2];
        truth = vehicle.next(truth, u, [random(0.17), random(0.17)]);
        filter.predict(&motion, &u.into()).unwrap();
        let y =
            ObservationFunction::output(&vehicle, truth, u, [random(0.017), random(0.017), random(0.005)]);
        filter.correct(&sensor, &u.into(), &y.into()).unwrap();
    }
    let error = filter.state() - nalgebra::Vector4::from(truth);
    assert!(error.amax() < 0.15, "{error}");
    // As uncertain as it says.
    let nees = (error.transpose() * filter.covariance().matrix().try_inverse().unwrap() * error)[0];
    assert!(nees < 20.0, "{nees}");
}

#[test]
fn a_derivative_that_is_not_finite_is_refused() {
    struct Root;
    impl TransitionFunction<f64, 1, 1> for Root {
        fn next<S: Number<f64>>(&self, [x]: [S; 1], _: [S; 0], [w]: [S; 1]) -> [S; 1] {
            [x.sqrt() + w.sqrt()]
        }
    }
    let unit = || Covariance::<f64, Const<1>>::from_diagonal(&SVector::<f64, 1>::new(1.0)).unwrap();
    let model = Differentiated::new(Root, unit());
    for (start, argument) in [(0.0, "transition Jacobian"), (1.0, "transition noise")] {
        let mut filter = ExtendedKalmanFilter::new(SVector::<f64, 1>::new(start), unit()).unwrap();
        let before = filter.clone();
        assert_eq!(filter.predict(&model, &SVector::zeros()), Err(Error::NotFinite { argument }));
        assert_eq!(filter, before);
    }
}
