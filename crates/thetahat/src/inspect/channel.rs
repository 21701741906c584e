//! The quality of one channel.

use super::{ChannelQuality, Times, moments, outliers, quantization, saturation};
use crate::Channel;

/// The first rows of outliers that are named.
const NAMED: usize = 20;

/// Looks at the values of a channel as they are. O(N log N).
pub(super) fn quality(channel: &Channel, role: Option<&str>, times: &Times) -> ChannelQuality {
    let rows: Vec<usize> = (0..channel.values.len()).filter(|&row| !channel.values[row].is_nan()).collect();
    let present: Vec<f64> = rows.iter().map(|&row| channel.values[row]).collect();
    let mut quality = ChannelQuality {
        name: channel.name.clone(),
        role: role.map(str::to_owned),
        missing: channel.values.len() - present.len(),
        minimum: None,
        maximum: None,
        mean: None,
        standard_deviation: None,
        trend: None,
        trend_share: None,
        repeated: channel.values.windows(2).filter(|pair| pair[0] == pair[1]).count(),
        longest_hold: 0,
        quantization: None,
        saturation: None,
        outliers: Vec::new(),
        outlier_count: 0,
    };
    let mut sorted = present.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let (Some(&minimum), Some(&maximum)) = (sorted.first(), sorted.last()) else { return quality };

    let scale = moments::scale([minimum, maximum].into_iter());
    let scaled: Vec<f64> = present.iter().map(|value| scale * value).collect();
    let mean = moments::mean(&scaled);
    let square = crate::regression::sum(scaled.iter().map(|value| (value - mean).powi(2)));
    quality.minimum = Some(minimum);
    quality.maximum = Some(maximum);
    quality.mean = Some((mean / scale).clamp(minimum, maximum));
    quality.standard_deviation = Some((square / scaled.len() as f64).sqrt() / scale);
    let elapsed: Vec<f64> = match times {
        Times::Measured(time) => rows.iter().map(|&row| time[row] - time[0]).collect(),
        Times::Uniform(step) => rows.iter().map(|&row| row as f64 * step).collect(),
    };
    if minimum < maximum
        && let Some((slope, share)) = moments::line(&elapsed, &scaled)
    {
        quality.trend = Some(slope / scale).filter(|slope| slope.is_finite());
        quality.trend_share = quality.trend.map(|_| share);
    }

    let runs = saturation::runs(&channel.values);
    quality.longest_hold = runs.iter().map(|run| run.rows).max().unwrap_or(0);
    let levels = saturation::levels(&sorted);
    quality.saturation = saturation::saturation(&runs, &levels);
    let distinct: Vec<f64> = levels.iter().map(|level| level.value).collect();
    quality.quantization = quantization::quantization(&distinct);
    let far = outliers::outliers(&scaled);
    quality.outlier_count = far.len();
    quality.outliers = far.iter().take(NAMED).map(|&position| rows[position] + 1).collect();
    quality
}
