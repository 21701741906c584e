//! Static curves: w = f(z).
//!
//! ```text
//! lines         f(z) = sum_i v_i H_i(z)              H_i the hat of knot i; straight on for a quarter of the range beyond
//!                                                    the ends, and constant from there
//! polynomial    f(z) = sum_i c_i ((z - m)/s)^p_i
//! ```
//!
//! Both are linear in their numbers v or c.

/// The form of a curve. Its numbers stand with the other parameters.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Curve {
    /// Straight lines from knot to knot.
    Lines {
        /// Two at least, rising.
        knots: Vec<f64>,
        /// A knot at which the curve is 0, where its level is that of another.
        pinned: Option<usize>,
    },
    /// A sum of powers.
    Polynomial {
        /// m.
        middle: f64,
        /// s.
        scale: f64,
        /// p_i.
        powers: Vec<i32>,
    },
}

/// The values of the basis that are not 0, with their places among the numbers of a curve.
pub(super) type Basis = Vec<(usize, f64)>;

impl Curve {
    /// How many numbers it has.
    pub(super) fn size(&self) -> usize {
        match self {
            Self::Lines { knots, pinned } => knots.len() - usize::from(pinned.is_some()),
            Self::Polynomial { powers, .. } => powers.len(),
        }
    }

    /// Between which arguments lines rise and fall.
    pub(super) fn reach(knots: &[f64]) -> [f64; 2] {
        let (first, last) = (knots[0], knots[knots.len() - 1]);
        let beyond = (last - first) / 4.0;
        [first - beyond, last + beyond]
    }

    /// The number of a knot; none of the one that is pinned.
    pub(super) fn place(pinned: Option<usize>, knot: usize) -> Option<usize> {
        match pinned {
            Some(pinned) if pinned == knot => None,
            Some(pinned) if pinned < knot => Some(knot - 1),
            _ => Some(knot),
        }
    }

    /// f(z) and f'(z); the basis at z goes to `basis`.
    pub(super) fn evaluate(&self, z: f64, numbers: &[f64], basis: &mut Basis) -> (f64, f64) {
        basis.clear();
        match self {
            Self::Lines { knots, pinned } => {
                let last = knots.len() - 1;
                let [low, high] = Self::reach(knots);
                let inside = z.clamp(low, high);
                let left = knots.partition_point(|knot| *knot <= inside).clamp(1, last) - 1;
                let width = knots[left + 1] - knots[left];
                let share = (inside - knots[left]) / width;
                let mut ends = [0.0; 2];
                for (side, weight) in [1.0 - share, share].into_iter().enumerate() {
                    if let Some(place) = Self::place(*pinned, left + side) {
                        ends[side] = numbers[place];
                        basis.push((place, weight));
                    }
                }
                let slope = if inside == z { (ends[1] - ends[0]) / width } else { 0.0 };
                (ends[0] + share * (ends[1] - ends[0]), slope)
            }
            Self::Polynomial { middle, scale, powers } => {
                let x = (z - middle) / scale;
                let mut sum = (0.0, 0.0);
                for (place, (&power, number)) in powers.iter().zip(numbers).enumerate() {
                    let value = x.powi(power);
                    basis.push((place, value));
                    sum.0 += number * value;
                    if power > 0 {
                        sum.1 += number * f64::from(power) * x.powi(power - 1) / scale;
                    }
                }
                sum
            }
        }
    }

    /// The numbers with which it is about another function: that function at the knots; of a polynomial the linear
    /// part through two points.
    pub(super) fn like(&self, function: impl Fn(f64) -> f64) -> Vec<f64> {
        match self {
            Self::Lines { knots, pinned } => {
                let level = pinned.map_or(0.0, |pinned| function(knots[pinned]));
                let others = knots.iter().enumerate().filter(|(knot, _)| *pinned != Some(*knot));
                others.map(|(_, knot)| function(*knot) - level).collect()
            }
            Self::Polynomial { middle, scale, powers } => {
                let (low, high) = (function(middle - scale), function(middle + scale));
                let number = |power: &i32| match power {
                    0 => (low + high) / 2.0,
                    1 => (high - low) / 2.0,
                    _ => 0.0,
                };
                powers.iter().map(number).collect()
            }
        }
    }
}

/// Up to so many knots for these values: halfway between places through which as many values go and places that are as
/// far apart, not nearer to one another than a quarter of that, with some values between any two. The ends are the
/// least and the largest value.
pub(super) fn knots(mut values: Vec<f64>, count: usize) -> Option<Vec<f64>> {
    values.sort_by(f64::total_cmp);
    let (first, last) = (*values.first()?, *values.last()?);
    if !(last > first && (last - first).is_finite()) {
        return None;
    }
    let even = (last - first) / (count - 1) as f64;
    let below = |knot: f64| values.partition_point(|value| *value <= knot);
    let mut knots = vec![first];
    for place in 1..count - 1 {
        let many = values[place * (values.len() - 1) / (count - 1)];
        let (knot, before) = ((many + first + even * place as f64) / 2.0, knots[knots.len() - 1]);
        let is_apart = knot - before > even / 4.0 && last - knot > even / 4.0;
        // Not in a hole that values jump over.
        if is_apart && below(knot) >= below(before) + FEWEST && below(knot) + FEWEST <= values.len() {
            knots.push(knot);
        }
    }
    knots.push(last);
    Some(knots)
}

/// Values between two knots.
const FEWEST: usize = 5;
