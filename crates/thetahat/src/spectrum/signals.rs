//! The signals of a log as spectra need them: deviations, scaled alike.

use std::ops::Range;

use crate::Error;
use crate::data::{Detrend, Log, Offset};
use crate::figures::short;

/// The deviations of inputs and output, the output last, each in units in which its largest is near 1: squares neither
/// overflow nor vanish.
pub(super) struct Signals {
    /// One for each channel; what lies outside of the segments is as it was.
    pub(super) channels: Vec<Vec<f64>>,
    /// The unit of each channel.
    pub(super) units: Vec<f64>,
    /// The rows without a missing value (0-based), in their order.
    pub(super) segments: Vec<Range<usize>>,
}

impl Signals {
    /// # Errors
    /// [`Error::Undetermined`] for an input that is constant in all segments; [`Error::Data`] for a constant output,
    /// and as for an [`Offset`].
    pub(super) fn new(
        log: &Log,
        inputs: &[String],
        output: &str,
        segments: Vec<Range<usize>>,
        detrend: Detrend,
    ) -> Result<Self, Error> {
        let (mut channels, mut units) = (Vec::new(), Vec::new());
        for name in inputs.iter().map(String::as_str).chain([output]) {
            let values = &log.channel(name)?.values;
            let offset = Offset::estimate(detrend, log, name, &segments)?;
            // A power of two: nothing is rounded.
            let first = segments.first().map_or(0.0, |segment| values[segment.start]);
            let (mut moves, mut largest) = (false, 0.0_f64);
            for segment in &segments {
                let own = &values[segment.clone()];
                moves |= own.iter().any(|value| *value != first);
                largest = own.iter().fold(largest, |largest, value| largest.max(value.abs()));
            }
            let plain = offset.slope == 0.0;
            let deviation =
                |row: usize| values[row] - if plain { offset.level } else { offset.at(log.elapsed(row)) };
            let mut size = 0.0_f64;
            for segment in &segments {
                let own = &values[segment.clone()];
                size = if plain {
                    own.iter().fold(size, |size, value| size.max((value - offset.level).abs()))
                } else {
                    segment.clone().fold(size, |size, row| size.max(deviation(row).abs()))
                };
            }
            // What is left of a line or of a constant is rounding.
            if !moves || size <= 1e-13 * largest {
                let level = short(first);
                return Err(if name == output {
                    Error::in_channel(
                        name,
                        None,
                        format!("the output '{name}' is constant ({level}): it answers nothing"),
                    )
                } else {
                    Error::undetermined(
                        Vec::new(),
                        format!(
                            "the input '{name}' is constant ({level}): it excites nothing; leave it out, or record a log in which \
                             it changes"
                        ),
                    )
                });
            }
            let unit = size.log2().round().clamp(-1000.0, 1000.0).exp2();
            let inverse = 1.0 / unit;
            let mut scaled = vec![0.0; values.len()];
            for segment in &segments {
                if plain {
                    let own = scaled[segment.clone()].iter_mut().zip(&values[segment.clone()]);
                    own.for_each(|(into, value)| *into = (value - offset.level) * inverse);
                } else {
                    segment.clone().for_each(|row| scaled[row] = deviation(row) * inverse);
                }
            }
            channels.push(scaled);
            units.push(unit);
        }
        Ok(Self { channels, units, segments })
    }

    /// How many inputs there are.
    pub(super) fn inputs(&self) -> usize {
        self.channels.len() - 1
    }

    /// The length of the longest segment.
    pub(super) fn longest(&self) -> usize {
        self.segments.iter().map(Range::len).max().unwrap_or(0)
    }

    /// All samples.
    pub(super) fn samples(&self) -> usize {
        self.segments.iter().map(Range::len).sum()
    }

    /// The channels two by two, the last one with itself where it is alone: their numbers.
    pub(super) fn pairs(&self) -> impl Iterator<Item = (usize, usize)> {
        let count = self.channels.len();
        (0..count).step_by(2).map(move |first| (first, (first + 1).min(count - 1)))
    }
}
