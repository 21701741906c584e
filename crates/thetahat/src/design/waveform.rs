//! The kinds of test signals, and how long each of their values is held.

use std::fmt;
use std::str::FromStr;

use crate::Error;

/// A kind of test signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SignalKind {
    /// A pseudo-random binary sequence of maximum length.
    Prbs,
    /// Two levels, drawn anew each time.
    Rbs,
    /// A sum of sinusoids with a low peak, over and over.
    Multisine,
    /// A sinusoid whose frequency rises steadily, over and over.
    Chirp,
    /// Independent values, uniform between the levels.
    White,
    /// One sinusoid after another: a stepped-sine experiment.
    Sines,
    /// Up and down between the levels.
    Steps,
}

/// All kinds with their words.
const WORDS: [(SignalKind, &str); 7] = [
    (SignalKind::Prbs, "prbs"),
    (SignalKind::Rbs, "rbs"),
    (SignalKind::Multisine, "multisine"),
    (SignalKind::Chirp, "chirp"),
    (SignalKind::White, "white"),
    (SignalKind::Sines, "sines"),
    (SignalKind::Steps, "steps"),
];

impl SignalKind {
    /// Every kind.
    pub fn all() -> impl Iterator<Item = Self> {
        WORDS.iter().map(|(kind, _)| *kind)
    }

    /// Its word, such as `prbs`.
    pub fn word(self) -> &'static str {
        WORDS.iter().find(|(kind, _)| *kind == self).map_or("", |(_, word)| word)
    }

    /// Whether a band says where its power is.
    pub fn has_band(self) -> bool {
        matches!(self, Self::Multisine | Self::Chirp | Self::Sines)
    }

    /// Whether it can have a number of frequencies.
    pub fn has_points(self) -> bool {
        matches!(self, Self::Multisine | Self::Sines)
    }

    /// Whether its values can be held: where there is no band, that is what makes a signal slower.
    pub fn has_hold(self) -> bool {
        !self.has_band()
    }
}

/// A kind of signal, and for how many samples each of its values is held. Written `prbs:4`, or `prbs` alone.
///
/// ```
/// use thetahat::design::{SignalKind, Waveform};
///
/// let slow: Waveform = "prbs:4".parse()?;
/// assert_eq!((slow.kind, slow.hold, slow.to_string().as_str()), (SignalKind::Prbs, Some(4), "prbs:4"));
/// assert!("prbs:0".parse::<Waveform>().is_err() && "multisine:4".parse::<Waveform>().is_err());
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Waveform {
    /// Which kind.
    pub kind: SignalKind,
    /// The clock period in samples: of a PRBS, an RBS or white noise 1 if it is not given; of steps, the time from one
    /// to the next.
    pub hold: Option<usize>,
}

impl From<SignalKind> for Waveform {
    fn from(kind: SignalKind) -> Self {
        Self { kind, hold: None }
    }
}

impl fmt::Display for Waveform {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.kind.word())?;
        self.hold.map_or(Ok(()), |hold| write!(f, ":{hold}"))
    }
}

impl FromStr for Waveform {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let (word, hold) = text.split_once(':').map_or((text, None), |(word, hold)| (word, Some(hold)));
        let Some((kind, _)) = WORDS.iter().find(|(_, known)| *known == word) else {
            let known: Vec<&str> = WORDS.iter().map(|(_, word)| *word).collect();
            return Err(Error::argument("signal", format!("'{word}' is none of {}", known.join(", "))));
        };
        let Some(hold) = hold else { return Ok(Self::from(*kind)) };
        if !kind.has_hold() {
            return Err(Error::argument(
                "signal",
                format!("'{text}': the values of a {word} signal are not held; `band` makes it slower"),
            ));
        }
        match hold.parse() {
            Ok(hold) if hold > 0 => Ok(Self { kind: *kind, hold: Some(hold) }),
            _ => Err(Error::argument(
                "signal",
                format!(
                    "'{text}': after the colon stands for how many samples each value is held, from 1 on"
                ),
            )),
        }
    }
}
