//! Long runs of the online estimators in single precision, beside the same in double precision.
//!
//! `SOAK_STEPS` says how many steps each takes: 10^6 if it is not said, 10^8 in `make soak`. Run it in release:
//! `cargo test --release -p thetahat-core --test soak`.
//!
//! The log holds what wears estimators out: long silences, held inputs, regressors of scales from 10^-3 to 10^3, and
//! parameters that switch.

#[path = "soak/control.rs"]
mod control;
#[path = "../src/noise.rs"]
#[expect(dead_code, reason = "the unit tests take more of it")]
mod noise;

use std::collections::VecDeque;

use thetahat_core::nalgebra::{self, Const, Matrix3, RowVector3, SVector, Vector1, Vector3, Vector4};
use thetahat_core::{
    Action, ArxOrders, Basis, Covariance, Forgetting, InputOrders, KalmanFilter, LeastSquares,
    LinearObservation, LinearTransition, Observation, OutputErrorMethod, Polynomial, Real,
    RecursiveLeastSquares, RecursiveNarx, RecursiveOutputError, Scaling, Transition, UnscentedKalmanFilter,
    Window, WindowedLeastSquares,
};

use noise::Noise;

/// How many steps each run takes.
fn steps() -> u64 {
    std::env::var("SOAK_STEPS")
        .map_or(1_000_000, |text| text.parse().expect("SOAK_STEPS is a number of steps"))
}

impl Noise {
    /// Uniform in -1 … 1, in single precision.
    fn single(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1_u64 << 23) as f32 - 1.0
    }
}

const SCALES: [f32; 4] = [1e-3, 1.0, 30.0, 1e3];

/// The deviation of the noise in the output.
const NOISE: f32 = 0.1;

/// A log of a plant with four parameters, of which the scaled values are 1, -2, 0.5 and 3, or the opposite.
struct Plant {
    noise: Noise,
    held: [f32; 4],
}

/// What the input does.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Input {
    Rich,
    Silent,
    Held,
}

/// A period of the log: rich, silent, rich, held. In the middle of each rich part the parameters switch.
const PERIOD: u64 = 40_000;

fn input(step: u64) -> Input {
    match step % PERIOD {
        10_000..20_000 => Input::Silent,
        30_000.. => Input::Held,
        _ => Input::Rich,
    }
}

/// The parameters in units of 1/scale.
fn truth(step: u64) -> [f32; 4] {
    let sign = if (step + 15_000) / 20_000 % 2 == 0 { 1.0 } else { -1.0 };
    [1.0, -2.0, 0.5, 3.0].map(|value| sign * value)
}

impl Plant {
    fn sample(&mut self, step: u64) -> ([f32; 4], f32) {
        let scaled = match input(step) {
            Input::Silent => [0.0; 4],
            Input::Held => self.held,
            Input::Rich => {
                self.held = [0; 4].map(|_| self.noise.single());
                self.held
            }
        };
        let clean: f32 = scaled.iter().zip(truth(step)).map(|(scaled, truth)| scaled * truth).sum();
        let regressor = [0, 1, 2, 3].map(|index: usize| scaled[index] * SCALES[index]);
        (regressor, clean + NOISE * 3.0_f32.sqrt() * self.noise.single())
    }
}

/// What a run found.
#[derive(Debug, Default)]
struct Findings {
    /// The largest distance of the `f32` parameters from the `f64` ones after rich input, in units of 1/scale.
    rounding: f64,
    /// The same of the `f64` ones from the truth.
    error: f64,
    /// The most samples it took to come within 0.5 of the truth after the parameters switched.
    acquisition: u64,
    /// The largest P_jj / p_j.
    variance: f64,
}

fn estimator<T: Real>(forgetting: Forgetting<T>, dead_zone: T) -> RecursiveLeastSquares<T, Const<4>> {
    let scales = Vector4::from(SCALES).map(|scale| nalgebra::convert(f64::from(scale)));
    RecursiveLeastSquares::new(&scales, forgetting)
        .expect("finite numbers")
        .with_dead_zone(dead_zone)
        .expect("finite numbers")
}

/// The distance of scaled parameters from others.
fn distance(parameters: [f64; 4], others: [f64; 4]) -> f64 {
    parameters.iter().zip(others).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Runs both precisions over the same log. At every step all numbers must be finite and no variance negative.
fn run(name: &str, single: Forgetting<f32>, double: Forgetting<f64>, dead_zone: f32, steps: u64) -> Findings {
    let mut single = estimator(single, dead_zone);
    let mut double = estimator(double, f64::from(dead_zone));
    let mut plant = Plant { noise: Noise(7), held: [0.0; 4] };
    let mut findings = Findings::default();
    let mut acquiring = None;
    for step in 0..steps {
        let (regressor, output) = plant.sample(step);
        let innovation = single.update(&Vector4::from(regressor), output).expect("finite numbers");
        double.update(&Vector4::from(regressor).cast(), f64::from(output)).expect("finite numbers");
        assert!(innovation.error.is_finite(), "{name} at {step}");

        let scaled = |parameters: [f64; 4]| {
            [0, 1, 2, 3].map(|index: usize| parameters[index] * f64::from(SCALES[index]))
        };
        let now = scaled((*single.parameters()).cast::<f64>().into());
        assert!(now.iter().all(|value| value.is_finite()), "{name} at {step}: {now:?}");
        if step % 1000 == 999 || step < 1000 {
            let variances = single.covariance().variances();
            assert!(variances.iter().all(|variance| *variance > 0.0), "{name} at {step}: {variances:?}");
            for (variance, scale) in variances.iter().zip(SCALES) {
                let relative = f64::from(*variance) * f64::from(scale).powi(2) / 100.0;
                findings.variance = findings.variance.max(relative);
            }
        }
        if step % 20_000 == 5_000 {
            acquiring = Some(step);
        }
        let truth = truth(step).map(f64::from);
        if let Some(since) = acquiring
            && distance(now, truth) < 0.5
        {
            findings.acquisition = findings.acquisition.max(step - since);
            acquiring = None;
        }
        if step % 20_000 == 9_999 {
            let reference = scaled((*double.parameters()).into());
            findings.rounding = findings.rounding.max(distance(now, reference));
            findings.error = findings.error.max(distance(reference, truth));
            assert!(acquiring.is_none(), "{name} at {step}: {now:?} has not come near {truth:?}");
        }
    }
    println!("{name}, {steps} steps: {findings:?}");
    findings
}

/// Every bounded policy stays bounded, follows, and agrees with double precision.
fn soak(name: &str, single: Forgetting<f32>, double: Forgetting<f64>, dead_zone: f32, rounding: f64) {
    let findings = run(name, single, double, dead_zone, steps());
    assert!(findings.rounding < rounding, "{name}: {findings:?}");
    assert!(findings.error < 0.5, "{name}: {findings:?}");
    // n samples pass before a column has its turn: up to (1 + 1/n)^n.
    assert!(findings.variance < 2.72, "{name}: {findings:?}");
}

#[test]
fn exponential() {
    let forgetting = (Forgetting::Exponential { factor: 0.99 }, Forgetting::Exponential { factor: 0.99 });
    soak("exponential", forgetting.0, forgetting.1, 0.0, 1e-3);
}

#[test]
fn exponential_with_a_dead_zone() {
    let forgetting = (Forgetting::Exponential { factor: 0.99 }, Forgetting::Exponential { factor: 0.99 });
    soak("dead zone", forgetting.0, forgetting.1, 0.05, 1e-3);
}

#[test]
fn selective() {
    let forgetting = (Forgetting::Selective { factor: 0.99 }, Forgetting::Selective { factor: 0.99 });
    soak("selective", forgetting.0, forgetting.1, 0.0, 1e-3);
}

#[test]
fn random_walk() {
    let forgetting = (Forgetting::RandomWalk { variance: 1e-3 }, Forgetting::RandomWalk { variance: 1e-3 });
    soak("random walk", forgetting.0, forgetting.1, 0.0, 1e-3);
}

#[test]
fn variable() {
    let single = Forgetting::Variable { factor: 0.99, minimum: 0.85, noise_variance: NOISE * NOISE };
    let double =
        Forgetting::Variable { factor: 0.99, minimum: 0.85, noise_variance: f64::from(NOISE * NOISE) };
    soak("variable", single, double, 0.0, 1e-3);
}

/// Without forgetting the estimate converges and single precision does not: after enough samples the rounding
/// exceeds what is left of the noise. The doc of `Forgetting::None` states that horizon.
#[test]
fn without_forgetting_the_horizon_is_finite() {
    let mut single = estimator::<f32>(Forgetting::None, 0.0);
    let mut double = estimator::<f64>(Forgetting::None, 0.0);
    let mut plant = Plant { noise: Noise(7), held: [0.0; 4] };
    let (mut horizon, mut largest) = (None, 0.0_f64);
    for step in 0..steps() {
        // Always rich, never another plant.
        let (regressor, output) = plant.sample(step % 10_000);
        single.update(&Vector4::from(regressor), output).unwrap();
        double.update(&Vector4::from(regressor).cast(), f64::from(output)).unwrap();
        if step % 1000 == 999 {
            let variances = single.covariance().variances();
            assert!(variances.iter().all(|variance| *variance > 0.0), "at {step}: {variances:?}");
            let deviations = double.parameter_covariance().unwrap().variances().map(f64::sqrt);
            let difference = (*single.parameters()).cast::<f64>() - double.parameters();
            let relative = difference.component_div(&deviations).amax();
            largest = largest.max(relative);
            if relative > 1.0 && horizon.is_none() {
                horizon = Some(step);
            }
        }
    }
    println!(
        "no forgetting: rounding exceeds one standard error at {horizon:?}, {largest:.1e} of it at most"
    );
    assert!(horizon.is_none_or(|step| step > 200_000), "{horizon:?}");
}

/// A window of 100 samples, exactly or in blocks, through silences, held inputs and scales that change by 10^3: always
/// that of the least squares of its samples in double precision, or the last one that was.
#[test]
fn windowed_least_squares() {
    for window in [Window { blocks: 100, block: 1 }, Window { blocks: 10, block: 10 }] {
        let mut windowed: WindowedLeastSquares<f32, Const<4>, Const<1500>> =
            WindowedLeastSquares::new(Const, window).unwrap();
        let mut plant = Plant { noise: Noise(7), held: [0.0; 4] };
        let (mut samples, mut worst, mut determined) = (VecDeque::new(), 0.0_f64, 0_u64);
        for step in 0..steps() {
            let (regressor, output) = plant.sample(step);
            let scale = if step / 1_500 % 2 == 0 { 1.0 } else { 1e3 };
            let (regressor, output) = (Vector4::from(regressor) * scale, output * scale);
            samples.push_back((regressor, output));
            let innovation = windowed.update(&regressor, output).expect("finite numbers");
            if samples.len() > windowed.rows() {
                samples.drain(..samples.len() - windowed.rows());
            }
            assert!(windowed.parameters().iter().all(|value| value.is_finite()), "at {step}");
            let kept = matches!(innovation.action, Action::Collecting);
            // Of 100 samples that are all silent, or all held, there is no solution.
            let (silent, rich) = (step % 10_000 >= 100, input(step) == Input::Rich);
            assert!(
                if rich { !kept || step % 10_000 < 5 } else { kept || !silent },
                "at {step}: {innovation:?}"
            );
            determined += u64::from(!kept);
            if step % 1009 == 0 && rich && !kept {
                let mut batch = LeastSquares::<f64, Const<4>>::new();
                for (regressor, output) in &samples {
                    batch.add(&regressor.cast(), f64::from(*output)).unwrap();
                }
                let truth = *batch.solve().unwrap().parameters();
                let off = (windowed.parameters().cast::<f64>() - truth)
                    .component_mul(&Vector4::from(SCALES).cast());
                let size = truth.component_mul(&Vector4::from(SCALES).cast()).amax();
                // In units of what rounding the data would do.
                worst = worst.max(off.amax() / size / (batch.condition() * f64::from(f32::EPSILON)));
            }
        }
        println!(
            "{window:?}: {worst:.1} condition numbers times epsilon, {determined} of {} determined",
            steps()
        );
        assert!(worst < 30.0, "{window:?}: {worst:e}");
    }
}

/// Models with noise of the sensor follow a plant that switches, through silences, held inputs and missing
/// measurements.
#[test]
fn recursive_output_error() {
    for method in [OutputErrorMethod::PredictionError, OutputErrorMethod::Instruments] {
        let orders = ArxOrders { na: 2, inputs: &[InputOrders { nb: 1, nk: 1 }], constant: false };
        let forgetting = Forgetting::Exponential { factor: 0.998 };
        let mut model: RecursiveOutputError<f32, Const<3>> =
            RecursiveOutputError::new(&orders, method, 2.0, &[1.0], forgetting).unwrap();
        let mut noise = Noise(5);
        let (mut x, mut u, mut largest, mut worst) = ([0.0_f32; 2], 0.0_f32, 0.0_f32, 0.0_f32);
        for step in 0..steps() {
            let gain = if (step + 15_000) / 20_000 % 2 == 0 { 0.5 } else { 0.3 };
            x = [1.2 * x[0] - 0.5 * x[1] + gain * u, x[0]];
            let measured = if step % 997 == 0 { f32::NAN } else { x[0] + 0.3 * noise.single() };
            model.measured(measured).expect("finite numbers");
            u = match input(step) {
                Input::Silent => 0.0,
                Input::Held => u,
                Input::Rich => noise.single(),
            };
            model.applied(&[u]).expect("finite numbers");
            let parameters = model.estimator().parameters();
            assert!(parameters.iter().all(|value| value.is_finite()), "at {step}: {parameters}");
            if step % 1_000 == 999 {
                let variances = model.estimator().covariance().variances();
                assert!(variances.iter().all(|variance| *variance > 0.0), "at {step}: {variances:?}");
                largest = largest.max(variances.component_mul(&Vector3::new(0.04, 0.04, 0.01)).max());
            }
            if step % 20_000 == 9_999 {
                worst = worst.max((parameters - Vector3::new(-1.2, 0.5, gain)).amax());
            }
        }
        println!("{method:?}: {worst} from the truth after rich input, P {largest} of its bound");
        assert!(worst < 0.2 && largest < 2.72, "{method:?}: {worst} {largest}");
    }
}

/// All products of at most two of y(k-1), y(k-2) and u(k-1): ten terms.
const PRODUCTS: Polynomial<'_> = Polynomial {
    factors: &[0, 1, 2, 0, 0, 0, 1, 0, 2, 1, 1, 1, 2, 2, 2],
    ends: &[0, 1, 2, 3, 5, 7, 9, 11, 13, 15],
};

/// A nonlinear model of ten terms follows a plant that switches, through silences and held inputs.
#[test]
fn recursive_narx() {
    let orders = ArxOrders { na: 2, inputs: &[InputOrders { nb: 1, nk: 1 }], constant: false };
    let (output, valve) = (Scaling { offset: 50.0, scale: 20.0 }, Scaling { offset: 1e-3, scale: 1e-3 });
    let mut plant: RecursiveNarx<f32, Polynomial<'_>, Const<3>, Const<10>> =
        RecursiveNarx::new(PRODUCTS, &orders, output, &[valve], Forgetting::Exponential { factor: 0.995 })
            .unwrap();
    let mut noise = Noise(5);
    let (mut z, mut worst, mut largest) = ([0.0_f32; 3], 0.0_f32, 0.0_f32);
    for step in 0..steps() {
        let gain = if (step + 15_000) / 20_000 % 2 == 0 { 0.5 } else { 0.3 };
        let theta = [0.02, 0.6, -0.2, gain, -0.05, 0.03, 0.1, 0.0, 0.05, 0.15];
        let next = PRODUCTS.value(&theta, &z) + 0.01 * noise.single();
        let now = match input(step) {
            Input::Silent => 0.0,
            Input::Held => z[2],
            Input::Rich => noise.single(),
        };
        let missing = step % 997 == 0;
        let innovation = plant
            .measured(if missing { f32::NAN } else { output.offset + output.scale * next })
            .expect("finite numbers");
        plant.applied(&[valve.offset + valve.scale * now]).expect("finite numbers");
        z = [next, z[0], now];
        let parameters = plant.estimator().parameters();
        assert!(parameters.iter().all(|value| value.is_finite()), "at {step}: {parameters}");
        if (7_000..9_900).contains(&(step % 20_000)) && innovation.error.is_finite() {
            worst = worst.max((innovation.error / output.scale).abs());
        }
        if step % 1_000 == 999 {
            let variances = plant.estimator().covariance().variances();
            assert!(variances.iter().all(|variance| *variance > 0.0), "at {step}: {variances:?}");
            largest = largest.max(variances.max() / 100.0);
        }
        if step % 20_000 == 9_999 {
            let distance =
                parameters.iter().zip(theta).map(|(found, truth)| (found - truth).abs()).fold(0.0, f32::max);
            assert!(distance < 0.1, "at {step}: {parameters}");
        }
    }
    println!("nonlinear ARX: errors {worst} of the scale at most after rich input, P {largest} of its bound");
    assert!(worst < 0.05 && largest < 2.72, "{worst} {largest}");
}

/// A filter of three states, driven and measured hard: a prior of 10^8, an accurate sensor and a coarse one,
/// silences, an observation that is almost another one.
fn filter<T: Real>()
-> (KalmanFilter<T, Const<3>>, LinearTransition<T, Const<3>>, [LinearObservation<T, Const<3>, Const<1>>; 3]) {
    let number = |value: f64| nalgebra::convert(value);
    let cast = |value: Vector3<f64>| value.map(number);
    let step: f64 = 0.1;
    let motion = Matrix3::new(1.0, step, step * step / 2.0, 0.0, 1.0, step, 0.0, 0.0, 0.98);
    let jerk: Covariance<T, Const<1>> =
        Covariance::from_diagonal(&Vector1::new(number(1e-4))).expect("finite numbers");
    let noise = jerk
        .transformed(&cast(Vector3::new(step.powi(3) / 6.0, step.powi(2) / 2.0, step)))
        .expect("finite numbers");
    let sensor = |row: RowVector3<f64>, variance: f64| {
        let noise = Covariance::from_diagonal(&Vector1::new(number(variance))).expect("finite numbers");
        LinearObservation::new(row.map(number), noise).expect("finite numbers")
    };
    let prior = Covariance::from_diagonal(&cast(Vector3::new(1e8, 1e8, 1e8))).expect("finite numbers");
    (
        KalmanFilter::new(SVector::from_element(T::zero()), prior).expect("finite numbers"),
        LinearTransition::new(motion.map(number), noise).expect("finite numbers"),
        [
            sensor(RowVector3::new(1.0, 0.0, 0.0), 1e-6),
            sensor(RowVector3::new(1.0, 0.01, 0.0), 1e-6),
            sensor(RowVector3::new(0.0, 1.0, 0.0), 1e2),
        ],
    )
}

#[test]
fn kalman_filter() {
    let (mut single, motion, sensors) = filter::<f32>();
    let (mut double, double_motion, double_sensors) = filter::<f64>();
    let mut noise = Noise(3);
    let mut largest = 0.0_f64;
    for step in 0..steps() {
        single.predict(&motion, &SVector::zeros()).unwrap();
        double.predict(&double_motion, &SVector::zeros()).unwrap();
        // The plant rests at 0; a silence of 1,000 samples in each 10,000.
        if step % 10_000 < 9_000 {
            for (index, (sensor, double_sensor)) in sensors.iter().zip(&double_sensors).enumerate() {
                let deviation = [1e-3, 1e-3, 10.0][index] * 3.0_f32.sqrt();
                let y = Vector1::new(deviation * noise.single());
                let innovation = single.correct(sensor, &SVector::zeros(), &y).unwrap();
                assert!(innovation.nis.is_finite() && innovation.variance[0] > 0.0, "at {step}");
                double.correct(double_sensor, &SVector::zeros(), &y.cast()).unwrap();
            }
        }
        if step % 1_000 == 999 {
            let variances = single.covariance().variances();
            assert!(variances.iter().all(|variance| *variance > 0.0), "at {step}: {variances:?}");
            let deviations = double.covariance().variances().map(f64::sqrt);
            let difference = (*single.state()).cast::<f64>() - double.state();
            largest = largest.max(difference.component_div(&deviations).amax());
            let ratios = variances.cast::<f64>().map(f64::sqrt).component_div(&deviations);
            assert!((ratios - Vector3::repeat(1.0)).amax() < 0.01, "at {step}: {ratios}");
        }
    }
    println!("Kalman filter: f32 and f64 differ by {largest:.1e} standard deviations at most");
    assert!(largest < 0.05, "{largest}");
}

/// A pendulum with friction, seen by the sideways position of its end, and the offset of that
/// sensor: nothing drives the offset.
struct Pendulum;

impl<T: Real> Transition<T, Const<3>> for Pendulum {
    fn next(&self, x: &SVector<T, 3>, _: &SVector<T, 0>) -> SVector<T, 3> {
        let step: T = nalgebra::convert(0.05);
        let pull = nalgebra::convert::<f64, T>(-9.81) * x[0].sine_and_cosine().0;
        let friction = nalgebra::convert::<f64, T>(-1.5) * x[1];
        Vector3::new(x[0] + step * x[1], x[1] + step * (pull + friction), x[2])
    }
    fn process_noise(&self, _: &SVector<T, 3>, _: &SVector<T, 0>) -> Covariance<T, Const<3>> {
        Covariance::from_diagonal(&Vector3::new(1e-9, 1e-4, 1e-12).map(nalgebra::convert))
            .expect("finite numbers")
    }
}

impl<T: Real> Observation<T, Const<3>, Const<1>> for Pendulum {
    fn output(&self, x: &SVector<T, 3>, _: &SVector<T, 0>) -> SVector<T, 1> {
        Vector1::new(x[0].sine_and_cosine().0 + x[2])
    }
    fn measurement_noise(&self, _: &SVector<T, 3>, _: &SVector<T, 0>) -> Covariance<T, Const<1>> {
        Covariance::from_diagonal(&Vector1::new(nalgebra::convert(1e-4))).expect("finite numbers")
    }
}

/// The unscented filter through silences and gated outliers: no variance negative or lost.
#[test]
fn unscented_filter() {
    let started = |x: f64| {
        let prior = Covariance::from_diagonal(&Vector3::new(0.1, 1.0, 1.0)).expect("finite numbers");
        UnscentedKalmanFilter::new(Vector3::new(x, 0.0, 0.0), prior)
    };
    let mut double = started(0.0).unwrap().with_gate(25.0).unwrap().with_release(20);
    let prior = Covariance::from_diagonal(&Vector3::new(0.1_f32, 1.0, 1.0)).unwrap();
    let mut single = UnscentedKalmanFilter::new(Vector3::zeros(), prior).unwrap();
    single = single.with_gate(25.0).unwrap().with_release(20);
    let (mut noise, mut truth) = (Noise(13), Vector3::new(0.3, 0.0, 0.1));
    let (mut largest, mut errors) = (0.0_f64, 0.0_f64);
    for step in 0..steps() {
        truth = Transition::<f64, _>::next(&Pendulum, &truth, &SVector::zeros());
        truth[1] += 0.01 * 3.0_f64.sqrt() * f64::from(noise.single());
        single.predict(&Pendulum, &SVector::zeros()).unwrap();
        double.predict(&Pendulum, &SVector::zeros()).unwrap();
        if step % 10_000 < 9_900 {
            let outlier = if step % 101 == 100 { 5.0 } else { 0.0 };
            let output: Vector1<f64> =
                Observation::<f64, _, Const<1>>::output(&Pendulum, &truth, &SVector::zeros());
            let y = output[0] + outlier + 0.01 * 3.0_f64.sqrt() * f64::from(noise.single());
            let innovation = single.correct(&Pendulum, &SVector::zeros(), &Vector1::new(y as f32)).unwrap();
            assert!(innovation.nis.is_finite() && innovation.variance[0] > 0.0, "at {step}");
            assert!(outlier == 0.0 || step < 1_000 || innovation.action == Action::Gated, "at {step}");
            double.correct(&Pendulum, &SVector::zeros(), &Vector1::new(y)).unwrap();
        }
        let variances = single.covariance().variances();
        assert!(variances.iter().all(|variance| *variance > 0.0), "at {step}: {variances:?}");
        if step % 1_000 == 999 && step > 10_000 {
            let deviations = double.covariance().variances().map(f64::sqrt);
            let difference = (*single.state()).cast::<f64>() - double.state();
            largest = largest.max(difference.component_div(&deviations).amax());
            errors = errors.max((double.state() - truth).component_div(&deviations).amax());
            let ratios = variances.cast::<f64>().map(f64::sqrt).component_div(&deviations);
            assert!((ratios - Vector3::repeat(1.0)).amax() < 0.2, "at {step}: {ratios}");
        }
    }
    println!(
        "unscented filter: f32 and f64 differ by {largest:.1e} standard deviations at most, errors are {errors:.1}"
    );
    assert!(largest < 1.0 && errors < 7.0, "{largest} {errors}");
}
