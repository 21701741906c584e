//! Values far from their neighbours.

/// Values before and after that a value is compared with.
pub(super) const HALF: usize = 3;
pub(super) const WINDOW: usize = 2 * HALF + 1;
/// This many scales away a value is an outlier.
pub(super) const THRESHOLD: f64 = 8.0;
/// With fewer values there are no neighbours to speak of.
pub(super) const FEWEST: usize = 2 * WINDOW;
/// The fraction of values that are no outliers for sure.
pub(super) const ORDINARY: f64 = 0.98;
/// The size that this many standard normal variables stay below.
pub(super) const NORMAL_SIZE: f64 = 2.326_347_874_040_841;

/// The positions of values that lie more than 8 scales off the median of the seven values around them.
///
/// This is Hampel's filter (Hampel 1974; Pearson 2002) with one scale for the whole signal, the larger of
///
/// - the distance to the median that 2 % exceed, over 2.326: the standard deviation of normal distances. The median of
///   all distances, which Hampel takes, would call short pulses of an input outliers: what happens so often is the
///   signal;
/// - the median change from one value to the next, where they change at all: a stepped or rounded signal moves so far.
///
/// The median of seven follows a step without delay, so edges are not outliers. A signal with other jumps as large goes
/// from level to level: of that, a value between its largest and smallest other ones is a short stay at a level and no
/// outlier. Normal noise reaches 8 deviations once in 10^15 values. O(N). The values have sizes near 1 or below.
pub(super) fn outliers(values: &[f64]) -> Vec<usize> {
    if values.len() < FEWEST {
        return Vec::new();
    }
    let of_position = |(position, value): (usize, &f64)| {
        let first = position.saturating_sub(HALF).min(values.len() - WINDOW);
        let mut window = [0.0; WINDOW];
        window.copy_from_slice(&values[first..first + WINDOW]);
        distance(*value, window)
    };
    let changes = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|change| *change > 0.0);
    let change = quantile(&mut changes.collect::<Vec<_>>(), 0.5);
    let distances: Vec<f64> = values.iter().enumerate().map(of_position).collect();
    let distance = quantile(&mut distances.clone(), ORDINARY) / NORMAL_SIZE;
    let limit = THRESHOLD * distance.max(change);
    let far = |position: usize| distances[position] > limit;
    let mut outliers: Vec<usize> = (0..values.len()).filter(|&position| far(position)).collect();
    let jump = |position: usize| {
        !far(position - 1) && !far(position) && (values[position] - values[position - 1]).abs() > limit
    };
    if !outliers.is_empty() && (1..values.len()).any(jump) {
        let others = || (0..values.len()).filter(|&position| !far(position)).map(|position| values[position]);
        let range = others().fold(f64::INFINITY, f64::min)..=others().fold(f64::NEG_INFINITY, f64::max);
        outliers.retain(|&position| !range.contains(&values[position]));
    }
    outliers
}

/// How far a value is from the median of a window.
pub(super) fn distance(value: f64, mut window: [f64; WINDOW]) -> f64 {
    window.sort_unstable_by(f64::total_cmp);
    (value - window[HALF]).abs()
}

/// The value that a fraction of all values stays below; 0 of none.
fn quantile(values: &mut [f64], fraction: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let position = ((values.len() - 1) as f64 * fraction).round() as usize;
    *values.select_nth_unstable_by(position, f64::total_cmp).1
}
