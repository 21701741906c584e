//! Processes in continuous time.

use std::borrow::Cow;
use std::sync::Arc;

use thetahat_numerics::optimize::Monitor;

use super::{Common, Draft, KindPlan, common, of_option, search};
use crate::Error;
use crate::data::{Log, Source};
use crate::estimate::Initial;
use crate::model::ProcessStructure;
use crate::plan::{FitOptions, Fitted, ModelWord};
use crate::report::{ProcessPlan, Report, fit_process, fit_process_to_response};
use crate::spectrum::MeasuredResponse;

/// A process of which the channels are open.
#[derive(Debug)]
pub(super) struct ProcessDraft {
    plan: ProcessPlan,
}

impl ProcessDraft {
    pub(super) fn new(options: &FitOptions, fitted: Fitted) -> Result<Self, Error> {
        let refused = |option: &str, message: &str| Err(Error::argument(option, message));
        let structures = match (&*options.structure, &*options.np) {
            ([], []) if options.model == Some(ModelWord::Tf) => {
                return refused("model", "tf needs `np`, the number of poles, such as 2");
            }
            ([], []) if options.model == Some(ModelWord::Process) => {
                return refused(
                    "model",
                    "process needs `structure`, such as p1d: a gain, a lag and a dead time",
                );
            }
            ([], []) => return refused("structure", "name one, such as p1d, or give `np`"),
            ([_, ..], [_, ..]) => {
                return refused("structure", "it does not go with `np`; leave one of the two out");
            }
            (_, []) if options.model == Some(ModelWord::Tf) => {
                return refused("structure", "it is of `model` process; leave one of the two out");
            }
            (_, []) => options.structure.clone(),
            _ if options.model == Some(ModelWord::Process) => {
                return refused("np", "it is of `model` tf; leave one of the two out");
            }
            _ => transfer_functions(options)?,
        };
        if options.np.is_empty() && (options.delay || !options.nz.is_empty()) {
            return refused(if options.delay { "delay" } else { "nz" }, "it goes with `np`; give that too");
        }
        if options.output.len() > 1 {
            return refused("output", "a process has one output; fit one after the other");
        }
        let free_start = match options.initial.unwrap_or_default() {
            Initial::Auto => {
                let of_log = fitted != Fitted::Response;
                (of_log && structures.iter().all(ProcessStructure::is_transfer_function)).then_some(true)
            }
            Initial::Zero => Some(false),
            Initial::Estimate => Some(true),
            Initial::Drop => {
                return refused(
                    "initial",
                    "drop is for models of past outputs; a process starts from zero, which is at rest, or estimate",
                );
            }
        };
        let Common { estimate, validate, split, offsets, .. } = common(options)?;
        Ok(Self {
            plan: ProcessPlan {
                inputs: options.inputs().unwrap_or_default(),
                output: String::new(),
                structures,
                estimate,
                validate,
                split,
                offsets,
                trend: options.trend,
                free_start,
                search: search::search(options)?,
            },
        })
    }
}

impl Draft for ProcessDraft {
    fn takes_any_clock(&self) -> bool {
        true
    }

    fn plan(&self, inputs: Vec<String>, mut outputs: Vec<String>) -> Result<Arc<dyn KindPlan>, Error> {
        let plan = ProcessPlan { inputs, output: outputs.pop().unwrap_or_default(), ..self.plan.clone() };
        plan.check()?;
        Ok(Arc::new(plan))
    }
}

impl KindPlan for ProcessPlan {
    fn fit(&self, log: Cow<'_, Log>, sources: &[Source], monitor: Monitor<'_>) -> Result<Report, Error> {
        fit_process(&log, sources, self, monitor)
    }

    fn fit_response(&self, response: &MeasuredResponse, monitor: Monitor<'_>) -> Result<Report, Error> {
        fit_process_to_response(response, self, monitor)
    }
}

/// One for each number of poles; one number of zeros is for all, none is one less than poles.
fn transfer_functions(options: &FitOptions) -> Result<Vec<ProcessStructure>, Error> {
    let (np, nz, delay) = (&options.np, &options.nz, options.delay);
    let (count, zeros) = (np.len().max(nz.len()), nz.len());
    if (np.len() != 1 && np.len() != count) || (zeros > 1 && zeros != count) {
        return Err(Error::argument(
            "nz",
            format!("{zeros} numbers beside {} of `np`; give one for all inputs or one for each", np.len()),
        ));
    }
    let of = |list: &[usize], input: usize| list.get(input).or(list.first()).copied();
    let each = (0..count).map(|input| {
        let poles = of(np, input).unwrap_or(0);
        let zeros = of(nz, input).unwrap_or(poles.saturating_sub(1));
        ProcessStructure::transfer_function(poles, zeros, delay).map_err(|error| of_option("np", error))
    });
    each.collect()
}
