//! Logs and what is done to them, against definitions.

use thetahat_numerics::noise::Noise;

use super::{Detrend, Interpolation, Log, Offset, Resample, Rows};
use crate::Error;
use crate::tests::channel;

const NAN: f64 = f64::NAN;

fn rows(text: &str) -> Rows {
    text.parse().unwrap()
}

/// The 1-based row that an error names.
fn row_of(result: Result<Log, Error>) -> Option<usize> {
    match result.unwrap_err() {
        Error::Data { row, .. } => row,
        other => panic!("{other}"),
    }
}

#[test]
fn missing_samples_and_jumps_cut_a_log() {
    let u = channel("u", [NAN, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, NAN, 1.0, 1.0]);
    let y = channel("y", [1.0, 1.0, 1.0, NAN, 1.0, 1.0, 1.0, NAN, 1.0, NAN]);
    // The clock has a gap before the sixth row.
    let time = vec![0.0, 1.0, 2.0, 3.0, 4.0, 7.0, 8.0, 9.0, 10.0, 11.0];
    let log = Log::with_time(vec![u, y], time).unwrap();
    let record = |parts: &[Rows]| log.record(&["u".to_owned()], "y", parts).unwrap();
    let all = record(&[rows("1..10")]);
    assert_eq!((&all.segments[..], &all.past[..]), (&[1..3, 4..5, 5..7, 8..9][..], &[0, 0, 0, 0][..]));
    // In rising order, and with what stands before them.
    let some = record(&[rows("7..9"), rows("3..5")]);
    assert_eq!((&some.segments[..], &some.past[..]), (&[2..3, 4..5, 6..7, 8..9][..], &[1, 0, 1, 0][..]));
    // Only the channels in use count.
    assert_eq!(log.segments(&["y"], &[rows("1..3")]).unwrap(), std::iter::once(0..3).collect::<Vec<_>>());
    assert_eq!(log.segments(&["u"], &[rows("1..1"), rows("8..8")]).unwrap(), []);
    assert_eq!((log.gaps(), log.sample_time()), (1, 1.0));
}

#[test]
fn rows_that_are_not_there_are_refused() {
    let log = Log::new(vec![channel("y", [1.0, 2.0])], 1.0).unwrap();
    assert!(log.record(&[], "y", &[rows("1..3")]).is_err());
    assert!(log.record(&[], "y", &[rows("1..2"), rows("2..2")]).is_err());
    assert!(log.record(&[], "z", &[rows("1..2")]).is_err());
    assert!(log.record(&["z".to_owned()], "y", &[rows("1..2")]).is_err());
    assert_eq!(log.record(&[], "y", &[]).unwrap().segments, []);
}

#[test]
fn clocks_are_uniform_up_to_gaps() {
    let with = |time: &[f64]| Log::with_time(vec![channel("y", vec![1.0; time.len()])], time.to_vec());
    // The median of an even number of steps is the mean of the middle two.
    assert_eq!(with(&[0.0, 1.0, 2.08]).unwrap().sample_time(), 1.04);
    assert_eq!(with(&[0.0, 1.0, 2.0, 3.09]).unwrap().sample_time(), 1.0);
    assert_eq!(with(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.501]).unwrap().gaps(), 1);
    assert_eq!(row_of(with(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.499])), Some(6));
    assert_eq!(row_of(with(&[0.0, 1.0, 2.0, 2.89, 4.0])), Some(4));
    assert_eq!(row_of(with(&[0.0, 1.0, 1.0, 2.0])), Some(3));
    assert_eq!(row_of(with(&[0.0, 1.0, 0.5, 2.0])), Some(3));
    assert_eq!(row_of(with(&[0.0, NAN, 2.0])), Some(2));
    assert_eq!(row_of(with(&[0.0])), None);
    assert_eq!(row_of(Log::with_time(vec![channel("y", [1.0, 2.0])], vec![0.0])), None);
}

#[test]
fn channels_are_checked() {
    assert_eq!(row_of(Log::new(vec![channel("y", [1.0, f64::NEG_INFINITY])], 1.0)), Some(2));
    assert!(Log::new(vec![], 1.0).is_err());
    assert!(Log::new(vec![channel("y", [])], 1.0).is_err());
    assert!(Log::new(vec![channel("y", [1.0]), channel("y", [1.0])], 1.0).is_err());
    assert!(Log::new(vec![channel("y", [1.0]), channel("u", [1.0, 2.0])], 1.0).is_err());
    for sample_time in [0.0, -1.0, NAN, f64::INFINITY] {
        assert!(Log::new(vec![channel("y", [1.0])], sample_time).is_err());
    }
}

#[test]
fn a_resampled_log_reads_between_samples() {
    let time = [0.0, 1.0, 1.5, 4.0];
    let read = |values: [f64; 4], interpolation| {
        let log =
            Log::resampled(vec![channel("y", values)], &time, &Resample::new(0.5, interpolation)).unwrap();
        assert_eq!((log.rows(), log.sample_time(), log.gaps()), (9, 0.5, 0));
        log.channels()[0].values.clone()
    };
    let hold = read([1.0, 3.0, 5.0, 0.0], Interpolation::Hold);
    assert_eq!(hold, [1.0, 1.0, 3.0, 5.0, 5.0, 5.0, 5.0, 5.0, 0.0]);
    let linear = read([1.0, 3.0, 5.0, 0.0], Interpolation::Linear);
    assert_eq!(linear, [1.0, 2.0, 3.0, 5.0, 4.0, 3.0, 2.0, 1.0, 0.0]);
    // A value is missing where one that it is read off is.
    let missing = |values: Vec<f64>| values.iter().map(|value| u8::from(value.is_nan())).collect::<Vec<_>>();
    assert_eq!(missing(read([1.0, NAN, 5.0, 0.0], Interpolation::Hold)), [0, 0, 1, 0, 0, 0, 0, 0, 0]);
    assert_eq!(missing(read([1.0, NAN, 5.0, 0.0], Interpolation::Linear)), [0, 1, 1, 0, 0, 0, 0, 0, 0]);
}

#[test]
fn resampling_a_uniform_log_changes_nothing() {
    let mut noise = Noise(1);
    let values = noise.take(5000);
    // Decimal steps, and seconds since 1970, of which rounding is a fraction of a thousandth of a step.
    for (first, step) in [(0.0, 0.1), (-3.7, 0.01), (1.7e9, 0.1), (1_712_345_678.123, 1e-3)] {
        let time: Vec<f64> = (0..5000).map(|k| first + f64::from(k) * step).collect();
        // As a file has it: rounded to microseconds.
        let written: Vec<f64> = time.iter().map(|t| format!("{t:.6}").parse().unwrap()).collect();
        for time in [&time, &written] {
            for interpolation in [Interpolation::Hold, Interpolation::Linear] {
                let log =
                    Log::resampled(vec![channel("y", &values)], time, &Resample::new(step, interpolation))
                        .unwrap();
                let found = &log.channels()[0].values;
                assert_eq!(found.len(), 5000, "{first} {step}");
                let worst = found.iter().zip(&values).map(|(f, v)| (f - v).abs()).fold(0.0, f64::max);
                assert!(worst < 2e-3, "{first} {step} {interpolation:?} {worst}");
            }
        }
    }
    let two = |step| {
        Log::resampled(vec![channel("y", [1.0, 2.0])], &[0.0, 1.0], &Resample::new(step, Interpolation::Hold))
    };
    assert!(two(1e-9).is_err() && two(0.0).is_err() && two(-1.0).is_err() && two(NAN).is_err());
    // One row is no log.
    assert!(two(1.5).is_err() && two(1.0).unwrap().rows() == 2);
}

#[test]
fn offsets_are_means_and_lines() {
    let mut noise = Noise(2);
    let time: Vec<f64> =
        (0..300).map(|k| 100.0 + 0.5 * f64::from(k) + if k < 120 { 0.0 } else { 40.0 }).collect();
    let mut values: Vec<f64> = time.iter().map(|t| 3.0 - 0.2 * (t - 100.0)).collect();
    values[7] = NAN;
    let log = Log::with_time(vec![channel("y", &values), channel("v", noise.take(300))], time).unwrap();
    let segments = log.segments(&["y"], &[rows("3..250")]).unwrap();
    let offset = |name: &str, detrend| Offset::estimate(detrend, &log, name, &segments);

    assert_eq!(offset("y", Detrend::None).unwrap(), Offset::default());
    let line = offset("y", Detrend::Linear).unwrap();
    assert!((line.level - 3.0).abs() < 1e-12 && (line.slope + 0.2).abs() < 1e-14, "{line:?}");
    // Rows 3 to 7 and 9 to 13, of which the line's mean lies half a row above row 8.
    let start = offset("y", Detrend::Start(10)).unwrap();
    assert!((start.level - (3.0 - 0.2 * 3.5)).abs() < 1e-14 && start.slope == 0.0, "{start:?}");
    assert!(offset("y", Detrend::Start(248)).is_err() && offset("y", Detrend::Start(247)).is_ok());
    let whole = offset("y", Detrend::Mean).unwrap();
    let counted = || segments.iter().cloned().flatten();
    let mean = counted().map(|row| values[row]).sum::<f64>() / 247.0;
    assert!((whole.level - mean).abs() < 1e-12 && whole.slope == 0.0);

    // What a line leaves has neither a mean nor a trend, whatever the channel.
    let mut detrended = log.clone();
    detrended.remove("v", &offset("v", Detrend::Linear).unwrap());
    let rest = &detrended.channel("v").unwrap().values;
    let moment = |power| counted().map(|row| rest[row] * log.elapsed(row).powi(power)).sum::<f64>();
    assert!(moment(0).abs() < 1e-11 && moment(1).abs() < 1e-9, "{} {}", moment(0), moment(1));
}

#[test]
fn small_signals_on_large_offsets_keep_their_digits() {
    let mut noise = Noise(3);
    // Multiples of 2^-20 beside 1e9: all sums are exact.
    let small: Vec<f64> = noise.take(1000).iter().map(|v| (v * 1024.0).round() / 1_048_576.0).collect();
    let large: Vec<f64> = small.iter().map(|v| 1e9 + v).collect();
    let mut log = Log::new(vec![channel("y", &large), channel("c", [0.1; 1000])], 1.0).unwrap();
    let segments = log.segments(&["y"], &[rows("1..1000")]).unwrap();
    let mean = Offset::estimate(Detrend::Mean, &log, "y", &segments).unwrap();
    log.remove("y", &mean);
    let expected = small.iter().sum::<f64>() / 1000.0;
    // The offset itself is rounded: half of 1.2e-7.
    let rest = &log.channel("y").unwrap().values;
    assert!(rest.iter().zip(&small).all(|(rest, v)| (rest - (v - expected)).abs() < 6e-8));
    // A constant channel is zero to the bit.
    let constant = Offset::estimate(Detrend::Mean, &log, "c", &segments).unwrap();
    assert_eq!(constant.level, 0.1);
}

#[test]
fn a_part_is_cut_where_the_log_is() {
    let u = channel("u", [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    let y = channel("y", [0.5, 1.5, NAN, 3.5, 4.5, 5.5]);
    // The clock has a gap before the fourth row.
    let time = vec![0.0, 0.1, 0.2, 0.9, 1.0, 1.1];
    let log = Log::with_time(vec![u.clone(), y.clone()], time).unwrap();
    let joined = Log::join(vec![log.clone(), log.clone()]).unwrap();
    assert_eq!((joined.segment_starts(), joined.boundaries()), (&[3, 6, 9][..], &[6][..]));

    let all = log.part(&["u", "y"], rows("1..6")).unwrap();
    assert_eq!(
        (all.sample_time(), all.time(), all.segment_starts()),
        (log.sample_time(), log.time(), log.segment_starts())
    );
    let part = joined.part(&["y"], rows("5..11")).unwrap();
    let values = &part.channels()[0].values;
    assert!(values[4].is_nan() && [&values[..4], &values[5..]].concat() == [4.5, 5.5, 0.5, 1.5, 3.5, 4.5]);
    assert_eq!((part.rows(), part.segment_starts(), part.boundaries()), (7, &[2, 5][..], &[2][..]));
    assert_eq!((part.sample_time(), part.before()), (log.sample_time(), 1.0));
    assert_eq!(part.part(&["y"], rows("2..3")).unwrap().before(), 1.1);
    // A gap that the part begins with is none.
    assert!(log.part(&["u"], rows("4..6")).unwrap().segment_starts().is_empty());
    assert!(log.part(&["w"], rows("1..2")).is_err() && log.part(&["u"], rows("1..7")).is_err());
}

#[test]
fn a_stored_log_comes_back() {
    let log = Log::with_time(vec![channel("y", [1.0, 2.0, 3.0, 4.0])], vec![0.0, 0.1, 0.5, 0.6]).unwrap();
    let joined = Log::join(vec![log.clone(), log]).unwrap();
    let again = |starts: &[usize], boundaries: &[usize], time: Option<Vec<f64>>| {
        Log::restored(
            joined.channels().to_vec(),
            joined.sample_time(),
            time,
            starts.to_vec(),
            boundaries.to_vec(),
            joined.before(),
        )
    };
    let time = joined.time().map(<[f64]>::to_vec);
    assert_eq!(again(joined.segment_starts(), joined.boundaries(), time.clone()).unwrap(), joined);
    for (starts, boundaries) in
        [(&[2, 8][..], &[][..]), (&[0], &[]), (&[4, 2], &[]), (&[2, 4], &[5]), (&[4, 4], &[4])]
    {
        assert!(again(starts, boundaries, time.clone()).is_err(), "{starts:?} {boundaries:?}");
    }
    assert!(again(&[], &[], Some(vec![0.0; 7])).is_err() && again(&[], &[], Some(vec![NAN; 8])).is_err());
}
