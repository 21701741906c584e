//! Which of several models to believe.
//!
//! - `grid`: the models of ranges of orders; `automatic`: those that are tried where nothing is asked for; `delay`: their delays.
//! - `compare`: all of them on the same samples. `linear` has those without C, D and F from one factor of the largest,
//!   `search` the others, each from its neighbours; `unseen` looks at samples that they were not fitted to.
//! - `ranking`: which is the best.

mod automatic;
mod candidates;
mod choice;
mod compare;
mod delay;
mod focus;
mod folds;
mod grid;
mod held_out;
mod linear;
mod ranking;
mod search;
mod selection;
#[cfg(test)]
mod tests;
mod unseen;
mod winners;

use std::ops::ControlFlow;

use crate::data::Record;
use crate::estimate::Initial;
use crate::optimize::{Deadline, Monitor, Search};
use crate::{Error, Orders};
pub(crate) use automatic::constant_pays;
pub use choice::{Automatic, Choice, Grid, OrderRange, Path, Select};
pub(crate) use delay::delays;
pub use focus::Focus;
pub use selection::{Best, Delay, HeldOut, Scan, Scored, Selection};

/// What a choice is made from.
#[derive(Clone, Copy)]
pub(crate) struct Task<'a> {
    pub(crate) estimation: &'a Record<'a>,
    pub(crate) validation: Option<&'a Record<'a>>,
    /// The inputs' names. Both records have further inputs behind these where a constant or a trend is part of every model.
    pub(crate) inputs: &'a [String],
    pub(crate) select: Select,
    pub(crate) focus: Focus,
    pub(crate) initial: Initial,
    pub(crate) search: &'a Search,
    /// Of all its searches.
    pub(crate) deadline: Deadline,
    pub(crate) monitor: Monitor<'a>,
}

impl<'a> Task<'a> {
    /// Orders with those of the inputs that have no name.
    fn with_constants(&self, orders: &Orders) -> Orders {
        orders.with_constants(self.estimation.inputs.len() - self.inputs.len())
    }

    /// Whether models are judged by more than errors one step ahead.
    fn looks_further(&self) -> bool {
        !self.inputs.is_empty() && self.focus.looks_further()
    }

    /// The same without them.
    fn named(&self, orders: &Orders) -> Orders {
        let mut orders = orders.clone();
        [&mut orders.nb, &mut orders.nf, &mut orders.nk]
            .into_iter()
            .for_each(|each| each.truncate(self.inputs.len()));
        orders
    }

    /// The record to estimate on without these inputs.
    fn named_record(&self) -> Record<'a> {
        let inputs = self.estimation.inputs[..self.inputs.len()].to_vec();
        Record { inputs, ..self.estimation.clone() }
    }
}

/// What was chosen.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Found {
    pub(crate) selection: Selection,
    /// The parameters of the chosen model, with a constant and a trend where the records have them, if a search found them: a
    /// start for the search on all samples.
    pub(crate) guess: Option<Vec<f64>>,
}

/// A sum of squared errors below this fraction of the output's is rounding: the model is exact.
const EXACT: f64 = 1e-20;

/// Chooses the orders of a model. All models are compared on the same samples of the record; those of `validation` are for
/// [`Select::Validation`]. Inputs are called `u1`, `u2`, ….
///
/// A model is then fitted with [`estimate`](crate::estimate()), which may use samples that were left out here.
///
/// Cost: for models without C, D and F, O(N p) for the p columns of all of them together, and no pass over the data for each;
/// of each other model a search, from what its neighbours have found.
///
/// # Errors
/// [`Error::Argument`] for ranges that make no model, a structure that does not fit the inputs, an initial condition that does
/// not fit the models, or if there is no validation record where one is needed; [`Error::Undetermined`] and
/// [`Error::Data`] as for [`estimate`](crate::estimate()).
///
/// ```
/// use thetahat::{Choice, Grid, OrderRange, Orders, Path, Record, Select, choose_orders};
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
pub(crate) fn choose(task: &Task<'_>, choice: &Choice) -> Result<Found, Error> {
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
    // Who gives ranges asks for the criterion.
    let gated = matches!(choice, Choice::Automatic(_)) && inputs > 0;
    let focus = if task.focus == Focus::Auto && !gated { Focus::Prediction } else { task.focus };
    let task = &Task { focus, ..*task };
    match choice {
        Choice::Known(orders) => {
            let outcome = compare::compare(task, vec![orders.clone()])?;
            ranking::ranked(task, outcome, Some(Path::All))
        }
        Choice::Grid(grid) => {
            let outcome = compare::compare(task, grid.orders(inputs)?)?;
            ranking::ranked(task, outcome, Some(grid.path))
        }
        Choice::Automatic(automatic) => automatic::choose(task, automatic),
    }
}
