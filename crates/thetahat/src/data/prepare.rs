use std::fmt;
use std::ops::Range;
use std::str::FromStr;

use thetahat_numerics::regression::{sum, sum_above};

use crate::Error;
use crate::data::{Log, Offset};

/// What is taken from each channel before a fit. A model speaks of deviations from it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Detrend {
    /// Nothing.
    None,
    /// The mean over the estimation rows.
    #[default]
    Mean,
    /// The least-squares line through the estimation rows.
    Linear,
    /// The mean of the first estimation rows, this many of them: for a step test that begins at rest.
    Start(usize),
}

impl fmt::Display for Detrend {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => f.write_str("none"),
            Self::Mean => f.write_str("mean"),
            Self::Linear => f.write_str("linear"),
            Self::Start(count) => write!(f, "start:{count}"),
        }
    }
}

impl FromStr for Detrend {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        match (text, text.strip_prefix("start:").map(str::parse)) {
            ("none", _) => Ok(Self::None),
            ("mean", _) => Ok(Self::Mean),
            ("linear", _) => Ok(Self::Linear),
            (_, Some(Ok(count))) if count > 0 => Ok(Self::Start(count)),
            _ => Err(Error::argument(
                "detrend",
                format!("'{text}' is none of none, mean, linear and start:K (K rows)"),
            )),
        }
    }
}

impl Offset {
    /// The offset of a channel over segments of rows (0-based).
    ///
    /// # Errors
    /// [`Error::Data`] if there are fewer rows than `Start` asks for; [`Error::Argument`] for a line through several
    /// logs.
    pub(crate) fn estimate(
        detrend: Detrend,
        log: &Log,
        name: &str,
        segments: &[Range<usize>],
    ) -> Result<Self, Error> {
        let values = &log.channel(name)?.values;
        let mean = |rows: &[Range<usize>]| {
            let count: usize = rows.iter().map(Range::len).sum();
            // From the first value: the mean of a constant channel is then that constant, to the bit.
            let base = rows.first().map_or(0.0, |rows| values[rows.start]);
            let sum = match rows {
                // Side by side: no row need be looked up by itself.
                [rows] => sum_above(&values[rows.clone()], base),
                all => sum(all.iter().cloned().flatten().map(|row| values[row] - base)),
            };
            base + sum / count.max(1) as f64
        };
        Ok(match detrend {
            Detrend::None => Self::default(),
            Detrend::Mean => Self { level: mean(segments), slope: 0.0 },
            Detrend::Start(count) => Self { level: mean(&leading(segments, count)?), slope: 0.0 },
            Detrend::Linear if log.is_joined() => {
                return Err(Error::argument(
                    "detrend",
                    "several logs have no common clock for a line; use mean, start:K or none",
                ));
            }
            Detrend::Linear => {
                let rows = || segments.iter().cloned().flatten();
                let count = rows().count().max(1) as f64;
                let middle = sum(rows().map(|row| log.elapsed(row))) / count;
                let level = mean(segments);
                let deviation = |row: usize| log.elapsed(row) - middle;
                let spread = sum(rows().map(|row| deviation(row).powi(2)));
                let slope = if spread > 0.0 {
                    sum(rows().map(|row| deviation(row) * (values[row] - level))) / spread
                } else {
                    0.0
                };
                Self { level: level - slope * middle, slope }
            }
        })
    }
}

/// The first `count` rows of the segments.
fn leading(segments: &[Range<usize>], count: usize) -> Result<Vec<Range<usize>>, Error> {
    let available: usize = segments.iter().map(Range::len).sum();
    if count == 0 || count > available {
        return Err(Error::data(format!(
            "`detrend` start:{count} needs {count} rows, at least 1; there are {available} without missing values"
        )));
    }
    let mut left = count;
    Ok(segments
        .iter()
        .map(|segment| {
            let taken = left.min(segment.len());
            left -= taken;
            segment.start..segment.start + taken
        })
        .take_while(|rows| !rows.is_empty())
        .collect())
}
