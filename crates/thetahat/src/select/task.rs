use thetahat_numerics::optimize::{Deadline, Monitor, Search};

use super::choice::Select;
use super::focus::Focus;
use super::selection::Selection;
use crate::data::{Decision, Record};
use crate::estimate::Initial;
use crate::model::Orders;

/// What a choice is made from.
#[derive(Clone, Copy)]
pub(crate) struct Task<'a> {
    pub(crate) estimation: &'a Record<'a>,
    pub(crate) validation: Option<&'a Record<'a>>,
    /// The inputs' names. Both records have further inputs after these where a constant or a trend is part of every
    /// model.
    pub(crate) inputs: &'a [String],
    pub(crate) select: Select,
    pub(crate) focus: Focus,
    pub(crate) initial: Initial,
    pub(crate) search: &'a Search,
    /// Whether a drift of the noise is looked for.
    pub(crate) may_drift: bool,
    /// Of all its searches.
    pub(crate) deadline: Deadline,
    pub(crate) monitor: Monitor<'a>,
}

impl<'a> Task<'a> {
    /// Orders with those of the inputs that have no name.
    pub(super) fn with_constants(&self, orders: &Orders) -> Orders {
        orders.with_constants(self.estimation.inputs.len() - self.inputs.len())
    }

    /// Whether models are evaluated by more than errors one step ahead.
    pub(crate) fn looks_further(&self) -> bool {
        !self.inputs.is_empty() && self.focus.looks_further()
    }

    /// The same without them.
    pub(super) fn named(&self, orders: &Orders) -> Orders {
        let mut orders = orders.clone();
        [&mut orders.nb, &mut orders.nf, &mut orders.nk]
            .into_iter()
            .for_each(|each| each.truncate(self.inputs.len()));
        orders
    }

    /// The record to estimate on without these inputs.
    pub(crate) fn named_record(&self) -> Record<'a> {
        let inputs = self.estimation.inputs[..self.inputs.len()].to_vec();
        Record { inputs, ..self.estimation.clone() }
    }
}

/// What was chosen.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SelectedModel {
    pub(crate) selection: Selection,
    /// What was done because of what the records show.
    pub(crate) decisions: Vec<Decision>,
    /// The parameters of the chosen model, with a constant and a trend where the records have them, if a search found
    /// them: a start for the search on all samples.
    pub(crate) initial_parameters: Option<Vec<f64>>,
}

/// A sum of squared errors below this fraction of the output's is rounding: the model is exact.
pub(super) const EXACT: f64 = 1e-20;
