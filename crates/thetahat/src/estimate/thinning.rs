//! Segments of a long record, spread evenly over it, for computations that do not need all samples; and how large the
//! output of a record is.

use std::ops::Range;

use thetahat_numerics::regression::sum_of_squares;

use crate::data::{JointRecord, Record, measured};

/// Records of at least this many samples are thinned where initial parameters are sought: to `SEGMENTS` segments of
/// `SEGMENT` samples each.
pub(crate) const LONG: usize = 1 << 18;
const SEGMENTS: usize = 8;
const SEGMENT: usize = 1 << 12;

/// Copies of the samples of some segments, one segment after the other: the cost of computations with them does not
/// depend on the length of the record that they come from.
#[derive(Debug, Clone)]
pub(crate) struct Packed {
    output: Vec<f64>,
    inputs: Vec<Vec<f64>>,
    segments: Vec<Range<usize>>,
}

impl Packed {
    /// The samples of all segments of a record.
    pub(super) fn of(record: &Record<'_>) -> Self {
        let samples =
            |signal: &[f64]| record.segments.iter().flat_map(|rows| &signal[rows.clone()]).copied().collect();
        let mut end = 0;
        let segments = record.segments.iter().map(|rows| {
            end += rows.len();
            end - rows.len()..end
        });
        let segments = segments.collect();
        let inputs = record.inputs.iter().map(|input| samples(input)).collect();
        Self { output: samples(record.output), inputs, segments }
    }

    /// These samples as a record without measured samples before its segments.
    pub(super) fn record(&self) -> Record<'_> {
        Record {
            output: &self.output,
            inputs: self.inputs.iter().map(Vec::as_slice).collect(),
            segments: self.segments.clone(),
            past: vec![0; self.segments.len()],
        }
    }
}

/// Segments of a long record, spread evenly over its samples; none for a record shorter than [`LONG`].
pub(super) fn thinned(record: &Record<'_>) -> Option<Packed> {
    let total: usize = record.segments.iter().map(Range::len).sum();
    if total < LONG { None } else { thinned_to(record, SEGMENTS, SEGMENT).map(|record| Packed::of(&record)) }
}

/// The rows from which initial parameters are sought: segments spread evenly over all, or, where the segments are
/// short, every k-th of them; none where there are fewer than [`LONG`] rows, so that all are used.
pub(crate) fn segments_of_starts(segments: &[Range<usize>]) -> Option<Vec<Range<usize>>> {
    let total: usize = segments.iter().map(Range::len).sum();
    if total < LONG {
        return None;
    }
    let every = total.div_ceil(SEGMENTS * SEGMENT);
    let some = || segments.iter().step_by(every).cloned().collect();
    Some(thinned_segments(segments, SEGMENTS, SEGMENT).unwrap_or_else(some))
}

/// As [`thinned`], for a record with several outputs: the segments are four times as long.
pub(super) fn thinned_joint<'a>(record: &JointRecord<'a>) -> Option<JointRecord<'a>> {
    let total: usize = record.segments.iter().map(Range::len).sum();
    let segments =
        if total < LONG { None } else { thinned_segments(&record.segments, SEGMENTS, 4 * SEGMENT) }?;
    Some(JointRecord { segments, ..record.clone() })
}

/// A record of `count` segments of at most `length` samples each, spread evenly over the given one; none if they would
/// hold less than half of `count * length` samples, as its segments are short.
pub(crate) fn thinned_to<'a>(record: &Record<'a>, count: usize, length: usize) -> Option<Record<'a>> {
    let segments = thinned_segments(&record.segments, count, length)?;
    let (output, inputs) = (record.output, record.inputs.clone());
    let past = vec![0; segments.len()];
    Some(Record { output, inputs, segments, past })
}

/// The rows of the segments of [`thinned_to`].
fn thinned_segments(all: &[Range<usize>], count: usize, length: usize) -> Option<Vec<Range<usize>>> {
    let total: usize = all.iter().map(Range::len).sum();
    let mut segments = Vec::with_capacity(count);
    let (mut before, mut rest) = (0, all.iter().peekable());
    for position in (0..count).map(|k| k * (total / count)) {
        while let Some(segment) = rest.next_if(|segment| before + segment.len() <= position) {
            before += segment.len();
        }
        if let Some(segment) = rest.peek() {
            let start = segment.start + position - before;
            segments.push(start..segment.end.min(start + length));
        }
    }
    let kept: usize = segments.iter().map(Range::len).sum();
    (2 * kept > count * length).then_some(segments)
}

/// The sum of squares of the output over all segments.
pub(super) fn energy(record: &Record<'_>) -> f64 {
    let square = |rows: &Range<usize>| sum_of_squares(&record.output[rows.clone()]);
    let whole: f64 = record.segments.iter().map(square).sum();
    if !whole.is_nan() {
        return whole;
    }
    record
        .segments
        .iter()
        .flat_map(|segment| measured(record.output, segment))
        .map(|rows| square(&rows))
        .sum()
}

/// Gives `starts` a record without missing outputs: these are interpolated linearly between the measured ones. Initial
/// parameters only have to lie near the minimum.
pub(super) fn filled<T>(record: &Record<'_>, starts: impl FnOnce(&Record<'_>) -> T) -> T {
    let runs = |segment: &Range<usize>| measured(record.output, segment);
    let whole = |segment: &Range<usize>| runs(segment).first() == Some(segment);
    if record.segments.iter().all(whole) {
        return starts(record);
    }
    let mut output = record.output.to_vec();
    let mut segments = Vec::new();
    for segment in &record.segments {
        let runs = runs(segment);
        for pair in runs.windows(2) {
            let (left, right) = (pair[0].end - 1, pair[1].start);
            let slope = (output[right] - output[left]) / (right - left) as f64;
            for row in left + 1..right {
                output[row] = output[left] + slope * (row - left) as f64;
            }
        }
        if let (Some(first), Some(last)) = (runs.first(), runs.last()) {
            segments.push(first.start..last.end);
        }
    }
    let past = vec![0; segments.len()];
    starts(&Record { output: &output, inputs: record.inputs.clone(), segments, past })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packed_segments_hold_the_samples_of_the_record() {
        let output: Vec<f64> = (0..100).map(f64::from).collect();
        let input: Vec<f64> = output.iter().map(|y| -y).collect();
        let segments = vec![10..30, 40..41, 60..100];
        let record = Record { output: &output, inputs: vec![&input], past: vec![3, 0, 0], segments };
        let packed = Packed::of(&record);
        let packed = packed.record();
        assert_eq!(packed.segments, [0..20, 20..21, 21..61]);
        assert_eq!(packed.past, [0; 3]);
        for (own, from) in packed.segments.iter().zip(&record.segments) {
            assert_eq!(packed.output[own.clone()], output[from.clone()]);
            assert_eq!(packed.inputs[0][own.clone()], input[from.clone()]);
        }
        assert_eq!(packed.output.len(), 61);
    }
}
