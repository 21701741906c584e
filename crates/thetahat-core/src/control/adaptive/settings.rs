//! What self-tuners are asked for, and what they tell.

use core::ops::RangeInclusive;

use super::{Distrust, Probing, ResponseWanted, Sensor, Supervision};
use crate::{Error, Real};

/// What a self-tuner is asked for.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "T: Real"))]
pub struct TunerSettings<T> {
    /// The loop that is wanted.
    pub response: ResponseWanted<T>,
    /// The range of the actuator, in the unit of the input.
    #[cfg_attr(feature = "serde", serde(with = "crate::snapshot::range"))]
    pub limits: RangeInclusive<T>,
    /// The input that it starts with.
    pub input: T,
    /// The sign of what the plant does first with a larger input: of its static gain for an
    /// [`IndirectSelfTuner`](crate::IndirectSelfTuner) (of its speed for a plant that integrates), of b_0 for a
    /// [`DirectSelfTuner`](crate::DirectSelfTuner). 0 where it is not known. An estimate with the other sign gets no
    /// controller.
    pub gain_sign: T,
    /// How it starts.
    pub probing: Probing<T>,
    /// The sensor.
    pub sensor: Sensor<T>,
    /// When it is not trusted, and what acts then.
    pub supervision: Supervision<T>,
}

impl<T: Real> TunerSettings<T> {
    /// Settings for this response, this range of the actuator and this usual size of inputs: from the input 0, or the
    /// nearest end of the range, with nothing known of the gain, [`Probing::of_scale`] and [`Supervision::of_scale`].
    pub fn new(response: ResponseWanted<T>, limits: RangeInclusive<T>, input_scale: T) -> Self {
        let input = T::zero().max(*limits.start()).min(*limits.end());
        let (probing, sensor) = (Probing::of_scale(input_scale), Sensor::default());
        let supervision = Supervision::of_scale(input_scale);
        TunerSettings { response, limits, input, gain_sign: T::zero(), probing, sensor, supervision }
    }

    pub(super) fn check(&self) -> Result<(), Error> {
        self.response.check()?;
        self.probing.check()?;
        self.sensor.check()?;
        self.supervision.check()?;
        let limits = &self.limits;
        let ranges = [
            ("limits", !limits.is_empty(), "in order, the lower one first"),
            ("input", limits.contains(&self.input) && self.input.is_finite(), "within the limits"),
            ("gain_sign", self.gain_sign.is_finite(), "a number"),
        ];
        for (argument, holds, range) in ranges {
            if !holds {
                return Err(Error::OutOfRange { argument, range });
            }
        }
        Ok(())
    }
}

/// What a self-tuner does in a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum TunerState {
    /// There is no controller yet: the plant is excited.
    Probing,
    /// The controller acts.
    Controlling,
    /// The sensor says nothing, and the controller acts on what the model predicts.
    Bridging,
    /// The sensor says nothing for long, or what it said is too little to predict from: the input stays as it was.
    Holding,
    /// It is not trusted: the fallback of [`Supervision`] acts, whether the sensor says anything or not, and the model
    /// goes on learning. Where the design is only old the controller acts.
    Distrusted(Distrust),
}
