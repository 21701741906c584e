//! Methods, policies and starts as a person writes them.

use std::fmt;
use std::iter;
use std::str::FromStr;

use thetahat_core::{Forgetting, Outliers, RlsStart};

use super::plan::{Policy, TrackMethod, TrackOutliers, TrackStart};
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
fn policies() -> String {
    let written: Vec<String> = Policy::all_written().collect();
    format!("write {}, or a factor such as 0.99", written.join(", "))
}

impl Policy {
    /// How each policy is written, such as `variable:FACTOR:MINIMUM:NOISE_VARIANCE`.
    pub fn all_written() -> impl Iterator<Item = String> {
        Forgetting::policies().iter().map(|policy| {
            let numbers = policy.numbers.iter().map(|number| number.name.to_uppercase());
            iter::once(policy.word.to_owned()).chain(numbers).collect::<Vec<_>>().join(":")
        })
    }
}

impl FromStr for Policy {
    type Err = Error;

    /// # Errors
    /// [`Error::Argument`] if it is none of them, or a number is out of its range.
    fn from_str(text: &str) -> Result<Self, Error> {
        let wrong = |why: &str| Error::argument("forgetting", format!("'{text}' {why}"));
        let number = |written: &str| {
            let number = written.parse::<f64>().ok().filter(|number| number.is_finite());
            number.ok_or_else(|| wrong(&format!("has '{written}' where a number must be; {}", policies())))
        };
        let mut parts = text.split(':');
        let word = parts.next().unwrap_or_default();
        let given: Vec<&str> = parts.collect();
        let named = |word: &str| Forgetting::policies().iter().find(|policy| policy.word == word);
        let (policy, numbers) = match named(word) {
            Some(policy) if policy.numbers.len() == given.len() => {
                (policy, given.into_iter().map(number).collect::<Result<Vec<_>, _>>()?)
            }
            Some(_) => {
                return Err(wrong(&format!("does not have the numbers of its word; {}", policies())));
            }
            None if given.is_empty() && word.parse::<f64>().is_ok() => {
                let factor = number(word)?;
                if factor == 1.0 {
                    return Ok(Self(Forgetting::None));
                }
                (Forgetting::Exponential { factor }.describe().0, vec![factor])
            }
            None => return Err(wrong(&format!("is no policy; {}", policies()))),
        };
        if let Some((number, _)) = policy.refused(&numbers) {
            let (name, range) = (number.name.replace('_', " "), number.range.says());
            return Err(wrong(&format!("has a {name} that is not {range}")));
        }
        policy.with(&numbers).map(Self).map_err(|error| wrong(&error.to_string()))
    }
}

/// As it is read.
impl fmt::Display for Policy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (policy, mut numbers) = self.0.describe();
        f.write_str(policy.word)?;
        // `{:?}` writes small numbers with an exponent, and all so that they are read back to the bit.
        numbers.try_for_each(|(_, value)| write!(f, ":{value:?}"))
    }
}

impl FromStr for TrackStart {
    type Err = Error;

    /// # Errors
    /// [`Error::Argument`] if it is none of them, or K is not in 0 … 65535.
    fn from_str(text: &str) -> Result<Self, Error> {
        let start = match text.split_once(':') {
            None if text == "standard" => Some(RlsStart::Standard),
            None if text == "exact" => Some(RlsStart::Exact),
            None if text == "mixed" => Some(RlsStart::Mixed { blend: 0 }),
            Some(("mixed", blend)) => blend.parse().ok().map(|blend| RlsStart::Mixed { blend }),
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
impl fmt::Display for TrackStart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            RlsStart::Standard => f.write_str("standard"),
            RlsStart::Exact => f.write_str("exact"),
            RlsStart::Mixed { blend: 0 } => f.write_str("mixed"),
            RlsStart::Mixed { blend } => write!(f, "mixed:{blend}"),
        }
    }
}

impl FromStr for TrackOutliers {
    type Err = Error;

    /// # Errors
    /// [`Error::Argument`] if it is none of them, a number is less than 1 or huge, or RELEASE is not in 0 … 65535.
    fn from_str(text: &str) -> Result<Self, Error> {
        let threshold = |text: &str| text.parse().ok().filter(|number| (1.0..=1e6).contains(number));
        let parts: Vec<&str> = text.split(':').collect();
        let rule = match parts[..] {
            ["used"] => Some(Outliers::Used),
            ["huber"] => Some(Outliers::Huber { threshold: 3.0 }),
            ["huber", number] => threshold(number).map(|threshold| Outliers::Huber { threshold }),
            ["gate"] => Some(Outliers::Gate { nis: 25.0, release: 20 }),
            ["gate", number] => threshold(number).map(|nis| Outliers::Gate { nis, release: 20 }),
            ["gate", number, release] => threshold(number)
                .zip(release.parse().ok())
                .map(|(nis, release)| Outliers::Gate { nis, release }),
            _ => None,
        };
        rule.map(Self).ok_or_else(|| {
            let message = format!(
                "'{text}' is no rule; write used, huber:THRESHOLD or gate:NIS:RELEASE, with THRESHOLD and NIS from 1 to 1e6 and RELEASE from 0 to 65535"
            );
            Error::argument("outliers", message)
        })
    }
}

/// As it is read.
impl fmt::Display for TrackOutliers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Outliers::Huber { threshold } => write!(f, "huber:{threshold:?}"),
            Outliers::Gate { nis, release } => write!(f, "gate:{nis:?}:{release}"),
            _ => f.write_str("used"),
        }
    }
}
