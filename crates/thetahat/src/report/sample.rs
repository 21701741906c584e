use super::apply::{Prepared, of_offsets, prepared};
use crate::Error;
use crate::data::{Detrend, Log, Rows};
use crate::model::Model;
use crate::respond::{Drawn, Draws, Horizon, InitialCondition, draw, record_for};

/// Free runs of a model on a log, drawn from what the estimate leaves open.
///
/// They are in the log's own units, with a value for each row of the log; NaN outside the rows asked for, in gaps, and
/// before a start. But for [`InitialCondition::Drop`], which begins anew from measured outputs, they go on where the
/// output alone is missing. `rows` are those to respond to; none: all. Offsets are as for
/// [`apply`](crate::report::apply), and a log without the output does for [`InitialCondition::Zero`]. [`Drawn::bands`]
/// gives the mean and quantiles of each row.
///
/// # Errors
/// As for [`apply`](crate::report::apply) and [`draw`].
///
/// ```
/// use thetahat::data::{Channel, Log};
/// use thetahat::model::Orders;
/// use thetahat::report::{Plan, identify, sample};
/// use thetahat::respond::{Draws, InitialCondition};
///
/// let u: Vec<f64> = (0..200).map(|t| f64::from(t * t % 7)).collect();
/// let mut y = vec![20.0];
/// for t in 1..200 {
///     y.push(4.0 + 0.8 * y[t - 1] + 0.5 * u[t - 1] + 0.01 * f64::from((t * t * t) as u32 % 11));
/// }
/// let channel = |name: &str, values| Channel { name: name.into(), values };
/// let log = Log::new(vec![channel("u", u), channel("y", y)], 0.1)?;
/// let model = identify(log.clone(), &[], &Plan::new(&["u"], "y", Orders::arx(1, &[1], &[1])?))?.model;
/// let runs = sample(&model, &log, &[], None, InitialCondition::Estimate, &Draws { count: 200, seed: 0 })?;
/// let (mean, bands) = runs.bands(&[0.025, 0.975]);
/// assert!(bands[0][150] < mean[150] && mean[150] < bands[1][150]);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn sample(
    model: &Model,
    log: &Log,
    rows: &[Rows],
    detrend: Option<Detrend>,
    initial: InitialCondition,
    draws: &Draws,
) -> Result<Drawn, Error> {
    model.polynomials("what is drawn from a fit's uncertainty")?;
    let Prepared { rows, log: deviations, levels } =
        prepared(model, log, rows, detrend, (Horizon::FreeRun, initial))?;
    let model = of_offsets(model, detrend);
    let model = model.polynomials("what is drawn from a fit's uncertainty")?;
    let record = record_for(model, &deviations, &rows, Horizon::FreeRun, initial)?;
    let mut drawn = draw(model, &record, initial, draws)?;
    for run in &mut drawn.values {
        for (row, value) in run.iter_mut().enumerate() {
            *value += levels[0].at(log.elapsed(row));
        }
    }
    Ok(drawn)
}
