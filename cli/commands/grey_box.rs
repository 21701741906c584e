//! `thetahat fit --grey`: the unknown parameters of a model in equations.

use thetahat::model::GreyBox;
use thetahat::report::fit_equations;

use super::search::{Identified, Telling};
use super::stored;
use crate::failure::Failure;
use crate::job::GreyBoxJob;
use crate::log::{self, Clocks, Joined};

/// Reads the logs and fits the model.
pub(super) fn found(job: &GreyBoxJob, telling: &Telling) -> Result<Identified, Failure> {
    let text = stored::text(&job.model)?;
    let model = GreyBox::from_toml(&text)
        .map_err(|error| Failure::data(format!("{}: {error}", job.model.display())))?;
    let Joined { log, sources, words } = log::joined(&job.paths, &job.log, Clocks::from(&model), |_, _| {
        Ok(model.inputs().iter().chain(model.outputs()).cloned().collect())
    })?;
    words.iter().for_each(|word| telling.warn(word));
    let report = telling.watched(|monitor| fit_equations(&model, &log, &sources, &job.plan, monitor))?;
    let report = report.map_err(log::failure(&sources))?;
    Ok(Identified { report, log: Some(log), sources })
}
