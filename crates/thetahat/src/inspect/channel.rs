//! The quality of one channel.

use super::{ChannelQuality, moments, outliers, quantization, saturation};
use crate::data::{Channel, Rows, Times};

/// The first rows of outliers that are named.
pub(super) const NAMED: usize = 20;

/// A run of equal values of so many rows may be a sensor that is stuck.
const STUCK: usize = 20;
/// And so many times the longest other one.
const ALONE: usize = 4;

/// The rows of the longest run of equal values, where no other one comes near it: a channel that moves in steps has more of them.
fn stuck(values: &[f64]) -> Option<Rows> {
    let (mut row, mut longest, mut second) = (0, 0..0, 0);
    for run in values.chunk_by(|left, right| left == right) {
        let own = row..row + run.len();
        row = own.end;
        if run[0].is_nan() {
            continue;
        }
        if own.len() > longest.len() {
            (longest, second) = (own, longest.len());
        } else {
            second = second.max(own.len());
        }
    }
    let alone = longest.len() >= STUCK.max(ALONE * second) && longest.len() < values.len();
    alone.then(|| Rows::from_positions(&longest))
}

/// Looks at the values of a channel as they are. O(N log N); up to 32 bytes for each value besides the values themselves.
pub(super) fn quality(channel: &Channel, role: Option<&str>, times: &Times) -> ChannelQuality {
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
        repeated: all.windows(2).filter(|pair| pair[0] == pair[1]).count(),
        longest_hold: saturation::runs(all).map(|run| run.rows).max().unwrap_or(0),
        stuck: stuck(all),
        ..ChannelQuality::without_values(&channel.name, role)
    };
    let mut sorted: Vec<f64> = all.iter().copied().filter(|value| !value.is_nan()).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let (Some(&minimum), Some(&maximum)) = (sorted.first(), sorted.last()) else { return quality };
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
    let far = outliers::outliers(&scaled);
    quality.outlier_count = far.len();
    quality.outliers = far.iter().take(NAMED).map(|&position| row_of(position) + 1).collect();
    quality
}
