//! Fewer points for the same picture.
//!
//! The rows are cut into as many equal segments as the picture can show. Of each only the smallest and the largest value
//! stay, in their order: no peak is lost, as it would be by leaving out samples, or made smaller, as by averaging (Steinarsson
//! 2013, Downsampling Time Series for Visual Representation, section 2).

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

/// At most about `points` points of a signal, its first and last value among them. The line is interrupted where values are
/// missing and where the clock steps back or by more than `longest`. A signal of no more rows stays as it is.
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
mod tests {
    use super::*;

    fn seconds(rows: usize) -> Vec<f64> {
        (0..rows).map(|row| row as f64).collect()
    }

    #[test]
    fn short_signals_stay_as_they_are() {
        let curve = decimate(&seconds(4), &[1.0, -2.0, 0.5, 0.5], 4, 1.5);
        assert_eq!(curve, Curve { x: seconds(4), y: vec![1.0, -2.0, 0.5, 0.5] });
        assert_eq!(decimate(&[], &[], 4, 1.5), Curve::default());
        assert_eq!(decimate(&seconds(2), &[f64::NAN; 2], 4, 1.5), Curve::default());
        assert_eq!(decimate(&[3.0], &[7.0], 0, 1.5), Curve { x: vec![3.0], y: vec![7.0] });
    }

    #[test]
    fn peaks_the_first_and_the_last_value_stay_in_their_order() {
        let rows = 100_000;
        let mut values: Vec<f64> = (0..rows).map(|row| (row as f64 * 0.01).sin()).collect();
        (values[31_007], values[31_011], values[77_777]) = (50.0, -60.0, 40.0);
        let curve = decimate(&seconds(rows), &values, 2000, 1.5);
        assert!((1900..=2010).contains(&curve.x.len()), "{}", curve.x.len());
        assert!(curve.x.is_sorted());
        assert_eq!((curve.x[0], curve.x[curve.x.len() - 1]), (0.0, 99_999.0));
        let peak = |value: f64| curve.y.iter().position(|y| *y == value).map(|at| curve.x[at]);
        assert_eq!((peak(50.0), peak(-60.0), peak(40.0)), (Some(31_007.0), Some(31_011.0), Some(77_777.0)));
        // Every point is one of the signal, to the digits shown.
        let close = |(x, y): (&f64, &f64)| (values[*x as usize] - y).abs() < 1e-5;
        assert!(curve.x.iter().zip(&curve.y).all(close));
    }

    #[test]
    fn gaps_stay_gaps() {
        let mut values = vec![1.0; 10_000];
        values[0] = f64::NAN;
        values[5000] = f64::NAN;
        values[7000..9000].fill(f64::NAN);
        let curve = decimate(&seconds(10_000), &values, 100, 1.5);
        assert_eq!(curve.y.iter().filter(|y| y.is_nan()).count(), 2);
        assert!(!curve.y[0].is_nan() && curve.x[0] == 1.0);
        let around = |row: f64| {
            let after = curve.x.iter().position(|x| *x > row).unwrap();
            curve.y[after - 1].is_nan() || curve.y[after].is_nan()
        };
        assert!(around(5000.0) && around(8000.0) && !around(3000.0));

        // A short signal, and a clock that jumps forward or back.
        let curve = decimate(&[0.0, 1.0, 2.0], &[1.0, f64::NAN, 1.0], 10, 1.5);
        assert!(curve.x == [0.0, 2.0, 2.0] && curve.y[1].is_nan());
        let curve = decimate(&[0.0, 1.0, 5.0, 6.0, 0.0, 1.0], &[1.0; 6], 10, 1.5);
        assert_eq!(curve.x, [0.0, 1.0, 5.0, 5.0, 6.0, 0.0, 0.0, 1.0]);
        assert_eq!(curve.y.iter().filter(|y| y.is_nan()).count(), 2);
    }

    #[test]
    fn digits_are_those_that_change() {
        assert_eq!(rounded(&[1.0 / 3.0, -1.0]), [0.333_333_3, -1.0]);
        // Two of the eight digits before the point never change.
        assert_eq!(rounded(&[101_325.123_456_789, 101_326.0]), [101_325.123_456_8, 101_326.0]);
        assert_eq!(rounded(&[0.1 + 0.2, f64::MAX]), [0.3, 1.797_693e308]);
        assert!(rounded(&[f64::NAN])[0].is_nan());
    }
}
