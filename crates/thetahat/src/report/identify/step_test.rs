//! The process that a step test may be described by.

use thetahat_numerics::optimize::Monitor;

use crate::Error;
use crate::data::{Decision, Detrend, Log, Offset, Rows, Source};
use crate::estimate::{Background, Constant, Initial, Method};
use crate::model::ProcessStructure;
use crate::report::{Plan, ProcessPlan, Report, fit_process};
use crate::respond::process::{HeldLog, held_logs};
use crate::select::{Automatic, Choice, Focus, SelectedModel, Selection, Task, is_step_test, processes};

/// A log with few steps, as it was read.
pub(super) struct StepTest<'l> {
    log: &'l Log,
    held: Vec<HeldLog>,
    plan: ProcessPlan,
}

impl<'l> StepTest<'l> {
    /// None where the log is none, or the plan asks for something that a process is not.
    ///
    /// # Errors
    /// [`Error::Data`] for channels that are not there.
    pub(super) fn of(log: &'l Log, plan: &Plan, rows: &[Rows]) -> Result<Option<Self>, Error> {
        let free = matches!(&plan.choice, Choice::Automatic(Automatic { structure: None, nk: None, .. }))
            && !plan.select.is_held_out()
            && matches!(plan.focus, Focus::Auto | Focus::Simulation)
            && matches!(plan.initial, Initial::Auto | Initial::Zero)
            && plan.detrend == Detrend::Mean
            && plan.offsets.is_empty()
            && plan.constant != Constant::No
            && plan.prefilter.is_none();
        let Method::PredictionError(search) = &plan.method else { return Ok(None) };
        let last = rows.iter().map(Rows::last).max().unwrap_or(0);
        let values = |name: &String| Ok(&log.channel(name)?.values[..last]);
        let inputs = plan.inputs.iter().map(values).collect::<Result<Vec<_>, Error>>()?;
        if !free || !is_step_test(&inputs) {
            return Ok(None);
        }
        let offsets = plan.inputs.iter().zip(inputs).map(|(name, values)| {
            let level = values.iter().copied().find(|value| !value.is_nan()).unwrap_or(0.0);
            (name.as_str(), Offset { level, slope: 0.0 })
        });
        let names: Vec<&str> = plan.inputs.iter().map(String::as_str).collect();
        let held = held_logs(&log.deviations(offsets)?, &names, rows)?;
        let plan = ProcessPlan::of(plan, search);
        Ok(Some(Self { log, held, plan }))
    }

    /// Processes beside the polynomial model that was chosen; also the structure of the one that is taken, if one is.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if the monitor says so.
    pub(super) fn compete(
        &self,
        task: &Task<'_>,
        found: SelectedModel,
    ) -> Result<(SelectedModel, Option<ProcessStructure>), Error> {
        let output = &self.log.channel(&self.plan.output)?.values;
        let background = Background { level: true, slope: self.plan.trend, free: false };
        processes(task, found, (&self.held, output), background)
    }

    /// The fit of the process that was taken.
    ///
    /// # Errors
    /// As for [`fit_process`].
    pub(super) fn fit(
        self,
        structure: ProcessStructure,
        selection: Selection,
        decisions: Vec<Decision>,
        (sources, monitor): (&[Source], Monitor<'_>),
    ) -> Result<Report, Error> {
        let plan = ProcessPlan { structures: vec![structure], ..self.plan };
        let report = fit_process(self.log, sources, &plan, monitor)?;
        let decisions = [decisions, report.decisions].concat();
        Ok(Report { selection: Some(selection), decisions, ..report })
    }
}
