//! Methods, policies and starts as a person writes them.

use std::fmt;
use std::str::FromStr;

use thetahat_core::{Forgetting, Start};

use super::plan::{Beginning, Policy, TrackMethod};
use crate::Error;

impl FromStr for TrackMethod {
    type Err = Error;

    /// # Errors
    /// [`Error::Argument`] if it is none of them.
    fn from_str(text: &str) -> Result<Self, Error> {
        match text {
            "rls" => Ok(Self::Rls),
            "els" => Ok(Self::Els),
            "rpem" => Ok(Self::Rpem),
            _ => Err(Error::argument("method", format!("'{text}' is none; write rls, els or rpem"))),
        }
    }
}

/// As it is read: `rls`, `els` or `rpem`.
impl fmt::Display for TrackMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Rls => "rls",
            Self::Els => "els",
            Self::Rpem => "rpem",
        })
    }
}

/// The policies, in the words of a message.
const POLICIES: &str = "write none, a factor such as 0.99, exponential:0.99, selective:0.99, random-walk:1e-6 or \
                        variable:FACTOR:MINIMUM:NOISE_VARIANCE";

impl FromStr for Policy {
    type Err = Error;

    /// # Errors
    /// [`Error::Argument`] if it is none of them, or a number is out of its range.
    fn from_str(text: &str) -> Result<Self, Error> {
        let wrong = |why: &str| Error::argument("forgetting", format!("'{text}' {why}"));
        let number = |written: &str| {
            let number = written.parse::<f64>().ok().filter(|number| number.is_finite());
            number.ok_or_else(|| wrong(&format!("has '{written}' where a number must be; {POLICIES}")))
        };
        let factor = |written: &str| {
            let factor = number(written)?;
            let fits = factor > 0.0 && factor <= 1.0;
            fits.then_some(factor).ok_or_else(|| wrong("has a factor that is not above 0 and at most 1"))
        };
        let (word, numbers) =
            text.split_once(':').map_or((text, None), |(word, numbers)| (word, Some(numbers)));
        let given = numbers.map_or(Vec::new(), |numbers| numbers.split(':').collect());
        let forgetting = match (word, given.as_slice()) {
            ("none", []) => Forgetting::None,
            ("exponential", [one]) => Forgetting::Exponential { factor: factor(one)? },
            ("selective", [one]) => Forgetting::Selective { factor: factor(one)? },
            ("random-walk", [variance]) => {
                let variance = number(variance)?;
                if !(0.0..=100.0).contains(&variance) {
                    return Err(wrong("has a variance that is not in 0 to 100"));
                }
                Forgetting::RandomWalk { variance }
            }
            ("variable", [most, least, noise]) => {
                let (most, minimum, noise_variance) = (factor(most)?, factor(least)?, number(noise)?);
                if minimum > most {
                    return Err(wrong("has a minimum above its factor"));
                }
                if noise_variance < f64::MIN_POSITIVE {
                    return Err(wrong("has a noise variance that is not above 0"));
                }
                Forgetting::Variable { factor: most, minimum, noise_variance }
            }
            (_, []) if word.parse::<f64>().is_ok() => match factor(word)? {
                1.0 => Forgetting::None,
                factor => Forgetting::Exponential { factor },
            },
            ("none" | "exponential" | "selective" | "random-walk" | "variable", _) => {
                return Err(wrong(&format!("does not have the numbers of its word; {POLICIES}")));
            }
            _ => return Err(wrong(&format!("is no policy; {POLICIES}"))),
        };
        Ok(Self(forgetting))
    }
}

/// As it is read.
impl fmt::Display for Policy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // `{:?}` writes small numbers with an exponent, and all so that they are read back to the bit.
        match self.0 {
            Forgetting::Exponential { factor } => write!(f, "exponential:{factor:?}"),
            Forgetting::Selective { factor } => write!(f, "selective:{factor:?}"),
            Forgetting::RandomWalk { variance } => write!(f, "random-walk:{variance:?}"),
            Forgetting::Variable { factor, minimum, noise_variance } => {
                write!(f, "variable:{factor:?}:{minimum:?}:{noise_variance:?}")
            }
            _ => f.write_str("none"),
        }
    }
}

impl FromStr for Beginning {
    type Err = Error;

    /// # Errors
    /// [`Error::Argument`] if it is none of them, or K is not in 0 … 65535.
    fn from_str(text: &str) -> Result<Self, Error> {
        let start = match text.split_once(':') {
            None if text == "standard" => Some(Start::Standard),
            None if text == "exact" => Some(Start::Exact),
            None if text == "mixed" => Some(Start::Mixed { blend: 0 }),
            Some(("mixed", blend)) => blend.parse().ok().map(|blend| Start::Mixed { blend }),
            _ => None,
        };
        start.map(Self).ok_or_else(|| {
            let message =
                format!("'{text}' is none; write standard, exact, mixed, or mixed:K with K from 0 to 65535");
            Error::argument("start", message)
        })
    }
}

/// As it is read.
impl fmt::Display for Beginning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Start::Standard => f.write_str("standard"),
            Start::Exact => f.write_str("exact"),
            Start::Mixed { blend: 0 } => f.write_str("mixed"),
            Start::Mixed { blend } => write!(f, "mixed:{blend}"),
        }
    }
}
