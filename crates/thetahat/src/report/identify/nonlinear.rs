//! The nonlinear ARX model that a default choice may come to.
//!
//! Products of two past values, and of three where these help, are chosen by forward regression for a few sets of lags,
//! without each third of the rows, and evaluated on it by their free run, as the linear models are. The best of them is
//! taken where it is far better than all linear ones: most plants are near enough to linear ones where they work, and a
//! linear model says more.

use std::ops::Range;

use thetahat_numerics::optimize::{Monitor, Search};

use crate::Error;
use crate::data::{Channel, Decision, FindingKind, Log, Record, Rows, Source, measured};
use crate::estimate::thinned_to;
use crate::figures::fixed;
use crate::model::{Activation, Model, Orders};
use crate::report::nonlinear_arx::{InputLags, MapPlan, NonlinearArxPlan, fit_planned};
use crate::report::{Plan, Report, apply};
use crate::respond::{Horizon, InitialCondition, Response};
use crate::select::{HeldOut, SelectedModel, Selection, Task, few_for_blocks, on_blocks};

/// Lags that are always tried, and the most of each channel.
const USUAL_LAGS: [usize; 2] = [2, 3];
const MOST_LAGS: usize = 4;
/// The number of best sets of lags that are evaluated further.
const BEST: usize = 3;
/// Products help that lower the mean of the logarithms of free runs by so much.
const HELPS: f64 = 0.1;
/// Units of a network, its further starts and iterations, and the samples that weigh for small numbers.
const UNITS: usize = 2;
const STARTS: usize = 2;
const ITERATIONS: usize = 200;
const RIDGE: f64 = 0.1;
/// Without a block networks are trained on so many samples at most, in a few pieces; the one that is taken on no more
/// than these.
const TRAINED: usize = 2000;
const PIECES: usize = 2;
const MOST_TRAINED: usize = 20_000;
/// A choice among more products than this part of the samples finds what fits by chance.
const PRODUCTS: usize = 4;

/// A run at rest is as long as the log, within these.
const FEWEST_AT_REST: usize = 100;
const MOST_AT_REST: usize = 2000;
/// It may leave the range of the output by this part of it.
const LEAVES: f64 = 0.5;

/// A nonlinear model and what it does on blocks.
struct Rival {
    plan: NonlinearArxPlan,
    what: String,
    held_out: HeldOut,
}

/// A log as it was read, and how a nonlinear model is fitted to it.
pub(super) struct Nonlinear<'l> {
    log: &'l Log,
    plan: NonlinearArxPlan,
}

impl<'l> Nonlinear<'l> {
    /// None where the plan asks for something that a nonlinear model is not.
    pub(super) fn of(log: &'l Log, plan: &Plan) -> Option<Self> {
        let own = || NonlinearArxPlan {
            estimate: plan.estimate.clone(),
            validate: plan.validate.clone(),
            split: plan.split,
            detrend: plan.detrend,
            offsets: plan.offsets.clone(),
            ..NonlinearArxPlan::new(
                &plan.inputs.iter().map(String::as_str).collect::<Vec<_>>(),
                &[plan.output.as_str()],
            )
        };
        (plan.leaves_all_open() && !plan.is_linear()).then(|| Self { log, plan: own() })
    }

    /// Nonlinear models beside the linear one that was chosen; also the report of the one that is taken, if one is.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if the monitor says so.
    pub(super) fn compete(
        &self,
        task: &Task<'_>,
        found: SelectedModel,
        sources: &[Source],
    ) -> Result<(SelectedModel, Option<Report>), Error> {
        let SelectedModel { mut selection, mut decisions, initial_parameters } = found;
        let mut taken = None;
        if selection.has_rivals() && task.looks_further() && !task.deadline.is_over() {
            let linear = selection.winners.as_ref().and_then(|winners| winners.simulation.held_out);
            let percent = |held_out: &HeldOut| fixed(held_out.percent(), 1);
            for Rival { plan, what, held_out } in self.ranked(task, &selection) {
                let nonlinear = format!("{what}, free-run fit on held-out blocks {} %", percent(&held_out));
                if !selection.is_far_worse_than(&held_out) {
                    if selection.is_worse_than(&held_out) {
                        let words = format!("Nonlinear: {nonlinear}; not taken, as that is not far better.");
                        selection.steps.push(words);
                    }
                    break;
                }
                let report = match fit_planned(self.log, sources, &plan, task.monitor) {
                    Ok(report) => report,
                    Err(Error::Interrupted) => return Err(Error::Interrupted),
                    Err(_) => continue,
                };
                if !self.settles(&report.model)? {
                    selection.steps.push(format!(
                        "Nonlinear: {nonlinear}; not taken, as it leaves the range of the output where inputs rest at an end of theirs."
                    ));
                    continue;
                }
                decisions.push(Decision {
                    kind: FindingKind::Nonlinear,
                    channels: self.plan.outputs.clone(),
                    because: match &linear {
                        Some(linear) => format!("{nonlinear}, the best linear model {} %", percent(linear)),
                        None => nonlinear,
                    },
                    did: "a nonlinear ARX model is taken".to_owned(),
                    instead: "`narx` none".to_owned(),
                });
                taken = Some(report);
                break;
            }
        }
        Ok((SelectedModel { selection, decisions, initial_parameters }, taken))
    }

    /// Models with what they do on blocks, the best first.
    fn ranked(&self, task: &Task<'_>, selection: &Selection) -> Vec<Rival> {
        let whole = task.named_record();
        let record = few_for_blocks(&whole, &whole);
        let run = |mut plan: NonlinearArxPlan, what: String| {
            if task.deadline.is_over() {
                return None;
            }
            plan.search.time_limit = task.deadline.left();
            let held_out = self.on_blocks(&record, selection.level_window, &plan, task.monitor)?;
            Some(Rival { plan, what, held_out })
        };
        let of_degree = |plan: &NonlinearArxPlan, degree: usize| {
            let few = plan.products(degree).is_ok_and(|products| PRODUCTS * products <= samples(&record));
            let plan = NonlinearArxPlan { map: MapPlan::Polynomial { degree }, ..plan.clone() };
            if few { run(plan, format!("products of degree {degree}")) } else { None }
        };
        let better = |one: &Rival, other: &Rival| one.held_out.both().total_cmp(&other.held_out.both());
        let mut squares: Vec<Rival> =
            self.lags(selection).iter().filter_map(|plan| of_degree(plan, 2)).collect();
        squares.sort_by(better);
        squares.truncate(BEST);
        let Some(first) = squares.first() else { return Vec::new() };
        let cubes = of_degree(&first.plan, 3);
        // A network is worth its training where products simulate better than none, found in the same way.
        let least = |rival: Option<&Rival>| rival.map_or(f64::INFINITY, |rival| rival.held_out.both());
        let straight = least(of_degree(&first.plan, 1).as_ref());
        let helps = straight - least(Some(first)).min(least(cubes.as_ref())) > HELPS;
        let trained = helps && samples(&whole) <= MOST_TRAINED;
        let networks = squares.iter().filter(|_| trained).filter_map(|Rival { plan, .. }| {
            let map = MapPlan::Network { activation: Activation::Tanh, units: Some(UNITS), drawn: false };
            let search = Search { starts: STARTS, max_iterations: ITERATIONS, ..plan.search.clone() };
            let plan = NonlinearArxPlan { map, ridge: Some(RIDGE), search, ..plan.clone() };
            run(plan, format!("a network of {UNITS} units"))
        });
        let networks: Vec<Rival> = networks.collect();
        let mut rivals: Vec<Rival> = squares.into_iter().chain(cubes).chain(networks).collect();
        rivals.sort_by(better);
        rivals
    }

    /// Whether the free run keeps to the range of the output where all inputs rest at the least and at the largest
    /// value that they had.
    ///
    /// # Errors
    /// As for [`Log::new`].
    fn settles(&self, model: &Model) -> Result<bool, Error> {
        let range = |name: &String| -> Result<[f64; 2], Error> {
            let values = self.log.channel(name)?.values.iter().filter(|value| !value.is_nan());
            Ok(values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
                [low.min(*value), high.max(*value)]
            }))
        };
        let rows = self.log.rows().clamp(FEWEST_AT_REST, MOST_AT_REST);
        let Some(output) = self.plan.outputs.first() else { return Ok(false) };
        let [low, high] = range(output)?;
        for end in 0..2 {
            let inputs = self.plan.inputs.iter().map(|name| {
                let level = range(name)?[end];
                Ok(Channel { name: name.clone(), values: vec![level; rows] })
            });
            let mut channels = inputs.collect::<Result<Vec<_>, Error>>()?;
            channels.push(Channel { name: output.clone(), values: vec![f64::midpoint(low, high); rows] });
            let log = Log::new(channels, self.log.sample_time())?;
            let Ok(said) = apply(model, &log, &[], None, Horizon::FreeRun, InitialCondition::Drop) else {
                return Ok(false);
            };
            let most = LEAVES * (high - low);
            let inside = |value: &f64| value.is_nan() || (low - most..=high + most).contains(value);
            if !said.outputs.iter().all(|output| output.predicted.iter().all(inside)) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// What a plan does on blocks that it was not fitted to.
    fn on_blocks(
        &self,
        record: &Record<'_>,
        window: Option<usize>,
        plan: &NonlinearArxPlan,
        monitor: Monitor<'_>,
    ) -> Option<HeldOut> {
        let first = record.segments.first()?.start;
        let level = self.log.channel(plan.outputs.first()?).ok()?.values[first] - record.output[first];
        let rows =
            |record: &Record<'_>| -> Vec<Rows> { record.segments.iter().map(Rows::from_positions).collect() };
        let fit = |training: &Record<'_>| {
            let few = match plan.map {
                MapPlan::Network { .. } if samples(training) > TRAINED => {
                    thinned_to(training, PIECES, TRAINED / PIECES)
                }
                _ => None,
            };
            let plan = NonlinearArxPlan {
                estimate: rows(few.as_ref().unwrap_or(training)),
                validate: Vec::new(),
                split: None,
                ..plan.clone()
            };
            let report = fit_planned(self.log, &[], &plan, monitor).ok()?;
            Some((true, report.model))
        };
        on_blocks(record, window, fit, |model, record| {
            let said = apply(model, self.log, &rows(record), None, Horizon::FreeRun, InitialCondition::Drop)?;
            let Some(said) = said.outputs.first() else { return Err(Error::data("the model has no output")) };
            let counted = record.segments.iter().flat_map(|rows| {
                let start = (rows.start + plan.lags()).min(rows.end);
                measured(record.output, &(start..rows.end))
            });
            let counted: Vec<_> = counted.collect();
            if counted.iter().cloned().flatten().any(|row| !said.predicted[row].is_finite()) {
                return Err(Error::data("the response grows out of the range of numbers"));
            }
            Ok(Response { values: said.predicted.iter().map(|value| value - level).collect(), counted })
        })
    }

    /// Plans with the lags that are always tried, and with those of the linear models.
    fn lags(&self, selection: &Selection) -> Vec<NonlinearArxPlan> {
        let own: Vec<usize> = match &*selection.delays {
            [] => selection.chosen.orders.nk.clone(),
            delays => delays.iter().map(|delay| delay.nk).collect(),
        };
        // A plant that is not linear may answer sooner than linear models say.
        let sooner: Vec<usize> = own.iter().map(|nk| nk.saturating_sub(1).max((*nk).min(1))).collect();
        let of = |lags: usize, delays: &[usize]| NonlinearArxPlan {
            output_lags: vec![lags],
            input_lags: delays.iter().map(|&delay| InputLags { lags, delay }).collect(),
            ..self.plan.clone()
        };
        let linear = |orders: &Orders| {
            let past = orders.nf.iter().copied().fold(orders.na, usize::max).clamp(1, MOST_LAGS);
            let own = orders.nb.iter().zip(&orders.nk);
            NonlinearArxPlan {
                output_lags: vec![past],
                input_lags: own
                    .map(|(&nb, &delay)| InputLags { lags: nb.clamp(1, MOST_LAGS), delay })
                    .collect(),
                ..self.plan.clone()
            }
        };
        let usual = USUAL_LAGS.iter().flat_map(|&lags| [of(lags, &own), of(lags, &sooner)]);
        let winners = selection.winners.iter().map(|winners| &winners.simulation.orders);
        let linear = std::iter::once(&selection.chosen.orders).chain(winners).map(linear);
        let mut plans: Vec<NonlinearArxPlan> = Vec::new();
        for plan in usual.chain(linear) {
            if !plans.contains(&plan) {
                plans.push(plan);
            }
        }
        plans
    }
}

fn samples(record: &Record<'_>) -> usize {
    record.segments.iter().map(Range::len).sum()
}
