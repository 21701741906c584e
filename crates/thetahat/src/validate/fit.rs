use std::borrow::Cow;
use std::ops::Range;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_numerics::regression::{differences, squares_above, sum_above};

use crate::data::Rows;
use crate::respond::{Horizon, InitialCondition, Response};

/// What rows serve for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Part {
    /// The model was fitted to them.
    Estimation,
    /// The fit did not use them.
    Validation,
    /// Neither the fit nor the choice of the model used them.
    Test,
}

/// How close a model comes to measured outputs.
///
/// With e = y - y^: percent = 100 (1 - |e| / |y - mean(y)|), rmse = |e| / sqrt(N), |.| being the root of the sum of
/// squares, and the mean and the largest of the absolute errors |e(t)|, all over the N samples that the response
/// covers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Fit {
    /// The output.
    pub output: String,
    /// The rows evaluated, 1-based and inclusive.
    pub rows: Vec<Rows>,
    /// What these rows served for; none for a log that the fit did not know.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part: Option<Part>,
    /// How far ahead the response looks.
    pub horizon: Horizon,
    /// What it starts from.
    pub initial: InitialCondition,
    /// N: samples without a start, or in a gap, do not count.
    pub samples: usize,
    /// 100 is perfect, 0 is as good as the mean; none where it is not defined: no samples, a constant output, a
    /// response that overflows.
    pub percent: Option<f64>,
    /// Root mean square error in units of y; none where there are no samples or the response overflows.
    pub rmse: Option<f64>,
    /// The mean of |e(t)| in units of y; none as for `rmse`, and in reports of before it was there.
    #[serde(default)]
    pub mean_absolute_error: Option<f64>,
    /// The largest |e(t)| in units of y; none likewise.
    #[serde(default)]
    pub largest_error: Option<f64>,
    /// Of a nonlinear model the share of these samples for which it read values outside of those that it was fitted to,
    /// 0 … 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outside: Option<f64>,
}

impl Fit {
    /// That of a response to some rows, beside what was measured of an output, one value for each row of the log.
    pub(crate) fn new(
        output: &str,
        measured: &[f64],
        response: &Response,
        rows: &[Rows],
        part: Option<Part>,
        (horizon, initial): (Horizon, InitialCondition),
    ) -> Self {
        let counted = |values| counted(values, &response.counted);
        let figures = figures(&counted(measured), &counted(&response.values));
        Self {
            output: output.to_owned(),
            rows: rows.to_vec(),
            part,
            horizon,
            initial,
            samples: response.counted.iter().map(|rows| rows.len()).sum::<usize>(),
            percent: figures.percent,
            rmse: figures.rmse,
            mean_absolute_error: figures.mean_absolute_error,
            largest_error: figures.largest_error,
            outside: None,
        }
    }
}

/// The figures of a [`Fit`]; none where they are no finite numbers.
struct Figures {
    percent: Option<f64>,
    rmse: Option<f64>,
    mean_absolute_error: Option<f64>,
    largest_error: Option<f64>,
}

/// The values that count, one after the other.
fn counted<'v>(values: &'v [f64], runs: &[Range<usize>]) -> Cow<'v, [f64]> {
    match runs {
        [run] => Cow::Borrowed(&values[run.clone()]),
        runs => Cow::Owned(runs.iter().flat_map(|run| &values[run.clone()]).copied().collect()),
    }
}

/// Those of measured values and what a model says of them.
fn figures(measured: &[f64], said: &[f64]) -> Figures {
    let n = measured.len() as f64;
    let mean = sum_above(measured, 0.0) / n;
    let spread = squares_above(measured, mean).sqrt();
    let [squares, sizes, largest] = differences(measured, said);
    let error = squares.sqrt();
    let finite = |figure: f64| Some(figure).filter(|figure| figure.is_finite());
    Figures {
        percent: finite(100.0 * (1.0 - error / spread)),
        rmse: finite(error / n.sqrt()),
        mean_absolute_error: finite(sizes / n),
        largest_error: finite(largest).filter(|_| n > 0.0),
    }
}

#[cfg(test)]
mod tests;
