//! The quality of single channels, and the clock.

use super::*;
use crate::tests::channel;

const NONE: f64 = f64::NAN;

#[test]
fn figures_of_a_few_rows() {
    let found = quality(vec![1.0, 1.0, NONE, 1.0, 4.0, 4.0, 4.0, 3.0]);
    assert_eq!((found.missing, found.repeated, found.longest_hold), (1, 3, 3));
    assert_eq!((found.minimum, found.maximum), (Some(1.0), Some(4.0)));
    assert_eq!(found.mean, Some(18.0 / 7.0));
    // By hand: sum of squares 60, less 18^2/7.
    assert!((found.standard_deviation.unwrap() - ((60.0 - 324.0 / 7.0) / 7.0_f64).sqrt()).abs() < 1e-15);
    // t = 0, 1, 3 … 7: mean 26/7, sum of squares 136, sum t x = 85.
    let (tt, tx, xx) = (136.0 - 676.0 / 7.0, 85.0 - 26.0 * 18.0 / 7.0, 60.0 - 324.0 / 7.0);
    assert!((found.trend.unwrap() - tx / tt).abs() < 1e-15);
    assert!((found.trend_share.unwrap() - tx * tx / tt / xx).abs() < 1e-15);
}

#[test]
fn offsets_and_sizes_lose_nothing() {
    let noise = normal(1, 1000);
    let plain = quality(noise.clone());
    let moved = quality(noise.iter().map(|x| 1e9 + x).collect());
    // The noise itself is rounded to 1e-7 there.
    assert!((moved.standard_deviation.unwrap() / plain.standard_deviation.unwrap() - 1.0).abs() < 1e-8);
    assert!((moved.trend.unwrap() - plain.trend.unwrap()).abs() < 1e-10);
    for size in [1e300, 1e-300, 1e-310] {
        let scaled = quality(noise.iter().map(|x| size * x).collect());
        let ratio =
            |of: fn(&ChannelQuality) -> Option<f64>| of(&scaled).unwrap() / size / of(&plain).unwrap();
        let figures: [fn(&ChannelQuality) -> Option<f64>; 4] =
            [|q| q.standard_deviation, |q| q.maximum, |q| q.mean, |q| q.trend];
        for of in figures {
            // Of 1e-310 ten digits are left, of its trend fewer.
            assert!(
                (ratio(of) - 1.0).abs() < if size < 1e-305 { 1e-5 } else { 1e-9 },
                "{size} {}",
                ratio(of)
            );
        }
        assert!((scaled.trend_share.unwrap() - plain.trend_share.unwrap()).abs() < 1e-9);
    }
    let extreme = quality(vec![f64::MAX, -f64::MAX, f64::MAX, -f64::MAX]);
    assert_eq!((extreme.mean, extreme.standard_deviation), (Some(0.0), Some(f64::MAX)));
}

#[test]
fn a_line_is_all_trend() {
    let times = Times::Uniform(0.5);
    let line = channel("x", (0..50).map(|row| 7.0 - 0.25 * f64::from(row)).collect::<Vec<_>>());
    let (found, _) = channel::quality(&line, Some("input"), &times);
    assert!((found.trend.unwrap() + 0.5).abs() < 1e-14);
    assert!((found.trend_share.unwrap() - 1.0).abs() < 1e-14);
    assert_eq!(found.role.as_deref(), Some("input"));
    let times = Times::Measured((0..50).map(|row| 1e9 + 2.0 * f64::from(row)).collect());
    assert!((channel::quality(&line, None, &times).0.trend.unwrap() + 0.125).abs() < 1e-14);
}

#[test]
fn what_is_not_there_is_none() {
    let empty = quality(vec![NONE; 3]);
    assert_eq!((empty.missing, empty.longest_hold, empty.minimum, empty.trend), (3, 0, None, None));
    let constant = quality(vec![0.1; 30]);
    assert_eq!((constant.mean, constant.standard_deviation), (Some(0.1), Some(0.0)));
    assert_eq!((constant.trend, constant.trend_share, constant.longest_hold), (None, None, 30));
    let single = quality(vec![5.0]);
    assert_eq!((single.mean, single.trend, single.longest_hold, single.repeated), (Some(5.0), None, 1, 0));
}

/// The values rounded to this many decimals.
fn printed(values: &[f64], decimals: usize) -> Vec<f64> {
    values.iter().map(|value| format!("{value:.decimals$}").parse().unwrap()).collect()
}

#[test]
fn rounding_is_found() {
    let noise = normal(2, 500);
    for (decimals, step) in [(0, 1.0), (1, 0.1), (2, 0.01), (4, 0.0001)] {
        let values: Vec<f64> = noise.iter().map(|x| 3.0 * x).collect();
        assert_eq!(quality(printed(&values, decimals)).quantization, Some(step), "{decimals}");
    }
    // Multiples of five hundredths, with an offset, and with the noise of floating-point sums.
    let coarse: Vec<f64> = noise.iter().map(|x| 0.37 + 0.05 * (20.0 * x).round()).collect();
    assert_eq!(quality(coarse).quantization, Some(0.05));
    let mut sum = 1e3;
    let sums: Vec<f64> = noise
        .iter()
        .map(|x| {
            sum += 0.1 * (5.0 * x).round();
            sum
        })
        .collect();
    assert_eq!(quality(sums).quantization, Some(0.1));
    // A converter of 12 bits, printed with few or with all digits.
    for (decimals, tolerance) in [(5, 2e-6), (7, 1e-9), (15, 1e-15)] {
        let codes = noise.iter().map(|x| 10.0 * (2048.0 + 300.0 * x).round() / 4095.0);
        let step = quality(printed(&codes.collect::<Vec<_>>(), decimals)).quantization.unwrap();
        assert!((step - 10.0 / 4095.0).abs() < tolerance, "{decimals}: {step}");
    }
    // Few of its values, far from each other.
    let codes: Vec<f64> = noise[..40].iter().map(|x| 10.0 * (2048.0 + 600.0 * x).round() / 4095.0).collect();
    let step = quality(printed(&codes, 7)).quantization.unwrap();
    assert!((step - 10.0 / 4095.0).abs() < 1e-9, "{step}");
    // Thousands.
    assert_eq!(quality(noise.iter().map(|x| 1e3 * (9.0 * x).round()).collect()).quantization, Some(1e3));
}

#[test]
fn continuous_and_stepped_values_are_not_rounded() {
    assert_eq!(quality(normal(3, 500)).quantization, None);
    assert_eq!(quality(normal(3, 500).iter().map(|x| 1e6 + x).collect()).quantization, None);
    assert_eq!(quality(telegraph(4, 500, 0.2)).quantization, None);
    assert_eq!(quality((0..70).map(|row| f64::from(row / 10)).collect()).quantization, None);
    assert_eq!(quality((0..90).map(|row| f64::from(row / 10)).collect()).quantization, Some(1.0));
    // Nine digits of a number are not the step of a converter.
    assert_eq!(quality(printed(&normal(3, 500), 9)).quantization, None);
    for size in [1e-300, 1e300] {
        let step = quality(normal(3, 500).iter().map(|x| size * (9.0 * x).round()).collect()).quantization;
        assert!((step.unwrap() / size - 1.0).abs() < 1e-12);
    }
}

/// A slow sine between two limits, seen with this many decimals.
fn limited(low: f64, high: f64, decimals: usize) -> Vec<f64> {
    printed(
        &(0..1000).map(|row| (f64::from(row) / 40.0).sin().clamp(low, high)).collect::<Vec<_>>(),
        decimals,
    )
}

#[test]
fn clipped_values_are_saturated() {
    for decimals in [2, 15] {
        let values = limited(-0.7, 0.9, decimals);
        let count = |limit: f64| {
            // Not the segments with which the log begins or ends.
            assert!(values[0] != limit && values[999] != limit);
            values.iter().filter(|value| **value == limit).count()
        };
        let expected = (count(-0.7), count(0.9));
        let found = quality(values.clone()).saturation.expect("it rests at both limits");
        assert_eq!((found.low, found.high), expected, "{decimals}");
        for (rows, limit) in [(&found.low_rows, -0.7), (&found.high_rows, 0.9)] {
            assert!(rows.iter().all(|rows| rows.len() > 1), "{rows:?}");
            assert!(
                rows.iter().flat_map(|rows| rows.positions()).all(|row| values[row] == limit),
                "{rows:?}"
            );
        }
    }
    // Of clipped noise the rows with another one beside them.
    let values: Vec<f64> = normal(17, 2000).iter().map(|x| x.min(1.0)).collect();
    let beside = |row: usize| values[row - 1] == 1.0 || values[row + 1] == 1.0;
    let high = (1..1999).filter(|&row| values[row] == 1.0 && beside(row)).count();
    let found = quality(values).saturation.expect("it rests at its largest value");
    assert_eq!((found.low, found.high, found.low_rows), (0, high, Vec::new()));
    let values: Vec<f64> = limited(-2.0, 0.9, 15).iter().map(|x| 1e-300 * x).collect();
    assert!(
        quality(values).saturation.is_some_and(|saturation| saturation.low == 0 && saturation.high > 100)
    );
}

#[test]
fn what_rests_by_nature_is_not_saturated() {
    for (name, values) in [
        ("smooth and rounded", limited(-2.0, 2.0, 2)),
        ("coarsely rounded", limited(-2.0, 2.0, 1)),
        ("binary", telegraph(5, 1000, 0.05)),
        ("stepped", (0..1000).map(|row| f64::from(row / 50 % 12)).collect()),
        ("noise", normal(6, 1000)),
        ("rounded noise", printed(&normal(6, 1000), 1)),
        ("held noise", normal(6, 200).iter().flat_map(|x| [*x; 5]).collect()),
        ("at rest at first", [vec![-4.0; 300], normal(7, 700)].concat()),
        ("at rest at last", [normal(7, 700), vec![4.0; 300]].concat()),
    ] {
        assert_eq!(quality(values).saturation, None, "{name}");
    }
}

#[test]
fn spikes_are_outliers() {
    let mut values = divided(&[-1.5, 0.7], &normal(8, 2000));
    for (row, spike) in [(0, 60.0), (77, -60.0), (78, -60.0), (1000, 60.0), (1999, 60.0)] {
        values[row] += spike;
    }
    values[500] = NONE;
    let found = quality(values);
    assert_eq!(found.outliers, [1, 78, 79, 1001, 2000]);
    assert_eq!(found.outlier_count, 5);
    // A wrong code in a stepped channel, where most values are those around them.
    let mut stepped: Vec<f64> = (0..500).map(|row| f64::from(row / 50 % 3)).collect();
    stepped[123] = -999.0;
    assert_eq!(quality(stepped).outliers, [124]);
    // Many: the first twenty are named.
    let mut many = normal(9, 4000);
    (0..30).for_each(|spike| many[100 * spike + 50] = 50.0);
    let found = quality(many);
    assert_eq!((found.outliers.len(), found.outliers[19], found.outlier_count), (20, 1951, 30));
}

#[test]
fn ordinary_signals_have_no_outliers() {
    for (name, values) in [
        ("noise", normal(10, 100_000)),
        ("process", divided(&[-0.99], &normal(11, 20_000))),
        ("binary", telegraph(12, 20_000, 0.01)),
        ("fast binary", telegraph(12, 20_000, 0.3)),
        ("noisy binary", sum_of(&telegraph(13, 20_000, 0.02), 0.01, &normal(14, 20_000))),
        ("rounded", printed(&divided(&[-0.99], &normal(15, 20_000)), 0)),
        ("sine", limited(-2.0, 2.0, 15)),
        (
            "pulses",
            (0..2000)
                .map(|row| if row * row % 97 < 2 { 1.0 } else { 0.0 })
                .zip(normal(16, 2000))
                .map(|(pulse, e): (f64, f64)| pulse + 0.01 * e)
                .collect(),
        ),
        ("flicker", (0..5000).map(|row| if row % 700 == 3 { 20.1 } else { 20.0 }).collect()),
        ("short", vec![0.0, 0.0, 0.0, 9.0, 0.0, 0.0]),
    ] {
        assert_eq!(quality(values).outliers, [0_usize; 0], "{name}");
    }
}

fn ticks(time: &[f64]) -> Ticks {
    Ticks::new(&Times::Measured(time.to_vec()), time.len()).unwrap()
}

#[test]
fn a_clock_is_measured() {
    let clock = ticks(&[0.0, 1.0, 2.0, 3.05, 4.0, 10.0]).clock;
    assert_eq!((clock.sample_time, clock.gaps, clock.irregular, clock.measured), (1.0, 1, false, true));
    let edge = |step: f64| ticks(&[0.0, 1.0, 2.0, 3.0, 3.0 + step, 4.0 + step]).clock;
    assert_eq!((edge(1.51).gaps, edge(1.51).irregular), (1, false));
    assert_eq!((edge(1.49).gaps, edge(1.49).irregular), (0, true));
    assert_eq!((edge(1.09).irregular, edge(0.91).irregular, edge(0.89).irregular), (false, false, true));
    let (shortest, longest) = clock.steps;
    assert!((shortest - 0.95).abs() < 1e-12 && (longest - 6.0).abs() < 1e-12);
    // 1, 1, 1.05, 0.95 about 1.
    assert!((clock.jitter - (0.005_f64 / 4.0).sqrt()).abs() < 1e-12);
    assert!(ticks(&[0.0, 1.0, 2.0, 3.2, 4.2, 5.2]).clock.irregular);
    assert_eq!(ticks(&[0.0, 0.1, 0.2, 0.30000000000000004, 0.4]).clock.sample_time, 0.1);
    let uniform = Ticks::new(&Times::Uniform(0.25), 1).unwrap().clock;
    assert_eq!((uniform.steps, uniform.jitter, uniform.measured), ((0.25, 0.25), 0.0, false));
}

#[test]
fn a_clock_that_does_not_run_forward_is_noticed() {
    let found = ticks(&[0.0, 1.0, 1.0, 2.0, 0.5, 3.0]);
    assert_eq!((found.backward, found.first_backward, found.clock.sample_time), (2, Some(3), 1.0));
    assert!(found.clock.irregular);
    assert_eq!(ticks(&[0.0, 1.0, 2.0]).first_backward, None);
    for wrong in [&[5.0, 5.0][..], &[1.0], &[0.0, NONE], &[-f64::MAX, f64::MAX], &[3.0, 2.0, 1.0]] {
        let refused = Ticks::new(&Times::Measured(wrong.to_vec()), wrong.len());
        assert!(matches!(refused, Err(Error::Data { .. })), "{wrong:?}");
    }
    for step in [0.0, -1.0, NONE, f64::INFINITY] {
        assert!(matches!(Ticks::new(&Times::Uniform(step), 2), Err(Error::Argument { .. })), "{step}");
    }
    assert!(Ticks::new(&Times::Measured(vec![0.0, 1.0]), 3).is_err());
}
