//! The map of an output: its functions, and what their parameters are.

use super::plan::{Centres, MapPlan, NonlinearArxPlan};
use crate::Error;
use crate::data::{Log, Rows};
use crate::estimate::{
    RunFigures, TermStep, TermsOutcome,
    nonlinear_arx::{Candidates, Chosen, Count, Growth, Samples, Solved, Training, Units, centres, splines},
};
use crate::model::{Activation, Map, NonlinearArxModel};
use crate::optimize::Monitor;
use crate::regression::Monomials;
use crate::respond::Horizon;
use crate::select::Select;

use super::super::shares::Shares;

/// Samples that radial basis functions may stand at.
const CANDIDATES: usize = 1000;
/// Radial basis functions, or bends, at most.
const MOST_CENTRES: usize = 2000;
/// Units that are drawn, of which a choice takes some.
const DRAWN: usize = 100;
/// What a choice among trained maps looks at: units, and what the square of a number weighs, in samples.
const SIZES: [usize; 3] = [2, 4, 8];
const RIDGES: [f64; 2] = [0.1, 1.0];
/// Those of the choice among all maps.
const FEW: [usize; 2] = [2, 4];
const DEGREES: [usize; 3] = [1, 2, 3];
/// Where no rows are held out, this part of the estimation samples, their last, is.
const HELD_OUT: f64 = 0.3;
/// Blocks of held-out rows over which they are compared.
const COMPARED: usize = 10;
/// What is foretold from what was measured.
const ONE: Horizon = Horizon::Steps { steps: 1 };

/// The map of an output, and how it was found.
pub(super) struct FittedMap<'l> {
    pub(super) samples: Samples<'l>,
    pub(super) solved: Solved,
    pub(super) outcome: TermsOutcome,
}

/// What maps are fitted to and compared on.
struct Parts<'l> {
    all: Samples<'l>,
    /// The first part, where a choice looks at models of that and the chosen one is fitted to all.
    first: Option<Samples<'l>>,
    held_out: Vec<Rows>,
    select: Select,
    /// What a choice by the free run on `held_out` is called.
    compared: &'static str,
}

/// Fits a linear model to some rows, and gives its row of the table and its squared errors on others, where it takes part.
pub(super) type Linear<'a> = &'a dyn Fn(&[Rows], &[Rows]) -> Result<Option<(TermStep, Vec<f64>)>, Error>;

/// Fits the map of the output of `head`, to which the other outputs are inputs. None where a linear model is as good.
pub(super) fn fit_map<'l>(
    plan: &NonlinearArxPlan,
    head: &NonlinearArxModel,
    deviations: &'l Log,
    Shares { estimation, validation, parts }: &Shares,
    linear: Linear<'_>,
    monitor: Monitor<'_>,
) -> Result<Option<FittedMap<'l>>, Error> {
    let read: Vec<String> =
        head.inputs.iter().chain(&head.expressions).map(|signal| signal.name.clone()).collect();
    let ridge = if plan.trains() { 0.0 } else { plan.ridge.unwrap_or(0.0) };
    let samples = |rows: &[Rows]| -> Result<Samples<'l>, Error> {
        let record = deviations.record(&read, &head.outputs[0].name, rows)?;
        let segments: Vec<_> = record.segments.into_iter().zip(record.past).collect();
        Samples::new(deviations, head.clone(), &segments, ridge)
    };
    let held_out = parts.as_ref().map_or_else(|| validation.clone(), |parts| parts.validation.clone());
    if plan.select == Some(Select::Validation) && held_out.is_empty() {
        return Err(Error::argument("select", "validation needs rows for it; give `validate` or `split`"));
    }
    let all = samples(estimation)?;
    if plan.horizon(plan.trains()) != ONE && all.reads_expressions_of_outputs() {
        return Err(Error::argument(
            "focus",
            "expressions of an output are not followed along longer runs; leave them out, or take prediction",
        ));
    }
    let select = plan.select.unwrap_or(if held_out.is_empty() { Select::Cv } else { Select::Validation });
    // With a split the choice looks at models of the first part, and the chosen one is fitted to both.
    let first = match parts {
        Some(parts) if select == Select::Validation => Some(samples(&parts.estimation)?),
        _ => None,
    };
    let mut parts = Parts { all, first, held_out, select, compared: "validation" };
    if plan.trains() && parts.select == Select::Cv {
        let (before, after) = parts.all.divided(1.0 - HELD_OUT);
        parts.first = Some(samples(&before)?);
        parts.held_out = after;
        parts.select = Select::Validation;
        parts.compared = "last-rows";
    }
    let fitted = match plan.map {
        MapPlan::Auto => {
            let fitted_to = parts.first.as_ref().unwrap_or(&parts.all).divided(1.0).0;
            let linear = linear(&fitted_to, &parts.held_out)?;
            best(plan, &parts, linear.as_ref(), monitor)?
        }
        ref map => Some(fit(plan, map, &parts, monitor)?),
    };
    Ok(fitted.map(|Fitted { solved, outcome, .. }| FittedMap { samples: parts.all, solved, outcome }))
}

/// A map with its parameters.
struct Fitted {
    solved: Solved,
    outcome: TermsOutcome,
    /// The model that was judged on held-out rows.
    judged: Option<NonlinearArxModel>,
}

/// Fits one kind of map.
fn fit(
    plan: &NonlinearArxPlan,
    map: &MapPlan,
    parts: &Parts<'_>,
    monitor: Monitor<'_>,
) -> Result<Fitted, Error> {
    let all = &parts.all;
    let trained = match *map {
        MapPlan::Network { activation, units, drawn } if !drawn && activation != Activation::Step => {
            Some((Units::Network(activation), units))
        }
        MapPlan::FreeRadial { units } => Some((Units::Radial, units)),
        _ => None,
    };
    let given = match *map {
        MapPlan::Local { units, .. } | MapPlan::Neighbours { units, .. } => units,
        MapPlan::Products { ref terms } => Some(terms.len()),
        _ if trained.is_some_and(|(_, units)| units.is_some()) && plan.ridge.is_some() => Some(1),
        _ => plan.terms,
    };
    let (count, selected_by) = match (given, parts.select) {
        (Some(count), _) => (Count::Given(count), "given".to_owned()),
        (None, Select::Criterion(criterion)) => (Count::Least(criterion), criterion.word().to_owned()),
        (None, Select::Validation) => (Count::HeldOut(parts.held_out.clone()), parts.compared.to_owned()),
        (None, Select::Cv) => (Count::Blocks, "cv".to_owned()),
    };
    let chosen_on = parts.first.as_ref().filter(|_| matches!(count, Count::HeldOut(_)));
    let horizon = plan.horizon(trained.is_some());
    let ridges: Vec<f64> = match plan.ridge {
        Some(ridge) => vec![ridge],
        None if trained.is_some() => RIDGES.to_vec(),
        None => vec![0.0],
    };
    let training = Training { horizon, ridges: &ridges, search: &plan.search, monitor };
    let (functions, Chosen { map, steps, taken, judged }, found) = match *map {
        _ if let Some((units, size)) = trained => {
            let sizes = size.map_or(SIZES.to_vec(), |size| vec![size]);
            let (chosen, solved, outcome) = all.train(units, &sizes, training, &count, chosen_on)?;
            (chosen.steps.len(), chosen, Some((solved, Some(outcome))))
        }
        MapPlan::Local { membership, planes, .. } => {
            let chosen = all.grow(Growth { membership, planes, most: plan.steps() }, &count, chosen_on)?;
            (chosen.steps.len(), chosen, None)
        }
        MapPlan::Neighbours { planes, .. } => {
            let (chosen, solved) = all.keep(planes, &count, chosen_on)?;
            (solved.model.parameters.len(), chosen, Some((solved, None)))
        }
        _ => {
            let candidates = candidates(map, plan.search.seed, all)?;
            let chosen = all.choose(&candidates, plan.steps(), &count, chosen_on)?;
            (candidates.count(all.regressors()), chosen, None)
        }
    };
    let (solved, training) = match found {
        Some(found) => found,
        None if horizon == ONE => (all.solve(map)?, None),
        None => {
            let (solved, outcome) = all.train_parameters(map, training)?;
            (solved, Some(outcome))
        }
    };
    let ridge = plan.ridge.filter(|ridge| *ridge > 0.0);
    let outcome = TermsOutcome { candidates: functions, selected_by, ridge, taken, path: steps, training };
    Ok(Fitted { solved, outcome, judged })
}

/// A map of the choice among all.
struct Tried {
    fitted: Fitted,
    step: TermStep,
    /// The squared errors at each row of the log; NaN where they do not count.
    errors: Vec<f64>,
}

/// Fits the maps of the choice among all, and takes the first, in the order of their complexity, whose free run on held-out rows is as good
/// as the best one: the mean difference of squared errors over blocks is within its standard error (Breiman, Friedman, Olshen and Stone,
/// Classification and Regression Trees, 1984, section 3.4.3, with differences in pairs). None where a linear model is: its squared errors
/// and its row of the table are given.
fn best(
    plan: &NonlinearArxPlan,
    parts: &Parts<'_>,
    linear: Option<&(TermStep, Vec<f64>)>,
    monitor: Monitor<'_>,
) -> Result<Option<Fitted>, Error> {
    let mut kinds = Vec::new();
    let fewest = parts.first.as_ref().map_or(parts.all.count(), |first| first.count().min(parts.all.count()));
    for degree in DEGREES {
        // A choice among more products than samples finds what fits by chance.
        let products = Monomials::new(parts.all.regressors(), degree).map_or(usize::MAX, |all| all.count());
        if degree > DEGREES[0] && products > fewest {
            break;
        }
        let map = MapPlan::Polynomial { degree };
        kinds.push((map.clone(), ONE));
        if plan.horizon(true) != ONE {
            kinds.push((map, plan.horizon(true)));
        }
    }
    for units in FEW {
        let map = MapPlan::Network { activation: Activation::Tanh, units: Some(units), drawn: false };
        kinds.push((map, plan.horizon(true)));
    }
    let (mut tried, mut refused): (Vec<Tried>, Option<Error>) = (Vec::new(), None);
    for (map, focus) in kinds {
        let own = NonlinearArxPlan { focus: Some(focus), map, ..plan.clone() };
        match try_one(&own, focus != ONE, parts, monitor) {
            Ok(one) => tried.extend(one),
            Err(error @ (Error::Interrupted | Error::Data { .. })) => return Err(error),
            Err(error) => refused = refused.or(Some(error)),
        }
    }
    let rank = |step: &TermStep| step.held_out.map_or((true, f64::INFINITY), RunFigures::rank);
    let better = |one: &&Tried, other: &&Tried| {
        let ((strays, rmse), (others, worse)) = (rank(&one.step), rank(&other.step));
        strays.cmp(&others).then(rmse.total_cmp(&worse))
    };
    let Some(least) = tried.iter().min_by(better) else {
        if linear.is_some() {
            return Ok(None);
        }
        return Err(refused.unwrap_or_else(|| Error::data("no map can be fitted to these rows")));
    };
    if linear.is_some_and(|(_, errors)| rank(&least.step).0 || about(errors, &least.errors)) {
        return Ok(None);
    }
    let as_good = |one: &Tried| rank(&one.step).0 == rank(&least.step).0 && about(&one.errors, &least.errors);
    let taken = tried.iter().position(as_good).unwrap_or(0);
    let path: Vec<TermStep> =
        linear.iter().map(|(step, _)| step).chain(tried.iter().map(|one| &one.step)).cloned().collect();
    let fitted = tried.swap_remove(taken).fitted;
    let outcome = TermsOutcome {
        candidates: path.len(),
        selected_by: parts.compared.to_owned(),
        taken: taken + 1 + usize::from(linear.is_some()),
        path,
        ..fitted.outcome
    };
    Ok(Some(Fitted { outcome, ..fitted }))
}

/// Fits a map of that choice, and judges it on the held-out rows; none where no model of it was judged.
fn try_one(
    plan: &NonlinearArxPlan,
    trained: bool,
    parts: &Parts<'_>,
    monitor: Monitor<'_>,
) -> Result<Option<Tried>, Error> {
    let fitted = fit(plan, &plan.map, parts, monitor)?;
    let (Some(mut step), Some(mut judged)) = (fitted.outcome.last().cloned(), fitted.judged.clone()) else {
        return Ok(None);
    };
    let first = parts.first.as_ref().unwrap_or(&parts.all);
    if let MapPlan::Polynomial { degree } = plan.map {
        let (terms, plural) = (step.parameters, if step.parameters == 1 { "" } else { "s" });
        step.term = format!("polynomial of degree {degree}, {terms} term{plural}");
        if trained {
            step.term.push_str(", trained");
            let ridges = [plan.ridge.unwrap_or(0.0)];
            let training =
                Training { horizon: plan.horizon(true), ridges: &ridges, search: &plan.search, monitor };
            let (solved, _) = first.train_parameters(judged.maps[0].functions.clone(), training)?;
            step.rmse = solved.mse.sqrt();
            judged = solved.model;
        }
    }
    step.free_run = Some(first.run_figures(&judged, &first.divided(1.0).0)?);
    step.held_out = Some(first.run_figures(&judged, &parts.held_out)?);
    let errors = first.squared_errors(&judged, &parts.held_out)?;
    Ok(Some(Tried { fitted, step, errors }))
}

/// Whether squared errors are no larger than the least ones, by one standard error of their mean difference over blocks of the rows where
/// both count.
fn about(errors: &[f64], least: &[f64]) -> bool {
    let both = errors.iter().zip(least).map(|(one, other)| one - other);
    let differences: Vec<f64> = both.filter(|difference| !difference.is_nan()).collect();
    let blocks: Vec<f64> = differences
        .chunks(differences.len().div_ceil(COMPARED).max(1))
        .map(|block| block.iter().sum::<f64>() / block.len() as f64)
        .collect();
    let count = blocks.len() as f64;
    let mean = blocks.iter().sum::<f64>() / count;
    let square = blocks.iter().map(|block| (block - mean).powi(2)).sum::<f64>();
    let deviation = if count > 1.0 { (square / (count - 1.0) / count).sqrt() } else { 0.0 };
    mean <= deviation
}

/// The functions to choose from.
fn candidates(map: &MapPlan, seed: u64, samples: &Samples<'_>) -> Result<Candidates, Error> {
    let (centres, width, linear) = match map {
        MapPlan::Polynomial { degree } => {
            return Ok(Candidates::Products(Monomials::new(samples.regressors(), *degree)?));
        }
        MapPlan::Products { terms } => {
            let map = Map::products(terms, &samples.names())?;
            return Ok(Candidates::Functions { map, always: terms.len() });
        }
        MapPlan::Spline { units } => {
            let (regressors, most) = (samples.regressors(), MOST_CENTRES / samples.regressors().max(1));
            if *units == 0 || *units > most {
                return Err(Error::argument(
                    "units",
                    format!("{units} bends for each of {regressors} regressors; give from 1 to {most}"),
                ));
            }
            let map = splines::map(&samples.ranges(), *units);
            return Ok(Candidates::Functions { map, always: regressors + 1 });
        }
        MapPlan::Radial { centres, width, linear } => (*centres, *width, *linear),
        MapPlan::Network { activation, units, .. } => {
            let map = Units::Network(*activation).draw(samples, units.unwrap_or(DRAWN), seed, 0);
            return Ok(Candidates::Functions { map, always: samples.regressors() + 1 });
        }
        // They are not chosen among functions.
        MapPlan::Local { .. } | MapPlan::Neighbours { .. } | MapPlan::FreeRadial { .. } | MapPlan::Auto => {
            return Err(Error::argument("map", "it has no functions to choose from"));
        }
    };
    if let Some(width) = width.filter(|width| !(*width > 0.0 && (width * width).is_normal())) {
        return Err(Error::argument(
            "width",
            format!("{width:?} is not a positive number that can be squared; about 1 is usual"),
        ));
    }
    let points = samples.points();
    let (many, wanted) = match centres {
        Centres::Chosen => (CANDIDATES, CANDIDATES),
        Centres::Clusters { count, .. } | Centres::Random { count, .. } => {
            (points.len().min(MOST_CENTRES), count)
        }
        Centres::Grid { each } => {
            let wanted = (0..samples.regressors()).try_fold(1_usize, |count, _| count.checked_mul(each));
            (MOST_CENTRES, wanted.unwrap_or(usize::MAX))
        }
    };
    if wanted == 0 || wanted > many {
        let message = match centres {
            Centres::Grid { each } => format!(
                "a grid of {each} in each direction of {} regressors has none, or more than {many} points; give another number, or \
                 fewer lags",
                samples.regressors()
            ),
            _ => format!(
                "there would be {wanted} centres, for {} samples; give from 1 to {many}",
                points.len()
            ),
        };
        return Err(Error::argument("centres", message));
    }
    let at = match centres {
        Centres::Chosen => centres::spread(&points, CANDIDATES),
        Centres::Clusters { count, seed } => centres::clusters(&points, count, seed),
        Centres::Grid { each } => centres::grid(&points, each),
        Centres::Random { count, seed } => centres::random(&points, count, seed),
    };
    let chosen = centres == Centres::Chosen;
    let map = centres::map(at, width, &points, chosen, linear);
    let path = if linear { samples.regressors() + 1 } else { 0 };
    let always = if chosen { path } else { map.parameters(samples.regressors()) };
    Ok(Candidates::Functions { map, always })
}
