//! What a sensor that fails makes of a sample.

use core::ops::RangeInclusive;

use crate::{Error, Real};

/// How a self-tuner tells that a sensor has failed, and what it does then.
///
/// A measurement that is NaN is missing. One beyond the range is taken as the end of the range that it passed: what is
/// too far is still known to be far, and a controller that held its input then would hold it for ever with a plant that
/// integrates. The model learns from neither, nor from the next samples, whose regressors contain them. So the range
/// should leave room for an excursion: a plant that begins to integrate, and leaves the range before that is learnt,
/// takes long to come back (measured: of 100 changes of the plant after long silences three burst within a range of 8
/// times the set point, none within 20 times).
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "T: Real"))]
pub struct Sensor<T> {
    /// What it can measure, in the unit of the output.
    #[cfg_attr(feature = "serde", serde(with = "crate::snapshot::range"))]
    pub range: RangeInclusive<T>,
    /// So many equal measurements in a row are those of a sensor that is stuck: all but the first of them are missing
    /// from then on. 0 for a sensor with so few digits that a working one repeats itself.
    pub stuck_after: u16,
    /// For so many missing samples in a row the controller goes on with what its model predicts, and then holds its
    /// input.
    pub longest_gap: u16,
    /// For so many samples after one that was missing or clipped nothing is learnt: the maximum lag of the model, or
    /// more.
    pub pause: u16,
}

impl<T: Real> Default for Sensor<T> {
    /// Any range, never stuck, 100 samples from the model, a pause of 6.
    fn default() -> Self {
        Sensor { range: -T::INFINITY..=T::INFINITY, stuck_after: 0, longest_gap: 100, pause: 6 }
    }
}

impl<T: Real> Sensor<T> {
    pub(super) fn check(&self) -> Result<(), Error> {
        if self.range.is_empty() {
            return Err(Error::OutOfRange { argument: "range", range: "in order, the lower end first" });
        }
        Ok(())
    }
}

/// What comes of a measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Reading<T> {
    /// What to control with; `None` to hold the input.
    pub(super) output: Option<T>,
    /// Whether it was measured, so that the model may learn from it.
    pub(super) learns: bool,
    /// Whether it is what the model predicts.
    pub(super) predicted: bool,
}

/// A sensor, and its latest samples.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "T: Real"))]
pub(super) struct Watch<T> {
    sensor: Sensor<T>,
    #[cfg_attr(feature = "serde", serde(with = "crate::snapshot::number"))]
    latest: T,
    equal: u16,
    missing: u16,
    paused: u16,
}

impl<T: Real> Watch<T> {
    pub(super) fn new(sensor: &Sensor<T>) -> Self {
        Watch { sensor: sensor.clone(), latest: T::NAN, equal: 0, missing: 0, paused: 0 }
    }

    /// The sample of this measurement, where the model predicts `predicted`.
    pub(super) fn take(&mut self, measurement: T, predicted: T) -> Reading<T> {
        let (lowest, highest) = (*self.sensor.range.start(), *self.sensor.range.end());
        self.equal = if measurement == self.latest { self.equal.saturating_add(1) } else { 0 };
        self.latest = measurement;
        let stuck = self.sensor.stuck_after > 0 && self.equal >= self.sensor.stuck_after.saturating_sub(1);
        // Not finite after it was clipped: NaN, or infinite where the range has no end.
        let clipped = if measurement > highest {
            highest
        } else if measurement < lowest {
            lowest
        } else {
            measurement
        };
        if stuck || !clipped.is_finite() {
            self.paused = self.sensor.pause;
            self.missing = self.missing.saturating_add(1);
            let bridged = self.missing <= self.sensor.longest_gap && predicted.is_finite();
            return Reading { output: bridged.then_some(predicted), learns: false, predicted: true };
        }
        self.missing = 0;
        if clipped != measurement {
            self.paused = self.sensor.pause;
            return Reading { output: Some(clipped), learns: false, predicted: false };
        }
        let learns = self.paused == 0;
        self.paused = self.paused.saturating_sub(1);
        Reading { output: Some(measurement), learns, predicted: false }
    }
}
