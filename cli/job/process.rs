use std::path::{Path, PathBuf};

use thetahat::model::ProcessStructure;
use thetahat::report::ProcessPlan;

use super::fit::named_values;
use super::{LogJob, parsed, refused, rows, search};
use crate::args::{FitArguments, InitialArgument, ModelArgument, Names};
use crate::failure::Failure;
use crate::memory::PerValue;

/// A process in continuous time to fit.
#[derive(Debug)]
pub(crate) struct ProcessJob {
    /// The logs, at least one unless a response is there instead.
    pub(crate) paths: Vec<PathBuf>,
    /// The document of a frequency response.
    pub(crate) from: Option<PathBuf>,
    /// How all of them are read.
    pub(crate) log: LogJob,
    /// Named inputs; none: those called u, u1, u2, …
    pub(crate) inputs: Option<Vec<String>>,
    /// The named outputs, one at most; none: y.
    pub(crate) outputs: Vec<String>,
    /// The rest of the plan: channels are open.
    plan: ProcessPlan,
}

impl ProcessJob {
    /// The job, if a process is asked for.
    pub(crate) fn resolve(arguments: &FitArguments) -> Result<Option<Self>, Failure> {
        let own = &arguments.model;
        let (option, model, name) = match (&*own.structure, &*own.np) {
            ([], []) => return Ok(None),
            ([], _) => ("--np", ModelArgument::Tf, "tf"),
            _ => ("--structure", ModelArgument::Process, "process"),
        };
        if own.model.is_some_and(|other| other != model) {
            return Err(Failure::usage(format!("{option} is of --model {name}; leave one of the two out")));
        }
        let structures = if own.np.is_empty() {
            let each = own.structure.iter().map(|text| parsed::<ProcessStructure>("--structure", text));
            each.collect::<Result<Vec<_>, _>>()?
        } else {
            transfer_functions(&own.np, &own.nz, own.delay)?
        };
        let outputs = Names::all(&arguments.output).unwrap_or_default();
        if outputs.len() > 1 {
            return Err(Failure::usage("--output: a process has one output; fit one after the other"));
        }
        let free_start = match own.initial {
            InitialArgument::Auto => {
                let free =
                    arguments.from.is_none() && structures.iter().all(ProcessStructure::is_transfer_function);
                free.then_some(true)
            }
            InitialArgument::Zero => Some(false),
            InitialArgument::Estimate => Some(true),
            InitialArgument::Drop => {
                return Err(Failure::usage(
                    "--initial drop is for models of past outputs; a process starts from zero, which is at rest, or estimate",
                ));
            }
        };
        if arguments.logs.iter().filter(|path| *path == Path::new("-")).count() > 1 {
            return Err(Failure::usage("only one of the logs can come from standard input (-)"));
        }
        let plan = ProcessPlan {
            inputs: Vec::new(),
            output: String::new(),
            structures,
            estimate: rows("--estimate", &arguments.estimate)?,
            validate: rows("--validate", &arguments.validate)?,
            split: arguments.choice.split.as_deref().map(|text| parsed("--split", text)).transpose()?,
            offsets: named_values("--offset", &arguments.offset)?,
            trend: own.trend,
            free_start,
            search: search::search(&arguments.search)?,
        };
        Ok(Some(Self {
            paths: arguments.logs.clone(),
            from: arguments.from.clone(),
            log: LogJob { per_value: PerValue::Search, ..LogJob::resolve(&arguments.log, &arguments.clock)? },
            inputs: Names::all(&arguments.input),
            outputs,
            plan,
        }))
    }

    /// The plan for a frequency response, of all its inputs if none are named.
    pub(crate) fn plan_of_response(&self) -> ProcessPlan {
        ProcessPlan { inputs: self.inputs.clone().unwrap_or_default(), ..self.plan.clone() }
    }

    /// The plan for the channels of a log.
    pub(crate) fn plan(&self, inputs: Vec<String>, output: String) -> Result<ProcessPlan, Failure> {
        let plan = ProcessPlan { inputs, output, ..self.plan.clone() };
        plan.check().map_err(|error| Failure::option(&error))?;
        Ok(plan)
    }
}

/// One for each number of poles; one number of zeros is for all, none is one less than poles.
fn transfer_functions(np: &[usize], nz: &[usize], delay: bool) -> Result<Vec<ProcessStructure>, Failure> {
    let (count, zeros) = (np.len().max(nz.len()), nz.len());
    if (np.len() != 1 && np.len() != count) || (zeros > 1 && zeros != count) {
        return Err(Failure::usage(format!(
            "--nz: {zeros} numbers beside {} of --np; give one for all inputs or one for each",
            np.len()
        )));
    }
    let of = |list: &[usize], input: usize| list.get(input).or(list.first()).copied();
    let each = (0..count).map(|input| {
        let poles = of(np, input).unwrap_or(0);
        let zeros = of(nz, input).unwrap_or(poles.saturating_sub(1));
        ProcessStructure::transfer_function(poles, zeros, delay).map_err(|error| refused("--np", &error))
    });
    each.collect()
}
