//! The search itself.

use super::annealing::anneal;
use super::objective::Objective;
use super::options::{Algorithm, Search};
use super::outcome::{Deadline, Found, Monitor, Progress, Stopped};
use super::solved::{best_free, solve_linear, solve_linear_here};
use super::workspace::{LARGEST_DAMPING, SMALLEST_DAMPING, Workspace};
use crate::Error;

/// The first damping of Levenberg and Marquardt. A larger one wastes iterations on fast-sampled plants.
const FIRST_DAMPING: f64 = 1e-8;
/// The first one of steps by orthogonal transformations, which begin without any.
const FIRST_ORTHOGONAL_DAMPING: f64 = 1e-14;
/// The last step is taken if it predicts more than this fraction of the tolerance.
const WORTH_TAKING: f64 = 0.01;
/// After this many halvings no step is long enough to matter.
const HALVINGS: usize = 40;
/// How often in a search trials may be moved back from outside without success.
const DRAWN_IN: usize = 3;
const MOST_ITERATIONS: usize = 10_000;
/// A predicted decrease of this fraction of the cost is lost in rounding.
const ROUNDING: f64 = 1e-10;
/// A step that lowers the cost by this fraction of what was predicted is a good one.
const GOOD: f64 = 0.75;
/// Where the cost falls by more than this multiple of the predicted decrease, a longer step is tried.
const BETTER: f64 = 1.2;

/// How the steps of an iteration are made from its normal equations.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Rule {
    Damped,
    Halved,
}

/// A step that lowers the cost.
struct Accepted {
    /// The cost after it.
    cost: f64,
    /// The decrease that was predicted; infinite for a trial that was drawn in from outside.
    predicted: f64,
}

/// Searches from `start` for the parameters of the least cost.
///
/// The objective is left at the parameters found. `smallest` is a cost that is nothing.
///
/// # Errors
/// [`Error::Interrupted`]; the refusal of a start that has no cost, or of a point that has no normal equations.
pub fn search<O: Objective>(
    objective: &mut O,
    start: &[f64],
    options: &Search,
    smallest: f64,
    deadline: Deadline,
    monitor: Monitor<'_>,
) -> Result<Result<Found, O::Refusal>, Error> {
    let mut start = start.to_vec();
    let mut cost = best_free(objective, &start);
    if let (Ok(own), Algorithm::Annealing) = (&cost, options.algorithm) {
        cost = anneal(objective, &mut start, *own, options, deadline, monitor)?;
    }
    let cost = match cost {
        Ok(cost) => cost,
        Err(refusal) => return Ok(Err(refusal)),
    };
    let mut descent = Descent {
        objective,
        workspace: Workspace::new(start.len(), options.algorithm == Algorithm::Newton),
        parameters: start,
        cost,
        damping: FIRST_DAMPING,
        may_turn: matches!(options.algorithm, Algorithm::LevenbergMarquardt | Algorithm::Annealing),
        unstable_steps: 0,
        stability_bound: false,
        drawn_in: 0,
    };
    // Memory for all of them, unless these are more than anybody waits for.
    let mut costs = Vec::with_capacity(options.max_iterations.min(MOST_ITERATIONS) + 1);
    costs.push(cost);
    let mut gradient_norm;
    let stopped = loop {
        let iteration = costs.len() - 1;
        if monitor(Progress { iteration, cost: descent.objective.mean(descent.cost), models: None })
            .is_break()
        {
            return Err(Error::Interrupted);
        }
        // The free responses alone can lower the cost by so much.
        let free_gain = match descent.objective.linearize() {
            Ok(gain) => gain,
            Err(refusal) => return Ok(Err(refusal)),
        };
        let mut predicted = if options.orthogonal && iteration == 0 && descent.may_turn {
            descent.turned(f64::NAN, free_gain)
        } else {
            f64::NAN
        };
        if predicted.is_nan() {
            predicted = descent.workspace.scale(descent.objective, &descent.parameters) + free_gain;
        }
        let scale = descent.objective.scale(descent.cost);
        let ends = predicted <= options.tolerance * scale;
        if descent.may_turn && descent.cost > smallest && ends && descent.workspace.is_lost() {
            predicted = descent.turned(predicted, free_gain);
        }
        gradient_norm =
            (descent.workspace.right.iter().map(|value| value * value).sum::<f64>() / scale).sqrt();
        if descent.cost <= smallest || predicted <= options.tolerance * scale {
            if descent.cost <= smallest {
                gradient_norm = 0.0;
            } else if predicted > WORTH_TAKING * options.tolerance * scale {
                costs.extend(descent.last_step());
            }
            break Stopped::Converged;
        }
        if iteration >= options.max_iterations {
            break Stopped::MaxIterations;
        }
        if deadline.is_over() {
            break Stopped::TimeLimit;
        }
        let rule = descent.direction(options, iteration);
        let may_turn = descent.may_turn;
        let Some(accepted) = descent.step(rule, free_gain) else {
            // The errors of the point again.
            if may_turn && descent.objective.linearize().is_ok() {
                descent.turned(0.0, free_gain);
                continue;
            }
            let rounding = predicted <= descent.rounding();
            break if rounding && !descent.stability_bound { Stopped::Converged } else { Stopped::NoDescent };
        };
        let fall = descent.cost - accepted.cost;
        descent.parameters.copy_from_slice(&descent.workspace.trial);
        descent.cost = accepted.cost;
        costs.push(accepted.cost);
        let scale = descent.objective.scale(descent.cost);
        if accepted.predicted == f64::INFINITY && fall <= options.tolerance * scale {
            if descent.may_turn && descent.objective.linearize().is_ok() {
                descent.turned(0.0, 0.0);
                continue;
            }
            break Stopped::NoDescent;
        }
        // What is left to gain is lost in rounding, and so is what a step gains.
        if predicted <= descent.rounding() && fall < 0.1 * accepted.predicted {
            break Stopped::Converged;
        }
    };
    // Trials that are solved for leave no normal equations behind.
    if descent.workspace.orthogonal.is_some() {
        let _ = descent.objective.linearize();
    }
    let Descent { parameters, stability_bound, unstable_steps, .. } = descent;
    Ok(Ok(Found { parameters, costs, gradient_norm, stopped, stability_bound, unstable_steps }))
}

/// A search on its way.
struct Descent<'o, O> {
    objective: &'o mut O,
    workspace: Workspace,
    /// Where it stands, and the cost there.
    parameters: Vec<f64>,
    cost: f64,
    damping: f64,
    /// Whether it may go on by orthogonal transformations.
    may_turn: bool,
    /// Trials that were refused as they are outside, whether there was one in the last iteration, and how many were
    /// drawn in in vain.
    unstable_steps: usize,
    stability_bound: bool,
    drawn_in: usize,
}

impl<O: Objective> Descent<'_, O> {
    /// A decrease of the cost that is lost in rounding.
    fn rounding(&self) -> f64 {
        ROUNDING * self.objective.scale(self.cost).max(self.cost.abs())
    }

    /// Goes on by orthogonal transformations where the objective has them: the decrease that they predict, else what
    /// was predicted.
    fn turned(&mut self, predicted: f64, free_gain: f64) -> f64 {
        self.may_turn = false;
        let Some(found) = self.workspace.turn(self.objective, &self.parameters) else { return predicted };
        self.damping = 0.0;
        found + free_gain
    }

    /// Takes the full step that is there already, if it lowers the cost, and gives the cost then: where convergence is
    /// slow, it is a good part of the way that is left.
    fn last_step(&mut self) -> Option<f64> {
        self.workspace.apply(self.objective, &self.parameters, 1.0);
        match self.cost_of_trial(0.0) {
            Ok(value) if value < self.cost => {
                self.parameters.copy_from_slice(&self.workspace.trial);
                self.cost = value;
                Some(value)
            }
            _ => {
                self.return_to_point();
                None
            }
        }
    }

    /// Leaves the direction of an iteration in the workspace, and says how its length is found.
    fn direction(&mut self, options: &Search, iteration: usize) -> Rule {
        match options.algorithm {
            Algorithm::LevenbergMarquardt | Algorithm::Annealing => return Rule::Damped,
            // The step is there already.
            Algorithm::GaussNewton => {}
            Algorithm::Newton => self.workspace.newton_step(self.objective, &self.parameters, self.cost),
            Algorithm::Gradient => {
                let length = options.step.at(iteration);
                let Workspace { step, right, .. } = &mut self.workspace;
                step.iter_mut().zip(right).for_each(|(step, right)| *step = length * *right);
            }
        }
        Rule::Halved
    }

    /// Looks for a step that lowers the cost, and leaves where it leads in the trial of the workspace. None if no step
    /// does; then the objective is back where the search stands.
    fn step(&mut self, rule: Rule, free_gain: f64) -> Option<Accepted> {
        self.stability_bound = false;
        let accepted = self.shortened(rule, free_gain);
        let Some(mut accepted) = accepted else {
            self.return_to_point();
            return None;
        };
        let least = if self.workspace.orthogonal.is_some() { 0.0 } else { SMALLEST_DAMPING };
        let fall = self.cost - accepted.cost;
        if fall > GOOD * accepted.predicted {
            self.damping = (self.damping / 10.0).max(least);
        } else if fall > 0.25 * accepted.predicted {
            self.damping = (self.damping / 3.0).max(least);
        }
        if O::STEP_RULES.lengthens && fall > BETTER * accepted.predicted {
            accepted.cost = self.lengthened(accepted.cost);
        }
        Some(accepted)
    }

    /// A step that is damped or shortened until the cost falls.
    fn shortened(&mut self, rule: Rule, free_gain: f64) -> Option<Accepted> {
        let shortenings = O::STEP_RULES.shortenings;
        let mut fraction = 1.0;
        let mut tries = 0;
        loop {
            if rule == Rule::Damped && (tries == 0 || tries > shortenings) {
                self.workspace.solve_damped(self.damping);
            }
            let predicted = self.workspace.apply(self.objective, &self.parameters, fraction) + free_gain;
            match self.cost_of_trial(GOOD * predicted) {
                Ok(cost) if cost < self.cost => return Some(Accepted { cost, predicted }),
                Err(refusal) if O::is_outside(&refusal) => {
                    self.unstable_steps += 1;
                    self.stability_bound = true;
                    if tries == 0
                        && self.workspace.orthogonal.is_none()
                        && self.drawn_in < DRAWN_IN
                        && self.objective.draw_in(&self.parameters, &mut self.workspace.trial)
                    {
                        if let Some(cost) = self.on_boundary() {
                            return Some(Accepted { cost, predicted: f64::INFINITY });
                        }
                        self.drawn_in += 1;
                    }
                }
                Ok(_) | Err(_) => {}
            }
            tries += 1;
            if rule == Rule::Damped && tries > shortenings {
                fraction = 1.0;
                let first = if self.workspace.orthogonal.is_some() {
                    FIRST_ORTHOGONAL_DAMPING
                } else {
                    FIRST_DAMPING
                };
                self.damping = (self.damping * 10.0).max(first);
            } else {
                fraction /= 2.0;
            }
            let exhausted = match rule {
                Rule::Damped => self.damping > LARGEST_DAMPING,
                Rule::Halved => tries >= HALVINGS,
            };
            if exhausted {
                return None;
            }
        }
    }

    /// The cost of a trial that was drawn in, with the parameters solved for that errors are linear in. None if it is
    /// not below that of the point where the search stands; then the objective is there again.
    fn on_boundary(&mut self) -> Option<f64> {
        let Workspace { trial, factor, moved, .. } = &mut self.workspace;
        if let Ok(cost) = solve_linear(self.objective, trial, factor, moved)
            && cost < self.cost
        {
            return Some(cost);
        }
        self.cost = best_free(self.objective, &self.parameters).unwrap_or(self.cost);
        // It had normal equations before.
        let _ = self.objective.linearize();
        None
    }

    /// Doubles the step to the trial, of this cost, as long as the cost falls. Gives the cost that is reached.
    fn lengthened(&mut self, mut cost: f64) -> f64 {
        let Workspace { trial, moved, .. } = &mut self.workspace;
        loop {
            // The trial and the longer one change places.
            for ((longer, trial), start) in moved.iter_mut().zip(&mut *trial).zip(&self.parameters) {
                (*longer, *trial) = (*trial, start + 2.0 * (*trial - start));
            }
            match self.objective.evaluate(trial) {
                Ok(further) if further < cost => cost = further,
                _ => break,
            }
        }
        trial.copy_from_slice(moved);
        // It has been evaluated before.
        let _ = self.objective.evaluate(trial);
        cost
    }

    /// The cost of the trial in the workspace, with free responses that go with the step. By orthogonal
    /// transformations, whose steps are long, with those that are best, and so are the parameters that errors are
    /// linear in (Golub and Pereyra 1973; Kaufman 1975), unless the cost falls by `enough` without.
    fn cost_of_trial(&mut self, enough: f64) -> Result<f64, O::Refusal> {
        self.objective.try_free(&self.workspace.moved);
        let cost = self.objective.evaluate(&self.workspace.trial);
        let falls = matches!(&cost, Ok(cost) if *cost <= self.cost - enough);
        if falls || self.workspace.orthogonal.is_none() {
            return cost;
        }
        let Workspace { trial, factor, moved, .. } = &mut self.workspace;
        if cost.is_ok() {
            return solve_linear_here(self.objective, trial, factor, moved);
        }
        solve_linear(self.objective, trial, factor, moved)
    }

    fn return_to_point(&mut self) {
        if self.workspace.orthogonal.is_some() {
            let _ = best_free(self.objective, &self.parameters);
            return;
        }
        self.objective.keep_free();
        // It has been evaluated before.
        let _ = self.objective.evaluate(&self.parameters);
    }
}
