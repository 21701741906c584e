//! How often each value is there, in bounded memory.

/// At most this many values wait to be counted, and no more than this for each that is kept.
const WAITING: usize = 1 << 16;
const FOR_EACH: usize = 4;

/// The values of a signal and how often each is there: exact while they are few, else rounded to as many bits as there
/// is room for.
///
/// A value is a whole number in the order of all numbers (IEEE 754, section 5.10). Where there are more than `most` of
/// them, the last bit that is left is dropped, from all and for good: cells of 2^d numbers become cells of 2^(d+1). A
/// cell is as wide as 2^(d - 52) of its values, so that a quantile is exact to half of that, in relative terms. Which
/// bits are dropped depends on the values alone, not on their order or on the parts that they came in.
///
/// Source: Epicoco et al., UDDSketch: accurate tracking of quantiles in data streams, IEEE Access 8 (2020), after
/// Masson, Rim and Lee, DDSketch, Proceedings of the VLDB Endowment 12 (2019); cells are those of the binary
/// representation. O(log M) for a value, O(M) memory.
#[derive(Debug)]
pub(in crate::inspect) struct Counts {
    most: usize,
    dropped: u32,
    /// Cells in rising order.
    cells: Vec<(u64, u64)>,
    waiting: Vec<u64>,
}

impl Counts {
    /// Room for this many values.
    pub(in crate::inspect) fn new(most: usize) -> Self {
        Self { most, dropped: 0, cells: Vec::new(), waiting: Vec::new() }
    }

    /// A value that is there.
    pub(in crate::inspect) fn push(&mut self, value: f64) {
        self.waiting.push(place(value));
        if self.waiting.len() >= WAITING.min(FOR_EACH.saturating_mul(self.most)) {
            self.settle();
        }
    }

    /// Counts what waits.
    pub(in crate::inspect) fn settle(&mut self) {
        self.waiting.sort_unstable();
        let waiting = std::mem::take(&mut self.waiting);
        let new = waiting.chunk_by(|a, b| a == b).map(|cell| (cell[0], cell.len() as u64));
        let mut cells = Vec::with_capacity(self.cells.len() + waiting.len().min(self.most));
        let mut known = self.cells.iter().copied().peekable();
        for (place, count) in new {
            while let Some(cell) = known.next_if(|(other, _)| *other < place) {
                cells.push(cell);
            }
            cells.push((place, count));
        }
        cells.extend(known);
        self.cells = cells;
        self.joined();
        while self.cells.len() > self.most {
            self.dropped += 1;
            self.joined();
        }
        self.cells.shrink_to_fit();
        self.waiting = waiting;
        self.waiting.clear();
    }

    /// Makes those of one cell one.
    fn joined(&mut self) {
        let mask = u64::MAX << self.dropped;
        self.cells.iter_mut().for_each(|(place, _)| *place &= mask);
        self.cells.dedup_by(|(later, more), (first, count)| {
            let same = later == first;
            *count += if same { *more } else { 0 };
            same
        });
    }

    /// Whether no bit was dropped.
    pub(in crate::inspect) fn is_exact(&self) -> bool {
        self.dropped == 0
    }

    /// The values in rising order, the middle of its cell for each, and how often they are there. All are settled.
    pub(in crate::inspect) fn values(&self) -> impl Iterator<Item = (f64, u64)> {
        let middle = if self.dropped == 0 { 0 } else { 1 << (self.dropped - 1) };
        self.cells.iter().map(move |&(place, count)| (value(place | middle), count))
    }

    /// The value at a position in rising order; none beyond the last.
    pub(in crate::inspect) fn at(&self, position: u64) -> Option<f64> {
        let mut before = 0;
        self.values().find_map(|(value, count)| {
            before += count;
            (position < before).then_some(value)
        })
    }

    /// How many different ones there are.
    pub(in crate::inspect) fn different(&self) -> usize {
        self.cells.len()
    }

    /// How many there are.
    pub(in crate::inspect) fn count(&self) -> u64 {
        self.cells.iter().map(|(_, count)| count).sum()
    }
}

/// The place of a number in the order of all; both zeros have the same.
fn place(value: f64) -> u64 {
    let bits = (value + 0.0).to_bits();
    if bits >> 63 == 0 { bits | 1 << 63 } else { !bits }
}

fn value(place: u64) -> f64 {
    f64::from_bits(if place >> 63 == 1 { place & !(1 << 63) } else { !place })
}
