//! The process with an integrator that a default choice may come to: a level that follows the sum of its input.
//!
//! A pole that was searched for ends near 1 and never on it; then the gain at rest is a large number that means
//! nothing. A process with an integrator has the pole where it is, and its gain for each second.

use thetahat_numerics::optimize::Monitor;
use thetahat_numerics::regression::sum;

use crate::Error;
use crate::data::{Decision, FindingKind, Log, Record, Source};
use crate::estimate::InformationCriterion;
use crate::figures::short;
use crate::model::{PolynomialModel, Quantity};
use crate::report::{Plan, ProcessPlan, Report, fit_process};
use crate::respond::{Horizon, InitialCondition, simulate};
use crate::validate::Part;

/// What is tried.
const STRUCTURES: [&str; 3] = ["p0di", "p1di", "p2di"];
/// A pole with a time constant of so many times the length of the log is one of an integrator.
const LENGTHS: f64 = 0.5;
/// So many standard errors from 1 a pole may be on it.
const CERTAIN: f64 = 3.0;
/// The mean square of the errors of a process may be this many times that of the polynomial model, which has more
/// parameters.
const CLOSE: f64 = 1.1;
/// The same beside a model whose noise integrates.
const FAR: f64 = 0.5;

/// A log as it was read, and how a process is fitted to it.
pub(super) struct Integrating<'l> {
    log: &'l Log,
    plan: ProcessPlan,
}

impl<'l> Integrating<'l> {
    /// None where the plan asks for something that a process is not.
    pub(super) fn of(log: &'l Log, plan: &Plan) -> Option<Self> {
        let open = plan.leaves_all_open() && plan.inputs.len() == 1 && plan.offsets.is_empty();
        let own = ProcessPlan::of(plan, plan.search()?);
        open.then_some(Self { log, plan: own })
    }

    /// The process that is as close to the log as a polynomial model with a pole that may be on 1, or far closer than
    /// one whose noise integrates, and why it is taken; none of other models, and where no process comes as close.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if the monitor says so.
    pub(super) fn instead(
        &self,
        model: &PolynomialModel,
        record: &Record<'_>,
        (sources, monitor): (&[Source], Monitor<'_>),
    ) -> Result<Option<(Report, Decision)>, Error> {
        let samples: usize = record.segments.iter().map(std::ops::Range::len).sum();
        // A noise that integrates follows the sum of an input too, but a free run with it does not.
        let (limit, evidence) = match slowest(model, samples) {
            _ if model.noise_integrates() => (FAR, "in free runs".to_owned()),
            Some(Quantity { value, standard_error, .. }) => {
                let spread = standard_error.map_or_else(String::new, |error| format!(" ± {}", short(error)));
                (CLOSE, format!("with a pole at {}{spread}", short(value)))
            }
            None => return Ok(None),
        };
        let Some(square) = free_run(model, record) else { return Ok(None) };
        let mut best: Option<(f64, Report)> = None;
        for structure in STRUCTURES {
            let plan = ProcessPlan { structures: vec![structure.parse()?], ..self.plan.clone() };
            let report = match fit_process(self.log, sources, &plan, monitor) {
                Ok(report) => report,
                Err(Error::Interrupted) => return Err(Error::Interrupted),
                Err(_) => continue,
            };
            let mdl = report.estimation.criteria.of(InformationCriterion::MDL).unwrap_or(f64::NEG_INFINITY);
            if best.as_ref().is_none_or(|(least, _)| mdl < *least) {
                best = Some((mdl, report));
            }
        }
        let free = |report: &Report| {
            let own = report
                .fit
                .iter()
                .find(|fit| fit.part == Some(Part::Estimation) && fit.horizon == Horizon::FreeRun);
            own.and_then(|fit| fit.rmse).map_or(f64::INFINITY, |rmse| rmse * rmse)
        };
        let taken = best.filter(|(_, report)| free(report) <= limit * square).map(|(_, report)| report);
        Ok(taken.map(|report| {
            let how = if limit < 1.0 { "far closer" } else { "as close" };
            let decision = Decision {
                kind: FindingKind::Integration,
                channels: vec![model.output.name.clone()],
                because: format!(
                    "'{}' follows the sum of '{}', {evidence}",
                    model.output.name,
                    self.plan.inputs.concat()
                ),
                did: format!(
                    "a process with an integrator is taken, {}, as it is {how}",
                    report.model.name()
                ),
                instead: "`model`".to_owned(),
            };
            (report, decision)
        }))
    }
}

/// The largest real pole, if it may be on 1.
fn slowest(model: &PolynomialModel, samples: usize) -> Option<Quantity> {
    let real = model.poles.iter().filter(|pole| pole.im == 0.0);
    let pole = real.max_by(|one, other| one.re.total_cmp(&other.re))?;
    let error = pole.covariance.map(|covariance| covariance[0][0].sqrt());
    let near = |error: f64| {
        (1.0 - pole.re).abs() <= CERTAIN * error && 1.0 - pole.re < 1.0 / (LENGTHS * samples as f64).sqrt()
    };
    let slow = pole.re >= (-1.0 / (LENGTHS * samples as f64)).exp();
    (slow || error.is_some_and(near)).then(|| Quantity::new(pole.re, error))
}

/// The mean square of the errors of a free run; none where it has none.
fn free_run(model: &PolynomialModel, record: &Record<'_>) -> Option<f64> {
    let response = simulate(model, record, InitialCondition::Estimate).ok()?;
    let rows = || response.counted.iter().cloned().flatten();
    let square =
        sum(rows().map(|row| (record.output[row] - response.values[row]).powi(2))) / rows().count() as f64;
    square.is_finite().then_some(square)
}
