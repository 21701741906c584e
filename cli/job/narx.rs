use std::path::{Path, PathBuf};

use thetahat::model::{Activation, Membership};
use thetahat::optimize::Search;
use thetahat::report::{Centres, InputLags, MapPlan, NonlinearArxPlan};
use thetahat::respond::Horizon;
use thetahat::select::Focus;

use super::fit::named_values;
use super::{LogJob, parsed, rows, search};
use crate::args::{FitArguments, MapArgument, MembershipArgument, Names, NarxArguments, SearchArguments};
use crate::failure::Failure;
use crate::memory::PerValue;

/// Bends of each regressor. Natural splines seldom need more than five knots (Stone, Statistical Science 1, 1986);
/// these have seven, of which a choice leaves out what is not needed.
const BENDS: usize = 5;

/// A nonlinear ARX model to fit.
#[derive(Debug)]
pub(crate) struct NarxJob {
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
    ny: Vec<usize>,
    nu: Vec<usize>,
    nk: Vec<usize>,
    /// The rest of the plan: channels and the lags of inputs are open.
    plan: NonlinearArxPlan,
}

impl NarxJob {
    pub(crate) fn resolve(arguments: &FitArguments, map: MapArgument) -> Result<Self, Failure> {
        let own = &arguments.narx;
        let default = NonlinearArxPlan::new(&[], &[]);
        let plan = NonlinearArxPlan {
            estimate: rows("--estimate", &arguments.estimate)?,
            validate: rows("--validate", &arguments.validate)?,
            split: arguments.choice.split.as_deref().map(|text| parsed("--split", text)).transpose()?,
            detrend: parsed("--detrend", &arguments.detrend)?,
            offsets: named_values("--offset", &arguments.offset)?,
            expressions: own.regressor.clone(),
            lags_chosen: map == MapArgument::Auto
                && own.ny.is_empty()
                && own.nu.is_empty()
                && arguments.model.nk.is_empty(),
            map: map_plan(own, map, arguments.search.seed)?,
            terms: own.terms,
            most: own.most_terms,
            select: arguments.choice.select,
            ridge: arguments.criterion.ridge,
            focus: focus(&arguments.model.focus)?,
            search: searched(&arguments.search, map, own, default.search.clone())?,
            raw_terms: own.raw_terms,
            ..default
        };
        let nk = arguments.model.nk.iter().map(|text| {
            text.trim().parse().map_err(|_| {
                Failure::usage(format!(
                    "--nk {text}: a nonlinear ARX model takes one delay for each input, such as --nk 1"
                ))
            })
        });
        let job = Self {
            paths: arguments.logs.clone(),
            log: LogJob { per_value: PerValue::Search, ..LogJob::resolve(&arguments.log, &arguments.clock)? },
            inputs: Names::all(&arguments.input),
            outputs: Names::all(&arguments.output).unwrap_or_default(),
            driven: own.nu.is_empty() || own.nu.iter().any(|lags| *lags > 0),
            ny: own.ny.clone(),
            nu: own.nu.clone(),
            nk: nk.collect::<Result<_, Failure>>()?,
            plan,
        };
        if job.paths.iter().filter(|path| *path == Path::new("-")).count() > 1 {
            return Err(Failure::usage("only one of the logs can come from standard input (-)"));
        }
        if !job.driven && job.inputs.is_some() {
            return Err(Failure::usage(
                "--nu 0 makes a model without inputs; leave out --input, or give another --nu",
            ));
        }
        Ok(job)
    }

    /// The plan for the channels of a log.
    pub(crate) fn plan(
        &self,
        inputs: Vec<String>,
        outputs: Vec<String>,
    ) -> Result<NonlinearArxPlan, Failure> {
        let each = |option: &str, values: &[usize], default: usize, count: usize, of: &str| match values {
            [] => Ok(vec![default; count]),
            [one] => Ok(vec![*one; count]),
            several if several.len() == count => Ok(several.to_vec()),
            several => Err(Failure::usage(format!(
                "{option} has {} numbers for {count} {of}; give one for all or one for each",
                several.len()
            ))),
        };
        let nu = each("--nu", &self.nu, 2, inputs.len(), "inputs")?;
        let nk = each("--nk", &self.nk, 1, inputs.len(), "inputs")?;
        let output_lags = each("--ny", &self.ny, 2, outputs.len(), "outputs")?;
        let input_lags = nu.into_iter().zip(nk).map(|(lags, delay)| InputLags { lags, delay }).collect();
        let plan = NonlinearArxPlan { inputs, outputs, output_lags, input_lags, ..self.plan.clone() };
        plan.check().map_err(|error| Failure::option(&error))?;
        Ok(plan)
    }
}

/// What is for nonlinear models alone, given for another one: where one option excludes --narx, the parser asks for it
/// no longer.
pub(crate) fn check_linear(arguments: &NarxArguments) -> Result<(), Failure> {
    let given = [
        ("--ny", !arguments.ny.is_empty()),
        ("--nu", !arguments.nu.is_empty()),
        ("--regressor", !arguments.regressor.is_empty()),
        ("--degree", arguments.degree.is_some()),
        ("--terms", arguments.terms.is_some()),
        ("--term", !arguments.term.is_empty()),
        ("--most-terms", arguments.most_terms.is_some()),
        ("--centres", arguments.centres.is_some()),
        ("--width", arguments.width.is_some()),
        ("--no-linear", arguments.no_linear),
        ("--membership", arguments.membership.is_some()),
        ("--units", arguments.units.is_some()),
        ("--drawn", arguments.drawn),
        ("--raw-terms", arguments.raw_terms),
    ];
    match given.iter().find(|(_, given)| *given) {
        Some((option, _)) if MapArgument::asked(arguments.narx).is_none() => {
            Err(Failure::usage(format!("{option} is for --narx; leave it out, or give --narx")))
        }
        _ => Ok(()),
    }
}

fn map_plan(arguments: &NarxArguments, map: MapArgument, seed: Option<u64>) -> Result<MapPlan, Failure> {
    use MapArgument::{Auto, Knn, Local, Logistic, Poly, Rbf, RbfFree, Relu, Spline, Step, Tanh};
    let own: [(&str, bool, &[MapArgument]); 10] = [
        ("--degree", arguments.degree.is_some(), &[Poly]),
        ("--centres", arguments.centres.is_some(), &[Rbf]),
        ("--width", arguments.width.is_some(), &[Rbf]),
        ("--no-linear", arguments.no_linear, &[Rbf, Local, Knn]),
        ("--membership", arguments.membership.is_some(), &[Local]),
        ("--terms", arguments.terms.is_some(), &[Poly, Rbf, Spline, Tanh, Logistic, Relu, Step]),
        ("--term", !arguments.term.is_empty(), &[Poly]),
        ("--seed", seed.is_some(), &[Rbf, Tanh, Logistic, Relu, Step, RbfFree, Auto]),
        ("--units", arguments.units.is_some(), &[Spline, Local, Knn, Tanh, Logistic, Relu, Step, RbfFree]),
        ("--drawn", arguments.drawn, &[Tanh, Logistic, Relu]),
    ];
    if let Some((option, _, maps)) = own.iter().find(|(_, given, maps)| *given && !maps.contains(&map)) {
        let names: Vec<String> = maps.iter().map(|map| format!("--narx {}", map.word())).collect();
        let names = match names.split_last() {
            Some((last, others)) if !others.is_empty() => format!("{} and {last}", others.join(", ")),
            _ => names.concat(),
        };
        return Err(Failure::usage(format!("{option} is for {names}")));
    }
    match map {
        Poly if !arguments.term.is_empty() => Ok(MapPlan::Products { terms: arguments.term.clone() }),
        Poly => Ok(MapPlan::Polynomial { degree: arguments.degree.unwrap_or(2) }),
        Rbf => {
            let text = arguments.centres.as_deref().unwrap_or("chosen");
            if seed.is_some() && !text.starts_with("kmeans") && !text.starts_with("random") {
                return Err(Failure::usage("--seed is for --centres kmeans:N and random:N"));
            }
            Ok(MapPlan::Radial {
                centres: centres(text, seed.unwrap_or(0))?,
                width: arguments.width,
                linear: !arguments.no_linear,
            })
        }
        Spline => Ok(MapPlan::Spline { units: arguments.units.unwrap_or(BENDS) }),
        Local => {
            let membership = match arguments.membership {
                Some(MembershipArgument::Rectangle) => Membership::Rectangle,
                Some(MembershipArgument::Trapezoid) => Membership::Trapezoid,
                Some(MembershipArgument::Gaussian) | None => Membership::Gaussian,
            };
            Ok(MapPlan::Local { membership, planes: !arguments.no_linear, units: arguments.units })
        }
        Knn => Ok(MapPlan::Neighbours { planes: !arguments.no_linear, units: arguments.units }),
        Tanh => Ok(network(Activation::Tanh, arguments)),
        Logistic => Ok(network(Activation::Logistic, arguments)),
        Relu => Ok(network(Activation::Relu, arguments)),
        Step => Ok(MapPlan::Network { activation: Activation::Step, units: arguments.units, drawn: true }),
        RbfFree => Ok(MapPlan::FreeRadial { units: arguments.units }),
        Auto => Ok(MapPlan::Auto),
        MapArgument::None => Err(Failure::usage("--narx none fits no nonlinear model; name the functions")),
    }
}

fn network(activation: Activation, arguments: &NarxArguments) -> MapPlan {
    MapPlan::Network { activation, units: arguments.units, drawn: arguments.drawn }
}

/// How far ahead errors are made small, if that is said.
fn focus(text: &str) -> Result<Option<Horizon>, Failure> {
    Ok(match parsed::<Focus>("--focus", text)? {
        Focus::Auto => None,
        focus => Some(focus.horizon()),
    })
}

/// How to search, where a map is trained, or its parameters for longer runs.
fn searched(
    arguments: &SearchArguments,
    map: MapArgument,
    own: &NarxArguments,
    default: Search,
) -> Result<Search, Failure> {
    use MapArgument::{Auto, Logistic, RbfFree, Relu, Tanh};
    let trained = matches!(map, Tanh | Logistic | Relu | RbfFree | Auto) && !own.drawn;
    if arguments.starts.is_some() && !trained {
        return Err(Failure::usage(
            "--starts is for maps that are trained: --narx tanh, logistic, relu, rbf-free and auto",
        ));
    }
    let found = search::seeded(arguments)?;
    Ok(Search {
        starts: arguments.starts.map_or(default.starts, |_| found.starts),
        max_iterations: arguments.max_iterations.map_or(default.max_iterations, |_| found.max_iterations),
        ..found
    })
}

fn centres(text: &str, seed: u64) -> Result<Centres, Failure> {
    let (word, count) = text.split_once(':').unwrap_or((text, ""));
    match (word, count.parse()) {
        ("chosen", _) if count.is_empty() => Ok(Centres::Chosen),
        ("kmeans", Ok(count)) => Ok(Centres::Clusters { count, seed }),
        ("grid", Ok(each)) => Ok(Centres::Grid { each }),
        ("random", Ok(count)) => Ok(Centres::Random { count, seed }),
        _ => Err(Failure::usage(format!(
            "--centres {text}: write it as chosen, kmeans:N, grid:N or random:N, such as kmeans:20"
        ))),
    }
}
