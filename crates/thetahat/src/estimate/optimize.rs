//! The search for the least sum of squared prediction errors.
//!
//! With the normal equations G step = g of an iteration (see `predictor`), scaled so that G has a unit diagonal:
//!
//! ```text
//! Levenberg-Marquardt  (G + mu I) step = g,  mu from 1e-8, a tenth where the cost falls as foretold; where it rises, the step
//!                      is halved three times, then mu is times 10
//! Gauss-Newton         G step = g,  halved until the cost falls
//! Newton-Raphson       (H + mu I) step = g,  H the Hessian by differences of g, mu the least that makes it positive; halved
//! steepest descent     step = c1/(c2 + l) g,  halved
//! ```
//!
//! (Levenberg 1944; Marquardt 1963; Moré, The Levenberg-Marquardt algorithm: implementation and theory, 1978; Ljung, System
//! Identification, 2nd ed. 1999, section 10.2). Damping alone freezes the flat directions of an ill-conditioned matrix, along
//! which a narrow valley leads: with it an output-error fit of two inputs took 157 iterations, with halved steps 8. A step that would make C or F unstable is refused like one that raises
//! the cost. The search stops when g' G^-1 g, the decrease of the cost that a full step foretells, is below the
//! tolerance times the cost.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::border::Border;
use super::normal;
use super::objective::{Objective, Unusable};
use crate::Error;
use crate::model::Orders;

/// The first damping of Levenberg and Marquardt. A larger one wastes iterations on fast-sampled plants.
pub(crate) const FIRST_DAMPING: f64 = 1e-8;
/// Always there: directions in which the matrix is nothing but rounding foretell no decrease.
pub(crate) const SMALLEST_DAMPING: f64 = 1e-12;
/// With a damping beyond this, or after so many halvings, no step is long enough to matter.
pub(crate) const LARGEST_DAMPING: f64 = 1e12;
/// The last step is taken if it foretells more than this fraction of the tolerance.
const WORTH_TAKING: f64 = 0.01;
const HALVINGS: usize = 40;
/// A damped step is halved so often before it is damped more.
const SHORTER: usize = 3;
/// So often roots may be moved back to the border of stability in vain, in a search.
const DRAWN_IN: usize = 3;
const MOST_ITERATIONS: usize = 10_000;
/// The first perturbation of a Hessian that is not positive definite, beside a diagonal near 1.
const FIRST_PERTURBATION: f64 = 1e-4;
/// A foretold decrease of this fraction of the cost is lost in rounding.
pub(crate) const ROUNDING: f64 = 1e-10;
/// The relative step of differences of the gradient.
const DIFFERENCE: f64 = 1e-6;

/// How a search chooses its steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Algorithm {
    /// Levenberg and Marquardt: the Gauss-Newton matrix with a damped diagonal.
    #[default]
    #[serde(rename = "lm")]
    LevenbergMarquardt,
    /// Gauss and Newton, with a step that is halved until the cost falls.
    GaussNewton,
    /// Newton and Raphson: the full Hessian, made positive definite by a perturbed diagonal.
    Newton,
    /// Steepest descent, in parameters scaled by the diagonal of the Gauss-Newton matrix.
    Gradient,
}

/// The length of the steps of [`Algorithm::Gradient`]: `c1/(c2 + l)` in iteration l = 0, 1, …; `c1` if there is no `c2`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Step {
    /// Above 0. 1 takes each parameter alone to its minimum.
    pub c1: f64,
    /// Above 0.
    pub c2: Option<f64>,
}

impl Default for Step {
    fn default() -> Self {
        Self { c1: 1.0, c2: None }
    }
}

/// How to search.
#[derive(Debug, Clone, PartialEq)]
pub struct Search {
    /// How steps are chosen.
    pub algorithm: Algorithm,
    /// Iterations at most, for each start.
    pub max_iterations: usize,
    /// The search stops when the next step would lower the cost by less than this fraction.
    pub tolerance: f64,
    /// The step length of steepest descent.
    pub step: Step,
    /// Searches from so many further starts: the other candidates, then random ones.
    pub starts: usize,
    /// Which random starts.
    pub seed: u64,
    /// After so long no iteration begins, no start is searched from, and none is looked for but the first.
    pub time_limit: Option<Duration>,
    /// One more start: parameters in their order, such as those of a model that is known to be close.
    pub guess: Option<Vec<f64>>,
    /// Whether the plant is found first, with the least errors of its free run, and the noise behind it: for models that
    /// simulate. Else all parameters together have the least errors one step ahead.
    pub plant_first: bool,
}

impl Search {
    /// Checks the numbers.
    ///
    /// # Errors
    /// [`Error::Argument`] for a tolerance or step constant that is not positive, or a guess of another length.
    pub(super) fn check(&self, orders: &Orders) -> Result<(), Error> {
        if let Some(guess) = &self.guess
            && (guess.len() != orders.parameters() || !guess.iter().all(|value| value.is_finite()))
        {
            return Err(Error::argument(
                "guess",
                format!(
                    "it has {} values; give {} finite ones: {}",
                    guess.len(),
                    orders.parameters(),
                    orders.names().join(", ")
                ),
            ));
        }
        self.check_numbers()
    }

    /// The same for what does not depend on the orders.
    pub(super) fn check_numbers(&self) -> Result<(), Error> {
        let positive = |name: &str, value: f64| {
            if value.is_finite() && value > 0.0 {
                return Ok(());
            }
            Err(Error::argument(name, format!("{value} is not a positive number")))
        };
        positive("tolerance", self.tolerance)?;
        positive("step", self.step.c1)?;
        self.step.c2.map_or(Ok(()), |c2| positive("step", c2))
    }
}

impl Default for Search {
    fn default() -> Self {
        Self {
            algorithm: Algorithm::default(),
            max_iterations: 100,
            tolerance: 1e-8,
            step: Step::default(),
            starts: 0,
            seed: 0,
            time_limit: None,
            guess: None,
            plant_first: false,
        }
    }
}

/// When to begin nothing more; never, unless there is a limit.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Deadline(Option<Instant>);

impl Deadline {
    /// So long from now. A limit beyond the end of the clock is none.
    pub(crate) fn after(limit: Option<Duration>) -> Self {
        Self(limit.and_then(|limit| Instant::now().checked_add(limit)))
    }

    pub(crate) fn is_over(self) -> bool {
        self.0.is_some_and(|deadline| Instant::now() >= deadline)
    }
}

/// Why a search stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Stopped {
    /// The next step would lower the cost by less than the tolerance.
    Converged,
    /// No step, however short, lowers the cost further: the end of what rounding allows, or of what stability allows.
    NoDescent,
    /// The iterations were used up.
    MaxIterations,
    /// The time was used up.
    TimeLimit,
}

/// What a start led to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StartOutcome {
    /// Where it comes from, such as `steiglitz-mcbride`.
    pub name: String,
    /// The mean of e^2 there; none where it cannot be computed.
    pub cost: Option<f64>,
    /// The mean of e^2 that the search from it reached, if there was one.
    pub reached: Option<f64>,
}

/// How a search went.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SearchOutcome {
    /// How steps were chosen.
    pub algorithm: Algorithm,
    /// The relative decrease of the cost at which to stop.
    pub tolerance: f64,
    /// Iterations allowed.
    pub max_iterations: usize,
    /// The step length of steepest descent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step: Option<Step>,
    /// The seed of random starts, if there were any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Iterations done, from the start that won.
    pub iterations: usize,
    /// The mean of e^2 at the start and behind each iteration.
    pub costs: Vec<f64>,
    /// The norm of the gradient at the end, each of its entries taken as the cosine between e and a column of psi: 0 at a
    /// minimum, whatever the units.
    pub gradient_norm: f64,
    /// Why it stopped.
    pub stopped: Stopped,
    /// Whether only the stability of C and F held the search back from a lower cost.
    pub stability_bound: bool,
    /// Steps that were refused as they would have left the stable region.
    pub unstable_steps: usize,
    /// The initial conditions that were estimated.
    pub initial_conditions: usize,
    /// How many samples, in stretches spread over the log, the starts were compared and searched on before the search on all
    /// of them; none if these were all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start_samples: Option<usize>,
    /// The start that won.
    pub start: String,
    /// All starts, the best first.
    pub starts: Vec<StartOutcome>,
    /// The largest modulus of a pole that a start had outside the unit circle, before it was reflected into it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unstable_pole: Option<f64>,
    /// Whether this search was for the least errors of a free run, and the noise was found behind it.
    #[serde(default)]
    pub plant_first: bool,
}

/// Where a search is, told before each iteration. An answer of [`ControlFlow::Break`] ends the estimation with
/// [`Error::Interrupted`](crate::Error::Interrupted).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Iterations done from this start.
    pub iteration: usize,
    /// The mean of e^2.
    pub cost: f64,
}

/// Who wants to know.
pub type Monitor<'a> = &'a (dyn Fn(Progress) -> ControlFlow<()> + Sync);

/// What one search found.
#[derive(Debug, Clone)]
pub(super) struct Found {
    pub(super) parameters: Vec<f64>,
    /// Sums of e^2 at the start and behind each iteration.
    pub(super) costs: Vec<f64>,
    pub(super) gradient_norm: f64,
    pub(super) stopped: Stopped,
    pub(super) stability_bound: bool,
    pub(super) unstable_steps: usize,
}

impl Found {
    pub(super) fn cost(&self) -> f64 {
        self.costs.last().copied().unwrap_or(f64::INFINITY)
    }
}

/// Memory of a search, taken once.
#[derive(Debug)]
struct Room {
    /// The scaled matrix, its factor, and a step.
    scaled: Vec<f64>,
    factor: Vec<f64>,
    step: Vec<f64>,
    /// The step in the parameters' own units, and where it leads.
    moved: Vec<f64>,
    trial: Vec<f64>,
    scales: Vec<f64>,
    /// The scaled gradient.
    right: Vec<f64>,
    /// The Hessian of Newton's method.
    hessian: Vec<f64>,
    center: Vec<f64>,
    border: Border,
}

impl Room {
    /// The cost of the trial, with the parameters solved for that e is linear in.
    fn best_linear(&mut self, predictor: &mut impl Objective) -> Result<f64, Unusable> {
        solve_linear(predictor, &mut self.trial, &mut self.factor, &mut self.moved)
    }

    /// Scales the normal equations so that the matrix has a unit diagonal, and solves them. Gives the decrease of the cost
    /// that the solution foretells.
    fn scale(&mut self, predictor: &impl Objective) -> f64 {
        let size = self.scales.len();
        for (index, scale) in self.scales.iter_mut().enumerate() {
            let diagonal = predictor.matrix()[index * size + index];
            // A column of zeros stays one.
            *scale = if diagonal > 0.0 { diagonal.sqrt() } else { 1.0 };
            self.right[index] = predictor.right()[index] / *scale;
        }
        for row in 0..size {
            for column in 0..size {
                self.scaled[row * size + column] =
                    predictor.matrix()[row * size + column] / self.scales[row] / self.scales[column];
            }
        }
        self.solve_damped(SMALLEST_DAMPING);
        self.step.iter().zip(&self.right).map(|(step, right)| step * right).sum()
    }

    /// `(G + damping I) step = g`.
    fn solve_damped(&mut self, damping: f64) {
        let size = self.scales.len();
        self.factor.copy_from_slice(&self.scaled);
        (0..size).for_each(|index| self.factor[index * size + index] += damping);
        normal::factor(&mut self.factor, size);
        self.step.copy_from_slice(&self.right);
        normal::solve(&self.factor, size, &mut self.step);
    }

    /// `(H + damping I) step = g` with the least damping, in tenfold steps, that makes the matrix positive definite.
    ///
    /// H comes from central differences of g, one-sided ones beside the border of stability: 2 p linearizations.
    fn newton_step(&mut self, predictor: &mut impl Objective, parameters: &[f64], cost: f64) {
        let size = self.scales.len();
        self.center.copy_from_slice(predictor.right());
        for column in 0..size {
            // A change of sqrt(cost)/scale changes the errors by their own size.
            let apart = DIFFERENCE * (parameters[column].abs() + 100.0 * cost.sqrt() / self.scales[column]);
            let mut width = 0.0;
            (0..size).for_each(|row| self.hessian[row * size + column] = 0.0);
            for side in [-1.0, 1.0] {
                self.trial.copy_from_slice(parameters);
                self.trial[column] += side * apart;
                predictor.keep_free();
                let usable = predictor.evaluate(&self.trial).is_ok();
                if usable {
                    predictor.linearize();
                    width += apart;
                }
                // g is minus half the gradient.
                let gradient = if usable { predictor.right() } else { &self.center };
                for (row, value) in gradient.iter().enumerate() {
                    self.hessian[row * size + column] -= side * value;
                }
            }
            let width = if width > 0.0 { width } else { 1.0 };
            for row in 0..size {
                self.hessian[row * size + column] /= width * self.scales[row] * self.scales[column];
            }
        }
        predictor.keep_free();
        // The signals of the current point again, which has a cost.
        let _ = predictor.evaluate(parameters);
        predictor.linearize();
        let mut damping = 0.0;
        loop {
            for row in 0..size {
                for column in 0..size {
                    let (one, other) = (self.hessian[row * size + column], self.hessian[column * size + row]);
                    self.factor[row * size + column] = f64::midpoint(one, other);
                }
                self.factor[row * size + row] += damping;
            }
            if normal::factor(&mut self.factor, size) == 0 || damping > LARGEST_DAMPING {
                break;
            }
            damping = (damping * 10.0).max(FIRST_PERTURBATION);
        }
        self.step.copy_from_slice(&self.right);
        normal::solve(&self.factor, size, &mut self.step);
    }

    /// Where a fraction of the step leads, and the decrease of the cost that it foretells: 2 g's - s'G s.
    fn apply(&mut self, parameters: &[f64], fraction: f64) -> f64 {
        let size = self.scales.len();
        let mut foretold = 0.0;
        for (row, parameter) in parameters.iter().enumerate() {
            let step = fraction * self.step[row];
            self.moved[row] = step / self.scales[row];
            self.trial[row] = parameter + self.moved[row];
            let curved = self.scaled[row * size..][..size].iter().zip(&self.step);
            foretold += step * (2.0 * self.right[row] - fraction * curved.map(|(g, s)| g * s).sum::<f64>());
        }
        foretold
    }
}

/// How the steps of an iteration are made from its normal equations.
enum Rule {
    Damped,
    Halved,
}

/// Searches from `start` for the parameters of the least cost.
///
/// The predictor is left at the parameters found. `smallest` is a sum of squares that is nothing.
///
/// # Errors
/// [`Error::Interrupted`]; the [`Unusable`] of a start that has no cost.
pub(super) fn search(
    predictor: &mut impl Objective,
    start: &[f64],
    search: &Search,
    smallest: f64,
    deadline: Deadline,
    monitor: Monitor<'_>,
) -> Result<Result<Found, Unusable>, Error> {
    let size = start.len();
    let square = || vec![0.0; size * size];
    let line = || vec![0.0; size];
    let newton = search.algorithm == Algorithm::Newton;
    let mut room = Room {
        scaled: square(),
        factor: square(),
        step: line(),
        moved: line(),
        trial: line(),
        scales: line(),
        right: line(),
        hessian: if newton { square() } else { Vec::new() },
        center: line(),
        border: Border::new(predictor.orders(), predictor.needs_stable_a()),
    };
    let mut parameters = start.to_vec();
    let mut cost = match best_free(predictor, &parameters) {
        Ok(cost) => cost,
        Err(unusable) => return Ok(Err(unusable)),
    };
    // Room for all of them, unless these are more than anybody waits for.
    let mut costs = Vec::with_capacity(search.max_iterations.min(MOST_ITERATIONS) + 1);
    costs.push(cost);
    let mut damping = FIRST_DAMPING;
    let mut unstable_steps = 0;
    let mut stability_bound = false;
    let mut drawn_in = 0;
    let samples = predictor.samples() as f64;
    let mut gradient_norm;
    let stopped = loop {
        let iteration = costs.len() - 1;
        if monitor(Progress { iteration, cost: cost / samples }).is_break() {
            return Err(Error::Interrupted);
        }
        // The free responses alone can lower the cost by so much.
        let free_gain = predictor.linearize();
        let foretold = room.scale(predictor) + free_gain;
        gradient_norm = (room.right.iter().map(|value| value * value).sum::<f64>() / cost).sqrt();
        if cost <= smallest || foretold <= search.tolerance * cost {
            gradient_norm = if cost <= smallest { 0.0 } else { gradient_norm };
            if cost > smallest && foretold > WORTH_TAKING * search.tolerance * cost {
                // The step is there: where convergence is slow, it is a good part of the way that is left.
                room.apply(&parameters, 1.0);
                predictor.try_free(&room.moved);
                match predictor.evaluate(&room.trial) {
                    Ok(value) if value < cost => {
                        parameters.copy_from_slice(&room.trial);
                        costs.push(value);
                    }
                    _ => {
                        predictor.keep_free();
                        let _ = predictor.evaluate(&parameters);
                    }
                }
            }
            break Stopped::Converged;
        }
        if iteration >= search.max_iterations {
            break Stopped::MaxIterations;
        }
        if deadline.is_over() {
            break Stopped::TimeLimit;
        }
        let rule = match search.algorithm {
            Algorithm::LevenbergMarquardt => Rule::Damped,
            // The step is there already.
            Algorithm::GaussNewton => Rule::Halved,
            Algorithm::Newton => {
                room.newton_step(predictor, &parameters, cost);
                Rule::Halved
            }
            Algorithm::Gradient => {
                let length = search.step.at(iteration);
                room.step.iter_mut().zip(&room.right).for_each(|(step, right)| *step = length * right);
                Rule::Halved
            }
        };
        let mut refused_unstable = false;
        let mut fraction = 1.0;
        let mut tries = 0;
        let accepted = loop {
            if matches!(rule, Rule::Damped) && (tries == 0 || tries > SHORTER) {
                room.solve_damped(damping);
            }
            let expected = room.apply(&parameters, fraction) + free_gain;
            predictor.try_free(&room.moved);
            match predictor.evaluate(&room.trial) {
                Ok(value) if value < cost => break Some((value, expected)),
                Ok(_) | Err(Unusable::Overflow) => {}
                Err(Unusable::Unstable) => {
                    refused_unstable = true;
                    unstable_steps += 1;
                    if tries == 0 && drawn_in < DRAWN_IN && room.border.draw_in(&parameters, &mut room.trial)
                    {
                        let value = room.best_linear(predictor);
                        if let Ok(value) = value
                            && value < cost
                        {
                            break Some((value, f64::INFINITY));
                        }
                        drawn_in += 1;
                        cost = best_free(predictor, &parameters).unwrap_or(cost);
                        predictor.linearize();
                    }
                }
            }
            tries += 1;
            if matches!(rule, Rule::Damped) && tries > SHORTER {
                fraction = 1.0;
                damping = (damping * 10.0).max(FIRST_DAMPING);
            } else {
                fraction /= 2.0;
            }
            let exhausted = match rule {
                Rule::Damped => damping > LARGEST_DAMPING,
                Rule::Halved => tries >= HALVINGS,
            };
            if exhausted {
                break None;
            }
        };
        let Some((value, expected)) = accepted else {
            stability_bound = refused_unstable;
            // Back to where the search stands.
            predictor.keep_free();
            let _ = predictor.evaluate(&parameters);
            let rounding = foretold <= ROUNDING * cost;
            break if rounding && !stability_bound { Stopped::Converged } else { Stopped::NoDescent };
        };
        if cost - value > 0.75 * expected {
            damping = (damping / 10.0).max(SMALLEST_DAMPING);
        } else if cost - value > 0.25 * expected {
            damping = (damping / 3.0).max(SMALLEST_DAMPING);
        }
        stability_bound = refused_unstable;
        parameters.copy_from_slice(&room.trial);
        let fall = cost - value;
        cost = value;
        costs.push(cost);
        if expected == f64::INFINITY && fall <= search.tolerance * cost {
            break Stopped::NoDescent;
        }
        // What is left to gain is lost in rounding, and so is what a step gains.
        if foretold <= ROUNDING * cost && fall < 0.1 * expected {
            break Stopped::Converged;
        }
    };
    Ok(Ok(Found { parameters, costs, gradient_norm, stopped, stability_bound, unstable_steps }))
}

/// The cost of parameters with the free responses that are best for them.
pub(super) fn best_free(predictor: &mut impl Objective, parameters: &[f64]) -> Result<f64, Unusable> {
    predictor.restart();
    let cost = predictor.evaluate(parameters)?;
    if predictor.initial_conditions() == 0 {
        return Ok(cost);
    }
    predictor.linearize();
    predictor.try_free(&[]);
    // Exact, as they enter linearly.
    predictor.evaluate(parameters)
}

/// The same with the parameters solved for that e is linear in where the others are given. Writes them into `parameters`.
pub(super) fn best_linear(predictor: &mut impl Objective, parameters: &mut [f64]) -> Result<f64, Unusable> {
    let size = parameters.len();
    solve_linear(predictor, parameters, &mut vec![0.0; size * size], &mut vec![0.0; size])
}

/// The same in memory for a matrix and a step.
fn solve_linear(
    predictor: &mut impl Objective,
    parameters: &mut [f64],
    matrix: &mut [f64],
    step: &mut [f64],
) -> Result<f64, Unusable> {
    best_free(predictor, parameters)?;
    predictor.linearize();
    let (size, linear) = (parameters.len(), predictor.linear());
    let count = linear.len();
    let matrix = &mut matrix[..count * count];
    let whole = predictor.matrix().chunks_exact(size).skip(linear.start);
    for (own, whole) in matrix.chunks_exact_mut(count.max(1)).zip(whole) {
        own.copy_from_slice(&whole[linear.clone()]);
    }
    step.fill(0.0);
    step[linear.clone()].copy_from_slice(&predictor.right()[linear.clone()]);
    normal::factor(matrix, count);
    normal::solve(matrix, count, &mut step[linear]);
    parameters.iter_mut().zip(&*step).for_each(|(value, step)| *value += step);
    predictor.try_free(step);
    predictor.evaluate(parameters)
}

impl Step {
    fn at(&self, iteration: usize) -> f64 {
        self.c2.map_or(self.c1, |c2| self.c1 / (c2 + iteration as f64))
    }
}
