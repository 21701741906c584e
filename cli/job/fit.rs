use std::path::{Path, PathBuf};

use thetahat::data::{Detrend, Prefilter, Rows, Split};
use thetahat::estimate::{Constant, Initial, Method};
use thetahat::report::Plan;
use thetahat::select::{Focus, Select};

use super::orders::OrderJob;
use super::{LogJob, method, parsed, rows};
use crate::args::{
    ConstantArgument, FitArguments, InitialArgument, LikelihoodArgument, MapArgument, ModelArguments, Names,
};
use crate::failure::Failure;
use crate::memory::PerValue;

/// A model to fit.
#[derive(Debug)]
pub(crate) struct FitJob {
    /// The logs, at least one.
    pub(crate) paths: Vec<PathBuf>,
    /// How all of them are read.
    pub(crate) log: LogJob,
    /// Named inputs; none: those called u, u1, u2, …
    pub(crate) inputs: Option<Vec<String>>,
    /// The named outputs, of a model one; none: y.
    pub(crate) outputs: Vec<String>,
    pub(crate) estimate: Vec<Rows>,
    pub(crate) validate: Vec<Rows>,
    pub(crate) split: Option<Split>,
    pub(crate) detrend: Detrend,
    pub(crate) offsets: Vec<(String, f64)>,
    pub(crate) prefilter: Option<Prefilter>,
    pub(crate) orders: OrderJob,
    pub(crate) select: Select,
    pub(crate) focus: Focus,
    pub(crate) method: Method,
    pub(crate) initial: Initial,
    pub(crate) constant: Constant,
    /// Whether a norm was given.
    pub(crate) uses_outliers: bool,
    pub(crate) trend: bool,
}

impl FitJob {
    pub(crate) fn resolve(arguments: &FitArguments) -> Result<Self, Failure> {
        let orders = OrderJob::resolve(&arguments.model, arguments.choice.path)?
            .linear(arguments.narx.narx == Some(MapArgument::None));
        let mut job = Self {
            paths: arguments.logs.clone(),
            log: LogJob::resolve(&arguments.log, &arguments.clock)?,
            inputs: Names::all(&arguments.input),
            outputs: Names::all(&arguments.output).unwrap_or_default(),
            estimate: rows("--estimate", &arguments.estimate)?,
            validate: rows("--validate", &arguments.validate)?,
            detrend: parsed("--detrend", &arguments.detrend)?,
            offsets: named_values("--offset", &arguments.offset)?,
            prefilter: arguments.prefilter.as_deref().map(|text| parsed("--prefilter", text)).transpose()?,
            split: arguments.choice.split.as_deref().map(|text| parsed("--split", text)).transpose()?,
            select: select(arguments.choice.select, &orders)?,
            focus: parsed("--focus", &arguments.model.focus)?,
            method: method::method(arguments, &orders)?,
            initial: initial(&arguments.model, &orders)?,
            constant: match arguments.model.constant {
                ConstantArgument::Auto => Constant::Auto,
                ConstantArgument::Yes => Constant::Yes,
                ConstantArgument::No => Constant::No,
            },
            trend: arguments.model.trend,
            uses_outliers: arguments.criterion.norm.is_some(),
            orders,
        };
        if !job.orders.is_linear() || job.orders.is_choice() || !job.is_plain() || arguments.html.is_some() {
            job.log.per_value = PerValue::Search;
        }
        let validates = !job.validate.is_empty() || job.split.is_some_and(|split| split.validates());
        if job.select == Select::Validation && !validates {
            return Err(Failure::usage(
                "--select validation needs rows for it: give --split 60/20/20, or --estimate and --validate",
            ));
        }
        if job.trend && job.constant == Constant::No {
            return Err(Failure::usage(
                "--trend is a line with a level, which is the constant; leave it or --constant no out",
            ));
        }
        if job.paths.iter().filter(|path| *path == Path::new("-")).count() > 1 {
            return Err(Failure::usage("only one of the logs can come from standard input (-)"));
        }
        if let Some(inputs) = &job.inputs {
            if !job.orders.has_inputs() {
                return Err(Failure::usage(
                    "the orders make a model without inputs; leave out --input, or give an --nb above 0",
                ));
            }
            job.orders.of(inputs.len())?;
        }
        Ok(job)
    }

    /// Whether there is one output, as every model of polynomials has.
    pub(crate) fn check_output(&self) -> Result<(), Failure> {
        if self.outputs.len() < 2 {
            return Ok(());
        }
        Err(Failure::usage(
            "--output: a polynomial model with C, D or F has one output; fit one after the other, or all at once with --model arx, --model ss, --narx or --grey",
        ))
    }

    /// Whether squares are made small and nothing else is asked.
    fn is_plain(&self) -> bool {
        matches!(self.method, Method::PredictionError(_))
    }

    /// The same for the channels of a log.
    pub(crate) fn plan(&self, inputs: Vec<String>, output: String) -> Result<Plan, Failure> {
        Ok(Plan {
            choice: self.orders.of(inputs.len())?,
            select: self.select,
            focus: self.focus,
            inputs,
            output,
            estimate: self.estimate.clone(),
            validate: self.validate.clone(),
            split: self.split,
            detrend: self.detrend,
            offsets: self.offsets.clone(),
            prefilter: self.prefilter,
            method: self.method.clone(),
            initial: self.initial,
            constant: self.constant,
            trend: self.trend,
            uses_outliers: self.uses_outliers,
        })
    }
}

/// Numbers set by hand, one for a channel.
pub(super) fn named_values(option: &str, texts: &[String]) -> Result<Vec<(String, f64)>, Failure> {
    let mut values: Vec<(String, f64)> = Vec::new();
    for text in texts {
        let (name, value) = text
            .rsplit_once('=')
            .and_then(|(name, value)| Some((name.to_owned(), value.trim().parse::<f64>().ok()?)))
            .filter(|(_, value)| value.is_finite())
            .ok_or_else(|| {
                Failure::usage(format!("{option} {text}: write it as NAME=VALUE, such as u=4.5"))
            })?;
        if values.iter().any(|(other, _)| *other == name) {
            return Err(Failure::usage(format!("{option}: '{name}' has two; give one")));
        }
        values.push((name, value));
    }
    Ok(values)
}

fn select(argument: Option<Select>, orders: &OrderJob) -> Result<Select, Failure> {
    if argument.is_some() && !orders.is_choice() {
        return Err(Failure::usage(
            "--select chooses among several models, and the orders say one; give ranges such as --na 1..10, or no orders",
        ));
    }
    Ok(argument.unwrap_or_default())
}

fn initial(arguments: &ModelArguments, orders: &OrderJob) -> Result<Initial, Failure> {
    let exact = arguments.likelihood == LikelihoodArgument::Exact;
    Ok(match arguments.initial {
        InitialArgument::Drop if exact => {
            return Err(Failure::usage(
                "--initial drop leaves samples out, and --likelihood exact is that of all of them; use auto, zero or estimate",
            ));
        }
        InitialArgument::Estimate if exact && !orders.has_inputs() => {
            return Err(Failure::usage(
                "--initial estimate finds what inputs did before the first row, and this model has none; leave it out",
            ));
        }
        InitialArgument::Estimate if exact => Initial::Estimate,
        InitialArgument::Drop if orders.is_filtered() => {
            return Err(Failure::usage(
                "--initial drop is for models without F, whose errors depend on few samples; use zero, estimate or auto",
            ));
        }
        InitialArgument::Estimate if orders.is_never_filtered() => {
            return Err(Failure::usage(
                "--initial estimate is for models with F: without it, unknown samples reach no further than a few errors, which \
                 drop leaves out; use drop, zero or auto",
            ));
        }
        InitialArgument::Auto => Initial::Auto,
        InitialArgument::Drop => Initial::Drop,
        InitialArgument::Zero => Initial::Zero,
        InitialArgument::Estimate => Initial::Estimate,
    })
}
