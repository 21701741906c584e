//! Fits of nonlinear ARX models: of a map that is named, or of the best of all, among which a linear model takes part.

use std::ops::ControlFlow;
use std::time::Duration;

use thetahat_numerics::optimize::{Deadline, Monitor, Search};

use super::nonlinear_arx::{InputLags, MapPlan, NonlinearArxPlan, fit_planned};
use crate::Error;
use crate::data::{Log, Rows, Source};
use crate::estimate::{MapsOutcome, Method, RunFigures, TermStep};
use crate::model::Activation;
use crate::report::shares::Shares;
use crate::report::{Plan, Report, apply, identify_monitored};
use crate::respond::nonlinear_arx::within;
use crate::respond::{Horizon, InitialCondition};
use crate::select::{Automatic, Choice};
use crate::validate::{Fit, Part};

/// What is tried beside a linear model: degrees of products, and units of networks.
const DEGREES: [usize; 2] = [2, 3];
const UNITS: [usize; 2] = [2, 4];
/// Of a time limit the choice of a linear model may take the first part, all models together the second; the rest is
/// for the last fit.
const FOR_LINEAR: f64 = 0.2;
const FOR_ALL: f64 = 0.6;
/// A simpler model is taken if its error on held-out rows is no more than this many times the least.
const CLEARLY: f64 = 1.1;
/// A model whose run leaves this many times the measured range, about its middle, is taken only where all do. Good
/// models of plants that saturate leave 1.1 times, within which a choice of terms prefers to stay.
const RANGE: f64 = 2.0;

/// A model of the comparison.
struct Candidate {
    /// None: the linear one.
    plan: Option<NonlinearArxPlan>,
    report: Report,
    step: TermStep,
}

/// The rows that models are fitted to, and those that they are evaluated on, in the choice.
struct Parts<'l> {
    log: &'l Log,
    sources: &'l [Source],
    estimation: Vec<Rows>,
    held_out: Vec<Rows>,
    monitor: Monitor<'l>,
}

/// Fits a nonlinear ARX model,
///
/// ```text
/// y(t) = sum_j theta_j f_j(z(t)) + e(t)
/// ```
///
/// where z are lags of the output and of the inputs, each less its offset and divided by its scale, and f_j are
/// functions of the plan's map. Of functions that are known forward regression chooses: the one that explains most of
/// what is left comes next (Chen, Billings and Luo, Int. J. Control 50, 1989). Products are chosen from moments,
/// without a matrix of all of them, and the parameters come from a QR of the chosen ones; their covariance is that of a
/// linear regression with white noise. How many are taken is what the free run says of rows that they were not fitted
/// to, an information criterion, or given. Functions with numbers of their own, such as the weights of a network, are
/// trained: a search from several starts for the least errors of free runs, or of shorter ones.
///
/// Cost: O(N C(n + 2 d, 2 d)) for products of degree d of n regressors, and O(M K^2) for K of M functions; of a
/// training O(N (p^2 + na p)) for each iteration on p numbers.
///
/// # Errors
/// [`Error::Argument`] for a plan that makes no sense or rows that are not there; [`Error::Data`] for channels that are
/// not there, an irregular clock, or sums that leave the range of numbers; [`Error::Undetermined`] if rows are too few,
/// a channel is constant, or functions depend on one another.
///
/// ```
/// use thetahat::data::{Channel, Detrend, Log};
/// use thetahat::report::{NonlinearArxPlan, fit_nonlinear_arx};
///
/// // y(t) = 0.5 y(t-1) + u(t-1)^2, without noise.
/// let (mut u, mut y, mut random) = (Vec::new(), vec![0.0], 1_u32);
/// for t in 0..200 {
///     random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
///     u.push(f64::from(random >> 16) / 32_768.0 - 1.0);
///     y.push(0.5 * y[t] + u[t] * u[t]);
/// }
/// y.pop();
/// let channel = |name: &str, values| Channel { name: name.into(), values };
/// let log = Log::new(vec![channel("u", u), channel("y", y)], 1.0)?;
/// let plan = NonlinearArxPlan {
///     terms: Some(2),
///     raw_terms: true,
///     detrend: Detrend::None,
///     ..NonlinearArxPlan::new(&["u"], &["y"])
/// };
/// let report = fit_nonlinear_arx(&log, &[], &plan)?;
/// let [first, second] = report.model.parameters() else { panic!("two terms") };
/// assert_eq!((first.name.as_str(), second.name.as_str()), ("u(k-1)^2", "y(k-1)"));
/// assert!((first.value - 1.0).abs() < 1e-12 && (second.value - 0.5).abs() < 1e-12);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn fit_nonlinear_arx(log: &Log, sources: &[Source], plan: &NonlinearArxPlan) -> Result<Report, Error> {
    fit_nonlinear_arx_monitored(log, sources, plan, &|_| ControlFlow::Continue(()))
}

/// [`fit_nonlinear_arx`] that tells `monitor` of each iteration of a training, from several threads. The monitor may
/// end it.
///
/// # Errors
/// As for [`fit_nonlinear_arx`]; [`Error::Interrupted`] if the monitor says so.
pub fn fit_nonlinear_arx_monitored(
    log: &Log,
    sources: &[Source],
    plan: &NonlinearArxPlan,
    monitor: Monitor<'_>,
) -> Result<Report, Error> {
    plan.check()?;
    let plan = &plan.holding_out()?;
    match plan.map {
        MapPlan::Auto => best(log, sources, plan, monitor),
        _ => fit_planned(log, sources, plan, monitor),
    }
}

/// Fits the linear model that the data choose, products of two degrees, as they are and trained for longer runs, and
/// networks of two sizes, and takes the first, in this order, whose run over held-out rows has an error of no more than
/// 1.1 times that of the best one. Where lags are chosen each is tried with those of the plan and with those of the
/// linear model.
///
/// # Errors
/// As for [`fit_nonlinear_arx`].
fn best(
    log: &Log,
    sources: &[Source],
    plan: &NonlinearArxPlan,
    monitor: Monitor<'_>,
) -> Result<Report, Error> {
    let shares = Shares::of(&plan.estimate, &plan.validate, plan.split, log.rows())?;
    let (estimation, held_out) = match shares.parts {
        Some(parts) => (parts.estimation, parts.validation),
        None => (shares.estimation, shares.validation),
    };
    let parts = Parts { log, sources, estimation, held_out, monitor };
    let limit = plan.search.time_limit;
    let part = |share: f64| limit.map(|limit| limit.mul_f64(share));
    let (for_all, whole) = (Deadline::after(part(FOR_ALL)), Deadline::after(limit));
    let linear = parts.linear(plan, part(FOR_LINEAR))?;
    let mut plans = Vec::new();
    let lags = lags(plan, linear.as_ref());
    for map in maps() {
        for own in &lags {
            let kind = |focus| NonlinearArxPlan { map: map.clone(), focus: Some(focus), ..own.clone() };
            if let MapPlan::Polynomial { degree } = map {
                // A choice among more products than samples finds what fits by chance.
                if own.products(degree)? > parts.rows() {
                    continue;
                }
                plans.push(kind(Horizon::ONE_STEP));
                if plan.horizon() == Horizon::ONE_STEP {
                    continue;
                }
            }
            plans.push(kind(plan.horizon()));
        }
    }
    let (mut tried, mut refused): (Vec<Candidate>, Option<Error>) = (linear.into_iter().collect(), None);
    let mut untried = 0;
    for mut plan in plans {
        if for_all.is_over() && !tried.is_empty() {
            untried += 1;
            continue;
        }
        plan.search.time_limit = for_all.left();
        match parts.nonlinear(plan) {
            Ok(one) => tried.extend(one),
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            Err(error) => refused = refused.or(Some(error)),
        }
    }
    let rank = |one: &Candidate| one.step.held_out.map_or((true, f64::INFINITY), RunFigures::rank);
    let better = |one: &(bool, f64), other: &(bool, f64)| one.0.cmp(&other.0).then(one.1.total_cmp(&other.1));
    let Some((strays, least)) = tried.iter().map(rank).min_by(better) else {
        return Err(refused.unwrap_or_else(|| Error::data("no model can be fitted to these rows")));
    };
    let is_near = |one: &Candidate| rank(one).0 == strays && rank(one).1 <= CLEARLY * least;
    let taken = tried.iter().position(is_near).unwrap_or(0);
    let path: Vec<TermStep> = tried.iter().map(|one| one.step.clone()).collect();
    let Candidate { plan: own, report, .. } = tried.swap_remove(taken);
    let mut report = match own {
        Some(mut own) => {
            own.search.time_limit = whole.left();
            // Without a split it was fitted to all estimation rows.
            let mut report = match plan.split {
                Some(_) => fit_planned(log, sources, &of_all_rows(own, plan), monitor)?,
                None => report,
            };
            let maps = report.estimation.procedure.terms().iter().cloned().map(|mut outcome| {
                outcome.candidates = path.len();
                outcome.taken = taken + 1;
                outcome.path.clone_from(&path);
                outcome
            });
            report.estimation.procedure = MapsOutcome { maps: maps.collect() }.trained();
            report
        }
        None => {
            let linear = linear_plan(plan, whole.left());
            let mut report = identify_monitored(log.clone(), sources, &linear, monitor)?;
            if let Some(selection) = &mut report.selection {
                selection.steps.push(
                    "Polynomials and networks were tried as nonlinear ARX models: the error of none is clearly smaller on held-out rows."
                        .to_owned(),
                );
            }
            report
        }
    };
    if untried > 0 {
        report.warnings.push(format!(
            "time was up: {untried} of {} models were not tried; allow more (`time-limit`)",
            path.len() + untried
        ));
    }
    Ok(report)
}

/// The plan of a model that was tried, for all rows of the choice.
fn of_all_rows(own: NonlinearArxPlan, plan: &NonlinearArxPlan) -> NonlinearArxPlan {
    NonlinearArxPlan { estimate: plan.estimate.clone(), validate: Vec::new(), split: plan.split, ..own }
}

/// The maps, in the order of their complexity.
fn maps() -> impl Iterator<Item = MapPlan> {
    let products = DEGREES.into_iter().map(|degree| MapPlan::Polynomial { degree });
    let networks = UNITS.into_iter().map(|units| MapPlan::Network {
        activation: Activation::Tanh,
        units: Some(units),
        drawn: false,
    });
    products.chain(networks)
}

/// The plan with its lags, and where lags are chosen with those of the linear model too: as many past outputs as A or F
/// reads, and of each input those of B and the one before them, as a nonlinear plant may answer sooner.
fn lags(plan: &NonlinearArxPlan, linear: Option<&Candidate>) -> Vec<NonlinearArxPlan> {
    let own = NonlinearArxPlan { lags_chosen: false, ..plan.clone() };
    let mut plans = vec![own.clone()];
    // A step test may come to a process, which has no lags.
    if let Some(linear) = linear.and_then(|linear| linear.report.model.as_polynomial())
        && plan.lags_chosen
    {
        let orders = &linear.orders;
        let past = orders.nf.iter().copied().fold(orders.na, usize::max).max(1);
        let input_lags = orders.nb.iter().zip(&orders.nk).map(|(&nb, &nk)| {
            let sooner = nk.min(1);
            InputLags { lags: nb + sooner, delay: nk - sooner }
        });
        let other =
            NonlinearArxPlan { output_lags: vec![past], input_lags: input_lags.collect(), ..own.clone() };
        plans.extend(Some(other).filter(|other| *other != own));
    }
    plans
}

/// The plan of a linear model of the same channels and rows, which the data choose.
fn linear_plan(plan: &NonlinearArxPlan, time_limit: Option<Duration>) -> Plan {
    let inputs: Vec<&str> = plan.inputs.iter().map(String::as_str).collect();
    let output = plan.outputs.first().map_or("", String::as_str);
    Plan {
        estimate: plan.estimate.clone(),
        validate: plan.validate.clone(),
        split: plan.split,
        detrend: plan.detrend,
        offsets: plan.offsets.clone(),
        method: Method::PredictionError(Search { time_limit, ..Search::default() }),
        ..Plan::new(&inputs, output, Choice::Automatic(Automatic { linear: true, ..Automatic::default() }))
    }
}

impl Parts<'_> {
    fn rows(&self) -> usize {
        self.estimation.iter().map(Rows::len).sum()
    }

    /// The linear model; none where these rows determine none.
    fn linear(&self, plan: &NonlinearArxPlan, limit: Option<Duration>) -> Result<Option<Candidate>, Error> {
        let own = Plan {
            estimate: self.estimation.clone(),
            validate: Vec::new(),
            split: None,
            ..linear_plan(plan, limit)
        };
        match identify_monitored(self.log.clone(), self.sources, &own, self.monitor) {
            Ok(report) => {
                let term = format!("linear: {}", report.model.name());
                let parameters = report.model.parameters().len();
                Ok(self.evaluated(None, report, (term, parameters), InitialCondition::Estimate))
            }
            Err(Error::Undetermined { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// A nonlinear one; none where it has no run over the rows.
    fn nonlinear(&self, plan: NonlinearArxPlan) -> Result<Option<Candidate>, Error> {
        let own = NonlinearArxPlan {
            estimate: self.estimation.clone(),
            validate: self.held_out.clone(),
            split: None,
            ..plan.clone()
        };
        let report = fit_planned(self.log, self.sources, &own, self.monitor)?;
        let (Some(model), [outcome]) = (report.model.as_nonlinear_arx(), report.estimation.procedure.terms())
        else {
            return Ok(None);
        };
        let Some(last) = outcome.last() else { return Ok(None) };
        let what = match plan.map {
            MapPlan::Polynomial { degree } => {
                let plural = if last.parameters == 1 { "" } else { "s" };
                let trained = if own.horizon() == Horizon::ONE_STEP { "" } else { ", trained" };
                format!("polynomial of degree {degree}, {} term{plural}{trained}", last.parameters)
            }
            _ => last.term.clone(),
        };
        let row = (format!("{what}, of {} lags", model.regressors.len()), last.parameters);
        Ok(self.evaluated(Some(plan), report, row, InitialCondition::Drop))
    }

    /// A model with the figures of its runs over the rows; none where it has none.
    fn evaluated(
        &self,
        plan: Option<NonlinearArxPlan>,
        report: Report,
        (term, parameters): (String, usize),
        start: InitialCondition,
    ) -> Option<Candidate> {
        let driven = !report.model.inputs().is_empty();
        let (horizon, initial) = match driven {
            true => (Horizon::FreeRun, start),
            false => (Horizon::ONE_STEP, InitialCondition::Drop),
        };
        let run = |rows: &[Rows]| -> Option<RunFigures> {
            let applied = apply(&report.model, self.log, rows, None, horizon, initial).ok()?;
            let [said] = &*applied.outputs else { return None };
            let (measured, fit) = (said.measured.as_ref()?, said.fit.as_ref()?);
            let range = |values: &[f64], rows: &[Rows]| {
                let all = rows.iter().flat_map(Rows::positions).map(|t| values[t]);
                all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
                    [low.min(value), high.max(value)]
                })
            };
            let [low, high] = within(range(measured, &[&*self.estimation, rows].concat()), RANGE);
            let [least, largest] = range(&said.predicted, rows);
            Some(RunFigures {
                rmse: fit.rmse,
                largest_error: fit.largest_error,
                percent: fit.percent,
                // A linear model that is stable keeps within bounds by itself.
                in_range: fit.rmse.is_some() && (plan.is_none() || least >= low && largest <= high),
            })
        };
        let (own, fresh) = (run(&self.estimation)?, run(&self.held_out)?);
        let ahead = |fit: &&Fit| fit.part == Some(Part::Estimation) && fit.horizon == Horizon::ONE_STEP;
        let percent = report.fit.iter().find(ahead).and_then(|fit| fit.percent).unwrap_or(0.0);
        let step = TermStep {
            term,
            parameters,
            error_reduction: 1.0 - (1.0 - percent / 100.0).powi(2),
            aliases: Vec::new(),
            rmse: report.estimation.mse.sqrt(),
            free_run: Some(own),
            held_out: Some(fresh),
        };
        Some(Candidate { plan, report, step })
    }
}
