use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use thetahat::estimate::{Constant, SubspaceOptions, VectorArxInputs, VectorArxOptions};
use thetahat::report::StateSpacePlan;

use super::fit::named_values;
use super::{LogJob, parsed, rows, search};
use crate::args::{
    ConstantArgument, FeedthroughArgument, FitArguments, InitialArgument, LikelihoodArgument, MethodArgument,
    ModelArgument, Names,
};
use crate::failure::Failure;
use crate::memory::PerValue;

/// The orders of an ARX model that are looked at where none are given.
const CHOSEN_LAGS: RangeInclusive<usize> = 1..=8;
/// More lags than anybody has.
const MOST_LAGS: usize = 200;

/// A state-space model to fit.
#[derive(Debug)]
pub(crate) struct StateSpaceJob {
    /// The logs, at least one.
    pub(crate) paths: Vec<PathBuf>,
    /// How all of them are read.
    pub(crate) log: LogJob,
    /// Named inputs; none: those called u, u1, u2, …
    pub(crate) inputs: Option<Vec<String>>,
    /// The named outputs; none: y.
    pub(crate) outputs: Vec<String>,
    /// Whether there are inputs at all.
    pub(crate) driven: bool,
    /// Samples that inputs wait: none, one for all or one for each.
    delays: Vec<RangeInclusive<usize>>,
    /// The rest of the plan: channels are open.
    plan: StateSpacePlan,
}

impl StateSpaceJob {
    /// The job, if a model in state space is asked for, or several outputs and no other model than ARX. A log that is
    /// there already may have several outputs without their names.
    pub(crate) fn resolve(arguments: &FitArguments, has_several: bool) -> Result<Option<Self>, Failure> {
        let (own, model) = (&arguments.states, &arguments.model);
        let outputs = Names::all(&arguments.output).unwrap_or_default();
        let given = [
            ("--order", own.order.is_some()),
            ("--past", own.past.is_some()),
            ("--future", own.future.is_some()),
            ("--weighting", own.weighting.is_some()),
            ("--feedthrough", own.feedthrough.is_some()),
            ("--refine", own.refine.is_some()),
        ];
        let given = given.iter().find(|(_, given)| *given).map(|(option, _)| option);
        // A model without inputs is asked for as of all structures.
        let without_inputs = matches!(&*model.nb, [nb] if nb.trim() == "0");
        let coefficients = [&model.na, &model.nc, &model.nd].into_iter().any(Option::is_some);
        let orders = coefficients || !model.nf.is_empty() || (!model.nb.is_empty() && !without_inputs);
        let noise = model.nc.is_some() || model.nd.is_some() || !model.nf.is_empty();
        let has_several = has_several || outputs.len() > 1;
        let is_arx = has_several
            && match model.model {
                Some(ModelArgument::Arx) => true,
                None => orders && !noise,
                _ => false,
            };
        if !is_arx && model.couple.is_some() {
            return Err(Failure::usage(
                "--couple is for ARX models with several outputs: --model arx and --output y1,y2; leave it out",
            ));
        }
        match model.model {
            Some(ModelArgument::Ss) => {}
            None if !orders && has_several => {}
            _ if is_arx => {
                if let Some(option) = given {
                    return Err(Failure::usage(format!(
                        "{option} is for --model ss, and not for ARX models with several outputs; leave it out"
                    )));
                }
            }
            _ => match given {
                Some(option) => {
                    return Err(Failure::usage(format!(
                        "{option} is for --model ss; leave it out, or give --model ss"
                    )));
                }
                None => return Ok(None),
            },
        }
        refuse_others(arguments, is_arx)?;
        let inputs = Names::all(&arguments.input);
        if without_inputs && inputs.is_some() {
            return Err(Failure::usage("--nb 0 makes a model without inputs; leave out --input or --nb"));
        }
        if arguments.logs.iter().filter(|path| *path == Path::new("-")).count() > 1 {
            return Err(Failure::usage("only one of the logs can come from standard input (-)"));
        }
        let plan = StateSpacePlan {
            estimate: rows("--estimate", &arguments.estimate)?,
            validate: rows("--validate", &arguments.validate)?,
            split: arguments.choice.split.as_deref().map(|text| parsed("--split", text)).transpose()?,
            detrend: parsed("--detrend", &arguments.detrend)?,
            offsets: named_values("--offset", &arguments.offset)?,
            orders: own.order.as_deref().map(range).transpose()?,
            subspace: SubspaceOptions {
                weighting: own
                    .weighting
                    .as_deref()
                    .map(|text| parsed("--weighting", text))
                    .transpose()?
                    .unwrap_or_default(),
                past: own.past.map(|past| past as usize),
                future: own.future.map(|future| future as usize),
                feedthrough: match own.feedthrough.unwrap_or(FeedthroughArgument::Auto) {
                    FeedthroughArgument::Auto => None,
                    FeedthroughArgument::Yes => Some(true),
                    FeedthroughArgument::No => Some(false),
                },
                constant: false,
            },
            constant: match model.constant {
                ConstantArgument::Auto => Constant::Auto,
                ConstantArgument::Yes => Constant::Yes,
                ConstantArgument::No => Constant::No,
            },
            refine: own.refine.as_deref().map(|text| parsed("--refine", text)).transpose()?,
            search: search::search(&arguments.search)?,
            arx: if is_arx { Some(arx(arguments, without_inputs)?) } else { None },
            ..StateSpacePlan::new(&[], &[])
        };
        let delay = |text: &String| {
            lags("--nk", text).and_then(|found| match (is_arx && model.nk.len() == 1, found.start() == found.end()) {
                (false, false) => Err(Failure::usage(format!(
                    "--nk {text}: a range is for all inputs of an ARX model; give a number for each input, such as --nk 3"
                ))),
                _ => Ok(found),
            })
        };
        Ok(Some(Self {
            paths: arguments.logs.clone(),
            log: LogJob { per_value: PerValue::Search, ..LogJob::resolve(&arguments.log, &arguments.clock)? },
            inputs,
            outputs,
            driven: !without_inputs,
            delays: model.nk.iter().map(delay).collect::<Result<_, Failure>>()?,
            plan,
        }))
    }

    /// The plan for the channels of a log. Without feedthrough an input acts one sample later by itself.
    pub(crate) fn plan(&self, inputs: Vec<String>, outputs: Vec<String>) -> Result<StateSpacePlan, Failure> {
        let count = inputs.len();
        let delays = match &*self.delays {
            [] => Vec::new(),
            [all] => vec![*all.start(); count],
            several if several.len() == count => several.iter().map(|delay| *delay.start()).collect(),
            several => {
                return Err(Failure::usage(format!(
                    "--nk has {} numbers for {count} inputs; give one for all or one for each",
                    several.len()
                )));
            }
        };
        let mut plan = StateSpacePlan { inputs, outputs, ..self.plan.clone() };
        if let Some(arx) = &mut plan.arx {
            if let VectorArxInputs::Each(nb) = &arx.nb
                && nb.len() != count
            {
                return Err(Failure::usage(format!(
                    "--nb has {} numbers for {count} inputs; give one for all or one for each",
                    nb.len()
                )));
            }
            arx.delay = self.delays.first().map_or(0..=0, |delays| 0..=delays.end() - delays.start());
            arx.direct = delays.contains(&0);
            plan.delays = delays.iter().map(|delay| delay - usize::from(!arx.direct)).collect();
        } else if !delays.is_empty() {
            // u(t - nk) acts on y(t): through D if some input acts at once, else through G.
            let at_once = delays.contains(&0) || plan.subspace.feedthrough == Some(true);
            if delays.contains(&0) && plan.subspace.feedthrough == Some(false) {
                return Err(Failure::usage(
                    "--nk 0 says that an input acts at once, and --feedthrough no that none does; leave one out",
                ));
            }
            plan.subspace.feedthrough = Some(at_once);
            plan.delays = delays.iter().map(|delay| delay - usize::from(!at_once)).collect();
        }
        plan.check().map_err(|error| Failure::option(&error))?;
        Ok(plan)
    }
}

/// Among which ARX models with several outputs the data choose.
fn arx(arguments: &FitArguments, without_inputs: bool) -> Result<VectorArxOptions, Failure> {
    let model = &arguments.model;
    let nb = model.nb.iter().map(|text| lags("--nb", text)).collect::<Result<Vec<_>, Failure>>()?;
    let each =
        || nb.iter().map(|nb| (nb.start() == nb.end()).then_some(*nb.start())).collect::<Option<Vec<_>>>();
    let nb = match &*nb {
        _ if without_inputs => VectorArxInputs::Alike(0..=0),
        [] => VectorArxInputs::Alike(CHOSEN_LAGS),
        [one] => VectorArxInputs::Alike(one.clone()),
        _ => VectorArxInputs::Each(each().ok_or_else(|| {
            Failure::usage("--nb: with several outputs give one range for all inputs, or a number for each")
        })?),
    };
    Ok(VectorArxOptions {
        na: model.na.as_ref().map_or(Ok(CHOSEN_LAGS), |text| lags("--na", text))?,
        nb,
        coupling: match model.couple.as_deref() {
            None | Some("auto") => None,
            Some(text) => Some(parsed("--couple", text)?),
        },
        delay: 0..=0,
        direct: false,
        constant: false,
    })
}

/// A number of lags, or a range of them.
fn lags(option: &str, text: &str) -> Result<RangeInclusive<usize>, Failure> {
    let number = |text: &str| text.trim().parse::<usize>().ok();
    let found = match text.split_once("..") {
        Some((first, last)) => number(first).zip(number(last)).filter(|(_, last)| *last <= MOST_LAGS),
        // A delay is no regressor.
        None => number(text).filter(|own| *own <= MOST_LAGS || option == "--nk").map(|own| (own, own)),
    };
    found.filter(|(first, last)| first <= last).map(|(first, last)| first..=last).ok_or_else(|| {
        Failure::usage(format!(
            "{option} {text}: write it as N or A..B, {MOST_LAGS} at most, such as 2 or 1..8"
        ))
    })
}

/// What other models have.
fn refuse_others(arguments: &FitArguments, is_arx: bool) -> Result<(), Failure> {
    let (model, search, criterion) = (&arguments.model, &arguments.search, &arguments.criterion);
    let searches = arguments.states.refine.is_some();
    match search::given(search) {
        Some(option) if !searches => {
            return Err(Failure::usage(format!("--refine is needed with {option}, which is for a search")));
        }
        Some(option @ ("--starts" | "--seed")) => {
            return Err(Failure::usage(format!(
                "{option} is not for models in state space, whose starts are subspace methods; leave it out"
            )));
        }
        _ => {}
    }
    let given = [
        ("--na", !is_arx && model.na.is_some()),
        ("--nb", !is_arx && !matches!(&*model.nb, []) && !matches!(&*model.nb, [nb] if nb.trim() == "0")),
        ("--nc", model.nc.is_some()),
        ("--nd", model.nd.is_some()),
        ("--nf", !model.nf.is_empty()),
        ("--taps", !model.taps.is_empty()),
        ("--kernel", model.kernel.is_some()),
        ("--structure", !model.structure.is_empty()),
        ("--np", !model.np.is_empty()),
        ("--method", model.method != MethodArgument::Pem),
        ("--likelihood", model.likelihood != LikelihoodArgument::Conditional),
        ("--initial", !matches!(model.initial, InitialArgument::Auto | InitialArgument::Estimate)),
        ("--focus", model.focus != "auto" && model.focus != "prediction"),
        ("--trend", model.trend),
        ("--prefilter", arguments.prefilter.is_some()),
        ("--path", arguments.choice.path.is_some()),
        ("--select", arguments.choice.select.is_some()),
        ("--norm", criterion.norm.is_some()),
        ("--bound", !criterion.bound.is_empty()),
        ("--dc-gain", !criterion.dc_gain.is_empty()),
        ("--ridge", criterion.ridge.is_some()),
        ("--noise-bound", criterion.noise_bound.is_some()),
    ];
    match given.iter().find(|(_, given)| *given) {
        Some((option, _)) => Err(Failure::usage(format!(
            "{option} is not for models in state space and of several outputs; leave it out"
        ))),
        None => Ok(()),
    }
}

/// N, or A..B.
fn range(text: &str) -> Result<RangeInclusive<usize>, Failure> {
    let number = |text: &str| text.trim().parse::<usize>().ok();
    let found = match text.split_once("..") {
        Some((first, last)) => number(first).zip(number(last)),
        None => number(text).map(|order| (order, order)),
    };
    found.filter(|(first, last)| *first > 0 && first <= last).map(|(first, last)| first..=last).ok_or_else(
        || Failure::usage(format!("--order {text}: write it as N or A..B, from 1 on, such as 4 or 1..10")),
    )
}
