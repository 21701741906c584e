//! What is known of the values of a channel.

use std::ops::Range;

use faer::fx128;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_numerics::regression::{extended_product, extended_sum};

use super::identify::{ROUNDING, constant};
use crate::Error;
use crate::model::Orders;

/// What the pieces together say of a channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub(super) struct Totals {
    /// Samples that count for the mean; none of the past.
    rows: usize,
    /// Their sum, and what that number lacks.
    sum: [f64; 2],
    /// That of their squares, where the model asks for it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    squares: Option<[f64; 2]>,
    /// The least and the largest of them; none where there is none.
    pub(super) range: Option<[f64; 2]>,
    pub(super) missing: usize,
}

impl Totals {
    /// Those of a channel of a piece, its past being left out; the samples in `segments` count.
    pub(super) fn of(values: &[f64], past: usize, segments: &[Range<usize>]) -> Self {
        let sum = added(segments.iter().map(|rows| extended_sum(&values[rows.clone()])));
        let each = || segments.iter().flat_map(|rows| &values[rows.clone()]).copied();
        let range = each().fold(None, |range: Option<[f64; 2]>, value| {
            let [least, largest] = range.unwrap_or([value; 2]);
            Some([least.min(value), largest.max(value)])
        });
        let missing = values[past..].iter().filter(|value| value.is_nan()).count();
        Self { rows: segments.iter().map(Range::len).sum(), sum, squares: None, range, missing }
    }

    /// The same with the sum of squares.
    pub(super) fn with_squares(self, values: &[f64], segments: &[Range<usize>]) -> Self {
        let squares = segments.iter().map(|rows| &values[rows.clone()]).map(|own| extended_product(own, own));
        Self { squares: Some(added(squares)), ..self }
    }

    pub(super) fn add(&mut self, other: &Self) {
        let both = |one: [f64; 2], other: [f64; 2]| added([whole(one), whole(other)].into_iter());
        self.sum = both(self.sum, other.sum);
        self.squares = self.squares.zip(other.squares).map(|(own, more)| both(own, more));
        self.rows += other.rows;
        self.missing += other.missing;
        self.range = match (self.range, other.range) {
            (Some([a, b]), Some([c, d])) => Some([a.min(c), b.max(d)]),
            (own, more) => own.or(more),
        };
    }

    /// Zero where there is no sample.
    pub(super) fn mean(&self) -> f64 {
        if self.rows == 0 { 0.0 } else { (whole(self.sum) / fx128::from_f64(self.rows as f64)).0 }
    }

    /// The standard deviation, where squares were summed.
    pub(super) fn deviation(&self) -> Option<f64> {
        let (sum, rows) = (whole(self.sum), fx128::from_f64(self.rows as f64));
        let about = whole(self.squares?).sub_accurate(sum * sum / rows) / rows;
        Some(about.0.max(0.0).sqrt())
    }

    /// What is told to be taken from the channel, or its mean. None without a sample that counts.
    ///
    /// # Errors
    /// [`Error::Undetermined`] if nothing but rounding is left of an output, or an input that the orders use.
    pub(super) fn level(
        &self,
        name: &str,
        told: Option<f64>,
        input: Option<usize>,
        orders: &Orders,
    ) -> Option<Result<f64, Error>> {
        let [least, largest] = self.range?;
        let level = told.unwrap_or_else(|| self.mean());
        let used = input.is_none_or(|input| orders.nb[input] > 0);
        let size = |least: f64, largest: f64| least.abs().max(largest.abs());
        let rests = used && size(least - level, largest - level) <= ROUNDING * size(least, largest);
        Some(if rests { Err(constant(name, input, Some(orders), false)) } else { Ok(level) })
    }

    pub(super) fn is_finite(&self) -> bool {
        self.sum.iter().chain(self.squares.iter().flatten()).all(|value| value.is_finite())
    }
}

/// A sum, and what that number lacks.
fn added(numbers: impl Iterator<Item = fx128>) -> [f64; 2] {
    let sum = numbers.fold(fx128::ZERO, fx128::add_accurate);
    [sum.0, sum.1]
}

fn whole([sum, rest]: [f64; 2]) -> fx128 {
    fx128::from_f64(sum).add_accurate(fx128::from_f64(rest))
}
