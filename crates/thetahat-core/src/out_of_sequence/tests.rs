extern crate std;
use std::format;
use std::vec::Vec;

use nalgebra::{Const, Matrix2, SMatrix, SVector, Vector1, Vector2};

use crate::noise::Noise;
use crate::{
    Action, Covariance, Error, ExtendedKalmanFilter, FilterHistory, KalmanFilter, LinearObservation,
    LinearTransition, Observation, OutOfSequenceFilter, Transition,
};

const HISTORY: FilterHistory = FilterHistory { samples: 6, states: 2, outputs: 2, inputs: 1 };
type Late = OutOfSequenceFilter<f64, Const<2>, Const<2>, Const<1>, Const<{ HISTORY.numbers() }>>;

/// A state-space model with an input, two sensors with correlated noises, and a feedthrough.
type Linear =
    (LinearTransition<f64, Const<2>, Const<1>>, LinearObservation<f64, Const<2>, Const<2>, Const<1>>);

fn linear() -> Linear {
    let noise = Covariance::new(&Matrix2::new(0.1, 0.02, 0.02, 0.2)).unwrap();
    let motion = LinearTransition::new(Matrix2::new(0.9, 0.2, -0.1, 0.8), noise.clone()).unwrap();
    let sensors = LinearObservation::new(Matrix2::new(1.0, 0.0, 0.3, 1.0), noise).unwrap();
    (motion.with_input(Vector2::new(0.5, 1.0)).unwrap(), sensors.with_input(Vector2::new(0.0, 0.1)).unwrap())
}

/// One that is not: the state bends, and a sensor too.
struct Bent;

impl Transition<f64, Const<2>, Const<1>> for Bent {
    fn next(&self, x: &Vector2<f64>, u: &Vector1<f64>) -> Vector2<f64> {
        Vector2::new(x.x + 0.1 * x.y, x.y - 0.1 * x.x.powi(3) + u.x)
    }

    fn next_jacobian(&self, x: &Vector2<f64>, _: &Vector1<f64>) -> Matrix2<f64> {
        Matrix2::new(1.0, 0.1, -0.3 * x.x * x.x, 1.0)
    }

    fn process_noise(&self, _: &Vector2<f64>, _: &Vector1<f64>) -> Covariance<f64, Const<2>> {
        Covariance::from_diagonal(&Vector2::new(0.01, 0.02)).unwrap()
    }
}

impl Observation<f64, Const<2>, Const<2>, Const<1>> for Bent {
    fn output(&self, x: &Vector2<f64>, u: &Vector1<f64>) -> Vector2<f64> {
        Vector2::new(x.x + 0.1 * x.x * x.x, x.y + 0.1 * u.x)
    }

    fn output_jacobian(&self, x: &Vector2<f64>, _: &Vector1<f64>) -> SMatrix<f64, 2, 2> {
        Matrix2::new(1.0 + 0.2 * x.x, 0.0, 0.0, 1.0)
    }

    fn measurement_noise(&self, _: &Vector2<f64>, _: &Vector1<f64>) -> Covariance<f64, Const<2>> {
        Covariance::from_diagonal(&Vector2::new(0.1, 0.1)).unwrap()
    }
}

fn prior() -> KalmanFilter<f64, Const<2>> {
    let covariance = Covariance::from_diagonal(&Vector2::new(4.0, 4.0)).unwrap();
    KalmanFilter::new(Vector2::new(1.0, 0.0), covariance).unwrap()
}

/// After each late measurement the filter is, to the bit, the one that had it in time.
fn check(
    start: ExtendedKalmanFilter<f64, Const<2>>,
    motion: &impl Transition<f64, Const<2>, Const<1>>,
    sensors: &impl Observation<f64, Const<2>, Const<2>, Const<1>>,
) {
    let mut noise = Noise(1);
    let mut late = Late::new(start.clone(), Const, Const, HISTORY.samples).unwrap();
    // What had come of each sample, and its input.
    let mut known: Vec<(Vector2<f64>, Vector1<f64>)> = Vec::new();
    let mut actions = Vec::new();
    for k in 0..200_usize {
        let u = Vector1::new(noise.next());
        let mut measurement = Vector2::from_fn(|_, _| 3.0 * noise.next());
        let mut withheld = Vector2::repeat(f64::NAN);
        for index in 0..2 {
            if noise.next() < 0.0 {
                core::mem::swap(&mut measurement[index], &mut withheld[index]);
            }
        }
        // Some come a little later in the same sample.
        if noise.next() < 0.0 {
            late.correct(sensors, &u, &measurement).unwrap();
        } else {
            late.correct(sensors, &u, &Vector2::new(measurement[0], f64::NAN)).unwrap();
            late.correct(sensors, &u, &Vector2::new(f64::NAN, measurement[1])).unwrap();
        }
        known.push((measurement, u));
        let age = (k % HISTORY.samples) + 1;
        if age <= late.kept() {
            let missing =
                known[k - age].0.map(|element| if element.is_nan() { noise.next() } else { f64::NAN });
            let innovation = late.correct_late(motion, sensors, age, &missing).unwrap();
            for index in 0..2 {
                if !missing[index].is_nan() {
                    known[k - age].0[index] = missing[index];
                }
            }
            actions.push(innovation.action);
        }
        let mut in_time = start.clone();
        for (index, (measurement, u)) in known.iter().enumerate() {
            in_time.correct(sensors, u, measurement).unwrap();
            if index < k {
                in_time.predict(motion, u).unwrap();
            }
        }
        assert_eq!(late.filter(), &in_time, "{k}");
        late.predict(motion, &u).unwrap();
        in_time.predict(motion, &u).unwrap();
        assert_eq!(late.filter(), &in_time, "{k}");
    }
    assert!(actions.contains(&Action::Updated));
}

#[test]
fn it_is_to_the_bit_the_filter_that_had_all_in_time() {
    let (motion, sensors) = linear();
    check(prior().into(), &motion, &sensors);
    // The gate closes and lets go.
    check(prior().with_gate(3.0).unwrap().with_release(2).into(), &motion, &sensors);
    check(prior().into(), &Bent, &Bent);
    check(ExtendedKalmanFilter::from(prior()).with_iterations(3).unwrap(), &Bent, &Bent);
}

#[test]
fn what_comes_too_late_from_the_future_or_twice_is_refused() {
    let (motion, sensors) = linear();
    let mut late = Late::new(prior(), Const, Const, HISTORY.samples).unwrap();
    let (u, all) = (Vector1::new(0.5), Vector2::new(1.0, 2.0));
    let first = Vector2::new(1.0, f64::NAN);
    let age = |error| matches!(error, Error::OutOfRange { argument: "age", .. });
    // There is nothing before the first sample.
    assert!(age(late.correct_late(&motion, &sensors, 1, &all).unwrap_err()));
    for k in 0..20 {
        late.correct(&sensors, &u, &first).unwrap();
        let before = format!("{late:?}");
        let kept = k.min(HISTORY.samples);
        assert_eq!(late.kept(), kept);
        for wrong in [0, kept + 1, usize::MAX] {
            assert!(age(late.correct_late(&motion, &sensors, wrong, &all).unwrap_err()), "{wrong}");
        }
        let twice = late.correct(&sensors, &u, &all).unwrap_err();
        assert!(matches!(twice, Error::OutOfRange { argument: "measurement", .. }));
        if kept > 0 {
            let twice = late.correct_late(&motion, &sensors, kept, &all).unwrap_err();
            assert!(matches!(twice, Error::OutOfRange { argument: "measurement", .. }));
            let infinite = Vector2::new(f64::NAN, f64::INFINITY);
            let error = late.correct_late(&motion, &sensors, kept, &infinite).unwrap_err();
            assert_eq!(error, Error::Infinite { argument: "measurement" });
            // Nothing in it: nothing changes.
            let none = Vector2::repeat(f64::NAN);
            late.correct_late(&motion, &sensors, kept, &none).unwrap();
        }
        assert!(late.predict(&motion, &Vector1::new(f64::NAN)).is_err());
        assert_eq!(format!("{late:?}"), before);
        late.predict(&motion, &u).unwrap();
    }
    let second = Vector2::new(f64::NAN, 2.0);
    late.correct_late(&motion, &sensors, 3, &second).unwrap();
    assert!(late.correct_late(&motion, &sensors, 3, &second).is_err());
}

/// A transition that fails from some state on.
struct Failing(LinearTransition<f64, Const<2>, Const<1>>);

impl Transition<f64, Const<2>, Const<1>> for Failing {
    fn next(&self, x: &Vector2<f64>, u: &Vector1<f64>) -> Vector2<f64> {
        if x.y > 50.0 { Vector2::repeat(f64::NAN) } else { self.0.next(x, u) }
    }

    fn next_jacobian(&self, x: &Vector2<f64>, u: &Vector1<f64>) -> Matrix2<f64> {
        self.0.next_jacobian(x, u)
    }

    fn process_noise(&self, x: &Vector2<f64>, u: &Vector1<f64>) -> Covariance<f64, Const<2>> {
        self.0.process_noise(x, u)
    }
}

#[test]
fn what_fails_on_the_way_changes_nothing() {
    let (motion, sensors) = linear();
    let motion = Failing(motion);
    let mut late = Late::new(prior(), Const, Const, HISTORY.samples).unwrap();
    for _ in 0..4 {
        late.correct(&sensors, &Vector1::new(0.0), &Vector2::new(1.0, f64::NAN)).unwrap();
        late.predict(&motion, &Vector1::new(0.0)).unwrap();
    }
    let before = format!("{late:?}");
    let outlier = Vector2::new(f64::NAN, 1e5);
    let error = late.correct_late(&motion, &sensors, 3, &outlier).unwrap_err();
    assert_eq!(error, Error::NotFinite { argument: "next state" });
    assert_eq!(format!("{late:?}"), before);
}

#[test]
fn sizes_are_checked() {
    let small: Result<OutOfSequenceFilter<f64, Const<2>, Const<2>, Const<1>, Const<8>>, _> =
        OutOfSequenceFilter::new(prior(), Const, Const, 1);
    assert_eq!(small.unwrap_err(), Error::Length { argument: "B", expected: 18, found: 8 });
    for samples in [0, usize::MAX, usize::MAX / 2] {
        let error = Late::new(prior(), Const, Const, samples).unwrap_err();
        assert!(matches!(error, Error::OutOfRange { argument: "samples", .. }), "{samples}");
    }
    let none = SVector::<f64, 0>::zeros();
    let one = Covariance::<f64, Const<1>>::from_diagonal(&Vector1::new(1.0)).unwrap();
    let walk = LinearTransition::new(Vector1::new(1.0), one.clone()).unwrap();
    let mut single: OutOfSequenceFilter<f64, Const<1>, Const<1>, Const<0>, Const<20>> =
        OutOfSequenceFilter::new(KalmanFilter::new(Vector1::new(0.0), one).unwrap(), Const, Const, 2)
            .unwrap();
    single.predict(&walk, &none).unwrap();
    assert_eq!(single.history().inputs, 0);
}
