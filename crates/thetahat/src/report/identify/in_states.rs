//! The model in state space that a default choice may come to.

use thetahat_numerics::optimize::Monitor;

use crate::Error;
use crate::data::{Decision, Log, Source};
use crate::report::{Plan, Report, StateSpacePlan, fit_state_space_monitored};
use crate::select::Selection;

/// A log as it was read, and how a model in state space is fitted to it.
pub(super) struct InStates<'l> {
    log: &'l Log,
    plan: StateSpacePlan,
}

impl<'l> InStates<'l> {
    /// None where the plan asks for something that a model in state space is not.
    pub(super) fn of(log: &'l Log, plan: &Plan) -> Option<Self> {
        let own = || StateSpacePlan {
            inputs: plan.inputs.clone(),
            outputs: vec![plan.output.clone()],
            estimate: plan.estimate.clone(),
            validate: plan.validate.clone(),
            split: plan.split,
            detrend: plan.detrend,
            offsets: plan.offsets.clone(),
            constant: plan.constant,
            ..StateSpacePlan::new(&[], &[])
        };
        plan.leaves_all_open().then(|| Self { log, plan: own() })
    }

    /// The fit of the order that was taken.
    ///
    /// # Errors
    /// As for [`fit_state_space_monitored`].
    pub(super) fn fit(
        self,
        order: usize,
        selection: Selection,
        decisions: Vec<Decision>,
        (sources, monitor): (&[Source], Monitor<'_>),
    ) -> Result<Report, Error> {
        let plan = StateSpacePlan { orders: Some(order..=order), ..self.plan };
        let report = fit_state_space_monitored(self.log, sources, &plan, monitor)?;
        let decisions = [decisions, report.decisions].concat();
        Ok(Report { selection: Some(selection), decisions, ..report })
    }
}
