//! The model in state space that a default choice may come to.

use thetahat_numerics::optimize::Monitor;

use crate::Error;
use crate::data::{Log, Source};
use crate::estimate::{Initial, Method};
use crate::report::{Plan, Report, StateSpacePlan, fit_state_space_monitored};
use crate::select::{Automatic, Choice, Focus, Select, Selection};

/// A log as it was read, and how a model in state space is fitted to it.
pub(super) struct InStates {
    log: Log,
    plan: StateSpacePlan,
}

impl InStates {
    /// None where the plan asks for something that a model in state space is not.
    pub(super) fn of(log: &Log, plan: &Plan) -> Option<Self> {
        let free = matches!(&plan.choice, Choice::Automatic(Automatic { structure: None, nk: None }))
            && matches!(plan.method, Method::PredictionError(_))
            && plan.select == Select::MDL
            && plan.focus == Focus::Auto
            && plan.initial == Initial::Auto
            && plan.prefilter.is_none()
            && !plan.trend
            && !plan.inputs.is_empty();
        let plan = || StateSpacePlan {
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
        free.then(|| Self { log: log.clone(), plan: plan() })
    }

    /// The fit of the order that was taken.
    ///
    /// # Errors
    /// As for [`fit_state_space_monitored`].
    pub(super) fn fit(
        self,
        order: usize,
        selection: Selection,
        sources: &[Source],
        monitor: Monitor<'_>,
    ) -> Result<Report, Error> {
        let plan = StateSpacePlan { orders: Some(order..=order), ..self.plan };
        let report = fit_state_space_monitored(&self.log, sources, &plan, monitor)?;
        Ok(Report { selection: Some(selection), ..report })
    }
}
