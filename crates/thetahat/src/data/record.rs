use std::ops::Range;

use super::{Log, Rows, checked};
use crate::Error;

/// The signals of one experiment as estimators see them.
///
/// Every segment is a range of 0-based samples inside all of the signals, without a missing value; in a record of
/// [`Log::driven_record`] the output alone may miss some (NaN).
#[derive(Debug, Clone)]
pub struct Record<'a> {
    /// y(t), N values.
    pub output: &'a [f64],
    /// u_j(t), N values each.
    pub inputs: Vec<&'a [f64]>,
    /// Segments of consecutive samples, in rising order, apart from each other.
    pub segments: Vec<Range<usize>>,
    /// How many usable samples stand directly before each segment: the measured past that a response may start from.
    pub past: Vec<usize>,
}

impl<'a> Record<'a> {
    /// A record of one segment without missing values.
    ///
    /// # Errors
    /// [`Error::Data`] if lengths differ, there is no sample, or one is not finite.
    pub fn new(output: &'a [f64], inputs: Vec<&'a [f64]>) -> Result<Self, Error> {
        let length = output.len();
        if length == 0 {
            return Err(Error::data("the record has no samples"));
        }
        for (position, input) in inputs.iter().enumerate() {
            if input.len() != length {
                return Err(Error::data(format!(
                    "input {} has {} samples, the output has {length}; they must be as many",
                    position + 1,
                    input.len()
                )));
            }
        }
        for signal in inputs.iter().chain([&output]) {
            if let Some(position) = signal.iter().position(|value| !value.is_finite()) {
                return Err(Error::data(format!(
                    "sample {} is not finite; build a Log to mark missing samples",
                    position + 1
                )));
            }
        }
        Ok(Self { output, inputs, segments: std::iter::once(0..length).collect(), past: vec![0] })
    }

    /// The same with further inputs after its own.
    pub(crate) fn with_inputs(&self, signals: &'a [Vec<f64>]) -> Self {
        let inputs = self.inputs.iter().copied().chain(signals.iter().map(Vec::as_slice)).collect();
        Self { inputs, ..self.clone() }
    }
}

impl Log {
    /// The signals of some channels over some rows. Segments end where a sample of any of them is missing.
    ///
    /// # Errors
    /// [`Error::Data`] for a name or rows that are not there; [`Error::Argument`] for rows that overlap.
    pub fn record(&self, inputs: &[String], output: &str, rows: &[Rows]) -> Result<Record<'_>, Error> {
        self.record_between(inputs, output, rows, true)
    }

    /// The same with segments that end only where a sample of an input is missing: where the output misses one, it is
    /// NaN.
    ///
    /// For models of which the errors do not depend on past outputs, A = C = D = 1: they go on through such a hole, and
    /// the errors in it do not count. And for free runs of any model.
    ///
    /// # Errors
    /// As for [`record`](Self::record).
    ///
    /// ```
    /// use thetahat::data::{Channel, Log};
    ///
    /// let u = Channel { name: "u".into(), values: vec![0.0, 1.0, 1.0, 2.0] };
    /// let y = Channel { name: "y".into(), values: vec![0.0, f64::NAN, 0.5, 0.5] };
    /// let log = Log::new(vec![u, y], 0.1)?;
    /// let rows = ["1..4".parse()?];
    /// assert_eq!(log.record(&["u".into()], "y", &rows)?.segments, [0..1, 2..4]);
    /// assert_eq!(log.driven_record(&["u".into()], "y", &rows)?.segments, [0..4]);
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn driven_record(&self, inputs: &[String], output: &str, rows: &[Rows]) -> Result<Record<'_>, Error> {
        self.record_between(inputs, output, rows, false)
    }

    fn record_between(
        &self,
        inputs: &[String],
        output: &str,
        rows: &[Rows],
        measured: bool,
    ) -> Result<Record<'_>, Error> {
        self.check_uniform()?;
        let signal = |name: &str| Ok(self.channel(name)?.values.as_slice());
        let names: Vec<&str> = inputs.iter().map(String::as_str).chain(measured.then_some(output)).collect();
        let output = signal(output)?;
        let inputs: Vec<&[f64]> = inputs.iter().map(|name| signal(name)).collect::<Result<_, Error>>()?;
        let needed: Vec<&[f64]> = inputs.iter().copied().chain(measured.then_some(output)).collect();
        let segments = self.segments(&names, &checked("rows", rows, self.rows())?)?;
        let usable = |row: usize| needed.iter().all(|values| !values[row].is_nan());
        // In one pass: the row after the last missing sample before each segment.
        let (mut first, mut seen) = (0, 0);
        let past = segments.iter().map(|segment| {
            if let Some(missing) = (seen..segment.start).rev().find(|row| !usable(*row)) {
                first = missing + 1;
            }
            seen = segment.start;
            // Or that after the last gap of the clock.
            let starts = self.segment_starts().partition_point(|&start| start <= segment.start);
            let start = if starts == 0 { 0 } else { self.segment_starts()[starts - 1] };
            segment.start - first.max(start)
        });
        let past = past.collect();
        Ok(Record { output, inputs, segments, past })
    }
}
