//! `thetahat fit --stream`: a model of logs of any length, which are read part by part.

use thetahat::fit::FitPlan;
use thetahat::report::{NormalEquations, Report};

use super::experiments::{Channels, Wanted};
use super::search::{Identified, Telling};
use crate::failure::Failure;
use crate::job::FitJob;
use crate::log::{self, Piece};

/// Reads the logs part by part and fits the model. Memory does not grow with their rows.
pub(super) fn found(job: &FitJob, telling: &Telling) -> Result<Identified, Failure> {
    let names = || job.paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ");
    let failed = |error| Failure::about(&error, |_| names());
    let (sum, plan, warnings) = telling.watched(|_| Ok(summed(job)))?.map_err(failed)??;
    warnings.iter().for_each(|warning| telling.warn(warning));
    let (sum, plan) = sum
        .zip(plan)
        .ok_or_else(|| Failure::data(format!("{}: there is no row; record at least one", names())))?;
    let report = Report { plan: Some(plan.options().clone()), ..sum.solve().map_err(failed)? };
    Ok(Identified { report, log: None, sources: Vec::new() })
}

/// The normal equations of all logs, the plan that they were made by, and what the reader should know.
type Summed = (Option<NormalEquations>, Option<FitPlan>, Vec<String>);

fn summed(job: &FitJob) -> Result<Summed, Failure> {
    let option = |error| Failure::option(&error);
    let (mut warnings, mut sum, mut found) = (Vec::new(), None::<NormalEquations>, None);
    let mut channels: Option<Channels> = None;
    let mut add = |plan: &FitPlan, Piece { log, source, past }: Piece| {
        let sources = [source];
        let piece = plan.pieces(&log, &sources, past).map_err(log::failure(&sources))?;
        match &mut sum {
            Some(sum) => sum.merge(&piece).map_err(log::failure(&sources)),
            None => {
                sum = Some(piece);
                Ok(())
            }
        }
    };
    for path in &job.paths {
        let choose = |header: &[String]| {
            let draft = job.draft()?;
            let own = Channels::same(&Wanted::of(&draft), path, header, &mut channels)?;
            let names = own.inputs.iter().chain(&own.outputs).cloned().collect();
            let plan = draft.plan(own.inputs, own.outputs).map_err(option)?;
            plan.check_pieces().map_err(option)?;
            found = Some(plan.clone());
            Ok((names, plan.lags(), plan))
        };
        warnings.extend(log::in_pieces(path, &job.log, choose, &mut add)?);
    }
    Ok((sum, found, warnings))
}
