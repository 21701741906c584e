//! Fewer points for the same picture.
//!
//! The rows are cut into as many equal segments as the picture can show. Of each only the smallest and the largest
//! value stay, in their order: no peak is lost, as it would be by leaving out samples, or made smaller, as by averaging
//! (Steinarsson 2013, Downsampling Time Series for Visual Representation, section 2).

/// Digits beyond this are below a pixel.
const DIGITS: i32 = 7;

/// The points of a line; a NaN interrupts it.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Curve {
    pub(super) x: Vec<f64>,
    pub(super) y: Vec<f64>,
}

/// What is known of a row that stays.
#[derive(Clone, Copy)]
struct Kept {
    row: usize,
    /// How often the line was interrupted up to here.
    gaps: usize,
}

/// At most about `points` points of a signal, its first and last value among them. The line is interrupted where values
/// are missing and where the clock steps back or by more than `longest`. A signal of no more rows stays as it is.
pub(super) fn decimate(time: &[f64], values: &[f64], points: usize, longest: f64) -> Curve {
    let rows = time.len().min(values.len());
    let usable = |row: &usize| values[*row].is_finite() && time[*row].is_finite();
    let (Some(first), Some(last)) = ((0..rows).find(usable), (0..rows).rfind(usable)) else {
        return Curve::default();
    };
    let width = if rows <= points { 1 } else { rows.div_ceil((points / 2).max(1)) };
    let mut curve = Curve::default();
    let (mut gaps, mut shown) = (0, 0);
    for start in (first..=last).step_by(width) {
        let mut kept: Vec<Kept> = Vec::with_capacity(4);
        let (mut low, mut high): (Option<Kept>, Option<Kept>) = (None, None);
        for row in start..(start + width).min(last + 1) {
            if !usable(&row) {
                gaps += 1;
                continue;
            }
            let step = if row > first { time[row] - time[row - 1] } else { longest };
            // A NaN was a gap already.
            if step <= 0.0 || step > longest {
                gaps += 1;
            }
            let now = Kept { row, gaps };
            if low.is_none_or(|low| values[row] < values[low.row]) {
                low = Some(now);
            }
            if high.is_none_or(|high| values[row] > values[high.row]) {
                high = Some(now);
            }
            if row == first || row == last {
                kept.push(now);
            }
        }
        kept.extend(low);
        kept.extend(high);
        kept.sort_by_key(|kept| kept.row);
        kept.dedup_by_key(|kept| kept.row);
        for Kept { row, gaps } in kept {
            if gaps > shown {
                curve.push(time[row], f64::NAN);
                shown = gaps;
            }
            curve.push(time[row], values[row]);
        }
    }
    Curve { x: rounded(&curve.x), y: rounded(&curve.y) }
}

impl Curve {
    fn push(&mut self, x: f64, y: f64) {
        self.x.push(x);
        self.y.push(y);
    }
}

/// The same with as many digits as a picture of them can show.
pub(super) fn rounded(values: &[f64]) -> Vec<f64> {
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    let (low, high) = finite()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    // What does not change needs digits of its own before those that do.
    let common = (low.abs().max(high.abs()) / (high - low)).log10().ceil();
    let digits = DIGITS + if common.is_finite() { common.clamp(0.0, 9.0) as i32 } else { 0 };
    values.iter().map(|value| significant(*value, digits)).collect()
}

/// A number with this many significant digits.
pub(super) fn significant(value: f64, digits: i32) -> f64 {
    let decimals = usize::try_from(digits - 1).unwrap_or(0);
    // The shortest decimal number is what JSON shows.
    format!("{value:.decimals$e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests;
