//! The options of a response, and the plan that they make.

use super::plan::{Estimator, Frequencies, Method, SpectrumPlan};
use crate::Error;
use crate::data::{Detrend, Rows};
use crate::options::{ColumnName, Kind, OptionText, Options, options, words};

const LOG: &str = "";
const CHANNELS: &str = "Channels";
const METHOD: &str = "Method";

const LPM: Kind = Kind::new("`method` lpm");
const SPA: Kind = Kind::new("`method` spa");
const WELCH: Kind = Kind::new("`method` welch");
const ETFE: Kind = Kind::new("`method` etfe");
const SINES: Kind = Kind::new("`method` sines");

/// The word of a [`Method`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SpectrumMethod {
    /// Local polynomials.
    #[default]
    Lpm,
    /// Blackman and Tukey's windowed covariances.
    Spa,
    /// Welch's averages.
    Welch,
    /// The ratio of the transforms.
    Etfe,
    /// Correlation over whole periods.
    Sines,
}

words! { of SpectrumMethod {
    Lpm "lpm" "Local polynomials for response and transient",
    Spa "spa" "Blackman and Tukey: transforms of windowed covariances",
    Welch "welch" "Welch: averages over windows that overlap by half",
    Etfe "etfe" "The ratio of the transforms, unsmoothed",
    Sines "sines" "Correlation over whole periods of a stepped or a multi-sine input",
}}

words! { of Estimator {
    H1 "h1" "The noise is in the output",
    H2 "h2" "It is in the input",
}}

/// A frequency, or a band of them, in radians per second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FrequencyRange {
    /// One.
    At(f64),
    /// All from the first to the second.
    Between(f64, f64),
}

impl OptionText for FrequencyRange {
    const LIST: crate::options::Form = crate::options::Form::List;
    const PYTHON: &'static str = "float";
    const PYTHON_LIST: &'static str = "Frequencies";
    const SIGNED: bool = true;

    fn of(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|value| value.is_finite());
        let range = match text.split_once("..") {
            Some((low, high)) => number(low).zip(number(high)).map(|(low, high)| Self::Between(low, high)),
            None => number(text).map(Self::At),
        };
        range.ok_or_else(|| {
            format!("'{text}': write a band as LOW..HIGH, or a list as W,W,…, in radians per second above 0")
        })
    }

    fn text(&self) -> String {
        match self {
            Self::At(one) => one.to_string(),
            Self::Between(low, high) => format!("{low}..{high}"),
        }
    }
}

options! {
    /// How a frequency response is estimated from a log, as it was given.
    ///
    /// ```
    /// use thetahat::spectrum::{Method, SpectrumOptions, SpectrumPlan};
    ///
    /// let options: SpectrumOptions = serde_json::from_str(r#"{"method": "spa", "lags": 30}"#)?;
    /// let plan = SpectrumPlan::of(&options, vec!["u".into()], "y".into())?;
    /// assert_eq!(plan.method, Method::Spa { lags: Some(30) });
    ///
    /// let options: SpectrumOptions = serde_json::from_str(r#"{"half_width": 12, "method": "spa"}"#)?;
    /// let refused = SpectrumPlan::of(&options, vec!["u".into()], "y".into()).unwrap_err();
    /// assert_eq!(refused.to_string(), "half-width: it is for `method` lpm; leave it out, or give that");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    SpectrumOptions of "a frequency response" {
        /// Rows to use, 1-based and inclusive; each range is a segment of its own
        rows: Vec<Rows>, "A..B[,C..D]", "all", LOG;
        /// What is subtracted from each channel first: none, mean, linear, start:K
        detrend: Option<Detrend>, "WHAT", "mean", LOG;
        /// Input columns; a name that holds a comma stands between double quotes, as in CSV
        input: Vec<ColumnName>, "NAME[,NAME…]", "u, u1, u2, …", CHANNELS;
        /// Output column
        output: Option<ColumnName>, "NAME", "y", CHANNELS;
        /// The estimation method
        method: Option<SpectrumMethod>, "METHOD", "lpm", METHOD;
        /// Frequencies in radians per second: a band, or for lpm and spa a list
        frequencies: Vec<FrequencyRange>, "LOW..HIGH|W[,W…]", "all that the log has", METHOD;
        /// For lpm and spa: how many frequencies of the band, each the same factor above the one before
        points: Option<usize>, "N", "200", METHOD, [LPM SPA];
        /// For lpm: lines of the transform on either side of a frequency
        half_width: Option<usize>, "LINES", "12 for one input, 14 for two, …", METHOD, [LPM];
        /// For spa: lags of the Hann window
        lags: Option<usize>, "M", "as many as do not change the response when they are doubled", METHOD, [SPA];
        /// For welch: rows of a window
        window: Option<usize>, "ROWS", "a power of two, about an eighth of the log", METHOD, [WELCH];
        /// For welch: which ratio of the spectra
        estimator: Option<Estimator>, "ESTIMATOR", "h1", METHOD, [WELCH];
        /// For sines: rows of a period
        period: Option<usize>, "ROWS", "those after which the input repeats itself", METHOD, [SINES];
        /// For sines: periods to leave out at the beginning
        discard: Option<usize>, "PERIODS", "those that differ from the later ones", METHOD, [SINES];
    }
}

impl SpectrumOptions {
    /// The names of input channels that were given, if any were.
    pub fn inputs(&self) -> Option<Vec<String>> {
        ColumnName::all(&self.input)
    }

    /// The name of the output channel, if it was given.
    pub fn output(&self) -> Option<String> {
        self.output.as_ref().map(|name| name.0.clone())
    }
}

impl SpectrumPlan {
    /// What options ask for, of these channels.
    ///
    /// # Errors
    /// [`Error::Argument`] for options that do not go with the method, and as for [`check`](Self::check).
    pub fn of(options: &SpectrumOptions, inputs: Vec<String>, output: String) -> Result<Self, Error> {
        let SpectrumOptions { half_width, lags, window, period, discard, .. } = *options;
        let (kind, method) = match options.method.unwrap_or_default() {
            SpectrumMethod::Lpm => (LPM, Method::Lpm { half_width }),
            SpectrumMethod::Spa => (SPA, Method::Spa { lags }),
            SpectrumMethod::Welch => {
                (WELCH, Method::Welch { window, estimator: options.estimator.unwrap_or_default() })
            }
            SpectrumMethod::Etfe => (ETFE, Method::Etfe),
            SpectrumMethod::Sines => (SINES, Method::Sines { period, discard }),
        };
        options.check_kind(kind, None)?;
        let plan = Self {
            inputs,
            output,
            rows: options.rows.clone(),
            detrend: options.detrend.unwrap_or_default(),
            method,
            frequencies: frequencies(options)?,
        };
        plan.check()?;
        Ok(plan)
    }
}

fn frequencies(options: &SpectrumOptions) -> Result<Frequencies, Error> {
    let points = options.points;
    match options.frequencies.as_slice() {
        [FrequencyRange::Between(low, high)] => Ok(Frequencies::Between { low: *low, high: *high, points }),
        [] if points.is_some() => {
            Err(Error::argument("points", "it is for a band: give it with `frequencies` LOW..HIGH"))
        }
        _ if points.is_some() => {
            Err(Error::argument("points", "it is for a band: `frequencies` names each frequency already"))
        }
        [] => Ok(Frequencies::All),
        list => {
            let each = list.iter().map(|range| match range {
                FrequencyRange::At(frequency) => Ok(*frequency),
                FrequencyRange::Between(..) => {
                    Err(Error::argument("frequencies", "give one band, or a list of frequencies"))
                }
            });
            each.collect::<Result<_, _>>().map(Frequencies::At)
        }
    }
}
