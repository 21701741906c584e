//! Where searches for a process start: a grid for one lag, then one lag more after the other.

use thetahat_numerics::optimize::{Deadline, Found, Monitor, Objective, Search, search};

use super::objective::{LATEST, ProcessObjective, spread};
use super::refined;
use crate::Error;
use crate::model::ProcessStructure;

/// Time constants and dead times of the grid.
const TIME_CONSTANTS: usize = 8;
const DEAD_TIMES: usize = 6;
/// The shortest time constant of the grid, as a fraction of the longest log.
const FASTEST: f64 = 1e-3;
/// How many candidates are searched from.
const SEARCHED: usize = 2;
/// A further lag is first as long as one of these fractions of the longest one.
const FURTHER: [f64; 4] = [0.02, 0.1, 0.3, 0.8];
/// The slowest lag beside a zero, as a multiple of what it was without.
const SLOWER: [f64; 3] = [1.0, 2.0, 4.0];
/// The same of lags side by side.
const BESIDE: [f64; 7] = [0.01, 0.03, 0.1, 0.3, 3.0, 10.0, 30.0];
/// Damping of pairs, and their frequency times the longest time constant.
const DAMPINGS: [f64; 3] = [0.1, 0.4, 0.9];
const FREQUENCIES: [f64; 6] = [0.5, 1.0, 2.0, 4.0, 8.0, 16.0];
/// A third lag beside a pair, as a fraction of the longest one.
const THIRD: f64 = 0.3;
/// The number of dead times that are evaluated where the output jumps with the input, and the number of rounds in which
/// further ones, nearer to the best, are evaluated.
const EVERY: usize = 48;
const NEARER: usize = 6;
const AROUND: i32 = 4;
/// The relative decrease at which searches stop: time constants keep their digits in little noise.
const TOLERANCE: f64 = 1e-11;
/// A dead time below this fraction of the shortest step may as well be zero.
const NO_DEAD_TIME: f64 = 1e-2;
/// Costs this close are the same.
const SAME: f64 = 1e-9;

/// Searches for these structures. The objective is left at what was found.
pub(super) fn searched(
    objective: &mut ProcessObjective<'_>,
    structures: &[ProcessStructure],
    options: &Search,
    deadline: Deadline,
    monitor: Monitor<'_>,
) -> Result<Found, Error> {
    let options = &Search { tolerance: options.tolerance.min(TOLERANCE), ..options.clone() };
    // Each with as many lags as it begins with, the last structure first.
    let ladders: Vec<Vec<ProcessStructure>> = structures
        .iter()
        .map(|structure| std::iter::successors(Some(*structure), ProcessStructure::simpler).collect())
        .collect();
    let mut current: Vec<ProcessStructure> =
        ladders.iter().zip(structures).map(|(ladder, own)| *ladder.last().unwrap_or(own)).collect();
    objective.take(current.clone());
    let grid = if structures.iter().all(ProcessStructure::is_transfer_function) {
        let points = refined::points(objective, structures, deadline);
        if points.is_empty() {
            return Err(Error::undetermined(
                Vec::new(),
                "no transfer function of so many poles and zeros is found in it: take fewer, or a log in which the input moves more",
            ));
        }
        points
    } else {
        first_grid(objective)
    };
    let mut found = from_best(objective, grid, options, deadline, monitor)?;
    for (input, ladder) in ladders.iter().enumerate() {
        for structure in ladder.iter().rev().skip(1) {
            let before = current[input];
            current[input] = *structure;
            let candidates = extended(objective, &found.parameters, input, (before, *structure));
            objective.take(current.clone());
            found = from_best(objective, candidates, options, deadline, monitor)?;
        }
    }
    for (input, structure) in current.iter().enumerate() {
        if structure.acts_at_once() && structure.has_dead_time() && !objective.is_of_points() {
            found = past_jumps(objective, found, input, options, (deadline, monitor))?;
        }
    }
    // Where a dead time wants to be less than zero the search stops at the bound.
    let places = objective.places();
    for (input, (_, dead_time)) in places.iter().enumerate().rev() {
        let Some(place) = *dead_time else { continue };
        if found.parameters[place] > NO_DEAD_TIME * objective.shortest() {
            continue;
        }
        objective.hold_dead_time(input, Some(0.0));
        let mut start = found.parameters.clone();
        start.remove(place);
        let without = from_best(objective, vec![start], options, deadline, monitor)?;
        if without.cost() <= found.cost() * (1.0 + SAME) {
            found = without;
        } else {
            objective.take(current.clone());
        }
    }
    // The longest time constant first; of lags side by side the shortest.
    let mut point = found.parameters.clone();
    for (structure, (shape, _)) in current.iter().zip(objective.places()) {
        if structure.is_transfer_function() {
            continue;
        }
        let own = &mut point[shape];
        let real = if structure.is_underdamped() { 2 } else { 0 };
        let own = &mut own[real..];
        own.sort_by(|left, right| right.total_cmp(left));
        if structure.is_parallel() {
            own.reverse();
        }
    }
    objective.evaluate(&point).map_err(|_| {
        Error::data("the response leaves the range of numbers; scale the channels towards one")
    })?;
    Ok(found)
}

/// Searches near parameters, without a grid and with their dead times. The objective is left at what was found.
pub(super) fn searched_from(
    objective: &mut ProcessObjective<'_>,
    structures: &[ProcessStructure],
    start: &[f64],
    options: &Search,
    monitor: Monitor<'_>,
) -> Result<Found, Error> {
    let mut first = 0;
    let (mut point, mut dead_times) = (Vec::new(), Vec::new());
    for structure in structures {
        let own = first..first + structure.parameters();
        first = own.end;
        let parts = structure.taken_apart(&start[own]);
        point.extend(parts.shape.iter().map(|value| value.ln()));
        dead_times.push(parts.dead_time);
    }
    objective.stay_near(&point, &dead_times);
    let found = from_best(objective, vec![point], options, Deadline::after(options.time_limit), monitor)?;
    objective.evaluate(&found.parameters).map_err(|_| {
        Error::data("the response leaves the range of numbers; scale the channels towards one")
    })?;
    Ok(found)
}

/// Searches from the best of some candidates.
fn from_best(
    objective: &mut ProcessObjective<'_>,
    candidates: Vec<Vec<f64>>,
    options: &Search,
    deadline: Deadline,
    monitor: Monitor<'_>,
) -> Result<Found, Error> {
    let mut tried: Vec<(f64, Vec<f64>)> = Vec::new();
    let limits = objective.limits();
    for mut candidate in candidates {
        candidate.iter_mut().zip(&limits).for_each(|(value, [low, high])| *value = value.clamp(*low, *high));
        if let Ok(cost) = objective.evaluate(&candidate) {
            tried.push((cost, candidate));
        }
    }
    tried.sort_by(|left, right| left.0.total_cmp(&right.0));
    let mut best: Option<Found> = None;
    for (_, start) in tried.iter().take(SEARCHED + options.starts) {
        if best.is_some() && deadline.is_over() {
            break;
        }
        let Ok(found) = search(objective, start, options, 0.0, deadline, monitor)? else { continue };
        if best.as_ref().is_none_or(|best| found.cost() < best.cost()) {
            best = Some(found);
        }
    }
    best.ok_or_else(|| {
        Error::data("the response leaves the range of numbers; scale the channels towards one")
    })
}

/// Where the output jumps with the input, so do the errors, as a function of the dead time, whenever a jump passes a
/// sample: slopes do not lead from one minimum to the next. So the dead time is held at many values, and at some nearer
/// to the best of them, the others being searched for. Between two such samples the errors of one lag do not depend on
/// it at all; it is put in the middle.
fn past_jumps(
    objective: &mut ProcessObjective<'_>,
    found: Found,
    input: usize,
    options: &Search,
    (deadline, monitor): (Deadline, Monitor<'_>),
) -> Result<Found, Error> {
    let (_, Some(place)) = objective.places()[input].clone() else { return Ok(found) };
    let (short, long) = (objective.shortest(), objective.longest());
    let ratio = (LATEST * long / short).max(2.0);
    let mut best = (found.cost(), found.parameters.clone());
    let mut tried: Vec<f64> = std::iter::once(0.0).chain(spread(short, ratio * short, EVERY)).collect();
    let mut width = f64::INFINITY;
    for _ in 0..=NEARER {
        let start = best.1.clone();
        for seconds in std::mem::take(&mut tried) {
            if deadline.is_over() {
                break;
            }
            objective.hold_dead_time(input, Some(seconds));
            let mut others = start.clone();
            others.remove(place);
            let own = match from_best(objective, vec![others], options, deadline, monitor) {
                Ok(own) => own,
                Err(Error::Interrupted) => return Err(Error::Interrupted),
                Err(_) => continue,
            };
            if own.cost() < best.0 {
                let mut point = own.parameters.clone();
                point.insert(place, seconds);
                best = (own.cost(), point);
            }
        }
        // As far as the next one that was evaluated.
        let center = best.1[place];
        let first = (center * ratio.ln() / EVERY as f64).max(short);
        width = (width / f64::from(AROUND)).min(first);
        let near = |k: i32| center + width * f64::from(k) / f64::from(AROUND);
        tried.extend((-AROUND..=AROUND).map(near).filter(|seconds| *seconds >= 0.0));
    }
    let [low, high] = objective.gap(input, best.1[place]);
    let middle = f64::midpoint(low, high);
    objective.hold_dead_time(input, Some(middle));
    best.1.remove(place);
    let mut found = from_best(objective, vec![best.1], options, deadline, monitor)?;
    objective.hold_dead_time(input, None);
    found.parameters.insert(place, middle);
    Ok(found)
}

/// One lag for each input: a grid for one after the other, the others being as good as they are.
fn first_grid(objective: &mut ProcessObjective<'_>) -> Vec<Vec<f64>> {
    let places = objective.places();
    let count = places.last().map_or(0, |(shape, dead_time)| dead_time.map_or(shape.end, |place| place + 1));
    let (short, long) = (objective.shortest(), objective.longest());
    let fastest = (FASTEST * long).max(0.5 * short);
    let mut start = vec![0.0; count];
    places.iter().for_each(|(shape, _)| start[shape.clone()].fill((0.05 * long).max(fastest).ln()));
    let mut candidates = Vec::new();
    let sweeps = if places.len() > 1 { 2 } else { 1 };
    let mut remaining = sweeps * places.len();
    for _ in 0..sweeps {
        for (input, (shape, dead_time)) in places.iter().enumerate() {
            candidates.clear();
            let shapes: Vec<Option<f64>> = if shape.is_empty() {
                vec![None]
            } else {
                spread(fastest, long.max(2.0 * fastest), TIME_CONSTANTS).map(Some).collect()
            };
            let dead_times =
                if dead_time.is_some() { objective.dead_times(input, DEAD_TIMES) } else { vec![0.0] };
            for tau in shapes {
                for seconds in &dead_times {
                    let mut candidate = start.clone();
                    if let Some(tau) = tau {
                        candidate[shape.start] = tau.ln();
                    }
                    if let Some(place) = dead_time {
                        candidate[*place] = *seconds;
                    }
                    candidates.push(candidate);
                }
            }
            // The last ones are evaluated by the searches from them.
            remaining -= 1;
            if remaining == 0 {
                return candidates;
            }
            let cost = |candidate: &Vec<f64>| objective.evaluate(candidate).unwrap_or(f64::INFINITY);
            let costs: Vec<f64> = candidates.iter().map(cost).collect();
            let best = (0..candidates.len()).min_by(|&i, &j| costs[i].total_cmp(&costs[j]));
            if let Some(best) = best {
                start.clone_from(&candidates[best]);
            }
        }
    }
    candidates
}

/// Points of a structure with one lag more at an input, or with a pair in the place of two lags.
fn extended(
    objective: &ProcessObjective<'_>,
    found: &[f64],
    input: usize,
    (before, after): (ProcessStructure, ProcessStructure),
) -> Vec<Vec<f64>> {
    let (shape, dead_time) = objective.places()[input].clone();
    let longest = found[shape.clone()].iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let with = |own: Vec<f64>, seconds: f64| {
        let mut point = found.to_vec();
        if let Some(place) = dead_time {
            point[place] = seconds;
        }
        point.splice(shape.clone(), own);
        point
    };
    let seconds = dead_time.map_or(0.0, |place| found[place]);
    let mut points = Vec::new();
    if after.is_underdamped() && !before.is_underdamped() {
        let mut lags: Vec<f64> = found[shape.clone()].to_vec();
        lags.sort_by(|left, right| right.total_cmp(left));
        let (first, second) = (lags[0].exp(), lags[1].exp());
        // A third lag may be the slow one, or as fast as it was.
        let rests: Vec<Vec<f64>> = match lags[2..] {
            [] => vec![Vec::new()],
            [third, ..] => vec![vec![third], vec![longest], vec![longest + THIRD.ln()]],
        };
        let mean = (first * second).sqrt();
        let pair = |omega: f64, zeta: f64, rest: &[f64]| [&[omega.ln(), zeta.ln()], rest].concat();
        points.push(with(pair(1.0 / mean, f64::midpoint(first, second) / mean, &rests[0]), seconds));
        for zeta in DAMPINGS {
            for frequency in FREQUENCIES {
                for rest in &rests {
                    let own = pair(frequency / longest.exp(), zeta, rest);
                    points.push(with(own.clone(), seconds));
                    if seconds > 0.0 {
                        points.push(with(own, 0.0));
                    }
                }
            }
        }
        return points;
    }
    if after.columns() > before.columns() && !after.is_parallel() {
        // A zero takes much of what a lag does, so that the lags beside it are others.
        points.push(found.to_vec());
        for slow in SLOWER {
            for fast in FURTHER {
                let mut own = found[shape.clone()].to_vec();
                own[0] = longest + slow.ln();
                own[1] = longest + fast.ln();
                points.extend([1.0, 0.5, 0.0].map(|part| with(own.clone(), part * seconds)));
            }
        }
        return points;
    }
    let fractions: &[f64] = if after.is_parallel() { &BESIDE } else { &FURTHER };
    for fraction in fractions {
        let lag = longest + fraction.ln();
        let own = [&found[shape.clone()], &[lag]].concat();
        // A lag more is in part what the dead time was.
        let shorter = (seconds - lag.exp()).max(0.0);
        points.push(with(own.clone(), seconds));
        if shorter < seconds {
            points.push(with(own, shorter));
        }
    }
    points
}
