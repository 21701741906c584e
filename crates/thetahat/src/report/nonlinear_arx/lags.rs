//! Lags that nobody named.

use super::plan::{InputLags, NonlinearArxPlan};
use crate::Error;
use crate::data::{Log, Source};
use crate::model::Model;
use crate::optimize::Monitor;
use crate::report::{Plan, identify_monitored};
use crate::select::{Automatic, Choice};

/// The plan with the lags of the linear model that the data choose: as many past outputs as A or F reads, and of each input those of B and
/// the one before them, as a nonlinear plant may answer sooner.
///
/// # Errors
/// [`Error::Argument`] for several outputs; those of the choice.
pub(super) fn from_a_linear_choice(
    log: &Log,
    sources: &[Source],
    plan: &NonlinearArxPlan,
    monitor: Monitor<'_>,
) -> Result<NonlinearArxPlan, Error> {
    let [output] = &*plan.outputs else {
        return Err(Error::argument("ny", "lags are chosen for one output; name those of several"));
    };
    let inputs: Vec<&str> = plan.inputs.iter().map(String::as_str).collect();
    let own = Plan {
        estimate: plan.estimate.clone(),
        split: plan.split,
        detrend: plan.detrend,
        offsets: plan.offsets.clone(),
        ..Plan::new(&inputs, output, Choice::Automatic(Automatic::default()))
    };
    let report = identify_monitored(log.clone(), sources, &own, monitor)?;
    // A step test may come to a process, which has no lags: then those that stand in the plan are as good.
    let Model::Polynomial(linear) = &report.model else { return Ok(plan.clone()) };
    let orders = &linear.orders;
    let past = orders.nf.iter().copied().fold(orders.na, usize::max).max(1);
    let input_lags = orders.nb.iter().zip(&orders.nk).map(|(&nb, &nk)| {
        let sooner = nk.min(1);
        InputLags { lags: nb + sooner, delay: nk - sooner }
    });
    Ok(NonlinearArxPlan { output_lags: vec![past], input_lags: input_lags.collect(), ..plan.clone() })
}
