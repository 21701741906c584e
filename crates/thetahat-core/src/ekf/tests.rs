extern crate std;

use nalgebra::{Const, Matrix2, RowVector2, SMatrix, SVector, Vector1, Vector2};

use crate::noise::Noise;
use crate::textbook::{random, random_covariance, stable};
use crate::{
    Action, Covariance, Error, ExtendedKalmanFilter, KalmanFilter, LinearObservation, LinearTransition,
    Observation, Real, Transition,
};

type None = SVector<f64, 0>;

/// What a model may answer wrongly.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    None,
    Value,
    Jacobian,
    Noise,
}

fn unit<const N: usize>(fault: Fault) -> Covariance<f64, Const<N>> {
    match fault {
        Fault::Noise => Covariance::unknown(Const),
        _ => Covariance::from_diagonal(&SVector::from_element(1.0)).unwrap(),
    }
}

/// A point in the plane, which stays.
struct Point(Fault);

impl Transition<f64, Const<2>> for Point {
    fn next(&self, x: &Vector2<f64>, _: &None) -> Vector2<f64> {
        if self.0 == Fault::Value { x / 0.0 } else { *x }
    }
    fn next_jacobian(&self, _: &Vector2<f64>, _: &None) -> Matrix2<f64> {
        if self.0 == Fault::Jacobian { Matrix2::from_element(f64::NAN) } else { Matrix2::identity() }
    }
    fn process_noise(&self, _: &Vector2<f64>, _: &None) -> Covariance<f64, Const<2>> {
        unit(self.0)
    }
}

/// Its distance from the origin.
struct Range {
    variance: f64,
    fault: Fault,
}

impl Observation<f64, Const<2>, Const<1>> for Range {
    fn output(&self, x: &Vector2<f64>, _: &None) -> Vector1<f64> {
        Vector1::new(if self.fault == Fault::Value { f64::NAN } else { x.norm() })
    }
    fn output_jacobian(&self, x: &Vector2<f64>, _: &None) -> RowVector2<f64> {
        if self.fault == Fault::Jacobian {
            RowVector2::new(f64::INFINITY, 0.0)
        } else {
            x.transpose() / x.norm()
        }
    }
    fn measurement_noise(&self, _: &Vector2<f64>, _: &None) -> Covariance<f64, Const<1>> {
        match self.fault {
            Fault::Noise => Covariance::unknown(Const),
            _ => Covariance::from_diagonal(&Vector1::new(self.variance)).unwrap(),
        }
    }
}

fn check_linear_model<T: Real, const N: usize, const M: usize>(seed: u64) {
    let mut noise = Noise(seed);
    let matrix = |noise: &mut Noise| -> SMatrix<T, N, N> { nalgebra::convert(random_covariance::<N>(noise)) };
    let f: SMatrix<T, N, N> = nalgebra::convert(stable::<N>(&mut noise, 1.0));
    let g: SMatrix<T, N, 2> = nalgebra::convert(random::<N, 2>(&mut noise));
    let h: SMatrix<T, M, N> = nalgebra::convert(random::<M, N>(&mut noise));
    let d: SMatrix<T, M, 2> = nalgebra::convert(random::<M, 2>(&mut noise));
    let r: SMatrix<T, M, M> = nalgebra::convert(random_covariance::<M>(&mut noise));
    let q = Covariance::new(&matrix(&mut noise)).unwrap();
    let model = LinearTransition::new(f, q).unwrap().with_input(g).unwrap();
    let sensor = LinearObservation::new(h, Covariance::new(&r).unwrap()).unwrap().with_input(d).unwrap();
    let start: SVector<T, N> = nalgebra::convert(random::<N, 1>(&mut noise));
    let prior = Covariance::new(&(matrix(&mut noise) * nalgebra::convert::<f64, T>(100.0))).unwrap();
    let gate = nalgebra::convert(20.0);

    let mut filter =
        KalmanFilter::new(start, prior.clone()).unwrap().with_gate(gate).unwrap().with_release(1);
    let mut extended =
        ExtendedKalmanFilter::new(start, prior).unwrap().with_gate(gate).unwrap().with_release(1);
    let (mut gated, mut released) = (0, 0);
    for k in 0..60 {
        let u: SVector<T, 2> = nalgebra::convert(random::<2, 1>(&mut noise));
        let mut y: SVector<T, M> = nalgebra::convert(random::<M, 1>(&mut noise));
        match k % 15 {
            1 | 6 | 11 => y[k % M] = T::NAN,
            2 | 7 | 8 | 9 => y *= nalgebra::convert::<f64, T>(60.0),
            _ => (),
        }
        filter.predict(&model, &u).unwrap();
        extended.predict(&model, &u).unwrap();
        let innovation = filter.correct(&sensor, &u, &y).unwrap();
        // About the estimate of its own each is linearised exactly, so that iterations change nothing.
        let mut iterated = extended.clone().with_iterations(3).unwrap();
        iterated.correct(&sensor, &u, &y).unwrap();
        let found = extended.correct(&sensor, &u, &y).unwrap();
        assert_eq!((innovation.nis, innovation.action), (found.nis, found.action));
        assert!((0..M).all(|i| y[i].partial_cmp(&y[i]).is_none() || innovation.error[i] == found.error[i]));
        assert_eq!(filter.state(), extended.state());
        assert_eq!(filter.covariance(), extended.covariance());
        assert_eq!(filter.gated_in_a_row(), extended.gated_in_a_row());
        assert_eq!(filter.gated_in_a_row(), iterated.gated_in_a_row());
        assert_eq!((iterated.gate(), iterated.release()), (gate, 1));
        let tolerance = T::EPSILON * nalgebra::convert::<f64, T>(100.0) * (T::one() + filter.state().amax());
        assert!((iterated.state() - filter.state()).amax() < tolerance);
        assert_eq!(iterated.covariance(), filter.covariance());
        gated += usize::from(found.action == Action::Gated);
        released += usize::from(found.action == Action::Released);
    }
    assert!(gated > 0 && released > 0, "{gated} {released}");
}

#[test]
fn on_a_linear_model_it_is_the_kalman_filter_to_the_bit() {
    check_linear_model::<f64, 3, 2>(1);
    check_linear_model::<f64, 5, 1>(2);
    check_linear_model::<f32, 2, 3>(3);
}

/// The gradient of -ln p(x | y), whose zero is the most probable state.
fn gradient(x: &Vector2<f64>, mean: &Vector2<f64>, p: &Matrix2<f64>, y: f64, variance: f64) -> Vector2<f64> {
    crate::textbook::inverse(p) * (x - mean) - x / x.norm() * (y - x.norm()) / variance
}

#[test]
fn iterations_go_to_the_most_probable_state() {
    let (mean, p) = (Vector2::new(3.0, 1.0), Matrix2::new(1.0, 0.3, 0.3, 2.0));
    let (sensor, y) = (Range { variance: 1e-4, fault: Fault::None }, 4.5);
    let corrected = |iterations| {
        let filter = ExtendedKalmanFilter::new(mean, Covariance::new(&p).unwrap()).unwrap();
        let mut filter = filter.with_iterations(iterations).unwrap();
        assert_eq!(filter.iterations(), iterations);
        let innovation = filter.correct(&sensor, &None::zeros(), &Vector1::new(y)).unwrap();
        // That of the first linearisation.
        assert_eq!(innovation.error[0], y - mean.norm());
        let row = mean.transpose() / mean.norm();
        let expected = (row * p * row.transpose())[0] + 1e-4;
        assert!((innovation.variance[0] - expected).abs() < 1e-14);
        assert_eq!(innovation.action, Action::Updated);
        filter
    };
    let sizes = [1, 2, 3, 20].map(|iterations| {
        let filter = corrected(iterations);
        gradient(filter.state(), &mean, &p, y, 1e-4).norm()
    });
    assert!(sizes[0] > 100.0 && sizes[1] < 0.2 * sizes[0] && sizes[2] < sizes[1], "{sizes:?}");
    assert!(sizes[3] < 1e-8, "{sizes:?}");

    // P is that of the last linearisation, at the point itself.
    let filter = corrected(20);
    let row = filter.state().transpose() / filter.state().norm();
    let gain = p * row.transpose() / ((row * p * row.transpose())[0] + 1e-4);
    let expected = p - gain * row * p;
    assert!((filter.covariance().matrix() - expected).amax() < 1e-10);
}

/// The arc tangent of a number, measured.
struct Saturating(f64);

impl Observation<f64, Const<1>, Const<1>> for Saturating {
    fn output(&self, x: &Vector1<f64>, _: &None) -> Vector1<f64> {
        x.map(f64::atan)
    }
    fn output_jacobian(&self, x: &Vector1<f64>, _: &None) -> Vector1<f64> {
        Vector1::new(1.0 / (1.0 + x[0] * x[0]))
    }
    fn measurement_noise(&self, _: &Vector1<f64>, _: &None) -> Covariance<f64, Const<1>> {
        Covariance::from_diagonal(&Vector1::new(self.0)).unwrap()
    }
}

/// Newton's method on the arc tangent goes away from 0 if it starts beyond 1.39: so do whole Gauss-Newton steps.
#[test]
fn steps_are_shortened_where_whole_ones_go_away() {
    for (start, truth, variance) in [(4.0, 0.0, 1e-6), (-20.0, 0.5, 1e-6), (3.0, -0.2, 0.0), (2.0, 1.9, 1e-8)]
    {
        let prior = Covariance::from_diagonal(&Vector1::new(1e4)).unwrap();
        let y = Vector1::new(f64::atan(truth));
        let (mut x, mut whole) = (start, 0.0_f64);
        for _ in 0..6 {
            x += (y[0] - f64::atan(x)) * (1.0 + x * x);
            whole = whole.max((x - truth).abs());
        }
        let filter = ExtendedKalmanFilter::new(Vector1::new(start), prior).unwrap();
        let mut filter = filter.with_iterations(50).unwrap();
        filter.correct(&Saturating(variance), &None::zeros(), &y).unwrap();
        let found = filter.state()[0];
        assert!((found - truth).abs() < 1e-4, "{start} {truth} {variance}: {found}");
        assert!(truth == 1.9 || whole > 1e3, "{start} {truth}: {whole}");
    }
}

#[test]
fn what_is_gated_or_missing_is_not_iterated() {
    let prior = Covariance::from_diagonal(&Vector2::new(1.0, 1.0)).unwrap();
    let filter = ExtendedKalmanFilter::new(Vector2::new(3.0, 4.0), prior).unwrap();
    let mut filter = filter.with_iterations(3).unwrap().with_gate(4.0).unwrap();
    let (before, sensor) = (filter.clone(), Range { variance: 1.0, fault: Fault::None });
    let innovation = filter.correct(&sensor, &None::zeros(), &Vector1::new(8.0)).unwrap();
    assert_eq!(innovation.action, Action::Gated);
    assert!((innovation.nis - 4.5).abs() < 1e-14);
    assert_eq!(filter.gated_in_a_row(), 1);
    assert_eq!((filter.state(), filter.covariance()), (before.state(), before.covariance()));
    let before = filter.clone();
    let innovation = filter.correct(&sensor, &None::zeros(), &Vector1::new(f64::NAN)).unwrap();
    assert_eq!((innovation.action, innovation.nis), (Action::Missing, 0.0));
    assert_eq!(filter, before);
    // The gate is still there afterwards.
    assert_eq!(filter.correct(&sensor, &None::zeros(), &Vector1::new(6.0)).unwrap().action, Action::Updated);
    assert_eq!((filter.gate(), filter.iterations()), (4.0, 3));
}

#[test]
fn errors_name_what_the_model_got_wrong_and_change_nothing() {
    let prior = Covariance::from_diagonal(&Vector2::new(1.0, 1.0)).unwrap();
    let once = ExtendedKalmanFilter::new(Vector2::new(3.0, 4.0), prior).unwrap();
    for mut filter in [once.clone().with_iterations(3).unwrap(), once.clone()] {
        let before = filter.clone();
        let (none, y) = (None::zeros(), Vector1::new(5.0));
        for (fault, argument) in [
            (Fault::Value, "next state"),
            (Fault::Jacobian, "transition Jacobian"),
            (Fault::Noise, "transition noise"),
        ] {
            let error = filter.predict(&Point(fault), &none).unwrap_err();
            assert_eq!(error, Error::NotFinite { argument });
        }
        for (fault, argument) in [
            (Fault::Value, "predicted measurement"),
            (Fault::Jacobian, "observation Jacobian"),
            (Fault::Noise, "observation noise"),
        ] {
            let error = filter.correct(&Range { variance: 1.0, fault }, &none, &y).unwrap_err();
            assert_eq!(error, Error::NotFinite { argument });
        }
        let sensor = Range { variance: 1.0, fault: Fault::None };
        let error = filter.correct(&sensor, &none, &Vector1::new(-f64::INFINITY)).unwrap_err();
        assert_eq!(error, Error::Infinite { argument: "measurement" });
        let error = filter.correct(&sensor, &none, &Vector1::new(1e200)).unwrap_err();
        assert_eq!(error, Error::TooLarge { argument: "measurement" });
        assert_eq!(filter, before);
        assert_eq!(filter.predict(&Point(Fault::None), &none), Ok(()));
        assert!(filter.correct(&sensor, &none, &y).is_ok());
    }
    let error = Error::OutOfRange { argument: "iterations", range: "1 or more" };
    assert_eq!(once.clone().with_iterations(0).unwrap_err(), error);
    assert!(once.clone().with_gate(0.0).is_err());

    let one = Vector1::new(1.0);
    let unit = Covariance::<f64, Const<1>>::from_diagonal(&one).unwrap();
    let model = LinearTransition::new(one, unit.clone()).unwrap().with_input(one).unwrap();
    let sensor = LinearObservation::new(one, unit.clone()).unwrap().with_input(one).unwrap();
    let mut filter = ExtendedKalmanFilter::new(one, unit).unwrap();
    let bad = Vector1::new(f64::NAN);
    assert_eq!(filter.predict(&model, &bad), Err(Error::NotFinite { argument: "input" }));
    assert_eq!(filter.correct(&sensor, &bad, &one), Err(Error::NotFinite { argument: "input" }));
}

#[test]
fn a_point_is_found_from_two_ranges() {
    /// The distances from two points.
    struct Ranges;
    const BASE: [Vector2<f64>; 2] = [Vector2::new(0.0, 0.0), Vector2::new(10.0, 0.0)];
    impl Observation<f64, Const<2>, Const<2>> for Ranges {
        fn output(&self, x: &Vector2<f64>, _: &None) -> Vector2<f64> {
            Vector2::new((x - BASE[0]).norm(), (x - BASE[1]).norm())
        }
        fn output_jacobian(&self, x: &Vector2<f64>, _: &None) -> Matrix2<f64> {
            Matrix2::from_rows(&BASE.map(|base| (x - base).transpose() / (x - base).norm()))
        }
        fn measurement_noise(&self, _: &Vector2<f64>, _: &None) -> Covariance<f64, Const<2>> {
            Covariance::new(&Matrix2::new(0.01, 0.005, 0.005, 0.01)).unwrap()
        }
    }
    let (truth, mut noise) = (Vector2::new(4.0, 7.0), Noise(4));
    let prior = Covariance::from_diagonal(&Vector2::new(4.0, 4.0)).unwrap();
    let mut filter = ExtendedKalmanFilter::new(Vector2::new(5.0, 5.0), prior).unwrap();
    for k in 0..400 {
        let mut y = Ranges.output(&truth, &None::zeros()) + 0.1 * random::<2, 1>(&mut noise);
        if k % 3 == 0 {
            y[k / 3 % 2] = f64::NAN;
        }
        filter.correct(&Ranges, &None::zeros(), &y).unwrap();
    }
    assert!((filter.state() - truth).amax() < 0.03, "{}", filter.state());
}

#[cfg(feature = "alloc")]
mod dynamic {
    use nalgebra::{DMatrix, DVector, Dyn};

    use super::*;

    /// A model that answers in sizes of its own.
    struct Sized {
        value: usize,
        rows: usize,
        columns: usize,
        noise: usize,
    }

    const FITTING: Sized = Sized { value: 2, rows: 2, columns: 2, noise: 2 };

    fn unit(size: usize) -> Covariance<f64, Dyn> {
        Covariance::from_diagonal(&DVector::from_element(size, 1.0)).unwrap()
    }

    impl Transition<f64, Dyn, Dyn> for Sized {
        fn next(&self, _: &DVector<f64>, _: &DVector<f64>) -> DVector<f64> {
            DVector::zeros(self.value)
        }
        fn next_jacobian(&self, _: &DVector<f64>, _: &DVector<f64>) -> DMatrix<f64> {
            DMatrix::identity(self.rows, self.columns)
        }
        fn process_noise(&self, _: &DVector<f64>, _: &DVector<f64>) -> Covariance<f64, Dyn> {
            unit(self.noise)
        }
    }

    impl Observation<f64, Dyn, Dyn, Dyn> for Sized {
        fn output(&self, _: &DVector<f64>, _: &DVector<f64>) -> DVector<f64> {
            DVector::zeros(self.value)
        }
        fn output_jacobian(&self, _: &DVector<f64>, _: &DVector<f64>) -> DMatrix<f64> {
            DMatrix::identity(self.rows, self.columns)
        }
        fn measurement_noise(&self, _: &DVector<f64>, _: &DVector<f64>) -> Covariance<f64, Dyn> {
            unit(self.noise)
        }
    }

    #[test]
    fn sizes_that_do_not_fit_are_errors() {
        let mut filter = ExtendedKalmanFilter::new(DVector::zeros(2), unit(2)).unwrap();
        let (none, y) = (DVector::zeros(0), DVector::zeros(2));
        assert_eq!(filter.predict(&FITTING, &none), Ok(()));
        assert!(filter.correct(&FITTING, &none, &y).is_ok());
        let before = filter.clone();
        for (model, transition, observation) in [
            (Sized { value: 3, ..FITTING }, "next state", "measurement"),
            (Sized { rows: 3, ..FITTING }, "transition Jacobian", "observation Jacobian"),
            (Sized { columns: 1, ..FITTING }, "transition Jacobian", "observation Jacobian"),
            (Sized { noise: 1, ..FITTING }, "transition noise", "observation noise"),
        ] {
            let error = filter.predict(&model, &none).unwrap_err();
            assert!(matches!(error, Error::Length { argument, .. } if argument == transition), "{error}");
            let error = filter.correct(&model, &none, &y).unwrap_err();
            assert!(matches!(error, Error::Length { argument, .. } if argument == observation), "{error}");
        }
        assert_eq!(filter, before);
    }
}
