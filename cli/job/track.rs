use std::path::{Path, PathBuf};

use thetahat::estimate::Coupling;
use thetahat::model::{Map, Model, Orders, Signal};
use thetahat::report::Report;
use thetahat::track::{PerChannel, Policy, TrackMethod, TrackPlan, Tracker};

use super::{LineJob, LogJob, parsed};
use crate::args::{Names, ResumeArgument, TrackArguments, TrackMethodArgument, TrackModelArgument};
use crate::failure::Failure;

/// A model to track.
#[derive(Debug)]
pub(crate) struct TrackJob {
    pub(crate) path: PathBuf,
    pub(crate) log: LogJob,
    /// Seconds from one row to the next, if that is given.
    pub(crate) sample_time: Option<f64>,
    /// Named inputs; none: those of the report, or those called u, u1, u2, …
    pub(crate) inputs: Option<Vec<String>>,
    /// Named outputs; none: that of the report, or y.
    pub(crate) outputs: Option<Vec<String>>,
    pub(crate) warm: Option<PathBuf>,
    pub(crate) lines: LineJob,
    /// How many rows ahead a forecast is, if it was asked for.
    pub(crate) horizon: Option<usize>,
    pub(crate) stop_on_alarm: bool,
    pub(crate) state: Option<StateJob>,
    pub(crate) summary: Option<PathBuf>,
    offsets: Vec<(String, f64)>,
    scales: Vec<(String, f64)>,
    orders: Given,
    /// Which past outputs each of several depends on.
    coupling: Option<Coupling>,
    /// The degree of the products of lags, of a nonlinear model.
    degree: Option<usize>,
    method: Option<TrackMethod>,
    policies: Vec<Policy>,
    plan: TrackPlan,
}

/// Where the state is kept.
#[derive(Debug)]
pub(crate) struct StateJob {
    pub(crate) path: PathBuf,
    pub(crate) save_every: u64,
    pub(crate) resume: ResumeArgument,
}

/// What trackers start from.
enum Source<'r> {
    Report(&'r Report),
    /// These orders; and of lags of these orders functions, if the model is nonlinear.
    Nothing(Orders, Option<Map>),
}

/// Orders as far as they were given.
#[derive(Debug)]
struct Given {
    model: Option<TrackModelArgument>,
    na: Option<usize>,
    nb: Vec<usize>,
    nc: Option<usize>,
    nk: Vec<usize>,
}

impl TrackJob {
    pub(crate) fn resolve(arguments: &TrackArguments) -> Result<Self, Failure> {
        let (log, sample_time) = LogJob::live(&arguments.log, &arguments.clock)?;
        let policies: Vec<Policy> =
            arguments.forgetting.iter().map(|text| parsed("--forgetting", text)).collect::<Result<_, _>>()?;
        if let Some(twice) = policies.iter().enumerate().find(|(index, one)| policies[..*index].contains(one))
        {
            return Err(Failure::usage(format!("--forgetting: {} is there twice; give it once", twice.1)));
        }
        let plan = TrackPlan {
            start: arguments
                .start
                .as_deref()
                .map(|text| parsed("--start", text))
                .transpose()?
                .unwrap_or_default(),
            dead_zone: arguments.dead_zone.unwrap_or(0.0),
            outliers: arguments
                .outliers
                .as_deref()
                .map(|text| parsed("--outliers", text))
                .transpose()?
                .unwrap_or_default(),
            constant: arguments.constant,
            alarm_interval: arguments.alarm,
            ..TrackPlan::default()
        };
        let lags = [
            ("--ny", arguments.ny.is_some()),
            ("--nu", !arguments.nu.is_empty()),
            ("--degree", arguments.degree.is_some()),
        ];
        if let (None, Some((option, _))) = (arguments.narx, lags.iter().find(|(_, given)| *given)) {
            return Err(Failure::usage(format!("{option} is for --narx; leave it out, or give --narx")));
        }
        let orders = match arguments.narx {
            None => Given {
                model: arguments.model,
                na: arguments.na,
                nb: arguments.nb.clone(),
                nc: arguments.nc,
                nk: arguments.nk.clone(),
            },
            Some(_) => Given {
                model: None,
                na: Some(arguments.ny.unwrap_or(2)),
                nb: if arguments.nu.is_empty() { vec![2] } else { arguments.nu.clone() },
                nc: None,
                nk: arguments.nk.clone(),
            },
        };
        if arguments.warm.is_none() {
            orders.check()?;
        }
        if arguments.warm.as_deref() == Some(Path::new("-")) && arguments.path == Path::new("-") {
            return Err(Failure::usage(
                "only one of the report and the log can come from standard input (-)",
            ));
        }
        if arguments.state.as_deref() == Some(Path::new("-")) {
            return Err(Failure::usage("--state -: a state is kept in a file; name one"));
        }
        Ok(Self {
            path: arguments.path.clone(),
            log,
            sample_time,
            inputs: Names::all(&arguments.input),
            outputs: Names::all(&arguments.output),
            warm: arguments.warm.clone(),
            lines: LineJob::resolve(&arguments.lines),
            horizon: arguments.horizon.map(|rows| rows as usize),
            stop_on_alarm: arguments.stop_on_alarm,
            state: arguments.state.as_ref().map(|path| StateJob {
                path: path.clone(),
                save_every: arguments.save_every,
                resume: arguments.resume,
            }),
            summary: arguments.lines.summary.clone(),
            offsets: named_values("--offset", &arguments.offset)?,
            scales: named_values("--scale", &arguments.scale)?,
            orders,
            coupling: arguments.couple.as_deref().map(coupling).transpose()?,
            degree: arguments.narx.map(|_| arguments.degree.unwrap_or(2)),
            method: arguments.method.map(|method| match method {
                TrackMethodArgument::Rls => TrackMethod::Rls,
                TrackMethodArgument::Els => TrackMethod::Els,
                TrackMethodArgument::Rpem => TrackMethod::Rpem,
            }),
            policies,
            plan,
        })
    }

    /// Whether the model has inputs, as far as the options say.
    pub(crate) fn has_inputs(&self) -> bool {
        self.orders.nb.iter().any(|&nb| nb > 0)
    }

    /// Whether alarms were asked for.
    pub(crate) fn is_watched(&self) -> bool {
        self.plan.alarm_interval.is_some()
    }

    /// Trackers for each policy: one for each output.
    pub(crate) fn trackers(
        &self,
        inputs: &[String],
        outputs: &[String],
        report: Option<&Report>,
    ) -> Result<Vec<Tracker>, Failure> {
        let model = report.map(|report| &report.model);
        self.check_outputs(outputs, model)?;
        let source = match report {
            Some(report) => Source::Report(report),
            None => {
                let orders = self.orders.of(inputs.len())?;
                let map = self.degree.map(|degree| Map::polynomial(orders.parameters(), degree)).transpose();
                Source::Nothing(orders, map.map_err(|error| Failure::option(&error))?)
            }
        };
        let noise = match &source {
            Source::Nothing(orders, _) => orders.nc,
            Source::Report(report) => report.model.as_polynomial().map_or(0, |model| model.orders.nc),
        };
        let method = match self.method {
            Some(method) => method,
            None if noise > 0 => TrackMethod::Rpem,
            None => TrackMethod::Rls,
        };
        let known = |name: &String| inputs.contains(name) || outputs.contains(name);
        for (option, values) in [("--offset", &self.offsets), ("--scale", &self.scales)] {
            if let Some((name, _)) = values.iter().find(|(name, _)| !known(name)) {
                return Err(Failure::usage(format!("{option}: '{name}' is no channel of the model")));
            }
        }
        let value = |values: &[(String, f64)], name: &str| {
            values.iter().find(|(other, _)| other == name).map(|(_, value)| *value)
        };
        // What each of several equations has of the outputs, as inputs in front of the others.
        let coupling = report.map_or(self.coupling, coupling_of);
        let coupled = if outputs.len() > 1 && coupling != Some(Coupling::None) { outputs } else { &[] };
        let offsets = |output: usize| {
            let level = |name: &str, stored: Option<&Signal>| {
                let stored = stored.map_or(0.0, |signal| signal.offset.level);
                value(&self.offsets, name).unwrap_or(stored)
            };
            let of_input = |index: usize| model.and_then(|model| model.inputs().get(index));
            let of_output = |index: usize| model.and_then(|model| model.outputs().get(index));
            let inputs = inputs.iter().enumerate().map(|(index, name)| level(name, of_input(index)));
            let past = coupled.iter().enumerate().map(|(index, name)| level(name, of_output(index)));
            (!self.offsets.is_empty()).then(|| PerChannel {
                inputs: past.chain(inputs).collect(),
                output: level(&outputs[output], of_output(output)),
            })
        };
        if let Some((name, scale)) = self.scales.iter().find(|(_, scale)| !(1e-98..=1e98).contains(scale)) {
            return Err(Failure::usage(format!(
                "--scale {name}={scale}: give the typical magnitude of the channel, from 1e-98 to 1e98"
            )));
        }
        let scale = |name: &str| -> Result<f64, Failure> {
            value(&self.scales, name).ok_or_else(|| {
                Failure::usage(format!(
                    "--scale: '{name}' has none; give one for each channel, or none at all"
                ))
            })
        };
        let scales = |output: &str| {
            let of =
                |names: &[String]| names.iter().map(|name| scale(name)).collect::<Result<Vec<_>, Failure>>();
            let all = || {
                Ok::<_, Failure>(PerChannel {
                    inputs: [of(coupled)?, of(inputs)?].concat(),
                    output: scale(output)?,
                })
            };
            (!self.scales.is_empty()).then(all).transpose()
        };
        let track = |policy: &Policy, place: usize| {
            let output = &outputs[place];
            let plan = TrackPlan {
                forgetting: *policy,
                method,
                offsets: offsets(place),
                scales: scales(output)?,
                ..self.plan.clone()
            };
            match &source {
                Source::Report(report) => Tracker::from_report_of(report, place, &plan),
                Source::Nothing(orders, None) if !coupled.is_empty() => {
                    Tracker::coupled(orders, coupled.len(), &plan)
                }
                Source::Nothing(orders, None) => Tracker::new(orders, &plan),
                Source::Nothing(orders, Some(map)) => {
                    Tracker::nonlinear(orders, map, &orders.lag_names(inputs, output), &plan)
                }
            }
            .map_err(|error| match error {
                thetahat::Error::Report { .. } => {
                    let file = self.warm.as_ref().map_or_else(String::new, |path| path.display().to_string());
                    Failure::data(format!("{file}: {error}"))
                }
                _ => Failure::option(&error),
            })
        };
        let each =
            self.policies.iter().flat_map(|policy| (0..outputs.len()).map(move |place| (policy, place)));
        each.map(|(policy, place)| track(policy, place)).collect()
    }

    /// That the model can have these outputs.
    fn check_outputs(&self, outputs: &[String], stored: Option<&Model>) -> Result<(), Failure> {
        let count = outputs.len();
        if count == 0 {
            return Err(Failure::usage("--output: there is none; name one"));
        }
        if let Some(model) = stored.filter(|model| model.outputs().len() != count) {
            return Err(Failure::usage(format!(
                "--output: {count} of the {} outputs of --warm; name all of them, or none",
                model.outputs().len()
            )));
        }
        match self.coupling {
            Some(_) if stored.is_some() => {
                return Err(Failure::usage("--couple: that of --warm is taken; leave it out"));
            }
            Some(_) if count == 1 => {
                return Err(Failure::usage(
                    "--couple is for several outputs, such as --output y1,y2; leave it out",
                ));
            }
            _ if count == 1 => return Ok(()),
            _ => {}
        }
        let option = if self.degree.is_some() {
            "--narx"
        } else if self.orders.nc.is_some_and(|nc| nc > 0) {
            "--nc"
        } else {
            return Ok(());
        };
        Err(Failure::usage(format!(
            "{option}: several outputs are tracked as ARX models; leave it out, or track one output"
        )))
    }
}

/// Which past outputs each output of a stored ARX model depends on; none of other models.
fn coupling_of(report: &Report) -> Option<Coupling> {
    report.estimation.procedure.vector_arx().map(|outcome| outcome.coupling)
}

/// Which past outputs each depends on, as it is written.
fn coupling(text: &str) -> Result<Coupling, Failure> {
    text.parse().map_err(|_| {
        Failure::usage(format!("--couple: '{text}' is neither full nor none; give one of these"))
    })
}

impl Given {
    /// That there are as many as it takes without a report.
    fn check(&self) -> Result<(), Failure> {
        if self.na.is_none() && self.nb.is_empty() {
            return Err(Failure::usage(
                "the orders are missing: give --na and --nb, or --warm REPORT to take up those of a fit",
            ));
        }
        if self.nb.is_empty() {
            return Err(Failure::usage("--nb is missing: give it, 0 for a model without inputs"));
        }
        match (self.model, self.nc.unwrap_or(0)) {
            (Some(TrackModelArgument::Arx), 1..) => {
                Err(Failure::usage("--nc: an arx model has no C; leave it out, or give --model armax"))
            }
            (Some(TrackModelArgument::Armax), 0) => {
                Err(Failure::usage("--model armax needs --nc, the number of coefficients of C"))
            }
            _ => Ok(()),
        }
    }

    /// The orders for this many inputs.
    fn of(&self, inputs: usize) -> Result<Orders, Failure> {
        let each = |option: &str, given: &[usize], usual: usize| match given {
            [] => Ok(vec![usual; inputs]),
            [one] => Ok(vec![*one; inputs]),
            all if all.len() == inputs => Ok(all.to_vec()),
            all => Err(Failure::usage(format!(
                "{option}: {} values for {inputs} inputs; give one for each, or one for all",
                all.len()
            ))),
        };
        let (nb, nk) = (each("--nb", &self.nb, 0)?, each("--nk", &self.nk, 1)?);
        Orders::new(self.na.unwrap_or(0), &nb, self.nc.unwrap_or(0), 0, &vec![0; inputs], &nk)
            .map_err(|error| Failure::option(&error))
    }
}

/// Numbers set by hand, one for a channel.
fn named_values(option: &str, texts: &[String]) -> Result<Vec<(String, f64)>, Failure> {
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
