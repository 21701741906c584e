//! `thetahat fit --stream`: a linear model of logs of any length, which are read part by part.

use thetahat::report::{NormalEquations, Plan};
use thetahat::select::Choice;

use super::experiments::{Channels, wanted};
use super::search::{Identified, Telling};
use crate::failure::Failure;
use crate::job::FitJob;
use crate::log::{self, Piece};

/// Reads the logs part by part and fits the model. Memory does not grow with their rows.
pub(super) fn found(job: &FitJob, telling: &Telling) -> Result<Identified, Failure> {
    let failed = |error| Failure::about(&error, |_| names(job));
    let (sum, words) = telling.watched(|_| Ok(summed(job)))?.map_err(failed)??;
    words.iter().for_each(|word| telling.warn(word));
    let report = sum.solve().map_err(failed)?;
    Ok(Identified { report, log: None, sources: Vec::new() })
}

/// The normal equations of all logs, and what the reader should know.
fn summed(job: &FitJob) -> Result<(NormalEquations, Vec<String>), Failure> {
    let mut words = Vec::new();
    let mut sum: Option<NormalEquations> = None;
    let mut channels: Option<Channels> = None;
    let mut add = |plan: &Plan, Piece { log, source, past }: Piece| {
        let sources = [source];
        let piece = NormalEquations::new(&log, &sources, plan, past).map_err(log::failure(&sources))?;
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
            let own = Channels::same(&wanted(job), path, header, &mut channels)?;
            let Choice::Known(orders) = job.orders.of(own.inputs.len())? else {
                return Err(Failure::usage(
                    "--stream: one pass over the log makes one model; give its orders, such as --na 2 --nb 2",
                ));
            };
            let names = own.inputs.iter().chain(&own.outputs).cloned().collect();
            let (inputs, output) = own.single();
            Ok((names, orders.maximum_lag(), job.plan(inputs, output)?))
        };
        words.extend(log::in_pieces(path, &job.log, choose, &mut add)?);
    }
    let sum =
        sum.ok_or_else(|| Failure::data(format!("{}: there is no row; record at least one", names(job))))?;
    Ok((sum, words))
}

fn names(job: &FitJob) -> String {
    let names: Vec<String> = job.paths.iter().map(|path| path.display().to_string()).collect();
    names.join(", ")
}
