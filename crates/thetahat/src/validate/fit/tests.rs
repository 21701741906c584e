use thetahat_numerics::noise::Noise;

use super::*;
use crate::data::{Offset, Record};
use crate::estimate::{Initial, arx};
use crate::model::{Orders, PolynomialModel, Signal};
use crate::respond::{predict, simulate};

#[test]
fn figures_are_what_they_say() {
    let mut noise = Noise(1);
    let u = noise.take(200);
    let mut y = vec![3.0];
    (1..200).for_each(|t| y.push(0.7 * y[t - 1] + u[t - 1] + 0.2 * noise.uniform()));
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
