//! Look-up tables: cubic polynomials between knots, held beyond the first and the last knot.

use thetahat_core::Number;

/// A function of one number, piece by piece. Between the knots k_i and k_(i+1), with s = x - k_i, it is
///
/// ```text
/// f(x) = c0 + c1 s + c2 s² + c3 s³
/// ```
///
/// and beyond the first and the last knot it is its value there. A derivative at a knot between two pieces is that of
/// the piece to its right, at the first and the last knot that of the only piece there. Evaluating it is a binary
/// search.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Table {
    /// At least two, rising.
    knots: Vec<f64>,
    /// The coefficients c0 … c3 of each piece.
    pieces: Vec<[f64; 4]>,
    /// The value at the first knot and at the last.
    ends: [f64; 2],
    /// The highest power of any piece.
    degree: u8,
}

impl Table {
    /// Straight lines through values at knots that rise.
    pub(super) fn lines(knots: &[f64], values: &[f64]) -> Self {
        let pieces = knots.windows(2).zip(values.windows(2)).map(|(knots, values)| {
            let slope = (values[1] - values[0]) / (knots[1] - knots[0]);
            [values[0], slope, 0.0, 0.0]
        });
        Self::of(knots, values, pieces.collect())
    }

    /// Cubic polynomials that have these values and slopes at knots that rise (Hermite).
    pub(super) fn cubics(knots: &[f64], values: &[f64], slopes: &[f64]) -> Self {
        let ends = knots.windows(2).zip(values.windows(2)).zip(slopes.windows(2));
        let pieces = ends.map(|((knots, values), slopes)| {
            let h = knots[1] - knots[0];
            let chord = (values[1] - values[0]) / h;
            let (first, second) = (slopes[0] - chord, slopes[1] - chord);
            [values[0], slopes[0], -(2.0 * first + second) / h, (first + second) / (h * h)]
        });
        Self::of(knots, values, pieces.collect())
    }

    fn of(knots: &[f64], values: &[f64], pieces: Vec<[f64; 4]>) -> Self {
        let highest = |piece: &[f64; 4]| piece.iter().rposition(|c| *c != 0.0).unwrap_or(0) as u8;
        let degree = pieces.iter().map(highest).max().unwrap_or(0);
        let ends = [values.first(), values.last()].map(|end| end.copied().unwrap_or(f64::NAN));
        Self { knots: knots.to_vec(), pieces, ends, degree }
    }

    /// The number that it is everywhere, if it is one.
    pub(super) fn constant(&self) -> Option<f64> {
        (self.degree == 0 && self.ends[0] == self.ends[1]).then_some(self.ends[0])
    }

    /// Whether the derivative of this order is 0 everywhere.
    pub(super) fn ends_before(&self, order: u8) -> bool {
        order > self.degree
    }

    /// The derivative of this order at x, the function itself where the order is 0; NaN where x is.
    #[inline]
    pub(super) fn value<S: Number<f64>>(&self, order: u8, x: S) -> S {
        let (at, knots) = (x.value(), self.knots.as_slice());
        if at.is_nan() {
            return x;
        }
        let last = knots.len() - 1;
        let beyond = |end: f64| if order == 0 { end.into() } else { 0.0.into() };
        if at < knots[0] {
            return beyond(self.ends[0]);
        }
        if at > knots[last] {
            return beyond(self.ends[1]);
        }
        let piece = knots.partition_point(|knot| *knot <= at).min(last) - 1;
        let [a, b, c, d] = derived(self.pieces[piece], order);
        let s = x - knots[piece];
        ((s * d + c) * s + b) * s + a
    }

    /// The knots.
    pub(crate) fn knots(&self) -> &[f64] {
        &self.knots
    }

    /// The coefficients of the derivative of this order, piece after piece.
    pub(crate) fn pieces(&self, order: u8) -> impl Iterator<Item = [f64; 4]> {
        self.pieces.iter().map(move |piece| derived(*piece, order))
    }

    /// What the derivative of this order is before the first knot and after the last one.
    pub(crate) fn ends(&self, order: u8) -> [f64; 2] {
        if order == 0 { self.ends } else { [0.0; 2] }
    }
}

/// The coefficients of a derivative of a cubic polynomial.
fn derived([a, b, c, d]: [f64; 4], order: u8) -> [f64; 4] {
    match order {
        0 => [a, b, c, d],
        1 => [b, 2.0 * c, 3.0 * d, 0.0],
        2 => [2.0 * c, 6.0 * d, 0.0, 0.0],
        3 => [6.0 * d, 0.0, 0.0, 0.0],
        _ => [0.0; 4],
    }
}
