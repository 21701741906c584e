//! What one input excites, and which inputs are the same, in one pass.

use std::slice;

use thetahat_numerics::regression::{ExtendedGram, Lagged, LaggedMoments, Presample, Taps};

use super::part::Part;
use crate::inspect::spectrum::Periodograms;
use crate::inspect::{Excitation, excitation, moments, rest};

/// A pair of inputs of which this fraction of the squares differs in any part is not the same.
const APART: f64 = 1e-9;

/// The sums of one input so far.
pub(super) struct InputTotals {
    scale: f64,
    /// What is taken from the scaled values: the mean of the first part.
    level: f64,
    moments: Option<LaggedMoments>,
    periodograms: Option<Periodograms>,
    /// Of the segment that goes on at the end of the rows: where its next window begins, counted back from there.
    ahead: Option<usize>,
    changes: usize,
    pairs: usize,
    /// How often it leaves a value that it held.
    steps: usize,
    total: f64,
    count: f64,
}

impl InputTotals {
    /// How far lags reach, and how long windows are, is that of the first part.
    pub(super) fn new(part: &Part<'_>, input: usize, scale: f64) -> Self {
        let values = part.log.channels()[input].values.as_slice();
        let segments = part.segments(&[values]);
        let inside = || segments.iter().flat_map(|segment| &values[segment.clone()]);
        let level = moments::mean_of(|| inside().map(|value| scale * value));
        let samples = moments::samples(&segments);
        let highest = if samples > 0 { excitation::highest(&segments) } else { excitation::HIGHEST };
        let whole = 0..part.log.rows();
        let windows = if samples > 0 { &segments[..] } else { slice::from_ref(&whole) };
        Self {
            scale,
            level,
            moments: highest.checked_sub(1).map(|longest| LaggedMoments::new(&[values], &[], longest)),
            // More rows follow.
            periodograms: Periodograms::new(usize::MAX, windows),
            ahead: None,
            changes: 0,
            pairs: 0,
            steps: 0,
            total: 0.0,
            count: 0.0,
        }
    }

    /// Adds the own rows of a part.
    pub(super) fn add(&mut self, part: &Part<'_>, values: &[f64]) {
        let segments = part.segments(&[values]);
        let centred: Vec<f64> = values.iter().map(|value| self.scale * value - self.level).collect();
        if let Some(moments) = &mut self.moments {
            let own = part.own(&segments, moments.longest());
            moments.merge(&LaggedMoments::new(&[&centred], &own, moments.longest()));
        }
        let mut ahead = None;
        for segment in &segments {
            let own = segment.start.max(part.past)..segment.end;
            self.total += thetahat_numerics::regression::sum(centred[own.clone()].iter().copied());
            self.count += own.len() as f64;
            let moves = |row: usize| row > segment.start && values[row] != values[row - 1];
            let moving = own.clone().filter(|&row| moves(row));
            self.steps += moving.clone().filter(|&row| !moves(row - 1)).count();
            self.changes += moving.count();
            self.pairs += own.len() - usize::from(own.start == segment.start);
            if let Some(periodograms) = &mut self.periodograms {
                // The one that goes on has had some of its windows.
                let begun = if segment.start < part.past { self.ahead } else { None };
                let first = begun.map_or(segment.start, |ahead| part.past - ahead);
                let next = periodograms.add(&centred, first..segment.end);
                ahead = (segment.end == values.len()).then(|| values.len() - next);
            }
        }
        self.ahead = ahead;
    }

    /// Whether it changes as that of a step test does.
    pub(super) fn steps(&self) -> bool {
        let few = self.changes as f64 <= rest::MOVES * self.count;
        self.changes > 0 && self.steps <= rest::FEW_CHANGES && few
    }

    /// What it excites; none of its rows follow. `moves`: whether it is not constant to rounding.
    pub(super) fn excitation(&mut self, name: &str, moves: bool, sample_time: f64) -> Excitation {
        let moments = self.moments.as_ref().filter(|moments| moments.rows() > 0 && moments.is_finite());
        let order = moments.map_or(0, |moments| excitation::rank_of(moments.covariance()));
        let spectrum = self.periodograms.take().map_or_else(Vec::new, |mut periodograms| {
            periodograms.remove(self.total / self.count.max(1.0));
            periodograms.points(if moves { 1.0 / self.scale } else { 0.0 }, sample_time)
        });
        Excitation {
            input: name.to_owned(),
            order: if moves { order.min(self.changes) } else { 0 },
            highest: moments.map_or(0, |moments| moments.longest() + 1),
            changes: self.changes as f64 / self.pairs.max(1) as f64,
            spectrum,
            same_as: None,
        }
    }
}

/// Two inputs that have been the same so far, but for scale and offset.
pub(super) struct Twins {
    pub(super) later: usize,
    pub(super) earlier: usize,
    /// The sums of their products, of which 1 - r^2 keeps its digits.
    products: Option<ExtendedGram>,
}

impl Twins {
    /// All pairs, the earlier ones first.
    pub(super) fn all(inputs: usize) -> Vec<Self> {
        let pair = |later, earlier| Self { later, earlier, products: None };
        (0..inputs).flat_map(|later| (0..later).map(move |earlier| pair(later, earlier))).collect()
    }

    fn taps() -> Vec<Taps> {
        vec![Taps { signal: 1, first: 0, count: 1, sign: 1.0 }]
    }

    /// Adds the own rows of a part; says whether they may still be the same.
    pub(super) fn add(&mut self, part: &Part<'_>, signals: &[&[f64]]) -> bool {
        let pair = [signals[self.later], signals[self.earlier]];
        let segments = part.own(&part.segments(&pair), 0);
        let holds = |signal: &[f64]| {
            let mut all = segments.iter().flat_map(|segment| &signal[segment.clone()]);
            let first = all.next();
            all.all(|value| Some(value) == first)
        };
        match pair.map(holds) {
            [true, true] => {}
            [false, false] => {
                let both = LaggedMoments::new(&pair, &segments, 0);
                let (later, earlier) = ((0, 0), (1, 0));
                let product = both.product(later, earlier);
                let square = both.product(later, later);
                let rest = square - product / both.product(earlier, earlier) * product;
                // Squares out of range tell nothing.
                if rest > APART * square {
                    return false;
                }
            }
            _ => return false,
        }
        let products = ExtendedGram::of(&Lagged::new(&pair, Self::taps(), &segments, Presample::Drop));
        match &mut self.products {
            Some(sum) => sum.merge(&products),
            None => self.products = Some(products),
        }
        true
    }

    /// Whether their correlation is 1 or -1 to rounding, over all rows.
    pub(super) fn are_the_same(&self) -> bool {
        let Some(products) = self.products.as_ref().filter(|products| products.is_in_range()) else {
            return false;
        };
        let columns: Vec<_> = std::iter::once((0, 1.0)).chain(ExtendedGram::columns(&Self::taps())).collect();
        let whole = products.spread(1);
        products.solve(&columns, 1).is_ok_and(|solved| {
            whole > 0.0 && solved.residual_norm * solved.residual_norm <= excitation::SAME * whole
        })
    }
}
