//! Time is the order of the calls.

extern crate std;
use std::vec::Vec;

use nalgebra::{Const, SVector};

use super::{FORGETTING, debug, one};
use crate::noise::Noise;
use crate::{
    Action, ArmaxMethod, ArmaxOrders, ArxOrders, Error, Forgetting, Innovation, RecursiveArmax, RecursiveArx,
    RecursiveLeastSquares,
};

type Arx = RecursiveArx<f64, Const<5>, Const<4>>;
type Armax = RecursiveArmax<f64, Const<6>, Const<4>>;

const METHODS: [ArmaxMethod; 2] = [ArmaxMethod::ExtendedLeastSquares, ArmaxMethod::PredictionError];

fn arx() -> Arx {
    let orders = ArxOrders { na: 2, inputs: &[one(1, 1), one(1, 3)], constant: true };
    RecursiveArx::new(&orders, 2.0, &[1.0, 10.0], FORGETTING).unwrap()
}

fn armax(method: ArmaxMethod) -> Armax {
    let orders = ArmaxOrders { na: 2, inputs: &[one(1, 1), one(1, 3)], nc: 1, constant: true };
    RecursiveArmax::new(&orders, method, 2.0, &[1.0, 10.0], 0.5, FORGETTING).unwrap()
}

/// What the two estimators have in common.
trait Estimator: Clone + std::fmt::Debug {
    fn measured(&mut self, output: f64) -> Result<Innovation<f64>, Error>;
    fn applied(&mut self, inputs: &[f64]) -> Result<(), Error>;
    fn log_row(&mut self, output: f64, inputs: &[f64]) -> Result<Innovation<f64>, Error>;
    fn predict(&self, future_inputs: &[f64], outputs: &mut [f64]) -> Result<(), Error>;
    fn gap(&mut self);
}

macro_rules! estimator {
    ($type:ty) => {
        impl Estimator for $type {
            fn measured(&mut self, output: f64) -> Result<Innovation<f64>, Error> {
                <$type>::measured(self, output)
            }
            fn applied(&mut self, inputs: &[f64]) -> Result<(), Error> {
                <$type>::applied(self, inputs)
            }
            fn log_row(&mut self, output: f64, inputs: &[f64]) -> Result<Innovation<f64>, Error> {
                <$type>::log_row(self, output, inputs)
            }
            fn predict(&self, future_inputs: &[f64], outputs: &mut [f64]) -> Result<(), Error> {
                <$type>::predict(self, future_inputs, outputs)
            }
            fn gap(&mut self) {
                <$type>::gap(self)
            }
        }
    };
}

estimator!(Arx);
estimator!(Armax);

/// A sample that is missing one time in thirty.
fn sample(noise: &mut Noise) -> f64 {
    let value = noise.next();
    if noise.next() < -0.93 { f64::NAN } else { value }
}

fn a_row_is_a_measurement_and_then_inputs(estimator: impl Estimator) {
    let (mut rows, mut moments, mut noise) = (estimator.clone(), estimator, Noise(1));
    for k in 0..500 {
        if k == 250 {
            rows.gap();
            moments.gap();
        }
        let (y, u) = (sample(&mut noise), [sample(&mut noise), sample(&mut noise)]);
        let expected = rows.log_row(y, &u).unwrap();
        assert_eq!(debug(&moments.measured(y).unwrap()), debug(&expected));

        // After the measurement u(k) is the first of the inputs to come; after the inputs, u(k+1) is.
        let future: Vec<f64> = (0..6).map(|_| noise.next()).collect();
        let (mut after_measured, mut after_applied) = ([0.0; 4], [0.0; 4]);
        moments.predict(&[&u, &future[..]].concat(), &mut after_measured).unwrap();
        moments.applied(&u).unwrap();
        moments.predict(&[&future[..], &[9.0, 9.0]].concat(), &mut after_applied).unwrap();
        assert_eq!(debug(&after_measured), debug(&after_applied), "{k}");

        assert_eq!(debug(&rows), debug(&moments));
    }
}

fn a_call_that_is_left_out_is_a_missing_sample(estimator: impl Estimator) {
    let (mut full, mut sparse, mut noise) = (estimator.clone(), estimator, Noise(2));
    let mut actions = [0; 3];
    for k in 0..500 {
        let (y, u) = (noise.next(), [noise.next(), noise.next()]);
        let (with_output, with_inputs) = (k % 20 != 7, k % 20 != 13);
        let y = if with_output { y } else { f64::NAN };
        let action = full.measured(y).unwrap().action;
        if with_output {
            assert_eq!(sparse.measured(y).unwrap().action, action);
        }
        let u = if with_inputs { u } else { [f64::NAN; 2] };
        full.applied(&u).unwrap();
        if with_inputs {
            sparse.applied(&u).unwrap();
        }
        if with_inputs {
            assert_eq!(debug(&full), debug(&sparse), "{k}");
        }
        actions[0] += usize::from(action == Action::Updated);
        actions[1] += usize::from(action == Action::Missing);
        actions[2] += usize::from(action == Action::NotReady);
    }
    assert!(actions.iter().all(|&count| count > 20), "{actions:?}");
}

#[test]
fn a_row_of_a_log_is_a_measurement_and_then_inputs_to_the_bit() {
    a_row_is_a_measurement_and_then_inputs(arx());
    METHODS.into_iter().for_each(|method| a_row_is_a_measurement_and_then_inputs(armax(method)));
}

#[test]
fn calls_that_are_left_out_are_missing_samples() {
    a_call_that_is_left_out_is_a_missing_sample(arx());
    METHODS.into_iter().for_each(|method| a_call_that_is_left_out_is_a_missing_sample(armax(method)));
}

#[test]
fn an_input_that_acts_at_once_is_needed_before_the_output() {
    let inputs = [one(1, 1), one(1, 0)];
    let refused = Error::InputFirst { input: 1 };
    let orders = ArxOrders { na: 1, inputs: &inputs, constant: false };
    let mut arx: RecursiveArx<f64, Const<3>> =
        RecursiveArx::new(&orders, 1.0, &[1.0, 1.0], FORGETTING).unwrap();
    let orders = ArmaxOrders { na: 1, inputs: &inputs, nc: 1, constant: false };
    let mut armax: RecursiveArmax<f64, Const<4>> =
        RecursiveArmax::new(&orders, METHODS[0], 1.0, &[1.0, 1.0], 0.5, FORGETTING).unwrap();
    let mut noise = Noise(3);
    for _ in 0..50 {
        let (y, u) = (noise.next(), [noise.next(), noise.next()]);
        let before = (debug(&arx), debug(&armax));
        assert_eq!(arx.measured(y).unwrap_err(), refused);
        assert_eq!(armax.measured(y).unwrap_err(), refused);
        assert_eq!((debug(&arx), debug(&armax)), before);
        arx.log_row(y, &u).unwrap();
        armax.log_row(y, &u).unwrap();
    }
    // Inputs alone: the output of their sample is missing.
    let (mut rows, u) = (arx.clone(), [0.5, -0.5]);
    arx.applied(&u).unwrap();
    assert_eq!(rows.log_row(f64::NAN, &u).unwrap().action, Action::Missing);
    assert_eq!(debug(&arx), debug(&rows));
    // An input that is read and not used does not ask for anything.
    let orders = ArxOrders { na: 1, inputs: &[one(0, 0)], constant: false };
    let mut arx: RecursiveArx<f64, Const<1>> = RecursiveArx::new(&orders, 1.0, &[1.0], FORGETTING).unwrap();
    assert!(arx.measured(1.0).is_ok());
}

#[test]
fn refused_moments_change_nothing() {
    let (mut arx, mut armax) = (arx(), armax(METHODS[1]));
    let mut noise = Noise(4);
    for k in 0..60 {
        let before = (debug(&arx), debug(&armax));
        let length = Error::Length { argument: "inputs", expected: 2, found: 1 };
        for (y, error) in [
            (f64::INFINITY, Error::Infinite { argument: "output" }),
            (1e200, Error::TooLarge { argument: "output" }),
        ] {
            assert_eq!(arx.measured(y).unwrap_err(), error);
            assert_eq!(armax.measured(y).unwrap_err(), error);
        }
        for (u, error) in [
            (&[1.0][..], length),
            (&[1.0, f64::NEG_INFINITY], Error::Infinite { argument: "inputs" }),
            (&[1e200, 1.0], Error::TooLarge { argument: "inputs" }),
        ] {
            assert_eq!(arx.applied(u).unwrap_err(), error);
            assert_eq!(armax.applied(u).unwrap_err(), error);
        }
        assert_eq!((debug(&arx), debug(&armax)), before);
        // In both moments.
        if k % 2 == 0 {
            let y = noise.next();
            arx.measured(y).unwrap();
            armax.measured(y).unwrap();
        } else {
            let u = [noise.next(), noise.next()];
            arx.applied(&u).unwrap();
            armax.applied(&u).unwrap();
        }
    }
}

const ORDERS: ArxOrders = ArxOrders { na: 1, inputs: &[one(1, 1)], constant: false };
const FIRST_ORDER: [f64; 2] = [-0.9, 0.08];
/// The standard deviation of e.
const NOISE: f64 = 0.1;

/// 2000 samples of y(k) = 0.9 y(k-1) + 0.08 u(k-1) + e(k) + c e(k-1), under steps of the set point. The controller is
/// given y(k), u(k-1) and the set point, and returns u(k). Returns the root of the mean square of what is left to the
/// set point, without the 20 samples after each step.
fn control(seed: u64, c: f64, mut controller: impl FnMut(f64, f64, f64) -> f64) -> f64 {
    let (mut noise, mut y, mut u, mut before) = (Noise(seed), 0.0, 0.0, 0.0);
    let (mut sum, mut count) = (0.0, 0);
    for k in 0..2000 {
        let e = NOISE * noise.normal();
        y = 0.9 * y + 0.08 * u + e + c * before;
        before = e;
        // What a step of the set point asks for arrives one sample later.
        let set_point = if k / 100 % 2 == 0 { 30.0 } else { 35.0 };
        if k % 100 > 20 {
            sum += (y - set_point) * (y - set_point);
            count += 1;
        }
        u = controller(y, u, set_point);
    }
    (sum / f64::from(count)).sqrt()
}

fn within_limits(wanted: f64) -> f64 {
    if wanted.is_finite() { wanted.clamp(0.0, 100.0) } else { 50.0 }
}

/// How many of their standard errors the parameters are away from the truth.
fn away<const N: usize>(estimator: &RecursiveLeastSquares<f64, Const<N>>, truth: SVector<f64, N>) -> f64 {
    let errors = estimator.standard_errors().unwrap();
    (estimator.parameters() - truth).component_div(&errors).amax()
}

#[test]
fn a_controller_learns_its_plant_under_noise() {
    for factor in [0.98, 0.99, 0.995] {
        for seed in 0..20 {
            let mut arx: RecursiveArx<f64, Const<2>> =
                RecursiveArx::new(&ORDERS, 20.0, &[50.0], Forgetting::Exponential { factor }).unwrap();
            let rms = control(seed, 0.0, |y, _, set_point| {
                arx.measured(y).unwrap();
                let [a1, b1] = (*arx.estimator().parameters()).into();
                let u = within_limits((set_point + a1 * y) / b1);
                arx.applied(&[u]).unwrap();
                u
            });
            assert!(rms < 1.1 * NOISE, "{factor} {seed}: {rms}");
            let away = away(arx.estimator(), FIRST_ORDER.into());
            assert!(away < 3.0, "{factor} {seed}: {away}");
        }
    }
}

#[test]
fn a_controller_that_predicts_learns_its_plant_under_white_and_coloured_noise() {
    let orders = ArmaxOrders { na: 1, inputs: ORDERS.inputs, nc: 1, constant: false };
    for c in [0.0, 0.6] {
        for seed in 0..10 {
            let forgetting = Forgetting::Exponential { factor: 0.99 };
            let mut armax: RecursiveArmax<f64, Const<3>> =
                RecursiveArmax::new(&orders, METHODS[1], 20.0, &[50.0], 0.1, forgetting).unwrap();
            let rms = control(seed, c, |y, _, set_point| {
                armax.measured(y).unwrap();
                // The output of the next sample, if nothing were applied now.
                let (mut next, b1) = ([0.0], armax.estimator().parameters()[1]);
                armax.predict(&[0.0], &mut next).unwrap();
                let u = within_limits((set_point - next[0]) / b1);
                armax.applied(&[u]).unwrap();
                u
            });
            assert!(rms < 1.3 * NOISE, "{c} {seed}: {rms}");
            let away = away(armax.estimator(), [-0.9, 0.08, c].into());
            assert!(away < 3.0, "{c} {seed}: {away}");
        }
    }
}

#[test]
fn an_input_that_comes_a_sample_late_is_another_plant() {
    // What the names are there to prevent: u(k-1) given as the input of sample k.
    let mut arx: RecursiveArx<f64, Const<2>> =
        RecursiveArx::new(&ORDERS, 20.0, &[50.0], Forgetting::default()).unwrap();
    let rms = control(1, 0.0, |y, u, set_point| {
        arx.log_row(y, &[u]).unwrap();
        let [a1, b1] = (*arx.estimator().parameters()).into();
        within_limits((set_point + a1 * y) / b1)
    });
    assert!(rms > 20.0 * NOISE, "{rms}");
}

#[test]
fn noise_of_the_sensor_pulls_the_poles_in() {
    // a_1 -> -0.9 var y/(var y + var n): the figures of the doc.
    for (share, expected) in [(0.5, -0.72), (0.1, -0.891)] {
        let mut arx: RecursiveArx<f64, Const<2>> =
            RecursiveArx::new(&ORDERS, 0.2, &[1.0], Forgetting::None).unwrap();
        let (mut noise, mut y, deviation) = (Noise(5), 0.0, 0.08 / (1.0_f64 - 0.81).sqrt());
        for _ in 0..100_000 {
            arx.measured(y + share * deviation * 3.0_f64.sqrt() * noise.next()).unwrap();
            let u = noise.next().signum();
            arx.applied(&[u]).unwrap();
            y = 0.9 * y + 0.08 * u;
        }
        // Three standard errors of this many samples are 0.007.
        let found = arx.estimator().parameters()[0];
        assert!((found - expected).abs() < 0.007, "{share}: {found}");
    }
}

#[test]
fn a_constant_is_an_input_of_one() {
    let inputs = [one(2, 1), one(1, 0), one(1, 0)];
    let (plain, raised) = (
        ArxOrders { na: 1, inputs: &inputs, constant: false },
        ArxOrders { na: 1, inputs: &inputs[..2], constant: true },
    );
    let mut plain: RecursiveArx<f64, Const<5>> =
        RecursiveArx::new(&plain, 1.0, &[1.0; 3], FORGETTING).unwrap();
    let mut raised: RecursiveArx<f64, Const<5>> =
        RecursiveArx::new(&raised, 1.0, &[1.0; 2], FORGETTING).unwrap();
    assert_eq!((plain.constant(), raised.constant()), (None, Some(0.0)));
    let mut noise = Noise(6);
    for k in 0..300 {
        if k == 150 {
            plain.gap();
            raised.gap();
        }
        let (y, [u, v]) = (sample(&mut noise), [sample(&mut noise), sample(&mut noise)]);
        let expected = debug(&plain.log_row(y, &[u, v, 1.0]).unwrap());
        assert_eq!(debug(&raised.log_row(y, &[u, v]).unwrap()), expected);
        let (mut ahead, mut other) = ([0.0; 2], [0.0; 2]);
        plain.predict(&[0.1, 0.2, 1.0, 0.3, 0.4, 1.0], &mut ahead).unwrap();
        raised.predict(&[0.1, 0.2, 0.3, 0.4], &mut other).unwrap();
        assert_eq!(debug(&ahead), debug(&other));
    }
    assert_eq!(raised.constant(), Some(plain.estimator().parameters()[4]));
    assert!(raised.b(1).unwrap().eq([plain.estimator().parameters()[3]]));
}

#[test]
fn a_level_is_found_in_the_loop() {
    // y(k) = 0.9 y(k-1) + 0.08 u(k-1) + 2 + e(k): an ambient temperature of 20.
    let orders = ArxOrders { constant: true, ..ORDERS };
    for seed in 0..10 {
        let mut arx: RecursiveArx<f64, Const<3>> =
            RecursiveArx::new(&orders, 20.0, &[50.0], Forgetting::Exponential { factor: 0.998 }).unwrap();
        control(seed, 0.0, |y, _, set_point| {
            let y = y + 20.0;
            arx.measured(y).unwrap();
            let [a1, b1, constant] = (*arx.estimator().parameters()).into();
            let u = within_limits((set_point + 20.0 + a1 * y - constant) / b1);
            arx.applied(&[u]).unwrap();
            u
        });
        let away = away(arx.estimator(), [-0.9, 0.08, 2.0].into());
        assert!(away < 4.0, "{seed}: {away}");
    }
    // A time series: its level is constant/A(1). It is there at once after a gap.
    let orders = ArxOrders { na: 0, inputs: &[], constant: true };
    let mut mean: RecursiveArx<f64, Const<1>> =
        RecursiveArx::new(&orders, 1.0, &[], Forgetting::None).unwrap();
    for y in [1.0, 2.0, 6.0] {
        mean.gap();
        assert_eq!(mean.measured(y).unwrap().action, Action::Updated);
    }
    // The prior weighs a hundredth of a sample.
    assert!((mean.constant().unwrap() - 9.0 / 3.01).abs() < 1e-12);
}
