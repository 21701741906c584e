extern crate std;
use std::format;
use std::string::String;
use std::vec;
use std::vec::Vec;

use nalgebra::{Const, Vector3, Vector4};

use crate::noise::Noise;
use crate::{
    Action, ArxOrders, Covariance, Dimension, Error, Forgetting, InputOrders, Lags, LeastSquares,
    RecursiveArx, RecursiveLeastSquares, RlsStart,
};

const FORGETTING: Forgetting<f64> = Forgetting::Exponential { factor: 0.98 };

fn debug<T: std::fmt::Debug>(value: &T) -> String {
    format!("{value:?}")
}

pub(crate) const fn one(nb: usize, nk: usize) -> InputOrders {
    InputOrders { nb, nk }
}

/// The coefficients of a monic polynomial with all zeros inside the unit circle, without the leading 1: from
/// reflection coefficients, by the step-up recursion.
pub(crate) fn stable_polynomial(order: usize, size: f64, noise: &mut Noise) -> Vec<f64> {
    let mut c: Vec<f64> = vec![];
    for _ in 0..order {
        let k = size * noise.next();
        let reversed: Vec<f64> = c.iter().rev().copied().collect();
        c.iter_mut().zip(reversed).for_each(|(c, mirrored)| *c += k * mirrored);
        c.push(k);
    }
    c
}

/// A plant as a difference equation over whole records, written down as the equation is.
pub(crate) struct Plant {
    pub(crate) a: Vec<f64>,
    /// b of each input, and its delay.
    pub(crate) b: Vec<(Vec<f64>, usize)>,
    pub(crate) c: Vec<f64>,
}

impl Plant {
    pub(crate) fn random(orders: &ArxOrders<'_>, nc: usize, noise: &mut Noise) -> Self {
        Plant {
            a: stable_polynomial(orders.na, 0.8, noise),
            b: orders
                .inputs
                .iter()
                .map(|i| ((0..i.nb).map(|_| 1.0 + 0.5 * noise.next()).collect(), i.nk))
                .collect(),
            c: stable_polynomial(nc, 0.7, noise),
        }
    }

    /// θ in the order of the regressor.
    pub(crate) fn parameters(&self) -> Vec<f64> {
        let b = self.b.iter().flat_map(|(b, _)| b.iter().copied());
        self.a.iter().copied().chain(b).chain(self.c.iter().copied()).collect()
    }

    /// y(k), from y(0) … y(k-1), the inputs and e(0) … e(k). What was before is 0.
    pub(crate) fn output(&self, k: usize, outputs: &[f64], inputs: &[Vec<f64>], noise: &[f64]) -> f64 {
        let at = |signal: &[f64], lag: usize| k.checked_sub(lag).map_or(0.0, |time| signal[time]);
        let mut y = noise[k];
        y += self.c.iter().enumerate().map(|(i, c)| c * at(noise, i + 1)).sum::<f64>();
        y -= self.a.iter().enumerate().map(|(i, a)| a * at(outputs, i + 1)).sum::<f64>();
        for ((b, nk), u) in self.b.iter().zip(inputs) {
            y += b.iter().enumerate().map(|(i, b)| b * at(u, nk + i)).sum::<f64>();
        }
        y
    }

    /// A record of the plant with random inputs.
    pub(crate) fn record(
        &self,
        steps: usize,
        noise_size: f64,
        noise: &mut Noise,
    ) -> (Vec<Vec<f64>>, Vec<f64>) {
        let inputs: Vec<Vec<f64>> =
            self.b.iter().map(|_| (0..steps).map(|_| noise.next()).collect()).collect();
        let e: Vec<f64> = (0..steps).map(|_| noise_size * noise.next()).collect();
        let mut outputs = vec![];
        for k in 0..steps {
            outputs.push(self.output(k, &outputs, &inputs, &e));
        }
        (inputs, outputs)
    }
}

/// Sample k of all inputs.
pub(crate) fn inputs_at(inputs: &[Vec<f64>], k: usize) -> Vec<f64> {
    inputs.iter().map(|u| u[k]).collect()
}

/// Random stable plants of these orders: found, and predicted.
fn identify<N: Dimension + Dimension<Const<1>>, D: Dimension>(orders: &ArxOrders<'_>, seed: u64) {
    let mut noise = Noise(seed);
    let plant = Plant::random(orders, 0, &mut noise);
    let noise_size = if seed.is_multiple_of(2) { 0.0 } else { 1e-3 };
    let (inputs, outputs) = plant.record(400, noise_size, &mut noise);
    let scales = vec![1.0; orders.inputs.len()];
    let start = [RlsStart::Standard, RlsStart::Exact, RlsStart::Mixed { blend: 20 }][seed as usize % 3];
    let mut estimator: RecursiveArx<f64, N, D> =
        RecursiveArx::new(orders, 1.0, &scales, Forgetting::None).unwrap().with_start(start).unwrap();
    let begin = 350;
    for (k, &y) in outputs.iter().enumerate().take(begin) {
        let innovation = estimator.log_row(y, &inputs_at(&inputs, k)).unwrap();
        if k > 100 {
            // Where zeros and poles nearly cancel, the prior stays longer in the parameters than in the predictions.
            assert!(innovation.error.abs() < 5e-3, "{orders:?} {seed} {k}");
        }
    }
    let truth = plant.parameters();
    if noise_size == 0.0 && start != RlsStart::Standard {
        let away = estimator.estimator().parameters().iter().zip(&truth).map(|(a, b)| (a - b).abs());
        assert!(away.fold(0.0, f64::max) < 1e-9, "{orders:?} {seed}");
    }

    // With the true parameters, predictions are the difference equation itself.
    let size = estimator.estimator().parameters().shape_generic().0;
    let mut parameters = size.vector(0.0);
    parameters.copy_from_slice(&truth);
    let exact = estimator.with_parameters(parameters).unwrap();
    let (mut known, none) = (outputs[..begin].to_vec(), vec![0.0; 400]);
    let mut ahead = [0.0; 20];
    let future: Vec<f64> = (begin..begin + ahead.len()).flat_map(|k| inputs_at(&inputs, k)).collect();
    exact.predict(&future, &mut ahead).unwrap();
    for (step, predicted) in ahead.iter().enumerate() {
        let expected = plant.output(begin + step, &known, &inputs, &none);
        assert!((predicted - expected).abs() < 1e-12, "{orders:?} {seed}");
        known.push(expected);
    }

    // The polynomials, in the notation of reports.
    let a: Vec<f64> = exact.a().collect();
    assert_eq!(a, [&[1.0], plant.a.as_slice()].concat());
    for (index, (b, nk)) in plant.b.iter().enumerate() {
        let found: Vec<f64> = exact.b(index).unwrap().collect();
        let zeros = if b.is_empty() { 0 } else { *nk };
        assert_eq!(found, [vec![0.0; zeros], b.clone()].concat());
    }
    assert!(exact.b(plant.b.len()).is_none());
}

#[test]
fn random_stable_plants_are_identified_and_predicted() {
    for seed in 0..20 {
        identify::<Const<3>, Const<1>>(&ArxOrders { na: 2, inputs: &[one(1, 1)], constant: false }, seed);
        identify::<Const<3>, Const<0>>(&ArxOrders { na: 1, inputs: &[one(2, 0)], constant: false }, seed);
        identify::<Const<5>, Const<4>>(
            &ArxOrders { na: 2, inputs: &[one(2, 1), one(1, 3)], constant: false },
            seed,
        );
        identify::<Const<4>, Const<5>>(
            &ArxOrders { na: 2, inputs: &[one(0, 2), one(2, 5), one(0, 0)], constant: false },
            seed,
        );
        identify::<Const<4>, Const<2>>(&ArxOrders { na: 0, inputs: &[one(4, 2)], constant: false }, seed);
    }
}

#[cfg(feature = "alloc")]
#[test]
fn random_stable_plants_of_run_time_orders_are_identified_and_predicted() {
    use nalgebra::Dyn;

    for seed in 0..10 {
        for na in 0..3 {
            for nk in [0, 1, 4] {
                identify::<Dyn, Dyn>(&ArxOrders { na, inputs: &[one(2, nk)], constant: false }, seed);
                identify::<Dyn, Dyn>(
                    &ArxOrders { na, inputs: &[one(1, nk), one(0, 3), one(3, 2)], constant: false },
                    seed,
                );
            }
        }
    }
}

#[test]
fn it_is_least_squares_on_delay_lines() {
    let orders = ArxOrders { na: 2, inputs: &[one(1, 1), one(1, 2)], constant: false };
    let mut arx: RecursiveArx<f64, Const<4>, Const<3>> =
        RecursiveArx::new(&orders, 2.0, &[1.0, 10.0], FORGETTING).unwrap();
    let mut lags: Lags<f64, Const<4>, Const<3>> = Lags::new(&orders).unwrap();
    let mut estimator = RecursiveLeastSquares::new(&Vector4::new(2.0, 2.0, 1.0, 10.0), FORGETTING).unwrap();
    let mut noise = Noise(1);
    let mut counts = [0; 3];
    for k in 0..1000 {
        if k == 500 {
            arx.gap();
            lags.gap();
        }
        // One sample in thirty is missing.
        let mut sample = || if noise.next() < -0.93 { f64::NAN } else { noise.next() };
        let (u, y) = ([sample(), sample()], sample());
        lags.push_inputs(&u).unwrap();
        let expected = lags.regressor().map(|regressor| estimator.update(regressor, y).unwrap());
        lags.push_output(y).unwrap();
        let innovation = arx.log_row(y, &u).unwrap();
        match expected {
            Some(expected) => {
                counts[usize::from(expected.action == Action::Missing)] += 1;
                assert_eq!(debug(&innovation), debug(&expected));
            }
            None => {
                counts[2] += 1;
                assert_eq!(innovation.action, Action::NotReady);
                assert!(innovation.error.is_nan() && innovation.variance.is_nan() && innovation.nis == 0.0);
            }
        }
        assert_eq!(debug(arx.estimator()), debug(&estimator));
    }
    assert!(counts.iter().all(|&count| count > 20), "{counts:?}");
}

#[test]
fn the_exact_start_is_the_batch_fit() {
    let orders = ArxOrders { na: 2, inputs: &[one(1, 1)], constant: false };
    let mut noise = Noise(2);
    let plant = Plant::random(&orders, 0, &mut noise);
    let (inputs, outputs) = plant.record(300, 0.1, &mut noise);
    let mut arx: RecursiveArx<f64, Const<3>> = RecursiveArx::new(&orders, 1.0, &[1.0], Forgetting::None)
        .unwrap()
        .with_start(RlsStart::Exact)
        .unwrap();
    let mut lags: Lags<f64, Const<3>> = Lags::new(&orders).unwrap();
    let mut batch = LeastSquares::<f64, Const<3>>::new();
    for (&u, &y) in inputs[0].iter().zip(&outputs) {
        arx.log_row(y, &[u]).unwrap();
        lags.push_inputs(&[u]).unwrap();
        if let Some(regressor) = lags.regressor() {
            batch.add(regressor, y).unwrap();
        }
        lags.push_output(y).unwrap();
    }
    let solution = batch.solve().unwrap();
    assert!((arx.estimator().parameters() - solution.parameters()).amax() < 1e-12);
    let covariance = arx.estimator().parameter_covariance().unwrap().matrix();
    let expected = solution.covariance().unwrap();
    assert!((covariance - expected).amax() < 1e-9 * expected.amax());

    // Or go on from the batch solution.
    let resumed: RecursiveArx<f64, Const<3>> =
        RecursiveArx::new(&orders, 1.0, &[1.0], FORGETTING).unwrap().with_solution(&solution).unwrap();
    assert_eq!(resumed.estimator().parameters(), solution.parameters());
    assert_eq!(resumed.estimator().forgetting(), FORGETTING);
}

#[test]
fn a_refused_sample_changes_nothing() {
    let orders = ArxOrders { na: 1, inputs: &[one(1, 1), one(1, 0)], constant: false };
    let mut arx: RecursiveArx<f32, Const<3>> =
        RecursiveArx::new(&orders, 1.0, &[1.0, 1.0], Forgetting::default()).unwrap();
    let mut noise = Noise(3);
    for k in 0..100 {
        let before = debug(&arx);
        let length = |argument, expected, found| Error::Length { argument, expected, found };
        assert_eq!(arx.log_row(1.0, &[1.0]), Err(length("inputs", 2, 1)));
        assert_eq!(arx.log_row(1.0, &[1.0, f32::INFINITY]), Err(Error::Infinite { argument: "inputs" }));
        assert_eq!(arx.log_row(f32::NEG_INFINITY, &[1.0, 1.0]), Err(Error::Infinite { argument: "output" }));
        let large = |argument| Err(Error::TooLarge { argument });
        assert_eq!(arx.log_row(1.0, &[1.0, 1e14]), large("inputs"));
        assert_eq!(arx.log_row(1.0, &[1e20, 1.0]), large("inputs"));
        assert_eq!(arx.log_row(-1e14, &[1.0, 1.0]), large("output"));
        let mut outputs = [0.0; 2];
        assert_eq!(arx.predict(&[0.0; 3], &mut outputs), Err(length("future_inputs", 4, 3)));
        let infinite = [0.0, 0.0, 0.0, f32::INFINITY];
        assert_eq!(arx.predict(&infinite, &mut outputs), Err(Error::Infinite { argument: "future_inputs" }));
        assert_eq!(debug(&arx), before);
        let mut sample = || noise.next() as f32;
        let y = if k % 10 == 4 { f32::NAN } else { sample() };
        arx.log_row(y, &[sample(), sample()]).unwrap();
    }
}

#[test]
fn no_sample_that_is_accepted_holds_time() {
    // Two taps of each, so that large samples add up; one input with a small scale, so that P is large.
    let orders = ArxOrders { na: 2, inputs: &[one(2, 1), one(1, 0)], constant: false };
    for scale in [1.0, 1e-9_f32] {
        for samples in [&[4e13][..], &[3e13; 5], &[-3e13, 3e13, -3e13], &[1e10; 3]] {
            for which in 0..3 {
                for ready in [0, 20] {
                    let mut arx: RecursiveArx<f32, Const<5>> =
                        RecursiveArx::new(&orders, 1.0, &[scale, 1.0], Forgetting::default()).unwrap();
                    let mut noise = Noise(5);
                    let mut ordinary =
                        || [scale * noise.next() as f32, noise.next() as f32, noise.next() as f32];
                    for _ in 0..ready {
                        let [u, v, y] = ordinary();
                        arx.log_row(y, &[u, v]).unwrap();
                    }
                    let mut refused = 0;
                    for &large in samples {
                        let mut sample = ordinary();
                        sample[which] = large;
                        let [u, v, y] = sample;
                        refused += usize::from(arx.log_row(y, &[u, v]).is_err());
                    }
                    let allowed = 5.0 * samples[0] * samples[0] <= f32::MAX / (1_u64 << 36) as f32;
                    assert_eq!(refused, if allowed { 0 } else { samples.len() });
                    // Time goes on, and what is too large leaves the taps.
                    for _ in 0..10 {
                        let [u, v, y] = ordinary();
                        arx.log_row(y, &[u, v]).unwrap();
                        assert!(arx.estimator().parameters().iter().all(|parameter| parameter.is_finite()));
                    }
                }
            }
        }
    }

    // The parameters of the issue: a finite sample that is not in a tap yet.
    let orders = ArxOrders { na: 1, inputs: &[one(1, 1)], constant: false };
    let mut arx: RecursiveArx<f32, Const<2>> =
        RecursiveArx::new(&orders, 1.0, &[1.0], Forgetting::default()).unwrap();
    let mut noise = Noise(6);
    for _ in 0..20 {
        arx.log_row(noise.next() as f32, &[noise.next() as f32]).unwrap();
    }
    assert_eq!(arx.log_row(0.3, &[1e14]), Err(Error::TooLarge { argument: "inputs" }));
    assert_eq!(arx.log_row(0.5, &[1.0]).unwrap().action, Action::Updated);
    // A product of parameters and samples that is too large: the sample that has it is left out.
    let mut arx = arx.with_parameters([0.0, 1e8].into()).unwrap();
    assert_eq!(arx.log_row(0.5, &[4e13]).unwrap().action, Action::Updated);
    assert_eq!(arx.log_row(0.5, &[1.0]).unwrap().action, Action::NotReady);
    assert!(arx.log_row(0.5, &[1.0]).unwrap().error.is_finite());
}

#[cfg(feature = "alloc")]
#[test]
fn predictions_in_used_lines_are_the_same() {
    use nalgebra::Dyn;

    use crate::{ArmaxMethod, ArmaxOrders, RecursiveArmax};

    let inputs = [one(2, 1), one(1, 3)];
    let orders = ArxOrders { na: 2, inputs: &inputs, constant: false };
    let mut arx: RecursiveArx<f64, Dyn, Dyn> =
        RecursiveArx::new(&orders, 1.0, &[1.0, 1.0], FORGETTING).unwrap();
    let orders = ArmaxOrders { na: 2, inputs: &inputs, nc: 2, constant: false };
    let method = ArmaxMethod::PredictionError;
    let mut armax: RecursiveArmax<f64, Dyn, Dyn> =
        RecursiveArmax::new(&orders, method, 1.0, &[1.0, 1.0], 1.0, FORGETTING).unwrap();
    let (mut workspace, mut other) = (arx.lags().clone(), armax.lags().clone());
    let mut noise = Noise(9);
    for k in 0..60 {
        let u = [noise.next(), noise.next()];
        let y = if k == 30 { f64::NAN } else { noise.next() };
        arx.log_row(y, &u).unwrap();
        armax.log_row(y, &u).unwrap();
        let future: Vec<f64> = (0..8).map(|_| noise.next()).collect();
        let (mut expected, mut found) = ([0.0; 4], [0.0; 4]);
        arx.predict(&future, &mut expected).unwrap();
        arx.predict_in(&mut workspace, &future, &mut found).unwrap();
        assert_eq!(debug(&found), debug(&expected));
        armax.predict(&future, &mut expected).unwrap();
        armax.predict_in(&mut other, &future, &mut found).unwrap();
        assert_eq!(debug(&found), debug(&expected));
    }
    let error = arx.predict_in(&mut other, &[], &mut []).unwrap_err();
    assert_eq!(error, Error::Length { argument: "workspace", expected: 5, found: 7 });
}

#[test]
fn predictions_need_samples_and_stay_finite() {
    let orders = ArxOrders { na: 1, inputs: &[one(1, 2)], constant: false };
    let mut arx: RecursiveArx<f64, Const<2>, Const<2>> = RecursiveArx::new(&orders, 1.0, &[1.0], FORGETTING)
        .unwrap()
        .with_parameters([-0.5, 1.0].into())
        .unwrap();
    let mut outputs = [0.0; 3];
    let nan = |outputs: &[f64]| outputs.iter().filter(|output| output.is_nan()).count();
    // Nothing is known yet.
    arx.predict(&[0.0; 3], &mut outputs).unwrap();
    assert_eq!(nan(&outputs), 3);
    arx.log_row(0.0, &[1.0]).unwrap();
    arx.log_row(4.0, &[2.0]).unwrap();
    arx.predict(&[3.0, 0.0, f64::NAN], &mut outputs).unwrap();
    assert_eq!(outputs, [0.5 * 4.0 + 1.0, 0.5 * 3.0 + 2.0, 0.5 * 3.5 + 3.0]);
    arx.predict(&[f64::NAN, 0.0, 0.0], &mut outputs).unwrap();
    assert_eq!(nan(&outputs), 1);
    arx.predict(&[], &mut []).unwrap();
    // A missing output, and none can be predicted.
    arx.log_row(f64::NAN, &[0.0]).unwrap();
    arx.predict(&[0.0; 3], &mut outputs).unwrap();
    assert_eq!(nan(&outputs), 3);

    let mut unstable: RecursiveArx<f32, Const<1>> =
        RecursiveArx::new(&ArxOrders { na: 1, inputs: &[], constant: false }, 1.0, &[], Forgetting::None)
            .unwrap()
            .with_parameters([-1e3].into())
            .unwrap();
    unstable.log_row(1.0, &[]).unwrap();
    let mut ahead = [0.0; 20];
    assert_eq!(unstable.predict(&[], &mut ahead), Err(Error::Overflow));
    // The first ones are predictions, the others are not.
    let known = ahead.iter().take_while(|output| output.is_finite()).count();
    assert!((10..14).contains(&known) && ahead[known..].iter().all(|output| output.is_nan()), "{ahead:?}");
    assert_eq!(unstable.predict(&[], &mut [0.0; 5]), Ok(()));
}

#[cfg(feature = "alloc")]
#[test]
fn sizes_known_at_run_time_fit() {
    use nalgebra::Dyn;

    let orders = ArxOrders { na: 2, inputs: &[one(2, 3)], constant: true };
    assert!(RecursiveArx::<f32, Dyn, Dyn>::fits(&orders));
    assert!(RecursiveArx::<f32, Const<5>, Const<7>>::fits(&orders));
    assert!(!RecursiveArx::<f32, Const<4>, Dyn>::fits(&orders));
    assert!(!RecursiveArx::<f32, Dyn, Const<2>>::fits(&orders));
}

#[test]
fn options_reach_the_estimator() {
    let orders = ArxOrders { na: 2, inputs: &[one(1, 1)], constant: false };
    let new = || RecursiveArx::<f64, Const<3>>::new(&orders, 1.0, &[1.0], FORGETTING).unwrap();
    let covariance = Covariance::from_diagonal(&Vector3::new(1.0, 2.0, 3.0)).unwrap();
    let mut arx = new().with_covariance(covariance.clone()).unwrap().with_dead_zone(10.0).unwrap();
    assert_eq!(arx.estimator().covariance(), &covariance);
    let mut skipped = 0;
    for k in 0..10 {
        skipped += usize::from(arx.log_row(f64::from(k), &[1.0]).unwrap().action == Action::Skipped);
    }
    assert_eq!(skipped, 8);
    arx.set_adaptation(false);
    assert_eq!(arx.log_row(100.0, &[1.0]).unwrap().action, Action::Frozen);
    // While frozen, samples still come in.
    let mut ahead = [0.0];
    arx.predict(&[0.0], &mut ahead).unwrap();
    assert_eq!(ahead, [0.0]);

    assert!(new().with_dead_zone(-1.0).is_err());
    assert!(new().with_parameters(Vector3::repeat(f64::NAN)).is_err());
    let wrong = RecursiveArx::<f64, Const<3>>::new(&orders, 1.0, &[1.0, 1.0], FORGETTING).map(|_| ());
    assert_eq!(wrong, Err(Error::Length { argument: "input_scales", expected: 1, found: 2 }));
    let wrong = RecursiveArx::<f64, Const<4>>::new(&orders, 1.0, &[1.0], FORGETTING).map(|_| ());
    assert_eq!(wrong, Err(Error::Orders { needed: 3, available: 4 }));
    let wrong = RecursiveArx::<f64, Const<3>>::new(&orders, 0.0, &[1.0], FORGETTING).map(|_| ());
    assert!(matches!(wrong, Err(Error::OutOfRange { argument: "scales", .. })));
}

#[test]
fn a_clone_goes_on_as_the_original() {
    let orders = ArxOrders { na: 2, inputs: &[one(2, 1)], constant: false };
    let mut original: RecursiveArx<f32, Const<4>> =
        RecursiveArx::new(&orders, 1.0, &[1.0], Forgetting::default()).unwrap();
    let mut noise = Noise(4);
    let mut sample = || noise.next() as f32;
    for _ in 0..100 {
        original.log_row(sample(), &[sample()]).unwrap();
    }
    let mut copy = original.clone();
    for _ in 0..100 {
        let (u, y) = ([sample()], sample());
        assert_eq!(debug(&original.log_row(y, &u)), debug(&copy.log_row(y, &u)));
    }
    assert_eq!(debug(&original), debug(&copy));
    // On a microcontroller it takes 220 bytes; here the counters have longer words.
    assert!(size_of::<RecursiveArx<f32, Const<4>>>() <= 220 + 16 * (size_of::<usize>() - 4));
}

mod order;
