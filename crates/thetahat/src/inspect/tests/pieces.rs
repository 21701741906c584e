//! An inspection part by part is that of the whole log.

use super::super::pieces::counts::Counts;
use super::super::pieces::far::Distances;
use super::super::run;
use super::*;
use crate::tests::assert_refused;

/// A plant with noise behind two inputs, one of which is late, and a copy of the first.
fn log(rows: usize) -> Vec<(&'static str, Vec<f64>)> {
    let u1 = telegraph(1, rows, 0.2);
    let u2: Vec<f64> = normal(2, rows).iter().map(|u| (20.0 * u).round() / 8.0 + 300.0).collect();
    let driven = sum_of(&late(&u1, 3), 0.4, &late(&u2.iter().map(|u| u - 300.0).collect::<Vec<_>>(), 1));
    let plant = divided(&[-0.8], &driven);
    let y: Vec<f64> = sum_of(&plant, 0.3, &divided(&[-0.5], &normal(3, rows)));
    let drifting = y.iter().enumerate().map(|(row, y)| y + 1e-3 * row as f64 + 40.0).collect();
    let copy = u1.iter().map(|u| 7.0 - 2.0 * u).collect();
    vec![("u1", u1), ("u2", u2), ("u3", copy), ("y", drifting)]
}

fn views<'a>(channels: &'a [(&'static str, Vec<f64>)]) -> Vec<(&'a str, &'a [f64])> {
    channels.iter().map(|(name, values)| (*name, values.as_slice())).collect()
}

/// The inspections of the whole, and of parts that end at some rows.
fn both(
    channels: &[(&'static str, Vec<f64>)],
    time: Option<&[f64]>,
    plan: &InspectionPlan,
    ends: &[usize],
) -> [Inspection; 2] {
    let times = |rows: Range<usize>| match time {
        Some(time) => Times::Measured(time[rows].to_vec()),
        None => Times::Uniform(0.5),
    };
    let rows = channels[0].1.len();
    let whole = run::inspect(recording(&views(channels), times(0..rows)), &source(), plan).unwrap();
    let mut pieces = PiecewiseInspection::new(plan.clone()).unwrap();
    let mut first = 0;
    for &end in ends.iter().chain([&rows]) {
        let part: Vec<(&str, &[f64])> =
            channels.iter().map(|(name, values)| (*name, &values[first..end])).collect();
        pieces.add(recording(&part, times(first..end))).unwrap();
        first = end;
    }
    [whole, pieces.finish(&source()).unwrap()]
}

fn assert_close(left: f64, right: f64, tolerance: f64, what: &str) {
    let size = left.abs().max(right.abs());
    assert!((left - right).abs() <= tolerance * size, "{what}: {left} {right}");
}

/// What is exact but for rounding.
fn assert_same_rows(whole: &Inspection, pieces: &Inspection) {
    assert_eq!(whole.rows, pieces.rows);
    let exact = |clock: &Clock| (clock.sample_time, clock.measured, clock.steps, clock.gaps, clock.irregular);
    assert_eq!(exact(&whole.clock), exact(&pieces.clock));
    assert!((whole.clock.jitter - pieces.clock.jitter).abs() < 1e-9);
    for (whole, pieces) in whole.channels.iter().zip(&pieces.channels) {
        let figures = |of: &ChannelQuality| [of.mean, of.standard_deviation, of.trend, of.trend_share];
        for (left, right) in figures(whole).into_iter().zip(figures(pieces)) {
            assert_eq!(left.is_some(), right.is_some());
            assert_close(left.unwrap_or(0.0), right.unwrap_or(0.0), 1e-9, &whole.name);
        }
        let same = ChannelQuality {
            mean: whole.mean,
            standard_deviation: whole.standard_deviation,
            trend: whole.trend,
            trend_share: whole.trend_share,
            ..pieces.clone()
        };
        assert_eq!(*whole, same);
    }
}

/// The same for excitation.
fn assert_same_excitation(whole: &Inspection, pieces: &Inspection, tolerance: f64) {
    assert_eq!(whole.excitation.len(), pieces.excitation.len());
    for (whole, pieces) in whole.excitation.iter().zip(&pieces.excitation) {
        let figures = |of: &Excitation| (of.order, of.highest, of.changes, of.same_as.clone());
        assert_eq!(figures(whole), figures(pieces));
        assert_eq!(whole.spectrum.len(), pieces.spectrum.len());
        let largest = whole.spectrum.iter().fold(0.0_f64, |largest, point| largest.max(point.density));
        for (left, right) in whole.spectrum.iter().zip(&pieces.spectrum) {
            assert_eq!(left.frequency, right.frequency);
            assert!((left.density - right.density).abs() <= tolerance * largest, "{left:?} {right:?}");
        }
    }
}

#[test]
fn parts_tell_what_the_whole_tells() {
    let channels = log(12_000);
    let plan = plan(&["u1", "u2", "u3"], Some("y"));
    for ends in [&[6000][..], &[5000, 5100, 5101, 7300], &[4999, 10_999, 11_998, 11_999]] {
        let [whole, pieces] = both(&channels, None, &plan, ends);
        assert_same_rows(&whole, &pieces);
        assert_same_excitation(&whole, &pieces, 1e-10);
        assert_eq!(pieces.excitation[2].same_as.as_deref(), Some("u1"));
        for (whole, pieces) in whole.delays.iter().zip(&pieces.delays) {
            assert_eq!(whole.nk, pieces.nk);
            assert!((whole.confidence.unwrap_or(0.0) - pieces.confidence.unwrap_or(0.0)).abs() < 0.05);
            if whole.input == "u3" {
                continue;
            }
            assert_eq!(whole.correlation.len(), pieces.correlation.len());
            let pairs = whole.correlation.iter().zip(&pieces.correlation);
            let following = whole.following.iter().zip(&pieces.following);
            // The first samples of a segment are left out: a hundredth of all.
            assert!(pairs.chain(following).all(|(left, right)| (left - right).abs() < 0.02));
        }
        assert_eq!(pieces.delays[0].nk, Some(3));
        let found = |inspection: &Inspection| -> Vec<bool> {
            inspection.feedback.iter().map(|feedback| feedback.found).collect()
        };
        assert_eq!(found(&whole), found(&pieces));
        // Nothing is missing that is not named.
        let new: Vec<String> =
            pieces.warnings().into_iter().filter(|warning| !whole.warnings().contains(warning)).collect();
        let first = ends[0];
        assert_eq!(new, [format!("impulse responses and feedback are those of the first {first} rows")]);
    }
}

#[test]
fn what_is_missing_and_gaps_may_lie_at_the_boundary() {
    let mut channels = log(9000);
    let mut time: Vec<f64> = (0..9000).map(|row| 0.25 * f64::from(row)).collect();
    for &(channel, row) in &[(0, 4000), (3, 3999), (1, 6001), (3, 0), (3, 8999), (0, 8000), (0, 8001)] {
        channels[channel].1[row] = f64::NAN;
    }
    time[5000..].iter_mut().for_each(|time| *time += 10.0);
    time[7500..].iter_mut().for_each(|time| *time += 0.5);
    // Holds and outliers across boundaries.
    channels[3].1[4995..5010].fill(1.0);
    for row in [4001, 5998, 6000, 8998] {
        channels[3].1[row] = 1e4;
    }
    let plan = plan(&["u1", "u2"], Some("y"));
    for ends in [&[4000, 5000, 6000, 8000][..], &[4001, 5001, 7500, 8999], &[5003, 5005, 6002]] {
        let [whole, pieces] = both(&channels, Some(&time), &plan, ends);
        assert_same_rows(&whole, &pieces);
        assert_eq!((pieces.clock.gaps, pieces.channels[3].longest_hold), (2, 15));
        assert_eq!(pieces.channels[3].outliers, [4002, 5999, 6001, 8999]);
        assert_same_excitation(&whole, &pieces, 1e-9);
        let nk = |of: &Inspection| of.delays.iter().map(|delay| delay.nk).collect::<Vec<_>>();
        assert_eq!(nk(&whole), nk(&pieces));
    }
}

#[test]
fn one_part_is_the_whole() {
    let channels = log(3000);
    let [whole, pieces] = both(&channels, None, &plan(&["u1"], Some("y")), &[]);
    assert_eq!(whole, pieces);
    // An irregular clock, too: it is resampled.
    let mut noise = Noise(5);
    let time: Vec<f64> = (0..3000).map(|row| f64::from(row) + 0.4 * noise.uniform()).collect();
    let [whole, pieces] = both(&channels, Some(&time), &plan(&["u1"], Some("y")), &[]);
    assert_eq!(whole, pieces);
    assert!(pieces.log.resampled.is_some());
}

#[test]
fn what_the_clock_forbids_is_named() {
    let channels = log(6000);
    let plan = plan(&["u1"], Some("y"));
    let left_out = |time: &[f64], words: &str| {
        let [whole, pieces] = both(&channels, Some(time), &plan, &[2000, 4000]);
        assert_same_rows(&whole, &pieces);
        assert!(pieces.excitation.is_empty() && pieces.delays.is_empty() && pieces.feedback.is_empty());
        assert!(pieces.warnings().iter().any(|warning| warning.contains(words)), "{:?}", pieces.warnings());
    };
    let regular: Vec<f64> = (0..6000).map(f64::from).collect();
    let mut time = regular.clone();
    time[4000] = 3999.0;
    left_out(&time, "the time repeats at row 4001");
    time[4000] = 3000.0;
    left_out(&time, "the time does not run forward");
    time = regular.iter().map(|time| if *time < 1000.0 { 2.0 * time } else { time + 1000.0 }).collect();
    left_out(&time, "the clock has 1000 gaps");
    left_out(&time, "the clock is another one at the beginning");
    time = regular.iter().map(|time| time + 0.3 * (time % 2.0)).collect();
    left_out(&time, "the log is not uniform");
}

#[test]
fn a_step_test_is_named_and_no_other_log() {
    let noise = normal(13, 4000);
    let ramp: Vec<f64> = noise.iter().enumerate().map(|(row, x)| row as f64 + 0.01 * x).collect();
    let steps: Vec<f64> = (0..4000).map(|row| f64::from(row / 1500)).collect();
    for (input, named) in [(steps, true), (ramp, false), (noise.clone(), false), (vec![2.0; 4000], false)] {
        let output = sum_of(&late(&input, 1), 0.1, &noise);
        let channels = vec![("u", input), ("y", output)];
        let [_, pieces] = both(&channels, None, &plan(&["u"], Some("y")), &[2000]);
        assert_eq!(pieces.warnings().iter().any(|words| words.contains("begins at rest")), named);
    }
}

#[test]
fn levels_that_move_cost_no_digits() {
    // The first part rests at zero; then the plant runs at a level a million deviations above.
    let [input, mut output] = [normal(11, 9000), normal(12, 9000)];
    output = sum_of(&late(&input, 2), 0.1, &output);
    let moved = |values: &[f64]| -> Vec<f64> {
        values.iter().enumerate().map(|(row, x)| if row < 3000 { 0.0 } else { x + 1e6 }).collect()
    };
    let channels = vec![("u", moved(&input)), ("y", moved(&output))];
    let [whole, pieces] = both(&channels, None, &plan(&["u"], Some("y")), &[3000, 6000]);
    assert_same_rows(&whole, &pieces);
    assert_same_excitation(&whole, &pieces, 1e-9);
}

#[test]
fn a_part_that_is_refused_changes_nothing() {
    let channels = log(4000);
    let part = |rows: Range<usize>, times| {
        let own: Vec<(&str, &[f64])> =
            channels.iter().map(|(name, values)| (*name, &values[rows.clone()])).collect();
        recording(&own, times)
    };
    let plan = plan(&["u1"], Some("y"));
    let uniform = Times::Uniform(1.0);
    let mut pieces = PiecewiseInspection::new(plan.clone()).unwrap();
    let refused = |pieces: &mut PiecewiseInspection, part: Recording, words: &str| {
        assert_refused(pieces.add(part), words);
    };
    refused(&mut pieces, part(0..0, uniform.clone()), "no rows");
    refused(&mut pieces, part(0..9, Times::Uniform(0.0)), "not a positive number");
    refused(&mut pieces, part(0..2, Times::Measured(vec![0.0, f64::NAN])), "not a finite number");
    pieces.add(part(0..2000, uniform.clone())).unwrap();
    let mut wrong = part(2000..4000, uniform.clone());
    wrong.channels[1].values[3] = f64::INFINITY;
    refused(&mut pieces, wrong.clone(), "is infinite in row 4");
    wrong.channels.truncate(1);
    refused(&mut pieces, wrong, "other channels");
    refused(&mut pieces, part(0..2, Times::Measured(vec![0.0, 1.0])), "another clock");
    refused(&mut pieces, part(0..2, Times::Uniform(2.0)), "another clock");
    pieces.add(part(2000..4000, uniform)).unwrap();
    let clean = pieces.finish(&source()).unwrap();
    let mut pieces = PiecewiseInspection::new(plan).unwrap();
    pieces.add(part(0..2000, Times::Uniform(1.0))).unwrap();
    pieces.add(part(2000..4000, Times::Uniform(1.0))).unwrap();
    assert_eq!(clean, pieces.finish(&source()).unwrap());
    let nothing = PiecewiseInspection::new(InspectionPlan::default()).unwrap().finish(&source());
    assert_refused(nothing, "no rows");
    let resampled = InspectionPlan {
        resample: Some(Resample::new(1.0, Interpolation::Hold)),
        ..InspectionPlan::default()
    };
    assert!(matches!(PiecewiseInspection::new(resampled), Err(Error::Argument { .. })));
    // A role that no channel has.
    let mut pieces = PiecewiseInspection::new(self::plan(&["w"], None)).unwrap();
    refused(&mut pieces, part(0..9, Times::Uniform(1.0)), "no channel 'w'");
}

#[test]
fn counts_are_exact_while_there_is_room_and_close_beyond() {
    let values = normal(21, 40_000);
    let mut sorted = values.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let of = |values: &mut dyn Iterator<Item = &f64>, most: usize| {
        let mut counts = Counts::new(most);
        values.for_each(|value| counts.push(*value));
        counts.settle();
        counts
    };
    let exact = of(&mut values.iter(), 1 << 16);
    assert!(exact.is_exact() && exact.values().map(|(value, _)| value).eq(sorted.iter().copied()));
    let close = of(&mut values.iter(), 1 << 10);
    assert!(!close.is_exact() && close.values().count() <= 1 << 10 && close.count() == 40_000);
    for position in [0, 10, 400, 20_000, 39_999] {
        let (found, expected) = (close.at(position as u64).unwrap(), sorted[position]);
        assert_close(found, expected, 0.02, "a quantile");
    }
    assert_eq!(close.at(40_000), None);
    // Neither their order nor when they are settled matters.
    let mut backward = of(&mut values.iter().rev().take(1000), 1 << 10);
    values[..39_000].iter().for_each(|value| backward.push(*value));
    backward.settle();
    assert!(backward.values().eq(close.values()));
    let mut zeros = of(&mut [0.0, -0.0, -1.0, f64::MAX, f64::MIN, 5e-324].iter(), 9);
    zeros.settle();
    let expected = [(f64::MIN, 1), (-1.0, 1), (0.0, 2), (5e-324, 1), (f64::MAX, 1)];
    assert!(zeros.values().eq(expected));
}

#[test]
fn a_channel_of_too_many_values_says_so_where_it_is_rounded() {
    let rows = 140_000;
    let smooth: Vec<f64> = (0..rows).map(|row| (0.37 * f64::from(row)).sin()).collect();
    let counted: Vec<f64> = (0..rows).map(|row| 0.25 * f64::from(row * 7919 % rows)).collect();
    let stepped: Vec<f64> = counted.iter().map(|value| value % 16.0).collect();
    let channels = vec![("smooth", smooth), ("counted", counted), ("stepped", stepped)];
    let [whole, pieces] = both(&channels, None, &plan(&[], None), &[70_000]);
    let steps = |of: &Inspection| of.channels.iter().map(|channel| channel.quantization).collect::<Vec<_>>();
    assert_eq!(steps(&whole), [None, Some(0.25), Some(0.25)]);
    assert_eq!(steps(&pieces), [None, None, Some(0.25)]);
    let words: Vec<String> =
        pieces.warnings().into_iter().filter(|words| words.contains("different values")).collect();
    assert_eq!(
        words,
        ["channel 'counted' has more than 65536 different values: what it is rounded to is left out"]
    );
}

#[test]
fn outliers_are_those_of_the_whole_while_they_are_few() {
    let jumps: Vec<f64> = (0..5000).map(|row| f64::from(row / 500 % 2) * 50.0).collect();
    let mut stepped = sum_of(&jumps, 0.1, &normal(31, 5000));
    let mut smooth = normal(32, 5000);
    for (row, value) in [(0, 70.0), (3, -40.0), (2500, 25.0), (4997, 1e3), (4999, -1e3)] {
        stepped[row] = value;
        smooth[row] = value;
    }
    for signal in [stepped, smooth, vec![0.0; 5000], normal(33, 13), normal(34, 14)] {
        let mut distances = Distances::new(1 << 14);
        signal.iter().enumerate().for_each(|(row, value)| distances.push(*value, row));
        let far = distances.finish();
        assert_eq!(far.rows, outliers::outliers(&signal));
        assert!(!far.more);
    }
    // There is room for the farthest only.
    let spiky: Vec<f64> = normal(35, 5000)
        .iter()
        .enumerate()
        .map(|(row, x)| if row % 100 == 9 { 50.0 + row as f64 } else { *x })
        .collect();
    let mut distances = Distances::new(20);
    spiky.iter().enumerate().for_each(|(row, value)| distances.push(*value, row));
    let far = distances.finish();
    assert!(far.more && (20..40).contains(&far.rows.len()) && far.rows.iter().all(|row| row % 100 == 9));
    assert_eq!(far.rows.last(), Some(&4909));
}
