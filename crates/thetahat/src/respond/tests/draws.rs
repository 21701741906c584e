//! Draws against what they are drawn from.

use thetahat_numerics::noise::Noise;

use crate::Error;
use crate::data::{Log, Record, Rows};
use crate::model::{Orders, PolynomialModel};
use crate::respond::{Draws, InitialCondition, draw, simulate};
use crate::tests::channel;

fn diagonal(variances: &[f64]) -> Vec<Vec<f64>> {
    let row = |i: usize| (0..variances.len()).map(|j| if i == j { variances[i] } else { 0.0 }).collect();
    (0..variances.len()).map(row).collect()
}

fn moments(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let count = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / count;
    (mean, values.map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0))
}

#[test]
fn noise_goes_through_its_model_and_is_stationary_unless_it_starts_at_rest() {
    // y = 2 u(t - 1) + e/(1 - 0.8 q^-1), e of variance 0.36: v has the variance 1 and r(1) = 0.8.
    let orders = Orders::bj(&[1], 0, 1, &[0], &[1]).unwrap();
    let model = PolynomialModel::from_parameters(&orders, &[2.0, -0.8], None, 0.36, 1.0).unwrap();
    let u = Noise(1).take(40);
    let y = vec![0.0; 40];
    let record = Record::new(&y, vec![&u]).unwrap();
    let draws = Draws { count: 4000, seed: 3 };
    for (start, first) in [(InitialCondition::Zero, 0.36), (InitialCondition::Drop, 1.0)] {
        let drawn = draw(&model, &record, start, &draws).unwrap();
        let run = simulate(&model, &record, start).unwrap();
        assert_eq!((drawn.counted.clone(), drawn.varied, drawn.unstable), (run.counted.clone(), false, 0));
        let noise = |row: usize| drawn.values.iter().map(move |values| values[row]);
        let beginning = run.counted[0].start;
        for (row, expected) in [(beginning, first), (39, 1.0)] {
            let (mean, variance) = moments(noise(row));
            // Four deviations of 4000 draws.
            assert!((mean - run.values[row]).abs() < 0.07, "{start:?} {row}: {mean}");
            assert!((variance / expected - 1.0).abs() < 0.09, "{start:?} {row}: {variance}");
        }
        let product =
            drawn.values.iter().map(|values| (values[38] - run.values[38]) * (values[39] - run.values[39]));
        assert!((product.sum::<f64>() / 4000.0 - 0.8).abs() < 0.08);
    }
}

#[test]
fn parameters_vary_as_their_covariance_says() {
    // A gain alone: y = b u, without noise.
    let orders = Orders::arx(0, &[2], &[0]).unwrap();
    let covariance = vec![vec![0.04, 0.018], vec![0.018, 0.09]];
    let model = PolynomialModel::from_parameters(&orders, &[1.0, -2.0], Some(&covariance), 0.0, 1.0).unwrap();
    // u = 1, 0, 0 gives b0, then b1.
    let u = [1.0, 0.0, 0.0];
    let record = Record::new(&[0.0; 3], vec![&u]).unwrap();
    let drawn = draw(&model, &record, InitialCondition::Zero, &Draws { count: 5000, seed: 0 }).unwrap();
    assert!(drawn.varied);
    let (mean, variance) = moments(drawn.values.iter().map(|values| values[0]));
    assert!((mean - 1.0).abs() < 0.012 && (variance / 0.04 - 1.0).abs() < 0.08, "{mean} {variance}");
    let (mean, variance) = moments(drawn.values.iter().map(|values| values[1]));
    assert!((mean + 2.0).abs() < 0.018 && (variance / 0.09 - 1.0).abs() < 0.08, "{mean} {variance}");
    let product =
        drawn.values.iter().map(|values| (values[0] - 1.0) * (values[1] + 2.0)).sum::<f64>() / 5000.0;
    assert!((product - 0.018).abs() < 0.004, "{product}");
    // The bands are their quantiles: +- 1.96 deviations.
    let (mean, quantiles) = drawn.bands(&[0.025, 0.975]);
    assert!((mean[0] - 1.0).abs() < 0.012);
    assert!((quantiles[0][0] - (1.0 - 1.96 * 0.2)).abs() < 0.025, "{}", quantiles[0][0]);
    assert!((quantiles[1][0] - (1.0 + 1.96 * 0.2)).abs() < 0.025);
}

#[test]
fn the_same_seed_gives_the_same_bits_on_any_number_of_threads() {
    let orders = Orders::armax(1, &[1], 1, &[1]).unwrap();
    let model = PolynomialModel::from_parameters(
        &orders,
        &[-0.7, 1.0, 0.3],
        Some(&diagonal(&[1e-3, 1e-3, 1e-2])),
        0.1,
        1.0,
    )
    .unwrap();
    let u = Noise(1).take(300);
    let y = Noise(2).take(300);
    let mut record = Record::new(&y, vec![&u]).unwrap();
    record.segments = vec![0..120, 150..300];
    record.past = vec![0, 0];
    let draws = Draws { count: 64, seed: 9 };
    let of = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let drawn = pool.install(|| draw(&model, &record, InitialCondition::Estimate, &draws).unwrap());
        let bits: Vec<u64> = drawn.values.iter().flatten().map(|value| value.to_bits()).collect();
        (bits, drawn.counted)
    };
    let (bits, counted) = of(1);
    assert_eq!((bits.clone(), counted.clone()), of(3));
    assert_eq!(counted, [0..120, 150..300]);
    let other = draw(&model, &record, InitialCondition::Estimate, &Draws { seed: 10, ..draws }).unwrap();
    assert!(other.values[0][0] != f64::from_bits(bits[0]));
    // The first draws of more are the same ones.
    let fewer = draw(&model, &record, InitialCondition::Estimate, &Draws { count: 5, seed: 9 }).unwrap();
    let first: Vec<u64> = fewer.values.iter().flatten().map(|value| value.to_bits()).collect();
    assert_eq!(first, bits[..5 * 300]);
}

#[test]
fn unstable_parameters_are_drawn_again_and_counted() {
    let orders = Orders::arx(1, &[1], &[1]).unwrap();
    let drawn = |pole: f64, variance: f64| {
        let model = PolynomialModel::from_parameters(
            &orders,
            &[-pole, 1.0],
            Some(&diagonal(&[variance, 0.0])),
            1.0,
            1.0,
        )
        .unwrap();
        let u = [1.0; 200];
        draw(
            &model,
            &Record::new(&u, vec![&u]).unwrap(),
            InitialCondition::Zero,
            &Draws { count: 500, seed: 1 },
        )
    };
    // P(pole > 1) = 0.159, so that each draw is repeated 0.19 times on average.
    let some = drawn(0.99, 1e-4).unwrap();
    assert!((70..120).contains(&some.unstable), "{}", some.unstable);
    // At most 199 without noise, of which the deviation is at most 14.2.
    assert!(some.values.iter().flatten().all(|value| value.abs() < 285.0));
    // An estimate that is unstable stays one.
    let all = drawn(1.02, 1e-4).unwrap();
    assert_eq!(all.unstable, 0);
    assert!(matches!(drawn(0.99, 1e9), Err(Error::Data { .. })));
}

#[test]
fn what_cannot_be_drawn_is_refused() {
    let orders = Orders::arx(1, &[1], &[1]).unwrap();
    let model = PolynomialModel::from_parameters(&orders, &[-0.5, 1.0], None, 1.0, 1.0).unwrap();
    let u = vec![0.0; 2000];
    let record = Record::new(&u, vec![&u]).unwrap();
    for count in [0, 100_001, 100_000] {
        let error = draw(&model, &record, InitialCondition::Zero, &Draws { count, seed: 0 }).unwrap_err();
        assert!(matches!(&error, Error::Argument { argument, .. } if argument == "draws"), "{error}");
    }
}

#[test]
fn runs_go_on_where_an_output_is_missing() {
    // Noise of an output-error model and of one with a memory: as certain in a hole as beside it.
    for (orders, parameters) in [
        (Orders::oe(&[1], &[1], &[1]).unwrap(), &[1.0, -0.5][..]),
        (Orders::bj(&[1], 0, 1, &[1], &[1]).unwrap(), &[1.0, -0.8, -0.5]),
    ] {
        let model = PolynomialModel::from_parameters(&orders, parameters, None, 1.0, 1.0).unwrap();
        let mut y = Noise(5).take(30);
        y[10..14].fill(f64::NAN);
        y[20] = f64::NAN;
        let log = Log::new(vec![channel("u", Noise(4).take(30)), channel("y", y)], 1.0).unwrap();
        let record = log.driven_record(&["u".to_owned()], "y", &[Rows::new(1, 30).unwrap()]).unwrap();
        let draws = Draws { count: 2000, seed: 5 };
        let drawn = draw(&model, &record, InitialCondition::Estimate, &draws).unwrap();
        assert_eq!(drawn.counted, [0..10, 14..20, 21..30], "{orders}");
        let run = simulate(&model, &record, InitialCondition::Estimate).unwrap();
        let deviation = |row: usize| moments(drawn.values.iter().map(|values| values[row])).1.sqrt();
        // 1/sqrt(1 - 0.64)
        let stationary = if orders.nd > 0 { 1.0 / 0.6 } else { 1.0 };
        for row in [9, 10, 12, 14, 20] {
            assert!((deviation(row) / stationary - 1.0).abs() < 0.08, "{orders} {row}: {}", deviation(row));
            let mean = moments(drawn.values.iter().map(|values| values[row])).0;
            assert!((mean - run.values[row]).abs() < 0.15, "{orders} {row}: {mean} {}", run.values[row]);
        }
    }
}
