//! The quality of one channel.

use statrs::distribution::{Binomial, DiscreteCDF};

use super::named::{NAMED, ranges};
use super::{ChannelQuality, moments, outliers, quantization, saturation};
use crate::Error;
use crate::data::{Channel, Log, Rows, Times};

/// An outlier so many rows from a jump of another channel is an answer to it, or what it answers.
const ANSWERS: usize = 10;
/// And that so many lie so near has at most this probability where there is nothing in it.
const CHANCE: f64 = 0.01;
/// Of jumps near which no more than this part of all rows lies, each outlier near one is an answer, whatever chance
/// says: a single blow.
const SELDOM: f64 = 0.2;
/// A jump is this part of the largest change, and so many times what nine of ten changes are.
const LARGE: f64 = 0.5;
const RARE: f64 = 10.0;

/// The rows (0-based) at which a channel jumps: a hammer blow, the kick after a step of the set point.
pub(super) fn jumps(values: &[f64]) -> Vec<usize> {
    let changes: Vec<f64> = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    let mut sorted: Vec<f64> = changes.iter().copied().filter(|change| !change.is_nan()).collect();
    if sorted.is_empty() {
        return Vec::new();
    }
    let place = sorted.len() * 9 / 10;
    let (_, usual, above) = sorted.select_nth_unstable_by(place, f64::total_cmp);
    let largest = above.iter().copied().fold(*usual, f64::max);
    let limit = (LARGE * largest).max(RARE * *usual);
    let is_jump = |change: f64| change >= limit && change > 0.0;
    (1..values.len()).filter(|row| is_jump(changes[row - 1])).collect()
}

/// Takes the outliers out of a channel that other channels explain.
pub(super) fn explain(quality: &mut ChannelQuality, all: &[usize], jumps: &[usize], rows: usize) {
    let left = unexplained(all, jumps, rows);
    quality.outlier_count = left.len();
    quality.outliers = left.into_iter().take(NAMED).collect();
}

/// The outliers (rows from 1) that other channels do not explain, by the rows (0-based, sorted) at which these jump:
/// all, but for those near jumps where jumps are seldom, or more lie there than chance brings once in a hundred times.
fn unexplained(all: &[usize], jumps: &[usize], rows: usize) -> Vec<usize> {
    let near = |row: usize| {
        let next = jumps.partition_point(|jump| jump + ANSWERS < row);
        jumps.get(next).is_some_and(|jump| *jump <= row + ANSWERS)
    };
    let covered = (0..rows).filter(|row| near(*row)).count() as f64 / rows as f64;
    let explained = all.iter().filter(|row| near(**row - 1)).count() as u64;
    let by_chance = Binomial::new(covered, all.len() as u64);
    let may_be_chance = || by_chance.map_or(1.0, |chance| chance.sf(explained - 1)) > CHANCE;
    if explained == 0 || covered > SELDOM && may_be_chance() {
        return all.to_vec();
    }
    all.iter().copied().filter(|row| !near(row - 1)).collect()
}

/// The rows (from 1) of the outliers of a channel that others do not explain. O(N log N).
///
/// # Errors
/// [`Error::Data`] for a channel that is not there.
pub(crate) fn outliers_of(log: &Log, name: &str, others: &[String]) -> Result<Vec<usize>, Error> {
    let values = &log.channel(name)?.values;
    let rows: Vec<usize> = (0..values.len()).filter(|&row| !values[row].is_nan()).collect();
    let scale = moments::scale(rows.iter().map(|&row| values[row]));
    let scaled: Vec<f64> = rows.iter().map(|&row| scale * values[row]).collect();
    let far: Vec<usize> =
        outliers::outliers(&scaled).into_iter().map(|position| rows[position] + 1).collect();
    if far.is_empty() {
        return Ok(far);
    }
    let mut all = Vec::new();
    for other in others {
        all.extend(jumps(&log.channel(other)?.values));
    }
    all.sort_unstable();
    Ok(unexplained(&far, &all, values.len()))
}

/// A run of equal values of so many rows may be a sensor that is stuck.
const STUCK: usize = 20;
/// And so many times the longest other one.
const ALONE: usize = 4;

/// The rows of the longest run of equal values inside of a log, where no other one comes near it and the channel moves
/// otherwise: one that goes from level to level, or is at rest to its rounding, has more of them.
fn stuck(values: &[f64]) -> Option<Rows> {
    let (mut row, mut longest, mut second, mut repeated) = (0, 0..0, 0, 0);
    for run in values.chunk_by(|left, right| left == right) {
        let own = row..row + run.len();
        row = own.end;
        if run[0].is_nan() {
            continue;
        }
        repeated += run.len() - 1;
        if own.len() > longest.len() {
            (longest, second) = (own, longest.len());
        } else {
            second = second.max(own.len());
        }
    }
    let inside = longest.start > 0 && longest.end < values.len();
    let alone = longest.len() >= STUCK.max(ALONE * second);
    let moves = 2 * (repeated + 1).saturating_sub(longest.len()) <= values.len() - longest.len();
    (inside && alone && moves).then(|| Rows::from_positions(&longest))
}

/// Looks at the values of a channel as they are; also all rows (1-based) of its outliers. O(N log N); up to 32 bytes
/// for each value besides the values themselves.
pub(super) fn quality(channel: &Channel, role: Option<&str>, times: &Times) -> (ChannelQuality, Vec<usize>) {
    let all = &channel.values;
    // Where nothing is missing, the values serve as they are.
    let rows: Option<Vec<usize>> = all
        .iter()
        .any(|value| value.is_nan())
        .then(|| (0..all.len()).filter(|&row| !all[row].is_nan()).collect());
    let row_of = |position: usize| rows.as_ref().map_or(position, |rows| rows[position]);
    let count = rows.as_ref().map_or(all.len(), Vec::len);
    let mut quality = ChannelQuality {
        missing: all.len() - count,
        missing_rows: ranges(rows.iter().flat_map(|_| (0..all.len()).filter(|&row| all[row].is_nan()))),
        repeated: all.windows(2).filter(|pair| pair[0] == pair[1]).count(),
        longest_hold: saturation::runs(all).map(|run| run.rows).max().unwrap_or(0),
        stuck: stuck(all),
        ..ChannelQuality::without_values(&channel.name, role)
    };
    let mut sorted: Vec<f64> = all.iter().copied().filter(|value| !value.is_nan()).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let (Some(&minimum), Some(&maximum)) = (sorted.first(), sorted.last()) else {
        return (quality, Vec::new());
    };
    quality.minimum = Some(minimum);
    quality.maximum = Some(maximum);
    quality.saturation = saturation::saturation(all, &sorted);
    sorted.dedup();
    quality.quantization = quantization::quantization(&sorted);
    drop(sorted);

    let scale = moments::scale([minimum, maximum].into_iter());
    let scaled: Vec<f64> = (0..count).map(|position| scale * all[row_of(position)]).collect();
    let mean = moments::mean(&scaled);
    let square = thetahat_numerics::regression::sum(scaled.iter().map(|value| (value - mean).powi(2)));
    quality.mean = Some((mean / scale).clamp(minimum, maximum));
    quality.standard_deviation = Some((square / count as f64).sqrt() / scale);
    let elapsed = |position: usize| match times {
        Times::Measured(time) => time[row_of(position)] - time[0],
        Times::Uniform(step) => row_of(position) as f64 * step,
    };
    if minimum < maximum
        && let Some((slope, share)) = moments::line(elapsed, &scaled)
    {
        quality.trend = Some(slope / scale).filter(|slope| slope.is_finite());
        quality.trend_share = quality.trend.map(|_| share);
    }
    let far: Vec<usize> =
        outliers::outliers(&scaled).into_iter().map(|position| row_of(position) + 1).collect();
    quality.outlier_count = far.len();
    quality.outliers = far.iter().take(NAMED).copied().collect();
    (quality, far)
}
