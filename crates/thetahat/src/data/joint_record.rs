use std::ops::Range;

use super::{Log, Rows, checked};
use crate::Error;

/// The signals of an experiment with any number of outputs, as estimators see them.
///
/// Every segment is a range of 0-based samples inside all of the signals, without a missing value in any of them.
#[derive(Debug, Clone)]
pub struct JointRecord<'a> {
    /// u_j(t), N values each.
    pub inputs: Vec<&'a [f64]>,
    /// y_i(t), N values each; at least one.
    pub outputs: Vec<&'a [f64]>,
    /// Segments of consecutive samples, in rising order, apart from each other.
    pub segments: Vec<Range<usize>>,
}

impl<'a> JointRecord<'a> {
    /// A record of one segment without missing values.
    ///
    /// # Errors
    /// [`Error::Data`] if there is no output or no sample, lengths differ, or a sample is not finite.
    pub fn new(inputs: Vec<&'a [f64]>, outputs: Vec<&'a [f64]>) -> Result<Self, Error> {
        let Some(length) = outputs.first().map(|output| output.len()) else {
            return Err(Error::data("the record has no outputs; it needs at least one"));
        };
        if length == 0 {
            return Err(Error::data("the record has no samples"));
        }
        let named = |kind: &'static str, signals: &[&'a [f64]]| {
            let each = signals.iter().enumerate();
            each.map(|(position, signal)| (format!("{kind} {}", position + 1), *signal)).collect::<Vec<_>>()
        };
        for (name, signal) in named("input", &inputs).into_iter().chain(named("output", &outputs)) {
            if signal.len() != length {
                return Err(Error::data(format!(
                    "{name} has {} samples, output 1 has {length}; they must be as many",
                    signal.len()
                )));
            }
            if let Some(position) = signal.iter().position(|value| !value.is_finite()) {
                return Err(Error::data(format!(
                    "sample {} of {name} is not finite; build a Log to mark missing samples",
                    position + 1
                )));
            }
        }
        Ok(Self { inputs, outputs, segments: std::iter::once(0..length).collect() })
    }

    /// The same with inputs that wait so many samples: sample t has u_j(t - delay). Segments begin with the first
    /// sample that has all of them.
    pub(crate) fn delayed(self, delays: &[usize]) -> Self {
        let longest = delays.iter().copied().max().unwrap_or(0);
        let samples = self.outputs.first().map_or(0, |output| output.len());
        let longest = longest.min(samples);
        let inputs = self.inputs.into_iter().zip(delays);
        Self {
            inputs: inputs
                .map(|(input, delay)| {
                    let delay = (*delay).min(longest);
                    &input[longest - delay..samples - delay]
                })
                .collect(),
            outputs: self.outputs.into_iter().map(|output| &output[longest..]).collect(),
            segments: (self.segments.into_iter())
                .filter(|segment| segment.len() > longest)
                .map(|segment| segment.start..segment.end - longest)
                .collect(),
        }
    }

    /// Inputs, then outputs.
    pub(crate) fn signals(&self) -> Vec<&'a [f64]> {
        self.inputs.iter().chain(&self.outputs).copied().collect()
    }
}

impl Log {
    /// The signals of some channels over some rows. Segments end where a sample of any of them is missing.
    ///
    /// # Errors
    /// [`Error::Data`] for a name or rows that are not there; [`Error::Argument`] for rows that overlap, or no outputs.
    ///
    /// ```
    /// use thetahat::data::{Channel, Log};
    ///
    /// let channel = |name: &str, values| Channel { name: name.into(), values };
    /// let u = channel("u", vec![1.0, 0.0, 1.0, 1.0, 0.0]);
    /// let (first, second) = (vec![0.0, 0.5, 0.2, 0.5, 0.75], vec![0.1, f64::NAN, 0.3, 0.4, 0.5]);
    /// let log = Log::new(vec![u, channel("y1", first), channel("y2", second)], 0.1)?;
    /// let record = log.joint_record(&["u".into()], &["y1".into(), "y2".into()], &["1..5".parse()?])?;
    /// assert_eq!(record.segments, [0..1, 2..5]);
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn joint_record(
        &self,
        inputs: &[String],
        outputs: &[String],
        rows: &[Rows],
    ) -> Result<JointRecord<'_>, Error> {
        if outputs.is_empty() {
            return Err(Error::argument("outputs", "there are none; name at least one"));
        }
        self.check_uniform()?;
        let signals = |names: &[String]| -> Result<Vec<&[f64]>, Error> {
            names.iter().map(|name| Ok(self.channel(name)?.values.as_slice())).collect()
        };
        let names: Vec<&str> = inputs.iter().chain(outputs).map(String::as_str).collect();
        let (inputs, outputs) = (signals(inputs)?, signals(outputs)?);
        let segments = self.segments(&names, &checked("rows", rows, self.rows())?)?;
        Ok(JointRecord { inputs, outputs, segments })
    }
}
