//! `thetahat fit --stream`: a model of logs of any length, which are read part by part.

use std::path::PathBuf;

use thetahat::Error;
use thetahat::data::{Log, Source};
use thetahat::report::NormalEquations;
use thetahat::select::Choice;

use super::experiments::{Channels, Wanted, wanted};
use super::search::{Identified, Telling};
use super::{narx, state_space};
use crate::args::{FitArguments, MapArgument};
use crate::failure::Failure;
use crate::job::{FitJob, LogJob, NarxJob, StateSpaceJob};
use crate::log::{self, Piece};

/// A model whose normal equations are sums over parts of the logs.
pub(crate) enum PiecesJob {
    Linear(Box<FitJob>),
    /// Of a subspace method, or an ARX model with several outputs.
    StateSpace(Box<StateSpaceJob>),
    NonlinearArx(Box<NarxJob>),
}

/// Makes the normal equations of a part, which begins with so many rows of the one before it.
pub type Making = Box<dyn Fn(&Log, &[Source], usize) -> Result<NormalEquations, Error> + Send + Sync>;

impl PiecesJob {
    /// A log that is there already may have several outputs without their names.
    pub(crate) fn resolve(arguments: &FitArguments, has_several: bool) -> Result<Self, Failure> {
        if let Some(map) = MapArgument::asked(arguments.narx.narx) {
            return Ok(Self::NonlinearArx(Box::new(NarxJob::resolve(arguments, map)?)));
        }
        if let Some(job) = StateSpaceJob::resolve(arguments, has_several)? {
            return Ok(Self::StateSpace(Box::new(job)));
        }
        let job = FitJob::resolve(arguments)?;
        job.check_output()?;
        Ok(Self::Linear(Box::new(job)))
    }

    fn logs(&self) -> (&[PathBuf], &LogJob) {
        match self {
            Self::Linear(job) => (&job.paths, &job.log),
            Self::StateSpace(job) => (&job.paths, &job.log),
            Self::NonlinearArx(job) => (&job.paths, &job.log),
        }
    }

    /// How the logs are read.
    pub(super) fn log(&mut self) -> &mut LogJob {
        match self {
            Self::Linear(job) => &mut job.log,
            Self::StateSpace(job) => &mut job.log,
            Self::NonlinearArx(job) => &mut job.log,
        }
    }

    fn wanted(&self) -> Wanted<'_> {
        match self {
            Self::Linear(job) => wanted(job),
            Self::StateSpace(job) => state_space::wanted(job),
            Self::NonlinearArx(job) => narx::wanted(job),
        }
    }

    /// Whether the model has inputs.
    pub(crate) fn is_driven(&self) -> bool {
        self.wanted().driven
    }

    /// What makes the sums of a part with these columns, and how many rows of the one before it it needs.
    pub(crate) fn making(&self, channels: Channels) -> Result<(usize, Making), Failure> {
        Ok(match self {
            Self::Linear(_) if channels.outputs.len() > 1 => {
                return Err(Failure::usage(format!(
                    "--output: there are {}, and the model has one; name it",
                    channels.outputs.join(", ")
                )));
            }
            Self::Linear(job) => {
                let (inputs, output) = channels.single();
                let plan = job.plan(inputs, output)?;
                let lags = match &plan.choice {
                    Choice::Known(orders) => orders.maximum_lag(),
                    Choice::Grid(_) | Choice::Automatic(_) => 0,
                };
                (lags, Box::new(move |log, sources, past| NormalEquations::new(log, sources, &plan, past)))
            }
            Self::StateSpace(job) => {
                let plan = job.plan(channels.inputs, channels.outputs)?;
                let lags = plan.lags();
                let made = move |log: &Log, sources: &[Source], past| {
                    NormalEquations::of_states(log, sources, &plan, past)
                };
                (lags, Box::new(made))
            }
            Self::NonlinearArx(job) => {
                let plan = job.plan(channels.inputs, channels.outputs)?;
                let lags = plan.lags();
                let made = move |log: &Log, sources: &[Source], past| {
                    NormalEquations::of_nonlinear_arx(log, sources, &plan, past)
                };
                (lags, Box::new(made))
            }
        })
    }

    /// Whether a model of these orders has to have inputs: products are of what there is.
    pub(crate) fn needs_inputs(&self) -> bool {
        self.is_driven() && !matches!(self, Self::NonlinearArx(_))
    }

    /// Whether there is one model to be made.
    fn check_orders(&self, inputs: usize) -> Result<(), Failure> {
        match self {
            Self::Linear(job) if !matches!(job.orders.of(inputs)?, Choice::Known(_)) => Err(Failure::usage(
                "--stream: one pass over the log makes one model; give its orders, such as --na 2 --nb 2",
            )),
            _ => Ok(()),
        }
    }

    fn names(&self) -> String {
        let names: Vec<String> = self.logs().0.iter().map(|path| path.display().to_string()).collect();
        names.join(", ")
    }

    /// Reads the logs part by part and fits the model. Memory does not grow with their rows.
    pub(super) fn found(&self, telling: &Telling) -> Result<Identified, Failure> {
        let failed = |error| Failure::about(&error, |_| self.names());
        let (sum, words) = telling.watched(|_| Ok(self.summed()))?.map_err(failed)??;
        words.iter().for_each(|word| telling.warn(word));
        let report = sum.solve().map_err(failed)?;
        Ok(Identified { report, log: None, sources: Vec::new() })
    }

    /// The normal equations of all logs, and what the reader should know.
    fn summed(&self) -> Result<(NormalEquations, Vec<String>), Failure> {
        let (paths, job) = self.logs();
        let mut words = Vec::new();
        let mut sum: Option<NormalEquations> = None;
        let mut channels: Option<Channels> = None;
        let mut add = |making: &Making, Piece { log, source, past }: Piece| {
            let sources = [source];
            let piece = making(&log, &sources, past).map_err(log::failure(&sources))?;
            match &mut sum {
                Some(sum) => sum.merge(&piece).map_err(log::failure(&sources)),
                None => {
                    sum = Some(piece);
                    Ok(())
                }
            }
        };
        for path in paths {
            let choose = |header: &[String]| {
                let own = Channels::same(&self.wanted(), path, header, &mut channels)?;
                self.check_orders(own.inputs.len())?;
                let names = own.inputs.iter().chain(&own.outputs).cloned().collect();
                let (lags, making) = self.making(own)?;
                Ok((names, lags, making))
            };
            words.extend(log::in_pieces(path, job, choose, &mut add)?);
        }
        let sum = sum.ok_or_else(|| {
            Failure::data(format!("{}: there is no row; record at least one", self.names()))
        })?;
        Ok((sum, words))
    }
}
