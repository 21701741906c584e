use nalgebra::{Const, Matrix1x2, Matrix1x3, Matrix2, Matrix3, SMatrix, SVector, Vector1, Vector2, Vector3};

use crate::noise::Noise;
use crate::textbook::random;
use crate::{
    Augmented, Covariance, Error, ExtendedKalmanFilter, LinearObservation, Observation,
    ParametricObservation, ParametricTransition, Real, Transition, WithoutParameters,
};

/// A cart of unknown mass, pushed by a force: position, speed; the parameter is 1/mass. Its sensor reads the
/// acceleration, and the position.
struct Cart<T> {
    sample_time: T,
    noise: T,
}

type One<T> = Vector1<T>;

impl<T: Real> ParametricTransition<T, Const<2>, Const<1>, Const<1>> for Cart<T> {
    fn next(&self, x: &Vector2<T>, inverse_mass: &One<T>, force: &One<T>) -> Vector2<T> {
        Vector2::new(x[0] + self.sample_time * x[1], x[1] + self.sample_time * inverse_mass[0] * force[0])
    }
    fn next_jacobian(&self, _: &Vector2<T>, _: &One<T>, _: &One<T>) -> Matrix2<T> {
        Matrix2::new(T::one(), self.sample_time, T::zero(), T::one())
    }
    fn next_parameter_jacobian(&self, _: &Vector2<T>, _: &One<T>, force: &One<T>) -> Vector2<T> {
        Vector2::new(T::zero(), self.sample_time * force[0])
    }
    fn process_noise(&self, _: &Vector2<T>, _: &One<T>, _: &One<T>) -> Covariance<T, Const<2>> {
        Covariance::from_diagonal(&Vector2::new(T::zero(), self.noise)).unwrap()
    }
}

impl<T: Real> ParametricObservation<T, Const<2>, Const<1>, Const<2>, Const<1>> for Cart<T> {
    fn output(&self, x: &Vector2<T>, inverse_mass: &One<T>, force: &One<T>) -> Vector2<T> {
        Vector2::new(inverse_mass[0] * force[0], x[0])
    }
    fn output_jacobian(&self, _: &Vector2<T>, _: &One<T>, _: &One<T>) -> Matrix2<T> {
        Matrix2::new(T::zero(), T::zero(), T::one(), T::zero())
    }
    fn output_parameter_jacobian(&self, _: &Vector2<T>, _: &One<T>, force: &One<T>) -> Vector2<T> {
        Vector2::new(force[0], T::zero())
    }
    fn measurement_noise(&self, _: &Vector2<T>, _: &One<T>, _: &One<T>) -> Covariance<T, Const<2>> {
        Covariance::from_diagonal(&Vector2::new(nalgebra::convert(0.1), nalgebra::convert(1e-4))).unwrap()
    }
}

type Plant<T> = Augmented<Cart<T>, T, Const<3>, Const<2>, Const<1>>;

fn plant<T: Real>(noise: f64) -> Plant<T> {
    let cart = Cart { sample_time: nalgebra::convert(0.1), noise: nalgebra::convert(noise) };
    Augmented::new(cart, Const, Const).unwrap()
}

#[test]
fn the_larger_model_is_made_of_the_parts() {
    let walk = Covariance::from_diagonal(&Vector1::new(0.25)).unwrap();
    let plant = plant::<f64>(0.5).with_walk(walk).unwrap();
    let (z, force) = (Vector3::new(1.0, 2.0, 0.5), Vector1::new(4.0));
    let transition: &dyn Transition<f64, Const<3>, Const<1>> = &plant;
    assert_eq!(transition.next(&z, &force), Vector3::new(1.2, 2.2, 0.5));
    let f = Matrix3::new(1.0, 0.1, 0.0, 0.0, 1.0, 0.4, 0.0, 0.0, 1.0);
    assert_eq!(transition.next_jacobian(&z, &force), f);
    let q = Matrix3::from_diagonal(&Vector3::new(0.0, 0.5, 0.25));
    assert_eq!(transition.process_noise(&z, &force).matrix(), q);

    let observation: &dyn Observation<f64, Const<3>, Const<2>, Const<1>> = &plant;
    assert_eq!(observation.output(&z, &force), Vector2::new(2.0, 1.0));
    let h = SMatrix::<f64, 2, 3>::new(0.0, 0.0, 4.0, 1.0, 0.0, 0.0);
    assert_eq!(observation.output_jacobian(&z, &force), h);
    assert_eq!(observation.measurement_noise(&z, &force).variances(), Vector2::new(0.1, 1e-4));
    assert_eq!(plant.model().sample_time, 0.1);
}

#[test]
fn noises_with_correlations_stay_side_by_side() {
    struct Noisy;
    impl ParametricTransition<f64, Const<2>, Const<2>> for Noisy {
        fn next(&self, x: &Vector2<f64>, _: &Vector2<f64>, _: &SVector<f64, 0>) -> Vector2<f64> {
            *x
        }
        fn next_jacobian(&self, _: &Vector2<f64>, _: &Vector2<f64>, _: &SVector<f64, 0>) -> Matrix2<f64> {
            Matrix2::identity()
        }
        fn next_parameter_jacobian(
            &self,
            _: &Vector2<f64>,
            _: &Vector2<f64>,
            _: &SVector<f64, 0>,
        ) -> Matrix2<f64> {
            Matrix2::zeros()
        }
        fn process_noise(
            &self,
            _: &Vector2<f64>,
            _: &Vector2<f64>,
            _: &SVector<f64, 0>,
        ) -> Covariance<f64, Const<2>> {
            Covariance::new(&Matrix2::new(4.0, 1.0, 1.0, 2.0)).unwrap()
        }
    }
    let walk = Matrix2::new(1.0, -0.5, -0.5, 2.0);
    let model: Augmented<_, f64, Const<4>, _, _> = Augmented::new(Noisy, Const::<2>, Const::<2>)
        .unwrap()
        .with_walk(Covariance::new(&walk).unwrap())
        .unwrap();
    let found = model.process_noise(&SVector::zeros(), &SVector::zeros()).matrix();
    let mut expected = SMatrix::<f64, 4, 4>::zeros();
    expected.fixed_view_mut::<2, 2>(0, 0).copy_from(&Matrix2::new(4.0, 1.0, 1.0, 2.0));
    expected.fixed_view_mut::<2, 2>(2, 2).copy_from(&walk);
    assert!((found - expected).amax() < 1e-15);
}

#[test]
fn an_observation_without_parameters_is_a_parametric_one() {
    let noise = Covariance::from_diagonal(&Vector1::new(0.5)).unwrap();
    let sensor = LinearObservation::new(Matrix1x2::new(1.0, 3.0), noise.clone()).unwrap();
    let sensor: Augmented<_, f64, Const<3>, _, _> =
        Augmented::new(WithoutParameters(sensor), Const::<2>, Const::<1>).unwrap();
    let z = Vector3::new(1.0, 2.0, 100.0);
    assert_eq!(sensor.output(&z, &SVector::zeros()), Vector1::new(7.0));
    assert_eq!(sensor.output_jacobian(&z, &SVector::zeros()), Matrix1x3::new(1.0, 3.0, 0.0));
    assert_eq!(sensor.measurement_noise(&z, &SVector::zeros()), noise);
}

/// Estimates the mass of a cart that is pushed to and fro, from its position alone.
fn estimated_mass<T: Real + Into<f64>>() -> (f64, f64) {
    let plant = plant::<T>(1e-6);
    let noise = Covariance::from_diagonal(&Vector1::new(nalgebra::convert(1e-4))).unwrap();
    let sensor = LinearObservation::new(nalgebra::RowVector2::new(T::one(), T::zero()), noise).unwrap();
    let sensor = sensor.with_input(Vector1::new(T::zero())).unwrap();
    let sensor: Augmented<_, T, Const<3>, _, _> =
        Augmented::new(WithoutParameters(sensor), Const::<2>, Const::<1>).unwrap();
    let prior = Covariance::from_diagonal(&Vector3::new(1.0, 1.0, 1.0).map(nalgebra::convert)).unwrap();
    let mut filter =
        ExtendedKalmanFilter::new(Vector3::new(0.0, 0.0, 1.0).map(nalgebra::convert), prior).unwrap();
    let (mut noise, mut truth) = (Noise(1), Vector2::new(0.2, 0.0));
    for k in 0..500 {
        let force = if k % 40 < 20 { 2.0 } else { -2.0 };
        truth += Vector2::new(0.1 * truth[1], 0.1 * 0.4 * force);
        let force = Vector1::new(nalgebra::convert(force));
        filter.predict(&plant, &force).unwrap();
        let y = Vector1::new(nalgebra::convert(truth[0] + 0.0173 * noise.next()));
        filter.correct(&sensor, &force, &y).unwrap();
    }
    (filter.state()[2].into(), filter.covariance().variances()[2].into().sqrt())
}

#[test]
fn an_unknown_mass_is_found() {
    let (inverse_mass, deviation) = estimated_mass::<f64>();
    assert!((inverse_mass - 0.4).abs() < 3.0 * deviation && deviation < 2e-3, "{inverse_mass} {deviation}");
    let (single, _) = estimated_mass::<f32>();
    assert!((single - inverse_mass).abs() < 1e-4, "{single} {inverse_mass}");
}

#[test]
fn a_parameter_that_jumps_is_followed_if_it_may_walk() {
    let run = |walk: f64| {
        let walk = Covariance::from_diagonal(&Vector1::new(walk)).unwrap();
        let plant = plant::<f64>(1e-6).with_walk(walk).unwrap();
        let prior = Covariance::from_diagonal(&Vector3::new(1.0, 1.0, 1.0)).unwrap();
        let mut filter = ExtendedKalmanFilter::new(Vector3::new(0.0, 0.0, 1.0), prior).unwrap();
        let (mut noise, mut truth) = (Noise(2), Vector2::zeros());
        for k in 0..2000 {
            let inverse_mass = if k < 1000 { 0.4 } else { 0.8 };
            let force = Vector1::new(random::<1, 1>(&mut noise)[0]);
            let y =
                Vector2::new(inverse_mass * force[0] + 0.5 * noise.next(), truth[0] + 0.0173 * noise.next());
            filter.correct(&plant, &force, &y).unwrap();
            truth += Vector2::new(0.1 * truth[1], 0.1 * inverse_mass * force[0]);
            filter.predict(&plant, &force).unwrap();
        }
        filter.state()[2]
    };
    assert!((run(1e-4) - 0.8).abs() < 0.05);
    assert!((run(0.0) - 0.8).abs() > 0.1);
}

#[test]
fn the_sizes_must_add_up() {
    let result: Result<Augmented<_, f64, Const<4>, _, _>, _> = Augmented::new((), Const::<2>, Const::<1>);
    let error = Error::Length { argument: "augmented state", expected: 3, found: 4 };
    assert_eq!(result.unwrap_err(), error);
}

#[cfg(feature = "alloc")]
mod dynamic {
    use nalgebra::{DMatrix, DVector, Dyn};

    use super::*;

    /// Answers in a size that it is told.
    struct Sized {
        states: usize,
        parameters: usize,
    }

    impl ParametricTransition<f64, Dyn, Dyn, Dyn> for Sized {
        fn next(&self, _: &DVector<f64>, _: &DVector<f64>, _: &DVector<f64>) -> DVector<f64> {
            DVector::from_element(self.states, 1.0)
        }
        fn next_jacobian(&self, _: &DVector<f64>, _: &DVector<f64>, _: &DVector<f64>) -> DMatrix<f64> {
            DMatrix::from_element(self.states, self.states, 2.0)
        }
        fn next_parameter_jacobian(
            &self,
            _: &DVector<f64>,
            _: &DVector<f64>,
            _: &DVector<f64>,
        ) -> DMatrix<f64> {
            DMatrix::from_element(self.states, self.parameters, 3.0)
        }
        fn process_noise(
            &self,
            _: &DVector<f64>,
            _: &DVector<f64>,
            _: &DVector<f64>,
        ) -> Covariance<f64, Dyn> {
            Covariance::from_diagonal(&DVector::from_element(self.states, 4.0)).unwrap()
        }
    }

    #[test]
    fn sizes_at_run_time() {
        let of = |states, parameters| -> Augmented<_, f64, Dyn, _, _> {
            Augmented::new(Sized { states, parameters }, Dyn(2), Dyn(1)).unwrap()
        };
        let walk = Covariance::from_diagonal(&DVector::from_element(1, 5.0)).unwrap();
        let model = of(2, 1).with_walk(walk).unwrap();
        let (z, none) = (DVector::from_element(3, 7.0), DVector::zeros(0));
        assert_eq!(model.next(&z, &none).as_slice(), [1.0, 1.0, 7.0]);
        let f = [2.0, 2.0, 0.0, 2.0, 2.0, 0.0, 3.0, 3.0, 1.0];
        assert_eq!(model.next_jacobian(&z, &none).as_slice(), f);
        assert_eq!(model.process_noise(&z, &none).variances().as_slice(), [4.0, 4.0, 5.0]);

        let walk = Covariance::from_diagonal(&DVector::from_element(2, 5.0)).unwrap();
        let error = Error::Length { argument: "walk", expected: 1, found: 2 };
        assert_eq!(of(2, 1).with_walk(walk).map(|_| ()), Err(error));

        let unit = Covariance::from_diagonal(&DVector::from_element(3, 1.0)).unwrap();
        let mut filter = ExtendedKalmanFilter::new(z, unit).unwrap();
        for wrong in [of(1, 1), of(3, 1), of(2, 2)] {
            let error = filter.predict(&wrong, &none).unwrap_err();
            assert!(matches!(error, Error::NotFinite { .. }), "{error}");
        }
        assert_eq!(filter.predict(&model, &none), Ok(()));
    }

    #[test]
    fn sizes_that_overflow_are_an_error() {
        let result: Result<Augmented<_, f64, Dyn, _, _>, _> = Augmented::new((), Dyn(usize::MAX), Dyn(1));
        let error = Error::Length { argument: "augmented state", expected: usize::MAX, found: usize::MAX };
        assert_eq!(result.unwrap_err(), error);
    }
}
