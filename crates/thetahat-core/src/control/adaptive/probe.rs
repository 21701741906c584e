//! An input that excites a plant.

use crate::{Error, Real};

/// How a self-tuner excites a plant that it does not know yet.
///
/// Until there is a first controller the input is the one it starts with plus or minus an amplitude, in an order as if
/// by chance. The amplitude doubles time and again, so that a plant of unknown gain is not driven further than it takes
/// to see it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "T: Real"))]
pub struct Probing<T> {
    /// The first amplitude, in the unit of the input.
    pub amplitude: T,
    /// The largest.
    pub largest: T,
    /// It doubles after so many samples.
    pub doubles_after: u16,
    /// It goes on for at least so many samples.
    pub at_least: u16,
    /// And for at most so many: then the controller begins, however uncertain the gain.
    pub at_most: u16,
}

impl<T: Real> Probing<T> {
    /// From a tenth of this size of inputs to twice, doubled every 15 samples, for 12 to 200 samples.
    pub fn of_scale(input_scale: T) -> Self {
        let amplitude = input_scale / T::from_count(10);
        let largest = input_scale + input_scale;
        Probing { amplitude, largest, doubles_after: 15, at_least: 12, at_most: 200 }
    }

    pub(super) fn check(&self) -> Result<(), Error> {
        let holds = self.amplitude >= T::zero() && self.largest >= self.amplitude && self.largest.is_finite();
        if holds && self.at_least <= self.at_most {
            return Ok(());
        }
        Err(Error::OutOfRange {
            argument: "probing",
            range: "amplitudes of 0 or more, and numbers of samples, with the larger one second",
        })
    }

    /// The amplitude after so many samples.
    pub(super) fn amplitude_at(&self, samples: u16) -> T {
        let doublings = samples.checked_div(self.doubles_after).unwrap_or(0).min(64);
        let grown =
            (0..doublings).fold(self.amplitude, |amplitude, _| (amplitude + amplitude).min(self.largest));
        grown.min(self.largest)
    }
}

/// Signs as if by chance: xorshift (Marsaglia 2003).
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Signs(u32);

impl Signs {
    pub(super) fn new() -> Self {
        Signs(0x9e37_79b9)
    }

    /// That it is not at 0, where it would stay.
    #[cfg(feature = "serde")]
    pub(super) fn is_alive(self) -> bool {
        self.0 != 0
    }

    pub(super) fn next<T: Real>(&mut self) -> T {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        if self.0 >> 31 == 0 { T::one() } else { -T::one() }
    }
}
