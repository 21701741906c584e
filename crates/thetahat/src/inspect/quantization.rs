//! The step of which all values are multiples.

use crate::data::shortest;

/// Below this fraction of the largest value, a difference is rounding of floating-point arithmetic.
const ROUNDING: f64 = 1e-13;
/// With fewer different values there is no telling a step from a choice of levels.
const FEWEST: usize = 8;
/// A step is that of a converter of 24 bits at most; finer ones are how the numbers are printed.
const MOST_STEPS: f64 = 16_777_216.0;
/// A step is told from the rounding of decimal printing from this many units of the last printed place on.
const CLEAR: f64 = 10.0;

/// The step of which the differences of all values are multiples; `distinct` in rising order.
///
/// First a step coarser than the printed decimals is searched for, such as 10/4095 printed with seven: an approximate
/// greatest common divisor of the differences between neighbours (Euclid's algorithm with the tolerance of printing),
/// which is then improved over the whole range and verified on every value. Failing that, it is the greatest common
/// divisor of the values in units of their last printed place. None where there are fewer than eight different values,
/// or the step is more than an eighth or less than 2^-24 of the range. O(N).
pub(crate) fn quantization(distinct: &[f64]) -> Option<f64> {
    let (&first, &last) = distinct.first().zip(distinct.last())?;
    let range = last - first;
    if distinct.len() < FEWEST || !range.is_finite() {
        return None;
    }
    let rounding = ROUNDING * first.abs().max(last.abs());
    let place = printed_place(distinct, rounding);
    let printing = rounding + place.map_or(0.0, |place| power_of_ten(-place));
    let step = common_step(distinct, printing).or_else(|| common_multiple(distinct, place?))?;
    (FEWEST as f64 * step <= range && range <= MOST_STEPS * step).then_some(step)
}

fn power_of_ten(exponent: i32) -> f64 {
    // Parsed: the nearest number, which powi does not always give.
    format!("1e{exponent}").parse().unwrap_or(0.0)
}

/// The number of decimals that all values are printed with (negative for tens, hundreds, …), if that is not all that a
/// floating-point number holds.
fn printed_place(values: &[f64], rounding: f64) -> Option<i32> {
    let mut place = i32::MIN;
    let mut unit = f64::INFINITY;
    for &value in values.iter().filter(|value| **value != 0.0) {
        let units = value / unit;
        if unit.is_finite() && (units - units.round()).abs() <= 4.0 * f64::EPSILON * units.abs() {
            continue;
        }
        let shortest = format!("{value:e}");
        let (mantissa, exponent) = shortest.split_once('e')?;
        let decimals = mantissa.split_once('.').map_or(0, |(_, decimals)| decimals.len()) as i32;
        place = place.max(decimals - exponent.parse::<i32>().ok()?);
        unit = power_of_ten(-place);
        if unit <= CLEAR * rounding {
            return None;
        }
    }
    (place > i32::MIN).then_some(place)
}

/// The step clearly coarser than `tolerance`, the error of a difference, of which all differences are multiples.
fn common_step(distinct: &[f64], tolerance: f64) -> Option<f64> {
    let differences = distinct.windows(2).map(|pair| pair[1] - pair[0]);
    // The same level, with rounding.
    let mut differences: Vec<f64> = differences.filter(|difference| *difference > tolerance).collect();
    differences.sort_unstable_by(f64::total_cmp);
    let mut step = *differences.first()?;
    let mut position = 0;
    let (mut multiples, mut length) = (0.0, 0.0);
    while position < differences.len() {
        if step < CLEAR * tolerance {
            return None;
        }
        let difference = differences[position];
        let multiple = (difference / step).round();
        let remainder = (difference - multiple * step).abs();
        // The step is the mean of this many differences, each with an error of one tolerance at most.
        let uncertainty = if multiples > 0.0 { position as f64 / multiples } else { 1.0 };
        if remainder > tolerance * (1.0 + multiple * uncertainty) {
            // At most half of it: this ends soon.
            step = remainder;
            (position, multiples, length) = (0, 0.0, 0.0);
            continue;
        }
        multiples += multiple;
        length += difference;
        step = length / multiples;
        position += 1;
    }
    if step < CLEAR * tolerance {
        return None;
    }
    // All values again, from the first on, with the step that the whole range gives.
    let first = *distinct.first()?;
    let mut counted = 0.0;
    let counts: Vec<f64> = distinct
        .windows(2)
        .map(|pair| {
            counted += ((pair[1] - pair[0]) / step).round();
            counted
        })
        .collect();
    let whole = (distinct.last()? - first) / counted;
    let fits = |(value, count): (&f64, &f64)| (value - first - count * whole).abs() <= 2.0 * tolerance;
    distinct[1..].iter().zip(&counts).all(fits).then(|| shortest(whole, 2.0 * tolerance / counted))
}

/// The greatest common divisor of the differences in units of 10^-place.
fn common_multiple(distinct: &[f64], place: i32) -> Option<f64> {
    let unit = power_of_ten(-place);
    let first = (distinct.first()? / unit).round();
    let divisor =
        distinct.iter().map(|value| ((value / unit).round() - first) as u64).fold(0, greatest_common_divisor);
    format!("{divisor}e{}", -place).parse().ok()
}

fn greatest_common_divisor(mut left: u64, mut right: u64) -> u64 {
    while right != 0 {
        (left, right) = (right, left % right);
    }
    left
}
