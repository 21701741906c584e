//! What is asked for.

use std::f64::consts::PI;
use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::data::{Detrend, Rows};
use crate::figures::short;
use crate::respond::logarithmic_frequencies;

/// How a response is estimated from data. Sizes that are none are chosen from the log; documents have those that were.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "name", rename_all = "lowercase")]
pub enum Method {
    /// The local polynomial method.
    Lpm {
        /// How many lines of the longest segment's transform serve on either side of a frequency.
        half_width: Option<usize>,
    },
    /// Blackman and Tukey's.
    Spa {
        /// The last lag of the covariances.
        lags: Option<usize>,
    },
    /// Welch's.
    Welch {
        /// The length of a window, in rows.
        window: Option<usize>,
        /// Which ratio of the spectra.
        estimator: Estimator,
    },
    /// The ratio of the transforms of output and input, unsmoothed.
    Etfe,
    /// Correlation with the sines of a periodic input over whole periods.
    Sines {
        /// Rows of a period.
        period: Option<usize>,
        /// How many periods of each segment are left out at its beginning.
        discard: Option<usize>,
    },
    /// Points that were measured elsewhere: no estimate from a log.
    Given,
}

/// Which ratio of spectra is the response.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Estimator {
    /// S_yu/S_uu: right where all noise is in the output.
    #[default]
    H1,
    /// S_yy/S_uy: right where all noise is in the input. For one input.
    H2,
}

/// At which frequencies, in radians per second.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Frequencies {
    /// All lines of a method that has lines of its own; of the others 200 from the first line of the longest segment's
    /// transform to half the sampling frequency, each the same factor above the one before.
    #[default]
    All,
    /// Those from `low` to `high`. Methods without lines of their own have `points` of them, each the same factor above
    /// the one before; 200 if that is none.
    Between {
        /// The lowest.
        low: f64,
        /// The highest.
        high: f64,
        /// How many.
        points: Option<usize>,
    },
    /// These, for methods without lines of their own.
    At(Vec<f64>),
}

/// What to estimate, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct SpectrumPlan {
    /// The input channels, one at least.
    pub inputs: Vec<String>,
    /// The output channel.
    pub output: String,
    /// The rows; none: all.
    pub rows: Vec<Rows>,
    /// What is taken from each channel first.
    pub detrend: Detrend,
    /// The method.
    pub method: Method,
    /// The frequencies.
    pub frequencies: Frequencies,
}

/// Frequencies where none are asked for.
const POINTS: usize = 200;
/// No more of them.
const MOST_POINTS: usize = 1_000_000;

impl Default for Method {
    fn default() -> Self {
        Self::Lpm { half_width: None }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Method {
    /// Its word: `lpm`, `spa`, `welch`, `etfe`, `sines` or `given`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Lpm { .. } => "lpm",
            Self::Spa { .. } => "spa",
            Self::Welch { .. } => "welch",
            Self::Etfe => "etfe",
            Self::Sines { .. } => "sines",
            Self::Given => "given",
        }
    }

    /// What it is, with the sizes that are known.
    pub fn title(&self) -> String {
        let size = |size: &Option<usize>, before: &str, after: &str| {
            size.map_or_else(String::new, |size| format!(", {before}{size}{after}"))
        };
        match self {
            Self::Lpm { half_width } => {
                format!("local polynomial method{}", size(half_width, "", " lines on either side"))
            }
            Self::Spa { lags } => format!("Blackman-Tukey{}", size(lags, "Hann window of ", " lags")),
            Self::Welch { window, estimator } => {
                let ratio = match estimator {
                    Estimator::H1 => "H1",
                    Estimator::H2 => "H2",
                };
                format!("Welch, {ratio}{}", size(window, "Hann windows of ", " rows"))
            }
            Self::Etfe => "ratio of the transforms (ETFE)".to_owned(),
            Self::Sines { period, discard } => format!(
                "correlation over whole periods{}{}",
                size(period, "", " rows each"),
                size(discard, "without the first ", "")
            ),
            Self::Given => "points that were measured elsewhere".to_owned(),
        }
    }

    /// Whether its lines come from the log.
    fn has_lines(&self) -> bool {
        !matches!(self, Self::Lpm { .. } | Self::Spa { .. })
    }
}

/// What there is to say of a plan that asks for points from elsewhere.
pub(super) fn given() -> Error {
    Error::argument(
        "method",
        "given is of points that were measured elsewhere; of a log take lpm, spa, welch, etfe or sines",
    )
}

impl SpectrumPlan {
    /// All rows and the default method, with means removed.
    ///
    /// ```
    /// use thetahat::spectrum::{Method, SpectrumPlan};
    ///
    /// assert_eq!(SpectrumPlan::new(&["u"], "y").method, Method::Lpm { half_width: None });
    /// ```
    pub fn new(inputs: &[&str], output: &str) -> Self {
        Self {
            inputs: inputs.iter().map(|name| (*name).to_owned()).collect(),
            output: output.to_owned(),
            rows: Vec::new(),
            detrend: Detrend::default(),
            method: Method::default(),
            frequencies: Frequencies::default(),
        }
    }

    /// Whether it makes sense, whatever the log.
    ///
    /// # Errors
    /// [`Error::Argument`] that names the argument.
    pub fn check(&self) -> Result<(), Error> {
        if self.inputs.is_empty() {
            return Err(Error::argument(
                "channels",
                "there is no input: name one, a response is from it to the output",
            ));
        }
        let roles: Vec<&String> = self.inputs.iter().chain([&self.output]).collect();
        if let Some(twice) = (1..roles.len()).find(|&k| roles[..k].contains(&roles[k])) {
            let message = format!("'{}' is named twice; a channel has one role", roles[twice]);
            return Err(Error::argument("channels", message));
        }
        let (argument, size, least) = match self.method {
            Method::Lpm { half_width } => ("half-width", half_width, 1),
            Method::Spa { lags } => ("lags", lags, 1),
            Method::Welch { window, .. } => ("window", window, 8),
            Method::Etfe => ("window", None, 1),
            Method::Sines { period, .. } => ("period", period, 3),
            Method::Given => return Err(given()),
        };
        if let Some(size) = size.filter(|size| *size < least) {
            return Err(Error::argument(argument, format!("{size}: give {least} at least")));
        }
        let several = self.inputs.len() > 1;
        match self.method {
            Method::Etfe if several => Err(Error::argument(
                "method",
                "etfe divides the output's transform by that of one input; for several inputs take lpm, spa or welch",
            )),
            Method::Welch { estimator: Estimator::H2, .. } if several => {
                Err(Error::argument("estimator", "h2 is for one input; for several inputs take h1"))
            }
            _ => self.check_frequencies(),
        }
    }

    fn check_frequencies(&self) -> Result<(), Error> {
        let wrong = |message: String| Err(Error::argument("frequencies", message));
        match &self.frequencies {
            Frequencies::All => Ok(()),
            Frequencies::Between { low, high, points } => {
                if !(*low > 0.0 && low < high && high.is_finite()) {
                    return wrong(format!(
                        "{low} to {high} rad/s: give a band from above 0 to a higher frequency"
                    ));
                }
                if points.is_some() && self.method.has_lines() {
                    let message = format!(
                        "{} has lines of its own, all of those in the band; leave the number out, or take lpm or spa",
                        self.method
                    );
                    return Err(Error::argument("points", message));
                }
                match points {
                    Some(points) if !(2..=MOST_POINTS).contains(points) => {
                        Err(Error::argument("points", format!("{points} is outside 2..{MOST_POINTS}")))
                    }
                    _ => Ok(()),
                }
            }
            Frequencies::At(all) => {
                if self.method.has_lines() {
                    return wrong(format!("{} has lines of its own: give a band, LOW..HIGH", self.method));
                }
                if all.is_empty() || !all.iter().all(|frequency| *frequency > 0.0 && frequency.is_finite()) {
                    return wrong("give frequencies above 0, in radians per second".to_owned());
                }
                if !all.is_sorted_by(|a, b| a < b) {
                    return wrong("give them in rising order, each once".to_owned());
                }
                Ok(())
            }
        }
    }

    /// The band of angles, in radians per sample.
    pub(super) fn band(&self, sample_time: f64) -> Result<(f64, f64), Error> {
        let (low, high) = match &self.frequencies {
            Frequencies::All => return Ok((0.0, PI)),
            Frequencies::Between { low, high, .. } => (*low, *high),
            Frequencies::At(all) => (all.first().copied().unwrap_or(0.0), all.last().copied().unwrap_or(0.0)),
        };
        // pi/T itself may be computed in several ways.
        let highest = PI / sample_time;
        if high > highest * (1.0 + 4.0 * f64::EPSILON) {
            return Err(Error::argument(
                "frequencies",
                format!(
                    "{} rad/s is above {} rad/s, half the sampling frequency: the log tells nothing of it",
                    short(high),
                    short(highest)
                ),
            ));
        }
        Ok((low * sample_time, (high * sample_time).min(PI)))
    }

    /// The angles for methods without lines of their own, in radians per sample; `first` is the lowest where none is
    /// given.
    pub(super) fn angles(&self, sample_time: f64, first: f64) -> Result<Vec<f64>, Error> {
        let (low, high) = self.band(sample_time)?;
        match &self.frequencies {
            Frequencies::All => logarithmic_frequencies(first, PI, POINTS),
            Frequencies::Between { points, .. } => {
                logarithmic_frequencies(low, high, points.unwrap_or(POINTS))
            }
            Frequencies::At(all) => {
                Ok(all.iter().map(|frequency| (frequency * sample_time).min(PI)).collect())
            }
        }
    }
}
