extern crate std;

use nalgebra::{Const, Matrix2, Matrix3, RowVector3, SMatrix, SVector, Vector1, Vector2, Vector3};

use crate::noise::Noise;
use crate::{
    Action, Covariance, Error, KalmanFilter, LinearObservation, LinearTransition, Observation, Real,
    Transition, ZonotopeFilter,
};

type None<T> = SVector<T, 0>;

/// A lightly damped oscillation with a drifting offset, seen by two sensors.
fn model<T: Real>() -> (LinearTransition<T, Const<3>>, LinearObservation<T, Const<3>, Const<2>>) {
    let f = Matrix3::new(0.95, 0.3, 0.0, -0.28, 0.94, 0.0, 0.0, 0.0, 1.0).map(nalgebra::convert);
    let h =
        SMatrix::<f64, 2, 3>::from_rows(&[RowVector3::new(1.0, 0.0, 1.0), RowVector3::new(0.0, 1.0, 0.0)]);
    // Variances of uniform noise within the bounds, for the Kalman filter beside it.
    let q = Covariance::from_diagonal(&W.map(|bound| nalgebra::convert(bound * bound / 3.0))).unwrap();
    let r = Covariance::from_diagonal(&V.map(|bound| nalgebra::convert(bound * bound / 3.0))).unwrap();
    (LinearTransition::new(f, q).unwrap(), LinearObservation::new(h.map(nalgebra::convert), r).unwrap())
}

const W: Vector3<f64> = Vector3::new(0.02, 0.02, 0.001);
const V: Vector2<f64> = Vector2::new(0.3, 0.5);

/// What a long run found: the largest distance of the state from the centre, in units of the reach; the mean reach of
/// each state; and the mean of 1.96 standard deviations of a Kalman filter beside it.
fn long_run<T: Real>(steps: usize, extreme: bool) -> (f64, Vector3<f64>, Vector3<f64>) {
    let (transition, observation) = model::<T>();
    let (exact, sensors) = model::<f64>();
    let none = None::<T>::zeros();
    let convert = |value: f64| -> T { nalgebra::convert(value) };
    let double = |value: T| -> f64 { nalgebra::try_convert(value).unwrap() };
    let start = Vector3::repeat(5.0);
    let mut filter: ZonotopeFilter<T, Const<3>, Const<30>> =
        ZonotopeFilter::new(SVector::zeros(), &start.map(convert), Const).unwrap();
    let prior = Covariance::from_diagonal(&start.map(|reach| reach * reach / 3.0)).unwrap();
    let mut kalman = KalmanFilter::new(Vector3::zeros(), prior).unwrap();
    let mut noise = Noise(17);
    // Uniform, or always at a bound.
    let mut draw = |bound: f64| bound * if extreme { noise.next().signum() } else { noise.next() };
    let mut truth = start.map(&mut draw);
    let (mut worst, mut reach, mut interval) = (0.0_f64, Vector3::zeros(), Vector3::zeros());
    for step in 0..steps {
        truth = exact.next(&truth, &SVector::zeros()) + W.map(&mut draw);
        let mut y = sensors.output(&truth, &SVector::zeros()) + V.map(&mut draw);
        if step % 7 == 3 {
            y[step % 2] = f64::NAN;
        }
        filter.predict(&transition, &W.map(convert), &none).unwrap();
        let told = filter.correct(&observation, &V.map(convert), &none, &y.map(convert)).unwrap();
        assert_eq!(told.contradiction, Option::None, "at {step}");
        kalman.predict(&exact, &SVector::zeros()).unwrap();
        kalman.correct(&sensors, &SVector::zeros(), &y).unwrap();
        let (centre, reaches) = (filter.centre().map(double), filter.reaches().map(double));
        for state in 0..3 {
            worst = worst.max((truth[state] - centre[state]).abs() / reaches[state]);
        }
        reach += reaches;
        interval += kalman.covariance().variances().map(|variance| 1.96 * variance.sqrt());
    }
    (worst, reach / steps as f64, interval / steps as f64)
}

/// `SOAK_STEPS` says how many steps, 20,000 without it; `make soak` takes a million.
#[test]
fn the_state_is_inside_at_every_step() {
    let steps = std::env::var("SOAK_STEPS").map_or(20_000, |text| text.parse().unwrap());
    for extreme in [false, true] {
        let (worst, reach, interval) = long_run::<f64>(steps, extreme);
        let ratio: Vector3<f64> = reach.component_div(&interval);
        std::println!(
            "{steps} steps, extreme {extreme}: at most {worst:.3} of the reach; reaches {:?}, 1.96 deviations of a \
             Kalman filter {:?}",
            reach.as_slice(),
            interval.as_slice()
        );
        assert!(worst <= 1.0, "{worst}");
        // The offset is worst: its noise is a thousandth of that of the sensor that sees it.
        assert!(ratio.max() < 70.0 && ratio.min() > 1.0, "{ratio}");
        let (single, narrow, _) = long_run::<f32>(steps, extreme);
        assert!(single <= 1.0 && (narrow - reach).amax() < 0.05, "{single} {narrow} {reach}");
    }
}

/// With one state the zonotope is an interval, and every operation is exact.
#[test]
fn with_one_state_it_is_the_intersection_of_intervals() {
    let variance = Covariance::<f64, Const<1>>::zero(Const);
    let transition = LinearTransition::new(Vector1::new(0.9), variance.clone()).unwrap();
    let observation = LinearObservation::new(Vector1::new(2.0), variance).unwrap();
    let mut filter: ZonotopeFilter<f64, Const<1>, Const<3>> =
        ZonotopeFilter::new(Vector1::new(1.0), &Vector1::new(4.0), Const).unwrap();
    let (mut low, mut high, mut noise, mut truth) = (-3.0_f64, 5.0_f64, Noise(2), 2.0);
    for _ in 0..200 {
        truth = 0.9 * truth + 0.5 * noise.next();
        (low, high) = (0.9 * low - 0.5, 0.9 * high + 0.5);
        filter.predict(&transition, &Vector1::new(0.5), &None::zeros()).unwrap();
        let y = 2.0 * truth + 0.7 * noise.next();
        (low, high) = (low.max((y - 0.7) / 2.0), high.min((y + 0.7) / 2.0));
        filter.correct(&observation, &Vector1::new(0.7), &None::zeros(), &Vector1::new(y)).unwrap();
        let (centre, reach) = (filter.centre()[0], filter.reaches()[0]);
        assert!((centre - reach - low).abs() < 1e-12 && (centre + reach - high).abs() < 1e-12);
        assert!(centre - reach <= truth && truth <= centre + reach);
    }
}

#[test]
fn a_measurement_that_no_state_explains_is_told() {
    let (transition, observation) = model::<f64>();
    let none = None::zeros();
    let mut filter: ZonotopeFilter<f64, Const<3>, Const<20>> =
        ZonotopeFilter::new(Vector3::zeros(), &Vector3::repeat(1.0), Const).unwrap();
    filter.predict(&transition, &W, &none).unwrap();
    let before = filter.clone();
    // The first output may reach 0.95 + 0.3 + 1 + bounds, the second less.
    let told = filter.correct(&observation, &V, &none, &Vector2::new(0.1, 1.8)).unwrap();
    assert_eq!((told.contradiction, told.action), (Some(1), Action::Gated));
    assert!(
        (told.bound - Vector2::new(0.95 + 0.3 + 1.0 + 0.021 + 0.3, 0.28 + 0.94 + 0.02 + 0.5)).amax() < 1e-12
    );
    assert_eq!(filter, before);
    let told = filter.correct(&observation, &V, &none, &Vector2::new(f64::NAN, f64::NAN)).unwrap();
    assert_eq!((told.contradiction, told.action), (Option::None, Action::Missing));
    assert_eq!(filter, before);
    let told = filter.correct(&observation, &V, &none, &Vector2::new(0.1, 1.7)).unwrap();
    assert_eq!((told.contradiction, told.action), (Option::None, Action::Updated));
}

#[test]
fn errors_change_nothing() {
    let (transition, observation) = model::<f64>();
    let none = None::zeros();
    type Small = ZonotopeFilter<f64, Const<3>, Const<7>>;
    let mut filter = Small::new(Vector3::zeros(), &Vector3::repeat(1.0), Const).unwrap();
    let (before, y) = (filter.clone(), Vector2::zeros());
    let wrong = Vector3::new(0.0, f64::NAN, 0.0);
    assert_eq!(filter.predict(&transition, &wrong, &none), Err(Error::NotFinite { argument: "bounds" }));
    assert_eq!(filter.predict(&transition, &-W, &none), Err(Error::Negative { argument: "bounds" }));
    let error = filter.correct(&observation, &-V, &none, &y).unwrap_err();
    assert_eq!(error, Error::Negative { argument: "bounds" });
    let error = filter.correct(&observation, &V, &none, &Vector2::new(0.0, f64::INFINITY)).unwrap_err();
    assert_eq!(error, Error::Infinite { argument: "measurement" });
    let huge = Matrix2::identity() * 1e300;
    assert_eq!(filter, before);
    let blown = LinearTransition::new(huge, Covariance::<f64, Const<2>>::zero(Const)).unwrap();
    let mut two: ZonotopeFilter<f64, Const<2>, Const<5>> =
        ZonotopeFilter::new(Vector2::repeat(1e10), &Vector2::repeat(1.0), Const).unwrap();
    assert_eq!(two.predict(&blown, &Vector2::zeros(), &none), Err(Error::Overflow));
    let few = ZonotopeFilter::<f64, Const<3>, Const<6>>::new(Vector3::zeros(), &Vector3::zeros(), Const);
    assert_eq!(few.unwrap_err(), Error::OutOfRange { argument: "generators", range: "2 n + 1 or more" });
    let error = Small::new(Vector3::zeros(), &-W, Const).unwrap_err();
    assert_eq!(error, Error::Negative { argument: "reaches" });
    // The smallest number of generators will do.
    for _ in 0..50 {
        filter.predict(&transition, &W, &none).unwrap();
        filter.correct(&observation, &V, &none, &y).unwrap();
        assert_eq!(filter.generators().len() % 3, 0);
    }
    assert!(filter.reaches()[1] < 0.75, "{}", filter.reaches());
}
