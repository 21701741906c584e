use std::fmt;
use std::ops::Range;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::{DMatrix, DVector};
use thetahat_numerics::distribution::two_sided;
use thetahat_numerics::regression::{Taps, sum_of_squares};

use super::independence::{Parameters, Setting, independence};
use super::moments::{Moments, Traces, columns, pseudo_inverse};
use super::verdict::{Anderson, Independence, Test};
use super::whiteness::{Autocorrelation, anderson, anderson_lags, ljung_box, pairs};
use crate::estimate::{NullDistribution, autoregression};
use crate::respond::{Regressors, Tested, TestedInput};

/// Fewer samples than this, and one for each parameter that was fitted to them, say nothing.
const FEWEST: usize = 10;
/// A lag has pairs for at least one in this many samples.
const PAIRS: usize = 4;
/// At least this many samples stand for each lag of the autocorrelation, and of an input: with fewer, Ljung and Box's
/// test rejects too often.
const SAMPLES_PER_LAG: usize = 10;
const SAMPLES_PER_INPUT_LAG: usize = 5;
/// How many more lags of an input are tested than the plant has parameters.
const MORE_LAGS: usize = 10;
/// A sum of squared errors below this fraction of the output's is rounding.
const NOTHING_LEFT: f64 = 1e-24;

/// The one-step residuals of a model on a log, with tests of whether they contain more than white noise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Residuals {
    /// The output.
    pub output: String,
    /// N, the residuals that count.
    pub samples: usize,
    /// The number of parameters that the tests count as fitted to these samples: 0 on held-out data.
    pub fitted: usize,
    /// The autocorrelation at lags 0, 1, …, M; 1 at lag 0.
    pub autocorrelation: Vec<f64>,
    /// White residuals stay within plus or minus this at 95 of 100 lags.
    pub band: f64,
    /// Whether the first lags together are too large for white residuals.
    pub ljung_box: Test,
    /// How many lags are outside their band, for several levels.
    pub anderson: Anderson,
    /// Whether the residuals depend on past inputs, for each input with a B.
    pub independence: Vec<Independence>,
}

/// Why residuals cannot be tested.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Untestable {
    /// There are too few.
    Few {
        /// N.
        samples: usize,
        /// As many are needed.
        needed: usize,
    },
    /// Gaps leave too few of them beside another one.
    Apart {
        /// N.
        samples: usize,
        /// How many follow directly on another one.
        pairs: usize,
    },
    /// They are zero up to rounding.
    Nothing,
    /// Their squares leave the range of numbers.
    Range,
}

impl fmt::Display for Untestable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Few { samples, needed } => {
                write!(f, "{samples} samples count, and tests need {needed}; name more rows")
            }
            Self::Apart { samples, pairs } => write!(
                f,
                "gaps leave {pairs} of {samples} samples directly after another one, and tests need a fourth of them; name rows \
                 without gaps"
            ),
            Self::Nothing => {
                f.write_str("the model explains all but rounding, there is nothing left to test")
            }
            Self::Range => {
                f.write_str("their squares leave the range of numbers; scale the channels towards one")
            }
        }
    }
}

impl Residuals {
    /// The tests of what a model leaves of an output: `lags` of the autocorrelation, Anderson's test at `alphas` with
    /// its verdicts at `level`.
    ///
    /// There are lags up to a tenth of the samples, of inputs to a fifth, and as far as a quarter of the samples have
    /// a partner. O(N (L + p)), and O(N (L + p)^2) where the residuals are coloured.
    pub(crate) fn of(
        tested: &Tested<'_>,
        null: NullDistribution,
        lags: usize,
        alphas: &[f64],
        level: f64,
    ) -> Result<Self, Untestable> {
        let Tested { output, inputs, record, innovations, model } = tested;
        // Of models that the tests do not know, nothing else can be said.
        let fitted_by = model.filter(|_| null != NullDistribution::Known);
        let fitted = fitted_by.map_or(0, Regressors::parameters);
        let known = model.filter(|model| fitted_by.is_some() || model.covariance().is_some());
        let psi = known.map_or_else(Vec::new, |model| {
            model.regressors(record, innovations, null == NullDistribution::Instrumental)
        });
        let traces = Traces::new(record, innovations, psi);
        let counted = traces.counted();
        let samples: usize = counted.iter().map(Range::len).sum();
        let needed = FEWEST + fitted;
        if samples < needed {
            return Err(Untestable::Few { samples, needed });
        }
        let outputs: f64 = counted.iter().map(|rows| sum_of_squares(&record.output[rows.clone()])).sum();
        let segments = traces.segments();
        let usable = |lag: &usize| PAIRS * pairs(&segments, *lag) >= samples;
        let Some(longest) = (1..=samples / SAMPLES_PER_INPUT_LAG).take_while(usable).last() else {
            return Err(Untestable::Apart { samples, pairs: pairs(&segments, 1) });
        };
        let lags = lags.min(samples / SAMPLES_PER_LAG).clamp(1, longest);
        let correlation = Autocorrelation::new(traces.signal(Traces::ERROR), &segments, lags);
        let square = correlation.square;
        if !square.is_finite() {
            return Err(Untestable::Range);
        }
        if square <= NOTHING_LEFT * outputs {
            return Err(Untestable::Nothing);
        }
        if !square.is_normal() || !correlation.values.iter().all(|value| value.is_finite()) {
            return Err(Untestable::Range);
        }

        // As many lags as of the autocorrelation, and more than the plant has parameters after its delay.
        let past_lags = |input: &TestedInput<'_>| lags.max(input.lags + MORE_LAGS).min(longest);
        let inputs: Vec<(usize, &str, usize)> = inputs
            .iter()
            .filter(|input| input.lags > 0)
            .map(|input| (input.place, input.name, past_lags(input)))
            .collect();
        let error = Taps { signal: Traces::ERROR, first: 1, count: lags, sign: 1.0 };
        let mut taps = traces.psi.clone();
        taps.push(error);
        taps.extend(inputs.iter().map(|&(input, _, count)| Taps {
            signal: Traces::input(input),
            first: 1,
            count,
            sign: 1.0,
        }));
        let moments = Moments::new(&traces, &taps);
        let psi = columns(&traces.psi);
        let inverse = pseudo_inverse(&moments.matrix(&psi, &psi)).ok_or(Untestable::Range)?;
        let parameters = match (fitted_by, known.and_then(Regressors::covariance)) {
            (Some(model), _) => Parameters::Fitted(model.past_errors(lags)),
            (None, rows) => Parameters::Known(
                rows.map(|rows| DMatrix::from_fn(rows.len(), rows.len(), |i, j| rows[i][j])),
            ),
        };

        let count = samples as f64;
        let own = DMatrix::identity(lags, lags);
        let (shift, covariance) = match &parameters {
            Parameters::Fitted(past) => {
                let weights = past * &inverse;
                let covariance = own - &weights * past.transpose() * square;
                (weights * moments.with_error(&psi), covariance)
            }
            Parameters::Known(Some(spread)) => {
                let past = moments.matrix(&columns(&[error]), &psi) / square;
                (DVector::zeros(lags), own + &past * spread * past.transpose() * count)
            }
            Parameters::Known(None) => (DVector::zeros(lags), own),
        };
        let ljung_box = ljung_box(&correlation, &shift, &covariance).ok_or(Untestable::Range)?;

        let colour = autoregression(traces.signal(Traces::ERROR), &counted, fitted);
        let setting = Setting {
            traces: &traces,
            moments: &moments,
            psi: &psi,
            inverse: &inverse,
            colour: &colour,
            samples: count,
            square,
            parameters,
        };
        let independence =
            inputs.iter().map(|&(input, name, lags)| independence(&setting, name, input, lags));
        let independence = independence.collect::<Option<Vec<_>>>().ok_or(Untestable::Range)?;
        Ok(Self {
            output: (*output).to_owned(),
            samples,
            fitted,
            autocorrelation: std::iter::once(1.0).chain(correlation.values.iter().copied()).collect(),
            band: two_sided(0.05) / count.sqrt(),
            ljung_box,
            anderson: anderson(&correlation, &covariance, anderson_lags(samples, lags), alphas, level),
            independence,
        })
    }
}
