use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::data::Rows;
use crate::regression::sum;
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
/// With e = y - y^: percent = 100 (1 - |e| / |y - mean(y)|), rmse = |e| / sqrt(N), |.| being the root of the sum of squares,
/// and the mean and the largest of the absolute errors |e(t)|, all over the N samples that the response covers.
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
    /// 100 is perfect, 0 is as good as the mean; none where it is not defined: no samples, a constant output, a response
    /// that overflows.
    pub percent: Option<f64>,
    /// Root mean square error in units of y; none where there are no samples or the response overflows.
    pub rmse: Option<f64>,
    /// The mean of |e(t)| in units of y; none as for `rmse`, and in reports of before it was there.
    #[serde(default)]
    pub mean_absolute_error: Option<f64>,
    /// The largest |e(t)| in units of y; none likewise.
    #[serde(default)]
    pub largest_error: Option<f64>,
    /// Of a nonlinear model the share of these samples for which it read values outside of those that it was fitted to, 0 … 1.
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
        let counted = || response.counted.iter().cloned().flatten();
        let samples = response.counted.iter().map(|rows| rows.len()).sum::<usize>();
        let pairs = || counted().map(|t| (measured[t], response.values[t]));
        let (percent, rmse) = closeness(pairs());
        let errors = || pairs().map(|(measured, said)| (measured - said).abs());
        let known = |figure: f64| Some(figure).filter(|figure| samples > 0 && figure.is_finite());
        Self {
            output: output.to_owned(),
            rows: rows.to_vec(),
            part,
            horizon,
            initial,
            samples,
            percent,
            rmse,
            mean_absolute_error: known(sum(errors()) / samples as f64),
            // One that is not a number stays one.
            largest_error: known(
                errors().fold(0.0_f64, |largest, e| if e > largest || e.is_nan() { e } else { largest }),
            ),
            outside: None,
        }
    }
}

/// percent and rmse, as [`Fit`] defines them, of pairs of a measured value and what a model says.
fn closeness(pairs: impl Iterator<Item = (f64, f64)> + Clone) -> (Option<f64>, Option<f64>) {
    let n = pairs.clone().count() as f64;
    let mean = sum(pairs.clone().map(|(measured, _)| measured)) / n;
    let error = sum(pairs.clone().map(|(measured, said)| (measured - said).powi(2))).sqrt();
    let spread = sum(pairs.map(|(measured, _)| (measured - mean).powi(2))).sqrt();
    let finite = |figure: f64| Some(figure).filter(|figure| figure.is_finite());
    (finite(100.0 * (1.0 - error / spread)), finite(error / n.sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Offset, Record};
    use crate::estimate::{Initial, arx};
    use crate::model::{Orders, PolynomialModel, Signal};
    use crate::regression::noise::Noise;
    use crate::respond::{predict, simulate};

    #[test]
    fn figures_are_what_they_say() {
        let mut noise = Noise(1);
        let u = noise.take(200);
        let mut y = vec![3.0];
        (1..200).for_each(|t| y.push(0.7 * y[t - 1] + u[t - 1] + 0.2 * noise.next()));
        let mut record = Record::new(&y, vec![&u]).unwrap();
        let orders = Orders::arx(1, &[1], &[1]).unwrap();
        let estimate = arx(&record, &orders, Initial::Drop).unwrap();
        let signal = || Signal { name: String::new(), offset: Offset::default() };
        let model = estimate.to_model(&orders, 1.0, vec![signal()], signal()).unwrap();
        let of = |model: &PolynomialModel, record: &Record<'_>, horizon, initial| {
            let response = match horizon {
                Horizon::Steps { steps } => predict(model, record, steps, initial).unwrap(),
                Horizon::FreeRun => simulate(model, record, initial).unwrap(),
            };
            (Fit::new("y", record.output, &response, &[], None, (horizon, initial)), response)
        };
        let fit = |record: &Record<'_>, horizon, initial| of(&model, record, horizon, initial);

        // One step ahead on the rows of the fit: its own residuals.
        let (figures, _) = fit(&record, Horizon::Steps { steps: 1 }, InitialCondition::Drop);
        assert_eq!(figures.samples, 199);
        assert!((figures.rmse.unwrap() - estimate.mse().sqrt()).abs() < 1e-14);

        record.segments = vec![10..12, 20..120];
        record.past = vec![0, 0];
        let (figures, response) = fit(&record, Horizon::FreeRun, InitialCondition::Zero);
        let rows = || (10..12).chain(20..120);
        let mean = rows().map(|t| y[t]).sum::<f64>() / 102.0;
        let error = rows().map(|t| (y[t] - response.values[t]).powi(2)).sum::<f64>();
        let spread = rows().map(|t| (y[t] - mean).powi(2)).sum::<f64>();
        assert_eq!(figures.samples, 102);
        assert!((figures.rmse.unwrap() - (error / 102.0).sqrt()).abs() < 1e-14);
        assert!((figures.percent.unwrap() - 100.0 * (1.0 - (error / spread).sqrt())).abs() < 1e-11);
        let errors: Vec<f64> = rows().map(|t| (y[t] - response.values[t]).abs()).collect();
        let mean = errors.iter().sum::<f64>() / 102.0;
        assert!((figures.mean_absolute_error.unwrap() - mean).abs() < 1e-14);
        assert_eq!(figures.largest_error, errors.iter().copied().reduce(f64::max));

        // What starts naturally counts as much as it can.
        assert_eq!(InitialCondition::natural(&model, Horizon::Steps { steps: 3 }), InitialCondition::Drop);
        assert_eq!(InitialCondition::natural(&model, Horizon::FreeRun), InitialCondition::Estimate);
        let orders = Orders::armax(1, &[1], 1, &[1]).unwrap();
        let armax = PolynomialModel::from_parameters(&orders, &[-0.5, 1.0, 0.5], None, 1.0, 1.0).unwrap();
        let start = InitialCondition::natural(&armax, Horizon::Steps { steps: 1 });
        assert_eq!(start, InitialCondition::Estimate);
        assert_eq!(of(&armax, &record, Horizon::Steps { steps: 1 }, start).0.samples, 100);

        // No sample is far enough from a start; nothing to explain.
        let (figures, _) = fit(&record, Horizon::Steps { steps: 300 }, InitialCondition::Drop);
        assert_eq!((figures.samples, figures.percent, figures.rmse), (0, None, None));
        assert_eq!((figures.mean_absolute_error, figures.largest_error), (None, None));
        let constant = [1.0; 10];
        let (figures, _) =
            fit(&Record::new(&constant, vec![&constant]).unwrap(), Horizon::FreeRun, InitialCondition::Zero);
        assert_eq!((figures.samples, figures.percent), (10, None));
    }
}
