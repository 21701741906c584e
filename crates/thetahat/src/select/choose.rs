use std::ops::ControlFlow;

use thetahat_numerics::optimize::{Deadline, Monitor, Search};

use super::choice::{Choice, Path, Select};
use super::focus::Focus;
use super::selection::Selection;
use super::task::{SelectedModel, Task};
use super::{automatic, compare, ranking};
use crate::Error;
use crate::data::Record;
use crate::estimate::Initial;

/// Chooses the orders of a model. All models are compared on the same samples of the record; those of `validation` are
/// for [`Select::Validation`]. Inputs are called `u1`, `u2`, ….
///
/// A model is then fitted with [`estimate`](crate::estimate::estimate()), which may use samples that were left out
/// here.
///
/// Cost: for models without C, D and F, O(N p) for the p columns of all of them together, and no pass over the data for
/// each; of each other model a search, from what its neighbours have found.
///
/// # Errors
/// [`Error::Argument`] for ranges that make no model, a structure that does not fit the inputs, an initial condition
/// that does not fit the models, or if there is no validation record where one is needed; [`Error::Undetermined`] and
/// [`Error::Data`] as for [`estimate`](crate::estimate::estimate()).
///
/// ```
/// use thetahat::data::Record;
/// use thetahat::model::Orders;
/// use thetahat::select::{Choice, Grid, OrderRange, Path, Select, choose_orders};
///
/// // y(t) = 1.2 y(t-1) - 0.5 y(t-2) + u(t-3) + e(t).
/// let random = |t: u32, by: u32| f64::from(t * t % by) / f64::from(by) - 0.5;
/// let u: Vec<f64> = (0..300).map(|t| random(t, 71)).collect();
/// let mut y = vec![0.0; 3];
/// for t in 3..300 {
///     y.push(1.2 * y[t - 1] - 0.5 * y[t - 2] + u[t - 3] + 0.1 * random(t as u32, 97));
/// }
/// let range = |first, last| OrderRange::new(first, last);
/// let grid = Grid {
///     na: range(1, 4)?,
///     nb: vec![range(1, 4)?],
///     nc: 0.into(),
///     nd: 0.into(),
///     nf: vec![0.into()],
///     nk: vec![range(1, 5)?],
///     path: Path::All,
/// };
/// let found = choose_orders(&Record::new(&y, vec![&u])?, None, &Choice::Grid(grid), Select::MDL)?;
/// assert_eq!(found.chosen.orders, Orders::arx(2, &[1], &[3])?);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn choose_orders(
    record: &Record<'_>,
    validation: Option<&Record<'_>>,
    choice: &Choice,
    select: Select,
) -> Result<Selection, Error> {
    let inputs: Vec<String> = (1..=record.inputs.len()).map(|number| format!("u{number}")).collect();
    let search = Search::default();
    let monitor: Monitor<'_> = &|_| ControlFlow::Continue(());
    let task = Task {
        estimation: record,
        validation,
        inputs: &inputs,
        select,
        focus: Focus::Auto,
        initial: Initial::Auto,
        may_drift: true,
        search: &search,
        deadline: Deadline::after(search.time_limit),
        monitor,
    };
    Ok(choose(&task, choice)?.selection)
}

/// Chooses the orders of a model.
///
/// # Errors
/// As for [`choose_orders`]; [`Error::Interrupted`] if the monitor says so.
pub(crate) fn choose(task: &Task<'_>, choice: &Choice) -> Result<SelectedModel, Error> {
    if task.select == Select::Validation && task.validation.is_none() {
        return Err(Error::argument(
            "select",
            "validation needs rows that the models are not fitted to; name them (`validate`), or select by cv",
        ));
    }
    let inputs = task.inputs.len();
    if let Some(validation) = task.validation
        && validation.inputs.len() != task.estimation.inputs.len()
    {
        let other = validation.inputs.len();
        return Err(Error::argument(
            "validation",
            format!("its record has {other} inputs, that of the estimation {inputs}"),
        ));
    }
    // With ranges of orders the criterion decides.
    let gated = matches!(choice, Choice::Automatic(_)) && inputs > 0;
    let focus = if task.focus == Focus::Auto && !gated { Focus::Prediction } else { task.focus };
    let may_drift = task.may_drift && gated;
    let task = &Task { focus, may_drift, ..*task };
    match choice {
        Choice::Known(orders) => {
            let outcome = compare::compare(task, vec![orders.clone()], None)?;
            ranking::ranked(task, outcome, Some(Path::All))
        }
        Choice::Grid(grid) => {
            let outcome = compare::compare(task, grid.orders(inputs)?, None)?;
            ranking::ranked(task, outcome, Some(grid.path))
        }
        Choice::Automatic(automatic) => automatic::choose(task, automatic),
    }
}
