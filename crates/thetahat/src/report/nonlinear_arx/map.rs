//! The map of an output: its functions, and what their parameters are.

use thetahat_numerics::optimize::Monitor;
use thetahat_numerics::regression::Monomials;

use super::super::shares::Shares;
use super::plan::{Centres, MapPlan, NonlinearArxPlan};
use crate::Error;
use crate::data::{Log, Rows};
use crate::estimate::{
    TermsOutcome,
    nonlinear_arx::{Candidates, Chosen, Count, Growth, Samples, Solved, Training, Units, centres, splines},
};
use crate::model::{Map, NonlinearArxModel};
use crate::respond::Horizon;
use crate::select::Select;

/// Samples that radial basis functions may stand at.
const CANDIDATES: usize = 1000;
/// Radial basis functions, or bends, at most.
const MOST_CENTRES: usize = 2000;
/// Units that are drawn, of which a choice takes some.
const DRAWN: usize = 100;
/// What a choice among trained maps varies: the number of units, and the weight of the square of a parameter, in
/// samples.
const SIZES: [usize; 3] = [2, 4, 8];
const RIDGES: [f64; 2] = [0.1, 1.0];

/// The map of an output, and how it was found.
pub(super) struct FittedMap<'l> {
    pub(super) samples: Samples<'l>,
    pub(super) solved: Solved,
    pub(super) outcome: TermsOutcome,
}

/// Fits the map of the output of `head`, to which the other outputs are inputs.
pub(super) fn fit_map<'l>(
    plan: &NonlinearArxPlan,
    head: &NonlinearArxModel,
    deviations: &'l Log,
    Shares { estimation, validation, parts }: &Shares,
    monitor: Monitor<'_>,
) -> Result<FittedMap<'l>, Error> {
    let read: Vec<String> =
        head.inputs.iter().chain(&head.expressions).map(|signal| signal.name.clone()).collect();
    let trained = plan.map.trained();
    let ridge = plan.ridge.filter(|_| trained.is_none()).unwrap_or(0.0);
    let samples = |rows: &[Rows]| -> Result<Samples<'l>, Error> {
        let record = deviations.record(&read, &head.outputs[0].name, rows)?;
        let segments: Vec<_> = record.segments.into_iter().zip(record.past).collect();
        Samples::new(deviations, head.clone(), &segments, ridge)
    };
    let compared_on = parts.as_ref().map_or_else(|| validation.clone(), |parts| parts.validation.clone());
    if plan.select == Some(Select::Validation) && compared_on.is_empty() {
        return Err(Error::argument("select", "validation needs rows for it; give `validate` or `split`"));
    }
    let all = samples(estimation)?;
    let horizon = plan.horizon();
    if horizon != Horizon::ONE_STEP && all.reads_expressions_of_outputs() {
        return Err(Error::argument(
            "focus",
            "expressions of an output are not followed along longer runs; leave them out, or take prediction",
        ));
    }
    let select = plan.select.unwrap_or(if compared_on.is_empty() { Select::Cv } else { Select::Validation });
    let given = match plan.map {
        MapPlan::Local { units, .. } | MapPlan::Neighbours { units, .. } => units,
        MapPlan::Products { ref terms } => Some(terms.len()),
        _ => match trained {
            Some((_, units)) => units.and(plan.ridge).map(|_| 1),
            None => plan.terms,
        },
    };
    let (count, selected_by) = match (given, select) {
        (Some(count), _) => (Count::Given(count), "given".to_owned()),
        (None, Select::Criterion(criterion)) => (Count::Least(criterion), criterion.word().to_owned()),
        (None, Select::Validation) => (Count::HeldOut(compared_on), "validation".to_owned()),
        (None, Select::Cv) => (Count::Blocks, "cv".to_owned()),
    };
    // With a split the choice compares models of the first part, and the chosen one is fitted to both.
    let first_part = match (parts, &count) {
        (Some(parts), Count::HeldOut(_)) => Some(samples(&parts.estimation)?),
        _ => None,
    };
    let (chosen_on, most) = (first_part.as_ref(), plan.steps());
    let ridges: Vec<f64> = match plan.ridge {
        Some(ridge) => vec![ridge],
        None if trained.is_some() => RIDGES.to_vec(),
        None => vec![0.0],
    };
    let training = Training { horizon, ridges: &ridges, search: &plan.search, monitor };
    let (functions, Chosen { map, steps, taken }, found) = match plan.map {
        _ if let Some((units, size)) = trained => {
            let sizes = size.map_or(SIZES.to_vec(), |size| vec![size]);
            let (chosen, solved, outcome) = all.train(units, &sizes, training, &count, chosen_on)?;
            (chosen.steps.len(), chosen, Some((solved, Some(outcome))))
        }
        MapPlan::Local { membership, planes, .. } => {
            let chosen = all.grow(Growth { membership, planes, most }, &count, chosen_on)?;
            (chosen.steps.len(), chosen, None)
        }
        MapPlan::Neighbours { planes, .. } => {
            let (chosen, solved) = all.keep(planes, &count, chosen_on)?;
            (solved.model.parameters.len(), chosen, Some((solved, None)))
        }
        _ => {
            let candidates = candidates(&plan.map, plan.search.seed, &all)?;
            let chosen = all.choose(&candidates, most, &count, chosen_on)?;
            (candidates.count(all.regressors()), chosen, None)
        }
    };
    let (solved, training) = match found {
        Some(found) => found,
        None if horizon == Horizon::ONE_STEP => (all.solve(map)?, None),
        None => {
            let (solved, outcome) = all.train_parameters(map, training)?;
            (solved, Some(outcome))
        }
    };
    let ridge = plan.ridge.filter(|ridge| *ridge > 0.0);
    let outcome = TermsOutcome { candidates: functions, selected_by, ridge, taken, path: steps, training };
    Ok(FittedMap { samples: all, solved, outcome })
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
