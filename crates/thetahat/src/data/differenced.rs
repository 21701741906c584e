//! Signals as their changes from one sample to the next.

use std::ops::Range;

use super::Record;

/// The changes y(t) - y(t-1) and u_j(t) - u_j(t-1) of a record, at the places of the samples that they lead to.
///
/// What is constant is gone from them, and a random walk has become white noise: (1 - q^-1) on both sides of a model
/// leaves its plant as it is (Ljung, System Identification, 2nd ed. 1999, section 14.1).
pub(crate) struct Differenced {
    output: Vec<f64>,
    inputs: Vec<Vec<f64>>,
    segments: Vec<Range<usize>>,
    past: Vec<usize>,
}

impl Differenced {
    pub(crate) fn new(record: &Record<'_>) -> Self {
        let (mut segments, mut past) = (Vec::new(), Vec::new());
        for (segment, before) in record.segments.iter().zip(&record.past) {
            // The first of all has no sample before it.
            let start = segment.start + usize::from(*before == 0);
            if start < segment.end {
                segments.push(start..segment.end);
                past.push(before.saturating_sub(1));
            }
        }
        let changes = |values: &[f64]| {
            let mut changes = vec![0.0; values.len()];
            for (change, pair) in changes[1.min(values.len())..].iter_mut().zip(values.windows(2)) {
                *change = pair[1] - pair[0];
            }
            changes
        };
        let inputs = record.inputs.iter().map(|values| changes(values)).collect();
        Self { output: changes(record.output), inputs, segments, past }
    }

    pub(crate) fn record(&self) -> Record<'_> {
        Record {
            output: &self.output,
            inputs: self.inputs.iter().map(Vec::as_slice).collect(),
            segments: self.segments.clone(),
            past: self.past.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_stand_where_they_lead_to_and_segments_without_a_past_lose_their_first_sample() {
        let y = [1.0, 3.0, 2.0, 2.0, 5.0, 4.0];
        let record =
            Record { output: &y, inputs: vec![&y], segments: vec![0..2, 3..5, 5..6], past: vec![0, 1, 0] };
        let changes = Differenced::new(&record);
        let seen = changes.record();
        assert_eq!(seen.output, [0.0, 2.0, -1.0, 0.0, 3.0, -1.0]);
        assert_eq!(seen.inputs, [seen.output]);
        assert_eq!((seen.segments, seen.past), (vec![1..2, 3..5], vec![0, 0]));
    }
}
