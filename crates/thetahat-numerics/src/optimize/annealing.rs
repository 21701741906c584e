//! Simulated annealing.

use super::objective::Objective;
use super::options::Search;
use super::outcome::{Deadline, Monitor, Progress};
use super::solved::best_free;
use crate::Error;
use crate::random::Random;

/// The first temperature and the last one, as fractions of the cost at the start.
const FIRST: f64 = 0.3;
const LAST: f64 = 1e-4;
/// Trials at each temperature.
const TRIALS: usize = 30;

/// Wanders through the parameters from `point` by random steps d, and leaves there the best of all that were met, of
/// which it gives the cost (Kirkpatrick, Gelatt and Vecchi, Science 220, 1983; Metropolis and others 1953). A step that
/// raises the cost J by dJ is taken with the probability
///
/// ```text
/// exp(-dJ/T),   T falling from 0.3 J to 1e-4 J by the same factor from stage to stage
/// ```
///
/// A step is normal, of root(T/(G_ii p)) in each of p parameters, with G the normal equations at the start: so that it
/// changes J by about T where J is quadratic. There are as many stages as iterations are allowed, with 30 trials each.
///
/// # Errors
/// [`Error::Interrupted`]; the refusal of a start that has no normal equations.
pub(super) fn anneal<O: Objective>(
    objective: &mut O,
    point: &mut [f64],
    cost: f64,
    options: &Search,
    deadline: Deadline,
    monitor: Monitor<'_>,
) -> Result<Result<f64, O::Refusal>, Error> {
    if let Err(refusal) = objective.linearize() {
        return Ok(Err(refusal));
    }
    let (size, scale) = (point.len(), objective.scale(cost));
    let reach: Vec<f64> = (0..size)
        .map(|i| {
            let curvature = objective.matrix()[i * size + i] * size as f64;
            if curvature > 0.0 { (scale / curvature).sqrt() } else { 1.0 }
        })
        .collect();
    let mut random = Random::of(options.seed, size as u64);
    let (mut here, mut own, mut least) = (point.to_vec(), cost, cost);
    let mut trial = here.clone();
    let stages = options.max_iterations.max(1);
    for stage in 0..stages {
        if monitor(Progress { iteration: stage, cost: objective.mean(own), models: None }).is_break() {
            return Err(Error::Interrupted);
        }
        if deadline.is_over() {
            break;
        }
        let temperature = FIRST * (LAST / FIRST).powf(stage as f64 / stages as f64);
        for _ in 0..TRIALS {
            for ((trial, here), reach) in trial.iter_mut().zip(&here).zip(&reach) {
                *trial = here + temperature.sqrt() * reach * random.normal();
            }
            let luck = random.uniform();
            let Ok(reached) = best_free(objective, &trial) else { continue };
            if reached < own || luck < ((own - reached) / (temperature * scale)).exp() {
                here.copy_from_slice(&trial);
                own = reached;
            }
            if own < least {
                point.copy_from_slice(&here);
                least = own;
            }
        }
    }
    Ok(best_free(objective, point))
}
