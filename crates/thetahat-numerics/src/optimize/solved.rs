//! What is solved for at once: free responses, and parameters that errors are linear in.

use super::normal;
use super::objective::Objective;

/// The cost of parameters with the free responses that are best for them.
pub fn best_free<O: Objective>(objective: &mut O, parameters: &[f64]) -> Result<f64, O::Refusal> {
    objective.restart();
    let cost = objective.evaluate(parameters)?;
    if objective.initial_conditions() == 0 {
        return Ok(cost);
    }
    objective.linearize()?;
    objective.try_free(&[]);
    // Exact, as they enter linearly.
    objective.evaluate(parameters)
}

/// The same with the parameters solved for that e is linear in where the others are given. Writes them into
/// `parameters`.
pub fn best_linear<O: Objective>(objective: &mut O, parameters: &mut [f64]) -> Result<f64, O::Refusal> {
    let size = parameters.len();
    solve_linear(objective, parameters, &mut vec![0.0; size * size], &mut vec![0.0; size])
}

/// The same in memory for a matrix and a step.
pub(super) fn solve_linear<O: Objective>(
    objective: &mut O,
    parameters: &mut [f64],
    matrix: &mut [f64],
    step: &mut [f64],
) -> Result<f64, O::Refusal> {
    best_free(objective, parameters)?;
    solve_linear_here(objective, parameters, matrix, step)
}

/// The same where the parameters have been evaluated, with any free responses.
pub(super) fn solve_linear_here<O: Objective>(
    objective: &mut O,
    parameters: &mut [f64],
    matrix: &mut [f64],
    step: &mut [f64],
) -> Result<f64, O::Refusal> {
    let linear = objective.linear();
    let count = linear.len();
    let matrix = &mut matrix[..count * count];
    step.fill(0.0);
    objective.linear_equations(matrix, &mut step[linear.clone()])?;
    normal::factor(matrix, count);
    normal::solve(matrix, count, &mut step[linear]);
    parameters.iter_mut().zip(&*step).for_each(|(value, step)| *value += step);
    objective.try_free(step);
    objective.evaluate(parameters)
}

/// By how much a full Gauss-Newton step from what was evaluated last would lower the cost, to first order; none where
/// there are no normal equations.
pub fn predicted_decrease<O: Objective>(objective: &mut O) -> f64 {
    let Ok(free_gain) = objective.linearize() else { return 0.0 };
    let (mut factor, mut step) = (objective.matrix().to_vec(), objective.right().to_vec());
    let size = step.len();
    normal::factor(&mut factor, size);
    normal::solve(&factor, size, &mut step);
    free_gain + step.iter().zip(objective.right()).map(|(step, right)| step * right).sum::<f64>()
}
