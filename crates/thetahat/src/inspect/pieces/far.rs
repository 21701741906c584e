//! Values far from their neighbours, in one pass.

use super::counts::Counts;
use crate::inspect::outliers::{FEWEST, HALF, NORMAL_SIZE, ORDINARY, THRESHOLD, WINDOW, distance};

/// What [`outliers`](crate::inspect::outliers::outliers) asks of a signal: the distances of its values from the median
/// of the seven around them, its changes, and the largest of both. The limit follows from two quantiles, which are
/// exact to 2^-10 or better (see [`Counts`]); all else is as in one piece, while no more values are beyond it than
/// there is room for.
#[derive(Debug)]
pub(in crate::inspect) struct Distances {
    /// The last values that are there, and their rows.
    window: Vec<(f64, usize)>,
    count: usize,
    distances: Counts,
    changes: Counts,
    last: Option<(f64, f64)>,
    farthest: Largest<(usize, f64)>,
    /// Of the values that are not among them.
    range: [f64; 2],
    /// The changes between two values, by the larger of their distances.
    pairs: Largest<f64>,
    /// Of the pairs that are not among them.
    largest_change: f64,
}

/// What is far.
#[derive(Debug, Default)]
pub(in crate::inspect) struct Far {
    /// The rows (0-based) in rising order.
    pub(in crate::inspect) rows: Vec<usize>,
    /// Whether there are more, closer to their neighbours than these.
    pub(in crate::inspect) more: bool,
}

impl Distances {
    /// With room for this many values of each kind.
    pub(in crate::inspect) fn new(most: usize) -> Self {
        Self {
            window: Vec::with_capacity(WINDOW),
            count: 0,
            distances: Counts::new(most),
            changes: Counts::new(most),
            last: None,
            farthest: Largest::new(most),
            range: [f64::INFINITY, f64::NEG_INFINITY],
            pairs: Largest::new(most),
            largest_change: 0.0,
        }
    }

    /// The next value that is there.
    pub(in crate::inspect) fn push(&mut self, value: f64, row: usize) {
        // Halves, so that no difference leaves the range of numbers.
        let value = 0.5 * value;
        if self.window.len() == WINDOW {
            self.window.remove(0);
        }
        self.window.push((value, row));
        self.count += 1;
        match self.count {
            ..WINDOW => {}
            // The first window is that of the first values, too.
            WINDOW => (0..=HALF).for_each(|position| self.take(position)),
            _ => self.take(HALF),
        }
    }

    /// The value at a position of the window.
    fn take(&mut self, position: usize) {
        let (value, row) = self.window[position];
        let mut window = [0.0; WINDOW];
        window.iter_mut().zip(&self.window).for_each(|(into, (value, _))| *into = *value);
        let distance = distance(value, window);
        self.distances.push(distance);
        let range = &mut self.range;
        self.farthest.push(distance, (row, value), |(_, value)| {
            *range = [range[0].min(value), range[1].max(value)];
        });
        if let Some((before, its_distance)) = self.last.replace((value, distance)) {
            let change = (value - before).abs();
            if change > 0.0 {
                self.changes.push(change);
            }
            let largest = &mut self.largest_change;
            self.pairs.push(distance.max(its_distance), change, |change| *largest = largest.max(change));
        }
    }

    /// What is far; no value follows.
    pub(in crate::inspect) fn finish(&mut self) -> Far {
        if self.count < FEWEST {
            return Far::default();
        }
        (HALF + 1..WINDOW).for_each(|position| self.take(position));
        self.distances.settle();
        self.changes.settle();
        let quantile = |counts: &Counts, fraction: f64| {
            let last = counts.count().saturating_sub(1);
            counts.at((last as f64 * fraction).round() as u64).unwrap_or(0.0)
        };
        let ordinary = quantile(&self.distances, ORDINARY) / NORMAL_SIZE;
        let limit = THRESHOLD * ordinary.max(quantile(&self.changes, 0.5));
        let jumps = self.pairs.kept.iter().filter(|(distance, _)| *distance <= limit);
        let jump = jumps.map(|(_, change)| *change).fold(self.largest_change, f64::max) > limit;
        let (far, near): (Vec<_>, Vec<_>) =
            self.farthest.kept.iter().partition(|(distance, _)| *distance > limit);
        let others = near.iter().map(|(_, (_, value))| *value);
        let [low, high] = others.fold(self.range, |[low, high], value| [low.min(value), high.max(value)]);
        let outside = |value: f64| !jump || !(low..=high).contains(&value);
        let mut rows: Vec<usize> =
            far.iter().filter(|(_, (_, value))| outside(*value)).map(|(_, (row, _))| *row).collect();
        rows.sort_unstable();
        Far { rows, more: self.farthest.left > limit }
    }
}

/// The items of the largest keys.
#[derive(Debug)]
struct Largest<T> {
    most: usize,
    kept: Vec<(f64, T)>,
    /// The largest key of those that were let go.
    left: f64,
}

impl<T: Copy> Largest<T> {
    /// Room for this many.
    fn new(most: usize) -> Self {
        Self { most, kept: Vec::new(), left: f64::NEG_INFINITY }
    }

    /// Keeps an item, or lets it or others go.
    fn push(&mut self, key: f64, item: T, mut let_go: impl FnMut(T)) {
        if key <= self.left {
            return let_go(item);
        }
        self.kept.push((key, item));
        if self.kept.len() >= 2 * self.most {
            self.kept.select_nth_unstable_by(self.most, |(left, _), (right, _)| right.total_cmp(left));
            for (key, item) in self.kept.drain(self.most..) {
                self.left = self.left.max(key);
                let_go(item);
            }
        }
    }
}
