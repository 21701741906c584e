//! The least largest error, or the least sum of absolute errors, for every structure: by a sequence of linear programs.
//!
//! ```text
//! V(x) = max |e(t, x)|   or   sum |e(t, x)|,   x = (theta, initial conditions)
//! ```
//!
//! Around x the errors are e - psi's for a step s, and V of these is least, among short steps, at the optimum of a
//! linear program (Madsen, An algorithm for minimax solution of overdetermined systems of non-linear equations, Journal
//! of the Institute of Mathematics and its Applications 16 (1975); Osborne and Watson, An algorithm for minimax
//! approximation in the nonlinear case, Computer Journal 12 (1969); for sums, On an algorithm for discrete nonlinear L1
//! approximation, Computer Journal 14 (1971)):
//!
//! ```text
//! m(D) = V(x) - min V(e - psi's)   over s = S w, |w_i| <= D,   S = rms(e) sqrt(N) R^-1,   psi = Q R
//! ```
//!
//! A step that leads less low than promised is corrected: the errors there take the place of the linearised ones, and
//! the program is solved again (Fletcher, Second order corrections for non-differentiable optimization, Lecture Notes
//! in Mathematics 912, 1982). A step is taken if V falls by a part of m(D); D is halved where it falls by much less,
//! and doubled where it falls as promised and D was in the way. m is concave in D, so that m(D)/min(D, 1) bounds what
//! any step of up to D = 1 promises: where it is below the tolerance times V, no small step lowers V to first order,
//! and the search has converged. With as many errors of the largest size as there are unknowns, and one more, it does
//! so quadratically, as Newton's method.
//!
//! C and each F are searched for in the coordinates of [`reflection`](super::reflection), in which stability has no
//! boundary. They move by up to two, or two D if that is less.
//!
//! It starts from the least squares estimate. Memory: psi, N numbers for each unknown. Cost of an iteration: O(N p^2),
//! and programs of some 10 p rows, or of some (N p)^(2/3) for the sum.

use thetahat_core::nalgebra::DVector;
use thetahat_numerics::optimize::{Deadline, Monitor, Objective, Progress, Search, Stopped, best_free};
use thetahat_numerics::regression::Unsolved;
use thetahat_numerics::regression::convex::{Fitting, Limit, peak};

use super::criterion::{ConvexFit, ConvexOutcome, Norm};
use super::outcome::ProgramsOutcome;
use super::prediction_error::{prediction_error, predictor_of};
use super::predictor::Predictor;
use super::thinning::energy;
use super::{Estimate, Initial, Procedure};
use crate::Error;
use crate::data::Record;
use crate::model::Orders;
use crate::respond::NOTHING_LEFT;

/// A step is taken if V falls by this part of what was promised.
const TAKEN: f64 = 1e-3;
/// So often a step is corrected.
const CORRECTIONS: usize = 3;
/// D is halved below the first of these parts, and doubled above the second.
const POOR: f64 = 0.25;
const GOOD: f64 = 0.75;
/// Below this D no step is long enough to change V by more than rounding.
const SHORTEST: f64 = 1e-10;
/// The same for a sum, whose programs take longer and begin where a search has ended; and it has converged where a step
/// is to lower it, or has lowered it, by less than this part, far below what its own uncertainty is.
const SHORTEST_OF_SUMS: f64 = 1e-4;
const ENOUGH_OF_SUMS: f64 = 1e-5;
/// How far a coordinate of C or F moves in a step for D = 1, and how far it goes at all.
const LONGEST: f64 = 2.0;
const FARTHEST: f64 = 12.0;
/// A promise below this part of V is rounding.
const ROUNDING: f64 = 1e-12;

/// Where a sequence of linear programs ended.
pub(super) struct Least {
    pub(super) parameters: Vec<f64>,
    /// V at the start and after each iteration.
    costs: Vec<f64>,
    promise: f64,
    stopped: Stopped,
    /// Steps of the interior point method.
    steps: u32,
}

/// The error of parameters whose errors overflow.
pub(super) fn unusable(orders: &Orders) -> Error {
    Error::undetermined(
        orders.names(),
        "the errors overflow; scale the channels towards one, or lower the orders",
    )
}

/// Fits a model that is not linear in its parameters with the least largest error.
pub(super) fn minimax(
    record: &Record<'_>,
    orders: &Orders,
    initial: Initial,
    criterion: &ConvexFit,
    monitor: Monitor<'_>,
) -> Result<Estimate, Error> {
    let demanded = criterion.ridge != 0.0
        || !(criterion.bounds.is_empty() && criterion.dc_gain.is_empty())
        || criterion.noise_bound.is_some();
    if demanded || criterion.norm != Norm::Infinity {
        return Err(Error::argument(
            "method",
            "bounds, ridges and gains are for models without C, D and F; for these there is the norm inf alone, and robust \
             losses",
        ));
    }
    let options = &criterion.search;
    let deadline = Deadline::after(options.time_limit);
    let squares = prediction_error(record, orders, initial, options, monitor)?;
    let mut predictor = predictor_of(record, orders, &squares);
    best_free(&mut predictor, squares.parameters()).map_err(|_| unusable(orders))?;
    let nothing = (NOTHING_LEFT * energy(record)).sqrt();
    let at = squares.parameters();
    let least = least(&mut predictor, at, Norm::Infinity, nothing, options, deadline, monitor)?;
    let (errors, _) = predictor.residuals();
    let samples = predictor.samples();
    let sum_of_squares: f64 = errors.iter().map(|e| e * e).sum();
    let taken = orders.parameters() + predictor.initial_conditions();
    let Procedure::PredictionError(least_squares) = squares.procedure() else { return Ok(squares) };
    let outcome = ConvexOutcome {
        iterations: least.steps,
        search: Some(ProgramsOutcome {
            promise: least.promise,
            stopped: least.stopped,
            initial_conditions: predictor.initial_conditions(),
            least_squares: least_squares.clone(),
            costs: least.costs,
        }),
        ..criterion.outcome(peak(&errors))
    };
    Ok(Estimate {
        parameters: least.parameters,
        covariance: None,
        noise_variance: sum_of_squares / (samples - taken) as f64,
        samples,
        mse: sum_of_squares / samples as f64,
        condition: squares.condition(),
        initial: squares.initial(),
        procedure: Procedure::Constrained(outcome),
    })
}

/// The least of a norm, 1 or inf, from where the predictor is on, unless errors of a size of `nothing` reach it; the
/// predictor stands at the end afterwards.
pub(super) fn least(
    predictor: &mut Predictor<'_>,
    at: &[f64],
    norm: Norm,
    nothing: f64,
    options: &Search,
    deadline: Deadline,
    monitor: Monitor<'_>,
) -> Result<Least, Error> {
    let size = |errors: &[f64]| match norm {
        Norm::Infinity => peak(errors),
        Norm::One | Norm::Two => errors.iter().map(|e| e.abs()).sum(),
    };
    let (shortest, enough) = match norm {
        Norm::Infinity => (SHORTEST, 0.0),
        Norm::One | Norm::Two => (SHORTEST_OF_SUMS, ENOUGH_OF_SUMS),
    };
    let mut now = Point::new(predictor, at);
    let mut cost = size(&now.errors);
    let (mut costs, mut promise, mut steps, mut radius) = (vec![cost], 0.0, 0, 1.0);
    let stopped = 'search: loop {
        if peak(&now.errors) <= nothing {
            promise = 0.0;
            break Stopped::Converged;
        }
        if costs.len() > options.max_iterations {
            break Stopped::MaxIterations;
        }
        if deadline.is_over() {
            break Stopped::TimeLimit;
        }
        let shown = if norm == Norm::Infinity { cost } else { cost / now.errors.len() as f64 };
        if monitor(Progress { iteration: costs.len() - 1, cost: shown, models: None }).is_break() {
            return Err(Error::Interrupted);
        }
        let Some(slopes) = now.slopes(predictor) else { break Stopped::NoDescent };
        loop {
            if radius < shortest {
                break 'search Stopped::NoDescent;
            }
            let Some(mut step) = slopes.step(&now, &now.errors, norm, radius) else {
                radius /= 4.0;
                continue;
            };
            steps += step.iterations;
            let mut linear = slopes.linear(&now, &step);
            let promised = cost - size(&linear);
            promise = promised.max(0.0) / cost / f64::min(radius, 1.0);
            if promise <= options.tolerance.max(ROUNDING) {
                break 'search Stopped::Converged;
            }
            let mut reached = now.moved(predictor, &step);
            let part = |reached: &Option<Point>| {
                reached.as_ref().map_or(f64::NEG_INFINITY, |reached| cost - size(&reached.errors)) / promised
            };
            let mut fell = part(&reached);
            for _ in 0..CORRECTIONS {
                let Some(there) = reached.as_ref().filter(|_| fell < GOOD) else { break };
                // Around the errors that the step led to, with the slopes of where it began.
                let errors = now.errors.iter().zip(&there.errors).zip(&linear);
                let target: Vec<f64> = errors.map(|((here, there), linear)| here + there - linear).collect();
                let Some(next) = slopes.step(&now, &target, norm, radius) else { break };
                steps += next.iterations;
                let corrected = now.moved(predictor, &next);
                let better = part(&corrected);
                if better <= fell {
                    break;
                }
                linear = slopes.linear(&now, &next);
                (step, reached, fell) = (next, corrected, better);
            }
            if fell < TAKEN {
                radius /= 4.0;
            } else if fell < POOR {
                radius /= 2.0;
            } else if fell > GOOD && step.reaches {
                radius *= 2.0;
            }
            if let Some(reached) = reached.filter(|_| fell > TAKEN) {
                now = reached;
                cost = size(&now.errors);
                costs.push(cost);
                if fell * promised < enough * cost {
                    break 'search Stopped::Converged;
                }
                break;
            }
        }
    };
    predictor.set_free(&now.weights);
    predictor
        .evaluate(&now.parameters)
        .map_err(|_| Error::data("the errors overflow; scale the channels towards one"))?;
    Ok(Least { parameters: now.parameters, costs, promise, stopped, steps })
}

/// Where a search stands.
struct Point {
    parameters: Vec<f64>,
    /// Of the parameters; these themselves where a polynomial is not stable.
    coordinates: Vec<f64>,
    /// Whether these are others than the parameters.
    own: bool,
    /// Of the initial-condition responses.
    weights: Vec<f64>,
    errors: Vec<f64>,
}

impl Point {
    /// Where the predictor was evaluated last.
    fn new(predictor: &mut Predictor<'_>, parameters: &[f64]) -> Self {
        let mut coordinates = parameters.to_vec();
        let own = predictor.coordinates(parameters, &mut coordinates);
        if !own {
            coordinates.copy_from_slice(parameters);
        }
        let (weights, (errors, _)) = (predictor.free_weights(), predictor.residuals());
        Self { parameters: parameters.to_vec(), coordinates, own, weights, errors }
    }

    /// psi with respect to the coordinates and the weights, at this point; none if its squares overflow.
    fn slopes(&self, predictor: &mut Predictor<'_>) -> Option<Slopes> {
        predictor.linearize();
        let mut columns = predictor.all_columns();
        let size = self.parameters.len();
        let curved: Vec<usize> = (0..size).filter(|place| self.own && predictor.is_curved(*place)).collect();
        if self.own {
            let (mut parameters, mut slopes) = (vec![0.0; size], vec![0.0; size * size]);
            predictor.parameters(&self.coordinates, &mut parameters, Some(&mut slopes));
            let of = |place: usize| {
                let mut column = vec![0.0; self.errors.len()];
                for (row, own) in columns[..size].iter().enumerate() {
                    let slope = slopes[row * size + place];
                    if slope != 0.0 {
                        column.iter_mut().zip(own).for_each(|(value, own)| *value += slope * own);
                    }
                }
                column
            };
            let of_curved: Vec<Vec<f64>> = curved.iter().map(|&place| of(place)).collect();
            for (&place, column) in curved.iter().zip(of_curved) {
                columns[place] = column;
            }
        }
        let mut slopes = Slopes { places: (0..columns.len()).collect(), columns, curved };
        // What depends on others stays as it is.
        while let Err(unsolved) = Fitting::of_columns(&self.errors, &slopes.columns, &[]) {
            let Unsolved::Deficient(dependent) = unsolved else { return None };
            for column in dependent.into_iter().rev() {
                slopes.columns.remove(column);
                slopes.places.remove(column);
            }
        }
        (!slopes.columns.is_empty()).then_some(slopes)
    }

    /// The point after a step of the coordinates and the weights; none where errors overflow, or a polynomial is not
    /// stable.
    fn moved(&self, predictor: &mut Predictor<'_>, step: &Step) -> Option<Self> {
        let size = self.parameters.len();
        let next = self.coordinates.iter().chain(&self.weights).zip(&step.moves).map(|(at, step)| at + step);
        let mut coordinates: Vec<f64> = next.collect();
        let weights = coordinates.split_off(size);
        let mut parameters = coordinates.clone();
        if self.own {
            predictor.parameters(&coordinates, &mut parameters, None);
        }
        predictor.set_free(&weights);
        predictor.evaluate(&parameters).ok()?;
        Some(Self { parameters, coordinates, own: self.own, weights, errors: predictor.residuals().0 })
    }
}

/// psi at a point.
struct Slopes {
    columns: Vec<Vec<f64>>,
    /// Of each column the place of its coordinate or weight.
    places: Vec<usize>,
    /// The coordinates that are no parameters.
    curved: Vec<usize>,
}

/// A step to the optimum of a linear program.
struct Step {
    /// Of all coordinates and weights.
    moves: Vec<f64>,
    /// Whether it goes as far as it may.
    reaches: bool,
    /// Of the interior point method.
    iterations: u32,
}

impl Slopes {
    /// The step for which `target` less psi's is smallest; none where the program is not solved.
    fn step(&self, from: &Point, target: &[f64], norm: Norm, radius: f64) -> Option<Step> {
        let longest = LONGEST * radius.min(1.0);
        let curved = self.places.iter().enumerate().filter(|(_, place)| self.curved.contains(place));
        let limit = |(column, &place): (usize, &usize)| {
            let mut coefficients = DVector::zeros(self.columns.len());
            coefficients[column] = 1.0;
            let at = from.coordinates[place];
            let step = |step: f64| (at + step).clamp(-FARTHEST, FARTHEST) - at;
            Limit { coefficients, low: step(-longest).min(0.0), high: step(longest).max(0.0) }
        };
        let limits: Vec<Limit> = curved.map(limit).collect();
        let fitting = Fitting::of_columns(target, &self.columns, &limits).ok()?;
        let solved = fitting.step(norm, radius).ok()?;
        let mut moves = vec![0.0; from.coordinates.len() + from.weights.len()];
        self.places.iter().zip(&solved.parameters).for_each(|(&place, step)| moves[place] = *step);
        Some(Step {
            reaches: fitting.reaches(&solved.parameters, radius),
            iterations: solved.iterations,
            moves,
        })
    }

    /// The linearised errors after a step.
    fn linear(&self, from: &Point, step: &Step) -> Vec<f64> {
        let mut linear = from.errors.clone();
        for (column, &place) in self.columns.iter().zip(&self.places) {
            linear.iter_mut().zip(column).for_each(|(e, psi)| *e -= psi * step.moves[place]);
        }
        linear
    }
}

#[cfg(test)]
mod tests;
